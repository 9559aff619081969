"""The explorer's answers: a run with the exact motion, as arrays, as a dataset and as a script; a map; friction.

The page sends a flat mapping of numbers and names, which `setup` reads. The script reproduces the numbers of the page
to the last bit.

The map is one method on one top over a grid of steps and spins, as one ensemble. A cell is the run from the page's
start with its own psi_dot (row) and step size (column). Its value is the largest angle in radians between its axis and
the exact one over nine samples, or NaN if the run ended early.
"""

import base64
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import xarray as xr

from symtop.core import __version__
from symtop.core.errors import SymtopError, finite, one_of, positive
from symtop.measure.conservation import CONSTANTS, residuals
from symtop.methods.framework.plan import OUTCOMES, sentence
from symtop.methods.framework.registry import Integrator, integrator, integrators
from symtop.methods.lagrangian.damped_oscillator import Oscillator, discrete_path, notebook_positions, rule_sums
from symtop.methods.lagrangian.damped_top import NEAR_POLE, Friction, damped_run, theta_before_pole
from symtop.model import charts
from symtop.model.body import rotated
from symtop.model.scenes import Scene, all_scenes, body_scenes, closed_form, horizon_of
from symtop.model.top import Angles, SymmetricTop
from symtop.report.spread import member_errors
from symtop.run.ensemble.ensemble import ensemble
from symtop.run.reference.truth import reference
from symtop.run.simulation import chart_of, integrate, simulate
from symtop.run.trajectory import Trajectory

TOP = ("I1", "I3", "mgl")
START = ("theta", "phi", "psi", "theta_dot", "phi_dot", "psi_dot")
OF_BODY, RATES = ("I1", "I2", "I3", "mgl"), ("w1", "w2", "w3")  # other numbers of a body and its start are the scene's
MOST_STEPS = 2_000_000  # of one run; common kernels take a quarter of a second for them
MOST_WORK = {"compiled": 2e6, "python": 2e5}  # of an adaptive run: force evaluations or Taylor steps
MOST_SECONDS = 2.0  # of an adaptive run; a lower budget is set if `MOST_WORK` would take longer
LONG_ENOUGH = 0.02  # seconds of a trial from which the cost of work is computed
FIRST_TRIAL = 16.0  # work of the first trial
SAMPLES_A_NUTATION = 60
FEWEST_SAMPLES, MOST_SAMPLES = 601, 4001  # limits for the samples of one run
PORTRAIT = 361  # points of the exact phase curve, over one nutation
COLUMNS, ROWS = 48, 32  # numbers of steps and of spins in a map
MAP_SAMPLES = 9
MOST_MAP_STEPS = 20_000_000  # of all cells: they take an implicit method seconds
OSCILLATOR_HORIZON, MOST_OSCILLATOR_STEPS = 25.0, 10_000
MOST_FRICTION = 1e6
MOST_TOP_STEPS, MOST_TOP_EVALUATIONS = 100_000, 50_000  # of the damped top: half a second for either
RULES = ("midpoint", "trapezoidal")  # of the discrete Lagrangian of the oscillator


@dataclass(frozen=True)
class Setup:
    """One run: a scene with its horizon, a method, and its step or tolerance."""

    scene: Scene
    method: Integrator
    setting: float | None

    @property
    def budget(self) -> float | None:
        """The most work of an adaptive run, which ends there as "out_of_budget"; None for a fixed step."""
        return _budget(self) if self.method.control == "tolerance" else None

    @property
    def samples(self) -> int:
        """The number of samples: 60 per nutation, within the limits of a page."""
        period = self.scene.nutation_period
        resolved = np.isfinite(period) and period > 0.0
        samples = SAMPLES_A_NUTATION * self.scene.horizon / period if resolved else FEWEST_SAMPLES
        return round(min(max(samples, FEWEST_SAMPLES), MOST_SAMPLES))

    @property
    def arguments(self) -> dict[str, Any]:
        """The arguments of `simulate` except the scene, the method and the guard."""
        control = {} if self.setting is None else self.method.given(self.setting)
        return control | {"observe": "attitude", "samples": self.samples, "budget": self.budget}


