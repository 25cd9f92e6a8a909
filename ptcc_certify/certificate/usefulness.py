"""Whether a bound says something by the deadline, of graphs and of families, and which gains would make it.

*Useful* is a bound that leaves at most 1 % at 0.99 T. Of a graph by one of two measures:

* ``||z|| <= ||z(0)|| / 100`` for every initial state, ``z`` being the coordinates ``E`` or ``eps`` of the envelope;
* from the given initial state, no agent is farther from its final state than a hundredth of the longest way of all.

Under the sliding-mode protocol with a reaching phase the first alone counts, from ``T_r`` on: ``||z||`` at
``T_r + 0.99 T_s`` against ``||z(T_r)||``. Of a family: of the largest ``|x_k(0)|``, for every agent, under the signals
that were asked for; without an initial state, of the norm that decays under every signal. Where it was asked what may
be left at ``T``, that decides. What is not useful comes with what to change.
"""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from lmi.exact.decimal_rounding import down, up
from ptcc_certify.bounds.delay.late_messages import LateBounds
from ptcc_certify.bounds.envelope import Envelope
from ptcc_certify.certificate.agents_answer import AgentsAnswer
from ptcc_certify.certificate.constrained_switching.bounds import deviation_of_signal
from ptcc_certify.certificate.family_proof import FamilyProof
from ptcc_certify.certificate.graph_proof import GraphProof
from ptcc_certify.checker.input_formulas import InitialSet, root_above
from ptcc_certify.errors import Change, Sentence, joined
from ptcc_certify.graphs.size_limits import EXACT_NODES
from ptcc_certify.lyapunov.search import USEFUL

#: The share of the time that is left where the bound is judged.
LAST = Fraction(1, 100)


#: Digits of the gain that is proposed.
_DIGITS = 3


#: A bound of 0 is this small at most once floats are rounded up.
_NOTHING = 1e-299


_LARGEST_CLOCK = 1e12
#: Up to which multiple of ``rho2`` one is looked for that makes the bound useful.
_LARGEST = 2e4


#: How often its interval is halved, to within a digit that is told.
_HALVINGS = 7


class Use(NamedTuple):
    """What a bound is worth by the deadline.

    Attributes
    ----------
    useful : bool or None
        Whether it says something; None where there is no bound.
    remark : str, or tuple of str and Change
        What it says, or does not, or what to try next.
    caveat : str
        That the input is not bounded, or not proved bounded; empty if it is.
    advice : str, or tuple of str and Change
        What would make it useful, and bound the input.
    """

    useful: bool | None
    remark: Sentence = ""
    caveat: str = ""
    advice: Sentence = ""


def use_of(proof: GraphProof | FamilyProof) -> Use:
    """Return what the bounds are worth: of all that is asked, the worst; of a family for the signals asked for."""
    if proof.constant and isinstance(proof, GraphProof):
        return Use(True, "nothing to decay")
    if proof.agents is not None:
        return _use_of_agents(proof.agents)
    if proof.late is not None:
        return _use_of_tracking(proof, proof.late) if proof.late.tracks else _use_of_late(proof, proof.late)
    if isinstance(proof, FamilyProof):
        return _use_of_family(proof)
    if proof.effort is not None and proof.effort.residual:
        useful, remark = _limited_usefulness(proof)
        return Use(useful, remark, advice="" if useful else _mend(proof))
    useful, remark, rho2 = _usefulness(proof)
    caveat, advice = _advise(proof, rho2)
    return Use(useful, remark, caveat, joined("; ", (advice, "" if useful or rho2 is not None else _mend(proof))))


def _mend(proof: GraphProof | FamilyProof) -> Sentence:
    """Tell what to change of what was asked, where no number is known that leaves 1 %."""
    messages, leaders, limits = proof.asked_messages, proof.asked_leaders, proof.limits
    smaller = {
        "delay": messages is not None and messages.largest_delay > 0,
        "period": messages is not None and messages.held > 0,
        "quantisation": messages is not None and messages.value_error > 0,
        "leader_speed": leaders is not None and leaders.speed > 0,
        "delta": leaders is not None and leaders.disturbance > 0,
        "noise": proof.noise is not None,
        "sample_period": any(limit.sample_period is not None for limit in limits),
        "stop_before": any(limit.stop_before is not None for limit in limits),
    }
    cap = proof.late.messages.gain_cap if proof.late is not None else None
    capped = cap is not None or any(limit.gain_cap is not None for limit in limits)
    less = joined(" or ", ((Change(name),) for name, asked in smaller.items() if asked))
    more = ("another ", Change("gain_cap")) if capped else ("a larger ", Change("rho2"))
    pieces = (joined("", ("a smaller ", less)) if less else "", more if capped or not less else "")
    return joined("", ("try ", joined(", or ", pieces)))


