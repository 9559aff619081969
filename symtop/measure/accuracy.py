"""Error against step or tolerance: the table that convergence and work-precision studies are made of."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr

from symtop.base.numbers import EPSILON
from symtop.measure.errors import QUANTITIES, attitude_error, errors_against
from symtop.measure.phase import phase
from symtop.methods.registry import Integrator
from symtop.model.scenes import Scene
from symtop.run.reference import reference
from symtop.run.simulation import simulate

SAMPLES = 331
ENOUGH = {"compiled": 1e9, "python": 2e4}  # force evaluations of a run after which no finer setting is tried


def error_table(
    scene: Scene, method: Integrator, settings: Sequence[float], horizon: float, observe: str | None = None
) -> xr.Dataset:
    """Largest and final error of every quantity at each setting, with the work it took and how it ended.

    Dimension ``setting``. ``axis`` ... hold the maximum over the run, ``axis_end`` ... the error at the horizon,
    ``axis_bound`` ... the least error that the reference can judge (its own bound plus rounding).
    """
    rows: list[dict[str, float | str]] = []
    enough = False
    for setting in settings:
        if enough:
            rows.append(
                dict.fromkeys(rows[-1], math.nan) | {"outcome": "not_run", "implementation": method.implementation}
            )
            continue
        rows.append(error_row(scene, method, setting, horizon, observe))
        enough = float(rows[-1]["force_evaluations"]) > ENOUGH[method.implementation]
    return as_table(rows)


def as_table(rows: Sequence[Mapping[str, float | str]]) -> xr.Dataset:
    """Rows with the same entries as one dataset over ``setting``."""
    return xr.Dataset({name: ("setting", [row[name] for row in rows]) for name in rows[0]})


def error_row(
    scene: Scene,
    method: Integrator,
    setting: float,
    horizon: float,
    observe: str | None = None,
    *,
    phases: bool = False,
) -> dict[str, float | str]:
    """One run's entries in an error table.

    With `phases` also its frequencies, shape error and lags (see `phase`), and, if the chart that shows what is
    observed does not show the attitude, the attitude error of a second run in the chart that does.
    """
    control = method.setting(setting).kwargs()
    run = simulate(scene, method, **control, horizon=horizon, samples=SAMPLES, observe=observe, guard=False)
    truth = reference(scene, run["time"].values, precision="closed-form")
    shown = errors_against(scene, run, truth)
    row: dict[str, float | str] = {name: run.attrs[name] for name in _COUNTS}
    failed = run.attrs["outcome"] != "ok"
    for name in QUANTITIES:
        values = shown[name].values if name in shown else np.array([math.nan])
        row[name] = math.nan if failed else float(np.max(values))
        row[f"{name}_end"] = math.nan if failed else float(values[-1])
        row[f"{name}_bound"] = judge_limit(scene, truth, name)
    if not phases:
        return row
    if not failed and "attitude" not in shown:
        wide = simulate(scene, method, **control, horizon=horizon, samples=SAMPLES, observe="attitude", guard=False)
        values = attitude_error(wide, truth)
        row["attitude"], row["attitude_end"] = float(np.max(values)), float(values[-1])
    return row | phase(scene, run, truth)._asdict()


_COUNTS = (
    "step_size", "tolerance", "steps", "force_evaluations", "newton_iterations", "outcome", "reached_time",
    "implementation",
)  # fmt: skip


def judge_limit(scene: Scene, truth: xr.Dataset, quantity: str) -> float:
    """The reference's largest bound on a quantity over the run, plus the rounding of the compared doubles."""
    if quantity in ("energy", "p_phi", "p_psi"):
        scale = scene.energy_scale if quantity == "energy" else scene.momentum_scale
        return 4.0 * EPSILON * max(1.0, float(np.max(np.abs(truth[quantity].values))) / scale)
    bound = float(np.max(truth[f"{quantity}_error_bound"].values))
    if quantity == "attitude":  # phi and psi come as doubles; their rounding is an angle
        bound += EPSILON * float(np.max(np.abs(truth["phi"].values)) + np.max(np.abs(truth["psi"].values)))
    return bound + EPSILON
