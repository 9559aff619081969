"""simulate(): the dataset it promises, its sampling, and what it refuses."""

import json
import math
from unittest.mock import Mock

import numpy as np
import pytest
import xarray as xr

import symtop
from symtop.core import netcdf
from symtop.core.numbers import GOLDEN
from symtop.run import trajectory as trajectories
from symtop.run.simulation import WIDEST_GAP, integrate, sample_times
from symtop.run.trajectory import Trajectory, dataset


def test_the_dataset_is_the_one_that_is_promised_and_begins_with_exact_values():
    run = symtop.simulate("spheroid", "midpoint", step_size=0.013, samples=51, guard=False)
    assert list(run["component"].values) == ["x", "y", "z"]
    for name in ("theta", "phi", "psi", "energy", "p_phi", "p_psi", "p_theta"):
        assert run[name].dims == ("time",)
    assert run["axis"].dims == ("time", "component")
    attrs = run.attrs
    assert (attrs["steps"], attrs["step_size"], attrs["outcome"]) == (615, 8.0 / 615, "ok")  # h = T/N exactly
    assert attrs["reached_time"] == 8.0
    assert {"integrator", "scene", "force_evaluations", "newton_iterations", "symtop_version"} <= attrs.keys()
    steps = run["time"].values / attrs["step_size"]
    assert steps == pytest.approx(np.rint(steps), abs=1e-9)
    scene = symtop.scene("goldstein-rising")
    for name, control in (("midpoint", {"step_size": 0.1}), ("rk45", {"tolerance": 1e-6}), ("taylor", {})):
        run = symtop.simulate(scene, name, horizon=1.0, **control)
        assert float(run["energy"][0]) == pytest.approx(14.1, rel=1e-15)
        assert float(run["p_phi"][0]) == pytest.approx(3.4, rel=1e-15)
        assert float(run["p_psi"][0]) == pytest.approx(5.0, rel=1e-15)


def sorted_times(horizon, samples, period, steps):
    """Samples as they are defined: each mark once, and the widest gap of all phases in their order."""
    last = samples - 1
    for dithered in (False, True):
        place = np.arange(samples, dtype=float)
        if dithered:
            place[1:last] += np.mod(GOLDEN * place[1:last], 1.0) - 0.5
        marks = None if steps is None else np.unique(np.rint(steps * (place / last)).astype(np.int64))
        times = horizon * (place / last) if steps is None else marks * (horizon / steps)
        phases = np.sort(np.mod(times / period, 1.0))
        gap = np.max(np.diff(phases, append=phases[0] + 1.0))
        every = steps is not None and marks.size > steps
        if not (math.isfinite(period) and horizon > 2.0 * period) or gap < WIDEST_GAP or every:
            break
    return times, marks, dithered


def test_samples_are_dithered_where_commensurate_and_those_of_a_sort():
    """F11: sampled at multiples of the nutation period, Verlet's energy error reads a thousand times too small."""
    scene = symtop.scene("spheroid")
    period = scene.nutation_period
    run = symtop.simulate(scene, "stormer-verlet", step_size=period / 200, horizon=period * 50, samples=51)
    assert run.attrs["sampling"] == "dithered"
    honest = float(np.max(np.abs(run["energy"] - run["energy"][0])))
    dense = symtop.simulate(scene, "stormer-verlet", step_size=period / 200, horizon=period * 50, samples=10_001)
    assert dense.attrs["sampling"] == "uniform"
    every = np.abs(dense["energy"].values - dense["energy"].values[0])
    assert honest > 0.3 * every.max()
    blind = every[::200]  # what uniform samples would have shown
    assert blind.max() < 0.01 * every.max()
    draw, dithered = np.random.default_rng(4), 0
    for k in range(4000):
        samples, period = int(draw.integers(2, 300)), float(10.0 ** draw.uniform(-1, 1))
        horizon = period * (float(draw.integers(1, 600)) / draw.integers(1, 5) if k % 2 else draw.uniform(0.1, 300.0))
        steps = None if k % 5 == 0 else int(draw.integers(1, 3 * samples))
        times, marks, scattered = sample_times(horizon, samples, period, steps)
        expected = sorted_times(horizon, samples, period, steps)
        np.testing.assert_array_equal(times, expected[0])
        assert steps is None or np.array_equal(marks, expected[1])
        assert scattered == expected[2]
        dithered += scattered
    assert 200 < dithered < 3800  # both happen


