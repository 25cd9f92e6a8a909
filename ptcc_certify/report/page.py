"""The page of a certificate: one file of HTML that loads nothing and runs no script.

What it tells are the facts of the certificate, of a graph or a family; around them stand tables, figures and how to
check the file, in ``templates/``, which Jinja2 fills: every text of the file is made printable, cut, and escaped.
"""

from __future__ import annotations

import math
import shlex
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from datetime import date
from fractions import Fraction
from functools import cache
from importlib import resources
from importlib.metadata import PackageNotFoundError, metadata
from itertools import groupby, islice
from pathlib import PurePath
from typing import Any

import jinja2
from markupsafe import Markup

from lmi.exact.decimal_rounding import counted
from ptcc_certify.certificate.certificate import Certificate, RejectedCertificate
from ptcc_certify.certificate.constrained_switching.bounds import nearer_for_signal
from ptcc_certify.certificate.fact import Fact
from ptcc_certify.certificate.runs_against_bounds import compare
from ptcc_certify.checker import CheckReport
from ptcc_certify.checker.obligations import VerifiedObligation
from ptcc_certify.errors import Change, Sentence, spell
from ptcc_certify.graphs.io.graph_files import reading_flags
from ptcc_certify.graphs.size_limits import LABELLED_NODES
from ptcc_certify.model.agents import plant_text
from ptcc_certify.report import html_text as texts
from ptcc_certify.report.facts.agents import claimed_of
from ptcc_certify.report.facts.claim import assumptions
from ptcc_certify.report.facts.constrained_switching import signal_text
from ptcc_certify.report.facts.decay import BOUND_KINDS
from ptcc_certify.report.facts.graph import leader_facts
from ptcc_certify.report.facts.late import beside_law
from ptcc_certify.report.facts.of_certificate import facts_of
from ptcc_certify.report.html_text import rational
from ptcc_certify.report.page_figures import Counterexamples, counterexamples, draw, inline_figure, run_of_agents
from ptcc_certify.report.page_states_table import ROWS, states_table
from ptcc_certify.report.plots.runs_under_signals import keeps_promise
from ptcc_certify.report.plots.sizes import PAGE, sized
from ptcc_certify.report.plots.subject import ideal_text, limits_text
from ptcc_certify.report.text_layout import arithmetic
from ptcc_certify.simulation.agents import AgentsTrajectory
from ptcc_certify.simulation.trajectory import Trajectory
from ptcc_certify.theorems.family_behaviour import DEPENDS
from ptcc_certify.theorems.table import THEOREMS

#: Weights of a member that are listed.
_WEIGHTS = 8
#: Facts of the question, and those that stand elsewhere on the page.
_QUESTION = ["graph", "family", "read", "nodes", "mode", "structure", "protocol", "x(0)", "offsets", "v(0)", "sigma(0)"]
_QUESTION += ["messages", "leaders"]
_ELSEWHERE = ("verdict", "proof")
#: The theorem of families, as page and statement give it.
THEOREM = (
    "If the mandatory graphs of all modes have one kernel K, and every uncertain edge joins agents whose rows of a"
    " basis of K agree up to its sign, then K is at rest in every graph of the family, and under every signal the"
    " agents come to a state of K by the deadline."
)


