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
from typing import TYPE_CHECKING, Any

import numpy as np

from lmi.exact.decimal_rounding import up
from ptcc_certify.bounds.input.initial_sets import initial_set_within
from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.certificate.certification import certify
from ptcc_certify.checker import INPUT_NODES
from ptcc_certify.checker.input_formulas import InitialSet
from ptcc_certify.errors import ParameterError
from ptcc_certify.gain_design.answer import INFEASIBLE, MET, UNPROVED, Design, refusal
from ptcc_certify.gain_design.gain_candidates import Option, decimal, options
from ptcc_certify.gain_design.request import DesignRequest, Fit, fit_of
from ptcc_certify.gain_design.shortest_possible import lower_product
from ptcc_certify.graphs.rationals import nearest_float, shorten
from ptcc_certify.graphs.structure import Structure, analyse
from ptcc_certify.model import NominalProtocol
from ptcc_certify.model.asks import Asks, Expectations
from ptcc_certify.model.gain_limits import GainLimits
from ptcc_certify.model.parameters import parameter
from ptcc_certify.theorems.lemmas import laplacian_spectrum

if TYPE_CHECKING:
    from ptcc_certify.graphs.digraph import Exact

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
