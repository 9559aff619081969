"""Each member of an ensemble is the run of `simulate`, to the last bit; a bad one is refused or fails alone."""

import dataclasses
import pickle
from unittest.mock import Mock

import numpy as np
import pytest
import xarray as xr

import symtop
from symtop.methods.framework import lanes
from symtop.methods.framework.lanes import W, members_of
from symtop.model.exact.closed_form import NUMBERS, ClosedForms
from symtop.model.scenes import nutation_period
from symtop.run.ensemble import chunks
from symtop.run.ensemble.chunks import nutation_periods, schedule
from symtop.run.simulation import sample_times
from tests.conftest import defer

pytestmark = pytest.mark.usefixtures("in_lanes")
SOME = symtop.population(36, seed=5)
COUNTS = ("steps", "force_evaluations", "newton_iterations", "reached_time")


def numbers_of(members):
    columns = [members[name].values if name in members else 0.0 for name in NUMBERS]
    return np.stack([np.broadcast_to(column, members.sizes["member"]) for column in columns], axis=1)


def assert_alone(members, name, data, samples, **setting):
    """Every member is what `simulate` returns."""
    if isinstance(members, xr.Dataset):
        members = [symtop.Scene("one", *pair, 1.0) for pair in members_of(numbers_of(members))]
    for i, scene in enumerate(members):
        member = data.isel(member=i)
        settings = {"samples": samples, "horizon": float(member.horizon), "guard": False} | setting
        if not setting:
            settings["step_size"] = float(member.step_size)
        observe = "attitude" if {"psi", "quaternion"} & {*data} else "axis"
        run = symtop.simulate(scene, name, observe=observe, **settings)
        count = run.sizes["time"]
        for variable in run.variables:
            if variable not in ("component", "part"):
                np.testing.assert_array_equal(member[variable].values[:count], run[variable].values, err_msg=f"{i}")
                assert np.isnan(member[variable].values[count:]).all()
        assert str(member.outcome.values) == run.attrs["outcome"]
        assert [member[word].item() for word in COUNTS] == [run.attrs[word] for word in COUNTS]
        assert bool(member.dithered) == (run.attrs["sampling"] == "dithered")


@pytest.mark.parametrize(("name", "settings", "samples"), [
    ("strang[axis]", {"per_nutation": 40, "nutations": 10}, 101),
    ("strang[attitude]", {"per_nutation": 40.5, "nutations": 10.3}, 33),
    ("strang[axis]", {"step_size": 0.02, "horizon": 2.0}, 60),
    ("midpoint[angles]", {"per_nutation": 12, "nutations": 20}, 45),
    ("cayley-tuned[axis]", {"per_nutation": 12, "nutations": 3}, 20),
    *defer(("gauss-4[attitude]", {"per_nutation": 12, "nutations": 5.5}, 50)),
])  # fmt: skip
def test_a_member_is_the_run_of_simulate_to_the_last_bit(name, settings, samples):
    data = symtop.ensemble(SOME, name, samples=samples, quiet=True, **settings)
    assert_alone(SOME, name, data, samples)
    assert data.sizes["time"] == samples


@pytest.mark.parametrize(("name", "setting"), [
    ("rk45-compiled[axis]", {"tolerance": 1e-8}), ("rk45-compiled[angles]", {"tolerance": 1e-6}),
    ("rk45", {"tolerance": 1e-4}), ("exact", {}),
])  # fmt: skip
def test_methods_that_choose_their_steps_run_as_well(name, setting):
    members = SOME.isel(member=slice(0, 8))
    data = symtop.ensemble(members, name, nutations=2.7, samples=20, quiet=True, **setting)
    assert_alone(members, name, data, 20, **(setting or {"tolerance": None}))
    assert data.attrs["execution"] == (chunks.IN_PYTHON if name == "rk45" else chunks.IN_TURN)


