"""The search for diagonal matrices by a primal-dual interior-point method that knows its constraints.

    maximise t   subject to   sum_i omega_i F_i >= t W   and one of

    - low <= omega_i <= 1 (a box),
    - omega >= 0, sum_i omega_i = n (a simplex),
    - sum_i omega_i = n and low <= scale_i omega_i <= c low for some low (a largest condition c),

    F_i = U'(e_i c_i' + c_i e_i')U,    W = U' diag(weight) U,

where ``c_i'`` are the rows of a matrix ``C`` and ``U`` is orthonormal (or the identity). With ``C = A - (b/2) D`` the
sum is ``Omega A + A' Omega - b Omega D``, restricted. Each ``F_i`` has rank 2, so that the Schur complement of the
Newton system takes a few products with ``C``, nearly free where ``C`` is sparse,

    M = B + B' + (C X C') o G + X o (C G C'),    B = (C X) o (C G)',    G = U S^-1 U',

instead of the dense block of order ``n^2/2`` that a general solver factors. An iteration is left with three dense
products, three Cholesky factors and an inverse of ``n`` rows. Predictor and corrector of Mehrotra in the direction of
Helmberg, Kojima and Monteiro; step lengths by Lanczos' method.

References
----------
Helmberg, Rendl, Vanderbei, Wolkowicz, An interior-point method for semidefinite programming, SIAM J. Optim. 6 (1996).
Toh, A note on the calculation of step-lengths in interior-point methods for semidefinite programming, Comput. Optim.
Appl. 21 (2002).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from scipy import sparse
from scipy.linalg import blas, eigh_tridiagonal, lapack

from lmi.errors import NoCertificate
from lmi.search_time import checkpoint

#: Share of the way to the boundary that a step goes.
_STEP = 0.95
_MOST_ITERATIONS = 60
#: Gaps are relative to the optimum or to this, if that is larger; the entries of ``C`` should be about 1.
_SMALL = 1e-3
#: Below this relative gap, :data:`_PATIENCE` iterations that do not quarter it are the end: rounding has taken over.
_NEAR, _PATIENCE = 1e-7, 2
#: Above so many rows, and up to this share of nonzeros, ``C`` is kept sparse.
_DENSE_ROWS, _SPARSE_SHARE = 150, 0.05
#: Above this many rows Lanczos' method gives step lengths, to this relative accuracy, in so many steps at most.
_LANCZOS_ROWS, _LANCZOS_ACCURACY, _LANCZOS_STEPS = 100, 0.02, 60


@dataclass(frozen=True, eq=False)
class Solution:
    """An approximate optimum; the caller recomputes whatever it claims.

    Attributes
    ----------
    omega : (n,) array
    t : float
        ``sum_i omega_i F_i - t W`` has a Cholesky factor in floating point.
    X : (r, r) array
        Dual matrix, positive semidefinite up to rounding: ``<X, W> = 1``.
    value : float
        What ``X`` proves up to rounding, however inexact it is: no admissible ``omega`` has a larger ``t``.
    """

    omega: np.ndarray
    t: float
    X: np.ndarray
    value: float


def maximise_margin(
    C: Any,
    weight: np.ndarray,
    basis: np.ndarray | None = None,
    tolerance: float = 1e-9,
    scale: np.ndarray | None = None,
    max_condition: float | None = None,
    least: float | None = None,
    groups: np.ndarray | None = None,
) -> Solution:
    """Solve the program of the module.

    Parameters
    ----------
    C : (n, n) array or sparse matrix
        In units in which its entries are about 1.
    weight : (n,) array
        Positive.
    basis : (n, r) array, optional
        Orthonormal columns ``U``.
    tolerance : float
        Relative gap at which to stop.
    scale : (n,) array, optional
        Of the condition: positive, ``max(scale) <= max_condition min(scale)``.
    max_condition : float, optional
        ``c``, above 1.
    least : float, optional
        ``low`` of the box, below 1; without it and without a condition the simplex is searched.
    groups : (n,) int array, optional
        Box only: rows with the same number, from 0 on, share their weight.

    Returns
    -------
    Solution

    Raises
    ------
    NoCertificate
        The iteration broke down before it had anything to show.

    Examples
    --------
    >>> solution = maximise_margin(np.array([[2.0, -1.0], [-1.0, 2.0]]), np.ones(2))
    >>> round(solution.t, 7), solution.omega.round(3)
    (2.0, array([1., 1.]))
    >>> solution = maximise_margin(np.array([[2.0, -1.0], [0.0, 4.0]]), np.ones(2), least=0.0)
    >>> round(solution.t, 7), solution.omega.round(6), solution.value - solution.t < 1e-8
    (3.763932, array([1., 1.]), True)
    >>> maximise_margin(np.diag([2.0, 1.0]), np.ones(2), least=0.0, groups=np.array([0, 0])).omega.round(6)
    array([1., 1.])
    """
    with np.errstate(all="ignore"):
        problem = _Problem(C, np.asarray(weight, dtype=float), basis, groups)
        n = len(problem.weight)
        if least is not None:
            weights = _box(problem.count, least)
        elif max_condition is None or scale is None:
            weights = _simplex(n)
        else:
            weights = _cone(scale, max_condition)
        try:
            return _iterate(problem, weights, tolerance)
        except (ZeroDivisionError, OverflowError, ValueError, np.linalg.LinAlgError):
            raise NoCertificate("the entries lie too far apart for floating point") from None


# ---------------------------------------------------------------------- what omega may be


@dataclass(frozen=True, eq=False)
class _Weights:
    """A set of admissible ``omega``: slacks ``own omega + shared low + offset >= 0``; ``fixed``: their sum is n.

    Each kind of inequality is a row of ``own``. ``low`` is a variable of its own, the last of ``y``, if ``start``,
    the first ``y`` without ``t``, has one more entry than there are weights. ``bound(pull)`` is the maximum of
    ``pull' omega`` over the set.
    """

    own: np.ndarray
    shared: np.ndarray
    offset: np.ndarray
    fixed: bool
    start: np.ndarray
    bound: Callable[[np.ndarray], float]

    def slacks(self, y: np.ndarray, offset: float = 1.0) -> np.ndarray:
        return self.own * y[: self.own.shape[1]] + self.shared * y[-1] + offset * self.offset

    def adjoint(self, z: np.ndarray, size: int) -> np.ndarray:
        """Return the derivative of ``<z, slacks(y)>`` by ``y``, of that many entries."""
        pull = np.zeros(size)
        pull[: self.own.shape[1]] = (self.own * z).sum(axis=0)
        pull[-1] += (self.shared * z).sum()
        return pull

    def add_to(self, K: np.ndarray, ratio: np.ndarray) -> None:
        """Add the second derivative of ``<ratio, slacks(y)^2> / 2``."""
        n = self.own.shape[1]
        K[np.arange(n), np.arange(n)] += (self.own**2 * ratio).sum(axis=0)
        mixed = (self.own * self.shared * ratio).sum(axis=0)
        K[:n, -1] += mixed
        K[-1, :n] += mixed
        K[-1, -1] += (self.shared**2 * ratio).sum()


def _box(n: int, low: float) -> _Weights:
    signs = np.repeat([[1.0], [-1.0]], n, axis=1)
    none, offset = np.zeros((2, 1)), np.array([[-low], [1.0]])

    def bound(pull: np.ndarray) -> float:
        return float(np.where(pull > 0, pull, low * pull).sum())

    return _Weights(signs, none, offset, False, np.full(n, (1 + low) / 2), bound)


def _simplex(n: int) -> _Weights:
    none = np.zeros((1, 1))
    return _Weights(np.ones((1, n)), none, none, True, np.ones(n), lambda pull: n * float(pull.max()))


def _cone(scale: np.ndarray, c: float) -> _Weights:
    # Strictly inside: the exponents are drawn in by a tenth, and low lies between.
    initial = np.append((scale / scale.max()) ** -0.1, c**-0.95 * scale.max())
    initial *= len(scale) / initial[:-1].sum()

    def bound(pull: np.ndarray) -> float:
        """Dinkelbach's method: the weights that gain most on a mean have the next, larger mean."""
        mean = -np.inf
        while True:
            omega = np.where(pull > mean, c, 1.0) / scale
            last, mean = mean, float(pull @ omega / omega.sum())
            if not mean > last:
                return len(scale) * last

    return _Weights(np.array([scale, -scale]), np.array([[-1.0], [c]]), np.zeros((2, 1)), True, initial, bound)


