"""`symtop.errors`: the errors of a run and of anybody's trajectory, with controls that must and must not show one."""

import warnings
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import solve_ivp

import symtop
from symtop.measure.errors import QUANTITIES
from tests.judging.blind.right import product

TIMES = np.linspace(0.0, 8.0, 41)
TURN = 1e-3  # rad


@pytest.fixture(scope="module")
def truth():
    return symtop.reference("spheroid", TIMES, "closed-form")


@pytest.mark.parametrize(("integrator", "observe"), [("midpoint", "nutation"), ("strang", "axis"), ("strang", None)])
def test_a_run_needs_no_scene_and_gives_the_errors_of_every_quantity_it_shows(integrator, observe):
    errors = symtop.errors(symtop.simulate("spheroid", integrator, step_size=0.01, observe=observe, guard=False))
    names = [name for name in QUANTITIES if name != "attitude" or observe != "axis"]
    assert set(errors.data_vars) == {*names, *(f"{name}_bound" for name in names)}
    for name in names:
        assert 0.0 < errors[f"{name}_bound"].values.min() <= errors[f"{name}_bound"].values.max() < 1e-12
    assert 1e-5 < float(errors["axis"].max()) < 1e-1


def test_the_closed_form_is_within_its_bounds_and_a_coarse_run_is_not():
    exact = symtop.errors(symtop.simulate("spheroid", "exact"))
    coarse = symtop.errors(symtop.simulate("spheroid", "strang", step_size=0.02, guard=False))
    for name in ("axis", "attitude", "theta", "energy"):
        assert np.all(exact[name].values <= 2.0 * exact[f"{name}_bound"].values)
        assert float(coarse[name].max()) > 1e3 * float(exact[f"{name}_bound"].max())


def test_a_run_is_compared_with_no_other_top_or_start_than_its_own():
    run, spheroid = symtop.simulate("spheroid", "strang", step_size=0.01, guard=False), symtop.scene("spheroid")
    variant = symtop.Scene("moved", spheroid.top, symtop.Angles(spheroid.start.theta, psi_dot=1.0), spheroid.horizon)
    longer = symtop.Scene("longer", spheroid.top, spheroid.start, 2.0 * spheroid.horizon)
    assert symtop.errors(run, longer)["axis"].identical(symtop.errors(run)["axis"])
    for scene, name in (("goldstein", "top"), (variant, "start")):
        with pytest.raises(symtop.SymtopError, match=f"scene must be that of the data, spheroid, whose {name} is"):
            symtop.errors(run, scene)
        with pytest.raises(symtop.SymtopError, match="scene must be that of the data, spheroid"):
            symtop.judge(run, scene=scene)
    body = symtop.simulate("heavy-brick", "rk4", step_size=0.05, guard=False)
    for data, scene, name in ((run, "heavy-brick", "spheroid"), (body, "spheroid", "heavy-brick")):
        with pytest.raises(symtop.SymtopError, match=f"scene must be that of the data, {name}, whose top is"):
            symtop.errors(data, scene)
    assert float(symtop.errors(body, "heavy-brick")["attitude"].max()) < 1e-3
    with pytest.warns(symtop.SymtopWarning, match="on goldstein"):
        assert float(symtop.errors(run.drop_attrs(), "goldstein")["axis"].max()) > 0.1
    assert symtop.judge(run)["axis_error"].value == pytest.approx(float(symtop.errors(run)["axis"].max()))


def test_a_member_of_fewer_steps_than_samples_has_the_errors_of_its_run():
    runs = symtop.ensemble(["spheroid"] * 2, "strang", step_size=[0.1, 0.01], samples=101, quiet=True)
    for k, h in enumerate((0.1, 0.01)):
        member = runs.isel(member=k)
        run = symtop.simulate("spheroid", "strang", step_size=h, samples=101, guard=False)
        assert bool(np.isnan(member["time"]).any()) is (k == 0)
        expected = symtop.errors(run)
        labelled = member.assign_attrs({name: run.attrs[name] for name in ("scene", "top", "start", "horizon")})
        for errors in (symtop.errors(member, "spheroid"), symtop.errors(labelled)):
            for name in ("time", "axis", "attitude", "energy", "axis_bound"):
                np.testing.assert_array_equal(errors[name].values, expected[name].values)
        assert symtop.judge(member)["axis_error"].value == pytest.approx(float(expected["axis"].max()))
    with pytest.raises(symtop.SymtopError, match="scene is missing"):
        symtop.errors(runs.isel(member=0))
    with pytest.raises(symtop.SymtopError, match="time must be finite"):  # a stranger's time that is no number
        symtop.errors(runs.isel(member=0).drop_attrs(), "spheroid")


