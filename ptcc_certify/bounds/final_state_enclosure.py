"""The final state of a large graph in intervals: leaders by left null vectors, followers by one solve.

With ``u > 0`` and ``M(L_F) u > 0``, any approximation ``y`` of the followers' end has

    |x_F - y|  <=  max_i((|r_i| + s_i) / (M(L_F) u)_i) u,      r = L_F y + L_FL x_L,

``s`` what the radii of the leaders add. The left null vector of a large leader group is enclosed in the same way.
Residuals are taken in floats with room for their rounding, or in rationals where that room is too wide; the check of
the certificate forms them exactly.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np

from lmi.errors import LMIError
from lmi.sparse_h_matrix import SparseHMatrix, solve
from ptcc_certify.bounds.final_state import Enclosure, FinalState, Influence, follower_state
from ptcc_certify.graphs.structure import ClosedComponent, Structure

#: Room for the rounding of a residual in floats, and the radius up to which it is narrow enough.
_ROUNDING, _NARROW = 1e-12, 4e-7
#: Residual of a witness in every row, relatively.
_LOOSE = 0.05
#: Room for the rounding of a radius, and of texts and floats of a middle.
_MORE, _ULP = 1 + 1e-6, 2.0**-52
#: Starts below this size leave no room for radii in float64, and are taken in another unit.
_SMALLEST = Fraction(1, 10**290)


class NotEnclosedError(ArithmeticError):
    """No interval was found; the message tells why."""


def enclose(structure: Structure, influence: Influence) -> Enclosure:
    """Enclose the left null vector of ``Q``, and find the witness of all intervals.

    Raises
    ------
    NotEnclosedError
        The equations of followers or left null vectors are too ill-conditioned for floats.
    """
    F = structure.followers
    u = np.ones(structure.graph.n_nodes)
    if F.size:
        u[F] = _witness(structure.graph.laplacian().tocsr()[F][:, F])
    left_null_vectors = {}
    for k, (component, null_vector) in enumerate(zip(influence.balanced, influence.left_null_vectors, strict=True)):
        if not all(isinstance(w, Fraction | int) for w in null_vector):
            left_null_vectors[k] = _enclosed_left_null_vector(
                structure, component, np.array(null_vector, dtype=float), u
            )
    return Enclosure(left_null_vectors, u)


def enclosed_final_state(structure: Structure, influence: Influence, start: Sequence[Fraction]) -> FinalState:
    """Enclose ``Q start``, what is known of ``Q`` being enclosed.

    Raises
    ------
    NotEnclosedError
        The followers' equations are too ill-conditioned for floats, or a consensus value may be 0.

    Examples
    --------
    >>> from dataclasses import replace
    >>> from ptcc_certify.graphs.digraph import SignedDigraph
    >>> from ptcc_certify.bounds.final_state import influence
    >>> from ptcc_certify.graphs.structure import analyse
    >>> st = analyse(SignedDigraph.from_edges([("a", "c", 1), ("b", "c", -2)]))
    >>> who = influence(st, exact=False)
    >>> start = [Fraction(1), Fraction(0), Fraction(1)]
    >>> found = enclosed_final_state(st, replace(who, enclosure=enclose(st, who)), start)
    >>> bool(abs(Fraction(found.states[1]) + Fraction(1, 3)) <= found.radius[1] < 1e-9)  # c ends at -1/3
    True
    """
    assert influence.enclosure is not None
    n, left_null_vectors, u = (
        structure.graph.n_nodes,
        influence.enclosure.left_null_vectors,
        influence.enclosure.witness,
    )
    size = max((abs(start[v]) for c in influence.balanced for v in c.nodes), default=Fraction(0))
    unit = Fraction(1)
    if 0 < size < _SMALLEST:
        unit = Fraction(1, 2 ** (size.denominator.bit_length() - size.numerator.bit_length()))
        start = [x / unit for x in start]
    middle, radius, exact = np.zeros(n), np.zeros(n), dict[int, Fraction]()
    numbers = [k for k, c in enumerate(structure.closed_components, start=1) if c.balanced]
    degenerate = []
    for k, (number, component) in enumerate(zip(numbers, influence.balanced, strict=True)):
        signs, nodes = np.array(component.gauge or ()), np.array(component.nodes)
        if k in left_null_vectors and any(start[v] for v in component.nodes):
            own = np.array([float(start[v]) for v in component.nodes])
            value, spread = float(left_null_vectors[k][0] @ own), float(left_null_vectors[k][1] @ np.abs(own))
            spread = (spread + _ROUNDING * float(np.abs(left_null_vectors[k][0]) @ np.abs(own))) * _MORE
            if abs(value) <= 2 * spread:
                raise NotEnclosedError(f"the consensus value of leader group {number} may or may not be 0")
            middle[nodes], radius[nodes] = signs * value, spread
            continue
        shares = zip(component.nodes, influence.left_null_vectors[k], strict=True)
        known = sum((Fraction(w) * start[v] for v, w in shares if start[v]), Fraction(0))
        degenerate += [number] if known == 0 else []
        exact.update((v, sign * known) for v, sign in zip(component.nodes, component.gauge or (), strict=True))
        middle[nodes], radius[nodes] = signs * float(known), rounding_radius(known)
    exact.update((v, Fraction(0)) for c in structure.closed_components if not c.balanced for v in c.nodes)
    if structure.followers.size and middle.any():
        middle[structure.followers], radius[structure.followers] = _enclosed_followers(
            structure, exact, middle, radius, u
        )
    final: list[Fraction | float] = [x if unit == 1 else Fraction(x) * unit for x in middle.tolist()]
    spreads = [Fraction(r) * unit for r in radius.tolist()]
    for v, x in exact.items():
        final[v], spreads[v] = x * unit, Fraction(0)
    values = [final[c.nodes[0]] * (c.gauge or (1,))[0] for c in influence.balanced]
    return FinalState(structure.graph.labels, tuple(final), tuple(values), tuple(degenerate), tuple(spreads))


def rounding_radius(value: Fraction) -> float:
    """Bound how far the nearest float, or its decimal text, is from a rational.

    Examples
    --------
    >>> rounding_radius(Fraction(1, 2)), 0 < rounding_radius(Fraction(1, 3)) < 1e-15
    (0.0, True)
    """
    near = float(value)
    return 0.0 if Fraction(near) == value else float(_spacing(near))


def _spacing(x: float | np.ndarray) -> Any:
    """Bound the rounding of a float or of its decimal text."""
    return 2 * _ULP * np.abs(x) + 5e-324


def _witness(block: Any) -> np.ndarray:
    """Return ``u > 0`` with ``M(block) u > 0``, its largest entry 1."""
    with np.errstate(all="ignore"):
        try:
            matrix = SparseHMatrix(block)
        except LMIError as error:
            raise NotEnclosedError(str(error)) from None
        ones = np.ones(matrix.diagonal.size)
        rows = matrix.M.multiply(1 / matrix.diagonal[:, None]).tocsr()  # rows of every size weigh alike
        u = solve(rows, ones, ones, _LOOSE / np.sqrt(ones.size))
        u /= u.max()
        pushed = matrix.M @ u
    if not (np.isfinite(u).all() and (u > 0).all() and np.isfinite(pushed).all() and (pushed > 0).all()):
        raise NotEnclosedError("the equations are too ill-conditioned for floats")
    return u


def _enclosed_left_null_vector(
    structure: Structure, component: ClosedComponent, null_vector: np.ndarray, u: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Enclose ``eta' M(L_k) = 0``, ``eta'1 = 1`` of one group, signs of the camps included; fill in its ``u``."""
    nodes = np.array(component.nodes)
    block = structure.graph.laplacian().tocsr()[nodes][:, nodes].tocsr()
    signs = np.array(component.gauge or (), dtype=float)
    eta = signs * null_vector
    top = int(np.argmax(eta))
    rest = np.delete(np.arange(nodes.size), top)
    own = _witness(block[rest][:, rest].T.tocsr())
    u[nodes[rest]] = own
    columns = block.T.tocsr()[rest]  # of the comparison matrix, but for signs
    z = eta / eta[top]
    pushed = 2 * block.diagonal()[rest] * own - abs(columns[:, rest]) @ own
    total = abs(columns) @ z
    residual = np.abs(2 * block.diagonal()[rest] * z[rest] - total)
    with np.errstate(all="ignore"):
        error = float(((residual + _ULP * (np.diff(columns.indptr) + 4) * total) / pushed).max()) * _MORE
    weights = np.zeros(nodes.size)
    weights[rest] = own
    low, high = z.sum() - error * weights.sum(), z.sum() + error * weights.sum()
    if not low > 0.5 * high:
        raise NotEnclosedError(
            f"the left null vector of a leader group of {nodes.size} nodes is too ill-conditioned for floats"
        )
    ends = np.abs((z - error * weights) / high - eta), np.abs((z + error * weights) / low - eta)
    return signs * eta, np.maximum(*ends) * _MORE + 8 * _ULP * eta


