"""Opinions in steps of time: the ends against exact solutions, the decision against spectra, the bound against runs."""

from __future__ import annotations

import csv
import json
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
from ptcc_certify.bounds.final_state.in_steps import opinions_in_steps, period
from ptcc_certify.errors import PTCCError
from ptcc_certify.graphs.stubborn import agent_nodes

CLASSES = all_classes()
WEIGHTS = ("small ints", "decimals", "ratios")
TEAM = "ann,bob,1\nbob,ann,1\nbob,eve,-2\neve,dan,1\ndan,eve,1\n"


def rational(x: Fraction) -> fmpq:
    return fmpq(x.numerator, x.denominator)


def drawn(seed: int) -> tuple[ptcc.SignedDigraph, dict[str, Fraction], list[Fraction]]:
    """Return a random graph of any class, often with stubborn agents, the shares kept, and x(0) of its agents."""
    rng = np.random.default_rng([7, seed])
    kwargs: dict[str, Any] = CLASSES[seed % len(CLASSES)][1]
    if not ("n" in kwargs or (kwargs.get("isolated") and not kwargs["parts"])):
        kwargs = dict(kwargs, n=int(rng.integers(smallest(**kwargs), max(smallest(**kwargs), 8) + 1)))
    graph = random_graph(rng, **dict(kwargs, weights=WEIGHTS[seed % len(WEIGHTS)])).graph
    x0 = [Fraction(int(x), 10) for x in rng.integers(-50, 51, graph.n_nodes)]
    own = {a: Fraction(int(rng.integers(0, 8)), 8) for a in graph.labels if rng.random() < (seed % 3) / 2}
    if seed % 4:
        some = rng.permutation(graph.labels)[: 1 + seed % graph.n_nodes].tolist()
        graph = ptcc.with_stubborn(graph, {a: Fraction(int(rng.integers(1, 40)), 8) for a in some})
    return graph, own, x0


def matrix_of(graph: ptcc.SignedDigraph, own: dict[str, Fraction]) -> list[list[Fraction]]:
    """Return A, prejudices and whoever hears nobody with 1 on the diagonal, from the definition."""
    n, labels = graph.n_nodes, graph.labels
    A = [[Fraction(0)] * n for _ in range(n)]
    for s, t, weight in graph.edges:
        A[graph.index[t]][graph.index[s]] = weight
    for k, row in enumerate(A):
        share, total = own.get(labels[k], Fraction(0)), sum(map(abs, row))
        A[k] = [(1 - share) * w / total for w in row] if total else row
        A[k][k] = share if total else Fraction(1)
    return A


@pytest.mark.few(60)
@pytest.mark.parametrize("seed", range(320))
def test_ends_are_the_exact_limits_or_means_and_runs_keep_the_bound(seed: int) -> None:
    graph, own, x0 = drawn(seed)
    found = opinions_in_steps(graph, x0, self_weight=own or 0)
    A, n = matrix_of(graph, own), graph.n_nodes
    assert all(sum(map(abs, row)) == 1 for row in A)
    x, X = (
        fmpq_mat([[rational(Fraction(v))] for v in values])
        for values in (found.initial_state, found.final_state.states)
    )
    M = fmpq_mat([[rational(a) for a in row] for row in A])
    rest = fmpq_mat([[fmpq(int(i == j)) for j in range(n)] for i in range(n)]) - M
    assert M * X == X
    # X is the projection of x(0) on the kernel of I - A along its range: x(0) - X is in that range
    beside = fmpq_mat([[*(rest[i, j] for j in range(n)), x[i, 0] - X[i, 0]] for i in range(n)])
    assert rest.rank() == beside.rank()
    floats = np.array([[float(a) for a in row] for row in A])
    circle = [z for z in np.linalg.eigvals(floats) if abs(z) > 1 - 1e-9 and abs(z - 1) > 1e-6]
    assert found.converges == (not circle)
    if found.converges:
        state, limit = np.array([float(v) for v in found.initial_state]), [float(v) for v in found.final_state.states]
        assert np.allclose(np.linalg.matrix_power(floats, 2**16) @ state, limit, atol=1e-6)
    if found.decay is not None:
        _keeps_the_bound(found, A)


