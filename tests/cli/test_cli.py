"""The command line as a user meets it: what it prints, writes, refuses, and with which code it ends."""

from __future__ import annotations

import csv
import io
import json
import math
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bad_inputs import BAD_INPUTS, BadInput, Run, detailed, listing, ptcc, write
from cpu_time import at_most
from generators import all_classes, random_graph
from scipy.linalg import expm
from selection import thinned

from ptcc_certify.bounds.envelope import Envelope
from ptcc_certify.checker import check, read
from ptcc_certify.examples import EXAMPLES, GRAPHS, load_graph, select
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.io import read_graph, write_graph
from ptcc_certify.graphs.structure import BEHAVIOURS, analyse
from ptcc_certify.report.screen import SECTIONS, check_summary

pytestmark = pytest.mark.usefixtures("quick_search")

X0 = "5,2,-4,3,-2,1"
PAPER = ("--method", "paper", "--no-simulation")


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def one_object(text: str) -> dict[str, Any]:
    """Parse exactly one JSON object; no NaN, no infinity, no key twice."""

    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        keys = [key for key, _ in pairs]
        assert len(set(keys)) == len(keys)
        return dict(pairs)

    def refuse(constant: str) -> None:
        raise AssertionError(constant)

    def finite(number: str) -> float:
        assert math.isfinite(float(number)), number
        return float(number)

    data = json.loads(text, object_pairs_hook=unique, parse_constant=refuse, parse_float=finite)
    assert isinstance(data, dict)
    return data


def save(name: str, edges: list[tuple], nodes: list = []) -> str:  # noqa: B006
    write_graph(SignedDigraph.from_edges(edges, nodes), name)
    return name


def ring(n: int, last: int = 1) -> list[tuple[int, int, int]]:
    """A directed ring; balanced iff ``last`` is positive."""
    return [(i, i % n + 1, last if i == n else 1) for i in range(1, n + 1)]


# ---------------------------------------------------------------------- bad input


def assert_refused(run: Run) -> None:
    assert run.code == 2, run
    assert run.out == ""
    (line,) = run.err.splitlines()
    assert line.startswith("ptcc: ") and len(line) > 10
    assert line.isprintable()
    assert "Traceback" not in line


@pytest.mark.parametrize("case", BAD_INPUTS, ids=lambda case: case.name)
def test_bad_input_is_refused_in_one_line(case: BadInput, folder: Path):
    write(case.files, folder)
    before = listing(folder)
    with at_most(10):
        run = ptcc(*case.args, stdin=case.stdin)
    assert_refused(run)
    assert re.search(case.says, run.err), run.err
    assert listing(folder) == before


def test_the_names_of_the_table_differ():
    assert len({case.name for case in BAD_INPUTS}) == len(BAD_INPUTS) >= 45


SAMPLE = ("weight NaN", "XML entity bomb", "T NaN", "unknown command")


@pytest.mark.few(0)
@pytest.mark.parametrize("case", [c for c in BAD_INPUTS if c.name in SAMPLE], ids=lambda case: case.name)
def test_bad_input_to_a_process_of_its_own(case: BadInput, folder: Path):
    write(case.files, folder)
    before = listing(folder)
    assert_refused(process(*case.args))
    assert listing(folder) == before


def process(*args: str, stdin: bytes = b"", env: dict[str, str] | None = None) -> Run:
    done = subprocess.run(
        [sys.executable, "-m", "ptcc_certify.cli", *args],
        input=stdin,
        capture_output=True,
        timeout=60,
        env=os.environ | (env or {}),
    )
    encoding = (env or {}).get("PYTHONIOENCODING", "utf-8")
    return Run(done.returncode, done.stdout.decode(encoding), done.stderr.decode(encoding))


@pytest.mark.parametrize(
    "edges",
    [
        [("a", "b", "1e-300"), ("b", "a", "1e300")],
        [("a", "b", "1e-300"), ("b", "a", "-1e300")],
        [("a", "b", "1e-300"), ("b", "c", "1e300"), ("c", "b", "1e300")],
        [("a", "b", "1e300"), ("b", "a", "1e300"), ("b", "c", "1e-300"), ("c", "d", "-1e300"), ("d", "c", "1e-300")],
        [("a", "c", "1e300"), ("b", "c", "-1e-300"), ("c", "d", "1e-300"), ("d", "c", "1")],
        [("a", "c", "1.6e308"), ("b", "c", "-1.6e308")],
        [("a", "b", "1.6e308"), ("b", "a", "1.6e308"), ("c", "a", "1.6e308"), ("a", "c", "1.6e308")],
        [("a", "b", "1e-300"), ("b", "a", "-1e-300")],
    ],
)
def test_weights_at_the_ends_of_float64_give_an_answer(edges: list[tuple]):
    name = save("wide.csv", edges)
    for command in ("classify", "certify", "simulate"):
        run = ptcc(command, name)
        assert run.code in ({0} if command == "classify" else {0, 2, 4}), run
        assert "Traceback" not in run.err and "Warning" not in run.err
        if run.code == 2:
            assert_refused(run)
    run = ptcc("certify", name, "--json")
    assert run.code in {0, 4}
    assert one_object(run.out)["verdict"] == {0: "certified", 4: "undecided"}[run.code]


@pytest.mark.few(0)
def test_starts_of_any_size_are_compared_alike():
    """The problem is linear: a start 10^200 times as large has the same ratios."""
    ratios = []
    for scale in ("", "e200", "e-200"):
        run = ptcc("certify", "fig1a", "--x0", ",".join(x + scale for x in X0.split(",")), "--json")
        assert run.code == 0 and run.err == ""
        ratios.append(one_object(run.out)["unverified"]["simulation"]["worst_ratio"])
    assert ratios[0] > 0.01
    assert ratios == pytest.approx([ratios[0]] * 3, rel=1e-3)


# ---------------------------------------------------------------------- exit codes


def test_proved_is_0():
    run = detailed("certify", "fig1b", "--x0", X0)
    assert run.code == 0
    says = r"verdict    certified; \|\|E\|\| <= [0-9.e-]+ \|\|E\(0\)\|\| at 0.99 T"
    assert re.fullmatch(says, run.out.splitlines()[0])
    assert run.err == ""


def test_a_violated_bound_is_1(monkeypatch: pytest.MonkeyPatch):
    compare = Envelope.compare
    monkeypatch.setattr(Envelope, "compare", lambda self, run: replace(compare(self, run), worst_ratio=1.01))
    run = detailed("certify", "fig1b", "--expect", "stability")
    assert run.code == 1
    says = "VIOLATED: the simulated run exceeds the proved bound; please report this graph; refuted: stability"
    assert run.out.splitlines()[0].startswith(f"verdict    {says}")
    assert ptcc("examples", "fig1a").code == 1


def test_an_error_of_the_program_is_not_taken_for_a_violated_bound(monkeypatch: pytest.MonkeyPatch):
    def fail(*_: object, **__: object) -> None:
        raise RuntimeError("a bug")

    monkeypatch.setattr("ptcc_certify.certificate.certification.certify_case", fail)
    run = ptcc("certify", "fig1b", *PAPER)
    assert run.code == 70
    assert "RuntimeError" in run.err and "report" in run.err and run.out == ""
    for error, code in ((MemoryError(), 2), (OverflowError(), 2), (KeyboardInterrupt(), 130)):
        monkeypatch.setattr(
            "ptcc_certify.certificate.certification.certify_case",
            lambda *_, error=error, **__: (_ for _ in ()).throw(error),
        )
        run = ptcc("certify", "fig1b", *PAPER)
        assert (run.code, run.out, len(run.err.strip().splitlines())) == (code, "", 1)


