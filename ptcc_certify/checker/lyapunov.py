"""Verifies Lyapunov functions: rates, ratios of eigenvalues, what they say of states; and what no rate exceeds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Literal

from lmi.exact.decimal_rounding import down, up
from lmi.exact.elementary_enclosures import rounded
from lmi.exact.numbers import integers, shorten
from ptcc_certify.checker.document import Document
from ptcc_certify.checker.dominance import Proved, check_dominance
from ptcc_certify.checker.final_state import FinalState
from ptcc_certify.checker.graph import positions
from ptcc_certify.checker.lyapunov_form import Form
from ptcc_certify.checker.matrix_products import (
    Matrix,
    block,
    combined,
    congruence,
    decays,
    first_unbounded,
    less,
    need_rows,
    only,
)
from ptcc_certify.checker.reading import RejectedError, need
from ptcc_certify.checker.section_declarations import FewAgents, Node, Nodes, Several, Triangle
from ptcc_certify.checker.side_files import beside
from ptcc_certify.checker.structure import Structure
from ptcc_certify.checker.theorem_function import BlockSection, Paper

#: Lyapunov functions that are read.
MANY_FUNCTIONS = 100
#: Bits to which constants are rounded up before they are added.
SUM_BITS = 64
#: What the first function has in common with the paper's certificate.
KEYS = ("coordinates", "blocks", "rho", "rate", "overshoot")


@dataclass(frozen=True, kw_only=True)
class DeviationSection:
    """``(x_k - (Q x)_k)^2 <= agents_k V``, and ``||x - Q x||^2 <= norm V``."""

    agents: FewAgents
    norm: Fraction


@dataclass(frozen=True, kw_only=True)
class FunctionSection:
    """What the file says of a Lyapunov function."""

    class_: Literal["paper", "perron", "lmi", "full"]
    coordinates: Literal["E", "eps"]
    blocks: Several[BlockSection]
    rho: Fraction | None = None
    rate: Fraction
    overshoot: Fraction
    deviation: DeviationSection | None = None


@dataclass(frozen=True)
class Function:
    """A Lyapunov function that was verified.

    Attributes
    ----------
    kind : str
        Its class.
    rate, overshoot : Fraction
        ``||z(t)||^2 <= overshoot e^(-rate s) ||z(0)||^2``.
    form : Form or None
        None: proved by rows, in a large graph; the coordinates are ``E``.
    by_rows : Form or None
        The form then, which says nothing of single agents of order 1.
    deviation : list of Fraction or None
        ``c_k`` with ``(x_k - (Q x)_k)^2 <= c_k V``.
    """

    kind: str
    rate: Fraction
    overshoot: Fraction
    form: Form | None
    by_rows: Form | None = None
    deviation: Sequence[Fraction] | None = None

    @property
    def quadratic(self) -> Form:
        """The form, of a large graph too."""
        form = self.form or self.by_rows
        assert form is not None
        return form


def check_functions(doc: Document, structure: Structure, final: FinalState, paper: Paper | None) -> list[Function]:
    """Verify every Lyapunov function."""
    items, of_paper = doc.section("decays"), paper is not None and paper.rate is not None
    need(len(items) <= MANY_FUNCTIONS, f"more than {MANY_FUNCTIONS} Lyapunov functions")
    need(not of_paper or bool(items), "the paper's certificate is not among the Lyapunov functions")
    need(bool(structure.graph.listening) or not items, "a Lyapunov function where nothing moves")
    functions: list[Function] = []
    form: tuple[Matrix, Fraction] | None
    proofs: Proved = set()
    for k, entry in enumerate(items):
        doc.at = of = f"decays[{k}]"
        if k == 0 and paper is not None and of_paper:
            function, form = _of_paper(doc, paper, entry)
        elif entry.class_ in ("perron", "lmi") and doc.following("dominance", of):
            function, form = _by_rows(doc, structure, entry, of, proofs), None
        else:
            function, form = _searched(doc, structure, entry, of)
        if entry.deviation is not None:
            if form is None:
                raise RejectedError("a deviation without a form")
            function = replace(function, deviation=_deviation(doc, final, entry.deviation, form, of))
        functions.append(function)
    return functions


def _of_paper(doc: Document, paper: Paper, function: FunctionSection) -> tuple[Function, tuple[Matrix, Fraction]]:
    """Return the paper's function, which was verified before, with its form of the state."""
    section, form = doc.sections["paper"], paper.form
    equal = function.class_ == "paper" and all(getattr(function, key) == getattr(section, key) for key in KEYS)
    need(equal, "the first Lyapunov function is not the paper's certificate")
    verified = Function("paper", form.rate, section.overshoot, form)
    return verified, form.of_state(doc.exact, paper.structure.graph)


