"""The order of a method as an assertion, for the tests of every family."""

import numpy as np

import symtop
from symtop.measure.accuracy import error_table
from symtop.measure.order import LEAST, Fit, power_law
from symtop.methods.framework.registry import Integrator


def measured_order(
    scene: str, method: Integrator, steps: tuple[float, float], quantity: str, nutations: float = 3.0
) -> Fit:
    """Slope of the largest error over ten steps between two numbers of steps a nutation, where it can be judged."""
    chosen = symtop.scene(scene)
    settings = chosen.nutation_period / np.geomspace(*steps, 10)
    table = error_table(chosen, method, list(settings), nutations * chosen.nutation_period, observe=quantity)
    error = table[quantity].values
    valid = np.isfinite(error) & (error > 10.0 * table[f"{quantity}_bound"].values) & (error < 1e-2)
    return power_law(table["step_size"].values, error, valid)


def assert_order(
    scene: str, method: Integrator, expected: float, band: float, steps: tuple[float, float], quantity: str = "axis"
) -> None:
    """The order is within `band` of what is expected, from at least `LEAST` points."""
    fit = measured_order(scene, method, steps, quantity)
    assert int(fit.used.sum()) >= LEAST, f"{method.name}: only {int(fit.used.sum())} points can be judged"
    assert abs(fit.slope - expected) < band, f"{method.name} on {scene}: order {fit}"
