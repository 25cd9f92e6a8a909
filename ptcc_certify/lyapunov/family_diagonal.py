"""Diagonal functions of large stable families, in closed form: one sparse matrix for all weights of a mode.

With ``P = diag(p)``, ``x'(P L + L'P) x = sum |w_kl| 2 p_k x_k (x_k - sgn(w_kl) x_l)``, and
``2 x_k (x_k - sgn x_l) >= -x_l^2 / 2``. Hence, for all weights in their intervals,

    P L + L'P  >=  P L(w-) + L(w-)'P - (1/2) diag_l( sum_k p_k (w+_kl - w-_kl) ),

and a rate ``r`` of every signal is proved if the right side minus ``r P`` is positive definite in every mode. ``p`` is
taken from ``p'(M + t I) = t 1'`` with the comparison matrix ``M`` of the middles of all weights: for small ``t`` near
to the left null vector of what leads, with small weights of what follows.

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

from lmi.dyadic import dyadic_array, round_to_bits
from lmi.sparse_definiteness_proofs import SparseDefinitenessProof, prove_sparse_positive_definite
from lmi.sparse_h_matrix import FILL_ROWS, fill_core, solve
from ptcc_certify.graphs.family import Family, Mode
from ptcc_certify.graphs.rationals import nearest_float
from ptcc_certify.lyapunov.dominance import round_array
from ptcc_certify.lyapunov.interval_rows import IntervalRows

#: Values of ``t`` over the largest in-weight, and losses of the rate that are tried.
_SHIFTS, _LOSSES = (1e-6, 1e-3, 1e-2, 0.1, 1.0), (1e-6, 1e-4, 1e-2, 0.1, 0.3)
#: What is taken off the diagonal for the rounding of the matrix, against the entries of its row.
_ROUNDING = 1e-14
#: Rows up to which eigenvalues are those of a dense matrix.
_DENSE = 300


@dataclass(frozen=True, eq=False)
class DiagonalDecay:
    """``x' diag(p) x`` decays with ``e^(-rate s)`` for every signal; proved.

    Attributes
    ----------
    weights : (N,) float array
        ``p``: the dyadic numbers that these are.
    rate : Fraction
    proofs : tuple of SparseDefinitenessProof
        One of each mode.
    """

    weights: np.ndarray
    rate: Fraction
    proofs: tuple[SparseDefinitenessProof, ...]


def diagonal_decay(family: Family) -> DiagonalDecay | None:
    """Search and prove a diagonal function of a family that is stable under every signal.

    Parameters
    ----------
    family : Family
        Of any size whose sparse factor fills in at most 4,000 rows.

    Returns
    -------
    DiagonalDecay or None
        None if no positive rate was proved.

    Examples
    --------
    >>> ring = [("a", "b", 1.9, 2.1), ("b", "c", 1.9, 2.1), ("c", "a", -2.1, -1.9)]
    >>> round(float(diagonal_decay(Family.from_intervals(ring)).rate), 3)
    1.8
    """
    n = family.n_nodes
    tables = [FormTable.of(mode) for mode in family.modes]
    if fill_core(sum(abs(_form(table, np.ones(n))) for table in tables)) > FILL_ROWS:
        return None
    largest, weights = 0.0, np.ones(n)
    with np.errstate(all="ignore"):
        for p in _candidates(family):
            guess = min(_smallest(_form(table, p), p) for table in tables)
            if guess > largest:
                largest, weights = guess, p
    for loss in _LOSSES if largest else ():
        rate = round_to_bits(largest * (1 - loss), 40)
        proofs = [prove_form(table, weights, rate) for table in tables]
        if all(proof is not None for proof in proofs):
            return DiagonalDecay(weights, rate, tuple(proof for proof in proofs if proof is not None))
    return None


@dataclass(frozen=True, eq=False)
class FormTable:
    """The edges of a mode: ends, signs, sizes in integers over a unit, and in floats."""

    n: int
    source: np.ndarray
    target: np.ndarray
    sign: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    unit: Fraction

    @classmethod
    def of(cls, mode: Mode) -> FormTable:
        """Return the table of all edges of a mode."""
        n = len(mode.labels)
        rows = IntervalRows.of([mode], np.arange(n))
        return cls(n, rows.source, rows.target, rows.sign.astype(np.int64), rows.lower, rows.upper, rows.unit)

    @property
    def floats(self) -> tuple[np.ndarray, np.ndarray]:
        """The sizes, each rounded."""
        unit = nearest_float(self.unit)
        return self.lower.astype(float) * unit, self.upper.astype(float) * unit


def _form(table: FormTable, p: np.ndarray) -> Any:
    """Return the right side of the module, in floats."""
    from scipy import sparse

    low, high = table.floats
    s, t, n = table.source, table.target, table.n
    off = -table.sign * p[t] * low
    diagonal = 2 * p * np.bincount(t, low, n) - np.bincount(s, p[t] * (high - low), n) / 2
    half = sparse.csr_array((off, (t, s)), shape=(n, n))
    return sparse.csr_array(half + half.T + sparse.diags_array(diagonal))


def _candidates(family: Family) -> Iterator[np.ndarray]:
    from scipy import sparse

    n = family.n_nodes
    total = sparse.csr_array((n, n))
    for mode in family.modes:
        middle = (mode.lower.as_float() + mode.upper.as_float()) / (2 * len(family.modes))
        total = total - sparse.csr_array((middle, (mode.target, mode.source)), shape=(n, n))
    diagonal = -np.asarray(total.sum(axis=1)).ravel()
    M = sparse.csr_array(total + sparse.diags_array(diagonal))
    top = float(diagonal.max(initial=0))
    for shift in _SHIFTS:
        t = shift * top
        p = np.abs(solve(sparse.csr_array(M.T + t * sparse.eye_array(n)), np.ones(n), diagonal + t))
        if np.isfinite(p).all() and (p > 0).all():
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


# ---------------------------------------------------------------------- proof


def prove_form(table: FormTable, p: np.ndarray, rate: Fraction) -> SparseDefinitenessProof | None:
    """Prove that the right side of the module, minus ``rate diag(p)``, is positive definite; None if that fails.

    The matrix in floats, less what rounding may have changed, is proved; then the exact one minus that matrix is
    dominated by its diagonal.
    """
    from scipy import sparse

    S = _form(table, p)
    size = abs(S) + sparse.diags_array(np.bincount(table.target, 4 * p[table.target] * table.floats[1], table.n))
    spare = _ROUNDING * (np.asarray(size.sum(axis=1)).ravel() + abs(float(rate)) * p)
    S = sparse.csc_array(S - sparse.diags_array(float(rate) * p + spare))
    S = sparse.csc_array((S + S.T) / 2)
    if not _above(table, p, rate, sparse.coo_array(S)):
        return None
    return prove_sparse_positive_definite(S)


def _above(table: FormTable, p: np.ndarray, rate: Fraction, S: Any) -> bool:
    """Tell whether the exact matrix minus ``S`` is dominated by its diagonal, which is not negative; in integers."""
    n = table.n
    (weights, power), (entries, other) = dyadic_array(p), dyadic_array(S.data)
    w, s, t = weights.astype(object), table.source, table.target
    low, high = table.lower.astype(object), table.upper.astype(object)
    # The exact one, times 2 d / (unit 2^power), d the denominator of rate / unit.
    r, d = (2 * rate / table.unit).as_integer_ratio()
    off = -2 * d * table.sign.astype(object) * w[t] * low
    keys = [t * n + s, s * n + t, t * n + t, s * n + s, np.arange(n) * (n + 1), S.row.astype(np.int64) * n + S.col]
    factor = Fraction(2) ** (other - power) * 2 * d / table.unit
    whole = factor.denominator
    values: Sequence[np.ndarray] = [
        off * whole,
        off * whole,
        4 * d * w[t] * low * whole,
        -d * w[t] * (high - low) * whole,
        -r * w * whole,
        -factor.numerator * entries.astype(object),
    ]
    key, inverse = np.unique(np.concatenate(keys), return_inverse=True)
    total = np.zeros(key.size, dtype=object)
    np.add.at(total, inverse, np.concatenate(values))
    i, j = key // n, key % n
    margin = np.zeros(n, dtype=object)
    np.add.at(margin, i, np.where(i == j, total, -np.abs(total)))
    return bool((margin >= 0).all())
