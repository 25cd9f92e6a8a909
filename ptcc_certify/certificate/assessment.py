"""The words of a verdict: what became of one expectation, the verdict in one line, and the exit code that agrees."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

from ptcc_certify.checker import CheckReport
from ptcc_certify.errors import ExitCode, Sentence, joined, spell

#: What became of an expectation.
MET, REFUTED, OPEN = "met", "refuted", "left open"
CERTIFIED, UNDECIDED = "certified", "undecided"
VIOLATED = "VIOLATED: the simulated run exceeds the proved bound; please report this graph"


@dataclass(frozen=True)
class Answer:
    """What became of one expectation: ``met``, ``refuted`` or ``left open``, of what, and why."""

    status: str
    what: str
    why: Sentence = ""

    @property
    def sentence(self) -> Sentence:
        """What was asked, and why that became of it."""
        return joined("", (self.what, " (", self.why, ")")) if self.why else self.what

    def __str__(self) -> str:
        return spell(self.sentence)


def rejects(report: CheckReport | None) -> bool:
    """Tell whether the independent check rejects what was found: a defect of this program, which then claims nothing.

    Examples
    --------
    >>> rejects(None), rejects(certify("fig1a", NominalProtocol()).checked)
    (False, False)
    """
    return report is not None and not report.accepted


def rejection_text(report: CheckReport) -> str:
    """Tell what the check rejects, and whose defect that is."""
    return (
        f"the independent check rejects {report.rejected}, a defect of this program: nothing is claimed; "
        "please report this graph"
    )


def rejection(report: CheckReport) -> dict[str, Any]:
    """Return what is left of a certificate that the check rejects, as JSON-ready data: no claim.

    Examples
    --------
    >>> rejection(check({"schema": "ptcc-certificate/3"}))["verdict"]
    'undecided'
    """
    return {"verdict": "undecided", "rejected": report.rejected, "reason": report.reason}


def standing(answers: Iterable[Answer], report: CheckReport | None) -> tuple[Answer, ...]:
    """Return the answers as they rest on what the check accepts: without that all are left open.

    Examples
    --------
    >>> [str(answer) for answer in standing([Answer(REFUTED, "rate >= 5", "upper bound 4, proved")], None)]
    ['rate >= 5 (nothing is certified)']
    """
    if report is not None and report.accepted:
        return tuple(answers)
    return tuple(replace(answer, status=OPEN, why="nothing is certified") for answer in answers)


@dataclass(frozen=True)
class Assessment:
    """The graded verdict of a certificate: what it is worth, what became of what was asked, and the exit code.

    A bound is useful if it leaves at most 1 % at ``0.99 T``: of ``||E(0)||`` (or ``||eps(0)||``), or from the initial
    state of the longest way of an agent; under the sliding-mode protocol of ``||E(T_r)||`` at ``T_r + 0.99 T_s``. Where
    it was asked what may be left at ``T``, that decides.

    Attributes
    ----------
    verdict : {"certified", "undecided"}
        Of the certificate.
    violated : bool
        Whether the simulated run exceeds a proved bound.
    useful : bool or None
        Whether the bound says something by the deadline with these gains; None if nothing is certified, or if less
        was asked to be left and that is not met.
    remark : str, or tuple of str and Change
        What it says, or does not, or what to try next.
    advice : str, or tuple of str and Change
        Gains with which the bound would be useful and the input bounded, or what to try; empty if both hold.
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
    remark: Sentence
    advice: Sentence
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
        return f"{'the rest is ' if self.asked in (REFUTED, OPEN) else ''}{CERTIFIED}{self.without}"

    @property
    def sentence(self) -> Sentence:
        """The verdict line: what is not as one would wish comes first, and agrees with the exit code."""
        crowded = self.violated or self.asked in (REFUTED, OPEN)
        if self.verdict != CERTIFIED:
            return self.line(joined(": ", (self.verdict, self.remark)))
        if self.useful is not False:
            return self.line(self.certified_part, "" if crowded else self.remark, self.caveat, self.advice)
        little = f"{self.certified_part}, but with these gains the bound says little by T"
        return self.line(joined(": ", (little, "" if crowded else self.remark)), self.caveat, self.advice)

    @property
    def brief(self) -> Sentence:
        """The verdict line without the bound."""
        if self.verdict != CERTIFIED:
            return self.sentence
        certified = f"{self.certified_part}{', but says little by T' if self.useful is False else ''}"
        return self.line(certified, self.caveat, self.advice)

    @property
    def text(self) -> str:
        """The verdict line, with fields named as in Python."""
        return spell(self.sentence)

    def line(self, *verdict: Sentence) -> Sentence:
        """Return a verdict in its place among what became of what was asked.

        Parameters
        ----------
        *verdict : str, or tuple of str and Change
            Its parts; empty ones are left out.
        """
        answers = {
            status: joined(", ", (a.sentence for a in self.answers if a.status == status))
            for status in (REFUTED, OPEN, MET)
        }
        *unmet, met = (joined(": ", (status, answer)) if answer else "" for status, answer in answers.items())
        order = (met, *verdict) if self.verdict == CERTIFIED else (*verdict, met)
        return joined("; ", (VIOLATED if self.violated else "", *unmet, *order))


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
