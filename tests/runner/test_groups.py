"""Studies that measure different things: a dataset a group, on disk, in a check and in a run."""

import numpy as np
import pytest
import xarray as xr

from symtop.core import netcdf
from symtop.core.errors import SymtopError
from symtop.measure import datasets
from symtop.measure.datasets import differences
from symtop.runner import store
from symtop.runner.study import Case

LONG = xr.Dataset({"energy": ("window", [1.0, 2.0, 3.0]), "outcome": "ok", "steps": 3})
SHORT = xr.Dataset({"energy": ("window", [4.0]), "outcome": "ok", "steps": 1})
PHASE = xr.Dataset({"energy": ("sample", np.arange(4, dtype=np.uint8))})


def tree(phase: xr.Dataset = PHASE) -> xr.DataTree:
    return datasets.combine([
        (Case("spheroid", "midpoint", group="windows"), LONG),
        (Case("goldstein", "midpoint", group="windows"), SHORT),
        (Case("spheroid", "strang", group="phases"), phase),
    ])  # fmt: skip


def test_a_group_covers_its_own_scenes_and_integrators_and_names_may_meet():
    data = tree()
    assert isinstance(data, xr.DataTree)
    assert not data.to_dataset().variables
    assert dict(data["windows"].sizes) == {"scene": 2, "variant": 1, "window": 3}
    assert dict(data["phases"].sizes) == {"scene": 1, "variant": 1, "sample": 4}
    short = data["windows/energy"].sel(scene="goldstein", variant="midpoint").values
    np.testing.assert_array_equal(short, [4.0, np.nan, np.nan])


def test_a_tree_is_read_as_it_was_written(tmp_path):
    data = netcdf.describe(tree(), "Groups", question="Does it come back?")
    path = netcdf.write(data, tmp_path / "groups.nc")
    again = netcdf.read_any(path)
    assert differences(data, again) == []
    assert again["phases/energy"].dtype == np.uint8
    assert again.attrs["question"] == "Does it come back?"
    assert again["windows/energy"].attrs["long_name"] == "total energy"


def test_single_precision_stays_and_is_stored_in_little_space(tmp_path):
    """Ten bits of each number; the same in double precision, which is not compressed, for comparison."""
    size, power = np.frexp(np.random.default_rng(1).lognormal(size=(3, 40_000)))
    rounded = np.ldexp(np.rint(np.ldexp(size, 10)), power - 10)
    sizes = {}
    for kind in (np.float32, np.float64):
        cases = [(Case("spheroid", name), xr.Dataset({"cost": ("member", row.astype(kind)[: 40_000 - (k == 2)])}))
                 for k, (name, row) in enumerate(zip(("rk4", "strang", "midpoint"), rounded, strict=True))]  # fmt: skip
        data = datasets.combine(cases)
        path = netcdf.write(data, tmp_path / f"{kind.__name__}.nc")
        again = netcdf.read(path)["cost"].sel(scene="spheroid")
        assert again.dtype == kind
        np.testing.assert_array_equal(again.values[:2], rounded[:2])
        assert np.isnan(again.values[2, -1])  # what a shorter case does not fill
        sizes[kind] = path.stat().st_size
    assert sizes[np.float32] < 0.25 * sizes[np.float64]


def test_a_check_names_the_group_that_differs():
    assert differences(tree(), tree()) == []
    (difference,) = differences(tree(), tree(PHASE + np.uint8(1)))
    assert difference.startswith("phases: energy differs")
    partial = tree()
    del partial["phases"]
    assert differences(tree(), partial) == ["group phases is in one of them only"]
    assert differences(LONG, LONG) == []


def test_cases_that_would_replace_each_other_are_refused():
    """A study of three steps of each method, say, whose cases differ in their settings alone."""
    steps = [(Case("spheroid", "rk4", {"n": n}), LONG) for n in (6, 3)]
    with pytest.raises(SymtopError, match="two cases of rk4 on spheroid measure energy, and one would replace the"):
        datasets.combine(steps)
    other = LONG.rename(energy="seconds", outcome="told", steps="calls")
    both = datasets.combine([steps[0], (steps[1][0], other)])  # the control: a round that measures something else
    assert {"energy", "seconds"} <= set(both.data_vars)
    separate = datasets.combine([(Case("spheroid", "rk4", {"n": n}, group=f"n-{n}"), LONG) for n in (6, 3)])
    assert set(separate.children) == {"n-6", "n-3"}


def test_a_case_without_a_group_among_cases_with_one_is_refused():
    cases = [(Case("spheroid", "midpoint"), LONG), (Case("spheroid", "strang", group="windows"), LONG)]
    with pytest.raises(SymtopError, match="case spheroid--midpoint has no group"):
        datasets.combine(cases)


def test_cases_that_differ_in_their_group_alone_have_files_of_their_own(tmp_path):
    from symtop.runner.run import load

    study = load("drift")
    cases = [Case("spheroid", "strang", {"steps": 1}, group=group) for group in ("windows", "rounding")]
    paths = [store.case_path(tmp_path, study, case) for case in cases]
    assert len({store.identity_of(path) for path in paths}) == 2
    assert len({store.digest_of(path) for path in paths}) == 2