def report_html(
    saved: Certificate,
    *,
    no_run: str = "no run was asked for",
    runs: Sequence[Trajectory] = (),
    day: date | None = None,
) -> str:
    """Return a certificate as one page of HTML that loads nothing and runs no script.

    The first screen is the answer in words; the same certificate makes the same page on the same day.

    Parameters
    ----------
    saved : Certificate
        As :func:`ptcc_certify.certificate.certificate.read_certificate` reads it; with a trajectory
        (:meth:`Certificate.with_simulation`) there are figures of bound and input. One of a family may be undecided.
    no_run : str
        Why there is no trajectory, for the page.
    runs : sequence of Trajectory
        Of a family, for figures of bound and input.
    day : date, optional
        The day that the page gives as that of its writing; today by default.

    Returns
    -------
    str
        The whole page, in HTML.

    Examples
    --------
    >>> foes = SignedDigraph.from_edges([("<b>", "b", -1), ("b", "<b>", -1)])
    >>> with TemporaryDirectory() as folder:
    ...     certify(foes, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), [3, 5]).save(f"{folder}/c.json")
    ...     page = report_html(read_certificate(f"{folder}/c.json"))
    >>> "<h1>Signed-average consensus at T = 1</h1>" in page, "<bdi>&lt;b&gt;</bdi>" in page, "<b>" in page
    (True, True, False)
    """
    why = counterexamples(saved) if saved.of_family else []
    report = saved.checked
    run = run_of_agents(saved)
    own = _of_family(saved, why) if saved.of_family else _of_graph(saved)
    view = _view(saved) | own | _runs(saved, runs, run)
    more: dict[str, Any] = {"no_run": no_run, "why": why, "obligations": [] if report is None else _obligations(report)}
    with sized(PAGE):
        more["figures"] = draw(saved, None, runs, why, run)
        late = more["figures"].get("late")
        more["missed"] = late is not None and any(line.get_marker() == "v" for line in late.axes[0].lines)
        return _environment().get_template("page.html").render(view | _written(day) | more)


def rejected_html(error: RejectedCertificate, *, day: date | None = None) -> str:
    """Return the page of a certificate that the independent check rejects: the reason, and no claim.

    Parameters
    ----------
    error : RejectedCertificate
        What :func:`ptcc_certify.certificate.certificate.read_certificate` raised.
    day : date, optional
        The day that the page gives as that of its writing; today by default.

    Returns
    -------
    str
        The whole page, in HTML.

    Examples
    --------
    >>> page = rejected_html(RejectedCertificate(Path("c.json"), ptcc.check({})))
    >>> "REJECTED by the independent check" in page, "consensus" in page
    (True, False)
    """
    name = texts.printable(error.path.name, 200)
    title = f"REJECTED: {name}"
    command = texts.printable(shlex.quote(error.path.name), 200)
    template = _environment().get_template("rejected.html")
    return template.render(title=title, name=name, quoted=command, report=error.report, **_written(day))


def _written(day: date | None) -> dict[str, str]:
    """Return the day of writing, as a page gives it."""
    return {"written": (day or date.today()).isoformat()}


@cache
def _environment() -> jinja2.Environment:
    """Return the templates with what they may use; what is printed is escaped, and an unknown name is an error."""
    environment = texts.environment(lambda text: texts.printable(text, 2000), autoescape=True)
    named = ("above", "below", "indexed", "label", "labels", "power", "printable", "rational", "symbol")
    environment.filters |= {name: getattr(texts, name) for name in named}
    environment.filters |= {"counted": counted, "grouped": "{:,}".format, "flags": reading_flags, "merged": dict.__or__}
    environment.filters |= {
        "head": lambda head: texts.typeset(texts.head_text(head)),
        "words": set_note,
        "set": lambda fact: set_note(fact.note),
    }
    style = (resources.files("ptcc_certify.report") / "page.css").read_text(encoding="utf-8")
    environment.globals |= {"style": Markup(style), "inline_figure": inline_figure, "newline": Markup("\n")}
    environment.globals["labelled_nodes"] = LABELLED_NODES
    return environment


def set_note(note: Sentence) -> Markup:
    """Return the sentence of a fact, set as formulas are.

    Examples
    --------
    >>> print(set_note(("says little; ", Change("rho2", "3"), " leaves 1 %")))
    says little; \u03c1<sub>2</sub> = 3 leaves 1 %
    """
    return texts.set_text(spell(note, texts.as_parameters, marked=True))


