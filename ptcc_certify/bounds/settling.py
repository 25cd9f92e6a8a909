r"""When protocols without a pole settle on the same graph: asymptotic, finite-time and fixed-time ones.

    x_k' = psi(e_k),    psi(e) = c e,   c |e|^p sgn e,   c (|e|^p + |e|^q) sgn e,    0 < p < 1 < q

``max_k |e_k|`` never grows, on any graph: where it is taken, ``|e_k|' <= -D_k psi(|e_k|) + sum_l |w_kl| psi(|e_l|)``,
which is at most 0 since ``sum_l |w_kl| = D_k``. So no input is above ``psi(max_k |e_k(0)|)``, which is one at 0. By the
same argument ``max_k |x_k|`` never grows.

*Leader groups.* ``V = sum_k w_k int_0^{e_k} psi``. Of an unbalanced group ``W L + L' W >= beta W``. Of a balanced one
``w = p`` with ``p' M(L) = 0``, ``p' 1 = 1``, and ``beta = lambda p_min`` with the second eigenvalue ``lambda`` of
``(P L + L' P, P)``: since ``p' g e = 0`` some ``g_k e_k <= 0`` and some ``>= 0``, so that the variance of ``psi(g e)``
under ``p`` is at least ``p_min`` times its mean square. In either case ``V' <= -(beta/2) sum_k w_k psi(e_k)^2``. With
``a = 2p/(p+1)``, ``a' = 2q/(q+1)``, ``A = (p+1)^a c^(2/(p+1)) (min w)^(1-a)``, ``A' = (p+1)^a' c^(2/(q+1)) (sum
w)^(1-a')`` this is at most ``-(beta/2) max(A V^a, A' V^a')``, which is 0 by

    (2/beta) V(0)^(1-a) / (A (1-a)),    (2/beta) [V*^(1-a) / (A (1-a)) + V*^(1-a') / (A' (a'-1))],

``V* = (A/A')^(1/(a'-a))``.

*Followers* of leaders that rest: ``M(L_F) u >= b u`` with ``max u = 1``, and ``y = max_k |x_k - x_k*| / u_k``. Where it
is taken ``-sgn(x_k - x_k*) e_k >= b u_k y``, so ``y' <= -psi(b u_k y)/u_k``, and y is 0 by

    y(0)^(1-p) / (c b^p (1-p)),    pi / ((q-p) sin(pi (1-p)/(q-p))) alpha^(-(q-1)/(q-p)) alpha'^(-(1-p)/(q-p))

with ``alpha = c b^p``, ``alpha' = c b^q (min u)^(q-1)``. The second of each holds from every initial state. Behind
groups of leaders the followers begin when these rest, with ``|x_k - x_k*| <= 2 max_l |x_l(0)|``.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import flint
import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

import lmi
from lmi.definiteness_proofs import prove_generalized_margin
from lmi.dyadic import round_array
from lmi.errors import LMIError
from lmi.exact.elementary_enclosures import rounded
from ptcc_certify.bounds.final_state.of_graph import final_state
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.io.conversion import as_graph
from ptcc_certify.graphs.io.states import as_state
from ptcc_certify.graphs.rationals import Exact
from ptcc_certify.graphs.size_limits import EXACT_NODES
from ptcc_certify.graphs.structure import ClosedComponent, Structure, analyse
from ptcc_certify.lyapunov.error_system import rounded_diagonal
from ptcc_certify.model.parameters import parameter, readable
from ptcc_certify.theorems.lemmas import (
    BITS,
    algebraic_connectivity,
    diagonal_matrix,
    exact_left_vector,
    symmetric_product,
    without_last,
)

#: Bits of the balls in which powers are enclosed, and of the entries of the vector of the followers.
_BITS, _VECTOR_BITS = 160, 30
#: Steps towards the slowest vector of the followers; the one that gives the shortest time is taken.
_STEPS = 12
Ball = Any  # flint.arb, of which there are no types


@dataclass(frozen=True)
class Settling:
    """When one protocol has every agent at rest, in rationals that are rounded up.

    Attributes
    ----------
    by : Fraction or None
        From this initial state, in units of time; None where nothing is proved, or it never does.
    from_anywhere : Fraction or None
        From every initial state.
    input : Fraction
        The largest input of all agents and times, which is the one at 0.
    """

    by: Fraction | None
    from_anywhere: Fraction | None
    input: Fraction


@dataclass(frozen=True)
class PowerProtocol:
    r"""``u_k = c (|e_k|^p + |e_k|^q) sgn e_k``, or with one power alone: 1 asymptotic, below 1 finite-time.

    Parameters
    ----------
    powers : sequence of number or str
        One in (0, 1], or two, p < 1 < q: then it is fixed-time.
    gain : number or str
        ``c > 0``, in 1/time and the units of states and weights that the powers leave.

    Raises
    ------
    ParameterError
        A power or the gain is out of its domain.

    References
    ----------
    Polyakov, Nonlinear feedback design for fixed-time stabilization of linear control systems, IEEE Trans. Automat.
    Control 57 (2012).

    Examples
    --------
    >>> float(PowerProtocol(["1/2"]).settling([("a", "b", 1)], [0, 1]).by)  # x' = -x^(1/2)
    2.0
    """

    powers: Sequence[Exact]
    gain: Exact = 1

    def __post_init__(self) -> None:
        powers = self._exact
        object.__setattr__(self, "gain", parameter("gain", self.gain))
        object.__setattr__(self, "powers", powers)
        one = len(powers) == 1 and powers[0] <= 1
        if not one and not (len(powers) == 2 and powers[0] < 1 < powers[1]):
            told = ", ".join(map(readable, powers))
            raise ParameterError("powers", f"= {told} are of no protocol that settles; give one up to 1, or p < 1 < q")

    @property
    def _exact(self) -> tuple[Fraction, ...]:
        return tuple(parameter("powers", p) for p in self.powers)

    @property
    def _factor(self) -> Ball:
        return _ball(Fraction(self.gain))

    def settling(self, graph: Any, x0: Any) -> Settling:
        """Return when every agent rests that begins at ``x0``; the module says why.

        Parameters
        ----------
        graph : graph-like
        x0 : state-like

        Returns
        -------
        Settling
        """
        structure = analyse(as_graph(graph))
        start = as_state(x0, structure.graph)
        rows = structure.graph.exact_rows(range(structure.graph.n_nodes))
        errors = [-sum((x * start[v] for v, x in row.items()), Fraction(0)) for row in rows]
        with flint.ctx.workprec(_BITS):
            largest = _above(self._input(max(map(abs, errors), default=Fraction(0))))
            if self.powers == (1,):
                return Settling(None, None, largest)
            groups = [c for c in structure.closed_components if len(c.nodes) > 1]
            times = [self._group(structure.graph, group, errors) for group in groups]
            times.append(self._followers(structure, start, rows, bool(groups)))
            found = [_sum(_longest(one[:-1]), one[-1]) for one in zip(*times, strict=True)]
        by, anywhere = (None if time is None else _above(time) for time in found)
        return Settling(by, anywhere, largest)

    def _input(self, size: Fraction) -> Ball:
        """Return ``psi`` of a nonnegative number."""
        return self._factor * sum((_power(_ball(size), p) for p in self._exact), flint.arb(0))

    def _group(self, graph: SignedDigraph, group: ClosedComponent, errors: Sequence[Fraction]) -> tuple[Any, Any]:
        """Return by when a leader group rests, from its initial state and from every one; None if nothing is proved."""
        found = _form(graph.subgraph(group.nodes), group.gauge)
        if found is None:
            return None, None
        weights, beta = found
        c, p, q = self._factor, self._exact[0], self._exact[-1]
        a, speed = 2 * p / (p + 1), 2 / _ball(beta)
        A = _power(_ball(p + 1), a) * _power(c, 2 / (p + 1)) * _power(_ball(min(weights)), 1 - a)
        V = flint.arb(0)
        for w, k in zip(weights, group.nodes, strict=True):
            for r in self._exact:
                V += _ball(w) * c * _power(_ball(abs(errors[k])), r + 1) / _ball(r + 1)

        def below(V: Ball) -> Ball:
            return speed * _power(V, 1 - a) / (A * _ball(1 - a))

        if len(self.powers) == 1:
            return below(V), None
        b = 2 * q / (q + 1)
        B = _power(_ball(p + 1), b) * _power(c, 2 / (q + 1)) * _power(_ball(sum(weights)), 1 - b)
        turn = _power(A / B, 1 / (b - a))
        anywhere = below(turn) + speed * _power(turn, 1 - b) / (B * _ball(b - 1))
        return _least(below(V), anywhere), anywhere

    def _followers(
        self, structure: Structure, start: Sequence[Fraction], rows: Sequence[dict[int, Fraction]], later: bool
    ) -> tuple[Any, Any]:
        """Return how long followers take from when their leaders rest, which is ``later`` where there are groups."""
        F = structure.followers.tolist()
        if not F:
            return flint.arb(0), flint.arb(0)
        if later or structure.graph.n_nodes > EXACT_NODES:
            off = dict.fromkeys(F, 2 * max(map(abs, start)))
        else:
            ends = final_state(structure, start).states
            off = {k: abs(start[k] - ends[k]) for k in F}
        c, p, q = self._factor, self._exact[0], self._exact[-1]
        by = anywhere = None
        for u, b in _vectors(structure, rows, F):
            alpha = c * _power(_ball(b), p)
            y = max(x / size for x, size in zip(off.values(), u, strict=True))
            by = _least(by, _power(_ball(y), 1 - p) / (alpha * _ball(1 - p)))
            if len(self.powers) > 1:
                beyond, width = c * _power(_ball(b), q) * _power(_ball(min(u)), q - 1), q - p
                share = flint.arb.pi() / (_ball(width) * (flint.arb.pi() * _ball((1 - p) / width)).sin())
                powers = _power(alpha, (q - 1) / width) * _power(beyond, (1 - p) / width)
                anywhere = _least(anywhere, share / powers)
        return (by if anywhere is None else _least(by, anywhere)), anywhere


def _form(group: SignedDigraph, gauge: Sequence[int] | None) -> tuple[list[Fraction], Fraction] | None:
    """Return ``w`` and ``beta > 0`` of a leader group; None of one that is large, or where none is found."""
    if group.n_nodes > EXACT_NODES:
        return None
    L, n = group.exact_laplacian(), group.n_nodes
    if gauge is not None:
        weights = exact_left_vector(group)
        guess = 2 * algebraic_connectivity(group)
    else:
        try:
            found = lmi.diagonal_lyapunov(group.dense_laplacian(), objective="rate")
        except LMIError:
            return None
        weights, guess = list(rounded_diagonal(found.log_omega, BITS)), found.rate
    S, P = symmetric_product(weights, L), diagonal_matrix(weights)
    if gauge is None:
        beta = prove_generalized_margin(S, P, guess)
    else:  # both sides vanish on g
        Z = [[P[i][j] - gauge[i] * gauge[j] * weights[i] * weights[j] for j in range(n)] for i in range(n)]
        beta = prove_generalized_margin(without_last(S), without_last(Z), guess)
        beta = None if beta is None else beta * min(weights)
    return None if beta is None or beta <= 0 else (weights, beta)


def _vectors(
    structure: Structure, rows: Sequence[dict[int, Fraction]], F: Sequence[int]
) -> Iterable[tuple[list[Fraction], Fraction]]:
    """Yield vectors ``u`` of the followers with the largest b of ``M(L_F) u >= b u``, which is positive."""
    place = {k: i for i, k in enumerate(F)}
    block = abs(structure.graph.laplacian().tocsc()[F, :][:, F])
    solve, x = splu((2 * sparse.diags_array(block.diagonal()) - block).tocsc()).solve, np.ones(len(F))
    for _ in range(_STEPS):
        x = solve(x)
        if not (np.isfinite(x).all() and x.min() > 0):
            return
        x /= x.max()
        u = [Fraction(v) for v in round_array(x, _VECTOR_BITS).tolist()]
        b = min(
            sum((x * u[i] if k == v else -abs(x) * u[place[v]] for v, x in rows[k].items() if v in place), Fraction(0))
            / u[i]
            for i, k in enumerate(F)
        )
        if b > 0:
            top = max(u)
            yield [x / top for x in u], b


# ---------------------------------------------------------------------- balls


def _ball(x: Fraction | int) -> Ball:
    return flint.arb(flint.fmpq(x.numerator, x.denominator))


def _power(x: Ball, exponent: Fraction) -> Ball:
    """Return a nonnegative ball to some power; 0 has none below 0."""
    return flint.arb(0) if x == 0 and exponent > 0 else x ** _ball(exponent)


def _above(x: Ball) -> Fraction:
    """Return an upper end as a short rational."""
    mantissa, exponent = x.upper().man_exp()
    return rounded(Fraction(int(mantissa)) * Fraction(2) ** int(exponent), BITS, up=True)


def _least(*times: Ball | None) -> Ball | None:
    """Return the one with the least upper end, of those that are known."""
    known = [time for time in times if time is not None]
    return min(known, key=lambda time: time.upper(), default=None)


def _longest(times: Sequence[Ball | None]) -> Ball | None:
    """Return the longest time, 0 of none; None if one is not known."""
    known = [time for time in times if time is not None]
    return None if len(known) < len(times) else max(known, key=lambda time: time.upper(), default=flint.arb(0))


def _sum(first: Ball | None, second: Ball | None) -> Ball | None:
    return None if first is None or second is None else first + second
