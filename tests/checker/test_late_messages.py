"""Late messages and moving leaders in certificates: accepted, judged by motions, and refused where they are forged."""

from __future__ import annotations

import copy
import math
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np
import pytest
from cpu_time import at_most
from late_certificates import Late, led_graph, nominal, obligation, plain, settling, with_leaders, with_messages
from mutations import Json, at, changed, resealed, without
from oracle import number
from oracle_messages import late_claims
from schema_validator import VALIDATOR
from selection import thinned
from side_files import Side

from lmi.exact.work import WorkError, limited
from ptcc_certify.certificate.certification import certify
from ptcc_certify.checker import check, graph
from ptcc_certify.checker.array_digraph import ArrayDigraph
from ptcc_certify.checker.array_stepwise_bounds import ArraySteps
from ptcc_certify.checker.digraph import Digraph
from ptcc_certify.checker.stepwise_bounds import Steps, fixed_decay_above
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Family
from ptcc_certify.model import NominalProtocol, SlidingModeProtocol
from ptcc_certify.model.late_messages import LateMessages

TOP = ("messages",)
F = Fraction


@cache
def base(seed: int = 1, signs: str = "positive", acyclic: bool = False, state: bool = True, sigma: Any = None) -> Json:
    """A certificate of two leaders and four followers, nothing late."""
    rng = np.random.default_rng(seed)
    drawn = led_graph(rng, 2, 4, acyclic=acyclic, signs=signs)
    x0 = [F(int(v), 10) for v in rng.integers(-50, 50, drawn.n_nodes)] if state else None
    if sigma is None:
        return plain(drawn, nominal(), x0, method="paper")
    protocol = SlidingModeProtocol(T_r="0.5", T_s="0.5", rho1=1, rho2=3, kappa=1, mu1=2, mu2=1, mu3=1, delta=1)
    return plain(drawn, protocol, x0, sigma0=[sigma] * drawn.n_nodes, method="paper")


@cache
def full() -> Json:
    """Rows, steps, an agent that misses the deadline, and deadlines of their own."""
    data = with_messages(base(1, "gauge", True), qs=("21/20", "11/10"), steps=30, missed=True, staged=True)
    assert all(data["messages"][key] for key in ("rows", "steps", "missed", "staged"))
    return data


@cache
def capped() -> Json:
    """A capped gain: rows with values that are off; losses."""
    packets = {"period": "1/100", "losses": "3"}
    return with_messages(base(), gain_cap=20, value_error="1/100", steps=30, packets=packets)


@cache
def form(late: bool = True) -> Json:
    """A Lyapunov function under small delays."""
    data = with_messages(base(1, "mixed", True), "1/5000", gain_cap=20, late=late, form=F(1, 2))
    assert data["messages"]["form"]
    return data


@cache
def led(sign: Any = None) -> Json:
    return with_leaders(base(3), sign_gain=sign)


@cache
def fled(**options: Any) -> Json:
    """Late messages and leaders that move."""
    return with_messages(base(), qs=("21/20", "11/10"), steps=30, moving=("1/2", "1/5"), **options)


@cache
def samples() -> dict[str, Json]:
    """Certificates of every kind."""
    ages = [F(1, 50) + F(k, 1000) for k in range(len(base(2, "gauge")["problem"]["graph"]["modes"][0]["edges"]))]
    apart = [F(1 + 17 * (3 * k % 4), 400) for k in range(len(ages))]
    return {
        "everything": full(),
        "capped": capped(),
        "late own state": form(),
        "small delays": form(False),
        "values off": with_messages(base(), "0", value_error="1/10", qs=("1", "3/2")),
        "each edge": with_messages(base(2, "gauge"), ages, missed=True),
        "ages apart": with_messages(base(2, "gauge"), apart, qs=("21/20", "2"), steps=30),
        "any state": with_messages(base(state=False), steps=20),
        "sliding": with_messages(base(sigma=0), qs=("11/10",)),
        "leaders": led(),
        "sign": led("1/2"),
        "any state, leaders": with_leaders(base(state=False), disturbance="1/3", bounded=False),
        "settling": settling(1),
        "settling, capped": settling(2, 12),
        "moving": fled(),
        "moving, capped": fled(gain_cap=20, value_error="1/100"),
        "moving, ages apart": with_messages(base(2, "gauge"), apart, qs=("21/20", "2"), steps=30, moving=("1", "0")),
        "moving, any state": with_messages(base(state=False), qs=("21/20",), moving=("0", "1/3")),
        "moving, values off": with_messages(base(), "0", value_error="1/10", qs=("1", "3/2"), moving=("1/2", "1/2")),
    }


NAMES = (
    *("everything", "capped", "late own state", "small delays", "values off", "each edge", "ages apart", "any state"),
    "sliding",
    *("leaders", "sign", "any state, leaders", "settling", "settling, capped"),
    *("moving", "moving, capped", "moving, ages apart", "moving, any state", "moving, values off"),
)


def reason(data: Json, path: tuple[Any, ...] = (), value: Any = None, **options: Any) -> str:
    """Why a certificate with another value is refused."""
    report = check(resealed(changed(data, path, value) if path else data), **options)
    assert not report.accepted
    return f"{report.rejected}: {report.reason}"


def step(data: Json, of: str) -> tuple[Any, ...]:
    """The path of an obligation."""
    (k,) = [k for k, told in enumerate(data["proof"]) if told["of"] == of]
    return ("proof", k)


def with_all(data: Json, *changes: tuple[tuple[Any, ...], Any]) -> Json:
    for path, value in changes:
        data = changed(data, path, value)
    return data


# ---------------------------------------------------------------------- what is true is accepted


@pytest.mark.few(1)
@pytest.mark.parametrize("name", NAMES)
def test_what_follows_is_accepted_with_and_without_arrays_and_has_the_shape_of_the_schema(name: str, monkeypatch: Any):
    data = samples()[name]
    VALIDATOR.validate(data)
    monkeypatch.setattr(graph, "MANY_EDGES", 0)
    monkeypatch.setattr("ptcc_certify.checker.messages.MANY_EDGES", 0)
    reports = [check(data), check(data, stdlib=True)]
    for report in reports:
        assert report.accepted, (report.rejected, report.reason)
        assert report.obligations == reports[0].obligations


@pytest.mark.few(2)
@pytest.mark.parametrize("name", thinned(NAMES, 3))
def test_motions_keep_to_what_is_accepted(name: str):
    assert late_claims(samples()[name]) == []


