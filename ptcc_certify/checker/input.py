"""Verifies what is said of the input: whether it stays bounded, how large it gets, what limits of actuators leave."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import chain
from typing import Annotated, Any

from lmi.exact.decimal_rounding import down, up
from lmi.exact.numbers import integers, longest, shorten, sized
from lmi.exact.spectrum_beyond_line import nonzero_spectrum_beyond, tractable
from lmi.exact.work import spend
from ptcc_certify.checker import input_formulas as formulas
from ptcc_certify.checker.digraph import Digraph
from ptcc_certify.checker.document import Document
from ptcc_certify.checker.final_state import FinalState, deviation_rows
from ptcc_certify.checker.graph import proved_above
from ptcc_certify.checker.lyapunov import Function
from ptcc_certify.checker.matrix_products import (
    Matrix,
    block,
    congruence,
    decrease,
    first_unbounded,
    less,
    need_rows,
    only,
)
from ptcc_certify.checker.protocol import (
    Begin,
    Protocol,
    SlidingPart,
    check_sliding_part,
    last_time,
    reaching_of,
    sliding_part,
)
from ptcc_certify.checker.reading import RejectedError, length, need
from ptcc_certify.checker.section_declarations import ByAgent, FewAgents, Positive, Rule, Several, Triangle
from ptcc_certify.checker.side_files import Numbers
from ptcc_certify.checker.structure import Structure

#: Graphs up to this size have bounds of the input.
INPUT_NODES = 400
#: Limits of actuators that are read.
MANY_LIMITS = 100


@dataclass(frozen=True, kw_only=True)
class Threshold:
    """Proved bounds of ``rho2 kappa min Re lambda``."""

    lower: Fraction | None = None
    upper: Fraction | None = None


@dataclass(frozen=True, kw_only=True)
class Box:
    """Initial states within a radius of a center, agent by agent."""

    center: FewAgents
    radius: Annotated[FewAgents, Rule(lambda x: min(x) >= 0, "is negative")]


@dataclass(frozen=True, kw_only=True)
class Ellipsoid:
    """Initial states: a center, and what the unit ball of the axes adds."""

    center: FewAgents
    axes: Several[FewAgents]


@dataclass(frozen=True, kw_only=True)
class PeakSection:
    """Bounds of ``|u_k|``, the largest of them, and a bound of the norm."""

    agents: FewAgents
    largest: Fraction
    norm: Fraction


@dataclass(frozen=True, kw_only=True)
class PeakWitness:
    """A Lyapunov function and an instant ``z`` for every agent, and a function for the norm."""

    agents: ByAgent[tuple[int, Fraction]]
    norm: int


@dataclass(frozen=True, kw_only=True)
class EnergyWitness:
    """Two matrices."""

    W0: Triangle
    W1: Triangle


@dataclass(frozen=True, kw_only=True)
class NoiseSection:
    """A bound of the noise, and what it makes of ``norm`` and ``largest``."""

    bound: Positive
    norm: Fraction
    largest: Fraction


@dataclass(frozen=True, kw_only=True)
class LimitedSection:
    """What is left at the deadline under limits of the gain."""

    gain_cap: Positive | None = None
    stop_before: Positive | None = None
    sample_period: Positive | None = None
    clock: Fraction
    norm: Fraction
    agents: FewAgents | None = None
    largest: Fraction | None = None
    noise: NoiseSection | None = None


@dataclass(frozen=True, kw_only=True)
class DisturbedSection:
    """What disturbances within ``delta`` add to inputs, and to where agents end."""

    delta: Positive
    inputs: FewAgents
    drift: FewAgents | None = None


@dataclass(frozen=True, kw_only=True)
class InputSection:
    """What the file says of the input."""

    bounded: bool | None = None
    threshold: Threshold
    initial_set: Box | Ellipsoid | None = None
    constants: Several[FewAgents | None]
    peak: PeakSection | None = None
    energy: Fraction | None = None
    path_length: Fraction | None = None
    sliding: SlidingPart | None = None
    residual: Several[LimitedSection]
    disturbed: DisturbedSection | None = None


@dataclass(frozen=True)
class Verified:
    """What the bounds of the input rest on.

    Attributes
    ----------
    rate, limit : Fraction or None
        The largest rate, and the upper bound on all.
    """

    structure: Structure
    protocol: Protocol
    begin: Begin
    final: FinalState
    functions: Sequence[Function]
    rate: Fraction | None
    limit: Fraction | None

    @property
    def gain(self) -> formulas.PrescribedGain:
        """The gain of the nominal part of the input."""
        return self.protocol.gain

    def sliding_part(self) -> list[Fraction]:
        """Return what the sliding-mode protocol adds to the input of every agent at most."""
        own = sliding_part(self.protocol.gains, self.begin.sigma or Numbers([]))
        if own is None:
            raise RejectedError("the sliding part is not bounded")
        return own


def check_input(doc: Document, verified: Verified) -> None:
    """Verify the section ``input``."""
    section = doc.section("input")
    decays = verified.rate is not None or not verified.structure.graph.listening
    need((section is not None) == decays, "the input is spoken of iff the decay is proved")
    if section is None:
        return
    need(len(section.residual) <= MANY_LIMITS, f"more than {MANY_LIMITS} limits")
    _threshold(doc, verified, section)
    need(len(section.constants) == len(verified.functions), f"constants has not {len(verified.functions)} entries")
    constants = _constants(doc, verified, section.constants)
    check_sliding_part(doc, verified.structure.graph, verified.protocol, verified.begin, section.sliding)
    initial_set = _initial_set(doc, verified, section.initial_set)
    if initial_set is None:
        for key in PARTS:
            empty = getattr(section, key) in (None, [])
            need(empty, f"{key} without an initial state, or of too large a graph")
        return
    try:
        bounds = _bounds(doc, verified, initial_set, constants)
        for key, verify in PARTS.items():
            doc.at = f"input.{key}"
            if getattr(section, key) is not None:
                verify(doc, verified, section, bounds)
    except (ValueError, OverflowError) as error:
        raise RejectedError(str(error)) from None


# ---------------------------------------------------------------------- bounded or not


def _threshold(doc: Document, verified: Verified, section: InputSection) -> None:
    """Verify whether the input stays bounded for every initial state, and the bounds of the threshold."""
    bounded, k = section.bounded, verified.gain.k
    for key, rate in (("lower", verified.rate), ("upper", verified.limit)):
        value = None if rate is None else k * rate / 2
        need(getattr(section.threshold, key) == value, f"the {key} end is not the proved one")
    if bounded is None:
        return
    by = doc.open("input-threshold", "input")["witness"]
    if by == "rate":
        holds = not verified.structure.graph.listening or (verified.rate is not None and verified.rate * k >= 2)
        need(bounded and holds, "no rate proves that the input stays bounded")
    elif by == "upper_bound":
        need(
            not bounded and verified.limit is not None and verified.limit * k < 2,
            "no limit proves that the input grows",
        )
    else:
        place = _spectrum(doc, verified.structure, 1 / k)
        need(bounded == (place in ("beyond", "on")), f"the spectrum is {place} the line")
    doc.done("the input stays bounded" if bounded else "the input of some initial state grows without limit")


def _spectrum(doc: Document, structure: Structure, line: Fraction) -> str:
    """Return where the nonzero eigenvalues of ``L`` lie, exactly."""
    graph = structure.graph
    need(graph.n <= INPUT_NODES, "too large a graph, or too long numbers")
    rows = block(graph, range(graph.n))
    need(tractable(rows, graph.unit, line), "too large a graph, or too long numbers")
    parts = {tuple(structure.strong_component(v)[0]) for v in range(graph.n)}
    return nonzero_spectrum_beyond(rows, graph.unit, line, parts, doc.exact.characteristic)


# ---------------------------------------------------------------------- constants, initial states


def _constants(doc: Document, verified: Verified, section: Sequence[Numbers | None]) -> list[list[Fraction] | None]:
    """Verify ``e_k^2 <= c_k V`` for full matrices; for diagonal ones the constants follow."""
    results: list[list[Fraction] | None] = [None] * len(section)
    for k, (entry, function) in enumerate(zip(section, verified.functions, strict=True)):
        doc.at = f"input.constants[{k}]"
        if entry is not None:
            results[k] = check_constants(doc, verified.structure.graph, function, k, entry)
    return results


def check_constants(doc: Document, graph: Digraph, function: Function, k: int, values: Numbers) -> list[Fraction]:
    """Verify ``e_v^2 <= c_v V`` for the full matrix of the Lyapunov function ``k``; return ``c``."""
    form = function.form
    if form is None or form.matrix is None:
        raise RejectedError("constants that follow from a diagonal")
    doc.open("input-constants", f"decays[{k}]")
    constants = list(values)
    P, scale = form.entries
    units = ([int(node == v) for node in form.nodes] for v in range(graph.n))
    failed = first_unbounded(doc.exact, P, units, (c / scale for c in constants))
    need(failed is None, f"the constant of agent {shorten(graph.labels[failed or 0])} is not proved")
    doc.done(f"at most {up(max(constants))}")
    return constants


def _initial_set(doc: Document, verified: Verified, section: Box | Ellipsoid | None) -> formulas.InitialSet | None:
    """Return the set of initial states; None if there is none, or the graph is too large."""
    doc.at = "input.initial_set"
    small = verified.structure.graph.n <= INPUT_NODES and bool(verified.structure.graph.listening)
    if section is None:
        return formulas.InitialSet(list(verified.begin.state)) if verified.begin.state is not None and small else None
    need(small, "initial states of too large a graph, or of one that does not move")
    if isinstance(section, Box):
        return formulas.InitialSet(list(section.center), list(section.radius))
    need(len(section.axes) <= INPUT_NODES, "too many axes")
    return formulas.InitialSet(list(section.center), axes=list(map(list, section.axes)))


def _bounds(
    doc: Document, verified: Verified, initial_set: formulas.InitialSet, constants: Sequence[Sequence[Fraction] | None]
) -> formulas.InputBounds:
    """Return what bounds the input over the initial states."""
    graph = verified.structure.graph
    sigma0 = list(verified.begin.sigma or ())
    set_rows, _ = integers([initial_set.center, initial_set.radius, *initial_set.axes])
    row_bits, state_bits = graph.bits + graph.unit.bit_length(), longest(chain.from_iterable(set_rows))
    sized(graph.n_edges + graph.n, row_bits, "the rows of L")
    spend(len(set_rows) * (graph.n_edges + graph.n), row_bits + state_bits, row_bits + state_bits, "the initial states")
    rows = [graph.rational_row(v) for v in range(graph.n)]
    reaching = None
    if any(sigma0):
        last = last_time(doc.sections["reaching_time"].z, sigma0)
        reaching = reaching_of(verified.protocol.gains, sigma0, last)
    return formulas.InputBounds(
        rows, verified.gain, [f.form for f in verified.functions], constants, initial_set, reaching
    )


# ---------------------------------------------------------------------- peak, energy, length


def _peak(doc: Document, verified: Verified, section: InputSection, bounds: formulas.InputBounds) -> None:
    """Verify the peak of every agent's input and of their norm."""
    peak: Any = section.peak
    obligation = doc.open("input-peak", "input")
    witness = obligation["witness"]
    own = verified.sliding_part() if verified.protocol.sliding else [Fraction(0)] * len(bounds.rows)
    least = []
    for v, (k, z) in enumerate(witness.agents):
        least.append(bounds.bound(formulas.peak_above, v, k, z) + own[v])
    peaks = proved_above(verified.structure.graph, peak.agents, "the peak", least)
    need(peak.largest == max(peaks), "the largest peak is another")
    norm = bounds.bound(formulas.peak_above, None, witness.norm, obligation["z"])
    norm += formulas.root_above(sum((x * x for x in own), Fraction(0)))
    need(peak.norm >= norm, "the peak of the norm is not proved")
    doc.done(f"at most {up(max(peaks))}, norm {up(peak.norm)}")