@pytest.mark.few(0)
@pytest.mark.usefixtures("every_class")
@pytest.mark.parametrize("method", thinned(["paper", "perron", "lmi", "full", "best"], 2))
def test_the_method_decides_which_classes_are_searched(method: str):
    data = one_object(ptcc("certify", "fig3a", "--method", method, "--x0", X0, "--json").out)
    classes = [function["class"] for function in data["decays"]]
    wanted = {"paper": {"paper"}, "best": {"paper", "lmi", "full"}}.get(method, {"paper", method})
    assert classes[0] == "paper" and set(classes) == wanted
    assert set(data["unverified"]["search"]["searched"]) == (
        {"perron", "lmi", "full"} if method == "best" else wanted - {"paper"}
    )
    screen = detailed("certify", "fig3a", "--method", method, "--x0", X0).out
    assert ("searched" in screen) == ("used" in screen) == (method != "paper")
    assert len(screen.splitlines()) <= 36


def test_the_bound_at_an_instant_is_printed_for_every_agent():
    run = detailed("certify", "fig3a", *PAPER, "--x0", X0, "--at", "0.3")
    assert run.code == 0 and "at t = 0.3: 1 " in run.out and len(run.out.splitlines()) <= 36
    sliding = detailed("certify", "fig3a", *PAPER, "--protocol", "sliding-mode", "--sigma0", "random", "--at", "0.9")
    assert sliding.code == 0 and "at t = 0.9: 1 " in sliding.out and len(sliding.out.splitlines()) <= 36
    for bad in ("1", "-0.1", "soon", "nan", "1e999"):
        refused = ptcc("certify", "fig3a", f"--at={bad}")
        assert_refused(refused)
        assert "at" in refused.err


@pytest.mark.parametrize("command", ["classify", "certify"])
def test_a_refuted_expectation_is_3(command: str):
    run = detailed(command, "fig1b", "--expect", "stability")
    assert run.code == 3
    claimed = run.out.split("claim      ")[1].partition(" (")[0].partition(" at T")[0]  # not a weaker one
    said = f"refuted: stability (it is {claimed})"
    if command == "certify":
        assert run.out.splitlines()[0] == f"verdict    {said}; the rest is certified" and run.err == ""
    else:
        assert run.err == f"{said}\n" and run.out  # the answer is printed all the same


def test_check_of_a_refuted_question_says_so(folder: Path):
    assert ptcc("certify", "fig1b", "--expect", "stability", "--no-simulation", "-o", "c.json").code == 3
    for flags in ((), ("-v",)):
        run = ptcc("check", "c.json", "fig1b", *flags)
        assert run.code == 0 and "accepted   certified; what was asked is refuted; " in run.out
    said = one_object(ptcc("check", "c.json", "--json").out)
    assert (said["verdict"], said["asked"]) == ("certified", "refuted")
    assert ptcc("certify", "fig1b", "--no-simulation", "-o", "c.json").code == 0
    assert "asked" not in one_object(ptcc("check", "c.json", "--json").out)


def test_check_reads_the_graph_as_its_reader_says_not_its_sender(folder: Path):
    """Orientation, repeated edges, self-loops: what only the sender said is named, and the check fails."""
    Path("g.csv").write_text("a,b,1\na,b,1\nb,c,-0.5\nc,c,1\nc,a,2\nc,d,3\n")
    reading = ("--edges", "listens", "--duplicates", "sum", "--drop-self-loops")
    assert ptcc("certify", "g.csv", "--method", "paper", *reading, "--no-simulation", "-o", "c.json").code == 0
    run = detailed("check", "c.json", "g.csv", *reading)
    assert run.code == 0
    assert run.out.splitlines()[0] == f"graph      g.csv, read as the options say: {' '.join(reading)}"
    assert one_object(ptcc("check", "c.json", "g.csv", *reading, "--json").out)["graph_read"].endswith(
        " ".join(reading)
    )
    for words in ((), reading[:2], reading[2:], reading[4:], ("--edges", "information", *reading[2:])):
        run = detailed("check", "c.json", "g.csv", *words)
        missing = [flag for flag in ("--edges", "--duplicates", "--drop-self-loops") if flag not in words]
        assert run.code == 1 and run.err == "", run
        last = run.out.splitlines()[-1]
        assert last.startswith("rejected   graph: ")
        assert last.endswith(" is what you mean")
        assert all(flag in last.partition("accepted if")[2] for flag in missing)
        assert "--edges listens" in last or words[:2] == reading[:2]
        assert one_object(ptcc("check", "c.json", "g.csv", *words, "--json").out)["accepted"] is False
    run = detailed("check", "c.json", "g.csv", *reading, "--duplicates", "last")
    assert run.code == 1 and run.out.splitlines()[-1].endswith("accepted if --duplicates sum is what you mean")


def test_check_names_the_direction_that_a_header_does_not_tell(folder: Path):
    Path("de.csv").write_text("von;zu;gewicht\nann;bob;0,5\nbob;ann;1,5\n", encoding="utf-8")
    for way in ("information", "listens"):
        words = ("--edges", way, "--no-simulation", "-o", "c.json")
        assert ptcc("certify", "de.csv", "--method", "paper", *words).code == 0
        run = ptcc("check", "c.json", "de.csv")
        assert run.code == 1 and f"accepted if --edges {way} is what you mean" in " ".join(run.out.split())


def test_check_tells_from_standard_input_what_would_agree(folder: Path):
    content = b"a,b,1\nb,c,2\n"
    Path("ties.csv").write_bytes(content)
    assert ptcc("certify", "ties.csv", "--method", "paper", "--undirected", "--no-simulation", "-o", "t.json").code == 0
    assert ptcc("check", "t.json", "ties.csv", "--undirected").code == 0
    for words, stdin in (("ties.csv", b""), ("-", content)):
        run = ptcc("check", "t.json", words, stdin=stdin)
        assert run.code == 1 and "accepted if --undirected is what you mean" in " ".join(run.out.split())
    assert ptcc("certify", "ties.csv", "--method", "paper", "--no-simulation", "-o", "p.json").code == 0
    run = ptcc("check", "p.json", "ties.csv", "--undirected")
    assert run.code == 1 and "accepted if --no-undirected is what you mean" in " ".join(run.out.split())


def test_check_takes_every_option_about_reading_that_other_commands_take():
    """None of them falls back to what the certificate says."""
    from ptcc_certify.cli import options
    from ptcc_certify.cli.certify import certify
    from ptcc_certify.cli.check_and_report import check

    own = {parameter.name for parameter in check.params}
    decorated = {option.name for option in options.reading_options(lambda: None).__click_params__}
    assert decorated <= own and set(options.READING) <= decorated
    assert {p.name for p in certify.params} & {"uncertainty", "optional", *decorated} <= own


def test_a_scenario_says_how_check_reads_its_graph(folder: Path):
    Path("g.csv").write_text("a,b,1\nb,c,-0.5\nc,a,2\nc,d,3\n")
    Path("s.toml").write_text('[graph]\nfile = "g.csv"\nedges = "listens"\n')
    assert ptcc("certify", "s.toml", "--method", "paper", "--no-simulation", "-o", "c.json").code == 0
    run = detailed("check", "c.json", "s.toml")
    assert run.code == 0 and run.out.startswith("graph      g.csv, read as the scenario says: --edges listens\n"), run
    assert ptcc("check", "c.json", "g.csv").code == 1
    assert ptcc("check", "c.json", "s.toml", "--edges", "information").code == 1


@pytest.mark.parametrize(
    ("edges", "said"),
    [
        ("b,a,1 c,b,-0.123456789 a,c,2 d,c,3", "every edge points the other way: read it with --edges listens?"),
        ("a,b,1 b,c,0.123456789 c,a,2 c,d,3", "1 of 4 edges has another sign (the signs are dropped), such as b -> c"),
        (
            "a,b,1 b,c,-0.123456789 c,a,-2 c,d,-3",
            "2 of 4 edges have another sign, such as c -> a: 2 in the certificate",
        ),
        ("a,b,1 b,c,-0.12346 c,a,2 c,d,3", "1 of 4 edges has another weight, as if rounded: the largest relative"),
        (
            "a,b,1 b,c,-0.12346 c,a,4 c,d,3",
            "2 of 4 edges have another weight: the largest relative difference is 1, of c",
        ),
        ("a,b,1 b,c,-0.123456789 c,a,2 d,c,3", "1 of 4 edges points the other way, such as c -> d in the certificate"),
        ("a,b,1 b,c,-0.123456789 c,a,2 a,d,3", "1 edge of the certificate alone, such as c -> d; 1 edge of the graph"),
        ("a,b,1 b,c,-0.123456789 c,a,2 c,e,3", "1 node of the certificate alone, such as d; 1 node of the graph alone"),
        (
            "b,a,1 c,b,0.123456789 a,c,2 d,c,3",
            "every edge points the other way: read it with --edges listens? Then 1 of 4",
        ),
    ],
)
def test_a_graph_that_is_another_one_is_told_apart(folder: Path, edges: str, said: str):
    Path("g.csv").write_text("a,b,1\nb,c,-0.123456789\nc,a,2\nc,d,3\n")
    assert ptcc("certify", "g.csv", "--method", "paper", "--no-simulation", "-o", "c.json").code == 0
    Path("h.csv").write_text(edges.replace(" ", "\n") + "\n")
    run = detailed("check", "c.json", "h.csv")
    assert run.code == 1 and run.err == ""
    assert run.out.splitlines()[-1].startswith(f"rejected   graph: another graph than h.csv: {said}")


