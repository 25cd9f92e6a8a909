"""What is asked of a certificate: how it is searched, for which initial states, and what is expected of it."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Any, ClassVar

from ptcc_certify.errors import ParameterError, gated
from ptcc_certify.graphs.declared_option import option
from ptcc_certify.graphs.rationals import shorten
from ptcc_certify.model.parameters import parameter

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
