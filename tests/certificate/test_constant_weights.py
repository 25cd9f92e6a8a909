"""Where agents end under constant weights that nobody knows: all vertices, forged files, screens, what is read back."""

from __future__ import annotations

import itertools
import random
import re
from fractions import Fraction
from functools import cache
from typing import Any

import pytest
from asked import certify_family
from mutations import changed, leaves, resealed
from row_families import random_consensus, random_state, values_of_vertices

from lmi import search_time
from ptcc_certify import Family, NominalProtocol, SlidingModeProtocol
from ptcc_certify.bounds.final_state.constant_weights import value_ends
from ptcc_certify.certificate.certificate import Certificate, read_certificate
from ptcc_certify.certificate.constrained_switching.claims import FinalValueClaim
from ptcc_certify.certificate.constrained_switching.final_states import constant_states
from ptcc_certify.checker import check
from ptcc_certify.report.page import report_html
from ptcc_certify.report.screen import certificate_lines, summary_lines
from ptcc_certify.report.statement import report_latex

PROTOCOL = NominalProtocol(T=1, rho1=1, rho2=1, kappa=3)
GAINS = {"T_r": 1, "T_s": 1, "rho1": 1, "rho2": 1, "kappa": 3, "mu1": 2, "mu2": 1, "mu3": 1, "delta": 1}
PAIR = [("a", "b", -2, -1), ("b", "a", -1, -1), ("b", "c", 5, 9)]


def made(family: Family, x0: Any, protocol: Any = PROTOCOL, **more: Any) -> Certificate:
    return certify_family(family, protocol, x0, signal="constant", time_limit=3, **more)


@cache
def pair() -> Certificate:
    return made(Family.from_intervals(PAIR), [0, 6, 100])


def claim_of(certificate: Certificate) -> FinalValueClaim:
    (claim,) = certificate.final_values.values()
    return claim


def compare(seed: int) -> int:
    rng = random.Random(seed)
    family = random_consensus(rng)
    x = random_state(rng, family.n_nodes)
    certificate = made(family, x)
    assert certificate.verdict == "certified" and check(certificate.to_dict(), stdlib=True).accepted
    if not certificate.final_values:
        assert family.n_nodes == 1 or certificate.final_state[0][0] == certificate.final_state[0][1]
        return 0
    (ends,) = claim_of(certificate).values
    values = values_of_vertices(family.modes[0], [g * y for g, y in zip(ends.camps, x, strict=True)])
    assert (ends.lower, ends.upper, ends.within) == (min(values), max(values), 0)
    for (low, high), (wide_low, wide_high) in zip(ends.final_states, certificate.final_state, strict=True):
        assert wide_low <= high and low <= wide_high
    return 1


@pytest.mark.few(0)
def test_the_ends_that_are_certified_are_those_of_all_vertices():
    assert sum(map(compare, range(4))) >= 2


@pytest.mark.campaign
@pytest.mark.parametrize("start", range(4, 124, 12))
def test_the_ends_that_are_certified_are_those_of_all_vertices_of_more_graphs(start: int):
    assert sum(map(compare, range(start, start + 12))) >= 4


@pytest.mark.parametrize("seed", range(4))
def test_long_numbers_are_rounded_outwards_and_some_weights_come_as_near_as_is_said(seed: int, monkeypatch: Any):
    monkeypatch.setattr("ptcc_certify.bounds.final_state.constant_weights._SHORT", 8)
    rng = random.Random(seed)
    family = random_consensus(rng)
    x = random_state(rng, family.n_nodes)
    ends = value_ends(family.modes[0], x)
    values = values_of_vertices(family.modes[0], [g * y for g, y in zip(ends.camps, x, strict=True)])
    assert ends.lower <= min(values) <= ends.lower + ends.within
    assert ends.upper - ends.within <= max(values) <= ends.upper
    assert ends.within <= max(map(abs, values)) * Fraction(1, 10**15)


def test_a_group_of_more_agents_than_are_solved_for_exactly_is_certified_all_the_same():
    rng, n = random.Random(5), 150
    edges = {(k, (k + 1) % n): (rng.randint(1, 9), rng.randint(10, 19)) for k in range(n)}
    edges |= {pair: (0, 5) for _ in range(n) if (pair := (rng.randrange(n), rng.randrange(n))) not in edges}
    family = Family.from_intervals([(s, t, *ends) for (s, t), ends in edges.items() if s != t])
    certificate = made(family, [rng.randint(-9, 9) for _ in range(n)])
    (ends,) = claim_of(certificate).values
    assert certificate.verdict == "certified" and ends.within < (ends.upper - ends.lower) / 10**9
    assert ends.upper - ends.lower < 18


