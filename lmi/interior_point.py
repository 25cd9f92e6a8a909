"""The search for diagonal matrices by a primal-dual interior-point method that knows its constraints.

    maximise t   subject to   sum_i omega_i F_i >= t W,    omega >= 0,    sum_i omega_i = n,
                              low <= scale_i omega_i <= c low    (if a largest condition c is given),

    F_i = U'(e_i c_i' + c_i e_i')U,    W = U' diag(weight) U,

where ``c_i'`` are the rows of a matrix ``C`` and ``U`` is orthonormal (or the identity). With ``C = A - (b/2) D`` the
sum is ``Omega A + A' Omega - b Omega D``, restricted. Each ``F_i`` has rank 2, so that the Schur complement of the
Newton system is a few matrix products,

    M = B + B' + (C X C') o G + X o (C G C'),    B = (C X) o (C G)',    G = U S^-1 U',

instead of the dense block of order ``n^2/2`` that a general solver factors. Predictor and corrector of Mehrotra in the
direction of Helmberg, Kojima and Monteiro.

References
----------
Helmberg, Rendl, Vanderbei, Wolkowicz, An interior-point method for semidefinite programming, SIAM J. Optim. 6 (1996).
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np

from lmi.errors import NoCertificate

#: Share of the way to the boundary that a step goes.
_STEP = 0.98
_MOST_ITERATIONS = 60


@dataclass(frozen=True, eq=False)
class Solution:
    """An approximate optimum; the caller recomputes whatever it claims.

    Attributes
    ----------
    omega : (n,) array
    t : float
    X : (r, r) array
        Dual matrix: ``<X, W> = 1`` and ``<X, F_i> + z_i = value / n`` with ``z >= 0``, up to the tolerance.
    value : float
        Dual objective; ``t <= value`` up to the tolerance.
    iterations : int
    """

    omega: np.ndarray
    t: float
    X: np.ndarray
    value: float
    iterations: int


def maximise_margin(
    C: np.ndarray,
    weight: np.ndarray,
    basis: np.ndarray | None = None,
    tolerance: float = 1e-9,
    scale: np.ndarray | None = None,
    max_condition: float | None = None,
) -> Solution:
    """Solve the program of the module.

    Parameters
    ----------
    C : (n, n) array
    weight : (n,) array
        Positive.
    basis : (n, r) array, optional
        Orthonormal columns ``U``.
    tolerance : float
        Relative gap and residual at which to stop.
    scale : (n,) array, optional
        Of the condition: positive, ``max(scale) <= max_condition min(scale)``.
    max_condition : float, optional
        ``c``, above 1.

    Returns
    -------
    Solution

    Raises
    ------
    NoCertificate
        The iteration broke down before it had anything to show.

    Examples
    --------
    >>> found = maximise_margin(np.array([[2.0, -1.0], [-1.0, 2.0]]), np.ones(2))
    >>> round(found.t, 7), found.omega.round(6)
    (2.0, array([1., 1.]))
    """
    with np.errstate(all="ignore"):
        problem = _Problem(np.asarray(C, dtype=float), np.asarray(weight, dtype=float), basis)
        n = len(problem.C)
        if max_condition is None or scale is None:
            rows, start = np.eye(n, n + 1), np.ones(n)
            extra = np.zeros(0)
        else:
            rows = np.block(
                [
                    [np.diag(scale), np.zeros((n, 1)), -np.ones((n, 1))],
                    [-np.diag(scale), np.zeros((n, 1)), np.full((n, 1), max_condition)],
                ]
            )
            # Strictly inside: the exponents are drawn in by a tenth, and low lies between.
            relative = scale / scale.max()
            start = relative**-0.1
            extra = np.array([max_condition**-0.95 * scale.max()]) * n / start.sum()
            start = start * n / start.sum()
        try:
            return _iterate(problem, rows, start, extra, tolerance)
        except (ZeroDivisionError, OverflowError, ValueError, np.linalg.LinAlgError):
            raise NoCertificate("the entries lie too far apart for floating point") from None


class _Problem:
    """The constraint matrices, by their products."""

    def __init__(self, C: np.ndarray, weight: np.ndarray, U: np.ndarray | None):
        self.C, self.weight, self._U = C, weight, U

    def restrict(self, form: np.ndarray) -> np.ndarray:
        form = (form + form.T) / 2
        return form if self._U is None else self._U.T @ form @ self._U

    def lift(self, form: np.ndarray) -> np.ndarray:
        return form if self._U is None else self._U @ form @ self._U.T

    def combine(self, omega: np.ndarray, t: float) -> np.ndarray:
        """Return ``sum_i omega_i F_i - t W``."""
        product = omega[:, None] * self.C
        return self.restrict(product + product.T - t * np.diag(self.weight))

    def inner(self, form: np.ndarray) -> np.ndarray:
        """Return ``<F_i, form>`` for every i and ``-<W, form>``."""
        lifted = self.lift(form)
        return np.append(2 * np.einsum("ij,ji->i", self.C, lifted), -self.weight @ np.diag(lifted))

    def schur(self, X: np.ndarray, G: np.ndarray) -> np.ndarray:
        """Return ``<F_i, X F_j G>`` for all pairs, ``-W`` the last; see the module."""
        C, weight, Xl, Gl = self.C, self.weight, self.lift(X), self.lift(G)
        n = len(C)
        CX, CG = C @ Xl, C @ Gl
        B = CX * CG.T
        XWG = Xl * weight @ Gl
        M = np.zeros((n + 1, n + 1))
        M[:n, :n] = B + B.T + (CX @ C.T) * Gl + Xl * (CG @ C.T)
        M[:n, n] = M[n, :n] = -np.einsum("ij,ji->i", C, XWG + XWG.T)
        M[n, n] = weight @ (Xl * Gl) @ weight
        return M


def _iterate(problem: _Problem, rows: np.ndarray, omega: np.ndarray, extra: np.ndarray, tolerance: float) -> Solution:
    """Iterate on ``y = (omega, t, extra)`` with ``rows y >= 0`` and multipliers ``z`` of these inequalities."""
    n = len(omega)
    size = n + 1 + len(extra)
    W, start = problem.combine(np.zeros(n), -1.0), problem.combine(omega, 0.0)
    t = float(np.linalg.eigvalsh(start)[0])
    t = min(t / float(x) for x in np.linalg.eigvalsh(W)[[0, -1]])
    t -= 0.1 * abs(t) + 0.1 * float(np.abs(start).max())
    y = np.concatenate([omega, [t], extra])
    X = np.eye(len(W)) / float(np.trace(W))
    pull = problem.inner(X)
    z = np.full(len(rows), float(np.abs(pull[:n]).max()) or 1.0) / np.maximum(np.abs(rows).max(axis=1), 1e-300)
    equality, gain = np.append(np.ones(n), np.zeros(size - n)), np.zeros(size)
    gain[n] = 1.0
    best: Solution | None = None
    for iteration in range(1, _MOST_ITERATIONS + 1):
        S, s = problem.combine(y[:n], float(y[n])), rows @ y
        try:
            factor, own = np.linalg.cholesky(S), np.linalg.cholesky(X)
        except np.linalg.LinAlgError:
            break
        half = np.linalg.inv(factor)
        G = half.T @ half
        pull = np.append(problem.inner(X), np.zeros(len(extra)))
        level = (pull + rows.T @ z + gain)[:n]
        value = float(level.mean()) * n
        mu = (float(np.tensordot(X, S)) + float(z @ s)) / (len(S) + len(s))
        best = Solution(y[:n].copy(), float(y[n]), X, value, iteration)
        scale = max(abs(y[n]), abs(value), 1e-12)
        if mu * (len(S) + len(s)) <= tolerance * 1e-3 * scale:
            break
        K = np.zeros((size + 1, size + 1))
        K[: n + 1, : n + 1] = problem.schur(X, G)
        K[:size, :size] += rows.T @ ((z / s)[:, None] * rows)
        K[:size, size] = K[size, :size] = equality
        # Rows and columns to unit size: the weights of the blocks lie far apart near the end.
        unit = 1 / np.sqrt(np.maximum(np.abs(np.diag(K)), 1e-300))
        unit[size] = 1 / max(float(np.abs(K[size, :size] * unit[:size]).max()), 1e-300)
        try:
            system = _Factored(unit[:, None] * K * unit)
        except np.linalg.LinAlgError:
            break
        newton = _Newton(problem, rows, X, G, S, y, z, s, system, unit, gain, equality)
        predicted = newton.step(0.0)
        primal = min(_reach(own, predicted.X), _reach_plain(z, predicted.z), 1.0)
        dual = min(_reach(factor, predicted.S), _reach_plain(s, predicted.s), 1.0)
        after = float(np.tensordot(X + primal * predicted.X, S + dual * predicted.S))
        after += float((z + primal * predicted.z) @ (s + dual * predicted.s))
        sigma = min(max(after / (len(S) + len(s)) / mu, 0.0) ** 3, 1.0)
        step = newton.step(max(sigma, 1e-6) * mu, predicted)
        primal = min(1.0, _STEP * min(_reach(own, step.X), _reach_plain(z, step.z)))
        dual = min(1.0, _STEP * min(_reach(factor, step.S), _reach_plain(s, step.s)))
        if not (np.isfinite(step.X).all() and np.isfinite(step.y).all()) or max(primal, dual) < 1e-8:
            break
        X = X + primal * step.X
        X, z, y = (X + X.T) / 2, z + primal * step.z, y + dual * step.y
    if best is None:
        raise NoCertificate("the interior-point method broke down at its start")
    return best


@dataclass(frozen=True)
class _Step:
    y: np.ndarray
    S: np.ndarray
    X: np.ndarray
    z: np.ndarray
    s: np.ndarray


@dataclass(frozen=True)
class _Newton:
    """One linearisation, solved for several right-hand sides."""

    problem: _Problem
    rows: np.ndarray
    X: np.ndarray
    G: np.ndarray
    S: np.ndarray
    y: np.ndarray
    z: np.ndarray
    s: np.ndarray
    system: _Factored
    unit: np.ndarray
    gain: np.ndarray
    equality: np.ndarray

    def step(self, target: float, predicted: _Step | None = None) -> _Step:
        """Aim at ``X S = target I``, ``z s = target``, with the second-order terms of a predicted step."""
        n, size = len(self.problem.C), len(self.y)
        centre, plain = target * self.G, target / self.s
        if predicted is not None:
            second = predicted.X @ predicted.S @ self.G
            centre = centre - (second + second.T) / 2
            plain = plain - predicted.z * predicted.s / self.s
        pull = np.append(self.problem.inner(centre), np.zeros(size - n - 1))
        rhs = np.append(pull + self.rows.T @ plain + self.gain, n - self.equality @ self.y)
        dy = (self.unit * self.system.solve(self.unit * rhs))[:size]
        dS, ds = self.problem.combine(dy[:n], float(dy[n])), self.rows @ dy
        product = self.X @ dS @ self.G
        dX = centre - self.X - (product + product.T) / 2
        return _Step(dy, dS, dX, plain - self.z - self.z * ds / self.s, ds)


class _Factored:
    """An indefinite bordered system, factored once; one step of iterative refinement."""

    def __init__(self, K: np.ndarray):
        from scipy.linalg import lu_factor

        if not np.isfinite(K).all():
            raise np.linalg.LinAlgError
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a singular system ends the iteration, which needs no word
            self._K, self._factor = K, lu_factor(K, check_finite=False)

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        from scipy.linalg import lu_solve

        x = lu_solve(self._factor, rhs, check_finite=False)
        return x + lu_solve(self._factor, rhs - self._K @ x, check_finite=False)


def _reach(factor: np.ndarray, step: np.ndarray) -> float:
    """Return how far ``L L' + alpha step`` stays positive semidefinite, at most 1 / _STEP."""
    from scipy.linalg import solve_triangular

    half = solve_triangular(factor, step, lower=True, check_finite=False)
    whole = solve_triangular(factor, half.T, lower=True, check_finite=False)
    if not np.isfinite(whole).all():
        return 0.0
    low = float(np.linalg.eigvalsh((whole + whole.T) / 2)[0])
    return 1 / _STEP if low >= -_STEP else -1 / low


def _reach_plain(value: np.ndarray, step: np.ndarray) -> float:
    low = float((step / value).min())
    return 1 / _STEP if low >= -_STEP else -1 / low
