"""What the commands print, and refuse to write to."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import click

from ptcc_certify.errors import ParameterError

#: What figures are written as; :mod:`ptcc_certify.report.plots.style` has them too.
FIGURES = (".png", ".pdf", ".svg")


def print_lines(lines: Sequence[str]) -> None:
    """Print lines."""
    click.echo("\n".join(lines))


def print_json(data: Any) -> None:
    """Print one JSON object, in ASCII: no label can spoil it or steer a terminal."""
    click.echo(json.dumps(data, allow_nan=False))


def refuse_output(output: str | None, graph: str = "") -> None:
    """Refuse before the work what could not, or should not, be written after it."""
    if not output:
        return
    if output == "-":
        raise ParameterError("-o names a file; for standard output leave it out (certify: and say --json)")
    if not Path(output).parent.is_dir():
        raise ParameterError(f"{output}: the folder does not exist; make it first")
    if Path(output).is_file() and Path(graph).is_file() and Path(output).samefile(graph):
        raise ParameterError(f"{output}: is the graph itself; name another file")


@contextmanager
def progress(steps: Sequence[str]) -> Iterator[Callable[[str], None]]:
    """Show on a terminal which of some steps is at work; the line goes when they are done."""
    with _bar("TimeElapsedColumn") as add:
        update = add("", total=len(steps))
        yield lambda step: update(completed=steps.index(step), description=step)


@contextmanager
def counting() -> Iterator[Callable[[int, int, int], None]]:
    """Show on a terminal how many of many rows are done, how many have an error, and how long the rest will take."""
    with _bar("MofNCompleteColumn", "TimeRemainingColumn") as add:
        update: Callable[..., None] | None = None

        def show(done: int, total: int, errors: int) -> None:
            nonlocal update
            if update is None:  # rows that were there already do not count for the speed
                update = add("left", total=total, completed=done)
            update(completed=done, description=f"left ({errors} with an error)" if errors else "left")

        yield show


@contextmanager
def _bar(*columns: str) -> Iterator[Callable[..., Callable[..., None]]]:
    """Yield what adds a task to a bar and returns what updates it; without a terminal nothing is shown."""
    if not sys.stderr.isatty():
        yield lambda description, **task: lambda **now: None
        return
    from rich import progress as rich
    from rich.console import Console

    layout = (rich.BarColumn(), *(getattr(rich, name)() for name in columns), rich.TextColumn("{task.description}"))
    with rich.Progress(*layout, console=Console(stderr=True), transient=True) as bar:
        yield lambda description, **task: partial(bar.update, bar.add_task(description, **task))