@pytest.mark.slow
def test_every_method_runs_and_every_member_is_the_run_of_simulate():
    members = SOME.isel(member=slice(0, 5))
    for method in symtop.integrators().values():
        for chart in method.charts():
            row = method.variant(chart)
            setting = {"tolerance": max(1e-6, row.least_tolerance)} if row.adaptive else {}
            settings = {"per_nutation": 30} if row.fixed_step else setting
            data = symtop.ensemble(members, row, nutations=1.3, samples=11, quiet=True, **settings)
            if row.speed > 0.1:
                assert_alone(members, row, data, 11, **(setting or ({} if row.fixed_step else {"tolerance": None})))


def test_threads_and_pieces_change_nothing(monkeypatch):
    settings = {"per_nutation": 20, "nutations": 3, "samples": 21, "quiet": True}
    expected = symtop.ensemble(SOME, "strang[axis]", threads=1, **settings)
    monkeypatch.setattr(chunks, "CHUNK", 21 * 5)
    assert symtop.ensemble(SOME, "strang[axis]", threads=3, **settings).identical(expected)
    monkeypatch.setattr(chunks, "CHUNK_STEPS", 100)
    assert symtop.ensemble(SOME, "strang[axis]", threads=2, **settings).identical(expected)


@pytest.mark.parametrize(("n", "steps", "share"), [
    (10_000, 1000, 0.1), (10_000, np.geomspace(10, 4000, 10_000).astype(int), 0.1),
    (10_000, "rk45-compiled", 0.1), (10_000, "rk45", 0.004), (40, 10, 1.0), (1, 10**9, 1.0), (3, 10**7, 0.4),
])  # fmt: skip
def test_pieces_are_shares_of_the_work_and_whole_blocks(n, steps, share):
    """What is worth more than a millisecond is shared evenly; a few short runs stay in one piece."""
    is_name = isinstance(steps, str)
    counts, method = None if is_name else np.broadcast_to(steps, n), symtop.integrator(steps if is_name else "strang")
    members = np.zeros((n, 9)), np.ones(n), counts, None
    pieces = list(chunks.Job(method.variant("axis"), "axis", *members, 11, None, ("axis",)).chunks())
    assert [*(piece.start for piece in pieces), n] == [0, *(piece.stop for piece in pieces)]
    work = np.ones(n) if counts is None else counts
    assert 0.5 * share < max(work[piece].sum() for piece in pieces) / work.sum() <= share
    assert all((piece.stop - piece.start) % W == 0 for piece in pieces[:-1] if piece.stop - piece.start > 4 * W)


def test_scalars_count_for_all_members_and_steps_and_horizons_may_differ():
    members = xr.Dataset({"I1": 2.0, "I3": 1.0, "mgl": 2.0, "theta": ("member", [0.3, 0.8, 1.2]), "psi_dot": 5.0})
    settings = {"horizon": 2.0, "samples": 31, "quiet": True}
    for step in (0.05, 0.5):  # more steps than samples, and fewer
        data = symtop.ensemble(members, "strang[axis]", step_size=step, **settings)
        assert (data["time"].dims, data.axis.dims) == (("time",), ("member", "time", "component"))
        assert data.theta[:, 0].values == pytest.approx([0.3, 0.8, 1.2], abs=1e-15)
        assert_alone(members, "strang[axis]", data, 31)
    np.testing.assert_array_equal(data["time"], [0.0, 0.5, 1.0, 1.5, 2.0, *[np.nan] * 26])
    data = symtop.ensemble(members, "strang[axis]", step_size=[0.5, 0.5, 0.4], **settings)
    assert data["time"].dims == ("member", "time")
    members = SOME.isel(member=slice(0, 3))
    period = nutation_periods(numbers_of(members))
    steps, ends = period / [10.0, 20.0, 35.0], period * [1.0, 2.0, 3.0]
    data = symtop.ensemble(members, "strang[axis]", step_size=steps, horizon=xr.DataArray(ends), quiet=True)
    expected = symtop.ensemble(members, "strang[axis]", per_nutation=[10, 20, 35], nutations=[1, 2, 3], quiet=True)
    assert data.steps.values.tolist() == [10, 40, 105]
    assert data.identical(expected)
    assert np.isfinite(data.theta).sum("time").values.tolist() == [11, 41, 101]