def _enough(proof: GraphProof | FamilyProof, late: LateBounds, useful: bool) -> bool | None:
    """Return whether so little is left, or what may be left at ``T`` was asked: None where that is not met."""
    most = proof.expectations.max_residual
    return useful if most is None else late.largest <= most or None


def _use_of_family(proof: FamilyProof) -> Use:
    """Return what the bounds of a family are worth for every signal, and for those asked for."""
    useful = _usefulness_of_signal(proof)
    caveat, rho2 = "", None
    if useful is False:
        rho2 = _useful_rho2_of_family(proof) if proof.direct else _useful_rho2_while_driven(proof)
    effects = [] if rho2 is None else ["leaves 1 %"]
    p, rate = proof.protocol, proof.rate
    mu3 = None
    if proof.common and not proof.bounded:
        grows = proof.unbounded
        caveat = "the input is not bounded for some signal" if grows else "the input is not proved bounded"
        if not grows and proof.signal != "any":
            caveat += " for every signal"
        if rate is not None:
            rho2 = max(rho2 or Fraction(0), _rounded_up(2 / (rate * p.kappa)))
            effects.append("bounds the input")
    if proof.sliding_bounded is False and proof.sliding_peaks is None:
        caveat = caveat or "the input is not proved bounded"
        mu3 = _rounded_up(1 / p.kappa)
        effects += [] if "bounds the input" in effects else ["bounds the input"]
    remark = "" if useful is not False else "little is proved by 0.99 T"
    mend = _mend(proof) if useful is False and "leaves 1 %" not in effects else ""
    return Use(useful, remark, caveat, joined("; ", (_gains(rho2, mu3, effects), mend)))


def _gains(rho2: Fraction | None, mu3: Fraction | None, effects: list[str]) -> Sentence:
    """Return gains with what they do, in words; nothing where there are none."""
    changes = [Change(name, gain) for name, gain in (("rho2", rho2), ("mu3", mu3)) if gain is not None]
    return joined(" ", [*((change,) for change in changes), " and ".join(effects)]) if changes else ""


# ---------------------------------------------------------------------- one graph


def _usefulness(proof: GraphProof) -> tuple[bool, str, Fraction | None]:
    """Return whether the bound is useful, what it says, and a ``rho2`` that would make it so."""
    envelope, p, direct = proof.envelope, proof.protocol, proof.direct
    span = p.T if direct else p.span
    z, instant = envelope.coordinates, "0.99 T"
    begin = f"{z}(0)"
    if not direct:
        begin, instant = f"{z}(T_r)", "T_r + 0.99 T_s"
    constant, pole = float(p.rho1 * span * (1 - LAST)), float(p.rho2 * p.kappa)
    share = _share(envelope, constant + pole * math.log(1 / LAST))
    remark = f"||{z}|| <= {up(share, 2)} ||{begin}|| at {instant}"
    if share <= USEFUL:
        return True, remark, None
    of_set = proof.effort is not None and proof.effort.initial_set is not None
    if direct and not of_set and (way := proof.longest_way) is not None:
        worst = float(proof.deviation_bound([float(LAST)]).max(initial=0.0))
        if worst <= USEFUL * way:
            return True, f"every agent within {up(worst, 2)} of its final state at {instant}", None
    return False, remark, _useful_rho2(envelope, constant, p.kappa)


def _use_of_agents(part: AgentsAnswer) -> Use:
    """Return whether bounds of agents of order n say something by ``T``, what, what is not proved, and a mend."""
    capped, caveat = part.protocol.gain_cap is not None, ""
    advice: Sentence = ""
    if part.unbounded:
        caveat = "the input is not certified bounded"
        mends = joined(" and ", ((mend,) for _, mend in part.unbounded))
        advice = joined(" ", (mends, "bounds it" if len(part.unbounded) == 1 else "bound it"))
    last = np.array([0.0 if capped else float(LAST)])
    fall = part.fall(float(last[0]))
    worst = float(part.deviation_bound(last)[:, 0].max(initial=0.0))
    when = "T" if capped else "0.99 T"
    remark = f"every position within {'0' if part.never_off else up(worst, 2)} of its place at {when}"
    useful = worst <= USEFUL * part.longest_way if part.longest_way else fall <= USEFUL
    if part.initial_state is None or not math.isfinite(worst):
        useful, remark = fall <= USEFUL, f"deviations at {when} are {up(fall, 2)} of {part.first_ones}"
    if not useful:
        nearer = ("try another ", Change("gain_cap")) if capped else part.nearer
        advice = joined("; ", (advice, nearer))
    return Use(useful, remark, caveat, advice)


