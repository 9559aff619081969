"""`symtop ensemble`: what it writes, draws and prints, and what it refuses."""

import functools
import json
from unittest.mock import Mock

import numpy as np
import pytest
import xarray as xr
from PIL import Image

import symtop
from symtop.core import netcdf, progress
from tests import commands

STEPS = ("--per-nutation", 30, "--nutations", 2)
call = functools.partial(commands.call, "ensemble")


def test_the_file_and_the_figure_are_those_of_the_ensemble(tmp_path, monkeypatch):
    path, figure = tmp_path / "runs.nc", tmp_path / "spread.png"
    words = ("--members", 50, "--seed", 3, "strang", *STEPS, "--samples", 21, "-o", path)
    call(*words)
    content = path.read_bytes()
    with monkeypatch.context() as patch:
        patch.setattr(xr.Dataset, "to_netcdf", Mock(side_effect=KeyboardInterrupt))
        call(*words, code=130)
    assert path.read_bytes() == content  # nothing is added to what is in its place
    result = call(*words, "--figure", figure)  # runs them again, into the same file
    assert "strang[axis] on 50 tops: 50 reached the horizon" in result.output
    tops = symtop.population(50, seed=3)
    expected = symtop.ensemble(tops, "strang", per_nutation=30, nutations=2, samples=21, quiet=True)
    with xr.open_dataset(path) as data:
        assert data.load()[list(expected.data_vars)].identical(expected.assign_attrs(seed=3, kind="all"))
        np.testing.assert_array_equal(data["I1"].values, tops["I1"].values)
        np.testing.assert_array_equal(data["start_theta_dot"].values, tops["theta_dot"].values)
        largest = symtop.errors(expected, tops)["axis"].max("time")
        np.testing.assert_allclose(data["axis_error"], largest, rtol=1e-6, atol=1e-14)
        assert data["axis_error"].attrs["long_name"].startswith("angle between axes")
        assert data["axis_error"].attrs["units"] == "rad"
    with Image.open(figure) as picture:
        assert np.asarray(picture.convert("L")).std() > 10.0


def test_json_has_outcomes_and_errors_finer_steps_smaller_ones_and_failures_are_counted():
    words = ("--members", 40, "strang", "--nutations", 2, "--json", "--per-nutation")
    coarse, fine = (json.loads(call(*words, per).output) for per in (30, 300))
    assert (coarse["outcomes"], progress.kernels_to_compile) == ({"ok": 40}, [2])  # of so few steps
    assert fine["largest_errors"]["axis"]["0.5"] < 0.02 * coarse["largest_errors"]["axis"]["0.5"]
    assert fine["steps"] == 10 * coarse["steps"]
    assert call("--members", 60, "stormer-verlet", *STEPS, "--samples", 21).output.count("left_chart") == 1
    result = call("--members", 20, "--kind", "grazing", "stormer-verlet", *STEPS, "--json", code=3)
    assert json.loads(result.output)["largest_errors"]["axis"] == dict.fromkeys(("0.01", "0.1", "0.5", "0.9", "0.99"))