def test_a_member_that_fails_fails_alone():
    """Steps that jump over a pole, a start on a pole where the angles chart ends: the others do not notice."""
    members = symtop.population(40, seed=3)
    control = members.copy(deep=True)
    control.theta[4] = 0.0
    settings = {"per_nutation": 30, "nutations": 2.2, "samples": 21, "quiet": True}
    for name in ("stormer-verlet", "rk4[angles]"):
        data, second = (symtop.ensemble(tops, name, **settings) for tops in (members, control))
        assert {"ok", "left_chart"} <= set(data.outcome.values.tolist())
        failed = data.isel(member=data.outcome.values == "left_chart")
        assert (failed.reached_time < failed.horizon).all()
        assert not np.isfinite(failed.theta[:, -1]).any()
        mask = np.arange(40) != 4
        assert second.isel(member=mask).identical(data.isel(member=mask))
        assert second.attrs["title"] == f"{name} on 40 tops"
        with pytest.warns(symtop.SymtopWarning, match="^1 of 1 members ended early: 1 left_chart$"):
            single = symtop.ensemble(control.isel(member=[4]), name, **settings | {"quiet": False})
        assert single.attrs["title"] == f"{name} on 1 top"
        assert (second.outcome[4], second.steps[4], second.reached_time[4]) == ("left_chart", 0, 0.0)
        assert np.isnan(second.theta[4]).all()


@pytest.mark.parametrize(("spoilt", "reason"), [
    ({"I3": 5.0}, "member 2: I3 must be at most 2 I1"), ({"theta": np.nan}, "member 2: theta must be a finite number"),
    ({"theta": -0.1}, r"member 2: theta must lie in \[0, pi\]"), ({"I1": 0.0}, "member 2: I1 must be"),
    ({"mgl": np.inf}, "member 2: mgl"), ({"I1": 1e308, "I3": 1e308}, "member 2: I1 must be between"),
])  # fmt: skip
def test_bad_members_are_refused_by_number_and_reason(spoilt, reason):
    members = xr.Dataset({name: ("member", np.array([1.0] * 4)) for name in ("I1", "I3", "mgl", "theta")})
    for name, value in spoilt.items():
        members[name][2] = value
    with pytest.raises(symtop.SymtopError, match=reason):
        symtop.ensemble(members, "strang[axis]", step_size=0.1, horizon=1.0)


STRANG, RK45 = "strang[axis]", "rk45-compiled"
FIXED = {"step_size": 0.1, "horizon": 2.0}


@pytest.mark.parametrize(("name", "settings", "reason"), [
    (STRANG, {"horizon": 2.0}, "needs step_size or per_nutation"), (STRANG, FIXED | {"per_nutation": 9}, "not both"),
    (STRANG, FIXED | {"tolerance": 1e-6}, "fixed step"),
    (STRANG, FIXED | {"step_size": [0.1, 0.2]}, "one for each of 36 members"),
    (STRANG, FIXED | {"step_size": [0.1] * 35 + [np.nan]}, "step_size of member 35 must be a finite number"),
    (STRANG, FIXED | {"step_size": 1e-12}, "member 0 asks for"),
    (STRANG, FIXED | {"variables": ["psi"]}, "variables in the axis chart are theta, .* not 'psi'"),
    (STRANG, FIXED | {"variables": np.array(1)}, "a list of names"), (STRANG, FIXED | {"budget": 5}, "limit is 5"),
    (STRANG, {"nutations": 2, "per_nutation": 0.3}, "per_nutation must be at least 0.5.* not 0.3 as of member 0"),
    (STRANG, {"nutations": 1e308, "per_nutation": 20}, "nutations must be fewer"),
    (RK45, FIXED, "chooses its own steps"), (RK45, {"horizon": 2.0, "tolerance": 2.0}, "below 1"),
    (RK45, {"horizon": 2.0, "tolerance": [1e-6] * 35 + [3.0]}, "below 1"),
    (RK45, {"horizon": 1e14, "tolerance": 1e-6}, "swings"),
    ("exact", {"horizon": 2.0, "tolerance": 0.1}, "nothing to tune: leave out tolerance = 0.1"),
    ("strong", FIXED, "did you mean strang"), ("rk4[axe", FIXED, "did you mean rk4 or"),
])  # fmt: skip
def test_settings_that_make_no_sense_are_refused_as_they_were_given(name, settings, reason):
    with pytest.raises(symtop.SymtopError, match=reason):
        symtop.ensemble(SOME, name, quiet=True, **settings)


