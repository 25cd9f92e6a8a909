"""The page of what goes together is what the program says."""

from __future__ import annotations

import pytest
from combinations import PAGE, PAIRS, PARTS, TEAMS, drawn_together, outcome, page, told


def test_the_page_is_written_of_what_it_tells():
    both = {team: told(team) for team in TEAMS}
    for pairs in both.values():
        assert list(pairs) == sorted(PAIRS, key=lambda pair: (list(PARTS).index(pair[1]), list(PARTS).index(pair[0])))
    assert page({team: {pair: pairs[pair] for pair in PAIRS} for team, pairs in both.items()}) == PAGE.read_text(
        "utf-8"
    )


@pytest.mark.few(6)
@pytest.mark.parametrize("team", TEAMS)
@pytest.mark.parametrize(("one", "other"), PAIRS)
def test_a_pair_goes_together_as_the_page_tells(one: str, other: str, team: str):
    assert outcome(one, other, team=team) == told(team)[one, other]


@pytest.mark.few(2)
@pytest.mark.parametrize("parts", drawn_together(), ids=" & ".join)
def test_three_and_four_that_go_together_in_pairs_go_together(parts: tuple[str, ...]):
    assert outcome(*parts) == "yes"
