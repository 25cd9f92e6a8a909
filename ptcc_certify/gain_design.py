"""Gains, and the shortest deadline, for which an input is proved to stay within what the actuators give.

With ``k = rho2 kappa`` and ``a = rho1 T`` the gain is ``(a + k e^z)/T`` at ``z = ln(T/(T - t))``, and the stretched
clock ``s = a (1 - e^-z) + k z``, which knows no ``T``. So a bound of the input over a set of initial states is ``phi(a,
k)/T`` exactly: smallest peak and shortest deadline are one question, ``T = phi/U``. Of every agent ``|e_v|`` is at most
``m_v``, and ``B_vi e^(-rate_i s/2)`` for each proved Lyapunov function ``i``. The bounded input up to ``T`` needs
``rate_i k >= 2``; then the peak is the gain where both meet, at the clock ``sigma_vi = (2/rate_i) ln(B_vi/m_v)``:

    phi(a, k) = max_v m_v (a + k e^(z_v)),    a (1 - e^(-z_v)) + k z_v = min_i sigma_vi
    phi(a, k) = max_v B_v (a + k),               where B_v = B_vi < m_v, since then z_v = 0

Which function serves an agent best depends on ``k`` only, by ``rate_i k >= 2``.

* For a fixed ``k`` this is convex in ``a``: ``dz/da = -(1 - e^-z)/(a e^-z + k)``, hence
  ``d(a + k e^z)/da = 1 - k (e^z - 1)/(a e^-z + k)``, which grows with ``a`` since ``z`` falls and
  ``a e^-z + k`` grows; a maximum of convex functions is convex.
* For one agent the smallest admissible ``k = 2/rate_i`` is best: at a fixed ``z`` clock costs peak
  ``1/(1 - e^-z) = e^z/(e^z - 1)`` by ``a`` and ``e^z/z``, which is more, by ``k``. With several agents,
  whose ``z_v`` differ, that is not proved; each Lyapunov function's
  ``2/rate_i`` is tried, and nothing between.

Where a residual is allowed at the deadline, the gain may be constant instead: a cap ``g`` that always acts gives the
clock ``g T`` and a peak of at most ``g max m``, so ``phi = s max m`` with the least clock ``s`` that proves the
residual, ``sqrt(c_v) start_i e^(-rate_i s/2) <= r``.

Two bounds hold for all gains of the protocol, whatever the certificate:

* without a residual the input must stay bounded, hence ``k >= 1/min Re lambda >= 2/limit``, and
  ``u(0) = (a + k)/T e(0)``: ``U T > (2/limit) sup |e_v(0)|``. This needs a set of initial states with inner points.
* an agent moves at most ``U T``: ``U T >= sup |x_v(0) - (Q X(0))_v| - r``.

The search is in floating point; what is answered is then proved: a
:class:`~ptcc_certify.certificate.certificate.Certificate` with the gains found, whose
bound of the input is compared with ``U`` exactly.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from lmi.exact.decimal_rounding import down, float_up, up
from lmi.exact.elementary_enclosures import rounded, sqrt
from ptcc_certify.bounds.input.initial_set import initial_set_within, ways
from ptcc_certify.bounds.input.tightest_bound import decaying, log, usable_functions
from ptcc_certify.bounds.input.worst_initial_state import WorstInitialState, worst_initial_state
from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.certificate.procedure import certify
from ptcc_certify.certificate.request import Expectations
from ptcc_certify.checker import INPUT_NODES
from ptcc_certify.checker.input_formulas import BITS, InitialSet, InputBounds, Limits, Linear
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.display_hook import Shown
from ptcc_certify.graphs.rationals import format_exact, nearest_float, short_exact, shorten
from ptcc_certify.graphs.structure import Structure, analyse
from ptcc_certify.protocols import NominalProtocol, Protocol
from ptcc_certify.protocols.gain_limits import GainLimits
from ptcc_certify.protocols.parameters import parameter
from ptcc_certify.theorems.lemmas import laplacian_spectrum

if TYPE_CHECKING:
    from ptcc_certify.graphs.digraph import Exact

MET, INFEASIBLE, UNPROVED = "met", "infeasible", "not with this certificate"
#: Significant decimal digits of the gains and deadlines that are found.
DIGITS = 10
#: ``rho1 T / k`` is sought between these.
_LEAST, _MOST = 1e-3, 1e6
#: The exact bound is not below what the search finds by such a factor.
_HOPELESS = Fraction(1001, 1000)
#: How often a deadline is lengthened by a little until the exact bound agrees.
_NUDGES = 20
#: How often gains are sought with the functions that certify finds for those before, until it proves its own.
_ROUNDS = 4
#: Gains that certify proves again are answered where their deadline is no longer than the shortest by such a factor.
_LONGER = Fraction(101, 100)
_PRODUCT_BITS = 40


class TradeOff(NamedTuple):
    """Deadlines (M,), the peak input certified at each, and below which none of all gains can stay."""

    deadlines: np.ndarray
    certified: np.ndarray
    lower: np.ndarray


@dataclass(frozen=True)
class DesignRequest:
    """What is asked of an input.

    Attributes
    ----------
    max_input : Fraction
        ``U``, of ``max_k |u_k|``, or of ``||u||_2``; in units of the input.
    input_norm : {2, None}
        None: of every agent's input.
    initial_set : InitialSet
        For all of which it is to hold.
    deadline, residual : Fraction or None
        In units of time and of the states; None where nothing is asked.
    """

    max_input: Fraction
    input_norm: int | None
    initial_set: InitialSet
    deadline: Fraction | None
    residual: Fraction | None

    def met_by(self, fit: Fit) -> bool:
        """Tell whether what is proved of some gains suffices."""
        if fit.peak is None or fit.residual is None:
            return False
        return fit.peak <= self.max_input and fit.residual <= (self.residual or 0)


@dataclass(frozen=True, repr=False)
class Design(Shown):
    """What was asked of an input, and the gains that are proved to meet it; made by :func:`design`.

    Attributes
    ----------
    verdict : {"met", "infeasible", "not with this certificate"}
        ``infeasible``: no gains of the nominal protocol can, proved. The third says that the bounds of this
        certificate do not suffice, and nothing about other gains.
    binding : str
        The limit that binds, and how far off it is.
    asked : DesignRequest
        The limit, the initial states, deadline and residual.
    deadline : Fraction or None
        ``T``, in units of time; None if none was asked for and none is certified.
    certificate : Certificate or None
        What proves it; None unless the verdict is ``met``.
    peak : Fraction or None
        The certified peak of the input at ``deadline``, also if it is too large.
    residual : Fraction or None
        How far from its final state an agent is at the deadline, at most; 0 without a cap.
    product : Fraction or None
        ``phi``, peak times deadline: what the gains found certify at any deadline.
    lower_product : Fraction or None
        Below which ``U T`` is too small for all gains of the protocol, proved.
    lower_by : str
        Why.
    repeatable : bool
        Whether :func:`ptcc_certify.certify` proves the same of these gains by the functions that it finds itself.

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

    verdict: str
    binding: str
    asked: DesignRequest
    deadline: Fraction | None = None
    certificate: Certificate | None = None
    peak: Fraction | None = None
    residual: Fraction | None = None
    product: Fraction | None = None
    lower_product: Fraction | None = None
    lower_by: str = ""
    repeatable: bool = False

    @property
    def protocol(self) -> Protocol | None:
        """The gains; None unless the verdict is ``met``."""
        return None if self.certificate is None else self.certificate.protocol

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
        agents = _fit_of(self.certificate, replace(self.asked, input_norm=None)).peak
        if agents is not None and agents <= self.asked.max_input:  # of the norm too, but for what is lost in the bounds
            options["max-input"] = self.asked.max_input
        return [text for name, value in options.items() for text in (f"--{name}", short_exact(value))]

    @property
    def shortest_possible(self) -> Fraction | None:
        """No gains of the protocol meet a shorter deadline within ``max_input``; None if nothing is known."""
        return None if self.lower_product is None else self.lower_product / self.asked.max_input

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
        case = self.certificate.structure, self.certificate.protocol, self.asked.initial_set
        if self.gain_cap is None:
            return worst_initial_state(*case)
        # The gain is constant, and max |e_k| never grows.
        first = worst_initial_state(*case, samples=1)
        return replace(first, size=first.size * float(self.gain_cap / self.certificate.protocol.gain.first))

    def trade_off(self, deadlines: Iterable[float]) -> TradeOff:
        """Return the certified peak at other deadlines, ``phi/T``, and what no gains can undercut; NaN if unknown.

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
    def request_text(self) -> str:
        """What was asked, in one line."""
        initial_set, deadline, residual = self.asked.initial_set, self.asked.deadline, self.asked.residual
        R = max(initial_set.radius, default=Fraction(0))
        box = not any(initial_set.center) and R and min(initial_set.radius) == R
        states = f"all |x_k(0)| <= {short_exact(R)}" if box else "the given initial states"
        size = f"{'||u||' if self.asked.input_norm == 2 else '|u_k|'} <= {short_exact(self.asked.max_input)}"
        text = f"{size} from {states}, "
        text += "shortest deadline" if deadline is None else f"deadline {short_exact(deadline)}"
        return text + ("" if residual is None else f", deviation {short_exact(residual)}")

    @property
    def bounds_text(self) -> str:
        """What is proved of input and deviation at the deadline, in one line; empty without gains."""
        if self.peak is None or self.residual is None:
            return ""
        size = f"{'||u||' if self.asked.input_norm == 2 else '|u_k|'} <= {up(self.peak)}"
        ends = f"within {up(self.residual)} of" if self.residual else "at"
        exact = " (deviation 0)" * (self.asked.residual is not None and not self.residual)
        return f"{size}, every agent {ends} its final state at T{exact}"

    @property
    def gains_text(self) -> str:
        """The gains, exact, in one line; empty where there are none."""
        if self.protocol is None:
            return ""
        text = ", ".join(f"{name}={short_exact(value)}" for name, value in self.protocol.parameters.items())
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

    def lines(self) -> list[str]:
        """Return everything as text: request, verdict, what binds, gains, bounds, deadlines, the largest input."""
        rows = [("asked", self.request_text), ("verdict", self.verdict), ("", self.binding)]
        rows += [("gains", self.gains_text), ("proved", self.bounds_text), ("deadline", self.deadline_text)]
        if self.ratio is not None:
            rows.append(("", f"ratio of the two at most {up(self.ratio, 3)}"))
        if self.worst is not None and self.protocol is not None:
            rows.append(("numerical", f"the largest input found is {self.worst.size:.4g}, at t = {self.worst.t:.4g}"))
        return [f"{name:<10} {text}" for name, text in rows if text]

    def to_dict(self) -> dict[str, Any]:
        """Return the design as JSON-ready data, exact numbers as texts, without the certificate."""

        def texts(source: Any, *names: str) -> dict[str, str | None]:
            values = ((name, getattr(source, name)) for name in names)
            return {name: None if x is None else format_exact(x) for name, x in values}

        return {
            "verdict": self.verdict,
            "binding": self.binding,
            **texts(self.asked, "max_input"),
            "input_norm": self.asked.input_norm,
            "asked": texts(self.asked, "deadline", "residual"),
            "protocol": None if self.protocol is None else self.protocol.to_dict(),
            **texts(self, "gain_cap", "deadline", "peak", "residual", "shortest_certified", "shortest_possible"),
            "ratio": self.ratio,
        }

    def __repr__(self) -> str:
        if self.protocol is None or self.peak is None:
            return f"Design({self.verdict}: {self.binding})"
        p, cap = self.protocol, "" if self.gain_cap is None else f", gain_cap={short_exact(self.gain_cap)}"
        gains = f"T={short_exact(p.T)}, rho1={short_exact(p.rho1)}, rho2={short_exact(p.rho2)}{cap}"
        return f"Design({self.verdict}, {gains}, peak {up(self.peak)})"


class Option(NamedTuple):
    """Gains in units of a deadline: ``rho1 T``, ``k``, the clock of a capped gain or None, and about what ``phi``."""

    a: Fraction
    k: Fraction
    clock: Fraction | None
    product: Fraction


class Fit(NamedTuple):
    """Gains at a deadline, and what is proved of them; None where nothing is."""

    deadline: Fraction
    certificate: Certificate
    peak: Fraction | None
    residual: Fraction | None


def design(
    graph: Any,
    *,
    max_input: Exact,
    initial_bound: Exact | InitialSet,
    deadline: Exact | None = None,
    residual: Exact | None = None,
    input_norm: int | None = None,
    orientation: str | None = None,
) -> Design:
    """Find gains of the nominal protocol whose input is proved to stay within a limit, and the shortest deadline.

    Parameters
    ----------
    graph : graph-like
        Up to 400 agents, in whatever form :func:`ptcc_certify.as_graph` takes.
    max_input : int, float, str or Fraction
        Positive: bound of ``|u_k|`` for all agents, at all times, from all initial states.
    initial_bound : int, float, str, Fraction or InitialSet
        All initial states with ``||X(0)||_inf`` up to this; or another set.
    deadline : int, float, str or Fraction, optional
        ``T``, in units of time: the gains with the smallest peak are sought. Without it the shortest one is.
    residual : int, float, str or Fraction, optional
        Positive: how far every agent may be from its final state at the deadline. Then the gain may be capped.
    input_norm : {2}, optional
        ``max_input`` bounds ``||u||_2`` instead.
    orientation : {"information", "listens"}, optional
        See :func:`ptcc_certify.as_graph`.

    Returns
    -------
    Design
        With ``kappa = 1``.

    Raises
    ------
    ParameterError
        A number that is not positive, another norm, or initial states of the wrong length.

    References
    ----------
    The protocol (4) of [Zhu]_. With ``rho1 T`` and ``rho2 kappa`` fixed, gain and input scale as ``1/T``.

    Examples
    --------
    >>> trio = SignedDigraph.from_edges([(1, 2, 3), (2, 3, -1), (3, 1, 1)])
    >>> design(trio, max_input=20, initial_bound=3, deadline=1)
    Design(infeasible: the input of agent 2 at t = 0: no gains meet a deadline below 1.18857, 1.18857 times the \
one asked for)
    >>> answer = design(trio, max_input=20, initial_bound=3, deadline="2.5")
    >>> answer.verdict, bool(answer.peak <= 20), answer.certificate.verdict
    ('met', True, 'certified')
    >>> pair = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])
    >>> answer = design(pair, max_input=20, initial_bound=3, residual="2.9")  # 2 * 3 * gain_cap = 20
    >>> answer.verdict, float(answer.limits.gain_cap)
    ('met', 3.333333333)
    """
    U = parameter("max_input", max_input)
    T = None if deadline is None else parameter("deadline", deadline)
    r = None if residual is None else parameter("residual", residual)
    if input_norm not in (None, 2):
        raise ParameterError(f"input_norm = {input_norm!r} is unknown; leave it out for max |u_k|, or give 2")
    structure = analyse(graph, orientation)
    graph = structure.graph
    initial_set = (
        initial_bound if isinstance(initial_bound, InitialSet) else initial_set_within(structure, initial_bound)
    )
    request = DesignRequest(U, input_norm, initial_set, T, r)
    begin: dict[str, Any] = {"x0": initial_set.center} if initial_set.point else {"initial_set": initial_set}
    base = certify(graph, _first_protocol(structure), **begin, simulation=False)
    lower, why = _lower_product(base, request)
    blank = Design(UNPROVED, "", request, T, lower_product=lower, lower_by=why)
    first: list[Fit] = []
    candidate = None
    for _ in range(_ROUNDS):
        if (reason := _unusable(base)) is not None:
            break
        fits = _search(base, request)
        first = first or fits
        if not fits or not request.met_by(fits[-1]):
            break
        candidate = candidate or fits[-1]
        own = fits[-1].certificate
        base = certify(graph, own.protocol, **begin, limits=own.limits, simulation=False)
        again = _fit_of(base, request)
        if request.met_by(again) and base.verdict == "certified":
            if again.deadline > candidate.deadline * _LONGER and _accepted(candidate):
                break  # a deadline that is shorter is worth more than a command that proves it again
            return _answer_with_gains(replace(blank, verdict=MET, repeatable=True), again)
    if candidate is not None:
        report = candidate.certificate.checked
        if report is None or not report.accepted:
            why = "" if report is None else f" {report.rejected}: {report.reason}"
            return replace(blank, binding=f"the independent check does not accept{why}")
        return _answer_with_gains(replace(blank, verdict=MET), candidate)
    if reason is None and first and (peak := first[0].peak) is not None:
        return _answer_without_gains(replace(blank, peak=peak, product=peak * first[0].deadline))
    return _answer_without_gains(replace(blank, binding=reason or "this certificate bounds no input"))


def _accepted(fit: Fit) -> bool:
    """Tell whether the independent check accepts what proves these gains."""
    report = fit.certificate.checked
    return report is not None and report.accepted


def _search(base: Certificate, request: DesignRequest) -> list[Fit]:
    """Return gains until the first of which the functions of ``base`` prove what is asked."""
    fits = []
    for option in _options(base, request):
        fits.append(_fit(base, option, request))
        hopeless = request.deadline and option.product > request.max_input * request.deadline * _HOPELESS
        if request.met_by(fits[-1]) or hopeless:
            break
    return fits


# ---------------------------------------------------------------------- what is known


def _first_protocol(structure: Structure) -> NominalProtocol:
    """Return gains on the scale of the graph, for whose clock the Lyapunov functions are chosen."""
    k = 0.0
    if structure.graph.n_edges:
        try:
            k = 2 / (laplacian_spectrum(structure).spectral_rate or 0.0)
        except (np.linalg.LinAlgError, ZeroDivisionError):
            k = 1 / float(np.mean(structure.graph.in_weight()))
    if not 1e-250 < k < 1e250:
        k = 1.0
    return NominalProtocol(1, 2 * k, k, 1)


def _unusable(base: Certificate) -> str | None:
    """Tell why the certificate bounds no input; None if it does."""
    n = base.graph.n_nodes
    if base.constant:
        return None
    if n > INPUT_NODES:
        return f"the input is bounded up to {INPUT_NODES} agents; the graph has {n}"
    if base.effort is None:
        return base.notes[0] if base.notes else "no decay was proved"
    return None


def _bounds(base: Certificate, initial_set: InitialSet) -> InputBounds:
    """Return what bounds the input."""
    constants = base.effort.constants if base.effort is not None else ()
    rows = base.graph.exact_rows(range(base.graph.n_nodes))
    return InputBounds(rows, base.protocol.gain.exact, base.forms, constants, initial_set)


def _lower_product(base: Certificate, request: DesignRequest) -> tuple[Fraction | None, str]:
    """Return what ``U T`` is at least, whatever the gains, and why; None if nothing is known."""
    candidates, initial_set, graph = [(Fraction(0), "")], request.initial_set, base.graph
    agents = [shorten(label) for label in graph.labels]
    if base.influence.exact and graph.n_nodes <= INPUT_NODES:
        for agent, row in zip(agents, ways(base.influence), strict=True):
            way = _largest_below(initial_set, row) - (request.residual or 0)
            candidates.append((way, f"the way of agent {agent} to its final state"))
    limit = base.upper_bound
    if request.residual is None and limit and _has_inner_points(initial_set):
        for agent, weights in zip(agents, graph.exact_rows(range(graph.n_nodes)), strict=True):
            candidates.append(
                (2 / limit * _largest_below(initial_set, weights), f"the input of agent {agent} at t = 0")
            )
    best, why = max(candidates, key=lambda entry: entry[0])
    return (rounded(best, _PRODUCT_BITS) if best > 0 else None), why


def _largest_below(initial_set: InitialSet, row: Linear) -> Fraction:
    """Bound the largest size of a linear function over the set from below; exact but for an ellipsoid's root."""
    if not initial_set.axes:
        return initial_set.largest(row)
    size = abs(sum((x * initial_set.center[j] for j, x in row.items()), Fraction(0)))
    shares = [sum((x * axis[j] for j, x in row.items()), Fraction(0)) for axis in initial_set.axes]
    return size + sqrt(rounded(sum((x * x for x in shares), Fraction(0)), BITS), BITS)[0]


