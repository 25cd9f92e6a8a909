"""Stubborn agents: their final opinions by the formula, in every class of graphs, and as they are told and refused."""

from __future__ import annotations

import json
from collections.abc import Sequence
from fractions import Fraction
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bad_inputs import ptcc as command
from flint import fmpq, fmpq_mat
from generators import all_classes, random_graph, smallest

import ptcc_certify as ptcc
from ptcc_certify.bounds.final_state.opinions import disagreement, polarisation
from ptcc_certify.errors import GraphError, ParameterError, UnknownAgentError
from ptcc_certify.graphs.structure import analyse
from ptcc_certify.graphs.stubborn import prejudices, stubborn_text, stubbornness

pytestmark = pytest.mark.usefixtures("quick_search")

CLASSES = all_classes()
WEIGHTS = ("small ints", "decimals", "ratios")
TEAM = "ann,bob,1\nbob,ann,1\nbob,eve,-2\neve,dan,1\ndan,eve,1\n"
PROTOCOL = ptcc.NominalProtocol(T=1, rho1=1, rho2=3, kappa=2)


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("team.csv").write_text(TEAM, encoding="utf-8")


def graph_of(seed: int) -> ptcc.SignedDigraph:
    """Return a random graph of at most 8 agents or so; the classes of the theory take turns."""
    rng = np.random.default_rng(seed)
    kwargs: dict[str, Any] = CLASSES[seed % len(CLASSES)][1]
    if not ("n" in kwargs or (kwargs.get("isolated") and not kwargs["parts"])):
        kwargs = dict(kwargs, n=int(rng.integers(smallest(**kwargs), max(smallest(**kwargs), 8) + 1)))
    return random_graph(rng, **dict(kwargs, weights=WEIGHTS[seed % len(WEIGHTS)])).graph


def asked_of(graph: ptcc.SignedDigraph, seed: int) -> tuple[dict[str, Fraction], dict[str, Fraction], list[Fraction]]:
    """Return how stubborn some agents are, some prejudices other than x(0), and x(0)."""
    rng = np.random.default_rng([1, seed])
    some = rng.permutation(graph.labels)[: 1 + seed % graph.n_nodes].tolist()
    theta = {label: Fraction(int(rng.integers(1, 40)), 8) for label in some}
    told = {label: Fraction(int(rng.integers(-50, 51)), 10) for label in some[::2]}
    return theta, told, [Fraction(int(x), 10) for x in rng.integers(-50, 51, graph.n_nodes)]


def by_formula(
    graph: ptcc.SignedDigraph, theta: dict[str, Fraction], p: dict[str, Fraction], x0: Sequence[Fraction]
) -> dict[str, Fraction]:
    """``X_S = (L_SS + Theta)^-1 (Theta p - L_SB X_B)``, B the balanced closed components without a stubborn agent."""
    labels, L = graph.labels, graph.exact_laplacian()
    closed = [c.nodes for c in analyse(graph).closed_components if c.balanced]
    B = {v for nodes in closed for v in nodes if not any(labels[u] in theta for u in nodes)}
    S = [v for v in range(graph.n_nodes) if v not in B]
    limits = ptcc.final_state(graph, x0)
    end = {labels[v]: limits[labels[v]] for v in B}
    A = [[fmpq(*(L[k][m] + (theta.get(labels[k], 0) if k == m else 0)).as_integer_ratio()) for m in S] for k in S]
    right = [theta.get(labels[k], 0) * p.get(labels[k], 0) - sum(L[k][b] * end[labels[b]] for b in B) for k in S]
    if S:
        X = fmpq_mat(A).solve(fmpq_mat([[fmpq(*Fraction(x).as_integer_ratio())] for x in right]))
        end |= {labels[k]: Fraction(int(X[i, 0].p), int(X[i, 0].q)) for i, k in enumerate(S)}
    return end


