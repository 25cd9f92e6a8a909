"""Facts about the nominal protocol as a CasADi expression. Its LaTeX is tried in test_latex.py."""

import pickle
from fractions import Fraction

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ptcc_certify.errors import ParameterError
from ptcc_certify.graph import SignedDigraph
from ptcc_certify.protocols import NominalProtocol

PROTOCOL = NominalProtocol("0.6", "0.1", "0.3", 1)


def matrices(n):
    weight = st.sampled_from([-8, -2.5, -1, 0, 0, 0.1, 4, 1e3])
    return st.lists(weight, min_size=n * n, max_size=n * n).map(lambda w: np.array(w).reshape(n, n) * (1 - np.eye(n)))


@settings(deadline=None)
@given(matrices(5), st.sampled_from([0.0, 0.3, 0.599, 0.6, 2.0]), st.integers(0, 99))
def test_the_input_is_the_gain_times_minus_the_laplacian(W, instant, seed):
    graph, state = SignedDigraph.from_matrix(W), np.random.default_rng(seed).normal(size=5)
    x, t = ca.SX.sym("x", 5), ca.SX.sym("t")
    u = ca.Function("u", [x, t], [PROTOCOL.input(graph, x, t)])(state, instant)
    L = np.diag(abs(W).sum(axis=1)) - W
    np.testing.assert_allclose(np.array(u).ravel(), -PROTOCOL.gain.value(instant) * (L @ state), rtol=1e-12, atol=1e-9)


def test_the_closed_loop_is_the_input_in_its_own_symbols():
    graph = SignedDigraph.from_edges([(1, 2, 3), (2, 1, -1)])
    loop = PROTOCOL.closed_loop(graph)
    assert {s.name() for s in ca.symvar(loop["ode"])} == {"x1", "x2", "t"}
    jacobian = ca.Function("J", [loop["x"], loop["t"]], [ca.jacobian(loop["ode"], loop["x"])])(0, 0)
    np.testing.assert_allclose(np.array(jacobian), -0.6 * graph.laplacian().toarray())


def test_an_agent_that_listens_to_nobody_has_no_input():
    graph = SignedDigraph.from_edges([("leader", "follower", -2)])
    assert PROTOCOL.input(graph)[0].is_zero()


def test_without_rho2_there_is_no_deadline():
    baseline = NominalProtocol(T=1, rho1=1, rho2=0, kappa=1)
    assert not baseline.prescribed
    assert baseline.settling_time is None
    assert PROTOCOL.prescribed
    assert PROTOCOL.settling_time == Fraction(3, 5)


@pytest.mark.parametrize(
    ("name", "value"),
    [("T", 0), ("T", "-1"), ("rho1", 0), ("rho1", float("nan")), ("rho2", -1e-9), ("kappa", 0), ("kappa", "two")],
)
def test_a_parameter_outside_its_domain_is_named_with_value_and_domain(name, value):
    with pytest.raises(ParameterError, match=rf"{name} = .*{name} must be") as caught:
        NominalProtocol(**({"T": 1, "rho1": 1, "rho2": 1, "kappa": 1} | {name: value}))
    assert "\n" not in str(caught.value)


def test_the_dictionary_rebuilds_the_protocol_exactly():
    for protocol in (PROTOCOL, NominalProtocol(0.1, 0.2, 0, 1e-9)):
        parameters = protocol.to_dict()
        assert parameters.pop("kind") == protocol.kind == "nominal"
        assert all(isinstance(value, str) for value in parameters.values())
        assert NominalProtocol(**parameters) == protocol
        assert pickle.loads(pickle.dumps(protocol)) == protocol  # noqa: S301


def test_latex_is_for_small_graphs():
    ring = SignedDigraph.from_edges([(k, (k + 1) % 21, 1) for k in range(21)])
    with pytest.raises(ParameterError, match="21 agents"):
        PROTOCOL.latex(ring)
    assert PROTOCOL._repr_latex_() == f"$${PROTOCOL.latex()}$$"
