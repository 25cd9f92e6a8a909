"""Late messages and moving leaders in the file of a certificate: written and read, section 22 of ``FORMAT.md``."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lmi.exact.decimal_rounding import float_up
from ptcc_certify.bounds.delay_lmi import DelayLMIBound
from ptcc_certify.bounds.late_messages import LateBounds, RowBound, heard_wrong, late_rows
from ptcc_certify.bounds.late_steps import bound_steps
from ptcc_certify.bounds.missed_deadline import Missed
from ptcc_certify.bounds.settling_leaders import Settling
from ptcc_certify.bounds.small_delays import SmallDelays
from ptcc_certify.certificate.format_vectors import Reader, Writer, number, text
from ptcc_certify.checker.messages import MOVING, ROW
from ptcc_certify.checker.reading import exact, triangle
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.rationals import format_exact
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.lyapunov.follower_rows import RowWitness
from ptcc_certify.protocols.base import Protocol
from ptcc_certify.protocols.gain_limits import GainLimits
from ptcc_certify.protocols.late_messages import LateMessages
from ptcc_certify.protocols.moving_leaders import MovingLeaders
from ptcc_certify.theorems.theorem import Obligation


@dataclass(frozen=True, eq=False)
class Vectors:
    """A witness of vectors by name: floats as the dyadic numbers that they are, or integers."""

    of: Mapping[str, np.ndarray]

    def written(self, out: Writer) -> dict[str, Any]:
        """Return what stands in the file."""
        return {
            name: out.floats(name, x) if x.dtype.kind == "f" else out.integers(name, x) for name, x in self.of.items()
        }


def late_obligations(late: LateBounds | None) -> Iterator[Obligation]:
    """Yield what proves bounds with late messages."""
    if late is None:
        return
    for i, row in enumerate(late.rows):
        numbers = {"q": row.witness.q, "b": row.witness.b}
        yield Obligation("late-rows", f"messages.rows[{i}]", numbers, Vectors({"u": row.witness.u}))
    if late.steps is not None:
        yield Obligation("late-steps", "messages.steps", witness=Vectors({"start": late.steps.start}))
    if late.missed is not None:
        yield Obligation("late-missed", "messages.missed", witness=Vectors({"gauge": late.missed.gauge}))
    if (settling := late.settling) is not None:
        u = dict(zip(late.structure.graph.labels, map(format_exact, settling.u), strict=True))
        numbers = {"q": settling.q, "b": settling.b}
        yield Obligation("late-settling", "messages.settling", numbers, {"function": settling.function, "u": u})
    if (form := late.form) is not None:
        phi = dict(zip(late.structure.graph.labels, map(format_exact, form.phi), strict=True))
        numbers = {"q": form.q, "b": form.b, "kap": form.kap}
        yield Obligation("late-form", "messages.form", numbers, {"function": form.function, "phi": phi})
    if (lmi := late.lmi) is not None:
        lower = [[float(x).hex() for x in row[: k + 1]] for k, row in enumerate(lmi.matrix)]
        witness = {"matrix": lower, "tau": [float(x).hex() if x else "0" for x in lmi.tau]}
        yield Obligation("late-lmi", "messages.lmi", {"b": lmi.b}, witness)


def asked_messages(messages: LateMessages, graph: SignedDigraph, out: Writer) -> dict[str, Any]:
    """Return how late, how often lost and how inexact messages are, as files have it."""
    latencies, period = messages.latencies(graph), messages.period
    return {
        "latency": out.numbers("latency", latencies) if isinstance(latencies, tuple) else format_exact(latencies),
        "packets": None if period is None else {"period": format_exact(period), "losses": str(messages.losses)},
        "delay": format_exact(messages.age),
        "own": "late" if messages.own_delay else "fresh",
        "value_error": format_exact(messages.value_error),
        "gain_cap": text(messages.gain_cap),
    }


def _asked_leaders(leaders: MovingLeaders | None) -> dict[str, str] | None:
    """Return how leaders move while messages are late, as files have it."""
    if leaders is None:
        return None
    return {"speed": format_exact(leaders.speed), "disturbance": format_exact(leaders.disturbance)}


def messages_section(late: LateBounds, out: Writer) -> dict[str, Any]:
    """Return what is proved with late messages, as files have it."""
    graph, missed, staged = late.structure.graph, late.missed, late.staged
    followers = [graph.labels[v] for v in late.structure.followers]
    names = ROW if late.leaders is None else (*ROW, *MOVING)
    return {
        **asked_messages(late.messages, graph, out),
        "leaders": _asked_leaders(late.leaders),
        "rows": [{name: text(getattr(row, name)) for name in names} for row in late.rows],
        "steps": None if late.steps is None else {"instants": [format_exact(t) for t in late.steps.instants]},
        "residual": None if late.residual is None else agents_section(graph.labels, "late", late.residual, out),
        "missed": missed and {"agent": graph.labels[missed.agent], "bound": format_exact(missed.bound)},
        "staged": staged and dict(zip(followers, map(format_exact, staged), strict=True)),
        "settling": late.settling and {name: text(getattr(late.settling, name)) for name in ("cap", "clock", "left")},
        "form": None if late.form is None else _form_section(late.form, graph.labels),
        "lmi": None if late.lmi is None else _form_section(late.lmi, graph.labels, ("moved", "away", "residual")),
        "input": None if late.input is None else agents_section(graph.labels, "late-input", late.input, out),
    }


def _form_section(
    form: SmallDelays | DelayLMIBound, labels: tuple[str, ...], names: Sequence[str] = ("moved", "residual")
) -> dict[str, Any]:
    agents = {name: dict(zip(labels, map(format_exact, getattr(form, name)), strict=True)) for name in names}
    return {"left": format_exact(form.left), **agents}


def _read_form(section: Mapping[str, Any] | None, step: Obligation | None, data: Reader) -> SmallDelays | None:
    if section is None or step is None:
        return None
    numbers, witness = step.numbers, step.witness
    return SmallDelays(
        witness["function"],
        numbers["q"],
        numbers["b"],
        numbers["kap"],
        data.agents(witness["phi"]),
        exact(section["left"]),
        data.agents(section["moved"]),
        data.agents(section["residual"]),
    )


def _read_lmi(section: Mapping[str, Any] | None, step: Obligation | None, data: Reader) -> DelayLMIBound | None:
    if section is None or step is None:
        return None
    matrix = tuple(map(tuple, triangle(step.witness["matrix"], len(step.witness["matrix"]))))
    bounds = (data.agents(section[name]) for name in ("moved", "away", "residual"))
    tau = tuple(map(exact, step.witness["tau"]))
    return DelayLMIBound(step.numbers["b"], matrix, tau, exact(section["left"]), *bounds)


def _read_settling(section: Mapping[str, Any] | None, step: Obligation | None, data: Reader) -> Settling | None:
    if section is None or step is None:
        return None
    cap, clock, left = (exact(section[name]) for name in ("cap", "clock", "left"))
    u = tuple(data.agents(step.witness["u"]))
    return Settling(step.witness["function"], step.numbers["q"], step.numbers["b"], cap, clock, left, u)


def agents_section(labels: tuple[str, ...], name: str, values: np.ndarray, out: Writer) -> Any:
    """Return one float of each agent, as it is; those of few agents by label."""
    if out.aside(values.size):
        return out.vector(name, values)
    return dict(zip(labels, (x.hex() if x else "0" for x in values.tolist()), strict=True))


def read_late(
    document: Mapping[str, Any],
    structure: Structure,
    protocol: Protocol,
    data: Reader,
    steps: Mapping[tuple[str, str], Obligation],
) -> LateBounds | None:
    """Return what an accepted certificate says of late messages; None if it says nothing."""
    section = document.get("messages")
    if section is None:
        return None
    messages, F, moving = read_messages(section, structure, data), structure.followers.size, section["leaders"]
    leaders = moving and MovingLeaders(exact(moving["speed"]), exact(moving["disturbance"]))
    rows = []
    for i, row in enumerate(section["rows"]):
        step = steps["late-rows", f"messages.rows[{i}]"]
        witness = RowWitness(step.numbers["q"], step.numbers["b"], data.floats(step.witness["u"], F))
        cap, clock = number(row["cap"]), number(row["clock"])
        rest = (exact(row[name]) for name in (*ROW[2:], *MOVING) if name in row)
        rows.append(RowBound(witness, cap, clock, *rest))
    gain, missed = GainLimits(gain_cap=messages.gain_cap).limit(protocol.gain), section["missed"]
    if missed is not None:
        signs = steps["late-missed", "messages.missed"].witness["gauge"]
        gauge = np.array(data.files.integers(signs, "gauge", F))
        missed = Missed(structure.graph.index[missed["agent"]], exact(missed["bound"]), gauge)
    staged = section["staged"]
    residual, instants = section["residual"], None
    if section["steps"] is not None:
        start = data.floats(steps["late-steps", "messages.steps"].witness["start"], F)
        times = tuple(map(exact, section["steps"]["instants"]))
        error, push = float_up(heard_wrong(messages, leaders)), float_up(leaders.total) if leaders else 0.0
        instants = bound_steps(late_rows(structure, messages), gain, messages.age, error, times, start, push)
    return LateBounds(
        messages,
        structure,
        gain,
        document["final_state"] is None,
        tuple(rows),
        instants,
        missed,
        staged and tuple(map(exact, staged.values())),
        None if residual is None else np.array([float_up(x) for x in data.agents(residual)]),
        _read_form(section["form"], steps.get(("late-form", "messages.form")), data),
        lmi=_read_lmi(section["lmi"], steps.get(("late-lmi", "messages.lmi")), data),
        settling=_read_settling(section["settling"], steps.get(("late-settling", "messages.settling")), data),
        input=None if section["input"] is None else np.array([float_up(x) for x in data.agents(section["input"])]),
        leaders=leaders,
    )


def read_messages(section: Mapping[str, Any], structure: Structure, data: Reader) -> LateMessages:
    """Return what a certificate says of how late messages are."""
    latency, packets = section["latency"], section["packets"]
    delay: Any = exact(latency) if isinstance(latency, str) else None
    if delay is None:
        values = data.numbers(latency, structure.graph.n_edges)
        delay = {(s, t): x for (s, t, _), x in zip(structure.graph.edges, values, strict=True)}
    return LateMessages(
        delay=delay,
        period=None if packets is None else exact(packets["period"]),
        losses=0 if packets is None else int(packets["losses"]),
        value_error=exact(section["value_error"]),
        own_delay=section["own"] == "late",
        gain_cap=number(section["gain_cap"]),
    )
