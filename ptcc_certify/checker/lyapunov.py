"""Verifies the Lyapunov functions that are used: their rates, their ratio of eigenvalues, what they say of states."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from lmi.exact.numbers import integers, longest, shorten, sized
from lmi.exact.rounding import down, up
from lmi.exact.work import spend
from ptcc_certify.checker.document import Document
from ptcc_certify.checker.dominance import Proved, check_dominance
from ptcc_certify.checker.final_state import FinalState
from ptcc_certify.checker.graph import ordered, positions
from ptcc_certify.checker.input_bounds import Form
from ptcc_certify.checker.matrices import Matrix, block, congruence, decrease, diagonal, less, need_rows, only
from ptcc_certify.checker.paper import Paper, deviation_form
from ptcc_certify.checker.reading import RejectedError, entries, exact, fields, need, same, triangle
from ptcc_certify.checker.structure import Structure
from ptcc_certify.checker.vectors import beside

#: Lyapunov functions that are read.
MANY_FUNCTIONS = 100
KEYS = ("coordinates", "blocks", "rho", "rate", "prefactor")


@dataclass(frozen=True)
class Function:
    """A Lyapunov function that was verified.

    Attributes
    ----------
    kind : str
        Its class.
    rate, prefactor : Fraction
        ``||z(t)||^2 <= prefactor e^(-rate s) ||z(0)||^2``.
    form : Form or None
        None: proved by rows, in a large graph; the coordinates are ``E``.
    """

    kind: str
    rate: Fraction
    prefactor: Fraction
    form: Form | None


def check_functions(doc: Document, structure: Structure, final: FinalState, paper: Paper | None) -> list[Function]:
    """Verify every Lyapunov function."""
    said, of_paper = doc.section("lyapunov"), paper is not None and paper.rate is not None
    members = entries(fields(said, ("members",), "lyapunov")["members"], "members")
    need(len(members) <= MANY_FUNCTIONS, f"more than {MANY_FUNCTIONS} Lyapunov functions")
    need(not of_paper or bool(members), "the paper's certificate is not among the members")
    need(bool(structure.graph.listening) or not members, "a Lyapunov function where nothing moves")
    functions: list[Function] = []
    state_form: tuple[Matrix, Fraction] | None
    proved: Proved = set()
    for k, member in enumerate(members):
        doc.at = of = f"lyapunov.members[{k}]"
        fields(member, ("class", *KEYS, "distance"), "a member")
        if k == 0 and paper is not None and of_paper:
            function, state_form = _of_paper(doc, paper, member)
        elif member["class"] in ("perron", "lmi") and doc.following.get("kind") == "dominance":
            function, state_form = _by_rows(doc, structure, member, of, proved), None
        else:
            function, state_form = _searched(doc, structure, member, of)
        functions.append(function)
        if member["distance"] is not None:
            if state_form is None:
                raise RejectedError("a distance without a form")
            _distance(doc, final, member["distance"], state_form, of)
    return functions


def _state_form(
    doc: Document, structure: Structure, nodes: Sequence[int], P: Matrix, scale: int
) -> tuple[Matrix, Fraction]:
    """Return ``E'P E``, with ``E`` on some nodes, as a form of the state, times a scale, and the scale."""
    graph = structure.graph
    form = congruence(doc.exact, P, [graph.row(v) for v in nodes], graph.n)
    return form, Fraction(scale * graph.unit**2)


def _of_paper(doc: Document, paper: Paper, member: Any) -> tuple[Function, tuple[Matrix, Fraction]]:
    """Return the paper's function, which was verified before, with its form of the state."""
    said, weights, rate = doc.data["paper"], paper.weights(paper.rho), paper.rate or Fraction(0)
    equal = member["class"] == "paper" and all(same(member[key], said[key]) for key in KEYS)
    need(equal, "the first member is not the paper's certificate")
    own, gauge = list(weights.values()), paper.structure.gauges[0] or []
    form = Form(rate, paper.coordinates, list(weights), own, None, min(own), gauge)
    function = Function("paper", rate, exact(said["prefactor"]), form)
    if paper.coordinates == "eps":
        return function, deviation_form(paper)
    (scaled,), scale = integers([own])
    return function, _state_form(doc, paper.structure, list(weights), diagonal(scaled), scale)


def _block(doc: Document, structure: Structure, member: Any, shape: str) -> tuple[list[int], Any]:
    """Return the nodes of the one block of a function, and its entries as they are written."""
    need(member["class"] in ("perron", "lmi", "full"), "an unknown class")
    need(member["coordinates"] == "E" and member["rho"] is None, "other coordinates, or a rho")
    (said,) = entries(member["blocks"], "blocks", 1)
    fields(said, ("name", "nodes", shape, "times_rho"), "a block")
    need(said["name"] == "P" and said["times_rho"] is False, "another block")
    listening = structure.graph.listening
    nodes = positions(doc, structure.graph, said["nodes"], "nodes of a block", len(listening))
    need(sorted(nodes) == listening, "nodes of a block")
    return nodes, said[shape]


