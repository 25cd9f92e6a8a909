"""Late messages and moving leaders on the command line, from certify to check, plot and the page."""

from __future__ import annotations

import csv
import io
import json
import re
from dataclasses import replace
from fractions import Fraction
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from asked import certify_words
from bad_inputs import ptcc
from selection import thinned

from ptcc_certify import (
    Expectations,
    GainLimits,
    LateMessages,
    MovingLeaders,
    NominalProtocol,
    SignedDigraph,
    analyse,
    certify,
    read_certificate,
    read_graph,
    simulate,
)
from ptcc_certify.certificate import section_io
from ptcc_certify.errors import ParameterError
from ptcc_certify.model.asks import Asks
from ptcc_certify.simulation.late_messages import simulate_late

pytestmark = pytest.mark.usefixtures("framed_figures")

TEAM = "source,target,weight,delay\na,b,1,0.01\nb,c,1,0.02\nc,b,1,0.01\nc,d,-2,0.005\n"
CHAIN = "source,target,weight\na,b,1\nb,c,-1\n"
SCENARIO = """[graph]
file = "team.csv"
[protocol]
rho2 = 4
kappa = 1
[initial_state]
x0 = [1, 3, 4, -4]
[certificate]
method = "paper"
simulation = false
"""
PAPER = ("--method", "paper", "--no-simulation")
QUICK = ("--rho2", "4", "--kappa", "1", *PAPER)
START = ("--x0", "1,3,4,-4")


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("team.csv").write_text(TEAM)
    Path("chain.csv").write_text(CHAIN)
    Path("none.csv").write_text("a\nb\n")
    Path("bare.csv").write_text("a,b,1\n")
    Path("group.csv").write_text("a,b,1\nb,a,1\nb,c,1\n")
    return tmp_path


@pytest.mark.few(0)
def test_a_certificate_with_late_messages_is_accepted_and_read_back_as_it_was_made() -> None:
    run = ptcc("certify", "team.csv", "--delay", "delay", *START, *QUICK, "-o", "c.json")
    assert run.code == 0, run
    assert "messages   up to 0.02 old" in run.out
    assert "certified" in run.out
    assert ptcc("check", "c.json").code == 0
    late, section = read_certificate("c.json").late, json.loads(Path("c.json").read_text())["messages"]
    assert late is not None
    assert late.steps is not None
    assert section["latency"] == ["1/100", "1/100", "1/50", "1/200"]  # in the order of listeners: b from a and c, c, d
    assert float(max(late.residual)) == late.largest  # type: ignore[arg-type]
    saved = read_certificate("c.json")
    motion = simulate_late(saved.graph, saved.protocol, late.messages, [1, 3, 4, -4], steps=300)
    assert np.abs(motion.states[:, -1] - [1, 1, 1, -1]).max() <= late.largest


@pytest.mark.few(0)
def test_a_behaviour_asked_for_at_T_is_refuted_where_an_agent_is_proved_to_miss_it() -> None:
    run = ptcc("certify", "team.csv", "--delay", "0.02", *START, *QUICK, "--expect", "bipartite-consensus")
    assert run.code == 3, run
    words = " ".join(run.out.split())
    assert "refuted: bipartite consensus at T with late messages (agent" in words
    assert "at least, proved)" in words
    met = ptcc("certify", "team.csv", "--delay", "0.02", *START, *QUICK, "--max-residual", "0.1")
    assert met.code == 0, met
    left = ptcc("certify", "team.csv", "--delay", "0.02", *START, *QUICK, "--max-residual", "0.001")
    assert left.code == 4, left
    assert "this certificate's limit is" in " ".join(left.out.split())


@pytest.mark.few(0)
@pytest.mark.parametrize(
    ("graph", "delay", "more", "status"),
    thinned(
        [
            ("team.csv", "0.02", ("--max-residual", "0.1"), "met"),
            ("team.csv", "0.02", ("--max-residual", "0.001"), "left open"),
            ("ring.csv", "0.01", ("--max-residual", "1", "--gain-cap", "5"), "met"),
            ("ring.csv", "0.5", ("--max-residual", "1.5", "--gain-cap", "5"), "left open"),
            ("ring.csv", "0.02", ("--max-residual", "0.15", "--gain-cap", "5"), "left open"),
            ("ring.csv", "0.0001", ("--max-residual", "2", "--gain-cap", "5", "--own-delay"), "met"),
        ],
        3,
    ),
)
def test_the_delay_up_to_which_a_wanted_residual_is_told_to_be_certified_is_certified(
    graph: str, delay: str, more: tuple[str, ...], status: str
) -> None:
    Path("ring.csv").write_text("a,b,1\nb,a,1\nb,c,-2\nc,d,1.5\nd,c,0.7\na,d,-1\n")
    gains = QUICK if graph == "team.csv" else PAPER
    run = ptcc("certify", graph, "--delay", delay, *more, *START, *gains)
    text = " ".join(run.out.partition("verdict")[2].split())
    told = re.search(r"certified where nothing is older than ([\d.]+\d)", text)
    assert text.startswith(status) and told is not None, run
    again = ptcc("certify", graph, "--delay", told[1], *more, *START, *gains)
    assert "verdict    met: within" in again.out, again


def test_no_delay_is_told_that_the_check_does_not_accept(monkeypatch: pytest.MonkeyPatch) -> None:
    words = ("team.csv", "--delay", "0.02", "--max-residual", "0.001", *START, *QUICK)
    monkeypatch.setattr(
        "ptcc_certify.certificate.certification.longest_delay",
        lambda late, _: replace(late, residual=np.zeros(4), case=replace(late.case, messages=LateMessages("0.01"))),
    )
    assert "older" not in ptcc("certify", *words).out


@pytest.mark.few(0)
@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ("--delay", "0.005", "--gain-cap", "50"),
            "left open: bipartite consensus at T with late messages (nothing settles under",
        ),
        (
            ("--quantisation", "0.1"),
            "left open: bipartite consensus at T with inexact messages (nobody is proved to settle at T)",
        ),
        (
            ("--delay", "0.005", "--max-input", "1e6"),
            "; a gain without a cap makes ever more of what is left at T: add --gain-cap)",
        ),
        (("--leader-speed", "1", "--max-input", "100"), "left open: |u_k| <= 100 (proved: "),
        (("--leader-speed", "1", "--max-input", "1"), "refuted: |u_k| <= 1 (it is up to"),
    ],
)
def test_what_holds_without_late_messages_and_with_leaders_at_rest_is_not_said_to_be_met(
    words: tuple[str, ...], said: str
) -> None:
    run = ptcc("certify", "team.csv", *words, *START, *QUICK, *("--expect", "bipartite-consensus") * ("open" in said))
    assert said in " ".join(run.out.split()), run
    assert run.code == (3 if said.startswith("refuted") else 4), run


@pytest.mark.few(0)
def test_a_behaviour_and_an_input_are_met_where_they_are_proved_of_late_messages_and_moving_leaders() -> None:
    capped = ptcc("certify", "team.csv", "--delay", "0.005", "--gain-cap", "50", "--max-input", "1e6", *START, *QUICK)
    assert capped.code == 0 and "met: |u_k| <= 1000000" in " ".join(capped.out.split()), capped
    assert "bounded up to T; |u_k| <= " in capped.out
    star = ("--delay", "0.1", "--expect", "bipartite-consensus")  # all listen to a leader at rest alone
    Path("star.csv").write_text("a,b,1\na,c,-1\n")
    assert ptcc("certify", "star.csv", *star, "--x0", "1,0,2", *QUICK).code == 0
    moving = ("--leader-speed", "1", "--expect", "bipartite-consensus", "--max-input", "1e6")
    assert ptcc("certify", "team.csv", *moving, *START, *QUICK).code == 0


def test_followers_without_a_cycle_are_told_deadlines_of_stages() -> None:
    run = ptcc("certify", "chain.csv", "--delay", "0.1", "--x0", "1,0,2", *QUICK)
    assert run.code == 0, run
    assert "deadlines of their own, from 0.9 to 1, 0.1 apart" in " ".join(run.out.split())
    late = ptcc("certify", "chain.csv", "--delay", "2", "--x0", "1,0,2", *QUICK)
    assert "information takes longer than T" in " ".join(late.out.split())


