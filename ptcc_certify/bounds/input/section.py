"""The section ``effort`` of a certificate, and what proves it, as JSON-ready data."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from typing import Any

from ptcc_certify.bounds.input.effort import Effort, EnergyIntegral, Limited, Peak


def effort_section(effort: Effort | None, labels: Sequence[str], text: Callable[[Fraction], str]) -> Any:
    """Return the section ``effort`` of a certificate."""
    if effort is None:
        return None

    def by_agent(values: Sequence[Fraction] | None) -> dict[str, str] | None:
        return None if values is None else dict(zip(labels, map(text, values), strict=True))

    def maybe(value: Fraction | None) -> str | None:
        return None if value is None else text(value)

    def limited(entry: Limited) -> dict[str, Any]:
        noise = {"bound": maybe(entry.noise), "norm": maybe(entry.noisy_norm), "largest": maybe(entry.noisy_largest)}
        return {
            "gain_cap": maybe(entry.limits.gain_cap),
            "stop_before": maybe(entry.limits.stop_before),
            "sample_period": maybe(entry.limits.sample_period),
            "clock": text(entry.clock),
            "norm": text(entry.norm),
            "agents": by_agent(entry.agents),
            "largest": maybe(entry.largest),
            "noise": None if entry.noise is None else noise,
        }

    region: dict[str, Any] | None = None
    if (initial_set := effort.initial_set) is not None:
        region = {"center": by_agent(initial_set.center)}
        if initial_set.axes:
            region["axes"] = [by_agent(axis) for axis in initial_set.axes]
        else:
            region["radius"] = by_agent(initial_set.radius or (Fraction(0),) * len(labels))
    peak, sliding, disturbed = effort.peak, effort.sliding, effort.disturbed
    return {
        "bounded": effort.bounded,
        "threshold": {"lower": maybe(effort.threshold[0]), "upper": maybe(effort.threshold[1])},
        "initial_set": region,
        "constants": [by_agent(c) for c in effort.constants],
        "peak": peak and {"agents": by_agent(peak.agents), "largest": text(peak.largest), "norm": text(peak.norm)},
        "energy": effort.energy and text(effort.energy.value),
        "path_length": effort.path_length and text(effort.path_length.value),
        "sliding": sliding and {"bounded": sliding.bounded, "agents": by_agent(sliding.agents)},
        "residual": [limited(entry) for entry in effort.residual],
        "disturbed": disturbed
        and {
            "delta": text(disturbed.delta),
            "inputs": by_agent(disturbed.inputs),
            "drift": by_agent(disturbed.drift),
        },
    }


def peak_witness(peak: Peak, labels: Sequence[str], text: Callable[[Fraction], str]) -> Mapping[str, Any]:
    """Return what proves the peaks: a Lyapunov function and an instant for every agent, and for the norm."""
    agents = {label: [how.function, text(how.z)] for label, how in zip(labels, peak.how, strict=True)}
    return {"agents": agents, "norm": peak.norm_how.function}


def energy_witness(energy: EnergyIntegral, text: Callable[[Fraction], str]) -> dict[str, list[list[str]]]:
    """Return the lower triangles of the matrices that prove the energy."""
    first, second = ([[text(x) for x in row[: i + 1]] for i, row in enumerate(W)] for W in energy.matrices)
    return {"W0": first, "W1": second}
