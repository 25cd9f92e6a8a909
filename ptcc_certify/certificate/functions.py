"""Lyapunov functions and boxes in a certificate, with what proves them: given as sections, and read."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from math import ceil
from typing import Any

import numpy as np

from lmi.exact.definite import SparseFactor
from ptcc_certify.bounds.final_state.attracting_box import AttractingBox
from ptcc_certify.certificate.graph_proof import GraphProof
from ptcc_certify.certificate.section_io import Reader, Writer, write
from ptcc_certify.checker import attracting_boxes
from ptcc_certify.checker.attracting_boxes import KeptBox
from ptcc_certify.checker.common_forms import FormSection, MeanSection, Multipliers
from ptcc_certify.checker.dominance import FactorSection
from ptcc_certify.checker.lyapunov import DeviationSection, FunctionSection, MeanWitness, OvershootSection, RatesSection
from ptcc_certify.checker.reading import Interval, exact
from ptcc_certify.checker.row_functions import PartSection, RowsSection
from ptcc_certify.checker.side_files import Numbers, SideFiles
from ptcc_certify.checker.theorem_function import BlockSection, PaperSection, RhoInterval
from ptcc_certify.checker.weighted_squares import FactorWitness, SquaresSection
from ptcc_certify.errors import FormatError
from ptcc_certify.graphs.rationals import format_exact
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.lyapunov.common_forms import CommonForm, Quotient, prove_ends, weighted_mean
from ptcc_certify.lyapunov.follower_function import FollowerDecay, FollowerFunction, LeadingPart
from ptcc_certify.lyapunov.function import DeviationBound, Dominance, LyapunovBlock, LyapunovFunction
from ptcc_certify.lyapunov.rate_upper_bound import RateBound
from ptcc_certify.lyapunov.squares_function import FormTable, SquaresFunction
from ptcc_certify.theorems.family_behaviour import FamilyComponent
from ptcc_certify.theorems.theorem import Obligation

#: Bits of integers that floats hold.
_FLOAT_BITS = 53


Proved = Mapping[tuple[str, str], Mapping[str, Any]]


def function_section(
    component: FamilyComponent, number: int, V: ProvedFunction, out: Writer
) -> FormSection | RowsSection | SquaresSection:
    """Return a Lyapunov function of a component."""
    if isinstance(V, SquaresFunction):
        return SquaresSection(class_="squares", component=number, vector=V.vector, rate=V.rate)
    nodes = component.nodes
    if isinstance(V, CommonForm):
        return _form(nodes, component.family.labels, number, V)
    parts = [_part(nodes, component.family.labels, number, part) for part in V.parts]
    return RowsSection(class_="rows", component=number, vector=_vector(V.vector, out), parts=parts, rate=V.rate)


def _form(nodes: np.ndarray, labels: Sequence[str], number: int, V: CommonForm) -> FormSection:
    """Return a quadratic form of some agents, which have these places and labels."""
    kind: Any = V.kind
    return FormSection(
        class_=kind,
        component=number,
        nodes=nodes[list(V.nodes)],
        lower_triangle=V.matrix,
        rate=V.rate,
        inputs=dict(zip(labels, V.input_constants, strict=True)),
        coordinates=dict(zip([labels[v] for v in V.nodes], V.coordinate_constants, strict=True)),
        means=[
            MeanSection(weights={labels[v]: w for v, w in mean.weights.items()}, constant=mean.constant)
            for mean in V.means
        ],
    )


def _part(nodes: np.ndarray, labels: Sequence[str], number: int, part: LeadingPart) -> PartSection:
    bounds, own = part.ends | part.speeds, part.agents.tolist()
    function = _form(nodes[own], [labels[v] for v in own], number, part.function)
    return PartSection(nodes=nodes[own], function=function, times=part.times, bounds=[bounds[v] for v in own])


def _vector(d: np.ndarray, out: Writer) -> np.ndarray | list[Fraction]:
    """Return positive integers; a long vector as floats, which hold what was rounded to their bits."""
    odd = max((int(x).bit_length() - (int(x) & -int(x)).bit_length() for x in d.tolist()), default=0)
    if out.aside(d.size) and odd < _FLOAT_BITS and int(d.max()).bit_length() < 1000:
        return np.asarray(d.astype(float))
    return list(map(Fraction, d.tolist()))


def box_section(nodes: np.ndarray, number: int, box: AttractingBox, out: Writer) -> attracting_boxes.AttractingBox:
    """Return a box of the followers of a component of agents of these places."""
    decay = box.decay
    return attracting_boxes.AttractingBox(
        component=number,
        nodes=nodes[decay.nodes],
        vector=_vector(decay.vector, out),
        lower=box.lower,
        upper=box.upper,
        rate=2 * decay.rate,
    )


def kept_section(number: int, ends: Sequence[Interval]) -> KeptBox:
    """Return a box in which all agents of a component stay."""
    lower, upper = zip(*ends, strict=True)
    return KeptBox(component=number, lower=lower, upper=upper)


def read_box(entry: attracting_boxes.AttractingBox, labels: Sequence[str], files: SideFiles) -> AttractingBox:
    """Return a box of an accepted file."""
    index = {label: v for v, label in enumerate(labels)}
    nodes = np.array([index[label] for label in entry.nodes], dtype=np.int64)
    d, _ = files.numbers(entry.vector, "vector", nodes.size).over(range(nodes.size))
    decay = FollowerDecay(nodes, np.array(d, dtype=object), entry.rate / 2)
    return AttractingBox(decay, tuple(entry.lower), tuple(entry.upper))


def function_steps(of: str, V: ProvedFunction, out: Writer) -> Iterator[Obligation]:
    """Yield the obligations of a Lyapunov function: of its modes, or of its parts, then of its rows."""
    if isinstance(V, CommonForm):
        for mode, rate in enumerate(V.rates):
            witness = Multipliers(multipliers=V.multipliers[mode] if V.multipliers else ())
            told = None if V.kind == "undirected" else witness
            yield Obligation("family-rate", f"{of}.modes[{mode}]", {"b": rate}, told)
    elif isinstance(V, SquaresFunction):
        for mode, factor in enumerate(V.factors):
            sparse = FactorWitness(factor=factor_section(factor, V.power))
            yield Obligation("family-squares", f"{of}.modes[{mode}]", {"b": V.rate}, sparse)
    else:
        for j, part in enumerate(V.parts):
            yield from function_steps(f"{of}.parts[{j}]", part.function, out)
        yield Obligation("family-rows", of, {"b": V.rate})


def read_function(
    of: str,
    section: FormSection | RowsSection | SquaresSection,
    component: FamilyComponent,
    proved: Proved,
    files: SideFiles,
) -> ProvedFunction:
    """Return a Lyapunov function of an accepted file."""
    if isinstance(section, SquaresSection):
        n, modes = component.family.n_nodes, component.family.modes
        own, scale = files.numbers(section.vector, "vector", n).over(range(n))
        tables = [(table.edges, table.unit) for table in map(FormTable.of, modes)]
        return SquaresFunction(dict(enumerate(own)), scale, section.rate, tables)
    if isinstance(section, RowsSection):
        return _read_rows(of, section, component, proved, files)
    return _read_form(of, section, Quotient.of(component), proved)


def _read_form(of: str, section: FormSection, quotient: Quotient, proved: Proved) -> CommonForm:
    index = {label: v for v, label in enumerate(quotient.family.labels)}
    matrix = list(map(list, section.lower_triangle))
    steps = rates_of(of, proved)
    ends = prove_ends(matrix)
    assert ends is not None, "the check has proved it definite"
    return CommonForm(
        section.class_,
        quotient,
        matrix,
        tuple(step["b"] for step in steps),
        tuple(tuple(step["witness"].multipliers) for step in steps if step["witness"] is not None),
        *ends,
        input_constants=tuple(section.inputs.values()),
        coordinate_constants=tuple(section.coordinates.values()),
        means=tuple(
            weighted_mean(quotient, {index[label]: w for label, w in mean.weights.items()}, mean.constant)
            for mean in section.means
        ),
    )


def rates_of(of: str, proved: Proved) -> list[Mapping[str, Any]]:
    """Return what was proved of every mode of a function or a claim."""
    return [
        step for (kind, place), step in proved.items() if kind == "family-rate" and place.startswith(f"{of}.modes[")
    ]


def _read_rows(
    of: str, section: RowsSection, component: FamilyComponent, proved: Proved, files: SideFiles
) -> FollowerFunction:
    family, kernel = component.family, component.kernel
    if kernel is None:
        raise FormatError("rest states of more than 120 agents are verified, not read back")
    index = {label: v for v, label in enumerate(family.labels)}
    pivots = {c.nodes[0] for c in kernel.structure.closed_components if c.balanced}
    agents = [np.array([index[label] for label in part.nodes]) for part in section.parts]
    outside = sorted(pivots.union(*(some.tolist() for some in agents)))
    followers = np.setdiff1d(np.arange(family.n_nodes), outside)
    d, scale = files.numbers(section.vector, "vector", followers.size).over(range(followers.size))
    ends, parts = dict.fromkeys(outside, 0), []
    for j, (some, part) in enumerate(zip(agents, section.parts, strict=True)):
        own = family.restricted(some)
        function = _read_form(f"{of}.parts[{j}]", part.function, Quotient(own), proved)
        parts.append(LeadingPart(some, function, part.times * scale))
        bounds = zip(some.tolist(), part.bounds, strict=True)
        ends |= {v: ceil(bound * scale) for v, bound in bounds if v not in pivots}
    vectors = np.array(d, dtype=object), np.array(list(ends.values()), dtype=object)
    return FollowerFunction(family, kernel, followers, *vectors, tuple(parts), section.rate)


def paper_section(proof: GraphProof) -> PaperSection | None:
    """Return the row of the theorem: its Lyapunov function, whether a rate of it was proved or not."""
    V, interval = proof.lyapunov, proof.paper_proof.interval
    if V is None:
        return None
    coordinates: Any = V.coordinates
    return PaperSection(
        theorem=proof.theorem.number,
        objective=V.objective,
        coordinates=coordinates,
        blocks=list(map(_block, V.blocks)),
        rho=V.rho,
        rho_interval=None if interval is None else RhoInterval(printed=interval.printed, exact=interval.exact),
        rate=V.rate,
        overshoot=V.overshoot if V.blocks else None,
    )


def _rates(proof: GraphProof) -> RatesSection:
    rates = proof.paper_rate, proof.diagonal_rate, proof.rate, proof.upper_bound
    return RatesSection(**dict(zip(("paper", "diagonal", "proved", "upper_bound"), rates, strict=True)))


def _write_function(V: LyapunovFunction, out: Writer) -> dict[str, Any]:
    where = Writer(out.labels) if V.kind == "paper" else out  # as the section "paper" has it
    section: dict[str, Any] = write(FunctionSection, _function(V), where)
    return section


def _function(V: LyapunovFunction) -> FunctionSection:
    bound, words = V.deviation, dict[str, Any](class_=V.kind, coordinates=V.coordinates)
    return FunctionSection(
        **words,
        blocks=list(map(_block, V.blocks)),
        rho=V.rho,
        rate=V.proved_rate,
        overshoot=V.overshoot,
        deviation=None if bound is None else DeviationSection(agents=Numbers(bound.agents), norm=bound.norm),
    )


def _block(block: LyapunovBlock) -> BlockSection:
    diagonal = block.diagonal if block.dyadic is None else block.dyadic
    return BlockSection(
        name=block.name,
        nodes=block.nodes,
        diagonal=diagonal if block.matrix is None else None,
        lower_triangle=block.matrix,
        times_rho=block.times_rho,
    )


def _read_function(
    name: str, section: FunctionSection, structure: Structure, data: Reader, proved: Mapping[tuple[str, str], Any]
) -> LyapunovFunction:
    bound = section.deviation
    full, rows = proved.get(("overshoot", name)), proved.get(("dominance", name))
    blocks = tuple(_read_block(block, data, rows is not None) for block in section.blocks)
    gauge = structure.closed_components[0].gauge if section.coordinates == "eps" else ()
    return LyapunovFunction(
        section.class_,
        section.coordinates,
        blocks,
        section.rho,
        section.rate,
        None if full is None else (full["lowest"], full["highest"]),
        gauge or (),
        dominance=None if rows is None else Dominance(data.floats(rows["witness"].vector, len(blocks[0].nodes))),
        deviation=None if bound is None else DeviationBound(tuple(bound.agents), bound.norm),
        name=name,
    )


def _read_block(section: BlockSection, data: Reader, large: bool) -> LyapunovBlock:
    nodes = data.nodes(section.nodes)
    if section.lower_triangle is not None:
        return LyapunovBlock(section.name, nodes, matrix=list(map(list, section.lower_triangle)))
    if large:
        return LyapunovBlock(section.name, nodes, dyadic=data.floats(section.diagonal, len(nodes)))
    return LyapunovBlock(section.name, nodes, tuple(map(exact, section.diagonal or ())), section.times_rho)


def _overshoot(proof: GraphProof) -> OvershootSection | None:
    if proof.rate is None:
        return None
    V = proof.fastest
    return OvershootSection(value=V.overshoot, of=f"||{V.coordinates}||^2")


def _read_limit(proved: Mapping[tuple[str, str], Any], data: Reader) -> RateBound | None:
    step = proved.get(("rate-upper-bound", "rates")) or proved.get(("rate-mean", "rates"))
    if step is None:
        return None
    value, witness = step["upper_bound"], step["witness"]
    if isinstance(witness, MeanWitness):
        return RateBound(value, (witness.node,))
    vectors = tuple(map(tuple, witness.vectors))
    return RateBound(value, data.nodes(witness.nodes), witness.lower_triangle, vectors)


def _dominance_witness(proof: Dominance, out: Writer) -> dict[str, Any]:
    """Return the vector, and the proof of every leader group, each factor once."""
    groups: list[Any] = []
    first = 0
    for group, scale in zip(proof.groups, proof.scales, strict=True):
        rate = format_exact(group.rate)
        unit = math.frexp(float(group.weights[0]))[1]
        key = first, group.rate, np.ldexp(group.weights, -unit).tobytes()
        repeated = key in out.written_groups
        out.written_groups.add(key)
        if group.factor is None or repeated:
            groups.append(rate)
        else:
            # The factor is that of the group's own weights, of which those of the function are a power of two.
            power = group.power + 1 - math.frexp(scale)[1]
            factor = write(FactorSection, factor_section(group.factor, power, group.parents), out)
            groups.append({"rate": rate, "factor": factor})
        first += group.weights.size
    return {"vector": out.floats("vector", proof.vector), "groups": groups}


def factor_section(factor: SparseFactor, power: int, parents: np.ndarray | None = None) -> FactorSection:
    """Return what is written of a sparse factor of ``2^power`` times a matrix."""
    return FactorSection(
        order=factor.order,
        indptr=factor.indptr,
        indices=factor.indices,
        data=factor.data,
        exponents=factor.exponents,
        bits=factor.bits,
        power=power,
        weights=factor.weights,
        parents=parents,
    )


ProvedFunction = CommonForm | FollowerFunction | SquaresFunction
