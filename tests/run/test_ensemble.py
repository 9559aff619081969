"""Each member of an ensemble is the run of `simulate`, to the last bit; a bad one is refused or fails alone."""

import dataclasses

import numpy as np
import pytest
import xarray as xr

import symtop
from symtop.methods.lanes import W
from symtop.methods.many import members_of
from symtop.model.closed_forms import NUMBERS, ClosedForms
from symtop.run import pieces
from symtop.run.schedule import nutation_periods, schedule
from symtop.run.simulation import sample_times

SOME = symtop.population(36, seed=5)
COUNTS = ("steps", "force_evaluations", "newton_iterations", "reached_time")


def numbers_of(members):
    columns = [members[name].values if name in members else 0.0 for name in NUMBERS]
    return np.stack([np.broadcast_to(column, members.sizes["member"]) for column in columns], axis=1)


def scene_of(members, i, horizon):
    return symtop.Scene(f"member-{i}", *next(members_of(numbers_of(members)[i : i + 1])), float(horizon))


def assert_alone(members, name, data, samples, **setting):
    """Every member is what `simulate` returns."""
    for i in range(members.sizes["member"]):
        one = data.isel(member=i)
        given = setting or {"step_size": float(one.step_size)}
        run = symtop.simulate(
            scene_of(members, i, one.horizon), name, samples=samples, guard=False, observe="attitude" if "psi" in data
            else "axis", **given,
        )  # fmt: skip
        shown = run.sizes["time"]
        for variable in run.variables:
            if variable not in ("component", "part"):
                np.testing.assert_array_equal(one[variable].values[:shown], run[variable].values, err_msg=f"{i}")
                assert np.isnan(one[variable].values[shown:]).all()
        assert str(one.outcome.values) == run.attrs["outcome"]
        assert [one[word].item() for word in COUNTS] == [run.attrs[word] for word in COUNTS]
        assert bool(one.dithered) == (run.attrs["sampling"] == "dithered")


@pytest.mark.parametrize(
    ("name", "asked", "samples"),
    [("strang[axis]", {"per_nutation": 40, "nutations": 10}, 101),
     ("strang[attitude]", {"per_nutation": 40.5, "nutations": 10.3}, 33),
     ("strang[axis]", {"step_size": 0.02, "horizon": 2.0}, 60),
     ("midpoint[angles]", {"per_nutation": 12, "nutations": 20}, 45),
     ("cayley-tuned[axis]", {"per_nutation": 12, "nutations": 3}, 20),
     ("gauss-4[attitude]", {"per_nutation": 12, "nutations": 5.5}, 50)],
)  # fmt: skip
def test_a_member_is_the_run_of_simulate_to_the_last_bit(name, asked, samples):
    data = symtop.ensemble(SOME, name, samples=samples, quiet=True, **asked)
    assert_alone(SOME, name, data, samples)
    assert data.sizes["time"] == samples


@pytest.mark.parametrize(
    ("name", "setting", "asked"),
    [("rk45-compiled[axis]", {"tolerance": 1e-8}, {}), ("rk45-compiled[angles]", {"tolerance": 1e-6}, {}),
     ("rk45", {"tolerance": 1e-4}, {}), ("exact", {}, {})],
)  # fmt: skip
def test_methods_that_choose_their_steps_run_as_well(name, setting, asked):
    some = SOME.isel(member=slice(0, 8))
    data = symtop.ensemble(some, name, nutations=2.7, samples=20, quiet=True, **setting, **asked)
    assert_alone(some, name, data, 20, **(setting or {"tolerance": None}))
    assert data.attrs["execution"] == (pieces.IN_PYTHON if name == "rk45" else pieces.IN_TURN)


