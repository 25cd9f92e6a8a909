"""Agents of order n at the command line: the screen, files, figures, the page, scenarios, and what is refused."""

from __future__ import annotations

import csv
import io
import json
import re
import shlex
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bad_inputs import ptcc

import ptcc_certify

pytestmark = pytest.mark.usefixtures("framed_figures")

CERTIFY = ("certify", "fig1a", "--method", "paper", "--T", "2", "--no-simulation")


def test_a_certificate_of_double_integrators_is_written_checked_drawn_and_shown(tmp_path: Path):
    file = str(tmp_path / "c.json")
    made = ptcc(*CERTIFY, "--agents", "double-integrator", "--dimension", "2", "--v0", "random", "-o", file)
    assert made.code == 0 and "agents     double integrators in 2 dimensions" in made.out
    assert "input      bounded; ||u_k|| <=" in made.out
    checked = ptcc("check", file)
    assert checked.code == 0 and "v(0) as in the file" in " ".join(checked.out.split())
    for what in ("motion", "formation", "input"):
        assert ptcc("plot", file, "--what", what, "-o", str(tmp_path / f"{what}.svg")).code == 0
    refused = ptcc("plot", file, "--what", "decay", "-o", str(tmp_path / "d.png"))
    assert refused.code == 2 and "ask for --what motion or formation or input" in refused.err
    assert ptcc("report", file, "-o", str(tmp_path / "c.html")).code == 0
    page = (tmp_path / "c.html").read_text(encoding="utf-8")
    assert "of double integrators at T = " in page and "agents are single integrators" not in page
    assert ptcc("report", file, "-o", str(tmp_path / "c.tex")).code == 0
    statement = (tmp_path / "c.tex").read_text(encoding="utf-8")
    assert "Let the agents be double integrators: in each" in statement and r"\dot x_{k} = u_{k}" not in statement


def test_single_integrators_under_a_gain_cap_are_those_of_the_plain_command():
    case = (*CERTIFY, "--gain-cap", "4")
    assert ptcc(*case, "--agents", "integrator").out == ptcc(*case).out


def test_single_integrators_in_places_under_a_gain_cap_have_the_bounds_of_the_plain_command(tmp_path: Path):
    """Bounds are those of ``x0 - h``, in all lines; where agents begin and end is told with the places."""
    table = tmp_path / "ring.csv"
    table.write_text("source,target,weight\na,b,1\nb,c,1\nc,d,-1\nd,a,-1\n")
    case = ("certify", str(table), "--T", "2", "--rho1", "1", "--rho2", "2", "--kappa", "1", "--gain-cap", "4")
    file, page = tmp_path / "p.json", tmp_path / "p.html"
    ours = ptcc(*case, "--x0", "5,2,4,-1", "--offsets", "1,-3,2,2", "-o", str(file))
    plain = ptcc(*case, "--x0", "4,5,2,-3")
    assert ours.code == plain.code == 0 and "of x - offsets" in ours.out
    for head in ("error", "input", "verdict"):
        lines = [[line for line in one.out.splitlines() if line.startswith(head)] for one in (ours, plain)]
        assert lines[0] == lines[1] and lines[0], head
    assert "x(T)       a=4.5, b=0.5, c=5.5, d=-1.5 (exact; without limits)" in ours.out
    assert ptcc("check", str(file)).code == 0 and ptcc("report", str(file), "-o", str(page)).code == 0
    text = page.read_text(encoding="utf-8")
    assert "of x - offsets" in text and "Place h" in text
    assert "less its place h" in text
    written = ptcc("report", str(file), "-o", str(tmp_path / "p.tex"))
    assert written.code == 0 and "z_{k} = x_{k} - h_{k}" in (tmp_path / "p.tex").read_text()
    assert ptcc("plot", str(file), "--what", "states", "-o", str(tmp_path / "s.png")).code == 0
    run = ptcc("simulate", *case[1:], "--x0", "5,2,4,-1", "--offsets", "1,-3,2,2")
    first = [float(x) for x in run.out.splitlines()[1].split(",")[2:6]]
    assert run.code == 0 and first == pytest.approx([5, 2, 4, -1], abs=1e-12)
    drawn = ("plot", *case[1:], "--x0", "5,2,4,-1", "--offsets", "1,-3,2,2", "--what", "motion")
    assert ptcc(*drawn, "-o", str(tmp_path / "m.png")).code == 0


