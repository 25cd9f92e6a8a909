"""Facts about disturbances: the grammar of their expressions, the bound on a horizon, samples, and the worst case."""

import itertools
import math
import re
import warnings
from fractions import Fraction

import casadi as ca
import flint
import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from ptcc_certify.errors import ParameterError
from ptcc_certify.model.disturbance import (
    Disturbance,
    ExpressionDisturbance,
    SampledDisturbance,
    StateDependent,
    WorstCaseDisturbance,
    as_disturbance,
    telegraph_noise,
)
from ptcc_certify.model.expression import enclosure, parse

ONE = Fraction(1)
LABELS = ["a", "b", "c"]


def value(text, t=0.0, agent=0):
    return ExpressionDisturbance(text).values([t], [agent], [0])[0, 0]


# ---------------------------------------------------------------------- the grammar


class Tree:
    """An expression under construction: its text, how tightly it binds, and its value by Python's arithmetic."""

    def __init__(self, text, binding, compute):
        self.text, self.binding, self.compute = text, binding, compute

    def within(self, needed):
        return self.text if self.binding >= needed else f"({self.text})"


SUM, PRODUCT, SIGN, POWER, ATOM = range(1, 6)
EXPONENTS = [("2", 2.0), ("3", 3.0), ("-1", -1.0), ("+-+2", -2.0), ("--1", 1.0), ("0", 0.0), ("2**2", 4.0)]
DYADIC = ["0.5", "1", "2", "3.", ".25", "1e1", "25E-2"]
LEAVES = st.one_of(
    st.sampled_from(DYADIC).map(lambda text: Tree(text, ATOM, lambda k, t: float(text))),
    st.just(Tree("k", ATOM, lambda k, t: k)),
    st.just(Tree("t", ATOM, lambda k, t: t)),
    st.just(Tree("pi", ATOM, lambda k, t: math.pi)),
)


def _binary(operands, operation):
    a, b = operands
    text, binding, left, right, compute = {
        "+": ("+", SUM, SUM, PRODUCT, lambda x, y: x + y),
        "-": (" - ", SUM, SUM, PRODUCT, lambda x, y: x - y),
        "*": ("*", PRODUCT, PRODUCT, SIGN, lambda x, y: x * y),
        "/": ("/ ", PRODUCT, PRODUCT, SIGN, lambda x, y: x / y),
    }[operation]
    return Tree(
        f"{a.within(left)}{text}{b.within(right)}", binding, lambda k, t: compute(a.compute(k, t), b.compute(k, t))
    )


def _raised(a, exponent):
    text, number = exponent
    return Tree(f"{a.within(ATOM)}**{text}", POWER, lambda k, t: a.compute(k, t) ** number)


def _negated(a):
    return Tree(f"-{a.within(SIGN)}", SIGN, lambda k, t: -a.compute(k, t))


def _called(operands, name):
    function = {"min": min, "max": max, "abs": lambda x, *_: abs(x)}[name]
    operands = operands[:1] if name == "abs" else operands
    text = f"{name}({', '.join(a.text for a in operands)})"
    return Tree(text, ATOM, lambda k, t: function(*(a.compute(k, t) for a in operands)))


ARITHMETIC = st.recursive(
    LEAVES,
    lambda trees: st.one_of(
        st.builds(_binary, st.tuples(trees, trees), st.sampled_from("+-*/")),
        st.builds(_raised, trees, st.sampled_from(EXPONENTS)),
        st.builds(_negated, trees),
        st.builds(_called, st.lists(trees, min_size=2, max_size=4), st.sampled_from(["min", "max", "abs"])),
    ),
    max_leaves=12,
)


