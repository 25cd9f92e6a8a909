"""What a batch is of: settings that all rows depend on, and sources, one for each graph, with what a worker is sent."""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Hashable, Iterator, Mapping, Sequence, Set, ValuesView
from dataclasses import asdict, dataclass, field
from fractions import Fraction
from glob import glob, has_magic
from pathlib import Path
from typing import Any, NamedTuple

from ptcc_certify.errors import FormatError, NumberError, ParameterError, PTCCError, gated, unknown_parameter
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.ensembles import Ensemble
from ptcc_certify.graphs.io import as_graph, by_label, read_graph
from ptcc_certify.graphs.io.files import read_bytes
from ptcc_certify.graphs.io.packaged import GRAPHS, file_or_packaged, graph_path
from ptcc_certify.graphs.rationals import as_fraction, format_exact, shorten, whole_number
from ptcc_certify.graphs.reading import OPTIONS, Reading
from ptcc_certify.graphs.structure import behaviour_name
from ptcc_certify.model import Protocol
from ptcc_certify.model.asks import Asks, Case, InitialState
from ptcc_certify.model.base import refuse_no_protocol
from ptcc_certify.model.disturbance import as_disturbance
from ptcc_certify.model.parameters import parameter
from ptcc_certify.model.refusals import refuse_before_the_graph

#: Where a graph comes from: a path, an ensemble and a number in it, or the graph itself; or why there is none.
Origin = str | tuple[Ensemble, int] | SignedDigraph | PTCCError


class Task(NamedTuple):
    """What a worker needs to make a row, besides the settings, and what the batch keeps with it."""

    number: int
    name: str
    payload: Any
    mark: str


@dataclass(frozen=True, slots=True)
class Source:
    """Where a graph comes from: a path, an ensemble and a number in it, or the graph itself; or why there is none.

    Sources of one ``key`` are one graph; their names may differ, and those of different graphs may be equal. ``mark``
    tells what graph it is, whatever else is in the list; that of a file, ``""`` here, depends on its content.
    """

    name: str
    origin: Origin
    key: Hashable
    mark: str = ""

    def task(self, number: int) -> Task:
        """Return the task of this graph, the ``number``-th of a batch; of one that cannot be read with the reason."""
        if not isinstance(self.origin, str):
            return Task(number, self.name, self.origin, self.mark)
        name, path = shorten(self.name, 200), Path(self.origin)
        try:
            # Whoever opens a pipe may wait for ever; a path that is missing is told by read_bytes.
            if os.path.exists(path) and not os.path.isfile(path):  # noqa: PTH110, PTH113 - those of Path may raise
                raise FormatError(f"{name}: is no regular file; save the graph as one")
            data = read_bytes(path, name)  # a Path: the file "-" is not standard input
        except PTCCError as error:
            return Task(number, self.name, error, f"{self.named} unreadable")
        return Task(number, self.name, data, f"{self.named} {hashlib.sha256(data).hexdigest()}")

    @property
    def named(self) -> str:
        """How the mark of a file begins: what is wrong with a file is told with its name."""
        return f"file {self.name}"


def chosen_sources(sources: Any, reading: Reading, own: Sequence[Path] = ()) -> list[Source]:
    """Return what ``sources`` stand for, each once; patterns leave out the files that the batch writes itself.

    What is wrong with a graph of a list is an error of its row; a graph or a path alone is refused.
    """
    several = Sequence | Set | Mapping | ValuesView | Iterator  # graphs, matrices and tables are none of these
    alone = isinstance(sources, str) or not isinstance(sources, several)
    sources = [sources] if alone else sources if isinstance(sources, Mapping) else list(sources)
    selection: dict[Hashable, Source] = {}
    graphs = ensembles = 0
    named = sources if isinstance(sources, Mapping) else {}
    for name, graph in named.items():
        graph = _given(graph, reading, alone)
        key = ("named", str(name))
        selection[key] = Source(str(name), graph, key, _mark_of_graph(graph))
    for source in () if named else sources:
        if isinstance(source, Ensemble):
            ensembles += 1
            name = "ensemble" if ensembles == 1 else f"ensemble{ensembles}"
            own_sources = _graphs_of(name, source, ("ensemble", ensembles))
        elif isinstance(source, str | os.PathLike):
            own_sources = _expand(os.fspath(source), own, len(sources) == 1)
        else:
            graph = _given(source, reading, alone)
            own_sources = [Source(f"graph#{graphs}", graph, ("graph", graphs), _mark_of_graph(graph))]
            graphs += 1
        for one in own_sources:
            selection.setdefault(one.key, one)
    if not selection:
        raise ParameterError("there are no graphs; name files or patterns")
    if reading != Reading() and all(isinstance(one.origin, tuple) for one in selection.values()):
        raise ParameterError(f"{', '.join(asdict(reading))} tell how files are read; ensembles have keys of their own")
    return list(selection.values())


