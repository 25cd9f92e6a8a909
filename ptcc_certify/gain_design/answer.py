"""The answer to what is asked of an input: gains, deadlines, and what is proved of them."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import numpy as np

from lmi.exact.decimal_rounding import down, float_up, up
from ptcc_certify.bounds.input.worst_initial_state import WorstInitialState, worst_initial_state
from ptcc_certify.certificate.assessment import CERTIFIED
from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.certificate.fact import Fact, Facts
from ptcc_certify.checker.input_formulas import Limits
from ptcc_certify.errors import ParameterError, SimulationError
from ptcc_certify.gain_design.request import DesignRequest, Request, fit_of
from ptcc_certify.graphs.rationals import format_exact, nearest_float, short_exact
from ptcc_certify.graphs.size_limits import TRACED_NODES
from ptcc_certify.lazy_report import Shown, rendered
from ptcc_certify.model import Protocol
from ptcc_certify.model.agents import Agents
from ptcc_certify.model.parameters import parameter

MET, INFEASIBLE, UNPROVED = "met", "infeasible", "not with this certificate"
#: Significant decimal digits of the gains and deadlines that are found.
DIGITS = 10


class TradeOff(NamedTuple):
    """Deadlines (M,), the peak input certified at each, and below which none of all gains can stay."""

    deadlines: np.ndarray
    certified: np.ndarray
    lower: np.ndarray


def refusal(certificate: Certificate) -> str:
    """Tell that the independent check does not accept a certificate, and why; empty if it does."""
    report = certificate.checked
    if certificate.verdict == CERTIFIED or report is None:
        return ""
    if report.accepted:
        return "the independent check accepts it as undecided, not as certified"
    return f"the independent check does not accept {report.rejected}: {report.reason}"


def texts(source: Any, *names: str) -> dict[str, str | None]:
    """Return exact numbers of an object as texts, by name."""
    values = ((name, getattr(source, name)) for name in names)
    return {name: None if x is None else format_exact(x) for name, x in values}


@dataclass(frozen=True, repr=False)
class DesignAnswer(Shown):
    """What was asked of an input, and what is proved of it, whatever the agents.

    Attributes
    ----------
    verdict : {"met", "infeasible", "not with this certificate"}
        ``infeasible``: no gains of the protocol can, proved. The third says that the bounds of this certificate do not
        suffice, and nothing about other gains.
    binding : str
        What binds, and how far off it is, or what is missing.
    asked : Request
        The limit, deadline and residual, and what else is asked.
    deadline : Fraction or None
        ``T``, in units of time; None if none was asked for and none is certified.
    certificate : Certificate or None
        What proves it; None unless the verdict is ``met``.
    peak : Fraction or None
        The proved peak of the input at ``deadline``, also if it is too large.
    residual : Fraction or None
        How far an agent is from its final state, or from its place, at the deadline, at most; 0 without a cap.
    shortest_possible : Fraction or None
        No gains of the protocol meet a shorter deadline within the limit, proved; None if nothing is known.
    repeatable : bool
        Whether :func:`ptcc_certify.certify` proves the same of these gains by the functions that it finds itself.
    """

    verdict: str
    binding: str
    asked: Request
    deadline: Fraction | None = None
    certificate: Certificate | None = None
    peak: Fraction | None = None
    residual: Fraction | None = None
    shortest_possible: Fraction | None = None
    repeatable: bool = False
    residual_name: ClassVar[str]

    @property
    def protocol(self) -> Protocol | None:
        """The gains; None unless the verdict is ``met``."""
        return None if self.certificate is None else self.certificate.protocol

    @property
    def excluded(self) -> str:
        """That no gains meet the deadline that was asked for, in one line; empty where that is not proved."""
        T, least = self.asked.deadline, self.shortest_possible
        if T is None or least is None or least <= T:
            return ""
        return f"no gains meet a deadline below {down(least)}, {down(least / T)} times the one asked for"

    @property
    def request_text(self) -> str:
        """What was asked, in one line."""
        deadline, residual = self.asked.deadline, self.asked.residual
        text = f"{self.size} <= {short_exact(self.asked.max_input)} from {self.states_text}, "
        text += "shortest deadline" if deadline is None else f"deadline {short_exact(deadline)}"
        return text + ("" if residual is None else f", {self.residual_name} {short_exact(residual)}")

    @property
    def bounds_text(self) -> str:
        """What is proved of input and deviation at the deadline, in one line; empty without gains."""
        if self.peak is None or self.residual is None:
            return ""
        return f"{self.size} <= {up(self.peak)}, {self.ends_text} at T"

    @property
    @abstractmethod
    def size(self) -> str:
        """The size of the input that is limited, in symbols."""

    @property
    @abstractmethod
    def states_text(self) -> str:
        """The initial states."""

    @property
    @abstractmethod
    def ends_text(self) -> str:
        """How near to their ends all agents are."""

    @property
    def gains_text(self) -> str:
        """The parameters of the protocol, exact, in one line; empty where there are none."""
        p = self.protocol
        return "" if p is None else ", ".join(f"{name}={short_exact(value)}" for name, value in p.parameters.items())

    @property
    @abstractmethod
    def deadline_text(self) -> str:
        """What is proved of shorter deadlines, in one line; empty where nothing is."""

    @property
    @abstractmethod
    def ratio_text(self) -> str:
        """How far apart the deadlines are, in one line; empty where that is not known."""

    def facts(self) -> Facts:
        """Return what is told of it: request, verdict, what binds, gains, bounds, deadlines."""
        yield Fact(head="asked", note=self.request_text)
        why = self.bounds_text if self.protocol is not None else self.binding
        yield Fact(head="verdict", value=self.verdict, note=self.verdict, brief=(f"{self.verdict}: {why}",))
        texts = {"verdict": self.binding, "gains": self.gains_text, "proved": self.bounds_text}
        for head, text in (texts | {"deadline": self.deadline_text}).items():
            if text:
                yield Fact(head=head, note=text, detail=head in ("verdict", "proved"))
        if self.ratio_text:
            yield Fact(head="deadline", note=self.ratio_text, detail=True)

    def summary(self) -> str:
        """Return all that is told of it, as lines."""
        return "\n".join(rendered("screen.long_screen", self.facts()))

    def _summary(self) -> dict[str, Any]:
        """Return what all answers tell as JSON-ready data."""
        return {
            **{"verdict": self.verdict, "binding": self.binding},
            **texts(self.asked, "max_input"),
            "asked": texts(self.asked, "deadline", "residual"),
            "protocol": None if self.protocol is None else self.protocol.to_dict(),
            **texts(self, "gain_cap", "deadline", "peak", "residual", "shortest_possible"),
        }


@dataclass(frozen=True, repr=False)
class Design(DesignAnswer):
    """What was asked of an input, and the gains that are proved to meet it; made by :func:`design`.

    All gains are those of the nominal protocol.

    Attributes
    ----------
    asked : DesignRequest
        The limit, the initial states, deadline and residual.
    product : Fraction or None
        ``phi``, peak times deadline: what the gains found certify at any deadline.
    lower_by : str
        Why no gains meet a shorter deadline than ``shortest_possible``.

    References
    ----------
    The protocol (4) of [Zhu]_. With ``rho1 T`` and ``rho2 kappa`` fixed, gain and input scale as ``1/T``.

    Examples
    --------
    >>> pair = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -3)])
    >>> answer = design(pair, max_input=10, initial_bound=1, deadline=1)
    >>> answer.verdict, bool(answer.shortest_possible <= answer.shortest_certified <= 1)
    ('met', True)
    """

    residual_name: ClassVar = "deviation"
    asked: DesignRequest
    product: Fraction | None = None
    lower_by: str = ""

    @property
    def limits(self) -> Limits | None:
        """The cap of the gain that belongs to them; None if there is none."""
        return None if self.certificate is None or not self.certificate.limits else self.certificate.limits[0]

    @property
    def gain_cap(self) -> Fraction | None:
        """Where the gain is capped; None if it is not."""
        return None if self.limits is None else self.limits.gain_cap

    @property
    def certify_options(self) -> list[str] | None:
        """Options of ``ptcc certify GRAPH`` that prove the same again, with exit code 0; None where none do.

        Whether every agent is within :attr:`residual` at the deadline, or the norm of the input within its limit,
        cannot be asked there: both are proved all the same.
        """
        initial_set = self.asked.initial_set
        R = max(initial_set.radius, default=Fraction(0))
        about_zero = not any(initial_set.center) and R > 0 and min(initial_set.radius) == R
        if not (self.repeatable and about_zero and self.protocol is not None and self.certificate is not None):
            return None
        p = self.protocol
        options = {"T": p.T, "rho1": p.rho1, "rho2": p.rho2, "kappa": p.kappa, "initial-bound": R}
        if self.gain_cap is not None:
            options["gain-cap"] = self.gain_cap
        agents = fit_of(self.certificate, replace(self.asked, input_norm=None)).peak
        if agents is not None and agents <= self.asked.max_input:  # of the norm too, but for what is lost in the bounds
            options["max-input"] = self.asked.max_input
        return [text for name, value in options.items() for text in (f"--{name}", short_exact(value))]

    @property
    def lower_product(self) -> Fraction | None:
        """Below which ``U T`` is too small for all gains of the protocol, proved; None if nothing is known."""
        return None if self.shortest_possible is None else self.shortest_possible * self.asked.max_input

    @property
    def shortest_certified(self) -> Fraction | None:
        """The deadline from which on the gains found keep to ``max_input``; None if nothing is certified."""
        return None if self.product is None else self.product / self.asked.max_input

    @property
    def ratio(self) -> float | None:
        """Shortest certified deadline over the shortest possible one, rounded up; at least 1."""
        if not self.product or not self.lower_product:
            return None
        return float_up(self.product / self.lower_product)

    @cached_property
    def worst(self) -> WorstInitialState | None:
        """The initial state from which the input gets largest under these gains (numerical); None without gains."""
        if self.certificate is None:
            return None
        case = self.certificate.graph_proof.structure, self.certificate.protocol, self.asked.initial_set
        if self.gain_cap is None:
            return worst_initial_state(*case)
        # The gain is constant, and max |e_k| never grows.
        first = worst_initial_state(*case, samples=1)
        return replace(first, size=first.size * float(self.gain_cap / self.certificate.protocol.gain.first))

    def trade_off(self, deadlines: Iterable[float]) -> TradeOff:
        """Return the proved peak at other deadlines, ``phi/T``, and what no gains can undercut; NaN if unknown.

        Peaks are rounded up, what no gains can undercut is rounded down.

        The gains for a deadline ``T`` are those of ``protocol`` with ``rho1 T`` kept.

        Parameters
        ----------
        deadlines : iterable of float
            Positive, in units of time.

        Returns
        -------
        TradeOff

        Examples
        --------
        >>> pair = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -3)])
        >>> design(pair, max_input=10, initial_bound=1).trade_off([1, 2]).lower.round(6)
        array([1.5 , 0.75])
        """
        T = np.array([float(parameter("a deadline", t)) for t in deadlines])
        products = (self.product, math.inf), (self.lower_product, -math.inf)
        certified, lower = (
            np.full(T.shape, math.nan)
            if x is None
            else np.nextafter(np.nextafter(nearest_float(x), towards) / T, towards)
            for x, towards in products
        )
        return TradeOff(T, certified, lower)

    def deadlines(self, count: int = 61) -> np.ndarray:
        """Return deadlines about the one that was found or asked for, evenly spaced in their logarithms.

        Parameters
        ----------
        count : int
            How many.

        Returns
        -------
        (count,) array
            In units of time.
        """
        candidates = (self.deadline, self.shortest_certified, self.shortest_possible, Fraction(1))
        middle = nearest_float(next(T for T in candidates if T))
        return np.geomspace(middle / 5, middle * 5, count)

    @property
    def size(self) -> str:
        """The size of the input that is limited, in symbols."""
        return "||u||" if self.asked.input_norm == 2 else "|u_k|"

    @property
    def states_text(self) -> str:
        """The initial states."""
        initial_set = self.asked.initial_set
        R = max(initial_set.radius, default=Fraction(0))
        box = not any(initial_set.center) and R and min(initial_set.radius) == R
        return f"all |x_k(0)| <= {short_exact(R)}" if box else "the given initial states"

    @property
    def ends_text(self) -> str:
        """How near to their final states all agents are."""
        return f"every agent {f'within {up(self.residual)} of' if self.residual else 'at'} its final state"

    @property
    def bounds_text(self) -> str:
        """What is proved of input and deviation at the deadline, in one line; empty without gains."""
        text = super().bounds_text
        return f"{text} (deviation 0)" if text and self.asked.residual is not None and not self.residual else text

    @property
    def gains_text(self) -> str:
        """The gains, exact, in one line; empty where there are none."""
        text = super().gains_text
        return text + ("" if self.gain_cap is None else f", gain saturated at {short_exact(self.gain_cap)} from t = 0")

    @property
    def deadline_text(self) -> str:
        """What is proved of shorter deadlines, in one line; empty where nothing is."""
        least, most = self.shortest_possible, self.shortest_certified
        parts = [] if most is None else [f"{up(most, DIGITS)} is met" if most else "every one is met"]
        if most is not None and self.asked.deadline is not None and most < self.asked.deadline:
            parts = [f"every one from {up(most, DIGITS)} on is met (a search for the shortest may go lower)"]
        parts += [] if least is None else [f"no gains meet one below {down(least)}"]
        return "; ".join(parts)

    @property
    def ratio_text(self) -> str:
        """How far apart the two deadlines are, in one line; empty where that is not known."""
        return "" if self.ratio is None else f"ratio of the two at most {up(self.ratio, 3)}"

    def facts(self) -> Facts:
        """Return what is told of it, the largest input that was found last."""
        yield from super().facts()
        if self.worst is not None and self.protocol is not None:
            yield _seen(self.worst.size, self.size, f", at t = {self.worst.t:.4g}, of all initial states", self.peak)

    def to_dict(self) -> dict[str, Any]:
        """Return the design as JSON-ready data, exact numbers as texts, without the certificate."""
        own = {"input_norm": self.asked.input_norm, "ratio": self.ratio}
        return self._summary() | texts(self, "shortest_certified") | own

    def __repr__(self) -> str:
        if self.protocol is None or self.peak is None:
            return f"Design({self.verdict}: {self.binding})"
        p, cap = self.protocol, "" if self.gain_cap is None else f", gain_cap={short_exact(self.gain_cap)}"
        gains = f"T={short_exact(p.T)}, rho1={short_exact(p.rho1)}, rho2={short_exact(p.rho2)}{cap}"
        return f"Design({self.verdict}, {gains}, peak {up(self.peak)})"


def _seen(seen: float, name: str, where: str, peak: Fraction | None) -> Fact:
    """Tell the largest input that was seen, and how far the proved peak is above it."""
    times = f"; proved {float(peak) / seen:.2g} times that" if peak and seen else ""
    note, brief = (f"{name} up to {seen:.4g}{text} (numerical){times}" for text in (where, ""))
    return Fact(head="simulated", value=seen, standing="observed", note=note, brief=(brief,))


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

    residual_name: ClassVar = "positions within"
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
    def size(self) -> str:
        """The size of the input that is limited, in symbols."""
        return "||u_k||"

    @property
    def states_text(self) -> str:
        """The initial states."""
        return "the given initial state"

    @property
    def ends_text(self) -> str:
        """How near to their places all agents are."""
        return f"every position within {up(self.residual)} of its place" if self.residual else "every agent in place"

    @property
    def gains_text(self) -> str:
        """The parameters of the protocol, exact, and the input of the agents; empty where there are none."""
        if self.certificate is None or self.certificate.proof.agents is None:
            return ""
        return f"{super().gains_text}; u = {self.certificate.proof.agents.protocol.law()}"

    def facts(self) -> Facts:
        """Return what is told of it, the largest input of a run last."""
        yield from super().facts()
        part = None if self.certificate is None else self.certificate.proof.agents
        if part is not None and part.initial_state is not None and len(part.initial_state) <= TRACED_NODES:
            with suppress(SimulationError, ParameterError):
                size = float(np.nanmax(np.linalg.norm(part.simulate().input, axis=1)))
                yield _seen(size, self.size, "", self.peak)

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
