"""Around the commands: help, near names, wrong kinds of file, completion, standard input, ``ptcc plot``."""

from __future__ import annotations

import csv
import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from bad_inputs import Run, ptcc
from side_files import with_side_files

import ptcc_certify
from ptcc_certify.cli import cli
from ptcc_certify.graphs.io import read_graph

pytestmark = pytest.mark.usefixtures("quick_search")

TEAM = "ann,bob,1\nbob,ann,1\nbob,eve,-2\neve,dan,1\ndan,eve,1\n"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("team.csv").write_text(TEAM)
    return tmp_path


@pytest.fixture(scope="module")
def certificate(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("made") / "c.json"
    assert ptcc("certify", "fig1b", "--no-simulation", "-o", str(path)).code == 0
    return str(path)


def process(*words: str, stdin: bytes = b"") -> Run:
    env = {"PYTHONPATH": str(Path(ptcc_certify.__file__).parents[1])}
    done = subprocess.run([sys.executable, *words], input=stdin, capture_output=True, timeout=60, env=os.environ | env)
    return Run(done.returncode, done.stdout.decode(), done.stderr.decode())


# ---------------------------------------------------------------------- help


def test_the_help_names_every_command_once_in_one_plain_line():
    lines = ptcc("--help").out.splitlines()
    for name in cli.commands:
        (line,) = (line for line in lines if line.startswith(f"  {name} "))
        assert not line.endswith("...")


@pytest.mark.parametrize("name", ["", *cli.commands])
def test_every_help_fits_80_columns(name: str):
    run = ptcc(*filter(None, [name]), "--help")
    assert run.code == 0 and max(map(len, run.out.splitlines())) <= 80


@pytest.mark.few(1)
@pytest.mark.parametrize("words", [("ptcc_certify", "check"), ("ptcc_certify.checker",)])
def test_nobody_who_reads_the_output_is_no_traceback_and_no_verdict(words: tuple[str, ...], certificate: str):
    """The code is that of other programs whose reader goes away; on a full disk it is that of bad input."""
    command = [sys.executable, "-m", *words, certificate]
    env = os.environ | {"PYTHONPATH": str(Path(ptcc_certify.__file__).parents[1])}
    own, other = os.pipe()
    os.close(own)
    gone = subprocess.run(command, stdout=other, stderr=subprocess.PIPE, env=env)
    os.close(other)
    assert (gone.returncode, gone.stderr) == (141, b"")
    if Path("/dev/full").exists():
        with Path("/dev/full").open("wb") as full:
            failed = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, env=env)
        assert failed.returncode == 2 and b"the result cannot be written" in failed.stderr.splitlines()[-1]
        assert len(failed.stderr.splitlines()) == 1


@pytest.mark.few(0)
def test_the_package_runs_as_the_command():
    assert process("-m", "ptcc_certify", "cite", "2.1").out == ptcc("cite", "2.1").out


# ---------------------------------------------------------------------- near names


@pytest.mark.parametrize(
    ("words", "near"),
    [
        (("certfy", "fig1a"), "did you mean certify?"),
        (("certify", "Fig1A"), "did you mean fig1a?"),
        (("certify", "teem.csv"), "did you mean team.csv?"),
        (("check", "teem.csv"), "did you mean team.csv?"),
        (("certify", "team.csv", "--rh1", "2"), "--rho1"),
        (("certify", "team.csv", "--expect", "bipartit-consensus"), "did you mean bipartite-consensus"),
        (("certify", "team.csv", "--x0", "anne=1,bob=2,eve=3,dan=4"), "did you mean ann?"),
        (("certify", "team.csv", "--protocol", "slidingmode"), "sliding-mode"),
        (("examples", "fig1A"), "did you mean fig1a?"),
        (("cite", "2,1"), "did you mean 2.1"),
    ],
)
def test_a_wrong_name_is_answered_with_near_ones(words: tuple[str, ...], near: str):
    run = ptcc(*words)
    assert run.code == 2 and len(run.err.splitlines()) == 1 and near in run.err, run.err


