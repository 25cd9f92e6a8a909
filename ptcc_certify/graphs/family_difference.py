"""In what two families of graphs differ; one line that says which."""

from __future__ import annotations

from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.rationals import shorten


def family_difference(one: Family, other: Family) -> str | None:
    """Tell in what a family differs from another: nodes, modes, edges; None if they are equal.

    Parameters
    ----------
    one : Family
        The one that is meant, of a certificate.
    other : Family
        The one at hand.

    Examples
    --------
    >>> family_difference(Family.from_intervals([("a", "b", 1, 2)]), Family.from_intervals([("a", "b", 1, 3)]))
    'the certificate alone has ["a", "b", "1", "2"], and the files alone ["a", "b", "1", "3"]'
    """
    if one.sha256 == other.sha256:
        return None
    if odd := sorted(set(one.labels) ^ set(other.labels)):
        return f"the {'certificate' if odd[0] in one.labels else 'files'} alone has node {shorten(odd[0])}"
    if len(one.modes) != len(other.modes):
        return f"{len(one.modes)} modes in the certificate, {len(other.modes)} in the files"
    rows = [[tuple(mode.lines()) for mode in family.modes] for family in (one, other)]
    if sorted(rows[0]) == sorted(rows[1]):
        names = ", ".join(shorten(mode.name) for mode in one.modes)
        return f"the modes are in another order, in the certificate {names}"
    number = next(k for k, (first, second) in enumerate(zip(*rows, strict=True)) if first != second)
    first, second = (set(part[number]) for part in rows)
    alone = [
        f"the {where} alone {'has ' if k == 0 or not first - second else ''}{shorten(min(some), 120)}"
        for k, (where, some) in enumerate((("certificate", first - second), ("files", second - first)))
        if some
    ]
    mode = f"in mode {shorten(one.modes[number].name)} " if len(one.modes) > 1 else ""
    return mode + ", and ".join(alone)
