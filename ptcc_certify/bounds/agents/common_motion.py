"""How agents of order n move together: one agent without neighbours, from 0 to the deadline, exactly or enclosed.

``Q L = 0``, so the rows of ``(Q (x) I) Xi`` obey the equation of one agent whatever the gains: ``xi(T) = M xi(0)``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

from ptcc_certify.checker.agent_model import Chains
from ptcc_certify.checker.common_motion import motion_of
from ptcc_certify.errors import ParameterError
from ptcc_certify.model.gain import Gain

Interval = tuple[Fraction, Fraction]
#: Bits after the point that are kept of a common motion that is not rational, and that are computed.
KEPT_BITS, BITS = 80, 120
#: Largest ``(a_2 + alpha rho1) T`` in size of agents that meet at rest.
LARGEST_DECAY = 100


def common_motion(plant: Sequence[Fraction], own: Sequence[Fraction], gain: Gain) -> tuple[tuple[Interval, ...], ...]:
    """Return ``M``, n by n intervals: of radius 0 for chains of integrators.

    ``e^(A T)`` with the companion matrix ``A``; for agents that meet at rest, with ``f = (0, alpha)`` and ``a_1 = 0``,
    the rows ``(1, m)`` and ``(0, 0)``, ``m = int_0^T e^(-a_2 t - alpha s(t)) dt``.

    Examples
    --------
    >>> zero, gain = Fraction(0), Gain(T=2, rho1=1, rho2=1, kappa=1)
    >>> [[str(x) for x, _ in row] for row in common_motion([zero, zero], [zero, zero], gain)]
    [['1', '2'], ['0', '1']]
    >>> at_rest = common_motion([zero, zero], [zero, Fraction(1)], gain)
    >>> float(at_rest[0][1][0]).__round__(6), float(at_rest[0][1][1]) < 1e-20  # int e^(-t) (1 - t/2) dt
    (0.567668, True)

    Raises
    ------
    ParameterError
        Of agents that meet at rest ``(a_2 + alpha rho1) T`` is beyond 100 in size.
    """
    if any(own) and abs(w := (plant[1] + own[1] * gain.rho1) * gain.T) > LARGEST_DECAY:
        raise ParameterError(
            "rest", f"(a_2 + rest rho1) T = {float(w):.4g} is beyond {LARGEST_DECAY}; take a smaller rest, or rho1"
        )
    rows, radius = motion_of(Chains(len(plant), 1, plant, own, None, gain.exact), BITS)
    return tuple(tuple(_wide((low + high) / 2, (high - low) / 2 + radius) for low, high in row) for row in rows)


def _wide(middle: Fraction, radius: Fraction) -> Interval:
    """Return an interval of few digits, wide enough for whoever encloses the same to a few digits more."""
    if not radius:
        return middle, radius
    unit, finer = 2**KEPT_BITS, 2 ** (KEPT_BITS + 16)
    wide = radius + Fraction(1 + math.ceil(abs(middle)), unit)
    return Fraction(round(middle * unit), unit), Fraction(math.ceil(wide * finer), finer)
