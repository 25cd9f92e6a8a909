"""What is told of a certificate is data: numbers rounded to the safe side, fields by their names, changes as such."""

from __future__ import annotations

import re
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
from asked import certify_words
from selection import thinned

import ptcc_certify as ptcc
from lmi.exact.decimal_rounding import down, up
from ptcc_certify.cli.terminal import flagged
from ptcc_certify.errors import Change, ParameterError, spell
from ptcc_certify.report.facts.late import beside_law
from ptcc_certify.report.page import set_note
from ptcc_certify.report.screen import SECTIONS, certificate_lines, summary_lines

pytestmark = pytest.mark.usefixtures("framed_figures", "quick_search")

CORPUS = Path(__file__).parents[1] / "corpus"
NAMES = thinned(sorted(path.stem for path in CORPUS.glob("*.json")), 24)
WEAK = ptcc.NominalProtocol(T=1, rho1=1, rho2="0.1", kappa=1)
FOES = [("a", "b", -1), ("b", "a", -1)]


@pytest.mark.parametrize("name", NAMES)
def test_a_number_stands_in_its_sentence_rounded_to_its_side(name: str):
    saved = ptcc.read_certificate(CORPUS / f"{name}.json")
    facts = saved.facts()
    numbers = [fact for fact in facts if fact.side != "exact" and isinstance(fact.value, Fraction | float)]
    assert numbers or saved.rate is None or saved.rate == 0
    for fact in numbers:
        rounded = {"up": up, "down": down}[fact.side]
        written = {rounded(fact.value, digits) for digits in range(1, 10)}  # type: ignore[arg-type]
        assert written & set(re.findall(r"-?[0-9][0-9.]*(?:e[-+]?[0-9]+)?", fact.text)), fact


@pytest.mark.few(0)
@pytest.mark.parametrize("name", NAMES)
def test_the_short_screen_leaves_details_out_and_the_long_one_tells_every_fact(name: str):
    saved = ptcc.read_certificate(CORPUS / f"{name}.json")
    facts, long = saved.facts(), certificate_lines(saved)
    assert len([line for line in long if line and line not in SECTIONS]) == len(facts)
    heads = {line.split("  ")[0].lower() for line in summary_lines(saved)}
    assert {head for head in heads if head.strip()} <= {fact.head.lower() for fact in facts if not fact.detail}
    assert facts[-1].head == "verdict" and facts[-1].value == saved.verdict


@pytest.mark.parametrize("name", NAMES)
def test_no_fact_names_an_option_of_the_command_line(name: str):
    assert not any("--" in fact.text for fact in ptcc.read_certificate(CORPUS / f"{name}.json").facts())


def test_advice_is_a_change_that_each_medium_names_in_its_own_way():
    certificate = ptcc.certify(FOES, WEAK, [3, 5], asks=ptcc.Asks(simulation=False))
    verdict = certificate.facts()[-1]
    (change,) = verdict.changes
    assert change == Change("rho2", Fraction("0.501"))
    assert ptcc.certify(
        FOES, WEAK.replace(rho2=change.value), [3, 5], asks=ptcc.Asks(simulation=False)
    ).assessment.useful
    assert "rho2=0.501 leaves 1 %" in verdict.text and "--rho2 0.501 leaves" in spell(verdict.note, flagged)
    assert "\u03c1<sub>2</sub> = 0.501 leaves 1 %" in set_note(verdict.note)


def test_a_refusal_knows_its_field():
    with pytest.raises(ParameterError, match=r"^rho1 = -1 is outside its domain; ") as refused:
        ptcc.NominalProtocol(T=1, rho1=-1, rho2=1, kappa=1)
    assert refused.value.field == "rho1" and refused.value.told(flagged).startswith("--rho1 = -1 is outside")
    with pytest.raises(ParameterError) as refused:
        ptcc.Agents(order=2, rest=1, gain_cap=4)
    assert refused.value.told(flagged).endswith("; leave --gain-cap out") and "leave gain_cap out" in str(refused.value)


