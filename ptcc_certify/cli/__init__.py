"""The command line ``ptcc``: parses, calls, prints.

Exit codes: 0 proved and everything asked holds; 1 a bound is violated, or a certificate rejected; 2 bad input or
usage; 3 an expectation is refuted; 4 undecided; 70 an error of this program; 130 Ctrl-C; 141 who reads the output has
gone. Data go to standard output, everything else to standard error.

Modules are named after their commands. :mod:`~ptcc_certify.cli.options` are those that several share, and what becomes
of them; :mod:`~ptcc_certify.cli.terminal` prints.
"""

from __future__ import annotations

import io
import os
import re
import sys
from typing import Any

import click

from ptcc_certify.cli import (
    animate,
    balance,
    batch,
    certify,
    check_and_report,
    classify,
    compare,
    design,
    edit,
    examples_and_cite,
    explore,
    influence,
    new,
    opinions,
    plot,
    simulate,
)
from ptcc_certify.cli.options import with_flags
from ptcc_certify.cli.scenario import MEMORY, placed
from ptcc_certify.errors import ExitCode, ParameterError, PTCCError, did_you_mean, explain, one_line
from ptcc_certify.graphs.rationals import shorten

__all__ = ["cli", "main"]

_NO_ARGUMENTS = getattr(click.exceptions, "NoArgsIsHelpError", ())  # its message is the help; new in click 8.2


#: What is no command, and where it is told.
_TOLD = {"why": "; the line why of classify and certify tells the counterexample of a family"}
#: What design calls options of other commands.
_OF_DESIGN = {"--T": "--deadline", "--x0": "--initial-bound", "--seed": "--initial-bound"}
#: What the deadline is called elsewhere.
_DEADLINE = ("--deadline", "-T")
#: What errors of what is heard are called elsewhere.
_ERRORS = ("--error", "--errors", "--value-error", "--message-error")


#: The commands, and what the help says of each, in this order.
GROUPS: dict[str, dict[click.Command, str]] = {
    "Ask about a graph": {
        classify.classify: "Tell its structure and the theorem that applies.",
        certify.certify: "Prove what the protocol does on it; write a certificate.",
        influence.influence: "Tell who decides where everybody ends.",
        opinions.opinions: "Tell what becomes of opinions in steps of time.",
        balance.balance: "Tell how far from balance it is, and which edges spoil it.",
        simulate.simulate: "Run the protocol: a table, or a figure of the states.",
        compare.compare: "Compare it with protocols that have no deadline.",
        design.design: "Find gains and a deadline that keep the input within limits.",
        batch.batch: "Certify many graphs: one table.",
    },
    "Certificates": {
        check_and_report.check: "Check a certificate exactly, without a solver.",
        check_and_report.report: "Write a page, or LaTeX, to send to somebody.",
        plot.plot: "Draw a figure of a certificate or a graph.",
        animate.animate: "Make a film of a certificate.",
    },
    "Set up and learn": {
        edit.edit: "Write a graph without some nodes or edges.",
        new.new: "Write a commented scenario file to begin with.",
        examples_and_cite.examples: "Run the paper's examples, figures included.",
        explore.explore: "Try graph, deadline and gains in a browser.",
        examples_and_cite.cite: "Print BibTeX of the theorem used.",
    },
}


