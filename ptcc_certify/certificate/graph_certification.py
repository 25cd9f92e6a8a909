"""The steps of ``certify`` for one graph: its structure is known, what is asked is read."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import partial
from typing import Any

import numpy as np

from lmi import search_time as deadline
from lmi.child_process import apart
from lmi.errors import LMIError, NoCertificate, OutOfTime
from lmi.search_time import share_of_time
from ptcc_certify.bounds.envelope import FRACTIONS
from ptcc_certify.bounds.final_state.of_graph import (
    FinalState,
    Influence,
    NotEnclosedError,
    enclose,
    enclosed_final_state,
    final_state,
    influence,
    influence_in_floats,
    takes_long,
)
from ptcc_certify.certificate.agents_part import AgentsPart, prove_agents, with_instants, with_phases
from ptcc_certify.certificate.agents_request import (
    Chains,
)
from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.certificate.evidence import Observations
from ptcc_certify.certificate.graph_proof import GraphProof
from ptcc_certify.certificate.request import OfQuestion, Question
from ptcc_certify.certificate.verdict import MANY_DECADES
from ptcc_certify.errors import HypothesisError, ParameterError, SimulationError
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.size_limits import (
    EXACT_NODES,
    FACTOR_NODES,
    SEARCH_NODES,
    SIMULATED_NODES,
)
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.lyapunov.error_system import ErrorSystem
from ptcc_certify.lyapunov.function import LyapunovFunction
from ptcc_certify.lyapunov.rate_upper_bound import RateBound, mean_bound, prove_rate_bound
from ptcc_certify.lyapunov.search import APART_NODES, Search, search_functions, search_large
from ptcc_certify.model import Protocol
from ptcc_certify.model.agents import Agents
from ptcc_certify.model.base import ReachingProtocol
from ptcc_certify.model.disturbance import as_disturbance
from ptcc_certify.model.reaching_time import ReachingTime
from ptcc_certify.simulation.nominal import PAST
from ptcc_certify.simulation.run import simulate
from ptcc_certify.simulation.sliding import rounding_slack
from ptcc_certify.simulation.trajectory import Trajectory
from ptcc_certify.theorems.lemmas import laplacian_spectrum
from ptcc_certify.theorems.table import theorem_for
from ptcc_certify.theorems.theorem import RateProof, Theorem

#: What :func:`certify` does, in this order.
STEPS = (
    "simulation",
    "the paper's certificate",
    "other Lyapunov functions",
    "upper bound on the decay rate",
    "final state",
    "independent check",
)
#: The share of a time limit that the final state may take; and of a limit of work, which it does not count: it ends by
#: processor time, five times as long, and has twice of what it may take where nothing else is at work.
ENDING, ENDING_WORK = 0.3, 0.12
#: The share of a time limit after which the searches end, so that what they found is checked within it, and the shares
#: of the time then left that the first of the steps may take.
SEARCHING, SHARES = 0.4, (0.3, 0.3, 0.8, 1.0)
#: Instants of a simulated run where the graph is large.
FEW_SAMPLES = 51
#: A simulated end state is settled when it is this near to the final state, relative to the initial state.
SETTLED = 1e-6


def with_agents(certificate: Certificate, agents: Agents, chains: Chains, run: bool) -> Certificate:
    """Return the certificate of a graph as one of agents of order n on it."""
    try:
        proof = prove_agents(certificate.graph_proof, certificate.protocol, agents, chains.offsets, chains.states)
    except NoCertificate as error:
        raise ParameterError("agents", f"{error}; ask for a smaller decay or a lower order") from None
    proof = with_instants(with_phases(proof)) if isinstance(proof, AgentsPart) else proof
    notes, cut_off = [*certificate.observed.notes, *chains.notes], list(certificate.observed.cut_off)
    motion = None
    if run and proof.initial_state is not None:
        limit = SEARCHING * certificate.time_limit
        with deadline.time_limit(limit), share_of_time(SHARES[0], STEPS[0], cut_off):
            try:
                motion = proof.simulate()
            except SimulationError as error:
                notes.append(f"simulation: {error}")
    return certificate.changed(agents=proof, notes=tuple(notes), cut_off=tuple(cut_off), agents_run=motion)


def check_disturbance(disturbance: Any, protocol: ReachingProtocol, graph: SignedDigraph) -> None:
    """Refuse a disturbance that no run will meet as a run would refuse it."""
    horizon = float(protocol.T) * (1 + PAST)  # as far as a run would go
    source = as_disturbance(disturbance, graph.n_nodes, protocol.delta, horizon)
    source.check(protocol.delta, graph.labels, horizon, rounding_slack(protocol))


# ---------------------------------------------------------------------- the steps


@dataclass
class GraphSteps(OfQuestion):
    """A graph, a protocol and what is asked, on the way to a certificate: the steps, in their order.

    Attributes
    ----------
    structure : Structure
        The subject of the question.
    question : Question
    progress : callable
        Is told each of :data:`STEPS` as it begins.
    notes : list of str
        What went wrong, and other remarks.
    cut_off : list of str
        What the time limit ended.
    """

    structure: Structure
    question: Question
    progress: Callable[[str], None]
    notes: list[str] = field(default_factory=list)
    cut_off: list[str] = field(default_factory=list)

    def certificate(self, disturbance: Any, runs: bool, reaching: tuple[ReachingTime, ...] | None) -> Certificate:
        """Return what the steps find and prove, before the independent check."""
        if not runs and disturbance is not None and self.protocol.reaching is not None:
            check_disturbance(disturbance, self.protocol.reaching, self.structure.graph)
        with deadline.time_limit(SEARCHING * self.time_limit, work=self.request.by_work):
            trajectory = self.simulation(disturbance) if runs else None
            lyapunov, rate_proof, numerical = self.paper()
            search = self.search(rate_proof)
            limit = self.upper_bound()
        matrix, result = self.final_state(trajectory)
        proved = [rate_proof.rate, *(V.rate for V in search.functions)]
        proof = GraphProof(
            question=self.question,
            reaching=reaching,
            lyapunov=lyapunov,
            paper_proof=rate_proof,
            searched_functions=search.functions,
            limit=limit,
            final_state=result,
            matrix=matrix,
        )
        observed = Observations(
            trajectory=trajectory,
            numerical_rate=numerical,
            spectral_rate=_spectral_rate(self.structure, proved, self.notes),
            search=replace(search, functions=()),
            cut_off=tuple(self.cut_off),
            notes=tuple(self.notes),
        )
        return Certificate(proof, observed)

    def needs_run(self, simulation: bool | None) -> bool:
        """Tell whether there is to be a run."""
        n = self.structure.graph.n_nodes
        if simulation is None and n > SIMULATED_NODES:
            self.notes.append(f"above {SIMULATED_NODES} agents there is no CVODES run unless it is asked for")
            return False
        return simulation is not False

    def simulation(self, disturbance: Any) -> Trajectory | None:
        """Run the protocol from the initial state with CVODES."""
        graph = self.structure.graph
        self.progress(STEPS[0])
        more: dict[str, Any] = {"samples": FEW_SAMPLES} if graph.n_nodes > SIMULATED_NODES else {}
        if self.sigma0 is not None:
            more |= {"sigma0": [float(x) for x in self.sigma0], "disturbance": disturbance}
        with share_of_time(SHARES[0], STEPS[0], self.cut_off):
            try:
                return simulate(graph, self.protocol, [float(x) for x in self.initial_state or ()], **more)
            except SimulationError as error:
                self.notes.append(f"simulation: {error}")
        return None

    def paper(self) -> tuple[LyapunovFunction | None, RateProof, float | None]:
        """Search the Lyapunov function of the theorem and prove its rate."""
        self.progress(STEPS[1])
        V, proof, numerical = None, RateProof(None, ()), None
        with share_of_time(SHARES[1], STEPS[1], self.cut_off):
            V, proof, numerical = _search_and_prove(
                self.structure, theorem_for(self.structure, self.protocol.kind), self.notes
            )
        return None if V is None else replace(V, rate=proof.rate, numerical_rate=numerical), proof, numerical

    def search(self, paper: RateProof) -> Search:
        """Search and prove Lyapunov functions beside the paper's."""
        self.progress(STEPS[2])
        search = Search()
        with share_of_time(SHARES[2], STEPS[2], self.cut_off):
            search = _search_functions(self.structure, self.protocol, self.request.method, self.request.at, self.notes)
            self.cut_off += search.cut_off
        if paper.rate is None and not any(V.proved_rate > 0 for V in search.functions) and self.structure.graph.n_edges:
            self.notes.insert(0, _precision_note(self.structure.graph))
        return search

    def upper_bound(self) -> RateBound | None:
        """Prove the upper bound on the decay rate."""
        self.progress(STEPS[3])
        mean = mean_bound(self.structure)
        with share_of_time(SHARES[3], STEPS[3], self.cut_off):
            return prove_rate_bound(self.structure)
        return mean  # which stands if time ran out

    def final_state(self, run: Trajectory | None) -> tuple[Influence, FinalState | None]:
        """Compute who decides whom, and where the agents end: exactly, or enclosed."""
        self.progress(STEPS[4])
        structure, x0 = self.structure, self.initial_state
        sigma0 = self.sigma0 or (Fraction(0),) * structure.graph.n_nodes
        first = None if x0 is None else [x - s if s else x for x, s in zip(x0, sigma0, strict=True)]
        matrix, result = None, None
        seconds = (ENDING_WORK if self.request.by_work else ENDING) * self.time_limit
        half = seconds / 2 if takes_long(structure.graph) else math.inf
        limit = partial(deadline.time_limit, half, work=self.request.by_work)
        with limit(), share_of_time(1, f"exact {STEPS[4]}", self.cut_off):
            found = influence(structure)
            if first is not None and found.exact:
                result = final_state(structure, first, matrix=found)
            matrix = found
        matrix = matrix or influence_in_floats(structure)  # whatever the time
        if not matrix.exact:
            try:
                with limit():
                    enclosed = enclose(matrix)
                    result = None if first is None else enclosed_final_state(enclosed, first)
                matrix = enclosed
            except OutOfTime:
                self.cut_off.append(STEPS[4])
            except NotEnclosedError as error:
                self.notes.append(f"the final state is floating point only: {error}")
        if result is None and first is not None:
            result = final_state(structure, first, matrix=matrix)
            if not np.isfinite(np.asarray(result)).all():
                result = None  # what the note of the enclosure tells
        if run is not None and result is not None:
            gap = float(np.abs(run.final_state - np.asarray(result)).max())
            if gap > SETTLED * max(float(max(map(abs, (*(x0 or ()), *sigma0)))), 1e-300):
                self.notes.append(
                    f"the simulated run is still {gap:.1e} from the final state: its slowest modes had not settled"
                )
        return matrix, result


