"""The search for diagonal Lyapunov matrices: rates by :mod:`lmi.diagonal_interior_point`, margins by Clarabel.

The solver only proposes: every result is recomputed from eigenvalues of the matrices that it returns, and a
certificate is proved elsewhere (:mod:`lmi.definiteness_proofs`).
"""

from __future__ import annotations

import contextlib
import importlib.util
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np

from lmi import child_process
from lmi.closed_form import h_matrix_diagonal, perron_vectors
from lmi.definiteness_proofs import no_diagonal_rate_above
from lmi.diagonal_interior_point import maximise_margin
from lmi.diagonal_solution import DiagonalCertificate, diagonal_margin, diagonal_rate, scaled
from lmi.dyadic import round_to_bits
from lmi.errors import LMIError, MatrixError, NoCertificate
from lmi.matrix_classes import block_columns, irreducible_blocks, square
from lmi.schur_coupling import couple_blocks
from lmi.search_time import checkpoint, seconds_left, uncounted

#: Up to this many rows Clarabel finds the best margin, as the paper does, within half a second; above,
#: :mod:`lmi.diagonal_interior_point`.
CLARABEL_MARGIN_ROWS = 32
#: Tolerance of a step, the relative gain that is worth another one, and how many steps there are at most, at a given
#: condition of a matrix of more than so many rows.
_COARSE, _COARSE_GAIN, _COARSE_STEPS, _FINE_ROWS = 1e-6, 1e-4, 8, 20
#: Solvers of the margin that may be asked for by name.
SOLVERS = ("clarabel", "interior-point", "sdpa")
#: Share of the smallest block rate that is given up when blocks are coupled.
COUPLING_LOSS = 5e-7


