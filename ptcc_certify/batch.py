"""Many graphs, one table: a row for each graph, on one machine or on many, resumed where it was interrupted.

The columns, in this order; an entry that does not apply, or was not proved, is empty:

==================  =====  ============================================================================================
graph               text   path, or ``spec.toml#i`` for graph ``i`` of an ensemble
sha256              text   of the canonical edge list (:attr:`SignedDigraph.sha256`)
nodes               int
edges               int
negative            int    edges of negative weight
connectivity        text   strong, quasi-strong, weak or disconnected
components          int    weakly connected components
leaders             int    nodes in closed components
followers           int
closed_components   int
balanced_leaders    int    closed components that are balanced
balanced            bool   whether the whole graph is balanced
theorem             text   of a disconnected graph those of its components, each once, joined by ``"; "``
behaviour           text   likewise
verdict             text   certified or undecided
asked               text   holds, refuted or undecided: what was expected, and the least rate; empty if nothing was
rate                float  proved, rounded down; per unit of the stretched clock
rate_limit          float  proved: no rate exceeds it; rounded up
tightness           float  rate over rate_limit, rounded down
fastest             text   class of the Lyapunov function with that rate: paper, perron, lmi or full
prefactor           float  its prefactor, rounded up
paper_rate          float  of the paper's own certificate, proved, rounded down
diagonal_rate       float  largest proved rate of a diagonal matrix, rounded down
input_bounded       bool   whether the input stays bounded up to the deadline for every start
peak_input          float  proved bound of every ``|u_k|`` from the start or the set of starts, rounded up
seed                int    of the random start: ``ptcc certify GRAPH --x0 random --seed SEED`` certifies the same
largest_outcome     float  largest ``|x_k|`` at the deadline
degenerate          bool   whether some balanced closed component meets at 0
reaching_time       float  sliding mode: when the last sliding variable is proved to be 0
worst_ratio         float  numerical: largest simulated ``sqrt(V)`` over its bound
bound_kept          bool   numerical: whether the simulated run exceeds no bound
obligations         int    statements proved
note                text   what kept the verdict from certified, and other remarks
seconds             float  that the row took
error               text   why there is no certificate, in one line; empty if there is one
==================  =====  ============================================================================================

A row depends on the graph and on the options alone, not on its place in the list nor on where it was computed, except
for ``seconds``. Files are read where the batch was started and their bytes are sent; workers neither read nor write.
"""

from __future__ import annotations

import csv
import hashlib
import io
import json
import logging
import math
import os
import signal
import sys
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Future, wait
from contextlib import closing
from dataclasses import dataclass
from fractions import Fraction
from glob import glob, has_magic
from pathlib import Path
from typing import IO, Any, Literal, NamedTuple

import numpy as np

from ptcc_certify.certificate import Certificate, certify
from ptcc_certify.disturbance import as_disturbance
from ptcc_certify.ensembles import Ensemble
from ptcc_certify.errors import FormatError, NumberError, ParameterError, PTCCError
from ptcc_certify.examples import GRAPHS, graph_path
from ptcc_certify.graph import SignedDigraph
from ptcc_certify.io import read_graph, read_state, write_atomically, write_graph
from ptcc_certify.io.files import read_bytes
from ptcc_certify.protocols import Protocol, SlidingModeProtocol
from ptcc_certify.rationals import as_fraction, format_exact, shorten
from ptcc_certify.sharpen import METHODS
from ptcc_certify.structure import behaviour_name

Row = dict[str, Any]
Start = str | Sequence[Any] | Mapping[Any, Any] | None
Origin = str | tuple[Ensemble, int] | SignedDigraph

COLUMNS: dict[str, type] = {
    "graph": str,
    "sha256": str,
    "nodes": int,
    "edges": int,
    "negative": int,
    "connectivity": str,
    "components": int,
    "leaders": int,
    "followers": int,
    "closed_components": int,
    "balanced_leaders": int,
    "balanced": bool,
    "theorem": str,
    "behaviour": str,
    "verdict": str,
    "asked": str,
    "rate": float,
    "rate_limit": float,
    "tightness": float,
    "fastest": str,
    "prefactor": float,
    "paper_rate": float,
    "diagonal_rate": float,
    "input_bounded": bool,
    "peak_input": float,
    "seed": int,
    "largest_outcome": float,
    "degenerate": bool,
    "reaching_time": float,
    "worst_ratio": float,
    "bound_kept": bool,
    "obligations": int,
    "note": str,
    "seconds": float,
    "error": str,
}
HOLDS, REFUTED, UNDECIDED = "holds", "refuted", "undecided"
TABLES = (".csv", ".parquet")
SCHEMA = "ptcc-batch/1"
#: One thread of linear algebra for each process; NumPy reads these when it is loaded.
ONE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
#: Seconds after which an idle worker process ends.
IDLE = 20
#: Graphs under way for each worker: while one is computed the next is there.
AHEAD = 2
#: Seconds to find a scheduler, and a worker of it.
PATIENCE = 20
MEND = 'install it with: pip install "ptcc-certify[batch]"'
# python-flint keeps one working precision for a whole process: its threads take turns.
_ONE_AT_A_TIME = threading.Lock()


