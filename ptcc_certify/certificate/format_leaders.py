"""Moving leaders in the file of a certificate: written and read, section 22 of ``FORMAT.md``."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from fractions import Fraction
from typing import Any

import numpy as np

from lmi.exact.decimal_rounding import float_up
from ptcc_certify.bounds.tracking import Tracking
from ptcc_certify.certificate.format_messages import Vectors, agents_section
from ptcc_certify.certificate.format_vectors import Reader, Writer, number, text
from ptcc_certify.checker.reading import exact
from ptcc_certify.graphs.rationals import format_exact
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.lyapunov.follower_rows import RowWitness
from ptcc_certify.protocols.base import Protocol
from ptcc_certify.protocols.moving_leaders import MovingLeaders
from ptcc_certify.theorems.theorem import Obligation


def tracking_obligations(tracking: Tracking | None) -> Iterator[Obligation]:
    """Yield what was proved of moving leaders."""
    if tracking is not None:
        witness = tracking.witness
        yield Obligation("tracking", "leaders", {"a": witness.b}, Vectors({"u": witness.u}))


def asked_leaders(leaders: MovingLeaders) -> dict[str, Any]:
    """Return how leaders move, as files have it."""
    return {
        "speed": format_exact(leaders.speed),
        "disturbance": format_exact(leaders.disturbance),
        "sign_gain": text(leaders.sign_gain),
    }


def read_leaders(section: Mapping[str, Any]) -> MovingLeaders:
    """Return what a certificate says of how leaders move."""
    return MovingLeaders(exact(section["speed"]), exact(section["disturbance"]), number(section["sign_gain"]))


def leaders_section(tracking: Tracking, out: Writer) -> dict[str, Any]:
    """Return what is proved with moving leaders, as files have it."""
    leaders, labels, bound = tracking.leaders, tracking.structure.graph.labels, tracking.input
    return {
        **asked_leaders(leaders),
        "initial": format_exact(tracking.initial),
        "input": None if bound is None else agents_section(labels, "tracking", bound, out),
        "after": format_exact(tracking.after),
    }


def read_tracking(
    document: Mapping[str, Any],
    structure: Structure,
    protocol: Protocol,
    data: Reader,
    steps: Mapping[tuple[str, str], Obligation],
) -> Tracking | None:
    """Return what an accepted certificate says of moving leaders; None if it says nothing."""
    section = document.get("leaders")
    if section is None:
        return None
    step, bound = steps["tracking", "leaders"], section["input"]
    u = data.floats(step.witness["u"], structure.followers.size)
    return Tracking(
        read_leaders(section),
        structure,
        protocol,
        RowWitness(Fraction(1), step.numbers["a"], u),
        exact(section["initial"]),
        document["final_state"] is None,
        exact(section["after"]),
        None if bound is None else np.array([float_up(x) for x in data.agents(bound)]),
    )
