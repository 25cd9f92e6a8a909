"""Programs that find a Lyapunov matrix of given rates, or of large ones: built by cvxpy, solved by Clarabel.

Every mode has the inequality of :mod:`lmi.common_lyapunov`. Its numbers are parameters of small programs, which are
built once for all of the same shape; where matrices are large their zeros count, and programs are built each time.
"""

from __future__ import annotations

import math
import threading
import warnings
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from lmi.diagonal import run_solver
from lmi.errors import NoCertificate
from lmi.search_time import checkpoint, seconds_left, uncounted
from lmi.uncertain_matrix import UncertainMatrix

#: Rows up to which Clarabel takes a matrix as it is; with a diagonal ``P`` those of sparse matrices have zeros.
_WHOLE_ROWS = {False: 60, True: 24}
#: Seconds that a program takes for each block: what multiplies a power of its rows, by what ``P`` is.
_SECONDS = {"full": (1.8e-7, 4), "diagonal": (2e-3, 1), "fixed": (0.02, 1)}
#: Rows up to which programs are built once, and of how many modes; how many of them are kept.
_ONCE_ROWS, _ONCE_MODES, _KEPT = 20, 8, 64

#: What multiplies the variables in the inequality of a mode: two or four numbers and arrays.
Row = tuple[Any, ...]


def program_seconds(modes: Sequence[UncertainMatrix], shape: str) -> float:
    """Return about how long a program with an inequality for each mode takes, from sizes alone.

    Examples
    --------
    >>> one = UncertainMatrix.known(np.eye(24))
    >>> program_seconds([one], "diagonal") < program_seconds([one], "full") < program_seconds([one, one], "full") < 1
    True
    """
    factor, power = _SECONDS[shape]
    return sum(factor * float(len(mode.A) + mode.radii.size) ** power for mode in modes)


def rows_of(modes: Sequence[UncertainMatrix], rates: Sequence[float], unit: float | None = None) -> list[Row]:
    """Return the numbers of the inequalities of modes over a unit, each its own largest entry where none is given.

    Parameters
    ----------
    modes : sequence of UncertainMatrix
        In coordinates of radii 1.
    rates : sequence of float
        ``b`` of each.
    unit : float, optional

    Examples
    --------
    >>> A, b = rows_of([UncertainMatrix.known(4 * np.eye(2))], [1.0])[0]
    >>> A.tolist(), float(b)
    ([[1.0, 0.0], [0.0, 1.0]], 0.25)
    """
    rows: list[Row] = []
    for mode, b in zip(modes, rates, strict=True):
        over = unit or float(np.abs(mode.A).max(initial=0.0)) or 1.0
        H, F = mode.H / math.sqrt(over), mode.F / math.sqrt(over)
        with np.errstate(over="ignore"):  # then the solver refuses them
            squares = (H[:, None] * H[None]).reshape(len(H) ** 2, H.shape[1])  # columns are those of matrices h h'
        rows.append((mode.A / over, np.array(b / over), *((F, squares) if mode.radii.size else ())))
    return rows


def inequality(P: Any, row: Row, tau: Any, t: Any) -> Any:
    """Return the matrix of the inequality of a mode, minus ``t I``."""
    import cvxpy as cp

    A, b, *spread = row
    product = P @ A
    form = product + product.T - b * P - t * np.eye(A.shape[0])
    if not spread:
        return form
    F, squares = spread
    coupling = P @ F
    taken = cp.reshape(squares @ tau, A.shape, order="F")
    return cp.bmat([[form - taken, coupling], [coupling.T, cp.diag(tau)]])


def multipliers(row: Row) -> Any:
    """Return the variables ``tau`` of a mode; None of one without uncertainty."""
    import cvxpy as cp

    return cp.Variable(row[2].shape[1]) if len(row) > 2 else None


