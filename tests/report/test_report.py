"""A report says what its certificate proves, no more, and is safe to open whatever the certificate holds."""

from __future__ import annotations

import html
import json
import math
import os
import re
import shlex
import shutil
import subprocess
import sys
import unicodedata
from datetime import date
from email.message import Message
from fractions import Fraction
from functools import cache
from html.parser import HTMLParser
from importlib import resources
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from asked import certify_words
from bad_inputs import ptcc
from generators import sparse_digraph
from jinja2 import UndefinedError
from report_examples import HOSTILE, MADE, NOMINAL, SLIDING, example, forged, undecided
from selection import thinned

import ptcc_certify
from lmi.exact.decimal_rounding import up
from ptcc_certify import (
    Agents,
    Certificate,
    GainLimits,
    LateMessages,
    MovingLeaders,
    NominalProtocol,
    SignedDigraph,
    certify,
    design,
)
from ptcc_certify.certificate.certificate import RejectedCertificate, read_certificate
from ptcc_certify.errors import ParameterError
from ptcc_certify.examples import load_graph
from ptcc_certify.graphs.io import read_graph
from ptcc_certify.model.asks import Asks, InitialState
from ptcc_certify.report.html_text import LISTED, formula_svg, printable, set_text, typeset
from ptcc_certify.report.latex_text import latex_of_text
from ptcc_certify.report.page import _environment, report_html
from ptcc_certify.report.page_states_table import EXTREMES
from ptcc_certify.report.plots.decay import plot_decay
from ptcc_certify.report.report_file import write_report
from ptcc_certify.report.screen import certificate_lines
from ptcc_certify.report.statement import report_latex

pytestmark = pytest.mark.usefixtures("quick_search")

#: What a page needs, and nothing that loads, runs or leaves it.
TAGS = frozenset(
    re.findall(
        "[a-z0-9]+",
        "html head meta title style body main h1 h2 h3 h4 div strong span p nav ul li a section "
        "table caption thead tbody dl dt dd tr th td code pre q cite details summary figure figcaption bdi sub sup svg "
        "g defs clippath path rect use image",
    )
)


class Page(HTMLParser):
    """What a browser would find: tags with their attributes, text, and whether every tag is closed in order."""

    def __init__(self, source: str):
        super().__init__(convert_charrefs=True)
        self.tags: list[tuple[str, dict[str, str]]] = []
        self.open: list[str] = []
        self.pieces: list[tuple[str, str]] = []
        self.comments: list[str] = []
        self.feed(source)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        names = [name for name, _ in attrs]
        assert len(set(names)) == len(names)
        self.tags.append((tag, {name: value or "" for name, value in attrs}))
        if tag not in {"meta", "br", "hr"}:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, {name: value or "" for name, value in attrs}))

    def handle_endtag(self, tag: str) -> None:
        assert self.open and self.open.pop() == tag, tag

    def handle_data(self, data: str) -> None:
        self.pieces.append((self.open[-1] if self.open else "", data))

    def handle_comment(self, data: str) -> None:
        self.comments.append(data)

    @property
    def text(self) -> str:
        return "".join(data for tag, data in self.pieces if tag != "style")

    def named(self, tag: str) -> list[dict[str, str]]:
        return [attributes for name, attributes in self.tags if name == tag]


def sound(source: str) -> Page:
    """Nothing loads, nothing runs, everything is closed; a reader without sight finds the way."""
    page = Page(source)
    assert page.open == [] and page.comments == []
    assert {tag for tag, _ in page.tags} <= TAGS
    policy = "default-src 'none'; style-src 'unsafe-inline'; img-src data:"
    assert [m for m in page.named("meta") if "http-equiv" in m] == [
        {"http-equiv": "Content-Security-Policy", "content": policy}
    ]
    for tag, attributes in page.tags:
        for name, value in attributes.items():
            if value == policy:
                continue
            assert not name.startswith("on") and name not in ("src", "srcset", "action", "background", "data", "xmlns")
            if tag == "image" and name == "href":  # a picture of cells, in the page itself
                assert re.fullmatch("data:image/png;base64,[A-Za-z0-9+/=\\s]+", value)
                continue
            if not name.startswith("aria-"):
                assert "://" not in value and "javascript:" not in value.lower() and "data:" not in value, (tag, name)
            if name.endswith("href"):
                assert value.startswith("#")
    style = "".join(data for tag, data in page.pieces if tag == "style")
    assert not re.search(r"url\(|@import|http|expression", style)
    assert not [c for c in source if unicodedata.category(c) in ("Cc", "Cf", "Cs") and c != "\n"]
    ids = [attributes["id"] for _, attributes in page.tags if "id" in attributes]
    assert len(set(ids)) == len(ids)
    referred = [attributes["href"][1:] for _, attributes in page.tags if "href" in attributes]
    referred += re.findall(r"url\(#([^)]*)\)", source)
    referred += [attributes["aria-labelledby"] for _, attributes in page.tags if "aria-labelledby" in attributes]
    assert set(referred) <= set(ids)
    assert page.named("html") == [{"lang": "en"}] and len(page.named("title")) == 1
    assert "width=device-width" in next(m["content"] for m in page.named("meta") if m.get("name") == "viewport")
    levels = [int(tag[1]) for tag, _ in page.tags if re.fullmatch("h[1-6]", tag)]
    assert levels[0] == 1 and levels.count(1) == 1
    assert all(after <= before + 1 for before, after in pairwise(levels))
    assert all(attributes.get("scope") in ("row", "col") for attributes in page.named("th"))
    assert len(page.named("table")) == len(page.named("caption"))
    assert len(page.named("figure")) == len(page.named("figcaption")) <= len(page.named("svg"))
    for svg in page.named("svg"):
        assert svg["role"] == "img" and re.search("[0-9]", svg["aria-label"]) and "<svg" not in svg["aria-label"]
    return page


