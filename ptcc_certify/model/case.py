"""What is asked of what: a graph or a family, a protocol, where the agents begin, and all that is told beside."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

from ptcc_certify.checker.input_formulas import Limits
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.rationals import shorten
from ptcc_certify.model.agents import Agents
from ptcc_certify.model.asks import Asks, InitialState
from ptcc_certify.model.base import Protocol
from ptcc_certify.model.constrained_switching import SignalClass
from ptcc_certify.model.gain_limits import GainLimits
from ptcc_certify.model.late_messages import LateMessages, MovingLeaders, told_leaders
from ptcc_certify.model.parameters import parameter


@dataclass(frozen=True, eq=False)
class Case:
    """What is asked of what, as :func:`ptcc_certify.certify` takes it.

    Attributes
    ----------
    graph : graph-like or family-like
    protocol : NominalProtocol or SlidingModeProtocol
    initial : InitialState
        States alone are read as one.
    uncertainty : number or str
        Of every weight, as a share of it; 0 if they are known.
    signal : {"any", "constant"}, DwellTime, JointWindows or ClockShares
    agents : Agents or None
        None for single integrators.
    messages : LateMessages or None
    leaders : MovingLeaders or None
    limits : tuple of Limits
    asks : Asks

    Examples
    --------
    >>> case = Case("fig1a", NominalProtocol(), [1, 2, 3], limits=GainLimits(gain_cap=50))
    >>> case.limits, float(case.given("gain_cap")), case.given("noise")
    ((GainLimits(gain_cap=50),), 50.0, None)
    """

    graph: Any
    protocol: Protocol
    initial: Any = None
    uncertainty: Any = 0
    signal: SignalClass = "any"
    agents: Agents | None = None
    messages: LateMessages | None = None
    leaders: MovingLeaders | None = None
    limits: Any = ()
    asks: Any = None

    def __post_init__(self) -> None:
        initial = self.initial if isinstance(self.initial, InitialState) else InitialState(self.initial)
        limits = () if self.limits is None else self.limits
        limits = tuple(limits) if isinstance(limits, Iterable) and not isinstance(limits, str) else (limits,)
        asks = Asks() if self.asks is None else self.asks
        for name, value in {"initial": initial, "limits": limits, "asks": asks}.items():
            object.__setattr__(self, name, value)
        for name, kind, example in (
            ("asks", Asks, 'method="perron"'),
            ("agents", Agents, "order=2"),
            ("messages", LateMessages, "delay='0.01'"),
            ("leaders", MovingLeaders, "speed=1"),
        ):
            if (value := getattr(self, name)) is not None and not isinstance(value, kind):
                mend = f"give {kind.__name__}({example}), say"
                raise ParameterError(name, f"= {shorten(repr(value))} is none; {mend}")
        object.__setattr__(self, "leaders", told_leaders(self.messages, self.leaders))
        for entry in limits:
            if not isinstance(entry, Limits):
                raise ParameterError(f"limits holds {shorten(repr(entry))}; give GainLimits(gain_cap=50), say")

    @property
    def sliding(self) -> bool:
        """Whether sliding variables reach 0 before the nominal phase."""
        return getattr(self.protocol, "reaching", None) is not None

    def given(self, name: str) -> Any:
        """Return what is given by a name: of the case, of what is asked, of where agents begin, or of a limit."""
        for holder in (self, self.asks, self.initial):
            if hasattr(holder, name):
                value = getattr(holder, name)
                return None if isinstance(value, tuple) and not value else value
        return next((value for limit in self.limits if (value := getattr(limit, name, None)) is not None), None)

    def with_plain_agents(self, of_family: bool = False) -> Case:
        """Return the case without agents that are the paper's; a cap of their gain is one of the limits then.

        Of a family a formation stays, without its cap. Under the sliding-mode protocol limits of the gain are those of
        agents of order n alone.
        """
        agents = self.agents
        if not isinstance(agents, Agents) or not (agents.plain or (of_family and agents.of_paper)):
            return self
        rest = None if agents.plain else replace(agents, gain_cap=None)
        if agents.cap is None:
            return replace(self, agents=rest)
        return self if self.sliding else replace(self, agents=rest, limits=self.limits_with(agents))

    def with_rows(self, of_family: bool = False) -> Case:
        """Return the case with all that is asked beside late messages and moving leaders told as part of these.

        Disturbances are those of the followers of leaders, which may rest; noise within NU is an error of values of 2
        NU; what moves or disturbs is told by messages, of which nothing need be late then. Of one graph both are judged
        otherwise where neither messages are late nor leaders move.

        Examples
        --------
        >>> noisy = Asks(noise="0.1", delta=1)
        >>> case = Case("fig1a", NominalProtocol(), messages=LateMessages("0.01"), asks=noisy).with_rows()
        >>> case.messages, case.leaders, case.asks.noise, case.asks.delta
        (LateMessages(delay=1/100, value_error=1/5, leaders=MovingLeaders(speed=0, disturbance=1)), \
MovingLeaders(speed=0, disturbance=1), None, None)
        """
        messages, leaders, asks = self.messages, self.leaders, self.asks
        of_order_n = isinstance(self.agents, Agents) and not self.agents.of_paper  # who take neither, and are refused
        limits, cap, error = self.limits, self._only_cap, Fraction(0)
        more = of_family and (asks.delta is not None or asks.noise is not None or cap is not None)
        if not (messages is not None or leaders is not None or more) or self.sliding or of_order_n:
            return self
        if asks.delta is not None and (leaders is None or not leaders.disturbance):
            disturbance, asks = parameter("delta", asks.delta, True), replace(asks, delta=None)
            leaders = replace(leaders or MovingLeaders(speed=0), disturbance=disturbance)
        if leaders is not None and leaders.idle:
            leaders = None  # they rest, and nothing disturbs anybody
        if asks.noise is not None and (messages is not None or leaders is not None or of_family):
            error, asks = 2 * parameter("noise", asks.noise), replace(asks, noise=None)
        if of_family and cap is not None and messages is None and leaders is None and not error:
            leaders = MovingLeaders(speed=0)  # whom followers settle behind, but for what a cap leaves
        if messages is None and ((leaders is None and not error) or (limits and cap is None)):
            return replace(self, leaders=leaders, asks=asks)  # nothing is left to tell, or limits that are refused
        if messages is None:
            messages = LateMessages(value_error=error, leaders=leaders)
        else:
            messages = replace(messages, value_error=messages.value_error + error, leaders=leaders)
        if cap is not None and (messages.gain_cap is None or (of_family and messages.gain_cap == cap)):
            messages, limits = replace(messages, gain_cap=cap), ()
        return replace(self, messages=messages, leaders=leaders, asks=asks, limits=limits)

    @property
    def _only_cap(self) -> Fraction | None:
        """The cap that all limits of the gain are, if there is one, and they are nothing else."""
        caps = {entry.gain_cap for entry in self.limits}
        alone = all(entry.stop_before is None and entry.sample_period is None for entry in self.limits)
        return next(iter(caps)) if alone and len(caps) == 1 else None

    def limits_with(self, agents: Agents) -> tuple[Limits, ...]:
        """Return the limits of the gain with the cap of agents, if they have one."""
        if agents.cap is None or (own := GainLimits(gain_cap=agents.cap)) in self.limits:
            return tuple(self.limits)
        return own, *self.limits