@pytest.mark.few(0)
def test_a_scenario_holds_what_the_flags_say() -> None:
    flags = ("--delay", "0.005", "--period", "0.01", "--packet-loss", "3", "--quantisation", "0.1")
    Path("s.toml").write_text(
        SCENARIO + "[messages]\ndelay = 0.005\nperiod = 0.01\npacket_loss = 3\nquantisation = 0.1\n"
    )
    one, other = ptcc("certify", "s.toml", "--json"), ptcc("certify", "team.csv", *flags, *START, *QUICK, "--json")
    assert one.code == other.code == 0, (one, other)
    sections = [json.loads(run.out)["messages"] for run in (one, other)]
    assert sections[0] == sections[1]
    assert sections[0]["delay"] == "9/200"
    assert sections[0]["value_error"] == "1/20"


def test_followers_track_leaders_that_move_and_the_file_says_so() -> None:
    run = ptcc("certify", "team.csv", "--leader-speed", "1", *START, *QUICK, "-o", "l.json")
    assert run.code == 0, run
    assert re.search(r"on its target at T = 1, within \S+ of it from then on", " ".join(run.out.split()))
    assert ptcc("check", "l.json").code == 0
    late = read_certificate("l.json").late
    assert late is not None and late.tracks and late.largest_bound([1.0]).max() == 0
    sign = ptcc("certify", "team.csv", "--leader-speed", "1", "--sign-gain", "1", *START, *QUICK)
    assert "ever after" in sign.out


@pytest.mark.few(0)  # one of each option
@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ("a,b,0,0.9\na,b,-2,0.0001", ("--drop-zeros",)),
        ("a,b,-2,0.9\na,b,-2,0.0001", ("--duplicates", "last")),
        ("a,b,-2,0.0001\na,b,0,0.9", ("--drop-zeros",)),
        ("a,b,-2,0.0001\nb,b,1,0.9", ("--drop-self-loops",)),
        ("a,b,0,0.9\na,b,-2,0.9\na,b,-2,0.0001", ("--duplicates", "last", "--drop-zeros")),
    ],
)
def test_the_delay_of_a_row_that_was_dropped_is_dropped_with_it(rows: str, words: tuple[str, ...]) -> None:
    """That of a row of weight 0, or of an earlier row, stayed on the edge, and the wish was refuted."""
    Path("rows.csv").write_text(f"source,target,weight,delay\nl,a,1,0.0001\n{rows}\n")
    asked = ("--delay", "delay", "--x0", "l=3,a=-5,b=2", "--max-residual", "1e-3", *QUICK)
    run = ptcc("certify", "rows.csv", *words, *asked, "-o", "rows.json")
    assert run.code == 0 and "messages   up to 0.0001 old" in run.out, run
    lagging = f"source,target,weight_min,weight_max,delay\nl,a,1,1,0.0001\n{rows}\n"
    lagging = re.sub(r"^([ab],b),(\S+?),", r"\1,\2,\2,", lagging, flags=re.M)
    Path("lagging.csv").write_text(lagging)
    if "--duplicates" not in words:
        assert "up to 0.0001 old" in ptcc("certify", "lagging.csv", *words, "--delay", "delay").out
    told = " ".join(ptcc("check", "rows.json", "rows.csv", *words).out.split())
    assert "accepted" in told and "delays are the certificate's own, not compared" in told


def test_where_nothing_is_proved_of_moving_leaders_the_screen_says_why() -> None:
    Path("tiny.csv").write_text("l,a,1e-20\na,b,1\nb,a,1\n")
    run = ptcc("certify", "tiny.csv", "--leader-speed", "1", "--x0", "1,2,3", *QUICK)
    assert run.code == 4 and "leaders    speed |x_j'| <= 1" in run.out, run
    assert "TRACKING   nothing is proved: no vector for the followers was found" in run.out


@pytest.mark.parametrize(
    "words", [("--delay", "0.01"), ("--leader-speed", "0"), ("--leader-speed", "0.1", "--rho2", "9")]
)
def test_agents_that_begin_on_their_targets_are_not_said_to_get_little_nearer(words: tuple[str, ...]) -> None:
    """Nothing is left but the least float, or what leaders at this speed leave; there was nothing to come nearer by."""
    run = ptcc("certify", "chain.csv", "--x0", "1,1,-1", *QUICK, *words)
    assert run.code == 0 and "verdict    certified" in run.out and "little" not in run.out, run


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("team.csv", "--delay=-1"), "delay = -1 is outside its domain; delay must be >= 0"),
        (("team.csv", "--delay", "nan"), '--delay: "nan" is not a finite number'),
        (("team.csv", "--delay", "0"), "nor rounded; give --delay, --period or --quantisation above 0"),
        (("team.csv", "--quantisation", "0"), "nor rounded; give --delay, --period or --quantisation above 0"),
        (("team.csv", "--delay", "0.1", "--period", "0"), "period = 0 is outside its domain"),
        (("none.csv", "--delay", "0.1"), "--delay: nobody listens to anybody; leave it out, or add edges"),
        (("none.csv", "--quantisation", "1"), "--quantisation: nobody listens to anybody; leave it out"),
        (("none.csv", "--leader-speed", "1"), "--leader-speed: nobody listens to anybody; leave it out"),
        (("team.csv", "--delay", "0.1", "--packet-loss", "3"), "--packet-loss says nothing by itself; give --period"),
        (("team.csv", "--max-residual", "1"), "--max-residual is asked of late messages"),
        (("team.csv", "--delay", "0.1", "--initial-bound", "1"), "--initial-bound is not taken up"),
        (("team.csv", "--leader-speed", "1", "--initial-bound", "1"), "--initial-bound is not taken up"),
        (("team.csv", "--delay", "0.1", "--stop-before", "0.1"), "--stop-before: late messages are certified under a"),
        (("team.csv", "--delay", "0.1", "--sample-period", "0.1"), "--sample-period: of late messages a period tells"),
        (("group.csv", "--delay", "0.1", "--noise", "1"), "a leads and hears others: add a gain cap"),
        (("group.csv", "--delay", "0.1", "--delta", "1"), "a leads and hears others: add a gain cap"),
        (
            ("team.csv", "--leader-speed", "1", "--stop-before", "0.1"),
            "one gain cap alone is certified; leave others out",
        ),
        (("team.csv", "--uncertainty", "1%", "--delay", "none"), 'no column "none"; add it, or name one of source'),
        (("group.csv", "--uncertainty", "1%", "--leader-speed", "1"), "a leads and hears others: leave it out"),
        (("group.csv", "--uncertainty", "1%", "--delay", "0.1"), "a leads and hears others: add a gain cap"),
        (("team.csv", "--uncertainty", "1%", "--max-residual", "1"), "--max-residual is asked of late messages"),
        (("team.csv", "--delay", "1e"), "give a number in your unit of time, or the name of a column"),
        (("team.csv", "--delay", "latency"), 'team.csv, line 1: no column "latency"; add it, or name one of'),
        (("bare.csv", "--delay", "lag"), 'line 1: no column "lag"; begin with a header source,target,weight,lag'),
        (("team.csv", "--packet-loss", "3"), "--packet-loss says nothing by itself; give --period"),
        (("team.csv", "--own-delay"), "--own-delay says nothing by itself; give --delay"),
        (  # the pair of allies has the eigenvalue 2: pi/2 / (2 * 0.1)
            ("group.csv", "--delay", "0.1", "--own-delay"),
            "add --gain-cap (with this delay a constant gain diverges above 7.85, numerical; what is",
        ),
        (("group.csv", "--quantisation", "0.1", "--own-delay"), "add --gain-cap, or measure the own state without"),
        (("group.csv", "--delay", "0.1"), "needs leaders that listen to nobody; a and b are leaders of one group"),
        (("group.csv", "--leader-speed", "1"), "needs leaders that listen to nobody; a and b are leaders of one group"),
        (("team.csv", "--sign-gain", "1"), "--sign-gain belongs to leaders that move; give --leader-speed"),
        (("team.csv", "--leader-speed", "1", "--sign-gain", "0.5"), "is below speed + disturbance = 1"),
        (("team.csv", "--leader-speed=-1"), "speed = -1 is outside its domain"),
        (
            ("team.csv", "--leader-speed", "1", "--delay", "1", "--own-delay", "--gain-cap", "9"),
            "--own-delay: an own state that is late is certified of leaders at rest alone; leave one of the two out",
        ),
        (("group.csv", "--leader-speed", "1", "--delay", "1"), "leaders that move: a bound needs leaders"),
        (("group.csv", "--leader-speed", "1", "--delay", "1", "--gain-cap", "9"), "a and b are leaders of one group"),
        (("team.csv", "--leader-speed", "1", "--delay", "1", "--stop-before", "0.1"), "--stop-before: late messages"),
        (
            ("team.csv", "--delay", "1", "--agents", "double-integrator"),
            "--delay: is not proved of agents of order n; let them exchange virtual positions: --exchange virtual; or",
        ),
        (
            ("team.csv", "--leader-speed", "1", "--agents", "double-integrator"),
            "--leader-speed: is not proved of agents of order n; let them exchange virtual positions: --exchange",
        ),
    ],
)
def test_what_cannot_be_is_refused_in_one_line_that_tells_what_to_do(words: tuple[str, ...], said: str) -> None:
    run = ptcc("certify", *words)
    assert run.code == 2, run
    assert said in run.err
    assert len(run.err.strip().splitlines()) == 1


