"""What becomes of a discrete Lagrangian under friction?

The notebook integrated a damped oscillator by the discrete Lagrangian, and stopped at a guess about the forces. Here
they follow from the virtual work of the force F over one step, which splits into F_d^- at its start and F_d^+ at its
end; the forced discrete Euler-Lagrange equations are

    D1 L_d(q1, q2) + D2 L_d(q0, q1) + F_d^-(q1, q2) + F_d^+(q0, q1) = 0.

Without friction the harmonic oscillator has an exact discrete Lagrangian in closed form. So have the planar quartic
oscillator (`quartic`) and, by two of these, the top (`exact-discrete`).
"""

import xarray as xr

from symtop.methods.lagrangian.damped_oscillator import ONE_SIDED
from symtop.model.scenes import scene
from symtop.runner.study import Case, Study

from . import facts, figures, measures, quartic_measures
from .measures import AGAINST_RK45, HORIZON, LONG, OSCILLATORS, RK45, RULES, TOPS


def cases(quick: bool) -> list[Case]:
    """Every damping with both rules and the one-sided force; two of them against RK45; damped tops; quartic ones."""
    steps = [10.0 ** (-k / 4.0) for k in range(13 if quick else 17)]
    counts = [1000 * 2**k for k in range(4 if quick else 6)]
    grid = []
    for name, oscillator in OSCILLATORS.items():
        plan = {"damping": oscillator.damping, "long_step": 0.1 if quick else 0.05}
        grid += [Case(name, method, {**plan, "steps": steps}) for method in (*RULES, ONE_SIDED)]
        grid += [Case(name, RK45, plan)] if name in AGAINST_RK45 else []
    for name in list(TOPS)[: 1 if quick else 2]:
        grid += [Case(name, method, {"counts": counts, "horizon": TOPS[name]}) for method in (*RULES, RK45)]
    plan = {"periods": quartic_measures.PERIODS, "steps": list(quartic_measures.STEPS)}
    grid += [Case(name, method, plan) for name in quartic_measures.QUARTICS for method in quartic_measures.MAPS]
    return grid


def measure(case: Case) -> xr.Dataset:
    """Errors against the analytic solution or the damped top's reference; ``chart`` names the variables of the run."""
    plan, method = case.settings, case.integrator
    if case.scene in quartic_measures.QUARTICS:
        table = quartic_measures.quartic_table(case.scene, method, plan["steps"], plan["periods"])
        return table.assign(chart="position")
    if case.scene not in OSCILLATORS:
        table = measures.damped_top_table(scene(case.scene), method, plan["counts"], plan["horizon"])
        return table.assign(chart="angles")
    oscillator = OSCILLATORS[case.scene]
    data = measures.decay(oscillator, method, plan["long_step"], LONG).assign(chart="position")
    if method != RK45:
        data = data.merge(measures.convergence(oscillator, method, plan["steps"], HORIZON))
    return data.merge(measures.notebook_history(oscillator, 0.1, HORIZON)) if method == "midpoint" else data


STUDY = Study(
    name="oscillators",
    title="Oscillators and friction",
    question="What becomes of a discrete Lagrangian under friction?",
    cases=cases, measure=measure, facts=facts.facts, tables=facts.tables, pictures=figures.pictures,
)  # fmt: skip
