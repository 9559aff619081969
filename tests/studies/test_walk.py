"""Settings that meet targets, their limits, and why a target is not met."""

import math

import numpy as np
import pytest
from symtop_studies.work_precision.walk import CAPPED, TOO_WIDE, Walk, nutation_width, spans, work_table

import symtop
from symtop.measure.accuracy import error_row
from symtop.measure.settings import TARGETS, compared, limits
from symtop.methods.framework.registry import methods
from symtop.model import charts
from symtop.run.reference.truth import reference


def test_settings_come_close_to_every_target_from_below():
    scene, method = symtop.scene("goldstein"), symtop.integrator("kahan-li-6")
    table = work_table(scene, method, [10.0 * scene.nutation_period], 1e6).isel(horizon=0)
    assert str(table["stopped"].values) == "all targets met"
    for target in TARGETS:
        good = table["axis"].values <= target
        best = int(np.flatnonzero(good)[np.argmin(table["steps"].values[good])])
        assert table["axis"].values[best] >= 0.4 * target
        step = float(table["setting_value"].values[best])
        coarser = symtop.simulate(
            scene, method, step_size=1.25 * step, horizon=10.0 * scene.nutation_period, samples=331
        )
        truth = reference(scene, coarser["time"], precision="closed-form")
        assert charts.axis_distance(coarser["axis"].values, truth["axis"].values).max() > target


def test_a_step_may_be_as_long_as_the_method_is_accurate():
    scene, method = symtop.scene("cusp"), symtop.integrator("sofroniou-spaletta-10[axis]")
    horizon = 10.0 * scene.nutation_period
    table = work_table(scene, method, [horizon], 1e6).isel(horizon=0)
    good = table["axis"].values <= 1e-3
    longest = float(table["setting_value"].values[good].max())
    assert longest > 0.8 * scene.nutation_period  # a quarter of a nutation would be three times the work
    assert longest <= limits(scene, method, horizon)[1]
    assert limits(scene, method, horizon, "energy")[1] <= 0.25 * scene.nutation_period  # it says nothing of the motion
    coarse = table["axis"].values[table["setting_value"].values > 1.05 * longest]
    assert (coarse > 1e-3).all() or str(table["reached"].sel(target=1e-3).values) == CAPPED


@pytest.mark.parametrize(("name", "good"), [("sofroniou-spaletta-10[axis]", True), ("takahashi-imada[axis]", False)])
def test_an_accurate_long_step_is_accurate_between_its_ends_too(name, good):
    scene, method = symtop.scene("cusp"), symtop.integrator(name)
    step = scene.nutation_period / 1.27
    at_ends = float(error_row(scene, method, step, 12.0 * step, "axis")["axis"])
    between = []
    for k in range(20):  # runs that end anywhere within a step, with steps that are a little shorter
        horizon = (11.0 + (k + 0.5) / 20.0) * step
        between.append(float(error_row(scene, method, horizon / 12.0, horizon, "axis")["axis_end"]))
    assert (at_ends < 1e-5) is good
    assert max(between) < 1.5 * at_ends


def test_a_target_that_is_wider_than_the_nutation_is_not_asked():
    scene, method = symtop.scene("fast"), symtop.integrator("rk4[axis]")
    assert nutation_width(scene) == pytest.approx(3.84e-4, rel=1e-2)
    table = work_table(scene, method, [10.0 * scene.nutation_period], 1e5).isel(horizon=0)
    reached = dict(zip(TARGETS, map(str, table["reached"].values), strict=True))
    assert (reached[1e-3], reached[1e-6]) == (TOO_WIDE, "met")
    still = np.cross(symtop.simulate(scene, "exact", horizon=10.0 * scene.nutation_period)["axis"].values, [0, 0, 1])
    angle = np.arcsin(np.linalg.norm(still, axis=1))
    assert np.ptp(angle) < 1e-3  # an axis that does not nutate at all is within 1e-3 of the truth
    assert nutation_width(symtop.scene("spheroid")) > 1.0