@pytest.mark.parametrize("name", ["axis", "theta"])
def test_an_axis_or_theta_alone_is_enough(truth, name):
    errors = symtop.errors(xr.Dataset({name: truth[name]}), "spheroid")
    assert ("axis" in errors, "attitude" in errors, "theta" in errors) == (name == "axis", False, True)
    assert np.all(errors["theta"].values <= 4e-16 + errors["theta_bound"].values)
    errors = symtop.errors({"time": TIMES, "theta": truth["theta"].values + TURN}, "spheroid")
    assert errors["theta"].values == pytest.approx(TURN, rel=1e-9)


def test_a_foreign_trajectory_is_compared_and_one_turned_by_a_thousandth_shows_a_thousandth(truth):
    mine, lengths = {"time": TIMES, "quaternion": truth["quaternion"].values}, 1.0 + TIMES[:, None]
    for factor in (1.0, -1.0, 1.0002, lengths):  # either sign, and lengths that single precision or a method has lost
        errors = symtop.errors({**mine, "quaternion": factor * mine["quaternion"]}, "spheroid")
        names = ("axis", "attitude", "theta", "quaternion_length")
        assert {*errors} == {f"{name}{end}" for name in names for end in ("", "_bound")}
        excess = np.abs(factor * np.ones_like(lengths))[:, 0] - 1.0
        assert errors["quaternion_length"].values == pytest.approx(excess, abs=4e-15)
        for name in ("axis", "attitude", "theta"):
            assert np.all(errors[name].values <= errors[f"{name}_bound"].values)
    about_the_vertical = np.array([np.cos(0.5 * TURN), 0.0, 0.0, np.sin(0.5 * TURN)])
    quaternions = [product(about_the_vertical, quaternion) for quaternion in truth["quaternion"].values]
    errors = symtop.errors({"time": TIMES, "quaternion": quaternions}, symtop.scene("spheroid"))
    assert errors["attitude"].values == pytest.approx(TURN, rel=1e-9)
    assert errors["axis"].values == pytest.approx(TURN * np.sin(truth["theta"].values), rel=1e-6)
    assert np.max(errors["theta"].values) < 1e-14
    angles = {"time": TIMES, **{name: truth[name].values for name in ("theta", "phi", "psi")}}
    assert float(symtop.errors(angles, "spheroid")["attitude"].max()) < 1e-13
    errors = symtop.errors({**angles, "psi": angles["psi"] + TURN}, "spheroid")
    assert errors["attitude"].values == pytest.approx(TURN, rel=1e-9)
    assert float(errors["axis"].max()) < 1e-13
    scene = symtop.scene("spheroid")
    errors = symtop.errors({**mine, "energy": truth["energy"].values + 1e-3 * scene.energy_scale}, scene)
    assert errors["energy"].values == pytest.approx(1e-3, rel=1e-9)
    assert "p_phi" not in errors


def test_what_scipy_makes_of_the_axis_at_a_loose_tolerance_is_judged_and_its_length_is_an_error():
    scene = symtop.scene("spheroid")
    f = symtop.field("axis", scene.top)
    run = solve_ivp(f, (0.0, 8.0), f.state(scene.start), rtol=1e-3, atol=1e-3)
    axis = np.where(run.t[:, None] == run.t[-1], np.nan, run.y[:3].T)
    with pytest.warns(symtop.SymtopWarning, match="not a number"):
        length = symtop.errors({"time": run.t, "axis": axis}, scene)["axis_length"].values
    np.testing.assert_array_equal(length, np.abs(np.linalg.norm(axis, axis=1) - 1.0))
    assert 1e-3 < np.nanmax(length) < 1e-2
    judged = symtop.judge({"time": run.t, "axis": run.y[:3].T}, scene=scene)["axis_length_error"]
    assert judged.value >= np.nanmax(length)


