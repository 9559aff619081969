"""The guard of anybody's equations: forecasts of motions that are no body's, causes, and what is refused."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import symtop
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


def stiff(t, y):
    return [-1000.0 * (y[0] - math.cos(t)) - math.sin(t)]


def swing(_, y):
    return [y[1], -y[0]]


def measured(f, y0, horizon, name, **control):
    """The error of the run itself, by SciPy or by steps of rk4."""
    h = control.get("step_size")
    times = np.linspace(0.0, horizon, 401) if h is None else h * np.arange(round(horizon / h) + 1)
    if h is None:
        tolerance = control["tolerance"]
        states = solve_ivp(f, (0.0, horizon), y0, name.upper(), times, rtol=tolerance, atol=tolerance).y
    else:
        steps = [np.array(y0)]
        for _ in times[1:]:
            steps.append(rk4(lambda t, y: np.array(f(t, y)), 0.0, steps[-1], h))
        states = np.array(steps).T
    truth = solve_ivp(f, (0.0, times[-1]), y0, "DOP853", times, rtol=3e-14, atol=1e-14).y
    return float(np.linalg.norm(states - truth, axis=0).max())


REGULAR = [
    (kepler, at_pericentre(0.3), 10, "rk4", {"step_size": 0.06}),
    (kepler, at_pericentre(0.3), 40, "dop853", {"tolerance": 1e-8}),
    (kepler, at_pericentre(0.6), 10, "rk4", {"step_size": 0.03}),
    (kepler, at_pericentre(0.6), 20, "rk45", {"tolerance": 1e-8}),
    (henon_heiles, of_energy(1.0 / 12.0, 0.1), 20, "rk4", {"step_size": 0.1}),
    (henon_heiles, of_energy(1.0 / 12.0, -0.1), 20, "rk45", {"tolerance": 1e-7}),
]  # fmt: skip


@pytest.mark.parametrize(("f", "y0", "periods", "name", "control"), REGULAR)
def test_a_regular_motion_is_forecast_within_a_factor_of_three(f, y0, periods, name, control):
    horizon = 2.0 * math.pi * periods
    expected = symtop.guard(f, 0.0, y0, horizon, name, **control)
    assert 1.0 / 3.0 < expected.error / measured(f, y0, horizon, name, **control) < 3.0
    assert expected.cause in ("", "step")


def test_chaos_is_told_from_order():
    y0, horizon = of_energy(1.0 / 6.0, -0.1), 300.0
    chaotic = symtop.guard(henon_heiles, 0.0, y0, horizon, "rk45", tolerance=1e-6)
    assert chaotic.cause == "instability"
    assert "the motion multiplies a small change" in str(chaotic)
    regular = symtop.guard(henon_heiles, 0.0, of_energy(1.0 / 12.0, 0.1), horizon, "rk45", tolerance=1e-6)
    assert regular.cause != "instability"
    assert chaotic.amplification > 100.0 * regular.amplification


@pytest.mark.parametrize(
    ("f", "y0", "horizon", "name", "control", "cause"),
    [
        (stiff, [1.0], 10.0, "rk4", {"step_size": 0.01}, "stiffness"),
        (stiff, [1.0], 10.0, "radau", {"tolerance": 1e-8}, ""),
        (swing, [1.0, 0.0], 100.0, "rk4", {"step_size": 3.0}, "instability"),
        (swing, [1.0, 0.0], 100.0, "rk4", {"step_size": 0.5}, "step"),
        (swing, [1.0, 0.0], 30.0, "vern9-fixed", {"step_size": 0.1, "accuracy": 1e-15}, "rounding"),
    ],
)  # fmt: skip
def test_each_cause_is_named(f, y0, horizon, name, control, cause):
    expected = symtop.guard(f, 0.0, y0, horizon, name, **control)
    assert expected.cause == cause, str(expected)
    assert str(expected).startswith(f"{name}: expect an error of ")
    assert "\n" not in str(expected)


def test_the_step_that_is_advised_keeps_the_accuracy():
    horizon = 20.0 * math.pi
    expected = symtop.guard(kepler, 0.0, at_pericentre(0.3), horizon, step_size=0.1, accuracy=1e-3)
    assert expected.error > 1e-3
    assert 3e-4 < measured(kepler, at_pericentre(0.3), horizon, "rk4", step_size=expected.setting) < 2e-3


@pytest.mark.parametrize(
    ("f", "y0", "control", "words"),
    [
        (swing, [1.0, 0.0], {"step_size": 0.1, "tolerance": 1.0}, "rk4 takes step_size, not tolerance"),
        (swing, [1.0, 0.0], {}, "step_size must be a finite number, not None"),
        (swing, [1.0, 0.0], {"method": "taylor", "tolerance": 1e-9}, "method 'taylor' is unknown"),
        (swing, [1.0, 0.0], {"method": "rk45", "step_size": 0.1}, "rk45 takes tolerance, not step_size"),
        (swing, "ab", {"step_size": 0.1}, "y0 must be a row of numbers, not 'ab'"),
        (swing, [1.0, 0.0, 2.0], {"step_size": 0.1}, "f must return 3 numbers, not an array of shape (2,)"),
        (lambda _t, _y: 1 / 0, [1.0], {"step_size": 0.1}, "f failed: ZeroDivisionError"),
        (lambda _t, _y: [math.nan], [1.0], {"step_size": 0.1}, "f must be finite, not [nan] at t = 0.0"),
    ],
)  # fmt: skip
def test_what_makes_no_sense_is_refused_in_one_sentence(f, y0, control, words):
    with pytest.raises(symtop.SymtopError) as refused:
        symtop.guard(f, 0.0, y0, 1.0, **control)
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)
