"""Many graphs, one table: a row for each graph, on one machine or on many, resumed where it was interrupted.

A row depends on the graph and on the settings alone, not on its place in the list nor on where it was computed, except
for ``seconds``, and for what a time limit cuts off. Files are read where the batch was started and their bytes are
sent; workers neither read nor write.

:mod:`~ptcc_certify.batch.sources` tells which graphs there are, :mod:`~ptcc_certify.batch.sources` is everything else
that a row depends on, and :mod:`~ptcc_certify.batch.rows` makes one row; its columns are listed there. Rows are
computed by one of the :mod:`~ptcc_certify.batch.backends`; :mod:`~ptcc_certify.batch.output` keeps them as they come,
and writes the table when all are there, or when a batch ends before.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import ExitStack, closing, suppress
from pathlib import Path
from typing import Any

from ptcc_certify.batch.backends import compute_rows, default_workers
from ptcc_certify.batch.output import Journal, Table, journal_path, refuse_table, table_bytes
from ptcc_certify.batch.rows import COLUMNS, Row
from ptcc_certify.batch.sources import LARGEST_SETTING, Settings, chosen_sources
from ptcc_certify.certificate.request import listener
from ptcc_certify.errors import ParameterError, PTCCError
from ptcc_certify.graphs.ensembles import Ensemble
from ptcc_certify.graphs.io import write_atomically, write_graph
from ptcc_certify.graphs.io.files import refuse_no_path
from ptcc_certify.graphs.rationals import shorten, whole_number
from ptcc_certify.graphs.reading import Reading
from ptcc_certify.model import Protocol

__all__ = ["COLUMNS", "Row", "Settings", "certify_many", "default_workers", "table_bytes", "write_graphs"]


def certify_many(
    sources: Any,
    protocol: Protocol,
    *,
    workers: int = 1,
    scheduler: str | None = None,
    output: str | os.PathLike[str] | None = None,
    restart: bool = False,
    progress: Callable[[int, int, int], None] | None = None,
    **settings: Any,
) -> Table:
    """Certify many graphs, and return or write a table with one row for each.

    Whatever goes wrong with one graph becomes the entry ``error`` of its row and stops nothing.

    Parameters
    ----------
    sources : path, pattern, graph-like, Ensemble, a sequence of these, or a mapping of name to graph-like
        A text is a file, a pattern such as ``"graphs/*.csv"`` (``**`` for folders within), the name of a packaged
        graph, or an ensemble's ``.toml`` file. A pattern skips folders and the table itself; a link to nowhere that
        matches has an error. A file that is named several times, in whatever way or through links, has one row, under
        the first of its names. Paths are read as they are written, and a leading ``./`` is left out of names.
    protocol : NominalProtocol or SlidingModeProtocol
    workers : int
        Processes on this machine; 1: in this process. A script that wants more calls this under
        ``if __name__ == "__main__":``.
    scheduler : str, optional
        Address of a Dask scheduler, ``tcp://host:8786``; it and its workers have the same version of this package.
    output : path, optional
        Write the table to this ``.csv`` or ``.parquet`` file. Rows are kept beside it in ``<output>.journal`` as they
        come; called again after an interruption with the same settings, the batch goes on with those that are missing,
        and with files that have changed since. The list may have changed too: rows of its graphs are used again, others
        are left out. After an interruption or a failure the file holds the rows so far.
    restart : bool
        Drop such a journal and replace such a table.
    progress : callable, optional
        Is told how many rows are there, how many there will be, and how many of them have an error; first before any
        work.
    **settings : keywords of :class:`Settings`
        What a row depends on besides its graph and the protocol; here with the defaults:

        - ``x0="random"``, ``seed=0``, ``sigma0=None``: initial state and sliding variables at 0, as numbers in node
          order, by label, or ``"random"``: then every graph has its own, a function of ``seed`` and the graph;
        - ``disturbance=None``: what a simulated run meets under the sliding-mode protocol;
        - ``method="best"``, ``simulation=False``, ``time_limit=None`` (seconds for each graph), ``expect=None``,
          ``min_rate=None``, ``initial_bound=None``;
        - ``orientation=None``, ``duplicates="refuse"``, ``drop_self_loops=False``, ``drop_zeros=False``,
          ``undirected=False``, ``laplacian=None``, ``columns=None``, ``variable=None``: how files are read, see
          :func:`ptcc_certify.read_graph`; of graphs in memory only ``orientation`` can be told.

        :class:`ptcc_certify.batch.Settings` tells all about each.

    Returns
    -------
    Table
        A list of rows, each a dict, in the order of ``sources``, with the columns that :mod:`ptcc_certify.batch.rows`
        lists; ``None`` where an entry is empty. ``to_pandas()`` makes a DataFrame of it. An exception that ends the
        work, an interrupt too, has those so far in its attribute ``rows``.

    Raises
    ------
    FormatError
        A file that is named is no regular file, a pattern matches none, or a ``.toml`` file cannot be read.
    GraphError
        What is given, not in a list, is no graph; or a FormatError, the only file is not there.
    ParameterError
        No graph, a setting outside its domain, a table that is there already, a journal of other settings or of a
        batch that still runs, a missing package, or a cluster that answers no longer or has no workers.

    Examples
    --------
    >>> rows = certify_many(["fig1a", "fig1b"], NominalProtocol(T=1, rho1=1, rho2=1, kappa=2), method="perron")
    >>> [(row["graph"], row["behaviour"], row["verdict"]) for row in rows]
    [('fig1a', 'stability', 'certified'), ('fig1b', 'bipartite consensus', 'certified')]
    """
    request, workers = Settings.of(protocol, **settings), whole_number(workers, "workers", 1, LARGEST_SETTING)
    progress = listener(progress)
    if output is not None:
        refuse_no_path(output)
    path = None if output is None else Path(output)
    if path is not None and not path.name:
        raise ParameterError(f'output = "{shorten(os.fspath(path))}" names no file; name a .csv or .parquet file')
    selection = chosen_sources(sources, request.reading, () if path is None else (path, journal_path(path)))
    rows: dict[int, Row] = {}
    with ExitStack() as stack:
        journal = None
        if path is not None:
            refuse_table(path, selection, restart or journal_path(path).exists())  # a table that is replaced has one
            journal = stack.enter_context(closing(Journal(journal_path(path), selection, request, restart)))
            if journal.new:  # another batch may have written the table meanwhile, and removed its journal
                refuse_table(path, selection, restart)
            rows |= journal.current()
        try:
            errors = sum(row["error"] is not None for row in rows.values())
            progress(len(rows), len(selection), errors)
            missing = [number for number in range(len(selection)) if number not in rows]
            tasks = (selection[number].task(number) for number in missing)
            where = (max(1, min(workers, len(missing))), scheduler if missing else None)
            for task, row in stack.enter_context(closing(compute_rows(tasks, request, *where))):
                rows[task.number] = row
                if journal is not None:
                    journal.append(task.mark, row)
                errors += row["error"] is not None
                progress(len(rows), len(selection), errors)
        except BaseException as error:
            error.rows = _in_order(rows)  # type: ignore[attr-defined]
            if path is not None and rows:
                with suppress(PTCCError, OSError):  # what stopped the batch is told, not what came of it
                    _write(path, rows)
            raise
        if path is not None and journal is not None:
            _write(path, rows)
            journal.remove()
    return Table(_in_order(rows))


def _in_order(rows: dict[int, Row]) -> list[Row]:
    return [rows[number] for number in sorted(rows)]


def _write(path: Path, rows: dict[int, Row]) -> None:
    write_atomically(path, table_bytes(_in_order(rows), path.suffix.lower()))


def write_graphs(sources: Any, folder: str | os.PathLike[str], *, restart: bool = False) -> int:
    """Write the graphs of ensembles as CSV files ``<spec>-<i>.csv`` into a folder, which is made, and return how many.

    Parameters
    ----------
    sources : path of a ``.toml`` file, Ensemble, or a sequence of these
    folder : path
    restart : bool
        Replace files that are there already.

    Raises
    ------
    ParameterError
        A source is no ensemble, two graphs would be one file, a file is there already, or the folder cannot be made.

    Examples
    --------
    >>> with TemporaryDirectory() as folder:
    ...     write_graphs(Ensemble(count=2, nodes=5), folder), sorted(path.name for path in Path(folder).iterdir())
    (2, ['ensemble-0.csv', 'ensemble-1.csv'])
    """
    if not os.fspath(folder):
        raise ParameterError("the name of the folder is empty; name a folder")
    targets: dict[Path, tuple[Ensemble, int]] = {}
    for source in chosen_sources(sources, Reading()):
        if not isinstance(source.origin, tuple):
            raise ParameterError(f"{shorten(source.name, 200)}: is a graph already; only those of a .toml are written")
        ensemble, i = source.origin
        stem, digits = Path(source.name.rpartition("#")[0]).stem, len(str(len(ensemble) - 1))
        target = Path(folder, f"{stem}-{i:0{digits}d}.csv")
        name = shorten(os.fspath(target), 200)
        if target in targets:
            raise ParameterError(f"{name}: would be two graphs; write ensembles of one name into folders of their own")
        if not restart and os.path.lexists(target):
            raise ParameterError(f"{name}: is there already; name another folder, or replace it with --restart")
        targets[target] = ensemble, i
    try:
        Path(folder).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ParameterError(f"{shorten(os.fspath(folder), 200)}: cannot make this folder ({error.strerror})") from None
    for target, (ensemble, i) in targets.items():
        write_graph(ensemble.graph(i), target)
    return len(targets)