@pytest.mark.few(2)
@pytest.mark.parametrize(
    ("name", "path", "factor", "claim"),
    [
        ("everything", ("messages", "missed", "bound"), F(3, 2), "missed"),
        ("everything", ("messages", "rows", 0, "left"), F(9, 10), "left"),
        ("everything", ("messages", "rows", 0, "initial"), F(9, 10), "initial"),
        ("capped", ("messages", "rows", 0, "floor"), F(9, 10), "floor"),
        ("late own state", ("messages", "form", "left"), F(9, 10), "left"),
        ("settling", ("messages", "settling", "left"), F(9, 10), "settling: left"),
        ("settling", ("messages", "settling", "cap"), F(11, 10), "settling: b cap delay"),
        ("settling, capped", ("messages", "settling", "clock"), F(11, 10), "settling: clock"),
        ("leaders", ("messages", "rows", 0, "after"), F(9, 10), "after"),
        ("moving", ("messages", "rows", 0, "floor"), F(9, 10), "floor"),
        ("moving", ("messages", "rows", 0, "after"), F(9, 10), "after"),
        ("moving", ("messages", "rows", 0, "drift"), F(1, 2), "drift"),
        ("leaders", ("messages", "rows", 0, "initial"), F(9, 10), "initial"),
    ],
)
def test_the_oracle_finds_what_is_false(name: str, path: tuple[Any, ...], factor: Fraction, claim: str):
    data = samples()[name]
    false = late_claims(changed(data, path, str(F(at(data, path)) * factor)))
    assert any(claim in told for told in false), false


@pytest.mark.few(0)
def test_the_oracle_finds_leaders_that_do_not_settle_so_fast_and_rows_that_do_not_hold():
    data, told = settling(1), step(settling(1), "messages.settling")
    u = data["proof"][told[1]]["witness"]["u"]
    for label, x in u.items():
        if F(x):
            false = late_claims(changed(data, (*told, "witness", "u", label), str(F(x) / 4)))
            assert any("settling: leaders at" in one or "settling: row" in one for one in false), label


def test_motions_alone_find_bounds_that_are_far_too_small():
    data = samples()["capped"]
    residual = {label: str(F(x) / 200) for label, x in data["messages"]["residual"].items()}
    assert "residual" in late_claims(changed(data, ("messages", "residual"), residual))
    data = samples()["leaders"]
    inputs = {label: str(F(x) / 50) for label, x in data["messages"]["input"].items()}
    assert any("input at" in told for told in late_claims(changed(data, ("messages", "input"), inputs)))


# ---------------------------------------------------------------------- rows


def test_rows_that_do_not_hold_are_refused():
    data, row, told = full(), (*TOP, "rows", 0), step(full(), "messages.rows[0]")
    q, b = (F(data["proof"][told[1]]["numbers"][key]) for key in ("q", "b"))
    assert "q is not above 1" in reason(data, (*told, "numbers", "q"), "9/10")
    assert "q is not above 1" in reason(data, (*told, "numbers", "q"), "1")
    assert "b is not positive" in reason(data, (*told, "numbers", "b"), "-1/10")
    assert "b is not positive" in reason(data, (*told, "numbers", "b"), "0")
    assert "does not decay so fast" in reason(data, (*told, "numbers", "b"), str(b * F(11, 10)))
    assert "does not decay so fast" in reason(data, (*told, "numbers", "q"), str(q * 40))
    assert "b cap delay is above ln q" in reason(data, (*row, "cap"), str(F(data["messages"]["rows"][0]["cap"]) * 2))
    assert "cap is not positive" in reason(data, (*row, "cap"), "-1")
    for key in ("cap", "clock"):
        assert f"{key} is told iff" in reason(without(data, (*row, key)))
        assert f"{key} is null, and not left out" in reason(data, (*row, key), None)
    assert "the clock does not come so far" in reason(data, (*row, "clock"), "-1")
    assert "the clock does not come so far" in reason(
        data, (*row, "clock"), str(F(data["messages"]["rows"][0]["clock"]) * F(100001, 100000))
    )
    for key, said in (("left", "left is not proved"), ("initial", "starts farther")):
        value = F(data["messages"]["rows"][0][key])
        assert said in reason(data, (*row, key), str(value * F(999, 1000)))
        assert said in reason(data, (*row, key), "0")
    assert "initial is negative" in reason(data, (*row, "initial"), "-1")
    assert "floor is negative" in reason(data, (*row, "floor"), "-1")


def test_a_cap_above_the_true_one_is_refused_with_all_that_follows_from_it():
    """``cap``, ``clock``, ``left`` and the residual as they would be for it."""
    data = with_messages(base(), steps=0)
    case, row = Late(data), data["messages"]["rows"][0]
    told = data["proof"][step(data, "messages.rows[0]")[1]]
    cap = F(row["cap"]) * F(10001, 10000)
    clock = case.clock(cap) * F(999999, 1000000)
    left = F(row["left"])
    forged = with_all(data, ((*TOP, "rows", 0, "cap"), str(cap)), ((*TOP, "rows", 0, "clock"), str(clock)))
    assert "b cap delay is above ln q" in reason(forged)
    assert left > 0 and told["numbers"]["q"] == "21/20"


def test_a_witness_of_other_rows_is_refused():
    data, told = full(), (*step(full(), "messages.rows[0]"), "witness", "u")
    u = at(data, told)
    assert "u has not 4 entries" in reason(data, told, u[:-1])
    assert "u has not 4 entries" in reason(data, told, [*u, "1"])
    assert "u is not positive" in reason(data, told, ["0", *u[1:]])
    assert "u is not positive" in reason(data, told, [f"-{u[0]}", *u[1:]])
    assert "does not decay so fast" in reason(data, told, [str(F(u[0]) / 1000), *u[1:]])
    assert "is not a list" in reason(data, told, dict.fromkeys(data["structure"][0]["followers"], "1"))
    assert "another obligation" in reason({**data, "proof": data["proof"][: told[1]] + data["proof"][told[1] + 1 :]})
    assert "nothing asks for" in reason({**data, "proof": [*data["proof"], data["proof"][-1]]})
    entry = data["messages"]["rows"][0]
    assert "more than 100" in reason(data, (*TOP, "rows"), [entry] * 101)


def test_values_that_are_off_leave_a_floor():
    data, row = samples()["values off"], (*TOP, "rows", 0)
    assert data["messages"]["rows"][0]["left"] == "0" and "clock" not in data["messages"]["rows"][0]
    floor = F(data["messages"]["rows"][0]["floor"])
    assert "heard wrong" in reason(data, (*row, "floor"), str(floor * F(999, 1000)))
    assert "left is not 0" in reason(data, (*row, "left"), "1/10")
    assert "clock is told iff" in reason(data, (*row, "clock"), "1")
    assert "cap is told iff" in reason(data, (*row, "cap"), "1")
    assert "heard wrong" in reason(data, (*TOP, "value_error"), "11/100")
    assert "value_error is negative" in reason(data, (*TOP, "value_error"), "-1/10")
    assert "nothing is late or off, and leaders rest" in reason(data, (*TOP, "value_error"), "0")


