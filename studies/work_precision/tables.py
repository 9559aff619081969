"""The two tables of the work-precision study, and the names of the variables that its figures and words read.

Dimensions: scene, integrator, horizon (in nutation periods), setting (coarse to fine, each method its own), batch.

    step_size or tolerance, setting_value, steps, force_evaluations, newton_iterations, outcome,     of one run
    reached_time
    axis, attitude, theta, energy, p_phi, p_psi     largest error over the run;  _end at the horizon;  _bound the least
                                                    error that the reference can judge
    nutation_period, precession_rate (and _bound)   relative errors of the mean frequencies
    shape, nutation_lag, precession_lag             parts of the axis error
    seconds, seconds_timed, seconds_foreseen, seconds_race, seconds_samples(batch), spread, reliable
                                                    time of one run, see `timing_rounds`
    first_call, seconds_overhead, seconds_per_evaluation, foreseen_miss, seconds_pace                of a method
    stopped(horizon)                                why a method tried nothing finer
"""

import xarray as xr

from symtop.measure.work import spans, work_table
from symtop.methods.registry import integrator
from symtop.model import scenes
from symtop.runner.study import Case

from .timing_rounds import TimedRun, timing_rounds


class Column:
    """Names of the variables that figures and words read."""

    STEP = "step_size"
    TOLERANCE = "tolerance"
    EVALUATIONS = "force_evaluations"
    OUTCOME = "outcome"
    IMPLEMENTATION = "tier"  # compiled, or python
    STOPPED = "stopped"
    AXIS = "axis"
    ENERGY = "energy"
    SHAPE = "shape"
    NUTATION_LAG = "nutation_lag"
    SECONDS = "seconds"
    TIMED = "seconds_timed"  # 1: a measured time, 0: a predicted one
    RELIABLE = "reliable"
    PREDICTION_MISS = "foreseen_miss"


def errors_and_work(case: Case) -> xr.Dataset:
    """Errors and counted work of one method on a scene, over all horizons."""
    scene, periods = scenes.scene(case.scene), case.settings["periods"]
    table = work_table(scene, integrator(case.integrator), spans(scene, periods), case.settings["budget"])
    return table.assign_coords(horizon=periods)


def run_times(case: Case) -> xr.Dataset:
    """Seconds of all runs of a scene; alone on the machine."""
    scene, options = scenes.scene(case.scene), case.settings
    runs = [TimedRun(*run) for run in options["runs"]]
    horizons = spans(scene, options["periods"])
    table = timing_rounds(scene, horizons, runs, options["rounds"], options["batch"], options["size"])
    return table.assign_coords(horizon=options["periods"])
