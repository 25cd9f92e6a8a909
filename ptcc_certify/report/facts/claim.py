"""Facts of what agents do: the claim, and of a family whose behaviour depends on the signal why, and what holds."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from operator import add
from typing import TYPE_CHECKING

import numpy as np

from lmi.exact.decimal_rounding import counted, down, near
from ptcc_certify.certificate.constrained_switching.claims import LastModeClaim
from ptcc_certify.certificate.fact import Fact, Facts
from ptcc_certify.errors import labelled
from ptcc_certify.graphs.family import Family, Mode
from ptcc_certify.graphs.structure import BIPARTITE_CONTAINMENT, STABILITY, Structure
from ptcc_certify.report.facts.agents import claimed_of
from ptcc_certify.report.facts.constrained_switching import RESTS, of_mode
from ptcc_certify.report.facts.input import without
from ptcc_certify.report.text_layout import TEXT, agent_text, columns, interval_text, printable, shorten_list, wrap_text
from ptcc_certify.theorems.agreeing_groups import AgreeingGroup, FamilyGroups
from ptcc_certify.theorems.claims import Claim
from ptcc_certify.theorems.family_behaviour import (
    CHAIN,
    DEPENDS,
    FamilyComponent,
    counterexample_text,
    decide,
    mode_name,
)

if TYPE_CHECKING:
    from ptcc_certify.bounds.final_state.attracting_box import AttractingBox
    from ptcc_certify.certificate.certificate import Certificate
    from ptcc_certify.checker.reading import Interval
    from ptcc_certify.model.late_messages import LateMessages

#: Components of which a screen tells, and lines of a text on the short one.
_COMPONENTS, _LINES = 4, 3
#: Columns of names within a phrase, and groups that agree of which each is named.
_NAMES, _GROUPS = 30, 3
#: Where sliding variables bring an agent that listens to nobody.
DRIVEN = "ends at x(0) - sigma(0)"
#: What is told of signals.
WHATEVER = {"any": "for every signal", "constant": "if mode and weights never change"}


def asked_messages(certificate: Certificate) -> LateMessages | None:
    """Return the late messages of which something is told."""
    return None if certificate.proof.late is None else certificate.proof.late.messages


def without_flaws(messages: LateMessages | None) -> str:
    """Tell that nothing is late, or inexact, of what was asked."""
    return f"nothing {' or '.join(messages.flaws if messages is not None else ())}"


def assumptions(certificate: Certificate, states: bool = False) -> list[str]:
    """Tell what claim, rate and error are without, where more was asked; or final ``states``, with their places."""
    messages, leaders, limits = asked_messages(certificate), certificate.proof.asked_leaders, bool(certificate.limits)
    virtual = messages is not None and messages.vehicles is not None
    placed = states and certificate.proof.offsets is not None
    assumed = {
        "of virtual positions, places added" if placed else "of virtual positions": virtual,
        "without a gain cap": not limits and messages is not None and messages.gain_cap is not None,
        without_flaws(messages): messages is not None and not messages.exact,
        "leaders at rest": leaders is not None and leaders.speed > 0,
        "without growth": leaders is not None and leaders.growth is not None,
        "without clipping": leaders is not None and leaders.saturation is not None,
        "without disturbances": leaders is not None and leaders.disturbance > 0,
        "without sign(e_k)": leaders is not None and leaders.sign_gain is not None,
    }
    return [*without(certificate), *(text for text, holds in assumed.items() if holds)]


def claim_facts(certificate: Certificate) -> Facts:
    """Tell what the agents of one graph do, by when, and under what."""
    p = certificate.protocol
    assumed = assumptions(certificate)
    also = "".join(f", {text}" for text in assumed)
    if p.reaching is not None and not also:
        also = f", any |d_k| <= {down(p.reaching.delta, 12)}" if p.reaching.delta else ", without disturbances"
    when = f" at T = {near(p.T)}"
    if certificate.proof.agents is not None:
        when = f"{claimed_of(certificate.proof.agents)}{when}"
    elif certificate.proof.offsets is not None:
        when = f" of x - offsets{when}"
    yield from structure_claims(certificate.graph_proof.structure, certificate.graph_proof.claims, when, also)


def structure_claims(structure: Structure, claims: Sequence[Claim], when: str = "", also: str = "") -> Facts:
    """Tell the claim of a connected graph in full; of every component, of the largest four of many, the sharpest."""
    if len(claims) == 1:
        (claim,) = claims
        brief = [f"{claim.sharpest}{when}{also} ({which})" for which in (claim.reference, f"Theorem {claim.theorem}")]
        yield Fact(head="claim", value=claim.sharpest, note=_claim_text(claim, when + also), brief=tuple(brief))
        return
    components, labels = structure.components, structure.graph.labels
    for k in sorted(range(len(claims)), key=lambda k: -len(components[k].nodes))[:_COMPONENTS]:
        text = f"{claims[k].sharpest}{when} (Theorem {claims[k].theorem})"
        names = [labels[v] for v in components[k].nodes]
        yield _component_fact(names, claims[k].sharpest, text)
    if len(claims) > _COMPONENTS:
        text = f"... {len(claims):,} components in all"
        counts = Counter(f"{claim.sharpest} (Theorem {claim.theorem})" for claim in claims)
        each = ", ".join(f"{number:,} {claim}" for claim, number in counts.items())
        yield Fact(head="claim", note=f"{text}: {each}", brief=(text,))
    if also:
        yield Fact(head="claim", note=also.removeprefix(", "))


def _component_fact(labels: Sequence[str], behaviour: str, text: str) -> Fact:
    """Tell what one component of several does, with as many of its agents as fit the line."""
    names = [labelled(printable(label)) for label in labels[:TEXT]]
    whose = shorten_list(names, max(TEXT - len(text) - 2, 14), len(labels))
    return Fact(head="claim", value=behaviour, note=f"{whose}: {text}")


def _claim_text(claim: Claim, when: str) -> str:
    numbers = f"Corollar{'y' if len(claim.corollaries) == 1 else 'ies'} {', '.join(claim.corollaries)}"
    theorem = f"{claim.behaviour}{when} (Theorem {claim.theorem}"
    if claim.special:
        return f"{theorem}), in particular {', '.join(claim.special)} ({numbers})"
    return f"{theorem}, {numbers})" if claim.corollaries else f"{theorem})"


# ---------------------------------------------------------------------- families


def family_claims(
    components: Sequence[FamilyComponent], when: str = "", certificate: Certificate | None = None
) -> Facts:
    """Tell what every component does; where that depends on the signal, why, and what holds all the same."""
    disturbed = certificate is not None and certificate.sigma0 is not None
    direct, boxes = (True, {}) if certificate is None else (certificate.direct, told_boxes(certificate))
    also = " and disturbance" if disturbed else ""
    also += "" if certificate is None else "".join(f", {text}" for text in assumptions(certificate))
    order = sorted(range(len(components)), key=lambda k: -components[k].nodes.size)
    known = all(component.family.graph is not None for component in components)
    if len(components) == 1:
        text, longer = _behaviour_texts(components[0], when, also, known)
        yield Fact(head="claim", value=components[0].sharpest, note=longer[0], brief=(longer[1], text))
    else:
        for k in order[:_COMPONENTS]:
            text, (_, camps_named) = _behaviour_texts(components[k], when, also, known)
            text = camps_named if columns(camps_named) <= TEXT else text
            yield _component_fact(components[k].family.labels, components[k].sharpest, text)
        if len(components) > _COMPONENTS:
            yield Fact(head="claim", note=f"... {len(components):,} components in all")
    depending = [k for k in order if components[k].behaviour == DEPENDS]
    for place, k in enumerate(depending):
        of = "" if certificate is None or certificate.proof.offsets is None else " (of x - offsets)"
        yield from _depends_facts(components[k], direct, of, detail=place > 0)
        if k in boxes:
            brief = box_text(components[k], boxes[k], TEXT)
            yield Fact(head="box", note=box_text(components[k], boxes[k]), brief=(brief,), detail=place > 0)


def _behaviour_texts(component: FamilyComponent, when: str, also: str, known: bool) -> tuple[str, tuple[str, str]]:
    """Tell what a component does, and the same with its camps, of which all agents are named or the first.

    Of one graph whose weights are ``known`` there is one signal alone.
    """
    if component.behaviour is None:
        return "not decided", ("not decided",) * 2
    if component.behaviour == DEPENDS:
        text = DEPENDS if component.signal == "any" else "depends on which graph it is"
        return text, (text, text)
    whatever = f" {WHATEVER[component.signal]}"
    if len(component.family.modes) == 1:
        whatever = "" if known else whatever.replace("mode and ", "")
    text = f"{component.sharpest}{when}{whatever}{also}"
    sides = component.camps
    if component.behaviour == STABILITY or len(sides) < 2:
        return text, (text, text)
    named = [
        " against ".join("{" + _names(component, side.tolist(), width) + "}" for side in sides) for width in (TEXT, 20)
    ]
    return text, (f"{text}: camps {named[0]}", f"{text}: camps {named[1]}")


def _depends_facts(component: FamilyComponent, direct: bool, of: str, detail: bool) -> Facts:
    texts = {}
    if component.counterexample is not None:
        texts["why"] = printable(counterexample_text(component, component.counterexample, labelled)) + of
    family = component.family
    if len(family.modes) > 1:
        alone = (f"{labelled(mode_name(family, k))}: {_alone(mode, direct)}" for k, mode in enumerate(family.modes))
        texts["alone"] = "; ".join(alone)
    elif component.signal == "any":
        (constant, *_) = decide(family, "constant")
        behaviour = "it depends on the weights" if constant.behaviour == DEPENDS else constant.sharpest
        texts["constant"] = f"where weights never change: {behaviour}"
    if component.signal == "any":
        texts["groups"] = groups_text(component, direct) + of
    for head, text in texts.items():
        brief = (_cut(text),) if head in ("why", "alone") else ()
        yield Fact(head=head, note=text, brief=brief, detail=detail)


def _names(component: FamilyComponent, nodes: Sequence[int], width: int) -> str:
    return shorten_list([agent_text(component.family.labels[v]) for v in nodes], width)


def _alone(mode: Mode, direct: bool) -> str:
    """Tell what a mode does if no other one acts."""
    if not mode.n_edges:
        return RESTS if direct else f"every agent {DRIVEN}"
    components = decide(Family((mode,)))
    if len(components) == 1:
        return components[0].sharpest
    parts, behaviours = f"{len(components):,} separate parts", {part.behaviour for part in components}
    if behaviours <= {*CHAIN}:
        return f"{of_mode(BIPARTITE_CONTAINMENT, mode)}, in {parts}"
    return f"{parts}, each by itself: {', '.join(dict.fromkeys(part.sharpest for part in components))}"


def groups_text(component: FamilyComponent, direct: bool = True) -> str:
    """Tell which agents agree, follow or end at 0 under every signal, where the behaviour depends on it.

    An agent that listens to nobody keeps its value where no sliding variable moves (``direct``). Many such agents, and
    many groups that agree, are counted.

    Examples
    --------
    >>> from ptcc_certify.errors import unlabelled
    >>> unlabelled(groups_text(ptcc.decide([(1, 3, 1, 2), (2, 3, 1, 1)])[0]))
    '1, 2 keep their value; 3 ends between these, up to signs, or moves there for ever'
    """
    groups = FamilyGroups(component)
    parts = _keeping(component, groups.agreeing, direct) + _agreeing(component, groups.agreeing)
    zero, near = groups.at_zero.tolist(), set(groups.bounded.tolist())
    known = {v for group in groups.agreeing for v in group.nodes.tolist()}.union(zero)
    others = [v for v in range(component.nodes.size) if v not in known]
    followers, free = ([v for v in others if (v in near) == wanted] for wanted in (True, False))
    if zero:
        parts.append(f"{_names(component, zero, _NAMES)} {'end' if len(zero) > 1 else 'ends'} at 0")
    if followers:
        ends, moves = ("end", "move") if len(followers) > 1 else ("ends", "moves")
        names = _names(component, followers, _NAMES)
        parts.append(f"{names} {ends} between these, up to signs, or {moves} there for ever")
    if free:
        parts.append(f"no limit is claimed of {_names(component, free, _NAMES)}")
    return "; ".join(parts)


def _keeping(component: FamilyComponent, groups: Sequence[AgreeingGroup], direct: bool) -> list[str]:
    """Tell of agents that listen to nobody: names of those that nobody agrees with if these are short, else how many.

    Of the many, those count too with whom others agree.
    """
    alone = [int(group.nodes[0]) for group in groups if group.nodes.size == 1]
    if not alone:
        return []
    names = ", ".join(agent_text(component.family.labels[v]) for v in alone)
    if columns(names) > _NAMES:
        _, target, _ = component.family.union
        names = f"{counted(component.nodes.size - np.unique(target).size, 'agent')} that listen to nobody"
    if direct:
        return [f"{names} {'keeps its value' if len(alone) == 1 else 'keep their value'}"]
    return [f"{names} {DRIVEN if len(alone) == 1 else DRIVEN.replace('ends', 'end')}"]


def _agreeing(component: FamilyComponent, groups: Sequence[AgreeingGroup]) -> list[str]:
    """Tell of groups of two agents or more that agree, of many only how many there are."""
    several = [group for group in groups if group.nodes.size > 1]
    if len(several) > _GROUPS:
        agents = sum(group.nodes.size for group in several)
        camps = ", up to camps" if any((group.camps < 0).any() for group in several) else ""
        return [f"{len(several):,} groups, of {agents:,} agents in all, agree each within itself{camps}"]
    return [
        f"{_names(component, group.nodes.tolist(), _NAMES)} agree{' up to camps' if (group.camps < 0).any() else ''}"
        for group in several
    ]


def told_ranges(certificate: Certificate) -> dict[int, tuple[Interval, ...]]:
    """Return between which ends every signal keeps agents, of components of which no last mode tells the same."""
    proof = certificate.family_proof
    last = proof.ends_of_signal.items()
    same = {k for k, claim in last if isinstance(claim, LastModeClaim) and claim.final_states is not None}
    ranges = {}
    for k, ends in proof.ranges.items():
        if k not in same:
            places = proof.places_in(proof.parts[k])
            ranges[k] = tuple((low + h, high + h) for (low, high), h in zip(ends, places, strict=True))
    return ranges


def told_boxes(certificate: Certificate) -> dict[int, AttractingBox]:
    """Return the boxes into which followers are drawn, of positions."""
    proof, boxes = certificate.family_proof, {}
    for k, box in proof.boxes.items():
        places = [proof.places_in(proof.parts[k])[v] for v in box.decay.nodes.tolist()]
        lower, upper = (tuple(map(add, ends, places)) for ends in (box.lower, box.upper))
        boxes[k] = replace(box, lower=lower, upper=upper)
    return boxes


def range_text(component: FamilyComponent, ends: Sequence[Interval], width: int = 12 * TEXT) -> str:
    """Tell in which intervals every signal keeps all agents of a component at all times.

    Where that takes more columns than ``width``, the interval is told that holds them all.

    Examples
    --------
    >>> foes = Family.from_intervals([("a", "b", -1, 1), ("b", "a", 1, 2)])
    >>> cert = certify(foes, NominalProtocol(T=1, rho1=1, rho2=1, kappa=3), [1, -2])
    >>> from ptcc_certify.errors import unlabelled
    >>> unlabelled(range_text(cert.parts[0].component, cert.ranges[0]))
    'every signal keeps a, b in [-2, 2] at all times'
    """
    groups: dict[str, list[int]] = {}
    for v, own in enumerate(ends):
        groups.setdefault(interval_text(own), []).append(v)
    told = ", ".join(f"{_names(component, nodes, _NAMES)} {text}" for text, nodes in groups.items())
    text = f"every signal keeps {told} at all times"
    if columns(text) <= width:
        return text
    whole = interval_text((min(low for low, _ in ends), max(high for _, high in ends)))
    return f"every signal keeps {counted(len(ends), 'agent')} {whole} at all times"


def box_text(component: FamilyComponent, box: AttractingBox, width: int = 12 * TEXT) -> str:
    """Tell into which intervals every signal draws followers, whether or not they come to rest, and at what rate.

    Intervals that take more columns than ``width`` are counted, and the one that holds them all is told.

    Examples
    --------
    >>> moved = Family.from_intervals([(1, 3, 1, 3), (2, 3, 1, 1), (1, 4, 1, 1), (2, 4, 1, 4)])
    >>> cert = certify(moved, NominalProtocol(T=1, rho1=1, rho2=1, kappa=3), {1: 0, 2: 4, 3: 100, 4: 0})
    >>> from ptcc_certify.errors import unlabelled
    >>> unlabelled(box_text(cert.parts[0].component, cert.boxes[0]))
    'every signal draws 3 into [1, 2], 4 into [2, 3.2], at the rate 4; no limit is claimed'
    >>> box_text(cert.parts[0].component, cert.boxes[0], 20)
    'every signal draws 2 agents into 2 intervals in all, within [1, 3.2], at the rate 4; no limit is claimed'
    """
    groups: dict[str, list[int]] = {}
    for v, *ends in zip(box.decay.nodes.tolist(), box.lower, box.upper, strict=True):
        text = interval_text((ends[0], ends[1])).replace("in [", "into [").replace("at ", "to ")
        groups.setdefault(text, []).append(v)
    told = ", ".join(f"{_names(component, nodes, _NAMES)} {text}" for text, nodes in groups.items())
    if columns(told) > width:
        hull = interval_text((min(box.lower), max(box.upper))).removeprefix("in ")
        told = f"{counted(len(box.lower), 'agent')} into {len(groups):,} intervals in all, within {hull}"
    return f"every signal draws {told}, at the rate {down(2 * box.decay.rate)}; no limit is claimed"


def _cut(text: str) -> str:
    lines = wrap_text(text)
    if len(lines) <= _LINES:
        return text
    more = "... (all with -v)"
    (last, *_) = wrap_text(lines[_LINES - 1], TEXT - len(more) - 1)
    return " ".join([*lines[: _LINES - 1], last, more])
