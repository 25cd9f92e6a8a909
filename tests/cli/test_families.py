"""Families of graphs on the command line: several files, weights in intervals, edges that may fail."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from bad_inputs import ptcc
from selection import thinned

from ptcc_certify import NominalProtocol, certify
from ptcc_certify.certificate.assessment import CERTIFIED
from ptcc_certify.graphs.io import read_family
from ptcc_certify.report.facts.claim import _cut
from ptcc_certify.report.text_layout import wrap_text

pytestmark = pytest.mark.usefixtures("framed_figures")

INTERVALS = "source,target,weight_min,weight_max"
#: "day" and "night" keep the same camps, "spoiled" others.
FILES = {
    "day.csv": "a,b,1\nb,c,-1\n",
    "night.csv": "c,a,-2\na,b,1\n",
    "spoiled.csv": "c,a,2\na,b,1\n",
    "other.csv": "a,b,1\nb,d,-1\n",
    "unsure.csv": f"{INTERVALS}\na,b,1,2\nb,c,-2,-1\nc,a,-1,0\n",
    "may_fail.csv": "source,target,weight,optional\na,b,1,no\nb,a,-1,yes\n",
    "s.toml": '[graph]\nfile = ["day.csv", "night.csv"]\nuncertainty = "5%"\n[protocol]\nkappa = 3\n',
}
BOTH = ("day.csv", "night.csv", "--switching")
FIXED = ("day.csv", "--optional", "a,b", "--signal", "constant")
SPOILED = ("day.csv", "spoiled.csv", "--switching")


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    for name, text in FILES.items():
        Path(name).write_text(text)
    return tmp_path


@pytest.mark.parametrize(
    ("words", "claim"),
    [
        (BOTH, "bipartite consensus for every signal: camps {a, b} against {c}"),
        (("unsure.csv",), "bipartite consensus for every signal"),
        (("day.csv", "--uncertainty", "10%"), "bipartite consensus for every signal"),
        (("fig1a", "--optional", "1,2"), "stability for every signal"),
        (("fig1a", "fig1b", "--switching"), "depends on the signal"),
        (("may_fail.csv",), "depends on the signal"),
        (("day.csv", "spoiled.csv", "--switching", "--signal", "constant"), "if mode and weights never change"),
        (("day.csv", "--optional", "a,b", "--optional", "b,c"), "depends on the signal"),
    ],
)
def test_what_every_signal_does_is_decided_on_the_command_line(words: tuple[str, ...], claim: str):
    run = ptcc("classify", *words)
    (line,) = (line for line in run.out.splitlines() if line.startswith("claim "))
    assert run.code == 0 and claim in line, run


@pytest.mark.few(0)
def test_one_graph_with_known_weights_is_no_family():
    Path("known.csv").write_text(f"{INTERVALS}\na,b,1,1\nb,c,-1,-1\n")
    plain = ptcc("certify", "day.csv", "--no-simulation")
    assert "Theorem 2.1" in plain.out
    for words in (("day.csv", "--switching"), ("day.csv", "--uncertainty", "0"), ("day.csv", "--signal", "constant")):
        assert ptcc("certify", *words, "--no-simulation").out == plain.out
    assert "Theorem 2.1" in ptcc("classify", "known.csv").out


def test_standard_input_holds_intervals_or_a_mode():
    unsure = ptcc("classify", "-", stdin=FILES["unsure.csv"].encode())
    assert unsure.code == 0 and "for every signal" in unsure.out
    assert "for every signal" in ptcc("classify", "day.csv", "-", "--switching", stdin=FILES["night.csv"].encode()).out
    switching = ("day.csv", "-", "--switching", "--json")
    document = json.loads(ptcc("certify", *switching, stdin=FILES["night.csv"].encode()).out)
    assert document["problem"]["graph"]["modes"][1]["name"] == "stdin"
    assert "Theorem 2.1" in ptcc("classify", "-", stdin=FILES["day.csv"].encode()).out
    assert "standard input, line 1" in ptcc("classify", "-", stdin=b"a,a,1").err


def test_what_is_written_is_checked_against_the_files():
    assert ptcc("certify", *BOTH, "--kappa", "3", "-o", "c.json").code == 0
    checked = ptcc("check", "c.json")
    assert checked.code == 0 and "bipartite consensus at T = 1 for every signal" in checked.out
    for words, why in (
        (
            ("day.csv", "spoiled.csv"),
            'in mode night (spoiled of the files) ["c", "a", "-2"] is only in the certificate',
        ),
        ((*BOTH, "--uncertainty", "1%"), "accepted if --uncertainty 0% is what you mean"),
        (("day.csv", "spoiled.csv", "--uncertainty", "1%"), "in mode day (one of 2 that differ)"),
        (("day.csv",), "2 modes in the certificate, 1 in the files"),
        (("other.csv", "--uncertainty", "1%"), "node c is only in the certificate"),
        (("day.csv", "day.csv"), "in mode night (day (2) of the files) ["),
    ):
        run = ptcc("check", "c.json", *words)
        assert run.code == 1 and why in " ".join(run.out.split()), run
    assert ptcc("check", "c.json", "day.csv", "nowhere.csv").code == 2


def test_a_certificate_of_one_graph_is_of_no_family():
    assert ptcc("certify", "day.csv", "--no-simulation", "-o", "one.json").code == 0
    for key in ('uncertainty = "10%"', 'optional = ["a,b"]'):
        Path("one.toml").write_text(f'[graph]\nfile = "day.csv"\n{key}\n')
        assert ptcc("check", "one.json", "one.toml").code == 1
    for words in (("day.csv", "--uncertainty", "10%"), ("day.csv", "--optional", "a,b"), ("s.toml",), ("unsure.csv",)):
        run = ptcc("check", "one.json", *words)
        assert run.code == 1 and "one graph in the certificate, a family in the files" in " ".join(run.out.split()), run


@pytest.mark.few(0)
def test_intervals_with_equal_ends_are_the_graph_of_a_certificate():
    """A file of intervals may hold one graph, which certify takes for one, and check compares as one."""
    rows = [row.split(",") for row in FILES["day.csv"].split() if "source" not in row]
    equal = "\n".join(f"{source},{target},{weight},{weight}" for source, target, weight in rows)
    Path("equal.csv").write_text(f"{INTERVALS}\n{equal}\n")
    Path("other.csv").write_text(f"{INTERVALS}\n{equal.replace('1,1', '3,3')}\n")
    for own, other in (("day.csv", "equal.csv"), ("equal.csv", "day.csv"), ("equal.csv", "equal.csv")):
        assert ptcc("certify", own, "--no-simulation", "-o", "one.json").code == 0
        run = ptcc("check", "one.json", other)
        assert run.code == 0 and f"{other}, read by default" in run.out, run
    run = ptcc("check", "one.json", "other.csv")
    assert run.code == 1 and "another graph than other.csv" in " ".join(run.out.split()), run
    for words in (("day.csv",), ("day.csv", "--uncertainty", "0"), ("day.csv", "--switching")):
        assert ptcc("check", "one.json", *words).code == 0
    assert ptcc("check", "one.json", "day.csv", "--signal", "constant").code == 2


def test_modes_are_the_same_in_any_order_and_by_any_name():
    """Which file is which is told where names or order are others; no claim rests on them."""
    assert ptcc("certify", *BOTH, "-o", "c.json").code == 0
    plain = ptcc("check", "c.json", "day.csv", "night.csv")
    assert plain.code == 0 and "modes" not in plain.out
    turned = ptcc("check", "c.json", "night.csv", "day.csv")
    assert turned.code == 0 and "in another order than in the certificate, day, night" in turned.out
    Path("noon.csv").write_text(FILES["night.csv"])
    named = ptcc("check", "c.json", "day.csv", "noon.csv")
    assert named.code == 0 and "modes day, noon are called day, night in the certificate" in named.out
    Path("day.csv").write_text(FILES["night.csv"])
    Path("night.csv").write_text(FILES["day.csv"])
    swapped = ptcc("check", "c.json", *BOTH)
    assert swapped.code == 0 and "modes night, day are called day, night" in swapped.out


def test_files_are_read_as_the_reader_says():
    options = ("--uncertainty", "5%", "--edges", "listens", "--optional", "c,b", "--undirected")
    assert ptcc("certify", *BOTH, *options, "-o", "c.json").code == 0
    run = ptcc("check", "c.json", "day.csv", "night.csv", *options)
    said = "read as the options say: --edges listens --undirected --uncertainty 5% --optional c,b"
    assert run.code == 0 and said in " ".join(run.out.split())
    for words in ((), options[:4], options[2:]):
        run = ptcc("check", "c.json", *BOTH, *words)
        assert run.code == 1 and " is what you mean" in " ".join(run.out.split()), run
        told = " ".join(run.out.split()).partition("accepted if")[2]
        assert all(flag in told for flag in {*options[::2]} - {*words})
    assert ptcc("check", "c.json", *BOTH, *options).code == 0
    for other in (("--uncertainty", "1%"), ("--optional", "a,b")):
        assert ptcc("check", "c.json", *BOTH, *options, *other).code == 1
    Path("s.toml").write_text('[graph]\nfile = ["day.csv", "night.csv"]\nuncertainty = "5%"\noptional = ["a,b"]\n')
    assert ptcc("certify", "s.toml", "-o", "d.json").code == 0
    assert ptcc("check", "d.json", "s.toml").code == 0
    assert ptcc("check", "d.json", "day.csv", "night.csv").code == 1
    assert ptcc("check", "c.json", "s.toml").code == ptcc("check", "d.json", "s.toml", "--uncertainty", "1%").code == 1
    Path("e.json").write_text(Path("c.json").read_text().replace('"1/20",\n   "optional"', '[],\n   "optional"'))
    assert ptcc("check", "e.json").code == 0 and ptcc("check", "e.json", *BOTH).code == 1


@pytest.mark.few(0)
def test_a_scenario_lists_the_graphs_of_a_family():
    """Its certificate is that of the same flags, and is checked against the scenario."""
    run = ptcc("certify", "s.toml", "-o", "c.json")
    assert run.code == 0 and "4 edges, 4 uncertain" in run.out
    assert ptcc("check", "c.json", "s.toml").code == 0
    assert ptcc("certify", *BOTH, "--uncertainty", "5%", "--kappa", "3", "-o", "d.json").code == 0
    one, other = (json.loads(Path(name).read_text()) for name in ("c.json", "d.json"))
    assert one["digest"] == other["digest"]
    assert one["unverified"]["scenario"]["graph"]["file"] == ["day.csv", "night.csv"]
    assert "4 uncertain" not in ptcc("classify", "s.toml", "--uncertainty", "0").out


def test_the_json_is_the_certificate_or_the_decision():
    certificate = json.loads(ptcc("certify", *BOTH, "--json").out)
    assert certificate["verdict"] == CERTIFIED and len(certificate["problem"]["graph"]["modes"]) == 2
    decision = json.loads(ptcc("classify", "day.csv", "spoiled.csv", "--switching", "--json").out)
    (part,) = decision["components"]
    assert part["behaviour"] == "depends on the signal" and part["counterexample"]["kind"] == "moving rest state"
    assert [mode["name"] for mode in decision["modes"]] == ["day", "spoiled"]


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("words", "code", "says"),
    thinned(
        [
            ((*BOTH, "--expect", "bipartite-consensus"), 0, "met: bipartite consensus"),
            ((*BOTH, "--expect", "bipartite-containment"), 0, "met: bipartite containment"),
            ((*BOTH, "--expect", "stability"), 3, "refuted: stability (held in day, a hears nobody else and keeps"),
            ((*BOTH, "--expect", "consensus"), 3, "refuted: consensus"),
            ((*BOTH, "--min-rate", "0.1"), 0, "met: rate >= 0.1"),
            ((*BOTH, "--min-rate", "100"), 3, "refuted: rate >= 100 (upper bound"),
            ((*BOTH, "--min-rate", "1"), 4, "left open: rate >= 1 (proved: 0.955"),
            ((*BOTH, "--kappa", "3", "--max-input", "1000"), 0, "met: |u_k| <= 1000"),
            ((*BOTH, "--kappa", "3", "--max-input", "1"), 3, "it is up to 57.888 at the start, proved"),
            ((*BOTH, "--kappa", "3", "--max-input", "59"), 4, "left open: |u_k| <= 59"),
            (("day.csv", "spoiled.csv", "--switching", "--min-rate", "1"), 3, "no rate holds for every signal"),
            (("day.csv", "spoiled.csv", "--switching", "--expect", "bipartite-consensus"), 3, "multiply to -1"),
            ((*SPOILED, "--signal", "constant"), 0, "never change: day: bipartite consensus; spoiled: consensus"),
            ((*SPOILED, "--signal", "constant", "--expect", "bipartite-consensus"), 0, "met: bipartite consensus"),
            ((*SPOILED, "--signal", "constant", "--min-rate", "1"), 4, "modes that end differently"),
            (FIXED, 4, "no rate is certified"),
            ((*FIXED, "--expect", "bipartite-containment"), 0, "met: bipartite containment: of fixed weights"),
            ((*FIXED, "--expect", "bipartite-containment", "-o", "c.json"), 4, "nothing was written"),
            ((*FIXED, "--expect", "stability"), 3, "refuted: stability"),
            ((*BOTH, "--signal", "constant"), 0, "certified"),
        ],
        2,
    ),
)
def test_the_exit_code_agrees_with_what_was_asked(words: tuple[str, ...], code: int, says: str):
    run = ptcc("certify", *words)
    assert run.code == code and says in " ".join((run.out + run.err).split()), run


def test_a_refuted_expectation_is_one_line_with_the_counterexample():
    run = ptcc("classify", *BOTH, "--expect", "stability")
    assert run.code == 3 and run.err == "refuted: stability (held in day, a hears nobody else and keeps its value)\n"
    assert ptcc("classify", *BOTH, "--expect", "bipartite-consensus").code == 0


def test_what_is_not_decided_says_what_to_try_and_writes_nothing():
    """Rows of 300 agents that agree by a coincidence of weights."""
    rows = ["left,n1,1,1", "right,n1,2,2"]
    for k in range(2, 301):
        rows += [f"n{k - 1},n{k},{k},{k}", f"left,n{k},1,1", f"n{min(k + 1, 300)},n{k},3,3" if k < 300 else ""]
    rows += [f"{leader},{agent},1,1" for leader in ("left", "right") for agent in ("twin", "other")]
    Path("many.csv").write_text("\n".join([INTERVALS, *filter(None, rows), "twin,other,0,1", ""]))
    run = ptcc("classify", "many.csv")
    assert run.code == 4 and "round the weights" in run.err
    assert ptcc("classify", "many.csv", "--expect", "stability").code == 3
    run = ptcc("certify", "many.csv", "-o", "c.json")
    assert run.code == 4 and "undecided: " in run.out and not Path("c.json").exists()
    run = ptcc("certify", "many.csv", "--min-rate", "0.001")
    assert run.code == 4 and "left open: rate >= 0.001" in " ".join(run.out.split()), run


@pytest.mark.parametrize("command", ["design", "explore"])
def test_commands_about_one_graph_say_so(command: str):
    needs = ("--max-input", "1", "--initial-bound", "1", "--deadline", "1") if command == "design" else ()
    for words in (("day.csv", "night.csv"), ("unsure.csv",), ("day.csv", "--switching")):
        run = ptcc(command, *words, *needs)
        assert (run.code, run.out, len(run.err.splitlines())) == (2, "", 1), run
        assert re.search(
            "takes one graph|ptcc classify, certify, simulate and plot take|option of ptcc classify, ptcc certify",
            run.err,
        )
    if command != "explore":
        assert f"ptcc {command} takes one graph" in ptcc(command, "s.toml").err


def test_help_names_the_commands_that_take_families():
    taken = "`classify`, `certify`, `simulate`, `plot` and `check` take families"
    assert taken.replace("`", "") in " ".join(ptcc("--help").out.replace("`", "").split())
    for words in (("unsure.csv", "--switching"), ("unsure.csv", "--what", "graph")):
        assert ptcc("plot" if "--what" in words else "simulate", *words).code == 0
    for file in ("unsure.csv", "may_fail.csv"):
        for command in (("explore", file), ("batch", file)):
            run = ptcc(*command)
            assert "ptcc classify, certify, simulate and plot take it" in " ".join((run.out + run.err).split()), run


@pytest.mark.few(0)
def test_pages_statements_and_figures_are_made_of_the_certificate_of_a_family():
    assert ptcc("certify", *BOTH, "--kappa", "3", "--x0", "3,1,2", "-o", "c.json").code == 0
    for name in ("p.html", "p.tex"):
        files = "written    p.tex, p_graph.pdf\n" * (name == "p.tex")
        assert ptcc("report", "c.json", "-o", name, "--no-simulation").out == f"certified  {name}\n{files}"
    assert "Bipartite consensus at T = 1 for every signal" in Path("p.html").read_text("utf-8")
    for what in ("decay", "graph"):
        assert ptcc("plot", "c.json", "--what", what).out == f"written    c-{what}.png\n"
        assert Path(f"c-{what}.png").stat().st_size > 10_000


@pytest.mark.campaign
def test_the_sliding_mode_protocol_has_pages_statements_and_figures_of_families():
    slide = ("--kappa", "3", "--x0", "3,1,2", "--protocol", "sliding-mode", "--delta", "1", "--sigma0", "random")
    assert ptcc("certify", *BOTH, *slide, "-o", "c.json").code == 0
    checked = ptcc("check", "c.json", *BOTH)
    assert checked.code == 0 and "for every signal and disturbance" in checked.out
    for name in ("p.html", "p.tex"):
        files = "written    p.tex, p_graph.pdf\n" * (name == "p.tex")
        assert ptcc("report", "c.json", "-o", name, "--no-simulation").out == f"certified  {name}\n{files}"
    assert "Sliding-mode protocol" in Path("p.html").read_text("utf-8")
    assert ptcc("plot", "c.json", "--what", "input").out == "written    c-input.png\n"
    assert "--disturbance: runs of a family" in ptcc("plot", *BOTH, *slide, "--disturbance", "sin(t)").err


@pytest.mark.campaign
def test_figures_are_made_of_the_files_of_a_family():
    assert ptcc("plot", *BOTH).out == "written    day-graph.png\n"
    assert ptcc("plot", "unsure.csv", "--what", "input", "--x0", "3,1,2").out == "written    unsure-input.png\n"
    for words, told in (
        (("plot", *BOTH, "--what", "spectrum"), "eigenvalues of single graphs do not tell"),
        (("plot", "day.csv", "night.csv"), "2 graphs; add --switching"),
        (("plot", *BOTH, "--what", "states", "--gain-cap", "3"), "--gain-cap is for one graph"),
        (("plot", *BOTH, "--wide"), "--wide is for the states of one graph; figures of families are one column wide"),
    ):
        run = ptcc(*words)
        assert (run.code, run.out) == (2, "") and told in run.err, run


def test_a_certificate_without_an_initial_state_is_drawn_from_one_that_is_given():
    certify(read_family(BOTH[:2]), NominalProtocol(T=1, rho1=1, rho2=1, kappa=3)).save("c.json")
    assert "give one with --x0" in ptcc("plot", "c.json", "--what", "states").err
    assert ptcc("plot", "c.json").code == 0  # a glance, of the graphs alone
    assert ptcc("plot", "c.json", "--what", "states", "--x0", "3,1,2").code == 0
    assert "is a certificate, which is drawn by itself" in ptcc("plot", "c.json", "day.csv").err
    assert "--switching is for a graph" in ptcc("plot", "c.json", "--switching").err


def _rows(*rows: str, header: str = INTERVALS) -> str:
    return "\n".join([header, *rows, ""])


@pytest.mark.few(0)
def test_a_family_is_certified_for_every_disturbance(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    Path("day.csv").write_text("a,b,1\nb,a,1\nb,c,-1\n")
    Path("night.csv").write_text("a,b,1\nb,a,2\na,c,-1\n")
    Path("s.toml").write_text(
        '[graph]\nfile = ["day.csv", "night.csv"]\nuncertainty = "10%"\n[protocol]\nkind = "sliding-mode"\nkappa = 3\n'
        '[initial_state]\nx0 = [1, 2, 3]\nsigma0 = [1, 0.5, -0.25]\n[disturbance]\nsignal = "sin(t)"\n'
    )
    flags = ("--protocol", "sliding-mode", "--kappa", "3", "--sigma0", "1,0.5,-0.25", "--x0", "1,2,3")
    family = ("day.csv", "night.csv", "--switching", "--uncertainty", "10%")
    run = ptcc("certify", *family, *flags, "-o", "c.json")
    assert run.code == 0 and max(map(len, run.out.splitlines())) <= 80
    assert "at T = 1 for every signal and disturbance" in run.out and "sigma(0) given" in run.out
    assert "T_r + 0.99 T_s" in run.out
    assert ptcc("check", "c.json", *family).code == 0
    data = json.loads(Path("c.json").read_text())
    assert len(data["drives"]) == len(data["decays"]) > 0
    assert "reaching time at most" in ptcc("certify", *family, *flags, "-v").out
    assert ptcc("certify", "s.toml", "-o", "s.json").code == 0 == ptcc("simulate", "s.toml", "--steps", "2").code
    assert json.loads(Path("s.json").read_text())["digest"] == data["digest"]
    direct = ptcc("certify", *family, *flags[:4], "--x0", "1,2,3")
    assert "sigma(0) 0" in direct.out and "at 0.99 T" in direct.out and direct.code == 0


@pytest.mark.few(0)
def test_rows_with_intervals_that_are_always_zero_and_self_loops_are_dropped_where_asked(folder):
    Path("i.csv").write_text(_rows("a,b,1,2", "b,c,0,0.0", "c,c,1,2", "c,a,-2,-1"))
    dropped = ("--drop-zeros", "--drop-self-loops")
    assert (
        "--drop-zeros" in ptcc("certify", "i.csv").err
        and "--drop-self-loops" in ptcc("certify", "i.csv", dropped[0]).err
    )
    run = ptcc("certify", "i.csv", *dropped, "-o", "i.json", "-v")
    assert run.code == 0 and "1 self-loop and 1 row of weight 0 dropped" in " ".join(run.out.split())
    assert ptcc("check", "i.json", "i.csv", *dropped).code == 0
    Path("same.csv").write_text(_rows("a,b,1,2", "c,a,-2,-1"))
    assert ptcc("check", "i.json", "same.csv").code == 0


@pytest.mark.few(0)
def test_a_file_of_intervals_in_which_all_weights_are_known_is_compared_as_its_sender_read_it(folder):
    Path("k.csv").write_text(_rows("lead,a,1,1", "a,b,2,2", "b,a,0,0", "b,b,1,2"))
    dropped = ("--drop-zeros", "--drop-self-loops")
    assert ptcc("certify", "k.csv", *dropped, "-o", "k.json").code == 0
    run = ptcc("check", "k.json", "k.csv")
    assert run.code == 1 and "accepted if --drop-self-loops --drop-zeros is what you mean" in " ".join(run.out.split())
    assert ptcc("check", "k.json", "k.csv", *dropped).code == 0


def test_a_header_of_intervals_in_another_order_is_said_to_be_read(folder):
    for weights, said in (("1,2", "columns by header"), ("2,2", "columns by header: information flows")):
        Path("i.csv").write_text(f"target,source,min,max\na,b,{weights}\nb,a,{weights}\n")
        assert said in " ".join(ptcc("certify", "i.csv").out.split())


@pytest.mark.few(0)
def test_columns_of_intervals_that_are_not_read_are_named_and_a_column_of_delays_where_none_is_asked_for(folder):
    Path("i.csv").write_text("source,target,min,max,lag,year\na,b,1,2,0.1,1999\nb,c,1,2,0.1,2000\n")
    told = " ".join(ptcc("certify", "i.csv").out.split())
    assert 'columns ignored: "lag", "year"' in told
    told = " ".join(ptcc("certify", "i.csv", "--delay", "lag", "--gain-cap", "5").out.split())
    assert 'delays of column "lag"; columns ignored: "year"' in told
    Path("j.csv").write_text("a,b,1\nb,c,1\n")
    told = " ".join(ptcc("certify", "i.csv", "j.csv", "--switching").out.split())
    assert 'i: columns ignored: "lag", "year"' in told and "j: columns" not in told


def test_all_that_is_wrong_with_rows_of_intervals_is_one_message(folder):
    rows = "a,b,1,2", "a,a,1,2", "b,c,0,0", "c,c,1,2", "b,c,3,2", ",c,1,2", "a,b,1,2", "b,d,x,1"
    Path("bad.csv").write_text(_rows(*rows))
    run = ptcc("certify", "bad.csv", "--undirected")
    assert run.code == 2 and run.err.count("\n") == 1
    for part in (
        "line 3: self-loop at node a (2 in all); line 4: edge b -> c: its weight is always 0; line 6: edge b -> c: the",
        "line 7: the source is empty (name the source or remove the row); line 8: second row for edge a -> b (the",
        'line 9: edge b -> d: "x" is not a number',
        "mend these, or all but line 6, line 7, line 8, line 9 with --drop-self-loops --drop-zeros",
    ):
        assert part in run.err, run.err
    Path("bad.csv").write_text(_rows("a,b,1,2", "a,a,1,2", "b,c,0,0"))
    assert "mend these, or read it with --drop-self-loops --drop-zeros" in (run := ptcc("certify", "bad.csv")).err
    assert ptcc("certify", "bad.csv", "--drop-self-loops", "--drop-zeros").code == 0


BAD = {
    "least above largest": (_rows("a,b,2,1"), (), "bad.csv, line 2: edge a -> b: the least weight 2 is above"),
    "always zero": (_rows("a,b,0,0"), (), "line 2: edge a -> b: its weight is always 0"),
    "two signs in one mode": (_rows("a,b,1,2", "a,b,-2,-1"), (), "line 3: second row .* two files \\(modes\\), or one"),
    "both directions of an undirected edge": (
        _rows("a,b,1,2", "b,c,1,1", "b,a,1,2"),
        ("--undirected",),
        "bad.csv, line 4: second row for edge b -> a .the first is line 2.; --undirected makes each row both",
    ),
    "one end": (_rows("a,b,1", header="source,target,weight_min"), (), "one end of the intervals"),
    "no number": (_rows("a,b,1,x"), (), 'line 2: edge a -> b: "x" is not a number'),
    "empty end": (_rows("a,b,,2"), (), "line 2: edge a -> b"),
    "missing end": (_rows("a,b,nan,2"), (), 'line 2: edge a -> b has no weight; add one in column "weight_min"'),
    "not finite": (_rows("a,b,-inf,2"), (), "not a finite number"),
    "no weight": (_rows("a,b,yes", header="source,target,optional"), (), "names no weight"),
    "answer": (
        _rows("a,b,1,perhaps", header="source,target,weight,optional"),
        (),
        "optional is perhaps; write yes or no",
    ),
    "loop": (_rows("a,a,1,2"), (), "self-loop at node a"),
    "no source": (_rows(",b,1,2"), (), "the source is empty"),
    "no rows": (_rows(), (), "bad.csv: no edge and no node"),
    "sum of intervals": (
        _rows("a,b,1,2"),
        ("--duplicates", "sum"),
        "--duplicates is not for rows with intervals, which are not merged",
    ),
    "columns of intervals": (
        _rows("a,b,1,2"),
        ("--columns", "1,2,3"),
        "--columns is not for rows with intervals, which are",
    ),
    "interval and share": (_rows("a,b,1,2"), ("--uncertainty", "1%"), "gives intervals itself"),
    "other nodes": ("a,b,1", ("day.csv", "--switching"), "mode bad has no node c, which another mode has"),
    "not switching": ("a,b,1", ("day.csv",), "2 graphs; add --switching"),
    "more than all": ("a,b,1", ("--uncertainty", "150%"), "uncertainty = 150% is not from 0 to 1"),
    "percent": ("a,b,1", ("--uncertainty", "10"), "write 10% if it is one"),
    "no share": ("a,b,1", ("--uncertainty", "much"), '"much" is not a number'),
    "no edge": ("a,b,1", ("--optional", "a"), "--optional: a is no edge; write SOURCE,TARGET"),
    "unknown edge": ("a,b,1", ("--optional", "a,c"), "optional edge a -> c is in no file; check the labels"),
    "turned edge": (
        "a,b,1",
        ("--optional", "a,b", "--edges", "listens"),
        "optional edge a -> b is in no file; b -> a is: name the one who is heard first",
    ),
    "standard input twice": ("a,b,1", ("-", "-", "--switching"), "standard input, which is one graph"),
    "a scenario beside": ("a,b,1", ("s.toml", "--switching"), "a scenario stands alone"),
    "signal": ("a,b,1", ("--signal", "fast"), "'fast' is not one of"),
    "disturbance": (
        _rows("a,b,1,2"),
        ("--protocol", "sliding-mode", "--disturbance", "sin(t)"),
        "no run is made of a family",
    ),
    "restricted signals": (
        _rows("a,b,1,2"),
        ("--protocol", "sliding-mode", "--dwell", "1"),
        "restricted signals are certified under the nominal protocol",
    ),
    "no deadline": (_rows("a,b,1,2"), ("--rho2", "0"), "rho2 = 0 gives no deadline"),
    "another length": (_rows("a,b,1,2"), ("--x0", "1,2,3"), "3 values for 2 nodes"),
    **{
        f"option {flag}": (
            _rows("a,b,1,2"),
            (flag, *value),
            f"{flag}:? (is for one graph, not for families|belongs to)",
        )
        for flag, *value in (
            *(("--stop-before", "0.1"), ("--sample-period", "0.1"), ("--simulation",), ("--disturbance", "none")),
            *(("--method", "paper"), ("--at", "0.5"), ("--initial-bound", "1"), ("--sigma0", "1")),
        )
    },
}


@pytest.mark.parametrize("name", BAD)
def test_a_family_that_is_none_is_refused_in_one_line(name: str):
    text, words, says = BAD[name]
    Path("bad.csv").write_text(text)
    run = ptcc("certify", "bad.csv", *words, "-o", "c.json")
    assert (run.code, run.out, len(run.err.splitlines())) == (2, "", 1), run
    assert re.search(says, run.err), run.err
    assert not Path("c.json").exists()


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("file = []", "s.toml: [graph] file: names no graph"),
        ("file = [1]", "s.toml: [graph] file: write a list of texts"),
        ('file = ["day.csv", "nowhere.csv"]', "[graph] file: nowhere.csv: no such file"),
        ('file = "day.csv"\nuncertainty = 3', "s.toml: [graph] uncertainty: uncertainty = 3 is not from 0 to 1"),
        ('file = "day.csv"\nuncertainty = true', "s.toml: [graph] uncertainty: write a text"),
        ('file = "day.csv"\noptional = ["a;b"]', "s.toml: [graph] optional: a;b is no edge"),
        ('file = "day.csv"\noptional = [1]', "s.toml: [graph] optional: write a list of texts"),
        ('file = "day.csv"\nsignal = "now"', "s.toml: [graph] signal: 'now' is not one of"),
        ('file = "unsure.csv"\n[limits]\nstop_before = 0.1', "s.toml: [limits] stop_before: is for one graph"),
    ],
)
def test_what_is_wrong_with_the_family_of_a_scenario_is_told_by_its_key(text: str, says: str):
    Path("s.toml").write_text(f"[graph]\n{text}\n")
    run = ptcc("certify", "s.toml")
    assert run.code == 2 and says in run.err and len(run.err.splitlines()) == 1, run


def test_what_new_writes_tells_of_families():
    text = ptcc("new").out
    assert "# uncertainty = " in text and '["day.csv", "night.csv"]' in text
    assert "repeat" not in text and ",  [default" not in text


def test_new_takes_the_graphs_of_a_family():
    assert ptcc("new", *BOTH[:2], "-o", "n.toml").code == 0
    assert '\nfile = ["day.csv", "night.csv"] ' in Path("n.toml").read_text()
    assert ptcc("classify", "n.toml").out == ptcc("classify", *BOTH).out
    assert 'file = "unsure.csv"' in ptcc("new", "unsure.csv").out
    assert "has no node c, which another mode has" in ptcc("new", "day.csv", "other.csv").err


def test_modes_are_called_by_their_files():
    assert [mode.name for mode in read_family(["day.csv", "night.csv"]).modes] == ["day", "night"]
    assert "day, night: 2 modes" in ptcc("classify", *BOTH).out


@pytest.mark.few(0)
def test_a_file_that_is_given_twice_is_told():
    for command in ("classify", "certify"):
        run = ptcc(command, "day.csv", "night.csv", "day.csv", "--switching")
        told = "day.csv was given 2 times: modes day, day (3) are the same"
        assert run.code == 0 and told in " ".join(run.out.split()), run
        assert "given" not in ptcc(command, *BOTH).out


@pytest.mark.few(0)
def test_no_name_of_a_file_or_a_mode_steers_the_terminal():
    odd = "day\x1bc.csv"
    Path(odd).write_text(FILES["day.csv"])
    both = (odd, "night.csv", "--switching")
    out = "c\x1bc.json"
    for words in (
        *(("classify", *both), ("classify", *both, "-v"), ("certify", *both, "-v", "-o", out), ("certify", *both)),
        *(("check", out, *both), ("check", out, *both, "-v"), ("check", out, *BOTH, "-v"), ("check", out, *BOTH)),
        *(("check", out, odd), ("simulate", *both, "-o", "r\x1b.csv"), ("certify", odd, "night.csv")),
        *(("certify", *both, "--expect", "stability"), ("classify", odd, "spoiled.csv", "--switching", "-v")),
    ):
        run = ptcc(*words)
        assert "\x1b" not in run.out + run.err and len(run.out + run.err) > 10, words


@pytest.mark.campaign
def test_more_is_claimed_for_restricted_signals():
    spoiled = ("day.csv", "spoiled.csv", "--switching")
    outage = ("day.csv", "outage.csv", "--switching")
    Path("outage.csv").write_text("a,,\nb,,\nc,,\n")
    for words, line in (
        ((*BOTH, "--dwell", "0.2"), "dwell      at least 0.2 of time between switches: rate "),
        ((*BOTH, "--dwell", "5"), "dwell      at least 5 of time between switches, longer than T: at most"),
        ((*BOTH, "--clock-dwell", "3"), "dwell      at least 3 of the clock between switches: rate "),
        ((*BOTH, "--signal", "constant"), "constant   if mode and weights never change: rate "),
        ((*spoiled, "--dwell", "0.2"), "dwell      at least 0.2 of time between switches: the last mode decides"),
        (
            (*outage, "--share", "0.5", "--share", "50%"),
            "shares     modes at 0.5, 0.5 of the clock: bipartite consensus",
        ),
        ((*outage, "--clock-window", "2", "--window-on", "1"), "windows    each edge on for 1 of every 2 of the clock"),
    ):
        run = ptcc("certify", *words, "--kappa", "3", "-o", "c.json")
        assert run.code == 0 and line in run.out, run
        checked = ptcc("check", "c.json")
        assert checked.code == 0 and line in checked.out, checked


def test_where_nothing_is_proved_of_the_signals_asked_for_a_reason_is_told_and_the_verdict_leaves_them_open(
    folder: Path,
) -> None:
    Path("sour.csv").write_text("a,b,1\nb,a,-1\nb,c,1\n")
    Path("sweet.csv").write_text("a,b,1\nb,a,1\nb,c,1\n")
    Path("outage.csv").write_text("a,,\nb,,\nc,,\n")
    sour, outage = (("sweet.csv", f"{name}.csv", "--switching") for name in ("sour", "outage"))
    for words, reason in (
        ((*sour, "--clock-dwell", "3"), "switches never end"),
        ((*sour, "--share", "1", "--share", "0"), "no function of all modes that falls with these shares was found"),
        ((*outage, "--share", "0", "--share", "1"), "no function of all modes that falls with these shares was found"),
        ((*sour, "--clock-window", "1e9", "--window-on", "1"), "a rate exists, too small to matter"),
    ):
        run = ptcc("certify", *words, "-q")
        assert run.code == 4
        told = " ".join(ptcc("certify", *words).out.split())
        assert told.count(reason) == 2 and "verdict left open: what these signals do" in told, told
    run = ptcc("certify", "sweet.csv", "sweet.csv", "--switching", "--clock-window", "1e9", "--window-on", "1")
    assert run.code == 0 and ", as for every signal; nothing more is proved" in " ".join(run.out.split())


def test_rates_below_every_number_are_said_to_be_too_small_to_matter(folder: Path) -> None:
    ring = [f"{i},{i + 1},{1 if i % 3 else -1}" for i in range(30)]
    back = [f"{i + 1},{i},{1 if i % 3 else -1}" for i in range(30)]
    Path("ring.csv").write_text("\n".join([*ring, "30,0,-1"]))
    Path("back.csv").write_text("\n".join([*back, "0,30,1"]))
    windows = ("--clock-window", "9", "--window-on", "1", "--time-limit", "2")
    run = ptcc("certify", "ring.csv", "back.csv", "--switching", *windows)
    assert "stability; a rate exists, too small to matter" in " ".join(run.out.split()) and "1e-" not in run.out


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (("--dwell", "1", "--clock-dwell", "1"), "give one of them"),
        (("--dwell", "0"), "dwell = 0 is outside its domain"),
        (("--dwell", "1", "--signal", "constant"), "never switches"),
        (("--window", "1"), "windows of time prove nothing at T"),
        (("--clock-window", "1"), "give both"),
        (("--clock-window", "1", "--window-on", "2"), "at most the whole window"),
        (("--clock-window", "1", "--window-on", "1", "--dwell", "1"), "signals of different kinds"),
        (("--share", "0.7"), "--share: 1 given, and 2 modes; give one for each"),
        (("--share", "0.7", "--share", "20%"), "sum to 9/10; give one for each mode, 1 in all"),
        (("--share", "0.7", "--share", "x%"), "share = x is not a finite number"),
    ],
)
def test_restricted_signals_that_are_none_are_refused(words: tuple[str, ...], reason: str):
    run = ptcc("certify", *BOTH, *words)
    assert run.code == 2 and reason in run.err and run.err.count("\n") == 1, run


def test_one_graph_has_no_restricted_signals():
    run = ptcc("certify", "day.csv", "--dwell", "1")
    assert run.code == 2 and "--dwell is for families" in run.err, run


@pytest.mark.campaign
def test_restricted_signals_are_keys_of_scenarios():
    Path("t.toml").write_text(FILES["s.toml"].replace("[protocol]", 'dwell = "0.2"\n[protocol]'))
    run = ptcc("certify", "t.toml")
    assert run.code == 0 and "at least 0.2 of time between switches" in run.out, run


@pytest.mark.few(0)
def test_one_graph_that_switches_is_told_that_nothing_changes():
    run = ptcc("certify", "day.csv", "--switching", "--no-simulation")
    assert run.code == 0 and run.err == (
        "note: --switching with one graph changes nothing; name the other modes beside it\n"
    )
    assert ptcc("certify", "day.csv", "--switching", "--no-simulation", "-q").err == ""
    assert ptcc("classify", *BOTH).err == ""


def test_a_family_is_called_by_its_files_without_their_folders(tmp_path: Path):
    (line, *_) = ptcc("classify", str(tmp_path / "unsure.csv")).out.splitlines()
    assert line.startswith("family     unsure.csv: 3 nodes"), line


@pytest.mark.few(0)
def test_a_check_without_graphs_tells_of_which_family_the_certificate_speaks():
    assert ptcc("certify", *BOTH, "-o", "c.json", "-q").code == 0
    digest = json.loads(Path("c.json").read_text())["problem"]["graph"]["sha256"]
    told = f"graph 2 modes, 3 nodes, 4 edges, as in the file; name yours to compare; SHA-256 {digest} "
    assert " ".join(ptcc("check", "c.json").out.split()).startswith(told)
    assert "as in the file; name" not in ptcc("check", "c.json", *BOTH).out


@pytest.mark.few(0)
def test_a_share_that_was_typed_as_a_percentage_is_one_in_the_check():
    assert ptcc("certify", "day.csv", "--uncertainty", "20%", "-o", "c.json", "-q").code == 0
    assert "--uncertainty 20%" in " ".join(ptcc("check", "c.json", "day.csv", "--uncertainty", "0.2").out.split())
    assert ptcc("certify", "day.csv", "--uncertainty", "1/3", "-o", "third.json", "-q").code == 0
    assert "accepted if --uncertainty 1/3 is" in " ".join(ptcc("check", "third.json", "day.csv").out.split())


def test_a_misprint_in_a_mode_names_the_node_that_is_near():
    Path("one.csv").write_text("ann,bob,1\nbob,eve,1\n")
    Path("two.csv").write_text("anne,bob,1\nbob,eve,1\n")
    run = ptcc("classify", "one.csv", "two.csv", "--switching")
    assert run.code == 2 and "two has no node ann, which another mode has; did you mean anne? declare it" in run.err


def test_what_the_time_limit_cut_off_of_a_family_is_a_sentence(monkeypatch: pytest.MonkeyPatch):
    from lmi.errors import OutOfTime
    from ptcc_certify.certificate import family_certification

    def late(*_: object) -> None:
        raise OutOfTime("late")

    monkeypatch.setattr(family_certification, "prove_signal_rate_bound", late)
    assert "note       upper bound on the decay rate: cut off by the time limit" in ptcc("certify", *BOTH, "-v").out


def test_what_is_cut_on_the_short_screen_ends_at_a_word():
    text = "end between these " * 20
    for start in range(18):
        whole = text[start:].strip()
        cut = _cut(whole)
        assert whole.startswith(cut.removesuffix("... (all with -v)")) and cut != whole, cut
        assert len(wrap_text(cut)) == 3


def test_one_switch_is_called_one():
    Path("one.csv").write_text("c,b,1\nb,a,1\na,c,9\n")
    Path("two.csv").write_text("c,b,1\nb,a,9\na,c,1\n")
    run = ptcc("certify", "one.csv", "two.csv", "--switching", "--dwell", "1")
    assert "times at the one switch" in " ".join(run.out.split()), run.out
