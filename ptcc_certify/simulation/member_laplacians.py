"""Members of a family in floating point: which one a signal chooses, and its Laplacian; one graph has one member."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Family, Mode
from ptcc_certify.graphs.rationals import shorten

if TYPE_CHECKING:
    from scipy import sparse

#: Where uncertain weights lie unless a signal tells: in the middle of their intervals.
MIDDLE = 0.5


@dataclass(frozen=True)
class Choice:
    """One member of a family.

    Attributes
    ----------
    mode : int
        From 0.
    levels : tuple of q float
        Of each uncertain parameter of the mode, in the order of :attr:`Mode.parameters
        <ptcc_certify.graphs.family.Mode.parameters>`: the size is ``w- + level (w+ - w-)``, level from 0 to 1.
    """

    mode: int
    levels: tuple[float, ...] = ()


class _ModeArrays:
    """The edges of a mode with their sizes in floats, and which parameter each belongs to."""

    def __init__(self, mode: Mode):
        self.source, self.target = mode.source, mode.target
        self.sign = mode.sign.astype(float)
        self.lower = mode.lower.as_float()
        self.upper = mode.upper.as_float()
        self.q = mode.parameters.size
        number = {self._ends(mode, edge): p for p, edge in enumerate(mode.parameters.tolist())}
        self.uncertain = np.flatnonzero(~mode.known)
        self.parameter = np.array([number[self._ends(mode, e)] for e in self.uncertain.tolist()], dtype=np.int64)
        self.gap = (self.upper - self.lower)[self.uncertain]
        self.rivals = [
            (p, number[source, target, -sign])
            for (source, target, sign), p in number.items()
            if sign > 0 and (source, target, -sign) in number
        ]

    @staticmethod
    def _ends(mode: Mode, edge: int) -> tuple[int, int, int]:
        ends = int(mode.source[edge]), int(mode.target[edge])
        return (*(sorted(ends) if mode.tied else ends), int(mode.sign[edge]))  # type: ignore[return-value]

    def sizes(self, levels: Sequence[float]) -> np.ndarray:
        """Return ``|w|`` of every edge."""
        sizes = self.lower.copy()
        sizes[self.uncertain] += self.gap * np.asarray(levels, dtype=float)[self.parameter]
        return sizes


class Members:
    """The members of a family, as arrays over one pattern.

    Parameters
    ----------
    members_of : Family or SignedDigraph

    Attributes
    ----------
    graph : SignedDigraph
        The only member, if there is one alone, else that of mandatory edges in the first mode.
    alone : bool
        Whether there is one member.
    in_weight : (N,) array
        The largest in-weight of each node over all members.

    Examples
    --------
    >>> from ptcc_certify.graphs.family import Family
    >>> members = Members(Family.from_intervals([("a", "b", -3, -1), ("b", "a", 2, 2)]))
    >>> members.laplacian(members.choice(0, 1.0)).toarray()
    array([[ 2., -2.],
           [ 3.,  3.]])
    """

    def __init__(self, members_of: Family | SignedDigraph):
        self.alone = isinstance(members_of, SignedDigraph)
        self.family = Family.from_graph(members_of) if isinstance(members_of, SignedDigraph) else members_of
        self.graph = members_of if isinstance(members_of, SignedDigraph) else members_of.modes[0].mandatory
        if self.alone:
            self.in_weight = self.graph.in_weight()
        else:
            heaviest = [np.bincount(a.target, a.upper, minlength=self.graph.n_nodes) for a in self.arrays]
            self.in_weight = np.max(heaviest, axis=0)

    @cached_property
    def arrays(self) -> list[_ModeArrays]:
        """The edges of every mode."""
        return [_ModeArrays(mode) for mode in self.family.modes]

    @cached_property
    def _keys(self) -> np.ndarray:
        """The pattern of all Laplacians, by columns, with the whole diagonal: column times N plus row."""
        n, (source, target, _) = self.family.n_nodes, self.family.union
        return np.unique(np.concatenate([source * n + target, np.arange(n) * (n + 1)]))

    @cached_property
    def _places(self) -> list[np.ndarray]:
        """Where the edges of every mode lie in the pattern."""
        n = self.family.n_nodes
        return [np.searchsorted(self._keys, a.source * n + a.target) for a in self.arrays]

    @cached_property
    def unit(self) -> float:
        """A stretch of the clock in which agents move: 1 over the median in-weight of those that listen."""
        listening = self.in_weight[self.in_weight > 0]
        return float(1 / np.median(listening)) if listening.size else 1.0

    def choice(self, mode: int | str, level: float | Sequence[float] | np.ndarray = MIDDLE) -> Choice:
        """Return a choice, of two edges of opposite signs between one pair of nodes with one on at most.

        Parameters
        ----------
        mode : int or str
            The number, from 0; or the name, or the number from 1 as a text.
        level : float or (q,) sequence of float
            From 0 (``w-``) to 1 (``w+``), of all uncertain parameters or of each.

        Raises
        ------
        ParameterError
            There is no such mode, or levels do not fit.
        """
        number = self.number(mode)
        q = self.arrays[number].q
        levels = np.array(np.broadcast_to(level, q) if np.ndim(level) == 0 else level, dtype=float)
        if levels.shape != (q,):
            raise ParameterError(f"mode {self.name(number)} has {q} uncertain weights, not {levels.size}")
        if not ((levels >= 0) & (levels <= 1)).all():
            raise ParameterError(f"level {levels.min()} to {levels.max()} is not from 0 (w-) to 1 (w+)")
        for one, other in self.arrays[number].rivals:
            levels[one if levels[one] < levels[other] else other] = 0.0
        return Choice(number, tuple(levels.tolist()))

    def name(self, mode: int) -> str:
        """Return what a mode is called: its name, or its number from 1."""
        return self.family.modes[mode].name or str(mode + 1)

    def number(self, mode: int | str) -> int:
        """Return the number of a mode from 0, from that or from its name, or from its number from 1 as a text.

        Raises
        ------
        ParameterError
            There is none.
        """
        count = len(self.family.modes)
        names = [m.name for m in self.family.modes]
        if isinstance(mode, str) and mode in names and mode:
            return names.index(mode)
        if isinstance(mode, str) and mode.isascii() and mode.isdigit() and 1 <= int(mode) <= count:
            return int(mode) - 1
        if not isinstance(mode, str) and 0 <= int(mode) < count and int(mode) == mode:
            return int(mode)
        listed = [shorten(self.name(k)) for k in range(min(count, 8))]
        if count > 8:
            listed.append("..")
        raise ParameterError(f"the family has no mode {shorten(str(mode))}; it has {', '.join(listed)}")

    def data(self, choice: Choice) -> np.ndarray:
        """Return the entries of the Laplacian of a member over the pattern."""
        own, n = self.arrays[choice.mode], self.family.n_nodes
        sizes = own.sizes(choice.levels)
        entries = np.bincount(self._places[choice.mode], -own.sign * sizes, minlength=self._keys.size)
        diagonal = np.searchsorted(self._keys, np.arange(n) * (n + 1))
        entries[diagonal] += np.bincount(own.target, sizes, minlength=n)
        return entries

    @cached_property
    def pattern(self) -> tuple[np.ndarray, np.ndarray]:
        """``indptr`` and ``indices`` of all Laplacians, by columns; of several members with the whole diagonal."""
        if self.alone:
            laplacian = self.graph.laplacian().tocsc()
            return laplacian.indptr, laplacian.indices
        n = self.family.n_nodes
        return np.searchsorted(self._keys // n, np.arange(n + 1)), self._keys % n

    def laplacian(self, choice: Choice) -> sparse.csc_array:
        """Return the Laplacian of a member."""
        if self.alone:
            return self.graph.laplacian().tocsc()
        from scipy import sparse  # is loaded when a run needs it

        n, (indptr, indices) = self.family.n_nodes, self.pattern
        return sparse.csc_array((self.data(choice), indices, indptr), shape=(n, n))

    def imbalance(self, x: np.ndarray, choice: Choice | None = None) -> float:
        """Bound ``max_k |(L x)_k| / (2 D_k)`` over all members, or of one; nobody moves the agents with ``D_k = 0``.

        Of one member, ``x`` may have several columns.
        """
        if choice is not None:
            listens = self.in_weight > 0
            motion = np.abs(self.laplacian(choice) @ x)[listens].T
            return float((motion / (2 * self.in_weight[listens])).max(initial=0.0))
        worst = 0.0
        for own in self.arrays:
            half = (x[own.target] - own.sign * x[own.source]) / 2
            some, heaviest = own.uncertain, self.in_weight[own.target]  # shares of it times states stay within floats
            total = np.abs(np.bincount(own.target, own.lower / heaviest * half, minlength=len(x)))
            total += np.bincount(own.target[some], own.gap / heaviest[some] * np.abs(half[some]), minlength=len(x))
            worst = max(worst, float(total.max(initial=0.0)))
        return worst

    def worst(self, x: np.ndarray, gradient: np.ndarray) -> Choice:
        """Return the member by which a function falls least, of which the gradient at ``x`` is given.

        Along ``x' = -L x`` it falls by ``sum |w_kl| gradient_k (x_k - sgn(w_kl) x_l)``, linear in every weight: each is
        at ``w+`` where its summand is negative, at ``w-`` otherwise.

        Examples
        --------
        >>> from ptcc_certify.graphs.family import Family
        >>> family = Family.from_intervals([("a", "b", 1, 3), ("c", "b", 1, 2)], nodes="abc")
        >>> x = np.array([1.0, 0.0, -2.0])
        >>> Members(family).worst(x, np.array([0.0, 1.0, 0.0]))  # b is to stay large
        Choice(mode=0, levels=(1.0, 0.0))
        """
        least, worst = np.inf, self.choice(0, 0.0)
        x, gradient = (v / (np.abs(v).max(initial=0.0) or 1.0) for v in (x, gradient))  # products stay within floats
        for mode, own in enumerate(self.arrays):
            falls = gradient[own.target] * (x[own.target] - own.sign * x[own.source])
            slopes = np.bincount(own.parameter, own.gap * falls[own.uncertain], minlength=own.q)
            levels = np.where(slopes < 0, 1.0, 0.0)
            for one, other in own.rivals:
                if levels[one] and levels[other]:
                    levels[one if slopes[one] > slopes[other] else other] = 0.0
            fall = float(own.lower @ falls + slopes @ levels)
            if fall < least:
                least, worst = fall, Choice(mode, tuple(levels.tolist()))
        return worst
