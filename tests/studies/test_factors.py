"""The factorial of method, formulation, language and call: equal accuracy, one factor at a time, measured times."""

import itertools
import math

import numpy as np
import pytest
import xarray as xr
from symtop_studies.factors import figures, plain_numpy, tables, words
from symtop_studies.factors.cells import (
    CALLS,
    COMPILED,
    DORMAND_PRINCE,
    FAMILIES,
    KERNEL,
    LANGUAGES,
    NUMPY,
    SCIPY_NUMBA,
    SCIPY_PYTHON,
    SIMULATE,
    SOLVE_IVP,
    cells,
    taylor_in_angles,
)  # fmt: skip
from symtop_studies.factors.tables import (
    FACTORS,
    LEAST,
    Column,
    Goal,
    Timed,
    changes,
    factorial,
    fastest,
    goals_of,
    least_share,
    settle,
    times,
    waterfall,
)  # fmt: skip

import symtop
from symtop.measure import settings
from symtop.measure.datasets import combine
from symtop.methods.framework.equations import FORMULATIONS
from symtop.runner.study import Case

SCENE = symtop.scene("spheroid")
GOAL = Goal(10.0, 1e-6, LANGUAGES, CALLS)


@pytest.fixture(scope="module")
def measured():
    """A small factorial as the study's functions see it: two schemes at one goal, short batches."""
    data = factorial(SCENE, [DORMAND_PRINCE, "Takahashi-Imada"], [GOAL], 2, 0.001, 2)
    return combine([(Case("spheroid", "together"), data)])


@pytest.fixture(scope="module")
def rows(measured):
    return times(next(goals_of(measured))[3])


# ---- the cells -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("plain", "name"), [(plain_numpy.RK4, "rk4"), (plain_numpy.STRANG, "strang")])
def test_the_loops_in_numpy_return_the_trajectory_of_the_compiled_ones(plain, name):
    for chart in plain.charts():
        plan = {"step_size": 0.01, "horizon": 4.0, "guard": False}
        mine, theirs = (symtop.simulate("goldstein", row, **plan) for row in (plain.variant(chart), f"{name}[{chart}]"))
        for quantity in ("axis", "energy", "p_phi", "p_psi"):
            np.testing.assert_allclose(mine[quantity], theirs[quantity], atol=1e-12)
        assert mine.attrs["force_evaluations"] == theirs.attrs["force_evaluations"]
        another = symtop.simulate("goldstein", f"{name}[{chart}]", **plan | {"step_size": 0.02})
        gap = np.abs(mine["axis"].values[-1] - another["axis"].values[-1]).max()
        assert gap > 1e-9  # the control: another step is another trajectory


def test_taylor_in_angles_solves_the_same_equations():
    hy = pytest.importorskip("heyoka")
    from symtop.methods.taylor.heyoka import equations

    scene = symtop.scene("goldstein")
    par, state = FORMULATIONS["angles"].prepare(scene.top, scene.start)
    names, sides = zip(*equations("angles"), strict=True)
    slopes = hy.cfunc(list(sides), list(names))(np.array(state), pars=np.array([1.0 / par.I1, par.mgl, par.I3]))
    np.testing.assert_allclose(slopes, FORMULATIONS["angles"].field(par, state), rtol=1e-14, atol=1e-14)
    run = symtop.simulate(scene, taylor_in_angles(), horizon=10.0)
    assert run.attrs["chart"] == "angles"
    assert float(symtop.errors(run)["attitude"].max()) < 1e-11
    assert 0.0 < float(np.ptp(run["p_phi"].values)) < 1e-12  # free to drift, by rounding


def test_a_cell_is_named_once_and_is_one_method_in_one_chart():
    every = cells()
    assert len({cell.name for cell in every}) == len({cell.key for cell in every}) == len(every)
    for cell in every:
        assert cell.method.charts() == (cell.chart,)
        assert (cell.method.implementation == "compiled") == (cell.language == COMPILED)
    schemes = {cell.scheme for cell in every}
    compiled = {cell.scheme for cell in every if cell.language == COMPILED}
    assert {scheme for members in FAMILIES.values() for scheme in members} == compiled == schemes - {"DOP853"}


# ---- equal accuracy --------------------------------------------------------------------------------------------------


