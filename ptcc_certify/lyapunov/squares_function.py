"""Weighted sums of squares of stable families, in closed form: one sparse matrix for all weights of a mode.

With ``P = diag(p)``, ``x'(P L + L'P) x = sum |w_kl| 2 p_k x_k (x_k - sgn(w_kl) x_l)``, and
``2 x_k (x_k - sgn x_l) >= -x_l^2 / 2``. Hence, for all weights in their intervals,

    P L + L'P  >=  P L(w-) + L(w-)'P - (1/2) diag_l( sum_k p_k (w+_kl - w-_kl) ),

and a rate ``r`` of every signal is proved if the right side minus ``r P`` is positive definite in every mode. ``p`` is
taken from ``p'(M + t I) = t 1'`` with the comparison matrix ``M`` of the middles of all weights: for small ``t`` near
to the left null vector of what leads, with small weights of what follows; for larger ones nearer to equal weights.

Floats propose ``p``, the rate and a sparse factor; the exact matrix, in integers as the check forms it, and the kernel
decide.

References
----------
docs/theory/families.md, "Uncertain weights".
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from lmi.definiteness_proofs import prove_sparse_positive_definite
from lmi.dyadic import dyadic_array, round_array, round_to_bits
from lmi.exact import arithmetic
from lmi.exact.decimal_rounding import down
from lmi.exact.definite import SparseFactor
from lmi.search_time import checkpoint
from lmi.sparse_h_matrix import FILL_ROWS, fill_core, solve
from ptcc_certify.checker.family import Edge
from ptcc_certify.checker.weighted_squares import WeightedSquares
from ptcc_certify.graphs.family import Family, Mode
from ptcc_certify.graphs.rationals import nearest_float
from ptcc_certify.lyapunov.follower_rows import IntervalRows

#: Values of ``t`` over the largest in-weight, and losses of the rate that are tried.
_SHIFTS, _LOSSES = (1e-6, 1e-2, 0.03, 0.1, 0.3, 1.0), (1e-6, 1e-4, 1e-2, 0.1, 0.3)
#: Of the weights whose rate is at least this share of the largest, those of the least overshoot constant are taken.
_NEARLY = 0.98
#: What is taken off the diagonal for the rounding of the matrix, against the entries of its row.
_ROUNDING = 1e-14
#: Rows up to which eigenvalues are those of a dense matrix, and the least over the largest ``p``.
_DENSE, _SMALLEST_WEIGHT = 300, 1e-250


@dataclass(frozen=True, eq=False)
class SquaresFunction(WeightedSquares):
    """``V = sum_k p_k x_k^2 <= e^(-rate s) V(0)`` for every signal; proved.

    Attributes
    ----------
    factors : tuple of SparseFactor
        Of the form of each mode; empty of a function that was read from a file.
    power : int
        The factors are those of ``2^power`` times the form.
    """

    factors: tuple[SparseFactor, ...] = ()
    power: int = 0

    kind = "squares"
    optimal = False

    @property
    def overshoot(self) -> Fraction:
        """``max p / min p``, which multiplies the squared norm of the state."""
        return Fraction(max(self.weights.values()), min(self.weights.values()))

    @property
    def vector(self) -> np.ndarray:
        """``p`` in floats, which are exact."""
        return np.array([weight / self.scale for weight in self.weights.values()])


def squares_function(family: Family, notes: list[str] | None = None) -> SquaresFunction | None:
    """Search and prove a weighted sum of squares of a family that is stable under every signal.

    Parameters
    ----------
    family : Family
        Of any size whose sparse factor fills in at most 4,000 rows.
    notes : list of str, optional
        Is told why nothing was found.

    Returns
    -------
    SquaresFunction or None
        None if no positive rate was proved.

    Examples
    --------
    >>> ring = [("a", "b", 1.9, 2.1), ("b", "c", 1.9, 2.1), ("c", "a", -2.1, -1.9)]
    >>> round(float(squares_function(Family.from_intervals(ring)).rate), 3)
    1.8
    """
    from scipy import sparse

    n, (source, target, _) = family.n_nodes, family.union
    filled = fill_core(sparse.csr_array((np.ones(source.size), (target, source)), shape=(n, n)))
    if filled > FILL_ROWS:
        if notes is not None:
            notes.append(f"class squares: a sparse factor fills in {filled} rows, and {FILL_ROWS} are the most")
        return None
    top = max(mode.upper.fraction(int(np.argmax(mode.upper.table))) for mode in family.modes if mode.n_edges)
    shift = top.numerator.bit_length() - top.denominator.bit_length()
    tables = [FormTable.of(mode, shift) for mode in family.modes]
    tried: list[tuple[float, np.ndarray]] = []
    with np.errstate(all="ignore"):
        for p in _candidates(tables, n):
            checkpoint()
            tried.append((min(_smallest(_form(table, p), p) for table in tables), p))
        best = max((rate for rate, _ in tried), default=0.0)
        near = [one for one in tried if one[0] >= _NEARLY * best > 0]
        largest, weights = max(near, key=lambda one: one[1].min(), default=(0.0, np.ones(n)))
        for loss in _LOSSES if largest else ():
            checkpoint()
            if (function := prove_squares(tables, weights, round_to_bits(largest * (1 - loss), 40), shift)) is not None:
                return function
    if notes is not None:
        rate = down(Fraction(largest) * Fraction(2) ** shift)
        notes.append(f"class squares: the rate {rate} is not proved" if largest else "class squares: no rate")
    return None


@dataclass(frozen=True, eq=False)
class FormTable:
    """The edges of a mode: as the check takes them, with what divides their sizes, and in floats over ``2^shift``."""

    n: int
    edges: list[Edge]
    unit: int
    source: np.ndarray
    target: np.ndarray
    sign: np.ndarray
    low: np.ndarray
    high: np.ndarray

    @classmethod
    def of(cls, mode: Mode, shift: int = 0) -> FormTable:
        """Return the table of all edges of a mode."""
        n = len(mode.labels)
        rows = IntervalRows.of([mode], np.arange(n))
        times, unit = rows.unit.as_integer_ratio()
        lower, upper = ([times * x for x in sizes.tolist()] for sizes in (rows.lower, rows.upper))
        ends = rows.source.tolist(), rows.target.tolist(), rows.sign.tolist()
        step = Fraction(1, unit) / Fraction(2) ** shift
        low, high = (np.array([nearest_float(x * step) for x in sizes]) for sizes in (lower, upper))
        return cls(n, list(zip(*ends, lower, upper, strict=True)), unit, rows.source, rows.target, rows.sign, low, high)


def _form(table: FormTable, p: np.ndarray) -> Any:
    """Return the right side of the module, in floats."""
    from scipy import sparse

    s, t, n = table.source, table.target, table.n
    off = -table.sign * p[t] * table.low
    diagonal = 2 * p * np.bincount(t, table.low, n) - np.bincount(s, p[t] * (table.high - table.low), n) / 2
    half = sparse.csr_array((off, (t, s)), shape=(n, n))
    return sparse.csr_array(half + half.T + sparse.diags_array(diagonal))


def _candidates(tables: Sequence[FormTable], n: int) -> Iterator[np.ndarray]:
    from scipy import sparse

    total = sparse.csr_array((n, n))
    for table in tables:
        middle = (table.low + table.high) / (2 * len(tables))
        total = total - sparse.csr_array((middle, (table.target, table.source)), shape=(n, n))
    diagonal = -np.asarray(total.sum(axis=1)).ravel()
    M = sparse.csr_array(total + sparse.diags_array(diagonal))
    top = float(diagonal.max(initial=0))
    for shift in _SHIFTS:
        t = shift * top
        p = np.abs(solve(sparse.csr_array(M.T + t * sparse.eye_array(n)), np.ones(n), diagonal + t))
        if np.isfinite(p).all() and p.min() > _SMALLEST_WEIGHT * p.max():
            yield round_array(p / p.max())


def _smallest(S: Any, p: np.ndarray) -> float:
    """Return the least ``r`` with ``S x = r diag(p) x``, in floats."""
    from scipy import sparse
    from scipy.sparse.linalg import ArpackError, eigsh

    scale = sparse.diags_array(1 / np.sqrt(p))
    scaled = scale @ S @ scale
    if p.size <= _DENSE:
        return float(np.linalg.eigvalsh(scaled.toarray())[0])
    try:
        return float(eigsh(scaled, 1, which="SA", return_eigenvectors=False, tol=1e-8, maxiter=5000)[0])
    except ArpackError:
        return -np.inf


def prove_squares(tables: Sequence[FormTable], p: np.ndarray, rate: Fraction, shift: int = 0) -> SquaresFunction | None:
    """Prove a rate over ``2^shift`` of positive weights, by a factor of every mode; None if one fails.

    A factor is that of the matrix in floats, less what rounding may have changed.
    """
    from scipy import sparse

    whole, power = dyadic_array(p)
    up = max(power, 0)
    weights = dict(enumerate(int(x) << up for x in whole.tolist()))
    modes = [(table.edges, table.unit) for table in tables]
    V = SquaresFunction(weights, 1 << max(-power, 0), rate * Fraction(2) ** shift, modes, power=-shift)
    factors = []
    for number, table in enumerate(tables):
        checkpoint()
        S = _form(table, p)
        size = abs(S) + sparse.diags_array(np.bincount(table.target, 4 * p[table.target] * table.high, table.n))
        spare = _ROUNDING * (np.asarray(size.sum(axis=1)).ravel() + abs(float(rate)) * p)
        S = sparse.csc_array(S - sparse.diags_array(float(rate) * p + spare))
        factor = prove_sparse_positive_definite(sparse.csc_array((S + S.T) / 2))
        if factor is None:
            return None
        lower, over = V.form(number)
        if not arithmetic().residual_definite(table.n, lower, factor, V.power, over):
            return None
        factors.append(factor)
    return SquaresFunction(V.weights, V.scale, V.rate, modes, tuple(factors), V.power)