@settings(deadline=None, max_examples=100)
@given(ARITHMETIC, st.integers(0, 4), st.sampled_from([0.0, 0.5, 1.25, -3.0, 7.0]))
def test_the_grammar_is_that_of_python(tree, agent, t):
    assume(len(tree.text) <= 1000)
    try:
        expected = tree.compute(agent + 1.0, t)
    except (ZeroDivisionError, OverflowError):
        expected = math.nan
    assume(abs(expected) < 1e6)
    assert value(tree.text, t, agent) == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_operators_bind_as_in_python():
    table = [
        ("-t**2", -9.0),
        ("(-t)**2", 9.0),
        ("2**-1", 0.5),
        ("2**3**2", 512.0),
        ("2**-1**2", 0.5),
        ("2**-2*3", 0.75),
        ("-2*-t", 6.0),
        ("7-2-1", 4.0),
        ("8/4/2", 1.0),
        ("8/4*2", 4.0),
        ("1 - -+--1", 2.0),
        ("2*3+4*5", 26.0),
        ("max(1, t, min(4, 5))", 4.0),
        ("sin(pi/2)**2 + log(e)", 2.0),
        ("sign(-t) + sign(0) + abs(-2)", 1.0),
        ("-" * 901 + "t", -3.0),
        ("(" * 50 + "t" + ")" * 50, 3.0),
        (" 1.5e1\t+ .5 ", 15.5),
    ]
    for text, expected in table:
        assert value(text, 3.0) == pytest.approx(expected, rel=1e-14), text


NONSENSE = {
    "": "column 1: the expression ends too early",
    "  ": "ends too early",
    "__import__('os')": 'column 12: "\'" has no meaning',
    "__import__(k)": 'column 1: "__import__" is no function; the names are k, t, pi, e and the functions sin',
    "t.real": 'column 1: "t.real" has no meaning',
    "pi.__class__": "has no meaning",
    "sin.real(t)": "has no meaning",
    '"a"': "column 1",
    "foo*t": 'unknown name "foo"; the names are k, t, pi, e',
    "2 + sin(foo)": 'column 9: unknown name "foo"',
    "t^2": r"column 2: .* write a power as \*\*",
    "sin t": r"column 5: .* sin\(...\) for a function",
    "sin": r'column 1: "\(" is missing after sin; write sin\(...\)',
    "sin*t": r'column 1: "\(" is missing after sin',
    "sin()": "column 1: sin takes one argument",
    "()": "only min and max take a comma",
    "max(1)": "column 1: max takes two or more arguments",
    "max(1,)": "max takes two or more arguments",
    "sin(1, 2)": "sin takes one argument",
    "max(*t)": "max takes two or more arguments",
    "max(1, *t)": r'column 8: "\*t" has no meaning',
    "max(1, **t)": "has no meaning",
    "(1, 2)": "only min and max take a comma",
    "1, 2": "only min and max take a comma",
    "1 2": "column 3: .* write \\* for a product",
    "t t": "column 3: .* write \\* for a product",
    "2t": "column 2: an operator is missing",
    "t(1)": 'column 1: "t" is no function',
    "2(t)": "has no meaning",
    "sin(t)(t)": "has no meaning",
    "1e": "column 2: an operator is missing",
    "1.2.3": "column 4",
    "1..": "column",
    "...": "column 1",
    "1_000": "column 2: an operator is missing",
    "0x10": "column 2: an operator is missing",
    "1j": "column 2: an operator is missing",
    "1or t": "column 2: an operator is missing",
    "t sin(t)": "column 3",
    "(1": 'column 1: this "\\(" is never closed',
    "1)": "column 2",
    "1 +": "column 4: the expression ends too early",
    "\t\n 1 + foo": 'column 8: unknown name "foo"',
    "* 2": "column 1",
    "2 */ 3": "column 4",
    "2 // 3": "has no meaning",
    "t = 1": 'column 3: "=" has no meaning',
    "t if t else 1": "has no meaning",
    "t and k": "has no meaning",
    "not t": "has no meaning",
    "(yield)": "has no meaning",
    "await t": "column",
    "lambda: 1": 'column 7: ":" has no meaning',
    "True": "has no meaning",
    "None": "has no meaning",
    "nan": "unknown name",
    "1e999": "beyond the range of floats",
    "9" * 400: "beyond the range of floats",
    "²": "has no meaning",
    "t*٣": "column 3",
    "ｔ": "has no meaning",
    "π": "has no meaning",
    "t\0": 'column 2: "\\?" has no meaning',
    "t;t": "has no meaning",
    "t # k": "has no meaning",
    "(" * 60 + "1" + ")" * 60: "column 51: nested deeper than 50 levels",
    "sin(" * 60 + "1" + ")" * 60: "nested deeper than 50 levels",
    "2**" * 330 + "2": "nested deeper than 50 levels",
    "2**" * 400 + "2": "1201 characters is too long; the limit is 1000",
    "(" * 10**5: "too long",
    "-" * 10**5 + "t": "too long",
}


