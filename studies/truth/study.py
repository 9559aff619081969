"""How well is the truth known?

The other studies measure errors against a reference. This one measures the error of the reference: a Taylor integration
in three precisions and two charts, the discrete map iterated, and the closed form in double are compared with the
closed form in 45 digits, and published values are computed again.
"""

import xarray as xr
from symtop_studies.grid import grid_scenes

from symtop.model.scenes import scene
from symtop.run.reference.independent_checks import have_heyoka
from symtop.runner.study import Case, Study

from . import facts, figures
from .measures import SOURCES, source_errors

LEFT_OUT = {  # tags of scenes, with the reason
    "repeats": "the same errors show",
    "family": "the tops of textbooks and benchmarks stand for its regular nutations",
    "fast": "a small nutation",
    "steady": "no nutation",
    "unstable": "errors grow with the motion",
}
LONGEST = {"spheroid": 1e5, "goldstein": 1e4, "hairer-lubich-wanner": 1e4}  # horizons, s; 1e3 elsewhere
AFFORDABLE = {
    "quadruple, attitude": 100.0,
    "discrete map": 1e6,
    "closed form": 1e6,
}  # horizons, s: a limit of machine time, not of accuracy
QUICK = {"quadruple, attitude": 8.0}  # longest horizons of the quick grid, s; 100 elsewhere


def cases(quick: bool) -> list[Case]:
    """Every source on every scene, from t = 8 to as far as it is affordable."""
    grid = []
    for name in grid_scenes(LEFT_OUT):
        for source in SOURCES if have_heyoka() else ("discrete map", "closed form"):
            furthest = AFFORDABLE.get(source, LONGEST.get(name, 1e3))
            if source.startswith("long double"):
                furthest = min(furthest, 1e4)  # takes three times as long as double
            if quick:
                furthest = min(furthest, QUICK.get(source, 100.0))
            horizons = [8.0] + [10.0**k for k in range(2, 7) if 10.0**k <= furthest]
            grid.append(Case(name, source, {"horizons": horizons}))
    return grid


def measure(case: Case) -> xr.Dataset:
    """Error, bound and cost of one source."""
    return source_errors(scene(case.scene), case.integrator, case.settings["horizons"])


STUDY = Study(
    name="truth",
    title="Truth",
    question="How well is the truth known?",
    cases=cases, measure=measure, facts=facts.facts, tables=facts.tables, pictures=figures.pictures,
    uses=lambda _: ["exact-discrete"],  # the discrete map
)  # fmt: skip
