"""The table of a family's certificate: ends for every signal, for restricted ones, boxes, and who keeps its value."""

from __future__ import annotations

import math
from fractions import Fraction

import pytest

import ptcc_certify as ptcc
from ptcc_certify.bounds.final_state.attracting_box import AttractingBox
from ptcc_certify.graphs.family import Family
from ptcc_certify.model.constrained_switching import DwellTime

pytest.importorskip("pandas")
PROTOCOL = ptcc.NominalProtocol(T=1, rho1=1, rho2=1, kappa=3)
FIRST = [("a", "b", 1), ("b", "c", -2), ("c", "d", 1)]
OTHER = [("b", "a", 1), ("b", "c", 1), ("c", "d", 1), ("a", "d", 1)]
SWITCHING = Family.switching([ptcc.SignedDigraph.from_edges(edges) for edges in (FIRST, OTHER)])
LEADERS = Family.from_intervals([("a", "c", 1, 3), ("b", "c", 1, 1)])
ENDS = ["restricted_least", "restricted_largest"]


def both_ways(certificate):
    """Return the table, which is that of the certificate when it is read back."""
    table = certificate.to_pandas()
    assert table.equals(ptcc.read_certificate(certificate.to_dict()).to_pandas())
    return table


def test_ends_under_a_dwell_time_stand_beside_those_for_every_signal():
    signal = DwellTime("0.2", clock="t")
    table = both_ways(ptcc.certify(SWITCHING, PROTOCOL, {"a": 1, "b": 2, "c": 3, "d": -4}, signal=signal))
    assert table[["least", "largest"]].isna().all(axis=None)
    assert table[ENDS].to_numpy().tolist() == [[1, 2], [1, 2], [-2, 3], [-4, 3]]
    assert set(table["restricted_to"]) == {str(signal)} and not table["keeps"].any()


def test_ends_of_constant_weights_do_not_replace_those_for_every_signal():
    pair = Family.from_intervals([("a", "b", 1, 2), ("b", "a", 1, 1)])
    table = both_ways(ptcc.certify(pair, PROTOCOL, [0, 6], signal="constant"))
    bare = both_ways(ptcc.certify(pair, PROTOCOL, [0, 6]))
    assert table[ENDS].to_numpy().tolist() == [[2, 3], [2, 3]] and set(table["restricted_to"]) == {"constant"}
    assert (table[["least", "largest"]] == bare[["least", "largest"]]).all(axis=None)
    assert (table["least"] < 2).all() and (table["largest"] > 3).all()
    assert bare[ENDS].isna().all(axis=None) and set(bare["restricted_to"]) == {""}


def test_types_of_the_table_do_not_depend_on_what_is_known():
    certificates = (
        ptcc.certify(SWITCHING, PROTOCOL),
        ptcc.certify(SWITCHING, PROTOCOL, [1, 2, 3, 4], signal="constant"),
        ptcc.certify(LEADERS, PROTOCOL, {"a": 0, "b": 4, "c": 9}),
    )
    tables = [both_ways(certificate) for certificate in certificates]
    assert all((table.dtypes == tables[0].dtypes).all() for table in tables)
    assert tables[0].drop(columns=["restricted_to", "keeps"]).isna().all(axis=None)


def test_boxes_are_no_ends_and_who_listens_to_nobody_keeps_its_value():
    certificate = ptcc.certify(LEADERS, PROTOCOL, {"a": 0, "b": 4, "c": 9})
    table = both_ways(certificate)
    assert table.loc["c", ["box_least", "box_largest"]].tolist() == [1, 2]
    assert table.loc[["a", "b"], ["box_least", "box_largest"]].isna().all(axis=None)
    assert table[["least", "largest"]].isna().all(axis=None)
    assert table["keeps"].to_dict() == {"a": True, "b": True, "c": False}


def test_boxes_of_several_components_belong_to_their_agents_and_are_rounded_outwards():
    rows = [(f"a{k}", f"c{k}", 1, 3) for k in (1, 2)] + [(f"b{k}", f"c{k}", 1, 1) for k in (1, 2)]
    family = Family.from_intervals(rows)
    certificate = ptcc.certify(family, PROTOCOL, {"a1": 0, "b1": 4, "c1": 0, "a2": "1/3", "b2": "2/3", "c2": 0})
    table = both_ways(certificate)
    assert sorted(table.index[table["box_least"].notna()]) == ["c1", "c2"]
    box: AttractingBox
    for number, box in certificate.boxes.items():
        label = certificate.parts[number].component.family.labels[int(box.decay.nodes[0])]
        low, high = (Fraction(table.loc[label, column]) for column in ("box_least", "box_largest"))
        assert low <= box.lower[0] <= math.nextafter(low, math.inf)
        assert math.nextafter(high, -math.inf) <= box.upper[0] <= high


def test_who_hears_somebody_in_one_mode_or_at_an_optional_edge_does_not_keep_its_value():
    optional = Family.from_intervals([("a", "b", 0, 1)])
    assert ptcc.certify(optional, PROTOCOL).to_pandas()["keeps"].tolist() == [True, False]
    one = [ptcc.SignedDigraph.from_edges([("a", "b", 1)]), ptcc.SignedDigraph.from_edges([("b", "a", 1)])]
    assert not ptcc.certify(Family.switching(one), PROTOCOL).to_pandas()["keeps"].any()


@pytest.mark.parametrize("sigma0", [[0, 0], [1, 0]])
def test_while_a_sliding_variable_moves_nobody_is_said_to_keep_its_value(sigma0):
    sliding = ptcc.SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=3, mu1=2, mu2=1, mu3=1, delta=1)
    table = both_ways(
        ptcc.certify(Family.from_intervals([("a", "b", 0, 1)]), sliding, ptcc.InitialState([1, 2], sigma0=sigma0))
    )
    assert table["keeps"].tolist() == [not any(sigma0), False]