def _by_rows(doc: Document, structure: Structure, member: Any, of: str, proved: Proved) -> Function:
    """Verify a diagonal function of a large graph row by row."""
    nodes, said = _block(doc, structure, member, "diagonal")
    weights, rate = doc.files.numbers(said, "diagonal", len(nodes)), exact(member["rate"])
    need(weights.positive(), "a weight is not positive")
    check_dominance(doc, structure, nodes, weights, rate, of, proved)
    prefactor = Fraction(max(weights.values)) / Fraction(min(weights.values))
    need(exact(member["prefactor"]) == prefactor, "the prefactor is another")
    return Function(member["class"], rate, prefactor, None)


def _searched(doc: Document, structure: Structure, member: Any, of: str) -> tuple[Function, tuple[Matrix, Fraction]]:
    """Verify rate and prefactor of a diagonal or a full matrix; return its form of the state besides."""
    full, graph = member["class"] == "full", structure.graph
    nodes, said = _block(doc, structure, member, "lower_triangle" if full else "diagonal")
    need_rows(graph.n)
    rate = exact(member["rate"])
    if full:
        rows, weights = triangle(said, len(nodes)), []
        P, scale = integers(rows)
    else:
        need(not beside(said), "a side vector where it has no place")
        rows, weights = [], list(doc.files.numbers(said, "diagonal", len(nodes)))
        need(all(w > 0 for w in weights), "a weight is not positive")
        (own,), scale = integers([weights])
        P = diagonal(own)
    state_form = _state_form(doc, structure, nodes, P, scale)
    need(doc.open("rate", of, ["b"])["b"] == rate, "b is not the rate")
    S, _ = decrease(doc.exact, state_form[0], block(graph, range(graph.n)), rate, graph.unit)
    need(doc.exact.definite(only(S, structure.kept)), "not proved definite")
    doc.done(f"b = {down(rate)}, class {member['class']}")
    if full:
        ends = doc.open("prefactor", of, ["lowest", "highest"])
        low, high = ends["lowest"], ends["highest"]
        need(low > 0 and doc.exact.definite(less(P, low * scale)), "the lower end is not proved")
        negative = [[-x for x in row] for row in P]
        need(doc.exact.definite(less(negative, -high * scale)), "the upper end is not proved")
        need(low <= high, "the ends are in the wrong order")
        doc.done(f"at most {up(high / low)}")
    else:
        low, high = min(weights), max(weights)
    need(exact(member["prefactor"]) == high / low, "the prefactor is another")
    form = Form(rate, "E", nodes, None if full else weights, rows if full else None, low)
    return Function(member["class"], rate, high / low, form), state_form


def _distance(doc: Document, final: FinalState, said: Any, state_form: tuple[Matrix, Fraction], of: str) -> None:
    """Verify ``(x_k - (Q x)_k)^2 <= c_k V`` and ``||x - Q x||^2 <= c V``, in the coordinates ``kept``."""
    doc.open("distance", of)
    structure, (form, scale) = final.structure, state_form
    labels = structure.graph.labels
    agents = ordered(labels, fields(said, ("agents", "norm"), "distance")["agents"], "agents")
    (D, common, gram), S = final.deviations, only(form, structure.kept)
    forms: list[tuple[list[int], int]] = []
    for row, text in zip(D, agents.values(), strict=True):
        p, q = (exact(text) * common**2 / scale).as_integer_ratio()
        sized((len(forms) + 1) * len(row), longest((q,)) + longest(row), "distances")
        spend(len(row), longest((q,)), longest(row), "distances")
        forms.append(([q * x for x in row], q * p))
    failed = doc.exact.bounded(S, forms)  # proves V > 0 besides
    need(failed is None, f"the constant of agent {shorten(labels[failed or 0])} is not proved")
    p, q = (exact(said["norm"]) * common**2 / scale).as_integer_ratio()
    bits, ratio = max(longest(x for row in part for x in row) for part in (S, gram)), longest((p, q))
    sized(len(S) ** 2, bits + ratio, "the distance of the norm")
    spend(2 * len(S) ** 2, bits, ratio, "the distance of the norm")
    N = [[p * s - q * g for s, g in zip(r, t, strict=True)] for r, t in zip(S, gram, strict=True)]
    need(p >= 0 and doc.exact.definite(N), "the constant of the norm is not proved")
    doc.done(f"norm at most {up(exact(said['norm']))}")
