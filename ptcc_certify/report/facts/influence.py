"""Facts of who decides whom, and of who is dangerous: how far captured agents move where the others end."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from lmi.exact.decimal_rounding import near, up
from ptcc_certify.bounds.final_state.captured import Captured, Number, Reach
from ptcc_certify.certificate.fact import Fact, Facts, Standing
from ptcc_certify.graphs.stubborn import PREJUDICE
from ptcc_certify.report.text_layout import agent_text, columns, shorten_list

if TYPE_CHECKING:
    from ptcc_certify.bounds.final_state.of_graph import Influence

#: Nodes above which sums are told without each node's row.
_ROWS = 60
#: Columns of a list on a short screen, and of the names and of the sum of one entry of it.
_SHORT, _NAMES, _TERMS = 140, 40, 75


def influence_facts(who: Influence) -> Facts:
    r"""Tell the share that every leader has in what all end at, and where each node ends.

    The share of leader j is ``sum_k |Q_kj|`` over the sum of all; nodes with equal rows of ``Q`` stand together.

    Examples
    --------
    >>> from ptcc_certify.report.facts.influence import influence_facts
    >>> for fact in influence_facts(ptcc.influence([("a", "c", 1), ("b", "c", -3)])):
    ...     print(f"{fact.head}: {fact.text}")
    decides: b 58.3 %, a 41.7 %
    x(T): a ends at x_a, c at 0.25 x_a - 0.75 x_b, b at x_b
    """
    labels = who.structure.graph.labels
    shares = who.shares
    if not shares.any():
        yield Fact(head="decides", note="nobody: every node ends at 0, wherever it begins")
        return
    order = [int(j) for j in np.argsort(-shares, kind="stable") if shares[j]]
    texts = [f"{agent_text(labels[j])} {100 * shares[j]:.3g} %" for j in order]
    yield Fact(head="decides", value={labels[j]: float(shares[j]) for j in order}, note=shorten_list(texts, _SHORT))
    if len(labels) > _ROWS:
        return
    groups: dict[tuple[tuple[int, Any], ...], list[str]] = defaultdict(list)
    for k, label in enumerate(labels):
        groups[tuple(who.row(k).items())].append(agent_text(label))
    told: list[str] = []
    brief: list[str] = []
    for row, names in groups.items():
        verb = "" if told else "end " if len(names) > 1 else "ends "
        told.append(f"{', '.join(names)} {verb}at {_sum(_terms(row, labels))}")
        largest_first = sorted(row, key=lambda term: -abs(term[1]))
        brief.append(f"{shorten_list(names, _NAMES)} {verb}at {_sum(_terms(largest_first, labels, 16), _TERMS)}")
    yield Fact(head="x(T)", note=", ".join(told), brief=(shorten_list(brief, _SHORT),))


def _terms(row: Iterable[tuple[int, Any]], labels: Sequence[str], width: int = 1000) -> list[str]:
    """Write the terms of a weighted sum of initial states, p of prejudices, each with its sign, rounded."""
    terms = []
    for j, weight in row:
        size = f"{abs(float(weight)):.3g}"
        agent, prejudice, _ = labels[j].partition(PREJUDICE)
        name = f"p_{agent_text(agent, width)}" if prejudice else f"x_{agent_text(agent, width)}"
        terms.append(f"{'-' if weight < 0 else '+'} {'' if size == '1' else f'{size} '}{name}")
    return terms


def _sum(terms: Sequence[str], width: int = 0) -> str:
    """Write a sum, 0 where it has no terms; of one that is wider, the first terms and how many there are."""
    text = " ".join(terms).removeprefix("+ ")
    text = "-" + text[2:] if text.startswith("- ") else text or "0"
    if not width or columns(text) <= width:
        return text
    ending = f" + ... ({len(terms)} terms)"
    fitting = next(n for n in range(len(terms) - 1, 0, -1) if n == 1 or columns(_sum(terms[:n]) + ending) <= width)
    return _sum(terms[:fitting]) + ending


#: Agents of a ranking on a short screen.
_RANKED = 10
#: Up to this factor numbers in floats are no larger.
_EQUAL = 1 + 1e-6


def captured_facts(found: Captured) -> Facts:
    """Tell how far constants, and signals that vary, move each other agent; those moved alike stand together.

    Examples
    --------
    >>> from ptcc_certify.report.facts.influence import captured_facts
    >>> for fact in captured_facts(ptcc.influence([("a", "c", 1), ("b", "c", -3)]).captured("b")):
    ...     print(f"{fact.head}: {fact.text}")
    captured: b hears nobody, shows anything within [-1, 1] (exact)
    constant: moves x(T) of c by up to 0.75, of a by 0
    varying: moves nobody farther
    """
    names, standing = [agent_text(agent) for agent in found.agents], _standing(found.exact)
    ending = f"{' hear nobody, show' if names[1:] else ' hears nobody, shows'} {_span(found.radius, found.exact)}"
    brief = (shorten_list(names, _NAMES) + ending,)
    yield Fact(head="captured", value=found.agents, note=", ".join(names) + ending, brief=brief)
    yield _moves("constant", "x(T)", found.constant, standing)
    if all(found.varying[k] <= x * (1 if found.exact else _EQUAL) for k, x in found.constant.items()):
        yield Fact(head="varying", standing=standing, note="moves nobody farther")
    else:
        yield _moves("varying", "x", found.varying, standing)


def ranking_facts(ranked: Sequence[Reach], radius: Fraction, exact: bool, details: bool = True) -> Facts:
    r"""Tell how far each agent, captured alone, moves the others, the farthest first; without details of the first.

    Examples
    --------
    >>> from ptcc_certify.report.facts.influence import ranking_facts
    >>> facts = ranking_facts(ptcc.influence([("a", "c", 1), ("b", "c", -3)]).ranking(), Fraction(1), True)
    >>> print(*(fact.text for fact in facts), sep="\n")
    each alone hears nobody, shows anything within [-1, 1] (exact)
    b: 0.75 in all, c most, by 0.75; varying at most 0.75
    a: 0.25 in all, c most, by 0.25; varying at most 0.25
    c: nobody
    """
    yield Fact(head="captured", note=f"each alone hears nobody, shows {_span(radius, exact)}")
    for reach in ranked if details else ranked[:_RANKED]:
        name, most = (agent_text(label) for label in (reach.agent, reach.moved_most))
        moves = f"{name}: {_up(reach.total)} in all, {most} most, by {_up(reach.largest)}"
        text = f"{moves}; varying at most {_up(reach.varying)}" if reach.varying else f"{name}: nobody"
        yield Fact(head="moves", value=reach.total, side="up", standing=_standing(exact), note=text)
    if not details and len(ranked) > _RANKED:
        yield Fact(head="moves", note=f"... ({len(ranked):,} in all)")


def _span(radius: Fraction, exact: bool) -> str:
    return f"anything within [-{near(radius)}, {near(radius)}] ({'exact' if exact else 'numerical'})"


def _standing(exact: bool) -> Standing:
    return "proved" if exact else "unproved"


def _up(x: Number) -> str:
    return up(x, 4) if x else "0"


def _moves(head: str, what: str, moves: Mapping[str, Number], standing: Standing) -> Fact:
    alike: dict[str, list[str]] = defaultdict(list)
    for label, x in sorted(moves.items(), key=lambda item: -item[1]):
        alike[_up(x)].append(agent_text(label))
    long, short = list[str](), list[str]()
    for size, names in alike.items():
        by = f"by {'' if long or size == '0' else 'up to '}{size}"
        long.append(f"of {', '.join(names)} {by}")
        short.append(f"of {shorten_list(names, _NAMES)} {by}")
    note, brief = f"moves {what} {', '.join(long)}", (f"moves {what} {shorten_list(short, _SHORT)}",)
    return Fact(head=head, value=dict(moves), side="up", standing=standing, note=note, brief=brief)
