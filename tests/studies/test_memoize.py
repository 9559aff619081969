"""Answers that are computed once for each dataset."""

import xarray as xr
from symtop_studies.memoize import of_one_dataset

from symtop.core.code_hash import Code, digest


def test_an_answer_is_computed_once_for_each_object_and_question():
    asked = []

    @of_one_dataset
    def total(data, name, *, times=1):
        asked.append((name, times))
        return times * float(data[name].sum())

    first, twin = (xr.Dataset({"a": ("x", [1.0, 2.0]), "b": ("x", [3.0, 4.0])}) for _ in range(2))
    assert [total(first, "a"), total(first, "a"), total(first, "a", times=2), total(first, "b")] == [3.0, 3.0, 6.0, 7.0]
    assert asked == [("a", 1), ("a", 2), ("b", 1)]
    assert total(twin, "a") == 3.0  # equal, but another object
    assert total(first, "a") == 3.0
    assert len(asked) == 5


def test_what_is_remembered_is_no_part_of_a_fingerprint():
    seen = {}

    @of_one_dataset
    def size(data):
        return seen.setdefault("size", len(data))

    def made_of():
        return digest(Code().reasons("measure", size))

    before = made_of()
    seen["other"] = 1  # the control: this a function closes over
    assert made_of() != before
    del seen["other"]
    assert size({"a": 1}) == 1
    del seen["size"]
    assert made_of() == before
