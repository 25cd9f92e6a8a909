"""Facts about ``ptcc simulate`` of families: one run under one signal, and what is refused."""

from __future__ import annotations

import csv
from itertools import pairwise
from pathlib import Path

import pytest
from bad_inputs import ptcc

pytestmark = pytest.mark.usefixtures("quick_search")

FAMILY = ("simulate", "day.csv", "night.csv", "--switching", "--x0", "1,2,3")


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("day.csv").write_text("a,b,1\nb,c,-1\n")
    Path("night.csv").write_text("c,a,-2\na,b,1\n")
    return tmp_path


def test_a_table_tells_which_graph_acts_when():
    Path("signal.csv").write_text("t,mode\n0,night\n0.5,day\n")
    run = ptcc(*FAMILY, "--signal", "signal.csv", "--steps", "4")
    rows = list(csv.DictReader(run.out.splitlines()))
    assert [float(row["mode"]) for row in rows] == [2, 2, 2, 1, 1]
    assert float(rows[0]["c"]) == float(rows[2]["c"]) == 3 != float(rows[3]["c"])  # nobody moves c at night
    assert run.code == 0


def test_the_seed_of_a_random_signal_tells_the_run():
    runs = [ptcc(*FAMILY, "--signal", "random", "--seed", seed, "--steps", "2").out for seed in ("1", "1", "2")]
    assert runs[0] == runs[1] != runs[2]


def test_a_random_signal_keeps_a_dwell_time():
    rows = csv.DictReader(ptcc(*FAMILY, "--dwell", "0.3", "--seed", "3", "--steps", "200").out.splitlines())
    modes = [(float(row["t"]), row["mode"]) for row in rows]
    changes = [t for (_, before), (t, after) in pairwise(modes) if before != after]
    assert changes
    assert all(b - a > 0.29 for a, b in pairwise([0, *changes]))


def test_a_family_slides_under_disturbances():
    sliding = ("--protocol", "sliding-mode", "--sigma0", "1,0.5,-1", "--disturbance", "sin(9*k*t)")
    rows = list(csv.DictReader(ptcc(*FAMILY, *sliding, "--steps", "4").out.splitlines()))
    assert [float(row["sigma(a)"]) > 0 for row in rows] == [True, True, False, False, False]  # 0 at T_r = 1/2
    assert [float(row["a"]) for row in rows[-1:]] == pytest.approx([-float(rows[-1]["c"])], abs=1e-8)


def test_figures_of_families_are_drawn():
    assert ptcc(*FAMILY, "--signal", "worst-case", "-o", "run.png").code == 0
    assert Path("run.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ((*FAMILY, "--signal", "dusk.csv"), "dusk.csv: no such file"),
        ((*FAMILY, "--dimension", "2"), "--dimension is for one graph"),
        ((*FAMILY, "--gain-cap", "5"), "--gain-cap is for one graph"),
        ((*FAMILY, "--noise", "5"), "--noise is for one graph"),
        ((*FAMILY, "--delta", "5"), "--delta is for one graph"),
        (("plot", *FAMILY[1:], "--what", "states", "--gain-cap", "5", "-o", "x.png"), "--gain-cap is for one graph"),
        (("simulate", "day.csv", "--leader-speed", "0", "--noise", "1"), "is not simulated with leaders at rest"),
        ((*FAMILY, "--dwell", "0.1", "--clock-dwell", "0.1"), "give one of them"),
        ((*FAMILY, "--dwell", "0.1", "--signal", "worst-case"), "leave out --signal worst-case"),
        (("simulate", "day.csv", "--dwell", "0.1"), "--dwell is for families of graphs"),
        (("simulate", "day.csv", "night.csv"), "add --switching"),
        (("simulate", "day.csv", "--signal", "random"), "--signal is for families"),
    ],
)
def test_what_does_not_fit_is_refused_in_one_line(words: tuple[str, ...], told: str):
    run = ptcc(*words)
    assert run.code == 2
    assert told in run.err
    assert run.err.count("\n") == 1
