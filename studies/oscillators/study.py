"""What becomes of a discrete Lagrangian when energy is taken away?

The notebook integrated a damped oscillator by the discrete Lagrangian, and stopped at a guess about the forces. What it
was after is done here: the virtual work of the force F over one step splits into F_d^- at its start and F_d^+ at its
end, and the forced discrete Euler-Lagrange equations are

    D1 L_d(q1, q2) + D2 L_d(q0, q1) + F_d^-(q1, q2) + F_d^+(q0, q1) = 0.

In momenta: p1 - p0 = (what the potential gives) + F_d^- + F_d^+, Noether's theorem with a right-hand side. The momentum
of a cyclic coordinate changes by the discrete forces and by nothing else.
"""

import xarray as xr

from symtop.model.scenes import scene
from symtop.runner.study import Case, Study

from . import figures, words
from .tables import (
    FRICTION,
    HORIZON,
    LONG,
    ONE_SIDED,
    RK45,
    RULES,
    convergence,
    damped_top_table,
    decay,
    notebook_history,
    scene_name,
)

DAMPINGS = (0.0, 0.1, 1.0, 2.0, 3.0, 4.0)  # with m = k = 1: 2 is critical
AGAINST_RK45 = (0.0, 0.1)
TOPS = {"goldstein": 40.0, "spheroid": 8.0}  # horizons, s


def cases(quick: bool) -> list[Case]:
    """Every damping with both rules and the one-sided force; two of them against RK45; two damped tops."""
    steps = [10.0 ** (-k / 4.0) for k in range(13 if quick else 17)]
    long_step = 0.1 if quick else 0.05
    grid = [
        Case(scene_name(b), method, {"damping": b, "steps": steps, "long_step": long_step})
        for b in DAMPINGS
        for method in (*RULES, ONE_SIDED)
    ]
    grid += [Case(scene_name(b), RK45, {"damping": b, "long_step": long_step}) for b in AGAINST_RK45]
    counts = [1000 * 2**k for k in range(4 if quick else 6)]
    return grid + [
        Case(name, method, {"counts": counts, "horizon": horizon})
        for name, horizon in list(TOPS.items())[: 1 if quick else 2]
        for method in (*RULES, RK45)
    ]


def measure(case: Case) -> xr.Dataset:
    """Errors against the analytic solution, or against the damped top's truth."""
    settings, method = case.settings, case.integrator
    if "damping" not in settings:
        return damped_top_table(scene(case.scene), FRICTION, method, settings["counts"], settings["horizon"])
    data = decay(settings["damping"], method, settings["long_step"], LONG)
    if method != RK45:
        data = data.merge(convergence(settings["damping"], method, settings["steps"], HORIZON))
    return data.merge(notebook_history(settings["damping"], 0.1, HORIZON)) if method == "midpoint" else data


def verdict(data: xr.Dataset) -> list[str]:
    """Orders, the notebook's update, decay and balance."""
    return [words.orders(data), words.update(data), words.energy(data), words.balance(data)]


STUDY = Study(
    name="oscillators",
    title="Oscillators and friction",
    question="What becomes of a discrete Lagrangian when energy is taken away?",
    how_to_read=words.HOW_TO_READ,
    cases=cases,
    measure=measure,
    pictures=figures.pictures,
    tables=words.tables,
    verdict=verdict,
)
