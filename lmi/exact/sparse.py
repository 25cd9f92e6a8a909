"""Checks of witnesses of definiteness in integers: the standard library, and NumPy where it is asked for.

Nothing of this package is imported, no solver and no SciPy: what
:mod:`lmi.exact.proofs` proves is judged here by other code.
All numbers are integers, a matrix is one of integers over a common scale. Every function answers True, proved, or
False, not proved; a witness that is malformed proves nothing.

Floats occur in two places only: to find the factor of :func:`dense_definite`, which is then judged exactly, and in
products of matrices of small integers, whose sums are below ``2^53`` and therefore exact.
"""

from __future__ import annotations

import operator
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from itertools import pairwise
from typing import Any

#: Sums of integers up to these sizes are exact in float64 and in int64.
FLOAT_SAFE, INT64_SAFE = 2**53, 2**62
#: Bits of a slice of :func:`dense_definite`: three of them fit in an int64.
SLICE = 20
#: Exponents beyond this are refused, lest a witness fill the memory.
LARGEST_SHIFT = 2**16
#: Bits that the entries may be shifted by, or multiplied by, in all.
LARGEST_BITS = 400_000_000
#: Pairs of entries of a column of the factor that are multiplied: in all, and kept at a time by the standard library.
LARGEST_PAIRS, LARGEST_KEPT = 200_000_000, 2_000_000
#: NumPy: longest column that is multiplied pair by pair, and entries of the largest dense block at the end.
LONGEST_COLUMN, LARGEST_BLOCK = 4000, 2_000_000
#: Pairs of entries multiplied at a time.
CHUNK = 2_000_000


# ---------------------------------------------------------------------- dominance


def dominates(n: int, edges: Any, diagonal: Any, u: Any, v: Any, rate: Any, *, numpy: bool | None = None) -> bool:
    """Check that two positive vectors prove a rate for a matrix, in integers.

    ``A`` has ``diagonal`` and, for each edge, its weight at (target, source). With ``M`` the comparison matrix,
    ``-|A_ij|`` off the diagonal, True means ``u, v, diagonal > 0`` and

        v_i (M u)_i + u_i (M' v)_i >= rate u_i v_i    for all i,

    hence ``Omega A + A' Omega >= rate Omega`` with ``Omega = diag(v / u)``: the symmetric Z-matrix
    ``Omega M + M' Omega - rate Omega`` takes ``u > 0`` to a nonnegative vector, and bounds the one of ``A`` from below.

    Parameters
    ----------
    n : int
    edges : (sources, targets, weights)
        Three sequences of ints; nodes are 0 to n - 1. The sizes of repeated edges
        add up, and a loop counts against its node: what is proved holds for their sum as well.
    diagonal, u, v : n ints
    rate : Fraction or int
        In units of the weights.
    numpy : bool, optional
        Default: NumPy if the weights are an array, otherwise the standard library.

    Returns
    -------
    bool

    References
    ----------
    Berman and Plemmons, Nonnegative Matrices in the Mathematical Sciences, SIAM 1994, chapter 6.

    Examples
    --------
    >>> edges = [0, 1], [1, 0], [-1, 1]
    >>> dominates(2, edges, [2, 2], [1, 1], [1, 1], 2), dominates(2, edges, [2, 2], [1, 1], [1, 1], Fraction(201, 100))
    (True, False)
    """
    try:
        rate = Fraction(rate)
        columns = [*edges, diagonal, u, v]
    except (TypeError, ValueError, OverflowError):
        return False
    if len(columns) != 6:
        return False
    try:
        if hasattr(columns[2], "dtype") if numpy is None else numpy:
            return _dominates_numpy(n, columns, rate)
        return _dominates_plain(n, [x.tolist() if hasattr(x, "tolist") else list(x) for x in columns], rate)
    except TypeError:
        return False