def test_only_near_names_of_files_are_told():
    for name in ("b.csv", "noread.csv"):
        Path(name).touch()
    for name in ("a.csv", "nope.csv"):
        assert "did you mean" not in ptcc("certify", name).err
    assert "; did you mean team.csv?" in ptcc("certify", "team.tsv").err


def test_an_option_of_another_command_is_told_with_it():
    words = ("design", "team.csv", "--max-input", "9", "--initial-bound", "1", "--deadline", "1", "--stop-before", "5")
    assert "--stop-before'. It is an option of ptcc certify, ptcc simulate, ptcc plot" in ptcc(*words).err
    capped = ptcc(*words[:-2], "--gain-cap", "5").err
    assert "--gain-cap: is not searched for single integrators; give it to ptcc certify, or" in capped


def test_help_beside_other_flags_and_of_a_topic_and_of_what_errors_are_called():
    assert ptcc("-hv").out == ptcc("--help").out
    assert "--radius" in ptcc("influence", "--help", "captured").out
    assert "by --quantisation STEP" in ptcc("certify", "team.csv", "--error", "0.1").err
    design = ptcc("design", "team.csv", "--max-input", "5", "--initial-bound", "1", "--delay", "0.1").err
    assert design.endswith("certify the gains that are found with it: ptcc certify GRAPH --delay\n")
    both = ptcc("certify", "team.csv", "--delay", "0.01", "--saturation", "5").err
    assert both.endswith("leave one of the two out, or bound inputs by --gain-cap and ask for --max-input\n")


def test_a_film_is_refused_in_words_of_what_was_certified():
    assert ptcc("certify", "team.csv", "--uncertainty", "10%", "-o", "c.json", "-q").code == 0
    assert "certify without these, or draw a figure" in ptcc("animate", "c.json").err


def test_nodes_without_edges_are_written_in_as_many_columns():
    Path("g.csv").write_text('"Smith, J",b,1\nb,c,-1\n')
    printed = ptcc("edit", "g.csv", "--without-edge", '"Smith, J",b').out
    assert {len(row) for row in csv.reader(printed.splitlines())} == {3}
    Path("h.csv").write_text(printed)
    assert read_graph("h.csv").labels == ("Smith, J", "b", "c")


def test_only_near_options_are_told():
    assert ptcc("certify", "team.csv", "--theorem", "3").err == "ptcc: No such option '--theorem'.\n"
    assert ptcc("certify", "team.csv", "--max-inputs", "3").err.endswith("Did you mean --max-input?\n")


def test_a_first_row_without_a_weight_may_be_a_header():
    for rows in ("a,b\n", "a,b,1\n"):
        Path("said.csv").write_text(f"listener,speaker\n{rows}")
        run = ptcc("classify", "said.csv")
        assert run.code == 2 and len(run.err.splitlines()) == 1
        assert run.err.endswith(
            "if this row is a header, call who is heard source, who listens target, and the weight weight\n"
        )


# ---------------------------------------------------------------------- wrong kinds of file

KINDS = {
    "x.pdf": (b"%PDF-1.7 ...", "is a PDF"),
    "x.png": (b"\x89PNG\r\n\x1a\n", "is an image"),
    "x.svg": (b'<?xml version="1.0"?>\n<svg/>', "is an image"),
    "x.html": (b"<!DOCTYPE html>\n<html></html>", "is a page"),
    "x.xlsx": (b"PK\x03\x04 sheet", "is a zip archive"),
    "x.ipynb": (b'{"cells": [{"cell_type": "code"}]}', "is a notebook"),
    "x.csv": (b"", "is empty"),
    "x.toml": (b'[graph]\nfile = "fig1a"\n', "is a scenario"),
}


@pytest.mark.parametrize("name", KINDS)
def test_what_is_neither_graph_nor_certificate_is_named(name: str):
    content, says = KINDS[name]
    Path(name).write_bytes(content)
    for words in (("certify", name), ("check", name), ("report", name, "-o", "r.html"), ("plot", name)):
        if (words[0], name) in (("certify", "x.toml"), ("plot", "x.toml")):
            continue  # where it belongs
        run = ptcc(*words)
        assert run.code == 2 and len(run.err.splitlines()) == 1 and says in run.err, run.err
        assert not Path("r.html").exists()


