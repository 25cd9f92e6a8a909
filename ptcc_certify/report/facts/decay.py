"""Facts of how fast agents get where they end: the rate, its functions and its upper bound, and the error."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from fractions import Fraction
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from lmi.exact.decimal_rounding import down, near, up
from ptcc_certify.bounds.envelope import Envelope
from ptcc_certify.certificate.fact import Fact, Facts, Standing
from ptcc_certify.errors import Change, Sentence, joined, labelled
from ptcc_certify.graphs.size_limits import EXACT_NODES
from ptcc_certify.graphs.structure import BIPARTITE_CONSENSUS, STABILITY
from ptcc_certify.report.facts.constrained_switching import TINY, TOO_SMALL, every_text
from ptcc_certify.report.facts.input import limits_text, said_without
from ptcc_certify.report.text_layout import shorten_list
from ptcc_certify.theorems.contractions import explicit_rate
from ptcc_certify.theorems.family_behaviour import mode_name

if TYPE_CHECKING:
    from ptcc_certify.bounds.input.effort import Limited
    from ptcc_certify.certificate.certificate import Certificate
    from ptcc_certify.model.base import Protocol

#: What proves an upper bound on the rate, in words.
BOUND_KINDS = {
    "member": "a single graph of the family, held for ever",
    "mixture": "a mixture of graphs of the family, between which a signal switches fast",
    "word": "a periodic signal",
}


#: 1 - t/T and its name, where screen, page and statement tell what is left; the last are told of one graph alone.
_INSTANTS = ((0.5, "0.5 T"), (0.1, "0.9 T"), (0.01, "0.99 T"), (1e-6, "T(1-1e-6)"), (1e-9, "T(1-1e-9)"))
#: Which of them the short screen tells.
SHORT = 2


def told_instants(protocol: Protocol, direct: bool) -> list[tuple[float, str]]:
    """Return ``1 - t/T`` and its name: with a reaching phase (not ``direct``) counted from ``T_r`` on.

    Examples
    --------
    >>> p = SlidingModeProtocol(T_r=1, T_s=3, rho1=1, rho2=1, kappa=2, mu1=2, mu2=1, mu3=1, delta=1)
    >>> told_instants(p, True)[0], told_instants(p, False)[0]
    ((0.5, '0.5 T'), (0.375, 'T_r + 0.5 T_s'))
    """
    if direct:
        return list(_INSTANTS)
    share = float(protocol.span / protocol.T)
    return [(left * share, f"T_r + {name.replace('T', 'T_s')}") for left, name in _INSTANTS]


# ---------------------------------------------------------------------- one graph


def rate_facts(certificate: Certificate) -> Facts:
    """Tell the rate and its upper bound, and the Lyapunov functions: class, rate, overshoot, what was searched."""
    proof = certificate.graph_proof
    rate, bound, spectral = proof.rate, proof.upper_bound, certificate.observed.spectral_rate
    if proof.constant:
        return
    limit = "" if bound is None else f"upper bound {up(bound, 8)}, proved"
    if bound is not None and spectral is not None and bound > Fraction(spectral) * Fraction(101, 100):
        limit += f" ({spectral:.6g}, numerical)"
    if rate is None:
        seen = certificate.observed.numerical_rate
        numerical = "" if seen is None else f"numerically {seen:.6g}"
        note = "; ".join(filter(None, ("not proved", numerical, limit)))
        yield Fact(head="rate", standing="unproved", note=note, detail=True)
        return
    yield Fact(head="rate", value=rate, side="down", note=_rate_text(certificate, rate, limit), detail=True)
    if proof.overshoot is not None:
        kinds = ", ".join(f"{number} {kind}" for kind, number in Counter(V.kind for V in proof.functions).items())
        of = proof.fastest.coordinates
        text = f"overshoot constant at that rate {up(proof.overshoot, 4)} of ||{of}||^2; functions: {kinds}"
        yield Fact(head="function", value=proof.overshoot, side="up", note=text, detail=True)
    V, search = proof.lyapunov, certificate.search
    if V is not None and proof.paper_rate is not None:
        rho = "" if V.rho is None else f", rho {float(V.rho):.4g}"
        overshoot = f"overshoot constant {up(V.overshoot, 4)} of ||{V.coordinates}||^2"
        text = f"paper {down(proof.paper_rate)} = {V.objective}{rho}; {overshoot}"
        yield Fact(head="function", value=proof.paper_rate, side="down", note=text, detail=True)
    if search.searched:
        searched = [f"{kind} {rate:.4g}" for kind, rate in search.searched.items()]
        limit = "" if search.diagonal_limit is None else f"; diagonal upper bound {search.diagonal_limit:.4g}"
        time = f"; time limit {certificate.time_limit:.3g} s" if math.isfinite(certificate.time_limit) else ""
        text = f"searched {', '.join(searched)} (numerical{limit}{time})"
        yield Fact(head="function", value=dict(search.searched), standing="unproved", note=text, detail=True)
        used = [f"{V.kind} {down(V.proved_rate, 4)} (overshoot {up(V.overshoot, 2)})" for V in search.functions]
        yield Fact(head="function", note=f"used {', '.join(used) or 'none, no rate was proved'}", detail=True)


def _rate_text(certificate: Certificate, rate: Fraction, limit: str) -> str:
    """Tell a proved rate, what decays at it, and its ratio to what limits it."""
    law = "V <= e^(-rate s) V(0)" if certificate.direct else "V <= e^(-rate (s - s(T_r))) V(T_r) from T_r on"
    text = f"{down(rate)} per unit of the stretched clock s, proved: {law}"
    if certificate.proof.upper_bound is None:
        return text
    return f"{text}; {limit}, optimality ratio at least {down(rate / certificate.proof.upper_bound, 4)}"


def error_facts(certificate: Certificate, drawn: bool, details: bool) -> Facts:
    """Tell how near the agents are to their final states by when; ``drawn`` if the initial state is of no interest."""
    proof = certificate.graph_proof
    if proof.constant:
        invariant = "its state" if certificate.direct else "x - sigma"
        note = f"none: no agent listens to another, each keeps {invariant}"
        yield from said_without(certificate, [Fact(head="error", note=note, asked=note)])
        return
    residual = () if proof.effort is None else proof.effort.residual
    if proof.at_rest and not any(entry.noise for entry in residual):
        note = "none: every agent begins at its final state"
        yield from said_without(certificate, [Fact(head="error", note=note, asked=note)])
        return
    if residual:
        yield _error_fact("proved", _limited_error(residual))
    if not residual or certificate.at is not None:
        standing: Standing = "proved" if certificate.direct else "unproved"
        told = [_error_fact(standing, text, drawn) for text in _ideal_error(certificate)]
        yield from said_without(certificate, told)
    if details and proof.rate is not None:
        if proof.envelope.coordinates == "E":
            yield Fact(head="error", note="E = -L x: by how much each agent differs from what it hears", detail=True)
        yield from said_without(certificate, instants_facts(certificate))
        if certificate.initial_state is not None and not drawn and any(V.deviation for V in proof.functions):
            yield from said_without(certificate, _deviation_facts(certificate))


def _error_fact(standing: Standing, told: tuple[Fraction | float, str, str, str], drawn: bool = False) -> Fact:
    """Tell a bound of the error, and of every agent unless the initial state is of no interest: value and texts."""
    value, norm, agents, more = told
    texts = [norm + agents.replace("every agent", whom) + more for whom in ("every agent", "agents", "each")]
    brief = [*([] if drawn else texts), norm + more]
    return Fact(
        head="error", value=value, side="up", standing=standing, note=brief[0], brief=tuple(brief), asked=brief[0]
    )


def _limited_error(residual: Sequence[Limited]) -> tuple[Fraction | float, str, str, str]:
    """Return bounds of the error and of every agent's deviation at ``T`` under the first limits, and how many are."""
    entry, *others = residual
    noise = "" if entry.noise is None else f", |n_k| <= {down(entry.noise.bound, 12)}"
    size = entry.norm if entry.noise is None else entry.noise.norm
    norm = f"{limits_text(entry.limits)}{noise}: ||E|| <= {up(size, 2)} at T"
    agents = "" if entry.agents is None or entry.noise else f", every agent within {up(max(entry.agents), 2)}"
    return size, norm, agents, f"; ... {len(others) + 1} limits in all" if others else ""


