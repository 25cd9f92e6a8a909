"""Control effort: how large the input gets, whether it stays finite at the deadline, what limits of actuators leave.

The gain is infinite at the deadline; the input ``u = gain E`` stays bounded for every start iff
``rho2 kappa Re lambda >= 1`` for all nonzero eigenvalues of ``L``, those on that line being semisimple. Bounds are
formed in exact arithmetic (:mod:`ptcc_certify.checker.input_bounds`) from the proved Lyapunov functions; here their
free parameters are chosen, in floating point.
"""

from __future__ import annotations

import contextlib
import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np

from lmi.exact import arithmetic
from lmi.exact.spectrum import LARGEST, nonzero_spectrum_beyond, tractable
from ptcc_certify.bounds.final_state import Influence
from ptcc_certify.checker import INPUT_NODES
from ptcc_certify.checker.input_bounds import (
    LAST_PERIODS,
    Form,
    InputBounds,
    Limits,
    Of,
    PrescribedGain,
    Reaching,
    Rows,
    Starts,
    energy_above,
    integral_above,
    length_above,
    peak_above,
    root_above,
    rounded,
)
from ptcc_certify.errors import NumberError, ParameterError
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.io import by_label, in_node_order
from ptcc_certify.graphs.rationals import as_fraction, nearest_float, writable
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.lyapunov.error_system import ErrorSystem
from ptcc_certify.protocols.nominal import Protocol, SlidingModeProtocol
from ptcc_certify.theorems import Obligation

#: Bits of the bounds that are written, and of the instants that witness them.
KEPT_BITS, INSTANT_BITS = 40, 24
#: Beyond this ``z = ln(T/(T - t))`` no bound is formed.
LATEST = 5_000
#: Bounds below are raised to this, so that they can be written.
LEAST = Fraction(1, 2**1200)
#: By how much constants of full matrices are raised, so that they are quick to prove.
RAISE = Fraction(1, 2**30)

#: Periods below this share of ``T`` are not tried; how often the interval of the longest one is halved, and which
#: shares of it are proved, one after the other, until one is.
SHORTEST_SHARE, PERIOD_STEPS, PERIOD_SHARES = 1e-12, 12, (0.999, 0.99, 0.9, 0.5)
#: Bits of the matrices that bound the energy, and by how much these exceed what solves the equations.
MATRIX_BITS, EXCESSES = 48, (1e-6, 1e-4, 1e-2)


@dataclass(frozen=True)
class Witness:
    """A bound, and what proves it: a member of the envelope and an instant ``z = ln(T/(T - t))``."""

    value: Fraction
    member: int
    z: Fraction


@dataclass(frozen=True)
class EnergyIntegral:
    """A bound of the energy from two Lyapunov equations, ``L'W + W L - c W >= m I`` with ``c = 0`` and ``c = 1/k``.

    ``p`` says how the gain is split between them, see :func:`ptcc_certify.checker.input_bounds.integral_above`;
    ``matrices`` are the two ``W``, in integers, and ``least`` the two ``m``.
    """

    value: Fraction
    p: Fraction
    matrices: tuple[Rows, Rows]
    least: tuple[Fraction, Fraction]


@dataclass(frozen=True)
class Peak:
    """``sup |u_k|`` of every agent, and of the norm ``||u||_2``."""

    agents: tuple[Fraction, ...]
    how: tuple[Witness, ...]
    norm: Fraction
    norm_how: Witness

    @property
    def largest(self) -> Fraction:
        """``sup max_k |u_k|``."""
        return max(self.agents)


@dataclass(frozen=True)
class SlidingPart:
    """The sliding part of the input: bounded for every start iff ``mu3 kappa >= 1``, and its bound for every agent."""

    bounded: bool
    agents: tuple[Fraction, ...] | None


@dataclass(frozen=True)
class Limited:
    """What is left at the deadline under limits of the gain: ``||E||``, and each agent's distance to its outcome.

    ``largest`` bounds ``max_k |u_k|``; None if the input is held. With measurement noise ``|n_k| <= noise``,
    ``u = -gain L (X + n)``, ``noisy_norm`` bounds ``||E||`` at the deadline and ``noisy_largest`` every ``|u_k|``.
    """

    limits: Limits
    clock: Fraction
    member: int
    growth: Fraction
    norm: Fraction
    agents: tuple[Fraction, ...] | None
    largest: Fraction | None
    noise: Fraction | None = None
    noise_member: int | None = None
    noisy_norm: Fraction | None = None
    noisy_largest: Fraction | None = None


@dataclass(frozen=True)
class Disturbed:
    """What disturbances ``|d_k| <= delta`` of the nominal protocol add to the inputs, and to where the agents end."""

    delta: Fraction
    member: int
    inputs: tuple[Fraction, ...]
    drift: tuple[Fraction, ...] | None