# ---------------------------------------------------------------------- what is late


def test_ages_that_do_not_fit_are_refused():
    data = full()
    assert "delay is not the largest age" in reason(data, (*TOP, "delay"), "1/100")
    assert "delay is not the largest age" in reason(data, (*TOP, "latency"), "1/40")
    negative = with_all(data, ((*TOP, "delay"), "-1/50"), ((*TOP, "latency"), "-1/50"))
    assert "a latency is negative" in reason(negative)
    larger = with_all(data, ((*TOP, "delay"), "1/40"), ((*TOP, "latency"), "1/40"))
    assert "b cap delay is above ln q" in reason(larger)
    for packets, said in (
        ({"period": "0", "losses": "1"}, "period is not positive"),
        ({"period": "1/100", "losses": "-1"}, "losses is negative"),
        ({"period": "1/100", "losses": "1/2"}, "no number of packets"),
        ({"period": "1/100", "losses": "1"}, "delay is not the largest age"),
        ({"period": "1/100"}, '"losses" is missing'),
        ([], "packets is not an object"),
    ):
        assert said in reason(data, (*TOP, "packets"), packets)
    assert "own is not one of fresh, late" in reason(data, (*TOP, "own"), "stale")
    assert "own is not one of fresh, late" in reason(data, (*TOP, "own"), None)


def test_a_late_own_state_diverges_without_a_cap():
    assert "the protocol diverges" in reason(full(), (*TOP, "own"), "late")
    assert "form without a cap" in reason(without(without(form(False), (*TOP, "input")), (*TOP, "gain_cap")))
    assert "the protocol diverges" in reason(without(form(), (*TOP, "gain_cap")))
    assert "gain_cap is null, and not left out" in reason(form(), (*TOP, "gain_cap"), None)
    assert "of a late own state" in reason(capped(), (*TOP, "own"), "late")


def test_a_latency_of_an_edge_that_is_not_there_is_refused():
    data = samples()["each edge"]
    ages = data["messages"]["latency"]
    count = len(ages)
    assert f"latency has not {count} entries" in reason(data, (*TOP, "latency"), [*ages, ages[0]])
    assert f"latency has not {count} entries" in reason(data, (*TOP, "latency"), ages[:-1])
    assert "a latency is negative" in reason(data, (*TOP, "latency"), ["-1/1000", *ages[1:]])
    assert "is not an exact number" in reason(data, (*TOP, "latency"), [None, *ages[1:]])
    by_label = {
        f"{s} {t}": age for (s, t, _), age in zip(data["problem"]["graph"]["modes"][0]["edges"], ages, strict=True)
    }
    assert "is not a list" in reason(data, (*TOP, "latency"), by_label)


def test_a_capped_gain_settles_nothing_at_the_deadline():
    data, rows = capped(), (*TOP, "rows", 0)
    assert "left is not proved" in reason(data, (*rows, "left"), "0")
    zero = dict.fromkeys(data["problem"]["graph"]["nodes"], "0")
    assert "residual of agent" in reason(data, (*TOP, "residual"), zero)
    # 0.02 s late, the same graph, and the parts that hold without a cap
    late = full()
    for key in ("missed", "staged"):
        forged = without(changed(late, (*TOP, "gain_cap"), "1000000"), (*TOP, "steps"))
        forged = {
            **forged,
            "proof": [s for s in forged["proof"] if s["of"] not in ("messages.steps", f"messages.{key}")],
        }
        large = {label: "1000000" if x != "0" else "0" for label, x in late["messages"]["residual"].items()}
        forged = without(changed(forged, (*TOP, "residual"), large), (*TOP, key))
        assert "of a capped gain" in reason(forged)
    for k in range(2):
        forged = changed(late, (*TOP, "rows", k, "left"), "0")
        assert "left is not proved" in reason(forged)


def test_leaders_in_groups_do_not_rest():
    pair = [("a", "b", 1), ("b", "a", -1), ("a", "c", 1), ("c", "d", 2), ("d", "c", 1), ("b", "d", 1)]
    data = plain(SignedDigraph.from_edges(pair), nominal(), [1, 2, 3, 4])
    donor = with_messages(base())
    u = {"u": ["1", "1"]}
    said = {**donor["messages"], "residual": dict.fromkeys("abcd", "9")}
    proof = [
        *data["proof"],
        obligation("late-rows", "messages.rows[0]", {"q": "21/20", "b": "1/100"}, u),
        obligation("late-residual", "messages.residual"),
    ]
    assert "group of two or more" in reason({**data, "messages": said, "proof": proof})
    said = {**without(led(), (*TOP, "input"))["messages"], "residual": dict.fromkeys("abcd", "9")}
    assert "group of two or more" in reason({**data, "messages": said, "proof": proof})


def test_without_followers_nothing_is_late():
    data = plain(SignedDigraph.from_edges([], ["a", "b"]), nominal(), [1, 2])
    said = {**with_messages(base())["messages"], "residual": {"a": "0", "b": "0"}}
    assert "no follower" in reason({**data, "messages": said})
    assert "latencies without edges" in reason({**data, "messages": {**said, "latency": []}})


def test_parts_that_stand_alone_or_are_missing_are_refused():
    data = full()
    stated = ("steps", "residual", "missed", "staged", "form", "input")
    empty = {key: x for key, x in data["messages"].items() if key not in stated} | {"rows": []}
    assert "nothing is stated" in reason(changed(data, TOP, empty))
    assert "iff rows, steps or forms" in reason(without(data, (*TOP, "residual")))
    for key in (*stated, "packets", "gain_cap", "leaders", "settling", "lmi", "vehicles"):
        assert f"{key} is null, and not left out" in reason(data, (*TOP, key), None)
    assert '"more" is not known' in reason(data, TOP, {**data["messages"], "more": None})
    assert '"own" is missing' in reason(data, TOP, {k: v for k, v in data["messages"].items() if k != "own"})
    assert "messages is null" in reason(data, TOP, None)
    assert '"leaders" is not known' in reason({**data, "leaders": None})
    assert "rows is not a list" in reason(data, (*TOP, "rows"), None)
    moving = base(sigma=F(1, 10))
    assert "while sliding variables move" in reason({**moving, "messages": samples()["sliding"]["messages"]})
    family = Family.from_intervals([("a", "b", 1, 2)])
    whole = certify(family, NominalProtocol(T=1, rho1=1, rho2=1, kappa=3), [1, 2]).to_dict()
    assert "is missing" in reason({**whole, "unverified": {}, "messages": {}})
    whole = certify(
        family, NominalProtocol(T=1, rho1=1, rho2=1, kappa=3), [1, 2], messages=LateMessages("0.01")
    ).to_dict()
    assert check(whole).accepted
    assert "of a family" in reason(changed(whole, (*TOP, "staged"), {"b": "1"}))


