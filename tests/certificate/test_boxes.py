"""Boxes that attract followers, certified: all vertices, forged files, screens, what is read back."""

from __future__ import annotations

import random
import re
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np
import pytest
from asked import certify_family
from mutations import changed, leaves, of_leaf, resealed
from oracle_family_certificates import false_family_claims
from row_families import laplacian, random_followers, vertices
from selection import thinned

from ptcc_certify import Family, NominalProtocol, SlidingModeProtocol
from ptcc_certify.bounds.final_state.attracting_box import box_of_family
from ptcc_certify.certificate.certificate import Certificate, read_certificate
from ptcc_certify.checker import check
from ptcc_certify.report.page import report_html
from ptcc_certify.report.screen import certificate_lines, summary_lines
from ptcc_certify.report.statement import report_latex

PROTOCOL = NominalProtocol(T=1, rho1=1, rho2=1, kappa=3)
GAINS = {"T_r": 1, "T_s": 1, "rho1": 1, "rho2": 1, "kappa": 3, "mu1": 2, "mu2": 1, "mu3": 1, "delta": 1}
MOVED = Family.from_intervals([("a", "c", 1, 3), ("b", "c", 1, 1), ("c", "d", 1, 2), ("a", "d", -1, 0)], nodes="abcd")


def made(family: Family, x0: Any, protocol: Any = PROTOCOL, **more: Any) -> Certificate:
    return certify_family(family, protocol, x0, time_limit=3, **more)


@cache
def moved() -> Certificate:
    return made(MOVED, [0, 4, 100, 3])


def compare(seed: int) -> int:
    """Compare with where followers end at all vertices, leaders being at rest; return how many boxes there were."""
    rng = random.Random(seed)
    family = random_followers(rng, leaders=rng.randint(2, 3))
    x = [Fraction(rng.randint(-20, 20), rng.randint(1, 7)) for _ in range(family.n_nodes)]
    certificate = made(family, x)
    assert certificate.verdict == "certified" and check(certificate.to_dict(), stdlib=True).accepted
    assert not certificate.boxes or false_family_claims(certificate.to_dict()) == []
    for number, box in certificate.boxes.items():
        nodes = certificate.parts[number].component.nodes
        inside = nodes[box.decay.nodes]
        rest = np.setdiff1d(nodes, inside)
        ends = []
        for largest in vertices(family.modes[0]):
            L = laplacian(family.modes[0], largest)
            begin = np.array([float(x[v]) for v in rest])
            ends.append(np.linalg.solve(L[np.ix_(inside, inside)], -L[np.ix_(inside, rest)] @ begin))
        low, high = np.min(ends, axis=0), np.max(ends, axis=0)
        assert np.allclose(np.array(box.lower, dtype=float), low, rtol=0, atol=1e-7)
        assert np.allclose(np.array(box.upper, dtype=float), high, rtol=0, atol=1e-7)
    return len(certificate.boxes)


@pytest.mark.few(0)
def test_the_box_that_is_certified_is_what_constant_weights_attain():
    assert sum(map(compare, range(4))) >= 2


@pytest.mark.campaign
@pytest.mark.parametrize("start", range(4, 76, 8))
def test_the_boxes_that_are_certified_are_what_constant_weights_attain(start: int):
    assert sum(map(compare, range(start, start + 8))) >= 3


def test_leaders_that_agree_count_with_all_their_values_from_the_beginning():
    """``a`` and ``b`` end between -1 and 2; what they are on the way there counts, their limit does not."""
    led = [("a", "b", 1, 2), ("b", "a", 1, 1), ("b", "d", 1, 2), ("c", "d", -2, -1)]
    certificate = made(Family.from_intervals(led, nodes="abcd"), [-1, 2, 3, 50])
    (box,) = certificate.boxes.values()
    assert (box.lower, box.upper) == ((Fraction(-7, 3),), (Fraction(1, 3),)) and certificate.verdict == "certified"


def test_agents_of_two_modes_with_other_targets_are_drawn_into_one_box():
    modes = [[("a", "c", 1, 1), ("b", "c", 1, 2)], [("a", "c", -2, -1), ("b", "c", 1, 1)]]
    certificate = made(Family.switching([Family.from_intervals(edges, nodes="abc") for edges in modes]), [3, 6, 0])
    (box,) = certificate.boxes.values()
    assert (box.lower, box.upper) == ((0,), (5,)) and certificate.verdict == "certified"


@pytest.mark.few(0)
def test_there_is_no_box_without_a_state_or_followers_or_where_all_come_to_rest_or_sliding_variables_move():
    assert made(MOVED, None).boxes == {}
    assert made(Family.from_intervals([("a", "b", 1, 2), ("b", "a", 1, 1), ("b", "c", 1, 2)]), [1, 2, 3]).boxes == {}
    foes = Family.from_intervals([("a", "b", -1, 1), ("b", "a", 1, 2)])
    assert made(foes, [1, 2]).behaviours == ("depends on the signal",) and made(foes, [1, 2]).boxes == {}
    sliding = SlidingModeProtocol(**GAINS)
    still = made(MOVED, [0, 4, 100, 3], sliding)
    moving = made(MOVED, [0, 4, 100, 3], sliding, sigma0=[0, 1, 0, 0])
    assert still.verdict == moving.verdict == "certified" and len(still.boxes) == 1 and not moving.boxes
    forged = {**moving.to_dict(), "boxes": still.to_dict()["boxes"]}
    forged["proof"] = moving.to_dict()["proof"] + [x for x in still.to_dict()["proof"] if x["kind"] == "attracting-box"]
    assert "a box while sliding variables move" in (check(resealed(forged)).reason or "")


