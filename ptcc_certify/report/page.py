"""The page of a certificate: one file of HTML that loads nothing and runs no script."""

from __future__ import annotations

import html
import math
import shlex
from collections import Counter
from fractions import Fraction
from itertools import islice

from lmi.exact.rounding import up
from ptcc_certify.bounds.envelope import FRACTIONS
from ptcc_certify.bounds.input import Effort
from ptcc_certify.certificate.document import producer
from ptcc_certify.certificate.saved import RejectedCertificate, SavedCertificate
from ptcc_certify.graphs.io.graph_files import reading_flags
from ptcc_certify.graphs.limits import DRAWN_NODES
from ptcc_certify.graphs.rationals import nearest_float
from ptcc_certify.protocols.nominal import SlidingModeProtocol
from ptcc_certify.report.figures import draw, inline_figure
from ptcc_certify.report.markup import bullets, document, folded, table, verdict_box
from ptcc_certify.report.mathml import equations, symbol
from ptcc_certify.report.screen import remarks_on, structure_text
from ptcc_certify.report.texts import (
    AUTHORS,
    LISTED,
    TITLE,
    above,
    agent_parts,
    balance_text,
    below,
    caveats,
    claim_text,
    common_bound,
    coordinates,
    enclosed,
    escaped,
    kinds_text,
    label_html,
    labels_html,
    limited_text,
    limits_text,
    parameter_names,
    plural,
    power,
    printable,
    rational,
    subscripts,
)
from ptcc_certify.simulation.trajectory import SlidingTrajectory
from ptcc_certify.theorems import THEOREMS

#: Rows of agents, and of leader groups, that are written out.
ROWS, GROUPS = 200, 40


def report_html(saved: SavedCertificate, *, no_run: str = "no run was asked for") -> str:
    """Return a certificate as one page of HTML that loads nothing and runs no script.

    Parameters
    ----------
    saved : SavedCertificate
        As :func:`ptcc_certify.certificate.saved.read_certificate` reads it; with a trajectory
        (:meth:`SavedCertificate.with_simulation`) there are figures of bound and input.
    no_run : str
        Why there is no trajectory, for the page.

    Returns
    -------
    str
        The whole page, in HTML.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> from ptcc_certify import NominalProtocol, SignedDigraph, certify, read_certificate
    >>> foes = SignedDigraph.from_edges([("<b>", "b", -1), ("b", "<b>", -1)])
    >>> with TemporaryDirectory() as folder:
    ...     certify(foes, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), [3, 5]).save(f"{folder}/c.json")
    ...     page = report_html(read_certificate(f"{folder}/c.json"))
    >>> "<h1>Bipartite consensus at T = 1</h1>" in page, "<bdi>&lt;b&gt;</bdi>" in page, "<b>" in page
    (True, True, False)
    """
    return _Page(saved, no_run).html()


def rejected_html(error: RejectedCertificate) -> str:
    """Return the page of a certificate that the independent check rejects: the reason, and no claim.

    Parameters
    ----------
    error : RejectedCertificate
        What :func:`ptcc_certify.certificate.saved.read_certificate` raised.

    Returns
    -------
    str
        The whole page, in HTML.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from ptcc_certify import NominalProtocol, SignedDigraph, certify, read_certificate
    >>> foes = SignedDigraph.from_edges([("a", "b", -1), ("b", "a", -1)])
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "c.json")
    ...     certify(foes, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1)).save(path)
    ...     _ = path.write_text(path.read_text().replace('"rho2": "1"', '"rho2": "2"'))
    ...     try:
    ...         read_certificate(path)
    ...     except RejectedCertificate as error:
    ...         page = rejected_html(error)
    >>> "REJECTED by the independent check" in page, "consensus" in page
    (True, False)
    """
    report, name = error.report, escaped(error.path.name, 200)
    said = f"Nothing in this file may be taken for proved. The reason: {escaped(str(report.reason))}."
    body = [
        f"<h1>Certificate {name}</h1>",
        verdict_box("bad", "\u2718", "REJECTED by the independent check", said),
        f"<p>The part that was not verified: <code>{escaped(str(report.rejected))}</code>. "
        f"{len(report.steps)} obligation(s) before it were verified, which by themselves make no claim.</p>",
        "<h2>What to do</h2>",
        bullets(
            [
                f"Check the file yourself: <code>ptcc check {escaped(shlex.quote(error.path.name), 200)}</code>.",
                "Side files belong in the folder of the certificate, under the names that it gives.",
                "Otherwise ask whoever sent the file for the graph, and certify it again: <code>ptcc certify</code>.",
            ]
        ),
    ]
    return document(f"REJECTED: {name}", "\n".join(body))