def _keeps_the_bound(found: Any, A: list[list[Fraction]]) -> None:
    """The bound holds in rationals at ten steps, and its rows are an inequality of ``|A|``."""
    u, decay, x = found.decay.weights, found.decay, list(found.initial_state)
    assert all(sum(abs(A[k][v]) * u[v] for v in u) <= decay.factor * u[k] for k in u)
    for step in range(11):
        errors = {k: abs(x[k] - found.final_state.states[k]) for k in u}
        assert all(errors[k] <= decay.factor**step * decay.size * u[k] for k in u)
        assert max(errors.values()) <= decay.after(step)
        x = [sum((a * v for a, v in zip(row, x, strict=True) if a), Fraction(0)) for row in A]
    soon = decay.steps(Fraction(1, 50))
    assert decay.after(soon) <= Fraction(1, 50) * (1 + Fraction(1, 10**12))


def group(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
    """Return a strongly connected signed graph: cycles share a divisor or not, signs are of camps, turned, or any."""
    rng = np.random.default_rng([8, seed])
    d, n = int(rng.integers(1, 5)), int(rng.integers(1, 9))
    n = max(n, d)
    classes = np.sort(np.concatenate([np.arange(d), rng.integers(0, d, n - d)]))
    while True:
        allowed = (classes[:, None] + 1) % d == classes[None, :] % d
        edges = allowed & (rng.random((n, n)) < rng.uniform(0.3, 1))
        if d > 1 or seed % 3:
            np.fill_diagonal(edges, edges.diagonal() & bool(seed % 3 == 1))
        reach = np.linalg.matrix_power(np.eye(n, dtype=int) + edges, n) > 0
        if edges.any() and reach.all():
            break
        if n == 1:
            edges[0, 0] = True
            break
    source, target = np.nonzero(edges)
    camps = rng.choice([-1, 1], n)
    sign = camps[source] * camps[target]
    how = seed // 3 % 4
    if how == 1:
        sign = np.where(classes[target] == 0, -sign, sign)
    elif how == 2:
        sign = -sign
    elif how == 3:
        sign = rng.choice([-1, 1], source.size)
    return source, target, sign, n


@pytest.mark.few(400)
@pytest.mark.parametrize("part", range(8))
def test_the_round_of_a_group_is_that_of_its_spectrum(part: int) -> None:
    seen: set[int] = set()
    for seed in range(60 * part, 60 * part + 60):
        source, target, sign, n = group(seed)
        A = np.zeros((n, n))
        A[target, source] = sign * np.random.default_rng(seed).uniform(0.5, 2, source.size)
        A /= np.abs(A).sum(axis=1, keepdims=True)
        steps = period(source, target, sign)
        circle = [z for z in np.linalg.eigvals(A) if abs(z) > 1 - 1e-7]
        assert all(abs(z**steps - 1) < 1e-5 for z in circle), (seed, steps)
        if steps == 1:
            assert all(abs(z - 1) < 1e-6 for z in circle), seed
        else:
            assert any(abs(z - np.exp(2j * np.pi / steps)) < 1e-6 for z in circle), (seed, steps)
        seen.add(steps)
    assert {1, 2} < seen and len(seen) > 3


def test_three_mutual_enemies_alternate_although_nothing_in_them_is_in_rounds() -> None:
    enemies = [(a, b, -1) for a in (1, 2, 3) for b in (1, 2, 3) if a != b]
    found = opinions_in_steps(enemies, [1, 1, 1])
    assert found.periods == {(0, 1, 2): 2} and not found.converges
    assert found.run(3).tolist() == [[1] * 3, [-1] * 3, [1] * 3, [-1] * 3]
    assert opinions_in_steps(enemies, [1, 1, 1], self_weight="1=0.1").converges  # one who keeps a share is enough


def test_followers_of_a_group_in_rounds_do_not_settle_either() -> None:
    cycle = [("a", "b", 1), ("b", "c", 1), ("c", "a", 1), ("c", "d", 1), ("rest", "e", 1), ("e", "f", 1)]
    found = opinions_in_steps(cycle, dict(zip("abcdef", [3, 0, 0, 0, 0, 0], strict=True)) | {"rest": 7})
    assert set(found.periods.values()) == {3}
    assert {a for a, moves in zip(found.graph.labels, found.restless, strict=True) if moves} == {*"abcd"}
    assert found.final_state["d"] == 1 and found.final_state["f"] == 7
    column = found.run(9)[:, found.graph.index["d"]].tolist()
    assert column[1:] == [0, 0, 0, 3, 0, 0, 3, 0, 0] or column[3:6] == column[6:9] != [1, 1, 1]


def test_a_matrix_as_degroot_prints_it_is_taken_with_its_diagonal() -> None:
    """DeGroot (1974): two people with rows (1/2, 1/2) and (1/4, 3/4) agree on one third and two thirds."""
    two = ptcc.SignedDigraph.from_matrix([[0, "0.5"], ["0.25", 0]], orientation="listens")
    found = opinions_in_steps(two, [1, 0], self_weight={"1": "0.5", "2": "0.75"})
    assert found.converges and found.final_state.states == (Fraction(1, 3), Fraction(1, 3))
    assert found.influence.row(0) == {0: Fraction(1, 3), 1: Fraction(2, 3)}


def test_four_people_of_friedkin_and_johnsen_end_where_they_print_it() -> None:
    """Rows of W, of whom 3 hears nobody; susceptibility 1 - w_kk, so ``a_kl = (1 - w_kk) w_kl``."""
    W = [["0.22", "0.12", "0.36", "0.3"], ["0.147", "0.215", "0.344", "0.294"], [0, 0, 1, 0]]
    W.append(["0.09", "0.178", "0.446", "0.286"])
    exact = [[Fraction(w) for w in row] for row in W]
    heard = [[(1 - row[k]) * w if k != m else 0 for m, w in enumerate(row)] for k, row in enumerate(exact)]
    theta = {str(k + 1): row[k] for k, row in enumerate(exact) if k != 2}
    own = {str(k + 1): (1 - row[k]) * row[k] for k, row in enumerate(exact) if k != 2}
    debate = ptcc.with_stubborn(ptcc.SignedDigraph.from_matrix(heard, orientation="listens"), theta)
    found = opinions_in_steps(debate, [25, 25, 75, 85], self_weight=own)
    assert [round(float(found.final_state[k])) for k in "1234"] == [60, 60, 75, 75]
    assert np.allclose(found.run(200)[-1], [float(x) for x in found.final_state.states])


@pytest.mark.parametrize("share", [1, "-0.1", "1.5", {"a": 2}, "a=x", {"z": 0}, "a=0.1,a=0.2"])
def test_what_is_no_share_is_refused_in_one_line(share: Any) -> None:
    with pytest.raises(PTCCError) as caught:
        opinions_in_steps([("a", "b", 1), ("b", "a", 1)], [1, 2], self_weight=share)
    assert "\n" not in str(caught.value)


REAL = {
    "bales.csv": {},
    "highland_tribes.csv": {},
    "sampson_t4.csv": {},
    "sampson_sanctions.csv": {},
    "regulatory_013.csv": {},
}


@pytest.mark.parametrize("name", REAL)
def test_opinions_of_real_graphs_end_where_long_runs_do(name: str, real_data: Path) -> None:
    graph = ptcc.read_graph(real_data / name)
    first = graph.labels[int(graph.target[0])]
    debate = ptcc.with_stubborn(graph, {first: "0.5"})
    x0 = [Fraction((7 * k) % 11 - 5) for k in range(graph.n_nodes)]
    found = opinions_in_steps(debate, x0, self_weight="0.1")
    assert found.converges  # everybody keeps a share
    end = np.array([float(x) for x in found.final_state.states])
    A = np.eye(debate.n_nodes) - found.structure.graph.dense_laplacian()
    assert np.allclose(np.linalg.matrix_power(A, 2**16) @ found.run(0)[0], end, atol=1e-7)
    assert len(agent_nodes(debate)) == graph.n_nodes


def test_ends_of_many_agents_are_in_proved_intervals_and_runs_keep_the_bound() -> None:
    """400 agents, above what is exact: every tenth is stubborn, opponents are a third."""
    rng = np.random.default_rng(3)
    edges = [
        (f"n{s}", f"n{t}", int(rng.choice([1, 2, -1])))
        for t in range(400)
        for s in rng.choice(400, 5, replace=False).tolist()
        if s != t
    ]
    debate = ptcc.with_stubborn(edges, {f"n{k}": 2 for k in range(0, 400, 10)})
    found = opinions_in_steps(debate, [Fraction(int(x), 10) for x in rng.integers(-50, 51, 400)])
    assert found.converges and found.decay is not None and found.final_state.radius is not None
    errors = np.abs(found.run(60) - np.array([float(x) for x in found.final_state.states]))
    for step in (0, 1, 5, 20, 60):
        assert errors[step].max() <= float(found.decay.after(step)) * (1 + 1e-9)
    assert errors[min(60, found.decay.steps(Fraction(1, 10)))].max() <= 0.1


# ---------------------------------------------------------------------- on the command line


@pytest.fixture
def team(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("team.csv").write_text(TEAM, encoding="utf-8")


@pytest.mark.usefixtures("team")
def test_the_command_tells_ends_bound_and_who_decides_and_writes_the_run() -> None:
    asked = ("opinions", "team.csv", "--stubborn", "ann=0.5,dan=1", "--x0", "5,2,4,-1")
    run = command(*asked, "--steps", "3", "-o", "run.csv")
    assert run.code == 0, run.err
    for part in ("settles    from every x(0)", "ann=5, bob=5, eve=-4.2, dan=-2.6 (exact)", "ann's prejudice 70 %"):
        assert part in run.out
    rows = list(csv.reader(StringIO(Path("run.csv").read_text(encoding="utf-8"))))
    assert rows[0] == ["step", "ann", "bob", "eve", "dan"] and len(rows) == 5
    assert np.allclose([float(x) for x in rows[2]], [1, 3, 5, -5 / 3, 1.5])  # eve: (-2 * 2 - 1) / 3
    told = json.loads(command(*asked, "--json").out)
    assert told["converges"] and told["final_state"]["eve"] == "-21/5" and told["bound"]["steps"] > 0
    alone = command("opinions", "team.csv", "--x0", "5,2,4,-1")
    assert "ann, bob go on in rounds of 2 steps" in alone.out and "nor eve, dan, who hear of them" in alone.out
    moved = command(*asked, "--prejudice", "dan=2", "--self-weight", "ann=0.3")
    assert "eve=-3.6, dan=-0.8 (exact)" in moved.out


REFUSED = {
    "the repelling rule": (("--rule", "repelling"), "--rule repelling: divides by the sum of w_kl, not of |w_kl|"),
    "a share of one": (("--self-weight", "1"), "--self-weight: of ann is 1; give the share 0 <= s < 1"),
    "a distance of 0": (("--within", "0"), "--within: is a distance; give a number > 0"),
    "a figure": (("-o", "run.png"), "run.png: the run is a table; write it to .csv"),
    "a negative prejudice": (("--stubborn", "ann=-1"), "repels it from its prejudice"),
}


@pytest.mark.usefixtures("team")
@pytest.mark.parametrize("case", REFUSED)
def test_what_is_another_model_is_refused_in_one_line(case: str) -> None:
    words, message = REFUSED[case]
    run = command("opinions", "team.csv", *words)
    assert run.code == 2 and message in run.err and run.err.count("\n") == 1, run.err
