"""Long names and units of the columns of error tables and of every study's dataset, each declared once.

`COLUMNS` holds them by study, or study/group, and name: ``"axis"`` is an error in one study and a variable of a
trajectory in `symtop.core.netcdf.VARIABLES`. An entry is (long name, units in SI, units of a problem without any where
they differ); seconds that a machine took are seconds anyway, and text has no units. Numbers that stand for words are
in `FLAGS`, and become ``flag_values`` and ``flag_meanings`` of the CF conventions.
"""

from collections.abc import Iterator

import numpy as np

from symtop.core import netcdf
from symtop.measure.errors import ERRORS
from symtop.measure.verdicts import VERDICTS

TIME, STEP, RATE = ("s", "1"), ("s", "1"), ("s-1", "1")  # of a problem that may have no units
ENERGY, MOMENTUM = ("kg m2 s-2", "1"), ("kg m2 s-1", "1")
Columns = dict[str, tuple[str, ...]]

ERROR_TABLE: Columns = {
    f"{name}{end}": (words.format(what), unit)
    for name, (what, unit) in ERRORS.items()
    for end, words in (
        ("", "largest {} over the run"),
        ("_end", "{} at the horizon"),
        ("_bound", "least {} that the reference can tell from none, largest over the run"),
    )
}
ANY: Columns = {  # of every dataset that has several scenes or variants
    "scene": ("name of the scene",),
    "variant": ("name of the variant: a method in one chart, method[chart]",),
    "integrator": ("name of the integrator",),
    "chart": ("chart that the variant steps in",),
    "implementation": ("is the method compiled, or in plain Python?",),
    "control": ("what sets the accuracy of the variant: step_size, tolerance, or nothing",),
    "quantity": ("quantity whose error is judged",),
    "stratum": ("kind of motion that a top was drawn for",),
    "seconds": ("time of a run, the smallest of its samples", "s"),
    "seconds_samples": ("time of a run, every sample", "s"),
    "spread": ("spread of the samples of a time: (median - minimum) / minimum", "1"),
    "first_call": ("time of the first call, with compilation", "s"),
    "sample_time": ("time of a sample since the start", *TIME),
}
PRICES: Columns = {
    "priced_at": ("tolerance at which a force evaluation was timed", "1"),
    "spread": ("largest spread of the samples of the times, or by how much two processes differ, relative", "1"),
    **{
        f"{kind}{end}": (f"time of a force evaluation {words}, without that of the call, {which}", "s")
        for kind, words in (("alone", "in a run of one top"), ("together", "in one call for many tops"))
        for end, which in (
            ("", "the least of two processes"),
            ("_half", "of each of two processes"),
            ("_by", "by the tolerance, the least of two processes"),
            ("_by_half", "by the tolerance, of each of two processes"),
        )
    },
}
CONSTANTS = {
    "energy": "change of the energy since the start, relative to E0 - min V",
    "p_phi": "change of p_phi since the start, relative to the larger momentum",
    "p_psi": "change of p_psi since the start, relative to the larger momentum",
}
KEPT = CONSTANTS | {"phase": "phase of the nutation ahead of the true one"}


def _history(name: str, what: str) -> Iterator[tuple[str, tuple[str, ...]]]:
    """The columns that say what became of a quantity over a run; a phase is an angle and has no trend."""
    unit = "rad" if name == "phase" else "1"
    yield f"{name}_largest", (f"largest {what}, absolute value over the run", unit)
    if name != "phase":
        yield f"{name}_residual", (what, unit)
        yield f"{name}_slope", (f"slope of the linear trend of the {what}", *RATE)
        yield f"{name}_interval", (f"half-width of the 95 % interval of {name}_slope", *RATE)
        yield f"{name}_rise", (f"rise of the linear trend over the run, of the {what}", "1")
    yield f"{name}_exponent", (f"exponent of growth with time of the {what}", "1")
    yield f"{name}_exponent_interval", (f"half-width of the 95 % interval of {name}_exponent", "1")
    yield f"{name}_law", (f"law by which the absolute value grows, of the {what}",)
    yield f"{name}_change", (f"time at which one law of growth gives way to another, of the {what}", *TIME)
    yield f"{name}_before", (f"exponent of growth before {name}_change", "1")
    yield f"{name}_after", (f"exponent of growth after {name}_change", "1")


