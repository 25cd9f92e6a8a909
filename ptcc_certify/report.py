"""A certificate as something to send to a person: one page of HTML, or a statement in LaTeX.

Both are made from a file that the independent check accepts (:mod:`ptcc_certify.saved`). What was proved is told apart
from what is numerical: a simulated run, repeated for the figures. The page is one file that loads nothing and runs no
script; every text that stands in the certificate is shown as text, whatever it holds.
"""

from __future__ import annotations

import html
import io
import re
import shlex
import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from decimal import Decimal, localcontext
from fractions import Fraction
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ptcc_certify.bounds import FRACTIONS
from ptcc_certify.errors import ParameterError, SimulationError
from ptcc_certify.io import write_atomically
from ptcc_certify.plots import DRAWN_NODES, STYLE, plot_decay, plot_graph, plot_input, plot_sliding, save_figure
from ptcc_certify.protocols import Protocol, SlidingModeProtocol
from ptcc_certify.rationals import format_exact, nearest_float, writable
from ptcc_certify.saved import RejectedCertificate, SavedCertificate, read_certificate
from ptcc_certify.structure import Claim, ClosedComponent
from ptcc_certify.summary import down, remarks_on, structure_text, up
from ptcc_certify.theorems import THEOREMS
from ptcc_certify.trajectory import SlidingTrajectory

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ptcc_certify.input_bounds import Starts

#: What a report is written as.
SUFFIXES = (".html", ".htm", ".tex")
#: Rows of agents, of leader groups, and labels of a list that are written out; characters of a label.
ROWS, GROUPS, LISTED, CHARACTERS = 200, 40, 30, 48
#: Agents up to which a run is repeated unasked, and up to which there is a figure of every agent's input.
SIMULATED_NODES, INPUT_NODES = 1000, 100
#: Rows from which on a table of agents or obligations is folded.
FOLDED = 25
AUTHORS = "Zhen-Hua Zhu, Huaiyu Wu, Zhi-Hong Guan, Zhi-Wei Liu, Yang Chen, Xiujuan Zheng"
TITLE = "Robust prescribed-time coordination control of cooperative-antagonistic networks with disturbances"


def write_report(
    certificate: str | Path,
    output: str | Path,
    *,
    simulation: bool | None = None,
    progress: Callable[[str], None] = lambda step: None,
) -> str:
    """Check a certificate's file and write a report of it: a page (``.html``) or a statement in LaTeX (``.tex``).

    A statement has its figures beside it, ``<name>_graph.pdf`` and ``<name>_decay.pdf``. Of a certificate that the
    check rejects there is a page that says so and shows nothing else of it, and no statement.

    Parameters
    ----------
    certificate : path
        A file of schema ``ptcc-certificate/1``.
    output : path
        The suffix decides what is written.
    simulation : bool, optional
        Whether to repeat the CVODES run for the figures; by default up to 1,000 agents.
    progress : callable
        Told which of ``independent check``, ``simulation``, ``report`` begins.

    Returns
    -------
    str
        ``certified``, ``undecided`` or ``rejected``.

    Raises
    ------
    ParameterError
        Another suffix, or ``output`` is the certificate.
    FormatError
        The file cannot be read as a certificate, or the report not be written.
    RejectedCertificate
        A statement is asked of a certificate that the check rejects.
    """
    path, suffix = Path(output), Path(output).suffix.lower()
    if suffix not in SUFFIXES:
        raise ParameterError(f"{output}: a report is written to .html or .tex; choose one of these")
    if path.is_file() and Path(certificate).is_file() and path.samefile(certificate):
        raise ParameterError(f"{output}: is the certificate itself; name another file")
    if not path.parent.is_dir():
        raise ParameterError(f"{output}: the folder does not exist; make it first")
    if suffix == ".tex" and not re.fullmatch(r"[A-Za-z0-9_.-]+", path.stem):
        raise ParameterError(f"{output}: LaTeX wants a plain name; use letters, digits, -, _ and .")
    progress("independent check")
    try:
        saved = read_certificate(certificate)
    except RejectedCertificate as error:
        if suffix == ".tex":
            raise
        write_atomically(path, rejected_html(error))
        return "rejected"
    progress("simulation")
    saved, why = _with_run(saved, simulation)
    progress("report")
    if suffix == ".tex":
        figures = {}
        for name, figure in _figures(saved, ("graph", "decay")).items():
            figures[name] = path.with_name(f"{path.stem}_{name}.pdf")
            with _whatever_the_script():
                save_figure(figure, figures[name])
        write_atomically(path, report_latex(saved, {name: file.name for name, file in figures.items()}))
    else:
        write_atomically(path, report_html(saved, no_run=why))
    return saved.verdict


def _with_run(saved: SavedCertificate, simulation: bool | None) -> tuple[SavedCertificate, str]:
    """Repeat the run, if there is one to repeat; return why there is none."""
    n = saved.graph.n_nodes
    if simulation is False:
        return saved, "it was left out (--no-simulation)"
    if saved.start is None:
        return saved, "the certificate names no start"
    if simulation is None and n > SIMULATED_NODES:
        return saved, f"above {SIMULATED_NODES} agents it is repeated only where that is asked for"
    try:
        return saved.with_simulation(samples=201 if n <= INPUT_NODES else 101), ""
    except (SimulationError, ParameterError) as error:
        return saved, f"it failed: {error}"
    except OverflowError:
        return saved, "a number of the start is beyond the range of float64"


def _figures(saved: SavedCertificate, wanted: Sequence[str]) -> dict[str, Figure]:
    """Draw those of the wanted figures for which there is something to draw."""
    run, n = saved.trajectory, saved.graph.n_nodes
    figures: dict[str, Any] = {}
    if "graph" in wanted and n <= DRAWN_NODES:
        figures["graph"] = plot_graph(saved.structure).figure
    if run is None:
        return figures
    if "decay" in wanted and saved.comparison is not None and saved.envelope.members and not saved.constant:
        figures["decay"] = plot_decay(saved).figure
    if "sliding" in wanted and isinstance(run, SlidingTrajectory) and not saved.direct and n <= INPUT_NODES:
        figures["sliding"] = plot_sliding(run, saved.reaching).figure
    if "input" in wanted and n <= INPUT_NODES and (not saved.constant or isinstance(run, SlidingTrajectory)):
        figures["input"] = plot_input(run, saved.structure, saved).figure  # type: ignore[arg-type]
    return figures


