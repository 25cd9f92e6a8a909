"""The delay LMI in certificates: accepted by both arithmetics, kept to by motions, refused where it is forged."""

from __future__ import annotations

import copy
from fractions import Fraction
from typing import Any

import pytest
from late_certificates import plain, whole, with_messages
from mutations import Json, changed, resealed, without
from oracle import number
from oracle_messages import late_claims
from schema_validator import VALIDATOR

from ptcc_certify.checker import check
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.model import NominalProtocol
from ptcc_certify.model.late_messages import LateMessages

TOP = ("messages", "lmi")
CASES = [(1, False), (2, True), (3, True)]


#: The same with values that are off.
OFF = [(1, "1/50"), (2, "1/10")]


def place(data: Json) -> tuple[str, int]:
    return "proof", next(k for k, step in enumerate(data["proof"]) if step["kind"] == "late-lmi")


def reason(data: Json, path: tuple[Any, ...] = (), value: Any = None) -> str:
    report = check(resealed(changed(data, path, value)) if path else resealed(data))
    assert not report.accepted, path
    return report.reason or ""


def scaled(text: str, factor: Fraction) -> str:
    return str(number(text) * factor)


@pytest.mark.few(0)
@pytest.mark.parametrize(("seed", "own"), CASES)
def test_what_is_made_is_accepted_by_both_arithmetics_and_kept_to_by_motions(seed: int, own: bool):
    data = whole(seed, own)
    assert "lmi" in data["messages"]
    VALIDATOR.validate(data)
    assert check(data).accepted and check(data, stdlib=True).accepted
    assert late_claims(data) == []


@pytest.mark.few(1)
@pytest.mark.parametrize(("seed", "error"), OFF)
def test_so_it_is_where_values_are_off(seed: int, error: str):
    data = whole(seed, False, error=error)
    VALIDATOR.validate(data)
    assert check(data).accepted and check(data, stdlib=True).accepted
    assert late_claims(data) == []


@pytest.mark.parametrize("state", [[0, 0, 0], [2, 2, 2]])
def test_agents_that_agree_at_first_are_bounded_by_what_errors_add(state: list[int], capfd: pytest.CaptureFixture[str]):
    graph = SignedDigraph.from_edges([("a", "b", 1), ("b", "a", 1), ("b", "c", 1), ("c", "a", 1)])
    off = LateMessages("0.01", value_error="0.1", gain_cap=6)
    data = plain(graph, NominalProtocol(1, 1, 3, 1), state, messages=off)
    assert check(data).accepted and 0 < max(map(number, data["messages"]["lmi"]["residual"].values())) < 1.2
    assert capfd.readouterr().err == ""  # of the solver, in any case


@pytest.mark.parametrize(("seed", "error"), OFF)
def test_what_errors_add_is_not_less_than_is_proved(seed: int, error: str):
    data = whole(seed, False, error=error)
    said, step = data["messages"]["lmi"], place(data)
    errors = data[step[0]][step[1]]["witness"]["errors"]
    for key in ("moved", "residual"):
        for label, x in said[key].items():
            if number(x) > 0:
                less = scaled(x, Fraction(999, 1000))
                assert f"{key} of agent {label} is not proved" in reason(data, (*TOP, key, label), less)
    assert "floor is too small" in reason(data, (*TOP, "floor"), scaled(said["floor"], Fraction(999, 1000)))
    assert "iff values are off" in reason(without(data, (*TOP, "floor")))
    assert "iff values are off" in reason(without(data, (*step, "witness", "errors")))
    for label, x in errors.items():
        path = (*step, "witness", "errors", label)
        if number(x):
            assert "not proved" in reason(data, path, scaled(x, Fraction(1, 1000)))
            assert "errors are positive" in reason(data, path, "0")
            assert "errors are positive" in reason(data, path, f"-{x}")
            assert "floor is too small" in reason(data, path, scaled(x, Fraction(3)))
    louder = changed(data, ("messages", "value_error"), scaled(data["messages"]["value_error"], Fraction(2)))
    assert "too small" in reason(louder)
    assert "own state" in reason(data, ("messages", "own"), "late")
    for label, x in data["messages"]["input"].items():
        if number(x) > Fraction(1, 10**6):
            found = reason(data, ("messages", "input", label), scaled(x, Fraction(99, 100)))
            assert f"the input of agent {label} is not proved" in found


