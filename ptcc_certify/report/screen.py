"""One screen of text about a structure or a certificate."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from fractions import Fraction
from itertools import chain, dropwhile, repeat, takewhile
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from lmi.exact.decimal_rounding import down, near, up
from ptcc_certify.bounds.final_state import extremes
from ptcc_certify.certificate.answer import rejects
from ptcc_certify.errors import PTCCError
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.report.agents_lines import answers, claimed_of, long_lines
from ptcc_certify.report.family_screen import WHATEVER, family_summary
from ptcc_certify.report.input_lines import disturbed_lines, initial_states_text, input_lines, limits_text
from ptcc_certify.report.late_lines import late_lines, residual_text, tracking_lines
from ptcc_certify.report.sliding_lines import sliding_lines
from ptcc_certify.report.structure_text import (
    ORIENTATION,
    Lines,
    graph_entries,
    leader_lines,
    remarks_on,
    structure_text,
)
from ptcc_certify.report.text_layout import (
    TEXT,
    arithmetic,
    columns,
    counted,
    format_lines,
    printable,
    short_number,
    shorten_label,
    shorten_list,
    shorten_text,
    value_list,
    wrap_lines,
    wrap_text,
)
from ptcc_certify.report.told_instants import SHORT, told_instants
from ptcc_certify.theorems.claims import Claim
from ptcc_certify.theorems.family_behaviour import DEPENDS

if TYPE_CHECKING:
    from ptcc_certify.bounds.final_state import FinalState
    from ptcc_certify.bounds.input.effort import Effort
    from ptcc_certify.certificate.agents_answer import AgentsAnswer
    from ptcc_certify.certificate.certificate import Certificate
    from ptcc_certify.checker import CheckReport
    from ptcc_certify.protocols.base import Protocol

#: Columns of a list of nodes on the long screen: twelve lines.
_LONG_LIST = 12 * TEXT


def summary_lines(certificate: Certificate, name: str, origins: Mapping[str, str] = MappingProxyType({})) -> list[str]:
    r"""Return the short screen of ``ptcc certify``: 8 lines of 80 columns, 10 or so rather than cut an answer.

    Of a disconnected graph there are up to 4 more.

    Parameters
    ----------
    certificate : Certificate
    name : str
        What the graph is called.
    origins : mapping of str to str, optional
        Where ``x(0)`` and ``sigma(0)`` come from, by these names; ``given`` unless told.

    Returns
    -------
    list of str
        Graph, how it was read, protocol, claim, final state, error bound, input, disturbances, verdict. Error
        bound and input tell of single agents where their line has room. Where messages are late, or leaders move, what
        holds then stands before the claim, in place of error bound and input.

    Examples
    --------
    >>> foes = SignedDigraph.from_edges([("a", "b", -1), ("b", "a", -1)])
    >>> cert = certify(foes, NominalProtocol(T=1, rho1=1, rho2=2, kappa=1), [3, 5], asks=Asks(simulation=False))
    >>> print("\n".join(summary_lines(cert, "foes")))
    graph      foes: 2 nodes, 2 edges (2 negative), strongly connected
    read       row a,b: information flows a -> b; undirected
    protocol   nominal: T=1, rho1=1, rho2=2, kappa=1; x(0) given
    claim      signed-average consensus at T = 1 (Theorem 1.1, Corollary 1.1)
    x(T)       a=-1, b=1 (exact)
    error      at 0.99 T: ||E|| <= 1.4e-09 ||E(0)||, every agent within 5.6e-09
    input      bounded; |u_k| <= 24.01, the largest of agent a
    verdict    certified; checked without a solver
    """
    p = certificate.protocol
    asked = [*graph_entries(certificate.structure, name), ("protocol", _protocol_text(certificate, origins))]
    if rejects(certificate.checked):
        return wrap_lines(format_lines([*asked, ("verdict", _short_verdict(certificate))]))
    whatever = "" if p.reaching is None else f", any |d_k| <= {down(p.reaching.delta, 12)}"
    if p.reaching is not None and p.reaching.delta == 0:
        whatever = ", without disturbances"
    if certificate.late is not None:
        whatever = ", nothing late"
    if certificate.leaders_move:
        whatever = ", nothing late, leaders at rest" if certificate.late else ", leaders at rest"
    if certificate.limits:
        whatever = ", without limits"
    claims = _claim_texts(
        certificate.structure, certificate.claims, _when(certificate, f"at T = {near(p.T)}"), whatever
    )
    drawn = _is_set_asked(certificate)
    entries = [
        *asked,
        *late_lines(certificate),
        *tracking_lines(certificate),
        *_headed("claim", claims),
        *_answers(certificate, drawn),
        ("verdict", _short_verdict(certificate)),
    ]
    return wrap_lines(format_lines(entries))


def structure_summary(structure: Structure, name: str) -> list[str]:
    """Return the short screen of ``ptcc classify``: at most 8 lines of 80 columns, 12 of a disconnected graph."""
    followers = [structure.graph.labels[v] for v in structure.followers.tolist()]
    claims = _claim_texts(structure, [component.claim for component in structure.components])
    leaders = (
        (head, text if columns(text) <= TEXT else shorten_text(text.partition(", negative cycle")[0], TEXT))
        for head, text in leader_lines(structure, 3, 20)
    )
    told = [("followers", shorten_list(followers, TEXT))] if followers else []
    return wrap_lines(format_lines([*graph_entries(structure, name), *leaders, *told, *_headed("claim", claims)]))


def check_summary(path: str, document: Mapping[str, Any], report: CheckReport) -> list[str]:
    """Return the short screen of ``ptcc check``: what is claimed, as ``certify`` tells it, and whether it was verified.

    Without a path, and where a number is beyond float64, nothing but the claim itself.
    """
    lines = []
    if report.accepted:
        claims = [part["claim"] for part in document.get("components") or [document]]
        texts = sorted({_file_claim(claim) for claim in claims})
        lines = format_lines([("claim", ", ".join(texts) + f" in {len(claims)} components" * (len(claims) > 1))])
    if report.accepted and path:
        with suppress(PTCCError):
            told = _file_summary(path, document, report)
            answers = dropwhile(lambda line: not line.startswith("protocol"), told)
            lines = list(takewhile(lambda line: not line.startswith("verdict"), answers))
    return wrap_lines([*lines, report.lines()[-1]])


def _file_claim(claim: Mapping[str, str]) -> str:
    """Tell a claim of a file in a few words."""
    if "signal" not in claim:
        return f"{claim['behaviour']} (Theorem {claim['theorem']})"
    return claim["behaviour"] + f" {WHATEVER['any']}" * (claim["behaviour"] != DEPENDS)


def _file_summary(path: str, document: Mapping[str, Any], report: CheckReport) -> list[str]:
    """Return the short screen of an accepted certificate, of a graph or a family, as its file says it."""
    from ptcc_certify.certificate.certificate import Certificate, accepted_certificate
    from ptcc_certify.certificate.section_writer import read_side_files

    origins = dict.fromkeys(("x(0)", "v(0)", "a(0)", "sigma(0)"), "as in the file")
    files = read_side_files(document, Path(path).parent)
    certificate = accepted_certificate(Path(path), document, "", report, files)
    if isinstance(certificate, Certificate):
        return summary_lines(certificate, path, origins)
    return family_summary(certificate, path, origins)


def _when(certificate: Certificate, when: str) -> str:
    """Tell of what a claim is, and when."""
    if certificate.agents is None:
        return f"{' of x - offsets' * (certificate.offsets is not None)} {when}"
    return f"{claimed_of(certificate.agents)} {when}"


def _protocol_text(certificate: Certificate, origins: Mapping[str, str]) -> str:
    """Tell the protocol with its parameters, and where the initial state comes from."""
    begin = [] if certificate.initial_state is None else [f"x(0) {origins.get('x(0)', 'given')}"]
    if certificate.agents is not None and certificate.agents.initial_state is not None:
        names = ("x(0)", "v(0)", "a(0)")[: certificate.agents.order]
        begin = [f"{name} {origins.get(name, _origin(certificate.agents, i))}" for i, name in enumerate(names)]
    if certificate.initial_set is not None and (not begin or _is_set_asked(certificate)):
        begin = [initial_states_text(certificate.initial_set)]
    begin += ["in a formation"] * (certificate.offsets is not None)
    if certificate.sigma0 is not None:
        begin += ["sigma(0) 0" if certificate.direct else f"sigma(0) {origins.get('sigma(0)', 'given')}"]
    return "; ".join([_gains_text(certificate.protocol), ", ".join(begin) or "no x(0)"])


def _origin(part: AgentsAnswer, i: int) -> str:
    """Tell of initial positions, velocities and so on that they are given, or that all are 0."""
    still = i > 0 and not any(chain[i] for agent in part.initial_state or () for chain in agent)
    return "0" if still else "given"


def _gains_text(p: Protocol) -> str:
    """Tell a protocol with its parameters."""
    return f"{p.kind}: " + ", ".join(f"{name}={near(getattr(p, name), 12)}" for name in p.to_dict() if name != "kind")


def _headed(head: str, texts: Iterable[str]) -> Lines:
    """Put a head before the first of some texts."""
    return zip(chain([head], repeat("")), texts, strict=False)


def _claim_texts(structure: Structure, claims: Sequence[Claim], when: str = "", also: str = "") -> list[str]:
    """Name the sharpest behaviour of every component, of the largest four of many, and under what ``also``."""
    sharpest = [claim.sharpest for claim in claims]
    if len(claims) == 1:
        (claim,) = claims
        texts = [f"{sharpest[0]}{when}{also} ({which})" for which in (claim.reference, f"Theorem {claim.theorem}")]
        return [texts[0] if len(texts[0]) <= TEXT else texts[1]]
    components, labels, lines = structure.components, structure.graph.labels, []
    for k in sorted(range(len(claims)), key=lambda k: -len(components[k].nodes))[:4]:
        text = f"{sharpest[k]}{when} (Theorem {claims[k].theorem})"
        nodes = components[k].nodes
        names = [printable(labels[v]) for v in nodes[:TEXT]]
        lines.append(f"{shorten_list(names, max(TEXT - len(text) - 2, 14), len(nodes))}: {text}")
    lines += [f"... {len(claims):,} components in all"] * (len(claims) > 4)
    return lines + [also.removeprefix(", ")] * bool(also)


def _short_final_state(certificate: Certificate) -> Lines:
    """Tell where the agents end, in two lines if all fit there, else how many where, or the least and largest state."""
    result, labels = certificate.final_positions, certificate.graph.labels
    if result is None:
        return
    degenerate = "; balanced leaders happen to meet at 0" * bool(result.degenerate)
    unproved = "; not certified that they get there" * (certificate.verdict == "undecided")
    kind = f"({_accuracy(result, 'rounded')}{degenerate}{'; without limits' * bool(certificate.limits)}{unproved})"
    groups: dict[Fraction | float, list[str]] = {}
    for label, state in zip(labels, result.states, strict=True):
        groups.setdefault(state, []).append(printable(label))
    listed = value_list(labels, result.states, 2 * TEXT)
    grouped = "; ".join(f"{', '.join(names)} at {short_number(state)}" for state, names in groups.items())
    text = min(listed, grouped, key=columns)
    cut = ", ... (" in text or len(wrap_text(f"{text} {kind}")) > 2
    if len(groups) == 1 < len(labels):
        text = f"every agent at {short_number(result.states[0])}"
    elif cut and len(groups) == 2:
        text = " and ".join(
            f"{len(names):,} agent{'s'[: len(names) > 1]} at {short_number(state)}" for state, names in groups.items()
        )
    elif cut:
        most, least = (
            value_list([labels[k]], [result.states[k]]) for (k,) in extremes(result.states, 1, result.radius)
        )
        text = f"least {least}, largest {most}, of {len(labels):,} agents"
    yield "x(T)", f"{text} {kind}"


def _is_set_asked(certificate: Certificate) -> bool:
    """Tell whether the question is of a set of initial states, and the one at hand drawn for the simulated run."""
    return certificate.initial_set is not None and "x(0)" in certificate.request.origins


def _answers(certificate: Certificate, drawn: bool) -> Lines:
    """Tell where the agents end, how near by when, and the input."""
    if certificate.agents is not None:
        yield from answers(certificate.agents)
        return
    if not certificate.leaders_move and not drawn:
        yield from _short_final_state(certificate)
    if certificate.late is None and certificate.tracking is None:
        yield from _bounds(certificate, drawn)
        yield from disturbed_lines(certificate)


def _bounds(certificate: Certificate, drawn: bool) -> Lines:
    """Tell how near the agents are by when, and how large the input gets; of single agents where the line has room."""
    if certificate.constant:
        invariant = "its state" if certificate.direct else "x - sigma"
        yield "error", f"none: no agent listens to another, each keeps {invariant}"
        return
    norm, agents, more = _error_texts(certificate)
    if norm:
        limited = certificate.effort is not None and bool(certificate.effort.residual)  # from the whole set
        texts = (norm + agents.replace("every agent", whom) + more for whom in ("every agent", "agents", "each"))
        fitting = (text for text in texts if columns(text) <= TEXT and (limited or not drawn))
        yield "error", next(fitting, norm + more)
    if certificate.effort is not None:
        loud = certificate.effort.bounded is False and not certificate.effort.residual
        text, agent = _input_texts(certificate, certificate.effort)
        yield "INPUT" if loud else "input", text + agent * (columns(text + agent) <= TEXT)


def _error_texts(certificate: Certificate) -> tuple[str, str, str]:
    """Return bounds of the error and of every agent's deviation at 0.99 T, at the instant asked for, or under limits.

    Empty texts where nothing is proved; the last one tells that there are more limits.
    """
    if certificate.effort is not None and certificate.effort.residual:
        entry, *others = certificate.effort.residual
        noise = "" if entry.noise is None else f", |n_k| <= {down(entry.noise, 12)}"
        norm = f"{limits_text(entry)}{noise}: at T ||E|| <= {up(entry.noisy_norm or entry.norm, 2)}"
        agents = "" if entry.agents is None or entry.noisy_norm else f", every agent within {up(max(entry.agents), 2)}"
        return norm, agents, f"; ... {len(others) + 1} limits in all" * bool(others)
    if certificate.rate is None:
        return "", "", ""
    remaining, when = _instant(certificate)
    z = certificate.envelope.coordinates
    if certificate.direct:
        norm = f"||{z}|| <= {up(certificate.envelope.residual(remaining), 2)} ||{z}(0)||"
    elif certificate.initial_state is not None:
        norm = f"||{z}|| <= {up(float(certificate.norm_bound([remaining])[0]), 2)}"
    else:
        return "", "", ""
    agents = ""
    if certificate.initial_state is not None and any(V.deviation for V in certificate.functions):
        agents = f", every agent within {up(float(certificate.deviation_bound([remaining]).max()), 2)}"
    return f"at {when}{', numerical' * (not certificate.direct)}: {norm}", agents, ""


def _instant(certificate: Certificate) -> tuple[float, str]:
    """Return ``1 - t/T`` where the short screen tells the error, and the name of that instant."""
    if certificate.at is not None:
        return float(1 - certificate.at / certificate.protocol.T), f"t = {near(certificate.at)}"
    return told_instants(certificate.protocol, certificate.direct)[SHORT]


def _input_texts(certificate: Certificate, effort: Effort) -> tuple[str, str]:
    """Tell whether the input is bounded and its proved size, and whose it is."""
    entry = effort.residual[0] if effort.residual else None
    if entry is not None:
        text, largest = "bounded under these limits", entry.largest if entry.noise is None else entry.noisy_largest
        nothing = "; under a sample period no number is proved"
    else:
        states = {True: "bounded", False: "NOT BOUNDED from some initial states", None: "not proved bounded"}
        text, largest = states[effort.bounded], None if effort.peak is None else effort.peak.largest
        nothing = "; no number is proved" * bool(effort.bounded and certificate.initial_state is not None)
        if largest is None and effort.bounded and effort.sliding is not None and not effort.sliding.bounded:
            text, nothing = "the nominal part is bounded", ", of the sliding part nothing is proved"
    if largest is None:
        return text + nothing, ""
    whom = "" if effort.initial_set is None else f" for {initial_states_text(effort.initial_set)}"
    agent = ""
    if entry is None and effort.peak is not None:
        label = certificate.graph.labels[effort.peak.agents.index(largest)]
        agent = f", the largest of agent {shorten_label(label, 22)}"
    return f"{text}; |u_k| <= {up(largest, 4)}{whom}", agent


def _short_verdict(certificate: Certificate) -> str:
    """Tell the verdict; what is not as one would wish comes first, and agrees with the exit code."""
    from ptcc_certify.certificate.verdict import CERTIFIED

    assessment = certificate.assessment
    if assessment.verdict != CERTIFIED:
        return assessment.line(f"{assessment.verdict}: {assessment.remark}")
    certified, advice = assessment.certified_part, re.sub(r" \(.*?\)", "", assessment.advice)
    certified += ", but says little by T" * (assessment.useful is False)
    checked = "" if certified != CERTIFIED or assessment.answers or assessment.caveat else "checked without a solver"
    ended = _cut_off_text(certificate)
    return assessment.line(certified, checked, assessment.caveat, advice, ended)


def _cut_off_text(certificate: Certificate) -> str:
    """Tell what was cut off because it took longer than its share of the time limit; nothing if nothing was."""
    if not certificate.cut_off:
        return ""
    shares = "its share" if len(certificate.cut_off) == 1 else "their shares"
    return f"{', '.join(certificate.cut_off)} cut off after {shares} of --time-limit {certificate.time_limit:g} s"


def structure_lines(structure: Structure, name: str) -> list[str]:
    """Return the lines of ``ptcc classify``."""
    labels = structure.graph.labels
    followers = [labels[v] for v in structure.followers.tolist()]
    claims = _claim_lines(structure, [component.claim for component in structure.components])
    told = [("followers", shorten_list(followers, _LONG_LIST))] if followers else []
    facts = [("nodes", shorten_list(labels)), ("structure", structure_text(structure))]
    return format_lines(
        [*_graph_lines(structure, name), *facts, *leader_lines(structure, 4, _LONG_LIST), *told, *claims]
    )


def certificate_lines(
    certificate: Certificate, name: str, origins: Mapping[str, str] = MappingProxyType({})
) -> list[str]:
    """Return the lines of ``ptcc certify -v``, as long as they are: at most 28 for a connected graph."""
    structure, p = certificate.structure, certificate.protocol
    when = f"at T = {near(p.T)}" if p.reaching is None else f"at T_r + T_s = {near(p.T)} whatever the disturbance"

    def lines() -> Lines:
        yield from _graph_lines(structure, name)
        yield "structure", structure_text(structure)
        if rejects(certificate.checked):
            yield from (("note", note) for note in certificate.notes[:1])
            yield "verdict", certificate.assessment.text
            return
        yield from late_lines(certificate)
        if by_agent := residual_text(certificate):
            yield "", f"left at T by agent: {by_agent}"
        yield from tracking_lines(certificate)
        if certificate.late is not None or certificate.tracking is not None:
            without = ["messages at once"] * (certificate.late is not None)
            without += ["leaders at rest"] * certificate.leaders_move
            yield "", f"the lines below are of {' and '.join(without)}"
        yield from _claim_lines(structure, certificate.claims, _when(certificate, when))
        yield "protocol", _gains_text(p)
        if certificate.limits or certificate.noise is not None or certificate.delta is not None:
            yield "", "a line that names no limits, noise or disturbances is without them"
        if (begin := certificate.initial_positions) is not None:
            drawn = f" ({origins['x(0)']})" if "x(0)" in origins else ""
            alone = ", of the simulated run alone" * _is_set_asked(certificate)
            yield "x(0)", value_list(structure.graph.labels, begin) + drawn + alone
        if certificate.agents is not None:
            yield from chain(long_lines(certificate.agents), _rate_lines(certificate))
            yield from _headed("simulated", _simulated_agents(certificate))
        else:
            states = () if _is_set_asked(certificate) else (_final_state_lines, _deviation_lines)
            for part in (_sliding_lines, *states, _rate_lines, input_lines):
                yield from part(certificate)
        yield from _headed("simulated", _simulated(certificate))
        if certificate.cut_off:
            yield "time limit", f"{_cut_off_text(certificate)}; what was proved by then stands"
        yield from (("note", note) for note in certificate.notes[:3])
        yield "verdict", certificate.assessment.text

    return format_lines(lines())


def _graph_lines(structure: Structure, name: str) -> Lines:
    graph, negative = structure.graph, int((structure.graph.sign < 0).sum())
    yield "graph", f"{name}: {counted(graph.n_nodes, 'node')}, {counted(graph.n_edges, 'edge')}, {negative:,} negative"
    yield "read", "; ".join([ORIENTATION[graph.read["orientation"]], *remarks_on(structure)])


def _final_state_lines(certificate: Certificate) -> Lines:
    """Tell where the agents end."""
    result = certificate.final_positions
    if result is None:
        return
    yield "x(T)", f"{value_list(certificate.graph.labels, result.states)} ({_accuracy(result)})"
    if result.degenerate:
        groups = ", ".join(map(str, result.degenerate))
        yield "", f"of this x(0) leader group {groups} happens to meet at 0, although it is balanced"


def _accuracy(result: FinalState, rounded: str = "here to 5 digits") -> str:
    """Tell how exactly a final state is known, and whether it is written with fewer digits."""
    if result.radius is None and not result.exact:
        return "floating point"
    cut = any(Fraction(short_number(x)) != x for x in result.states)
    if widest := max(result.radius or (0,)):
        return f"to within {up(widest, 2)}, proved" + f"; {rounded}" * cut
    return "exact" if not cut else rounded if rounded == "rounded" else f"exact; {rounded}"


def _rate_lines(certificate: Certificate) -> Lines:
    rate, bound, spectral = certificate.rate, certificate.upper_bound, certificate.spectral_rate
    best = "" if bound is None else f"; upper bound {up(bound, 8)}, proved"
    if bound is not None and spectral is not None and bound > Fraction(spectral) * Fraction(101, 100):
        best += f" ({spectral:.6g}, numerical)"
    if certificate.constant:
        invariant = "its state" if certificate.direct else "x - sigma"
        yield "rate", f"no agent listens to another, each keeps {invariant}: there is nothing to decay"
        return
    if rate is None:
        numerical = certificate.numerical_rate
        yield "rate", f"not proved{'' if numerical is None else f'; numerically {numerical:.6g}'}{best}"
        return
    ratio = "" if bound is None else f", optimality ratio at least {down(rate / bound, 4)}"
    yield "rate", f"{down(rate)} per unit of the stretched clock s, proved: V <= e^(-rate s) V(0){best}{ratio}"
    yield from _class_lines(certificate)
    if certificate.agents is None:
        yield from _residual_lines(certificate) if certificate.direct else _reaching_lines(certificate)
    proved = f"{len(certificate.obligations)} proof obligations proved in {arithmetic(certificate.direct)}"
    yield "proof", f"{proved}; checked without a solver: accepted"


def _class_lines(certificate: Certificate) -> Lines:
    """Tell the Lyapunov functions of the envelope: class, rate, overshoot; what was searched; the paper's formula."""
    V, search = certificate.lyapunov, certificate.search
    if V is not None and certificate.proof.rate is not None:
        rho = "" if V.rho is None else f", rho {float(V.rho):.4g}"
        overshoot = f"overshoot constant {up(V.overshoot, 4)} of ||{V.coordinates}||^2"
        yield "", f"paper {down(certificate.proof.rate)} = {V.objective}{rho}; {overshoot}"
    if search.searched:
        searched = [f"{kind} {rate:.4g}" for kind, rate in search.searched.items()]
        limit = "" if search.diagonal_limit is None else f"; diagonal upper bound {search.diagonal_limit:.4g}"
        time = f"; time limit {certificate.time_limit:.3g} s" if math.isfinite(certificate.time_limit) else ""
        yield "", f"searched {', '.join(searched)} (numerical{limit}{time})"
        used = [f"{V.kind} {down(V.proved_rate, 4)} (overshoot {up(V.overshoot, 2)})" for V in search.functions]
        yield "", f"used {', '.join(used) or 'none, no rate was proved'}"


