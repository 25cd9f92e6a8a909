"""One Lyapunov matrix for several uncertain matrices."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

import lmi
from lmi.child_process import apart
from lmi.common_lyapunov import best_multipliers, common_lyapunov, evaluate, least_condition
from lmi.uncertain_matrix import UncertainMatrix


def uncertain(rng, n=3, q=3):
    A = rng.standard_normal((n, n)) + 3 * np.eye(n)
    return UncertainMatrix(A, rng.standard_normal((n, q)), rng.standard_normal((n, q)), rng.uniform(0.05, 0.2, q))


def vertices(mode):
    for signs in product((-1, 1), repeat=len(mode.radii)):
        yield mode.A + (mode.F * (mode.radii * np.array(signs))) @ mode.H.T


def least_rate(P, matrices):
    inverse = np.linalg.inv(np.linalg.cholesky(P))
    forms = (P @ A + A.T @ P for A in matrices)
    return min(np.linalg.eigvalsh(inverse @ S @ inverse.T)[0] for S in forms)


@pytest.mark.parametrize("shape", ["full", "diagonal"])
def test_the_rates_hold_at_every_vertex_of_every_mode(shape):
    rng = np.random.default_rng(1)
    modes = [uncertain(rng), uncertain(rng)]
    found = best_multipliers(common_lyapunov(modes, shape=shape), modes)
    assert found.rate > 0 and np.linalg.eigvalsh(found.matrix)[-1] == pytest.approx(1)
    for mode, rate in zip(modes, found.rates, strict=True):
        assert least_rate(found.matrix, vertices(mode)) >= rate - 1e-9
    if shape == "diagonal":
        assert (found.matrix == np.diag(np.diag(found.matrix))).all()


def test_the_multipliers_lose_little_against_all_vertices():
    rng = np.random.default_rng(2)
    for _ in range(3):
        mode = uncertain(rng)
        by_vertices = common_lyapunov([UncertainMatrix.known(A) for A in vertices(mode)]).rate
        assert 0.9 * by_vertices < common_lyapunov([mode]).rate < by_vertices * (1 + 1e-3)


def test_one_known_matrix_decays_nearly_at_its_spectral_rate():
    A = np.array([[1.0, 9.0], [0.0, 2.0]])
    assert 1.99 < common_lyapunov([UncertainMatrix.known(A)]).rate <= 2


def test_a_slower_matrix_may_have_a_much_smaller_condition():
    mode = UncertainMatrix.known([[1.0, 9.0], [0.0, 2.0]])
    best = common_lyapunov([mode])
    slower = least_condition([mode], [0.9 * best.rate])
    assert slower.condition < best.condition / 2 and slower.rate == pytest.approx(0.9 * best.rate, rel=1e-3)


def test_scales_of_the_modes_do_not_matter():
    rng = np.random.default_rng(3)
    mode = uncertain(rng)
    large = UncertainMatrix(1e6 * mode.A, 1e9 * mode.F, mode.H, 1e-3 * mode.radii)
    assert common_lyapunov([large]).rate == pytest.approx(1e6 * common_lyapunov([mode]).rate, rel=1e-3)


def test_rates_of_matrices_that_share_none_are_negative():
    # x' = -A x with each turns outwards in another direction; together they destabilise.
    modes = [UncertainMatrix.known([[0.1, 4.0], [-0.5, 0.1]]), UncertainMatrix.known([[0.1, 0.5], [-4.0, 0.1]])]
    assert common_lyapunov(modes).rate < 0


def test_malformed_matrices_are_refused():
    one = UncertainMatrix.known([[1.0]])
    with pytest.raises(lmi.MatrixError, match="same number of rows"):
        common_lyapunov([one, UncertainMatrix.known(np.eye(2))])
    with pytest.raises(lmi.MatrixError, match="same number of rows"):
        common_lyapunov([])
    with pytest.raises(lmi.MatrixError, match="shape"):
        common_lyapunov([one], shape="round")
    with pytest.raises(lmi.MatrixError, match="radius"):
        UncertainMatrix(np.eye(1), np.ones((1, 1)), np.ones((1, 1)), np.zeros(1))
    with pytest.raises(np.linalg.LinAlgError):
        evaluate(-np.eye(1), [one], [np.zeros(0)])


def test_a_time_limit_ends_the_search():
    with lmi.time_limit(0), pytest.raises(lmi.OutOfTime):
        common_lyapunov([UncertainMatrix.known(np.eye(2))])


def test_a_forked_process_refuses_at_once():
    with pytest.raises(lmi.NoCertificate, match="forked"):
        list(apart(lambda: [common_lyapunov([UncertainMatrix.known(np.eye(2))])]))
