"""simulate(): the dataset it promises, its sampling, what it refuses, and how runs end."""

import json
import math
import re
import time
from unittest.mock import Mock

import numpy as np
import pytest
import xarray as xr

import symtop
from symtop.core import netcdf
from symtop.core.numbers import GOLDEN
from symtop.methods.runge_kutta.pair_tables import DOP853
from symtop.model import charts
from symtop.model.scenes import grazing, steady
from symtop.run import trajectory as trajectories
from symtop.run.simulation import WIDEST_GAP, _run_at_times, _setup, integrate, sample_times
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
        gap, all_steps = np.max(np.diff(phases, append=phases[0] + 1.0)), steps is not None and marks.size > steps
        if not (math.isfinite(period) and horizon > 2.0 * period) or gap < WIDEST_GAP or all_steps:
            break
    return times, marks, dithered


def test_samples_are_dithered_where_commensurate_and_those_of_a_sort():
    """F11: sampled at multiples of the nutation period, Verlet's energy error reads a thousand times too small."""
    scene = symtop.scene("spheroid")
    period = scene.nutation_period
    run = symtop.simulate(scene, "stormer-verlet", step_size=period / 200, horizon=period * 50, samples=51)
    assert run.attrs["sampling"] == "dithered"
    largest = float(np.max(np.abs(run["energy"] - run["energy"][0])))
    dense = symtop.simulate(scene, "stormer-verlet", step_size=period / 200, horizon=period * 50, samples=10_001)
    assert dense.attrs["sampling"] == "uniform"
    change = np.abs(dense["energy"].values - dense["energy"].values[0])
    assert largest > 0.3 * change.max()
    assert change[::200].max() < 0.01 * change.max()  # what uniform samples would have shown
    for settings in ({"step_size": 0.01}, {"step_size": 0.016}, {"step_size": 0.1}, {"tolerance": 1e-6}):
        name = "tsit5" if "tolerance" in settings else "strang"  # which makes 800 steps, 500, 80
        run = symtop.simulate(scene, name, guard=False, **settings)
        gaps = np.diff(run["time"].values)
        assert run.attrs["sampling"] == ("uniform" if np.ptp(gaps) < 1e-9 else "nearest steps")
        assert (np.ptp(gaps) < 1e-9) == (settings != {"step_size": 0.01})
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
    contents = {name: data[name].values.tobytes() for name in data.data_vars}
    assert contents == {name: values.tobytes() for name, values in trajectory.columns.items()}


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


RK4 = ((), (0.5,), (0.0, 0.5), (0.0, 0.0, 1.0)), (1 / 6, 1 / 3, 1 / 3, 1 / 6)
OWN = np.sort(np.append(np.arange(0.0, 4.0, 0.3), np.random.default_rng(7).uniform(0.0, 4.0, 40)))  # ends too


@pytest.mark.parametrize(("scene", "row", "h", "accuracy"), [
    ("spheroid", "exact-discrete[attitude]", 0.3, 1e-12), ("grazing", "exact-discrete[axis]", 0.3, 1e-10),
    ("spheroid", "vern9-fixed[axis]", 0.01, 1e-12), ("goldstein", "vern9-fixed[angles]", 0.01, 1e-11),
    ("heavy-brick", "vern9-fixed", 0.01, 1e-12), ("check-case-2", "series-general", 0.3, 1e-12),
    ("spheroid", "taylor", None, 1e-12),
])  # fmt: skip
def test_times_of_ones_own_show_the_true_motion_in_every_chart(scene, row, h, accuracy):
    run, truth = symtop.simulate(scene, row, step_size=h, times=OWN, guard=False), symtop.reference(scene, OWN)
    np.testing.assert_array_equal(run["time"].values, OWN)
    for name in {*run.data_vars} & {*truth.data_vars} - {"quaternion"}:  # whose sign is free
        np.testing.assert_allclose(run[name].values, truth[name].values, rtol=accuracy, atol=accuracy, err_msg=name)
    assert max(float(symtop.errors(run)[name].max()) for name in ("axis", "energy", "p_phi")) < accuracy
    assert run.attrs["sampling"] == "at times"
    if h:
        assert run.attrs["steps"] == math.floor(OWN[-1] / h)
        dense = symtop.simulate(scene, row, step_size=h, horizon=3.9, samples=1001, guard=False)["axis"].values
        values = run["axis"].values[np.isin(OWN, np.arange(0.0, 4.0, 0.3))]
        np.testing.assert_allclose(values, dense[:: round(0.3 / h)], rtol=0.0, atol=accuracy)


