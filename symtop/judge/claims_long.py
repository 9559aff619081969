"""What a million steps do to the constants of the motion, what a step costs, and what happens at a pole.

A constant is kept, bounded, a random walk, a drift or just growing by the rule of every study,
`symtop.measure.growth.behaviour`: by its size, and by the exponent of its growth (0, 1/2, 1) if the 95 % interval
excludes the others. Somebody else's sums may be plain. So a change that grows is rounding, too, while it is no more
than `KEPT`, relative, or than the random walk that the rounding seen in one step makes, n^1/2 times as much: a bias
beyond a thousandth of that rounding is seen in a million steps. A drift that hides below a
bounded oscillation shows in the means of 24 equal stretches, and counts if the line through them exceeds `SURE` of its
own intervals. Random walks pass a plain test of the slope in one case in three; this one they do not pass, and at the
size of rounding nothing but the size is judged. Every chart of a method makes its own run.

A Cayley map keeps |L|^2/2 + c e_z - (h mgl)^2 (1 - e_z^2)/8 with c = h mgl/2 tau, whatever its tau: c is fitted, and it
is the rest of the fit that must vanish. Source: Bobenko, Suris, Commun. Math. Phys. 204 (1999) 147.

Python solvers are too slow for a million steps: they run for as many as `EVALUATIONS` allow, and the ledger says so.
"""

import math
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from symtop.measure.conservation import Changed, constant_of, residuals
from symtop.measure.errors import errors_against
from symtop.measure.growth import behaviour
from symtop.methods.registry import Integrator
from symtop.model.scenes import Scene
from symtop.model.top import Angles, SymmetricTop
from symtop.run.reference import reference
from symtop.run.simulation import simulate

Array = NDArray[np.float64]

STEPS, QUICK_STEPS = 1_000_000, 50_000
STEPS_A_NUTATION = 118.02
FINER = (1.0, 3.17, 10.03)  # times more, if a run does not reach its end
SAMPLES = 4001
PILOT = 400  # steps of the run that is sampled at every step
EVALUATIONS = {"compiled": 2e8, "python": 4e4}
TOLERANCE = 1e-6  # of an adaptive method without a default of its own
KEPT = 1e-11
ROUNDING_OF_A_STEP = 2e-13  # a change in one step that may be rounding, where |p| is small beside what makes it up
BOUNDED = 0.25  # an exponent that exceeds it with its whole interval is growth
SURE = 8.0
VISIBLE = 1e-3  # of the largest residual: a smaller trend does not matter


class Constant(NamedTuple):
    """What became of one constant of the motion."""

    changed: Changed  # relative change, its trend and its growth
    a_step: float  # largest change in one step
    floor: float  # a smaller change is rounding
    grain: float = 1.0  # rounding of the constant, in units of the machine's

    @property
    def kind(self) -> str:
        """kept, bounded, random walk, drift, or just growing; unknown without a size or an exponent to judge it by."""
        seen = self.changed
        word = behaviour(seen.largest, seen.exponent, seen.exponent_interval, self.grain, self.floor)
        if word == "kept":
            return word
        if not (math.isfinite(seen.largest) and math.isfinite(seen.exponent)):
            return "unknown"
        sure = 0.0 < SURE * seen.interval < abs(seen.slope)
        drifts = sure and abs(seen.rise) > VISIBLE * seen.largest
        return "drift" if drifts else word

    @property
    def grows(self) -> bool | None:
        """Is it beyond doubt that it grows? None if the exponent leaves that open."""
        if self.kind in ("kept", "bounded", "unknown"):
            return None if self.kind == "unknown" else False
        least = self.changed.exponent - self.changed.exponent_interval
        return True if self.kind == "drift" or least > BOUNDED else None


class LongRun(NamedTuple):
    """One long run: its constants by name, and its cost."""

    constants: dict[str, Constant]
    outcome: str
    message: str
    chart: str
    steps: int
    nutations: float
    evaluations: float  # of the force, a step
    iterations: float  # of a solver, a step
    steady_cost: bool  # every run of the same number of steps cost the same, at two step sizes


def _run(method: Integrator, scene: Scene, steps: float, step: float, samples: int) -> xr.Dataset:
    """A run for `steps` times `step`: of that many steps, or for that time at the tolerance."""
    horizon = (round(steps) if method.fixed_step else steps) * step
    control = {"step_size": step} if method.fixed_step else {}
    if method.adaptive and method.default_tolerance is None:
        control = {"tolerance": TOLERANCE}
    return simulate(scene, method, **control, horizon=horizon, samples=samples, observe="axis", guard=False)