@pytest.mark.parametrize("steps", [None, 7, 40, 1000, 12_347])
@pytest.mark.parametrize("samples", [2, 9, 33, 41, 50, 101])
def test_a_schedule_has_the_rows_of_sample_times(steps, samples):
    """Commensurate samples among them: every whole and half number of samples a nutation."""
    period = nutation_periods(numbers_of(symtop.population(60, seed=9)))
    horizon = period * np.resize([0.5, 2.0, 4.0, 5.0, 10.0, 12.5, 33.3], 60)
    counts = None if steps is None else np.full(60, steps) + np.arange(60) % 3
    rows = schedule(period, horizon, samples, counts)
    for i in range(60):
        times, marks, dithered = sample_times(float(horizon[i]), samples, float(period[i]),
                                              None if counts is None else int(counts[i]))  # fmt: skip
        assert rows.dithered[i] == dithered
        np.testing.assert_array_equal(rows.times[i, : rows.counts[i]], times)
        assert np.isnan(rows.times[i, rows.counts[i] :]).all()
        if counts is not None:
            np.testing.assert_array_equal(rows.marks[i, : rows.counts[i]], marks)


def test_periods_are_those_of_one_top_and_one_without_a_nutation_has_no_steps_per_nutation(monkeypatch):
    hanging = {"I1": 1.0, "I3": 0.5, "mgl": -1.0, "theta": 0.0, "theta_dot": ("member", [1.9, 2.0])}
    with pytest.raises(symtop.SymtopError, match="member 1 is endless"):
        symtop.ensemble(xr.Dataset(hanging), "strang", per_nutation=20, horizon=8.0)
    data = symtop.ensemble(xr.Dataset(hanging), "strang", step_size=0.1, horizon=8.0, quiet=True)
    assert data.outcome.values.tolist() == ["ok", "ok"]
    numbers = numbers_of(symtop.population(300, seed=4))
    numbers[::7, 2] = 0.0  # some are free, and some begin beside a pole
    numbers[1::7] = 1.0, 1.0, 1.0, 1e-8, 0.0, 0.0, 0.0, 0.0, 1.0
    monkeypatch.setattr(chunks._periods, "compiled", None)
    monkeypatch.setattr(chunks._periods, "_spent", 0.0)
    period = nutation_periods(numbers)
    assert chunks._periods.compiled is None  # few are interpreted
    assert nutation_periods(np.tile(numbers, (8, 1))).tolist() == 8 * period.tolist()
    assert chunks._periods.compiled is not None
    assert period.tolist() == [nutation_period(*pair) for pair in members_of(numbers)]
    assert (period != [top.nutation_period(start) for top, start in members_of(numbers)]).sum() > 5
    np.testing.assert_allclose(period, ClosedForms(numbers).nutation_period, rtol=1e-7)
    chunks._periods.compiled(numbers_of(symtop.population(300, seed=4)), period)
    assert np.signbit(period).mean() < 0.05  # few need the closed form, which takes 4 us


def test_kernels_in_lanes_wait_for_many_steps_unless_they_are_stored_and_change_no_bit(monkeypatch):
    """36 members of 60 steps."""
    settings = {"per_nutation": 20, "nutations": 3, "samples": 9, "quiet": True}
    first, blocks = symtop.ensemble(SOME, STRANG, **settings), symtop.integrator(STRANG).solvers["axis"]._whole.blocks()
    run = Mock(side_effect=blocks.run)
    cases = (False, 5000, 0, 0), (False, 5000, 2160, 0), (False, 5000, 4320, 1), (True, 5000, 0, 2), (False, 2100, 0, 4)
    for stored, limit, before, calls in cases:  # the last in two chunks, each of fewer steps
        for place, change in ((lanes, {"is_stored": {blocks.march: stored}.get, "FEW_STEPS": limit}),
                              (chunks, {"LEAST_STEPS": limit}), (blocks, {"run": run, "asked": before})):  # fmt: skip
            for name, value in change.items():
                monkeypatch.setattr(place, name, value)
        assert symtop.ensemble(SOME, STRANG, **settings).identical(first)
        assert (run.call_count, blocks.asked) == (calls, before + 2160 * (limit == 5000))