def test_a_graph_and_a_certificate_in_the_place_of_the_other_are_told_with_the_command(certificate: str):
    for command in ("certify", "classify", "new"):
        run = ptcc(command, certificate)
        assert run.code == 2 and f"is a certificate, not a graph; ptcc check {certificate}" in run.err
    for graph in ("team.csv", "fig1a"):
        for words in (("check", graph), ("report", graph, "-o", "r.html")):
            run = ptcc(*words)
            assert run.code == 2 and f"ptcc certify {graph} -o {graph.removesuffix('.csv')}.json makes one" in run.err
            assert ("the certificate comes first" in run.err) == (words[0] == "check")
    run = ptcc("certify", ".")
    assert run.code == 2 and "is a folder, not a graph" in run.err and "ptcc batch '*.csv'" in run.err
    Path("odd.csv").write_text("{a,b,1\nb,{a,1\n")  # begins like JSON
    assert ptcc("classify", "odd.csv").code == 0


@pytest.mark.few(0)
def test_standard_input_of_the_wrong_kind_is_named_as_a_file_is(certificate: str):
    content = Path(certificate).read_bytes()
    for words in (("classify", "-"), ("certify", "-"), ("certify", "-", "fig1a", "--switching")):
        run = ptcc(*words, stdin=content)
        assert run.code == 2 and "standard input: is a certificate, not a graph; ptcc check" in run.err
    for stdin, says in ((Path("team.csv").read_bytes(), "if it is a graph, ptcc certify - -o"), (b"", "is empty")):
        run = ptcc("check", "-", stdin=stdin)
        assert run.code == 2 and run.err.startswith("ptcc: standard input: ") and says in run.err
    scenario = KINDS["x.toml"][0]  # rows of one field would be nodes
    assert "is a scenario, not a graph; save it as .toml" in ptcc("classify", "-", stdin=scenario).err
    assert process("-m", "ptcc_certify", "check", "/dev/stdin", stdin=content).code == 0


def test_a_matrix_that_is_an_archive_is_a_graph():
    np.savez("w.npz", np.array([[0.0, 1.0], [-1.0, 0.0]]))
    assert ptcc("classify", "w.npz").code == 0


@pytest.mark.parametrize("output", ["x.html", "x.png", "x.csv", "x.toml"])
def test_another_kind_of_output_is_sent_to_its_command(output: str):
    run = ptcc("certify", "fig1a", "-o", output)
    command = {".html": "report", ".png": "plot", ".csv": "simulate", ".toml": "new"}[Path(output).suffix]
    assert run.code == 2 and f"ptcc {command} " in run.err and not Path(output).exists()


# ---------------------------------------------------------------------- standard input


def test_a_certificate_is_checked_from_standard_input(certificate: str):
    content = Path(certificate).read_bytes()
    assert ptcc("check", "-", stdin=content).out == ptcc("check", certificate).out
    run = process("-m", "ptcc_certify.checker", "-", stdin=content)
    assert run.code == 0 and run.out.splitlines()[-1].startswith("accepted")
    assert ptcc("check", "-", "fig1b", stdin=content).code == 0
    for stdin in (b"", b"a,b,1\n", b"\xff"):
        assert ptcc("check", "-", stdin=stdin).code == 2
    tight = ptcc("check", "-", "--memory", "0.00001", stdin=content)
    assert tight.code == 2 and "--memory" in tight.err


@pytest.mark.usefixtures("framed_figures")
def test_a_report_is_written_of_a_certificate_from_standard_input(certificate: str):
    content = Path(certificate).read_bytes()
    Path("certificate.json").write_bytes(content)
    for name in ("c.html", "c.tex"):
        assert ptcc("report", "certificate.json", "-o", name, "--no-simulation").code == 0
        expected = Path(name).read_text(encoding="utf-8")
        Path(name).unlink()
        assert ptcc("report", "-", "-o", name, "--no-simulation", stdin=content).code == 0
        assert Path(name).read_text(encoding="utf-8") == expected
    spaced = json.dumps(json.loads(content), indent=3).encode()  # another file, of the same content
    run = ptcc("report", "-", "-o", "d.html", "--no-simulation", stdin=spaced)
    assert run.code == 0 and hashlib.sha256(spaced).hexdigest() in Path("d.html").read_text(encoding="utf-8")
    for wrong in (b"", b"a,b,1", b"{}"):
        run = ptcc("report", "-", "-o", "e.html", stdin=wrong)
        assert run.code == 2 and run.err.startswith("ptcc: standard input: ") and not Path("e.html").exists()
    false = content.replace(b'"T": "', b'"T": "1', 1)
    run = ptcc("report", "-", "-o", "e.html", stdin=false)
    assert run.code == 1 and "standard input" in Path("e.html").read_text(encoding="utf-8")