_budgets: dict[tuple[str, bool, int], float] = {}  # by method, kind of body and decade of the tolerance


def _budget(config: Setup) -> float:
    """The work that takes two seconds, from trials of the run itself, but at most `MOST_WORK`.

    The cost of an evaluation differs by a factor of 1000 between methods, and that of a Taylor step also grows as the
    tolerance falls: no attribute of an integrator predicts it.
    """
    tolerance = config.setting or 1.0
    key = config.method.name, config.scene.of_body, math.floor(math.log10(tolerance))
    limit = MOST_WORK[config.method.implementation]
    if key in _budgets:
        return _budgets[key]

    def trial(work: float) -> tuple[float, bool]:
        before = time.thread_time()  # without the time of other threads
        options: dict[str, Any] = {"tolerance": config.setting, "observe": "attitude", "samples": 2, "budget": work}
        run = integrate(config.scene, config.method, **options)
        return time.thread_time() - before, run.outcome == "out_of_budget"

    trial(FIRST_TRIAL)  # compiles its kernels
    work, (fixed, unfinished) = FIRST_TRIAL, trial(FIRST_TRIAL)
    seconds = fixed
    while unfinished and seconds - fixed < LONG_ENOUGH:
        work *= 4.0
        if work >= limit:
            break
        seconds, unfinished = trial(work)
    if not unfinished:
        return limit  # the run ends with less work than the trial
    cost = (seconds - fixed) / (work - FIRST_TRIAL) if work < limit else 0.0
    affordable = MOST_SECONDS / cost if cost > 0.0 else limit
    return _budgets.setdefault(key, float(f"{min(limit, affordable):.2g}"))


def setup(fields: Mapping[str, Any]) -> Setup:
    """The run that the fields of a page define. Raises SymtopError if a field is missing or out of range."""
    of_body = fields.get("I2") is not None or str(fields.get("base")) in body_scenes()
    names = (OF_BODY, RATES) if of_body else (TOP, START)
    if missing := [name for name in (*names[0], *names[1], "horizon", "integrator") if name not in fields]:
        raise SymtopError(f"the question lacks {', '.join(missing)}")
    top, start = (tuple(finite(name, fields[name]) for name in group) for group in names)
    if of_body:
        base = body_scenes()[one_of("base", str(fields.get("base")), body_scenes())]
        pair = replace(base.top, **dict(zip(OF_BODY, top, strict=True))), replace(base.start, omega_body=start)
    else:
        pair = SymmetricTop(*top), Angles(*start)
    scene = Scene(str(fields.get("scene", "explored")), *pair, horizon_of(fields["horizon"]))
    method = integrator(str(fields["integrator"]))
    chart_of(method, scene.observes, "attitude")  # refuses a variant such as rk4[axis]: the page shows the attitude
    if method.control is None:
        return Setup(scene, method, None)
    setting = positive(method.control, fields.get(method.control))
    if method.control == "step_size" and scene.horizon / setting > MOST_STEPS:
        minimum = f"{scene.horizon / MOST_STEPS:.3g} for this horizon, not {setting!r}"
        raise SymtopError(f"step_size must be at least {minimum}: the explorer runs at most {MOST_STEPS} steps")
    return Setup(scene, method, setting)


def dataset(config: Setup, warn: Callable[[str], object]) -> xr.Dataset:
    """The run as a dataset of `simulate`; `warn` is called with the guard's warning, if there is one."""
    return simulate(config.scene, config.method, **config.arguments, guard=warn)


