"""Sparse factors: proposed, and judged by both arithmetics, against rationals."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from exact_cases import FAST, FEW, PLAIN, SEEDS, checked, judged, sparse_matrix
from hypothesis import given
from hypothesis import strategies as st
from scipy import sparse

import lmi
from lmi.definiteness_proofs import eliminate
from lmi.exact import fast
from lmi.exact.definite import Arithmetic, SparseFactor


@FEW
@given(SEEDS, st.integers(2, 120), st.sampled_from([-(2.0**-20), 0.0, 2.0**-20, 1.0]))
def test_a_sparse_laplacian_is_definite_by_its_margin_only(seed, n, margin):
    S = sparse_matrix(np.random.default_rng(seed), n, margin)
    proof = lmi.prove_sparse_positive_definite(S)
    assert (proof is not None) == (margin > 0)
    if proof is not None:
        assert checked(S, proof)
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
    witness = SparseFactor(order, *factor, exponents, bits, d)
    assert judged(n, (rows, columns, values), witness, 40 - 80 - up) is truth


def test_a_long_factor_in_pairs_and_block_is_that_of_the_standard_library(monkeypatch: pytest.MonkeyPatch):
    """Columns before and behind the dense block, several chunks of pairs, rows where only weights dominate."""
    rng = np.random.default_rng(11)
    S = sparse_matrix(rng, 400, 2.0**-20)
    proof = lmi.prove_sparse_positive_definite(S)
    monkeypatch.setattr(fast, "CHUNK", 500)
    assert checked(S, proof)
    # A chain of residuals: row k needs a weight 2^-k
    n = 12
    E = 16 * np.eye(n) - 10 * np.eye(n, k=1) - 5 * np.eye(n, k=-1)
    d = np.array([2**k for k in range(n)][::-1])
    entries = [np.array(x) for x in np.tril_indices(n)]
    E = (E + E.T).astype(int)
    empty = (np.zeros(n + 1, dtype=int), [], [])
    entries, witness = (*entries, E[tuple(entries)]), SparseFactor(np.arange(n), *empty, np.zeros(n, dtype=int), 0)
    assert judged(n, entries, witness)
    assert not judged(n, entries, witness._replace(weights=d))


def test_a_changed_sparse_witness_is_refused():
    S = sparse_matrix(np.random.default_rng(5), 150, 2.0**-20)
    proof = lmi.prove_sparse_positive_definite(S)
    assert checked(S, proof)
    data = proof.data.copy()
    data[20] += 2**36
    swapped = proof.order.copy()
    swapped[[3, 90]] = swapped[[90, 3]]
    repeated = proof.order.copy()
    repeated[0] = repeated[1]
    outside = proof.indices.copy()
    outside[-1] += 1
    for change in (
        {"data": data},
        {"indices": outside},
        {"indptr": proof.indptr[:-1]},
        {"indices": proof.indices[::-1]},
        {"data": proof.data.astype(float)},
        {"order": swapped},
        {"order": repeated},
        {"exponents": proof.exponents + 1},
        {"exponents": proof.exponents + 10**9},
        {"bits": proof.bits - 1},
        {"bits": float(proof.bits)},
        {"weights": np.zeros(150, dtype=int)},
    ):
        assert not checked(S, proof, **change)
    upper = sparse.coo_array(sparse.triu(S))
    assert not checked(S, proof, entries=(upper.row, upper.col, upper.data.astype(int)))


def test_a_sparse_matrix_indefinite_by_a_trillionth_is_refused():
    """Circulant second differences: eigenvalue 0, the next 4 sin^2(pi / n)."""
    n = 60
    ring = sparse.diags_array([-1.0, -1.0, 2.0, -1.0, -1.0], offsets=[1 - n, -1, 0, 1, n - 1], shape=(n, n))
    for margin in (-(2.0**-40), 0.0, 2.0**-40):
        S = sparse.csr_array(ring + margin * sparse.eye_array(n))
        proof = lmi.prove_sparse_positive_definite(S)
        assert (proof is not None) == (margin > 0)
        assert proof is None or checked(S, proof)


@pytest.mark.parametrize("judge", [PLAIN, FAST], ids=["plain", "fast"])
def test_factors_that_would_fill_the_memory_once_multiplied_are_not_judged(judge: Arithmetic):
    n, low = 130, -(2**16)
    columns = [list(range(k, n)) for k in range(n)]
    indices = [i for column in columns for i in column]
    indptr = np.cumsum([0, *map(len, columns)]).tolist()
    diagonal = list(range(n)), list(range(n)), [1] * n
    tracemalloc.start()
    factor = SparseFactor(list(range(n)), indptr, indices, [1] * len(indices), [low] * n, low)
    assert not judge.residual_definite(n, diagonal, factor, low)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 10**8


def test_elimination_directions_and_factors_of_one_row():
    assert eliminate([]) is None and eliminate([[3]]) is None and eliminate([[0]]) == 0
    for judge in (PLAIN, FAST):
        assert judge.residual_definite(0, ([], [], []), SparseFactor([], [0], [], [], [], 0))
        assert not judge.residual_definite(1, ([0], [0], [4]), SparseFactor([0], [0, 1], [0], [2], [0], 0))
