"""The short screens: at most 11 lines of 80 columns whatever the graph, and a verdict the exit code agrees with."""

from __future__ import annotations

import re
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from asked import certify_words
from generators import KINDS, all_classes, random_graph, smallest
from hypothesis import given, settings
from hypothesis import strategies as st
from rich.cells import cell_len
from selection import thinned

import ptcc_certify as ptcc
from ptcc_certify.bounds.final_state.of_graph import extremes
from ptcc_certify.certificate.certificate import read_certificate
from ptcc_certify.certificate.graph_certification import STEPS
from ptcc_certify.certificate.verdict import NO_SEARCHES
from ptcc_certify.errors import ExitCode, UnknownAgentError
from ptcc_certify.examples import load_graph
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.structure import analyse
from ptcc_certify.model.asks import Expectations, GainLimits
from ptcc_certify.report.facts.decay import told_instants
from ptcc_certify.report.facts.graph import structure_facts
from ptcc_certify.report.page import report_html
from ptcc_certify.report.screen import certificate_lines, check_summary, short_screen, summary_lines
from ptcc_certify.report.text_layout import columns, shorten_list, wrap_lines

pytestmark = pytest.mark.usefixtures("quick_search")

NOMINAL = ptcc.NominalProtocol(T="0.6", rho1="0.1", rho2="0.6", kappa=1)
STRONG = ptcc.NominalProtocol(T=1, rho1=1, rho2=2, kappa=2)
SLIDING = ptcc.SlidingModeProtocol(T_r="0.5", T_s=1, rho1="0.1", rho2="0.3", kappa=2, mu1="1.2", mu2=1, mu3=1, delta=1)
PAIR = SignedDigraph.from_edges([("a", "b", -1), ("b", "a", -1)])
LABELS = (str, lambda k: f"agent number {k} of a rather long list of agents", lambda k: f"日本語の節点{k}" * 5)
HEADS = ["verdict", "graph", "read", "protocol", "claim", "x(T)", "error", "input"]
#: The beginning of the verdict line by exit code.
VERDICTS = {
    ExitCode.OK: "(met: .*)?certified",
    ExitCode.VIOLATED: "VIOLATED",
    ExitCode.REFUTED: "refuted",
    ExitCode.UNDECIDED: "(undecided|left open)",
}


def assert_short(lines: list[str], most: int) -> None:
    assert len(lines) <= most, "\n".join(lines)
    for line in lines:
        assert cell_len(line) <= 80 and line.isprintable() and line == line.rstrip(), (cell_len(line), line)


def assert_screen(certificate: ptcc.Certificate, name: str = "graph") -> list[str]:
    """The screen is short, and its verdict is that of the exit code."""
    lines = summary_lines(certificate, name)
    assert_short(lines, 12 if len(certificate.claims) == 1 else 14)
    (verdict,) = [line for line in lines if line.startswith("verdict ")]
    assert re.match(rf"verdict    {VERDICTS[certificate.assessment.exit_code]}\b", verdict), verdict
    return lines


@pytest.mark.few(0)
@pytest.mark.parametrize("kind", thinned(KINDS))
def test_of_every_class_the_screens_fit_8_lines_of_80_columns(kind: str):
    kwargs = dict(all_classes())[kind]
    rng = np.random.default_rng(KINDS.index(kind))
    fixed = "n" in kwargs or (kwargs.get("isolated") and not kwargs["parts"])
    n = smallest(**kwargs) if fixed else smallest(**kwargs) + 2
    made = random_graph(rng, **dict(kwargs, n=n))
    label = LABELS[KINDS.index(kind) % len(LABELS)]
    graph = SignedDigraph.from_edges(
        [(label(s), label(t), w) for s, t, w in made.graph.edges], [label(v) for v in made.graph.labels]
    )
    x0 = [Fraction(int(x), 7) for x in rng.integers(-9_999, 10_000, n)]
    assert_short(
        short_screen(structure_facts(analyse(graph), "a graph of a long name" * 4)), 8 if len(made.parts) == 1 else 12
    )
    for protocol, sigma in ((NOMINAL, {}), (SLIDING, {"sigma0": x0[::-1]})):
        certificate = certify_words(graph, protocol, x0, simulation=False, method="paper", **sigma)
        assert_screen(certificate, "/a/long/path/of/some/folders/to/the/file/of/the/graph/graph_5.csv")
        for line in wrap_lines(certificate_lines(certificate, "g" * 100)):
            assert cell_len(line) <= 80