def test_a_wrong_scene_and_another_order_of_a_quaternion_are_seen(truth):
    run = symtop.simulate("goldstein", "exact", horizon=8.0, samples=41)
    with pytest.warns(symtop.SymtopWarning, match=r"the first sample, at t = 0, is \S+ rad from the true axis"):
        assert float(symtop.errors({"time": TIMES, "axis": run["axis"].values}, "spheroid")["axis"].max()) > 0.5
    assert float(symtop.errors({"time": TIMES, "axis": truth["axis"].values}, "spheroid")["axis"].max()) < 1e-14
    with pytest.raises(symtop.SymtopError, match="order w, x, y, z"):
        symtop.errors({"time": TIMES, "quaternion": np.roll(truth["quaternion"].values, -1, axis=1)}, "spheroid")
    inverse = truth["quaternion"].values * [1.0, -1.0, -1.0, -1.0]
    with pytest.raises(symtop.SymtopError, match="read as from space to body"):
        symtop.errors({"time": TIMES, "quaternion": inverse}, "spheroid")


def masked(values):
    """The same, but for a sample that is masked."""
    rows = np.arange(len(values)) == 7
    return np.ma.masked_array(np.where(rows[:, None], 1.0, values), np.repeat(rows[:, None], values.shape[1], axis=1))


@pytest.mark.parametrize("lose", [
    lambda values: np.where((np.arange(41) == 7)[:, None], np.nan, values), masked,
    lambda values: [*values[:7].tolist(), [None] * values.shape[1], *values[8:].tolist()],
], ids=["nan", "masked", "none"])  # fmt: skip
def test_lost_samples_are_nan_and_text_is_read_as_numbers(lose, truth):
    """As a reader of CSV files has them."""
    for name, quantity in (("axis", "axis"), ("quaternion", "attitude")):
        data = {"time": [str(time) for time in TIMES], name: lose(truth[name].values)}
        with pytest.warns(symtop.SymtopWarning, match=f"axis is not a number from t = {TIMES[7]:.6g}; a largest error"):
            errors = symtop.errors(data, "spheroid")[quantity].values
        assert np.flatnonzero(np.isnan(errors)).tolist() == [7]
        assert np.nanmax(errors) < 1e-14


def test_a_part_of_a_run_is_judged_by_what_it_shows_and_no_other_shape_is_taken():
    run = symtop.simulate("spheroid", "rk4", step_size=0.01, samples=41, guard=False)
    expected = symtop.errors(run)
    for part in (run.drop_vars("theta"), run.drop_vars("phi"), run[["axis", "psi"]]):
        errors = symtop.errors(part)
        assert ("attitude" in errors) is ("phi" in part)
        xr.testing.assert_allclose(errors, expected[list(errors)], atol=1e-15)
    xr.testing.assert_identical(symtop.errors(run.transpose()), expected)
    for data in (run.isel(component=slice(2)), run.sel(component="z")):
        with pytest.raises(symtop.SymtopError, match=r"axis must have the shape \(41, 3\), one row for each time, not"):
            symtop.errors(data)


def test_samples_after_a_failure_stay_nan_and_single_precision_may_round_beyond_the_pole():
    run = symtop.simulate("grazing", "midpoint", step_size=0.2, guard=False)
    assert run.attrs["outcome"] != "ok"
    axis = symtop.errors(run)["axis"].values
    np.testing.assert_array_equal(np.isnan(axis), np.isnan(run["axis"].values).any(axis=1))
    assert np.isnan(axis[-1])
    assert np.isfinite(axis[0])
    hanging = symtop.Scene("hanging", symtop.SymmetricTop(1.0, 1.0, 1.0), symtop.Angles(np.pi), 5.0)
    single = {"time": [0.0, 1.0], "theta": np.full(2, np.pi, dtype=np.float32)}
    assert float(symtop.errors(single, hanging)["theta"].max()) == pytest.approx(8.7e-8, rel=0.01)
    with pytest.raises(symtop.SymtopError, match="theta must be radians"):
        symtop.errors({"time": [0.0, 1.0], "theta": [np.pi, np.pi + 1e-6]}, hanging)


