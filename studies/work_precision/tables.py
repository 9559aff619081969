"""The two tables of the work-precision study.

Dimensions: scene, integrator, horizon (in nutation periods), setting (coarse to fine, each method its own), batch.

    step_size or tolerance, setting_value, steps, force_evaluations, newton_iterations, outcome,     of one run
    reached_time
    axis, attitude, theta, energy, p_phi, p_psi     largest error over the run;  _end at the horizon;  _bound the least
                                                    error that the reference can judge
    nutation_period, precession_rate (and _bound)   relative errors of the mean frequencies
    shape, nutation_lag, precession_lag             parts of the axis error
    seconds, seconds_samples(batch), spread         time of one run, NaN if it was not timed, see `timing_rounds`
    first_call, implementation                      of a method: seconds of its first run, "compiled" or "python"
    stopped(horizon)                                why it tried nothing finer
"""

import xarray as xr

from symtop.measure.work import spans, work_table
from symtop.methods.registry import integrator
from symtop.model import scenes
from symtop.runner.study import Case

from .timing_rounds import Effort, TimedRun, timing_rounds


def errors_and_work(case: Case) -> xr.Dataset:
    """Errors and counted work of one method on a scene, over all horizons."""
    scene, periods = scenes.scene(case.scene), case.settings["periods"]
    table = work_table(scene, integrator(case.integrator), spans(scene, periods), case.settings["budget"])
    return table.assign_coords(horizon=periods)


def run_times(case: Case) -> xr.Dataset:
    """Seconds of the timed runs of a scene; alone on the machine."""
    scene, options = scenes.scene(case.scene), case.settings
    runs = [TimedRun(*run) for run in options["runs"]]
    efforts = (Effort(*options[name]) for name in ("first", "further"))
    return timing_rounds(scene, spans(scene, options["periods"]), runs, *efforts).assign_coords(
        horizon=options["periods"]
    )