REQUESTS: list[tuple[Any, dict[str, Any], int, str]] = [
    (NOMINAL, {"expectations": Expectations("stability")}, 3, "refuted: stability"),
    (NOMINAL, {"expectations": Expectations("bipartite consensus", Fraction(1), Fraction(10**6))}, 0, "met: bipartite"),
    (NOMINAL, {"expectations": Expectations(max_input=Fraction(1, 10**6))}, 3, "refuted: |u_k|"),
    (SLIDING, {"expectations": Expectations("stability", Fraction(9), Fraction(1, 10**6))}, 3, "refuted: stability"),
    (NOMINAL, {"limits": [GainLimits(gain_cap=30)]}, 0, "gain <= 30: ||E|| <= "),
    (
        NOMINAL,
        {"limits": [GainLimits(gain_cap=30)], "noise": "0.1", "delta": "0.1"},
        0,
        "gain <= 30, |n_k| <= 0.1: ||E||",
    ),
    (NOMINAL, {"noise": "0.1"}, 4, "left open: noise"),
    (NOMINAL, {"limits": [GainLimits(sample_period="0.1")]}, 0, "zero-order hold 0.1: ||E|| <= "),
    (NOMINAL, {"limits": [GainLimits(sample_period="0.1")]}, 0, "; under a sample period no number is proved"),
    (
        NOMINAL,
        {"limits": [GainLimits(gain_cap=30)], "initial_set": 3},
        0,
        "these limits; |u_k| <= 6.601 for all |x_k(0)",
    ),
    (
        NOMINAL,
        {"limits": [GainLimits(gain_cap=30, sample_period="0.001")], "noise": "0.1", "delta": "0.1"},
        4,
        "the rest is certified without noise and disturbances",
    ),
    (
        ptcc.NominalProtocol(T=1, rho1=9, rho2=9, kappa=1),
        {"limits": [GainLimits(sample_period="0.9")]},
        4,
        "left open: limits",
    ),
    (NOMINAL, {"initial_set": 3}, 0, "for all |x_k(0)| <= 3"),
    (NOMINAL, {"initial_set": 3, "limits": [GainLimits(gain_cap=50)]}, 0, "every agent within"),
    (NOMINAL, {"at": "0.3"}, 0, "at t = 0.3: ||E|| <="),
    (NOMINAL, {"time_limit": 1e-9}, 4, "took its share of 1e-09 s"),
    (ptcc.NominalProtocol(T=1, rho1=1, rho2="0.1", kappa=1), {}, 0, "NOT BOUNDED"),
    (
        ptcc.NominalProtocol(T=1, rho1=1, rho2="0.1", kappa=1),
        {},
        0,
        "little by T; the input is not bounded; rho2=0.501 leaves 1 % and bounds the input",
    ),
    (ptcc.NominalProtocol(T="1/7", rho1="1/30011", rho2="1/40009", kappa="100003/7"), {}, 0, "kappa="),
]


@pytest.mark.few(8)
@pytest.mark.parametrize(("protocol", "request_", "code", "says"), REQUESTS, ids=str)
def test_whatever_is_asked_the_screen_is_short_and_agrees_with_the_exit_code(protocol, request_, code, says):
    certificate = certify_words(PAIR, protocol, [5, 1], simulation=False, **request_)
    assert certificate.assessment.exit_code == code
    lines = assert_screen(certificate)
    assert says in " ".join(line.strip() for line in lines), lines


def test_without_particulars_there_is_one_line_for_each_thing():
    lines = assert_screen(ptcc.certify(PAIR, NOMINAL, [5, 1], asks=ptcc.Asks(simulation=False)))
    assert [line.split()[0] for line in lines] == HEADS
    assert [line.split()[0] for line in assert_screen(ptcc.certify(PAIR, NOMINAL))] == [h for h in HEADS if h != "x(T)"]