AXIS = np.tile([0.0, 0.0, 1.0], (41, 1))


@pytest.mark.parametrize(("data", "scene", "words"), [
    ({"axis": AXIS}, "spheroid", "must hold time"),
    ({"time": TIMES, "axis": np.where(AXIS > -2.0, np.nan, AXIS)}, "spheroid", "where the top is has a NaN"),
    ({"time": np.where(TIMES > 7.0, np.nan, TIMES), "axis": AXIS}, "spheroid", "time must be finite"),
    ({"time": TIMES.astype("timedelta64[s]"), "axis": AXIS}, "spheroid", r"of real numbers, not timedelta64\[s"),
    ({"time": TIMES, "axis": AXIS.T}, "spheroid", r"shape \(41, 3\)"),
    ({"time": TIMES, "quaternion": AXIS}, "spheroid", r"shape \(41, 4\)"),
    ({"time": TIMES, "axis": AXIS, "energy": TIMES[:5]}, "spheroid", r"energy must have the shape \(41,\)"),
    ({"time": TIMES, "axis": 2.0 * AXIS}, "spheroid", r"length 1, at first within 0.5, .* is 2 at t = 0$"),
    ({"time": TIMES, "axis": np.where(TIMES[:, None] > 7.0, 0.0, AXIS)}, "spheroid", "its length is 0 at t = 7.2"),
    ({"time": TIMES, "theta": 50.0 + TIMES}, "spheroid", r"radians from the vertical"),
    ({"time": TIMES, "axis": AXIS}, None, r"give errors\(data, scene\)"),
    (xr.Dataset({"axis": (("time", "c"), AXIS)}, {"time": TIMES}), None, r"give errors\(data, scene\)"),
    (xr.Dataset({"axis": (("member", "time", "c"), [AXIS])}, {"time": TIMES}), None, r"give errors\(data, members\)"),
    (AXIS, "spheroid", "Dataset or a mapping"), (None, None, "data must be a Dataset or a mapping"),
])  # fmt: skip
def test_bad_data_are_refused_in_one_sentence(data, scene, words):
    with pytest.raises(symtop.SymtopError, match=words) as info:
        symtop.errors(data, scene)
    assert "\n" not in str(info.value)


def test_another_unit_of_time_is_asked_about():
    """Milliseconds for seconds; the control: a trajectory that goes on for fifty horizons is nobody's mistake."""
    horizon = symtop.scene("spheroid").horizon
    for times, doubtful in ((np.linspace(0.0, 1e3 * horizon, 41), True), (np.linspace(0.0, 50 * horizon, 41), False)):
        data = {"time": times, "quaternion": symtop.reference("spheroid", times)["quaternion"].values}
        with warnings.catch_warnings(record=True, action="always") as record:
            symtop.errors(data, "spheroid")
        assert [("are they in the scene's unit of time" in str(entry.message)) for entry in record] == [True] * doubtful


