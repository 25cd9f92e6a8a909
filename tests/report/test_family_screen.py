"""The screens of families: few lines of 80 columns whatever the family, and a verdict the exit code agrees with."""

from __future__ import annotations

import itertools
import random
import re
from fractions import Fraction

import pytest
from asked import certify_family, family_certificate
from families import KINDS, random_family
from rich.cells import cell_len
from selection import thinned

import ptcc_certify as ptcc
from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.certificate.judgements import first_input
from ptcc_certify.errors import unlabelled
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Family, Mode
from ptcc_certify.model.asks import Expectations
from ptcc_certify.model.constrained_switching import DwellTime
from ptcc_certify.report.facts.claim import groups_text
from ptcc_certify.report.facts.graph import decision_facts
from ptcc_certify.report.page import report_html
from ptcc_certify.report.screen import certificate_lines, long_screen, short_screen, summary_lines
from ptcc_certify.theorems.family_behaviour import FamilyComponent, counterexample_text

pytestmark = pytest.mark.usefixtures("framed_figures", "quick_search")

PROTOCOL = ptcc.NominalProtocol(T=1, rho1=1, rho2=1, kappa=3)
LONG = "agent number {} of a rather long list of agents"
BEHAVIOURS = ("stability", "bipartite consensus", "interval bipartite consensus", "bipartite containment")


def renamed(family: Family, name: str) -> Family:
    """Return the family with other names of nodes and modes."""
    labels = tuple(name.format(k) for k in range(family.n_nodes))
    fields = ("source", "target", "sign", "lower", "upper")
    modes = (Mode(labels, *(getattr(m, f) for f in fields), name.format(m.name), m.tied) for m in family.modes)
    return Family(tuple(modes), family.notes)


def assert_fits(lines: list[str], most: int) -> None:
    assert len(lines) <= most, "\n".join(lines)
    for line in lines:
        assert cell_len(line) <= 80 and line.isprintable() and line == line.rstrip(), line


@pytest.mark.few(0)
@pytest.mark.parametrize("kind", KINDS)
def test_the_decision_of_any_family_fits_the_screen(kind: str):
    rng = random.Random(KINDS.index(kind))
    for case in range(6):
        family = random_family(rng, kind).family
        family = renamed(family, LONG) if case % 3 == 0 else family
        for signal in ("any", "constant"):
            components = ptcc.decide(family, signal)
            lines = short_screen(
                decision_facts(components, family, "g.csv", "row a,b: information flows a -> b; undirected")
            )
            assert_fits(lines, 14)  # of these up to 3 tell why, and 3 what each mode does alone
            told = long_screen(decision_facts(components, family, "g.csv"))
            assert len(components) > 1 or sum(line.startswith("claim") for line in told) == 1


@pytest.mark.few(0)
@pytest.mark.parametrize("kind", KINDS)
def test_the_certificate_of_any_family_fits_the_screen(kind: str):
    rng = random.Random(10 + KINDS.index(kind))
    family = random_family(rng, kind, nodes=3).family
    family = renamed(family, LONG) if KINDS.index(kind) % 2 else family
    cert = certify_family(family, PROTOCOL, "random", time_limit=3)
    lines = summary_lines(cert, "g.csv", {"read": "row a,b: information flows a -> b"})
    stays = any(line.startswith("x(t)") for line in lines)  # between which ends, where no end is claimed
    assert_fits(lines, 15 + stays + len(cert.parts) - 1)
    (verdict,) = (line for line in lines if line.startswith("verdict"))
    assert re.match("verdict    certified" if cert.verdict == "certified" else "verdict    undecided", verdict)
    assert cert.summary().splitlines()[-1] == lines[-1]
    assert certificate_lines(cert, "g.csv")[0].startswith(f"verdict    {cert.assessment.text}")