# ---------------------------------------------------------------------- residual


def test_a_residual_below_all_bounds_is_refused():
    data, above = with_messages(base()), full()
    for label, x in data["messages"]["residual"].items():
        path = (*TOP, "residual", label)
        if x != "0":
            assert f"residual of agent {label} is not proved" in reason(data, path, str(F(x) * F(999, 1000)))
            assert f"residual of agent {label} is not proved" in reason(data, path, f"-{x}")
        else:
            assert "of a leader that rests" in reason(data, path, "1")
    for label in above["structure"][0]["followers"]:
        assert "is not proved" in reason(above, (*TOP, "residual", label), "-1/1000")
    labels = data["problem"]["graph"]["nodes"]
    turned = {label: data["messages"]["residual"][label] for label in reversed(labels)}
    assert "another order" in reason(data, (*TOP, "residual"), turned)


# ---------------------------------------------------------------------- steps


def test_steps_that_do_not_reach_the_deadline_are_refused():
    data, told = full(), (*TOP, "steps", "instants")
    instants = data["messages"]["steps"]["instants"]
    assert "do not reach from 0 to the deadline" in reason(data, told, instants[:-1])
    assert "do not reach from 0 to the deadline" in reason(data, told, instants[1:])
    assert "do not reach from 0 to the deadline" in reason(data, told, [*instants, "11/10"])
    assert "do not ascend" in reason(data, told, [instants[0], *instants])
    assert "do not ascend" in reason(data, told, [*instants[:2], instants[1], *instants[2:]])
    assert "fewer than 2" in reason(data, told, ["0"])
    many = [str(F(i, 2001)) for i in range(2002)]
    assert "more than 2001" in reason(data, told, many)
    assert "instants is not a list" in reason(data, told, {"0": "1"})
    still = samples()["values off"]
    forged = changed(still, (*TOP, "steps"), {"instants": ["0", "1"]})
    assert "steps though nothing is late" in reason(forged)


def test_a_start_that_may_grow_or_is_below_the_initial_state_is_refused():
    data, told = full(), (*step(full(), "messages.steps"), "witness", "start")
    start = at(data, told)
    assert "start has not 4 entries" in reason(data, told, start[:-1])
    assert "start is negative" in reason(data, told, ["-1", *start[1:]])
    assert "starts farther" in reason(data, told, [str(F(x) / 100) for x in start])
    grown = [resealed(changed(data, (*told, k), str(F(x) * 1000))) for k, x in enumerate(start)]
    assert any("may grow" in (check(forged).reason or "") for forged in grown)


def test_messages_of_one_edge_that_are_said_to_be_younger_than_they_may_be_are_refused():
    data = samples()["ages apart"]
    oldest = max(map(F, data["messages"]["latency"]))
    for k, told in enumerate(map(F, data["messages"]["latency"])):
        if told < oldest:
            # the bounds are those of the ages as told: with older messages over one edge some row or residual is wrong
            older = changed(data, (*TOP, "latency", k), str(oldest))
            report = check(resealed(older))
            assert report.accepted or "row of agent" in report.reason or "residual" in report.reason
            assert not report.accepted or late_claims(resealed(older)) == []
    all_oldest = changed(data, (*TOP, "latency"), str(oldest))
    assert "does not decay so fast" in reason(all_oldest)


