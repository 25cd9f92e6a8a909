"""Programs over symmetric matrices: formulas mean what they say, and the optimum is that of a modelling language."""

from __future__ import annotations

import cvxpy as cp
import numpy as np
import pytest

from lmi.errors import NoCertificate, OutOfTime
from lmi.search_time import time_limit
from lmi.semidefinite_program import Program, bordered, diagonal


def test_formulas_are_those_of_arrays():
    rng = np.random.default_rng(1)
    program = Program()
    d, P, t = program.column(2), program.symmetric(3), program.column(1)
    x = rng.standard_normal(program.count)
    A, B, C = rng.standard_normal((2, 3)), rng.standard_normal((3, 2)), rng.standard_normal((3, 3))

    def value(matrix):
        moved = matrix.terms @ x[: matrix.terms.shape[1]]
        return matrix.constant + moved.reshape(matrix.constant.shape, order="F")

    values = {"d": value(d), "P": value(P), "t": value(t)}
    assert (values["d"][:, 0] == x[:2]).all() and values["t"][0, 0] == x[-1]
    assert sorted(values["P"][np.tril_indices(3)]) == sorted(x[2:8]) and (values["P"] == values["P"].T).all()
    for made, meant in (
        (A @ P, A @ values["P"]),
        (P @ B, values["P"] @ B),
        ((P @ B).T, (values["P"] @ B).T),
        (P - t * C, values["P"] - x[-1] * C),
        (C - 2.0 * P + 1.0, C - 2 * values["P"] + 1),
        (diagonal(d), np.diag(x[:2])),
        (
            bordered(P, P @ B, diagonal(d)),
            np.block([[values["P"], values["P"] @ B], [(values["P"] @ B).T, np.diag(x[:2])]]),
        ),
        (bordered(C, B, diagonal(d)), np.block([[C, B], [B.T, np.diag(x[:2])]])),
    ):
        np.testing.assert_allclose(value(made), meant, atol=1e-13)


@pytest.mark.parametrize("seed", range(3))
def test_the_optimum_is_that_of_a_modelling_language(seed):
    rng = np.random.default_rng(seed)
    A, F = rng.standard_normal((4, 4)) + 3 * np.eye(4), rng.standard_normal((4, 2)) / 5
    program = Program()
    P, tau, t = program.symmetric(4), program.column(2), program.column(1)
    form = P @ A
    program.positive(bordered(form + form.T - t * np.eye(4), P @ F, diagonal(tau)))
    program.positive(np.eye(4) - P)
    program.positive(P)
    program.not_negative(1.0 - tau)
    best = program.maximise(t, tol_gap_rel=1e-9)(t)[0, 0]
    Q, s, u = cp.Variable((4, 4), symmetric=True), cp.Variable(2), cp.Variable()
    whole = cp.bmat([[Q @ A + A.T @ Q - u * np.eye(4), Q @ F], [(Q @ F).T, cp.diag(s)]])
    problem = cp.Problem(cp.Maximize(u), [whole >> 0, np.eye(4) - Q >> 0, Q >> 0, s <= 1])
    assert best == pytest.approx(problem.solve(solver="CLARABEL"), rel=1e-6)


def test_what_has_no_answer_is_said():
    program = Program()
    x = program.column(1)
    program.not_negative(x - 2.0)
    program.not_negative(1.0 - x)
    with pytest.raises(NoCertificate, match="Infeasible"):
        program.maximise(x)
    program = Program()
    x = program.column(1)
    program.not_negative(x + np.nan)
    with pytest.raises(NoCertificate, match="not finite"):
        program.maximise(x)
    with time_limit(1e-9), pytest.raises(OutOfTime):
        program.maximise(x)


def test_a_panic_is_tried_once_more_without_splitting(monkeypatch):
    import clarabel

    class PanicException(BaseException):
        pass

    solver, asked = clarabel.DefaultSolver, []

    def panics(*program):
        asked.append(program[-1].chordal_decomposition_enable)
        if asked[-1] or len(asked) > 2:
            raise PanicException
        return solver(*program)

    monkeypatch.setattr(clarabel, "DefaultSolver", panics)
    program = Program()
    x = program.column(1)
    program.not_negative(1.0 - x)
    assert program.maximise(x)(x)[0, 0] == pytest.approx(1) and asked == [True, False]
    with pytest.raises(NoCertificate, match="panicked"):
        program.maximise(x)
