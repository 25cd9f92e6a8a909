"""Where agents end, for intervals of where they begin: exactly, or as balls where numbers are too long to write."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

from lmi.exact.decimal_rounding import down, up
from ptcc_certify.bounds.final_state.of_graph import Influence, enclosed_ends
from ptcc_certify.errors import quoted
from ptcc_certify.graphs.labels import place_of, position
from ptcc_certify.graphs.rationals import shorten, writable
from ptcc_certify.graphs.structure import Structure

#: Decimals of the middle of a ball, and its radius, where an exact number would be too long.
DECIMALS, RADIUS = 120, Fraction(1, 10**60)


Interval = tuple[Fraction, Fraction]


def weighted_sum(weights: Sequence[Interval], values: Sequence[Interval]) -> Interval:
    """Return an interval that contains the sum of the products; of radius 0 where all of them are.

    Examples
    --------
    >>> middle, radius = weighted_sum([(Fraction(2), Fraction(1))], [(Fraction(3), Fraction(0))])
    >>> str(middle), str(radius)
    ('6', '3')
    """
    pairs = [(*weight, *value) for weight, value in zip(weights, values, strict=True)]
    middle = sum((w * x for w, _, x, _ in pairs), Fraction(0))
    return middle, sum((abs(w) * s + r * (abs(x) + s) for w, r, x, s in pairs), Fraction(0))


def influence_balls(matrix: Influence) -> tuple[list[list[Interval]], list[list[Interval]]]:
    """Return left null vectors and containment weights as intervals: of radius 0, unless too long to write."""
    left_null_vectors = [_balls([Fraction(w) for w in null_vector]) for null_vector in matrix.left_null_vectors]
    rows = matrix.containment_weights or ()
    columns = [_balls([Fraction(row[k]) for row in rows]) for k in range(len(matrix.left_null_vectors))]
    containment_weights = [list(row) for row in zip(*columns, strict=True)] if columns else [[] for _ in rows]
    return left_null_vectors, containment_weights


def agents_ends(matrix: Influence, begin: Sequence[Interval]) -> list[Interval]:
    """Return ``Q x`` for intervals ``x`` of the agents.

    Raises
    ------
    NotEnclosedError
        Of a large graph, whose ``Q`` is enclosed: its equations are too ill-conditioned for floats.
    """
    if not matrix.exact:
        return enclosed_ends(matrix, begin)
    left_null_vectors, containment_weights = influence_balls(matrix)
    groups = list(zip(matrix.balanced, left_null_vectors, strict=True))
    values = [weighted_sum(null_vector, [begin[v] for v in c.nodes]) for c, null_vector in groups]
    ends = [(Fraction(0), Fraction(0))] * len(begin)
    for component, (middle, radius) in zip(matrix.balanced, values, strict=True):
        for v, g in zip(component.nodes, component.gauge or (), strict=True):
            ends[v] = g * middle, radius
    for v, row in zip(matrix.structure.followers.tolist(), containment_weights, strict=True):
        ends[v] = weighted_sum(row, values)
    return ends


def _balls(values: Sequence[Fraction]) -> list[Interval]:
    if all(map(writable, values)):
        return [(x, Fraction(0)) for x in values]
    unit = 10**DECIMALS
    return [(Fraction(round(x * unit), unit), RADIUS) for x in values]


def final_state_witness(structure: Structure, matrix: Influence) -> tuple[Fraction, ...] | None:
    """Return ``u > 0`` with ``M u > 0`` on followers and on leader groups less one agent, if balls need it.

    ``M`` is the comparison matrix of ``L_F``, and that of ``L_k`` transposed. From it follows how far a ball's middle
    may be from the truth.
    """
    left_null_vectors, containment_weights = influence_balls(matrix)
    if not any(r for row in (*left_null_vectors, *containment_weights) for _, r in row):
        return None
    u = np.ones(structure.graph.n_nodes)
    L = structure.graph.laplacian().toarray()
    M = np.diag(np.diag(L)) * 2 - np.abs(L)
    groups = [(structure.followers.tolist(), M)]
    for component, null_vector in zip(matrix.balanced, left_null_vectors, strict=True):
        top = max(range(len(null_vector)), key=lambda i: abs(null_vector[i][0]))
        groups.append(([v for i, v in enumerate(component.nodes) if i != top], M.T))
    for nodes, block in groups:
        if nodes:
            own = block[np.ix_(nodes, nodes)]
            u[nodes] = np.abs(np.linalg.solve(own / np.diag(own)[:, None], np.ones(len(nodes))))
    return tuple(map(Fraction, u.tolist()))


class FinalEnds(tuple[Interval | None, ...]):
    """The ends of every agent, in the order of the nodes: a tuple that takes labels.

    Attributes
    ----------
    labels : tuple of str

    References
    ----------
    docs/theory/families.md, "Where it ends".

    Examples
    --------
    >>> ends = FinalEnds([(Fraction(6, 5), Fraction(8, 5)), None], ["ann", "bob"])
    >>> ends, ends["ann"] == ends[0]
    (FinalEnds(ann in [1.2, 1.6], bob unknown), True)
    >>> FinalEnds([None, (Fraction(2), Fraction(2))], ["1", "2"])[2]  # a number is a label where labels are numbers
    (Fraction(2, 1), Fraction(2, 1))
    """

    labels: tuple[str, ...]

    def __new__(cls, ends: Iterable[Interval | None], labels: Iterable[str]) -> FinalEnds:
        """Keep the labels beside the ends."""
        self = super().__new__(cls, ends)
        self.labels = tuple(labels)
        return self

    def __getnewargs__(self) -> tuple[Any, ...]:
        return tuple(self), self.labels

    def __getitem__(self, key: Any) -> Any:
        """Return the ends of an agent by its label; where no label is a number, by its place, too."""
        if isinstance(key, slice) or (hasattr(key, "__index__") and -len(self) <= key < 0 and not self._numbered):
            return super().__getitem__(key)
        return super().__getitem__((position if self._numbered else place_of)(key, self.labels))

    @cached_property
    def _numbered(self) -> bool:
        return any(label.removeprefix("-").isdecimal() for label in self.labels)

    def __repr__(self) -> str:
        texts = [f"{quoted(shorten(label))} {_text(ends)}" for label, ends in zip(self.labels[:8], self, strict=False)]
        return f"FinalEnds({', '.join(texts)}{', ...' if len(self) > 8 else ''})"


def _text(ends: Interval | None) -> str:
    if ends is None:
        return "unknown"
    low, high = ends
    if down(low) == up(high):
        return f"at {down(low)}"
    return f"in [{down(low)}, {up(high)}]"
