"""The structure of one step: is it symplectic, is it symmetric (time-reversible), is it a map of the state alone?

A step is evaluated only through a solver, as a run of one step from z = (theta, phi, psi, p_theta, p_phi, p_psi), so
that any plug-in can be judged. Its result is a vector Y(z) in the chart's variables, whose Poisson brackets are known:

    angles      (theta, phi, psi, p_theta, p_phi, p_psi)    {q_i, p_j} = delta_ij
    nutation    (theta, p_theta)                             likewise, of z = (theta, p_theta)
    axis        (e, L)                                       {L_i, L_j} = eps_ijk L_k,  {e_i, L_j} = eps_ijk e_k
    attitude    (q, L)                                       the same L,  {q, L_i} = i-th unit vector times q, halved

With D = dY/dz and J the canonical matrix, the step is symplectic (Lie-Poisson on the axis) if D J D^T = B(Y), which
has no singularity if Y is at a pole. D comes from central differences of width w, w/2, w/4 ... and Richardson's
extrapolation; its error is estimated by the change from one extrapolation to the next, and a defect counts only if it
is larger. With shrinking w the raw defect of a symplectic map falls as w^2, that of any other map stays.

Momenta are in units of the larger of |p_phi| and |p_psi|, so that everything here is of order one.
A symmetric method has step(-h) = step(h)^-1. An adaptive one has no step of a given h: it runs for that time, and runs
back with all rates reversed. If a run of two steps differs from two runs of one step (the method adapts a parameter to
the start, or has a special first step), it is not one map. If it adapts one parameter t to its start, D = D_t +
(dY/dt) (dt/dz)^T, and D J D^T - B has rank two when the map of fixed t is symplectic: the third singular value is zero.
Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, II.1, VI.2, VII.2; Ridders, Adv. Eng. Softw. 4 (1982).
"""

import contextlib
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from symtop.core.errors import SymtopError
from symtop.methods.framework.calling import solve
from symtop.methods.framework.plan import Plan, Run
from symtop.methods.framework.registry import Integrator
from symtop.model import charts
from symtop.model.charts import Array
from symtop.model.scenes import Scene, closed_form
from symtop.model.top import Angles, SymmetricTop

WIDEST_DIFFERENCE = 0.04  # the first differencing width, in radians and units of the momenta
WIDTHS = 5  # differencing widths, each half the one before
COARSE_GAP = 3e-3  # the largest step is used that differs from two steps of half its size by less than this
LOOSE_TOLERANCE = 1e-3  # tolerance of the runs of an adaptive method, loose enough to show a defect
UNIT_LENGTH = 1e-12  # |e| = 1 and |q| = 1 within this
APART = 0.01  # rad: nearer to a pole a state in angles has an error of 2e-16 over the square of this distance
UPRIGHT = 1e-15  # rad: nearer to a pole an axis counts as vertical; pi itself is rounded by 1.2e-16
LEAST_UNIT = 1e-3  # least unit of the momenta, in 2 pi I1 over the nutation period
RUN_NUTATIONS = 0.37  # nutations: the duration of the run of an adaptive method, and the first trial of a fixed step
SEVERAL = 8  # steps, more than the starting steps of any multistep method


