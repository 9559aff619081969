"""field(): the equations for anybody's solver are those of the motion, in all charts, in NumPy and compiled."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import symtop
from symtop.model import charts
from tests.conftest import random_scenes

CHARTS = ("angles", "axis", "attitude")


@pytest.mark.parametrize("chart", CHARTS)
@pytest.mark.parametrize("compiled", [False, True])
def test_a_solver_of_scipy_follows_the_motion(chart, compiled):
    scene = symtop.scene("goldstein")
    f = symtop.field(chart, scene.top, compiled=compiled)
    run = solve_ivp(f, (0.0, 10.0), f.state(scene.start), method="DOP853", rtol=1e-11, atol=1e-11, dense_output=True)
    y = run.y[:, -1]
    truth = symtop.reference(scene, [run.t[-1]])
    if chart == "angles":
        axis = charts.axis_from_angles(y[0], y[1])
    else:
        axis = y[:3] if chart == "axis" else charts.axis_from_quaternion(y[:4])
    assert float(charts.axis_distance(axis, truth["axis"].values[0])) < 1e-8


@pytest.mark.parametrize("chart", CHARTS)
def test_numpy_and_compiled_are_one_function(chart):
    for scene in random_scenes(5, seed=3):
        plain, fast = (symtop.field(chart, scene.top, compiled=compiled) for compiled in (False, True))
        y = plain.state(scene.start)
        np.testing.assert_allclose(plain(0.0, y), fast(1.0, y), rtol=1e-14, atol=1e-14)
        np.testing.assert_array_equal(fast.kernel(*fast.parameters, y), fast(0.0, y))
        assert y.shape == ((7,) if chart == "attitude" else (6,))


def test_the_attitude_takes_its_spin_from_the_state():
    """A field of one top serves every start: the kernels' own holds the spin of one."""
    scene = symtop.scene("spheroid")
    f = symtop.field("attitude", scene.top)
    for spin in (0.0, 3.0, 80.0):
        start = symtop.Angles(theta=0.7, psi_dot=spin)
        y, h = f.state(start), 1e-6
        truth = symtop.ClosedForm(scene.top, start).quaternion([h])[0]
        assert np.abs(truth - (y[:4] + h * f(0.0, y)[:4])).max() < 1e-8


def test_a_pole_of_the_angles_is_nan_and_no_other_chart_has_one():
    top = symtop.SymmetricTop(2.0, 1.0, 1.0)
    start = symtop.Angles(theta=0.0, theta_dot=1.0, psi_dot=2.0)
    for chart in ("axis", "attitude"):
        f = symtop.field(chart, top)
        assert np.isfinite(f(0.0, f.state(start))).all()
    assert math.isnan(symtop.field("angles", top)(0.0, np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0]))[4])


@pytest.mark.parametrize("compiled", [False, True])
@pytest.mark.parametrize("chart", CHARTS)
def test_a_state_of_another_shape_is_refused(chart, compiled):
    """Compiled code does not look where an array ends."""
    size = 7 if chart == "attitude" else 6
    f = symtop.field(chart, symtop.SymmetricTop(1.0, 0.5, 1.0), compiled=compiled)
    for shape in ((3,), (13 - size,), (size, 3), (size, 1), (0,), ()):
        with pytest.raises(symtop.SymtopError) as refused:
            f(0.0, np.ones(shape))
        assert str(refused.value) == f"y must have the shape ({size},) in the chart {chart}, not {shape}"
    for value in ("abcdef", None, [1.0, 2.0], [[1.0], [2.0, 3.0]]):
        with pytest.raises(symtop.SymtopError, match="y must"):
            f(0.0, value)
    y = f.state(symtop.Angles(1.0, psi_dot=2.0))
    for same in (list(y), np.repeat(y, 2)[::2]):
        np.testing.assert_array_equal(f(0.0, same), f(0.0, y))