@dataclass(frozen=True)
class Settings:
    """Everything that a row depends on besides its graph; see :func:`certify_many` for the entries."""

    protocol: Protocol
    x0: Start = "random"
    seed: int = 0
    sigma0: Start = None
    disturbance: str | None = None
    method: str = "best"
    simulation: bool | None = False
    initial_bound: Fraction | None = None
    expect: str | None = None
    min_rate: Fraction | None = None
    orientation: str | None = None
    duplicates: Literal["refuse", "sum", "last"] = "refuse"
    drop_self_loops: bool = False
    undirected: bool = False

    def __post_init__(self) -> None:
        if not self.protocol.prescribed:
            raise ParameterError("rho2 = 0 gives no deadline: nothing is prescribed to certify; give rho2 > 0")
        if self.method not in METHODS:
            raise ParameterError(f'method "{self.method}" is unknown; one of {", ".join(METHODS)}')
        if not isinstance(self.seed, int) or self.seed < 0:
            raise ParameterError(f"seed = {self.seed} is outside its domain; it must be a natural number")
        sliding = isinstance(self.protocol, SlidingModeProtocol)
        for name in ("x0", "sigma0"):
            start = getattr(self, name)
            if isinstance(start, str) and os.path.isfile(start):  # noqa: PTH113 - Path.is_file may raise
                raise ParameterError(f'{name} = "{shorten(start)}" is a file; for a batch give numbers, or random')
        for name in ("sigma0", "disturbance"):
            if getattr(self, name) is not None and not sliding:
                raise ParameterError(
                    f"{name} belongs to the sliding-mode protocol; leave it out or change the protocol"
                )
        if self.disturbance is not None:
            self.disturbance_of(1)  # refuses an expression that cannot be read, before the work
        for name in ("initial_bound", "min_rate"):
            if (value := getattr(self, name)) is not None:
                try:
                    number = as_fraction(value)
                except NumberError as error:
                    raise ParameterError(f"{name}: {error}") from None
                if number <= 0:
                    raise ParameterError(f"{name} is outside its domain; it must be > 0")
                object.__setattr__(self, name, number)
        if self.expect is not None:
            try:
                object.__setattr__(self, "expect", behaviour_name(self.expect))
            except ValueError as error:
                raise ParameterError(f"expect: {error}") from None

    def to_dict(self) -> dict[str, Any]:
        """Return the settings as JSON takes them."""
        entries = {name: getattr(self, name) for name in self.__dataclass_fields__}
        return {name: _plain(value) for name, value in entries.items()}

    def seed_of(self, graph: SignedDigraph) -> int:
        """Return the seed of a graph's own random start: 32 bits of a hash of ``seed`` and the graph."""
        return int.from_bytes(hashlib.sha256(f"{self.seed} {graph.sha256}".encode()).digest()[:4], "big")

    def disturbance_of(self, n: int, seed: int = 0) -> Any:
        """Return the disturbance of ``n`` agents, which a simulated run meets."""
        text = "adversary" if self.disturbance is None else self.disturbance
        delta = getattr(self.protocol, "delta", 0)
        return as_disturbance(text, n, delta, 2 * float(self.protocol.T), seed)


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
        graph, or an ensemble's ``.toml`` file. A file that is named twice has one row.
    protocol : NominalProtocol or SlidingModeProtocol
    x0 : "random", str, sequence of numbers, mapping or None
        ``"random"``: a start of its own for every graph, uniform on [-10, 10] to three decimals, a function of ``seed``
        and the graph. Otherwise as in :func:`ptcc_certify.certify`, the same for all; a graph that it does not fit has
        an error.
    seed : int
        Of random starts and telegraph signals.
    sigma0 : "random", str, sequence of numbers, mapping or None
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
    workers : int
        Processes on this machine, through joblib; 1: in this process.
    scheduler : str, optional
        Address of a Dask scheduler, ``tcp://host:8786``; it and its workers have the same version of this package.
    output : path, optional
        Write the table to this ``.csv`` or ``.parquet`` file. Rows are kept beside it in ``<output>.journal`` as they
        come; called again after an interruption with the same settings, the batch goes on with those that are missing,
        and with files that have changed since.
    restart : bool
        Drop such a journal and replace such a table.
    progress : callable
        Is told how many rows are there, how many there will be, and how many of them have an error; first before any
        work.

    Returns
    -------
    list of dict
        The rows in the order of ``sources``, with the columns that :mod:`ptcc_certify.batch` lists; ``None`` where an
        entry is empty.

    Raises
    ------
    ParameterError
        No graph, a setting outside its domain, a table that is there already, a journal of other settings or of a
        batch that still runs, or a missing package.

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
    )
    if not isinstance(workers, int) or workers < 1:
        raise ParameterError(f"workers = {workers} is outside its domain; it must be 1 or more")
    path = None if output is None else Path(output)
    chosen = _sources(sources, () if path is None else (path, _journal_path(path)))
    rows: dict[int, Row] = {}
    if path is None:
        _compute(chosen, settings, workers, scheduler, rows, lambda *_: None, progress)
        return [rows[number] for number in range(len(chosen))]
    _refuse_table(path, chosen, restart)
    with closing(_Journal(_journal_path(path), _header(chosen, settings), restart)) as journal:
        rows.update(journal.current(chosen))
        _compute(chosen, settings, workers, scheduler, rows, journal.append, progress)
        ordered = [rows[number] for number in range(len(chosen))]
        write_atomically(path, table_bytes(ordered, path.suffix.lower()))
        journal.remove()
    return ordered


