"""Many graphs, one table: a row for each graph, on one machine or on many, resumed where it was interrupted.

A row depends on the graph and on the settings alone, not on its place in the list nor on where it was computed, except
for ``seconds``, and for what a time limit cuts off. Files are read where the batch was started and their bytes are
sent; workers neither read nor write.

:mod:`~ptcc_certify.batch.sources` tells which graphs there are, :mod:`~ptcc_certify.batch.settings` is everything else
that a row depends on, and :mod:`~ptcc_certify.batch.rows` makes one row; its columns are listed there. Rows are
computed by one of the :mod:`~ptcc_certify.batch.backends`, kept as they come by :mod:`~ptcc_certify.batch.journal`, and
written by :mod:`~ptcc_certify.batch.table` when all are there, or when a batch ends before.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import closing, suppress
from pathlib import Path
from typing import Any, Literal

from ptcc_certify.batch.backends import compute_rows, default_workers
from ptcc_certify.batch.journal import Journal, journal_path
from ptcc_certify.batch.rows import COLUMNS, Row
from ptcc_certify.batch.settings import Settings, Start, whole_number
from ptcc_certify.batch.sources import chosen_sources
from ptcc_certify.batch.table import refuse_table, table_bytes
from ptcc_certify.errors import ParameterError, PTCCError
from ptcc_certify.graphs.ensembles import Ensemble
from ptcc_certify.graphs.io import write_atomically, write_graph
from ptcc_certify.graphs.rationals import shorten
from ptcc_certify.protocols import Protocol

__all__ = ["COLUMNS", "Row", "Settings", "certify_many", "default_workers", "table_bytes", "write_graphs"]


def certify_many(
    sources: Any,
    protocol: Protocol,
    *,
    x0: Start = "random",
    seed: int = 0,
    sigma0: Start = None,
    disturbance: str | None = None,
    method: str = "best",
    simulation: bool | None = False,
    initial_bound: Any = None,
    expect: str | None = None,
    min_rate: Any = None,
    orientation: str | None = None,
    duplicates: Literal["refuse", "sum", "last"] = "refuse",
    drop_self_loops: bool = False,
    undirected: bool = False,
    time_limit: float | None = None,
    workers: int = 1,
    scheduler: str | None = None,
    output: str | os.PathLike[str] | None = None,
    restart: bool = False,
    progress: Callable[[int, int, int], None] = lambda done, total, errors: None,
) -> list[Row]:
    """Certify many graphs, and return or write a table with one row for each.

    Whatever goes wrong with one graph becomes the entry ``error`` of its row and stops nothing.

    Parameters
    ----------
    sources : path, pattern, SignedDigraph, Ensemble, or a sequence of these
        A text is a file, a pattern such as ``"graphs/*.csv"`` (``**`` for folders within), the name of a packaged
        graph, or an ensemble's ``.toml`` file. A pattern skips folders and the table itself; a link to nowhere that
        matches has an error. A file that is named several times, in whatever way or through links, has one row, under
        the first of its names. Paths are read as they are written, and a leading ``./`` is left out of names.
    protocol : NominalProtocol or SlidingModeProtocol
    x0 : "random", str, sequence of numbers, mapping, pandas Series or None
        ``"random"``: a start of its own for every graph, uniform on [-10, 10] to three decimals, a function of ``seed``
        and the graph. Otherwise as in :func:`ptcc_certify.certify`, the same for all; a graph that it does not fit has
        an error.
    seed : int
        Of random starts and telegraph signals.
    sigma0 : "random", str, sequence of numbers, mapping, pandas Series or None
        Sliding mode: the sliding variables at 0, like ``x0``; None: 0.
    disturbance : str, optional
        Sliding mode: what a simulated run meets, an expression of ``k`` and ``t`` or a name; the adversary by default.
    method : {"best", "paper", "perron", "lmi", "full"}
        As in :func:`ptcc_certify.certify`.
    simulation : bool or None
        Compare with CVODES runs; None: of up to 10,000 agents.
    initial_bound : positive number, optional
        Bound the input for all starts with ``|x_k(0)| <= initial_bound`` instead of ``x0``.
    expect : str, optional
        A behaviour that every graph should show.
    min_rate : positive number, optional
        A rate that should be proved for every graph, per unit of the stretched clock.
    orientation : {"information", "listens"}, optional
        How files are read, as the next three; see :func:`ptcc_certify.read_graph`.
    duplicates : {"refuse", "sum", "last"}
        What becomes of two rows for the same ordered pair.
    drop_self_loops, undirected : bool
        Drop self-loops; let each edge go both ways.
    time_limit : float, optional
        Seconds for each graph, as in :func:`ptcc_certify.certify`; the column ``cut_off`` names what they ended.
    workers : int
        Processes on this machine, through joblib; 1: in this process.
    scheduler : str, optional
        Address of a Dask scheduler, ``tcp://host:8786``; it and its workers have the same version of this package.
    output : path, optional
        Write the table to this ``.csv`` or ``.parquet`` file. Rows are kept beside it in ``<output>.journal`` as they
        come; called again after an interruption with the same settings, the batch goes on with those that are missing,
        and with files that have changed since. The list may have changed too: rows of its graphs are used again, others
        are left out. After an interruption or a failure the file holds the rows so far.
    restart : bool
        Drop such a journal and replace such a table.
    progress : callable
        Is told how many rows are there, how many there will be, and how many of them have an error; first before any
        work.

    Returns
    -------
    list of dict
        The rows in the order of ``sources``, with the columns that :mod:`ptcc_certify.batch.rows` lists; ``None`` where
        an entry is empty. An exception that ends the work, an interrupt too, has those so far in its attribute
        ``rows``.

    Raises
    ------
    FormatError
        A file that is named is not there or is no regular file, a pattern matches none, or a ``.toml`` file cannot be
        read.
    ParameterError
        No graph, a setting outside its domain, a table that is there already, a journal of other settings or of a
        batch that still runs, a missing package, or a cluster that answers no longer or has no workers.

    Examples
    --------
    >>> from ptcc_certify.protocols import NominalProtocol
    >>> rows = certify_many(["fig1a", "fig1b"], NominalProtocol(T=1, rho1=1, rho2=1, kappa=2), method="perron")
    >>> [(row["graph"], row["behaviour"], row["verdict"]) for row in rows]
    [('fig1a', 'stability', 'certified'), ('fig1b', 'bipartite consensus', 'certified')]
    """
    settings = Settings(
        protocol=protocol,
        x0=x0,
        seed=seed,
        sigma0=sigma0,
        disturbance=disturbance,
        method=method,
        simulation=simulation,
        initial_bound=initial_bound,
        expect=expect,
        min_rate=min_rate,
        orientation=orientation,
        duplicates=duplicates,
        drop_self_loops=drop_self_loops,
        undirected=undirected,
        time_limit=time_limit,
    )
    workers = whole_number(workers, "workers", 1)
    path = None if output is None else Path(output)
    if path is not None and not path.name:
        raise ParameterError(f'output = "{shorten(os.fspath(path))}" names no file; name a .csv or .parquet file')
    chosen = chosen_sources(sources, () if path is None else (path, journal_path(path)))

    rows: dict[int, Row] = {}

    def so_far() -> list[Row]:
        return [rows[number] for number in sorted(rows)]

    def complete(keep: Callable[[str, Row], None]) -> list[Row]:
        """Compute the rows that are missing and keep each as it comes; return all in their order."""
        errors = sum(row["error"] is not None for row in rows.values())
        progress(len(rows), len(chosen), errors)
        missing = [number for number in range(len(chosen)) if number not in rows]
        if missing:
            tasks = (chosen[number].task(number) for number in missing)
            with closing(compute_rows(tasks, settings, min(workers, len(missing)), scheduler)) as found:
                for task, row in found:
                    rows[task.number] = row
                    keep(task.mark, row)
                    errors += row["error"] is not None
                    progress(len(rows), len(chosen), errors)
        return so_far()

    if path is None:
        try:
            return complete(lambda *_: None)
        except BaseException as error:
            error.rows = so_far()  # type: ignore[attr-defined]
            raise
    # A table that is being replaced has a journal.
    refuse_table(path, chosen, restart or journal_path(path).exists())
    with closing(Journal(journal_path(path), chosen, settings, restart)) as journal:
        if journal.new:  # another batch may have written the table, and removed its journal, since it was looked for
            refuse_table(path, chosen, restart)
        rows.update(journal.current())
        try:
            table = complete(journal.append)
        except BaseException as error:
            error.rows = so_far()  # type: ignore[attr-defined]
            if rows:
                with suppress(PTCCError, OSError):  # what stopped the batch is told, not what came of it
                    write_atomically(path, table_bytes(so_far(), path.suffix.lower()))
            raise
        write_atomically(path, table_bytes(table, path.suffix.lower()))
        journal.remove()
    return table


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
    >>> from tempfile import TemporaryDirectory
    >>> from ptcc_certify import Ensemble
    >>> with TemporaryDirectory() as folder:
    ...     write_graphs(Ensemble(count=2, nodes=5), folder), sorted(path.name for path in Path(folder).iterdir())
    (2, ['ensemble-0.csv', 'ensemble-1.csv'])
    """
    chosen = chosen_sources(sources)
    for source in chosen:
        if not isinstance(source.origin, tuple):
            raise ParameterError(f"{shorten(source.name, 200)}: is a graph already; only those of a .toml are written")
    if not os.fspath(folder):
        raise ParameterError("the name of the folder is empty; name a folder")
    targets: dict[Path, tuple[Ensemble, int]] = {}
    for source in chosen:
        assert isinstance(source.origin, tuple)
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
