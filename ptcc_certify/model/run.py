"""What ``ptcc simulate`` lets one choose of a run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from ptcc_certify.graphs.declared_option import option


@dataclass(frozen=True, kw_only=True)
class Run:
    """What is chosen of a run beside the motion; see :func:`ptcc_certify.simulate`."""

    section: ClassVar = "simulation"
    samples: int = option(
        "--samples", "Instants up to T, dense towards it.", default=201, example="201", least=2, most=100_000
    )
    steps: int | None = option(
        "--steps", "Instead: so many equal steps of t from 0 to T.", example="100", least=1, most=100_000
    )
    boundary_layer: float | None = option(
        "--boundary-layer W", "Sliding mode: tanh(sigma/W) for the sign, to compare.", example="0.01", kind="float"
    )
    pattern: str = option(
        "--pattern",
        "With late messages: as old as allowed, fresh, between the two, or now this, now that (with --seed).",
        default="oldest",
        name="age_pattern",
        example='"oldest"',
        choices=("oldest", "fresh", "varying", "square"),
    )
    seed: int = option(
        "--seed", "Seed of random initial states.", default=0, key="initial_state.seed", example="0", least=0
    )
