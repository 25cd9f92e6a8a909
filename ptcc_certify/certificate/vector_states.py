"""Vector-valued states: the protocol acts on each component alike, so that each has a certificate of its own."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from lmi.exact.decimal_rounding import down, float_up
from ptcc_certify.bounds.envelope import Comparison
from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.certificate.procedure import certify
from ptcc_certify.certificate.verdict import CERTIFIED
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.io import as_graph, as_states
from ptcc_certify.graphs.io.files import refuse_no_path
from ptcc_certify.graphs.rationals import shorten
from ptcc_certify.protocols import Protocol
from ptcc_certify.simulation.trajectory import Trajectory

#: Room for the rounding of a norm in floating point.
_MORE = 1 + 1e-12


@dataclass(frozen=True, repr=False)
class VectorCertificate:
    """Certificates of the S components of vector-valued states, made by :func:`certify_vectors`.

    The protocol acts as ``L kron I_S``: every component moves by itself, and ``||E||_F^2``, the sum over the
    components, obeys the rate that holds for each.

    Attributes
    ----------
    components : tuple of S Certificate
        Each is one that ``ptcc check`` verifies by itself.

    Examples
    --------
    >>> certs = certify_vectors([("a", "b", -1), ("b", "a", -1)], NominalProtocol(), [[3, 1], [1, 5]])
    >>> certs
    VectorCertificate(2 components, signed-average consensus, rate 3.99999, certified)
    >>> certs.final_state
    array([[ 1., -2.],
           [-1.,  2.]])
    >>> certs.norm_bound([1.0]) >= np.hypot(*(one.norm_bound([1.0]) for one in certs))
    array([ True])
    """

    components: tuple[Certificate, ...]

    @property
    def claim(self) -> Any:
        """What is claimed of every component; None if the graph is disconnected."""
        return self.components[0].claim

    @property
    def verdict(self) -> str:
        """``certified`` if every component is, otherwise ``undecided``."""
        return next((one.verdict for one in self.components if one.verdict != CERTIFIED), CERTIFIED)

    @property
    def rate(self) -> Fraction | None:
        """The largest rate that is proved of every component; None if one has none."""
        rates = [one.rate for one in self.components]
        return None if None in rates else min(rate for rate in rates if rate is not None)

    @property
    def final_state(self) -> np.ndarray:
        """(N, S) float64 array; the exact one of component j is ``components[j].final_state``."""
        return np.column_stack([np.asarray(one.final_state) for one in self.components if one.final_state is not None])

    @property
    def peak_input(self) -> np.ndarray | None:
        """(N,) array: proved bound of ``||u_k(t)||_2`` at all times; None where none is proved, or under limits.

        With what disturbances within ``delta`` of the nominal protocol add, if they were asked for.
        """
        peaks = []
        for one in self.components:
            if one.effort is None or one.effort.peak is None or one.limits:
                return None
            disturbed = one.effort.disturbed
            if one.delta is not None and disturbed is None:
                return None
            added = [Fraction(0)] * len(one.effort.peak.agents) if disturbed is None else disturbed.inputs
            peaks.append([float_up(u + d) for u, d in zip(one.effort.peak.agents, added, strict=True)])
        return _norm([np.array(peak) for peak in peaks])

    def norm_bound(self, remaining: Sequence[float] | np.ndarray) -> np.ndarray:
        """Bound of the Frobenius norm ``||E(t)||_F`` (or ``||eps(t)||_F``) where ``1 - t/T`` is ``remaining``.

        See :meth:`ptcc_certify.Certificate.norm_bound`.
        """
        if len({one.envelope.coordinates for one in self.components}) > 1:
            raise ParameterError("a time limit left some components with bounds of E and others of eps; raise it")
        return _norm([one.norm_bound(remaining) for one in self.components])

    def deviation_bound(self, remaining: Sequence[float] | np.ndarray) -> np.ndarray:
        """(N, M) array: bound of ``||x_k(t) - x_k(T)||_2`` of every agent where ``1 - t/T`` is ``remaining``.

        See :meth:`ptcc_certify.Certificate.deviation_bound`.
        """
        return _norm([one.deviation_bound(remaining) for one in self.components])

    def compare(self, run: Trajectory) -> Comparison:
        """Compare a run of (N, S) states with the proved bounds of its components."""
        return self.components[0].envelope.compare(run)

    def save(self, path: str | Path) -> list[Path]:
        """Write a certificate per component, ``c.1.json`` .. ``c.S.json`` for ``c`` or ``c.json``; return the paths."""
        refuse_no_path(path)
        whole = Path(path)
        paths = [whole.with_name(f"{whole.stem}.{j}{whole.suffix or '.json'}") for j in range(1, len(self) + 1)]
        for one, file in zip(self.components, paths, strict=True):
            one.save(file)
        return paths

    def summary(self) -> str:
        """Return what ``ptcc certify`` prints of each component."""
        return "\n\n".join(one.summary() for one in self.components)

    def __len__(self) -> int:
        return len(self.components)

    def __iter__(self) -> Iterator[Certificate]:
        return iter(self.components)

    def __getitem__(self, component: int) -> Certificate:
        try:
            return self.components[component]
        except (IndexError, TypeError):
            where = f"{len(self)} components count from 0, and each has its agents: [0].final_state[label]"
            raise ParameterError(f"there is no component [{shorten(repr(component))}]; the {where}") from None

    def __repr__(self) -> str:
        rate = "none" if self.rate is None else down(self.rate)
        behaviour = self.claim.sharpest if self.claim else "disconnected"
        return f"VectorCertificate({len(self)} components, {behaviour}, rate {rate}, {self.verdict})"


def certify_vectors(
    graph: Any, protocol: Protocol, x0: Any, *, sigma0: Any = None, orientation: str | None = None, **options: Any
) -> VectorCertificate:
    """Certify what a protocol does with vector-valued states: component by component, each with its own certificate.

    The work is that of :func:`ptcc_certify.certify` for every component.

    Parameters
    ----------
    graph : graph-like
        N agents; see :func:`ptcc_certify.as_graph`.
    protocol : NominalProtocol or SlidingModeProtocol
        Under the sliding-mode protocol every component of the disturbance is within ``delta``.
    x0 : (N, S) array, DataFrame by label, or mapping of label to S numbers
        The initial state.
    sigma0 : like ``x0``, optional
        Sliding mode: ``sigma(0)``; without it 0.
    orientation : {"information", "listens"}, optional
        See :func:`ptcc_certify.as_graph`.
    **options : Any
        Those of :func:`ptcc_certify.certify`, the same for every component.

    Returns
    -------
    VectorCertificate

    Raises
    ------
    ParameterError
        As :func:`ptcc_certify.certify`; or ``sigma0`` has another number of components than ``x0``.

    References
    ----------
    The networks (2) and (3) of [Zhu]_, for agents of several dimensions.

    Examples
    --------
    >>> pair = [("a", "b", 1), ("b", "a", 1)]
    >>> certify_vectors(pair, NominalProtocol(), {"b": [0, 4], "a": [2, 0]}, simulation=False).final_state
    array([[1., 2.],
           [1., 2.]])
    """
    graph = as_graph(graph, orientation)
    states = list(zip(*as_states(x0, graph), strict=True))
    manifolds: list[Any] = [None] * len(states)
    if sigma0 is not None:
        manifolds = list(zip(*as_states(sigma0, graph, "sigma0"), strict=True))
    if len(manifolds) != len(states):
        raise ParameterError(f"x0 has {len(states)} components and sigma0 has {len(manifolds)}; give as many of each")
    pairs = zip(states, manifolds, strict=True)
    return VectorCertificate(tuple(certify(graph, protocol, x, sigma0=s, **options) for x, s in pairs))


def _norm(bounds: Sequence[np.ndarray]) -> np.ndarray:
    """Return the Euclidean norm of bounds, entry by entry, not below the true one."""
    stack = np.array(bounds)
    largest = stack.max(axis=0)
    unit = np.where((largest > 0) & np.isfinite(largest), largest, 1.0)
    with np.errstate(over="ignore"):
        norm = unit * np.sqrt(((stack / unit) ** 2).sum(axis=0)) * _MORE
    return np.where(norm > 0, np.nextafter(norm, np.inf), 0.0)
