"""What becomes of expectations where messages are late, or leaders move: the rest of a certificate knows of neither."""

from __future__ import annotations

import math
from collections.abc import Mapping
from fractions import Fraction

from lmi.exact.decimal_rounding import down, near, up
from ptcc_certify.bounds.late_messages import LateBounds
from ptcc_certify.bounds.missed_deadline import Missed
from ptcc_certify.bounds.tracking import Tracking
from ptcc_certify.certificate.answer import MET, OPEN, REFUTED, Answer
from ptcc_certify.certificate.certificate_data import Content
from ptcc_certify.lyapunov.search import USEFUL
from ptcc_certify.protocols.base import Protocol


def at_deadline(certificate: Content, answer: Answer) -> Answer:
    """Return what becomes at ``T``, where messages are late, of a behaviour that follows where none are."""
    late = certificate.late
    asked = late is not None or certificate.request.messages is not None
    if not asked or answer.status != MET or certificate.constant:
        return answer
    what = f"{answer.what} at T with late messages"
    if late is None:
        return Answer(OPEN, what, "nothing is proved of them")
    if late.direct:
        return answer
    if late.missed is not None:
        return Answer(REFUTED, what, _misses(certificate, late.missed))
    if late.staged is not None:
        return Answer(OPEN, what, "with deadlines of stages it holds, with one for all none is proved to hold it")
    if late.leaders is not None:
        return Answer(OPEN, what, "leaders move, so that nobody is proved to settle")
    if late.messages.gain_cap is not None:
        return Answer(OPEN, what, "nothing settles under a cap")
    return Answer(OPEN, what, "nobody is proved to settle at T")


def judge_rate_beside(certificate: Content, least: Fraction, what: str) -> Answer | None:
    """Tell the same of a rate where messages are late, leaders move or the gain is held; None where nothing of it is.

    The rates of a certificate, and the upper bound on them, are those of the loop without these.
    """
    late = certificate.late
    if certificate.constant or certificate.agents is not None:
        return None
    if certificate.leaders_move:
        return Answer(OPEN, what, "no rate is proved while leaders move")
    if any(limits.sample_period is not None for limits in certificate.limits):
        return Answer(OPEN, what, "no rate is proved of a gain that is held")
    if (late is None and certificate.request.messages is None) or (late is not None and late.direct):
        return None
    if late is None or late.lmi is None:
        return Answer(OPEN, what, "no rate is proved with late messages")
    rate = 2 * late.lmi.b
    return Answer(MET if rate >= least else OPEN, what, f"with late messages {down(rate)} is proved")


def judge_messages(certificate: Content) -> list[Answer]:
    """Tell what becomes of what may be left at ``T`` with late messages, and whether anything is proved of these."""
    late, most = certificate.late, certificate.expectations.max_residual
    if late is None:
        unproved = certificate.request.messages is not None
        answers = [Answer(OPEN, "late messages", "nothing is proved of what is left at T")] * unproved
        answers += [] if most is None or unproved else [Answer(OPEN, "max_residual", "no messages are late")]
        if certificate.request.leaders is not None and certificate.tracking is None:
            answers.append(Answer(OPEN, "leaders that move", "no vector for their followers was found"))
        return answers
    if not late.says_something:
        known = 0 < (late.longest_delay or 0) < math.inf
        limit = f"; this certificate's limit is a delay of {late.longest_delay:.3g}" if known else ""
        wish = "" if most is None else _longest(late, f"within {near(most, 12)} at T is ")
        mend = "; give an initial state" * (certificate.initial_state is None)
        return [Answer(OPEN, "late messages", f"nothing is proved of what is left at T{mend}{limit}{wish}")]
    return [] if most is None else [_judge_residual(certificate, late, most)]


def _judge_residual(certificate: Content, late: LateBounds, most: Fraction) -> Answer:
    """Tell whether no more than ``most`` is left at ``T``, and up to which delay that is proved."""
    what, missed = f"within {near(most, 12)} at T" + " from within 1 of it" * late.relative, late.missed
    if late.largest <= most:
        return Answer(MET, what, _longest(late).removeprefix("; "))
    if missed is not None and missed.bound > most:
        return Answer(REFUTED, what, f"{_misses(certificate, missed)}{_longest(late)}")
    return Answer(OPEN, what, f"this certificate's limit is {up(late.largest, 3)}{_longest(late)}")


