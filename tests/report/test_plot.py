"""plot() of the errors of a run, of a foreign trajectory and of ensembles, whose errors are those of each member."""

import matplotlib.pyplot as plt
import numpy as np
import pytest

import symtop
from symtop.report.plot import draw_ensemble
from symtop.report.spread import LEVELS, _energy_scales, at_places, largest, member_errors, spread
from symtop.report.style import save
from tests.commands import call


def test_errors_are_drawn_as_the_run_and_a_trajectory_of_no_integrator_and_without_time_refused():
    run = symtop.simulate("goldstein", "midpoint", step_size=0.02, horizon=10.0, samples=51, guard=False)
    errors = symtop.errors(run)
    ax = symtop.plot(errors)
    line, bound = ax.get_lines()
    assert np.array_equal(line.get_ydata(), errors["axis"].values[1:])
    assert np.array_equal(line.get_ydata(), symtop.plot(run).get_lines()[0].get_ydata())
    assert line.get_color() == symtop.plot(run).get_lines()[0].get_color()
    assert bound.get_ydata().max() < 1e-9 < line.get_ydata().max()
    symtop.plot(symtop.simulate("goldstein", "rk4[axis]", step_size=0.02, horizon=10.0, guard=False), ax)
    assert (ax.get_title(), ax.get_legend_handles_labels()[1]) == ("", ["midpoint[angles]", "rk4[axis]"])
    assert symtop.plot(errors, quantity="energy").get_ylabel() == "energy error / energy of the nutation"
    errors = symtop.errors({"time": run["time"].values, "axis": run["axis"].values}, "goldstein")
    assert np.array_equal(symtop.plot(errors).get_lines()[0].get_ydata(), errors["axis"].values[1:])
    with pytest.raises(symtop.SymtopError, match="does not show the attitude; it shows axis"):
        symtop.plot(errors, quantity="attitude")
    with pytest.raises(symtop.SymtopError, match="must have the dimension time"):
        symtop.plot(symtop.reference("goldstein", [1.0]).isel(time=0, drop=True))


@pytest.mark.parametrize(("n", "per_nutation"), [(1, 1), (40, 2)])
def test_an_ensemble_of_short_runs_is_drawn_over_time(n, per_nutation):
    tops = symtop.population(n, seed=3)
    runs = symtop.ensemble(tops, "strang", per_nutation=per_nutation, nutations=1, quiet=True)
    ax = symtop.plot(runs, members=tops)
    times = ax.get_lines()[0].get_xdata()
    assert (times.size, times[-1]) == (per_nutation, pytest.approx(runs["horizon"].item() if n == 1 else 1.0))
    middle = spread(at_places(runs, member_errors(tops, runs, "axis"))[1], (0.5,))[0, -per_nutation:]
    np.testing.assert_array_equal(ax.get_lines()[0].get_ydata(), middle)
    ax.figure.canvas.draw()


@pytest.mark.parametrize(("quantity", "limit"), [("axis", np.pi), ("energy", 1e3)])
def test_failed_runs_are_named_and_angles_end_at_pi(quantity, limit):
    tops = symtop.population(60, seed=0)
    for name, fail in (("stormer-verlet", True), ("strang", False)):
        runs = symtop.ensemble(tops, name, per_nutation=30, nutations=2, quiet=True)
        ax = symtop.plot(runs, members=tops, quantity=quantity)
        texts = [text.get_text() for text in ax.texts]
        assert texts == ["1 %", "10 %", "median", *(f"{level} %{': failed' * fail}" for level in (90, 99))]
        heights = np.concatenate([band.get_paths()[0].vertices[:, 1] for band in ax.collections])
        assert heights.max() <= limit
        assert (heights.max() == limit) == fail


def test_one_integrator_or_scene_of_a_sweep_is_drawn():
    options = {"step_size": [0.1, 0.05], "tolerance": [1e-3, 1e-6], "horizon": 4.0, "quiet": True}
    sweep = symtop.sweep(["spheroid", "goldstein"], ["rk4", "rk45"], **options)
    full = {line.get_label(): line for line in symtop.plot(sweep, plt.figure().gca(), x="steps").get_lines()}
    assert len(full) == 4
    assert {key.split()[-1]: line.get_linestyle() for key, line in full.items()} == {"spheroid": "-", "goldstein": "--"}
    for part in (sweep.isel(variant=0), sweep.isel(scene=1), sweep.isel(variant=0, scene=1)):
        lines = symtop.plot(part, plt.figure().gca(), x="steps").get_lines()
        assert len(lines) == (2 if "scene" in part.dims else 1) * (2 if "variant" in part.dims else 1)
        labels = [line.get_label() for line in lines]
        if "scene" not in part.dims:
            labels = [f"{label} on goldstein" for label in labels]
        for label, line in zip(labels, lines, strict=True):
            assert np.array_equal(line.get_ydata(), full[label].get_ydata())
    with pytest.raises(symtop.SymtopError, match="a sweep must have the scenes that it compares"):
        symtop.plot(sweep.isel(scene=0, drop=True), plt.figure().gca())