@pytest.mark.few(80)
@pytest.mark.parametrize("seed", range(4 * len(CLASSES)))
def test_the_final_state_of_a_certificate_is_that_of_the_formula(seed: int) -> None:
    graph = graph_of(seed)
    theta, told, x0 = asked_of(graph, seed)
    p = {label: told.get(label, x0[graph.labels.index(label)]) for label in theta}
    debate = ptcc.with_stubborn(graph, theta)
    begin = dict(zip(graph.labels, x0, strict=True)) | {f"{label}'s prejudice": x for label, x in told.items()}
    cert = ptcc.certify(debate, PROTOCOL, begin, asks=ptcc.Asks(method="perron", simulation=False))
    expected = by_formula(graph, theta, p, x0)
    assert {label: cert.final_state[label] for label in graph.labels} == expected
    assert all(cert.final_state[f"{label}'s prejudice"] == x for label, x in p.items())
    document, files = cert.for_check()
    report = ptcc.check(document, files=files)
    assert report.accepted, report.reason


def test_an_agent_that_is_not_reached_from_a_prejudice_stays_out_of_the_formula() -> None:
    """3 hears a stubborn agent and an ordinary leader: what 3 ends at is no function of prejudices alone."""
    graph = ptcc.with_stubborn([(1, 3, 1), (2, 3, 1)], {"1": 1})
    assert ptcc.final_state(graph, {"1": 0, "2": 5, "3": 9, "1's prejudice": 1})["3"] == 3


def test_four_people_end_where_friedkin_and_johnsen_print_it() -> None:
    """The packaged example has prejudices as leaders u1, u2 and u4."""
    known = ptcc.as_graph(Path(ptcc.__file__).parent / "examples" / "published" / "four_people.csv")
    people = known.without_nodes("u1", "u2", "u4")
    debate = ptcc.with_stubborn(people, {"1": "0.22", "2": "0.215", "4": "0.286"})
    end = ptcc.final_state(debate, {"1": 25, "2": 25, "3": 75, "4": 85})
    assert [round(float(end[k])) for k in "1234"] == [60, 60, 75, 75]
    old = ptcc.final_state(known, {"1": 25, "2": 25, "3": 75, "4": 85, "u1": 25, "u2": 25, "u4": 85})
    assert all(end[k] == old[k] for k in "1234")


def test_polarisation_and_disagreement_are_of_agents_alone() -> None:
    graph = ptcc.as_graph(StringIO(TEAM))
    debate = ptcc.with_stubborn(graph, {"ann": "0.5", "dan": 1})
    begin, end = ptcc.as_state([5, 2, 4, -1], debate), ptcc.final_state(debate, [5, 2, 4, -1]).states
    assert [polarisation(graph, x[:4]) for x in (begin, end)] == [polarisation(debate, x) for x in (begin, end)]
    assert polarisation(graph, [5, 2, 4, -1]) == Fraction(21, 4)
    assert disagreement(debate, begin) == disagreement(graph, [5, 2, 4, -1]) == 2 * 9 + 2 * 36 + 2 * 25
    said = "opinions   x(0) to x(T): polarisation 5.25 -> 17.96, disagreement 140 -> 6.4"
    asked = ("certify", "team.csv", "--stubborn", "ann=0.5,dan=1", "--x0", "5,2,4,-1", "--no-simulation")
    assert said in command(*asked).out
    for more in (("--delay", "0.01"), ("--offsets", "1,2,3,4")):
        assert "polarisation" not in command(*asked, *more).out  # x(T) is another then, or holds without limits


