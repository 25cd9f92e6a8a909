"""True certificates of every kind, of small graphs and families, that tests change."""

from __future__ import annotations

import json
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np
import pytest
from asked import certify_family, certify_words
from generators import all_classes, random_graph, smallest
from mutations import Json
from side_files import with_factors, with_side_files

from ptcc_certify.bounds.final_state import of_graph as final_states
from ptcc_certify.bounds.input.initial_sets import box, ellipsoid
from ptcc_certify.certificate import graph_certification
from ptcc_certify.certificate.certification import certify
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Family
from ptcc_certify.model import NominalProtocol, SlidingModeProtocol
from ptcc_certify.model.agents import Agents
from ptcc_certify.model.asks import Asks, GainLimits
from ptcc_certify.model.late_messages import LateMessages

CLASSES = dict(all_classes())
Case = tuple[str, Json, dict[str, bytes]]


def made(name: str, seed: int, slides: bool = False, large: bool = False, **options: Any) -> Json:
    """A certificate of a small graph of a class."""
    rng = np.random.default_rng(seed)
    settings = {"weights": "decimals", **CLASSES[name]}
    settings["n"] = smallest(**CLASSES[name]) + int(rng.integers(0, 2)) * ("n" not in settings)
    graph = random_graph(rng, **settings).graph
    n = graph.n_nodes
    start: Any = [Fraction(int(v), 100) for v in rng.integers(-1000, 1001, n)]
    protocol: Any = NominalProtocol(T=1, rho1=1, rho2=options.pop("rho2", 1), kappa=2)
    if slides:
        kappa = Fraction(int(rng.integers(1, 6)), 2)
        protocol = SlidingModeProtocol(T_r="0.5", T_s=1, rho1=1, rho2=1, kappa=kappa, mu1=2, mu2=1, mu3=1, delta=1)
        options["sigma0"] = [Fraction(int(v), 100) * (seed % 2) for v in rng.integers(-200, 201, n)]
    if (initial_set := options.pop("initial_set", None)) is not None:
        axes = [[Fraction(i == j) / 2 + Fraction(j == 0) / 8 for i in range(n)] for j in range(n)]
        options["initial_set"] = ellipsoid([1] * n, axes) if initial_set == "ball" else box([-1] * n, [2] * n)
        start = None
    with pytest.MonkeyPatch.context() as patch:
        if large:
            patch.setattr(graph_certification, "EXACT_NODES", 0)
            patch.setattr(final_states, "EXACT_NODES", 0)
        certificate = certify_words(graph, protocol, start, simulation=False, **options)
        return {**json.loads(certificate.to_json()), "unverified": {}}


@cache
def cases() -> list[Case]:
    """True certificates of every kind."""
    found: list[Case] = []
    some = ("1.1", "1.2", "2.1 K>=2", "2.1 K=1", "2.2", "3.1 mixed", "3.1 all single", "3.2", "disconnected 1.1 2.1")
    for k, name in enumerate(some):
        found += [(f"{name}, {'sliding' if s else 'nominal'}", made(name, 4 + k + s, s), {}) for s in (False, True)]
    limits = [GainLimits(gain_cap=9), GainLimits(stop_before="0.01"), GainLimits(gain_cap=9, sample_period="0.000001")]
    for k, name in enumerate(("1.1", "2.1 K>=2", "2.2", "3.1 mixed")):
        more: Any = {
            "limits": limits,
            "delta": "0.1",
            "noise": "0.01",
            "rho2": 5,
            "initial_set": ("ball", "box", None)[k % 3],
        }
        found.append((f"{name}, limits", made(name, 6 + k, **more), {}))
    for k, name in enumerate(("1.1", "2.1 K>=2", "2.2", "3.1 mixed", "disconnected 1.1 2.1")):
        large = made(name, 5 + k, bool(k % 2), large=True)
        found += [(f"{name}, large", large, {}), (f"{name}, side files", *with_side_files(large))]
        if "disconnected" not in name:
            found.append((f"{name}, factors", *with_side_files(with_factors(large))))
    ring = SignedDigraph.from_edges([(1, 2, 1), (2, 3, 1), (3, 1, 1)])
    line = certify(ring, NominalProtocol(T=1, rho1=1, rho2="1/3", kappa=2), [1, 5, -2], asks=Asks(simulation=False))
    found.append(("spectrum on the line", {**json.loads(line.to_json()), "unverified": {}}, {}))
    found.append(("undecided", made("1.1", 5, large=True, method="full"), {}))
    kinds = {data["verdict"] for _, data, _ in found}
    assert kinds == {"certified", "undecided"}
    return found


@cache
def more_cases() -> list[Case]:
    """True certificates of families, of agents of order n, of late messages."""
    day = [("a", "b", 1), ("b", "a", 2), ("b", "c", -1), ("c", "a", -2)]
    night = [("a", "b", 2), ("b", "a", 1), ("a", "c", -1)]
    one = Family.from_graph(SignedDigraph.from_edges(day), uncertainty="10%", optional=[("c", "a")])
    two = Family.switching([SignedDigraph.from_edges(edges) for edges in (day, night)])
    protocol = NominalProtocol(T=1, rho1=1, rho2=2, kappa=3)
    found = [(f"family of {len(f.modes)}", certify_family(f, protocol, [1, 2, 3]).to_json()) for f in (one, two)]
    ring = [("a", "b", 1), ("b", "c", -2), ("c", "a", -1)]
    led = [("l", "a", 1), ("a", "b", 1), ("b", "a", 1)]
    strong = NominalProtocol(T=2, rho1="1/2", rho2=12, kappa=2)
    for name, edges, more in (
        ("double integrators", ring, {"agents": Agents(order=2)}),
        ("cascade", ring, {"agents": Agents(order=2, cascade=1)}),
        ("late", led, {"messages": LateMessages(delay="0.01")}),
    ):
        found.append((name, certify_words(edges, strong, [1, 2, 3], simulation=False, **more).to_json()))
    for n, method in ((40, "full"), (90, "best")):
        graph = random_graph(np.random.default_rng(n), "weak", "mixed", n=n).graph
        plain = NominalProtocol(T=1, rho1=1, rho2=1, kappa=2)
        found.append(
            (f"{n} nodes", certify(graph, plain, list(range(n)), asks=Asks(simulation=False, method=method)).to_json())
        )
    return [(name, {**json.loads(text), "unverified": {}}, {}) for name, text in found]
