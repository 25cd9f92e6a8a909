"""Delays of whole graphs under a capped gain by the delay LMI: longer ones, and no longer than the loop bears."""

from __future__ import annotations

import math
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from asked import certify_words
from late_certificates import grouped_graph

from lmi.exact.decimal_rounding import float_up
from ptcc_certify import read_certificate
from ptcc_certify.bounds.delay.case import LateCase
from ptcc_certify.bounds.delay.delay_lmi import DelayLMIBounds
from ptcc_certify.bounds.delay.longest_delay import bound_case, longest_delay
from ptcc_certify.bounds.delay.small_delays import SmallDelayBounds, delay_threshold
from ptcc_certify.bounds.final_state.of_graph import influence
from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.structure import analyse
from ptcc_certify.model import NominalProtocol
from ptcc_certify.model.late_messages import LateMessages
from ptcc_certify.simulation.late_messages import simulate_late

PROTOCOL, CAP = NominalProtocol(T=1, rho1=1, rho2=3, kappa=1), 20
#: A group of three that leads two followers.
TEAM = SignedDigraph.from_edges([(1, 2, 1), (2, 3, -2), (3, 1, -1), (1, 4, 1), (4, 5, -1), (5, 4, "0.5")])


def bounds(graph: SignedDigraph, delay: object, own: bool, x0: list[Fraction] | None = None) -> DelayLMIBounds:
    structure, messages = analyse(graph), LateMessages(delay, own_delay=own, gain_cap=CAP)
    start = x0 or [Fraction(k) for k in range(graph.n_nodes)]
    return DelayLMIBounds(LateCase(structure, PROTOCOL, messages, start, influence=influence(structure)))


def small_delays(cert: Certificate, probe: LateMessages) -> SmallDelayBounds:
    known = cert.initial_state, None, cert.influence, cert.decaying_forms
    return SmallDelayBounds(LateCase(cert.structure, PROTOCOL, probe, *known))


@pytest.mark.few(0)
@pytest.mark.parametrize("own", [False, True])
def test_delays_of_a_whole_graph_are_certified_that_are_five_times_as_long_as_those_of_its_functions(own: bool) -> None:
    probe = LateMessages("0.001", own_delay=own, gain_cap=CAP)
    cert = certify_words(TEAM, PROTOCOL, [3, 1, 2, -4, 5], messages=probe, simulation=False)
    delay = Fraction(f"{5 * small_delays(cert, probe).longest_delay():.3e}")
    longer = LateMessages(delay, own_delay=own, gain_cap=CAP)
    found = certify_words(TEAM, PROTOCOL, [3, 1, 2, -4, 5], messages=longer, simulation=False)
    assert found.verdict == "certified" and found.checked is not None and found.checked.accepted
    assert found.late is not None and found.late.form is None and found.late.lmi is not None
    assert math.isfinite(found.late.largest) and found.late.input is not None
    assert (found.late.longest_delay or 0) > delay


def test_less_is_left_at_the_deadline_than_by_the_functions_where_both_prove_something() -> None:
    messages = LateMessages("0.0002", own_delay=True, gain_cap=CAP)
    late = certify_words(TEAM, PROTOCOL, [3, 1, 2, -4, 5], messages=messages, simulation=False).late
    assert late is not None and late.form is not None and late.lmi is not None
    assert late.largest == float_up(max(late.lmi.residual))
    assert late.largest < float(max(late.form.residual))


@pytest.mark.few(0)
def test_what_a_certificate_says_of_it_is_read_back(tmp_path: Path) -> None:
    messages = LateMessages("0.002", own_delay=True, gain_cap=CAP)
    cert = certify_words(TEAM, PROTOCOL, [3, 1, 2, -4, 5], messages=messages, simulation=False)
    cert.save(tmp_path / "c.json")
    made, found = cert.late, read_certificate(tmp_path / "c.json").late
    assert made is not None and found is not None and made.lmi is not None and found.lmi is not None
    for name in ("b", "matrix", "tau", "left", "moved", "away", "residual"):
        assert getattr(found.lmi, name) == getattr(made.lmi, name)
    assert found.largest == made.largest


@pytest.mark.few(0)
def test_the_longest_delay_for_a_wanted_residual_is_sought_by_it_too() -> None:
    graph, start = analyse(TEAM), [Fraction(k) for k in (3, 1, 2, -4, 5)]
    cert = certify_words(TEAM, PROTOCOL, start, simulation=False)
    ends = None if cert.final_state is None else cert.final_state.intervals
    messages, parts = LateMessages("0.0001", own_delay=True, gain_cap=CAP), (cert.influence, cert.decaying_forms)
    late = bound_case(LateCase(graph, PROTOCOL, messages, cert.initial_state, ends, *parts))
    longest = longest_delay(late, Fraction(1))
    assert longest is not None and longest.lmi is not None and longest.form is None
    assert longest.largest <= 1