def rows(source: str, caption: str) -> list[list[str]]:
    """Return the cells of a table by its caption, as text."""
    tables = re.findall(r"<table.*?</table>", source, flags=re.DOTALL)
    (table,) = [t for t in tables if plain(re.findall("<caption>(.*?)</caption>", t)[0]).startswith(caption)]
    body = table[table.index("<tbody") :]
    return [[plain(cell) for cell in re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", row)] for row in body.split("<tr")[1:]]


def plain(text: str) -> str:
    text = re.sub(r"\s\u00d7\s10<sup>(.*?)</sup>", r"e\1", text)
    text = re.sub(r"\b10<sup>(.*?)</sup>", r"1e\1", text)
    return html.unescape(re.sub("<[^>]*>", "", text)).replace("\u2212", "-")


def number(text: str) -> Fraction:
    """Return the first number of a text."""
    found = re.search(r"-?[0-9]+(?:\.[0-9]+)?(?:e-?[0-9]+)?", text)
    assert found is not None, text
    return Fraction(found[0])


def reported(certificate: Certificate, folder: Path, **options: Any) -> str:
    certificate.save(folder / "c.json")
    assert write_report(folder / "c.json", folder / "c.html", **options) == certificate.verdict
    return (folder / "c.html").read_text(encoding="utf-8")


@cache
def page_without_run(name: str) -> str:
    """The page of an example, without a simulated run; made once."""
    with TemporaryDirectory() as folder:
        return reported(example(name), Path(folder), simulation=False)


# ---------------------------------------------------------------------- the page


@pytest.mark.few(0)
def test_the_commands_of_a_page_work(tmp_path: Path):
    """As they stand, in the folder of the certificate; with the graph added to the first."""
    (tmp_path / "g.csv").write_text("a,b,1\nb,a,-2\nb,c,1\n")
    graph = read_graph(tmp_path / "g.csv", orientation="listens")
    certify(graph, NOMINAL, asks=Asks(simulation=False)).save(tmp_path / "my c.json")
    write_report(tmp_path / "my c.json", tmp_path / "c.html", simulation=False)
    source = (tmp_path / "c.html").read_text()
    page = sound(source).text
    commands = html.unescape(re.findall("<pre>(ptcc check .*?)</pre>", source, re.DOTALL)[0]).splitlines()
    assert commands == ["ptcc check 'my c.json'", "python -m ptcc_certify.checker 'my c.json'"]
    assert "--edges listens" in page
    environment = {**os.environ, "PYTHONPATH": str(Path(ptcc_certify.__file__).parents[1])}
    for command in (*commands, f"{commands[0]} g.csv --edges listens"):
        words = shlex.split(command.replace("ptcc check", "python -m ptcc_certify.cli check"))
        done = subprocess.run([sys.executable, *words[1:]], cwd=tmp_path, env=environment, capture_output=True)
        assert done.returncode == 0, done


@pytest.mark.few(0)
@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=() if name in ("limits", "no start", "sliding", "single") else pytest.mark.campaign)
        for name in MADE
    ],
)
def test_every_page_is_sound_and_says_what_it_is(name: str, tmp_path: Path):
    made = example(name)
    source = reported(made, tmp_path)
    page = sound(source)
    assert page.text.index("CERTIFIED") < page.text.index("What they do") < page.text.index("What was asked")
    assert made.graph.sha256 in page.text and made.to_dict()["digest"] in page.text
    assert "ptcc check c.json" in page.text and "python -m ptcc_certify.checker c.json" in page.text
    order = ["asked", "proved", "graph", "bound", "obligations", "check", "limits", "cite"]
    assert [a["id"] for tag, a in page.tags if tag == "h2"] == order
    for claim in made.claims:
        assert f"Theorem {claim.theorem}" in page.text and claim.behaviour in page.text.lower()
    report = made.checked
    assert report is not None
    said = rows(source, "Verified by the independent check")
    assert sum(row[2].count(": ") for row in said) >= len(report.obligations)
    for s in report.obligations:
        (row,) = [
            row
            for row in said
            if row[0] == s.kind and row[1].startswith(plain(f"{set_text(s.statement)} ({set_text(s.lemma)})"))
        ]
        assert plain(f"{s.of}: {set_text(s.detail)}") in row[2]
    assert "printed end" not in page.text and ("counted from 0" in page.text) == ("decays[0]" in page.text)
    figures = {a["id"] for a in page.named("figure")}
    for figure in ("figure-states", "figure-decay", "figure-input"):
        assert (figure in figures) == (name not in ("no start", "single"))
    assert ("figure-sliding" in figures) == (name == "sliding")


@pytest.mark.few(0)
def test_numbers_are_rounded_to_the_safe_side():
    for name in ("nominal", "sliding"):
        made, source = example(name), page_without_run(name)
        assert made.rate is not None and made.limit is not None and made.effort is not None
        said: dict[str, str] = {}
        for key, text in rows(source, "In detail"):
            said[key] = said.get(key, "") + text.replace("\u00a0", " ")
        rate = said["How fast"]
        assert made.rate * Fraction(99999, 100000) <= number(rate) <= made.rate
        upper = number(rate.partition("upper bound ")[2])
        assert made.limit.value <= upper <= made.limit.value * Fraction(100001, 100000)
        assert number(rate.partition("ratio at least ")[2]) <= made.rate / made.limit.value
        assert made.effort.peak is not None and made.effort.energy is not None
        peak = number(plain(source).partition("|uk| \u2264 ")[2])
        assert made.effort.peak.largest <= peak <= made.effort.peak.largest * Fraction(1001, 1000)
        assert made.effort.energy.value <= number(said["Size of the input"].partition("\u20162 dt \u2264 ")[2])
        share = 1 if made.direct else float(made.protocol.span / made.protocol.T)
        begin, unit = ("", "T") if made.direct else ("Tr + ", "Ts")
        for q, f in ((0.5 * share, 0.5), (0.1 * share, 0.9), (0.01 * share, 0.99)):
            bound = made.envelope.residual(q) if made.direct else float(made.norm_bound([q])[0])
            at = rf"([0-9.]+(?:e-?[0-9]+)?) at {re.escape(begin)}{f} {unit}"
            left, deviation = (re.findall(at, said[key])[-1] for key in ("How near", "Deviation"))
            assert Fraction(bound) <= Fraction(left) <= Fraction(bound) * Fraction(12, 10)
            assert float(made.deviation_bound([q]).max()) <= float(deviation)


@pytest.mark.few(0)
def test_final_states_are_the_proved_ones(tmp_path: Path):
    made = example("nominal")
    assert made.final_state is not None
    said = rows(page_without_run("nominal"), "Where the agents end, proved exactly")
    assert [Fraction(row[3]) for row in said] == list(made.final_state.states)
    assert [row[0] for row in said] == list(made.graph.labels)
    graph = sparse_digraph(np.random.default_rng(7), 150, 2.5)
    reported(certify(graph, NOMINAL, list(range(150)), asks=Asks(simulation=False)), tmp_path, simulation=False)
    saved = read_certificate(tmp_path / "c.json")
    said = rows((tmp_path / "c.html").read_text(), "Where the agents end, proved in intervals: the 10 highest")
    assert saved.final_state is not None and saved.final_state.intervals is not None and len(said) == 2 * EXTREMES
    ends = [(float(x), radius > 0, k) for k, (x, radius) in enumerate(saved.final_state.intervals)]
    highest = sorted(ends, key=lambda end: (-end[0], *end[1:]))[:EXTREMES]  # of the same states exact ones come first
    lowest = sorted(set(ends).difference(highest))[:EXTREMES]
    assert [row[0] for row in said] == [graph.labels[k] for *_, k in [*highest, *reversed(lowest)]]
    for row in said:
        middle, radius = saved.final_state.intervals[graph.labels.index(row[0])]
        shown, _, wide = row[3].partition(" \u00b1 ")
        assert abs(Fraction(shown) - middle) + radius <= (number(wide) if wide else 0)


@pytest.mark.parametrize("name", thinned(["disconnected", "nominal", "hostile"], 3))
def test_every_agent_is_in_its_part(name: str):
    made = example(name)
    parts = [row[1] for row in rows(page_without_run(name), "Where the agents end")]
    assert [p == "follower" for p in parts] == [v in made.structure.followers for v in range(made.graph.n_nodes)]
    for component in made.structure.closed_components:
        own = [parts[v] for v in component.nodes]
        camps = {1: "camp 1" if len(own) > 1 else "alone", -1: "camp 2", 0: "unbalanced"}
        assert [p.partition(", ")[2] for p in own] == [camps[g] for g in component.gauge or [0] * len(own)]
        assert len({p.partition(",")[0] for p in own}) == 1


