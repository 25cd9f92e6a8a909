"""Theorems 4 to 6: the rows of Theorems 1 to 3 under the sliding-mode protocol and bounded disturbances.

From ``T_r`` on every sliding variable is 0 (Proposition 1) and the agents move as under the nominal protocol with the
deadline ``T_r + T_s``, from ``X(0) - sigma(0)`` so to speak. The Lyapunov functions and rates are those of the nominal
rows; Theorem 4.1 is Theorem 1.1, and so on, Corollaries 6 to 10 are Corollaries 1 to 5.
"""

from __future__ import annotations

import numpy as np

from ptcc_certify.graphs.structure import Structure
from ptcc_certify.lyapunov.function import LyapunovFunction
from ptcc_certify.theorems.base import RateProof, Theorem
from ptcc_certify.theorems.claims import sliding_number


class SlidingMode(Theorem):
    """The counterpart of a nominal row."""

    def __init__(self, nominal: Theorem):
        self._nominal = nominal
        self.number = sliding_number(nominal.number)
        self.statement = nominal.statement.replace(" at T", " at T_r + T_s, under bounded disturbances")

    def hypotheses(self, structure: Structure) -> dict[str, bool]:
        """Return the hypotheses of the nominal row; ``mu1 > delta`` is checked by the protocol."""
        return self._nominal.hypotheses(structure)

    def lyapunov(self, structure: Structure) -> LyapunovFunction:
        """Search as for the nominal row."""
        return self._nominal.lyapunov(structure)

    def decrease(self, structure: Structure, V: LyapunovFunction) -> np.ndarray:
        """Return the matrix of the nominal row."""
        return self._nominal.decrease(structure, V)

    def prove(self, structure: Structure, V: LyapunovFunction) -> RateProof:
        """Prove the rate as for the nominal row."""
        return self._nominal.prove(structure, V)
