"""Independent checks of the closed form: integrations, the iterated discrete map, and the closed form in 40 digits.

heyoka integrates the space-frame equations in double, long double or quadruple precision (never in angles, which lose
digits near a pole), at a tolerance of a hundredth of the rounding unit, from a start that is built in 60 digits. Its
error is measured against the closed form in `DIGITS` digits at `CHECKS` times. It grows, so that the bound at a time t
is `SAFETY` times the largest error at any check up to the next one after t.

The iterated map `exact-discrete` shares only the start with the others: it has no series in time, no theta function, no
integral over the motion. Its error is estimated by changing mgl by one unit in the last place, and the step size.
"""

import functools
import importlib.util
import math
import time
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from symtop.core.errors import SymtopError, foreign_code
from symtop.core.numbers import context
from symtop.methods.framework.plan import Plan
from symtop.methods.framework.registry import integrator
from symtop.methods.taylor import heyoka
from symtop.model import charts
from symtop.model.charts import Array
from symtop.model.exact.digits import PreciseForm
from symtop.model.scenes import Scene, closed_form
from symtop.model.top import Angles, SymmetricTop

CHECKS = 16  # times, besides those of fastest nutation
DIGITS = 40
SAFETY = 8.0  # factor from the largest error seen to a bound
MAP_STEPS = (4.37, 7.13)  # steps of the discrete map per nutation, of two runs that have no constant in common
MOST_NUTATIONS = 1e4  # over which the map is iterated
CHECKED = ("attitude", "axis", "phi", "psi")

Checks = dict[str, Array]  # largest errors up to each check time (running maxima), by quantity, and the ``times``


def integrate(scene: Scene, times: Array, precision: str, chart: str = "attitude") -> tuple[Any, int]:
    """heyoka's states at increasing times in its precision, and the steps; SymtopError if it ends before the last."""
    tolerance = heyoka.arithmetic(precision).epsilon / 100.0
    with foreign_code(f"heyoka's integration of {scene.name} in {precision}"):
        flight = heyoka.propagate(chart, precision, tolerance, scene.top, scene.start, times)
    if len(flight.states) < times.size:
        reached = float(times[len(flight.states) - 1]) if len(flight.states) else 0.0
        end = f"ends at t = {reached:.6g} ({flight.outcome}); the closed form has no such limit"
        raise SymtopError(f"heyoka's integration of {scene.name} in {precision} {end}")
    return flight.states, flight.steps


def iterate_map(scene: Scene, times: Array, per_nutation: float = MAP_STEPS[0]) -> tuple[Any, int]:
    """Attitudes (n, 4) of the discrete map at times (n,) > 0, each reached in whole steps, and the number of steps."""
    solve = integrator("exact-discrete").solvers["attitude"]
    nutation, attitudes, total = min(scene.nutation_period, scene.horizon), [], 0
    nutation = max(nutation, float(np.max(times)) / MOST_NUTATIONS)  # if the horizon is far below a nutation
    for t in map(float, times):
        steps = math.ceil(t / nutation * per_nutation)
        attitudes.append(solve(scene.top, scene.start, Plan.steps(t / steps, [steps])).states[0, :4])
        total += steps
    return np.array(attitudes), total


def iterate_map_with_error(scene: Scene, times: Array) -> tuple[Any, Array]:
    """Attitudes of the discrete map, and `SAFETY` times their distance from runs with another step and another mgl."""
    attitudes, gap = iterate_map(scene, times)[0], np.zeros(len(times))
    for direction in (-math.inf, math.inf):
        mgl = math.nextafter(scene.top.mgl, direction) if scene.top.mgl else 0.0
        near = iterate_map(replace(scene, top=replace(scene.top, mgl=mgl)), times, MAP_STEPS[1])[0]
        gap = np.maximum(gap, charts.attitude_distance(attitudes, near))
    return attitudes, SAFETY * np.maximum.accumulate(gap)


def have_heyoka() -> bool:
    """Is heyoka installed? It has wheels for Linux only."""
    return importlib.util.find_spec("heyoka") is not None


def check_times(scene: Scene, horizon: float) -> Array:
    """Times of the checks: denser towards the start, the last one at the horizon.

    For each, the moment of fastest nutation in the period before it is added: there an error of phase has the largest
    effect; elsewhere it may be thousands of times smaller (near a separatrix the top hovers, with small errors).
    """
    even = horizon * (np.arange(1, CHECKS + 1) / CHECKS) ** 2
    period = min(scene.nutation_period, horizon)
    grid = np.maximum(even[:, None] - period * np.linspace(0.0, 1.0, 64), 0.0)
    speed = np.nan_to_num(np.abs(closed_form(scene)(grid).theta_dot))
    fastest = grid[np.arange(CHECKS), np.argmax(speed, axis=1)]
    return np.unique(np.concatenate([even, fastest[fastest > 0.0]]))