def _view(saved: Certificate) -> dict[str, Any]:
    """Return what the template shows of every certificate."""
    facts = facts_of(saved)
    source, assessment = saved.source, saved.assessment
    shown = [fact for fact in facts if fact.head not in (*_QUESTION, *_ELSEWHERE)]
    answers, details = ([fact for fact in shown if fact.detail == wanted] for wanted in (False, True))
    asked = [fact for fact in facts if fact.head in _QUESTION]
    if not saved.of_family:
        asked += leader_facts(saved.graph_proof.structure)
    pairs = zip(saved.labels, saved.sigma0 or (), saved.proof.reaching or (), strict=False)
    advised = next((piece.number for piece in assessment.advice if isinstance(piece, Change)), "")
    begins = saved.initial_state if saved.proof.agents is None else saved.proof.agents.initial_state
    certified = saved.verdict == "certified"
    caption, *states = states_table(saved)
    lacks = [
        text
        for text, lacking in {
            "no decay was proved": saved.proof.rate is None and not saved.proof.constant,
            "no final state was proved": source is not None and "influence" not in source.document,
        }.items()
        if lacking
    ]
    return {
        **{"saved": saved, "certified": certified, "sliding": saved.protocol.reaching is not None},
        "verdict_text": set_note(facts[-1].note),
        "larger_rho2": advised if "leaves 1 %" in spell(assessment.advice) else "",
        "arithmetic": arithmetic(saved.direct),
        "answers": _by_head(answers),
        **{"asked": asked, "details": _by_head(details), "lacks": lacks},
        "graph_text": set_note(facts[0].note),
        "beside_law": beside_law(saved),
        "equations": texts.formula_svg(protocol_latex(saved), inline=False),
        "parameters": [(name, getattr(saved.protocol, name)) for name in texts.parameter_names(saved.protocol)],
        "states": (texts.indexed(caption), *states),
        "reaching": [] if saved.direct else list(islice(pairs, ROWS)),
        "begins": begins is not None,
        "sampled": any(limits.sample_period is not None for limits in saved.limits),
        "commands": _commands(saved),
        "documentation": _documentation(),
        "file_name": None if source is None else source.path.name,
        "sha256": None if source is None else source.sha256,
        "document": None if source is None else source.document,
        **{"constant": saved.proof.constant, "theorem": THEOREM},
    }


def protocol_latex(saved: Certificate) -> str:
    """Return the protocol in LaTeX: that of agents of order n, or with places in a formation."""
    if saved.proof.agents is not None:
        return saved.proof.agents.protocol.latex()
    if saved.proof.late is not None and (tracking := saved.proof.late.tracking_protocol) is not None:
        return tracking.latex(places=saved.proof.offsets is not None)
    return saved.protocol.latex(places=saved.proof.offsets is not None)


def _of_graph(saved: Certificate) -> dict[str, Any]:
    """Return what the template shows of one graph alone."""
    proof = saved.graph_proof
    claims = sorted(Counter(proof.claims).items(), key=lambda item: item[0].theorem)
    statements = {theorem.number: theorem.statement for theorem in THEOREMS}
    rows = []
    for claim, number in claims:
        words = ", ".join((claim.behaviour[:1].upper() + claim.behaviour[1:], *claim.special))
        corollaries = (
            f" ({'Corollary' if len(claim.corollaries) == 1 else 'Corollaries'} {', '.join(claim.corollaries)})"
        )
        source = f"Theorem {claim.theorem}{corollaries if claim.corollaries else ''}"
        rows.append((words, source, statements[claim.theorem] if proof.agents is None else "", number))
    title = _title(saved)
    return {
        **{"family": None, "several": False, "depends": False, "promise": "", "promised": False, "of_the_kind": False},
        **{"claims": rows, "claims_in_all": len(proof.claims), "bound_words": []},
        "theorems": list(dict.fromkeys(claim.theorem for claim, _ in claims)),
        **{"heading": texts.indexed(title), "title": title.replace("<sup>", "^").striptags()},
        "unbounded": proof.effort is not None and proof.effort.bounded is False and proof.agents is None,
    }


