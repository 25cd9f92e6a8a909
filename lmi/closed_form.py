"""Diagonal Lyapunov matrices in closed form, without a solver."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import cache
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import ArpackError, eigsh

from lmi.diagonal_solution import DiagonalCertificate
from lmi.errors import MatrixError, NoCertificate, NotAnHMatrix, NotAnMMatrix
from lmi.matrix_classes import block_depths, m_matrix_witness, sparse_square
from lmi.search_time import checkpoint
from lmi.sparse_h_matrix import diagonal_factor

#: Up to this many rows a tight rate is the eigenvalue of a dense matrix.
DENSE_ROWS = 1500
#: Up to this many rows a left null vector is computed without subtractions.
ELIMINATION_ROWS = 3000
#: Coupled components reach ``2 lambda_min`` only in the limit: this share of it is given up.
LOSS = 5e-7
#: The shares of ``lambda_min`` tried under a bound on the condition; above 1 the shift is negative.
LOSSES = np.geomspace(LOSS, 10.0, 15)
#: Above this many rows only so many of them, the best, are improved.
FEW_ROWS, MOST_TIGHTENED = 40, 4
EPS = float(np.finfo(float).eps)


def h_matrix_diagonal(A: Any) -> np.ndarray:
    """Diagonal Lyapunov matrix of a nonsingular H-matrix with positive diagonal: ``Omega = diag(v / u)``.

    With ``M = M(A)``, ``M u = 1`` and ``M' v = 1``, both positive,

        x'(Omega A + A' Omega)x >= |x|'(Omega M + M' Omega)|x|,    (Omega M + M' Omega) u = Omega 1 + 1 > 0,

    and a symmetric Z-matrix that takes some ``u > 0`` to a positive vector is positive definite. Not the best such
    matrix, but there for every H-matrix, however small its margin.

    Parameters
    ----------
    A : (n, n) array or sparse matrix

    Returns
    -------
    (n,) array
        Positive, largest entry 1.

    Raises
    ------
    NotAnHMatrix
        No positive ``u`` with ``M(A) u > 0`` was confirmed, or a diagonal entry is not positive.

    References
    ----------
    Kaszkurewicz and Bhaya, Matrix Diagonal Stability in Systems and Computation, Birkhauser 2000, section 2.

    Examples
    --------
    >>> h_matrix_diagonal([[2.0, 0.0], [-1.0, 1.0]])
    array([1.        , 0.33333333])
    """
    M = _comparison(sparse_square(A)).toarray()
    # Rows scaled to unit diagonal: the class does not change, and the witness is confirmed at any magnitude.
    if m_matrix_witness(M / np.diag(M)[:, None]) is None:
        raise NotAnHMatrix("no positive u with M(A) u > 0 was confirmed in float64")
    u, v = (np.linalg.solve(B, np.ones(len(M))) for B in (M, M.T))
    if not ((u > 0).all() and (v > 0).all()):
        raise NotAnHMatrix("the comparison matrix M(A) is too near a singular one for float64")
    omega = v / u
    return omega / omega.max()


def m_matrix_certificate(
    A: Any, u: Any = None, v: Any = None, *, max_condition: float | None = None
) -> DiagonalCertificate:
    """Diagonal Lyapunov matrix of a nonsingular M-matrix: ``Omega = diag(v / u)``.

    With ``u, v > 0``, ``A u > 0`` and ``A' v > 0``,

        Omega A + A' Omega  >=  b Omega,     b = min_i (A u)_i / u_i + (A' v)_i / v_i:

    the symmetric Z-matrix ``S = Omega A + A' Omega - b Omega`` has ``(S u)_i = v_i ((A u)_i / u_i + (A' v)_i / v_i - b)
    >= 0``, and one that takes some ``u > 0`` to a nonnegative vector is positive semidefinite (Perron and Frobenius).
    With Perron vectors ``b = 2 lambda_min(A)``: no Lyapunov function of any kind decays faster.

    A reducible matrix has in general no positive Perron vectors. There ``A u >= t u`` and ``A' v >= t v`` are solved
    one strong component after the other with ``t`` just below ``lambda_min``. Along chains ``cond(Omega)`` leaves the
    range of float64: all is done in logarithms, and the rate is evaluated from the witness and rounded down.

    Parameters
    ----------
    A : (n, n) array or sparse matrix
        Off-diagonal entries <= 0.
    u, v : (n,) array, optional
        Positive witnesses, used as they are. Default: Perron vectors where no strong component is coupled to another
        (rate ``2 lambda_min`` to rounding), otherwise a rate of ``2 lambda_min (1 - 5e-7)`` to rounding.
    max_condition : float, optional
        Largest admissible ``max(Omega) / min(Omega)``, >= 1. Smaller ``t`` and powers of the witness are tried (``b``
        is concave in ``(log u, log v)``) and the best is kept; another ``Omega`` of that condition may do better.

    Returns
    -------
    DiagonalCertificate
        ``rate`` is ``b``, ``upper`` is ``2 lambda_min`` rounded up, ``witness`` is ``(log u, log v)``.

    Raises
    ------
    NotAnMMatrix
        ``A`` is no nonsingular M-matrix as far as float64 tells, or ``u`` or ``v`` no witness; names the entry.
    NoCertificate
        No positive rate was found within ``max_condition``.
    MatrixError
        ``A`` is not real, finite and square, or ``max_condition`` is below 1.

    References
    ----------
    Kaszkurewicz and Bhaya, Matrix Diagonal Stability in Systems and Computation, Birkhauser 2000, section 2.
    Berman and Plemmons, Nonnegative Matrices in the Mathematical Sciences, SIAM 1994, chapter 6.

    Examples
    --------
    >>> certificate = m_matrix_certificate([[2.0, -1.0], [-4.0, 2.0 + 3.0]])
    >>> round(certificate.rate, 9), round(certificate.upper, 9), certificate.omega.round(9).tolist()
    (2.0, 2.0, [1.0, 0.25])
    >>> m_matrix_certificate([[1.0, 0.0], [-3.0, 1.0]], max_condition=100).rate > 1.39
    True
    """
    return _ClosedForm(A, u, v).best(max_condition)


class _ClosedForm:
    """The witnesses of an M-matrix at several losses of rate, each made once."""

    def __init__(self, A: Any, u: Any = None, v: Any = None):
        self.A = sparse_square(A)
        _require_z_matrix(self.A)
        self._right, self._left = _Components(self.A), _Components(self.A.T)
        self._low = max(self._right.smallest(), self._left.smallest())
        self._upper = 2 * float(min(self._right.high.min(), self._left.high.min()))
        self._log_u, self._log_v = _check(self.A, u, "A u", "u"), _check(self.A.T, v, "A' v", "v")
        self._at = cache(self._certificate)

    def _certificate(self, loss: float) -> DiagonalCertificate:
        checkpoint()
        rate = self._low * (1 - loss)
        log_u = self._right.log_witness(rate) if self._log_u is None else self._log_u
        log_v = self._left.log_witness(rate) if self._log_v is None else self._log_v
        return _from_witness(self.A, log_u, log_v, self._upper)

    def best(self, max_condition: float | None) -> DiagonalCertificate:
        """Return the certificate of :func:`m_matrix_certificate`."""
        if max_condition is not None and not max_condition >= 1:
            raise MatrixError(f"max_condition is {max_condition}, not at least 1")
        limit = math.inf if max_condition is None else math.log(max_condition)
        best = self._at(LOSS)
        if best.rate <= 0:
            raise NotAnMMatrix("the matrix is too near a singular one for float64")
        if best.log_condition <= limit:
            return best
        if self._log_u is None and self._log_v is None:
            candidates = [_shrink(self.A, self._at(loss), limit) for loss in LOSSES]
            if self.A.shape[0] > FEW_ROWS:
                candidates = sorted(candidates, key=lambda one: one.rate)[-MOST_TIGHTENED:]
            best = max((_tighten(self.A, one) for one in candidates), key=lambda one: one.rate)
        if best.log_condition > limit or best.rate <= 0:
            raise NoCertificate(f"no positive rate was found with a condition of at most {max_condition:.6g}")
        return best


def h_matrix_certificate(A: Any, *, max_condition: float | None = None) -> DiagonalCertificate:
    """Diagonal Lyapunov matrix of a nonsingular H-matrix with positive diagonal, from its comparison matrix.

    With ``M = M(A)`` and ``Omega``, ``b`` of :func:`m_matrix_certificate` for ``M``,

        x'(Omega A + A' Omega)x  >=  |x|'(Omega M + M' Omega)|x|  >=  b x' Omega x.

    Parameters
    ----------
    A : (n, n) array or sparse matrix
        Stays sparse above 1,500 rows.
    max_condition : float, optional
        See :func:`m_matrix_certificate`.

    Returns
    -------
    DiagonalCertificate
        ``rate`` is ``b``, or up to 1,500 rows the tight rate of ``Omega`` and ``A`` if that is larger. ``upper`` is
        infinite: ``2 lambda_min(M)`` bounds no other diagonal. ``witness`` is ``(log u, log v)`` for ``M``.

    Raises
    ------
    NotAnHMatrix
        A diagonal entry is not positive, or ``M(A)`` is no nonsingular M-matrix as far as float64 tells.
    NoCertificate
        No positive rate was found within ``max_condition``.
    MatrixError
        ``A`` is not real, finite and square, or ``max_condition`` is below 1.

    References
    ----------
    Kaszkurewicz and Bhaya, Matrix Diagonal Stability in Systems and Computation, Birkhauser 2000, section 2.

    Examples
    --------
    >>> certificate = h_matrix_certificate([[2.0, 1.0], [-1.0, 2.0]])
    >>> round(certificate.rate, 9), certificate.omega.round(9).tolist()
    (4.0, [1.0, 1.0])
    """
    return next(h_matrix_frontier(A, [max_condition]))


def h_matrix_frontier(A: Any, conditions: Sequence[float | None]) -> Iterator[DiagonalCertificate]:
    """Yield :func:`h_matrix_certificate` for several largest conditions, with less work than one after the other.

    Parameters
    ----------
    A : (n, n) array or sparse matrix
    conditions : sequence of float or None
        None for no limit.

    Returns
    -------
    iterator of DiagonalCertificate

    Raises
    ------
    NotAnHMatrix
        As :func:`h_matrix_certificate`.
    NoCertificate
        At the first condition within which no positive rate was found.
    MatrixError
        ``A`` is not real, finite and square, or a condition is below 1.

    References
    ----------
    Kaszkurewicz and Bhaya, Matrix Diagonal Stability in Systems and Computation, Birkhauser 2000, section 2.

    Examples
    --------
    >>> chain = [[1.0, 0.0], [-9.0, 1.0]]
    >>> wide, narrow = h_matrix_frontier(chain, [None, 100.0])
    >>> wide.rate > narrow.rate, narrow.condition <= 100
    (True, True)
    """
    A = sparse_square(A)
    try:
        closed = _ClosedForm(_comparison(A))
        for max_condition in conditions:
            best = closed.best(max_condition)
            rate = max(best.rate, _tight_rate(A, best.log_omega)) if A.shape[0] <= DENSE_ROWS else best.rate
            yield DiagonalCertificate(best.log_omega, rate, witness=best.witness)
    except NotAnMMatrix as error:
        raise NotAnHMatrix(f"M(A) is not a nonsingular M-matrix: {error}") from None


def perron_certificate(A: Any) -> DiagonalCertificate:
    """Diagonal Lyapunov matrix of a matrix whose comparison matrix is an irreducible M-matrix, even a singular one.

    With Perron vectors ``M u = lambda u``, ``M' v = lambda v`` of ``M = M(A)`` and ``Omega = diag(v / u)``,

        x'(Omega A + A' Omega)x  >=  |x|'(Omega M + M' Omega)|x|  >=  2 lambda x' Omega x,     lambda >= 0.

    For a signed Laplacian ``L`` of a strongly connected digraph ``M(L) 1 = 0``, hence ``lambda = 0``, ``u = 1``,
    ``v' M(L) = 0``, and ``x'(Omega L + L' Omega)x = sum_kl v_k |w_kl| (x_k - sign(w_kl) x_l)^2``, which vanishes for
    some ``x != 0`` only if the digraph is structurally balanced.

    Parameters
    ----------
    A : (n, n) array or sparse matrix
        Irreducible, with positive diagonal. Stays sparse above 3,000 rows.

    Returns
    -------
    DiagonalCertificate
        ``rate`` is the tight rate of this ``Omega`` (see :func:`lmi.diagonal_solution.diagonal_rate`), lowered by
        its rounding up to 1,500 rows and by its residual above; ``upper`` is infinite, ``witness`` is
        ``(log u, log v)``.

    Raises
    ------
    NotAnHMatrix
        ``A`` is reducible, a diagonal entry is not positive or ``M(A)`` has a negative eigenvalue.
    NoCertificate
        The rate is not positive as far as float64 tells: for a signed Laplacian, the digraph is balanced.
    MatrixError
        ``A`` is not real, finite and square.

    References
    ----------
    Berman and Plemmons, Nonnegative Matrices in the Mathematical Sciences, SIAM 1994, chapter 6, theorem 4.16.
    Grassmann, Taksar and Heyman, Regenerative analysis and steady state distributions, Oper. Res. 33 (1985).

    Examples
    --------
    >>> certificate = perron_certificate([[3.0, 3.0], [-1.0, 1.0]])
    >>> round(certificate.rate, 9), certificate.omega.round(9).tolist()
    (2.0, [0.333333333, 1.0])
    """
    A = sparse_square(A)
    log_u, log_v = perron_vectors(A)
    log_omega = log_v - log_u
    log_omega -= log_omega.max()
    rate = _tight_rate(A, log_omega)
    if not rate > 0:
        raise NoCertificate("the Perron vectors give no rate above rounding; a balanced digraph has none")
    return DiagonalCertificate(log_omega, rate, witness=(log_u, log_v))


def perron_vectors(A: Any) -> tuple[np.ndarray, np.ndarray]:
    """Logarithms of the right and left Perron vectors of ``M(A)``: eigenvectors of its smallest eigenvalue.

    Where the rows of ``M(A)`` sum to 0, as for the Laplacian of a signed digraph, the right one is constant and the
    left one is computed without subtractions.

    Parameters
    ----------
    A : (n, n) array or sparse matrix
        Irreducible.

    Returns
    -------
    tuple of two (n,) arrays

    Raises
    ------
    NotAnHMatrix
        ``A`` is reducible or ``M(A)`` is not an M-matrix.

    References
    ----------
    Berman and Plemmons, Nonnegative Matrices in the Mathematical Sciences, SIAM 1994, chapter 6, theorem 4.16.
    Grassmann, Taksar and Heyman, Regenerative analysis and steady state distributions, Oper. Res. 33 (1985).

    Examples
    --------
    >>> u, v = perron_vectors([[3.0, 3.0], [1.0, 1.0]])
    >>> u.tolist(), round(float(v[1] - v[0]), 9)
    ([0.0, 0.0], 1.098612289)
    """
    M = _comparison(sparse_square(A))
    if connected_components(M, connection="strong")[0] > 1:
        raise NotAnHMatrix("the matrix is reducible")
    rows = np.zeros(M.shape[0])
    ratio, error = _ratios(M, rows)
    if (np.abs(ratio) <= error).all():
        return rows, _log_left_vector(M)
    right, left = _Components(M, singular=True), _Components(M.T, singular=True)
    if (value := min(right.high[0], left.high[0])) < 0:
        raise NotAnHMatrix(f"M(A) is not an M-matrix: it has the eigenvalue {value:.6g}")
    return right.log_perron, left.log_perron


class _Components:
    """The strong components of a Z-matrix with the eigenvalues and Perron vectors of its diagonal blocks.

    Rows are reordered so that the blocks are contiguous and each is coupled to earlier ones only.

    Attributes
    ----------
    low, high : (number of blocks,) arrays
        Bounds of the smallest eigenvalue of each block, from the quotients of Collatz and Wielandt
        and, above, the least diagonal entry.
    log_perron : (n,) array
        Logarithms of the Perron vectors of the blocks, in the order of the matrix.
    """

    def __init__(self, A: sparse.csr_array, singular: bool = False) -> None:
        label, level = block_depths(sparse.csr_array(A))
        size = np.bincount(label)
        self.order = np.lexsort((label, size[label] > 1, level[label]))
        label = label[self.order]
        self.offsets = np.flatnonzero(np.diff(label, prepend=-1))
        self.part = np.cumsum(np.diff(label, prepend=label[0]) != 0)
        entries = sparse.csr_array(A)[self.order][:, self.order].tocoo()
        inside = self.part[entries.row] == self.part[entries.col]
        within, across = (
            sparse.csr_array((entries.data[k], (entries.row[k], entries.col[k])), shape=A.shape)
            for k in (inside, ~inside)
        )
        self.blocks, self.coupling = within, across
        self.diagonal = within.diagonal()
        # One step of the substitution per level: first row, first row of a larger block, end.
        by_row, large = level[label], size[label] > 1
        ends = np.append(np.flatnonzero(np.diff(by_row)) + 1, len(label))
        self.levels = [
            (a, a + int(np.count_nonzero(~large[a:b])), int(b)) for a, b in zip([0, *ends[:-1]], ends, strict=True)
        ]
        self.least = np.minimum.reduceat(self.diagonal, self.offsets)
        self._perron(singular)
        self.log_perron = np.empty(len(label))
        self.log_perron[self.order] = self._log_r

    def _perron(self, singular: bool) -> None:
        """Find the Perron vectors of all blocks together, by Noda's iteration.

        ``(A - t I) y = r`` with ``t`` just below ``min (A r)_i / r_i``, which rises to ``lambda_min``: it converges
        quadratically from any ``r > 0``. In the scaled unknown ``y / r`` no entry under- or overflows.
        """
        offsets, part = self.offsets, self.part
        self._log_r = np.zeros(len(part))
        self.low, self.high = self._bounds(self._log_r)
        unit, distance = np.maximum.reduceat(self.diagonal, offsets), 1e-14
        active = np.diff(offsets, append=len(part)) > 1
        for _ in range(200):
            rows = np.flatnonzero(active[part])
            if rows.size == 0:
                break
            gap = self.high - self.low
            t = self.low - np.maximum(1e-3 * gap, distance * unit)
            if not singular:
                t = np.maximum(t, 0.0)
            try:
                z = self._solve(rows, self._log_r[rows], t[part[rows]])
            except RuntimeError:  # exactly singular
                distance *= 100
                if distance > 1e-6:
                    break
                continue
            log_r = self._log_r.copy()
            with np.errstate(invalid="ignore", divide="ignore"):
                log_r[rows] += np.log(z)
            good = active & np.logical_and.reduceat(np.isfinite(log_r), offsets)
            log_r = np.where(good[part], log_r, self._log_r)
            log_r -= np.maximum.reduceat(log_r, offsets)[part]
            low, high = self._bounds(log_r)
            better = good & (high - low < gap)
            self._log_r = np.where(better[part], log_r, self._log_r)
            self.low, self.high = np.where(better, low, self.low), np.where(better, high, self.high)
            active = better & ((high - low < gap / 2) | (high - low > 1e-9 * unit))

    def _solve(self, rows: np.ndarray, log_r: np.ndarray, t: np.ndarray) -> np.ndarray:
        """Solve ``(R^-1 A R - t I) z = 1`` on whole blocks."""
        B = _similar(self.blocks[rows][:, rows], log_r)
        return diagonal_factor(B - sparse.diags_array(t)).solve(np.ones(len(rows)))

    def _bounds(self, log_r: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        ratio, error = _ratios(self.blocks, log_r)
        high = np.minimum(np.maximum.reduceat(ratio + error, self.offsets), self.least)
        return np.minimum.reduceat(ratio - error, self.offsets), high

    def smallest(self) -> float:
        """Return a positive lower bound of ``lambda_min``, or refuse the matrix."""
        k = int(self.low.argmin())
        if not self.low[k] > 0:
            row = int(self.order[self.offsets[k]])
            raise NotAnMMatrix(
                f"the smallest eigenvalue of the strong component of row {row} was not confirmed to be positive"
            )
        return float(self.low[k])

    def log_witness(self, t: float) -> np.ndarray:
        """Return ``log u`` with ``A u >= t u``, by substitution from block to block; Perron vectors if uncoupled."""
        if len(self.levels) == 1:
            return self.log_perron
        log_u = np.empty(len(self.order))
        across = self.coupling
        with np.errstate(divide="ignore"):
            log_entries = np.log(-across.data)
            for a, m, b in self.levels:
                log_c = np.full(b - a, -np.inf)  # what the earlier blocks contribute
                heads = across.indptr[a : b + 1]
                if (filled := np.flatnonzero(np.diff(heads))).size:
                    here = slice(heads[0], heads[-1])
                    terms = log_entries[here] + log_u[across.indices[here]]
                    log_c[filled] = np.logaddexp.reduceat(terms, heads[filled] - heads[0])
                log_u[a:m] = np.maximum(0.0, log_c[: m - a] - np.log(self.diagonal[a:m] - t))
                if m < b:
                    for k in range(self.part[m], self.part[b - 1] + 1):
                        first = self.offsets[k]
                        last = self.offsets[k + 1] if k + 1 < len(self.offsets) else len(log_u)
                        log_u[first:last] = self._block_witness(k, slice(first, last), t, log_c[first - a : last - a])
        result = np.empty_like(log_u)
        result[self.order] = log_u
        return result

    def _block_witness(self, k: int, rows: slice, t: float, log_c: np.ndarray) -> np.ndarray:
        """Return ``log u`` of one block with ``(A - t I) u >= c``: as flat as a solution can be, largest entry >= 1.

        ``u = (A - t I)^-1 max(s d, c)``, ``d`` the diagonal and ``s`` such that ``(A - t I)^-1 s d <= 1``; a multiple
        of the Perron vector if float64 fails.
        """
        diagonal = self.diagonal[rows] - t
        try:
            factor = diagonal_factor(self.blocks[rows, rows] - sparse.diags_array(np.full(len(log_c), t)))
            flat = factor.solve(diagonal)
            if (flat > 0).all():
                log_w = np.maximum(np.log(diagonal) - np.log(flat.max()), log_c)
                u = factor.solve(np.exp(log_w - log_w.max()))
                if (u > 0).all() and np.isfinite(u).all():
                    return np.log(u) + log_w.max()
        except RuntimeError:  # exactly singular
            pass
        log_r = self._log_r[rows]
        return log_r + max(0.0, float((log_c - log_r).max()) - math.log(self.low[k] - t))


def _ratios(A: sparse.csr_array, log_u: np.ndarray, blur: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Return ``(A u)_i / u_i`` of a Z-matrix and a bound of its rounding; ``blur`` units more for that of ``log u``."""
    entries = sparse.coo_array(A)
    diagonal, away = A.diagonal(), entries.row != entries.col
    rows, columns = entries.row[away], entries.col[away]
    n = len(log_u)
    apart = log_u[columns] - log_u[rows]
    with np.errstate(over="ignore", invalid="ignore"):
        terms = -entries.data[away] * np.exp(apart)
        total, moment = np.bincount(rows, terms, n), np.bincount(rows, terms * np.abs(apart), n)
        size = np.abs(diagonal) + total
        return diagonal - total, EPS * ((np.bincount(rows, minlength=n) + 4 + blur) * size + moment)


def _from_witness(A: sparse.csr_array, log_u: np.ndarray, log_v: np.ndarray, upper: float) -> DiagonalCertificate:
    """Return the certificate ``Omega = diag(v / u)`` of an M-matrix with the rate ``b``, rounded down."""
    log_omega = log_v - log_u
    log_omega -= log_omega.max()
    blur = 4 * float(np.ptp(log_u) + np.ptp(log_v))  # that of the subtraction above, too
    (ratio_u, error_u), (ratio_v, error_v) = _ratios(A, log_u, blur), _ratios(sparse.csr_array(A.T), log_v, blur)
    rate = float((ratio_u + ratio_v - error_u - error_v).min())
    return DiagonalCertificate(log_omega, rate, upper, (log_u, log_v))


def _shrink(A: sparse.csr_array, certificate: DiagonalCertificate, limit: float) -> DiagonalCertificate:
    """Take the witness to the power at which ``log(cond(Omega)) <= limit``."""
    if certificate.log_condition <= limit or certificate.witness is None:
        return certificate
    power = limit / certificate.log_condition * (1 - 1e-12)
    log_u, log_v = certificate.witness
    return _from_witness(A, power * log_u, power * log_v, certificate.upper)


def _tighten(A: sparse.csr_array, certificate: DiagonalCertificate) -> DiagonalCertificate:
    """Replace the witness by the best one of the same ``Omega``: ``b`` is then its tight rate.

    That is ``Omega^-1/2 y``, ``Omega^1/2 y`` with the Perron vectors ``y`` of the symmetric Z-matrix ``B + B'``.
    """
    if A.shape[0] > DENSE_ROWS:
        return certificate
    B = _similar(A, -certificate.log_omega / 2)
    log_y = _Components(sparse.csr_array(B + B.T), singular=True).log_perron
    half = certificate.log_omega / 2
    return max(certificate, _from_witness(A, log_y - half, log_y + half, certificate.upper), key=lambda one: one.rate)


def _tight_rate(A: sparse.csr_array, log_omega: np.ndarray) -> float:
    """Return the smallest eigenvalue of ``B + B'``, ``B = Omega^1/2 A Omega^-1/2``, less the error of computing it.

    Above 1,500 rows by Lanczos: nothing excludes that a smaller eigenvalue was missed but that it seldom happens.
    """
    B = _similar(A, -log_omega / 2)
    if not np.isfinite(B.data).all():
        raise NoCertificate("the weights lie too far apart for floating point")
    S = sparse.csc_array(B + B.T)
    n = S.shape[0]
    if n <= DENSE_ROWS:
        values = np.linalg.eigvalsh(S.toarray())
        return float(values[0]) - n * EPS * float(np.abs(values).max())
    initial_vector = np.ones(n)
    try:
        _, x = eigsh(S, k=1, which="SA", v0=initial_vector, ncv=60, maxiter=500, tol=1e-9)
    except ArpackError:
        below = -1e-6 * float(S.diagonal().min())
        _, x = eigsh(S, k=1, sigma=below, v0=initial_vector)
    x = x[:, 0] / np.linalg.norm(x)
    value = float(x @ (S @ x))
    return value - float(np.linalg.norm(S @ x - value * x))


def _log_left_vector(M: sparse.csr_array) -> np.ndarray:
    """Return ``log v`` with ``v' M = 0``, ``v > 0``, of an irreducible Z-matrix with ``M 1 = 0``.

    Without subtractions up to 3,000 rows, hence to full relative accuracy in each entry; above by a sparse factor.
    """
    n = M.shape[0]
    if n > ELIMINATION_ROWS:
        v = np.append(diagonal_factor(sparse.csr_array(M.T)[:-1, :-1]).solve(-M[[n - 1]].toarray().ravel()[:-1]), 1.0)
        if not (np.isfinite(v).all() and (v > 0).all()):
            raise NoCertificate("no positive left null vector was found in float64")
        return np.log(v)
    rate = np.abs(M.toarray())
    rate /= rate.max()
    log_v = np.zeros(n)
    with np.errstate(all="ignore"):
        for k in range(n - 1, 0, -1):
            rate[:k, k] /= rate[k, :k].sum()
            rate[:k, :k] += np.outer(rate[:k, k], rate[k, :k])
        for k in range(1, n):
            log_v[k] = np.logaddexp.reduce(log_v[:k] + np.log(rate[:k, k]))
    if not np.isfinite(log_v).all():
        raise NoCertificate("the weights lie too far apart for floating point")
    return log_v


def _similar(A: sparse.csr_array, log_u: np.ndarray) -> sparse.csr_array:
    """Return ``diag(1 / u) A diag(u)``, each entry scaled at once."""
    entries = sparse.coo_array(A)
    with np.errstate(over="ignore"):
        size = np.exp(np.log(np.abs(entries.data)) + log_u[entries.col] - log_u[entries.row])
    return sparse.csr_array((np.sign(entries.data) * size, (entries.row, entries.col)), shape=A.shape)


def _check(A: sparse.csr_array, u: Any, product: str, name: str) -> np.ndarray | None:
    """Return ``log u`` of a given witness, or refuse it."""
    if u is None:
        return None
    u, n = np.asarray(u, dtype=float), A.shape[0]
    if u.shape != (n,):
        raise MatrixError(f"{name} has shape {u.shape}, not {(n,)}")
    if (low := np.flatnonzero(~((u > 0) & (u < np.inf)))).size:
        raise NotAnMMatrix(f"entry {low[0]} of {name} is {u[low[0]]:.6g}, not positive and finite")
    ratio, error = _ratios(sparse.csr_array(A), np.log(u))
    if (low := np.flatnonzero(~(ratio > error))).size:
        i = int(low[0])
        raise NotAnMMatrix(f"entry {i} of {product} is {ratio[i] * u[i]:.6g}, not confirmed to be positive")
    return np.log(u)


def _require_z_matrix(A: sparse.csr_array) -> None:
    entries = sparse.coo_array(A)
    if (high := np.flatnonzero((entries.row != entries.col) & (entries.data > 0))).size:
        i, j, value = entries.row[high[0]], entries.col[high[0]], entries.data[high[0]]
        raise NotAnMMatrix(f"entry ({i}, {j}) is {value:.6g}, positive off the diagonal")
    if (low := np.flatnonzero(A.diagonal() <= 0)).size:
        raise NotAnMMatrix(f"diagonal entry {low[0]} is {A.diagonal()[low[0]]:.6g}, not positive")


def _comparison(A: sparse.csr_array) -> sparse.csr_array:
    """Return the sparse comparison matrix of a matrix with positive diagonal, or refuse it."""
    diagonal = A.diagonal()
    if (low := np.flatnonzero(diagonal <= 0)).size:
        raise NotAnHMatrix(f"diagonal entry {low[0]} is {diagonal[low[0]]:.6g}, not positive")
    entries = sparse.coo_array(A)
    data = np.where(entries.row == entries.col, 1.0, -1.0) * np.abs(entries.data)
    return sparse.csr_array((data, (entries.row, entries.col)), shape=A.shape)
