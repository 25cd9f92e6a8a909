"""What all tests share: a hypothesis profile that repeats itself; real graphs and a browser where there are any."""

from __future__ import annotations

import gc
import os
import shutil
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

# Before NumPy is loaded: tests run side by side, where more threads only wait for each other.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

import pytest
from hypothesis import settings

from ptcc_certify.certificate import graph_certification
from ptcc_certify.lyapunov import search

# A shell lets what it runs in the background ignore Ctrl-C; tests send it to themselves and to their children.
signal.signal(signal.SIGINT, signal.default_int_handler)

settings.register_profile("repeatable", deadline=None, derandomize=True, max_examples=40)
#: ``--hypothesis-profile thorough``: other examples every time, and many.
settings.register_profile("thorough", deadline=None, max_examples=1000)
settings.load_profile("repeatable")


def pytest_collection_finish() -> None:
    """Leave what is loaded, thousands of tests and their modules, to no later search for garbage."""
    gc.freeze()
    gc.set_threshold(100_000, 20, 50)


@pytest.fixture(scope="session")
def real_data() -> Path:
    """The folder of the published graphs; the licence of the large ones is not stated, so none are kept here."""
    beside = Path(__file__).resolve().parents[1].parent / "shared" / "data" / "real"
    folder = Path(os.environ.get("PTCC_REAL_DATA", beside))
    if not folder.is_dir():
        pytest.skip(f"no real graphs: {folder} does not exist; set PTCC_REAL_DATA to their folder")
    return folder


@pytest.fixture
def framed_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pages and statements with empty frames for figures, for tests of their words: letters of figures are paths."""
    frames = {".svg": b'<svg viewBox="0 0 1 1"></svg>', ".pdf": b"%PDF"}
    for module in ("page_figures", "report_file"):
        monkeypatch.setattr(f"ptcc_certify.report.{module}.figure_bytes", lambda _, suffix: frames[suffix])


@pytest.fixture
def quick_search(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Certificates by closed forms where every class would be searched, for tests of all else: it takes a third.

    With ``--all`` every class is searched.
    """
    every = graph_certification.search_functions
    if request.config.getoption("--all"):
        return

    def closed_forms(system: Any, method: str, *more: Any) -> Any:
        return every(system, "perron" if method == "best" else method, *more)

    monkeypatch.setattr(graph_certification, "search_functions", closed_forms)


@pytest.fixture
def every_class(quick_search: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """Search every class after all, in a file whose other tests need none of that."""
    monkeypatch.setattr(graph_certification, "search_functions", search.search_functions)


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    """Chromium, driven by playwright, for what only a browser can tell of a page."""
    playwright = pytest.importorskip("playwright.sync_api", reason="no playwright: pip install playwright")
    program = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if program is None:
        pytest.skip("no Chromium: install it (apt-get install chromium)")
    with playwright.sync_playwright() as engine:
        chromium = engine.chromium.launch(executable_path=program, args=["--no-sandbox"])
        yield chromium
        chromium.close()
