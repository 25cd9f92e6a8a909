"""What is proved about the input, as a certificate's file has it: written, and read again."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from functools import partial
from typing import Any

from ptcc_certify.bounds.input.effort import Disturbed, Effort, EnergyIntegral, Limited, Peak, SlidingPart, Witness
from ptcc_certify.bounds.input.effort_bounds import first_input
from ptcc_certify.certificate.format_vectors import Reader, Writer, number, text
from ptcc_certify.checker.input_formulas import InitialSet, Limits
from ptcc_certify.checker.reading import exact, triangle
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.protocols.nominal import Protocol
from ptcc_certify.theorems.theorem import Obligation

Steps = Mapping[tuple[str, str], Obligation]
Section = Mapping[str, Any]

ENDS = ("lower", "upper")
LIMITS = ("gain_cap", "stop_before", "sample_period")
#: Keys under ``noise`` of what limits leave, and the attributes of :class:`~ptcc_certify.bounds.input.effort.Limited`.
NOISE = {"bound": "noise", "norm": "noisy_norm", "largest": "noisy_largest"}


def effort_section(effort: Effort | None, out: Writer) -> Any:
    """Return the section ``input`` of a certificate."""
    if effort is None:
        return None
    agents, initial_set = partial(out.state, "input"), effort.initial_set
    region: dict[str, Any] | None = None
    if initial_set is not None:
        radius = initial_set.radius or (Fraction(0),) * len(out.labels)
        extent = {"axes": list(map(agents, initial_set.axes))} if initial_set.axes else {"radius": agents(radius)}
        region = {"center": agents(initial_set.center), **extent}
    peak, sliding, disturbed = effort.peak, effort.sliding, effort.disturbed
    residual = [
        {key: text(getattr(entry.limits, key)) for key in LIMITS}
        | {"clock": text(entry.clock), "norm": text(entry.norm)}
        | {"agents": agents(entry.agents), "largest": text(entry.largest)}
        | {"noise": entry.noise and {key: text(getattr(entry, name)) for key, name in NOISE.items()}}
        for entry in effort.residual
    ]
    return {
        "bounded": effort.bounded,
        "threshold": dict(zip(ENDS, map(text, effort.threshold), strict=True)),
        "initial_set": region,
        "constants": list(map(agents, effort.constants)),
        "peak": peak and {"agents": agents(peak.agents), "largest": text(peak.largest), "norm": text(peak.norm)},
        "energy": effort.energy and text(effort.energy.value),
        "path_length": effort.path_length and text(effort.path_length.value),
        "sliding": sliding and {"bounded": sliding.bounded, "agents": agents(sliding.agents)},
        "residual": residual,
        "disturbed": disturbed
        and {"delta": text(disturbed.delta), "inputs": agents(disturbed.inputs), "drift": agents(disturbed.drift)},
    }


def peak_witness(peak: Peak, out: Writer) -> Section:
    """Return what proves the peaks: a Lyapunov function and an instant for every agent, and for the norm."""
    agents = {label: [how.function, text(how.z)] for label, how in zip(out.labels, peak.how, strict=True)}
    return {"agents": agents, "norm": peak.norm_how.function}


def energy_witness(energy: EnergyIntegral) -> Section:
    """Return the lower triangles of the matrices that prove the energy."""
    first, second = ([list(map(text, row[: i + 1])) for i, row in enumerate(W)] for W in energy.matrices)
    return {"W0": first, "W1": second}


def read_effort(
    document: Section, structure: Structure, protocol: Protocol, data: Reader, steps: Steps
) -> Effort | None:
    """Read the section ``input``; ``steps`` are the obligations by kind and part, whose witnesses belong to it."""
    section, initial_state = document["input"], data.state(document["initial_state"])
    if section is None:
        return None
    region, initial_set, sliding = section["initial_set"], None, section["sliding"]
    if region is not None:
        axes = tuple(map(data.agents, region.get("axes", ())))
        initial_set = InitialSet(data.agents(region["center"]), () if axes else data.agents(region["radius"]), axes)
    states = initial_set or (None if initial_state is None else InitialSet(initial_state))
    lower, upper = (number(section["threshold"][key]) for key in ENDS)
    return Effort(
        bounded=section["bounded"],
        by=None if section["bounded"] is None else steps["input-threshold", "input"].witness,
        threshold=(lower, upper),
        initial_set=initial_set,
        constants=tuple(map(data.state, section["constants"])),
        peak=_read_peak(section["peak"], data, steps),
        energy=_read_energy(section["energy"], steps),
        path_length=_read_witness(section["path_length"], "input-length", steps),
        sliding=sliding and SlidingPart(sliding["bounded"], data.state(sliding["agents"])),
        residual=tuple(
            _read_limited(entry, steps["limited-gain", f"input.residual[{k}]"], data)
            for k, entry in enumerate(section["residual"])
        ),
        disturbed=_read_disturbed(section["disturbed"], data, steps),
        first=None if states is None else first_input(structure, protocol, states),
    )


def _read_witness(section: str | None, kind: str, steps: Steps) -> Witness | None:
    if section is None:
        return None
    step = steps[kind, "input"]
    return Witness(exact(section), step.witness, step.numbers["z"])


def _read_energy(section: str | None, steps: Steps) -> Witness | EnergyIntegral | None:
    step = steps.get(("input-energy", "input"))
    if section is None or step is None or not isinstance(step.witness, dict):
        return _read_witness(section, "input-energy", steps)
    first, second = (triangle(step.witness[key], len(step.witness[key])) for key in ("W0", "W1"))
    p, m0, m1 = (step.numbers[key] for key in ("p", "m0", "m1"))
    return EnergyIntegral(exact(section), p, (first, second), (m0, m1))


def _read_peak(section: Section | None, data: Reader, steps: Steps) -> Peak | None:
    if section is None:
        return None
    step, agents, norm = steps["input-peak", "input"], data.agents(section["agents"]), exact(section["norm"])
    how = zip(agents, step.witness["agents"].values(), strict=True)
    each = tuple(Witness(bound, k, exact(z)) for bound, (k, z) in how)
    return Peak(agents, each, norm, Witness(norm, step.witness["norm"], step.numbers["z"]))


def _read_limited(section: Section, step: Obligation, data: Reader) -> Limited:
    noise = section["noise"] or {}
    first, second = step.witness if noise else (step.witness, None)
    return Limited(
        limits=Limits(*(number(section[key]) for key in LIMITS)),
        clock=exact(section["clock"]),
        function=first,
        growth=step.numbers["growth"],
        norm=exact(section["norm"]),
        agents=data.state(section["agents"]),
        largest=number(section["largest"]),
        noise_function=second,
        **{name: number(noise.get(key)) for key, name in NOISE.items()},
    )


def _read_disturbed(section: Section | None, data: Reader, steps: Steps) -> Disturbed | None:
    if section is None:
        return None
    function = steps["nominal-disturbed", "input"].witness
    return Disturbed(exact(section["delta"]), function, data.agents(section["inputs"]), data.state(section["drift"]))
