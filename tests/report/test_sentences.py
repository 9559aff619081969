"""Lists in a sentence."""

import pytest

from symtop.report.sentences import abridged, counted, few, joined


@pytest.mark.parametrize(
    ("words", "said"), [([], "none"), (["a"], "a"), (["a", "b"], "a and b"), (["a", "b", "c"], "a, b and c")]
)
def test_a_list_is_joined_as_one_says_it(words, said):
    assert joined(words) == said


def test_a_long_list_is_cut_off_and_counted():
    assert abridged(list("abcd")) == "a, b, c and d"
    assert abridged(list("abcdef")) == "a, b, c, d and 2 more"
    assert abridged(list("abc"), 2) == "a, b and 1 more"


def test_few_things_are_named_and_many_are_counted():
    assert few(["a", "b"]) == "a, b"
    assert few(list("abcde")) == "5 variants"
    assert few(list("abc"), "scene", 2) == "3 scenes"
    assert counted(1, "top") == "1 top"