@dataclass(frozen=True)
class Effort:
    """What is proved about the input.

    Attributes
    ----------
    bounded : bool or None
        Whether ``u`` (the nominal part, under the sliding-mode protocol) stays bounded up to the deadline for every
        start; None: undecided.
    by : {"rate", "limit", "spectrum"} or None
        What decides it: a proved rate, a proved limit of rates, or the exact location of the spectrum.
    threshold : pair of Fraction or None
        Proved bounds of ``rho2 kappa min Re lambda``; the input is bounded from 1 on.
    starts : Starts or None
        The set of starts that the bounds are for; None: the start of the certificate.
    constants : tuple of (tuple of Fraction or None)
        ``c_k`` of every member with a full matrix, ``e_k^2 <= c_k V``.
    peak : Peak or None
        None: not bounded, or not proved.
    energy : EnergyIntegral, Witness or None
        Bound of ``int ||u||^2 dt`` (of the nominal part).
    path_length : Witness or None
        Bound of ``int ||u|| dt`` (of the nominal part).
    sliding : SlidingPart or None
        Bounds of the sliding part of the input; None under the nominal protocol, or if ``sigma(0)`` is not known.
    residual : tuple of Limited
        Of those limits under which something is certified.
    longest_period : Fraction or None
        Where sampling is not certified, ``||E||`` being proved to be no larger at the deadline than at first: a period
        with which it would be, near to the longest one.
    disturbed : Disturbed or None
        What disturbances within ``delta`` add under the nominal protocol; None if none was given.
    first : Fraction or None
        Nominal protocol: ``sup max_k |u_k(0)|`` over the starts, exactly, which no peak falls below; None for an
        ellipsoid.

    Notes
    -----
    ``u(t) = -gain(t) L e^(-L s(t)) X(0)`` before the deadline, and ``gain e^(-lambda s)`` stays bounded iff
    ``rho2 kappa Re lambda >= 1``: hence the threshold, where eigenvalues on that line must be semisimple. The bounds
    follow from ``V <= e^(-rate s) V(0)`` and ``e_k^2 <= c_k V``.

    References
    ----------
    The protocols (4) and (48) of Zhu et al., Robust prescribed-time coordination control of
    cooperative-antagonistic networks with disturbances.

    Examples
    --------
    >>> from ptcc_certify import NominalProtocol, SignedDigraph, certify
    >>> pair = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])
    >>> effort = certify(pair, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), [3, 1], simulation=False).effort
    >>> effort.bounded, [float(bound) >= 1 for bound in effort.threshold], float(effort.first)
    (True, [True, True], 8.0)
    """

    bounded: bool | None
    by: str | None
    threshold: tuple[Fraction | None, Fraction | None]
    starts: Starts | None
    constants: tuple[tuple[Fraction, ...] | None, ...]
    peak: Peak | None = None
    energy: Witness | EnergyIntegral | None = None
    path_length: Witness | None = None
    sliding: SlidingPart | None = None
    residual: tuple[Limited, ...] = ()
    longest_period: Fraction | None = None
    disturbed: Disturbed | None = None
    first: Fraction | None = None

    @property
    def obligations(self) -> list[Obligation]:
        """What the independent check verifies, in its order."""
        found = [Obligation("input-threshold", "effort", witness=self.by)] if self.bounded is not None else []
        found += [
            Obligation("input-constants", f"lyapunov.members[{k}]")
            for k, c in enumerate(self.constants)
            if c is not None
        ]
        if self.sliding is not None and self.sliding.agents is not None:
            found.append(Obligation("input-sliding", "effort"))
        if self.peak is not None:
            found.append(Obligation("input-peak", "effort", {"z": self.peak.norm_how.z}, self.peak))
        for kind, bound in (("input-energy", self.energy), ("input-length", self.path_length)):
            if isinstance(bound, EnergyIntegral):
                numbers = {"p": bound.p, "m0": bound.least[0], "m1": bound.least[1]}
                found.append(Obligation(kind, "effort", numbers, bound))
            elif bound is not None:
                found.append(Obligation(kind, "effort", {"z": bound.z}, bound.member))
        for k, entry in enumerate(self.residual):
            witness = entry.member if entry.noise_member is None else [entry.member, entry.noise_member]
            found.append(Obligation("limited-gain", f"effort.residual[{k}]", {"growth": entry.growth}, witness))
        if self.disturbed is not None:
            numbers = {"delta": self.disturbed.delta}
            found.append(Obligation("nominal-disturbed", "effort", numbers, self.disturbed.member))
        return found


# ---------------------------------------------------------------------- starts


def starts_within(structure: Structure, bound: Any) -> Starts:
    """Return all starts with ``||X(0)||_inf <= bound``.

    Parameters
    ----------
    structure : Structure
        Of N agents.
    bound : int, float, str or Fraction
        Positive, at most 1e300.

    Returns
    -------
    Starts
        A box about 0.

    Raises
    ------
    ParameterError
        The bound is not a positive number.

    Examples
    --------
    >>> from ptcc_certify.graphs.digraph import SignedDigraph
    >>> from ptcc_certify.graphs.structure import analyse
    >>> starts_within(analyse(SignedDigraph.from_edges([("a", "b", 1)])), "1/2").radius
    (Fraction(1, 2), Fraction(1, 2))
    """
    try:
        R = as_fraction(bound, "the bound of starts")
    except NumberError as error:
        raise ParameterError(f"the bound of starts: {error}") from None
    if not 0 < R <= 10**300:
        raise ParameterError("the bound of starts is outside its domain; it must be positive, and at most 1e300")
    n = structure.graph.n_nodes
    return Starts((Fraction(0),) * n, (R,) * n)