def test_what_is_not_reached_has_a_reason():
    scene = symtop.scene("spheroid")
    horizon = 10.0 * scene.nutation_period
    for name, budget, target, why in (
        ("stormer-verlet[angles]", 3e4, 1e-9, "budget"),
        ("rk45-compiled[angles]", 1e6, 1e-12, "least tolerance"),
        ("taylor[axis]", 1e6, 1e-12, "met"),
    ):
        table = work_table(scene, symtop.integrator(name), [horizon], budget).isel(horizon=0)
        assert str(table["reached"].sel(target=target).values) == why
    pole = symtop.scene("bruls-cardona-arnold")
    table = work_table(pole, symtop.integrator("midpoint[angles]"), [100.0 * pole.nutation_period], 1e4)
    assert set(map(str, table["reached"].values.ravel())) == {"left chart"}


def test_the_rows_are_every_method_in_every_chart_that_costs_what_the_axis_costs():
    names = [row.name for row in compared("axis")]
    assert {"rk4[angles]", "rk4[axis]", "strang[axis]", "midpoint[angles]", "exact[attitude]"} <= set(names)
    assert "strang[attitude]" not in names  # the same axis for more work
    assert "strang[attitude]" in [row.name for row in compared("attitude")]
    assert {row.method for row in compared("axis")} == {name for name, one in methods().items() if not one.exact_steps}


def test_a_walk_ends_at_its_budget_and_says_so():
    scene, method = symtop.scene("goldstein"), symtop.integrator("stormer-verlet")
    table = work_table(scene, method, [10.0 * scene.nutation_period, 1000.0 * scene.nutation_period], 3e4)
    assert list(table["stopped"].values) == ["budget", "budget"]
    assert np.nanmax(table["force_evaluations"].values) <= 1.05 * 3e4
    assert (table["outcome"].values[1] == "not_run").any()  # padding says that nobody ran
    nothing = work_table(scene, method, [10.0 * scene.nutation_period, 1000.0 * scene.nutation_period], 500.0)
    assert set(nothing["outcome"].values[1]) == {"not_run"}


def test_a_run_that_costs_far_more_than_was_foreseen_ends():
    """At 1e-2 rk45 loses the motion, and its steps shrink: 850,000 evaluations over 1000 nutations for 20,000."""
    scene = symtop.scene("goldstein")
    table = work_table(scene, symtop.integrator("rk45[axis]"), spans(scene, [10.0, 1000.0]), 2.5e4)
    assert table["outcome"].values[1, 0] == "out_of_budget"
    assert 5e4 <= np.nanmax(table["force_evaluations"].values) <= 5.1e4
    assert list(table["stopped"].values) == ["budget", "budget"]
    assert list(table["reached"].values[1]) == ["out of budget"] * 4
    assert (table["outcome"].values[0] == "ok").all()


def test_a_coarse_setting_that_is_good_enough_is_made_coarser():
    scene, method = symtop.scene("fast"), symtop.integrator("strang[axis]")
    walk = Walk(scene, method, 10.0 * scene.nutation_period, 1e4)
    walk.run(scene.nutation_period / 20.37)
    walk.coarsen(1e-3)
    assert walk.error(sorted(walk.rows)[-2]) <= 1e-3
    assert max(walk.rows) > 2.0 * scene.nutation_period / 20.37


def test_a_separatrix_has_spans_too():
    top, third = symtop.SymmetricTop(1.0, 1.0, 1.0), 1.0 / math.sqrt(3.0)
    edge = symtop.Scene("edge", top, symtop.Angles(theta=math.pi / 3, phi_dot=2 * third, psi_dot=2 * third), 10.0)
    assert all(math.isfinite(span) for span in spans(edge, [10.0, 100.0]))
    scene = symtop.scene("fast")
    assert spans(scene, [10.0]) == [10.0 * scene.nutation_period]
