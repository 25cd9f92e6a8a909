"""The longest delay with which no more than a wanted residual is left at the deadline, by what is proved of it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np

from ptcc_certify.bounds.delay.delay_lmi import DelayLMIBounds
from ptcc_certify.bounds.delay.late_messages import LateBounds, bound_late
from ptcc_certify.bounds.delay.settling_leaders import SettlingBounds
from ptcc_certify.bounds.delay.small_delays import DecayingForm, SmallDelayBounds
from ptcc_certify.bounds.final_state.of_graph import Influence
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.model.base import Protocol
from ptcc_certify.model.late_messages import LateMessages
from ptcc_certify.model.moving_leaders import MovingLeaders

#: Halvings of the interval, in powers of two, and digits of the delay that is returned.
_HALVINGS, _DIGITS = 9, 3
#: Delays below this share of ``T`` are not tried.
_SHORTEST = 1e-5


@dataclass(frozen=True, eq=False)
class LateCase:
    """A graph, a protocol and an initial state, of which many delays are asked.

    Parameters
    ----------
    structure : Structure
    protocol : Protocol
    initial_state : sequence of N Fraction, optional
    ends : sequence of N (middle, radius), optional
        Of ``Q X(0)``.
    influence : Influence, optional
        Exact; it belongs to ``forms``.
    forms : sequence of DecayingForm
        Lyapunov functions of the whole graph: they forgive small delays under a cap, or tell how leaders settle.
    leaders : MovingLeaders, optional
        Leaders move; nothing is then asked of these functions.

    Examples
    --------
    >>> structure = analyse(SignedDigraph.from_edges([(1, 2, 1), (2, 3, 1), (3, 2, 1)]))
    >>> case = LateCase(structure, NominalProtocol(T=1, rho1=1, rho2=4, kappa=1))
    >>> longest = case.longest(case.bound(LateMessages(delay=1)), Fraction(1, 20))
    >>> 0.005 < longest.messages.age < 0.5, longest.largest <= 0.05
    (True, True)
    """

    structure: Structure
    protocol: Protocol
    initial_state: Sequence[Fraction] | None = None
    ends: Sequence[tuple[Fraction, Fraction]] | None = None
    influence: Influence | None = None
    forms: Sequence[DecayingForm] = ()
    leaders: MovingLeaders | None = None

    def bound(self, messages: LateMessages) -> LateBounds:
        """Return what is proved with such messages, by rows and by Lyapunov functions."""
        late = bound_late(self.structure, self.protocol, messages, self.initial_state, self.ends, self.leaders)
        return self.with_forms(late)

    def _whole(self, kind: Any, messages: LateMessages) -> Any:
        """Return what bounds delays of the whole graph by a kind of function; None where nothing does."""
        state, exact, cap = self.initial_state, self.influence, messages.gain_cap
        if self.leaders is not None or cap is None or messages.value_error or state is None:
            return None
        if exact is None or not exact.exact:
            return None
        return kind(self.structure, self.protocol.gain, messages, exact, state)

    def longest_forgiven(self, messages: LateMessages) -> float | None:
        """Return about the longest delay that a function of the whole graph forgives; None where none is asked."""
        lmi = self._whole(DelayLMIBounds, messages)
        if lmi is None:
            return None
        small = self._whole(SmallDelayBounds, messages).longest_delay(self.forms) if self.forms else 0.0
        return max(small, lmi.longest_delay())

    def with_forms(self, late: LateBounds) -> LateBounds:
        """Add what the best Lyapunov functions of the whole graph prove."""
        late, bounds = self._with_settling(late), self._whole(SmallDelayBounds, late.messages) if self.forms else None
        form = None if bounds is None else bounds.best(self.forms)
        if bounds is not None and form is not None:
            inputs = bounds.inputs(next(one for one in self.forms if one.function == form.function), form)
            late = replace(late, form=form, input=_least(inputs, late.input))
        lmi = self._whole(DelayLMIBounds, late.messages)
        if lmi is not None and (found := lmi.best()) is not None:
            late = replace(late, lmi=found[0], input=_least(found[1], late.input))
        return late

    def _with_settling(self, late: LateBounds) -> LateBounds:
        """Add what holds of followers that hear late of leaders in groups, unless these hear late, too."""
        state, ends, structure = self.initial_state, self.ends, self.structure
        groups = any(len(c.nodes) > 1 for c in structure.closed_components)
        if state is None or ends is None or not groups or not structure.followers.size or not late.messages.age:
            return late
        if not self.forms or not late.messages.leaders_hear_at_once(structure):
            return late
        bounds = SettlingBounds(structure, late.gain, late.messages, state, ends)
        best = bounds.best(self.forms)
        inputs = None if best is None or late.messages.gain_cap is None else bounds.inputs(best)
        return replace(late, settling=best, input=inputs)

    def longest(self, late: LateBounds, residual: Fraction) -> LateBounds | None:
        """Return the bounds for nearly the longest delay that leaves no more than a residual.

        Parameters
        ----------
        late : LateBounds
            With some delay; its value error, losses and cap of the gain are kept, and so are the proportions of all
            times.
        residual : Fraction
            What may be left of ``|x_k(T) - x_k*|``.

        Returns
        -------
        LateBounds or None
            None if no delay is found. One of ``T`` is as good as any longer one, and none longer is tried.
        """
        T, age = self.protocol.T, late.messages.age
        best = None
        shortest, high = T * Fraction(_SHORTEST), min(age, T)
        if late.largest <= residual:
            best, shortest, high = late, age, max(age, T)
            latest = late if age >= T else self._bound_at(late.messages, T)
            if latest.largest <= residual:
                return latest
        low, top = math.log(float(shortest)), math.log(float(high))
        for _ in range(_HALVINGS):
            middle = (low + top) / 2
            tried = self._bound_at(late.messages, Fraction(f"{math.exp(middle):.{_DIGITS - 1}e}"))
            if tried.largest <= residual:
                best, low = tried, middle
            else:
                top = middle
        return best

    def _bound_at(self, messages: LateMessages, age: Fraction) -> LateBounds:
        """Bound what is left where what is heard is so old, all times in proportion."""
        factor, given = age / messages.age, messages.delay
        delay: Fraction | dict[tuple[str, str], Fraction] = messages.largest_delay * factor
        if isinstance(given, Mapping):
            delay = {edge: Fraction(x) * factor for edge, x in given.items()}
        period = None if messages.period is None else messages.period * factor
        return self.bound(replace(messages, delay=delay, period=period))


def _least(one: np.ndarray, other: np.ndarray | None) -> np.ndarray:
    """Return the smaller bounds of two, of which the second may be missing."""
    return one if other is None else np.minimum(one, other)