@pytest.mark.slow
def test_every_method_runs_and_every_member_is_the_run_of_simulate():
    few = SOME.isel(member=slice(0, 5))
    for method in symtop.integrators().values():
        for chart in method.charts():
            row = method.row(chart)
            setting = {"tolerance": max(1e-6, row.least_tolerance)} if row.adaptive else {}
            asked = {"per_nutation": 30} if row.fixed_step else setting
            data = symtop.ensemble(few, row, nutations=1.3, samples=11, quiet=True, **asked)
            if row.speed > 0.1:
                assert_alone(few, row, data, 11, **(setting or ({} if row.fixed_step else {"tolerance": None})))


def test_threads_and_pieces_change_nothing(monkeypatch):
    asked = {"per_nutation": 20, "nutations": 3, "samples": 21, "quiet": True}
    one = symtop.ensemble(SOME, "strang[axis]", threads=1, **asked)
    monkeypatch.setattr(pieces, "PIECE", 21 * 5)
    assert symtop.ensemble(SOME, "strang[axis]", threads=3, **asked).identical(one)
    monkeypatch.setattr(pieces, "PIECE_STEPS", 100)
    assert symtop.ensemble(SOME, "strang[axis]", threads=2, **asked).identical(one)


@pytest.mark.parametrize(
    ("n", "steps", "most"),
    [(10_000, 1000, 0.1), (10_000, np.geomspace(10, 4000, 10_000).astype(int), 0.1), (10_000, None, 0.1),
     (40, 10, 1.0), (1, 10**9, 1.0), (3, 10**7, 0.4)],
)  # fmt: skip
def test_pieces_are_shares_of_the_work_and_whole_blocks(n, steps, most):
    """What is worth more than a millisecond is shared evenly; a few short runs stay in one piece."""
    counts = None if steps is None else np.broadcast_to(steps, n)
    method = symtop.integrator("strang" if steps is not None else "rk45-compiled").row("axis")
    job = pieces.Job(method, "axis", np.zeros((n, 9)), np.ones(n), counts, None, 11, None, ("axis",))
    cut = list(job.pieces())
    assert [piece.start for piece in cut] == [0, *(piece.stop for piece in cut[:-1])]
    assert cut[-1].stop == n
    work = np.ones(n) if counts is None else counts
    shares = [work[piece].sum() / work.sum() for piece in cut]
    assert 0.5 * most < max(shares) <= most
    assert all((piece.stop - piece.start) % W == 0 for piece in cut[:-1] if piece.stop - piece.start > 4 * W)


def test_scenes_are_members_with_horizons_and_units_of_their_own():
    data = symtop.ensemble(["spheroid", symtop.scene("kinon-betsch")], "strang", per_nutation=50, quiet=True)
    assert data.scene.values.tolist() == ["spheroid", "kinon-betsch"]
    assert data.horizon.values.tolist() == [8.0, 2.0]
    assert data["time"].dims == ("member", "time")
    assert "psi" in data  # as the scenes are watched for
    assert data.energy.attrs["units"] == "kg m2 s-2"
    run = symtop.simulate("kinon-betsch", "strang", step_size=float(data.step_size[1]), samples=101, guard=False)
    np.testing.assert_array_equal(data.isel(member=1).phi, run.phi)


def test_scalars_count_for_all_members_and_times_that_all_share_are_one_row():
    members = xr.Dataset({"I1": 2.0, "I3": 1.0, "mgl": 2.0, "theta": ("member", [0.3, 0.8, 1.2]), "psi_dot": 5.0})
    data = symtop.ensemble(members, "strang[axis]", step_size=0.05, horizon=3.0, samples=31, quiet=True)
    assert data["time"].dims == ("time",)
    assert data.theta.dims == ("member", "time")
    assert data.axis.dims == ("member", "time", "component")
    assert data.theta[:, 0].values == pytest.approx([0.3, 0.8, 1.2], abs=1e-15)
    assert_alone(members, "strang[axis]", data, 31)