@pytest.mark.parametrize(("nodes", "digits"), [(6, 1800), (30, 300), (130, 1800)])
def test_weights_that_exact_proofs_cannot_take_are_refused_in_one_line(folder: Path, nodes: int, digits: int):
    """Quotients of long numbers without a common factor."""
    ends = [(i, (i + k) % nodes) for i in range(nodes) for k in (1, 2)]
    rows = [f"n{i},n{j},{10**digits + 2 * k + 1}/{10**digits + 6 * k + 7}" for k, (i, j) in enumerate(ends)]
    Path("g.csv").write_text("\n".join(rows) + "\n")
    run = ptcc("certify", "g.csv", *PAPER)
    assert run.code == 2 and run.out == "" and len(run.err.splitlines()) == 1
    assert f"too many for exact proofs of {nodes} agents (the longest is that of edge n" in run.err
    assert run.err.rstrip().endswith("round them, to 17 digits say")


@pytest.mark.few(1)
@pytest.mark.parametrize("ending", ["npy", "mtx"])
@pytest.mark.parametrize("options", [(), ("--edges", "information"), ("--edges", "listens")])
def test_check_reads_a_matrix_as_its_reader_says(folder: Path, ending: str, options: tuple[str, ...]):
    W = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 2.0, 0.0]])
    if ending == "npy":
        np.save("m.npy", W)
    else:
        from scipy.io import mmwrite

        mmwrite("m.mtx", W)
    assert ptcc("certify", f"m.{ending}", *options, "--x0", "1,2,3", "--no-simulation", "-o", "c.json").code == 0
    run = ptcc("check", "c.json", f"m.{ending}", *options)
    assert run.code == 0 and "accepted" in run.out, run.out
    run = ptcc("check", "c.json", f"m.{ending}")
    said = " ".join(run.out.split())
    if options == ("--edges", "information"):
        assert run.code == 1 and said.endswith("accepted if --edges information is what you mean"), run.out
    else:
        assert run.code == 0, run.out


@pytest.mark.few(1)
@pytest.mark.parametrize("digits", [50, 200, 400])
def test_long_weights_short_of_the_limit_are_certified(folder: Path, digits: int):
    rows = [
        f"n{i},n{(i + k) % 6},{10**digits + 2 * i + 1}/{10**digits + 6 * i + 7 * k}" for i in range(6) for k in (1, 2)
    ]
    Path("g.csv").write_text("\n".join(rows) + "\n")
    start = ",".join(f"{k}.{10**digits + k}" for k in range(6))
    run = ptcc("certify", "g.csv", "--method", "paper", "--no-simulation", "--x0", start, "--T", f"1.{10**digits + 1}")
    assert run.code == 0 and run.out.splitlines()[0].startswith("verdict    certified; ")


def test_parameters_of_thousands_of_digits_are_refused_by_name(folder: Path):
    long = "1." + "123456789" * 300
    for flag, name in (("--T", "T"), ("--rho1", "rho1"), ("--kappa", "kappa")):
        run = ptcc("certify", "fig1a", "--method", "paper", flag, long, "--no-simulation")
        assert run.code == 2 and len(run.err.splitlines()) == 1, run.err
        assert name in run.err and "round it" in run.err


def test_check_tells_the_claims_of_many_components(folder: Path):
    Path("many.csv").write_text("".join(f"a{k},b{k},1\n" for k in range(101)) + "foe,a,1\na,foe,-1\n")
    assert ptcc("certify", "many.csv", "--method", "paper", "--no-simulation", "-o", "many.json").code == 4
    told = ptcc("check", "many.json", "many.csv")
    assert (told.code, told.err) == (4, "") and "... 102 components in all" in told.out
    lines = check_summary("", json.loads(Path("many.json").read_text()), check("many.json"))
    claim = "interval bipartite consensus (Theorem 2.1, Corollary 4), stability (Theorem 1.2) in 102 components"
    assert claim in " ".join(map(str.strip, lines))


def test_check_tells_every_obligation_and_its_verdict_by_exit_code(folder: Path):
    """0 proved, 1 rejected (a changed field, another graph), 4 undecided; the same from the module."""
    assert ptcc("certify", "fig5b", "--no-simulation", "-o", "c.json").code == 0
    for options in ((), ("--stdlib",), ("fig5b",)):
        run = detailed("check", "c.json", *options)
        assert run.code == 0 and run.err == ""
        lines = run.out.splitlines()
        if options != ("fig5b",):
            sha = read("c.json")["problem"]["graph"]["sha256"]
            assert (
                lines.pop(0) == f"graph      16 nodes, 28 edges, as in the file; name yours to compare; SHA-256 {sha}"
            )
        else:
            assert lines.pop(0) == "graph      fig5b, read by default: --edges information"
        assert len(lines) == len(read("c.json")["proof"]) + 1
        assert all(line.startswith("verified   ") for line in lines[:-1])
        assert lines[-1].startswith("accepted   certified;")
        assert ("python-flint" in lines[-1]) == (options != ("--stdlib",))
    said = one_object(ptcc("check", "c.json", "--json").out)
    assert said["accepted"] is True and said["rejected"] is None
    assert [(step["kind"], step["of"]) for step in said["obligations"]] == [
        (step["kind"], step["of"]) for step in read("c.json")["proof"]
    ]
    run = detailed("check", "c.json", "fig5a")
    assert run.code == 1
    assert run.out.splitlines()[-1].startswith("rejected   graph: another graph than fig5a: ")
    data = read("c.json")
    data["rates"]["proved"] = "1000"
    Path("false.json").write_text(json.dumps(data))
    run = detailed("check", "false.json")
    assert run.code == 1
    assert run.out.splitlines()[-1] == "rejected   rates: rates.proved is not what was proved"
    assert ptcc("check", "false.json", "--json").code == 1
    Path("ring.csv").write_text("".join(f"{i},{(i + 1) % 130},1\n" for i in range(130)))
    assert ptcc("certify", "ring.csv", "--method", "full", "-o", "ring.json").code == 4
    run = detailed("check", "ring.json", "ring.csv")
    assert run.code == 4 and run.out.splitlines()[-1].startswith("accepted   undecided;")
    module = [sys.executable, "-m", "ptcc_certify.checker"]
    for name, code in (("c.json", 0), ("false.json", 1), ("ring.json", 4), ("nowhere.json", 2)):
        assert subprocess.run([*module, name], capture_output=True, cwd=folder).returncode == code


def test_a_rate_beyond_the_upper_bound_is_3_and_one_below_it_4():
    """fig1b: the bound by its slowest mode, below that by its mean eigenvalue; below it, doubt."""
    data = one_object(ptcc("certify", "fig1b", *PAPER, "--json").out)
    proved, limit = Fraction(data["rates"]["proved"]), Fraction(data["rates"]["upper_bound"])
    (mode,) = data["problem"]["graph"]["modes"]
    mean = 2 * sum(abs(Fraction(w)) for _, _, w in mode["edges"]) / 5  # trace(L) over 5 nonzero eigenvalues
    hair = Fraction(1, 10**6)
    assert proved + hair < limit < mean
    for wanted, code in ((proved, 0), (proved + hair, 4), (limit, 4), (limit + hair, 3), (mean, 3)):
        run = detailed("certify", "fig1b", *PAPER, "--min-rate", str(wanted))
        assert run.code == code
        verdict = run.out.splitlines()[0].removeprefix("verdict    ")
        assert verdict.startswith({0: "met: rate >= ", 3: "refuted: rate >= ", 4: "left open: rate >= "}[code])
        bound = re.search(r"upper bound ([0-9.]+), proved|at most ([0-9.]+) can be|met: rate", verdict)
        assert bound is not None and (code == 0 or Fraction(bound[1] or bound[2]) >= limit)


