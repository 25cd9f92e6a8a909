"""Captured agents: how far they move the others, by the definition, against signals that vary, and as it is told."""

from __future__ import annotations

import csv
import json
from fractions import Fraction
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bad_inputs import ptcc as command
from generators import all_classes, random_graph, smallest
from scipy.linalg import expm

import ptcc_certify as ptcc
from ptcc_certify.bounds.final_state.captured import captured, ranking
from ptcc_certify.errors import ParameterError, UnknownAgentError
from ptcc_certify.graphs.structure import analyse

CLASSES = all_classes()
WEIGHTS = ("small ints", "decimals", "log6", "ratios")
#: Two enemies that hear a: constants of a cancel in b, signals that turn their sign do not.
ENEMIES = [("a", "b", 1), ("a", "c", 1), ("b", "c", -1), ("c", "b", -2)]


def graph_of(seed: int, most: int = 9, weights: tuple[str, ...] = WEIGHTS) -> ptcc.SignedDigraph:
    """Return a random graph; the classes of the theory take turns."""
    rng = np.random.default_rng(seed)
    kwargs: dict[str, Any] = CLASSES[seed % len(CLASSES)][1]
    if not ("n" in kwargs or (kwargs.get("isolated") and not kwargs["parts"])):
        least = smallest(**kwargs)
        kwargs = dict(kwargs, n=int(rng.integers(least, max(least, most) + 1)))
    return random_graph(rng, **dict(kwargs, weights=weights[seed % len(weights)])).graph


def deaf(graph: ptcc.SignedDigraph, agents: set[str]) -> ptcc.SignedDigraph:
    edges = [(a, b, w) for a, b, w in graph.edges if b not in agents]
    return ptcc.SignedDigraph.from_edges(edges, nodes=graph.labels)


def chosen_of(graph: ptcc.SignedDigraph, seed: int) -> list[str]:
    """Return one to three agents, not all."""
    rng = np.random.default_rng([1, seed])
    return rng.permutation(graph.labels)[: min(1 + seed % 3, graph.n_nodes - 1)].tolist()


@pytest.mark.few(16)
@pytest.mark.parametrize("seed", range(5 * len(CLASSES)))
def test_final_states_span_what_the_definition_says(seed: int) -> None:
    """Ends of all signs of what captured agents show, in the graph in which they hear nobody, exactly."""
    graph = graph_of(seed)
    if graph.n_nodes < 2:
        return
    agents, radius = chosen_of(graph, seed), Fraction(3, 1 + seed % 4)
    found = ptcc.influence(graph).captured(*agents, radius=radius)
    assert found.exact and set(found.agents) == set(agents) and set(found.constant) == {*graph.labels} - set(agents)
    rest, begin = deaf(graph, set(agents)), {label: Fraction(k * k - 5, k + 2) for k, label in enumerate(graph.labels)}
    ends = [
        ptcc.final_state(rest, begin | dict(zip(agents, (sign * radius for sign in signs), strict=True)))
        for signs in product((-1, 1), repeat=len(agents))
    ]
    for label, size in found.constant.items():
        reached = [end[label] for end in ends]
        assert max(reached) - min(reached) == 2 * size, label
        assert sum(map(abs, found.weights[label].values())) <= 1 and size <= found.varying[label] <= radius
    everybody_agrees = analyse(graph).gauge is not None
    assert not everybody_agrees or found.constant == found.varying


@pytest.mark.few(16)
@pytest.mark.parametrize("seed", range(5 * len(CLASSES)))
def test_one_matrix_serves_every_agent(seed: int) -> None:
    """The ranking, by columns of one inverse, against the graph in which each agent hears nobody, and in floats."""
    graph = graph_of(seed)
    if graph.n_nodes < 2:
        return
    who = ptcc.influence(graph)
    ranked = who.ranking(radius="1/2")
    assert [row.total for row in ranked] == sorted((row.total for row in ranked), reverse=True)
    assert {row.agent for row in ranked} == set(graph.labels)
    floats = {row.agent: row for row in ptcc.influence(graph, exact=False).ranking("1/2")}
    for row in ranked:
        alone = who.captured(row.agent, radius=Fraction(1, 2))
        assert row.total == sum(alone.constant.values()) and row.varying == sum(alone.varying.values())
        assert row.largest == max(alone.constant.values()) == alone.constant[row.moved_most]
        near = floats[row.agent]
        for name in ("total", "largest", "varying"):
            assert abs(getattr(near, name) - float(getattr(row, name))) <= 1e-9 * graph.n_nodes
    numerical = ptcc.influence(graph, exact=False).captured(ranked[0].agent, radius="1/2")
    exact = who.captured(ranked[0].agent, radius="1/2")
    assert not numerical.exact
    assert all(abs(x - exact.constant[k]) < 1e-9 for k, x in numerical.constant.items())