def test_steps_and_horizons_may_differ_by_member():
    members = SOME.isel(member=slice(0, 3))
    period = nutation_periods(numbers_of(members))
    steps, ends = period / [10.0, 20.0, 35.0], period * [1.0, 2.0, 3.0]
    given = symtop.ensemble(members, "strang[axis]", step_size=steps, horizon=xr.DataArray(ends), quiet=True)
    counted = symtop.ensemble(members, "strang[axis]", per_nutation=[10, 20, 35], nutations=[1, 2, 3], quiet=True)
    assert given.steps.values.tolist() == [10, 40, 105]
    assert given.identical(counted)
    assert np.isfinite(given.theta).sum("time").values.tolist() == [11, 41, 101]


def test_a_member_that_fails_fails_alone():
    """Steps that jump over a pole, a start on a pole where the angles chart ends: the others do not notice."""
    members = symtop.population(40, seed=3)
    moved = members.copy(deep=True)
    moved.theta[4] = 0.0
    asked = {"per_nutation": 30, "nutations": 2.2, "samples": 21, "quiet": True}
    for name in ("stormer-verlet", "rk4[angles]"):
        data, other = (symtop.ensemble(some, name, **asked) for some in (members, moved))
        assert {"ok", "left_chart"} <= set(data.outcome.values.tolist())
        failed = data.isel(member=data.outcome.values == "left_chart")
        assert (failed.reached_time < failed.horizon).all()
        assert not np.isfinite(failed.theta[:, -1]).any()
        rest = np.arange(40) != 4
        assert other.isel(member=rest).identical(data.isel(member=rest))
        assert (other.outcome[4], other.steps[4], other.reached_time[4]) == ("left_chart", 0, 0.0)
        assert np.isnan(other.theta[4]).all()


@pytest.mark.parametrize(
    ("spoilt", "reason"),
    [({"I3": 5.0}, "member 2: I3 must be at most 2 I1"), ({"theta": np.nan}, "member 2: theta must be a finite number"),
     ({"theta": -0.1}, r"member 2: theta must lie in \[0, pi\]"), ({"I1": 0.0}, "member 2: I1 must be"),
     ({"mgl": np.inf}, "member 2: mgl")],
)  # fmt: skip
def test_bad_members_are_refused_by_number_and_reason(spoilt, reason):
    members = xr.Dataset({name: ("member", np.array([1.0] * 4)) for name in ("I1", "I3", "mgl", "theta")})
    for name, value in spoilt.items():
        members[name][2] = value
    with pytest.raises(symtop.SymtopError, match=reason):
        symtop.ensemble(members, "strang[axis]", step_size=0.1, horizon=1.0)


@pytest.mark.parametrize(
    ("changed", "reason"),
    [({"step_size": None}, "needs step_size or per_nutation"), ({"per_nutation": 9}, "not both"),
     ({"nutations": 2}, "not both"), ({"horizon": None}, "no horizon of their own"),
     ({"tolerance": 1e-6}, "fixed step"),
     ({"step_size": [0.1, 0.2]}, "one for each of 36 members"), ({"step_size": -1.0}, "above zero"),
     ({"step_size": [0.1] * 35 + [np.nan]}, "step_size of member 35 must be a finite number"),
     ({"step_size": 3.0}, "at most the horizon"), ({"step_size": 1e-12}, "member 0 asks for"),
     ({"samples": 1}, "samples"),
     ({"samples": 10_000_000}, "give a path to stream them"),
     ({"variables": ["psi"]}, "variables in the axis chart are theta, .* not 'psi'"),
     ({"variables": "axis"}, "a list of names"), ({"threads": 0}, "threads"), ({"observe": "phi"}, "observe"),
     ({"budget": 5}, "limit is 5")],
)  # fmt: skip
def test_settings_that_make_no_sense_are_refused(changed, reason):
    asked = {"step_size": 0.1, "horizon": 2.0, **changed}
    with pytest.raises(symtop.SymtopError, match=reason):
        symtop.ensemble(SOME, "strang[axis]", quiet=True, **asked)


