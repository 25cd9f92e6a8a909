"""What a reader meets who opens a page in a browser, or prints it: nothing is cut off, faint, or fetched."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from generators import sparse_digraph
from report_examples import MADE, NOMINAL, forged, nominal, undecided

from ptcc_certify import Expectations, Family, NominalProtocol, SignedDigraph, certify
from ptcc_certify.model.asks import Asks
from ptcc_certify.report.report_file import write_report

pytestmark = pytest.mark.browser

WIDTHS = (390, 768, 1280)
#: Pixels between the margins of an A4 sheet.
SHEET = 695
#: Ratio of luminances of every element that holds text of its own, to the ground that is painted behind it.
CONTRASTS = """() => {
  const channels = colour => colour.match(/[0-9.]+/g).map(Number);
  const linear = c => c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4;
  const luminance = rgb => rgb.slice(0, 3).map(c => linear(c / 255))
    .reduce((sum, c, k) => sum + c * [0.2126, 0.7152, 0.0722][k], 0);
  const painted = element => {
    for (let e = element; e; e = e.parentElement) {
      const ground = channels(getComputedStyle(e).backgroundColor);
      if (ground.length < 4 || ground[3] > 0) return ground;
    }
    return [255, 255, 255];
  };
  return [...document.querySelectorAll("body *")]
    .filter(e => [...e.childNodes].some(n => n.nodeType === 3 && n.textContent.trim())
      || e.getAttribute("fill") === "currentColor")
    .map(e => {
      const pair = [luminance(channels(getComputedStyle(e).color)), luminance(painted(e))].sort((a, b) => b - a);
      return [(pair[0] + 0.05) / (pair[1] + 0.05), e.textContent.slice(0, 40)];
    });
}"""
#: Elements that reach beyond the sides of the screen, and tables that would have to be moved to be read.
BEYOND = """() => [...document.querySelectorAll("body *")]
  .filter(e => e.getBoundingClientRect().width)
  .filter(e => e.getBoundingClientRect().left < -1 || e.getBoundingClientRect().right > innerWidth + 1)
  .filter(e => !e.closest("svg") && !e.closest("thead") && !e.closest(".scroll, .equations"))
  .concat([...document.querySelectorAll(".scroll, .equations")].filter(e => e.scrollWidth > e.clientWidth + 1))
  .map(e => e.tagName + ": " + e.textContent.slice(0, 60))"""


def long_labels() -> Any:
    names = ["alpha" + "x" * 80, "a long name of an agent that says what it does", "b" * 300, "c", "d e f " * 40]
    edges = [(names[k - 1], names[k], -1) for k in range(5)]
    protocol = NominalProtocol(T="1/3", rho1="100000000000000000001/22539340290692258087863249", rho2=1, kappa=2)
    return certify(
        SignedDigraph.from_edges(edges), protocol, [f"{k}00001/700003" for k in range(5)], asks=Asks(simulation=False)
    )


def right_to_left() -> Any:
    names = ["\u05e9\u05dc\u05d5\u05dd", "\u05e2\u05d5\u05dc\u05dd", "\u0645\u0631\u062d\u0628\u0627", "(1)", "a"]
    edges = [(names[k - 1], names[k], 1 - 2 * (k % 2)) for k in range(5)]
    return certify(SignedDigraph.from_edges(edges), NOMINAL, [1, 2, 3, 4, 5], asks=Asks(simulation=False))


def large() -> Any:
    graph = sparse_digraph(np.random.default_rng(2), 2_000, 1.2)
    return certify(graph, NOMINAL, list(range(2_000)), asks=Asks(simulation=False, method="perron"))


def family() -> Any:
    names = ["alpha" + "x" * 80, "a long name of an agent", "<c>", "d"]
    ring = SignedDigraph.from_edges([(names[k - 1], names[k], 1 - 2 * (k == 0)) for k in range(4)])
    unsure = Family.from_graph(ring, uncertainty="20%")
    return certify(Family.switching({"a long name of a mode" * 3: unsure, "night": ring}), NOMINAL, [1, 2, 3, "1/7"])


def refuted_family() -> Any:
    unsure = Family.from_graph(SignedDigraph.from_edges([("a", "b", 1), ("b", "c", -1)]), optional=[("b", "c")])
    return certify(unsure, NOMINAL, [1, 2, 3], asks=Asks(expectations=Expectations("stability")))


def rejected(folder: Path) -> Path:
    made = nominal()
    made.save(folder / "c.json")
    return forged(folder, rates={"proved": str(2 * made.rate)})


CERTIFIED = {name: MADE[name] for name in ("nominal", "sliding", "disconnected")}
CERTIFIED |= {"long labels": long_labels, "right to left": right_to_left, "large": large}
FAMILIES = {"family": family, "refuted family": refuted_family}
CERTIFIED |= FAMILIES
NAMES = (*CERTIFIED, "undecided", "rejected")


@pytest.fixture(scope="module")
def page_file(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Return what writes the page of a name, once."""

    @cache
    def written(name: str) -> Path:
        folder = tmp_path_factory.mktemp("page")
        if name in CERTIFIED:
            CERTIFIED[name]().save(folder / "c.json")
        else:
            {"undecided": undecided, "rejected": rejected}[name](folder)
        said = name.partition(" ")[0] if name in (*NAMES[-2:], "refuted family") else "certified"
        assert write_report(folder / "c.json", folder / "c.html") == said
        return folder / "c.html"

    return written