@pytest.mark.parametrize("name", NAMES)
def test_a_page_sets_every_fact_without_codes_of_letters(name: str):
    assert not any("\\u{" in set_note(fact.note) for fact in ptcc.read_certificate(CORPUS / f"{name}.json").facts())


def test_labels_that_look_like_signs_stand_as_they_are():
    certificate = ptcc.certify([("<b>", "a", -1), ("a", "<b>", -1)], WEAK, [0, 5], asks=ptcc.Asks(simulation=False))
    (end,) = (fact for fact in certificate.facts() if fact.head == "x(T)")
    assert "<bdi>&lt;b&gt;</bdi>=" in set_note(end.note)


def test_what_holds_from_the_deadline_on_holds_at_it_in_every_line():
    chain = [("L", "a", 1), ("a", "b", 1), ("b", "a", 1), ("b", "c", 1), ("c", "b", 1)]
    parts: dict[str, Any] = {"agents": ptcc.Agents(order=2, exchange="virtual"), "leaders": ptcc.MovingLeaders("0.5")}
    parts |= {"messages": ptcc.LateMessages("0.02", gain_cap=2)}
    asks = ptcc.Asks(simulation=False, method="paper")
    made = ptcc.certify(chain, ptcc.NominalProtocol(T=20, rho2="0.2"), [0, 4, -2, -1], asks=asks, **parts)
    assert made.late is not None and made.late.vehicles is not None and made.late.after is not None
    assert made.late.vehicles.position.max() > 2 * made.late.after == 2 * made.late.largest
    within = up(made.late.after, 2)
    assert told(made, "late")[0].startswith(f"every follower within {up(made.late.after, 3)} of its target at T")
    assert told(made, "left") == [f"at T by agent: a {within}, b {within}, c {within}"]
    assert f"every follower within {within} of its target at T; try a smaller" in told(made, "verdict")[0]
    whose = "of virtual positions, without a gain cap, nothing late, leaders at rest"
    assert told(made, "input")[1] == f"{whose}: NOT BOUNDED from some initial states"


def told(certificate: ptcc.Certificate, head: str) -> list[str]:
    return [fact.text for fact in certificate.facts() if fact.head == head]


@pytest.mark.few(0)
def test_what_is_told_of_other_agents_or_another_law_says_so(tmp_path: Path):
    led = [("lead", "a", 1), ("a", "b", 1), ("b", "a", -1)]
    law, asks = ptcc.NominalProtocol(), ptcc.Asks(simulation=False, method="paper")
    moving = ptcc.certify(led, law, [1, 3, -2], leaders=ptcc.MovingLeaders("0.5", "0.2", "0.9"), asks=asks)
    disturbed = ptcc.certify(led, law, [1, 3, -2], asks=replace(asks, delta="0.5"))
    for certificate in (moving, disturbed):
        assert all("without disturbances" in told(certificate, head)[0] for head in ("claim", "x(T)"))
    assert told(moving, "given") == ["leaders at rest, without disturbances, without sign(e_k), in what follows"]
    assert not told(disturbed, "given")
    pages = {}
    for name, certificate in (("moving", moving), ("disturbed", disturbed)):
        certificate.save(tmp_path / f"{name}.json")
        ptcc.write_report(tmp_path / f"{name}.json", tmp_path / f"{name}.html")
        pages[name] = (tmp_path / f"{name}.html").read_text("utf-8")
    assert "no disturbances in the model" not in pages["moving"] and "of those that move was asked" in pages["moving"]
    assert "without disturbances</h1>" in pages["disturbed"]


def test_a_bound_of_initial_states_in_a_formation_is_told_of_positions():
    path, asks = [("a", "b", 1), ("b", "a", 1)], ptcc.Asks(simulation=False, initial_set=2)
    made = ptcc.certify(path, ptcc.NominalProtocol(), agents=ptcc.Agents(order=1, offsets=[5, -5]), asks=asks)
    for certificate in (made, ptcc.read_certificate(made.to_dict())):
        assert told(certificate, "protocol")[0].endswith("; all |x_k(0)| <= 2, in a formation")