def _has_inner_points(initial_set: InitialSet) -> bool:
    """Tell whether the set spans all directions, so that an input bounded on it is bounded for every initial state."""
    if not initial_set.axes:
        return bool(initial_set.radius) and min(initial_set.radius) > 0
    import flint

    rows = [[flint.fmpq(x.numerator, x.denominator) for x in axis] for axis in initial_set.axes]
    return flint.fmpq_mat(rows).rank() == len(initial_set.center)


# ---------------------------------------------------------------------- search


def _options(base: Certificate, request: DesignRequest) -> list[Option]:
    """Return gains by increasing ``phi``: the best without a cap, and a cap for each function if a residual is allowed.

    In units of ``k`` and the largest ``m_v`` everything is free of dimensions.
    """
    bounds, residual = _bounds(base, request.initial_set), request.residual
    functions = usable_functions(bounds)
    agents: list[int | None] = [None] if request.input_norm == 2 else [*range(len(bounds.rows))]
    largest = [bounds.error_norm if v is None else bounds.error_bounds[v] for v in agents]
    top = max(largest)
    if base.constant or top == 0 or not functions:
        return [Option(Fraction(1), Fraction(1), None, Fraction(0))] if base.constant or top == 0 else []
    rates = {i: bounds.form(i).rate for i in functions}
    decay = {i: [decaying(bounds, i, v) for v in agents] for i in functions}
    moving = [j for j, h in enumerate(largest) if h and all(decay[i][j] for i in functions)]
    size = np.array([nearest_float(largest[j] / top) for j in moving])
    over = {i: np.array([log(decay[i][j] / largest[j]) for j in moving]) for i in functions}
    least = 2 / max(rates.values())
    best = (math.inf, 1.0, least)
    for i in functions:
        k = _decimal(2 / rates[i], up=True)
        may = [j for j in functions if rates[j] * k >= 2]
        # The clock of the crossing, over k.
        clocks = np.array([over[j] * nearest_float(2 / (rates[j] * k)) for j in may])
        which, every = clocks.argmin(axis=0), np.arange(len(moving))
        crossing = clocks[which, every]
        share = size * np.exp(np.minimum(np.array([over[j] for j in may])[which, every], 0))
        a, peak = least_peak(np.maximum(crossing, 0), share)
        if peak * nearest_float(k / least) < best[0] * (1 - 1e-9):
            best = (peak * nearest_float(k / least), a, k)
    product, a, k = best
    options = []
    if math.isfinite(product):
        options.append(Option(_decimal(Fraction(a) * k), k, None, Fraction(product) * least * top))
    if residual is not None:
        for i in functions:
            bound = base.functions[i].deviation
            if bound is None:
                continue
            excess = max(map(log, bound.agents)) / 2 + log(bounds.initial_root(i)) - log(residual)
            clock = _decimal(Fraction(max(excess, 1e-6) * (1 + 1e-12)) * 2 / rates[i], up=True)
            options.append(Option(clock, k, clock, clock * top))
    return sorted(options, key=lambda option: option.product)


