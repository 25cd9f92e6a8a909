"""Exact proofs of definiteness and their checks, against minors in rationals and against constructed truths."""

from __future__ import annotations

import math
import subprocess
import sys
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lmi.exact.sparse import dense_definite, dominates, residual_definite
from scipy import sparse

import lmi
import ptcc_certify
from lmi.exact import proofs as exact
from lmi.exact import sparse as sparse_definite

SEEDS = st.integers(0, 2**32 - 1)
FEW = settings(max_examples=30, deadline=None)


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


def checked(S, proof, **kwargs) -> bool:
    """Hand a sparse matrix of floats and the witness to the independent check."""
    lower = sparse.coo_array(sparse.tril(S))
    values, power = lmi.dyadic_integers(lower.data)
    claim = {
        "entries": (lower.row, lower.col, values),
        "order": proof.order,
        "factor": (proof.indptr, proof.indices, proof.data),
        "exponents": proof.exponents,
        "bits": proof.bits,
        "power": power,
        "weights": proof.weights,
    }
    return residual_definite(S.shape[0], **{**claim, **kwargs})


def sparse_matrix(rng: np.random.Generator, n: int, margin: float) -> sparse.csr_array:
    """Laplacian of a random connected graph, weights over some decades, plus a margin: its least eigenvalue."""
    i, j = rng.integers(0, n, 3 * n), rng.integers(0, n, 3 * n)
    i, j = np.concatenate([i, np.arange(n - 1)]), np.concatenate([j, np.arange(1, n)])
    w = 2.0 ** rng.integers(-6, 6, len(i))  # sums are exact
    keep = i != j
    A = sparse.csr_array((w[keep], (i[keep], j[keep])), shape=(n, n))
    A = A + A.T
    return sparse.csr_array(sparse.diags_array(A.sum(axis=1) + margin) - A)


# ---------------------------------------------------------------------- dense


@FEW
@given(SEEDS, st.integers(1, 7), st.integers(-1, 1), st.integers(0, 2))
def test_all_proofs_agree_with_the_minors(seed, n, shift, missing_rank):
    rng = np.random.default_rng(seed)
    S = gram(rng, n, max(n - missing_rank, 1)) + shift * np.eye(n, dtype=int)
    truth = minors_positive(S.tolist())
    assert bool(lmi.prove_positive_definite(S)) == truth
    assert lmi.definite_by_polynomial(S.tolist()) == truth
    assert dense_definite(S.tolist(), numpy=False) == truth
    assert dense_definite(S.tolist()) <= truth
    assert (lmi.prove_sparse_positive_definite(S) is not None) <= truth


@FEW
@given(SEEDS, st.integers(21, 45), st.sampled_from([-1, 0, 1]))
def test_a_singular_matrix_shifted_either_way(seed, n, sign):
    """Gram matrices of rank n - 1, over 2^40: shifted by one unit of 2^-40 only one of the three is definite."""
    S = gram(np.random.default_rng(seed), n, n - 1).astype(float)
    S += sign * 2.0**-20 * np.eye(n)
    rows = [[int(x) for x in row] for row in np.ldexp(S, 20)]
    truth = sign > 0
    proof = lmi.prove_positive_definite(S)
    assert proof.proved is truth
    assert (exact._residual_witness(exact._scaled(S)) is not None) is truth
    assert dense_definite(rows) is truth
    assert (proof.witness is not None) is truth
    assert not truth or proof.witness.proves(S)


def test_the_polynomial_is_a_second_opinion_up_to_forty_rows():
    rng = np.random.default_rng(7)
    S = gram(rng, 40, 39)
    assert not lmi.definite_by_polynomial(S.tolist())
    assert lmi.definite_by_polynomial((S + np.eye(40, dtype=int)).tolist())
    assert lmi.definite_by_polynomial([])
    with pytest.raises(lmi.MatrixError, match="symmetric"):
        lmi.definite_by_polynomial([[2, 1], [0, 2]])


