"""One Lyapunov matrix for several uncertain matrices: the search, by Clarabel; proofs are elsewhere.

Let ``A_i + sum_e delta_e f_e h_e'``, ``|delta_e| <= r_e``, be the members of mode ``i``: each parameter multiplies a
matrix of rank one. With multipliers ``tau_e > 0``

    [[P A_i + A_i' P - b P - H diag(tau) H',   P F diag(r)],
     [diag(r) F' P,                            diag(tau)  ]]  >=  0            F = [f_e], H = [h_e]

implies ``P A + A' P >= b P`` for all of them at once, by ``tau a^2 + r^2 c^2 / tau >= 2 r |a c|``. One ``P`` and one
such inequality for each mode bound every solution of ``x' = -A(s) x``, whatever the signal that chooses.
"""

from __future__ import annotations

import contextlib
import math
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lmi import child_process
from lmi.errors import MatrixError, NoCertificate, OutOfTime
from lmi.rate_programs import program_seconds, rows_of, solved
from lmi.search_time import spend
from lmi.uncertain_matrix import UncertainMatrix

#: Steps at most, and the relative gain that is worth another one.
_STEPS, _GAIN = 12, 1e-4
#: Loss of the rate without uncertainty at which the search with it begins.
_START_LOSS = 0.2
#: How much smaller than the last ``P`` the next one may be in some direction, and the largest condition of ``P``.
_LEAST, _LARGEST_CONDITION = 1e-7, 1e12
#: The same of steps that weigh modes by their shares: large ones, then smaller ones.
_TRUST = (0.3, 0.8)
#: Weight of other directions than that of the state at which ``P`` is to be small.
_ASIDE = 1e-3


@dataclass(frozen=True, eq=False)
class CommonCertificate:
    """One matrix ``P`` with a rate for each mode, as far as floating point tells.

    Attributes
    ----------
    matrix : (n, n) array
        Symmetric; its largest eigenvalue 1.
    rates : tuple of float
        ``b_i`` of each mode, per unit of the clock; may be negative.
    multipliers : tuple of (q_i,) arrays
        ``tau`` of each mode.

    References
    ----------
    Boyd, El Ghaoui, Feron, Balakrishnan, Linear Matrix Inequalities in System and Control Theory, SIAM 1994, chapter 5.
    """

    matrix: np.ndarray
    rates: tuple[float, ...]
    multipliers: tuple[np.ndarray, ...]

    @property
    def rate(self) -> float:
        """The smallest of the rates."""
        return min(self.rates)

    @property
    def condition(self) -> float:
        """``lmax(P) / lmin(P)``, the overshoot constant of the squared norm."""
        sizes = np.linalg.eigvalsh(self.matrix)
        return float(sizes[-1] / sizes[0]) if sizes[0] > 0 else math.inf


def common_lyapunov(
    modes: Sequence[UncertainMatrix],
    *,
    shape: str = "full",
    shares: Sequence[float] | None = None,
    tolerance: float = 1e-7,
    start: Any = None,
) -> CommonCertificate:
    """Find one ``P > 0`` of the largest common rate: the smallest ``b_i`` of all modes, or their mean over ``shares``.

    With ``b`` from the last ``P_0``, in coordinates in which ``P_0 = I``, the program ``maximise t`` subject to the
    inequalities above with ``b P + t I`` instead of ``b P``, ``0 <= P <= I``, gives a rate of ``b + t`` at least; it is
    repeated until it gains less than a ten-thousandth. With shares ``sum_i shares_i (b_i + t_i)`` is maximised, in
    steps that change ``P`` little; then what comes out need not be the best.

    Parameters
    ----------
    modes : sequence of UncertainMatrix
        All with the same n >= 1.
    shape : {"full", "diagonal"}
        Of ``P``.
    shares : sequence of float, optional
        Of the clock that each mode is active: some may have no positive rate, and the mean is made large.
    tolerance : float
        Relative gap asked of the solver.
    start : (n, n) array, optional
        A positive definite ``P`` from which to climb; diagonal if ``shape`` is.

    Returns
    -------
    CommonCertificate
        The rate may be negative: no better one was found.

    Raises
    ------
    MatrixError
        There is no mode or no row, or the sizes differ.
    NoCertificate
        The solver found nothing at all, or this is a forked process, in which Clarabel may wait for ever.
    OutOfTime
        The time limit is reached (:func:`lmi.time_limit`) before the first step; later the best so far is returned.

    References
    ----------
    Boyd, El Ghaoui, Feron, Balakrishnan, Linear Matrix Inequalities in System and Control Theory, SIAM 1994, chapter 5.

    Examples
    --------
    >>> modes = [UncertainMatrix.known([[1.0, 1.0], [0.0, 1.0]]), UncertainMatrix.known([[1.0, 0.0], [-1.0, 1.0]])]
    >>> round(common_lyapunov(modes).rate, 3)
    1.0
    """
    if shape not in ("full", "diagonal"):
        raise MatrixError(f'shape "{shape}" is unknown; use "full" or "diagonal"')
    sizes = {len(mode.A) for mode in modes}
    if len(sizes) != 1 or 0 in sizes:
        raise MatrixError("all modes have the same number of rows, at least one")
    if child_process.forked:
        raise NoCertificate("Clarabel is not run in a forked process")
    if shares is not None and (len(shares) != len(modes) or not min(shares) >= 0 or not max(shares) > 0):
        raise MatrixError("shares are one number for each mode, none negative, not all 0")
    search = _Search(tuple(modes), shape == "diagonal", tolerance, None if shares is None else np.array(shares, float))
    if start is None and shares is None and any(mode.radii.size for mode in modes):
        start = search.nominal_start()
    return search.climb(start)


