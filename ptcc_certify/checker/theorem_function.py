"""Verifies the Lyapunov function of the theorem's row, as the paper has it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, ClassVar, Literal, NamedTuple

from lmi.exact.decimal_rounding import down
from lmi.exact.numbers import integers
from ptcc_certify.checker.document import Document
from ptcc_certify.checker.graph import positions
from ptcc_certify.checker.lyapunov_form import Form
from ptcc_certify.checker.matrix_products import block, congruence, decays, decrease, diagonal, less, need_rows
from ptcc_certify.checker.reading import entries, exact, need
from ptcc_certify.checker.section_declarations import ManyNodes, Positive, Several, Triangle, Vector
from ptcc_certify.checker.structure import Claim, Structure, Theorem

#: By how much weights may be off the left null vector of the comparison matrix: this part of each diagonal term.
NEAR = 10**9


@dataclass(frozen=True, kw_only=True)
class BlockSection:
    """A block of a Lyapunov matrix: its diagonal, or a full matrix."""

    name: str
    nodes: ManyNodes
    diagonal: Vector | None = None
    lower_triangle: Triangle | None = None
    times_rho: bool
    one_of: ClassVar[tuple[str, ...]] = ("diagonal", "lower_triangle")


@dataclass(frozen=True, kw_only=True)
class RhoInterval:
    """The end of the interval of ``rho`` that the paper prints, and an admissible one; None: no end."""

    printed: Fraction | None = None
    exact: Fraction | None = None


@dataclass(frozen=True, kw_only=True)
class PaperSection:
    """What the file says of the Lyapunov function of the theorem's row."""

    theorem: Theorem
    objective: str
    coordinates: Literal["E", "eps"]
    blocks: Several[BlockSection]
    rho: Positive | None = None
    rho_interval: RhoInterval | None = None
    rate: Positive | None = None
    overshoot: Fraction | None = None


class Block(NamedTuple):
    """A diagonal block of the Lyapunov matrix: its name, nodes and weights, and whether these are times ``rho``."""

    name: str
    nodes: list[int]
    weights: list[Fraction]
    times_rho: bool


@dataclass(frozen=True)
class Paper:
    """The Lyapunov function of the theorem's row; ``rate`` is None where none was proved."""

    structure: Structure
    coordinates: str
    blocks: list[Block]
    rho: Fraction
    rate: Fraction | None

    @property
    def form(self) -> Form:
        """The function with its own rho."""
        weights, gauge = self.weights(self.rho), self.structure.gauges[0] or ()
        own = list(weights.values())
        return Form(self.rate or Fraction(0), self.coordinates, list(weights), own, None, min(own), gauge)

    def weights(self, rho: Fraction) -> dict[int, Fraction]:
        """Return the diagonal by node, with some ``rho``."""
        return {
            v: w * (rho if b.times_rho else 1) for b in self.blocks for v, w in zip(b.nodes, b.weights, strict=True)
        }


def check_paper(doc: Document, structure: Structure, claim: Claim) -> Paper | None:
    """Verify the certificate of the theorem's row; None if there is none."""
    section, graph = doc.section("paper"), structure.graph
    if section is None:
        return None
    need_rows(graph.n)
    objective, coordinates, expected = _row(structure, claim.theorem)
    need(section.theorem == claim.theorem and section.objective == objective, "another theorem or objective")
    need(section.coordinates == coordinates, "other coordinates")
    need(len(section.blocks) == len(expected), f"blocks has not {len(expected)} entries")
    blocks = []
    for entry, (name, nodes, times_rho) in zip(section.blocks, expected, strict=True):
        need(entry.name == name and entry.times_rho is times_rho and entry.lower_triangle is None, "another block")
        need(positions(doc, graph, entry.nodes, "nodes of a block") == nodes, "nodes of a block")
        weights = [exact(w) for w in entries(entry.diagonal, "diagonal", len(nodes))]
        need(all(w > 0 for w in weights), "a weight is not positive")
        blocks.append(Block(name, nodes, weights, times_rho))
    need((section.rho is not None) == any(b.times_rho for b in blocks), "rho belongs to a block times rho")
    rho, rate = section.rho or Fraction(1), section.rate
    paper = Paper(structure, coordinates, blocks, rho, rate)
    if not blocks:
        need(rate is None and section.overshoot is None, "a rate where nothing moves")
    else:
        weights = list(paper.weights(rho).values())
        need(section.overshoot == max(weights) / min(weights), "overshoot")
    if rate is None or coordinates == "eps":
        need(section.rho_interval is None, "an interval without a proof, or without rho")
    if rate is not None and coordinates == "eps":
        _deviation_decrease(doc, paper, rate)
    elif rate is not None:
        gamma = _leaders(doc, paper, claim.theorem)
        _margin(doc, paper, gamma, rate)
        _interval(doc, paper, gamma)
    return paper


