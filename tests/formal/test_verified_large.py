"""The verified checker on certificates of the large form: random graphs are accepted, and mutants only if true."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
from collections import Counter
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from asked import certify_words
from generators import all_classes, random_graph, smallest, sparse_digraph
from mutations import Json, changed, mutants, resealed, without
from verified import ACCEPTED, UNREAD, named, program, said, unchecked

from ptcc_certify import SignedDigraph
from ptcc_certify.bounds.final_state import of_graph as final_states
from ptcc_certify.certificate import graph_certification
from ptcc_certify.certificate.certification import certify
from ptcc_certify.checker import check
from ptcc_certify.lyapunov import dominance
from ptcc_certify.model import NominalProtocol, SlidingModeProtocol
from ptcc_certify.model.asks import Asks

NOMINAL = NominalProtocol(T=1, rho1=1, rho2=1, kappa=2)
SLIDING = SlidingModeProtocol(T_r="0.5", T_s=1, rho1=1, rho2=1, kappa=2, mu1=2, mu2=1, mu3=1, delta=1)
CLASSES = dict(all_classes())


@pytest.fixture(autouse=True)
def small_is_large(monkeypatch: pytest.MonkeyPatch) -> None:
    """Treat every graph as a large one."""
    monkeypatch.setattr(graph_certification, "EXACT_NODES", 0)
    monkeypatch.setattr(final_states, "EXACT_NODES", 0)


def made(name: str, seed: int = 3, sliding: bool = False) -> Json:
    """The certificate of a graph of a class, in the large form."""
    rng, kwargs = np.random.default_rng(seed), CLASSES[name]
    fixed = "isolated" in kwargs and not kwargs["parts"]
    graph = random_graph(rng, **{"n": smallest(**kwargs) + (0 if fixed else seed % 5), **kwargs}).graph
    start = [int(v) for v in rng.integers(-9, 10, graph.n_nodes)]
    more = {"sigma0": [int(v) for v in rng.integers(-2, 3, graph.n_nodes)]} if sliding else {}
    cert = certify_words(graph, SLIDING if sliding else NOMINAL, start, simulation=False, time_limit=3600, **more)
    return {**json.loads(cert.to_json()), "unverified": {}}


def rate_too_high(document: Json) -> Json:
    """The same with the largest rate higher by a millionth, wherever it is told; the threshold is the same number."""
    rate = document["rates"]["proved"]
    higher = str(Fraction(rate) * (1 + Fraction(1, 10**6)))
    return resealed(json.loads(json.dumps(document).replace(rate, higher)))


#: Of a large form not checked besides: the upper bound on the rate; left null vectors but for what they say of the end.
NOT_CHECKED = (("influence", "components"), ("rates", "upper_bound"), ("input", "threshold", "upper"))


def compare(document: Json, path: tuple, folder: Path) -> bool:
    """Whether both checkers agree on a mutant; else the cause is one that is listed."""
    python, (code, text) = check(resealed(document)), said(resealed(document), folder)
    accepted = code in ACCEPTED
    if python.accepted == accepted:
        return True
    if accepted:
        left = named(text)
        told = unchecked(document, path, left) or any(path[: len(part)] == part for part in NOT_CHECKED)
        # true, but not as narrow as is proved
        narrow = path[0] == "final_state" and any(word in str(python.reason) for word in ("radius", "wider than"))
        assert told or narrow or str(python.rejected) in left, (path, python.rejected, python.reason)
    else:
        # radii of followers are proved by ``u`` from the intervals of leaders as stated, however wide they are
        at = path[0] == "final_state" or path[2:4] == ("witness", "u")
        wide = code == 1 and at and "final-state of graph" in text
        assert wide or (code == 2 and any(word in text for word in UNREAD)), (path, python, text)
    return False


@pytest.mark.few(0)
@pytest.mark.parametrize("name", ["3.1 all single", "2.1 K=1", "3.1 mixed", "1.1"])
def test_a_large_form_is_accepted_and_what_is_proved_of_it_is_named(name: str, tmp_path: Path) -> None:
    for sliding in (False, True):
        document = made(name, sliding=sliding)
        code, text = said(document, tmp_path)
        assert code == 0 and check(document).accepted, text
        for kind in (
            "structure of graph.modes[0]",
            "claim of graph",
            "dominance of decays[0]",
        ):
            assert f"verified    {kind}" in text
        assert "verified    final-state of graph" in text and "not checked final_state" not in text
        assert "not checked rates.upper_bound" in text


def test_false_rates_intervals_and_structure_of_a_large_form_are_rejected(tmp_path: Path) -> None:
    document = made("3.1 all single irreducible followers", 4)
    code, text = said(rate_too_high(document), tmp_path)
    assert code == 1 and "dominance" in text
    label, ball = next((k, v) for k, v in document["final_state"].items() if isinstance(v, dict))
    for new in ({**ball, "radius": "1e-300"}, {**ball, "mid": str(Fraction(ball["mid"]) + Fraction(1, 1000))}):
        code, text = said(resealed(changed(document, ("final_state", label), new)), tmp_path)
        assert code == 1 and "final-state" in text
    leader = document["structure"][0]["leaders"][0]
    code, text = said(resealed(changed(document, ("final_state", leader), "1/7")), tmp_path)
    assert code == 1 and "final-state" in text
    step = next(i for i, s in enumerate(document["proof"]) if s["kind"] == "dominance")
    for new in ("0", "-1"):
        assert said(resealed(changed(document, ("proof", step, "witness", "vector", 0), new)), tmp_path).code == 1


def final_states_moved(document: Json, folder: Path) -> None:
    """A group that ends a little elsewhere, all of it, is rejected."""
    groups = [one for one in document["structure"][0]["closed_components"] if one["balanced"] and len(one["nodes"]) > 1]
    assert groups
    for group in groups:
        for off in (Fraction(1, 10**3), Fraction(-1, 10**5)):
            moved = document
            for label, camp in zip(group["nodes"], group["gauge"], strict=True):
                old = document["final_state"][label]
                mid = Fraction(old["mid"] if isinstance(old, dict) else old) + camp * off
                new = {**old, "mid": str(mid)} if isinstance(old, dict) else str(mid)
                moved = changed(moved, ("final_state", label), new)
            code, text = said(resealed(moved), folder)
            assert code == 1 and "final-state" in text


def test_a_balanced_group_that_ends_elsewhere_is_rejected(tmp_path: Path) -> None:
    for name in ("1.1", "2.1 K>=2", "3.1 mixed"):
        final_states_moved(made(name, 4), tmp_path)


def with_factor(monkeypatch: pytest.MonkeyPatch, kind: str) -> Json:
    """A certificate of a leader group of eight nodes that is proved by a sparse factor: of which form."""
    monkeypatch.setattr(dominance, "EXACT_NODES", 4)
    rng = np.random.default_rng(5)
    pairs = [(i, (i + k) % 8) for i in range(8) for k in ((1, 3) if kind == "pinned" else (1,))]
    weights = [int(w) for w in rng.integers(1, 9, len(pairs))]
    camps = [1, -1, 1, 1, -1, -1, 1, -1]
    edges = [(i, j, w * camps[i] * camps[j]) for (i, j), w in zip(pairs, weights, strict=True)]
    if kind == "whole":
        edges[0] = (*edges[0][:2], -edges[0][2])
    if kind == "tree":
        edges += [(j, i, w) for i, j, w in edges]
    edges += [(0, 8, 2), (8, 9, -1), (3, 9, 1)]
    graph = SignedDigraph.from_edges(edges)
    cert = certify(
        graph, NOMINAL, [int(v) for v in rng.integers(-9, 10, 10)], asks=Asks(simulation=False, time_limit=3600)
    )
    document = {**json.loads(cert.to_json()), "unverified": {}}
    factor = next(factors(document))[1]
    assert ("parents" in factor) == (kind == "tree")
    assert len(factor["order"]) == (8 if kind == "whole" else 7)
    return document


def factors(document: Json) -> Iterator[tuple[tuple, Json]]:
    """The sparse factors of a document, each with its path."""
    for i, step in enumerate(document["proof"]):
        if step["kind"] == "dominance":
            for k, entry in enumerate(step["witness"]["groups"]):
                if isinstance(entry, dict):
                    yield ("proof", i, "witness", "groups", k, "factor"), entry["factor"]


@pytest.mark.few(1)
@pytest.mark.parametrize("kind", ["whole", "pinned", "tree"])
def test_a_leader_group_is_proved_by_its_factor_and_by_no_other(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    document = with_factor(monkeypatch, kind)
    code, text = said(document, tmp_path)
    assert code == 0 and check(document).accepted and "verified    dominance of decays[0]" in text, text
    if kind != "whole":
        final_states_moved(document, tmp_path)
    path, factor = next(factors(document))
    rates = path[:-1]
    g = Fraction(document["proof"][path[1]]["witness"]["groups"][path[4]]["rate"])
    swapped = [factor["order"][1], factor["order"][0], *factor["order"][2:]]
    big = max(range(len(factor["data"])), key=lambda k: abs(factor["data"][k]))
    false = [((*rates, "rate"), str(2 * g)), ((*path, "data", big), factor["data"][big] * 3 // 2)]
    false += [((*path, "power"), factor["power"] - 1), ((*path, "bits"), factor["bits"] - 1)]
    false += [((*path, "exponents", 0), factor["exponents"][0] - 1), ((*path, "order"), swapped)]
    false += [((*path, "order", 0), factor["order"][1]), ((*path, "indices", 0), 1), ((*path, "exponents", 0), 65_537)]
    false += [((*path, "weights"), [1] * (len(factor["order"]) - 1)), ((*path, "parents"), [0] * 8)]
    if kind == "tree":
        root = factor["parents"].index(-1)
        false += [((*path, "parents", root), (root + 1) % 8), ((*path, "parents", (root + 1) % 8), -1)]
    mutants_ = [(where, changed(document, where, new)) for where, new in false]
    if kind == "tree":
        mutants_.append(((*path, "parents"), without(document, (*path, "parents"))))
    for where, mutant in mutants_:
        sealed = resealed(mutant)
        assert not check(sealed).accepted, where
        code, text = said(sealed, tmp_path)
        assert code == 1, (where, text)


def test_a_factor_in_side_files_is_read_and_its_hash_compared(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    document = with_factor(monkeypatch, "pinned")
    path, factor = next(factors(document))

    def beside(key: str) -> Json:
        """Write the integers of a key as a side file; return what stands in their place."""
        file = tmp_path / f"{key}.npy"
        np.save(file, np.array(factor[key], dtype="<i8"))
        sha256 = hashlib.sha256(file.read_bytes()).hexdigest()
        return {"file": file.name, "sha256": sha256, "count": len(factor[key])}

    entry = {**factor, **{key: beside(key) for key in ("order", "indptr", "indices", "data", "exponents")}}
    mutant = resealed(changed(document, path, entry))
    assert said(mutant, tmp_path).code == 0
    for key, new in (("count", len(factor["data"]) + 1), ("sha256", "0" * 64), ("file", "../data.npy"), ("scale", "2")):
        odd = resealed(changed(mutant, (*path, "data"), {**entry["data"], key: new}))
        assert said(odd, tmp_path).code == 1
    np.save(tmp_path / "data.npy", np.array(factor["data"], dtype="<f8"))
    assert said(mutant, tmp_path).code == 1


@pytest.mark.campaign
@pytest.mark.parametrize("kind", ["whole", "pinned", "tree"])
def test_of_many_mutants_with_a_factor_none_is_accepted_unless_true(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    document = with_factor(monkeypatch, kind)
    every = int(os.environ.get("PTCC_MUTANTS_EVERY", 3))
    agreed = Counter(compare(mutant, path, tmp_path) for path, mutant in mutants(document, every=every))
    assert agreed[True] > 50


def strong(n: int, kind: str, seed: int) -> SignedDigraph:
    """A strong leader group of ``n`` nodes, balanced or not or undirected, with a third as many followers."""
    rng, following = np.random.default_rng(seed), n // 3
    ring = np.arange(n)
    source = np.concatenate([(ring - 1) % n, rng.integers(0, n, n // 2), rng.integers(0, n, 3 * following)])
    target = np.concatenate([ring, rng.integers(0, n, n // 2), np.repeat(np.arange(n, n + following), 3)])
    weight = rng.integers(1, 10, source.size)
    camps = rng.choice([-1, 1], n + following)
    inside = (target < n) & (kind != "whole")
    signs = np.where(inside, camps[source] * camps[target], np.where(rng.random(source.size) < 0.3, -1, 1))
    edges = {(int(s), int(t)): int(w) for s, t, w in zip(source, target, weight * signs, strict=True) if s != t}
    if kind == "tree":
        edges |= {(t, s): w for (s, t), w in edges.items() if t < n}
    return SignedDigraph.from_edges([(s, t, w) for (s, t), w in edges.items()])


@pytest.mark.campaign
@pytest.mark.parametrize("kind", ["whole", "pinned", "tree"])
def test_strong_leader_groups_of_many_nodes_are_accepted(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.undo()  # the limits of the program
    sizes = [int(n) for n in os.environ.get("PTCC_GROUPS", "130,300,700,1400").split(",")]
    accepted = 0
    for n in sizes:
        graph = strong(n, kind, n)
        start = [int(v) for v in np.random.default_rng(n).integers(-9, 10, graph.n_nodes)]
        cert = certify(graph, NOMINAL, start, asks=Asks(simulation=False, time_limit=3600))
        if cert.verdict != "certified":
            continue
        accepted += 1
        cert.save(tmp_path / "saved.json")
        command = [program(), "--obligations", tmp_path / "saved.json"]
        run = subprocess.run(command, capture_output=True, text=True, check=False)
        assert run.returncode == 0 and "verified    final-state of graph" in run.stdout, (n, run.stdout + run.stderr)
        assert list(factors(json.loads(cert.to_json())))
    assert 2 * accepted >= len(sizes)


def test_where_nothing_is_told_of_the_end_it_is_not_called_verified(tmp_path: Path) -> None:
    graph = random_graph(np.random.default_rng(3), **{"n": 5, **CLASSES["3.1 all single"]}).graph
    document = json.loads(certify(graph, NOMINAL, asks=Asks(simulation=False)).to_json())
    code, text = said(document, tmp_path)
    assert code == 0 and "not checked final-state of graph" in text and "verified    final-state" not in text


def test_an_undecided_certificate_is_not_read(tmp_path: Path) -> None:
    graph = random_graph(np.random.default_rng(3), **{"n": 5, **CLASSES["1.1"]}).graph
    document = json.loads(certify(graph, NOMINAL, asks=Asks(simulation=False, method="full")).to_json())
    assert document["verdict"] == "undecided" and check(document).accepted
    code, text = said(document, tmp_path)
    assert code == 2 and "undecided" in text


@pytest.mark.few(1)
@pytest.mark.parametrize("name", ["3.1 all single", "2.2"])
def test_of_some_mutants_of_a_large_form_none_is_accepted_unless_true(name: str, tmp_path: Path) -> None:
    document = made(name)
    for path, mutant in mutants(document, every=97):
        compare(mutant, path, tmp_path)


@pytest.mark.campaign
@pytest.mark.parametrize(
    "name", ["1.1", "2.1 K=1", "2.1 K=1 chain", "2.1 K>=2", "3.1 all single", "3.1 mixed several", "3.2"]
)
def test_of_many_mutants_of_large_forms_none_is_accepted_unless_true(name: str, tmp_path: Path) -> None:
    document = made(name, 4, sliding=name == "2.1 K=1 chain")
    every = int(os.environ.get("PTCC_MUTANTS_EVERY", 3))
    agreed = Counter(compare(mutant, path, tmp_path) for path, mutant in mutants(document, every=every))
    assert agreed[True] > 50


@pytest.mark.campaign
@pytest.mark.parametrize("name", sorted(CLASSES))
def test_large_forms_of_random_graphs_are_accepted(name: str, tmp_path: Path) -> None:
    for seed in range(int(os.environ.get("PTCC_VERIFIED_GRAPHS", 6))):
        document = made(name, seed, sliding=seed % 2 == 1)
        code, text = said(document, tmp_path)
        assert check(document).accepted
        assert code == 0 or (code == 2 and any(word in text for word in UNREAD)), (name, seed, text)


@pytest.mark.campaign
def test_ten_thousand_nodes_are_accepted(tmp_path: Path) -> None:
    graph = sparse_digraph(np.random.default_rng(1), 10_000, 3)
    start = [int(v) for v in np.random.default_rng(2).integers(-9, 10, graph.n_nodes)]
    document = json.loads(certify(graph, NOMINAL, start, asks=Asks(simulation=False)).to_json())
    code, text = said(document, tmp_path)
    assert code == 0 or (code == 2 and any(word in text for word in UNREAD)), text