def _title(saved: Certificate) -> Markup:
    """Say what the certificate is about."""
    claims, deadline = saved.graph_proof.claims, "T" if saved.protocol.reaching is None else "T_r + T_s"
    behaviour = claims[0].sharpest if len(claims) == 1 else f"{len(claims):,} components settle"
    text = Markup(behaviour)
    if (part := saved.proof.agents) is not None:
        of = claimed_of(part).replace(" - ", " \N{MINUS SIGN} ")
        text = Markup("{} of {}{}").format(behaviour, plant_text(part.protocol.plant), of)
    text += Markup(" at {} = {}").format(deadline, rational(saved.protocol.T)).replace("= \u2248", "\u2248")
    if part is None and saved.proof.constant:
        text = Markup("every agent keeps {}").format("its state" if saved.direct else "x \u2212 \u03c3")
    if part is None:
        text += "" if saved.proof.offsets is None else " of x \N{MINUS SIGN} offsets"
        text += _without(saved)
    return text[:1].upper() + text[1:] if saved.verdict == "certified" else "Undecided: " + text


def _without(saved: Certificate) -> str:
    """Say what a claim is without, where more was asked."""
    return "".join(f", {assumption}" for assumption in assumptions(saved))


def _of_family(saved: Certificate, why: Counterexamples) -> dict[str, Any]:
    """Return what the template shows of a family alone."""
    proof = saved.family_proof
    components = [part.component for part in proof.parts]
    depends, T = any(component.behaviour == DEPENDS for component in components), rational(saved.protocol.T)
    counts = Counter(claim.value for claim in facts_of(saved, details=False) if claim.head == "claim" and claim.value)
    behaviour = next(iter(counts)) if len(counts) == 1 else f"{len(components):,} components settle"
    title = Markup("{} at T = {}{}").format(behaviour, T, "" if proof.family.graph is not None else " for every signal")
    if depends:
        title = Markup("where agents end depends on the signal")
    elif saved.verdict != "certified":
        title = Markup("what the agents do at T = {}").format(T)
    title += _without(saved)
    title = title.replace("= \u2248", "\u2248")
    title = title[:1].upper() + title[1:] if saved.verdict == "certified" else "Undecided: " + title
    bound = min((p.upper_bound for p in proof.parts if p.upper_bound), key=lambda b: b.value, default=None)
    claims = [(str(claim)[:1].upper() + str(claim)[1:], "", "", number) for claim, number in counts.items()]
    return {
        **{
            "family": proof.family,
            "several": len(proof.family.modes) > 1,
            "depends": depends,
            "why": why,
        },
        **{"claims": claims, "claims_in_all": len(components), "heading": title, "title": title.striptags()},
        "promise": "" if proof.signal == "any" else signal_text(proof.signal)[1],
        "promised": nearer_for_signal(saved.family_proof) if saved.initial_state is not None else False,
        "bound_words": _bound_words(saved),
        "bound_kind": "" if bound is None else BOUND_KINDS[bound.kind],
        "unbounded": proof.unbounded and proof.common,
        "theorems": [],
    }


def _runs(saved: Certificate, runs: Sequence[Trajectory], run: AgentsTrajectory | None) -> dict[str, Any]:
    """Return what the template tells of simulated runs."""
    view: dict[str, Any] = {"runs": runs, "asked_run": False, "of_the_kind": False}
    if saved.of_family:
        if not runs:
            return view | {"run_text": ""}
        ratios = [compare(saved, run) for run in runs]
        promise_kept = saved.family_proof.signal != "any" and keeps_promise(saved, runs)
        worst = sum(run.signal.startswith("worst") for run in runs)
        text = f"{counted(len(runs), 'run')} from the initial state of the certificate"
        text += (
            " under signals that keep the promise"
            if promise_kept
            else f", {worst} of them under the worst that was found"
        )
        text += "." if saved.direct else ", under the worst disturbance."
        if any(ratio.judged for ratio in ratios) and saved.family_proof.common:
            largest = max(ratio.worst_ratio for ratio in ratios)
            word = "VIOLATED" if any(ratio.violated for ratio in ratios) else "kept"
            text += f" The bounds are {word}: the largest ratio of run to bound is {largest:.3g}."
        return view | {"run_text": text, "of_the_kind": promise_kept}
    if saved.proof.agents is not None:
        seen = None if run is None else saved.proof.agents.compare(run)
        if seen is None:
            return view | {"run_text": ""}
        word = "exceeds a bound" if seen.violated else "keeps every bound"
        text = (
            f"A run by CVODES {word}: the largest ratio of V to its bound is {seen.decay:.4f}, of all {seen.worst:.4f}."
        )
        return view | {"run_text": text}
    if saved.trajectory is None:
        return view | {"run_text": ""}
    asked, ideal = saved.asked_trajectory, ideal_text(saved)
    text = "The run was repeated for this page with CVODES, from the initial state of the certificate"
    if asked is not None:
        limits = limits_text(asked, saved).replace("$T$", "T")
        stepped = asked.conditions.messages is not None or asked.conditions.leaders is not None
        how = "a run in steps of closed form" if stepped else "a run"
        text += f"; states and input are those of {how} with what was asked: {limits}"
    elif ideal:
        text += f", with {ideal}"
    return view | {"run_text": f"{text}.", "asked_run": asked is not None}