def answer(config: Setup) -> dict[str, Any]:
    """A run and the exact motion: attitudes, residuals, errors, and the messages of the outcome and the guard.

    Arrays are base64 of float32, over `time`: ``attitude`` and ``truth`` (rows w, x, y, z), ``theta``, ``energy``,
    ``p_phi`` and ``p_psi`` (relative changes since the start), ``axis_error`` and ``attitude_error`` in radians. Values
    after a failure are NaN. For a top also ``p_theta``, and the exact phase curve, ``true_theta`` and ``true_p_theta``,
    one nutation at 361 times; for a body ``middle`` and ``true_middle``, the part of the angular momentum along the
    axis of the middle moment, which changes its sign when the body flips.
    """
    began = time.perf_counter()
    warnings: list[str] = []
    run = integrate(config.scene, config.method, **config.arguments, guard=warnings.append)
    end = time.perf_counter()
    times, scene, attitude = run.time, config.scene, run.quaternion
    period = float(np.nan_to_num(scene.nutation_period, posinf=0.0))
    if scene.of_body:
        true = Trajectory.of_data(reference(scene, times))
        truth, extras = true.quaternion, {"middle": _middle(scene, run), "true_middle": _middle(scene, true)}
    else:
        truth = closed_form(scene).quaternion(times)
        cycle = closed_form(scene)(np.linspace(0.0, period or scene.horizon, PORTRAIT))
        extras = {"p_theta": run.p_theta, "true_theta": cycle.theta, "true_p_theta": scene.top.I1 * cycle.theta_dot}
    if attitude is None:
        attitude = charts.quaternion_from_angles(run.theta, run.phi, run.psi)
    with np.errstate(over="ignore", invalid="ignore"):  # a run may have blown up
        arrays = {
            "time": times,
            "attitude": attitude,
            "truth": truth,
            "theta": run.theta,
            **extras,
            **residuals(scene, run),
            "axis_error": charts.axis_distance(run.axis, charts.axis_from_quaternion(truth)),
            "attitude_error": charts.attitude_distance(attitude, truth),
        }
        largest = {}
        for name in {*CONSTANTS, "axis_error", "attitude_error"} & {*arrays}:
            sizes = np.abs(arrays[name][np.isfinite(arrays[name])])
            largest[name] = float(sizes.max()) if sizes.size else None
        encoded = {name: _float32(values) for name, values in arrays.items()}
    return {
        "outcome": run.outcome,
        "message": sentence(run.outcome, run.reached_time, scene.horizon, scene.second),
        "warnings": warnings,
        "steps": int(run.steps),
        "force_evaluations": int(run.force_evaluations),
        "period": period,
        "steps_per_nutation": run.steps * period / run.reached_time if run.reached_time > 0.0 else 0.0,
        "run_ms": 1e3 * (end - began),
        "all_ms": 1e3 * (time.perf_counter() - began),
        "largest": largest,
        "arrays": encoded,
    }


def _middle(scene: Scene, run: Trajectory) -> np.ndarray:
    """The component of a body's angular momentum along the axis of its middle moment, divided by |L|; (n,)."""
    middle = np.eye(3)[np.argsort(scene.top.moments)[1]]
    with np.errstate(over="ignore", invalid="ignore"):  # a run may have blown up
        component = np.sum(rotated(run.quaternion, middle) * run.momentum, axis=1)
        return np.asarray(component / np.linalg.norm(run.momentum, axis=1))


def _float32(values: Any) -> str:
    """Base64 of the values as float32, little-endian; infinite beyond its range."""
    with np.errstate(over="ignore"):
        return base64.b64encode(np.ascontiguousarray(values, dtype="<f4").tobytes()).decode()


def _curves(largest: dict[str, float], message: str = "", /, **arrays: Any) -> dict[str, Any]:
    """The answer for the views with friction: message, largest errors, and arrays as base64."""
    return {"message": message, "largest": largest, "arrays": {name: _float32(array) for name, array in arrays.items()}}


def grid(fields: Mapping[str, Any]) -> tuple[Setup, np.ndarray, np.ndarray]:
    """The run, steps and spins of a map: step_least, step_most (s), spin_least, spin_most (rad/s); or SymtopError."""
    config = setup(fields)
    if config.scene.of_body:
        raise SymtopError(f"a map must be of a top, not of {config.scene.name}, a body without symmetry")
    if config.method.control != "step_size":
        raise SymtopError(f"integrator must be one with a step for a map, not {config.method.name!r}")
    fine, coarse = (positive(name, fields.get(name)) for name in ("step_least", "step_most"))
    low, high = (finite(name, fields.get(name)) for name in ("spin_least", "spin_most"))
    if not (fine < coarse and low < high):
        raise SymtopError(f"the ranges of a map must not be empty, not {fine!r} to {coarse!r}, {low!r} to {high!r}")
    steps, spins = np.geomspace(fine, coarse, COLUMNS), np.linspace(low, high, ROWS)
    if (total := ROWS * float(np.sum(config.scene.horizon / steps))) > MOST_MAP_STEPS:
        raise SymtopError(f"a map must have at most {MOST_MAP_STEPS} steps, not {total:.3g}: take a shorter time")
    return config, steps, spins


