"""Whether two families of graphs have the same modes, in any order; if not, one line that says in what they differ."""

from __future__ import annotations

from collections import defaultdict

from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.rationals import shorten


def mode_order(one: Family, other: Family) -> tuple[int, ...] | None:
    """Return the positions in ``other`` of the modes of ``one``; None if these are not the same modes.

    A family is the same in any order of its modes, whatever these are called.

    Examples
    --------
    >>> day, night = (Family.from_intervals([("a", "b", w, w)]) for w in (1, 2))
    >>> mode_order(Family.switching([day, night]), Family.switching([night, day]))
    (1, 0)
    >>> mode_order(day, night) is None
    True
    """
    if one.sha256 == other.sha256:
        return tuple(range(len(one.modes)))
    if sorted(one.labels) != sorted(other.labels) or len(one.modes) != len(other.modes):
        return None
    order = _matches(one, other)
    return None if None in order else tuple(k for k in order if k is not None)


def family_difference(one: Family, other: Family) -> str | None:
    """Tell in what a family differs from another: nodes, modes, edges; None if they have the same modes.

    Parameters
    ----------
    one : Family
        The one that is meant, of a certificate.
    other : Family
        The one at hand.

    Examples
    --------
    >>> family_difference(Family.from_intervals([("a", "b", 1, 2)]), Family.from_intervals([("a", "b", 1, 3)]))
    '["a", "b", "1", "2"] is only in the certificate, and ["a", "b", "1", "3"] is only in the files'
    """
    if mode_order(one, other) is not None:
        return None
    if odd := sorted(set(one.labels) ^ set(other.labels)):
        return f"node {shorten(odd[0])} is only in the {'certificate' if odd[0] in one.labels else 'files'}"
    if len(one.modes) != len(other.modes):
        modes = len(one.modes)
        return f"{modes} mode{'s' * (modes > 1)} in the certificate, {len(other.modes)} in the files"
    pairs = _different_modes(one, other)
    number, place = pairs[0]
    first, second = (set(f.modes[k].marked_lines()) for f, k in ((one, number), (other, place)))
    alone = [
        f"{shorten(min(some), 120)} is only in the {where}"
        for where, some in (("certificate", first - second), ("files", second - first))
        if some
    ]
    return _mode_text(one, other, pairs) + ", and ".join(alone)


def _matches(one: Family, other: Family) -> list[int | None]:
    """Return for every mode of a family the position of an equal one in another, each taken once; None without."""
    places = defaultdict(list)
    for number, mode in enumerate(other.modes):
        places[tuple(mode.marked_lines())].append(number)
    equal = [places[tuple(mode.marked_lines())] for mode in one.modes]
    return [numbers.pop(0) if numbers else None for numbers in equal]


def _different_modes(one: Family, other: Family) -> list[tuple[int, int]]:
    """Return pairs of positions of modes that differ: those of one name, then the others as they come."""
    order = _matches(one, other)
    mine = [k for k, place in enumerate(order) if place is None]
    theirs = [k for k in range(len(other.modes)) if k not in order]
    named = {other.modes[k].name: k for k in reversed(theirs)}
    pairs = [(k, named.pop(one.modes[k].name)) for k in mine if one.modes[k].name in named]  # names may occur twice
    rest = [k for k in mine if k not in {first for first, _ in pairs}]
    return pairs + list(zip(rest, [k for k in theirs if k not in {second for _, second in pairs}], strict=True))


def _mode_text(one: Family, other: Family, pairs: list[tuple[int, int]]) -> str:
    """Name the first of two modes that differ, and tell how many more do."""
    if len(one.modes) == 1:
        return ""
    name, also = (shorten(family.modes[k].name) for family, k in zip((one, other), pairs[0], strict=True))
    remarks = [f"{also} of the files"] * (also != name) + [f"one of {len(pairs)} that differ"] * (len(pairs) > 1)
    return f"in mode {name} " + f"({', '.join(remarks)}) " * bool(remarks)