# ---------------------------------------------------------------------- the constraint matrices


class _Problem:
    """The constraint matrices, by their products. ``X``, ``G`` and steps of ``X`` are kept in n rows: ``U X U'``."""

    def __init__(self, C: Any, weight: np.ndarray, U: np.ndarray | None, groups: np.ndarray | None = None):
        entries = sparse.coo_array(C, dtype=float)
        n = len(weight)
        self.groups = np.arange(n) if groups is None else np.asarray(groups)
        self.count = int(self.groups.max()) + 1  # of the weights
        sparsely = n > _DENSE_ROWS and entries.nnz <= _SPARSE_SHARE * n * n
        self.C: Any = sparse.csr_array(entries) if sparsely else entries.toarray()
        self.weight, self._U = weight, U
        self._rows, self._columns, self._data = entries.row, entries.col, entries.data

    def form(self, y: np.ndarray) -> Any:
        """Return ``sum_i omega_i F_i - t W`` in n rows, not yet restricted; sparse if ``C`` is."""
        omega, t = y[self.groups], y[self.count]
        if isinstance(self.C, np.ndarray):
            product = omega[:, None] * self.C
            return product + product.T - np.diag(t * self.weight)
        product = sparse.diags_array(omega) @ self.C
        return sparse.csr_array(product + product.T - sparse.diags_array(t * self.weight))

    def restrict(self, form: Any) -> Any:
        return form if self._U is None else self._U.T @ (form @ self._U)

    def lift(self, form: np.ndarray) -> np.ndarray:
        return form if self._U is None else self._U @ form @ self._U.T

    def slack(self, y: np.ndarray) -> np.ndarray:
        """Return ``S = sum_i omega_i F_i - t W``, restricted and dense."""
        return _dense(self.restrict(self.form(y)))

    def inner(self, form: np.ndarray) -> np.ndarray:
        """Return ``<F_i, form>`` for every i and ``-<W, form>``; ``form`` need not be symmetric."""
        i, j = self._rows, self._columns
        pull = np.bincount(self.groups[i], self._data * (form[i, j] + form[j, i]), self.count)
        return np.append(pull, -self.weight @ np.diag(form))

    def schur(self, X: np.ndarray, G: np.ndarray, size: int) -> np.ndarray:
        """Return ``<F_i, X F_j G>`` for all pairs, ``-W`` the last, in the corner of a matrix of zeros."""
        C, weight, n = self.C, self.weight, self.count
        CX, CG = C @ X, C @ G
        XC, GC = np.ascontiguousarray(CX.T), np.ascontiguousarray(CG.T)
        M = np.zeros((size, size))
        pairs = CX * GC + CG * XC + (C @ XC) * G + (C @ GC) * X
        mixed = -np.einsum("ij,ij,j->i", CX, G, weight) - np.einsum("ij,ij,j->i", CG, X, weight)
        if n < len(weight):
            own = sparse.csr_array(np.eye(n)[:, self.groups])
            pairs, mixed = own @ (own @ pairs).T, own @ mixed
        M[:n, :n] = pairs
        M[:n, n] = M[n, :n] = mixed
        M[n, n] = weight @ (X * G) @ weight
        return M