@functools.lru_cache(maxsize=8)
def precise_form(top: SymmetricTop, start: Angles, digits: int) -> PreciseForm:
    """The closed form in `digits` digits."""
    return PreciseForm(top, start, digits)


@functools.lru_cache(maxsize=2048)  # integrations in three precisions have the same checks
def precise_attitude(top: SymmetricTop, start: Angles, t: float) -> tuple[Any, ...]:
    """The attitude at time t in `DIGITS` digits, as w, x, y, z."""
    return precise_form(top, start, DIGITS).quaternion(t)


def largest_errors(scene: Scene, times: Array, quaternions: Any, phis: Any, psis: Any) -> Checks:
    """Running maxima of the errors of given attitudes and angles, against the closed form in `DIGITS` digits."""
    mp, rows = context(DIGITS + 10), []
    for t, *numbers in zip(times, *quaternions.T, phis, psis, strict=True):
        precise = precise_attitude(scene.top, scene.start, float(t))
        w, x, y, z = true = np.array([mp.convert(value) for value in precise])  # all digits, in this arithmetic
        *q, phi, psi = [mp.mpf(float(number) if isinstance(number, float) else str(number)) for number in numbers]
        attitude = np.array(q) if true @ q >= 0 else -np.array(q)
        turn = 2.0 * float(mp.norm(attitude - true))
        tilt = float(mp.norm(charts.axis_from_quaternion(attitude) - charts.axis_from_quaternion(true)))
        total, difference = mp.atan2(z, w), mp.atan2(y, x)
        rows.append((turn, tilt, _angle_gap(mp, phi, total + difference), _angle_gap(mp, psi, total - difference)))
    return {"times": times, **dict(zip(CHECKED, np.maximum.accumulate(np.array(rows), axis=0).T, strict=True))}


def _angle_gap(mp: Any, angle: Any, true: Any) -> float:
    """Distance of two angles modulo a full turn."""
    gap = (angle - true) / (2 * mp.pi)
    return abs(float((gap - mp.nint(gap)) * 2 * mp.pi))


def envelope(checks: Checks, name: str, times: Array) -> Array:
    """SAFETY times the largest error at any check up to the first one that is not before t."""
    after = np.minimum(np.searchsorted(checks["times"], times, side="left"), checks[name].size - 1)
    return SAFETY * checks[name][after]


def _unwrapped(angle: Any, near: Array) -> Any:
    """`angle` plus the multiple of 2 pi that brings it nearest to `near`, without rounding 2 pi to double."""
    turns = np.rint((near - angle.astype(np.float64)) / (2.0 * math.pi))
    return angle + turns.astype(angle.dtype) * angle.dtype.type("6.283185307179586476925286766559005768394")


class Integration(NamedTuple):
    """heyoka's run through the given times and those of the checks."""

    grid: Array  # all of them, increasing
    chosen: Any  # indices of the given times in the grid
    checked: Any  # indices of the times of the checks
    states: Any  # of the attitude, in the working precision
    seconds: float  # of the integration alone

    @property
    def axes(self) -> Any:
        """The axis at the given times."""
        return charts.axis_from_quaternion(self.states[self.chosen, :4])


def integrate_with_checks(scene: Scene, times: Array, precision: str) -> Integration:
    """The integration for `integration_values`, through the given times and those of the checks."""
    check = check_times(scene, float(times[-1]))
    grid, inverse = np.unique(np.concatenate([times, check]), return_inverse=True)
    start = time.perf_counter()
    states, _ = integrate(scene, grid, precision)
    return Integration(grid, inverse[: times.size], inverse[times.size :], states, time.perf_counter() - start)


def integration_values(scene: Scene, run: Integration) -> tuple[dict[str, Any], Checks]:
    """heyoka's quantities at the times of a run, and their errors at its checks."""
    attitude = run.states[:, :4]
    theta, phi, psi = charts.angles_from_quaternion(attitude)
    motion = closed_form(scene)(run.grid)
    columns = {
        "theta": theta,
        "phi": _unwrapped(phi, motion.phi),
        "psi": _unwrapped(psi, motion.psi),
        "axis": charts.axis_from_quaternion(attitude),
        "quaternion": attitude,
    }
    index = run.checked
    checks = largest_errors(scene, run.grid[index], attitude[index], columns["phi"][index], columns["psi"][index])
    return {name: values[run.chosen] for name, values in columns.items()}, checks