class _Commands(click.Group):
    """Commands in groups, each with one plain line; near names of one that is not there."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        if args and re.fullmatch("-[vq]*h[vq]*", args[0]):  # flags of commands beside -h
            args = ["-h"]
        return super().parse_args(ctx, args)

    def list_commands(self, ctx: click.Context) -> list[str]:
        return [name for group in GROUPS.values() for command in group if (name := command.name)]

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        for title, group in GROUPS.items():
            with formatter.section(title):
                formatter.write_dl([(command.name or "", text) for command, text in group.items()])

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        if not args[0].startswith("-") and args[0] not in self.commands:
            hint = _TOLD.get(args[0]) or did_you_mean(args[0], self.commands) or "; ptcc --help lists the commands"
            raise click.UsageError(f'there is no command "{shorten(args[0])}"{hint}', ctx)
        return super().resolve_command(ctx, args)

    def invoke(self, ctx: click.Context) -> Any:
        try:
            return super().invoke(ctx)
        except ParameterError as error:
            command = self.commands[ctx.invoked_subcommand or ""]
            raise placed(ctx, error) if MEMORY in ctx.meta else with_flags(command, error) from None
        except (PTCCError, click.BadParameter) as error:
            raise placed(ctx, error) from None
        except click.NoSuchOption as error:
            flag, others = error.option_name, self.commands.items()
            unknown = f"No such option '{flag}'"  # click's own sentence differs from version to version
            if files := [word for word in sys.argv[1:] if word[:1] == "-" and os.path.exists(word)]:  # noqa: PTH110
                raise click.UsageError(f"{unknown}. A file of this name is written ./{files[0]}") from None
            if ctx.invoked_subcommand == "design" and flag in _OF_DESIGN:
                raise click.UsageError(f"{unknown}; here it is {_OF_DESIGN[flag]}") from None
            flags = {told for p in self.commands[ctx.invoked_subcommand or ""].params for told in p.opts}
            if flag in _ERRORS and "--quantisation" in flags:
                mend = "what is heard is rounded by --quantisation STEP, disturbed by --noise NU"
                raise click.UsageError(f"{unknown}; {mend}") from None
            if flag in _DEADLINE and "--T" in flags:
                raise click.UsageError(f"{unknown}. Did you mean --T?") from None
            if not (having := [f"ptcc {name}" for name, c in others if any(flag in p.opts for p in c.params)]):
                options = [p for p in error.possibilities or () if did_you_mean(flag.lstrip("-"), [p.lstrip("-")])]
                hint = f" Did you mean {' or '.join(options)}?" if options else ""  # click's counts the dashes as alike
                raise click.UsageError(f"{unknown}.{hint}") from None
            message = f"{unknown}. It is an option of {', '.join(having)}"
            if ctx.invoked_subcommand == "batch":
                message += f"; of many graphs certify each: ptcc certify GRAPH {flag}"
            elif ctx.invoked_subcommand == "design" and "ptcc certify" in having:
                message += f"; certify the gains that are found with it: ptcc certify GRAPH {flag}"
            raise click.UsageError(message) from None


@click.group(cls=_Commands, context_settings={"help_option_names": ["-h", "--help"], "show_default": True})
@click.version_option(package_name="ptcc-certify", prog_name="ptcc")
def cli() -> None:
    """Certify prescribed-time coordination control on signed digraphs.

    GRAPH is a file (a table source,target,weight, or any common format of graphs), - for standard input, or the name
    of a packaged graph: fig1a, fig1b, fig3a, fig3b, fig5a, fig5b, highland_tribes. A scenario file, SCENARIO.toml,
    stands for a graph with all that is asked about it. `classify`, `certify`, `simulate`, `plot` and `check` take
    families of graphs, too: several with --switching, or uncertain weights.

    Begin with: ptcc certify fig1b
    """


for group in GROUPS.values():
    for command in group:
        cli.add_command(command)


def main() -> None:
    """Run ``ptcc`` and exit with its code; every refusal is one line on standard error."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # a label that the terminal cannot show stops nothing
    try:
        code = cli.main(prog_name="ptcc", standalone_mode=False)
    except click.MissingParameter as error:
        more = f"; {error.ctx.command_path} --help tells more" if error.ctx else ""
        code = _refuse(error.format_message().rstrip(".") + more)
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
    except SystemExit:  # by click, where who reads the output has gone; the code is that of other programs then
        code = 141
    except OSError as error:
        code = _refuse(f"the result cannot be written ({error.strerror or error})")
        sys.stdout = sys.stderr  # Python would try again at its end
    except ModuleNotFoundError:
        raise  # what is told of a package that is missing is in ptcc_certify.__main__
    except Exception as error:
        click.echo(f"ptcc: {explain(error)}", err=True)
        code = ExitCode.INTERNAL_ERROR
    sys.exit(code if isinstance(code, int) else ExitCode.OK)


def _refuse(message: str) -> int:
    click.echo(f"ptcc: {one_line(message)}", err=True)
    return ExitCode.BAD_INPUT