def outcome_map(config: Setup, steps: np.ndarray, spins: np.ndarray) -> dict[str, Any]:
    """The map: ``error_rad`` as base64 of float32, row by row from the least spin; NaN where a run ended early."""
    scene = config.scene
    step, spin = (column.ravel() for column in np.meshgrid(steps, spins))
    numbers = asdict(scene.top) | asdict(scene.start) | {"psi_dot": spin}
    members = xr.Dataset({name: ("member", np.broadcast_to(number, step.size)) for name, number in numbers.items()})
    for rows in (slice(-COLUMNS, None), slice(None)):  # the first call, of one row, compiles the kernel
        began = time.perf_counter()
        runs = ensemble(
            members.isel(member=rows), config.method, step_size=step[rows], horizon=scene.horizon, samples=MAP_SAMPLES,
            variables=["axis"], observe="attitude", quiet=True,
        )  # fmt: skip
    rate = step.size / (time.perf_counter() - began)
    worst = np.fmax.reduce(member_errors(members, runs, "axis"), axis=1)
    worst[runs["outcome"].values != "ok"] = np.nan
    shape = {"columns": COLUMNS, "rows": ROWS, "cells_a_second": rate}
    return shape | {"error_rad": _float32(worst), "failed": int(np.isnan(worst).sum())}


def _friction(fields: Mapping[str, Any]) -> float:
    friction = finite("friction", fields.get("friction"), 0.0)
    if friction > MOST_FRICTION:
        raise SymtopError(f"friction must be at most {MOST_FRICTION:g}, not {friction!r}", "friction")
    return friction


def damped(fields: Mapping[str, Any]) -> tuple[float, float]:
    """Friction and step of the oscillator: `friction` (0 to 1e6), `oscillator_step`. SymtopError if out of range."""
    friction, step = _friction(fields), positive("step", fields.get("oscillator_step"))
    shortest, longest = OSCILLATOR_HORIZON / MOST_OSCILLATOR_STEPS, OSCILLATOR_HORIZON / 2.0
    if not shortest <= step <= longest:
        raise SymtopError(f"step must be between {shortest} and {longest}, not {step!r}", "step")
    return friction, step


def oscillator(friction: float, step: float) -> dict[str, Any]:
    """The damped oscillator x'' + b x' + x = 0 from x = 1 at rest, as base64 of float32 over ``time``.

    ``midpoint`` and ``trapezoidal`` are forced discrete Lagrangians, ``guess`` is that of `notebook_positions`;
    ``exact`` is over ``exact_time``. `largest` has the largest errors of x of the two rules.
    """
    body, steps = Oscillator(damping=friction), max(2, round(OSCILLATOR_HORIZON / step))
    paths = {
        rule: discrete_path(body, rule_sums(rule), 1.0, 0.0, OSCILLATOR_HORIZON, steps, steps + 1) for rule in RULES
    }
    times, dense = paths["midpoint"][0], np.linspace(0.0, OSCILLATOR_HORIZON, FEWEST_SAMPLES)
    exact = body.exact(times, 1.0, 0.0)[0]
    positions = {rule: position for rule, (_, position, _) in paths.items()}
    largest = {rule: float(np.max(np.abs(position - exact))) for rule, position in positions.items()}
    guess = notebook_positions(friction, times[1], 1.0, float(exact[1]), steps)[1]
    of_exact = {"exact_time": dense, "exact": body.exact(dense, 1.0, 0.0)[0]}
    return _curves(largest, time=times, guess=guess, **of_exact, **positions)