def _energy(doc: Document, verified: Verified, section: InputSection, bounds: formulas.InputBounds) -> None:
    """Verify the energy, by one function or by two matrices."""
    if not isinstance(doc.following("input-energy", "input").get("witness"), dict):
        _by_function(doc, section.energy, "input-energy", formulas.energy_above, bounds)
        return
    obligation = doc.open("input-energy", "input")
    matrices = obligation["witness"]
    need(bounds.reaching is None, "sliding variables move")
    even = _remainder(doc, verified, matrices.W0, Fraction(0), obligation["m0"], bounds)
    grown = _remainder(doc, verified, matrices.W1, 1 / verified.gain.k, obligation["m1"], bounds)
    _at_most(doc, section.energy, formulas.integral_above(verified.gain, even, grown, obligation["p"]))


def _path_length(doc: Document, verified: Verified, section: InputSection, bounds: formulas.InputBounds) -> None:
    """Verify the length of the path."""
    _by_function(doc, section.path_length, "input-length", formulas.length_above, bounds)


def _by_function(doc: Document, bound: Any, kind: str, of: formulas.Of, bounds: formulas.InputBounds) -> None:
    """Verify a bound for the norm that follows from one function and an instant."""
    obligation = doc.open(kind, "input")
    _at_most(doc, bound, bounds.bound(of, None, obligation["witness"], obligation["z"]))