def least_peak(clocks: np.ndarray, sizes: np.ndarray) -> tuple[float, float]:
    """Return the ``a`` that makes ``max_v sizes_v (a + e^(z_v))`` least, ``a (1 - e^(-z_v)) + z_v = clocks_v``, and it.

    Examples
    --------
    >>> a, peak = least_peak(np.array([1.0]), np.array([1.0]))  # with a = 0 it is e
    >>> round(a, 3), round(peak, 3)
    (0.403, 2.588)
    """
    from scipy.optimize import minimize_scalar

    grid = np.geomspace(_LEAST, _MOST, 28)
    values = [peak_factor(a, clocks, sizes) for a in grid]
    i = int(np.argmin(values))
    ends = (grid[max(i - 1, 0)], grid[min(i + 1, len(grid) - 1)])
    near = minimize_scalar(
        lambda a: peak_factor(a, clocks, sizes), bounds=ends, method="bounded", options={"xatol": 1e-9 * ends[1]}
    )
    return min([(float(near.x), float(near.fun)), (float(grid[i]), float(values[i]))], key=lambda pair: pair[1])


def peak_factor(a: float, clocks: np.ndarray, sizes: np.ndarray) -> float:
    """Return ``max_v sizes_v (a + e^(z_v))``, ``a (1 - e^(-z_v)) + z_v = clocks_v``, for ``k = 1``.

    The clock is concave in ``z``, so that Newton's method from below grows to the root.

    Examples
    --------
    >>> round(peak_factor(0.0, np.array([1.0]), np.array([1.0])), 6)
    2.718282
    """
    z = np.maximum(clocks / (1 + a), clocks - a)
    for _ in range(40):
        step = (clocks + a * np.expm1(-z) - z) / (a * np.exp(-z) + 1)
        z = z + step
        if np.abs(step).max(initial=0) <= 1e-13 * (1 + z.max(initial=0)):
            break
    with np.errstate(over="ignore"):
        return float((sizes * (a + np.exp(z))).max(initial=0.0))


