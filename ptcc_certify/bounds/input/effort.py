"""What is proved about the input: whether it is bounded, its peak, its energy, what limits of the gain leave."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from types import SimpleNamespace
from typing import Any, NamedTuple

from lmi.exact.decimal_rounding import up
from ptcc_certify.bounds.float_conversion import fractions
from ptcc_certify.checker import INPUT_NODES
from ptcc_certify.checker.input import (
    Box,
    DisturbedSection,
    Ellipsoid,
    EnergyWitness,
    InputSection,
    LimitedSection,
    PeakSection,
    PeakWitness,
)
from ptcc_certify.checker.input_formulas import InitialSet, Limits, Rows
from ptcc_certify.checker.obligations import CheckReport
from ptcc_certify.checker.section_declarations import declared
from ptcc_certify.checker.side_files import Numbers
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.model.base import Protocol
from ptcc_certify.theorems.theorem import Obligation


class Threshold(NamedTuple):
    """Proved bounds of ``rho2 kappa min Re lambda``, or None; the input is bounded from 1 on."""

    lower: Fraction | None
    upper: Fraction | None


@dataclass(frozen=True)
class Witness:
    """A bound, and what proves it: a Lyapunov function of the envelope and an instant ``z = ln(T/(T - t))``."""

    value: Fraction
    function: int
    z: Fraction


@dataclass(frozen=True)
class EnergyIntegral:
    """A bound of the energy from two Lyapunov equations, ``L'W + W L - c W >= m I`` with ``c = 0`` and ``c = 1/k``.

    ``p`` says how the gain is split between them, see :func:`ptcc_certify.checker.input_formulas.integral_above`;
    ``matrices`` are the two ``W``, in integers, and ``least`` the two ``m``.
    """

    value: Fraction
    p: Fraction
    matrices: tuple[Rows, Rows] = field(hash=False)
    least: tuple[Fraction, Fraction]


@dataclass(frozen=True, repr=False)
class Peak:
    """``sup |u_k|`` of every agent, and of the norm ``||u||_2``."""

    agents: tuple[Fraction, ...]
    how: tuple[Witness, ...]
    norm: Fraction
    norm_how: Witness

    @property
    def largest(self) -> Fraction:
        """``sup max_k |u_k|``."""
        return max(self.agents)

    def __repr__(self) -> str:
        return f"Peak(|u_k| <= {up(self.largest)}, ||u|| <= {up(self.norm)}, {len(self.agents)} agents)"


@dataclass(frozen=True)
class SlidingPart:
    """The sliding part of the input: bounded for all initial states iff ``mu3 kappa >= 1``, and by agent."""

    bounded: bool
    agents: tuple[Fraction, ...] | None


@dataclass(frozen=True)
class Noise:
    """Measurement noise ``|n_k| <= bound``, ``u = -gain L (X + n)``: ``||E||`` at the deadline, and every ``|u_k|``."""

    bound: Fraction
    function: int
    norm: Fraction
    largest: Fraction


@dataclass(frozen=True)
class Limited:
    """What is left at the deadline under limits of the gain: ``||E||``, and the deviation of each agent.

    ``largest`` bounds ``max_k |u_k|``; None under a zero-order hold.
    """

    limits: Limits
    clock: Fraction
    function: int
    growth: Fraction
    norm: Fraction
    agents: tuple[Fraction, ...] | None
    largest: Fraction | None
    noise: Noise | None = None


@dataclass(frozen=True)
class Disturbed:
    """What disturbances ``|d_k| <= delta`` of the nominal protocol add to the inputs, and to where the agents end."""

    delta: Fraction
    function: int
    inputs: tuple[Fraction, ...]
    drift: tuple[Fraction, ...] | None


@dataclass(frozen=True, repr=False)
class Effort:
    """What is proved about the input.

    Attributes
    ----------
    bounded : bool or None
        Whether ``u`` (the nominal part, under the sliding-mode protocol) stays bounded up to the deadline for every
        initial state; None: undecided.
    by : {"rate", "upper_bound", "spectrum"} or None
        What decides it: a proved rate, a proved upper bound on the decay rate, or the exact location of the spectrum.
    threshold : Threshold
    initial_set : InitialSet or None
        The set of initial states that the bounds are for; None: the initial state of the certificate.
    constants : tuple of (tuple of Fraction or None)
        ``c_k`` of every Lyapunov function with a full matrix, ``e_k^2 <= c_k V``.
    peak : Peak or None
        None: not bounded, or not proved.
    energy : EnergyIntegral, Witness or None
        Bound of ``int ||u||^2 dt`` (of the nominal part).
    path_length : Witness or None
        Bound of ``int ||u|| dt`` (of the nominal part).
    sliding : SlidingPart or None
        Bounds of the sliding part of the input; None under the nominal protocol, or if ``sigma(0)`` is not known.
    residual : tuple of Limited
        Of those limits under which something is certified.
    longest_period : Fraction or None
        Where sampling is not certified, ``||E||`` being proved to be no larger at the deadline than at first: a period
        with which it would be, near to the longest one.
    disturbed : Disturbed or None
        What disturbances within ``delta`` add under the nominal protocol; None if none was given.
    first : Fraction or None
        Nominal protocol: ``sup max_k |u_k(0)|`` over the initial states, exactly, which no peak falls below; None
        for an ellipsoid.

    Notes
    -----
    ``u(t) = -gain(t) L e^(-L s(t)) X(0)`` before the deadline, and ``gain e^(-lambda s)`` stays bounded iff
    ``rho2 kappa Re lambda >= 1``: hence the threshold, where eigenvalues on that line must be semisimple. The bounds
    follow from ``V <= e^(-rate s) V(0)`` and ``e_k^2 <= c_k V``.

    References
    ----------
    The protocols (4) and (48) of [Zhu]_.

    Examples
    --------
    >>> pair = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])
    >>> protocol = NominalProtocol(T=1, rho1=1, rho2=1, kappa=1)
    >>> effort = certify(pair, protocol, [3, 1], asks=Asks(simulation=False)).effort
    >>> effort.bounded, [float(bound) >= 1 for bound in effort.threshold], float(effort.first)
    (True, [True, True], 8.0)
    """

    bounded: bool | None
    by: str | None
    threshold: Threshold
    initial_set: InitialSet | None
    constants: tuple[tuple[Fraction, ...] | None, ...]
    peak: Peak | None = None
    energy: Witness | EnergyIntegral | None = None
    path_length: Witness | None = None
    sliding: SlidingPart | None = None
    residual: tuple[Limited, ...] = ()
    longest_period: Fraction | None = None
    disturbed: Disturbed | None = None
    first: Fraction | None = None

    def __repr__(self) -> str:
        word = {True: "bounded", False: "not bounded", None: "undecided"}[self.bounded]
        peak = "" if self.peak is None else f", |u_k| <= {up(self.peak.largest)}"
        energy = "" if self.energy is None else f", energy <= {up(self.energy.value)}"
        length = "" if self.path_length is None else f", path length <= {up(self.path_length.value)}"
        return f"Effort({word}{peak}{energy}{length})"

    @property
    def obligations(self) -> list[Obligation]:
        """What proves the bounds: obligations with numbers or a witness."""
        result = [Obligation("input-threshold", "input", witness=self.by)] if self.bounded is not None else []
        if self.peak is not None:
            result.append(Obligation("input-peak", "input", {"z": self.peak.norm_how.z}, self.peak))
        for kind, bound in (("input-energy", self.energy), ("input-length", self.path_length)):
            if isinstance(bound, EnergyIntegral):
                numbers = {"p": bound.p, "m0": bound.least[0], "m1": bound.least[1]}
                result.append(Obligation(kind, "input", numbers, bound))
            elif bound is not None:
                result.append(Obligation(kind, "input", {"z": bound.z}, bound.function))
        for k, entry in enumerate(self.residual):
            witness = entry.function if entry.noise is None else [entry.function, entry.noise.function]
            result.append(Obligation("limited-gain", f"input.residual[{k}]", {"growth": entry.growth}, witness))
        if self.disturbed is not None:
            numbers = {"delta": self.disturbed.delta}
            result.append(Obligation("nominal-disturbed", "input", numbers, self.disturbed.function))
        return result


Step = Mapping[str, Any]


LIMITS = ("gain_cap", "stop_before", "sample_period")


def effort_section(effort: Effort | None, n: int) -> InputSection | None:
    """Return the section ``input`` of a certificate of ``n`` agents."""
    if effort is None:
        return None
    stated: dict[str, Any] = {f.name: getattr(effort, f.name) for f in declared(InputSection)}
    for name in ("energy", "path_length"):
        stated[name] = None if stated[name] is None else stated[name].value
    stated["residual"] = [SimpleNamespace(**vars(entry), **vars(entry.limits)) for entry in effort.residual]
    if (states := effort.initial_set) is not None and states.axes:
        stated["initial_set"] = Ellipsoid(center=Numbers(states.center), axes=list(map(Numbers, states.axes)))
    elif states is not None and not states.radius:
        stated["initial_set"] = replace(states, radius=(Fraction(0),) * n)
    return InputSection(**stated)


def peak_witness(peak: Peak) -> PeakWitness:
    """Return what proves the peaks: a Lyapunov function and an instant for every agent, and for the norm."""
    return PeakWitness(agents=[(how.function, how.z) for how in peak.how], norm=peak.norm_how.function)


def read_effort(
    report: CheckReport, structure: Structure, protocol: Protocol, begin: Sequence[Fraction] | None
) -> Effort | None:
    """Return what an accepted certificate says of the input."""
    section: InputSection | None = report.sections.get("input")
    if section is None:
        return None
    region, proved, sliding, disturbed = section.initial_set, report.proved, section.sliding, section.disturbed
    initial_set = None
    if isinstance(region, Box):
        initial_set = InitialSet(tuple(region.center), tuple(region.radius))
    elif region is not None:
        initial_set = InitialSet(tuple(region.center), axes=tuple(map(tuple, region.axes)))
    states = initial_set or (None if begin is None else InitialSet(tuple(begin)))
    return Effort(
        bounded=section.bounded,
        by=None if section.bounded is None else proved["input-threshold", "input"]["witness"],
        threshold=Threshold(section.threshold.lower, section.threshold.upper),
        initial_set=initial_set,
        constants=tuple(map(fractions, section.constants)),
        peak=None if section.peak is None else _read_peak(section.peak, proved["input-peak", "input"]),
        energy=_read_energy(section.energy, proved.get(("input-energy", "input"))),
        path_length=_read_witness(section.path_length, proved.get(("input-length", "input"))),
        sliding=None if sliding is None else SlidingPart(sliding.bounded, fractions(sliding.agents)),
        residual=tuple(
            _read_limited(entry, proved["limited-gain", f"input.residual[{k}]"])
            for k, entry in enumerate(section.residual)
        ),
        disturbed=None if disturbed is None else _read_disturbed(disturbed, proved["nominal-disturbed", "input"]),
        first=None if states is None else first_input(structure, protocol, states),
    )


def _read_disturbed(section: DisturbedSection, step: Step) -> Disturbed:
    return Disturbed(section.delta, step["witness"], tuple(section.inputs), fractions(section.drift))


def _read_witness(bound: Fraction | None, step: Step | None) -> Witness | None:
    return None if bound is None or step is None else Witness(bound, step["witness"], step["z"])


def _read_energy(bound: Fraction | None, step: Step | None) -> Witness | EnergyIntegral | None:
    if bound is None or step is None or not isinstance(step["witness"], EnergyWitness):
        return _read_witness(bound, step)
    matrices = step["witness"].W0, step["witness"].W1
    return EnergyIntegral(bound, step["p"], matrices, (step["m0"], step["m1"]))


def _read_peak(section: PeakSection, step: Step) -> Peak:
    each = zip(section.agents, step["witness"].agents, strict=True)
    how = tuple(Witness(bound, k, z) for bound, (k, z) in each)
    return Peak(tuple(section.agents), how, section.norm, Witness(section.norm, step["witness"].norm, step["z"]))


def _read_limited(section: LimitedSection, step: Step) -> Limited:
    noise, used = section.noise, step["witness"]
    return Limited(
        limits=Limits(*(getattr(section, key) for key in LIMITS)),
        clock=section.clock,
        function=used if noise is None else used[0],
        growth=step["growth"],
        norm=section.norm,
        agents=fractions(section.agents),
        largest=section.largest,
        noise=None if noise is None else Noise(noise.bound, used[1], noise.norm, noise.largest),
    )


def first_input(structure: Structure, protocol: Protocol, region: InitialSet) -> Fraction | None:
    """Return ``sup max_k |u_k(0)|``, exactly; None in sliding mode, for an ellipsoid, for a large graph."""
    n = structure.graph.n_nodes
    if protocol.reaching or region.axes or n > INPUT_NODES or not structure.graph.n_edges:
        return None
    return protocol.gain.first * max(map(region.largest, structure.graph.exact_rows(range(n))))
