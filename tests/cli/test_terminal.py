"""How much the commands print, what they log, and what they say while they work."""

from __future__ import annotations

import json
import re
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import click
import pytest
from bad_inputs import ptcc
from rich.cells import cell_len

from ptcc_certify.certificate.fact import Fact
from ptcc_certify.cli import terminal
from ptcc_certify.examples import GRAPHS

FAST = ("--no-simulation", "--method", "paper")
DESIGN = ("design", "fig1a", "--max-input", "10", "--initial-bound", "1")


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.few(0)
@pytest.mark.parametrize("name", [*GRAPHS][::2])
def test_short_screens_fit_8_lines_of_80_columns_and_long_ones_80_columns(name: str):
    ptcc("certify", name, *FAST, "-o", "c.json", "-q")
    for words in (("classify", name), ("certify", name, *FAST), ("check", "c.json", name)):
        short, long = ptcc(*words), ptcc(*words, "-v")
        assert short.code == long.code == 0
        assert len(short.out.splitlines()) <= 8 and len(long.out) > len(short.out)
        assert max(cell_len(line) for line in (short.out + long.out).splitlines()) <= 80


@pytest.mark.few(0)
def test_design_says_what_was_asked_what_is_met_and_how_to_prove_it_again():
    for task, code in (("--shortest-deadline",), 0), (("--deadline", "0.7"), 3), (("--deadline", "0.9"), 4):
        short, long = ptcc(*DESIGN, *task), ptcc(*DESIGN, *task, "-v")
        assert short.code == long.code == code
        assert len(short.out.splitlines()) <= 10 and long.out != short.out
        assert ("gains      T=1.26" in short.out) == (code == 0)
        assert max(map(len, (short.out + long.out).splitlines())) <= 80
        assert ("to prove it again:" in short.out) == (code == 0)


def test_design_names_everything_that_is_missing_at_once():
    assert (
        "needs --max-input U, --initial-bound R and one of --deadline T, --shortest-deadline; e.g."
        in ptcc("design", "fig1a").err
    )
    assert "needs one of --deadline T, --shortest-deadline;" in ptcc(*DESIGN).err
    both = ptcc(*DESIGN, "--deadline", "1", "--shortest-deadline")
    assert both.code == 2 and "leave one out" in both.err


def test_a_drawn_initial_state_is_told_with_its_seed_and_a_given_one_as_given():
    assert "; x(0) random, seed 7\n" in ptcc("certify", "fig1b", "--seed", "7", *FAST).out
    assert "; x(0) given\n" in ptcc("certify", "fig1b", "--x0", "1,2,3,4,5,6", *FAST).out
    sliding = ("certify", "fig1b", "--protocol", "sliding-mode", *FAST)
    assert "x(0) random, seed 0, sigma(0) 0" in ptcc(*sliding).out.replace("\n           ", " ")
    assert "sigma(0) random, seed 0" in ptcc(*sliding, "--sigma0", "random").out.replace("\n           ", " ")


def test_quiet_prints_nothing_and_the_exit_code_tells():
    run = ptcc("certify", "fig1a", "-q", "--expect", "bipartite-consensus", *FAST, "-o", "c.json")
    assert (run.code, run.out, run.err) == (3, "", "")
    assert Path("c.json").exists()
    for words in (("check", "c.json"), ("classify", "fig1a"), (*DESIGN, "--deadline", "2")):
        run = ptcc(*words, "-q")
        assert (run.code, run.out, run.err) == (0, "", "")
    assert json.loads(ptcc("certify", "fig1a", "-q", "--json", *FAST).out)["verdict"] == "certified"
    refused = ptcc("certify", "fig1a", "-q", "--T", "0")
    assert refused.code == 2 and "T = 0" in refused.err
    assert ptcc("certify", "fig1a", "-q", "-v").code == 2


def test_the_log_tells_steps_with_seconds_what_was_searched_and_decided_and_is_appended():
    words = ("certify", "fig1a", "--log", "run.log", "--no-simulation")
    assert ptcc(*words, "-q").code == 0
    text = Path("run.log").read_text()
    for pattern in (
        r"independent check: \d+\.\d{3} s",
        "searched lmi: numerical",
        "proved paper: decay",
        "verdict certified",
    ):
        assert re.search(pattern, text), pattern
    assert all(
        re.match(r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d,\d{3} (INFO|WARNING|ERROR) ", line) for line in text.splitlines()
    )
    assert ptcc(*words, "--T", "0").code == 2 and ptcc(*words, "--time-limit", "1e-9").code == 4
    longer = Path("run.log").read_text()
    assert longer.startswith(text) and "T = 0 is outside its domain" in longer and "cut off by the time limit" in longer


def test_a_log_that_cannot_be_written_is_refused_in_one_line():
    Path("g.csv").write_text("a,b,1\n")
    for path in ("no/such/folder/a.log", ".", "g.csv"):
        run = ptcc("certify", "g.csv", "--log", path)
        assert run.code == 2 and run.out == "" and len(run.err.splitlines()) == 1 and "--log" in run.err
    assert Path("g.csv").read_text() == "a,b,1\n"


def test_work_that_lasts_says_where_it_is_without_a_terminal(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
):
    monkeypatch.setattr(terminal, "FIRST_WORD", 0.01)
    monkeypatch.setattr(terminal, "NEXT_WORD", 0.01)
    threads = threading.active_count()
    with terminal.progress(("one step", "another step")) as begin:
        begin("another step")
        for _ in range(3000):
            threading.Event().wait(0.02)
            if (printed := capsys.readouterr()).err:
                break
    assert printed.out == "" and re.search(r"ptcc: after \d+ s: 1 of 2 done, another step\n", printed.err)
    assert threading.active_count() == threads
    capsys.readouterr()  # a second line may have come before the work ended
    with terminal.progress(("one step",), quiet=True) as begin:
        begin("one step")
        threading.Event().wait(0.05)
    assert capsys.readouterr().err == ""


@pytest.mark.few(0)
@pytest.mark.parametrize(
    ("words", "steps"),
    [
        (("examples", "fig1a"), {"example 1 on fig1a", "example 4 on fig1a"}),
        (("plot", "fig1a"), {"figure"}),
        (("plot", "fig1a", "--what", "states"), {"simulation", "figure"}),
        (("report", "c.json", "-o", "c.html", "--no-simulation"), {"independent check", "report"}),
    ],
)
def test_every_command_that_lasts_says_where_it_is(
    monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...], steps: set[str]
):
    assert ptcc("certify", "fig1a", "--no-simulation", "-q", "-o", "c.json").code == 0
    begun: set[str] = set()

    @contextmanager
    def lines() -> Iterator[Callable[..., Callable[..., None]]]:
        """Where the work is, whether it lasts or not: what is told of it is above."""
        yield lambda description, **_: lambda completed, description: begun.add(description)

    monkeypatch.setattr(terminal, "_plain_lines", lines)
    assert ptcc(*words).code == 0
    assert steps <= begun


