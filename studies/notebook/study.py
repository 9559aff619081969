"""Does symtop reproduce the notebook that it began with, and why do the discrete methods win there?

The notebook derives the equations of the heavy top from its Lagrangian, integrates them with a library's solver, and
watches the energy and the two momenta slip. Its figures are drawn again here by its own means, beside the truth.

A discrete Lagrangian conserves the momenta at any step (Noether's theorem, derived in `words.HOW_TO_READ`) and
generates a symplectic map, which bounds the energy. A Runge-Kutta method in the angles has neither property.
"""

import xarray as xr

from symtop.model.scenes import scene
from symtop.runner.study import Case, Study

from . import figures, tables, words
from .tables import ALPHA, FILMED, MODIFIED, SOLVER, SOLVER_TOLERANCE, STEPS_A_NUTATION

SCENES = ("spheroid", "goldstein")  # of the notebook's first and of its second part
QUICK = ("midpoint", "trapezoidal", "stormer-verlet", "strang", "cayley")


def cases(quick: bool) -> list[Case]:
    """The notebook's solver and every discrete method, on both scenes."""
    settings = {"film": 20 if quick else 80, "shadow_steps": 3 if quick else 6}
    methods = [*(QUICK if quick else tables.discrete_methods()), SOLVER]
    return [Case(name, method, settings) for name in SCENES for method in methods]


def measure(case: Case) -> xr.Dataset:
    """Residuals of every method; beside them the solver's derivations, the modified energy, the film."""
    start, method = scene(case.scene), case.integrator
    period = start.nutation_period
    if method == SOLVER:
        parts = [tables.residual_history(start, method, SOLVER_TOLERANCE)]
        parts += [tables.notebook_path(start), tables.both_derivations(start)]
        return xr.merge([*parts, tables.alpha_table(start, ALPHA)] if case.scene == "goldstein" else parts)
    parts = [tables.residual_history(start, method, period / STEPS_A_NUTATION)]
    if method in MODIFIED:
        steps = [period / (40.3 * 2.0**k) for k in range(case.settings["shadow_steps"])]
        parts.append(tables.modified_energy_table(start, method, steps))
    if method == FILMED:
        parts.append(tables.film_table(start, method, period / 30.0, 2.0 * period, case.settings["film"]))
    return xr.merge(parts)


STUDY = Study(
    name="notebook",
    title="The notebook",
    question="Does it reproduce the notebook that it began with, and why do the discrete methods win there?",
    how_to_read=words.HOW_TO_READ,
    cases=cases, measure=measure, pictures=figures.pictures, tables=words.tables, verdict=words.verdict,
)  # fmt: skip
