"""The order of a method as an assertion, for the tests of every family, and slopes of discrete Lagrangians."""

import numpy as np

import symtop
from symtop.measure.accuracy import error_table
from symtop.measure.order import LEAST_POINTS, power_law
from symtop.methods.framework.registry import Integrator


def assert_order(
    name: str, method: Integrator, expected: float, band: float, steps: tuple[float, float], quantity: str = "axis"
) -> None:
    """The largest error over three nutations falls by a power within `band`, from `LEAST_POINTS` of ten steps."""
    scene = symtop.scene(name)
    settings = scene.nutation_period / np.geomspace(*steps, 10)
    table = error_table(scene, method, list(settings), 3.0 * scene.nutation_period, observe=quantity)
    error = table[quantity].values
    valid = np.isfinite(error) & (error > 10.0 * table[f"{quantity}_bound"].values) & (error < 1e-2)
    fit = power_law(table["step_size"].values, error, valid)
    assert int(fit.used.sum()) >= LEAST_POINTS, f"{method.name}: only {int(fit.used.sum())} points can be judged"
    assert abs(fit.slope - expected) < band, f"{method.name} on {name}: order {fit}"


def slopes(lagrangian, *arguments, width=1e-30):
    """D1 L_d and D2 L_d, each of shape (2,), by complex steps, to rounding; the last two arguments are its points."""
    *numbers, first, second = arguments
    steps = 1j * width * np.eye(2)
    gradient = [lagrangian(*numbers, first + step, second).imag / width for step in steps]
    return np.array(gradient), np.array([lagrangian(*numbers, first, second + step).imag / width for step in steps])