@pytest.mark.parametrize("seed", thinned(range(12), 5))
def test_steps_of_arrays_are_those_of_integers_and_bound_the_solution(seed: int):
    """Against the delay equation by fine steps from below, in floats."""
    rng = np.random.default_rng(seed)
    drawn = led_graph(rng, 2, int(rng.integers(1, 7)), signs="mixed")
    index = {label: v for v, label in enumerate(drawn.labels)}
    edges = sorted(((index[t], index[s], F(w)) for s, t, w in drawn.edges))
    columns = [s for _, s, _ in edges], [t for t, _, _ in edges], [w for _, _, w in edges]
    found, largest = [], []
    T, delay, error = F(1), F(int(rng.integers(1, 30)), 100), F(int(rng.integers(0, 2)), 20)
    instants = [F(0), *sorted({F(int(x), 10**6) for x in rng.integers(1, 10**6, 60)}), T]
    ways: list[Fraction | None] = [F(int(rng.integers(0, 10**9)), 10 ** int(rng.integers(6, 12))) for _ in instants[1:]]
    if seed % 2:
        ways[-1] = None
    parts = [64] if seed % 3 else [int(x) for x in rng.choice([0, 7, 32, 64], len(edges))]
    ages = {(t, s): delay * p / 64 for (t, s, _), p in zip(edges, parts * (len(edges) if seed % 3 else 1), strict=True)}
    for kind, steps in ((Digraph, Steps), (ArrayDigraph, ArraySteps)):
        own = kind(drawn.labels, *columns, 1)
        followers = own.listening
        degrees = [own.diagonal[v] for v in followers]
        start = [10**6 + int(x) for x in rng.integers(0, 1, len(followers))]
        walked, peaks = steps(own, followers, degrees, start, error * 10**6, parts), [0] * len(followers)
        for i, step in enumerate(walked.walk(instants, delay, ways)):
            peaks = walked.larger(peaks, step, 2**30 * (i + 1) // len(ways))
        found.append(list(walked.run(instants, delay, ways)))
        largest.append([int(x) for x in peaks])
        assert list(step.end) == found[-1]
    assert found[0] == found[1] and largest[0] == largest[1]
    W = np.zeros((own.n, own.n))
    for t, s, w in edges:
        W[t, s] = abs(float(w))
    D, y = W.sum(axis=1), [np.ones(own.n)]
    y[0][[v for v in range(own.n) if v not in followers]] = 0
    for i, way in enumerate(ways):
        pushed = np.zeros(own.n)
        for (t, s), age in ages.items():
            pushed[t] += W[t, s] * y[max((m for m, x in enumerate(instants) if x <= instants[i] - age), default=0)][s]
        h = np.divide(pushed, D, out=np.zeros(own.n), where=D > 0) + float(error)
        decay = np.zeros(own.n) if way is None else np.exp(-D * float(way))
        y.append(np.where(D > 0, np.minimum(y[i], h + np.maximum(y[i] - h, 0) * decay), 0))
    exact = y[-1][followers] * 2**30
    assert all(a >= b * (1 - 1e-9) for a, b in zip(found[0], exact, strict=True))
    assert all(a <= 2**30 for a in found[0])


def test_decays_of_arrays_are_those_of_integers_at_every_size():
    rng = np.random.default_rng(3)
    near = [(1 << b) + d for b in range(2, 62) for d in (-1, 0, 1)]
    x = np.array([*range(99), *near, *(int(v) for b in range(5, 62) for v in rng.integers(0, 1 << b, 50))])
    assert ArraySteps._decay(x).tolist() == [fixed_decay_above(v) for v in x.tolist()]


# ---------------------------------------------------------------------- a missed deadline, and deadlines of their own


def test_a_deadline_that_need_not_be_missed_is_refused():
    data, said, told = full(), (*TOP, "missed"), (*step(full(), "messages.missed"), "witness", "gauge")
    bound, gauge = F(data["messages"]["missed"]["bound"]), at(data, told)
    assert "bound is not proved" in reason(data, (*said, "bound"), str(bound * F(1001, 1000)))
    assert "bound is not positive" in reason(data, (*said, "bound"), "0")
    assert "bound is not positive" in reason(data, (*said, "bound"), "-1")
    leader = data["structure"][0]["leaders"][0]
    assert "a leader does not miss" in reason(data, (*said, "agent"), leader)
    assert "unknown node" in reason(data, (*said, "agent"), "nobody")
    assert "gauge has not 4 entries" in reason(data, told, gauge[:-1])
    assert "neither 1, -1 nor 0" in reason(data, told, [2 * g for g in gauge])
    assert "no sign of the agent" in reason(data, told, [0] * 4)
    assert "other side" in reason(data, told, [-g for g in gauge])
    assert "not integers" in reason(data, told, [True, *gauge[1:]])
    seen = 0
    for k, g in enumerate(gauge):
        if g:
            text_of = reason(data, told, [-x if j == k else x for j, x in enumerate(gauge)])
            seen += "sign of an edge does not fit" in text_of
    assert seen
    other = [label for label in data["structure"][0]["followers"] if label != data["messages"]["missed"]["agent"]]
    assert all(reason(data, (*said, "agent"), label) for label in other)


def test_what_is_not_late_or_is_off_misses_nothing():
    data = samples()["each edge"]
    assert data["messages"]["missed"]
    agent, ages = data["messages"]["missed"]["agent"], list(data["messages"]["latency"])
    followers = data["structure"][0]["followers"]
    into = [
        k for k, (s, t, _) in enumerate(data["problem"]["graph"]["modes"][0]["edges"]) if t == agent and s in followers
    ]
    for k in into:
        fresh = [x if j != k else "0" for j, x in enumerate(ages)]
        if max(map(F, fresh)) == F(data["messages"]["delay"]):
            assert "not late" in reason(data, (*TOP, "latency"), fresh)
        fresh[k] = str(F(ages[k]) / 2)
        if max(map(F, fresh)) == F(data["messages"]["delay"]):
            assert "bound is not proved" in reason(data, (*TOP, "latency"), fresh)
    unknown = with_messages(base(1, "gauge", True, state=False))
    forged = changed(unknown, (*TOP, "missed"), {"agent": unknown["structure"][0]["followers"][0], "bound": "1/10"})
    assert "without a final state" in reason(forged)


def test_levels_that_are_not_longest_paths_are_refused():
    data = full()
    staged = data["messages"]["staged"]
    assert len(set(staged.values())) > 1
    for label, x in staged.items():
        for new in (F(x) + F(1, 50), F(x) - F(1, 50), F(x) * F(1000001, 1000000)):
            assert f"deadline of agent {label} is another" in reason(data, (*TOP, "staged", label), str(new))
    late = dict.fromkeys(staged, "1")
    assert "is another" in reason(data, (*TOP, "staged"), late)
    assert "is missing" in reason(data, (*TOP, "staged"), dict(list(staged.items())[1:]))
    leader = data["structure"][0]["leaders"][0]
    assert "not known" in reason(data, (*TOP, "staged"), {**staged, leader: "1"})


def test_deadlines_of_their_own_on_a_cycle_or_before_anything_arrives_are_refused():
    ring = with_messages(base())
    followers = ring["structure"][0]["followers"]
    forged = changed(ring, (*TOP, "staged"), dict.fromkeys(followers, "1"))
    forged = {**forged, "proof": [*forged["proof"], obligation("late-staged", "messages.staged")]}
    assert "form a cycle" in reason(forged)
    chain = plain(SignedDigraph.from_edges([(k, k + 1, 1) for k in range(4)]), nominal(), [1, 2, 3, 4, 5])
    late = with_messages(chain, "1/3", qs=("11/10",), staged=True)
    assert late["messages"]["staged"] == {"1": "0", "2": "1/3", "3": "2/3", "4": "1"}
    assert "has not arrived by the deadline" in reason(late)
    assert check(with_messages(chain, "33/100", qs=("11/10",), staged=True)).accepted


# ---------------------------------------------------------------------- leaders in groups that settle


@pytest.mark.few(1)
@pytest.mark.parametrize(("seed", "cap"), [(3, None), (4, 12)])
def test_followers_behind_leaders_that_settle_are_accepted_and_no_motion_exceeds_it(seed: int, cap: Any):
    data = settling(seed, cap)
    assert "settling" in data["messages"] and ("input" not in data["messages"]) == (cap is None)
    VALIDATOR.validate(data)
    for stdlib in (False, True):
        assert check(data, stdlib=stdlib).accepted, check(data).reason
    assert late_claims(data) == []


def test_bounds_behind_leaders_that_settle_are_refused_where_they_do_not_follow():
    data = settling(1)
    told = step(data, "messages.settling")
    numbers, u = data["proof"][told[1]]["numbers"], data["proof"][told[1]]["witness"]["u"]
    q = F(numbers["q"])
    assert "q is not above 1" in reason(data, (*told, "numbers", "q"), "1")
    assert "above half the rate" in reason(data, (*told, "numbers", "b"), "-1")
    assert "above half the rate" in reason(data, (*told, "numbers", "b"), "100")
    assert "b cap delay is above ln q" in reason(data, (*told, "numbers", "q"), str(1 + (q - 1) * F(99, 100)))
    assert "b cap delay is above ln q" in reason(
        data, (*TOP, "settling", "cap"), str(3 * F(data["messages"]["settling"]["cap"]))
    )
    assert "does not come so far" in reason(data, (*TOP, "settling", "clock"), "1000")
    assert "left is not proved" in reason(data, (*TOP, "settling", "left"), "0")
    assert "no such Lyapunov function" in reason(data, (*told, "witness", "function"), 99)
    leaders = next(part["nodes"] for part in data["structure"][0]["closed_components"] if len(part["nodes"]) > 1)
    for label, x in u.items():
        if F(x) == 0:  # a leader that rests
            assert f"u of agent {label} is too small" in reason(data, (*told, "witness", "u", label), "-1")
            continue
        less = reason(data, (*told, "witness", "u", label), str(F(x) * F(999, 1000)))
        if label in leaders:
            assert f"u of agent {label} is too small" in less
        else:
            assert "starts farther" in less or "does not decay" in less
            assert "not positive" in reason(data, (*told, "witness", "u", label), "0")
            far = {**data["problem"]["initial_state"], label: str(F(data["problem"]["initial_state"][label]) + 10**9)}
            assert reason(data, ("problem", "initial_state"), far)


def test_leaders_that_hear_each_other_late_or_inexactly_do_not_settle_by_themselves():
    data = settling(1)
    edges, latency = data["problem"]["graph"]["modes"][0]["edges"], data["messages"]["latency"]
    followers = set(data["structure"][0]["followers"])
    for k, (_, target, _) in enumerate(edges):
        if target not in followers:
            assert f"agent {target} leads, and hears late" in reason(data, (*TOP, "latency", k), "1/1000")
    assert "hears late" in reason(data, (*TOP, "latency"), max(latency, key=F))
    assert "or values are off" in reason(data, (*TOP, "value_error"), "1/10")
    held = with_all(
        data,
        ((*TOP, "packets"), {"period": "1/100", "losses": "0"}),
        ((*TOP, "delay"), str(F(data["messages"]["delay"]) + F(1, 100))),
    )
    assert "values that are held" in reason(held)
    capped = settling(2, 12)
    assert "late own state" in reason(capped, (*TOP, "own"), "late")


def test_inputs_behind_leaders_that_settle_are_refused_where_too_small():
    data = settling(2, 12)
    for label, said in data["messages"]["input"].items():
        if (x := number(said)) > F(1, 10**6):
            found = reason(data, (*TOP, "input", label), str(x * F(99, 100)))
            assert f"the input of agent {label} is not proved" in found


# ---------------------------------------------------------------------- small delays of the whole graph


def test_small_delays_that_are_not_small_enough_are_refused():
    data, told = form(), step(form(), "messages.form")
    numbers = data["proof"][told[1]]["numbers"]
    q, b, kap = (F(numbers[key]) for key in ("q", "b", "kap"))
    assert "q is below" in reason(data, (*told, "numbers", "q"), "1")
    assert "q is below" in reason(data, (*told, "numbers", "q"), str(1 - q))
    assert "b is not positive" in reason(data, (*told, "numbers", "b"), "-1")
    phi = {label: str(F(x) * F(6, 5)) for label, x in data["proof"][told[1]]["witness"]["phi"].items()}
    wider = (((*told, "witness", "phi"), phi), ((*told, "numbers", "kap"), str(kap * F(13, 10))))
    growth = b * 2 * F(data["messages"]["gain_cap"]) * F(data["messages"]["delay"])
    wider = (*wider, ((*told, "numbers", "q"), str(1 + growth + growth**2)), ((*told, "numbers", "b"), str(b * 2)))
    assert "takes more than the rate" in reason(with_all(data, *wider))
    assert "q is below" in reason(data, (*told, "numbers", "b"), "1e300")
    assert "kap is too small" in reason(data, (*told, "numbers", "kap"), str(kap * F(99, 100)))
    assert "kap is too small" in reason(data, (*told, "numbers", "kap"), str(-kap))
    assert "left is not proved" in reason(data, (*TOP, "form", "left"), "0")
    for key in ("moved", "away", "residual"):
        for label, x in data["messages"]["form"][key].items():
            if F(x):
                less = str(F(x) * F(999, 1000))
                assert f"{key} of agent {label} is not proved" in reason(data, (*TOP, "form", key, label), less)
    for label, x in data["proof"][told[1]]["witness"]["phi"].items():
        if F(x):
            assert "phi of agent" in reason(data, (*told, "witness", "phi", label), str(F(x) * F(99, 100)))
            assert "phi is negative" in reason(data, (*told, "witness", "phi", label), f"-{x}")


def test_no_other_lyapunov_function_stands_for_it():
    data, told = form(), (*step(form(), "messages.form"), "witness", "function")
    for k in (-1, 99):
        assert "no such Lyapunov function" in reason(data, told, k)
    for k in (True, "0", None):
        assert "function is not an integer" in reason(data, told, k)
    strong = plain(SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)]), nominal(), [3, 5], method="paper")
    agents = {"moved": {"1": "1", "2": "1"}, "away": {"1": "9", "2": "9"}, "residual": {"1": "9", "2": "9"}}
    said = {**data["messages"], "form": {"left": "1", **agents}}
    del said["input"]
    witness = {"function": 0, "phi": {"1": "9", "2": "9"}}
    proof = [*strong["proof"], obligation("late-form", "messages.form", {"q": "2", "b": "1/9", "kap": "9"}, witness)]
    assert "of deviations" in reason({**strong, "messages": said, "proof": proof})
    bare = with_messages(base(1, "mixed", True, state=False), "1/5000", gain_cap=20)
    forged = changed(bare, (*TOP, "form"), data["messages"]["form"])
    forged = {**forged, "proof": [*forged["proof"], data["proof"][step(data, "messages.form")[1]]]}
    assert reason(forged)


