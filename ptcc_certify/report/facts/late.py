"""Facts of late messages and moving leaders: what is left at the deadline, who misses it, how leaders are tracked."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from lmi.exact.decimal_rounding import down, float_up, near, up
from ptcc_certify.bounds.delay.small_delays import delay_threshold
from ptcc_certify.certificate.fact import Fact, Facts
from ptcc_certify.checker.input_formulas import Limits
from ptcc_certify.errors import Change, joined, labelled
from ptcc_certify.graphs.size_limits import EXACT_NODES
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.report.facts.claim import asked_messages
from ptcc_certify.report.facts.input import limits_text
from ptcc_certify.report.text_layout import agent_text, shorten_list

if TYPE_CHECKING:
    from ptcc_certify.bounds.delay.late_messages import LateBounds
    from ptcc_certify.certificate.certificate import Certificate
    from ptcc_certify.model.base import Protocol
    from ptcc_certify.model.late_messages import LateMessages, MovingLeaders

#: From where bounds are that no initial state is given for.
FROM_WITHIN_1 = ", from within 1 of it at first"


def late_facts(certificate: Certificate) -> Facts:
    """Tell how late messages are; what cannot be then, and what is left at the deadline."""
    late = certificate.proof.late
    if late is None:
        return
    if late.tracks and late.leaders is not None:
        yield from _tracking(late, late.leaders, certificate.at)
        return
    yield from _vehicles(certificate, late)
    yield Fact(head="messages", note=messages_text(late.messages, certificate.protocol))
    if late.leaders is not None:
        yield _pushed(late, late.leaders)
    told = [*_impossible(late), *([] if late.direct else _left(late)), *_stages(late), *_kept_off(late)]
    if (at := certificate.at) is not None and (late.of_followers or late.of_all):
        bound = float(late.largest_bound([float(at)])[0])
        note = f"at t = {near(at)} every agent within {_bound_text(late, bound, 2)}"
        told.append(Fact(head="late", value=bound, side="up", note=note))
    yield from (replace(fact, loud=not late.says_something) for fact in told)
    from ptcc_certify.certificate.judgements import largest_late_input  # ``classify`` has no use for solvers

    largest, whole = largest_late_input(late, certificate.protocol), FROM_WITHIN_1 if late.relative else ""
    if largest is not None:
        sliding = "" if certificate.protocol.reaching is None else ", the sliding term included"
        speed = None if late.vehicles is None or late.vehicles.velocity is None else late.vehicles.velocity.max()
        also = "" if speed is None else f", |v_k| <= {_bound_text(late, float(speed), 4)}"
        text = f"bounded up to T; |u_k| <= {up(largest, 4)}{also}{sliding}{whole}"
        yield Fact(head="input", value=largest, side="up", note=text)
    else:
        yield Fact(head="input", standing="unproved", note=_unbounded_text(late), loud=True)
    if by_agent := _residual_text(late):
        yield Fact(head="left", note=f"at T by agent: {by_agent}", detail=True)
    yield from _targets(late)


def _targets(late: LateBounds) -> Facts:
    """Tell what a target is where leaders hear each other, and values are off or agents disturbed."""
    if late.forms and not late.messages.settles:
        note = "targets are where the first leader of a group is now, in another camp its opposite; or 0"
        moved = "what is off or disturbed moves them"
        without = late.messages.value_error and late.messages.gain_cap is None
        moved += ", without a gain cap as far as it likes" if without else ", how far is not told"
        yield Fact(head="left", note=f"{note}; {moved}", brief=(f"targets are where first leaders are; {moved}",))


def _unbounded_text(late: LateBounds) -> str:
    """Tell that no bound of the input is proved, and why."""
    if late.vehicles is not None:
        return "not proved bounded yet of virtual positions without a cap of the gain"
    if late.heard_right:
        return "not proved bounded: not all who listen have rho2 kappa times their weights >= 1"
    kind = "late" if late.messages.age else "inexact"
    why = "" if late.messages.gain_cap is not None else f": a gain without a cap makes ever more of what is {kind}"
    return f"not proved bounded with {kind} messages{why}"


def _bound_text(late: LateBounds, bound: float, digits: int) -> str:
    """Write a bound with up to so many digits, from above: 0 only where nothing is off at first, either."""
    return up(bound, digits) if bound or late.largest_bound([0.0]).any() else "0"


def _vehicles(certificate: Certificate, late: LateBounds) -> Facts:
    """Tell what vehicles do that exchange virtual positions, and what is proved of their motion before ``T``."""
    if late.messages.vehicles is None:
        return
    orders = late.messages.vehicles.orders
    names = {1: "single", 2: "double", 3: "triple"}
    mixed = [f"{orders.count(n)} {names[n]}" for n in sorted(set(orders))]
    who = names[orders[0]] if len(mixed) == 1 else ", ".join(mixed)
    text = f"{who} integrators exchange virtual positions z_k, z_k' = gain e_k"
    if late.messages.vehicles.disturbance:
        leading = late.leaders is not None and ("leaders" if late.leaders.speed else "leaders of order 1")
        whose = f", not of {leading}" if leading else ""
        text = f"any |d_k| <= {near(late.messages.vehicles.disturbance)} beside u_k{whose}; {text}"
    if (proved := late.vehicles) is None:
        yield Fact(head="agents", note=text)
        return
    places = "" if certificate.proof.offsets is None else ", places added"
    named = [f"a_{i} = " for i, a in enumerate(proved.gains, start=1)]
    told = zip(named, proved.gains, strict=True) if len(set(proved.gains)) > 1 else [("".join(named), proved.gains[0])]
    gains = ", ".join(f"{name}{near(a)}" for name, a in told)
    yield Fact(head="agents", note=f"{text}, and track them{places}: {gains}")
    shares, percent = (0.5, 0.9, 0.99), np.arange(1, 100)  # drives are summed up from instant to instant
    over_time = late.vehicles_over_time(float(late.gain.gain.T) * percent / 100)
    position, velocity = (bounds[:, np.isin(percent, (50, 90, 99))] for bounds in over_time)
    whole = FROM_WITHIN_1 if late.relative else ""
    for name, bounds in (("deviations", position), ("velocities", velocity)):
        largest = zip(bounds.max(axis=0).tolist(), shares, strict=True)
        if not np.isfinite(bounds).all():  # of velocities of order 1 nothing is told without a cap
            continue
        each = ", ".join(f"{_bound_text(late, x, 2)} at {share:g} T" for x, share in largest)
        yield Fact(head="agents", note=f"{name} at most {each}{whole}", detail=True)


def _tracking(late: LateBounds, leaders: MovingLeaders, at: Fraction | None) -> Facts:
    """Tell how followers track leaders that move, of which they hear at once."""
    alone = leaders.idle or leaders.clipped
    head = "limited" if alone else "tracking"  # where limits are all that was asked
    if not leaders.idle:
        yield Fact(head=head, note=leaders_text(leaders)) if alone else _pushed(late, leaders)
    if not late.says_something:
        why = f"nothing is proved: {late.missing}"
        if late.unreachable is not None:
            name, off = late.unreachable
            why = f"agent {labelled(name)} is off by {down(off, 3)} at T at least; {late.missing}"
        yield Fact(head=head, standing="unproved", note=why, loud=True)
        return
    protocol, after = late.case.protocol, late.after
    if (cap := late.messages.gain_cap) is not None:
        yield Fact(head=head, note=f"gain <= {near(cap)}{': under a cap nothing settles' if late.largest else ''}")
    where = f"within {up(late.largest, 2)} of {late.goal}" if late.largest else f"on {late.goal}"
    then = "" if after is None else f", within {up(after, 2)} of it from then on" if after else ", and ever after"
    text = f"every {late.whose} {where} at T = {near(protocol.T)}{then}"
    yield Fact(head=head, note=text, brief=(f"{text};",), asked=text)
    instants = {"0.9 T": protocol.T * 9 / 10, "0.99 T": protocol.T * 99 / 100}
    if at is not None:
        instants = {f"t = {near(at)}": at}
    whole = FROM_WITHIN_1.removeprefix(",") if late.relative else ""
    bounds = late.largest_bound([float(t) for t in instants.values()]).tolist()
    within = ", ".join(f"{_bound_text(late, x, 2)} of it at {when}" for when, x in zip(instants, bounds, strict=True))
    yield Fact(head=head, note=f"before T within {within}{whole}")
    if late.inputs is not None:
        largest, most = float(late.inputs.max()), leaders.saturation
        size = near(most) if most is not None and largest >= most else up(largest, 4) if largest else "0"
        text = f"bounded up to T; |u_k| <= {size}{whole}"
        yield Fact(head="input", value=largest, side="up", note=text)
    else:
        note = (f"not proved bounded {leaders.while_told}; ", Change("rho2", late.bounding_rho2), " bounds it")
        yield Fact(head="input", standing="unproved", note=note, loud=True)
    if late.largest and (by_agent := _residual_text(late)):
        yield Fact(head="left", note=f"at T by agent: {by_agent}", detail=True)
    yield from _targets(late)


def _pushed(late: LateBounds, leaders: MovingLeaders) -> Fact:
    """Tell how fast leaders move, and what disturbs others; where leaders hear each other all who listen."""
    text = leaders_text(leaders)
    if late.forms:
        text = text.removeprefix("at rest; ").replace("of followers", "of all who listen")
    heads = {"agents": leaders.growth, "disturbed": late.forms, "limited": leaders.clipped, "leaders": True}
    head = next(name for name, fits in heads.items() if fits)
    return Fact(head=head, note=text)


def leaders_text(leaders: MovingLeaders) -> str:
    """Tell how fast leaders move, and what disturbs the followers.

    Examples
    --------
    >>> leaders_text(MovingLeaders(speed="0.5", disturbance=1))
    "speed |x_j'| <= 0.5; any |d_k| <= 1 of followers"
    """
    speed = "|v_j|" if leaders.growth else "|x_j'|"
    if leaders.clipped and leaders.saturation is not None:
        return f"inputs are clipped to [-{near(leaders.saturation)}, {near(leaders.saturation)}]"
    clauses = [f"speed {speed} <= {near(leaders.speed)}" if leaders.speed else "at rest"]
    if leaders.growth:
        own = f"x' = f(x) + {'v or ' if leaders.speed else ''}u, any odd f"
        clauses[0] = f"{own} with |f(x) - f(y)| <= {near(leaders.growth)} |x - y|"
        clauses += [f"leaders' speed {speed} <= {near(leaders.speed)}"] * bool(leaders.speed)
    if leaders.disturbance > 0:
        clauses.append(f"any |d_k| <= {near(leaders.disturbance)} of followers")
    if leaders.sign_gain is not None:
        clauses.append(f"followers add {near(leaders.sign_gain)} sign(e_k)")
    return "; ".join(clauses)


def messages_text(messages: LateMessages, protocol: Protocol | None = None) -> str:
    """Tell how late, how often lost and how inexact messages are.

    Examples
    --------
    >>> from ptcc_certify.model.late_messages import LateMessages
    >>> messages_text(LateMessages(delay="0.01", period="0.005", losses=3))
    'up to 0.03 old: 0.01 late, every 0.005, 3 in a row lost'
    >>> messages_text(LateMessages(delay={("a", "b"): "0.01", ("b", "c"): "0.02"}))
    'up to 0.02 old, edge by edge'
    """
    each = ", edge by edge" if isinstance(messages.delay, Mapping) else ""
    if messages.period is not None:
        late = [f"{near(messages.largest_delay)} late{each}"] if messages.largest_delay > 0 else []
        lost = [f"{messages.losses} in a row lost"] if messages.losses > 0 else []
        each = f": {', '.join([*late, f'every {near(messages.period)}', *lost])}"
    clauses = ["nothing late, lost or rounded"] if messages.exact else []
    if messages.age > 0:
        clauses.append(f"up to {near(messages.age)} old{each}")
    if protocol is not None and messages.age >= protocol.T:
        clauses.append(f"T = {near(protocol.T)}, so that by T nothing new need arrive")
    if messages.value_error != 0:
        clauses.append(f"off by up to {near(messages.value_error)}")
    if messages.gain_cap is not None:
        clauses.append(f"gain <= {near(messages.gain_cap)}")
    if messages.own_delay:
        clauses.append("the own state as well")
    return "; ".join(clauses)


def _residual_text(late: LateBounds) -> str:
    """List what is left at ``T`` at most, agent by agent; empty where nothing is proved."""
    if math.isinf(late.largest):
        return ""
    bounds, names = np.minimum.reduce(late.residuals), late.labels
    return shorten_list([f"{labelled(names[v])} {up(float(bounds[v]), 2)}" for v in range(len(names)) if bounds[v]])


def _impossible(late: LateBounds) -> Facts:
    """Tell what cannot be: who misses the deadline, and delays from which on a constant gain diverges."""
    if late.missed is not None:
        label = agent_text(late.labels[late.missed.agent], 22)
        notes = [
            f"agent {label} is off its final state at T by {size} at least, if none comes sooner"
            for size in (down(late.missed.bound, 3), down(late.missed.bound, 2))
        ]
        yield Fact(head="late", value=late.missed.bound, side="down", note=notes[0], brief=(notes[1],))
    threshold = _threshold(late)
    if late.messages.age >= threshold:
        gain = near(late.messages.gain_cap or Fraction(1))
        note = f"at a constant gain of {gain} agents diverge with delays above {threshold:.3g} (numerical)"
        yield Fact(head="late", standing="unproved", note=note)


def _threshold(late: LateBounds) -> float:
    """Return the delay that constant gain bears with a late own state; infinite if the own state is fresh."""
    structure = late.structure
    if not late.messages.own_delay or not isinstance(structure, Structure) or structure.graph.n_nodes > EXACT_NODES:
        return math.inf
    return delay_threshold(structure, float(late.messages.gain_cap or 1))


def _left(late: LateBounds) -> Facts:
    """Tell what is left at T at most, and which delays are certified."""
    capped = late.messages.gain_cap is not None and late.leaders is None and late.largest > 0
    cap = "under a cap nothing settles: " if capped else ""
    limit = _limit_text(late)
    if math.isinf(late.largest):
        note = f"{cap}nothing is proved of what is left at T"
        yield Fact(head="late", standing="unproved", note=joined("; ", (note, limit)))
        return
    settling = "; leaders hear each other at once, and settle by themselves" if late.settling is not None else ""
    within, shorter = (_within_text(late, digits) for digits in (3, 2))
    notes = [f"{cap}{text}{settling if late.largest else ''}" for text in (within, shorter)]
    formed = late.largest in [float_up(max(one.residual)) for one in (late.form, late.lmi) if one is not None]
    brief = joined("; ", (notes[1], limit if formed else ""))
    yield Fact(head="late", value=late.largest, side="up", note=notes[0], brief=(brief,), asked=within)
    if formed and limit:
        yield Fact(head="late", standing="unproved", note=limit, detail=True)


def _within_text(late: LateBounds, digits: int) -> str:
    """Tell how far agents are from their final states at T at most, or from the targets that leaders move."""
    if not late.largest:
        return f"every {'agent exactly at its final state' if late.leaders is None else 'follower on its target'} at T"
    text = f"every agent within {up(late.largest, digits)} of {late.goal} at T"
    if late.leaders is not None and not late.forms:
        text = f"every follower within {up(late.largest, digits)} of {late.goal} at T"
        text += "" if late.after is None else f", within {up(late.after, digits)} from then on"
    return text + (FROM_WITHIN_1 if late.relative else "")


def _kept_off(late: LateBounds) -> Facts:
    """Tell what no gain takes out of this bound, since leaders move on while messages come."""
    if late.never_below:
        note = (
            f"{down(late.never_below, 2)} of that no gain takes out of this bound: leaders move on while messages come"
        )
        yield Fact(head="late", value=late.never_below, side="down", note=note)


def _limit_text(late: LateBounds) -> str:
    """Tell the longest delay that the certificate forgives, and the one that constant gain does."""
    if late.longest_delay is None or math.isinf(late.longest_delay):
        return ""
    threshold = _threshold(late)
    more = "" if math.isinf(threshold) else f", the loop's {threshold:.3g} at constant gain"
    return f"this certificate's limit is a delay of {late.longest_delay:.2g} (double under half the cap){more}"


def _stages(late: LateBounds) -> Facts:
    """Tell the deadlines of stages, at which agents are at their final states exactly."""
    if late.unarrived:
        note = "no deadlines of stages: information takes longer than T from the leaders to the last agent"
        yield Fact(head="late", note=note)
    elif late.direct:
        note = "every agent exactly at its final state at T: all hear of leaders alone"
        yield Fact(head="late", note=note, asked=note)
    elif late.staged is not None and late.largest:
        when = f"from {near(min(late.staged))} to {near(max(late.staged))}, {near(late.messages.age)} apart"
        yield Fact(head="late", note=f"exactly at x(T) by T if agents have deadlines of their own, {when}")


def beside_law(certificate: Certificate) -> list[str]:
    """Tell in sentences what was asked for that the displayed law leaves out: limits, late values, moving leaders."""
    messages, leaders, told = asked_messages(certificate), certificate.proof.asked_leaders, list[str]()
    limits = list(certificate.limits)
    if messages is not None:
        if messages.age > 0:
            whose = "and the own value" if messages.own_delay else "but not the own value"
            told.append(
                f"Here nothing is late; with late messages what is heard, {whose}, is up to {near(messages.age)} old."
            )
        if messages.value_error > 0:
            off = f"with inexact ones what is heard is off by up to {near(messages.value_error)}"
            told.append(f"Here messages are exact; {off}.")
        if messages.gain_cap is not None and messages.vehicles is None and not limits:
            limits = [Limits(gain_cap=messages.gain_cap)]
    if leaders is not None and not leaders.idle:
        rest = "leaders are at rest; of those that move was asked:"
        driven = "; followers then move by x_k' = u_k + d_k" if leaders.disturbance > 0 else ""
        what = rest if leaders.speed else "nothing disturbs; asked was:"
        what = "nothing is clipped; asked was:" if leaders.clipped else "f = 0; asked was:" if leaders.growth else what
        text = leaders_text(leaders).removeprefix("at rest; ")
        if certificate.proof.late is not None and certificate.proof.late.forms:  # of agents that all follow each other
            text, driven = (words.replace("followers", "agents") for words in (text, driven))
        told.append(f"Here {what} {text}{driven}.")
    if certificate.noise is not None:
        told.append(f"With noise e_k is that of x + n, any |n_k| <= {near(certificate.noise)}.")
    if limits:
        each = "; or ".join(dict.fromkeys(map(limits_text, limits)))
        told.append(f"Where limits are named, the gain g is limited: {each}.")
    return told
