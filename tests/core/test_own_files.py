"""A file that symtop wrote is read at once, and is what xarray reads variable by variable."""

import numpy as np
import pytest
import xarray as xr

from symtop.core import netcdf
from symtop.core.errors import SymtopError


def of_every_kind() -> xr.Dataset:
    """Values of each type that a measure may return, with what xarray stores in another form."""
    line = np.arange(3.0)
    return xr.Dataset(
        {
            "error": ("setting", np.array([1e-3, np.nan, 0.0]), {"units": "s"}),
            "small": ("setting", line.astype(np.float32)),
            "ended": ("setting", np.array([True, False, True])),
            "map": (("row", "setting"), np.full((2, 3), 255, np.uint8)),
            "count": 7,
            "outcome": ("setting", ["ok", "", "not_finite"]),
            "names": ("setting", np.array(["a", "bé", ""], object)),
            "control": "step_size",
            "nothing": ("none", np.array([], str)),
            "day": ("row", np.array(["2020-01-01", "2021-01-01"], "datetime64[ns]")),
            "pause": ("row", np.array([1, 2], "timedelta64[s]")),
        },
        coords={"setting": 0.1 * line, "label": ("setting", ["p", "q", "r"]), "width": 0.5},
        attrs={"title": "all", "numbers": [1, 2], "settings": '{"a": 1}'},
    )


def test_a_file_of_ours_is_read_as_xarray_reads_it(tmp_path):
    path = netcdf.write(of_every_kind(), tmp_path / "data.nc")
    one, other = netcdf.read(path), netcdf.read_own(path)
    assert one.identical(other)
    assert {name: values.dtype for name, values in one.variables.items()} == {
        name: values.dtype for name, values in other.variables.items()
    }
    assert [*one.data_vars] == [*other.data_vars]
    assert [*one.coords] == [*other.coords]
    assert [*one.sizes.items()] == [*other.sizes.items()]
    assert netcdf.content_hash(one) == netcdf.content_hash(other)
    assert other["ended"].dtype == bool  # the control: types that netCDF has not


def test_what_is_no_such_file_is_refused_in_a_sentence(tmp_path):
    path = netcdf.write(of_every_kind(), tmp_path / "data.nc")
    path.write_bytes(path.read_bytes()[:2000])
    for file in (path, tmp_path / "missing.nc"):
        with pytest.raises(SymtopError, match=f"cannot read .*{file.name}"):
            netcdf.read_own(file)