def test_a_time_inside_a_step_has_the_order_of_the_method_and_a_line_between_steps_has_order_two():
    steps, errors = np.array([0.04, 0.02, 0.01, 0.005]), []
    for h in steps:
        ends, inside = np.arange(0.0, 2.0, h), np.arange(0.0, 2.0, h)[:-1] + 0.4 * h
        run = symtop.simulate("spheroid", "rk4[axis]", step_size=h, times=inside, guard=False)
        line = np.interp(inside, ends, symtop.reference("spheroid", ends)["theta"].values)
        gap = np.abs(line - symtop.reference("spheroid", inside)["theta"].values).max()
        errors.append([float(symtop.errors(run)["axis"].max()), gap])
    assert np.polyfit(np.log(steps), np.log(errors), 1)[0] == pytest.approx([4.0, 2.0], abs=0.2)


@pytest.mark.parametrize(("scene", "row", "h"), [
    ("spheroid", "rk4[axis]", 0.05), ("goldstein", "rk4[attitude]", 0.06), ("spheroid", "rk4[attitude]", 0.04),
    ("spheroid", "dop853-compiled-fixed[attitude]", 0.15),
])  # fmt: skip
def test_a_time_inside_a_step_is_the_same_step_that_is_shorter_by_hand(scene, row, h):
    """From a state whose |e| or |q| is not one: one step of half the length of f, as anybody has it."""
    case, method, chart, plan, _ = _setup(scene, row, h, times=[40 * h, 40.5 * h])
    before, after = _run_at_times(case, method, chart, plan).states
    assert 1e-7 < abs(np.linalg.norm(before[:-3]) - 1.0) < 1e-2
    f, slopes, zero = symtop.field(chart, case.top), [], np.zeros(before.size)
    a, b = RK4 if row.startswith("rk4") else (((), *DOP853.a), DOP853.b)
    for weights in a[: len(b)]:
        slopes.append(f(0.0, before + 0.5 * h * sum(map(np.multiply, weights, slopes), zero)))
    expected = before + 0.5 * h * sum(map(np.multiply, b, slopes), zero)
    np.testing.assert_allclose(after, expected, rtol=0.0, atol=3e-15 * np.abs(before).max())


def test_times_before_a_first_step_at_zero_and_after_a_failure():
    for row, control in (("midpoint", {"step_size": 9.0}), ("rk4[axis]", {"step_size": 9.0}), ("radau", {})):
        for times in ([0], 0, np.float32(1e-3), [0.0, 1e-9, 1e-3], range(1)):
            run = symtop.simulate("spheroid", row, times=times, guard="series", **control or {"tolerance": 1e-6})
            assert (run.attrs["horizon"], run.attrs["outcome"]) == (np.max(times), "ok")
            assert run.attrs["steps"] == 0 or not control
            assert float(symtop.errors(run)["axis"].max()) < 1e-4
            symtop.plot(run)
    for row, h, outcome in (("rk4[axis]", 1.0, "not_finite"), ("rk4[attitude]", 0.02, "not_normalised")):
        run = symtop.simulate("simo-wong", row, step_size=h, times=np.linspace(0.0, 10.0, 77), guard=False)
        mask = np.isfinite(run["axis"].values).all(axis=1)
        assert (run.attrs["outcome"], mask[0], mask[-1]) == (outcome, True, False)
        np.testing.assert_array_equal(mask, run["time"].values <= run.attrs["reached_time"])
        assert all((np.isfinite(run[name].values) == mask).all() for name in ("theta", "phi", "energy", "p_psi"))
    run = symtop.simulate("spheroid", "rk4[axis]", step_size=0.1, times=np.linspace(0.0, 4.0, 401), guard=False)
    lengths = np.linalg.norm(run["axis"].values, axis=1)
    assert np.abs(np.diff(lengths)).max() < 0.2 * np.ptp(lengths)  # a shorter step keeps what a step has done to |e|