@dataclass(frozen=True)
class StepMap:
    """The map of one step of a method in one of its charts, on one top."""

    method: Integrator
    chart: str
    top: SymmetricTop
    unit: float  # of momenta
    h: float

    def run(self, start: Angles, h: float, steps: int = 1) -> Run:
        """A run of `steps` steps of h, sampled at its end; for an adaptive method a run over the same time."""
        if self.method.fixed_step:
            plan = Plan.steps(h, [steps])
        else:
            tolerance = max(LOOSE_TOLERANCE, self.method.least_tolerance) if self.method.adaptive else math.nan
            plan = Plan.until([steps * h], tolerance)
        run = solve(self.method, self.chart, self.top, start, plan)
        if run.outcome != "ok" or not np.isfinite(run.states).all():
            raise SymtopError(f"a step of {h:.3g} in the {self.chart} chart ended as {run.outcome}")
        return run

    def shown(self, run: Run) -> Array:
        """The last sample as Y."""
        return self.scaled(run.states[-1], run.p_phi[-1], run.p_psi[-1])

    def scaled(self, state: Array, p_phi: float, p_psi: float) -> Array:
        """A state of the chart as Y; p_phi and p_psi are used only in the angles chart."""
        if self.chart == "angles":
            theta, p_theta, phi, psi = state
            return np.array([theta, phi, psi, *(np.array([p_theta, p_phi, p_psi]) / self.unit)])
        return np.concatenate([state[:-3], state[-3:] / self.unit])

    def own(self, name: str) -> Any:
        """An optional function of a solver of fixed steps, by its name; None if the solver does not have it.

        onward          a run of steps (top, start, lengths), each from where the last one ended; runs from a start
                        cannot replace it, for a start has |e| = 1 and |q| = 1 and a state may not
        there_and_back  a step and one from its end with all rates reversed (top, start, step size)
        """
        return getattr(self.method.solvers[self.chart], name, None) if self.method.fixed_step else None

    def image(self, z: Array, h: float | None = None) -> Array:
        """Y after one step from z."""
        return self.shown(self.run(self.angles(z), self.h if h is None else h))

    def angles(self, z: Array) -> Angles:
        """The start at a point z."""
        return angles_at(self.top, np.concatenate([z[:3], self.unit * z[3:]]))

    def at(self, start: Angles) -> Array:
        """Y of a start itself."""
        if self.chart == "angles":
            return self.point(start)
        return self.scaled(charts.space_state(self.chart, self.top, start), 0.0, 0.0)

    def motion(self, start: Angles) -> Callable[[float], Array]:
        """Y of the true motion from a start as a function of time; q has the sign that is nearer to the start's q."""
        exact, before = closed_form(Scene("start", self.top, start, 1.0)), self.at(start)
        return lambda time: aligned(self.chart, self.at(Angles(*map(float, exact(time)))), before)

    def point(self, start: Angles) -> Array:
        """z of a start."""
        momenta = self.top.momenta(start)
        scaled = np.array([self.top.I1 * start.theta_dot, momenta.p_phi, momenta.p_psi]) / self.unit
        return np.array([start.theta, start.phi, start.psi, *scaled])

    def restart(self, y: Array) -> Angles:
        """The start with a given Y; in the axis chart the spin angle is arbitrary and set to zero."""
        if self.chart == "angles":
            return self.angles(y)
        state = np.concatenate([y[:-3], self.unit * y[-3:]])
        if self.chart == "attitude":
            return charts.angles_from_attitude(self.top, state)
        phi = charts.phi_from_axis(state[:3])
        rates = charts.rates_from_momentum(self.top, state[:3], phi, state[3:])
        return Angles(*(float(value) for value in (charts.theta_from_axis(state[:3]), phi, 0.0, *rates)))

    def length(self, y: Array) -> float:
        """|e| or |q| of Y; 1 in the angles chart."""
        return 1.0 if self.chart == "angles" else float(np.linalg.norm(y[:-3]))

    def gap(self, first: Array, second: Array) -> float:
        """Largest difference of two Y; q and -q are one attitude, phi and psi are angles."""
        difference = first - aligned(self.chart, second, first)
        if self.chart == "angles":
            difference[1:3] = np.remainder(difference[1:3] + math.pi, 2.0 * math.pi) - math.pi
        return float(np.max(np.abs(difference)))


def angles_at(top: SymmetricTop, z: Array) -> Angles:
    """The start at (theta, phi, psi, p_theta, p_phi, p_psi); SymtopError at a pole."""
    theta, phi, psi, p_theta, p_phi, p_psi = (float(value) for value in z)
    if abs(math.sin(theta)) < UPRIGHT:
        raise SymtopError("a step is looked at beside a start of the scene, and its axis stays upright")
    phi_dot = (p_phi - p_psi * math.cos(theta)) / (top.I1 * math.sin(theta) ** 2)
    return Angles(theta, phi, psi, p_theta / top.I1, phi_dot, p_psi / top.I3 - phi_dot * math.cos(theta))


def one_step(method: Integrator, chart: str, scene: Scene, h: float) -> StepMap:
    """The map of a step of a given h."""
    return StepMap(method, chart, scene.top, unit_of(scene), h)