def box(low: Any, high: Any, graph: SignedDigraph | None = None) -> Starts:
    """Return all starts with ``low_k <= x_k(0) <= high_k``.

    Parameters
    ----------
    low, high : sequences of N numbers, mappings of label to number or pandas Series
        Ints, floats (the dyadic numbers they are), Fractions or texts of the exact grammar.
    graph : SignedDigraph, optional
        Needed where there are labels: it has the order of the nodes.

    Returns
    -------
    Starts

    Raises
    ------
    ParameterError
        The lengths differ, a lower end exceeds its upper end, or labels are not those of the nodes.
    NumberError
        An end is not a number of the exact grammar.

    Examples
    --------
    >>> box([0, 1], [2, 1])
    Starts(center=(Fraction(1, 1), Fraction(1, 1)), radius=(Fraction(1, 1), Fraction(0, 1)), axes=())
    >>> from ptcc_certify.graphs.digraph import SignedDigraph
    >>> graph = SignedDigraph.from_edges([("a", "b", 1)])
    >>> box({"b": 1, "a": 0}, {"b": 1, "a": 2}, graph) == box([0, 1], [2, 1])
    True
    """
    low, high = _unlabelled(low, graph, "low"), _unlabelled(high, graph, "high")
    if len(low) != len(high):
        raise ParameterError(f"a box of {len(low)} lower and {len(high)} upper ends; give one of each for every agent")
    ends = [(as_fraction(a, "low"), as_fraction(b, "high")) for a, b in zip(low, high, strict=True)]
    if any(a > b for a, b in ends):
        raise ParameterError("a box whose lower end exceeds its upper end")
    return Starts(tuple((a + b) / 2 for a, b in ends), tuple((b - a) / 2 for a, b in ends))


def ellipsoid(center: Any, axes: Sequence[Any], graph: SignedDigraph | None = None) -> Starts:
    """Return all starts ``center + sum_j v_j axes_j`` with ``||v||_2 <= 1``.

    Parameters
    ----------
    center : sequence of N numbers, mapping of label to number or pandas Series
    axes : sequence of vectors like ``center``
        One semi-axis or more; they need not be orthogonal.
    graph : SignedDigraph, optional
        Needed where there are labels: it has the order of the nodes.

    Returns
    -------
    Starts

    Raises
    ------
    ParameterError
        There is no axis, one of another length than ``center``, or labels are not those of the nodes.
    NumberError
        A number is not of the exact grammar.

    Examples
    --------
    >>> ellipsoid([0, 0], [[1, 0], [0, 2]]).axes
    ((Fraction(1, 1), Fraction(0, 1)), (Fraction(0, 1), Fraction(2, 1)))
    """
    if by_label(axes, "axes") is not None:
        raise ParameterError("axes are a list of vectors, each of which may have labels; a table does not tell which")
    middle = tuple(as_fraction(x, "center") for x in _unlabelled(center, graph, "center"))
    vectors = tuple(tuple(as_fraction(x, "axes") for x in _unlabelled(axis, graph, "axes")) for axis in axes)
    if not vectors or any(len(axis) != len(middle) for axis in vectors):
        raise ParameterError(f"the axes of an ellipsoid are vectors of {len(middle)} numbers, at least one")
    return Starts(middle, axes=vectors)


def _unlabelled(values: Any, graph: SignedDigraph | None, name: str) -> Any:
    if graph is not None:
        return in_node_order(values, graph, name)
    if by_label(values, name) is not None:
        raise ParameterError(f"{name} has labels, and the graph has the order of its nodes; give graph= besides")
    return values


# ---------------------------------------------------------------------- bounds


def bound_effort(
    structure: Structure,
    protocol: Protocol,
    forms: Sequence[Form | None],
    *,
    rate: Fraction | None,
    limit: Fraction | None,
    start: Sequence[Fraction] | None = None,
    starts: Starts | None = None,
    sigma0: Sequence[Fraction] | None = None,
    reaching: Sequence[Fraction | None] | None = None,
    influence: Influence | None = None,
    distances: Sequence[Sequence[Fraction] | None] = (),
    limits: Sequence[Limits] = (),
    delta: Fraction | None = None,
    noise: Fraction | None = None,
) -> Effort:
    """Bound the input.

    Parameters
    ----------
    structure : Structure
    protocol : NominalProtocol or SlidingModeProtocol
    forms : sequence of Form or None
        The members of the envelope; None for those of large graphs.
    rate, limit : Fraction or None
        The largest proved rate, and the proved limit of rates.
    start, starts
        ``X(0)``, or a set of starts instead.
    sigma0 : sequence of Fraction or None
    reaching : sequence of (Fraction or None), optional
        Proved reaching times ``ln(T_r/(T_r - t))`` of the agents; without them, and for None, ``T_r``.
    influence : Influence, optional
        ``Q``, for the drift under disturbances.
    distances : sequence
        Of every member, the constants from ``V`` to the distances of agents to their outcomes, or None.
    limits : sequence of Limits
        Nominal protocol: limits of the gain to be judged.
    delta : Fraction, optional
        Nominal protocol: bound of the disturbances to be judged.
    noise : Fraction, optional
        Nominal protocol: bound of the measurement noise to be judged under each of the limits but sampling.
    """
    gain = _prescribed(protocol)
    still = structure.graph.n_edges == 0
    bounded, by = _bounded(structure, gain.k, rate, limit, still)
    threshold = tuple(None if r is None else gain.k * r / 2 for r in (rate, limit))
    sliding = _sliding_part(protocol, sigma0)
    effort: dict[str, Any] = {"bounded": bounded, "by": by, "threshold": threshold, "sliding": sliding}
    n = structure.graph.n_nodes
    center = start if starts is None else starts.center
    if center is None or still or n > INPUT_NODES:
        return Effort(**effort, starts=None, constants=(None,) * len(forms))
    constants = tuple(None if f is None or f.matrix is None else _proved_constants(f, n) for f in forms)
    region = starts or Starts(tuple(center))
    driven = _reaching(protocol, sigma0, reaching)
    bounds = InputBounds(structure.graph.exact_rows(range(n)), gain, forms, constants, region, driven)
    usable = [k for k, f in enumerate(forms) if f is not None and f.rate > 0 and _usable(bounds, k)]
    own = [Fraction(0)] * n if sliding is None else sliding.agents
    peak = None
    if own is not None:
        peak = _peak(bounds, [k for k in usable if bounds.form(k).rate * gain.k >= 2], own)
    ample = [k for k in usable if bounds.form(k).rate * gain.k > 1]
    cap = None if influence is None or not influence.exact or not limits else largest_deviation(region, influence)
    energies = (_integral(structure, bounds), _least(bounds, energy_above, ample))
    entries = [_limited(bounds, usable, entry, distances, cap, peak, noise) for entry in limits]
    return Effort(
        **effort,
        starts=starts,
        constants=constants,
        peak=peak,
        energy=min((e for e in energies if e is not None), key=lambda e: e.value, default=None),
        path_length=_least(bounds, length_above, usable),
        residual=tuple(entry for entry in entries if entry is not None),
        longest_period=_longest_period(bounds, usable, limits, entries),
        disturbed=None if delta is None else _disturbed(bounds, usable, delta, influence),
        first=first_input(structure, protocol, region),
    )