def _at_instants(values: Iterable[float], names: Iterable[str]) -> str:
    """List bounds at instants, rounded up."""
    return ", ".join(f"{up(float(x), 2)} at {name}" for x, name in zip(values, names, strict=True))


def _deviation_lines(certificate: Certificate) -> Lines:
    """Tell how far from its final state the farthest agent may be, and every agent at the instant asked for."""
    if certificate.initial_state is None or not any(V.deviation for V in certificate.functions):
        return
    instants = told_instants(certificate.protocol, certificate.direct)[:4]
    worst = certificate.deviation_bound([q for q, _ in instants]).max(axis=0, initial=0.0)
    numerical = "" if certificate.direct else " (numerical, rounded up)"
    bounds = _at_instants(worst, (name for _, name in instants))
    yield "deviation", f"of every agent from its final state at most {bounds}{numerical}"
    if certificate.at is not None:
        each = certificate.deviation_bound([float(1 - certificate.at / certificate.protocol.T)])[:, 0]
        entries = [f"{label} {up(float(x), 2)}" for label, x in zip(certificate.graph.labels, each, strict=True)]
        yield "", f"at t = {near(certificate.at, 12)}: {shorten_list(entries)}"


def _residual_lines(certificate: Certificate) -> Lines:
    envelope, at = certificate.envelope, certificate.at
    instants = told_instants(certificate.protocol, certificate.direct)
    proved = _at_instants((envelope.residual(q) for q, _ in instants), (name for _, name in instants))
    if at is not None:
        own = envelope.residual(float(1 - at / certificate.protocol.T))
        proved = f"{up(own, 3)} at t = {near(at, 12)}, {proved}"
    yield "error", f"||{envelope.coordinates}(t)|| / ||{envelope.coordinates}(0)|| at most {proved}"
    slowest = [certificate.best_possible_residual(q) for q, _ in instants]
    if slowest[-1] is not None:
        yield "", "slowest mode (numerical) " + ", ".join(f"{x or 0.0:.2g}" for x in slowest)


