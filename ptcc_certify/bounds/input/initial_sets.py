"""Sets of initial states: boxes and ellipsoids, and how far from their final states agents are at first."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import Any

from ptcc_certify.bounds.final_state.of_graph import Influence
from ptcc_certify.checker.input_formulas import InitialSet, Linear
from ptcc_certify.errors import NumberError, ParameterError
from ptcc_certify.graphs.io import as_graph, by_label, in_node_order
from ptcc_certify.graphs.io.states import LARGEST_STATE
from ptcc_certify.graphs.rationals import as_fraction, shorten, writable
from ptcc_certify.graphs.structure import Structure


def initial_set_within(graph: Any, bound: Any) -> InitialSet:
    """Return all initial states with ``||X(0)||_inf <= bound``.

    Parameters
    ----------
    graph : graph-like or Structure
        Whatever :func:`ptcc_certify.as_graph` takes.
    bound : int, float, str or Fraction
        Positive, at most 1e300.

    Returns
    -------
    InitialSet
        A box about 0.

    Raises
    ------
    ParameterError
        The bound is not a positive number.

    Examples
    --------
    >>> initial_set_within([("a", "b", 1)], "1/2").radius
    (Fraction(1, 2), Fraction(1, 2))
    """
    try:
        R = as_fraction(bound, "the bound of initial states")
    except NumberError as error:
        raise ParameterError(f"the bound of initial states: {error}") from None
    if not 0 < R <= 10**300:
        raise ParameterError(
            "the bound of initial states is outside its domain; it must be positive, and at most 1e300"
        )
    n = as_graph(graph).n_nodes
    return InitialSet((Fraction(0),) * n, (R,) * n)


def box(low: Any, high: Any, graph: Any = None) -> InitialSet:
    """Return all initial states with ``low_k <= x_k(0) <= high_k``.

    Parameters
    ----------
    low, high : sequences of N numbers, mappings of label to number or pandas Series
        Ints, floats (the dyadic numbers they are), Fractions or texts of the exact grammar.
    graph : graph-like, optional
        Needed where there are labels: it has the order of the nodes.

    Returns
    -------
    InitialSet

    Raises
    ------
    ParameterError
        The lengths differ, a lower end exceeds its upper end, or labels are not those of the nodes.
    NumberError
        An end is not a number of the exact grammar.

    Examples
    --------
    >>> box([0, 1], [2, 1])
    InitialSet(center=(Fraction(1, 1), Fraction(1, 1)), radius=(Fraction(1, 1), Fraction(0, 1)), axes=())
    >>> graph = SignedDigraph.from_edges([("a", "b", 1)])
    >>> box({"b": 1, "a": 0}, {"b": 1, "a": 2}, graph) == box([0, 1], [2, 1])
    True
    """
    low, high = _without_labels(low, graph, "low"), _without_labels(high, graph, "high")
    if len(low) != len(high):
        raise ParameterError(f"a box of {len(low)} lower and {len(high)} upper ends; give one of each for every agent")
    ends = [(as_fraction(a, "low"), as_fraction(b, "high")) for a, b in zip(low, high, strict=True)]
    if any(a > b for a, b in ends):
        raise ParameterError("a box whose lower end exceeds its upper end")
    return InitialSet(tuple((a + b) / 2 for a, b in ends), tuple((b - a) / 2 for a, b in ends))


def ellipsoid(center: Any, axes: Sequence[Any], graph: Any = None) -> InitialSet:
    """Return all initial states ``center + sum_j v_j axes_j`` with ``||v||_2 <= 1``.

    Parameters
    ----------
    center : sequence of N numbers, mapping of label to number or pandas Series
    axes : sequence of vectors like ``center``
        One semi-axis or more; they need not be orthogonal.
    graph : graph-like, optional
        Needed where there are labels: it has the order of the nodes.

    Returns
    -------
    InitialSet

    Raises
    ------
    ParameterError
        There is no axis, one of another length than ``center``, or labels are not those of the nodes.
    NumberError
        A number is not of the exact grammar.

    Examples
    --------
    >>> ellipsoid([0, 0], [[1, 0], [0, 2]]).axes
    ((Fraction(1, 1), Fraction(0, 1)), (Fraction(0, 1), Fraction(2, 1)))
    """
    if not isinstance(axes, Iterable):
        raise ParameterError("axes", f"= {shorten(repr(axes))} is no list of vectors; give one semi-axis or more")
    if by_label(axes, "axes") is not None:
        raise ParameterError("axes are a list of vectors, each of which may have labels; a table does not tell which")
    middle = tuple(as_fraction(x, "center") for x in _without_labels(center, graph, "center"))
    vectors = tuple(tuple(as_fraction(x, "axes") for x in _without_labels(axis, graph, "axes")) for axis in axes)
    if not vectors or any(len(axis) != len(middle) for axis in vectors):
        raise ParameterError(f"the axes of an ellipsoid are vectors of {len(middle)} numbers, at least one")
    return InitialSet(middle, axes=vectors)


def _without_labels(values: Any, graph: Any, name: str) -> Any:
    if graph is not None:
        values = in_node_order(values, as_graph(graph), name)
    elif by_label(values, name) is not None:
        raise ParameterError(name, "has labels, and the graph has the order of its nodes; give graph= besides")
    if isinstance(values, str) or not hasattr(values, "__len__"):
        raise ParameterError(name, f"is {shorten(repr(values))}; give one number for each agent")
    return values


def read_initial_set(structure: Structure, initial_set: Any) -> InitialSet:
    """Return a set of initial states, or refuse it."""
    if not isinstance(initial_set, InitialSet):
        return initial_set_within(structure, initial_set)
    n = structure.graph.n_nodes
    for name, vector in (("center", initial_set.center), ("radius", initial_set.radius or initial_set.center)):
        if len(vector) != n:
            raise ParameterError(f"{name} of the initial states has {len(vector)} entries for {n} agents")
    if any(len(axis) != n for axis in initial_set.axes):
        raise ParameterError(f"an axis of the initial states has another number of entries than {n} agents")
    if initial_set.radius and initial_set.axes:
        raise ParameterError("initial states have a radius, for a box, or axes, for an ellipsoid; leave one out")
    if any(r < 0 for r in initial_set.radius):
        raise ParameterError("a radius of the initial states is negative")
    numbers = [x for vector in (initial_set.center, initial_set.radius, *initial_set.axes) for x in vector]
    if any(abs(x) > LARGEST_STATE or not writable(Fraction(x)) for x in numbers):
        raise ParameterError("the initial states are beyond 1e300, or have too many digits to keep")
    return initial_set


def ways(influence: Influence) -> list[Linear]:
    """Return the rows of ``I - Q``: from its initial to its final state, each agent's way."""
    rows: list[Linear] = []
    for v in range(influence.structure.graph.n_nodes):
        row = {j: -Fraction(x) for j, x in influence.row(v).items()}
        rows.append(row | {v: row.get(v, Fraction(0)) + 1})
    return rows


def largest_deviation(initial_set: InitialSet, influence: Influence) -> Fraction:
    """Return ``sup max_k |x_k(0) - (Q x(0))_k|`` over the initial states, which nominal motions never exceed.

    Parameters
    ----------
    initial_set : InitialSet
    influence : Influence
        ``Q`` in rationals.

    Returns
    -------
    Fraction
        Exact for a point or a box, rounded up for an ellipsoid.

    Examples
    --------
    >>> pair = influence(analyse(SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])))
    >>> largest_deviation(InitialSet([Fraction(3), Fraction(1)]), pair)  # they meet at 1 and -1
    Fraction(2, 1)
    """
    return max(map(initial_set.largest, ways(influence)))
