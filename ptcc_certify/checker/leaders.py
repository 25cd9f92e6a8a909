"""Verifies how followers track leaders that move as they like, within a speed: section 22 of the format."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from lmi.exact.decimal_rounding import down
from lmi.exact.work import spend
from ptcc_certify.checker.document import Document
from ptcc_certify.checker.family import Family
from ptcc_certify.checker.messages_asked import Moving
from ptcc_certify.checker.protocol import Begin, Protocol
from ptcc_certify.checker.reading import length, need
from ptcc_certify.checker.rows import Rows, followers_of
from ptcc_certify.checker.section_declarations import Agents
from ptcc_certify.checker.stated_bounds import Stated
from ptcc_certify.checker.structure import Structure


@dataclass(frozen=True, kw_only=True)
class LeadersAsked(Moving):
    """How leaders move, and followers are disturbed and kept on their targets."""

    sign_gain: Fraction | None


@dataclass(frozen=True, kw_only=True)
class LeadersSection(LeadersAsked):
    """What the file says of leaders that move."""

    initial: Fraction
    input: Agents | None
    after: Fraction


def check_leaders(doc: Document, of: Structure | Family, protocol: Protocol, begin: Begin) -> None:
    """Verify everything that is said of leaders that move, if there is something."""
    if "leaders" not in doc.data:
        return
    section = doc.section("leaders")
    need(not protocol.sliding, "leaders that move under the sliding-mode protocol")
    initial, after, sign, push = section.initial, section.after, section.sign_gain, section.push
    need(sign is None or sign >= push, "sign_gain is below speed + disturbance")
    followers = followers_of(doc, of, begin)
    doc.at = "leaders"
    obligation = doc.open("tracking", "leaders")
    a = obligation["a"]
    rows = Rows(followers, obligation["witness"].u)
    rows.decay(Fraction(1), a)
    rows.above_initial(initial)
    gain, least = protocol.gain, rows.least
    bits = length((a, push, initial, after, least, gain.T, gain.rho1, gain.k))
    spend(50, bits, bits, "leaders that move")
    if sign is None:
        need(after >= push / (a * gain.rho1 * least), "after is not proved")
    else:
        need(after == 0, "after is not 0 though followers never leave their targets")
    if section.input is not None:
        p, most = a * gain.k, gain.value(Fraction(1)) * initial
        need(p >= 1 if sign is not None else p > 1, "a rho2 kappa is too small for a bounded input")
        if sign is None:
            most += push / least * (gain.rho1 * gain.T + gain.k) / (p - 1)
        stated, (heard, unit) = Stated("input", followers.labels, section.input), rows.largest
        stated.rest(followers.others, "an input of a leader")
        added = sign or Fraction(0), [1] * len(followers.nodes)
        stated.meet(followers.nodes, (most / (rows.scale * unit), heard), added)
        stated.close()
    doc.done(f"a = {down(a)}")