def _given(graph: Any, reading: Reading, alone: bool) -> SignedDigraph | PTCCError:
    """Return a graph that has a name, or is in memory, or of one of several why it is none.

    Of a graph in memory only its orientation can be told.
    """
    file = isinstance(graph, str | os.PathLike)
    for name in () if file else OPTIONS[1:]:
        if getattr(reading, name) != getattr(Reading, name):
            raise ParameterError(f"{name} tells how files are read; beside graphs in memory leave it out")
    try:
        if file:
            return read_graph(file_or_packaged(os.fspath(graph)), **asdict(reading))
        return as_graph(graph, reading.orientation)
    except ParameterError:  # a setting of the batch
        raise
    except PTCCError as error:
        if alone:
            raise
        return error


def _expand(text: str, own: Sequence[Path], alone: bool) -> list[Source]:
    """Return what a text stands for."""
    name, path = shorten(text, 200), Path(text)
    try:
        exists, folder = path.exists(), path.is_dir()
    except (OSError, ValueError):  # a name that no file can have
        exists = folder = False
    if exists and not folder:
        if not path.is_file():
            raise FormatError(f"{name}: is no regular file; save the graph as one")
        return _file(text)
    if text in GRAPHS:
        file = str(graph_path(text))
        return [Source(text, file, ("file", os.path.realpath(file)))]
    if folder:
        raise ParameterError(f"{name}: is a folder; write a pattern such as {Path(name, '*.csv')}")
    if not has_magic(text):
        if alone or text.lower().endswith(".toml"):  # of how many graphs is not known
            raise FormatError(f"{name}: no such file; check the path")
        return _file(text)
    mine = {os.path.realpath(one) for one in own}
    matches = sorted(glob(text, recursive=True))  # noqa: PTH207 - Path.glob takes no absolute patterns
    # Links to nowhere stay: each is a row that tells so.
    files = [one for one in matches if not os.path.isdir(one) and os.path.realpath(one) not in mine]  # noqa: PTH112
    if not files:
        raise FormatError(f"{name}: no file matches this pattern; check it, and quote it for the shell")
    return [source for one in files for source in _file(one)]


def _file(text: str) -> list[Source]:
    """Return what a file, or a link to nowhere, stands for; of ``link/..`` the system knows best what it means."""
    name, key = re.sub(r"^(?:\./+)+", "", text), ("file", os.path.realpath(text))
    if name.lower().endswith(".toml") and os.path.isfile(text):  # noqa: PTH113 - Path.is_file may raise
        return _graphs_of(name, Ensemble.read(text), key)
    return [Source(name, text, key)]


def _graphs_of(name: str, ensemble: Ensemble, key: Hashable) -> list[Source]:
    mark = hashlib.sha256(json.dumps(ensemble.to_dict(), sort_keys=True).encode()).hexdigest()
    return [Source(f"{name}#{i}", (ensemble, i), (key, i), f"ensemble {mark} {i}") for i in range(len(ensemble))]


def _mark_of_graph(graph: SignedDigraph | PTCCError) -> str:
    """Tell a graph from others, and from itself with its nodes in another order, which initial states obey."""
    if isinstance(graph, PTCCError):
        return f"no graph: {graph}"
    order = hashlib.sha256(json.dumps(graph.labels).encode()).hexdigest()
    return f"graph {graph.sha256} {order}"


#: What an initial state may be given as.
StateLike = str | Sequence[Any] | Mapping[Any, Any] | None
#: Seeds and numbers of workers are at most this.
LARGEST_SETTING = 2**64 - 1
#: How to get the packages that several workers, Dask and Parquet need.
INSTALL = 'install it with: pip install "ptcc-certify[batch]"'