@pytest.mark.parametrize("row", ["strang[axis]", "strang[attitude]", "midpoint[angles]", "rk45[angles]"])
@pytest.mark.parametrize("scene", ["spheroid", "goldstein", "grazing"])
def test_the_dataset_is_the_one_of_xarray_itself(scene, row, monkeypatch, tmp_path):
    """With the public constructor in place of the quick one: values, types, order, coordinates, attributes."""
    settings = {"samples": 101, "horizon": 2.0, "tolerance" if row.startswith("rk45") else "step_size": 1e-3}
    quick = symtop.simulate(scene, row, guard=False, **settings)
    monkeypatch.setattr(trajectories, "_direct_works", lambda: False)
    public = symtop.simulate(scene, row, guard=False, **settings)
    xr.testing.assert_identical(quick, public)
    assert list(quick.variables) == list(public.variables)
    assert [type(part) for part in quick.variables.values()] == [type(part) for part in public.variables.values()]
    assert quick.sel(time=2.0).identical(public.sel(time=2.0))
    files = [netcdf.write(data, tmp_path / f"{k}.nc").read_bytes() for k, data in enumerate((quick, public))]
    assert files[0] == files[1]
    for record in ("top", "start"):
        numbers, held = json.loads(quick.attrs[record]), getattr(symtop.scene(scene), record)
        assert numbers == {name: getattr(held, name) for name in held.__slots__}
        assert quick.attrs[record] == json.dumps(numbers, sort_keys=True)


def test_two_datasets_share_nothing_and_a_trajectory_has_the_numbers_of_its_dataset():
    trajectory = integrate("spheroid", "strang[attitude]", step_size=0.1)
    first, second = (dataset(trajectory.time, trajectory.columns) for _ in range(2))
    for name in ("time", "component", "part", "theta"):
        first[name].attrs["mark"] = 1
        first[name].encoding["mark"] = 1
        assert "mark" not in second[name].attrs
        assert "mark" not in second[name].encoding
    assert not np.shares_memory(first["time"].values, trajectory.time)
    settings = {"step_size": 0.01, "observe": "attitude", "horizon": 1.0}
    data = symtop.simulate("spheroid", "midpoint", guard=False, **settings)
    trajectory = integrate("spheroid", "midpoint", **settings)
    np.testing.assert_equal(Trajectory.of_data(data)._asdict(), trajectory._asdict())
    assert {name: data[name].values.tobytes() for name in data.data_vars} == {
        name: values.tobytes() for name, values in trajectory.columns.items()
    }


def test_files_are_whole_and_a_failed_write_leaves_the_old_one(tmp_path, monkeypatch):
    run = symtop.simulate("spheroid", "stormer-verlet", step_size=0.01)
    first = netcdf.write(run, tmp_path / "a" / "run.nc")
    second = netcdf.write(symtop.simulate("spheroid", "stormer-verlet", step_size=0.01), tmp_path / "b.nc")
    assert first.read_bytes() == second.read_bytes()
    assert netcdf.read(first).identical(run)
    before = second.read_bytes()
    with pytest.raises(symtop.SymtopError, match="it is a folder"):
        netcdf.write(run, tmp_path)
    monkeypatch.setattr(type(run), "to_netcdf", Mock(side_effect=OSError(28, "No space left on device")))
    with pytest.raises(symtop.SymtopError, match="No space left"):
        netcdf.write(run, second)
    assert second.read_bytes() == before
    assert sorted(path.name for path in tmp_path.rglob("*") if path.is_file()) == ["b.nc", "run.nc"]


@pytest.mark.parametrize("theta", [0.0, math.pi])
def test_a_start_on_a_pole_is_refused_by_the_angles_chart_and_welcome_elsewhere(theta):
    scene = symtop.Scene("pole", symtop.SymmetricTop(2.0, 1.0, 1.0), symtop.Angles(theta=theta, psi_dot=9.0), 1.0)
    with pytest.raises(symtop.SymtopError, match=r"inside \(0, pi\)"):
        symtop.simulate(scene, "midpoint", step_size=0.01)
    run = symtop.simulate(scene, "taylor", samples=5)
    assert run["theta"].values == pytest.approx(theta, abs=1e-15)


def test_the_three_kinds_of_nutation_are_what_they_are_called():
    """At the upper turning point phi' vanishes (cusp), turns back (loop) or goes on (wave)."""
    for name, sign in (("cusp", 0.0), ("loop", -1.0), ("wave", 1.0)):
        scene = symtop.scene(name)
        motion = symtop.ClosedForm(scene.top, scene.start)(np.linspace(0.0, scene.nutation_period, 2001))
        assert np.sign(np.round(motion.phi_dot.min(), 9)) == sign
        assert motion.phi_dot.max() > 0.0
