"""The verdict of a family's certificate in one line: what became of what was asked, and the exit code that agrees.

*Useful* is a bound that leaves at most 1 % at 0.99 T: of the largest ``|x_k(0)|``, for every agent, under the signals
that were asked for; without an initial state, of the norm that decays under every signal.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np

from lmi.exact.decimal_rounding import down, near, up
from ptcc_certify.certificate.answer import rejection_text, standing
from ptcc_certify.certificate.family_content import FamilyContent
from ptcc_certify.certificate.restricted_bounds import deviation_of_signal
from ptcc_certify.certificate.restricted_claims import LastModeClaim
from ptcc_certify.certificate.restricted_reasons import reasons_for_none
from ptcc_certify.certificate.verdict import CERTIFIED, LAST, MET, OPEN, REFUTED, UNDECIDED, Answer, Assessment
from ptcc_certify.checker import CheckReport
from ptcc_certify.graphs.family import Mode
from ptcc_certify.protocols.restricted_signals import ClockShares, JointWindows
from ptcc_certify.theorems.counterexample_text import counterexample_text, mode_name
from ptcc_certify.theorems.family_behaviour import DEPENDS, FamilyComponent
from ptcc_certify.theorems.family_claims import component_holds, component_refutation
from ptcc_certify.theorems.last_mode import last_mode_shows

#: Up to which multiple of ``rho2`` one is looked for that makes the bound useful.
_LARGEST = 2e4
#: How often its interval is halved, to within a digit that is told.
_HALVINGS = 7
#: What to try where edges do not tell whether rest states agree.
NEXT_STEP = (
    "whether rest states agree is not decided: it takes exact rows of more than 120 agents; round the weights to few "
    "digits, or take out what is uncertain between agents that hear several leader groups"
)
#: What is told where it is decided without these rows.
DECIDED_ALONE = (
    "the behaviour is decided on edges, and not certified: a certificate holds exact rows of agents that hear several "
    "leader groups, of 120 at most; ptcc classify shows the decision"
)


def assess_family(certificate: FamilyContent, report: CheckReport | None) -> Assessment:
    """Return the graded verdict of a family's certificate, and of what was expected of it.

    Examples
    --------
    >>> unsure = Family.from_intervals([("a", "b", "0.8", "1.2"), ("b", "a", "-1.2", "-0.8")])
    >>> asked = Expectations("bipartite consensus", min_rate=100)
    >>> cert = certify(unsure, NominalProtocol(T=1, rho1=1, rho2=1, kappa=3), asks=Asks(expectations=asked))
    >>> cert.assessment.asked, int(cert.assessment.exit_code)
    ('refuted', 3)
    """
    asked, components = certificate.expectations, [part.component for part in certificate.parts]
    answers = [] if asked.behaviour is None else [_judge_behaviour(certificate, components, asked.behaviour)]
    answers += [] if asked.min_rate is None else [_judge_rate(certificate, asked.min_rate)]
    answers += [] if asked.max_input is None else [_judge_input(certificate, asked.max_input)]
    reasons = (reason for reason, leaves_open in reasons_for_none(certificate).values() if leaves_open)
    if asked.behaviour is None and asked.min_rate is None and (reason := next(reasons, "")):
        answers.append(Answer(OPEN, "what these signals do", reason))
    if report is None or not report.accepted:
        why = _without_report(components) if report is None else rejection_text(report)
        return Assessment(UNDECIDED, False, None, why, "", standing(answers, report))
    useful, caveat, rho2 = _usefulness(certificate), "", Fraction(0)
    effects: list[str] = []
    if useful is False:
        gain = _useful_rho2(certificate) if certificate.direct else _useful_rho2_while_driven(certificate)
        rho2, effects = (rho2, effects) if gain is None else (gain, ["leaves 1 %"])
    if certificate.common and not certificate.bounded:
        grows = certificate.unbounded
        caveat = "the input is not bounded for some signal" if grows else "the input is not proved bounded"
        caveat += " for every signal" * (not grows and certificate.signal != "any")
        rate, kappa = certificate.rate, certificate.protocol.gain.pole / certificate.protocol.parameters["rho2"]
        if rate is not None:
            rho2 = max(rho2, Fraction(up(2 / (rate * kappa), 3)))
            effects.append("bounds the input" if effects else "bounds it")
    advice = f"--rho2 {near(rho2)} {' and '.join(effects)}" if effects else ""
    if certificate.sliding_bounded is False and certificate.sliding_peaks is None:
        caveat = caveat or "the input is not proved bounded"
        advice = " ".join(
            [advice.removesuffix(" bounds it"), f"--mu3 {up(1 / certificate.protocol.kappa, 3)} bounds it"]
        ).strip()
    remark = "" if useful is not False else "little is proved by 0.99 T"
    return Assessment(CERTIFIED, False, useful, remark, advice, tuple(answers), caveat)


def _without_report(components: Sequence[FamilyComponent]) -> str:
    return NEXT_STEP if any(component.behaviour is None for component in components) else DECIDED_ALONE


def judge_family_behaviour(components: Sequence[FamilyComponent], expected: str) -> Answer:
    """Tell whether every component shows a behaviour under every signal, with a counterexample where one does not.

    Examples
    --------
    >>> from ptcc_certify.theorems.family_behaviour import decide
    >>> print(judge_family_behaviour(decide(Family.from_intervals([("a", "b", 0, 1)])), "bipartite consensus"))
    bipartite consensus (held constant, the leader groups of a and b do not hear each other, and do not meet)
    """
    answers = [component_holds(component, expected) for component in components]
    if False in answers:
        component = components[answers.index(False)]
        why = component_refutation(component, expected)
        other = f"it is {component.behaviour}"
        return Answer(REFUTED, expected, other if why is None else counterexample_text(component, why))
    return Answer(OPEN, expected, "not decided") if None in answers else Answer(MET, expected)


def _judge_behaviour(certificate: FamilyContent, components: Sequence[FamilyComponent], expected: str) -> Answer:
    """Tell whether a behaviour holds for every signal, or for those that were asked for, by the last mode."""
    last = certificate.ends_of_signal
    others = [component for k, component in enumerate(components) if k not in last]
    narrow = isinstance(certificate.signal, ClockShares | JointWindows)  # no constant member is one of these signals
    judged = [component for component in others if component.behaviour != DEPENDS or not narrow]
    met = Answer(MET, expected, "these signals" if last else "every signal" * (certificate.signal != "any"))
    answer = judge_family_behaviour(judged, expected) if judged else met
    answer = met if answer.status == MET else answer
    if len(judged) < len(others) and answer.status == MET:
        answer = Answer(OPEN, expected, "not decided of these signals")
    for k, claim in last.items():
        family = components[k].family
        edges = [mode.sign for mode in family.modes] if isinstance(claim, LastModeClaim) else [family.union[2]]
        pairs = zip(claim.behaviours, edges, strict=True)
        shows = [last_mode_shows(one, expected, bool((signs > 0).all())) for one, signs in pairs]
        if False in shows and answer.status != REFUTED:
            number = shows.index(False)
            whose = f"{mode_name(certificate.family, number)} by itself: " * isinstance(claim, LastModeClaim)
            return Answer(REFUTED, expected, f"{whose or 'it is '}{claim.behaviours[number]}")
        if None in shows and answer.status == MET:
            answer = Answer(OPEN, expected, "not decided of these signals")
    return answer


def _judge_rate(certificate: FamilyContent, least: Fraction) -> Answer:
    """Tell whether a rate of at least so much is proved for every signal, or excluded by the upper bound."""
    what, rate, bound = f"rate >= {near(least, 12)}", certificate.rate_of_signal, certificate.upper_bound
    if certificate.signal != "any":
        # No constant member is one of these signals.
        narrow = isinstance(certificate.signal, ClockShares | JointWindows)
        bound = None if narrow else certificate.member_bound
    alone = all(part.component.nodes.size == 1 for part in certificate.parts)
    if alone or (rate is not None and rate >= least):
        every = alone or (certificate.rate is not None and certificate.rate >= least)
        return Answer(MET, what, "" if certificate.signal == "any" else "every signal" if every else "these signals")
    if certificate.signal == "any" and any(part.component.behaviour == DEPENDS for part in certificate.parts):
        return Answer(REFUTED, what, "no rate holds for every signal")
    if not certificate.common:
        differ = any(part.component.behaviour == DEPENDS for part in certificate.parts)
        reason = "whether rest states agree is not decided"
        return Answer(OPEN, what, "no rate is proved of modes that end differently" if differ else reason)
    if bound is not None and least > bound:
        return Answer(REFUTED, what, f"upper bound {up(bound, 8)}, proved")
    reason = "none is proved" if rate is None else f"proved: {down(rate)}"
    return Answer(OPEN, what, reason if bound is None else f"{reason}, at most {up(bound, 8)} can be")


def _judge_input(certificate: FamilyContent, most: Fraction) -> Answer:
    """Tell whether every input is proved to stay within so much for every signal."""
    what, peaks = f"|u_k| <= {near(most, 12)}", certificate.input_peaks
    if peaks is not None and max(peaks) <= most:
        return Answer(MET, what, "every signal" * (certificate.signal != "any"))
    known = certificate.initial_state is not None and certificate.protocol.reaching is None
    if known and (first := first_input(certificate)) > most:
        return Answer(REFUTED, what, f"it is up to {down(first)} at the start, proved")
    return Answer(OPEN, what, "no bound is proved" if peaks is None else f"proved: {up(max(peaks))}")


def first_input(certificate: FamilyContent) -> Fraction:
    """Return the largest ``|u_k(0)|`` over all signals and agents: that of some member."""
    assert certificate.initial_state is not None
    rows = (row for mode in certificate.family.modes for row in _first_rows(mode, certificate.initial_state).values())
    return certificate.protocol.gain.first * max((max(abs(low), high) for low, high in rows), default=Fraction(0))


def _first_rows(mode: Mode, x: Sequence[Fraction]) -> Mapping[int, tuple[Fraction, Fraction]]:
    """Return the least and the largest ``(L x)_k`` over the members of a mode; of two signs on a pair one is on."""
    pairs: dict[tuple[int, int], tuple[Fraction, Fraction]] = {}
    for edge, (source, target) in enumerate(zip(mode.source.tolist(), mode.target.tolist(), strict=True)):
        step = x[target] - int(mode.sign[edge]) * x[source]
        low, high = sorted((mode.lower.fraction(edge) * step, mode.upper.fraction(edge) * step))
        if (source, target) in pairs:  # both may fail: 0 lies in each
            other = pairs[source, target]
            low, high = min(low, other[0]), max(high, other[1])
        pairs[source, target] = low, high
    sums: dict[int, tuple[Fraction, Fraction]] = {}
    for (_, target), (low, high) in pairs.items():
        before = sums.get(target, (Fraction(0), Fraction(0)))
        sums[target] = before[0] + low, before[1] + high
    return sums


def _useful_rho2(certificate: FamilyContent) -> Fraction | None:
    """Return a short ``rho2`` with which the bounds at hand leave 1 % at 0.99 T; None if there is none within reach.

    ``rho2`` enters the bounds by the clock alone, ``s = rho1 t + rho2 kappa ln(T/(T-t))``.
    """
    gain, rho2 = certificate.protocol.gain, certificate.protocol.parameters["rho2"]
    kappa, last = float(gain.pole / rho2), -math.log(float(LAST))
    candidates = float(rho2) * np.geomspace(1, _LARGEST, max(15, min(500, 10**6 // certificate.family.n_nodes)))
    clock = float(gain.clock_at_remaining(float(LAST))) + (candidates - float(rho2)) * kappa * last
    if certificate.initial_state is not None:
        with np.errstate(over="ignore", invalid="ignore"):  # functions with negative rates
            left = certificate.deviation_at(clock).max(axis=0)
        enough = left <= float(max(map(abs, certificate.initial_state)) * LAST)
    else:
        enough = np.ones(clock.size, bool)
        for part in (part for part in certificate.parts if part.component.nodes.size > 1):
            decays = [math.sqrt(V.overshoot) * np.exp(-float(V.rate) / 2 * clock) for V in part.functions if V.rate > 0]
            enough &= np.min(decays or [np.full(clock.size, np.inf)], axis=0) <= float(LAST)
    return Fraction(up(float(candidates[enough.argmax()]), 3)) if enough.any() else None


def _useful_rho2_while_driven(certificate: FamilyContent) -> Fraction | None:
    """Return the same at ``T_r + 0.99 T_s`` where sliding variables move; None without an initial state.

    They drive the agents with the gain, too: the bound for every signal is formed anew with every ``rho2``.
    """
    protocol = certificate.protocol
    if certificate.initial_state is None or certificate.rate is None:
        return None

    def suffices(rho2: float) -> bool:
        other = replace(certificate, protocol=protocol.replace(rho2=Fraction(up(rho2, 3))))
        left, enough = _target(other)
        return bool(other.deviation_bound([left]).max() <= enough)

    low = float(protocol.parameters["rho2"])
    high, largest = 2 * low, _LARGEST * low
    while not suffices(high):
        low, high = high, 2 * high
        if high > largest:
            return None
    for _ in range(_HALVINGS):
        middle = math.sqrt(low * high)
        low, high = (low, middle) if suffices(middle) else (middle, high)
    return Fraction(up(high, 3))


def _target(certificate: FamilyContent) -> tuple[float, float]:
    """Return ``1 - t/T`` where the bound is judged, and what of the largest state it may leave there."""
    sizes = map(abs, (*(certificate.initial_state or ()), *(certificate.sigma0 or ())))
    return float(LAST) * certificate.settling_share, float(max(sizes) * LAST)


def _usefulness(certificate: FamilyContent) -> bool | None:
    """Tell whether the bound leaves at most 1 % at 0.99 T; None where no state is approached by every signal."""
    if not certificate.common:
        return None
    if certificate.initial_state is not None:
        instant, enough = _target(certificate)
        return enough == 0 or bool(deviation_of_signal(certificate, [instant]).max() <= enough)
    clock = float(certificate.protocol.gain.clock_at_remaining(float(LAST)))
    for part in certificate.parts:
        left = [math.sqrt(V.overshoot) * math.exp(-float(V.rate) / 2 * clock) for V in part.functions]
        if part.component.nodes.size > 1 and min(left, default=math.inf) > float(LAST):
            return False
    return True
