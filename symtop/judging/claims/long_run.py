"""What a million steps do to the constants of the motion, and what a step costs.

A constant is kept, bounded, a random walk, a drift or just growing by the rule of every study,
`symtop.measure.conservation.behaviour`: by its size, and by the exponent of its growth (0, 1/2, 1) if the 95 % interval
excludes the others. Somebody else's sums may be plain. So a change that grows is rounding, too, while it is no more
than `KEPT`, relative, or than the random walk that the rounding seen in one step makes, n^1/2 times as much: a bias
beyond a thousandth of that rounding is visible in a million steps. A drift that hides below a bounded oscillation shows
in the means of 24 equal stretches, and counts if the line through them exceeds `SURE` of its own intervals. A random
walk passes a plain test of the slope in one case in three, and not this one; at the size of rounding only the size is
judged. Every chart of a method makes its own run.

A Cayley map keeps |L|^2/2 + c e_z - (h mgl)^2 (1 - e_z^2)/8 with c = h mgl/2 tau, whatever its tau: c is fitted, and it
is the rest of the fit that must vanish. Source: Bobenko, Suris, Commun. Math. Phys. 204 (1999) 147.

In the space frame p_phi = L_z and p_psi = L.e are those of the states, whatever the run reports; in angles, where they
are parameters of a state, those of the increments are set beside the reported ones (`symtop.measure.conservation`).

Python solvers are too slow for a million steps: they run for as many as `EVALUATIONS` allow, and the ledger says so.
"""

import math
from typing import NamedTuple

import numpy as np

from symtop.measure.conservation import Changed, Difference, behaviour, constant_of, from_increments, residuals, tops
from symtop.methods.framework.calling import solve
from symtop.methods.framework.plan import Array, Plan, Run, sentence
from symtop.methods.framework.registry import Integrator
from symtop.model.charts import space_momenta
from symtop.model.scenes import Scene
from symtop.model.top import SymmetricTop
from symtop.run.simulation import make_plan
from symtop.run.trajectory import Trajectory

STEPS, QUICK_STEPS = 1_000_000, 50_000
STEPS_A_NUTATION = 118.02
FINER = (1.0, 3.17, 10.03)  # times more, if a run does not reach its end
SAMPLES = 4001
PILOT = 400  # steps of the run that is sampled at every step
EVALUATIONS = {"compiled": 2e8, "python": 4e4}
QUICK_SHARE = 0.25  # of these; no verdict on a method of the package changes
TOLERANCE = 1e-6  # of an adaptive method without a default of its own
KEPT = 1e-11
REPORTED = 1e-9  # relative, of a reported momentum from that of the states: plain sums leave 1e-11 in a million steps
ROUNDING_OF_A_STEP = 2e-13  # a change in one step that may be rounding, where |p| is small beside what makes it up
BOUNDED = 0.25  # an exponent that exceeds it with its whole interval is growth
SURE = 8.0
VISIBLE = 1e-3  # of the largest residual: a smaller trend does not matter
WINDOWS = 160  # of a long run, evenly spaced in the logarithm of time: what a figure shows of it


class Constant(NamedTuple):
    """What became of one constant of the motion."""

    changed: Changed  # relative change, its trend and its growth
    a_step: float  # largest change in one step
    floor: float  # a smaller change is rounding
    grain: float = 1.0  # rounding of the constant, in units of the machine's

    @property
    def kind(self) -> str:
        """kept, bounded, random walk, drift, or just growing; unknown without a size or an exponent to judge it by."""
        change = self.changed
        word = behaviour(change.largest, change.exponent, change.exponent_interval, self.grain, self.floor)
        if word == "kept":
            return word
        if not (math.isfinite(change.largest) and math.isfinite(change.exponent)):
            return "unknown"
        sure = 0.0 < SURE * change.interval < abs(change.slope)
        return "drift" if sure and abs(change.rise) > VISIBLE * change.largest else word

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
    reported: Difference | None  # of the momenta from those of the states; None where the states show none
    energy: tuple[Array, Array]  # times, in nutations, and the largest relative change around each, shape (WINDOWS,)

    @property
    def span(self) -> str:
        """Its length in words."""
        return f"{f'{self.steps} steps' if self.steps else 'a formula'} over {self.nutations:.3g} nutations"

    def most_in_a_nutation(self, constant: Constant) -> float:
        """What an error that returns with the nutation cannot exceed: the largest change of a step, all one way."""
        return constant.a_step * self.steps / self.nutations if self.nutations > 1.0 else math.inf


def _run(
    method: Integrator, scene: Scene, chart: str, steps: float, step: float, samples: int
) -> tuple[Trajectory, Run, Plan]:
    """A run for `steps` times `step`: with the momenta of its states, as the solver returned it, and its plan."""
    horizon = (round(steps) if method.fixed_step else steps) * step
    control = {"step_size": step} if method.fixed_step else {}
    if method.adaptive and method.default_tolerance is None:
        control = {"tolerance": TOLERANCE}
    plan, _ = make_plan(scene, method, **control, horizon=horizon, samples=samples)
    run = solve(method, chart, scene.top, scene.start, plan, f" on {scene.name}")
    own = run
    if chart != "angles":
        with np.errstate(over="ignore", invalid="ignore"):  # a run may blow up
            p_phi, p_psi = space_momenta(chart, run.states)
        own = run._replace(p_phi=p_phi, p_psi=p_psi)
    return Trajectory.of_run(scene, chart, plan, own), run, plan