# ---------------------------------------------------------------------- the iteration


@dataclass(frozen=True, eq=False)
class _Point:
    """``y = (omega, t, low)``, multipliers ``z`` of the slacks, ``X``; Cholesky's factors of ``X`` and ``S``."""

    X: np.ndarray
    y: np.ndarray
    z: np.ndarray
    own: np.ndarray
    factor: np.ndarray


def _iterate(problem: _Problem, weights: _Weights, tolerance: float) -> Solution:
    n = problem.count
    y = np.insert(weights.start, n, _first_t(problem, weights.start[:n]))
    X = problem.lift(np.eye(len(problem.restrict(np.eye(len(problem.weight))))))
    X /= problem.weight @ np.diag(X)
    z = (float(np.abs(problem.inner(X)[:n]).max()) or 1.0) / np.maximum(np.abs(weights.own), np.abs(weights.shared))
    primal_factor, factor = _cholesky(problem.restrict(X)), _cholesky(problem.slack(y))
    if primal_factor is None or factor is None:
        raise NoCertificate("the interior-point method broke down at its start")
    point: _Point | None = _Point(X, y, z, primal_factor, factor)
    lower = y
    upper = (np.inf, X)
    idle = 0
    for _ in range(_MOST_ITERATIONS):
        checkpoint()
        if point is None:
            break
        before = upper[0] - float(lower[n])
        pull = problem.inner(point.X)
        value = weights.bound(pull[:n] / -pull[n])
        if value < upper[0]:
            upper = value, point.X / -pull[n]
        if point.y[n] > lower[n]:
            lower = point.y
        gap, size = upper[0] - float(lower[n]), max(abs(upper[0]), _SMALL)
        idle = idle + 1 if 4 * gap > before and gap <= _NEAR * size else 0
        if gap <= tolerance * size or idle >= _PATIENCE:
            break
        point = _Newton(problem, weights, point).step()
    return Solution(lower[problem.groups], float(lower[n]), problem.restrict(upper[1]), upper[0])