def test_a_delay_of_a_row_that_is_no_number_is_named_by_its_line() -> None:
    Path("odd.csv").write_text("source,target,weight,delay\na,b,1,soon\n")
    run = ptcc("certify", "odd.csv", "--delay", "delay")
    assert run.code == 2
    assert 'odd.csv, line 2: delay "soon" of edge a -> b is not a number; give a number >= 0' in run.err


@pytest.mark.few(0)
def test_small_delays_of_a_leader_group_are_certified_under_a_cap_up_to_a_limit_that_is_told() -> None:
    group, protocol = SignedDigraph.from_edges([(1, 2, 1), (2, 1, 1), (2, 3, -1)]), NominalProtocol(1, 1, 2, 1)
    cert = certify(
        group,
        protocol,
        [3, 1, 2],
        messages=LateMessages(delay="0.0002", own_delay=True, gain_cap=20),
        asks=Asks(simulation=False, method="paper"),
    )
    assert cert.verdict == "certified"
    assert cert.late is not None
    assert cert.late.form is not None
    assert 0.0002 < (cert.late.longest_delay or 0) < 0.1
    long = certify(
        group,
        protocol,
        [3, 1, 2],
        messages=LateMessages(delay="0.5", gain_cap=20),
        asks=Asks(simulation=False, method="paper"),
    )
    assert int(long.assessment.exit_code) == 4
    assert "this certificate's limit is a delay of" in long.assessment.text


@pytest.mark.few(0)
def test_followers_of_a_leader_group_are_certified_without_a_cap_where_the_leaders_hear_each_other_at_once() -> None:
    Path("led.csv").write_text("source,target,weight,delay\np,q,1,0\nq,p,2,0\np,f,-1,0.01\nf,g,1,0.02\ng,f,0.5,0.02\n")
    words = ("certify", "led.csv", "--delay", "delay", "--rho2", "12", *START, *PAPER)
    run = ptcc(*words, "--max-residual", "1", "--at", "0.9", "-v", "-o", "c.json")
    text = " ".join(run.out.split())
    assert run.code == 0 and "leaders hear each other at once, and settle by themselves" in text, run
    assert re.search(r"met: within 1 at T \(certified where nothing is older than 0.\d+, all delays in prop", text)
    assert "at t = 0.9 every agent within" in text and ptcc("check", "c.json").code == 0
    saved = read_certificate("c.json").late
    assert saved is not None and saved.settling is not None and saved.largest <= 1
    assert ptcc("report", "c.json", "-o", "c.html").code == ptcc("plot", "c.json", "--what", "late").code == 0
    capped = ptcc(*words, "--gain-cap", "30")
    assert capped.code == 0 and "input      bounded up to T" in capped.out, capped
    held = ptcc(*words, "--period", "0.01").err
    assert "let leaders hear each other at once (delays of 0 within their group, and no period)" in held
    off = ptcc(*(word for word in words if word not in PAPER), "--quantisation", "0.1").err
    assert "nothing is proved yet where leaders hear others; p leads and hears others: add a gain cap" in off
    assert ptcc(*words, "--quantisation", "0.1", "--gain-cap", "30").code in (0, 4)


def test_a_leader_group_without_an_initial_state_is_told_that_it_needs_one() -> None:
    group = [("p", "q", 1), ("q", "p", 2), ("p", "f", -1)]
    late = LateMessages({("p", "f"): "0.01"})
    open_ = certify(
        group, NominalProtocol(T=1, rho1=1, rho2=4, kappa=1), messages=late, asks=Asks(simulation=False, method="paper")
    ).assessment
    assert "nothing is proved of what is left at T; give an initial state" in open_.text


def test_messages_that_take_longer_than_the_deadline_are_certified_to_leave_what_was_there_at_first() -> None:
    run = ptcc("certify", "chain.csv", "--delay", "5", "--x0", "1,0,2", *QUICK)
    assert run.code == 0, run


@pytest.mark.few(0)
def test_screens_say_first_what_cannot_be_and_then_what_is_left() -> None:
    run = ptcc("certify", "chain.csv", "--delay", "0.02", "--x0", "1,0,2", *QUICK)
    heads = [line.split()[0] for line in run.out.splitlines() if not line.startswith(" ")]
    assert heads == ["verdict", "graph", "read", "protocol", "messages", "late", "INPUT", "claim", "x(T)"]
    words = " ".join(run.out.split())
    assert "late agent c is off its final state at T by" in words
    assert words.index("at least, if none comes sooner") < words.index("every agent within") < words.index("claim")
    assert "by agent: b " in ptcc("certify", "chain.csv", "--delay", "0.02", "--x0", "1,0,2", *QUICK, "-v").out
    Path("star.csv").write_text("a,b,1\na,c,-1\n")
    star = ptcc("certify", "star.csv", "--delay", "0.02", *QUICK, "--expect", "bipartite-consensus")
    assert star.code == 0, star
    assert "every agent exactly at its final state at T" in star.out


def test_delays_of_a_column_are_those_of_uncertain_edges_too() -> None:
    """Of intervals and several files as well; of an edge in two files the larger one counts."""
    Path("day.csv").write_text("source,target,weight,lag\nl,a,1,0.001\na,b,-2,0.03\nb,a,-0.5,0\nl,b,-1,0.01\n")
    rows = "l,a,0.8,1.2,0.002\na,b,-2.2,-2,0.02\nb,a,-0.5,-0.4,0\nl,b,-1,-1,0.01\n"
    Path("night.csv").write_text(f"source,target,weight_min,weight_max,lag\n{rows}")
    start, largest = ("--x0", "1,2,-3", "--kappa", "3", "-o", "c.json"), Fraction(3, 100)
    for words in (("day.csv", "--uncertainty", "10%"), ("night.csv",), ("day.csv", "night.csv", "--switching")):
        run = ptcc("certify", *words, "--delay", "lag", *start)
        assert run.code == 0 and 'delays of column "lag"' in run.out, run
        messages = read_certificate("c.json").late.messages
        assert messages.age == (Fraction(1, 50) if words == ("night.csv",) else largest)
        assert messages.delay["b", "a"] == 0
        assert messages.delay["l", "a"] == Fraction(2 if "night.csv" in words else 1, 1000)


def test_a_column_of_delays_is_named_and_not_called_ignored() -> None:
    run = ptcc("certify", "team.csv", "--delay", "delay", *START, *QUICK)
    assert 'delays of column "delay"' in run.out
    assert "ignored" not in run.out
    assert "up to 0.02 old, edge by edge" in run.out


def test_a_late_own_state_beyond_the_threshold_of_constant_gain_is_said_to_diverge() -> None:
    run = ptcc("certify", "group.csv", "--delay", "0.5", "--own-delay", "--gain-cap", "20", *QUICK)
    assert run.code == 4, run
    assert "at a constant gain of 20 agents diverge with delays above 0.0393" in run.out  # pi/2 / (20 * 2)


