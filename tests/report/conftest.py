"""What tests of pages share: the equations of a protocol are drawn once."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

import pytest

from ptcc_certify.report import notation


@pytest.fixture(scope="session", autouse=True)
def _equations_once() -> Iterator[None]:
    """Drawing them takes half of the time of a page, and depends on their LaTeX alone."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(notation, "formula_svg", cache(notation.formula_svg))
        yield
