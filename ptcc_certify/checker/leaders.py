"""Verifies how followers track leaders that move as they like, within a speed: section 22 of the format."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from lmi.exact.decimal_rounding import down
from lmi.exact.numbers import longest, shorten
from lmi.exact.work import spend
from ptcc_certify.checker.follower_rows import Followers, Rows, followers_of
from ptcc_certify.checker.graph import by_agent
from ptcc_certify.checker.input import Verified
from ptcc_certify.checker.proof_cursor import Document
from ptcc_certify.checker.reading import exact, fields, length, need

KEYS = ("speed", "disturbance", "sign_gain", "initial", "input", "after")


def check_leaders(doc: Document, verified: Verified) -> None:
    """Verify everything that is said of leaders that move, if there is something."""
    if "leaders" not in doc.data:
        return
    section = fields(doc.section("leaders"), KEYS, "leaders")
    need(not verified.protocol.sliding, "leaders that move under the sliding-mode protocol")
    speed, disturbance, initial, after = (exact(section[key]) for key in ("speed", "disturbance", "initial", "after"))
    need(speed >= 0 and disturbance >= 0, "a speed or a disturbance is negative")
    push, sign = speed + disturbance, None if section["sign_gain"] is None else exact(section["sign_gain"])
    need(sign is None or sign >= push, "sign_gain is below speed + disturbance")
    followers = followers_of(doc, verified.structure, verified.begin)
    doc.at = "leaders"
    obligation = doc.open("tracking", "leaders", ["a"], witness=True)
    a = obligation["a"]
    rows = Rows(followers, followers.vector(doc, fields(obligation["witness"], ("u",), "the witness")["u"], "u"))
    rows.decay(Fraction(1), a)
    rows.above_initial(initial)
    gain, least = verified.gain, rows.least
    bits = length((a, push, initial, after, least, gain.T, gain.rho1, gain.k))
    spend(50, bits, bits, "leaders that move")
    if sign is None:
        need(after >= push / (a * gain.rho1 * least), "after is not proved")
    else:
        need(after == 0, "after is not 0 though followers never leave their targets")
    if section["input"] is not None:
        p, most = a * gain.k, gain.value(Fraction(1)) * initial
        need(p >= 1 if sign is not None else p > 1, "a rho2 kappa is too small for a bounded input")
        if sign is None:
            most += push / least * (gain.rho1 * gain.T + gain.k) / (p - 1)
        _inputs(doc, followers, rows, section["input"], most, sign or Fraction(0))
    doc.done(f"a = {down(a)}")


def _inputs(doc: Document, followers: Followers, rows: Rows, entry: Any, most: Fraction, added: Fraction) -> None:
    """Verify ``input_k >= (D_k u_k + sum_l |w_kl| u_l) most + added``; leaders have none."""
    structure = followers.structure
    graph, values = structure.graph, by_agent(doc, structure.graph, entry, "input")
    need(all(values.values[v] == 0 for group in structure.closed for v in group), "an input of a leader")
    bounds, (inputs, scale) = rows.inputs(), values.over(followers.nodes)
    factor = most / (rows.scale * graph.unit)
    bits = longest((*factor.as_integer_ratio(), *added.as_integer_ratio(), scale))
    spend(6 * len(inputs), bits + longest(bounds), bits + longest(inputs), "inputs of followers")
    for v, x, y in zip(followers.nodes, inputs, bounds, strict=True):
        need(Fraction(x, scale) >= y * factor + added, f"the input of agent {shorten(graph.labels[v])} is not proved")
