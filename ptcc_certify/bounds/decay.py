"""A decay over time: the one scalar that every bound over time is a multiple of.

With ``push`` what drives it per unit of the clock ``s``, which is 0 but in a reaching phase,

    y(t) = e^(-rate s(t)/2) first + int_0^t e^(-rate (s(t) - s(r))/2) push(r) ds(r)

bounds ``sqrt(V)``: then norms, deviations and speeds of agents are at most constants times ``y``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ptcc_certify.bounds.instants import Instants
from ptcc_certify.bounds.reaching_phase import ReachingPhase


@dataclass(frozen=True, eq=False)
class Decay:
    """``y`` of the module.

    Attributes
    ----------
    rate : float
        From below; positive where something drives it.
    first : float
        ``y(0)``, from above.
    phase : ReachingPhase or None
        The time in which something drives it.
    push : array or None
        From above what drives it in every piece of that time, see :meth:`ReachingPhase.driven`.

    Examples
    --------
    >>> decay = Decay(2.0, 3.0)
    >>> decay.times([1.0, 2.0], Instants(np.array([0.0, np.inf]))).round(9).tolist()
    [[3.0, 0.0], [6.0, 0.0]]
    """

    rate: float
    first: float
    phase: ReachingPhase | None = None
    push: np.ndarray | None = None

    def times(self, constants: np.ndarray | list[float] | float, at: Instants) -> np.ndarray:
        """Return the constants times ``y`` at M instants, (.., M), rounded up; infinite beyond the range of floats."""
        with np.errstate(over="ignore", invalid="ignore"):
            if self.phase is None or self.push is None:
                # 0 times infinity is 0
                return decayed(np.nan_to_num(np.multiply(constants, self.first), posinf=np.inf), self.rate, at.clock)
            y = self.phase.driven(self.rate / 2, self.first, self.push, at)
            return np.nan_to_num(np.multiply.outer(constants, y * (1 + 1e-12)), posinf=np.inf)


def decayed(size: np.ndarray | float, rate: float, clock: np.ndarray) -> np.ndarray:
    """Return ``size e^(-rate s / 2)`` for every size and every clock value, rounded up; formed in logarithms.

    At the deadline, where the clock is infinite, 0 if the rate is positive or the size is 0.
    """
    with np.errstate(all="ignore"):
        exponent = np.add.outer(np.log(size), -rate * clock / 2 if rate else np.zeros_like(clock))
        value = np.exp(exponent) * (1 + 1e-12)
    value = np.where((value == 0) & (exponent > -np.inf), 5e-324, value)
    return np.where(np.isnan(value), 0.0, value)
