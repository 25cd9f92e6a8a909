"""A sparse factor of a leader group of which all entries are exact."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest

from lmi.exact.definite import Arithmetic
from ptcc_certify import SignedDigraph
from ptcc_certify.lyapunov import dominance


@pytest.mark.parametrize("seed", [1, 46])
def test_a_sparse_factor_proves_the_exact_form_of_a_leader_group_and_not_only_its_rounding(seed: int) -> None:
    """Rows judged with weights forgive less of what rounding changed: with seed 46 the exact form was not proved."""
    rng = np.random.default_rng(seed)
    n, low = int(rng.integers(5, 60)), int(rng.integers(5, 59))
    weights = [Fraction(int(rng.integers(1, 2**60)), int(rng.integers(2**low, 2**60)) | 1) for _ in range(n)]
    ring = SignedDigraph.from_edges([(k, (k + 1) % n, w) for k, w in enumerate(weights)])
    left = dominance.left_vector(ring)
    proof = dominance._prove_large_group(ring, True, left, *dominance._best_diagonal(ring, left))
    assert proof.parents is None and proof.factor is not None
    unit = Fraction(1, 2**proof.shift)
    L = np.full((n, n), Fraction(0))
    for k, w in enumerate(weights):
        L[(k + 1) % n, [(k + 1) % n, k]] = w * unit, -w * unit
    W = np.array([Fraction(x) for x in proof.weights.tolist()])
    S, B = W[:, None] * L, L[:, 1:]
    form = B.T @ (S + S.T - np.diag(W) * (proof.rate * unit)) @ B
    scale = math.lcm(*(x.denominator for x in form.ravel()))
    rows, columns = np.tril_indices(n - 1)
    entries = rows.tolist(), columns.tolist(), [int(x * scale) for x in form[rows, columns]]
    assert Arithmetic().residual_definite(n - 1, entries, proof.factor, 0, scale)
