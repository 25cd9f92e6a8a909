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
from dataclasses import replace
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np

from lmi.exact.decimal_rounding import up
from lmi.exact.elementary_enclosures import rounded, sqrt
from ptcc_certify.bounds.input.initial_sets import initial_set_within, ways
from ptcc_certify.bounds.input.tightest_bound import decaying, log, usable_functions
from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.certificate.certification import certify
from ptcc_certify.checker import INPUT_NODES
from ptcc_certify.checker.input_formulas import BITS, InitialSet, Linear
from ptcc_certify.errors import ParameterError
from ptcc_certify.gain_design.answer import DIGITS, INFEASIBLE, MET, UNPROVED, Design, refusal
from ptcc_certify.gain_design.request import DesignRequest, Fit, fit_of, input_bounds
from ptcc_certify.graphs.digraph import Exact
from ptcc_certify.graphs.rationals import nearest_float, shorten
from ptcc_certify.graphs.structure import Structure, analyse
from ptcc_certify.model import NominalProtocol
from ptcc_certify.model.asks import Asks, Expectations, GainLimits
from ptcc_certify.model.parameters import parameter
from ptcc_certify.theorems.lemmas import laplacian_spectrum

#: ``rho1 T / k`` is sought between these.
_LEAST, _MOST = 1e-3, 1e6


class Option(NamedTuple):
    """Gains in units of a deadline: ``rho1 T``, ``k``, the clock of a capped gain or None, and about what ``phi``."""

    a: Fraction
    k: Fraction
    clock: Fraction | None
    product: Fraction


def options(base: Certificate, request: DesignRequest) -> list[Option]:
    """Return gains by increasing ``phi``: the best without a cap, and a cap for each function if a residual is allowed.

    In units of ``k`` and the largest ``m_v`` everything is free of dimensions.
    """
    bounds, residual = input_bounds(base, request.initial_set), request.residual
    functions = usable_functions(bounds)
    agents: list[int | None] = [None] if request.input_norm == 2 else [*range(len(bounds.rows))]
    largest = [bounds.error_norm if v is None else bounds.error_bounds[v] for v in agents]
    top = max(largest)
    if base.proof.constant or top == 0 or not functions:
        return [Option(Fraction(1), Fraction(1), None, Fraction(0))] if base.proof.constant or top == 0 else []
    rates = {i: bounds.form(i).rate for i in functions}
    decay = {i: [decaying(bounds, i, v) for v in agents] for i in functions}
    moving = [j for j, h in enumerate(largest) if h and all(decay[i][j] for i in functions)]
    size = np.array([nearest_float(largest[j] / top) for j in moving])
    over = {i: np.array([log(decay[i][j] / largest[j]) for j in moving]) for i in functions}
    least = 2 / max(rates.values())
    best = (math.inf, 1.0, least)
    for i in functions:
        k = decimal(2 / rates[i], up=True)
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
        options.append(Option(decimal(Fraction(a) * k), k, None, Fraction(product) * least * top))
    if residual is not None:
        for i in functions:
            bound = base.graph_proof.functions[i].deviation
            if bound is None:
                continue
            excess = max(map(log, bound.agents)) / 2 + log(bounds.initial_root(i)) - log(residual)
            clock = decimal(Fraction(max(excess, 1e-6) * (1 + 1e-12)) * 2 / rates[i], up=True)
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


def decimal(x: Fraction, up: bool = False) -> Fraction:
    """Round a nonnegative rational to a few decimal digits, to nearest or upwards.

    Examples
    --------
    >>> float(decimal(Fraction(2, 3))), float(decimal(Fraction(1, 3), up=True)), float(decimal(Fraction(0)))
    (0.6666666667, 0.3333333334, 0.0)
    """
    if not x:
        return x
    shift = DIGITS - 1 - math.floor(log(x) / math.log(10))
    unit = Fraction(10) ** shift
    scaled = x * unit
    return Fraction(math.ceil(scaled) if up else round(scaled)) / unit


_PRODUCT_BITS = 40


def lower_product(base: Certificate, request: DesignRequest) -> tuple[Fraction | None, str]:
    """Return what ``U T`` is at least, whatever the gains, and why; None if nothing is known."""
    proof = base.graph_proof
    candidates = [(Fraction(0), "")]
    initial_set, graph = request.initial_set, proof.graph
    agents = [shorten(label) for label in graph.labels]
    if proof.influence.exact and graph.n_nodes <= INPUT_NODES:
        for agent, row in zip(agents, ways(proof.influence), strict=True):
            way = _largest_below(initial_set, row) - (request.residual or 0)
            candidates.append((way, f"the way of agent {agent} to its final state"))
    limit = proof.upper_bound
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


