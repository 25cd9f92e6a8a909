"""Signals that are restricted: a dwell time between switches, windows of the clock, shares of it.

What is claimed for every signal holds for these, too. They give more: a larger rate where modes change seldom, an end
where the members have different states at rest (docs/theory/families.md, "Restricted signals").
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, ClassVar

from ptcc_certify.errors import ParameterError, gated
from ptcc_certify.graphs.declared_option import Option, option
from ptcc_certify.graphs.rationals import shorten
from ptcc_certify.model.parameters import parameter, readable

#: What a dwell time of the clock is called.
CLOCK_DWELL = Option(
    flag="--clock-dwell TAU",
    help="Families, nominal: the same on the stretched clock, which is infinite at T.",
    key="graph.clock_dwell",
    example='"0.1"',
    unit="clock",
)
#: ``t`` is the user's time, ``s`` the stretched clock.
CLOCKS = ("t", "s")
#: Why windows of time are refused.
WINDOWS_OF_TIME = (
    "windows of time prove nothing at T: in the last one, the graph of the last instants acts for infinite clock, and "
    "must do it alone; give windows of the stretched clock"
)


@gated
@dataclass(frozen=True, repr=False)
class DwellTime:
    """Signals that keep each mode for at least ``least`` between two switches; weights may change in their intervals.

    Attributes
    ----------
    least : Fraction
        Positive, in units of ``clock``.
    clock : {"t", "s"}
        Time, or the stretched clock. A dwell in ``t`` allows finitely many switches before ``T``, one on the clock
        ``s`` infinitely many.

    Raises
    ------
    ParameterError
        It is not positive, or of another clock.

    References
    ----------
    docs/theory/families.md, "Dwell times".

    Examples
    --------
    >>> DwellTime("0.3").switches(Fraction(1))
    4
    """

    section: ClassVar = "graph"
    least: Fraction = option(
        "--dwell THETA",
        "Families, nominal: at least so much time between switches; claim more for these.",
        required=True,
        key="dwell",
        example='"0.1"',
        unit="time",
    )
    clock: str = "t"

    def __post_init__(self) -> None:
        object.__setattr__(self, "least", parameter("dwell", self.least))
        if self.clock not in CLOCKS:
            raise ParameterError(
                f'a dwell time is of time, "t", or of the clock, "s", not "{shorten(str(self.clock))}"'
            )

    def switches(self, length: Fraction) -> int:
        """Return how many switches there can be within an open interval of ``length``, in units of the clock.

        Parameters
        ----------
        length : Fraction
        """
        return math.ceil(length / self.least)

    def __repr__(self) -> str:
        return f"DwellTime({readable(self.least)}, clock={self.clock!r})"


@gated
@dataclass(frozen=True, repr=False)
class JointWindows:
    """Signals that turn every edge on for ``on`` or more of every window ``[j length, (j+1) length]`` of the clock.

    That is every edge that is mandatory in some mode: such modes act for so long, together. No mode need be connected.

    Attributes
    ----------
    length, on : Fraction
        In units of the stretched clock; ``on`` is at most ``length``.
    clock : {"s"}
        Windows of time are refused: inside the last one the graph of the last instants acts for infinite clock.

    Raises
    ------
    ParameterError
        A number is not positive, ``on`` is longer than a window, or these are not of the clock.

    References
    ----------
    docs/theory/families.md, "Joint windows".

    Examples
    --------
    >>> JointWindows(2, on="0.5", clock="s")
    JointWindows(2, on=0.5, clock='s')
    """

    section: ClassVar = "graph"
    length: Fraction = option(
        "--clock-window H",
        "Families, nominal: the length of windows of stretched clock; every edge is on in each.",
        required=True,
        key="clock_window",
        example='"2"',
        unit="clock",
    )
    on: Fraction = option(
        "--window-on DELTA",
        "Families: for how much of every window an edge is on, at least.",
        required=True,
        key="window_on",
        example='"0.5"',
        unit="clock",
    )
    clock: str = "s"

    def __post_init__(self) -> None:
        object.__setattr__(self, "length", parameter("window", self.length))
        object.__setattr__(self, "on", parameter("on", self.on))
        if self.clock == "t":
            raise ParameterError(WINDOWS_OF_TIME)
        if self.clock != "s":
            raise ParameterError(f'windows are of the stretched clock, "s", not "{shorten(str(self.clock))}"')
        if self.on > self.length:
            raise ParameterError("an edge is on for at most the whole window: on <= length")

    def __repr__(self) -> str:
        return f"JointWindows({readable(self.length)}, on={readable(self.on)}, clock={self.clock!r})"


@gated
@dataclass(frozen=True, repr=False)
class ClockShares:
    """Signals under which each mode has a share of the stretched clock: ``s_i`` stays near ``shares_i s``.

    That is ``|s_i - shares_i s| <= c`` for some number ``c``, where ``s_i`` is the clock that mode ``i`` has had until
    ``s``. A mode may be an outage, without edges.

    Attributes
    ----------
    shares : tuple of Fraction
        One of each mode; their sum is 1. Texts may be percentages, "75%".

    Raises
    ------
    ParameterError
        A share is negative, or their sum is not 1.

    References
    ----------
    docs/theory/families.md, "Shares of the clock".

    Examples
    --------
    >>> ClockShares(["0.75", "0.25"])
    ClockShares(0.75, 0.25)
    """

    section: ClassVar = "graph"
    shares: tuple[Fraction, ...] = option(
        "--share NU",
        "Families, nominal: the share of the stretched clock that a mode acts, an outage too; one for each graph.",
        required=True,
        key="share",
        example='["0.7", "0.3"]',
        kind="text",
        many=True,
    )

    def __post_init__(self) -> None:
        shares = tuple(_share(share) for share in self.shares)
        object.__setattr__(self, "shares", shares)
        if sum(shares) != 1:
            raise ParameterError(
                f"shares of the clock sum to {readable(sum(shares, Fraction(0)))}; give one for each mode, 1 in all"
            )

    def __repr__(self) -> str:
        return f"ClockShares({', '.join(map(readable, self.shares))})"


def _share(value: Any) -> Fraction:
    """Return a share of the clock: ``0.75`` or ``"75%"``."""
    percent = isinstance(value, str) and value.strip().endswith("%")
    number = parameter("share", value.strip()[:-1] if percent else value, zero_allowed=True)
    return number / 100 if percent else number


#: What a certificate may be asked for: all signals, constant ones, or restricted ones.
SignalClass = str | DwellTime | JointWindows | ClockShares


def read_signal(signal: Any) -> SignalClass:
    """Return the signals that are meant, or refuse them.

    Raises
    ------
    ParameterError
        No signals are called so.

    Examples
    --------
    >>> read_signal("constant")
    'constant'
    """
    if isinstance(signal, DwellTime | JointWindows | ClockShares) or signal in ("any", "constant"):
        return signal
    more = 'signals are "any", "constant", DwellTime(..), JointWindows(..) or ClockShares(..)'
    raise ParameterError(f"{more}, not {shorten(repr(signal))}")
