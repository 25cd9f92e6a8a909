"""The upper bound on the decay rate, whatever the Lyapunov function: twice a proved bound of the smallest real part.

``V <= e^(-b s) V(0)`` for all initial states means ``b <= 2 Re lambda`` for every nonzero eigenvalue of ``L``, and
so for their mean in a strong component, the trace of its block ``A`` over their number: exact, and sharp for a single
follower and for two agents. Otherwise, with
``B = A - c I`` for a strong component's block ``A`` and a symmetric ``H`` with ``H B + B'H > 0``, ``H`` and ``B`` have
the same inertia (Ostrowski and Schneider 1962): where ``H`` is negative on a subspace of dimension ``k``, at least
``k`` eigenvalues of ``A`` have a real part below ``c``. One suffices; of a balanced closed component, whose eigenvalue
0 does not count, two. So no rate exceeds ``2 c``. The better of the two is taken.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from lmi.definiteness_proofs import prove_positive_definite
from lmi.dyadic import round_to_bits
from lmi.exact.decimal_rounding import float_down
from ptcc_certify.checker.lyapunov import InertiaWitness, MeanWitness
from ptcc_certify.graphs.rationals import writable
from ptcc_certify.graphs.size_limits import EXACT_NODES
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.lyapunov.error_system import rounded_matrix
from ptcc_certify.theorems.lemmas import Matrix, component_blocks, integer_matrix, integer_rows, single_followers

#: Relative amounts by which ``c`` lies above the smallest real part, one after the other, until the proof succeeds.
_GAPS = (1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1)
_MATRIX_BITS, _VECTOR_BITS = 60, 40


@dataclass(frozen=True)
class RateBound:
    """No rate exceeds ``value``, and what proves it.

    Attributes
    ----------
    value : Fraction
    nodes : tuple of int
        A strong component; of the mean eigenvalue one of its nodes.
    form : rows of Fractions
        ``H``; empty if the mean of the nonzero eigenvalues is the bound.
    vectors : tuple of tuple of Fraction
        On which ``H`` is negative.
    """

    value: Fraction
    nodes: tuple[int, ...]
    form: Sequence[Sequence[Fraction]] = ()
    vectors: tuple[tuple[Fraction, ...], ...] = ()

    @property
    def kind(self) -> str:
        """Kind of the obligation that proves it."""
        return "rate-upper-bound" if self.form else "rate-mean"

    @property
    def witness(self) -> MeanWitness | InertiaWitness:
        """The node, or nodes, form and vectors, as the check takes them."""
        if not self.form:
            return MeanWitness(node=self.nodes[0])
        return InertiaWitness(nodes=self.nodes, lower_triangle=self.form, vectors=self.vectors)


def prove_rate_bound(structure: Structure) -> RateBound | None:
    """Prove an upper bound on every rate, as near to the spectral rate as proves; None if no agent listens.

    Examples
    --------
    >>> pair = [(1, 2, -1), (2, 1, -3)]
    >>> float(prove_rate_bound(analyse(SignedDigraph.from_edges(pair))).value)  # one nonzero eigenvalue, 4
    8.0
    >>> three = analyse(SignedDigraph.from_edges([*pair, (1, 3, 1), (3, 1, 1)]))  # the eigenvalues 0, 1 and 5
    >>> limit = prove_rate_bound(three)
    >>> limit.kind, float(limit.value).__round__(6)
    ('rate-upper-bound', 2.0)
    """
    mean = mean_bound(structure)
    slowest = None if mean is None else _slowest(structure)
    if mean is None or slowest is None:
        return mean
    nodes, decay, dimension = slowest
    if mean.value <= 2 * Fraction(decay) * (1 + Fraction(_GAPS[0])):
        return mean
    rows = structure.graph.exact_rows(nodes)
    A = [[row.get(j, Fraction(0)) for j in nodes] for row in rows]
    with np.errstate(all="ignore"):
        for gap in _GAPS:
            if not np.isfinite(decay * (1 + gap)):
                break
            c = round_to_bits(decay * (1 + gap), 53)
            if (witness := prove_slow_eigenvalues(A, c, dimension)) is not None:
                return min(mean, RateBound(2 * c, nodes, *witness), key=lambda bound: bound.value)
    return mean


def optimality_ratio(rate: Fraction | None, upper_bound: Fraction | None) -> float | None:
    """Return the proved rate over its proved upper bound, rounded down; None without one of them.

    Examples
    --------
    >>> optimality_ratio(Fraction(3), Fraction(4)), optimality_ratio(None, Fraction(4))
    (0.75, None)
    """
    return None if rate is None or upper_bound is None else float_down(rate / upper_bound)


def mean_bound(structure: Structure) -> RateBound | None:
    """Return twice the mean nonzero eigenvalue of the strong component where that is least.

    None if no agent listens, or the number is too long to be written. Which one is found in floats; its trace is exact,
    and costs no more than a sum over its edges.

    Examples
    --------
    >>> mean_bound(analyse(SignedDigraph.from_edges([(1, 2, -1), (2, 1, -3), (2, 3, "1/7")]))).value
    Fraction(2, 7)
    """
    graph, number = structure.graph, structure.strong_component
    count = np.bincount(number)
    for component in structure.closed_components:
        count[number[component.nodes[0]]] -= component.balanced
    moving = np.flatnonzero(count)
    if not moving.size:
        return None
    with np.errstate(over="ignore"):
        traces = np.bincount(number, graph.in_weight(), minlength=count.size)
    least = int(moving[np.argmin(traces[moving] / count[moving])])
    edges = np.flatnonzero(number[graph.target] == least)
    table, scale = graph.weight_table()
    if table is not None and table.dtype.kind == "i":
        trace = Fraction(sum(map(abs, table[edges].tolist())), scale)
    else:
        trace = sum((abs(graph.exact_weight(i)) for i in edges.tolist()), Fraction(0))
    value = 2 * trace / int(count[least])
    return RateBound(value, (int(np.flatnonzero(number == least)[0]),)) if writable(value) else None


def _slowest(structure: Structure) -> tuple[tuple[int, ...], float, int] | None:
    """Return the strong component with the smallest real part, that part, and how many eigenvalues lie up to it.

    Components of more than ``EXACT_NODES`` nodes are left out: the bound holds, but may not be sharp.
    """
    balanced = {c.nodes[0] for c in structure.closed_components if c.balanced}
    best, weight = None, structure.graph.in_weight()
    single = single_followers(structure)
    single = single[np.isfinite(weight[single])]
    if single.size:
        node = int(single[np.argmin(weight[single])])
        best = ((node,), float(weight[node]), 1)
    for nodes, block in component_blocks(structure):
        if nodes.size > EXACT_NODES:
            continue
        zeros = int(int(nodes[0]) in balanced)
        try:
            parts = np.sort(np.linalg.eigvals(block.toarray()).real)[zeros:]
        except np.linalg.LinAlgError:
            continue
        if parts.size and np.isfinite(parts[0]) and parts[0] > 0 and (best is None or parts[0] < best[1]):
            best = (tuple(nodes.tolist()), float(parts[0]), 1 + zeros)
    return best


def prove_slow_eigenvalues(
    A: Matrix, c: Fraction, dimension: int = 1
) -> tuple[Matrix, tuple[tuple[Fraction, ...], ...]] | None:
    """Prove that ``dimension`` eigenvalues of ``A`` have a real part below ``c``; return ``H`` and vectors, or None.

    Examples
    --------
    >>> A = [[Fraction(1), Fraction(1)], [Fraction(0), Fraction(2)]]
    >>> prove_slow_eigenvalues(A, Fraction(11, 10)) is not None, prove_slow_eigenvalues(A, Fraction(9, 10))
    (True, None)
    """
    from scipy.linalg import matrix_balance, solve_continuous_lyapunov

    B = [[x - c * (i == j) for j, x in enumerate(row)] for i, row in enumerate(A)]
    floats = np.array([[float(x) for x in row] for row in B])
    try:
        own, (scale, _) = matrix_balance(floats, permute=False, separate=True)
        with warnings.catch_warnings():  # that eigenvalues cancel is told by the proof
            warnings.simplefilter("ignore")
            H = solve_continuous_lyapunov(own.T, np.diag(1 / np.maximum(np.abs(own).max(axis=1), 1e-300)))
        H = (H + H.T) / 2 / np.outer(scale, scale)
        if not np.isfinite(H).all():
            return None
        sizes, directions = np.linalg.eigh(H)
        if not (sizes[:dimension] < 0).all():
            return None
        form = rounded_matrix(H, _MATRIX_BITS)
    except (np.linalg.LinAlgError, ValueError, OverflowError, ZeroDivisionError):
        return None
    vectors = tuple(tuple(round_to_bits(float(x), _VECTOR_BITS) for x in column) for column in directions.T[:dimension])
    H, X = integer_matrix(form)[0], integer_matrix(vectors)[0]
    HB = H * integer_matrix(B)[0]
    if not prove_positive_definite(integer_rows(HB + HB.transpose())):
        return None
    if not prove_positive_definite(integer_rows(-(X * H * X.transpose()))):
        return None
    return form, vectors
