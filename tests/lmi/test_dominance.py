"""Dominance: the rate of two vectors, by both arithmetics, against rationals."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from exact_cases import FAST, FEW, PLAIN, SEEDS, dominance_case, dominance_rate, minors_positive
from hypothesis import given
from hypothesis import strategies as st
from scipy import sparse

import lmi


@FEW
@given(SEEDS, st.integers(1, 12), st.sampled_from([0, 45, 300]), st.sampled_from([0, 45, 300]))
def test_dominance_is_judged_alike_by_both_paths(seed, n, up_weights, up_vectors):
    edges, diagonal, u, v = dominance_case(np.random.default_rng(seed), n)
    rate = dominance_rate(n, edges, diagonal, u, v) * 2**up_weights
    lists = [[x << up_weights for x in edges[2].tolist()], [x << up_weights for x in diagonal.tolist()]]
    lists += [[x << up_vectors for x in x.tolist()] for x in (u, v)]
    whole = (edges[0], edges[1], lists[0])
    for judge in (PLAIN, FAST):
        for claimed, truth in ((rate, True), (rate - 1, True), (rate + Fraction(1, 10**30), False)):
            assert judge.dominates(n, whole, *lists[1:], claimed) is truth
        assert judge.largest_rate(n, whole, *lists[1:]) == rate
    assert FAST.dominates(n, edges, diagonal, u, v, rate / 2**up_weights)


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
    assert FAST.dominates(n, edges, diagonal, proof.u, proof.v, rate)
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
    for judge in (PLAIN, FAST):
        assert judge.dominates(3, *claim, proof.rate / Fraction(2) ** power)
        assert not judge.dominates(3, *claim, proof.rate / Fraction(2) ** power * (1 + Fraction(1, 2**20)))
    signed = np.array([[2**62, -(2**61)], [-(2**63) + 2**62, 2**62]], dtype=np.int64)
    assert lmi.prove_dominance(signed, [1, 1], [1, 1]).rate == 2**61
    assert lmi.prove_dominance(np.array([[2**62, -(2**63)], [0, 2**62]]), [1, 1], [1, 1]) is None
    assert lmi.prove_dominance(np.array([[2**62, -(2**63)], [0, 2**62]]), [4, 1], [1, 4]).rate == 3 * 2**61


def test_what_does_not_dominate_or_is_malformed_is_refused():
    edges, good = ([0, 1], [1, 0], [-1, 1]), ([2, 2], [1, 1], [1, 1])
    for judge in (PLAIN, FAST):
        assert judge.dominates(2, edges, *good, 2)
        for bad in (([0, 1], [1, 2], [-1, 1]), ([0, -1], [1, 0], [1, 1]), ([0], [1, 0], [1, 1]), ([0], [1], [0.5])):
            assert not judge.dominates(2, bad, *good, 0)
        for k, vector in ((0, [0, 2]), (1, [1, 0]), (2, [1, -1]), (1, [1]), (2, [1.0, 1.0]), (1, [True, 1])):
            spoiled = [*good]
            spoiled[k] = vector
            assert not judge.dominates(2, edges, *spoiled, -10)
        assert not judge.dominates(2, edges, *good, float("nan"))
        assert judge.dominates(0, ([], [], []), [], [], [], 5)
    assert lmi.prove_dominance([[1.0, 1.0], [1.0, 1.0]], [1, 1], [1, 1]) is None
    assert lmi.prove_dominance([[-1.0]], [1], [1]) is None
    for A, u in (([[1.0, 0.0]], [1]), ([[np.nan]], [1]), ([[1.0]], [0]), ([[1.0]], [1, 1]), ([[1j]], [1])):
        with pytest.raises(lmi.MatrixError):
            lmi.prove_dominance(A, u, u)
