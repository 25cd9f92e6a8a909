"""What is proved of one graph, and what follows: claims, rates, final states, bounds over time, input.

Nothing here writes, reads or checks.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

from ptcc_certify.bounds.agents.each_agent import error_constants
from ptcc_certify.bounds.decay import ReachingPhase
from ptcc_certify.bounds.delay.case import DecayingForm
from ptcc_certify.bounds.delay.late_messages import late_obligations
from ptcc_certify.bounds.deviation.from_final_state import DeviationGeometry
from ptcc_certify.bounds.envelope import Envelope
from ptcc_certify.bounds.final_state.enclosed_ends import final_state_witness
from ptcc_certify.bounds.final_state.of_graph import FinalState, Influence, influence
from ptcc_certify.bounds.input.effort import Effort
from ptcc_certify.bounds.input.effort_bounds import InputRequest, bound_effort, full_constants
from ptcc_certify.bounds.input.worst_initial_state import WorstInitialState, worst_initial_state
from ptcc_certify.certificate.agents_answer import AgentsAnswer
from ptcc_certify.certificate.request import Proof
from ptcc_certify.checker import INPUT_NODES
from ptcc_certify.checker.final_state import AgentsVector
from ptcc_certify.checker.lyapunov_form import Form
from ptcc_certify.checker.side_files import Numbers
from ptcc_certify.errors import ParameterError, gated
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.size_limits import EXACT_NODES
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.lyapunov.function import LyapunovFunction
from ptcc_certify.lyapunov.rate_upper_bound import RateBound, optimality_ratio
from ptcc_certify.lyapunov.search import DIAGONAL
from ptcc_certify.theorems.claims import Claim, sliding_claim
from ptcc_certify.theorems.table import theorem_for
from ptcc_certify.theorems.theorem import Obligation, RateProof, Theorem

#: By how much ``1 - t/T`` may be larger than what floats make of it.
_EPSILON = 4 * np.finfo(float).eps
#: What is added for rounding, relative to the largest state.
_ROUNDING = 1e-12


@dataclass(frozen=True)
class Tube:
    """Bounds of every state over time: ``low <= x_k(t) <= high``; infinite where nothing is proved.

    Attributes
    ----------
    t : (M,) array
    low, high : (N, M) arrays
        In a formation of positions. While leaders move they are about targets, which depend on the run.
    labels : tuple of str
    """

    t: np.ndarray
    low: np.ndarray
    high: np.ndarray
    labels: tuple[str, ...]

    def compare(self, x: Any, tolerance: float = 0) -> Compared:
        """Compare states at the instants with the bounds.

        Parameters
        ----------
        x : (N, M) or (M, N) array_like
            Measured or simulated by whomever; where N = M agents are rows.
        tolerance : float
            By how much states may be off, such as the noise of a sensor.

        Returns
        -------
        Compared

        Raises
        ------
        ParameterError
            The shape is another one, or a state is not finite.

        Examples
        --------
        >>> pair = SignedDigraph.from_edges([("ann", "bob", -1), ("bob", "ann", -1)])
        >>> cert = certify(pair, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), [3, 5])
        >>> tube = cert.tube([0, 0.5, 0.9])
        >>> tube.compare([[3, -0.7, -0.995], [5, 1.2, 1.002]])
        Compared(inside)
        >>> tube.compare([[3, -0.7, -0.995], [5, 2.5, 1.002]])
        Compared(bob is 1.13 outside at t = 0.5)
        """
        x = np.asarray(x, dtype=float)
        n, m = self.low.shape
        if x.shape not in ((n, m), (m, n)):
            raise ParameterError(f"states of {n} agents at {m} instants have shape ({n}, {m}), not {x.shape}")
        x = x if x.shape == (n, m) else x.T
        if not np.isfinite(x).all():
            raise ParameterError("a state is not finite; leave out instants that were not measured")
        slack = tolerance + _ROUNDING * float(np.abs(x).max(initial=0))
        outside = np.maximum(np.maximum(self.low - x, x - self.high) - slack, 0)
        k, at = np.unravel_index(int(outside.argmax()), outside.shape)
        return Compared(float(outside[k, at]), self.labels[k], float(self.t[at]))


@dataclass(frozen=True, repr=False)
class Compared:
    """By how much a run is outside its tube, at worst; 0 where it is inside at all instants.

    Attributes
    ----------
    outside : float
    agent : str
    t : float
        Whose state is farthest outside, and when.
    """

    outside: float
    agent: str
    t: float

    @property
    def inside(self) -> bool:
        """Whether every state is where it is proved to be."""
        return self.outside == 0

    def __repr__(self) -> str:
        where = "inside" if self.inside else f"{self.agent} is {self.outside:.3g} outside at t = {self.t:.4g}"
        return f"Compared({where})"


def tube_of(proof: Any, t: Sequence[float] | np.ndarray, targets: np.ndarray | None = None) -> Tube:
    """Return where every agent is proved to be at instants.

    With late messages, moving leaders, a gain cap beside these, and of vehicles that exchange virtual positions it is
    what ``late`` bounds; under limits of the gain alone nothing is proved before ``T``. Otherwise it is without noise
    and without disturbances of the nominal protocol. Through a reaching phase of the sliding mode bounds are integrated
    in floats: numerical.

    Parameters
    ----------
    proof : :class:`~ptcc_certify.certificate.graph_proof.GraphProof`
        Of single integrators, or of vehicles that exchange virtual positions.
    t : (M,) array_like
        From 0 on, in units of time.
    targets : (N, M) array, optional
        Where agents aim at, less places, while leaders move: of the run that is compared.

    Raises
    ------
    ParameterError
        There is no initial state, an instant is not finite or before 0; or leaders move, and no targets are given.
    """
    proof.require_initial_state()
    t, late = np.atleast_1d(np.asarray(t, dtype=float)), proof.late
    if t.ndim != 1 or not (np.isfinite(t) & (t >= 0)).all():
        raise ParameterError("t", "is no list of finite instants from 0 on")
    if proof.leaders_move and targets is None:
        raise ParameterError("while leaders move where agents should be depends on their way; give their targets")
    n = proof.graph.n_nodes
    off = np.full((n, t.size), np.inf)
    if proof.final_state is None:
        return Tube(t, -off, off, proof.graph.labels)
    if late is not None and late.says_something:
        if late.vehicles is not None:
            off = late.vehicles_over_time(t)[0]
        else:
            alone = [v for c in proof.structure.closed_components if len(c.nodes) == 1 for v in c.nodes]
            off[alone] = 0  # single leaders are their own aims
            off[late.followers] = late.deviation_bound(t)
            for one in late.of_all:
                off = np.fmin(off, one.over_time(late.case, t).bound)
    elif not proof.limits and not proof.leaders_move and late is None:
        left = 1 - t / float(proof.protocol.gain.T)
        off = proof.deviation_bound(np.where(left > 0, np.minimum(left + _EPSILON, 1), 0))
    aims = np.asarray(proof.final_state, dtype=float)[:, None] if targets is None else targets
    if proof.offsets is not None:
        aims = aims + np.array([float(h) for h in proof.offsets])[:, None]
    return Tube(t, aims - off, aims + off, proof.graph.labels)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class GraphProof(Proof):
    """What is proved of one graph, and what follows.

    Attributes
    ----------
    lyapunov : LyapunovFunction or None
        The paper's; None when the search found none or was not started. All that are proved are ``functions``.
    paper_proof : RateProof
        The proved rate of the paper's function (None if not proved) and the statements proved for it.
    searched_functions : tuple of LyapunovFunction
        Better ones, of the classes that ``method`` names, proved.
    limit : RateBound or None
        The proved upper bound on the decay rate, and what proves it; None if no agent listens to another.
    final_state : FinalState or None
        ``Q X(0)``, for the sliding-mode protocol ``Q (X(0) - sigma(0))``; None without an initial state.
    matrix : Influence or None
        ``Q``, as it was computed; see ``influence``.
    agents : AgentsAnswer or None
        What is proved of agents of order n; then initial and final states are there, and not above.
    """

    lyapunov: LyapunovFunction | None
    paper_proof: RateProof
    searched_functions: tuple[LyapunovFunction, ...]
    limit: RateBound | None
    final_state: FinalState | None
    matrix: Influence | None
    agents: AgentsAnswer | None = None

    #: Which notes are of how the graph was read; and there is something to check, whatever was found.
    reading_notes, checkable = (), True

    @property
    def structure(self) -> Structure:
        """The graph with its structure."""
        assert isinstance(self.question.subject, Structure)
        return self.question.subject

    @property
    def graph(self) -> SignedDigraph:
        """The graph."""
        return self.structure.graph

    @property
    def final_positions(self) -> FinalState | None:
        """Where agents end: in a formation ``final_state`` is less their places."""
        if self.offsets is None or self.final_state is None:
            return self.final_state
        states = tuple(Fraction(x) + h for x, h in zip(self.final_state.states, self.offsets, strict=True))
        return replace(self.final_state, states=states)

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
    def at_rest(self) -> bool:
        """Whether every agent begins at its final state, exactly, and nothing slides."""
        end = self.final_positions
        return self.direct and end is not None and end.exact and tuple(self.initial_positions or ()) == end.states

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
        return tuple(replace(V, name=f"decays[{k}]") for k, V in enumerate(functions))

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
        return self.paper_proof.rate

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
    def headline(self) -> str:
        """Behaviour and theorem in a few words."""
        behaviour = self.claim.sharpest if self.claim else f"{len(self.structure.components)} components"
        return f"{behaviour}, {self.theorems_named}"

    @property
    def main_figure(self) -> str:
        """The figure of what is claimed: of moving leaders, late messages, agents of order n, else the decay."""
        if self.agents is not None:
            return "motion"
        if self.initial_state is None or self.final_state is None:
            return "decay"
        if self.late is None or (self.late.tracks and not self.late.rows):
            return "decay"
        return "tracking" if self.late.tracks else "late"

    @property
    def longest_way(self) -> float | None:
        """The longest way of an agent from its initial to its final state (numerical); None if unknown."""
        if self.initial_state is None or self.final_state is None:
            return None
        return float(np.abs(np.array([float(x) for x in self.initial_state]) - np.asarray(self.final_state)).max())

    @cached_property
    def envelope(self) -> Envelope:
        """The proved bounds over time; without Lyapunov functions if nothing was proved."""
        sliding = self.protocol.reaching
        phase = None if sliding is None else ReachingPhase(sliding, self.reaching or (), self.sigma0 or ())
        return Envelope(self.structure, self.protocol.gain, self.functions, phase)

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
        return self.envelope.norm_bound(remaining, self.require_initial_state())

    @gated
    def deviation_bound(self, remaining: Sequence[float] | np.ndarray) -> np.ndarray:
        """Bound of ``|x_k(t) - x_k(T)|`` from the initial state, for every agent.

        Under the sliding-mode protocol it holds whatever the disturbance. It is of single integrators that hear each
        other at once, with leaders at rest and an unlimited gain; what of these was asked for otherwise, virtual
        positions too, ``late`` bounds.

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
        return self.envelope.deviation_bound(remaining, self.require_initial_state())

    @gated
    def tube(self, t: Sequence[float] | np.ndarray, targets: np.ndarray | None = None) -> Tube:
        """Return where every agent is proved to be at instants, to be compared with a run of anybody.

        See :func:`tube_of`, and :meth:`Tube.compare`.

        Parameters
        ----------
        t : (M,) array_like
            From 0 on, in units of time.
        targets : (N, M) array, optional
            Where agents aim at while leaders move.

        Raises
        ------
        ParameterError
            There is no initial state, an instant is not finite or before 0; or leaders move, and no targets are given.
        """
        return tube_of(self, t, targets)

    def require_initial_state(self) -> tuple[Fraction, ...]:
        """Return the initial state, or refuse a certificate without one."""
        if self.agents is not None:
            raise ParameterError("this certificate is of agents of order n; ask its attribute agents")
        if self.initial_state is None:
            raise ParameterError("the certificate has no initial state; certify the graph with x0")
        return self.initial_state

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
            rates=(self.rate, self.upper_bound),
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
                constants = error_constants(self.structure, V)
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
        obligations += self.paper_proof.obligations if self.paper_proof.rate is not None else ()
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
        return (*obligations, *late_obligations(self.late))
