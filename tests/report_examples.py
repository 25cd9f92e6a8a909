"""Certificates of every kind, of which reports are made: for the tests of the page and of the page in a browser."""

from __future__ import annotations

import json
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

from asked import certify_words

from ptcc_certify import Agents, Certificate, GainLimits, NominalProtocol, SignedDigraph, SlidingModeProtocol, certify
from ptcc_certify.certificate import graph_certification
from ptcc_certify.checker import digest
from ptcc_certify.examples import EXAMPLES, load_graph
from ptcc_certify.lyapunov.search import search_functions
from ptcc_certify.model.asks import Asks, InitialState

NOMINAL = NominalProtocol(T="0.6", rho1="0.2", rho2="0.5", kappa=1)
SLIDING = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=2, mu1=2, mu2=1, mu3=1, delta=1)
HOSTILE = [
    "<script>alert(1)</script>",
    "javascript:alert(1)",
    '" onload="alert(1)',
    "' onmouseover='alert(1)",
    "\u202eright to left\u202c",
    "\x1b[31m\x00\x85",
    "http://evil.example/x.png",
    "]]><!-- --> <img src=x>",
    "$x^2$ \\input{x} _%#&{}~^|<>--``''\"",
    "</title></style></svg></math>",
    "&lt;b&gt; &amp;",
    "\u4e2d\u6587 \u00e9\u00d0",
    "x" * 3000,
]


def forged(folder: Path, **changes: Any) -> Path:
    """Change a saved certificate, without the parts that are None; its digest is made anew."""
    data = json.loads((folder / "c.json").read_text(encoding="utf-8"))
    for key, value in changes.items():
        part = data["problem"] if key in data["problem"] else data
        part[key] = _present({**part[key], **value}) if isinstance(value, dict) else value
    data = _present(data)
    data["digest"] = digest(data)
    (folder / "c.json").write_text(json.dumps(data), encoding="utf-8")
    return folder / "c.json"


def _present(part: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in part.items() if value is not None}


def undecided(folder: Path) -> Path:
    """Take the final state out of a certificate: the decay is proved, where it ends is not stated."""
    certify(load_graph("fig3a"), NOMINAL, [-4, 3, -1, 2, -2, 5], asks=Asks(simulation=False)).save(folder / "c.json")
    data = json.loads((folder / "c.json").read_text())
    functions = [_present({**m, "deviation": None}) for m in data["decays"]]
    proof = [s for s in data["proof"] if s["kind"] not in ("final-state", "deviation")]
    unverified = {"notes": ["<i>no final state</i>", 7]}
    return forged(
        folder,
        influence=None,
        final_state=None,
        verdict="undecided",
        proof=proof,
        decays=functions,
        unverified=unverified,
    )


def sliding_mode() -> Certificate:
    example = EXAMPLES[4]
    start, sigma0 = example.x0.split(","), (example.sigma0 or "").split(",")
    return certify(
        load_graph("fig1b"),
        example.protocol(),
        InitialState(start, sigma0=sigma0),
        asks=Asks(disturbance=example.disturbance, simulation=False),
    )


def nominal(**options: Any) -> Certificate:
    protocol = NominalProtocol(T=1, rho1=1, rho2=2, kappa=1)
    return certify_words(load_graph("fig3a"), protocol, [-4, 3, -1, 2, -2, 5], simulation=False, **options)


def disconnected() -> Certificate:
    edges = [("a", "b", 1), ("b", "a", 1), ("b", "c", -2), ("x", "y", -1), ("y", "x", 3)]
    return certify(SignedDigraph.from_edges(edges, ["z"]), NOMINAL, [1, 2, 3, 4, -5, 6], asks=Asks(simulation=False))


def hostile() -> Certificate:
    return certify(
        SignedDigraph.from_edges([(HOSTILE[i - 1], HOSTILE[i], -1) for i in range(len(HOSTILE))]),
        NominalProtocol(T="1/3", rho1=Fraction(10**20 + 1, 7**30), rho2=1, kappa=1),
        [Fraction(k, 7) for k in range(len(HOSTILE))],
        asks=Asks(simulation=False),
    )


MADE = {
    "nominal": nominal,
    "limits": lambda: nominal(limits=[GainLimits(gain_cap=50)], noise="1/100", delta="1/3"),
    "initial_set": lambda: nominal(initial_set=5, limits=[GainLimits(sample_period="1/1000", gain_cap=20)]),
    "not bounded": lambda: certify(load_graph("fig5b"), NominalProtocol(T=1, rho1=1, rho2="1/10", kappa=1), [1] * 16),
    "no start": lambda: certify(load_graph("fig1a"), NOMINAL),
    "sliding": sliding_mode,
    "disconnected": disconnected,
    "single": lambda: certify(SignedDigraph.from_edges([], ["alone"]), NOMINAL, [3], asks=Asks(simulation=False)),
    "hostile": hostile,
    "formation": lambda: nominal(agents=Agents(order=1, offsets=["1/3", -2, 0, 4, 7, -5])),
}


def example(name: str) -> Certificate:
    """The certificate of a name: one for tests of which the search is quick, and one for the others."""
    return _example(name, graph_certification.search_functions is search_functions)


@cache
def _example(name: str, whole: bool) -> Certificate:
    return MADE[name]()