@pytest.mark.few(0)
@pytest.mark.parametrize(
    "limits",
    [
        ("--stop-before", "0.1"),
        ("--gain-cap", "4", "--stop-before", "0.1"),
        ("--sample-period", "0.01"),
        ("--noise", "0.1", "--gain-cap", "4"),
        ("--delta", "1", "--disturbance", "sin(k*t)"),
        ("--delay", "0.05"),
        ("--leader-speed", "0.5"),
        ("--protocol", "sliding-mode", "--sigma0", "1,0,-2,1"),
        ("--biases", "0,0,0,0"),
    ],
)
def test_formations_run_as_their_states_less_places_do(limits: tuple[str, ...], tmp_path: Path):
    """Whatever limits the gain or acts on a run: positions are those of the run from ``x0 - h``, and ``h``."""
    table = tmp_path / "path.csv"
    table.write_text("source,target,weight\na,b,1\nb,c,-2\nc,d,1\nd,b,-1\n")
    ours = ptcc("simulate", str(table), "--x0", "5,2,4,-1", "--offsets", "1,-3,2,2", *limits)
    plain = ptcc("simulate", str(table), "--x0", "4,5,2,-3", *[x for x in limits if x not in ("--biases", "0,0,0,0")])
    assert ours.code == plain.code == 0, ours.err
    heads = ours.out.splitlines()[0].split(",")
    assert heads == plain.out.splitlines()[0].split(",")
    own, other = (np.loadtxt(one.out.splitlines()[1:], delimiter=",") for one in (ours, plain))
    places = dict(zip("abcd", (1, -3, 2, 2), strict=True))
    shift = [places.get(head.removeprefix("target(").removesuffix(")"), 0) for head in heads]
    shift = [0 if head.startswith(("u(", "sigma(")) else x for head, x in zip(heads, shift, strict=True)]
    assert own == pytest.approx(other + np.array(shift), abs=1e-12)


def test_a_certificate_of_places_alone_is_drawn_from_positions(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """What ``--x0`` gives to a certificate without an initial state is where agents begin, as it is to ``certify``."""
    protocol = ptcc_certify.NominalProtocol(T=1, rho1=1, rho2=2, kappa=1)
    agents = ptcc_certify.Agents(order=1, offsets=[1, 2, 3, 4, 5, 9])
    ptcc_certify.certify("fig1a", protocol, agents=agents).save(tmp_path / "c.json")
    drawn: list[Any] = []
    monkeypatch.setattr("ptcc_certify.cli.plot._draw", lambda what, subject, *_: drawn.append(subject))
    monkeypatch.setattr("ptcc_certify.report.plots.style.save_figure", lambda *_: None)
    assert ptcc("plot", str(tmp_path / "c.json"), "--x0", "6,5,4,3,2,1", "--what", "states").code == 0
    assert drawn[0].trajectory.positions[:, 0] == pytest.approx([6, 5, 4, 3, 2, 1], rel=1e-12)


@pytest.mark.few(0)
@pytest.mark.parametrize("what", ["states", "motion", "input", "decay"])
def test_figures_of_a_formation_take_limits_of_the_gain(what: str, tmp_path: Path):
    case = ("plot", "fig1a", "--offsets", "1,2,3,4,5,6", "--what", what, "-o", str(tmp_path / "f.png"))
    limits = () if what == "decay" else ("--stop-before", "0.1", "--gain-cap", "9")
    drawn = ptcc(*case, *limits)
    assert drawn.code == 0 and (tmp_path / "f.png").stat().st_size > 0, drawn.err


@pytest.mark.few(0)
def test_a_limit_of_the_input_that_is_exceeded_at_first_is_refuted():
    done = ptcc(*CERTIFY, "--agents", "double-integrator", "--max-input", "1")
    assert done.code == 3 and "refuted: |u_k| <= 1 (it is up to" in done.out and "at the start, proved" in done.out
    told = ptcc(*CERTIFY, "--agents", "double-integrator", "--dimension", "2", "--max-input", "1e9")
    assert told.code == 0 and "met: ||u_k|| <= 1000000000" in told.out


@pytest.mark.few(0)
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
        (("--agents", "tricycle"), '--agents: "tricycle" is unknown; one of integrator, double-integrator'),
        (("--v0", "1,2,3,4,5,6"), "--v0: is for agents of order n; give --agents double-integrator"),
        (("--dimension", "2"), "ptcc certify takes single integrators of one component"),
        (("--agents", "integrator", "--dimension", "2"), "ptcc certify takes single integrators of one component"),
        (("--agents", "1", "--gain-cap", "4", "--v0", "1,2,3,4,5,6"), "--v0: agents of order 1 have no velocity"),
        (("--agents", "2", "--decay", "2"), "not above 2 (n - 1) = 2"),
        (("--agents", "2", "--stop-before", "0.1"), "--stop-before: is not proved of agents of order n"),
        (("--agents", "2", "--dimension", "2", "--x0", "1,2"), "--x0 has 2 values for 6 agents of dimension 2"),
        (("--agents", "2", "--noise", "1"), "--noise: is not proved of agents of order n"),
        (("--agents", "2", "--dimension", "-1"), "-1 is not in the range"),
        (("--agents", "2", "--dimension", "1e30"), "not a valid integer"),
        (("--agents", "2", "--a0", "1,2,3,4,5,6"), "--a0: agents of order 2 have no acceleration"),
        (("--agents", "2", "--initial-bound", "3"), "--initial-bound: is not proved of agents of order n"),
        (("--agents", "9"), "or an order from 1 to 8"),
        *(
            (("--agents", "2", "--dimension", "2", "--delay", "0.01", *more), "--dimension: " + what)
            for more, what in (
                ((), "late messages and leaders that move take one coordinate at a time"),
                (("--exchange", "virtual"), "vehicles that exchange virtual positions take one coordinate at a time"),
            )
        ),
    ],
)
def test_what_does_not_fit_agents_is_refused_in_one_line(options: tuple[str, ...], says: str):
    done = ptcc(*CERTIFY, *options)
    assert done.code == 2 and says in done.err and len(done.err.strip().splitlines()) == 1