def _dominates_plain(n: int, columns: list[list[int]], rate: Fraction) -> bool:
    sources, targets, weights, diagonal, u, v = columns
    if not all(set(map(type, column)) <= {int} for column in columns):
        return False
    if not len(sources) == len(targets) == len(weights) or not len(diagonal) == len(u) == len(v) == n:
        return False
    if n == 0:
        return not sources
    if min(u) <= 0 or min(v) <= 0 or min(diagonal) <= 0:
        return False
    if sources and (min(sources) < 0 or min(targets) < 0 or max(sources) >= n or max(targets) >= n):
        return False
    heard, hearing = [0] * n, [0] * n
    for source, target, weight in zip(sources, targets, map(abs, weights), strict=True):
        heard[target] += weight * u[source]
        hearing[source] += weight * v[target]
    p, q = rate.numerator, rate.denominator
    return all(
        q * (b * (d * a - inward) + a * (d * b - outward)) >= p * a * b
        for a, b, d, inward, outward in zip(u, v, diagonal, heard, hearing, strict=True)
    )


def _dominates_numpy(n: int, columns: list[Any], rate: Fraction) -> bool:
    import numpy as np

    if (arrays := _integer_arrays(columns)) is None:
        return False
    sources, targets, weights, diagonal, u, v = arrays
    if not len(sources) == len(targets) == len(weights) or not len(diagonal) == len(u) == len(v) == n:
        return False
    if n == 0 or not ((u > 0).all() and (v > 0).all() and (diagonal > 0).all()):
        return n == 0 and len(sources) == 0
    if len(sources) and (min(sources.min(), targets.min()) < 0 or max(sources.max(), targets.max()) >= n):
        return False
    sources, targets = sources.astype(np.int64), targets.astype(np.int64)
    heard = _weighted_sums(n, targets, sources, weights, u)
    hearing = _weighted_sums(n, sources, targets, weights, v)
    p, q = rate.numerator, rate.denominator
    # Everything below is at most this in size
    largest = _largest(u) * _largest(v) * _largest(diagonal) + _largest(u) * _largest(hearing)
    largest = 2 * q * (largest + _largest(v) * _largest(heard)) + abs(p) * _largest(u) * _largest(v)
    kind = np.int64 if largest < INT64_SAFE else object
    a, b, d, heard, hearing = (x.astype(kind) for x in (u, v, diagonal, heard, hearing))
    ab = a * b
    return bool((q * (2 * d * ab - b * heard - a * hearing) >= p * ab).all())


def _integer_arrays(columns: Iterable[Any]) -> list[Any] | None:
    """Return int64 arrays, or arrays of Python integers where those do not fit; None if there is anything else."""
    import numpy as np

    arrays = []
    for column in columns:
        x = column if isinstance(column, np.ndarray) else np.array(column, dtype=object)
        if x.ndim != 1:
            return None
        if x.dtype.kind in "iu" and x.dtype != np.uint64:
            x = x.astype(np.int64, copy=False)
        else:
            listed = x.tolist()
            if x.dtype.kind not in "Ou" or not set(map(type, listed)) <= {int}:
                return None
            small = all(-INT64_SAFE <= value <= INT64_SAFE for value in listed)
            x = np.array(listed, dtype=np.int64 if small else object)
        arrays.append(x)
    return arrays


def _largest(x: Any) -> int:
    return max(int(x.max()), -int(x.min())) if len(x) else 0


def _weighted_sums(n: int, to: Any, of: Any, weights: Any, x: Any) -> Any:
    """Return ``y`` with ``y[to] += |weights| x[of]``, in int64 if a bound from the data allows, or slice by slice."""
    import numpy as np

    degree = int(np.bincount(to, minlength=n).max()) if len(to) else 0
    if x.dtype == object or weights.dtype == object or -int(weights.min(initial=0)) > INT64_SAFE:
        total = np.zeros(n, dtype=object)
        np.add.at(total, to, np.abs(weights.astype(object)) * x.astype(object)[of])
        return total
    weights, each = np.abs(weights), x[of]
    room = INT64_SAFE // (max(degree, 1) * _largest(x))
    if _largest(weights) <= room:
        total = np.zeros(n, dtype=np.int64)
        np.add.at(total, to, weights * each)
        return total
    step = room.bit_length() - 1
    if step < 8:
        return _weighted_sums(n, to, of, weights.astype(object), x)
    total, power = np.zeros(n, dtype=object), 0
    while weights.any():
        sums = np.zeros(n, dtype=np.int64)
        np.add.at(sums, to, (weights & ((1 << step) - 1)) * each)
        total += sums.astype(object) << power
        weights, power = weights >> step, power + step
    return total