def _row(structure: Structure, theorem: str) -> tuple[str, str, list[tuple[str, list[int], bool]]]:
    """Return objective, coordinates and blocks of the theorem's row, by section 10 of the format."""
    row, balanced = (int(theorem[0]) - 1) % 3 + 1, theorem.endswith("1")
    F = structure.followers
    groups = [(k, group) for k, group in enumerate(structure.closed, start=1) if len(group) > 1]
    if not structure.graph.listening:
        return "none: every agent keeps its state", "eps" if row == 1 else "E", []
    if row == 1 and balanced:
        return "2 a(L)", "eps", [("P", structure.closed[0], False)]
    if row == 1:
        return "lmin(Omega L + L' Omega) / lmax(Omega)", "E", [("Omega", structure.closed[0], False)]
    if balanced and not groups:
        letter = "Xi_F" if row == 2 else "H_F"
        return f"lmin({letter} L_F + L_F' {letter}) / lmax({letter})", "E", [(letter, F, False)]
    if row == 2:
        name, objective = ("Xi_L", "lmin(Phi) / lmax(Xi)") if balanced else ("Xit_L", "lmin(Psi) / lmax(Xit)")
        return objective, "E", [(name, groups[0][1], False), ("Xi_F", F, True)]
    prefix, last = ("H_", "H_F") if balanced else ("Theta_L", "Theta_F")
    objective = "lmin(Pi) / lmax(H)" if balanced else "lmin(Theta L + L' Theta) / lmax(Theta)"
    return objective, "E", [(f"{prefix}{k}", group, False) for k, group in groups] + ([(last, F, True)] if F else [])


def _near_null_vector(structure: Structure, nodes: Sequence[int], p: Sequence[Fraction]) -> list[int]:
    """Verify ``p' M(L_k) = 0`` up to a part in 10^9 of each diagonal term; return a multiple of ``p`` in integers."""
    (multiple,), _ = integers([list(p)])
    residuals, graph = structure.graph.left_product(nodes, multiple), structure.graph
    near = all(abs(x) * NEAR <= w * graph.row(v)[v] for x, w, v in zip(residuals, multiple, nodes, strict=True))
    need(near, "the weights are not the left null vector of the comparison matrix")
    return multiple


def _deviation_decrease(doc: Document, paper: Paper, rate: Fraction) -> None:
    """Verify ``Z L + L'Z - b Z > 0`` modulo ``G 1``."""
    graph, one = paper.structure.graph, paper.blocks[0]
    b = doc.open("deviation-decrease", "paper")["b"]
    need(b == rate, "b is not the rate")
    _near_null_vector(paper.structure, one.nodes, one.weights)
    Z, _ = paper.form.of_state(doc.exact, graph)
    need(
        decays(doc.exact, Z, block(graph, range(graph.n)), b, graph.unit, paper.structure.free_nodes),
        "not proved definite",
    )
    doc.done(f"b = {down(b)}")


def group_decrease(doc: Document, structure: Structure, k: int, weights: Sequence[int], b: Fraction) -> bool:
    """Tell whether ``F L_k + L_k'F - b F > 0``, ``F = L_k'W L_k``, is proved, modulo ``G_k 1`` if that is balanced."""
    A = block(structure.graph, structure.closed[k])
    F, columns = congruence(doc.exact, diagonal(weights), A, len(A)), range(structure.gauges[k] is not None, len(A))
    return decays(doc.exact, F, A, b, structure.graph.unit, columns)