def _at_most(doc: Document, bound: Fraction | None, least: Fraction) -> None:
    need(bound is not None and bound >= least, "the bound is not proved")
    doc.done(f"at most {up(bound or least)}")


def _remainder(
    doc: Document, verified: Verified, rows: Any, c: Fraction, m: Fraction, bounds: formulas.InputBounds
) -> Fraction:
    """Verify ``W L + L'W - c W > m I`` on the range of ``L``, and ``W > 0`` besides unless ``c = 0``.

    Returns a bound of the integral of ``e^(c s) ||E||^2``.
    """
    graph, nodes = verified.structure.graph, verified.structure.graph.listening
    need_rows(graph.n)
    need(len(rows) == len(nodes), f"lower_triangle has not {len(nodes)} entries")
    W, scale = integers(rows)
    S, more = decrease(doc.exact, W, block(graph, nodes), c, graph.unit)
    for T in [less(S, m * scale * more), *([W] if c else [])]:  # W > 0 need not be known for c = 0: E tends to 0
        definite = m > 0 and doc.exact.definite(_on_range(doc, verified.structure, T))
        need(definite, f"the inequality of {'W1' if c else 'W0'} is not proved")
    return bounds.largest_form(rows) / m


def _on_range(doc: Document, structure: Structure, S: Matrix) -> Matrix:
    """Return a form of ``E``, on the nodes that listen, where ``E`` lives: ``L'S L`` on ``free_nodes``, times a scale.

    Where only single nodes are balanced closed components, ``E`` may be anything on the nodes that listen.
    """
    if all(len(group) == 1 for _, group, _ in structure.balanced):
        return S
    rows = [structure.graph.row(v) for v in structure.graph.listening]
    return only(congruence(doc.exact, S, rows, structure.graph.n), structure.free_nodes)