def test_a_gain_at_which_the_bound_of_small_delays_is_singular_is_no_defect() -> None:
    run = ptcc("certify", "team.csv", "--delay", "0.05", "--gain-cap", "20", *PAPER)
    assert run.code == 0, run


def test_bounds_are_told_at_an_instant_that_is_asked_for() -> None:
    late = ptcc("certify", "team.csv", "--delay", "0.02", *START, *QUICK, "--at", "0.5")
    assert "at t = 0.5 every agent within" in late.out
    tracking = ptcc("certify", "team.csv", "--leader-speed", "1", *START, *QUICK, "--at", "0.5")
    assert "of it at t = 0.5" in tracking.out


def test_an_input_that_is_not_bounded_while_leaders_move_is_told_with_the_gain_that_bounds_it() -> None:
    weak = ptcc("certify", "team.csv", "--leader-speed", "1", *START, *PAPER, "--rho2", "0.1", "--kappa", "1")
    least = re.search(r"INPUT      not proved bounded while leaders move; --rho2 (\S+) bounds it", weak.out)
    assert least is not None, weak
    strong = ptcc("certify", "team.csv", "--leader-speed", "1", *START, *PAPER, "--rho2", least[1], "--kappa", "1")
    assert "input      bounded up to T" in strong.out, strong
    verdict = " ".join(weak.out.partition("verdict")[2].split())
    assert f"the input is not proved bounded; --rho2 {least[1]} bounds the input" in verdict


@pytest.mark.few(0)
def test_the_verdict_with_late_messages_is_about_these_and_proposes_no_gains_for_messages_at_once() -> None:
    weak = (*PAPER, "--rho2", "0.1", "--kappa", "1")
    for words, caveat in (((), "the input is not proved bounded"), (("--gain-cap", "1"), "")):
        run = ptcc("certify", "team.csv", "--delay", "0.02", *START, *weak, *words)
        verdict = " ".join(run.out.partition("verdict")[2].split())
        assert caveat in verdict and "--rho2" not in verdict, run


@pytest.mark.few(0)
def test_a_delay_that_would_do_is_told_as_an_age() -> None:
    lost = ("--delay", "0.005", "--period", "0.01", "--packet-loss", "3", "--max-residual", "0.001")
    run = ptcc("certify", "team.csv", *lost, *START, *QUICK)
    assert "certified where nothing is older than 0.0" in " ".join(run.out.split()), run


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("design", "--max-input", "9", "--initial-bound", "1", "--deadline", "1"), "ptcc design does not take late"),
        (("plot", "--what", "states"), "ptcc plot --what states does not take late messages"),
    ],
)
def test_commands_that_would_leave_late_messages_out_refuse_their_scenario(words: tuple[str, ...], said: str) -> None:
    Path("s.toml").write_text(SCENARIO + "[messages]\ndelay = 0.005\n")
    run = ptcc(words[0], "s.toml", *words[1:])
    assert run.code == 2, run
    assert said in run.err
    assert ptcc("classify", "s.toml").code == ptcc("plot", "s.toml", "--what", "graph").code == 0


def test_delays_of_many_edges_stand_in_a_side_file(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(section_io, "LONG", 3)
    run = ptcc("certify", "team.csv", "--delay", "delay", *START, *QUICK, "-o", "c.json")
    assert run.code == ptcc("check", "c.json").code == 0, run
    section, messages = json.loads(Path("c.json").read_text())["messages"], read_certificate("c.json").late.messages
    assert section["latency"]["count"] == 4 and section["latency"]["scale"] == "200"
    given = {
        edge: Fraction(x) for edge, x in zip(("ab", "bc", "cb", "cd"), ("0.01", "0.02", "0.01", "0.005"), strict=True)
    }
    assert {"".join(edge): x for edge, x in messages.delay.items()} == given


def table(text: str) -> dict[str, np.ndarray]:
    """Return the columns of a run by their heads."""
    head, *rows = csv.reader(io.StringIO(text))
    return dict(zip(head, np.array(rows, dtype=float).T, strict=True))


@pytest.mark.few(0)
@pytest.mark.parametrize(
    ("words", "messages", "pattern"),
    [
        (("--delay", "0.05"), LateMessages(delay="0.05"), "oldest"),
        (("--delay", "0.01", "--period", "0.02", "--packet-loss", "2"), LateMessages("0.01", "0.02", 2), "square"),
        (
            ("--delay", "0.01", "--own-delay", "--gain-cap", "9"),
            LateMessages("0.01", own_delay=True, gain_cap=9),
            "oldest",
        ),
        (("--quantisation", "0.5"), LateMessages(value_error="0.25"), "varying"),
        (("--delay", "0.05", "--noise", "0.1"), LateMessages("0.05", value_error="0.2"), "oldest"),
    ],
)
def test_simulate_runs_with_late_messages(words: tuple[str, ...], messages: LateMessages, pattern: str) -> None:
    """Its columns obey the closed loop: where the step is short the input is the slope of the states."""
    run = ptcc(
        "simulate", "team.csv", *words, *START, "--rho2", "3", "--kappa", "1", "--pattern", pattern, "--seed", "4"
    )
    assert run.code == 0, run
    columns, protocol = table(run.out), NominalProtocol(T=1, rho1=1, rho2=3, kappa=1)
    graph = read_graph("team.csv")
    own = simulate(graph, protocol, [1, 3, 4, -4], messages=messages, signal=(pattern, 4))
    direct = simulate_late(graph, protocol, messages, [1, 3, 4, -4], pattern=(pattern, 4))
    assert own == direct and own.deadline_index == own.t.size - 1
    for label, states, inputs in zip(graph.labels, own.states, own.input, strict=True):
        assert columns[label].tolist() == states.tolist()
        assert columns[f"u({label})"].tolist() == (inputs + 0.0).tolist()
    slope, early = np.diff(own.states) / np.diff(own.t), own.t[:-1] < 0.5
    assert np.abs(slope - own.input[:, :-1])[:, early].max() < 0.05 * np.abs(slope).max()


def test_simulate_runs_leaders_that_move_with_their_targets() -> None:
    run = ptcc("simulate", "team.csv", "--leader-speed", "1", *START, "--rho2", "3", "--kappa", "1")
    assert run.code == 0, run
    columns, graph = table(run.out), read_graph("team.csv")
    at = int(np.argmin(np.abs(columns["t"] - 1)))
    x, goal = (np.array([columns[name.format(k)] for k in graph.labels]) for name in ("{}", "target({})"))
    assert columns["t"][-1] > 1 and np.abs(x - goal)[:, at].max() < 1e-5
    lead = analyse(graph).leaders[0]
    assert np.abs(columns[f"u({graph.labels[lead]})"]).max() <= 1 + 1e-9
    assert np.allclose(
        x[lead][-1] - x[lead][0], np.sum(columns[f"u({graph.labels[lead]})"][:-1] * np.diff(columns["t"]))
    )


@pytest.mark.few(0)
@pytest.mark.parametrize("words", [("--delay", "0.1"), ("--leader-speed", "1")])
def test_simulate_draws_such_runs_and_takes_them_from_a_scenario(words: tuple[str, ...]) -> None:
    assert ptcc("simulate", "team.csv", *words, *START, "-o", "run.png").code == 0
    assert Path("run.png").stat().st_size > 5000
    section = "[messages]\ndelay = 0.1\n" if words[0] == "--delay" else "[leaders]\nspeed = 1\n"
    Path("s.toml").write_text(SCENARIO + section)
    heads = [table(ptcc("simulate", *given).out) for given in (("s.toml",), ("team.csv", *words, *START))]
    assert heads[0].keys() == heads[1].keys() and (len(heads[0]) == 2 + 4 * (2 + (words[0] != "--delay")))


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--delay", "0.1", "--stop-before", "0.1"), "--stop-before: is not simulated with late messages"),
        (("--delay", "0.1", "--steps", "9"), "--steps: is not simulated with late messages"),
        (("--delay", "0.1", "--samples", "9"), "--samples: is not simulated with late messages"),
        (("--delay", "0.1", "--leader-speed", "1", "--sign-gain", "2"), "--sign-gain is not simulated where messages"),
        (("--leader-speed", "1", "--stop-before", "0.1"), "--stop-before: is not simulated with leaders that move"),
        (("--delay", "0.1", "--agents", "double-integrator"), "--delay: is not simulated of agents of order n"),
        (("--delay", "0.1", "--uncertainty", "10%"), "--delay: is not simulated of families of graphs"),
        (("--delay", "1e-9"), "more than 20,000 steps"),
    ],
)
def test_what_is_not_simulated_beside_late_messages_is_refused(words: tuple[str, ...], said: str) -> None:
    run = ptcc("simulate", "team.csv", *words, *START)
    assert run.code == 2 and said in run.err and run.err.count("\n") == 1, run


