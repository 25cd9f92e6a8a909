"""What proves the upper bound on the rate of a family, in the file: members by their weights, a word by its durations.

It stands under ``unverified``: the independent check does not read it. Who reads the certificate proves it anew.
"""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from typing import Any

from ptcc_certify.checker.reading import RejectedError, entries, exact, need
from ptcc_certify.graphs.rationals import format_exact
from ptcc_certify.lyapunov.family_rate_upper_bound import FamilyRateBound, Member, prove_again
from ptcc_certify.lyapunov.quotient import Quotient
from ptcc_certify.theorems.counterexample_text import mode_name

#: Members of a word or mixture that are read.
_MANY = 100


def upper_bound_entry(quotient: Quotient, bound: FamilyRateBound) -> dict[str, Any]:
    """Return a bound as JSON-ready data.

    Each member has its mode and the weights of its uncertain edges as ``[source, target, weight]``; those that change
    nothing off the common rest states are left out. ``durations`` are those of a word, on the stretched clock, in its
    order in time; of a mixture the shares.

    Examples
    --------
    >>> from ptcc_certify.lyapunov.family_rate_upper_bound import prove_family_rate_bound
    >>> quotient = Quotient(Family.from_intervals([("a", "b", 1, 2)]))
    >>> upper_bound_entry(quotient, prove_family_rate_bound(quotient))["members"]
    [{'mode': 0, 'name': 'the graph', 'weights': [['a', 'b', '1']]}]
    """
    members = [
        {"mode": m.mode, "name": mode_name(quotient.family, m.mode), "weights": _weights(quotient, m)}
        for m in bound.members
    ]
    durations = [format_exact(h) for h in bound.durations]
    return {"value": format_exact(bound.value), "kind": bound.kind, "members": members, "durations": durations}


def _weights(quotient: Quotient, member: Member) -> list[list[str]]:
    mode, weights = quotient.family.modes[member.mode], []
    for part, level in zip(quotient.modes[member.mode].parts, member.levels, strict=True):
        low, high = mode.lower.fraction(part.edge), mode.upper.fraction(part.edge)
        size = low + level * (high - low)
        ends = (mode.labels[int(end[part.edge])] for end in (mode.source, mode.target))
        weights.append([*ends, format_exact(int(mode.sign[part.edge]) * size)])
    return weights


def read_upper_bound(quotient: Quotient, entry: Any) -> FamilyRateBound | None:
    """Return a bound that the file states, proved anew from its members; None if it is none, or not proved.

    Examples
    --------
    >>> quotient = Quotient(Family.from_intervals([("a", "b", 1, 2)]))
    >>> member = {"kind": "member", "members": [{"mode": 0, "weights": [["a", "b", "1"]]}], "durations": ["1"]}
    >>> str(read_upper_bound(quotient, member | {"value": "2"}).value)
    '2'
    >>> read_upper_bound(quotient, member | {"value": "1"}) is None
    True
    """
    try:
        members = tuple(_member(quotient, one) for one in entries(entry["members"], "members"))
        durations = tuple(exact(h) for h in entries(entry["durations"], "durations", len(members)))
        need(0 < len(members) <= _MANY and all(h > 0 for h in durations), "no durations")
        need(entry["kind"] in ("mixture", "word") or (entry["kind"] == "member" and len(members) == 1), "no bound")
        need(entry["kind"] == "word" or sum(durations) == 1, "no shares")
        value = exact(entry["value"])
    except (RejectedError, LookupError, TypeError, ValueError, ArithmeticError):
        return None
    return prove_again(quotient, entry["kind"], members, durations, value)


def _member(quotient: Quotient, entry: Mapping[str, Any]) -> Member:
    number = entry["mode"]
    need(type(number) is int and 0 <= number < len(quotient.modes), "no mode")
    mode, parts = quotient.family.modes[number], quotient.modes[number].parts
    levels, on = [], dict[tuple[int, int], Fraction]()
    for part, row in zip(parts, entries(entry["weights"], "weights", len(parts)), strict=True):
        low, high = mode.lower.fraction(part.edge), mode.upper.fraction(part.edge)
        level = (int(mode.sign[part.edge]) * exact(row[2]) - low) / (high - low)
        ends = int(mode.source[part.edge]), int(mode.target[part.edge])
        on[ends] = on.get(ends, Fraction(0)) + level
        need(0 <= level <= 1 and on[ends] <= 1, "no member of the family")
        levels.append(level)
    return Member(number, tuple(levels))
