"""The shortest deadline of agents of order n within a limit of their input.

Of chains of integrators gain and bound scale with the deadline alone: the Lyapunov function of the graph fixes the
gains ``K`` up to the decay ``R``, which is least at ``R = 2 n``, where the input is bounded; multiplying ``rho1`` and
``rho2`` by one number changes ``K`` and nothing else; and a larger share ``rho1 T/(rho2 kappa)`` of the constant
part of the gain raised the bound wherever it was tried. So the deadline is sought, with ``rho1 T``, ``rho2 kappa`` and
``R`` as they are. Of the cascade ``alpha`` takes the place of ``R``.
There, and where agents meet at rest, ``rho2 kappa`` is raised if the input is not bounded by the one that is given.

Deadlines that were not tried are excluded by nothing but what holds for all gains of the protocol:
:mod:`ptcc_certify.gain_design.deadline_search`.

The search is bisection with secants in the logarithms of deadline and bound. Every candidate is proved, by
:func:`~ptcc_certify.certificate.agents_part.prove_agents`, and compared with the limit exactly; it ends where a
deadline keeps the limit and one that is shorter by a thousandth does not. The bound need not be monotone in the
deadline: agents may fly towards each other.

How long agents of order n need at least, whoever steers them, if their input is within a limit.

Let ``x^(n) = u`` with ``|u| <= U``, and let ``D_i`` be the i-th derivative of its deviation from a free motion at the
beginning, which is 0 at ``T`` with all its derivatives up to ``n - 1``. Integration by parts against the Chebyshev
polynomial ``U_j`` of the second kind, shifted to ``[0, T]``, whose absolute value has the integral ``T``, gives

    | sum_{q < n} 4^q q! C(j + q + 1, 2 q + 1) D_(n-1-q) T^(-q) | <= U T,      j = 0, .., n - 1.

With ``n = 1`` this is ``|D| <= U T``; with ``n = 2`` it is ``|D_1| <= U T`` and ``|2 D_1 + 4 D_0/T| <= U T``. In space
it holds of Euclidean norms.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from math import comb, factorial, lcm
from typing import Any

from lmi.errors import NoCertificate
from lmi.exact.decimal_rounding import up
from lmi.exact.polynomials import product, shifted
from ptcc_certify.bounds.agents.each_agent import scaled_states
from ptcc_certify.bounds.final_state.enclosed_ends import agents_ends
from ptcc_certify.bounds.input.tightest_bound import log
from ptcc_certify.certificate.agents_answer import AgentsAnswer
from ptcc_certify.certificate.agents_part import prove_agents
from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.certificate.certification import certify
from ptcc_certify.errors import Change, ParameterError, gated
from ptcc_certify.gain_design.answer import INFEASIBLE, MET, UNPROVED, AgentsDesign, refusal
from ptcc_certify.gain_design.request import Request
from ptcc_certify.graphs.digraph import Exact
from ptcc_certify.graphs.io import as_graph
from ptcc_certify.graphs.rationals import short_exact, shorten
from ptcc_certify.model import NominalProtocol, Protocol
from ptcc_certify.model.agents import MOST_MOTION, Agents
from ptcc_certify.model.asks import Asks, Expectations
from ptcc_certify.model.parameters import parameter

#: A shortest time is found to one part in ``2^20``.
_BITS = 20


def shortest_time(deviations: Sequence[Sequence[Fraction]], limit: Fraction) -> Fraction:
    """Return a time below which no input within a limit ends a deviation from a free motion; 0 if there is none.

    Parameters
    ----------
    deviations : d rows of n Fraction
        Of position, velocity and so on, in each coordinate of space.
    limit : Fraction
        Positive: ``U`` of the Euclidean norm of the input, in units of the input.

    Returns
    -------
    Fraction
        In units of time.

    Examples
    --------
    >>> float(shortest_time([[Fraction(1)]], Fraction(2)))
    0.5
    >>> float(shortest_time([[Fraction(1), Fraction(0)]], Fraction(1)))  # bang-bang: full speed up, full speed down
    2.0
    """
    n = len(deviations[0])
    bounds = [_largest_root(_excess(deviations, j, limit)) for j in range(n)]
    return max((1 / z for z in bounds if z), default=Fraction(0))


def _excess(deviations: Sequence[Sequence[Fraction]], j: int, limit: Fraction) -> list[int]:
    """Return ``(z |..|)^2 - U^2`` as a polynomial in ``z = 1/T``, the highest power first, times a positive number."""
    n = len(deviations[0])
    factors = [4**q * factorial(q) * comb(j + q + 1, 2 * q + 1) for q in range(n)]
    rows = [[c * row[n - 1 - q] for q, c in enumerate(factors)] for row in deviations]
    scale = lcm(limit.denominator, *(x.denominator for row in rows for x in row))
    total = [0] * (2 * n + 1)
    for row in rows:
        p = [int(x * scale) for x in reversed(row)] + [0]
        total = [a + b for a, b in zip(total, product(p, p), strict=True)]
    total[-1] -= int(limit * scale) ** 2
    return total


def _largest_root(p: list[int]) -> Fraction | None:
    """Return a number above which a polynomial is not negative; None if it is nowhere seen to be.

    Its Taylor coefficients there have one sign, so that it grows from there on.
    """
    if not any(p[:-1]):
        return None

    def grows(z: Fraction) -> bool:
        return min(shifted(p, z)) >= 0

    high = Fraction(1)
    while not grows(high):
        high *= 2
    while grows(high / 2):
        high /= 2
    low = high / 2
    while high - low > high / 2**_BITS:
        middle = (low + high) / 2
        low, high = (low, middle) if grows(middle) else (middle, high)
    return high


#: A deadline that is shorter by this share than the one that is found does not keep the limit.
TOLERANCE = Fraction(1, 1000)
#: Significant digits of deadlines and of ``rho1``.
DIGITS = 7
#: How often the deadline is doubled or halved until it is bracketed.
_DOUBLINGS = 60
#: The logarithm of the excess of what is not proved at all.
_HOPELESS = 700.0


@gated
def design_agents(
    graph: Any,
    agents: Agents,
    x0: Any,
    *,
    max_input: Exact,
    deadline: Exact | None = None,
    residual: Exact | None = None,
    protocol: Protocol | None = None,
    orientation: str | None = None,
) -> AgentsDesign:
    """Find the shortest deadline of agents of order n for which their input is proved to stay within a limit.

    Parameters
    ----------
    graph : graph-like
        In whatever form :func:`ptcc_certify.as_graph` takes.
    agents : Agents
        Of order n, or in a formation; their ``decay`` is ``2 n`` unless it is given. Of the cascade, and of agents that
        meet at rest, ``rho2`` is raised where that of ``protocol`` does not bound the input.
    x0 : state-like, N rows of coordinates, or InitialState
        Initial positions, in node order or by label, in units of length; an :class:`~ptcc_certify.InitialState` tells
        velocities and so on, too, which are 0 without it.
    max_input : int, float, str or Fraction
        Positive: bound of the Euclidean norm of every agent's input at all times, sliding terms included.
    deadline : int, float, str or Fraction, optional
        ``T``, in units of time: is it met? Without it the shortest deadline is sought.
    residual : int, float, str or Fraction, optional
        Positive, with ``agents.gain_cap``: how far every position may be from its place at the deadline.
    protocol : NominalProtocol or SlidingModeProtocol, optional
        Its ``rho1 T``, ``rho2 kappa`` and sliding terms are kept, its deadline is sought; by default nominal with
        ``rho2 kappa = 1`` and ``rho1 T = 1/1000``.
    orientation : {"information", "listens"}, optional
        See :func:`ptcc_certify.as_graph`.

    Returns
    -------
    AgentsDesign

    Raises
    ------
    ParameterError
        A number that is not positive, states that do not fit, single integrators without a formation, or something
        that is not searched: a decay below ``2 n``, a gain cap without a residual.

    References
    ----------
    The protocol (4) of [Zhu]_ for agents of order n; see "Agents of order n" in the theory.

    Examples
    --------
    >>> trio = SignedDigraph.from_edges([("a", "b", 1), ("b", "a", 1), ("a", "c", -1), ("c", "a", -1)])
    >>> square = Agents(order=2, offsets={"a": [0, 0], "b": [1, 0], "c": [0, 1]})
    >>> start = {"a": [0, 3], "b": [5, 1], "c": [-2, -4]}
    >>> answer = design_agents(trio, square, start, max_input=5)
    >>> answer.verdict, answer.certificate.assessment.text.split(";")[0]
    ('met', 'met: ||u_k|| <= 5')
    >>> design_agents(trio, square, start, max_input=5, deadline=1).verdict
    'infeasible'
    """
    request = Request(
        max_input=parameter("max_input", max_input),
        deadline=None if deadline is None else parameter("deadline", deadline),
        residual=None if residual is None else parameter("residual", residual),
    )
    _refuse(agents, request)
    agents = agents if agents.cascade is not None else replace(agents, decay=agents.decay_rate)
    template = NominalProtocol(T=1, rho1="0.001", rho2=1, kappa=1) if protocol is None else protocol
    graph, asks = graph if orientation is None else as_graph(graph, orientation), Asks(simulation=False)
    first = request.deadline or min(Fraction(1), longest(agents) / 2)
    base = certify(graph, at_deadline(template, first), x0, agents=agents, asks=asks)
    if base.proof.agents is not None and base.proof.agents.bounding_rho2 is not None:
        template = template.replace(rho2=base.proof.agents.bounding_rho2)
        base = certify(graph, at_deadline(template, first), x0, agents=agents, asks=asks)
    part = base.proof.agents
    if part is None or part.initial_state is None:
        raise ParameterError(("design of agents of order n starts from an initial state; give ", Change("x0")))
    least = _least_time(base, request)
    blank = AgentsDesign(UNPROVED, "", request, request.deadline, shortest_possible=least, agents=agents)
    if (reason := _unusable(base, part, request)) is not None:
        return replace(blank, binding=reason)
    search = Search(base, agents, template, request)
    if request.deadline is not None or part.in_place:  # agents in place need no input, nor more time
        candidate = search.at(first)
        if candidate is None or not request.met_by(candidate):
            return _without(blank, search, candidate)
    else:
        search.run(blank.shortest_possible or first)
        candidate = search.best
        if candidate is None:
            return _without(blank, search, search.nearest)
    asks = replace(asks, expectations=Expectations(max_input=request.max_input))
    again = certify(graph, candidate.protocol, x0, agents=agents, asks=asks)
    return _with(replace(blank, too_short=search.too_short), candidate, base, again)


def _refuse(agents: Any, request: Request) -> None:
    """Refuse what is not searched."""
    if not isinstance(agents, Agents):
        raise ParameterError("agents", f"= {shorten(repr(agents))}: give Agents(order=2) for double integrators")
    if agents.plain:
        raise ParameterError("agents", "these are single integrators; design(graph, ..) finds their gains")
    if agents.cascade is None and agents.decay_rate < 2 * agents.degree and agents.cap is None:
        raise ParameterError(
            "decay", f"below 2 n = {2 * agents.degree} no input is proved to be bounded; leave it out, or cap the gain"
        )
    if request.residual is not None and agents.cap is None:
        mend = () if agents.cascade is not None else (", or give ", Change("gain_cap"))
        why = "nothing is left at T without a gain cap, and no cap is searched for agents of order n; leave "
        raise ParameterError("residual", (why, Change("residual"), " out", *mend))
    if agents.cap is not None and request.residual is None:
        raise ParameterError(
            "gain_cap", ("leaves something at every deadline; give ", Change("residual"), ", how far a position may be")
        )


def _least_time(base: Certificate, request: Request) -> Fraction | None:
    """Return a deadline below which no input within the limit suffices; None if nothing is known."""
    part = base.proof.agents
    if part is None or part.initial_state is None or any(part.protocol.plant) or part.protocol.gain_cap is not None:
        return None
    if (
        any(part.protocol.own) or not base.graph_proof.influence.exact
    ):  # where agents that rest end depends on the gains
        return None
    offsets = part.protocol.offsets
    deviations: list[list[list[Fraction]]] = [[[] for _ in row] for row in offsets]
    states = scaled_states(part.initial_state, offsets, Fraction(1))
    for q in range(part.dimension):
        for i in range(part.order):
            begin = [agent[q][i] for agent in states]
            ends = agents_ends(base.graph_proof.influence, [(x, Fraction(0)) for x in begin])
            if any(radius for _, radius in ends):
                return None
            for k, (x, (end, _)) in enumerate(zip(begin, ends, strict=True)):
                deviations[k][q].append(x - end)
    return max(shortest_time(rows, request.max_input) for rows in deviations) or None


def _unusable(base: Certificate, part: AgentsAnswer, request: Request) -> str | None:
    """Tell what is missing, whatever the deadline; None if nothing is."""
    if part.grows:
        least = up(1 / part.protocol.gain.pole, 4)
        return f"no agent listens to another, and the input grows without limit: give cascade {least} or more"
    if not part.functions and not part.alone:
        return base.observed.notes[0] if base.observed.notes else "no decay was proved"
    if part.unbounded:
        at = f"at T = {short_exact(part.protocol.gain.T)}"
        return f"the input is not proved bounded {at}: {', '.join(why for why, _ in part.unbounded)}"
    if part.inputs is None:
        return "no input of single agents is proved for a graph of this size"
    if part.protocol.gain_cap is not None and part.residual is None and not part.alone:
        return "no deviation of single agents is proved for a graph of this size"
    terms, forces = part.sliding_terms, abs(part.protocol.plant[0])
    places = forces * max(sum(map(abs, h), Fraction(0)) for h in part.protocol.offsets)
    if terms + places < request.max_input:
        return None
    reasons = [f"the sliding terms {short_exact(terms)}"] if terms else []
    if places:
        reasons.append(f"the force that holds agents in their places {up(places)}")
    return f"whatever the deadline, the limit is taken by {' and '.join(reasons)}: give a larger limit or a smaller mu1"


def _with(blank: AgentsDesign, candidate: Candidate, base: Certificate, again: Certificate) -> AgentsDesign:
    """Return the answer with a certificate: the one that certify makes by itself, if it meets what is asked."""
    asked = blank.asked
    own = None if again.proof.agents is None else Candidate(candidate.deadline, candidate.protocol, again.proof.agents)
    repeatable = own is not None and asked.met_by(own) and again.verdict == "certified"
    if own is None or not repeatable:
        own, changes = candidate, {"protocol": candidate.protocol, "agents": candidate.part}
        again = base.changed(**changes, expectations=Expectations(max_input=asked.max_input))
        if refused := refusal(again):
            return replace(blank, binding=refused)
    peak, residual, inputs = own.peak, own.residual, own.part.inputs
    assert peak is not None and residual is not None and inputs is not None
    label = again.graph_proof.graph.labels[inputs.index(peak)]
    binding = f"the bound of the input of agent {shorten(label)}, {up(100 * peak / asked.max_input, 4)} % of the limit"
    if asked.residual is not None and residual / asked.residual > peak / asked.max_input:
        binding = f"what the gain cap leaves, {up(100 * residual / asked.residual, 4)} % of what is allowed"
    if not peak:
        alone = "no agent listens to another, and none needs an input: every deadline is met"
        binding = f"nothing binds: {alone if own.part.alone else 'agents are in place and need no input'}"
    return replace(
        blank,
        verdict=MET,
        binding=binding,
        deadline=own.deadline,
        certificate=again,
        peak=peak,
        residual=residual,
        repeatable=repeatable,
    )


def _without(answer: AgentsDesign, search: Search, nearest: Candidate | None) -> AgentsDesign:
    """Return the answer without a certificate: what is not met, by how much, and which deadline would be."""
    asked = answer.asked
    if answer.excluded:
        return replace(answer, verdict=INFEASIBLE, binding=answer.excluded)
    if nearest is None or nearest.peak is None:
        return replace(answer, binding="no matrix for these agents was proved")
    text = f"at T = {short_exact(nearest.deadline)} the proved peak is {up(nearest.peak)}"
    text += f", {up(nearest.peak / asked.max_input)} times the limit"
    if nearest.residual:
        text += f", and {up(nearest.residual)} is left of a position"
    if asked.deadline is None:
        return replace(answer, binding=f"{text}; no deadline that was tried keeps the limit")
    search.run(asked.deadline)
    best = search.best
    mend = (
        "no longer deadline that was tried keeps it" if best is None else f"T = {short_exact(best.deadline)} keeps it"
    )
    return replace(answer, binding=f"{text}; {mend}", peak=nearest.peak, residual=nearest.residual)


# ---------------------------------------------------------------------- the search


@dataclass(frozen=True)
class Candidate:
    """A deadline, and what is proved of it."""

    deadline: Fraction
    protocol: Protocol
    part: AgentsAnswer

    @cached_property
    def peak(self) -> Fraction | None:
        """The largest bound of an input; None if none is proved."""
        return None if self.part.inputs is None else max(self.part.inputs)

    @cached_property
    def residual(self) -> Fraction | None:
        """The largest deviation of a position at the deadline; None if none is proved."""
        if self.part.protocol.gain_cap is None or self.part.alone:
            return Fraction(0)
        return None if self.part.residual is None else max(row[0] for row in self.part.residual.agents)

    def excess(self, request: Request) -> Fraction | None:
        """Return what is proved over what is asked, the larger of two; at most 1 if it is met, None if it is open."""
        if self.peak is None or self.residual is None:
            return None
        beyond = self.residual / request.residual if request.residual else Fraction(0)
        return max(self.peak / request.max_input, beyond)


def at_deadline(protocol: Protocol, T: Fraction) -> Protocol:
    """Return a protocol with another deadline: ``rho1 T`` is kept, but for rounding, and so are shares of ``T``.

    Examples
    --------
    >>> from ptcc_certify.gain_design.deadline_search import at_deadline
    >>> at_deadline(NominalProtocol(T=1, rho1=1, rho2=3, kappa=2), Fraction(4))
    NominalProtocol(T=4, rho1=0.25, rho2=3, kappa=2)
    """
    share = T / protocol.T
    rho1, reaching = Fraction(up(protocol.rho1 / share, DIGITS)), protocol.reaching
    if reaching is None:
        return protocol.replace(T=T, rho1=rho1)
    T_r = min(Fraction(up(reaching.T_r * share, DIGITS)), T * (1 - Fraction(1, 10**DIGITS)))
    return protocol.replace(T_r=T_r, T_s=T - T_r, rho1=rho1)


def longest(agents: Agents) -> Fraction:
    """Return the longest deadline of agents that move by themselves; that of others is as good as without a limit."""
    if not any(agents.coefficients):
        return Fraction(2) ** _DOUBLINGS
    return MOST_MOTION / (1 + max(map(abs, agents.coefficients)))


@dataclass
class Search:
    """The search of a deadline: candidates by their deadlines, each proved once."""

    base: Certificate
    agents: Agents
    template: Protocol
    request: Request
    tried: dict[Fraction, Candidate | None] = field(default_factory=dict)

    def at(self, T: Fraction) -> Candidate | None:
        """Return what is proved of a deadline; None if no matrix is found."""
        if T not in self.tried:
            self.tried[T] = self._prove(T)
        return self.tried[T]

    def _prove(self, T: Fraction) -> Candidate | None:
        first, protocol = self.base.proof.agents, at_deadline(self.template, T)
        assert first is not None
        try:
            states = first.protocol.offsets, first.initial_state
            part = prove_agents(self.base.graph_proof, protocol, self.agents, *states)
        except NoCertificate:
            return None
        return Candidate(T, protocol, part)

    def run(self, start: Fraction) -> None:
        """Bracket the limit from a first deadline on, and narrow it down to the tolerance."""
        from scipy.optimize import brentq

        most = log(longest(self.agents))
        ends = [min(log(start), most)]
        outside = self.margin(ends[0]) > 0
        for _ in range(_DOUBLINGS):
            following = ends[-1] + (math.log(2) if outside else -math.log(2))
            if ends[-1] == most and outside:
                return
            ends.append(min(following, most))
            if (self.margin(ends[-1]) > 0) != outside:
                break
        else:
            return
        brentq(self.margin, *sorted(ends[-2:]), xtol=float(TOLERANCE) / 2)

    def margin(self, z: float) -> float:
        """Return the logarithm of what is proved over what is asked, at the deadline ``e^z``."""
        candidate = self.at(Fraction(up(math.exp(z), DIGITS)))
        excess = None if candidate is None else candidate.excess(self.request)
        return _HOPELESS if excess is None else min(max(log(excess), -_HOPELESS), _HOPELESS)

    @property
    def best(self) -> Candidate | None:
        """The shortest deadline that is proved to meet what is asked."""
        met = [c for c in self.tried.values() if c is not None and self.request.met_by(c)]
        return min(met, key=lambda c: c.deadline, default=None)

    @property
    def nearest(self) -> Candidate | None:
        """The candidate that exceeds what is asked least."""
        found = [(c.excess(self.request), c) for c in self.tried.values() if c is not None]
        return min(((x, c) for x, c in found if x is not None), key=lambda pair: pair[0], default=(0, None))[1]

    @property
    def too_short(self) -> Fraction | None:
        """The longest deadline tried that is shorter than the best one."""
        best = self.best
        return None if best is None else max((T for T in self.tried if best.deadline > T), default=None)