def test_what_is_read_back_says_the_same():
    certificate = moved()
    again = read_certificate(certificate.to_dict())
    assert again == certificate and certificate_lines(again, "f")[2:] == certificate_lines(certificate, "f")[2:]
    assert again.boxes[0].excess([0, 4, 100, 3]) == certificate.boxes[0].excess([0, 4, 100, 3]) > 0
    assert certificate.final_state == (None,) * 4


@pytest.mark.usefixtures("framed_figures")
def test_screen_page_and_statement_tell_the_box_and_claim_no_limit():
    saved = read_certificate(moved().to_dict())
    told = "every signal draws c into [1, 2], d into [0.5, 2], at the rate 1.99004; no limit is claimed"
    screen = re.sub(r"\s+", " ", "\n".join(summary_lines(saved, "f")))
    assert f"box {told}" in screen and "x(T)" not in screen
    page = " ".join(re.sub("</?bdi>|(<[^>]*>)", lambda tag: " " if tag[1] else "", report_html(saved)).split())
    assert f"Where they are drawn {told}." in page
    assert f"Where they are drawn: {told}." in re.sub("[$]", "", report_latex(saved))


# ---------------------------------------------------------------------- forged files


def mutants(boxes: Any) -> list[tuple[tuple[Any, ...], Any]]:
    """Places in a claim, and what to write there."""
    found = []
    for path, value in leaves(boxes):
        others = of_leaf(value, list("abcd"), False)
        if isinstance(value, str) and value not in "abcd":
            others += [str(Fraction(value) * (1 + Fraction(k, 10**6))) for k in (-1, 1)]
            others += [str(Fraction(value) + k) for k in (-1, 1)]
        found += [(path, new) for new in others]
    return found


@pytest.mark.parametrize("first", thinned(range(14), 14))
def test_no_mutant_of_a_box_is_accepted_that_is_false(first: int):
    """Every fourteenth of them, from the first on."""
    data = {**moved().to_dict(), "unverified": {}}
    accepted = rejected = 0
    for path, new in mutants(data["boxes"])[first::14]:
        mutant = resealed(changed(data, ("boxes", *path), new))
        if check(mutant, stdlib=True).accepted:
            accepted += 1
            assert false_family_claims(mutant) == [], (path, new)
        else:
            rejected += 1
    assert accepted >= 1 and rejected >= 3


@pytest.mark.parametrize(
    ("path", "new", "reason"),
    [
        (("component",), 1, "an unknown component"),
        (("nodes",), ["d", "c"], "followers"),
        (("nodes",), ["c"], "a follower is heard by another agent"),  # d hears c
        (("nodes",), [], "followers"),
        (("nodes",), ["b", "c", "d"], "vector has not 3 entries"),
        (("lower",), ["1", "501/1000"], "an agent may leave the box"),
        (("upper",), ["1999/1000", "2"], "an agent may leave the box"),
        (("upper",), ["2", "2", "2"], "lower or upper has not 2 entries"),
        (("vector",), ["1", "0"], "the vector is not positive"),
        (("rate",), "0", "rate is not positive"),
        (("rate",), "2", "a row does not decay fast enough"),
    ],
)
def test_what_does_not_fit_is_rejected(path: tuple[Any, ...], new: Any, reason: str):
    data = moved().to_dict()
    assert check(data).accepted
    assert check(resealed(changed(data, ("boxes", 0, *path), new))).reason == reason


def test_a_leader_is_no_follower():
    data = moved().to_dict()
    box = {"nodes": ["b", "c", "d"], "vector": ["1", "1", "1"], "lower": ["4", "1", "1"], "upper": ["4", "2", "2"]}
    wrong = data | {"boxes": [data["boxes"][0] | box]}
    assert check(resealed(wrong)).reason == "a row does not decay fast enough"


def test_a_box_of_agents_that_come_to_rest_is_none():
    rest = made(Family.from_intervals([("a", "b", 1, 2)]), [1, 2]).to_dict()
    box = {"component": 0, "nodes": ["b"], "vector": ["1"], "lower": ["1"], "upper": ["1"], "rate": "2"}
    assert "where all agents come to rest" in (check(resealed({**rest, "boxes": [box]})).reason or "")


def test_states_without_a_common_denominator_that_the_check_takes_have_no_box(monkeypatch: pytest.MonkeyPatch):
    x = [Fraction(1, 3**20), Fraction(1, 5**20), Fraction(0), Fraction(1)]
    assert box_of_family(MOVED, x) is not None
    monkeypatch.setattr("lmi.exact.numbers.MAX_SCALE_BITS", 60)
    assert box_of_family(MOVED, x) is None
