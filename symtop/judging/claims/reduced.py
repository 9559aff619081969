"""The claims of a map of (theta, p_theta): order, structure and energy of the nutation alone.

Such a map is judged in the plane. Its order is that of the distance from the true (theta, p_theta), p_theta in units of
the larger momentum; it is symplectic if it keeps the area, {theta, p_theta} = 1; and the one constant of its motion is
the energy at the p_phi and p_psi of the start, which are parameters and are not judged.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from symtop.core.errors import SymtopError
from symtop.judging.adapters.adapter import AdapterSolver
from symtop.judging.adapters.separable import SeparableStep
from symtop.judging.claims import long_run as long
from symtop.judging.claims.constants import of_run, traces_of
from symtop.judging.claims.order import NUTATIONS, Order, settings_shown, weighed
from symtop.judging.claims.series import ChartSeries
from symtop.judging.claims.structure import ONE_MAP, structure_of
from symtop.judging.claims.subject import FEWEST, STEPS, Subject
from symtop.judging.findings import Finding, inapplicable
from symtop.measure.order import order as order_of
from symtop.measure.step_map import SHARE, StepMap, angles_at, coarsest, generic_start, restart_gap
from symtop.measure.step_series import step_series
from symtop.methods.framework.plan import NOT_FINITE, OK, OUTCOMES, Array, Run, sentence
from symtop.model.scenes import Scene, closed_form
from symtop.model.top import Angles, Momenta

CHART = "nutation"
COARSEST, RUNS = 17, 13  # steps of the shortest run of the order, and how many runs
BOUND = 1e-14  # of the closed form at the end of such a run


@dataclass(frozen=True)
class Plane(StepMap):
    """The map of a step in the plane; z and Y are (theta, p_theta) alike."""

    stepper: SeparableStep
    momenta: Momenta

    def run(self, start: Angles, h: float, steps: int = 1) -> Run:
        """So many steps, shown at their end."""
        done: Run = self.onward(self.top, start, (h,) * steps)
        if not np.isfinite(done.states).all():
            raise SymtopError(f"a step of {h:.3g} is not finite")
        return done

    @property
    def onward(self) -> Any:
        """Steps of given lengths, each from the state where the last one ended."""
        return AdapterSolver(self.stepper).onward

    @property
    def there_and_back(self) -> Any:
        """A step, and one from its end with p_theta reversed."""
        return AdapterSolver(self.stepper).there_and_back

    def scaled(self, state: Array, _phi: float, _psi: float) -> Array:
        """A state as Y."""
        scaled: Array = state / np.array([1.0, self.unit])
        return scaled

    def angles(self, z: Array) -> Angles:
        """The start that a point stands for, phi and psi zero."""
        whole = [float(z[0]), 0.0, 0.0, self.unit * float(z[1]), self.momenta.p_phi, self.momenta.p_psi]
        return angles_at(self.top, np.array(whole))

    def point(self, start: Angles) -> Array:
        """z of a start."""
        return np.array([start.theta, self.top.I1 * start.theta_dot / self.unit])

    def at(self, start: Angles) -> Array:
        """Y of a start."""
        return self.point(start)

    def restart(self, y: Array) -> Angles:
        """The start that a Y stands for."""
        return self.angles(y)

    def length(self, _: Array) -> float:
        """A state of the plane has no length to keep."""
        return 1.0


def plane(subject: Subject) -> tuple[Plane, Angles]:
    """The map at a step so large that its structure shows, and the point to judge it at."""
    scene, start = subject.scene, generic_start(subject.scene)
    h, momenta = SHARE * scene.time_scale(), scene.top.momenta(start)
    trial = Plane(subject.method, CHART, scene.top, scene.momentum_scale, h, subject.stepper, momenta)
    coarse: Any = coarsest(trial, start)
    return coarse, start


def not_shown(_: Subject) -> list[Finding]:
    """The findings on what the plane does not show."""
    return [inapplicable(claim, "a map of (theta, p_theta) does not show it") for claim in ("time", "pole")]


def structure(subject: Subject) -> list[Finding]:
    """The findings on symplectic and symmetric."""
    return structure_of({CHART: lambda: plane(subject)}, subject)


def constants(subject: Subject) -> list[Finding]:
    """What a long run shows."""
    steps = min(subject.long_steps or STEPS, long.QUICK_STEPS if subject.quick else STEPS)
    run = long_run(subject.stepper, subject.scene, round(steps))
    subject.traces.update(traces_of(run))
    return of_run(subject.method, run)


def order(subject: Subject) -> list[Finding]:
    """The finding on the order: the slope of the errors at the end of runs, and the power series of a step."""
    method, scene, stepper = subject.method, subject.scene, subject.stepper
    horizon = NUTATIONS * scene.time_scale()
    finest = max(subject.finest or FEWEST, 4 * COARSEST)
    counts = np.unique(np.rint(np.geomspace(COARSEST, finest, RUNS)).astype(np.int64))
    truth = closed_form(scene)(np.array([horizon]))
    end = np.array([float(truth.theta[0]), scene.top.I1 * float(truth.theta_dot[0])])
    par, state = stepper.form.prepare(scene.top, scene.start)
    errors, unit = [], np.array([1.0, scene.momentum_scale])
    for count in counts:
        done = stepper.march(scene.top, par, np.array(state), horizon / count, np.array([count]))
        errors.append(float(np.linalg.norm((done.states[0] - end) / unit)))
    step_size, error, bound = horizon / counts, np.array(errors), np.full(counts.size, BOUND)
    omega = 2.0 * math.pi / scene.time_scale()
    fit = order_of(step_size, error, bound, omega, method.order, symmetric=method.symmetric)
    fitted = Order(scene.name, step_size, error, bound, {CHART: fit}, CHART, True)
    subject.traces.update(settings_shown(fitted))
    step, start = plane(subject)
    one_map = restart_gap(step, start) <= ONE_MAP
    series = ChartSeries(CHART, step_series(step, start, scene.time_scale())) if one_map else None
    slopes = f"slopes {CHART} {fit} on {scene.name}" if math.isfinite(fit.slope) else "no slope"
    return [weighed(method.order, fitted, series, slopes)]


def long_run(stepper: SeparableStep, scene: Scene, steps: int) -> long.LongRun:
    """The energy over many steps, and in each of the first."""
    par, state = stepper.form.prepare(scene.top, scene.start)
    h, most = scene.time_scale() / long.STEPS_A_NUTATION, max(steps, long.PILOT)
    p_phi, p_psi = (float(value[0]) for value in stepper.form.momenta(par, np.array([state])))

    def change(marks: Array, h: float) -> tuple[Array, int]:
        """The change of the energy since the start, as a share of the nutation's, and the forces."""
        states, forces = stepper.march(scene.top, par, np.array(state), h, marks.astype(np.int64))
        with np.errstate(all="ignore"):
            energy = scene.top.reduced_energy(states[:, 0], states[:, 1], p_phi, p_psi)
        return (energy - energy[0]) / scene.energy_scale, forces

    marks = np.unique(np.rint(np.linspace(0, most, long.SAMPLES)))
    values, forces = change(marks, h)
    every, few = change(np.arange(long.PILOT + 1.0), h)
    _, other = change(np.arange(long.PILOT + 1.0), 0.21 * h)
    good, times = np.isfinite(values), marks * h
    made = int(marks[good][-1])
    outcome = OUTCOMES[OK if good.all() else NOT_FINITE]
    return long.LongRun(
        constants={"energy": long.change_of(times, values, every, max(made, 1), scene.energy_grain)},
        outcome=outcome,
        message=sentence(outcome, made * h, most * h),
        chart=CHART,
        steps=made,
        nutations=made * h / scene.time_scale(),
        evaluations=forces / max(made, 1),
        iterations=0.0,
        steady_cost=few == other,
        reported=None,
        energy=long.windows(times / scene.time_scale(), values),
    )