@pytest.mark.parametrize(("step", "count"), [(8.0, 0), (1.0, 0), (0.5, 6)])
def test_a_run_that_fails_in_its_first_step_is_drawn(step, count, tmp_path, monkeypatch):
    """Lines without a number are left out, and one with a single one has a marker."""
    drawn = []
    monkeypatch.setattr("symtop.report.style.save", lambda figure, path: (save(figure, path), drawn.append(figure)))
    call("run", "spheroid", "midpoint", "--step-size", step, "--no-guard", "--figure", tmp_path / "f.png", code=3)
    errors = [line for line in drawn[0].axes[1].get_lines() if line.get_label() != "stopped here"]
    assert [np.isfinite(line.get_ydata()).sum() for line in errors] == [count] * (3 if count else 0)
    lines = {line.get_label(): line for axis in drawn[0].axes for line in axis.get_lines()}
    assert lines["true theta"].get_ydata()[0] == pytest.approx(np.degrees(symtop.scene("spheroid").start.theta))
    assert lines["stopped here"].get_xdata()[0] == (3.0 if count else 0.0)
    assert not count or np.nanmin(lines["residual of energy, relative"].get_ydata()) > 1e-3  # the energy is less


@pytest.mark.parametrize(("samples", "marker"), [(2, "o"), (3, "None")])
def test_a_single_sample_is_a_point(samples, marker, tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr("symtop.report.style.save", lambda figure, _: drawn.append(figure))
    call("run", "spheroid", "rk4", "--step-size", 0.01, "--samples", samples, "--figure", tmp_path / "f.png")
    assert {line.get_marker() for axis in drawn[0].axes[1:] for line in axis.get_lines()} == {marker}
    run = symtop.simulate("spheroid", "rk4", step_size=0.01, samples=samples)
    assert symtop.plot(run).lines[0].get_marker() == marker


def test_runs_of_different_lengths_are_drawn_forwards_and_what_is_no_ensemble_is_refused():
    tops = symtop.population(40, seed=3)
    runs = symtop.ensemble(tops, "strang", per_nutation=[2] * 20 + [100] * 20, nutations=2, samples=50, quiet=True)
    times = symtop.plot(runs, members=tops).get_lines()[0].get_xdata()
    assert (np.diff(times) > 0.0).all()
    assert times[0] == pytest.approx(0.25, abs=0.03)  # not before all have made a step
    assert times[-1] == pytest.approx(1.0)
    tops = symtop.population(3, seed=1)
    runs = symtop.ensemble(tops, "strang", per_nutation=20, nutations=1, samples=5, quiet=True)
    for data in (tops, symtop.errors(runs, tops), runs.drop_attrs(), runs.drop_vars("horizon")):
        with pytest.raises(symtop.SymtopError, match="data over member must be a dataset of ensemble"):
            symtop.plot(data, members=tops)
    symtop.plot(runs, members=tops)  # the control


SOME = symtop.population(30, seed=7)
ASKED = {"per_nutation": 30, "nutations": 2, "samples": 41, "quiet": True}


def test_quantiles_are_members_failed_ones_infinitely_wrong_and_samples_a_run_has_not_no_errors(monkeypatch):
    data = symtop.ensemble(symtop.population(200, seed=3), "stormer-verlet", **ASKED)
    errors, failed = member_errors(symtop.population(200, seed=3), data, "axis"), data.outcome.values != "ok"
    assert 0 < failed.sum() < 100
    np.testing.assert_array_equal(np.isinf(largest(errors)), failed)
    monkeypatch.setattr("symtop.report.style.save", lambda *_: None)
    draw_ensemble(data, {"axis": errors}, "f.png")
    assert f"{100.0 * (1.0 - failed.mean()):.4g} % of the runs ended ok" in " ".join(plt.gcf().get_suptitle().split())
    quantiles = spread(errors)
    assert quantiles.shape == (len(LEVELS), 41)
    assert np.isfinite(quantiles[2]).all()
    assert np.isinf(quantiles[4, -1])  # more than 1 % have failed
    assert np.isin(quantiles[:, -1], errors[:, -1]).all()
    np.testing.assert_array_equal(np.sort(quantiles, axis=0), quantiles)
    errors = np.array([[0.0, 1.0, np.nan], [0.0, 3.0, 5.0], [0.0, 2.0, np.nan]])
    np.testing.assert_array_equal(spread(errors, (0.0, 0.5, 1.0)), [[0.0, 1.0, 5.0], [0.0, 2.0, 5.0], [0.0, 3.0, 5.0]])
    assert np.isnan(spread(np.full((2, 1), np.nan))).all()
    assert largest(errors).tolist() == [1.0, 5.0, 2.0]


def test_errors_at_a_place_are_those_of_the_same_time():
    """Runs of 4, 5 and 40 steps: at each place the latest sample of each, from where all of them have stepped."""
    members = SOME.isel(member=slice(3))
    data = symtop.ensemble(members, "strang[axis]", per_nutation=[4, 5, 40], nutations=1, samples=101, quiet=True)
    errors = member_errors(members, data, "axis")
    places, latest = at_places(data, errors)
    np.testing.assert_allclose(places, np.arange(10, 41) / 40.0, atol=1e-12)
    assert np.isfinite(latest).all()
    np.testing.assert_array_equal(latest[2], errors[2, 10:41])
    for i, steps in enumerate((4, 5)):
        np.testing.assert_array_equal(latest[i], errors[i, np.floor(places * steps + 1e-6).astype(int)])
    assert not np.array_equal(latest[0], errors[0, 10:41])  # as samples of the same index would be


def test_errors_are_those_of_the_ensemble_and_runs_of_all_samples_are_compared_by_index():
    data = symtop.ensemble(SOME, "strang[axis]", **ASKED)
    errors = symtop.errors(data, SOME)
    np.testing.assert_allclose(member_errors(SOME, data, "axis"), errors["axis"], rtol=1e-6, atol=1e-14)
    part = slice(None, None, 7)  # none of them begins beside a pole, where the start's own energy is rounded
    np.testing.assert_allclose(member_errors(SOME, data, "energy")[part], errors["energy"][part], rtol=1e-6, atol=1e-13)
    upright = symtop.Scene("still", symtop.SymmetricTop(1.0, 0.5, 1.0), symtop.Angles(0.0, psi_dot=0.1), 1.0)
    assert _energy_scales(np.array([[1.0, 0.5, 1.0, *[0.0] * 5, 0.1]]))[0] == pytest.approx(upright.energy_scale)
    places, values = at_places(data, errors := member_errors(SOME, data, "axis"))
    assert values is errors
    np.testing.assert_allclose(places, np.arange(41) / 40.0, atol=0.013)  # half an interval
    short = symtop.ensemble(SOME, "strang[axis]", **ASKED | {"per_nutation": 2, "nutations": 2})
    places, values = at_places(short, member_errors(SOME, short, "axis"))
    np.testing.assert_allclose(places, [0.25, 0.5, 0.75, 1.0], atol=1e-12)
    np.testing.assert_array_equal(values, member_errors(SOME, short, "axis")[:, 1:5])


def test_members_of_other_labels_are_refused():
    first, second = (SOME.assign_coords(member=labels) for labels in (range(30), range(30, 60)))
    data = symtop.ensemble(first, "strang[axis]", **ASKED)
    assert np.array_equal(member_errors(SOME, data, "axis"), member_errors(first, data, "axis"))
    with pytest.raises(symtop.SymtopError, match="their labels are others"):
        member_errors(second, data, "axis")


@pytest.mark.parametrize(("members", "quantity", "reason"), [
    (SOME, "phi", "quantity 'phi' is unknown"), (SOME.isel(member=slice(3)), "axis", "members must be the 30"),
    (SOME, "energy", "without the variable energy"),
])  # fmt: skip
def test_what_cannot_be_compared_is_refused(members, quantity, reason):
    data = symtop.ensemble(SOME, "strang[axis]", variables=["axis"], **ASKED)
    with pytest.raises(symtop.SymtopError, match=reason):
        member_errors(members, data, quantity)
