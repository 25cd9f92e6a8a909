"""The certificates of the paper's examples, for all tests of checkers that take the twelve."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from asked import certify_words

from ptcc_certify.examples import load_graph, select

STORED = Path(__file__).parent / "corpus"


@cache
def paper_examples() -> tuple[str, ...]:
    """Return their JSON: those under the nominal protocol as they are stored, the others without simulated runs."""
    found = []
    for example, name, _ in select("all"):
        if example.sigma0 is None:
            found.append((STORED / f"{name}.json").read_text(encoding="utf-8"))
            continue
        x0, sigma0, push = example.x0.split(","), example.sigma0.split(","), example.disturbance
        more = {"sigma0": sigma0, "disturbance": push, "simulation": False}
        cert = certify_words(load_graph(name), example.protocol(), x0, **more)
        assert cert.verdict == "certified" and cert.checked is not None and cert.checked.accepted
        found.append(cert.to_json())
    return tuple(found)