@pytest.mark.parametrize("theta", [0.0, math.pi])
def test_a_start_on_a_pole_is_refused_by_the_angles_chart_and_welcome_elsewhere(theta):
    scene = symtop.Scene("pole", symtop.SymmetricTop(2.0, 1.0, 1.0), symtop.Angles(theta=theta, psi_dot=9.0), 1.0)
    with pytest.raises(symtop.SymtopError, match=r"inside \(0, pi\)"):
        symtop.simulate(scene, "midpoint", step_size=0.01)
    assert symtop.simulate(scene, "taylor", samples=5)["theta"].values == pytest.approx(theta, abs=1e-15)


def test_the_three_kinds_of_nutation_are_what_they_are_called():
    """At the upper turning point phi' vanishes (cusp), turns back (loop) or goes on (wave)."""
    for name, sign in (("cusp", 0.0), ("loop", -1.0), ("wave", 1.0)):
        scene = symtop.scene(name)
        motion = symtop.ClosedForm(scene.top, scene.start)(np.linspace(0.0, scene.nutation_period, 2001))
        assert np.sign(np.round(motion.phi_dot.min(), 9)) == sign
        assert motion.phi_dot.max() > 0.0


HUGE = symtop.Scene("huge", symtop.SymmetricTop(1.0, 1.0, 1e30), symtop.Angles(theta=1.0, psi_dot=1.0), 8.0)


@pytest.mark.parametrize(("scene", "name", "controls", "outcome"), [
    ("spheroid", "stormer-verlet", {"step_size": 1.0, "horizon": 50.0}, "left_chart"),
    ("spheroid", "rk4", {"step_size": 0.4, "horizon": 40.0}, "left_chart"),
    ("bruls-cardona-arnold", "rk45", {"tolerance": 0.5}, "left_chart"),
    ("spheroid", "gauss-2", {"step_size": 10.0, "horizon": 200.0, "observe": "axis"}, "not_converged"),
    ("spheroid", "collective-gauss-4", {"step_size": 10.0, "horizon": 200.0, "observe": "axis"}, "not_converged"),
    ("spheroid", "simo-wong", {"step_size": 10.0, "horizon": 200.0, "observe": "axis"}, "not_converged"),
    ("sleeping", "trapezoidal", {"step_size": 2.0, "horizon": 4000.0}, "not_converged"),
    ("simo-wong", "rk4", {"step_size": 1.0, "observe": "axis"}, "not_finite"),
    (grazing(1e-14), "rk45-compiled", {"tolerance": 1e-12}, "step_too_small"),
    ("spheroid", "rk45-compiled", {"tolerance": 1e-9, "budget": 100}, "out_of_budget"),
    ("spheroid", "dop853", {"tolerance": 1e-9, "budget": 100}, "out_of_budget"),
    ("spheroid", "taylor", {"budget": 3}, "out_of_budget"),
    ("spheroid", "taylor", {"tolerance": 1e-9, "budget": 40, "samples": 2}, "out_of_budget"),
    ("spheroid", "rk45-compiled", {"tolerance": 1e-9, "budget": 40, "samples": 2}, "out_of_budget"),
    ("spheroid", "rk4[attitude]", {"step_size": 0.2}, "not_normalised"),
])  # fmt: skip
def test_every_outcome_is_produced_said_and_timed(scene, name, controls, outcome):
    run = symtop.simulate(scene, name, guard=False, **{"samples": 201, **controls})
    end, unit = run.attrs["reached_time"], symtop.scene(scene).second
    assert run.attrs["outcome"] == outcome
    assert re.fullmatch(rf"stopped at t = {end:.6g} of [\d.e+-]+{unit}: .+; .+", run.attrs["outcome_message"])
    assert 0.0 <= end < run.attrs["horizon"]
    assert end > 0.0 or outcome != "out_of_budget"
    mask, after = np.isfinite(run["axis"].values).all(axis=1), run["time"].values > end * (1.0 + 1e-9)
    assert mask[0]
    assert not mask[after].any()  # nothing is made up