LADDER: Columns = {  # of the study of populations, over either horizon
    "cost": ("force evaluations that reach the target; inf if none do, NaN if it was not asked", "1"),
    "met_at": ("tolerance that reaches the target, in tenths of a decade below 1; 0 if there is none", "1"),
    "setting": ("steps a nutation, or the tolerance", "1"),
    "target": ("error to be reached: rad for axis and attitude, relative to E0 - min V for energy", "1"),
    "runs": ("number of members judged", "1"),
    "wrong": ("number of members whose axis error is too large for the motion to be right", "1"),
    "ended": ("number of members whose run ended ok", "1"),
    "silent": ("number of wrong members that ended ok and kept the energy and both momenta", "1"),
    "order": ("declared order of the method", "1"),
    "budget": ("most force evaluations of a run", "1"),
    "made": ("number of runs made", "1"),
    "evaluated": ("number of force evaluations of all runs", "1"),
    "foretold": ("largest axis error over the run that the guard foretells, against the true axis", "rad"),
    "measured": ("largest angle between the axis and the true axis over the run", "rad"),
    "watched": ("largest change over the run of energy (relative to E0 - min V) or of a momentum (to the larger)", "1"),
    "whole": ("was the guard's trial the whole run, so that nothing was foretold?", "1"),
    "nutations": ("length of the run, in nutations", "1"),
}

