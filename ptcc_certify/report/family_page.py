"""What the page and the statement of a family's certificate say, beside what they share with those of one graph."""

from __future__ import annotations

import math
import re
import shlex
from collections.abc import Mapping, Sequence
from fractions import Fraction
from itertools import islice
from pathlib import PurePath
from typing import Any

from markupsafe import Markup

from lmi.exact.decimal_rounding import up
from ptcc_certify.certificate.family_certificate import FamilyCertificate
from ptcc_certify.certificate.family_comparison import compare
from ptcc_certify.certificate.restricted_bounds import deviation_of_signal, nearer_for_signal
from ptcc_certify.certificate.restricted_states import states_of_signal
from ptcc_certify.certificate.verdict import REFUTED
from ptcc_certify.errors import ParameterError, SimulationError
from ptcc_certify.graphs.family import Mode
from ptcc_certify.graphs.size_limits import DRAWN_NODES, INPUT_NODES
from ptcc_certify.protocols.reaching_time import ReachingTime
from ptcc_certify.protocols.restricted_signals import DwellTime
from ptcc_certify.report import notation as texts
from ptcc_certify.report.family_screen import (
    BOUND_KINDS,
    box_text,
    constant_text,
    groups_text,
    range_text,
    sharpest,
    told_ranges,
)
from ptcc_certify.report.figures import plot
from ptcc_certify.report.notation import above, rational
from ptcc_certify.report.plots.counterexample import plot_counterexample
from ptcc_certify.report.plots.runs import keeps_promise
from ptcc_certify.report.restricted_screen import agreement_text, restricted_entries, rests, signal_text
from ptcc_certify.report.structure_text import structure_text
from ptcc_certify.report.text_layout import arithmetic
from ptcc_certify.report.told_instants import FEW, told_instants
from ptcc_certify.simulation.trajectory import Trajectory
from ptcc_certify.theorems.counterexample_text import counterexample_text, mode_name
from ptcc_certify.theorems.family_behaviour import DEPENDS, Counterexample, FamilyComponent
from ptcc_certify.theorems.family_claims import camps, component_holds, component_refutation
from ptcc_certify.theorems.family_rate import explicit_rate

#: Modes, uncertain weights and parts of a proof that are listed.
MODES, WEIGHTS = 12, 8
#: How sentences begin that do not begin with a label.
_BEGINNINGS = ("the state ", "the leader ", "the signs ", "the graph ", "a state ", "no limit ", "held ")
#: The theorem, as page and statement give it.
THEOREM = (
    "If the mandatory graphs of all modes have one kernel K, and every uncertain edge joins agents whose rows of a"
    " basis of K agree up to its sign, then K is at rest in every graph of the family, and under every signal the"
    " agents come to a state of K by the deadline."
)


def family_facts(saved: FamilyCertificate) -> dict[str, Any]:
    """Return what the page and the statement of a family show both."""
    family, components = saved.family, [part.component for part in saved.parts]
    certified = saved.verdict == "certified"
    return {
        **{"saved": saved, "family": family, "components": components, "certified": certified},
        **{"claims": _claims(components), "claims_in_all": len(components), "several": len(family.modes) > 1},
        **{"n_edges": sum(mode.n_edges for mode in family.modes), "uncertain": _count(saved, "uncertain")},
        **{"optional": _count(saved, "optional"), "depends": any(c.behaviour == DEPENDS for c in components)},
        "mode_names": [texts.printable(mode_name(family, k)) for k in range(len(family.modes))],
        "rate_bound": min((p.upper_bound for p in saved.parts if p.upper_bound), key=lambda b: b.value, default=None),
        "constant": all(component.nodes.size == 1 for component in components),
        "restricted": _restricted(saved) if certified else [],
        "boxes": [box_text(components[k], box) for k, box in sorted(saved.boxes.items())] if certified else [],
        "ranges": [range_text(components[k], ends) for k, ends in told_ranges(saved).items()] if certified else [],
        "promise": "" if saved.signal == "any" else signal_text(saved.signal)[1],
        "stays": isinstance(saved.signal, DwellTime) or not rests(saved),
        "these": states_of_signal(saved) != list(saved.final_states or ()),
        "explicit_power": _explicit_power(saved),
        **{"sliding": saved.protocol.reaching is not None, "arithmetic": arithmetic(saved.direct)},
        "peak_agent": None if not saved.input_peaks else family.labels[saved.input_peaks.index(max(saved.input_peaks))],
    }


