"""Intervals in words, rounded outwards."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from lmi.exact.decimal_rounding import down, up
from ptcc_certify.report.text_layout import TEXT, agent_text, short_number, shorten_list


def interval_text(ends: tuple[Fraction, Fraction] | None) -> str:
    """Tell an interval, rounded outwards.

    Examples
    --------
    >>> interval_text((Fraction(1, 3), Fraction(2, 3))), interval_text((Fraction(1), Fraction(1)))
    ('in [0.33333, 0.66667]', 'at 1')
    """
    if ends is None:
        return "no limit is claimed"
    low, high = ends
    return f"at {short_number(low)}" if low == high else f"in [{down(low, 5)}, {up(high, 5)}]"


def intervals_text(labels: Sequence[str], states: Sequence[tuple[Fraction, Fraction] | None], width: int) -> str:
    """Tell the intervals of agents, those with the same one together.

    Examples
    --------
    >>> both = (Fraction(0), Fraction(1))
    >>> from ptcc_certify.errors import unlabelled
    >>> unlabelled(intervals_text(["a", "b", "c"], [both, both, None], 80))
    'a, b in [0, 1], c no limit is claimed'
    >>> intervals_text(["a", "b"], [both, both], 80)
    'every agent in [0, 1]'
    """
    groups: dict[str, list[str]] = {}
    for label, ends in zip(labels, states, strict=True):
        groups.setdefault(interval_text(ends), []).append(agent_text(label))
    if len(groups) == 1 < len(states):
        return f"every agent {next(iter(groups))}"
    texts = [f"{shorten_list(names, 24 if width < 4 * TEXT else 4 * TEXT)} {ends}" for ends, names in groups.items()]
    return shorten_list(texts, width)
