"""Between which ends every signal keeps agents: all walks by hand, random and greedy signals, forged files, screens."""

from __future__ import annotations

import copy
import random
import re
from fractions import Fraction
from itertools import product
from typing import Any

import numpy as np
import pytest
from asked import certify_family
from families import random_family
from mutations import resealed
from oracle_family_certificates import false_family_claims
from scipy.linalg import expm
from selection import thinned

from ptcc_certify import Family, NominalProtocol, SlidingModeProtocol
from ptcc_certify.certificate.certificate import Certificate, read_certificate
from ptcc_certify.checker import check
from ptcc_certify.model.constrained_switching import DwellTime
from ptcc_certify.report.page import report_html
from ptcc_certify.report.screen import certificate_lines, summary_lines
from ptcc_certify.report.statement import report_latex

PROTOCOL = NominalProtocol(T=1, rho1=1, rho2=1, kappa=3)
GAINS = {"T_r": 1, "T_s": 1, "rho1": 1, "rho2": 1, "kappa": 3, "mu1": 2, "mu2": 1, "mu3": 1, "delta": 1}
DAY = Family.from_intervals([("a", "b", 1, 2), ("b", "c", -1, -1)], nodes="abcd")
NIGHT = Family.from_intervals([("b", "a", 1, 1), ("d", "c", "1/2", 1)], nodes="abcd")
MOVED, X0 = Family.switching([DAY, NIGHT]), [1, 2, 0, 5]


def made(family: Family, x0: Any, **more: Any) -> Certificate:
    return certify_family(family, more.pop("protocol", PROTOCOL), x0, time_limit=3, **more)


def by_walks(family: Family, x: list[Fraction]) -> list[tuple[Fraction, Fraction]]:
    """The ends from all walks: powers of the matrix of edges, with a row and a column for each sign of each agent."""
    n = family.n_nodes
    R = np.eye(2 * n, dtype=bool)
    for mode in family.modes:
        for s, t, sign in zip(mode.source.tolist(), mode.target.tolist(), mode.sign.tolist(), strict=True):
            for side in (0, 1):
                R[t + side * n, s + (side if sign > 0 else 1 - side) * n] = True
    for _ in range(2 * n):
        R = R | ((R.astype(int) @ R.astype(int)) > 0)
    values = [*x, *(-y for y in x)]
    told = [[y for y, heard in zip(values, R[k], strict=True) if heard] for k in range(n)]
    return [(min(some), max(some)) for some in told]


def members(family: Family) -> list[np.ndarray]:
    """Laplacians of members: of every mode that at the least weights, that at the largest, and two in between."""
    found, rng = [], np.random.default_rng(0)
    for mode, way in product(family.modes, range(4)):
        L = np.zeros((family.n_nodes, family.n_nodes))
        for e, (s, t) in enumerate(zip(mode.source, mode.target, strict=True)):
            low, high = float(mode.lower.fraction(e)), float(mode.upper.fraction(e))
            w = (low, high, low if rng.random() < 0.5 else high, rng.uniform(low, high))[way]
            L[t, t] += w
            L[t, s] -= w * mode.sign[e]
        found.append(L)
    return found


def reached(family: Family, x: list[Fraction], rng: random.Random) -> tuple[np.ndarray, np.ndarray]:
    """The least and the largest value that each agent has under signals that are played, half of them greedy."""
    begin, some = np.array([float(y) for y in x]), members(family)
    size = max(float(np.abs(L).max()) for L in some) or 1.0
    flows = [[expm(-L * h / size) for L in some] for h in (0.1, 1.0, 10.0)]
    low, high = begin.copy(), begin.copy()
    for run in range(40):
        y, target, side = begin, rng.randrange(len(x)), rng.choice((-1, 1))
        for _ in range(30):
            flow = rng.choice(flows)
            y = rng.choice(flow) @ y if run % 2 else max((F @ y for F in flow), key=lambda z: side * z[target])
            low, high = np.minimum(low, y), np.maximum(high, y)
    return low, high


@pytest.mark.few(0)
@pytest.mark.parametrize("seed", thinned(range(12), 3))
def test_every_signal_keeps_agents_within_the_ends_of_all_walks(seed: int):
    rng = random.Random(seed)
    family = random_family(rng, "depends", nodes=3 + seed % 4).family
    x = [Fraction(rng.randint(-20, 20), rng.randint(1, 7)) for _ in range(family.n_nodes)]
    certificate = made(family, x)
    assert certificate.verdict == "certified" and check(certificate.to_dict(), stdlib=True).accepted
    walks, (low, high) = by_walks(family, x), reached(family, x, rng)
    depending = [k for k, part in enumerate(certificate.parts) if part.component.behaviour == "depends on the signal"]
    assert list(certificate.ranges) == depending != []
    for k, ends in certificate.ranges.items():
        for v, own in zip(certificate.parts[k].component.nodes.tolist(), ends, strict=True):
            assert own == walks[v]
            assert float(own[0]) - 1e-9 <= low[v] <= high[v] <= float(own[1]) + 1e-9
    assert false_family_claims(certificate.to_dict()) == []


def test_ends_are_attained_where_agents_follow_whom_they_hear():
    certificate = made(MOVED, X0)
    assert certificate.ranges == {0: ((1, 2), (1, 2), (-2, 5), (5, 5))}
    low, high = reached(MOVED, [Fraction(x) for x in X0], random.Random(1))
    assert low[2] < -1.9 and high[2] > 4.9


