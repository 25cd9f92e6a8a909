"""What is told of a certificate: question, answers, verdict."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from operator import add
from typing import TYPE_CHECKING

from lmi.exact.decimal_rounding import down, near, up
from lmi.exact.elementary_enclosures import LARGEST_PUSH
from ptcc_certify.certificate.assessment import CERTIFIED, rejects
from ptcc_certify.certificate.fact import Fact, Facts
from ptcc_certify.errors import Change, Sentence, joined, labelled, spell
from ptcc_certify.report.facts.agents import agents_facts
from ptcc_certify.report.facts.claim import assumptions, claim_facts, family_claims
from ptcc_certify.report.facts.constrained_switching import signal_facts
from ptcc_certify.report.facts.decay import (
    error_facts,
    family_error_facts,
    family_rate_facts,
    function_facts,
    rate_facts,
)
from ptcc_certify.report.facts.graph import family_facts, graph_facts
from ptcc_certify.report.facts.input import disturbed_facts, family_input_facts, initial_states_text, input_facts
from ptcc_certify.report.facts.late import late_facts
from ptcc_certify.report.facts.states import family_final_facts, final_facts, initial_facts
from ptcc_certify.report.text_layout import arithmetic, shorten_list, value_list

if TYPE_CHECKING:
    from ptcc_certify.certificate.certificate import Certificate
    from ptcc_certify.checker.input_formulas import InitialSet
    from ptcc_certify.model.base import Protocol, ReachingProtocol
    from ptcc_certify.model.reaching_time import ReachingTime


def sliding_facts(
    labels: Sequence[str],
    protocol: ReachingProtocol | None,
    sigma0: Sequence[Fraction] | None,
    reaching: Sequence[ReachingTime] | None,
) -> Facts:
    """Tell ``sigma(0)``, and the last proved reaching time; nothing under the nominal protocol.

    Examples
    --------
    >>> from ptcc_certify.model.reaching_time import ReachingTime
    >>> p = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=2, mu1=2, mu2=1, mu3=1, delta=1)
    >>> print(next(sliding_facts(["a"], p, [Fraction(0)], [ReachingTime(p.T_r, Fraction(0))])).text)
    0: no reaching phase, the agents slide from the beginning
    """
    if protocol is None or reaching is None or sigma0 is None:
        return
    if not any(sigma0):
        yield Fact(head="sigma(0)", note="0: no reaching phase, the agents slide from the beginning", detail=True)
        return
    values = dict(zip(labels, sigma0, strict=True))
    yield Fact(head="sigma(0)", value=values, note=value_list(labels, sigma0), detail=True)
    late = [labelled(label) for label, r in zip(labels, reaching, strict=True) if r.z is None]
    last = max((r for r in reaching if r.z is not None), key=lambda r: r.z or 0, default=None)
    clauses = []
    if last is not None and last.z:
        agent = labelled(labels[list(reaching).index(last)])
        margin = f"{down(last.remaining, 3)} before T_r" if last.remaining else "nearer to T_r than a float tells"
        others = " of others" if late else ""
        clauses.append(f"reaching time{others} at most {up(last.time, 6)}, {margin} (agent {agent})")
    if late:
        pole, push = protocol.mu3 * protocol.kappa, protocol.mu2 * protocol.T_r
        why = "0 is reached nearer to T_r than can be written"
        if pole < 1:
            why = "mu3 kappa < 1 and sigma(0) is large"
        if push + pole > LARGEST_PUSH:
            why = f"mu2 T_r + mu3 kappa is above {LARGEST_PUSH}, where no earlier instant is proved"
        clauses.append(f"reaching time T_r for {shorten_list(late, 40)}: {why}")
    value = None if last is None else last.time
    yield Fact(head="sliding", value=value, side="up", note="; ".join(clauses), detail=True)


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


#: How the line ends that tells what is given.
_FOLLOWS = ", in what follows"


def facts_of(
    certificate: Certificate,
    name: str | None = None,
    origins: Mapping[str, str] | None = None,
    details: bool = True,
) -> list[Fact]:
    r"""Return what is told of a certificate: question, answers, verdict. Nothing that the check rejects is told.

    Parameters
    ----------
    certificate : Certificate
    name : str, optional
        What the graph is called, unless as the certificate says.
    origins : mapping of str to str, optional
        Where ``x(0)`` and ``sigma(0)`` come from, and how a family was ``read``, unless as the certificate says.
    details : bool
        Whether facts that a short screen leaves out are sought at all: some take as long as the proof.

    Examples
    --------
    >>> foes = SignedDigraph.from_edges([("a", "b", -1), ("b", "a", -1)])
    >>> cert = certify(foes, NominalProtocol(T=1, rho1=1, rho2=2, kappa=1), [3, 5], asks=Asks(simulation=False))
    >>> print(*(f"{fact.head}: {fact.text}" for fact in facts_of(cert) if fact.head in ("x(T)", "input")), sep="\n")
    x(T): a=-1, b=1 (exact)
    input: bounded; |u_k| <= 24.01, the largest of agent a
    """
    origins = certificate.origins if origins is None else origins
    if name is None:
        name = certificate.origins.get("graph", "" if certificate.of_family else "graph")
    facts: list[Fact] = []
    if certificate.of_family:
        components = [part.component for part in certificate.family_proof.parts]
        facts += family_facts(
            certificate.family_proof.family, name, origins.get("read", ""), components if details else None
        )
    else:
        facts += graph_facts(certificate.graph_proof.structure, name, details)
    facts += protocol_facts(certificate, origins)
    if not rejects(certificate.checked):
        facts += _answers(certificate, origins, details)
    return [*facts, *verdict_facts(certificate)]


def _answers(certificate: Certificate, origins: Mapping[str, str], details: bool) -> Facts:
    """Tell what becomes of the agents: first with late messages and moving leaders, if there are any."""
    labels, protocol = certificate.labels, certificate.protocol
    yield from initial_facts(certificate, origins, alone=certificate.only_drawn)
    yield from sliding_facts(labels, protocol.reaching, certificate.sigma0, certificate.proof.reaching)
    yield from late_facts(certificate)
    beside = _beside(certificate)
    if certificate.of_family:
        components = [part.component for part in certificate.family_proof.parts]
        of = "" if certificate.proof.offsets is None else " of x - offsets"
        yield from family_claims(components, f"{of} at T = {near(protocol.T)}", certificate)
    else:
        yield from claim_facts(certificate)
    yield from beside
    yield from (_of_family if certificate.of_family else _of_graph)(certificate, details, beside)


def _of_graph(certificate: Certificate, details: bool, beside: Sequence[Fact]) -> Facts:
    """Tell of one graph where its agents end, how fast, and with what input; ``beside`` what is given there."""
    drawn = certificate.only_drawn
    if certificate.proof.agents is not None:
        yield from agents_facts(certificate.proof.agents, details)
    elif not drawn:
        yield from _details(final_facts(certificate), certificate.proof.leaders_move)
    if details:
        part = certificate.proof.agents
        of = "" if part is None else "of the plain protocol: " if part.order == 1 else "of single integrators: "
        yield from (replace(fact, note=joined("", (of, fact.note))) for fact in rate_facts(certificate))
    if certificate.proof.agents is None and (details or not beside):
        yield from _details(error_facts(certificate, drawn, details), bool(beside))
        yield from _given(input_facts(certificate, details), beside)
        yield from _details(disturbed_facts(certificate), bool(beside))
    if details:
        yield from run_facts(certificate)


def _of_family(certificate: Certificate, details: bool, beside: Sequence[Fact]) -> Facts:
    """Tell the same of a family for every signal, and for those that were asked for."""
    yield from family_rate_facts(certificate)
    if details:
        yield from function_facts(certificate)
    yield from signal_facts(certificate)
    yield from _details(family_final_facts(certificate), certificate.proof.leaders_move)
    yield from _details(family_error_facts(certificate), bool(beside))
    yield from _given(family_input_facts(certificate), beside)


def _beside(certificate: Certificate) -> list[Fact]:
    """Tell what the rest of a certificate knows nothing of: nothing, or one fact."""
    if certificate.proof.late is None and not certificate.proof.leaders_move:
        return []  # facts that are without limits, noise or disturbances say so
    without = [text for text in assumptions(certificate) if not text.startswith("without limits")]
    text = f"{', '.join(without)}{_FOLLOWS}"
    return [Fact(head="given", note=text, detail=True)] if without else []


def _details(facts: Iterable[Fact], are: bool) -> Iterable[Fact]:
    """Return facts, which are details where others stand in their place."""
    return (replace(fact, detail=True) for fact in facts) if are else facts


def _given(facts: Iterable[Fact], beside: Sequence[Fact]) -> Facts:
    """Return facts of the input as details that say what is given; as they are where nothing is."""
    first = "".join(f"{fact.text.removesuffix(_FOLLOWS)}: " for fact in beside)
    for fact in _details(facts, bool(beside)):
        yield replace(fact, note=joined("", (first, fact.note)), brief=()) if first and fact.head == "input" else fact
