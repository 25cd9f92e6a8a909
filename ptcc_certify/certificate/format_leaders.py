"""Moving leaders in the file of a certificate: written and read, section 22 of ``FORMAT.md``."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction

from ptcc_certify.bounds.tracking import Tracking
from ptcc_certify.certificate.format_vectors import floats, floats_up
from ptcc_certify.checker.leaders import LeadersAsked, LeadersSection
from ptcc_certify.checker.obligations import CheckReport
from ptcc_certify.checker.sections import RowVector
from ptcc_certify.checker.side_files import Numbers
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.lyapunov.follower_rows import RowWitness
from ptcc_certify.protocols.base import Protocol
from ptcc_certify.protocols.moving_leaders import MovingLeaders
from ptcc_certify.theorems.theorem import Obligation


def tracking_obligations(tracking: Tracking | None) -> Iterator[Obligation]:
    """Yield what was proved of moving leaders."""
    if tracking is not None:
        witness = tracking.witness
        yield Obligation("tracking", "leaders", {"a": witness.b}, RowVector(u=Numbers(witness.u)))


def asked_leaders(leaders: MovingLeaders) -> LeadersAsked:
    """Return how leaders move, as files have it."""
    return LeadersAsked(speed=leaders.speed, disturbance=leaders.disturbance, sign_gain=leaders.sign_gain)


def read_leaders(section: LeadersAsked) -> MovingLeaders:
    """Return what a certificate says of how leaders move."""
    return MovingLeaders(section.speed, section.disturbance, section.sign_gain)


def leaders_section(tracking: Tracking) -> LeadersSection:
    """Return what is proved with moving leaders, as files have it."""
    asked, bound = vars(asked_leaders(tracking.leaders)), None if tracking.input is None else Numbers(tracking.input)
    return LeadersSection(**asked, initial=tracking.initial, input=bound, after=tracking.after)


def read_tracking(report: CheckReport, structure: Structure, protocol: Protocol, relative: bool) -> Tracking | None:
    """Return what an accepted certificate says of moving leaders; None if it says nothing."""
    section: LeadersSection | None = report.sections.get("leaders")
    if section is None:
        return None
    step = report.proved["tracking", "leaders"]
    rows = RowWitness(Fraction(1), step["a"], floats(step["witness"].u))
    leaders, bound = read_leaders(section), floats_up(section.input)
    return Tracking(leaders, structure, protocol, rows, section.initial, relative, section.after, bound)
