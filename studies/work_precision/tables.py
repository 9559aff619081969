"""The two tables of the work-precision study.

Dimensions: scene, variant (method[chart]), horizon (in nutation periods), setting (coarse to fine, each variant
its own), target (rad), batch.

    step_size or tolerance, setting_value, steps, force_evaluations, newton_iterations, outcome,     of one run
    reached_time
    axis, attitude, theta, energy, p_phi, p_psi     largest error over the run;  _end at the horizon;  _bound the least
                                                    error that the reference can judge
    nutation_period, precession_rate (and _bound)   relative errors of the mean frequencies
    shape, nutation_lag, precession_lag             parts of the axis error
    seconds, seconds_samples(batch), spread         time of one run, NaN if it was not timed, see `timing_rounds`
    seconds_forecast                                what the variant's other times foretell for it; drawn nowhere
    first_call, implementation, chart, control,     of a variant: seconds of its first run, "compiled" or "python", its
    structured                                      chart, "step_size", "tolerance" or "", 1 if symplectic or symmetric
    set_up_seconds, sample_seconds                  seconds of a variant without steps, NaN of the others
    stopped(horizon)                                why it tried nothing finer
    reached(horizon, target)                        "met", or why not: one of `walk.STOPS`, `TOO_WIDE`, `CAPPED`, or
                                                    the outcome of a variant's runs if none ended well
    nutation_width                                  of a scene: angle between the turning points, rad
"""

import xarray as xr

from symtop.methods.framework.registry import integrator
from symtop.model import scenes
from symtop.runner.study import Case

from .timing_rounds import Effort, TimedRun, timing_rounds
from .walk import spans, work_table


def errors_and_work(case: Case) -> xr.Dataset:
    """Errors and counted work of one variant on a scene, over all horizons."""
    scene, periods, row = scenes.scene(case.scene), case.settings["periods"], integrator(case.integrator)
    table = work_table(scene, row, spans(scene, periods), case.settings["budget"])
    structured = bool(row.symplectic) or bool(row.symmetric)
    traits = {"chart": ((), row.chart_for("axis")), "structured": ((), float(structured))}
    return table.assign(traits).assign_coords(horizon=periods)


def run_times(case: Case) -> xr.Dataset:
    """Seconds of the timed runs of a scene."""
    scene, options = scenes.scene(case.scene), case.settings
    runs = [TimedRun(*run) for run in options["runs"]]
    efforts = (Effort(*options[name]) for name in ("first", "further"))
    return timing_rounds(scene, spans(scene, options["periods"]), runs, *efforts).assign_coords(
        horizon=options["periods"]
    )