@pytest.mark.few(0)
def test_late_messages_and_leaders_that_move_from_certify_to_page() -> None:
    words = ("--delay", "0.02", "--leader-speed", "0.5", "--delta", "0.2", *START)
    run = ptcc("certify", "team.csv", *words, *PAPER, "--max-residual", "9", "-o", "both.json")
    text = " ".join(run.out.split())
    assert run.code == 0 and "leaders speed |x_j'| <= 0.5; any |d_k| <= 0.2 of followers" in text, run
    assert "of its target at T, within" in text and "of that no gain takes out of this bound" in text
    assert "nothing late, leaders at rest" in text and "x(T)" not in text and "met: within 9 at T" in text
    assert ptcc("check", "both.json").code == 0
    verbose = " ".join(ptcc("certify", "team.csv", *words, *PAPER, "-v").out.split())
    assert "given nothing late, leaders at rest, without disturbances, in what follows" in verbose
    assert "|u_k| <=" in " ".join(ptcc("certify", "team.csv", *words, *PAPER, "--gain-cap", "9").out.split())
    for name, said in (
        ("both.html", "nothing late, leaders at rest, without disturbances, in what follows"),
        ("both.tex", "nothing late, leaders at rest, without disturbances, in what follows"),
    ):
        assert ptcc("report", "both.json", "-o", name).code == 0
        assert said in Path(name).read_text(encoding="utf-8")
    assert ptcc("plot", "both.json", "--what", "late", "-o", "both.svg").code == 0
    assert ptcc("simulate", "team.csv", *words, "-o", "both.csv").code == 0
    assert "target(" in Path("both.csv").read_text(encoding="utf-8").splitlines()[0]
    strict = ptcc("certify", "team.csv", *words, *PAPER, "--expect", "containment")
    assert strict.code in (3, 4), strict


def test_what_is_not_simulated_beside_is_refused_in_python() -> None:
    graph, p = SignedDigraph.from_edges([(1, 2, 1)]), NominalProtocol(T=1, rho1=1, rho2=1, kappa=1)
    late = LateMessages(delay="0.1")
    for more, said in (({"actuator": GainLimits(gain_cap=9)}, "gain_cap="), ({"times": [1]}, "times: is not")):
        with pytest.raises(ParameterError, match=said):
            simulate(graph, p, [1, 0], messages=late, **more)
    with pytest.raises(ParameterError, match="sign_gain is not simulated where messages are late"):
        simulate(graph, p, [1, 0], messages=late, leaders=MovingLeaders(speed=1, sign_gain=1))
    with pytest.raises(ParameterError, match="own_delay: an own state that is late"):
        own = LateMessages(delay="0.1", own_delay=True, gain_cap=3)
        simulate(graph, p, [1, 0], messages=own, leaders=MovingLeaders(speed=1))
    with pytest.raises(ParameterError, match="sigma0: leaders that move ask"):
        simulate(graph, p, [1, 0], leaders=MovingLeaders(speed=1), sigma0=[1, 0])
    many = SignedDigraph.from_edges([(0, k, 1) for k in range(1, 60_000)])
    with pytest.raises(ParameterError, match="more than 50,000,000 states"):
        simulate(many, p, [0.0] * 60_000, messages=late)


@pytest.mark.campaign
def test_page_and_statement_tell_of_late_messages_and_moving_leaders() -> None:
    assert ptcc("certify", "chain.csv", "--delay", "0.1", "--x0", "1,0,2", *QUICK, "-o", "c.json").code == 0
    assert ptcc("certify", "team.csv", "--leader-speed", "1", *START, *QUICK, "-o", "l.json").code == 0
    for name in ("c", "l"):
        for ending in ("html", "tex"):
            assert ptcc("report", f"{name}.json", "-o", f"{name}.{ending}").code == 0
    page, statement = Path("c.html").read_text(), Path("c.tex").read_text()
    assert "consensus at T = 1, nothing late</h1>" in page
    assert "nothing late, in what follows" in page
    assert r"Messages: up to $0.1$ old." in statement
    assert r"agent c is off its final state at $T$ by $4.06 \cdot 10^{-5}$ at least, if none comes sooner." in statement
    assert "leaders at rest, in what follows" in Path("l.html").read_text()
    assert "every follower on its target at $T = 1$" in Path("l.tex").read_text()


@pytest.mark.few(0)
def test_the_figure_that_is_drawn_unasked_is_of_what_the_certificate_claims() -> None:
    assert ptcc("certify", "chain.csv", "--leader-speed", "1", "--x0", "1,0,2", *QUICK, "-o", "l.json").code == 0
    assert ptcc("plot", "l.json").code == 0 and Path("l-glance.png").exists()
    assert ptcc("certify", "chain.csv", "--delay", "0.01", "--x0", "1,0,2", *QUICK, "-o", "m.json").code == 0
    assert ptcc("plot", "m.json").code == 0 and Path("m-glance.png").exists()
    assert ptcc("certify", "chain.csv", "--delay", "0.01", *QUICK, "-o", "random.json").code == 0
    assert ptcc("plot", "random.json").code == 0 and Path("random-glance.png").exists()


@pytest.mark.few(0)
def test_delays_that_are_too_short_to_run_have_a_page_and_a_figure_of_the_bound() -> None:
    assert ptcc("certify", "chain.csv", "--delay", "1e-5", "--x0", "1,0,2", *QUICK, "-o", "c.json").code == 0
    assert ptcc("report", "c.json", "-o", "c.html").code == ptcc("plot", "c.json", "--what", "late").code == 0
    assert "ask for --what late or states or input or decay" in ptcc("plot", "c.json", "--what", "formation").err


@pytest.mark.few(0)
def test_components_are_claimed_of_messages_at_once_too() -> None:
    Path("two.csv").write_text("source,target,weight\na,b,1\nc,d,-1\nd,e,1\n")
    assert "\n           nothing late\n" in ptcc("certify", "two.csv", "--delay", "0.1", *QUICK).out
    assert "\n           leaders at rest\n" in ptcc("certify", "two.csv", "--leader-speed", "1", *QUICK).out


def test_a_column_of_a_file_without_columns_is_refused() -> None:
    Path("g.gml").write_text("graph [ directed 1 node [ id 0 ] node [ id 1 ] edge [ source 0 target 1 weight 1 ] ]")
    run = ptcc("certify", "g.gml", "--delay", "delay")
    assert run.code == 2
    assert "--delay delay: names a column of an edge list, and .gml is none" in run.err


def test_families_and_other_limits_are_refused_in_python_too() -> None:
    pair, protocol = SignedDigraph.from_edges([(1, 2, 1)]), NominalProtocol(1, 1, 2, 1)
    each, same = LateMessages(delay={(1, 2): "0.1"}), GainLimits(gain_cap=20)
    alone = SignedDigraph.from_matrix([[0, 0], [0, 0]], orientation="listens")
    for asked, said in (({"messages": LateMessages("0.1")}, "messages"), ({"leaders": MovingLeaders(1)}, "leaders")):
        with pytest.raises(ParameterError, match=f"{said}: nobody listens to anybody, so .*; leave it out"):
            certify_words(alone, protocol, **asked)
    with pytest.raises(ParameterError, match="own_delay: an own state that is late is not proved of families yet"):
        certify(pair, protocol, uncertainty="10%", messages=LateMessages("0.1", own_delay=True, gain_cap=2))
    with pytest.raises(ParameterError, match="max_residual is asked of late messages; tell how late"):
        certify(pair, protocol, uncertainty="10%", asks=Asks(expectations=Expectations(max_residual=1)))
    with pytest.raises(ParameterError, match="gain_cap: limits and late messages have two"):
        certify(pair, protocol, messages=LateMessages("0.1", gain_cap=9), limits=same)
    assert certify(pair, protocol, messages=each, limits=same).late.messages.gain_cap == 20
    with pytest.raises(ParameterError, match=r"delta is given twice: MovingLeaders\(disturbance=..\)"):
        certify(pair, protocol, leaders=MovingLeaders(speed=1, disturbance=1), asks=Asks(delta=1))