def unit_of(scene: Scene) -> float:
    """The unit of the momenta: the larger of |p_phi| and |p_psi|, but at least `LEAST_UNIT` (of 2 pi I1 / period)."""
    return float(max(scene.momentum_scale, LEAST_UNIT * scene.top.I1 * 2.0 * math.pi / scene.time_scale()))


def generic_start(scene: Scene) -> Angles:
    """A point of the scene's true motion where nothing is special: no turning point, no phase of zero, no pole."""
    start: Angles = scene.start
    if scene.of_body or not math.isfinite(scene.nutation_period):
        return start
    point = Angles(*map(float, closed_form(scene)(0.3711 * scene.nutation_period)))
    return start if math.sin(point.theta) < APART else point


def drawn(scene: Scene, count: int, seed: int, *, same_top: bool) -> Iterator[Scene]:
    """Random starts whose axes are spread over all heights but the poles, on random tops or all on the `same_top`."""
    rng, rate = np.random.default_rng(seed), 2.0 * math.pi / scene.time_scale()
    for height in rng.permutation(count):
        cosine, top = 0.99 * (2.0 * (height + rng.uniform()) / count - 1.0), scene.top
        size, shape, weight = 2.0 ** rng.uniform(-1.0, 1.0), rng.uniform(0.2, 1.8), 2.0 ** rng.uniform(-1.0, 1.0)
        if not same_top:
            top = SymmetricTop(top.I1 * size, top.I1 * size * shape, top.mgl * size * weight)
        rates = rate * rng.uniform(-1.0, 1.0, 3) * np.array([0.5, 0.5, 2.0])
        yield Scene("drawn", top, Angles(math.acos(cosine), *rng.uniform(-3.0, 3.0, 2), *rates.tolist()), 1.0)


def step_map(method: Integrator, chart: str, scene: Scene) -> tuple[StepMap, Angles]:
    """The map of a step large enough to show a defect, and the start to judge it at; SymtopError if there is none."""
    start, trial = generic_start(scene), one_step(method, chart, scene, RUN_NUTATIONS * scene.time_scale())
    return coarsest(trial, start) if method.fixed_step else trial, start


def coarsest(trial: StepMap, start: Angles) -> StepMap:
    """The map of the largest step, from that of `trial` downwards, that two half steps match to within `COARSE_GAP`."""
    refusal = SymtopError(f"{trial.method.name} makes no step in the {trial.chart} chart")
    h = trial.h
    for _ in range(40):
        try:
            halves = trial.shown(trial.run(start, 0.5 * h, 2))
            if trial.gap(trial.image(trial.point(start), h), halves) < COARSE_GAP:
                return replace(trial, h=h)
        except SymtopError as error:
            refusal = error
        h *= 0.7
    raise refusal


