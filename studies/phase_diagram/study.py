"""Which method is the cheapest for an accuracy over a horizon, from ten nutations to a billion?

A case is a variant, a method in one chart, on a population of random tops or on one scene; one more, alone on the
machine, times a force evaluation of each variant. A second round runs ten cells that were foretold, to see whether
they are right.
"""

import xarray as xr

from symtop.methods.framework.registry import integrator, variants
from symtop.runner.study import Case, Study

from ..population.prices import PROCESSES, prices
from . import figures, words
from .checks import check, chosen
from .runs import POPULATION, ladder, tops_of
from .tables import CHECKS, LADDERS, PRICES, SCENE

SEED = 1
CANDIDATES = (  # what can win: the cheapest variants of each family in `population` and `work_precision`
    "stormer-verlet[angles]", "midpoint[angles]", "strang[axis]", "takahashi-imada[axis]", "chin-4a[axis]",
    "aba-10-4[axis]", "srkn-14-6[axis]", "kahan-li-8[axis]", "sofroniou-spaletta-10[axis]", "gauss-4[axis]",
    "gauss-8[axis]", "gauss-12[axis]", "rk4[axis]", "rk45-compiled[axis]", "series[axis]", "series-adaptive[axis]",
    "taylor[axis]",
)  # fmt: skip
FULL = {"members": 16, "levels": 13, "steps": 1.2e6, "budget": 2.5e6}
FULL_SCENE = {"members": 1, "levels": 13, "steps": 5e6, "budget": 5e6}
QUICK = {"members": 4, "levels": 10, "steps": 1e5, "budget": 2e5}
CHECKED = {False: 1e8, True: 4e6}  # force evaluations of one run of a check, by quick


def candidates() -> list[str]:
    """The variants of `CANDIDATES` that this machine has: heyoka's Taylor series may be missing."""
    there = {variant.name for variant in variants()}
    return [name for name in CANDIDATES if name in there]


def grid(quick: bool) -> list[Case]:
    """Every candidate on the population and on the scene, and the prices."""
    names = candidates()
    timing = {"integrators": names, "rounds": 3 if quick else 6, "batch": 0.001 if quick else 0.002}
    asked = {POPULATION: QUICK if quick else FULL, SCENE: QUICK | {"members": 1} if quick else FULL_SCENE}
    return [
        *(Case(tops, name, {**settings, "seed": SEED}, group=LADDERS)
          for tops, settings in asked.items() for name in names),
        *(Case(process, "together", timing, timed=True, group=PRICES) for process in PROCESSES),
    ]  # fmt: skip


def follow_up(data: xr.DataTree) -> list[Case]:
    """The cells to check, each a case: the cheapest variant and the next, at the settings around the target."""
    quick = float(data[LADDERS]["reach"].max()) < 1e6
    return [
        Case(SCENE, f"check-{place}", settings, group=CHECKS)
        for place, settings in enumerate(chosen(data, CHECKED[quick]))
    ]


def measure(case: Case) -> xr.Dataset:
    """The errors of a variant at all horizons, the prices, or a cell run in full."""
    asked = case.settings
    if case.group == PRICES:
        return prices(asked["integrators"], asked["rounds"], asked["batch"])
    if case.group == CHECKS:
        return check(asked)
    tops = tops_of(case.scene, asked["members"], asked["seed"])
    return ladder(integrator(case.integrator), tops, asked["levels"], asked["steps"], asked["budget"])


STUDY = Study(
    name="phase_diagram",
    title="Phase diagram",
    question="Which method is the cheapest for an accuracy over a horizon, from ten nutations to a billion?",
    how_to_read=words.HOW_TO_READ,
    cases=grid,
    measure=measure,
    pictures=figures.pictures,
    tables=words.tables,
    verdict=words.sentences,
    follow_up=follow_up,
)