@pytest.mark.parametrize("text", NONSENSE)
def test_nonsense_is_refused_in_one_line(text):
    with warnings.catch_warnings(), pytest.raises(ParameterError, match=NONSENSE[text]) as caught:
        warnings.simplefilter("error")
        ExpressionDisturbance(text)
    assert str(caught.value).isprintable() and len(str(caught.value)) < 300


@settings(deadline=None)
@given(st.text("kt0159.e+-*/(), sinmaxpi^'", max_size=60) | st.text(max_size=30))
@example("-" * 999)
@example("(-" * 499)
@example("**" * 400)
def test_any_text_is_read_or_refused(text):
    try:
        d = ExpressionDisturbance(text)
    except ParameterError as refusal:
        assert "\n" not in str(refusal)
    else:
        assert d.values([0.0, 1.0], [0, 1], [1, 1]).shape == (2, 2)


def test_other_types_are_refused():
    for nonsense in ([], ["t", 1], [None]):
        with pytest.raises(ParameterError, match="one text for each agent"):
            ExpressionDisturbance(nonsense)


def test_evaluation_never_warns_and_may_be_infinite():
    with np.errstate(all="raise"):
        values = ExpressionDisturbance("1/t + log(t - 1) + 9**9**9 + sqrt(-t)").values([0.0, 1.0], [0], [1])
    assert not np.isfinite(values).any()


# ---------------------------------------------------------------------- CasADi and intervals

UNARY = ["sin", "cos", "tan", "atan", "tanh", "exp", "log", "sqrt", "abs", "sign", "-", "+"]
CONSTANTS = ["0", "1", "2", "0.3", "k", "t", "t", "t", "pi", "e", "1e3"]


def _joined(a, operation, b):
    return f"{operation}({a}, {b})" if operation in ("min", "max") else f"({a}){operation}({b})"


TEXTS = st.recursive(
    st.sampled_from(CONSTANTS),
    lambda texts: st.one_of(
        st.builds(_joined, texts, st.sampled_from(["+", "-", "*", "/", "**", "min", "max"]), texts),
        st.builds(lambda name, a: f"{name}({a})", st.sampled_from(UNARY), texts),
        st.builds(lambda a, n: f"({a})**{n}", texts, st.sampled_from(["2", "3", "-1", "-2", "0", "0.5"])),
    ),
    max_leaves=7,
)


@settings(deadline=None, max_examples=60)
@given(TEXTS, st.integers(0, 3), st.floats(0.1, 3), st.sampled_from([ca.SX, ca.MX]))
def test_casadi_and_numpy_agree(text, agent, instant, symbols):
    assume(text.count("(") < 40)
    d, t = ExpressionDisturbance(text), symbols.sym("t")
    expression = d.casadi(t, agent)
    assert isinstance(expression, symbols)
    expected = d.values([instant], [agent], [1])[0, 0]
    near = d.values(instant * (1 + np.array([-1e-13, 1e-13])), [agent], [1])
    assume(np.isfinite(expected) and np.ptp(near) < 1e-8 * (1 + abs(expected)))  # neither a jump nor a pole
    computed = float(ca.Function("d", [t], [expression])(instant))
    assert computed == pytest.approx(expected, rel=1e-6, abs=1e-6) or "sign" in text or "min" in text or "max" in text