def test_the_parts_of_a_command_count_its_seconds_together(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
):
    """The first part ends before anything is to be told; 1,000 s after the command began, the second is at work."""
    monkeypatch.setattr(terminal, "FIRST_WORD", 1000)
    monkeypatch.setattr(terminal, "NEXT_WORD", 0.01)
    with click.Context(click.Command("plot")) as context:
        with terminal.progress(("one step",)) as begin:
            begin("one step")
        for time_of in context.meta[terminal.CLOCK]:
            context.meta[terminal.CLOCK][time_of] -= 1000
        with terminal.progress(("another step",)) as begin:
            begin("another step")
            for _ in range(3000):
                threading.Event().wait(0.02)
                if told := capsys.readouterr().err:
                    break
    assert re.match(r"ptcc: after 1\d\d\d s: 0 of 1 done, another step\n", told)


@pytest.mark.parametrize(
    "words",
    [
        ("certify", "s.toml", "--log", "s.toml"),
        ("certify", "s.toml", "--log", "st.csv"),
        ("certify", "fig3a", "--x0", "st.csv", "--log", "./st.csv"),
        ("certify", "fig3a", "--x0", "state", "-o", "state"),
        ("simulate", "fig3a", "--x0", "st.csv", "-o", "st.csv"),
    ],
)
def test_nothing_is_written_over_what_a_command_reads(words: tuple[str, ...]):
    state = "".join(f"{node},1\n" for node in range(1, 7))
    texts = {"st.csv": state, "state": state, "s.toml": '[graph]\nfile = "fig3a"\n[initial_state]\nx0 = "st.csv"\n'}
    for name, text in texts.items():
        Path(name).write_text(text, encoding="utf-8")
    done = ptcc(*words)
    assert done.code == 2 and done.err.count("\n") == 1 and "read by the command itself" in done.err
    assert {name: Path(name).read_text(encoding="utf-8") for name in texts} == texts


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
def test_a_log_on_a_full_disk_is_one_line():
    done = ptcc("certify", "fig1a", *FAST, "--log", "/dev/full")
    assert done.code == 2 and done.err.count("\n") == 1


@pytest.mark.parametrize("stream", ["stdout", "stderr"])
def test_a_closed_stream_is_no_defect(monkeypatch: pytest.MonkeyPatch, stream: str):
    monkeypatch.setattr(f"sys.{stream}", None)
    assert terminal.Screen().show(lambda details: [Fact(head="a", note="line")]) is None
    with terminal.progress(["a step"]) as begin:
        begin("a step")


def test_check_tells_deadline_bounds_and_input_as_certify_does():
    ptcc("certify", "fig1a", *FAST, "-o", "c.json", "-q")
    told, checked = ptcc("certify", "fig1a", *FAST).out.splitlines(), ptcc("check", "c.json").out.splitlines()
    assert checked[3:-1] == told[4:] and checked[2].startswith("protocol ") and checked[-1].startswith("accepted ")
    bare = ptcc("check", "c.json", "--stdlib").out.splitlines()
    assert bare[:2] == checked[:2] and bare[0].startswith("graph      6 nodes, 12 edges, as in the file; ")
    assert [line.split()[0] for line in bare[2:]] == ["claim", "accepted"]


@pytest.mark.few(0)
def test_check_names_the_agent_of_the_largest_input_of_a_design():
    rows = ("source,target,weight", "m1,m2,1", "m2,m1,-1", "m2,m3,1", "m3,m4,-2", "m4,m5,1", "m5,m3,-1")
    Path("team.csv").write_text("\n".join(rows))
    design = ("--max-input", "50", "--initial-bound", "5", "--shortest-deadline")
    ptcc("design", "team.csv", *design, "-o", "design.json")
    (line,) = [line for line in ptcc("check", "design.json").out.splitlines() if line.startswith("input")]
    assert line.endswith("the largest of agent m4")


def test_gains_whose_proof_is_the_certificate_alone_are_printed(monkeypatch):
    from ptcc_certify.gain_design.answer import Design

    monkeypatch.setattr(Design, "certify_options", None)
    out = ptcc(*DESIGN, "--deadline", "2", "--residual", "0.01").out
    assert "gains      T=2, rho1=" in out and "(deviation" in out
    assert "deadline   every one from 1.265" in out and "\nnote       add -o design.json to keep the proof" in out