# ---------------------------------------------------------------------- sparse residual


def residual_definite(
    n: int,
    entries: Any,
    order: Any,
    factor: Any,
    exponents: Any,
    bits: int,
    *,
    power: int = 0,
    weights: Any = None,
    scale: int = 1,
    numpy: bool | None = None,
    fits: Callable[[float, float], bool] = operator.le,
) -> bool:
    """Check that a rounded sparse factor proves a symmetric matrix positive definite, in integers.

    With ``T_ij = 2^(exponents_i + exponents_j + power) S_ij`` and ``E = 2^(2 bits) T[order, order] - R R'``, formed
    exactly, True means ``E_ii d_i > sum_j |E_ij| d_j`` for all rows, ``d`` positive. Then ``E > 0``, ``R R' >= 0``, and
    ``S > 0``. Whether ``R`` is a good factor, and scaling and order good ones, decides only if it succeeds. For a
    rational ``S`` the entries are those of ``scale S``, and ``scale E`` is formed.

    Parameters
    ----------
    n : int
    entries : (rows, columns, values)
        The lower triangle of ``scale S`` in ints, ``row >= column``; repeated entries add up.
    order : n ints
        A permutation of 0 to n - 1.
    factor : (indptr, indices, data)
        ``R`` column by column, rows increasing from the diagonal on, in ints.
    exponents : n ints
    bits : int
    power : int
        For ``S`` over a scale: the exponents may be those of another multiple of it.
    weights : n ints, optional
        ``d`` in the order of elimination. Default: all 1.
    scale : int
        Positive.
    numpy : bool, optional
        Default: NumPy if the data of the factor are an array, otherwise the standard library.
    fits : callable
        Tells whether a size is within a limit.

    Returns
    -------
    bool

    References
    ----------
    Rump, Verification of positive definiteness, BIT 46 (2006).

    Examples
    --------
    >>> entries = [0, 1, 1], [0, 0, 1], [4, 2, 5]
    >>> residual_definite(2, entries, [0, 1], ([0, 2, 3], [0, 1, 1], [31, 16, 31]), [0, 0], 4)
    True
    >>> residual_definite(2, entries, [0, 1], ([0, 2, 3], [0, 1, 1], [31, 0, 31]), [0, 0], 4)
    False
    """
    try:
        columns = [*entries, order, *factor, exponents, [1] * n if weights is None else weights]
        if len(columns) != 9 or {type(bits), type(power), type(scale)} != {int} or scale <= 0:
            return False
        wanted = hasattr(columns[6], "dtype") if numpy is None else numpy
        columns = [x.tolist() if hasattr(x, "tolist") else list(x) for x in columns]
    except TypeError:
        return False
    if not all(set(map(type, column)) <= {int} for column in columns):
        return False
    rows, cols, values, order, indptr, indices, data, exponents, weights = columns
    if not len(rows) == len(cols) == len(values) or len(indices) != len(data):
        return False
    if sorted(order) != list(range(n)) or len(exponents) != n or len(weights) != n or min(weights, default=1) <= 0:
        return False
    if len(indptr) != n + 1 or indptr[0] != 0 or indptr[n] != len(indices) or any(b < a for a, b in pairwise(indptr)):
        return False
    if not all(n > row >= column >= 0 for row, column in zip(rows, cols, strict=True)):
        return False
    for k in range(n):
        part = indices[indptr[k] : indptr[k + 1]]
        if part and (part[0] < k or part[-1] >= n or any(b <= a for a, b in pairwise(part))):
            return False
    if n == 0:
        return True
    if max(abs(bits), abs(power), *map(abs, exponents)) > LARGEST_SHIFT:
        return False
    # scale 2^(2 bits + up) T in integers, the lower triangle in the order of elimination
    place = [0] * n
    for k, node in enumerate(order):
        place[node] = k
    shifts = [exponents[i] + exponents[j] + power + 2 * bits for i, j in zip(rows, cols, strict=True)]
    up = max(0, -min(shifts, default=0))
    if not fits((max(shifts, default=0) + up) * len(shifts), LARGEST_BITS):
        return False
    T: dict[tuple[int, int], int] = defaultdict(int)
    for i, j, value, shift in zip(rows, cols, values, shifts, strict=True):
        a, b = place[i], place[j]
        T[(a, b) if a >= b else (b, a)] += value << (shift + up)
    judge = _residual_numpy if wanted else _residual_plain
    return judge(n, T, (indptr, indices, data), scale << up, weights, fits)


