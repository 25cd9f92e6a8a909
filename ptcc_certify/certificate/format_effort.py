"""What is proved about the input, read from a certificate's file; :func:`effort_section` writes it."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from typing import Any

from ptcc_certify.bounds.input import (
    Disturbed,
    Effort,
    EnergyIntegral,
    InitialSet,
    Limited,
    Limits,
    Peak,
    SlidingPart,
    Witness,
    first_input,
)
from ptcc_certify.certificate.vectors import Reader, number
from ptcc_certify.checker.reading import exact, triangle
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.protocols.nominal import Protocol
from ptcc_certify.theorems.base import Obligation

Steps = Mapping[tuple[str, str], Obligation]
Said = Mapping[str, Any]


def read_effort(
    section: Said | None,
    start: tuple[Fraction, ...] | None,
    structure: Structure,
    protocol: Protocol,
    data: Reader,
    steps: Steps,
) -> Effort | None:
    """Read the section ``input``; ``steps`` are the obligations by kind and part, whose witnesses belong to it."""
    if section is None:
        return None
    initial_set, sliding, threshold = _starts(section["initial_set"], data), section["sliding"], section["threshold"]
    region = initial_set or (None if start is None else InitialSet(start))
    return Effort(
        bounded=section["bounded"],
        by=None if section["bounded"] is None else steps["input-threshold", "input"].witness,
        threshold=(number(threshold["lower"]), number(threshold["upper"])),
        initial_set=initial_set,
        constants=tuple(map(data.state, section["constants"])),
        peak=_peak(section["peak"], data, steps),
        energy=_energy(section["energy"], steps),
        path_length=_witness(section["path_length"], "input-length", steps),
        sliding=None if sliding is None else SlidingPart(sliding["bounded"], data.state(sliding["agents"])),
        residual=tuple(
            _limited(entry, steps["limited-gain", f"input.residual[{k}]"], data)
            for k, entry in enumerate(section["residual"])
        ),
        disturbed=_disturbed(section["disturbed"], data, steps),
        first=None if region is None else first_input(structure, protocol, region),
    )


def _starts(section: Said | None, data: Reader) -> InitialSet | None:
    if section is None:
        return None
    axes = tuple(map(data.agents, section.get("axes", ())))
    return InitialSet(data.agents(section["center"]), () if axes else data.agents(section["radius"]), axes)


def _witness(section: str | None, kind: str, steps: Steps) -> Witness | None:
    if section is None:
        return None
    step = steps[kind, "input"]
    return Witness(exact(section), step.witness, step.numbers["z"])


def _energy(section: str | None, steps: Steps) -> Witness | EnergyIntegral | None:
    step = steps.get(("input-energy", "input"))
    if section is None or step is None or not isinstance(step.witness, dict):
        return _witness(section, "input-energy", steps)
    first, second = (triangle(step.witness[key], len(step.witness[key])) for key in ("W0", "W1"))
    p, m0, m1 = (step.numbers[key] for key in ("p", "m0", "m1"))
    return EnergyIntegral(exact(section), p, (first, second), (m0, m1))


def _peak(section: Said | None, data: Reader, steps: Steps) -> Peak | None:
    if section is None:
        return None
    step = steps["input-peak", "input"]
    agents, norm = data.agents(section["agents"]), exact(section["norm"])
    how = step.witness["agents"].values()
    return Peak(
        agents,
        tuple(Witness(bound, k, exact(z)) for bound, (k, z) in zip(agents, how, strict=True)),
        norm,
        Witness(norm, step.witness["norm"], step.numbers["z"]),
    )


def _limited(section: Said, step: Obligation, data: Reader) -> Limited:
    noise = section["noise"] or {}
    first, second = (*step.witness, None)[:2] if isinstance(step.witness, list) else (step.witness, None)
    return Limited(
        limits=Limits(*(number(section[key]) for key in ("gain_cap", "stop_before", "sample_period"))),
        clock=exact(section["clock"]),
        function=first,
        growth=step.numbers["growth"],
        norm=exact(section["norm"]),
        agents=data.state(section["agents"]),
        largest=number(section["largest"]),
        noise=number(noise.get("bound")),
        noise_function=second,
        noisy_norm=number(noise.get("norm")),
        noisy_largest=number(noise.get("largest")),
    )


def _disturbed(section: Said | None, data: Reader, steps: Steps) -> Disturbed | None:
    if section is None:
        return None
    function = steps["nominal-disturbed", "input"].witness
    return Disturbed(exact(section["delta"]), function, data.agents(section["inputs"]), data.state(section["drift"]))
