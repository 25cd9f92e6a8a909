"""Leaders that move: how fast, what disturbs the followers, and the sign term that keeps them on their targets.

x_j' = f(t, x_j) + v_j,  |v_j| <= speed                                  a leader, which listens to nobody
x_k' = f(t, x_k) - gain(t) (L x)_k + d_k [ + sign_gain sign(e_k) ],      a follower, |d_k| <= disturbance,  e = -L x

``f`` is what every agent does by itself: 0, or anything with ``|f(t, x) - f(t, y)| <= growth |x - y|`` that is odd in
``x``, which nobody need know.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Any, ClassVar

from lmi.exact.decimal_rounding import near
from ptcc_certify.errors import ParameterError, gated
from ptcc_certify.graphs.declared_option import option
from ptcc_certify.model.parameters import Given, NotNegative, Parameters


@gated
@dataclass(frozen=True, repr=False)
class MovingLeaders(Parameters):
    """How fast leaders move, and what is done about it.

    Parameters
    ----------
    speed : number or str
        Of every leader, at most; in units of the state over time, not negative.
    disturbance : number or str
        Of every follower, at most; in units of the input, not negative.
    sign_gain : number or str, optional
        What followers add times ``sign(e_k)``, at least ``speed + disturbance``: they stay on their targets after
        ``T``. Without it they are there at ``T``.
    growth : number or str, optional
        The Lipschitz constant of ``f``, positive, 1/time; without it ``f = 0``.
    saturation : number or str, optional
        What the inputs of followers are clipped to, positive, in units of the input.

    Raises
    ------
    ParameterError
        A number is outside its domain, or ``sign_gain`` is below ``speed + disturbance``.

    References
    ----------
    The sliding-mode term is that of protocol (8) of [Zhu]_, with ``e_k`` in place of ``sigma_k``.

    Examples
    --------
    >>> MovingLeaders(speed="0.5", sign_gain=1).total
    Fraction(1, 2)
    >>> MovingLeaders(speed=1, disturbance=1, sign_gain=1)
    Traceback (most recent call last):
    ptcc_certify.errors.ParameterError: sign_gain = 1 is below speed + disturbance = 2, which pushes followers off; \
give 2 or more
    """

    section: ClassVar = "leaders"
    speed: NotNegative = option(
        "--leader-speed V",
        "Leaders move, as fast as V: how followers track them.",
        NotNegative(0),
        example="0.5",
        unit="state/time",
    )
    disturbance: NotNegative = NotNegative(0)
    sign_gain: Given = option(
        "--sign-gain MU",
        "With --leader-speed: followers add MU sign(e_k), and stay on their targets.",
        Given(),
        unit="state/time",
    )
    growth: Given = option(
        "--growth L",
        "Agents move by themselves, too: x' = f(x) + u, any odd f of slopes up to L.",
        Given(),
        example="0.3",
        unit="1/time",
    )
    saturation: Given = option(
        "--saturation U",
        "Nominal: inputs are clipped to [-U, U].",
        Given(),
        key="limits.saturation",
        example="10",
        unit="state/time",
    )

    def __post_init__(self) -> None:
        if self.sign_gain is not None and self.sign_gain < self.total:
            total = near(self.total)
            raise ParameterError(
                "sign_gain",
                f"= {near(self.sign_gain)} is below speed + disturbance = {total}, which pushes "
                f"followers off; give {total} or more",
            )

    @property
    def moving(self) -> bool:
        """Whether leaders move, as they like or by themselves."""
        return bool(self.speed or self.growth)

    @property
    def while_told(self) -> str:
        """During what something holds or not: while they move, under disturbances, or under a cap alone."""
        if self.moving:
            return "while leaders move" if self.speed else "while agents move by themselves"
        if self.saturation:
            return "of inputs that are clipped"
        return "under disturbances" if self.disturbance else "under a cap"

    @property
    def goal(self) -> str:
        """Where followers are drawn to: a target, or where leaders rest and nothing disturbs a final state."""
        return "target" if self.total or self.growth else "final state"

    @property
    def idle(self) -> bool:
        """Whether leaders rest, and nothing moves, disturbs or limits anybody."""
        return not (self.total or self.growth or self.saturation or self.sign_gain is not None)

    @property
    def asked(self) -> str:
        """What is asked, in words: that leaders move, disturbances and so on, or a cap alone."""
        given: dict[str, Any] = {"leaders that move": self.speed, "disturbances": self.disturbance}
        given |= {"inputs that are clipped": self.saturation, "agents that move by themselves": self.growth}
        return next((name for name, there in given.items() if there), "a gain cap")

    @property
    def clipped(self) -> bool:
        """Whether inputs are clipped, and nothing else is asked."""
        return self.saturation is not None and not (self.total or self.growth or self.sign_gain)

    @property
    def total(self) -> Fraction:
        """``speed + disturbance``: how fast a follower and its target may part."""
        return self.speed + self.disturbance
