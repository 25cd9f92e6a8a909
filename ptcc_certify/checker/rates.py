"""Verifies the rates that are stated, and the upper bound that no rate exceeds."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

from lmi.exact.decimal_rounding import up
from lmi.exact.numbers import integers
from ptcc_certify.checker.graph import positions
from ptcc_certify.checker.lyapunov import Function
from ptcc_certify.checker.matrix_products import block, congruence, decays, need_rows
from ptcc_certify.checker.proof_cursor import Document
from ptcc_certify.checker.reading import entries, exact, fields, need, triangle
from ptcc_certify.checker.structure import Structure
from ptcc_certify.checker.theorem_function import Paper


def check_rates(doc: Document, paper: Paper | None, functions: Sequence[Function]) -> Fraction | None:
    """Verify that the rates and the overshoot constant are those of the functions; return the largest rate."""
    section = fields(doc.section("rates"), ("paper", "diagonal", "proved", "upper_bound"), "rates")
    decaying = [f for f in functions if f.rate > 0]
    best = max(decaying, key=lambda f: (f.rate, -f.overshoot), default=None)
    values = {
        "paper": paper and paper.rate,
        "diagonal": max((f.rate for f in decaying if f.kind in ("perron", "lmi")), default=None),
        "proved": best and best.rate,
    }
    for key, value in values.items():
        need((None if section[key] is None else exact(section[key])) == value, f"rates.{key} is not what was proved")
    section = doc.section("overshoot")
    if best is None:
        need(section is None, "an overshoot constant without a rate")
        return None
    fields(section, ("value", "of"), "overshoot")
    of = f"||{best.form.coordinates if best.form else 'E'}||^2"
    need(exact(section["value"]) == best.overshoot and section["of"] == of, "not that of the largest rate")
    return best.rate


def check_rate_bound(doc: Document, structure: Structure) -> Fraction | None:
    """Verify the upper bound on every rate: by the mean nonzero eigenvalue of a strong component, or by inertia."""
    entry = doc.data["rates"]["upper_bound"]
    if entry is None:
        return None
    mean = bool(doc.following("rate-mean", "rates"))
    obligation = doc.open("rate-mean" if mean else "rate-upper-bound", "rates", ["upper_bound"], witness=Any)
    need(exact(entry) == obligation["upper_bound"], "the upper bound is another")
    (_mean if mean else _inertia)(doc, structure, obligation["upper_bound"], obligation["witness"])
    doc.done(f"upper bound on the decay rate {up(obligation['upper_bound'])}")
    return obligation["upper_bound"]


def _mean(doc: Document, structure: Structure, limit: Fraction, witness: Any) -> None:
    """Verify that the limit is twice the mean of the nonzero eigenvalues, whose sum is the trace."""
    graph = structure.graph
    (v,) = positions(doc, graph, [fields(witness, ("node",), "the witness")["node"]], "node")
    own, still = structure.strong_component(v)
    trace = Fraction(sum(graph.diagonal[u] for u in own), graph.unit)
    need(v == own[0], "not the first node of a strong component")
    need(len(own) > still and limit * (len(own) - still) == 2 * trace, "not twice the mean nonzero eigenvalue")


def _inertia(doc: Document, structure: Structure, limit: Fraction, witness: Any) -> None:
    """Verify ``H B + B'H > 0``, which gives ``H`` and ``B = A - (limit/2) I`` the same inertia."""
    section, graph = fields(witness, ("nodes", "lower_triangle", "vectors"), "the witness"), structure.graph
    nodes = positions(doc, graph, section["nodes"], "nodes")
    need(bool(nodes), "no nodes")
    own, still = structure.strong_component(nodes[0])
    need(nodes == own, "the nodes are not a strong component")
    need_rows(len(nodes))
    H, _ = integers(triangle(section["lower_triangle"], len(nodes)))
    need(decays(doc.exact, H, block(graph, nodes), limit, graph.unit, range(len(nodes))), "not proved definite")
    # Of a balanced closed component the eigenvalue 0 lies below too, so that one more is needed.
    rows = entries(section["vectors"], "vectors", 2 if still else 1)
    X, _ = integers([[exact(x) for x in entries(row, "a vector", len(nodes))] for row in rows])
    below = congruence(doc.exact, H, [dict(enumerate(column)) for column in zip(*X, strict=True)], len(X))
    need(doc.exact.definite([[-x for x in row] for row in below]), "H is not negative on the vectors")