def _scenario(folder: Path, text: str) -> str:
    path = folder / "team.toml"
    path.write_text(f'[graph]\nfile = "fig1a"\n{text}')
    return str(path)


def test_a_simulated_run_of_agents_has_columns_of_velocities_and_ends_where_certify_says():
    begin = ("fig1a", "--agents", "2", "--x0", "5,2,-4,3,-2,1", "--v0", "1,2,3,4,5,6")
    rows = list(csv.reader(io.StringIO(ptcc("simulate", *begin, "--samples", "2").out)))
    part = json.loads(ptcc("certify", *begin, "--no-simulation", "--json").out)["agents"]
    ends = [agent[0] for agent in part["final_state"].values()]
    assert rows[0][8:14] == [f"v({k})" for k in range(1, 7)]
    for i in range(2):
        proved = [float(Fraction(chain[i])) for chain in ends]
        assert np.allclose([float(x) for x in rows[-1][2 + 6 * i : 8 + 6 * i]], proved, rtol=0, atol=1e-9)


@pytest.mark.few(0)
def test_a_simulated_run_has_the_gains_that_certify_proves_under_the_same_method():
    begin = ("fig1a", "--agents", "2", "--x0", "5,2,-4,3,-2,1")
    runs = {}
    for method in ("paper", "best"):
        cert = json.loads(ptcc("certify", *begin, "--method", method, "--no-simulation", "--json").out)["agents"]
        rows = list(csv.reader(io.StringIO(ptcc("simulate", *begin, "--method", method, "--samples", "2").out)))
        runs[method] = ([float(Fraction(K)) for K in cert["gains"]], [float(x) for x in rows[1][-6:]])
    (paper, u), (best, other) = runs["paper"], runs["best"]
    assert paper[0] != best[0]
    # At rest the input is the first gain times what is the same in both.
    assert np.allclose(np.array(u) * best[0], np.array(other) * paper[0])


@pytest.mark.parametrize(
    ("command", "options", "says"),
    [
        (
            "simulate",
            ("--exchange", "virtual", "--gain-cap", "20", "--delay", "0.01", "--steps", "5"),
            "--steps: these runs have instants of their own",
        ),
        (
            "simulate",
            ("--boundary-layer", "1", "--protocol", "sliding-mode"),
            "--boundary-layer: is for single integrators",
        ),
        ("simulate", ("--disturbance", "none"), "--disturbance: agents of order n run without"),
        ("plot", ("--what", "decay"), "--what decay: is not drawn of agents of order n"),
        ("plot", ("--what", "formation"), "--what formation: is drawn in the plane; add --dimension 2"),
    ],
)
def test_what_is_not_run_or_drawn_of_agents_is_refused(command: str, options: tuple[str, ...], says: str):
    done = ptcc(command, "fig1a", "--agents", "2", *options)
    assert done.code == 2 and says in done.err and len(done.err.strip().splitlines()) == 1