def _limited_usefulness(proof: GraphProof) -> tuple[bool, str]:
    """Return the same of what is left at the deadline itself under the limits of the gain that were asked about."""
    effort, x0, way = proof.effort, proof.initial_state, proof.longest_way
    residual = () if effort is None else effort.residual
    region = None if effort is None else effort.initial_set
    noisy = any(entry.noise is not None for entry in residual)
    if region is None and way is not None and not noisy and all(entry.agents is not None for entry in residual):
        worst = max(x for entry in residual for x in entry.agents or ())
        if worst <= Fraction(USEFUL) * Fraction(way):
            return True, f"under the limits every agent within {up(worst, 2)} of its final state at T"
    norm = max(entry.norm if entry.noise is None else entry.noise.norm for entry in residual)
    under = f"under the limits{' and noise' if noisy else ''} ||E||"
    remark = f"{under} <= {up(norm, 2)} at T"
    rows = proof.structure.graph.exact_rows(range(proof.structure.graph.n_nodes))
    if region is not None:  # the largest |e_k(0)| of the set is attained, the norm that goes with it is larger
        largest = max(region.largest(row) for row in rows)
        return norm <= Fraction(USEFUL) * largest, f"{remark} from all these initial states"
    first = Fraction(0) if x0 is None else sum((InitialSet(x0).largest(row) ** 2 for row in rows), Fraction(0))
    if not first:
        return norm == 0, remark
    share = root_above(norm**2 / first)
    return share <= USEFUL, f"{under} <= {up(share, 2)} ||E(0)|| at T"


def _advise(proof: GraphProof, rho2: Fraction | None) -> tuple[str, Sentence]:
    """Return what is not proved of the input, and gains that bound it and, given ``rho2``, leave a hundredth."""
    effort, p, rate = proof.effort, proof.protocol, proof.rate
    if effort is None:
        return "", ""
    sliding_open = effort.peak is None and effort.sliding is not None and not effort.sliding.bounded
    caveat = "" if effort.bounded else f"the input is not {'' if effort.bounded is False else 'proved '}bounded"
    if sliding_open and not caveat:
        caveat = "the input is not proved bounded"
    effects = [] if rho2 is None else ["leaves 1 %"]
    if caveat:
        effects.append("bounds the input")
    if not effort.bounded and rate is not None:
        rho2 = max(rho2 or Fraction(0), _rounded_up(2 / rate / p.kappa))
    return caveat, _gains(rho2, _rounded_up(1 / p.kappa) if sliding_open else None, effects)


def _rounded_up(gain: Fraction) -> Fraction:
    """Return a gain of few digits that is no smaller."""
    return Fraction(up(gain, _DIGITS))


def _share(envelope: Envelope, clock: float) -> float:
    """Return what is left of ``||z||`` after so much of the clock, rounded up."""
    return float(Envelope(envelope.structure, envelope.gain, envelope.functions).norm_factor(clock))


def _useful_rho2(envelope: Envelope, constant: float, kappa: Fraction) -> Fraction | None:
    """Return a short ``rho2`` with which the bounds at hand leave a hundredth; None if there is none."""
    low, high = constant, max(constant, 1e-300)
    while _share(envelope, high) > USEFUL:
        low, high = high, 2 * high
        if high > _LARGEST_CLOCK:
            return None
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if _share(envelope, middle) > USEFUL else (low, middle)
    rho2 = Fraction(high - constant) / Fraction(math.log(1 / LAST)) / kappa
    return _rounded_up(rho2 * (1 + Fraction(1, 10**9))) if rho2 > 0 else None


def _use_of_late(proof: GraphProof | FamilyProof, late: LateBounds) -> Use:
    """Tell whether what is left at ``T`` with late messages is a hundredth of the longest way of an agent, if known.

    Of more, and of what a shorter delay alone mends, it is told how to ask for one that leaves so much. The rest of
    the certificate knows of no delay: what it tells of the input does not hold here.
    """
    caveat = "" if late.inputs is not None else "the input is not proved bounded"
    if math.isinf(late.largest):
        return Use(None, "", caveat)
    if late.largest <= _NOTHING:
        return Use(True, "", caveat)
    way = 1.0 if late.relative else proof.longest_way
    if way is not None and (proved := late.vehicles) is not None:  # the way on which they brake, beside that to go
        way += float(max(map(abs, proved.vehicles.v0)) / (proved.gains[0] * late.case.exact.least_gain()))
    relative = " from within 1 of it" if late.relative else ""
    remark = f"every {late.whose} within {up(late.largest, 2)} of {late.goal} at T{relative}"
    useful = _enough(proof, late, way is not None and late.largest <= USEFUL * way)
    if useful is not False:
        return Use(useful, remark, caveat)
    searched = isinstance(proof, GraphProof) and proof.graph.n_nodes <= EXACT_NODES and late.vehicles is None
    alone = late.leaders is None and not late.messages.value_error and late.messages.gain_cap is None
    if not (way and searched and alone and late.messages.age):
        return Use(useful, remark, caveat, _mend(proof))
    delay = (Change("max_residual", down(Fraction(way) / 100, 2)), " asks for a delay that leaves 1 %")
    return Use(useful, remark, caveat, delay)


