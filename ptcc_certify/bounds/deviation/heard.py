"""How far each agent is from its end, from how far those are that it hears; in floats, upwards.

``y = x - x(T)`` is at rest where nothing is left: ``y' = -L y`` in every member, so that for every signal

    |y_k|'  <=  max sum_l |w_kl| (|y_l| - |y_k|),

the largest over the weights of a mode and over modes. Functions of a whole component bound all ``|y_l|`` at one rate,
from a value in which quick agents count, too. These rows tell that an agent of large weights is soon where others take
it, and goes on as they do.

References
----------
docs/theory/families.md, "Inputs".
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.rationals import nearest_float

#: Entries of the weights of all modes up to which rows are followed, and steps at most beside the instants.
_ENTRIES, _STEPS = 10_000, 300
#: Share that functions may lose in one step, and rounds in which what is heard in a step is made smaller.
_LOSS, _ROUNDS = 0.1, 2
#: Room for the rounding of all steps.
_SLACK = 1 + 1e-9


@dataclass(frozen=True, eq=False)
class HeardRows:
    """The sizes of the weights of a component.

    Attributes
    ----------
    low, high : (m, N, N) arrays
        Of every mode the least and the largest of what agent ``k`` hears of agent ``l``.
    """

    low: np.ndarray
    high: np.ndarray

    @classmethod
    def of(cls, family: Family) -> HeardRows | None:
        """Return the rows of a family; None where they are too many.

        Examples
        --------
        >>> HeardRows.of(Family.from_intervals([("a", "b", -3, -1), ("b", "a", 2, 2)])).high[0].tolist()
        [[0.0, 2.0], [3.0, 0.0]]
        """
        m, n = len(family.modes), family.n_nodes
        if m * n**2 > _ENTRIES:
            return None
        low, high = np.zeros((m, n, n)), np.zeros((m, n, n))
        for i, mode in enumerate(family.modes):
            for array, table in ((low, mode.lower), (high, mode.upper)):
                sizes = [nearest_float(table.fraction(e)) for e in range(mode.n_edges)]
                np.add.at(array[i], (mode.target, mode.source), sizes)
        return cls(low, high)

    def follow(
        self, start: np.ndarray, bound: Callable[[np.ndarray], np.ndarray], clock: np.ndarray, rate: float
    ) -> np.ndarray:
        """Bound ``|y_k|`` at instants of the clock, (N, M).

        In every step all that is heard is at most what it is at its beginning by ``bound``, and no more than the
        larger of what an agent has there and what it hears.

        Parameters
        ----------
        start : (N,) array
            ``|y_k(0)|`` at most.
        bound : callable
            Of instants, (G,): other bounds of ``|y_k|``, (N, G), none of which ever grows.
        clock : (M,) array
        rate : float
            Twice the largest rate of ``bound``; steps are as small as it asks for.

        Examples
        --------
        >>> rows = HeardRows.of(Family.from_intervals([("a", "b", 5, 5), ("b", "c", 1, 1)]))
        >>> slow = lambda s: np.outer([0, 5, 5], np.exp(-s / 2))
        >>> left = rows.follow(np.array([0, 1, 1]), slow, np.array([2.0]), 1.0)
        >>> exact = np.array([np.exp(-10), (5 * np.exp(-2) - np.exp(-10)) / 4])
        >>> bool((left[1:, 0] >= exact).all() and (left[1:, 0] <= 1.2 * exact).all())
        True
        """
        steps = np.minimum(np.arange(_STEPS) * 2 * _LOSS / rate, clock.max(initial=0.0))
        instants, place = np.unique(np.concatenate([clock, steps]), return_inverse=True)
        with np.errstate(all="ignore"):
            others = bound(instants)
            result = np.empty_like(others)
            slow, fast = self.low.sum(axis=2).min(axis=0), self.high.sum(axis=2).max(axis=0)
            y = result[:, 0] = np.minimum(start, others[:, 0])
            for j, length in enumerate(np.diff(instants)):
                heard = self._heard(others[:, j])
                for _ in range(_ROUNDS):
                    heard = self._heard(np.minimum(others[:, j], np.maximum(y, heard)))
                kept = np.exp(-np.where(y >= heard, slow, fast) * length)
                y = result[:, j + 1] = np.fmin(heard * (1 - kept) + y * kept, others[:, j + 1])
        return np.asarray(result[:, place[: clock.size]] * _SLACK)

    def _heard(self, y: np.ndarray) -> np.ndarray:
        """Return the largest weighted mean of what each agent hears; 0 of those that hear nobody."""
        order = np.argsort(-y)
        low, spread = self.low[:, :, order], (self.high - self.low)[:, :, order]
        above = np.zeros((*low.shape[:2], 1))  # largest weights of the first few, least ones of the others
        weights = low.sum(axis=2, keepdims=True) + np.concatenate([above, spread.cumsum(axis=2)], axis=2)
        sums = (low @ y[order])[:, :, None] + np.concatenate([above, (spread * y[order]).cumsum(axis=2)], axis=2)
        means = np.divide(sums, weights, out=np.zeros_like(sums), where=weights > 0)
        return np.asarray(means.max(axis=(0, 2)))

    def speeds(self, y: np.ndarray) -> np.ndarray:
        """Bound ``|(L X)_k|`` from bounds of ``|y|``, (N, M).

        Examples
        --------
        >>> rows = HeardRows.of(Family.from_intervals([("a", "b", -3, -1), ("b", "a", 2, 2)]))
        >>> rows.speeds(np.array([[1.0], [2.0]])).ravel().round(6).tolist()
        [6.0, 9.0]
        """
        sums = [high.sum(axis=1)[:, None] * y + high @ y for high in self.high]
        return np.asarray(np.max(sums, axis=0) * _SLACK)
