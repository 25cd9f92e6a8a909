"""What one matrix for agents of order n says of each agent: deviations of every derivative, and the input.

With ``V = sum_kl Om_kl z_k'P z_l``, ``z`` the coordinates of a Lyapunov function of the graph, each column of ``Y``
taken for a state, ``V(t) <= e^(-r s) V(0)``, and

    |x_k^(i-1) - common motion| <= eta^(i-1) sqrt(c_k W_ii V),      |K eps_k| <= c sqrt(b'P b c_k^E V)

with the constants ``(x_k - (Q x)_k)^2 <= c_k V`` and ``e_k^2 <= c_k^E V`` that the function has for single integrators.
All norms are Euclidean over the coordinates of space.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from fractions import Fraction

import numpy as np

from ptcc_certify.bounds.input.effort_bounds import full_constants
from ptcc_certify.checker.agent_bounds import Begin
from ptcc_certify.checker.agent_model import Agents
from ptcc_certify.checker.digraph import Digraph
from ptcc_certify.checker.input_formulas import root_above
from ptcc_certify.checker.lyapunov import Function
from ptcc_certify.checker.lyapunov_form import Form
from ptcc_certify.checker.side_files import Numbers
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.lyapunov.function import LyapunovFunction
from ptcc_certify.model.agents_protocol import AgentsProtocol
from ptcc_certify.theorems.matrix_for_order_n import AgentMatrix, Matrix

#: Of every agent, in every coordinate of space, its position, velocity and so on.
States = tuple[tuple[tuple[Fraction, ...], ...], ...]


def scaled_states(states: States, offsets: Sequence[Sequence[Fraction]], zeta: Fraction) -> States:
    """Return ``y_k = diag(1, zeta, ..) (xi_k - (h_k, 0, ..))``.

    Examples
    --------
    >>> one = Fraction(1)
    >>> scaled_states((((3 * one, one),),), [[one]], Fraction(1, 2))
    (((Fraction(2, 1), Fraction(1, 2)),),)
    """
    return tuple(
        tuple(
            tuple((x - (h if i == 0 else 0)) * zeta**i for i, x in enumerate(chain))
            for chain, h in zip(agent, offset, strict=True)
        )
        for agent, offset in zip(states, offsets, strict=True)
    )


def first_inputs(structure: Structure, protocol: AgentsProtocol, states: States) -> tuple[Fraction, ...]:
    """Return the squares of ``|u_k(0)|``, the inputs at time 0 without sliding terms, exactly.

    Examples
    --------
    >>> from ptcc_certify.model import NominalProtocol
    >>> base, zero, one = NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), Fraction(0), Fraction(1)  # eta(0) = 2
    >>> pair = analyse(SignedDigraph.from_edges([("a", "b", 1)]))
    >>> protocol = AgentsProtocol(base, (zero,) * 2, (zero,) * 2, (3 * one, one), ((zero,),) * 2, None)
    >>> [int(x) for x in first_inputs(pair, protocol, (((one, zero),), ((zero, one),)))]  # b: 3 4 (1 - 0) + 2 (0 - 1)
    [0, 100]
    """
    n, gains, own = protocol.order, protocol.gains_at_first, protocol.own
    scaled = scaled_states(states, protocol.offsets, 1 / protocol.first_gain)
    rows, squares = structure.graph.exact_rows(range(structure.graph.n_nodes)), []
    for k, (row, h) in enumerate(zip(rows, protocol.offsets, strict=True)):
        square = Fraction(0)
        for q, place in enumerate(h):
            heard = [sum((a * scaled[j][q][i] for j, a in row.items()), Fraction(0)) for i in range(n)]
            felt = sum((K * x + f * y for K, x, f, y in zip(gains, heard, own, scaled[k][q], strict=True)), Fraction(0))
            square += (protocol.plant[0] * place - protocol.first_gain**n * felt) ** 2
        squares.append(square)
    return tuple(squares)


def error_constants(structure: Structure, V: LyapunovFunction) -> tuple[Fraction, ...] | None:
    """Return ``c_k^E`` with ``e_k^2 <= c_k^E V`` of every agent; None where they are not seen for a full matrix."""
    n = structure.graph.n_nodes
    if V.matrix is not None:
        return None if V.form is None else full_constants(V.form, n)
    weight = dict(zip(V.nodes, V.weights, strict=True))
    if V.coordinates == "E":
        return tuple(1 / weight[v] if v in weight else Fraction(0) for v in range(n))
    rows = structure.graph.exact_rows(range(n))
    return tuple(sum((x * x / weight[j] for j, x in row.items()), Fraction(0)) for row in rows)


def least_input(
    structure: Structure, functions: Sequence[LyapunovFunction], P: Matrix, scaled: States | None
) -> Fraction | None:
    """Return the proved rate of the function by which the bound of the input is least, in floats; None without one.

    That bound is ``sqrt(max_k c_k^E V(0))/rate``, up to what all functions share. Without an initial state ``V(0)``
    stands for the largest of errors of size 1. The fastest functions of followers may have huge constants.
    """
    decaying = [V for V in functions if V.proved_rate > 0]
    if len(decaying) < 2:
        return decaying[0].proved_rate if decaying else None
    L, inner = structure.graph.laplacian(), np.array([[float(x) for x in row] for row in P])
    states = None if scaled is None else np.array([[[float(x) for x in row] for row in agent] for agent in scaled])

    def size(V: LyapunovFunction) -> float:
        with np.errstate(all="ignore"), suppress(np.linalg.LinAlgError):
            if V.matrix is None:
                constant = max(map(float, error_constants(structure, V) or ()))
            else:
                constant = float(np.linalg.inv(V.array).diagonal().max())
            value = float(V.highest)
            if states is not None:
                z = V.scaled(V.coordinates_of(states, L))
                value = float(np.einsum("kqi,ij,kqj", z, inner, z))
            bound = math.sqrt(max(constant * value, 0.0)) / float(V.proved_rate)
            return bound if math.isfinite(bound) else math.inf
        return math.inf

    return min(decaying, key=lambda V: (size(V), -V.proved_rate)).proved_rate


def checked_begin(structure: Structure, protocol: AgentsProtocol, matrix: AgentMatrix, states: States) -> Begin:
    """Return where agents of order n begin, as the check reads it."""
    numbers = protocol.gains, matrix.coupling, matrix.W, matrix.rate, matrix.points
    chains = protocol.order, len(protocol.offsets[0]), protocol.plant, protocol.own, protocol.gain_cap
    agents = Agents(*chains, protocol.gain.exact, *numbers)
    return Begin(agents, checked_graph(structure), states, protocol.offsets)


def checked_function(V: LyapunovFunction) -> Function:
    """Return a Lyapunov function as the check reads it, without its constants."""
    large = V.form is None
    by_rows = Form(V.proved_rate, "E", V.nodes, Numbers(V.weights), None, min(V.weights)) if large else None
    return Function("", V.proved_rate, Fraction(1), V.form, by_rows)


def checked_graph(structure: Structure) -> Digraph:
    """Return a graph as the check reads it."""
    rows = structure.graph.exact_rows(range(structure.graph.n_nodes))
    edges = [(s, t, -row[s]) for t, row in enumerate(rows) for s in sorted(row) if s != t]
    source, target, weights = zip(*edges, strict=True) if edges else ((), (), ())
    return Digraph(structure.graph.labels, source, target, weights, 1)


def root_product(*factors: Fraction) -> Fraction:
    """Return the root of a product, rounded up.

    Examples
    --------
    >>> float(root_product(Fraction(2), Fraction(8)))
    4.0
    """
    product = Fraction(1)
    for factor in factors:
        product *= factor
    return root_above(product) if product else Fraction(0)