def test_errors_of_an_ensemble_are_those_of_its_members_and_other_members_are_refused():
    names, settings = ["spheroid", "goldstein"], {"step_size": 0.5, "horizon": [4.0, 8.0], "samples": 30}
    runs = symtop.ensemble(names, "rk4[attitude]", **settings, observe="attitude", quiet=True)
    errors = symtop.errors(runs, names)
    assert errors["axis"].dims == ("member", "time")
    assert np.isfinite(errors["time"].values).sum(axis=1).tolist() == [9, 17]
    for i, name in enumerate(names):
        member = symtop.errors(runs.isel(member=i), name)
        for quantity in ("axis", "attitude", "energy", "p_phi"):
            np.testing.assert_array_equal(errors[quantity][i].values[: member.sizes["time"]], member[quantity].values)
    runs = symtop.ensemble(["spheroid", "goldstein"], "strang", step_size=0.05, horizon=1.0, samples=5, quiet=True)
    with pytest.raises(symtop.SymtopError, match="members must be the 2 of the ensemble, not 3"):
        symtop.errors(runs, ["spheroid", "goldstein", "fast"])
    members = symtop.population(2, seed=1).assign_coords(member=["a", "b"])
    ensemble = symtop.ensemble(members, "strang", step_size=0.01, horizon=0.1, samples=3, quiet=True)
    with pytest.raises(symtop.SymtopError, match="their labels are others"):
        symtop.errors(ensemble, members.assign_coords(member=["b", "a"]))
    assert float(symtop.errors(runs, ["spheroid", "goldstein"])["axis"].max()) < 0.1
    with pytest.raises(symtop.SymtopError, match="their names are others"):
        symtop.errors(runs, ["goldstein", "spheroid"])
    members = symtop.population(4, seed=1)
    ensemble = symtop.ensemble(members, "strang", step_size=1e-4, horizon=1e-3, samples=3, quiet=True)
    with pytest.raises(symtop.SymtopError, match="their strata are others"):
        symtop.errors(ensemble, symtop.population(4, seed=2))
    with pytest.warns(symtop.SymtopWarning, match="is this the start of the scene"):
        symtop.errors(ensemble.drop_vars("stratum"), symtop.population(4, seed=2))
    with warnings.catch_warnings():
        before, shown_by = [*warnings.filters], warnings._showwarnmsg_impl
        with ThreadPoolExecutor(4) as threads:  # a record of warnings takes those of other threads, and may keep them
            list(threads.map(lambda _: symtop.errors(ensemble, members), range(12)))
        assert (warnings.filters, warnings._showwarnmsg_impl) == (before, shown_by)
        warnings.simplefilter("error")
        errors = symtop.errors(ensemble, members)
        permuted = ensemble.sel(component=["z", "x", "y"]).transpose()  # read by its labels
        xr.testing.assert_identical(symtop.errors(permuted, members), errors)
    with pytest.warns(symtop.SymtopWarning, match="is this the start of the scene"):
        symtop.errors(permuted.assign_coords(component=["x", "y", "z"]), members)  # the control


def test_an_axis_with_y_up_is_told_from_another_start():
    run = symtop.simulate("spheroid", "rk4", step_size=0.01, samples=5)
    x, y, z = run["axis"].values.T
    for axis, y_up in (((x, z, y), True), ((x, z, -y), True), ((y, x, z), False)):
        with pytest.warns(symtop.SymtopWarning, match="is this the start of the scene") as record:
            symtop.errors({"time": run["time"].values, "axis": np.stack(axis, axis=1)}, "spheroid")
        assert ("if y is read as up" in str(record[0].message)) is y_up


@pytest.mark.parametrize(("top", "start", "integrator"), [
    (symtop.RigidBody(1.0, 1.2, 0.6, mgl=1.0, centre=(0.1, 0.0, 1.0)), symtop.Attitude(), "vern9-fixed"),
    (symtop.SymmetricTop(1.0, 0.5, mgl=1.0), symtop.Angles(theta=1.0, phi=0.3), "rkmk-se3-4"),
    (symtop.SymmetricTop(0.5, 0.5, mgl=0.0), symtop.Angles(theta=1.0, theta_dot=-2.0, psi_dot=1e-18), "rk4"),
])  # fmt: skip
def test_momenta_of_what_has_none_are_measured_by_what_the_weight_or_the_turning_gives(top, start, integrator):
    scene = symtop.Scene("without", top, start, horizon=5.0)
    assert scene.momentum_scale == pytest.approx(1.0)  # sqrt(mgl I1), or |L|
    errors = symtop.errors(symtop.simulate(scene, integrator, step_size=0.05, guard=False, observe="axis"))
    names = ("momentum", "p_phi") if scene.of_body else ("p_phi", "p_psi")
    assert all(float(errors[name].max()) < 1e-6 for name in names)