Triangle = dict[tuple[int, int], int]
Factor = tuple[list[int], list[int], list[int]]
Fits = Callable[[float, float], bool]


def _residual_plain(n: int, T: Triangle, factor: Factor, times: int, d: Sequence[int], fits: Fits) -> bool:
    indptr, indices, data = factor
    pairs = sum((b - a + 1) * (b - a) // 2 for a, b in pairwise(indptr))
    if pairs > LARGEST_PAIRS:
        return False
    E: list[dict[int, int]] = [defaultdict(int) for _ in range(n)]
    kept = 0
    for k in range(n):
        part = list(zip(indices[indptr[k] : indptr[k + 1]], data[indptr[k] : indptr[k + 1]], strict=True))
        for number, (i, x) in enumerate(part, 1):
            row = E[i]
            kept -= len(row)
            for j, y in part[:number]:
                row[j] -= x * y
            kept += len(row)
            if not fits(kept, LARGEST_KEPT):
                return False
    if not fits(sum(map(len, E)) * times.bit_length(), LARGEST_BITS):
        return False
    if times != 1:
        E = [{j: value * times for j, value in row.items()} for row in E]
    for (i, j), value in T.items():
        E[i][j] = E[i].get(j, 0) + value
    spare = [0] * n
    for i, row in enumerate(E):
        for j, value in row.items():
            if i == j:
                spare[i] += value * d[i]
            else:
                spare[i] -= abs(value) * d[j]
                spare[j] -= abs(value) * d[i]
    return min(spare) > 0


def _residual_numpy(n: int, T: Triangle, factor: Factor, times: int, d: Sequence[int], fits: Fits) -> bool:
    """Check as :func:`_residual_plain`: leading columns pair by pair, trailing ones as a dense block of slices."""
    import numpy as np

    if max(map(abs, factor[2]), default=0) > INT64_SAFE:
        return _residual_plain(n, T, factor, times, d, fits)
    indptr, indices, data = (np.array(x, dtype=np.int64) for x in factor)
    counts = np.diff(indptr)
    left = n - np.arange(n + 1.0)
    before = np.concatenate([[0.0], np.cumsum(counts.astype(float) ** 2)])
    first = int(np.argmin(100 * before + 0.1 * left**3 + 500 * left**2))
    long = int(counts[:first].max(initial=0)) > LONGEST_COLUMN
    if long or before[first] > 2 * LARGEST_PAIRS or not fits((n - first) ** 2, LARGEST_BLOCK):
        return False
    width = min(21, (53 - max(n - first, 1).bit_length()) // 2 + 1)
    slices = max(-(-(int(np.abs(data).max(initial=0)).bit_length() + 1) // width), 1)

    corner = np.zeros((n - first, n - first), dtype=np.int64)
    start = indptr[first]
    corner[indices[start:] - first, np.repeat(np.arange(n - first), counts[first:])] = data[start:]
    squares = _slice_products(_slices_of(corner, width, slices))
    sums = _pair_products(n, first, indptr, indices, _slices_of(data, width, slices))
    if squares is None or sums is None:
        return _residual_plain(n, T, factor, times, d, fits)
    if not fits((len(sums[0]) + corner.size) * times.bit_length(), LARGEST_BITS):
        return False
    block = sum(square.astype(object) << (width * m) for m, square in enumerate(squares))
    keys, limbs = sums
    values = sum(limb.astype(object) << (width * m) for m, limb in enumerate(limbs))

    E = defaultdict(int, {key: -value * times for key, value in zip(keys.tolist(), values.tolist(), strict=True)})
    for (i, j), value in T.items():
        E[i * n + j] += value
    block = -block * times if block.size else block
    spare = [0] * n
    for key, value in E.items():
        i, j = divmod(key, n)
        if j >= first:
            block[i - first, j - first] += value
            if i != j:
                block[j - first, i - first] += value
        elif i == j:
            spare[i] += value * d[i]
        else:
            spare[i] -= abs(value) * d[j]
            spare[j] -= abs(value) * d[i]
    if block.size:
        weight = np.array(d[first:], dtype=object)
        diagonal = np.diag(block).copy()
        size = np.abs(block)
        np.fill_diagonal(size, 0)
        for k, (x, y) in enumerate(zip((diagonal * weight).tolist(), (size @ weight).tolist(), strict=True), first):
            spare[k] += x - y
    return min(spare) > 0


def _slices_of(whole: Any, width: int, slices: int) -> list[Any]:
    """Split int64 numbers into digits of at most ``2^(width - 1)``, the last takes the rest."""
    half = 1 << (width - 1)
    digits = []
    for _ in range(slices - 1):
        digit = ((whole + half) & ((1 << width) - 1)) - half
        digits.append(digit)
        whole = (whole - digit) >> width
    return [*digits, whole]


def _slice_products(digits: list[Any]) -> list[Any] | None:
    """Return ``sum_(a+b=m) D_a D_b'`` for all ``m``, by float64 products without rounding; None if they could round."""
    import numpy as np

    n, inner = digits[0].shape
    if inner * max(int(np.abs(digit).max(initial=0)) for digit in digits) ** 2 > FLOAT_SAFE:
        return None
    floats = [digit.astype(np.float64) for digit in digits]
    products = [np.zeros((n, n), dtype=np.int64) for _ in range(2 * len(digits) - 1)]
    for a, left in enumerate(floats):
        for b, right in enumerate(floats[: a + 1]):
            product = (left @ right.T).astype(np.int64)
            products[a + b] += product if a == b else product + product.T
    return products


def _pair_products(n: int, first: int, indptr: Any, indices: Any, digits: list[Any]) -> tuple[Any, list[Any]] | None:
    """Return the lower triangle of ``R R'`` from the columns before ``first``: keys ``i n + j`` and int64 limbs."""
    import numpy as np

    count = 2 * len(digits) - 1
    counts = np.diff(indptr)[:first]
    largest = max(int(np.abs(digit).max(initial=0)) for digit in digits)
    if len(digits) * first * largest**2 > INT64_SAFE or n > 2**31:
        return None
    keys, limbs = np.zeros(0, dtype=np.int64), [np.zeros(0, dtype=np.int64) for _ in range(count)]
    waiting: list[tuple[Any, list[Any]]] = []

    def gathered() -> tuple[Any, list[Any]]:
        every = np.concatenate([keys, *(key for key, _ in waiting)])
        distinct, inverse = np.unique(every, return_inverse=True)
        sums = []
        for m in range(count):
            total = np.zeros(len(distinct), dtype=np.int64)
            np.add.at(total, inverse, np.concatenate([limbs[m], *(part[m] for _, part in waiting)]))
            sums.append(total)
        return distinct, sums

    size = 0
    for c in np.unique(counts[counts > 0]).tolist():
        upper, lower = np.tril_indices(c)
        columns = np.flatnonzero(counts == c)
        per_chunk = max(CHUNK // len(upper), 1)
        for begin in range(0, len(columns), per_chunk):
            at = indptr[columns[begin : begin + per_chunk]][:, None] + np.arange(c)[None, :]
            rows = indices[at]
            part = [np.zeros(len(at) * len(upper), dtype=np.int64) for _ in range(count)]
            for a, x in enumerate(digits):
                for b, y in enumerate(digits):
                    part[a + b] += (x[at][:, upper] * y[at][:, lower]).ravel()
            waiting.append(((rows[:, upper] * n + rows[:, lower]).ravel(), part))
            size += len(part[0])
            if size > CHUNK:
                keys, limbs = gathered()
                waiting, size = [], 0
    return gathered()


# ---------------------------------------------------------------------- dense


def dense_definite(S: Sequence[Sequence[int]], *, numpy: bool = True) -> bool:
    """Prove a symmetric matrix of integers positive definite: float Cholesky, exact residual.

    Rows and columns are scaled by powers of two to diagonal entries of one size. ``R`` is the factor of the result
    less a multiple of the identity, rounded to integers. ``S - R R'``, formed exactly, must be strictly diagonally
    dominant with a positive diagonal. ``R R'`` is added from products of slices of 20 bits, whose sums of ``n`` stay
    below ``2^53``.

    Parameters
    ----------
    S : n lists of n ints
    numpy : bool
        False: fraction-free elimination by the standard library, which always decides; for small matrices.

    Returns
    -------
    bool
        True: positive definite. False: not proved; from the elimination: it is not.

    References
    ----------
    Rump, Verification of positive definiteness, BIT 46 (2006).
    Bareiss, Sylvester's identity and multistep integer-preserving Gaussian elimination, Math. Comp. 22 (1968).

    Examples
    --------
    >>> dense_definite([[2, 1], [1, 1]]), dense_definite([[1, 1], [1, 1]]), dense_definite([[2, 1], [0, 2]])
    (True, False, False)
    """
    n = len(S)
    if any(len(row) != n or not set(map(type, row)) <= {int} for row in S):
        return False
    if any(list(row) != list(column) for row, column in zip(S, zip(*S, strict=True), strict=True)):
        return False
    if any(S[i][i] <= 0 for i in range(n)):
        return False
    if n == 0 or not numpy:
        return _eliminates([list(row) for row in S])
    return _dense_residual(S)


def _eliminates(rows: list[list[int]]) -> bool:
    """Tell whether all leading principal minors are positive."""
    previous = 1
    for k, pivot_row in enumerate(rows):
        pivot = pivot_row[k]
        if pivot <= 0:
            return False
        for row in rows[k + 1 :]:
            head = row[k]
            row[k:] = [(x * pivot - head * y) // previous for x, y in zip(row[k:], pivot_row[k:], strict=True)]
        previous = pivot
    return True


def _dense_square(R: Any) -> Any:
    """Return ``R R'`` of int64 entries in integers; None unless every product, sum and shift is exact.

    Rows of the factor of a matrix scaled to a unit diagonal have norms of about ``2^57``, and 16 times that is room
    enough; a row beyond it would wrap around in the last shift, and prove what is not true.
    """
    products = _slice_products(_slices_of(R, SLICE, 3))
    if products is None:
        return None
    # Carried, three limbs in [0, 2^SLICE) make one int64, and so do the two above them, if the last is short
    for m in range(4):
        carry = products[m] >> SLICE
        products[m] -= carry << SLICE
        products[m + 1] += carry
    if max(-int(products[4].min()), int(products[4].max())) > INT64_SAFE >> SLICE:
        return None
    low = products[0] + (products[1] << SLICE) + (products[2] << 2 * SLICE)
    high = products[3] + (products[4] << SLICE)
    return (high.astype(object) << 3 * SLICE) + low.astype(object)


def _dense_residual(S: Sequence[Sequence[int]]) -> bool:
    import numpy as np

    n = len(S)
    length = max(S[i][i].bit_length() for i in range(n))
    up = np.array([(length - S[i][i].bit_length()) // 2 for i in range(n)])
    T = np.empty((n, n), dtype=object)
    T[:] = S
    if up.any():
        T = T << (up[:, None] + up[None, :]).astype(object)
    # The diagonal is in [2^(length-2), 2^length): unit in [1/4, 1), off the diagonal below 1 if S > 0
    cut = length - 60
    try:
        unit = (T >> cut if cut > 0 else T << -cut).astype(np.int64).astype(np.float64) * 2.0**-60
    except OverflowError:
        return False
    bits = 3 * SLICE - 3
    spare = 2 * bits - length
    if spare > 0:
        T = T << spare
    shift = 2 * n * 2.0**-52
    for _ in range(3):
        try:
            R = np.linalg.cholesky(unit - shift * np.eye(n))
        except np.linalg.LinAlgError:
            return False
        whole = np.rint(np.ldexp(R, bits))
        if not np.abs(whole).max() <= INT64_SAFE or (square := _dense_square(whole.astype(np.int64))) is None:
            return False
        E = T - (square << -spare if spare < 0 else square)
        diagonal = np.diag(E).copy()
        short = (np.abs(E).sum(axis=1) - np.abs(diagonal) - diagonal).tolist()
        if max(short) < 0:
            return True
        missing = Fraction(max(short), 1 << max(length, 2 * bits))
        if missing > 1:
            return False
        shift += 1.25 * float(missing)
    return False
