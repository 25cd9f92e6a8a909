"""Rows of followers in integers: what numbers of any length cost."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable
from fractions import Fraction

import pytest

from lmi.exact.work import WorkError
from ptcc_certify.checker.follower_rows import Followers, Rows, WeightsBetween
from ptcc_certify.checker.side_files import Numbers

MANY, LONG = 40_000, 10**3990


@pytest.mark.parametrize(
    "verify",
    [
        lambda rows: rows.decay(Fraction(LONG + 1, LONG), Fraction(1, 2)),
        lambda rows: rows.decay(Fraction(2), Fraction(LONG, 2 * LONG + 1)),
        lambda rows: rows.above_floor(Fraction(LONG + 1, LONG), Fraction(1)),
        lambda rows: rows.above_floor(Fraction(1), Fraction(LONG)),
        lambda rows: rows.followers.need_outweighed([1] * MANY, Fraction(1), Fraction(1, LONG), Fraction(0), ""),
        lambda rows: rows.followers.need_outweighed([1] * MANY, Fraction(1), Fraction(LONG), Fraction(0), ""),
    ],
)
def test_long_numbers_of_many_followers_are_refused_before_rows_are_formed(verify: Callable[[Rows], None]):
    mode = WeightsBetween([(0, v, 1, 1, 2) for v in range(1, MANY + 1)], 1)
    followers = Followers([*map(str, range(MANY + 1))], range(1, MANY + 1), [mode], Numbers([1] * MANY, 1))
    rows = Rows(followers, Numbers([1] * MANY, 1))
    tracemalloc.start()
    with pytest.raises(WorkError, match="rows of followers are too long"):
        verify(rows)
    assert tracemalloc.get_traced_memory()[1] < 4_000_000  # one row of so long numbers for each: 50 MB
    tracemalloc.stop()