def marching(solver):
    """Its loop in plain Python, which is given marks that increase."""

    def march(par, rule, state, h, marks):
        assert (np.diff(marks) > 0).all()
        return solver.loop(par, rule, state, h, marks)

    return march


@pytest.mark.parametrize(("change", "execution"), [
    (lambda solver: {"rule": solver.rule.__call__}, chunks.IN_PYTHON),
    (lambda solver: {"loop": marching(solver)}, chunks.IN_PYTHON),
    (lambda solver: {"loop": dataclasses.replace(solver.loop, lanes=lambda _: None)}, chunks.IN_TURN),
], ids=["rule of Python", "loop of Python", "without lanes"])  # fmt: skip
def test_the_dataset_says_how_members_were_run_and_they_are_the_same(change, execution):
    """Members of fewer steps than samples, too, whose rows of marks end before those of others."""
    strang = symtop.integrator("strang[axis]")
    solver = dataclasses.replace(strang.solvers["axis"], **change(strang.solvers["axis"]))
    variant = dataclasses.replace(strang, name="mine[axis]", solvers={"axis": solver})
    settings = {"per_nutation": np.linspace(5.0, 40.0, 36), "nutations": 3, "samples": 41, "quiet": True}
    first, second = (symtop.ensemble(SOME, method, **settings) for method in (strang, variant))
    assert (first.attrs["execution"], second.attrs["execution"]) == (chunks.IN_LANES, execution)
    xr.testing.assert_identical(first.drop_attrs(), second.drop_attrs())


def test_variables_are_those_of_all_and_need_no_closed_form(monkeypatch):
    settings = {"per_nutation": 20, "nutations": 3, "quiet": True}
    expected = symtop.ensemble(SOME, "strang[attitude]", **settings)
    monkeypatch.setattr(chunks, "ClosedForms", None)
    data = symtop.ensemble(SOME, "strang[attitude]", variables=("energy", "axis"), **settings)
    assert [name for name in data if "time" in data[name].dims] == ["axis", "energy"]
    xr.testing.assert_identical(data.axis, expected.axis)
    xr.testing.assert_identical(data.energy, expected.energy)
    data = symtop.ensemble(SOME, "strang[attitude]", **settings)  # nor does phi, before it is read
    xr.testing.assert_identical(data.theta, expected.theta)
    with pytest.raises(TypeError):
        data.phi.values  # noqa: B018


@pytest.mark.parametrize("name", ["strang[axis]", "strang[attitude]"])
def test_angles_are_made_when_they_are_read_with_the_bits_of_a_file(name, tmp_path, monkeypatch):
    settings = {"per_nutation": 20, "nutations": 3, "samples": 7, "quiet": True}
    data, second = (symtop.ensemble(SOME, name, **settings) for _ in range(2))
    angles = [angle for angle in ("phi", "psi") if angle in data]
    with symtop.ensemble(SOME, name, path=tmp_path / "runs.nc", **settings) as written:
        expected = {angle: written[angle].values for angle in angles}
    assert any(np.abs(values).max() > np.pi for values in expected.values())  # more than a turn
    for angle in angles:
        np.testing.assert_array_equal(pickle.loads(pickle.dumps(data))[angle], expected[angle])
        np.testing.assert_array_equal(data[angle].isel(member=[3, 30], time=slice(2, 5)), expected[angle][[3, 30], 2:5])
        np.testing.assert_array_equal(data[angle].isel(member=4, time=-1), expected[angle][4, -1])
    xr.testing.assert_identical(data.isel(member=slice(5, 30)).phi, second.load().phi.isel(member=slice(5, 30)))
    monkeypatch.setattr(chunks, "ClosedForms", None)  # what has been read is kept
    second["phi"][2, 1] = 9.0
    assert second.phi.values[2, 1] == 9.0