def _first_t(problem: _Problem, omega: np.ndarray) -> float:
    """Return a ``t`` at which the form is well inside the cone."""
    form = problem.slack(np.append(omega, 0.0))
    low = float(np.linalg.eigvalsh(form)[0])
    t = min(low / problem.weight.min(), low / problem.weight.max())
    return t - 0.1 * abs(t) - 0.1 * float(np.abs(form).max())


@dataclass(frozen=True, eq=False)
class _Direction:
    """Steps of all variables, ``dSG`` is ``dS G``; how far ``X, z`` (primal) and ``S, s`` (dual) stay positive."""

    y: np.ndarray
    X: np.ndarray
    z: np.ndarray
    s: np.ndarray
    dSG: np.ndarray
    primal: float
    dual: float


class _Newton:
    """One linearisation, solved for a predictor and a corrector."""

    def __init__(self, problem: _Problem, weights: _Weights, point: _Point):
        self.problem, self.weights, self.at = problem, weights, point
        y, n = point.y, problem.count
        self.s = weights.slacks(y)
        self.G = problem.lift(_inverse(point.factor))
        K = problem.schur(point.X, self.G, len(y))
        weights.add_to(K, point.z / self.s)
        self.solve = _solver(
            K, np.append(np.full(n, float(weights.fixed)), np.zeros(len(y) - n)), n - float(y[:n].sum())
        )

    def step(self) -> _Point | None:
        """Return the next point; None where precision ends."""
        X, y, z, s, problem = self.at.X, self.at.y, self.at.z, self.s, self.problem
        order = len(self.at.factor) + s.size
        mu = self._product(X, y, z, s) / order
        first = self._direction(0.0, None)
        if first is None:
            return None
        primal, dual = min(first.primal, 1.0), min(first.dual, 1.0)
        after = self._product(X + primal * first.X, y + dual * first.y, z + primal * first.z, s + dual * first.s)
        sigma = min(max(after / (order * mu), 1e-3) ** 2, 1.0)
        last = self._direction(sigma * mu, first)
        if last is None or not np.isfinite(last.X).all() or max(last.primal, last.dual) < 1e-8:
            return None
        primal, dual = min(1.0, _STEP * last.primal), min(1.0, _STEP * last.dual)
        # Lanczos' method can overestimate a step, and all ends at the boundary: shorter until there are factors.
        for _ in range(20):
            own = _cholesky(problem.restrict(X + primal * last.X))
            factor = _cholesky(problem.slack(y + dual * last.y))
            if own is not None and factor is not None:
                return _Point(X + primal * last.X, y + dual * last.y, z + primal * last.z, own, factor)
            primal, dual = (0.8 * primal if own is None else primal), (0.8 * dual if factor is None else dual)
        return None

    def _product(self, X: np.ndarray, y: np.ndarray, z: np.ndarray, s: np.ndarray) -> float:
        """Return ``<X, S> + <z, s>``."""
        pull = self.problem.inner(X)
        return float(pull @ y[: len(pull)]) + float(np.vdot(z, s))

    def _direction(self, target: float, predicted: _Direction | None) -> _Direction | None:
        """Aim at ``X S = target I``, ``z s = target``, with the second-order terms of a predicted step."""
        problem, X, z, s = self.problem, self.at.X, self.at.z, self.s
        centre, plain = target * self.G, target / s
        second: Any = 0.0
        if predicted is not None:
            second = predicted.X @ predicted.dSG
            plain = plain - predicted.z * predicted.s / s
        pull = problem.inner(centre - second)
        rhs = self.weights.adjoint(plain, len(self.at.y))
        rhs[: len(pull)] += pull
        rhs[len(pull) - 1] += 1.0
        dy = self.solve(rhs)
        if not np.isfinite(dy).all():
            return None
        dS, ds = problem.form(dy), self.weights.slacks(dy, 0.0)
        dSG = dS @ self.G
        product = X @ dSG + second
        dX = centre - X - (product + product.T) / 2
        dz = plain - z - z * ds / s
        primal = min(_reach(self.at.own, problem.restrict(dX)), _reach_plain(z, dz))
        dual = min(_reach(self.at.factor, problem.restrict(dS)), _reach_plain(s, ds))
        return _Direction(dy, dX, dz, ds, dSG, primal, dual)


