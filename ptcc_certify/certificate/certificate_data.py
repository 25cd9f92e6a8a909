"""What a certificate holds: claims with their proof, what was asked, what was only observed; and what follows.

Made by :func:`ptcc_certify.certify` or read from a file, it is the same class. Nothing here writes, reads or checks.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np

from ptcc_certify.bounds.agents_comparison import AgentsComparison
from ptcc_certify.bounds.deviation_from_final_state import DeviationGeometry
from ptcc_certify.bounds.enclosed_ends import final_state_witness
from ptcc_certify.bounds.envelope import Comparison, Envelope, remaining_part
from ptcc_certify.bounds.final_state import FinalState, Influence, final_state, influence
from ptcc_certify.bounds.input.effort import Effort
from ptcc_certify.bounds.input.effort_bounds import InputRequest, bound_effort, full_constants
from ptcc_certify.bounds.input.worst_initial_state import WorstInitialState, worst_initial_state
from ptcc_certify.bounds.late_messages import LateBounds, late_obligations
from ptcc_certify.bounds.sliding_envelope import SlidingEnvelope
from ptcc_certify.bounds.small_delays import DecayingForm
from ptcc_certify.bounds.tracking import Tracking, tracking_obligations
from ptcc_certify.certificate.agents_answer import AgentsAnswer
from ptcc_certify.certificate.request import Expectations, Request
from ptcc_certify.checker import INPUT_NODES, CheckReport
from ptcc_certify.checker.final_state import AgentsVector
from ptcc_certify.checker.input_formulas import InitialSet, Limits
from ptcc_certify.checker.quadratic_form import Form
from ptcc_certify.checker.side_files import Numbers
from ptcc_certify.errors import ParameterError, PTCCError, SimulationError, gated
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.size_limits import EXACT_NODES
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.lyapunov.function import LyapunovFunction
from ptcc_certify.lyapunov.rate_upper_bound import RateBound, optimality_ratio
from ptcc_certify.lyapunov.search import DIAGONAL, Search
from ptcc_certify.model import Protocol
from ptcc_certify.model.disturbance import ExpressionDisturbance
from ptcc_certify.model.gain_limits import GainLimits
from ptcc_certify.model.late_messages import LateMessages
from ptcc_certify.model.moving_leaders import MovingLeaders
from ptcc_certify.model.reaching_time import ReachingTime
from ptcc_certify.simulation.agents import AgentsTrajectory
from ptcc_certify.simulation.late_messages import can_run, simulate_late
from ptcc_certify.simulation.run import simulate
from ptcc_certify.simulation.trajectory import Trajectory
from ptcc_certify.theorems.claims import Claim, sliding_claim
from ptcc_certify.theorems.table import theorem_for
from ptcc_certify.theorems.theorem import Obligation, RateProof, Theorem

#: What a simulated run meets under the sliding-mode protocol unless a file states an expression.
WORST_CASE = "worst-case"


@dataclass(frozen=True)
class Observations:
    """What was seen and is not claimed.

    Attributes
    ----------
    trajectory : Trajectory or None
        A simulated run.
    numerical_rate : float or None
        The paper's rate in floating point, per unit of the clock.
    spectral_rate : float or None
        ``2 min Re lambda`` in floating point, per unit of the clock: no certificate can reach further.
    search : Search
        What was searched beside the paper's; the functions that were proved are apart.
    cut_off : tuple of str
        The searches that the time limit ended; what they had proved by then stands.
    notes : tuple of str
        What kept the verdict from ``certified``, and other remarks.
    agents_run : AgentsTrajectory or None
        A simulated run of agents of order n.
    """

    trajectory: Trajectory | None = None
    numerical_rate: float | None = None
    spectral_rate: float | None = None
    search: Search = field(default_factory=Search)
    cut_off: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    agents_run: AgentsTrajectory | None = None


#: What may be put to a certificate that was read: what is asked, and what was seen.
_OF_NO_FILE = {"observed", "expectations", *(part.name for part in fields(Observations))} - {"search"}
#: What Lyapunov functions and their constants depend on, and where they are kept.
_OF_FUNCTIONS = {"structure", "influence", "lyapunov", "searched_functions", "source"}
_ONCE = ("functions", "full_constants")


@dataclass(frozen=True, eq=False)
class Source:
    """The file that a certificate was read from, accepted by the independent check.

    Attributes
    ----------
    path : Path
    sha256 : str
        Of the file.
    document : mapping
        Its JSON. What stands under ``unverified`` is the file's own word.
    report : CheckReport
        Of the independent check.
    effort : Effort or None
        What is proved about the input.
    files : mapping of str to bytes
        The side files that stood beside it, by name.
    """

    path: Path
    sha256: str
    document: Mapping[str, Any]
    report: CheckReport
    effort: Effort | None
    files: Mapping[str, bytes] = field(repr=False)


@dataclass(frozen=True, eq=False, repr=False)
class Content:
    """The parts of a certificate, and what follows from them."""

    structure: Structure
    protocol: Protocol
    initial_state: tuple[Fraction, ...] | None
    sigma0: tuple[Fraction, ...] | None
    reaching: tuple[ReachingTime, ...] | None
    lyapunov: LyapunovFunction | None
    proof: RateProof
    searched_functions: tuple[LyapunovFunction, ...]
    limit: RateBound | None
    final_state: FinalState | None
    matrix: Influence | None
    request: Request
    observed: Observations
    late: LateBounds | None = None
    tracking: Tracking | None = None
    source: Source | None = None
    agents: AgentsAnswer | None = None
    offsets: tuple[Fraction, ...] | None = None

    @property
    def initial_positions(self) -> tuple[Fraction, ...] | None:
        """Where agents begin: in a formation ``initial_state`` is less their places."""
        if self.offsets is None or self.initial_state is None:
            return self.initial_state
        return tuple(x + h for x, h in zip(self.initial_state, self.offsets, strict=True))

    @property
    def final_positions(self) -> FinalState | None:
        """Where agents end: in a formation ``final_state`` is less their places."""
        if self.offsets is None or self.final_state is None:
            return self.final_state
        states = tuple(Fraction(x) + h for x, h in zip(self.final_state.states, self.offsets, strict=True))
        return replace(self.final_state, states=states)

    def _in_places(self, run: Trajectory) -> Trajectory:
        """Return a run of ``initial_state`` that tells positions: in a formation with the places of its agents."""
        if self.offsets is None:
            return run
        return run.in_places(np.array([float(h) for h in self.offsets]))

    def changed(self, **values: Any) -> Self:
        """Return the certificate with other parts, in whichever group they are; what follows is computed anew.

        Parameters
        ----------
        **values : Any
            Fields of the certificate, of its ``request`` or of its ``observed``; ``search`` is what a search found.

        Raises
        ------
        ParameterError
            The certificate was read from a file, which says other than that.

        Examples
        --------
        >>> pair = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])
        >>> cert = certify(pair, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), [3, 1], asks=Asks(simulation=False))
        >>> cert.changed(protocol=NominalProtocol(T=2, rho1=1, rho2=1, kappa=1), noise=Fraction(1)).request.noise
        Fraction(1, 1)
        """
        if self.source is not None and values.keys() - _OF_NO_FILE:
            raise ParameterError("a certificate that was read is what its file says; certify the graph again")
        if self.agents is not None and values.keys() & {"protocol", "initial_state", "sigma0"}:
            raise ParameterError("gains and bounds of agents of order n belong to their protocol; certify them again")
        if (search := values.pop("search", None)) is not None:
            values |= {"searched_functions": search.functions, "search": replace(search, functions=())}
        if values.keys() & {"protocol", "initial_state", "sigma0"}:
            values.setdefault("trajectory", None)
            values |= {"late": values.get("late"), "tracking": values.get("tracking")}
        if values.keys() & {"initial_state", "sigma0"} and "final_state" not in values:
            x0, sigma0 = (values.get(name, getattr(self, name)) for name in ("initial_state", "sigma0"))
            first = x0 and [x - s for x, s in zip(x0, sigma0 or [0] * len(x0), strict=True)]
            values["final_state"] = first and final_state(self.structure, first, matrix=self.influence)
        same_functions = not values.keys() & _OF_FUNCTIONS
        for name in ("request", "observed"):
            group = values.pop(name, getattr(self, name))
            own = {f.name: values.pop(f.name) for f in fields(group) if f.name in values}
            values[name] = replace(group, **own)
        changed = replace(self, **values)
        if same_functions:  # what depends on them alone is computed once for all gains and initial states
            vars(changed).update({part: vars(self)[part] for part in _ONCE if part in vars(self)})
        return changed

    # ------------------------------------------------------------------ parts by their short names

    @property
    def labels(self) -> Sequence[str]:
        """The names of the agents."""
        return self.structure.graph.labels

    @property
    def origins(self) -> Mapping[str, str]:
        """What the graph is called, and where initial states come from."""
        return self.request.origins

    @property
    def reading_notes(self) -> tuple[str, ...]:
        """Which of :attr:`notes` are of how the graph was read."""
        return ()

    @property
    def only_drawn(self) -> bool:
        """Whether the question is of a set of initial states, and the one at hand drawn for the simulated run."""
        return self.initial_set is not None and "x(0)" in self.request.origins

    @property
    def graph(self) -> SignedDigraph:
        """The graph."""
        return self.structure.graph

    @property
    def method(self) -> str:
        """Which Lyapunov functions were searched."""
        return self.request.method

    @property
    def at(self) -> Fraction | None:
        """Instant for which the bound was optimised, in units of time."""
        return self.request.at

    @property
    def initial_set(self) -> InitialSet | None:
        """The set of initial states for which the input is bounded; None: that of ``initial_state`` alone."""
        return self.request.initial_set

    @property
    def limits(self) -> tuple[Limits, ...]:
        """Limits of the gain that are judged besides."""
        return self.request.limits

    @property
    def delta(self) -> Fraction | None:
        """Nominal protocol: bound of the disturbances that are judged besides, in units of the input."""
        return self.request.delta

    @property
    def noise(self) -> Fraction | None:
        """Nominal protocol: bound of the measurement noise that is judged under each of the limits."""
        return self.request.noise

    @property
    def time_limit(self) -> float:
        """Seconds that the searches were given, infinity for no limit."""
        return self.request.time_limit

    @property
    def expectations(self) -> Expectations:
        """What is asked besides."""
        return self.request.expectations

    @property
    def trajectory(self) -> Trajectory | None:
        """A simulated run."""
        run = self.observed.trajectory
        return None if run is None else self._in_places(run)

    @property
    def numerical_rate(self) -> float | None:
        """The paper's rate in floating point, per unit of the clock; nothing is claimed about it."""
        return self.observed.numerical_rate

    @property
    def spectral_rate(self) -> float | None:
        """``2 min Re lambda`` in floating point, per unit of the clock: no certificate can reach further."""
        return self.observed.spectral_rate

    @property
    def cut_off(self) -> tuple[str, ...]:
        """The searches that the time limit ended."""
        return self.observed.cut_off

    @property
    def notes(self) -> tuple[str, ...]:
        """What kept the verdict from ``certified``, and other remarks."""
        return self.observed.notes

    @property
    def search(self) -> Search:
        """Better Lyapunov functions than the paper's, proved, and what else was searched."""
        return replace(self.observed.search, functions=self.searched_functions)

    # ------------------------------------------------------------------ claims

    @property
    def theorem(self) -> Theorem:
        """The theorem whose hypotheses the graph meets."""
        return theorem_for(self.structure, self.protocol.kind)

    @property
    def theorems_named(self) -> str:
        """The theorem of the claim, or those of the components: ``Theorems 1.2 and 2.1``."""
        numbers = sorted({claim.theorem for claim in self.claims})
        if len(numbers) == 1:
            return f"Theorem {numbers[0]}"
        return f"Theorems {', '.join(numbers[:-1])} and {numbers[-1]}"

    @cached_property
    def claims(self) -> tuple[Claim, ...]:
        """What is claimed of each of ``structure.components``."""
        claims = tuple(component.claim for component in self.structure.components)
        return tuple(map(sliding_claim, claims)) if self.reaching is not None else claims

    @property
    def claim(self) -> Claim | None:
        """What is claimed of a weakly connected graph; None if disconnected (see ``claims``)."""
        return self.claims[0] if len(self.claims) == 1 else None

    @property
    def constant(self) -> bool:
        """Whether every agent keeps its state, so that there is no decay to certify."""
        return self.graph.n_edges == 0

    @property
    def direct(self) -> bool:
        """Whether the decay begins at 0: nominal protocol, or ``sigma(0) = 0``."""
        return not any(self.sigma0 or ())

    # ------------------------------------------------------------------ rates

    @cached_property
    def functions(self) -> tuple[LyapunovFunction, ...]:
        """Every proved Lyapunov function, the paper's first, with its name and its constants of deviation."""
        functions = self.searched_functions
        if self.lyapunov is not None and self.lyapunov.blocks and self.lyapunov.rate is not None:
            functions = (self.lyapunov, *functions)
        if self.source is None:
            geometry = self._geometry
            functions = tuple(replace(V, deviation=None if geometry is None else geometry.bound(V)) for V in functions)
        return tuple(replace(V, name=f"lyapunov.functions[{k}]") for k, V in enumerate(functions))

    @cached_property
    def _geometry(self) -> DeviationGeometry | None:
        """What turns Lyapunov functions into deviations; None without an exact final state."""
        if not self.influence.exact or final_state_witness(self.structure, self.influence) is not None:
            return None
        return DeviationGeometry(self.structure, self.influence)

    @property
    def forms(self) -> list[Form | None]:
        """The Lyapunov functions as bounds of the input take them; None for those of large graphs."""
        return [V.form for V in self.functions]

    @cached_property
    def full_constants(self) -> tuple[tuple[Fraction, ...] | None, ...]:
        """Of every Lyapunov function ``c_k``, ``e_k^2 <= c_k V``, where its matrix is full and the graph not large."""
        n = self.graph.n_nodes
        forms = [None if f is None or f.matrix is None or n > INPUT_NODES else f for f in self.forms]
        return tuple(None if f is None else full_constants(f, n) for f in forms)

    @property
    def _functions_with_rate(self) -> list[LyapunovFunction]:
        """The functions of a proved rate, the paper's first; as ``functions``, without what is not needed for rates."""
        paper = () if self.lyapunov is None or self.lyapunov.rate is None else (self.lyapunov,)
        return [*paper, *self.searched_functions]

    @property
    def rate(self) -> Fraction | None:
        """The largest proved rate of all Lyapunov functions; None if nothing decays or nothing was proved."""
        return max((V.proved_rate for V in self._functions_with_rate if V.proved_rate > 0), default=None)

    @property
    def paper_rate(self) -> Fraction | None:
        """The rate of the paper's own certificate."""
        return self.proof.rate

    @property
    def diagonal_rate(self) -> Fraction | None:
        """The largest proved rate of a diagonal Lyapunov matrix of the searched classes; None if there is none."""
        rates = (V.proved_rate for V in self.searched_functions if V.kind in DIAGONAL)
        return max((rate for rate in rates if rate > 0), default=None)

    @property
    def fastest(self) -> LyapunovFunction:
        """The function of the largest proved rate, and of those that share it the least overshoot constant."""
        return max(self._functions_with_rate, key=lambda V: (V.proved_rate, -V.overshoot))

    @property
    def overshoot(self) -> Fraction | None:
        """What multiplies the squared norm at the largest proved rate."""
        return self.fastest.overshoot if self.rate is not None else None

    @property
    def upper_bound(self) -> Fraction | None:
        """The proved upper bound on the decay rate, per unit of the clock: no Lyapunov function exceeds it."""
        return None if self.limit is None else self.limit.value

    @property
    def optimality_ratio(self) -> float | None:
        """Proved rate over its proved upper bound, rounded down; at most 1."""
        return optimality_ratio(self.rate, self.upper_bound)

    @property
    def rounding_loss(self) -> float | None:
        """The largest relative loss of rate between what floating point found and what was proved; None without rates.

        Matrices are rounded to short rationals, and their rates lowered until they prove.
        """
        pairs = [(V.proved_rate, V.numerical_rate) for V in self._functions_with_rate]
        losses = [
            float(1 - rate / Fraction(numerical)) * math.copysign(1, numerical)
            for rate, numerical in pairs
            if numerical
        ]
        return max(losses, default=None)

    # ------------------------------------------------------------------ final state, bounds over time, input

    @cached_property
    def influence(self) -> Influence:
        """``Q``, factored."""
        return influence(self.structure) if self.matrix is None else self.matrix

    @property
    def degenerate(self) -> tuple[int, ...]:
        """1-based numbers of the balanced closed components that meet at 0."""
        return () if self.final_state is None else self.final_state.degenerate

    @property
    def longest_way(self) -> float | None:
        """The longest way of an agent from its initial to its final state (numerical); None if unknown."""
        if self.initial_state is None or self.final_state is None:
            return None
        return float(np.abs(np.array([float(x) for x in self.initial_state]) - np.asarray(self.final_state)).max())

    @property
    def asked_messages(self) -> LateMessages | None:
        """How late messages are."""
        return self.request.messages if self.late is None else self.late.messages

    @property
    def asked_leaders(self) -> MovingLeaders | None:
        """How leaders move."""
        return self.request.leaders

    @property
    def leaders_move(self) -> bool:
        """Whether leaders move where it is told what is proved beside the claim."""
        return self.tracking is not None or (self.late is not None and self.late.leaders is not None)

    @cached_property
    def envelope(self) -> Envelope:
        """The proved bounds over time; without Lyapunov functions if nothing was proved."""
        gain = self.protocol.gain
        if (sliding := self.protocol.reaching) is not None:
            sigma0, reaching = self.sigma0 or (), self.reaching or ()
            return SlidingEnvelope(self.structure, gain, self.functions, sliding, sigma0, reaching)
        return Envelope(self.structure, gain, self.functions)

    @gated
    def norm_bound(self, remaining: Sequence[float] | np.ndarray) -> np.ndarray:
        """Bound of ``||E(t)||`` (or ``||eps(t)||``, see ``envelope.coordinates``) from the initial state.

        Under the sliding-mode protocol it holds whatever the disturbance.

        Parameters
        ----------
        remaining : (M,) array_like
            ``1 - t/T`` at the instants, in [0, 1].

        Returns
        -------
        (M,) array
            Infinite where nothing was proved.

        Raises
        ------
        ParameterError
            The certificate has no initial state, or an instant is not from 0 to 1.
        """
        return self.envelope.norm_bound(remaining, self._require_initial_state())

    @gated
    def deviation_bound(self, remaining: Sequence[float] | np.ndarray) -> np.ndarray:
        """Bound of ``|x_k(t) - x_k(T)|`` from the initial state, for every agent.

        Under the sliding-mode protocol it holds whatever the disturbance.

        Parameters
        ----------
        remaining : (M,) array_like
            ``1 - t/T`` at the instants, in [0, 1].

        Returns
        -------
        (N, M) array
            Infinite where nothing was proved.

        Raises
        ------
        ParameterError
            The certificate has no initial state, or an instant is not from 0 to 1.
        """
        return self.envelope.deviation_bound(remaining, self._require_initial_state())

    def _require_initial_state(self) -> tuple[Fraction, ...]:
        if self.agents is not None:
            raise ParameterError("this certificate is of agents of order n; ask its attribute agents")
        if self.initial_state is None:
            raise ParameterError("the certificate has no initial state; certify the graph with x0")
        return self.initial_state

    def best_possible_residual(self, remaining: float) -> float | None:
        """``e^(-spectral rate s / 2)`` where ``1 - t/T`` is ``remaining``: what the slowest mode leaves (numerical).

        Raises
        ------
        ParameterError
            ``remaining`` is not from 0 to 1.
        """
        if self.spectral_rate is None:
            return None
        return math.exp(-self.spectral_rate * self.protocol.gain.clock_at_remaining(remaining_part(remaining)) / 2)

    @cached_property
    def effort(self) -> Effort | None:
        """What is proved about the input; None if no decay was proved."""
        if self.source is not None:
            return self.source.effort
        if self.agents is not None or (self.rate is None and not self.constant):
            return None
        request = InputRequest(
            self.structure,
            self.protocol,
            self.forms,
            () if self.initial_state is None and self.initial_set is None else self.full_constants,
            rate=self.rate,
            limit=self.upper_bound,
            initial_state=self.initial_state,
            initial_set=self.initial_set,
            sigma0=self.sigma0,
            reaching=None if self.reaching is None else [r.z for r in self.reaching],
            influence=self.influence,
            deviations=[None if V.deviation is None else V.deviation.agents for V in self.functions],
            limits=self.limits,
            delta=self.delta,
            noise=self.noise,
        )
        return bound_effort(request)

    @property
    def decaying_forms(self) -> list[DecayingForm]:
        """The Lyapunov functions in the coordinates ``E`` with all their constants; none without an exact ``Q``."""
        effort, found = self.effort, []
        if effort is None or not self.influence.exact or self._geometry is None:
            return []
        for k, (V, constants) in enumerate(zip(self.functions, effort.constants, strict=True)):
            form = V.form
            if form is None or form.coordinates != "E" or V.deviation is None or not V.proved_rate > 0:
                continue
            if form.diagonal is not None:
                weight = dict(zip(form.nodes, form.diagonal, strict=True))
                constants = tuple(1 / weight[v] if v in weight else Fraction(0) for v in range(self.graph.n_nodes))
            if constants is not None:
                found.append(DecayingForm(k, form, constants, V.deviation.agents))
        return found

    @cached_property
    def worst_initial_state(self) -> WorstInitialState | None:
        """The state of ``initial_set`` from which the input gets largest (numerical); None without such a set."""
        if self.initial_set is None or self.graph.n_nodes > EXACT_NODES:
            return None
        return worst_initial_state(self.structure, self.protocol, self.initial_set)

    # ------------------------------------------------------------------ proof

    @cached_property
    def witnesses(self) -> tuple[Obligation, ...]:
        """What the proof needs besides the claims: obligations with numbers or a witness, in any order."""
        obligations = []
        if self.influence.exact:
            u = final_state_witness(self.structure, self.influence)
            obligations.append(Obligation("final-state", "graph", witness=u and AgentsVector(u=Numbers(u))))
        elif self.influence.enclosure is not None:
            above = AgentsVector(u=Numbers(self.influence.enclosure.witness))
            obligations.append(Obligation("final-state", "graph", witness=above))
        obligations += self.proof.obligations if self.proof.rate is not None else ()
        for V in self.functions:
            if V.kind != "paper":
                kind = "rate" if V.dominance is None else "dominance"
                obligations.append(Obligation(kind, V.name, {"b": V.proved_rate}, V.dominance))
            if V.matrix is not None:
                obligations.append(Obligation("overshoot", V.name, {"lowest": V.lowest, "highest": V.highest}))
        if self.limit is not None:
            bound = {"upper_bound": self.limit.value}
            obligations.append(Obligation(self.limit.kind, "rates", bound, self.limit.witness))
        if self.effort is not None:
            obligations += self.effort.obligations
        if self.agents is not None:
            obligations += self.agents.obligations
        return (*obligations, *late_obligations(self.late), *tracking_obligations(self.tracking))

    # ------------------------------------------------------------------ simulation

    @cached_property
    def comparison(self) -> Comparison | None:
        """The simulated run against the proved bounds; None without a run, or if nothing was proved."""
        if self.trajectory is None or not (self.envelope.functions or self.protocol.reaching):
            return None
        return self.envelope.compare(self.trajectory)

    @cached_property
    def agents_comparison(self) -> AgentsComparison | None:
        """The simulated run of agents of order n against the proved bounds; None without a run."""
        run = self.observed.agents_run
        return None if self.agents is None or run is None else self.agents.compare(run)

    @property
    def violated(self) -> bool:
        """Whether a simulated run exceeds a proved bound."""
        return any(seen is not None and seen.violated for seen in (self.comparison, self.agents_comparison))

    @property
    def disturbance(self) -> str | None:
        """The disturbance of a repeated run: the one written down, if it is an expression, otherwise ``worst-case``.

        None for the nominal protocol. No part of the claim, which holds for every disturbance within ``delta``.
        """
        if self.sigma0 is None:
            return None
        run = self.trajectory
        source = None if run is None or run.sliding is None else run.sliding.source
        if self.source is not None:
            source = self.source.document["protocol"]["disturbance"]
        if source is None or source == "none":
            return source or WORST_CASE
        try:
            ExpressionDisturbance(source)
        except PTCCError:
            return WORST_CASE
        return source

    def simulate(self, **options: Any) -> Trajectory:
        """Run the protocol again from the initial state with CVODES, without whatever limits of the gain were judged.

        Under the sliding-mode protocol with :attr:`disturbance`; with the worst-case disturbance where that exceeds
        ``delta``.

        Parameters
        ----------
        **options : Any
            ``samples`` and others of :func:`ptcc_certify.simulation.run.simulate`.

        Returns
        -------
        Trajectory
            The run, from 0 to the deadline.

        Raises
        ------
        ParameterError
            The certificate has no initial state.
        SimulationError
            The integrator failed.
        """
        x0 = [float(x) for x in self._require_initial_state()]
        if self.sigma0 is None:
            return self._in_places(simulate(self.graph, self.protocol, x0, **options))
        options["sigma0"] = [float(x) for x in self.sigma0]
        try:
            run = simulate(self.graph, self.protocol, x0, disturbance=self.disturbance, **options)
        except ParameterError:
            if self.disturbance == WORST_CASE:
                raise
            run = simulate(self.graph, self.protocol, x0, disturbance=WORST_CASE, **options)
        return self._in_places(run)

    @cached_property
    def asked_trajectory(self) -> Trajectory | None:
        """The run of what was asked where messages are late, leaders move, or one set of limits holds the gain.

        Messages are as late as allowed, leaders move away from the farthest follower as fast as they may. None where
        nothing of that was asked, or where there is no such run: delays too short for one, or too many agents.
        """
        late, tracking = self.late, self.tracking
        if self.initial_state is None:
            return None
        try:
            start = [float(x) for x in self.initial_state]
            if late is not None and late.tracking_protocol is not None:
                from ptcc_certify.simulation.vehicles import run_of_vehicles

                return run_of_vehicles(
                    self.graph, self.protocol, late.tracking_protocol, late.messages, start, late.leaders
                )
            if late is not None:
                if not can_run(self.protocol, late.messages):
                    return None
                run: Trajectory = simulate_late(self.graph, self.protocol, late.messages, start, leaders=late.leaders)
                return self._in_places(run)
            if tracking is not None:
                from ptcc_certify.simulation.moving_leaders import simulate_tracking  # it loads SciPy

                run = simulate_tracking(self.graph, self.protocol, tracking.leaders, start, u=tracking.witness.u)
                return self._in_places(run)
            if len(self.limits) != 1 or not self.direct:
                return None
            (limits,) = self.limits
            return self.simulate(actuator=GainLimits(limits.gain_cap, limits.stop_before, limits.sample_period))
        except (ParameterError, SimulationError, OverflowError):
            return None

    def with_simulation(self, **options: Any) -> Self:
        """Return the same with ``trajectory`` and, if a bound was proved, ``comparison``.

        Parameters
        ----------
        **options : Any
            Those of :meth:`simulate`.

        Returns
        -------
        Certificate

        Raises
        ------
        ParameterError
            The certificate has no initial state.
        SimulationError
            The integrator failed.
        """
        return self.changed(trajectory=self.simulate(**options))
