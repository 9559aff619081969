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


def step_ladder(method: Integrator, scene: Scene, horizon: float, count: int = 13, most: float = 4e6) -> list[float]:
    """Steps from ten a nutation down to where the method meets round-off or `most` steps, evenly in the logarithm.

    The finest step of a method of order p resolves a nutation about 10 * 10^(11/p) times; methods of high order, whose
    steps have many stages, begin at five.
    """
    period = scene.time_scale(horizon)
    power = method.order or 2
    first = 10.37 if power <= 4 else 5.37  # nothing here may be commensurate with the nutation
    decades = min(4.5, 11.0 / power + math.log10(10.37 / first), max(math.log10(most * period / horizon / first), 0.5))
    return [period / (first * 10.0 ** (decades * k / (count - 1))) for k in range(count)]


def tolerance_ladder(method: Integrator, count: int = 9) -> list[float]:
    """Tolerances from 1e-2 down to what the method's arithmetic allows, or its patience."""
    tedious = method.tier == "python" and method.explicit is False  # radau at 1e-12: a minute for ten nutations
    decades = -2.0 - math.log10(max(method.least_tolerance, 1e-8 if tedious else 1e-18))
    return [10.0 ** (-2.0 - 0.999 * decades * k / (count - 1)) for k in range(count)]


def ladder(method: Integrator, scene: Scene, horizon: float, count: int = 9, most: float = 4e6) -> list[float]:
    """`count` settings of a method's one knob, coarse to fine; steps end at `most` of them."""
    if method.knob == "step_size":
        return step_ladder(method, scene, horizon, count, most)
    return tolerance_ladder(method, count) if method.knob == "tolerance" else [math.nan]


def knobs(method: Integrator, setting: float) -> dict[str, float | None]:
    """The arguments `step_size` and `tolerance` that a setting of the method's one knob stands for."""
    return {name: setting if method.knob == name else None for name in ("step_size", "tolerance")}


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
            rows.append(dict.fromkeys(rows[-1], math.nan) | {"outcome": "not_run", "tier": method.tier})
            continue
        rows.append(error_row(scene, method, setting, horizon, observe))
        enough = float(rows[-1]["force_evaluations"]) > ENOUGH[method.tier]
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
    knob = knobs(method, setting)
    run = simulate(scene, method, **knob, horizon=horizon, samples=SAMPLES, observe=observe, guard=False)
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
        wide = simulate(scene, method, **knob, horizon=horizon, samples=SAMPLES, observe="attitude", guard=False)
        values = attitude_error(wide, truth)
        row["attitude"], row["attitude_end"] = float(np.max(values)), float(values[-1])
    return row | phase(scene, run, truth)._asdict()


_COUNTS = (
    "step_size", "tolerance", "steps", "force_evaluations", "newton_iterations", "outcome", "reached_time", "tier",
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
