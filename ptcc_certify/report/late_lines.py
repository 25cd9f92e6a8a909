"""What screens tell of late messages: how late, what is left at the deadline, who misses it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from lmi.exact.decimal_rounding import down, near, up
from ptcc_certify.bounds.small_delays import delay_threshold
from ptcc_certify.report.structure_text import Lines
from ptcc_certify.report.text_layout import shorten_label

if TYPE_CHECKING:
    from ptcc_certify.bounds.late_messages import LateBounds
    from ptcc_certify.bounds.tracking import Tracking
    from ptcc_certify.certificate.certificate import Certificate
    from ptcc_certify.protocols.late_messages import LateMessages


def late_lines(certificate: Certificate) -> Lines:
    """Tell how late messages are, what is left then, and who is certain to miss the deadline."""
    late = certificate.late
    if late is None:
        return
    yield "messages", messages_text(late.messages)
    yield "late" if late.says_something else "LATE", "; ".join([*_left(late), *_missed(late)])
    if late.unarrived:
        yield "", "no deadlines of stages: information takes longer than T from the leaders to the last agent"
    if late.staged is not None:
        first = min(late.staged)
        when = f"from {near(first)} to {near(certificate.protocol.T)}, {near(late.messages.age)} apart"
        yield "", f"exactly at x(T) by T if agents have deadlines of their own, {when}"


def tracking_lines(certificate: Certificate) -> Lines:
    """Tell how followers track leaders that move."""
    tracking = certificate.tracking
    if tracking is None:
        return
    leaders, T = tracking.leaders, near(certificate.protocol.T)
    sign = "" if leaders.sign_gain is None else f"; followers add {near(leaders.sign_gain)} sign(e_k)"
    pushed = f"; any |d_k| <= {near(leaders.disturbance)}" * (leaders.disturbance > 0)
    yield "leaders", f"move, |x_j'| <= {near(leaders.speed)}{pushed}{sign}"
    early, late = (up(float(tracking.distance_bound(np.array([q])).max()), 2) for q in (0.1, 0.01))
    after = "ever after" if not tracking.after else f"from T on within {up(_after(tracking), 2)}"
    whole = "for every 1 at first: " * tracking.relative
    yield (
        "tracking",
        f"{whole}every follower within {early} at 0.9 T, {late} at 0.99 T; on its target at T = {T}, {after}",
    )
    if tracking.input is None:
        yield "", "the input is not proved bounded: rho2 kappa is too small"
    else:
        yield "", f"|gain e_k| <= {up(float(tracking.input.max()), 4)}"


def _after(tracking: Tracking) -> float:
    return float(tracking.after) * float(tracking.witness.u.max())


def messages_text(messages: LateMessages) -> str:
    """Tell how late, how often lost and how inexact messages are.

    Examples
    --------
    >>> from ptcc_certify.protocols.late_messages import LateMessages
    >>> messages_text(LateMessages(delay="0.01", period="0.005", losses=3))
    'up to 0.03 old: 0.01 late, every 0.005, 3 in a row lost'
    """
    parts = [f"{near(messages.largest_delay)} late"] * (messages.largest_delay > 0)
    if messages.period is not None:
        parts.append(f"every {near(messages.period)}")
        parts += [f"{messages.losses} in a row lost"] * (messages.losses > 0)
    old = f"up to {near(messages.age)} old" + f": {', '.join(parts)}" * (messages.period is not None)
    told = [old] * (messages.age > 0)
    told += [f"off by up to {near(messages.value_error)}"] * (messages.value_error != 0)
    told += [f"gain <= {near(messages.gain_cap)}"] if messages.gain_cap is not None else []
    return "; ".join(told + ["the own state as well"] * messages.own_delay)


def _left(late: LateBounds) -> list[str]:
    """Tell what is left at T at most."""
    if math.isinf(late.largest):
        return ["nothing is proved of what is left at T"]
    whole = "for every 1 at first, " * late.relative
    settled = "" if late.messages.gain_cap is None else ", nothing settles under a cap"
    if late.form is not None and float(max(late.form.residual)) <= late.largest:
        threshold = delay_threshold(late.structure, float(late.messages.gain_cap or 1))
        limits = [] if late.longest_delay is None else [f"this certificate's limit {late.longest_delay:.2g}"]
        limits += [f"the loop's {threshold:.3g} at constant gain"] * late.messages.own_delay
        settled += f"; of delays {', '.join(limits)}" * bool(limits)
    return [f"{whole}at T every agent within {up(late.largest, 2)} of its final state{settled}"]


def _missed(late: LateBounds) -> list[str]:
    """Tell who misses the deadline."""
    if late.missed is None:
        return []
    label = shorten_label(late.structure.graph.labels[late.missed.agent], 22)
    return [f"agent {label} is away from it by {down(late.missed.bound, 2)} at least"]