def test_an_early_end_is_announced_and_a_budget_that_was_kept_is_no_failure():
    for gap, tolerance, outcome in ((1e-14, 1e-9, "step_too_small"), (1e-6, 1e-6, "ok")):
        sentences, controls = [], {"observe": "nutation", "samples": 11}
        run = symtop.simulate(grazing(gap), "radau", tolerance=tolerance, guard=sentences.append, **controls)
        assert run.attrs["outcome"] == outcome
        assert len(sentences) == (outcome != "ok")
        words = f"expect the run to be stopped at t = {run.attrs['reached_time']:.6g} "
        assert all(words in sentence and "step size fell below" in sentence for sentence in sentences)
    run = symtop.simulate("spheroid", "rk45-compiled", tolerance=1e-6)
    count = run.attrs["force_evaluations"]
    assert symtop.simulate("spheroid", "rk45-compiled", tolerance=1e-6, budget=count).equals(run)
    assert symtop.simulate("spheroid", "rk45", tolerance=1e-6, budget=count + 2).attrs["outcome"] == "ok"
    assert symtop.simulate("spheroid", "taylor", budget=1e4).attrs["outcome"] == "ok"
    with pytest.raises(symtop.SymtopError, match="the limit is 700"):
        symtop.simulate("spheroid", "midpoint", step_size=0.01, budget=700)
    assert symtop.simulate("spheroid", "midpoint", step_size=0.01, budget=800, guard=False).attrs["outcome"] == "ok"


@pytest.mark.parametrize("name", ["midpoint", "trapezoidal", "simpson-linear", "galerkin-simpson"])
@pytest.mark.parametrize("turn", [0.3, 1.0, 1.9])
def test_implicit_steps_are_solved_where_nothing_moves_but_rounding(name, turn):
    """On a steady precession the increment of theta is rounding, and no correction is small beside it."""
    for scene in (steady(20.0), symtop.scene("steady")):
        h = turn / scene.top.nutation_frequency(scene.top.momenta(scene.start))
        run = symtop.simulate(scene, name, step_size=h, horizon=1000 * h, samples=101, guard=False)
        assert run.attrs["outcome"] == "ok"
        assert run.attrs["newton_iterations"] < 7 * run.attrs["steps"]
        assert float(np.abs(run["theta"] - math.pi / 3.0).max()) < 1e-11


@pytest.mark.parametrize(("scene", "name", "controls"), [
    ("spheroid", "midpoint", {"step_size": 1e-300}), ("spheroid", "midpoint", {"step_size": 0.01, "horizon": 1e300}),
    ("spheroid", "strang", {"step_size": 1e299, "horizon": 1e300}),
    ("spheroid", "rk45", {"tolerance": 1e-6, "horizon": 1e300}),
    ("separatrix", "rk45-compiled", {"tolerance": 1e-6, "horizon": 1e300}), ("spheroid", "taylor", {"horizon": 1e300}),
    ("spheroid", "exact", {"horizon": 1e300}), ("spheroid", "dop853", {"tolerance": 1e300}),
    *((HUGE, name, {"step_size": 0.01}) for name in ("midpoint", "galerkin-simpson", "stormer-verlet", "strang")),
    *((HUGE, name, {"step_size": 0.01}) for name in ("gauss-8", "rk4")),
    *((HUGE, name, {"tolerance": 1e-6}) for name in ("rk45", "rk45-compiled", "taylor")),
])  # fmt: skip
def test_absurd_runs_end_at_once_with_a_sentence(scene, name, controls):
    defaults = {None: {}, "step_size": {"step_size": 0.1}, "tolerance": {"tolerance": 1e-3}}
    symtop.simulate("spheroid", name, guard=False, **defaults[symtop.integrator(name).control])
    start, sentences = time.process_time(), []  # of this process: others may be busy
    try:
        run = symtop.simulate(scene, name, guard=sentences.append, **controls)
        sentence = run.attrs["outcome_message"] if run.attrs["outcome"] != "ok" else sentences[0]
    except symtop.SymtopError as error:
        sentence = str(error)
    assert time.process_time() - start < 2.0
    assert len(sentence) > 20
    assert "\n" not in sentence


