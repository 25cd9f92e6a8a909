"""What every theorem of the paper has: hypotheses, a Lyapunov function, a rate with its proof.

All rates are per unit of the stretched clock ``s``: ``V <= e^(-rate s) V(0)`` and, in the coordinates of the theorem,
``||.||^2 <= overshoot e^(-rate s) ||.(0)||^2``.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

import numpy as np

from ptcc_certify.checker import ProofObligation
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.lyapunov.function import LyapunovFunction

#: The objective where there is nothing to decrease.
CONSTANT = "none: every agent keeps its state"


@dataclass(frozen=True)
class ExactInterval:
    """Proved lower bounds of the ends of the interval of ``rho``; None where ``rho`` is unbounded.

    Every ``rho`` in ``0 < rho <= printed`` and ``0 < rho <= exact`` is admissible; the true ends lie above, as a rule
    by one part in 10^9.
    """

    printed: Fraction | None
    exact: Fraction | None


@dataclass(frozen=True)
class Obligation(ProofObligation):
    """One statement that was proved, and that the independent check verifies again.

    Attributes
    ----------
    kind : str
        One of :data:`ptcc_certify.checker.OBLIGATIONS`, which gives the statement and its lemma.
    of : str
        The part of the certificate that it is about.
    numbers : mapping of str to Fraction
        The constants of the statement.
    witness : optional
        What makes the statement easy to verify, JSON-ready or to be written by the document; need not be trusted.
    """

    numbers: Mapping[str, Fraction] = field(default_factory=dict, hash=False)
    witness: Any = field(default=None, hash=False)


@dataclass(frozen=True)
class RateProof:
    """A proved rate, with what was proved; ``rate`` None when a step could not be proved (``failed`` says which)."""

    rate: Fraction | None
    obligations: tuple[Obligation, ...]
    interval: ExactInterval | None = None
    failed: str | None = None


class Theorem(ABC):
    """A theorem row: when it applies, its Lyapunov function, its rate.

    Subclasses set ``number``, ``statement`` and ``conditions`` and read like the theorem.
    """

    number: str
    statement: str
    #: The hypotheses, each with its name.
    conditions: tuple[tuple[str, Callable[[Structure], bool]], ...]

    def __repr__(self) -> str:
        return f"Theorem({self.number}: {self.statement})"

    def hypotheses(self, structure: Structure) -> dict[str, bool]:
        """Return the named hypotheses, each with its truth value."""
        return {name: holds(structure) for name, holds in self.conditions}

    def applies(self, structure: Structure) -> bool:
        """Tell whether all hypotheses hold."""
        return all(self.hypotheses(structure).values())

    @abstractmethod
    def lyapunov(self, structure: Structure) -> LyapunovFunction:
        """Search the Lyapunov function and round it to rationals.

        Raises
        ------
        lmi.NoCertificate
            The search found none.
        """

    @abstractmethod
    def decrease(self, structure: Structure, V: LyapunovFunction) -> np.ndarray:
        """Return the symmetric ``S`` (floats) with which the paper bounds ``V' <= -gain z'Sz``."""

    @abstractmethod
    def rate(self, structure: Structure, V: LyapunovFunction) -> float:
        """Return the paper's rate from floating-point eigenvalues; infinite if ``V`` is 0."""

    @abstractmethod
    def prove(self, structure: Structure, V: LyapunovFunction) -> RateProof:
        """Prove a rate of ``V`` in exact arithmetic, as near to the paper's as proves."""
