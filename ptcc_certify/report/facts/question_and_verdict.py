"""Facts of what was asked, and what came of it: the protocol, what a run showed, the proof, the verdict."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from operator import add
from typing import TYPE_CHECKING

from lmi.exact.decimal_rounding import near
from ptcc_certify.certificate.assessment import CERTIFIED, rejects
from ptcc_certify.certificate.fact import Fact, Facts
from ptcc_certify.errors import Change, Sentence, joined, labelled, spell
from ptcc_certify.report.facts.input import initial_states_text
from ptcc_certify.report.text_layout import arithmetic

if TYPE_CHECKING:
    from ptcc_certify.certificate.certificate import Certificate
    from ptcc_certify.checker.input_formulas import InitialSet
    from ptcc_certify.model.base import Protocol

#: Notes that are told.
_NOTES = 3


def gains_text(p: Protocol) -> str:
    """Tell a protocol with its parameters."""
    return f"{p.kind}: " + ", ".join(f"{name}={near(getattr(p, name), 12)}" for name in p.to_dict() if name != "kind")


def protocol_facts(certificate: Certificate, origins: Mapping[str, str]) -> Facts:
    """Tell the protocol with its parameters, and where the initial state comes from."""
    text = f"{gains_text(certificate.protocol)}; {', '.join(_beginning(certificate, origins)) or 'no x(0)'}"
    yield Fact(head="protocol", value=certificate.protocol, note=text)
    more = certificate.limits or certificate.noise is not None or certificate.delta is not None
    if more and certificate.proof.asked_messages is None:
        text = "a line that names no limits, noise or disturbances is without them"
        yield Fact(head="protocol", note=text, detail=True)


def _beginning(certificate: Certificate, origins: Mapping[str, str]) -> list[str]:
    """Tell where initial positions, velocities and so on, and sliding variables, come from."""
    begin = [] if certificate.initial_state is None else [f"x(0) {origins.get('x(0)', 'given')}"]
    if certificate.proof.agents is not None and (states := certificate.proof.agents.initial_state) is not None:
        begin = []
        for i, name in enumerate(("x(0)", "v(0)", "a(0)")[: certificate.proof.agents.order]):
            still = i > 0 and not any(chain[i] for agent in states for chain in agent)
            begin.append(f"{name} {origins.get(name, '0' if still else 'given')}")
    for name, values in (certificate.proof.vehicles or {}).items():
        if name != "order":
            begin.append(f"{name} {origins.get(name, 'given' if any(values) else '0')}")
    if certificate.initial_set is not None and (not begin or certificate.only_drawn):
        begin = [initial_states_text(_set_of_positions(certificate.initial_set, certificate.proof.offsets))]
    begin += ["in a formation"] if certificate.proof.offsets is not None else []
    if certificate.sigma0 is not None:
        begin += ["sigma(0) 0" if certificate.direct else f"sigma(0) {origins.get('sigma(0)', 'given')}"]
    return begin


def _set_of_positions(initial_set: InitialSet, places: Sequence[Fraction] | None) -> InitialSet:
    """Return the set of ``x(0)``, where that which is kept is of ``x(0)`` less the places in a formation."""
    center = initial_set.center
    return initial_set if places is None else replace(initial_set, center=tuple(map(add, center, places)))


def run_facts(certificate: Certificate) -> Facts:
    """Tell what the simulated run showed, and which disturbance it met."""
    run, comparison, seen = certificate.trajectory, certificate.comparison, certificate.agents_comparison
    texts = []
    if seen is not None:
        word = "VIOLATED" if seen.violated else "kept"
        texts.append(f"CVODES: bounds {word}, worst ratio of V {seen.decay:.4g}, of all bounds {seen.worst:.4g}")
    if run is not None and run.sliding is not None:
        texts.append(f"the run meets d = {run.sliding.source}; |d| <= delta: {run.sliding.bounded_by}")
    if run is not None and comparison is not None and not certificate.proof.constant:
        word = "VIOLATED" if comparison.violated else "kept"
        if not comparison.judged:
            word = "not tested, all is below the floor"
        resolved = f"until 1 - t/T = {comparison.resolved_until:.1e}" if comparison.resolved_until else "throughout"
        ratio = f"worst ratio {comparison.worst_ratio:.4g}, above integrator tolerance {resolved}"
        texts.append(f"CVODES to 1 - t/T = {comparison.stop:.0e}: bound {word}, {ratio}")
    if run is not None and comparison is not None and run.sliding is not None and not certificate.direct:
        slid, last = run.sliding, int(run.sliding.reaching_z.argmax())
        when = "at T_r only"
        if math.isfinite(slid.reaching_z[last]):
            when = f"at t = {slid.reaching_times[last]:.6g}, {slid.reaching_left[last]:.3g} before T_r"
        reaching = "kept" if comparison.reaching_kept else "VIOLATED"
        ratio = f"worst |sigma| ratio {comparison.sliding_ratio or 0:.4g}"
        texts.append(f"reaching times {reaching}, the last {when} (agent {labelled(run.labels[last])}); {ratio}")
    if run is not None and certificate.proof.final_state is not None:
        gap = float(abs(run.final_state - certificate.proof.final_state).max())
        remark = "" if run.deadline_resolved else " (the run had not settled)"
        texts.append(f"end state within {gap:.1e} of the final state{remark}")
    yield from (Fact(head="simulated", standing="observed", note=text, detail=True) for text in texts)


def verdict_facts(certificate: Certificate) -> Facts:
    """Tell the proof, remarks, and the verdict; what is not as one would wish comes first."""
    ended = _cut_off(certificate)
    report, assessment = certificate.checked, certificate.assessment
    if ended:
        yield Fact(head="time limit", note=(*ended, "; what was proved by then stands"), detail=True)
    notes = [note for note in certificate.observed.notes if note not in certificate.proof.reading_notes]
    yield from (Fact(head="note", note=note, detail=True) for note in notes[:_NOTES])
    if report is None:
        yield Fact(head="proof", standing="unproved", note="nothing to check", detail=True)
    elif rejects(report):
        yield Fact(head="proof", standing="unproved", note=report.lines()[-1], detail=True)
    else:
        proved = f"{len(report.obligations)} proof obligations proved in {arithmetic(certificate.direct)}"
        yield Fact(head="proof", note=f"{proved}; checked without a solver: accepted", detail=True)
    brief = assessment.brief
    if assessment.verdict == CERTIFIED:
        brief = joined("; ", (brief, "checked without a solver" if spell(brief) == CERTIFIED else "", ended))
    yield Fact(head="verdict", value=assessment.verdict, note=assessment.sentence, brief=(brief,))


def _cut_off(certificate: Certificate) -> Sentence:
    """Tell what was cut off because it took longer than its share of the time limit; nothing if nothing was."""
    if not certificate.observed.cut_off:
        return ""
    shares = "its share" if len(certificate.observed.cut_off) == 1 else "their shares"
    limit = Change("time_limit", f"{certificate.time_limit:g}")
    return (f"{', '.join(certificate.observed.cut_off)} cut off after {shares} of ", limit, " s")