def test_late_messages_ask_for_sliding_variables_at_0() -> None:
    with pytest.raises(ParameterError, match="is none; give LateMessages"):
        certify(SignedDigraph.from_edges([(1, 2, 1)]), NominalProtocol(1, 1, 2, 1), messages=0.1)
    with pytest.raises(ParameterError, match="is none; give MovingLeaders"):
        certify(SignedDigraph.from_edges([(1, 2, 1)]), NominalProtocol(1, 1, 2, 1), leaders=MovingLeaders)


GROUP = ("group.csv", "--x0", "1,2,3", "--gain-cap", "20", "--expect", "bipartite-consensus", *QUICK)


@pytest.mark.few(0)
@pytest.mark.parametrize(
    ("words", "said"),
    thinned(
        [
            (("--delay", "1"), "up to 1 old"),
            (("--delay", "1", "--own-delay"), "the own state as well"),
            (("--delay", "delay"), "edge by edge"),
            (("--delay", "1", "--period", "0.1", "--packet-loss", "2"), "2 in a row lost"),
        ]
    ),
)
def test_a_file_without_anything_proved_of_late_messages_still_says_that_they_were_asked_for(
    words: tuple[str, ...], said: str
) -> None:
    Path("group.csv").write_text("source,target,weight,delay\na,b,1,1\nb,a,1,2\nb,c,1,0\n")
    run = ptcc("certify", *GROUP, *words, "-o", "c.json")
    assert run.code == 4 and "messages" not in json.loads(Path("c.json").read_text())
    saved = read_certificate("c.json")
    assert saved.late is not None and not saved.late.says_something
    assert saved.request.messages == saved.late.messages
    assert int(saved.assessment.exit_code) == 4 and "at T with late messages" in saved.assessment.text
    assert "LATE" in run.out and "LATE" in saved.summary()
    assert said in run.out and said in saved.summary()
    assert ptcc("report", "c.json", "-o", "c.html").code == ptcc("report", "c.json", "-o", "c.tex").code == 0
    assert "Messages" in Path("c.html").read_text() and "nothing is proved" in Path("c.html").read_text()


def test_a_file_without_anything_proved_of_moving_leaders_still_says_that_they_were_asked_for() -> None:
    graph = SignedDigraph.from_edges([("a", "b", 1), ("b", "c", 1)])
    leaders = MovingLeaders(speed=1, disturbance="1/3", sign_gain=2)
    made = certify(
        graph, NominalProtocol(T=1, rho1=1, rho2=4, kappa=1), [1, 2, 3], leaders=leaders, asks=Asks(method="paper")
    )
    made.changed(late=replace(made.late, rows=(), residual=None, input=None)).save("c.json")
    saved = read_certificate("c.json")
    assert saved.request.messages.leaders == leaders and not saved.late.says_something
    assert "left open: leaders that move" in saved.assessment.text and int(saved.assessment.exit_code) == 4


@cache
def of_group() -> str:
    """The file of a certificate by which nothing is proved of late messages."""
    assert ptcc("certify", *GROUP, "--delay", "1", "-o", "c.json").code == 4
    return Path("c.json").read_text()


@pytest.mark.few(0)
@pytest.mark.parametrize("asked", [None, 3, {}, {"messages": 1}, {"messages": {"latency": [], "packets": None}}])
def test_what_a_file_says_of_messages_that_were_asked_for_may_be_of_any_content(asked: object) -> None:
    data = json.loads(of_group())
    data["unverified"]["asked"] = asked
    Path("c.json").write_text(json.dumps(data))
    assert read_certificate("c.json").late is None


def test_gains_that_are_changed_leave_late_messages_undecided() -> None:
    graph, protocol = SignedDigraph.from_edges([("a", "b", 1)]), NominalProtocol(T=1, rho1=1, rho2=4, kappa=1)
    late, asked = LateMessages(delay="0.1"), Expectations("bipartite containment")
    made = certify(graph, protocol, [1, 2], messages=late, asks=Asks(expectations=asked, method="paper"))
    assert int(made.assessment.exit_code) == 0
    other = made.changed(protocol=NominalProtocol(T=2, rho1=1, rho2=4, kappa=1))
    assert int(other.assessment.exit_code) == 4