@pytest.mark.parametrize("n", [30, 200])
def test_indefinite_by_a_trillionth_is_refused(n):
    """The Laplacian of the complete graph has the eigenvalue 0; its other eigenvalue is n."""
    K = n * np.eye(n) - 1
    for margin in (-n * 2.0**-40, n * 2.0**-40):
        S = K + margin * np.eye(n)
        rows = [[int(x) for x in row] for row in np.ldexp(S, 43)]
        assert np.ldexp(np.array(rows, dtype=float), -43).tolist() == S.tolist()
        proof = lmi.prove_positive_definite(S)
        assert bool(proof) == (margin > 0) == dense_definite(rows)
        found = lmi.prove_sparse_positive_definite(S)
        assert (found is not None) == (margin > 0)
        assert found is None or checked(sparse.csr_array(S), found)
    if n > exact.ELIMINATION_ROWS:
        refuted = lmi.prove_positive_definite(K - n * 2.0**-40 * np.eye(n))
        x = refuted.direction
        K = [[(n if i == j else 0) - 1 for j in range(n)] for i in range(n)]
        form = sum(x[i] * sum(K[i][j] * x[j] for j in range(n)) for i in range(n))
        assert form - Fraction(n, 2**40) * sum(a * a for a in x) <= 0 < sum(a * a for a in x)


def test_an_asymmetric_or_malformed_matrix_is_refused():
    S = np.eye(30)
    S[3, 4] = 1e-300
    for proof in (lmi.prove_positive_definite, lmi.prove_sparse_positive_definite):
        with pytest.raises(lmi.MatrixError, match="symmetric"):
            proof(S)
        with pytest.raises(lmi.MatrixError, match="square"):
            proof(np.ones((3, 2)))
        with pytest.raises(lmi.MatrixError, match="finite"):
            proof(np.full((30, 30), np.inf))
    rows = (np.eye(30, dtype=int) * 5).tolist()
    assert dense_definite(rows)
    for row, column, value in ((3, 4, 1), (2, 2, 0), (2, 2, -5), (2, 2, 5.0), (2, 2, True)):
        spoiled = [list(r) for r in rows]
        spoiled[row][column] = value
        assert not dense_definite(spoiled)
    assert not dense_definite([[1, 0]])
    assert dense_definite([])


@FEW
@given(SEEDS, st.integers(21, 40), st.sampled_from([-1, 1]))
def test_entries_from_tiny_to_huge(seed, n, sign):
    rng = np.random.default_rng(seed)
    S = gram(rng, n, n - 1) + sign * np.eye(n, dtype=int)
    d = rng.integers(-480, 480, n)  # rows from 1e-300 to 1e300
    scaled = np.ldexp(S.astype(float), d[:, None] + d[None, :])
    assert bool(lmi.prove_positive_definite(scaled)) == (sign > 0)
    found = lmi.prove_sparse_positive_definite(scaled)
    assert (found is not None) == (sign > 0)
    assert found is None or checked(sparse.csr_array(scaled), found)
    up = d - d.min()
    rows = [[int(S[i, j]) << int(up[i] + up[j]) for j in range(n)] for i in range(n)]
    assert dense_definite(rows) == (sign > 0)
    fractions = [[Fraction(x, 3**50) for x in row] for row in rows]
    proof = lmi.prove_positive_definite(fractions)
    assert bool(proof) == (sign > 0)
    assert not proof or proof.witness.proves(fractions)


@FEW
@given(SEEDS, st.integers(2, 30), st.integers(-2, 2))
def test_integers_near_the_end_of_int64(seed, n, excess):
    """Diagonal ``(n-1) a + excess`` over off-diagonals ``a`` in size, as near ``2^63`` as that allows."""
    rng = np.random.default_rng(seed)
    a = (2**63 - 8) // n
    x = rng.choice([-1, 1], n)
    S = -a * np.outer(x, x)
    np.fill_diagonal(S, (n - 1) * a + excess)  # S x = excess x
    assert bool(lmi.prove_positive_definite(S)) == (excess > 0) == dense_definite(S.tolist(), numpy=False)
    assert dense_definite(S.tolist()) <= (excess > 0)
    found = lmi.prove_sparse_positive_definite(S)
    assert (found is not None) <= (excess > 0)
    big = S + (a >> 20) * np.eye(n, dtype=np.int64)
    if int(np.diag(big).astype(object).max()) > 0:
        assert lmi.prove_positive_definite(big)
        assert dense_definite(big.tolist())
        assert checked(sparse.csr_array(big), lmi.prove_sparse_positive_definite(big))


