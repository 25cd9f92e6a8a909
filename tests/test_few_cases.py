"""What ``conftest.py`` leaves to ``pytest --all``, and what of it a turn takes."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
TESTS = """
import pytest

@pytest.mark.few(2)
@pytest.mark.parametrize("case", range(6))
def test_slow(case):
    pass

@pytest.mark.few(9)
@pytest.mark.parametrize("case", range(2))
def test_of_two(case):
    pass

@pytest.mark.few(0)
def test_again():
    pass

@pytest.mark.parametrize("case", range(2))
def test_quick(case):
    pass
"""
SLOW, OTHERS = [f"slow[{k}]" for k in range(6)], ["of_two[0]", "of_two[1]", "quick[0]", "quick[1]"]


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("options", "which", "left"),
    [
        ((), [SLOW[0], SLOW[3], *OTHERS], 5),
        (("-n", "2"), [SLOW[0], SLOW[3], *OTHERS], 5),
        (("--all",), [*SLOW, *OTHERS, "again"], 0),
        (("--turn", "1/4"), [SLOW[3], "quick[1]"], 5),
        (("--all", "--turn", "1/4"), [SLOW[1], SLOW[5], "quick[0]"], 0),
        (("-k", "slow and 5"), [SLOW[5]], 0),
    ],
)
def test_few_cases_run_by_default_and_the_last_lines_tell_how_many_are_left(
    options: tuple[str, ...], which: list[str], left: int, tmp_path: Path
):
    (tmp_path / "test_them.py").write_text(TESTS)
    words = ("-p", "conftest", "--rootdir", tmp_path, "-o", "markers=few(count): few", "-v", tmp_path, *options)
    done = subprocess.run([sys.executable, "-m", "pytest", *words], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert sorted(set(re.findall(r"test_them\.py::test_(\S+)", done.stdout))) == sorted(which)
    assert re.findall(r"^(\d+) more with --all$", done.stdout, re.M) == ([str(left)] if left else [])
