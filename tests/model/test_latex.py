"""The LaTeX of an expression, read back by an evaluator of its own, has the value of the expression."""

import re

import casadi as ca
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.model import NominalProtocol
from ptcc_certify.model.casadi_latex import symbol_latex, to_latex
from ptcc_certify.model.gain import Gain

TOKEN = re.compile(r"\s*(\\begin\{cases\}|\\end\{cases\}|\\\\|\\[a-zA-Z]+|[0-9.]+|.)")
FUNCTIONS = {
    r"\sin": np.sin,
    r"\cos": np.cos,
    r"\ln": np.log,
    r"\tanh": np.tanh,
    r"\min": np.fmin,
    r"\max": np.fmax,
    "sign": np.sign,
}
RELATIONS = {
    "<": lambda a, b: a < b,
    r"\le": lambda a, b: a <= b,
    ">": lambda a, b: not a <= b,  # as CasADi does where a or b is not a number
    r"\ge": lambda a, b: not a < b,
}


class Reader:
    """Evaluate LaTeX as a mathematician reads it: juxtaposition multiplies and binds tighter than plus and minus."""

    def __init__(self, text, values):
        self.tokens, self.at, self.values = [*TOKEN.findall(text), ""], 0, values

    @property
    def next(self):
        return self.tokens[self.at]

    def take(self, *expected):
        token = self.next
        assert not expected or token in expected, (token, expected)
        self.at += 1
        return token

    def braced(self, read):
        self.take("{")
        value = read()
        self.take("}")
        return value

    def sum(self):
        sign = -1 if self.next == "-" and self.take() else 1
        value = sign * self.product()
        while self.next in ("+", "-"):
            value = value + self.product() if self.take() == "+" else value - self.product()
        return value

    def product(self):
        value = self.power()
        while self.next and self.next not in ("+", "-", ",", "&", "}", "^", "|", r"\right", r"\\", *RELATIONS):
            if self.next == r"\end{cases}":
                break
            if self.next == r"\cdot":
                self.take()
            value = value * self.power()
        return value

    def power(self):
        base = self.atom()
        if self.next == "^":
            self.take()
            return base ** self.braced(self.sum)
        return base

    def atom(self):
        token = self.take()
        if token[0].isdigit():
            return np.float64(token)
        if token == r"\infty":
            return np.float64(np.inf)
        if token == r"\frac":
            return self.braced(self.sum) / self.braced(self.sum)
        if token == r"\sqrt":
            return np.sqrt(self.braced(self.sum))
        if token == r"\left":
            bracket = self.take("(", "|")
            inside = [self.sum()]
            while self.next == ",":
                self.take()
                inside.append(self.sum())
            self.take(r"\right")
            self.take(")", "|")
            return np.abs(inside[0]) if bracket == "|" else inside[0] if len(inside) == 1 else inside
        if token == r"\begin{cases}":
            return self.cases()
        if token in FUNCTIONS or token == r"\operatorname":
            name = token if token in FUNCTIONS else self.braced(self.word)
            argument = self.atom()
            return FUNCTIONS[name](*argument) if isinstance(argument, list) else FUNCTIONS[name](argument)
        name = self.braced(self.word) if token == r"\mathrm" else token.lstrip("\\")
        if token == r"\mathrm" and name == "e":
            return np.float64(np.e)
        if self.next == "_":
            self.take()
            name += self.braced(self.word)
        return np.float64(self.values[name])

    def word(self):
        letters = ""
        while self.next != "}":
            letters += self.take()
        return letters

    def cases(self):
        found = []
        while self.next != r"\end{cases}":
            value = self.sum()
            self.take(",")
            self.take("&")
            left = self.sum()
            holds = RELATIONS[self.take()](left, self.sum())
            found += [value] if holds else []
            if self.next == r"\\":
                self.take()
        self.take()
        assert len(found) == 1
        return found[0]


def read(text, **values):
    reader = Reader(text, values)
    with np.errstate(all="ignore"):
        value = reader.sum()
    assert reader.next == "", f"left over: {reader.tokens[reader.at :]}"
    return value


x, y, t = ca.SX.sym("x3"), ca.SX.sym("kappa"), ca.SX.sym("t")


def evaluate(expression, **values):
    symbols = ca.vertcat(x, y, t)
    return float(ca.Function("f", [symbols], [expression])([values[s.name()] for s in (x, y, t)]))


LEAVES = st.one_of(
    st.sampled_from([x, y, t]),
    st.sampled_from([-3.0, -1.0, 0.0, 0.5, 2.0, 12.0, 1e-7, 2.5e20, 1 / 3]).map(ca.SX),
)
UNARY = [
    lambda a: -a,
    ca.sin,
    ca.cos,
    ca.tanh,
    ca.exp,
    ca.log,
    ca.sqrt,
    ca.fabs,
    ca.sign,
    lambda a: a**2,
    lambda a: 1 / a,
    lambda a: 2 * a,
    lambda a: a**1.5,
]
BINARY = [
    lambda a, b: a + b,
    lambda a, b: a - b,
    lambda a, b: a * b,
    lambda a, b: a / b,
    lambda a, b: a**b,
    ca.fmin,
    ca.fmax,
    lambda a, b: ca.if_else(a < b, a, b * b),
    lambda a, b: ca.if_else(a <= b, a - 1, 0),
    lambda a, b: ca.if_else(a <= b, 0, a - 1),
]
EXPRESSIONS = st.recursive(
    LEAVES,
    lambda inner: st.one_of(
        st.builds(lambda f, a: f(a), st.sampled_from(UNARY), inner),
        st.builds(lambda f, a, b: f(a, b), st.sampled_from(BINARY), inner, inner),
    ),
    max_leaves=7,
)