@contextmanager
def _whatever_the_script() -> Iterator[None]:
    """Draw labels in scripts that the font does not have as boxes, without a word about each."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing from")
        yield


# ---------------------------------------------------------------------- numbers and texts


def _clean(text: str, limit: int = CHARACTERS) -> str:
    """Return a text of the file fit to be shown: cut, and what is not printable written as its code."""
    cut = text if len(text) <= limit else text[: limit - 1] + "\N{HORIZONTAL ELLIPSIS}"
    return "".join(c if c.isprintable() else f"\\u{{{ord(c):x}}}" for c in cut)


def _text(text: str, limit: int = 2000) -> str:
    return html.escape(_clean(text, limit))


def _label(text: str) -> str:
    """Return a label; ``bdi`` keeps its direction of writing to itself."""
    return f"<bdi>{html.escape(_clean(text))}</bdi>"


def _labels(labels: Sequence[str]) -> str:
    more = f" and {len(labels) - LISTED:,} more" if len(labels) > LISTED else ""
    return ", ".join(map(_label, labels[:LISTED])) + more


def _exact(x: Fraction) -> str:
    """Write a rational: as a decimal or a quotient if that is short, else with six digits, marked as near."""
    left = x.denominator
    for prime in (2, 5):
        while left % prime == 0:
            left //= prime
    if left == 1 and writable(x):
        with localcontext(prec=5000):
            text = f"{Decimal(x.numerator) / Decimal(x.denominator):f}"
        if len(text) <= 12:
            return text.replace("-", "\N{MINUS SIGN}")
    if writable(x) and len(text := format_exact(x)) <= 14:
        return text.replace("-", "\N{MINUS SIGN}")
    return _near(x)


def _near(x: Fraction) -> str:
    if abs(x) > 10**300:
        return "beyond 10<sup>300</sup>" if x > 0 else "beyond \N{MINUS SIGN}10<sup>300</sup>"
    return f"\N{ALMOST EQUAL TO} {_power(f'{nearest_float(x):.6g}')}"


def _power(text: str) -> str:
    """Write ``3e-07`` as a product with a power of ten, and a true minus sign."""
    mantissa, _, exponent = text.partition("e")
    mantissa = mantissa.replace("-", "\N{MINUS SIGN}")
    return f"{mantissa} \u00d7 10<sup>{int(exponent)}</sup>".replace("-", "\N{MINUS SIGN}") if exponent else mantissa


def _above(x: Fraction | float, digits: int = 4) -> str:
    return _power(up(x, digits))


def _below(x: Fraction | float, digits: int = 6) -> str:
    return _power(down(x, digits))


def _enclosed(value: tuple[Fraction, Fraction]) -> str:
    """Write a proved interval: exactly, or a decimal with a radius that takes its rounding in."""
    middle, radius = value
    if radius == 0:
        text = _exact(middle)
        return f"{_near(middle)} ({text})" if "/" in text else text
    text = f"{nearest_float(middle):.9g}"
    if "inf" in text:
        return _near(middle)
    return f"{_power(text)} \u00b1 {_above(radius + abs(middle - Fraction(text)), 2)}"


def _subscripts(text: str) -> str:
    """Set ``T_r`` and ``T_s`` with subscripts."""
    return re.sub(r"T_([rs])\b", r"T<sub>\1</sub>", text)


def _coordinates(saved: SavedCertificate) -> str:
    return "E" if saved.envelope.coordinates == "E" else "\u03b5"


# ---------------------------------------------------------------------- pieces of HTML


def _table(caption: str, head: Sequence[str], rows: Iterable[Sequence[str]], stack: bool = False) -> str:
    """Return a table of HTML cells, the first of each row its header; ``stack`` piles cells up on narrow screens."""
    cells = []
    for first, *others in rows:
        data = "".join(
            f'<td role="cell" data-label="{name}">{cell}</td>' for name, cell in zip(head[1:], others, strict=True)
        )
        cells.append(f'<tr role="row"><th scope="row" role="rowheader">{first}</th>{data}</tr>')
    columns = "".join(f'<th scope="col" role="columnheader">{name}</th>' for name in head)
    kind = "scroll stack" if stack else "scroll"
    return (
        f'<div class="{kind}"><table role="table"><caption>{caption}</caption>'
        f'<thead role="rowgroup"><tr role="row">{columns}</tr></thead>'
        f'<tbody role="rowgroup">{"".join(cells)}</tbody></table></div>'
    )


def _folded(summary: str, table: str, rows: int) -> str:
    """Return a table that is folded if it is long; on paper it is open."""
    return table if rows <= FOLDED else f"<details><summary>{summary}</summary>{table}</details>"


def _count(number: int, what: str) -> str:
    return f"{number:,} {what}{'' if number == 1 else 's'}"


def _list(items: Iterable[str]) -> str:
    return f"<ul>{''.join(f'<li>{item}</li>' for item in items)}</ul>"


def _figure(figure: Figure, name: str, caption: str) -> str:
    """Return a figure as inline SVG, which a caption of HTML describes in words and numbers."""
    from matplotlib import rc_context, style

    buffer = io.StringIO()
    with style.context(STYLE), rc_context({"svg.hashsalt": f"ptcc-{name}"}), _whatever_the_script():
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    svg = re.sub(r"<!--.*?-->|<metadata>.*?</metadata>|<style.*?</style>", "", buffer.getvalue(), flags=re.DOTALL)
    svg = re.sub(r"\bid=\"", f'id="{name}-', svg.replace("xlink:href=", "href="))
    svg = re.sub(r"(href=\"#|url\(#)", rf"\g<1>{name}-", svg)
    svg = re.sub(r' d="[^"]*"', lambda d: re.sub(r"(\.\d{3})\d+", r"\1", d[0]), svg)
    frame = re.search(r'<svg[^>]*viewBox="([-0-9. ]+)"[^>]*>', svg)
    assert frame is not None
    said = re.sub(r"<[^>]*>", "", caption)  # what is left is escaped already, quotes too
    head = f'<svg viewBox="{frame[1]}" role="img" aria-label="{said}">'
    return f'<figure id="figure-{name}">{head}{svg[frame.end() :].strip()}<figcaption>{caption}</figcaption></figure>'


def _page(title: str, body: str) -> str:
    style = (resources.files("ptcc_certify") / "report.css").read_text(encoding="utf-8")
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<meta name="color-scheme" content="light dark">\n<meta name="referrer" content="no-referrer">\n'
        "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'\">\n"
        f"<title>{title}</title>\n<style>\n{style}</style>\n</head>\n<body>\n<main>\n{body}\n</main>\n</body>\n</html>\n"
    )


def _verdict(kind: str, mark: str, word: str, said: str) -> str:
    return (
        f'<div class="verdict {kind}"><strong><span aria-hidden="true">{mark}</span> {word}</strong><p>{said}</p></div>'
    )


# ---------------------------------------------------------------------- the page


def rejected_html(error: RejectedCertificate) -> str:
    """Return the page of a certificate that the independent check rejects: the reason, and no claim.

    Parameters
    ----------
    error : RejectedCertificate
    """
    report, name = error.report, _text(error.path.name, 200)
    said = f"Nothing in this file may be taken for proved. {_text(str(report.reason)).capitalize()}."
    body = [
        f"<h1>Certificate {name}</h1>",
        _verdict("bad", "\u2718", "REJECTED by the independent check", said),
        f"<p>The part that was not verified: <code>{_text(str(report.rejected))}</code>. "
        f"{len(report.steps)} obligation(s) before it were verified, which by themselves make no claim.</p>",
        "<h2>What to do</h2>",
        _list(
            [
                f"Check the file yourself: <code>ptcc check {_text(shlex.quote(error.path.name), 200)}</code>.",
                "Side files belong in the folder of the certificate, under the names that it gives.",
                "Otherwise ask whoever sent the file for the graph, and certify it again: <code>ptcc certify</code>.",
            ]
        ),
    ]
    return _page(f"REJECTED: {name}", "\n".join(body))


def report_html(saved: SavedCertificate, *, no_run: str = "no run was asked for") -> str:
    """Return a certificate as one page of HTML that loads nothing and runs no script.

    Parameters
    ----------
    saved : SavedCertificate
        With a trajectory (:meth:`SavedCertificate.with_simulation`) for the figures of bound and input.
    no_run : str
        Why there is none, for the page.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> from ptcc_certify import NominalProtocol, SignedDigraph, certify
    >>> foes = SignedDigraph.from_edges([("<b>", "b", -1), ("b", "<b>", -1)])
    >>> with TemporaryDirectory() as folder:
    ...     certify(foes, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), [3, 5]).save(f"{folder}/c.json")
    ...     page = report_html(read_certificate(f"{folder}/c.json"))
    >>> "<h1>Bipartite consensus at T = 1</h1>" in page, "<bdi>&lt;b&gt;</bdi>" in page, "<b>" in page
    (True, True, False)
    """
    return _Page(saved, no_run).html()


class _Page:
    """The sections of one page."""

    def __init__(self, saved: SavedCertificate, no_run: str):
        self.saved, self.no_run = saved, no_run
        self.graph, self.structure, self.protocol = saved.graph, saved.structure, saved.protocol
        self.sliding = isinstance(saved.protocol, SlidingModeProtocol)
        self.deadline = "T_r + T_s" if self.sliding else "T"
        self.figures = _figures(saved, ("graph", "decay", "sliding", "input"))

    def html(self) -> str:
        sections = [
            ("asked", "What was asked", self.asked()),
            ("proved", "What was proved", self.proved()),
            ("graph", "The graph", self.drawn()),
            ("bound", "The bound over a simulated run", self.decay()),
            ("effort", "The input", self.effort()),
            ("obligations", "Every obligation of the proof", self.obligations()),
            ("check", "How to check it", self.check()),
            ("limits", "What this does not say", self.limits()),
            ("cite", "How to cite", self.cite()),
        ]
        links = _list(f'<a href="#{key}">{name}</a>' for key, name, _ in sections)
        body = [f"<h1>{_subscripts(self.title())}</h1>", self.verdict(), f'<nav aria-label="Contents">{links}</nav>']
        body += [
            f'<section aria-labelledby="{key}"><h2 id="{key}">{name}</h2>\n{text}\n</section>'
            for key, name, text in sections
        ]
        return _page(self.title().replace("<sup>", "^").replace("</sup>", ""), "\n".join(body))

    # ------------------------------------------------------------------ title, verdict, question

    def title(self) -> str:
        """Say what the certificate is about."""
        claims = self.saved.claims
        said = claims[0].behaviour if len(claims) == 1 else f"{len(claims):,} components settle"
        said = f"{said} at {self.deadline} = {_exact(self.protocol.T)}".replace("= \u2248", "\u2248")
        if self.saved.constant:
            said = f"every agent keeps {self.kept()}"
        return f"{said[0].upper()}{said[1:]}" if self.saved.verdict == "certified" else f"Undecided: {said}"

    def kept(self) -> str:
        """Say what does not change where no agent listens to another."""
        return "its state" if self.saved.direct else "x \u2212 \u03c3"

    def verdict(self) -> str:
        report = self.saved.report
        count = f"{len(report.steps)} obligation(s) in exact arithmetic ({_text(report.arithmetic)})"
        if self.saved.verdict == "certified":
            said = f"The independent check verified {count}, without a solver. What follows from them is proved."
            return _verdict("good", "\u2714", "CERTIFIED", said)
        missing = self.missing()
        said = f"The independent check verified {count}; what these state is proved. But {missing}."
        return _verdict("doubt", "?", "UNDECIDED", said)

    def missing(self) -> str:
        """Say what keeps a certificate from being certified."""
        lacks = ["no decay was proved"] if self.saved.rate is None and not self.saved.constant else []
        lacks += ["no final state was proved"] if self.saved.document["outcome"] is None else []
        return " and ".join(lacks) or "not everything was proved"

    def asked(self) -> str:
        graph, saved = self.graph, self.saved
        negative = int((graph.sign < 0).sum())
        orientation = {
            "information": "a row a, b: information flows from a to b, and b listens",
            "listens": "a row a, b: a listens to b",
            "matrix": "rows of the matrix are listeners",
        }[graph.read["orientation"]]
        rows = [
            ("Graph", f"{_count(graph.n_nodes, 'agent')}, {_count(graph.n_edges, 'edge')}, {negative:,} negative"),
            ("Read as", _text("; ".join([orientation, *remarks_on(self.structure)]))),
            ("Structure", _text(structure_text(self.structure))),
            ("Start", "given, below" if saved.start is not None else "none: the claims are for every start"),
        ]
        effort = saved.effort
        if effort is not None and effort.starts is not None:
            R = _common_bound(effort.starts)
            shape = "an ellipsoid" if effort.starts.axes else "a box"
            which = (
                f"{shape} of starts, which the file names"
                if R is None
                else f"all |x<sub>k</sub>(0)| \u2264 {_exact(R)}"
            )
            rows.append(("Starts", f"bounds of the input are for {which}"))
        rows += [("Limits of the gain", _limits_text(entry)) for entry in (effort.residual if effort else ())]
        if effort is not None and effort.disturbed is not None:
            rows.append(("Disturbances", f"|d<sub>k</sub>| \u2264 {_exact(effort.disturbed.delta)} under the protocol"))
        given = [(_symbol(name), _exact(getattr(self.protocol, name))) for name in _parameters(self.protocol)]
        kind = "Sliding-mode protocol" if self.sliding else "Nominal protocol"
        return "\n".join(
            [
                _table("The question", ("What", "As given"), rows),
                f"<h3>{kind}</h3>",
                f"<p>{self.protocol_words()}</p>",
                '<div class="equations" tabindex="0" role="group" aria-label="Equations">'
                f"{_mathml(self.protocol)}</div>",
                _table("Parameters, exact", ("Parameter", "Value"), given),
            ]
        )

    def protocol_words(self) -> str:
        if not self.sliding:
            return (
                "Agent k has the state x<sub>k</sub> and moves by x<sub>k</sub>\u2032 = u<sub>k</sub>. Its input is "
                "the gain g times what it hears: the sum over those it listens to, l, of w<sub>kl</sub> (x<sub>l</sub> "
                "\u2212 sign(w<sub>kl</sub>) x<sub>k</sub>). The gain grows without limit at the deadline T."
            )
        return (
            "Agent k moves by x<sub>k</sub>\u2032 = u<sub>k</sub> + d<sub>k</sub> under any disturbance with "
            f"|d<sub>k</sub>| \u2264 \u03b4 = {_exact(self.protocol.delta)}. The sliding part of its input "  # type: ignore[union-attr]
            "drives the sliding variable \u03c3<sub>k</sub> to 0 by T<sub>r</sub>; from then on no disturbance is "
            "felt, and the nominal part settles the agents at T<sub>r</sub> + T<sub>s</sub>."
        )

    # ------------------------------------------------------------------ what was proved

    def proved(self) -> str:
        saved = self.saved
        parts = [self.claims(), self.states(), self.rates(), self.left()]
        if self.sliding and not saved.direct:
            parts.append(self.reaching())
        return "\n".join(part for part in parts if part)

    def claims(self) -> str:
        statements = {theorem.number: theorem.statement for theorem in THEOREMS}
        counted = Counter(self.saved.claims)
        said = []
        for claim, count in sorted(counted.items(), key=lambda item: item[0].theorem):
            whole = f"{_count(count, 'component')}: " if len(self.saved.claims) > 1 else ""
            statement = _subscripts(_text(statements[claim.theorem]))
            doubt = "" if self.saved.verdict == "certified" else "not certified: "
            claimed = f"{whole}{doubt}<strong>{_claim_text(claim)}</strong>"
            said.append(f"{claimed}. Theorem {claim.theorem}: <q>{statement}</q>")
        told = ""
        if self.saved.verdict != "certified":
            told = "<p>Verified are the hypotheses of the theorem, and what follows here.</p>"
        elif self.sliding:
            told = "<p>This holds whatever the disturbances within \u03b4.</p>"
        degenerate = ""
        if self.saved.degenerate:
            groups = _labels(list(map(str, self.saved.degenerate)))
            degenerate = f"<p>From this start leader group {groups} meets at 0, although it is balanced.</p>"
        return f"<h3>Behaviour at the deadline</h3>{_list(said)}{told}{degenerate}"

    def states(self) -> str:
        """Return the table of starts and final states."""
        saved, n = self.saved, self.graph.n_nodes
        if saved.start is None:
            return ""
        head, parts = ["Agent", "Part", "Start"], _parts(saved)
        if self.sliding and not saved.direct:
            head.append("\u03c3(0)")
        if saved.final_state is not None:
            head.append("State at the deadline")
        rows = []
        for k in range(min(n, ROWS)):
            row = [_label(self.graph.labels[k]), parts[k], _exact(saved.start[k])]
            if self.sliding and not saved.direct:
                row.append(_exact((saved.sigma0 or ())[k]))
            if saved.final_state is not None:
                row.append(_enclosed(saved.final_state[k]))
            rows.append(row)
        exact = saved.final_state is not None and not any(radius for _, radius in saved.final_state)
        how = "" if saved.final_state is None else ", proved exactly" if exact else ", proved in intervals"
        more = f'<p class="note">The first {ROWS} of {n:,} agents; the file has all.</p>' if n > ROWS else ""
        if self.sliding and not saved.direct:
            more += "<p>The agents end at Q (X(0) \u2212 \u03c3(0)), whatever the disturbance.</p>"
        caption = "Where the agents begin" if saved.final_state is None else "Where the agents end"
        return _folded(f"{caption}{how}", _table(f"{caption}{how}", head, rows, stack=len(head) > 4), len(rows)) + more

    def rates(self) -> str:
        saved = self.saved
        if saved.constant:
            return f"<p>No agent listens to another: each keeps {self.kept()}, and there is nothing to decay.</p>"
        if saved.rate is None:
            return "<p>No rate of decay was proved.</p>"
        limit, rows = saved.rate_limit, []
        rows.append(("Proved rate", f"{_below(saved.rate)} per unit of the stretched clock s, rounded down"))
        if limit is not None:
            rows.append(("No rate exceeds", f"{_above(limit, 8)}, proved, rounded up"))
            rows.append(("Tightness", f"at least {_below(saved.rate / limit, 4)} (proved rate over that limit)"))
        if saved.prefactor is not None:
            rows.append(("Prefactor at that rate", f"{_above(saved.prefactor, 4)} of the squared norm"))
        if saved.paper_rate is not None and saved.lyapunov is not None:
            formula = _text(saved.lyapunov.objective)
            rows.append(("The article's own rate", f"{_below(saved.paper_rate)} = {formula}"))
        rows.append(("Lyapunov functions", _kinds(saved)))
        clock = "s(t) = \u03c1<sub>1</sub> t + \u03c1<sub>2</sub> \u03ba ln(T/(T \u2212 t))"
        whole = ", T = T<sub>r</sub> + T<sub>s</sub>" if self.sliding else ""
        decay = "V(t) \u2264 e<sup>\u2212rate s(t)</sup> V(0)"
        if self.sliding and not saved.direct:
            since = "s(t) \u2212 s(T<sub>r</sub>)"
            decay = f"V(t) \u2264 e<sup>\u2212rate ({since})</sup> V(T<sub>r</sub>) from T<sub>r</sub> on"
        words = (
            f"<p>Each Lyapunov function V = z\u2032Pz of the file obeys {decay}, with a rate of its own, on the "
            f"stretched clock {clock}{whole}, which grows without limit towards the deadline. z is the error E = "
            "\u2212L X, L the signed Laplacian, or the deviation \u03b5 of X from its weighted signed mean.</p>"
        )
        if self.sliding and not saved.direct:
            words += "<p>Until T<sub>r</sub> the sliding variables drive the agents too.</p>"
        return "<h3>Rate of decay</h3>" + words + _table("Rates", ("Quantity", "Value"), rows)

    def left(self) -> str:
        """Return what may be left at some instants, rounded up."""
        saved = self.saved
        if not saved.envelope.members or saved.rate is None:
            return ""
        z, T = _coordinates(saved), self.protocol.T
        instants = [(Fraction(str(f)), f"{f} T") for f in FRACTIONS]
        if saved.direct:
            head = ["Instant", f"\u2016{z}(t)\u2016 / \u2016{z}(0)\u2016 at most"]
            bounds = [saved.envelope.residual(float(1 - f)) for f, _ in instants]
        elif saved.start is None:
            return ""
        else:
            share = Fraction(self.protocol.T_r, 1) / T  # type: ignore[union-attr]
            instants = [(share, "T<sub>r</sub>"), *(pair for pair in instants if pair[0] > share)]
            head = ["Instant", f"\u2016{z}(t)\u2016 at most (numerical, rounded up)"]
            bounds = saved.norm_bound([float(1 - f) for f, _ in instants]).tolist()
        columns = [[_above(x, 2) for x in bounds]]
        if saved.start is not None and any(m.distance is not None for m in saved.envelope.members):
            head.append("Distance of any agent to its outcome at most")
            worst = saved.outcome_distance([float(1 - f) for f, _ in instants]).max(axis=0)
            columns.append([_above(float(x), 2) for x in worst])
        rows = [(name, *cells) for (_, name), *cells in zip(instants, *columns, strict=True)]
        whole = ", T = T<sub>r</sub> + T<sub>s</sub>" if self.sliding else ""
        return "<h3>What may be left before the deadline</h3>" + _table(f"Bounds, rounded up{whole}", head, rows)

    def reaching(self) -> str:
        """Return when each sliding variable is proved to be 0."""
        saved, rows = self.saved, []
        for label, sigma, r in list(zip(self.graph.labels, saved.sigma0 or (), saved.reaching or (), strict=True))[
            :ROWS
        ]:
            when, before = "T_r only", "0"
            if r.z is not None:
                when = "0, it starts there" if not sigma else f"{up(r.time, 6)}" if r.time else "0"
                before = _below(r.remaining, 3) if r.remaining else "nearer than a float tells"
            rows.append((_label(label), _exact(sigma), when, before))
        head = ("Agent", "\u03c3(0)", "\u03c3 = 0 proved from t =", "That is before T<sub>r</sub> by")
        n = self.graph.n_nodes
        more = f'<p class="note">The first {ROWS} of {n:,} agents.</p>' if n > ROWS else ""
        figure = ""
        if "sliding" in self.figures and saved.comparison is not None:
            kept = "reached 0 no later than proved" if saved.comparison.reaching_kept else "reached 0 LATER than proved"
            caption = (
                f"Sliding variables of a repeated run under the disturbance {_text(self.met())} (numerical): all "
                f"{kept}. Ticks: the proved reaching times, for every disturbance within \u03b4. Dotted: T<sub>r</sub>."
            )
            figure = _figure(self.figures["sliding"], "sliding", caption)
        table = _folded("Reaching times of all agents", _table("Whatever the disturbance", head, rows), len(rows))
        return "<h3>Reaching times</h3>" + table + more + figure

    def met(self) -> str:
        """Say which disturbance a repeated run meets."""
        run = self.saved.trajectory
        return f"d = {run.source}" if isinstance(run, SlidingTrajectory) else "none"

    # ------------------------------------------------------------------ graph, run, input

    def drawn(self) -> str:
        structure, labels = self.structure, self.graph.labels
        figure = ""
        if "graph" in self.figures:
            groups = _count(len(structure.closed_components), "group")
            camps = Counter(part.partition(", ")[2] for part in _parts(self.saved))
            said = ", ".join(f"{camps[name]} in {name}" for name in ("camp 1", "camp 2") if camps[name])
            said += f"{', ' if said else ''}{camps['unbalanced']} unbalanced" if camps["unbalanced"] else ""
            caption = (
                f"{_count(self.graph.n_nodes, 'agent')}, {_count(self.graph.n_edges, 'edge')}; leaders in {groups}, "
                f"{said}; {_count(structure.followers.size, 'follower')}. Arrows point to who listens, solid from "
                "allies, dashed from opponents."
            )
            figure = _figure(self.figures["graph"], "graph", caption)
        else:
            figure = (
                f'<p class="note">Graphs are drawn up to {DRAWN_NODES} nodes; this one has {self.graph.n_nodes:,}.</p>'
            )
        rows = [
            (f"{k}", _labels([labels[v] for v in c.nodes]), _balance(c, labels))
            for k, c in enumerate(structure.closed_components[:GROUPS], start=1)
        ]
        count = len(structure.closed_components)
        more = f'<p class="note">The first {GROUPS} of {count:,} groups.</p>' if count > GROUPS else ""
        followers = [labels[v] for v in structure.followers.tolist()[: LISTED + 1]]
        said = _labels(followers) if structure.followers.size <= LISTED else f"{structure.followers.size:,} agents"
        words = f"<p>Followers: {said}.</p>" if structure.followers.size else "<p>There are no followers.</p>"
        head = ("Group", "Leaders", "Camps")
        return figure + _table("Leader groups: who listens to nobody outside", head, rows, stack=True) + more + words

    def decay(self) -> str:
        saved = self.saved
        if saved.trajectory is None:
            return f"<p>There is no simulated run here: {_text(self.no_run)}. The proved bounds do not need one.</p>"
        told = [
            "<p>The run was repeated for this page with CVODES, from the start of the certificate"
            + (f", under the disturbance <code>{_text(self.met())}</code>" if self.sliding else "")
            + (", without limits of the gain and without noise" if saved.effort and saved.effort.residual else "")
            + ". It is <strong>numerical</strong>: it corroborates the bounds and proves nothing.</p>"
        ]
        seen = saved.comparison
        if "decay" in self.figures and seen is not None:
            z = _coordinates(saved)
            word = "VIOLATED" if seen.violated else "kept" if seen.judged else "not tested: all is below the floor"
            until = (
                f"down to 1 \u2212 t/T = {_power(f'{seen.resolved_until:.1e}')}"
                if seen.resolved_until
                else "throughout"
            )
            caption = (
                f"Proved bounds of \u2016{z}(t)\u2016 over a simulated run, against the time left. The bound is "
                f"{word}: the largest ratio of run to bound is {seen.worst_ratio:.4g}, resolved {until}."
            )
            told.append(_figure(self.figures["decay"], "decay", caption))
        if saved.final_state is not None:
            gap = max(
                abs(float(x) - nearest_float(m))
                for x, (m, _) in zip(saved.trajectory.final_state.tolist(), saved.final_state, strict=True)
            )
            settled = "" if saved.trajectory.deadline_resolved else " (it had not settled)"
            told.append(f"<p>It ends within {_above(Fraction(gap), 2)} of the proved final state{settled}.</p>")
        return "\n".join(told)

    def effort(self) -> str:
        saved, effort = self.saved, self.saved.effort
        if saved.constant:
            return "<p>No agent listens to another: the nominal input is 0.</p>"
        if effort is None:
            return "<p>Nothing is proved about the input, since no decay was proved.</p>"
        lower, upper = effort.threshold
        product = "\u03c1<sub>2</sub> \u03ba min Re \u03bb"
        if effort.bounded:
            said = "<strong>Bounded</strong> up to the deadline, from every start."
        elif effort.bounded is False:
            said = (
                "<strong>NOT BOUNDED</strong>: the state converges, but from some starts the input grows without limit "
                "towards the deadline."
            )
        else:
            said = "Whether it stays bounded up to the deadline is <strong>undecided</strong>."
        part = "The nominal part of the input" if self.sliding else "The input"
        ends = [f"at least {_below(lower, 5)}"] if lower is not None else []
        ends += [f"at most {_above(upper, 5)}"] if upper is not None else []
        rows = [(f"Threshold {product}", f"{' and '.join(ends) or 'not bounded by a proof'}; bounded from 1 on")]
        if effort.by is not None:
            how = {"rate": "the proved rate", "limit": "the proved limit of rates", "spectrum": "the exact spectrum"}
            rows.append(("Decided by", how[effort.by]))
        if effort.bounded is False and saved.rate is not None:
            rows.append(("What mends it", f"raise \u03c1<sub>2</sub> \u03ba to {_above(2 / saved.rate, 5)} or more"))
        whom = "from all of these starts" if effort.starts is not None else "from this start"
        whom = f"of the whole input {whom}" if self.sliding else whom
        if effort.peak is not None:
            most = max(range(len(effort.peak.agents)), key=effort.peak.agents.__getitem__)
            label = _label(self.graph.labels[most])
            rows.append((f"Peak {whom}", f"|u<sub>k</sub>| \u2264 {_above(effort.peak.largest)} (agent {label})"))
            rows.append(("Peak of the norm", f"\u2016u\u2016 \u2264 {_above(effort.peak.norm)}"))
        nominal = " of the nominal part" if self.sliding else ""
        if effort.energy is not None:
            rows.append((f"Energy{nominal}", f"\u222b \u2016u\u2016\u00b2 dt \u2264 {_above(effort.energy.value)}"))
        if effort.path_length is not None:
            rows.append((f"Path length{nominal}", f"\u222b \u2016u\u2016 dt \u2264 {_above(effort.path_length.value)}"))
        if effort.sliding is not None and not effort.sliding.bounded:
            rows.append(("Sliding part", "\u03bc<sub>3</sub> \u03ba &lt; 1: not bounded for every \u03c3(0)"))
        rows += [(f"With {_limits_text(entry)}", _limited_text(entry)) for entry in effort.residual]
        if effort.disturbed is not None:
            d = effort.disturbed
            drift = "" if d.drift is None else f"; agents end within {_above(max(d.drift))} of their outcome"
            rows.append(
                (
                    f"Disturbances |d<sub>k</sub>| \u2264 {_exact(d.delta)}",
                    f"add at most {_above(max(d.inputs))} to |u<sub>k</sub>|{drift}",
                )
            )
        figure = ""
        if "input" in self.figures and saved.trajectory is not None:
            largest = float(abs(saved.trajectory.input).max())
            line = ""
            if effort.peak is not None and effort.starts is None:
                line = f" Dashed: the certified peak {_above(effort.peak.largest)}."
            caption = (
                f"Inputs |u<sub>k</sub>(t)| of the repeated run (numerical), up to {_power(f'{largest:.4g}')} at its "
                f"samples.{line}"
            )
            figure = _figure(self.figures["input"], "input", caption)
        return f"<p>{part}: {said}</p>" + _table("Proved bounds, rounded up", ("Quantity", "Bound"), rows) + figure

    # ------------------------------------------------------------------ proof, check, limits, citation

    def obligations(self) -> str:
        steps = self.saved.report.steps
        rows = [
            (
                f"{number}",
                f"{_text(s.kind)} of <code>{_text(s.of)}</code>",
                _text(s.statement),
                _text(s.lemma),
                _text(s.detail),
            )
            for number, s in enumerate(steps, start=1)
        ]
        head = ("No.", "Obligation", "States", "By", "Verified")
        table = _table("Verified by the independent check, in exact arithmetic", head, rows, stack=True)
        return _folded(f"{_count(len(steps), 'obligation')}, all verified", table, len(steps))

    def check(self) -> str:
        saved, name = self.saved, shlex.quote(self.saved.path.name)
        rows = [
            ("SHA-256 of the file", f"<code>{saved.sha256}</code>"),
            ("SHA-256 of the graph", f"<code>{_text(saved.report.sha256)}</code>"),
            ("Digest of the claims", f"<code>{_text(saved.document['digest'])}</code>"),
            ("Written by", _text(saved.document["producer"], 200)),
        ]
        commands = [f"ptcc check {name} YOUR_GRAPH.csv", f"python -m ptcc_certify.checker {name} --stdlib"]
        return (
            "<p>The page is made from the certificate's file and proves nothing by itself; the file does. The first "
            "command checks it, and that it speaks of your graph; the second needs Python alone. The format is "
            "specified in <code>ptcc_certify/checker/FORMAT.md</code>, for a checker of your own.</p>"
            f"<pre>{html.escape(chr(10).join(_clean(c, 300) for c in commands))}</pre>"
            + _table("What to compare", ("What", "Value"), rows, stack=True)
        )

    def limits(self) -> str:
        return _list(_caveats(self.saved, self.no_run))

    def cite(self) -> str:
        theorems = sorted({claim.theorem for claim in self.saved.claims})
        which = f"Theorem{'s' * (len(theorems) > 1)} {', '.join(theorems)}"
        return (
            f"<p>{which} of: {AUTHORS}. <cite>{TITLE}</cite>. Manuscript.</p><p>BibTeX: <code>ptcc cite "
            f"{theorems[0]}</code>. The program: {_text(self.saved.document['producer'], 200)}; its "
            "<code>CITATION.cff</code> says how to cite it.</p>"
        )


# ---------------------------------------------------------------------- words


def _claim_text(claim: Claim) -> str:
    special = f", {', '.join(claim.special)}" if claim.special else ""
    number = "Corollary" if len(claim.corollaries) == 1 else "Corollaries"
    by = f" ({number} {', '.join(claim.corollaries)})" if claim.corollaries else ""
    return f"{claim.behaviour.capitalize()}{special}{by}"


def _parts(saved: SavedCertificate) -> list[str]:
    """Say of every agent which part of the graph it is in."""
    parts = ["follower"] * saved.graph.n_nodes
    groups = saved.structure.closed_components
    for k, component in enumerate(groups, start=1):
        name = f"leader of group {k}" if len(groups) > 1 else "leader"
        for v, sign in zip(component.nodes, component.gauge or [0] * len(component.nodes), strict=True):
            parts[v] = name + {1: ", camp 1", -1: ", camp 2", 0: ", unbalanced"}[sign]
    return parts


def _balance(component: ClosedComponent, labels: Sequence[str]) -> str:
    """Say how a leader group splits, or why it does not."""
    if component.negative_cycle is not None:
        cycle = component.negative_cycle[:LISTED]
        steps = ", ".join(f"{_label(labels[s])} \u2192 {_label(labels[t])}" for s, t in cycle)
        return f"unbalanced; negative cycle {steps}{', ...' if len(component.negative_cycle) > LISTED else ''}"
    camps = [
        [labels[v] for v, g in zip(component.nodes, component.gauge or (), strict=True) if g == sign]
        for sign in (1, -1)
    ]
    said = " against ".join(f"{{{_labels(camp)}}}" for camp in camps if camp)
    return f"balanced; {'camps' if camps[1] else 'one camp'} {said}"


def _kinds(saved: SavedCertificate) -> str:
    names = {"paper": "the article's", "perron": "Perron vectors", "lmi": "best diagonal", "full": "full matrices"}
    counted = Counter(m.kind for m in saved.envelope.members)
    return ", ".join(f"{count} {names[kind]}" for kind, count in counted.items())


def _common_bound(starts: Starts) -> Fraction | None:
    """Return ``R`` of a set that is all starts with ``|x_k(0)| <= R``; None of another one."""
    same = len(set(starts.radius)) == 1 and not any(starts.center) and not starts.axes
    return starts.radius[0] if same else None


def _limits_text(entry: Any) -> str:
    limits = entry.limits
    said = [f"gain \u2264 {_exact(limits.gain_cap)}"] if limits.gain_cap is not None else []
    said += [f"input 0 from T \u2212 {_exact(limits.stop_before)} on"] if limits.stop_before is not None else []
    said += [f"input held for {_exact(limits.sample_period)}"] if limits.sample_period is not None else []
    return ", ".join(said)


def _limited_text(entry: Any) -> str:
    said = [f"\u2016E(T)\u2016 \u2264 {_above(entry.norm, 3)}"]
    said += [f"every agent within {_above(max(entry.agents), 3)} of its outcome"] if entry.agents is not None else []
    said += [f"|u<sub>k</sub>| \u2264 {_above(entry.largest)}"] if entry.largest is not None else []
    if entry.noise is not None:
        said.append(
            f"with noise |n<sub>k</sub>| \u2264 {_exact(entry.noise)}: "
            f"\u2016E(T)\u2016 \u2264 {_above(entry.noisy_norm, 3)}, "
            f"|u<sub>k</sub>| \u2264 {_above(entry.noisy_largest)}"
        )
    return "; ".join(said)


def _caveats(saved: SavedCertificate, no_run: str) -> list[str]:
    """Say what a reader might take for proved and is not, for this certificate."""
    effort, sliding = saved.effort, isinstance(saved.protocol, SlidingModeProtocol)
    residual = () if effort is None else effort.residual
    said = []
    if saved.verdict != "certified":
        notes = saved.document["unverified"].get("notes")
        own = [_text(note, 300) for note in notes[:5] if isinstance(note, str)] if isinstance(notes, list) else []
        word = f" The file remarks, unverified: {'; '.join(own)}." if own else ""
        said.append(f"The certificate is undecided: that the agents behave so by the deadline is not certified.{word}")
    said.append(
        "The model: agents are single integrators, weights are exact and constant, every agent knows the states it "
        "listens to without delay" + ("." if any(e.noise for e in residual) else " and without noise.")
    )
    if any(e.limits.sample_period for e in residual):
        said.append("Sampling is certified with the periods named above, and with no others.")
    else:
        said.append("Continuous time: nothing is said of an input that is sampled and held.")
    if not saved.constant:
        gain = "The gain is infinite at the deadline. No device follows it to the end; "
        said.append(
            gain + ("what the limits named above leave is proved." if residual else "what a cap leaves was not asked.")
        )
    if sliding:
        said.append(
            "Disturbances must stay within \u03b4, and \u03b4 must be known. The sign in the input is ideal: a device "
            "that switches with a delay chatters, and what that does is not said."
        )
    elif effort is None or effort.disturbed is None:
        said.append("There are no disturbances in the model, and nothing is said of what they would do.")
    if saved.start is None:
        said.append("No start was given: there is no final state, and no bound of the input in numbers.")
    elif effort is not None and effort.starts is not None:
        said.append("Bounds of the input are for the set of starts, the final state for the one start alone.")
    elif not saved.constant:
        said.append("Final state and bounds in numbers are for this start; behaviour and rate are for every start.")
    if effort is not None and not saved.constant:
        if effort.bounded is False:
            said.append("The input is not bounded: the deadline is met in the model, and by no actuator with a limit.")
        elif effort.bounded is None:
            said.append("Whether the input stays bounded is not decided.")
        elif effort.peak is None and saved.start is not None:
            said.append("The input stays bounded, but by which number is not proved.")
    if saved.final_state is not None and any(radius for _, radius in saved.final_state):
        said.append("The final state is proved to lie in the intervals, and no nearer.")
    if saved.rate is not None and saved.rate_limit is None:
        said.append("No limit of rates is proved: a faster certificate may exist.")
    if len(saved.claims) > 1:
        said.append(
            "The article leaves disconnected graphs out; components are treated one by one, by the same proofs."
        )
    if saved.trajectory is None:
        said.append(f"No run was simulated for this page: {_text(no_run)}.")
    else:
        said.append("Simulated curves and everything called numerical are floating point, and no part of the proof.")
    said.append(
        "The theorems are those of the article: verified are their hypotheses, and the inequalities and numbers "
        "listed. The SHA-256 values show that a file was not changed; they are no signature. "
        "Whether the graph is the one you mean, only you can tell."
    )
    return said


# ---------------------------------------------------------------------- equations


def _parameters(protocol: Protocol) -> list[str]:
    return [name for name in protocol.to_dict() if name != "kind"]


def _symbol(name: str) -> str:
    """Return a parameter's letter with its index."""
    match = re.fullmatch(r"([A-Za-z]+?)_?([0-9rs]?)", name)
    letters, index = (match[1], match[2]) if match else (name, "")
    return _SIGNS.get(letters, letters) + (f"<sub>{index}</sub>" if index else "")


