"""Errors of one variant on one scene: against the steps a nutation, at the steps that people use, and at the same cost.

axis        the largest angle (rad) between the axis and the true one, at a hundred samples
spherical   the same to the axis of the spherical top, I3 := I1, with the same start
energy      the change of the energy at the end, over |E| + |mgl|
spin        the change of L.e at the end, over the largest |L.e| and |L_z| of the start
precession  the azimuth that the axis has run through, less the true one, over the true one: the mean rate's error
forces      evaluations of the torque

On a body without symmetry: the largest angle of attitude and third axis, and relative change of the energy, at the
steps that people use.
"""

import math
from collections.abc import Sequence

import numpy as np
import xarray as xr

from symtop.measure.errors import errors
from symtop.methods.framework.calling import solve
from symtop.methods.framework.plan import Plan
from symtop.methods.framework.registry import Integrator
from symtop.model.charts import axis_of, space_energy, space_momenta
from symtop.model.exact.closed_form import ClosedForms
from symtop.model.scenes import Scene
from symtop.model.top import SymmetricTop, flat
from symtop.run.simulation import simulate

SCENES = ("goldstein", "fast")
BODIES = ("tennis-racket", "check-case-2")  # free
HORIZON = 10.0  # s
PER_NUTATION = 16.0 * 2.0 ** np.arange(16)  # steps
FREQUENCIES = (60.0, 240.0, 1000.0)  # steps a second
SAMPLES = 100
WINDING = 32  # samples a nutation that the azimuth is followed by
NUMBERS = ("axis", "spherical", "energy", "spin", "precession", "forces")


def axis_angle(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """The angle between unit vectors, shape (..., 3) to (...); pi where a run has ended."""
    angle = np.arctan2(np.linalg.norm(np.cross(first, second), axis=-1), np.sum(first * second, axis=-1))
    return np.where(np.isfinite(angle), angle, math.pi)


def azimuth(e: np.ndarray) -> float:
    """The angle (rad) that axes of shape (n, 3) have run through about the vertical; NaN where a run has ended."""
    angles = np.unwrap(np.arctan2(e[:, 1], e[:, 0]))
    return float(angles[-1] - angles[0])


def judged(scene: Scene, variant: Integrator, h: float, horizon: float) -> dict[str, float]:
    """The errors of one run (see the head of this module), by name, and its number of steps."""
    chart, top = variant.charts()[0], scene.top
    steps = max(SAMPLES, round(horizon / h))
    between = max(1, min(math.ceil(WINDING * horizon / (scene.nutation_period * SAMPLES)), steps // SAMPLES))
    marks = np.rint(np.linspace(0.0, steps, SAMPLES * between + 1)).astype(int)
    run = solve(variant, chart, top, scene.start, Plan.steps(h, marks))
    form, ball = (ClosedForms([flat(body, scene.start)]) for body in (top, SymmetricTop(top.I1, top.I1, top.mgl)))
    with np.errstate(over="ignore", invalid="ignore"):  # a run that flies apart
        e, spin = axis_of(chart, run.states), space_momenta(chart, run.states)[1]
        energy = space_energy(top, e, run.states[:, -3:], spin)
    true, shown = form.axis(marks[None] * h)[0], slice(None, None, between)
    sizes = abs(float(form.energy[0])) + abs(top.mgl), max(abs(float(form.p_psi[0])), abs(float(form.p_phi[0])))
    return {
        "axis": float(axis_angle(e[shown], true[shown]).max()),
        "spherical": float(axis_angle(e[shown], ball.axis(marks[None, shown] * h)[0]).max()),
        "energy": float(energy[-1] - energy[0]) / sizes[0],
        "spin": float(spin[-1] - spin[0]) / sizes[1],
        "precession": azimuth(e) / azimuth(true) - 1.0,
        "forces": float(run.force_evaluations),
        "steps": float(steps),
    }


def ladder(scene: Scene, variant: Integrator, max_steps: float) -> xr.Dataset:
    """The axis error within `HORIZON` against steps a nutation, with at most `max_steps` steps in a run."""
    counts = PER_NUTATION[PER_NUTATION * HORIZON / scene.nutation_period <= max_steps]
    runs = [judged(scene, variant, scene.nutation_period / count, HORIZON) for count in counts]
    return xr.Dataset({"axis": ("per_nutation", [run["axis"] for run in runs])}, coords={"per_nutation": counts})


def frames(scene: Scene, variant: Integrator, horizons: tuple[float, float]) -> xr.Dataset:
    """Errors after a short and a long time, at `FREQUENCIES` steps a second, and as many evaluations of the torque."""

    def at(rates: Sequence[float]) -> list[list[dict[str, float]]]:
        return [[judged(scene, variant, 1.0 / rate, horizon) for horizon in horizons] for rate in rates]

    runs = at(FREQUENCIES)
    a_step = max(1, *(round(run["forces"] / run["steps"]) for part in runs for run in part))
    level = runs if a_step == 1 else at([rate / a_step for rate in FREQUENCIES])
    columns = {f"frame_{name}": [[run[name] for run in part] for part in runs] for name in NUMBERS}
    columns["level_axis"] = [[run["axis"] for run in part] for part in level]
    table = xr.Dataset({name: (("rate", "horizon"), values) for name, values in columns.items()})
    return table.assign(forces_a_step=float(a_step)).assign_coords(rate=list(FREQUENCIES), horizon=list(horizons))


def followed(scene: Scene, variant: Integrator) -> xr.Dataset:
    """The largest errors on a body without symmetry within `HORIZON`, at each of `FREQUENCIES`; pi after a failure."""
    rows = {"attitude": [], "axis": [], "energy": []}
    for rate in FREQUENCIES:
        run = simulate(scene, variant, step_size=1.0 / rate, horizon=HORIZON, samples=SAMPLES + 1, guard=False)
        wrong = errors(run)
        for name, row in rows.items():
            value = float(wrong[name].max(skipna=False))
            row.append(value if math.isfinite(value) or name == "energy" else math.pi)
    return xr.Dataset({name: ("rate", row) for name, row in rows.items()}, coords={"rate": list(FREQUENCIES)})