def damped_top(fields: Mapping[str, Any]) -> tuple[Setup, float]:
    """The midpoint rule on the page's top at its step, and the friction. Raises SymtopError as `setup` and `damped`."""
    config = setup({**fields, "integrator": "midpoint"})
    friction = _friction(fields)
    if (steps := config.scene.horizon / (config.setting or 1.0)) > MOST_TOP_STEPS:
        raise SymtopError(f"the damped top must have at most {MOST_TOP_STEPS} steps, not {steps:.3g}")
    return config, friction


def inclination(config: Setup, friction: float) -> dict[str, Any]:
    """Theta in degrees with the torques -b phi'/2 and -b psi' for friction b, as base64 of float32 over ``time``.

    ``midpoint`` is the forced discrete Lagrangian, NaN after a failure; ``exact``, over ``exact_time``, ends where the
    axis comes near a pole. `largest` has the largest difference in degrees, `message` says which of them ended early.
    """
    scene, torque = config.scene, Friction(0.5 * friction, friction)
    steps = max(1, round(scene.horizon / (config.setting or scene.horizon)))
    h, positions = scene.horizon / steps, np.linspace(0.0, steps, min(config.samples, steps + 1))
    marks = np.unique(np.rint(positions).astype(int))
    run = damped_run(scene, torque, "midpoint", h, marks)
    times, theta = marks * h, run.states[:, 0]
    dense = np.union1d(times, np.linspace(0.0, scene.horizon, config.samples))
    exact = theta_before_pole(scene, torque, dense, MOST_TOP_EVALUATIONS)
    valid = np.searchsorted(dense, times) < exact.size
    error = np.degrees(np.abs(theta[valid] - exact[np.searchsorted(dense, times[valid])]))
    notes = [f"midpoint: {OUTCOMES[run.outcome].replace('_', ' ')} at t = {run.steps * h:.3g}"] if run.outcome else []
    if exact.size < dense.size:
        words = f"within {NEAR_POLE} rad of a pole at t = {dense[exact.size]:.3g}"
        notes.append(f"the exact motion comes {words} and ends there")
    of_exact = {"exact_time": dense[: exact.size], "exact": np.degrees(exact)}
    largest = {"midpoint": float(np.nanmax(error))}
    return _curves(largest, "; ".join(notes), time=times, midpoint=np.degrees(theta), **of_exact)


def script(config: Setup) -> str:
    """A Python script that makes the same dataset, bit for bit."""
    scene, name, samples = config.scene, config.method.name, config.samples
    options = "" if config.method.control is None else f", {config.method.control}={config.setting!r}"
    options += "" if config.budget is None else f", budget={config.budget!r}"
    return f'''"""A run of symtop explore, symtop {__version__}."""

import symtop

top = symtop.{scene.top!r}
start = symtop.{scene.start!r}
scene = symtop.Scene("{scene.name}", top, start, horizon={scene.horizon!r})
run = symtop.simulate(scene, "{name}"{options}, observe="attitude", samples={samples})
run.to_netcdf("explored.nc")
print(run.attrs["title"] + ": " + run.attrs["outcome_message"])
'''


def shows(method: Integrator) -> bool:
    """Does a method follow the attitude of a top, so that the page can offer it?"""
    return bool({"angles", "attitude"} & set(method.charts()))


def catalogue() -> dict[str, Any]:
    """The scenes and integrators that the page offers, with the numbers of its controls."""
    from symtop.report import style  # matplotlib: half a second

    entries = [
        {
            **{name: getattr(entry, name) for name in ("name", "purpose", "horizon", "units")},
            "period": float(np.nan_to_num(entry.nutation_period, posinf=0.0)),
            **asdict(entry.top),
            **(dict(zip(RATES, entry.start.omega_body, strict=True)) if entry.of_body else asdict(entry.start)),
        }
        for entry in all_scenes().values()
    ]
    methods = [
        {
            **{name: getattr(entry, name) for name in ("name", "family", "summary", "control", "implementation")},
            "chart": entry.chart_for("attitude"),
            "of_body": charts.BODY in entry.solvers,
            "tolerance": max(entry.default_tolerance or 1e-6, entry.least_tolerance),
            "color": style.look(entry.name).color,
        }
        for entry in integrators().values()
        if shows(entry)
    ]
    return {"version": __version__, "scenes": entries, "integrators": methods}