def test_of_one_mode_the_mean_eigenvalue_is_the_limit():
    """Two agents: 8 is twice the only nonzero eigenvalue."""
    name = save("pair.csv", [(1, 2, -1), (2, 1, -3)])
    assert one_object(ptcc("certify", name, "--json").out)["rates"]["upper_bound"] == "8"
    assert ptcc("certify", name, "--min-rate", "8").code == 4
    assert ptcc("certify", name, "--min-rate", "8.000000000001").code == 3


@pytest.mark.few(0)
def test_a_class_that_is_not_proved_for_a_large_graph_leaves_it_undecided():
    name = save("ring.csv", ring(121))
    run = detailed("certify", name, "--method", "full", "--no-simulation")
    assert run.code == 4
    assert "the paper's certificate is proved up to 120 nodes" in run.out
    assert "not proved; numerically" in run.out
    assert ptcc("certify", name, "--method", "full", "--min-rate", "0.001", "--no-simulation").code == 4
    assert ptcc("certify", name, "--min-rate", "0.001").code == 0
    assert ptcc("certify", name, "--min-rate", "1000", "--no-simulation").code == 3
    assert ptcc("certify", name, "--expect", "stability", "--no-simulation").code == 3
    assert ptcc("classify", name).code == 0


@pytest.mark.few(0)
def test_every_behaviour_can_be_expected_with_hyphens_and_implies_the_weaker_ones():
    graphs = {
        "stability": save("s.csv", ring(3, -1)),
        "consensus": save("c.csv", ring(3)),
        "signed-average-consensus": save("a.csv", [(1, 2, -1), (2, 1, -1)]),
        "bipartite-consensus": save("b.csv", [(1, 2, -1), (2, 1, -2)]),
        "interval-bipartite-consensus": save("i.csv", [(1, 2, -1), (1, 3, 1), (2, 3, 1)]),
        "containment": save("h.csv", [(1, 3, 1), (2, 3, 1)]),
        "bipartite-containment": save("d.csv", [(1, 3, 1), (2, 3, 1), (1, 4, 1), (3, 4, -1)]),
    }
    assert {name.replace("-", " ") for name in graphs} == {name.replace("-", " ") for name in BEHAVIOURS}
    follows = {
        "stability": {"stability"},
        "consensus": {
            "consensus",
            "signed-average-consensus",  # the ring is regular
            "containment",
            "bipartite-consensus",
            "interval-bipartite-consensus",
            "bipartite-containment",
        },
        "signed-average-consensus": {
            "signed-average-consensus",
            "bipartite-consensus",
            "interval-bipartite-consensus",
            "bipartite-containment",
        },
        "bipartite-consensus": {"bipartite-consensus", "interval-bipartite-consensus", "bipartite-containment"},
        "interval-bipartite-consensus": {"interval-bipartite-consensus", "bipartite-containment"},
        "containment": {"containment", "bipartite-containment"},
        "bipartite-containment": {"bipartite-containment"},
    }
    for kind, name in graphs.items():
        for wanted in graphs:
            assert ptcc("classify", name, "--expect", wanted).code == (0 if wanted in follows[kind] else 3), kind
    assert ptcc("certify", graphs["interval-bipartite-consensus"], "--expect", "bipartite-containment").code == 0


def test_of_a_disconnected_graph_the_worst_component_counts():
    name = save("apart.csv", [(1, 2, 1), (2, 1, 1), (3, 4, -1), (4, 3, -1)])
    assert ptcc("classify", name, "--expect", "bipartite-consensus").code == 0
    assert ptcc("classify", name, "--expect", "consensus").code == 3


# ---------------------------------------------------------------------- JSON


def odd_graphs() -> dict[str, str]:
    return {
        "apart": save("apart.csv", [(1, 2, 1), (2, 1, -1), (3, 4, -1), (4, 3, -1)], [5]),
        "one": save("one.csv", [], ["alone"]),
        "isolated": save("isolated.csv", [], ["a", "b", "c"]),
    }


@pytest.mark.few(0)
@pytest.mark.parametrize("command", ["classify", "certify"])
@pytest.mark.parametrize("name", [*GRAPHS, "apart", "one", "isolated"])
def test_json_is_exactly_one_object(command: str, name: str):
    graph = odd_graphs().get(name, name)
    run = ptcc(command, graph, "--json")
    assert run.code == 0
    assert run.err == ""
    data = one_object(run.out)
    assert run.out.count("\n") == 1 and run.out.isascii()
    assert {"problem", "structure"} <= set(data) and "graph" in data["problem"] and len(data["structure"]) == 1
    assert ("claim" not in data) == (name in ("apart", "isolated")) == ("components" in data)
    if command == "certify":
        assert data["verdict"] == "certified"
        assert data == one_object(json.dumps(data))


def test_json_goes_out_also_when_an_expectation_is_refuted():
    run = ptcc("certify", "fig1a", *PAPER, "--json", "--expect", "consensus", "-o", "c.json")
    assert run.code == 3 and run.err == "verdict    refuted: consensus (it is stability); the rest is certified\n"
    assert one_object(run.out) == read("c.json")


# ---------------------------------------------------------------------- files in and out


def test_the_certificate_is_written_whole(folder: Path):
    run = ptcc("certify", "fig1b", *PAPER, "--x0", X0, "-o", "c.json", "--json")
    data = one_object(run.out)
    assert one_object(Path("c.json").read_text(encoding="utf-8")) == data == read("c.json")
    assert listing(folder) == ["c.json"]
    run = ptcc("certify", "fig1b", *PAPER, "--x0", X0, "-o", "c.json")
    assert run.out.splitlines()[-1] == "written    c.json"
    Path("c.json").write_text("an older file")
    assert ptcc("certify", "fig1b", *PAPER, "--x0", "1,2", "-o", "c.json").code == 2
    assert Path("c.json").read_text() == "an older file"


@pytest.mark.few(0)
def test_a_graph_from_standard_input():
    text = b"a,b,-1\nb,a,-1\n"
    for run in (
        ptcc("certify", "-", *PAPER, "--json", stdin=text),
        process("certify", "-", "--json", *PAPER, stdin=text),
    ):
        data = one_object(run.out)
        assert data["problem"]["graph"]["modes"] == [{"edges": [["b", "a", "-1"], ["a", "b", "-1"]]}]
        assert data["claim"]["behaviour"] == "bipartite consensus"


def test_a_local_file_wins_over_a_packaged_graph():
    def claim(name: str) -> str:
        return one_object(ptcc("classify", name, "--json").out)["claim"]["behaviour"]

    assert claim("fig1a") == "stability"
    Path("fig1a").mkdir()
    assert claim("fig1a") == "stability"
    Path("fig1b").write_text("a,b,1\nb,a,-1\n")
    assert claim("fig1b") == "stability"


@pytest.mark.parametrize("form", ["plain", "labelled", "file"])
def test_starts_in_every_form(form: str):
    Path("x0.csv").write_text("node,value\n6,1\n" + "".join(f"{k + 1},{v}\n" for k, v in enumerate(X0.split(",")[:5])))
    labelled = "6=1," + ",".join(f"{k + 1}={v}" for k, v in enumerate(X0.split(",")[:5]))
    data = one_object(
        ptcc(
            "certify", "fig1b", *PAPER, "--json", "--x0", {"plain": X0, "labelled": labelled, "file": "x0.csv"}[form]
        ).out
    )
    assert data["problem"]["initial_state"] == dict(zip("123456", X0.split(","), strict=True))


