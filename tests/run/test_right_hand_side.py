"""The guard of anybody's equations: forecasts of motions that are no body's, causes, and what is refused."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import symtop
from symtop.run import right_hand_side
from tests.judging.blind.right import rk4


def kepler(_, y):
    """Two bodies; a period is 2 pi."""
    x, z, vx, vz = y
    cube = math.hypot(x, z) ** 3
    return [vx, vz, -x / cube, -z / cube]


def at_pericentre(e):
    return [1.0 - e, 0.0, 0.0, math.sqrt((1.0 + e) / (1.0 - e))]


def henon_heiles(_, y):
    return [y[2], y[3], -y[0] - 2.0 * y[0] * y[1], -y[1] - y[0] ** 2 + y[1] ** 2]


def of_energy(energy, y):
    return [0.0, y, math.sqrt(2.0 * energy - y * y + 2.0 * y**3 / 3.0), 0.0]


def prothero_robinson(rate):
    return lambda t, y: [-rate * (y[0] - math.cos(t)) - math.sin(t)]


def swing(_, y):
    return [y[1], -y[0]]


def true_error(f, y0, horizon, name, **control):
    """The error of the run itself, by SciPy or by steps of rk4."""
    h, onset = control.get("step_size"), horizon * np.geomspace(1e-6, 1.0, 200)
    times = np.union1d(np.linspace(0.0, horizon, 401), onset) if h is None else h * np.arange(round(horizon / h) + 1)
    if h is None:
        tolerance, solver = control["tolerance"], {"radau": "Radau"}.get(name, name.upper())
        states = solve_ivp(f, (0.0, horizon), y0, solver, times, rtol=tolerance, atol=tolerance).y
    else:
        steps = [np.array(y0)]
        for _ in times[1:]:
            steps.append(rk4(lambda t, y: np.array(f(t, y)), 0.0, steps[-1], h))
        states = np.array(steps).T
    truth = solve_ivp(f, (0.0, times[-1]), y0, "DOP853", times, rtol=3e-14, atol=1e-14).y
    return float(np.linalg.norm(states - truth, axis=0).max())


def decay(rate):
    return lambda _, y: [-rate * y[0]]


@pytest.mark.parametrize(("f", "y0", "horizon", "name", "control", "causes"), [
    (kepler, at_pericentre(0.3), 40.0 * math.pi, "dop853", {"tolerance": 1e-8}, ("", "step")),
    (kepler, at_pericentre(0.6), 20.0 * math.pi, "rk4", {"step_size": 0.03}, ("", "step")),
    *((kepler, at_pericentre(0.9), 2.0 * turns * math.pi, "dop853", {"tolerance": tolerance}, ("step",))
      for turns, tolerance in ((2, 2.5e-5), (10, 1e-7), (20, 1e-7))),
    (henon_heiles, of_energy(1.0 / 12.0, -0.1), 40.0 * math.pi, "rk45", {"tolerance": 1e-7}, ("", "step")),
    (henon_heiles, of_energy(1.0 / 12.0, -0.1), 5.3102, "rk4", {"step_size": 0.02}, ("",)),  # half a step is left over
    *((decay(rate), [1.0], horizon, "rk4", {"step_size": step}, None)
      for rate, horizon, step in ((1.0, 10.0, 0.1), (1000.0, 5.0, 0.002), (30.0, 10.0, 0.1))),
    *((decay(1000.0), [1.0], 5.0, name, {"tolerance": 1e-4}, None) for name in ("radau", "bdf", "lsoda")),
    *((swing, [1.0, 0.0], horizon, "rk4", {"step_size": step}, ("",))  # of few steps
      for horizon, step in ((1.0, 0.3), (1.0, 0.4), (2.0, 0.32), (1.0, 0.21))),
])  # fmt: skip
def test_an_error_is_forecast_within_a_factor_of_three(f, y0, horizon, name, control, causes):
    """In a transient, too: nothing is left of exp(-1000 t) at the first of even times; exp(-30 t) ends at 7e13."""
    expected = symtop.guard(f, 0.0, y0, horizon, name, **control)
    assert 1.0 / 3.0 < expected.error / true_error(f, y0, horizon, name, **control) < 3.0
    assert causes is None or expected.cause in causes


def test_an_error_that_has_halved_goes_on_as_it_was_and_one_that_has_faded_as_it_is():
    times = np.arange(1.0, 11.0)
    whole, halved, faded = (
        right_hand_side._largest_error(times, 1e-9 * np.where(times < 5.0, 1.0, share), 1000.0, 1.0, math.inf)
        for share in (1.0, 0.5, 0.05)
    )
    assert halved == pytest.approx(whole, rel=1e-9)
    assert faded == pytest.approx(0.05 * whole, rel=1e-9)


@pytest.mark.parametrize(("f", "y0", "step"), [
    (decay(1000.0), 1.0, 0.1), (decay(1e6), 1.0, 0.1), (lambda _, y: [-200.0 * (y[0] - 1.0)], 0.0, 0.05),
    pytest.param(prothero_robinson(1e6), 1.0, 0.1, marks=pytest.mark.quick),
], ids=["decay", "fast decay", "relaxation", "Prothero and Robinson"])  # fmt: skip
def test_steps_that_are_too_long_for_a_stiff_f_are_no_small_error(f, y0, step):
    expected = symtop.guard(f, 0.0, [y0], 10.0, "rk4", step_size=step)
    assert expected.error > 1e10
    assert expected.cause == "stiffness"
    assert math.isnan(expected.setting)


@pytest.mark.quick
def test_chaos_is_told_from_order_and_what_was_not_watched_says_so():
    text = str(symtop.guard(prothero_robinson(1e6), 0.0, [1.0], 10.0, "radau", tolerance=1e-6))
    assert "; the motion was watched to t = 0.0" in text
    assert "watched" not in str(symtop.guard(swing, 0.0, [1.0, 0.0], 1500.0, "rk4", step_size=0.1))
    y0, horizon = of_energy(1.0 / 6.0, -0.1), 120.0
    chaotic = symtop.guard(henon_heiles, 0.0, y0, horizon, "rk45", tolerance=1e-6)
    assert chaotic.cause == "instability"
    assert chaotic.setting < 1e-6  # rounding, which grows 1e8 times, stays small
    assert "the motion multiplies a small change" in str(chaotic)
    regular = symtop.guard(henon_heiles, 0.0, of_energy(1.0 / 12.0, 0.1), horizon, "rk45", tolerance=1e-6)
    assert regular.cause != "instability"
    assert chaotic.amplification > 100.0 * regular.amplification


@pytest.mark.parametrize(("f", "y0", "horizon", "name", "control", "cause"), [
    (prothero_robinson(1e3), [1.0], 0.5, "rk4", {"step_size": 0.01}, "stiffness"),
    (prothero_robinson(1e3), [1.0], 0.5, "radau", {"tolerance": 1e-8}, ""),
    (swing, [1.0, 0.0], 100.0, "rk4", {"step_size": 3.0}, "instability"),
    (swing, [1.0, 0.0], 100.0, "rk4", {"step_size": 0.5}, "step"),
    (swing, [1.0, 0.0], 30.0, "vern9-fixed", {"step_size": 0.1, "accuracy": 1e-15}, "rounding"),
])  # fmt: skip
def test_each_cause_is_named(f, y0, horizon, name, control, cause):
    expected = symtop.guard(f, 0.0, y0, horizon, name, **control)
    assert expected.cause == cause, str(expected)
    assert str(expected).startswith(f"{name}: expect an error of ")
    assert (", with the motion lost and no size known: " in str(expected)) is (cause in ("stiffness", "instability"))
    assert "\n" not in str(expected)


def test_a_forecast_has_the_units_of_the_motion():
    """Of a length 1024 times and a time 64 times as long, of which the numbers keep their bits."""
    outlook = lambda length, time: symtop.guard(
        lambda _, y: np.array([y[1], -y[0]]) / time, 0.0, [length, 0.0], 60.0 * time, "rk4", step_size=0.2 * time,
        accuracy=1e-4 * length)  # fmt: skip
    small, large = outlook(1.0, 1.0), outlook(1024.0, 64.0)
    assert (large.cause, large.error) == (small.cause, pytest.approx(1024.0 * small.error, rel=1e-3))
    assert large.setting == pytest.approx(64.0 * small.setting, rel=0.1)  # two digits


def test_a_motion_may_begin_at_zero():
    """Its size is that of what drives it: z'' = c sin t - 2 z is c (sin t - sin(t sqrt 2)/sqrt 2)."""
    c, h, z, root, error = 1e-9, 0.1, np.zeros(2), math.sqrt(2.0), 0.0
    driven = lambda t, y: np.array([y[1], c * math.sin(t) - 2.0 * y[0]])
    for k in range(200):
        z, t = rk4(driven, k * h, z, h), (k + 1) * h
        place, slope = math.sin(t) - math.sin(t * root) / root, math.cos(t) - math.cos(t * root)
        error = max(error, math.hypot(z[0] - c * place, z[1] - c * slope))
    assert 1.0 / 3.0 < symtop.guard(driven, 0.0, [0.0, 0.0], 20.0, step_size=h, accuracy=1e-12).error / error < 3.0
    assert symtop.guard(prothero_robinson(1e3), 0.0, [0.0], 0.5, step_size=0.01).cause == "stiffness"
    result = symtop.guard(lambda _t, y: 0.0 * y, 0.0, [0.0], 10.0, step_size=0.1)
    assert (result.error, result.setting) == (0.0, 10.0)  # no step is longer than the run
    result = symtop.guard(lambda _t, y: [y[1], -y[0]], 0.0, [1.0, 0.0], 93.05488730716638, "rk45", tolerance=1e-4)
    assert 1e-4 < result.error < 0.1  # two of its times are neighbours, which SciPy refuses


def test_f_may_return_one_array_again_and_a_horizon_beyond_the_end_is_refused():
    buffer = np.empty(2)

    def swing_in_place(_, y):
        buffer[:] = y[1], -y[0]
        y[:] = math.nan
        return buffer

    for name, control in (("rk4", {"step_size": 0.1}), ("rk45", {"tolerance": 1e-4})):
        expected = symtop.guard(swing, 0.0, [1.0, 0.0], 30.0, name, **control)
        assert symtop.guard(swing_in_place, 0.0, [1.0, 0.0], 30.0, name, **control) == expected
    # y' = y^2 from 1 is 1/(1 - t).
    with pytest.raises(symtop.SymtopError, match=r"horizon must be below 1, not 2\.0: the motion goes beyond"):
        symtop.guard(lambda _t, y: y * y, 0.0, [1.0], 2.0, step_size=0.01)
    assert symtop.guard(lambda _t, y: y * y, 0.0, [1.0], 0.9, step_size=0.01).error < 1e-3
    # A motion beside zero ends at once.
    assert symtop.guard(lambda _t, y: 1e12 * y * y, 0.0, [0.0], 1.0, step_size=0.01).error == 0.0
    for start in (0.1, 0.3, 0.7, 1e10):  # where the rounded end of a run is not its horizon
        first, second = (symtop.guard(swing, t0, [1.0, 0.0], 0.6, step_size=0.01)[:4] for t0 in (0.0, start))
        assert second == first


def test_the_step_that_is_advised_keeps_the_accuracy_also_where_the_piece_itself_fails():
    horizon = 20.0 * math.pi
    expected = symtop.guard(kepler, 0.0, at_pericentre(0.3), horizon, step_size=0.1, accuracy=1e-3)
    assert expected.error > 1e-3
    assert 3e-4 < true_error(kepler, at_pericentre(0.3), horizon, "rk4", step_size=expected.setting) < 2e-3
    assert f"over about 11 periods; take a step of about {expected.setting!r}" in str(expected)  # ten orbits
    step, stiffening = 0.8, lambda t, y: [y[1], -(y[0] ** 3)]
    expected = symtop.guard(stiffening, 0.0, [3.0, 0.0], 30.0, step_size=step)
    assert (math.isinf(expected.error), 0.2 * step < expected.setting < 0.4 * step) == (True, True)
    assert f"try a step of {expected.setting!r}" in str(expected)
    assert math.isfinite(symtop.guard(stiffening, 0.0, [3.0, 0.0], 30.0, step_size=expected.setting).error)


@pytest.mark.parametrize(("f", "y0", "control", "words"), [
    (swing, [1.0, 0.0], {"step_size": 0.1, "tolerance": 1.0}, "rk4 needs step_size, and no tolerance"),
    (swing, [1.0, 0.0], {}, "rk4 needs step_size, and no tolerance"),
    (swing, [1.0, 0.0], {"method": "taylor", "tolerance": 1e-9}, "method 'taylor' is unknown"),
    (swing, [1.0, 0.0], {"step_size": 1.5}, "step_size must be at most the horizon 1.0, not 1.5"),
    (swing, [1.0, 0.0], {"method": "bdf", "tolerance": 1e-20}, "tolerance must be at least 2.3e-14 and below 1"),
    (swing, [1.0, 0.0], {"step_size": 0.1, "t0": 1e20}, "horizon must be longer than what t0 = 1e+20 is"),
    (swing, [1.0, 0.0, 2.0], {"step_size": 0.1}, "f must return 3 numbers, not an array of shape (2,)"),
    (lambda t, y: np.float32(y), [1.0], {"step_size": 0.1}, "f must return doubles, not float32: the run"),
    (lambda _t, _y: 1 / 0, [1.0], {"step_size": 0.1}, "f failed: ZeroDivisionError"),
    (lambda _t, _y: [math.nan], [1.0], {"step_size": 0.1}, "f must be finite, not [nan] at t = 0.0"),
    (lambda t, y: y if t < 0.5 else y * math.nan, [1.0], {"step_size": 0.1}, "not [nan] at t = 0."),
])  # fmt: skip
def test_what_makes_no_sense_is_refused_in_one_sentence(f, y0, control, words):
    with pytest.raises(symtop.SymtopError) as info:
        symtop.guard(f, control.pop("t0", 0.0), y0, 1.0, **control)
    assert [words in line for line in str(info.value).splitlines()] == [True]