#: The exact bound is not below what the search finds by such a factor.
_HOPELESS = Fraction(1001, 1000)
#: How often a deadline is lengthened by a little until the exact bound agrees.
_NUDGES = 20
#: How often gains are sought with the functions that certify finds for those before, until it proves its own.
_ROUNDS = 4
#: Gains that certify proves again are answered where their deadline is no longer than the shortest by such a factor.
_LONGER = Fraction(101, 100)


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
        raise ParameterError("input_norm", f"= {input_norm!r} is unknown; leave it out for max |u_k|, or give 2")
    structure = analyse(graph, orientation)
    graph = structure.graph
    initial_set = (
        initial_bound if isinstance(initial_bound, InitialSet) else initial_set_within(structure, initial_bound)
    )
    request = DesignRequest(max_input=U, deadline=T, residual=r, input_norm=input_norm, initial_set=initial_set)
    x0, region = (initial_set.center, None) if initial_set.point else (None, initial_set)
    asks = Asks(initial_set=region, simulation=False)
    base = certify(graph, _first_protocol(structure), x0, asks=asks)
    lower, why = lower_product(base, request)
    blank = Design(UNPROVED, "", request, T, shortest_possible=None if lower is None else lower / U, lower_by=why)
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
        base = certify(graph, own.protocol, x0, limits=own.limits, asks=asks)
        again = fit_of(base, request)
        if request.met_by(again) and base.verdict == "certified":
            if again.deadline > candidate.deadline * _LONGER and not refusal(candidate.certificate):
                break  # a deadline that is shorter is worth more than a command that proves it again
            return _answer_with_gains(replace(blank, verdict=MET, repeatable=True), again)
    if candidate is not None:
        if refused := refusal(candidate.certificate):
            return replace(blank, binding=refused)
        return _answer_with_gains(replace(blank, verdict=MET), candidate)
    if reason is None and first and (peak := first[0].peak) is not None:
        return _answer_without_gains(replace(blank, peak=peak, product=peak * first[0].deadline))
    return _answer_without_gains(replace(blank, binding=reason or "this certificate bounds no input"))


def _search(base: Certificate, request: DesignRequest) -> list[Fit]:
    """Return gains until the first of which the functions of ``base`` prove what is asked."""
    fits = []
    for option in options(base, request):
        fits.append(_fit(base, option, request))
        hopeless = request.deadline and option.product > request.max_input * request.deadline * _HOPELESS
        if request.met_by(fits[-1]) or hopeless:
            break
    return fits


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
    n = base.graph_proof.graph.n_nodes
    if base.proof.constant:
        return None
    if n > INPUT_NODES:
        return f"the input is bounded up to {INPUT_NODES} agents; the graph has {n}"
    if base.graph_proof.effort is None:
        return base.observed.notes[0] if base.observed.notes else "no decay was proved"
    return None


def _fit(base: Certificate, option: Option, request: DesignRequest) -> Fit:
    """Return the gains at a deadline, or at the shortest one that is proved, and what is proved of them."""
    U, deadline = request.max_input, request.deadline
    T = deadline if deadline is not None else decimal(option.product / U, up=True) or Fraction(1)
    for nudge in range(_NUDGES + 1):
        fit = _at(base, option, T, request)
        if deadline is not None or fit.peak is None or fit.peak <= U:
            break
        T = decimal(T * fit.peak / U * (1 + nudge * Fraction(1, 10**9)), up=True)
    return fit


def _at(base: Certificate, option: Option, T: Fraction, request: DesignRequest) -> Fit:
    rho1 = decimal(option.a / T) if option.clock is None else decimal(option.clock / T, up=True)
    limits = () if option.clock is None else (GainLimits(gain_cap=rho1),)
    return fit_of(base.changed(protocol=NominalProtocol(T, rho1, option.k, 1), limits=limits), request)


def _answer_with_gains(blank: Design, fit: Fit) -> Design:
    """Return the answer with gains."""
    assert fit.peak is not None
    cert, effort, limit = fit.certificate, fit.certificate.graph_proof.effort, blank.asked.max_input
    if not fit.peak:
        binding = "nothing binds: no agent moves, whatever the gains"
    elif cert.limits:
        binding = f"the capped gain times the largest error at t = 0, {_percent(fit.peak, limit)}"
    else:
        assert effort is not None and effort.peak is not None
        agents, by_norm = effort.peak.agents, blank.asked.input_norm == 2
        v = max(range(len(agents)), key=agents.__getitem__)
        how = effort.peak.norm_how if by_norm else effort.peak.how[v]
        whose = "||u||" if by_norm else f"the input of agent {shorten(cert.graph_proof.graph.labels[v])}"
        when = f"{nearest_float(fit.deadline) * -math.expm1(-nearest_float(how.z)):.4g}"
        binding = f"the bound of {whose}, largest about t = {when}, {_percent(fit.peak, limit)}"
    if blank.asked.input_norm is None:  # an expectation is one of every |u_k|
        cert = cert.changed(expectations=Expectations(max_input=limit))
    product = fit.peak * fit.deadline
    return replace(blank, binding=binding, product=product, **fit._replace(certificate=cert)._asdict())


def _answer_without_gains(answer: Design) -> Design:
    """Return the answer without gains; ``binding`` tells why if nothing is certified."""
    U = answer.asked.max_input
    if answer.excluded:
        return replace(answer, verdict=INFEASIBLE, binding=f"{answer.lower_by}: {answer.excluded}")
    if answer.peak is None or answer.product is None:
        return answer
    if answer.peak <= U:
        return replace(answer, binding="the residual is not proved")
    over = f"the proved peak is {up(answer.peak)}, {up(answer.peak / U)} times the limit"
    return replace(answer, binding=f"{over}; from T = {up(answer.product / U)} on it is met")


def _percent(part: Fraction, whole: Fraction) -> str:
    return f"{up(100 * part / whole, 4)} % of the limit"
