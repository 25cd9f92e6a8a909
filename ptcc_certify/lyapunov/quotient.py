"""The distance of a family of graphs to its common states at rest, as a linear system of its own.

``K`` is at rest in every member, ``B`` its basis (N, d), and ``p_1 .. p_d`` are *pivots*, nodes whose rows of ``B`` are
the unit vectors. Over the other nodes

    xi_k = x_k - sum_j B_kj x_(p_j),    xi = C X,    xi' = -gain A xi,    A = C L C^r

for every member ``L``, since ``L B = 0``; ``C^r`` puts ``xi`` on these nodes and 0 on the pivots. An uncertain weight
changes ``A`` by a matrix of rank one: ``A = A_0 + sum_e delta_e f_e h_e'``, ``|delta_e| <= r_e``.

References
----------
docs/theory/families.md, "Common quadratic functions" and "Uncertain weights".
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

import numpy as np

from lmi.uncertain_matrix import UncertainMatrix
from ptcc_certify.errors import HypothesisError
from ptcc_certify.graphs.family import Family, Mode
from ptcc_certify.graphs.structure import analyse
from ptcc_certify.theorems.family_behaviour import FamilyComponent, moving_rest_state
from ptcc_certify.theorems.kernel import Kernel, TooLarge
from ptcc_certify.theorems.lemmas import Matrix

Vector = tuple[Fraction, ...]


@dataclass(frozen=True)
class UncertainPart:
    """What one uncertain parameter adds: ``delta f h'`` with ``|delta| <= radius``.

    Attributes
    ----------
    edge : int
        The number of the edge in its mode; of an undirected edge that of the direction from the smaller node.
    f, h : tuple of n Fraction
        In the coordinates ``xi``.
    effect : dict of node to int
        ``f`` in the coordinates ``X``: 1 at the listener; of an undirected edge its sign, reversed, at the other end.
    radius : Fraction
        Half the length of the interval of ``|w|``.
    """

    edge: int
    f: Vector
    h: Vector
    effect: dict[int, int]
    radius: Fraction


@dataclass(frozen=True, eq=False)
class QuotientMode:
    """One mode: ``A = center + sum_e delta_e f_e h_e'``.

    Attributes
    ----------
    center : n rows of n Fraction
        ``A_0``, with all weights at the midpoints of their intervals.
    parts : tuple of UncertainPart
    rows : N rows of n Fraction
        ``L_0 C^r``: the input of each node is minus the gain times its row of this times ``xi``.
    """

    center: Matrix
    parts: tuple[UncertainPart, ...]
    rows: Matrix

    @cached_property
    def array(self) -> UncertainMatrix:
        """The same in floats."""
        n, q = len(self.center), len(self.parts)
        F, H = np.zeros((n, q)), np.zeros((n, q))
        for e, part in enumerate(self.parts):
            F[:, e], H[:, e] = [float(x) for x in part.f], [float(x) for x in part.h]
        A = np.array([[float(x) for x in row] for row in self.center]).reshape(n, n)
        return UncertainMatrix(A, F, H, np.array([float(part.radius) for part in self.parts]))

    @property
    def proof_rows(self) -> int:
        """Rows of the matrix that proves a rate: one for each coordinate and each multiplier."""
        return len(self.center) + len(self.parts)

    @property
    def at_rest(self) -> bool:
        """Whether nothing moves in this mode: a mode without edges, an outage."""
        return not self.parts and not any(map(any, self.center))

    @property
    def largest_entry(self) -> float:
        """The size of the largest entry of ``A_0``."""
        return max((float(abs(x)) for row in self.center for x in row), default=0.0)

    def member(self, levels: Sequence[Fraction]) -> Matrix:
        """Return ``A`` with each uncertain size at ``w- + level (w+ - w-)``, levels in the order of ``parts``."""
        A = [list(row) for row in self.center]
        for part, level in zip(self.parts, levels, strict=True):
            delta = (2 * level - 1) * part.radius
            for row, f in zip(A, part.f, strict=True):
                if f and delta:
                    row[:] = [x + delta * f * h for x, h in zip(row, part.h, strict=True)]
        return A


class Quotient:
    """The coordinates ``xi`` of a family whose states at rest have a common subspace.

    Parameters
    ----------
    family : Family
        Connected.
    kernel : Kernel, optional
        ``K``; by default the kernel of the first mandatory graph whose dimension is least. Modes may have more states
        at rest than ``K``, as an outage has.

    Attributes
    ----------
    kernel : Kernel
    pivots : tuple of int
        The first node of each balanced closed component that ``K`` belongs to.
    nodes : tuple of int
        The others, ascending.

    Raises
    ------
    HypothesisError
        A state of ``K`` moves in some member, or ``B`` takes an exact solve of too many rows.

    Examples
    --------
    >>> day = SignedDigraph.from_edges([("a", "b", 1), ("b", "c", -1)])
    >>> night = SignedDigraph.from_edges([("c", "a", -2), ("a", "b", 1)])
    >>> quotient = Quotient(Family.switching([day, night]))
    >>> quotient.pivots, quotient.nodes, quotient.modes[1].center
    ((0,), (1, 2), [[Fraction(1, 1), Fraction(-2, 1)], [Fraction(0, 1), Fraction(2, 1)]])
    """

    def __init__(self, family: Family, kernel: Kernel | None = None):
        self.family, self.kernel = family, kernel or _least_kernel(family)
        balanced = [c for c in self.kernel.structure.closed_components if c.balanced]
        self.pivots = tuple(c.nodes[0] for c in balanced)
        self.nodes = tuple(v for v in range(family.n_nodes) if v not in set(self.pivots))
        try:
            self._verify_rest()
            self.basis = [tuple(self.kernel.row(v)) for v in range(family.n_nodes)]
        except TooLarge:
            raise HypothesisError("the common states at rest take an exact solve of too many rows") from None

    @classmethod
    def of(cls, component: FamilyComponent) -> Quotient:
        """Return the quotient of a component whose behaviour is decided and does not depend on the signal.

        Raises
        ------
        HypothesisError
            It does, or is not decided.
        """
        if component.kernel is None:
            raise HypothesisError("the members have no common kernel, or it is not known")
        return cls(component.family, component.kernel)

    @cached_property
    def modes(self) -> tuple[QuotientMode, ...]:
        """What every mode is in these coordinates."""
        return tuple(self._mode(mode) for mode in self.family.modes)

    def coordinates(self, x: Sequence[Fraction]) -> list[Fraction]:
        """Return ``xi`` of a state."""
        return [x[v] - sum(b * x[p] for b, p in zip(self.basis[v], self.pivots, strict=True)) for v in self.nodes]

    def coordinate_sizes(self, sizes: Mapping[int, Fraction]) -> list[Fraction]:
        """Return bounds of ``|xi_k|`` of all states with ``|x_k| <= sizes_k``."""
        rows = ((v, zip(self.basis[v], self.pivots, strict=True)) for v in self.nodes)
        return [sizes[v] + sum((abs(b) * sizes[p] for b, p in row), Fraction(0)) for v, row in rows]

    def _verify_rest(self) -> None:
        if (moved := moving_rest_state(self.family, self.kernel)) is not None:
            name = self.family.modes[moved.other].name or moved.other + 1
            raise HypothesisError(f"a state at rest in one mode moves in mode {name}")

    def _mode(self, mode: Mode) -> QuotientMode:
        place = {v: i for i, v in enumerate(self.nodes)}
        rows = [[Fraction(0)] * len(self.nodes) for _ in range(self.family.n_nodes)]
        for edge in range(mode.n_edges):
            weight = (mode.lower.fraction(edge) + mode.upper.fraction(edge)) / 2
            source, target = int(mode.source[edge]), int(mode.target[edge])
            for v, entry in ((target, weight), (source, -int(mode.sign[edge]) * weight)):
                if v in place:
                    rows[target][place[v]] += entry
        parts = (self._part(mode, int(edge), place) for edge in mode.parameters)
        return QuotientMode(self._project(rows), tuple(p for p in parts if any(p.f) and any(p.h)), rows)

    def _project(self, rows: Matrix) -> Matrix:
        """Return ``C M``: the rows of the nodes, minus those of the pivots times ``B``."""
        result = []
        for v in self.nodes:
            row = list(rows[v])
            for b, pivot in zip(self.basis[v], self.pivots, strict=True):
                if b:
                    row = [x - b * y for x, y in zip(row, rows[pivot], strict=True)]
            result.append(row)
        return result

    def _part(self, mode: Mode, edge: int, place: dict[int, int]) -> UncertainPart:
        source, target, sign = int(mode.source[edge]), int(mode.target[edge]), int(mode.sign[edge])
        h = [Fraction(0)] * len(self.nodes)
        for v, entry in ((target, 1), (source, -sign)):
            if v in place:
                h[place[v]] = Fraction(entry)
        effect = {target: 1, source: -sign} if mode.tied else {target: 1}
        column = [[Fraction(effect.get(v, 0))] for v in range(self.family.n_nodes)]
        f = tuple(x for (x,) in self._project(column))
        radius = (mode.upper.fraction(edge) - mode.lower.fraction(edge)) / 2
        return UncertainPart(edge, f, tuple(h), effect, radius)


def _least_kernel(family: Family) -> Kernel:
    kernels = [Kernel(analyse(mode.mandatory)) for mode in family.modes]
    return min(kernels, key=lambda kernel: kernel.dimension)
