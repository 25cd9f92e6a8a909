"""How far each agent is from its outcome, given a bound on ``V``.

The coordinates ``z`` of a Lyapunov function determine ``x - Q x``: for ``z = E`` on its rows,
``x - Q x = -(L + g Q)^-1 E`` with any ``g > 0``; for ``z = eps``, ``x - Q x = (I - Q) eps``. With ``x - Q x = R z`` and
``n_j' z = 0`` on the subspace of ``z``,

    |x_k - (Q x)_k|^2 <= c_k V,    c_k = [R P^-1 R' - R P^-1 N (N' P^-1 N)^-1 N' P^-1 R']_kk,

the best constants there are; the largest eigenvalue of that matrix bounds ``||x - Q x||^2``. Everything is computed in
ball arithmetic and rounded up.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ptcc_certify.outcomes import Influence
from ptcc_certify.structure import Structure

if TYPE_CHECKING:
    import flint

#: Bits of the balls, doubled until the constants are sharp.
_BITS, _MOST_BITS = 256, 4096
#: Bits of the constants that are kept.
_KEPT_BITS = 40
#: The largest eigenvalue is bounded by ``(tr C^(2^k))^(1/2^k)``, at most ``N^(1/2^k)`` too large.
_SQUARINGS = 9


@dataclass(frozen=True)
class DistanceBound:
    """``|x_k - (Q x)_k|^2 <= agents[k] V`` and ``||x - Q x||^2 <= norm V``, proved in ball arithmetic.

    Attributes
    ----------
    agents : tuple of N Fraction
    norm : Fraction
    """

    agents: tuple[Fraction, ...]
    norm: Fraction

    @cached_property
    def roots(self) -> np.ndarray:
        """``sqrt(agents)`` (N,), rounded up."""
        return np.array([root_above(c) for c in self.agents])

    @cached_property
    def norm_root(self) -> float:
        """``sqrt(norm)``, rounded up."""
        return root_above(self.norm)


def root_above(value: Fraction) -> float:
    """Return a float that is not below the square root of a nonnegative rational of any size.

    Examples
    --------
    >>> root_above(Fraction(10) ** 500) >= 1e250, root_above(Fraction(0))
    (True, 0.0)
    """
    if value == 0:
        return 0.0
    shift = (value.numerator.bit_length() - value.denominator.bit_length()) // 2
    root = math.sqrt(float(value * Fraction(4) ** -shift)) * (1 + 1e-15)
    try:
        return math.nextafter(math.ldexp(root, shift), math.inf)
    except OverflowError:
        return math.inf


class OutcomeGeometry:
    """What turns coordinates of a Lyapunov function into ``x - Q x``, for one graph.

    Parameters
    ----------
    structure : Structure
    influence : Influence
        ``Q`` in rationals.
    """

    def __init__(self, structure: Structure, influence: Influence):
        self._structure, self._influence = structure, influence

    def bound(
        self,
        coordinates: str,
        nodes: Sequence[int],
        diagonal: Sequence[Fraction] | None,
        matrix: Sequence[Sequence[Fraction]] | None,
    ) -> DistanceBound | None:
        """Return the constants of ``V = z' P z``, or None where the precision given was not enough.

        Parameters
        ----------
        coordinates : {"E", "eps"}
        nodes : sequence of int
            The rows of ``z``.
        diagonal, matrix
            ``P``, one of both.
        """
        import flint

        before, bits = flint.ctx.prec, _BITS
        try:
            while bits <= _MOST_BITS:
                flint.ctx.prec = bits
                found = self._constants(coordinates, nodes, diagonal, matrix)
                if found is not None:
                    return found
                bits *= 4
        finally:
            flint.ctx.prec = before
        return None

    def _constants(
        self,
        coordinates: str,
        nodes: Sequence[int],
        diagonal: Sequence[Fraction] | None,
        matrix: Sequence[Sequence[Fraction]] | None,
    ) -> DistanceBound | None:
        import flint

        n = self._structure.graph.n_nodes
        where = {v: i for i, v in enumerate(nodes)}
        try:
            if coordinates == "E":
                inverse, still = self._inverse(flint.ctx.prec), self._still
                R = flint.arb_mat([[flint.arb(0) if i in still else -inverse[i, v] for v in nodes] for i in range(n)])
            else:
                Q = self._projection
                R = flint.arb_mat([[_ball(int(i == v) - Q[i][v]) for v in nodes] for i in range(n)])
            normals = self._normals(coordinates, where, diagonal)
            both = flint.arb_mat([[R[i, j] for i in range(n)] + [c[j] for c in normals] for j in range(len(nodes))])
            if diagonal is not None:
                weighted = flint.arb_mat(
                    [[both[j, i] / _ball(w) for i in range(both.ncols())] for j, w in enumerate(diagonal)]
                )
            else:
                assert matrix is not None
                weighted = flint.arb_mat([[_ball(x) for x in row] for row in matrix]).solve(both)
            gram = both.transpose() * weighted
            C = flint.arb_mat([[gram[i, j] for j in range(n)] for i in range(n)])
            if normals:
                m = len(normals)
                mixed = flint.arb_mat([[gram[i, n + j] for j in range(m)] for i in range(n)])
                own = flint.arb_mat([[gram[n + i, n + j] for j in range(m)] for i in range(m)])
                C = C - mixed * own.solve(mixed.transpose())
        except ZeroDivisionError:  # a pivot that may be 0: more digits
            return None
        agents = []
        for i in range(n):
            if not _sharp(C[i, i]):
                return None
            agents.append(_above(C[i, i]))
        return DistanceBound(tuple(agents), _largest_eigenvalue(C, sum(agents, Fraction(0))))

    @cached_property
    def _still(self) -> set[int]:
        """Agents that listen to nobody: they are where they end."""
        return {c.nodes[0] for c in self._influence.balanced if len(c.nodes) == 1}

    @cached_property
    def _projection(self) -> list[list[Fraction]]:
        """``Q``, row by row."""
        rows = []
        n = self._structure.graph.n_nodes
        for node in range(n):
            row = [Fraction(0)] * n
            for v, weight in self._influence.row(node).items():
                row[v] = Fraction(weight)
            rows.append(row)
        return rows

    def _inverse(self, bits: int) -> flint.arb_mat:
        """Enclose ``(L + g Q)^-1``, with ``g`` the mean weight of an edge."""
        import flint

        kept = getattr(self, "_kept", None)
        if kept is not None and kept[0] == bits:
            return kept[1]
        L, Q = self._structure.graph.exact_laplacian(), self._projection
        n = len(L)
        g = sum((abs(L[i][i]) for i in range(n)), Fraction(0)) / n or Fraction(1)
        matrix = flint.arb_mat([[_ball(L[i][j]) + _ball(g * Q[i][j]) for j in range(n)] for i in range(n)])
        inverse = matrix.inv()
        self._kept = (bits, inverse)
        return inverse

    def _normals(
        self, coordinates: str, where: dict[int, int], diagonal: Sequence[Fraction] | None
    ) -> list[list[flint.arb]]:
        """Return the vectors orthogonal to ``z``: ``G_k eta_k`` of balanced groups for ``E``, ``P G 1`` for ``eps``."""
        import flint

        columns = []
        for component, voice in zip(self._influence.balanced, self._influence.voices, strict=True):
            if component.nodes[0] not in where:
                continue
            column = [flint.arb(0)] * len(where)
            for v, sign, weight in zip(component.nodes, component.gauge or (), voice, strict=True):
                entry = Fraction(weight) if coordinates == "E" else (diagonal or ())[where[v]] * sign
                column[where[v]] = _ball(entry)
            columns.append(column)
        return columns


def _ball(x: Fraction | int) -> flint.arb:
    import flint

    x = Fraction(x)
    return flint.arb(x.numerator) / flint.arb(x.denominator)


def _sharp(x: Any) -> bool:
    """Tell whether a ball is known to seven digits, or is 0."""
    return bool(x.is_finite()) and (x.rel_accuracy_bits() > 24 or x == 0)


def _above(x: Any) -> Fraction:
    """Return a short rational that is above every number of the ball, 0 if that is all it holds."""
    mantissa, exponent = (int(part) for part in x.upper().man_exp())
    if mantissa <= 0:
        return Fraction(0)
    extra = mantissa.bit_length() - _KEPT_BITS
    kept = mantissa >> extra if extra >= 0 else mantissa << -extra
    return Fraction(kept + 1) * Fraction(2) ** (exponent + extra)


def _largest_eigenvalue(C: Any, fallback: Fraction) -> Fraction:
    """Bound the largest eigenvalue of a positive semidefinite matrix by the trace of a power."""
    trace = C.trace() if hasattr(C, "trace") else sum((C[i, i] for i in range(C.nrows())), C[0, 0] * 0)
    if not trace > 0:
        return fallback
    power, scale = C / trace, trace
    exponent = 1
    for _ in range(_SQUARINGS):
        power = power * power
        exponent *= 2
        trace = sum((power[i, i] for i in range(power.nrows())), power[0, 0] * 0)
        if not (trace > 0 and trace.rel_accuracy_bits() > 24):
            break
        bound = _above(scale * trace.root(exponent))
        fallback = min(fallback, bound) if bound > 0 else fallback
    return fallback