def _compute(
    chosen: Sequence[Source],
    settings: Settings,
    workers: int,
    scheduler: str | None,
    rows: dict[int, Row],
    keep: Callable[[int, str | None, Row], None],
    progress: Callable[[int, int, int], None],
) -> None:
    """Compute the rows that are missing, and keep each as it comes."""
    errors = sum(row["error"] is not None for row in rows.values())
    progress(len(rows), len(chosen), errors)
    missing = [number for number in range(len(chosen)) if number not in rows]
    if not missing:
        return
    tasks = (_task(number, chosen[number]) for number in missing)
    found: Generator[tuple[_Task, Row]]
    if scheduler is not None:
        found = _on_dask(tasks, settings, scheduler)
    elif workers > 1 and len(missing) > 1:
        found = _on_processes(tasks, settings, min(workers, len(missing)))
    else:
        found = ((task, certified_row(task.name, task.payload, settings)) for task in tasks)
    with closing(found):
        for task, row in found:
            keep(task.number, task.fingerprint, row)
            rows[task.number] = row
            errors += row["error"] is not None
            progress(len(rows), len(chosen), errors)


def default_workers() -> int:
    """Return the number of cores that this process may use; 1 where joblib is not installed."""
    try:
        from joblib import cpu_count
    except ImportError:
        return 1
    return int(cpu_count())


# ---------------------------------------------------------------------- sources


@dataclass(frozen=True, slots=True)
class Source:
    """Where a graph comes from: a path, an ensemble and a number in it, or the graph itself."""

    name: str
    origin: Origin

    def load(self) -> tuple[Any, str]:
        """Return what a worker makes the graph of, and its fingerprint."""
        if isinstance(self.origin, str):
            data = read_bytes(self.origin, shorten(self.name, 200))
            return data, hashlib.sha256(data).hexdigest()
        if isinstance(self.origin, SignedDigraph):
            return self.origin, self.origin.sha256
        return self.origin, ""  # the ensemble is among the settings

    @property
    def fingerprint(self) -> str | None:
        """The fingerprint; None if there is nothing to be read."""
        try:
            return self.load()[1]
        except PTCCError:
            return None


class _Task(NamedTuple):
    number: int
    name: str
    payload: Any
    fingerprint: str | None


def _task(number: int, source: Source) -> _Task:
    try:
        payload, fingerprint = source.load()
    except PTCCError as error:
        return _Task(number, source.name, error, None)
    return _Task(number, source.name, payload, fingerprint)


def _sources(sources: Any, own: Sequence[Path]) -> list[Source]:
    """Return what ``sources`` stand for, each once; patterns leave out the files that the batch writes itself."""
    if isinstance(sources, str | os.PathLike | SignedDigraph | Ensemble):
        sources = [sources]
    found: dict[str, Source] = {}
    given = ensembles = 0
    for source in sources:
        if isinstance(source, SignedDigraph):
            own_sources = [Source(f"graph#{given}", source)]
            given += 1
        elif isinstance(source, Ensemble):
            ensembles += 1
            own_sources = _members("ensemble" if ensembles == 1 else f"ensemble{ensembles}", source)
        elif isinstance(source, str | os.PathLike):
            own_sources = _named(os.fspath(source), own)
        else:
            raise ParameterError(f"{shorten(repr(source))} is no graph; give paths, SignedDigraphs or Ensembles")
        for one in own_sources:
            found.setdefault(one.name, one)
    if not found:
        raise ParameterError("there are no graphs; name files or patterns")
    return list(found.values())


