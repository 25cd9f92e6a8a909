"""Searches what may be claimed of a family for restricted signals, dwell times or weights that never change, say.

Each claim is about one component, and stands beside what is claimed for every signal: a rate where states at rest are
common, an end where they differ.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction

from lmi.exact.elementary_enclosures import log, rounded
from lmi.search_time import share_of_time
from ptcc_certify.bounds.final_state.attracting_box import have_common_denominator
from ptcc_certify.bounds.final_state.constant_weights import ValueEnds, mean_of_shares, value_ends
from ptcc_certify.certificate.constrained_switching.claims import (
    Claim,
    FinalValueClaim,
    LastModeClaim,
    RateClaim,
    ShareClaim,
    WindowClaim,
)
from ptcc_certify.certificate.family_proof import ComponentProof
from ptcc_certify.checker.constrained_switching import MANY_CLAIMS, agreed_bounds, reachable_bounds
from ptcc_certify.errors import Change, HypothesisError, ParameterError
from ptcc_certify.graphs.family import Mode
from ptcc_certify.graphs.rationals import writable
from ptcc_certify.graphs.size_limits import EXACT_NODES
from ptcc_certify.graphs.structure import BIPARTITE_CONSENSUS, STABILITY
from ptcc_certify.lyapunov.common_forms import Quotient
from ptcc_certify.lyapunov.mode_forms import (
    ModeForms,
    search_mode_forms,
    search_share_form,
    search_single_forms,
    within_reach,
)
from ptcc_certify.model import Protocol
from ptcc_certify.model.constrained_switching import ClockShares, DwellTime, JointWindows, SignalClass
from ptcc_certify.theorems.contractions import joint_behaviour, window_rate
from ptcc_certify.theorems.family_behaviour import DEPENDS, FamilyComponent, last_mode_behaviours

STEP = "restricted signals"
#: 1 - t/T at which switches are weighed against the rate.
_WEIGHED = 0.01
#: Relative gain for which forms of their own are written, and bits of rates.
_GAIN, _RATE_BITS = 1e-6, 60
#: Shares of the price of a switch at which a rate that is asked for is looked for.
_CHEAPER = (0.3, 0.1, 0.01)
#: What is told with every claim of windows.
_OF_THE_CLOCK = (
    "the windows are of the stretched clock: in time they shrink towards T, and who switches at a fixed pace in time "
    "does not keep them"
)


def require_nominal(signal: SignalClass, protocol: Protocol) -> None:
    """Refuse restricted signals under the sliding-mode protocol; of constant ones it is said where agents end."""
    if signal not in ("any", "constant") and protocol.reaching is not None:
        raise ParameterError(
            (
                "restricted signals are certified under the nominal protocol; leave out ",
                Change("signal"),
                ", or take the nominal protocol, NominalProtocol(..)",
            )
        )


def claims_for(
    signal: SignalClass,
    parts: Sequence[ComponentProof],
    protocol: Protocol,
    state: Sequence[Fraction] | None,
    notes: list[str],
    least: Fraction | None = None,
) -> tuple[Claim, ...]:
    """Return what is proved beside for restricted signals, component after component.

    Parameters
    ----------
    signal : SignalClass
    parts : sequence of ComponentProof
        What was proved for every signal.
    protocol : NominalProtocol or SlidingModeProtocol
        Under the latter only final values are claimed.
    state : sequence of N Fraction, or None
        None also where sliding variables move.
    notes : list of str
        Is told what the time limit cut off.
    least : Fraction, optional
        A rate that is asked for: under a dwell time in time one of it goes before one with a smaller constant.
    """
    if signal == "any":
        return ()
    claims: list[Claim] = []
    for number, part in enumerate(parts if protocol.reaching is None else ()):
        if part.component.nodes.size == 1 or part.component.behaviour is None:
            continue
        if isinstance(signal, ClockShares):
            claims += filter(None, [_share_claim(number, signal, part, state, notes)])
        elif part.component.behaviour == DEPENDS:
            if isinstance(signal, JointWindows):
                claims += filter(None, [_window_claim(number, signal, part, state)])
            elif not isinstance(signal, DwellTime) or signal.clock == "t":
                claims.append(_last_mode_claim(number, signal, part, state))
        elif not isinstance(signal, JointWindows) and (
            claim := _rate_claim(number, signal, part, protocol, notes, least)
        ):
            claims.append(claim)
    if any(isinstance(claim, WindowClaim) for claim in claims):
        notes.append(_OF_THE_CLOCK)
    if signal == "constant" and state is not None:
        with share_of_time(1.0, STEP, notes):
            claims += filter(None, (_final_value_claim(number, part, state) for number, part in enumerate(parts)))
    if len(claims) > MANY_CLAIMS:
        claims.sort(key=lambda claim: isinstance(claim, RateClaim) and claim.forms is None)  # those say least
        notes.append(f"{len(claims):,} claims for restricted signals: the first {MANY_CLAIMS} are written")
    return tuple(claims[:MANY_CLAIMS])


def _final_value_claim(number: int, part: ComponentProof, state: Sequence[Fraction]) -> FinalValueClaim | None:
    """Return where a component ends if nothing changes; None where that is nowhere known, or for every signal."""
    component, x = part.component, [state[v] for v in part.component.nodes.tolist()]
    if component.nodes.size == 1 or component.behaviour not in (BIPARTITE_CONSENSUS, DEPENDS):
        return None
    if not have_common_denominator(x) or any(group.final_value(x) is not None for group in part.leading_groups):
        return None
    values = tuple(_value_ends(mode, x) for mode in component.family.modes)
    return FinalValueClaim(number, values) if any(values) else None


def _value_ends(mode: Mode, x: Sequence[Fraction]) -> ValueEnds | None:
    try:
        return value_ends(mode, x)
    except HypothesisError:
        return None


def _rate_claim(
    number: int, signal: SignalClass, part: ComponentProof, protocol: Protocol, notes: list[str], least: Fraction | None
) -> RateClaim | None:
    best, forms = part.rate, None
    own = list(part.forms)
    price = switch_price(signal, protocol)
    asked = least if isinstance(signal, DwellTime) and signal.clock == "t" else None
    with share_of_time(1.0, STEP, notes):
        if part.component.nodes.size <= EXACT_NODES and within_reach(quotient := Quotient.of(part.component)):
            forms = search_single_forms(quotient) if price == 0 else search_mode_forms(quotient, price, own)
            for cheaper in _CHEAPER:  # switches cost no rate in time, only a constant
                if asked is None or asked <= max(best or 0, forms.rate if forms else 0):
                    break
                forms = search_mode_forms(quotient, price * cheaper, own) or forms
    wanted = forms is not None and asked is not None and forms.rate >= asked > (best or 0)
    if not wanted and forms and best is not None and _worth(forms, price) <= float(best) + _GAIN * abs(float(best)):
        forms = None
    rate = best if forms is None else own_rate(signal, forms)
    return None if rate is None else RateClaim(number, signal, forms, rate, rate * protocol.gain.pole >= 2)


def _share_claim(
    number: int, signal: ClockShares, part: ComponentProof, state: Sequence[Fraction] | None, notes: list[str]
) -> ShareClaim | None:
    with share_of_time(1.0, STEP, notes):
        known = [V for V in part.forms if V.kind != "undirected"]
        form = search_share_form(part.component, signal.shares, known)
        if form is None:
            return None
        claim = ShareClaim(number, signal, form, form.mean(signal.shares))
        if state is None or claim.behaviour is None or part.component.behaviour != DEPENDS:
            return claim
        return _with_ends(claim, part.component, [state[v] for v in part.component.nodes.tolist()])
    return None


def _with_ends(claim: ShareClaim, component: FamilyComponent, x: Sequence[Fraction]) -> ShareClaim:
    """Add where the agents end: at one value that a kept mean tells, or within all their bounds; or at 0."""
    camps = None if claim.behaviour == STABILITY else component.gauge
    if camps is not None and (group := mean_of_shares(component, claim.signal.shares)) is not None:
        q = tuple(Fraction(p * g) for p, g in zip(group.vector or (), group.camps, strict=True))
        c = group.final_value(x)
        if c is not None and all(map(writable, (c, *q))):
            return replace(claim, final_states=tuple((g * c, g * c) for g in group.camps), mean=q)
    edges = zip(*(end.tolist() for end in component.family.union), strict=True)
    signs = None if camps is None else dict(enumerate(camps.tolist()))
    return replace(claim, final_states=tuple(agreed_bounds(range(len(x)), edges, x, signs).values()))


def _window_claim(
    number: int, signal: JointWindows, part: ComponentProof, state: Sequence[Fraction] | None
) -> WindowClaim | None:
    component, bounds = part.component, None
    behaviour = joint_behaviour(component)
    rate = None if behaviour is None else window_rate(component, signal, behaviour)
    if behaviour is None or rate is None:
        return None
    if state is not None:
        edges = zip(*(end.tolist() for end in component.family.union), strict=True)
        x = [state[v] for v in component.nodes.tolist()]
        camps = None if behaviour == STABILITY else dict(enumerate(component.gauge.tolist()))  # type: ignore[union-attr]
        bounds = tuple(agreed_bounds(range(len(x)), edges, x, camps).values())
    return WindowClaim(number, signal, behaviour, rate, bounds)


def _last_mode_claim(
    number: int, signal: SignalClass, part: ComponentProof, state: Sequence[Fraction] | None
) -> LastModeClaim:
    component, bounds = part.component, None
    if state is not None:
        edges = zip(*(end.tolist() for end in component.family.union), strict=True)
        x = [state[v] for v in component.nodes.tolist()]
        bounds = tuple(reachable_bounds(range(len(x)), edges, x).values())
    return LastModeClaim(number, signal, last_mode_behaviours(component), bounds)


def switch_price(signal: SignalClass, protocol: Protocol) -> float:
    """Return the switches per unit of the stretched clock: all of them, or those until 0.99 T.

    Examples
    --------
    >>> switch_price(DwellTime("0.5", clock="s"), NominalProtocol(T=1, rho1=1, rho2=1, kappa=3))
    2.0
    """
    if not isinstance(signal, DwellTime):
        return 0.0
    if signal.clock == "s":
        return float(1 / signal.least)
    return signal.switches(protocol.T) / float(protocol.gain.clock_at_remaining(_WEIGHED))


def _worth(forms: ModeForms, price: float) -> float:
    return float(forms.rate) - price * float(log(forms.ratio)[1])


def own_rate(signal: SignalClass, forms: ModeForms) -> Fraction:
    """Return the rate that forms of each mode prove: the least of theirs, minus ``ln(ratio)/dwell`` on the clock.

    Examples
    --------
    >>> forms = ModeForms((), (Fraction(3), Fraction(2)), (), Fraction(2))
    >>> own_rate("constant", forms), float(own_rate(DwellTime(1, clock="s"), forms))
    (Fraction(2, 1), 1.3068528194400546)
    """
    if not isinstance(signal, DwellTime) or signal.clock == "t":
        return forms.rate
    loss = log(forms.ratio)[1] / signal.least
    return forms.rate - rounded(loss, _RATE_BITS, up=True)