def test_what_disturbances_add_has_a_line_and_the_verdict_is_of_none():
    for limits in ([], [GainLimits(gain_cap=30)]):
        lines = assert_screen(
            ptcc.certify(PAIR, NOMINAL, [5, 1], limits=limits, asks=ptcc.Asks(simulation=False, delta=1))
        )
        (line,) = [line for line in lines if line.startswith("disturbed  |d_k| <= 1 adds at most ")]
        assert ("x_k(T)" in line) == (not limits), "where they move the agents is proved without limits alone"
        assert ("; of x(T) nothing is proved" in " ".join(map(str.strip, lines))) == bool(limits)
        assert lines[0].startswith("verdict    certified without disturbances")


def test_noise_that_is_left_open_has_its_reason():
    sampled = [GainLimits(gain_cap=30, sample_period="0.001")]
    for limits, why in (([], "gain_cap or stop_before"), (sampled, "ask for each alone")):
        certificate = ptcc.certify(PAIR, NOMINAL, [5, 1], limits=limits, asks=ptcc.Asks(simulation=False, noise="0.01"))
        text = " ".join(line.strip() for line in assert_screen(certificate))
        assert f"{why}); the rest is certified" in text


def test_a_drawn_state_is_not_told_where_a_set_is_asked_about():
    certificate = ptcc.certify(PAIR, NOMINAL, [5, 1], asks=ptcc.Asks(simulation=False, initial_set=1))
    assert any(line.startswith("x(T)") for line in assert_screen(certificate))
    assert "x(T)" in "\n".join(summary_lines(certificate, "g", {"x(0)": "as in the file"}))
    certificate = ptcc.certify(PAIR, NOMINAL, "random", asks=ptcc.Asks(simulation=False, initial_set=1))
    for show in (summary_lines, certificate_lines):
        text = "\n".join(show(certificate, "g", {"x(0)": "random, seed 0"}))
        assert "x(T)" not in text and "every agent" not in text and "all |x_k(0)| <= 1" in text


@pytest.mark.few(0)
def test_final_states_are_exact_or_called_rounded_and_of_many_there_are_the_ends():
    def line(x0: list[Any], graph: SignedDigraph = PAIR) -> str:
        lines = assert_screen(ptcc.certify(graph, NOMINAL, x0, asks=ptcc.Asks(simulation=False, method="paper")))
        return " ".join(lines).partition("x(T)")[2].partition("error")[0]

    assert "a=1/6, b=-1/6 (exact)" in line(["1/3", 0])
    assert "a=0.11728, b=-0.11728 (rounded)" in line(["0.234567", "0.0"])
    many = SignedDigraph.from_edges([("n0", f"n{k}", 1) for k in range(1, 109)], ["alone"])
    text = line(["3.123456789" if label == "alone" else 1 for label in many.labels], many)
    assert "1 agent at 3.1235 and 109 agents at 1 (rounded)" in text
    labels = [f"n{k}" for k in range(40)]
    loose = SignedDigraph.from_edges([("n0", "n1", 1)], labels)
    assert "least n0=0, largest n39=39," in line([*range(40)], loose).replace("every agent", "")


def test_of_agents_that_end_highest_an_exact_one_comes_first_then_the_first_in_order():
    tied = [1.5, Fraction(3, 2), Fraction(0), Fraction(3, 2), Fraction(0)]
    assert extremes(tied, 1, [Fraction(1, 10**9), *[Fraction(0)] * 4]) == ([1], [2])
    assert extremes([0, 0, 1], 2) == ([2, 0], [1])  # no agent twice


