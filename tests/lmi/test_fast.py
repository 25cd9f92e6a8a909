"""The array twins of the kernel against the plain ones, on random and on adversarial input."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from exact_cases import FAST, FEW, PLAIN, SEEDS, factored, gram
from hypothesis import given
from hypothesis import strategies as st

import lmi
from lmi.definiteness_proofs import _array_integers, eliminate
from lmi.dyadic import dyadic_array
from lmi.exact import fast
from lmi.exact.definite import SparseFactor, scaled


def wide(rng: np.random.Generator, shape, bits: int) -> list:
    """Integers of up to so many bits and either sign, some of them 0."""
    sizes = rng.integers(0, bits + 1, shape)
    return np.vectorize(
        lambda size: int(rng.integers(-1, 2)) * ((1 << int(size)) - int(rng.integers(0, 2))), otypes="O"
    )(sizes).tolist()


@FEW
@given(SEEDS, st.integers(1, 40), st.sampled_from([3, 62, 64, 200]))
def test_products_and_polynomials_are_those_of_the_standard_library(seed, n, bits):
    rng = np.random.default_rng(seed)
    A, B = wide(rng, (n, n), bits), wide(rng, (n, 3), bits)
    assert FAST.product(A, B) == PLAIN.product(A, B)
    assert FAST.product([], A) == PLAIN.product([], A) == []
    rows = [{j: x for j, x in enumerate(row) if x} for row in A[: min(n, 12)]]
    rows = [{j: x for j, x in row.items() if j < len(rows)} for row in rows]
    assert FAST.characteristic(rows) == PLAIN.characteristic(rows)


@FEW
@given(SEEDS, st.integers(1, 34), st.integers(-1, 1), st.sampled_from([0, 1, 40, 3000]), st.booleans())
def test_definiteness_is_that_of_elimination(seed, n, shift, spread, singular):
    """Singular or not, shifted by one, rows of up to 900 decades apart, with entries that float64 cannot hold."""
    rng = np.random.default_rng(seed)
    S = (gram(rng, n, max(n - singular, 1)) + shift * np.eye(n, dtype=int)).tolist()
    up = rng.integers(0, spread + 1, n).tolist()
    S = [[x << up[i] + up[j] for j, x in enumerate(row)] for i, row in enumerate(S)]
    truth = eliminate(S) is None
    assert FAST.definite(S) is PLAIN.definite(S) is truth
    assert factored(S) <= truth


@FEW
@given(SEEDS, st.integers(0, 40), st.sampled_from([3, 30, 61, 62, 64, 90]), st.booleans())
def test_remainders_are_those_of_the_standard_library(seed, n, bits, many):
    """Any factor, entries and weights, up to the ends of int64 and beyond; ``many``: columns that count as a block."""
    rng = np.random.default_rng(seed)
    R = np.tril(rng.random((n, n)) < (0.9 if many else 0.2))
    indices, data = [], []
    for k in range(n):
        rows = np.flatnonzero(R[:, k]).tolist()
        indices.append(rows)
        data += wide(rng, len(rows), bits)
    indptr = [0, *np.cumsum([len(rows) for rows in indices]).tolist()]
    count = int(rng.integers(0, 3 * n + 1))
    ends = np.sort(rng.integers(0, max(n, 1), (2, count)), axis=0)
    entries = ends[1], ends[0], wide(rng, count, 2 * bits)
    weights = [abs(x) + 1 for x in wide(rng, n, 70)] if rng.random() < 0.5 else None
    factor = SparseFactor(
        rng.permutation(n), indptr, [i for rows in indices for i in rows], data, rng.integers(-9, 9, n), 5, weights
    )
    S = scaled(n, entries, factor, int(rng.integers(-30, 30)), int(rng.integers(1, 10**6)))
    assert S is not None
    assert FAST.spare(S) == PLAIN.spare(S)


def test_what_is_not_symmetric_is_neither_proved_nor_bounded():
    """Dominance of the rows of ``E`` says nothing where it is not symmetric: ``x'Sx < 0`` at (1, 1, ..)."""
    for n in (2, 30):
        S = [[10**6 if i == j else 0 for j in range(n)] for i in range(n)]
        S[0][1] = -(10**7)
        assert fast.factor(S) is None
        assert fast.dense_spare(S, np.zeros((n, n), dtype=np.int64), [0] * n, 0) is None
        assert sum(map(sum, S)) < 0 or n > 2
        for judge in (PLAIN, FAST):
            assert not judge.definite(S) and judge.above(S, [[1] * n]) is None
            assert judge.bounded(S, [([1] * n, 10**20)]) == 0
        assert lmi.prove_generalized_margin(S, np.eye(n, dtype=int).tolist(), 1.0) is None