def raising(error, *bad):
    """A method that raises an error on some members."""
    rk4 = symtop.integrator("rk4[axis]")

    def solve(top, start, plan):
        if start.theta in SOME.theta.values[[*bad]]:
            raise error("a reason")
        return rk4.solvers["axis"](top, start, plan)

    return dataclasses.replace(rk4, name="rk4-python[axis]", solvers={"axis": solve})


def test_numbers_that_leave_the_range_fail_alone():
    settings = {"step_size": 0.1, "horizon": 2.0, "quiet": True}
    base, data = (symtop.ensemble(SOME, method, **settings) for method in ("rk4[axis]", raising(ZeroDivisionError, 3)))
    mask = np.arange(36) != 3
    xr.testing.assert_identical(base.isel(member=mask).drop_attrs(), data.isel(member=mask).drop_attrs())
    assert (data.outcome[3], data.reached_time[3]) == ("not_finite", 0.0)
    assert np.isnan(data.theta[3]).all()
    assert "raised" not in data.attrs


@pytest.mark.parametrize("path", [None, "runs.nc"])
def test_a_member_on_which_a_solver_raises_is_lost_alone_and_told(path, tmp_path, monkeypatch):
    monkeypatch.setattr(chunks, "CHUNK", 21 * 5)
    options = {} if path is None else {"path": tmp_path / path}
    settings = {"step_size": 0.1, "horizon": 2.0, "samples": 21, "quiet": True, **options}
    expected = symtop.ensemble(SOME, "rk4[axis]", **settings).load()
    expected.close()
    for members, name in ((SOME, "3"), (SOME.assign_coords(member=[f"m{i}" for i in range(36)]), "m3")):
        first = rf"rk4-python\[axis\] on member {name} failed: TypeError: a reason"
        with pytest.warns(symtop.SymtopWarning, match=f"2 of 36 members raised an exception, the first: .*{first}"):
            data = symtop.ensemble(members, raising(TypeError, 3, 30), **settings).load()
        data.close()
        assert ("raised" in data.attrs) == (path is None)
        assert np.flatnonzero(data.outcome == "raised").tolist() == [3, 30]
        assert np.isnan(data.theta[3]).all()
        mask, bare = ~np.isin(np.arange(36), [3, 30]), data.drop_vars("member", errors="ignore")
        xr.testing.assert_identical(expected.isel(member=mask).drop_attrs(), bare.isel(member=mask).drop_attrs())


@pytest.mark.parametrize(("name", "meant"), [
    ("thetadot", "theta_dot"), ("dphi_dt", "phi_dot"), ("psi_rate", "psi_dot"), ("Phi", "phi"), ("theta0", "theta"),
    ("phi_dto", "phi_dot"),
])  # fmt: skip
def test_a_misspelled_variable_of_members_is_refused(name, meant):
    settings = {"per_nutation": 20, "nutations": 2, "quiet": True}
    for members in (SOME.rename({meant: name}), SOME.assign({name: 1.0}), SOME.assign_coords({name: SOME.theta})):
        if meant == "theta" and meant not in members:
            continue  # it is needed, and its lack is told
        with pytest.raises(symtop.SymtopError, match=rf"members have no variable '{name}'; did you mean {meant}\?"):
            symtop.ensemble(members, "strang[axis]", **settings)


def test_members_may_have_labels_of_any_other_name_and_rows_are_taken_by_label():
    settings = {"per_nutation": 20, "nutations": 2, "quiet": True}
    names = ("period", "weight", "phase", "p_phi", "theta_max", "group", "steps")
    members = SOME.assign(dict.fromkeys(names, SOME.I1)).assign(curve=("place", [1.0, 2.0]))
    expected = symtop.ensemble(SOME, "strang[axis]", **settings)
    assert symtop.ensemble(members, "strang[axis]", **settings).identical(expected)
    counts, settings = np.linspace(10.0, 45.0, 36), {"nutations": 2, "quiet": True}
    expected = symtop.ensemble(SOME, "strang[axis]", per_nutation=counts, **settings)
    for labels in ([f"m{i}" for i in range(36)], list(range(100, 136))):
        members, row = SOME.assign_coords(member=labels), xr.DataArray(counts, {"member": labels}, "member")
        for values in (row, row[::-1], counts):
            data = symtop.ensemble(members, "strang[axis]", per_nutation=values, **settings)
            assert data.member.values.tolist() == labels
            assert data.drop_vars("member").identical(expected)
    assert not symtop.ensemble(SOME, "strang[axis]", per_nutation=counts[::-1], **settings).identical(expected)
    row, settings = xr.DataArray([1e-4, 1e-6, 1e-8] * 12, {"member": labels}, "member"), settings | {"nutations": 1}
    first, second = (symtop.ensemble(members, RK45, tolerance=tolerance, **settings) for tolerance in (row, row[::-1]))
    assert first.identical(second)
    assert first.steps[0] < first.steps[2]


