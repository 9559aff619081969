"""The columns of stored datasets say what they are: of each study, of error tables, and of a study of one's own."""

import numpy as np
import pytest
import xarray as xr
from symtop_studies.stability.many_verdicts import VERDICTS

from symtop.core import netcdf
from symtop.core.errors import SymtopError
from symtop.measure import columns
from symtop.measure.errors import ERRORS, OF_BODY, QUANTITIES
from symtop.runner.scripts import file_beside, names
from tests.commands import ROOT
from tests.core.test_conventions import lacking

PEERS = netcdf.read_columns(ROOT / "benchmarks" / "peers" / "columns.tsv")
OWN = {name: netcdf.read_columns(file_beside(name, "columns.tsv")) for name in names()}
CHECKS = "checks"  # a group of the study of cost, of a second round that a quick pass may not have


def table_of(**attributes: dict[str, str]) -> xr.Dataset:
    """A small error table with other columns beside."""
    values = dict.fromkeys(("axis", "axis_end", "axis_bound", "energy", "outcome", "gap"), ("setting", np.zeros(2)))
    data = xr.Dataset(values, {"scene": "spheroid"})
    for name, attrs in attributes.items():
        data[name].attrs = attrs
    return data


def test_a_study_of_ones_own_keeps_its_names_or_declares_them_beside_it(tmp_path):
    attrs = {"long_name": "a gap", "units": "m"}
    data = netcdf.describe(columns.described(table_of(gap=attrs, energy=attrs)), "Mine")
    assert data["gap"].attrs == data["energy"].attrs == attrs
    file = tmp_path / "columns.tsv"
    file.write_text("variable\tunits\twithout_units\tflags\tlong_name\naxis\tm\t\t\tlength of the axle\n")
    data = columns.described(table_of(axis=attrs), "SI", netcdf.read_columns(file))
    assert data["axis"].attrs == {"long_name": "length of the axle", "units": "m"}
    assert netcdf.read_columns(None) == {}


@pytest.mark.parametrize("line", [
    "gap\tm", "gap\t\t\t\t", "gap\tm\t\tyes\ta gap", "gap\tm\t\t\ta gap\ngap\tm\t\t\tagain", ""])  # fmt: skip
def test_a_line_that_declares_no_column_is_refused(tmp_path, line):
    file = tmp_path / "columns.tsv"
    file.write_text(f"variable\tunits\twithout_units\tflags\tlong_name\n{line}\n")
    with pytest.raises(SymtopError, match=f"line {len(line.splitlines() or [line]) + 1} must be .* not '"):
        netcdf.read_columns(file)


def test_an_error_table_says_of_what_and_against_what_and_flags_have_meanings():
    assert ERRORS.keys() == (QUANTITIES | OF_BODY).keys()
    data = columns.described(table_of(), "SI", of_body=[True, False])
    words = "largest angle between the axis and the true axis over the run"
    assert (data["axis"].attrs, data["energy"].attrs["units"]) == ({"long_name": words, "units": "rad"}, "1")
    assert "relative to the energy of the nutation or of bodies the kinetic energy" in data["energy"].attrs["long_name"]
    assert data["gap"].attrs == {}
    run = columns.described(table_of().drop_vars("axis_bound"), "SI")
    assert (run["energy"].attrs["long_name"], run["energy"].attrs["units"]) == ("total energy", "kg m2 s-2")
    outcomes = xr.Dataset({"outcome": ("setting", np.array([0, 254], np.uint8)), "broken": ("setting", [0.0, 1.0])})
    data = columns.described(outcomes, own=OWN["stability"])
    for name in ("outcome", "broken"):
        values, meanings = data[name].attrs["flag_values"], data[name].attrs["flag_meanings"].split()
        assert values.dtype == data[name].dtype
        assert len(set(meanings)) == len(set(values.tolist())) == len(meanings)
    assert tuple(meanings) == ("no", "yes")
    assert data["outcome"].attrs["flag_meanings"].split()[: len(VERDICTS)] == list(VERDICTS)


@pytest.mark.parametrize("units", ["SI", ""])
def test_units_of_a_problem_without_any(units):
    data = columns.described(xr.Dataset({"history_time": 0.1, "seconds": 1.0}), units, OWN["convergence"])
    assert (data["seconds"].attrs["units"], data["history_time"].attrs["units"]) == ("s", "s" if units else "1")
    assert data["history_time"].attrs["long_name"].endswith("in units of the scene") is not bool(units)


def assert_declared(data: xr.Dataset | xr.DataTree, entries: dict[str, netcdf.Column]) -> None:
    """Every variable has its name and units, none of which comes from elsewhere, and no line is left over."""
    groups = netcdf.groups(data).items()
    bare = xr.DataTree.from_dict({path or "/": group.drop_attrs() for path, group in groups})
    assert (lacking(data), len(lacking(bare)) > 4) == ([], True)
    absent = {name for name in entries if name.partition("/")[0] == CHECKS and CHECKS not in dict(groups)}
    names = {name for path, group in groups for key in group.variables for name in (key, f"{path}/{key}")}
    assert entries.keys() - absent <= names
    for path, group in groups:
        for name, variable in group.variables.items():
            errors = columns.ERROR_TABLE if "axis_bound" in group else {}
            column = entries.get(f"{path}/{name}", entries.get(name))
            entry = column.entry if column else errors.get(name, netcdf.VARIABLES.get(name, ("",)))
            assert variable.attrs["long_name"].startswith(entry[0]), name
            assert ("flag_values" in variable.attrs) is bool(column and column.flags), name


@pytest.mark.parametrize("study", OWN)
def test_every_variable_of_a_stored_dataset_has_a_name_and_units(quick_results, study):
    assert_declared(netcdf.read_any(quick_results / f"{study}.nc"), OWN[study])


def test_all_files_are_read(quick_results):
    assert {file.stem for file in quick_results.glob("*.nc")} == OWN.keys()
    assert_declared(netcdf.read_any(ROOT / "results" / "peers.nc"), PEERS)
