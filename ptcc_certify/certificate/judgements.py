"""What became of each expectation, of graphs and of families: behaviour, rate, input, limits, late messages."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from itertools import islice
from typing import Any

from lmi.exact.decimal_rounding import down, near, up
from ptcc_certify.bounds.delay.certain_misses import Missed
from ptcc_certify.bounds.delay.late_messages import LateBounds
from ptcc_certify.certificate.assessment import MET, OPEN, REFUTED, Answer
from ptcc_certify.certificate.constrained_switching.claims import LastModeClaim
from ptcc_certify.certificate.constrained_switching.reasons import reasons_for_none
from ptcc_certify.certificate.family_proof import FamilyProof
from ptcc_certify.certificate.graph_proof import GraphProof
from ptcc_certify.errors import Change, Sentence, joined, labelled
from ptcc_certify.graphs.family import Mode
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.model.base import Protocol
from ptcc_certify.model.constrained_switching import ClockShares, JointWindows
from ptcc_certify.theorems.family_behaviour import (
    DEPENDS,
    FamilyComponent,
    counterexample_text,
    last_mode_shows,
    mode_name,
)


def judge(proof: GraphProof | FamilyProof) -> Iterator[Answer]:
    """Tell what became of what was asked."""
    asked = proof.expectations
    judges: tuple[Callable[[Any, Any], Answer], ...] = (_judge_behaviour, judge_rate, judge_input)
    if isinstance(proof, FamilyProof):
        judges = (_judge_behaviour_of_signal, _judge_rate_of_signal, _judge_input_of_signal)
    judge_behaviour_of, judge_rate_of, judge_input_of = judges
    if asked.behaviour is not None:
        yield at_deadline(proof, judge_behaviour_of(proof, asked.behaviour))
    if asked.min_rate is not None:
        yield judge_rate_of(proof, asked.min_rate)
    if asked.max_input is not None:
        yield judge_input_of(proof, asked.max_input)
    if not isinstance(proof, FamilyProof):
        yield from judge_limits(proof)
    elif asked.behaviour is None and asked.min_rate is None:
        reasons = (reason for reason, leaves_open in reasons_for_none(proof).values() if leaves_open)
        yield from (Answer(OPEN, "what these signals do", reason) for reason in islice(reasons, 1))
    yield from judge_messages(proof)


def _proved_or_bounded(what: str, rate: Fraction | None, bound: Fraction | None, least: Fraction) -> Answer:
    """Tell that a rate that is not proved is above the proved upper bound, or what is proved."""
    if bound is not None and least > bound:
        return Answer(REFUTED, what, f"upper bound {up(bound, 8)}, proved")
    reason = "none is proved" if rate is None else f"proved: {down(rate)}"
    return Answer(OPEN, what, reason if bound is None else f"{reason}, at most {up(bound, 8)} can be")


# ---------------------------------------------------------------------- one graph


def judge_behaviour(structure: Structure, expected: str) -> Answer:
    """Tell whether a behaviour follows from the theorem that applies, in every component."""
    if structure.holds(expected):
        return Answer(MET, expected)
    claims = [component.claim for component in structure.components]
    return Answer(REFUTED, expected, f"it is {claims[0].sharpest}" if len(claims) == 1 else "not in every component")


def _judge_behaviour(proof: GraphProof, expected: str) -> Answer:
    """Tell the same of what the agents are, which may be of order n, and have places or a capped gain."""
    answer, part = judge_behaviour(proof.structure, expected), proof.agents
    if part is None:
        answer = replace(answer, what=expected if proof.offsets is None else f"{expected} of x - offsets")
        disturbed = proof.delta is not None and bool(proof.limits) and proof.protocol.reaching is None
        asked = {"limits of the gain": bool(proof.limits) and not proof.at_rest, "noise": proof.noise is not None}
        left = [what for what, there in (asked | {"disturbances": disturbed}).items() if there]
        if proof.constant or proof.asked_messages is not None or not left:
            return answer
        leave = "leaves" if left == ["noise"] else "leave"
        return replace(answer, status=OPEN, why=f"{' and '.join(left)} {leave} something at T")
    what = f"{expected} of x - offsets" if part.formation else expected
    if part.settles:
        return replace(answer, what=what)
    return Answer(OPEN, what, "the capped gain leaves something at T" if part.functions else "no decay is proved")


def judge_rate(proof: GraphProof, least: Fraction) -> Answer:
    """Tell whether a rate of at least so much is proved, or excluded by the proved upper bound."""
    what = f"rate >= {near(least, 12)}"
    rate, bound = proof.rate, proof.upper_bound
    if (answer := judge_rate_beside(proof, least, what)) is not None:
        return answer
    if proof.agents is not None:
        rate, bound = proof.agents.rate if proof.agents.functions else None, None
    if proof.constant or (rate is not None and rate >= least):
        return Answer(MET, what)
    if rate is None and proof.agents is not None and proof.agents.functions:
        return Answer(OPEN, what, "deviations of the cascade fall by two laws, not by one rate")
    return _proved_or_bounded(what, rate, bound, least)


def judge_input(proof: GraphProof, most: Fraction) -> Answer:
    """Tell whether every input is proved to stay within so much, under all that was asked for besides."""
    effort, what = proof.effort, f"|u_k| <= {near(most, 12)}"
    if proof.agents is not None:
        return proof.agents.judge_input(most)
    if proof.constant:
        return Answer(MET, what)
    if proof.late is not None:
        return judge_input_beside(proof, most, what, _first_input(proof))
    least, bound = input_range(proof)
    if bound is not None and bound <= most:
        return Answer(MET, what)
    if least > most:
        first = effort is not None and effort.first is not None and effort.first >= least
        size = f"up to {down(least)}" if least < math.inf else "without limit"
        return Answer(REFUTED, what, f"it is {size} {'at the start' if first else 'by the noise alone'}, proved")
    solid = (
        effort is not None and effort.initial_set is not None and all(r > 0 for r in effort.initial_set.radius or (0,))
    )
    if effort is not None and effort.bounded is False and solid and not proof.limits:
        return Answer(REFUTED, what, "from some of these initial states it grows without limit, proved")
    return Answer(OPEN, what, "no bound is proved" if bound is None else f"proved: {up(bound)}")


def input_range(proof: GraphProof) -> tuple[Fraction | float, Fraction | None]:
    """Return proved bounds of the largest ``|u_k|`` over all agents, initial states, noise and disturbances.

    Under the limits of the gain, with noise within ``noise`` and disturbances within ``delta``. The lower bound is
    attained or approached: at first, or where noise meets the largest gain, without a limit an infinite one.
    The upper one is None where nothing is proved. What disturbances add under the protocol itself they add at most
    under a cap and a stop, too: ``gain int_0^t e^(-alpha (s(t) - s(r))) dr`` stays below what is proved without these.
    """
    effort, p, graph = proof.effort, proof.protocol, proof.structure.graph
    if effort is None:
        return Fraction(0), None
    tops = [entry.largest_gain(p.gain.exact) for entry in proof.limits]
    share = min([Fraction(1), *(top / p.gain.first for top in tops)])
    least: Fraction | float = (effort.first or Fraction(0)) * share
    if proof.noise is not None:
        rows = graph.exact_rows(range(graph.n_nodes))
        degree = max(row.get(v, Fraction(0)) for v, row in enumerate(rows))
        least = max(least, 2 * degree * proof.noise * min(tops)) if tops else math.inf
    if proof.limits:
        under = effort.residual if proof.noise is None else [e.noise for e in effort.residual]
        peaks = [None if one is None else one.largest for one in under]
        most = None if len(peaks) < len(proof.limits) or None in peaks else max(x for x in peaks if x is not None)
    else:
        most = None if effort.peak is None or proof.noise is not None else effort.peak.largest
    if most is not None and proof.delta is not None:
        most = None if effort.disturbed is None else most + max(effort.disturbed.inputs)
    return least, most


def _first_input(proof: GraphProof) -> Fraction:
    """Return what the largest ``|u_k(0)|`` is at least under the limits of the gain; 0 where nothing is known."""
    first = None if proof.effort is None else proof.effort.first
    return Fraction(0) if first is None else first * _first_share(proof)


def _first_share(proof: GraphProof | FamilyProof) -> Fraction:
    """Return what the limits of the gain leave of the first gain."""
    gain, late, limits = proof.protocol.gain, proof.late, proof.limits
    caps = [] if late is None or late.messages.gain_cap is None else [late.messages.gain_cap]
    tops = [*caps, *(entry.largest_gain(gain.exact) for entry in limits)]
    clipped = late is not None and late.case.exact.saturation is not None  # whose first input says nothing
    return Fraction(0) if clipped else min([Fraction(1), *(top / gain.first for top in tops)])


def judge_limits(proof: GraphProof) -> list[Answer]:
    """Tell which of the limits, noise and disturbances that were asked for are not certified."""
    effort, answers = proof.effort, []
    residual = () if effort is None else effort.residual
    mend: Sentence = "" if proof.method == "best" else ("; try ", Change("method", "best"))
    no_bound = joined("", ("no bound of its effect is proved", mend))
    if len(residual) < len(proof.limits) and not proof.constant:
        period = None if effort is None else effort.longest_period
        why = joined("", ("no bound of their effect is proved", mend))
        why = why if period is None else f"certified with a period of {down(period, 4)}"
        answers.append(Answer(OPEN, "limits", why))
    silent = not residual or len(residual) < len(proof.limits) or not all(entry.noise for entry in residual)
    if proof.noise is not None and silent and not proof.constant:
        why = ("without a limit it meets an infinite gain: add ", Change("gain_cap"), " or ", Change("stop_before"))
        if any(entry.sample_period is not None for entry in proof.limits):
            why = "with a sample period no bound is proved: ask for each alone"
        elif proof.limits:
            why = no_bound
        answers.append(Answer(OPEN, "noise", why))
    if proof.delta is not None and not proof.constant and (effort is None or effort.disturbed is None):
        bounded = effort is not None and effort.bounded
        answers.append(Answer(OPEN, "delta", no_bound if bounded else "the rate proves no bounded input"))
    return answers


# ---------------------------------------------------------------------- late messages, moving leaders


def at_deadline(proof: GraphProof | FamilyProof, answer: Answer) -> Answer:
    """Return what becomes at ``T``, where messages are late or leaders move, of a behaviour that follows elsewhere."""
    late = proof.late
    if late is not None and answer.status == MET and late.unreachable is not None:
        return Answer(REFUTED, f"{answer.what} at T", _unreachable(*late.unreachable))
    if late is not None and late.tracks and late.leaders is not None and late.largest and answer.status == MET:
        why = "nothing is proved of that" if math.isinf(late.largest) else "nothing settles under a cap"
        return Answer(OPEN, f"{answer.what} at T {late.leaders.while_told}", why)
    if proof.asked_messages is None or answer.status != MET or proof.constant:
        return answer
    what = f"{answer.what} at T with {proof.asked_messages.name}"
    if late is None:
        return Answer(OPEN, what, "nothing is proved of them")
    rest = isinstance(proof, GraphProof) and proof.at_rest and proof.asked_leaders is None
    if not late.largest or (rest and not late.messages.value_error and late.vehicles is None):
        return answer
    if late.missed is not None:
        return Answer(REFUTED, what, _misses(late, late.missed))
    if late.staged:
        return Answer(OPEN, what, "with deadlines of stages it holds, with one for all none is proved to hold it")
    if late.leaders is not None:
        moving = late.leaders.moving
        why = "leaders move, so that nobody is proved to settle" if moving else "disturbances leave something at T"
        return Answer(OPEN, what, why)
    if late.messages.gain_cap is not None:
        return Answer(OPEN, what, "nothing settles under a cap")
    return Answer(OPEN, what, "nobody is proved to settle at T")


def judge_rate_beside(proof: GraphProof | FamilyProof, least: Fraction, what: str) -> Answer | None:
    """Tell the same of a rate where messages are late, leaders move or the gain is held; None where nothing of it is.

    The rates of a proof, and the upper bound on them, are those of the loop without these.
    """
    late = proof.late
    if proof.constant or proof.agents is not None:
        return None
    if (leaders := proof.asked_leaders) is not None and not leaders.idle:
        return Answer(OPEN, what, f"no rate is proved {leaders.while_told}")
    if any(limits.sample_period is not None for limits in proof.limits):
        return Answer(OPEN, what, "no rate is proved of a gain that is held")
    if proof.asked_messages is None or (late is not None and late.direct):
        return None
    if late is None or late.lmi is None:
        vehicles = proof.vehicles is not None and proof.asked_messages.exact
        whose = "of vehicles that exchange virtual positions" if vehicles else f"with {proof.asked_messages.name}"
        return Answer(OPEN, what, f"no rate is proved {whose}")
    rate = 2 * late.lmi.b
    return Answer(MET if rate >= least else OPEN, what, f"with {late.messages.name} {down(rate)} is proved")


def judge_messages(proof: GraphProof | FamilyProof) -> list[Answer]:
    """Tell what becomes of what may be left at ``T`` with late messages, and whether anything is proved of these."""
    late, most = proof.late, proof.expectations.max_residual
    if late is None:
        answers = []
        if proof.asked_messages is not None:
            answers.append(Answer(OPEN, proof.asked_messages.name, "nothing is proved of what is left at T"))
        elif most is not None:
            answers.append(Answer(OPEN, "max_residual", "no messages are late"))
        return answers
    if not late.says_something and late.tracks:
        told = Answer(OPEN, late.messages.asked_of_leaders, late.missing)
        if late.unreachable is not None:
            told = Answer(REFUTED, late.messages.asked_of_leaders, _unreachable(*late.unreachable))
        return [told, *_nothing_left(most)]
    if not late.says_something:
        limited = 0 < (late.longest_delay or 0) < math.inf
        limit = f"; this certificate's limit is a delay of {late.longest_delay:.3g}" if limited else ""
        wish = "" if most is None else _longest(late, f"within {near(most, 12)} at T is ")
        mend = "; give an initial state" if proof.initial_state is None else ""
        told = Answer(OPEN, late.messages.asked, f"nothing is proved of what is left at T{mend}{limit}{wish}")
        return [told, *_nothing_left(None if wish else most)]
    return [] if most is None else [_judge_residual(proof, late, most)]


def _nothing_left(most: Fraction | None) -> list[Answer]:
    """Leave open what may be left at ``T``, if that was asked."""
    return [] if most is None else [Answer(OPEN, f"within {near(most, 12)} at T", "nothing is proved")]


def _judge_residual(proof: GraphProof | FamilyProof, late: LateBounds, most: Fraction) -> Answer:
    """Tell whether no more than ``most`` is left at ``T``, and up to which delay that is proved."""
    what = f"within {near(most, 12)} at T{' from within 1 of it' if late.relative else ''}"
    missed = late.missed
    if late.largest <= most:
        return Answer(MET, what, _longest(late).removeprefix("; "))
    if missed is not None and missed.bound > most:
        return Answer(REFUTED, what, f"{_misses(late, missed)}{_longest(late)}")
    return Answer(OPEN, what, f"this certificate's limit is {up(late.largest, 3)}{_longest(late)}")


def _longest(late: LateBounds, what: str = "") -> str:
    """Tell how old what is heard may be so that what was asked is certified; empty if that is not known."""
    if late.enough is None:
        return ""
    alike = ", all delays in proportion" if isinstance(late.messages.delay, Mapping) else ""
    return f"; {what}certified where nothing is older than {down(late.enough, 4)}{alike}"


def _unreachable(label: str, off: Fraction) -> str:
    """Tell who cannot come to where it ends."""
    return f"agent {labelled(label)} is off its final state at T by {down(off, 3)} at least, whatever it does"


def _misses(late: LateBounds, missed: Missed) -> str:
    """Tell who misses the deadline by how much."""
    return f"agent {late.labels[missed.agent]} is away by {down(missed.bound, 2)} at least, proved"


def judge_input_beside(proof: GraphProof | FamilyProof, most: Fraction, what: str, first: Fraction | float) -> Answer:
    """Tell whether every input stays within so much where messages are late, or leaders move.

    Parameters
    ----------
    certificate : Certificate
    most : Fraction
    what : str
        What is asked, in words.
    first : Fraction or float
        What the largest ``|u_k(0)|`` is at least where nobody hears of anything wrong.
    """
    late = proof.late
    assert late is not None, "something is asked of late messages or of moving leaders"
    if first > most and not late.messages.value_error and late.messages.vehicles is None:
        return Answer(REFUTED, what, f"it is up to {down(first)} at the start, proved")
    return _judge_late_input(proof, late, most, what)


def _judge_late_input(proof: GraphProof | FamilyProof, late: LateBounds, most: Fraction, what: str) -> Answer:
    """Tell whether every input stays within so much with late messages."""
    largest = largest_late_input(late, proof.protocol)
    if largest is None:
        tracked = late.leaders if late.tracks else None
        under = f"with {late.messages.name}" if tracked is None else tracked.while_told
        why: Sentence = f"no bound is proved {under}"
        if late.messages.vehicles is not None:
            why = "no bound is proved of virtual positions without a cap"
        elif late.heard_right and not late.tracks:
            why = "not all who listen have rho2 kappa times their weights >= 1"
        elif late.messages.gain_cap is None and not late.tracks:
            why = (f"{why}; a gain without a cap makes ever more of what is left at T: add ", Change("gain_cap"))
        return Answer(OPEN, what, why)
    if late.relative:
        what += f" from within 1 of the {'final states' if late.leaders is None else 'targets'}"
    return Answer(MET, what) if largest <= most else Answer(OPEN, what, f"proved: {up(largest)}")


def largest_late_input(late: LateBounds, protocol: Protocol) -> Fraction | None:
    """Return what bounds every ``|u_k|`` with late messages, the sliding term included; None where nothing does."""
    if late.inputs is None:
        return None
    return Fraction(float(late.inputs.max())) + (0 if protocol.reaching is None else protocol.reaching.mu1)


# ---------------------------------------------------------------------- families


def judge_family_behaviour(components: Sequence[FamilyComponent], expected: str) -> Answer:
    """Tell whether every component shows a behaviour under every signal, with a counterexample where one does not.

    Examples
    --------
    >>> from ptcc_certify.theorems.family_behaviour import decide
    >>> print(judge_family_behaviour(decide(Family.from_intervals([("a", "b", 0, 1)])), "bipartite consensus"))
    bipartite consensus (held constant, the leader groups of a and b do not hear each other, and do not meet)
    """
    answers = [component.holds(expected) for component in components]
    if False in answers:
        component = components[answers.index(False)]
        why = component.refutation(expected)
        other = f"it is {component.behaviour}"
        return Answer(REFUTED, expected, other if why is None else counterexample_text(component, why))
    return Answer(OPEN, expected, "not decided") if None in answers else Answer(MET, expected)


def _judge_behaviour_of_signal(proof: FamilyProof, expected: str) -> Answer:
    """Tell whether a behaviour holds for every signal, or for those that were asked for, by the last mode."""
    last, components = proof.ends_of_signal, [part.component for part in proof.parts]
    others = [component for k, component in enumerate(components) if k not in last]
    narrow = isinstance(proof.signal, ClockShares | JointWindows)  # no constant member is one of these signals
    judged = [component for component in others if component.behaviour != DEPENDS or not narrow]
    every = "" if proof.signal == "any" else "every signal"
    met = Answer(MET, expected, "these signals" if last else every)
    answer = judge_family_behaviour(judged, expected) if judged else met
    answer = met if answer.status == MET else answer
    if len(judged) < len(others) and answer.status == MET:
        answer = Answer(OPEN, expected, "not decided of these signals")
    for k, claim in last.items():
        family = components[k].family
        edges = [mode.sign for mode in family.modes] if isinstance(claim, LastModeClaim) else [family.union[2]]
        pairs = zip(claim.behaviours, edges, strict=True)
        shows = [last_mode_shows(behaviour, expected, bool((signs > 0).all())) for behaviour, signs in pairs]
        if False in shows and answer.status != REFUTED:
            number = shows.index(False)
            whose = "it is "
            if isinstance(claim, LastModeClaim):
                whose = f"{mode_name(proof.family, number)} by itself: "
            return Answer(REFUTED, expected, f"{whose}{claim.behaviours[number]}")
        if None in shows and answer.status == MET:
            answer = Answer(OPEN, expected, "not decided of these signals")
    return answer


def _judge_rate_of_signal(proof: FamilyProof, least: Fraction) -> Answer:
    """Tell whether a rate of at least so much is proved for every signal, or excluded by the upper bound."""
    what = f"rate >= {near(least, 12)}"
    rate, bound = proof.rate_of_signal, proof.upper_bound
    if (answer := judge_rate_beside(proof, least, what)) is not None:
        return answer
    if proof.signal != "any":
        # No constant member is one of these signals.
        narrow = isinstance(proof.signal, ClockShares | JointWindows)
        bound = None if narrow else proof.member_bound
    alone = all(part.component.nodes.size == 1 for part in proof.parts)
    if alone or (rate is not None and rate >= least):
        every = alone or (proof.rate is not None and proof.rate >= least)
        return Answer(MET, what, "" if proof.signal == "any" else "every signal" if every else "these signals")
    if proof.signal == "any" and any(part.component.behaviour == DEPENDS for part in proof.parts):
        return Answer(REFUTED, what, "no rate holds for every signal")
    if not proof.common:
        differ = any(part.component.behaviour == DEPENDS for part in proof.parts)
        reason = "whether rest states agree is not decided"
        return Answer(OPEN, what, "no rate is proved of modes that end differently" if differ else reason)
    return _proved_or_bounded(what, rate, bound, least)


def _judge_input_of_signal(proof: FamilyProof, most: Fraction) -> Answer:
    """Tell whether every input is proved to stay within so much for every signal."""
    what, peaks = f"|u_k| <= {near(most, 12)}", proof.input_peaks
    has_first_input = proof.initial_state is not None and proof.protocol.reaching is None
    if proof.late is not None or proof.leaders_move:
        first = first_input(proof) * _first_share(proof) if has_first_input else Fraction(0)
        return judge_input_beside(proof, most, what, first)
    if peaks is not None and max(peaks) <= most:
        return Answer(MET, what, "" if proof.signal == "any" else "every signal")
    if has_first_input and (first := first_input(proof)) > most:
        return Answer(REFUTED, what, f"it is up to {down(first)} at the start, proved")
    return Answer(OPEN, what, "no bound is proved" if peaks is None else f"proved: {up(max(peaks))}")


def first_input(proof: FamilyProof) -> Fraction:
    """Return the largest ``|u_k(0)|`` over all signals and agents: that of some member."""
    assert proof.initial_state is not None
    rows = (row for mode in proof.family.modes for row in _first_rows(mode, proof.initial_state).values())
    return proof.protocol.gain.first * max((max(abs(low), high) for low, high in rows), default=Fraction(0))


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