_SIGNS = {
    "rho": "\u03c1",
    "kappa": "\u03ba",
    "mu": "\u03bc",
    "sigma": "\u03c3",
    "varsigma": "\u03c2",
    "delta": "\u03b4",
}
_OPERATORS = {"cdot": "\u22c5", "le": "\u2264", "ge": "\u2265", "ne": "\u2260", "infty": "\u221e", "-": "\u2212"}
_TOKEN = re.compile(r"\\begin\{\w+\}|\\end\{\w+\}|\\\\|\\[A-Za-z]+|[0-9]+(?:\.[0-9]+)?|[^\s]")


def _mathml(protocol: Protocol) -> str:
    """Return the equations of a protocol in MathML, translated from the LaTeX that is printed from its expressions."""
    source = protocol.latex()
    tokens = _TOKEN.findall(source)[::-1]
    inner = _math_row(tokens, ())
    return f'<math display="block" alttext="{html.escape(" ".join(source.split()), quote=True)}">{inner}</math>'


def _math_row(tokens: list[str], ends: Sequence[str]) -> str:
    """Translate tokens up to one of ``ends``, which is left; scripts bind to what stands before them."""
    pieces: list[str] = []
    while tokens and tokens[-1] not in ends:
        if tokens[-1] in ("_", "^"):
            scripts = {}
            while tokens and tokens[-1] in ("_", "^"):
                mark = tokens.pop()
                scripts[mark] = _math_atom(tokens)
            base = pieces.pop()
            kind = "under" if base == "<mo>\u2211</mo>" else "sub"
            tag = {"_": f"m{kind}", "^": "mover" if kind == "under" else "msup"}
            whole = f"m{kind}{'over' if kind == 'under' else 'sup'}" if len(scripts) == 2 else tag[next(iter(scripts))]
            ordered = "".join(scripts[key] for key in ("_", "^") if key in scripts)
            pieces.append(f"<{whole}>{base}{ordered}</{whole}>")
        else:
            pieces.append(_math_atom(tokens))
    return f"<mrow>{''.join(pieces)}</mrow>"


