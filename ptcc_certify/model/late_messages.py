"""Messages that arrive late, get lost, or are rounded: what agents hear of each other, and how old it is.

    x_k'(t) = -gain(t) sum_l w_kl (sign(w_kl) x_k(t) - y_kl(t)),    |y_kl(t) - x_l(t - tau_kl(t))| <= value_error,

``0 <= tau_kl(t) <= age``. A value is sent every ``period``, of which at most ``losses`` in a row get lost; the last one
that came is held, so that what is heard is at most ``delay + (losses + 1) period`` old.

Leaders that move: how fast, what disturbs the followers, and the sign term that keeps them on their targets.

x_j' = f(t, x_j) + v_j,  |v_j| <= speed                                  a leader, which listens to nobody
x_k' = f(t, x_k) - gain(t) (L x)_k + d_k [ + sign_gain sign(e_k) ],      a follower, |d_k| <= disturbance,  e = -L x

``f`` is what every agent does by itself: 0, or anything with ``|f(t, x) - f(t, y)| <= growth |x - y|`` that is odd in
``x``, which nobody need know.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from numbers import Integral
from typing import TYPE_CHECKING, Any, ClassVar

from lmi.exact.decimal_rounding import near
from ptcc_certify.errors import ParameterError, gated
from ptcc_certify.graphs.declared_option import option
from ptcc_certify.graphs.rationals import Exact, shorten
from ptcc_certify.model.parameters import Given, NotNegative, Parameters, parameter, readable

if TYPE_CHECKING:
    from ptcc_certify.graphs.digraph import SignedDigraph
    from ptcc_certify.graphs.family import Family
    from ptcc_certify.graphs.structure import Structure
    from ptcc_certify.model.virtual_positions import Vehicles


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


#: Most losses in a row.
MOST_LOSSES = 10**6


@gated
@dataclass(frozen=True)
class LateMessages:
    """How late and how exact is what agents hear.

    Parameters
    ----------
    delay : number or str, or mapping of (source, target) to number
        What every message takes, or that over each edge by itself, in units of time, not negative. Over an edge that
        a mapping does not name messages take no time.
    period : number or str, optional
        Between two messages, positive, in units of time; without it messages are sent all the time.
    losses : int
        Messages in a row that may get lost; asks for a ``period``.
    value_error : number or str
        What a value that is heard is off by at most, in units of the state: half the step of a quantiser, the
        threshold of an event trigger, noise.
    own_delay : bool
        Whether the own state is as old as what is heard: a relative position that is measured late.
    gain_cap : number or str, optional
        The gain is at most this, 1/time/weight; ``own_delay`` asks for it.
    vehicles : Vehicles, optional
        Of order 2 or 3, that exchange virtual states, and track these; then nothing need be late, lost or rounded.
    leaders : MovingLeaders, optional
        Of which these are heard, and what disturbs their followers; then nothing need be late, lost or rounded, either.

    Raises
    ------
    ParameterError
        A number is outside its domain, losses without a period, an own state that is late without a cap of the gain,
        or nothing is late, lost or rounded.

    References
    ----------
    Feyzmahdavian, Charalambous, Johansson, Exponential stability of homogeneous positive systems of degree one with
    time-varying delays, IEEE Trans. Automat. Control 59 (2014).

    Examples
    --------
    >>> messages = LateMessages(delay="0.01", period="0.005", losses=3)
    >>> messages.age
    Fraction(3, 100)
    >>> LateMessages(delay=1, own_delay=True)
    Traceback (most recent call last):
    ptcc_certify.errors.ParameterError: an own state that is late makes the protocol diverge, for its gain grows \