def test_a_random_start_depends_on_the_seed_alone():
    drawn = [
        one_object(ptcc("certify", "fig1b", *PAPER, "--json", "--seed", seed).out)["problem"]["initial_state"]
        for seed in ("0", "0", "7")
    ]
    assert drawn[0] == drawn[1] != drawn[2]
    assert all(abs(Fraction(x)) <= 10 and Fraction(x) * 1000 % 1 == 0 for x in drawn[2].values())


def test_edges_are_read_the_way_that_is_asked_and_it_is_said():
    Path("g.csv").write_text("a,b,1\n")
    for edges, leader, words in ((None, "a", "flows a -> b"), ("listens", "b", "a listens to b")):
        options = [] if edges is None else ["--edges", edges]
        (structure,) = one_object(ptcc("classify", "g.csv", "--json", *options).out)["structure"]
        assert structure["leaders"] == [leader]
        assert words in ptcc("classify", "g.csv", *options).out
        assert words in ptcc("certify", "g.csv", *PAPER, *options).out


def test_what_was_merged_dropped_or_mirrored_is_said():
    Path("g.csv").write_text("a,b,1\na,b,2\nb,b,5\n")
    run = ptcc("classify", "g.csv", "--duplicates", "sum", "--drop-self-loops", "--undirected", "--json")
    data = one_object(run.out)
    assert data["problem"]["graph"]["modes"] == [{"edges": [["b", "a", "3"], ["a", "b", "3"]]}]
    read = {"orientation": "information", "duplicates": "sum", "self_loops": "dropped 1", "undirected": True}
    assert data["problem"]["graph"]["read"] == read
    screen = ptcc("classify", "g.csv", "--duplicates", "sum", "--drop-self-loops", "--undirected", "-v").out
    assert "duplicates sum" in screen and "self-loops dropped 1" in screen and "undirected" in screen


LABELS = ["two words", "a,b", 'say "no"', "ünï ☃ 中", "line\nbreak", "\x1b[31mred", "\x9b2J", "\u202egnihton", "=1"]


def test_labels_of_any_kind_are_printed_safely_and_kept():
    edges = [(a, b, 1) for a, b in zip(LABELS, LABELS[1:] + LABELS[:1], strict=True)]
    name = save("labels.csv", edges, LABELS)
    for command in ("classify", "certify"):
        run = ptcc(command, name)
        assert run.code == 0
        assert all(line.isprintable() for line in run.out.splitlines())
        data = one_object(ptcc(command, name, "--json").out)
        assert data["problem"]["graph"]["nodes"] == LABELS
    assert len(ptcc("certify", name).out.splitlines()) <= 24
    run = ptcc("simulate", name, "--samples", "2")
    assert next(csv.reader(io.StringIO(run.out))) == ["t", "remaining", *LABELS, *(f"u({x})" for x in LABELS)]
    items = [f"{label}={k}".replace('"', '""') for k, label in enumerate(LABELS)]
    run = ptcc("certify", name, "--json", "--x0", ",".join(f'"{item}"' for item in items))
    assert one_object(run.out)["problem"]["initial_state"] == {label: str(k) for k, label in enumerate(LABELS)}
    run = ptcc("certify", name, "--x0", ",".join(f'"{item}"' for item in items[:-3]))
    assert_refused(run)
    assert "\u202e" not in run.err
    np.savez("surrogate.npz", A=[[0.0, 1.0], [1.0, 0.0]], labels=["\ud800", "b"])
    run = ptcc("certify", "surrogate.npz", *PAPER, "-o", "c.json", "--json")
    assert run.code == 0
    for document in (read("c.json"), one_object(run.out)):
        assert document["problem"]["graph"]["nodes"] == ["\ud800", "b"]
    assert ptcc("simulate", "surrogate.npz").code == 0


@pytest.mark.campaign
def test_a_terminal_that_lacks_a_letter_is_no_obstacle():
    name = save("labels.csv", [("中", "b", -1), ("b", "中", -1)])
    env = {"PYTHONIOENCODING": "cp1252", "PYTHONUTF8": "0"}
    assert process("certify", name, env=env).code == 0
    assert one_object(process("certify", name, "--json", env=env).out)["problem"]["graph"]["nodes"] == ["中", "b"]
    assert process("classify", "中.csv", env=env).code == 2


