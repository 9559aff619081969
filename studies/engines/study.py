"""How well do the integrators of physics engines follow a top?

Their maps run a slow top and a fast one, from few steps a nutation to many, and at usual step sizes over 10 s and over
1000 s; a random population of tops; and two free bodies without symmetry, a racket that flips and NASA's check case 2.
Some methods of the registry run beside them for comparison.
"""

import functools

import numpy as np
import xarray as xr

from symtop.methods.framework.registry import engines, integrator
from symtop.model.charts import BODY
from symtop.model.exact.closed_form import ClosedForms
from symtop.model.scenes import scene
from symtop.run.ensemble.ensemble import ensemble
from symtop.run.ensemble.population import NUMBERS, population
from symtop.runner.study import Case, Study

from . import facts, figures
from .measures import BODIES, HORIZON, SCENES, axis_angle, followed, frames, ladder

COMPARED = ("strang[axis]", "rk4[axis]", "srkn-11-6[axis]")
ON_BODIES = ("strang[body]", "rk4[body]", "kahan-li-6[body]")
SEED = 1
ORDINARY = {"steps": 1.5e6, "long": 1000.0, "members": 400}
QUICK = {"steps": 3e4, "long": 20.0, "members": 100}
FRAME = 1.0 / 240.0  # step size in units of time, on the population


def variant_names() -> list[str]:
    """Every map on the axis, or the attitude if it has no other chart, and the variants of `COMPARED`."""
    charts = {name: entry.charts() for name, entry in engines().items()}
    return [f"{name}[{'axis' if 'axis' in known else known[0]}]" for name, known in charts.items()] + list(COMPARED)


def cases(quick: bool) -> list[Case]:
    """One case a variant and scene, and one a variant for the population."""
    chosen = QUICK if quick else ORDINARY
    plan, names = {"steps": chosen["steps"], "long": chosen["long"]}, variant_names()
    runs = [Case(scene, name, plan, group="tops") for scene in SCENES for name in names]
    many = {"members": chosen["members"], "seed": SEED}
    free = *(f"{name}[{BODY}]" for name, entry in engines().items() if BODY in entry.solvers), *ON_BODIES
    bodies = [Case(body, name, {}, group="bodies") for body in BODIES for name in free]
    return [*runs, *(Case("population", name, many, group="population") for name in names), *bodies]


@functools.lru_cache(maxsize=2)
def _members(count: int, seed: int) -> tuple[xr.Dataset, np.ndarray, np.ndarray]:
    """Tops, where their axes point after `HORIZON`, and steps a nutation at `FRAME`."""
    tops = population(count, seed=seed)
    forms = ClosedForms(np.stack([tops[name].values for name in NUMBERS], axis=1))
    return tops, forms.axis(np.full((count, 1), HORIZON))[:, 0], np.asarray(forms.nutation_period) / FRAME


def measure(case: Case) -> xr.Dataset:
    """The table of a variant on a scene, the angles at the end on the population, or errors on a body."""
    chosen, row = case.settings, integrator(case.integrator)
    if case.group == "tops":
        there = scene(case.scene)
        return ladder(there, row, chosen["steps"]).merge(frames(there, row, (HORIZON, chosen["long"])))
    if case.group == "bodies":
        return followed(scene(case.scene, bodies=True), row)
    tops, true, per_nutation = _members(chosen["members"], chosen["seed"])
    run = ensemble(tops, row, step_size=FRAME, horizon=HORIZON, samples=2, threads=1, quiet=True)
    angles = axis_angle(run["axis"].values[:, -1], true)
    return xr.Dataset({"off": ("member", angles), "steps_a_nutation": ("member", per_nutation)})


STUDY = Study(
    name="engines",
    title="Physics engines",
    question="How well do the integrators of physics engines follow a top?",
    cases=cases, measure=measure, facts=facts.facts, tables=facts.tables, pictures=figures.pictures,
)  # fmt: skip