def _reaching_lines(certificate: Certificate) -> Lines:
    """Tell what the proved rate leaves where the sliding variables drive the agents until ``T_r``."""
    if certificate.initial_state is None:
        return
    p = certificate.protocol
    instants = [(float(p.span / p.T), "T_r"), *told_instants(p, certificate.direct)]
    bounds = _at_instants(certificate.norm_bound([q for q, _ in instants]), (name for _, name in instants))
    z = certificate.envelope.coordinates
    yield "error", f"||{z}(t)|| at most {bounds} (numerical, rounded up)"


def _simulated(certificate: Certificate) -> Iterator[str]:
    """Tell what the run showed."""
    run, comparison = certificate.trajectory, certificate.comparison
    if run is None:
        return
    if comparison is not None and not certificate.constant:
        verdict = (
            "VIOLATED" if comparison.violated else "kept" if comparison.judged else "not tested, all is below the floor"
        )
        resolved = f"until 1 - t/T = {comparison.resolved_until:.1e}" if comparison.resolved_until else "throughout"
        ratio = f"worst ratio {comparison.worst_ratio:.4g}, above integrator tolerance {resolved}"
        yield f"CVODES to 1 - t/T = {comparison.stop:.0e}: bound {verdict}, {ratio}"
    if comparison is not None and (slid := run.sliding) is not None and not certificate.direct:
        last = int(slid.reaching_z.argmax())
        when = "at T_r only"
        if math.isfinite(slid.reaching_z[last]):
            when = f"at t = {slid.reaching_times[last]:.6g}, {slid.reaching_left[last]:.3g} before T_r"
        reaching = "kept" if comparison.reaching_kept else "VIOLATED"
        ratio = f"worst |sigma| ratio {comparison.sliding_ratio or 0:.4g}"
        yield f"reaching times {reaching}, the last {when} (agent {run.labels[last]}); {ratio}"
    if certificate.final_state is not None:
        gap = float(abs(run.final_state - certificate.final_state).max())
        remark = "" if run.deadline_resolved else " (the run had not settled)"
        yield f"end state within {gap:.1e} of the final state{remark}"