def test_a_changed_factor_is_refused():
    S = gram(np.random.default_rng(3), 60, 80) + np.eye(60)
    witness = lmi.prove_positive_definite(S).witness
    assert witness.proves(S)
    for change in (2**30, -(2**62)):
        R = witness.R.copy()
        R[17, 5] += change
        assert not exact.ResidualWitness(R, witness.exponents, witness.bits, witness.scale).proves(S)
    assert not exact.ResidualWitness(witness.R, witness.exponents + 1, witness.bits).proves(S)
    assert not exact.ResidualWitness(witness.R, witness.exponents, witness.bits - 1).proves(S)
    assert not witness.proves(S + 1e-3 * np.eye(60)[::-1])
    assert not witness.proves(S[:50, :50])


def test_a_factor_with_long_rows_proves_nothing(monkeypatch: pytest.MonkeyPatch):
    """``R R' = S/2`` up to multiples of 1024, the place where a shifted int64 would wrap around; S is indefinite."""
    S = [[1, 2], [2, 1]]
    least = 2.0**-20
    factor = np.array([[math.sqrt(0.5 - least), 0], [1 / math.sqrt(0.5 - least), 0]])
    factor[1, 1] = math.sqrt(1024.5 - factor[1, 0] ** 2 - least)
    monkeypatch.setattr(np.linalg, "cholesky", lambda matrix: factor)
    assert not dense_definite(S)


@given(st.integers(0, 2**32), st.integers(1, 6), st.integers(1, 62))
def test_squares_of_factors_are_exact_or_not_formed(seed: int, n: int, bits: int):
    rng = np.random.default_rng(seed)
    R = rng.integers(-(2**bits), 2**bits, (n, n), endpoint=True)
    found = sparse_definite._dense_square(R)
    assert found is None or (found == R.astype(object) @ R.T.astype(object)).all()
    assert bits > 57 or found is not None


def test_slices_stay_within_the_exact_integers_of_float64():
    for n in (1, 2, 1000, 8192, 8193, 2**20, 2**30):
        w = exact.slice_width(n)
        assert n * 2 ** (2 * w - 2) <= 2**53
        assert w == 21 or n * 2 ** (2 * w) > 2**52
    R = np.full((40, 40), 2**62 - 1)
    limbs = exact._squares(R, 21, 3)
    assert sum(int(q[0, 0]) << (21 * m) for m, q in enumerate(limbs)) == 40 * (2**62 - 1) ** 2
    assert exact._squares(np.full((2, 2**14), 2**62), 21, 3) is None


@FEW
@given(SEEDS, st.integers(0, 61), st.integers(1, 3))
def test_integers_have_the_limbs_that_they_are(seed, size, slices):
    rng = np.random.default_rng(seed)
    values = np.concatenate([rng.integers(-(2**size), 2**size, 20) * 2 + 1, [-(2**63), 2**63 - 1, 0, -1]])
    bits = 21 * slices - 2
    power = 2 - np.array([abs(int(x)).bit_length() for x in values]) - rng.integers(0, 3, 24)
    limbs = exact._limbs(values, power, 21, slices)
    for k, (x, p) in enumerate(zip(values.tolist(), power.tolist(), strict=True)):
        whole = sum(int(limb[k]) << (21 * m) for m, limb in enumerate(limbs))
        assert abs(whole - x * Fraction(2) ** (p + 2 * bits)) <= 1
    small = gram(rng, 30, 40) - 40
    small += 10**6 * np.eye(30, dtype=int)
    assert lmi.prove_positive_definite(small).witness.proves(small)
    assert lmi.prove_positive_definite(small.astype(float)).witness.proves(small)


# ---------------------------------------------------------------------- dominance


def dominance_case(rng: np.random.Generator, n: int):
    """A random H-matrix with integer entries: its edges, diagonal and vectors that prove a positive rate."""
    m = 3 * n
    sources, targets = rng.integers(0, n, m), rng.integers(0, n, m)
    keep = np.unique(sources * n + targets, return_index=True)[1]
    keep = keep[sources[keep] != targets[keep]]
    sources, targets = sources[keep], targets[keep]
    weights = rng.choice([-1, 1], len(keep)) * rng.integers(1, 1000, len(keep))
    u, v = rng.integers(1, 2**20, n), rng.integers(1, 2**20, n)
    need = np.zeros(n)
    np.add.at(need, targets, np.abs(weights) * u[sources] / u[targets])
    np.add.at(need, sources, np.abs(weights) * v[targets] / v[sources])
    diagonal = (need / 2 + rng.uniform(1, 50, n)).astype(np.int64) + 1
    return (sources, targets, weights), diagonal, u, v