@pytest.mark.few(0)
def test_a_reader_that_stops_early_is_no_error():
    with subprocess.Popen(
        [sys.executable, "-m", "ptcc_certify.cli", "simulate", "fig1a", "--samples", "20000"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    ) as child:
        assert child.stdout is not None and child.stderr is not None
        assert child.stdout.readline().startswith(b"t,remaining")
        child.stdout.close()
        assert child.stderr.read() == b""
    assert child.returncode == 0


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full")
def test_a_full_disk_is_told():
    with Path("/dev/full").open("wb") as full:
        done = subprocess.run(
            [sys.executable, "-m", "ptcc_certify.cli", "classify", "fig1a"], stdout=full, stderr=subprocess.PIPE
        )
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
    run = ptcc("classify", "fig1a")
    assert run.code == 0


# ---------------------------------------------------------------------- the screens


@pytest.mark.few(0)
@pytest.mark.parametrize("name", thinned(GRAPHS, 3))
def test_the_screen_of_certify_fits_24_lines(name: str):
    (example, _, _) = select(name)[0]
    parameters = [text for key, value in example.parameters.items() for text in (f"--{key}", value)]
    for options in ([], [*parameters, "--x0", example.x0]):
        run = detailed("certify", name, *options)
        assert run.code == 0
        lines = [line for line in run.out.splitlines() if line and line not in SECTIONS]
        assert len(lines) <= 24
        heads = {line.split(maxsplit=1)[0] for line in lines}
        expected = {"graph", "read", "structure", "claim", "protocol", "x(0)", "x(T)", "rate", "error", "proof"}
        assert expected | {"simulated", "verdict"} <= heads
        assert "Theorem" in run.out


def test_camps_of_followers_are_told_where_the_whole_graph_is_balanced(tmp_path: Path):
    file = tmp_path / "led.csv"
    file.write_text("a,b,-1\nb,a,-1\nb,c,1\nc,d,-2\n")
    assert "camps      of all {a, d} against {b, c}" in ptcc("classify", str(file)).out
    camp = analyse(read_graph(file)).to_pandas()["camp"]
    assert camp.to_dict() == {"a": 1, "b": -1, "c": -1, "d": 1}
    file.write_text("a,b,-1\nb,a,-1\nb,c,1\na,c,1\n")
    assert "of all" not in ptcc("classify", str(file), "-v").out
    assert analyse(read_graph(file)).to_pandas()["camp"].isna().to_dict() == {"a": False, "b": False, "c": True}


def test_the_screen_of_classify_names_camps_and_cycles():
    out = ptcc("classify", "fig1b").out
    assert "camps {1, 2, 5, 6} against {3, 4}" in out
    structure = analyse(load_graph("fig1a"))
    cycle = structure.closed_components[0].negative_cycle
    assert cycle is not None
    labels = structure.graph.labels
    assert "negative cycle " + ", ".join(f"{labels[s]}->{labels[t]}" for s, t in cycle) in ptcc("classify", "fig1a").out


def test_help_is_printed():
    for args in (["--help"], ["certify", "-h"], ["simulate", "--help"]):
        run = ptcc(*args)
        assert run.code == 0
        assert "Usage: ptcc" in run.out
    run = ptcc()
    assert run.code in (0, 2)
    assert "certify" in run.out + run.err
    assert re.fullmatch(r"ptcc, version \d+\.\d+.*\n", ptcc("--version").out)


# ---------------------------------------------------------------------- simulate


def table(text: str) -> tuple[list[str], np.ndarray]:
    header, *rows = csv.reader(io.StringIO(text))
    return header, np.array(rows, dtype=float)


def test_simulate_prints_csv_up_to_the_deadline_and_past_it():
    run = ptcc("simulate", "fig1b", "--T", "0.6", "--x0", X0, "--samples", "50")
    assert run.code == 0 and run.err == ""
    header, rows = table(run.out)
    assert header == ["t", "remaining", *"123456", *(f"u({k})" for k in "123456")]
    t, remaining, states, inputs = rows[:, 0], rows[:, 1], rows[:, 2:8], rows[:, 8:]
    L, gain = load_graph("fig1b").laplacian().toarray(), 1 + 2 / 0.6  # rho1 + rho2 kappa / T
    assert inputs[0] == pytest.approx(-gain * L @ states[0])
    assert (np.diff(t) >= 0).all() and t[0] == 0 and t[-1] > 0.6
    assert (np.diff(remaining) <= 0).all() and remaining[0] == 1 and remaining[-1] == 0
    assert remaining[remaining > 0].min() == pytest.approx(1e-8)
    assert len(rows) >= 50
    assert states[0].tolist() == [float(x) for x in X0.split(",")]
    final = one_object(ptcc("certify", "fig1b", *PAPER, "--T", "0.6", "--x0", X0, "--json").out)["final_state"]
    settled = states[remaining == 0]
    assert np.abs(settled - [float(Fraction(final[k])) for k in "123456"]).max() < 1e-8


def test_simulate_without_a_deadline_is_the_plain_exponential():
    run = ptcc("simulate", "fig1b", "--rho1", "0.7", "--rho2", "0", "--x0", X0)
    assert run.code == 0
    assert run.err == ""  # nobody promised that it settles
    _, rows = table(run.out)
    L = load_graph("fig1b").laplacian().toarray()
    start = np.array([float(x) for x in X0.split(",")])
    for row in rows[::20]:
        assert row[2:8] == pytest.approx(expm(-0.7 * row[0] * L) @ start, abs=1e-8)


def test_simulate_agents_of_two_dimensions():
    """The components of a vector-valued agent do not see each other."""
    both = ptcc("simulate", "fig1a", "--dimension", "2", "--x0", "5,1,2,2,-4,3,3,4,-2,5,1,6")
    first, second = (ptcc("simulate", "fig1a", "--x0", x0) for x0 in (X0, "1,2,3,4,5,6"))
    header, rows = table(both.out)
    assert header[:14] == ["t", "remaining", *(f"{k}[{c}]" for k in range(1, 7) for c in (1, 2))]
    for component, alone in enumerate((first, second)):
        assert rows[:, 2 + component : 14 : 2] == pytest.approx(table(alone.out)[1][:, 2:8], abs=1e-7)
    assert ptcc("simulate", "fig1a", "--dimension", "3").code == 0


def test_simulate_says_when_the_run_has_not_settled():
    run = ptcc("simulate", save("slow.csv", [(1, 2, 1), (2, 3, "1e-16"), (3, 2, 10000)]), "--x0", "1,0,0")
    assert run.code == 0
    assert run.err.startswith("note: ")
    assert "note" not in run.out


@pytest.mark.few(0)
@pytest.mark.parametrize(
    ("name", "magic"), [("a.png", b"\x89PNG\r\n\x1a\n"), ("a.svg", b"<?xml"), ("a.pdf", b"%PDF"), ("A.PNG", b"\x89PNG")]
)
def test_simulate_draws_figures(name: str, magic: bytes, folder: Path):
    run = ptcc("simulate", "fig5a", "-o", name)
    assert (run.code, run.out, run.err) == (0, f"written    {name}\n", "")
    data = Path(name).read_bytes()
    assert data.startswith(magic) and len(data) > 5000
    assert listing(folder) == [name]


@pytest.mark.parametrize("name", ["run.csv", "run.txt", "run"])
def test_simulate_writes_tables(name: str):
    assert ptcc("simulate", "fig1a", "-o", name).out == f"written    {name}\n"
    assert Path(name).read_text(encoding="utf-8") == ptcc("simulate", "fig1a").out


# ---------------------------------------------------------------------- the input, design


@pytest.mark.parametrize(
    ("most", "code", "says"),
    [
        ("1000", 0, "met: |u_k| <= 1000"),
        ("100", 3, "refuted: |u_k| <= 100 (it is up to "),
        ("652", 4, "left open: |u_k| <= 652 (proved: "),
    ],
)
def test_max_input_is_met_refuted_or_undecided(most: str, code: int, says: str):
    run = detailed("certify", "fig1a", "--method", "paper", "--no-simulation", "--max-input", most)
    assert run.code == code and says in run.out.splitlines()[0]


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("given", "most", "code", "says"),
    [
        # |u(0)| is 8, the gain reaches 30, and b and c hear 1 and 2: noise alone moves c by 30 * 4 * 10
        (
            ("--gain-cap", "30", "--noise", "10"),
            "400",
            3,
            "(it is up to 1200 by the noise alone, proved)",
        ),
        (("--gain-cap", "30", "--noise", "10"), "4000", 4, "left open: |u_k| <= 4000"),
        (("--gain-cap", "30", "--noise", "10"), "7000", 0, ""),
        (("--noise", "1"), "1e9", 3, "(it is without limit by the noise alone, proved)"),
        (("--delta", "5"), "20", 4, "left open: |u_k| <= 20"),
        (("--delta", "5"), "400", 0, ""),
        (("--delta", "5", "--gain-cap", "30"), "20", 4, "left open: |u_k| <= 20"),
        (("--delta", "5", "--gain-cap", "30", "--noise", "0.1"), "400", 0, ""),
        (("--gain-cap", "30"), "20", 0, ""),
        (("--gain-cap", "30"), "5", 3, "at the start, proved"),
    ],
)
def test_max_input_is_judged_under_the_noise_and_the_disturbances_of_the_command(
    folder: Path, given: tuple[str, ...], most: str, code: int, says: str
):
    (folder / "g.csv").write_text("a,b,1\nb,a,-1\nb,c,2\n")
    run = detailed("certify", "g.csv", "--x0", "1,2,3", "--no-simulation", *given, "--max-input", most)
    assert run.code == code and (says or "met: |u_k|") in run.out.splitlines()[0], (run.code, run.out)


def test_max_input_under_a_limit_is_about_what_the_limit_leaves(folder: Path):
    Path("pair.csv").write_text("a,b,1\nb,a,-1\n")
    words = ("certify", "pair.csv", "--initial-bound", "1", "--no-simulation")
    assert ptcc(*words, "--gain-cap", "1", "--max-input", "3").code == 0
    weak = detailed(*words, "--gain-cap", "20", "--rho2", "0.1", "--kappa", "1", "--max-input", "50")
    assert weak.code == 0 and "NOT BOUNDED" in weak.out
    assert ptcc(*words, "--gain-cap", "2", "--max-input", "3").code == 3
    assert ptcc(*words, "--gain-cap", "1", "--sample-period", "0.01", "--max-input", "3").code == 4


@pytest.mark.few(0)
@pytest.mark.usefixtures("every_class")
def test_an_input_without_bound_is_said_prominently_and_refutes_every_limit():
    words = ("certify", "fig5b", "--T", "0.6", "--rho1", "0.1", "--rho2", "0.3", "--kappa", "1", "--no-simulation")
    assert "INPUT      NOT BOUNDED" in ptcc(*words).out
    run = detailed(*words)
    assert run.code == 0 and "INPUT      NOT BOUNDED" in run.out and "raise rho2 kappa to 0.38337" in run.out
    refuted = detailed(*words, "--initial-bound", "1", "--max-input", "1e9")
    assert refuted.code == 3 and "without limit, proved" in refuted.out.splitlines()[0]


@pytest.mark.few(0)
def test_limits_of_actuators_are_judged_and_simulated(folder: Path):
    run = detailed(
        "certify", "fig1a", "--no-simulation", "--gain-cap", "20", "--sample-period", "1/1000", "--delta", "0.1"
    )
    assert run.code == 0 and "zero-order hold 0.001" in run.out and "disturbed  |d_k| <= 0.1" in run.out
    coarse = detailed("certify", "fig1a", "--no-simulation", "--gain-cap", "20", "--sample-period", "0.5")
    assert "(certified with a period of 0.00" in coarse.out and coarse.code == 4
    assert "verdict    left open: limits (certified with a period of 0.00" in coarse.out
    rows = ptcc("simulate", "fig1a", "--gain-cap", "20", "--samples", "11").out.splitlines()
    assert rows != ptcc("simulate", "fig1a", "--samples", "11").out.splitlines()
    assert rows[0].startswith("t,remaining,1,2,3,4,5,6,u(1),")