def first_input(structure: Structure, protocol: Protocol, region: Starts) -> Fraction | None:
    """Return ``sup max_k |u_k(0)|``, exactly; None in sliding mode, for an ellipsoid, for a large graph."""
    n = structure.graph.n_nodes
    if isinstance(protocol, SlidingModeProtocol) or region.axes or n > INPUT_NODES or not structure.graph.n_edges:
        return None
    gain = _prescribed(protocol)
    return (gain.rho1 + gain.k / gain.T) * max(map(region.largest, structure.graph.exact_rows(range(n))))


def _prescribed(protocol: Protocol) -> PrescribedGain:
    return PrescribedGain(protocol.T, protocol.rho1, protocol.rho2 * protocol.kappa)


def _bounded(
    structure: Structure, k: Fraction, rate: Fraction | None, limit: Fraction | None, still: bool
) -> tuple[bool | None, str | None]:
    """Decide whether the input stays bounded for every start, and by what."""
    if still or (rate is not None and rate * k >= 2):
        return True, "rate"
    if limit is not None and limit * k < 2:
        return False, "limit"
    graph = structure.graph
    if graph.n_nodes > LARGEST:
        return None, None
    unit = math.lcm(*{graph.exact_weight(i).denominator for i in range(graph.n_edges)})
    rows = [{j: int(x * unit) for j, x in row.items()} for row in graph.exact_rows(range(graph.n_nodes))]
    if not tractable(rows, unit, 1 / k):
        return None, None
    labels = structure.strong_component
    components = [np.flatnonzero(labels == c).tolist() for c in range(int(labels.max()) + 1)]
    balanced = [sorted(c.nodes) for c in structure.closed_components if c.balanced]
    still_parts = {k for k, nodes in enumerate(components) if nodes in balanced}
    place = nonzero_spectrum_beyond(rows, unit, components, still_parts, 1 / k, arithmetic().characteristic)
    return place in ("beyond", "on"), "spectrum"


def _sliding_part(protocol: Protocol, sigma0: Sequence[Fraction] | None) -> SlidingPart | None:
    """Bound the sliding part of every input; None for the nominal protocol."""
    if not isinstance(protocol, SlidingModeProtocol) or sigma0 is None:
        return None
    pole = protocol.mu3 * protocol.kappa
    push = protocol.mu2 + pole / protocol.T_r
    known = pole >= 1 or not any(sigma0)
    return SlidingPart(pole >= 1, tuple(protocol.mu1 + push * abs(s) for s in sigma0) if known else None)


