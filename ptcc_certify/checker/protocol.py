"""Verifies the parameters of the protocol, and when the sliding variables are 0."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Literal

from lmi.exact.elementary_enclosures import decay_integrals_below
from lmi.exact.numbers import shorten
from lmi.exact.work import spend
from ptcc_certify.checker.digraph import Digraph
from ptcc_certify.checker.document import Document
from ptcc_certify.checker.graph import proved_above
from ptcc_certify.checker.input_formulas import PrescribedGain, Reaching
from ptcc_certify.checker.reading import RejectedError, need
from ptcc_certify.checker.section_declarations import ByAgent, FewAgents, NotNegative, Positive
from ptcc_certify.checker.side_files import Numbers

SLIDING_BOUND = "||sigma(t)|| <= phi(t,T_r)^(-mu3) e^(-mu2 t) ||sigma(0)||"
SLIDING_CLOCK = "z = ln(T_r / (T_r - t)); null: certain at T_r only"
#: Bits of the bounds that prove reaching times.
REACHING_BITS = 64
#: Products of short integers that an instant of a reaching time costs, about.
EACH_INSTANT = 12_000


def nominal_gain(gains: Mapping[str, Fraction]) -> PrescribedGain:
    """Return the gain of the nominal part of the input."""
    T = gains["T_r"] + gains["T_s"] if "T_r" in gains else gains["T"]
    return PrescribedGain(T, gains["rho1"], gains["rho2"] * gains["kappa"])


def reaching_of(gains: Mapping[str, Fraction], sigma0: Sequence[Fraction], z: Fraction | None) -> Reaching:
    """Return how sliding variables move until all are 0, at ``z`` or ``T_r``."""
    power, push = gains["mu3"] * gains["kappa"], gains["mu1"] + gains["delta"]
    return Reaching(sigma0, gains["T_r"], gains["T_s"], gains["mu2"], power, push, z)


def last_time(times: Sequence[Fraction | None], sigma0: Iterable[Fraction]) -> Fraction | None:
    """Return the last reaching time of the sliding variables that are not 0 at first; None: ``T_r``."""
    own = [z for z, s in zip(times, sigma0, strict=True) if s]
    return None if None in own else max((z for z in own if z is not None), default=Fraction(0))


@dataclass(frozen=True)
class Protocol:
    """The parameters by name, and whether the protocol is the sliding-mode one."""

    sliding: bool
    gains: dict[str, Fraction]

    @cached_property
    def gain(self) -> PrescribedGain:
        """The gain of the nominal part of the input."""
        return nominal_gain(self.gains)


@dataclass(frozen=True, kw_only=True)
class NominalSection:
    """The nominal protocol; ``rho1`` may be 0 for agents of order n."""

    kind: Literal["nominal"]
    T: Positive
    rho1: NotNegative
    rho2: Positive
    kappa: Positive


@dataclass(frozen=True, kw_only=True)
class SlidingSection:
    """The sliding-mode protocol, and what a run met, if any."""

    kind: Literal["sliding-mode"]
    T_r: Positive
    T_s: Positive
    rho1: NotNegative
    rho2: Positive
    kappa: Positive
    mu1: Positive
    mu2: Positive
    mu3: Positive
    delta: NotNegative
    disturbance: str | None = None


@dataclass(frozen=True, kw_only=True)
class SlidingPart:
    """Whether the sliding part of the input is bounded for every ``sigma(0)``, and bounds of it."""

    bounded: bool
    agents: FewAgents | None = None


@dataclass(frozen=True, kw_only=True)
class ReachingTimes:
    """What Proposition 1 bounds, on which clock, and the reaching time of every agent."""

    bound: str
    clock: str
    z: ByAgent[Fraction | None]


@dataclass(frozen=True)
class Begin:
    """``X(0)`` and ``sigma(0)``; None: not given, or the nominal protocol."""

    state: Numbers | None
    sigma: Numbers | None


def check_protocol(doc: Document) -> Protocol:
    """Read the parameters, which are positive; mu1 is above delta."""
    section = doc.section("gain")
    gains = {name: value for name, value in vars(section).items() if name not in ("kind", "disturbance")}
    need(section.rho1 > 0 or "agents" in doc, "rho1 is not positive")  # that of agents of order n may be 0
    if isinstance(section, SlidingSection):
        need(section.delta < section.mu1, "mu1 is not above delta")
    return Protocol(isinstance(section, SlidingSection), gains)


def check_begin(doc: Document, protocol: Protocol) -> Begin:
    """Read ``X(0)`` and ``sigma(0)``."""
    state, sigma = (doc.section(key) for key in ("initial_state", "sliding_variable"))
    need((sigma is not None) == protocol.sliding, "sigma(0) belongs to the sliding-mode protocol, and is part of it")
    return Begin(state, sigma)


def check_sliding(doc: Document, graph: Digraph, protocol: Protocol, begin: Begin) -> None:
    """Verify Proposition 1 and every reaching time."""
    section = doc.section("reaching_time")
    sigma0, g = begin.sigma, protocol.gains
    if sigma0 is None or section is None:
        need(sigma0 is None and section is None, "reaching times are told iff there are sliding variables")
        return
    need(section.bound == SLIDING_BOUND and section.clock == SLIDING_CLOCK, "another bound or clock")
    doc.open("sliding-bound", "gain")
    doc.done("for every disturbance within delta")
    z = section.z
    if not any(x is not None and s for x, s in zip(z, sigma0, strict=True)):
        need(not any(z), "a reaching time of a variable that is 0 at time 0")
        return
    doc.open("reaching-time", "reaching_time")
    need(all(end is None or end >= 0 for end in z), "a reaching time before time 0")
    instants = {end for end, s in zip(z, sigma0, strict=True) if s and end is not None}
    spend(len(instants) * EACH_INSTANT, what="the reaching times of many agents")
    integrals = decay_integrals_below(g["T_r"], g["mu2"], g["mu3"] * g["kappa"], instants, REACHING_BITS)
    for label, size, end in zip(graph.labels, map(abs, sigma0), z, strict=True):
        if size and end is not None:
            need(size <= (g["mu1"] - g["delta"]) * integrals[end], f"agent {shorten(label)} need not be there by then")
        else:
            need(not end, f"agent {shorten(label)} starts at 0")
    doc.done(f"{sum(1 for x in z if x is not None)} of {graph.n} agents before T_r")


def sliding_bounded(gains: Mapping[str, Fraction]) -> bool:
    """Whether the sliding part of the input is bounded for every ``sigma(0)``."""
    return gains["mu3"] * gains["kappa"] >= 1


def sliding_part(gains: Mapping[str, Fraction], sigma0: Sequence[Fraction] | Numbers) -> list[Fraction] | None:
    """Return what the sliding-mode protocol adds to the input of every agent at most; None where it is not bounded."""
    if not sliding_bounded(gains) and any(sigma0):
        return None
    push = gains["mu2"] + gains["mu3"] * gains["kappa"] / gains["T_r"]
    return [gains["mu1"] + push * abs(s) for s in sigma0]


def check_sliding_part(
    doc: Document, graph: Digraph, protocol: Protocol, begin: Begin, section: SlidingPart | None
) -> None:
    """Verify the sliding part of the input."""
    doc.at = "input.sliding"
    need((section is not None) == protocol.sliding, "a sliding part belongs to the sliding-mode protocol")
    if section is None:
        return
    need(section.bounded is sliding_bounded(protocol.gains), "bounded for every initial state iff mu3 kappa >= 1")
    if section.agents is not None:
        doc.open("input-sliding", "input")
        least = sliding_part(protocol.gains, begin.sigma or Numbers([]))
        if least is None:
            raise RejectedError("the sliding part is not bounded")
        proved_above(graph, section.agents, "the sliding part", least)
        doc.done("for every disturbance within delta")