# ---------------------------------------------------------------------- proof


def _fit(base: Certificate, option: Option, request: DesignRequest) -> Fit:
    """Return the gains at a deadline, or at the shortest one that is proved, and what is proved of them."""
    U, deadline = request.max_input, request.deadline
    T = deadline if deadline is not None else _decimal(option.product / U, up=True) or Fraction(1)
    for nudge in range(_NUDGES + 1):
        fit = _at(base, option, T, request)
        if deadline is not None or fit.peak is None or fit.peak <= U:
            break
        T = _decimal(T * fit.peak / U * (1 + nudge * Fraction(1, 10**9)), up=True)
    return fit


def _at(base: Certificate, option: Option, T: Fraction, request: DesignRequest) -> Fit:
    rho1 = _decimal(option.a / T) if option.clock is None else _decimal(option.clock / T, up=True)
    limits = () if option.clock is None else (GainLimits(gain_cap=rho1),)
    return _fit_of(base.changed(protocol=NominalProtocol(T, rho1, option.k, 1), limits=limits), request)


def _fit_of(cert: Certificate, request: DesignRequest) -> Fit:
    """Return what a certificate proves of its gains: the peak of the input, and what is left at the deadline."""
    T, effort, by_norm = cert.protocol.T, cert.effort, request.input_norm == 2
    if not cert.limits:
        if effort is None or effort.peak is None:
            return Fit(
                T, cert, Fraction(0) if not any(_bounds(cert, request.initial_set).error_bounds) else None, Fraction(0)
            )
        return Fit(T, cert, effort.peak.norm if by_norm else effort.peak.largest, Fraction(0))
    cap = cert.limits[0].gain_cap
    entries = effort.residual if effort is not None else ()
    if cap is None or not entries or entries[0].agents is None:
        return Fit(T, cert, None, None)
    peak = cap * _bounds(cert, request.initial_set).error_norm if by_norm else entries[0].largest
    return Fit(T, cert, peak, max(entries[0].agents))