@pytest.mark.parametrize(
    ("name", "changed", "reason"),
    [("rk45-compiled", {"step_size": 0.1}, "chooses its own steps"), ("rk45-compiled", {"tolerance": 2.0}, "below 1"),
     ("rk45-compiled", {}, "needs a tolerance"), ("exact", {"tolerance": 0.1}, "nothing to tune"),
     ("rk45-compiled", {"tolerance": [1e-6] * 35 + [3.0]}, "below 1"),
     ("rk45-compiled", {"tolerance": 1e-6, "horizon": 1e14}, "swings"), ("strong", {}, "did you mean strang")],
)  # fmt: skip
def test_settings_of_other_methods_are_refused(name, changed, reason):
    with pytest.raises(symtop.SymtopError, match=reason):
        symtop.ensemble(SOME, name, quiet=True, **{"horizon": 2.0, **changed})


@pytest.mark.parametrize("members", [[], "spheroid", 3, xr.Dataset({"I1": 1.0}), [symtop.scene("spheroid"), 3]])
def test_members_that_are_none_are_refused(members):
    with pytest.raises(symtop.SymtopError):
        symtop.ensemble(members, "strang", step_size=0.1, horizon=1.0)


def test_a_member_without_a_nutation_has_no_steps_per_nutation():
    hanging = {"I1": 1.0, "I3": 0.5, "mgl": -1.0, "theta": 0.0, "theta_dot": ("member", [1.9, 2.0])}
    with pytest.raises(symtop.SymtopError, match="member 1 is endless"):
        symtop.ensemble(xr.Dataset(hanging), "strang", per_nutation=20, horizon=8.0)
    data = symtop.ensemble(xr.Dataset(hanging), "strang", step_size=0.1, horizon=8.0, quiet=True)
    assert data.outcome.values.tolist() == ["ok", "ok"]


@pytest.mark.parametrize("steps", [None, 7, 40, 1000, 12_347])
@pytest.mark.parametrize("samples", [2, 9, 33, 41, 50, 101])
def test_a_schedule_has_the_rows_of_sample_times(steps, samples):
    """Commensurate samples among them: every whole and half number of samples a nutation."""
    members = symtop.population(60, seed=9)
    numbers = numbers_of(members)
    period = nutation_periods(numbers)
    horizon = period * np.resize([0.5, 2.0, 4.0, 5.0, 10.0, 12.5, 33.3], 60)
    counts = None if steps is None else np.full(60, steps) + np.arange(60) % 3
    rows = schedule(period, horizon, samples, counts)
    for i, (top, start) in enumerate(members_of(numbers)):
        times, marks, dithered = sample_times(
            float(horizon[i]), samples, top.nutation_period(start), None if counts is None else int(counts[i])
        )
        assert rows.dithered[i] == dithered
        np.testing.assert_array_equal(rows.times[i, : rows.counts[i]], times)
        assert np.isnan(rows.times[i, rows.counts[i] :]).all()
        if counts is not None:
            np.testing.assert_array_equal(rows.marks[i, : rows.counts[i]], marks)


def test_a_schedule_dithers_what_is_sampled_in_time_with_the_nutation():
    period = nutation_periods(numbers_of(symtop.population(400, seed=9)))
    assert schedule(period, period * 10.0, 51, None).dithered.mean() > 0.8  # five samples a nutation
    assert not schedule(period, period * 10.0, 201, None).dithered.any()


def test_periods_are_those_of_one_top_and_of_the_closed_form():
    numbers = numbers_of(symtop.population(300, seed=4))
    period = nutation_periods(numbers)
    assert period.tolist() == [top.nutation_period(start) for top, start in members_of(numbers)]
    np.testing.assert_allclose(period, ClosedForms(numbers).nutation_period, rtol=1e-7)