def dominance_rate(n, edges, diagonal, u, v) -> Fraction:
    """The largest rate, entry by entry in rationals."""
    u, v = u.tolist(), v.tolist()
    rates = [2 * Fraction(d) for d in diagonal.tolist()]
    for s, t, w in zip(*(x.tolist() for x in edges), strict=True):
        rates[t] -= Fraction(abs(w) * u[s], u[t])
        rates[s] -= Fraction(abs(w) * v[t], v[s])
    return min(rates)


@FEW
@given(SEEDS, st.integers(1, 12), st.sampled_from([0, 45, 300]), st.sampled_from([0, 45, 300]))
def test_dominance_is_judged_alike_by_both_paths(seed, n, up_weights, up_vectors):
    edges, diagonal, u, v = dominance_case(np.random.default_rng(seed), n)
    rate = dominance_rate(n, edges, diagonal, u, v) * 2**up_weights
    lists = [[x << up_weights for x in edges[2].tolist()], [x << up_weights for x in diagonal.tolist()]]
    lists += [[x << up_vectors for x in x.tolist()] for x in (u, v)]
    for path in (True, False):
        for claimed, truth in ((rate, True), (rate - 1, True), (rate + Fraction(1, 10**30), False)):
            whole = (edges[0], edges[1], lists[0])
            assert dominates(n, whole, *lists[1:], claimed, numpy=path) is truth
    assert dominates(n, edges, diagonal, u, v, rate / 2**up_weights)


@FEW
@given(SEEDS, st.integers(1, 10), st.integers(-300, 300))
def test_a_proved_dominance_is_the_largest_rate_and_a_lyapunov_inequality(seed, n, exponent):
    edges, diagonal, u, v = dominance_case(np.random.default_rng(seed), n)
    A = sparse.csr_array((edges[2].astype(float), (edges[1], edges[0])), shape=(n, n))
    A = A + sparse.diags_array(diagonal.astype(float))
    A = sparse.csr_array((np.ldexp(A.data, exponent), A.indices, A.indptr), shape=(n, n))
    proof = lmi.prove_dominance(A, u, v)
    best = dominance_rate(n, edges, diagonal, proof.u, proof.v)
    rate = proof.rate / Fraction(2) ** exponent
    assert best * (1 - Fraction(1, 2**52)) <= rate <= best
    assert dominates(n, edges, diagonal, proof.u, proof.v, rate)
    dense, omega = A.toarray(), [Fraction(int(b), int(a)) for a, b in zip(proof.u, proof.v, strict=True)]
    S = [[omega[i] * Fraction(dense[i, j]) + omega[j] * Fraction(dense[j, i]) for j in range(n)] for i in range(n)]
    for i in range(n):
        S[i][i] -= proof.rate * (1 - Fraction(1, 10**9)) * omega[i]
    assert minors_positive(S)


def test_dominance_with_entries_and_vectors_over_hundreds_of_decades():
    A = np.array([[1e300, 1e290, 0], [-1e-300, 1e-5, 0], [0, 1e-310, 1e-290]])
    proof = lmi.prove_dominance(A, [1.0, 1.0, 1.0], [1e-300, 1.0, 1.0])
    values, power = lmi.dyadic_integers([1e290, -1e-300, 1e-310, 1e300, 1e-5, 1e-290])
    claim = [(1, 0, 1), (0, 1, 2), values[:3]], values[3:], proof.u, proof.v
    assert 0 < proof.rate <= Fraction(2e-290)
    for path in (True, False):
        assert dominates(3, *claim, proof.rate / Fraction(2) ** power, numpy=path)
        assert not dominates(3, *claim, proof.rate / Fraction(2) ** power * (1 + Fraction(1, 2**20)), numpy=path)
    signed = np.array([[2**62, -(2**61)], [-(2**63) + 2**62, 2**62]], dtype=np.int64)
    assert lmi.prove_dominance(signed, [1, 1], [1, 1]).rate == 2**61
    assert lmi.prove_dominance(np.array([[2**62, -(2**63)], [0, 2**62]]), [1, 1], [1, 1]) is None
    assert lmi.prove_dominance(np.array([[2**62, -(2**63)], [0, 2**62]]), [4, 1], [1, 4]).rate == 3 * 2**61