def real(text, agent, t):
    """Compute an expression by Python's own evaluation of its text, over thin balls of 300 bits."""
    names = {name: getattr(flint.arb, name) for name in ("sin", "cos", "tan", "atan", "tanh", "exp", "log", "sqrt")}
    names |= {"min": flint.arb.min, "max": flint.arb.max, "sign": flint.arb.sgn, "abs": abs, "ball": flint.arb}
    names |= {"k": flint.arb(agent + 1), "t": flint.arb(t), "pi": flint.arb.pi(), "e": flint.arb.const_e()}
    exact = re.sub(r"(?<![\w.])([0-9.]+(?:e-?[0-9]+)?)", r"ball(\1)", text)
    return eval(exact, {"__builtins__": {}}, names)  # noqa: S307


@settings(deadline=None, max_examples=150)
@given(TEXTS, st.integers(0, 3), st.floats(0, 10), st.floats(0, 1) | st.floats(0, 1e-9) | st.floats(0, 30))
@example("sin(1e3*t)", 0, 0.0, 1e-3)
@example("(t-1)**2", 0, 0.5, 1.0)
@example("tan(t)", 0, 1.5, 0.1)
@example("1/(t-1)", 0, 0.5, 1.0)
@example("(t-1)**(1+k)", 0, 0.5, 1.0)
@example("exp(1e3*t)", 0, 0.0, 1.0)
@example("sign(t*1e-300*1e-300 - t)", 0, 0.0, 1.0)
@example("tanh(log(t-1))", 0, 0.5, 1.0)
@example("sin(t**-2)", 0, 2.3e-308, 0.0)
@example("sin(sin(t)*1e22)", 0, 0.0, 1e-20)
def test_enclosures_hold_every_value(text, agent, start, width):
    """The values are those of real arithmetic, to 300 bits: they are above the lower end, and below the upper."""
    assume(text.count("(") < 40)
    instants = np.linspace(start, start + width, 101)
    ends = enclosure(parse(text), agent + 1, instants[0], instants[-1])
    if ends is None:
        return
    with flint.ctx.workprec(300):
        for instant in instants:
            value = real(text, agent, instant)
            assert value.is_finite() and not value < ends[0].lower() and not value > ends[1].upper()


@pytest.mark.parametrize(
    ("text", "low", "high"),
    [
        ("t**2 - 1", -1, 3),
        ("(t - 1)**2", 0, 1),
        ("sin(t)", 0, 1),
        ("cos(10*t)", -1, 1),
        ("exp(-t)", math.exp(-2), 1),
        ("abs(t - 1)", 0, 1),
        ("(t - 1)**3", -1, 1),
        ("(t + 1)**-2", 1 / 9, 1),
        ("sqrt(2 - t)", 0, math.sqrt(2)),
        ("min(t, 1, 0.5)", 0, 0.5),
        ("sign(t - 1)", -1, 1),
        ("atan(t)", 0, math.atan(2)),
    ],
)
def test_enclosures_are_tight(text, low, high):
    assert [float(end) for end in enclosure(parse(text), 1, 0.0, 2.0)] == pytest.approx([low, high], abs=1e-13)


@pytest.mark.parametrize("text", ["1/(t-1)", "log(t)", "sqrt(t-1)", "tan(t)", "(t-1)**0.5", "(t-1)**-1", "t**-t"])
def test_undefined_operations_stay_undefined(text):
    for around in (text, f"atan({text})", f"0*({text})", f"min(1, {text})", f"({text})**0"):
        assert enclosure(parse(around), 1, 0.0, 2.0) is None


@pytest.mark.parametrize(
    "text", ["atan(exp(1e3*t))", "1e300*1e300/1e300", "atan(9**9**9)", "1e-300*t/1e300 + 1e200**2"]
)
def test_what_a_float_run_cannot_compute_is_not_called_bounded(text):
    assert enclosure(parse(text), 1, 0.0, 2.0) is None


