"""The columns of stored datasets say what they are: of each study, of error tables, and of a study of one's own."""

import numpy as np
import pytest
import xarray as xr

from symtop.core import netcdf
from symtop.measure import columns
from symtop.measure.errors import ERRORS, QUANTITIES
from symtop.measure.verdicts import VERDICTS
from tests.core.test_conventions import lacking

UNITS = {"1", "rad", "rad s-1", "s", "s-1", "s-2", "kg m2 s-2", "kg m2 s-1"}
GROUPS = {key: table for key, table in columns.COLUMNS.items() if key != "sweep"}
STUDIES = sorted({key.partition("/")[0] for key in GROUPS} - {"peers"})  # those are measured by a benchmark
TABLES = columns.COLUMNS | {"any": columns.ANY, "errors": columns.ERROR_TABLE}


def table_of(**attributes: dict[str, str]) -> xr.Dataset:
    """A small error table with other columns beside."""
    values = dict.fromkeys(("axis", "axis_end", "axis_bound", "energy", "outcome", "gap"), ("setting", np.zeros(2)))
    data = xr.Dataset(values, {"scene": "spheroid"})
    for name, given in attributes.items():
        data[name].attrs = given
    return data


@pytest.mark.parametrize("key", TABLES)
def test_every_entry_is_a_name_with_units_that_are_known(key):
    for name, (long_name, *units) in TABLES[key].items():
        assert long_name.strip() == long_name, name
        assert len(long_name) > 5, name
        assert set(units) <= UNITS, name
        assert len(units) < 2 or units[1] in ("1", "rad"), name


def test_an_error_table_says_of_what_and_against_what():
    assert ERRORS.keys() == QUANTITIES.keys()
    data = columns.described(table_of(), "mine", "SI")
    assert data["axis"].attrs == {
        "long_name": "largest angle between the axis and the true axis over the run",
        "units": "rad",
    }
    assert data["energy"].attrs["units"] == "1"
    assert "relative to E0 - min V" in data["energy"].attrs["long_name"]
    assert data["gap"].attrs == {}
    run = columns.described(table_of().drop_vars("axis_bound"), "mine", "SI")
    assert (run["energy"].attrs["long_name"], run["energy"].attrs["units"]) == ("total energy", "kg m2 s-2")


def test_a_study_of_ones_own_keeps_its_names():
    own = {"long_name": "a gap", "units": "m"}
    data = netcdf.describe(columns.described(table_of(gap=own, energy=own), "mine"), "Mine")
    assert data["gap"].attrs == data["energy"].attrs == own
    assert columns.described(table_of(axis=own), "truth")["axis"].attrs != own, "a study of the catalogue has a table"


def test_flags_are_numbers_with_meanings():
    outcomes = xr.Dataset({"outcome": ("setting", np.array([0, 254], np.uint8)), "broken": ("setting", [0.0, 1.0])})
    data = columns.described(outcomes, "stability")
    for name in ("outcome", "broken"):
        values, meanings = data[name].attrs["flag_values"], data[name].attrs["flag_meanings"].split()
        assert values.dtype == data[name].dtype
        assert len(set(meanings)) == len(set(values.tolist())) == len(meanings)
    assert tuple(meanings) == ("no", "yes")
    assert data["outcome"].attrs["flag_meanings"].split()[: len(VERDICTS)] == list(VERDICTS)
    for key in columns.FLAGS:
        scope, _, name = key.rpartition("/")
        assert name in columns.COLUMNS[scope]


@pytest.mark.parametrize("units", ["SI", ""])
def test_units_of_a_problem_without_any(units):
    data = columns.described(xr.Dataset({"extended_step": 0.1, "seconds": 1.0}), "convergence", units)
    assert data["seconds"].attrs["units"] == "s"
    assert data["extended_step"].attrs["units"] == ("s" if units else "1")
    assert data["extended_step"].attrs["long_name"].endswith("in units of the scene") is not bool(units)


@pytest.fixture(scope="module")
def stored(quick_results):
    return {study: netcdf.read_any(quick_results / f"{study}.nc") for study in STUDIES}


@pytest.mark.parametrize("study", STUDIES)
def test_every_variable_of_a_stored_dataset_has_a_name_and_units(stored, study):
    assert lacking(stored[study]) == []
    bare = stored[study].drop_attrs() if isinstance(stored[study], xr.Dataset) else xr.DataTree.from_dict(
        {name or "/": group.drop_attrs() for name, group in netcdf.groups(stored[study]).items()}
    )  # fmt: skip
    assert len(lacking(bare)) > 4


def test_all_studies_are_read_and_no_entry_is_of_a_column_that_is_gone(stored, quick_results):
    assert {file.stem for file in quick_results.glob("*.nc")} == set(STUDIES)
    for study, data in stored.items():
        groups = netcdf.groups(data)
        assert {key for key in GROUPS if key.partition("/")[0] == study} <= {
            f"{study}/{name}".strip("/") for name in groups
        }
        for name, group in groups.items():
            declared = GROUPS.get(f"{study}/{name}".strip("/"), {})
            assert declared.keys() <= set(group.variables), f"{study}/{name}"
