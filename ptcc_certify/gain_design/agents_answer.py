"""The answer to what is asked of the input of agents of order n: a deadline, and what is proved of it."""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

from lmi.exact.decimal_rounding import down, float_up, up
from ptcc_certify.gain_design.answer import DesignAnswer, texts
from ptcc_certify.graphs.rationals import short_exact
from ptcc_certify.model.agents import Agents


@dataclass(frozen=True, repr=False)
class AgentsDesign(DesignAnswer):
    """What was asked of agents of order n, and a deadline that is proved to meet it; made by :func:`design_agents`.

    Attributes
    ----------
    peak, residual : Fraction or None
        Proved at ``deadline``: the largest input of an agent, and what is left of a position under a gain cap.
    shortest_possible : Fraction or None
        No input within the limit brings the agents where the protocol does by a shorter deadline, proved; None if
        nothing is known: under a gain cap, of agents that move by themselves, and of the cascade.
    agents : Agents
    too_short : Fraction or None
        The longest deadline below ``deadline`` that was tried, and whose bounds do not keep the limit.

    Examples
    --------
    >>> pair = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -3)])
    >>> answer = design_agents(pair, Agents(order=2), InitialState([1, 1], v0=[0, 1]), max_input=10)
    >>> answer.verdict, answer.certificate.verdict, bool(answer.peak <= 10)
    ('met', 'certified', True)
    >>> bool(answer.shortest_possible <= answer.too_short < answer.deadline)
    True
    """

    agents: Agents = field(kw_only=True)
    too_short: Fraction | None = None

    @property
    def gain_cap(self) -> Fraction | None:
        """Where the gain is capped; None if it is not."""
        return self.agents.cap

    @property
    def ratio(self) -> float | None:
        """The deadline over the shortest possible one, rounded up; None where one is not known."""
        if not self.deadline or not self.shortest_possible:
            return None
        return float_up(self.deadline / self.shortest_possible)

    @property
    def request_text(self) -> str:
        """What was asked, in one line."""
        asked = self.asked
        text = f"||u_k|| <= {short_exact(asked.max_input)} from the given initial state, "
        text += "shortest deadline" if asked.deadline is None else f"deadline {short_exact(asked.deadline)}"
        return text + ("" if asked.residual is None else f", positions within {short_exact(asked.residual)}")

    @property
    def bounds_text(self) -> str:
        """What is proved of input and positions at the deadline, in one line; empty without a certificate."""
        if self.peak is None or self.residual is None:
            return ""
        where = f"every position within {up(self.residual)} of its place" if self.residual else "every agent in place"
        return f"||u_k|| <= {up(self.peak)}, {where} at T"

    @property
    def gains_text(self) -> str:
        """The parameters of the protocol, exact, and the gains of the agents; empty where there are none."""
        if self.protocol is None or self.certificate is None or self.certificate.proof.agents is None:
            return ""
        text = ", ".join(f"{name}={short_exact(value)}" for name, value in self.protocol.parameters.items())
        return f"{text}; {self.certificate.proof.agents.gains_text}"

    @property
    def deadline_text(self) -> str:
        """What is proved of shorter deadlines, in one line; empty where nothing is."""
        clauses = ["every one is met"] if self.peak == 0 else []
        if self.certificate is not None and self.deadline is not None and self.too_short is not None:
            clauses = [f"{short_exact(self.deadline)} is met, {short_exact(self.too_short)} not by these bounds"]
        if self.shortest_possible is not None:
            clauses.append(f"no gains meet one below {down(self.shortest_possible)}")
        return "; ".join(clauses)

    @property
    def ratio_text(self) -> str:
        """How far the deadline is from the shortest possible one, in one line; empty where that is not known."""
        if self.ratio is None or self.certificate is None:
            return ""
        return f"the deadline is at most {up(self.ratio, 3)} times the shortest possible one"

    def to_dict(self) -> dict[str, Any]:
        """Return the design as JSON-ready data, exact numbers as texts, without the certificate."""
        own = {"agents": self.agents.text(), "ratio": self.ratio}
        return self._summary() | texts(self, "too_short") | own

    def __repr__(self) -> str:
        if self.deadline is None or self.certificate is None or self.peak is None:
            return f"AgentsDesign({self.verdict}: {self.binding})"
        return f"AgentsDesign({self.verdict}, T={short_exact(self.deadline)}, peak {up(self.peak)})"
