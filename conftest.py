"""What packages and tests share: the names of docstring examples, and campaigns that are run in turns."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from io import BytesIO, StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest


@pytest.fixture(scope="session")
def doctest_namespace() -> dict[str, Any]:
    """Return the names, those of ``ptcc_certify`` before those of ``lmi``."""
    import numpy as np

    import lmi
    import ptcc_certify

    others = (replace, Fraction, BytesIO, StringIO, Path, TemporaryDirectory)
    public = {name: getattr(package, name) for package in (lmi, ptcc_certify) for name in package.__all__}
    return {"np": np, "lmi": lmi, "ptcc": ptcc_certify, **{one.__name__: one for one in others}, **public}


def pytest_addoption(parser: pytest.Parser) -> None:
    """Offer ``--turn K/N``: of the selected tests every N-th, from the K-th on."""
    parser.addoption("--turn", default="0/1", help="K/N: run every N-th of the selected tests, from the K-th on")


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Keep those of the turn, after the selection by marker."""
    first, step = map(int, config.getoption("turn").split("/"))
    if step > 1:
        config.hook.pytest_deselected(items=[item for k, item in enumerate(items) if k % step != first % step])
        items[:] = items[first % step :: step]