def _named(text: str, own: Sequence[Path]) -> list[Source]:
    """Return what a text stands for."""
    name, path = shorten(text, 200), Path(text)
    try:
        exists, folder = path.exists(), path.is_dir()
    except (OSError, ValueError):  # a name that no file can have
        exists = folder = False
    if exists and not folder:
        return _file(text)
    if text in GRAPHS:
        return [Source(text, str(graph_path(text)))]
    if folder:
        raise ParameterError(f"{name}: is a folder; write a pattern such as {Path(name, '*.csv')}")
    if not has_magic(text):
        raise FormatError(f"{name}: no such file; check the path")
    mine = {os.path.realpath(one) for one in own}
    matches = sorted(glob(text, recursive=True))  # noqa: PTH207 - Path.glob takes no absolute patterns
    files = [one for one in matches if Path(one).is_file() and os.path.realpath(one) not in mine]
    if not files:
        raise FormatError(f"{name}: no file matches this pattern; check it, and quote it for the shell")
    return [source for one in files for source in _file(one)]


def _file(text: str) -> list[Source]:
    path = os.path.normpath(text)
    return _members(path, Ensemble.read(path)) if path.lower().endswith(".toml") else [Source(path, path)]


def _members(name: str, ensemble: Ensemble) -> list[Source]:
    return [Source(f"{name}#{i}", (ensemble, i)) for i in range(len(ensemble))]


def write_graphs(sources: Any, folder: str | os.PathLike[str]) -> int:
    """Write the graphs of ensembles as CSV files ``<spec>-<i>.csv`` into a folder, which is made, and return how many.

    Parameters
    ----------
    sources : path of a ``.toml`` file, Ensemble, or a sequence of these
    folder : path

    Raises
    ------
    ParameterError
        A source is no ensemble, or the folder cannot be made.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     write_graphs(Ensemble(count=2, nodes=5), folder), sorted(path.name for path in Path(folder).iterdir())
    (2, ['ensemble-0.csv', 'ensemble-1.csv'])
    """
    chosen = _sources(sources, ())
    for source in chosen:
        if not isinstance(source.origin, tuple):
            raise ParameterError(f"{shorten(source.name, 200)}: is a graph already; only those of a .toml are written")
    try:
        Path(folder).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ParameterError(f"{shorten(os.fspath(folder), 200)}: cannot make this folder ({error.strerror})") from None
    for source in chosen:
        assert isinstance(source.origin, tuple)
        ensemble, i = source.origin
        stem, digits = Path(source.name.rpartition("#")[0]).stem, len(str(len(ensemble) - 1))
        write_graph(ensemble.graph(i), Path(folder, f"{stem}-{i:0{digits}d}.csv"))
    return len(chosen)


# ---------------------------------------------------------------------- one row


def certified_row(name: str, payload: Any, settings: Settings) -> Row:
    """Return the row of one graph; whatever goes wrong is told in it.

    Parameters
    ----------
    name : str
    payload : bytes, pair (Ensemble, int), SignedDigraph or PTCCError
        The content of a file, or what stands for a graph, or why there is none.
    settings : Settings
    """
    began = time.perf_counter()
    row: Row = dict.fromkeys(COLUMNS)
    row["graph"] = _unicode(name)
    try:
        with _ONE_AT_A_TIME:
            graph = _graph(name, payload, settings)
            negative = int((graph.sign < 0).sum())
            row |= {"sha256": graph.sha256, "nodes": graph.n_nodes, "edges": graph.n_edges, "negative": negative}
            row["seed"] = settings.seed_of(graph)
            row |= _columns(_certificate(graph, settings, row["seed"]), settings)
    except PTCCError as error:
        row["error"] = _one_line(str(error))
    except MemoryError:
        row["error"] = "not enough memory for a graph of this size"
    except OverflowError:
        row["error"] = "a number is beyond the range of float64; choose other units of time, weight or state"
    except Exception as error:
        at = traceback.extract_tb(error.__traceback__)[-1]
        where = f"{Path(at.filename).name}, line {at.lineno}"
        row["error"] = f"a defect of this program ({type(error).__name__} in {where}), please report it"
    row["seconds"] = round(time.perf_counter() - began, 6)
    return row