def _ideal_error(certificate: Certificate) -> Iterator[tuple[Fraction | float, str, str, str]]:
    """Yield bounds of the error and of every agent's deviation at 0.99 T, or at the instant asked for, if proved."""
    proof = certificate.graph_proof
    if proof.rate is None or (not certificate.direct and certificate.initial_state is None):
        return
    remaining, when = told_instants(certificate.protocol, certificate.direct)[SHORT]
    if certificate.at is not None:
        remaining, when = float(1 - certificate.at / certificate.protocol.T), f"t = {near(certificate.at)}"
    z = proof.envelope.coordinates
    if certificate.direct:
        value = proof.envelope.residual(remaining)
        norm = f"||{z}|| <= {up(value, 2)} ||{z}(0)||"
    else:
        value = float(proof.norm_bound([remaining])[0])
        norm = f"||{z}|| <= {up(value, 2)}"
    agents = ""
    if certificate.initial_state is not None and any(V.deviation for V in proof.functions):
        agents = f", every agent within {up(float(proof.deviation_bound([remaining]).max()), 2)}"
    when += "" if certificate.direct else ", numerical"
    yield value, f"at {when}: {norm}", agents, ""


def _at_instants(values: Iterable[float], names: Iterable[str]) -> str:
    """List bounds at instants, rounded up."""
    return ", ".join(f"{up(float(x), 2) if x else 0} at {name}" for x, name in zip(values, names, strict=True))


