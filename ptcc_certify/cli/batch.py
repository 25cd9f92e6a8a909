"""``ptcc batch``: many graphs, one table."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import fields
from typing import Any

import click

from ptcc_certify.cli import options as shared
from ptcc_certify.cli.click_options import Command, one_of
from ptcc_certify.cli.terminal import counting, print_lines
from ptcc_certify.errors import ExitCode, ParameterError
from ptcc_certify.graphs.recognised_files import kind_of
from ptcc_certify.model.asks import Asks, Expectations


def _refuse_scenarios(context: click.Context, parameter: click.Parameter, pattern: tuple[str, ...]) -> tuple[str, ...]:
    for text in pattern:
        if kind_of(text) == "a scenario":
            mend = f"ptcc certify {text} runs it; ptcc batch takes graphs, and the options of certify"
            raise ParameterError(f"{text}: is a scenario, for one graph; {mend}")
    return pattern


@click.command(cls=Command)
@click.argument("pattern", nargs=-1, required=True, callback=_refuse_scenarios, type=click.Path())
@shared.plain_reading_options
@shared.protocol_options
@shared.expect_option("E.g. stability; exit code 3 if it does not follow for some graph.")
@one_of(Expectations, "min_rate", help="Ask for a proved rate of at least R of every graph.")
@shared.method_option
@shared.initial_bound_option
@one_of(Asks, "simulation", default=False, shown="no-simulation", help="Compare with CVODES runs.")
@shared.time_limit_option
@click.option("--workers", type=click.IntRange(1, 1024), help="Processes on this machine.  [default: one per core]")
@click.option("--scheduler", metavar="ADDRESS", help="Compute on the workers of this Dask scheduler instead.")
@click.option("-o", "--output", type=click.Path(dir_okay=False), help="Write the table to FILE.csv or FILE.parquet.")
@click.option("--restart", is_flag=True, help="Begin again, and replace the table, or the graphs of --write-graphs.")
@click.option("--write-graphs", metavar="DIR", help="Only write the graphs of SPEC.toml to this folder, as CSV.")
def batch(pattern: tuple[str, ...], output: str | None, restart: bool, write_graphs: str | None, **options: Any) -> int:
    """Certify many graphs: a table with one row for each.

    Every graph has a random initial state of its own, unless --x0 is given.

    For example: ptcc batch 'graphs/*.csv' -o table.csv

    PATTERN is a file, a quoted pattern such as 'graphs/*.csv', a packaged graph, or SPEC.toml, which describes an
    ensemble of random graphs (keys: count, nodes, seed, connectivity, balanced, mean_degree, negative, weight_range,
    weight_decades, undirected); several may be given.

    Rows are kept in FILE.journal as they come: after an interruption the same command goes on with those that are
    missing, and with files that have changed; the list of graphs may have changed too. FILE then has the rows so far.
    Whatever goes wrong with one graph becomes the column error of its row. Without -o the table is printed as CSV when
    it is complete, or with the rows so far when it ends before.

    Columns are told in docs/guide/many-graphs.md; useful: the bound leaves at most 1 % at 0.99 T. asked: met, refuted
    or left open. fastest: class of the Lyapunov function with the rate. overshoot: the constant before its bound.

    Exit code 0: every graph certified, and what was asked of them holds. Otherwise the table is there too, and the
    code is the worst of its rows: 1 a simulated run exceeds its bound, 3 an expectation is refuted, 4 some are
    undecided or have an error. 2: nothing was written.
    """
    from ptcc_certify import batch as many

    settings = {field.name: options[field.name] for field in fields(many.Settings) if field.name in options}
    settings |= shared.reading_of(options)
    workers, scheduler = options["workers"], options["scheduler"]
    if write_graphs is not None:
        for flag, value in (("-o", output), ("--scheduler", scheduler), ("--workers", workers)):
            if value is not None:
                raise ParameterError(f"{flag} has no effect beside --write-graphs; leave it out")
        print_lines(f"written    {many.write_graphs(pattern, write_graphs, restart=restart)} graphs to {write_graphs}")
        return ExitCode.OK
    if scheduler is not None and workers is not None:
        raise ParameterError("--workers is for this machine, --scheduler for a cluster; leave one out")
    if restart and output is None:
        raise ParameterError("--restart replaces a table; name it with -o")
    if output in ("", "-"):
        raise ParameterError("-o names a file; for standard output leave it out")
    protocol, total = shared.protocol_of(options, ()), 0
    where: dict[str, Any] = {"workers": workers or many.default_workers(), "scheduler": scheduler}
    try:
        with counting() as show, _interrupts() as ask:

            def progress(*counts: int) -> None:
                nonlocal total
                ask()
                if output and total == 0 and counts[0]:
                    click.echo(f"note: {counts[0]} of {counts[1]} rows were there already", err=True)
                total = counts[1]
                show(*counts)

            where |= {"output": output, "restart": restart, "progress": progress}
            rows = many.certify_many(pattern, protocol, **where, **settings)
    except BaseException as error:
        part, interrupt = getattr(error, "rows", []), isinstance(error, KeyboardInterrupt)
        if part or interrupt:
            text = _tell_rows(part, total, output, restart)
            click.echo(f"{'ptcc: interrupted' if interrupt else 'note: the batch failed'}; {text}", err=True)
        if interrupt:
            return ExitCode.INTERRUPTED
        raise
    if output is None:
        click.echo(many.table_bytes(rows, ".csv").decode(), nl=False, color=True)
    else:
        counts = [f"{sum(row['verdict'] == v for row in rows)} {v}" for v in ("certified", "undecided")]
        failed = sum(row["error"] is not None for row in rows)
        click.echo(f"rows       {len(rows)}: {', '.join(counts)}, {failed} with an error")
        print_lines(f"written    {output}")
    return _exit_code(rows)


@contextmanager
def _interrupts() -> Iterator[Callable[[], None]]:
    """Let SIGTERM, by which schedulers and shutdowns end a process, do what Ctrl-C does; yield what asks between rows.

    What a handler raises in a callback from C is lost: then the next row raises it.
    """
    received: list[int] = []

    def interrupt(number: int, frame: Any) -> None:
        received.append(number)
        raise KeyboardInterrupt

    def ask() -> None:
        if received:
            raise KeyboardInterrupt

    numbers: list[int] = []
    if threading.current_thread() is threading.main_thread():  # which alone handles signals
        numbers.append(signal.SIGTERM)
        if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            numbers.append(signal.SIGINT)
    before = {number: signal.signal(number, interrupt) for number in numbers}
    try:
        yield ask
    finally:
        for number, handler in before.items():
            signal.signal(number, signal.SIG_DFL if handler is None else handler)


def _tell_rows(rows: list[dict[str, Any]], total: int, output: str | None, restart: bool) -> str:
    """Tell, after a batch ended before its time, which rows there are and how it goes on; print them without a file."""
    from ptcc_certify.batch import table_bytes

    if not rows:
        return "nothing is kept"
    if output is None:
        click.echo(table_bytes(rows, ".csv").decode(), nl=False, color=True)
        return f"{len(rows)} of {total} rows are printed; with -o FILE.csv the same command could go on"
    again = "the same command without --restart" if restart else "the same command"
    missing = f"{total - len(rows)} are missing, and {again} goes on"
    return f"{len(rows)} of {total} rows are kept, in {output} too; {missing}"


def _exit_code(rows: Sequence[dict[str, Any]]) -> int:
    """Return the exit code of the worst row, and tell how many rows are not what one would wish."""
    from ptcc_certify.certificate.assessment import OPEN, REFUTED, exit_code

    failed = [row for row in rows if row["error"] is not None]
    violated = sum(row["bound_kept"] is False for row in rows)
    refuted = sum(row["asked"] == REFUTED for row in rows)
    undecided = sum(row["verdict"] == "undecided" or row["asked"] == OPEN for row in rows)
    remarks = (
        (sum(row["cut_off"] is not None for row in rows), "the time limit ended searches, column cut_off"),
        (violated, "violated: the simulated run exceeds the proved bound; please report"),
        (refuted, "refuted: what was asked does not hold"),
        (undecided, "undecided, or what was asked is left open"),
        (len(failed), "" if not failed else f"no certificate, such as {failed[0]['error']}"),
    )
    for count, text in remarks:
        if count:
            click.echo(f"note: {count} of {len(rows)} graphs: {text}", err=True)
    return exit_code(bool(violated), bool(refuted), bool(undecided or failed))
