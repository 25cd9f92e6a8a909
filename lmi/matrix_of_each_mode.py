"""One Lyapunov matrix for each mode of a system that switches seldom: the search, by Clarabel; proofs are elsewhere.

With ``P_i A + A' P_i >= b P_i`` for all members ``A`` of mode ``i``, and ``P_j <= m P_i`` for all pairs of modes, the
value ``x' P_i x`` of the present mode ``i`` decays at the rate ``b`` between switches, and grows at most by the factor
``m`` at one. A larger ``m`` leaves room for a larger ``b``: what is maximised is ``b - price ln m``, the price being
the switches per unit of the clock.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lmi import child_process
from lmi.common_lyapunov import CommonCertificate, common_lyapunov, evaluate
from lmi.errors import MatrixError, NoCertificate, OutOfTime
from lmi.rate_programs import inequality, multipliers, program_seconds, rows_of, run_program
from lmi.search_time import checkpoint, spend, uncounted
from lmi.uncertain_matrix import UncertainMatrix

#: Steps at most for one ``m``, the relative gain that is worth another one, and values of ``ln m`` that are tried.
_STEPS, _GAIN, _TRIALS = 8, 1e-3, 6
#: Largest ``ln m`` that is tried, and least eigenvalue of a matrix against the common one.
_LARGEST, _LEAST = math.log(1e6), 1e-7


@dataclass(frozen=True, eq=False)
class SwitchedCertificate:
    """One matrix for each mode, as far as floating point tells.

    Attributes
    ----------
    matrices : tuple of (n, n) arrays
        Symmetric.
    rates : tuple of float
        Of each mode with its own matrix, per unit of the clock.
    multipliers : tuple of (q_i,) arrays
        Of the uncertain parameters of each mode.
    ratio : float
        ``m >= 1``, with ``P_j <= m P_i`` for all modes.

    References
    ----------
    Hespanha and Morse, Stability of switched systems with average dwell-time, CDC 1999.
    """

    matrices: tuple[np.ndarray, ...]
    rates: tuple[float, ...]
    multipliers: tuple[np.ndarray, ...]
    ratio: float

    def worth(self, price: float) -> float:
        """Return the least rate minus what switches cost."""
        return min(self.rates) - price * math.log(self.ratio)


def switched_lyapunov(
    modes: Sequence[UncertainMatrix], price: float, *, start: CommonCertificate | None = None
) -> SwitchedCertificate:
    """Find one matrix for each mode with a large least rate minus ``price ln m``.

    One matrix for all modes, ``m = 1``, comes first. The least of the best rates of single modes, minus its rate,
    bounds what a larger ``m`` may cost; some values below are tried. For each the program ``maximise t`` subject to the
    inequalities with ``b P_i + t I`` in place of ``b P_i``, ``P_j <= m P_i`` and ``0 <= P_i <= I`` is repeated, ``b``
    being the rate of the last one.

    Parameters
    ----------
    modes : sequence of UncertainMatrix
    price : float
        Positive: the switches per unit of the clock.
    start : CommonCertificate, optional
        One matrix for all modes.

    Returns
    -------
    SwitchedCertificate

    Raises
    ------
    MatrixError
        The price is not positive.
    NoCertificate
        The solver found not even one matrix for all modes.
    OutOfTime
        The time limit is reached before that; later the best so far is returned.

    Examples
    --------
    >>> import numpy as np
    >>> fast, turned = np.array([[1.0, 9.0], [0.0, 1.5]]), np.array([[1.0, 0.0], [9.0, 1.5]])
    >>> modes = [UncertainMatrix.known(fast), UncertainMatrix.known(turned)]
    >>> seldom, often = (switched_lyapunov(modes, price) for price in (0.01, 10.0))
    >>> min(seldom.rates) > 1 > 0 > min(often.rates), seldom.ratio > often.ratio
    (True, True)
    """
    if not price > 0:
        raise MatrixError("the price of a switch is positive")
    if start is None:
        start = common_lyapunov(modes)
    best = SwitchedCertificate((start.matrix,) * len(modes), start.rates, start.multipliers, 1.0)
    if len(modes) == 1 or child_process.forked:
        return best
    with contextlib.suppress(NoCertificate, OutOfTime, np.linalg.LinAlgError):
        room = min(common_lyapunov([mode]).rate for mode in modes) - start.rate
        top, last = min(max(room, 0.0) / price, _LARGEST), best
        for trial in range(_TRIALS):
            if top < 1e-6:
                break
            last = _climb(modes, top * 2.0 ** (trial + 1 - _TRIALS), last, start.matrix)
            best = max(best, last, key=lambda found: found.worth(price))
    return best


def _climb(
    modes: Sequence[UncertainMatrix], log_ratio: float, last: SwitchedCertificate, common: np.ndarray
) -> SwitchedCertificate:
    """Repeat the program for one ``m``, each mode in coordinates in which its last matrix is the identity."""
    unit = np.linalg.inv(np.linalg.cholesky(common).T)
    for _ in range(_STEPS):
        checkpoint()
        rate, factors = min(last.rates), [np.linalg.cholesky(P).T for P in last.matrices]
        pairs = [mode.transformed(R) for mode, R in zip(modes, factors, strict=True)]
        program = _Program([mode for mode, _ in pairs], [R @ unit for R in factors], math.exp(log_ratio), rate)
        matrices, multipliers = program.solve()
        own = [R.T @ Q @ R for R, Q in zip(factors, matrices, strict=True)]
        size = max(float(np.abs(P).max()) for P in own)
        found = [
            evaluate((P + P.T) / (2 * size), [mode], [np.maximum(tau, 1e-12) / scale / size])
            for mode, P, tau, (_, scale) in zip(modes, own, multipliers, pairs, strict=True)
        ]
        ratio = max(_ratio(one.matrix, other.matrix) for one in found for other in found)
        rates = tuple(certificate.rate for certificate in found)
        if min(rates) <= rate:
            break
        forms = tuple(certificate.matrix for certificate in found)
        last = SwitchedCertificate(forms, rates, tuple(c.multipliers[0] for c in found), max(ratio, 1.0))
        if min(rates) - rate <= _GAIN * abs(min(rates)):
            break
    return last


def _ratio(one: np.ndarray, other: np.ndarray) -> float:
    """Return the least ``m`` with ``other <= m one``."""
    inverse = np.linalg.inv(np.linalg.cholesky(one))
    return float(np.linalg.eigvalsh(inverse @ other @ inverse.T)[-1])


@dataclass(frozen=True, eq=False)
class _Program:
    """The program of :func:`switched_lyapunov`: modes in their own coordinates, and how these lie to common ones."""

    modes: Sequence[UncertainMatrix]
    factors: Sequence[np.ndarray]
    ratio: float
    rate: float

    def solve(self) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """Return matrices and multipliers."""
        with uncounted():
            import cvxpy as cp
        n = len(self.modes[0].A)
        unit = max(float(np.abs(mode.A).max(initial=0.0)) for mode in self.modes) or 1.0
        t = cp.Variable()
        constraints, forms, taus = [], [], []
        for row in rows_of(self.modes, [self.rate] * len(self.modes), unit):
            P, tau = cp.Variable((n, n), symmetric=True), multipliers(row)
            constraints += [P >> _LEAST * np.eye(n), P << np.eye(n), inequality(P, row, tau, t) >> 0]
            forms.append(P)
            taus.append(tau)
        common = [S.T @ P @ S for S, P in zip(self.factors, forms, strict=True)]
        constraints += [self.ratio * P - Q >> 0 for P in common for Q in common if P is not Q]
        problem = cp.Problem(cp.Maximize(t), constraints)
        spend(len(self.modes) * program_seconds(self.modes, "full"))  # with an inequality for each pair of modes
        run_program(problem, n + max(mode.radii.size for mode in self.modes), 1e-7)
        if t.value is None or any(P.value is None or not np.isfinite(P.value).all() for P in forms):
            raise NoCertificate(f"the solver answered {problem.status}")
        matrices = [(P.value + P.value.T) / 2 + _LEAST * np.eye(n) for P in forms]
        return matrices, [np.zeros(0) if tau is None else tau.value for tau in taus]
