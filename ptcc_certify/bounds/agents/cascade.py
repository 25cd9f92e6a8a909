r"""How near double integrators of the cascade are to their common motion, and what they need for it.

With ``q_k = x_k' - eta e_k``: ``q' = -alpha eta q`` and ``X' = -eta L X + q``, so ``q = e^(-alpha s) q(0)``. Let
``Z`` be the form of a Lyapunov function of the graph in the state, ``Z L + L'Z >= beta Z``, ``|X|^2 = X'Z X``. Then

    |X(t)| <= e^(-beta s/2) |X(0)| + |q(0)| I(t),   I(t) = int_0^t e^(-(beta/2)(s(t) - s(r)) - alpha s(r)) dr

in every coordinate, and so in the Euclidean norm over them. With ``b = beta/2``, ``k = rho2 kappa``,
``rest = 1 - t/T``, ``m = min(alpha, b)``

    I <= T e^(-m rho1 t) (rest^(b k) - rest^(alpha k + 1))/(alpha k + 1 - b k),
    I <= (e^(-b s) - e^(-alpha s))/((alpha - b) eta(0))

the first being exact for ``rho1 = 0``; fractions stand for their limits where numbers coincide.

Where ``L`` is far larger than its rate, ``|q(0)|`` is, too. With ``' = d/ds``, ``g = alpha + theta``, ``theta =
eta'/eta``, ``G`` the integral of ``g`` and ``r = X' + g X``: ``r' = -L r + theta' X`` and ``X'' + g X' = -L r``. So
with ``R >= |r|``, ``S >= |X|``

    R' = -b R + theta' S,   S = e^-G S(0) + J,   J' = -g J + R,   J(0) = 0,   e^-G = e^(-alpha s) eta(0)/eta

and no ``L`` is in ``r(0) = x'(0)/eta(0) + g(0) X(0)``. An agent whose deviations and errors have the constants ``c``
and ``c^E`` deviates by at most ``sqrt(c) S``, and its velocity by the lesser of ``eta sqrt(c) (R + g S)`` and ``eta
sqrt(c^E) J + e^(-alpha s) sqrt(c) |x'(0)|``. Both bounds of ``|X|`` hold; :func:`course` steps through the latter.

Lyapunov functions of agents of order n where halves of the time are left, as the check encloses them.

Of agents by one matrix they are of ``y``; of the cascade of positions and of ``r``, of which its bounds are made.

What a function is worth there, of the motion from one initial state, is far less than its decay says: most of it is of
motions that die sooner.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from fractions import Fraction
from itertools import islice
from typing import NamedTuple

import numpy as np

from lmi.exact.decimal_rounding import float_down, float_up
from lmi.exact.elementary_enclosures import rounded
from lmi.exact.work import WorkError, limited
from ptcc_certify.bounds.agents.each_agent import States, checked_function, checked_graph, root_product
from ptcc_certify.bounds.input.tightest_bound import round_up
from ptcc_certify.checker.agent_bounds import Begin
from ptcc_certify.checker.agent_cascade import drive_of, halvings_of, input_size, roots_above
from ptcc_certify.checker.agent_instants import halvings, value_above
from ptcc_certify.checker.agent_model import Cascade
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.lyapunov.function import LyapunovFunction
from ptcc_certify.model.agents_protocol import CascadeProtocol
from ptcc_certify.model.gain import Gain

#: By this share what is formed in floats is enlarged.
_ROOM = 1e-9
#: Steps of a course, more or less, each by the same share of what remains.
_STEPS = 400


class Roots(NamedTuple):
    """Of a Lyapunov function not below ``sqrt(V)`` of the initial positions, of ``q(0)``, ``r(0)``, and velocities."""

    state: Fraction
    drive: Fraction
    combined: Fraction | None = None
    velocity: Fraction | None = None


class Course(NamedTuple):
    """Bounds of ``R``, ``S`` and ``J`` at some instants, and ``g`` there."""

    combined: np.ndarray
    state: np.ndarray
    integral: np.ndarray
    pull: np.ndarray


def checked_agents(protocol: CascadeProtocol) -> Cascade:
    """Return agents of the cascade as the check reads them."""
    return Cascade(2, len(protocol.offsets[0]), protocol.plant, protocol.own, None, protocol.gain.exact)


def roots_of(
    structure: Structure, protocol: CascadeProtocol, functions: Sequence[LyapunovFunction], states: States
) -> tuple[Roots, ...]:
    """Return what every function is worth at the beginning.

    Of positions less places, ``q(0) = x'(0) - eta e(0)``, ``r(0) = x'(0)/eta + (alpha + theta)(x(0) - h)``, and
    velocities, as the check forms them.

    Examples
    --------
    >>> from ptcc_certify.model import NominalProtocol
    >>> pair, x0 = SignedDigraph.from_edges([("a", "b", 1)]), [1, 0]
    >>> fast = NominalProtocol(T=1, rho1=1, rho2=4, kappa=1)
    >>> part = certify(pair, fast, x0, agents=Agents(order=2, cascade=1), asks=Asks(method="paper")).agents
    >>> roots_of(part.structure, part.protocol, part.functions, part.initial_state) == part.roots
    True
    """
    graph, agents = checked_graph(structure), checked_agents(protocol)
    drive = drive_of(graph, agents, states, protocol.offsets)
    vectors = drive.positions, drive.error, drive.combined(agents), drive.velocities
    return tuple(Roots(*(root_product(x.value(graph, checked_function(V))) for x in vectors)) for V in functions)


def drive_integral(gain: Gain, rate: Fraction, alpha: Fraction, remaining: np.ndarray) -> np.ndarray:
    """Return ``I`` where ``1 - t/T`` is ``remaining``, above 0, from above.

    Examples
    --------
    >>> late = drive_integral(Gain(T=1, rho1=1, rho2=1, kappa=2), Fraction(4), Fraction(1), np.array([1.0, 0.01]))
    >>> float(late[0]), bool(0 < late[1] < 1e-3)
    (0.0, True)
    """
    q = np.asarray(remaining, dtype=float)
    T, rho1 = float(gain.T), float(gain.rho1)
    a, b = float_down(alpha), float_down(rate / 2)
    k = float(gain.pole)
    z, slowest = np.log(1 / q), min(a, b)
    s = gain.clock_at_remaining(q)
    first = T * np.exp(-slowest * rho1 * T * (1 - q) - min(b * k, a * k + 1) * z) * _falling(abs(a * k + 1 - b * k), z)
    second = np.exp(-slowest * s) * _falling(abs(a - b), s) / float(gain.first)
    return np.minimum(first, second) * (1 + _ROOM)


def course(
    gain: Gain, rate: Fraction, alpha: Fraction, roots: Roots, remaining: np.ndarray, begin: float = 1.0
) -> Course:
    """Return bounds of ``R``, ``S`` and ``J`` where ``1 - t/T`` is ``remaining``, above 0, from above.

    The roots are those where it is ``begin``, from which on ``J`` counts.

    Step by step: in a step in which ``theta`` grows by ``d`` and ``s`` by ``D``, let ``m = int e^(-g s)`` over it, with
    the ``g`` it begins with. ``S <= (S + m R)/(1 - m d)`` all along, which times ``d`` is what ``theta' S`` adds to
    ``R``.

    Examples
    --------
    >>> gain, one = Gain(T=1, rho1=1, rho2=1, kappa=2), Fraction(1)
    >>> late = course(gain, 2 * one, one, Roots(one, one, one), np.array([1.0, 0.01]))
    >>> bool(1 <= late.state[0] < 1.01), bool(0 < late.state[1] < 1e-3)
    (True, True)
    """
    steps_of_course = _STEPS if begin == 1 else 20 + int(15 * math.log2(begin / remaining.min()))
    q = np.unique(np.concatenate([np.geomspace(remaining.min(), begin, steps_of_course), remaining]))[::-1]
    a, b = float_down(alpha), float_down(rate / 2)
    k, linear = float(gain.pole), float(gain.rho1 * gain.T)
    past = linear * q + k  # eta (T - t)
    theta = (k / past) ** 2 / k
    grows = linear * (q[:-1] - q[1:]) / (past[:-1] * past[1:]) * (k / past[:-1] + k / past[1:])
    steps = linear * (q[:-1] - q[1:]) + k * np.log(q[:-1] / q[1:])
    falls = np.exp(-a * steps) * (past[:-1] / past[1:]) * (q[1:] / q[:-1])  # of e^-G
    R, first = float_up(roots.combined or Fraction(0)), float_up(roots.state)
    S, J = first, 0.0
    values = np.empty((len(q), 3))
    values[0] = R, S, J
    for i, (D, d, fall) in enumerate(zip(steps.tolist(), grows.tolist(), falls.tolist(), strict=True)):
        g = a + float(theta[i])
        m = float(_falling(g, D))
        if m * d > 0.5:
            values[i + 1 :] = np.inf
            break
        more = d * (S + m * R) / (1 - m * d)
        J = J * fall + R * math.exp(-min(b, g) * D) * float(_falling(abs(b - g), D)) + more * m
        R, first = R * math.exp(-b * D) + more, first * fall
        S = first + J
        values[i + 1] = R, S, J
    values *= 1 + _ROOM
    at = len(q) - 1 - np.searchsorted(q[::-1], remaining)
    combined, state, integral = values[at].T
    return Course(combined, state, integral, float_up(alpha) + theta[at])


def _falling(x: float, z: np.ndarray) -> np.ndarray:
    """Return ``(1 - e^(-x z))/x``; ``z`` for ``x = 0``."""
    return np.abs(np.expm1(-x * z)) / x if x else z


def input_from(
    gain: Gain,
    alpha: Fraction,
    rate: Fraction,
    constants: Sequence[Fraction],
    state: Fraction,
    combined: Fraction,
    speeds: Sequence[Fraction],
) -> tuple[Fraction, ...]:
    """Return bounds of the input from one Lyapunov function by which it is bounded.

        u = -eta^2 (L r + alpha X'),   r = X' + (alpha + theta) X,   ' = d/ds,   theta = eta'/eta^2
        |u_k| <= sqrt(c_k) eta(0)^2 (|r(0)| + (1/k - theta(0)) |X(0)|) max(1, (a + alpha)/(a + b)) + alpha eta(0) |v_k|

    with ``a = alpha - 1/k``, ``b = rate/2 - 2/k``, ``e_k^2 <= c_k V``.

    Parameters
    ----------
    constants : sequence of N Fraction
        ``c_k``.
    state, combined : Fraction
        Not below ``sqrt(V)`` of ``X(0)``, and of ``r(0)``.
    speeds : sequence of N Fraction
        Not below ``|v_k|``, the initial speeds.

    Examples
    --------
    >>> one, gain = Fraction(1), Gain(T=1, rho1=1, rho2=1, kappa=1)  # eta = 2, k = 1, theta = 1/4
    >>> [round(float(x), 6) for x in input_from(gain, 2 * one, 4 * one, [4 * one], one, 3 * one, [one])]
    [94.0]
    """
    zero = Fraction(0)
    agents = Cascade(2, 1, (zero, zero), (zero, alpha), None, gain.exact)
    size, pairs = input_size(agents, rate, state, combined), zip(constants, speeds, strict=True)
    return tuple(round_up(root_product(c) * size + alpha * gain.first * speed) for c, speed in pairs)


Values = tuple[Fraction | None, ...]
#: Instants at most; GB whose share of work they may take, a small part of what a check may.
INSTANTS, WORK = 10, 0.1
#: Bits of values.
BITS = 64


def instant_values(begin: Begin, functions: Sequence[LyapunovFunction]) -> tuple[Values, ...]:
    """Return bounds of ``V`` at ``T (1 - 2^-i)``, ``i = 1, 2, ..``, of those functions that bound a deviation best.

    Empty where the gain is capped; as many as little work allows.
    """
    known = {k: V for k, V in enumerate(functions) if V.deviation is not None and V.form is not None}
    if begin.agents.cap is not None or not known:
        return ()
    graph, nodes, found = begin.graph, range(begin.graph.n), list[Values]()
    with suppress(WorkError), limited(WORK):
        read = {k: checked_function(V) for k, V in known.items()}
        deviations = {k: V.deviation.agents for k, V in known.items() if V.deviation is not None}
        instants = halvings(begin.agents, graph.laplacian_product, graph.unit, begin.states, begin.offsets)
        for at in islice(instants, INSTANTS):
            values = {k: rounded(value_above(begin, V, at), BITS, up=True) for k, V in read.items()}
            best = {min(known, key=lambda k: deviations[k][v] * values[k]) for v in nodes}
            found.append(tuple(values[k] if k in best else None for k in range(len(functions))))
    return tuple(found)


def instant_roots(
    structure: Structure, protocol: CascadeProtocol, functions: Sequence[LyapunovFunction], states: States
) -> tuple[Values, ...]:
    """Return bounds of ``sqrt(V)`` of positions and of ``r``, function after function, at ``T (1 - 2^-i)``.

    Of those functions alone that bound a position best; as many instants as little work allows.
    """
    known = {k: V for k, V in enumerate(functions) if V.deviation is not None and V.form is not None}
    if not known:
        return ()
    agents = checked_agents(protocol)
    nodes, found, remaining = range(structure.graph.n_nodes), list[Values](), Fraction(1)
    with suppress(WorkError), limited(WORK):
        graph, read = checked_graph(structure), {k: checked_function(V) for k, V in known.items()}
        deviations = {k: V.deviation.agents for k, V in known.items() if V.deviation is not None}
        for at in islice(halvings_of(graph, agents, states, protocol.offsets), INSTANTS):
            remaining /= 2
            roots = {k: roots_above(graph, agents, V, at, remaining) for k, V in read.items()}
            best = {min(known, key=lambda k: deviations[k][v] * roots[k][0] ** 2) for v in nodes}
            told = [roots[k] if k in best else (None, None) for k in range(len(functions))]
            found.append(tuple(None if x is None else rounded(x, BITS, up=True) for pair in told for x in pair))
    return tuple(found)
