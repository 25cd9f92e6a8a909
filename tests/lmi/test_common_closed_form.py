"""One matrix for several uncertain ones from Lyapunov equations: what it proves, and how far from the best it is."""

from __future__ import annotations

import numpy as np
import pytest

import lmi
from lmi.common_closed_form import closed_form_lyapunov, tuned_multipliers
from lmi.common_lyapunov import best_multipliers, common_lyapunov, evaluate
from lmi.uncertain_matrix import UncertainMatrix


def uncertain(seed: int, n: int = 6, q: int = 5) -> UncertainMatrix:
    rng = np.random.default_rng(seed)
    A = 3 * np.eye(n) + rng.normal(size=(n, n)) / np.sqrt(n)
    return UncertainMatrix(A, rng.normal(size=(n, q)), rng.normal(size=(n, q)), rng.uniform(0.01, 0.1, q))


@pytest.mark.parametrize("seed", range(5))
def test_the_rate_holds_for_every_member_and_is_near_to_the_best(seed: int):
    mode, rng = uncertain(seed), np.random.default_rng(seed)
    found = closed_form_lyapunov([mode])
    P, best = found.matrix, common_lyapunov([mode]).rate
    for _ in range(200):
        A = mode.A + (mode.F * mode.radii * rng.choice([-1, 1], mode.radii.size)) @ mode.H.T
        assert np.linalg.eigvalsh(P @ A + A.T @ P - found.rate * P)[0] > -1e-9
    assert best / 2 < found.rate < best * (1 + 1e-6)


@pytest.mark.parametrize("seed", range(5))
def test_multipliers_without_a_solver_are_nearly_as_good(seed: int):
    mode = uncertain(seed)
    quick = evaluate(np.eye(6), [mode], [tuned_multipliers(np.eye(6), mode)]).rate
    best = best_multipliers(evaluate(np.eye(6), [mode], [np.ones(5)]), [mode]).rate
    assert best - 0.02 * abs(best) < quick < best + 1e-6 * abs(best)


def test_a_mean_that_does_not_decay_gives_none():
    with pytest.raises(lmi.NoCertificate):
        closed_form_lyapunov([UncertainMatrix.known(-np.eye(2))])