def test_every_timed_run_meets_its_target_when_it_is_run_again(rows):
    known = {cell.name: cell for cell in cells()}
    for one in rows:
        assert 0.0 < one.error <= GOAL.target
    for name in ("rk45-compiled[attitude]", "takahashi-imada[axis]", "rk45-numba[axis]"):
        (row,) = {(one.error, one.forces) for one in rows if one.name == name}
        met = settle(SCENE, [known[name]], GOAL)[known[name]]
        assert met.error <= GOAL.target
        if known[name].language == COMPILED:  # it was searched for by itself
            assert (met.error, met.evaluations) == row


def test_the_share_that_is_stated_is_the_least_of_the_timed_runs(measured, rows):
    share = min(one.error for one in rows) / GOAL.target
    assert least_share(measured) == pytest.approx(share)
    assert share >= LEAST  # of these methods; Taylor's error jumps with its order


def test_the_search_ends_closer_to_the_target_if_asked():
    horizon = 10.0 * SCENE.nutation_period
    for name in ("rk4[axis]", "rk4[attitude]", "strang[axis]"):
        found = settings.search(SCENE, symtop.integrator(name), 1e-5, "axis", horizon, least=LEAST)
        assert LEAST * 1e-5 <= found.error <= 1e-5


def test_languages_of_one_method_have_the_same_setting_and_the_same_work(measured):
    part = measured.isel(scene=0, horizon=0, target=0)
    for chart in ("angles", "axis", "attitude"):
        trio = [part.sel(variant=f"{name}[{chart}]") for name in ("rk45-compiled", "rk45", "rk45-numba")]
        assert len({float(one[Column.SETTING]) for one in trio}) == 1
        assert len({float(one[Column.FORCES]) for one in trio}) == 1
        np.testing.assert_allclose([float(one[Column.AXIS]) for one in trio], float(trio[0][Column.AXIS]), rtol=1e-3)


def test_what_is_not_within_the_budget_has_a_reason_and_no_time():
    goal = Goal(10.0, 1e-7, (NUMPY,), (KERNEL,))
    strang = [cell for cell in cells(["Strang"]) if cell.chart == "axis"]
    settled = settle(SCENE, strang, goal)
    assert [cell.language for cell in settled] == [COMPILED, NUMPY]
    assert list(settled.values())[1] == settings.BUDGET
    data = factorial(SCENE, ["Strang"], [goal._replace(languages=(COMPILED, NUMPY))], 1, 0.001, 1)
    slow, fast = (data.sel(variant=name, call=KERNEL).squeeze() for name in ("strang-numpy[axis]", "strang[axis]"))
    assert (str(slow[Column.REASON].values), bool(np.isnan(slow[Column.SECONDS]))) == (settings.BUDGET, True)
    assert (str(fast[Column.REASON].values), bool(np.isnan(fast[Column.SECONDS]))) == ("", False)


# ---- measured times --------------------------------------------------------------------------------------------------


def test_every_time_is_the_median_of_its_processes(measured, rows):
    samples, seconds = measured[Column.SAMPLES], measured[Column.SECONDS]
    assert samples.sizes["process"] == 2
    assert np.array_equal(np.isfinite(seconds), np.isfinite(samples).all("process"))
    np.testing.assert_array_equal(seconds, np.median(samples, axis=samples.get_axis_num("process")))
    taken = samples.values[np.isfinite(seconds.values)]
    assert (np.ptp(taken, axis=-1) > 0.0).all()  # each process measures for itself
    gap = measured[Column.SPREAD].values[np.isfinite(seconds.values)]
    np.testing.assert_allclose(gap, 0.5 * np.ptp(taken, axis=-1) / np.median(taken, axis=-1))
    assert {one.call for one in rows} == set(CALLS)
    assert {one.language for one in rows if one.call == SOLVE_IVP} == {SCIPY_PYTHON}