def test_reaching_times_are_no_earlier_than_proved():
    made, source = example("sliding"), page_without_run("sliding")
    assert made.reaching is not None and any(r.z for r in made.reaching)
    for (_, _, when, before), r in zip(rows(source, "Whatever the disturbance"), made.reaching, strict=True):
        if r.z is None:
            assert "only" in when
        else:
            assert float(number(when)) >= r.time and float(number(before)) <= r.remaining
    assert "whatever the disturbances within \u03b4" in Page(source).text


@pytest.mark.few(0)
def test_a_page_is_the_same_every_time_on_the_same_day(tmp_path: Path):
    made, day = example("nominal"), date(2026, 1, 2)
    assert reported(made, tmp_path, day=day) == reported(made, tmp_path, day=day)
    first = reported(made, tmp_path, simulation=False, day=day)
    next_day = reported(made, tmp_path, simulation=False, day=date(2026, 1, 3))
    assert first.replace("2026-01-02", "2026-01-03") == next_day
    assert date.today().isoformat() in reported(made, tmp_path, simulation=False)


@pytest.mark.few(0)
def test_without_a_run_the_page_says_why(tmp_path: Path):
    page = sound(page_without_run("nominal"))
    assert "it was left out, as was asked" in page.text
    assert {a["id"] for a in page.named("figure")} == {"figure-graph"}
    page = sound(reported(certify(load_graph("fig1a"), NOMINAL), tmp_path))
    assert "the certificate names no initial state" in page.text


@pytest.mark.few(0)
def test_what_a_certificate_does_not_say_is_said():
    def caveats(name: str) -> str:
        source = page_without_run(name)
        return plain(source[source.index('id="limits"') : source.index('id="cite"')])

    nominal, limited, unbounded = caveats("nominal"), caveats("limits"), caveats("not bounded")
    assert "gain is infinite at the deadline" in nominal and "single integrators" in nominal
    assert "no disturbances in the model" in nominal and "without noise" in nominal
    assert "no disturbances in the model" not in limited and "without noise" not in limited
    assert "The input is not bounded" in unbounded and "The input is not bounded" not in nominal
    assert "sampled and held" in nominal and "Sampling is certified with the periods" in caveats("initial_set")
    assert "\u03b4 must be known" in caveats("sliding") and "No initial state was given" in caveats("no start")
    assert "article leaves disconnected graphs out" in caveats("disconnected")