def test_a_figure_of_agents_is_drawn_of_a_certificate_and_of_a_graph(tmp_path: Path):
    saved = tmp_path / "team.json"
    ptcc(*CERTIFY, "--agents", "2", "--no-simulation", "-o", str(saved))
    for index, subject in enumerate(
        ((str(saved),), ("fig1a", "--agents", "2", "--what", "motion", "--method", "paper"))
    ):
        figure = tmp_path / f"{index}.svg"
        assert ptcc("plot", *subject, "-o", str(figure)).code == 0 and figure.stat().st_size


def test_design_takes_a_scenario_of_agents_and_prints_the_command_that_proves_it_again(tmp_path: Path):
    text = (
        '[agents]\nkind = "double-integrator"\nv0 = [1, 0, 0, 0, 0, -1]\n[initial_state]\nx0 = [5, 2, -4, 3, -2, 1]\n'
    )
    text += "[expectations]\nmax_input = 30\n[design]\nshortest_deadline = true\n[limits]\nstop_before = 0.1\n"
    scenario, saved = _scenario(tmp_path, text), tmp_path / "d.json"
    done = ptcc("design", scenario, "-o", str(saved))
    assert done.code == 0 and "verdict    met: ||u_k|| <= " in done.out and "not by these bounds" in done.out
    assert "not designed for" in done.out and "[limits] stop_before" in " ".join(done.out.split())
    command = done.out.split("to prove it again:")[1].replace("\\\n", " ").split()
    again = ptcc(*command[1:], "--no-simulation")
    assert again.code == 0 and "verdict    met: |u_k| <= 30" in again.out
    (law,) = re.findall(r"; (u = \S+ g\^2 e \+ \S+ g e')", " ".join(done.out.split()))
    assert law in " ".join(again.out.split())
    assert ptcc("check", str(saved)).code == 0
    assert json.loads(saved.read_text())["unverified"]["scenario"]["design"] == {"shortest_deadline": True}


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--agents", "2"), "design needs --max-input U and one of --deadline T, --shortest-deadline"),
        (("--agents", "2", "--initial-bound", "1"), "--initial-bound: is not proved of agents of order n; bounds"),
        (("--agents", "2", "--curve", "c.csv"), "--curve: is drawn of single integrators; leave it out"),
        (("--agents", "2", "--input-norm", "2"), "--input-norm: is of single integrators"),
        (("--agents", "2", "--decay", "3"), "decay: below 2 n = 4 no input is proved to be bounded"),
        (("--agents", "2", "--residual", "1"), "residual: nothing is left at T without a gain cap"),
        (("--agents", "2", "--gain-cap", "9"), "--gain-cap: leaves something at every deadline; give --residual,"),
        (("--agents", "2", "--delta", "1"), "--delta: is not proved of agents of order n under the nominal"),
        (("--initial-bound", "1", "--protocol", "sliding-mode"), "--protocol: is not searched for single integrators"),
        (
            ("--initial-bound", "1", "--x0", "1,2"),
            "--x0: single integrators are designed for all states within a bound",
        ),
        (("--initial-bound", "1", "--v0", "1,2"), "--v0: is for agents of order n"),
    ],
)
def test_what_design_does_not_search_of_agents_is_refused_in_one_line(options: tuple[str, ...], says: str):
    asked = () if "needs" in says else ("--max-input", "30", "--shortest-deadline")
    done = ptcc("design", "fig1a", *options, *asked)
    assert done.code == 2 and says in done.err and len(done.err.splitlines()) == 1


@pytest.mark.few(1)
@pytest.mark.parametrize("plant", ["[0, 0.1]", '"0,0.1"'])
def test_a_scenario_lists_the_plant(tmp_path: Path, plant: str):
    text = f'[agents]\nkind = "double-integrator"\nplant = {plant}\n[certificate]\nmethod = "paper"\nsimulation = false'
    document = json.loads(ptcc("certify", _scenario(tmp_path, text), "--json").out)
    assert document["agents"]["plant"] == ["0", "1/10"]


