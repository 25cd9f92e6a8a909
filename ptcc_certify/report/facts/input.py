"""Facts of the input: bounded or not, how large, under limits and disturbances."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from fractions import Fraction
from itertools import chain
from typing import TYPE_CHECKING, Any

from lmi.exact.decimal_rounding import down, near, up
from ptcc_certify.certificate.fact import Fact, Facts, Standing
from ptcc_certify.errors import joined, labelled
from ptcc_certify.report.facts.constrained_switching import every_text
from ptcc_certify.report.text_layout import TEXT, agent_text, shorten_list, value_list

if TYPE_CHECKING:
    from ptcc_certify.bounds.input.effort import Effort
    from ptcc_certify.certificate.certificate import Certificate
    from ptcc_certify.checker.input_formulas import InitialSet, Limits


def without(certificate: Certificate) -> list[str]:
    """Tell that something is without limits, noise and disturbances, of what was asked; nothing if none was."""
    asked = {"limits": bool(certificate.limits), "noise": certificate.noise is not None}
    asked["disturbances"] = certificate.delta is not None and certificate.protocol.reaching is None
    lacking = [name for name, holds in asked.items() if holds]
    return [f"without {' or '.join(filter(None, (', '.join(lacking[:-1]), *lacking[-1:])))}"] if lacking else []


def said_without(certificate: Certificate, facts: Iterable[Fact]) -> Facts:
    """Say of facts that are without limits, noise and disturbances that they are, where these were asked for."""
    first = "".join(f"{text}: " for text in without(certificate))
    for fact in facts:
        brief = tuple(joined("", (first, text)) for text in fact.brief)
        yield replace(fact, note=joined("", (first, fact.note)), brief=brief, asked="") if first else fact


def input_facts(certificate: Certificate, details: bool) -> Facts:
    """Tell whether the input stays finite, how large it gets and of which agent, by what, and under which limits."""
    effort = certificate.graph_proof.effort
    if effort is None or certificate.proof.constant:
        return
    told = [_input_fact(certificate, effort)]
    yield from told if effort.residual else said_without(certificate, told)
    if not details:
        return
    yield from said_without(certificate, chain(threshold_facts(certificate), _size_facts(certificate, effort)))
    yield from _limited_facts(effort)


def _input_fact(certificate: Certificate, effort: Effort) -> Fact:
    entry = effort.residual[0] if effort.residual else None
    if entry is not None:
        text, largest = "bounded under these limits", entry.largest
        if entry.noise is not None:
            text, largest = f"{text}, |n_k| <= {down(entry.noise.bound, 12)}", entry.noise.largest
        nothing = "; under a sample period no number is proved"
    else:
        states = {True: "bounded", False: "NOT BOUNDED from some initial states", None: "not proved bounded"}
        text, largest = states[effort.bounded], None if effort.peak is None else effort.peak.largest
        nothing = "; no number is proved" if effort.bounded and certificate.initial_state is not None else ""
        if largest is None and effort.bounded and effort.sliding is not None and not effort.sliding.bounded:
            text, nothing = "the nominal part is bounded", ", of the sliding part nothing is proved"
    loud = effort.bounded is False and entry is None
    if largest is None:
        standing: Standing = "unproved" if effort.bounded is None and entry is None else "proved"
        return Fact(head="input", standing=standing, note=text + nothing, loud=loud)
    whom = "" if effort.initial_set is None else f" for {initial_states_text(effort.initial_set)}"
    peaks = effort.peak.agents if entry is None and effort.peak is not None else ()
    return peak_fact(f"{text}; |u_k| <= {up(largest, 4)}{whom}", largest, certificate.labels, peaks, loud=loud)


def peak_fact(
    text: str, largest: Fraction | float, labels: Sequence[str], peaks: Sequence[Any], of: str = "", loud: bool = False
) -> Fact:
    """Tell a bound of every input, and of which agent it is, where ``peaks`` are known; ``of`` names signals."""
    agent = f", the largest of agent {agent_text(labels[peaks.index(largest)], 22)}" if peaks else ""
    note = f"{text}{agent}{of}"
    return Fact(head="input", value=largest, side="up", note=note, brief=(note, f"{text}{of}"), loud=loud)


def threshold_facts(certificate: Certificate) -> Facts:
    """Tell what decides whether the input is bounded."""
    effort = certificate.graph_proof.effort
    if effort is None or certificate.proof.constant:
        return
    lower, upper = effort.threshold
    whose = "the nominal part is " if effort.sliding is not None else ""
    product = f"rho2 kappa min Re lambda >= {down(lower, 5)}" if lower is not None else "nothing else is proved"
    product += f" and <= {up(upper, 5)}" if lower is not None and upper is not None else ""
    if effort.bounded:
        how = {"rate": f"{product}, 1 is enough", "spectrum": "by the exact spectrum"}[effort.by or "rate"]
        text = f"{whose}bounded from every initial state: {how}"
    elif effort.bounded is False:
        below = f" <= {up(upper, 5)}" if upper is not None and effort.by == "upper_bound" else " = 1 or less"
        enough = "" if certificate.proof.rate is None else f" to {up(2 / certificate.proof.rate, 5)} or more"
        text = f"rho2 kappa min Re lambda{below}, 1 is needed: raise rho2 kappa{enough}"
        text = f"NOT BOUNDED: {text}" if certificate.limits else text
    else:
        text = f"{product}, 1 is needed"
    told = None if effort.bounded is False or product not in text else lower
    yield Fact(head="threshold", value=told, side="down", note=text, detail=True)


def _size_facts(certificate: Certificate, effort: Effort) -> Facts:
    """Tell norms, energy and path length, and the largest input that was found."""
    sizes = [] if effort.peak is None else [f"||u|| <= {up(effort.peak.norm, 4)}"]
    if effort.peak is not None and effort.residual:
        sizes.insert(0, f"|u_k| <= {up(effort.peak.largest, 4)}")
    sizes += [f"int ||u||^2 dt <= {up(effort.energy.value, 4)}"] if effort.energy is not None else []
    sizes += [f"int ||u|| dt <= {up(effort.path_length.value, 4)}"] if effort.path_length is not None else []
    if sizes:
        whom = "" if effort.initial_set is None else f" for {initial_states_text(effort.initial_set)}"
        part = " (integrals of the nominal part)" if effort.sliding is not None else ""
        yield Fact(head="effort", note=", ".join(sizes) + whom + part, detail=True)
    other = bool(certificate.limits) or not certificate.direct  # the initial state that is found is of neither
    worst = None if effort.peak is None or other else certificate.graph_proof.worst_initial_state
    if worst is not None and math.isfinite(worst.size):
        where = f"|u_{labelled(certificate.labels[worst.agent])}| = {worst.size:.4g} at t = {worst.t:.4g}"
        text = f"largest found (numerical) {where} from {value_list(certificate.labels, worst.x0.tolist())}"
        yield Fact(head="effort", value=worst.size, standing="observed", note=text, detail=True)
    if effort.sliding is not None and not effort.sliding.bounded:
        text = "mu3 kappa < 1: the sliding part of the input is not bounded for every sigma(0)"
        yield Fact(head="effort", note=text, detail=True)


def disturbed_facts(certificate: Certificate) -> Facts:
    """Tell what disturbances add to the input under the nominal protocol, and without limits to the final state."""
    effort = certificate.graph_proof.effort
    if effort is not None and (d := effort.disturbed) is not None:
        held = any(entry.sample_period is not None for entry in certificate.limits)
        text = f"|d_k| <= {down(d.delta, 12)} adds at most {up(max(d.inputs), 4)} to |u_k|"
        if d.drift is None or certificate.limits:
            text += f"{' without a sample period' if held else ''}; of x(T) nothing is proved"
        else:
            text += f" and moves x_k(T) by at most {up(max(d.drift), 4)}" if any(d.drift) else " and moves no x_k(T)"
        yield Fact(head="disturbed", note=text)


def _limited_facts(effort: Effort) -> Facts:
    """Tell what is proved under limits of the gain, and under noise with them."""
    for entry in effort.residual:
        agents = "" if entry.agents is None else f", every agent within {up(max(entry.agents), 3)} of its final state"
        largest = "" if entry.largest is None else f", |u_k| <= {up(entry.largest, 4)}"
        text = f"{limits_text(entry.limits)}: ||E|| <= {up(entry.norm, 3)} at T{agents}{largest}"
        yield Fact(head="limited", value=entry.norm, side="up", note=text, detail=True)
        if (noise := entry.noise) is not None:
            text = f"noise |n_k| <= {near(noise.bound)} leaves ||E|| <= {up(noise.norm, 3)} at T"
            text += f", |u_k| <= {up(noise.largest, 4)}"
            yield Fact(head="limited", value=noise.norm, side="up", note=text, detail=True)


def limits_text(limits: Limits) -> str:
    """Name the limits of the gain."""
    names = (("gain <= ", limits.gain_cap), ("switched off at T - ", limits.stop_before))
    return ", ".join(f"{what}{near(x)}" for what, x in (*names, ("zero-order hold ", limits.sample_period)) if x)


def initial_states_text(initial_set: InitialSet) -> str:
    """Name a set of initial states."""
    R = max(initial_set.radius, default=0)
    cube = R and not initial_set.axes and not any(initial_set.center) and min(initial_set.radius) == R
    return f"all |x_k(0)| <= {near(Fraction(R))}" if cube else "the initial states asked about"


def family_input_facts(certificate: Certificate) -> Facts:
    """Tell whether the input stays finite for every signal, and how large it gets."""
    proof = certificate.family_proof
    every, peaks = every_text(certificate), proof.input_peaks
    if any(part.component.behaviour is None for part in proof.parts):
        return
    if not proof.bounded or certificate.refused:
        loud, text = False, f"not proved bounded{every}"
        if not proof.common:
            loud, text = True, f"no bound for all signals and x(0): a switch near T may meet any gain{every}"
        elif proof.unbounded:
            loud, text = True, "NOT BOUNDED for some signal from some initial states"
        yield Fact(head="input", standing="unproved", note=text, loud=loud)
    elif peaks is None and proof.sliding_bounded is False:
        text = "the nominal part is bounded, of the sliding part nothing is proved"
        if proof.sliding_peaks is not None:
            text = "bounded while sigma(0) = 0"
        yield Fact(head="input", note=text)
    elif not peaks:
        yield Fact(head="input", note="bounded for every signal and every initial state")
    else:
        largest = max(peaks)
        yield peak_fact(f"bounded; |u_k| <= {up(largest, 4)}", largest, certificate.labels, peaks, every)
        each = [f"{agent_text(label)} {up(peak, 4)}" for label, peak in zip(certificate.labels, peaks, strict=True)]
        yield Fact(head="input", note=f"|u_k| <= {shorten_list(each, 4 * TEXT)}", detail=True)