def long_run(method: Integrator, scene: Scene, chart: str, *, quick: bool = False) -> LongRun:
    """A million steps of a compiled method in one of its charts, fewer where that would take minutes."""
    method = method.row(chart)
    for finer in FINER:  # a motion that passes close to a pole needs shorter steps
        step = scene.time_scale() / (STEPS_A_NUTATION * finer)
        pilot = _run(method, scene, PILOT, step, PILOT + 1)
        cost = max(float(pilot.attrs["force_evaluations"]) / PILOT, 1.0)
        most = QUICK_STEPS if quick else STEPS
        steps = min(most, EVALUATIONS[method.implementation] / cost) * method.speed
        if method.control is None:
            steps = PILOT  # a formula has no steps: nothing adds up
        run = _run(method, scene, max(steps, PILOT), step, SAMPLES)
        if run.attrs["outcome"] == "ok" or not method.fixed_step:
            break
    other = _run(method, scene, PILOT, 0.21 * step, PILOT + 1)
    made = max(int(run.attrs["steps"]), 1)
    changes, small = constants(scene, run), constants(scene, pilot)
    return LongRun(
        {
            name: _judged(
                run["time"].values, values, small[name], made, scene.energy_grain if name == "energy" else 1.0
            )
            for name, values in changes.items()
        },
        str(run.attrs["outcome"]),
        str(run.attrs["outcome_message"]),
        str(run.attrs["chart"]),
        int(run.attrs["steps"]),
        float(run.attrs["reached_time"]) / scene.time_scale(),
        float(run.attrs["force_evaluations"]) / made,
        float(run.attrs["newton_iterations"]) / made,
        len({data.attrs["force_evaluations"] / max(data.attrs["steps"], 1) for data in (pilot, other)}) == 1,
    )


def constants(scene: Scene, run: xr.Dataset) -> dict[str, Array]:
    """Relative change of every constant that the run's chart has, at its samples."""
    changes = residuals(scene, run)
    if run.attrs["chart"] != "angles":
        changes["axis_length"] = np.linalg.norm(run["axis"].values, axis=1) - 1.0
    if run.attrs["chart"] != "angles" and math.isfinite(run.attrs["step_size"]):
        changes["cayley_energy"] = _cayley_residual(scene.top, run)
    return changes


def _cayley_residual(top: SymmetricTop, run: xr.Dataset) -> Array:
    """|L|^2/2 + c u - k^2 (1-u^2)/8 with the best c, relative to its size; |L|^2 is in the energy."""
    u = run["axis"].values[:, 2]
    spin: Array = 0.5 * run["p_psi"].values ** 2 * (1.0 / top.I3 - 1.0 / top.I1)
    square: Array = top.I1 * (run["energy"].values - top.mgl * u - spin)  # |L|^2 / 2
    kick = float(run.attrs["step_size"]) * top.mgl
    rest = square - kick * kick * (1.0 - u) * (1.0 + u) / 8.0
    good = np.isfinite(rest) & np.isfinite(u)
    if good.sum() < 8 or np.ptp(u[good]) == 0.0:
        return np.full(u.size, math.nan)
    du, dr = u[good] - u[good].mean(), rest[good] - rest[good].mean()
    c = -float(du @ dr) / float(du @ du)
    whole: Array = rest + c * u
    relative: Array = (whole - whole[0]) / float(np.max(np.abs(rest[good])))
    return relative


def _judged(time: Array, values: Array, every_step: Array, steps: int, grain: float = 1.0) -> Constant:
    """Size, growth and trend of a residual over so many steps; `every_step` holds it at consecutive ones."""
    jumps = np.abs(np.diff(every_step))
    jumps = jumps[np.isfinite(jumps)]
    a_step = float(jumps.max()) if jumps.size else math.nan
    floor = KEPT * grain
    if a_step <= ROUNDING_OF_A_STEP * grain:
        floor = max(floor, a_step * math.sqrt(steps))
    return Constant(constant_of(time, values), a_step, floor, grain)


# the axis passes theta = 0 exactly: I1 = I3 = mgl = 1, w3 = 1, p_phi = p_psi, theta' = -1.2 at theta = 1
_POLE_RATE = 0.5 / math.cos(0.5) ** 2
POLE = Scene(
    "pole",
    SymmetricTop(1.0, 1.0, 1.0),
    Angles(theta=1.0, theta_dot=-1.2, phi_dot=_POLE_RATE, psi_dot=1.0 - _POLE_RATE * math.cos(1.0)),
    4.0,
)
POLE_STEPS = 400
POLE_RIGHT = 1e-7  # rad: right, whatever the step


class Passage(NamedTuple):
    """What a method did in one chart when the axis passed a pole."""

    chart: str
    outcome: str
    error: float  # of the axis, rad
    finer: float  # with half the step or a tenth of the tolerance

    @property
    def passes(self) -> bool:
        """Did it come out on the other side, with an error that falls with the step?"""
        return self.outcome == "ok" and (self.finer < 0.7 * self.error or self.finer < POLE_RIGHT)


def passages(method: Integrator) -> list[Passage]:
    """What happens at a pole, in every chart of the method."""
    rows = []
    for chart in method.charts():
        only = method.row(chart)
        ends, errors_there = [], []
        for finer in (1.0, 2.0):
            step, tolerance = POLE.horizon / (POLE_STEPS * finer), max(10.0 ** (-5.0 - finer), method.least_tolerance)
            control = method.setting(step if method.fixed_step else tolerance).kwargs()
            observe = "axis" if chart != "attitude" else "attitude"
            run = simulate(POLE, only, samples=201, observe=observe, guard=False, **control)
            truth = reference(POLE, run["time"].values, precision="closed-form")
            ends.append(str(run.attrs["outcome"]))
            miss = errors_against(POLE, run, truth)["axis"].values
            errors_there.append(float(np.nanmax(miss)) if np.isfinite(miss).any() else math.nan)
        rows.append(Passage(chart, next((end for end in ends if end != "ok"), "ok"), *errors_there))
    return rows
