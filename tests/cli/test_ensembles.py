"""`symtop ensemble`: what it writes, draws and prints, and what it refuses."""

import functools
import importlib
import json

import numpy as np
import pytest
import xarray as xr
from PIL import Image

import symtop
from symtop.core import netcdf
from tests import commands

STEPS = ("--per-nutation", 30, "--nutations", 2)


call = functools.partial(commands.call, "ensemble")


def test_the_file_and_the_figure_are_those_of_the_ensemble(tmp_path):
    path, figure = tmp_path / "runs.nc", tmp_path / "spread.png"
    done = call("--members", 50, "--seed", 3, "strang", *STEPS, "--samples", 21, "-o", path, "--figure", figure)
    assert "strang on 50 tops: 50 reached the horizon" in done.output
    assert "in vector registers (lanes)" in done.output
    assert f"written to {figure}" in done.output
    wanted = symtop.ensemble(
        symtop.population(50, seed=3), "strang", per_nutation=30, nutations=2, samples=21, quiet=True
    )
    with xr.open_dataset(path) as data:
        assert data.load()[list(wanted.data_vars)].identical(wanted)
        assert {"I1", "start_theta", "axis_error"} < set(data.data_vars) - set(wanted.data_vars)
    with Image.open(figure) as picture:
        assert np.asarray(picture.convert("L")).std() > 10.0


def test_a_file_of_runs_holds_the_tops_their_starts_and_the_errors(tmp_path):
    words = ("strang", "--members", 7, "--seed", 2, "--per-nutation", 50, "--nutations", 2, "--output")
    file, tops = tmp_path / "runs.nc", symtop.population(7, seed=2)
    for _ in range(2):  # the second call runs them again, into the same file
        call(*words, file)
        data = netcdf.read(file)
        np.testing.assert_array_equal(data["I1"].values, tops["I1"].values)
        np.testing.assert_array_equal(data["start_theta_dot"].values, tops["theta_dot"].values)
        wrong = symtop.errors(data, tops)
        np.testing.assert_allclose(data["axis_error"].values, wrong["axis"].max("time").values, rtol=1e-6, atol=1e-14)
        assert data["axis_error"].attrs["long_name"].startswith("angle between axes")
    call(*words, tmp_path / "theta.nc", "--variables", "theta")
    assert "axis_error" not in netcdf.read(tmp_path / "theta.nc")


def test_json_has_outcomes_and_errors_and_a_finer_step_has_smaller_ones():
    coarse, fine = (
        json.loads(call("--members", 40, "strang", "--per-nutation", per, "--nutations", 2, "--json").output)
        for per in (30, 300)
    )
    assert coarse["outcomes"] == {"ok": 40}
    assert fine["largest_errors"]["axis"]["0.5"] < 0.02 * coarse["largest_errors"]["axis"]["0.5"]
    assert fine["steps"] == 10 * coarse["steps"]


def test_members_that_fail_are_counted_and_drawn(tmp_path):
    done = call("--members", 60, "stormer-verlet", *STEPS, "--samples", 21, "--figure", tmp_path / "f.png")
    assert "left_chart" in done.output
    assert (tmp_path / "f.png").stat().st_size > 5000
    done = call("--members", 20, "--kind", "grazing", "stormer-verlet", *STEPS, "--json", code=3)
    assert json.loads(done.output)["largest_errors"]["axis"] == dict.fromkeys(("0.01", "0.1", "0.5", "0.9", "0.99"))


@pytest.mark.parametrize(
    "words", [("--members", 60, "--per-nutation", 2), ("--members", 1, "--per-nutation", 20)], ids=["coarse", "alone"]
)
def test_runs_of_few_steps_are_drawn(tmp_path, words):
    done = call("strang", *words, "--nutations", 2, "--figure", tmp_path / "f.png")
    assert "Warning" not in done.output
    assert (tmp_path / "f.png").stat().st_size > 5000


@pytest.mark.parametrize(
    ("words", "says"),
    [(["strang", *STEPS, "--members", 0], "--members must be a whole number"),
     (["strang"], "needs --step-size or --per-nutation"),
     (["strong", *STEPS], "did you mean strang"), (["strang", *STEPS, "--kind", "quick"], "kind"),
     (["strang", *STEPS, "--seed", -1], "seed"),
     (["strang", "--step-size", 0.1, *STEPS], "not both"), (["strang", *STEPS, "-o", "/proc/no/x.nc"], "in a folder"),
     (["strang", "--step-size", 0.1], "give --horizon or --nutations: these members have no"),
     (["strang", *STEPS, "--threads", 0], "threads"),
     (["strang", "--per-nutation", 0.2, "--nutations", 2], "--per-nutation must be at least 0.5"),
     (["exact", *STEPS], "exact has nothing to tune: leave out --per-nutation = 30"),
     (["exact", "--horizon", 1, "--tolerance", 0.1], "leave out --tolerance = 0.1"),
     (["exact", "--horizon", 1e300], "--horizon must be at most 1e+100"),
     (["strang", *STEPS, "--budget", 10], "member 0 asks for 60 steps; the limit is 10 (see --budget)"),
     (["strang", *STEPS, "--variables", "theta,spin"], "not 'spin'"),
     (["strang", *STEPS, "--variables", "theta", "--figure", "a.png"], "needs axis or energy among --variables"),
     (["midpoint[attitude]", *STEPS], "known: angles"), (["taylor", *STEPS, "--members", 3], "chooses its own steps")],
)  # fmt: skip
def test_bad_input_is_one_sentence_and_code_2(words, says):
    done = call(*words, code=2)
    assert says in done.output
    assert "Traceback" not in done.output


def test_a_few_variables_are_kept_and_compared_and_a_budget_is_one(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    words = ("--members", 5, "strang", *STEPS, "--variables", "theta,energy", "--budget", 60, "--output=~/few.nc")
    done = call(*words, "--figure", tmp_path / "few.png")
    assert "energy error" in done.output
    assert "angle between axes" not in done.output
    with xr.open_dataset(tmp_path / "few.nc") as data:
        assert [name for name in data if "time" in data[name].dims] == ["theta", "energy"]
    done = call("--members", 5, "strang", *STEPS, "--variables", "theta")
    assert "largest error" not in done.output


def test_members_that_raise_are_told_in_one_sentence(tmp_path, monkeypatch):
    registry = importlib.import_module("symtop.methods.framework.registry")
    monkeypatch.setattr(registry, "_registry", registry.integrators())
    plugin = tmp_path / "raises_for_some.py"
    plugin.write_text(
        "import symtop\n"
        "def solve(top, start, plan):\n"
        "    if start.theta > 1.5:\n        raise TypeError('too far')\n"
        "    return symtop.integrator('rk4[axis]').solvers['axis'](top, start, plan)\n"
        "symtop.register(symtop.Integrator(\n"
        "    name='raises-for-some', family='other', summary='', solvers={'axis': solve}))\n"
    )
    done = call("--plugin", plugin, "--members", 20, "raises-for-some", *STEPS)
    assert "raised an exception, the first: integrator raises-for-some on member" in done.output
    assert "failed: TypeError: too far" in done.output
    assert "SymtopWarning" not in done.output
