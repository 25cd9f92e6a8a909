"""Claims for restricted signals in the file of a family's certificate, their obligations, and how they are read."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from typing import Any

from lmi.exact.numbers import longest
from ptcc_certify.certificate.restricted_claims import Claim, LastModeClaim, RateClaim
from ptcc_certify.checker.reading import exact, interval, triangle
from ptcc_certify.graphs.rationals import format_exact
from ptcc_certify.lyapunov.mode_forms import ModeForms
from ptcc_certify.theorems.restricted_signals import DwellTime, SignalClass

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
    size = max(abs(low), abs(high))
    unit = Fraction(2) ** (longest([size.numerator]) - longest([size.denominator]) - _BITS)
    below, above = low // unit, -(-high // unit)
    return {"mid": format_exact((below + above) * unit / 2), "radius": format_exact((above - below) * unit / 2)}


def claim_entry(claim: Claim, labels: Sequence[str]) -> dict[str, Any]:
    """Return a claim about the component of the agents ``labels`` as JSON."""
    if isinstance(claim, LastModeClaim):
        ends = claim.final_states
        return {
            "claim": "last mode",
            "signals": signal_entry(claim.signal),
            "component": claim.component,
            "modes": list(claim.behaviours),
            "final_state": None if ends is None else {v: enclosed(*pair) for v, pair in zip(labels, ends, strict=True)},
        }
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


def _lower_triangle(P: Sequence[Sequence[Any]]) -> list[list[str]]:
    return [[format_exact(x) for x in row[: i + 1]] for i, row in enumerate(P)]


def claim_steps(of: str, claim: Claim) -> Iterator[Step]:
    """Yield kind, place, witness and numbers of the obligations of a claim."""
    if isinstance(claim, LastModeClaim):
        yield "last-mode", of, None, {}
        return
    if claim.forms is not None:
        for mode, (rate, tau) in enumerate(zip(claim.forms.rates, claim.forms.multipliers, strict=True)):
            witness = {"multipliers": [format_exact(x) for x in tau]}
            yield "family-rate", f"{of}.modes[{mode}]", witness, {"b": format_exact(rate)}
    yield "restricted-rate", of, None, {}


def read_claim(of: str, entry: Mapping[str, Any], proof: Sequence[Mapping[str, Any]]) -> Claim:
    """Return a claim of a certificate that was accepted."""
    said, forms = entry["signals"], None
    signal = said if isinstance(said, str) else DwellTime(exact(said["dwell"]), clock=said["clock"])
    if entry["claim"] == "last mode":
        ends = entry["final_state"] and tuple((m - r, m + r) for m, r in map(interval, entry["final_state"].values()))
        return LastModeClaim(entry["component"], signal, tuple(entry["modes"]), ends)
    if (triangles := entry["forms"]) is not None:
        steps = [x for x in proof if x["kind"] == "family-rate" and x["of"].startswith(f"{of}.modes[")]
        forms = ModeForms(
            tuple(triangle(lower, len(lower)) for lower in triangles),
            tuple(exact(step["numbers"]["b"]) for step in steps),
            tuple(tuple(map(exact, step["witness"]["multipliers"])) for step in steps),
            exact(entry["ratio"]),
        )
    return RateClaim(entry["component"], signal, forms, exact(entry["rate"]), bool(entry["bounded"]))
