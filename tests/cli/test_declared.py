"""Options are declared once, at the fields that they fill: flags, keys of scenarios and help follow from these."""

from __future__ import annotations

import inspect
from collections import Counter
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, ClassVar

import click
import pytest
from bad_inputs import ptcc
from click.testing import CliRunner

import ptcc_certify
from ptcc_certify.cli import cli
from ptcc_certify.cli.click_options import DECLARED, OF_PROTOCOL, TITLES, given_of, options_for
from ptcc_certify.graphs.declared_option import option, options_of
from ptcc_certify.model.moving_leaders import MovingLeaders
from ptcc_certify.model.parameters import Given

pytestmark = pytest.mark.usefixtures("quick_search")

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


@pytest.mark.parametrize("command", ["certify", "simulate", "design"])
def test_help_shows_few_options_first_and_the_others_by_sections(command: str):
    text = ptcc(command, "--help").out
    first, *others = text.partition("Options:")[2].split("\n\n")
    assert 10 <= sum(line.startswith("  -") for line in first.splitlines()) <= 20
    assert len(others) > 5
    shown = " ".join(text.split())
    for parameter in cli.commands[command].params:
        if isinstance(parameter, click.Option) and not parameter.hidden:
            assert parameter.opts[0] in shown


@pytest.mark.parametrize("name", ["certify", "design", "design_agents", "certify_many", "read_graph"])
def test_no_function_takes_more_than_ten_parameters(name: str):
    assert len(inspect.signature(getattr(ptcc_certify, name)).parameters) <= 10
