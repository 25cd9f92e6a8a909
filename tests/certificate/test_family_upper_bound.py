"""Facts about the upper bound in the file of a family: it is read back with what proves it, or not at all."""

from functools import cache

import pytest
from selection import thinned

from ptcc_certify import Family, NominalProtocol, SignedDigraph, certify, read_certificate

PROTOCOL = NominalProtocol(T=1, rho1=1, rho2=1, kappa=3)
DAY = SignedDigraph.from_edges([("a", "b", 1), ("b", "c", -1)])
NIGHT = SignedDigraph.from_edges([("c", "a", -2), ("a", "b", 1)])
FAMILIES = {
    "word": Family.switching({"day": DAY, "night": NIGHT}),
    "rivals": Family.from_intervals(
        [("a", "b", -1, 1), ("b", "a", 1, 2), ("b", "c", -3, -2), ("c", "b", 1, 1), ("c", "a", 1, 1)]
    ),
    "mixture": Family.from_intervals([(2, 0, 3, 3), (2, 1, 3, 3), (0, 2, -3, -3), (1, 2, -3, 3)]),
    "member": Family.from_graph(DAY, uncertainty="10%"),
    "undirected": Family.from_intervals([("a", "b", 1, 2), ("b", "c", 1, 3)], undirected=True),
}


@cache
def certified(name):
    return certify(FAMILIES[name], PROTOCOL)


@pytest.mark.few(1)
@pytest.mark.parametrize("name", thinned(FAMILIES, 2))
def test_a_bound_is_read_back_as_it_was_proved(name):
    made = certified(name)
    bound = made.parts[0].upper_bound
    assert bound is not None and (name not in ("word", "member", "mixture") or bound.kind == name)
    assert read_certificate(made.to_dict()).parts[0].upper_bound == bound


@pytest.mark.parametrize("name", thinned(FAMILIES, 2))
def test_a_bound_below_what_its_members_prove_is_not_taken(name):
    made = certified(name)
    document, bound = made.to_dict(), made.upper_bound
    document["unverified"]["upper_bounds"][0]["value"] = str(bound / 2)
    read = read_certificate(document).upper_bound
    assert read is None or read >= bound


def test_members_that_the_family_has_not_prove_nothing():
    made = certified("member")
    for change in ({"mode": 1}, {"mode": "0"}, {"weights": []}, {"weights": [["a", "b", "0.1"], ["b", "c", "-1"]]}):
        document = made.to_dict()
        document["unverified"]["upper_bounds"][0]["members"][0] |= change
        assert read_certificate(document).upper_bound is None
    for junk in (5, [], [5], [{}], [{"members": 3}], None):
        document = made.to_dict()
        document["unverified"]["upper_bounds"] = junk
        assert read_certificate(document).upper_bound is None


def test_members_with_both_signs_of_an_edge_on_make_a_mixture_of_those_with_one():
    made = certified("mixture")
    entry = made.to_dict()["unverified"]["upper_bounds"][0]
    weights = [[x for *_, x in member["weights"] if x != "0"] for member in entry["members"]]
    assert sorted(weights) == [["-3"], ["3"]] and entry["durations"] == ["1/2", "1/2"]
    both = {"mode": 0, "name": "", "weights": [["1", "2", "-3/2"], ["1", "2", "3/2"]]}
    document = made.to_dict()
    document["unverified"]["upper_bounds"][0] |= {"kind": "member", "members": [both], "durations": ["1"]}
    assert made.upper_bound is not None and read_certificate(document).upper_bound is None
