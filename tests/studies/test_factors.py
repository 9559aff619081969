"""The factorial of method, formulation, language and call: equal accuracy, one factor at a time, measured times."""

import itertools
import math
import operator

import numpy as np
import pandas as pd
import pytest
from symtop_studies import fresh_process
from symtop_studies.factors import cells as grid, facts, figures, measures, plain_numpy
from symtop_studies.factors.cells import CALLS, COMPILED, DORMAND_PRINCE, KERNEL, LANGUAGES, NUMPY, SCIPY_PYTHON, cells
from symtop_studies.factors.facts import FACTORS, GOAL, charts, effects, fastest, first_goal, pairs, timed, waterfall
from symtop_studies.factors.measures import LEAST, Goal, factorial, settle

import symtop
from symtop.measure import settings
from symtop.measure.datasets import combine
from symtop.methods.framework.equations import FORMULATIONS
from symtop.report.formats import number
from tests.templates import checked_page

SCENE = symtop.scene("spheroid")
SHORT = Goal(3.0, 1e-5, LANGUAGES, CALLS)


@pytest.fixture(scope="module")
def dataset():
    """A small factorial as the study's functions see it; the second process is this one, which has started."""
    functions = iter([fresh_process.call, operator.call])

    def call(*args):
        return next(functions)(*args)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(measures, "TRIES", 1)
        patch.setattr(fresh_process, "call", call)
        data = factorial(SCENE, [DORMAND_PRINCE, "Takahashi-Imada"], [SHORT], 2, 0.001, 2)
    return combine([(symtop.Case("spheroid", "together"), data)])


@pytest.fixture(scope="module")
def quiet(dataset):
    """The same with times that agree from process to process."""
    return dataset.assign({"spread": dataset["spread"].where(~np.isfinite(dataset["spread"]), 0.01)})


@pytest.fixture(scope="module")
def rows(dataset):
    return timed(dataset)


@pytest.mark.parametrize(("plain", "name"), [(plain_numpy.RK4, "rk4"), (plain_numpy.STRANG, "strang")])
def test_the_loops_in_numpy_return_the_trajectory_of_the_compiled_ones(plain, name):
    for chart in plain.charts():
        plan = {"step_size": 0.01, "horizon": 4.0, "guard": False}
        mine, theirs = (symtop.simulate("goldstein", row, **plan) for row in (plain.variant(chart), f"{name}[{chart}]"))
        for quantity in ("axis", "energy", "p_phi", "p_psi"):
            np.testing.assert_allclose(mine[quantity], theirs[quantity], atol=1e-12)
        assert mine.attrs["force_evaluations"] == theirs.attrs["force_evaluations"]
        control = symtop.simulate("goldstein", f"{name}[{chart}]", **plan | {"step_size": 0.02})
        gap = np.abs(mine["axis"].values[-1] - control["axis"].values[-1]).max()
        assert gap > 1e-9  # the control: another step is another trajectory


def test_a_cell_is_named_once_and_taylor_in_angles_solves_the_same_equations():
    all_cells = cells()
    assert len({cell.name for cell in all_cells}) == len({cell.key for cell in all_cells}) == len(all_cells)
    for cell in all_cells:
        assert cell.method.charts() == (cell.chart,)
        assert (cell.method.implementation == "compiled") == (cell.language == COMPILED)
    schemes = {cell.scheme for cell in all_cells}
    compiled = {cell.scheme for cell in all_cells if cell.language == COMPILED}
    assert {scheme for members in grid.FAMILIES.values() for scheme in members} == compiled == schemes - {"DOP853"}
    hy = pytest.importorskip("heyoka")
    assert {cell.chart for cell in all_cells if cell.scheme == "Taylor"} == {*FORMULATIONS}
    from symtop.methods.taylor.heyoka import equations

    scene = symtop.scene("goldstein")
    par, state = FORMULATIONS["angles"].prepare(scene.top, scene.start)
    names, sides = zip(*equations("angles"), strict=True)
    slopes = hy.cfunc(list(sides), list(names))(np.array(state), pars=np.array([1.0 / par.I1, par.mgl, par.I3]))
    np.testing.assert_allclose(slopes, FORMULATIONS["angles"].field(par, state), rtol=1e-14, atol=1e-14)
    run = symtop.simulate(scene, grid.taylor_in_angles(), horizon=10.0)
    assert run.attrs["chart"] == "angles"
    assert float(symtop.errors(run)["attitude"].max()) < 1e-11
    assert 0.0 < float(np.ptp(run["p_phi"].values)) < 1e-12  # free to drift, by rounding


