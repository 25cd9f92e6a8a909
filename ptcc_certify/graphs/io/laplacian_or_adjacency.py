"""Laplacians among matrices: told from their diagonal, so that none is taken for an adjacency matrix."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

#: How far, relative to the entries, sums may be off by rounding; no weight is computed from them.
_ROUNDED = 1e-6


@dataclass(frozen=True)
class Diagonal:
    """What the diagonal of a matrix is, by the sums of the other entries of its rows and of its columns.

    Attributes
    ----------
    loops : int
        Entries on the diagonal.
    rows, columns : bool
        It is the sums of their magnitudes: a signed Laplacian ``D - W``.
    balanced_rows, balanced_columns : bool
        It is minus the sums: an ordinary Laplacian, whose rows or columns sum to 0.
    normalised : bool
        It is positive, and no other entry is: as of a normalised Laplacian, or one that is grounded.
    negative : bool
        It is minus the sums of magnitudes: minus a Laplacian.
    odd : int
        The first row where it is neither; -1 if there is none.
    """

    loops: int
    rows: bool
    columns: bool
    balanced_rows: bool
    balanced_columns: bool
    normalised: bool
    negative: bool
    odd: int

    @property
    def laplacian(self) -> bool:
        """Whether the matrix may be a Laplacian, of either sign."""
        found = (self.rows, self.columns, self.balanced_rows, self.balanced_columns, self.negative)
        return self.loops > 0 and any(found)


def fits_one_node(first: np.ndarray, second: np.ndarray, entries: np.ndarray) -> bool:
    """Tell whether one entry of the diagonal, the first, may be a Laplacian's: it costs less than to ask of all.

    Examples
    --------
    >>> L = np.array([[1, 1], [-2, 2]])
    >>> fits_one_node(*np.nonzero(L), L[np.nonzero(L)])
    True
    """
    place = int(np.argmax(first == second))
    node, diagonal = first[place], entries[place]
    row, column = (entries[(ends == node) & (first != second)] for ends in (first, second))
    both = np.append(row, column)
    sums = [abs(np.sum(f(one))) for one in (row, column, both) for f in (np.abs, np.array)]
    return any(abs(total - abs(diagonal)) <= _ROUNDED * np.abs(both).sum() for total in sums)


def is_one_half(first: np.ndarray, second: np.ndarray) -> bool:
    """Tell whether no pair of nodes stands both ways, as in a triangle of a symmetric matrix.

    Examples
    --------
    >>> is_one_half(np.array([0, 0]), np.array([0, 1])), is_one_half(np.array([0, 1]), np.array([1, 0]))
    (True, False)
    """
    off = first != second
    first, second = first[off].astype(np.int64), second[off].astype(np.int64)
    n = 1 + max(first.max(initial=0), second.max(initial=0))
    unordered = np.minimum(first, second) * n + np.maximum(first, second)
    return np.unique(unordered).size == np.unique(first * n + second).size


def diagonal_of(first: np.ndarray, second: np.ndarray, entries: np.ndarray, n: int, both: bool) -> Diagonal:
    """Compare the diagonal of an n x n matrix with its other entries; ``both`` if (k, l) stands for (l, k), too.

    Examples
    --------
    >>> L = np.array([[1, 1], [-2, 2]])
    >>> diagonal_of(*np.nonzero(L), L[np.nonzero(L)], 2, False).rows
    True
    """
    first, second = (np.asarray(ends, dtype=np.int64) for ends in (first, second))
    loops = first == second
    off, size = ~loops, np.abs(entries)

    def sums(values: np.ndarray, ends: np.ndarray, others: np.ndarray) -> np.ndarray:
        total = np.bincount(ends[off], values[off], minlength=n)
        return total + np.bincount(others[off], values[off], minlength=n) if both else total

    diagonal = np.bincount(first[loops], entries[loops], minlength=n)
    by_rows, by_columns = sums(size, first, second), sums(size, second, first)
    signed_rows, signed_columns = sums(entries, first, second), sums(entries, second, first)

    def equal(total: np.ndarray, magnitude: np.ndarray) -> np.ndarray:
        return np.abs(diagonal - total) <= _ROUNDED * np.maximum(magnitude, np.abs(diagonal))

    some = bool(off.any()) or not loops.any()  # a graph without edges is its own Laplacian
    rows = equal(by_rows, by_rows)
    return Diagonal(
        loops=int(loops.sum()),
        rows=some and bool(rows.all()),
        columns=some and bool(equal(by_columns, by_columns).all()),
        balanced_rows=some and bool(equal(-signed_rows, by_rows).all()),
        balanced_columns=some and bool(equal(-signed_columns, by_columns).all()),
        normalised=some and bool((entries[loops] > 0).all() and (entries[off] < 0).all()),
        negative=some and bool(equal(-by_rows, by_rows).all() or equal(-by_columns, by_columns).all()),
        odd=-1 if rows.all() else int(np.argmin(rows)),
    )
