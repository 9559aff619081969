"""Files of netCDF groups: read whole, whatever else has been done with the file in the same process."""

import textwrap

import numpy as np
import pytest
import xarray as xr

from symtop.core import netcdf
from symtop.core.errors import SymtopError
from tests.commands import printed_by


@pytest.fixture
def stored(tmp_path):
    names = ["rk4", "strang", "gauss-4", "taylor"]  # text is what makes the other way of reading crash
    part = xr.Dataset({"error": (("variant", "step"), np.ones((4, 200)))}, {"variant": names})
    parts = dict.fromkeys(("long", "short"), part)
    tree = xr.DataTree.from_dict({"/": xr.Dataset(attrs={"title": "two kinds"}), **parts})
    return tree, netcdf.write(tree, tmp_path / "tree.nc")


def test_a_tree_comes_back_with_every_group_and_attribute(stored):
    tree, path = stored
    assert netcdf.read_any(path).identical(tree)


def test_a_file_without_groups_is_a_dataset(tmp_path):
    flat = xr.Dataset({"error": ("step", np.arange(4.0))}, attrs={"title": "one kind"})
    assert netcdf.read_any(netcdf.write(flat, tmp_path / "flat.nc")).identical(flat)


@pytest.mark.parametrize("content", [None, b"", b"no netCDF at all"])
def test_what_is_no_netcdf_is_refused_in_a_sentence(tmp_path, content):
    path = tmp_path / "broken.nc"
    if content is not None:
        path.write_bytes(content)
    for read in (netcdf.read, netcdf.read_any):
        with pytest.raises(SymtopError, match=r"cannot read .*broken\.nc as netCDF"):
            read(path)


def test_a_tree_can_be_read_beside_lazy_ones(stored):
    """`with xr.open_datatree` in the place of `read_any` ends this process with a segmentation fault."""
    script = """
        import sys
        import xarray
        from symtop.core import netcdf
        held = []
        for k in range(12):
            tree = xarray.open_datatree(sys.argv[1])
            tree["short"]["error"].values
            if k % 2:
                held.append(tree)
            assert netcdf.read_any(sys.argv[1])["long"]["error"].sum() == 800.0
    """
    printed_by(textwrap.dedent(script), stored[1])