def _search_and_prove(
    structure: Structure, theorem: Theorem, notes: list[str]
) -> tuple[LyapunovFunction | None, RateProof, float | None]:
    n = structure.graph.n_nodes
    nothing = RateProof(None, ())
    if n > SEARCH_NODES:
        notes.append(f"the search of the paper's certificate stops at {SEARCH_NODES} nodes; the graph has {n}")
        return None, nothing, None
    try:
        with np.errstate(all="ignore"):
            search = partial(_search, theorem, structure)
            (V,) = apart(search) if n > APART_NODES else search()
            numerical = theorem.rate(structure, V) if V.blocks else None
    except OutOfTime:
        raise
    except (LMIError, np.linalg.LinAlgError) as error:
        notes.append(f"no Lyapunov matrix was found: {error}")
        return None, nothing, None
    except (HypothesisError, ZeroDivisionError, OverflowError):
        # The structure meets the hypotheses exactly, so it is the floats that do not.
        notes.append("no Lyapunov matrix was found: the weights lie too far apart for floating point")
        return None, nothing, None
    if n > EXACT_NODES:
        notes.append(f"the paper's certificate is proved up to {EXACT_NODES} nodes; the graph has {n}")
        return V, nothing, numerical
    with np.errstate(all="ignore"):
        proof = theorem.prove(structure, V)
    if proof.failed:
        notes.append(proof.failed)
    return V, proof, numerical


