"""Does symtop reproduce the notebook that it began with, and why do the discrete methods win there?

The notebook derives the equations of the heavy top from its Lagrangian, integrates them with a library's solver, and
watches the energy and the two momenta slip. Its figures are drawn again here by its own means, beside the truth.

A discrete Lagrangian conserves the momenta at any step. Its equations D1 L_d(q_k, q_(k+1)) + D2 L_d(q_(k-1), q_k) = 0
say that the momentum p+ = D2 L_d with which a step ends is the momentum p- = -D1 L_d with which the next one begins. If
L_d does not change when phi is shifted at both ends of a step, then (D1 + D2) L_d = 0 along phi, hence p-_phi = p+_phi
over each step too: p_phi is constant. This is Noether's theorem, with no term neglected. L_d also generates a
symplectic map, which bounds the energy (see `tables`). A Runge-Kutta method in the angles has neither property.
"""

import xarray as xr

from symtop.model.scenes import scene
from symtop.runner.study import Case, Study

from . import figures, words
from .tables import (
    ALPHA,
    FILMED,
    MODIFIED,
    SOLVER,
    SOLVER_TOLERANCE,
    STEPS_A_NUTATION,
    alpha_table,
    both_derivations,
    discrete_methods,
    film_table,
    modified_energy_table,
    notebook_path,
    residual_history,
)

SCENES = ("spheroid", "goldstein")  # of the notebook's first and of its second part
QUICK = ("midpoint", "trapezoidal", "stormer-verlet", "strang", "cayley")


def cases(quick: bool) -> list[Case]:
    """The notebook's solver and every discrete method, on both scenes."""
    settings = {"film": 20 if quick else 80, "shadow_steps": 3 if quick else 6}
    methods = [*(QUICK if quick else discrete_methods()), SOLVER]
    return [Case(name, method, settings) for name in SCENES for method in methods]


def measure(case: Case) -> xr.Dataset:
    """Residuals of every method; beside them the solver's derivations, the modified energy, the film."""
    start, method = scene(case.scene), case.integrator
    period = start.nutation_period
    if method == SOLVER:
        data = residual_history(start, method, SOLVER_TOLERANCE)
        data = data.merge(notebook_path(start)).merge(both_derivations(start))
        return data.merge(alpha_table(start, ALPHA)) if case.scene == "goldstein" else data
    data = residual_history(start, method, period / STEPS_A_NUTATION)
    if method in MODIFIED:
        steps = [period / (40.3 * 2.0**k) for k in range(case.settings["shadow_steps"])]
        data = data.merge(modified_energy_table(start, method, steps))
    if method == FILMED:
        data = data.merge(film_table(start, method, period / 30.0, 2.0 * period, case.settings["film"]))
    return data


def verdict(data: xr.Dataset) -> list[str]:
    """What was reproduced, what was matched or corrected, and why the discrete methods win."""
    return [words.reproduced(data), words.matched(), words.corrected(data), words.momenta(data), words.energy(data)]


STUDY = Study(
    name="notebook",
    title="The notebook",
    question="Does it reproduce the notebook that it began with, and why do the discrete methods win there?",
    how_to_read=words.HOW_TO_READ,
    cases=cases,
    measure=measure,
    pictures=figures.pictures,
    tables=words.tables,
    verdict=verdict,
)
