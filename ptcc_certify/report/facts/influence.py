"""Facts of who decides whom: on whose initial states final states depend, and how much."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ptcc_certify.certificate.fact import Fact, Facts
from ptcc_certify.errors import labelled
from ptcc_certify.report.text_layout import agent_text, printable, shorten_list

if TYPE_CHECKING:
    from ptcc_certify.bounds.final_state.of_graph import Influence

#: Nodes above which sums are told without each node's row.
_ROWS = 60
#: Columns of a list on a short screen.
_SHORT = 140


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
    texts = [f"{labelled(agent_text(labels[j]))} {100 * shares[j]:.3g} %" for j in order]
    yield Fact(head="decides", value={labels[j]: float(shares[j]) for j in order}, note=shorten_list(texts, _SHORT))
    if len(labels) > _ROWS:
        return
    groups: dict[tuple[tuple[int, object], ...], list[str]] = defaultdict(list)
    for k, label in enumerate(labels):
        groups[tuple(who.row(k).items())].append(labelled(agent_text(label)))
    told: list[str] = []
    for row, names in groups.items():
        verb = "" if told else "end " if len(names) > 1 else "ends "
        told.append(f"{', '.join(names)} {verb}at {_sum(dict(row), labels)}")
    yield Fact(head="x(T)", note=", ".join(told), brief=(shorten_list(told, _SHORT),))


def _sum(row: dict[int, Any], labels: Sequence[str]) -> str:
    """Write a weighted sum of initial states, rounded; 0 where there is none."""
    text = ""
    for j, weight in row.items():
        number, name = f"{abs(float(weight)):.3g}", f"x_{labelled(printable(labels[j]))}"
        sign = "-" if weight < 0 else "+"
        term = name if number == "1" else f"{number} {name}"
        text += f" {sign} {term}" if text else (f"-{term}" if sign == "-" else term)
    return text or "0"