def _leaders(doc: Document, paper: Paper, theorem: str) -> dict[int, Fraction]:
    """Verify the decrease of each leader block; return the diagonal of Gamma, empty where the row has no Gamma."""
    structure, gamma = paper.structure, dict[int, Fraction]()
    if theorem not in ("2.1", "3.1", "5.1", "6.1"):
        return gamma
    for name, nodes, weights, times_rho in paper.blocks:
        if times_rho or nodes == structure.followers:
            continue
        k = structure.closed.index(nodes)
        if structure.gauges[k] is None:
            m = doc.open("leader-margin", f"paper.{name}")["m"]
            own = dict(zip(nodes, weights, strict=True))
            need(m > 0 and _exceeds(doc, structure, own, {}, m), "not proved definite")
            gamma |= dict.fromkeys(nodes, m)
            doc.done(f"m = {down(m)}")
        else:
            b = doc.open("leader-decrease", f"paper.{name}")["b"]
            multiple = _near_null_vector(structure, nodes, weights)
            need(b > 0 and group_decrease(doc, structure, k, multiple, b), "not proved definite")
            least = min(weights)
            gamma |= {v: b * (w if theorem in ("2.1", "5.1") else least) for v, w in zip(nodes, weights, strict=True)}
            doc.done(f"b = {down(b)}")
    return gamma


def _margin(doc: Document, paper: Paper, gamma: Mapping[int, Fraction], rate: Fraction) -> None:
    """Verify ``S - m I > 0``, and that the rate is ``m`` over the largest weight."""
    has_rho = doc.sections["paper"].rho is not None
    numbers = doc.open("margin", "paper")
    need(("rho" in numbers) == has_rho, "rho is told iff there is one")
    need(numbers.get("rho", paper.rho) == paper.rho, "another rho")
    weights = paper.weights(paper.rho)
    need(_exceeds(doc, paper.structure, weights, gamma, numbers["m"]), "not proved definite")
    need(rate == numbers["m"] / max(weights.values()), "the rate is not m / largest weight")
    doc.done(f"m = {down(numbers['m'])}, rate {down(rate)}")


def _exceeds(
    doc: Document, structure: Structure, weights: Mapping[int, Fraction], gamma: Mapping[int, Fraction], m: Fraction
) -> bool:
    """Tell whether ``S > m I`` is proved: ``S = W A + A'W`` on some nodes, with Gamma for the leaders' block."""
    graph, nodes = structure.graph, list(weights)
    leading = [i for i, v in enumerate(nodes) if v in gamma]
    (whole,), scale = integers([[*weights.values(), *(gamma[nodes[i]] for i in leading)]])
    S, unit = decrease(doc.exact, diagonal(whole[: len(nodes)]), block(graph, nodes), Fraction(0), graph.unit)
    for i, top in zip(leading, whole[len(nodes) :], strict=True):
        for j in leading:
            S[i][j] = top * unit * (i == j)
    return doc.exact.definite(less(S, m * scale * unit))


def _interval(doc: Document, paper: Paper, gamma: Mapping[int, Fraction]) -> None:
    """Verify that both ends of the interval of ``rho`` are admissible."""
    section, rho = doc.sections["paper"].rho_interval, doc.sections["paper"].rho
    doc.at = "rho-interval of paper"
    if rho is None:
        need(section is None, "an interval without rho")
        return
    need(section is not None, "rho_interval is missing")
    ends = {key: x for key, x in vars(section).items() if x is not None}
    need(len(ends) != 1, "one end without the other")
    if not ends:
        leading = {v for b in paper.blocks if not b.times_rho for v in b.nodes}
        free = all(j not in leading for v in paper.structure.followers for j in paper.structure.graph.row(v))
        need(free, "rho is bounded, since followers listen to these leaders")
        return
    numbers: dict[str, Any] = doc.open("rho-interval", "paper")
    need(numbers == {**ends, "witness": None}, "other ends")
    need(ends["printed"] <= ends["exact"], "the ends are in the wrong order")
    for end in ends.values():
        admissible = end > 0 and _exceeds(doc, paper.structure, paper.weights(end), gamma, Fraction(0))
        need(admissible, "an end is not proved admissible")
    need(paper.rho <= ends["exact"], "rho lies beyond the interval")
    printed, exact = (down(ends[key]) for key in ("printed", "exact"))
    doc.done(f"rho <= {printed} as printed, <= {exact} exactly")
