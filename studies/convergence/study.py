"""At what rate does the error fall with the step, or with the tolerance?"""

import math

import xarray as xr
from symtop_studies.grid import grid_scenes

from symtop.measure.order_table import observable, order_table
from symtop.measure.settings import ladder
from symtop.methods.framework.registry import integrator, variants
from symtop.model.scenes import TAGS, scene
from symtop.runner.study import Case, Study

from . import facts, figures, measures

LEFT_OUT = {  # tags of scenes, with the reason
    "repeats": "the same orders show",
    "steady": "the angles of a steady precession have other orders",
    "fast": "the coarsest steps are limited by the spin and not by the nutation",
    "near_pole": "the angles chart fails",
    "unstable": "errors grow with the motion",
}
WHOLE = "spheroid"  # runs to its horizon; the other scenes run for `NUTATIONS` at most
NUTATIONS = 8.0
MOST_STEPS = 1e6  # limit on the steps of a run
HISTORY = (1000.0, 100.0)  # nutations of the run that shows the energy over time: in full, and quick


def cases(quick: bool) -> list[Case]:
    """Every method in every chart: from ten steps a nutation to steps where rounding dominates, tolerances likewise."""
    names = grid_scenes(TAGS if quick else LEFT_OUT)
    return [case for name in names for case in on_scene(name, quick)]


def on_scene(name: str, quick: bool) -> list[Case]:
    """The cases of one scene."""
    on, grid = scene(name), []
    horizon = min(on.horizon, math.inf if name == WHOLE else NUTATIONS * on.nutation_period)
    for variant in variants():
        if variant.exact_steps or variant.control is None:
            continue  # no step is more accurate than another, or there is nothing to set
        count = (8 if quick else 17) if variant.fixed_step else 5 if quick else 13
        settings = ladder(variant, on, horizon, count, 1e5 if quick else MOST_STEPS)
        chosen = {"horizon": horizon, "settings": settings, "dense": not quick}
        if name == WHOLE and variant.method in measures.NAMED:
            chosen["history"] = HISTORY[quick]
        grid.append(Case(name, variant.name, chosen))
    return grid


def measure(case: Case) -> xr.Dataset:
    """The error table of one method in one chart on one scene, with the attitude where the chart shows it.

    Of the methods in `NAMED` on one scene also the change of the energy over a longer time.
    """
    on, row = scene(case.scene), integrator(case.integrator)
    horizon = case.settings["horizon"]
    table = order_table(on, row, case.settings["settings"], horizon, observable(row), dense=case.settings["dense"])
    history = case.settings.get("history")
    return (table if history is None else table.merge(measures.energy_history(on, row, history))).assign(
        horizon=horizon
    )


STUDY = Study(
    name="convergence",
    title="Convergence",
    question="At what rate does the error fall with the step, or with the tolerance?",
    cases=cases, measure=measure, facts=facts.facts, tables=facts.tables, pictures=figures.pictures,
)  # fmt: skip