@pytest.mark.few(0)
def test_nothing_that_is_rounded_is_called_exact():
    done = ptcc("certify", "fig1b", "--method", "paper", "--agents", "2", "--drag", "0.2", "--no-simulation")
    (line,) = [line for line in done.out.splitlines() if line.startswith("v(T)")]
    assert "(rounded)" in line


def test_the_page_writes_a_vector_in_one_cell(tmp_path: Path):
    saved, page = tmp_path / "team.json", tmp_path / "team.html"
    state = ",".join(map(str, range(12)))
    ptcc(*CERTIFY, "--agents", "2", "--dimension", "2", "--x0", state, "--gain-cap", "20", "-o", str(saved))
    assert ptcc("report", str(saved), "-o", str(page)).code == 0
    text = page.read_text(encoding="utf-8")
    assert "(10, 11)" in text and "\N{DOUBLE VERTICAL LINE}u\N{DOUBLE VERTICAL LINE} at most" in text
    assert "fall like" not in text  # which they do under an unlimited gain alone


CASCADE = '[agents]\nkind = "double-integrator"\ncascade = {alpha}\n[protocol]\nT = 2\nrho2 = {rho2}\n'


@pytest.mark.campaign
def test_the_page_of_the_cascade_says_that_no_gain_depends_on_the_graph(tmp_path: Path):
    saved, page = tmp_path / "c.json", tmp_path / "c.html"
    ptcc("certify", _scenario(tmp_path, CASCADE.format(alpha=2, rho2=2)), "--method", "paper", "-o", str(saved))
    assert ptcc("report", str(saved), "-o", str(page)).code == 0
    assert "No gain depends on the graph" in page.read_text(encoding="utf-8")


def test_the_cascade_is_certified_and_checked_from_a_scenario(tmp_path: Path):
    """A rate that bounds the input; below it, what mends that, and velocities of which nothing is claimed."""
    saved, wide = tmp_path / "c.json", _scenario(tmp_path, CASCADE.format(alpha=2, rho2=2))
    done = ptcc("certify", wide, "--method", "paper", "--no-simulation", "-o", str(saved))
    assert done.code == 0 and "u = (2 g^2 + g') e + g e' - 2 g x'" in " ".join(done.out.split())
    assert "(exact, at rest)" in done.out and "input      bounded" in done.out
    assert ptcc("check", str(saved)).code == 0
    slow = _scenario(tmp_path, CASCADE.format(alpha='"1/4"', rho2="0.05"))
    done = ptcc("certify", slow, "--method", "paper", "--no-simulation")
    told = " ".join(done.out.split())
    assert "velocities are not proved to vanish" in told and "meeting at rest" not in told
    assert "NOT CERTIFIED BOUNDED: rate" in told and "--rho2" in told and "and --cascade" in told


@pytest.mark.parametrize(
    ("command", "options", "says"),
    [
        ("certify", ("--cascade", "1"), "--cascade: is for agents of order n; give --agents double-integrator"),
        ("certify", ("--agents", "3", "--cascade", "1"), "agents of order 2; these are of order 3"),
        ("certify", ("--agents", "2", "--cascade", "-1"), "cascade = -1 is outside its domain"),
        ("certify", ("--agents", "2", "--cascade", "x"), '--cascade: "x" is not a number'),
        ("certify", ("--agents", "2", "--cascade", "1", "--drag", "1"), "double integrators without drag or forces"),
        ("certify", ("--agents", "2", "--cascade", "1", "--rest", "1"), "leave --rest out"),
        ("certify", ("--agents", "2", "--cascade", "1", "--gain-cap", "9"), "leave --gain-cap out"),
        ("certify", ("--agents", "2", "--cascade", "1", "--delay", "0.1"), "--delay: is not proved of agents of order"),
        (
            "certify",
            ("--agents", "2", "--packet-loss", "1", "--period", "0.1"),
            "--period and --packet-loss: are not proved of agents of",
        ),
        ("certify", ("--agents", "2", "--cascade", "1e6"), "cascade = 1e+06 is too large to enclose the common motion"),
        ("certify", ("--agents", "2", "--rest", "1e6"), "take a smaller rest, or rho1"),
        ("certify", ("--agents", "2", "--cascade", "1", "--leader-speed", "1"), "--leader-speed: is not proved of"),
        (
            "design",
            ("--agents", "3", "--cascade", "1", "--max-input", "9", "--shortest-deadline"),
            "these are of order 3",
        ),
    ],
)
def test_what_the_cascade_does_not_take_is_refused_in_one_line(command: str, options: tuple[str, ...], says: str):
    done = ptcc(command, "fig1a", *options)
    assert done.code == 2 and says in done.err and len(done.err.strip().splitlines()) == 1