@pytest.mark.usefixtures("framed_figures")
def test_the_page_links_to_the_checker_in_the_browser_where_the_documentation_has_an_address(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    told = Message()
    for url in ("Source, https://example.org/source", "Documentation, https://example.org/ptcc/"):
        told["Project-URL"] = url
    for known, shown in ((Message(), "file onto the page check.html of the"), (told, "page check.html")):
        monkeypatch.setattr("ptcc_certify.report.page.metadata", lambda _, known=known: known)
        page = reported(example("nominal"), tmp_path, simulation=False)
        assert shown in plain(page)
        assert ('<a href="https://example.org/ptcc/check.html">the page check.html</a>' in page) is (known is told)


@pytest.mark.few(0)
def test_the_page_of_capped_vehicles_does_not_say_that_their_gain_is_infinite():
    vehicles, messages = Agents(order=2, exchange="virtual"), LateMessages("0.01", gain_cap=20)
    graph = SignedDigraph.from_edges([("a", "b", 1)])
    made = certify(graph, NOMINAL, InitialState([0, 2], v0=[0, 1]), agents=vehicles, messages=messages)
    page = sound(report_html(read_certificate(made.to_dict()))).text
    assert "The gain is infinite" not in page and "What is told without limits is of a gain that is infinite" in page


@pytest.mark.usefixtures("framed_figures")
def test_the_page_of_a_design_says_what_was_asked_and_of_which_states_its_bounds_are(tmp_path: Path):
    graph = SignedDigraph.from_edges([(1, 2, 3), (2, 3, -1), (3, 1, 1)])
    asked = {"max_input": 20, "initial_bound": 3, "deadline": "2.5"}
    text = plain(reported(design(graph, **asked).certificate, tmp_path, simulation=False))
    assert "met: |uk| \u2264 20" in text
    assert "there is no final state. Bounds of the input are for the set of initial states." in text
    assert "no bound of the input in numbers" not in text
    text = plain(reported(design(graph, **asked, input_norm=2).certificate, tmp_path, simulation=False))
    assert "met:" not in text


def test_hostile_texts_are_shown_as_texts(tmp_path: Path):
    ring = [(HOSTILE[i], HOSTILE[(i + 1) % len(HOSTILE)], (-1) ** i) for i in range(len(HOSTILE))]
    certify(SignedDigraph.from_edges(ring), SLIDING, list(range(len(HOSTILE))), asks=Asks(simulation=False)).save(
        tmp_path / "c.json"
    )
    evil = '<svg onload="alert(1)">\u202e\x1b http://evil.example'
    path = forged(tmp_path, producer=evil, gain={"disturbance": evil}, unverified={"notes": [evil], "x": evil})
    odd = path.with_name("c '<b>\".json")
    path.rename(odd)
    assert write_report(odd, tmp_path / "c.html") == "certified"
    source = (tmp_path / "c.html").read_text(encoding="utf-8")
    page = sound(source)
    for label in HOSTILE[:4]:
        assert label in page.text
    assert "\\u{202e}right to left\\u{202c}" in page.text and "\\u{1b}[31m\\u{0}\\u{85}" in page.text
    assert "x" * 100 not in page.text


def test_templates_escape_what_they_show():
    """Nothing in them turns the escaping off, and a label that is HTML, or a template, is shown as it stands."""
    folder = resources.files("ptcc_certify.report") / "templates"
    sources = {file.name: file.read_text(encoding="utf-8") for file in folder.iterdir()}
    assert sorted(sources) == sorted(_environment().list_templates()) and "page.html" in sources
    for source in sources.values():
        assert not re.search(r"\|\s*safe|autoescape|<script|\bon[a-z]+=", source)
    for text in (*HOSTILE, "{{ saved }}", "{% raw %}", "{# #}"):
        shown = _environment().from_string("<p title='{{ x }}'>{{ x }}</p>{{ x|label }}{{ [x]|labels }}").render(x=text)
        page = Page(shown)
        assert [tag for tag, _ in page.tags] == ["p", "bdi", "bdi"] and list(page.tags[0][1]) == ["title"]
        assert page.tags[0][1]["title"] == page.pieces[0][1] == printable(text, 2000)
        assert page.pieces[1][1] == page.pieces[2][1] == printable(text)
    with pytest.raises(UndefinedError):
        _environment().from_string("{{ saved.rate }}").render()


def test_a_rejected_certificate_is_called_rejected_and_nothing_else(tmp_path: Path):
    made = example("nominal")
    made.save(tmp_path / "c.json")
    assert made.rate is not None and made.claim is not None
    path = forged(tmp_path, rates={"proved": str(2 * made.rate)}, producer="<script>")
    done = ptcc("report", str(path), "-o", str(tmp_path / "c.html"))
    told = [f"rejected   {path}", f"written    {tmp_path / 'c.html'} (tells why)"]
    assert done.code == 1 and done.out.splitlines() == told
    page = sound_rejection((tmp_path / "c.html").read_text(encoding="utf-8"))
    assert page.text.index("REJECTED") < 100 and "rates" in page.text
    for word in (made.claim.behaviour, "Theorem", "certified at", "CERTIFIED", "bounded"):
        assert word.lower() not in page.text.lower().replace("rates.proved is not what was proved", "")
    done = ptcc("report", str(path), "-o", str(tmp_path / "c.tex"))
    assert done.code == 1 and not (tmp_path / "c.tex").exists() and len(done.err.splitlines()) == 1
    with pytest.raises(RejectedCertificate):
        write_report(path, tmp_path / "c.tex")


def sound_rejection(source: str) -> Page:
    assert "<table" not in source and "<figure" not in source
    return sound(source)


@pytest.mark.usefixtures("framed_figures")
def test_an_undecided_certificate_is_not_called_certified(tmp_path: Path):
    done = ptcc("report", str(undecided(tmp_path)), "-o", str(tmp_path / "c.html"))
    assert done.code == 4, done.err
    page = sound((tmp_path / "c.html").read_text(encoding="utf-8"))
    assert "UNDECIDED" in page.text and "CERTIFIED" not in page.text
    assert "no final state was proved" in page.text and "<i>no final state</i>" in page.text
    assert "not certified: Interval bipartite consensus" in page.text
    assert "".join(data for tag, data in page.pieces if tag == "h1").startswith("Undecided: ")
    text = report_latex(read_certificate(tmp_path / "c.json"))
    assert "[certified]" not in text and "[verified; the certificate is undecided]" in text and "occurs at" not in text


@pytest.mark.usefixtures("framed_figures")
def test_without_a_proved_rate_little_is_said(tmp_path: Path):
    example("nominal").save(tmp_path / "c.json")
    data = json.loads((tmp_path / "c.json").read_text())
    nothing = dict.fromkeys(("paper", "diagonal", "proved", "upper_bound"))
    proof = [s for s in data["proof"] if s["kind"] in ("structure", "claim", "final-state")]
    less = {"paper": None, "overshoot": None, "input": None, "verdict": "undecided", "proof": proof}
    path = forged(tmp_path, decays=[], rates=nothing, **less)
    assert write_report(path, tmp_path / "c.html") == write_report(path, tmp_path / "c.tex") == "undecided"
    page = sound((tmp_path / "c.html").read_text(encoding="utf-8"))
    assert "no decay was proved" in page.text and "No rate of decay was proved" in page.text
    assert "Where the agents end if they settle (exact)" in page.text and "proved exactly" not in page.text
    assert "limit, if it settles" in (tmp_path / "c.tex").read_text() and "Limit, if it settles" in page.text
    assert "e^" not in (tmp_path / "c.tex").read_text()


def test_isolated_agents_under_the_sliding_mode_keep_the_difference(tmp_path: Path):
    graph = SignedDigraph.from_edges([], ["a", "b"])
    page = sound(
        reported(certify(graph, SLIDING, InitialState([1, 2], sigma0=[3, 0]), asks=Asks(simulation=False)), tmp_path)
    )
    assert "Every agent keeps x \u2212 \u03c3" in page.text and "keeps its state" not in page.text
    assert [row[4] for row in rows((tmp_path / "c.html").read_text(), "Where the agents end")] == ["-2", "2"]


@pytest.mark.few(0)
@pytest.mark.usefixtures("framed_figures")
def test_the_heading_names_the_sharpest_claim(tmp_path: Path):
    allies = SignedDigraph.from_edges([("a", "b", 1), ("b", "a", 1), ("b", "c", 1)])
    protocol = NominalProtocol(T=1, rho1=1, rho2=1, kappa=2)
    for agents, told in ((None, "Consensus at T"), (Agents(order=2), "Consensus of double integrators at T = 1</h1>")):
        made = certify(allies, protocol, [1, 2, 3], agents=agents, asks=Asks(method="paper", simulation=False))
        assert f"<h1>{told}" in reported(made, tmp_path, simulation=False)


def test_a_long_deadline_is_plain_in_the_title(tmp_path: Path):
    protocol = NominalProtocol(T=Fraction(10**30 + 1, 10**22 + 7), rho1=1, rho2=1, kappa=1)
    source = reported(certify(load_graph("fig1a"), protocol), tmp_path)
    assert "".join(data for tag, data in sound(source).pieces if tag == "title") == "Stability at T \u2248 10^8"
    assert "\u2248\u00a010<sup>8</sup></h1>" in source


def test_numbers_beyond_floats_are_shown(tmp_path: Path):
    example("single").save(tmp_path / "c.json")
    huge = {"alone": "-1e350"}
    path = forged(tmp_path, initial_state=huge, final_state=huge)
    assert write_report(path, tmp_path / "c.html") == "certified"
    page = sound((tmp_path / "c.html").read_text(encoding="utf-8"))
    assert "beyond \u221210300" in page.text and "beyond the range of float64" in page.text


@pytest.mark.few(0)
def test_the_page_of_a_large_graph_stays_small(tmp_path: Path):
    n = 4_000
    graph = sparse_digraph(np.random.default_rng(2), n, 1.2)
    made = certify(graph, NOMINAL, list(range(n)), asks=Asks(simulation=False, method="perron"))
    source = reported(made, tmp_path)
    page = sound(source)
    assert len(source.encode()) < 2_000_000
    assert len(rows(source, "Where the agents end")) == 2 * EXTREMES
    assert "the 10 highest and the 10 lowest of 4,000 agents" in page.text and "under final_state" in page.text
    assert {a["id"] for a in page.named("figure")} == {"figure-final", "figure-degrees"}
    assert f"{len(made.structure.closed_components):,} groups" in page.text
    assert "repeated only where that is asked for" in page.text


# ---------------------------------------------------------------------- equations and colours


@pytest.mark.parametrize("protocol", [NOMINAL, SLIDING], ids=["nominal", "sliding-mode"])
def test_the_equations_are_those_of_the_protocol(protocol: Any, tmp_path: Path):
    """Drawn, so that no font is needed; the LaTeX is the text of the drawing."""
    certify(load_graph("fig1b"), protocol).save(tmp_path / "c.json")
    page = Page(report_html(read_certificate(tmp_path / "c.json")))
    (found,) = [svg for svg in page.named("svg") if "begin{aligned}" in svg.get("aria-label", "")]
    assert found["aria-label"] == " ".join(protocol.latex().split()) and found["role"] == "img"


@pytest.mark.parametrize("latex", [r"\frac{a}{b}", r"x_k' = -\sum_{l=1}^N w_{kl}", r"\rho_1 \le \left(\kappa\right)^2"])
def test_a_formula_lies_within_its_frame(latex: str):
    """Every point of its outlines; and a curve that is closed comes back to where it began."""
    drawn = ElementTree.fromstring(formula_svg(latex))
    left, top, width, height = map(int, drawn.attrib["viewBox"].split())
    (path,) = drawn
    x = y = 0
    for letter, numbers in re.findall("([a-zM])([^a-zM]*)", path.attrib["d"]):
        values = list(map(int, re.findall("-?[0-9]+", numbers)))
        assert len(values) == {"M": 2, "l": 2, "q": 4, "h": 1, "v": 1, "z": 0}[letter]
        if letter in "Mlq":
            x, y = values[-2:] if letter == "M" else (x + values[-2], y + values[-1])
        assert left <= x <= left + width and top <= y <= top + height
    assert drawn.attrib["aria-label"] == latex and "stroke" not in path.attrib


def test_colours_have_enough_contrast():
    """WCAG 2: text of 4.5 to 1 on its ground, in the light, in the dark and on paper."""
    style = (resources.files("ptcc_certify.report") / "page.css").read_text(encoding="utf-8")
    palettes = [dict(re.findall(r"--([a-z-]+): (#[0-9a-f]{6})", part)) for part in style.split(":root {")[1:]]
    assert len(palettes) == 3
    pairs = [("text", "page"), ("text", "card"), ("muted", "page"), ("muted", "card")]
    pairs += [pair for kind in ("good", "doubt", "bad") for pair in ((kind, f"{kind}-card"), ("text", f"{kind}-card"))]
    for palette in palettes:
        for front, ground in pairs:
            light, dark = sorted((luminance(palette[front]), luminance(palette[ground])), reverse=True)
            assert (light + 0.05) / (dark + 0.05) >= 4.5, (front, ground, palette)
    assert "color:" not in re.sub(r"color: (var\(--[a-z-]+\)|inherit)", "", style.partition("* {")[2])


def luminance(colour: str) -> float:
    parts = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    linear = [x / 12.92 if x <= 0.04045 else ((x + 0.055) / 1.055) ** 2.4 for x in parts]
    return math.fsum(a * b for a, b in zip((0.2126, 0.7152, 0.0722), linear, strict=True))


def test_letters_are_large_enough_and_details_open_on_paper():
    style = (resources.files("ptcc_certify.report") / "page.css").read_text(encoding="utf-8")
    screen, _, paper = style.partition("@media print")
    assert "font: 1rem/" in screen
    assert all(float(size) >= 1 for size in re.findall(r"font-size: ([0-9.]+)rem", screen))
    assert "details::details-content" in paper and "@page" in paper and "break-inside: avoid" in paper


# ---------------------------------------------------------------------- LaTeX


@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="no pdflatex to compile with")
@pytest.mark.parametrize("name", ["limits", "sliding", "disconnected", "single", "hostile", "formation"])
def test_a_statement_compiles(name: str, tmp_path: Path):
    example(name).save(tmp_path / "c.json")
    assert write_report(tmp_path / "c.json", tmp_path / "state_ment.tex") == "certified"
    source = r"\documentclass{article}\usepackage{amsmath,graphicx}\begin{document}\input{state_ment}\end{document}"
    (tmp_path / "main.tex").write_text(source)
    command = ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "-no-shell-escape", "main.tex"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, timeout=60)
    assert done.returncode == 0, done.stdout[-2000:]
    assert b"Missing character" not in done.stdout
    assert (tmp_path / "state_ment_graph.pdf").exists()


