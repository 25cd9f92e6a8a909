"""What packages and tests share: names of docstring examples, few cases of slow tests by default, runs in turns."""

from __future__ import annotations

import os
import sys
from dataclasses import replace
from fractions import Fraction
from io import BytesIO, StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest

# Compiled files are kept, whatever the shell says: else every process of a test compiles the sources again, and
# pytest rewrites all assertions in every run.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False


@pytest.fixture(scope="session")
def doctest_namespace() -> dict[str, Any]:
    """Return the names, those of ``ptcc_certify`` before those of ``lmi``."""
    import numpy as np

    import lmi
    import ptcc_certify

    others = (replace, Fraction, BytesIO, StringIO, Path, TemporaryDirectory)
    public = {name: getattr(package, name) for package in (lmi, ptcc_certify) for name in package.__all__}
    return {"np": np, "lmi": lmi, "ptcc": ptcc_certify, **{one.__name__: one for one in others}, **public}


#: How many cases are left to ``--all``.
LEFT_OUT = pytest.StashKey[int]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Offer ``--all``, every case of tests marked ``few``, and ``--turn K/N``: of the selected tests every N-th."""
    parser.addoption("--all", action="store_true", help="run every case of the tests of which few run by default")
    parser.addoption("--turn", default="0/1", help="K/N: run every N-th of the selected tests, from the K-th on")


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out what ``--all`` adds, then what is not of the turn, after the selection by marker."""
    rest = set() if config.getoption("all") else _left_out(items)
    config.stash[LEFT_OUT] = len(rest)
    if hasattr(config, "workeroutput"):  # a process of pytest-xdist
        config.workeroutput["left_out"] = len(rest)
    first, step = map(int, config.getoption("turn").split("/"))
    kept = [item for item in items if item not in rest][first % step :: step]
    if len(kept) < len(items):
        config.hook.pytest_deselected(items=list(set(items).difference(kept)))
        items[:] = kept


def _left_out(items: list[pytest.Item]) -> set[pytest.Item]:
    """Return of every test that is marked ``few(count)`` all cases but so many, spread from the first on.

    Cases of campaigns are none of these: where they are selected, all of them run.
    """
    tests: dict[str, list[pytest.Item]] = {}
    for item in items:
        if item.get_closest_marker("campaign") is None:
            tests.setdefault(item.nodeid.partition("[")[0], []).append(item)
    rest: set[pytest.Item] = set()
    for cases in tests.values():
        if (mark := cases[0].get_closest_marker("few")) is not None:
            count = min(mark.args[0], len(cases))
            rest |= set(cases).difference(cases[k * len(cases) // count] for k in range(count))
    return rest


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any) -> None:
    """Keep what a process of pytest-xdist left out; each has collected all tests."""
    node.config.stash[LEFT_OUT] = getattr(node, "workeroutput", {}).get("left_out", 0)


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    """Tell how many cases there are besides."""
    if more := config.stash.get(LEFT_OUT, 0):
        terminalreporter.write_line(f"{more} more with --all")
