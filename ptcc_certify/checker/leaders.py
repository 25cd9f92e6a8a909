"""Verifies how followers track leaders that move as they like, within a speed: section 22 of the format."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from lmi.exact.decimal_rounding import down
from lmi.exact.numbers import longest
from lmi.exact.work import spend
from ptcc_certify.checker.family import Family
from ptcc_certify.checker.proof_cursor import Document
from ptcc_certify.checker.protocol import Begin, Protocol
from ptcc_certify.checker.reading import length, need
from ptcc_certify.checker.rows import Followers, Rows, followers_of
from ptcc_certify.checker.sections import Agents, NotNegative
from ptcc_certify.checker.side_files import Numbers
from ptcc_certify.checker.structure import Structure


@dataclass(frozen=True, kw_only=True)
class LeadersAsked:
    """How leaders move, and followers are disturbed."""

    speed: NotNegative
    disturbance: NotNegative
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
    initial, after, sign, push = section.initial, section.after, section.sign_gain, section.speed + section.disturbance
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
        _inputs(followers, rows, section.input, most, sign or Fraction(0))
    doc.done(f"a = {down(a)}")


def _inputs(followers: Followers, rows: Rows, values: Numbers, most: Fraction, added: Fraction) -> None:
    """Verify ``input_k >= (D_k u_k + sum_l |w_kl| u_l) most + added``; leaders have none."""
    need(all(values.values[v] == 0 for v in followers.others), "an input of a leader")
    (bounds, unit), (inputs, scale) = rows.largest, values.over(followers.nodes)
    factor = most / (rows.scale * unit)
    bits = longest((*factor.as_integer_ratio(), *added.as_integer_ratio(), scale))
    spend(6 * len(inputs), bits + longest(bounds), bits + longest(inputs), "inputs of followers")
    for k, (x, y) in enumerate(zip(inputs, bounds, strict=True)):
        need(Fraction(x, scale) >= y * factor + added, f"the input of agent {followers.label(k)} is not proved")