def _block(doc: Document, structure: Structure, function: FunctionSection) -> tuple[list[int], BlockSection]:
    """Return the nodes of the one block of a function, and the block."""
    need(function.class_ != "paper", "another class")
    need(function.coordinates == "E" and function.rho is None, "other coordinates, or a rho")
    need(len(function.blocks) == 1, "blocks has not 1 entries")
    (entry,) = function.blocks
    full = function.class_ == "full"
    need((entry.diagonal is None) == full and (entry.lower_triangle is not None) == full, "another shape of a block")
    need(entry.name == "P" and not entry.times_rho, "another block")
    listening = structure.graph.listening
    nodes = positions(doc, structure.graph, entry.nodes, "nodes of a block", len(listening))
    need(sorted(nodes) == listening, "nodes of a block")
    return nodes, entry


def _by_rows(doc: Document, structure: Structure, function: FunctionSection, of: str, proofs: Proved) -> Function:
    """Verify a diagonal function of a large graph row by row."""
    nodes, entry = _block(doc, structure, function)
    weights, rate = doc.files.numbers(entry.diagonal, "diagonal", len(nodes)), function.rate
    need(weights.positive(), "a weight is not positive")
    check_dominance(doc, structure, nodes, weights, rate, of, proofs)
    low = Fraction(min(weights.values))
    overshoot = Fraction(max(weights.values)) / low
    need(function.overshoot == overshoot, "the overshoot constant is another")
    form = Form(rate, "E", nodes, weights, None, low / (weights.scale or 1))
    return Function(function.class_, rate, overshoot, None, form)


def _searched(
    doc: Document, structure: Structure, function: FunctionSection, of: str
) -> tuple[Function, tuple[Matrix, Fraction]]:
    """Verify rate and overshoot constant of a diagonal or a full matrix; return its form of the state besides."""
    nodes, entry = _block(doc, structure, function)
    rate, graph = function.rate, structure.graph
    need_rows(graph.n)
    if entry.lower_triangle is not None:
        need(len(entry.lower_triangle) == len(nodes), f"lower_triangle has not {len(nodes)} entries")
        form = Form(rate, "E", nodes, None, entry.lower_triangle, Fraction(0))
    else:
        need(not beside(entry.diagonal), "a side vector where it has no place")
        weights = list(doc.files.numbers(entry.diagonal, "diagonal", len(nodes)))
        low, high = min(weights), max(weights)
        need(low > 0, "a weight is not positive")
        form = Form(rate, "E", nodes, weights, None, low)
    need(doc.open("rate", of)["b"] == rate, "b is not the rate")
    F, times = form.of_state(doc.exact, graph)
    definite = decays(doc.exact, F, block(graph, range(graph.n)), rate, graph.unit, structure.free_nodes)
    need(definite, "not proved definite")
    doc.done(f"b = {down(rate)}, class {function.class_}")
    if form.matrix:
        low, high = _ends(doc, form.matrix, of)
        form = replace(form, lowest=low)
    need(function.overshoot == high / low, "the overshoot constant is another")
    return Function(function.class_, rate, high / low, form), (F, times)


def _ends(doc: Document, rows: Sequence[Sequence[Fraction]], of: str) -> tuple[Fraction, Fraction]:
    """Verify ``lowest I < P < highest I``; return both."""
    ends, (P, scale) = doc.open("overshoot", of), integers(rows)
    low, high = ends["lowest"], ends["highest"]
    need(low > 0 and doc.exact.definite(less(P, low * scale)), "the lower end is not proved")
    need(doc.exact.definite(less([[-x for x in row] for row in P], -high * scale)), "the upper end is not proved")
    doc.done(f"at most {up(high / low)}")
    return low, high


def _deviation(
    doc: Document, final: FinalState, section: DeviationSection, scaled_form: tuple[Matrix, Fraction], of: str
) -> list[Fraction]:
    """Verify ``(x_k - (Q x)_k)^2 <= c_k V``, ``||x - Q x||^2 <= c V``, in the coordinates ``free_nodes``.

    Returns the ``c_k``.
    """
    doc.open("deviation", of)
    structure, (form, scale) = final.structure, scaled_form
    labels = structure.graph.labels
    (D, common), S = final.deviations, only(form, structure.free_nodes)
    constants = list(section.agents)
    failed = first_unbounded(doc.exact, S, D, (c * common**2 / scale for c in constants))  # proves V > 0 besides
    need(failed is None, f"the constant of agent {shorten(labels[failed or 0])} is not proved")
    if section.norm < sum(rounded(c, SUM_BITS, up=True) for c in constants):
        p, q = (section.norm * common**2 / scale).as_integer_ratio()
        N = combined("the deviation of the norm", (p, S), (-q, final.gram))
        need(p >= 0 and doc.exact.definite(N), "the constant of the norm is not proved")
    doc.done(f"squared distance <= {up(section.norm)} V")
    return constants


@dataclass(frozen=True, kw_only=True)
class RatesSection:
    """Rates: the paper's, the largest of diagonal functions, the largest of all, and what no rate exceeds."""

    paper: Fraction | None = None
    diagonal: Fraction | None = None
    proved: Fraction | None = None
    upper_bound: Fraction | None = None


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