@pytest.mark.few(0)
def test_agents_of_order_n_are_not_single_integrators_and_end_at_their_places(tmp_path: Path):
    path = [("a", "b", 1), ("b", "a", 1)]
    start, asks = ptcc.InitialState([1, 2], v0=[0, 1]), ptcc.Asks(simulation=False)
    law = ptcc.NominalProtocol(kappa=3)
    capped = ptcc.certify(path, law, start, agents=ptcc.Agents(order=2, gain_cap=20), asks=asks)
    assert told(capped, "rate")[0].startswith("of single integrators: ")
    assert all("without the cap" in text for head in ("x(T)", "v(T)") for text in told(capped, head))
    formed = ptcc.certify(path, law, start, agents=ptcc.Agents(order=2, offsets=[0, 1]), asks=asks)
    assert told(formed, "error")[0].endswith("of their places in the common motion")
    both = ptcc.certify(path, law, start, agents=ptcc.Agents(order=2, offsets=[0, 1], gain_cap=20), asks=asks)
    for name, certificate, says in (
        ("both", both, "Of x \N{MINUS SIGN} offsets, but for what the cap leaves: all agents"),
        ("capped", capped, "But for what the cap leaves: all agents"),
        ("formed", formed, "Of x \N{MINUS SIGN} offsets: all agents"),
    ):
        certificate.save(tmp_path / f"{name}.json")
        ptcc.write_report(tmp_path / f"{name}.json", tmp_path / f"{name}.html")
        assert says in (tmp_path / f"{name}.html").read_text("utf-8")


CAMPS = [("a", "b", 1), ("b", "a", 2), ("b", "c", -1), ("c", "b", -1)]


def asked(x0: Any = (1, 2, 3), **words: Any) -> ptcc.Certificate:
    return certify_words(CAMPS, ptcc.NominalProtocol(), list(x0), simulation=False, **words)


def test_bounds_of_the_law_without_what_was_asked_say_so_on_every_screen():
    slow = asked(limits=ptcc.GainLimits(sample_period="0.2"))
    noisy = asked(noise="0.1", delta="0.1")
    for certificate, without in ((slow, "limits"), (noisy, "noise or disturbances")):
        for head in ("error", "input"):
            assert told(certificate, head)[0].startswith(f"without {without}: ")
            assert any(line.startswith(f"{head:<10} without {without}: ") for line in summary_lines(certificate))
    both = asked(limits=ptcc.GainLimits(gain_cap=20), noise="0.01", at="0.7")
    assert told(both, "input")[0].startswith("bounded under these limits, |n_k| <= 0.01; ")
    assert "under the limits and noise" in told(both, "verdict")[0]
    assert told(both, "claim")[0].startswith("bipartite consensus at T = 1, without limits or noise ")
    assert any("without limits or noise: at t = 0.7: " in line for line in summary_lines(both))


@pytest.mark.usefixtures("every_class")
def test_agents_that_begin_at_their_ends_stay_there_but_for_noise():
    cap, ends = ptcc.GainLimits(gain_cap=20), ["0.3", "0.3", "-0.3"]
    assert told(asked(ends, limits=cap), "error")[0] == "without limits: none: every agent begins at its final state"
    assert told(asked(ends, limits=cap, noise="0.01"), "error")[0].startswith("gain <= 20, |n_k| <= 0.01: ||E|| <= 0.1")