COLUMNS: dict[str, Columns] = {
    "claims": {
        "claim": ("property that an integrator may claim",),
        "declared": ("what the integrator claims; empty if nothing",),
        "measured": ("what was measured of the claim",),
        "verdict": ("verdict on the claim: confirmed, refuted, measured, undecided or inapplicable",),
        "why": ("reason of the verdict",),
        "value": ("number that the verdict rests on", "1"),
        "resolution": ("least value that the measurement can tell from a true claim", "1"),
        "step_size": ("step of the runs that show the order", *STEP),
        "error": ("error against the true attitude, or the true axis where the chart has no attitude", "rad"),
        "fitted": ("did the fit of the order use this error?", "1"),
        "defect_width": ("width of the differences that the defect of the bracket is read from", "1"),
        "bracket_defect": ("largest difference of the Poisson brackets after a step from those before", "1"),
        "steps_run": ("number of steps of the long run", "1"),
        "nutations_run": ("length of the long run, in nutations", "1"),
        "long_nutations": ("time in the long run, in nutations", "1"),
        "energy_change": (f"largest {CONSTANTS['energy']}, around long_nutations", "1"),
        "chart": ("charts that the claims were judged in",),
    },
    "convergence": {
        "history_time": ("time since the start", *TIME),
        "history_energy": (f"{CONSTANTS['energy']}, absolute value", "1"),
        "history_tolerance": ("tolerance of the run that shows the energy over time; NaN for a fixed step", "1"),
        "extended_step": ("step of a run in long double", *STEP),
        "extended_error": ("angle between the axis of a run in long double and the true axis, at the horizon", "rad"),
        "extended_bound": ("least extended_error that the reference in long double can tell from none", "rad"),
    },
    "drift/histories": {
        **dict(column for name, what in KEPT.items() for column in _history(name, what)),
        "nutations": ("length of the run, in nutations", "1"),
        "steps_a_nutation": ("steps in a nutation; NaN for an adaptive method", "1"),
        "own_tolerance": ("did the method run at a default tolerance of its own?", "1"),
    },
    "drift/windows": {
        "steps": ("number of steps at the end of the window", "1"),
        **{
            f"{name}_{part}": (f"{part} over the window, {what}", unit)
            for part in ("least", "largest", "mean")
            for name, what, unit in (
                *((name, what, "1") for name, what in CONSTANTS.items()),
                ("modified_energy", CONSTANTS["energy"].replace("the energy", "the modified energy"), "1"),
                ("theta", "nutation angle", "rad"),
            )
        },
    },
    "drift/rounding": {
        "elapsed": ("steps of a random walk between the mean over the first window and that over this one", "1"),
        "p_phi": (f"largest {CONSTANTS['p_phi']}, of all members, with compensated sums", "1"),
        "p_psi": (f"largest {CONSTANTS['p_psi']}, of all members, with compensated sums", "1"),
        "gain": ("what compensated sums gain: plain_late over late", "1"),
        **{
            f"{prefix}{name}": (f"{words}, with {sums} sums", "1")
            for prefix, sums in (("", "compensated"), ("plain_", "plain"))
            for name, words in (
                ("drift", "mean modified energy over the window less that over the first, relative to E0 - min V"),
                ("rms", "root mean square of drift over the members"),
                ("end", "last rms of the drift of the modified energy"),
                ("exponent", "exponent of growth with the number of steps of the rms"),
                ("exponent_interval", "half-width of the 95 % interval of the exponent"),
                ("late", "rms over the last decade of steps, of the members that ran with both sums"),
            )
        },
    },
    "drift/horizons": {
        "steps": ("steps a nutation", "1"),
        "evaluations": ("force evaluations a nutation", "1"),
        "predicted": ("nutations after which the phase error reaches its tolerance, from a short run", "1"),
        "short": ("length of the run that predicts, in nutations", "1"),
        "measured": ("nutations after which the phase error has reached its tolerance", "1"),
        "ratio": ("predicted over measured", "1"),
        "nutations": ("time since the start of the run that measures, in nutations", "1"),
        "phase": (KEPT["phase"], "rad"),
        "exponent": ("exponent of growth with time of the phase error in the last decade", "1"),
        "exponent_interval": ("half-width of the 95 % interval of the exponent", "1"),
    },
    "engines/tops": {
        "axis": ("largest angle between the axis and the true axis over the run, by steps a nutation", "rad"),
        "frame_axis": ("largest angle between the axis and the true axis over the run, by steps a second", "rad"),
        "frame_spherical": ("largest angle between the axis and that of the spherical top, I3 = I1", "rad"),
        "frame_energy": ("change of the energy at the end since the start, relative to |E| + |mgl|", "1"),
        "frame_spin": ("change of L.e at the end since the start, relative to the larger of |L.e| and |L_z|", "1"),
        "frame_precession": ("error of the azimuth run through at the end, relative to that of the true axis", "1"),
        "frame_forces": ("number of evaluations of the torque", "1"),
        "level_axis": ("largest angle between the axis and the true axis, at equal evaluations of the torque", "rad"),
        "forces_a_step": ("evaluations of the torque in a step", "1"),
        "per_nutation": ("steps in a nutation", "1"),
        "rate": ("steps a second", *RATE),
        "horizon": ("length of the run", *TIME),
    },
    "engines/population": {
        "off": ("angle between the axis and the true axis at the horizon; pi where the run has ended", "rad"),
        "steps_a_nutation": ("steps in a nutation of the member", "1"),
    },
    "factors": {
        "variant": ("scheme, in a language, in a chart",),
        "setting": ("step or tolerance at which the variant meets the target", "1"),
        "reason": ("why the variant has no setting; empty if it has one",),
        "horizon": ("length of the run, in nutations", "1"),
        "target": ("largest angle between the axis and the true axis over the run that is to be met", "rad"),
        "call": ("how the kernel is called",),
    },
    "notebook": {
        "energy": ("total energy", *ENERGY),
        "p_phi": ("momentum conjugate to phi", *MOMENTUM),
        "p_psi": ("momentum conjugate to psi", *MOMENTUM),
        **{f"{name}_residual": (what, "1") for name, what in CONSTANTS.items()},
        **{f"{name}_largest": (f"largest {what}, absolute value", "1") for name, what in CONSTANTS.items()},
        "long_time": ("time since the start of a longer run", *TIME),
        "long_energy": (f"largest {CONSTANTS['energy']}, absolute value up to long_time", "1"),
        "shadow_step_size": ("step of the runs whose modified energy is known", *STEP),
        "shadow_time": ("time since the start, at the first shadow_step_size", *TIME),
        "energy_swing": (f"largest {CONSTANTS['energy']}, absolute value over the run", "1"),
        "energy_swing_history": (f"{CONSTANTS['energy']}, over shadow_time", "1"),
        "modified_swing": ("largest change of the modified energy since the start, relative to E0 - min V", "1"),
        "modified_swing_history": ("change of the modified energy since the start, relative to E0 - min V", "1"),
        "frame_time": ("time of a frame of the film since the start", *TIME),
        "frame_attitude": ("attitude of the run in a frame, body to space, (w, x, y, z)", "1"),
        "true_attitude": ("true attitude in a frame, body to space, (w, x, y, z)", "1"),
        "path_time": ("time since the start", *TIME),
        "hard_theta": ("nutation angle by the notebook's solver", "rad"),
        "hard_phi": ("precession angle by the notebook's solver", "rad"),
        "hard_theta_dot": ("rate of theta by the notebook's solver", "rad s-1", "rad"),
        "true_theta": ("nutation angle of the true motion", "rad"),
        "true_phi": ("precession angle of the true motion", "rad"),
        "true_theta_dot": ("rate of theta of the true motion", "rad s-1", "rad"),
        "both_time": ("time since the start", *TIME),
        "ways_gap": ("largest difference of any angle of one derivation from that of the other", "rad"),
        "hard_gap": ("largest difference of any angle of the second-order equations from the true angle", "rad"),
        "easy_gap": ("largest difference of any angle of the equations without momenta from the true angle", "rad"),
        "energy_gap": ("|E1 + p_psi^2/2 I3 - E|, the difference of the two energies relative to E0 - min V", "1"),
        "cosine": ("u = cos(theta)", "1"),
        "cubic_at_rest": ("the nutation's cubic, u'^2 against u, for a start at rest", "s-2", "1"),
        "cubic_printed": ("the nutation's cubic, u'^2 against u, for the printed alpha", "s-2", "1"),
        "alpha_at_rest": ("alpha = 2 E1/I1 of the cubic for a start at rest", "s-2", "1"),
        "alpha_rate": ("rate of theta at the start that the printed alpha means, absolute value", "rad s-1", "rad"),
        "alpha_time": ("time since the start", *TIME),
        "theta_at_rest": ("nutation angle after a start at rest", "rad"),
        "theta_falling": ("nutation angle after a start with the printed alpha and falling theta", "rad"),
        "theta_rising": ("nutation angle after a start with the printed alpha and rising theta", "rad"),
    },
    "oscillators": {
        "scene": ("name of the oscillator or damped top",),
        "variant": ("rule of the discrete Lagrangian, map, or solver",),
        "chart": ("what was stepped: position, angles or plane",),
        "sample_time": ("time since the start, times sqrt(k/m)", "1"),
        "energy_error": ("error of the energy relative to that of the exact solution at the same time", "1"),
        "evaluations": ("number of force evaluations", "1"),
        "step_size": ("step, times sqrt(k/m)", "1"),
        "position_error": ("largest error of the position over the run against the exact one, over the start", "1"),
        "exponent_error": ("error of the slow exponent of decay, relative to the exact one", "1"),
        "seed_time": ("time since the start, times sqrt(k/m)", "1"),
        "analytic": ("position by the exact solution, over the start", "1"),
        "seed_update": ("position by the notebook's update, over the start", "1"),
        "seed_guess": ("position by the notebook's guess at the forces, over the start", "1"),
        "update_gap": ("distance of the notebook's update from the midpoint rule, over the start", "1"),
        "top_bound": ("largest difference of two references of the damped top, in any angle", "rad"),
        "top_step_size": ("step of a run of the damped top", *STEP),
        "theta_error": ("largest error of theta over the run, against the reference of the damped top", "rad"),
        "top_time": ("time since the start of the damped top", *TIME),
        "theta": ("nutation angle of the damped top", "rad"),
        "true_theta": ("nutation angle of the damped top by its reference", "rad"),
        "p_phi": ("momentum conjugate to phi of the damped top", *MOMENTUM),
        "p_psi": ("momentum conjugate to psi of the damped top", *MOMENTUM),
        "balance_phi": ("p_phi + c_phi phi since the start, relative to the larger momentum; zero if true", "1"),
        "balance_psi": ("p_psi + c_psi psi since the start, relative to the larger momentum; zero if true", "1"),
        "quartic_step": ("step, in periods of the quartic oscillator", "1"),
        "quartic_error": ("largest error of the position over the run, relative to the largest |x|", "1"),
        "quartic_orbit": ("|x|^2 of the points of a discrete orbit, over the largest one", "1"),
        "curve_here": ("|x(t)|^2 of the true motion, over the largest one", "1"),
        "curve_ahead": ("|x(t + h)|^2 of the true motion, over the largest one", "1"),
        "constant_a": ("constant A of the exact map", "1"),
        "constant_b": ("constant B of the exact map, over -sigma h^2", "1"),
        "constant_delta": ("angle delta by which the exact map turns in a step", "rad"),
        "gap_a": ("difference of the constant A of the exact map from McMillan's", "1"),
        "gap_b": ("difference of the constant B of the exact map from McMillan's", "1"),
        "gap_delta": ("difference of the angle delta of the exact map from McMillan's, which is zero", "rad"),
    },
    "peers": {
        "variant": ("method of a library, in a chart",),
        "end_error": ("angle between the axis and the true axis at the end of the inner loop", "rad"),
        "control_setting": ("step or tolerance", "1"),
        "call": ("public call or inner loop",),
        "reliable": ("is the spread of the samples small enough for a verdict?", "1"),
        "package": ("library",),
        "version": ("version of the library",),
        "language": ("language of the force, and who calls it",),
        "formulation": ("method and equations",),
        "shows": ("what the public call returns",),
    },
    "phase_diagram/ladders": {
        "error": ("largest error up to the horizon: rad for axis, relative to E0 - min V for energy, u for shape", "1"),
        "power": ("leading power of the horizon in the law of the error", "1"),
        "slope": ("exponent of growth with the horizon of the error", "1"),
        "interval": ("half-width of the 95 % interval of the slope", "1"),
        "work": ("force evaluations a nutation", "1"),
        "walk": ("smallest energy error over sqrt(evaluations) of any setting: a step of the walk of rounding", "1"),
        "setting_value": ("steps a nutation, or the tolerance", "1"),
        "reach": ("last horizon that was measured, in nutations", "1"),
        "conserves_energy": ("does the variant keep the energy by construction?", "1"),
        "horizon": ("length of the run, in nutations", "1"),
    },
    "phase_diagram/prices": PRICES,
    "phase_diagram/checks": {
        "variant": ("number of the check",),
        "errors": ("largest error up to checked_horizon, measured: rad for axis, relative for energy and shape", "1"),
        "work": ("force evaluations a nutation", "1"),
        "setting_value": ("steps a nutation, or the tolerance, coarser and finer", "1"),
        "contender": ("variant: the foretold winner and the next",),
        "target": ("error to be reached: rad for axis, relative to E0 - min V for energy", "1"),
        "checked_horizon": ("length of the run, in nutations", "1"),
    },
    "population/short": LADDER,
    "population/long": LADDER,
    "population/prices": PRICES,
    "population/tops": {
        "stratum_place": ("place in stratum of the kind of motion that the top was drawn for", "1"),
        "width": ("width of the nutation: angle between the turning points", "rad"),
        "regime": ("extremes of u = cos(theta), then asinh(p/sqrt(I1 |mgl|)) of p_psi and p_phi", "1"),
        "known": ("has the top a nutation and a closed form?", "1"),
    },
    "reduction": {
        "chart": ("chart that the method steps in",),
        "kernel": ("is it the reduced kernel, or its unreduced form?",),
        "variant": ("method, in each of its charts",),
        "theta_gap": ("difference of theta of the reduced kernel from that of its unreduced form", "rad"),
        "phi_gap": ("difference of phi of the reduced kernel from that of its unreduced form", "rad"),
        "psi_gap": ("difference of psi of the reduced kernel from that of its unreduced form", "rad"),
        "p_phi_drift": (f"{CONSTANTS['p_phi']}, absolute value, of the unreduced form", "1"),
        "p_psi_drift": (f"{CONSTANTS['p_psi']}, absolute value, of the unreduced form", "1"),
        "seconds_per_step": ("time of a step", "s"),
        "iterations_per_step": ("iterations of a step", "1"),
        "twin_step_size": ("step at which a kernel and its unreduced form are timed", *STEP),
        "commutation_step_size": ("step at which reducing first and last are compared", *STEP),
        "commutation_gap": ("largest difference in theta between reducing first and reducing last", "rad"),
    },
    "stability": {
        "outcome": ("verdict on a run of the map", "1"),
        "checks": ("number of runs that checked scenes which had settled as accurate", "1"),
        "refuted": ("number of scenes that had settled as accurate and were then not", "1"),
        "parameter_value": ("row of the map: spin over that of sleeping, or (grazing) gap to the pole in rad", "1"),
        "control": ("column of the map: step in nutation periods, or the tolerance", "1"),
        "knob_name": ("what the columns of the map set: step_size, tolerance or none",),
        "grid": ("settings x rows of the map",),
        "limit_parameter": ("spin, over that of sleeping, at which the limits of a step are given", "1"),
        "linear_limit": ("longest step that is linearly stable, in nutation periods", "1"),
        "third_turn": ("step that turns a small nutation by a third, in nutation periods", "1"),
        "shown_knob": ("step in nutation periods, or tolerance, at which grazing_error is given", "1"),
        "grazing_error": ("largest angle between the axis and the true axis over the run", "rad"),
        "early_error": ("angle between the axis and the true axis at an early time next to the separatrix", "rad"),
        "horizon": ("time at which the axis error is lost, measured next to the separatrix", *TIME),
        "predicted_horizon": ("time at which the axis error is lost, predicted from early_error", *TIME),
        "broken": ("did the run end before the axis error was lost?", "1"),
        "phase_value": ("h omega: step times the angular frequency of small nutations", "rad"),
        "surviving": ("largest displacement of a steady precession that stays near it", "rad"),
        "displaced_steps": ("number of steps of a displaced precession", "1"),
        "limit_phase": ("h omega of the linear limit", "rad"),
        "third_turn_phase": ("h omega at which a step turns a small nutation by a third", "rad"),
        "window_start": ("h omega before the first narrow window of unstable steps", "rad"),
        "window_end": ("h omega behind the first narrow window of unstable steps", "rad"),
        "sought_phase": ("largest h omega at which limits were looked for", "rad"),
        "surviving_at_third_turn": ("largest displacement that survives at a third of a turn a step", "rad"),
        "surviving_past_third_turn": ("largest displacement that survives beyond a third of a turn a step", "rad"),
        "sleeping_step": ("step of the upright top of I1 = I3 = mgl = 1", "1"),
        "sleeping_threshold": ("spin w3 at which that top begins to sleep; that of the motion is 2", "1"),
        "energy_once": ("largest |E - E0| seen once a nutation", *ENERGY),
        "energy_every": ("largest |E - E0| seen at every step", *ENERGY),
        "sampled_steps": ("steps a nutation of the sampled run", "1"),
        "sampled_periods": ("length of the sampled run, in nutations", "1"),
        "solver_step": ("step of the runs that vary the tolerance of the solver", *STEP),
        "solver_steps": ("number of steps of the runs that vary the tolerance of the solver", "1"),
        "one_iteration_energy": ("largest |E - E0| of the textbook's solver after one iteration a step", *ENERGY),
        "solver_tolerance": ("tolerance of the solver of an implicit step", "1"),
        "solver_energy": ("largest |E - E0| of the run", *ENERGY),
        "solver_momentum": ("largest |p - p0| of p_phi and p_psi over the run", *MOMENTUM),
        "solver_iterations": ("iterations of a step", "1"),
        "plain_energy": ("largest |E - E0| of the run with the textbook's solver", *ENERGY),
    },
    "sweep": {
        "message": ("what a run that raised an exception said",),
        "made_of": ("digest of all that the numbers of a cell depend on",),
    },
    "truth": {
        "variant": ("source of truth",),
        "horizon": ("time up to which the source was run", *TIME),
        "axis": ("largest distance of the axis from the closed form in 45 digits, over the last nutation", "rad"),
        "axis_bound": ("bound on the error of the axis that the source claims; NaN if it claims none", "rad"),
        "seconds": ("time of the run", "s"),
    },
    "work_precision": {
        "shape": ("largest distance of (u, u'/omega) from the true orbit, u = cos(theta): the error of the shape", "1"),
        "nutation_lag": ("largest lag of the nutation behind the true one", "rad"),
        "precession_lag": ("largest angle by which the axis is turned about the vertical from the true one", "rad"),
        "nutation_period": ("error of the mean period of the nutation, relative to the true one", "1"),
        "precession_rate": ("error of the mean rate of precession, relative to the true one", "1"),
        "nutation_period_bound": ("least error of nutation_period that the reference can tell from none", "1"),
        "precession_rate_bound": ("least error of precession_rate that the reference can tell from none", "1"),
        "setting_value": ("step in units of the scene's time, or the tolerance", "1"),
        "stopped": ("why the variant tried nothing finer",),
        "reached": ("was the target met? or why not",),
        "nutation_width": ("width of the nutation: angle between the turning points", "rad"),
        "structured": ("is the method symplectic or symmetric?", "1"),
        "horizon": ("length of the run, in nutations", "1"),
        "target": ("largest angle between the axis and the true axis over the run that is to be met", "rad"),
        "seconds_forecast": ("time of a run that the variant's other times foretell", "s"),
        "set_up_seconds": ("time before the first sample, of a variant without steps", "s"),
        "sample_seconds": ("time of each sample, of a variant without steps", "s"),
    },
}  # fmt: skip