@pytest.mark.usefixtures("every_class")
def test_design_answers_with_gains_a_refutation_or_neither(folder: Path):
    asked = ("design", "fig1a", "--max-input", "10", "--initial-bound", "1")
    met = ptcc(*asked, "--deadline", "2", "-o", "d.json", "--curve", "d.csv")
    assert met.code == 0 and "verdict    met: |u_k| <= " in met.out
    assert ptcc("check", "d.json", "fig1a").code == 0
    lines = Path("d.csv").read_text().splitlines()
    assert lines[0] == "deadline,certified_peak,least_possible_peak" and len(lines) == 62
    assert ptcc(*asked, "--deadline", "0.7").code == 3
    assert ptcc(*asked, "--deadline", "0.9", "-o", "none.json").code == 4
    assert not Path("none.json").exists()
    assert ptcc(*asked, "--shortest-deadline", "--curve", "d.png").code == 0 and Path("d.png").stat().st_size > 5000
    data = json.loads(ptcc(*asked, "--shortest-deadline", "--input-norm", "2", "--json").out)
    assert data["verdict"] == "met" and data["input_norm"] == 2 and Fraction(data["peak"]) <= 10


@pytest.mark.campaign
@pytest.mark.usefixtures("every_class")
def test_the_command_that_design_prints_proves_its_gains_again(folder: Path):
    rng, capped = np.random.default_rng(1), 0
    graphs = ["fig1a", "fig3b", "fig5b"]
    for seed in (9, 27):
        _, kwargs = all_classes()[seed]
        write_graph(random_graph(rng, n=8, **{k: v for k, v in kwargs.items() if k != "n"}).graph, f"r{seed}.csv")
        graphs.append(f"r{seed}.csv")
    tasks = [("--shortest-deadline",), ("--shortest-deadline", "--input-norm", "2"), ("--deadline", "20/3")]
    tasks += [("--shortest-deadline", "--residual", "4"), ("--deadline", "4.1", "--residual", "0.01")]
    for graph, task in zip(graphs, tasks, strict=True):
        asked = ("design", graph, "--max-input", "50", "--initial-bound", "2.3", *task)
        found = one_object(ptcc(*asked, "--json").out)
        word, *command = shlex.split(found["command"])
        assert word == "ptcc" and command[:2] == ["certify", graph]
        again = ptcc(*command, "--json", "--no-simulation")
        assert again.code == 0, (asked, command, again.err)
        proved = one_object(again.out)
        gain = proved["problem"]["gain"]
        assert gain == {k: found["protocol"][k] for k in gain}
        effort = proved["input"]
        if found["gain_cap"] is None:
            agents = max(map(Fraction, effort["peak"]["agents"].values()))
            peak = Fraction(effort["peak"]["norm"]) if found["input_norm"] else agents
            assert peak == Fraction(found["peak"]) <= 50
        else:
            (entry,) = effort["residual"]
            assert max(map(Fraction, entry["agents"].values())) == Fraction(found["residual"])
            assert Fraction(found["residual"]) <= Fraction(found["asked"]["residual"])
            assert Fraction(entry["largest"]) == Fraction(found["peak"]) <= 50
            capped += 1
    assert capped
    run = ptcc(*asked)
    assert command_of(run) == found["command"]


def command_of(run: Run) -> str:
    """The command that design prints last, on one line."""
    return re.search(r"^to prove it again.*:\n(ptcc(.|\n)*)", run.out, re.M)[1].rstrip("\n").replace(" \\\n    ", " ")


@pytest.mark.few(0)
def test_the_command_that_design_prints_is_one_for_a_shell(folder: Path):
    name = "it's a $graph; -rf.csv"
    Path(name).write_text("a,b,-1\nb,a,-1\nb,b,2\na,b,-1\n")
    reading = ("--edges", "listens", "--duplicates", "sum", "--drop-self-loops")
    task = ("--max-input", "10", "--initial-bound", "1", "--shortest-deadline")
    command = ptcc("design", name, *reading, *task).out.partition("again:\n")[2]
    program = f"{shlex.quote(sys.executable)} -m ptcc_certify.cli"
    shown = subprocess.run(["sh", "-c", command.replace("ptcc", program, 1)], capture_output=True, text=True)
    assert shown.returncode == 0 and "certified" in shown.stdout, shown
    assert all(flag in command for flag in reading)
    Path("-g.csv").write_text("a,b,1\nb,a,-1\n")
    assert ptcc(*shlex.split(command_of(ptcc("design", *task, "--", "-g.csv")))[1:]).code == 0
    edges = b"a,b,1\nb,a,1\n"
    run = ptcc("design", "-", "--undirected", *task, stdin=b"a,b,1\n")
    assert "to prove it again (give it the graph again, on standard input):" in run.out
    assert ptcc(*shlex.split(command_of(run))[1:], stdin=b"a,b,1\n").code == 0
    assert command_of(ptcc("design", "-", *task, stdin=edges)).startswith("ptcc certify - --T ")


# ---------------------------------------------------------------------- examples, cite, imports


REPORTED = [
    (str(example.number), graph, behaviour)
    for example in EXAMPLES.values()
    for graph, behaviour in zip(example.graphs, example.behaviours, strict=True)
]


def rows_of_examples(run: Run) -> Iterator[tuple[str, str, str, re.Match[str]]]:
    """Number, graph, reported behaviour and printed columns of each run, which are as the paper reports."""
    assert run.code == 0, run
    lines = run.out.splitlines()
    assert max(map(len, lines)) <= 80 and " ".join(lines[:2]).split() == [
        *("example", "theorem", "behaviour", "verdict", "rate", "optimality", "worst", "reached", "proved", "by"),
        *("T_r", "final", "state"),
    ]
    rows = [" ".join(pair) for pair in zip(lines[2::2], lines[3::2], strict=True)]
    assert len(rows) == len(REPORTED) == 12
    for row, (number, graph, behaviour) in zip(rows, REPORTED, strict=True):
        columns = [r"(\d) (\w+)", r"([\d.]+)", r"(\D+?)", r"(\w+)(?:, says little by T)?"]
        columns += [*[r"([\d.]+)"] * 3, *[r"(\S+)"] * 3]
        match = re.fullmatch(f"{' +'.join(columns)}  (\\S.*)", row)
        assert match is not None, row
        assert match.group(1, 2, 4, 5) == (number, graph, behaviour, "certified")
        assert (match[12] == "0") == (behaviour == "stability")
        assert match[12].startswith("+-") == (behaviour == "bipartite consensus")
        if number in "456":
            assert 0 < float(match[9]) < float(match[10]) < float(match[11])
        else:
            assert match.group(9, 10, 11) == ("-", "-", "-")
        rate, ratio, worst = (float(x) for x in match.group(6, 7, 8))
        assert rate > 0 and 0 < ratio <= 1 and 0 < worst <= 1
        yield number, graph, behaviour, match


@pytest.mark.few(0)
def test_all_examples_behave_as_the_paper_reports():
    assert len(list(rows_of_examples(ptcc("examples", "all")))) == 12


