"""What every certificate of agents of order n says, whatever their protocol: where they end, and how near."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

from lmi.exact.decimal_rounding import down, float_up, near, up
from lmi.exact.elementary_enclosures import sqrt
from ptcc_certify.bounds.agents.cascade import Values
from ptcc_certify.bounds.agents.common_motion import Interval
from ptcc_certify.bounds.agents.each_agent import States, error_constants, first_inputs, scaled_states
from ptcc_certify.bounds.agents.run_against_bounds import AgentsComparison
from ptcc_certify.bounds.final_state.enclosed_ends import agents_ends, weighted_sum
from ptcc_certify.bounds.final_state.of_graph import Influence, NotEnclosedError
from ptcc_certify.bounds.float_conversion import fractions
from ptcc_certify.certificate.assessment import MET, OPEN, REFUTED, Answer
from ptcc_certify.checker.agent_bounds import AgentsInput
from ptcc_certify.checker.agent_cascade import CascadeSection
from ptcc_certify.checker.agents import AgentsSection
from ptcc_certify.checker.side_files import Numbers
from ptcc_certify.errors import Change, ParameterError, Sentence
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.lyapunov.function import LyapunovFunction
from ptcc_certify.model.agents_protocol import AgentsProtocol
from ptcc_certify.simulation.agents import AgentsTrajectory, simulate_agents
from ptcc_certify.theorems.matrix_for_order_n import Phase
from ptcc_certify.theorems.theorem import Obligation

Intervals = tuple[tuple[tuple[Interval, ...], ...], ...]


@dataclass(frozen=True)
class UsedFunction:
    """A Lyapunov function of the graph that is used: its number, and the input constants of a full matrix."""

    number: int
    inputs: tuple[Fraction, ...] | None


@dataclass(frozen=True)
class Residual:
    """What is left at ``T`` under a bounded gain: of each agent, of its position, velocity and so on."""

    clock: Fraction
    agents: tuple[tuple[Fraction, ...], ...]


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class AgentsAnswer(ABC):
    """What is proved of agents of order n.

    Attributes
    ----------
    structure : Structure
    protocol : AgentsProtocol
        As the agents run it.
    used : tuple of UsedFunction
    functions : tuple of LyapunovFunction
        Those that are used.
    initial_state : N tuples of d tuples of n Fraction, or None
        Position, velocity and so on of every agent in every coordinate.
    motion : n by n intervals
        ``M``: the common motion from 0 to ``T``.
    final_state : like initial_state, with intervals, or None
        Fewer derivatives where not all of them are proved to agree.
    residual : Residual or None
        What a bounded gain leaves at ``T``.
    input : tuple of N Fraction, or None
        Bounds of the Euclidean norm of every agent's input.
    phases : tuple of Phase
        Faster decrease of single functions, nearer to the deadline.
    instants : tuple of tuples of Fraction or None
        What functions used are worth at most at ``1 - t/T = 1/2, 1/4, ..``.
    """

    structure: Structure
    protocol: AgentsProtocol
    used: tuple[UsedFunction, ...]
    functions: tuple[LyapunovFunction, ...]
    initial_state: States | None
    motion: tuple[tuple[Interval, ...], ...]
    final_state: Intervals | None = None
    residual: Residual | None = None
    input: tuple[Fraction, ...] | None = None
    phases: tuple[Phase, ...] = ()
    instants: tuple[Values, ...] = ()

    @property
    def order(self) -> int:
        """``n``."""
        return self.protocol.order

    @property
    def dimension(self) -> int:
        """``d``, the coordinates of space."""
        return len(self.protocol.offsets[0])

    @property
    def norm(self) -> str:
        """What bounds of the input are of, in signs."""
        return "|u_k|" if self.dimension == 1 else "||u_k||"

    @property
    def formation(self) -> bool:
        """Whether an agent has a place other than 0."""
        return any(any(row) for row in self.protocol.offsets)

    @property
    def settled(self) -> int:
        """Of how many derivatives, the position the first of them, final values are proved."""
        return 0 if self.final_state is None else len(self.final_state[0][0])

    @property
    def derivatives_agree(self) -> bool:
        """Whether all derivatives are proved to agree at ``T`` where positions are."""
        return True

    @property
    def moving(self) -> bool:
        """Whether some derivative of a final state is not 0."""
        return any(m or r for agent in self.final_state or () for chain in agent for m, r in chain[1:])

    @property
    def begins_moving(self) -> bool:
        """Whether some initial velocity is not 0."""
        return any(chain[1] for agent in self.initial_state or () for chain in agent)

    @property
    def longest_way(self) -> float:
        """The longest way of an agent from its initial to its final position (numerical); 0 without a final state."""
        begin, end = self.initial_state or (), self.final_state or ()
        ways = (
            math.hypot(*(float(x[0] - m[0][0]) for x, m in zip(agent, place, strict=True)))
            for agent, place in zip(begin, end, strict=False)
        )
        return max(ways, default=0.0)

    # ------------------------------------------------------------------ input

    @cached_property
    def error_constants(self) -> tuple[tuple[Fraction, ...] | None, ...]:
        """``c_k^E`` of every function used."""
        pairs = zip(self.used, self.functions, strict=True)
        return tuple(one.inputs if V.matrix is not None else error_constants(self.structure, V) for one, V in pairs)

    @property
    def sliding_terms(self) -> Fraction:
        """What the sliding terms add to an input at most."""
        reaching = self.protocol.base.reaching
        return Fraction(0) if reaching is None else reaching.mu1 * self.dimension

    @property
    def alone(self) -> bool:
        """Whether no agent listens to another."""
        return not self.structure.graph.n_edges

    @property
    def least_rest(self) -> Fraction:
        """What ``alpha`` is at least if ``eta e^(-alpha s - a_2 t)``, the pace of the own velocity, does not grow."""
        gain = self.protocol.gain
        return 1 / gain.pole + max(Fraction(0), -self.protocol.plant[1]) / gain.first

    @property
    def grows(self) -> bool:
        """Whether the input of agents alone grows without limit: some move, and ``alpha rho2 kappa < 1``."""
        if not self.alone or not any(self.protocol.own):
            return False
        return self.begins_moving and self.protocol.own[1] * self.protocol.gain.pole < 1

    @cached_property
    def inputs(self) -> tuple[Fraction, ...] | None:
        """Bounds of the Euclidean norm of every agent's input; of agents alone, too, where :attr:`input` has none.

        Agents alone feel ``a_1 h_k``, their sliding terms, and ``-alpha eta`` times their own velocity, which is
        largest at first unless it grows.
        """
        if self.input is not None or not self.alone:
            return self.input
        forces = abs(self.protocol.plant[0])
        if not any(self.protocol.own):
            squares = tuple(forces**2 * sum((x * x for x in h), Fraction(0)) for h in self.protocol.offsets)
        elif self.initial_state is None or self.protocol.own[1] < self.least_rest:
            return None
        else:
            squares = first_inputs(self.structure, self.protocol, self.initial_state)
        return tuple(_root(x)[1] + self.sliding_terms for x in squares)

    def judge_input(self, most: Fraction) -> Answer:
        """Tell whether every input is proved to stay within so much, or exceeds it at time 0, exactly."""
        what, proved = f"{self.norm} <= {near(most, 12)}", self.inputs
        if proved is not None and max(proved) <= most:
            return Answer(MET, what)
        if self.grows:
            return Answer(REFUTED, what, "it grows without limit, proved")
        if self.initial_state is not None and (self.functions or self.alone):
            first = max(first_inputs(self.structure, self.protocol, self.initial_state))
            if first > most**2:
                return Answer(REFUTED, what, f"it is up to {down(_root(first)[0])} at the start, proved")
        return Answer(OPEN, what, "no bound is proved" if proved is None else f"proved: {up(max(proved))}")

    def columns(self) -> dict[str, list[float]]:
        """Return initial and final states in floats, and bounds of the input, one number for each agent."""
        names = ["x", "v", "a", *(f"x^({i})_" for i in range(3, self.order))][: self.order]
        marks = [""] if self.dimension == 1 else [f"_{q + 1}" for q in range(self.dimension)]
        table: dict[str, list[float]] = {}
        for i, name in enumerate(names):
            for q, mark in enumerate(marks):
                if self.initial_state is not None:
                    table[f"{name}{mark}(0)"] = [float(agent[q][i]) for agent in self.initial_state]
                if i < self.settled:
                    table[f"{name}{mark}(T)"] = [float(agent[q][i][0]) for agent in self.final_state or ()]
        return table | ({} if self.input is None else {"input": [float_up(x) for x in self.input]})

    def simulate(self, **options: Any) -> AgentsTrajectory:
        """Run the agents from their initial states; options are those of :func:`simulate_agents`.

        Raises
        ------
        ParameterError
            There are no initial states.
        SimulationError
            The integrator failed.
        """
        if self.initial_state is None:
            raise ParameterError("the certificate has no initial state; certify the graph with x0")
        states = [[[float(x) for x in chain] for chain in agent] for agent in self.initial_state]
        return simulate_agents(self.structure.graph, self.protocol, states, self.weighing_rate, **options)

    @property
    @abstractmethod
    def _summary(self) -> str:
        """What a representation tells of the protocol."""

    @property
    @abstractmethod
    def rate(self) -> Fraction | None:
        """The rate at which all deviations decay, per unit of the stretched clock; None if there is no single one."""

    @property
    @abstractmethod
    def weighing_rate(self) -> float:
        """The rate by which deviations are weighed where they are integrated."""

    @property
    @abstractmethod
    def settles(self) -> bool:
        """Whether the behaviour of the claim is proved at ``T`` itself."""

    @property
    @abstractmethod
    def unbounded(self) -> tuple[tuple[str, Change], ...]:
        """What leaves the input without a bound, and what mends it; empty where nothing does."""

    @property
    def bounding_rho2(self) -> Fraction | None:
        """A ``rho2`` by which the input is proved to be bounded; None where it is, or other numbers decide that."""
        return None

    @property
    @abstractmethod
    def nearer(self) -> Sentence:
        """What leaves less by ``T``."""

    @property
    @abstractmethod
    def in_place(self) -> bool:
        """Whether nothing steers the agents from their initial state."""

    @property
    @abstractmethod
    def gains_text(self) -> str:
        """The numbers of the protocol beside those of the gain."""

    @property
    @abstractmethod
    def proof_text(self) -> tuple[str, str]:
        """What the long screen tells of gains and of the proof."""

    @property
    @abstractmethod
    def section(self) -> AgentsSection | CascadeSection:
        """The section ``agents``."""

    @property
    @abstractmethod
    def obligations(self) -> list[Obligation]:
        """What proves the decay: obligations with numbers or a witness."""

    @property
    def first_ones(self) -> str:
        """What :meth:`fall` is a share of."""
        return "the first ones"

    @abstractmethod
    def fall(self, remaining: float) -> float:
        """Return what deviations are of :attr:`first_ones` at most, in the norm of ``V``."""

    @abstractmethod
    def deviation_bound(self, remaining: np.ndarray) -> np.ndarray:
        """Return (N, n, M) bounds of the deviation of each derivative from the common motion."""

    @cached_property
    def never_off(self) -> bool:
        """Whether bounds of all deviations are 0 at first, and therefore ever."""
        return not self.deviation_bound(np.array([1.0])).any()

    @abstractmethod
    def compare(self, run: AgentsTrajectory) -> AgentsComparison | None:
        """Compare a run with what is proved of it; None where nothing disagrees."""

    def __repr__(self) -> str:
        size = "" if self.input is None else f", {self.norm} <= {up(max(self.input), 4)}"
        return f"{type(self).__name__}({self._summary}{size})"


def _root(square: Fraction) -> Interval:
    """Enclose a root, in one number where it is rational."""
    root = Fraction(math.isqrt(square.numerator), math.isqrt(square.denominator))
    return (root, root) if root**2 == square else sqrt(square)


def final_states(part: AgentsAnswer, influence: Influence) -> Intervals | None:
    """Return where the agents end, with their velocities and so on; None if it is not enclosed in a large graph."""
    if not influence.exact and influence.enclosure is None:
        return None
    offsets, coordinates = part.protocol.offsets, []
    states = scaled_states(part.initial_state or (), offsets, Fraction(1))
    for q in range(part.dimension):
        begin = [[(x, Fraction(0)) for x in agent[q]] for agent in states]
        try:
            columns = [agents_ends(influence, [weighted_sum(row, chain) for chain in begin]) for row in part.motion]
        except NotEnclosedError:
            return None
        coordinates.append(list(zip(*columns, strict=True)))
    return tuple(
        tuple(
            tuple((m + (offsets[k][q] if i == 0 else 0), r) for i, (m, r) in enumerate(coordinates[q][k]))
            for q in range(part.dimension)
        )
        for k in range(len(offsets))
    )


def use(structure: Structure, functions: Sequence[LyapunovFunction], chosen: Sequence[int]) -> dict[str, Any]:
    """Return the fields of an answer that tell which functions of a graph are used: those of some numbers."""
    used = tuple(functions[k] for k in chosen)
    constants = [error_constants(structure, V) if V.matrix is not None else None for V in used]
    return {"structure": structure, "used": tuple(map(UsedFunction, chosen, constants)), "functions": used}


def written(part: AgentsAnswer) -> dict[str, Any]:
    """Return what sections of all agents have."""
    bounds = part.input
    return {
        "dimension": part.dimension,
        "offsets": part.protocol.offsets,
        "initial_state": part.initial_state,
        "motion": part.motion,
        "final_state": part.final_state,
        "input": None if bounds is None else AgentsInput(agents=Numbers(bounds), largest=max(bounds)),
    }


def read(
    section: AgentsSection | CascadeSection, structure: Structure, functions: Sequence[LyapunovFunction]
) -> dict[str, Any]:
    """Return the fields of an answer that sections of all agents have."""
    return {
        "structure": structure,
        "used": tuple(UsedFunction(one.function, fractions(one.inputs)) for one in section.functions),
        "functions": tuple(functions[one.function] for one in section.functions),
        "initial_state": states_of(section.initial_state),
        "motion": rows_of(section.motion),
        "final_state": states_of(section.final_state),
        "input": None if section.input is None else tuple(section.input.agents),
    }


def rows_of(rows: Sequence[Sequence[Any]]) -> tuple[tuple[Any, ...], ...]:
    """Return rows as tuples."""
    return tuple(map(tuple, rows))


def states_of(states: Sequence[Sequence[Sequence[Any]]] | None) -> tuple[tuple[tuple[Any, ...], ...], ...] | None:
    """Return states of agents as tuples; None of None."""
    return None if states is None else tuple(map(rows_of, states))
