"""Every dataset that a user gets says what it holds: CF-1.11's names, units and global attributes.

The rules of the convention that a dataset of a run can break, as the IOOS compliance checker asks for them. One it asks
for is not kept, on purpose: ``time`` is elapsed time and no date, so that it has no ``standard_name`` "time".
"""

import dataclasses
import re

import numpy as np
import pytest
import xarray as xr

import symtop
from symtop.core import netcdf


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
    assert lacking(data) == []
    assert lacking(netcdf.read(netcdf.write(data, tmp_path / "data.nc"))) == []


def test_what_lacks_a_name_a_unit_or_a_title_is_found(run):
    assert lacking(run.assign(gap=("time", run["theta"].values))) == ["long_name of gap", "units of gap"]
    assert lacking(run.rename(theta="2theta")) == ["name 2theta"]
    assert lacking(run.drop_attrs(deep=False))[0] == "global Conventions"


def test_units_are_those_of_the_scene():
    scenes = {name: symtop.scene(name).units for name in symtop.scenes()}
    for name in ("SI", ""):
        scene = next(key for key, units in scenes.items() if units == name)
        body = "check-case-2" if name == "SI" else "heavy-brick"
        run = symtop.simulate(scene, "strang", step_size=0.001, horizon=0.01)
        for data in (run, symtop.reference(scene, [0.0, 1.0]), symtop.reference(body, [0.0, 1.0])):
            assert data["time"].attrs["units"] == ("s" if name == "SI" else "1")
            assert data["energy"].attrs["units"] == ("kg m2 s-2" if name == "SI" else "1")
            assert data["p_phi"].attrs["units"] == ("kg m2 s-1" if name == "SI" else "1")
            assert data["theta"].attrs["units"] == "rad"
        wrong = symtop.errors({"time": run["time"], "theta": run["theta"]}, scene)
        assert wrong["time"].attrs["units"] == ("s" if name == "SI" else "1")
    with pytest.raises(symtop.SymtopError, match="units"):
        dataclasses.replace(symtop.scene("spheroid"), units="imperial")