@pytest.mark.few(0)
@pytest.mark.parametrize("seed", range(8))
def test_no_delay_is_forgiven_at_which_a_constant_gain_diverges(seed: int) -> None:
    graph, _ = grouped_graph(np.random.default_rng(seed), 1 + seed % 3)
    longest = bounds(graph, "0.001", True).longest_delay()
    assert 0.05 * delay_threshold(analyse(graph), CAP) < longest < delay_threshold(analyse(graph), CAP)
    assert bounds(graph, Fraction(f"{longest * 0.9:.3e}"), True).best() is not None


def test_leaders_that_rest_are_forgiven_any_delay() -> None:
    star = SignedDigraph.from_edges([(1, 3, 1), (2, 3, -1)])
    assert bounds(star, "0.001", False).longest_delay() == math.inf
    found = bounds(star, 1000, False).best()
    assert found is not None and not any(found[0].moved)
    assert 0 < bounds(star, "0.001", True).longest_delay() < math.inf


def test_of_a_larger_team_the_first_function_is_taken_and_forgives_longer_delays_than_those_of_the_graph() -> None:
    edges = [(k, (k + step) % 23, sign) for k in range(23) for step, sign in ((1, 1), (5, 2), (7, -1))]
    graph, x0 = SignedDigraph.from_edges(edges), [k % 7 - 3 for k in range(23)]
    probe = LateMessages("0.001", gain_cap=CAP)
    cert = certify_words(graph, PROTOCOL, x0, messages=probe, simulation=False, method="paper")
    assert cert.late is not None and cert.late.lmi is not None and cert.verdict == "certified"
    assert (cert.late.longest_delay or 0) > 5 * small_delays(cert, probe).longest_delay()


def test_nothing_is_searched_of_large_graphs() -> None:
    ring = SignedDigraph.from_edges([(k, (k + 1) % 40, 1) for k in range(40)])
    assert bounds(ring, "0.0001", False).best() is None and bounds(ring, "0.0001", False).longest_delay() == 0


def test_what_a_state_at_rest_leaves_is_nothing() -> None:
    pair = SignedDigraph.from_edges([(1, 2, 1), (2, 1, 1)])
    found = bounds(pair, "0.001", True, [Fraction(2), Fraction(2)]).best()
    assert found is not None and not any(found[0].residual)


@pytest.mark.few(0)
def test_small_weights_and_large_ones_scale_as_the_clock_does() -> None:
    edges = [(1, 2, 1), (2, 1, 2), (2, 3, -1)]
    one = bounds(SignedDigraph.from_edges(edges), "0.001", True).longest_delay()
    for factor in (Fraction(1, 10**6), Fraction(10**6)):
        scaled = SignedDigraph.from_edges([(s, t, w * factor) for s, t, w in edges])
        assert bounds(scaled, Fraction(1, 1000) / factor, True).longest_delay() == pytest.approx(
            one / float(factor), rel=0.05
        )


def test_states_and_weights_at_the_ends_of_floats_are_taken_or_left_without_a_traceback() -> None:
    edges = [(1, 2, 1), (2, 1, 2), (2, 3, -1)]
    for factor in (Fraction(10) ** 290, 1 / Fraction(10) ** 290):
        start = [factor * k for k in (1, -2, 3)]
        found = bounds(SignedDigraph.from_edges(edges), "0.001", True, start).best()
        assert found is not None and max(found[0].residual) < factor
    for factor in (Fraction(10) ** 300, 1 / Fraction(10) ** 300):
        graph = SignedDigraph.from_edges([(s, t, w * factor) for s, t, w in edges])
        assert bounds(graph, "0.001", True).best() is None
        assert bounds(graph, "0.001", True).longest_delay() >= 0


def test_delays_of_many_times_the_deadline_are_forgiven_where_few_listen_to_each_other() -> None:
    chain = SignedDigraph.from_edges([(1, 2, 1), (2, 1, 1), (2, 3, 1), (3, 4, 1)])
    late = {(2, 3): Fraction(5), (3, 4): Fraction(5)}
    found = bounds(chain, late, False).best()
    assert found is not None and 0 < found[0].b < 0.02


@pytest.mark.few(0)
def test_deviations_on_the_way_are_bounded_of_leaders_too() -> None:
    messages = LateMessages("0.002", own_delay=True, gain_cap=CAP)
    cert = certify_words(TEAM, PROTOCOL, [3, 1, 2, -4, 5], messages=messages, simulation=False, at="0.5")
    assert cert.late is not None and cert.final_state is not None and cert.initial_state is not None
    t = np.linspace(0, 1, 51)
    bound = cert.late.largest_bound(t)
    assert (np.diff(bound) <= 0).all() and bound[0] < 1e3
    assert bound[-1] == pytest.approx(cert.late.largest, rel=1e-6)
    run = simulate_late(TEAM, PROTOCOL, messages, [float(x) for x in cert.initial_state])
    away = np.abs(run.states - np.asarray(cert.final_state, dtype=float)[:, None]).max(axis=0)
    assert (away <= cert.late.largest_bound(run.t)).all()
