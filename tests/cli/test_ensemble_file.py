"""The file of `symtop ensemble --output`: runs, tops, starts and errors."""

import numpy as np
from click.testing import CliRunner

import symtop
from symtop.cli.main import main
from symtop.core import netcdf

WORDS = ["ensemble", "strang", "--members", "7", "--seed", "2", "--per-nutation", "50", "--nutations", "2"]


def test_the_file_holds_the_tops_their_starts_and_the_errors(tmp_path):
    file, tops = tmp_path / "runs.nc", symtop.population(7, seed=2)
    for _ in range(2):  # the second call runs them again, into the same file
        assert CliRunner().invoke(main, [*WORDS, "--output", str(file)]).exit_code == 0
        data = netcdf.read(file)
        np.testing.assert_array_equal(data["I1"].values, tops["I1"].values)
        np.testing.assert_array_equal(data["start_theta_dot"].values, tops["theta_dot"].values)
        wrong = symtop.errors(data, tops)
        np.testing.assert_allclose(data["axis_error"].values, wrong["axis"].max("time").values, rtol=1e-6, atol=1e-14)
        assert data["axis_error"].attrs["long_name"].startswith("angle between axes")
    only = tmp_path / "theta.nc"
    assert CliRunner().invoke(main, [*WORDS, "--variables", "theta", "--output", str(only)]).exit_code == 0
    assert "axis_error" not in netcdf.read(only)
