"""Random command lines of every kind: no error of the program, and the check accepts every file that is written."""

from __future__ import annotations

from pathlib import Path

import pytest
from random_commands import KINDS, random_command, run_case

pytestmark = pytest.mark.usefixtures("quick_search")

#: Seeds of each kind by default, and in campaigns.
FEW, MANY = 1, 40
CASES = [
    pytest.param(kind, seed, marks=() if seed < FEW else pytest.mark.campaign)
    for seed in range(MANY)
    for kind in (*KINDS, "set")
]


@pytest.mark.few(0)
@pytest.mark.parametrize(("kind", "seed"), CASES)
def test_what_is_written_is_accepted_and_nothing_goes_wrong(
    kind: str, seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    run_case(kind, seed, tmp_path)


@pytest.mark.few(0)
def test_the_runs_say_something():
    """Of the commands most are no refusals, sizes go beyond what is computed exactly, and seeds give the same again."""
    sizes = [random_command(kind, seed).size for kind in KINDS for seed in range(60)]
    assert min(sizes) == 1 and sum(n > 120 for n in sizes) > 20 and sum(n <= 12 for n in sizes) > 200
    assert random_command("late", 7) == random_command("late", 7)
