"""Claims for restricted signals in the file of a family's certificate, their obligations, and how they are read."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from functools import lru_cache
from typing import Any

from lmi.exact.numbers import longest
from ptcc_certify.bounds.family_final_state import ValueEnds
from ptcc_certify.certificate.restricted_claims import (
    Claim,
    FinalValueClaim,
    LastModeClaim,
    RateClaim,
    ShareClaim,
    WindowClaim,
)
from ptcc_certify.checker.reading import Interval, exact, interval, triangle
from ptcc_certify.graphs.family import Mode
from ptcc_certify.graphs.rationals import format_exact
from ptcc_certify.graphs.structure import BIPARTITE_CONSENSUS, STABILITY, find_camps
from ptcc_certify.lyapunov.clock_shares import ShareForm
from ptcc_certify.lyapunov.family_function import FamilyFunction, prove_ends
from ptcc_certify.lyapunov.mode_forms import ModeForms
from ptcc_certify.protocols.restricted_signals import ClockShares, DwellTime, JointWindows, SignalClass
from ptcc_certify.theorems.family_behaviour import FamilyComponent
from ptcc_certify.theorems.joint_windows import contraction

#: Bits of the middles and radii of final states, which are rounded outwards.
_BITS = 64
Step = tuple[str, str, Any, dict[str, str]]


def signal_entry(signal: SignalClass) -> Any:
    """Return a class of signals as JSON.

    Examples
    --------
    >>> signal_entry(DwellTime("0.5", clock="t"))
    {'dwell': '1/2', 'clock': 't'}
    """
    if isinstance(signal, ClockShares):
        return {"shares": [format_exact(share) for share in signal.shares]}
    if isinstance(signal, JointWindows):
        return {"window": format_exact(signal.length), "on": format_exact(signal.on)}
    if isinstance(signal, DwellTime):
        return {"dwell": format_exact(signal.least), "clock": signal.clock}
    return signal


def enclosed(low: Fraction, high: Fraction) -> Any:
    """Write ends as a middle and a radius, rounded outwards.

    Examples
    --------
    >>> enclosed(Fraction(1), Fraction(1)), enclosed(Fraction(1), Fraction(2))
    ('1', {'mid': '3/2', 'radius': '1/2'})
    """
    if low == high:
        return format_exact(low)
    return dict(zip(("mid", "radius"), _ball(low, high), strict=True))


@lru_cache(maxsize=100)  # the ends of agents that agree are the same
def _ball(low: Fraction, high: Fraction) -> tuple[str, str]:
    size = max(abs(low), abs(high))
    unit = Fraction(2) ** (longest([size.numerator]) - longest([size.denominator]) - _BITS)
    below, above = low // unit, -(-high // unit)
    return format_exact((below + above) * unit / 2), format_exact((above - below) * unit / 2)


def claim_entry(claim: Claim, labels: Sequence[str]) -> dict[str, Any]:
    """Return a claim about the component of the agents ``labels`` as JSON."""
    if isinstance(claim, ShareClaim):
        return {
            "claim": "shares",
            "signals": signal_entry(claim.signal),
            "component": claim.component,
            "nodes": [labels[v] for v in claim.form.function.nodes],
            "form": _lower_triangle(claim.form.function.matrix),
            "rate": format_exact(claim.rate),
            "behaviour": claim.behaviour,
            **({} if claim.final_states is None else {"final_state": _ends_entry(claim.final_states, labels)}),
        }
    if isinstance(claim, FinalValueClaim):
        modes = [None if ends is None else _value_entry(ends, labels) for ends in claim.values]
        signals = {"claim": "final value", "signals": signal_entry(claim.signal)}
        return {**signals, "component": claim.component, "modes": modes}
    if not isinstance(claim, RateClaim):
        ends = claim.final_states
        about = {"signals": signal_entry(claim.signal), "component": claim.component}
        final = None if ends is None else _ends_entry(ends, labels)
        if isinstance(claim, LastModeClaim):
            return {"claim": "last mode", **about, "modes": list(claim.behaviours), "final_state": final}
        more = {"behaviour": claim.behaviour, "eta": format_exact(claim.rate.eta)}
        return {"claim": "windows", **about, **more, "final_state": final}
    forms = claim.forms
    return {
        "claim": "rate",
        "signals": signal_entry(claim.signal),
        "component": claim.component,
        "forms": None if forms is None else [_lower_triangle(P) for P in forms.matrices],
        "ratio": format_exact(claim.ratio),
        "rate": format_exact(claim.rate),
        "bounded": True if claim.bounded else None,
    }


def _ends_entry(ends: Sequence[Interval], labels: Sequence[str]) -> dict[str, Any]:
    return {label: enclosed(*pair) for label, pair in zip(labels, ends, strict=True)}


def _value_entry(ends: ValueEnds, labels: Sequence[str]) -> dict[str, Any]:
    names = [labels[v] for v in ends.nodes]
    entry: dict[str, Any] = {key: format_exact(getattr(ends, key)) for key in ("lower", "upper", "within")}
    for key, h in zip(("above", "below"), ends.vectors or (None, None), strict=True):
        entry[key] = None if h is None else dict(zip(names, map(format_exact, h), strict=True))
    return entry


def _lower_triangle(P: Sequence[Sequence[Any]]) -> list[list[str]]:
    return [[format_exact(x) for x in row[: i + 1]] for i, row in enumerate(P)]


def claim_steps(of: str, claim: Claim, labels: Sequence[str]) -> Iterator[Step]:
    """Yield kind, place, witness and numbers of the obligations of a claim about the agents ``labels``."""
    if isinstance(claim, ShareClaim):
        V = claim.form.function
        for mode, (rate, tau, rests) in enumerate(zip(V.rates, V.multipliers, claim.form.at_rest, strict=True)):
            witness = None if rests else {"multipliers": [format_exact(x) for x in tau]}
            yield "family-rate", f"{of}.modes[{mode}]", witness, {"b": format_exact(rate)}
        q = None if claim.mean is None else {v: format_exact(x) for v, x in zip(labels, claim.mean, strict=True) if x}
        yield "clock-shares", of, None if q is None else {"mean": q}, {}
    elif isinstance(claim, RateClaim) and claim.forms is not None:
        for mode, (rate, tau) in enumerate(zip(claim.forms.rates, claim.forms.multipliers, strict=True)):
            witness = {"multipliers": [format_exact(x) for x in tau]}
            yield "family-rate", f"{of}.modes[{mode}]", witness, {"b": format_exact(rate)}


def _read_signal(entry: Any) -> SignalClass:
    if isinstance(entry, str):
        return entry
    if "shares" in entry:
        return ClockShares(tuple(map(exact, entry["shares"])))
    if "window" in entry:
        return JointWindows(exact(entry["window"]), on=exact(entry["on"]), clock="s")
    return DwellTime(exact(entry["dwell"]), clock=entry["clock"])


def read_claim(
    of: str, entry: Mapping[str, Any], proof: Sequence[Mapping[str, Any]], components: Sequence[FamilyComponent]
) -> Claim:
    """Return a claim of a certificate that was accepted; about one of its components."""
    size = components[entry["component"]].nodes.size
    number, signal, forms = entry["component"], _read_signal(entry["signals"]), None
    steps = [x for x in proof if x["kind"] == "family-rate" and x["of"].startswith(f"{of}.modes[")]
    if entry["claim"] == "shares":
        assert isinstance(signal, ClockShares), "the check has verified what a claim is about"
        form, labels = _read_share_form(entry, steps, components[number]), components[number].family.labels
        ends = None if "final_state" not in entry else _read_ends(entry["final_state"])
        last = next(step for step in proof if step["kind"] == "clock-shares" and step["of"] == of)
        mean = last["witness"] and tuple(exact(last["witness"]["mean"].get(label, "0")) for label in labels)
        return ShareClaim(number, signal, form, exact(entry["rate"]), ends, mean)
    if entry["claim"] == "final value":
        pairs = zip(entry["modes"], components[number].family.modes, strict=True)
        return FinalValueClaim(
            number, tuple(None if value is None else _read_value(value, mode) for value, mode in pairs)
        )
    if entry["claim"] != "rate":
        ends = entry["final_state"] and _read_ends(entry["final_state"])
        if entry["claim"] == "last mode":
            return LastModeClaim(number, signal, tuple(entry["modes"]), ends)
        assert isinstance(signal, JointWindows), "the check has verified what a claim is about"
        behaviour, eta = entry["behaviour"], exact(entry["eta"])
        return WindowClaim(number, signal, behaviour, contraction(size, signal, behaviour, eta), ends)
    if (triangles := entry["forms"]) is not None:
        forms = ModeForms(
            tuple(triangle(lower, len(lower)) for lower in triangles),
            tuple(exact(step["numbers"]["b"]) for step in steps),
            tuple(tuple(map(exact, step["witness"]["multipliers"])) if step["witness"] else () for step in steps),
            exact(entry["ratio"]),
        )
    return RateClaim(entry["component"], signal, forms, exact(entry["rate"]), bool(entry["bounded"]))


def _read_ends(section: Mapping[str, Any]) -> tuple[Interval, ...]:
    return tuple((m - r, m + r) for m, r in map(interval, section.values()))


def _read_value(entry: Mapping[str, Any], mode: Mode) -> ValueEnds:
    index, n = {label: v for v, label in enumerate(mode.labels)}, len(mode.labels)
    camps, _, _ = find_camps(n, mode.source, mode.target, mode.sign)
    lower, upper, within = (exact(entry[key]) for key in ("lower", "upper", "within"))
    if entry["above"] is None:
        return ValueEnds(tuple(camps.tolist()), tuple(range(n)), lower, upper, within, None)
    vectors = tuple(tuple(map(exact, entry[key].values())) for key in ("above", "below"))
    nodes = tuple(index[label] for label in entry["above"])
    return ValueEnds(tuple(camps.tolist()), nodes, lower, upper, within, (vectors[0], vectors[1]))


def _read_share_form(
    entry: Mapping[str, Any], steps: Sequence[Mapping[str, Any]], component: FamilyComponent
) -> ShareForm:
    index = {label: v for v, label in enumerate(component.family.labels)}
    nodes = tuple(index[label] for label in entry["nodes"])
    pivots = tuple(v for v in range(component.nodes.size) if v not in set(nodes))
    matrix, witnesses = triangle(entry["form"], len(nodes)), [step["witness"] for step in steps]
    ends = prove_ends(matrix)
    assert ends is not None, "the check has proved it definite"
    rates = tuple(exact(step["numbers"]["b"]) for step in steps)
    taus = tuple(() if witness is None else tuple(map(exact, witness["multipliers"])) for witness in witnesses)
    function = FamilyFunction("full", pivots, nodes, matrix, rates, taus, *ends)
    behaviour = BIPARTITE_CONSENSUS if pivots else STABILITY
    return ShareForm(function, behaviour, tuple(witness is None for witness in witnesses))