def test_a_breach_within_the_rounding_of_floats_is_seen():
    """Balls know the sign of what cancels to nothing in floats, or is a rounding error of theirs."""
    low, high = enclosure(parse("(t + 1e-30) - t"), 1, 0.0, 0.0)
    assert low > 0 and high < 2e-30
    low, high = enclosure(parse("sin(pi)"), 1, 0.0, 1.0)
    assert low.contains(0) and high.contains(0)


# ---------------------------------------------------------------------- the bound


@pytest.mark.parametrize(
    ("text", "delta", "until"),
    [
        ("sin(2*k*t + pi/3)", 1, 5),
        ("0.5*sin(t) + 0.5", 1, 5),
        ("0.1", Fraction(1, 10), 5),
        ("0", 0, 5),
        ("k*t*exp(-k*t)", Fraction(1, 2), 3),
        ("0.1*sign(sin(20*t))", Fraction(1, 10), 3),
        ("sqrt(1 - t)", 1, 1),
        ("(t - 0.5)**(1 + 1)", 1, 1),
        ("tan(t)", 2, 1),
        ("sin(t) + cos(t)", Fraction("1.4143"), 3),
    ],
)
def test_intervals_establish_the_bound(text, delta, until):
    assert ExpressionDisturbance(text).check(Fraction(delta), LABELS, until) == "interval arithmetic"


@pytest.mark.few(1)
@pytest.mark.parametrize("text", ["sin(k*t)**2 + cos(k*t)**2", "sin(t)**2 + cos(t)**2"])
def test_samples_do_where_intervals_cannot(text: str):
    assert ExpressionDisturbance(text).check(ONE, LABELS, 3.0) == "sampling at 20,000 instants"


@pytest.mark.few(0)
def test_agents_that_intervals_cannot_decide_leave_the_others_bounded():
    stubborn = ["sin(t)**2 + cos(t)**2" + " + 0" * i for i in range(8)]
    last = "0.1*sqrt(sin(9*t)**2 - 2*sin(9*t) + 1.01)"  # needs bisection to be defined at all
    d, labels = ExpressionDisturbance([*stubborn, last]), [str(i) for i in range(9)]
    assert d.check(ONE, labels, 9.0) == "sampling at 20,000 instants"


@pytest.mark.parametrize(
    ("text", "until", "message"),
    [
        ("2*sin(t)", 1, r"of agent a at t = 1 is 1\.68294.*, beyond delta = 1\.0"),
        ("k*sin(t)", 2, r"of agent c at t = 1\.57.* is 2\.999.*, beyond delta"),
        ("1 + 1e-11", 1, r"at t = 0 is 1\.00000000001"),
        ("t/2 + 0.50001*sign(t-1.999)", 2, r"agent a at t = 2 is 1\.5"),
        ("1.1*exp(-((t-0.5001)*1e5)**2)", 1, r"agent a at t = 0\.500.* is 1\.0"),
        ("1/t", 1, "agent a at t = 0 is inf, not finite"),
        ("1/0", 1, "not finite"),
        ("log(t)", 1, "not finite"),
        ("0.1/(t-0.3)", 1, r"t = 0\.3.* beyond delta"),
        ("9**9**9**9", 1, "not finite"),
        ("sin(t)/t", 1, "nan, not finite"),
        ("atan(1/(t-0.3001))/2", 1, r"no bound can be given near agent a, t = 0\.3001"),
        ("sqrt((t-0.5)*(t-0.5000001))", 1, "nan, not finite"),
    ],
)
def test_breaches_are_refused_with_agent_time_and_value(text, until, message):
    with pytest.raises(ParameterError, match=message) as caught:
        ExpressionDisturbance(text).check(ONE, LABELS, until)
    assert "\n" not in str(caught.value)