def _math_atom(tokens: list[str]) -> str:
    token = tokens.pop()
    name = token.lstrip("\\")
    if token == "{":
        row = _math_row(tokens, ("}",))
        tokens.pop()
        return row
    if token.startswith("\\begin"):
        return _math_table(tokens, token[7:-1])
    if token == "\\frac":
        return f"<mfrac>{_math_atom(tokens)}{_math_atom(tokens)}</mfrac>"
    if token == "\\left":
        first, inner = tokens.pop(), _math_row(tokens, ("\\right",))
        tokens.pop()
        return f"<mrow><mo>{first}</mo>{inner}<mo>{tokens.pop()}</mo></mrow>"
    if token in ("\\operatorname", "\\mathrm", "\\text"):
        tokens.pop()
        letters = ""
        while tokens[-1] != "}":
            letters += tokens.pop()
        tokens.pop()
        return f'<mi mathvariant="normal">{letters}</mi>'
    if token == "\\dot":
        return f"<mover>{_math_atom(tokens)}<mo>\u02d9</mo></mover>"
    if token == "\\sum":
        return "<mo>\u2211</mo>"
    if token == "\\quad":
        return '<mspace width="1em"></mspace>'
    if name in _SIGNS:
        return f"<mi>{_SIGNS[name]}</mi>"
    if name in _OPERATORS:
        return f"<mo>{_OPERATORS[name]}</mo>"
    if token[0].isdigit():
        return f"<mn>{token}</mn>"
    return f"<mi>{token}</mi>" if token.isalpha() else f"<mo>{html.escape(token)}</mo>"