@pytest.mark.few(16)
@pytest.mark.parametrize("seed", range(5 * len(CLASSES)))
def test_closed_components_are_the_old_ones_without_captured_agents_and_these(seed: int) -> None:
    graph = graph_of(seed)
    agents = set(chosen_of(graph, seed))

    def closed(graph: ptcc.SignedDigraph) -> set[frozenset[str]]:
        return {frozenset(graph.labels[v] for v in c.nodes) for c in analyse(graph).closed_components}

    kept = {nodes for nodes in closed(graph) if not nodes & agents}
    assert closed(deaf(graph, agents)) == kept | {frozenset({agent}) for agent in agents}


def attack(graph: ptcc.SignedDigraph, agent: str, target: str, steps: int = 2000) -> tuple[float, float]:
    """Show the worst signal within [-1, 1] on the clock; return where the target is then, and the sum of its kernel.

    The signal turns its sign with the kernel, and is held from step to step; each step is exact by an exponential.
    """
    L = deaf(graph, {agent}).laplacian().toarray()
    a = graph.labels.index(agent)
    keep = [v for v, label in enumerate(graph.labels) if v != a and L[v].any()]
    A, b, k = -L[np.ix_(keep, keep)], -L[keep, a], keep.index(graph.labels.index(target))
    rates = -np.linalg.eigvals(A).real
    h = 30 / rates[rates > 1e-9].min() / steps
    block = expm(h * np.block([[A, b[:, None]], [np.zeros((1, len(keep) + 1))]]))
    step, push = block[:-1, :-1], block[:-1, -1]
    kernel, column = [], push
    for _ in range(steps):
        kernel.append(column[k])
        column = step @ column
    x = np.zeros(len(keep))
    for sign in np.sign(kernel[::-1]):
        x = step @ x + push * sign
    return float(x[k]), float(np.abs(kernel).sum())


def test_constants_are_not_the_worst_on_signed_graphs() -> None:
    found = ptcc.influence(ENEMIES).captured("a")
    assert found.constant == {"b": 0, "c": Fraction(1, 2)} and found.varying == {"b": 1, "c": 1}
    reached, _ = attack(ptcc.as_graph(ENEMIES), "a", "b")
    assert abs(reached - 4 ** (-1 / 3) / 2) < 1e-3  # the integral of |4 e^(-4s) - e^(-s)|/3


@pytest.mark.few(8)
@pytest.mark.parametrize("seed", range(2 * len(CLASSES)))
def test_the_worst_signal_that_varies_stays_below_the_bound_and_does_no_less_than_constants(seed: int) -> None:
    graph = graph_of(seed, 7, ("units", "small ints", "ratios"))
    who = ptcc.influence(graph)
    for agent in graph.labels[:2] if graph.n_nodes > 1 else ():
        found = who.captured(agent)
        for target, bound in found.varying.items():
            if bound:
                reached, total = attack(graph, agent, target, 400)
                assert float(found.constant[target]) - 1e-9 <= reached <= float(bound) + 1e-9, (agent, target)
                assert abs(reached - total) < 1e-9