def test_the_claim_says_that_it_is_without_limits_of_the_gain():
    several = SignedDigraph.from_edges([("a", "b", 1), ("c", "d", 1)])
    for limits in (GainLimits(gain_cap=50), GainLimits(stop_before="0.1"), GainLimits(1000, sample_period="0.001")):
        more: dict[str, Any] = {"simulation": False, "method": "paper", "limits": limits}
        (claim,) = (line for line in assert_screen(certify_words(PAIR, NOMINAL, [1, 2], **more)) if "claim " in line)
        assert ", without limits (Theorem" in claim
        assert " " * 11 + "without limits" in summary_lines(certify_words(several, NOMINAL, **more), "several")


def test_agents_that_end_at_the_same_state_are_told_together_where_one_line_is_enough():
    graph, x0 = load_graph("fig1b"), ["7.013", "2.739", "0.223", "-4.604", "-3.844", "-9.181"]
    lines = assert_screen(ptcc.certify(graph, NOMINAL, x0, asks=ptcc.Asks(simulation=False)))
    assert len(lines) == 8 and lines[5] == "x(T)       1, 2, 5, 6 at 1.3001; 3, 4 at -1.3001 (rounded)"


def test_a_long_label_keeps_the_end_that_tells_it_apart():
    labels = [f"department of network science, room {k}" for k in range(2)]
    graph = SignedDigraph.from_edges([(*labels, 1), (*labels[::-1], -1)])
    (line,) = [
        x
        for x in assert_screen(ptcc.certify(graph, STRONG, [5, 1], asks=ptcc.Asks(simulation=False)))
        if x.startswith("input")
    ]
    assert line.endswith(('room 0"', 'room 1"'))


def test_a_label_with_a_comma_reads_as_one_in_lists_and_messages():
    graph = SignedDigraph.from_edges([("Smith, J", "a", 1), ("a", "Lee, K", 1), ("Lee, K", "a", -1)])
    certificate = ptcc.certify(graph, NOMINAL, [1, 0, 0], asks=ptcc.Asks(simulation=False))
    text = " ".join(certificate_lines(certificate, "graph"))
    assert 'nodes      "Smith, J", a, "Lee, K"' in text and '"Smith, J"=1, a=' in text
    assert not re.findall('[^"]Smith, J|[^"]Lee, K', text)
    page = report_html(read_certificate(certificate.to_dict()))
    assert '<bdi>"Smith, J"</bdi>, <bdi>a</bdi>' in page.replace("&#34;", '"')
    assert "Smith, J" in repr(certificate.final_state) and '"Smith, J"' in repr(certificate.final_state)
    with pytest.raises(UnknownAgentError, match='there are "Smith, J", a, "Lee, K"'):
        graph.without_nodes("z")


def test_of_many_groups_of_leaders_the_large_ones_are_told():
    edges = [(f"s{k}", "hub", 1) for k in range(9)] + [("a", "b", -1), ("b", "a", -1), ("a", "hub", 1)]
    lines = short_screen(structure_facts(analyse(SignedDigraph.from_edges(edges)), "g"))
    assert "leaders    10 groups, 10 balanced; 9 of one node, 1 larger, up to 2" in lines
    assert "           group 10: balanced, camps {a} against {b}" in lines
    edges += [(f"{x}{k}", f"{y}{k}", 1) for k in range(40) for x, y in ("pq", "qp")]
    lines = short_screen(structure_facts(analyse(SignedDigraph.from_edges(edges)), "g"))
    assert "leaders    50 groups, 50 balanced; 9 of one node, 41 larger, up to 2, such as" in lines


def test_a_header_that_swaps_the_columns_is_told(tmp_path):
    (tmp_path / "g.csv").write_text("target,source,weight\nb,a,1\n")
    for orientation, says in (
        ("information", "information flows source -> target"),
        ("listens", "source listens to target"),
    ):
        structure = analyse(ptcc.read_graph(tmp_path / "g.csv", orientation=orientation))
        assert short_screen(structure_facts(structure, "g"))[1] == f"read       columns by header: {says}"


@pytest.mark.few(0)
def test_of_many_components_the_largest_four_are_told():
    edges = [(f"{k}a{i}", f"{k}a{i + 1}", 1) for k in range(6) for i in range(k)]
    lines = assert_screen(
        ptcc.certify(SignedDigraph.from_edges(edges, ["0a0"]), NOMINAL, [1] * 21, asks=ptcc.Asks(simulation=False))
    )
    claims = [line for line in lines if "at T = 0.6" in line]
    assert len(claims) == 4 and claims[0].startswith("claim      5a0, 5a1")
    assert any("... 6 components in all" in line for line in lines)