# ---------------------------------------------------------------------- limits of actuators


def _residual(doc: Document, verified: Verified, section: InputSection, bounds: formulas.InputBounds) -> None:
    """Verify what is left under each of the limits."""
    for k, entry in enumerate(section.residual):
        _under_limits(doc, verified, f"input.residual[{k}]", entry, section.peak, bounds)


def _under_limits(
    doc: Document,
    verified: Verified,
    of: str,
    entry: LimitedSection,
    peak: PeakSection | None,
    bounds: formulas.InputBounds,
) -> None:
    """Verify what is left at the deadline under limits of the gain, and the largest input."""
    doc.at = of
    need(not verified.protocol.sliding, "limits are for the nominal protocol")
    cap, stop, period = entry.gain_cap, entry.stop_before, entry.sample_period
    need(stop is None or stop < verified.gain.T, "a stop beyond the deadline")
    need(period is None or period <= verified.gain.T, "a period beyond the deadline")
    limits, clock = formulas.Limits(cap, stop, period), entry.clock
    top = limits.largest_gain(verified.gain)
    obligation = doc.open("limited-gain", of)
    chosen = obligation["witness"] if entry.noise is not None else [obligation["witness"]]
    need(isinstance(chosen, list) and type(chosen[0]) is int, "two functions iff there is noise")
    k = chosen[0]
    form = bounds.form(k)
    need(period is not None or obligation["growth"] == 0, "growth belongs to a held gain")
    if period is not None:
        _growth(doc, verified.structure, form, obligation["growth"])
    need(0 <= clock <= limits.clock_below(verified.gain), "the clock does not come so far")
    root = bounds.share(k, limits, clock, obligation["growth"]) * bounds.initial_root(k)
    norm = bounds.root_constant(k, None) * root
    need(entry.norm >= norm, "what is left is not proved")
    if entry.agents is not None:
        roots = {k: root} if period is not None else _roots(verified, limits, clock, bounds)
        known = [(verified.functions[j].deviation, x) for j, x in roots.items()]
        sizes = [[formulas.root_above(c) * x for c in constants] for constants, x in known if constants is not None]
        need(bool(sizes), "deviations without constants")
        most = [_largest_deviation(verified.final, bounds.initial_set)] if period is None else []
        least = [min([*row, *most]) for row in zip(*sizes, strict=True)]
        proved_above(verified.structure.graph, entry.agents, "what is left", least)
    need((entry.largest is None) == (period is not None), "the largest input is bounded unless it is held")
    if entry.largest is not None:
        ends = [top * max(bounds.error_bounds)] + ([peak.largest] if peak is not None else [])
        need(entry.largest >= min(ends), "the largest input is not proved")
    if (noise := entry.noise) is not None:
        need(period is None, "noise of a held gain")
        whole, each = bounds.noisy(chosen[1], noise.bound)
        need(noise.norm >= norm + whole, "what is left by noise is not proved")
        need(noise.largest >= (entry.largest or 0) + top * max(each), "the largest input under noise is not proved")
    doc.done(f"||E|| at most {up(entry.norm)} at the deadline")


