"""The site in ``docs/``: what its pages show is run, its links lead somewhere, and it loads nothing from elsewhere.

``python -m sphinx -W -b html docs site`` builds it, which runs the notebooks and every code cell. Then
``PTCC_SITE=site python -m pytest -m docs tests/test_site.py`` runs the commands of its pages, and looks at what was
built.
"""

from __future__ import annotations

import os
import re
import shutil
from io import StringIO
from pathlib import Path
from typing import Any

import click
import pytest
from run_blocks import blocks, check_transcripts, run_page

import lmi
import ptcc_certify
from ptcc_certify.cli import cli

pytest.importorskip("sphinx", reason="the site needs the extra docs")

from docstring_equations import literal
from local_links import faults
from reference_pages import command_page, write_reference
from sphinx.application import Sphinx

ROOT = Path(__file__).parent.parent
PAGES = sorted(page for page in (ROOT / "docs").rglob("*.md") if "generated" not in page.parts)


@pytest.fixture
def site() -> Path:
    """The built site."""
    if "PTCC_SITE" not in os.environ:
        pytest.skip("no site: set PTCC_SITE to the folder where it was built")
    return Path(os.environ["PTCC_SITE"]).resolve()


# ---------------------------------------------------------------------- pages and code


def runs_something(page: Path) -> bool:
    """Tell whether commands or Python of a page are run here: those of the list of all commands in test_readme.py."""
    return page.name != "commands.md" and bool(blocks(page.read_text(encoding="utf-8"), "sh", "python"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One folder for all pages, in their order: a review takes the certificate of the page before."""
    return tmp_path_factory.mktemp("pages")


@pytest.mark.docs
@pytest.mark.parametrize("page", [*filter(runs_something, PAGES)], ids=lambda page: page.stem)
def test_commands_and_python_of_a_page_run(page: Path, folder: Path, request, monkeypatch: pytest.MonkeyPatch):
    text = page.read_text(encoding="utf-8")
    monkeypatch.chdir(folder)
    if network := re.search(r"soc-[\w.-]+gz", text):
        published = request.getfixturevalue("real_data") / network[0]
        if not published.exists():
            pytest.skip(f"{network[0]} is not among the real graphs")
        shutil.copy(published, folder)
    run_page(text, folder)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_no_line_of_a_formula_begins_like_a_point_of_a_list(page: Path):
    apart = r"^```.*?^```|`[^`\n]*`|^\$\$.*?\$\$"
    text = re.sub(apart, "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    formulas = re.findall(r"\$[^$]+\$", text)
    assert [formula for formula in formulas if re.search(r"\n([-+*]|\d+[.)]) ", formula)] == []


@pytest.mark.few(0)
@pytest.mark.parametrize(
    "page", ["guide/answer.md", "guide/balance.md", "guide/influence.md", "guide/input.md", "guide/agents.md"]
)
def test_transcripts_are_what_ptcc_prints(page: str):
    assert check_transcripts((ROOT / "docs" / page).read_text(encoding="utf-8"))


def test_the_reference_has_every_public_name(tmp_path: Path):
    write_reference(tmp_path / "reference")
    documented = set(
        re.findall(r"^\.\. auto\w+:: (\S+)", "".join(page.read_text() for page in tmp_path.rglob("*.rst")), re.M)
    )
    assert {f"lmi.{name}" for name in lmi.__all__} <= documented
    functions = {name for name in ptcc_certify._EXPORTS if callable(getattr(ptcc_certify, name))}
    assert {f"ptcc_certify.{name}" for name in functions} <= documented
    assert {name.rpartition(".")[2] for name in documented} >= set(ptcc_certify._EXPORTS)


def test_the_page_of_the_command_line_has_every_option():
    parts = command_page().split("\n## ptcc ")
    for name, command in cli.commands.items():
        (part,) = (part for part in parts if part.startswith(f"{name}\n"))
        told = {p.opts[-1] for p in command.params if isinstance(p, click.Option) and not p.hidden}
        assert told <= set(re.findall(r"^  (?:-\w, )?(--[\w-]+)", part, re.MULTILINE))


def test_the_gallery_has_every_figure():
    gallery = (ROOT / "docs" / "gallery" / "figures.md").read_text(encoding="utf-8")
    assert [name for name in ptcc_certify.__all__ if name.startswith("plot_") and f"ptcc.{name}(" not in gallery] == []


@pytest.mark.parametrize(
    ("lines", "more"),
    [
        (["With", "", "    a + b", "    c"], 2),
        (["- a point", "", "  of two"], 0),
        (["Parameters", "---", "", "  x"], 0),
    ],
)
def test_equations_of_docstrings_are_literal(lines: list[str], more: int):
    assert len(literal(lines)) == len(lines) + more
    assert [line for line in literal(lines) if line != "::"][-1] == lines[-1]


# ---------------------------------------------------------------------- formulas and links


def built(folder: Path, text: str, *extensions: str) -> tuple[str, str]:
    """Build a site of one page with extensions of the site; return its HTML and the warnings."""
    (folder / "index.rst").write_text(f"Page\n====\n\n{text}\n", encoding="utf-8")
    warnings = StringIO()
    settings = {
        "extensions": ["formulas", "local_links", *extensions],
        "html_math_renderer": "svg",
        "html_theme": "basic",
        "suppress_warnings": ["app"],  # that a process builds several sites
    }
    app = Sphinx(folder, None, folder / "out", folder / "doctrees", "html", settings, status=None, warning=warnings)
    app.build()
    return (folder / "out" / "index.html").read_text(encoding="utf-8"), warnings.getvalue()


@pytest.mark.few(0)
def test_formulas_are_drawings_with_a_name(tmp_path: Path):
    page, warnings = built(tmp_path, r"The rate :math:`\lambda_{\min}(A)` and ``x``." + "\n\n.. math:: x' = -A x")
    assert not warnings
    assert page.count('role="img"') == 2
    assert r'aria-label="\lambda_{\min}(A)"' in page and "currentColor" in page


@pytest.mark.few(0)
@pytest.mark.parametrize(
    ("text", "warning"),
    [
        (r":math:`\nosuch a`", r"unknown command \nosuch"),
        (r":math:`\frac{a}`", "formula"),
        ("`a <#nowhere>`_", "no such anchor: #nowhere"),
        ("`a <there.html>`_", "no such file: there.html"),
        (".. raw:: html\n\n   <script src='https://example.org/a.js'></script>", "loads https://example.org/a.js"),
    ],
)
def test_a_page_with_a_fault_is_told(tmp_path: Path, text: str, warning: str):
    assert warning in built(tmp_path, text)[1]


OTHER = ":orphan:\n\nOther\n=====\n\nOne\n---\n\n.. image:: a.svg\n\n.. image:: b.svg\n   :width: 46em\n\nTwo\n---\n"


@pytest.mark.few(0)
def test_small_pictures_lead_to_their_sections(tmp_path: Path):
    (tmp_path / "other.rst").write_text(OTHER, encoding="utf-8")
    for name in ("a.svg", "b.svg"):
        (tmp_path / name).write_text('<svg xmlns="http://www.w3.org/2000/svg" width="9" height="9"/>', "utf-8")
    page, warnings = built(tmp_path, ".. thumbnails:: other\n   :figure: 2\n", "thumbnails")
    assert not warnings
    (link,) = re.findall(r'<a class="reference internal" href="other.html#one">(.*?)</a>', page)
    assert re.findall(r"<(img|span)", link) == ["img", "span"] and ">One<" in link
    assert 'src="_images/b.svg"' in link and 'alt=""' in link and "46em" not in link


@pytest.mark.few(0)
def test_a_page_without_figures_is_told_where_its_small_pictures_would_stand(tmp_path: Path):
    (tmp_path / "other.rst").write_text(":orphan:\n\nOther\n=====\n", encoding="utf-8")
    assert "no figures in the sections of other" in built(tmp_path, ".. thumbnails:: other", "thumbnails")[1]


@pytest.mark.docs
def test_the_gallery_begins_with_a_small_picture_of_every_section(site: Path):
    gallery = (site / "gallery" / "index.html").read_text(encoding="utf-8")
    for page in ("figures", "paper"):
        sections = re.findall(r"^## ", (ROOT / "docs" / "gallery" / f"{page}.md").read_text("utf-8"), re.MULTILINE)
        assert len(re.findall(rf'href="{page}.html#[^"]+"><img', gallery)) == len(sections)


@pytest.mark.docs
def test_the_built_site_has_its_figures_and_no_fault(site: Path):
    assert list(faults(site)) == []
    for page in (
        "index",
        "gallery/figures",
        "gallery/paper",
        "guide/influence",
        "how-to/actuators",
        "how-to/paper-graph",
        "how-to/uncertain-weights",
        *(f"tutorial/{one.stem}" for one in ROOT.glob("notebooks/*.ipynb")),
    ):
        html = (site / f"{page}.html").read_text(encoding="utf-8")
        assert "cell_output" in html and (
            "_images/" in html or (page == "index" and 'class="glance-narrow"' in html)
        ), page
        assert "<Figure size" not in html and "VBox(" not in html, page


@pytest.mark.docs
def test_no_request_leaves_the_site_and_no_page_is_wider_than_a_phone(site: Path, browser: Any):
    requests: list[str] = []
    page = browser.new_page(viewport={"width": 390, "height": 800})
    page.on("request", lambda request: requests.append(request.url))
    for path in sorted(site.rglob("*.html")):
        page.goto(path.as_uri())
        assert page.evaluate("document.documentElement.scrollWidth") <= 390, path
    page.goto((site / "search.html").as_uri() + "?q=overshoot")
    page.wait_for_selector("#search-results li")
    page.close()
    assert [url for url in requests if not url.startswith(("file:", "data:"))] == []