@pytest.mark.parametrize("error", ["0", "1/10"])
def test_inputs_that_are_stated_too_small_are_rejected(error: str):
    data = with_messages(base(1, "mixed", True), "1/50", value_error=error, gain_cap=20, qs=("21/20",))
    assert "form" not in data["messages"] and check(data).accepted
    _forge_inputs(data)


@pytest.mark.parametrize("late", [False, True])
def test_inputs_by_a_lyapunov_function_are_rejected_where_too_small(late: bool):
    data = with_messages(base(1, "mixed", True), "1/5000", gain_cap=20, late=late, form=F(1, 2), qs=())
    assert data["messages"]["form"] and not data["messages"]["rows"] and check(data).accepted
    _forge_inputs(data)


def _forge_inputs(data: Json) -> None:
    """Lower every input, one by one."""
    stated = data["messages"]["input"]
    assert any(map(F, stated.values()))
    for label, x in stated.items():
        if F(x):
            less = str(F(x) * F(9999, 10000))
            assert f"the input of agent {label} is not proved" in reason(data, (*TOP, "input", label), less)
        assert "an input is negative" in reason(data, (*TOP, "input", label), "-1/9")
    assert reason(data, (*TOP, "input"), {**stated, "more": "1"}) and reason(data, (*TOP, "input"), "1")
    assert reason(without(data, (*TOP, "input")))  # its obligation is left