def test_what_does_not_dominate_or_is_malformed_is_refused():
    edges, good = ([0, 1], [1, 0], [-1, 1]), ([2, 2], [1, 1], [1, 1])
    for path in (True, False, None):
        assert dominates(2, edges, *good, 2, numpy=path)
        for bad in (([0, 1], [1, 2], [-1, 1]), ([0, -1], [1, 0], [1, 1]), ([0], [1, 0], [1, 1]), ([0], [1], [0.5])):
            assert not dominates(2, bad, *good, 0, numpy=path)
        for k, vector in ((0, [0, 2]), (1, [1, 0]), (2, [1, -1]), (1, [1]), (2, [1.0, 1.0]), (1, [True, 1])):
            spoiled = [*good]
            spoiled[k] = vector
            assert not dominates(2, edges, *spoiled, -10, numpy=path)
        assert not dominates(2, edges, *good, float("nan"), numpy=path)
        assert dominates(0, ([], [], []), [], [], [], 5, numpy=path)
    assert lmi.prove_dominance([[1.0, 1.0], [1.0, 1.0]], [1, 1], [1, 1]) is None
    assert lmi.prove_dominance([[-1.0]], [1], [1]) is None
    for A, u in (([[1.0, 0.0]], [1]), ([[np.nan]], [1]), ([[1.0]], [0]), ([[1.0]], [1, 1]), ([[1j]], [1])):
        with pytest.raises(lmi.MatrixError):
            lmi.prove_dominance(A, u, u)


# ---------------------------------------------------------------------- sparse


@FEW
@given(SEEDS, st.integers(2, 120), st.sampled_from([-(2.0**-20), 0.0, 2.0**-20, 1.0]))
def test_a_sparse_laplacian_is_definite_by_its_margin_only(seed, n, margin):
    S = sparse_matrix(np.random.default_rng(seed), n, margin)
    proof = lmi.prove_sparse_positive_definite(S)
    assert (proof is not None) == (margin > 0)
    if proof is not None:
        assert checked(S, proof, numpy=True)
        assert checked(S, proof, numpy=False)
        assert not checked(S - 2 * margin * sparse.eye_array(n), proof)


