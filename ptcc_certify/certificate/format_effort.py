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
from ptcc_certify.theorems.theorem import Obligation

Steps = Mapping[tuple[str, str], Obligation]
Said = Mapping[str, Any]


def read_effort(
    said: Said | None,
    start: tuple[Fraction, ...] | None,
    structure: Structure,
    protocol: Protocol,
    data: Reader,
    steps: Steps,
) -> Effort | None:
    """Read the section ``input``; ``steps`` are the obligations by kind and part, whose witnesses belong to it."""
    if said is None:
        return None
    initial_set, sliding, threshold = _starts(said["initial_set"], data), said["sliding"], said["threshold"]
    region = initial_set or (None if start is None else InitialSet(start))
    return Effort(
        bounded=said["bounded"],
        by=None if said["bounded"] is None else steps["input-threshold", "input"].witness,
        threshold=(number(threshold["lower"]), number(threshold["upper"])),
        initial_set=initial_set,
        constants=tuple(map(data.state, said["constants"])),
        peak=_peak(said["peak"], data, steps),
        energy=_energy(said["energy"], steps),
        path_length=_witness(said["path_length"], "input-length", steps),
        sliding=None if sliding is None else SlidingPart(sliding["bounded"], data.state(sliding["agents"])),
        residual=tuple(
            _limited(entry, steps["limited-gain", f"input.residual[{k}]"], data)
            for k, entry in enumerate(said["residual"])
        ),
        disturbed=_disturbed(said["disturbed"], data, steps),
        first=None if region is None else first_input(structure, protocol, region),
    )


def _starts(said: Said | None, data: Reader) -> InitialSet | None:
    if said is None:
        return None
    axes = tuple(map(data.agents, said.get("axes", ())))
    return InitialSet(data.agents(said["center"]), () if axes else data.agents(said["radius"]), axes)


def _witness(said: str | None, kind: str, steps: Steps) -> Witness | None:
    if said is None:
        return None
    step = steps[kind, "input"]
    return Witness(exact(said), step.witness, step.numbers["z"])


def _energy(said: str | None, steps: Steps) -> Witness | EnergyIntegral | None:
    step = steps.get(("input-energy", "input"))
    if said is None or step is None or not isinstance(step.witness, dict):
        return _witness(said, "input-energy", steps)
    first, second = (triangle(step.witness[key], len(step.witness[key])) for key in ("W0", "W1"))
    p, m0, m1 = (step.numbers[key] for key in ("p", "m0", "m1"))
    return EnergyIntegral(exact(said), p, (first, second), (m0, m1))


def _peak(said: Said | None, data: Reader, steps: Steps) -> Peak | None:
    if said is None:
        return None
    step = steps["input-peak", "input"]
    agents, norm = data.agents(said["agents"]), exact(said["norm"])
    how = step.witness["agents"].values()
    return Peak(
        agents,
        tuple(Witness(bound, k, exact(z)) for bound, (k, z) in zip(agents, how, strict=True)),
        norm,
        Witness(norm, step.witness["norm"], step.numbers["z"]),
    )


def _limited(said: Said, step: Obligation, data: Reader) -> Limited:
    noise = said["noise"] or {}
    first, second = (*step.witness, None)[:2] if isinstance(step.witness, list) else (step.witness, None)
    return Limited(
        limits=Limits(*(number(said[key]) for key in ("gain_cap", "stop_before", "sample_period"))),
        clock=exact(said["clock"]),
        function=first,
        growth=step.numbers["growth"],
        norm=exact(said["norm"]),
        agents=data.state(said["agents"]),
        largest=number(said["largest"]),
        noise=number(noise.get("bound")),
        noise_function=second,
        noisy_norm=number(noise.get("norm")),
        noisy_largest=number(noise.get("largest")),
    )


def _disturbed(said: Said | None, data: Reader, steps: Steps) -> Disturbed | None:
    if said is None:
        return None
    function = steps["nominal-disturbed", "input"].witness
    return Disturbed(exact(said["delta"]), function, data.agents(said["inputs"]), data.state(said["drift"]))