# ---------------------------------------------------------------------- linear algebra


def _dense(form: Any) -> np.ndarray:
    return form.toarray() if sparse.issparse(form) else form


def _cholesky(S: np.ndarray) -> np.ndarray | None:
    """Return the lower factor, in Fortran's order; None if there is none."""
    factor, info = lapack.dpotrf(S.T, lower=1, clean=1)
    return factor if info == 0 and np.isfinite(np.diag(factor)).all() else None


def _solver(K: np.ndarray, border: np.ndarray, defect: float) -> Callable[[np.ndarray], np.ndarray]:
    """Return what solves ``K dy + m border = rhs`` with two steps of iterative refinement.

    ``m`` is such that ``border' dy = defect``, or 0 without a border. Rows and columns are scaled to a unit diagonal:
    the weights of the blocks lie far apart near the end. By Cholesky's factor, or by pivots where rounding has cost
    ``K`` its definiteness; what it returns is not finite if the system is singular.
    """
    unit = 1 / np.sqrt(np.maximum(np.diag(K), 1e-300))
    K, border = unit[:, None] * (K * unit), unit * border
    plain = partial(lapack.dpotrs, _cholesky(K), lower=1)
    if plain.args[0] is None:
        plain = partial(lapack.dgetrs, *lapack.dgetrf(K)[:2])

    def solve(rhs: np.ndarray) -> np.ndarray:
        x = np.zeros(len(rhs))
        multiplier = 0.0
        answer = plain(border)[0]
        for _ in range(3):
            x = x + plain(unit * rhs - K @ x - multiplier * border)[0]
            if border.any():
                more = float(border @ x - defect) / float(border @ answer)
                x, multiplier = x - more * answer, multiplier + more
        return unit * x

    return solve


def _inverse(factor: np.ndarray) -> np.ndarray:
    half, _ = lapack.dpotri(factor, lower=1)
    half[np.diag_indices_from(half)] /= 2
    return half + half.T


def _reach(factor: np.ndarray, step: Any) -> float:
    """Return how far ``L L' + alpha step`` stays positive semidefinite, at most 1 / _STEP."""
    if len(factor) > _LANCZOS_ROWS:

        def apply(v: np.ndarray) -> np.ndarray:
            return blas.dtrsv(factor, step @ blas.dtrsv(factor, v, lower=1, trans=1), lower=1)

        low = _least_eigenvalue(apply, len(factor))
    else:
        half = blas.dtrsm(1.0, factor, _dense(step), lower=1)
        whole = blas.dtrsm(1.0, factor, half.T, lower=1)
        low = float(np.linalg.eigvalsh((whole + whole.T) / 2)[0]) if np.isfinite(whole).all() else -np.inf
    return 1 / _STEP if low >= -_STEP else -1 / low


def _reach_plain(value: np.ndarray, step: np.ndarray) -> float:
    low = float((step / value).min())
    return 1 / _STEP if low >= -_STEP else -1 / low


def _least_eigenvalue(apply: Callable[[np.ndarray], np.ndarray], n: int) -> float:
    """Estimate the smallest eigenvalue of a symmetric operator from below, by Lanczos' method."""
    Q = np.zeros((_LANCZOS_STEPS + 1, n))
    Q[0] = np.random.default_rng(n).standard_normal(n)
    Q[0] /= np.linalg.norm(Q[0])
    diagonal, off = np.zeros(_LANCZOS_STEPS), np.zeros(_LANCZOS_STEPS)
    for k in range(_LANCZOS_STEPS):
        w = apply(Q[k])
        if not np.isfinite(w).all():
            return -np.inf
        diagonal[k] = Q[k] @ w
        for _ in range(2):
            w = w - (Q[: k + 1] @ w) @ Q[: k + 1]
        off[k] = np.linalg.norm(w)
        if k % 4 == 3:
            values, vectors = eigh_tridiagonal(diagonal[: k + 1], off[:k], select="i", select_range=(0, 0))
            error = off[k] * abs(float(vectors[-1, 0]))
            if error <= _LANCZOS_ACCURACY * max(abs(float(values[0])), 1.0):
                break
        Q[k + 1] = w / off[k]
    return float(values[0]) - error