def test_a_deadline_of_the_cascade_is_designed_and_proved_again_by_the_command_that_is_told():
    asked = ("--agents", "2", "--cascade", "2", "--v0", "random", "--max-input", "40", "--shortest-deadline")
    done = ptcc("design", "fig1a", *asked)
    told = " ".join(done.out.replace("\\\n", " ").split())
    assert done.code == 0 and "verdict met: ||u_k|| <= " in told and "; u = (2 g^2 + g') e + g e' - 2 g x'" in told
    (command,) = re.findall(r"ptcc (certify fig1a .*?--max-input 40)", told)
    again = ptcc(*shlex.split(command), "--no-simulation")
    assert again.code == 0 and "met: |u_k| <= 40" in " ".join(again.out.split())


@pytest.mark.few(0)
def test_coordinates_may_take_more_letters_than_the_name_of_a_file(tmp_path: Path):
    path = tmp_path / "many.csv"
    path.write_text("".join(f"{k},{k + 1},1\n" for k in range(100)))
    state = ",".join(["-1/3"] * 202)
    made = ptcc("certify", str(path), "--agents", "2", "--dimension", "2", "--x0", state, "--no-simulation", "-q")
    assert made.code in (0, 4) and not made.err


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (("certify", "--biases", "0,0,0,0,0,0"), "--biases: of a family make other places in every graph"),
        (("simulate", "--biases", "0,0,0,0,0,0"), "--biases: of a family make other places in every graph"),
        (("certify", "--dimension", "2"), "--dimension: a formation of a family is on a line"),
        (("plot", "--what", "states", "--dimension", "2"), "--dimension: a formation of a family is on a line"),
        (("certify", "--agents", "double-integrator"), "--agents: is not for families of graphs yet"),
        (("simulate", "--agents", "2", "--exchange", "virtual"), "--agents and --exchange: are not for families"),
    ],
)
def test_of_formations_of_families_what_is_not_proved_is_refused_by_what_it_is(
    words: tuple[str, ...], why: str, tmp_path: Path
):
    command, *options = words
    options += ["-o", str(tmp_path / "out.png")] if command == "plot" else []
    asked = ptcc(command, "fig1b", "--uncertainty", "10%", "--offsets", "1,2,3,4,5,6", "--x0", "1,2,3,4,5,6", *options)
    assert asked.code == 2 and why in asked.err


def test_runs_of_a_family_and_of_vehicles_in_a_formation_are_of_positions(tmp_path: Path):
    team = tmp_path / "team.csv"
    team.write_text("1,2,1\n2,3,-1\n")
    asked = ("simulate", str(team), "--offsets", "1,2,3", "--x0", "1,2,3", "--rho2", "9")
    for more in (("--uncertainty", "10%"), ("--agents", "double-integrator", "--exchange", "virtual")):
        run = ptcc(*asked, *more)
        first, *_, last = list(csv.DictReader(io.StringIO(run.out)))
        for k in range(1, 4):  # less their places all begin at 0, where they stay
            assert float(first[str(k)]) == float(last[str(k)]) == k


@pytest.mark.parametrize("exchange", ["states", "virtual"])
def test_equal_steps_are_instants_of_the_same_run(exchange: str):
    asked = ("simulate", "fig1b", "--agents", "double-integrator", "--v0", "random", "--exchange", exchange)
    rows = np.genfromtxt(io.StringIO(ptcc(*asked, "--steps", "8").out), delimiter=",", skip_header=1)
    dense = np.genfromtxt(io.StringIO(ptcc(*asked, "--samples", "2001").out), delimiter=",", skip_header=1)
    assert np.allclose(rows[:, 0], np.arange(len(rows)) / 8) and len(rows) == (9 if exchange == "states" else 8)
    for column in range(2, 8):
        assert np.allclose(rows[:, column], np.interp(rows[:, 0], dense[:, 0], dense[:, column]), atol=1e-3)