def test_a_side_file_that_is_missing_is_no_rejection():
    protocol = ptcc_certify.NominalProtocol(T=1, rho1=1, rho2=1, kappa=2)
    document, files = with_side_files(
        ptcc_certify.certify("team.csv", protocol, asks=ptcc_certify.Asks(simulation=False)).to_dict()
    )
    Path("c.json").write_text(json.dumps(document))
    for name, content in files.items():
        Path(name).write_bytes(content)
    assert ptcc("check", "c.json").code == 0
    Path(next(iter(files))).unlink()
    run = ptcc("check", "c.json")
    assert run.code == 2 and run.err.startswith("ptcc: c.json: incomplete: side file ")


def test_a_package_that_is_missing_is_named_with_the_check_that_needs_none(certificate: str):
    for package in ("click", "numpy"):
        code = f"import sys; sys.modules['{package}'] = None; from ptcc_certify.__main__ import main; main()"
        run = process("-c", code, "check", certificate)
        assert run.code == 2 and run.err.startswith(f"ptcc: ptcc needs the package {package},"), run
        assert "pip install . in the project's folder; " in run.err and len(run.err.splitlines()) == 1
        assert "python -m ptcc_certify.checker" in run.err


def test_the_module_that_two_distributions_share_is_told_back_by_reinstalling():
    """``pip install .`` leaves it as it is: ``cvxpy-base`` counts as installed, though ``cvxpy`` took its files."""
    code = "import sys; sys.modules['cvxpy'] = None; from ptcc_certify.__main__ import main; main()"
    run = process("-c", code, "certify", "team.csv", "--uncertainty", "10%")
    assert run.code == 2 and run.err.startswith("ptcc: ptcc needs the package cvxpy, which is not installed; "), run
    assert "; pip uninstall -y cvxpy-base && pip install cvxpy-base; " in run.err and len(run.err.splitlines()) == 1


def test_a_run_tells_what_was_written_and_meets_noise():
    words = ("simulate", "team.csv", "--gain-cap", "20", "--noise", "0.1", "-o", "run.csv")
    assert ptcc(*words).out == "written    run.csv\n"
    assert "give a gain cap or stop before T" in ptcc("simulate", "team.csv", "--noise", "0.1").err


def test_steps_are_equal_and_end_at_the_deadline():
    rows = ptcc("simulate", "team.csv", "--T", "0.3", "--steps", "3", "--x0", "1,2,3,4").out.splitlines()[1:]
    assert [float(row.split(",")[0]) for row in rows] == [0, 0.1, 0.2, 0.3]


# ---------------------------------------------------------------------- plot


@pytest.mark.few(0)
def test_every_figure_of_a_certificate_a_graph_and_a_scenario_is_drawn(certificate: str):
    Path("s.toml").write_text('[graph]\nfile = "team.csv"\n')
    for what in ("states", "input", "decay", "graph", "spectrum"):
        assert ptcc("plot", certificate, "--what", what, "-o", f"{what}.svg").out == f"written    {what}.svg\n"
        assert Path(f"{what}.svg").read_bytes().startswith(b"<?xml")
    for what in ("states", "graph"):
        assert ptcc("plot", "team.csv", "--what", what, "--x0", "1,2,3,4").out == f"written    team-{what}.png\n"
    assert ptcc("plot", "s.toml").code == 0 and Path("team-graph.png").exists()
    words = ("--for", "slide", "--width", "10", "--state-unit", "m", "-o", "slide.svg")
    assert ptcc("plot", certificate, "--what", "states", *words).out == "written    slide.svg\n"
    assert 'width="720.000000pt" height="405.000000pt"' in Path("slide.svg").read_text()


