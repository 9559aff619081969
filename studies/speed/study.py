"""How fast are the methods that people know at the accuracy I need?

A few methods on a few scenes, each at settings from coarse to fine: the largest errors of a run, its force evaluations,
and the seconds that it takes. A method runs in the angles or the axis chart, and again in the attitude chart for the
error of the attitude, which the axis chart does not show. The closed form, which needs no integrator, is timed beside
them.
"""

import numpy as np
import xarray as xr

from symtop.measure.accuracy import error_table
from symtop.measure.settings import ladder
from symtop.measure.sweep import timed_rows
from symtop.methods.framework.registry import Integrator, integrator, integrators
from symtop.model.scenes import Scene, scene
from symtop.runner.study import REFERENCE, Case, Study

from . import facts, figures

METHODS = {  # and the charts that they run in
    "stormer-verlet": ("angles",), "midpoint": ("angles",), "trapezoidal": ("angles",),
    **dict.fromkeys(
        ("rk4", "rk45-compiled", "dop853-compiled", "gauss-8", "strang", "takahashi-imada", "taylor", "rk45", "dop853",
         "srkn-14-6", "tsit5-fixed", "vern9-fixed", "series"),
        ("axis", "attitude"),
    ),
}  # fmt: skip
SCENES = (facts.SHOWN, "spheroid", "hairer-lubich-wanner", "bruls-cardona-arnold")
LENGTHS = (10.0, 100.0)  # nutations
QUANTITIES = ("axis", "attitude", "energy", "p_phi")
KEPT = ("step_size", "tolerance", "force_evaluations", "seconds", *QUANTITIES, "axis_bound")
SETTINGS, MOST_STEPS = 12, 3e5


def cases(quick: bool) -> list[Case]:
    """Every method that is there, in its charts, and the closed form, on every scene."""
    names = [f"{name}[{chart}]" for name, charts in METHODS.items() if name in integrators() for chart in charts]
    asked = {"lengths": LENGTHS[:1] if quick else LENGTHS, "settings": 7 if quick else SETTINGS}
    places = SCENES[:1] if quick else SCENES
    return [Case(place, name, asked, timed=True) for place in places for name in (REFERENCE, *names)]


def measure(case: Case) -> xr.Dataset:
    """Errors, work and seconds over ``nutations`` and ``setting``."""
    lengths, count = case.settings["lengths"], case.settings["settings"]
    parts = [runs(scene(case.scene), integrator(case.integrator), length, count) for length in lengths]
    return xr.concat(parts, xr.DataArray(list(lengths), dims="nutations", name="nutations"))


def runs(on: Scene, variant: Integrator, length: float, count: int) -> xr.Dataset:
    """A method's runs over so many nutations; those that ended `ok` are timed. The closed form has nothing to set."""
    horizon, (chart,) = length * on.nutation_period, variant.charts()
    settings = ladder(variant, on, horizon, count, MOST_STEPS)
    table = error_table(on, variant, settings, horizon, observe="attitude" if chart == "attitude" else "axis")
    if chart == "attitude" and variant.method != REFERENCE:  # the axis chart has the rest
        table = table.assign({name: table[name] * np.nan for name in ("axis", "energy", "p_phi")})
    outcomes = zip(settings, table["outcome"].values, strict=True)
    rows = [{"setting_value": setting, "outcome": outcome, "seconds": np.nan} for setting, outcome in outcomes]
    timed_rows([(on, variant, horizon, rows)])
    return table.assign(seconds=("setting", [one["seconds"] for one in rows]))[list(KEPT)]


STUDY = Study(
    name="speed",
    title="Speed",
    question="How fast are well-known methods at the accuracy I need?",
    cases=cases, measure=measure, facts=facts.facts, tables=facts.tables, pictures=figures.pictures,
    charts=figures.charts, timed=True,
)  # fmt: skip
