"""Products of integer matrices with the signed Laplacian: every inequality of the proof is built of these.

A matrix is a list of rows; one that multiplies from the right is sparse, by rows of ``{column: entry}``. What a product
costs is counted before it is formed.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import chain
from operator import mul

from lmi.exact.definite import Arithmetic
from lmi.exact.numbers import longest, sized
from lmi.exact.work import spend
from ptcc_certify.checker.digraph import Digraph
from ptcc_certify.checker.reading import need

Matrix = list[list[int]]
Sparse = list[dict[int, int]]
#: Rows of a dense matrix.
LARGEST_ROWS = 400
#: Above so many entries, a quarter of them not 0, a product is formed as that of dense matrices.
DENSE_SIZE = 400


def need_rows(rows: int) -> None:
    """Refuse dense matrices that would take long."""
    need(rows <= LARGEST_ROWS, f"a matrix of {rows} rows; {LARGEST_ROWS} are taken")


def block(graph: Digraph, nodes: Sequence[int]) -> Sparse:
    """Return the rows and columns of ``L`` that belong to some nodes, times ``unit``."""
    place = {v: i for i, v in enumerate(nodes)}
    return [{place[j]: x for j, x in graph.row(v).items() if j in place} for v in nodes]


def product(A: Matrix, B: Matrix) -> Matrix:
    """Return ``A B``; for small matrices."""
    return [[sum(map(mul, row, column)) for column in zip(*B, strict=True)] for row in A]


def transposed(A: Matrix) -> Matrix:
    """Return ``A'``."""
    return [list(column) for column in zip(*A, strict=True)]


def times(exact: Arithmetic, A: Matrix, B: Sparse, width: int) -> Matrix:
    """Return ``A B``; ``B`` has so many columns."""
    need_rows(max(len(A), len(B), width))
    bits, own = longest(chain.from_iterable(A)), longest(x for row in B for x in row.values())
    sized(len(A) * width, bits + own + len(B).bit_length(), "a product of matrices")
    spend(
        sum(len(other) for row in A for x, other in zip(row, B, strict=True) if x), bits, own, "a product of matrices"
    )
    if A and 4 * sum(map(len, B)) > len(B) * width > DENSE_SIZE:
        return exact.product(A, [[row.get(j, 0) for j in range(width)] for row in B])
    result = []
    for row in A:
        total = [0] * width
        for x, other in zip(row, B, strict=True):
            if x:
                for j, y in other.items():
                    total[j] += x * y
        result.append(total)
    return result


def congruence(exact: Arithmetic, P: Matrix, A: Sparse, width: int) -> Matrix:
    """Return ``A'P A`` for a symmetric ``P``; ``A`` has so many columns."""
    left = transposed(times(exact, P, A, width)) if P else [[] for _ in range(width)]
    return times(exact, left, A, width)


def decrease(exact: Arithmetic, F: Matrix, A: Sparse, b: Fraction, unit: int) -> tuple[Matrix, int]:
    """Return ``F A + A'F - b F`` times a positive integer, and that; ``F`` is symmetric, ``A`` over ``unit``."""
    FA = times(exact, F, A, len(A))
    p, q = (b * unit).as_integer_ratio()
    bits, ratio = longest(chain.from_iterable(FA)) + 1, longest((p, q))
    sized(len(F) ** 2, bits + ratio, "F A + A'F - b F")
    spend(2 * len(F) ** 2, bits, ratio, "F A + A'F - b F")
    pairs = zip(F, FA, zip(*FA, strict=True), strict=True)
    return [[q * (x + y) - p * f for f, x, y in zip(*rows, strict=True)] for rows in pairs], q * unit


def diagonal(values: Sequence[int]) -> Matrix:
    """Return a diagonal matrix."""
    need_rows(len(values))
    return [[x * (i == j) for j in range(len(values))] for i, x in enumerate(values)]


def less(S: Matrix, m: Fraction) -> Matrix:
    """Return ``S - m I``, times a positive integer."""
    p, q = m.as_integer_ratio()
    bits, ratio = longest(chain.from_iterable(S)), longest((p, q))
    sized(len(S) ** 2, bits + ratio, "S - m I")
    spend(len(S) ** 2, bits, ratio, "S - m I")
    return [[q * x - p * (i == j) for j, x in enumerate(row)] for i, row in enumerate(S)]


def only(S: Matrix, kept: Sequence[int]) -> Matrix:
    """Return some rows and columns."""
    return [[S[i][j] for j in kept] for i in kept]
