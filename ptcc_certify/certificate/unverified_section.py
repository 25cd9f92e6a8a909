"""What a certificate says beside its claims, which nobody checks: what was asked, searched and seen."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ptcc_certify.bounds.delay.case import LateCase
from ptcc_certify.bounds.delay.late_messages import LateBounds, delays, read_messages
from ptcc_certify.bounds.envelope import FRACTIONS, LAST_INSTANTS
from ptcc_certify.bounds.input.effort import LIMITS, Effort
from ptcc_certify.certificate.constrained_switching.sections import read_signals, signals_section
from ptcc_certify.certificate.evidence import Evidence, Observations
from ptcc_certify.certificate.family_proof import FamilyProof
from ptcc_certify.certificate.graph_proof import GraphProof
from ptcc_certify.certificate.request import Expectations, Request
from ptcc_certify.certificate.section_io import Writer, finite, readable, text, write
from ptcc_certify.checker.constrained_switching import Dwell, Shares, Windows
from ptcc_certify.checker.input_formulas import InitialSet, Limits
from ptcc_certify.checker.message_ages import Delays
from ptcc_certify.checker.reading import RejectedError, entries, exact, need
from ptcc_certify.checker.section_declarations import Context, read
from ptcc_certify.checker.side_files import SideFiles
from ptcc_certify.errors import one_line
from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.rationals import format_exact
from ptcc_certify.graphs.structure import Structure, behaviour_name
from ptcc_certify.lyapunov.common_forms import Quotient
from ptcc_certify.lyapunov.search import METHODS
from ptcc_certify.lyapunov.slow_signals import Member, SignalRateBound, prove_again
from ptcc_certify.model.base import Protocol
from ptcc_certify.model.constrained_switching import SignalClass
from ptcc_certify.model.late_messages import LateMessages
from ptcc_certify.theorems.family_behaviour import mode_name

#: Of what it is read where it comes from.
ORIGINS = ("graph", "read", "x(0)", "v(0)", "a(0)", "sigma(0)")
#: Members of a word or mixture that are read.
_MANY = 100


def upper_bound_entry(quotient: Quotient, bound: SignalRateBound) -> dict[str, Any]:
    """Return a bound as JSON-ready data.

    Each member has its mode and the weights of its uncertain edges as ``[source, target, weight]``; those that change
    nothing off the common rest states are left out. ``durations`` are those of a word, on the stretched clock, in its
    order in time; of a mixture the shares.

    Examples
    --------
    >>> from ptcc_certify.lyapunov.slow_signals import prove_signal_rate_bound
    >>> quotient = Quotient(Family.from_intervals([("a", "b", 1, 2)]))
    >>> upper_bound_entry(quotient, prove_signal_rate_bound(quotient))["members"]
    [{'mode': 0, 'name': 'the graph', 'weights': [['a', 'b', '1']]}]
    """
    members = [
        {"mode": m.mode, "name": mode_name(quotient.family, m.mode), "weights": _weights(quotient, m)}
        for m in bound.members
    ]
    durations = [format_exact(h) for h in bound.durations]
    return {"value": format_exact(bound.value), "kind": bound.kind, "members": members, "durations": durations}


def _weights(quotient: Quotient, member: Member) -> list[list[str]]:
    mode, weights = quotient.family.modes[member.mode], []
    for part, level in zip(quotient.modes[member.mode].parts, member.levels, strict=True):
        low, high = mode.lower.fraction(part.edge), mode.upper.fraction(part.edge)
        size = low + level * (high - low)
        ends = (mode.labels[int(end[part.edge])] for end in (mode.source, mode.target))
        weights.append([*ends, format_exact(int(mode.sign[part.edge]) * size)])
    return weights


def read_upper_bound(quotient: Quotient, entry: Any) -> SignalRateBound | None:
    """Return a bound that the file states, proved anew from its members; None if it is none, or not proved.

    Examples
    --------
    >>> quotient = Quotient(Family.from_intervals([("a", "b", 1, 2)]))
    >>> member = {"kind": "member", "members": [{"mode": 0, "weights": [["a", "b", "1"]]}], "durations": ["1"]}
    >>> str(read_upper_bound(quotient, member | {"value": "2"}).value)
    '2'
    >>> read_upper_bound(quotient, member | {"value": "1"}) is None
    True
    """
    try:
        members = tuple(_member(quotient, one) for one in entries(entry["members"], "members"))
        durations = tuple(exact(h) for h in entries(entry["durations"], "durations", len(members)))
        need(0 < len(members) <= _MANY and all(h > 0 for h in durations), "no durations")
        need(entry["kind"] in ("mixture", "word") or (entry["kind"] == "member" and len(members) == 1), "no bound")
        need(entry["kind"] == "word" or sum(durations) == 1, "no shares")
        value = exact(entry["value"])
    except (RejectedError, LookupError, TypeError, ValueError, ArithmeticError):
        return None
    return prove_again(quotient, entry["kind"], members, durations, value)


def _member(quotient: Quotient, entry: Mapping[str, Any]) -> Member:
    number = entry["mode"]
    need(type(number) is int and 0 <= number < len(quotient.modes), "no mode")
    mode, parts = quotient.family.modes[number], quotient.modes[number].parts
    levels, on = [], dict[tuple[int, int], Fraction]()
    for part, row in zip(parts, entries(entry["weights"], "weights", len(parts)), strict=True):
        low, high = mode.lower.fraction(part.edge), mode.upper.fraction(part.edge)
        level = (int(mode.sign[part.edge]) * exact(row[2]) - low) / (high - low)
        ends = int(mode.source[part.edge]), int(mode.target[part.edge])
        on[ends] = on.get(ends, Fraction(0)) + level
        need(0 <= level <= 1 and on[ends] <= 1, "no member of the family")
        levels.append(level)
    return Member(number, tuple(levels))


def write_unproved(proof: GraphProof | FamilyProof) -> dict[str, Any]:
    """Return the late messages or moving leaders that were asked for where nothing is proved of them."""
    if (late := proof.late) is None or late.says_something:
        return {}
    return {"messages": write(Delays, delays(late.messages, late.case.of), Writer(proof.labels))}


def read_unproved(document: Mapping[str, Any], structure: Structure | Family) -> dict[str, Any]:
    """Read what :func:`write_unproved` wrote, unless something of the kind is proved."""
    asked = document["unverified"].get("asked")
    of = structure if isinstance(structure, Family) else structure.graph
    pairs = of.pairs[0].size if isinstance(of, Family) else of.n_edges
    at = Context(SideFiles(Path(), {}), of.labels, edges=pairs)
    if not isinstance(asked, dict) or "messages" in document:
        return {}
    section: Delays | None = readable(lambda: read(Delays, asked["messages"], at, "messages"))
    if section is None:
        return {}
    return {"messages": readable(lambda: read_messages(section, structure))}


def nothing_proved(
    messages: LateMessages | None,
    structure: Structure | Family,
    protocol: Protocol,
    relative: bool,
) -> LateBounds | None:
    """Return that nothing is proved of late messages that were asked for; None if none were.

    Parameters
    ----------
    messages : LateMessages or None
    structure : Structure or Family
    protocol : Protocol
    relative : bool
        Whether no initial state was given.
    """
    if messages is None:
        return None
    return LateBounds(LateCase(structure, protocol, messages), relative)


def _write_signals(proof: FamilyProof) -> dict[str, Any]:
    """Return the restricted signals that were asked for where nothing is claimed of these alone."""
    if proof.restricted or proof.signal == "any":
        return {}
    signals = signals_section(proof.signal)
    return {"signals": signals if isinstance(signals, str) else write(type(signals), signals, Writer(proof.labels))}


def read_unproved_signals(unverified: Mapping[str, Any]) -> SignalClass:
    """Return the restricted signals that were asked for where nothing is claimed of these alone; ``any`` if none."""
    asked, at = unverified.get("asked"), Context(SideFiles(Path(), {}), ())
    entry = asked.get("signals") if isinstance(asked, dict) else None
    if entry is None:
        return "any"
    return (
        readable(lambda: read_signals(read(Dwell | Windows | Shares | Literal["constant"], entry, at, "signals")))
        or "any"
    )


def write_unverified(certificate: Evidence) -> dict[str, Any]:
    """Return what was asked, searched and seen."""
    proof, notes = certificate.proof, list(certificate.observed.notes)
    scenario = None if proof.request.scenario is None else dict(proof.request.scenario)
    origins = dict(proof.origins)
    if isinstance(proof, FamilyProof):
        bounds = [(part.component, part.upper_bound) for part in proof.parts]
        return {
            "upper_bounds": [None if b is None else upper_bound_entry(Quotient.of(c), b) for c, b in bounds],
            "asked": _write_request(proof.request) | write_unproved(proof) | _write_signals(proof),
            "read": dict(proof.family.read) or None,
            **{"origins": origins, "scenario": scenario, "notes": notes},
        }
    search, envelope, observed = certificate.search, proof.envelope, certificate.observed
    remaining = (*(1 - f for f in FRACTIONS), *LAST_INSTANTS)
    residual = {str(1 - q if q > 1e-3 else f"1-{q:g}"): q for q in remaining}
    floats = None
    if proof.final_state is not None and not proof.final_state.exact:
        floats = dict(zip(proof.labels, map(finite, np.asarray(proof.final_state).tolist()), strict=True))
    return {
        "spectral": finite(observed.spectral_rate),
        "optimality_ratio": proof.optimality_ratio,
        "paper_rate": finite(observed.numerical_rate),
        "rounding_loss": finite(proof.rounding_loss),
        "search": {
            "method": proof.method,
            "at": None if proof.at is None else float(proof.at),
            "searched": {kind: finite(rate) for kind, rate in search.searched.items()},
            "diagonal_limit": finite(search.diagonal_limit),
            "longest_period": None if proof.effort is None else text(proof.effort.longest_period),
            "longest_delay": None if proof.late is None else finite(proof.late.longest_delay),
            "longest_age": None if proof.late is None else text(proof.late.enough),
        },
        "residual": {name: finite(envelope.residual(q)) for name, q in residual.items()} if proof.direct else None,
        "final_state": floats,
        "asked": _write_request(proof.request) | write_unproved(proof),
        **{"scenario": scenario, "origins": origins},
        "simulation": _write_run(certificate),
        "time_limit": finite(proof.time_limit),
        "cut_off": list(observed.cut_off),
        "notes": notes,
    }


def _write_run(certificate: Evidence) -> dict[str, Any] | None:
    run, comparison = certificate.trajectory, certificate.comparison
    if comparison is None:
        return None
    section = {
        "worst_ratio": finite(comparison.worst_ratio),
        "floor": finite(comparison.floor),
        "resolved_until": comparison.resolved_until,
        "judged": comparison.judged,
        "ratios": {str(k): finite(v) for k, v in comparison.ratios.items()},
        "stop": comparison.stop,
        "tolerances": {"relative": comparison.tolerance},
        "deviation_ratio": finite(comparison.deviation_ratio),
        "deadline_resolved": comparison.deadline_resolved,
    }
    if run is None or run.sliding is None:
        return section
    return section | {
        "sliding_ratio": finite(comparison.sliding_ratio),
        "reaching_kept": comparison.reaching_kept,
        "reached": dict(zip(certificate.proof.labels, map(finite, run.sliding.reaching_z.tolist()), strict=True)),
        "disturbance_bounded_by": run.sliding.bounded_by,
    }


def read_observations(section: Mapping[str, Any]) -> Observations:
    """Read what the file says of searches; other observations are made anew."""
    return Observations(cut_off=_texts(section.get("cut_off")), notes=_texts(section.get("notes")))


def with_longest_period(effort: Effort | None, unverified: Mapping[str, Any]) -> Effort | None:
    """Return bounds of the input with the period that the file names, which would be certified."""
    if effort is None:
        return None
    return replace(effort, longest_period=_positive(unverified.get("search"), "longest_period"))


def with_longest_delays(late: LateBounds | None, unverified: Mapping[str, Any]) -> LateBounds | None:
    """Return what is proved with late messages, with the delays that the file names, which would be certified."""
    search = unverified.get("search")
    delay = search.get("longest_delay") if isinstance(search, dict) else None
    known = isinstance(delay, float) and 0 < delay < math.inf
    if late is None:
        return None
    return replace(late, longest_delay=delay if known else None, enough=_positive(search, "longest_age"))


def _write_request(request: Request) -> dict[str, Any]:
    """Return what was asked; what became of it is no part of the claim, and follows from what is."""
    expectations = request.expectations
    return {
        "behaviour": expectations.behaviour,
        "min_rate": text(expectations.min_rate),
        "max_input": text(expectations.max_input),
        "max_residual": text(expectations.max_residual),
        "limits": [{name: text(getattr(entry, name)) for name in LIMITS} for entry in request.limits],
        "delta": text(request.delta),
        "noise": text(request.noise),
    }


def read_request(unverified: Mapping[str, Any], initial_set: InitialSet | None) -> Request:
    """Read what was asked, and where it comes from.

    Nothing of it is claimed, so that what cannot be read is left out.
    """
    section, search, seconds = (unverified.get(key) for key in ("asked", "search", "time_limit"))
    scenario, origins = unverified.get("scenario"), unverified.get("origins")
    origins = origins if isinstance(origins, dict) else {}
    told = {key: one_line(origins[key][:200]).strip() for key in ORIGINS if isinstance(origins.get(key), str)}
    section = section if isinstance(section, dict) else {}
    method, behaviour = search.get("method") if isinstance(search, dict) else None, section.get("behaviour")
    try:
        behaviour = behaviour_name(behaviour) if isinstance(behaviour, str) else None
    except ValueError:
        behaviour = None
    entries = section.get("limits")
    each = [[_positive(entry, key) for key in LIMITS] for entry in (entries if isinstance(entries, list) else [])[:100]]
    return Request(
        method=method if method in METHODS else "best",
        initial_set=initial_set,
        limits=tuple(Limits(*entry) for entry in each if any(entry)),
        delta=_positive(section, "delta"),
        noise=_positive(section, "noise"),
        time_limit=float(seconds) if isinstance(seconds, int | float) and seconds is not True else math.inf,
        expectations=Expectations(
            behaviour, *(_positive(section, key) for key in ("min_rate", "max_input", "max_residual"))
        ),
        scenario=scenario if isinstance(scenario, dict) else None,
        origins={key: origin for key, origin in told.items() if origin},
    )


def _positive(section: Any, key: str) -> Fraction | None:
    try:
        value = None if section.get(key) is None else exact(section[key])
    except (AttributeError, RejectedError):
        return None
    return value if value is not None and value > 0 else None


def _texts(section: Any) -> tuple[str, ...]:
    return tuple(one for one in section if isinstance(one, str)) if isinstance(section, list) else ()