def _math_table(tokens: list[str], kind: str) -> str:
    rows: list[list[str]] = [[]]
    while tokens[-1] != f"\\end{{{kind}}}":
        rows[-1].append(_math_row(tokens, ("&", "\\\\", f"\\end{{{kind}}}")))
        if tokens[-1] == "\\\\":
            rows.append([])
        if tokens[-1] in ("&", "\\\\"):
            tokens.pop()
    tokens.pop()
    sides = ("right", "left") if kind == "aligned" else ("left", "left")
    cells = "".join(
        "<mtr>"
        + "".join(f'<mtd style="text-align:{side}">{cell}</mtd>' for side, cell in zip(sides, row, strict=False))
        + "</mtr>"
        for row in rows
    )
    table = f'<mtable displaystyle="true">{cells}</mtable>'
    return table if kind == "aligned" else f'<mrow><mo stretchy="true">{{</mo>{table}</mrow>'


# ---------------------------------------------------------------------- LaTeX


def report_latex(saved: SavedCertificate, figures: dict[str, str] | None = None) -> str:
    r"""Return a certificate as a statement in LaTeX, to be read by ``\input``; it needs amsmath and graphicx.

    Parameters
    ----------
    saved : SavedCertificate
    figures : mapping of {"graph", "decay"} to str, optional
        Names of the files that are included.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> from ptcc_certify import NominalProtocol, SignedDigraph, certify
    >>> foes = SignedDigraph.from_edges([("a_1", "b", -1), ("b", "a_1", -1)])
    >>> with TemporaryDirectory() as folder:
    ...     certify(foes, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), [3, 5]).save(f"{folder}/c.json")
    ...     text = report_latex(read_certificate(f"{folder}/c.json"))
    >>> print(next(line for line in text.splitlines() if line.startswith("a")))
    a\_1 & leader, camp 1 & $3$ & $-1$ \\
    """
    p, graph = saved.protocol, saved.graph
    sliding = isinstance(p, SlidingModeProtocol)
    T = "T_{r} + T_{s}" if sliding else "T"
    given = ", ".join(f"${_tex_symbol(name)} = {_tex_exact(getattr(p, name))}$" for name in _parameters(p))
    given = given.replace(r"= \approx", r"\approx")
    parts = [
        f"% A statement that ptcc report made from a certificate: {_tex_comment(saved.path.name)}",
        f"% SHA-256 of the file {saved.sha256}, of the graph {saved.report.sha256}",
        r"% For \input in a document with \usepackage{amsmath,graphicx}.",
        r"\begin{trivlist}",
        rf"\item[\hskip\labelsep\textbf{{{_tex_head(saved)}}}]",
        f"Let ${graph.n_nodes}$ agents be connected by a signed digraph of ${graph.n_edges}$ edges, of which "
        f"${int((graph.sign < 0).sum())}$ are negative ({_tex(structure_text(saved.structure))}), and let agent $k$ "
        + (
            r"move by $\dot x_{k} = u_{k} + d_{k}$ with $|d_{k}| \le \delta$"
            if sliding
            else r"move by $\dot x_{k} = u_{k}$"
        ),
        r"under the protocol",
        r"\begin{equation*}",
        p.latex(),
        r"\end{equation*}",
        f"with {given}.",
        *_tex_claims(saved, T),
        *_tex_decay(saved, T),
        *_tex_input(saved),
        *_tex_limits(saved),
        r"\end{trivlist}",
        *_tex_states(saved),
        *_tex_figures(saved, figures or {}),
        *_tex_source(saved),
    ]
    return "\n".join(parts) + "\n"


