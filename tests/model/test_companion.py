"""Linear agents with one input in the coordinates of a chain: exactly so, or named where no input moves them."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from ptcc_certify.errors import ParameterError
from ptcc_certify.model.companion import companion_form


@pytest.mark.parametrize("seed", range(12))
def test_the_chain_obeys_the_equation_of_the_agent(seed: int):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 6))
    A = [[Fraction(int(x), 4) for x in row] for row in rng.integers(-9, 10, (n, n))]
    B = [Fraction(int(x), 3) for x in rng.integers(1, 9, n)]
    form = companion_form(A, B)
    R, M, b = (np.array(x, dtype=object) for x in (form.transformation, A, B))
    chain = np.array([[Fraction(j == i + 1) for j in range(n)] for i in range(n)], dtype=object)
    chain[-1] = [-a for a in form.plant]
    assert (R.dot(M) == chain.dot(R)).all()
    assert R.dot(b).tolist() == [0] * (n - 1) + [1]
    state = [Fraction(int(x)) for x in rng.integers(-9, 10, n)]
    assert [row[0] for row in form.derivatives([state])] == R.dot(np.array(state, dtype=object)).tolist()


def test_what_no_input_moves_is_named():
    with pytest.raises(ParameterError, match=r"q = \(-1, 1\), q'B = 0 and q'A = 3 q'"):
        companion_form([[3, 0], [0, 3]], [1, 1])
    with pytest.raises(ParameterError, match="no input moves"):
        companion_form([[0, 1, 0], [0, 0, 0], [0, 0, 0]], [0, 1, 0])
    with pytest.raises(ParameterError, match="A is n x n"):
        companion_form([[1, 2]], [1])


def test_one_input_may_stand_in_a_column_and_several_are_refused():
    A = [[0, 1], [-2, "0.5"]]
    assert companion_form(np.array([[0, 1], [-2, 0.5]]), np.array([[0], [1]])) == companion_form(A, [0, 1])
    with pytest.raises(ParameterError, match="B has several columns"):
        companion_form(A, np.eye(2))
    for states in (3, "x", [[1, 2, 3]]):
        with pytest.raises(ParameterError, match="state"):
            companion_form(A, [0, 1]).derivatives(states)  # type: ignore[arg-type]  # wrong on purpose