def dense_digraph(n: int, size: Any = 1) -> SignedDigraph:
    """A ring with chords to every third agent, every other one negative."""
    pairs = [(i, j) for i in range(n) for j in range(n) if (j - i) % n in (1, 4)]
    return SignedDigraph.from_edges([(f"a{i}", f"a{j}", size * (-1) ** (i * j)) for i, j in pairs])


@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="no pdflatex to compile with")
@pytest.mark.parametrize("sliding", [False, True])
@pytest.mark.parametrize(
    ("n", "size"),
    [(8, 1), *(pytest.param(*case, marks=pytest.mark.campaign) for case in ((4, 1), (10, 1), (10, 1.25)))],
)
def test_a_statement_fits_a_column_of_two(n: int, size: Any, sliding: bool, tmp_path: Path):
    protocol: Any = SLIDING if sliding else NOMINAL
    more: Any = {"sigma0": [Fraction(2 * k - 9, 7) for k in range(n)]} if sliding else {}
    start = [Fraction(10 * k - 31, 7) for k in range(n)]
    made = certify_words(dense_digraph(n, size), protocol, start, simulation=False, **more)
    write_report(made, tmp_path / "s.tex", simulation=False)
    begin = r"\documentclass[twocolumn]{article}\usepackage{amsmath,graphicx}\begin{document}"
    (tmp_path / "main.tex").write_text(begin + r"\input{s}\end{document}")
    command = ["pdflatex", "-interaction=batchmode", "-halt-on-error", "-no-shell-escape", "main.tex"]
    assert subprocess.run(command, cwd=tmp_path, capture_output=True, timeout=60).returncode == 0
    log = (tmp_path / "main.log").read_text(errors="replace")
    assert all(float(excess) <= 2 for excess in re.findall(r"Overfull \\hbox \(([0-9.]+)pt", log)), log


@pytest.mark.few(0)
@pytest.mark.usefixtures("framed_figures")
@pytest.mark.parametrize("x0", thinned([[1, 2, 3], None], 2))
def test_a_statement_tells_the_input_with_late_messages(x0: Any):
    graph = SignedDigraph.from_edges([("a", "b", 1), ("b", "c", -1), ("a", "c", 2)])
    messages = LateMessages(delay="0.01", gain_cap=40)
    certificate = certify(graph, NOMINAL, x0, messages=messages, asks=Asks(method="perron", simulation=False))
    text = report_latex(read_certificate(certificate.to_dict()))
    largest = up(Fraction(float(certificate.late.input.max())), 4)
    told = f"Input: bounded up to $T$; $|u_{{k}}| \\le {largest}$"
    assert told + (", from within $1$ of it at first" if x0 is None else "") + "." in text


@pytest.mark.few(0)
@pytest.mark.usefixtures("framed_figures")
def test_the_answer_of_late_messages_tells_whose_speed_it_names():
    graph = SignedDigraph.from_edges([("a", "b", 1), ("b", "c", -1)])
    leaders = MovingLeaders(speed="0.5", disturbance="0.2")
    for messages in (LateMessages(delay="0.01"), None):
        made = certify(
            graph, NOMINAL, [1, 2, 3], messages=messages, leaders=leaders, asks=Asks(method="perron", simulation=False)
        )
        page = " ".join(re.sub("<[^>]*>", "", report_html(read_certificate(made.to_dict()))).split())
        assert re.search(r"Leaders ?speed \|xj&#39;\| ≤ 0.5; any \|dk\| ≤ 0.2 of followers", page)


def test_a_matrix_too_wide_for_a_column_of_two_is_a_list_of_weights(tmp_path: Path):
    for size, fits in ((1, True), ("1.25", False)):
        graph = dense_digraph(10, Fraction(size))
        text = report_latex(read_certificate(certify(graph, NOMINAL, asks=Asks(simulation=False)).to_dict()))
        assert (r"\begin{bmatrix}" in text) == fits == (r"\footnotesize\setlength\arraycolsep" in text)
        assert ("$w_{2,1} = 1.25$" in text) != fits