def _tex_head(saved: SavedCertificate) -> str:
    return (
        "Proposition (certified)." if saved.verdict == "certified" else "Verified statements (certificate undecided)."
    )


def _tex_claims(saved: SavedCertificate, T: str) -> list[str]:
    counted = sorted(Counter(saved.claims).items(), key=lambda item: item[0].theorem)
    if saved.constant:
        kept = "its state" if saved.direct else r"$x_{k} - \sigma_{k}$"
        return [f"No agent listens to another: each keeps {kept}."]
    sliding = isinstance(saved.protocol, SlidingModeProtocol)
    whatever = ", whatever the disturbances" if sliding else ""
    proved = saved.verdict == "certified"
    lines = []
    for claim, count in counted:
        whole = f"On {count} component(s) of the graph, " if len(saved.claims) > 1 else ""
        said = f"{claim.behaviour} occurs at ${T}${whatever}, by Theorem~{claim.theorem}"
        if not proved:
            said = f"the hypotheses of Theorem~{claim.theorem} ({claim.behaviour} at ${T}$) hold"
        lines.append(f"{(whole + said)[0].upper()}{(whole + said)[1:]}.")
    if saved.degenerate:
        lines.append(f"From the start below, leader group {', '.join(map(str, saved.degenerate))} meets at $0$.")
    return lines


