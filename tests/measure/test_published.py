"""Published numbers: each of them is reproduced to its last printed digit."""

from symtop.measure.published import OTHER_BODY, START, TRAJECTORY, published_values


def test_every_published_value_is_reproduced():
    values = published_values()
    assert [(one.source, one.quantity) for one in values if not one.reproduced] == []
    printed = [one.tests for one in values if one.kind == "printed"]
    assert [printed.count(what) for what in (TRAJECTORY, START, OTHER_BODY)] == [3, 1, 3]
    assert len(values) - len(printed) == 6


def test_a_value_that_is_off_by_its_last_digit_is_not():
    for one in published_values():
        assert not one._replace(published=one.published + 1.01 * one.unit).reproduced