@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="no pdflatex to compile with")
def test_a_label_in_brackets_is_no_argument_of_latex(tmp_path: Path):
    graph = SignedDigraph.from_edges([("a", "[2cm]", 1), ("[2cm]", "[br]", -1), ("[br]", "*", 1)])
    certify(graph, NominalProtocol(T=1, rho1=1, rho2=1, kappa=2), [1, 2, 3, 4], asks=Asks(simulation=False)).save(
        tmp_path / "c.json"
    )
    write_report(tmp_path / "c.json", tmp_path / "s.tex", simulation=False)
    source = r"\documentclass{article}\usepackage{amsmath,graphicx}\begin{document}\input{s}\end{document}"
    (tmp_path / "main.tex").write_text(source)
    command = ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "-no-shell-escape", "main.tex"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, timeout=60)
    assert done.returncode == 0, done.stdout[-2000:]


def test_every_row_of_the_table_begins_with_a_label_and_not_with_an_argument(tmp_path: Path):
    graph = SignedDigraph.from_edges([("a", "[2cm]", 1), ("[2cm]", "*", -1)])
    certify(graph, NominalProtocol(T=1, rho1=1, rho2=1, kappa=2), [1, 2, 3], asks=Asks(simulation=False)).save(
        tmp_path / "c.json"
    )
    text = report_latex(read_certificate(tmp_path / "c.json"))
    after = re.findall(r"\\\\\n(?:\\hline\n)?(.)", text)
    assert after and not set(after) & set("[*")


@pytest.mark.usefixtures("framed_figures")
@pytest.mark.few(1)
@pytest.mark.parametrize(
    "size", ["1e300", "0", *(pytest.param(size, marks=pytest.mark.campaign) for size in ("1e-250", "1e160"))]
)
def test_starts_of_any_size_are_reported(size: str, tmp_path: Path):
    graph = SignedDigraph.from_edges([("a", "b", 1), ("b", "a", 1)])
    start = [Fraction(size), -Fraction(size)]
    certify(graph, NominalProtocol(T=1, rho1=1, rho2=1, kappa=3), start).save(tmp_path / "c.json")
    for name in ("c.html", "c.tex"):
        assert write_report(tmp_path / "c.json", tmp_path / name) == "certified"
    assert (tmp_path / "c_decay.pdf").exists() == (size != "0")


@pytest.mark.few(1)
@pytest.mark.usefixtures("framed_figures")
@pytest.mark.parametrize("start", [["1", "1/3", "1/3"], ["1", "1/3", "0.33333333333333333333"]])
def test_where_agents_begin_at_their_ends_or_all_but_there_a_page_has_no_decay(start: list[str]):
    graph = SignedDigraph.from_edges([("lead", "a", 1), ("a", "b", 1), ("b", "a", -1)])
    made = certify(graph, NominalProtocol(T=1, rho1=1, rho2=1, kappa=2), start)
    saved = read_certificate(made.to_dict()).with_simulation()
    page = report_html(saved)
    assert 'id="figure-states"' in page and 'id="figure-decay"' not in page
    with pytest.raises(ParameterError, match="nothing decays: every agent begins where it ends"):
        plot_decay(saved)


def test_a_statement_whose_figure_has_no_place_writes_nothing(tmp_path: Path):
    example("nominal").save(tmp_path / "c.json")
    (tmp_path / "s_decay.pdf").mkdir()
    with pytest.raises(ParameterError, match="is a folder, where a figure of the statement would go"):
        write_report(tmp_path / "c.json", tmp_path / "s.tex")
    assert {path.name for path in tmp_path.iterdir()} == {"c.json", "s_decay.pdf"}


@pytest.mark.few(0)
def test_the_file_does_not_say_who_checked_it(tmp_path: Path):
    example("nominal").save(tmp_path / "c.json")
    path = forged(tmp_path, producer="Theorem. Everything is proved")
    write_report(path, tmp_path / "c.html", simulation=False)
    write_report(path, tmp_path / "c.tex", simulation=False)
    assert "Everything is proved" not in (tmp_path / "c.tex").read_text()
    page = sound((tmp_path / "c.html").read_text(encoding="utf-8"))
    assert page.text.count("Everything is proved") == 1 and "as the file says" in page.text


def shares_of(text: str) -> dict[float, float]:
    """Return the instants, as fractions of the deadline, and the shares of the error that a statement gives."""
    line = next(line for line in text.splitlines() if r")\|$ at most" in line)
    pairs = re.findall(r"\$([0-9.]+)(?: \\cdot 10\^\{(-?\d+)\})?\$ at \$([0-9.]+)", line)
    return {float(f): float(share) * 10 ** int(power or 0) for share, power, f in pairs}


@pytest.mark.usefixtures("every_class")
def test_a_statement_holds_hypotheses_claim_and_numbers(tmp_path: Path):
    made = example("limits")
    made.save(tmp_path / "c.json")
    text = report_latex(read_certificate(tmp_path / "c.json"), {"graph": "g.pdf", "decay": "d.pdf"})
    assert (
        r"[certified]\label{prop:c}" in text
        and r"at $T$, without limits, noise or disturbances, by Theorem~2.1: as $t \to T$" in text
    )
    assert NOMINAL.latex() in text and made.graph.sha256 in text and "$\\kappa = 1$" in text
    rows = [re.search(rf"^{name}_{{i}} & ([^\\]*)", text, re.M) for name in "cr"]
    constants, rates = ([Fraction(x) for x in row[1].split(" & ")] for row in rows if row is not None)
    own = {(m.overshoot, m.proved_rate) for m in made.envelope.functions if m.coordinates == made.envelope.coordinates}
    assert all(any(c >= x and r <= y for x, y in own) for c, r in zip(constants, rates, strict=True))
    shares = shares_of(text)
    assert len(shares) == 3
    for instant, share in shares.items():  # what the statement says follows from its own inequality
        s = float(made.envelope.gain.clock_at_remaining(1 - instant))
        least = min(math.sqrt(c) * math.exp(-r * s / 2) for c, r in zip(constants, rates, strict=True))
        assert least * 0.999 <= share <= least * 1.12
    assert r"\includegraphics[width=\linewidth]{g.pdf}" in text and "{d.pdf}" in text
    assert text.count("\\begin{") == text.count("\\end{")
    assert (
        r"gain $\le 50$: $\|E\| \le" in text and r"|n_{k}| \le 0.01" in text and r"|d_{k}| \le 0.333333333333" in text
    )


