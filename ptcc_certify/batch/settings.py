"""The settings: everything that a row depends on besides its graph, checked before the work."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

from ptcc_certify.errors import NumberError, ParameterError, gated, unknown_parameter
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.io import by_label
from ptcc_certify.graphs.rationals import as_fraction, format_exact, shorten, whole_number
from ptcc_certify.graphs.reading import Reading
from ptcc_certify.graphs.structure import behaviour_name
from ptcc_certify.model import Protocol
from ptcc_certify.model.asks import Asks, Case, InitialState
from ptcc_certify.model.base import refuse_no_protocol
from ptcc_certify.model.disturbance import as_disturbance
from ptcc_certify.model.parameters import parameter
from ptcc_certify.model.refusals import refuse_before_the_graph

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
