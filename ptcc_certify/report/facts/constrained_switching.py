"""Facts of signals: what holds for restricted ones, and of which signals a fact is."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from lmi.exact.decimal_rounding import down, near, up
from ptcc_certify.certificate.constrained_switching.claims import (
    FinalValueClaim,
    LastModeClaim,
    RateClaim,
    ShareClaim,
    WindowClaim,
)
from ptcc_certify.certificate.constrained_switching.reasons import TOO_SMALL, reasons_for_none
from ptcc_certify.certificate.fact import Fact, Facts
from ptcc_certify.errors import labelled
from ptcc_certify.graphs.family import Mode
from ptcc_certify.graphs.structure import BIPARTITE_CONSENSUS, CONSENSUS, CONTAINMENT
from ptcc_certify.model.constrained_switching import ClockShares, DwellTime, JointWindows, SignalClass
from ptcc_certify.report.text_layout import agent_text, printable
from ptcc_certify.theorems.family_behaviour import DEPENDS, GENERAL, mode_name

if TYPE_CHECKING:
    from ptcc_certify.certificate.certificate import Certificate

#: The power of 10 below which what shrinks is not told as a number.
TINY = -100
#: What agents do in a mode without edges, an outage.
RESTS = "every agent keeps its value"
CLOCK = {"t": "time", "s": "the clock"}


def signal_facts(certificate: Certificate) -> Facts:
    """Yield what is proved for restricted signals, component after component.

    Examples
    --------
    >>> unsure = Family.from_intervals([("a", "b", 1, 2), ("b", "a", -2, -1)])
    >>> cert = certify(unsure, NominalProtocol(T=1, rho1=1, rho2=1, kappa=3), signal="constant")
    >>> print(next(signal_facts(cert)).text)
    if mode and weights never change: rate 1.58578, as for every signal; nothing more is proved

    Where agents end then is told by :mod:`ptcc_certify.certificate.constrained_switching.final_states`.
    """
    proof = certificate.family_proof
    if proof.signal == "any":
        return
    head = signal_text(proof.signal)
    if isinstance(proof.signal, DwellTime) and proof.signal.clock == "t":
        longer = proof.signal.least > certificate.protocol.T
        head = head[0], head[1] + (", longer than T: at most one switch" if longer else "")
    several = len(proof.parts) > 1

    def where(component: int) -> str:
        name = agent_text(proof.parts[component].component.family.labels[0])
        return f"component of {name}: " if several else ""

    none = reasons_for_none(certificate.family_proof)
    if not proof.restricted and not none:
        yield Fact(head=head[0], note=f"{head[1]}: nothing more is proved")
    for number, (reason, _) in none.items():
        yield Fact(head=head[0], note=f"{where(number)}{head[1]}: {reason}")
    for claim in proof.restricted:
        if claim.component in none or (isinstance(claim, FinalValueClaim) and not _stands_alone(certificate, claim)):
            continue
        if isinstance(claim, LastModeClaim | FinalValueClaim):
            text = _last_mode_text(certificate, claim)
        elif isinstance(claim, ShareClaim):
            text = _share_text(certificate, claim)
        else:
            text = _window_text(claim) if isinstance(claim, WindowClaim) else _rate_text(certificate, claim)
        yield Fact(head=head[0], note=f"{where(claim.component)}{head[1]}: {text}")


def every_text(certificate: Certificate) -> str:
    """Tell apart what holds for every signal where more is claimed of some."""
    return "" if certificate.family_proof.signal == "any" else " (every signal)"


def signal_text(signal: SignalClass) -> tuple[str, str]:
    """Name restricted signals: the word at the beginning of a line, and the condition.

    Examples
    --------
    >>> signal_text(DwellTime("0.5", clock="t"))
    ('dwell', 'at least 0.5 of time between switches')
    """
    if isinstance(signal, DwellTime):
        return "dwell", f"at least {near(signal.least, 6)} of {CLOCK[signal.clock]} between switches"
    if isinstance(signal, ClockShares):
        return "shares", f"modes at {', '.join(near(share, 4) for share in signal.shares)} of the clock"
    if isinstance(signal, JointWindows):
        return "windows", f"each edge on for {near(signal.on, 6)} of every {near(signal.length, 6)} of the clock"
    return "constant", "if mode and weights never change"


def _stands_alone(certificate: Certificate, claim: FinalValueClaim) -> bool:
    """Tell whether no other claim says what single modes do to a component whose end depends on the signal."""
    depends = certificate.family_proof.parts[claim.component].component.behaviour == DEPENDS
    return depends and claim.component not in certificate.family_proof.ends_of_signal


def _last_mode_text(certificate: Certificate, claim: LastModeClaim | FinalValueClaim) -> str:
    """Tell what the last mode does, of each mode where they differ."""
    own = claim.behaviours
    begin = "the last mode decides" if len(own) > 1 and claim.signal != "constant" else ""
    unknown = "rest where the weights say" if claim.signal == "constant" else "no limit while weights move"
    if isinstance(claim, FinalValueClaim):
        unknown = "nothing is claimed"
    modes = certificate.family_proof.parts[claim.component].component.family.modes
    pairs = zip(own, modes, strict=True)
    behaviours = [of_mode(behaviour, mode, unknown) for behaviour, mode in pairs]
    late = "; how near by when depends on the last switch" if begin else "; how near by when is not proved"
    if len(set(behaviours)) == 1:
        camps = ", camps of that mode" if begin and own[0] == BIPARTITE_CONSENSUS else ""
        return f"{begin}: {behaviours[0]}{camps}{late}".removeprefix(": ")
    names = (labelled(printable(mode_name(certificate.family_proof.family, k))) for k in range(len(behaviours)))
    each = "; ".join(f"{name}: {behaviour}" for name, behaviour in zip(names, behaviours, strict=True))
    return f"{begin}: {each}{late}".removeprefix(": ")


def of_mode(behaviour: str | None, mode: Mode, unknown: str = "") -> str:
    """Name what the last mode does; no average of ``x(0)``, which is not where it begins."""
    if not mode.n_edges:
        return RESTS
    if behaviour is None or (mode.sign < 0).any():
        return behaviour or unknown
    return {GENERAL[name]: name for name in (CONSENSUS, CONTAINMENT)}.get(behaviour, behaviour)


def _window_text(claim: WindowClaim) -> str:
    rate = claim.rate
    size = math.log10(rate.eta.numerator) - math.log10(rate.eta.denominator)
    left = math.floor(math.log10(rate.multiple) + rate.exponent * size)
    if left < TINY:
        return f"{claim.behaviour}; {TOO_SMALL}"
    in_each = f"in every {near(rate.window, 6)} of the clock"
    return f"{claim.behaviour}; what is left shrinks by 1e{left} of it, or more, {in_each}"


def _share_text(certificate: Certificate, claim: ShareClaim) -> str:
    names = (
        labelled(printable(mode_name(certificate.family_proof.family, k)))
        for k in range(len(certificate.family_proof.family.modes))
    )
    own = map(down, claim.form.function.rates)
    each = ", ".join(f"{name} {rate}" for name, rate in zip(names, own, strict=True))
    late = "how near by when depends on how far the shares stray"
    return f"{claim.behaviour}, rate {down(claim.rate)}; of each: {each}; {late}"


def rests(certificate: Certificate) -> bool:
    """Tell whether the signals that were asked for bring all agents to rest whose end depends on the signal."""
    claims = certificate.family_proof.ends_of_signal.values()
    return not any(isinstance(claim, LastModeClaim) and None in claim.behaviours for claim in claims)


def agreement_text(certificate: Certificate) -> str:
    """Tell that all agents end at one value, up to camps, where every mode that may be the last one sees to it.

    The ends between which they stay bound that value; they do not say that the agents agree.

    Examples
    --------
    >>> both, one, rivals = ([("a", "b", 1), ("b", "a", 1)], [("a", "b", 1)], [("a", "b", -1), ("b", "a", -1)])
    >>> for pair in ([both, one], [both, rivals]):
    ...     family = Family.switching([SignedDigraph.from_edges(edges) for edges in pair])
    ...     cert = certify(family, NominalProtocol(T=1, rho1=1, rho2=1, kappa=2), [3, 1], signal=DwellTime("0.1"))
    ...     print(cert.parts[0].component.behaviour + agreement_text(cert))
    bipartite consensus
    depends on the signal, all at one |x(T)|
    """
    proof = certificate.family_proof
    of_one = len(proof.parts) == 1
    claims = [claim for claim in proof.ends_of_signal.values() if of_one and isinstance(claim, LastModeClaim)]
    if not claims or {*claims[0].behaviours} != {BIPARTITE_CONSENSUS}:
        return ""
    signs = (mode.sign for mode in proof.parts[0].component.family.modes)
    return ", all at one value" if all((sign > 0).all() for sign in signs) else ", all at one |x(T)|"


def _rate_text(certificate: Certificate, claim: RateClaim) -> str:
    if claim.forms is None:
        more = "" if claim.component in certificate.family_proof.final_values else "; nothing more is proved"
        return f"rate {down(claim.rate)}, as for every signal{more}"
    text = f"rate {down(claim.rate)}" if claim.rate > 0 else "no rate is proved"
    if claim.ratio > 1 and isinstance(claim.signal, DwellTime):
        text += f", V up to {up(claim.ratio, 3)} times"
        if claim.signal.clock == "t":
            most = claim.signal.switches(certificate.protocol.T)
            text += " at the one switch" if most == 1 else f" at each of {most} switches at most"
        else:
            text += " V(0)"
    return f"{text}, input bounded" if claim.bounded else text