def diagonal_lyapunov(
    A: Any,
    *,
    objective: str = "margin",
    max_condition: float | None = None,
    basis: Any = None,
    start: Any = None,
    tolerance: float = 1e-9,
    solver: str | None = None,
) -> DiagonalCertificate:
    """Find the diagonal ``Omega > 0`` of the best margin or of the best rate.

    ``objective="margin"``, the paper's quotient: solves

        maximise t   subject to   Omega A + A' Omega >= t I,   0 <= Omega <= I,

    whose optimum is the largest ``lmin(Omega A + A' Omega) / lmax(Omega)``. ``objective="rate"`` maximises

        beta(Omega) = max { b : Omega A + A' Omega >= b Omega },

    which is what ``V = x' Omega x`` really decays by; quasiconcave, so with ``b`` from the last ``Omega_0`` the program
    ``maximise t: Omega A + A' Omega - b Omega >= t Omega_0`` climbs superlinearly. The optimum over a reducible matrix
    is the smallest of its irreducible blocks, reached in the limit of large condition: blocks are searched by
    themselves and coupled at a loss of 5e-7.

    A diagonal Lyapunov matrix exists for every nonsingular H-matrix with positive diagonal (Lemma 4) and for the
    Laplacian of every strongly connected structurally unbalanced signed digraph (Lemma 3.2), but the function takes
    any real square matrix.

    Parameters
    ----------
    A : (n, n) array or sparse matrix
        Any real matrix; a diagonal Lyapunov matrix exists only if all its eigenvalues have positive real part (not
        a sufficient condition).
    objective : {"margin", "rate"}
        What to maximise.
    max_condition : float, optional
        Largest ``max(omega) / min(omega)``, at least 1.
    basis : (n, r) array, optional
        Rate only: of an invariant subspace of ``A``, block by block; the inequality is asked for there only.
    start : (n,) array, optional
        Rate with ``max_condition`` only: logarithms of a diagonal from which to climb besides others, such as the
        ``log_omega`` of a faster one.
    tolerance : float
        Relative gap asked of the solver.
    solver : {"clarabel", "interior-point", "sdpa"}, optional
        Margin only; by default Clarabel up to 32 rows, and :mod:`lmi.diagonal_interior_point` above and in a forked
        process. SDPA needs the package sdpa-python.

    Returns
    -------
    DiagonalCertificate
        Best rate: with ``upper``, an upper bound of all diagonal rates from a dual solution, and its ``witness``
        (without ``max_condition``).

    Raises
    ------
    MatrixError
        ``A`` is not square, not finite, or an option is outside its domain.
    NoCertificate
        Margin or rate of what the solver returned is not positive: no diagonal Lyapunov matrix exists
        (:func:`refute_diagonal_lyapunov` may show it), or precision ends.

    References
    ----------
    Boyd, El Ghaoui, Feron, Balakrishnan, Linear Matrix Inequalities in System and Control Theory, SIAM 1994.

    Examples
    --------
    >>> certificate = diagonal_lyapunov([[2.0, -1.0], [-1.0, 2.0]])
    >>> round(certificate.rate, 6), certificate.omega.round(6)
    (2.0, array([1., 1.]))
    >>> fast = diagonal_lyapunov([[1.0, 2.0], [-1.0, 3.0]], objective="rate")
    >>> slow = diagonal_lyapunov([[1.0, 2.0], [-1.0, 3.0]])
    >>> round(fast.rate, 4), round(slow.rate, 4), fast.gap < 1e-4
    (2.0, 1.7639, True)
    """
    A = square(A)
    n, rate = len(A), objective == "rate"
    refusals = {
        f'objective "{objective}" is unknown; use "margin" or "rate"': objective not in ("margin", "rate"),
        f"max_condition = {max_condition} is below 1": max_condition is not None and not max_condition >= 1,
        f'solver "{solver}" is unknown; use one of {", ".join(SOLVERS)}': solver not in (None, *SOLVERS),
        "A has no rows": n == 0,
        'solver belongs to objective="margin"': rate and solver is not None,
        'basis and start belong to objective="rate"': not rate and (basis is not None or start is not None),
    }
    if refusal := next((text for text, holds in refusals.items() if holds), None):
        raise MatrixError(refusal)
    if solver == "sdpa" and importlib.util.find_spec("sdpap") is None:
        raise LMIError('solver "sdpa" needs the package sdpa-python: pip install sdpa-python')
    max_condition = None if max_condition == math.inf else max_condition
    if rate:
        diagonal = None if start is None else np.asarray(start, dtype=float)
        if diagonal is not None and not (diagonal.shape == (n,) and np.isfinite(diagonal).all()):
            raise MatrixError(f"start is not a finite vector of {n} entries")
        return _RateSearch(A, _basis(basis, n), tolerance, max_condition).optimum(diagonal)
    if n == 1 or max_condition == 1:
        return _margin_certificate(A, np.ones(n))
    scale, least = largest_entry(A), 0.0 if max_condition is None else 1 / max_condition
    # After a fork Clarabel may wait for ever for threads that the parent has.
    solver = solver or ("clarabel" if n <= CLARABEL_MARGIN_ROWS and not child_process.forked else "interior-point")
    if solver == "interior-point":
        return _margin_certificate(A, maximise_margin(A / scale, np.ones(n), tolerance=tolerance, least=least).omega)
    omega = positive(solve(A / scale, least, tolerance, solver))
    return _margin_certificate(A, np.maximum(omega, least * omega.max()))


# ---------------------------------------------------------------------- best rate


