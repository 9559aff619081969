"""A short run is made once: the guard's probe is read off it, and says what a probe of its own would have said."""

import numpy as np
import pytest

import symtop
from symtop.methods.framework.calling import solve
from symtop.run.guard import forecast
from symtop.run.simulation import make_plan

WHERE = symtop.scene("spheroid")


def _plan(method, steps, samples=501):
    return make_plan(WHERE, method, WHERE.horizon / steps, horizon=WHERE.horizon, samples=samples)[0]


@pytest.mark.parametrize("row", ["strang[attitude]", "rk4[axis]", "stormer-verlet[angles]", "gauss-4[axis]"])
@pytest.mark.parametrize("steps", [100, 150, 400])
def test_the_forecast_is_the_same(row, steps, monkeypatch):
    method = symtop.integrator(row)
    (chart,), plan = method.charts(), _plan(method, steps)
    assert forecast.repeats(method, plan)
    alone = forecast.forecast(WHERE, method, chart, plan)
    run = solve(method, chart, WHERE.top, WHERE.start, plan)
    other = run._replace(states=np.roll(run.states, 1, axis=0))  # every state a step late
    monkeypatch.setattr(forecast, "solve", None)  # no second run
    np.testing.assert_equal(tuple(forecast.forecast(WHERE, method, chart, plan, run)), tuple(alone))
    assert forecast.forecast(WHERE, method, chart, plan, other).axis_error != alone.axis_error


def test_a_run_that_broke_off_is_probed_by_itself():
    method = symtop.integrator("rk4[axis]")
    plan = _plan(method, 7)
    run = solve(method, "axis", WHERE.top, WHERE.start, plan)
    assert run.outcome != "ok"
    alone, beside = (forecast.forecast(WHERE, method, "axis", plan, done) for done in (None, run))
    np.testing.assert_equal(tuple(beside), tuple(alone))


def test_runs_that_a_probe_does_not_repeat_are_not_read():
    method = symtop.integrator("strang[axis]")
    assert not forecast.repeats(method, _plan(method, 501, samples=600))
    assert not forecast.repeats(method, _plan(method, 400, samples=101))
    assert not forecast.repeats(symtop.integrator("rk45"), _plan(method, 400))