@FEW
@given(SEEDS, st.integers(1, 14), st.integers(0, 70), st.sampled_from([0, 90]))
def test_residuals_are_judged_alike_by_both_paths_and_by_rationals(seed, n, bits, up):
    """Any integers serve as factor, order, exponents and weights; most witnesses fail, some hold."""
    rng = np.random.default_rng(seed)
    R = np.tril(rng.integers(-5, 6, (n, n)) * rng.integers(0, 2, (n, n)))
    np.fill_diagonal(R, rng.integers(1, 9, n))
    noise = np.triu(rng.integers(-2, 3, (n, n)), 1)
    d = rng.integers(1, 4, n)
    E = noise + noise.T
    truth = bool(rng.integers(0, 2))
    np.fill_diagonal(E, -(-(np.abs(E) @ d) // d) + truth)  # dominates, or fails in the rows where this is exact
    truth = bool((np.diag(E) * d > (np.abs(E) @ d - np.abs(np.diag(E)) * d)).all())
    order = rng.permutation(n)
    T = np.zeros((n, n), dtype=np.int64)
    T[np.ix_(order, order)] = R @ R.T + E
    rows, columns = np.tril_indices(n)
    values = [x << (2 * 40 + up) for x in T[rows, columns].tolist()]
    exponents = rng.integers(-20, 20, n)
    values = [x >> int(exponents[i] + exponents[j] + 40) for x, i, j in zip(values, rows, columns, strict=True)]
    indptr = np.concatenate([[0], np.cumsum((R != 0).sum(axis=0))])
    indices, data = np.nonzero(R.T)[1], R.T[np.nonzero(R.T)]
    factor = (indptr, indices, [x << bits for x in data.tolist()])
    claim = (rows, columns, values), order, factor, exponents, bits
    for path in (True, False):
        assert residual_definite(n, *claim, power=40 - 80 - up, weights=d, numpy=path) is truth


def test_a_long_factor_in_pairs_and_block_is_that_of_the_standard_library():
    """Columns before and behind the dense block, several chunks of pairs, rows where only weights dominate."""
    from lmi.exact import sparse as sparse_definite

    rng = np.random.default_rng(11)
    S = sparse_matrix(rng, 400, 2.0**-20)
    proof = lmi.prove_sparse_positive_definite(S)
    chunk, sparse_definite.CHUNK = sparse_definite.CHUNK, 500
    try:
        assert checked(S, proof, numpy=True)
    finally:
        sparse_definite.CHUNK = chunk
    assert checked(S, proof, numpy=False)
    # A chain of residuals: row k needs a weight 2^-k
    n = 12
    E = 16 * np.eye(n) - 10 * np.eye(n, k=1) - 5 * np.eye(n, k=-1)
    d = np.array([2**k for k in range(n)][::-1])
    entries = [np.array(x) for x in np.tril_indices(n)]
    E = (E + E.T).astype(int)
    empty = (np.zeros(n + 1, dtype=int), [], [])
    for path in (True, False):
        claim = (*entries, E[tuple(entries)]), np.arange(n), empty, np.zeros(n, dtype=int), 0
        assert residual_definite(n, *claim, numpy=path)
        assert not residual_definite(n, *claim, weights=d, numpy=path)


def test_a_changed_sparse_witness_is_refused():
    S = sparse_matrix(np.random.default_rng(5), 150, 2.0**-20)
    proof = lmi.prove_sparse_positive_definite(S)
    for path in (True, False):
        assert checked(S, proof, numpy=path)
        data = proof.data.copy()
        data[20] += 2**36
        swapped = proof.order.copy()
        swapped[[3, 90]] = swapped[[90, 3]]
        repeated = proof.order.copy()
        repeated[0] = repeated[1]
        outside = proof.indices.copy()
        outside[-1] += 1
        for change in (
            {"factor": (proof.indptr, proof.indices, data)},
            {"factor": (proof.indptr, outside, proof.data)},
            {"factor": (proof.indptr[:-1], proof.indices, proof.data)},
            {"factor": (proof.indptr, proof.indices[::-1], proof.data)},
            {"factor": (proof.indptr, proof.indices, proof.data.astype(float))},
            {"order": swapped},
            {"order": repeated},
            {"exponents": proof.exponents + 1},
            {"exponents": proof.exponents + 10**9},
            {"bits": proof.bits - 1},
            {"bits": float(proof.bits)},
            {"weights": np.zeros(150, dtype=int)},
        ):
            assert not checked(S, proof, numpy=path, **change)
        upper = sparse.coo_array(sparse.triu(S))
        assert not checked(S, proof, numpy=path, entries=(upper.row, upper.col, upper.data.astype(int)))


def test_a_sparse_matrix_indefinite_by_a_trillionth_is_refused():
    """Circulant second differences: eigenvalue 0, the next 4 sin^2(pi / n)."""
    n = 60
    ring = sparse.diags_array([-1.0, -1.0, 2.0, -1.0, -1.0], offsets=[1 - n, -1, 0, 1, n - 1], shape=(n, n))
    for margin in (-(2.0**-40), 0.0, 2.0**-40):
        S = sparse.csr_array(ring + margin * sparse.eye_array(n))
        proof = lmi.prove_sparse_positive_definite(S)
        assert (proof is not None) == (margin > 0)
        assert proof is None or checked(S, proof)


# ---------------------------------------------------------------------- independence


def test_the_checks_run_on_the_standard_library_alone():
    """In an isolated interpreter without site-packages, from the file itself."""
    path = Path(ptcc_certify.__file__).parent / "sparse_definite.py"
    code = (
        "import runpy, sys\n"
        f"m = runpy.run_path({str(path)!r})\n"
        "assert m['dominates'](2, ([0, 1], [1, 0], [-1, 1]), [2, 2], [1, 1], [1, 1], 2)\n"
        "assert m['residual_definite'](1, ([0], [0], [5]), [0], ([0, 1], [0], [2]), [0], 0)\n"
        "assert m['dense_definite']([[2, 1], [1, 1]], numpy=False)\n"
        "assert not {'numpy', 'scipy', 'lmi', 'ptcc_certify'} & set(sys.modules)\n"
    )
    done = subprocess.run([sys.executable, "-I", "-S", "-c", code], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