@dataclass(frozen=True, eq=False)
class _Search:
    modes: tuple[UncertainMatrix, ...]
    diagonal: bool
    tolerance: float
    shares: np.ndarray | None = None

    def worth(self, rates: Sequence[float]) -> float:
        """Return what is maximised."""
        return min(rates) if self.shares is None else float(self.shares @ np.array(rates) / self.shares.sum())

    def climb(self, start: Any = None) -> CommonCertificate:
        """Climb from the best of a few matrices until nothing is gained."""
        starts = list(self._starts()) if start is None else [np.asarray(start, dtype=float)]
        P = max(starts, key=lambda P: self.worth(self._nominal_rates(P)))
        rates, best = self._nominal_rates(P), None
        P = P / np.linalg.eigvalsh(P)[-1]
        trust = _LEAST if self.shares is None else _TRUST[0]
        for _ in range(_STEPS):
            try:
                step = self._step(P, rates, trust)
            except (NoCertificate, np.linalg.LinAlgError):
                break
            except OutOfTime:
                if best is None:
                    raise
                break
            gain = math.inf if best is None else self.worth(step.rates) - self.worth(best.rates)
            if gain > 0:
                best, P, rates = step, step.matrix, step.rates
            if best is None or best.condition > _LARGEST_CONDITION:
                break
            if gain <= _GAIN * abs(self.worth(best.rates)):
                if trust not in _TRUST[:-1]:
                    break
                trust = _TRUST[_TRUST.index(trust) + 1]
        if best is None:
            raise NoCertificate("no common Lyapunov matrix was found in floating point")
        return best

    def nominal_start(self) -> np.ndarray | None:
        """Return a well-conditioned ``P`` for the matrices without their uncertainty, which cost little."""
        known = tuple(UncertainMatrix.known(mode.A) for mode in self.modes)
        with contextlib.suppress(NoCertificate, np.linalg.LinAlgError):
            nominal = replace(self, modes=known, tolerance=1e-5).climb()
            shape = "diagonal" if self.diagonal else "full"
            return least_condition(
                known, [nominal.rate - _START_LOSS * abs(nominal.rate)] * len(known), shape=shape
            ).matrix
        return None

    def _starts(self) -> Iterator[np.ndarray]:
        """Yield the identity, and the solution of a Lyapunov equation of the mean mode (its diagonal)."""
        n = len(self.modes[0].A)
        yield np.eye(n)
        mean = np.sum([mode.A / max(float(np.abs(mode.A).max()), 1e-300) for mode in self.modes], axis=0)
        with contextlib.suppress(np.linalg.LinAlgError, ValueError):
            from scipy.linalg import solve_continuous_lyapunov

            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # nearly singular: it is one start of a few
                P = solve_continuous_lyapunov(mean.T, np.eye(n))
            P = np.diag(np.diag(P)) if self.diagonal else (P + P.T) / 2
            if np.isfinite(P).all() and np.linalg.eigvalsh(P)[0] > 1e-9 * np.abs(P).max():
                yield P

    def _nominal_rates(self, P: np.ndarray) -> tuple[float, ...]:
        """Return the rates of the matrices without their uncertainty."""
        R = np.linalg.cholesky(P).T
        transformed = (np.linalg.solve(R.T, (R @ mode.A).T).T for mode in self.modes)
        return tuple(float(np.linalg.eigvalsh(B + B.T)[0]) for B in transformed)

    def _step(self, P: np.ndarray, rates: Sequence[float], least: float) -> CommonCertificate:
        """Solve the program of :func:`common_lyapunov`, and compute the rates of its ``P``."""
        R = np.diag(np.sqrt(np.diag(P))) if self.diagonal else np.linalg.cholesky(P).T
        pairs = [mode.transformed(R) for mode in self.modes]
        Q, multipliers = self._solve([mode for mode, _ in pairs], rates, least)
        if self.diagonal:
            Q = np.diag(np.diag(Q))
        sizes = np.linalg.eigvalsh(Q)
        if not sizes[0] > _LEAST / 10 * sizes[-1]:
            Q = Q + (_LEAST * sizes[-1] - min(sizes[0], 0.0)) * np.eye(len(Q))
        P = R.T @ Q @ R
        P, top = (P + P.T) / 2, float(np.linalg.eigvalsh(P)[-1])
        taus = [np.maximum(t, 1e-12) / scale / top for t, (_, scale) in zip(multipliers, pairs, strict=True)]
        return evaluate(P / top, self.modes, taus)

    def _solve(
        self, modes: Sequence[UncertainMatrix], rates: Sequence[float], least: float
    ) -> tuple[np.ndarray, list[np.ndarray]]:
        unit = max(float(np.abs(mode.A).max(initial=0.0)) for mode in modes) or 1.0
        own = [min(rates)] * len(modes) if self.shares is None else rates
        shares = np.ones(1) if self.shares is None else self.shares
        spend(program_seconds(modes, "diagonal" if self.diagonal else "full"))
        rows = rows_of(modes, own, unit)
        return solved("rates", self.diagonal, [np.array(least), shares], rows, self.tolerance)


