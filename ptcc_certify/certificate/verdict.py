"""The verdict of a certificate in one line, and the exit code that agrees with it.

To ``certified`` and ``undecided`` it adds three things: whether the bound says something by the deadline with the gains
at hand, and whether they bound the input, if not which gains would; what to try next where nothing was decided; and
which expectation was met, refuted or left open.

*Useful* is a bound that leaves at most 1 % at 0.99 T, by one of two measures:

* ``||z|| <= ||z(0)|| / 100`` for every initial state, ``z`` being the coordinates ``E`` or ``eps`` of the envelope;
* from the given initial state, no agent is farther from its final state than a hundredth of the longest way of all.

Under the sliding-mode protocol with a reaching phase the first alone counts, from ``T_r`` on: ``||z||`` at
``T_r + 0.99 T_s`` against ``||z(T_r)||``.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from lmi.exact.decimal_rounding import down, near, up
from ptcc_certify.bounds.envelope import Envelope
from ptcc_certify.certificate.agents_answer import AgentsAnswer
from ptcc_certify.certificate.answer import MET, OPEN, REFUTED, Answer, rejection_text, rejects, standing
from ptcc_certify.certificate.certificate_data import Content
from ptcc_certify.certificate.late_answers import (
    at_deadline,
    judge_input_beside,
    judge_messages,
    judge_rate_beside,
    use_of_late,
    use_of_tracking,
)
from ptcc_certify.checker import CheckReport
from ptcc_certify.checker.input_formulas import InitialSet, root_above
from ptcc_certify.errors import ExitCode
from ptcc_certify.graphs.size_limits import EXACT_NODES
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.lyapunov.search import USEFUL

#: The share of the time that is left where the bound is judged.
LAST = Fraction(1, 100)
#: Digits of the gain that is proposed.
_DIGITS = 3
_LARGEST_CLOCK = 1e12
#: Steps of :func:`certify` without which there may be a rate; the time limit may end the others, which seek one.
NO_SEARCHES = ("simulation", "upper bound on the decay rate", "exact final state")
#: From so many decades between weights on, they are named as the reason that nothing was proved.
MANY_DECADES = 8

CERTIFIED, UNDECIDED = "certified", "undecided"
VIOLATED = "VIOLATED: the simulated run exceeds the proved bound; please report this graph"


@dataclass(frozen=True)
class Assessment:
    """The graded verdict of a certificate: what it is worth, what became of what was asked, and the exit code.

    A bound is useful if it leaves at most 1 % at ``0.99 T``: of ``||E(0)||`` (or ``||eps(0)||``), or from the initial
    state of the longest way of an agent; under the sliding-mode protocol of ``||E(T_r)||`` at ``T_r + 0.99 T_s``.

    Attributes
    ----------
    verdict : {"certified", "undecided"}
        Of the certificate.
    violated : bool
        Whether the simulated run exceeds a proved bound.
    useful : bool or None
        Whether the bound says something by the deadline with these gains; None if nothing is certified.
    remark : str
        What it says, or does not, or what to try next.
    advice : str
        Gains with which the bound would be useful and the input bounded; empty if both hold, or if none are known.
    answers : tuple of Answer
        One for each expectation.
    caveat : str
        That the input is not bounded, or not proved bounded; empty if it is, or if limits of the gain bound it.
    without : str
        Which of limits, noise and disturbances were asked for and are not counted in.

    References
    ----------
    Theorems 1 to 6 of [Zhu]_ are what is certified.

    Examples
    --------
    >>> pair = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])
    >>> protocol = NominalProtocol(T=1, rho1=1, rho2=2, kappa=1)
    >>> assessment = certify(pair, protocol, asks=Asks(simulation=False)).assessment
    >>> assessment.verdict, assessment.useful, int(assessment.exit_code)
    ('certified', True, 0)
    """

    verdict: str
    violated: bool
    useful: bool | None
    remark: str
    advice: str
    answers: tuple[Answer, ...]
    caveat: str = ""
    without: str = ""

    @property
    def exit_code(self) -> int:
        """0 proved and everything asked holds, 1 violated, 3 an expectation refuted, 4 undecided or one left open."""
        statuses = {answer.status for answer in self.answers}
        return exit_code(self.violated, REFUTED in statuses, OPEN in statuses or self.verdict != CERTIFIED)

    @property
    def asked(self) -> str | None:
        """The worst of what became of the expectations; None if there were none."""
        statuses = {answer.status for answer in self.answers}
        return next((status for status in (REFUTED, OPEN, MET) if status in statuses), None)

    @property
    def word(self) -> str:
        """The verdict in a few words."""
        if self.violated:
            return "VIOLATED"
        if self.asked in (REFUTED, OPEN) and (self.asked == REFUTED or self.verdict == CERTIFIED):
            return str(self.asked)
        return f"{self.verdict}, says little by T" if self.useful is False else self.verdict

    @property
    def certified_part(self) -> str:
        """What is certified where something asked is not."""
        return "the rest is " * (self.asked in (REFUTED, OPEN)) + CERTIFIED + self.without

    @property
    def text(self) -> str:
        """The verdict line: what is not as one would wish comes first, and agrees with the exit code."""
        crowded = self.violated or self.asked in (REFUTED, OPEN)
        if self.verdict != CERTIFIED:
            return self.line(f"{self.verdict}: {self.remark}")
        if self.useful is not False:
            return self.line(self.certified_part, "" if crowded else self.remark, self.caveat, self.advice)
        little = f"{self.certified_part}, but with these gains the bound says little by T"
        return self.line(little if crowded else f"{little}: {self.remark}", self.caveat, self.advice)

    def line(self, *verdict: str) -> str:
        """Return a verdict in its place among what became of what was asked.

        Parameters
        ----------
        *verdict : str
            Its parts; empty ones are left out.
        """
        told = {
            status: ", ".join(str(a) for a in self.answers if a.status == status) for status in (REFUTED, OPEN, MET)
        }
        *unmet, met = (f"{status}: {texts}" if texts else "" for status, texts in told.items())
        order = (met, *verdict) if self.verdict == CERTIFIED else (*verdict, met)
        return "; ".join(filter(None, (VIOLATED * self.violated, *unmet, *order)))


def verdict_of(report: CheckReport | None) -> str:
    """Return ``certified`` if rate and final state were proved and the check accepts it, else ``undecided``.

    Examples
    --------
    >>> verdict_of(None)
    'undecided'
    """
    return report.verdict if report is not None and report.accepted else UNDECIDED


def exit_code(violated: bool, refuted: bool, left_open: bool) -> int:
    """Return the exit code: 1 violated, 3 refuted, 4 undecided or left open, 0 otherwise; the first that holds.

    Examples
    --------
    >>> int(exit_code(False, True, True)), int(exit_code(False, False, False))
    (3, 0)
    """
    codes = ((violated, ExitCode.VIOLATED), (refuted, ExitCode.REFUTED), (left_open, ExitCode.UNDECIDED))
    return next((code for holds, code in codes if holds), ExitCode.OK)


def worst_code(codes: Iterable[int]) -> int:
    """Return the worst of several exit codes.

    Examples
    --------
    >>> int(worst_code([0, 4, 3])), int(worst_code([]))
    (3, 0)
    """
    present = set(codes)
    return exit_code(ExitCode.VIOLATED in present, ExitCode.REFUTED in present, ExitCode.UNDECIDED in present)


def assess(certificate: Content, report: CheckReport | None) -> Assessment:
    """Return the graded verdict of a certificate, and of what was expected of it.

    Parameters
    ----------
    certificate : Certificate
    report : CheckReport or None
        What the independent check says of it; None if nothing was proved.

    Returns
    -------
    Assessment

    Examples
    --------
    >>> pair = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])
    >>> weak, strong = (NominalProtocol(T=1, rho1=1, rho2=k, kappa=1) for k in ("0.1", 2))
    >>> print(certify(pair, weak, [3, 1], asks=Asks(simulation=False)).assessment.text)
    certified, but with these gains the bound says little by T: ||E|| <= 0.055 ||E(0)|| at 0.99 T; \
