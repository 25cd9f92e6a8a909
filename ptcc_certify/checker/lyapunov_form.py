"""A Lyapunov function as a quadratic form, of the error and of the state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from operator import mul

from lmi.exact.definite import Arithmetic
from lmi.exact.numbers import integers, longest, sized
from lmi.exact.work import spend
from ptcc_certify.checker.digraph import Digraph
from ptcc_certify.checker.matrix_products import Matrix, congruence, diagonal


@dataclass(frozen=True)
class Form:
    """A Lyapunov function ``z'P z`` that decays: ``V <= e^(-rate s) V(0)``.

    Attributes
    ----------
    rate : Fraction
    coordinates : {"E", "eps"}
        ``E = -L X`` on the nodes, or the weighted deviation ``eps = X - (p'G X / p'1) G 1``.
    nodes : list of int
    diagonal : list of Fraction or None
    matrix : list of list of Fraction or None
        ``P``, its diagonal if it is diagonal.
    lowest : Fraction
        Not above the smallest eigenvalue of ``P``.
    gauge : list of int
        Camps of the nodes, for the coordinates ``eps``.
    """

    rate: Fraction
    coordinates: str
    nodes: Sequence[int]
    diagonal: Sequence[Fraction] | None
    matrix: Sequence[Sequence[Fraction]] | None
    lowest: Fraction
    gauge: Sequence[int] = ()

    @cached_property
    def entries(self) -> tuple[Matrix, int]:
        """``P`` in integers over a scale, and the scale."""
        P, scale = integers([self.diagonal] if self.diagonal is not None else self.matrix or [])
        return (P if self.diagonal is None else diagonal(P[0])), scale

    def value(self, z: Sequence[Fraction], sizes: bool = False) -> Fraction:
        """Return ``z'P z``, or ``z'|P| z`` with the sizes of the entries, which bounds it where ``|z_i|`` is less."""
        (P, common), ((Z,), scale) = self.entries, integers([z])
        total = sum(x * sum(map(mul, map(abs, row) if sizes else row, Z)) for x, row in zip(Z, P, strict=True) if x)
        return Fraction(total, common * scale**2)

    def of_state(self, exact: Arithmetic, graph: Digraph) -> tuple[Matrix, Fraction]:
        """Return the function as a form of the state, times a scale, and the scale.

        ``L'P L`` of the nodes in the coordinates ``E``; ``G (P - p p'/p'1) G``, ``P = diag(p)``, in ``eps``.
        """
        P, scale = self.entries
        if self.coordinates != "eps":
            return congruence(exact, P, [graph.row(v) for v in self.nodes], graph.n), Fraction(scale * graph.unit**2)
        eta = [g * P[i][i] for i, g in enumerate(self.gauge)]
        bits, total = longest(eta) + len(eta).bit_length(), sum(map(abs, eta))
        sized(len(eta) ** 2, 2 * bits, "deviations")
        spend(4 * len(eta) ** 2, bits, bits, "deviations")
        Z = [[total * abs(a) * (i == j) - a * b for j, b in enumerate(eta)] for i, a in enumerate(eta)]
        return Z, Fraction(total * scale)