def test_expressions_of_each_agent():
    d = ExpressionDisturbance(["t", "-t", "k"])
    np.testing.assert_array_equal(d.values([0.5, 1.0], [2, 0, 1], [0, 0, 0]), [[3, 3], [0.5, 1], [-0.5, -1]])
    assert d.text == "t; -t; k" and d.linear(0, 1, [0], [0]) is None and d.breaks(1.0).size == 0
    assert d.check(Fraction(3), LABELS, 3.0) == "interval arithmetic"
    with pytest.raises(ParameterError, match=r"of agent c at t = 0 is 3\.0"):
        d.check(ONE, LABELS, 1.0)
    with pytest.raises(ParameterError, match="3 expressions for 2 agents"):
        d.check(ONE, LABELS[:2], 1.0)
    assert float(ca.DM(d.casadi(ca.SX.sym("t"), 2))) == 3


def test_many_agents_are_checked_in_pieces():
    labels = [str(i) for i in range(1, 301)]
    assert ExpressionDisturbance("sin(k*t)").check(ONE, labels, 1.0) == "interval arithmetic"
    with pytest.raises(ParameterError, match="agent 201 at"):
        ExpressionDisturbance("max(0, 2 - 10*abs(k - 201))").check(ONE, labels, 1.0)


def test_latex_shows_the_expression():
    d = ExpressionDisturbance("0.2*sin(2*k*t) + e**-t")
    assert d.latex() == r"0.2 \sin\left(2 k t\right) + e^{-t}"
    assert ExpressionDisturbance(["t", "k"]).latex(1) == "k"
    with pytest.raises(ParameterError, match="too long to be printed"):
        ExpressionDisturbance("sin(t)" + "+k+t" * 248).latex()


# ---------------------------------------------------------------------- samples


@settings(deadline=None)
@given(st.lists(st.tuples(st.floats(0.01, 2), st.floats(-5, 5), st.floats(-5, 5)), min_size=1, max_size=8))
def test_samples_are_interpolated_or_held(rows):
    times = np.cumsum([row[0] for row in rows])
    values = np.array([row[1:] for row in rows]).T
    t = np.linspace(0, times[-1] + 1, 57)
    linear, held = SampledDisturbance(times, values), SampledDisturbance(times, values, hold=True)
    for agent in (0, 1):
        np.testing.assert_allclose(
            linear.values(t, [agent], [1])[0], np.interp(t, times, values[agent]), rtol=1e-12, atol=1e-12
        )
        expected = [values[agent][max(sum(times <= instant) - 1, 0)] for instant in t]
        np.testing.assert_array_equal(held.values(t, [agent], [1])[0], expected)
    edges = [0.0, *linear.breaks(t[-1]), t[-1]]
    for t0, t1 in itertools.pairwise(edges):
        inside = t0 + (t1 - t0) * np.array([0.1, 0.5, 0.9])
        for d in (linear, held):
            a, b = d.linear(t0, t1, [1, 0], [0, 0])
            np.testing.assert_allclose(a[:, None] + np.outer(b, inside), d.values(inside, [1, 0], [0, 0]), atol=1e-9)


def test_the_bound_of_samples_concerns_the_horizon_only():
    d = SampledDisturbance([0, 1, 2, 3], [[0, 1, 0, 8], [0, 0, 4, 0]])
    assert d.check(ONE, LABELS[:2], 1.25) == "exact at the samples"
    with pytest.raises(ParameterError, match=r"4 samples, linear between\) of agent b at t = 1.5 is 2.0, beyond delta"):
        d.check(ONE, LABELS[:2], 1.5)
    with pytest.raises(ParameterError, match=r"of agent a at t = 3 is 8\.0"):
        d.check(ONE, LABELS[:2], 9.0)
    with pytest.raises(ParameterError, match="2 signals for 3 agents"):
        d.check(ONE, LABELS, 1.0)
    common = SampledDisturbance([1], [1])
    assert common.check(ONE, LABELS, 2.0) == "exact at the samples" and common.values([0], [2], [0]) == 1


