"""Facts about the protocols as CasADi expressions. LaTeX of the nominal one is tried in test_latex.py."""

import pickle
import re
import shutil
import subprocess
from fractions import Fraction
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from run_blocks import blocks

from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.model import NominalProtocol, Protocol, SlidingModeProtocol
from ptcc_certify.theorems.casadi_lyapunov import symbolic_lyapunov

SLIDING = SlidingModeProtocol("0.5", 1, "0.1", "0.3", 2, "1.2", "0.6", "0.9", 1)
PROTOCOL = NominalProtocol("0.6", "0.1", "0.3", 1)


def matrices(n):
    weight = st.sampled_from([-8, -2.5, -1, 0, 0, 0.1, 4, 1e3])
    return st.lists(weight, min_size=n * n, max_size=n * n).map(lambda w: np.array(w).reshape(n, n) * (1 - np.eye(n)))


@settings(deadline=None)
@given(matrices(5), st.sampled_from([0.0, 0.3, 0.599, 0.6, 2.0]), st.integers(0, 99))
def test_the_input_is_the_gain_times_minus_the_laplacian(W, instant, seed):
    graph, state = SignedDigraph.from_matrix(W, orientation="listens"), np.random.default_rng(seed).normal(size=5)
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


@pytest.mark.skipif(shutil.which("gcc") is None, reason="no C compiler")
def test_c_code_of_the_guide_compiles_and_computes_what_python_does(tmp_path, monkeypatch):
    page = (Path(__file__).parents[2] / "docs/guide/python.md").read_text(encoding="utf-8")
    (block,) = [code for _, code in blocks(page, "python") if "generate(" in code]
    command = re.search("gcc .*", block)
    graph = SignedDigraph.from_edges([("ann", "bob", 1), ("bob", "ann", "-2/3"), ("bob", "eve", 1)])
    names = {"g": graph, "p": PROTOCOL}
    monkeypatch.chdir(tmp_path)
    exec(block, names)
    assert command is not None and subprocess.run(command[0].split(), check=True).returncode == 0
    compiled, python = ca.external("protocol", str(tmp_path / "protocol.so")), names["protocol"]
    rng = np.random.default_rng(0)
    for instant in (0, 0.3, 0.599, 0.6, 1):
        state = rng.normal(size=3)
        gain = min(float(PROTOCOL.gain.value(instant)), 50)
        inputs = np.array(compiled(instant, state)).ravel()
        np.testing.assert_allclose(inputs, np.array(python(instant, state)).ravel(), rtol=1e-12, atol=1e-12)  # type: ignore[operator]
        np.testing.assert_allclose(inputs, -gain * (graph.laplacian() @ state), rtol=1e-12, atol=1e-12)
    assert "bob" in (tmp_path / "bob.c").read_text()
    (main,) = blocks(page, "c")
    Path("main.c").write_text(main[1])
    command = re.search("gcc .* main", main[1])
    assert command is not None and subprocess.run(command[0].split(), check=True).returncode == 0
    printed = subprocess.run(["./main"], check=True, capture_output=True, text=True).stdout.split()
    expected = np.array(python(0.5, [5, 2, -4])).ravel()  # type: ignore[operator]
    np.testing.assert_allclose([float(u) for u in printed], expected, rtol=1e-12)


def test_an_agent_that_listens_to_nobody_has_no_input():
    graph = SignedDigraph.from_edges([("leader", "follower", -2)])
    assert PROTOCOL.input(graph)[0].is_zero()


def test_without_rho2_there_is_no_deadline():
    baseline = NominalProtocol(T=1, rho1=1, rho2=0, kappa=1)
    assert not baseline.prescribed
    assert PROTOCOL.prescribed


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


@pytest.mark.parametrize("protocol", [PROTOCOL, SLIDING], ids=["nominal", "sliding-mode"])
def test_a_protocol_is_asked_and_not_told_apart_by_its_class(protocol):
    assert Protocol.from_dict(protocol.to_dict()) == protocol
    assert protocol.parameters == {name: Fraction(text) for name, text in protocol.to_dict().items() if name != "kind"}
    begin = Fraction(0) if protocol.reaching is None else protocol.reaching.T_r
    assert begin + protocol.span == protocol.T == protocol.gain.T
    assert protocol.nominal.reaching is None and protocol.nominal.gain == protocol.gain
    assert protocol.gain.first == Fraction(protocol.rho1 + protocol.rho2 * protocol.kappa / protocol.T)


def test_a_protocol_that_nobody_knows_is_refused():
    given = PROTOCOL.to_dict()
    for change in ({"kind": "linear"}, {"kind": None}, {"mu1": "1"}, {"T": "-1"}):
        with pytest.raises(ParameterError):
            Protocol.from_dict(given | change)
    with pytest.raises(ParameterError, match="kappa"):
        Protocol.from_dict({name: text for name, text in given.items() if name != "kappa"})


def test_latex_is_for_small_graphs():
    ring = SignedDigraph.from_edges([(k, (k + 1) % 21, 1) for k in range(21)])
    with pytest.raises(ParameterError, match="21 agents"):
        PROTOCOL.latex(ring)
    assert PROTOCOL._repr_latex_() == f"$${PROTOCOL.latex()}$$"


