"""What the commands print, log and refuse to write to."""

from __future__ import annotations

import functools
import json
import logging
import os
import shutil
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ptcc_certify.errors import Change, ParameterError, PTCCError, Sentence, one_line

if TYPE_CHECKING:
    from ptcc_certify.certificate.fact import Fact

#: What figures are written as; :mod:`ptcc_certify.report.plots.style` has them too.
FIGURES = (".png", ".pdf", ".svg")
#: Options that name a file to write, and where the path of the scenario of a call is kept.
WRITTEN, SCENARIO = ("output", "log", "curve"), "ptcc_certify.scenario_file"
#: Where a call keeps when its work began.
CLOCK = "ptcc_certify.clock"
#: Seconds after which a command that writes to no terminal tells where it is, and between two such lines.
FIRST_WORD, NEXT_WORD = 10, 30

#: What the commands do, step by step; ``--log`` writes it to a file.
LOG = logging.getLogger("ptcc_certify")
LOG.addHandler(logging.NullHandler())  # nothing of it goes to a terminal


# ---------------------------------------------------------------------- how much is printed


@dataclass(frozen=True)
class Screen:
    """How much a command prints: a short screen, everything (``-v``), or nothing but errors (``-q``)."""

    verbose: bool = False
    quiet: bool = False

    def show(self, facts: Callable[[bool], Iterable[Fact]]) -> None:
        """Print facts, with details or without; lines of all are wrapped to the terminal, without one to 80 columns."""
        from ptcc_certify.report.screen import long_screen, short_screen

        if self.verbose:
            self.lines(long_screen(facts(True), flagged))
        elif not self.quiet:
            print_lines(*short_screen(facts(False), flagged))

    def lines(self, lines: Iterable[str]) -> None:
        """Print lines of any length, wrapped."""
        from ptcc_certify.report.text_layout import WIDTH, wrap_lines

        width = shutil.get_terminal_size((WIDTH, 24)).columns if _on_terminal(sys.stdout) else WIDTH
        print_lines(*wrap_lines(lines, width))

    def note(self, text: str) -> None:
        """Print one more line on standard output."""
        if not self.quiet:
            print_lines(*text.split("\n"))


def flagged(change: Change) -> str:
    """Name a change as an option of a command.

    Examples
    --------
    >>> from ptcc_certify.errors import Change
    >>> flagged(Change("rho2", "0.5")), flagged(Change("time_limit"))
    ('--rho2 0.5', '--time-limit')
    """
    return f"--{change.field.replace('_', '-')} {change.number}".rstrip()


def in_flags(sentence: Sentence) -> str:
    """Return a sentence as one line, its changes named as options."""
    from ptcc_certify.errors import spell

    return one_line(spell(sentence, flagged))