def _answer_with_gains(blank: Design, fit: Fit) -> Design:
    """Return the answer with gains."""
    assert fit.peak is not None
    cert, effort, limit = fit.certificate, fit.certificate.effort, blank.asked.max_input
    if not fit.peak:
        binding = "nothing binds: no agent moves, whatever the gains"
    elif cert.limits:
        binding = f"the capped gain times the largest error at t = 0, {_percent(fit.peak, limit)}"
    else:
        assert effort is not None and effort.peak is not None
        agents, by_norm = effort.peak.agents, blank.asked.input_norm == 2
        v = max(range(len(agents)), key=agents.__getitem__)
        how = effort.peak.norm_how if by_norm else effort.peak.how[v]
        whose = "||u||" if by_norm else f"the input of agent {shorten(cert.graph.labels[v])}"
        when = f"{nearest_float(fit.deadline) * -math.expm1(-nearest_float(how.z)):.4g}"
        binding = f"{whose}, largest about t = {when}, {_percent(fit.peak, limit)}"
    if blank.asked.input_norm is None:  # an expectation is one of every |u_k|
        cert = cert.changed(expectations=Expectations(max_input=limit))
    product = fit.peak * fit.deadline
    return replace(blank, binding=binding, product=product, **fit._replace(certificate=cert)._asdict())