def _tex_decay(saved: SavedCertificate, T: str) -> list[str]:
    if saved.rate is None or saved.prefactor is None:
        return []
    z = {"||E||^2": "E", "||eps||^2": r"\varepsilon"}[saved.document["prefactor"]["of"]]
    whole = f"({T})" if "+" in T else T
    rate, factor = _tex_power(down(saved.rate, 6)), _tex_power(up(saved.prefactor, 4))
    begin = "0" if saved.direct else "T_{r}"
    since = "s(t)" if saved.direct else f"(s(t) - s({begin}))"
    said = {
        "E": "$E = -L X$, $L$ being the signed Laplacian,",
        r"\varepsilon": r"the deviation $\varepsilon$ of $X$ from its weighted signed mean",
    }
    lines = [
        f"For every start and ${begin} \\le t < {T}$, {said[z]} obeys",
        r"\begin{gather*}",
        rf"\|{z}(t)\|^2 \le {factor}\, \mathrm{{e}}^{{-{rate}\, {since}}}\, \|{z}({begin})\|^2, \\",
        rf"s(t) = \rho_{{1}} t + \rho_{{2}} \kappa \ln\frac{{{T}}}{{{T} - t}}.",
        r"\end{gather*}",
    ]
    if saved.rate_limit is not None:
        lines.append(f"The rate of no Lyapunov function exceeds ${_tex_power(up(saved.rate_limit, 8))}$.")
    if saved.direct:
        left = ", ".join(
            f"${_tex_power(up(saved.envelope.residual(float(1 - Fraction(str(f)))), 2))}$ at $t = {f}\\,{whole}$"
            for f in FRACTIONS
        )
        name = "E" if saved.envelope.coordinates == "E" else r"\varepsilon"
        lines.append(rf"Of $\|{name}(0)\|$ at most the following share is left: {left}.")
    if not saved.direct and saved.reaching is not None:
        late = sum(r.z is None for r in saved.reaching)
        last = max((r.time for r in saved.reaching if r.z is not None), default=0.0)
        lines.append(
            f"Of the sliding variables ${len(saved.reaching) - late}$ are $0$ from $t = {_tex_power(up(last, 6))}$ "
            "on, and all from $T_{r}$ on."
        )
    return lines


