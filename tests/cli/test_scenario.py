"""Scenario files: what a command takes of them, what overrides them, what is refused, what ``ptcc new`` writes."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from typing import Any

import pytest
from bad_inputs import ptcc
from matplotlib.figure import Figure

from ptcc_certify.certificate.certificate import read_certificate
from ptcc_certify.cli import cli
from ptcc_certify.cli.new import template
from ptcc_certify.cli.scenario import MAX_BYTES, SECTIONS, read_scenario
from ptcc_certify.errors import PTCCError
from ptcc_certify.report.page_figures import PLOTS

pytestmark = pytest.mark.usefixtures("quick_search")

TEAM = "ann,bob,1\nbob,ann,1\nbob,eve,-2\neve,dan,1\ndan,eve,1\n"
SCENARIO = """
[graph]
file = "team.csv"
[protocol]
T = 2
rho1 = 0.1
[initial_state]
x0 = { ann = 5, bob = 2, eve = 4.25, dan = "-1/3" }
[expectations]
behaviour = "bipartite-consensus"
max_input = 1000
[certificate]
simulation = false
[design]
deadline = 1
"""
PARAMETERS = {parameter.name: parameter for command in cli.commands.values() for parameter in command.params}


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("my data").mkdir()
    Path("my data/team.csv").write_text(TEAM)
    Path("my data/s.toml").write_text(SCENARIO)
    return tmp_path


def write(old: str = "", new: str = "") -> str:
    assert old in SCENARIO
    Path("s.toml").write_text(SCENARIO.replace("team.csv", "my data/team.csv").replace(old, new, 1))
    return "s.toml"


def test_a_scenario_stands_for_a_graph_with_all_that_is_asked_about_it():
    """Numbers are exact, paths are relative to the file; what only other commands take is left to them."""
    run = ptcc("certify", "my data/s.toml", "-o", "c.json")
    assert run.code == 0, run
    assert "met: bipartite consensus" in run.out
    data = json.loads(Path("c.json").read_text())
    assert data["problem"]["gain"]["rho1"] == "1/10" and data["problem"]["gain"]["T"] == "2"
    assert data["problem"]["initial_state"] == {"ann": "5", "bob": "2", "eve": "17/4", "dan": "-1/3"}
    assert data["unverified"]["simulation"] is None
    assert ptcc("classify", "my data/s.toml").code == 0
    assert ptcc("check", "c.json", "my data/s.toml").code == 0


def test_design_names_what_a_scenario_asks_beside_it():
    Path("plant.toml").write_text(
        '[graph]\nfile = "fig1b"\n[limits]\ngain_cap = 60\n[disturbance]\nnoise = 0.1\n'
        "[expectations]\nmax_input = 50\n[initial_state]\ninitial_bound = 1\n[design]\ndeadline = 1\n"
    )
    run = ptcc("design", "plant.toml")
    places = "plant.toml: [limits] gain_cap, plant.toml: [disturbance] noise"
    assert run.code == 0 and f"not designed for: {places}; ask ptcc certify about them" in run.out.replace("\n", " ")


def test_the_certificate_records_its_scenario_and_what_overrode_it():
    assert ptcc("certify", write(), "--T", "0.5", "--rho2", "2", "-o", "c.json").code == 0
    section = json.loads(Path("c.json").read_text())["unverified"]["scenario"]
    assert section["file"] == "s.toml" and section["protocol"] == {"T": "2", "rho1": "0.1"}
    assert section["initial_state"]["x0"]["dan"] == "-1/3"
    assert section["overridden"] == {"T": "0.5"}
    saved = read_certificate("c.json")
    assert saved.request.scenario == section and saved.protocol.T == 0.5
    assert ptcc("certify", "fig1a", "--no-simulation", "-o", "d.json").code == 0
    assert json.loads(Path("d.json").read_text())["unverified"]["scenario"] is None


@pytest.mark.few(0)
def test_a_scenario_gives_what_flags_would_give():
    flags = ("--T", "2", "--rho1", "0.1", "--x0", "ann=5,bob=2,eve=4.25,dan=-1/3")
    assert ptcc("simulate", write()).out == ptcc("simulate", "my data/team.csv", *flags).out
    design = ptcc("design", write(), "--initial-bound", "5", "-o", "d.json")
    assert design.code == 0 and "--max-input 1000" in design.out
    assert json.loads(Path("d.json").read_text())["unverified"]["scenario"]["design"] == {"deadline": "1"}
    assert ptcc("check", "d.json", "s.toml").code == 0
    x0 = '"x0.csv"'
    Path("x0.csv").write_text("ann,5\nbob,2\neve,17/4\ndan,-1/3\n")
    for state in (x0, "[5, 2, 4.25, '-1/3']"):
        scenario = write('{ ann = 5, bob = 2, eve = 4.25, dan = "-1/3" }', state)
        assert ptcc("simulate", scenario).out == ptcc("simulate", "my data/team.csv", *flags).out


@pytest.mark.parametrize("order", [("s.toml", "--protocol", "sliding-mode"), ("--protocol", "sliding-mode", "s.toml")])
def test_a_flag_that_changes_the_protocol_leaves_out_the_parameters_of_the_other_one(order: tuple[str, ...]):
    write()
    gain = json.loads(ptcc("certify", *order, "--json").out)["problem"]["gain"]
    assert [gain[name] for name in ("kind", "T_r", "rho1")] == ["sliding-mode", "1/2", "1/10"]


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("rho1", "rh1", "s.toml: [protocol] rh1: no such key; did you mean rho1?"),
        ("rho1", "velocity", "s.toml: [protocol] velocity: no such key; there are kind, T, rho1, rho2, kappa"),
        ("deadline", "seed", "s.toml: [design] seed: no such key; it belongs to [initial_state]"),
        ("[protocol]", "[protocl]", "s.toml: [protocl]: no such section; did you mean protocol?"),
        ("[design]", "[vehicles]", "s.toml: [vehicles]: no such section"),
        ("\n[graph]", "T = 1\n[graph]", "s.toml: [T]: no such key outside of a section; it belongs to [protocol]"),
        ("T = 2", "T = -2", "s.toml: [protocol] T: T = -2 is outside its domain"),
        ("T = 2", "T = nan", "s.toml: [protocol] T: T = nan"),
        ("T = 2", "T = [2]", "s.toml: [protocol] T: write a number, such as 1"),
        ("T = 2", "T = 2020-01-01", "s.toml: [protocol] T: write a number, such as 1"),
        ("T = 2", "T_r = 2", "s.toml: [protocol] T_r: belongs to --protocol sliding-mode"),
        ("T = 2", 'kind = "slding"', "s.toml: [protocol] kind: 'slding' is not one of"),
        ("ann = 5", "anna = 5", 'node "anna" is not in the graph; did you mean ann'),
        ("ann = 5", "ann = [5]", "s.toml: [initial_state] x0: write a list of numbers"),
        ("max_input = 1000", 'max_input = "1 V"', 's.toml: [expectations] max_input: "1 V" is not a number'),
        ("-consensus", "-consensu", "s.toml: [expectations] behaviour: unknown behaviour"),
        ("false", "0", "s.toml: [certificate] simulation: write true or false"),
        (
            "team.csv",
            "taem.csv",
            "[graph] file: my data/taem.csv: no such file; check the path; did you mean team.csv?",
        ),
        ("team.csv", "s.toml", "is a scenario, not a graph"),
        ('file = "my data/team.csv"', "", "s.toml: [graph] file: names no graph"),
        ("T = 2", "T = 2\nT = 3", "no TOML that can be read"),
        ("T = 2", f"T = {'9' * 5000}", "no TOML that can be read"),
        ("T = 2", f"a = {'[' * 9999}", "no TOML that can be read"),
        ("T = 2", "#" * MAX_BYTES, "more than 1000000 bytes"),
        ("T = 2", f"[a{'.a' * 100_000}]", "no TOML that can be read (a name of more than 32 parts)"),
        (
            "[expectations]",
            "dimension = 2\n[expectations]",
            "s.toml: [initial_state] dimension: ptcc certify takes single integrators of one component",
        ),
    ],
)
def test_what_is_wrong_with_a_scenario_is_told_by_section_and_key(old: str, new: str, says: str):
    path = Path(write())
    path.write_text(path.read_text().replace(old, new, 1))
    run = ptcc("certify", "s.toml", "-o", "c.json")
    assert (run.code, run.out, len(run.err.splitlines())) == (2, "", 1), run
    assert says in run.err, run.err
    assert not Path("c.json").exists()


def test_a_packaged_name_is_a_file_beside_the_scenario_or_none():
    Path("my data/p.toml").write_text('[graph]\nfile = "fig1b"\n')
    Path("fig1b").write_text("a,b,1\n")
    assert "6 nodes" in ptcc("classify", "my data/p.toml").out
    Path("my data/fig1b").write_text("a,b,1\nb,c,1\n")
    assert "3 nodes" in ptcc("classify", "my data/p.toml").out


def test_a_flag_displaces_what_the_scenario_has_instead():
    """A true boolean by ``--no-``; of deadline and shortest deadline the one that is not in the file."""
    Path("my data/team.csv").write_text(f"{TEAM}dan,dan,1\n")
    scenario = write()
    text = Path(scenario).read_text().replace("[protocol]", "drop_self_loops = true\n[protocol]")
    Path(scenario).write_text(text.replace("rho1 = 0.1", "rho1 = 1_000.5e-3"))
    assert ptcc("classify", scenario).code == 0
    assert "self-loop at node dan" in ptcc("classify", scenario, "--no-drop-self-loops").err
    assert "rho1=1.0005" in ptcc("certify", scenario).out
    design = ("design", scenario, "--initial-bound", "5")
    assert "deadline 1" in ptcc(*design).out and "shortest deadline" in ptcc(*design, "--shortest-deadline").out
    assert ptcc(*design, "--shortest-deadline", "--deadline", "1").code == 2


def test_a_flag_that_is_wrong_is_told_as_the_flag():
    run = ptcc("certify", write(), "--T", "-3")
    assert run.err.startswith("ptcc: T = -3 is outside its domain")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("count = 3\nnodes = 5\n", "ptcc batch takes it"),
        ("[tool]\nx = 1\n", "not a scenario"),
        ("", "is empty"),
        ("a,b,1\n", "no TOML"),
    ],
)
def test_toml_that_is_no_scenario_says_so(text: str, says: str):
    Path("x.toml").write_text(text)
    run = ptcc("certify", "x.toml")
    assert run.code == 2 and says in run.err
    assert "is a scenario, for one graph" in ptcc("batch", write()).err


# ---------------------------------------------------------------------- ptcc new


def test_what_new_writes_certifies(folder: Path):
    assert ptcc("new", "-o", "a.toml").out == "written    a.toml; now: ptcc certify a.toml\n"
    assert ptcc("certify", "a.toml").code == 0
    assert ptcc("new").out == Path("a.toml").read_text()
    assert max(map(len, ptcc("new").out.splitlines())) <= 100
    assert ptcc("new", "my data/team.csv", "-o", "my data/new one.toml").code == 0
    assert read_scenario("my data/new one.toml").sections["graph"] == {"file": "team.csv"}
    assert ptcc("certify", "my data/new one.toml", "--no-simulation").code == 0
    Path("odd.csv").write_text("a\x7fb,c,1\nc,a\x7fb,1\n")
    assert ptcc("new", "odd.csv", "-o", "odd.toml").code == 0
    assert read_scenario("odd.toml").sections["graph"] == {"file": "odd.csv"}


def test_new_replaces_nothing_unless_told_to():
    Path("a.toml").write_text("mine")
    refused = ptcc("new", "-o", "a.toml")
    assert refused.code == 2 and "--force" in refused.err and Path("a.toml").read_text() == "mine"
    assert ptcc("new", "-o", "a.toml", "--force").code == 0 and Path("a.toml").read_text() != "mine"
    assert ptcc("new", "nowhere.csv", "-o", "b.toml").code == 2 and not Path("b.toml").exists()


def test_every_key_is_an_option_with_a_meaning_and_an_example_that_is_read():
    text = template(PARAMETERS)
    for section, (_, keys) in SECTIONS.items():
        for key, told in keys.items():
            option, example = told.name, told.example
            assert option in PARAMETERS
            (line,) = (line for line in text.splitlines() if line.removeprefix("# ").startswith(f"{key} = {example} "))
            explained = line + text.partition(line)[2].partition("=")[0]
            assert "[default:" in explained or key == "file"
            if key == "file":
                continue
            graph = "" if section == "graph" else 'graph.file = "fig1a"\n'
            file = 'file = "fig1a"\n' if section == "graph" else ""
            Path("one.toml").write_text(f"{graph}[{section}]\n{file}{line.removeprefix('# ')}\n")
            wanted = tomllib.loads(f"x = {example}", parse_float=str)["x"]
            assert read_scenario("one.toml").options[option] == (str(wanted) if type(wanted) is int else wanted)
    with pytest.raises(PTCCError, match="cannot be read"):
        read_scenario("nowhere.toml")


def test_without_its_comments_every_line_of_the_template_is_toml():
    lines = [
        line.removeprefix("# ")
        for line in template(PARAMETERS, ["a b.csv"], ["é", 'say "x"', "a\x7fb"]).splitlines()[2:]
    ]
    once = [line for line in lines if not line.startswith("x0 = {")]
    sections = tomllib.loads("\n".join(once))
    assert {name: set(keys) for name, keys in sections.items()} == {k: set(keys) for k, (_, keys) in SECTIONS.items()}
    assert tomllib.loads(next(line for line in lines if line not in once)) == {
        "x0": {"é": 1, 'say "x"': 1, "a\x7fb": 1}
    }


def test_a_random_state_of_a_scenario_begins_within_its_initial_bound(monkeypatch: pytest.MonkeyPatch):
    Path("s.toml").write_text('[graph]\nfile = "fig1a"\n[initial_state]\nx0 = "random"\ninitial_bound = 1\n')
    rows = ptcc("simulate", "s.toml", "--steps", "2").out.splitlines()
    first = [float(cell) for cell in rows[1].split(",")[2:8]]
    assert 0.1 < max(map(abs, first)) <= 1
    drawn: list[Any] = []
    monkeypatch.setitem(PLOTS, "input", lambda run, **_: drawn.append(run) or Figure())
    assert ptcc("plot", "s.toml", "--what", "input", "-o", "u.png").code == 0
    assert drawn[0].states[:, 0].tolist() == first