def _restricted(saved: FamilyCertificate) -> list[str]:
    """Tell what is proved of restricted signals, with the ends of constant weights."""
    entries = [text for _, text in restricted_entries(saved)]
    if text := constant_text(saved):
        within = max(ends.within for claim in saved.final_values.values() for ends in claim.values if ends is not None)
        near = f"some weights come within {up(within, 2)} of either end" if within else "some weights attain these ends"
        entries.append(f"{signal_text('constant')[1]}: at the deadline {text}; {near}")
    return entries


def family_view(saved: FamilyCertificate, runs: Sequence[Trajectory]) -> dict[str, Any]:
    """Return everything that the template of a page shows of a family, beside its obligations."""
    why = _counterexamples(saved)
    figures = _figures(saved, runs, why)
    protocol, facts = saved.protocol, family_facts(saved)
    ratios = [compare(saved, run) for run in runs]
    return facts | {
        **{"title": _title(facts), "protocol": protocol, "figures": figures, "runs": runs, "why": why},
        "equations": texts.formula_svg(protocol.latex(), inline=False),
        "parameters": [(name, getattr(protocol, name)) for name in texts.parameter_names(protocol)],
        "verdict_text": texts.typeset(
            _signs(saved.assessment.text).replace("--rho2 ", "rho2 = ").replace("--mu3 ", "mu3 = ")
        ),
        "reaching": _reaching(saved),
        "modes": [_mode_row(saved, k) for k in range(min(len(saved.family.modes), MODES))],
        "states": _states(saved),
        "endings": endings(saved),
        "remaining": [(texts.instant(name), bound) for name, bound in remaining(saved)],
        "remaining_promised": [(texts.instant(name), bound) for name, bound in remaining(saved, of_signal=True)],
        "functions": _functions(saved),
        "bound_words": bound_words(saved),
        "worst_ratio": max((ratio.worst_ratio for ratio in ratios), default=0.0),
        "violated": any(ratio.violated for ratio in ratios),
        "judged": sum(ratio.judged for ratio in ratios),
        "of_the_kind": saved.signal != "any" and keeps_promise(saved, runs),
        "worst_runs": sum(run.signal.startswith("worst") for run in runs),
        "groups": [
            _sentence(texts.printable(groups_text(c, saved.direct), 2000))
            for c in facts["components"]
            if c.behaviour == DEPENDS
        ],
        "answers": [(answer.status, texts.typeset(_signs(str(answer)))) for answer in saved.assessment.answers],
        "commands": _commands(saved),
        "file_name": None if saved.source is None else saved.source.path.name,
        "sha256": None if saved.source is None else saved.source.sha256,
        "document": None if saved.source is None else saved.source.document,
        "report": saved.checked,
        "bound_kinds": BOUND_KINDS,
        "sentence": _sentence,
        "theorem": THEOREM,
    }


def _count(saved: FamilyCertificate, which: str) -> int:
    """Count uncertain weights or edges that may fail; both directions of an undirected edge are one."""
    total = 0
    for mode in saved.family.modes:
        parameters = mode.parameters
        total += int(mode.optional[parameters].sum()) if which == "optional" else parameters.size
    return total


def _claims(components: Sequence[FamilyComponent]) -> list[tuple[str, int]]:
    """Return the sharpest behaviours, and of how many components."""
    counts: dict[str, int] = {}
    for component in components:
        counts[sharpest(component)] = counts.get(sharpest(component), 0) + 1
    return list(counts.items())


