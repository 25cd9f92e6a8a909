"""Dense proofs of definiteness and what the kernel says to them, against minors and constructed truths."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from exact_cases import FAST, FEW, PLAIN, SEEDS, checked, factored, gram, minors_positive
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse

import lmi
from lmi.definiteness_proofs import ELIMINATION_ROWS, ResidualWitness, eliminate


@FEW
@given(SEEDS, st.integers(1, 7), st.integers(-1, 1), st.integers(0, 2))
def test_all_proofs_agree_with_the_minors(seed, n, shift, missing_rank):
    rng = np.random.default_rng(seed)
    S = gram(rng, n, max(n - missing_rank, 1)) + shift * np.eye(n, dtype=int)
    truth = minors_positive(S.tolist())
    assert bool(lmi.prove_positive_definite(S)) == truth
    assert (eliminate(S.tolist()) is None) == truth
    assert PLAIN.definite(S.tolist()) == FAST.definite(S.tolist()) == truth
    assert factored(S.tolist()) <= truth
    assert (lmi.prove_sparse_positive_definite(S) is not None) <= truth


@settings(max_examples=6, deadline=None)
@given(SEEDS, st.integers(21, 45), st.sampled_from([-1, 0, 1]))
def test_a_singular_matrix_shifted_either_way(seed, n, sign):
    """Gram matrices of rank n - 1, over 2^40: shifted by one unit of 2^-40 only one of the three is definite."""
    S = gram(np.random.default_rng(seed), n, n - 1).astype(float)
    S += sign * 2.0**-20 * np.eye(n)
    rows = [[int(x) for x in row] for row in np.ldexp(S, 20)]
    truth = sign > 0
    proof = lmi.prove_positive_definite(S)
    assert proof.proved is truth
    assert factored(rows) is truth
    assert FAST.definite(rows) is PLAIN.definite(rows) is truth
    assert (proof.witness is not None) is truth
    assert not truth or proof.witness.proves(S)


@pytest.mark.parametrize("n", [30, 200])
def test_indefinite_by_a_trillionth_is_refused(n):
    """The Laplacian of the complete graph has the eigenvalue 0; its other eigenvalue is n."""
    K = n * np.eye(n) - 1
    for margin in (-n * 2.0**-40, n * 2.0**-40):
        S = K + margin * np.eye(n)
        rows = [[int(x) for x in row] for row in np.ldexp(S, 43)]
        assert np.ldexp(np.array(rows, dtype=float), -43).tolist() == S.tolist()
        proof = lmi.prove_positive_definite(S)
        assert bool(proof) == (margin > 0) == factored(rows)
        found = lmi.prove_sparse_positive_definite(S)
        assert (found is not None) == (margin > 0)
        assert found is None or checked(sparse.csr_array(S), found)
    if n > ELIMINATION_ROWS:
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
    assert factored(rows)
    for row, column, value in ((3, 4, 1), (2, 2, 0), (2, 2, -5), (2, 2, 5.0), (2, 2, True)):
        spoiled = [list(r) for r in rows]
        spoiled[row][column] = value
        assert not FAST.definite(spoiled) and not PLAIN.definite(spoiled)
    assert not FAST.definite([[1, 0]]) and not PLAIN.definite([[1, 0]])
    assert FAST.definite([]) and PLAIN.definite([])


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
    assert factored(rows) == (sign > 0)
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
    assert bool(lmi.prove_positive_definite(S)) == (excess > 0) == (eliminate(S.tolist()) is None)
    assert factored(S.tolist()) <= (excess > 0)
    found = lmi.prove_sparse_positive_definite(S)
    assert (found is not None) <= (excess > 0)
    big = S + (a >> 20) * np.eye(n, dtype=np.int64)
    if int(np.diag(big).astype(object).max()) > 0:
        assert lmi.prove_positive_definite(big)
        assert factored(big.tolist())
        assert checked(sparse.csr_array(big), lmi.prove_sparse_positive_definite(big))


def test_a_changed_factor_is_refused():
    S = gram(np.random.default_rng(3), 60, 80) + np.eye(60)
    witness = lmi.prove_positive_definite(S).witness
    assert witness.proves(S)
    for change in (2**30, -(2**62)):
        R = witness.R.copy()
        R[17, 5] += change
        assert not ResidualWitness(R, witness.exponents, witness.bits, witness.scale).proves(S)
    assert not ResidualWitness(witness.R, witness.exponents + 1, witness.bits).proves(S)
    assert not ResidualWitness(witness.R, witness.exponents, witness.bits - 1).proves(S)
    assert not witness.proves(S + 1e-3 * np.eye(60)[::-1])
    assert not witness.proves(S[:50, :50])
