"""What is proved about the input: whether it is bounded, its peak, its energy, what limits of the gain leave."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

from lmi.exact.decimal_rounding import up
from ptcc_certify.bounds.float_conversion import fractions, numbers
from ptcc_certify.checker import INPUT_NODES
from ptcc_certify.checker.input import (
    Box,
    DisturbedSection,
    Ellipsoid,
    EnergyWitness,
    InputSection,
    LimitedSection,
    NoiseSection,
    PeakSection,
    PeakWitness,
    Threshold,
)
from ptcc_certify.checker.input_formulas import InitialSet, Limits, Rows
from ptcc_certify.checker.obligations import CheckReport
from ptcc_certify.checker.protocol import SlidingPart as SlidingSection
from ptcc_certify.checker.side_files import Numbers
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.model.base import Protocol
from ptcc_certify.theorems.theorem import Obligation


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
class Limited:
    """What is left at the deadline under limits of the gain: ``||E||``, and the deviation of each agent.

    ``largest`` bounds ``max_k |u_k|``; None under a zero-order hold. With measurement noise ``|n_k| <= noise``,
    ``u = -gain L (X + n)``, ``noisy_norm`` bounds ``||E||`` at the deadline and ``noisy_largest`` every ``|u_k|``.
    """

    limits: Limits
    clock: Fraction
    function: int
    growth: Fraction
    norm: Fraction
    agents: tuple[Fraction, ...] | None
    largest: Fraction | None
    noise: Fraction | None = None
    noise_function: int | None = None
    noisy_norm: Fraction | None = None
    noisy_largest: Fraction | None = None


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
    threshold : pair of Fraction or None
        Proved bounds of ``rho2 kappa min Re lambda``; the input is bounded from 1 on.
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
    threshold: tuple[Fraction | None, Fraction | None]
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
            witness = entry.function if entry.noise_function is None else [entry.function, entry.noise_function]
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
    energy, length, peak, disturbed = effort.energy, effort.path_length, effort.peak, effort.disturbed
    sliding = effort.sliding
    return InputSection(
        bounded=effort.bounded,
        threshold=Threshold(lower=effort.threshold[0], upper=effort.threshold[1]),
        initial_set=None if effort.initial_set is None else _region(effort.initial_set, n),
        constants=list(map(numbers, effort.constants)),
        peak=None if peak is None else PeakSection(agents=Numbers(peak.agents), largest=peak.largest, norm=peak.norm),
        energy=None if energy is None else energy.value,
        path_length=None if length is None else length.value,
        sliding=None if sliding is None else SlidingSection(bounded=sliding.bounded, agents=numbers(sliding.agents)),
        residual=list(map(_limited, effort.residual)),
        disturbed=None
        if disturbed is None
        else DisturbedSection(delta=disturbed.delta, inputs=Numbers(disturbed.inputs), drift=numbers(disturbed.drift)),
    )


def _region(states: InitialSet, n: int) -> Box | Ellipsoid:
    center = Numbers(states.center)
    if states.axes:
        return Ellipsoid(center=center, axes=list(map(Numbers, states.axes)))
    return Box(center=center, radius=Numbers(states.radius or (Fraction(0),) * n))


def _limited(entry: Limited) -> LimitedSection:
    noise = None
    bound, norm, largest = entry.noise, entry.noisy_norm, entry.noisy_largest
    if bound is not None and norm is not None and largest is not None:
        noise = NoiseSection(bound=bound, norm=norm, largest=largest)
    return LimitedSection(
        **{key: getattr(entry.limits, key) for key in LIMITS},
        clock=entry.clock,
        norm=entry.norm,
        agents=numbers(entry.agents),
        largest=entry.largest,
        noise=noise,
    )


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
        threshold=(section.threshold.lower, section.threshold.upper),
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
        disturbed=None
        if disturbed is None
        else Disturbed(
            disturbed.delta,
            proved["nominal-disturbed", "input"]["witness"],
            tuple(disturbed.inputs),
            fractions(disturbed.drift),
        ),
        first=None if states is None else first_input(structure, protocol, states),
    )


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
        noise=None if noise is None else noise.bound,
        noise_function=None if noise is None else used[1],
        noisy_norm=None if noise is None else noise.norm,
        noisy_largest=None if noise is None else noise.largest,
    )


def first_input(structure: Structure, protocol: Protocol, region: InitialSet) -> Fraction | None:
    """Return ``sup max_k |u_k(0)|``, exactly; None in sliding mode, for an ellipsoid, for a large graph."""
    n = structure.graph.n_nodes
    if protocol.reaching or region.axes or n > INPUT_NODES or not structure.graph.n_edges:
        return None
    return protocol.gain.first * max(map(region.largest, structure.graph.exact_rows(range(n))))