the input is not bounded; --rho2 0.501 (rho2 kappa 0.501) leaves 1 % and bounds the input
    >>> assessment = certify(pair, strong, [3, 1], asks=Asks(simulation=False)).assessment
    >>> assessment.useful, int(assessment.exit_code)
    (True, 0)
    """
    expectations = certificate.expectations
    answers = []
    if expectations.behaviour is not None:
        answers.append(at_deadline(certificate, _judge_behaviour(certificate, expectations.behaviour)))
    answers += [] if expectations.min_rate is None else [judge_rate(certificate, expectations.min_rate)]
    answers += [] if expectations.max_input is None else [judge_input(certificate, expectations.max_input)]
    answers += judge_limits(certificate)
    answers += judge_messages(certificate)
    useful, remark, caveat, advice = None, "", "", ""
    verdict = verdict_of(report)
    if verdict != CERTIFIED:
        remark = _next_step(certificate, report)
    elif certificate.constant:
        useful, remark = True, "nothing to decay"
    elif certificate.agents is not None:
        useful, remark, caveat, advice = _assess_agents(certificate.agents)
    elif certificate.late is not None:
        useful, remark, caveat = use_of_late(certificate.late, certificate.longest_way)
    elif certificate.tracking is not None:
        useful, remark, caveat, advice = use_of_tracking(certificate.tracking)
    else:
        limited = certificate.effort is not None and certificate.effort.residual
        useful, remark, rho2 = (_limited_usefulness if limited else _usefulness)(certificate)
        caveat, advice = ("", "") if limited else _advise(certificate, rho2)
    violated = certificate.violated and not rejects(report)
    ignored = sorted({answer.what for answer in answers if answer.status == OPEN} & {"limits", "noise"})
    ignored += ["disturbances"] * (certificate.delta is not None)
    without = f" without {' and '.join(ignored)}" if ignored else ""
    return Assessment(verdict, violated, useful, remark, advice, standing(answers, report), caveat, without)


# ---------------------------------------------------------------------- expectations


def judge_behaviour(structure: Structure, expected: str) -> Answer:
    """Tell whether a behaviour follows from the theorem that applies, in every component."""
    if structure.holds(expected):
        return Answer(MET, expected)
    claims = [component.claim for component in structure.components]
    return Answer(REFUTED, expected, f"it is {claims[0].sharpest}" if len(claims) == 1 else "not in every component")


def _judge_behaviour(certificate: Content, expected: str) -> Answer:
    """Tell the same of what the agents are, which may be of order n, and have places or a capped gain."""
    answer, part = judge_behaviour(certificate.structure, expected), certificate.agents
    if part is None and certificate.offsets is not None:
        what = f"{expected} of x - offsets"
        if certificate.limits:
            return Answer(OPEN, what, "limits of the gain leave something at T")
        return replace(answer, what=what)
    if part is None:
        return answer
    what = f"{expected} of x - offsets" if part.formation else expected
    if part.settles:
        return replace(answer, what=what)
    return Answer(OPEN, what, "the capped gain leaves something at T" if part.functions else "no decay is proved")


def judge_rate(certificate: Content, least: Fraction) -> Answer:
    """Tell whether a rate of at least so much is proved, or excluded by the proved upper bound."""
    what, rate, bound = f"rate >= {near(least, 12)}", certificate.rate, certificate.upper_bound
    if (beside := judge_rate_beside(certificate, least, what)) is not None:
        return beside
    if certificate.agents is not None:
        rate, bound = certificate.agents.rate if certificate.agents.functions else None, None
    if certificate.constant or (rate is not None and rate >= least):
        return Answer(MET, what)
    if bound is not None and least > bound:
        return Answer(REFUTED, what, f"upper bound {up(bound, 8)}, proved")
    reason = "none is proved" if rate is None else f"proved: {down(rate)}"
    if rate is None and certificate.agents is not None and certificate.agents.functions:
        reason = "deviations of the cascade fall by two laws, not by one rate"
    return Answer(OPEN, what, reason if bound is None else f"{reason}, at most {up(bound, 8)} can be")


def judge_input(certificate: Content, most: Fraction) -> Answer:
    """Tell whether every input is proved to stay within so much, under all that was asked for besides."""
    effort, what = certificate.effort, f"|u_k| <= {near(most, 12)}"
    if certificate.agents is not None:
        return certificate.agents.judge_input(most)
    if certificate.constant:
        return Answer(MET, what)
    beside = (certificate.late, certificate.tracking, certificate.request.leaders)
    if any(part is not None for part in beside):
        return judge_input_beside(certificate, most, what, _first_input(certificate))
    least, bound = input_range(certificate)
    if bound is not None and bound <= most:
        return Answer(MET, what)
    if least > most:
        first = effort is not None and effort.first is not None and effort.first >= least
        size = f"up to {down(least)}" if least < math.inf else "without limit"
        return Answer(REFUTED, what, f"it is {size} {'at the start' if first else 'by the noise alone'}, proved")
    solid = (
        effort is not None and effort.initial_set is not None and all(r > 0 for r in effort.initial_set.radius or (0,))
    )
    if effort is not None and effort.bounded is False and solid and not certificate.limits:
        return Answer(REFUTED, what, "from some of these initial states it grows without limit, proved")
    return Answer(OPEN, what, "no bound is proved" if bound is None else f"proved: {up(bound)}")


def input_range(certificate: Content) -> tuple[Fraction | float, Fraction | None]:
    """Return proved bounds of the largest ``|u_k|`` over all agents, initial states, noise and disturbances.

    Under the limits of the gain, with noise within ``noise`` and disturbances within ``delta``. The lower bound is
    attained or approached: at first, or where noise meets the largest gain, without a limit an infinite one.
    The upper one is None where nothing is proved. What disturbances add under the protocol itself they add at most
    under a cap and a stop, too: ``gain int_0^t e^(-alpha (s(t) - s(r))) dr`` stays below what is proved without these.
    """
    effort, p, graph = certificate.effort, certificate.protocol, certificate.structure.graph
    if effort is None:
        return Fraction(0), None
    tops = [entry.largest_gain(p.gain.exact) for entry in certificate.limits]
    share = min([Fraction(1), *(top / p.gain.first for top in tops)])
    least: Fraction | float = (effort.first or Fraction(0)) * share
    if certificate.noise is not None:
        rows = graph.exact_rows(range(graph.n_nodes))
        degree = max(row.get(v, Fraction(0)) for v, row in enumerate(rows))
        least = max(least, 2 * degree * certificate.noise * min(tops)) if tops else math.inf
    if certificate.limits:
        peaks = [e.largest if certificate.noise is None else e.noisy_largest for e in effort.residual]
        most = None if len(peaks) < len(certificate.limits) or None in peaks else max(x for x in peaks if x is not None)
    else:
        most = None if effort.peak is None or certificate.noise is not None else effort.peak.largest
    if most is not None and certificate.delta is not None:
        most = None if effort.disturbed is None else most + max(effort.disturbed.inputs)
    return least, most


def _first_input(certificate: Content) -> Fraction:
    """Return what the largest ``|u_k(0)|`` is at least under the limits of the gain; 0 where nothing is known."""
    effort, gain, late = certificate.effort, certificate.protocol.gain.exact, certificate.late
    if effort is None or effort.first is None:
        return Fraction(0)
    caps = [] if late is None or late.messages.gain_cap is None else [late.messages.gain_cap]
    tops = [*caps, *(entry.largest_gain(gain) for entry in certificate.limits)]
    return effort.first * min([Fraction(1), *(top / certificate.protocol.gain.first for top in tops)])


def judge_limits(certificate: Content) -> list[Answer]:
    """Tell which of the limits, noise and disturbances that were asked for are not certified."""
    effort, answers = certificate.effort, []
    residual = () if effort is None else effort.residual
    no_bound = "no bound of its effect is proved" + "; try --method best" * (certificate.method != "best")
    if len(residual) < len(certificate.limits) and not certificate.constant:
        period = None if effort is None else effort.longest_period
        why = no_bound.replace("its", "their") if period is None else f"certified with a period of {down(period, 4)}"
        answers.append(Answer(OPEN, "limits", why))
    silent = not residual or len(residual) < len(certificate.limits) or not all(entry.noise for entry in residual)
    if certificate.noise is not None and silent and not certificate.constant:
        why = "without a limit it meets an infinite gain: add --gain-cap or --stop-before"
        if any(entry.sample_period is not None for entry in certificate.limits):
            why = "with a sample period no bound is proved: ask for each alone"
        elif certificate.limits:
            why = no_bound
        answers.append(Answer(OPEN, "noise", why))
    if certificate.delta is not None and (effort is None or effort.disturbed is None):
        bounded = effort is not None and effort.bounded
        answers.append(Answer(OPEN, "delta", no_bound if bounded else "the rate proves no bounded input"))
    return answers


# ---------------------------------------------------------------------- use


def _usefulness(certificate: Content) -> tuple[bool, str, Fraction | None]:
    """Return whether the bound is useful, what it says, and a ``rho2`` that would make it so."""
    envelope, p, direct = certificate.envelope, certificate.protocol, certificate.direct
    span = p.T if direct else p.span
    z, instant = envelope.coordinates, "0.99 T"
    begin = f"{z}(0)"
    if not direct:
        begin, instant = f"{z}(T_r)", "T_r + 0.99 T_s"
    constant, pole = float(p.rho1 * span * (1 - LAST)), float(p.rho2 * p.kappa)
    share = _share(envelope, constant + pole * math.log(1 / LAST))
    remark = f"||{z}|| <= {up(share, 2)} ||{begin}|| at {instant}"
    if share <= USEFUL:
        return True, remark, None
    of_set = certificate.effort is not None and certificate.effort.initial_set is not None
    if direct and not of_set and (way := certificate.longest_way) is not None:
        worst = float(certificate.deviation_bound([float(LAST)]).max(initial=0.0))
        if worst <= USEFUL * way:
            return True, f"every agent within {up(worst, 2)} of its final state at {instant}", None
    return False, remark, _useful_rho2(envelope, constant, p.kappa)


def _assess_agents(part: AgentsAnswer) -> tuple[bool | None, str, str, str]:
    """Return whether bounds of agents of order n say something by ``T``, what, what is not proved, and a mend."""
    capped, caveat, advice = part.protocol.gain_cap is not None, "", ""
    if part.unbounded:
        mends = [mend for _, mend in part.unbounded]
        caveat = "the input is not certified bounded"
        advice = f"{' and '.join(mends)} bound{'s' * (len(mends) == 1)} it"
    last = np.array([0.0 if capped else float(LAST)])
    fall = part.fall(float(last[0]))
    worst = float(part.deviation_bound(last)[:, 0].max(initial=0.0))
    when = "T" if capped else "0.99 T"
    remark = f"every position within {up(worst, 2)} of its place at {when}"
    if part.initial_state is None or not math.isfinite(worst):
        return fall <= USEFUL, f"deviations at {when} are {up(fall, 2)} of {part.first_ones}", caveat, advice
    useful = worst <= USEFUL * part.longest_way if part.longest_way else fall <= USEFUL
    if not useful and not capped and not advice:
        advice = part.nearer
    return useful, remark, caveat, advice


def _limited_usefulness(certificate: Content) -> tuple[bool, str, None]:
    """Return the same of what is left at the deadline itself under the limits of the gain that were asked about."""
    effort, x0, way = certificate.effort, certificate.initial_state, certificate.longest_way
    residual = () if effort is None else effort.residual
    region = None if effort is None else effort.initial_set
    noisy = any(entry.noise is not None for entry in residual)
    if region is None and way is not None and not noisy and all(entry.agents is not None for entry in residual):
        worst = max(x for entry in residual for x in entry.agents or ())
        if worst <= Fraction(USEFUL) * Fraction(way):
            return True, f"under the limits every agent within {up(worst, 2)} of its final state at T", None
    norm = max(entry.norm if entry.noisy_norm is None else entry.noisy_norm for entry in residual)
    remark = f"under the limits ||E|| <= {up(norm, 2)} at T"
    rows = certificate.structure.graph.exact_rows(range(certificate.structure.graph.n_nodes))
    if region is not None:  # the largest |e_k(0)| of the set is attained, the norm that goes with it is larger
        largest = max(region.largest(row) for row in rows)
        return norm <= Fraction(USEFUL) * largest, f"{remark} from all these initial states", None
    first = Fraction(0) if x0 is None else sum((InitialSet(x0).largest(row) ** 2 for row in rows), Fraction(0))
    if not first:
        return norm == 0, remark, None
    share = root_above(norm**2 / first)
    return share <= USEFUL, f"under the limits ||E|| <= {up(share, 2)} ||E(0)|| at T", None


def _advise(certificate: Content, rho2: Fraction | None) -> tuple[str, str]:
    """Return what is not proved of the input, and gains that bound it and, given ``rho2``, leave a hundredth."""
    effort, p, rate = certificate.effort, certificate.protocol, certificate.rate
    if effort is None:
        return "", ""
    sliding_open = effort.peak is None and effort.sliding is not None and not effort.sliding.bounded
    caveat = "" if effort.bounded else f"the input is not {'' if effort.bounded is False else 'proved '}bounded"
    caveat = caveat or "the input is not proved bounded" * sliding_open
    effects = ["leaves 1 %"] * (rho2 is not None) + ["bounds the input"] * bool(caveat)
    if not effort.bounded and rate is not None:
        rho2 = max(rho2 or Fraction(0), _rounded_up(2 / rate / p.kappa))
    gains = [] if rho2 is None else [f"--rho2 {near(rho2)} (rho2 kappa {near(rho2 * p.kappa)})"]
    gains += [f"--mu3 {near(_rounded_up(1 / p.kappa))}"] * sliding_open
    return caveat, " ".join([*gains, " and ".join(effects)]) if gains else ""


def _rounded_up(gain: Fraction) -> Fraction:
    """Return a gain of few digits that is no smaller."""
    return Fraction(up(gain, _DIGITS))


def _share(envelope: Envelope, clock: float) -> float:
    """Return what is left of ``||z||`` after so much of the clock, rounded up."""
    return float(Envelope(envelope.structure, envelope.gain, envelope.functions).norm_factor(clock))


def _useful_rho2(envelope: Envelope, constant: float, kappa: Fraction) -> Fraction | None:
    """Return a short ``rho2`` with which the bounds at hand leave a hundredth; None if there is none."""
    low, high = constant, max(constant, 1e-300)
    while _share(envelope, high) > USEFUL:
        low, high = high, 2 * high
        if high > _LARGEST_CLOCK:
            return None
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if _share(envelope, middle) > USEFUL else (low, middle)
    rho2 = Fraction(high - constant) / Fraction(math.log(1 / LAST)) / kappa
    return _rounded_up(rho2 * (1 + Fraction(1, 10**9))) if rho2 > 0 else None


# ---------------------------------------------------------------------- what to try next


def _next_step(certificate: Content, report: CheckReport | None) -> str:
    """Tell why nothing was decided, and what to try."""
    if report is not None and rejects(report):
        return rejection_text(report)
    method, notes, n = certificate.method, certificate.notes, certificate.graph.n_nodes
    if certificate.rate is None:
        if any(name not in NO_SEARCHES for name in certificate.cut_off):
            return f"no rate is proved, the search took its share of {certificate.time_limit:g} s; raise --time-limit"
        if method != "best":
            return f"--method {method} proves no rate; try --method best"
        if (decades := certificate.graph.weight_decades) >= MANY_DECADES:
            return f"no rate is proved, weights span {decades} decades: rescale them, or leave out the smallest"
        groups = [note for note in notes if "leader group" in note and "lmi is for" not in note]
        if groups:
            most = max(len(component.nodes) for component in certificate.structure.closed_components)
            return f"no rate is proved: a leader group of {most} nodes is too much; certify followers and leaders apart"
        size = "--method lmi" if n > EXACT_NODES else "rounding the weights to fewer digits"
        return f"no rate is proved; try {size}"
    return (
        "the final state is not proved, the equations are ill-conditioned: rescale weights that are far from the others"
    )