def _tex_input(saved: SavedCertificate) -> list[str]:
    effort = saved.effort
    if effort is None or saved.constant or effort.bounded is None:
        return []
    part = "nominal part of the input" if isinstance(saved.protocol, SlidingModeProtocol) else "input"
    if not effort.bounded:
        return [f"The {part} is not bounded up to the deadline: from some starts it grows without limit."]
    lines = [f"The {part} stays bounded up to the deadline for every start."]
    if effort.peak is not None:
        whom = "from the start below"
        if effort.starts is not None:
            R = _common_bound(effort.starts)
            which = (
                "of the set that the certificate names" if R is None else rf"with $|x_{{k}}(0)| \le {_tex_exact(R)}$"
            )
            whom = f"from all starts {which}"
        largest, norm = (_tex_power(up(x, 4)) for x in (effort.peak.largest, effort.peak.norm))
        which = "It" if part == "input" else "The whole input"
        lines.append(rf"{which} satisfies $|u_{{k}}| \le {largest}$ for all $k$ and $\|u\| \le {norm}$, {whom}.")
    return lines


def _tex_limits(saved: SavedCertificate) -> list[str]:
    """Return what limits of the gain, noise and disturbances of the nominal protocol leave."""
    effort, lines = saved.effort, []
    for entry in () if effort is None else effort.residual:
        limits = entry.limits
        named = [rf"the gain is at most ${_tex_exact(limits.gain_cap)}$"] if limits.gain_cap is not None else []
        if limits.stop_before is not None:
            named.append(rf"the input is $0$ from $T - {_tex_exact(limits.stop_before)}$ on")
        if limits.sample_period is not None:
            named.append(rf"gain and input are held over periods of ${_tex_exact(limits.sample_period)}$")
        said = [rf"$\|E(T)\| \le {_tex_power(up(entry.norm, 3))}$"]
        if entry.agents is not None:
            said.append(f"every agent is within ${_tex_power(up(max(entry.agents), 3))}$ of its outcome at $T$")
        if entry.largest is not None:
            said.append(rf"$|u_{{k}}| \le {_tex_power(up(entry.largest, 4))}$")
        lines.append(f"If {' and '.join(named)}, then {', '.join(said)}.")
        if entry.noise is not None and entry.noisy_norm is not None and entry.noisy_largest is not None:
            norm, largest = _tex_power(up(entry.noisy_norm, 3)), _tex_power(up(entry.noisy_largest, 4))
            bound = _tex_exact(entry.noise)
            lines.append(rf"With noise $|n_{{k}}| \le {bound}$, $\|E(T)\| \le {norm}$ and $|u_{{k}}| \le {largest}$.")
    if effort is not None and effort.disturbed is not None:
        d = effort.disturbed
        ends = (
            "" if d.drift is None else f", and agents end within ${_tex_power(up(max(d.drift), 4))}$ of their outcome"
        )
        more = _tex_power(up(max(d.inputs), 4))
        lines.append(rf"Disturbances $|d_{{k}}| \le {_tex_exact(d.delta)}$ add at most ${more}$ to $|u_{{k}}|${ends}.")
    return lines


def _tex_states(saved: SavedCertificate) -> list[str]:
    if saved.start is None:
        return []
    parts, gone = _parts(saved), saved.sigma0 if not saved.direct else None
    heads = ["Agent", "Part", "$x_{k}(0)$"] + ([r"$\sigma_{k}(0)$"] if gone else [])
    heads += ["at the deadline"] if saved.final_state is not None else []
    rows = []
    for k, label in enumerate(saved.graph.labels[:LISTED]):
        row = [_tex(_clean(label, CHARACTERS // 2)), parts[k], f"${_tex_exact(saved.start[k])}$"]
        row += [f"${_tex_exact(gone[k])}$"] if gone else []
        row += [f"${_tex_interval(saved.final_state[k])}$"] if saved.final_state is not None else []
        rows.append(" & ".join(row) + r" \\")
    more = saved.graph.n_nodes - LISTED
    lines = [
        r"\begin{center}",
        rf"\begin{{tabular}}{{ll{'r' * (len(heads) - 2)}}}",
        r"\hline",
        " & ".join(heads) + r" \\",
        r"\hline",
        *rows,
        r"\hline",
        r"\end{tabular}",
        r"\end{center}",
    ]
    return lines + ([rf"\noindent The table leaves out ${more}$ more agents."] if more > 0 else [])


def _tex_figures(saved: SavedCertificate, figures: dict[str, str]) -> list[str]:
    captions = {
        "graph": "The signed digraph: arrows point to who listens, solid from allies, dashed from opponents.",
        "decay": "Proved bounds over a simulated run (numerical), against the time left.",
    }
    return [
        f"\\begin{{figure}}[htbp]\n\\centering\n\\includegraphics[width=0.75\\linewidth]{{{file}}}\n"
        f"\\caption{{{captions[name]}}}\n\\label{{fig:ptcc-{name}}}\n\\end{{figure}}"
        for name, file in figures.items()
    ]


def _tex_source(saved: SavedCertificate) -> list[str]:
    breakable = r"\allowbreak{}".join(saved.sha256[i : i + 8] for i in range(0, 64, 8))
    return [
        rf"\noindent Theorems: {AUTHORS}, \emph{{{TITLE}}}, manuscript. The statement follows from a certificate of "
        f"${len(saved.report.steps)}$ obligations, which the checker of "
        rf"{_tex(_clean(saved.document['producer'], 200))} verified in exact arithmetic; "
        rf"SHA-256 of its file: \texttt{{{breakable}}}."
    ]


_TEX = {c: f"\\{c}" for c in "{}$&#%_"}
_TEX |= {"\\": r"$\backslash$", "^": r"\^{}", "~": r"\~{}", "<": "$<$", ">": "$>$", "|": "$|$"}
_TEX |= {c: rf"{{\char{ord(c)}}}" for c in "\"'`"}


def _tex(text: str) -> str:
    r"""Return a text as LaTeX that every engine sets; letters beyond Latin-1 are written as their code.

    Examples
    --------
    >>> print(_tex("50% of {a}_1 \\ \u4e2d"))
    50\% of \{a\}\_1 $\backslash$ U+4E2D
    """

    def one(c: str) -> str:
        if " " <= c <= "~":
            return _TEX.get(c, c)
        if c == "\N{HORIZONTAL ELLIPSIS}":
            return "..."
        return c if "\u00c0" <= c <= "\u00ff" and c not in "\u00d0\u00de\u00f0\u00fe" else f"U+{ord(c):04X}"

    return re.sub("-(?=-)", "-{}", "".join(map(one, text)))


def _tex_comment(text: str) -> str:
    return "".join(c if " " <= c <= "~" else "?" for c in text)


def _tex_symbol(name: str) -> str:
    from ptcc_certify.latex import symbol_latex

    return symbol_latex(name)


def _tex_exact(x: Fraction) -> str:
    return _tex_html(_exact(x))


def _tex_interval(value: tuple[Fraction, Fraction]) -> str:
    return _tex_exact(value[0]) if value[1] == 0 else _tex_html(_enclosed(value))


def _tex_power(text: str) -> str:
    return _tex_html(_power(text))


def _tex_html(text: str) -> str:
    """Turn a number as the page shows it into LaTeX."""
    signs = {"\N{MINUS SIGN}": "-", "\N{ALMOST EQUAL TO}": r"\approx", "\u00d7": r"\cdot", "\u00b1": r"\pm"}
    for sign, latex in signs.items():
        text = text.replace(sign, latex)
    return text.replace("<sup>", "^{").replace("</sup>", "}")