def _proved_constants(form: Form, n: int) -> tuple[Fraction, ...] | None:
    """Return ``c_k`` with ``e_k^2 <= c_k E'P E`` for a full ``P``, a little above the diagonal of its inverse."""
    matrix = form.matrix or ()
    scale = math.lcm(*(x.denominator for row in matrix for x in row))
    P = [[x.numerator * (scale // x.denominator) for x in row] for row in matrix]
    above = arithmetic().above(P, [[int(i == j) for j in range(len(P))] for i in range(len(P))])
    if above is None:
        return None
    constants = [Fraction(0)] * n
    try:
        for v, value in zip(form.nodes, above, strict=True):
            constants[v] = _kept(value * scale * (1 + RAISE))
    except OverflowError:
        return None
    return tuple(constants)


def _kept(x: Fraction) -> Fraction:
    """Round up to the bits that are written, and what is next to nothing to ``LEAST``.

    Raises
    ------
    OverflowError
        Too large to be written.
    """
    value = rounded(max(x, LEAST), KEPT_BITS, up=True) if x else x
    if not writable(value):
        raise OverflowError("a bound that is too large to be written")
    return value


def _reaching(
    protocol: Protocol, sigma0: Sequence[Fraction] | None, times: Sequence[Fraction | None] | None
) -> Reaching | None:
    """Return how the sliding variables move; None if they do not."""
    if not isinstance(protocol, SlidingModeProtocol) or not any(sigma0 or ()):
        return None
    last = [None] if times is None else [z for z, s in zip(times, sigma0 or (), strict=True) if s]
    return Reaching(
        sigma0 or (),
        protocol.T_r,
        protocol.T_s,
        protocol.mu2,
        protocol.mu3 * protocol.kappa,
        protocol.mu1 + protocol.delta,
        None if None in last else max(z for z in last if z is not None),
    )


def _integral(structure: Structure, bounds: InputBounds) -> EnergyIntegral | None:
    """Bound the energy by two Lyapunov equations; None if it is infinite, or floats do not solve them well enough."""
    if bounds.reaching is not None:
        return None
    gain = bounds.gain
    try:
        with np.errstate(all="ignore"), warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a singular equation: what comes of it is judged by its remainder
            system = ErrorSystem(structure)
            (first, m0), (second, m1) = (_lyapunov(system, c) for c in (0.0, nearest_float(1 / gain.k)))
        even, grown = bounds.largest_form(first) / m0, bounds.largest_form(second) / m1
        # The best p is ln(grown / even).
        most = gain.rho1 * gain.T / gain.k
        wanted = max(_log(grown) - _log(even), 0.0) if even and grown else 0.0
        p = min(rounded(Fraction(wanted), INSTANT_BITS), most)
        return EnergyIntegral(_kept(integral_above(gain, even, grown, p)), p, (first, second), (m0, m1))
    except (np.linalg.LinAlgError, ValueError, OverflowError):
        return None


def _lyapunov(system: ErrorSystem, c: float) -> tuple[Rows, Fraction]:
    """Return ``W`` in integers and ``m`` with ``A'W + W A - c W > m I`` on the subspace of ``E``, near to equality.

    The remainder is formed in floats, after rounding; what these may be off by is left between it and ``m``, so that
    the independent check proves it.

    Raises
    ------
    ValueError
        Floats do not find such a ``W > 0``.
    """
    from scipy.linalg import solve_continuous_lyapunov

    A, basis = system.matrix, system.basis
    B = np.eye(len(A)) if basis is None else basis
    inner = B.T @ A @ B - c / 2 * np.eye(B.shape[1])
    W = B @ solve_continuous_lyapunov(inner.T, np.eye(B.shape[1])) @ B.T
    order = np.argsort(system.nodes)
    W, A, B = W[np.ix_(order, order)], A[np.ix_(order, order)], B[order]
    top = float(np.abs(W).max())
    if not 0 < top < 1e100:
        raise ValueError("the equation is not solved")
    unit = 2.0 ** (MATRIX_BITS - math.ceil(math.log2(top)))
    W = np.round((W + W.T) / 2 * unit) / unit
    least = [float(np.linalg.eigvalsh(B.T @ S @ B)[0]) for S in (W, W @ A + A.T @ W - c * W)]
    size = float(np.linalg.norm(W))
    noise = 100 * len(A) * 2.0**-52 * size * np.array([1.0, 2 * float(np.linalg.norm(A)) + c])
    for excess in EXCESSES:
        if least[0] > noise[0] and least[1] - noise[1] > 1 - excess:
            rows = [[Fraction(int(x)) for x in row] for row in (W * unit).tolist()]
            return rows, rounded(Fraction(unit * (1 - excess)), INSTANT_BITS)
    raise ValueError("the equation is not solved well enough")


def _usable(bounds: InputBounds, k: int) -> bool:
    try:
        bounds.constant(k)
        bounds.start(k)
    except (ValueError, OverflowError):
        return False
    return True


def _log(x: Fraction) -> float:
    """Return the natural logarithm of a nonnegative rational of any size."""
    return math.log(x.numerator) - math.log(x.denominator) if x else -math.inf


def _crossing(bounds: InputBounds, agent: int | None, k: int) -> float:
    """Return ``z`` where what is held meets what decays, the instant that serves the bounds best; 0 while driven."""
    if bounds.reaching is not None:
        return 0.0
    held = bounds.held_norm if agent is None else bounds.held[agent]
    start = bounds.root_constant(k, agent) * bounds.start(k)
    if not held or not start:
        return 0.0
    s = 2 * (_log(start) - _log(held)) / nearest_float(bounds.form(k).rate)
    linear, pole = nearest_float(bounds.gain.rho1 * bounds.gain.T), nearest_float(bounds.gain.k)
    low, high = 0.0, s / pole
    if not 0 < high < math.inf:
        return 0.0 if high <= 0 else math.inf
    for _ in range(60):
        z = (low + high) / 2
        low, high = (z, high) if -linear * math.expm1(-z) + pole * z < s else (low, z)
    return high


def _best(bounds: InputBounds, of: Of, agent: int | None, members: Sequence[int]) -> Witness | None:
    """Return the bound of the member whose decay takes over first, which is the least peak; the least while driven."""
    found: Witness | None = None
    order = sorted((_crossing(bounds, agent, k), bounds.root_constant(k, agent) * bounds.start(k), k) for k in members)
    for z, _, k in order:
        if z <= LATEST:
            instant = max(Fraction(math.ceil(z * 2**INSTANT_BITS), 2**INSTANT_BITS), bounds.quiet)
            try:
                own = Witness(_kept(bounds.bound(of, agent, k, instant)), k, instant)
            except (ValueError, OverflowError):
                continue
            if found is None or own.value < found.value:
                found = own
            if bounds.reaching is None:
                break
    return found


def _least(bounds: InputBounds, of: Of, members: Sequence[int]) -> Witness | None:
    """Return the least bound of the norm over some members."""
    found = [_best(bounds, of, None, [k]) for k in members]
    return min((w for w in found if w is not None), key=lambda w: w.value, default=None)


def _peak(bounds: InputBounds, members: Sequence[int], own: Sequence[Fraction]) -> Peak | None:
    """Bound the peak of every agent's input, and of the norm."""
    agents = [_best(bounds, peak_above, v, members) for v in range(len(bounds.rows))]
    norm = _best(bounds, peak_above, None, members)
    if norm is None or any(a is None for a in agents):
        return None
    how = tuple(a for a in agents if a is not None)
    try:
        whole = _kept(norm.value + root_above(sum((x * x for x in own), Fraction(0))))
        return Peak(tuple(_kept(a.value + x) for a, x in zip(how, own, strict=True)), how, whole, norm)
    except OverflowError:
        return None


def largest_deviation(starts: Starts, influence: Influence) -> Fraction:
    """Return ``sup max_k |x_k(0) - (Q x(0))_k|`` over the starts, which nominal motions never exceed.

    Parameters
    ----------
    starts : Starts
    influence : Influence
        ``Q`` in rationals.

    Returns
    -------
    Fraction
        Exact for a point or a box, rounded up for an ellipsoid.

    Examples
    --------
    >>> from ptcc_certify.graphs.digraph import SignedDigraph
    >>> from ptcc_certify.bounds.final_state import influence
    >>> from ptcc_certify.graphs.structure import analyse
    >>> pair = influence(analyse(SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])))
    >>> largest_deviation(Starts([Fraction(3), Fraction(1)]), pair)  # they meet at 1 and -1
    Fraction(2, 1)
    """
    rows = []
    for v in range(len(starts.center)):
        row = {j: -Fraction(x) for j, x in influence.row(v).items()}
        rows.append(row | {v: row.get(v, Fraction(0)) + 1})
    return max(map(starts.largest, rows))


def _limited(
    bounds: InputBounds,
    members: Sequence[int],
    limits: Limits,
    distances: Sequence[Sequence[Fraction] | None],
    cap: Fraction | None,
    peak: Peak | None,
    noise: Fraction | None,
) -> Limited | None:
    """Bound what is left at the deadline under limits of the gain; None if nothing is certified.

    Unless the input is held no agent is farther from its outcome than ``cap``, the largest deviation at the start.
    With sampling, which may drive the agents apart, that is certified which leaves ``||E||`` no larger than at first.
    """
    gain = bounds.gain
    top = limits.largest_gain(gain)
    if top is None:
        return None
    clock = limits.clock_below(gain)
    found: Limited | None = None
    for k in members:
        growth = Fraction(0) if limits.sample_period is None else step_growth(bounds, k)
        if growth is None:
            continue
        try:
            left = bounds.share(k, limits, clock, growth) * bounds.start(k)
            norm = _kept(bounds.root_constant(k, None) * left)
            if limits.sample_period is not None and norm > bounds.first:
                continue
            if found is None or norm < found.norm:
                known = distances[k] if k < len(distances) else None
                sizes = [root_above(c) * left for c in known or ()]
                if cap is not None and limits.sample_period is None:
                    sizes = [min(x, cap) for x in sizes]
                agents = None if known is None else tuple(map(_kept, sizes))
                largest = None
                if limits.sample_period is None:
                    largest = _kept(min([top * max(bounds.held)] + ([peak.largest] if peak is not None else [])))
                found = Limited(limits, clock, k, growth, norm, agents, largest)
        except (ValueError, OverflowError):
            continue
    if found is None or noise is None or limits.sample_period is not None:
        return found
    return _with_noise(bounds, members, found, top, noise)


def _with_noise(bounds: InputBounds, members: Sequence[int], found: Limited, top: Fraction, noise: Fraction) -> Limited:
    """Add the bounds under measurement noise, by the member that it moves least."""
    result = found
    for k in members:
        try:
            whole, each = bounds.noisy(k, noise)
            norm, most = _kept(found.norm + whole), _kept((found.largest or 0) + top * max(each))
        except (ValueError, OverflowError):
            continue
        if result.noisy_largest is None or most < result.noisy_largest:
            result = replace(found, noise=noise, noise_member=k, noisy_norm=norm, noisy_largest=most)
    return result


def _longest_period(
    bounds: InputBounds, members: Sequence[int], limits: Sequence[Limits], found: Sequence[Limited | None]
) -> Fraction | None:
    """Return a period of four digits with which all is certified that is not, near to the longest; None if none is."""
    failed = [entry for entry, known in zip(limits, found, strict=True) if known is None]
    if not failed or any(entry.sample_period is None for entry in failed) or not bounds.first:
        return None
    growths = [(k, m) for k in members if (m := step_growth(bounds, k)) is not None]
    sizes = {k: _log(bounds.root_constant(k, None) * bounds.start(k)) - _log(bounds.first) for k, _ in growths}

    def excess(limits: Limits, period: float) -> float:
        logs = (sizes[k] + _log_share(bounds.gain, limits, period, bounds.form(k).rate, m) for k, m in growths)
        return min(logs, default=math.inf)

    def proved(limits: Limits, period: Fraction) -> bool:
        sampled = replace(limits, sample_period=period)
        with contextlib.suppress(ValueError, OverflowError):
            for k, m in growths:
                left = bounds.share(k, sampled, Fraction(0), m) * bounds.start(k)
                if _kept(bounds.root_constant(k, None) * left) <= bounds.first:
                    return True
        return False

    longest: list[Fraction] = []
    for entry in failed:
        high = nearest_float(entry.sample_period or bounds.gain.T)
        shortest = SHORTEST_SHARE * nearest_float(bounds.gain.T)
        low = high / 2
        while low >= shortest and excess(entry, low) > 0:
            high, low = low, low / 2
        for _ in range(PERIOD_STEPS):
            middle = (low + high) / 2
            low, high = (middle, high) if excess(entry, middle) <= 0 else (low, middle)
        for share in PERIOD_SHARES:
            period = Fraction(f"{low * share:.3e}")
            if low >= shortest and proved(entry, period):
                longest.append(period)
                break
        else:
            return None
    return min(longest)


def _log_share(gain: PrescribedGain, limits: Limits, period: float, rate: Fraction, growth: Fraction) -> float:
    """Return the logarithm of the bound of ``sqrt(V)`` over ``sqrt(V(0))`` if the gain is held, in floating point."""
    T, rho1, k, b, m = map(nearest_float, (gain.T, gain.rho1, gain.k, rate, growth))
    cap = math.inf if limits.gain_cap is None else nearest_float(limits.gain_cap)
    end = T - nearest_float(limits.stop_before or Fraction(0))
    count = math.ceil(end / period * (1 - 1e-12))
    first = max(count - LAST_PERIODS, 0)
    # Before the last periods the gain changes little from one to the next: they are counted by the thousand.
    edges = np.unique(np.append(np.geomspace(1, first + 1, 1000).astype(np.int64), 1)) - 1 if first else np.array([0])
    starts = np.append(first - edges[::-1], np.arange(first + 1, count))
    times = np.diff(starts, append=count)
    at = starts * period
    eta = np.minimum(rho1 + k / (T - at), cap) * np.minimum(period, end - at)
    with np.errstate(all="ignore"):
        return float(np.sum(times * np.log(np.maximum(1 - eta * b + eta**2 * m, 1e-300))) / 2)


def step_growth(bounds: InputBounds, k: int) -> Fraction | None:
    """Return ``m`` with ``L'P L <= m P``, in floating point and raised a little; the check proves it."""
    form = bounds.form(k)
    if form.coordinates != "E":
        return None
    A = np.array([[float(bounds.rows[v].get(w, 0)) for w in form.nodes] for v in form.nodes])
    try:
        with np.errstate(all="ignore"):
            if form.diagonal is not None:
                R = np.diag(np.sqrt([float(w) for w in form.diagonal]))
            else:
                R = np.linalg.cholesky(np.array([[float(x) for x in row] for row in form.matrix or ()])).T
            size = float(np.linalg.norm(R @ A @ np.linalg.inv(R), 2))
    except (np.linalg.LinAlgError, OverflowError):
        return None
    return _kept(Fraction(size) ** 2 * (1 + Fraction(1, 10**9))) if math.isfinite(size) else None


def _disturbed(
    bounds: InputBounds, members: Sequence[int], delta: Fraction, influence: Influence | None
) -> Disturbed | None:
    """Bound what disturbances add under the nominal protocol."""
    drift = None
    if influence is not None and influence.exact:
        T, sizes = bounds.gain.T, [Fraction(0)] * len(bounds.rows)
        for v in range(len(sizes)):
            sizes[v] = sum((abs(Fraction(x)) for x in influence.row(v).values()), Fraction(0))
        drift = tuple(_kept(delta * T * x) for x in sizes)
    found: Disturbed | None = None
    for k in members:
        try:
            inputs = tuple(map(_kept, bounds.disturbed(k, delta)))
        except (ValueError, OverflowError):
            continue
        if found is None or max(inputs) < max(found.inputs):
            found = Disturbed(delta, k, inputs, drift)
    return found


# ---------------------------------------------------------------------- worst start


@dataclass(frozen=True)
class WorstStart:
    """A start of the set from which the input gets largest, in floating point.

    Attributes
    ----------
    x0 : (N,) array
    agent : int
        Whose input is largest.
    t : float
        When, in units of time.
    size : float
        ``|u_agent(t)|``, in units of the input.

    References
    ----------
    The protocol (4) of Zhu et al., Robust prescribed-time coordination control of
    cooperative-antagonistic networks with disturbances.

    Examples
    --------
    >>> from ptcc_certify.graphs.digraph import SignedDigraph
    >>> from ptcc_certify.graphs.structure import analyse
    >>> from ptcc_certify.protocols.nominal import NominalProtocol
    >>> follower = analyse(SignedDigraph.from_edges([(1, 2, -2)]))
    >>> worst_start(follower, NominalProtocol(1, 1, 1, 1), box([0, 0], [1, 1]))
    WorstStart(x0=array([1., 1.]), agent=1, t=0.0, size=8.0)
    """

    x0: np.ndarray
    agent: int
    t: float
    size: float


def worst_start(
    structure: Structure, protocol: Protocol, starts: Starts, *, samples: int = 120, latest: float = 14.0
) -> WorstStart:
    """Return the start from which some ``|u_k(t)|`` is largest under the nominal part of the protocol (numerical).

    ``u(t) = -gain L e^(-L s) X(0)`` is linear in the start: at each of ``samples`` instants, evenly spaced in
    ``z = ln(T/(T - t))`` up to ``latest``, the maximum over the set is exact.

    Parameters
    ----------
    structure : Structure
        Of N agents.
    protocol : NominalProtocol or SlidingModeProtocol
    starts : Starts
        Of N numbers.
    samples : int
        Number of instants.
    latest : float
        ``ln(T/(T - t))`` of the last one, dimensionless.

    Returns
    -------
    WorstStart

    References
    ----------
    The protocol (4) of Zhu et al., Robust prescribed-time coordination control of
    cooperative-antagonistic networks with disturbances.

    Examples
    --------
    >>> from ptcc_certify.graphs.digraph import SignedDigraph
    >>> from ptcc_certify.protocols.nominal import NominalProtocol
    >>> from ptcc_certify.graphs.structure import analyse
    >>> pair = analyse(SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)]))
    >>> worst = worst_start(pair, NominalProtocol(1, 1, 1, 1), starts_within(pair, 3))
    >>> worst.x0, worst.t, worst.size
    (array([-3., -3.]), 0.0, 12.0)
    """
    from scipy.linalg import expm

    L = structure.graph.dense_laplacian()
    center = np.array([nearest_float(x) for x in starts.center])
    radius = np.array([nearest_float(x) for x in starts.radius]) if starts.radius else np.zeros(len(center))
    axes = np.array([[nearest_float(x) for x in axis] for axis in starts.axes])
    best: WorstStart | None = None
    gain = protocol.gain
    for z in np.linspace(0.0, latest, samples):
        M = -float(gain.value_at_remaining(math.exp(-z))) * (L @ expm(-L * float(gain.clock_at_tau(z))))
        middle = M @ center
        reach = np.linalg.norm(M @ axes.T, axis=1) if axes.size else np.abs(M) @ radius
        k = int(np.argmax(np.abs(middle) + reach))
        size = float(abs(middle[k]) + reach[k])
        if best is None or size > best.size * (1 + 1e-12):
            sign = -1.0 if middle[k] < 0 else 1.0
            if axes.size:
                along = axes @ M[k]
                x0 = center + sign * along @ axes / (np.linalg.norm(along) or 1.0)
            else:
                x0 = center + sign * radius * np.sign(M[k])
            best = WorstStart(x0, k, float(gain.time_at_tau(z)), size)
    assert best is not None
    return best


# ---------------------------------------------------------------------- JSON


def effort_section(effort: Effort | None, labels: Sequence[str], text: Callable[[Fraction], str]) -> Any:
    """Return the section ``effort`` of a certificate."""
    if effort is None:
        return None

    def by_agent(values: Sequence[Fraction] | None) -> dict[str, str] | None:
        return None if values is None else dict(zip(labels, map(text, values), strict=True))

    def maybe(value: Fraction | None) -> str | None:
        return None if value is None else text(value)

    region: dict[str, Any] | None = None
    if effort.starts is not None:
        region = {"center": by_agent(effort.starts.center)}
        if effort.starts.axes:
            region["axes"] = [by_agent(axis) for axis in effort.starts.axes]
        else:
            region["radius"] = by_agent(effort.starts.radius or (Fraction(0),) * len(labels))
    peak, disturbed = effort.peak, effort.disturbed
    return {
        "bounded": effort.bounded,
        "threshold": {"lower": maybe(effort.threshold[0]), "upper": maybe(effort.threshold[1])},
        "starts": region,
        "constants": [by_agent(c) for c in effort.constants],
        "peak": peak and {"agents": by_agent(peak.agents), "largest": text(peak.largest), "norm": text(peak.norm)},
        "energy": None if effort.energy is None else text(effort.energy.value),
        "path_length": None if effort.path_length is None else text(effort.path_length.value),
        "sliding": effort.sliding and {"bounded": effort.sliding.bounded, "agents": by_agent(effort.sliding.agents)},
        "residual": [
            {
                "gain_cap": maybe(entry.limits.gain_cap),
                "stop_before": maybe(entry.limits.stop_before),
                "sample_period": maybe(entry.limits.sample_period),
                "clock": text(entry.clock),
                "norm": text(entry.norm),
                "agents": by_agent(entry.agents),
                "largest": maybe(entry.largest),
                "noise": None
                if entry.noise is None
                else {
                    "bound": text(entry.noise),
                    "norm": maybe(entry.noisy_norm),
                    "largest": maybe(entry.noisy_largest),
                },
            }
            for entry in effort.residual
        ],
        "disturbed": disturbed
        and {
            "delta": text(disturbed.delta),
            "inputs": by_agent(disturbed.inputs),
            "drift": by_agent(disturbed.drift),
        },
    }


def peak_witness(peak: Peak, labels: Sequence[str], text: Callable[[Fraction], str]) -> Mapping[str, Any]:
    """Return what proves the peaks: a member and an instant for every agent, and for the norm."""
    agents = {label: [how.member, text(how.z)] for label, how in zip(labels, peak.how, strict=True)}
    return {"agents": agents, "norm": peak.norm_how.member}


def energy_witness(energy: EnergyIntegral, text: Callable[[Fraction], str]) -> dict[str, list[list[str]]]:
    """Return the lower triangles of the matrices that prove the energy."""
    first, second = ([[text(x) for x in row[: i + 1]] for i, row in enumerate(W)] for W in energy.matrices)
    return {"W0": first, "W1": second}
