"""The written grammar of exact numbers: what it reads, what it refuses, and that writing inverts reading."""

from __future__ import annotations

import math
from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lmi.exact.numbers import MAX_CHARACTERS, MAX_EXPONENT
from ptcc_certify.errors import NumberError, PTCCError
from ptcc_certify.graphs.rationals import (
    as_fraction,
    format_exact,
    nearest_float,
    parse_exact,
    shorten,
)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("0", Fraction(0)),
        ("-12", Fraction(-12)),
        ("+7", Fraction(7)),
        ("007", Fraction(7)),
        ("3/4", Fraction(3, 4)),
        ("-6/4", Fraction(-3, 2)),
        ("0/5", Fraction(0)),
        ("0.1", Fraction(1, 10)),
        (".5", Fraction(1, 2)),
        ("5.", Fraction(5)),
        ("-.25e1", Fraction(-5, 2)),
        ("2.5e-3", Fraction(1, 400)),
        ("1E+2", Fraction(100)),
        ("1e400", Fraction(10**400)),
        ("1e-400", Fraction(1, 10**400)),
        ("0e0", Fraction(0)),
        ("1e00002", Fraction(100)),
        ("0x1p0", Fraction(1)),
        ("0x1.8p-1", Fraction(3, 4)),
        ("-0XAp2", Fraction(-40)),
        ("0x.8p0", None),
        ("  4 \t", Fraction(4)),
        ("\u00a04\n", Fraction(4)),
    ],
)
def test_a_text_is_the_number_it_says(text, value):
    if value is None:
        with pytest.raises(NumberError):
            parse_exact(text)
    else:
        assert parse_exact(text) == value


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "not a number"),
        (" ", "not a number"),
        (".", "not a number"),
        ("-", "not a number"),
        ("e5", "not a number"),
        ("1e", "not a number"),
        ("--1", "not a number"),
        ("1 2", "not a number"),
        ("1,5", "not a number"),
        ("1_000", "not a number"),
        ("1/-2", "not a number"),
        ("1/2/3", "not a number"),
        ("1.5/2", "not a number"),
        ("1/ 2", "not a number"),
        ("0x10", "not a number"),
        ("0x1.8", "not a number"),
        ("1j", "not a number"),
        ("True", "not a number"),
        ("٣", "not a number"),
        ("½", "not a number"),
        ("1\0", "not a number"),
        ("__import__('os')", "not a number"),
        ("nan", "not a finite number"),
        ("-NaN", "not a finite number"),
        ("inf", "not a finite number"),
        ("+Infinity", "not a finite number"),
        ("1/0", "divides by zero"),
        ("0/00", "divides by zero"),
        ("1e401", "exponent"),
        ("1e-401", "exponent"),
        ("1e10000000", "exponent"),
        ("1e0000002", "exponent"),
        ("1e" + "9" * 3000, "exponent"),
        ("0x1p1401", "exponent"),
        ("0x1p-99999999", "exponent"),
        ("1" * (MAX_CHARACTERS + 1), "too long"),
        ("0." + "1" * MAX_CHARACTERS, "too long"),
    ],
)
def test_what_is_no_exact_number_is_refused_with_one_line(text, reason):
    with pytest.raises(NumberError, match=reason) as caught:
        parse_exact(text)
    message = str(caught.value)
    assert message.isprintable() and len(message) < 200
    assert isinstance(caught.value, ValueError) and isinstance(caught.value, PTCCError)


@pytest.mark.parametrize("text", ["1e10000000", "1e-10000000", "9" * 10**6, "0x1p999999999", "1/" + "9" * 10**6])
def test_a_text_beyond_the_caps_is_refused_before_it_is_converted(text):
    with pytest.raises(NumberError, match=r"beyond|too long"):
        parse_exact(text)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("9" * 3999, 10**3999 - 1),
        ("9" * 1999 + "/" + "7" * 1999, Fraction(9, 7)),
        ("0." + "3" * 3990 + "e-400", Fraction(10**3990 - 1, 3 * 10**4390)),
        ("0x" + "f" * 3900 + "p1400", (16**3900 - 1) * 2**1400),
    ],
    ids=["integer", "quotient", "decimal", "hexadecimal"],
)
def test_the_longest_texts_are_read_exactly(text, value):
    assert parse_exact(text) == value


