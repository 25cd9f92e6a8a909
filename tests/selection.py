"""Which cases of a test are run by default, and which by campaigns."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest


def thinned(cases: Iterable[Any], step: int = 4) -> list[Any]:
    """Leave every ``step``-th case, from the first on, to the default run; the others belong to the campaigns.

    For ``pytest.mark.parametrize`` over many slow cases of one kind; a tuple is a case of several names.
    """
    rows = [case if isinstance(case, tuple) else (case,) for case in cases]
    return [pytest.param(*row, marks=[pytest.mark.campaign] * (k % step > 0)) for k, row in enumerate(rows)]


def every(step: int) -> pytest.MarkDecorator:
    """Call a test with ``every=step`` by default, and with ``every=1`` in the campaigns.

    For a test that takes every so many of the cases in a loop, which share what takes long to make.
    """
    return pytest.mark.parametrize("every", [step, pytest.param(1, marks=pytest.mark.campaign)])