@pytest.mark.parametrize("name", ["step_size", "per_nutation", "horizon", "nutations"])
def test_rows_of_others_are_refused(name):
    labels = [f"m{i}" for i in range(36)]
    members, values = SOME.assign_coords(member=labels), np.full(36, 5.0)
    options = {"step_size": 0.1} if name in ("horizon", "nutations") else {"horizon": 9.0}
    for row, reason in (
        (xr.DataArray(values, {"member": range(36)}, "member"), "the labels of the 36 members"),
        (xr.DataArray(values, {"member": ["m0"] * 36}, "member"), "the labels of the 36 members"),
        (xr.DataArray(values, dims="time"), "a row over member, not over time"),
        (np.ma.masked_array(values, [True] + [False] * 35), "without a mask"),
        (xr.DataArray(-values, {"member": labels}, "member"), f"{name} of member m0 must be above zero"),
    ):
        with pytest.raises(symtop.SymtopError, match=reason):
            symtop.ensemble(members, "strang[axis]", quiet=True, **options, **{name: row})


def test_a_solver_that_raises_on_every_member_is_refused_and_an_ensemble_for_a_cluster_before_it_is_sent(tmp_path):
    method = raising(TypeError, *range(36))
    for options in ({}, {"path": tmp_path / "runs.nc"}):
        with pytest.raises(symtop.SymtopError, match=r"on member 0 failed: TypeError: a reason"):
            symtop.ensemble(SOME, method, step_size=0.1, horizon=2.0, quiet=True, **options)
    assert list(tmp_path.iterdir()) == []
    settings = {"step_size": 0.1, "horizon": 2.0, "quiet": True, "path": tmp_path / "runs.nc"}
    with pytest.raises(symtop.SymtopError, match=r"scheduler must be the address of a dask scheduler.* not 5"):
        symtop.ensemble(SOME, "strang", scheduler=5, **settings)
    method = symtop.composition("own-split", [0.5, 0.5], [0.25, 0.5, 0.25])
    with pytest.raises(symtop.SymtopError, match=r"own-split.* cannot be sent to other processes: register it"):
        symtop.ensemble(SOME, method, scheduler="tcp://127.0.0.1:1", **settings)
    assert list(tmp_path.iterdir()) == []


def test_scenes_are_members_with_horizons_of_their_own_and_swings_as_simulate_says():
    data = symtop.ensemble(["spheroid", symtop.scene("kinon-betsch")], "strang", per_nutation=50, quiet=True)
    assert (data.scene.values.tolist(), data.horizon.values.tolist()) == (["spheroid", "kinon-betsch"], [8.0, 2.0])
    assert data["time"].dims == ("member", "time")
    assert "psi" in data  # as the scenes are watched for
    assert data.energy.attrs["units"] == "kg m2 s-2"
    run = symtop.simulate("kinon-betsch", "strang", step_size=float(data.step_size[1]), samples=101, guard=False)
    np.testing.assert_array_equal(data.isel(member=1).phi, run.phi)
    # Its nutations count, where gravity alone would let it run.
    scene = symtop.Scene("fast-one", symtop.SymmetricTop(1.0, 0.5, 1e-6), symtop.Angles(0.5, psi_dot=200.0), 2e7)
    for run in (symtop.simulate, lambda top, name, **settings: symtop.ensemble([top], name, quiet=True, **settings)):
        with pytest.raises(symtop.SymtopError, match=r"3\.18e\+08 swings"):
            run(scene, "rk45-compiled[axis]", tolerance=1e-3)
