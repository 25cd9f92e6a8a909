"""Options are declared once, at the fields that they fill: flags, keys of scenarios and help follow from these."""

from __future__ import annotations

import inspect
import re
import shlex
from collections import Counter
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any, ClassVar

import click
import pytest
from bad_inputs import ptcc
from click.testing import CliRunner

import ptcc_certify
from ptcc_certify.cli import cli
from ptcc_certify.cli.click_options import DECLARED, OF_PROTOCOL, TITLES, given_of, options_for
from ptcc_certify.graphs.declared_option import option, options_of
from ptcc_certify.model.late_messages import MovingLeaders
from ptcc_certify.model.parameters import Given

pytestmark = pytest.mark.usefixtures("quick_search")

#: Commands whose help has topics; ``certify`` comes first.
BY_TOPIC = ("certify", "simulate", "plot", "design", "check", "batch", "classify")
PARAMETERS = {name: {p.name: p for p in command.params} for name, command in cli.commands.items()}


def test_every_flag_every_name_and_every_key_is_declared_once():
    for told in ([one.word for one in DECLARED], [one.name for one in DECLARED], [one.key for one in DECLARED]):
        assert max(Counter(filter(None, told)).values()) == 1
    assert {one.key.partition(".")[0] for one in DECLARED} == {*TITLES}
    assert {name for names in OF_PROTOCOL.values() for name in names} <= {one.name for one in DECLARED}


@pytest.mark.parametrize("command", ["certify", "simulate", "design", "plot", "batch"])
def test_an_option_of_a_command_has_the_flag_that_is_declared(command: str):
    """The help may be another: what a command makes of it."""
    flags = {one.name: one.word for one in DECLARED if one.flag}
    shared = [name for name in PARAMETERS[command] if name in flags]
    assert len(shared) > 15
    assert all(flags[name] in PARAMETERS[command][name].opts for name in shared)


def test_a_field_of_a_dataclass_is_an_option_and_a_key():
    @dataclass(frozen=True)
    class Wind:
        section: ClassVar = "weather"
        speed: Given = option("--wind-speed V", "How fast it blows.", Given(), unit="m/s")
        gusts: int = option("--gusts", "How many.", default=2, least=0, most=9)

    made: list[dict[str, Any]] = []
    command = click.Command("sail", callback=lambda **options: made.append(given_of(Wind, options)))
    assert CliRunner().invoke(options_for(Wind)(command), ["--wind-speed", "1/3"]).exit_code == 0
    assert made == [{"speed": Fraction(1, 3), "gusts": 2}]
    assert [one.key for one in options_of(Wind).values()] == ["weather.speed", "weather.gusts"]


def test_leaders_that_move_are_told_by_their_fields_alone():
    options = {one.name: None for one in options_of(MovingLeaders).values()} | {"leader_speed": "1/2"}
    assert MovingLeaders(**given_of(MovingLeaders, options)) == MovingLeaders(speed="1/2")


def shown(text: str) -> list[str]:
    """Return the long flags of the options that a help shows."""
    return re.findall(r"^  (?:-\w, )?(--[\w-]+)", text.split("Options:\n")[-1], re.MULTILINE)


@pytest.mark.parametrize("command", BY_TOPIC)
def test_help_shows_few_options_first_and_each_of_the_others_under_one_topic(command: str):
    first, _, listed = ptcc(command, "--help").out.partition("\n\nMore options by topic, ")
    assert 5 <= len(shown(first)) <= 15 and len(f"{first}\n\n{listed}".splitlines()) <= 45
    assert f"\n\n  For example: ptcc {command} " in first
    topics = [line.split()[0] for line in listed.splitlines()[1:]]
    pages = [ptcc(command, "--help", topic).out for topic in topics]
    assert all(page.startswith(f"Usage: ptcc {command} ") and shown(page) for page in pages)
    parameters = PARAMETERS[command].values()
    told = [p.opts[-1] for p in parameters if isinstance(p, click.Option) and not p.hidden]
    once = sorted([*told, "--help", "--help-all"])
    assert sorted(flag for page in (first, *pages) for flag in shown(page)) == once
    whole = ptcc(command, "--help-all").out
    assert sorted(shown(whole)) == once and max(map(len, whole.splitlines())) <= 80


@pytest.mark.parametrize("command", sorted({*cli.commands} - {*BY_TOPIC}))
def test_commands_of_few_options_show_them_at_once(command: str):
    assert "TOPIC" not in ptcc(command, "--help").out
    assert "No such option '--help-all'" in ptcc(command, "--help-all").err


def test_a_word_that_is_no_topic_is_refused_with_the_topics():
    run = ptcc("check", "--help", "messages")  # of other commands
    assert (run.code, run.out) == (2, "")
    assert run.err == 'ptcc: --help: there is no topic "messages"; topics: graph, families, files\n'
    assert "; did you mean messages?; topics: graph, " in ptcc("certify", "-h", "message").err


def test_help_beside_arguments_runs_nothing_and_takes_none_of_them_for_a_topic(tmp_path: Path):
    text, output = ptcc("certify", "--help").out, str(tmp_path / "c.json")
    for words in (
        "--help fig1b",
        "-h highland_tribes",
        "--help missing.csv",
        "missing.csv -h",
        "-h - --T 2",
        "-h ../x",
    ):
        run = ptcc("certify", *words.split(), "-o", output)
        assert (run.code, run.out, run.err) == (0, text, "")
    page = ptcc("certify", "--help", "limits").out
    assert page == ptcc("certify", "missing.csv", "--help=limits").out == ptcc("certify", "-h", "limits", "x.csv").out
    assert not (tmp_path / "c.json").exists()


def test_the_examples_of_the_help_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    Path("graphs").mkdir()
    Path("graphs/pair.csv").write_text("a,b,1\nb,a,1\n")
    for command in BY_TOPIC:  # certify writes what check and plot read
        (example,) = re.findall("For example: ptcc (.*)", ptcc(command, "--help").out)
        run = ptcc(*shlex.split(example))
        assert run.code == 0, run


@pytest.mark.parametrize("name", ["certify", "design", "design_agents", "certify_many", "read_graph"])
def test_no_function_takes_more_than_ten_parameters(name: str):
    assert len(inspect.signature(getattr(ptcc_certify, name)).parameters) <= 10
