"""Formations from biases of what agents measure: those that fit have places, exactly; others drift, and who is named.

With biases ``b_k`` of the relative positions, ``e = -L x + b``. If ``Q b = 0`` there is one ``h`` with ``L h = b`` and
``Q h = 0``: then ``e = -L (x - h)``, and the agents take the formation ``h``. If not, the means of leader groups drift.
With ``K_1`` the gain of relative positions and ``eta`` the gain, chains of ``n`` integrators drift by

    K_1 int_0^t (t - r)^(n-1)/(n-1)! eta(r)^n dr Q b

beside where they would be without biases: single integrators, ``n = K_1 = 1``, by ``s(t) Q b``. Before ``T`` this has
no bound; velocities grow like ``1/(T - t)``. Under a gain cap it is :func:`drift_until_deadline` at ``T``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from lmi.exact.elementary_enclosures import log
from ptcc_certify.bounds.agents.common_motion import Interval
from ptcc_certify.bounds.final_state.of_graph import Influence, influence
from ptcc_certify.errors import ParameterError, gated
from ptcc_certify.graphs.io import as_graph, as_states
from ptcc_certify.graphs.rationals import shorten
from ptcc_certify.graphs.structure import analyse
from ptcc_certify.model.gain import Gain
from ptcc_certify.theorems.lemmas import solve_exact

#: Agents at most: the places of more are not solved for exactly.
MOST_NODES = 400
#: Bits to which logarithms are enclosed.
BITS = 64

Rows = tuple[tuple[Fraction, ...], ...]


@dataclass(frozen=True)
class GroupDrift:
    """A balanced leader group whose biases do not cancel.

    Attributes
    ----------
    nodes : tuple of str
    rate : tuple of d Fraction
        ``eta_k'G_k b``, coordinate by coordinate: single integrators drift by plus or minus this per unit of the clock,
        agents of order n have plus or minus ``K_1 eta^n`` times this added to their n-th derivative.
    """

    nodes: tuple[str, ...]
    rate: tuple[Fraction, ...]

    @property
    def square(self) -> Fraction:
        """The square of the Euclidean norm of ``rate``."""
        return sum((x * x for x in self.rate), Fraction(0))

    def __str__(self) -> str:
        rates = ", ".join(str(x) for x in self.rate)
        more = ", ..." if len(self.nodes) > 5 else ""
        return f"{', '.join(map(shorten, self.nodes[:5]))}{more} by {shorten(rates)}"


@dataclass(frozen=True)
class Biases:
    """What biases do.

    Attributes
    ----------
    labels : tuple of str
    offsets : N rows of d Fraction, or None
        The formation that they make; None if they drift.
    drift : N rows of d Fraction
        ``Q b``: how far single integrators drift per unit of the clock; of agents of order n it is added to the n-th
        derivative, times ``K_1 eta^n``.
    groups : tuple of GroupDrift
        The leader groups that drift, and how fast; empty if the biases fit a formation.
    """

    labels: tuple[str, ...]
    offsets: Rows | None
    drift: Rows
    groups: tuple[GroupDrift, ...]


@gated
def formation_of_biases(graph: Any, biases: Any) -> Biases:
    """Return the formation that biases of relative positions make, or who drifts and how fast, exactly.

        Q X(t) = Q X(0) + s(t) Q b                                               single integrators
        Q X^(n)(t) = K_1 eta(t)^n Q b                                            chains of n integrators

    with ``K_1`` the gain of relative positions and ``eta`` the gain. Unless ``Q b = 0`` positions have no bound before
    ``T``. A gain cap bounds them: at ``T`` single integrators have drifted by ``s(T) Q b``, ``s`` the clock of the
    capped gain.

    Parameters
    ----------
    graph : graph-like
        N agents.
    biases : state-like, or N rows of d numbers
        ``b_k``, what is added to ``e_k = sum_l w_kl (x_l - sign(w_kl) x_k)``.

    Returns
    -------
    Biases

    Raises
    ------
    ParameterError
        The biases do not fit the graph, or it has more than 400 agents.

    Examples
    --------
    >>> pair = SignedDigraph.from_edges([("a", "b", 1), ("b", "a", 1)])
    >>> fit = formation_of_biases(pair, [1, -1])
    >>> [str(h) for (h,) in fit.offsets]
    ['1/2', '-1/2']
    >>> odd = formation_of_biases(pair, [1, 0])
    >>> odd.offsets, str(odd.groups[0])
    (None, 'a, b by 1/2')
    """
    graph = as_graph(graph)
    if graph.n_nodes > MOST_NODES:
        raise ParameterError("biases", f"exact places are found for up to {MOST_NODES} agents; give offsets instead")
    rows = [list(map(Fraction, row)) for row in as_states(biases, graph, "biases")]
    who, d = influence(analyse(graph), exact=True), len(rows[0])
    columns = [[row[q] for row in rows] for q in range(d)]
    ends = [who.apply(column) for column in columns]
    drift = tuple(tuple(Fraction(x) for x in row) for row in zip(*(end for end, _ in ends), strict=True))
    rates = [tuple(Fraction(values[k]) for _, values in ends) for k in range(len(who.balanced))]
    groups = tuple(
        GroupDrift(tuple(graph.labels[v] for v in c.nodes), rate)
        for c, rate in zip(who.balanced, rates, strict=True)
        if any(rate)
    )
    offsets = None if groups else tuple(map(tuple, zip(*(_places(who, column) for column in columns), strict=True)))
    return Biases(graph.labels, offsets, drift, groups)


def drift_until_deadline(gain: Gain, cap: Fraction, order: int = 1) -> Interval:
    """Return bounds of what a capped gain makes of biases until ``T``, over ``K_1 Q b``, for chains of integrators.

        int_0^T (T - r)^(n-1)/(n-1)! min(eta(r), cap)^n dr

    which for ``n = 1`` is the clock at ``T``. In ``w = T - r`` the cap acts below ``w_c = k/(cap - rho1)``, where it
    leaves ``(cap w_c)^n/n!``; the rest is a polynomial in ``w`` and ``k^n ln(T/w_c)``, over ``(n-1)!``.

    Parameters
    ----------
    gain : Gain
        Without the cap, of a deadline.
    cap : Fraction
        Positive.
    order : int
        ``n``.

    Examples
    --------
    >>> low, high = drift_until_deadline(Gain(T=1, rho1=1, rho2=1, kappa=2), Fraction(5))  # 2 ln 2 + 1/2 + 5/2
    >>> round(float(low), 9), bool(low <= high)
    (4.386294361, True)
    """
    n, k, rho1, T = order, gain.pole, gain.rho1, gain.T
    turn = T if cap <= gain.first else k / (cap - rho1)
    known = sum(
        (math.comb(n, j) * rho1**j * k ** (n - j) * (T**j - turn**j) / j for j in range(1, n + 1)),
        (cap * turn) ** n / n,
    )
    return tuple((known + k**n * x) / math.factorial(n - 1) for x in log(T / turn, BITS))  # type: ignore[return-value]


def _places(who: Influence, biases: Sequence[Fraction]) -> list[Fraction]:
    """Return ``h`` with ``L h = b``, ``Q h = 0``, for ``Q b = 0``.

    All nodes but the first one of each balanced closed component are solved for, which leaves a nonsingular matrix.
    """
    graph, first = who.structure.graph, {c.nodes[0] for c in who.balanced}
    nodes = [v for v in range(graph.n_nodes) if v not in first]
    places = [Fraction(0)] * graph.n_nodes
    if nodes:
        L = [[row.get(v, Fraction(0)) for v in nodes] for row in graph.exact_rows(nodes)]
        solution = solve_exact(L, [[biases[v]] for v in nodes])
        assert solution is not None, "without one agent of each group L is not singular"
        for v, (place,) in zip(nodes, solution, strict=True):
            places[v] = place
    kept, _ = who.apply(places)
    return [h - Fraction(x) for h, x in zip(places, kept, strict=True)]
