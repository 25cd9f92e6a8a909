"""Linear programs over symmetric matrices, handed to Clarabel as it takes them; what it returns is proved elsewhere.

``maximise c'x`` subject to ``F_0 + x_1 F_1 + .. + x_N F_N >= 0`` for some families of symmetric matrices, and to
inequalities of numbers. Matrices that are affine in ``x`` are written as formulas: see :class:`Program`. Small programs
are solved by the thousand, and a general modelling language would take most of the time.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy import sparse

from lmi.errors import NoCertificate
from lmi.search_time import checkpoint, seconds_left, uncounted

Value = Callable[["Affine"], np.ndarray]


@dataclass(frozen=True, eq=False)
class Affine:
    """An ``(r, c)`` matrix that is affine in the variables: ``constant + sum_k x_k F_k``.

    Attributes
    ----------
    terms : (r c, N) sparse array
        Column ``k`` is ``F_k``, column after column; variables after the last are not in it.
    constant : (r, c) array
    """

    terms: Any
    constant: np.ndarray

    __array_ufunc__ = None  # an array on the left leaves the operation to this class

    @property
    def T(self) -> Affine:
        """The transpose."""
        r, c = self.constant.shape
        order = np.arange(r * c).reshape((r, c), order="F").ravel()
        return Affine(self.terms[order], self.constant.T)

    def __add__(self, other: Any) -> Affine:
        if not isinstance(other, Affine):
            return Affine(self.terms, self.constant + other)
        count = max(self.terms.shape[1], other.terms.shape[1])
        return Affine(_widened(self.terms, count) + _widened(other.terms, count), self.constant + other.constant)

    __radd__ = __add__

    def __neg__(self) -> Affine:
        return Affine(-self.terms, -self.constant)

    def __sub__(self, other: Any) -> Affine:
        return self + (-other)

    def __rsub__(self, other: Any) -> Affine:
        return -self + other

    def __mul__(self, other: Any) -> Affine:
        """Multiply by a number, or a matrix by the single entry."""
        if np.ndim(other) == 0:
            return Affine(self.terms * other, self.constant * other)
        column = sparse.csr_array(np.ravel(other, order="F")[:, None])
        return Affine(column @ self.terms, self.constant * other)

    __rmul__ = __mul__

    def __matmul__(self, right: np.ndarray) -> Affine:
        return (right.T @ self.T).T

    def __rmatmul__(self, left: np.ndarray) -> Affine:
        (r, n), c, one = left.shape, self.constant.shape[1], sparse.csr_array(left)
        columns = (np.arange(c)[:, None] * n + one.indices).ravel()  # the same matrix for each column
        ends = (np.arange(c)[:, None] * one.nnz + one.indptr[1:]).ravel()
        lift = sparse.csr_array((np.tile(one.data, c), columns, np.append(0, ends)), shape=(r * c, n * c))
        return Affine(lift @ self.terms, left @ self.constant)


def _widened(terms: Any, count: int) -> Any:
    if terms.shape[1] == count:
        return terms
    return sparse.csr_array((terms.data, terms.indices, terms.indptr), shape=(terms.shape[0], count))


def _stacked(parts: Sequence[Any], count: int) -> Any:
    """Return rows of sparse arrays below each other: :func:`scipy.sparse.vstack` takes longer than small programs."""
    ends = np.cumsum(np.concatenate([[0], *(np.diff(part.indptr) for part in parts)]))
    data, indices = (np.concatenate([getattr(part, name) for part in parts]) for name in ("data", "indices"))
    return sparse.csr_array((data, indices, ends), shape=(len(ends) - 1, count))


def _affine(matrix: Any) -> Affine:
    if isinstance(matrix, Affine):
        return matrix
    return Affine(sparse.csr_array((matrix.size, 0)), np.asarray(matrix, dtype=float))


def diagonal(column: Affine) -> Affine:
    """Return the diagonal matrix of an ``(n, 1)`` matrix."""
    n = len(column.constant)
    places = sparse.csr_array((np.ones(n), (np.arange(n) * (n + 1), np.arange(n))), shape=(n * n, n))
    return Affine(places @ column.terms, np.diag(column.constant[:, 0]))


def bordered(corner: Any, border: Any, other: Any) -> Affine:
    """Return ``[[corner, border], [border', other]]``, affine matrices or arrays."""
    blocks = [_affine(x) for x in (corner, border, other)]
    blocks.insert(1, blocks[1].T)
    n, m = blocks[2].constant.shape
    count = max(block.terms.shape[1] for block in blocks)
    stacked = _stacked([block.terms for block in blocks], count)
    where = np.split(np.arange((n + m) ** 2), np.cumsum([n * n, n * m, n * m]))
    left = np.vstack([where[0].reshape((n, n), order="F"), where[1].reshape((m, n), order="F")])
    right = np.vstack([where[2].reshape((n, m), order="F"), where[3].reshape((m, m), order="F")])
    A, B, C, D = (blocks[k].constant for k in (0, 2, 1, 3))
    return Affine(stacked[np.hstack([left, right]).ravel(order="F")], np.block([[A, B], [C, D]]))


@dataclass
class Program:
    """A program under construction: variables first, then inequalities.

    Examples
    --------
    The largest ``t`` with ``[[1, x], [x, 4]] >= t I`` is 1:

    >>> program = Program()
    >>> x, t = program.column(1), program.column(1)
    >>> program.positive(x * np.array([[0.0, 1.0], [1.0, 0.0]]) + np.diag([1.0, 4.0]) - t * np.eye(2))
    >>> round(float(program.maximise(t)(t)[0, 0]), 6)
    1.0
    """

    count: int = 0
    matrices: list[Affine] = field(default_factory=list)
    numbers: list[Affine] = field(default_factory=list)

    def column(self, n: int) -> Affine:
        """Return ``n`` variables as an ``(n, 1)`` matrix."""
        before = self.count
        self.count += n
        own = np.arange(before, self.count)
        terms = sparse.csr_array((np.ones(n), own, np.arange(n + 1)), shape=(n, self.count))
        return Affine(terms, np.zeros((n, 1)))

    def symmetric(self, n: int) -> Affine:
        """Return a symmetric matrix of ``n (n + 1) / 2`` variables."""
        before, size = self.count, n * (n + 1) // 2
        self.count += size
        place = np.zeros((n, n), dtype=int)
        place[np.tril_indices(n)] = np.arange(before, self.count)
        place = np.tril(place) + np.tril(place, -1).T
        terms = sparse.csr_array((np.ones(n * n), place.ravel(), np.arange(n * n + 1)), shape=(n * n, self.count))
        return Affine(terms, np.zeros((n, n)))

    def positive(self, matrix: Affine) -> None:
        """Demand that a symmetric matrix is positive semidefinite."""
        self.matrices.append(matrix)

    def not_negative(self, column: Affine) -> None:
        """Demand that no entry of an ``(n, 1)`` matrix is negative."""
        self.numbers.append(column)

    def maximise(self, goal: Affine, **options: Any) -> Value:
        """Solve the program for the largest single entry, and return the function that evaluates matrices.

        Parameters
        ----------
        goal : Affine
            ``(1, 1)``.
        **options
            Settings of Clarabel.

        Raises
        ------
        NoCertificate
            It was not solved.
        OutOfTime
            The time limit is reached (:func:`lmi.time_limit`).
        """
        checkpoint()
        x = _clarabel(-_widened(goal.terms, self.count).toarray()[0], *self._cones(), options)
        checkpoint()

        def value(matrix: Affine) -> np.ndarray:
            moved = matrix.terms @ x[: matrix.terms.shape[1]]
            return matrix.constant + moved.reshape(matrix.constant.shape, order="F")

        return value

    def _cones(self) -> tuple[Any, np.ndarray, list[int], list[int]]:
        """Return ``A`` and ``b`` of ``b - A x`` in a product of cones: numbers, then upper triangles of matrices."""
        rows = [column.terms for column in self.numbers]
        constants = [column.constant[:, 0] for column in self.numbers]
        for matrix in self.matrices:
            column, row = np.tril_indices(len(matrix.constant))
            scale = np.where(row == column, 1.0, math.sqrt(2.0))
            own = matrix.terms[row + column * len(matrix.constant)]
            own.data *= np.repeat(scale, np.diff(own.indptr))
            rows.append(own)
            constants.append(scale * matrix.constant[row, column])
        sizes = [len(matrix.constant) for matrix in self.matrices]
        counts = [len(column.constant) for column in self.numbers]
        return -_stacked(rows, self.count).tocsc(), np.concatenate(constants), counts, sizes


def _clarabel(
    q: np.ndarray, A: Any, b: np.ndarray, numbers: list[int], sizes: list[int], options: dict[str, Any]
) -> np.ndarray:
    """Minimise ``q'x``; where Clarabel panics, once more without splitting matrices."""
    with uncounted():
        import clarabel
    if not (np.isfinite(A.data).all() and np.isfinite(b).all()):
        raise NoCertificate("the program has an entry that is not finite")
    settings = clarabel.DefaultSettings()
    for name, value in ({"verbose": False, "time_limit": seconds_left()} | options).items():
        setattr(settings, name, value)
    cones = [clarabel.NonnegativeConeT(sum(numbers))] * bool(numbers)
    cones += [clarabel.PSDTriangleConeT(n) for n in sizes]
    A.eliminate_zeros()
    try:
        found = clarabel.DefaultSolver(sparse.csc_array((len(q), len(q))), q, A, b, cones, settings).solve()
    except BaseException as error:  # a panic is no Exception
        if type(error).__name__ != "PanicException":
            raise
        if not options.get("chordal_decomposition_enable", True):
            raise NoCertificate("the solver failed: Clarabel panicked") from None
        return _clarabel(q, A, b, numbers, sizes, options | {"chordal_decomposition_enable": False})
    x = np.array(found.x)
    if str(found.status) not in ("Solved", "AlmostSolved") or not np.isfinite(x).all():
        raise NoCertificate(f"the solver answered {found.status}")
    return x