def long_run(
    method: Integrator, scene: Scene, chart: str, *, quick: bool = False, most: float | None = None
) -> LongRun:
    """A million steps of a compiled method in one of its charts, or `most`; fewer where that would take minutes."""
    for finer in FINER:  # a motion that passes close to a pole needs shorter steps
        step = scene.time_scale() / (STEPS_A_NUTATION * finer)
        pilot, first, _ = _run(method, scene, chart, PILOT, step, PILOT + 1)
        steps = float(PILOT)  # of a formula, which has no steps: nothing adds up
        if method.control is not None:
            cost = max(first.force_evaluations / PILOT, 1.0)
            share = QUICK_SHARE if quick else 1.0
            limit = share * EVALUATIONS[method.implementation] / cost if most is None else most
            steps = max(min(QUICK_STEPS if quick else STEPS, limit) * method.speed, PILOT)
        shown, run, plan = _run(method, scene, chart, steps, step, SAMPLES)
        if run.outcome == "ok" or not method.fixed_step:
            break
    _, other, _ = _run(method, scene, chart, PILOT, 0.21 * step, PILOT + 1)
    made, changes, small = max(run.steps, 1), constants(scene, shown), constants(scene, pilot)
    grains = {name: scene.energy_grain if name == "energy" else 1.0 for name in changes}
    if chart == "angles":
        reported = from_increments(method, scene, plan) if method.fixed_step else None
    else:
        reported = _reported(scene, shown, run)
    return LongRun(
        constants={name: change_of(plan.times, changes[name], small[name], made, grains[name]) for name in changes},
        outcome=run.outcome,
        message=sentence(run.outcome, run.reached, plan.horizon),
        chart=chart,
        steps=run.steps,
        nutations=run.reached / scene.time_scale(),
        evaluations=run.force_evaluations / made,
        iterations=run.newton_iterations / made,
        steady_cost=len({one.force_evaluations / max(one.steps, 1) for one in (first, other)}) == 1,
        reported=reported,
        energy=windows(plan.times / scene.time_scale(), changes["energy"]),
    )


def windows(nutations: Array, change: Array) -> tuple[Array, Array]:
    """The largest |change| in windows of the logarithm of time, with their middles; NaN where there is no sample."""
    middles, largest = np.full((2, WINDOWS), math.nan)
    times, values = tops(nutations, change, math.log10(nutations[-1] / nutations[1]), WINDOWS)
    middles[: len(times)], largest[: len(values)] = times, values
    return middles, largest


def _reported(scene: Scene, shown: Trajectory, run: Run) -> Difference:
    """How far the reported momenta are from those of the states, over the long run."""
    apart = {}
    for name in ("p_phi", "p_psi"):
        gap = np.abs(getattr(run, name) - getattr(shown, name)) / scene.momentum_scale
        apart[name] = float(np.max(gap[np.isfinite(gap)], initial=0.0))
    name = max(apart, key=lambda one: apart[one])
    return Difference(name, apart[name], REPORTED, f"of the larger momentum in {run.steps} steps")


def constants(scene: Scene, run: Trajectory) -> dict[str, Array]:
    """Relative change of every constant that the run's chart has, at its samples."""
    changes = residuals(scene, run)
    if run.chart != "angles":
        changes["axis_length"] = np.linalg.norm(run.axis, axis=1) - 1.0
    if run.chart != "angles" and math.isfinite(run.step_size):
        changes["cayley_energy"] = _cayley_residual(scene.top, run)
    return changes


def _cayley_residual(top: SymmetricTop, run: Trajectory) -> Array:
    """|L|^2/2 + c u - k^2 (1-u^2)/8 with the best c, relative to its size; |L|^2 is in the energy."""
    u = run.axis[:, 2]
    spin: Array = 0.5 * run.p_psi**2 * (1.0 / top.I3 - 1.0 / top.I1)
    square: Array = top.I1 * (run.energy - top.mgl * u - spin)  # |L|^2 / 2
    kick = run.step_size * top.mgl
    rest = square - kick * kick * (1.0 - u) * (1.0 + u) / 8.0
    good = np.isfinite(rest) & np.isfinite(u)
    if good.sum() < 8 or np.ptp(u[good]) == 0.0:
        return np.full(u.size, math.nan)
    du, dr = u[good] - u[good].mean(), rest[good] - rest[good].mean()
    c = -float(du @ dr) / float(du @ du)
    whole: Array = rest + c * u
    relative: Array = (whole - whole[0]) / float(np.max(np.abs(rest[good])))
    return relative


def change_of(time: Array, values: Array, every_step: Array, steps: int, grain: float = 1.0) -> Constant:
    """Size, growth and trend of a residual over so many steps; `every_step` holds it at consecutive ones."""
    jumps = np.abs(np.diff(every_step))
    a_step = float(np.max(jumps[np.isfinite(jumps)])) if np.isfinite(jumps).any() else math.nan
    floor = KEPT * grain
    if a_step <= ROUNDING_OF_A_STEP * grain:
        floor = max(floor, a_step * math.sqrt(steps))
    return Constant(constant_of(time, values), a_step, floor, grain)
