"""Deadlines of agents of order n that are tried, and the search for the shortest one within a limit of the input.

The search is bisection with secants in the logarithms of deadline and bound. Every candidate is proved, by
:func:`~ptcc_certify.certificate.agents_part.prove_agents`, and compared with the limit exactly; it ends where a
deadline keeps the limit and one that is shorter by a thousandth does not. The bound need not be monotone in the
deadline: agents may fly towards each other.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property

from lmi.errors import NoCertificate
from lmi.exact.decimal_rounding import up
from ptcc_certify.bounds.input.tightest_bound import log
from ptcc_certify.certificate.agents_answer import AgentsAnswer
from ptcc_certify.certificate.agents_part import prove_agents
from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.gain_design.request import Request
from ptcc_certify.model import Protocol
from ptcc_certify.model.agents import MOST_MOTION, Agents

#: A deadline that is shorter by this share than the one that is found does not keep the limit.
TOLERANCE = Fraction(1, 1000)
#: Significant digits of deadlines and of ``rho1``.
DIGITS = 7
#: How often the deadline is doubled or halved until it is bracketed.
_DOUBLINGS = 60
#: The logarithm of the excess of what is not proved at all.
_HOPELESS = 700.0


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

    def meets(self, request: Request) -> bool:
        """Tell whether what is proved suffices."""
        excess = self.excess(request)
        return excess is not None and excess <= 1


def at_deadline(protocol: Protocol, T: Fraction) -> Protocol:
    """Return a protocol with another deadline: ``rho1 T`` is kept, but for rounding, and so are shares of ``T``.

    Examples
    --------
    >>> from ptcc_certify.gain_design.agents_deadlines import at_deadline
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
        met = [c for c in self.tried.values() if c is not None and c.meets(self.request)]
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
