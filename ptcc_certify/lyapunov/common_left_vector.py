"""Families whose members share a positive left null vector: the distance to the states at rest, in closed form.

Let ``p > 0`` and ``p' M(L) = 0`` for every member, ``M(L)`` with ``-|w|`` off the diagonal: known weights that share
``p``, and uncertain undirected edges between nodes of equal ``p`` (``p = 1`` for undirected graphs). Then

    x'(diag(p) L + L' diag(p)) x = sum_kl p_k |w_kl| (x_k - sgn(w_kl) x_l)^2

grows with every weight: ``w-`` is the worst case, whatever the signal. The weighted distance to ``K`` decays at the
rate ``b`` if ``S - b P > 0`` over the nodes that are no pivots, ``S`` the matrix above at ``w-`` and
``P = diag(p) - diag(p) B (B' diag(p) B)^-1 B' diag(p)``: ``B' diag(p) X`` is constant. Where ``diag(p) L(w-)`` is
symmetric in the slowest mode, no rate of any kind is larger.

References
----------
docs/theory/families.md, "Undirected graphs".
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from lmi.search_time import checkpoint
from ptcc_certify.graphs.family import Family, Mode
from ptcc_certify.graphs.size_limits import EXACT_NODES
from ptcc_certify.lyapunov.common_forms import CommonForm, prove_ends, prove_margin_about, with_constants
from ptcc_certify.lyapunov.quotient import Quotient
from ptcc_certify.theorems.lemmas import solve_exact
from ptcc_certify.theorems.matrix_arithmetic import Matrix

Vector = tuple[Fraction, ...]


def undirected_function(quotient: Quotient) -> CommonForm | None:
    """Return the function of the module, proved; None if no common left vector is found.

    Nor is one tried above 120 nodes, or where nothing moves.

    Examples
    --------
    >>> path = Family.from_intervals([("a", "b", 1, 10), ("b", "c", 1, 10)], undirected=True)
    >>> V = undirected_function(Quotient(path))
    >>> round(float(V.rate), 6), V.optimal, V.left_vector
    (2.0, True, (Fraction(1, 1), Fraction(1, 1), Fraction(1, 1)))
    """
    family = quotient.family
    p = common_left_vector(family)
    if p is None:
        return None
    P = _distance(quotient, p)
    ends = prove_ends(P)
    if ends is None:
        return None
    rates, symmetric, numerical = [], [], []
    for mode, own in zip(family.modes, quotient.modes, strict=True):
        checkpoint()
        L = mode.mandatory.exact_laplacian()
        S = [[p[i] * L[i][j] + p[j] * L[j][i] for j in quotient.nodes] for i in quotient.nodes]
        guess = _least_eigenvalue(S, P)
        rate = Fraction(0) if own.at_rest else prove_margin_about(S, P, guess, own.largest_entry)
        if rate is None:
            return None
        rates.append(rate)
        numerical.append(guess)
        nodes = range(family.n_nodes)
        symmetric.append(all(p[i] * L[i][j] == p[j] * L[j][i] for i in nodes for j in nodes if i < j))
    moving = [i for i, own in enumerate(quotient.modes) if not own.at_rest]
    if not moving:
        return None
    optimal = symmetric[min(moving, key=lambda i: rates[i])]
    function = CommonForm(
        "undirected",
        quotient,
        P,
        tuple(rates),
        ((),) * len(rates),
        *ends,
        left_vector=p,
        optimal=optimal,
        numerical_rate=min(numerical),
    )
    return with_constants(function)


def common_left_vector(family: Family) -> Vector | None:
    """Return ``p > 0`` with ``p' M(L) = 0`` for every member, exact; None if none is found or nodes are too many.

    It is all ones, or the one left null vector of the sum of all mandatory graphs.

    Examples
    --------
    >>> common_left_vector(Family.from_graph(SignedDigraph.from_edges([(1, 2, -3), (2, 1, 1)])))
    (Fraction(3, 4), Fraction(1, 4))
    """
    n = family.n_nodes
    if any(mode.parameters.size and not mode.tied for mode in family.modes) or n > EXACT_NODES:
        return None
    comparisons, zero = [_comparison(mode) for mode in family.modes], Fraction(0)
    ones = (Fraction(1),) * n
    if _shared(family, comparisons, ones):
        return ones
    total = [[sum((M[i][j] for M in comparisons), zero) for j in range(n)] for i in range(n)]
    system = [[total[j][i] for j in range(n)] for i in range(n - 1)] + [list(ones)]
    solution = solve_exact(system, [[zero]] * (n - 1) + [[Fraction(1)]])
    if solution is None or any(row[0] <= 0 for row in solution):
        return None
    p = tuple(row[0] for row in solution)
    return p if _shared(family, comparisons, p) else None


def _comparison(mode: Mode) -> Matrix:
    L = mode.mandatory.exact_laplacian()
    return [[x if i == j else -abs(x) for j, x in enumerate(row)] for i, row in enumerate(L)]


def _shared(family: Family, comparisons: list[Matrix], p: Vector) -> bool:
    for mode, M in zip(family.modes, comparisons, strict=True):
        ends = ((int(mode.source[e]), int(mode.target[e])) for e in mode.parameters)
        if any(p[source] != p[target] for source, target in ends):
            return False
        if any(sum(map(Fraction.__mul__, p, column), Fraction(0)) for column in zip(*M, strict=True)):
            return False
    return True


def _distance(quotient: Quotient, p: Vector) -> Matrix:
    """Return ``P`` of the module over the nodes that are no pivots."""
    nodes, d = quotient.nodes, len(quotient.pivots)
    P = [[p[v] if v == u else Fraction(0) for u in nodes] for v in nodes]
    if not d:
        return P
    B, zero = quotient.basis, Fraction(0)
    gram = [[sum((w * b[i] * b[j] for w, b in zip(p, B, strict=True)), zero) for j in range(d)] for i in range(d)]
    part = solve_exact(gram, [[p[v] * B[v][j] for v in nodes] for j in range(d)])
    assert part is not None, "B has full rank"
    for row, v in zip(P, nodes, strict=True):
        for j in range(d):
            if scale := p[v] * B[v][j]:
                row[:] = [x - scale * y for x, y in zip(row, part[j], strict=True)]
    return P


def _least_eigenvalue(S: Matrix, P: Matrix) -> float:
    from scipy.linalg import eigh

    arrays = (np.array([[float(x) for x in row] for row in M]) for M in (S, P))
    return float(eigh(*arrays, eigvals_only=True, subset_by_index=[0, 0])[0])