# ---------------------------------------------------------------------- exact products


def test_a_factor_with_long_rows_proves_nothing(monkeypatch: pytest.MonkeyPatch):
    """``R R' = S/2`` up to multiples of 1024, the place where a shifted int64 would wrap around; S is indefinite."""
    S = [[1, 2], [2, 1]]
    least = 2.0**-20
    for size in (0.25, 0.5, 1.0):
        factor = np.array([[math.sqrt(size / 2 - least), 0], [size / math.sqrt(size / 2 - least), 0]])
        factor[1, 1] = math.sqrt(1024 + size / 2 - factor[1, 0] ** 2 - least)
        monkeypatch.setattr(np.linalg, "cholesky", lambda matrix, factor=factor: factor)
        assert not factored(S)


@given(st.integers(0, 2**32), st.integers(1, 6), st.integers(1, 62))
def test_squares_of_factors_are_exact_or_not_formed(seed: int, n: int, bits: int):
    rng = np.random.default_rng(seed)
    R = rng.integers(-(2**bits), 2**bits, (n, n), endpoint=True)
    found = fast.square(R)
    assert found is None or (found == R.astype(object) @ R.T.astype(object)).all()
    assert bits > 57 or found is not None


def test_slices_stay_within_the_exact_integers_of_float64():
    for terms in (1, 2, 1000, 8192, 8193, 2**20, 2**30):
        digits, width = fast._digits(np.array([2**62, -(2**62), 1, -1, 2**62 - 1]), terms)
        assert terms * 2 ** (2 * width - 2) <= 2**53
        assert width == fast.SLICE or terms * 2 ** (2 * width) >= 2**51
        whole = sum(digit.astype(object) << (width * k) for k, digit in enumerate(digits))
        assert whole.tolist() == [2**62, -(2**62), 1, -1, 2**62 - 1]
        assert all(np.abs(digit).max() <= 2 ** (width - 1) for digit in digits[:-1])
    assert (fast.square(np.full((40, 40), 2**62 - 1)) == 40 * (2**62 - 1) ** 2).all()
    for long in (np.full((2, 2**14), 2**62), np.full((1, 2**17), -(2**61) + 1)):
        found = fast.square(long)
        assert found is None or (found == long.shape[1] * int(long[0, 0]) ** 2).all()
    for beyond in (-(2**63), 2**63 - 1, 2**62 + 1):
        assert fast.square(np.array([[beyond, 0], [0, 1]])) is None


def test_pieces_are_joined_without_wrapping():
    """Sums at the end of int64 in every place."""
    for width in (4, 20, 21):
        for size in (2**20, 2**55, 2**62):
            for signs in np.ndindex(3, 3, 3, 3):
                limbs = [np.array([(s - 1) * size]) for s in signs]
                truth = sum(int(limb[0]) << (width * k) for k, limb in enumerate(limbs))
                assert fast._join(limbs, width).tolist() == [truth]


@FEW
@given(SEEDS, st.integers(0, 62), st.integers(-1060, 900))
def test_floats_and_integers_become_the_integers_that_they_are(seed, size, exponent):
    rng = np.random.default_rng(seed)
    whole = np.concatenate([rng.integers(-(2**size), 2**size, 20) * 2 - 1, [-(2**63), 2**63 - 1, 0, -1]])
    spread = rng.integers(0, 60, len(whole))
    for values in (whole, np.ldexp(whole.astype(float), exponent + spread), np.zeros(3), np.array([5e-324, 1e308])):
        found, power = dyadic_array(values)
        assert [Fraction(x) * Fraction(2) ** power for x in found.tolist()] == [Fraction(x) for x in values.tolist()]
    S = np.add.outer(np.ldexp(whole.astype(float), exponent % 300), np.ldexp(whole.astype(float), exponent % 300))
    for matrix in (S, rng.integers(-(2**62), 2**62, (5, 5))):
        matrix = np.triu(matrix) + np.triu(matrix, 1).T
        rows, shift, scale = _array_integers(matrix)
        for i, row in enumerate(matrix.tolist()):
            for j, x in enumerate(row):
                assert rows[i, j] == scale * Fraction(x) * Fraction(2) ** (shift[i] + shift[j])
    small = gram(rng, 30, 40) - 40 + 10**6 * np.eye(30, dtype=int)
    assert lmi.prove_positive_definite(small).witness.proves(small)
    assert lmi.prove_positive_definite(small.astype(float)).witness.proves(small)