def _answer_without_gains(answer: Design) -> Design:
    """Return the answer without gains; ``binding`` tells why if nothing is certified."""
    U, T, shortest = answer.asked.max_input, answer.asked.deadline, answer.shortest_possible
    if T is not None and shortest is not None and shortest > T:
        least, times = map(down, (shortest, shortest / T))
        text = f"no gains meet a deadline below {least}, {times} times the one asked for"
        return replace(answer, verdict=INFEASIBLE, binding=f"{answer.lower_by}: {text}")
    if answer.peak is None or answer.product is None:
        return answer
    if answer.peak <= U:
        return replace(answer, binding="the residual is not proved")
    over = f"the certified peak is {up(answer.peak)}, {up(answer.peak / U)} times the limit"
    return replace(answer, binding=f"{over}; from T = {up(answer.product / U)} on it is met")


# ---------------------------------------------------------------------- numbers


def _decimal(x: Fraction, up: bool = False) -> Fraction:
    """Round a nonnegative rational to a few decimal digits, to nearest or upwards.

    Examples
    --------
    >>> float(_decimal(Fraction(2, 3))), float(_decimal(Fraction(1, 3), up=True)), float(_decimal(Fraction(0)))
    (0.6666666667, 0.3333333334, 0.0)
    """
    if not x:
        return x
    shift = DIGITS - 1 - math.floor(log(x) / math.log(10))
    unit = Fraction(10) ** shift
    scaled = x * unit
    return Fraction(math.ceil(scaled) if up else round(scaled)) / unit


def _percent(part: Fraction, whole: Fraction) -> str:
    return f"{up(100 * part / whole, 4)} % of the limit"
