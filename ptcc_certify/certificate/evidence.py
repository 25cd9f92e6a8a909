"""What a certificate rests on: a proof, and what was seen and is not claimed, runs that keep the bounds or do not."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any, Self

import numpy as np

from ptcc_certify.bounds.agents.run_against_bounds import AgentsComparison
from ptcc_certify.bounds.delay.late_messages import LateBounds
from ptcc_certify.bounds.envelope import Comparison
from ptcc_certify.bounds.final_state.enclosed_ends import FinalEnds
from ptcc_certify.bounds.final_state.of_graph import FinalState, final_state
from ptcc_certify.bounds.instants import remaining_part
from ptcc_certify.certificate.family_proof import FamilyProof
from ptcc_certify.certificate.graph_proof import GraphProof
from ptcc_certify.certificate.request import OfQuestion, Question
from ptcc_certify.errors import ParameterError, PTCCError, SimulationError, did_you_mean, unknown_parameter
from ptcc_certify.lazy_report import Shown
from ptcc_certify.lyapunov.search import Search
from ptcc_certify.model.asks import GainLimits
from ptcc_certify.model.disturbance import ExpressionDisturbance
from ptcc_certify.simulation.agents import AgentsTrajectory
from ptcc_certify.simulation.late_messages import can_run, simulate_late
from ptcc_certify.simulation.moving_leaders import simulate_tracking
from ptcc_certify.simulation.run import simulate
from ptcc_certify.simulation.trajectory import Trajectory
from ptcc_certify.simulation.virtual_positions import follow, run_virtual_positions


def late_run(proof: GraphProof | FamilyProof, late: LateBounds, **options: Any) -> Trajectory | None:
    """Return the run of what is proved of one graph with late messages or moving leaders, from its initial state.

    Of a graph that has something proved as a family of one mode there is one where nothing is late or off.

    Messages are as late as allowed, leaders move away from the farthest follower as fast as they may, and vehicles that
    exchange virtual positions track the run of these.

    Parameters
    ----------
    proof : GraphProof or FamilyProof
        With an initial state.
    late : LateBounds
        What is proved.
    **options : Any
        ``pattern`` of :func:`ptcc_certify.simulate_late`, ``steps`` of that or of
        :func:`ptcc_certify.simulate_tracking`.

    Returns
    -------
    Trajectory or None
        None where delays are too short for one, and of families.

    Raises
    ------
    ParameterError, SimulationError
        There are too many agents, or the run fails.

    Examples
    --------
    >>> pair = SignedDigraph.from_edges([(1, 2, 1)])
    >>> cert = certify(pair, NominalProtocol(T=1, rho1=1, rho2=2, kappa=1), [1, 0], messages=LateMessages(delay="0.1"))
    >>> late_run(cert.proof, cert.late).states[:, -1].round(3)
    array([1., 1.])
    """
    graph, protocol, messages = late.graph, proof.protocol, late.messages
    if graph is None or (isinstance(proof, FamilyProof) and (late.forms or not late.tracks)):
        return None
    assert proof.initial_state is not None
    start = [float(x) for x in proof.initial_state]
    if late.tracks and late.leaders is not None:
        u = late.rows[0].witness.u if late.rows else None
        return simulate_tracking(graph, protocol, late.leaders, start, u=u, gain_cap=messages.gain_cap, **options)
    if not can_run(protocol, messages):
        return None
    if late.tracking_protocol is not None and messages.vehicles is not None:
        virtual = run_virtual_positions(graph, protocol, messages, start, late.leaders, **options)
        return follow(virtual, late.tracking_protocol, messages.vehicles)
    return simulate_late(graph, protocol, messages, start, leaders=late.leaders, **options)


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


#: True for the type checker of this project alone: its own code asks the parts themselves, of which types are known.
WHOLE_PARTS_ALONE = False
#: What may be put to a certificate that was read: what is asked, and what was seen.
_OF_NO_FILE = {"expectations", *(part.name for part in fields(Observations))} - {"search"}
#: Where agents begin.
_STATES = {"initial_state", "sigma0"}
#: What Lyapunov functions and their constants depend on, and where they are kept.
_OF_FUNCTIONS = {"subject", "matrix", "lyapunov", "searched_functions", "source"}
_ONCE = ("functions", "full_constants")


@dataclass(frozen=True, eq=False, repr=False)
class Evidence(OfQuestion, Shown):
    """What a certificate rests on: the proof, with the question that it answers, and what was observed.

    What the parts tell is asked of it by the same names, see :class:`ptcc_certify.Certificate`.
    """

    proof: GraphProof | FamilyProof
    observed: Observations = field(default_factory=Observations)

    @property
    def question(self) -> Question:
        """Of whom it is, under which protocol, from where, and what was asked beside."""
        return self.proof.question

    if not WHOLE_PARTS_ALONE:

        def __getattr__(self, name: str) -> Any:
            if name.startswith("__") or name in ("proof", "observed"):
                raise AttributeError(name)
            part = self.observed if hasattr(type(self.observed), name) else self.proof
            try:
                return getattr(part, name)
            except AttributeError:
                if name in dir(part):  # which it has, and misses something itself
                    raise
                known = [] if name[0] == "_" else sorted({*dir(self), *dir(part)})
                raise AttributeError(f"a Certificate has no attribute {name}{did_you_mean(name, known)}") from None

    @property
    def final_state(self) -> FinalState | FinalEnds | None:
        """Where agents end, of a family between which ends; in a formation ``proof.final_state`` is less places.

        None where nothing is proved, and of agents of order n: :meth:`to_pandas` tells where those end.
        """
        return self.proof.final_positions

    @property
    def graph_proof(self) -> GraphProof:
        """What is proved of one graph.

        Raises
        ------
        ParameterError
            It is of a family.
        """
        if isinstance(self.proof, FamilyProof):
            raise ParameterError(
                "this is the certificate of a family, under whose signals it runs; see cert.family_proof"
            )
        return self.proof

    @property
    def family_proof(self) -> FamilyProof:
        """What is proved of a family.

        Raises
        ------
        ParameterError
            It is of one graph.
        """
        if isinstance(self.proof, GraphProof):
            raise ParameterError("this is the certificate of one graph; see cert.graph_proof")
        return self.proof

    @property
    def of_family(self) -> bool:
        """Whether it is of a family, and not of one graph."""
        return isinstance(self.proof, FamilyProof)

    @property
    def search(self) -> Search:
        """Better Lyapunov functions than the paper's, proved, and what else was searched."""
        return replace(self.observed.search, functions=self.graph_proof.searched_functions)

    def best_possible_residual(self, remaining: float) -> float | None:
        """``e^(-spectral rate s / 2)`` where ``1 - t/T`` is ``remaining``: what the slowest mode leaves (numerical).

        Raises
        ------
        ParameterError
            ``remaining`` is not from 0 to 1.
        """
        if (rate := self.observed.spectral_rate) is None:
            return None
        return math.exp(-rate * self.proof.protocol.gain.clock_at_remaining(remaining_part(remaining)) / 2)

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
        proof, question = self.proof, self.proof.question
        if proof.source is not None and values.keys() - _OF_NO_FILE:
            raise ParameterError("a certificate that was read is what its file says; certify the graph again")
        if proof.agents is not None and values.keys() & {"protocol", *_STATES}:
            raise ParameterError("gains and bounds of agents of order n belong to their protocol; certify them again")
        if (search := values.pop("search", None)) is not None:
            values |= {"searched_functions": search.functions, "search": replace(search, functions=())}
        if values.keys() & {"protocol", *_STATES}:
            values.setdefault("trajectory", None)
            values |= {"late": values.get("late")}
        if values.keys() & _STATES and "final_state" not in values and isinstance(proof, GraphProof):
            x0, sigma0 = (values.get(name, getattr(question, name)) for name in ("initial_state", "sigma0"))
            first = x0 and [x - s for x, s in zip(x0, sigma0 or [0] * len(x0), strict=True)]
            values["final_state"] = first and final_state(proof.structure, first, matrix=proof.influence)
        same_functions = not values.keys() & _OF_FUNCTIONS
        observed = _take(self.observed, values)
        values["request"] = _take(question.request, values)
        values["question"] = _take(question, values)
        if unknown := sorted(values.keys() - {part.name for part in fields(proof)}):
            raise ParameterError(unknown_parameter("Certificate", unknown[0], [part.name for part in fields(proof)]))
        changed = replace(proof, **values)
        if same_functions:  # what depends on them alone is computed once for all gains and initial states
            vars(changed).update({part: vars(proof)[part] for part in _ONCE if part in vars(proof)})
        return replace(self, proof=changed, observed=observed)

    def _in_places(self, run: Trajectory) -> Trajectory:
        """Return a run of ``initial_state`` that tells positions: in a formation with the places of its agents."""
        offsets = self.proof.offsets
        return run if offsets is None else run.in_places(np.array([float(h) for h in offsets]))

    @property
    def trajectory(self) -> Trajectory | None:
        """A simulated run."""
        run = self.observed.trajectory
        return None if run is None else self._in_places(run)

    @cached_property
    def comparison(self) -> Comparison | None:
        """The simulated run against the proved bounds; None without a run, or if nothing was proved."""
        if self.trajectory is None or not (self.graph_proof.envelope.functions or self.proof.protocol.reaching):
            return None
        return self.graph_proof.envelope.compare(self.trajectory)

    @cached_property
    def agents_comparison(self) -> AgentsComparison | None:
        """The simulated run of agents of order n against the proved bounds; None without a run."""
        run = self.observed.agents_run
        return None if self.proof.agents is None or run is None else self.proof.agents.compare(run)

    @property
    def violated(self) -> bool:
        """Whether a simulated run exceeds a proved bound."""
        return any(seen is not None and seen.violated for seen in (self.comparison, self.agents_comparison))

    @property
    def disturbance(self) -> str | None:
        """The disturbance of a repeated run: the one written down, if it is an expression, otherwise ``worst-case``.

        None for the nominal protocol. No part of the claim, which holds for every disturbance within ``delta``.
        """
        if self.proof.sigma0 is None:
            return None
        run = self.trajectory
        source = None if run is None or run.sliding is None else run.sliding.source
        if self.proof.source is not None:
            source = self.proof.source.document["problem"]["gain"].get("disturbance")
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
            The certificate has no initial state, or is of a family.
        SimulationError, unknown_parameter
            The integrator failed.
        """
        proof = self.graph_proof
        x0 = [float(x) for x in proof.require_initial_state()]
        if proof.sigma0 is None:
            return self._in_places(simulate(proof.graph, proof.protocol, x0, **options))
        options["sigma0"] = [float(x) for x in proof.sigma0]
        try:
            run = simulate(proof.graph, proof.protocol, x0, disturbance=self.disturbance, **options)
        except ParameterError:
            if self.disturbance == WORST_CASE:
                raise
            run = simulate(proof.graph, proof.protocol, x0, disturbance=WORST_CASE, **options)
        return self._in_places(run)

    @cached_property
    def asked_trajectory(self) -> Trajectory | None:
        """The run of what was asked where messages are late, leaders move, or one set of limits holds the gain.

        Messages are as late as allowed, leaders move away from the farthest follower as fast as they may. None where
        nothing of that was asked, or where there is no such run: delays too short for one, or too many agents.
        """
        proof = self.proof
        if isinstance(proof, FamilyProof) or proof.initial_state is None:
            return None
        try:
            if proof.late is not None:
                run = late_run(proof, proof.late)
                return None if run is None else self._in_places(run)
            if len(proof.limits) != 1 or not proof.direct:
                return None
            (limits,) = proof.limits
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
            The certificate has no initial state, or is of a family.
        SimulationError, unknown_parameter
            The integrator failed.
        """
        return self.changed(trajectory=self.simulate(**options))


def _take(group: Any, values: dict[str, Any]) -> Any:
    """Return a group of fields with those of the values that are its own, which are taken out of these."""
    return replace(group, **{f.name: values.pop(f.name) for f in fields(group) if f.name in values})