def test_modes_have_ends_of_their_own_and_undirected_ones_their_mean():
    directed = Family.from_intervals([("a", "b", 1, 2), ("b", "a", 1, 1)])
    tied = Family.from_intervals([("a", "b", -2, -1)], undirected=True)
    certificate = made(Family.switching([directed, tied]), [0, 6])
    first, second = claim_of(certificate).values
    assert (first.lower, first.upper) == (2, 3) and (second.lower, second.upper, second.vectors) == (-3, -3, None)
    assert constant_states(certificate) == [(-3, 3), (2, 3)] and certificate.verdict == "certified"
    other = Family.switching([directed, Family.from_intervals([("a", "b", 1, 1), ("b", "a", -1, -1)])])
    assert claim_of(made(other, [0, 6])).values[1] is None and constant_states(made(other, [0, 6])) == [None, None]


def test_nothing_is_claimed_where_it_would_say_no_more():
    a_leader, unbalanced = [("a", "b", 1, 2)], [("a", "b", 1, 1), ("b", "a", -1, -1)]
    for edges in (a_leader, unbalanced, [("a", "c", 1, 1), ("b", "c", 1, 2)]):
        family = Family.from_intervals(edges)
        assert not made(family, range(family.n_nodes)).final_values
    assert not made(Family.from_intervals(a_leader, undirected=True), [0, 1]).final_values
    assert not made(Family.from_intervals(PAIR), None).final_values
    assert not certify_family(Family.from_intervals(PAIR), PROTOCOL, [0, 6, 1], time_limit=3).restricted


@pytest.mark.few(0)
def test_at_rest_in_the_sliding_mode_the_ends_are_the_same_and_none_are_claimed_otherwise():
    family, protocol = Family.from_intervals(PAIR), SlidingModeProtocol(**GAINS)
    certificate = made(family, [0, 6, 100], protocol)
    assert certificate.verdict == "certified" and constant_states(certificate) == [(-3, -2), (2, 3), (2, 3)]
    assert read_certificate(certificate.to_dict()) == certificate and len(certificate.restricted) == 1
    moving = made(family, [0, 6, 100], protocol, sigma0=[1, 0, 0])
    assert moving.verdict == "certified" and not moving.restricted
    forged = {**moving.to_dict(), "restricted": certificate.to_dict()["restricted"]}
    assert "while sliding variables move" in (check(resealed(forged)).reason or "")


@pytest.mark.few(0)
def test_what_is_read_back_says_the_same(monkeypatch: pytest.MonkeyPatch):
    """No limit is met on a clock that stands still; what one cuts off is a note that no file keeps."""
    monkeypatch.setattr(search_time, "_now", lambda: 0.0)
    certificate = made(Family.from_intervals(PAIR), [0, 6, 100])
    again = read_certificate(certificate.to_dict())
    assert again == certificate and certificate_lines(again, "f")[2:] == certificate_lines(certificate, "f")[2:]
    (own,), (other,) = claim_of(certificate).values, claim_of(again).values
    assert own.__dict__ == other.__dict__


@pytest.mark.few(0)
@pytest.mark.usefixtures("framed_figures")
def test_screen_page_and_statement_tell_the_ends_of_constant_weights():
    saved = read_certificate(pair().to_dict())
    text = "\n".join(summary_lines(saved, "pair"))
    assert "           a in [-3, -2], b, c in [2, 3] (constant weights)" in text and "(every signal)" in text
    assert "as for every signal\n" in text and "nothing more is proved" not in text
    page = " ".join(re.sub("</?bdi>|(<[^>]*>)", lambda tag: " " if tag[1] else "", report_html(saved)).split())
    ends = "a in [-3, -2], b, c in [2, 3] (constant weights; some weights attain these ends)"
    assert ends.replace("-", "\N{MINUS SIGN}") in page
    assert f"Where they end: {ends}." in re.sub("[$]", "", report_latex(saved))


@pytest.mark.few(0)
@pytest.mark.usefixtures("framed_figures")
def test_where_modes_have_camps_of_their_own_each_ends_within_the_ends_of_all():
    modes = [[("a", "b", 1, 2), ("b", "a", 1, 1)], [("a", "b", -2, -1), ("b", "a", -1, -1)]]
    certificate = made(Family.switching([Family.from_intervals(edges) for edges in modes]), [0, 6])
    saved = read_certificate(certificate.to_dict())
    assert "x(T)       a in [-3, 3], b in [2, 3], all at one |x(T)| (these signals)" in "\n".join(
        summary_lines(saved, "pair")
    )
    assert "constant weights" not in "\n".join(summary_lines(saved, "pair"))
    assert "a in [\N{MINUS SIGN}3, 3], b in [2, 3]" in re.sub(
        " +", " ", re.sub("</?bdi>|(<[^>]*>)", lambda tag: " " if tag[1] else "", report_html(saved))
    )


