"""What does stepping fewer variables save?

The top has three charts of different size, and phi and psi can be eliminated from its equations before or after they
are discretised. Three comparisons: the same integrator in another chart, the same discrete Lagrangian with nothing
eliminated, and the order of reducing and discretising. The second is of two kernels as they are, whose predictors and
rules to stop differ as well: it shows that both are one map, and not what eliminating alone saves.
"""

import math

import xarray as xr
from symtop_studies.grid import ALL_BUT_TWO, grid_scenes

from symtop.measure.settings import ladder
from symtop.methods.framework.registry import integrator, methods
from symtop.model.scenes import TAGS, scene
from symtop.runner.study import Case, Study

from . import facts, figures, measures
from .commutation import reduced_first

FIRST = "spheroid"


def cases(quick: bool) -> list[Case]:
    """Compiled methods with several charts (first scene), with an unreduced form, with a reduced-first step."""
    grid = []
    for name in grid_scenes(TAGS if quick else ALL_BUT_TWO, lambda scene: math.isfinite(scene.nutation_period)):
        start, period = scene(name), scene(name).nutation_period
        several = [
            method
            for method in methods().values()
            if method.implementation == "compiled" and len(method.charts()) > 1 and name == FIRST
        ]
        for method in several[2:6] if quick else several:
            settings = ladder(method, start, measures.CHART_PERIODS * period, 8, 1e5)[1 :: 3 if quick else 2]
            plan = {"settings": settings, "horizon": measures.CHART_PERIODS * period, "batches": 3 if quick else 5}
            grid.append(Case(name, method.name, {"part": "charts", **plan}))
        plan = {"horizon": 8.0 * period, "step_sizes": [period / 30.7, period / 307.0], "batches": 3 if quick else 5}
        grid += [Case(name, reduced, {"part": "twins", **plan}) for reduced in measures.unreduced_forms()]
        plan = {"horizon": 2.0 * period, "counts": [50 * 2**k for k in range(4 if quick else 6)]}
        known = [method.name for method in methods().values() if reduced_first(start, method)]
        grid += [Case(name, method, {"part": "commutation", **plan}) for method in known]
    return grid


def measure(case: Case) -> xr.Dataset:
    """The dataset of a case, by its part: charts, unreduced forms, or commutation."""
    start, method, plan = scene(case.scene), integrator(case.integrator), case.settings
    if plan["part"] == "charts":
        return measures.chart_table(start, method, plan["settings"], plan["horizon"], plan["batches"])
    if plan["part"] == "twins":
        gaps = measures.unreduced_gaps(start, method.name, plan["horizon"], measures.COMPARED_STEPS)
        return gaps.merge(measures.unreduced_cost(start, method.name, plan["step_sizes"], plan["batches"]))
    return measures.commutation_table(start, method, plan["horizon"], plan["counts"])


def uses(case: Case) -> list[str]:
    """The integrators that a case runs: its own, and for a comparison of kernels the unreduced form."""
    name = case.integrator
    return [name, measures.unreduced_forms()[name]] if case.settings["part"] == "twins" else [name]


STUDY = Study(
    name="reduction",
    title="Reduction",
    question="What does stepping fewer variables save?",
    cases=cases, measure=measure, facts=facts.facts, tables=facts.tables, pictures=figures.pictures,
    timed=True, uses=uses,
)  # fmt: skip
