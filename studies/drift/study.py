"""What happens to energy, momenta and phase over a million steps?"""

import math
from collections.abc import Iterable

import xarray as xr
from symtop_studies.drift.runs import rounding, run_history, windows
from symtop_studies.grid import grid_scenes

from symtop.measure.settings import smallest_charts
from symtop.methods.framework.registry import Integrator, integrator
from symtop.model.scenes import TAGS, Scene, scene
from symtop.run.long_run import PER_NUTATION
from symtop.runner.study import Case, Study

from . import facts, figures
from .measures import HISTORIES, HORIZONS, ROUNDINGS, WINDOWS
from .phase_loss import MOST_STEPS, SHORT, TARGET, phase_loss

LONG = "spheroid"  # the scene of the long runs and of the losses of phase
LEFT_OUT = {  # tags of scenes, with the reason; a million steps of every method take minutes on each scene
    "ordinary": "spheroid and goldstein show it",
    "repeats": "the same drift shows",
    "fast": "a step is limited by the spin",
    "steady": "no nutation",
    "near_pole": "the angles chart fails",
    "unstable": "errors grow with the motion",
}
STEPS_A_NUTATION = 118.02  # not commensurate with the nutation
TOLERANCE = 1e-8  # of every adaptive method without a default of its own
SHORTENED = {  # share of the horizon: over all of it they take between 15 s (lsoda) and 8 minutes (radau) on each scene
    "rk45": 0.05, "dop853": 0.05, "lsoda": 0.05, "radau": 0.005, "taylor-quad": 0.005,
}  # fmt: skip
MEASURES = {HISTORIES: run_history, WINDOWS: windows, ROUNDINGS: rounding, HORIZONS: phase_loss}


def cases(quick: bool) -> list[Case]:
    """A million steps of every fixed-step variant (adaptive ones: the same horizon); losses of phase; long runs.

    An attitude chart beside an axis chart is left out: it steps the same axis, and no constant or phase differs.
    """
    if quick:
        return grid(20_000, 2, 100_000, 200_000, 0.1, TAGS)
    return grid(1_000_000, 24, 10_000_000, 100_000_000, 1.0)


def full() -> list[Case]:
    """An ensemble of 10^8 and a run of 10^9 steps each of four methods."""
    return grid(1_000_000, 24, 100_000_000, 1_000_000_000, 1.0)


def grid(
    steps: int, members: int, walk: int, longest: int, share: float,
    left_out: Iterable[str] = LEFT_OUT,
) -> list[Case]:  # fmt: skip
    """Histories of `steps`, windows of `longest`, ensembles of `walk` steps, and losses over `share` of their time."""
    long_run = {"steps": longest, "per_nutation": PER_NUTATION}
    ensemble = {"steps": walk, "per_nutation": PER_NUTATION, "count": members}
    loss = {"short": share * SHORT, "target": share * TARGET, "most": share * MOST_STEPS}
    variants = smallest_charts("nutation")
    return [
        *(Case(name, row.name, history_settings(scene(name), row, steps), group=HISTORIES)
          for name in grid_scenes(left_out, lambda scene: math.isfinite(scene.nutation_period))
          for row in variants),
        *(Case(LONG, row.name, settings, group=group) for row in variants if row.modified_energy
          for group, settings in ((WINDOWS, long_run), (ROUNDINGS, ensemble))),
        *(Case(LONG, row.name, loss, group=HORIZONS) for row in variants if row.fixed_step and not row.exact_steps),
    ]  # fmt: skip


def history_settings(on: Scene, method: Integrator, steps: int) -> dict[str, float]:
    """So many steps of a fixed-step method, or the same horizon at a tolerance.

    A Taylor method has a default tolerance, the rounding of its arithmetic, and keeps it: its order grows as the
    tolerance falls, so that a looser one is another method and not the same one with less work.
    """
    horizon = steps * on.nutation_period / STEPS_A_NUTATION
    settings = {"samples": 4001 if steps > 100_000 else 601, "horizon": horizon * SHORTENED.get(method.method, 1.0)}
    if method.fixed_step:
        return settings | {"step_size": horizon / steps}
    chooses = method.adaptive and method.default_tolerance is None
    return settings | ({"tolerance": TOLERANCE} if chooses else {})


def measure(case: Case) -> xr.Dataset:
    """A history with its growth, the windows of a long run, an ensemble, or a loss of phase, by the case's group."""
    return MEASURES[case.group](scene(case.scene), integrator(case.integrator), **case.settings)


STUDY = Study(
    name="drift",
    title="Drift",
    question="What happens to energy, momenta and phase over a million steps?",
    cases=cases, full=full, measure=measure, facts=facts.facts, tables=facts.tables, pictures=figures.pictures,
)  # fmt: skip