@pytest.mark.few(0)
def test_where_more_is_claimed_of_some_signals_every_line_says_of_which_it_is():
    line = ptcc.SignedDigraph.from_edges([("a", "b", 1), ("b", "c", -2)])
    pair = Family.switching([line, ptcc.SignedDigraph.from_edges([("b", "a", 1), ("a", "c", -1)])])
    depends = Family.switching([line, ptcc.SignedDigraph.from_edges([("a", "b", -1), ("b", "c", -1)])])
    asked = Expectations("bipartite consensus")
    for family, told in ((pair, "every signal)"), (depends, "these signals)")):
        for signal in ("any", DwellTime("0.4", clock="t")):
            cert = certify_family(family, PROTOCOL, [1, 2, 3], signal=signal, expectations=asked)
            marked = [
                line for line in certificate_lines(cert, "g.csv") if re.match(r"rate|x\(T|error|input|verdict", line)
            ]
            assert len(marked) == (5 if family is pair else 1 if signal == "any" else 2)
            assert {told in line for line in marked} == {signal != "any"}


@pytest.mark.few(0)
def test_the_gain_that_is_proposed_makes_the_bound_useful_and_bounds_the_input():
    edges = [("a", "b", 1), ("b", "c", -2)], [("b", "a", 1), ("a", "c", -1)]
    pair = Family.switching([ptcc.SignedDigraph.from_edges(some) for some in edges])
    slow = ptcc.NominalProtocol(T=1, rho1=1, rho2="0.1", kappa=2)
    for x0 in (None, [1, 2, 4]):
        cert = certify_family(pair, slow, x0)
        told = re.search(r"rho2=([0-9.]+) leaves 1 % and bounds the input", cert.assessment.text)
        assert cert.assessment.useful is False and told
        again = certify_family(pair, ptcc.NominalProtocol(T=1, rho1=1, rho2=told[1], kappa=2), x0)
        assert again.assessment.useful and again.bounded, x0


def test_where_no_rate_is_proved_the_line_says_why():
    cases = (
        (430, 1, 9, "(430 agents are above the 400"),
        (130, -1, 9, "(closed forms of 130 agents prove none)"),
        (60, -1, 0.01, "raise time_limit)"),
    )
    for size, sign, seconds, told in cases:
        ring = [(k, (k + 1) % size, 1 if k else sign) for k in range(size)]
        family = Family.from_graph(ptcc.SignedDigraph.from_edges(ring), uncertainty="10%")
        lines = certificate_lines(certify_family(family, PROTOCOL, time_limit=seconds), "g.csv")
        assert told in next(line for line in lines if line.startswith("rate"))


def test_every_refutation_is_told_in_words():
    """Each names agents or modes, and never an index or an internal kind."""
    rng, kinds = random.Random(5), set()
    for _ in range(30):
        family = random_family(rng, rng.choice(KINDS)).family
        for signal in ("any", "constant"):
            for component in ptcc.decide(family, signal):
                for behaviour in BEHAVIOURS:
                    if (why := component.refutation(behaviour)) is not None:
                        kinds.add(why.kind)
                        text = counterexample_text(component, why)
                        assert any(
                            name in text for name in (*component.family.labels, "leader group", "mode ", "the graph")
                        ), text
                        assert "Fraction" not in text and "  " not in text and text == text.strip()
    assert len(kinds) == 6


@pytest.mark.parametrize(
    "kind, told",
    [
        ("p", "the state p0=1, p1=1, p2=1, p3=1, ..."),
        ("v_protein", "the state v_protein0=1, ..."),
        ("v_protein_of_the_cell_", "a state at the camps of leader group 1"),
    ],
)
def test_the_edge_that_moves_a_state_is_told_however_long_the_names_are(kind, told):
    names = [f"{kind}{k}" for k in range(5)]
    rows = [(s, t, 1, 2) for s, t in itertools.pairwise(names)]
    family = Family.from_intervals([*rows, (names[4], names[0], 1, 2), (names[0], names[2], -1, 0)])
    (component,) = ptcc.decide(family)
    text = " ".join(" ".join(short_screen(decision_facts([component], family, "net"))).split())
    assert f"{told} rests at the least weights and moves with {names[0]} -> {names[2]} on" in text