def test_no_input_is_taken_without_a_cap_or_without_what_bounds_it():
    free = with_messages(base(1, "mixed", True), "1/50")
    stated = dict.fromkeys(free["problem"]["graph"]["nodes"], "1000000")
    forged = changed(free, (*TOP, "input"), stated)
    assert "is not proved" in reason(
        {**forged, "proof": [*forged["proof"], obligation("late-input", "messages.input")]}
    )
    stepwise = with_messages(base(1, "mixed", True), "1/50", gain_cap=20, qs=(), steps=40)
    assert check(stepwise).accepted
    for label, x in stepwise["messages"]["input"].items():
        if x != "0":
            assert "is not proved" in reason(stepwise, (*TOP, "input", label), str(F(x) * F(999, 1000)))


# ---------------------------------------------------------------------- leaders that move


def test_leaders_that_are_faster_than_what_follows_are_refused():
    data, top, row, told = led(), (*TOP, "leaders"), (*TOP, "rows", 0), step(led(), "messages.rows[0]")
    b = F(data["proof"][told[1]]["numbers"]["b"])
    assert "does not decay so fast" in reason(data, (*told, "numbers", "b"), str(b * F(1001, 1000)))
    assert "b is not positive" in reason(data, (*told, "numbers", "b"), "0")
    assert "is negative" in reason(data, (*top, "speed"), "-1/2")
    assert "is negative" in reason(data, (*top, "disturbance"), "-1/2")
    assert "is pushed farther" in reason(data, (*top, "speed"), "51/100")
    assert "is pushed farther" in reason(data, (*top, "disturbance"), "1/100")
    for key, why in (("after", "is pushed farther"), ("initial", "starts farther")):
        assert why in reason(data, (*row, key), str(F(at(data, row)[key]) * F(999, 1000)))
    for label, x in data["messages"]["input"].items():
        if F(x):
            assert "is not proved" in reason(data, (*TOP, "input", label), str(F(x) * F(999, 1000)))
    u = data["proof"][told[1]]["witness"]["u"]
    assert "u is not positive" in reason(data, (*told, "witness", "u"), [f"-{u[0]}", *u[1:]])
    assert "u has not" in reason(data, (*told, "witness", "u"), u[1:])
    assert "and leaders rest" in reason(without(data, top))


def test_a_sign_term_below_the_speeds_is_refused():
    data = led("1/2")
    assert "sign_gain is below" in reason(data, (*TOP, "leaders", "sign_gain"), "49/100")
    assert "sign_gain is below" in reason(data, (*TOP, "leaders", "sign_gain"), "-1/2")
    assert "sign_gain is below" in reason(data, (*TOP, "leaders", "speed"), "51/100")
    assert "is pushed farther" in reason(changed(led(), (*TOP, "rows", 0, "after"), "0"))
    stepped = with_messages(base(), qs=("21/20",), steps=30, moving=("1/2", "0"))
    moving = stepped["messages"]["leaders"]
    assert "steps beside a sign term" in reason(stepped, (*TOP, "leaders"), {**moving, "sign_gain": "1/2"})


def test_an_input_that_may_grow_is_refused():
    slow = plain(SignedDigraph.from_edges([("a", "b", "1/10")]), nominal(k=3), [1, 2])
    data = with_leaders(slow)
    assert "input" not in data["messages"] and check(data).accepted
    forged = changed(data, (*TOP, "input"), {"a": "0", "b": "999999"})
    forged = {**forged, "proof": [*forged["proof"], obligation("late-input", "messages.input")]}
    assert "the input of agent b is not proved" in reason(forged)


# ---------------------------------------------------------------------- late messages behind leaders that move


def test_what_leaders_that_move_add_is_refused_where_it_is_told_too_small():
    data, top, row = fled(), (*TOP, "leaders"), (*TOP, "rows", 1)
    for key, said in (("drift", "drift is not proved"), ("after", "is pushed farther"), ("floor", "heard wrong")):
        value = F(data["messages"]["rows"][1][key])
        assert said in reason(data, (*row, key), str(value * F(999, 1000)))
    assert "floor is negative" in reason(data, (*row, "floor"), "-1")
    assert "what pushes followers is negative" in reason(data, (*row, "after"), "-1")
    assert "drift is not proved" in reason(data, (*row, "drift"), "-1")
    assert "heard wrong" in reason(data, (*top, "speed"), "51/100")
    assert "drift is not proved" in reason(data, (*top, "disturbance"), "21/100")
    assert "is negative" in reason(data, (*top, "speed"), "-1/2")
    assert "is negative" in reason(data, (*top, "disturbance"), "-1/5")
    for label, x in data["messages"]["residual"].items():
        if x != "0":
            assert "is not proved" in reason(data, (*TOP, "residual", label), str(F(x) * F(99, 100)))
    still = with_messages(base(), qs=(), steps=30)
    for moving in (("40", "0"), ("0", "40")):
        fast = with_messages(base(), qs=(), steps=30, moving=moving)
        start = (*step(fast, "messages.steps"), "witness", "start")
        assert check(fast).accepted
        assert "may grow" in reason(fast, start, at(still, (*step(still, "messages.steps"), "witness", "start")))


def test_leaders_that_move_are_refused_beside_what_is_of_leaders_at_rest():
    data, top = fled(), (*TOP, "leaders")
    still = with_messages(base(), qs=("21/20", "11/10"), steps=30)
    assert "told iff leaders move" in reason(without(data, top))
    assert "leaders is null, and not left out" in reason(data, top, None)
    assert "told iff leaders move" in reason(still, top, {"speed": "1/2", "disturbance": "1/5"})
    assert "sign_gain is null" in reason(data, top, {**data["messages"]["leaders"], "sign_gain": None})
    assert '"speed" is missing' in reason(data, top, {"disturbance": "0"})
    assert "leaders is not an object" in reason(data, top, [])
    assert '"leaders" is not known' in reason({**data, "leaders": data["messages"]["leaders"]})
    moving = data["messages"]["leaders"]
    for key, whole in (("missed", full()), ("staged", full()), ("form", form(False)), ("settling", settling(1))):
        assert key in whole["messages"] and "though leaders move" in reason(whole, top, moving)
    assert "under the sliding-mode protocol" in reason(samples()["sliding"], top, moving)
    assert "of a late own state" in reason(fled(gain_cap=20), (*TOP, "own"), "late")


def test_an_input_behind_leaders_that_move_counts_them_in():
    data = fled(gain_cap=20, value_error="1/100")
    assert check(data).accepted and data["messages"]["input"]
    still = with_messages(base(), qs=("21/20", "11/10"), steps=30, gain_cap=20, value_error="1/100")
    for label, x in data["messages"]["input"].items():
        if x != "0":
            assert F(still["messages"]["input"][label]) < F(x)
            assert "is not proved" in reason(data, (*TOP, "input", label), str(F(x) * F(999, 1000)))
            assert "is not proved" in reason(data, (*TOP, "input", label), still["messages"]["input"][label])