# ---------------------------------------------------------------------- sliding mode


@settings(deadline=None)
@given(matrices(4), st.sampled_from([0.0, 0.3, 0.499, 0.5, 1.2, 1.5, 2.0]), st.integers(0, 99))
def test_the_sliding_mode_input_is_48(W, instant, seed):
    graph, rng = SignedDigraph.from_matrix(W, orientation="listens"), np.random.default_rng(seed)
    state, varsigma = rng.normal(size=4), rng.normal(size=4)
    varsigma[0] = -state[0]
    x, v, t = ca.SX.sym("x", 4), ca.SX.sym("v", 4), ca.SX.sym("t")
    u = ca.Function("u", [x, v, t], [SLIDING.input(graph, x, v, t)])(state, varsigma, instant)
    L = np.diag(abs(W).sum(axis=1)) - W
    gain = 0.1 + (0.6 / (1.5 - instant) if instant < 1.5 else 0)
    reaching = 0.6 + (1.8 / (0.5 - instant) if instant < 0.5 else 0)
    sigma = state + varsigma
    expected = -gain * (L @ state) - 1.2 * np.sign(sigma) - reaching * sigma
    np.testing.assert_allclose(np.array(u).ravel(), expected, rtol=1e-11, atol=1e-9)


def test_sliding_variables_move_by_the_disturbance_and_what_drives_them_to_zero():
    graph = SignedDigraph.from_edges([(1, 2, 3), (2, 1, -1)])
    loop = SLIDING.closed_loop(graph)
    sigma_dot = ca.Function("s", [loop["x"], loop["p"], loop["t"]], [loop["ode"][:2] + loop["ode"][2:]])
    reached = sigma_dot([5, -3, -4, 1], [0.25, -1], 0.25)
    np.testing.assert_allclose(np.array(reached).ravel(), [-1.2 - 7.8 + 0.25, 1.2 + 2 * 7.8 - 1])


def test_v_dot_of_proposition_1_is_below_its_bounding_form():
    graph = SignedDigraph.from_edges([(1, 2, 3), (2, 1, -1), (2, 3, 1)])
    loop = SLIDING.closed_loop(graph)
    x, varsigma = loop["x"][:3], loop["x"][3:]
    sigma = x + varsigma
    V_dot = ca.jtimes(ca.sumsqr(sigma) / 2, loop["x"], loop["ode"])
    reach = float(SLIDING.mu1 - SLIDING.delta) * ca.sum1(ca.fabs(sigma))
    bounding_form = -reach - SLIDING.reaching_gain.expression(loop["t"]) * ca.sumsqr(sigma)
    both = ca.Function("V", [loop["t"], x, varsigma, loop["p"]], [V_dot, bounding_form])
    rng = np.random.default_rng(1)
    for _ in range(200):
        x, v = rng.normal(size=3), rng.normal(size=3)
        t = float(rng.uniform(0, 1))
        v_dot, bound = both(t, x, v, rng.uniform(-1, 1, 3))
        assert float(v_dot) <= float(bound) + 1e-9 * abs(float(bound))
        v_dot, bound = both(t, x, v, np.sign(x + v))  # the worst case attains it
        assert float(v_dot) == pytest.approx(float(bound))


def test_on_the_manifold_the_lyapunov_function_is_that_of_the_nominal_protocol():
    from ptcc_certify.graphs.structure import analyse
    from ptcc_certify.theorems.table import theorem_for

    structure = analyse(SignedDigraph.from_edges([(1, 2, 3), (2, 1, -1), (2, 3, 1)]))
    V = theorem_for(structure, "sliding-mode").lyapunov(structure)
    slid, plain = (symbolic_lyapunov(structure, V, p) for p in (SLIDING, SLIDING.nominal))
    assert slid.latex() == plain.latex()
    assert slid.protocol == SLIDING.nominal


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("T_r", 0),
        ("T_s", -1),
        ("rho2", 0),
        ("mu1", 1),
        ("mu1", "0.5"),
        ("mu2", 0),
        ("mu3", 0),
        ("delta", -1),
        ("delta", "1.2"),
    ],
)
def test_a_sliding_mode_parameter_outside_its_domain_is_named(name, value):
    given = {key: text for key, text in SLIDING.to_dict().items() if key != "kind"}
    with pytest.raises(ParameterError, match=name) as caught:
        SlidingModeProtocol(**(given | {name: value}))
    assert "\n" not in str(caught.value)
    assert SlidingModeProtocol(**given) == SLIDING
    assert pickle.loads(pickle.dumps(SLIDING)) == SLIDING  # noqa: S301


def test_latex_of_the_sliding_mode_shows_numbers_of_a_graph():
    graph = SignedDigraph.from_edges([(1, 2, -3)])
    text = SLIDING.latex(graph)
    assert r"u_{2}^{\mathrm{nom}} &= g \left(-3 \left(x_{1} + x_{2}\right)\right)" in text
    assert r"- 1.2 \operatorname{sign}\left(\sigma_{k}\right) - h \sigma_{k}" in text
    assert r"0.6 + \frac{1.8}{0.5 - t}" in text and r"0.1 + \frac{0.6}{1.5 - t}" in text
    assert SLIDING._repr_latex_() == f"$${SLIDING.latex()}$$"