def test_groups_are_told_once_each():
    """Of every agent it is told that it agrees, ends at 0, follows, or that no limit is claimed."""
    rng = random.Random(3)
    for _ in range(25):
        for component in ptcc.decide(random_family(rng, "depends").family):
            if component.behaviour == "depends on the signal":
                assert_once(component, unlabelled(groups_text(component)))


def many_followers(n: int) -> Family:
    """Return ``n`` followers, each of two leaders of its own, and one of all leaders, whose edge joins all."""
    own = [(f"{name}{k}", f"follower{k}", 1, 2) for k in range(n) for name in ("ann", "bob")]
    return Family.from_intervals([*own, *((s, "last", 1, 2) for s, *_ in own)])


def told(lines: list[str], head: str) -> str:
    """Return the text of an entry of a screen."""
    text = "\n".join(lines).replace("\n" + " " * 11, " ")
    return next(line[11:] for line in text.splitlines() if line.startswith(head))


@pytest.mark.few(0)
def test_many_agents_that_keep_their_value_and_many_intervals_are_counted_and_nothing_is_cut():
    family = many_followers(40)
    x0 = {label: k % 7 - k for k, label in enumerate(family.labels)}
    certificate = ptcc.read_certificate(certify_family(family, PROTOCOL, x0).to_dict())
    box = certificate.boxes[0]
    keep, intervals = (
        "80 agents that listen to nobody keep their value; ",
        len(set(zip(box.lower, box.upper, strict=True))),
    )
    assert intervals > 20
    page = re.sub(r"\s+", " ", re.sub("<[^>]+>", "", report_html(certificate)))
    short, long = summary_lines(certificate, "net"), certificate_lines(certificate, "net")
    for groups in (told(short, "groups"), told(long, "groups"), page):
        assert keep in groups and "(41 in all) end between these, up to signs, or move there for ever" in groups
    for boxes in (told(short, "box"), told(long, "box"), page):
        assert f"every signal draws 41 agents into {intervals} intervals in all, within [" in boxes
        assert "; no limit is claimed" in boxes and "... ..." not in boxes and "......" not in boxes
    for text in (told(lines, head) for lines in (short, long) for head in ("groups", "box")):
        assert not re.search(r"\.\.\. ?\.\.\.|\.\.\.$", text), text
    hull = [Fraction(x) for x in re.search(r"within \[(.*), (.*)\], at", told(short, "box")).groups()]
    assert hull[0] <= min(box.lower) and max(box.upper) <= hull[1]


def test_intervals_that_do_not_fit_the_short_screen_are_listed_on_the_long_one():
    family = many_followers(3)
    certificate = certify_family(family, PROTOCOL, range(family.n_nodes))
    assert "4 agents into " in told(summary_lines(certificate, "net"), "box")
    assert all(f"follower{k} into [" in told(certificate_lines(certificate, "net"), "box") for k in range(3))


def test_many_groups_that_agree_are_counted():
    pairs = [(f"a{k}", f"b{k}", 1, 2) for k in range(5)] + [(f"b{k}", f"a{k}", 1, 2) for k in range(5)]
    (component,) = ptcc.decide([*pairs, *((f"a{k}", "last", 1, 2) for k in range(5))])
    assert unlabelled(groups_text(component)).startswith(
        "5 groups, of 10 agents in all, agree each within itself; last ends between"
    )