# ---------------------------------------------------------------------- forged files


def test_no_other_number_of_a_final_value_is_accepted_unless_it_is_true():
    """Every number of the claim nudged: what is accepted claims no less than the truth."""
    data = pair().to_dict()
    (place,) = [k for k, claim in enumerate(data["restricted"]) if claim["claim"] == "final value"]
    count = 0
    for path, value in leaves(data["restricted"][place]["modes"]):
        for step in ("-1", "1", "-1/1000000", "1/1000000"):
            new = str(Fraction(value) + Fraction(step))
            mutant = resealed(changed(data, ("restricted", place, "modes", *path), new))
            report = check(mutant, stdlib=True)
            said = mutant["restricted"][place]["modes"][0]
            low, high, within = (Fraction(said[key]) for key in ("lower", "upper", "within"))
            assert not report.accepted or (low <= -3 and high >= -2 and within >= max(-3 - low, high + 2)), path
            count += not report.accepted
    assert count >= 20


@pytest.mark.parametrize(
    ("path", "new", "reason"),
    [
        (("signals",), {"dwell": "1", "clock": "t"}, "signals is not one of constant"),
        (("component",), 1, "an unknown component"),
        (("modes",), [None], "no final value of any mode"),
        (("modes",), [], "modes has not 1 entries"),
        (("modes", 0, "above"), None, "above is null, and not left out"),
        (("modes", 0, "above"), {"a": "0"}, 'the key "b" is missing'),
        (("modes", 0, "above"), {"b": "0", "a": "0"}, "agents are in another order"),
        (("modes", 0, "below"), {"a": "0", "b": "0", "c": "0"}, 'the key "c" is not known'),
        (("modes", 0, "within"), "-1", "no weights are known to come so near to the end"),
        (("modes", 0, "lower"), "-1", "the lower end is the larger"),
    ],
)
def test_what_does_not_fit_is_rejected(path: tuple[Any, ...], new: Any, reason: str):
    data = pair().to_dict()
    assert check(data).accepted
    assert check(resealed(changed(data, ("restricted", 1, *path), new))).reason == reason


@pytest.mark.parametrize("key", ["above", "below"])
def test_both_vectors_are_told(key: str):
    data = pair().to_dict()
    bare = {k: value for k, value in data["restricted"][1]["modes"][0].items() if k != key}
    report = check(resealed(changed(data, ("restricted", 1, "modes", 0), bare)))
    assert report.reason == f"{key} is not an object"


@pytest.mark.few(0)
def test_optional_edges_count_for_who_decides():
    """``c`` is heard only at times; then its state counts, and a claim about ``a``, ``b`` alone is refused."""
    edges = [("a", "b", 1, 1), ("b", "a", 1, 1), ("b", "c", 1, 1), ("c", "b", 0, 1)]
    data = made(Family.from_intervals(edges), [0, 2, 10]).to_dict()
    (place,) = [k for k, claim in enumerate(data["restricted"]) if claim["claim"] == "final value"]
    said = data["restricted"][place]["modes"][0]
    assert list(said["above"]) == ["a", "b", "c"] and said["lower"] == "1" and said["upper"] == "4"
    for key in ("above", "below"):
        short = {k: v for k, v in said[key].items() if k != "c"}
        assert check(resealed(changed(data, ("restricted", place, "modes", 0, key), short))).rejected


@pytest.mark.few(0)
def test_a_vector_of_another_mode_proves_nothing():
    one, other = ([("a", "b", 1, 2), ("b", "a", 1, 1)], [("a", "b", 5, 6), ("b", "a", 1, 1)])
    data = made(Family.switching([Family.from_intervals(one), Family.from_intervals(other)]), [0, 6]).to_dict()
    (place,) = [k for k, claim in enumerate(data["restricted"]) if claim["claim"] == "final value"]
    modes = data["restricted"][place]["modes"]
    for some in itertools.permutations([*modes, None], 2):
        mutant = resealed(changed(data, ("restricted", place, "modes"), list(some)))
        right = all(said is None or said == modes[k] for k, said in enumerate(some))
        assert check(mutant).accepted == right