def test_a_certificate_without_an_initial_state_is_drawn_from_the_one_that_is_given(certificate: str):
    protocol = ptcc_certify.NominalProtocol(T=1, rho1=1, rho2=1, kappa=2)
    ptcc_certify.certify("team.csv", protocol, asks=ptcc_certify.Asks(simulation=False)).save("none.json")
    for what in ("input", "decay", "states"):
        assert ptcc("plot", "none.json", "--what", what, "--x0", "1,2,3,4").out == f"written    none-{what}.png\n"
    assert "give one with --x0" in ptcc("plot", "none.json", "--what", "input").err
    assert "has its own" in ptcc("plot", certificate, "--x0", "1,2,3,4,5,6").err


def test_what_cannot_be_drawn_is_refused_in_one_line(certificate: str):
    for words, says in (
        ((certificate, "--T", "2"), "--T is for a graph"),
        (("fig1a", "-o", "x.jpg"), "figures are written to"),
        (("fig1a", "-o", "nowhere/x.png"), "the folder does not exist"),
        (("fig1a", "--what", "decay", "--gain-cap", "5"), "decay is drawn without limits"),
        (("fig1b", "--what", "decay", "--x0", "0,0,0,0,0,0"), "nothing decays"),
    ):
        run = ptcc("plot", *words)
        assert (run.code, run.out, len(run.err.splitlines())) == (2, "", 1) and says in run.err, run
    changed = Path(certificate).read_text().replace('"verdict": "certified"', '"verdict": "undecided"')
    Path("bad.json").write_text(changed)
    run = ptcc("plot", "bad.json")
    assert run.code == 1 and run.err.startswith("rejected: ") and not list(Path().glob("*.png"))


# ---------------------------------------------------------------------- completion


def test_click_completes_commands_options_and_values_without_anything_that_computes():
    code = (
        "import sys; from ptcc_certify.cli import cli; from click.shell_completion import ShellComplete as S\n"
        "told = lambda *words: [item.value for item in S(cli, {}, 'ptcc', '_PTCC_COMPLETE').get_completions(*words)]\n"
        "print(told([], 'ce'), told(['certify', 'fig1a', '--method'], 'p'), told(['check', 'c.json'], '--std'))\n"
        "print({'numpy', 'scipy', 'casadi', 'cvxpy', 'matplotlib', 'networkx', 'rich'} & set(sys.modules))"
    )
    assert process("-c", code).out == "['certify'] ['paper', 'perron'] ['--stdlib']\nset()\n"


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("why", "fig1a"), 'there is no command "why"; the line why of classify and certify tells the counterexample'),
        (("design", "fig1a", "--max-input", "3", "--T", "2"), "; here it is --deadline"),
        (("design", "fig1a", "--max-input", "3", "--x0", "1"), "give --initial-bound R instead"),
        (("plot", "fig1a", "--what", "sliding"), "the sliding variables are under states"),
        (("plot", "fig1a", "--what", "slides"), "'slides' is not one of"),
    ],
)
def test_a_word_of_another_place_is_refused_with_its_place(words: tuple[str, ...], says: str):
    run = ptcc(*words)
    assert run.code == 2 and says in run.err and run.err.count("\n") == 1, run


