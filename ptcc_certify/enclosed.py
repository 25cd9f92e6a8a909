"""The final state of a large graph in intervals: exact leaders, followers by one solve and its residual.

With ``u > 0`` and ``M(L_F) u > 0``, any approximation ``y`` of the followers' end has

    |x_F - y|  <=  max_i(|r_i| / (M(L_F) u)_i) u,      r = L_F y + L_FL x_L.

The residual is taken in floats with room for their rounding, or in rationals where that room is too wide; the check of
the certificate forms it exactly.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from lmi.errors import LMIError
from lmi.iterative import SparseHMatrix, solve
from ptcc_certify.outcomes import Influence, follower_state
from ptcc_certify.structure import Structure

#: Decimals of a middle and of a radius, in units of the largest entry of the start.
_DIGITS, _RADIUS_DIGITS = 17, 30
#: Room for the rounding of a residual in floats, and the radius up to which it is narrow enough.
_ROUNDING, _NARROW = 1e-12, 4e-7


class NotEnclosedError(ArithmeticError):
    """No interval was found; the message tells why."""


@dataclass(frozen=True, eq=False)
class EnclosedOutcome:
    """The final state in intervals, and what proves them.

    Attributes
    ----------
    final : tuple of N (middle, radius), or None without a start
    degenerate : tuple of int, or None without a start
        1-based numbers of the balanced closed components that meet at 0.
    witness : tuple of N float
        ``u``; 1 for leaders.
    """

    final: tuple[tuple[Fraction, Fraction], ...] | None
    degenerate: tuple[int, ...] | None
    witness: tuple[float, ...]


def enclose(structure: Structure, influence: Influence, start: Sequence[Fraction] | None) -> EnclosedOutcome:
    """Enclose ``Q start``.

    Raises
    ------
    NotEnclosedError
        A leader group is too large for exact voices, or the followers' equations are too ill-conditioned for floats.

    Examples
    --------
    >>> from ptcc_certify.graph import SignedDigraph
    >>> from ptcc_certify.outcomes import influence
    >>> from ptcc_certify.structure import analyse
    >>> st = analyse(SignedDigraph.from_edges([("a", "c", 1), ("b", "c", -2)]))
    >>> found = enclose(st, influence(st, exact=False), [Fraction(1), Fraction(0), Fraction(1)])
    >>> middle, radius = found.final[1]
    >>> abs(middle + Fraction(1, 3)) <= radius < 1e-9  # the follower c ends at -1/3
    True
    """
    n, F = structure.graph.n_nodes, structure.followers
    if not all(isinstance(w, Fraction | int) for voice in influence.voices for w in voice):
        largest = max(len(c.nodes) for c in influence.balanced)
        raise NotEnclosedError(f"a balanced leader group has {largest} nodes")
    u, matrix = np.ones(n), None
    if F.size:
        with np.errstate(all="ignore"):
            try:
                matrix = SparseHMatrix(structure.graph.laplacian().tocsr()[F][:, F])
                u[F] = solve(matrix.M, matrix.diagonal, matrix.diagonal)  # rows of every size weigh alike
                u /= u.max()
                pushed = matrix.M @ u[F]
            except LMIError as error:
                raise NotEnclosedError(str(error)) from None
        if not (np.isfinite(u).all() and (u > 0).all() and np.isfinite(pushed).all() and (pushed > 0).all()):
            raise NotEnclosedError("the followers' equations are too ill-conditioned for floats")
    if start is None:
        return EnclosedOutcome(None, None, tuple(u.tolist()))
    final = [(Fraction(0), Fraction(0))] * n
    numbers = [k for k, c in enumerate(structure.closed_components, start=1) if c.balanced]
    degenerate = []
    for k, component, voice in zip(numbers, influence.balanced, influence.voices, strict=True):
        value = sum((Fraction(w) * start[v] for v, w in zip(component.nodes, voice, strict=True)), Fraction(0))
        degenerate += [k] if value == 0 else []
        for v, sign in zip(component.nodes, component.gauge or (), strict=True):
            final[v] = (sign * value, Fraction(0))
    top = max((abs(x) for x, _ in final), default=Fraction(0))
    if F.size and top:
        _enclose_followers(structure, final, u, top)
    return EnclosedOutcome(tuple(final), tuple(degenerate), tuple(u.tolist()))


def _enclose_followers(
    structure: Structure, final: list[tuple[Fraction, Fraction]], u: np.ndarray, top: Fraction
) -> None:
    """Fill in the followers, in a unit near to the largest leader."""
    F = structure.followers
    exponent = len(str(top.numerator)) - len(str(top.denominator))
    unit = Fraction(10) ** exponent
    rows = structure.graph.laplacian().tocsr()[F]
    state = np.array([float(x / unit) for x, _ in final])
    block = rows[:, F].tocsr()
    with np.errstate(all="ignore"):
        solved = follower_state(structure, state)
        if not np.isfinite(solved).all():
            raise NotEnclosedError("the followers' equations are too ill-conditioned for floats")
        middles = [Fraction(round(x * 10**_DIGITS), 10**_DIGITS) for x in solved.tolist()]
        state[F] = [float(x) for x in middles]
        comparison = 2 * block.diagonal() * u[F] - abs(block) @ u[F]
        residual = np.abs(rows @ state) + _ROUNDING * (abs(rows) @ np.abs(state))
        error = float((residual / comparison).max()) * 1.01
    if error * u[F].max() <= _NARROW:
        ratio = Fraction(error)
    else:
        known = [x / unit for x, _ in final]
        for v, x in zip(F.tolist(), middles, strict=True):
            known[v] = x
        ratio = _exact_ratio(structure, known, u)
    for v, x in zip(F.tolist(), middles, strict=True):
        radius = math.ceil(ratio * Fraction(float(u[v])) * 10**_RADIUS_DIGITS)
        final[v] = (x * unit, Fraction(radius, 10**_RADIUS_DIGITS) * unit)


def _exact_ratio(structure: Structure, state: Sequence[Fraction], u: np.ndarray) -> Fraction:
    """Return ``max_i |r_i| / (M(L_F) u)_i`` in rationals."""
    following = set(structure.followers.tolist())
    weights = [Fraction(float(x)) for x in u]
    ratio = Fraction(0)
    rows = structure.graph.exact_rows(structure.followers.tolist())
    for v, row in zip(structure.followers.tolist(), rows, strict=True):
        left = sum((x * state[j] for j, x in row.items()), Fraction(0))
        signs = ((weights[j] * (x if j == v else -abs(x))) for j, x in row.items() if j in following)
        pushed = sum(signs, Fraction(0))
        if pushed <= 0:
            raise NotEnclosedError("the followers' equations are too ill-conditioned for floats")
        ratio = max(ratio, abs(left) / pushed)
    return ratio