@pytest.mark.parametrize(
    "words, left",
    [
        ({"limits": ptcc.GainLimits(gain_cap="0.5")}, "limits of the gain leave something at T"),
        ({"noise": "0.1"}, "noise leaves something at T"),
    ],
)
def test_a_behaviour_is_not_met_where_limits_or_noise_leave_something(words: dict[str, Any], left: str):
    certificate = asked(expectations=ptcc.Expectations("bipartite consensus"), **words)
    assert f"left open: bipartite consensus ({left})" in told(certificate, "verdict")[0]
    assert certificate.assessment.exit_code == 4
    still = asked(["0.3", "0.3", "-0.3"], expectations=certificate.expectations, limits=words.get("limits"))
    assert told(still, "verdict")[0].startswith("met: ")


def test_messages_that_are_inexact_are_not_called_late():
    led, law, asks = (
        [("lead", "a", 1), ("a", "b", 1), ("b", "a", -1)],
        ptcc.NominalProtocol(),
        ptcc.Asks(simulation=False),
    )
    messages = {
        "nothing late or inexact": ptcc.LateMessages("0.001", value_error="0.1"),
        "nothing inexact": ptcc.LateMessages(value_error="0.1"),
    }
    for without, of in messages.items():
        rounded = ptcc.certify(led, law, [1, 2, 3], messages=of, asks=asks)
        assert f", {without} (" in told(rounded, "claim")[0]
    assert beside_law(rounded) == ["Here messages are exact; with inexact ones what is heard is off by up to 0.1."]


def test_rates_of_the_plain_protocol_are_not_those_of_agents_of_order_1_with_gains_of_their_own():
    certificate = asked(agents=ptcc.Agents(order=1, decay=2))
    assert told(certificate, "rate")[0].startswith("of the plain protocol: 2.763")


def test_a_family_that_begins_where_it_ends_stays_exactly_there():
    unsure = ptcc.Family.from_intervals([("a", "b", 1, 2), ("b", "a", 1, 2)])
    certificate = ptcc.certify(unsure, ptcc.NominalProtocol(), [1, 1], asks=ptcc.Asks(simulation=False))
    assert told(certificate, "error")[0].startswith("at 0.99 T: every agent within 0 of its final state")
    assert not certificate.proof.deviation_bound([1.0, 0.5, 0.0]).any()


def test_disturbances_under_a_cap_leave_a_behaviour_open_and_each_cause_is_named():
    cap, of = ptcc.GainLimits(gain_cap=20), ptcc.Expectations("bipartite consensus")
    ends = ["0.3", "0.3", "-0.3"]
    for x0, words, left in (
        (ends, {"delta": "0.1"}, "disturbances leave"),
        (ends, {"noise": "0.1"}, "noise leaves"),
        ([1, 2, 3], {"noise": "0.1"}, "limits of the gain and noise leave"),
    ):
        assert f"({left} something at T)" in told(asked(x0, limits=cap, expectations=of, **words), "verdict")[0]


@pytest.mark.few(0)
def test_what_is_asked_of_a_family_stands_in_its_file(tmp_path: Path):
    unsure = ptcc.Family.from_intervals([("a", "b", 1, 2), ("b", "a", 1, 2)])
    asks = ptcc.Asks(simulation=False, expectations=ptcc.Expectations(max_input=1))
    made = ptcc.certify(unsure, ptcc.NominalProtocol(), [1, 3], asks=asks)
    made.save(tmp_path / "c.json")
    assert told(ptcc.read_certificate(tmp_path / "c.json"), "verdict") == told(made, "verdict")
    assert told(made, "verdict")[0].startswith("refuted: |u_k| <= 1 ")
    assert ptcc.write_report(tmp_path / "c.json", tmp_path / "c.html") == "refuted"


def test_followers_of_leaders_alone_are_exactly_at_their_ends_however_late():
    star, law, asks = [("l", "a", 1), ("l", "b", -1)], ptcc.NominalProtocol(), ptcc.Asks(simulation=False)
    certificate = ptcc.certify(star, law, [1, 3, 2], messages=ptcc.LateMessages("0.1"), asks=asks)
    assert certificate.late.largest == 0 and not told(certificate, "left")
