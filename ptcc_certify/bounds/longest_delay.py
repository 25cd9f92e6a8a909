"""The longest delay with which no more than a wanted residual is left at the deadline, by what is proved of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

from ptcc_certify.bounds.late_messages import bound_late
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.protocols.base import Protocol
from ptcc_certify.protocols.late_messages import LateMessages

#: Halvings of the interval, in powers of two, and digits of the delay that is returned.
_HALVINGS, _DIGITS = 9, 3
#: Delays below this share of ``T`` are not tried.
_SHORTEST = 1e-5


def longest_delay(
    structure: Structure,
    protocol: Protocol,
    residual: Fraction,
    messages: LateMessages,
    initial_state: Sequence[Fraction] | None = None,
    ends: Sequence[tuple[Fraction, Fraction]] | None = None,
) -> Fraction | None:
    """Return a delay of few digits, near to the longest one, that is proved to leave no more than a residual.

    Parameters
    ----------
    structure : Structure
    protocol : Protocol
    residual : Fraction
        What may be left of ``|x_k(T) - x_k*|``.
    messages : LateMessages
        Whose delay is too long; its value error and cap of the gain are kept, and nothing gets lost.
    initial_state : sequence of N Fraction, optional
    ends : sequence of N (middle, radius), optional
        Of ``Q X(0)``.

    Returns
    -------
    Fraction or None
        Proved by the bound that a certificate with this delay states; None if no delay is.

    Examples
    --------
    >>> structure = analyse(SignedDigraph.from_edges([(1, 2, 1), (2, 3, 1), (3, 2, 1)]))
    >>> p = NominalProtocol(T=1, rho1=1, rho2=4, kappa=1)
    >>> 0.005 < longest_delay(structure, p, Fraction(1, 20), LateMessages(delay=1)) < 0.5
    True
    """

    def holds(delay: Fraction) -> bool:
        late = LateMessages(delay=delay, value_error=messages.value_error, gain_cap=messages.gain_cap)
        return bound_late(structure, protocol, late, initial_state, ends).largest <= residual

    T = float(protocol.T)
    high = math.log(float(messages.age) or T)
    low = math.log(_SHORTEST * T)
    best = None
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        delay = Fraction(f"{math.exp(middle):.{_DIGITS - 1}e}")
        if holds(delay):
            best, low = delay, middle
        else:
            high = middle
    return best