def instants_facts(certificate: Certificate) -> Facts:
    """Tell what the proved rate leaves at instants; of a reaching phase from ``T_r`` on."""
    proof = certificate.graph_proof
    p, z, direct = certificate.protocol, proof.envelope.coordinates, certificate.direct
    instants = told_instants(p, direct)
    if direct:
        proved = _at_instants((proof.envelope.residual(q) for q, _ in instants), (name for _, name in instants))
        yield Fact(head="error", note=f"||{z}(t)|| / ||{z}(0)|| at most {proved}", detail=True)
        slowest = [certificate.best_possible_residual(q) for q, _ in instants]
        if slowest[-1] is not None:
            text = "slowest mode (numerical) " + ", ".join(f"{x or 0.0:.2g}" for x in slowest)
            yield Fact(head="error", standing="unproved", note=text, detail=True)
    else:
        envelope = proof.envelope
        sliding = Envelope(envelope.structure, envelope.gain, envelope.functions)
        left = [q * float(p.T / p.span) for q, _ in instants]
        clocks = [float(p.rho1 * p.span) * (1 - q) - float(p.rho2 * p.kappa) * math.log(q) for q in left]
        shares = [float(sliding.norm_factor(s * (1 - 1e-12))) for s in clocks]
        proved = _at_instants(shares, (name for _, name in instants))
        yield Fact(head="error", note=f"||{z}(t)|| / ||{z}(T_r)|| at most {proved}", detail=True)
    if not direct and certificate.initial_state is not None:
        instants = [(float(p.span / p.T), "T_r"), *instants]
        bounds = _at_instants(proof.norm_bound([q for q, _ in instants]), (name for _, name in instants))
        text = f"||{z}(t)|| at most {bounds} (numerical, rounded up)"
        yield Fact(head="error", standing="unproved", note=text, detail=True)


def _deviation_facts(certificate: Certificate) -> Facts:
    """Tell how far from its final state the farthest agent may be, and every agent at the instant asked for."""
    yield _deviation_fact(certificate, certificate.proof.deviation_bound)
    if certificate.at is not None:
        each = certificate.proof.deviation_bound([float(1 - certificate.at / certificate.protocol.T)])[:, 0]
        entries = [f"{labelled(label)} {up(float(x), 2)}" for label, x in zip(certificate.labels, each, strict=True)]
        text = f"at t = {near(certificate.at, 12)}: {shorten_list(entries)}"
        yield Fact(head="deviation", value=each, side="up", note=text, detail=True)


def _deviation_fact(certificate: Certificate, bound: Callable[[list[float]], np.ndarray], of: str = "") -> Fact:
    """Tell how far from its final state the farthest agent may be at instants, under the signals ``of`` names."""
    instants = told_instants(certificate.protocol, certificate.direct)[:4]
    worst = bound([remaining for remaining, _ in instants]).max(axis=0, initial=0.0)
    numerical = "" if certificate.direct else " (numerical, rounded up)"
    bounds = _at_instants(worst, (name for _, name in instants))
    note = f"of every agent from its final state at most {bounds}{numerical}{of}"
    standing: Standing = "proved" if certificate.direct else "unproved"
    return Fact(head="deviation", standing=standing, note=note, detail=True)


# ---------------------------------------------------------------------- families


def family_rate_facts(certificate: Certificate) -> Facts:
    """Tell the proved rate, its upper bound and their ratio; where no rate was found, the one in closed form."""
    if not certificate.family_proof.common or all(
        part.component.nodes.size == 1 for part in certificate.family_proof.parts
    ):
        return
    rate, bound = certificate.proof.rate, certificate.proof.upper_bound
    limit = "" if bound is None else f"upper bound {up(bound)}"
    if rate is not None and certificate.refused:
        text = "none is proved: the independent check does not accept what was found"
        yield Fact(head="rate", standing="unproved", note=joined("; ", (text, limit)))
        return
    if rate is not None:
        which = f"{down(rate)}{every_text(certificate)}"
        brief = f"{which}, proved" if bound is None else f"{which}, {limit}: both proved, ratio {down(rate / bound)}"
        note = _rate_text(certificate, rate, "" if bound is None else f"upper bound {up(bound, 8)}, proved")
        yield Fact(head="rate", value=rate, side="down", note=f"{note}{every_text(certificate)}", brief=(brief,))
        return
    why = no_search(certificate)
    why = joined("", [" (", why, ")"]) if why else ""
    logs = explicit_logs(certificate)
    text = "there is one, but none was proved"
    if logs:
        power = int(min(logs)) - 1
        least = TOO_SMALL if power < TINY else f"above 1e{power}"
        text = f"{least}, in closed form; no larger one was proved"
    standing: Standing = "proved" if logs else "unproved"
    yield Fact(head="rate", standing=standing, note=joined("; ", [joined("", [text, why]), limit]))