def least_condition(
    modes: Sequence[UncertainMatrix], rates: Sequence[float], *, shape: str = "full", tolerance: float = 1e-7
) -> CommonCertificate:
    """Find one ``P`` of least condition that has given rates: ``minimise c`` subject to ``I <= P <= c I``.

    Parameters
    ----------
    modes : sequence of UncertainMatrix
    rates : sequence of float
        One of each mode, less than what some ``P`` has.
    shape : {"full", "diagonal"}
    tolerance : float
        Relative gap asked of the solver.

    Returns
    -------
    CommonCertificate
        Its rates may lie below the wanted ones by what the solver leaves.

    Raises
    ------
    NoCertificate
        The solver found none, or this is a forked process.
    numpy.linalg.LinAlgError
        What it returned is not positive definite.
    OutOfTime
        The time limit is reached.

    Examples
    --------
    >>> fast = UncertainMatrix.known([[1.0, 9.0], [0.0, 2.0]])
    >>> least_condition([fast], [1.9]).condition < common_lyapunov([fast]).condition
    True
    """
    return _least_form(modes, rates, np.eye(len(modes[0].A)), None, shape == "diagonal", tolerance)


def least_value(
    modes: Sequence[UncertainMatrix], rates: Sequence[float], x: np.ndarray, least: np.ndarray, tolerance: float = 1e-7
) -> CommonCertificate:
    """Find one ``P`` of given rates that is small at one state: ``minimise x'P x`` subject to ``P >= least``.

    Other directions are weighed by a thousandth, so that ``P`` is no larger there than it needs to be.

    Parameters
    ----------
    modes : sequence of UncertainMatrix
    rates : sequence of float
        One of each mode, less than what some ``P`` has.
    x : (n,) array
        Not 0.
    least : (n, n) array
        Positive definite: a sum of ``y y'`` bounds every ``|y'x|`` by ``sqrt(V)``.
    tolerance : float
        Relative gap asked of the solver.

    Raises
    ------
    NoCertificate, numpy.linalg.LinAlgError, OutOfTime
        As :func:`least_condition`.

    Examples
    --------
    >>> fast = UncertainMatrix.known([[1.0, 9.0], [0.0, 2.0]])
    >>> x = np.array([1.0, 0.0])
    >>> forms = [least_value([fast], [1.9], x, np.eye(2)).matrix, least_condition([fast], [1.9]).matrix]
    >>> [round(float(x @ P @ x / np.linalg.eigvalsh(P)[0]), 2) for P in forms]
    [1.05, 1.41]
    """
    R = np.linalg.cholesky(least).T
    z = R @ x
    return _least_form(modes, rates, R, np.outer(z, z) / (z @ z) + _ASIDE * np.eye(len(z)), False, tolerance)


