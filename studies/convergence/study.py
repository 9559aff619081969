"""At what rate does the error fall with the step?"""

import math

import xarray as xr

from symtop.measure.accuracy import error_table
from symtop.measure.settings import step_ladder
from symtop.methods.registry import integrator, integrators
from symtop.model.scenes import scene
from symtop.runner.grid import grid_scenes
from symtop.runner.study import Case, Study

from . import figures, words

LEFT_OUT = {
    "goldstein is the same top, let go at another speed": ("goldstein-falling", "goldstein-rising"),
    "loop is the same top, let go at another speed": ("cusp", "wave"),
    "a steady precession, whose angles have other orders": ("steady", "kinon-betsch", "steady-fast"),
    "the coarsest steps are limited by the spin and not by the nutation": ("fast", "simo-wong"),
    "close to a pole, where the angles chart fails": ("bruls-cardona-arnold", "grazing"),
    "unstable or nearly so: errors grow with the motion": ("sleeping", "sleeping-unstable", "separatrix"),
}
NOT_QUICK = {"left to the ordinary grid": ("loop", "hairer-lubich-wanner")}
WHOLE = "spheroid"  # runs to its horizon; the other scenes run for `NUTATIONS` at most
NUTATIONS = 8.0


def cases(quick: bool) -> list[Case]:
    """Every fixed-step method on every scene, from ten steps a nutation to steps so short that rounding rules."""
    grid = []
    for name in grid_scenes(LEFT_OUT | (NOT_QUICK if quick else {})):
        on = scene(name)
        horizon = min(on.horizon, math.inf if name == WHOLE else NUTATIONS * on.nutation_period)
        for method in integrators().values():
            if method.fixed_step:
                steps = step_ladder(method, on, horizon, *((8, 1e5) if quick else (17,)))
                grid.append(Case(name, method.name, {"horizon": horizon, "step_sizes": steps}))
    return grid


def measure(case: Case) -> xr.Dataset:
    """The error table of one method on one scene."""
    on, method = scene(case.scene), integrator(case.integrator)
    return error_table(on, method, case.settings["step_sizes"], case.settings["horizon"], observe="attitude")


STUDY = Study(
    name="convergence",
    title="Convergence",
    question="At what rate does the error fall with the step?",
    how_to_read=(
        "Both axes are logarithmic, so a method of order p is a straight line of slope p. Where a line bends at the "
        "top, the step is too large for the order to show; where it flattens at the bottom, the error has reached "
        "rounding or the grey band, below which the reference cannot judge."
    ),
    cases=cases, measure=measure, pictures=figures.pictures, tables=words.tables, verdict=words.verdict,
)  # fmt: skip