without limit before T; add a gain_cap, below (pi/2 - |arg lambda|)/(delay |lambda|) for all nonzero eigenvalues \
lambda of L, or measure the own state without delay
    """

    section: ClassVar = "messages"
    delay: Exact | Mapping[tuple[str, str], Exact] = option(
        "--delay D|COLUMN",
        "What agents hear is up to D late; or the column of the edge list that tells the delay of every edge.",
        default=0,
        example="0.02",
        kind="text",
        unit="time",
    )
    period: Given = option(
        "--period H", "Messages are sent every H; the last one that came is held.", Given(), example="0.01"
    )
    losses: int = option(
        "--packet-loss COUNT",
        "Up to so many messages in a row get lost; asks for --period.",
        default=0,
        key="packet_loss",
        example="3",
        least=0,
        most=MOST_LOSSES,
    )
    value_error: NotNegative = option(
        "--quantisation STEP",
        "What is heard is rounded to multiples of STEP.",
        NotNegative(0),
        key="quantisation",
        example="0.1",
    )
    own_delay: bool = option(
        "--own-delay/--no-own-delay",
        "The own state is as late as what is heard; asks for --gain-cap.",
        default=False,
        example="false",
    )
    gain_cap: Given = Given()
    vehicles: Vehicles | None = None
    leaders: MovingLeaders | None = None
    _of_graph: tuple[SignedDigraph | Family, tuple[Fraction, ...]] | None = field(
        default=None, init=False, repr=False, compare=False
    )

    def __post_init__(self) -> None:
        put = object.__setattr__
        if isinstance(self.delay, Mapping):
            put(self, "delay", _read(self.delay))
        else:
            put(self, "delay", parameter("delay", self.delay, True))
        if (
            isinstance(self.losses, bool)
            or not isinstance(self.losses, Integral)
            or not 0 <= self.losses <= MOST_LOSSES
        ):
            raise ParameterError(
                "losses", f"= {shorten(repr(self.losses))} is not a number of messages, 0 to {MOST_LOSSES:,}"
            )
        put(self, "losses", int(self.losses))
        if self.losses and self.period is None:
            raise ParameterError("losses without a period: tell how long it is from one message to the next")
        if not isinstance(self.own_delay, bool):
            raise ParameterError("own_delay", f"= {shorten(repr(self.own_delay))} is neither True nor False")
        if self.own_delay and self.gain_cap is None:
            raise ParameterError(
                "an own state that is late makes the protocol diverge, for its gain grows without limit before T; "
                "add a gain_cap, below (pi/2 - |arg lambda|)/(delay |lambda|) for all nonzero eigenvalues lambda of L, "
                "or measure the own state without delay"
            )
        if self.vehicles is not None and not hasattr(self.vehicles, "v0"):
            what = f"= {shorten(repr(self.vehicles))} are none"
            raise ParameterError("vehicles", f'{what}; ask for Agents(order=2, exchange="virtual") instead')
        if self.exact and self.vehicles is None and self.leaders is None:
            raise ParameterError(
                "messages that are neither late, nor lost, nor rounded; give delay, period or value_error above 0, "
                "or leave messages out"
            )

    @property
    def largest_delay(self) -> Fraction:
        """What a message takes at most, in units of time."""
        each = self.delay.values() if isinstance(self.delay, Mapping) else [self.delay]
        return max((Fraction(x) for x in each), default=Fraction(0))

    @property
    def held(self) -> Fraction:
        """How long a value is held at most, until the next one comes: ``(losses + 1) period``."""
        return Fraction(0) if self.period is None else (self.losses + 1) * self.period

    @property
    def age(self) -> Fraction:
        """How old is what is heard, at most, in units of time: ``largest_delay + held``."""
        return self.largest_delay + self.held

    @property
    def exact(self) -> bool:
        """Whether nothing is late, lost or rounded."""
        return not self.age and not self.value_error

    @property
    def tracks(self) -> bool:
        """Whether nothing is late, lost or rounded, and leaders move or followers are disturbed."""
        return self.exact and self.leaders is not None and self.vehicles is None

    @property
    def flaws(self) -> tuple[str, ...]:
        """What messages are, of "late" and "inexact"; empty where they are neither."""
        return tuple(word for word, size in (("late", self.age), ("inexact", self.value_error)) if size)

    @property
    def name(self) -> str:
        """What they are called: late messages, inexact ones, or both."""
        return f"{' and '.join(self.flaws) or 'late'} messages"

    @property
    def at_rest(self) -> bool:
        """Whether leaders that hear nobody rest, and no sign term acts."""
        return self.leaders is None or (not self.leaders.speed and self.leaders.sign_gain is None)

    @property
    def settles(self) -> bool:
        """Whether nothing moves or disturbs anybody, and no value is off."""
        return not self.value_error and (self.leaders is None or not (self.leaders.total or self.leaders.growth))

    @property
    def asked(self) -> str:
        """What is asked by them, in words: late messages, virtual positions, leaders that move, or a cap alone."""
        if not self.exact:
            return self.name
        return "vehicles that exchange virtual positions" if self.vehicles is not None else self.asked_of_leaders

    @property
    def asked_of_leaders(self) -> str:
        """What is asked by their leaders, in words."""
        return "a gain cap" if self.leaders is None else self.leaders.asked

    def latencies(self, of: SignedDigraph | Family) -> Fraction | tuple[Fraction, ...]:
        """Return what messages take: one number, or one for every ordered pair of an edge, in the order of these.

        Parameters
        ----------
        of : SignedDigraph or Family
            See :func:`ptcc_certify.graphs.family.pairs_of`.

        Raises
        ------
        ParameterError
            A delay is of an edge that the graph does not have.
        """
        if not isinstance(self.delay, Mapping):
            return Fraction(self.delay)
        if self._of_graph is None or self._of_graph[0] is not of:
            object.__setattr__(self, "_of_graph", (of, self._by_edge(of)))
        return self._of_graph[1]  # type: ignore[index]

    def leaders_hear_at_once(self, structure: Structure) -> bool:
        """Tell whether what leaders hear of each other is neither late, nor held, nor off, and no own state is late.

        Parameters
        ----------
        structure : Structure

        Examples
        --------
        >>> pair = analyse(SignedDigraph.from_edges([(1, 2, 1), (2, 1, 1), (2, 3, 1)]))
        >>> LateMessages("0.1").leaders_hear_at_once(pair), LateMessages({(2, 3): "0.1"}).leaders_hear_at_once(pair)
        (False, True)
        """
        if self.own_delay or self.value_error or self.held:
            return False
        latencies, followers = self.latencies(structure.graph), set(structure.followers.tolist())
        each = latencies if isinstance(latencies, tuple) else (latencies,) * structure.graph.n_edges
        return not any(x for x, v in zip(each, structure.graph.target.tolist(), strict=True) if v not in followers)

    def _by_edge(self, of: SignedDigraph | Family) -> tuple[Fraction, ...]:
        from ptcc_certify.graphs.family import pairs_of  # which loads NumPy

        assert isinstance(self.delay, Mapping)
        given: dict[tuple[str, str], Any] = {(str(s), str(t)): x for (s, t), x in self.delay.items()}
        none, found = Fraction(0), [given.pop(pair, None) for pair in pairs_of(of)]
        for source, target in given:
            raise ParameterError(
                f"a delay of {shorten(source)} -> {shorten(target)}, but the graph has no such edge; "
                "(source, target) is the way that information flows"
            )
        return tuple(none if x is None else x for x in found)

    def __repr__(self) -> str:
        fields = [f"delay={readable(self.largest_delay)}"] if self.largest_delay or not self.tracks else []
        if self.period is not None:
            fields.append(f"period={readable(self.period)}, losses={self.losses}")
        if self.value_error:
            fields.append(f"value_error={readable(self.value_error)}")
        if self.own_delay:
            fields.append("own_delay=True")
        if self.gain_cap is not None:
            fields.append(f"gain_cap={readable(self.gain_cap)}")
        if self.leaders is not None:
            fields.append(f"leaders={self.leaders!r}")
        return f"LateMessages({', '.join(fields)})"


def told_leaders(messages: LateMessages | None, leaders: MovingLeaders | None) -> MovingLeaders | None:
    """Return the leaders that are told beside messages or by them.

    Raises
    ------
    ParameterError
        Both tell of leaders, and of others.

    Examples
    --------
    >>> told_leaders(LateMessages("0.1", leaders=MovingLeaders(speed=1)), None)
    MovingLeaders(speed=1, disturbance=0)
    """
    own = None if messages is None else messages.leaders
    if None not in (own, leaders) and own != leaders:
        raise ParameterError("leaders", "is given twice, beside the messages and by them; leave one out")
    return own if leaders is None else leaders


def _read(delays: Mapping[Any, Any]) -> dict[Any, Fraction]:
    """Return delays by edge; each number is read once, for there may be many edges and few delays."""
    known: dict[Any, Fraction] = {}
    return {edge: _known(edge, x, known) for edge, x in delays.items()}


def _known(edge: Any, x: Any, known: dict[Any, Fraction]) -> Fraction:
    name = _of(edge)
    try:
        if (value := known.get((type(x), x))) is None:
            value = known[type(x), x] = Fraction(parameter(name, x, True))
        return value
    except TypeError:  # not hashable, which no number is
        return Fraction(parameter(name, x, True))


def _of(edge: Any) -> str:
    if not isinstance(edge, tuple) or len(edge) != 2:
        raise ParameterError(f"a delay of {shorten(repr(edge))}, which is no edge; name it as (source, target)")
    return f"delay of {shorten(str(edge[0]))} -> {shorten(str(edge[1]))}"
