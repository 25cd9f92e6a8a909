"""``ptcc new``: a commented scenario file."""

from __future__ import annotations

import json
import os
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path

import click

from ptcc_certify.cli.options import graph_file
from ptcc_certify.cli.scenario import SECTIONS, is_scenario
from ptcc_certify.cli.terminal import print_lines
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.rationals import shorten
from ptcc_certify.graphs.recognised_files import kind_of, shell_word

#: Columns of the file, where values leave room, and what is written in it as it is; the rest are comments.
_WIDTH = 100
_WRITTEN = ("graph", "kind", "T", "rho1", "rho2", "kappa", "x0", "seed")


@click.command()
@click.argument("graph", nargs=-1, type=click.Path())
@click.option("-o", "--output", type=click.Path(dir_okay=False), help="Write it to this file, such as scenario.toml.")
@click.option("--force", is_flag=True, help="Replace an existing file.")
@click.pass_context
def new(context: click.Context, graph: tuple[str, ...], output: str | None, force: bool) -> int:
    """Write a commented scenario file, with GRAPH in it if one is given; several are the modes of a family.

    A scenario holds all that a run needs - graph, protocol, initial state, limits, expectations - in one file that
    `ptcc certify`, `simulate`, `design` and `plot` take in place of GRAPH. Flags override it. Without -o it is printed.
    """
    from ptcc_certify.graphs.io import read_family, write_atomically

    if "-" in graph:
        raise ParameterError("a scenario names the file of its graph; save the graph first")
    if scenario := next(filter(is_scenario, graph), None):
        raise ParameterError(f"{shorten(scenario, 200)}: is a scenario itself; copy it, or name a graph")
    labels = read_family([graph_file(one) for one in graph]).labels if graph else ()
    files = [_named(one, Path(output or "").parent) for one in graph]
    root = context.find_root().command
    commands = root.commands.values() if isinstance(root, click.Group) else ()
    text = template({p.name: p for command in reversed([*commands]) for p in command.params if p.name}, files, labels)
    if output is None:
        click.echo(text, nl=False)
        return 0
    if not is_scenario(output):
        raise ParameterError(f"{output}: a scenario is written to a file that ends in .toml")
    if os.path.exists(output) and not force:  # noqa: PTH110 - Path.exists may raise
        raise ParameterError(f"{output}: is there already; name another file, or replace it with --force")
    write_atomically(output, text)
    print_lines(f"written    {output}; now: ptcc certify {shell_word(output)}")
    return 0


def template(options: Mapping[str, click.Parameter], files: Sequence[str] = (), labels: Sequence[str] = ()) -> str:
    """Return a commented scenario: every key with its meaning and its default.

    Parameters
    ----------
    options : mapping of str to click.Parameter
        What the keys stand for, by name.
    files : sequence of str
        What it is about: a graph, or the modes of a family.
    labels : sequence of str
        The nodes of the graph; those of a small one are shown where their values go.

    Returns
    -------
    str
        TOML that :func:`~ptcc_certify.cli.scenario.read_scenario` reads, with or without the ``#`` of its keys.
    """
    lines = ["# A scenario: ptcc certify, simulate, design and plot take this file in place of a graph."]
    lines += ["# Lines that begin with # are left out; remove the # to give the key a value. Flags override it."]
    for section, (title, keys) in SECTIONS.items():
        lines += ["", *_commented(f"[{section}]", title)]
        for key, told in keys.items():
            example = told.example
            if key == "file" and files:
                quoted = [_quoted(file) for file in files]
                example = quoted[0] if len(files) == 1 else f"[{', '.join(quoted)}]"
            line = f"{'' if told.name in _WRITTEN else '# '}{key} = {example}"
            lines += _commented(f"{line:<32}", _meaning(options.get(told.name)))
            if key == "x0" and 0 < len(labels) <= 12:
                values = ", ".join(f"{_quoted(label)} = 1" for label in labels)
                lines.append(f"# x0 = {{ {values} }}")
    return "\n".join(lines) + "\n"


def _commented(line: str, comment: str) -> list[str]:
    """Return a line with a comment beside it, which goes on in the lines below."""
    first, *others = textwrap.wrap(comment, _WIDTH - len(line) - 4)
    return [f"{line}  # {first}", *(f"{' ' * len(line)}  # {more}" for more in others)]


def _quoted(text: str) -> str:
    """Return a text as TOML has it, in values and in comments."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _meaning(option: click.Parameter | None) -> str:
    """Return what an option means, its values and its default."""
    if not isinstance(option, click.Option):
        return (
            "A file, relative to the folder of this one, or a packaged graph: fig1a .. fig5b. "
            'A list, ["day.csv", "night.csv"], is a family: any of them may act at any time.'
        )
    text, _, default = (option.help or "").partition("  [default: ")
    text = text.replace("; repeat it for more", "; list several")  # flags are repeated, keys hold lists
    if isinstance(option.type, click.Choice) and len(option.type.choices) > 1:
        text += f" One of {', '.join(map(str, option.type.choices))}."
    if not default:
        shown = option.show_default if isinstance(option.show_default, str) else option.default
        shown = False if option.is_flag and not option.secondary_opts else shown
        known = isinstance(shown, bool | int | str)
        default = f"{str(shown).lower() if isinstance(shown, bool) else shown if known else 'none'}]"
    return f"{text}  [default: {default}"


def _named(graph: str, folder: Path) -> str:
    """Return a file as seen from a folder; a packaged graph by its name."""
    from ptcc_certify.graphs.io.packaged import GRAPHS

    return graph if graph in GRAPHS and kind_of(graph) == "missing" else _relative(graph, folder)


def _relative(path: str, folder: Path) -> str:
    """Return a path as seen from a folder, with slashes."""
    try:
        return Path(os.path.relpath(path, folder)).as_posix()
    except ValueError:  # another drive
        return Path(path).resolve().as_posix()