def _simulated_agents(certificate: Certificate) -> Iterator[str]:
    """Tell what the run of agents of order n showed."""
    seen = certificate.agents_comparison
    if seen is not None:
        word = "VIOLATED" if seen.violated else "kept"
        yield f"CVODES: bounds {word}, worst ratio of V {seen.decay:.4g}, of all bounds {seen.worst:.4g}"


def _claim_lines(structure: Structure, claims: Sequence[Claim], when: str = "") -> Lines:
    """Tell each claim in full, and of several components which one it is of, or how many."""
    labels, texts = structure.graph.labels, []
    for claim, count in sorted(Counter(claims).items(), key=lambda item: item[0].theorem):
        nodes = structure.components[claims.index(claim)].nodes
        whose = f"{count} components" if count > 1 else shorten_list([labels[v] for v in nodes], 40)
        texts.append(f"{whose}: " * (len(claims) > 1) + _claim_text(claim, when))
    return _headed("claim", texts)


def _sliding_lines(certificate: Certificate) -> Lines:
    """Tell ``sigma(0)``, what is proved of the sliding variables, and which disturbance the run met."""
    run = certificate.trajectory
    yield from sliding_lines(
        certificate.graph.labels, certificate.protocol.reaching, certificate.sigma0, certificate.reaching
    )
    if run is not None and (slid := run.sliding) is not None:
        yield "disturbed", f"the run meets d = {slid.source}; |d| <= delta: {slid.bounded_by}"


def _claim_text(claim: Claim, when: str) -> str:
    numbers = f"Corollar{'y' if len(claim.corollaries) == 1 else 'ies'} {', '.join(claim.corollaries)}"
    theorem = f"{claim.behaviour}{when} (Theorem {claim.theorem}"
    if claim.special:
        return f"{theorem}), in particular {', '.join(claim.special)} ({numbers})"
    return f"{theorem}, {numbers})" if claim.corollaries else f"{theorem})"