def _roots(
    verified: Verified, limits: formulas.Limits, clock: Fraction, bounds: formulas.InputBounds
) -> dict[int, Fraction]:
    """Return ``sqrt(V)`` at the deadline at most, of every Lyapunov function that says something of single agents."""
    known = [
        j for j, f in enumerate(verified.functions) if f.form is not None and f.deviation is not None and f.rate > 0
    ]
    return {j: bounds.share(j, limits, clock, Fraction(0)) * bounds.initial_root(j) for j in known}


def _largest_deviation(final: FinalState, initial_set: formulas.InitialSet) -> Fraction:
    """Return ``sup max_k |x_k(0) - (Q x(0))_k|``, which no deviation exceeds where the input is not held."""
    rows = deviation_rows(final.projection)
    bits = length(x for row in rows for x in row.values()) + length(initial_set.center)
    spend(5 * sum(map(len, rows)) * (2 + len(initial_set.axes)), bits, bits, "deviations of all initial states")
    return max(map(initial_set.largest, rows))


def _growth(doc: Document, structure: Structure, form: formulas.Form, growth: Fraction) -> None:
    """Verify ``m F - L'F L > 0`` on ``free_nodes`` for the form ``F = L'P L`` of the state."""
    graph = structure.graph
    need(form.coordinates == "E", "deviations say nothing of a step")
    F = congruence(doc.exact, form.entries[0], [graph.row(v) for v in form.nodes], graph.n)
    step = congruence(doc.exact, F, block(graph, range(graph.n)), graph.n)
    p, q = (growth * graph.unit**2).as_integer_ratio()
    bits, ratio = longest(chain.from_iterable([*F, *step])), longest((p, q))
    sized(graph.n**2, bits + ratio, "L'F L")
    spend(2 * len(structure.free_nodes) ** 2, bits, ratio, "L'F L")
    S = [[p * F[i][j] - q * step[i][j] for j in structure.free_nodes] for i in structure.free_nodes]
    need(doc.exact.definite(S), "the growth of a step is not proved")


# ---------------------------------------------------------------------- disturbances of the nominal protocol


def _disturbance(doc: Document, verified: Verified, section: InputSection, bounds: formulas.InputBounds) -> None:
    """Verify what disturbances within ``delta`` add under the nominal protocol."""
    need(not verified.protocol.sliding, "the sliding-mode protocol has its own claims")
    disturbed: Any = section.disturbed
    obligation, graph = doc.open("nominal-disturbed", "input"), verified.structure.graph
    delta = disturbed.delta
    need(delta == obligation["delta"], "another delta")
    proved_above(graph, disturbed.inputs, "the input", bounds.disturbed(obligation["witness"], delta))
    if disturbed.drift is not None:
        drift = [
            delta * verified.gain.T * sum(map(abs, row.values()), Fraction(0)) for row in verified.final.projection
        ]
        proved_above(graph, disturbed.drift, "the drift", drift)
    doc.done(f"for every disturbance within {down(delta)}")


#: What is verified of initial states, by key, in the order of the proof.
PARTS = {
    "peak": _peak,
    "energy": _energy,
    "path_length": _path_length,
    "residual": _residual,
    "disturbed": _disturbance,
}