@dataclass(frozen=True, eq=False)
class _RateSearch:
    """The search for the best rate of ``A``, on a subspace and within a largest condition where these are given."""

    A: np.ndarray
    basis: np.ndarray | None
    tolerance: float
    max_condition: float | None = None

    def optimum(self, diagonal: np.ndarray | None) -> DiagonalCertificate:
        """Search block by block where the matrix is reducible, otherwise at once.

        ``diagonal`` is one from which to climb besides, within a largest condition.
        """
        A, parts = self.A, irreducible_blocks(self.A)
        if self.max_condition is not None:
            if diagonal is None and len(parts) > 1:
                with contextlib.suppress(NoCertificate):
                    diagonal = replace(self, max_condition=None).optimum(None).log_omega
            _, best = self.climb(diagonal)
            if not best.rate > _rounding(A, best.log_omega):
                raise NoCertificate(f"the best rate found at condition {self.max_condition:.3g} is {best.rate:.3g}")
            return best
        blocks = []
        for part in parts:
            own = None if self.basis is None else block_columns(self.basis, part)
            if own is None or own.shape[1]:
                blocks.append((part, replace(self, A=A[np.ix_(part, part)], basis=own).with_upper()))
        if not blocks:
            raise MatrixError("the basis has no columns: there is nothing to decay")
        part, worst = min(blocks, key=lambda block: block[1].rate)
        if not worst.rate > _rounding(A[np.ix_(part, part)], worst.log_omega):
            raise NoCertificate(f"the best rate found is {worst.rate:.3g}, which is not positive")
        if len(parts) == 1:
            return worst
        part, limit = min(blocks, key=lambda block: block[1].upper)
        witness = None
        if limit.witness is not None:
            witness = (np.zeros((len(A), limit.witness[0].shape[1])),)
            witness[0][part] = limit.witness[0]
        log_omega = np.zeros(len(A))
        for part, best in blocks:
            log_omega[part] = best.log_omega
        coupled = couple_blocks(A, parts, log_omega, worst.rate * (1 - COUPLING_LOSS), self.basis)
        return DiagonalCertificate(coupled, diagonal_rate(A, coupled, self.basis), limit.upper, witness)

    def with_upper(self) -> DiagonalCertificate:
        """Return the optimum of an irreducible matrix with a dual bound on all diagonal rates."""
        A = self.A
        if len(A) == 1:
            rate = 2 * float(A[0, 0])
            return DiagonalCertificate(np.zeros(1), rate, rate, (np.ones((1, 1)),))
        if len(A) == 2 and self.basis is None:
            return _two_rows(A)
        frame, best = self.climb()
        if not best.rate > 0:
            return best
        # The dual lives in other scales than the primal: frames and tolerances are tried until one shows the optimum.
        finer = self.tolerance / 100
        attempts = [(frame, self.tolerance), (_balance(A), finer), (frame, finer), (best.log_omega, finer)]
        for excess in (2e-6, 2e-5, 2e-4, 2e-3, 2e-2):
            for log_omega, accuracy in attempts:
                for Y in self.dual_factors(log_omega, best.rate * (1 + excess), accuracy):
                    if (upper := diagonal_rate_limit(A, Y)) < best.upper:
                        best = replace(best, upper=max(upper, best.rate), witness=(Y,))
                if best.gap <= 1.5 * excess:
                    return best
        return best

    def climb(self, diagonal: np.ndarray | None = None, steps: int = 40) -> tuple[np.ndarray, DiagonalCertificate]:
        """Climb to the best rate from a balanced scaling, the frame of all steps; the rate may be negative."""
        best = self.best_candidate(diagonal)
        frame = best.log_omega
        least, tolerance = 1e-7, self.tolerance
        # At a given condition a larger matrix is one of several, whose last digits are worth no further steps.
        if self.max_condition is not None and len(self.A) > _FINE_ROWS:
            least, tolerance, steps = _COARSE_GAIN, max(tolerance, _COARSE), min(steps, _COARSE_STEPS)
        for _ in range(steps):
            checkpoint()
            try:
                log_omega = np.log(positive(self.step(frame, best, tolerance)[0]))
            except NoCertificate:
                break
            proposal = log_omega - log_omega.max() + frame
            proposal -= proposal.max()
            if self.max_condition is not None:
                proposal = np.maximum(proposal, -math.log(self.max_condition))
            candidate = self.certify(proposal)
            if candidate is None or not candidate.rate > best.rate + _rounding(self.A, proposal):
                break
            gain, best = candidate.rate - best.rate, candidate
            if gain <= least * abs(best.rate):
                break
        return frame, best

    def best_candidate(self, diagonal: np.ndarray | None = None) -> DiagonalCertificate:
        """Return the best of the identity, a balanced scaling, the Perron vectors of ``M(A)`` and a known diagonal."""
        candidates = [np.zeros(len(self.A)), _balance(self.A), *([] if diagonal is None else [diagonal])]
        with contextlib.suppress(LMIError, np.linalg.LinAlgError):
            log_u, log_v = perron_vectors(self.A)
            candidates.append(log_v - log_u)
        diagonals = [one for log in candidates if np.isfinite(log).all() for one in self.fit(log - log.max())]
        certificates = [candidate for one in diagonals if (candidate := self.certify(one)) is not None]
        if not certificates:
            raise NoCertificate("the entries lie too far apart for floating point")
        return max(certificates, key=lambda candidate: candidate.rate)

    def fit(self, log_omega: np.ndarray) -> list[np.ndarray]:
        """Return the diagonal cut, and its power shrunk, to the largest condition."""
        limit = math.inf if self.max_condition is None else math.log(self.max_condition)
        if -log_omega.min() <= limit:
            return [log_omega]
        return [np.maximum(log_omega, -limit), log_omega * (limit / -log_omega.min())]

    def certify(self, log_omega: np.ndarray) -> DiagonalCertificate | None:
        """Return a diagonal with its rate; None where floating point ends."""
        with contextlib.suppress(NoCertificate, np.linalg.LinAlgError):
            rate = diagonal_rate(self.A, log_omega, self.basis)
            return DiagonalCertificate(log_omega, rate) if math.isfinite(rate) else None
        return None

    def step(
        self, frame: np.ndarray, current: DiagonalCertificate, tolerance: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Solve ``maximise t: Omega A + A' Omega - b Omega >= t Omega_0`` for the rate ``b`` of the current matrix.

        Rows and columns are scaled by the frame to the power -1/2, then by ``unit`` to unit diagonal, where weights of
        many decades meet. Returns ``Omega`` relative to the frame, ``unit``, and a factor of the dual matrix in rows
        so scaled: unscaled, its small rows would be lost.
        """
        B, apart = scaled(self.A, frame), current.log_omega - frame
        diagonal = np.diag(B)
        unit = 1 / np.sqrt(diagonal if (diagonal > 0).all() else np.full(len(B), largest_entry(B)))
        square_unit = unit * unit
        weight = square_unit * np.exp(apart - apart.max())
        tail = None
        if self.basis is not None:
            tail = np.linalg.qr((np.exp(frame / 2) / unit)[:, None] * self.basis)[0]
        C = unit[:, None] * B * unit - np.diag(current.rate / 2 * square_unit)
        optimum = maximise_margin(C, weight / weight.max(), tail, tolerance, np.exp(frame), self.max_condition)
        values, vectors = np.linalg.eigh((optimum.X + optimum.X.T) / 2)
        factor = vectors * np.sqrt(np.maximum(values, 0.0))
        return optimum.omega, unit, factor if tail is None else tail @ factor

    def dual_factors(self, frame: np.ndarray, b: float, tolerance: float) -> list[np.ndarray]:
        """Return matrices ``Y``, ``X = Y Y'`` of which may show that no diagonal rate exceeds ``b``; in original rows.

        Rows in which the solver left noise are cleared at several levels: a row of zeros meets its condition.
        """
        try:
            _, unit, factor = self.step(frame, DiagonalCertificate(frame, b), tolerance)
        except NoCertificate:
            return []
        size = np.einsum("ij,ij->i", factor, factor)
        factors: list[np.ndarray] = []
        for noise in (0.0, 1e-14, 1e-12, 1e-10, 1e-8) if self.basis is None else (0.0,):
            rows = size > noise * size.max()
            if factors and rows.all():
                continue
            Y = np.where(rows[:, None], (unit * np.exp(-frame / 2))[:, None] * factor, 0.0)
            top = np.abs(Y).max(initial=0.0)
            if top > 0 and math.isfinite(top):
                factors.append(Y / top)
        return factors


def _two_rows(A: np.ndarray) -> DiagonalCertificate:
    """Return the optimum of an irreducible block of two rows: ``B = Omega^1/2 A Omega^-1/2`` with ``|B_12| = |B_21|``.

    If both have one sign, ``B`` is symmetric and nothing beats its smallest eigenvalue; otherwise ``B + B'`` is
    diagonal and nothing beats its smaller entry.
    """
    log_omega = np.array([math.log(abs(A[1, 0])) - math.log(abs(A[0, 1])), 0.0])
    log_omega -= log_omega.max()
    Y = np.eye(2)[:, [int(np.argmin(np.diag(A)))]]
    if A[0, 1] * A[1, 0] > 0:
        Y = np.exp(-log_omega / 2)[:, None] * np.linalg.eigh(scaled(A, log_omega))[1][:, :1]
    rate = diagonal_rate(A, log_omega)
    return DiagonalCertificate(log_omega, rate, max(diagonal_rate_limit(A, Y), rate), (Y,))


def _balance(A: np.ndarray) -> np.ndarray:
    """Return ``log_omega`` with which the rows and columns of ``Omega^1/2 A Omega^-1/2`` have norms of a size."""
    from scipy.linalg import matrix_balance

    with np.errstate(all="ignore"):
        log_omega = -2 * np.log(matrix_balance(A, permute=False, separate=True)[1][0])
    return log_omega - log_omega.max()


def diagonal_rate_limit(A: Any, Y: np.ndarray) -> float:
    """Return the least ``b`` with ``diag(A X) <= (b/2) diag(X)``, ``X = Y Y'``: no diagonal rate exceeds it.

    If ``Omega A + A' Omega >= b' Omega`` then ``2 sum_i omega_i (A X)_ii >= b' sum_i omega_i X_ii``.

    Parameters
    ----------
    A : (n, n) array or sparse matrix
    Y : (n, k) array
        Not zero.

    Returns
    -------
    float
        In floating point, raised by what rounding may have taken; :func:`lmi.no_diagonal_rate_above` decides in
        rationals. Infinite if the rows where ``X`` is zero forbid any bound.

    Raises
    ------
    MatrixError
        The shapes do not match.

    References
    ----------
    Barker, Berman, Plemmons, Positive diagonal solutions to the Lyapunov equations, Linear Multilinear Algebra 5
    (1978).

    Examples
    --------
    >>> 0 <= diagonal_rate_limit([[1.0, -1.0], [-1.0, 1.0]], [[1.0], [1.0]]) < 1e-14
    True
    """
    A, Y = square(A), np.asarray(Y, dtype=float)
    if Y.ndim != 2 or len(Y) != len(A):
        raise MatrixError(f"Y has shape {Y.shape}, not ({len(A)}, k)")
    forms, size, terms = ((M * N).sum(axis=1) for M, N in ((A @ Y, Y), (Y, Y), (np.abs(A) @ np.abs(Y), np.abs(Y))))
    # What rounding may have taken from the sums is added.
    forms += (len(A) + Y.shape[1] + 4) * np.finfo(float).eps * terms
    return float((2 * forms[size > 0] / size[size > 0]).max()) if size.any() else math.inf


def refute_diagonal_lyapunov(A: Any, rate: float = 0.0, *, tolerance: float = 1e-9) -> list[list[Fraction]] | None:
    """Search a proof that no diagonal matrix decays faster than ``rate``; 0: that there is no diagonal solution at all.

    A nonzero ``X = Y Y'`` with ``diag(A X) <= (rate/2) diag(X)`` is that proof; the rounded ``Y`` is checked in
    rationals before it is returned.

    Parameters
    ----------
    A : (n, n) array or sparse matrix
        Read as the dyadic rationals that its floats are.
    rate : float
        Per unit of the clock.
    tolerance : float
        Relative gap asked of the solver.

    Returns
    -------
    n rows of k Fractions, or None
        ``Y``; None if no proof was found, as for every matrix that has a faster diagonal solution.

    Raises
    ------
    MatrixError
        ``A`` is not real, finite and square or has no rows, or the rate is not finite.

    References
    ----------
    Barker, Berman, Plemmons, Positive diagonal solutions to the Lyapunov equations, Linear Multilinear Algebra 5
    (1978).

    Examples
    --------
    >>> refute_diagonal_lyapunov([[1.0, 3.0], [3.0, 1.0]]) is not None
    True
    >>> refute_diagonal_lyapunov([[1.0, 3.0], [-3.0, 1.0]]) is None
    True
    """
    A = square(A)
    if len(A) == 0 or not math.isfinite(rate):
        raise MatrixError("A has no rows, or the rate is not finite")
    exact = [[Fraction(float(x)) for x in row] for row in A]
    if (low := np.flatnonzero(2 * np.diag(A) <= rate)).size:
        return [[Fraction(int(i == low[0]))] for i in range(len(A))]
    search = _RateSearch(A, None, tolerance)
    try:
        log_omega = search.best_candidate().log_omega
    except NoCertificate:
        return None
    attempts = [(np.zeros(len(A)), tolerance), (log_omega, tolerance), (_balance(A), tolerance / 100)]
    for frame, accuracy in attempts:
        for Y in search.dual_factors(frame, rate, accuracy):
            # Columns by size: small ones carry the solver's noise, and the sum often passes without them.
            order = np.argsort(-np.einsum("ij,ij->j", Y, Y))
            for count in sorted({len(order), 1, 2}):
                if diagonal_rate_limit(A, chosen := Y[:, order[:count]]) > rate + 1e-3 * abs(rate) + 1e-12:
                    continue
                rows = [[round_to_bits(float(x), 40) for x in row] for row in chosen]
                if no_diagonal_rate_above(exact, rows, Fraction(rate)):
                    return rows
    return None


def rate_frontier(
    A: Any,
    *,
    conditions: Sequence[float] | None = None,
    basis: Any = None,
    best: DiagonalCertificate | None = None,
    tolerance: float = 1e-9,
) -> tuple[DiagonalCertificate, ...]:
    """Return rate against overshoot constant: diagonal matrices, each the fastest at its condition number.

    At clock value ``s`` a Lyapunov function bounds ``||x||^2`` by ``condition * exp(-rate s) ||x(0)||^2``; early the
    small conditions are best, late the large rates, and the pointwise minimum of a few Lyapunov functions is much
    better than either.

    Parameters
    ----------
    A : (n, n) array or sparse matrix
    conditions : sequence of float, optional
        By default 1 and six values up to the condition of the best rate, but at most 1e8.
    basis : (n, r) array, optional
        See :func:`diagonal_lyapunov`.
    best : DiagonalCertificate, optional
        The best rate, if it was searched before.
    tolerance : float
        Relative gap asked of the solver.

    Returns
    -------
    tuple of DiagonalCertificate
        Condition and rate strictly increasing. The rate of the first, the identity, may be negative.

    Raises
    ------
    MatrixError
        ``A`` is not real, finite and square or has no rows, or ``basis`` is no finite matrix of n rows.
    NoCertificate
        No positive rate was found at any condition.

    References
    ----------
    Boyd, El Ghaoui, Feron, Balakrishnan, Linear Matrix Inequalities in System and Control Theory, SIAM 1994.

    Examples
    --------
    >>> [(round(c.condition, 2), round(c.rate, 3)) for c in rate_frontier([[1.0, 2.0], [-1.0, 3.0]], conditions=[1, 2])]
    [(1.0, 1.764), (2.0, 2.0)]
    """
    A = square(A)
    if len(A) == 0:
        raise MatrixError("A has no rows")
    search = _RateSearch(A, _basis(basis, len(A)), tolerance)
    points = [DiagonalCertificate(np.zeros(len(A)), diagonal_rate(A, np.zeros(len(A)), search.basis))]
    diagonal = None if best is None else best.log_omega
    if conditions is None:
        best = search.optimum(None) if best is None else best
        diagonal = best.log_omega
        top = min(best.log_condition, math.log(1e8))
        conditions = [math.exp(top * share) for share in (0.9, 0.7, 0.5, 0.35, 0.2, 0.1)]
        points.append(best)
    for condition in conditions:
        if condition > 1:
            with contextlib.suppress(NoCertificate):
                points.append(replace(search, max_condition=condition).climb(diagonal, steps=12)[1])
                diagonal = points[-1].log_omega
    points.sort(key=lambda point: (point.log_condition, -point.rate))
    frontier: list[DiagonalCertificate] = []
    for point in points:
        if not frontier or point.rate > frontier[-1].rate:
            frontier.append(point)
    if not frontier[-1].rate > _rounding(A, frontier[-1].log_omega):
        raise NoCertificate(f"the best rate found is {frontier[-1].rate:.3g}, which is not positive")
    return tuple(frontier)


def _basis(basis: Any, n: int) -> np.ndarray | None:
    if basis is None:
        return None
    basis = np.asarray(basis, dtype=float)
    if basis.ndim != 2 or len(basis) != n or not np.isfinite(basis).all() or not basis.any():
        raise MatrixError(f"basis is not a finite matrix of {n} rows that spans something")
    return basis


def _rounding(A: np.ndarray, log_omega: np.ndarray) -> float:
    """Bound what rounding may add to :func:`diagonal_rate`; a smaller rate is none."""
    return len(A) * np.finfo(float).eps * float(np.abs(scaled(A, log_omega)).sum(axis=1).max())


def h_matrix_lyapunov(A: Any, *, tolerance: float = 1e-9) -> DiagonalCertificate:
    """Lemma 4: a nonsingular H-matrix with positive diagonal has ``Omega > 0`` with ``Omega A + A' Omega > 0``.

    The hypothesis is tested first; then the search of :func:`diagonal_lyapunov` runs.

    Parameters
    ----------
    A : (n, n) array or sparse matrix
    tolerance : float
        Relative gap asked of the solver.

    Returns
    -------
    DiagonalCertificate

    Raises
    ------
    NotAnHMatrix
        A diagonal entry is not positive, or ``M(A)`` has no positive ``u`` with ``M(A) u > 0``.

    Examples
    --------
    >>> h_matrix_lyapunov([[2.0, 1.0], [-1.0, 2.0]]).omega.round(6)
    array([1., 1.])
    """
    A = square(A)
    closed_form = h_matrix_diagonal(A)
    try:
        return diagonal_lyapunov(A, tolerance=tolerance)
    except NoCertificate:
        # The best margin can lie below what the solver resolves; the closed form exists all the same.
        return _margin_certificate(A, closed_form)


def _margin_certificate(A: np.ndarray, omega: np.ndarray) -> DiagonalCertificate:
    log_omega = np.log(positive(omega))
    log_omega -= log_omega.max()
    margin = diagonal_margin(A, np.exp(log_omega))
    if not margin > 0:
        raise NoCertificate(f"the best margin found is {margin:.3g}, which is not positive")
    return DiagonalCertificate(log_omega, margin)


def positive(omega: np.ndarray) -> np.ndarray:
    """Lift entries that the solver left at or below zero."""
    top = float(np.max(omega, initial=0.0))
    if not (math.isfinite(top) and top > 0):
        raise NoCertificate("the solver returned no positive diagonal")
    return np.maximum(omega, 1e-14 * top)


def largest_entry(A: np.ndarray) -> float:
    """Return a unit in which the entries of ``A`` are at most 1."""
    return float(np.abs(A).max(initial=0.0)) or 1.0


def solve(A: np.ndarray, least: float, tolerance: float, solver: str) -> np.ndarray:
    """Maximise the margin with cvxpy, and return ``Omega``; the status is not trusted, only its absence."""
    import warnings

    from scipy import sparse

    with uncounted():
        import cvxpy as cp

        cp.installed_solvers()
    checkpoint()
    n = len(A)
    omega, t = cp.Variable(n), cp.Variable()
    product = cp.diag(omega) @ sparse.csr_array(A)  # keeps the zeros
    form = product + product.T - t * np.eye(n)
    problem = cp.Problem(cp.Maximize(t), [form >> 0, omega >= least, omega <= 1])
    options: dict[str, Any] = {}  # SDPA stops where its own precision ends, whatever it is asked for
    if solver == "clarabel":
        options = {"tol_gap_abs": tolerance * 1e-3, "tol_gap_rel": tolerance, "tol_feas": tolerance}
        # The default merge of chordal cliques does not end on some sparse matrices. Small ones need no decomposition.
        options["chordal_decomposition_enable"] = n > CLARABEL_MARGIN_ROWS
        options["chordal_decomposition_merge_method"] = "parent_child"
        options["time_limit"] = seconds_left()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # "solution may be inaccurate": every result is recomputed by the caller
        run_solver(problem, solver, options)
    checkpoint()
    if omega.value is None or not np.isfinite(omega.value).all():
        raise NoCertificate(f"the solver answered {problem.status}")
    return omega.value


def run_solver(built: Any, solver: str, options: dict[str, Any]) -> None:
    """Run a solver; where Clarabel panics, once more without splitting the matrix, which makes rings 100 times slower.

    Raises
    ------
    NoCertificate
        The solver failed, or panicked again.
    """
    import cvxpy as cp

    try:
        built.solve(solver=solver.upper(), **options)
        return
    except (cp.SolverError, ValueError) as error:  # a ValueError: an entry is not finite
        raise NoCertificate(f"the solver failed: {str(error).splitlines()[0]}") from None
    except BaseException as error:  # a panic is no Exception
        if type(error).__name__ != "PanicException":
            raise
        if not options.get("chordal_decomposition_enable", True):
            raise NoCertificate("the solver failed: Clarabel panicked") from None
    run_solver(built, solver, options | {"chordal_decomposition_enable": False})