@pytest.mark.parametrize("name", NAMES)
def test_a_page_is_as_wide_as_the_screen_or_the_sheet(name: str, page_file: Any, browser: Any):
    for width in (*WIDTHS, SHEET):
        page = browser.new_page(viewport={"width": width, "height": 800})
        page.emulate_media(media="print" if width == SHEET else "screen")
        page.goto(page_file(name).as_uri())
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        assert page.evaluate(BEYOND) == [], width
        page.close()


@pytest.mark.parametrize("name", NAMES)
def test_a_page_asks_for_nothing_and_complains_of_nothing(name: str, page_file: Any, browser: Any):
    page, requests, complaints = browser.new_page(), [], []
    page.on("request", lambda request: requests.append(request.url))
    page.on("console", lambda message: complaints.append(message.text))
    page.goto(page_file(name).as_uri(), wait_until="networkidle")
    assert requests == [page_file(name).as_uri()] and complaints == []
    page.close()


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("name", NAMES)
def test_text_stands_out_from_its_ground(name: str, scheme: str, page_file: Any, browser: Any):
    """By 4.5 to 1 (WCAG 2), as the browser computes the colours."""
    page = browser.new_page(color_scheme=scheme)
    page.goto(page_file(name).as_uri())
    contrasts = page.evaluate(CONTRASTS)
    assert len(contrasts) > 10 and min(contrasts)[0] >= 4.5, min(contrasts)
    page.close()


@pytest.mark.parametrize("name", [name for name in NAMES if name not in FAMILIES])
def test_the_first_screen_holds_the_answer(name: str, page_file: Any, browser: Any):
    page = browser.new_page(viewport={"width": 1280, "height": 800})
    page.goto(page_file(name).as_uri())
    parts = ["h1", ".verdict"] if name == "rejected" else ["h1", ".verdict", ".answer div:has(dt:text-is('Input'))"]
    for part in parts:
        box = page.locator(part).bounding_box()
        assert box["y"] >= 0 and box["y"] + box["height"] <= 800, part
    answer = page.locator("main").inner_text()
    shown = ["What they do", "Where they end", "How near", "Input", "Certificate"]
    if name == "undecided":
        shown.remove("Where they end")
    entries = [text for text in page.locator(".answer dt").all_inner_texts() if text != "Why that says little"]
    assert entries == ([] if name == "rejected" else shown)
    assert re.search("written on [0-9]{4}-[0-9]{2}-[0-9]{2} by ptcc-certify [0-9]", answer)
    assert ("What this means" in answer) == (name == "rejected")
    page.close()


@pytest.mark.parametrize("name", FAMILIES)
def test_the_first_screen_of_a_family_holds_the_answer(name: str, page_file: Any, browser: Any):
    page = browser.new_page(viewport={"width": 1280, "height": 900})
    page.goto(page_file(name).as_uri())
    for part in ("h1", ".verdict", ".answer div:has(dt:text-is('Input'))"):
        box = page.locator(part).bounding_box()
        assert box["y"] >= 0 and box["y"] + box["height"] <= 900, part
    page.close()


@pytest.mark.parametrize("name", NAMES)
def test_a_page_prints_on_four_sheets_without_a_row_cut(name: str, page_file: Any, browser: Any):
    page = browser.new_page()
    page.goto(page_file(name).as_uri())
    sheets = len(re.findall(rb"/Type\s*/Page\b", page.pdf(prefer_css_page_size=True)))
    assert 1 <= sheets <= 4
    page.emulate_media(media="print")
    kept = page.evaluate("[...document.querySelectorAll('tr, figure')].map(e => getComputedStyle(e).breakInside)")
    assert set(kept) <= {"avoid"} and (kept or name == "rejected")
    assert all(table.is_visible() for table in page.locator("table").all())
    page.close()


def test_a_reader_without_sight_hears_the_formulas_and_the_figures(page_file: Any, browser: Any):
    page = browser.new_page()
    page.goto(page_file("sliding").as_uri())
    assert page.get_by_role("img").count() == page.locator("svg:visible").count() >= 6
    assert page.get_by_role("img", name=r"\begin{aligned}").count() == 1
    assert page.get_by_role("img", name="Sliding variables").count() == 1
    assert page.get_by_role("table", name="Whatever the disturbance").count() == 1
    page.close()
