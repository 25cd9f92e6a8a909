"""Agents of order n at the command line: the screen, files, figures, the page, scenarios, and what is refused."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from bad_inputs import ptcc

CERTIFY = ("certify", "fig1a", "--method", "paper", "--T", "2", "--no-simulation")


def test_a_certificate_of_double_integrators_is_written_checked_drawn_and_shown(tmp_path: Path):
    file = str(tmp_path / "c.json")
    made = ptcc(*CERTIFY, "--agents", "double-integrator", "--dimension", "2", "--v0", "random", "-o", file)
    assert made.code == 0 and "agents     double integrators in 2 dimensions" in made.out
    assert "input      bounded; ||u_k|| <=" in made.out
    checked = ptcc("check", file)
    assert checked.code == 0 and "v(0) as in the file" in " ".join(checked.out.split())
    for what in ("motion", "formation"):
        assert ptcc("plot", file, "--what", what, "-o", str(tmp_path / f"{what}.svg")).code == 0
    refused = ptcc("plot", file, "--what", "decay", "-o", str(tmp_path / "d.png"))
    assert refused.code == 2 and "ask for --what motion or formation" in refused.err
    assert ptcc("report", file, "-o", str(tmp_path / "c.html")).code == 0
    page = (tmp_path / "c.html").read_text(encoding="utf-8")
    assert "of double integrators</h1>" in page and "single integrators" not in page
    refused = ptcc("report", file, "-o", str(tmp_path / "c.tex"))
    assert refused.code == 2 and "no statement in LaTeX" in refused.err


def test_a_scenario_tells_the_agents(tmp_path: Path):
    (tmp_path / "v.csv").write_text("node,x\n" + "".join(f"{k},{k}\n" for k in range(1, 7)))
    text = '[graph]\nfile = "fig1a"\n[agents]\nkind = "double-integrator"\ndrag = 0.2\nv0 = "v.csv"\n'
    (tmp_path / "s.toml").write_text(text + '[certificate]\nmethod = "paper"\nsimulation = false\n')
    done = ptcc("certify", str(tmp_path / "s.toml"), "--json")
    part = json.loads(done.out)["agents"]
    assert done.code == 0 and part["plant"] == ["0", "1/5"]
    assert [agent[0][1] for agent in part["initial_state"].values()] == ["1", "2", "3", "4", "5", "6"]


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--agents", "tricycle"), '--agents "tricycle" is unknown; one of integrator, double-integrator'),
        (("--v0", "1,2,3,4,5,6"), "--v0 is for agents of order n; give --agents double-integrator"),
        (("--dimension", "2"), "ptcc certify takes scalar agents, unless --agents tells others"),
        (("--agents", "2", "--decay", "2"), "not above 2 (n - 1) = 2"),
        (("--agents", "2", "--stop-before", "0.1"), "--stop-before is not proved of agents of order n"),
        (("--agents", "2", "--dimension", "2", "--x0", "1,2"), "--x0 has 2 values for 6 agents of dimension 2"),
        (("--agents", "2", "--noise", "1"), "noise is for single integrators"),
    ],
)
def test_what_does_not_fit_agents_is_refused_in_one_line(options: tuple[str, ...], says: str):
    done = ptcc(*CERTIFY, *options)
    assert done.code == 2 and says in done.err and len(done.err.strip().splitlines()) == 1