def _title(facts: Mapping[str, Any]) -> Markup:
    claims, T = facts["claims"], rational(facts["saved"].protocol.T)
    behaviour = claims[0][0] if len(claims) == 1 else f"{facts['claims_in_all']:,} components settle"
    if facts["depends"]:
        text = Markup("where agents end depends on the signal")
    elif not facts["certified"]:
        text = Markup("what the agents do at T = {}").format(T)
    else:
        text = Markup("{} at T = {} for every signal").format(behaviour, T)
    text = text[:1].upper() + text[1:] if facts["certified"] else "Undecided: " + text
    return text.replace("= \u2248", "\u2248")


# ---------------------------------------------------------------------- the family


def _mode_row(saved: FamilyCertificate, number: int) -> tuple[Any, ...]:
    """Return name, size, uncertain weights, and structure of the mandatory edges."""
    mode = saved.family.modes[number]
    size = f"{texts.plural(mode.n_edges, 'edge')}, {int((mode.sign < 0).sum()):,} negative"
    structures = saved.parts[0].component.structures
    from ptcc_certify.graphs.structure import analyse

    structure = structures[number] if len(saved.parts) == 1 else analyse(mode.mandatory)
    return texts.printable(mode_name(saved.family, number)), size, _weights(mode), structure_text(structure)