@pytest.mark.campaign
def test_all_examples_are_written_with_their_figures(folder: Path):
    for number, graph, behaviour, match in rows_of_examples(ptcc("examples", "all", "-o", "new/results")):
        data = read(f"new/results/{graph}{'_sliding' if number in '456' else ''}.json")
        assert data["claim"]["theorem"] == match[3]
        assert data["claim"]["behaviour"] == behaviour
        rate = float(match[6])
        assert rate <= Fraction(data["rates"]["proved"]) < rate + 1e-4
    table = list(csv.DictReader(Path("new/results/examples.csv").read_text().splitlines()))
    assert [(row["example"], row["graph"], row["claim"]) for row in table] == REPORTED
    assert {row["verdict"] for row in table} == {"certified"}
    assert [bool(row["reached_by"]) for row in table] == [bool(row["simulated_reached"]) for row in table]
    assert [bool(row["reached_by"]) for row in table] == [row["example"] in "456" for row in table]
    figures = {path.name for path in (folder / "new" / "results").glob("*.png")}
    drawn = {1: "graphs", 3: "graphs", 5: "graphs", 7: "sliding_variables", 9: "sliding_variables"}
    drawn |= {11: "sliding_variables"} | dict.fromkeys((2, 4, 6, 8, 10, 12), "states")
    assert figures == {f"figure_{number:02d}_{what}.png" for number, what in drawn.items()} | {
        f"example_{number}_{what}.png" for number in range(1, 7) for what in ("decay", "input")
    }
    for name in figures:
        assert Path(f"new/results/{name}").read_bytes().startswith(b"\x89PNG\r\n\x1a\n")
    assert len(listing(folder / "new" / "results")) == 12 + 24 + 1


def vectors_of_examples(folder: Path, name: str) -> dict[str, bytes]:
    assert ptcc("examples", "fig1b", "-o", name, "--format", "svg").code == 0
    return {p.name: p.read_bytes() for p in (folder / name).glob("*.svg")}


@pytest.mark.campaign
def test_examples_are_drawn_as_vectors_too(folder: Path):
    drawn = vectors_of_examples(folder, "one")
    assert len(drawn) == 2 + 2 + 4 and all(b"<svg" in content for content in drawn.values())


@pytest.mark.campaign
def test_examples_are_drawn_the_same_again(folder: Path):
    assert vectors_of_examples(folder, "one") == vectors_of_examples(folder, "two")


@pytest.mark.few(0)
def test_examples_can_be_chosen():
    assert [row.split()[1] for row in ptcc("examples", "2").out.splitlines()[2::2]] == ["fig3a", "fig3b"]
    assert [row.split()[1] for row in ptcc("examples", "fig1b").out.splitlines()[2::2]] == ["fig1b", "fig1b"]


@pytest.mark.parametrize("theorem", [None, "1.1", "1.2", "2.1", "2.2", "3.1", "3.2", "4.1", "6.2"])
def test_cite_is_bibtex_and_invents_nothing(theorem: str | None):
    run = ptcc("cite", *([] if theorem is None else [theorem]))
    assert run.code == 0 and run.err == ""
    match = re.fullmatch(r"@(\w+)\{(\w+),\n((?:  \w+ *= \{.*\},?\n)+)\}\n", run.out)
    assert match is not None
    fields = dict(re.findall(r"^  (\w+) *= \{(.*)\},?$", match[3], flags=re.MULTILINE))
    assert set(fields) == {"author", "title", "note"}
    assert "Zhu" in fields["author"] and fields["author"].count(" and ") == 5
    assert fields["title"].startswith("Robust prescribed-time coordination control")
    assert not re.search(r"doi|\b(19|20)\d\d\b|http", run.out)
    assert all(text.count("{") == text.count("}") for text in fields.values())
    if theorem:
        assert f"Theorem {theorem}: " in fields["note"]
        assert ptcc("cite", f"Theorem {theorem}").out == ptcc("cite", "theorem", theorem).out == run.out


def test_cite_takes_a_certificate_and_the_software(tmp_path: Path):
    corpus = Path(__file__).parents[1] / "corpus"
    assert ptcc("cite", str(corpus / "fig3a.json")).out == ptcc("cite", "2.1").out
    parts = ptcc("cite", str(corpus / "parts.json")).out
    assert "Theorem 2.1: " in parts and "Theorem 1.2: " in parts
    refused = ptcc("cite", str(corpus / "uncertain.json"))
    assert refused.code == 2 and "ptcc cite alone prints the source" in refused.err
    forged = json.loads((corpus / "fig3a.json").read_text(encoding="utf-8")) | {"verdict": "undecided"}
    (tmp_path / "forged.json").write_text(json.dumps(forged), encoding="utf-8")
    assert ptcc("cite", str(tmp_path / "forged.json")).code == 1
    software, facts = ptcc("cite", "software").out, (Path(__file__).parents[2] / "CITATION.cff").read_text("utf-8")
    for field in ("title", "version"):
        (said,) = re.findall(rf"^  {field} *= \{{(.*)\}},$", software, flags=re.MULTILINE)
        assert re.search(rf'^{field}: "?{re.escape(said)}"?$', facts, flags=re.MULTILINE)
    assert "- name: ptcc-certify contributors\n" in facts and "{{ptcc-certify contributors}}" in software


def test_published_examples_are_run_by_name():
    assert ptcc("examples", "published", "french").out == ptcc("examples", "french").out
    for words, mend in ((("published", "fig1a"), "use leader_of_two_camps"), (("1", "2"), "give one name")):
        refused = ptcc("examples", *words)
        assert refused.code == 2 and mend in refused.err


@pytest.mark.few(0)
def test_classify_loads_nothing_heavy():
    done = subprocess.run(
        [sys.executable, "-X", "importtime", "-m", "ptcc_certify.cli", "classify", "fig1a"],
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 0
    modules = {line.rpartition("|")[2].strip() for line in done.stderr.splitlines() if "|" in line}
    loaded = {module.partition(".")[0] for module in modules}
    assert {"ptcc_certify", "numpy", "scipy", "click"} <= loaded
    assert not loaded & {"casadi", "cvxpy", "clarabel", "matplotlib", "networkx", "flint", "rich"}
    assert not modules & {"lmi.diagonal", "lmi.diagonal_interior_point", "ptcc_certify.certificate.certificate"}


# ---------------------------------------------------------------------- progress


@pytest.mark.few(0)
def test_a_terminal_sees_which_step_is_at_work_and_standard_output_does_not(tmp_path: Path):
    """Standard error is a pseudo-terminal: a bar comes and goes; without one there is nothing."""
    pty = pytest.importorskip("pty")
    words = [sys.executable, "-c", "from ptcc_certify.cli import main; main()", "certify", "fig1a", "--json", *PAPER]
    own, other = pty.openpty()
    run = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=other, cwd=tmp_path)
    os.close(other)
    seen = b""
    try:
        while part := os.read(own, 4096):
            seen += part
    except OSError:  # the other end is closed
        pass
    assert run.stdout is not None
    assert one_object(run.stdout.read().decode())["verdict"] == "certified" and run.wait() == 0
    assert b"independent check" in seen  # the last step stands until the end
    assert b"\x1b[2K" in seen  # the line is erased
    plain = subprocess.run(words, capture_output=True, cwd=tmp_path, check=True)
    assert plain.stderr == b""


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("certify fig1b --noise 0", "--noise = 0 is outside its domain; leave it out for none"),
        ("certify fig1b --delta 0", "--delta = 0 is outside its domain; leave it out for none"),
        ("certify fig1b --gain-cap 0", "--gain-cap = 0 is outside its domain; leave it out for none"),
        ("certify fig1b --delay 0", "give --delay, --period or --quantisation above 0, or leave them out"),
        ("certify fig1b --noise -1", "noise must be > 0"),
        ("simulate fig1b --steps 4 --samples 9", "--samples: --steps tells the instants; leave one of them out"),
        ("simulate fig1b --agents 2 --steps 4 --samples 9", "--samples: --steps tells the instants; leave one"),
        ("certify fig1b --sign-gain 2 --noise 0.1", "give --leader-speed, or --delta if followers are disturbed"),
        ("simulate fig1b --sign-gain 2 --noise 0.1 --leader-speed 0.5", "not simulated where what is heard is off"),
        ("certify fig1b --delay 0.1 --initial-bound 2", "bounds are from one initial state, x0; leave it out"),
        ("certify fig1b --agents 2 --initial-bound 2", "bounds are from one initial state, --x0; leave it out"),
    ],
)
def test_the_mend_is_of_what_was_asked(words: str, told: str):
    run = ptcc(*words.split())
    assert run.code == 2 and run.err.count("\n") == 1 and told in run.err, run


def test_flags_of_one_letter_in_one_word_with_that_of_the_help_are_no_topic():
    assert ptcc("certify", "-hv").out == ptcc("certify", "--help").out