def test_entries_of_prejudices_may_be_left_out_of_every_state() -> None:
    graph = ptcc.with_stubborn(ptcc.as_graph(StringIO(TEAM)), "dan=1, ann=0.5")
    assert graph.labels[4:] == ("ann's prejudice", "dan's prejudice") and prejudices(graph) == {4: 0, 5: 3}
    by_label = {"eve": 4, "dan": -1, "ann": 5, "bob": 2}
    assert ptcc.as_state([5, 2, 4, -1], graph) == ptcc.as_state(by_label, graph) == [5, 2, 4, -1, 5, -1]
    assert ptcc.as_state("5,2,4,-1", graph) == ptcc.as_state("eve=4,dan=-1,ann=5,bob=2", graph) == [5, 2, 4, -1, 5, -1]
    assert ptcc.as_state(by_label | {"dan's prejudice": 7}, graph)[4:] == [5, 7]
    assert ptcc.as_state([5, 2, 4, -1, 8, 9], graph)[4:] == [8, 9]
    for given in ([5, 2, 4, -1], by_label, "5,2,4,-1", "eve=4,dan=-1,ann=5,bob=2", "random"):
        assert ptcc.as_state(given, graph, "sigma0")[4:] == [0, 0]  # which rests, and is not disturbed
    plain = ptcc.as_state("random", ptcc.as_graph(StringIO(TEAM)))
    assert ptcc.as_state("random", graph) == [*plain, plain[0], plain[3]]
    for short in ([1, 2, 3], "1,2,3"):
        with pytest.raises(ParameterError, match=r"3 values for 4 \w+; give one .*for each of ann, bob, eve, dan$"):
            ptcc.as_state(short, graph)


def test_intervals_of_stubbornness_make_a_family_and_keep_every_mode() -> None:
    graph = ptcc.SignedDigraph.from_edges([("a", "b", 1), ("b", "a", 2)])
    family: Any = ptcc.with_stubborn(graph, {"a": ("0.3", "0.5"), "b": 1})
    assert stubborn_text(stubbornness(family)) == "a=3/10..1/2,b=1"
    assert family.modes[0].mandatory == ptcc.with_stubborn(graph, {"a": "0.3", "b": 1})
    cert = ptcc.certify(ptcc.with_stubborn(graph, "a=0.3..0.5"), PROTOCOL, [3, -4])
    assert cert.assessment.verdict == "certified" and set(cert.final_state["b"]) == {3}  # whatever the weight is
    both = ptcc.Family.switching({"day": graph, "night": ptcc.SignedDigraph.from_edges([("a", "b", 3)])})
    modes = ptcc.with_stubborn(both, "0.5").modes
    assert [mode.n_edges for mode in modes] == [4, 3] and [mode.name for mode in modes] == ["day", "night"]
    undirected = ptcc.SignedDigraph.from_edges([("a", "b", 1)], undirected=True)
    loose: Any = ptcc.with_stubborn(ptcc.Family.from_graph(undirected, uncertainty="10%"), {"a": 1})
    assert not loose.modes[0].tied and "by themselves" in loose.notes[-1]
    unsure = ptcc.Family.from_graph(ptcc.with_stubborn(undirected, {"a": 1}), uncertainty="10%")
    after = ptcc.certify(unsure, PROTOCOL, [1, 1])
    assert after.assessment.verdict == "certified"  # no edge without its reverse


BAD = {
    "nobody": ({}, "names nobody"),
    "stranger": ({"z": 1}, "no agent is called 'z'"),
    "zero": ({"a": 0}, "its weight is always 0; give a number > 0"),
    "repelled": ("a=-1", "is -1, which repels it from its prejudice"),
    "no number": ("a=x", '"x" is not a number'),
    "empty interval": ("a=2..1", "the least weight 2 is above the largest"),
    "three ends": ({"a": (1, 2, 3)}, "has 3 numbers"),
    "twice": ("a=1,a=2", "names an agent twice"),
    "half": ("a=1,2", 'has "2", which is not label=number'),
    "a list": ([0.5, 1], "does not tell of which agents"),
    "two rows": ("a=1\nb=2", "has unclear quotes or rows"),
    "no file": ("theta.csv", 'has "theta.csv", which is not label=number; write a=0.5'),
}


@pytest.mark.parametrize("case", BAD)
def test_what_is_no_stubbornness_is_refused_in_one_line(case: str) -> None:
    given, message = BAD[case]
    with pytest.raises((ParameterError, UnknownAgentError), match=message) as caught:
        ptcc.with_stubborn([("a", "b", 1)], given)
    assert "\n" not in str(caught.value)


