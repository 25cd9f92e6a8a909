"""Matrices, edges and witnesses for the tests of the kernel, and what their truth is in rationals."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from hypothesis import settings
from hypothesis import strategies as st
from scipy import sparse

import lmi
from lmi.exact import fast
from lmi.exact.definite import Arithmetic, symmetric
from lmi.exact.fast import FastArithmetic

SEEDS = st.integers(0, 2**32 - 1)
FEW = settings(max_examples=30, deadline=None)
PLAIN, FAST = Arithmetic(), FastArithmetic()


def minors_positive(S) -> bool:
    """Sylvester's criterion in rationals, with plain Gaussian elimination."""
    rows = [[Fraction(x) for x in row] for row in S]
    for k, pivot in enumerate(rows):
        if pivot[k] <= 0:
            return False
        for row in rows[k + 1 :]:
            factor = row[k] / pivot[k]
            for j in range(k, len(rows)):
                row[j] -= factor * pivot[j]
    return True


def gram(rng: np.random.Generator, n: int, rank: int) -> np.ndarray:
    Y = rng.integers(-9, 10, (n, rank))
    return Y @ Y.T


def factored(S) -> bool:
    """Tell whether floats propose a factor that the kernel accepts."""
    return symmetric(S) and fast.factor(S) is not None


def judged(n, entries, factor, power=0) -> bool:
    """Judge a sparse factor by both arithmetics, which agree."""
    plain, arrays = (judge.residual_definite(n, entries, factor, power) for judge in (PLAIN, FAST))
    assert plain is arrays
    return plain


def checked(S, proof, *, entries=None, **changes) -> bool:
    """Hand a sparse matrix of floats and the witness, changed, to both arithmetics."""
    lower = sparse.coo_array(sparse.tril(S))
    values, power = lmi.dyadic_integers(lower.data)
    return judged(S.shape[0], entries or (lower.row, lower.col, values), proof._replace(**changes), power)


def sparse_matrix(rng: np.random.Generator, n: int, margin: float) -> sparse.csr_array:
    """Laplacian of a random connected graph, weights over some decades, plus a margin: its least eigenvalue."""
    i, j = rng.integers(0, n, 3 * n), rng.integers(0, n, 3 * n)
    i, j = np.concatenate([i, np.arange(n - 1)]), np.concatenate([j, np.arange(1, n)])
    w = 2.0 ** rng.integers(-6, 6, len(i))  # sums are exact
    keep = i != j
    A = sparse.csr_array((w[keep], (i[keep], j[keep])), shape=(n, n))
    A = A + A.T
    return sparse.csr_array(sparse.diags_array(A.sum(axis=1) + margin) - A)