@pytest.mark.quick
def test_the_search_ends_closer_if_asked_and_languages_of_one_method_have_the_same_setting_and_work(dataset):
    horizon = 10.0 * SCENE.nutation_period
    for name in ("rk4[axis]", "rk4[attitude]", "strang[axis]"):
        answers = settings.search(SCENE, symtop.integrator(name), 1e-5, "axis", horizon, least=LEAST)
        assert LEAST * 1e-5 <= answers.error <= 1e-5
    part = dataset.isel(scene=0, horizon=0, target=0)
    for chart in ("angles", "axis", "attitude"):
        trio = [part.sel(variant=f"{name}[{chart}]") for name in ("rk45-compiled", "rk45", "rk45-numba")]
        assert len({float(row["setting"]) for row in trio}) == 1
        assert len({float(row["force_evaluations"]) for row in trio}) == 1
        np.testing.assert_allclose([float(row["axis"]) for row in trio], float(trio[0]["axis"]), rtol=1e-3)


def test_what_is_not_within_the_budget_has_a_reason_and_no_time(monkeypatch):
    monkeypatch.setattr(measures, "timed", lambda job, processes: np.ones((len(job.runs), processes)))
    goal = Goal(10.0, 1e-7, (NUMPY,), (KERNEL,))
    results = settle(SCENE, [cell for cell in cells(["Strang"]) if cell.chart == "axis"], goal)
    assert [cell.language for cell in results] == [COMPILED, NUMPY]
    assert list(results.values())[1].why == settings.BUDGET
    data = factorial(SCENE, ["Strang"], [goal._replace(languages=(COMPILED, NUMPY))], 1, 0.001, 1)
    slow, fast = (data.sel(variant=name, call=KERNEL).squeeze() for name in ("strang-numpy[axis]", "strang[axis]"))
    assert (str(slow["reason"].values), bool(np.isnan(slow["seconds"]))) == (settings.BUDGET, True)
    assert (str(fast["reason"].values), bool(np.isnan(fast["seconds"]))) == ("", False)


def test_every_timed_run_meets_its_target_and_its_time_is_the_median_of_its_processes(rows, dataset):
    by_name = {cell.name: cell for cell in cells()}
    assert ((rows["axis"] > 0.0) & (rows["axis"] <= SHORT.target)).all()
    for name in ("rk45-compiled[attitude]", "takahashi-imada[axis]", "rk45-numba[axis]"):
        part = rows[rows["variant"] == name]
        (row,) = set(zip(part["axis"], part["force_evaluations"], strict=True))
        attempt = settle(SCENE, [by_name[name]], SHORT)[by_name[name]]
        assert attempt.error <= SHORT.target
        if by_name[name].language == COMPILED:  # it was searched for by itself
            assert (attempt.error, attempt.evaluations) == row
    samples, seconds = dataset["seconds_samples"], dataset["seconds"]
    assert samples.sizes["process"] == 2
    assert np.array_equal(np.isfinite(seconds), np.isfinite(samples).all("process"))
    np.testing.assert_array_equal(seconds, np.median(samples, axis=samples.get_axis_num("process")))
    times = samples.values[np.isfinite(seconds.values)]
    assert (np.ptp(times, axis=-1) > 0.0).all()  # each process measures for itself
    gap = dataset["spread"].values[np.isfinite(seconds.values)]
    np.testing.assert_allclose(gap, 0.5 * np.ptp(times, axis=-1) / np.median(times, axis=-1))
    assert set(rows["call"]) == set(CALLS)
    assert set(rows["language"][rows["call"] == grid.SOLVE_IVP]) == {SCIPY_PYTHON}


