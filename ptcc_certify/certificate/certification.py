"""``certify``: from a graph, a protocol and an initial state to a certificate, step by step.

Structure, theorem, Lyapunov functions, proved rates, upper bound, final state, and the word of the independent check.
Every claim of a certificate outside ``unverified`` was established in exact or ball arithmetic, and verified again by
the check; a simulation corroborates and never proves.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

from lmi.blas_threads import one_thread
from ptcc_certify.bounds.delay.case import LateCase
from ptcc_certify.bounds.delay.late_messages import LateBounds, bound_late
from ptcc_certify.bounds.delay.longest_delay import longest_delay, longest_forgiven, with_forms, with_forms_of_family
from ptcc_certify.certificate.agents_request import formation_on_a_line, read_chains, with_vehicles
from ptcc_certify.certificate.assessment import rejects
from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.certificate.family_certification import certify_family, refuse_signals
from ptcc_certify.certificate.family_proof import FamilyProof
from ptcc_certify.certificate.graph_certification import STEPS, GraphSteps, with_agents
from ptcc_certify.certificate.graph_proof import GraphProof
from ptcc_certify.certificate.graph_sections import stated_ends
from ptcc_certify.certificate.request import (
    Question,
    listener,
    origins_of,
    read_initial_state,
    read_request,
    read_sliding_variable,
    refuse_long_weights,
)
from ptcc_certify.checker.input_formulas import Limits
from ptcc_certify.checker.reading import Interval
from ptcc_certify.errors import HypothesisError, ParameterError, gated
from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.io import as_family, as_graph
from ptcc_certify.graphs.io.conversion import is_family
from ptcc_certify.graphs.rationals import shorten
from ptcc_certify.graphs.size_limits import EXACT_NODES, ONE_THREAD_NODES
from ptcc_certify.graphs.structure import BIPARTITE_CONSENSUS, STABILITY, analyse
from ptcc_certify.lyapunov.follower_rows import leading_group, listeners, refuse_other_targets
from ptcc_certify.model import Protocol
from ptcc_certify.model.agents import Agents
from ptcc_certify.model.asks import Asks, Case
from ptcc_certify.model.constrained_switching import SignalClass
from ptcc_certify.model.late_messages import LateMessages, MovingLeaders
from ptcc_certify.model.refusals import (
    asked_of_signals,
    refuse_agents,
    refuse_before_the_graph,
    refuse_beside,
    refuse_exchanged,
    refuse_of_families,
)
from ptcc_certify.theorems.family_behaviour import decide


def with_messages(certificate: Certificate) -> Certificate:
    """Add what is left at the deadline, where messages are late or leaders move; of one graph the longest delay, too.

    Lyapunov functions of a whole graph forgive small delays under a cap.

    Raises
    ------
    HypothesisError
        Where followers are drawn to depends on the signal, or leaders hear somebody in some mode.
    """
    proof = certificate.proof
    if (messages := proof.request.messages) is None:
        return certificate
    case = LateCase(proof.question.subject, proof.protocol, messages, proof.initial_state, _ends(proof))
    late = bound_late(case)
    if isinstance(proof, FamilyProof) and case.led_by_groups:
        late = with_forms_of_family(late, [(part.component, part.functions) for part in proof.parts])
    if not isinstance(proof, GraphProof) or late.tracks:
        return certificate.changed(late=late)
    case = replace(late.case, influence=proof.influence, forms=proof.decaying_forms)
    late = with_forms(replace(late, case=case))
    if messages.age and not late.rows:  # which bear any delay
        late = replace(late, longest_delay=longest_forgiven(case))
    certificate, asked = certificate.changed(late=late), certificate.expectations.max_residual
    if asked is not None and messages.age and proof.graph.n_nodes <= EXACT_NODES:
        certificate = certificate.changed(late=replace(late, enough=_longest_delay(certificate, late, asked)))
    return certificate


def _ends(proof: GraphProof | FamilyProof) -> Sequence[Interval] | None:
    """Return where agents end, as middles and radii that a file states; None where some end is not known."""
    if isinstance(proof, GraphProof):
        return stated_ends(proof.influence, proof.final_state, proof.initial_state)
    return proof.ends


def _longest_delay(certificate: Certificate, late: LateBounds, asked: Fraction) -> Fraction | None:
    """Return nearly the longest delay that leaves so little, if the check accepts what a certificate states of it."""
    longest = longest_delay(late, asked)
    if longest is None or longest is late:
        return None if longest is None else late.messages.age
    return None if rejects(certificate.changed(late=longest).checked) else longest.messages.age


@gated  # type: ignore[misc]  # it takes the parts below, no others
def certify(
    graph: Any,
    protocol: Protocol,
    x0: Any = None,
    *,
    uncertainty: Any = 0,
    signal: SignalClass = "any",
    agents: Agents | None = None,
    messages: LateMessages | None = None,
    leaders: MovingLeaders | None = None,
    limits: Limits | Sequence[Limits] = (),
    asks: Asks | None = None,
) -> Certificate:
    """Certify what a protocol does on a signed digraph, or on a family of these whatever the signal.

    Parameters
    ----------
    graph : graph-like
        Any signed digraph, disconnected ones included, in whatever form :func:`ptcc_certify.as_graph` takes; or a
        family, as :func:`ptcc_certify.as_family` takes it, such as ``{"day": day, "night": night}``.
    protocol : NominalProtocol or SlidingModeProtocol
        With ``rho2 > 0``. Under the sliding-mode protocol everything is claimed for all disturbances within ``delta``.
    x0 : state-like or InitialState, optional
        The initial state, in node order, or by label where there are labels: whatever :func:`ptcc_certify.as_state`
        takes. An :class:`~ptcc_certify.InitialState` tells sliding variables, velocities and so on, too. Without it
        there is no final state and no simulation.
    uncertainty : number or str
        Of every weight, as a share of it, such as "10%": then the graph is a family.
    signal : {"any", "constant"}, DwellTime, JointWindows or ClockShares
        Of a family: restricted signals of which more is claimed, beside what holds for every signal; the three classes
        are in :mod:`ptcc_certify.model.constrained_switching`.
    agents : Agents, optional
        Agents of order n, or in a formation; without them ``x' = u``. Then ``x0`` may be N rows of coordinates.
    messages : LateMessages, optional
        How late, how often lost and how inexact is what agents hear; what is left at the deadline then is bounded. With
        single leaders, leader groups that hear each other at once, or a cap; ``sigma(0) = 0`` under the sliding-mode
        protocol.
    leaders : MovingLeaders, optional
        Nominal protocol, single leaders: how fast these move; how followers track them is bounded, with ``messages``
        and under a cap what is left at the deadline.
    limits : GainLimits or sequence of GainLimits
        Nominal protocol: caps, stops and sampling of the gain, under which what is left at the deadline is bounded.
        With sampling, which may drive agents apart, it is certified if ``||E||`` is no larger there than at first.
    asks : Asks, optional
        How it is searched, for which initial states the input is bounded, under which disturbances and noise, whether
        it is simulated, in which time, and what is expected of it.

    Returns
    -------
    Certificate
        A family takes ``x0``, ``signal`` (under the nominal protocol), and of ``asks`` time limit and expectations.

    Raises
    ------
    ParameterError
        A part that families do not take, no protocol, ``rho2 = 0`` (no deadline), a time limit that is not positive,
        an initial state of the wrong length, with other labels than the nodes, beyond 1e300 or of thousands of digits,
        or a disturbance beyond ``delta``.

    References
    ----------
    Theorems 1 to 6, Corollaries 1 to 10 and Proposition 1 of [Zhu]_.

    Examples
    --------
    >>> g = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])
    >>> cert = certify(g, NominalProtocol(T="0.6", rho1=1, rho2=2, kappa=1), [3, 5])
    >>> cert
    Certificate(certified; signed-average consensus, Theorem 1.1, rate 3.99999)
    >>> cert.final_state
    FinalState(1=-1, 2=1)
    >>> robust = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=2, mu1=2, mu2=1, mu3=1, delta=1)
    >>> cert = certify(g, robust, InitialState([3, 5], sigma0=[1, 0]), asks=Asks(disturbance="sin(5*k*t)"))
    >>> cert
    Certificate(certified; signed-average consensus, Theorem 4.1, rate 3.99999)
    >>> cert.reaching
    (ReachingTime(0.43409, 0.565 before T_r), ReachingTime(0, 1 before T_r))
    >>> cert.final_state
    FinalState(1=-1.5, 2=1.5)
    >>> certify(g, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), uncertainty="10%")
    Certificate(certified; bipartite consensus for every signal, rate 3.59999)
    """
    return certify_case(Case(graph, protocol, x0, uncertainty, signal, agents, messages, leaders, limits, asks))


def certify_case(
    case: Case,
    *,
    progress: Callable[[str], None] | None = None,
    scenario: Mapping[str, Any] | None = None,
    origins: Mapping[str, str] | None = None,
) -> Certificate:
    """Certify a case, and keep where it comes from.

    Parameters
    ----------
    case : Case
    progress : callable, optional
        Is told each step as it begins: ``STEPS`` of one graph, or of a family.
    scenario : mapping, optional
        The scenario file that asked for it, as JSON: kept in the certificate under ``unverified.scenario``.
    origins : mapping of str to str, optional
        What ``"graph"`` is called, and where ``"x(0)"`` and ``"sigma(0)"`` come from, where the case does not tell:
        kept under ``unverified.origins``, and told by ``summary``.

    Returns
    -------
    Certificate
    """
    origins = origins_of(case.graph, case.initial) | dict(origins or {})
    of_family = bool(case.uncertainty or is_family(case.graph))
    case = with_vehicles(case.with_plain_agents(of_family)).with_rows(of_family)
    _refuse_before_reading(case)
    refuse_before_the_graph(case)
    progress, structure = listener(progress), None if of_family else analyse(as_graph(case.graph))
    if structure is not None and asked_of_signals(structure, case):
        of_family, case = True, replace(case, graph=[structure.graph]).with_rows(of_family=True)
    family = _read_family(case) if of_family else None
    if structure is None or family is not None:
        assert family is not None
        structure = analyse(family.modes[0].mandatory)  # for its nodes alone
    graph = structure.graph
    if family is None:
        if case.signal != "any":
            raise ParameterError("signal is for families of graphs, which change; this is one graph: leave it out")
        refuse_long_weights(graph)
    else:
        refuse_signals(family, case)
    chains, formation, agents = None, None, case.agents
    if agents is not None:
        chains = read_chains(agents, graph, case.protocol.gain, case.initial)
        formation = formation_on_a_line(case, agents, chains, of_family)
    if formation is not None:
        case, chains = formation.case_of(case), None
    request = read_request(structure, case, scenario, origins)
    if formation is not None:
        request = replace(request, initial_set=formation.shift(request.initial_set))
    if family is None:
        refuse_beside(structure, case)
    x0 = None if chains else case.initial.x0
    state = None if x0 is None else read_initial_state(structure, x0, "x0")
    manifold, reaching = read_sliding_variable(structure, case.protocol, case.initial.sigma0)
    if case.messages is not None and any(manifold or ()):
        raise ParameterError("sigma0", "late messages ask for 0, so that no sliding variable moves; leave it out")
    question = Question(structure if family is None else family, case.protocol, state, manifold, request)
    with one_thread(graph.n_nodes <= ONE_THREAD_NODES):
        if family is not None:
            certificate = certify_family(family, question, reaching, progress)
        else:
            steps = GraphSteps(structure, question, progress)
            wanted = steps.needs_run(case.asks.simulation)
            certificate = steps.certificate(case.asks.disturbance, wanted and state is not None, reaching)
            if agents is not None and chains is not None:
                certificate = with_agents(certificate, agents, chains, wanted)
        if formation is not None:
            certificate = certificate.changed(offsets=formation.offsets)
        certificate = with_messages(certificate)
        progress(STEPS[5])
        return with_word_of_check(certificate)


def with_word_of_check(certificate: Certificate) -> Certificate:
    """Check a certificate, and note what the check has to say besides."""
    if (report := certificate.checked) is None:
        return certificate  # nothing is decided that a file could hold
    if report.accepted and report.memory > 1:
        note = f"the check of this certificate needs more than 1 GB: allow {math.ceil(report.memory)} GB of memory"
        return certificate.changed(notes=(*certificate.observed.notes, note))
    if not report.accepted:
        note = f"the independent check does not accept {report.rejected}: {report.reason}"
        return certificate.changed(notes=(note, *certificate.observed.notes))
    return certificate


def _read_family(case: Case) -> Family:
    """Return the family that is asked about, or refuse what it does not take."""
    refuse_of_families(case)
    family = as_family(case.graph, uncertainty=case.uncertainty)
    if case.messages is not None or case.leaders is not None:
        asked, mend, messages = "leaders that move", "leave it out", case.messages
        if case.leaders is not None and case.leaders.growth:
            _refuse_uncarried(family)
        if case.leaders is not None and case.leaders.saturation:
            refuse_other_targets(family, "inputs that are clipped", "do without saturation")
        if messages is not None:
            asked, late = messages.asked, messages.age > 0 and messages.gain_cap is None
            driven = messages.vehicles is not None and not messages.settles
            if messages.at_rest and not late and not driven:
                leading_group(family, asked)
                return family
            if messages.at_rest:
                mend = "add a gain cap" if late else "leave out the vehicles, or what is off"
                if not late:
                    what = messages.asked_of_leaders if messages.exact else messages.name
                    asked = f"{what} of vehicles that exchange virtual positions"
        refuse_other_targets(family, asked, mend)
    return family


def _refuse_uncarried(family: Family) -> None:
    """Refuse agents that move by themselves where some target is neither 0, a leader nor its opposite."""
    for component in decide(family):
        if component.behaviour not in (STABILITY, BIPARTITE_CONSENSUS):
            one = shorten(component.family.labels[int(listeners(component.family)[0])])
            why = "its leaders are several, or paths from one disagree; do without growth"
            raise HypothesisError(
                f"agents that move by themselves do not stay at the mean that {one} is drawn to: {why}"
            )


def _refuse_before_reading(case: Case) -> None:
    """Refuse what is asked of agents of order n, velocities where there are none, and a graph that is none."""
    if case.agents is None and (case.initial.v0 is not None or case.initial.derivatives is not None):
        raise ParameterError("v0", "single integrators have no velocity to begin with; give agents=Agents(order=2)")
    others = case.agents is not None and not getattr(case.agents, "of_paper", False)
    if others and isinstance(case.protocol, Protocol):  # the paper's when their states are read
        refuse_agents(case)
    refuse_exchanged(case.graph)
