"""How fast are well-known methods at the accuracy I need?

A few methods on a few scenes, each at settings from coarse to fine: the largest errors of a run, its force evaluations,
and its time in seconds. A method runs in the angles or the axis chart, and again in the attitude chart for the error of
the attitude, which the axis chart does not show. All runs on a scene are timed in interleaved order, so that a change
of the machine's speed affects all methods alike. The closed form, which needs no integrator, is among them.
"""

from typing import Any

import numpy as np
import xarray as xr

from symtop.measure.accuracy import error_table
from symtop.measure.settings import ladder
from symtop.measure.sweep import timed_rows
from symtop.methods.framework.registry import Integrator, integrator, integrators
from symtop.model.charts import Array
from symtop.model.scenes import Scene, scene
from symtop.runner.study import REFERENCE, Case, Study

from . import facts, figures

METHODS = {  # and the charts that they run in
    "stormer-verlet": ("angles",), "midpoint": ("angles",), "trapezoidal": ("angles",),
    "galerkin-gauss-8": ("angles",),
    **dict.fromkeys(
        ("rk4", "rk45-compiled", "dop853-compiled", "gauss-8", "strang", "takahashi-imada", "taylor", "rk45", "dop853",
         "srkn-14-6", "tsit5-fixed", "dop853-compiled-fixed", "vern9-fixed", "series"),
        ("axis", "attitude"),
    ),
}  # fmt: skip
SCENES = (facts.SHOWN, "spheroid", "hairer-lubich-wanner", "bruls-cardona-arnold")
LENGTHS = (10.0, 100.0)  # nutations
QUANTITIES = ("axis", "attitude", "energy", "p_phi")
KEPT = ("step_size", "tolerance", "force_evaluations", *QUANTITIES, "axis_bound")
SETTINGS, MOST_STEPS = 12, 3e5


def cases(quick: bool) -> list[Case]:
    """Every method of `METHODS` in the registry, in its charts, and the closed form, on every scene."""
    names = [f"{name}[{chart}]" for name, charts in METHODS.items() if name in integrators() for chart in charts]
    names.insert(0, REFERENCE)
    settings = {"lengths": LENGTHS[:1] if quick else LENGTHS, "settings": 7 if quick else SETTINGS}
    return [Case(place, name, settings) for place in (SCENES[:1] if quick else SCENES) for name in names]


def follow_up(data: xr.Dataset) -> list[Case]:
    """One case for each scene, which times all its runs together, `without` those that have no error."""
    names, lengths = data["variant"].values.tolist(), data["nutations"].values.tolist()
    settings = {"lengths": lengths, "settings": data.sizes["setting"], "integrators": names}
    ended = (data["axis"].notnull() | data["attitude"].notnull()).transpose("scene", "variant", "nutations", "setting")
    without = [np.argwhere(~mask.values).tolist() for mask in ended]  # places of runs, in the order of the last three
    return [
        Case(str(place), "together", settings | {"without": places}, timed=True)
        for place, places in zip(data["scene"].values, without, strict=True)
    ]


def measure(case: Case) -> xr.Dataset:
    """Errors and work, or seconds, over ``nutations`` and ``setting``."""
    on, lengths, count = scene(case.scene), list(case.settings["lengths"]), case.settings["settings"]
    if names := case.settings.get("integrators"):
        ended = np.ones((len(names), len(lengths), count), dtype=bool)
        ended[tuple(np.array(case.settings["without"], dtype=int).reshape(-1, 3).T)] = False
        variants = [integrator(name) for name in names]
        parts = [times(on, variants, length, ended[:, k]) for k, length in enumerate(lengths)]
    else:
        parts = [runs(on, integrator(case.integrator), length, count) for length in lengths]
    return xr.concat(parts, xr.DataArray(lengths, dims="nutations", name="nutations"))


def runs(on: Scene, variant: Integrator, length: float, count: int) -> xr.Dataset:
    """A method's errors and work over so many nutations. The closed form has nothing to set."""
    horizon, (chart,) = length * on.nutation_period, variant.charts()
    observe = "attitude" if chart == "attitude" else "axis"
    table = error_table(on, variant, ladder(variant, on, horizon, count, MOST_STEPS), horizon, observe=observe)
    if chart == "attitude" and variant.method != REFERENCE:  # the axis chart has the rest
        table = table.assign({name: table[name] * np.nan for name in ("axis", "energy", "p_phi")})
    return table[list(KEPT)]


def times(on: Scene, variants: list[Integrator], length: float, ended: Array) -> xr.Dataset:
    """Seconds of the runs that `ended` (variant, setting) well, interleaved in random order, and their spreads."""
    horizon, cells = length * on.nutation_period, []
    for variant, well in zip(variants, ended, strict=True):
        settings = ladder(variant, on, horizon, well.size, MOST_STEPS)
        rows: list[dict[str, Any]] = [
            {"setting_value": setting, "outcome": "ok" if good else "failed"}
            for setting, good in zip(settings, well, strict=False)
        ]
        cells.append((on, variant, horizon, rows))
    timed_rows(cells)
    columns = {name: np.full(ended.shape, np.nan) for name in ("seconds", "seconds_spread")}
    for name, column in columns.items():
        for place, (*_, rows) in enumerate(cells):
            column[place, : len(rows)] = [row.get(name, np.nan) for row in rows]
    coordinates = {"variant": [variant.name for variant in variants]}
    return xr.Dataset({name: (("variant", "setting"), column) for name, column in columns.items()}, coordinates)


STUDY = Study(
    name="speed",
    title="Speed",
    question="How fast are well-known methods at the accuracy I need?",
    cases=cases, measure=measure, follow_up=follow_up,
    facts=facts.facts, tables=facts.tables, pictures=figures.pictures, charts=figures.charts,
)  # fmt: skip
