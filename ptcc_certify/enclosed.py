"""The final state of a large graph in proved intervals: exact leaders, followers by one solve and its residual.

With ``u > 0`` and ``M(L_F) u > 0``, any approximation ``y`` of the followers' end has

    |x_F - y|  <=  max_i(|r_i| / (M(L_F) u)_i) u,      r = L_F y + L_FL x_L.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from lmi.errors import LMIError
from lmi.iterative import SparseHMatrix
from ptcc_certify.bounds import float_above
from ptcc_certify.outcomes import Influence, follower_state
from ptcc_certify.structure import Structure

#: Residuals and products are computed in floats; their bounds are widened by these shares.
_ROUNDING, _WIDER = 1e-13, 1.01


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


def enclose(structure: Structure, influence: Influence, start: Sequence[Fraction] | None) -> EnclosedOutcome | None:
    """Enclose ``Q start``; None where a leader group is too large for exact voices, or no witness was found.

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
        return None
    u = np.ones(n)
    if F.size:
        try:
            matrix = SparseHMatrix(structure.graph.laplacian().tocsr()[F][:, F])
            u[F] = (matrix.certificate(0.0).witness or ())[0]
        except LMIError:
            return None
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
    if F.size:
        state = np.array([float(x) for x, _ in final])
        state[F] = follower_state(structure, state)
        rows = structure.graph.laplacian().tocsr()[F]
        residual = np.abs(rows @ state) + _ROUNDING * (abs(rows) @ np.abs(state))
        error = float((residual / (matrix.M @ u[F])).max()) * _WIDER
        for v in F.tolist() if error else ():
            final[v] = (Fraction(float(state[v])), Fraction(float_above(Fraction(error * u[v] * _WIDER + 1e-300))))
    return EnclosedOutcome(tuple(final), tuple(degenerate), tuple(u.tolist()))
