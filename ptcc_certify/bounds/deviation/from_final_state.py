"""How far each agent is from its final state, given a bound on ``V``.

In the state, a Lyapunov function is ``V = x'F x``, and ``x - Q x = D x``; both vanish on the kernel of ``L``, so that
only rows and columns ``nodes`` count: all nodes but the first one of each balanced closed component. There

    |x_k - (Q x)_k|^2 <= c_k V,    c_k = d_k' F^-1 d_k,

``d_k`` a row of ``D``: the best constants there are. The largest eigenvalue of ``D F^-1 D'`` bounds ``||x - Q x||^2``.
All constants come from one factor of ``F`` in floats and are raised by more than its rounding errors, which are seen in
what it leaves of the identity; where they are too large, from one in integers. The check proves them; where ``D'D``
would take it too long, the sum of the ``c_k`` bounds ``||x - Q x||^2``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from fractions import Fraction
from functools import cached_property

import numpy as np

from lmi.exact import arithmetic
from lmi.exact.elementary_enclosures import rounded
from lmi.exact.fast import floats, unit_diagonal
from lmi.exact.numbers import longest
from lmi.exact.work import EACH_BYTE, GB, cost
from ptcc_certify.bounds.final_state.of_graph import Influence
from ptcc_certify.bounds.input.initial_sets import ways
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.lyapunov.function import DeviationBound, LyapunovFunction
from ptcc_certify.theorems.lemmas import integer_matrix, integer_rows

#: Bits of the constants.
CONSTANT_BITS = 40
#: How near a factor in floats must take a form to the identity for constants of agents, and for that of the norm.
NEAR, FAR = 2.0**-30, 2.0**-12
#: Below this squares of floats may have lost digits.
LEAST = 2.0**-900
#: By how much constants are raised, relatively, so that they are quick to prove; that of the norm instead.
RAISE, NORM_RAISE = Fraction(1, 2**36), Fraction(1, 2**22)
#: What ``D'D`` may cost the check: a part of what it may spend for a GB.
GRAM_WORK = EACH_BYTE * GB // 4

Integers = list[list[int]]


class DeviationGeometry:
    """What turns a bound on Lyapunov functions into bounds of ``x - Q x``, for one graph.

    Parameters
    ----------
    structure : Structure
    influence : Influence
        ``Q`` in rationals.
    """

    def __init__(self, structure: Structure, influence: Influence):
        self._structure, self._influence = structure, influence

    def bound(self, V: LyapunovFunction) -> DeviationBound | None:
        """Return the constants of ``V``, or None where it is not seen to be definite."""
        F, scale = self._error_form(V) if V.coordinates == "E" else self._mean_form(V.weights)
        D, common = self._deviation
        unit, constants = scale / common**2, _constants(F, D)
        if constants is None:
            return None
        *agents, norm = (rounded(x * unit, CONSTANT_BITS, up=True) for x in constants)
        return DeviationBound(tuple(agents), norm if self._short else sum(agents, Fraction(0)))

    @cached_property
    def _short(self) -> bool:
        """Whether the check can form ``D'D``."""
        (D, _), width = self._deviation, len(self._nodes)
        bits = longest(x for row in D for x in row)
        return cost(width**2 * len(D) // 2, bits, bits) <= GRAM_WORK

    @cached_property
    def _nodes(self) -> list[int]:
        """All nodes but the first one of each balanced closed component."""
        first = {c.nodes[0] for c in self._influence.balanced}
        return [v for v in range(self._structure.graph.n_nodes) if v not in first]

    @cached_property
    def _laplacian(self) -> tuple[Integers, int]:
        """``L`` times a scale on the columns ``nodes``, and the scale."""
        return self._on_nodes(self._structure.graph.exact_rows(range(self._structure.graph.n_nodes)))

    @cached_property
    def _deviation(self) -> tuple[Integers, int]:
        """``D = I - Q`` times a scale on the columns ``nodes``, and the scale."""
        return self._on_nodes(ways(self._influence))

    def _on_nodes(self, rows: Sequence[Mapping[int, Fraction]]) -> tuple[Integers, int]:
        """Return sparse rows times a scale on the columns ``nodes``, and the scale."""
        return _over_one_scale([[row.get(j, Fraction(0)) for j in self._nodes] for row in rows])

    def _error_form(self, V: LyapunovFunction) -> tuple[Integers, Fraction]:
        """Return ``L'P L`` times a scale on ``nodes``, and the scale."""
        import flint

        L, unit = self._laplacian
        rows = flint.fmpz_mat([L[v] for v in V.nodes])
        if V.matrix is None:
            (weights,), scale = _over_one_scale([V.weights])
            product = flint.fmpz_mat([[w * x for x in L[v]] for v, w in zip(V.nodes, weights, strict=True)])
        else:
            P, scale = integer_matrix(V.matrix)
            product = P * rows
        return integer_rows(rows.transpose() * product), Fraction(scale * unit**2)

    def _mean_form(self, p: Sequence[Fraction]) -> tuple[Integers, Fraction]:
        """Return ``Z = G (P - p p'/p'1) G``, whose form is ``eps'P eps``, times a scale on ``nodes``, and the scale."""
        (weights,), scale = _over_one_scale([p])
        (gauge,), total = (c.gauge or () for c in self._influence.balanced), sum(weights)
        Z = [
            [gauge[i] * gauge[j] * weights[i] * (total * (i == j) - weights[j]) for j in self._nodes]
            for i in self._nodes
        ]
        return Z, Fraction(total * scale)


def _over_one_scale(rows: Sequence[Sequence[Fraction]]) -> tuple[Integers, int]:
    """Return rational rows times their common denominator, and that."""
    whole, scale = integer_matrix(rows)
    return integer_rows(whole), scale


def _constants(F: Integers, D: Integers) -> list[Fraction] | None:
    """Return ``d'F^-1 d`` for the rows ``d`` of ``D`` and the largest eigenvalue of ``D F^-1 D'``, a little raised.

    By floats where they are sharp enough, else in integers; there the last one may be the sum of the others. None where
    ``F > 0`` is not proved.
    """
    image, power, apart = _factor(F, D)
    unit, sizes = Fraction(4) ** power, (image**2).sum(axis=1).tolist()
    if apart <= NEAR and all(x > LEAST or not any(d) for x, d in zip(sizes, D, strict=True)):
        values = [Fraction(x) * unit * (1 + Fraction(64 * apart)) for x in sizes]
    else:
        exact = arithmetic().above(F, D)
        if exact is None:
            return None
        values = exact
    norm = sum(values, Fraction(0))
    if apart <= FAR and (size := float(np.linalg.norm(image, 2)) if image.size else 0.0) ** 2 > LEAST:
        norm = min(norm, Fraction(size) ** 2 * unit * (1 + max(NORM_RAISE, Fraction(64 * apart))))
    return [x * (1 + RAISE) for x in (*values, norm)]


def _factor(F: Integers, D: Integers) -> tuple[np.ndarray, int, float]:
    """Return ``D Z`` over a power of two, that power, and how far ``Z'F Z`` is from the identity, in floats."""
    rows, power = floats(D)
    with np.errstate(all="ignore"):
        try:
            T, halves = unit_diagonal(F)
            Z = np.linalg.inv(np.linalg.cholesky(T)).T
        except np.linalg.LinAlgError:
            return np.zeros_like(rows), 0, math.inf
        least = min(halves, default=0)
        image, power = np.ldexp(rows, [least - half for half in halves]) @ Z, power - least
        # besides what the rounding of T may hide: of an ill-conditioned T floats see another matrix
        off = np.abs(Z.T @ T @ Z - np.eye(len(T))) + 2.0**-50 * (np.abs(Z.T) @ np.abs(T) @ np.abs(Z))
        apart = float(off.sum(axis=1).max(initial=0.0))
        finite = bool(np.isfinite((image**2).sum()))
    return (image, power, apart) if finite else (np.zeros_like(rows), 0, math.inf)