@pytest.mark.parametrize(("seed", "own"), CASES)
def test_a_witness_that_does_not_prove_it_is_refused(seed: int, own: bool):
    data = whole(seed, own)
    step = place(data)
    witness = data[step[0]][step[1]]["witness"]
    every = (*step, "witness")
    assert "b is not positive" in reason(data, (*step, "numbers", "b"), "0")
    assert "b is not positive" in reason(data, (*step, "numbers", "b"), "1e30")
    b = data[step[0]][step[1]]["numbers"]["b"]
    assert "is not proved" in reason(data, (*step, "numbers", "b"), scaled(b, Fraction(4)))
    for factor in (Fraction(1, 1000), Fraction(1000), Fraction(-1)):
        matrix = [[scaled(x, factor) for x in row] for row in witness["matrix"]]
        assert "the delay LMI is not proved" in reason(data, (*every, "matrix"), matrix)
        if factor > 0:
            tau = [scaled(x, factor) for x in witness["tau"]]
            assert "the delay LMI is not proved" in reason(data, (*every, "tau"), tau)
    assert "tau" in reason(data, (*every, "tau"), witness["tau"][:-1])
    late = next(k for k, x in enumerate(witness["tau"]) if x != "0")
    for value in ("0", "-1"):
        assert "tau is positive iff" in reason(data, (*every, "tau", late), value)
    assert "another size" in reason(data, (*every, "matrix"), witness["matrix"][:-1])


def test_a_multiplier_of_an_edge_that_is_not_late_is_refused():
    graph = SignedDigraph.from_edges([("a", "b", 1), ("b", "a", 1), ("b", "c", 1), ("d", "c", 1)])
    late = LateMessages({("a", "b"): "0.01", ("b", "a"): "0.01", ("d", "c"): "0.01"}, gain_cap=5)
    data = plain(graph, NominalProtocol(1, 1, 3, 1), [3, 1, -2, 4], messages=late)
    step = place(data)
    tau = data[step[0]][step[1]]["witness"]["tau"]
    zero = [k for k, x in enumerate(tau) if x == "0"]
    assert {tuple(data["problem"]["graph"]["modes"][0]["edges"][k][:2]) for k in zero} == {
        ("b", "c"),
        ("d", "c"),
    }  # at once; d rests
    for k in zero:
        assert "tau is positive iff" in reason(data, (*step, "witness", "tau", k), "1")


@pytest.mark.parametrize(("seed", "own"), CASES)
def test_bounds_below_what_is_proved_are_refused(seed: int, own: bool):
    data = whole(seed, own)
    said = data["messages"]["lmi"]
    assert "left is not proved" in reason(data, (*TOP, "left"), scaled(said["left"], Fraction(99, 100)))
    for key in ("moved", "away", "residual"):
        for label, x in said[key].items():
            if number(x) > 0:
                less = scaled(x, Fraction(999, 1000))
                assert f"{key} of agent {label} is not proved" in reason(data, (*TOP, key, label), less)
    for label, x in data["messages"]["input"].items():
        if number(x) > Fraction(1, 10**6):
            found = reason(data, ("messages", "input", label), scaled(x, Fraction(99, 100)))
            assert f"the input of agent {label} is not proved" in found


@pytest.mark.parametrize(("seed", "own"), CASES)
def test_a_witness_for_shorter_delays_or_a_lower_cap_proves_nothing_of_longer_ones(seed: int, own: bool):
    data = whole(seed, own)
    longer = copy.deepcopy(data)
    said = longer["messages"]
    said["latency"] = [scaled(x, Fraction(20)) for x in said["latency"]]
    said["delay"] = scaled(said["delay"], Fraction(20))
    said.pop("form", None)
    longer["proof"] = [one for one in longer["proof"] if one["kind"] != "late-form"]
    assert "the delay LMI is not proved" in reason(longer)


def test_without_a_cap_or_a_state_or_with_values_that_are_off_it_is_refused():
    data = whole(1, False)
    step, said = place(data), data["messages"]["lmi"]
    bare = plain(SignedDigraph.from_edges([(1, 2, 1), (2, 3, -1), (3, 2, 1)]), NominalProtocol(1, 1, 3, 1), [3, 1, 2])
    said = {"left": said["left"]} | {k: dict.fromkeys("123", "1") for k in ("moved", "away", "residual")}
    for options, what in (({}, "without a cap"), ({"gain_cap": 20, "value_error": "1/10"}, "iff values are off")):
        forged = with_messages(bare, "1/100", **options)
        forged["messages"] = {k: x for k, x in forged["messages"].items() if k != "input"} | {"lmi": said}
        proof = [one for one in forged["proof"] if one["kind"] != "late-input"]
        assert what in reason({**forged, "proof": [*proof, data[step[0]][step[1]]]})
    moving = with_messages(bare, "1/100", gain_cap=20, moving=("1/2", "0"))
    moving["messages"]["lmi"] = said
    assert "though leaders move" in reason(moving)
