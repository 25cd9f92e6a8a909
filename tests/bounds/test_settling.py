"""When protocols without a pole settle: closed forms of single followers, and runs that rest no later."""

from __future__ import annotations

import json
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from bad_inputs import ptcc as command
from generators import all_classes, random_graph
from scipy.integrate import quad

from ptcc_certify.bounds.settling import PowerProtocol
from ptcc_certify.errors import ParameterError

F = Fraction
CLASSES = all_classes()
LAWS: list[tuple[list[str], Any]] = [
    (["1/2"], 1),
    (["1/2", "3/2"], 2),
    (["3/4"], "1/2"),
    (["1/4", "5/4"], 1),
    (["1/3", "2"], "1/2"),
]
LED = [("a", "b", 3)]


def psi(e: np.ndarray, law: PowerProtocol) -> np.ndarray:
    return float(law.gain) * sum((np.sign(e) * np.abs(e) ** float(F(p)) for p in law.powers), np.zeros_like(e))


def rests(L: np.ndarray, x0: np.ndarray, law: PowerProtocol, by: float) -> tuple[float, float]:
    """Return from when on ``|e|`` is nothing but what steps leave of it, and the largest input, up to ``by``."""
    x, t, last, most = x0, 0.0, 0.0, 0.0
    e = -L @ x
    p, slope = float(F(law.powers[0])), np.abs(L).sum(1).max() * float(law.gain)
    small = max(1e-3 * np.abs(e).max(), 5 * (by / 20_000 * slope) ** (1 / (1 - p)))
    while t < by:
        rate = slope * sum(float(F(q)) * max(np.abs(e).max(), small) ** (float(F(q)) - 1) for q in law.powers)
        h, u = min(by / 20_000, 0.05 / rate), psi(e, law)
        most = max(most, float(np.abs(u).max()))
        x, t = x + h * u, t + h
        e = -L @ x
        last = t if np.abs(e).max() > small else last
    return last, most


@pytest.mark.few(6)
@pytest.mark.parametrize("seed", range(60))
def test_no_run_rests_later_than_is_proved_or_has_a_larger_input(seed: int):
    rng = np.random.default_rng(seed)
    graph = random_graph(rng, **CLASSES[seed % len(CLASSES)][1]).graph
    x0 = [F(int(v), 10) for v in rng.integers(-50, 50, graph.n_nodes)]
    law = PowerProtocol(*LAWS[seed % len(LAWS)])
    found = law.settling(graph, x0)
    L, begin = graph.dense_laplacian(), np.array(x0, dtype=float)
    assert found.by is not None and (found.from_anywhere is None) == (len(law.powers) == 1 and L.any())
    assert found.from_anywhere is None or found.by <= found.from_anywhere
    assert float(found.input) == pytest.approx(np.abs(psi(L @ begin, law)).max(), rel=1e-9)
    if found.by:
        last, most = rests(L, begin, law, float(found.by))
        assert last < float(found.by) and most <= float(found.input) * (1 + 1e-9)


@pytest.mark.parametrize("p", ["1/2", "1/3", "9/10"])
def test_a_single_follower_rests_exactly_then(p: str):
    found = PowerProtocol([p], 2).settling(LED, [1, 5])  # x_b' = 2 (3 (x_a - x_b))^p
    exponent = float(F(p))
    exact = 4 ** (1 - exponent) / (2 * 3**exponent * (1 - exponent))
    assert float(found.by) == pytest.approx(exact, rel=1e-12) and float(found.by) >= exact * (1 - 1e-15)
    assert found.from_anywhere is None


def test_a_single_follower_rests_in_fixed_time_from_everywhere():
    law = PowerProtocol(["1/2", "3/2"])
    exact = quad(lambda y: 1 / ((3 * y) ** 0.5 + (3 * y) ** 1.5), 0, np.inf)[0]
    for far in (1, 10**6):
        found = law.settling(LED, [0, far])
        assert float(found.from_anywhere) == pytest.approx(exact, rel=1e-7)
        assert found.by <= found.from_anywhere
    near = law.settling(LED, [0, "0.001"])
    assert near.by < near.from_anywhere / 5


def test_who_is_at_rest_rests_from_0_and_followers_wait_for_groups():
    law = PowerProtocol(["1/2"])
    assert law.settling([("a", "b", 1), ("b", "a", 1)], [2, 2]) == type(law.settling(LED, [1, 1]))(0, None, 0)
    pair = [("a", "b", 1), ("b", "a", 1)]
    alone, led = law.settling(pair, [1, 3]), law.settling([*pair, ("b", "c", 1)], [1, 3, 2])
    assert led.by >= alone.by + 4  # at most 6 from its final state: 2 sqrt(6)
    opponents = law.settling([("a", "b", 1), ("b", "a", -1)], [1, 3])
    assert opponents.by is not None


@pytest.mark.parametrize("powers", [[], ["2"], ["3/2", "1/2"], ["1/2", "1/2"], ["1/2", "3/2", "2"], ["-1"], [0]])
def test_other_powers_are_refused(powers: list[Any]):
    with pytest.raises(ParameterError, match="powers"):
        PowerProtocol(powers)


def test_the_command_compares_and_refuses(tmp_path: Any, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "g.csv").write_text("a,b,1\nb,c,-2\n", encoding="utf-8")
    run = command("compare", "g.csv", "--x0", "1,2,3", "--rho2", "3", "--json")
    told = json.loads(run.out)
    assert run.code == 0 and list(told) == ["asymptotic", "finite", "fixed", "prescribed"]
    assert told["asymptotic"]["by"] is None and told["prescribed"]["by"] == "1"
    assert F(told["fixed"]["by"]) <= F(told["fixed"]["from_anywhere"])
    assert told["asymptotic"]["input"] == "10"  # e_c = -2 (2) - 2 (3)
    lines = command("compare", "g.csv", "--x0", "1,2,3").out
    assert "never at rest" in lines and "later from farther away" in lines and "at rest at 1, from everywhere" in lines
    for words, said in ((("--power", "2"), "powers"), (("--factor", "0"), "gain"), (("--power", "x"), "--power")):
        run = command("compare", "g.csv", *words)
        assert run.code == 2 and said in run.err
