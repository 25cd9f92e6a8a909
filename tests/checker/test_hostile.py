"""Files made to exhaust the checkers stay within a gigabyte and ten seconds, whoever wrote them.

Every file is drawn from a seed and its number. To repeat one that failed:

    PTCC_FUZZ_SEED=0 PTCC_FUZZ_ONLY=123 python -m pytest -m "" tests/checker/test_hostile.py

``PTCC_FUZZ_COUNT`` sets how many are drawn.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from hostile_files import HOSTILE, colliding, sparse
from mutations import Json
from random_mutants import SEED, numbers, pick
from true_certificates import cases, more_cases

import ptcc_certify
from ptcc_certify.cli.proved_checker import executable
from ptcc_certify.errors import ParameterError

MEMORY, SECONDS = 10**9, 10
pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="memory is limited by the system on Linux only")


def ways() -> list[str]:
    """The checkers: that in Python, with and without other packages, and the verified one where it is built."""
    try:
        return ["reference", "stdlib", str(executable())]
    except ParameterError:
        return ["reference", "stdlib"]


@pytest.fixture(scope="module")
def worker() -> Iterator[Callable[[str, Path], Json]]:
    """Checks a file in a process of limited memory and time."""
    environment = {**os.environ, "PYTHONPATH": str(Path(ptcc_certify.__file__).parents[1])}
    script = Path(__file__).parents[1] / "hostile_worker.py"
    process = subprocess.Popen(
        [sys.executable, str(script), str(MEMORY), str(SECONDS)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=environment,
    )
    assert process.stdin and process.stdout

    def judge(way: str, path: Path) -> Json:
        print(way, path, sep="\t", file=process.stdin, flush=True)
        return json.loads(process.stdout.readline())

    yield judge
    process.stdin.close()
    process.wait(20)


def attacked(judge: Callable[[str, Path], Json], folder: Path, most: int) -> dict[str, Json]:
    """Judge hostile files by every checker; return how each answered, its largest memory and longest time."""
    found: dict[str, Json] = {way: {"codes": Counter(), "memory": (0, ""), "seconds": (0.0, "")} for way in ways()}
    beyond: list[str] = []
    for drawn in numbers(most):
        rng = np.random.default_rng([SEED, 1, drawn])
        name, data, files = pick(rng, [*cases(), *more_cases() * 3])
        files, attack = dict(files), HOSTILE[drawn % len(HOSTILE)]
        path = folder / f"{drawn}.json"
        try:  # not every certificate can be changed so
            parts = attack(rng, data, files)
        except (KeyError, TypeError, ValueError, StopIteration):
            continue
        with path.open("wb") as file:
            file.writelines(parts)
        for file_name, content in files.items():
            (folder / file_name).write_bytes(content)
        for way, worst in found.items():
            answer = judge(way, path)
            where = f"file {drawn} of seed {SEED}: {attack.__name__} of {name}, {path.stat().st_size} bytes: {answer}"
            within = answer["memory"] <= MEMORY and answer["seconds"] <= SECONDS
            if not within or answer["code"] not in (0, 1, 2, 4) or "MemoryError" in answer["said"]:
                beyond.append(f"{way}: {where}")
            worst["codes"][answer["code"]] += 1
            for key in ("memory", "seconds"):
                worst[key] = max(worst[key], (answer[key], where))
        path.unlink()
        for file_name in files:
            (folder / file_name).unlink()
    assert beyond == []
    return found


@pytest.mark.few(0)
def test_hostile_files_stay_within_a_gigabyte_and_ten_seconds(worker: Callable[[str, Path], Json], tmp_path: Path):
    attacked(worker, tmp_path, len(HOSTILE))


@pytest.mark.campaign
def test_two_thousand_hostile_files_stay_within_a_gigabyte_and_ten_seconds(
    worker: Callable[[str, Path], Json], tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    found = attacked(worker, tmp_path, 2400)
    with capsys.disabled():
        for way, worst in found.items():
            print(f"\nseed {SEED}, {way}: {worst}")


@pytest.mark.few(0)
def test_colliding_keys_and_a_matrix_of_many_nodes_cost_the_verified_checker_little(
    worker: Callable[[str, Path], Json], tmp_path: Path
):
    """Once 1 s of 15,000 keys, four times that of twice as many; and 2.5 GB of one row for 18,000 nodes."""
    try:
        program = str(executable())
    except ParameterError as error:
        pytest.skip(f"no verified checker: {error}")
    _, data, _ = cases()[0]
    keys = [one + other for one in colliding() for other in colliding()][:60_000]
    (tmp_path / "keys.json").write_text(json.dumps({**data, "unverified": dict.fromkeys(keys, 0)}))
    (many,) = sparse(np.random.default_rng(8), data, {})
    assert b'"15000"' in many
    (tmp_path / "nodes.json").write_bytes(many)
    for name, code in (("keys.json", 0), ("nodes.json", 1)):
        answer = worker(program, tmp_path / name)
        assert answer["code"] == code and answer["memory"] < 2 * 10**8 and answer["seconds"] < 3, answer


def test_what_the_verified_checker_would_need_more_for_ends_in_one_line(tmp_path: Path):
    try:
        program = executable()
    except ParameterError as error:
        pytest.skip(f"no verified checker: {error}")
    (tmp_path / "c.json").write_text('{"schema": "ptcc-certificate/3", "unverified": [' + "1," * 1_000_000 + "1]}")
    for words in (["--memory", "0.05"], ["--memory", "0.001"]):
        run = subprocess.run([program, *words, tmp_path / "c.json"], capture_output=True, text=True, check=False)
        assert run.returncode == 2 and run.stdout == "" and run.stderr.count("\n") == 1, run
        assert "allow more by --memory" in run.stderr
    for words in (["--memory", "0"], ["--memory", "-1"], ["--memory", "nan"], ["--memory"]):
        run = subprocess.run([program, *words, tmp_path / "c.json"], capture_output=True, text=True, check=False)
        assert run.returncode == 2 and run.stderr.startswith("usage") and run.stderr.count("\n") == 1, run