def test_a_node_that_is_called_like_a_prejudice_is_not_taken_for_one() -> None:
    graph = ptcc.SignedDigraph.from_edges([("a", "b", 1), ("b's prejudice", "a", 1)])
    assert not prejudices(graph)
    with pytest.raises(GraphError, match="a node is called b's prejudice already; rename it"):
        ptcc.with_stubborn(graph, {"b": 1})


# ---------------------------------------------------------------------- on the command line


def test_a_certificate_with_stubborn_agents_is_of_the_graph_of_the_same_flag() -> None:
    stubborn, begin = ("--stubborn", "ann=0.5,dan=1"), ("--x0", "5,2,4,-1", "--rho2", "3")
    run = command("certify", "team.csv", *stubborn, *begin, "-o", "c.json")
    assert run.code == 0 and "4 agents and 2 prejudices, 7 edges" in run.out
    assert "stubborn   ann 0.5, dan 1; weights of prejudices, added nodes" in run.out
    assert "x(T)       ann=5, bob=5, eve=-4.2, dan=-2.6, ann's prejudice=5" in run.out
    right = command("check", "c.json", "team.csv", *stubborn)
    assert right.code == 0 and "--stubborn ann=0.5,dan=1" in " ".join(right.out.split())
    for more in ((), ("--stubborn", "ann=0.7")):
        wrong = command("check", "c.json", "team.csv", *more)
        assert wrong.code == 1 and "accepted if --stubborn ann=1/2,dan=1 is what" in " ".join(wrong.out.split())
    interval = ("--stubborn", "ann=0.3..0.5")
    assert command("certify", "team.csv", *interval, "--edges", "listens", "-q", "-o", "f.json").code in (0, 4)
    wrong = command("check", "f.json", "team.csv")
    assert "accepted if --edges listens --stubborn ann=3/10..1/2 is" in " ".join(wrong.out.split())
    assert command("check", "f.json", "team.csv", *interval, "--edges", "listens").code in (0, 4)


def test_a_prejudice_has_the_order_of_its_agent() -> None:
    Path("team.csv").write_text("ann,bob,1\nbob,ann,1\nbob,eve,-1\n", encoding="utf-8")
    options = ("--stubborn", "bob=0.5", "--orders", "ann=1,bob=3,eve=2", "--x0", "ann=1,bob=2,eve=-4")
    assert command("certify", "team.csv", *options, "-q", "-o", "c.json").code == 0
    document = json.loads(Path("c.json").read_text(encoding="utf-8"))
    assert list(document["messages"]["vehicles"]["orders"].values()) == ["1", "3", "2", "3"]
    assert command("check", "c.json").code == 0


def test_a_scenario_and_a_file_tell_who_is_stubborn_and_to_what() -> None:
    Path("theta.csv").write_text("node,theta\nann,0.5\ndan,1\n", encoding="utf-8")
    Path("s.toml").write_text(
        '[graph]\nfile = "team.csv"\nstubborn = { ann = 0.5, dan = 1 }\n[protocol]\nrho2 = 3\n'
        "[initial_state]\nx0 = [5, 2, 4, -1]\nprejudice = { dan = 2 }\n",
        encoding="utf-8",
    )
    told = command("certify", "s.toml", "-v").out
    assert "ann's prejudice=5, dan's prejudice=2" in told and "ann=5, bob=5, eve=-3.6, dan=-0.8" in told
    flags = ("--x0", "5,2,4,-1", "--rho2", "3", "--prejudice", "dan=2", "--stubborn")
    for stubborn in ("ann=0.5,dan=1", "theta.csv"):
        assert "eve=-3.6, dan=-0.8" in command("certify", "team.csv", *flags, stubborn).out
    ends = command("simulate", "s.toml", "--steps", "1").out.splitlines()[-1].split(",")
    assert np.allclose([float(x) for x in ends[2:8]], [5, 5, -3.6, -0.8, 5, 2], atol=1e-5)
    assert "ann's prejudice 70 %" in command("influence", "s.toml").out


