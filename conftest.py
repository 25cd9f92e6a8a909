"""The names that examples in docstrings use without an import: the public ones of both packages, and a few of others."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from io import BytesIO, StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest

import lmi
import ptcc_certify


@pytest.fixture(scope="session")
def doctest_namespace() -> dict[str, Any]:
    """Return the names, those of ``ptcc_certify`` before those of ``lmi``."""
    others = (replace, Fraction, BytesIO, StringIO, Path, TemporaryDirectory)
    public = {name: getattr(package, name) for package in (lmi, ptcc_certify) for name in package.__all__}
    return {"np": np, "lmi": lmi, "ptcc": ptcc_certify, **{one.__name__: one for one in others}, **public}
