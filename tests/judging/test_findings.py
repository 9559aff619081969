"""What the findings on a method are called in words."""

from symtop.judging.findings import Finding, Measured, description, pace


def test_a_time_has_the_unit_that_suits_what_is_printed_and_a_least_order_is_said_to_be_one():
    assert [pace(seconds) for seconds in (5.4321e-6, 999.4e-6, 999.7e-6, 0.0)] == ["5.43 us", "999 us", "1 ms", "0 ns"]
    for text, words in (("2 or more", "order 2 or more"), ("2: the h^3 term is off", "order 2")):
        assert description([Finding("order", "", Measured("by a term", 2.0, text=text), "measured", "")]) == words
