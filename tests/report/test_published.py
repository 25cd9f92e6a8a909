"""Published examples: each claim holds, or fails, as recorded, and each number says where it was seen."""

from __future__ import annotations

import re
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest
from bad_inputs import ptcc as command

import ptcc_certify as ptcc
from ptcc_certify.errors import ParameterError
from ptcc_certify.examples import published
from ptcc_certify.examples.published import PUBLISHED, select_published
from ptcc_certify.report.example_results import PUBLISHED_HEAD, Found, certify_published

FOLDER = Path(published.__file__).parent
PAGE = Path(__file__).parents[2] / "docs" / "gallery" / "published.md"


@pytest.mark.parametrize("name", PUBLISHED)
def test_every_claim_holds_or_fails_as_recorded(name: str) -> None:
    found = certify_published(PUBLISHED[name])
    assert found.as_recorded, found.certificate.assessment.text
    assert found.misses == ()
    assert found.certificate.checked is not None and found.certificate.checked.accepted
    assert found.verdict.startswith("not as claimed" if found.entry.fails else "certified")


def test_every_entry_says_where_its_numbers_are_from() -> None:
    assert len(PUBLISHED) == 33
    for name, entry in PUBLISHED.items():
        assert entry.name == name and len(name) < 26
        assert re.search(r"github\.com/\S+", entry.source), name
        assert entry.doi is None or re.fullmatch(r"10\.\d{4,9}/\S+", entry.doi)
        assert entry.claim.endswith(".") and entry.paper and entry.kind


def test_every_graph_is_of_an_entry_and_every_entry_on_the_page() -> None:
    graphs = {graph for entry in PUBLISHED.values() for graph in entry.graphs} - {"highland_tribes"}
    assert {path.stem for path in FOLDER.glob("*.csv")} == graphs
    page = PAGE.read_text(encoding="utf-8")
    assert re.findall(r'^glance\("(\w+)"\)$', page, re.MULTILINE) == list(PUBLISHED)


def test_initial_and_final_states_are_of_nodes() -> None:
    for entry in PUBLISHED.values():
        if entry.x0:
            assert set(entry.x0) == {str(label) for label in entry.graph().labels}
            assert set(entry.ends or ()) <= set(entry.x0)


def test_a_state_is_compared_to_the_last_digit() -> None:
    entry = PUBLISHED["four_people_second_issue"]
    ends = {node: Fraction(text) for node, text in (entry.ends or {}).items()}
    assert entry.misses(ends) == ()
    assert entry.misses(ends | {"1": ends["1"] + Fraction("0.05")}) == ()
    assert entry.misses(ends | {"1": ends["1"] + Fraction("0.051")}) == ("1",)
    assert PUBLISHED["french"].misses(dict.fromkeys("123", Fraction("0.4285714"))) == ("1", "2", "3")


def test_a_final_state_that_depends_on_the_signal_is_not_as_claimed() -> None:
    assert certify_published(PUBLISHED["noisy"]).verdict == "certified, 4 final states as claimed"
    entry = replace(PUBLISHED["textbook_four_switching"], ends={"1": "15"})
    assert certify_published(entry).misses == ("1",)


def test_what_is_not_as_recorded_is_told() -> None:
    certificate = certify_published(PUBLISHED["four_people"]).certificate
    other = Found(PUBLISHED["four_people_second_issue"], certificate)
    assert not other.as_recorded
    assert other.verdict == "not as claimed: 1, 2, 3, 4 end elsewhere"
    found = Found(PUBLISHED["leader_other_matrix"], certificate)
    assert not found.as_recorded


def test_the_social_power_of_managers_is_that_of_those_who_are_asked() -> None:
    graph = ptcc.as_graph(PUBLISHED["managers"].graph())
    shares = dict(zip(graph.labels, ptcc.influence(graph).shares, strict=True))
    assert sorted((label for label, share in shares.items() if share == 0), key=int) == ["6", "13", "16", "17"]
    assert [label for label, _ in sorted(shares.items(), key=lambda pair: -pair[1])][:4] == ["21", "7", "2", "18"]


def test_the_slowest_follower_is_as_slow_as_printed() -> None:
    rate = certify_published(PUBLISHED["six_in_three"]).certificate.proof.rate
    assert rate is not None and round(float(2 / rate), 4) == 1.2176  # c_th of the source


def test_the_command_tells_and_writes_them(tmp_path: Path) -> None:
    run = command("examples", "french", "-o", str(tmp_path / "new"), "--format", "svg")
    assert run.code == 0
    assert run.out.splitlines() == [*PUBLISHED_HEAD, *certify_published(PUBLISHED["french"]).lines()]
    assert ptcc.read_certificate(tmp_path / "new" / "french.json").graph_proof.claim.special == ("consensus",)
    assert "<svg" in (tmp_path / "new" / "french.svg").read_text(encoding="utf-8")


@pytest.mark.few(0)
def test_one_command_runs_them_all() -> None:
    run = command("examples", "published")
    assert run.code == 0
    assert [line.split()[0] for line in run.out.splitlines()[2::2]] == list(PUBLISHED)


def test_an_unknown_name_is_refused() -> None:
    with pytest.raises(ParameterError, match="did you mean french"):
        select_published("frensh")