@pytest.mark.parametrize(
    ("times", "values", "message"),
    [
        ([0, 1], [1], r"times \(2,\) and values \(1,\)"),
        ([], [], "times"),
        ([[0]], [[1]], "times"),
        (0, 1, "times"),
        ([0, 1], [[[1, 2]]], "times"),
        ([0, 0], [1, 1], "ascending"),
        ([-1, 0], [1, 1], "not negative"),
        ([0, np.inf], [1, 1], "finite"),
        ([0, 1], [[1, 1], [1, np.nan]], "sample 2 of signal 2 is nan"),
        (["a"], [1], "arrays of numbers"),
        ([0, 1], [[1], [1, 2]], "arrays of numbers"),
        ([0], [1j], "arrays of numbers"),
    ],
)
def test_samples_out_of_shape_are_refused(times, values, message):
    with pytest.raises(ParameterError, match=message):
        SampledDisturbance(times, values)


def test_telegraph_signals_switch_at_their_rate():
    noise = telegraph_noise(0.3, rate=5, n=20, until=100.0, seed=4)
    assert (np.abs(noise.samples) == 0.3).all() and noise.hold and noise.times[0] == 0
    switches = (np.diff(noise.samples, axis=1) != 0).sum(axis=1)
    assert abs(switches.mean() - 500) < 5 * math.sqrt(500 / 20) and switches.std() == pytest.approx(22, rel=0.6)
    assert abs(noise.samples.mean()) < 0.1
    assert (np.diff(noise.samples, axis=1) != 0).sum(axis=0).max() == 1  # no two agents switch together
    again, other = (telegraph_noise(0.3, 5, 20, 100.0, seed) for seed in (4, 5))
    np.testing.assert_array_equal(noise.samples, again.samples)
    assert noise.times.shape != other.times.shape or (noise.times != other.times).any()
    assert noise.check(Fraction(3, 10), [str(i) for i in range(20)], 100.0) == "exact at the samples"
    assert telegraph_noise(1, 0, 3, 1.0).times.size == 1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((1, 1e9, 1, 1.0), "too many"),
        ((1, 20, 10**4, 1.0), "too many"),
        ((-1, 1, 1, 1.0), "amplitude"),
        ((1, -1, 1, 1.0), "rate"),
        ((1, 1, 0, 1.0), "n = 0"),
        ((1, 1, 1, 0.0), "until"),
        ((1, 1, 1, 1.0, -1), "seed"),
        ((math.nan, 1, 1, 1.0), "amplitude is nan"),
        ((1, math.inf, 1, 1.0), "rate is inf"),
    ],
)
def test_absurd_telegraph_signals_are_refused(arguments, message):
    with pytest.raises(ParameterError, match=message):
        telegraph_noise(*arguments)


# ---------------------------------------------------------------------- worst case and state


def test_the_worst_case_pushes_away_from_sliding():
    worst_case = WorstCaseDisturbance("0.25")
    np.testing.assert_array_equal(worst_case.values([0, 1], [0, 1, 2], [1, 0, -1]), [[0.25] * 2, [0] * 2, [-0.25] * 2])
    a, b = worst_case.linear(0, 1, [0, 1, 2], [1, 0, -1])
    np.testing.assert_array_equal([a, b], [[0.25, 0, -0.25], [0, 0, 0]])
    assert worst_case.check(Fraction(1, 4), LABELS, 1.0) == "by definition" and worst_case.breaks(1.0).size == 0
    with pytest.raises(ParameterError, match=r"= 0\.25 of agent a from t = 0 on is beyond delta = 0\.2;"):
        worst_case.check(Fraction(1, 5), LABELS, 1.0)
    for nonsense in (-1, "x", math.nan, None):
        with pytest.raises(ParameterError, match=r"delta|number"):
            WorstCaseDisturbance(nonsense)