def screen_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add ``-v``, ``-q`` and ``--log``; the command is given its :class:`Screen` as the keyword ``screen``."""

    @click.option("-v", "--verbose", is_flag=True, help="Print all that is known, not the short screen alone.")
    @click.option("-q", "--quiet", is_flag=True, help="Print nothing but errors; the exit code tells.")
    @click.option("--log", metavar="FILE", help="Append to FILE what is done, step by step, with the seconds it takes.")
    @functools.wraps(command)
    def wrapped(*args: Any, verbose: bool, quiet: bool, log: str | None, **options: Any) -> Any:
        if verbose and quiet:
            raise ParameterError("-v asks for more and -q for nothing; leave one out")
        with log_to(log):
            return command(*args, screen=Screen(verbose, quiet), **options)

    return wrapped


#: Colours of verdicts, by how they begin; others, such as ``left open``, are yellow.
_COLOURS = {("certified;", "met", "accepted"): "green", ("refuted", "violated", "rejected", "not met"): "red"}


def print_lines(*lines: str, err: bool = False) -> None:
    """Print lines; what would steer a terminal, in the name of a file or a node, is shown as ``?``.

    A verdict has the colour of what it says, where the terminal has colours and ``NO_COLOR`` is not set.
    """
    from ptcc_certify.report.text_layout import printable

    click.echo("\n".join(_coloured(printable(line)) for line in lines), err=err)


def _coloured(line: str) -> str:
    """Return a line of the screen, a verdict in its colour; what goes to a file is printed without."""
    head, _, text = line.partition(" ")
    if head.lower() not in ("verdict", "accepted", "rejected") or os.environ.get("NO_COLOR"):
        return line
    said = text.strip().lower() if head.lower() == "verdict" else head
    colour = next((colour for words, colour in _COLOURS.items() if said.startswith(words)), "yellow")
    return click.style(line, fg=colour, bold=True)


def _on_terminal(stream: Any) -> bool:
    """Tell whether a stream is a terminal; one that was closed before the start is None."""
    return stream is not None and stream.isatty()


def print_json(data: Any) -> None:
    """Print one JSON object, in ASCII: no label can spoil it or steer a terminal."""
    click.echo(json.dumps(data, allow_nan=False))


def refuse_output(output: str | None) -> None:
    """Refuse before the work what could not, or should not, be written after it."""
    if output is None:
        return
    if output in ("", "-"):
        raise ParameterError("-o names a file; for standard output leave it out (certify: and say --json)")
    if not Path(output).parent.is_dir():
        raise ParameterError(f"{output}: the folder does not exist; make it first")
    if not os.access(Path(output).parent, os.W_OK) and not os.path.exists(output):  # noqa: PTH110 - Path.exists may raise
        raise ParameterError(f"{output}: nothing may be written to this folder; name another one")
    _refuse_input(output, output)


def _refuse_input(path: str, place: str) -> None:
    """Refuse to write to a file that the command reads: graph, certificate, states, scenario."""
    context = click.get_current_context()
    given = [value for name, value in context.params.items() if name not in WRITTEN]
    texts = [
        text for value in given for text in (value if isinstance(value, tuple) else (value,)) if isinstance(text, str)
    ]
    for text in (*texts, context.meta.get(SCENARIO)):
        if text and (path == text or (os.path.isfile(path) and os.path.isfile(text) and os.path.samefile(path, text))):  # noqa: PTH113, PTH121 - Path.is_file may raise
            raise ParameterError(f"{place}: is read by the command itself; name another file")


# ---------------------------------------------------------------------- the log


@contextmanager
def log_to(path: str | None) -> Iterator[None]:
    """Append to a file what is logged inside: the command, its steps, and how it ended."""
    if path is None:
        yield
        return
    if path == click.get_current_context().params.get("output"):
        raise ParameterError(f"--log {path}: is written by -o; name another file")
    _refuse_input(path, f"--log {path}")
    try:
        handler = _LogFile(path, encoding="utf-8", errors="backslashreplace")
    except OSError as error:
        raise ParameterError(f"--log {path}: cannot be written ({error.strerror}); name another file") from None
    handler.setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(message)s"))
    level = LOG.level
    LOG.addHandler(handler)
    LOG.setLevel(logging.INFO)
    began = time.monotonic()
    try:
        LOG.info("%s", one_line(f"ptcc {' '.join(sys.argv[1:])}"))
        yield
        LOG.info("ended after %.3f s", time.monotonic() - began)
    except (Exception, KeyboardInterrupt) as error:
        why = one_line(str(error)) if isinstance(error, PTCCError) else type(error).__name__
        LOG.error("ended after %.3f s: %s", time.monotonic() - began, why)
        raise
    finally:
        LOG.setLevel(level)
        LOG.removeHandler(handler)
        with suppress(OSError):
            handler.close()


class _LogFile(logging.FileHandler):
    def handleError(self, record: logging.LogRecord) -> None:
        """Refuse a file that cannot be written, as on a full disk."""
        raise ParameterError(f"--log {self.baseFilename}: cannot be written; name another file")


# ---------------------------------------------------------------------- progress


@contextmanager
def progress(steps: Sequence[str], quiet: bool = False) -> Iterator[Callable[[str], None]]:
    """Show which of some steps is at work, and log each with its seconds; on a terminal the line goes at the end.

    A graph that has something proved as a family takes the steps of one, of which some have other names.
    """
    began, last, done = time.monotonic(), "", 0
    with _bar("TimeElapsedColumn", quiet=quiet) as add:
        update = add("", total=len(steps))

        def begin(step: str) -> None:
            nonlocal began, last, done
            if last:
                LOG.info("%s: %.3f s", last, time.monotonic() - began)
            began, last = time.monotonic(), step
            if step:
                done = steps.index(step) if step in steps else done
                update(completed=done, description=step)

        yield begin
        begin("")


@contextmanager
def counting() -> Iterator[Callable[[int, int, int], None]]:
    """Show how many of many rows are done, how many have an error, and on a terminal how long the rest will take."""
    with _bar("MofNCompleteColumn", "TimeRemainingColumn") as add:
        update: Callable[..., None] | None = None

        def show(done: int, total: int, errors: int) -> None:
            nonlocal update
            if update is None:  # rows that were there already do not count for the speed
                update = add("rows", total=total, completed=done)
            update(completed=done, description=f"rows ({errors} with an error)" if errors else "rows")

        yield show


@contextmanager
def _bar(*columns: str, quiet: bool = False) -> Iterator[Callable[..., Callable[..., None]]]:
    """Yield what adds a task to a bar and returns what updates it; without a terminal, to lines now and then."""
    if quiet:
        yield lambda description, **task: lambda **now: None
        return
    if not _on_terminal(sys.stderr):
        with _plain_lines() as add:
            yield add
        return
    from rich import progress as rich
    from rich.console import Console

    layout = (rich.BarColumn(), *(getattr(rich, name)() for name in columns), rich.TextColumn("{task.description}"))
    to_terminal = _on_terminal(sys.stdout)  # else rich would send to standard error what is printed to a file
    with rich.Progress(*layout, console=Console(stderr=True), transient=True, redirect_stdout=to_terminal) as bar:
        yield lambda description, **task: partial(bar.update, bar.add_task(description, **task))


@contextmanager
def _plain_lines() -> Iterator[Callable[..., Callable[..., None]]]:
    """Write where the work is to standard error, 10 s after it began and then every 30 s."""
    state: dict[str, Any] = {}
    done, clock = threading.Event(), _clock()

    def tell() -> None:
        while not done.wait(max(clock["word"] - time.monotonic(), 0)):
            clock["word"] = time.monotonic() + NEXT_WORD
            if state:
                where = f"{state.get('completed', 0)} of {state['total']} done, {state['description']}"
                click.echo(f"ptcc: after {time.monotonic() - clock['began']:.0f} s: {where}", err=True)

    def add(description: str, **task: Any) -> Callable[..., None]:
        state.update(description=description, **task)
        return state.update

    teller = threading.Thread(target=tell, daemon=True)
    teller.start()
    try:
        yield add
    finally:
        done.set()
        teller.join()


def _clock() -> dict[str, float]:
    """Return when the work of this command began, and when it next tells where it is; parts of a command share it."""
    now, context = time.monotonic(), click.get_current_context(silent=True)
    clock = {"began": now, "word": now + FIRST_WORD}
    return clock if context is None else context.meta.setdefault(CLOCK, clock)