def assert_once(component: FamilyComponent, text: str) -> None:
    words = re.findall(r"n\d+", text)
    assert len(words) == len(set(words))
    assert set(words) == set(component.family.labels) or "in all" in text, text


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("sigma0", "mu3"), thinned([([1, "-1/2", 0], "0.1"), (None, "0.1"), ([1, "-1/2", 0], 1), (None, 1)], 2)
)
def test_the_screen_of_a_family_that_slides_is_short_and_tells_of_disturbances(sigma0, mu3):
    unsure = Family.from_intervals([("a", "b", 1, 2), ("b", "a", 1, 1), ("b", "c", -2, -1)])
    protocol = ptcc.SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=3, mu1=2, mu2=1, mu3=mu3, delta=1)
    certificate = certify_family(unsure, protocol, [1, 2, 3], sigma0=sigma0, time_limit=60)
    lines, more = summary_lines(certificate, "unsure"), "\n".join(certificate_lines(certificate, "unsure"))
    text = "\n".join(lines)
    assert len(lines) <= 11 and max(map(len, lines)) <= 80
    assert "for every signal and disturbance" in text
    assert ("T_r + 0.99 T_s" in text) == ("reaching time" in more) == (sigma0 is not None)
    if mu3 == "0.1" and sigma0:
        assert "of the sliding part nothing is proved" in text and "mu3=" in more
    else:
        assert "bounded; |u_k| <=" in text


def test_a_wish_is_refuted_by_an_input_that_some_member_has_at_the_start():
    """The largest first input is that of a vertex: no member of a random family exceeds it, and one attains it."""
    rng = random.Random(1)
    for _ in range(25):
        family = random_family(rng, "any", nodes=3).family
        x = [Fraction(rng.randint(-5, 5)) for _ in range(3)]
        certificate = _shell(family, tuple(x))
        largest = first_input(certificate)
        assert largest == max(_member_input(mode, x, rng) for mode in family.modes) * PROTOCOL.gain.first


def _shell(family: Family, x: tuple[Fraction, ...]) -> Certificate:
    return family_certificate(family, PROTOCOL, (), x)


def _member_input(mode: Mode, x: list[Fraction], rng: random.Random) -> Fraction:
    """Return the largest ``|(L x)_k|`` over the vertices of a mode, each agent by itself."""
    best = Fraction(0)
    for k in range(len(mode.labels)):
        into = [e for e in range(mode.n_edges) if mode.target[e] == k]
        for mask in range(2 ** len(into)):
            on = [e for j, e in enumerate(into) if mask >> j & 1]
            if len({int(mode.source[e]) for e in on}) == len(on):  # of two signs on a pair one is on
                terms = (
                    (mode.upper if e in on else mode.lower).fraction(e) * (x[k] - int(mode.sign[e]) * x[mode.source[e]])
                    for e in into
                )
                best = max(best, abs(sum(terms, Fraction(0))))
    return best


def test_consensus_is_called_by_its_sharpest_name():
    undirected = ptcc.decide(Family.from_intervals([("a", "b", 1, 2), ("b", "c", -2, -1)], undirected=True))
    positive = ptcc.decide([("a", "b", 1, 2), ("b", "a", 0, 1)])
    lines = [short_screen(decision_facts(parts, parts[0].family, "g"))[1] for parts in (undirected, positive)]
    assert lines[0].startswith("claim      signed-average consensus for every signal")
    assert lines[1].startswith("claim      consensus for every signal")