@pytest.mark.parametrize(("name", "step_size"), [("rk4[attitude]", 0.2), ("series[attitude]", 0.5)])
def test_a_quaternion_that_leaves_length_one_has_failed_alone_and_in_an_ensemble(name, step_size):
    options = {"step_size": step_size, "horizon": 8.0, "samples": 41}
    run = symtop.simulate("spheroid", name, **options, guard=False)
    assert run.attrs["outcome"] == "not_normalised"
    assert "0.1 %" in run.attrs["outcome_message"]
    mask = np.isfinite(run["quaternion"].values).all(axis=1)
    assert 0 < mask.sum() < mask.size
    assert (np.diff(mask.astype(int)) <= 0).all()  # nothing after the failure
    assert np.abs(np.linalg.norm(run["quaternion"].values[mask], axis=1) - 1.0).max() <= 1e-3
    assert run.attrs["reached_time"] == run["time"].values[mask][-1]
    assert np.isnan(run["p_phi"].values[~mask]).all()
    assert np.nanmax(symtop.errors(run)["attitude"].values) <= np.pi
    member = symtop.ensemble(["spheroid", "goldstein"], name, **options, observe="attitude", quiet=True).isel(member=0)
    assert (member["outcome"].item(), member["reached_time"].item()) == ("not_normalised", run.attrs["reached_time"])
    np.testing.assert_array_equal(member["quaternion"].values[: mask.size], run["quaternion"].values)


def test_a_quaternion_that_keeps_its_length_has_not_failed_and_a_state_whose_squares_overflow_is_not_finite():
    assert symtop.simulate("spheroid", "strang[attitude]", step_size=0.5, guard=False).attrs["outcome"] == "ok"
    run = symtop.simulate("spheroid", "rk4[attitude]", step_size=0.05, guard=False)
    assert run.attrs["outcome"] == "ok"
    assert np.abs(np.linalg.norm(run["quaternion"].values, axis=1) - 1.0).max() > 5e-4
    assert charts.attitude_distance(np.array([3e116, 0.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0, 0.0])) == np.pi
    # L is finite, about 1e160; the energy is the square of it.
    top, start = symtop.SymmetricTop(0.1862, 0.2285, 0.1828), symtop.Angles(0.00337, psi_dot=-1.61)
    scene = symtop.Scene("doubtful", top, start, 87.0)
    run = symtop.simulate(scene, "rk4[axis]", step_size=43.5, horizon=130.5, guard=False)
    assert np.isfinite(run["axis"].values).all()
    assert not np.isfinite(run["energy"].values).all()
    assert (run.attrs["outcome"], run.attrs["reached_time"]) == ("not_finite", 87.0)
    data = symtop.ensemble([scene] * 2, "rk4[axis]", step_size=43.5, horizon=130.5, quiet=True)
    assert (data["outcome"].values.tolist(), data["reached_time"].values.tolist()) == (["not_finite"] * 2, [87.0] * 2)
    assert symtop.simulate(scene, "rk4[axis]", step_size=0.5, guard=False).attrs["outcome"] == "ok"  # the control


@pytest.mark.parametrize("count", [2, pytest.param(4, marks=pytest.mark.slow)])
def test_every_variant_shows_finite_numbers_or_says_that_it_does_not(count):
    draw, outcomes = np.random.default_rng(50), set()
    for row in (method.variant(chart) for method in symtop.integrators().values() for chart in method.charts()):
        for _ in range(count):
            I1, mgl, rate = 10.0 ** draw.uniform(-2.0, 2.0, 3)
            top = symtop.SymmetricTop(I1, I1 * draw.uniform(0.05, 1.95), mgl * draw.choice([-1.0, 1.0]))
            start = symtop.Angles(draw.choice([1e-3, 1.0, 3.0]), theta_dot=rate,
                                  psi_dot=draw.choice([-1.0, 1.0]) * rate)  # fmt: skip
            h = 10.0 ** draw.uniform(0.0, 4.0) / rate
            scene, control = symtop.Scene("drawn", top, start, 4.0 * h if row.fixed_step else 20.0 / rate), {}
            if row.control == "step_size":
                control = {"step_size": h}
            elif row.control == "tolerance":
                control = {"tolerance": max(10.0 ** draw.uniform(-6.0, -0.1), row.least_tolerance), "budget": 2000}
            run = symtop.simulate(scene, row, **control, guard=False)
            finite = all(np.isfinite(values).all() for values in run.data_vars.values())
            assert finite or run.attrs["outcome"] != "ok", (row.name, scene, control)
            outcomes.add(run.attrs["outcome"])
    assert {"ok", "not_finite", "left_chart"} <= outcomes
