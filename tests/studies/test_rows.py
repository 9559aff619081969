"""What a stored dataset and a caption must say: which chart, which step or tolerance, which scene.

``rk4`` beside ``strang`` differs in two factors, method and chart, and an error without its step cannot be compared.
"""

import numpy as np
import pytest
import xarray as xr
from symtop_studies.memoize import of_one_dataset

from symtop.core import netcdf
from symtop.core.code_hash import Code, digest
from symtop.measure.settings import smallest_charts
from symtop.methods.framework.registry import integrators, methods, split_name

STUDIES = (
    "cost", "truth", "convergence", "factors", "drift", "stability", "reduction", "claims", "notebook", "oscillators",
    "engines",
)  # fmt: skip


def without_a_chart(data: xr.Dataset) -> list[str]:
    """Names of the dimension ``integrator`` that leave open in which of several charts a method ran."""
    if "chart" in data.variables:
        return []
    charts = {name: method.charts() for name, method in integrators().items()}
    return [str(name) for name in data["variant"].values if len(charts.get(str(name), ())) > 1]


@pytest.mark.parametrize("study", STUDIES)
def test_every_stored_dataset_says_in_which_chart_a_method_ran(study, quick_results):
    tree = netcdf.groups(netcdf.read_any(quick_results / f"{study}.nc"))
    groups = [group for group in tree.values() if group.variables]
    assert groups
    assert [name for group in groups for name in without_a_chart(group)] == []


@pytest.mark.parametrize(("names", "expected"), [
    (["rk4", "midpoint"], ["rk4"]), (["rk4[axis]", "strang"], ["strang"]), (["rk4[axis]", "exact"], []),
])  # fmt: skip
def test_a_name_that_leaves_the_chart_open_is_found(names, expected):
    data = xr.Dataset({"axis": ("variant", np.zeros(len(names)))}, coords={"variant": names})
    assert (without_a_chart(data), without_a_chart(data.assign_coords(chart=["angles"]))) == (expected, [])


def test_the_rows_of_a_grid_are_every_method_and_no_chart_that_repeats_another():
    rows = [row.name for row in smallest_charts("nutation")]
    assert {split_name(name)[0] for name in rows} == set(methods())
    assert {"rk4[angles]", "rk4[axis]", "strang[axis]", "exact[attitude]"} <= set(rows)
    assert "strang[attitude]" not in rows


def test_an_answer_is_computed_once_for_each_object_and_question():
    calls = []

    @of_one_dataset
    def total(data, name, *, times=1):
        calls.append((name, times))
        return times * float(data[name].sum())

    first, twin = (xr.Dataset({"a": ("x", [1.0, 2.0]), "b": ("x", [3.0, 4.0])}) for _ in range(2))
    assert [total(first, "a"), total(first, "a"), total(first, "a", times=2), total(first, "b")] == [3.0, 3.0, 6.0, 7.0]
    assert calls == [("a", 1), ("a", 2), ("b", 1)]
    assert total(twin, "a") == 3.0  # equal, but another object
    assert (total(first, "a"), len(calls)) == (3.0, 5)


def test_what_is_remembered_is_no_part_of_a_fingerprint():
    store = {}

    @of_one_dataset
    def size(data):
        return store.setdefault("size", len(data))

    def made_of():
        return digest(Code().reasons("measure", size))

    before = made_of()
    store["other"] = 1  # the control: this a function closes over
    assert made_of() != before
    del store["other"]
    assert size({"a": 1}) == 1
    del store["size"]
    assert made_of() == before
