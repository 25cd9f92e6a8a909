"""A Lyapunov function as a quadratic form, of the error and of the state."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import chain
from operator import mul

from lmi.exact.definite import Arithmetic
from lmi.exact.elementary_enclosures import rounded
from lmi.exact.numbers import integers, longest, sized
from lmi.exact.work import spend
from ptcc_certify.checker.digraph import Digraph
from ptcc_certify.checker.matrix_products import Matrix, congruence, diagonal, quadratic
from ptcc_certify.checker.side_files import Numbers


@dataclass(frozen=True)
class Form:
    """A Lyapunov function ``z'P z`` that decays: ``V <= e^(-rate s) V(0)``.

    Attributes
    ----------
    rate : Fraction
    coordinates : {"E", "eps"}
        ``E = -L X`` on the nodes, or the weighted deviation ``eps = X - (p'G X / p'1) G 1``.
    nodes : list of int
    diagonal : list of Fraction, or Numbers, or None
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
    diagonal: Sequence[Fraction] | Numbers | None
    matrix: Sequence[Sequence[Fraction]] | None
    lowest: Fraction
    gauge: Sequence[int] = ()

    @cached_property
    def weights(self) -> tuple[list[int], int]:
        """The diagonal in integers over a scale, and the scale; empty if ``P`` is not diagonal."""
        own = self.diagonal if isinstance(self.diagonal, Numbers) else Numbers(self.diagonal or [])
        return own.over(range(len(own)))

    @cached_property
    def entries(self) -> tuple[Matrix, int]:
        """``P`` in integers over a scale, and the scale."""
        if self.diagonal is None:
            return integers(self.matrix or [])
        own, scale = self.weights
        return diagonal(own), scale

    def value(self, z: Sequence[Fraction], sizes: bool = False) -> Fraction:
        """Return ``z'P z``, or ``z'|P| z`` with the sizes of the entries, which bounds it where ``|z_i|`` is less."""
        (P, common), ((Z,), scale) = self.entries, integers([z])
        return Fraction(quadratic(P, Z, sizes), common * scale**2)

    def times(self, z: Sequence[int]) -> tuple[list[int], int]:
        """Return ``P z`` in integers over a scale, and the scale."""
        what, bits = "initial values", longest(z)
        if self.diagonal is not None:
            own, scale = self.weights
            spend(len(own), longest(own), bits, what)
            return list(map(mul, own, z)), scale
        P, scale = self.entries
        spend(len(z) ** 2, longest(chain.from_iterable(P)), bits, what)
        return [sum(map(mul, row, z)) for row in P], scale

    def coordinates_of(self, graph: Digraph, x: Sequence[int]) -> tuple[list[int], int]:
        """Return ``L x`` on the nodes, or ``x - (p'G x / p'1) G 1``, in integers over a scale, and the scale."""
        if self.coordinates == "E":
            pushed = graph.laplacian_product(x)
            return [pushed[v] for v in self.nodes], graph.unit
        p, _ = self.weights
        total = sum(p)
        spend(2 * len(p), total.bit_length(), longest(x), "initial values")
        mean = sum(w * g * x[v] for w, g, v in zip(p, self.gauge, self.nodes, strict=True))
        return [total * x[v] - g * mean for g, v in zip(self.gauge, self.nodes, strict=True)], total

    def error_constants(
        self, n: int, row: Callable[[int], Mapping[int, Fraction]], bits: int | None = None
    ) -> list[Fraction] | None:
        """Return ``c_v`` with ``e_v^2 <= c_v V`` of every agent; None if ``P`` is not diagonal.

        Parameters
        ----------
        n : int
            The number of agents.
        row : callable
            The row of ``L`` of an agent, which ``eps`` asks for.
        bits : int, optional
            To which ``1/p`` of ``eps`` is rounded, upwards; None: exact.
        """
        if self.diagonal is None:
            return None
        each = {v: 1 / w for v, w in zip(self.nodes, self.diagonal, strict=True)}
        if self.coordinates == "E":
            return [each.get(v, Fraction(0)) for v in range(n)]
        if bits is not None:
            each = {v: rounded(x, bits, up=True) for v, x in each.items()}
        return [sum((x * x * each[j] for j, x in row(v).items()), Fraction(0)) for v in range(n)]

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
