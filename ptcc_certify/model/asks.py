"""What is asked: of which graph and protocol, from which states, under which limits, how, and what is expected."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import TYPE_CHECKING, Any, ClassVar

from ptcc_certify.checker.input_formulas import Limits
from ptcc_certify.errors import ParameterError, gated
from ptcc_certify.graphs.declared_option import option
from ptcc_certify.graphs.rationals import shorten
from ptcc_certify.model.agents import Agents
from ptcc_certify.model.base import Protocol
from ptcc_certify.model.constrained_switching import SignalClass
from ptcc_certify.model.late_messages import LateMessages, MovingLeaders, told_leaders
from ptcc_certify.model.parameters import Given, Parameters, parameter

if TYPE_CHECKING:
    from ptcc_certify.model.gain import Gain
    from ptcc_certify.model.limited_gain import LimitedGain


@gated
@dataclass(frozen=True, repr=False)
class GainLimits(Parameters, Limits):
    """What an actuator leaves of a gain: a cap, switch-off, zero-order hold; None for what it does not.

    Parameters
    ----------
    gain_cap : int, float, str or Fraction, optional
        Positive: the gain is at most this; 1/time/weight.
    stop_before : int, float, str or Fraction, optional
        Positive and below ``T``, in units of time: the input is 0 from ``T - stop_before`` on, for ever.
    sample_period : int, float, str or Fraction, optional
        Positive, in units of time: gain and input change at its multiples only, and at ``T - stop_before`` or ``T``.

    Raises
    ------
    ParameterError
        Names the parameter, its value and its domain.

    References
    ----------
    These limit the gain of the protocol (4) of [Zhu]_.

    Examples
    --------
    >>> from ptcc_certify.model.gain import Gain
    >>> limits = GainLimits(gain_cap=11, stop_before="0.01")
    >>> limits
    GainLimits(gain_cap=11, stop_before=1/100)
    >>> limits.limit(Gain(T=1, rho1=1, rho2=1, kappa=1)).value([0, 0.9, 0.95, 0.99])
    array([ 2., 11., 11.,  0.])
    """

    section: ClassVar = "limits"
    gain_cap: Given = option("--gain-cap G", "Nominal: the gain is at most G.", Given(), example="100")
    stop_before: Given = option(
        "--stop-before EPS", "Nominal: the input is 0 from T - EPS on.", Given(), example="0.01", unit="time"
    )
    sample_period: Given = option(
        "--sample-period H", "Nominal: gain and input are held over periods H.", Given(), example="0.001", unit="time"
    )

    @property
    def ideal(self) -> bool:
        """Whether it limits nothing."""
        return not self.parameters

    def limit(self, gain: Gain) -> LimitedGain:
        """Return what these limits leave of a gain.

        Parameters
        ----------
        gain : Gain
            Of the protocol.

        Returns
        -------
        LimitedGain

        Raises
        ------
        ParameterError
            ``stop_before`` is not below ``T``, or a limit acts only where ``1 - t/T`` is below 1e-300.
        """
        from ptcc_certify.model.limited_gain import LimitedGain

        return LimitedGain(gain, self)


#: Which Lyapunov functions are searched; see :mod:`ptcc_certify.lyapunov.search`.
METHODS = ("paper", "perron", "lmi", "full", "best")


@gated
@dataclass(frozen=True)
class Expectations:
    """What is expected of a certificate.

    Attributes
    ----------
    behaviour : str or None
        As :attr:`ptcc_certify.theorems.claims.Claim.behaviour` or one of its special cases.
    min_rate : Fraction or None
        A proved rate of at least so much, per unit of the stretched clock.
    max_input : Fraction or None
        A proved peak of every ``|u_k|`` of at most so much, in units of the input.
    max_residual : Fraction or None
        With late messages: every agent proved within so much of its final state at ``T``.

    Raises
    ------
    ParameterError
        No behaviour is called so, or a number is negative.

    References
    ----------
    Theorems 1 to 6 of [Zhu]_ say which behaviour follows.

    Examples
    --------
    >>> pair = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])
    >>> protocol = NominalProtocol(T=1, rho1=1, rho2=2, kappa=1)
    >>> asked = Expectations("bipartite consensus", min_rate=Fraction(5))
    >>> print(certify(pair, protocol, asks=Asks(expectations=asked)).assessment.text)
    refuted: rate >= 5 (upper bound 4, proved); met: bipartite consensus; the rest is certified
    """

    section: ClassVar = "expectations"
    behaviour: str | None = option(
        "--expect BEHAVIOUR",
        "Such as bipartite-consensus; exit code 3 if refuted.",
        example='"bipartite-consensus"',
        kind="text",
    )
    min_rate: Fraction | None = option(
        "--min-rate R", "Ask for a proved decay rate of at least R per unit of the stretched clock.", unit="1/clock"
    )
    max_input: Fraction | None = option(
        "--max-input U", "Ask for a proved peak of every |u_k| of at most U.", example="100", unit="input"
    )
    max_residual: Fraction | None = option(
        "--max-residual R",
        "With late messages: ask for every agent within R of its final state at T.",
        example="0.05",
        unit="state",
    )

    def __post_init__(self) -> None:
        from ptcc_certify.graphs.structure import behaviour_name  # which loads NumPy

        try:
            behaviour = None if self.behaviour is None else behaviour_name(str(self.behaviour))
        except ValueError as error:
            raise ParameterError(f"expected behaviour: {error}") from None
        object.__setattr__(self, "behaviour", behaviour)
        for name in ("min_rate", "max_input", "max_residual"):
            if (value := getattr(self, name)) is not None:
                object.__setattr__(self, name, parameter(name, value, zero_allowed=True))


def read_expectations(expected: Any) -> Expectations:
    """Return what is expected; a text names a behaviour.

    Examples
    --------
    >>> read_expectations("bipartite-consensus").behaviour
    'bipartite consensus'
    """
    if expected is None or isinstance(expected, str):
        return Expectations(expected)
    if not isinstance(expected, Expectations):
        raise ParameterError(
            "expectations", f"= {shorten(repr(expected))} is none; give Expectations('stability'), say"
        )
    return expected


@gated
@dataclass(frozen=True, kw_only=True)
class Asks:
    """What is asked of a certificate beside the claim.

    Parameters
    ----------
    method : {"best", "paper", "perron", "lmi", "full"}
        Which Lyapunov functions are searched beside the paper's; see :mod:`ptcc_certify.lyapunov.search`.
    at : number, optional
        An instant before the deadline, in units of time, at which the bound should be smallest.
    initial_set : InitialSet or positive number, optional
        The set of initial states for which the input is bounded, instead of the initial state alone; a number ``R``
        stands for ``||X(0)||_inf <= R``.
    delta : number, optional
        Nominal protocol: bound of the disturbances ``|d_k|`` whose effect is bounded, in units of the input;
        where messages are late or leaders move, in what is bounded of these.
    noise : number, optional
        Nominal protocol: bound of the measurement noise ``|n_k|``, ``u = -gain L (X + n)``, whose effect is bounded
        under each limit of the gain but sampling. Noise times an infinite gain is bounded by nothing. Where messages
        are late or leaders move it is an error of values of twice this.
    disturbance : Disturbance, str, number, callable or sequence, optional
        Sliding mode: what the simulated run meets; see :func:`ptcc_certify.simulation.run.simulate`.
    simulation : bool, optional
        Whether to compare the proved bound with a CVODES run; by default up to 10,000 agents.
    time_limit : float, optional
        Seconds of wall time. Simulation and searches may take 40 % together, each its share of what is left; what is
        proved by then stands and is checked, and ``cut_off`` names what was ended. Without it they have 60 s, and 1 s
        more for every 1,000 nodes, of work: what is found then does not depend on how busy the machine is.
    expectations : Expectations or str, optional
        A behaviour (a text names one), a rate, a bound of the input. It decides nothing but the ``assessment``.

    Raises
    ------
    ParameterError
        The method is unknown, or the expectations are none.

    Examples
    --------
    >>> pair, p = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)]), NominalProtocol(T=1, rho1=1, rho2=2, kappa=1)
    >>> certify(pair, p, asks=Asks(method="perron", expectations="bipartite-consensus")).assessment.asked
    'met'
    """

    section: ClassVar = "certificate"
    method: str = option(
        "--method",
        "Lyapunov functions searched beside the paper's.",
        default="best",
        example='"best"',
        choices=("best", *METHODS[:-1]),
    )
    at: Any = option(
        "--at t", "Optimise the bound at this instant, and print it; -v: for every agent.", example="0.5", unit="time"
    )
    initial_set: Any = option(
        "--initial-bound R",
        "Bound the input for all initial states within |x_k(0)| <= R, not --x0.",
        key="initial_state.initial_bound",
        example="10",
        unit="state",
    )
    delta: Any = None
    noise: Any = option(
        "--noise NU",
        "Nominal: measurement noise |n_k| <= NU, under a limit or with late messages.",
        key="disturbance.noise",
        example="0.01",
        unit="state",
    )
    disturbance: Any = option(
        "--disturbance EXPR",
        "Of the simulated run: an expression of k and t, worst-case (sliding mode), telegraph or none.",
        key="disturbance.signal",
        example='"worst-case"',
        kind="text",
        shown="worst-case",
    )
    simulation: bool | None = option(
        "--simulation/--no-simulation", "Compare with a CVODES run.", example="true", shown="up to 10,000 agents"
    )
    time_limit: float | None = option(
        "--time-limit SECONDS",
        "Of wall time, for simulation and searches of a graph together, not for decisions and checks; near it what is "
        "found may differ from run to run.",
        example="60",
        kind="float",
        shown="the work of 60 s, and of 1 s more for every 1,000 nodes, which does not depend on how busy the machine "
        "is",
    )
    expectations: Any = None

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise ParameterError(f'method "{shorten(str(self.method))}" is unknown; one of {", ".join(METHODS)}')
        object.__setattr__(self, "expectations", read_expectations(self.expectations))


@gated
@dataclass(frozen=True)
class InitialState:
    """Where the agents begin, where their states alone do not tell it.

    Parameters
    ----------
    x0 : state-like, optional
        The initial state, in node order, or by label where there are labels: whatever :func:`ptcc_certify.as_state`
        takes; of agents of order n N rows of coordinates, too.
    sigma0 : state-like, optional
        Sliding mode: ``sigma(0)``, like ``x0``; without it 0, which leaves no reaching phase.
    v0 : state-like, optional
        Of agents of order n: initial velocities, like ``x0``; without them 0.
    derivatives : sequence of state-like, optional
        Instead of ``v0``: velocities, accelerations and so on.

    Examples
    --------
    >>> pair = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])
    >>> robust = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=2, mu1=2, mu2=1, mu3=1, delta=1)
    >>> certify(pair, robust, InitialState([3, 5], sigma0=[1, 0])).final_state
    FinalState(1=-1.5, 2=1.5)
    """

    section: ClassVar = "initial_state"
    x0: Any = option("--x0 STATE", "Initial state: 5,2,-4 | label=value,... | FILE.csv | random", example='"random"')
    sigma0: Any = option(
        "--sigma0 STATE", "Sliding mode: like --x0; 0 leaves no reaching phase.", example="0", shown="0"
    )
    v0: Any = option("--v0 STATE", "Agents: initial velocities, like --x0.", key="agents.v0", example='"0"', shown="0")
    derivatives: Any = None


@dataclass(frozen=True, kw_only=True)
class Run:
    """What is chosen of a run beside the motion; see :func:`ptcc_certify.simulate`."""

    section: ClassVar = "simulation"
    samples: int = option(
        "--samples", "Instants up to T, dense towards it.", default=201, example="201", least=2, most=100_000
    )
    steps: int | None = option(
        "--steps", "Instead: so many equal steps of t from 0 to T.", example="100", least=1, most=100_000
    )
    boundary_layer: float | None = option(
        "--boundary-layer W", "Sliding mode: tanh(sigma/W) for the sign, to compare.", example="0.01", kind="float"
    )
    pattern: str = option(
        "--pattern",
        "With late messages: as old as allowed, fresh, between the two, or now this, now that (with --seed).",
        default="oldest",
        name="age_pattern",
        example='"oldest"',
        choices=("oldest", "fresh", "varying", "square"),
    )
    seed: int = option(
        "--seed", "Seed of random initial states.", default=0, key="initial_state.seed", example="0", least=0
    )


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