@given(st.fractions())
def test_writing_inverts_reading(value):
    assert parse_exact(format_exact(value)) == value


@given(st.integers(-(10**18), 10**18), st.integers(-MAX_EXPONENT, MAX_EXPONENT))
def test_a_decimal_is_exact(digits, exponent):
    assert parse_exact(f"{digits}e{exponent}") == Fraction(digits) * Fraction(10) ** exponent


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_a_hexadecimal_float_is_the_float_and_a_shortest_decimal_rounds_to_it(value):
    assert parse_exact(value.hex()) == Fraction(value) == as_fraction(value)
    assert float(parse_exact(repr(value))) == value
    assert nearest_float(Fraction(value)) == value


@given(st.text(max_size=30))
def test_any_text_is_a_number_or_refused(text):
    try:
        value = parse_exact(text)
    except NumberError as error:
        assert str(error).isprintable()
    else:
        assert parse_exact(format_exact(value)) == value


@given(st.text(st.sampled_from("+-0123456789./eExXpPaf"), max_size=12))
def test_what_is_read_agrees_with_python_where_python_reads_it(text):
    try:
        value = parse_exact(text)
    except NumberError:
        return
    if "x" in text.lower():
        assert value == Fraction(float.fromhex(text))
    else:
        assert value == Fraction(text.replace("+.", "+0.").replace("-.", "-0."))


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        ("0.1", Fraction(1, 10)),
        (0.1, Fraction(0.1)),
        (3, Fraction(3)),
        (Fraction(1, 3), Fraction(1, 3)),
        (np.int8(-5), Fraction(-5)),
        (np.uint64(2**64 - 1), Fraction(2**64 - 1)),
        (np.float32(0.1), Fraction(float(np.float32(0.1)))),
        (Decimal("0.1"), Fraction(1, 10)),
        (Decimal("-1.5E+3"), Fraction(-1500)),
    ],
)
def test_values_are_taken_as_what_they_are(value, expected):
    result = as_fraction(value)
    assert type(result) is Fraction and result == expected
    assert type(result.numerator) is int


@pytest.mark.parametrize(
    "value",
    [
        math.nan,
        -math.inf,
        np.float64("inf"),
        True,
        np.True_,
        None,
        1j,
        [1],
        b"1",
        Decimal("NaN"),
        Decimal("Infinity"),
        Decimal("1e-9999999"),
        object(),
    ],
)
def test_what_is_no_finite_real_number_is_refused(value):
    with pytest.raises(NumberError) as caught:
        as_fraction(value, "weight")
    assert str(caught.value).isprintable()


def test_a_number_too_long_for_the_grammar_is_not_written():
    assert len(format_exact(Fraction(10**3900))) == 3901
    for value in (Fraction(10**5000), Fraction(1, 10**5000), Fraction(10**2500 + 1, 10**2500)):
        with pytest.raises(NumberError, match="too long"):
            format_exact(value)


@pytest.mark.parametrize("value", [Fraction(10**400), Fraction(10**400, 3)])
def test_a_rational_beyond_float64_rounds_to_infinity(value):
    assert nearest_float(value) == math.inf
    assert nearest_float(-value) == -math.inf
    assert nearest_float(1 / value) == 0


@given(st.text(max_size=80))
def test_a_shortened_text_fits_a_message(text):
    short = shorten(text)
    assert short.isprintable() and len(short) <= 43
    if text.isprintable() and len(text) <= 40:
        assert short == text