def test_a_rule_of_python_runs_its_members_by_calls_of_python():
    strang = symtop.integrator("strang[axis]")
    solver = strang.solvers["axis"]
    python = dataclasses.replace(
        strang, name="strang-python[axis]", solvers={"axis": dataclasses.replace(solver, rule=solver.rule.__call__)}
    )
    asked = {"per_nutation": 20, "nutations": 3, "samples": 21, "quiet": True}
    one, other = (symtop.ensemble(SOME, method, **asked) for method in (strang, python))
    assert (one.attrs["execution"], other.attrs["execution"]) == (pieces.IN_LANES, pieces.IN_PYTHON)
    xr.testing.assert_identical(one.drop_attrs(), other.drop_attrs())


def test_the_dataset_says_which_members_ran_side_by_side():
    strang = symtop.integrator("strang[axis]")
    solver = strang.solvers["axis"]
    in_turn = dataclasses.replace(solver, loop=dataclasses.replace(solver.loop, lanes=lambda _: None))
    without = dataclasses.replace(strang, name="strang-in-turn[axis]", solvers={"axis": in_turn})
    asked = {"per_nutation": 20, "nutations": 2, "quiet": True}
    one, other = (symtop.ensemble(SOME, method, **asked) for method in (strang, without))
    assert (one.attrs["execution"], other.attrs["execution"]) == (pieces.IN_LANES, pieces.IN_TURN)
    xr.testing.assert_identical(one.drop_attrs(), other.drop_attrs())


def test_variables_are_those_of_all_and_need_no_closed_form(monkeypatch):
    asked = {"per_nutation": 20, "nutations": 3, "quiet": True}
    wanted = symtop.ensemble(SOME, "strang[attitude]", **asked)
    monkeypatch.setattr(pieces, "ClosedForms", None)
    data = symtop.ensemble(SOME, "strang[attitude]", variables=("energy", "axis"), **asked)
    assert [name for name in data if "time" in data[name].dims] == ["axis", "energy"]
    xr.testing.assert_identical(data.axis, wanted.axis)
    xr.testing.assert_identical(data.energy, wanted.energy)
    with pytest.raises(TypeError):
        symtop.ensemble(SOME, "strang[attitude]", variables=("phi",), **asked)


def test_numbers_that_leave_the_range_fail_alone_and_other_errors_end_the_ensemble():
    rk4 = symtop.integrator("rk4[axis]")

    def solve(top, start, plan):
        if start.theta == SOME.theta[3]:
            raise (ZeroDivisionError if plan.horizon < 5.0 else TypeError)("a reason")
        return rk4.solvers["axis"](top, start, plan)

    python = dataclasses.replace(rk4, name="rk4-python[axis]", solvers={"axis": solve})
    asked = {"step_size": 0.1, "horizon": 2.0, "quiet": True}
    one, other = (symtop.ensemble(SOME, method, **asked) for method in (rk4, python))
    rest = np.arange(36) != 3
    xr.testing.assert_identical(one.isel(member=rest).drop_attrs(), other.isel(member=rest).drop_attrs())
    assert (other.outcome[3], other.reached_time[3]) == ("not_finite", 0.0)
    assert np.isnan(other.theta[3]).all()
    with pytest.raises(symtop.SymtopError, match=r"rk4-python.* on member 3 failed: TypeError: a reason"):
        symtop.ensemble(SOME, python, **asked | {"horizon": 6.0})


def test_a_fast_top_has_as_many_swings_as_simulate_says():
    """Its nutations count, where gravity alone would let it run."""
    fast = symtop.Scene("fast-one", symtop.SymmetricTop(1.0, 0.5, 1e-6), symtop.Angles(0.5, psi_dot=200.0), 2e7)
    for run in (symtop.simulate, lambda one, name, **asked: symtop.ensemble([one], name, quiet=True, **asked)):
        with pytest.raises(symtop.SymtopError, match=r"3\.18e\+08 swings"):
            run(fast, "rk45-compiled[axis]", tolerance=1e-3)