def test_a_missing_file_names_first_what_begins_alike(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    for name in ("crew_of_monday_morning.csv", "screw.csv", "other.csv"):
        Path(name).write_text("a,b,1\n")
    assert "did you mean crew_of_monday_morning.csv?" in ptcc("classify", "crew.csv").err


def test_the_deadline_under_another_name_and_words_in_capitals():
    for words, flag in ((("--deadline", "3"), "--deadline"), (("-T", "3"), "-T")):
        assert ptcc("certify", "team.csv", *words).err == f"ptcc: No such option '{flag}'. Did you mean --T?\n"
    loud, plain = (ptcc("classify", "team.csv", "--edges", word) for word in ("Listens", "listens"))
    assert loud.code == 0 and loud.out == plain.out
    assert ptcc("certify", "team.csv", "--protocol", "Nominal", "--method", "Paper").code == 0


def test_what_is_no_number_is_told_how_one_looks():
    for text, mend in (("fast", "give a number such as 0.5"), ("0,5", "write decimals with a point, 0.5")):
        told = ptcc("certify", "team.csv", "--leader-speed", text)
        assert told.code == 2 and told.err == f'ptcc: --leader-speed: "{text}" is not a number; {mend}\n'


def test_a_certificate_is_run_as_its_graph_is(tmp_path: Path):
    words = ("--x0", "1,2,3,4", "--T", "2")
    for more in (
        (),
        ("--gain-cap", "9"),
        ("--agents", "2"),
        ("--protocol", "sliding-mode", "--T-r", "1", "--T-s", "1"),
    ):
        given = (*words[: 2 if "--T-r" in more else 4], *more)
        ptcc("certify", "team.csv", *given, "--no-simulation", "-o", "c.json")
        by_graph, by_certificate = ptcc("simulate", "team.csv", *given), ptcc("simulate", "c.json")
        assert by_certificate.code == 0 and by_certificate.out == by_graph.out, more
    refused = ptcc("simulate", "c.json", "--T", "3")
    assert refused.code == 2 and refused.err == "ptcc: --T is for a graph; the certificate c.json has its own\n"
    forged = json.loads(Path("c.json").read_text(encoding="utf-8")) | {"verdict": "undecided"}
    Path("c.json").write_text(json.dumps(forged), encoding="utf-8")
    assert ptcc("simulate", "c.json").code == 1
    ptcc("certify", "team.csv", "--uncertainty", "1%", "--no-simulation", "-o", "f.json")
    assert "--switching" in ptcc("simulate", "f.json").err
    ptcc("certify", "team.csv", "--initial-bound", "2", "--no-simulation", "-o", "set.json")
    assert "is of no single initial state" in ptcc("simulate", "set.json").err


def test_edit_writes_the_graph_that_is_left_for_the_other_commands():
    Path("team.csv").write_text('ann,"Lee, K",1/3\n"Lee, K",ann,0.1\n"Lee, K",eve,-2\neve,dan,1\n')
    run = ptcc("edit", "team.csv", "--without-node", "dan", "--without-edge", 'ann,"Lee, K"', "-o", "left.csv")
    assert run.code == 0 and run.out.splitlines()[-1].startswith("written    left.csv: 3 nodes, 2 edges"), run
    whole, left = ptcc_certify.read_graph("team.csv"), ptcc_certify.read_graph("left.csv")
    assert left == whole.without_nodes("dan").without_edges(("ann", "Lee, K"))
    assert ptcc("edit", "team.csv", "--without-node", "dan", "--without-edge", 'ann,"Lee, K"').out == (
        Path("left.csv").read_text()
    )
    assert ptcc("edit", "team.csv", "--edges", "listens", "--without-node", "dan", "-o", "turned.csv").code == 0
    assert ("eve", "Lee, K", -2) in ptcc_certify.read_graph("turned.csv").edges  # written as information flows
    assert ptcc("certify", "left.csv").code == 0


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ((), "nothing is left out; give --without-node NODE or --without-edge SOURCE,TARGET"),
        (("--without-node", "zoe"), "no agent is called 'zoe'; there are ann, bob, eve, dan"),
        (("--without-edge", "bob"), "--without-edge: bob is no edge; write SOURCE,TARGET, such as a,b"),
        (("--without-edge", "eve,ann"), "there is no edge eve -> ann"),
        (("--without-node", "ann", "-o", "team.csv"), "team.csv: is read by the command itself; name another file"),
        (("--without-node", "ann", "-o", "left.gml"), "graphs are written as edge lists; let the name end in .csv"),
        (tuple(word for label in ("ann", "bob", "eve", "dan") for word in ("--without-node", label)), "no graph"),
    ],
)
def test_what_edit_cannot_leave_out_is_told_in_one_line(words: tuple[str, ...], told: str):
    run = ptcc("edit", "team.csv", *words)
    assert run.code == 2 and run.err.count("\n") == 1 and told in run.err, run
