"""Lyapunov functions and upper bounds of rates for families of graphs, compared with members drawn at random."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from asked import certify_family
from common_kernel_families import KINDS, random_family
from scipy.linalg import expm
from selection import thinned

import lmi
import lmi.common_lyapunov
from ptcc_certify import NominalProtocol
from ptcc_certify.errors import HypothesisError
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Family
from ptcc_certify.lyapunov import common_form_search
from ptcc_certify.lyapunov.common_form_search import (
    Aim,
    aimed_functions,
    common_left_vector,
    search_common_forms,
    undirected_function,
)
from ptcc_certify.lyapunov.common_forms import CommonForm, Quotient, decay_matrices, prove_mode
from ptcc_certify.lyapunov.slow_signals import (
    SignalRateBound,
    prove_candidate,
    prove_signal_rate_bound,
    prove_word,
    rate_bounds,
)
from ptcc_certify.theorems.family_behaviour import decide

TENTH = Fraction(1, 10)


def members(rng, quotient, count):
    """Yield mode, Laplacian (exact) and levels of random members."""
    for _ in range(count):
        number = int(rng.integers(len(quotient.family.modes)))
        mode = quotient.family.modes[number]
        largest = np.zeros(mode.n_edges, dtype=bool)
        for e in mode.parameters.tolist():
            ends = (mode.source == mode.source[e]) & (mode.target == mode.target[e])
            back = (mode.source == mode.target[e]) & (mode.target == mode.source[e]) & (mode.sign == mode.sign[e])
            if rng.random() < 0.5 and not (largest & ends).any():
                largest[e] = True
                largest[back] |= mode.tied
        largest[mode.known] = False
        levels = [Fraction(int(largest[part.edge])) for part in quotient.modes[number].parts]
        yield number, mode.member(largest).exact_laplacian(), levels


def floats(rows):
    return np.array([[float(x) for x in row] for row in rows])


def unsure_pair():
    """A stable family with a weight of unknown sign."""
    return Family.from_intervals([(1, 2, 1, 2), (2, 1, -3, -2), (2, 3, 1, 1), (3, 4, 2, 3), (1, 4, -1, "1/2")])


@pytest.fixture(scope="module", params=thinned([*KINDS, "unknown sign"], 2))
def certified(request):
    """A quotient, its functions and its bound."""
    if request.param == "unknown sign":
        family = unsure_pair()
    else:
        rng = np.random.default_rng(KINDS.index(request.param))
        family = random_family(rng, request.param, 4, 2, TENTH, 0.3)
    quotient = Quotient.of(decide(family)[0])
    functions = search_common_forms(quotient).functions
    return quotient, functions, prove_signal_rate_bound(quotient, functions)


# ---------------------------------------------------------------------- the quotient


#: But for stability of one agent: who hears nobody keeps its state.
SIZES = [(kind, n) for kind in KINDS for n in (1, 2, 3, 6, 8) if (kind, n) != ("stability", 1)]


@pytest.mark.parametrize(("kind", "n"), SIZES)
def test_the_quotient_of_every_member_is_that_of_its_laplacian(kind, n):
    rng = np.random.default_rng(n)
    quotient = Quotient(random_family(rng, kind, n, int(rng.integers(1, 5)), Fraction(3, 10), 0.4))
    for number, L, levels in members(rng, quotient, 8):
        x = [Fraction(int(v)) for v in rng.integers(-9, 10, n)]
        change = [sum((w * y for w, y in zip(row, x, strict=True)), Fraction(0)) for row in L]
        xi = quotient.coordinates(x)
        A = quotient.modes[number].member(levels)
        assert quotient.coordinates(change) == [
            sum((a * y for a, y in zip(r, xi, strict=True)), Fraction(0)) for r in A
        ]


def test_a_state_at_rest_that_moves_elsewhere_has_no_quotient():
    day, night = SignedDigraph.from_edges([("a", "b", 1)]), SignedDigraph.from_edges([("a", "b", -1)])
    family = Family.switching([day, night])
    with pytest.raises(HypothesisError, match="moves"):
        Quotient(family)
    with pytest.raises(HypothesisError, match="no common kernel"):
        Quotient.of(decide(family)[0])


# ---------------------------------------------------------------------- proved rates


@pytest.mark.few(0)
def test_the_proved_rate_holds_exactly_at_every_member_drawn(certified):
    quotient, functions, _ = certified
    rng, n = np.random.default_rng(1), len(quotient.nodes)
    for V in functions:
        assert lmi.prove_positive_definite(V.matrix)
        for number, _, levels in members(rng, quotient, 6):
            A, P = quotient.modes[number].member(levels), V.matrix
            product = [[sum(P[i][k] * A[k][j] for k in range(n)) for j in range(n)] for i in range(n)]
            rate = V.rates[number]
            S = [[product[i][j] + product[j][i] - rate * P[i][j] for j in range(n)] for i in range(n)]
            assert lmi.prove_positive_definite(S)


@pytest.mark.few(0)
def test_no_proved_rate_exceeds_the_proved_upper_bound_and_the_best_comes_near(certified):
    _, functions, bound = certified
    assert [V.rate for V in functions] == sorted((V.rate for V in functions), reverse=True)
    assert 0.85 * float(bound.value) < float(functions[0].rate) <= float(bound.value)


@pytest.mark.few(1)
def test_inputs_and_coordinates_stay_below_their_constants_for_every_member(certified):
    quotient, functions, _ = certified
    rng = np.random.default_rng(2)
    V, largest = functions[0], 0.0
    for _, L, _ in members(rng, quotient, 40):
        x = [Fraction(int(v)) for v in rng.integers(-9, 10, len(L))]
        xi = quotient.coordinates(x)
        value = V.value(xi)
        assert all(y * y <= c * value for y, c in zip(xi, V.coordinate_constants, strict=True))
        for row, c in zip(L, V.input_constants, strict=True):
            own = sum((w * y for w, y in zip(row, x, strict=True)), Fraction(0)) ** 2
            assert own <= c * value
            largest = max(largest, float(own / (c * value)) if c * value else 0.0)
    assert largest > 0.2  # the constants are not idle


def test_random_signals_never_beat_the_certificate(certified):
    quotient, functions, _ = certified
    rng = np.random.default_rng(3)
    V, P = functions[0], floats(functions[0].matrix)
    xi = rng.standard_normal(len(P))
    first, clock = xi @ P @ xi, 0.0
    for number, _, levels in members(rng, quotient, 30):
        h = float(rng.exponential(0.2))
        xi, clock = expm(-h * floats(quotient.modes[number].member(levels))) @ xi, clock + h
        assert xi @ P @ xi <= np.exp(-float(V.rate) * clock) * first * (1 + 1e-9)


def test_one_uncertain_follower_decays_at_its_least_weight():
    mode = Quotient(Family.from_intervals([("a", "b", 1, 3)])).modes[0]
    one = [[Fraction(1)]]
    rate = prove_mode(mode, one, [Fraction(1)], 2.0)
    assert 2 - 1e-8 < rate < 2
    S, Z = decay_matrices(mode, one, [Fraction(1)])
    faster = [[s - Fraction("2.000001") * z for s, z in zip(*rows, strict=True)] for rows in zip(S, Z, strict=True)]
    assert not lmi.prove_positive_definite(faster)


def test_an_outage_keeps_v_and_the_other_modes_let_it_fall():
    pair = SignedDigraph.from_edges([("a", "b", 1), ("b", "a", -2)])
    nothing = SignedDigraph.from_edges([], nodes="ab")
    best = search_common_forms(Quotient(Family.switching({"on": pair, "off": nothing}))).functions[0]
    assert best.rates[1] == 0 and best.rates[0] > 2.9  # both eigenvalues have the real part 3/2
    assert best.rate == 0


def test_a_mode_without_decay_may_be_given_a_share_of_the_clock():
    full = SignedDigraph.from_edges([("a", "b", 1), ("b", "c", 1), ("c", "a", 1), ("c", "d", 2)])
    part = SignedDigraph.from_edges([("a", "b", 1), ("b", "c", 1)], nodes="abcd")
    quotient = Quotient(Family.switching([full, part]))
    equal, shared = (search_common_forms(quotient, ["full"], shares=s).functions for s in (None, [0.5, 0.5]))
    assert all(V.rates[1] <= 0 for V in (*equal, *shared))
    # The spectral rate of the full mode is 3; the other costs little.
    assert sum(shared[0].rates) > Fraction(29, 10) > sum(equal[0].rates)


def test_where_all_is_at_rest_there_is_nothing_to_prove():
    quotient = Quotient(Family.from_intervals([], nodes=["a"]))
    assert search_common_forms(quotient).functions == () and prove_signal_rate_bound(quotient) is None


def test_scaling_all_weights_scales_rates_and_changing_camps_changes_none():
    edges = [("a", "b", 1, 2), ("b", "c", 2, 3), ("c", "a", 1, 1), ("a", "c", 1, 2)]
    flipped = [(s, t, -high, -low) if "b" in (s, t) else (s, t, low, high) for s, t, low, high in edges]
    scaled = [(s, t, 7 * low, 7 * high) for s, t, low, high in edges]
    rates = [
        float(search_common_forms(Quotient(Family.from_intervals(e))).functions[0].rate)
        for e in (edges, flipped, scaled)
    ]
    assert rates[1] == pytest.approx(rates[0], rel=1e-3) and rates[2] == pytest.approx(7 * rates[0], rel=1e-3)


def test_a_time_limit_leaves_what_was_proved_before():
    quotient = Quotient(random_family(np.random.default_rng(5), "consensus", 8, 3, TENTH))
    with lmi.time_limit(0):
        search = search_common_forms(quotient)
    assert search.functions == () and search.cut_off == ("Lyapunov equations", "class diagonal", "class full")


def test_what_was_climbed_to_before_a_time_limit_is_proved():
    quotient = Quotient(random_family(np.random.default_rng(5), "consensus", 5, 2, TENTH))
    real, calls = lmi.common_lyapunov._Search._step, []

    def slow_after_the_first(*step):
        calls.append(1)
        if len(calls) > 1:
            raise lmi.OutOfTime("the time limit is reached")
        return real(*step)

    with pytest.MonkeyPatch.context() as patch, lmi.time_limit(300):
        patch.setattr(lmi.common_lyapunov._Search, "_step", slow_after_the_first)
        patch.setattr(lmi.common_lyapunov._Search, "nominal_start", lambda self: None)
        search = search_common_forms(quotient, ["full"])
    assert search.functions and len(calls) == 2


def test_where_no_program_can_be_afforded_there_is_a_useful_rate_all_the_same(monkeypatch: pytest.MonkeyPatch):
    quotient = Quotient(random_family(np.random.default_rng(5), "consensus", 24, 1, TENTH))
    monkeypatch.setattr(lmi.common_lyapunov, "program_seconds", lambda *_: math.inf)
    with lmi.time_limit(60, work=True):
        search = search_common_forms(quotient)
    assert {"class diagonal", "class full"} <= set(search.cut_off)
    (V,) = search.functions
    assert V.kind == "full" and V.rate > Fraction(1, 10)


def test_a_program_that_fails_leaves_those_of_smaller_rates(monkeypatch: pytest.MonkeyPatch):
    ring = [(k, (k + 1) % 5, -1 if k == 4 else 1, -1 if k == 4 else 1) for k in range(5)]
    quotient = Quotient.of(decide(Family.from_intervals([*ring, (0, 2, 1, 3), (3, 1, 1, 3)]))[0])
    usual, calls = common_form_search.least_condition, list[int]()

    def failing(*given, **words):
        calls.append(1)
        if len(calls) == 1:
            raise lmi.NoCertificate("the solver failed")
        return usual(*given, **words)

    monkeypatch.setattr(common_form_search, "least_condition", failing)
    search = search_common_forms(quotient, ["full"])
    assert len(calls) > 1 and "class full: the solver failed" in search.notes
    assert len(search.functions) > 1 and search.functions[-1].overshoot < search.functions[0].overshoot / 2


@pytest.mark.few(0)
def test_consensus_of_more_agents_than_programs_take_has_a_rate_that_the_check_accepts():
    hub = [(0, k, Fraction(9, 10), Fraction(11, 10)) for k in range(1, 130)]
    rim = [(k, k + 1, Fraction(9, 10), Fraction(11, 10)) for k in range(1, 129)]
    family = Family.from_intervals([*hub, *rim, (129, 0, Fraction(9, 10), Fraction(11, 10))])
    certificate = certify_family(family, NominalProtocol(T=1, rho1=1, rho2=1, kappa=3))
    assert certificate.behaviours == ("bipartite consensus",) and certificate.verdict == "certified"
    assert certificate.rate > Fraction(1, 10)


def test_large_families_are_left_to_others():
    path = Family.from_intervals([(k, k + 1, 1, 2) for k in range(500)])
    search = search_common_forms(Quotient(path))
    assert search.functions == () and "500 agents" in search.notes[0]
    assert prove_signal_rate_bound(Quotient(path)) is None


def test_enough_ends_the_search():
    quotient = Quotient(random_family(np.random.default_rng(6), "consensus", 4, 1))
    assert {V.kind for V in search_common_forms(quotient, enough=Fraction(0)).functions} == {"diagonal"}


# ---------------------------------------------------------------------- undirected graphs


def test_undirected_families_are_as_fast_as_their_least_weights_and_no_faster():
    for seed in range(6):
        rng = np.random.default_rng(seed)
        family = random_family(rng, "undirected", int(rng.integers(2, 9)), int(rng.integers(1, 4)), TENTH, 0.3)
        V = undirected_function(Quotient.of(decide(family)[0]))
        spectra = [np.sort(np.linalg.eigvalsh(mode.mandatory.dense_laplacian())) for mode in family.modes]
        slowest = 2 * min(values[len(V.quotient.pivots)] for values in spectra)
        assert V.optimal and float(V.rate) == pytest.approx(slowest, rel=1e-6)


def test_the_closed_form_is_refused_where_directions_change_alone():
    # The least weights of the path would promise 0.586; a member has half the rate 0.156.
    ends = [(1, 2), (2, 3), (3, 4)]
    alone = Family.from_intervals([(s, t, 1, 10) for a in ends for s, t in (a, a[::-1])])
    together = Family.from_intervals([(s, t, 1, 10) for s, t in ends], undirected=True)
    assert undirected_function(Quotient(alone)) is None
    assert float(undirected_function(Quotient(together)).rate) == pytest.approx(2 * 0.585786, rel=1e-5)
    assert float(prove_signal_rate_bound(Quotient(alone)).value) < 2 * 0.157


def test_directed_graphs_that_share_a_left_vector_have_the_closed_form():
    cycle = SignedDigraph.from_edges([(1, 2, 1), (2, 3, 1), (3, 1, 1)])
    back = SignedDigraph.from_edges([(2, 1, 3), (3, 2, 3), (1, 3, 3)])
    V = undirected_function(Quotient(Family.switching([cycle, back])))
    assert common_left_vector(V.quotient.family) == (1, 1, 1) and not V.optimal
    assert [round(float(rate), 6) for rate in V.rates] == [
        3,
        9,
    ]  # eigenvalues 3/2 +- i sqrt(3)/2, and three times these
    heavy = SignedDigraph.from_edges([(1, 2, 1), (2, 1, 1), (2, 3, 1), (3, 2, 1)])
    assert undirected_function(Quotient(Family.switching([cycle, replace_weight(heavy)]))) is None


def replace_weight(graph):
    return SignedDigraph.from_edges([(s, t, 5 if (s, t) == ("1", "2") else w) for s, t, w in graph.edges])


# ---------------------------------------------------------------------- upper bounds


def test_every_proved_bound_is_that_of_its_own_witness(certified):
    quotient, _, bound = certified
    matrices = [floats(quotient.modes[m.mode].member(m.levels)) for m in bound.members]
    durations = [float(h) for h in bound.durations]
    if bound.kind == "word":
        Phi = np.eye(len(quotient.nodes))
        for A, h in zip(matrices, durations, strict=True):
            Phi = expm(-A * h) @ Phi
        own = -2 * np.log(np.abs(np.linalg.eigvals(Phi)).max()) / sum(durations)
    else:
        assert sum(bound.durations) == 1
        own = 2 * np.linalg.eigvals(sum(h * A for h, A in zip(durations, matrices, strict=True))).real.min()
    assert own * (1 - 1e-9) <= float(bound.value) <= own * (1 + 1e-3)


def test_members_of_bounds_have_one_sign_of_a_pair_on():
    quotient = Quotient(unsure_pair())
    edges = {part.edge: k for k, part in enumerate(quotient.modes[0].parts)}
    mode = quotient.family.modes[0]
    pair = [edges[e] for e in mode.parameters.tolist() if (mode.source[e], mode.target[e]) == (0, 3)]
    assert len(pair) == 2
    for candidate in rate_bounds(quotient):
        assert all(sum(member.levels[k] for k in pair) <= 1 for member in candidate.members)


def test_switching_may_be_slower_than_every_member_and_every_mixture():
    day = SignedDigraph.from_edges([("a", "b", 1), ("b", "c", -1)])
    night = SignedDigraph.from_edges([("c", "a", -2), ("a", "b", 1)])
    quotient = Quotient(Family.switching([day, night]))
    functions = search_common_forms(quotient).functions
    bound = prove_signal_rate_bound(quotient, functions)
    constant = min(c.value for c in rate_bounds(quotient) if c.kind != "word")
    assert bound.kind == "word" and functions[0].rate < bound.value < 0.8 * constant


def test_a_mixture_may_be_slower_than_its_modes():
    # Each mode turns in its own direction fast; together they hardly turn, and their real parts part.
    turns = [SignedDigraph.from_edges([("a", "b", s), ("b", "a", -s), ("a", "b2", 1), ("b2", "a", 1)]) for s in (3, -3)]
    quotient = Quotient(Family.switching(turns))
    mixture = next(c for c in rate_bounds(quotient) if c.kind == "mixture")
    proved = prove_candidate(quotient, mixture)
    assert isinstance(proved, SignalRateBound) and proved.kind == "mixture"
    assert float(proved.value) == pytest.approx(mixture.value, rel=1e-3)


def test_words_are_bounded_on_the_safe_side():
    rng = np.random.default_rng(7)
    for n in (1, 2, 4):
        whole = [rng.integers(-3, 4, (n, n)) + 4 * np.eye(n, dtype=int) for _ in range(2)]
        exact = [[[Fraction(int(x)) for x in row] for row in A] for A in whole]
        value = prove_word(exact, [Fraction(1, 4), Fraction(1, 8)])
        Phi = expm(-whole[1] / 8) @ expm(-whole[0] / 4)
        own = -2 * np.log(np.abs(np.linalg.eigvals(Phi)).max()) / 0.375
        assert own - 1e-9 <= float(value) <= own + 1e-6


# ---------------------------------------------------------------------- campaign


@pytest.mark.campaign
@pytest.mark.parametrize("seed", range(60))
def test_families_of_every_kind_have_rates_below_their_bounds(seed):
    rng = np.random.default_rng(1000 + seed)
    share = Fraction(int(rng.choice([0, 1, 3])), 10)
    kind = KINDS[seed % len(KINDS)]
    family = random_family(rng, kind, int(rng.integers(2, 9)), int(rng.integers(1, 5)), share, 0.2)
    quotient = Quotient.of(decide(family)[0])
    functions = search_common_forms(quotient).functions
    bound = prove_signal_rate_bound(quotient, functions)
    if quotient.nodes:
        best: CommonForm = functions[0]
        assert best.rate <= bound.value
        assert lmi.prove_positive_definite(best.matrix)
        assert replace(best, rates=(bound.value,)).rate == bound.value


@pytest.mark.parametrize("exponent", thinned([300, -250, 160], 3))
def test_scaling_all_weights_scales_the_rate_however_far(exponent):
    edges, unit = [("a", "b", 1, 2), ("b", "a", -1, -1)], Fraction(10) ** exponent
    rates = []
    for size in (1, unit):
        family = Family.from_intervals([(s, t, size * low, size * high) for s, t, low, high in edges])
        search = search_common_forms(quotient := Quotient.of(decide(family)[0]), ("diagonal",))
        bound = prove_signal_rate_bound(quotient, search.functions)
        rates.append((search.functions[0].rate / size, bound.value / size))
    assert float(rates[1][0]) == pytest.approx(float(rates[0][0]), rel=1e-3)
    assert rates[1][0] <= rates[1][1]


def test_forms_for_one_state_bound_inputs_more_closely_than_those_of_least_condition():
    pairs = [(1, 0, 4, 4), (0, 1, 2, 4), (3, 2, 1, 2), (2, 3, 1, 3)]
    known = [(0, 4, 7), (1, 4, 8), (2, 4, -5), (3, 4, 4), (4, 5, 4)]
    quotient = Quotient.of(decide(Family.from_intervals([*pairs, *((a, b, w, w) for a, b, w in known)]))[0])
    x = [Fraction(v) for v in (1, 1, -5, -1, 3, 2)]
    aim = Aim(np.array(floats([quotient.coordinates(x)])[0]), np.array([2.0, 5.0]))

    def bounds(functions):
        return [
            min(
                math.sqrt(V.value(quotient.coordinates(x)) * max(V.input_constants)) * math.exp(-float(V.rate) / 2 * s)
                for V in functions
            )
            for s in aim.clocks
        ]

    fastest = search_common_forms(quotient, slower=False).functions
    aimed = list(aimed_functions(quotient, aim, fastest, []))
    assert max(V.rate for V in aimed) <= max(V.rate for V in fastest)
    assert (np.array(bounds(aimed)) < 0.7 * np.array(bounds(search_common_forms(quotient).functions))).all()