@gated
@dataclass(frozen=True)
class Settings:
    """Everything that a row depends on besides its graph.

    Attributes
    ----------
    protocol : NominalProtocol or SlidingModeProtocol
    x0 : "random", str, sequence of numbers, mapping, pandas Series or None
        ``"random"``: an initial state of its own for every graph, uniform on [-10, 10] to three decimals, a function
        of ``seed`` and the graph. Otherwise as in :func:`ptcc_certify.certify`, the same for all; a graph that it does
        not fit has an error.
    seed : int
        Of random initial states and telegraph signals.
    sigma0 : "random", str, sequence of numbers, mapping, pandas Series or None
        Sliding mode: the sliding variables at 0, like ``x0``; None: 0.
    disturbance : str, optional
        Sliding mode: what a simulated run meets, an expression of ``k`` and ``t`` or a name; the worst-case disturbance
        by default.
    method : {"best", "paper", "perron", "lmi", "full"}
        As in :func:`ptcc_certify.certify`.
    simulation : bool or None
        Compare with CVODES runs; None: of up to 10,000 agents.
    initial_bound : positive number, optional
        Bound the input for all initial states with ``|x_k(0)| <= initial_bound`` instead of ``x0``.
    expect : str, optional
        A behaviour that every graph should show.
    min_rate : positive number, optional
        A rate that should be proved for every graph, per unit of the stretched clock.
    time_limit : positive number, optional
        Seconds for each graph, as in :func:`ptcc_certify.certify`; the column ``cut_off`` names what they ended.
    reading : Reading
        How files are read.

    Raises
    ------
    ParameterError
        A setting is outside its domain.

    Examples
    --------
    >>> Settings.of(NominalProtocol(T=1, rho1=1, rho2=1, kappa=2), seed=3, undirected=True).reading.undirected
    True
    """

    protocol: Protocol
    x0: StateLike = "random"
    seed: int = 0
    sigma0: StateLike = None
    disturbance: str | None = None
    method: str = "best"
    simulation: bool | None = False
    initial_bound: Fraction | None = None
    expect: str | None = None
    min_rate: Fraction | None = None
    time_limit: Fraction | None = None
    reading: Reading = field(default_factory=Reading)

    @classmethod
    def of(cls, protocol: Protocol, **settings: Any) -> Settings:
        """Return the settings of these keywords: the names of the fields, and those of :class:`Reading`."""
        known = [*list(cls.__dataclass_fields__)[1:-1], *Reading.__dataclass_fields__]
        if unknown := next((name for name in settings if name not in known), None):
            if unknown in ("uncertainty", "signal"):
                value = '"20%"' if unknown == "uncertainty" else "..."
                mend = f"one graph each: [ptcc.certify(g, p, {unknown}={value}) for g in graphs]"
                raise ParameterError(f"certify_many has no parameter {unknown}, which makes families; {mend}")
            raise ParameterError(unknown_parameter("certify_many", unknown, known))
        reading = {name: settings.pop(name) for name in Reading.__dataclass_fields__ if name in settings}
        return cls(protocol, **settings, reading=Reading(**reading))

    def __post_init__(self) -> None:
        refuse_no_protocol(self.protocol)
        one_node = SignedDigraph.from_edges([], nodes=["1"])  # what certify refuses of it, it refuses of every graph
        asks = Asks(method=self.method, disturbance=self.disturbance)
        refuse_before_the_graph(Case(one_node, self.protocol, InitialState(sigma0=self.sigma0), asks=asks))
        self.disturbance_of(1)  # refuses an expression that cannot be read, before the work
        values: dict[str, Any] = {
            "seed": whole_number(self.seed, "seed", 0, LARGEST_SETTING),
            "x0": _as_initial_state(self.x0, "x0"),
            "sigma0": _as_initial_state(self.sigma0, "sigma0"),
        }
        for name, unit in (("initial_bound", ""), ("min_rate", ""), ("time_limit", ", in seconds")):
            if getattr(self, name) is not None:
                try:
                    values[name] = parameter(name, getattr(self, name))
                except ParameterError as error:
                    raise ParameterError(f"{error}{unit}") from None
        if self.expect is not None:
            try:
                values["expect"] = behaviour_name(self.expect)
            except ValueError as error:
                raise ParameterError("expect", f"{error}") from None
        vars(self).update(values)

    def to_dict(self) -> dict[str, Any]:
        """Return the settings as JSON takes them."""
        entries = vars(self) | vars(self.reading)
        return {name: _plain(value) for name, value in entries.items() if name != "reading"}

    def seed_of(self, graph: SignedDigraph) -> int:
        """Return the seed of a graph's own random initial state: 32 bits of a hash of ``seed`` and the graph."""
        return int.from_bytes(hashlib.sha256(f"{self.seed} {graph.sha256}".encode()).digest()[:4], "big")

    def disturbance_of(self, n: int, seed: int = 0) -> Any:
        """Return the disturbance of ``n`` agents, which a simulated run meets; None in the nominal protocol."""
        if self.protocol.reaching is None:
            return None
        text = "worst-case" if self.disturbance is None else self.disturbance
        return as_disturbance(text, n, self.protocol.reaching.delta, 2 * float(self.protocol.T), seed)


def _as_initial_state(initial_state: StateLike, name: str) -> StateLike:
    """Return an initial state as a row takes it; refuse a file, and what is no number."""
    if (by_node := by_label(initial_state, name)) is not None:
        initial_state = by_node
    if isinstance(initial_state, str) and os.path.isfile(initial_state):  # noqa: PTH113 - Path.is_file may raise
        raise ParameterError(f'{name} = "{shorten(initial_state)}" is a file; for a batch give numbers, or random')
    try:
        _plain(initial_state)
    except NumberError as error:
        raise ParameterError(name, f"{error}") from None
    return initial_state


def _plain(value: Any) -> Any:
    """Return a setting as JSON takes it."""
    if isinstance(value, Protocol):
        return value.to_dict()
    if isinstance(value, Fraction):
        return format_exact(value)
    if isinstance(value, Mapping):
        return {str(key): _plain(x) for key, x in value.items()}
    if isinstance(value, int):
        format_exact(Fraction(value))  # refuses one that is too long to be written
    if isinstance(value, str | int | None):
        return value
    if hasattr(value, "__len__"):
        return [_plain(x) for x in value]
    return _plain(as_fraction(value))