def _weights(mode: Mode) -> Markup:
    parameters = mode.parameters.tolist()
    listed = []
    for edge in parameters[:WEIGHTS]:
        ends = [texts.label(mode.labels[int(side[edge])], texts.CHARACTERS // 2) for side in (mode.source, mode.target)]
        least, largest = map(rational, mode.edge_interval(edge))
        listed.append(
            Markup("{} {} {} in [{},\u00a0{}]").format(
                ends[0], "\u2013" if mode.tied else "\u2192", ends[1], least, largest
            )
        )
    more = f", and {len(parameters) - WEIGHTS:,} more" if len(parameters) > WEIGHTS else ""
    return (Markup("; ").join(listed) + more) if listed else Markup("none")


def bound_words(saved: FamilyCertificate) -> list[Markup]:
    """Tell the members that prove the upper bound on the rate: modes, weights, durations or shares."""
    parts = [part for part in saved.parts if part.upper_bound is not None]
    if not parts:
        return []
    part = min(parts, key=lambda p: p.upper_bound.value)  # type: ignore[union-attr]
    bound, family = part.upper_bound, saved.family
    assert bound is not None
    from ptcc_certify.certificate.unverified import upper_bound_entry
    from ptcc_certify.lyapunov.quotient import Quotient

    lines = []
    for member, duration in zip(
        upper_bound_entry(Quotient.of(part.component), bound)["members"], bound.durations, strict=True
    ):
        name = texts.printable(member["name"]) if len(family.modes) > 1 else "the graph"
        how = {
            "word": Markup("for {} of the clock").format(rational(duration)),
            "mixture": Markup("for a share {} of the time").format(rational(duration)),
            "member": Markup("for ever"),
        }[bound.kind]
        some = [
            Markup("{} \u2192 {}: {}").format(texts.label(s, 24), texts.label(t, 24), rational(Fraction(w)))
            for s, t, w in member["weights"][:WEIGHTS]
        ]
        more = ", ..." if len(member["weights"]) > WEIGHTS else ""
        weights = Markup(" with ") + Markup(", ").join(some) + more if some else Markup("")
        lines.append(Markup("{} {}{}").format(name, how, weights))
    return lines


# ---------------------------------------------------------------------- what is proved


def endings(saved: FamilyCertificate) -> list[tuple[Markup, str]]:
    """Return agents and the interval in which they end, those with the same ends together."""
    groups: dict[Any, list[int]] = {}
    for k, ends in enumerate(states_of_signal(saved)):
        groups.setdefault(ends, []).append(k)
    return [(texts.labels(nodes, saved.family.labels, 8), _ends(ends)) for ends, nodes in groups.items()]


def _ends(ends: tuple[Fraction, Fraction] | None) -> str:
    """Write an interval, rounded outwards."""
    if ends is None:
        return "no limit is claimed"
    low, high = ends
    if low == high:
        return rational(low)
    return Markup("[{},\u00a0{}]").format(_rounded(low, -1), _rounded(high, 1))


def _rounded(x: Fraction, way: int) -> str:
    text = rational(x)
    if "\N{ALMOST EQUAL TO}" not in text and "/" not in text:
        return text
    outwards = above if (x > 0) == (way > 0) else texts.below
    sign = "\N{MINUS SIGN}" if x < 0 else ""
    return Markup("{}{}").format(sign, outwards(abs(x), 5)) if x else "0"


def _reaching(saved: FamilyCertificate) -> list[tuple[str, Fraction, ReachingTime]]:
    """Return label, ``sigma(0)`` and reaching time of agents; nothing where no sliding variable moves."""
    if saved.direct:
        return []
    rows = zip(saved.family.labels, saved.sigma0 or (), saved.reaching or (), strict=True)
    return list(islice(rows, 2 * texts.LISTED))


def state_rows(saved: FamilyCertificate) -> list[tuple[str, str, str, str | None]]:
    """Return label, camp, initial and final state of every agent; None where no limit is claimed."""
    if saved.initial_state is None:
        return []
    labels, finals = saved.family.labels, states_of_signal(saved)
    camp = ["\u2013"] * len(labels)
    for part in saved.parts:
        for number, side in enumerate(camps(part.component), 1):
            for v in part.component.nodes[side].tolist():
                camp[v] = f"camp {number}"
    ends = [None if end is None else _ends(end) for end in finals]
    return list(zip(labels, camp, map(rational, saved.initial_state), ends, strict=True))


def _states(saved: FamilyCertificate) -> tuple[list[str], list[list[Any]]]:
    """Return head and rows of the table of initial and final states."""
    rows = state_rows(saved)[: 2 * texts.LISTED]
    heads = ["Agent", "Camp", "Initial state"]
    if all(last is None for *_, last in rows):
        return heads, [[texts.label(name), camp, first] for name, camp, first, _ in rows]
    written = [[texts.label(name), camp, first, last or _ends(None)] for name, camp, first, last in rows]
    which = "every signal" if states_of_signal(saved) == list(saved.final_states or ()) else "these signals"
    which += " and disturbance" * (saved.protocol.reaching is not None)
    last = "State at the deadline" if rests(saved) else "State at any instant"
    return [*heads, f"{last}{agreement_text(saved)}, for {which}"], written


def remaining(saved: FamilyCertificate, of_signal: bool = False) -> list[tuple[str, Markup]]:
    """Return the names of instants and the bound of the deviation of any agent from its final state there.

    For every signal, or for those that were asked for, where more is proved of these.
    """
    proved = nearer_for_signal(saved) if of_signal else saved.common and saved.rate is not None
    if saved.initial_state is None or not proved:
        return []
    instants = told_instants(saved.protocol, saved.direct)[:FEW]
    left = [share for share, _ in instants]
    bounds = deviation_of_signal(saved, left) if of_signal else saved.deviation_bound(left)
    return [(name, above(float(x), 2)) for (_, name), x in zip(instants, bounds.max(axis=0), strict=True)]


def _functions(saved: FamilyCertificate) -> list[tuple[Any, ...]]:
    """Return class, rate, and the rates of the modes of every Lyapunov function."""
    names = [texts.printable(mode_name(saved.family, k)) for k in range(len(saved.family.modes))]
    kinds = {
        "full": "full matrix",
        "diagonal": "diagonal",
        "undirected": "diagonal, least weights",
        "rows": "row by row",
        "squares": "weighted squares",
    }
    rows = []
    for part in saved.parts:
        for V in part.functions:
            own = getattr(V, "rates", ())
            rates = [
                f"{name} {texts.below(r) if r > 0 else '0' if not r else 'negative'}"
                for name, r in zip(names, own, strict=False)
            ]
            rows.append(
                (
                    kinds.get(V.kind, V.kind),
                    texts.below(V.rate) if V.rate > 0 else "0",
                    Markup(", ").join(map(Markup, rates)) if len(names) > 1 else "\u2013",
                )
            )
    return rows


def _explicit_power(saved: FamilyCertificate) -> int | None:
    """Return ``p`` with a rate above ``10^p`` in closed form; None if some component has none, or a better one."""
    if saved.rate is not None or not saved.common:
        return None
    explicit = [explicit_rate(part.component) for part in saved.parts if part.component.nodes.size > 1]
    logs = [one.log10_decay_rate for one in explicit if one is not None]
    return int(min(logs)) - 1 if logs and len(logs) == len(explicit) else None


# ---------------------------------------------------------------------- counterexamples, figures


def _counterexamples(saved: FamilyCertificate) -> list[tuple[str, Markup, FamilyComponent, Counterexample]]:
    """Return what is refuted, the counterexample in words, its component, and itself: for claim and expectation."""
    result = []
    for part in saved.parts:
        component = part.component
        if component.behaviour == DEPENDS and component.counterexample is not None:
            result.append(("one behaviour for every signal", component, component.counterexample))
            break
    asked = saved.expectations.behaviour
    if asked is not None and any(a.status == REFUTED for a in saved.assessment.answers):
        for part in saved.parts:
            if component_holds(part.component, asked) is False:
                why = component_refutation(part.component, asked)
                if why is not None and why not in [one for _, _, one in result]:
                    result.append((asked, part.component, why))
                break
    return [
        (what, Markup("{}").format(_signs(texts.printable(counterexample_text(c, why), 500))), c, why)
        for what, c, why in result
    ]


def _signs(text: str) -> str:
    """Write minus signs of numbers, and arrows of edges, as such."""
    return re.sub(r"(?<=[= ])-(?=\d)", "\N{MINUS SIGN}", text).replace(" -> ", " \N{RIGHTWARDS ARROW} ")


def _sentence(text: str) -> str:
    """Begin with a capital letter, unless the text begins with a label."""
    return text[0].upper() + text[1:] if text.startswith(_BEGINNINGS) else text


def draw_family(
    saved: FamilyCertificate, runs: Sequence[Trajectory], wanted: Sequence[str] = ("graph", "decay")
) -> dict[str, Any]:
    """Draw those of the wanted figures for which there is something to draw."""
    small = bool(runs) and saved.family.n_nodes <= INPUT_NODES
    there = {"graph": saved.family.n_nodes <= DRAWN_NODES, "states": small, "input": small}
    moves = bool(runs) and saved.common and saved.rate is not None
    there["decay"] = moves and bool(saved.deviation_bound([1.0]).max() > 0)
    axes = {name: plot(saved, name, **({} if name == "graph" else {"runs": runs})) for name in wanted if there[name]}
    return {name: ax.figure for name, ax in axes.items()}


def _figures(
    saved: FamilyCertificate,
    runs: Sequence[Trajectory],
    why: Sequence[tuple[str, Markup, FamilyComponent, Counterexample]],
) -> dict[str, Any]:
    """Draw the graphs, runs within what is proved, and counterexamples: as far as there are any."""
    figures = draw_family(saved, runs, ("graph", "states", "decay", "input"))
    for number, (_, _, component, one) in enumerate(why):
        try:
            figures[f"why{number}"] = plot_counterexample(component, why=one, protocol=saved.protocol).figure
        except (ParameterError, SimulationError):
            continue  # no state of it is known; the words stand alone
    return figures


def _commands(saved: FamilyCertificate) -> list[str]:
    if saved.source is None:
        return []
    name = shlex.quote(PurePath(saved.source.path).name)
    name = f"./{name}" if name.startswith("-") else name
    memory = saved.source.report.memory
    more = f" --memory {math.ceil(memory)}" if memory > 1 else ""
    return [f"ptcc check {name}{more}", f"python -m ptcc_certify.checker {name}{more}"]
