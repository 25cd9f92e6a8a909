"""Control effort: how large the input gets, whether it stays finite at the deadline, what limits of the gain leave.

The gain is infinite at the deadline; the input ``u = gain E`` stays bounded for every initial state iff
``rho2 kappa Re lambda >= 1`` for all nonzero eigenvalues of ``L``, those on that line being semisimple. Bounds are
formed in exact arithmetic (:mod:`ptcc_certify.checker.input_formulas`) from the proved Lyapunov functions; here their
free parameters are chosen, in floating point.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from lmi.exact import arithmetic
from lmi.exact.spectrum_beyond_line import LARGEST, nonzero_spectrum_beyond, tractable
from ptcc_certify.bounds.final_state.of_graph import Influence
from ptcc_certify.bounds.input.effort import Effort, EnergyIntegral, Peak, SlidingPart, Threshold, first_input
from ptcc_certify.bounds.input.initial_sets import largest_deviation
from ptcc_certify.bounds.input.residual_under_limits import LimitedBounds, bound_disturbed
from ptcc_certify.bounds.input.tightest_bound import (
    INSTANT_BITS,
    best_bound,
    least_bound,
    log,
    round_up,
    usable_functions,
)
from ptcc_certify.checker import INPUT_NODES
from ptcc_certify.checker.input_formulas import (
    Form,
    InitialSet,
    InputBounds,
    Limits,
    Reaching,
    Rows,
    energy_above,
    integral_above,
    length_above,
    peak_above,
    root_above,
    rounded,
)
from ptcc_certify.checker.protocol import last_time, sliding_bounded, sliding_part
from ptcc_certify.graphs.rationals import nearest_float
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.lyapunov.error_system import ErrorSystem
from ptcc_certify.model import Protocol

#: Bits of the matrices that bound the energy, and by how much these exceed what solves the equations.
MATRIX_BITS, EXCESSES = 48, (1e-6, 1e-4, 1e-2)


def energy_integral(structure: Structure, bounds: InputBounds) -> EnergyIntegral | None:
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
        best = max(log(grown) - log(even), 0.0) if even and grown else 0.0
        p = min(rounded(Fraction(best), INSTANT_BITS), most)
        return EnergyIntegral(round_up(integral_above(gain, even, grown, p)), p, (first, second), (m0, m1))
    except (ValueError, ArithmeticError):
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


#: By how much constants of full matrices are raised, so that they are quick to prove.
RAISE = Fraction(1, 2**30)


@dataclass(frozen=True)
class InputRequest:
    """What the input is to be bounded for, and from what is proved already.

    Attributes
    ----------
    structure : Structure
    protocol : Protocol
    forms : sequence of Form or None
        The Lyapunov functions of the envelope; None for those of large graphs.
    constants : sequence of (sequence of Fraction or None)
        Of every one with a full matrix ``c_k``, ``e_k^2 <= c_k V``; asked for where there are initial states.
    rates : pair of (Fraction or None)
        The largest proved rate, and the proved upper bound on the decay rate.
    initial_state, initial_set
        ``X(0)``, or a set of initial states instead.
    sigma0 : sequence of Fraction or None
    reaching : sequence of (Fraction or None), optional
        Proved reaching times ``ln(T_r/(T_r - t))`` of the agents; without them, and for None, ``T_r``.
    influence : Influence, optional
        ``Q``, for the drift under disturbances.
    deviations : sequence
        Of every Lyapunov function, the constants from ``V`` to how far agents are from their final states, or None.
    limits : sequence of Limits
        Nominal protocol: limits of the gain to be judged.
    delta : Fraction, optional
        Nominal protocol: bound of the disturbances to be judged.
    noise : Fraction, optional
        Nominal protocol: bound of the measurement noise to be judged under each of the limits but sampling.
    """

    structure: Structure
    protocol: Protocol
    forms: Sequence[Form | None]
    constants: Sequence[Sequence[Fraction] | None]
    rates: tuple[Fraction | None, Fraction | None]
    initial_state: Sequence[Fraction] | None = None
    initial_set: InitialSet | None = None
    sigma0: Sequence[Fraction] | None = None
    reaching: Sequence[Fraction | None] | None = None
    influence: Influence | None = None
    deviations: Sequence[Sequence[Fraction] | None] = ()
    limits: Sequence[Limits] = ()
    delta: Fraction | None = None
    noise: Fraction | None = None


def bound_effort(request: InputRequest) -> Effort:
    """Bound the input."""
    structure, gain, influence = request.structure, request.protocol.gain, request.influence
    still, n = structure.graph.n_edges == 0, structure.graph.n_nodes
    bounded, by = _decide_boundedness(structure, gain.pole, *request.rates, still)
    lower, upper = (None if r is None else gain.pole * r / 2 for r in request.rates)
    sliding = _sliding_part(request)
    effort = Effort(bounded, by, Threshold(lower, upper), None, (None,) * len(request.forms), sliding=sliding)
    if (request.initial_state is None and request.initial_set is None) or still or n > INPUT_NODES:
        return effort
    constants = tuple(None if c is None else tuple(c) for c in request.constants)
    region = request.initial_set or InitialSet(tuple(request.initial_state or ()))
    rows = structure.graph.exact_rows(range(n))
    bounds = InputBounds(rows, gain.exact, request.forms, constants, region, _reaching_phase(request))
    usable = usable_functions(bounds)
    own = [Fraction(0)] * n if sliding is None else sliding.agents
    peak = None if own is None else _peak(bounds, usable, own)
    cap = (
        None if influence is None or not influence.exact or not request.limits else largest_deviation(region, influence)
    )
    energies = (energy_integral(structure, bounds), least_bound(bounds, energy_above, usable))
    limited = LimitedBounds(bounds, usable, request.deviations, cap, peak, request.noise)
    entries = [limited.bound_residual(entry) for entry in request.limits]
    return replace(
        effort,
        initial_set=request.initial_set,
        constants=constants,
        peak=peak,
        energy=min((e for e in energies if e is not None), key=lambda e: e.value, default=None),
        path_length=least_bound(bounds, length_above, usable),
        residual=tuple(entry for entry in entries if entry is not None),
        longest_period=limited.longest_period(request.limits, entries, gain),
        disturbed=None if request.delta is None else bound_disturbed(bounds, usable, request.delta, influence),
        first=first_input(structure, request.protocol, region),
    )


def _decide_boundedness(
    structure: Structure, k: Fraction, rate: Fraction | None, limit: Fraction | None, still: bool
) -> tuple[bool | None, str | None]:
    """Decide whether the input stays bounded for every initial state, and by what."""
    if still or (rate is not None and rate * k >= 2):
        return True, "rate"
    if limit is not None and limit * k < 2:
        return False, "upper_bound"
    graph = structure.graph
    if graph.n_nodes > LARGEST:
        return None, None
    unit = math.lcm(*{graph.exact_weight(i).denominator for i in range(graph.n_edges)})
    rows = [{j: int(x * unit) for j, x in row.items()} for row in graph.exact_rows(range(graph.n_nodes))]
    if not tractable(rows, unit, 1 / k):
        return None, None
    labels = structure.strong_component
    parts = [np.flatnonzero(labels == c).tolist() for c in range(int(labels.max()) + 1)]
    place = nonzero_spectrum_beyond(rows, unit, 1 / k, parts, arithmetic().characteristic)
    return place in ("beyond", "on"), "spectrum"


def _sliding_part(request: InputRequest) -> SlidingPart | None:
    """Bound the sliding part of every input; None where there is none."""
    protocol, sigma0 = request.protocol.reaching, request.sigma0
    if protocol is None or sigma0 is None:
        return None
    own = sliding_part(protocol.parameters, sigma0)
    return SlidingPart(sliding_bounded(protocol.parameters), None if own is None else tuple(own))


def _reaching_phase(request: InputRequest) -> Reaching | None:
    """Return how the sliding variables move; None if they do not."""
    protocol, sigma0, times = request.protocol.reaching, request.sigma0, request.reaching
    if protocol is None or sigma0 is None or not any(sigma0):
        return None
    drive, push = protocol.reaching_gain, protocol.mu1 + protocol.delta
    quiet = None if times is None else last_time(times, sigma0)
    return Reaching(sigma0, protocol.T_r, protocol.T_s, drive.rho1, drive.pole, push, quiet)


def full_constants(form: Form, n: int) -> tuple[Fraction, ...] | None:
    """Return ``c_k`` with ``e_k^2 <= c_k E'P E`` for a full ``P``, a little above the diagonal of its inverse."""
    P, scale = form.entries
    above = arithmetic().above(P, [[int(i == j) for j in range(len(P))] for i in range(len(P))])
    with suppress(OverflowError):
        if above is not None:
            by_node = {v: round_up(x * scale * (1 + RAISE)) for v, x in zip(form.nodes, above, strict=True)}
            return tuple(by_node.get(v, Fraction(0)) for v in range(n))
    return None


def _peak(bounds: InputBounds, functions: Sequence[int], own: Sequence[Fraction]) -> Peak | None:
    """Bound the peak of every agent's input, and of the norm; ``own`` is that of the sliding parts."""
    agents = [best_bound(bounds, peak_above, v, functions) for v in range(len(bounds.rows))]
    norm = best_bound(bounds, peak_above, None, functions)
    how = tuple(a for a in agents if a is not None)
    if norm is None or len(how) < len(agents):
        return None
    with suppress(OverflowError):
        whole = round_up(norm.value + root_above(sum((x * x for x in own), Fraction(0))))
        return Peak(tuple(round_up(a.value + x) for a, x in zip(how, own, strict=True)), how, whole, norm)
    return None