REFUSED = {
    "no stubborn agent": (("--prejudice", "ann=1"), "--prejudice is of stubborn agents; name them by --stubborn"),
    "told twice": (
        ("--stubborn", "ann=1", "--x0", "ann=5,bob=2,eve=4,dan=-1,ann's prejudice=3", "--prejudice", "ann=2"),
        "--x0 gives ann's prejudice 3, and this 2; keep one",
    ),
    "another agent": (("--stubborn", "ann=1", "--prejudice", "bob=1"), "bob is not stubborn; stubborn are ann"),
    "no number": (("--stubborn", "ann=1", "--prejudice", "ann=x"), '--prejudice: "x" is not a number'),
    "no text": (("--stubborn", "ann=1", "--prejudice", "high"), '--prejudice has "high", which is not label=number'),
    "no file": (("--stubborn", "nothere.csv"), '--stubborn has "nothere.csv", which is not label=number'),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_no_prejudice_is_refused_by_its_flag(case: str) -> None:
    words, message = REFUSED[case]
    run = command("certify", "team.csv", *words)
    assert run.code == 2 and message in run.err and run.err.count("\n") == 1, run.err


def test_the_command_that_design_prints_names_who_is_stubborn() -> None:
    asked = ("--stubborn", "ann=0.5", "--prejudice", "ann=3", "--agents", "2", "--x0", "1,2,3,4", "--deadline", "3")
    told = " ".join(command("design", "team.csv", *asked, "--max-input", "1000").out.replace("\\\n", " ").split())
    printed = told.partition("ptcc certify ")[2].split()
    assert "--stubborn ann=0.5" in " ".join(printed) and "--prejudice ann=3" in " ".join(printed)
    run = command("certify", *printed)
    assert run.code == 0 and "ann's prejudice=3" in run.out
    alone = command("design", "team.csv", *asked[:4], "--max-input", "1000", "--initial-bound", "5", "--deadline", "3")
    assert alone.code == 2 and "--prejudice: is not searched for single integrators" in alone.err


def test_a_command_of_one_graph_takes_no_interval_of_stubbornness() -> None:
    run = command("influence", "team.csv", "--stubborn", "ann=1..2")
    assert run.code == 2 and "an interval makes a family; ptcc influence takes one graph" in run.err


@pytest.mark.parametrize(
    "words",
    [
        ("--delay", "0.01", "--gain-cap", "50", "--leader-speed", "0.1", "--noise", "0.01"),
        ("--agents", "double-integrator", "--v0", "1,1,1,1"),
        ("--agents", "double-integrator", "--exchange", "virtual"),
        ("--protocol", "sliding-mode", "--sigma0", "1,0,0,1"),
        ("--offsets", "1,2,3,4"),
        ("--gain-cap", "50", "--delta", "0.1"),
    ],
)
def test_stubborn_agents_go_with_whatever_goes_with_leaders(words: tuple[str, ...]) -> None:
    speed = () if "sliding-mode" in words else ("--rho2", "3")
    run = command(
        "certify", "team.csv", "--stubborn", "ann=1", "--x0", "5,2,4,-1", *speed, *words, "-o", "c.json", "-q"
    )
    assert run.code == 0, run.err
    assert command("check", "c.json", "team.csv", "--stubborn", "ann=1").code == 0


def test_names_of_prejudices_are_drawn_in_rows_that_keep_off_the_runs() -> None:
    cert = ptcc.certify(ptcc.with_stubborn(ptcc.as_graph(StringIO(TEAM)), "ann=0.5,dan=1"), PROTOCOL, [5, 2, 4, -1])
    figure = ptcc.plot_glance(cert).figure
    figure.canvas.draw()
    texts = {text.get_text(): text for ax in figure.axes for text in ax.texts}
    for label in ("ann's\nprejudice", "dan's\nprejudice"):
        box = texts[label].get_window_extent()
        others = [ax.get_tightbbox() for ax in figure.axes if ax is not texts[label].axes]
        assert box.x0 >= 0 and not any(box.overlaps(other) for other in others)