@settings(max_examples=150, deadline=None)
@given(EXPRESSIONS, st.tuples(*[st.floats(-4, 4)] * 3))
def test_the_printed_expression_has_the_value_of_the_expression(expression, point):
    assume("nan" not in str(expression))
    values = dict(zip(("x3", "kappa", "t"), point, strict=True))
    expected = evaluate(expression, **values)
    if np.isfinite(expected):
        assert read(to_latex(expression), **values) == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_symbols_are_printed_as_the_paper_writes_them():
    names = {"rho1": r"\rho_{1}", "kappa": r"\kappa", "x3": "x_{3}", "T": "T", "t": "t", "tau": r"\tau"}
    assert {name: symbol_latex(name) for name in names} == names


def test_what_cannot_be_printed_is_refused_by_name():
    with pytest.raises(ParameterError, match="ERF"):
        to_latex(ca.erf(x))
    with pytest.raises(ParameterError, match="nan"):
        to_latex(x + float("nan"))
    with pytest.raises(ParameterError, match="2 x 1"):
        to_latex(ca.vertcat(x, y))


@pytest.mark.parametrize("of", ["gain", "phi", "clock"])
@pytest.mark.parametrize("rho2", ["0.3", 0])
@pytest.mark.parametrize("instant", [0.0, 0.25, 0.59, 0.7])
def test_latex_of_the_gain_is_its_numpy_function(of, rho2, instant):
    gain = Gain("0.6", "0.1", rho2, "1.7")
    expected = {"gain": gain.value, "phi": gain.phi, "clock": gain.clock}[of](instant)
    letters = {"T": 0.6, "rho1": 0.1, "rho2": float(rho2), "kappa": 1.7}
    assert read(gain.latex(of), t=instant) == pytest.approx(expected, rel=1e-12)
    assert read(gain.latex(of, numbers=False), t=instant, **letters) == pytest.approx(expected, rel=1e-12)


def rows_of(text):
    """Split the aligned block into {left side: right side}."""
    body = text.removeprefix("\\begin{aligned}\n").removesuffix("\n\\end{aligned}")
    return dict(row.removesuffix(r" \\").split(" &= ") for row in body.split("\n"))


def signed_graph(seed=0, n=5):
    rng = np.random.default_rng(seed)
    W = rng.integers(-8, 9, (n, n)) * rng.choice([0, 0.1, 1], (n, n))
    np.fill_diagonal(W, 0)
    W[2] = 0  # one agent listens to nobody
    return SignedDigraph.from_matrix(W, orientation="listens")


@pytest.mark.parametrize("instant", [0.1, 0.55, 0.8])
@pytest.mark.parametrize("rho2", ["0.3", 0])
def test_latex_of_a_graph_is_the_input_of_every_agent(instant, rho2):
    graph, protocol = signed_graph(), NominalProtocol("0.6", "0.1", rho2, 2)
    state = np.random.default_rng(1).normal(size=5)
    symbols = ca.SX.sym("x", 5)
    u = ca.Function("u", [symbols, t], [protocol.input(graph, symbols, t)])(state, instant)
    rows = rows_of(protocol.latex(graph))
    gain = read(rows["g"], t=instant)
    values = {f"x{k + 1}": state[k] for k in range(5)}
    printed = [read(rows[f"u_{{{k + 1}}}"], g=gain, **values) for k in range(5)]
    assert printed == pytest.approx(np.array(u).ravel(), rel=1e-12, abs=1e-12)


def test_in_a_formation_every_state_is_less_its_place():
    graph, protocol = signed_graph(), NominalProtocol("0.6", "0.1", "0.3", 2)
    state, h = np.random.default_rng(4).normal(size=(2, 5))
    values = {f"x{k + 1}": state[k] for k in range(5)} | {f"h{k + 1}": h[k] for k in range(5)}
    placed, less = rows_of(protocol.latex(graph, places=True)), rows_of(protocol.latex(graph))
    own = {f"x{k + 1}": state[k] - h[k] for k in range(5)}
    for k in range(5):
        name = f"u_{{{k + 1}}}"
        assert read(placed[name], g=3, **values) == pytest.approx(read(less[name], g=3, **own), rel=1e-12, abs=1e-12)
    general = rows_of(protocol.latex(places=True))["u_{k}"].removeprefix(r"\sum_{l=1}^{N} ")
    assert read(general, g=3, wkl=-2, xl=5, hl=1, xk=4, hk=-3) == 3 * -2 * ((5 - 1) + (4 + 3))


@pytest.mark.parametrize("instant", [0.1, 0.55, 0.8])
def test_the_generic_form_is_the_input_of_every_agent(instant):
    graph, protocol = signed_graph(3), NominalProtocol("0.6", "0.1", "0.3", 2)
    state, W = np.random.default_rng(2).normal(size=5), graph.adjacency().toarray()
    expected = protocol.gain.value(instant) * (-graph.laplacian() @ state)
    rows = rows_of(protocol.latex())
    gain = read(rows["g"], t=instant, T=0.6, rho1=0.1, rho2=0.3, kappa=2)
    summand = rows["u_{k}"].removeprefix(r"\sum_{l=1}^{N} ")
    for k in range(5):
        total = sum(read(summand, g=gain, wkl=W[k, l], xl=state[l], xk=state[k]) for l in range(5))  # noqa: E741
        assert total == pytest.approx(expected[k], rel=1e-12, abs=1e-12)