def test_many_leaders_that_are_told_of_in_long_numbers_take_no_long_time():
    long = "1/" + "7" * 3990
    with at_most(20):
        for key in ("speed", "disturbance"):
            check(resealed(changed(fled(), (*TOP, "leaders", key), long)))
        for key in ("drift", "after"):
            for new in (long, "9" * 4000):
                check(resealed(changed(fled(), (*TOP, "rows", 0, key), new)))


# ---------------------------------------------------------------------- side files, sizes, work


def beside(data: Json) -> tuple[Json, Side]:
    """The same with every vector of section 22 in a side file that may stand in one."""
    data, side = copy.deepcopy(data), Side()
    said = data["messages"]
    for key in ("residual", "input"):
        if said.get(key):
            said[key] = side.numbers([F(math.ceil(F(x) * 10**9), 10**9) for x in said[key].values()])
    if isinstance(said.get("latency"), list):
        said["latency"] = side.numbers([F(x) for x in said["latency"]])
    for told in data["proof"]:
        for key in ("u", "start"):
            if told["kind"] in ("late-rows", "late-steps") and key in told.get("witness", {}):
                told["witness"][key] = side.numbers([F(x) for x in told["witness"][key]])
        if told["kind"] == "late-missed":
            told["witness"]["gauge"] = side.integers(told["witness"]["gauge"])
    return resealed(data), side


@pytest.mark.parametrize("name", ["everything", "each edge", "leaders"])
def test_vectors_in_side_files_are_accepted(name: str):
    data, side = beside(samples()[name])
    VALIDATOR.validate(data)
    for stdlib in (True, False):
        report = check(data, files=side.files, stdlib=stdlib)
        assert report.accepted, (report.rejected, report.reason)
    assert late_claims(data, side.files) == []


def test_side_files_that_do_not_fit_are_refused():
    data, side = beside(full())
    files = side.files
    told, gauge = (
        (*step(data, "messages.rows[0]"), "witness", "u"),
        (*step(data, "messages.missed"), "witness", "gauge"),
    )
    residual = (*TOP, "residual")
    short, long = side.integers([1, 1, 1]), side.integers([1] * 5)
    odd = side.integers([F(1, 2).__float__()] * 4)  # type: ignore[list-item]
    for path, value, said in (
        (told, short, "u has not 4 entries"),
        (told, {**short, "count": 4}, "is not a vector of 4 numbers"),
        (told, long, "u has not 4 entries"),
        (told, {**at(data, told), "scale": "-1"}, "scale"),
        (told, {**side.integers([1, 2, 3, 4]), "scale": "0"}, "the scale is not positive"),
        (told, {**side.integers([1, 2, 3, 4]), "scale": "1/0"}, "not an exact number"),
        (told, {**at(data, told), "file": "../u.npy"}, "name is odd"),
        (told, {**at(data, told), "file": "nothing.npy"}, "cannot be read"),
        (told, {**at(data, told), "sha256": "0" * 64}, "not what its hash says"),
        (told, {**at(data, told), "count": True}, "is not a list"),
        (told, {**at(data, told), "more": 1}, "not known"),
        (told, {**side.column([float("nan")] * 4), "count": 4}, "not finite"),
        (told, side.integers([-1, 1, 1, 1]), "u is not positive"),
        (gauge, {**side.integers([1, 1, 1, 1]), "scale": "1"}, "have no scale"),
        (gauge, odd, "not integers"),
        (gauge, side.integers([3, 1, 1, 1]), "neither 1, -1 nor 0"),
        (residual, side.integers([9] * 4), "residual has not 6 entries"),
        (residual, side.integers([9] * 6), "of a leader that rests"),
        ((*TOP, "latency"), side.integers([1, 2]), "latency has not"),
        ((*TOP, "staged"), side.integers([1, 1, 1, 1]), "is missing"),
    ):
        assert said in reason(data, path, value, files=files), (path, said)


@pytest.mark.parametrize("digits", ["9" * 5000, "1e401", "1/" + "0" * 10, "0x1p1401", "nan", "1e-99999999", " 1"])
def test_numbers_beyond_the_grammar_are_refused(digits: str):
    data = full()
    paths = [(*TOP, key) for key in ("latency", "delay", "value_error", "gain_cap")]
    paths += [(*TOP, "rows", 0, key) for key in ("cap", "clock", "left", "initial", "floor")]
    paths += [
        (*TOP, "steps", "instants", 3),
        (*TOP, "missed", "bound"),
        (*step(data, "messages.rows[0]"), "numbers", "q"),
    ]
    paths += [
        (*step(data, "messages.rows[0]"), "witness", "u", 0),
        (*step(data, "messages.steps"), "witness", "start", 1),
    ]
    for path in paths:
        assert "is not an exact number" in reason(data, path, digits), path


def test_long_numbers_take_no_long_time():
    """Of 4,000 digits, wherever a number stands: refused or accepted, and soon."""
    long = "1/" + "7" * 3990
    with at_most(20):
        for data in (full(), form(), led()):
            for told in (data.get("messages"), data.get("leaders")):
                top = "messages" if "messages" in data else "leaders"
                for key, value in (told or {}).items():
                    if isinstance(value, str) and key != "own":
                        check(resealed(changed(data, (top, key), long)))
            for k, obligation_of in enumerate(data["proof"]):
                if obligation_of["kind"].startswith("late") or obligation_of["kind"] == "tracking":
                    for key, value in obligation_of.get("numbers", {}).items():
                        for new in (long, f"{value}{'1' * 3000}" if "/" in value else long, "9" * 4000):
                            check(resealed(changed(data, ("proof", k, "numbers", key), new)))
        primes = [f"1/{'9' * 1000}{k}1" for k in range(40)]
        assert not check(resealed(changed(full(), (*TOP, "steps", "instants"), ["0", *primes, "1"]))).accepted


def test_work_and_memory_are_refused_before_they_are_taken():
    n, count = 300, 2000
    edges = [(s, t) for t in range(1, n) for s in range(n) if s != t]
    own = Digraph([str(v) for v in range(n)], *zip(*edges, strict=True), [1] * len(edges), 1)
    steps = Steps(own, own.listening, [n - 1] * (n - 1), [1] * (n - 1), F(0))
    instants = [F(i, count) for i in range(count + 1)]
    for delay, allowed, said in ((F(1, 2), 1, "take too long"), (F(1, 2), 0.01, "too long over one denominator")):
        with at_most(1), limited(allowed), pytest.raises(WorkError, match=said):
            steps.run(instants, delay, [F(1)] * count)
