"""Where the nonzero spectrum of a signed Laplacian lies against a vertical line, exactly, with the standard library.

The characteristic polynomial, moved to the line, tells how many eigenvalues lie on it and whether one lies left of it.
Everything is decided in integers, and no eigenvalue is computed: where entries are rounded, they are enclosed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from math import gcd
from typing import Literal

from lmi.exact.numbers import longest
from lmi.exact.polynomials import Matrix, Polynomial, characteristic, evaluated, product, quotient, rank, shifted
from lmi.exact.work import cost, spend

#: Largest number of nodes for which the decision is meant to be asked; it takes seconds there.
LARGEST = 120
#: Largest product of N^3 and the bits of an entry of ``rows`` for which it takes seconds.
MOST_WORK = 300_000_000
#: Largest cost of the characteristic polynomial, by :func:`lmi.exact.work.cost`.
MOST_COST = 6_000_000_000
#: Bits with which the array of Routh is enclosed, one after the other, before it is formed exactly.
BITS = (512, 2048, 8192)

Location = Literal["beyond", "on", "defective", "below"]


def tractable(rows: Matrix, unit: int, line: Fraction = Fraction(1)) -> bool:
    """Tell whether :func:`nonzero_spectrum_beyond` takes some seconds at most.

    Examples
    --------
    >>> tractable([{0: 1, 1: -1}, {}], 1), tractable([{0: 1}] * 121, 1)
    (True, False)
    """
    longest = max((abs(x).bit_length() for row in rows for x in row.values()), default=0)
    n, bits = len(rows), max(longest, (unit * line).numerator.bit_length(), line.denominator.bit_length())
    return n <= LARGEST and n**3 * bits <= MOST_WORK and cost(n**3, n * bits, bits) <= MOST_COST


def nonzero_spectrum_beyond(
    rows: Matrix,
    unit: int,
    line: Fraction,
    parts: Iterable[Sequence[int]] | None = None,
    polynomial: Callable[[Matrix], Polynomial] = characteristic,
) -> Location:
    """Decide where the nonzero eigenvalues of ``L = rows / unit`` lie against ``Re = line``.

    Parameters
    ----------
    rows
        Rows of ``unit * L``: entries by column.
    unit
        Common denominator of the entries.
    line
        Real part of the line, positive.
    parts
        Strong components of the graph of ``rows``, each node in one: ``L`` is block triangular, and its characteristic
        polynomial the product of those of the blocks. None: one part.
    polynomial
        What forms the characteristic polynomial.

    Returns
    -------
    Location
        ``"beyond"``: every nonzero eigenvalue has ``Re > line``. ``"on"``: none has ``Re < line``, some lie on the
        line, and those are semisimple eigenvalues of ``L``. ``"defective"``: none has ``Re < line``, and one on the
        line has a Jordan block of size 2 or more. ``"below"``: one has ``Re < line``.

    Raises
    ------
    ValueError
        ``unit`` or ``line`` is not positive.
    WorkError
        The exact array would take longer than :func:`lmi.exact.work.limited` allows.

    Notes
    -----
    ``h`` having the distinct eigenvalues on the line, less ``line``, as its simple roots, the kernel of
    ``h(L - line I)`` is the sum of their eigenspaces. With ``m`` the sum of their algebraic multiplicities, they are
    semisimple iff ``rank h(L - line I) = N - m``.

    Examples
    --------
    >>> ring = [{0: 2, 2: -2}, {0: -2, 1: 2}, {1: -2, 2: 2}]
    >>> nonzero_spectrum_beyond(ring, 1, Fraction(3)), nonzero_spectrum_beyond(ring, 1, Fraction(4))
    ('on', 'below')
    """
    if unit <= 0 or line <= 0:
        raise ValueError("the unit or the line is not positive")
    on_line, place = [1], unit * line
    for nodes in [range(len(rows))] if parts is None else parts:
        index = {v: i for i, v in enumerate(nodes)}
        p = polynomial([{index[j]: x for j, x in rows[v].items() if j in index} for v in nodes])
        while not p[-1]:  # an eigenvalue 0
            p = p[:-1]
        roots = _roots_on_axis(shifted(p, place))
        if roots is None:
            return "below"
        if roots[0]:
            on_line = product(on_line, p)
    roots = _roots_on_axis(shifted(on_line, place))
    assert roots is not None  # those of parts that have none below
    count, simple = roots
    if len(simple) - 1 == count:
        return "on" if count else "beyond"
    # y = b x - a at the eigenvalue x of `rows`, as in `shifted`.
    a, b = place.as_integer_ratio()
    matrix = [{**{j: b * v for j, v in row.items()}, i: b * row.get(i, 0) - a} for i, row in enumerate(rows)]
    return "on" if rank(evaluated(simple, matrix)) == len(rows) - count else "defective"


def _roots_on_axis(p: Polynomial) -> tuple[int, Polynomial] | None:
    """Return how many roots lie on the imaginary axis, and what has each of them once; None if one has ``Re < 0``.

    ``p`` is monic with integer coefficients. With the zero roots taken out, ``p = g p1``, the roots of
    ``g(y) = G(y^2)`` being those on the axis and all other pairs ``y, -y``. So no root is left of the axis iff all
    roots of ``g`` are on it and those of ``p1`` lie in ``Re > 0``. By the theorem of Hermite and Biehler the roots of
    ``g`` are on the axis iff ``g + g' = gcd(g, g') h`` with all roots of ``h`` in ``Re < 0``.

    Examples
    --------
    >>> _roots_on_axis([1, -1, 2, -2, 1, -1, 0]), _roots_on_axis([1, 0, -1])  # y (y^2 + 1)^2 (y - 1), y^2 - 1
    ((5, [1, 0, 1, 0]), None)
    """
    size = len(p)
    while not p[-1]:
        p = p[:-1]
    zeros = size - len(p)
    G = _symmetric_part([-c if k % 2 else c for k, c in enumerate(p)])
    if G is None:
        return None
    g = _of_square(G)
    repeated = _symmetric_part(
        [c + (len(g) - k) * before for k, (before, c) in enumerate(zip([0, *g], g, strict=False))]
    )
    simple = None if repeated is None else quotient(g, _of_square(repeated))
    if simple is None:
        return None
    return zeros + len(g) - 1, [*simple, 0] if zeros else simple


def _symmetric_part(p: Polynomial) -> Polynomial | None:
    """Return the ``G`` of ``p = G(y^2) h`` for which all roots of ``h`` have ``Re < 0``; None if there is none.

    ``p`` is monic with integer coefficients, and not 0 at 0. The array of Routh is Euclid's algorithm on its parts of
    even and odd exponents: its first column is positive down to a row that vanishes below ``G``, or to the end.
    """
    if any(c < 0 for c in p):  # neither a factor y + r nor (y + r)^2 + s^2 with r >= 0 brings in a minus
        return None
    part = [1]
    for bits in (*BITS, None):
        stable, divisor = _array(p, bits)
        # p is monic with integer coefficients, and so is each monic divisor.
        while len(divisor) > 1 and (rest := quotient(p, _of_square(divisor))) is not None:
            p, part = rest, product(part, divisor)
            stable, divisor = _array(p, bits)
        if stable is not None:
            return part if stable else None
    raise AssertionError("the exact array decides")


def _array(p: Polynomial, bits: int | None) -> tuple[bool | None, Polynomial]:
    """Enclose the array of Routh, each row up to a positive factor, in integers of so many bits; None: exactly.

    Returns
    -------
    stable : bool or None
        Whether the first column is positive; None: that is not told.
    divisor : list of int
        If a row may vanish: coefficients in ``y^2`` of the row above, made monic and rounded to integers.
    """
    # In units of 2^shift, about the mean size of a root, no coefficient dwarfs the others.
    shift = abs(p[-1]).bit_length() // (len(p) - 1) if len(p) > 1 else 0
    level = [(c << shift * k, c << shift * k) for k, c in zip(range(len(p) - 1, -1, -1), p, strict=True)]
    above, row = _cut(level[::2], bits), _cut(level[1::2], bits)
    while row:
        spend(4 * len(row), longest(v for _, v in row), longest(v for _, v in above), "an array of Routh")
        (low, high), (least, most) = row[0], above[0]
        if high < 0:
            return False, []
        if low <= 0:
            if any(u > 0 or v < 0 for u, v in row):
                return (False if bits is None else None), []
            unit = 2 * (least + most)
            return None, [((2 * (u + v) << 2 * shift * k) + unit // 2) // unit for k, (u, v) in enumerate(above)]
        after = [
            (
                (low if u >= 0 else high) * u - (most if y >= 0 else least) * y,
                (high if v >= 0 else low) * v - (least if x >= 0 else most) * x,
            )
            for (u, v), (x, y) in zip(above[1:], [*row[1:], (0, 0)], strict=False)
        ]
        above, row = row, _cut(after, bits)
    return True, []


def _cut(row: list[tuple[int, int]], bits: int | None) -> list[tuple[int, int]]:
    """Divide intervals by the power of 2 that leaves so many bits, outwards; None: numbers by their common divisor."""
    if bits is None:
        size = longest(u for u, _ in row)  # common divisors and quotients are found digit by digit
        spend(2 * len(row) * (size // 30 + 1), 30, size, "an array of Routh")
        content = gcd(*(u for u, _ in row)) or 1
        return [(u // content, u // content) for u, _ in row]
    cut = max((max(abs(u), abs(v)).bit_length() for u, v in row), default=0) - bits
    return [(u >> cut, -(-v >> cut)) for u, v in row] if cut > 0 else row


def _of_square(p: Polynomial) -> Polynomial:
    """Return ``p(y^2)``."""
    result = [0] * (2 * len(p) - 1)
    result[::2] = p
    return result