class _Page:
    """The sections of one page."""

    def __init__(self, saved: SavedCertificate, no_run: str):
        self.saved, self.no_run = saved, no_run
        self.graph, self.structure, self.protocol = saved.graph, saved.structure, saved.protocol
        self.sliding = isinstance(saved.protocol, SlidingModeProtocol)
        self.deadline = "T_r + T_s" if self.sliding else "T"
        self.meaning = ", T = T<sub>r</sub> + T<sub>s</sub>" if self.sliding else ""
        self.figures = draw(saved, ("graph", "decay", "sliding", "input"))

    def html(self) -> str:
        """Return the whole page."""
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
        links = bullets(f'<a href="#{key}">{name}</a>' for key, name, _ in sections)
        body = [f"<h1>{subscripts(self.title())}</h1>", self.verdict(), f'<nav aria-label="Contents">{links}</nav>']
        body += [
            f'<section aria-labelledby="{key}"><h2 id="{key}">{name}</h2>\n{text}\n</section>'
            for key, name, text in sections
        ]
        return document(self.title().replace("<sup>", "^").replace("</sup>", ""), "\n".join(body))

    # ------------------------------------------------------------------ title, verdict, question

    def title(self) -> str:
        """Say what the certificate is about."""
        claims = self.saved.claims
        said = claims[0].behaviour if len(claims) == 1 else f"{len(claims):,} components settle"
        said = f"{said} at {self.deadline} = {rational(self.protocol.T)}".replace("= \u2248", "\u2248")
        if self.saved.constant:
            said = f"every agent keeps {self.kept()}"
        return f"{said[0].upper()}{said[1:]}" if self.saved.verdict == "certified" else f"Undecided: {said}"

    def kept(self) -> str:
        """Say what does not change where no agent listens to another."""
        return "its state" if self.saved.direct else "x \u2212 \u03c3"

    def verdict(self) -> str:
        """Return the box that says what the check found."""
        report = self.saved.report
        count = f"{len(report.steps)} obligation(s) in exact arithmetic ({escaped(report.arithmetic)})"
        if self.saved.verdict == "certified":
            said = f"The independent check verified {count}, without a solver. What follows from them is proved."
            found = self.saved.assessment
            fine = found.exit_code == 0 and found.useful
            kind, mark, word = ("good", "\u2714", "CERTIFIED") if fine else ("doubt", "!", found.word.upper())
            return verdict_box(kind, mark, word, f"{said} Verdict: {escaped(found.text)}.")
        missing = self.missing()
        said = f"The independent check verified {count}; what these state is proved. But {missing}. "
        said += f"Verdict: {escaped(self.saved.assessment.text)}."
        return verdict_box("doubt", "?", "UNDECIDED", said)

    def missing(self) -> str:
        """Say what keeps a certificate from being certified."""
        lacks = ["no decay was proved"] if self.saved.rate is None and not self.saved.constant else []
        lacks += ["no final state was proved"] if self.saved.document["outcome"] is None else []
        return " and ".join(lacks) or "not everything was proved"

    def asked(self) -> str:
        """Return graph, start, limits and protocol, as they were given."""
        graph, saved = self.graph, self.saved
        negative = int((graph.sign < 0).sum())
        orientation = {
            "information": "a row a, b: information flows from a to b, and b listens",
            "listens": "a row a, b: a listens to b",
            "matrix": "rows of the matrix are listeners",
        }[graph.read["orientation"]]
        rows = [
            ("Graph", f"{plural(graph.n_nodes, 'agent')}, {plural(graph.n_edges, 'edge')}, {negative:,} negative"),
            ("Read as", escaped("; ".join([orientation, *remarks_on(self.structure)]))),
            ("Structure", escaped(structure_text(self.structure))),
            ("Start", "given, below" if saved.start is not None else "none: the claims are for every start"),
        ]
        effort = saved.effort
        if effort is not None and effort.starts is not None:
            R = common_bound(effort.starts)
            shape = "an ellipsoid" if effort.starts.axes else "a box"
            which = (
                f"{shape} of starts, which the file names"
                if R is None
                else f"all |x<sub>k</sub>(0)| \u2264 {rational(R)}"
            )
            rows.append(("Starts", f"bounds of the input are for {which}"))
        rows += [("Limits of the gain", limits_text(entry)) for entry in (effort.residual if effort else ())]
        if effort is not None and effort.disturbed is not None:
            rows.append(
                ("Disturbances", f"|d<sub>k</sub>| \u2264 {rational(effort.disturbed.delta)} under the protocol")
            )
        given = [(symbol(name), rational(getattr(self.protocol, name))) for name in parameter_names(self.protocol)]
        kind = "Sliding-mode protocol" if self.sliding else "Nominal protocol"
        return "\n".join(
            [
                table("The question", ("What", "As given"), rows),
                f"<h3>{kind}</h3>",
                f"<p>{self.protocol_words()}</p>",
                '<div class="equations" tabindex="0" role="group" aria-label="Equations">'
                f"{equations(self.protocol)}</div>",
                table("Parameters, exact", ("Parameter", "Value"), given),
            ]
        )

    def protocol_words(self) -> str:
        """Say in words what agents do under the protocol."""
        if not isinstance(self.protocol, SlidingModeProtocol):
            return (
                "Agent k has the state x<sub>k</sub> and moves by x<sub>k</sub>\u2032 = u<sub>k</sub>. Its input is "
                "the gain g times what it hears: the sum over those it listens to, l, of w<sub>kl</sub> (x<sub>l</sub> "
                "\u2212 sign(w<sub>kl</sub>) x<sub>k</sub>). The gain grows without limit at the deadline T."
            )
        return (
            "Agent k moves by x<sub>k</sub>\u2032 = u<sub>k</sub> + d<sub>k</sub> under any disturbance with "
            f"|d<sub>k</sub>| \u2264 \u03b4 = {rational(self.protocol.delta)}. The sliding part of its input "
            "drives the sliding variable \u03c3<sub>k</sub> to 0 by T<sub>r</sub>; from then on no disturbance is "
            "felt, and the nominal part settles the agents at T<sub>r</sub> + T<sub>s</sub>."
        )

    # ------------------------------------------------------------------ what was proved

    def proved(self) -> str:
        """Return everything that follows from the verified obligations, but for the input."""
        saved = self.saved
        parts = [self.claims(), self.states(), self.rates(), self.left()]
        if not saved.direct:
            parts.append(self.reaching())
        return "\n".join(part for part in parts if part)

    def claims(self) -> str:
        """Return what the theorems say of each component."""
        statements = {theorem.number: theorem.statement for theorem in THEOREMS}
        counted = Counter(self.saved.claims)
        said = []
        for claim, count in sorted(counted.items(), key=lambda item: item[0].theorem):
            whole = f"{plural(count, 'component')}: " if len(self.saved.claims) > 1 else ""
            statement = subscripts(escaped(statements[claim.theorem]))
            doubt = "" if self.saved.verdict == "certified" else "not certified: "
            claimed = f"{whole}{doubt}<strong>{claim_text(claim)}</strong>"
            said.append(f"{claimed}. Theorem {claim.theorem}: <q>{statement}</q>")
        told = ""
        if self.saved.verdict != "certified":
            told = "<p>Verified are the hypotheses of the theorem, and what follows here.</p>"
        elif self.sliding:
            told = "<p>This holds whatever the disturbances within \u03b4.</p>"
        degenerate = ""
        if self.saved.degenerate:
            groups = labels_html(list(map(str, self.saved.degenerate)))
            degenerate = f"<p>From this start leader group {groups} meets at 0, although it is balanced.</p>"
        return f"<h3>Behaviour at the deadline</h3>{bullets(said)}{told}{degenerate}"

    def states(self) -> str:
        """Return the table of starts and final states."""
        saved, n = self.saved, self.graph.n_nodes
        if saved.start is None:
            return ""
        head, parts = ["Agent", "Part", "Start"], agent_parts(saved)
        if not saved.direct:
            head.append("\u03c3(0)")
        if saved.final_state is not None:
            head.append("State at the deadline" if saved.verdict == "certified" else "Limit, if it settles")
        rows = []
        for k in range(min(n, ROWS)):
            row = [label_html(self.graph.labels[k]), parts[k], rational(saved.start[k])]
            if not saved.direct:
                row.append(rational((saved.sigma0 or ())[k]))
            if saved.final_state is not None:
                row.append(enclosed(saved.final_state[k]))
            rows.append(row)
        caption = "Where the agents begin"
        if saved.final_state is not None:
            exact = not any(radius for _, radius in saved.final_state)
            caption = f"Where the agents end, proved {'exactly' if exact else 'in intervals'}"
            if saved.verdict != "certified":
                caption = f"Where the agents end if they settle ({'exact' if exact else 'in proved intervals'})"
        more = f'<p class="note">The first {ROWS} of {n:,} agents; the file has all.</p>' if n > ROWS else ""
        if not saved.direct:
            more += "<p>The agents end at Q (X(0) \u2212 \u03c3(0)), whatever the disturbance.</p>"
        return folded(caption, table(caption, head, rows, stack=len(head) > 4), len(rows)) + more

    def rates(self) -> str:
        """Return the proved rate, its limit and prefactor, and what they are rates of."""
        saved = self.saved
        if saved.constant:
            return f"<p>No agent listens to another: each keeps {self.kept()}, and there is nothing to decay.</p>"
        if saved.rate is None:
            return "<p>No rate of decay was proved.</p>"
        limit, rows = saved.upper_bound, []
        rows.append(("Proved rate", f"{below(saved.rate)} per unit of the stretched clock s, rounded down"))
        if limit is not None:
            rows.append(("No rate exceeds", f"{above(limit, 8)}, proved, rounded up"))
            ratio = f"at least {below(saved.rate / limit, 4)} (proved rate over that upper bound)"
            rows.append(("Optimality ratio", ratio))
        if saved.prefactor is not None:
            z = "E" if saved.document["prefactor"]["of"] == "||E||^2" else "\u03b5"
            rows.append(("Prefactor at that rate", f"{above(saved.prefactor, 4)} of \u2016{z}\u2016\u00b2"))
        if saved.paper_rate is not None and saved.lyapunov is not None:
            formula = escaped(saved.lyapunov.objective)
            rows.append(("The article's own rate", f"{below(saved.paper_rate)} = {formula}"))
        rows.append(("Lyapunov functions", kinds_text(saved)))
        clock = "s(t) = \u03c1<sub>1</sub> t + \u03c1<sub>2</sub> \u03ba ln(T/(T \u2212 t))"
        decay = "V(t) \u2264 e<sup>\u2212rate s(t)</sup> V(0)"
        if not saved.direct:
            since = "s(t) \u2212 s(T<sub>r</sub>)"
            decay = f"V(t) \u2264 e<sup>\u2212rate ({since})</sup> V(T<sub>r</sub>) from T<sub>r</sub> on"
        words = (
            f"<p>Each Lyapunov function V = z\u2032Pz of the file obeys {decay}, with a rate of its own, on the "
            f"stretched clock {clock}{self.meaning}, which grows without limit towards the deadline. z is the error "
            "E = \u2212L X, L the signed Laplacian, or the deviation \u03b5 of X from its weighted signed mean.</p>"
        )
        if not saved.direct:
            words += "<p>Until T<sub>r</sub> the sliding variables drive the agents too.</p>"
        return "<h3>Rate of decay</h3>" + words + table("Rates", ("Quantity", "Value"), rows)

    def left(self) -> str:
        """Return what may be left at some instants, rounded up."""
        saved = self.saved
        if not saved.envelope.members or saved.rate is None:
            return ""
        z, T = coordinates(saved), self.protocol.T
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
        columns = [[above(x, 2) for x in bounds]]
        if saved.start is not None and any(m.distance is not None for m in saved.envelope.members):
            numerical = "" if saved.direct else " (numerical, rounded up)"
            head.append(f"Distance of any agent to its outcome at most{numerical}")
            worst = saved.outcome_distance([float(1 - f) for f, _ in instants]).max(axis=0)
            columns.append([above(float(x), 2) for x in worst])
        rows = [(name, *cells) for (_, name), *cells in zip(instants, *columns, strict=True)]
        return "<h3>What may be left before the deadline</h3>" + table(f"Bounds, rounded up{self.meaning}", head, rows)

    def reaching(self) -> str:
        """Return when each sliding variable is proved to be 0."""
        saved, rows = self.saved, []
        agents = zip(self.graph.labels, saved.sigma0 or (), saved.reaching or (), strict=True)
        for label, sigma, r in islice(agents, ROWS):
            when, before = "T_r only", "0"
            if r.z is not None:
                when = "0, it starts there" if not sigma else up(r.time, 6) if r.time else "0"
                before = below(r.remaining, 3) if r.remaining else "nearer than a float tells"
            rows.append((label_html(label), rational(sigma), when, before))
        head = ("Agent", "\u03c3(0)", "\u03c3 = 0 proved from t =", "That is before T<sub>r</sub> by")
        n = self.graph.n_nodes
        more = f'<p class="note">The first {ROWS} of {n:,} agents.</p>' if n > ROWS else ""
        figure = ""
        if "sliding" in self.figures and saved.comparison is not None:
            kept = "reached 0 no later than proved" if saved.comparison.reaching_kept else "reached 0 LATER than proved"
            caption = (
                f"Sliding variables of a repeated run under the disturbance {escaped(self.met())} (numerical): all "
                f"{kept}. Ticks: the proved reaching times, for every disturbance within \u03b4. Dotted: T<sub>r</sub>."
            )
            figure = inline_figure(self.figures["sliding"], "sliding", caption)
        times = folded("Reaching times of all agents", table("Whatever the disturbance", head, rows), len(rows))
        return "<h3>Reaching times</h3>" + times + more + figure

    def met(self) -> str:
        """Say which disturbance a repeated run meets."""
        run = self.saved.trajectory
        return f"d = {run.source}" if isinstance(run, SlidingTrajectory) else "none"

    # ------------------------------------------------------------------ graph, run, input

    def drawn(self) -> str:
        """Return the graph's drawing, its leader groups and its followers."""
        structure, labels = self.structure, self.graph.labels
        figure = ""
        if "graph" in self.figures:
            groups = plural(len(structure.closed_components), "group")
            camps = Counter(part.partition(", ")[2] for part in agent_parts(self.saved))
            said = ", ".join(f"{camps[name]} in {name}" for name in ("camp 1", "camp 2") if camps[name])
            said += f"{', ' if said else ''}{camps['unbalanced']} unbalanced" if camps["unbalanced"] else ""
            caption = (
                f"{plural(self.graph.n_nodes, 'agent')}, {plural(self.graph.n_edges, 'edge')}; leaders in {groups}, "
                f"{said}; {plural(structure.followers.size, 'follower')}. Arrows point to who listens, solid from "
                "allies, dashed from opponents."
            )
            figure = inline_figure(self.figures["graph"], "graph", caption)
        else:
            figure = (
                f'<p class="note">Graphs are drawn up to {DRAWN_NODES} nodes; this one has {self.graph.n_nodes:,}.</p>'
            )
        rows = [
            (f"{k}", labels_html([labels[v] for v in c.nodes]), balance_text(c, labels))
            for k, c in enumerate(structure.closed_components[:GROUPS], start=1)
        ]
        count = len(structure.closed_components)
        more = f'<p class="note">The first {GROUPS} of {count:,} groups.</p>' if count > GROUPS else ""
        followers = [labels[v] for v in structure.followers.tolist()[: LISTED + 1]]
        said = labels_html(followers) if structure.followers.size <= LISTED else f"{structure.followers.size:,} agents"
        words = f"<p>Followers: {said}.</p>" if structure.followers.size else "<p>There are no followers.</p>"
        head = ("Group", "Leaders", "Camps")
        return figure + table("Leader groups: who listens to nobody outside", head, rows, stack=True) + more + words

    def decay(self) -> str:
        """Return the repeated run under the proved bounds."""
        saved = self.saved
        if saved.trajectory is None:
            return f"<p>There is no simulated run here: {escaped(self.no_run)}. The proved bounds do not need one.</p>"
        told = [
            "<p>The run was repeated for this page with CVODES, from the start of the certificate"
            + (f", under the disturbance <code>{escaped(self.met())}</code>" if self.sliding else "")
            + (", without limits of the gain and without noise" if saved.effort and saved.effort.residual else "")
            + ". It is <strong>numerical</strong>: it corroborates the bounds and proves nothing.</p>"
        ]
        seen = saved.comparison
        if "decay" in self.figures and seen is not None:
            z = coordinates(saved)
            word = "VIOLATED" if seen.violated else "kept" if seen.judged else "not tested: all is below the floor"
            until = (
                f"down to 1 \u2212 t/T = {power(f'{seen.resolved_until:.1e}')}" if seen.resolved_until else "throughout"
            )
            caption = (
                f"Proved bounds of \u2016{z}(t)\u2016 over a simulated run, against the time left. The bound is "
                f"{word}: the largest ratio of run to bound is {seen.worst_ratio:.4g}, resolved {until}."
            )
            told.append(inline_figure(self.figures["decay"], "decay", caption))
        if saved.final_state is not None:
            gap = max(
                abs(float(x) - nearest_float(m))
                for x, (m, _) in zip(saved.trajectory.final_state.tolist(), saved.final_state, strict=True)
            )
            where = "the proved final state" if saved.verdict == "certified" else "that limit"
            settled = "" if saved.trajectory.deadline_resolved else " (it had not settled)"
            told.append(f"<p>It ends within {above(Fraction(gap), 2)} of {where}{settled}.</p>")
        return "\n".join(told)

    def effort(self) -> str:
        """Return whether the input stays finite, how large it gets, and the inputs of the repeated run."""
        saved, effort = self.saved, self.saved.effort
        if saved.constant:
            return "<p>No agent listens to another: the nominal input is 0.</p>"
        if effort is None:
            return "<p>Nothing is proved about the input, since no decay was proved.</p>"
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
        figure = ""
        if "input" in self.figures and saved.trajectory is not None:
            largest = float(abs(saved.trajectory.input).max())
            line = ""
            if effort.peak is not None and effort.starts is None:
                line = f" Dashed: the certified peak {above(effort.peak.largest)}."
            caption = (
                f"Inputs |u<sub>k</sub>(t)| of the repeated run (numerical), up to {power(f'{largest:.4g}')} at its "
                f"samples.{line}"
            )
            figure = inline_figure(self.figures["input"], "input", caption)
        bounds = table("Proved bounds, rounded up", ("Quantity", "Bound"), self.input_bounds(effort))
        return f"<p>{part}: {said}</p>{bounds}{figure}"

    def input_bounds(self, effort: Effort) -> list[tuple[str, str]]:
        """Return the rows of what is proved about the input."""
        lower, upper = effort.threshold
        ends = [f"at least {below(lower, 5)}"] if lower is not None else []
        ends += [f"at most {above(upper, 5)}"] if upper is not None else []
        product = "\u03c1<sub>2</sub> \u03ba min Re \u03bb"
        rows = [(f"Threshold {product}", f"{' and '.join(ends) or 'not bounded by a proof'}; bounded from 1 on")]
        if effort.by is not None:
            how = {"rate": "the proved rate", "limit": "the proved limit of rates", "spectrum": "the exact spectrum"}
            rows.append(("Decided by", how[effort.by]))
        if effort.bounded is False and (rate := self.saved.rate) is not None:
            rows.append(("What mends it", f"raise \u03c1<sub>2</sub> \u03ba to {above(2 / rate, 5)} or more"))
        whom = "from all of these starts" if effort.starts is not None else "from this start"
        whom = f"of the whole input {whom}" if self.sliding else whom
        if effort.peak is not None:
            most = max(range(len(effort.peak.agents)), key=effort.peak.agents.__getitem__)
            label = label_html(self.graph.labels[most])
            rows.append((f"Peak {whom}", f"|u<sub>k</sub>| \u2264 {above(effort.peak.largest)} (agent {label})"))
            rows.append(("Peak of the norm", f"\u2016u\u2016 \u2264 {above(effort.peak.norm)}"))
        nominal = " of the nominal part" if self.sliding else ""
        if effort.energy is not None:
            rows.append((f"Energy{nominal}", f"\u222b \u2016u\u2016\u00b2 dt \u2264 {above(effort.energy.value)}"))
        if effort.path_length is not None:
            rows.append((f"Path length{nominal}", f"\u222b \u2016u\u2016 dt \u2264 {above(effort.path_length.value)}"))
        if effort.sliding is not None and not effort.sliding.bounded:
            rows.append(("Sliding part", "\u03bc<sub>3</sub> \u03ba &lt; 1: not bounded for every \u03c3(0)"))
        rows += [(f"With {limits_text(entry)}", limited_text(entry)) for entry in effort.residual]
        if effort.disturbed is not None:
            d = effort.disturbed
            drift = "" if d.drift is None else f"; agents end within {above(max(d.drift))} of their outcome"
            rows.append(
                (
                    f"Disturbances |d<sub>k</sub>| \u2264 {rational(d.delta)}",
                    f"add at most {above(max(d.inputs))} to |u<sub>k</sub>|{drift}",
                )
            )
        return rows

    # ------------------------------------------------------------------ proof, check, limits, citation

    def obligations(self) -> str:
        """Return the table of what the independent check verified."""
        steps = self.saved.report.steps
        rows = [
            (
                f"{number}",
                f"{escaped(s.kind)} of <code>{escaped(s.of)}</code>",
                escaped(s.statement),
                escaped(s.lemma),
                escaped(s.detail),
            )
            for number, s in enumerate(steps, start=1)
        ]
        head = ("No.", "Obligation", "States", "By", "Verified")
        proof = table("Verified by the independent check, in exact arithmetic", head, rows, stack=True)
        return folded(f"{plural(len(steps), 'obligation')}, all verified", proof, len(steps))

    def check(self) -> str:
        """Return how a stranger verifies the file, and by which hashes it is known."""
        saved, name = self.saved, shlex.quote(self.saved.path.name)
        name = f"./{name}" if name.startswith("-") else name
        more = f" --memory {math.ceil(saved.report.memory)}" if saved.report.memory > 1 else ""
        rows = [
            ("SHA-256 of the file", f"<code>{saved.sha256}</code>"),
            ("SHA-256 of the graph", f"<code>{escaped(saved.report.sha256)}</code>"),
            ("Digest of the claims", f"<code>{escaped(saved.document['digest'])}</code>"),
            ("Written by, as the file says", escaped(saved.document["producer"], 200)),
            ("Checked by", producer()),
        ]
        commands = [f"ptcc check {name}{more}", f"python -m ptcc_certify.checker {name}{more}"]
        return (
            "<p>The page is made from the certificate's file and proves nothing by itself; the file does. Either "
            "command checks it, in its folder; the second needs Python alone. Add the file of your graph to the first, "
            "and it is compared with that of the certificate, read in the same way "
            f"(<code>{escaped(reading_flags(saved.document['graph']['read']))}</code>). The format is "
            "specified in <code>ptcc_certify/checker/FORMAT.md</code>, for a checker of your own.</p>"
            f"<pre>{html.escape(chr(10).join(printable(c, 300) for c in commands))}</pre>"
            + table("What to compare", ("What", "Value"), rows, stack=True)
        )

    def limits(self) -> str:
        """Return what a reader might take for proved and is not."""
        return bullets(caveats(self.saved, self.no_run))

    def cite(self) -> str:
        """Return the sources of theorems and program."""
        theorems = sorted({claim.theorem for claim in self.saved.claims})
        which = f"Theorem{'s' * (len(theorems) > 1)} {', '.join(theorems)}"
        return (
            f"<p>{which} of: {AUTHORS}. <cite>{TITLE}</cite>. Manuscript.</p><p>BibTeX: <code>ptcc cite "
            f"{theorems[0]}</code>. The program: {producer()}; its "
            "<code>CITATION.cff</code> says how to cite it.</p>"
        )
