"""Claims about restricted signals as sections of a certificate: written, and read back from an accepted file."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from functools import lru_cache
from typing import Any, cast

import numpy as np

from lmi.exact.numbers import longest
from ptcc_certify.bounds.final_state.constant_weights import ValueEnds
from ptcc_certify.certificate.constrained_switching.claims import (
    Claim,
    FinalValueClaim,
    LastModeClaim,
    RateClaim,
    ShareClaim,
    WindowClaim,
)
from ptcc_certify.certificate.functions import Proved, rates_of
from ptcc_certify.checker.common_forms import Multipliers
from ptcc_certify.checker.common_kernel_ends import EQUAL
from ptcc_certify.checker.constant_signal_ends import FinalValue, FinalValueSection
from ptcc_certify.checker.constrained_switching import (
    Dwell,
    KeptMean,
    LastModeSection,
    RateSection,
    Section,
    Shares,
    SharesSection,
    Windows,
    WindowsSection,
)
from ptcc_certify.checker.reading import Interval
from ptcc_certify.graphs.family import Mode
from ptcc_certify.graphs.structure import BIPARTITE_CONSENSUS, STABILITY, find_camps
from ptcc_certify.lyapunov.common_forms import CommonForm, Quotient, prove_ends
from ptcc_certify.lyapunov.mode_forms import ModeForms, ShareForm
from ptcc_certify.model.constrained_switching import ClockShares, DwellTime, JointWindows, SignalClass
from ptcc_certify.theorems.contractions import contraction
from ptcc_certify.theorems.family_behaviour import FamilyComponent
from ptcc_certify.theorems.theorem import Obligation

#: Bits of the middles and radii of final states, which are rounded outwards.
_BITS = 64


def signals_section(signal: SignalClass) -> Any:
    """Return a class of signals as files have it."""
    if isinstance(signal, ClockShares):
        return Shares(shares=signal.shares)
    if isinstance(signal, JointWindows):
        return Windows(window=signal.length, on=signal.on)
    if isinstance(signal, DwellTime):
        return Dwell(dwell=signal.least, clock=cast(Any, signal.clock))
    return signal


@lru_cache(maxsize=100)  # the ends of agents that agree are the same
def ball(low: Fraction, high: Fraction) -> Interval:
    """Return ends as a middle and a radius, rounded outwards.

    Examples
    --------
    >>> ball(Fraction(1), Fraction(1)), ball(Fraction(1), Fraction(2))
    ((Fraction(1, 1), Fraction(0, 1)), (Fraction(3, 2), Fraction(1, 2)))
    """
    if low == high:
        return low, Fraction(0)
    size = max(abs(low), abs(high))
    unit = Fraction(2) ** (longest([size.numerator]) - longest([size.denominator]) - _BITS)
    below, above = low // unit, -(-high // unit)
    return (below + above) * unit / 2, (above - below) * unit / 2


def claim_section(claim: Claim, nodes: np.ndarray, labels: Sequence[str]) -> Section:
    """Return a claim about the component of the agents of these places and labels."""
    about: dict[str, Any] = {"signals": signals_section(claim.signal), "component": claim.component}
    if isinstance(claim, FinalValueClaim):
        modes = [None if ends is None else _value(ends, labels) for ends in claim.values]
        return FinalValueSection(claim="final value", **about, modes=modes)
    if isinstance(claim, RateClaim):
        forms = None if claim.forms is None else claim.forms.matrices
        bounded = True if claim.bounded else None
        return RateSection(claim="rate", **about, forms=forms, ratio=claim.ratio, rate=claim.rate, bounded=bounded)
    ends = claim.final_states
    final = None if ends is None else {label: ball(*pair) for label, pair in zip(labels, ends, strict=True)}
    if isinstance(claim, ShareClaim):
        form = claim.form.function
        return SharesSection(
            claim="shares",
            **about,
            nodes=nodes[list(form.nodes)],
            form=form.matrix,
            rate=claim.rate,
            behaviour=claim.behaviour,
            final_state=final,
        )
    if isinstance(claim, LastModeClaim):
        return LastModeSection(claim="last mode", **about, modes=list(claim.behaviours), final_state=final)
    return WindowsSection(claim="windows", **about, behaviour=claim.behaviour, eta=claim.rate.eta, final_state=final)


def _value(ends: ValueEnds, labels: Sequence[str]) -> FinalValue:
    names = [labels[v] for v in ends.nodes]
    above, below = (None if h is None else dict(zip(names, h, strict=True)) for h in ends.vectors or (None, None))
    return FinalValue(lower=ends.lower, upper=ends.upper, within=ends.within, above=above, below=below)


def claim_steps(of: str, claim: Claim, labels: Sequence[str]) -> Iterator[Obligation]:
    """Yield the obligations of a claim about the agents ``labels`` that have numbers or a witness."""
    if isinstance(claim, ShareClaim):
        V = claim.form.function
        for mode, (rate, tau, rests) in enumerate(zip(V.rates, V.multipliers, claim.form.at_rest, strict=True)):
            witness = None if rests else Multipliers(multipliers=tau)
            yield Obligation("family-rate", f"{of}.modes[{mode}]", {"b": rate}, witness)
        if claim.mean is not None:
            q = {label: x for label, x in zip(labels, claim.mean, strict=True) if x}
            yield Obligation("clock-shares", of, witness=KeptMean(mean=q))
    elif isinstance(claim, RateClaim) and claim.forms is not None:
        for mode, (rate, tau) in enumerate(zip(claim.forms.rates, claim.forms.multipliers, strict=True)):
            yield Obligation("family-rate", f"{of}.modes[{mode}]", {"b": rate}, Multipliers(multipliers=tau))


def read_signals(entry: Any) -> SignalClass:
    """Return a class of signals that files name."""
    if isinstance(entry, Shares):
        return ClockShares(tuple(entry.shares))
    if isinstance(entry, Windows):
        return JointWindows(entry.window, on=entry.on, clock="s")
    return DwellTime(entry.dwell, clock=entry.clock) if isinstance(entry, Dwell) else entry


def read_claim(of: str, entry: Section, proved: Proved, components: Sequence[FamilyComponent]) -> Claim:
    """Return a claim of a certificate that was accepted; about one of its components."""
    number = entry.component
    signal = read_signals(entry.signals)
    component = components[entry.component]
    steps = rates_of(of, proved)
    if isinstance(entry, FinalValueSection):
        pairs = zip(entry.modes, component.family.modes, strict=True)
        return FinalValueClaim(
            number, tuple(None if value is None else _read_value(value, mode) for value, mode in pairs)
        )
    if isinstance(entry, RateSection):
        forms = None
        if entry.forms is not None:
            forms = ModeForms(
                tuple(list(map(list, P)) for P in entry.forms),
                tuple(step["b"] for step in steps),
                tuple(tuple(step["witness"].multipliers) if step["witness"] else () for step in steps),
                entry.ratio,
            )
        return RateClaim(number, signal, forms, entry.rate, bool(entry.bounded))
    final = entry.final_state
    ends = None if final is None else tuple((m - r, m + r) for m, r in final.values())
    if isinstance(entry, LastModeSection):
        return LastModeClaim(number, signal, tuple(entry.modes), ends)
    if isinstance(entry, WindowsSection):
        assert isinstance(signal, JointWindows), "the check has verified what a claim is about"
        rate = contraction(component.nodes.size, signal, entry.behaviour, entry.eta)
        return WindowClaim(number, signal, entry.behaviour, rate, ends)
    assert isinstance(signal, ClockShares), "the check has verified what a claim is about"
    witness = proved["clock-shares", of]["witness"]
    labels = component.family.labels
    mean = None
    if witness is not None and witness.mean != EQUAL:
        mean = tuple(witness.mean.get(label, Fraction(0)) for label in labels)
    return ShareClaim(number, signal, _read_share_form(entry, steps, component), entry.rate, ends, mean)


def _read_value(entry: FinalValue, mode: Mode) -> ValueEnds:
    index, n = {label: v for v, label in enumerate(mode.labels)}, len(mode.labels)
    camps, _, _ = find_camps(n, mode.source, mode.target, mode.sign)
    ends = entry.lower, entry.upper, entry.within
    if entry.above is None or entry.below is None:
        return ValueEnds(tuple(camps.tolist()), tuple(range(n)), *ends, None)
    nodes = tuple(index[label] for label in entry.above)
    vectors = tuple(entry.above.values()), tuple(entry.below.values())
    return ValueEnds(tuple(camps.tolist()), nodes, *ends, vectors)


def _read_share_form(entry: SharesSection, steps: Sequence[Any], component: FamilyComponent) -> ShareForm:
    quotient = Quotient(component.family, component.kernel)
    matrix, witnesses = list(map(list, entry.form)), [step["witness"] for step in steps]
    ends = prove_ends(matrix)
    assert ends is not None, "the check has proved it definite"
    taus = tuple(() if witness is None else tuple(witness.multipliers) for witness in witnesses)
    function = CommonForm("full", quotient, matrix, tuple(step["b"] for step in steps), taus, *ends)
    behaviour = BIPARTITE_CONSENSUS if quotient.pivots else STABILITY
    return ShareForm(function, behaviour, tuple(witness is None for witness in witnesses))
