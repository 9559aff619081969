"""Every dataset that a user gets follows CF-1.11, and files of netCDF groups are read whole."""

import dataclasses
import re
import textwrap

import numpy as np
import pytest
import xarray as xr

import symtop
from symtop.core import netcdf
from tests.commands import printed_by


def lacking(data: xr.Dataset | xr.DataTree) -> list[str]:
    """What breaks the convention, in all groups."""
    faults = [f"global {name}" for name in ("Conventions", "title", "source", "history") if not data.attrs.get(name)]
    for group in netcdf.groups(data).values():
        for name, variable in group.variables.items():
            if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", str(name)):
                faults.append(f"name {name}")
            faults += [] if variable.attrs.get("long_name") else [f"long_name of {name}"]
            numbers = variable.dtype.kind in "fiu"
            faults += [] if bool(variable.attrs.get("units")) == numbers else [f"units of {name}"]
    return faults


@pytest.fixture(scope="module")
def run():
    return symtop.simulate("spheroid", "strang", step_size=0.01, horizon=2.0)


MADE = {
    "errors": symtop.errors,
    "reference": lambda _: symtop.reference("spheroid", np.linspace(0.0, 2.0, 11)),
    "reference of a body": lambda _: symtop.reference("check-case-2", [0.0, 1.0]),
    "reference beyond double": lambda _: symtop.reference("spheroid", [0.0, 1.0], "quad"),
    "bodies": lambda _: symtop.body_population(8, seed=1),
    "population": lambda _: symtop.population(8, seed=1),
    "ensemble": lambda _: symtop.ensemble(symtop.population(8, seed=1), "strang", per_nutation=50, nutations=1),
    "long_run": lambda _: symtop.long_run("spheroid", "strang", steps=20_000, step_size=0.001, quiet=True),
    "run": lambda run: run,
    "sweep": lambda _: symtop.sweep("spheroid", "strang", step_size=[0.1, 0.01], horizon=1.0, quiet=True),
}


@pytest.mark.parametrize("name", MADE)
def test_every_number_has_a_name_and_a_unit(name, run, tmp_path):
    data = MADE[name](run)
    assert (lacking(data), lacking(netcdf.read(netcdf.write(data, tmp_path / "data.nc")))) == ([], [])


def test_what_lacks_a_name_a_unit_or_a_title_is_found(run):
    assert lacking(run.assign(gap=("time", run["theta"].values))) == ["long_name of gap", "units of gap"]
    assert lacking(run.rename(theta="2theta")) == ["name 2theta"]
    assert lacking(run.drop_attrs(deep=False))[0] == "global Conventions"


def test_units_are_those_of_the_scene():
    scenes = {name: symtop.scene(name).units for name in symtop.scenes()}
    SI = {"time": "s", "energy": "kg m2 s-2", "p_phi": "kg m2 s-1", "theta": "rad"}
    plain = dict.fromkeys(SI, "1") | {"theta": "rad"}
    for name, body, units in (("SI", "check-case-2", SI), ("", "heavy-brick", plain)):
        scene = next(key for key, unit in scenes.items() if unit == name)
        run = symtop.simulate(scene, "strang", step_size=0.001, horizon=0.01)
        for data in (run, symtop.reference(scene, [0.0, 1.0]), symtop.reference(body, [0.0, 1.0])):
            assert {key: data[key].attrs["units"] for key in units} == units
        errors = symtop.errors({"time": run["time"], "theta": run["theta"]}, scene)
        assert errors["time"].attrs["units"] == units["time"]
    with pytest.raises(symtop.SymtopError, match="units 'imperial' is unknown; known: '', SI"):
        dataclasses.replace(symtop.scene("spheroid"), units="imperial")


@pytest.mark.parametrize("content", [None, b"", b"no netCDF at all"])
def test_what_is_no_netcdf_is_refused_in_a_sentence(tmp_path, content):
    path = tmp_path / "broken.nc"
    if content is not None:
        path.write_bytes(content)
    for read in (netcdf.read, netcdf.read_any):
        with pytest.raises(symtop.SymtopError, match=r"cannot read .*broken\.nc as netCDF"):
            read(path)


def test_a_file_without_groups_is_a_dataset_and_a_tree_comes_back_whole_also_beside_lazy_ones(tmp_path):
    names = ["rk4", "strang", "gauss-4", "taylor"]  # text is what makes the other way of reading crash
    part = xr.Dataset({"error": (("variant", "step"), np.ones((4, 200)))}, {"variant": names})
    tree = xr.DataTree.from_dict({"/": xr.Dataset(attrs={"title": "two kinds"}), "long": part, "short": part})
    flat, path = netcdf.write(part, tmp_path / "flat.nc"), netcdf.write(tree, tmp_path / "tree.nc")
    assert netcdf.read_any(flat).identical(part)
    assert netcdf.read_any(path).identical(tree)
    # `with xr.open_datatree` in the place of `read_any` ends this process with a segmentation fault.
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
    printed_by(textwrap.dedent(script), path)