@pytest.mark.few(0)
@pytest.mark.usefixtures("framed_figures")
@pytest.mark.parametrize("sigma0", [None, [1, 0, -2, 1, 0, 3]], ids=["nominal", "sliding"])
def test_a_statement_of_a_formation_is_that_of_states_less_places_but_for_where_agents_are(sigma0: Any):
    """Bounds are those of the statement of ``x0 - h``; the protocol and the table tell places and positions."""
    graph, h, x0 = "fig3a", [Fraction(1, 3), -2, 0, 4, 7, -5], [-4, 3, -1, 2, -2, 5]
    protocol: Any = NOMINAL if sigma0 is None else SLIDING
    options: dict[str, Any] = {"simulation": False, "sigma0": sigma0}
    ours = read_certificate(certify_words(graph, protocol, x0, agents=Agents(order=1, offsets=h), **options).to_dict())
    less = [x - y for x, y in zip(x0, h, strict=True)]
    plain = read_certificate(certify_words(graph, protocol, less, **options).to_dict())
    text, other = report_latex(ours), report_latex(plain)
    assert protocol.latex(places=True) in text and protocol.latex() not in text
    assert "x_{k}(t)" not in text and "$E = -L Z$" in text and "$z_{k} = x_{k} - h_{k}$" in text
    before, after = (
        part[part.index("occurs at $T") : part.index(r"\end{proposition}")].replace("x_{k}", "z_{k}")
        for part in (text, other)
    )
    assert before == after.replace("-L X", "-L Z")
    rows = [line.removeprefix("{}").removesuffix(r" \\").split(" & ") for line in text.splitlines() if line[:2] == "{}"]
    told = [[Fraction(cell.strip("$ \\")) for cell in row[2:]] for row in rows]
    assert ours.final_positions is not None
    assert [(row[0], row[1], row[-1]) for row in told] == list(zip(h, x0, ours.final_positions.states, strict=True))


def test_a_statement_of_a_formation_without_an_initial_state_tells_the_places():
    made = certify("fig3a", NOMINAL, agents=Agents(order=1, offsets=[1, -2, 0, 4, 7, -5]), asks=Asks(simulation=False))
    text = report_latex(read_certificate(made.to_dict()))
    assert "Agent & Part & $h_{k}$ \\\\" in text and "positions where agents" not in text


def test_through_a_reaching_phase_the_statement_tells_what_is_left_from_T_r_on(tmp_path: Path):
    saved = read_certificate(example("sliding").to_dict())
    text, p = report_latex(saved, {"decay": "d.pdf"}), saved.protocol
    assert r"$\|E(t)\| / \|E(T_{r})\|$ at most" in text and r" at $T_{r} + 0.99\, T_{s}$," in text
    own = [m for m in saved.envelope.functions if m.coordinates == saved.envelope.coordinates]
    line = text[text.index("E(T_{r})\\|$ at most") :].partition("\n")[0].replace("T_{r} + ", "")
    for instant, share in shares_of(line).items():
        s = p.rho1 * p.span * Fraction(instant) - p.rho2 * p.kappa * Fraction(math.log(1 - instant))  # type: ignore[attr-defined]
        least = min(math.sqrt(m.overshoot) * math.exp(-m.proved_rate * s / 2) for m in own)  # type: ignore[type-var]
        assert least * 0.999 <= share <= least * 1.12


@pytest.mark.few(0)
@pytest.mark.usefixtures("framed_figures")
def test_the_bound_through_a_reaching_phase_is_called_numerical_everywhere(tmp_path: Path):
    for name, word, arithmetic in (
        ("nominal", "proved bound", "exact arithmetic"),
        ("sliding", "bound (numerical)", "exact or ball arithmetic"),
    ):
        made = example(name)
        saved = read_certificate(made.to_dict())
        text, page = report_latex(saved, {"decay": "d.pdf"}), sound(report_html(saved.with_simulation())).text
        assert f"Thick line: the {word} from the initial state of the table" in text
        assert f"verified in {arithmetic};" in text and f"obligations in {arithmetic} (" in page
        assert ("Bounds (numerical) of" in page) == (not made.direct) == ("Proved bounds of" not in page)
        labels = [text.get_text() for text in plot_decay(made).get_legend().get_texts()]
        assert ("proved bound from $x(0)$" in labels) == made.direct != ("bound from $x(0)$ (numerical)" in labels)
        assert f"proved in {arithmetic}" in "\n".join(certificate_lines(made, name))


def test_a_statement_holds_the_weights_and_says_that_it_is_without_disturbances(tmp_path: Path):
    graph = SignedDigraph.from_edges([("ann", "bob", 2), ("bob", "ann", -1), ("bob", "eve", 1)])
    protocol = NominalProtocol(T=1, rho1=1, rho2=1, kappa=3)
    certify(graph, protocol, [1, 2, 3], asks=Asks(delta=1, simulation=False)).save(tmp_path / "c.json")
    saved = read_certificate(tmp_path / "c.json")
    text, page = report_latex(saved), sound(report_html(saved)).text
    assert "0 & -1 & 0 \\\\\n2 & 0 & 0 \\\\\n0 & 1 & 0\n\\end{bmatrix}" in text and "(labelled ann, bob, eve)" in text
    assert "All this is without disturbances, but for" in text and r"u_{k} + d_{k}" in text
    assert "certified without disturbances" in page and "disturbances is without them" in page
    assert "moves no $x_{k}(T)$" in text and "moves no xk(T)" in page
    certify(graph, protocol, [1, 2, 3], limits=[GainLimits(gain_cap=30)], asks=Asks(delta=1, simulation=False)).save(
        tmp_path / "l.json"
    )
    limited = read_certificate(tmp_path / "l.json")
    for told in (report_latex(limited), sound(report_html(limited)).text):
        assert "nothing is proved" in told and "where they would" not in told and "moves no" not in told


def test_the_page_says_in_words_why_a_bound_says_little(tmp_path: Path):
    graph = SignedDigraph.from_edges([("ann", "bob", 2), ("bob", "ann", -1), ("bob", "eve", 1)])
    protocol = NominalProtocol(T="1/5", rho1="1/10", rho2="1/10", kappa=1)
    certify(graph, protocol, asks=Asks(simulation=False)).save(tmp_path / "c.json")
    page = sound(report_html(read_certificate(tmp_path / "c.json"))).text
    assert "Why that says little" in page and "in place of 0.1, at most 1 % would be left then" in page
    assert "--rho2" not in page


@pytest.mark.few(1)
@pytest.mark.usefixtures("framed_figures")
@pytest.mark.parametrize("more", [{}, {"sample_period": "0.1"}])
def test_bounds_without_the_limits_of_the_gain_are_told_so(more: dict[str, Any], tmp_path: Path):
    limits = GainLimits(gain_cap=3, **more)
    certify("fig3a", NOMINAL, [-4, 3, -1, 2, -2, 5], limits=[limits], asks=Asks(simulation=False)).save(
        tmp_path / "c.json"
    )
    page = sound(report_html(read_certificate(tmp_path / "c.json"))).text
    details = {fact.head: fact.text for fact in read_certificate(tmp_path / "c.json").facts() if fact.detail}
    told = [details[head] for head in ("deviation", "threshold", "effort", "error")]
    assert all(text.startswith("without limits: ") for text in told)
    assert page.count("without limits") >= 6 and "names no limits, noise or disturbances is without them" in page
    assert ("left open: limits (" in page) == bool(more)
    assert ("gain \u2264 3: \u2016E\u2016" in page) != bool(more)


@pytest.mark.few(0)
def test_a_page_needs_neither_an_instant_after_the_reaching_time_nor_an_edge(tmp_path: Path):
    short = ptcc_certify.SlidingModeProtocol(T_r=1, T_s="1/100", rho1=1, rho2=1, kappa=2, mu1=2, mu2=1, mu3=1, delta=1)
    certify("fig1b", short, InitialState([5, 1, 2, 3, 4, 6], sigma0="random"), asks=Asks(simulation=False)).save(
        tmp_path / "c.json"
    )
    assert "every agent within" in sound(report_html(read_certificate(tmp_path / "c.json"))).text
    alone = SignedDigraph.from_edges([], [f"n{k}" for k in range(301)])
    certify(alone, NOMINAL, [*range(301)], asks=Asks(simulation=False)).save(tmp_path / "alone.json")
    assert "301 agents" in sound(report_html(read_certificate(tmp_path / "alone.json"))).text