def _search(theorem: Theorem, structure: Structure) -> list[LyapunovFunction]:
    return [theorem.lyapunov(structure)]


def _search_functions(
    structure: Structure, protocol: Protocol, method: str, at: Fraction | None, notes: list[str]
) -> Search:
    """Search Lyapunov functions for the instants that the screen reports, and for ``at``."""
    gain = protocol.gain
    clocks = [float(gain.clock_at_remaining(1 - fraction)) for fraction in FRACTIONS]
    own = None if at is None else float(gain.clock_at_remaining(float(1 - at / protocol.T)))
    if structure.graph.n_nodes <= EXACT_NODES:
        search = search_functions(ErrorSystem(structure), method, clocks, own)
    else:
        search = search_large(structure, method, clocks if own is None else [*clocks, own])
    notes.extend(search.notes)
    return search


def _precision_note(graph: SignedDigraph) -> str:
    """Tell how far apart the weights lie, where no rate was proved."""
    decades = graph.weight_decades
    if decades < MANY_DECADES:
        return "no rate was proved"
    return f"no rate was proved; the weights span {decades} decades, which may be too many for float64"


def _spectral_rate(structure: Structure, proved: Sequence[Fraction | None], notes: list[str]) -> float | None:
    if int(np.bincount(structure.strong_component).max()) > FACTOR_NODES:
        notes.append(f"the spectral rate is not computed for strong components above {FACTOR_NODES} nodes")
        return None
    try:
        rate = laplacian_spectrum(structure).spectral_rate
    except np.linalg.LinAlgError:
        rate = math.nan
    if rate is not None and not (rate > 0 and math.isfinite(rate) and max(x or 0 for x in proved) <= rate * (1 + 1e-6)):
        notes.append("the spectral rate was not found, or is lost in the rounding of float64")
        return None
    return rate