def _graph(name: str, payload: Any, settings: Settings) -> SignedDigraph:
    if isinstance(payload, PTCCError):
        raise payload
    if isinstance(payload, SignedDigraph):
        return payload
    if isinstance(payload, tuple):
        ensemble, i = payload
        return ensemble.graph(i)
    file = io.BytesIO(payload)
    file.name = name  # its ending tells the format
    return read_graph(
        file,
        orientation=settings.orientation,
        duplicates=settings.duplicates,
        drop_self_loops=settings.drop_self_loops,
        undirected=settings.undirected,
    )


def _certificate(graph: SignedDigraph, settings: Settings, seed: int) -> Certificate:
    more: dict[str, Any] = {}
    if isinstance(settings.protocol, SlidingModeProtocol):
        more["sigma0"] = _start(settings.sigma0, [seed, 1], graph)
        more["disturbance"] = settings.disturbance_of(graph.n_nodes, seed)
    return certify(
        graph,
        settings.protocol,
        _start(settings.x0, seed, graph),
        method=settings.method,
        simulation=settings.simulation,
        starts=settings.initial_bound,
        **more,
    )


def _start(start: Start, seed: Any, graph: SignedDigraph) -> Any:
    if not isinstance(start, str):
        return start
    if start != "random":
        return [Fraction(0)] * graph.n_nodes if start.strip() == "0" else read_state(start, graph)
    # As `ptcc certify --x0 random --seed SEED` draws it, and --sigma0 random with the seed [SEED, 1].
    thousandths = np.random.default_rng(seed).integers(-10_000, 10_001, size=(graph.n_nodes, 1))
    return [Fraction(int(x), 1000) for x in thousandths[:, 0]]


def _columns(certificate: Certificate, settings: Settings) -> Row:
    structure, effort, seen = certificate.structure, certificate.effort, certificate.comparison
    rate, limit = certificate.rate, certificate.rate_limit
    result, reaching = certificate.outcome, certificate.reaching
    return {
        "connectivity": structure.connectivity,
        "components": len(structure.components),
        "leaders": int(structure.leaders.size),
        "followers": int(structure.followers.size),
        "closed_components": len(structure.closed_components),
        "balanced_leaders": sum(c.balanced for c in structure.closed_components),
        "balanced": structure.balanced,
        "theorem": "; ".join(dict.fromkeys(claim.theorem for claim in certificate.claims)),
        "behaviour": "; ".join(dict.fromkeys(claim.behaviour for claim in certificate.claims)),
        "verdict": certificate.verdict,
        "asked": _asked(certificate, settings),
        "rate": _down(rate),
        "rate_limit": _up(limit),
        "tightness": None if rate is None or not limit else _down(rate / limit),
        "fastest": None if rate is None else certificate.fastest[2],
        "prefactor": _up(certificate.prefactor),
        "paper_rate": _down(certificate.proof.rate),
        "diagonal_rate": _down(certificate.diagonal_rate),
        "input_bounded": None if effort is None else effort.bounded,
        "peak_input": None if effort is None or effort.peak is None else _up(Fraction(effort.peak.largest)),
        "largest_outcome": None if result is None else _finite(float(np.abs(result.values).max())),
        "degenerate": None if result is None else bool(result.degenerate),
        "reaching_time": None if reaching is None else max(r.time for r in reaching),
        "worst_ratio": None if seen is None else _finite(seen.worst_ratio),
        "bound_kept": None if seen is None else not seen.violated,
        "obligations": len(certificate.obligations),
        "note": _one_line("; ".join(certificate.notes)) or None,
    }


def _asked(certificate: Certificate, settings: Settings) -> str | None:
    """Tell whether what was asked for holds: the behaviour by its theorem, the rate by proof."""
    if settings.expect is None and settings.min_rate is None:
        return None
    if settings.expect is not None and not certificate.structure.holds(settings.expect):
        return REFUTED
    if settings.min_rate is None or certificate.constant:
        return HOLDS
    if certificate.rate is not None and certificate.rate >= settings.min_rate:
        return HOLDS
    limit = certificate.rate_limit
    return REFUTED if limit is not None and settings.min_rate > limit else UNDECIDED


def _down(x: Fraction | None) -> float | None:
    """Round a proved number so that it stays true as a lower bound; None beyond float64."""
    return None if x is None else _directed(x, -math.inf)


def _up(x: Fraction | None) -> float | None:
    return None if x is None else _directed(x, math.inf)


def _directed(x: Fraction, towards: float) -> float | None:
    try:
        nearest = x.numerator / x.denominator
    except OverflowError:
        return None
    wrong = Fraction(nearest) > x if towards < 0 else Fraction(nearest) < x
    return _finite(math.nextafter(nearest, towards)) if wrong else nearest