def test_state_dependent_disturbances_are_checked_at_each_evaluation():
    x, sigma = np.array([0.0, 1.0, 2.0]), np.array([1.0, 0.0, -1.0])
    d = StateDependent(lambda t, x, sigma: t * np.sign(sigma))
    assert d.text == "state-dependent (Python)" and d.linear(0, 1, [0], [0]) is None
    np.testing.assert_array_equal(d.at(0.5, x, sigma, ONE, LABELS), [0.5, 0, -0.5])
    np.testing.assert_array_equal(StateDependent(lambda t, x, s: 1).at(0, x, sigma, ONE, LABELS), [1, 1, 1])
    assert d.check(ONE, LABELS, 1.0) == "at every evaluation of the run"
    with pytest.raises(ParameterError, match="has no values without it"):
        d.values([0], [0], [0])
    for result, message in [
        (np.zeros(2), r"at t = 0\.5: the shape is \(2,\); return a number or shape \(3,\)"),
        (np.zeros((3, 1)), r"the shape is \(3, 1\)"),
        (None, "None is no array of numbers|nan"),
        ("text", "no array of numbers"),
        (np.array([0, np.nan, 0]), r"of agent b at t = 0\.5 is nan, not finite"),
        (np.array([0, 0, -1.5]), r"of agent c at t = 0\.5 is -1\.5, beyond delta = 1\.0"),
    ]:
        with pytest.raises(ParameterError, match=message):
            StateDependent(lambda t, x, sigma, result=result: result).at(0.5, x, sigma, ONE, LABELS)


# ---------------------------------------------------------------------- from anything


def test_disturbances_are_made_of_what_is_at_hand():
    def made(value, n=2):
        return as_disturbance(value, n, "0.1", 4.0, seed=3)

    own = WorstCaseDisturbance(1)
    assert made(own) is own
    assert isinstance(made("worst-case"), WorstCaseDisturbance) and made(" worst-case ").delta == Fraction(1, 10)
    assert made("none").text == "none" and not made("none").values([0, 1], [0, 1], [1, 1]).any()
    assert made("0.1*sin(t)").text == "0.1*sin(t)" and made(["t", "k"]).texts == ("t", "k")
    assert made(Fraction(1, 20)).text == "constant 0.05" and made(np.float64(0.05)).values([1], [1], [1]) == 0.05
    for levels in ([0.1, Fraction(-1, 10)], (0.1, -0.1), np.array([0.1, -0.1])):
        np.testing.assert_array_equal(made(levels).values([0, 3], [0, 1], [1, 1]), [[0.1, 0.1], [-0.1, -0.1]])
        assert made(levels).check(Fraction(1, 10), LABELS[:2], 4.0) == "exact at the samples"
    telegraph = made("telegraph")
    assert telegraph.text == "random telegraph signals, +-0.1, rate 5, seed 3" and len(telegraph.samples) == 2
    assert isinstance(made(lambda t, x, sigma: 0), StateDependent)
    assert all(isinstance(made(value), Disturbance) for value in ("t", 0, [0, 0], "none"))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (None, "the disturbance is None, not a number"),
        (True, "the disturbance is True"),
        (math.inf, "not a finite number"),
        (10**400, "beyond the range"),
        ([0.1], "1 disturbances for 2 agents"),
        (["t"] * 3, "3 disturbances for 2 agents"),
        (["t", 1], "texts and numbers are mixed"),
        ([0, None], "disturbance of agent 2 is None"),
        ([], "0 disturbances for 2 agents"),
        ({"a": 1}, "not a number"),
        ("adversarial", "unknown name"),
        (b"t", "not a number"),
        (np.zeros((2, 2)), "not a number"),
    ],
)
def test_anything_else_is_refused(given, message):
    with pytest.raises(ParameterError, match=message) as caught:
        as_disturbance(given, 2, "0.1", 1.0)
    assert "\n" not in str(caught.value)


def test_a_horizon_that_is_none_is_refused():
    for until in (0.0, -1.0, math.nan):
        with pytest.raises(ParameterError, match="until"):
            as_disturbance("telegraph", 2, "0.1", until)
