"""Any controllable linear agent with one input as an agent of order n, by a rational change of coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from ptcc_certify.errors import NumberError, ParameterError, gated
from ptcc_certify.graphs.rationals import as_fraction, shorten
from ptcc_certify.model.agents import MOST_ORDER, Agents

Rows = tuple[tuple[Fraction, ...], ...]


@dataclass(frozen=True)
class CompanionForm:
    """The agent ``x' = A x + B u`` in the coordinates ``xi = R x`` of an agent of order n.

    Attributes
    ----------
    plant : tuple of n Fraction
        ``a``, the coefficients of the characteristic polynomial of ``A``: ``xi_1^(n) + a_n xi_1^(n-1) + .. = u``.
    transformation : n rows of n Fraction
        ``R``; its first row is the position of the chain.
    """

    plant: tuple[Fraction, ...]
    transformation: Rows

    def agents(self, **options: Any) -> Agents:
        """Return agents with this equation; options are those of :class:`Agents`."""
        return Agents(plant=self.plant, **options)

    def derivatives(self, states: Sequence[Sequence[Any]]) -> list[list[Fraction]]:
        """Return position, velocity and so on of the chains, a list over the agents of each, of N states of n numbers.

        Raises
        ------
        ParameterError
            A state has not n numbers.
        """
        rows = _rows(states, "states")
        if any(len(row) != len(self.plant) for row in rows):
            raise ParameterError(f"a state of these agents has {len(self.plant)} numbers; give N rows of so many")
        return [[_dot(r, row) for row in rows] for r in self.transformation]


@gated
def companion_form(A: Sequence[Sequence[Any]], B: Sequence[Any]) -> CompanionForm:
    """Return a controllable agent ``x' = A x + B u`` as an agent of order n.

    With ``c' = e_n' [B, A B, .., A^(n-1) B]^-1`` and the rows ``c', c'A, .., c'A^(n-1)`` of ``R``, the chain
    ``xi = R x`` has ``xi_i' = xi_(i+1)`` and ``xi_n' = -a'xi + u``.

    Parameters
    ----------
    A : n rows of n numbers
    B : n numbers, or one column of them

    Returns
    -------
    CompanionForm

    Raises
    ------
    ParameterError
        The sizes do not fit, or the agent is not controllable: the combination of states that no input moves is named.

    Examples
    --------
    >>> form = companion_form([[0, 1], [-4, 0]], [1, 1])
    >>> [str(a) for a in form.plant], [[str(x) for x in row] for row in form.transformation]
    (['4', '0'], [['1/5', '-1/5'], ['4/5', '1/5']])
    >>> companion_form([[1, 0], [0, 2]], [1, 0])
    Traceback (most recent call last):
    ptcc_certify.errors.ParameterError: (A, B) is not controllable: with q = (0, 1), q'B = 0 and q'A = 2 q', so that \
no input moves q'x; leave that part out
    """
    matrix, columns = _rows(A, "A"), _rows(_as_column(B), "B")
    n = len(matrix)
    if any(len(row) != 1 for row in columns):
        raise ParameterError("B has several columns; agents have one input each, in every coordinate of space")
    column = [row[0] for row in columns]
    if not 1 <= n <= MOST_ORDER or any(len(row) != n for row in matrix) or len(column) != n:
        raise ParameterError(f"A is n x n and B has n numbers, n = 1 to {MOST_ORDER}")
    powers = [column]
    for _ in range(n):
        powers.append([_dot(row, powers[-1]) for row in matrix])
    # the rows are B, A B, .., so that c solves [B, A B, ..]'c = e_n, and a solves sum_i a_i A^(i-1) B = -A^n B
    c, null = _solve(powers[:n], [Fraction(i == n - 1) for i in range(n)])
    if null is not None:
        raise ParameterError(_uncontrollable(matrix, null))
    plant, _ = _solve([list(row) for row in zip(*powers[:n], strict=True)], [-x for x in powers[n]])
    rows = [c]
    for _ in range(n - 1):
        rows.append([_dot(rows[-1], part) for part in zip(*matrix, strict=True)])
    return CompanionForm(tuple(plant), tuple(map(tuple, rows)))


def _as_column(B: Any) -> Any:
    """Return a list of numbers as a column, and a column as it is."""
    try:
        return [x if hasattr(x, "__len__") and not isinstance(x, str) else [x] for x in B]
    except TypeError:
        raise ParameterError("B", f"= {shorten(repr(B))} is no list; give n numbers") from None


def _rows(values: Any, name: str) -> list[list[Fraction]]:
    """Return rows of numbers, or refuse them."""
    if isinstance(values, str):
        raise ParameterError(name, f"= {shorten(repr(values))} is no list; give rows of numbers")
    try:
        rows = [list(row) for row in values]
    except TypeError:
        raise ParameterError(name, f"= {shorten(repr(values))} is no matrix; give rows of numbers") from None
    return [[_exact(x, f"an entry of {name}") for x in row] for row in rows]


def _uncontrollable(A: Sequence[Sequence[Fraction]], q: Sequence[Fraction]) -> str:
    """Tell which combination of states no input moves; it is a left eigenvector if there is but one."""
    image = [_dot(q, part) for part in zip(*A, strict=True)]
    place = next(i for i, x in enumerate(q) if x)
    value = image[place] / q[place]
    named = f"({', '.join(map(str, q))})"
    eigen = f" and q'A = {value} q'" if image == [value * x for x in q] else ""
    return (
        f"(A, B) is not controllable: with q = {shorten(named, 200)}, q'B = 0{eigen}, so that no input moves q'x; "
        "leave that part out"
    )


def _solve(M: Sequence[Sequence[Fraction]], right: Sequence[Fraction]) -> tuple[list[Fraction], list[Fraction] | None]:
    """Return the solution of ``M c = right`` and None; of a singular ``M`` nothing, and a vector of its kernel."""
    import flint

    n = len(M)
    entries = [flint.fmpq(x.numerator, x.denominator) for row, b in zip(M, right, strict=True) for x in (*row, b)]
    reduced, _ = flint.fmpq_mat(n, n + 1, entries).rref()
    rows = [[Fraction(int(x.p), int(x.q)) for x in row] for row in reduced.tolist()]
    pivots = [next(j for j, x in enumerate(row) if x) for row in rows if any(row[:n])]
    if len(pivots) == n:
        return [row[n] for row in rows], None
    free = next(j for j in range(n) if j not in pivots)
    kernel = [Fraction(j == free) for j in range(n)]
    for k, j in enumerate(pivots):
        kernel[j] = -rows[k][free]
    return [], kernel


def _dot(x: Sequence[Fraction], y: Sequence[Fraction]) -> Fraction:
    return sum((a * b for a, b in zip(x, y, strict=True)), Fraction(0))


def _exact(value: Any, name: str) -> Fraction:
    try:
        return as_fraction(value, name)
    except NumberError:
        raise ParameterError(f"{name}, {shorten(str(value))}, is not a finite number") from None