def test_a_rate_is_asked_of_the_loop_with_late_messages_moving_leaders_or_a_held_gain(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """That of the loop without these says nothing of it."""
    monkeypatch.chdir(tmp_path)
    Path("ring.csv").write_text("a,b,1\nb,c,1\nc,d,1\nd,a,-1\n")
    Path("led.csv").write_text("lead,a,1\na,b,1\n")
    own = ("--delay", "0.03", "--gain-cap", "10", "--own-delay")
    for graph, rate, more, code in (
        ("ring.csv", "0.5", (), 0),
        ("ring.csv", "0.5", own, 4),
        ("ring.csv", "0.01", own, 0),
        ("led.csv", "0.5", (), 0),
        ("led.csv", "0.5", ("--delay", "0.01"), 4),
        ("led.csv", "0.5", ("--leader-speed", "1"), 4),
        ("led.csv", "0.5", ("--sample-period", "0.001", "--gain-cap", "9"), 4),
    ):
        run = ptcc("certify", graph, "--rho2", "3", "--min-rate", rate, *PAPER, *more)
        assert run.code == code, (graph, rate, more, run.out)


VEHICLES = ("--agents", "double-integrator", "--exchange", "virtual", "--v0", "0,2,-1,3")


@pytest.mark.few(0)
def test_vehicles_that_exchange_virtual_positions_are_certified_checked_drawn_and_run():
    late = ("--delay", "0.01", "--leader-speed", "0.5", "--gain-cap", "20")
    said = ptcc("certify", "team.csv", *QUICK, *START, *VEHICLES, *late, "-o", "c.json")
    assert said.code == 0
    text = " ".join(said.out.split())
    assert "double integrators exchange virtual positions z_k, z_k' = gain e_k, and track them: a_1 = a_2 =" in text
    assert re.search(r"every follower within [0-9.]+ of its target at T, within [0-9.]+ from then on", text)
    assert re.search(r"bounded up to T; \|u_k\| <= [0-9.e+]+, \|v_k\| <= [0-9.e+]+ claim", text)
    assert "of virtual positions, without a gain cap, nothing late, leaders at rest" in text
    assert ptcc("check", "c.json").code == 0
    assert ptcc("plot", "c.json", "--what", "late", "-o", "late.png").code == 0
    assert ptcc("report", "c.json", "-o", "c.html").code == 0
    assert "It moves a virtual position" in Path("c.html").read_text()
    asked = ("simulate", "team.csv", "--rho2", "4", "--kappa", "1", *START, *VEHICLES)
    for more, lead in (((), [0]), (late, [-0.5]), (("--delay", "0.02", "--pattern", "square"), [0])):
        run = ptcc(*asked, *more)
        assert run.code == 0 and run.out.startswith("t,remaining,a,b,c,d,v(a)")
        rows = run.out.splitlines()
        assert len(rows) > 100 and [float(x) for x in rows[1].split(",")[2:10]] == [1, 3, 4, -4, *lead, 2, -1, 3]
    assert ptcc(*asked, *late, "-o", "vehicles.png").code == 0
    for flag, *value in (("--stop-before", "0.1"), ("--sample-period", "0.1"), ("--noise", "1")):
        said = ptcc(*asked, *late, flag, *value)
        assert said.code == 2 and f"{flag} is not proved yet where virtual positions are exchanged" in said.err
    for more in (late, late[:2]):
        said = ptcc("certify", "team.csv", *QUICK, *START, *VEHICLES, *more, "--delta", "1", "-o", "c.json")
        assert said.code == 0 and "any |d_k| <= 1 beside u_k; double integrators" in " ".join(said.out.split())
        assert ptcc("check", "c.json").code == 0 and ptcc(*asked, *more, "--delta", "1").code == 0
    assert "have instants of their own" in ptcc(*asked, *late, "--samples", "20").err
    assert "--pattern says how late messages are" in ptcc(*asked, "--pattern", "square").err
    family = ptcc("certify", "team.csv", *QUICK[:4], *START, *VEHICLES, "--uncertainty", "5%", "--gain-cap", "20")
    assert family.code == 0 and "for every signal, of virtual positions" in " ".join(family.out.split())


def test_a_mixed_team_is_certified_checked_and_run_and_what_it_cannot_be_is_refused():
    Path("orders.csv").write_text("node,order\na,1\nb,2\nc,3\nd,1\n")
    team = (*START, "--orders", "orders.csv", "--v0", "0,2,-1,0", "--a0", "0,0,4,0", "--gain-cap", "20")
    said = ptcc("certify", "team.csv", *QUICK, *team, "--delay", "0.01", "-o", "c.json")
    text = " ".join(said.out.split())
    assert said.code == 0 and "2 single, 1 double, 1 triple integrators exchange virtual positions" in text
    assert "v(0) given, a(0) given" in text and re.search(r"a_1 = [\d.]+, a_2 = [\d.]+, a_3 = [\d.]+ messages", text)
    assert ptcc("check", "c.json").code == 0
    assert ptcc("report", "c.json", "-o", "c.html").code == 0
    assert "Agent k is of order 1, 2 or 3" in Path("c.html").read_text()
    assert ptcc("report", "c.json", "-o", "c.tex").code == 0
    paper = Path("c.tex").read_text()
    assert "be of order $n_{k}$, $x_{k}^{(n_{k})} = u_{k}$" in paper and r"\text{order } 3" in paper
    assert r"$n_{k}$ & $\dot x_{k}(0)$ & $\ddot x_{k}(0)$" in paper
    run = ptcc("simulate", "team.csv", "--rho2", "4", "--kappa", "1", *team)
    assert run.out.startswith("t,remaining,a,b,c,d,v(a),v(b),v(c),v(d),a(a)")
    cells = run.out.splitlines()[1].split(",")
    assert cells[10:14] == ["nan", cells[15], "4.0", "nan"]  # the input of order 2 is its acceleration
    for wrong, why in (
        (("--orders", "a=1,b=2,c=4,d=1"), "--orders: of c is 4; give a whole number from 1 to 3"),
        (("--orders", "orders.csv", "--v0", "1,0,0,0"), "--v0: of a is not 0, an agent of order 1"),
        (("--orders", "orders.csv", "--a0", "0,1,0,0"), "--a0: of b is not 0, an agent of order 2"),
        (("--orders", "orders.csv", "--exchange", "states"), "give --exchange virtual"),
        (("--agents", "1", "--exchange", "virtual"), "single integrators exchange their positions as they are"),
    ):
        said = ptcc("certify", "team.csv", *QUICK, *START, *wrong)
        assert said.code == 2 and why in said.err, said.err


@pytest.mark.few(0)
def test_the_page_of_vehicles_that_hear_at_once_draws_them_with_leaders_that_move():
    asked = (*QUICK, *START, *VEHICLES, "--leader-speed", "0.5", "--gain-cap", "20")
    assert ptcc("certify", "team.csv", *asked, "-o", "c.json").code == 0
    assert ptcc("report", "c.json", "-o", "c.html").code == 0
    page = Path("c.html").read_text()
    assert "input are those of a run in steps of closed form with what was asked: vehicles, gain at most 20, le" in page
    assert "under the proved bound, which holds however leaders move within their speed" in page
    assert "however old" not in page
    assert "late messages: at most" not in page


@pytest.mark.few(0)
def test_the_largest_bound_that_is_drawn_is_that_of_the_nearest_proof_of_every_agent():
    Path("rate.csv").write_text("source,target,weight,delay\nann,bob,2,0.01\nbob,eve,-1,0.02\neve,bob,-3,0.01\n")
    asked = ("--delay", "delay", "--x0", "1,0,2", "--gain-cap", "40", "--no-simulation")
    assert ptcc("certify", "rate.csv", *asked, "-o", "c.json").code == 0
    made = read_certificate("c.json")
    lines = {line.get_label(): line.get_ydata() for line in made.plot("late").lines}
    assert lines["proved bound"][-1] == pytest.approx(made.late.largest, rel=0.05)
    assert (
        made.late.largest_bound([1.0])[0]
        < 0.1 * made.late.of_all[0].over_time(made.late.case, np.array([1.0])).bound.max()
    )
    assert lines["as late as allowed"][-1] <= made.late.largest and "proved at $T$" not in lines


@pytest.mark.parametrize("command", ["design", "plot"])
def test_what_is_not_built_of_vehicles_is_refused(command: str):
    more = {"design": ("--max-input", "10", "--shortest-deadline"), "plot": ("--what", "decay", "-o", "a.png")}
    said = ptcc(command, "team.csv", *START, *VEHICLES, *more[command])
    assert said.code == 2 and "this is not built yet" in said.err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("certify", "none.csv"), "--exchange: nobody listens to anybody"),
        (("certify", "none.csv", "--gain-cap", "3"), "--exchange: nobody listens to anybody"),
        (("certify", "none.csv", "--delay", "0.01"), "--delay: nobody listens to anybody"),
        (("plot", "team.csv", "--what", "motion"), "ptcc plot c.json draws that"),
    ],
)
def test_refusals_of_vehicles_name_what_was_given_and_what_works(words: tuple[str, ...], said: str):
    Path("none.csv").write_text("source,target,weight\na,b,0\n")
    zeros = ("--drop-zeros",) if words[0] == "certify" else ()
    refused = ptcc(*words, *zeros, "--agents", "double-integrator", "--exchange", "virtual")
    assert refused.code == 2 and said in refused.err


def test_a_figure_of_the_motion_of_vehicles_is_refused_with_those_that_are_drawn():
    assert ptcc("certify", "team.csv", *QUICK, *START, *VEHICLES, "--gain-cap", "20", "-o", "c.json").code == 0
    cert = read_certificate("c.json")
    with pytest.raises(ParameterError, match="vehicles that exchange virtual positions; take states, late or input"):
        cert.plot("motion")
    for what in ("states", "late", "input"):
        cert.plot(what)


@pytest.mark.few(0)
def test_the_rate_of_vehicles_that_hear_at_once_is_not_left_open_for_late_messages():
    words = ("team.csv", *START, *VEHICLES, "--gain-cap", "20", "--min-rate", "0.1")
    text = " ".join(ptcc("certify", *words).out.split())
    assert "no rate is proved of vehicles that exchange virtual positions" in text and "late messages" not in text


def test_a_rate_of_a_family_is_told_where_the_check_accepts_it_though_not_all_is_checked():
    """As with ``--verified``, which checks nothing of messages: the verdict is undecided, and the rate proved."""
    edges = [("a", "b", 1), ("b", "c", -1)]
    cert = certify(SignedDigraph.from_edges(edges), NominalProtocol(), uncertainty="10%", messages=LateMessages("0.01"))
    assert cert.checked is not None and not cert.refused
    unchecked = replace(cert.checked, verdict="undecided")
    cert.__dict__["checked"] = unchecked
    assert cert.verdict == "undecided" and not cert.refused
    cert.__dict__["checked"] = replace(unchecked, accepted=False)
    assert cert.refused


@pytest.mark.few(0)
def test_vehicles_that_begin_on_their_targets_with_velocities_are_judged_by_the_way_on_which_they_brake():
    Path("pair.csv").write_text("source,target,weight\na,b,1\nb,c,-1\n")
    words = ("--x0", "2,2,-2", "--agents", "double-integrator", "--exchange", "virtual", "--gain-cap", "200")
    fast = ptcc("certify", "pair.csv", *words, "--rho2", "3", "--v0", "0,3,-1").out
    assert "says little" not in fast
    slow = ptcc("certify", "pair.csv", *words, "--rho2", "0.1", "--v0", "0,3,-1").out
    assert "says little" in slow


