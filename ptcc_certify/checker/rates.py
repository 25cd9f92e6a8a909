"""Verifies the rates that are stated, and the upper bound that no rate exceeds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from lmi.exact.decimal_rounding import up
from lmi.exact.numbers import integers
from ptcc_certify.checker.document import Document
from ptcc_certify.checker.graph import positions
from ptcc_certify.checker.lyapunov import Function
from ptcc_certify.checker.matrix_products import block, congruence, decays, need_rows
from ptcc_certify.checker.reading import need
from ptcc_certify.checker.section_declarations import Node, Nodes, Several, Triangle
from ptcc_certify.checker.structure import Structure
from ptcc_certify.checker.theorem_function import Paper


@dataclass(frozen=True, kw_only=True)
class RatesSection:
    """Rates: the paper's, the largest of diagonal functions, the largest of all, and what no rate exceeds."""

    paper: Fraction | None
    diagonal: Fraction | None
    proved: Fraction | None
    upper_bound: Fraction | None


@dataclass(frozen=True, kw_only=True)
class OvershootSection:
    """The overshoot constant of the largest rate, and of which norm."""

    value: Fraction
    of: str


@dataclass(frozen=True, kw_only=True)
class MeanWitness:
    """The first node of a strong component."""

    node: Node


@dataclass(frozen=True, kw_only=True)
class InertiaWitness:
    """The nodes of a strong component, a form, and vectors on which it is negative."""

    nodes: Nodes
    lower_triangle: Triangle
    vectors: Several[Several[Fraction]]


def check_rates(doc: Document, paper: Paper | None, functions: Sequence[Function]) -> Fraction | None:
    """Verify that the rates and the overshoot constant are those of the functions; return the largest rate."""
    section = doc.section("rates")
    decaying = [f for f in functions if f.rate > 0]
    best = max(decaying, key=lambda f: (f.rate, -f.overshoot), default=None)
    values = {
        "paper": paper and paper.rate,
        "diagonal": max((f.rate for f in decaying if f.kind in ("perron", "lmi")), default=None),
        "proved": best and best.rate,
    }
    for key, value in values.items():
        need(getattr(section, key) == value, f"rates.{key} is not what was proved")
    constant = doc.section("overshoot")
    if best is None:
        need(constant is None, "an overshoot constant without a rate")
        return None
    of = f"||{best.form.coordinates if best.form else 'E'}||^2"
    need(constant == OvershootSection(value=best.overshoot, of=of), "not that of the largest rate")
    return best.rate


def check_rate_bound(doc: Document, structure: Structure) -> Fraction | None:
    """Verify the upper bound on every rate: by the mean nonzero eigenvalue of a strong component, or by inertia."""
    bound: Fraction | None = doc.sections["rates"].upper_bound
    if bound is None:
        return None
    mean = bool(doc.following("rate-mean", "rates"))
    if mean:
        obligation = doc.open("rate-mean", "rates")
        _mean(structure, bound, obligation["witness"].node)
    else:
        obligation = doc.open("rate-upper-bound", "rates")
        _inertia(doc, structure, bound, obligation["witness"])
    need(bound == obligation["upper_bound"], "the upper bound is another")
    doc.done(f"upper bound on the decay rate {up(bound)}")
    return bound


def _mean(structure: Structure, limit: Fraction, v: int) -> None:
    """Verify that the limit is twice the mean of the nonzero eigenvalues, whose sum is the trace."""
    graph = structure.graph
    own, still = structure.strong_component(v)
    trace = Fraction(sum(graph.diagonal[u] for u in own), graph.unit)
    need(v == own[0], "not the first node of a strong component")
    need(len(own) > still and limit * (len(own) - still) == 2 * trace, "not twice the mean nonzero eigenvalue")


def _inertia(doc: Document, structure: Structure, limit: Fraction, witness: InertiaWitness) -> None:
    """Verify ``H B + B'H > 0``, which gives ``H`` and ``B = A - (limit/2) I`` the same inertia."""
    graph = structure.graph
    nodes = positions(doc, graph, witness.nodes, "nodes")
    need(bool(nodes), "no nodes")
    own, still = structure.strong_component(nodes[0])
    need(nodes == own, "the nodes are not a strong component")
    need_rows(len(nodes))
    need(len(witness.lower_triangle) == len(nodes), f"lower_triangle has not {len(nodes)} entries")
    H, _ = integers(witness.lower_triangle)
    need(decays(doc.exact, H, block(graph, nodes), limit, graph.unit, range(len(nodes))), "not proved definite")
    # Of a balanced closed component the eigenvalue 0 lies below too, so that one more is needed.
    need(len(witness.vectors) == 1 + still, f"vectors has not {1 + still} entries")
    need(all(len(row) == len(nodes) for row in witness.vectors), f"a vector has not {len(nodes)} entries")
    X, _ = integers(witness.vectors)
    below = congruence(doc.exact, H, [dict(enumerate(column)) for column in zip(*X, strict=True)], len(X))
    need(doc.exact.definite([[-x for x in row] for row in below]), "H is not negative on the vectors")