def _finite(x: float) -> float | None:
    return float(x) if math.isfinite(x) else None


def _unicode(name: str) -> str:
    """Write what is no character in the name of a file as an escape code."""
    return name.encode("utf-8", "backslashreplace").decode("utf-8")


def _one_line(text: str) -> str:
    return "".join(c if c.isprintable() else "?" for c in " ".join(text.split()))


# ---------------------------------------------------------------------- where rows are computed


def _on_processes(tasks: Iterator[_Task], settings: Settings, workers: int) -> Generator[tuple[_Task, Row]]:
    """Compute rows in processes of this machine.

    A process that dies breaks the pool and all that is under way. Those graphs are tried again one at a time, so that
    the one to blame is found, and the others lose nothing.
    """
    try:
        from joblib.externals.loky import ProcessPoolExecutor
    except ImportError:
        raise ParameterError(f"several workers need joblib; {MEND}, or say --workers 1") from None

    def start() -> Any:
        return ProcessPoolExecutor(workers, timeout=IDLE, initializer=_attend, initargs=(os.getpid(),), env=ONE_THREAD)

    pool = start()
    under_way: dict[Future[Row], _Task] = {}
    suspects: deque[_Task] = deque()
    try:
        while True:
            broken, room = False, 1 if suspects else AHEAD * workers
            while len(under_way) < room and not broken:
                task = suspects.popleft() if suspects else next(tasks, None)
                if task is None:
                    break
                try:
                    under_way[pool.submit(certified_row, task.name, task.payload, settings)] = task
                except BrokenExecutor:  # by a graph that is under way, or by one whose row was just taken
                    suspects.append(task)
                    broken = True
            if not under_way and not broken:
                return
            alone = len(under_way) == 1 and not broken
            for future in wait(under_way, return_when=FIRST_COMPLETED).done:
                task = under_way.pop(future)
                try:
                    row = future.result()
                except BrokenExecutor:
                    broken = True
                    if not alone:
                        suspects.append(task)
                        continue
                    row = _lost(task.name, "the process that worked on it died, perhaps for lack of memory")
                yield task, row
            if broken:
                suspects.extend(under_way.values())
                under_way.clear()
                pool.shutdown(kill_workers=True)
                pool = start()
    finally:
        pool.shutdown(kill_workers=True)