def test_there_are_none_without_a_state_or_where_all_come_to_rest_or_sliding_variables_move():
    assert made(MOVED, None).ranges == {}
    assert made(DAY, X0).ranges == {}
    still = made(MOVED, X0, protocol=SlidingModeProtocol(**GAINS))
    moving = made(MOVED, X0, protocol=SlidingModeProtocol(**GAINS), sigma0=[0, 1, 0, 0])
    assert still.verdict == moving.verdict == "certified" and len(still.ranges) == 1 and not moving.ranges
    forged = {**moving.to_dict(), "boxes": still.to_dict()["boxes"]}
    forged["proof"] = moving.to_dict()["proof"] + [x for x in still.to_dict()["proof"] if x["of"].startswith("boxes")]
    assert "a box while sliding variables move" in (check(resealed(forged)).reason or "")


def test_no_end_is_accepted_that_is_nearer():
    data = made(MOVED, X0).to_dict()
    (place,) = [k for k, box in enumerate(data["boxes"]) if "vector" not in box]
    assert place == 1 and data["boxes"][place] == {
        "component": 0,
        "lower": ["1", "1", "-2", "5"],
        "upper": ["2", "2", "5", "5"],
    }
    step = Fraction(1, 10**30)
    for key, outwards in (("lower", -1), ("upper", 1)):
        for k, side in product(range(4), (-1, 1)):
            forged = copy.deepcopy(data)
            forged["boxes"][place][key][k] = str(Fraction(data["boxes"][place][key][k]) + side * step)
            report = check(resealed(forged))
            assert report.accepted is (side == outwards), (key, k, side)
            assert report.accepted or report.reason == "an agent may leave the box"


@pytest.mark.few(3)
@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"component": 1}, "an unknown component"),
        ({"component": -1}, "an unknown component"),
        ({"component": True}, "component is not an integer"),
        ({"lower": ["1", "1", "-2"]}, "lower or upper has not 4 entries"),
        ({"upper": ["2", "2", "5", "5", "5"]}, "lower or upper has not 4 entries"),
        ({"upper": None}, "upper is not a list"),
        ({"upper": [2, 2, 5, 5]}, "a value of type int is not an exact number"),
        ({"nodes": ["a", "b", "c", "d"]}, 'the key "nodes" is not known'),
        ({"rate": "1"}, 'the key "rate" is not known'),
    ],
)
def test_a_box_that_is_none_is_rejected(change: dict[str, Any], reason: str):
    data = made(MOVED, X0).to_dict()
    data["boxes"][1] |= change
    assert check(resealed(data)).reason == reason


@pytest.mark.few(0)
def test_boxes_have_an_order_and_obligations_of_their_own():
    data = made(MOVED, X0).to_dict()
    turned = copy.deepcopy(data)
    turned["boxes"].reverse()
    kinds = [step for step in turned["proof"] if step["of"].startswith("boxes")]
    for step, of in zip(kinds, ("boxes[1]", "boxes[0]"), strict=True):
        step["of"] = of
    turned["proof"] = [*turned["proof"][: -len(kinds)], *reversed(kinds)]
    assert check(resealed(turned)).reason == "boxes are out of order"
    twice = copy.deepcopy(data)
    twice["boxes"].append(twice["boxes"][1])
    twice["proof"].append(twice["proof"][-1] | {"of": "boxes[2]"})
    assert check(resealed(twice)).reason == "boxes are out of order"
    bare = copy.deepcopy(data)
    bare["proof"].pop()
    assert not check(resealed(bare)).accepted
    resting = made(DAY, X0).to_dict()
    first = {"component": 0, "lower": ["-9"] * 3, "upper": ["9"] * 3}
    assert check(resealed({**resting, "boxes": [first]})).reason == "a box where all agents come to rest"
    older = copy.deepcopy(data)  # files that were made before have none
    older["boxes"].pop()
    older["proof"].pop()
    assert check(resealed(older)).accepted


@pytest.mark.usefixtures("framed_figures")
def test_screen_page_statement_and_table_tell_them():
    certificate = made(MOVED, X0)
    saved = read_certificate(certificate.to_dict())
    assert saved == certificate and saved.ranges == certificate.ranges
    assert certificate_lines(saved, "f")[2:] == certificate_lines(certificate, "f")[2:]
    told = "every signal keeps a, b in [1, 2], c in [-2, 5], d at 5 at all times"
    assert f"x(t) {told}" in re.sub(r"\s+", " ", "\n".join(summary_lines(saved, "f")))
    page = " ".join(re.sub("</?bdi>|(<[^>]*>)", lambda tag: " " if tag[1] else "", report_html(saved)).split())
    assert f"Where they stay {told}.".replace("-", "\N{MINUS SIGN}") in page
    assert f"Where they stay: {told}." in re.sub("[$]", "", report_latex(saved))
    pytest.importorskip("pandas")
    table = saved.to_pandas()
    assert table["stays_least"].tolist() == [1, 1, -2, 5] and table["stays_largest"].tolist() == [2, 2, 5, 5]


def test_where_the_last_mode_tells_the_same_the_screen_does_not_repeat_it():
    dwell = made(MOVED, X0, signal=DwellTime("0.3", clock="t"))
    assert dwell.ranges and "every signal keeps" not in "\n".join(summary_lines(dwell, "f"))
