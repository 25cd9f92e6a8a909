"""Where the nonzero spectrum of a signed Laplacian lies against a vertical line, exactly, with the standard library.

The Laplacian is block triangular in its strongly connected components, so its spectrum is that of the diagonal blocks.
For each block ``C`` the polynomial ``p(y) = det((l + y) I - L[C, C])`` tells how many eigenvalues lie on ``Re = l`` and
whether another lies left of it; only whether those on the line are semisimple is a matter of the whole Laplacian.
Everything is decided in integers, and no eigenvalue is computed: where entries are rounded, they are enclosed.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from fractions import Fraction
from graphlib import TopologicalSorter
from itertools import pairwise
from typing import Literal, NamedTuple

from lmi.exact.polynomials import (
    Matrix,
    Polynomial,
    characteristic,
    common_divisor,
    derivative,
    divided,
    evaluated,
    primitive,
    product,
    quotient,
    rank,
    remainder,
    shifted,
    squarefree,
)
from lmi.exact.work import cost

#: Largest number of nodes for which the decision is meant to be asked; it takes seconds there.
LARGEST = 120
#: Largest product of N^3 and the bits of an entry of ``rows`` for which it takes seconds.
MOST_WORK = 300_000_000
#: Largest cost of the characteristic polynomial, by :func:`lmi.exact.work.cost`.
MOST_COST = 6_000_000_000
#: Bits with which the array of Routh is enclosed, one after the other, before it is formed exactly.
BITS = (512, 2048, 8192)

Location = Literal["beyond", "on", "defective", "below"]


class OnLine(NamedTuple):
    """Roots on the imaginary axis: ``y^zeros G(y^2)``, with all roots of ``G`` real and negative."""

    zeros: int
    pairs: Polynomial  #: coefficients of ``G``, with its multiple roots


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
    components: Sequence[Sequence[int]],
    still: Collection[int],
    line: Fraction,
    polynomial: Callable[[Matrix], Polynomial] | None = None,
) -> Location:
    """Decide where the nonzero eigenvalues of ``L = rows / unit`` lie against ``Re = line``.

    Parameters
    ----------
    rows
        Rows of ``unit * L``: entries by column.
    unit
        Common denominator of the entries.
    components
        Node indices of every strongly connected component.
    still
        Indices of the components whose block has the simple eigenvalue 0, which are closed and balanced.
    line
        Real part of the line, positive.
    polynomial
        What forms the characteristic polynomial of a block, if not :func:`characteristic`.

    Returns
    -------
    Location
        ``"beyond"``: every nonzero eigenvalue has ``Re > line``. ``"on"``: none has ``Re < line``, some lie on the
        line, and those are semisimple eigenvalues of ``L``. ``"defective"``: none has ``Re < line``, and one on the
        line has a Jordan block of size 2 or more. ``"below"``: one has ``Re < line``.

    Raises
    ------
    ValueError
        ``unit`` or ``line`` is not positive, the components do not part the nodes into blocks of a block triangular
        matrix, or 0 is not a simple eigenvalue of the blocks ``still`` and of no other.

    Notes
    -----
    ``h`` having the distinct eigenvalues on the line, less ``line``, as its simple roots, the kernel of
    ``h(L - line I)`` is the sum of their eigenspaces. With ``m`` the sum of their algebraic multiplicities, they are
    semisimple iff ``rank h(L - line I) = N - m``.

    Examples
    --------
    The nonzero eigenvalues of a directed ring of three are ``3/2 +- i sqrt(3)/2``.

    >>> ring = [{0: 1, 2: -1}, {1: 1, 0: -1}, {2: 1, 1: -1}]
    >>> [nonzero_spectrum_beyond(ring, 1, [[0, 1, 2]], {0}, Fraction(n, 2)) for n in (2, 3, 4)]
    ['beyond', 'on', 'below']

    A leader, its follower, and the follower of that: the eigenvalue 1 twice, in one Jordan block.

    >>> chain = [{}, {1: 1, 0: -1}, {2: 1, 1: -1}]
    >>> nonzero_spectrum_beyond(chain, 1, [[0], [1], [2]], {0}, Fraction(1))
    'defective'
    """
    if unit <= 0 or line <= 0:
        raise ValueError("the unit and the real part of the line must be positive")
    _check_blocks(rows, components, still)
    place = unit * line
    found: dict[tuple[object, ...], OnLine | None] = {}
    on_line: list[OnLine] = []
    for index, nodes in sorted(enumerate(components), key=lambda item: len(item[1])):
        block = _block(rows, nodes)
        key = (index in still, *(tuple(sorted(row.items())) for row in block))
        if key not in found:
            p = (polynomial or characteristic)(block)
            found[key] = _roots_on_axis(shifted(_nonzero_part(p, index in still), place))
        roots = found[key]
        if roots is None:
            return "below"
        if roots.zeros or len(roots.pairs) > 1:
            on_line.append(roots)
    if not on_line:
        return "beyond"
    count = sum(roots.zeros + 2 * (len(roots.pairs) - 1) for roots in on_line)
    zero = any(roots.zeros for roots in on_line)
    pairs = [1]
    for roots in on_line:
        simple = squarefree(roots.pairs)
        pairs = product(pairs, divided(simple, common_divisor(pairs, simple)))
    if zero + 2 * (len(pairs) - 1) == count:
        return "on"
    # y = b x - a at the eigenvalue x of `rows`, as in `shifted`.
    a, b = place.numerator, place.denominator
    moved = [{**{j: b * v for j, v in row.items()}, i: b * row.get(i, 0) - a} for i, row in enumerate(rows)]
    return "on" if rank(evaluated(pairs, zero, moved)) == len(rows) - count else "defective"


def _check_blocks(rows: Matrix, components: Sequence[Sequence[int]], still: Collection[int]) -> None:
    """Raise unless the components part the nodes, no two hear each other, and ``still`` indexes them."""
    if sorted(i for nodes in components for i in nodes) != list(range(len(rows))):
        raise ValueError("the components do not part the nodes")
    if not all(0 <= index < len(components) for index in still):
        raise ValueError("there is no such component")
    member = {i: index for index, nodes in enumerate(components) for i in nodes}
    if any(j not in member for row in rows for j in row):
        raise ValueError("a row has an entry in no column")
    heard = {
        index: {member[j] for i in nodes for j, v in rows[i].items() if v} - {index}
        for index, nodes in enumerate(components)
    }
    TopologicalSorter(heard).prepare()  # a CycleError is a ValueError


def _block(rows: Matrix, nodes: Sequence[int]) -> list[dict[int, int]]:
    place = {node: k for k, node in enumerate(nodes)}
    return [{place[j]: v for j, v in rows[i].items() if v and j in place} for i in nodes]


def _nonzero_part(p: Polynomial, still: bool) -> Polynomial:
    """Return the characteristic polynomial of a block, divided by ``x`` if its simple eigenvalue is 0."""
    if still:
        if p[-1]:
            raise ValueError("a block said to have the eigenvalue 0 is regular")
        p = p[:-1]
    if not p[-1]:
        raise ValueError("a block has the eigenvalue 0 more often than said")
    return p


def _roots_on_axis(p: Polynomial) -> OnLine | None:
    """Return the roots of a monic integer polynomial on the imaginary axis, or None if it has a root with ``Re < 0``.

    With the zero roots taken out, ``p = g p1``, the roots of ``g(y) = G(y^2)`` being those on the axis and all other
    pairs ``y, -y``. So no root is left of the axis iff ``G`` has real negative roots only and those of ``p1`` lie in
    ``Re > 0``. The array of Routh of ``p(-y)`` tells the second; it is tried with rounded entries first.
    """
    zeros = 0
    while not p[-1]:
        p, zeros = p[:-1], zeros + 1
    p = [-c if k % 2 else c for k, c in enumerate(p)]
    if any(c < 0 for c in p):  # neither a factor y + r nor (y + r)^2 + s^2 with r >= 0 brings in a minus
        return None
    pairs = [1]
    tries = list(reversed(BITS))
    while tries:
        sign, divisor = _rounded_array(p, tries[-1])
        if sign < 0:
            return None
        if sign > 0:
            break
        # p is monic with integer coefficients, and so is each monic divisor.
        rest = quotient(p, _of_square(divisor)) if len(divisor) > 1 else None
        if rest is None:
            tries.pop()
        else:
            p, pairs = rest, product(pairs, divisor)
    else:
        left = _array(p)
        if left is None:
            return None
        pairs = product(pairs, left)
    return OnLine(zeros, pairs) if _negative_roots(pairs) else None


def _rounded_array(p: Polynomial, bits: int) -> tuple[int, Polynomial]:
    """Enclose the array of Routh, each row up to a positive factor, in integers of so many bits.

    Returns
    -------
    sign : int
        1: the first column is positive. -1: its first entry that is not positive is negative. 0: neither is told.
    divisor : list of int
        If a row may vanish: coefficients in ``y^2`` of the row above, made monic and rounded to integers.
    """
    # In units of 2^shift, about the mean size of a root, no coefficient dwarfs the others.
    shift = abs(p[-1]).bit_length() // (len(p) - 1) if len(p) > 1 else 0
    level = [(c << shift * k, c << shift * k) for k, c in zip(range(len(p) - 1, -1, -1), p, strict=True)]
    above, row = _cut(level[::2], bits), _cut(level[1::2], bits)
    while row:
        (low, high), (least, most) = row[0], above[0]
        if high < 0:
            return -1, []
        if low <= 0:
            if any(u > 0 or v < 0 for u, v in row):
                return 0, []
            unit = 2 * (least + most)
            return 0, [((2 * (u + v) << 2 * shift * k) + unit // 2) // unit for k, (u, v) in enumerate(above)]
        after = [
            (
                (low if u >= 0 else high) * u - (most if y >= 0 else least) * y,
                (high if v >= 0 else low) * v - (least if x >= 0 else most) * x,
            )
            for (u, v), (x, y) in zip(above[1:], [*row[1:], (0, 0)], strict=False)
        ]
        above, row = row, _cut(after, bits)
    return 1, []


def _cut(row: list[tuple[int, int]], bits: int) -> list[tuple[int, int]]:
    """Divide intervals by the power of 2 that leaves so many bits to the longest end, outwards."""
    cut = max((max(abs(u), abs(v)).bit_length() for u, v in row), default=0) - bits
    return [(u >> cut, -(-v >> cut)) for u, v in row] if cut > 0 else row


def _array(p: Polynomial) -> Polynomial | None:
    """Return the ``G`` of ``p`` by Routh's array in integers, or None if the column above it is not positive.

    The array is Euclid's algorithm on the parts of ``p`` of even and odd exponents: a row that vanishes leaves the row
    above it as their greatest common divisor ``g``, and the rows down to that one are ``g`` times those of ``p / g``.
    With ``D_k`` the minors of the matrix of Hurwitz, ``R_k = D_(k-1) * (row k of Routh)`` has integer entries,
    ``R_k[0] = D_k``, and ``R_(k+1)[j] = (R_k[0] R_(k-1)[j+1] - R_(k-1)[0] R_k[j+1]) / D_(k-2)``.

    Examples
    --------
    >>> _array([1, 1, 3, 3]), _array([1, 1, 1, 3]), _array([1, 2, 1, 1])
    ([1, 3], None, [1])
    """
    above, row = p[::2], p[1::2]
    divisor = before = 1
    while any(row):
        if row[0] <= 0:
            return None
        head, lead = row[0], above[0]
        after = [(head * u - lead * v) // divisor for u, v in zip(above[1:], [*row[1:], 0], strict=False)]
        above, row = row, after
        divisor, before = before, head
    return primitive(above)


def _of_square(p: Polynomial) -> Polynomial:
    """Return ``p(y^2)``."""
    result = [0] * (2 * len(p) - 1)
    result[::2] = p
    return result


def _negative_roots(p: Polynomial) -> bool:
    """Whether all complex roots of a polynomial that is not 0 at 0 are real and negative, by Sturm's theorem."""
    chain = [p, derivative(p)]
    while chain[-1]:
        chain.append([-c for c in remainder(chain[-2], chain[-1])])
    chain.pop()
    far = [q[0] * (-1) ** (len(q) - 1) for q in chain]
    near = [q[-1] for q in chain]
    # The chain ends in gcd(p, p'): distinct roots are as many as the degree of p less that of the gcd.
    return _variations(far) - _variations(near) == len(p) - len(chain[-1])


def _variations(values: Sequence[int]) -> int:
    signs = [v > 0 for v in values if v]
    return sum(a != b for a, b in pairwise(signs))