def test_python_takes_a_family_in_many_forms():
    day, night = ptcc.as_graph([("a", "b", 1), ("b", "a", 1)]), ptcc.as_graph([("a", "b", 2), ("b", "a", 3)])
    forms = [{"day": day, "night": night}, [day, night], Family.switching({"day": day, "night": night})]
    made = {ptcc.certify(form, PROTOCOL) for form in forms}
    assert all(repr(one) == repr(next(iter(made))) for one in made)
    asked = ptcc.certify(forms[0], PROTOCOL, [1, 2], asks=ptcc.Asks(expectations=Expectations("stability")))
    assert asked.assessment.asked == "refuted" and int(asked.assessment.exit_code) == 3
    known = ptcc.certify(Family.from_graph(day), PROTOCOL, asks=ptcc.Asks(simulation=False))
    assert isinstance(known, ptcc.Certificate)


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (
            lambda: ptcc.certify(Family.from_intervals([("a", "b", 1, 2)]), PROTOCOL, asks=ptcc.Asks(at="0.5")),
            "at is not for families",
        ),
        (
            lambda: ptcc.certify("fig1a", PROTOCOL, uncertainty="10%", asks=ptcc.Asks(method="lmi")),
            "method is not for families",
        ),
        (lambda: ptcc.certify("fig1a", PROTOCOL, uncertainty=3), "not from 0 to 1"),
        (lambda: ptcc.certify({}, PROTOCOL), "at least one mode"),
        (lambda: ptcc.certify(Family.from_intervals([("a", "b", 1, 2)]), 5), "protocol = 5 is none"),
        (lambda: ptcc.decide("fig1a", "sometimes"), 'signals are "any" or "constant", not "sometimes"'),
        (lambda: ptcc.as_family(Family.from_intervals([("a", "b", 1, 2)]), uncertainty=0.1), "leave out uncertainty"),
        (lambda: Family.from_graph([("a", "b", 1)]), "is no SignedDigraph"),
    ],
)
def test_a_call_that_does_not_fit_a_family_is_one_line(call, says: str):
    with pytest.raises(ptcc.PTCCError, match=re.escape(says)) as refused:
        call()
    assert "\n" not in str(refused.value)


def test_a_family_without_a_name_is_told_by_its_size():
    unsure = Family.from_intervals([("a", "b", 0, 1)])
    assert repr(unsure) == "Family(2 nodes, 1 of 1 weights uncertain, 1 edge optional)"
    cert = certify_family(unsure, ptcc.NominalProtocol(T=1, rho1=1, rho2=1, kappa=3))
    assert cert.summary().splitlines()[1].split() == ["family", "2", "nodes,", "1", "edge,", "1", "optional"]


def test_more_functions_than_the_check_takes_are_left_out_and_nothing_rests_on_them(monkeypatch: pytest.MonkeyPatch):
    pairs = [(s, t, 1, high) for k in range(3) for s, t, high in ((f"a{k}", f"b{k}", 2), (f"b{k}", f"a{k}", 1))]
    monkeypatch.setattr("ptcc_certify.checker.row_functions.MANY_FUNCTIONS", 2)
    refused = certify_family(Family.from_intervals(pairs), PROTOCOL, range(6), time_limit=60)
    told = "\n".join(summary_lines(refused, "pairs")).replace("\n           ", " ")
    assert refused.verdict == "undecided" and "more than 2 Lyapunov functions" in (refused.checked.reason or "")
    assert "the independent check rejects" in told
    assert not any(f"\n{entry}" in told for entry in ("claim", "rate", "x(T)", "error", "input"))
    monkeypatch.setattr("ptcc_certify.certificate.family_certification.MANY_FUNCTIONS", 2)
    fewer = certify_family(Family.from_intervals(pairs), PROTOCOL, range(6), time_limit=60)
    assert fewer.verdict == "certified" and not any(part.functions for part in fewer.parts)
    assert any("more than 2 Lyapunov functions" in note for note in fewer.notes)
    assert set(fewer.behaviours) == {"bipartite consensus"}


def test_a_mode_of_several_parts_is_called_by_one_word():
    graphs = {"first": [("ann", "bob", 1)], "second": [("bob", "eve", -1)]}
    nodes = ["ann", "bob", "eve"]
    family = Family.switching({name: SignedDigraph.from_edges(edges, nodes) for name, edges in graphs.items()})
    protocol = ptcc.NominalProtocol(T=1, rho1=1, rho2=1, kappa=2)
    text = " ".join(" ".join(summary_lines(ptcc.certify(family, protocol, signal=DwellTime("0.5")), "two")).split())
    assert "first: containment, in 2 separate parts; second: bipartite containment, in 2 separate parts" in text
    assert "decides: first: containment; second: bipartite containment; how near" in text