@pytest.mark.quick
def test_bodies_are_run_compared_and_written(tmp_path):
    """Without epsilon they are other bodies, and a finer step has smaller errors."""
    path = tmp_path / "runs.nc"
    kind = ("--bodies", "--kind", "heavy", "--epsilon", 0.1, "--members", 6, "--seed", 3)
    call(*kind, "strang", *STEPS, "--samples", 21, "-o", path)
    bodies = symtop.body_population(6, seed=3, kind="heavy", epsilon=0.1)
    expected = symtop.ensemble(bodies, "strang", per_nutation=30, nutations=2, samples=21, quiet=True)
    data, kernels = netcdf.read(path), progress.kernels_to_compile[0]
    assert data[list(expected.data_vars)].drop_attrs().identical(expected.drop_attrs())
    assert [kernels, *(data.attrs[name] for name in ("seed", "kind", "epsilon"))] == [5, 3, "heavy", 0.1]
    np.testing.assert_array_equal(data["I2"], bodies["I2"])
    np.testing.assert_array_equal(data["start_omega_body"], bodies["omega_body"])
    errors = symtop.errors(expected, bodies)
    np.testing.assert_array_equal(data["attitude_error"], errors["attitude"].max("time"))
    np.testing.assert_allclose(data["energy_error"], errors["energy"].max("time"), rtol=1e-6, atol=1e-15)
    finer = ("strang", "--per-nutation", 300, "--nutations", 2, "--samples", 21, "--json")
    fine, default = (json.loads(call(*words, *finer).output) for words in (kind, kind[:3] + kind[5:]))
    assert 0.005 < fine["largest_errors"]["attitude"]["0.5"] / float(errors["attitude"].max("time").median()) < 0.02
    assert fine["largest_errors"] != default["largest_errors"]


@pytest.mark.parametrize(("words", "message"), [
    (["strang"], "needs --step-size or --per-nutation"),
    (["strang", "--step-size", 0.1], "give --horizon or --nutations: these members have no"),
    (["strang", *STEPS, "--budget", 10], "member 0 asks for 60 steps; the limit is 10 (see --budget)"),
    (["strang", *STEPS, "--variables", "theta", "--figure", "a.png"], "needs axis or energy among --variables"),
    (["strang", *STEPS, "--bodies", "--kind", "grazing"], "kind 'grazing' is unknown"),
    (["strang", *STEPS, "--bodies", "--members", 2, "--variables", "axis", "--figure", "a.png"],
     "needs quaternion or energy among"),
    (["midpoint[attitude]", *STEPS], "known: angles"),
])  # fmt: skip
def test_bad_input_is_one_sentence_and_code_2(words, message):
    assert message in call(*words, code=2).output


def test_bodies_whose_motion_is_lost_in_chaos_are_counted_and_the_others_compared():
    words = ("rk4", "--bodies", "--kind", "chaotic", "--members", 3, "--per-nutation", 60, "--samples", 5)
    result = call(*words, "--nutations", 99)
    assert "the attitudes of 3 bodies are not compared: their motion is not known to 1e-9 rad" in result.output
    energy, attitude = (next(row for row in result.output.splitlines() if name in row) for name in ("energy", "angle"))
    assert "nan" in attitude
    assert "nan" not in energy
    assert "not compared" not in call(*words, "--nutations", 2).output


def test_a_few_variables_are_kept_and_compared_and_a_budget_is_one(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    words = ("--members", 5, "strang", *STEPS, "--variables", "theta,energy", "--budget", 60, "--output=~/few.nc")
    result = call(*words, "--figure", tmp_path / "few.png")
    assert "energy error" in result.output
    assert "angle between axes" not in result.output
    with xr.open_dataset(tmp_path / "few.nc") as data:
        assert [name for name in data if "time" in data[name].dims] == ["theta", "energy"]
    assert "largest error" not in call("--members", 5, "strang", *STEPS, "--variables", "theta").output


def test_members_that_raise_are_told_in_one_sentence(tmp_path, clean_registry):
    plugin = tmp_path / "raises_for_some.py"
    plugin.write_text(
        "import symtop\ndef solve(top, start, plan):\n    if start.theta > 1.5:\n        raise TypeError('too far')\n"
        "    return symtop.integrator('rk4[axis]').solvers['axis'](top, start, plan)\n"
        "symtop.register(symtop.Integrator(name='raises-for-some', family='other',summary='', solvers={'axis': solve}))"
    )
    result = call("--plugin", plugin, "--members", 20, "raises-for-some", *STEPS)
    assert "raised an exception, the first: integrator raises-for-some on member" in result.output
    assert "failed: TypeError: too far" in result.output
    assert "SymtopWarning" not in result.output
