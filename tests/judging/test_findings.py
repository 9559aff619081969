"""What the findings on a method are called in words."""

import pytest

from symtop.judging.findings import Finding, Measured, description, pace


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(5.4321e-6, "5.43 us"), (999.4e-6, "999 us"), (999.7e-6, "1 ms"), (2e-9, "2 ns"), (0.0, "0 ns")],
)
def test_a_time_has_the_unit_that_suits_what_is_printed(seconds, words):
    assert pace(seconds) == words


@pytest.mark.parametrize(("text", "words"), [("2 or more", "order 2 or more"), ("2: the h^3 term is off", "order 2")])
def test_an_order_that_is_a_least_one_is_said_to_be_one(text, words):
    assert description([Finding("order", "", Measured("by a term", 2.0, text=text), "measured", "")]) == words