def test_a_noisy_time_is_taken_again_and_the_fastest_processes_count(monkeypatch):
    noisy, quiet = [1.0, 1.0, 9.0, 9.0], [2.0, 2.0, 2.1, 2.1]
    repeats = [np.array([[1.1, 9.0, 9.0, 1.0], [9.0, 9.0, 1.0, 9.0]]), *[np.array([[9.0, 9.0, 9.0, 9.0]])] * 2]
    calls, arrays = [], [np.array([noisy, quiet, noisy]), *repeats]
    monkeypatch.setattr(measures, "timed", lambda runs, _: calls.append(runs.runs) or arrays.pop(0))
    times, tries = measures.settled_times(measures.Runs(SCENE, ["a", "b", "c"], 1, 0.001), 4)
    assert calls == [["a", "b", "c"], ["a", "c"], ["c"], ["c"]]  # 1, 1, 1, 9 stays noisy: no more are tried
    assert (times.tolist(), tries.tolist()) == ([[1.0, 1.0, 1.0, 1.1], quiet, [1.0, 1.0, 1.0, 9.0]], [2, 1, 4])


@pytest.mark.parametrize(("share", "busy"), [(0.0, None), (facts.NOISY_SHARE, None), (0.2, True)])
def test_times_of_a_busy_machine_are_not_compared(quiet, share, busy):
    spread = quiet["spread"].values.copy()
    indices = np.flatnonzero(np.isfinite(spread))
    count = int(share * indices.size)
    spread.flat[indices[:count]] = 1.01 * facts.NOISY
    data = quiet.assign({"spread": (quiet["spread"].dims, spread)})
    answers = facts.facts(data)
    assert (answers["loud"], answers["times"], answers["busy"]) == (count, indices.size, busy)
    assert answers["again"] == 0
    tries = data["seconds_tries"].where(~(data["spread"] > facts.NOISY), 4)
    assert facts.facts(data.assign({"seconds_tries": tries}))["again"] == count
    assert (answers["called"] is None) == np.isnan(answers["user_most"]) == bool(busy)
    tables = facts.tables(data)
    assert tables["effects"].empty == tables["charts"].empty == tables["scipy"].empty == bool(busy)
    assert len(tables["times"]) >= indices.size
    assert {picture.name for picture in figures.pictures(data)} == (set() if busy else {"waterfall"})


def test_where_nothing_was_timed_nothing_is_said_and_the_page_has_numbers_and_none(quiet, tmp_path):
    data = quiet.assign({name: quiet[name] * np.nan for name in ("seconds", "spread")})
    answers = facts.facts(data)
    assert answers["called"] is answers["busy"] is None
    assert answers["times"] == 0
    assert np.isnan(answers["near_share"])
    assert list(figures.pictures(data)) == []
    text = checked_page("factors", quiet, tmp_path)
    assert f"becomes {number(facts.facts(quiet)['called'], 2)} times faster" in text
    assert "busy" not in text


@pytest.mark.parametrize("call_first", [False, True])
def test_neighbours_in_the_waterfall_differ_in_exactly_the_factor_they_name(rows, call_first):
    keys = {cell.name: cell.key for cell in cells()}
    bars = waterfall(rows, call_first=call_first).to_dict("records")
    levels = [(*keys[bar["variant"]], bar["call"]) for bar in bars]
    assert levels[0] == (DORMAND_PRINCE, "angles", SCIPY_PYTHON, grid.SOLVE_IVP)
    assert levels[-1] == tuple(fastest(rows)[FACTORS])
    assert len(bars) >= 5
    for before, after, bar in zip(levels, levels[1:], bars[1:], strict=False):
        changes = [(factor, a, b) for factor, a, b in zip(FACTORS, before, after, strict=True) if a != b]
        assert changes == [(bar["factor"], bar["from"], bar["to"])]
        (seconds,) = rows[(rows[FACTORS] == list(after)).all(axis=1)]["seconds"]
        assert bar["time (s)"] == seconds


def test_the_product_of_the_ratios_is_the_total_and_a_waterfall_with_a_missing_step_is_not_drawn(quiet, rows):
    part, answers, ((_, figure),) = first_goal(rows), facts.facts(quiet), figures.pictures(quiet)
    sides = ("called", 0, -2), ("bare", 1, -1)  # what is left out is the bar of the call
    for axis, (ratio, first, last) in zip(figure.axes, sides, strict=True):
        order = waterfall(part, call_first=ratio == "bare")
        seconds = order["time (s)"].to_numpy()
        assert [line.get_xdata()[0] for line in axis.lines if line.get_marker() == "o"] == seconds.tolist()
        assert answers[ratio] == pytest.approx(seconds[first] / seconds[last])
        assert order["so far"].to_numpy() == pytest.approx(seconds[0] / seconds, rel=1e-12)
        assert math.prod(order["times faster"].iloc[1:]) == pytest.approx(seconds[0] / seconds[-1], rel=1e-12)
    bars = waterfall(rows)
    assert len(bars)
    for bar in bars.iloc[:-1].to_dict("records"):
        assert waterfall(rows[(rows["variant"] != bar["variant"]) | (rows["call"] != bar["call"])]).empty