def _obligations(report: CheckReport) -> list[tuple[VerifiedObligation, list[VerifiedObligation]]]:
    """Return the obligations of one kind and statement together, in the order of the first of each."""
    kinds: dict[tuple[str, str, str], list[VerifiedObligation]] = {}
    for obligation in report.obligations:
        kinds.setdefault((obligation.kind, obligation.statement, obligation.lemma), []).append(obligation)
    return [(same[0], same) for same in kinds.values()]


def _bound_words(saved: Certificate) -> list[Markup]:
    """Tell the members that prove the upper bound on the rate: modes, weights, durations or shares."""
    parts = [part for part in saved.family_proof.parts if part.upper_bound is not None]
    if not parts:
        return []
    part = min(parts, key=lambda p: p.upper_bound.value)  # type: ignore[union-attr]
    bound, family = part.upper_bound, saved.family_proof.family
    assert bound is not None
    from ptcc_certify.certificate.unverified_section import upper_bound_entry
    from ptcc_certify.lyapunov.common_forms import Quotient

    lines = []
    for member, duration in zip(
        upper_bound_entry(Quotient.of(part.component), bound)["members"], bound.durations, strict=True
    ):
        name = texts.printable(member["name"]) if len(family.modes) > 1 else "the graph"
        how = {
            "word": Markup("for {} of the clock").format(rational(duration)),
            "mixture": Markup("for a share {} of the time").format(rational(duration)),
            "member": Markup("for ever"),
        }[bound.kind]
        some = [
            Markup("{} \u2192 {}: {}").format(texts.label(s, 24), texts.label(t, 24), rational(Fraction(w)))
            for s, t, w in member["weights"][:_WEIGHTS]
        ]
        more = ", ..." if len(member["weights"]) > _WEIGHTS else ""
        weights = Markup(" with ") + Markup(", ").join(some) + more if some else Markup("")
        lines.append(Markup("{} {}{}").format(name, how, weights))
    return lines


def _by_head(facts: Sequence[Fact]) -> list[tuple[str, list[Fact]]]:
    """Return facts by their heads, in the order in which these stand."""
    return [(head, list(each)) for head, each in groupby(facts, lambda fact: fact.head)]


def _documentation() -> str:
    """Return where the documentation stands, as ``pyproject.toml`` names it under ``urls``; empty if it does not."""
    with suppress(PackageNotFoundError):
        for entry in metadata("ptcc-certify").get_all("Project-URL") or ():
            name, _, url = entry.partition(", ")
            if name == "Documentation":
                return url.rstrip("/")
    return ""


def _commands(saved: Certificate) -> list[str]:
    if saved.source is None:
        return []
    name = shlex.quote(PurePath(saved.source.path).name)
    name = f"./{name}" if name.startswith("-") else name
    memory = saved.source.report.memory
    more = f" --memory {math.ceil(memory)}" if memory > 1 else ""
    return [f"ptcc check {name}{more}", f"python -m ptcc_certify.checker {name}{more}"]