NO_YES = {0: "no", 1: "yes"}
FLAGS: dict[str, dict[int, str]] = {
    "stability/outcome": {**dict(enumerate(VERDICTS)), 254: "settled_as_accurate_and_not_run", 255: "no_such_run"},
    "claims/fitted": NO_YES,
    "drift/histories/own_tolerance": NO_YES,
    "peers/reliable": NO_YES,
    "phase_diagram/ladders/conserves_energy": NO_YES,
    "population/short/whole": NO_YES,
    "population/long/whole": NO_YES,
    "population/tops/known": NO_YES,
    "stability/broken": NO_YES,
    "work_precision/structured": NO_YES,
}


def described(data: netcdf.Tree, table: str, units: str = "") -> netcdf.Tree:
    """Give the columns of a study's dataset, or of another `table` of `COLUMNS`, their long names, units and flags.

    `units` are those of `netcdf.describe`. A group with an ``axis_bound`` is an error table, whosever study it is; what
    `COLUMNS` does not have keeps the long name that it may have been given.
    """
    for group, variables in ((path, one.variables) for path, one in netcdf.groups(data).items()):
        scope = f"{table}/{group}" if group else table
        own, errors = COLUMNS.get(scope, {}), ERROR_TABLE if "axis_bound" in variables else {}
        known = netcdf.VARIABLES | ANY | errors | own
        for name, variable in variables.items():
            if name in own or (name in known and "long_name" not in variable.attrs):
                variable.attrs.update(netcdf.label(known[str(name)], units, " in units of the scene"))
            if flags := FLAGS.get(f"{scope}/{name}"):
                values = np.array(list(flags), variable.dtype)
                variable.attrs.update(flag_values=values, flag_meanings=" ".join(flags.values()))
    return data
