"""Declarations are read strictly: every annotation counts, and what is refused is named."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import fields
from fractions import Fraction
from pathlib import Path
from typing import Annotated, Any, Literal

import pytest

from ptcc_certify.certificate.json_schema import json_schema
from ptcc_certify.checker.contents import BRINGS, FamilyCertificate, GraphCertificate
from ptcc_certify.checker.input import Box
from ptcc_certify.checker.obligations import OBLIGATIONS
from ptcc_certify.checker.reading import SCHEMA, RejectedError
from ptcc_certify.checker.section_declarations import (
    ByNumber,
    Context,
    FewAgents,
    Labels,
    Node,
    Pattern,
    Rule,
    Several,
    Unread,
    declared,
    read,
)
from ptcc_certify.checker.side_files import SideFiles
from ptcc_certify.checker.theorem_function import BlockSection


def context() -> Context:
    at = Context(SideFiles(Path(), {}))
    at.know(["a", "b"])
    return at


def refused(kind: Any, value: Any) -> str:
    with pytest.raises(RejectedError) as error:
        read(kind, value, context(), "it")
    return str(error.value)


def test_a_negative_radius_of_initial_states_is_refused():
    center = {"a": "1", "b": "2"}
    assert list(read(Box, {"center": center, "radius": {"a": "0", "b": "1"}}, context(), "it").radius) == [0, 1]
    assert refused(Box, {"center": center, "radius": {"a": "0", "b": "-1"}}) == "radius is negative"


def test_every_annotation_of_several_counts():
    even = Annotated[FewAgents, Rule(lambda x: all(value % 2 == 0 for value in x), "is odd")]
    side = {"file": "x.npy", "sha256": "0" * 64, "count": 2}
    assert refused(even, {"a": "1", "b": "2"}) == "it is odd"
    assert refused(even, side) == "it in a side file"
    assert read(Unread[Several[int]], "anything", context(), "it") == "anything"


def test_tuples_labels_numbers_and_texts_are_read():
    edge = tuple[Node, Node, Fraction] | None
    assert read(edge, ["b", "a", "1/2"], context(), "it") == (1, 0, Fraction(1, 2))
    assert refused(edge, ["b", "a"]) == "it has not 3 entries"
    assert refused(edge, ["b", "c", "1"]) == "it: an unknown node"
    assert refused(Labels, ["a", "a"]) == "a node occurs twice"
    assert refused(Labels, []) == "it are not texts, or there is none"
    assert refused(Annotated[str, Pattern("[0-9]+")], "1x") == "it is not like [0-9]+"
    assert refused(ByNumber[Fraction], {"0": "1"}) == "it is not an object with numbers as keys"


def test_alternatives_are_told_by_the_types_of_json():
    assert read(int | Several[int], [1, 2], context(), "it") == [1, 2]
    assert refused(int | Several[int], True) == "it is not an integer"
    assert read(Literal["equal"] | ByNumber[Fraction], {"1": "2"}, context(), "it") == {"1": 2}


def test_one_of_two_shapes_of_a_block_is_there():
    block: dict[str, Any] = {"name": "P", "nodes": ["a"], "times_rho": False}
    assert read(BlockSection, {**block, "diagonal": ["1"]}, context(), "it").diagonal == ["1"]
    assert refused(BlockSection, block) == "it has not one of diagonal, lower_triangle"
    assert "has not one of" in refused(BlockSection, {**block, "diagonal": ["1"], "lower_triangle": [["1"]]})


def test_what_is_declared_is_what_there_is():
    assert set(BRINGS) <= set(OBLIGATIONS)
    for kind in (GraphCertificate, FamilyCertificate):
        assert declared(kind)[0].kind == Literal[SCHEMA] and len(declared(kind)) == len(fields(kind))


def test_the_schema_is_printed():
    command = [sys.executable, "-m", "ptcc_certify.certificate.json_schema"]
    assert json.loads(subprocess.run(command, capture_output=True, check=True).stdout) == json_schema()
