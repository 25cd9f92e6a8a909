r"""How near double integrators of the cascade are to their common motion, and what they need for it.

With ``q_k = x_k' - eta e_k``: ``q' = -alpha eta q`` and ``X' = -eta L X + q``, so ``q = e^(-alpha s) q(0)``. Let
``Z`` be the form of a Lyapunov function of the graph in the state, ``Z L + L'Z >= beta Z``, ``|X|^2 = X'Z X``. Then

    |X(t)| <= e^(-beta s/2) |X(0)| + |q(0)| I(t),   I(t) = int_0^t e^(-(beta/2)(s(t) - s(r)) - alpha s(r)) dr

in every coordinate, and so in the Euclidean norm over them. With ``b = beta/2``, ``k = rho2 kappa``,
``rest = 1 - t/T``, ``m = min(alpha, b)``

    I <= T e^(-m rho1 t) (rest^(b k) - rest^(alpha k + 1))/(alpha k + 1 - b k),
    I <= (e^(-b s) - e^(-alpha s))/((alpha - b) eta(0))

the first being exact for ``rho1 = 0``; fractions stand for their limits where numbers coincide.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from lmi.exact.decimal_rounding import float_down
from ptcc_certify.bounds.agents import States, initial_value, root_product
from ptcc_certify.bounds.input.tightest_bound import round_up
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.lyapunov.function import LyapunovFunction
from ptcc_certify.protocols.gain import Gain

Rows = tuple[tuple[Fraction, ...], ...]
#: By this share what is formed in floats is enlarged.
_ROOM = 1e-9


class Roots(NamedTuple):
    """Of a Lyapunov function not below ``sqrt(V)`` of the initial positions, and of ``q(0)``."""

    state: Fraction
    drive: Fraction


def positions_of(states: States, offsets: Sequence[Sequence[Fraction]]) -> Rows:
    """Return ``x_k(0) - h_k``.

    Examples
    --------
    >>> one = Fraction(1)
    >>> positions_of((((3 * one, one),),), [[one]])
    ((Fraction(2, 1),),)
    """
    pairs = zip(states, offsets, strict=True)
    return tuple(tuple(chain[0] - x for chain, x in zip(agent, h, strict=True)) for agent, h in pairs)


def tracking_error(structure: Structure, states: States, offsets: Sequence[Sequence[Fraction]], eta: Fraction) -> Rows:
    """Return ``q_k(0) = x_k'(0) - eta e_k(0)``.

    Examples
    --------
    >>> allies, (zero, one) = analyse(SignedDigraph.from_edges([("a", "b", 1)])), (Fraction(0), Fraction(1))
    >>> tracking_error(allies, (((one, zero),), ((zero, one),)), [[zero]] * 2, 2 * one)  # b: 1 - 2 (1 - 0)
    ((Fraction(0, 1),), (Fraction(-1, 1),))
    """
    X, rows = positions_of(states, offsets), structure.graph.exact_rows(range(structure.graph.n_nodes))
    return tuple(
        tuple(
            chain[1] + eta * sum((a * X[j][axis] for j, a in row.items()), Fraction(0))
            for axis, chain in enumerate(agent)
        )
        for agent, row in zip(states, rows, strict=True)
    )


def roots_of(structure: Structure, V: LyapunovFunction, positions: Rows, error: Rows) -> Roots:
    """Return ``sqrt(V)`` of positions and of ``q(0)``, rounded up."""
    one = ((Fraction(1),),)
    state, drive = (
        root_product(initial_value(structure, V, one, tuple(tuple((x,) for x in row) for row in rows)))
        for rows in (positions, error)
    )
    return Roots(state, drive)


def drive_integral(gain: Gain, rate: Fraction, alpha: Fraction, remaining: np.ndarray) -> np.ndarray:
    """Return ``I`` where ``1 - t/T`` is ``remaining``, above 0, from above.

    Examples
    --------
    >>> late = drive_integral(Gain(T=1, rho1=1, rho2=1, kappa=2), Fraction(4), Fraction(1), np.array([1.0, 0.01]))
    >>> float(late[0]), bool(0 < late[1] < 1e-3)
    (0.0, True)
    """
    q, T, rho1 = np.asarray(remaining, dtype=float), float(gain.T), float(gain.rho1)
    a, b, k = float_down(alpha), float_down(rate / 2), float(gain.pole)
    z, slowest = np.log(1 / q), min(a, b)
    s = gain.clock_at_remaining(q)
    first = T * np.exp(-slowest * rho1 * T * (1 - q) - min(b * k, a * k + 1) * z) * _falling(abs(a * k + 1 - b * k), z)
    second = np.exp(-slowest * s) * _falling(abs(a - b), s) / float(gain.first)
    return np.minimum(first, second) * (1 + _ROOM)


def _falling(x: float, z: np.ndarray) -> np.ndarray:
    """Return ``(1 - e^(-x z))/x``; ``z`` for ``x = 0``."""
    return np.abs(np.expm1(-x * z)) / x if x else z


def input_constants(structure: Structure, constants: Sequence[Fraction], k: Fraction) -> tuple[Fraction, ...]:
    """Return ``G_k`` with ``|(theta e - L e)_k| <= G_k sqrt(V)`` for ``theta`` from 0 to ``1/k``, ``e_l^2 <= c_l V``.

    ``G_k = sum_l R_kl sqrt(c_l)``, ``R_kl = |L_kl|``, ``R_kk = max(L_kk, 1/k - L_kk)``.

    Examples
    --------
    >>> leader_and_follower = analyse(SignedDigraph.from_edges([("a", "b", 1)]))
    >>> [float(x) for x in input_constants(leader_and_follower, [Fraction(0), Fraction(4)], Fraction(1, 3))]
    [0.0, 4.0]
    """
    roots = [root_product(c) for c in constants]
    found = []
    for v, row in enumerate(structure.graph.exact_rows(range(structure.graph.n_nodes))):
        own = row.get(v, Fraction(0))
        others = sum((abs(a) * roots[j] for j, a in row.items() if j != v), Fraction(0))
        found.append(max(own, 1 / k - own) * roots[v] + others)
    return tuple(found)


def input_is_bounded(k: Fraction, rate: Fraction, alpha: Fraction) -> bool:
    """Tell whether ``eta^2 |e|`` and ``eta |q|`` are proved not to grow without limit: ``b k >= 2``, ``alpha k >= 1``.

    Not with both as equations: then ``eta^2 I`` grows like ``s``.

    Examples
    --------
    >>> [input_is_bounded(Fraction(1), Fraction(r), Fraction(a)) for r, a in ((4, 1), (5, 1), (4, 2), (3, 9))]
    [False, True, True, False]
    """
    return rate * k >= 4 and alpha * k >= 1 and rate * k + alpha * k > 5


def input_from(
    structure: Structure,
    gain: Gain,
    alpha: Fraction,
    rate: Fraction,
    constants: Sequence[Fraction],
    roots: Roots,
    error: Rows,
) -> tuple[Fraction, ...]:
    """Return bounds of the input from one Lyapunov function by which it is bounded.

        u = eta^2 (theta e - L e) - eta (L + alpha) q
        eta^2 I <= eta(0)/(a + b),   a = alpha - 1/k,   b = rate/2 - 2/k

    so ``|u_k| <= G_k (eta(0)^2 sqrt(V(x)) + eta(0) sqrt(V(q(0)))/(a + b)) + eta(0) |((L + alpha) q(0))_k|``: neither
    ``eta^2 e^(-rate s/2)`` nor ``eta e^(-alpha s)`` grows.
    """
    k, eta = gain.pole, gain.first
    spare = alpha - 1 / k + rate / 2 - 2 / k
    size = eta**2 * roots.state + eta * roots.drive / spare
    each = input_constants(structure, constants, k)
    rows = structure.graph.exact_rows(range(structure.graph.n_nodes))
    bounds = []
    for v, (row, factor) in enumerate(zip(rows, each, strict=True)):
        pushed = [sum((a * error[j][axis] for j, a in row.items()), alpha * x) for axis, x in enumerate(error[v])]
        late = root_product(sum((x * x for x in pushed), Fraction(0)))
        bounds.append(round_up(factor * size + eta * late))
    return tuple(bounds)