def _longest(late: LateBounds, what: str = "") -> str:
    """Tell how old what is heard may be so that what was asked is certified; empty if that is not known."""
    if late.enough is None:
        return ""
    alike = ", all delays in proportion" * isinstance(late.messages.delay, Mapping)
    return f"; {what}certified where nothing is older than {down(late.enough, 4)}{alike}"


def _misses(certificate: Content, missed: Missed) -> str:
    """Tell who misses the deadline by how much."""
    return f"agent {certificate.graph.labels[missed.agent]} is away by {down(missed.bound, 2)} at least, proved"


def judge_input_beside(certificate: Content, most: Fraction, what: str, first: Fraction | float) -> Answer:
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
    late, tracking = certificate.late, certificate.tracking
    if first > most and not (late is not None and late.messages.value_error):
        return Answer(REFUTED, what, f"it is up to {down(first)} at the start, proved")
    if late is not None:
        return _judge_late_input(certificate, late, most, what)
    return _judge_tracking(tracking, most, what)


def _judge_late_input(certificate: Content, late: LateBounds, most: Fraction, what: str) -> Answer:
    """Tell whether every input stays within so much with late messages."""
    largest = largest_late_input(late, certificate.protocol)
    if largest is None:
        why = "no bound is proved with late messages"
        why += "; a gain without a cap makes ever more of what is left at T" * (late.messages.gain_cap is None)
        return Answer(OPEN, what, why)
    what += f" from within 1 of the {'final states' if late.leaders is None else 'targets'}" * late.relative
    return Answer(MET, what) if largest <= most else Answer(OPEN, what, f"proved: {up(largest)}")


def largest_late_input(late: LateBounds, protocol: Protocol) -> Fraction | None:
    """Return what bounds every ``|u_k|`` with late messages, the sliding term included; None where nothing does."""
    if late.input is None:
        return None
    return Fraction(float(late.input.max())) + (0 if protocol.reaching is None else protocol.reaching.mu1)


def _judge_tracking(tracking: Tracking | None, most: Fraction, what: str) -> Answer:
    """Tell whether every input stays within so much while leaders move."""
    if tracking is None or tracking.input is None:
        return Answer(OPEN, what, "no bound is proved while leaders move")
    what += " from within 1 of the targets" * tracking.relative
    largest = Fraction(float(tracking.input.max()))
    return Answer(MET, what) if largest <= most else Answer(OPEN, what, f"proved: {up(largest)}")


def use_of_late(late: LateBounds, longest_way: float | None) -> tuple[bool | None, str, str]:
    """Return whether what is left at ``T`` with late messages is a hundredth of the longest way, what, and a caveat.

    Parameters
    ----------
    late : LateBounds
    longest_way : float or None
        Of an agent to its final state; None without an initial state.

    Returns
    -------
    tuple of bool or None, str, str
        None where nothing is proved of what is left. The rest of the certificate knows of no delay: what it tells of
        the input does not hold here.
    """
    caveat = "" if late.input is not None else "the input is not proved bounded"
    if math.isinf(late.largest):
        return None, "", caveat
    way = 1.0 if late.relative else longest_way
    where = "agent within {} of its final state" if late.leaders is None else "follower within {} of its target"
    remark = f"every {where.format(up(late.largest, 2))} at T{' from within 1 of it' * late.relative}"
    return way is not None and late.largest <= USEFUL * way, remark, caveat


def use_of_tracking(tracking: Tracking) -> tuple[bool, str, str, str]:
    """Return whether followers are near their targets at ``0.99 T``, how near, what is not proved, and a mend.

    Parameters
    ----------
    tracking : Tracking

    Returns
    -------
    tuple of bool, str, str, str
        Near is a hundredth of what is proved of the distance at first.
    """
    first, last = (float(x) for x in tracking.distance_bound([1.0, 0.01]).max(axis=0))
    remark = f"every follower within {up(last, 2)} of its target at 0.99 T{' from within 1 of it' * tracking.relative}"
    if tracking.input is not None:
        return last <= USEFUL * first, remark, "", ""
    mend = f"--rho2 {tracking.bounding_rho2} bounds the input"
    return last <= USEFUL * first, remark, "the input is not proved bounded", mend