def explicit_logs(certificate: Certificate) -> list[float]:
    """Return the logarithms of rates in closed form, of every component of several agents; none if one has none."""
    explicit = [
        explicit_rate(part.component) for part in certificate.family_proof.parts if part.component.nodes.size > 1
    ]
    logs = [one.log10_decay_rate for one in explicit if one is not None]
    return logs if len(logs) == len(explicit) else []


def no_search(certificate: Certificate) -> Sentence:
    """Tell why no rate was proved: too many agents for a search, or too little time; nothing where it is not known."""
    from ptcc_certify.lyapunov.common_form_search import CLOSED_ROWS, TOO_MANY_ROWS

    without = [
        part.component for part in certificate.family_proof.parts if part.component.nodes.size > 1 and not part.rate
    ]
    largest = max(without, key=lambda component: component.nodes.size, default=None)
    late = any("cut off" in note for note in certificate.observed.notes)
    if largest is not None and largest.behaviour != STABILITY:
        most = CLOSED_ROWS if largest.behaviour == BIPARTITE_CONSENSUS else EXACT_NODES
        if largest.nodes.size > most:
            return f"{largest.nodes.size:,} agents are above the {most:,} of the searches"
    if large := next((note for note in certificate.observed.notes if TOO_MANY_ROWS in note), ""):
        return large
    if largest is not None and largest.nodes.size > EXACT_NODES and not late:
        return f"closed forms of {largest.nodes.size:,} agents prove none"
    return ("the searches took too long; raise ", Change("time_limit")) if late else ""


def function_facts(certificate: Certificate) -> Facts:
    """Tell the rate of every Lyapunov function, of every mode, and what proves the upper bound."""
    proof = certificate.family_proof
    for part in proof.parts:
        names = [labelled(mode_name(proof.family, k)) for k in range(len(proof.family.modes))]
        for V in part.functions:
            own = getattr(V, "rates", ()) if len(names) > 1 else ()  # functions of rows have one rate
            rates = ", ".join(f"{name} {down(rate)}" for name, rate in zip(names, own, strict=False))
            alone = f"; of each mode: {rates}" if own else ""
            text = f"{V.kind}: decay rate {down(V.rate) if V.rate > 0 else 0}{alone}"
            yield Fact(head="function", value=V.rate, side="down", note=text, detail=True)
        if part.upper_bound is not None:
            modes = dict.fromkeys(names[member.mode] for member in part.upper_bound.members)
            what = BOUND_KINDS[part.upper_bound.kind]
            what += f": {', '.join(modes)}" if len(names) > 1 else ""
            text = f"decay rate at most {up(part.upper_bound.value, 8)}, proved by {what}"
            yield Fact(head="bound", value=part.upper_bound.value, side="up", note=text, detail=True)


def family_error_facts(certificate: Certificate) -> Facts:
    """Tell how near the agents are to their final states by when, for every signal and those that were asked for."""
    from ptcc_certify.certificate.constrained_switching.bounds import (  # slow to load
        deviation_of_signal,
        nearer_for_signal,
    )

    if certificate.initial_state is None or certificate.refused:
        return
    every = certificate.family_proof.common and certificate.proof.rate is not None
    if every:
        yield from _family_error(certificate, certificate.proof.deviation_bound, every_text(certificate))
    if nearer_for_signal(certificate.family_proof):
        bound = partial(deviation_of_signal, certificate.family_proof)
        again = certificate.proof.rate is not None
        usual = (
            list(_family_error(certificate, certificate.proof.deviation_bound, " (these signals)", again))
            if again
            else []
        )
        own = _family_error(certificate, bound, " (these signals)", again)
        yield from (fact for fact in own if fact not in usual)


def _family_error(
    certificate: Certificate, bound: Callable[[list[float]], np.ndarray], of: str, again: bool = False
) -> Facts:
    """Tell how near at 0.99 T, and at every instant; ``again`` after the same of other signals."""
    left, when = told_instants(certificate.protocol, certificate.direct)[SHORT]
    when += "" if certificate.direct else ", numerical"
    worst = float(bound([left]).max())
    whose = "" if again else " of its final state"
    standing: Standing = "proved" if certificate.direct else "unproved"
    text = f"at {when}: every agent within {up(worst, 2) if worst else 0}{whose}{of}"
    yield Fact(head="error", value=worst, side="up", standing=standing, note=text)
    yield _deviation_fact(certificate, bound, of)