def test_large_graphs_are_numerical_and_say_so() -> None:
    """Rows above those of one factor, with and without one: a ring on which walks take long to forget."""
    n = 2500
    ring = [(k, (k + step) % n, 1) for k in range(n) for step in (1, 2)]
    found = ptcc.influence(ring).captured("0", "7")
    assert not found.exact and max(abs(x - 1) for x in found.constant.values()) < 1e-6
    tree = [((k - 1) // 2, k, (-1) ** k) for k in range(1, n)]
    sizes = ptcc.influence(tree).captured("0").constant
    assert len(sizes) == n - 1 and all(abs(x - 1) < 1e-9 for x in sizes.values())
    ranked = ptcc.influence([*ring[:600], (300, 0, -1)]).ranking()
    assert len(ranked) == 302 and ranked[0].total >= ranked[-1].total


def test_what_floats_do_not_resolve_is_refused() -> None:
    """Nearly balanced, listening backward 10^8 times as much: the inverse leaves float64, and rationals do not."""

    def chain(n: int) -> list[tuple[int, int, int]]:
        return [(k, k + 1, 1) for k in range(n)] + [(k + 1, k, 10**8) for k in range(n)] + [(n, 0, -1)]

    assert ptcc.influence(chain(60)).ranking()[0].largest == 1
    with pytest.raises(ParameterError, match="too ill-conditioned for floats; give weights of more even size"):
        ptcc.influence(chain(130)).ranking()


def test_the_order_of_nodes_does_not_matter() -> None:
    graph = ptcc.as_graph([(1, 2, 1), (1, 3, 1), (2, 3, -1), (3, 2, -2), (2, 4, 1)])
    turned = graph.subgraph([3, 2, 1, 0])
    assert turned.labels == ("4", "3", "2", "1")
    for agent in graph.labels:
        one, other = (ptcc.influence(g).captured(agent) for g in (graph, turned))
        assert one.constant == other.constant and one.varying == other.varying
    rows = [
        {reach.agent: (reach.total, reach.varying) for reach in ptcc.influence(g).ranking()} for g in (graph, turned)
    ]
    assert rows[0] == rows[1]


def test_who_cannot_be_captured_is_refused() -> None:
    who = ptcc.influence(ENEMIES)
    with pytest.raises(UnknownAgentError, match="no agent is called 'B'; there are a, b, c; did you mean b"):
        who.captured("B")
    with pytest.raises(ParameterError, match="every agent is captured; name some of the 3"):
        who.captured("a", "b", "c")
    with pytest.raises(ParameterError, match="no agent is captured"):
        who.captured()
    with pytest.raises(ParameterError, match="radius = 0 is outside its domain"):
        who.ranking(radius=0)
    with pytest.raises(ParameterError, match="a single agent has no others"):
        ranking(analyse(ptcc.SignedDigraph.from_edges([], nodes=["a"])), 1, True)
    line = analyse([(k, k + 1, 1) for k in range(10_000)])
    with pytest.raises(ParameterError, match="up to 10,000, and these are 10,001"):
        ranking(line, 1, False)
    assert len(captured(line, [5], 1, False).constant) == 10_000


def test_the_command_prints_and_writes(tmp_path: Path) -> None:
    file = tmp_path / "enemies.csv"
    file.write_text("".join(f"{a},{b},{w}\n" for a, b, w in ENEMIES), encoding="utf-8")
    run = command("influence", str(file), "--captured", "a", "-o", str(tmp_path / "moves.csv"))
    assert run.code == 0 and "captured   a hears nobody, shows anything within [-1, 1] (exact)\n" in run.out
    assert "constant   moves x(T) of c by up to 0.5, of b by 0\nvarying    moves x of b, c by up to 1\n" in run.out
    rows = list(csv.DictReader((tmp_path / "moves.csv").read_text(encoding="utf-8").splitlines()))
    assert rows[1] == {"node": "c", "constant": "0.5", "varying": "1.0"}
    told = json.loads(command("influence", str(file), "--captured", "b, c", "--radius", "3/2", "--json").out)
    assert told["exact"] is True and told["agents"] == ["b", "c"] and told["constant"] == {"a": "0"}
    ranked = command("influence", str(file), "--captured", "all", "-o", str(tmp_path / "all.csv"))
    assert ranked.code == 0 and "each alone hears nobody, shows anything within [-1, 1] (exact)\n" in ranked.out
    rows = list(csv.DictReader((tmp_path / "all.csv").read_text(encoding="utf-8").splitlines()))
    assert [row["agent"] for row in rows] == ["c", "a", "b"]
    assert "\n           a: 0.5 in all, c most, by 0.5; varying at most 2\n" in ranked.out
    told = json.loads(command("influence", "fig5a", "--captured", "all", "--json").out)
    assert len(told["ranking"]) == 16 and told["ranking"][0]["moved_most"] == "2"
    assert "... (16 in all)" in command("influence", "fig5a", "--captured", "all").out
    assert "16: 0.9172" in command("influence", "fig5a", "--captured", "all", "-v").out


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("--captured", "17"), "no agent is called '17'"),
        (("--captured", ",".join(map(str, range(1, 17)))), "every agent is captured"),
        (("--captured", "1", "--radius", "-1"), "--radius = -1 is outside its domain"),
        (("--captured", "1", "--radius", "far"), "--radius:"),
        (("--radius", "2"), "--radius is of what captured agents show"),
        (("--captured", "1", "-o", "q.png"), "write it to .csv"),
        (("--captured", ""), "no agent is captured"),
        (("--captured", '1,"2'), "names no agents; write A,B"),
        (("--captured", "1\n2"), "names no agents; write A,B"),
    ],
)
def test_bad_questions_are_refused_in_one_line(words: tuple[str, ...], says: str) -> None:
    run = command("influence", "fig5a", *words)
    assert run.code == 2 and run.err.count("\n") == 1 and says in run.err and not run.out


def test_an_agent_called_all_or_with_a_comma(tmp_path: Path) -> None:
    file = tmp_path / "odd.csv"
    file.write_text('all,"x,y",1\n"x,y",z,-2\n', encoding="utf-8")
    run = command("influence", str(file), "--captured", "all")
    assert run.code == 2 and run.err.count("\n") == 1 and 'captured("all") or .ranking()' in run.err
    assert command("influence", str(file), "--captured", "x,y").code == 0
    told = json.loads(command("influence", str(file), "--captured", '"x,y",z', "--json").out)
    assert told["agents"] == ["x,y", "z"] and told["constant"] == {"all": "0"}