def _use_of_tracking(proof: GraphProof | FamilyProof, late: LateBounds) -> Use:
    """Tell whether followers are nearer to their targets at ``0.99 T`` than a hundredth of what there was to go.

    That is what is proved at first, or how far the leaders may move by ``T`` if that is farther.
    """
    if not late.says_something or late.leaders is None:
        return Use(None)
    T = float(late.case.protocol.T)
    first, last = (float(x) for x in late.largest_bound([0.0, 0.99 * T]))
    relative = " from within 1 of it" if late.relative else ""
    remark = f"every {late.whose} within {up(last, 2)} of {late.goal} at 0.99 T{relative}"
    useful = _enough(proof, late, last <= max(USEFUL * max(first, float(late.leaders.total) * T), _NOTHING))
    mend = _mend(proof) if useful is False else ""
    if late.inputs is not None:
        return Use(useful, remark, advice=mend)
    bounding = (Change("rho2", late.bounding_rho2), " bounds the input")
    return Use(useful, remark, "the input is not proved bounded", joined("; ", (bounding, mend)))


# ---------------------------------------------------------------------- families


def _useful_rho2_of_family(proof: FamilyProof) -> Fraction | None:
    """Return a short ``rho2`` with which the bounds at hand leave 1 % at 0.99 T; None if there is none within reach.

    ``rho2`` enters the bounds by the clock alone, ``s = rho1 t + rho2 kappa ln(T/(T-t))``.
    """
    gain, rho2 = proof.protocol.gain, proof.protocol.parameters["rho2"]
    kappa, last = float(gain.pole / rho2), -math.log(float(LAST))
    candidates = float(rho2) * np.geomspace(1, _LARGEST, max(15, min(500, 10**6 // proof.family.n_nodes)))
    clock = float(gain.clock_at_remaining(float(LAST))) + (candidates - float(rho2)) * kappa * last
    if proof.initial_state is not None:
        with np.errstate(over="ignore", invalid="ignore"):  # functions with negative rates
            left = proof.deviation_at(clock).max(axis=0)
        enough = left <= float(max(map(abs, proof.initial_state)) * LAST)
    else:
        enough = np.ones(clock.size, bool)
        for part in (part for part in proof.parts if part.component.nodes.size > 1):
            decays = [math.sqrt(V.overshoot) * np.exp(-float(V.rate) / 2 * clock) for V in part.functions if V.rate > 0]
            enough &= np.min(decays or [np.full(clock.size, np.inf)], axis=0) <= float(LAST)
    return Fraction(up(float(candidates[enough.argmax()]), 3)) if enough.any() else None


def _useful_rho2_while_driven(proof: FamilyProof) -> Fraction | None:
    """Return the same at ``T_r + 0.99 T_s`` where sliding variables move; None without an initial state.

    They drive the agents with the gain, too: the bound for every signal is formed anew with every ``rho2``.
    """
    protocol = proof.protocol
    if proof.initial_state is None or proof.rate is None:
        return None

    def suffices(rho2: float) -> bool:
        other = replace(proof, question=replace(proof.question, protocol=protocol.replace(rho2=Fraction(up(rho2, 3)))))
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


def _target(proof: FamilyProof) -> tuple[float, float]:
    """Return ``1 - t/T`` where the bound is judged, and what of the largest state it may leave there."""
    sizes = map(abs, (*(proof.initial_state or ()), *(proof.sigma0 or ())))
    return float(LAST) * proof.settling_share, float(max(sizes) * LAST)


def _usefulness_of_signal(proof: FamilyProof) -> bool | None:
    """Tell whether the bound leaves at most 1 % at 0.99 T; None where no state is approached by every signal."""
    if not proof.common:
        return None
    if proof.initial_state is not None:
        instant, enough = _target(proof)
        return enough == 0 or bool(deviation_of_signal(proof, [instant]).max() <= enough)
    clock = float(proof.protocol.gain.clock_at_remaining(float(LAST)))
    for part in proof.parts:
        left = [math.sqrt(V.overshoot) * math.exp(-float(V.rate) / 2 * clock) for V in part.functions]
        if part.component.nodes.size > 1 and min(left, default=math.inf) > float(LAST):
            return False
    return True