def _enclosed_followers(
    structure: Structure, exact: dict[int, Fraction], middle: np.ndarray, radius: np.ndarray, u: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return middles and radii of the followers, in a unit near to the largest leader."""
    F = structure.followers
    unit = float(np.exp2(np.floor(np.log2(np.abs(middle).max()))))
    rows = structure.graph.laplacian().tocsr()[F]
    state, blur = middle / unit, abs(rows) @ (radius / unit)
    block = rows[:, F].tocsr()
    with np.errstate(all="ignore"):
        solved = follower_state(structure, state)
        if not np.isfinite(solved).all():
            raise NotEnclosedError("the followers' equations are too ill-conditioned for floats")
        state[F] = solved
        comparison = 2 * block.diagonal() * u[F] - abs(block) @ u[F]
        residual = np.abs(rows @ state) + blur + _ROUNDING * (abs(rows) @ np.abs(state))
        error = float((residual / comparison).max()) * 1.01
    if not error * u[F].max() <= _NARROW:
        error = _exact_error(structure, exact, state, blur + _ULP * (abs(rows) @ np.abs(state)), u, unit)
    found = solved * unit
    return found, (error * u[F] * unit + _spacing(found)) * _MORE


def _exact_error(
    structure: Structure, exact: dict[int, Fraction], state: np.ndarray, blur: np.ndarray, u: np.ndarray, unit: float
) -> float:
    """Return ``max_i (|r_i| + s_i) / (M(L_F) u)_i``, the residual in rationals."""
    F = structure.followers.tolist()
    following = set(F)
    known = [exact[v] / Fraction(unit) if v in exact else Fraction(x) for v, x in enumerate(state.tolist())]
    weights = [Fraction(x) for x in u.tolist()]
    error = Fraction(0)
    for v, row, more in zip(F, structure.graph.exact_rows(F), blur.tolist(), strict=True):
        left = sum((x * known[j] for j, x in row.items()), Fraction(0))
        signs = (weights[j] * (x if j == v else -abs(x)) for j, x in row.items() if j in following)
        pushed = sum(signs, Fraction(0))
        if pushed <= 0:
            raise NotEnclosedError("the followers' equations are too ill-conditioned for floats")
        error = max(error, (abs(left) + Fraction(more)) / pushed)
    return float(error) * _MORE