def _attend(parent: int) -> None:
    """Leave Ctrl-C, which a terminal sends to every process, to the parent, and end with it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def follow() -> None:
        while os.getppid() == parent:
            time.sleep(1)
        os._exit(1)

    if os.name == "posix":  # elsewhere a process keeps the number of its parent, and ends when it is idle
        threading.Thread(target=follow, daemon=True).start()


def _lost(name: str, why: str) -> Row:
    return dict.fromkeys(COLUMNS) | {"graph": _unicode(name), "seconds": 0.0, "error": why}


def _on_dask(tasks: Iterator[_Task], settings: Settings, scheduler: str) -> Generator[tuple[_Task, Row]]:
    """Compute rows on the workers of a Dask cluster, a few ahead for each of their threads."""
    try:
        from distributed import Client, as_completed
    except ImportError:
        raise ParameterError(f"a scheduler needs Dask; {MEND}") from None
    where = shorten(scheduler, 100)
    try:
        client = Client(scheduler, timeout=PATIENCE, set_as_default=False)
    except Exception as error:
        reason = shorten(_one_line(str(error)), 100) or type(error).__name__
        raise ParameterError(f"{where}: no Dask scheduler answers ({reason}); check the address") from None
    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # what matters is told in one line below
    with client:
        _refuse_workers(client, where)
        under_way: dict[Any, _Task] = {}
        done = as_completed(loop=client.loop)
        room, asked = 0, -math.inf
        while True:
            if time.monotonic() > asked + 1:  # workers come and go
                room, asked = AHEAD * max(sum(client.nthreads().values()), 1), time.monotonic()
            while len(under_way) < room and (task := next(tasks, None)) is not None:
                future = client.submit(certified_row, task.name, task.payload, settings, pure=False)
                under_way[future] = task
                done.add(future)
            if not under_way:
                return
            future = next(done)
            task = under_way.pop(future)
            try:
                row = future.result()
            except CancelledError:
                raise ParameterError(f"{where}: the scheduler was lost; start it again, and the same command") from None
            except Exception as error:
                row = _lost(
                    task.name, f"the worker failed ({type(error).__name__}: {shorten(_one_line(str(error)), 200)})"
                )
            del future  # frees the row on the worker
            yield task, row


def _refuse_workers(client: Any, where: str) -> None:
    """Refuse a cluster without workers, or with workers of another version."""
    try:
        client.wait_for_workers(1, timeout=PATIENCE)
        versions = client.run(_version)
    except TimeoutError:
        raise ParameterError(f"{where}: this scheduler has no workers; start some: dask worker {where}") from None
    except Exception as error:
        reason = shorten(_one_line(str(error)), 100)
        raise ParameterError(f"{where}: the workers have no ptcc-certify like this one ({reason})") from None
    for worker, version in versions.items():
        if version != _version():
            raise ParameterError(f"{worker}: has ptcc-certify {version}, not {_version()}; install the same version")


def _version() -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("ptcc-certify")
    except PackageNotFoundError:
        return "unknown"


# ---------------------------------------------------------------------- the table


def table_bytes(rows: Sequence[Row], suffix: str) -> bytes:
    """Return a table as CSV or Parquet; an empty entry is an empty field, or null.

    Examples
    --------
    >>> table_bytes([], ".csv")[:18]
    b'graph,sha256,nodes'
    """
    if suffix == ".parquet":
        pa, parquet = _pyarrow()
        kinds = {str: pa.string(), int: pa.int64(), float: pa.float64(), bool: pa.bool_()}
        schema = pa.schema([(name, kinds[kind]) for name, kind in COLUMNS.items()])
        sink = pa.BufferOutputStream()
        parquet.write_table(pa.Table.from_pylist(list(rows), schema=schema), sink)
        return sink.getvalue().to_pybytes()
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows([_field(row[name]) for name in COLUMNS] for row in rows)
    return text.getvalue().encode("utf-8")


def _field(value: Any) -> str:
    if value is None:
        return ""
    return str(value).lower() if isinstance(value, bool) else str(value)


def _pyarrow() -> tuple[Any, Any]:
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError:
        raise ParameterError(f"Parquet needs pyarrow; {MEND}, or name a .csv file") from None
    return pyarrow, parquet


def _refuse_table(path: Path, chosen: Sequence[Source], restart: bool) -> None:
    """Refuse before the work what could not, or should not, be written after it."""
    name = shorten(os.fspath(path), 200)
    if path.suffix.lower() not in TABLES:
        raise ParameterError(f"{name}: tables are written to {' and '.join(TABLES)}; let the name end in one of these")
    if path.suffix.lower() == ".parquet":
        _pyarrow()
    if not path.parent.is_dir():
        raise ParameterError(f"{name}: the folder does not exist; make it first")
    if path.is_dir():
        raise ParameterError(f"{name}: is a folder; name a file")
    if any(isinstance(s.origin, str) and os.path.realpath(s.origin) == os.path.realpath(path) for s in chosen):
        raise ParameterError(f"{name}: is one of the graphs; name another file")
    if path.exists() and not _is_table(path):
        raise ParameterError(f"{name}: is there already, and no table of ptcc batch; name another file")
    # A table that is being replaced has a journal.
    if path.exists() and not restart and not _journal_path(path).exists():
        raise ParameterError(f"{name}: is there already; name another file, or replace it with --restart")


def _is_table(path: Path) -> bool:
    if path.suffix.lower() == ".parquet":
        try:
            return list(_pyarrow()[1].read_schema(path).names) == list(COLUMNS)
        except (OSError, ValueError):
            return False
    header = table_bytes([], ".csv")
    with path.open("rb") as file:
        return file.read(len(header)) == header


# ---------------------------------------------------------------------- the journal


def _journal_path(path: Path) -> Path:
    return path.with_name(f"{path.name}.journal")


def _header(chosen: Sequence[Source], settings: Settings) -> dict[str, Any]:
    """Return what the first line of a journal holds: everything that the rows depend on."""
    digest = hashlib.sha256()
    known: dict[int, str] = {}
    for source in chosen:
        mark = ""
        if isinstance(source.origin, SignedDigraph):
            mark = source.origin.sha256
        elif isinstance(source.origin, tuple):
            ensemble = source.origin[0]
            mark = known.setdefault(id(ensemble), json.dumps(ensemble.to_dict(), sort_keys=True))
        digest.update(f"{json.dumps([source.name, mark])}\n".encode())
    graphs = {"graphs": len(chosen), "list": digest.hexdigest()}
    return {"schema": SCHEMA, "version": _version(), **graphs, **settings.to_dict()}


def _plain(value: Any) -> Any:
    """Return a setting as JSON takes it."""
    if isinstance(value, Protocol):
        return value.to_dict()
    if isinstance(value, Fraction):
        return format_exact(value)
    if isinstance(value, Mapping):
        return {str(key): _plain(x) for key, x in value.items()}
    if isinstance(value, str | int | None):
        return value
    if hasattr(value, "__len__"):
        return [_plain(x) for x in value]
    return _plain(as_fraction(value))


class _Journal:
    """Rows as they come, one JSON object per line, the first of which holds the settings; locked while it is open.

    A batch that is killed leaves whole lines and perhaps part of one, which is dropped.
    """

    def __init__(self, path: Path, header: dict[str, Any], restart: bool):
        self.path, self.name = path, shorten(os.fspath(path), 200)
        self._file = _opened_alone(path, self.name)
        self._rows: dict[int, tuple[str | None, Row]] = {}
        try:
            self._read(header, restart)
        except BaseException:
            self.close()
            raise

    def _read(self, header: dict[str, Any], restart: bool) -> None:
        data = self._file.read()
        whole = data.rfind(b"\n") + 1
        lines = data[:whole].splitlines()
        mark = json.dumps({"schema": SCHEMA}).encode()[:-1]  # how the first line begins, of which a part may be missing
        if data[: len(mark)] != mark[: len(data)]:
            raise ParameterError(f"{self.name}: is no journal of ptcc batch; name another -o")
        whole = 0 if restart else whole
        self._file.seek(whole)
        self._file.truncate()
        if not whole:
            self._write(header)
            return
        self._refuse_other(self._object(1, lines[0]), header)
        for number, line in enumerate(lines[1:], start=2):
            entry = self._object(number, line)
            try:
                place, fingerprint, row = entry["number"], entry["file"], entry["row"]
                intact = 0 <= place < header["graphs"] and list(row) == list(COLUMNS)
            except (KeyError, TypeError):
                intact = False
            if not intact:
                raise ParameterError(f"{self.name}, line {number}: is no row; begin again with --restart")
            self._rows[place] = fingerprint, row

    def _object(self, number: int, line: bytes) -> dict[str, Any]:
        try:
            entry = json.loads(line)
        except ValueError:
            entry = None
        if isinstance(entry, dict):
            return entry
        raise ParameterError(f"{self.name}, line {number}: is no row; begin again with --restart")

    def _refuse_other(self, old: dict[str, Any], new: dict[str, Any]) -> None:
        mend = "go on with that, name another -o, or drop the journal with --restart"
        for key in new:
            if key == "list" and old.get(key) != new[key]:
                raise ParameterError(f"{self.name}: was begun with other graphs; {mend}")
            if old.get(key) != new[key]:
                before, now = (shorten(json.dumps(x), 60) for x in (old.get(key), new[key]))
                raise ParameterError(f"{self.name}: was begun with {key} {before}, not {now}; {mend}")

    def current(self, chosen: Sequence[Source]) -> dict[int, Row]:
        """Return the rows whose files are what they were."""
        return {n: row for n, (mark, row) in self._rows.items() if chosen[n].fingerprint == mark}

    def append(self, number: int, fingerprint: str | None, row: Row) -> None:
        """Keep a row."""
        self._write({"number": number, "file": fingerprint, "row": row})

    def _write(self, entry: dict[str, Any]) -> None:
        self._file.write(json.dumps(entry, allow_nan=False).encode() + b"\n")
        self._file.flush()

    def remove(self) -> None:
        """Delete the journal, whose rows are in the table."""
        if os.name == "nt":  # where an open file cannot be deleted
            self.close()
        self.path.unlink(missing_ok=True)

    def close(self) -> None:
        """Release the journal."""
        self._file.close()


def _opened_alone(path: Path, name: str) -> IO[bytes]:
    """Open a file to be read and continued, and lock it; the lock ends with the process, however that ends."""
    for _ in range(10):
        try:
            file = path.open("r+b") if path.exists() else path.open("x+b")
        except (FileExistsError, FileNotFoundError):
            continue  # another process was faster
        except OSError as error:
            raise ParameterError(f"{name}: cannot be written ({error.strerror})") from None
        try:
            _lock(file)
        except BlockingIOError:
            file.close()
            raise ParameterError(f"{name}: another process is at work on it; wait for it, or name another -o") from None
        if path.exists() and os.path.samestat(os.fstat(file.fileno()), path.stat()):
            return file
        file.close()  # the other process finished in between
    raise ParameterError(f"{name}: cannot be opened; remove what is there, or name another -o")


def _lock(file: IO[bytes]) -> None:
    if sys.platform == "win32":
        import msvcrt

        file.seek(2**40)  # a byte beyond all content: a locked one could not be read
        try:
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        except OSError:
            raise BlockingIOError from None
        file.seek(0)
        return
    import fcntl

    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise
    except OSError:
        pass  # some network file systems know no locks


__all__ = ["COLUMNS", "Row", "Settings", "certify_many", "write_graphs"]
