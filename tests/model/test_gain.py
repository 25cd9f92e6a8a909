"""Facts about the gain, its clock, and the decay lemma that rests on them."""

import subprocess
import sys
from fractions import Fraction

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from ptcc_certify.errors import ParameterError
from ptcc_certify.model.gain import Gain, prescribed_time_bound

positive = st.fractions(min_value=Fraction(1, 20), max_value=20, max_denominator=50)
GAINS = st.builds(Gain, positive, positive, positive | st.just(Fraction(0)), positive)
SHARES = st.floats(0, 0.999)


@settings(deadline=None)
@given(GAINS, SHARES | st.floats(1.001, 3))
def test_the_gain_is_the_derivative_of_the_clock(gain, share):
    t, instant = ca.SX.sym("t"), share * float(gain.T)
    clock = gain.clock_expression(t)
    if gain.rho2 and share > 1:
        assert float(ca.Function("s", [t], [clock])(instant)) == np.inf
        return
    slope = float(ca.Function("ds", [t], [ca.jacobian(clock, t)])(instant))
    assert slope == pytest.approx(float(ca.Function("g", [t], [gain.expression(t)])(instant)), rel=1e-9)


@settings(deadline=None)
@given(GAINS, SHARES)
def test_the_logarithmic_derivative_of_phi_is_the_pole(gain, share):
    t, instant = ca.SX.sym("t"), share * float(gain.T)
    phi = gain.phi_expression(t)
    ratio = float(ca.Function("r", [t], [ca.jacobian(phi, t) / phi])(instant))
    assert ratio == pytest.approx(float(gain.kappa) / (float(gain.T) - instant), rel=1e-8)
    assert float(gain.rho1) + float(gain.rho2) * ratio == pytest.approx(float(gain.value(instant)), rel=1e-8)


@pytest.mark.few(0)
@settings(deadline=None)
@given(GAINS, st.lists(SHARES | st.floats(1.001, 3), min_size=1, max_size=5))
def test_numpy_functions_and_expressions_agree(gain, shares):
    t, instants = ca.SX.sym("t"), np.array(shares) * float(gain.T)
    pairs = [
        (gain.value, gain.expression),
        (gain.phi, gain.phi_expression),
        (gain.clock, gain.clock_expression),
    ]
    for function, expression in pairs:
        values = np.array(ca.Function("f", [t], [expression(t)]).map(len(shares))(instants.reshape(1, -1))).ravel()
        np.testing.assert_allclose(function(instants), values, rtol=1e-9, atol=1e-12)


@given(GAINS, SHARES)
def test_the_clock_is_the_same_by_every_variable(gain, share):
    instant = share * float(gain.T)
    tau = gain.tau(instant)
    assert gain.time_at_tau(tau) == pytest.approx(instant, rel=1e-12)
    assert gain.clock_at_tau(tau) == pytest.approx(gain.clock(instant), rel=1e-12)
    assert gain.clock_at_remaining(1 - share) == pytest.approx(gain.clock(instant), rel=1e-10, abs=1e-13)


def test_the_clock_goes_on_where_a_float_time_has_reached_the_deadline():
    gain = Gain(T=2, rho1=3, rho2=5, kappa=7)
    assert gain.clock_at_remaining(1e-200) == pytest.approx(6 + 35 * 200 * np.log(10), rel=1e-15)
    assert gain.value_at_remaining(1e-200) == pytest.approx(3 + 35 / 2e-200)
    assert gain.clock(2) == gain.clock(5) == gain.clock_at_remaining(0) == np.inf


def test_without_rho2_the_gain_is_constant_and_the_clock_runs_on():
    gain = Gain(T=2, rho1=3, rho2=0, kappa=1)
    np.testing.assert_array_equal(gain.value([0, 1, 2, 9]), 3)
    np.testing.assert_array_equal(gain.clock([0, 1, 2, 9]), [0, 3, 6, 27])


def test_only_the_product_of_rho2_and_kappa_enters():
    instants = np.linspace(0, 1, 7)
    np.testing.assert_array_equal(Gain(1, 1, 6, 2).value(instants), Gain(1, 1, 3, 4).value(instants))


@settings(deadline=None, max_examples=50)
@given(st.floats(0.1, 5), st.floats(0.1, 5), st.floats(0.1, 5), st.floats(0.1, 4), st.floats(0, 0.99), st.floats(0, 30))
def test_lemma_6(a, b, T, kappa, share, extra):
    """V' = -(a + b phi'/phi) V attains the bound; a further decay ``extra sin^2`` keeps V below it."""
    t, V0 = share * T, 3.0

    def rate(r):
        return a + b * kappa / (T - r)

    attained = V0 * np.exp(-quad(rate, 0, t, epsabs=1e-12, epsrel=1e-12)[0])
    faster = attained * np.exp(-quad(lambda r: extra * np.sin(9 * r) ** 2, 0, t)[0])
    bound = prescribed_time_bound(V0, a, b, t, T, kappa)
    assert bound == pytest.approx(attained, rel=1e-8)
    assert faster <= bound * (1 + 1e-8)


def test_the_bound_of_lemma_6_falls_to_zero_at_the_deadline_and_stays():
    bound = prescribed_time_bound(7.0, 0.2, 0.1, [0, 0.5, 1 - 1e-15, 1, 4], T=1, kappa="0.5")
    assert bound[0] == 7
    assert (np.diff(bound) <= 0).all()
    assert bound[2] > 0
    assert (bound[3:] == 0).all()


@pytest.mark.parametrize("name", ["T", "rho1", "rho2", "kappa"])
@pytest.mark.parametrize("value", [-1, "nan", float("nan"), float("inf"), "abc", None, True, "1e-350", 10**400, -1e-9])
def test_a_bad_parameter_is_named(name, value):
    good = {"T": 1, "rho1": 1, "rho2": 1, "kappa": 1}
    with pytest.raises(ParameterError, match=rf"^{name} (=|is)") as caught:
        Gain(**(good | {name: value}))
    assert "\n" not in str(caught.value)


def test_zero_is_refused_except_for_rho2():
    for name in ("T", "rho1", "kappa"):
        with pytest.raises(ParameterError, match=f"{name} = 0 .*> 0"):
            Gain(**({"T": 1, "rho1": 1, "rho2": 1, "kappa": 1} | {name: 0}))
    assert Gain(1, 1, 0, 1).rho2 == 0
    with pytest.raises(ParameterError, match="rho2 kappa"):
        Gain(1, 1, "1e-200", "1e-200")


def test_parameters_are_exact_and_frozen():
    gain = Gain("0.6", 0.5, Fraction(1, 3), 1)
    assert (gain.T, gain.rho1, gain.rho2, gain.kappa) == (Fraction(3, 5), Fraction(1, 2), Fraction(1, 3), 1)
    assert gain == Gain(Fraction(3, 5), "1/2", "1/3", "1.0")
    with pytest.raises(AttributeError):
        gain.T = 1


def test_importing_the_modules_loads_neither_casadi_nor_scipy():
    code = (
        "import sys, ptcc_certify.model.gain, ptcc_certify.model.base, ptcc_certify.simulation.run;"
        "import ptcc_certify.model.casadi_latex;"
        "sys.exit(bool({'casadi', 'scipy', 'networkx', 'matplotlib'} & set(sys.modules)))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