def canonical(size: int) -> Array:
    """The canonical matrix J (size, size), angles before momenta."""
    zero, unit = np.zeros((size // 2, size // 2)), np.eye(size // 2)
    return np.block([[zero, unit], [-unit, zero]])


def bracket(chart: str, y: Array) -> Array:
    """B(Y): the brackets of all pairs of the chart's variables, momenta in the map's unit."""
    if chart in ("angles", "nutation"):
        return canonical(y.size)
    position, momentum = y[:-3], y[-3:]
    units = np.eye(3)
    rotations = [np.cross(unit, momentum) for unit in units]
    if chart == "axis":
        columns = [np.cross(unit, position) for unit in units]
    else:
        w, x = position[0], position[1:]
        columns = [0.5 * np.array([-(unit @ x), *(w * unit + np.cross(unit, x))]) for unit in units]
    block = np.stack(columns, axis=1)
    return np.block([[np.zeros((position.size, position.size)), block], [-block.T, np.stack(rotations, axis=1)]])


class Defect(NamedTuple):
    """How far a step is from preserving the bracket."""

    size: float  # max |D J D^T - B|, extrapolated
    rest: float  # the third singular value: zero if the defect comes from one parameter adapted to the start
    noise: float  # estimated error of the differencing
    widths: Array
    raw: Array  # the defect from plain central differences of each width


def symplectic_defect(step: StepMap, start: Angles) -> Defect:
    """The defect of the bracket after one step from `start`, extrapolated to width zero, with its estimated error."""
    z = step.point(start)
    middle = step.image(z)
    scale = min(1.0, math.sin(start.theta))  # near a pole the map varies over the distance from the pole
    widths = np.array([scale * WIDEST_DIFFERENCE / 2.0**k for k in range(WIDTHS)])
    table = [[_differences(step, z, middle, width)] for width in widths]
    best, error = table[0][0], math.inf
    for k in range(1, WIDTHS):
        for j in range(1, k + 1):
            finer, coarser = table[k][j - 1], table[k - 1][j - 1]
            table[k].append(finer + (finer - coarser) / (4.0**j - 1.0))
            change = max(_largest(table[k][j] - finer), _largest(table[k][j] - coarser))
            if change < error:
                best, error = table[k][j], change
    noise = 4.0 * _largest(best) * error + 1e-13
    raw = np.array([_largest(_defect(step.chart, row[0], middle)) for row in table])
    remainder = float(np.linalg.svd(_defect(step.chart, best, middle), compute_uv=False)[2:3].sum())
    return Defect(_largest(_defect(step.chart, best, middle)), remainder, noise, widths, raw)


def _differences(step: StepMap, z: Array, middle: Array, width: float) -> Array:
    columns = []
    for k in range(z.size):
        if step.chart == "axis" and k == 2:  # the variables of the axis chart do not depend on psi
            columns.append(np.zeros_like(middle))
            continue
        offset = width * np.eye(z.size)[k]
        forward, backward = (aligned(step.chart, step.image(z + sign * offset), middle) for sign in (1.0, -1.0))
        columns.append((forward - backward) / (2.0 * width))
    return np.stack(columns, axis=1)


def aligned(chart: str, y: Array, middle: Array) -> Array:
    """Y with the sign of q that is nearer to that of `middle`: q and -q are one attitude."""
    opposite = chart == "attitude" and float(y[:4] @ middle[:4]) < 0.0
    return np.concatenate([-y[:4], y[4:]]) if opposite else y


def _defect(chart: str, slopes: Array, y: Array) -> Array:
    difference: Array = slopes @ canonical(slopes.shape[1]) @ slopes.T - bracket(chart, y)
    return difference


def _largest(matrix: Any) -> float:
    return float(np.max(np.abs(matrix)))


def return_miss(step: StepMap, start: Angles) -> float:
    """Distance from the start after a step forth and back; without negative steps the way back has reversed rates."""
    before = step.at(start)
    if (onward := step.own("onward")) is not None:
        try:
            return step.gap(step.shown(onward(step.top, start, (step.h, -step.h))), before)
        except SymtopError:
            if (there_and_back := step.own("there_and_back")) is not None:
                return step.gap(step.shown(there_and_back(step.top, start, step.h)), before)
            if abs(step.length(step.image(step.point(start))) - 1.0) > UNIT_LENGTH:
                raise
    end = step.restart(step.image(step.point(start)))
    if step.method.fixed_step:
        with contextlib.suppress(SymtopError):
            return step.gap(step.shown(step.run(end, -step.h)), before)
    returned = step.restart(step.shown(step.run(reversed_rates(end), step.h)))
    return step.gap(step.at(reversed_rates(returned)), before)


def reversed_rates(start: Angles) -> Angles:
    """The start with the same attitude and all rates negated."""
    return Angles(start.theta, start.phi, start.psi, -start.theta_dot, -start.phi_dot, -start.psi_dot)


def restart_gap(step: StepMap, start: Angles) -> float:
    """Difference between a run of two steps (or `SEVERAL` quarter steps) and as many runs of one: rounding for a map.

    A step that does not keep |e| or |q| at one cannot be continued from a start: no evidence, and the result is zero.
    """
    if (onward := step.own("onward")) is not None:
        steps = step.shown(onward(step.top, start, (0.25 * step.h,) * SEVERAL))
        return step.gap(step.shown(step.run(start, 0.25 * step.h, SEVERAL)), steps)
    after = step.image(step.point(start))
    if not step.method.fixed_step or abs(step.length(after) - 1.0) > UNIT_LENGTH:
        return 0.0
    middle = step.restart(after)
    return step.gap(step.shown(step.run(start, step.h, 2)), step.shown(step.run(middle, step.h)))