def test_a_saved_certificate_says_that_information_arrives_too_late_for_stages():
    Path("pair.csv").write_text("source,target,weight\na,b,1\nb,c,-1\nc,d,1\n")
    made = ptcc("certify", "pair.csv", "--delay", "0.6", "--x0", "1,2,3,4", "--no-simulation", "-o", "c.json")
    assert made.code == 0 and "no deadlines of stages" in made.out
    read = read_certificate("c.json")
    assert read.late is not None and read.late.unarrived and "no deadlines of stages" in read.summary()


def test_under_a_cap_leaders_that_move_are_nearly_tracked_and_no_behaviour_is_met() -> None:
    asked = (*QUICK, *START, "--leader-speed", "0.5")
    run = ptcc("certify", "team.csv", *asked, "--gain-cap", "20", "--expect", "bipartite-containment", "-o", "c.json")
    text = " ".join(run.out.split())
    assert run.code == 4 and "nothing settles under a cap" in text and "gain <= 20: under a cap nothing settles" in text
    assert ptcc("check", "c.json").code == 0
    late, free = read_certificate("c.json").late, certify("team.csv", NominalProtocol(), leaders=MovingLeaders("0.5"))
    assert late is not None and late.tracks and 0 < late.largest < 0.3 and free.late.largest == 0
    assert ptcc("plot", "c.json", "-o", "c.svg").code == 0
    assert "proved at" not in Path("c.svg").read_text(encoding="utf-8")
    run = ptcc("simulate", "team.csv", *START, "--leader-speed", "0.5", "--gain-cap", "20", "-o", "run.csv")
    assert run.code == 0 and "target(" in Path("run.csv").read_text(encoding="utf-8")
    met = ptcc("certify", "team.csv", *asked, "--expect", "bipartite-containment")
    assert met.code == 0 and "met: bipartite containment" in " ".join(met.out.split())


@pytest.mark.few(0)
def test_a_sign_term_takes_up_how_leaders_move_where_messages_are_late_too() -> None:
    asked = ("certify", "team.csv", *QUICK, *START, "--leader-speed", "0.5", "--delay", "0.01")
    signed, plain = ptcc(*asked, "--sign-gain", "0.5", "-o", "s.json"), ptcc(*asked, "-o", "p.json")
    assert signed.code == plain.code == 0 and ptcc("check", "s.json").code == 0
    one, other = (read_certificate(name).late for name in ("s.json", "p.json"))
    assert one is not None and other is not None and one.after is not None and other.after is not None
    assert one.after < other.after and one.steps is None and one.leaders.sign_gain == Fraction(1, 2)
    assert ptcc("plot", "s.json", "-o", "s.svg").code == 0


@pytest.mark.few(2)
@pytest.mark.parametrize(
    "words",
    [
        ("--delay", "0.01", "--delta", "0.2"),
        ("--delay", "0.01", "--noise", "0.05", "--gain-cap", "20"),
        ("--leader-speed", "0.5", "--noise", "0.05", "--delta", "0.2"),
        ("--uncertainty", "1%", "--delay", "0.01", "--delta", "0.2", "--noise", "0.05"),
    ],
)
def test_disturbances_and_noise_go_with_late_messages_and_leaders_that_move(words: tuple[str, ...]) -> None:
    quick = QUICK[:4] if "--uncertainty" in words else QUICK
    run = ptcc("certify", "team.csv", *words, *START, *quick, "--expect", "bipartite-containment", "-o", "c.json")
    assert run.code == 4 and "left open: bipartite containment at T with" in " ".join(run.out.split()), run
    late = read_certificate("c.json").late
    assert late is not None and late.messages.value_error == (Fraction(1, 10) if "--noise" in words else 0)
    pushed = Fraction(0) if late.leaders is None else late.leaders.disturbance
    assert pushed == (Fraction(1, 5) if "--delta" in words else 0)
    assert ptcc("check", "c.json").code == 0 == ptcc("report", "c.json", "-o", "c.html").code
    page = Path("c.html").read_text(encoding="utf-8")
    assert ("leaders at rest" in page) == ("--leader-speed" in words)
    assert ("without disturbances" in page) == ("--delta" in words)


@pytest.mark.parametrize("more", [("--leader-speed", "1"), ("--delay", "0.01", "--delta", "1")])
def test_followers_that_begin_on_their_targets_still_add_their_sign_term(more: tuple[str, ...]) -> None:
    Path("r.csv").write_text("l,a,1\na,b,1\nb,a,1\n")
    asked = ("r.csv", "--rho2", "0.7", "--x0", "1,1,1", "--sign-gain", "2", "--max-input", "0.5", *QUICK[4:])
    run = ptcc("certify", *asked, *more)
    assert run.code == 4 and "left open: |u_k| <= 0.5" in " ".join(run.out.split()), run


def test_of_weights_too_far_apart_for_floats_a_page_is_written_and_no_run_is_made() -> None:
    Path("ill.csv").write_text("l,a,1e-30\na,b,1e9\nb,a,1e9\n")
    asked = ("ill.csv", "--x0", "1,3,-4", "--leader-speed", "1")
    run = ptcc("certify", *asked, *QUICK[4:], "--max-residual", "1", "-o", "i.json")
    assert run.code == 4 and "within 1 at T (nothing is proved)" in " ".join(run.out.split())
    assert ptcc("report", "i.json", "-o", "i.html").code == 4 and Path("i.html").exists()
    refused = ptcc("simulate", *asked, "-o", "i.csv")
    assert refused.code == 2 and "too far apart for a run" in refused.err


def test_leaders_of_speed_0_are_told_to_rest() -> None:
    plain, still = (ptcc("certify", "team.csv", *START, *QUICK, *more) for more in ((), ("--leader-speed", "0")))
    assert still.out == plain.out
    disturbed = ptcc("certify", "team.csv", *START, *QUICK, "--delta", "1", "--delay", "0.01", "--gain-cap", "20")
    assert "at rest; any |d_k| <= 1" in disturbed.out and "leaders move" not in disturbed.out
    assert ptcc("simulate", "team.csv", *START, "--delta", "1", "--delay", "0.01", "-o", "r.csv").code == 0


@pytest.mark.parametrize("delay", ["0.3", "0.02"])
def test_where_late_messages_leave_more_than_1_percent_the_verdict_says_how_to_ask_for_less(delay: str) -> None:
    asked = ("certify", "team.csv", "--delay", delay, *START, *QUICK)
    words = " ".join(ptcc(*asked).out.split())
    advice = re.search(r"says little by T; .*(--max-residual) ([\d.]+) asks for a delay that leaves 1 %", words)
    assert advice is not None, words
    assert Fraction(advice[2]) == Fraction(3, 100)  # the longest way is 3, from 4 to 1
    text = " ".join(ptcc(*asked, *advice.groups()).out.split())
    told = re.search(r"certified where nothing is older than ([\d.]+\d)", text)
    assert told is not None and "says little" not in text
    followed = ptcc("certify", "team.csv", "--delay", told[1], *START, *QUICK).out
    assert "asks for a delay" not in followed and "says little" not in followed


@pytest.mark.parametrize(
    ("more", "told"),
    [
        (("--leader-speed", "2", "--gain-cap", "9"), "try a smaller --leader-speed, or another --gain-cap"),
        (("--delay", "0.05", "--leader-speed", "1"), "try a smaller --delay or --leader-speed"),
    ],
)
def test_what_says_little_comes_with_what_to_change_and_not_beside_what_is_met(more: tuple[str, ...], told: str):
    asked = ("certify", "team.csv", *START, *QUICK, *more)
    words = " ".join(ptcc(*asked).out.split())
    assert "says little by T; " in words and told in words, words
    met = " ".join(ptcc(*asked, "--max-residual", "9").out.split())
    assert "verdict met: within 9 at T" in met and "says little" not in met, met
