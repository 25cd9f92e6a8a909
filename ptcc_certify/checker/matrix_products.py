"""Products of integer matrices with the signed Laplacian: every inequality of the proof is built of these.

A matrix is a list of rows; one that multiplies from the right is sparse, by rows of ``{column: entry}``. What a product
costs is counted before it is formed.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from itertools import chain
from operator import mul

from lmi.exact.definite import Arithmetic
from lmi.exact.numbers import longest, sized
from lmi.exact.polynomials import row_sum
from lmi.exact.work import spend
from ptcc_certify.checker.digraph import Digraph
from ptcc_certify.checker.reading import need

Matrix = list[list[int]]
Sparse = list[dict[int, int]]
#: Rows of a dense matrix.
LARGEST_ROWS = 400
#: Rows of a form of a family with its multipliers, one for each uncertain weight; above ``LARGEST_ROWS`` they are work.
WITH_MULTIPLIERS = 800
#: Above so many entries, a quarter of them not 0, a product is formed as that of dense matrices.
DENSE_SIZE = 400


def need_rows(rows: int) -> None:
    """Refuse dense matrices that would take long."""
    need(rows <= LARGEST_ROWS, f"a matrix of {rows} rows; {LARGEST_ROWS} are taken")


def need_rows_with_multipliers(rows: int) -> None:
    """Refuse forms of families with more multipliers than are taken, and count what many of them cost."""
    need(rows <= WITH_MULTIPLIERS, f"a matrix of {rows} rows; {WITH_MULTIPLIERS} are taken")
    if rows > LARGEST_ROWS:
        spend(rows**3 // 20, what="a proof of definiteness")


def block(graph: Digraph, nodes: Sequence[int]) -> Sparse:
    """Return the rows and columns of ``L`` that belong to some nodes, times ``unit``."""
    place = {v: i for i, v in enumerate(nodes)}
    return [{place[j]: x for j, x in graph.row(v).items() if j in place} for v in nodes]


def transposed(A: Matrix) -> Matrix:
    """Return ``A'``."""
    return [list(column) for column in zip(*A, strict=True)]


def times(exact: Arithmetic, A: Matrix, B: Sparse, width: int) -> Matrix:
    """Return ``A B``; ``B`` has so many columns."""
    need_rows(max(len(A), len(B), width))
    bits, own = longest(chain.from_iterable(A)), longest(x for row in B for x in row.values())
    sized(len(A) * width, bits + own + len(B).bit_length(), "a product of matrices")
    count = sum(len(other) for row in A for x, other in zip(row, B, strict=True) if x)
    spend(count, bits, own, "a product of matrices")
    if A and 4 * sum(map(len, B)) > len(B) * width > DENSE_SIZE:
        return exact.product(A, [[row.get(j, 0) for j in range(width)] for row in B])
    sums = (row_sum({k: x for k, x in enumerate(row) if x}, B) for row in A)
    return [[total.get(j, 0) for j in range(width)] for total in sums]


def congruence(exact: Arithmetic, P: Matrix, A: Sparse, width: int) -> Matrix:
    """Return ``A'P A`` for a symmetric ``P``; ``A`` has so many columns."""
    product = transposed(times(exact, P, A, width)) if P else [[] for _ in range(width)]
    return times(exact, product, A, width)


def combined(what: str, *terms: tuple[int, Matrix]) -> Matrix:
    """Return the sum of multiples of matrices.

    Examples
    --------
    >>> combined("A - 2 B", (1, [[5, 6]]), (-2, [[1, 2]]))
    [[3, 2]]
    """
    factors, matrices = zip(*terms, strict=True)
    count = sum(map(len, matrices[0]))
    bits, ratio = max(longest(chain.from_iterable(S)) for S in matrices), longest(factors)
    sized(count, bits + ratio + 1, what)
    spend(len(terms) * count, bits, ratio, what)
    return [[sum(map(mul, factors, x)) for x in zip(*rows, strict=True)] for rows in zip(*matrices, strict=True)]


def decrease(exact: Arithmetic, F: Matrix, A: Sparse, b: Fraction, unit: int) -> tuple[Matrix, int]:
    """Return ``F A + A'F - b F`` times a positive integer, and that; ``F`` is symmetric, ``A`` over ``unit``."""
    FA = times(exact, F, A, len(A))
    p, q = (b * unit).as_integer_ratio()
    return combined("F A + A'F - b F", (q, FA), (q, transposed(FA)), (-p, F)), q * unit


def decays(exact: Arithmetic, F: Matrix, A: Sparse, b: Fraction, unit: int, columns: Sequence[int]) -> bool:
    """Tell whether ``F A + A'F - b F > 0`` is proved on some coordinates; see :func:`decrease`."""
    return exact.definite(only(decrease(exact, F, A, b, unit)[0], columns))


def quadratic(P: Matrix, z: Sequence[int], sizes: bool = False) -> int:
    """Return ``z'P z``, or ``z'|P| z`` with the sizes of the entries, which bounds it where ``|z_i|`` is less.

    Examples
    --------
    >>> quadratic([[2, -1], [-1, 2]], [1, 1]), quadratic([[2, -1], [-1, 2]], [1, 1], sizes=True)
    (2, 6)
    """
    return sum(x * sum(map(mul, map(abs, row) if sizes else row, z)) for x, row in zip(z, P, strict=True) if x)


def first_unbounded(
    exact: Arithmetic, P: Matrix, rows: Iterable[Sequence[int]], constants: Iterable[Fraction]
) -> int | None:
    """Return the first row of which ``(row z)^2 < c z'P z`` is not proved for all ``z``; 0 unless ``P > 0`` is."""
    forms: list[tuple[list[int], int]] = []
    count = 0
    for row, c in zip(rows, constants, strict=True):
        p, q = c.as_integer_ratio()
        own = [x for x in row if x]
        count += len(own)
        sized(count, longest((q,)) + longest(own), "bounds of agents")
        sized(len(forms) + 1, longest((q * p,)), "bounds of agents")
        spend(len(own), longest((q,)), longest(own), "bounds of agents")
        forms.append(([q * x for x in row], q * p))
    return exact.bounded(P, forms)


def diagonal(values: Sequence[int]) -> Matrix:
    """Return a diagonal matrix."""
    need_rows(len(values))
    return [[x * (i == j) for j in range(len(values))] for i, x in enumerate(values)]


def less(S: Matrix, m: Fraction) -> Matrix:
    """Return ``S - m I``, times a positive integer."""
    p, q = m.as_integer_ratio()
    return combined("S - m I", (q, S), (-p, diagonal([1] * len(S))))


def only(S: Matrix, rows: Sequence[int]) -> Matrix:
    """Return some rows and columns."""
    return [[S[i][j] for j in rows] for i in rows]