def _least_form(
    modes: Sequence[UncertainMatrix],
    rates: Sequence[float],
    R: np.ndarray,
    moment: np.ndarray | None,
    diagonal: bool,
    tolerance: float,
) -> CommonCertificate:
    """Minimise the trace of ``moment Q``, or the condition of ``Q``, over ``P = R'Q R`` of these rates, ``Q >= I``."""
    if child_process.forked:
        raise NoCertificate("Clarabel is not run in a forked process")
    pairs = [mode.transformed(R) for mode in modes]
    rows = rows_of([mode for mode, _ in pairs], rates)
    spend(program_seconds(modes, "diagonal" if diagonal else "full"))
    goal, numbers = ("condition", []) if moment is None else ("trace", [moment])
    Q, taus = solved(goal, diagonal, numbers, rows, tolerance)
    value = R.T @ Q @ R
    value, top = (value + value.T) / 2, float(np.linalg.eigvalsh(value)[-1])
    multipliers = [np.maximum(tau, 1e-12) / scale / top for tau, (_, scale) in zip(taus, pairs, strict=True)]
    return evaluate(value / top, modes, multipliers)


def evaluate(P: np.ndarray, modes: Sequence[UncertainMatrix], multipliers: Sequence[np.ndarray]) -> CommonCertificate:
    """Return the rates that ``P`` has with given multipliers, from eigenvalues of Schur complements.

    Parameters
    ----------
    P : (n, n) array
        Positive definite.
    modes : sequence of UncertainMatrix
    multipliers : sequence of (q_i,) arrays
        Positive.

    Raises
    ------
    numpy.linalg.LinAlgError
        ``P`` is not positive definite in floats.

    Examples
    --------
    >>> one = UncertainMatrix(np.array([[3.0]]), np.ones((1, 1)), np.ones((1, 1)), np.array([1.0]))
    >>> round(evaluate(np.eye(1), [one], [np.ones(1)]).rate, 9)  # the matrices [2] to [4]
    4.0
    """
    inverse = np.linalg.inv(np.linalg.cholesky(P))  # of R'
    rates = []
    for mode, tau in zip(modes, multipliers, strict=True):
        S = P @ mode.A
        S = S + S.T
        if len(tau):
            spread = P @ (mode.F * mode.radii)
            S = S - (mode.H * tau) @ mode.H.T - (spread / tau) @ spread.T
        rates.append(float(np.linalg.eigvalsh(inverse @ S @ inverse.T)[0]))
    return CommonCertificate(P, tuple(rates), tuple(multipliers))


def best_multipliers(certificate: CommonCertificate, modes: Sequence[UncertainMatrix]) -> CommonCertificate:
    """Return the same ``P`` with the multipliers of the largest rate of each mode by itself, as far as time allows.

    Parameters
    ----------
    certificate : CommonCertificate
    modes : sequence of UncertainMatrix

    Examples
    --------
    >>> one = UncertainMatrix(np.array([[3.0]]), np.ones((1, 1)), np.ones((1, 1)), np.array([1.0]))
    >>> poor = evaluate(np.eye(1), [one], [np.array([0.1])])
    >>> round(best_multipliers(poor, [one]).rate, 4)
    4.0
    """
    P, taus, rates = certificate.matrix, list(certificate.multipliers), list(certificate.rates)
    R = np.linalg.cholesky(P).T
    for i, mode in enumerate(modes):
        # The slowest mode decided the search, and has its best already.
        if not len(taus[i]) or (len(modes) > 1 and rates[i] == certificate.rate):
            continue
        own, scale = mode.transformed(R)
        with contextlib.suppress(NoCertificate, OutOfTime, np.linalg.LinAlgError):
            spend(program_seconds([own], "fixed"))
            _, (best,) = solved("multipliers", False, [], rows_of([own], [0.0]), 1e-7)
            tau = np.maximum(best, 1e-12) / scale
            rate = evaluate(P, [mode], [tau]).rate
            if rate > rates[i]:
                taus[i], rates[i] = tau, rate
    return replace(certificate, rates=tuple(rates), multipliers=tuple(taus))