def solved(
    goal: str, diagonal: bool, numbers: Sequence[np.ndarray], rows: Sequence[Row], tolerance: float
) -> tuple[np.ndarray, list[np.ndarray]]:
    """Solve a program; return ``P``, and ``tau`` of every mode.

    Parameters
    ----------
    goal : {"rates", "condition", "trace", "multipliers"}
        Maximise the sum of rises of the rates by shares, for ``least <= P <= I``, the numbers being ``least`` and the
        shares, one number where one rise is of all modes; minimise the condition of ``P >= I``; minimise the trace of
        a number times ``P >= I``; maximise the rise with ``P = I``.
    diagonal : bool
    numbers : sequence of array
    rows : sequence of Row
    tolerance : float
        Relative gap asked of the solver.

    Raises
    ------
    NoCertificate
        The solver found nothing.
    OutOfTime
        The time limit is reached.

    Examples
    --------
    >>> P, _ = solved("condition", False, [], rows_of([UncertainMatrix.known([[1.0, 9.0], [0.0, 2.0]])], [0.0]), 1e-7)
    >>> np.linalg.eigvalsh(P).round(3)
    array([1.   , 9.596])
    """
    with uncounted():
        import cvxpy  # noqa: F401
        from scipy import sparse
    checkpoint()
    size = len(rows[0][0]) + max(row[2].shape[1] if len(row) > 2 else 0 for row in rows)
    if size <= _ONCE_ROWS and len(rows) <= _ONCE_MODES:
        shapes = tuple(x.shape for x in numbers), tuple(tuple(x.shape for x in row) for row in rows)
        problem, variables, parameters = _built_once(goal, diagonal, *shapes, threading.get_ident())
        for parameter, value in zip(parameters, [*numbers, *(x for row in rows for x in row)], strict=True):
            parameter.value = value
        for variable in problem.variables():
            variable.save_value(None)  # of the last time
    else:
        sparse_rows = [tuple(sparse.csr_array(x) if x.ndim else x for x in row) for row in rows]  # zeros are kept
        problem, variables = _program(goal, diagonal, numbers, sparse_rows)
    run_program(problem, size, tolerance, diagonal)
    values = [np.zeros(0) if x is None else x.value for x in variables]
    if any(x is None or not np.isfinite(x).all() for x in values):
        raise NoCertificate(f"the solver answered {problem.status}")
    p, *taus = values
    return np.diag(p) if p.ndim == 1 else (p + p.T) / 2, taus


@lru_cache(maxsize=_KEPT)
def _built_once(
    goal: str, diagonal: bool, numbers: tuple[Any, ...], rows: tuple[tuple[Any, ...], ...], _thread: int
) -> tuple[Any, list[Any], list[Any]]:
    """Return a program with parameters of given shapes, for one thread."""
    import cvxpy as cp

    given = [cp.Parameter(shape) for shape in numbers]
    of_rows = [tuple(cp.Parameter(shape) for shape in row) for row in rows]
    problem, variables = _program(goal, diagonal, given, of_rows)
    return problem, variables, [*given, *(x for row in of_rows for x in row)]


def _program(goal: str, diagonal: bool, numbers: Sequence[Any], rows: Sequence[Row]) -> tuple[Any, list[Any]]:
    """Return the program of :func:`solved`, and its variables: ``P``, or its diagonal, and ``tau`` of every mode."""
    import cvxpy as cp

    one = np.eye(rows[0][0].shape[0])
    p = cp.Variable(len(one)) if diagonal else cp.Variable(one.shape, symmetric=True)
    P = cp.diag(p) if diagonal else p
    rises, taus = [0.0] * len(rows), [multipliers(row) for row in rows]
    above = [p >= 1] if diagonal else [P >> one]
    if goal == "rates":
        least, shares = numbers
        t = cp.Variable(shares.shape[0])
        rises = [t[min(i, shares.shape[0] - 1)] for i in range(len(rows))]
        objective: Any = cp.Maximize(shares @ t)
        constraints = [p >= least, p <= 1] if diagonal else [P >> least * one, P << one]
    elif goal == "condition":
        top = cp.Variable()
        objective, constraints = cp.Minimize(top), [*above, p <= top if diagonal else P << top * one]
    elif goal == "trace":
        objective, constraints = cp.Minimize(cp.sum(cp.multiply(numbers[0], P))), above
    else:
        rise, p = cp.Variable(), cp.Constant(one)
        P, rises, objective, constraints = p, [rise] * len(rows), cp.Maximize(rise), []
    constraints += [inequality(P, *of_one) >> 0 for of_one in zip(rows, taus, rises, strict=True)]
    return cp.Problem(objective, constraints), [p, *taus]


def run_program(problem: Any, rows: int, tolerance: float, diagonal: bool = False) -> None:
    """Solve a program of blocks of so many rows at most; whether it was solved is asked by the caller."""
    options: dict[str, Any] = {"tol_gap_abs": tolerance * 1e-2, "tol_gap_rel": tolerance, "tol_feas": tolerance * 1e-2}
    options["chordal_decomposition_enable"] = rows > _WHOLE_ROWS[diagonal]
    options["chordal_decomposition_merge_method"] = "parent_child"
    options["time_limit"] = seconds_left()
    options["warm_start"] = False  # nothing depends on what was solved before
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # "solution may be inaccurate": every result is recomputed by the caller
        run_solver(problem, "clarabel", options)
    checkpoint()