def test_agents_without_edges_keep_their_state():
    (text,) = [
        x for x in assert_screen(ptcc.certify(SignedDigraph.from_edges([], ["a"]), NOMINAL, [5])) if "keeps" in x
    ]
    assert text == "error      none: no agent listens to another, each keeps its state"


@pytest.mark.parametrize("rho2", ["0.3", "2/3", "5/7"])
def test_bounds_are_rounded_up(rho2: str):
    protocol = ptcc.NominalProtocol(T="0.6", rho1="1/3", rho2=rho2, kappa=1)
    certificate = ptcc.certify(PAIR, protocol, ["5/3", 1], asks=ptcc.Asks(simulation=False, initial_set="7/3"))
    text = " ".join(summary_lines(certificate, "pair"))
    (error,) = re.findall(r"\|\|E\|\| <= (\S+) \|\|E\(0\)\|\|", text)
    assert Fraction(error) >= certificate.envelope.residual(0.01)
    for agents in re.findall(r"every agent within (\S+)", text):
        assert Fraction(agents) >= certificate.deviation_bound([0.01]).max()
    if certificate.effort.peak is not None:
        (size,) = re.findall(r"\|u_k\| <= ([0-9.e+]+) for all", text)
        assert Fraction(size) >= certificate.effort.peak.largest
    else:
        assert "NOT BOUNDED" in text


def test_a_certificate_read_back_shows_the_same_screen(tmp_path):
    certificate = ptcc.certify(PAIR, NOMINAL, [5, 1], asks=ptcc.Asks(simulation=False))
    certificate.save(tmp_path / "c.json")
    assert summary_lines(ptcc.read_certificate(tmp_path / "c.json"), "pair") == summary_lines(certificate, "pair")


@given(st.lists(st.text(max_size=30), min_size=1, max_size=12), st.integers(30, 90))
@settings(max_examples=25, deadline=None)
def test_a_list_is_shortened_to_its_width(words: list[str], width: int):
    text = shorten_list(words, width)
    assert columns(text) <= width
    if columns(", ".join(words)) <= width:
        assert text == ", ".join(words)


@given(st.text(max_size=300), st.integers(31, 90))
@settings(max_examples=25, deadline=None)
def test_wrapping_loses_nothing_and_keeps_to_the_width(text: str, width: int):
    lines = wrap_lines([f"{'head':<11}{text}"], width)
    assert all(columns(line) <= width for line in lines)
    assert "".join(line[11:] for line in lines).replace(" ", "") == text.replace(" ", "")


def test_a_delta_of_0_is_called_no_disturbances():
    pair = [("a", "b", -1), ("b", "a", -1)]
    for delta, told in (("0", "at T = 2, without disturbances"), ("1", "at T = 2, any |d_k| <= 1")):
        protocol = ptcc.SlidingModeProtocol(T_r=1, T_s=1, mu1=2, delta=delta)
        assert told in ptcc.certify(pair, protocol, [3, 5], asks=ptcc.Asks(simulation=False)).summary()


def test_certify_and_check_tell_the_same_of_single_agents(tmp_path):
    certificate = ptcc.certify(
        load_graph("fig1b"), SLIDING, ptcc.InitialState("random", sigma0="random"), asks=ptcc.Asks(simulation=False)
    )
    certificate.save(tmp_path / "c.json")
    report = ptcc.check(tmp_path / "c.json")
    told = summary_lines(certificate, "fig1b", {"x(0)": "random, seed 0", "sigma(0)": "random, seed 0"})
    checked = check_summary(str(tmp_path / "c.json"), certificate.to_dict(), report)
    answers = [line for line in told if line.startswith(("error", "input"))]
    assert len(answers) == 2 and set(answers) <= set(checked) and len(told) <= 9
    assert "agents within" in answers[0] and "the largest of agent" in answers[1]


