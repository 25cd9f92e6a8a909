"""Trajectories in ball arithmetic: ``X = exp(-L s) X(0)`` with every rounding bounded, the judge over floats."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import flint

from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.lyapunov.function import LyapunovFunction
from ptcc_certify.model import NominalProtocol, ReachingProtocol

BITS = 512


def ball(x: Fraction | int) -> flint.arb:
    x = Fraction(x)
    return flint.arb(x.numerator) / flint.arb(x.denominator)


def rational_matrix(rows: Sequence[Sequence[Fraction]]) -> flint.arb_mat:
    return flint.arb_mat([[ball(x) for x in row] for row in rows])


def clock(protocol: NominalProtocol, q: Fraction) -> flint.arb:
    """``s`` where ``1 - t/T = q``: ``rho1 T (1 - q) + rho2 kappa ln(1/q)``."""
    return ball(protocol.rho1 * protocol.T * (1 - q)) - ball(protocol.rho2 * protocol.kappa) * ball(q).log()


def inverse_decay_integral(protocol: ReachingProtocol, z: Fraction) -> flint.arb:
    """``int_0^t dr/psi(r)`` up to the instant ``z``, at the present precision.

    With ``m = mu3 kappa`` and ``u = T_r - r`` it is ``T_r^m e^(mu2 T_r) int u^-m e^(-mu2 u) du``, a difference of upper
    incomplete gamma functions of order ``1 - m``.
    """
    T, m = ball(protocol.T_r), protocol.mu3 * protocol.kappa
    order, whole = ball(1 - m), ball(protocol.mu2) * T
    tail = (whole * (-ball(z)).exp()).gamma_upper(order) - whole.gamma_upper(order)
    return T * (whole ** ball(m - 1)) * whole.exp() * tail


def states(graph: SignedDigraph, s: flint.arb, x0: Sequence[Fraction]) -> list[flint.arb]:
    L = rational_matrix(graph.exact_laplacian())
    X = (L * (-s)).exp() * flint.arb_mat([[ball(x)] for x in x0])
    return [row[0] for row in X.tolist()]


def value(graph: SignedDigraph, V: LyapunovFunction, gauge: Sequence[int] | None, X: Sequence[flint.arb]) -> flint.arb:
    """``V`` of a state, from the definition of its coordinates."""
    weights = [ball(w) for w in V.weights]
    if V.coordinates == "E":
        L = graph.exact_laplacian()
        z = [-sum((ball(L[i][j]) * X[j] for j in range(len(X)) if L[i][j]), flint.arb(0)) for i in V.nodes]
    else:
        assert gauge is not None
        mean = sum((w * int(g) * x for w, g, x in zip(weights, gauge, X, strict=True)), flint.arb(0))
        mean /= sum(weights, flint.arb(0))
        z = [x - int(g) * mean for g, x in zip(gauge, X, strict=True)]
    return sum((w * y * y for w, y in zip(weights, z, strict=True)), flint.arb(0))


def form_value(
    graph: SignedDigraph,
    nodes: Sequence[int],
    diagonal: Sequence[Fraction] | None,
    matrix: Sequence[Sequence[Fraction]] | None,
    X: Sequence[flint.arb],
) -> flint.arb:
    """``E' P E`` of a state on the rows ``nodes`` of ``E = -L X``."""
    L = graph.exact_laplacian()
    E = [-sum((ball(L[i][j]) * X[j] for j in range(len(X)) if L[i][j]), flint.arb(0)) for i in nodes]
    if diagonal is not None:
        return sum((ball(w) * e * e for w, e in zip(diagonal, E, strict=True)), flint.arb(0))
    moved = rational_matrix(matrix or []) * flint.arb_mat([[e] for e in E])
    return sum((e * moved[i, 0] for i, e in enumerate(E)), flint.arb(0))
