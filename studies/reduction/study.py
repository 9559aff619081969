"""What does modelling less buy?

The top has three charts of different size, and phi and psi can be eliminated from its equations before or after they
are discretised. Each saving is measured by itself: a smaller chart with the same integrator, the same discrete
Lagrangian with nothing eliminated, and the order of reducing and discretising.
"""

import xarray as xr

from symtop.measure.settings import ladder
from symtop.methods.registry import integrator, integrators
from symtop.model.scenes import added_scenes, scene
from symtop.runner.study import Case, Study

from . import figures, words
from .commutation import reduced_first
from .tables import (
    COMPARED_STEPS,
    chart_table,
    commutation_table,
    several_charts,
    unreduced_cost,
    unreduced_form,
    unreduced_gaps,
    with_unreduced_form,
)

SCENES = ["spheroid", "goldstein"]
CHART_PERIODS = 32.0  # nutations: long enough that the call itself does not count


def cases(quick: bool) -> list[Case]:
    """Every method with several charts (first scene), with an unreduced form, and with a reduced-first step."""
    grid = []
    for name in [*(SCENES[:1] if quick else SCENES), *added_scenes()]:
        period = scene(name).nutation_period
        several = several_charts() if name == SCENES[0] else []
        for method in several[:6] if quick else several:
            settings = ladder(method, scene(name), CHART_PERIODS * period, 8, 1e5)[1 :: 3 if quick else 2]
            plan = {"settings": settings, "horizon": CHART_PERIODS * period, "batches": 2 if quick else 3}
            grid.append(Case(name, method.name, {"part": "charts", **plan}))
        for reduced in with_unreduced_form():
            steps = [period / 30.7, period / 307.0]
            plan = {"horizon": 8.0 * period, "step_sizes": steps, "batches": 3 if quick else 5}
            grid.append(Case(name, reduced, {"part": "twins", **plan}))
        counts = [round(50 * 2**k) for k in range(4 if quick else 6)]
        grid += [
            Case(name, method.name, {"part": "commutation", "horizon": 2.0 * period, "counts": counts})
            for method in integrators().values()
            if reduced_first(scene(name), method)
        ]
    return grid


def measure(case: Case) -> xr.Dataset:
    """The part of the question that a case asks."""
    start, method, plan = scene(case.scene), case.integrator, case.settings
    if plan["part"] == "charts":
        return chart_table(start, integrator(method), plan["settings"], plan["horizon"], plan["batches"])
    if plan["part"] == "twins":
        gaps = unreduced_gaps(start, method, plan["horizon"], COMPARED_STEPS)
        return gaps.merge(unreduced_cost(start, method, plan["step_sizes"], plan["batches"]))
    return commutation_table(start, integrator(method), plan["horizon"], plan["counts"])


def uses(case: Case) -> list[str]:
    """The integrators that a case runs: its own, and for a comparison of kernels the unreduced form."""
    form = unreduced_form(case.integrator) if case.settings["part"] == "twins" else None
    return [case.integrator, *([form] if form else [])]


def verdict(data: xr.Dataset) -> list[str]:
    """One sentence a comparison."""
    return [words.commuting(data), words.eliminating(data), *words.larger_charts(data)]


STUDY = Study(
    name="reduction",
    title="Reduction",
    question="What does modelling less buy?",
    how_to_read=words.HOW_TO_READ,
    cases=cases,
    measure=measure,
    pictures=figures.pictures,
    tables=words.tables,
    verdict=verdict,
    timed=True,
    uses=uses,
)
