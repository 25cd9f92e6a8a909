"""The command line ``ptcc``: parses, calls, prints.

Exit codes: 0 proved and everything asked holds; 1 a bound is violated, or a certificate rejected; 2 bad input or
usage; 3 an expectation is refuted; 4 undecided; 70 an error of this program. Data go to standard output, everything
else to standard error.

Modules are named after their commands. :mod:`~ptcc_certify.cli.options` are those that several share, and what becomes
of them; :mod:`~ptcc_certify.cli.terminal` prints.
"""

from __future__ import annotations

import io
import sys

import click

from ptcc_certify.cli import batch, certify, check_and_report, classify, design, examples_and_cite, explore, simulate
from ptcc_certify.errors import ExitCode, PTCCError, explain, one_line

__all__ = ["cli", "main"]

_NO_ARGUMENTS = getattr(click.exceptions, "NoArgsIsHelpError", ())  # its message is the help; new in click 8.2


class _InOrder(click.Group):
    """Commands in the order of their use, as they are added below."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(self.commands)


@click.group(cls=_InOrder, context_settings={"help_option_names": ["-h", "--help"], "show_default": True})
@click.version_option(package_name="ptcc-certify", prog_name="ptcc")
def cli() -> None:
    """Certify prescribed-time coordination control on signed digraphs.

    GRAPH is a file, - for standard input, or the name of a packaged graph (fig1a, fig1b, fig3a, fig3b, fig5a, fig5b).
    """


for command in (
    classify.classify,
    certify.certify,
    check_and_report.check,
    check_and_report.report,
    simulate.simulate,
    design.design,
    explore.explore,
    examples_and_cite.examples,
    batch.batch,
    examples_and_cite.cite,
):
    cli.add_command(command)


def main() -> None:
    """Run ``ptcc`` and exit with its code; every refusal is one line on standard error."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # a label that the terminal cannot show stops nothing
    try:
        code = cli.main(prog_name="ptcc", standalone_mode=False)
    except click.ClickException as error:
        if isinstance(error, _NO_ARGUMENTS):
            click.echo(error.format_message(), err=True)
            code = ExitCode.BAD_INPUT
        else:
            code = _refuse(error.format_message())
    except (PTCCError, OverflowError, MemoryError) as error:
        code = _refuse(explain(error))
    except (KeyboardInterrupt, click.Abort):
        click.echo("ptcc: interrupted", err=True)
        code = ExitCode.INTERRUPTED
    except BrokenPipeError:
        code = ExitCode.OK
        sys.stderr.close()
    except OSError as error:
        code = _refuse(f"the result cannot be written ({error.strerror or error})")
    except Exception as error:
        click.echo(f"ptcc: {explain(error)}", err=True)
        code = ExitCode.INTERNAL_ERROR
    sys.exit(code if isinstance(code, int) else ExitCode.OK)


def _refuse(message: str) -> int:
    click.echo(f"ptcc: {one_line(message)}", err=True)
    return ExitCode.BAD_INPUT