@pytest.mark.few(0)
def test_instants_of_the_page_are_those_of_the_screen():
    certificate = ptcc.certify(
        PAIR, SLIDING, ptcc.InitialState([5, 1], sigma0=[1, 0]), asks=ptcc.Asks(simulation=False)
    )
    bounds = certificate.norm_bound([left for left, _ in told_instants(SLIDING, certificate.direct)])
    assert np.all(np.diff(bounds) < 0)
    (line,) = [line for line in summary_lines(certificate, "g") if line.startswith("error")]
    page = report_html(read_certificate(certificate.to_dict()))
    assert "at T_r + 0.99 T_s" in line and "T<sub>r</sub> + 0.99\N{NO-BREAK SPACE}T<sub>s</sub>" in page
    assert "0.99\N{NO-BREAK SPACE}T<" not in page.replace("0.99\N{NO-BREAK SPACE}T<sub>s", "")


def test_undecided_for_want_of_time_names_the_search():
    assert set(NO_SEARCHES) - {"exact final state"} <= set(STEPS)  # which gives way to an enclosed one
    text = ptcc.certify(PAIR, NOMINAL, [5, 1], asks=ptcc.Asks(time_limit=1e-9)).assessment.text
    assert text == "undecided: no rate is proved, the search took its share of 1e-09 s; raise time_limit"


def test_no_claim_hypothesis_or_parameter_is_cut_short():
    fine = ptcc.SlidingModeProtocol(T_r="0.123456789", T_s="0.987654321", mu1="0.2234567891", delta="0.123456789012")
    text = " ".join(" ".join(assert_screen(ptcc.certify(PAIR, fine, [3, 5], asks=ptcc.Asks(simulation=False)))).split())
    assert "any |d_k| <= 0.123456789012 (Theorem 4.1)" in text and "sigma(0) 0" in text and "..." not in text
    apart = SignedDigraph.from_edges([("a", "b", 1), ("b", "a", 1), ("c", "d", -1), ("d", "c", -1)])
    assert "           any |d_k| <= 1" in assert_screen(
        ptcc.certify(apart, SLIDING, [1, 2, 3, 4], asks=ptcc.Asks(simulation=False))
    )
    capped = ptcc.Agents(order=1, offsets=[1, 2], gain_cap=4)
    lines = summary_lines(ptcc.certify(PAIR, NOMINAL, [3, 5], agents=capped, asks=ptcc.Asks(simulation=False)), "pair")
    text = " ".join(" ".join(lines).split())
    assert "consensus of x - offsets at T = 0.6, without limits (Theorem 1.1" in text


def test_a_protocol_is_broken_between_terms_only():
    cascade = ptcc.certify(
        PAIR, STRONG, [3, 5], agents=ptcc.Agents(order=2, cascade=3), asks=ptcc.Asks(simulation=False)
    )
    for lines in (summary_lines(cascade, "pair"), wrap_lines(certificate_lines(cascade, "pair"))):
        first = next(k for k, line in enumerate(lines) if line.startswith("agents "))
        assert lines[first + 1].startswith("           - 3 g x'") and lines[first].endswith("g e'")
        assert all(line.isprintable() for line in lines)


def test_of_many_agents_of_order_n_the_least_and_the_largest_final_state_are_told():
    star = SignedDigraph.from_edges([(0, k, 1 if k % 2 else -1) for k in range(1, 121)])
    options = {"agents": ptcc.Agents(order=2), "simulation": False, "method": "perron"}
    made = certify_words(star, STRONG, [3] * 121, v0=[1] * 121, **options)
    lines = summary_lines(made, "star")
    assert any(line.startswith("x(T)       least 2=-4, largest 0=4, of 121 agents (") for line in lines), lines
    assert any(line.startswith("v(T)       least 2=-1, largest 0=1, of 121 agents (") for line in lines), lines
    made = certify_words(star, STRONG, [Fraction(1, 3)] * 121, v0=[1] * 121, **options)
    assert "proved; rounded)" in " ".join(" ".join(summary_lines(made, "star")).split())