@pytest.mark.parametrize(("loud", "said"), [(0, False), (2, False), (3, True)])
def test_times_of_a_busy_machine_are_not_compared(measured, loud, said):
    """Three noisy times of a hundred are too many, two are not."""
    timed = measured.assign({Column.SPREAD: xr.where(np.isfinite(measured[Column.SPREAD]), 0.01, np.nan)})
    first = timed.isel(scene=0, horizon=0, target=0)
    every = int(np.isfinite(first[Column.SPREAD]).sum())
    copies = xr.concat([timed] * -(-100 // every), "target")
    spread = copies[Column.SPREAD].values.ravel()
    known = np.flatnonzero(np.isfinite(spread))
    spread[known[100:]] = np.nan
    spread[known[:loud]] = 0.3
    copies[Column.SPREAD].values[:] = spread.reshape(copies[Column.SPREAD].shape)
    assert tables.noisy(copies) == (loud, 100)
    assert tables.busy(copies) == said
    data = timed if not said else timed.assign({Column.SPREAD: timed[Column.SPREAD] + 1.0})
    sentences = words.verdict(data)
    assert sentences[0].startswith("Not measured: the machine was busy.") == said
    assert (words.waterfalls(data) == []) == said
    assert ("waterfall" in {picture.name for picture in figures.pictures(data)}) != said


# ---- one factor at a time --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("call_first", [False, True])
def test_neighbours_in_the_waterfall_differ_in_exactly_the_factor_they_name(rows, call_first):
    bars = waterfall(rows, call_first=call_first)
    assert bars[0].time.levels == (DORMAND_PRINCE, "angles", SCIPY_PYTHON, SOLVE_IVP)
    assert bars[-1].time == fastest(rows)
    assert len(bars) >= 5
    for before, after in itertools.pairwise(bars):
        changed = [
            factor for factor, a, b in zip(FACTORS, before.time.levels, after.time.levels, strict=True) if a != b
        ]
        assert changed == [after.factor]
        assert after.time in rows


def test_the_product_of_the_ratios_is_the_total(rows):
    bars = waterfall(rows)
    total = bars[0].time.seconds / bars[-1].time.seconds
    for order in (bars, waterfall(rows, call_first=True)):
        assert math.prod(bar.ratio for bar in order[1:]) == pytest.approx(total, rel=1e-12)


def test_a_waterfall_with_a_missing_step_is_not_drawn(rows):
    bars = waterfall(rows)
    for missing in bars[1:-1]:
        rest = [one for one in rows if one != missing.time]
        assert waterfall(rest) == []


EFFECT = {
    DORMAND_PRINCE: 8.0, "rk4": 5.0, "Takahashi-Imada": 1.0, "angles": 3.0, "axis": 1.0, "attitude": 1.5,
    SCIPY_PYTHON: 100.0, SCIPY_NUMBA: 90.0, NUMPY: 80.0, COMPILED: 1.0, SOLVE_IVP: 2.5, SIMULATE: 2.0, KERNEL: 1.0,
}  # fmt: skip


def synthetic(interaction=1.0):
    """Times that are products of an effect a factor; an interaction makes angles slower in compiled loops alone."""
    grid = []
    for levels in itertools.product(
        (DORMAND_PRINCE, "rk4", "Takahashi-Imada"), ("angles", "axis", "attitude"), LANGUAGES, CALLS
    ):
        seconds = 1e-6 * math.prod(EFFECT[level] for level in levels)
        if levels[1:3] == ("angles", COMPILED):
            seconds *= interaction
        grid.append(Timed(*levels, "-".join(levels), seconds, 0.0, 1e-6, 100.0))
    return grid


def test_the_effect_of_a_factor_is_found_where_effects_multiply_and_spread_where_they_do_not():
    for change in changes(synthetic()):
        np.testing.assert_allclose(change.ratios, EFFECT[change.before] / EFFECT[change.after], rtol=1e-12)
    spread = {change[:3]: change.ratios for change in changes(synthetic(interaction=4.0))}
    charts = spread["chart", "angles", "axis"]
    assert (min(charts), max(charts)) == (pytest.approx(3.0), pytest.approx(12.0))
    assert len(charts) == 3 * len(LANGUAGES) * len(CALLS)


@pytest.mark.parametrize(("attitude", "chart"), [(0.95, "axis"), (0.8, "attitude")])
def test_a_tie_goes_to_the_smaller_chart_and_a_lead_does_not(attitude, chart):
    pair = [
        Timed("rk4", where, COMPILED, KERNEL, where, seconds, 0.0, 1e-6, 1.0)
        for where, seconds in (("axis", 1.0), ("attitude", attitude))
    ]
    assert fastest(pair).chart == chart