EFFECT = {
    DORMAND_PRINCE: 8.0, "rk4": 5.0, "Takahashi-Imada": 1.0, "angles": 3.0, "axis": 1.0, "attitude": 1.5,
    SCIPY_PYTHON: 100.0, grid.SCIPY_NUMBA: 90.0, NUMPY: 0.5, COMPILED: 1.0,
    grid.SOLVE_IVP: 2.5, grid.SIMULATE: 2.0, KERNEL: 1.0,
}  # fmt: skip


def synthetic(interaction=1.0):
    """Times that are products of an effect a factor; an interaction makes angles slower in compiled loops alone."""
    rows = []
    schemes, chart_names = (DORMAND_PRINCE, "rk4", "Takahashi-Imada"), ("angles", "axis", "attitude")
    for levels in itertools.product(schemes, chart_names, LANGUAGES, CALLS):
        seconds = 1e-6 * math.prod(EFFECT[level] for level in levels)
        if levels[1:3] == ("angles", COMPILED):
            seconds *= interaction
        rows.append(["spheroid", 10.0, 1e-6, *levels, "-".join(levels), seconds])
    return pd.DataFrame(rows, columns=[*GOAL, *FACTORS, "variant", "seconds"])


def test_effects_that_multiply_are_found_and_scipy_and_charts_compared_by_the_fastest(quiet, monkeypatch):
    for pair in pairs(synthetic()).to_dict("records"):
        assert pair["ratio"] == pytest.approx(EFFECT[pair["before"]] / EFFECT[pair["after"]], rel=1e-12)
    table = effects(synthetic(interaction=4.0)).set_index(["factor", "before", "after"])
    answers = table.loc["chart", "angles", "axis"]
    assert (answers["min"], answers["max"]) == (pytest.approx(3.0), pytest.approx(12.0))
    assert answers["count"] == 3 * len(LANGUAGES) * len(CALLS)
    # As called: 8 x 100 x 2.5 over 2; kernels: 8 x 100 over 1.
    (row,) = facts.against_scipy(synthetic()).to_dict("records")
    assert (row["times, as called"], row["times, kernels"]) == (pytest.approx(1000.0), pytest.approx(800.0))
    ours = f"Takahashi-Imada-axis-{COMPILED}"
    assert row["SciPy's"] == f"{DORMAND_PRINCE}-axis-{SCIPY_PYTHON}-{grid.SOLVE_IVP}"
    assert (row["fastest, as called"], row["fastest kernel"]) == (f"{ours}-{grid.SIMULATE}", f"{ours}-{KERNEL}")
    table = charts(synthetic(interaction=4.0))
    assert list(table["family"]) == ["Dormand-Prince", "rk4", "splitting"]
    np.testing.assert_allclose(table["angles / axis"], 12.0)
    np.testing.assert_allclose(table["attitude / axis"], 1.5)
    goals = [synthetic(interaction=2.0**k).assign(target=10.0**-k, spread=0.01) for k in range(3)]
    for goal, factor in zip(goals, (1.0, 2.0, 6.0), strict=True):
        goal.loc[goal["language"] == SCIPY_PYTHON, "seconds"] *= factor
    monkeypatch.setattr(facts, "compared", lambda _: pd.concat(goals, ignore_index=True))
    answers = facts.facts(quiet)
    assert [answers[f"user_{end}"] for end in ("least", "most")] == pytest.approx([1000.0, 6000.0])
    assert [answers[f"angles_{family}"] for family in ("rk4", "splitting")] == pytest.approx([6.0, 6.0])


@pytest.mark.parametrize(("attitude", "chart"), [(0.95, "axis"), (0.8, "attitude")])
def test_a_tie_goes_to_the_smaller_chart_and_a_lead_does_not(attitude, chart):
    pair = [["rk4", where, COMPILED, KERNEL, seconds] for where, seconds in (("axis", 1.0), ("attitude", attitude))]
    assert fastest(pd.DataFrame(pair, columns=[*FACTORS, "seconds"]))["chart"] == chart
