"""Facts of a comparison of protocols: when everybody rests, and what input it takes."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any, NamedTuple

from lmi.exact.decimal_rounding import near, up
from ptcc_certify.bounds.settling import Settling
from ptcc_certify.certificate.fact import Fact, Facts
from ptcc_certify.model.base import NominalProtocol


class Row(NamedTuple):
    """One protocol: its name, its law as a text, when everybody rests, and its largest input, None where unproved."""

    name: str
    law: str
    by: Fraction | None
    from_anywhere: Fraction | None
    input: Fraction | None

    def told(self) -> dict[str, Any]:
        """Return the row for JSON, numbers as texts."""
        return {key: None if x is None else str(x) for key, x in self._asdict().items() if key != "name"}


def row_of_powers(name: str, factor: Fraction, powers: Sequence[Fraction], found: Settling) -> Row:
    """Return the row of a protocol of powers.

    Examples
    --------
    >>> from ptcc_certify.report.facts.compare import row_of_powers
    >>> row_of_powers("finite", Fraction(2), [Fraction(1, 2)], Settling(None, None, Fraction(1))).law
    'u = 2 |e|^(1/2) sgn e'
    """
    times = "" if factor == 1 else f"{near(factor)} "
    if list(powers) == [1]:
        return Row(name, f"u = {times}e", found.by, found.from_anywhere, found.input)
    each = " + ".join(f"|e|^({p})" if p.denominator > 1 else f"|e|^{p}" for p in powers)
    law = f"u = {times}{f'({each})' if len(powers) > 1 else each} sgn e"
    return Row(name, law, found.by, found.from_anywhere, found.input)


def row_of_protocol(protocol: NominalProtocol, largest: Fraction | None) -> Row:
    """Return the row of the prescribed-time protocol, of which the largest input is known, or not."""
    pole = near(protocol.rho2 * protocol.kappa)
    law = f"u = ({near(protocol.rho1)} + {pole}/({near(protocol.T)} - t)) e"
    return Row("prescribed", law, protocol.T, protocol.T, largest)


def compare_facts(rows: Sequence[Row]) -> Facts:
    """Tell of each protocol when everybody rests, whether from everywhere, and its largest input."""
    for row in rows:
        if row.name == "asymptotic":
            rests = "never at rest"
        elif row.by is None:
            rests = "no time is proved"
        elif row.name == "prescribed":
            rests = f"at rest at {near(row.by)}, from everywhere"
        else:
            here, far = (None if x is None else up(x, 3) for x in (row.by, row.from_anywhere))
            rest = "later from farther away" if far is None else f"{'' if far == here else f'by {far} '}from everywhere"
            rests = f"at rest by {here}, {rest}"
        size = "input not proved bounded" if row.input is None else f"|u_k| <= {up(row.input, 4)}"
        yield Fact(head=row.name, value=row.by, side="up", note=f"{row.law}: {rests}; {size}")
