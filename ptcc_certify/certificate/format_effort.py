"""What is proved about the input, as a certificate's file has it: written, and read again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any

from ptcc_certify.bounds.input.effort import Disturbed, Effort, EnergyIntegral, Limited, Peak, SlidingPart, Witness
from ptcc_certify.bounds.input.effort_bounds import first_input
from ptcc_certify.certificate.format_vectors import fractions, numbers
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
from ptcc_certify.checker.input_formulas import InitialSet, Limits
from ptcc_certify.checker.obligations import CheckReport
from ptcc_certify.checker.protocol import SlidingPart as SlidingSection
from ptcc_certify.checker.side_files import Numbers
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.protocols.nominal import Protocol

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
    noise, bound, whole, largest = None, entry.noise, entry.noisy_norm, entry.noisy_largest
    if bound is not None and whole is not None and largest is not None:
        noise = NoiseSection(bound=bound, norm=whole, largest=largest)
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
