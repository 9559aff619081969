"""Does symtop reproduce its notebook, and from when on do discrete methods keep the energy better?

The notebook derives the equations of the heavy top from its Lagrangian, integrates them with a library's solver, and
plots the errors of the energy and of the two momenta. The same solver and equations are compared here with the closed
form.

A discrete Lagrangian conserves the momenta at any step (Noether's theorem, derived in `page.md`) and
generates a symplectic map, which bounds the energy. A Runge-Kutta method in the angles has neither property.
"""

import xarray as xr

from symtop.model.scenes import scene
from symtop.runner.study import Case, Study

from . import facts, figures, measures
from .long_energy import long_energy
from .measures import ALPHA, MODIFIED, SOLVER, SOLVER_TOLERANCE, STEPS_A_NUTATION

SCENES = ("spheroid", "goldstein")  # of the notebook's first and of its second part
QUICK = ("midpoint[angles]", "trapezoidal[angles]", "stormer-verlet[angles]", "strang[axis]", "cayley[axis]")
LONG = 3000.0  # s: some 2500 nutations of the first scene, 1000 of the second


def cases(quick: bool) -> list[Case]:
    """The notebook's solver and every discrete variant, on both scenes."""
    settings = {"shadow_steps": 3 if quick else 6, "long": 0.2 * LONG if quick else LONG}
    methods = [*(QUICK if quick else measures.discrete_methods()), SOLVER]
    return [Case(name, method, settings) for name in SCENES for method in methods]


def measure(case: Case) -> xr.Dataset:
    """Residuals of every method; of the solver also its derivations, of two methods the modified energy."""
    start, method = scene(case.scene), case.integrator
    period = start.nutation_period
    if method == SOLVER:
        parts = [measures.residual_history(start, method, SOLVER_TOLERANCE)]
        parts += [measures.notebook_path(start), measures.both_derivations(start)]
        parts.append(long_energy(start, method, SOLVER_TOLERANCE, case.settings["long"]))
        return xr.merge([*parts, measures.alpha_table(start, ALPHA)] if case.scene == "goldstein" else parts)
    parts = [measures.residual_history(start, method, period / STEPS_A_NUTATION)]
    parts.append(long_energy(start, method, period / STEPS_A_NUTATION, case.settings["long"]))
    if method in MODIFIED:
        steps = [period / (40.3 * 2.0**k) for k in range(case.settings["shadow_steps"])]
        parts.append(measures.modified_energy_table(start, method, steps))
    return xr.merge(parts)


STUDY = Study(
    name="notebook",
    title="The notebook",
    question="Does symtop reproduce its notebook, and from when on do discrete methods keep the energy better?",
    cases=cases, measure=measure, facts=facts.facts, tables=facts.tables, pictures=figures.pictures,
)  # fmt: skip
