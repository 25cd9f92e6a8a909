"""What a certificate says of agents of order n: their protocol, its proof, final states, and bounds over time."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property

import numpy as np

from lmi.exact.decimal_rounding import counted, down, float_down, float_up, near, up
from ptcc_certify.bounds.agents.cascade import instant_values
from ptcc_certify.bounds.agents.common_motion import common_motion
from ptcc_certify.bounds.agents.each_agent import (
    States,
    checked_begin,
    checked_function,
    least_input,
    root_product,
    scaled_states,
)
from ptcc_certify.bounds.agents.run_against_bounds import AgentsComparison, compare_agents
from ptcc_certify.bounds.final_state.enclosed_ends import agents_ends
from ptcc_certify.bounds.final_state.of_graph import Influence
from ptcc_certify.bounds.float_conversion import numbers
from ptcc_certify.bounds.input.tightest_bound import round_up
from ptcc_certify.bounds.instants import remaining_part
from ptcc_certify.certificate.agents_answer import AgentsAnswer, Residual, final_states, read, rows_of, use, written
from ptcc_certify.certificate.cascade_part import prove_cascade, read_cascade
from ptcc_certify.certificate.graph_proof import GraphProof
from ptcc_certify.checker.agent_bounds import Begin, ResidualSection, UsedSection
from ptcc_certify.checker.agent_cascade import CascadeSection
from ptcc_certify.checker.agents import AgentsSection
from ptcc_certify.checker.input_formulas import Limits, decay_above
from ptcc_certify.checker.obligations import CheckReport
from ptcc_certify.errors import Change, Sentence
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.lyapunov.function import LyapunovFunction
from ptcc_certify.model import Protocol
from ptcc_certify.model.agents import Agents
from ptcc_certify.model.agents_protocol import AgentsProtocol
from ptcc_certify.simulation.agents import AgentsTrajectory
from ptcc_certify.theorems.matrix_for_order_n import (
    AgentMatrix,
    Matrix,
    Phase,
    ScaledAgent,
    agent_matrix,
    find_phases,
    paper_matrix,
    round_and_prove,
)
from ptcc_certify.theorems.theorem import Obligation


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class AgentsPart(AgentsAnswer):
    """What is proved of agents of order n by one matrix; see :class:`AgentsAnswer`.

    Attributes
    ----------
    matrix : AgentMatrix
        ``W``, the rate ``r`` and the gains, proved.
    instants : tuple of tuples of Fraction or None
        Bounds of ``V`` of functions used; none larger at later instants than its decay tells.
    """

    matrix: AgentMatrix

    @property
    def decay(self) -> Fraction:
        """``R = r rho2 kappa``."""
        return self.matrix.rate * self.protocol.gain.pole

    @property
    def settles(self) -> bool:
        """Whether the behaviour of the claim is proved at ``T`` itself, of positions less their places in a formation.

        A capped gain leaves something there unless nothing is off, and gains without a Lyapunov function prove nothing.
        """
        if self.alone or self.protocol.gain_cap is None:
            return self.alone or bool(self.functions)
        return self.residual is not None and not any(map(any, self.residual.agents))

    @property
    def unbounded(self) -> tuple[tuple[str, Change], ...]:
        """What leaves the input without a bound, and what mends it; empty where nothing does.

        The deviations' part is ``eta^n e^(-r s/2)`` of what it is at 0; that of the common velocity at rest
        ``eta e^(-alpha s - a_2 t)``, whose logarithm grows by at most ``eta (1/k - alpha) - a_2``.
        """
        n = self.order
        if self.protocol.gain_cap is not None:
            return ()
        found = []
        if self.decay < 2 * n and n == 1 and self.matrix.gains == (1,):  # the paper's: its decay follows from its rate
            k, kappa = self.protocol.gain.pole, self.protocol.base.kappa
            mend = Change("rho2", up(2 / (self.matrix.rate * kappa), 4))
            found.append((f"rate {down(self.matrix.rate)} is below 2/(rho2 kappa) = {up(2 / k, 4)}", mend))
        elif self.decay < 2 * n:
            found.append((f"decay {down(self.decay)} is below 2 n = {2 * n}", Change("decay", str(2 * n))))
        if any(self.protocol.own):
            alpha, least = self.protocol.own[1], self.least_rest
            if alpha < least:
                found.append((f"rest {down(alpha)} is below {up(least, 4)}", Change("rest", up(least, 4))))
        return tuple(found)

    @cached_property
    def begin(self) -> Begin:
        """Where the agents begin, as the check reads it."""
        return checked_begin(self.structure, self.protocol, self.matrix, self.initial_state or ())

    @cached_property
    def initial_values(self) -> tuple[Fraction, ...]:
        """``V(0)`` of every function used."""
        if self.initial_state is None:
            return ()
        return tuple(self.begin.value(checked_function(V)) for V in self.functions)

    @property
    def obligations(self) -> list[Obligation]:
        """What proves the decay: obligations with numbers or a witness."""
        return [
            Obligation("agent-decrease", "agents", {"rate": self.matrix.rate}),
            Obligation("agent-coupling", "agents", {"coupling": self.matrix.coupling}),
            *(Obligation("agent-phase", f"phases[{k}]", {"rate": phase.rate}) for k, phase in enumerate(self.phases)),
        ]

    @property
    def section(self) -> AgentsSection:
        """The section ``agents``."""
        protocol, matrix, residual = self.protocol, self.matrix, self.residual
        return AgentsSection(
            order=self.order,
            plant=protocol.plant,
            own=protocol.own,
            gains=protocol.gains,
            coupling=matrix.coupling,
            lower_triangle=matrix.W,
            rate=matrix.rate,
            gain_cap=protocol.gain_cap,
            points=matrix.points,
            functions=[UsedSection(function=one.number, inputs=numbers(one.inputs)) for one in self.used],
            residual=None if residual is None else ResidualSection(clock=residual.clock, agents=residual.agents),
            **written(self),
        )

    # ------------------------------------------------------------------ bounds over time

    def deviation_bound(self, remaining: np.ndarray) -> np.ndarray:
        """Return (N, n, M) bounds of the deviation of each derivative from the common motion.

        Infinite where nothing is proved, or without an initial state.
        """
        q = np.atleast_1d(remaining_part(remaining))
        bounds = np.full((self.structure.graph.n_nodes, self.order, len(q)), np.inf)
        powers = np.outer(np.arange(self.order), np.log([self.protocol.value(x) for x in q]))
        known = list(enumerate((self.initial_values, *self.instants))) if self.initial_values else []
        for i, values in known:
            for one, V, value in zip(self.used, self.functions, values, strict=True):
                if V.deviation is None or value is None:
                    continue
                for W, falls in self._courses(one.number, q, 2.0**-i):
                    rows = [
                        [float_up(root_product(c, W[j][j], value)) for j in range(self.order)]
                        for c in V.deviation.agents
                    ]
                    with np.errstate(over="ignore", invalid="ignore"):
                        own = np.array(rows)[:, :, None] * np.exp(powers - falls / 2 + 1e-9)
                    bounds = np.where(np.isfinite(falls), np.minimum(bounds, own), bounds)
        return bounds

    def _courses(self, function: int, q: np.ndarray, since: float) -> Iterator[tuple[Matrix, np.ndarray]]:
        """Yield matrices of a function, and by which exponent it has fallen by these since ``1 - t/T = since``.

        Minus infinity before.
        """
        s = self.protocol.clock(q)
        gain, former = self.protocol.gain, self.matrix.rate
        fallen, begun = 0.0, float(self.protocol.clock(np.array([since]))[0])
        yield self.matrix.W, np.where(q <= since, float_down(former) * (s - begun), -np.inf)
        for phase in self.phases:
            if phase.function == function:
                since = min(since, phase.begins(gain.rho1, gain.pole, gain.T))
                clock = float(self.protocol.clock(np.array([since]))[0])
                fallen += float_down(former) * (clock - begun)
                begun, former = clock, phase.rate
                yield phase.W, np.where(q <= since, fallen + float_down(former) * (s - clock), -np.inf)

    def compare(self, run: AgentsTrajectory) -> AgentsComparison | None:
        """Compare a run with what is proved of it; None where nothing disagrees."""
        each = self.functions, self.initial_values, self.error_constants
        return compare_agents(self.structure, self.matrix, *each, self.input, run)

    @property
    def rate(self) -> Fraction:
        """``r``, per unit of the stretched clock."""
        return self.matrix.rate

    @property
    def weighing_rate(self) -> float:
        """``r``."""
        return float(self.matrix.rate)

    def fall(self, remaining: float) -> float:
        """Return ``e^(-r s/2)``, which deviations are of the first ones at most, in the norm of ``V``."""
        return math.exp(-float(self.matrix.rate) * float(self.protocol.clock(np.array([remaining]))[0]) / 2)

    @property
    def nearer(self) -> Sentence:
        """What leaves less by ``T``."""
        return "a larger ", Change("decay"), f", such as {2 * math.ceil(self.decay)}, leaves less"

    @property
    def in_place(self) -> bool:
        """Whether agents begin in agreement, with a common motion: then nothing steers them but to rest."""
        return not any(self.initial_values) and not (any(self.protocol.own) and self.begins_moving)

    @property
    def bounding_rho2(self) -> Fraction | None:
        """That by which ``alpha rho2 kappa = 1``, if it is less."""
        alpha, k = max(self.protocol.own), self.protocol.gain.pole
        return Fraction(up(1 / (alpha * self.protocol.base.kappa), 4)) if alpha and alpha * k < 1 else None

    @property
    def gains_text(self) -> str:
        """The gains of relative positions, velocities and so on."""
        return f"K = ({', '.join(str(float(K)) for K in self.protocol.gains)})"

    @property
    def proof_text(self) -> tuple[str, str]:
        """What the long screen tells of gains and of the proof."""
        matrix = self.matrix
        pieces = max(len(matrix.points) - 1, 0)
        proof = f"V <= e^(-r s) V(0), r = {down(matrix.rate)}, R = r rho2 kappa = {near(self.decay)}; one matrix for "
        proof += f"{counted(len(self.used), 'Lyapunov function')}, {counted(pieces, 'piece')}"
        return f"{self.gains_text}, coupling {near(matrix.coupling)}", proof

    @property
    def _summary(self) -> str:
        return f"order {self.order}, R = {float(self.decay):.6g}"


def prove_agents(
    proof: GraphProof,
    base: Protocol,
    agents: Agents,
    offsets: Sequence[Sequence[Fraction]],
    initial_state: States | None,
) -> AgentsAnswer:
    """Design the gains of agents of order n for proved Lyapunov functions of their graph, and prove what they do.

    Of the cascade, which has no gains to design, see :func:`~ptcc_certify.certificate.cascade_part.prove_cascade`.

    Parameters
    ----------
    proof : GraphProof
        Of the graph; of its functions the one that makes inputs smallest decides the coupling, faster ones are used
        besides.
    base : Protocol
        Gain, clock and deadline.
    agents : Agents
    offsets : N rows of d Fraction
    initial_state : N tuples of d tuples of n Fraction, or None

    Raises
    ------
    NoCertificate
        No matrix for one agent was found.
    """
    if agents.cascade is not None:
        return prove_cascade(proof, base, agents, offsets, initial_state)
    structure, functions, gain = proof.structure, proof.functions, base.gain
    proved = [V.proved_rate for V in functions]
    best = max((rate for rate in proved if rate > 0), default=None)
    scaled = ScaledAgent(agents.coefficients, agents.own, gain.rho1, gain.pole, gain.first, agents.cap)
    if agents.of_paper:
        enough = [V for V in functions if V.proved_rate * gain.pole >= 2]  # by which the input is bounded
        states = None if initial_state is None else scaled_states(initial_state, offsets, Fraction(1))
        matrix = paper_matrix(scaled, least_input(structure, enough, ((Fraction(1),),), states) or best or Fraction(1))
    else:
        rate = agents.decay_rate / gain.pole
        matrix = agent_matrix(scaled, rate, Fraction(1) if best is None else _coupling(best))
        first = gain.first if agents.cap is None else min(gain.first, agents.cap)
        states = None if initial_state is None else scaled_states(initial_state, offsets, 1 / first)
        chosen = least_input(structure, functions, matrix.inverse, states)
        if chosen is not None and best is not None and chosen < best:
            found = np.array([[float(x) for x in row] for row in matrix.W])
            slower = round_and_prove(scaled, found, rate, _coupling(chosen))
            matrix = matrix if slower is None else slower
    used = [k for k, rate in enumerate(proved) if rate > 0 and matrix.coupling * rate >= 1]
    part = AgentsPart(
        protocol=AgentsProtocol(base, agents.coefficients, agents.own, matrix.gains, rows_of(offsets), agents.cap),
        matrix=matrix,
        initial_state=initial_state,
        motion=common_motion(agents.coefficients, agents.own, gain),
        **use(structure, functions, used),
    )
    decided = initial_state is not None and bool(used or not structure.graph.n_edges)
    final = final_states(part, proof.influence) if decided else None
    return replace(part, final_state=final, residual=_residual(part), input=_input(part, proof.influence))


def with_phases(part: AgentsPart) -> AgentsPart:
    """Add phases of functions that bound deviations; later ones of that which bounds them best at first."""
    protocol, gain = part.protocol, part.protocol.gain
    if part.order < 2 or part.initial_state is None or protocol.gain_cap is not None:
        return part
    agent = ScaledAgent(protocol.plant, protocol.own, gain.rho1, gain.pole, gain.first, None)
    each = zip(part.used, part.functions, part.initial_values, strict=True)
    known = [(max(V.deviation.agents) * value, one.number, V) for one, V, value in each if V.deviation is not None]
    known.sort(key=lambda entry: entry[:2])
    found = list[Phase]()
    with suppress(np.linalg.LinAlgError):  # of a matrix that is positive definite by less than the rounding of floats
        for k, (_, number, V) in enumerate(known):
            found += find_phases(agent, part.matrix, number, V.proved_rate, later=k == 0)
    return replace(part, phases=tuple(found))


def with_instants(part: AgentsPart) -> AgentsPart:
    """Add what functions are worth at instants nearer to the deadline."""
    if part.order < 2 or part.initial_state is None or not any(part.initial_values):
        return part
    return replace(part, instants=instant_values(part.begin, part.functions))


def _coupling(rate: Fraction) -> Fraction:
    """Return a short number not below the reciprocal of a rate."""
    return Fraction(up(1 / rate, 6))


def _residual(part: AgentsPart) -> Residual | None:
    """Return what is left at ``T`` under the cap."""
    cap, gain = part.protocol.gain_cap, part.protocol.gain
    known = [(V.deviation, value) for V, value in zip(part.functions, part.initial_values, strict=False)]
    if cap is None or not any(deviation for deviation, _ in known):
        return None
    clock = Limits(gain_cap=cap).clock_below(gain.exact)
    decay = decay_above(part.matrix.rate * clock)
    rows = []
    for k in range(part.structure.graph.n_nodes):
        squares = [
            min(d.agents[k] * part.matrix.W[i][i] * value for d, value in known if d is not None)
            for i in range(part.order)
        ]
        rows.append(tuple(round_up(cap**i * root_product(x, decay)) for i, x in enumerate(squares)))
    return Residual(clock, tuple(rows))


def _input(part: AgentsPart, influence: Influence) -> tuple[Fraction, ...] | None:
    """Return bounds of the whole input; None where none is proved."""
    n, cap = part.order, part.protocol.gain_cap
    if part.initial_state is None or part.unbounded or not part.functions:
        return None
    eta = part.protocol.first_gain if part.decay >= 2 * n or cap is None else cap
    pairs = list(zip(part.error_constants, part.initial_values, strict=True))
    damped = _damping(part, influence)
    if damped is None or all(constants is None for constants, _ in pairs):
        return None
    gain = part.matrix.gains[-1] * part.matrix.coupling  # c^2 b'P b
    bounds = []
    for k, h in enumerate(part.protocol.offsets):
        square = min(constants[k] * value for constants, value in pairs if constants is not None)
        own = abs(part.protocol.plant[0]) * sum(map(abs, h)) + damped[k]
        bounds.append(round_up(eta**n * root_product(gain, square) + own + part.sliding_terms))
    return tuple(bounds)


def _damping(part: AgentsPart, influence: Influence) -> list[Fraction] | None:
    """Return bounds of ``eta f_2 |x_k'|`` of agents that meet at rest, else 0; None where none is proved."""
    N, eta = part.structure.graph.n_nodes, part.protocol.first_gain
    if not any(part.protocol.own):
        return [Fraction(0)] * N
    known = [(V.deviation.agents, x) for V, x in zip(part.functions, part.initial_values, strict=True) if V.deviation]
    if not known or not influence.exact:
        return None
    begin = [[(agent[q][1], Fraction(0)) for agent in part.initial_state or ()] for q in range(part.dimension)]
    common = list(zip(*(agents_ends(influence, column) for column in begin), strict=True))
    bounds = []
    for k in range(N):
        away = root_product(part.matrix.W[1][1], min(c[k] * value for c, value in known))
        along = root_product(sum(((abs(m) + r) ** 2 for m, r in common[k]), Fraction(0)))
        bounds.append(part.protocol.own[1] * eta * (eta * away + along))
    return bounds


def read_agents(
    report: CheckReport, structure: Structure, base: Protocol, functions: Sequence[LyapunovFunction]
) -> AgentsAnswer | None:
    """Return what an accepted certificate says of agents; None if it says nothing."""
    section: AgentsSection | CascadeSection | None = report.sections.get("agents")
    if section is None:
        return None
    instants = rows_of(report.sections.get("instants", ()))
    if isinstance(section, CascadeSection):
        return replace(read_cascade(section, structure, base, functions), instants=instants)
    plant, own, gains, points = map(tuple, (section.plant, section.own, section.gains, section.points))
    residual = section.residual
    return AgentsPart(
        protocol=AgentsProtocol(base, plant, own, gains, rows_of(section.offsets), section.gain_cap),
        matrix=AgentMatrix(rows_of(section.lower_triangle), section.rate, points, section.coupling, gains),
        residual=None if residual is None else Residual(residual.clock, rows_of(residual.agents)),
        phases=tuple(
            Phase(p.function, rows_of(p.lower_triangle), p.rate, p.coupling, tuple(p.points))
            for p in report.sections.get("phases", ())
        ),
        instants=instants,
        **read(section, structure, functions),
    )