def test_long_tables_are_cut(tmp_path: Path):
    graph = SignedDigraph.from_edges([(k, k + 1, 1) for k in range(LISTED + 9)])
    certify(graph, NOMINAL, [1] * (LISTED + 10), asks=Asks(simulation=False, method="paper")).save(tmp_path / "c.json")
    text = report_latex(read_certificate(tmp_path / "c.json"))
    assert text.count(r" \\") < LISTED + 10 and "leaves out $10$ more agents" in text


def test_every_special_character_of_latex_is_escaped():
    special = "\\{}$&#%_^~"
    for c in map(chr, range(32, 127)):
        left = latex_of_text(c)
        for known in (r"$\backslash$", "$<$", "$>$", "$|$", r"\^{}", r"\~{}", *(rf"\{s}" for s in "{}$&#%_")):
            if left == known:
                left = ""
        if left.startswith(r"{\char"):
            assert left == rf"{{\char{ord(c)}}}"
            continue
        assert left in ("", c) and (left == "" or c not in special), c
    assert latex_of_text("---") == "-{}-{}-" and latex_of_text("\u4e2d\u00e9\u00d0") == "U+4E2D\u00e9U+00D0"


# ---------------------------------------------------------------------- the command


@pytest.mark.parametrize("output", ["c.pdf", "c", "c.json", "none/c.html", "a b.tex"])
def test_what_cannot_be_written_is_refused_before_the_work(output: str, tmp_path: Path):
    example("nominal").save(tmp_path / "c.json")
    before = (tmp_path / "c.json").read_bytes()
    done = ptcc("report", str(tmp_path / "c.json"), "-o", str(tmp_path / output))
    assert done.code == 2 and len(done.err.splitlines()) == 1 and done.out == ""
    assert [p.name for p in tmp_path.iterdir()] == ["c.json"] and (tmp_path / "c.json").read_bytes() == before


def test_words_of_a_screen_are_set_and_escaped():
    assert (
        typeset("||E(T_r)|| <= 2e-07") == "\u2016E(T<sub>r</sub>)\u2016 \u2264 2\u00a0\u00d7\u00a010<sup>\u22127</sup>"
    )
    shown = "\u03bb<sub>min</sub>(\u039e<sub>F</sub> L<sub>F</sub>\u2032) &lt; \u03c1<sub>2</sub>"
    assert typeset("lmin(Xi_F L_F') < rho2") == shown


def test_a_page_does_not_replace_its_certificate(tmp_path: Path):
    example("nominal").save(tmp_path / "c.json")
    (tmp_path / "c.json").rename(tmp_path / "c.html")
    with pytest.raises(ParameterError, match="is the certificate itself"):
        write_report(tmp_path / "c.html", tmp_path / "c.html")


@pytest.mark.parametrize("content", [None, "", "{}", "\x00"])
def test_what_is_no_certificate_is_refused_in_one_line(content: str | None, tmp_path: Path):
    if content is not None:
        (tmp_path / "c.json").write_text(content)
    done = ptcc("report", str(tmp_path / "c.json"), "-o", str(tmp_path / "c.html"))
    assert done.code == 2 and len(done.err.splitlines()) == 1
    assert not (tmp_path / "c.html").exists()


def test_the_command_writes_a_page(tmp_path: Path):
    example("nominal").save(tmp_path / "c.json")
    done = ptcc("report", str(tmp_path / "c.json"), "-o", str(tmp_path / "c.html"), "--no-simulation")
    assert (done.code, done.err) == (0, "") and done.out.split() == ["certified", str(tmp_path / "c.html")]
    sound((tmp_path / "c.html").read_text(encoding="utf-8"))


@pytest.mark.usefixtures("framed_figures")
def test_the_command_names_every_file_of_a_statement(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    certify([("a", "b", -1), ("b", "a", -1)], NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), [3, 5]).save("c.json")
    run = ptcc("report", "c.json", "-o", "mine.tex")
    certified, written = run.out.splitlines()
    assert certified == "certified  mine.tex"
    assert set(written.removeprefix("written    ").split(", ")) == {path.name for path in tmp_path.glob("mine*")}
    assert len(ptcc("report", "c.json", "-o", "mine.html").out.splitlines()) == 1


_VEHICLES = {"agents": Agents(order=2, exchange="virtual")}
_LATE, _SPEED = LateMessages("0.01"), MovingLeaders("0.3")


@pytest.mark.few(3)
@pytest.mark.usefixtures("framed_figures")
@pytest.mark.parametrize(
    ("parts", "without"),
    [
        ({"limits": GainLimits(gain_cap=30)}, "without limits"),
        ({"messages": LateMessages("0.01", gain_cap=30)}, "without a gain cap, nothing late"),
        ({"leaders": _SPEED}, "leaders at rest"),
        ({"messages": _LATE, "leaders": _SPEED}, "nothing late, leaders at rest"),
        ({"messages": _LATE, "uncertainty": "10%"}, "nothing late"),
        ({**_VEHICLES, "limits": GainLimits(gain_cap=30)}, "of virtual positions, without a gain cap"),
        ({**_VEHICLES, "uncertainty": "10%"}, "of virtual positions"),
    ],
)
def test_latex_says_of_claim_bound_and_ends_what_they_are_without(parts: Any, without: str, tmp_path: Path) -> None:
    graph = SignedDigraph.from_edges([("a", "b", 1), ("b", "c", -1), ("c", "b", -1)])
    vehicles = "agents" in parts
    initial = InitialState([1, 2, 3], v0=[0, 7, -5] if vehicles else None)
    more = {} if "uncertainty" in parts else {"asks": Asks(simulation=False, method="paper")}
    certify(graph, NominalProtocol(), initial, **parts, **more).save(tmp_path / "c.json")
    saved = read_certificate(tmp_path / "c.json")
    text = report_latex(saved)
    claim = next(line for line in text.splitlines() if " occurs at " in line)
    bound = next(line for line in text.splitlines() if "very initial state" in line)
    ends = next(line for line in text.splitlines() if "The table tells where agents end" in line)
    assert all(f", {without}" in line for line in (claim, bound, ends))
    law = text.partition("where $w_{kl}")[2].partition("The stretched clock")[0]
    assert ("Here nothing is late" in law) == ("messages" in parts)
    capped = not vehicles and ("a gain cap" in without or "limits" in parts)
    assert ("the gain $g$ is limited: gain $\\le 30$" in law) == capped
    assert ("z_{k}(t) \\to" in claim) == vehicles == ("x_{k}(t) \\to" not in claim)
    assert (r"$\dot x_{k}(0)$" in text and "$-5$" in text) == vehicles
    assert ("Initial velocity" in report_html(saved)) == vehicles == ("v(0) " in "\n".join(certificate_lines(saved)))
