"""Facts of who decides whom: on whose initial states final states depend, and how much."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ptcc_certify.certificate.fact import Fact, Facts
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
    """Write the terms of a weighted sum of initial states, each with its sign, rounded, labels shortened."""
    sizes = [
        ("-" if weight < 0 else "+", f"{abs(float(weight)):.3g}", agent_text(labels[j], width)) for j, weight in row
    ]
    return [f"{sign} {'' if size == '1' else f'{size} '}x_{name}" for sign, size, name in sizes]


def _sum(terms: Sequence[str], width: int = 0) -> str:
    """Write a sum, 0 where it has no terms; of one that is wider, the first terms and how many there are."""
    text = " ".join(terms).removeprefix("+ ")
    text = "-" + text[2:] if text.startswith("- ") else text or "0"
    if not width or columns(text) <= width:
        return text
    ending = f" + ... ({len(terms)} terms)"
    fitting = next(n for n in range(len(terms) - 1, 0, -1) if n == 1 or columns(_sum(terms[:n]) + ending) <= width)
    return _sum(terms[:fitting]) + ending
