"""A dataset that is put together by hand is the one that xarray's public constructor makes, or is made by that."""

import numpy as np
import pytest
import xarray as xr

from symtop.core import netcdf, over_time as module
from symtop.core.over_time import over_time, publicly

TIMES = np.array([0.0, 0.25, 0.5, 1.0])


def columns(**changes):
    draw = np.random.default_rng(1)
    given = {"theta": draw.normal(size=4), "axis": draw.normal(size=(4, 3)), "energy": draw.normal(size=(4, 2))[:, 1]}
    return given | changes


@pytest.fixture
def fresh():
    """The comparison with xarray is made anew, before and after."""
    module.fits.cache_clear()
    yield
    module.fits.cache_clear()


CASES = [{}, {"quaternion": np.ones((4, 4))}, {"theta": np.array([1.0, np.nan, np.inf, -0.0])}, {"axis": TIMES}]


def test_this_xarray_holds_a_dataset_as_it_is_put_together():
    assert module.fits()


@pytest.mark.parametrize("changes", CASES)
def test_it_is_the_dataset_of_the_public_constructor(changes, tmp_path):
    quick, public = (make(TIMES, columns(**changes)) for make in (over_time, publicly))
    assert quick.identical(public)
    assert module._alike(quick, public)
    for now in (quick, public):
        netcdf.describe(now, "title", units="SI", number=1.0, words="two")
    xr.testing.assert_identical(quick, public)
    assert [dict(part.attrs) for part in quick.variables.values()] == [dict(p.attrs) for p in public.variables.values()]
    assert quick.sel(time=0.5).identical(public.sel(time=0.5))
    assert quick.interp(time=[0.1]).identical(public.interp(time=[0.1]))
    assert (quick + quick).identical(public + public)
    written = [netcdf.write(now, tmp_path / f"{k}.nc").read_bytes() for k, now in enumerate((quick, public))]
    assert written[0] == written[1]


def test_two_datasets_share_nothing_that_can_be_written_to():
    first, second = (over_time(TIMES, columns(quaternion=np.ones((4, 4)))) for _ in range(2))
    for name in ("time", "component", "part"):
        first[name].attrs["mark"] = 1
        first[name].encoding["mark"] = 1
        assert "mark" not in second[name].attrs
        assert "mark" not in second[name].encoding
    assert not np.shares_memory(first["time"].values, TIMES)


def test_a_difference_in_anything_is_seen():
    """The negative control of the comparison that decides."""
    public = publicly(TIMES, columns())
    other = [
        public.assign_attrs(title="t"), public.astype("float32"), public.drop_indexes("component"),
        public[["axis", "theta", "energy"]], public.assign_coords(component=["x", "y", "w"]),
        public.assign(theta=public["theta"].assign_attrs(units="rad")), public.rename(component="part"),
    ]  # fmt: skip
    assert module._alike(public, publicly(TIMES, columns()))
    assert not any(module._alike(changed, public) for changed in other)


@pytest.mark.parametrize("breakage", ["raises", "differs"])
def test_an_xarray_that_holds_them_otherwise_is_asked_publicly(breakage, monkeypatch, fresh):
    def changed(times, given):
        if breakage == "raises":
            raise AttributeError("_construct_direct")
        return publicly(times, given).drop_indexes("component")

    monkeypatch.setattr(module, "_put_together", changed)
    assert not module.fits()
    assert over_time(TIMES, columns()).identical(publicly(TIMES, columns()))


def test_columns_that_do_not_fit_are_refused_as_xarray_refuses_them():
    with pytest.raises(ValueError, match="conflicting sizes"):
        over_time(TIMES, columns(theta=np.zeros(3)))
    listed = columns(theta=[1.0, 2.0, 3.0, 4.0], energy=np.arange(4))
    assert over_time(TIMES, listed).identical(publicly(TIMES, listed))
