"""Facts as lines for a terminal: a head of ten characters and a text; few lines, or all of them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from itertools import dropwhile
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ptcc_certify.certificate.assessment import OPEN, REFUTED
from ptcc_certify.certificate.fact import Fact
from ptcc_certify.checker.family import THEOREM
from ptcc_certify.checker.structure import reference
from ptcc_certify.errors import PTCCError, Spelling, spell
from ptcc_certify.report.facts.claim import WHATEVER
from ptcc_certify.report.text_layout import TEXT, columns, format_lines, wrap_lines
from ptcc_certify.theorems.family_behaviour import DEPENDS

if TYPE_CHECKING:
    from ptcc_certify.certificate.certificate import Certificate
    from ptcc_certify.checker import CheckReport

#: Titles on a long screen, each before facts of these heads; those of others stay where they are.
SECTIONS = {
    "What is asked": ("graph", "family"),
    "Who leads, what is heard": ("messages", "leaders"),
    "Where they end": ("claim",),
    "How fast": ("rate", "why"),
    "How near, by when": ("error", "deviation"),
    "What it takes": ("input", "threshold", "effort", "limited"),
    "Proof": ("simulated", "proof", "note", "time limit"),
}
#: The section that keeps what is told of error and input under its own title.
_WHOLE = "Who leads, what is heard"


def short_screen(facts: Iterable[Fact], name: Spelling = str) -> list[str]:
    """Return facts as lines of 80 columns: details left out, and of a text that has shorter ones the first that fits.

    Parameters
    ----------
    facts : iterable of Fact
    name : callable, optional
        How changes that are advised are named; by default as in Python.

    Examples
    --------
    >>> more = Fact(head="rate", note="2", detail=True)
    >>> short_screen([Fact(head="error", note="none"), more, Fact(head="error", note="at all")])
    ['error      none', '           at all']
    """
    return wrap_lines(format_lines(entries((fact for fact in facts if not fact.detail), name, brief=True)))


def long_screen(facts: Iterable[Fact], name: Spelling = str) -> list[str]:
    """Return all facts as lines, as long as they are; those of several sections under a title each.

    Examples
    --------
    >>> rate = Fact(head="rate", note="2", detail=True)
    >>> long_screen([rate])
    ['rate       2']
    >>> long_screen([Fact(head="claim", note="consensus"), rate])
    ['', 'Where they end', 'claim      consensus', '', 'How fast', 'rate       2']
    """
    lines, title = [], ""
    for head, text in entries(facts, name):
        section = next((section for section, heads in SECTIONS.items() if head.lower() in heads), title)
        if section != title and not (title == _WHOLE and section in ("How near, by when", "What it takes")):
            lines += ["", section]
            title = section
        lines += format_lines([(head, text)])
    return lines[2:] if lines.count("") == 1 and not lines[0] else lines


def entries(facts: Iterable[Fact], name: Spelling = str, brief: bool = False) -> Iterator[tuple[str, str]]:
    """Yield head and text of each fact, the verdict first; of those of one head the first alone has it.

    Where it is to be ``brief``, the text is the first of the shorter ones that fits a line, or the last.
    """
    last = ""
    for fact in sorted(facts, key=lambda fact: fact.head != "verdict"):
        head = fact.head.upper() if fact.loud else fact.head
        texts = [spell(text, name) for text in (brief and fact.brief) or (fact.note,)]
        yield "" if head == last else head, next((text for text in texts if columns(text) <= TEXT), texts[-1])
        last = head


def summary_lines(
    certificate: Certificate,
    title: str | None = None,
    origins: Mapping[str, str] | None = None,
    name: Spelling = str,
) -> list[str]:
    r"""Return the short screen of a certificate: 8 lines of 80 columns, 10 or so rather than cut an answer.

    Parameters
    ----------
    certificate : Certificate
    title : str, optional
        What the graph is called, unless as the certificate says.
    origins : mapping of str to str, optional
        Where ``x(0)`` and ``sigma(0)`` come from, by these names, unless as the certificate says.
    name : callable, optional
        How changes that are advised are named; by default as in Python.

    Examples
    --------
    >>> foes = SignedDigraph.from_edges([("a", "b", -1), ("b", "a", -1)])
    >>> cert = certify(foes, NominalProtocol(T=1, rho1=1, rho2=2, kappa=1), [3, 5], asks=Asks(simulation=False))
    >>> print("\n".join(summary_lines(cert, "foes")))
    verdict    certified; checked without a solver
    graph      foes: 2 nodes, 2 edges (2 negative), strongly connected
    read       row a,b: information flows a -> b; undirected
    protocol   nominal: T=1, rho1=1, rho2=2, kappa=1; x(0) given
    claim      signed-average consensus at T = 1 (Theorem 1.1, Corollary 1.1)
    x(T)       a=-1, b=1 (exact)
    error      at 0.99 T: ||E|| <= 1.4e-09 ||E(0)||, every agent within 5.6e-09
    input      bounded; |u_k| <= 24.01, the largest of agent a
    >>> unsure = Family.from_intervals([("a", "b", "0.9", "1.1")], undirected=True)
    >>> print("\n".join(summary_lines(certify(unsure, NominalProtocol(T=1, rho1=1, rho2=2, kappa=1)), "pair")))
    verdict    certified; checked without a solver
    family     pair: 2 nodes, 2 edges, 2 uncertain
    protocol   nominal: T=1, rho1=1, rho2=2, kappa=1; no x(0)
    claim      consensus at T = 1 for every signal
    rate       3.59999, upper bound 3.6: both proved, ratio 0.999999
    input      bounded for every signal and every initial state
    """
    from ptcc_certify.report.facts.of_certificate import facts_of  # ``classify`` has no use for solvers

    return short_screen(facts_of(certificate, title, origins, details=False), name)


def certificate_lines(
    certificate: Certificate,
    title: str | None = None,
    origins: Mapping[str, str] | None = None,
    name: Spelling = str,
) -> list[str]:
    """Return the long screen of a certificate: all facts; parameters are those of :func:`summary_lines`."""
    from ptcc_certify.report.facts.of_certificate import facts_of  # ``classify`` has no use for solvers

    return long_screen(facts_of(certificate, title, origins), name)


def check_summary(path: str, document: Mapping[str, Any], report: CheckReport) -> list[str]:
    """Return the short screen of ``ptcc check``: what is claimed, as ``certify`` tells it, and whether it was verified.

    Without a path, and where a number is beyond float64, nothing but the claim itself.
    """
    lines = []
    if report.accepted:
        claims = _file_claims(document)
        texts = sorted({_file_claim(claim) for claim in claims})
        where = f" in {len(claims)} components" if len(claims) > 1 else ""
        lines = format_lines([("claim", ", ".join(texts) + where)])
    certificate = certificate_of_file(path, document, report)
    with suppress(PTCCError):
        if certificate is not None:
            lines = short_screen(dropwhile(lambda fact: fact.head != "protocol", _file_facts(path, certificate)))
    return wrap_lines([*lines, accepted_line(report, certificate)])


def certificate_of_file(path: str, document: Mapping[str, Any], report: CheckReport) -> Certificate | None:
    """Return an accepted certificate; None of others, without a path, and where a number is beyond float64."""
    from ptcc_certify.certificate.certificate import accepted_certificate
    from ptcc_certify.certificate.section_io import read_side_files

    with suppress(PTCCError):
        if report.accepted and report.sections and path:
            files = read_side_files(document, Path(path).parent)
            return accepted_certificate(Path(path), document, "", report, files)
    return None


def accepted_line(report: CheckReport, certificate: Certificate | None) -> str:
    """Return the last line of a check, which tells too what became of what was asked where that is not met."""
    asked = None if certificate is None else certificate.assessment.asked
    verdict, *rest = report.lines()[-1].split("; ", 1)
    return "; ".join([verdict, *([f"what was asked is {asked}"] if asked in (REFUTED, OPEN) else []), *rest])


def _file_claims(document: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Return the claims of a file: of many components their parts stand in arrays."""
    components = document.get("components", [document])
    if isinstance(components, list):
        return [part["claim"] for part in components]
    keys = "theorem", "behaviour", "corollaries"
    return [dict(zip(keys, claim, strict=True)) for claim in zip(*(components[key] for key in keys), strict=True)]


def _file_claim(claim: Mapping[str, Any]) -> str:
    """Tell a claim of a file in a few words."""
    if claim["theorem"] != THEOREM:
        return f"{claim['behaviour']} ({reference(claim['theorem'], claim['corollaries'])})"
    return claim["behaviour"] if claim["behaviour"] == DEPENDS else f"{claim['behaviour']} {WHATEVER['any']}"


def _file_facts(path: str, certificate: Certificate) -> list[Fact]:
    """Return the facts of an accepted certificate, as its file says it; a verdict only where something is left open."""
    from ptcc_certify.report.facts.of_certificate import facts_of

    origins = dict.fromkeys(("x(0)", "v(0)", "a(0)", "sigma(0)"), "as in the file")
    facts = facts_of(certificate, path, origins, details=False)
    return [fact for fact in facts if fact.head != "verdict" or certificate.assessment.asked]
