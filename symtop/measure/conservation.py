"""What a run does to the constants of the motion: residuals, their trends, and momenta that are only reported.

A trend is the slope of the least-squares line through the means of `BLOCKS` equal stretches, with Student's 95 %
interval, widened by the correlation of what the line leaves over. Samples are never commensurate with the
nutation, so that a fast oscillation averages out. A random walk, which is what rounding makes, has no slope but
wanders: in 33 % of cases its interval is too narrow (white noise: 3 %), so that near rounding the exponent of growth,
1/2, is the better witness.

In the angles chart p_phi and p_psi are parameters of a state. What the trajectory itself says of them are its rates,

    p_psi = I3 (psi' + phi' cos theta),    p_phi = I1 phi' sin^2 theta + p_psi cos theta,

phi' and psi' by central differences of order 8 over nine consecutive steps. They differ from the momenta of a method by
its error of a step, which oscillates with the nutation and does not grow. A run that loses its momenta and reports
those of its start shows a difference that drifts, as far as its momenta do (`from_increments`).
"""

import math
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from symtop.core.numbers import GOLDEN
from symtop.measure.growth import change_point, growth, law, tops
from symtop.measure.phase import nutation_phase
from symtop.measure.statistics import line, student
from symtop.methods.framework.calling import solve
from symtop.methods.framework.plan import Plan, Run
from symtop.methods.framework.registry import Integrator
from symtop.model.charts import Array
from symtop.model.scenes import Scene
from symtop.model.top import SymmetricTop
from symtop.run.simulation import integrate
from symtop.run.trajectory import Trajectory

CONSTANTS = ("energy", "p_phi", "p_psi")
BLOCKS = 24
WINDOWS = 24  # for a change of law: each side of it needs at least five
SETTLED = 30.0  # nutations: before, an oscillation switches on, which is no change of law


class Trend(NamedTuple):
    """A linear trend of a residual."""

    slope: float  # per unit time
    interval: float  # half-width, 95 %
    rise: float  # slope times the length of the run

    @property
    def significant(self) -> bool:
        """Does the interval exclude zero?"""
        return bool(abs(self.slope) > self.interval)


class Changed(NamedTuple):
    """What became of a quantity that the true motion keeps: its size, its trend and its law of growth."""

    largest: float  # NaN if there is no finite sample
    slope: float  # of the trend, per unit time
    interval: float
    rise: float
    exponent: float  # of growth with time
    exponent_interval: float  # half-width, 95 %
    law: str  # name of the exponent


def constant_of(time: ArrayLike, residual: ArrayLike, decades: float = 2.0) -> Changed:
    """Size, trend and growth over the last `decades` of a residual (n,) at times (n,); samples may be NaN."""
    size, power = np.abs(np.asarray(residual, float)), growth(time, residual, decades)
    largest = float(np.max(size[np.isfinite(size)], initial=-1.0))
    return Changed(
        largest if largest >= 0.0 else math.nan, *trend(time, residual), power.slope, power.interval, law(power)
    )


def history(scene: Scene, method: Integrator, **settings: Any) -> xr.Dataset:
    """One run and what became of the constants of the motion and of its phase.

    Dimension ``sample``: ``sample_time`` and, for energy, p_phi and p_psi, ``NAME_residual``. For each of them the
    ``largest``, the linear ``slope`` with its ``interval`` and ``rise``, and the ``exponent`` of growth over the last
    two decades; for the phase of the nutation (rad; NaN where there is none) ``largest`` and ``exponent``, over the
    last decade, because a wrong frequency gives way to a drifting one only late. ``exponent_interval`` goes with each,
    and ``law``, its name; where one law gives way to another, ``change`` is the time, ``before`` and ``after`` are the
    exponents (NaN where none does).
    """
    run = integrate(scene, method, observe="nutation", **settings)
    time = run.time
    columns: dict[str, Any] = {"sample_time": ("sample", time), "outcome": run.outcome, "steps": run.steps}
    period = scene.nutation_period
    late = time > (SETTLED * period if math.isfinite(period) else 0.0)
    for name, values in residuals(scene, run).items():
        columns[f"{name}_residual"] = ("sample", values)
        columns |= _columns(name, constant_of(time, values)._asdict(), time[late], values[late])
    phase = nutation_phase(scene, time, run.theta, run.p_theta / scene.top.I1)
    changed = constant_of(time, phase, 1.0)._asdict()
    without_trend = {part: value for part, value in changed.items() if part not in Trend._fields}
    return xr.Dataset(columns | _columns("phase", without_trend, time[late], phase[late]))


def _columns(name: str, changed: dict[str, Any], time: np.ndarray, values: np.ndarray) -> dict[str, Any]:
    """What became of a quantity, and where within the last two decades another law than that of the end ended."""
    change = change_point(*tops(time, values, count=WINDOWS)) if time.size else None
    when, before, after = (math.nan,) * 3 if change is None else change
    parts = changed | {"change": when, "before": before, "after": after}
    return {f"{name}_{part}": value for part, value in parts.items()}


def residuals(scene: Scene, run: Trajectory) -> dict[str, np.ndarray]:
    """Relative change of energy, p_phi and p_psi since the start, signed."""
    scales = {"energy": scene.energy_scale, "p_phi": scene.momentum_scale, "p_psi": scene.momentum_scale}
    values = {name: getattr(run, name) for name in CONSTANTS}
    return {name: (values[name] - values[name][0]) / scales[name] for name in CONSTANTS}


def trend(time: ArrayLike, residual: ArrayLike) -> Trend:
    """The linear trend of a residual (n,) at times (n,), from the means of `BLOCKS` equal stretches of the run."""
    t, r = np.asarray(time, float), np.asarray(residual, float)
    good = np.isfinite(r)
    t, r = t[good], r[good]
    if t.size < 2 * BLOCKS:
        return Trend(math.nan, math.nan, math.nan)
    t_mean = np.array([part.mean() for part in np.array_split(t, BLOCKS)])
    r_mean = np.array([part.mean() for part in np.array_split(r, BLOCKS)])
    slope, error, _, rest = line(t_mean, r_mean)
    # first-order autocorrelation r of the residuals leaves (1-r)/(1+r) of them independent; r is biased by about -4/n
    power = float(rest @ rest)
    memory = float(rest[1:] @ rest[:-1]) / power + 4.0 / BLOCKS if power > 0.0 else 0.0
    memory = min(max(memory, 0.0), 0.95)
    error *= math.sqrt((1.0 + memory) / (1.0 - memory))
    return Trend(slope, student(BLOCKS - 2) * error, slope * float(t[-1] - t[0]))


STENCIL = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0.0, 4 / 5, -1 / 5, 4 / 105, -1 / 280])
REACH = 4  # steps to either side
PLACES = 240
FEWEST = 4000  # steps: in a shorter run places would meet
SURE = 8.0  # intervals of the trend
LEAST = 1e-8  # relative: what differences of angles of many turns leave in doubt
SHARE = 0.5  # of the drift of the increments' momentum: what the difference drifts by if the run hides it


class Difference(NamedTuple):
    """How far reported momenta are from those of the states."""

    name: str  # of the momentum that differs more
    size: float  # relative to the larger momentum
    floor: float  # a smaller one is rounding
    how: str


def from_increments(method: Integrator, scene: Scene, plan: Plan) -> Difference | None:
    """The drift of the difference over a run as long as `plan`, in the angles chart; None if the run is short."""
    steps = int(plan.marks[-1])
    if steps < FEWEST:
        return None
    places = np.arange(PLACES) + np.mod(GOLDEN * np.arange(PLACES), 1.0)
    middles = np.rint(places * (steps - 2 * REACH - 1) / PLACES).astype(np.int64) + REACH
    marks = (middles[:, None] + np.arange(-REACH, REACH + 1)).ravel()
    again = Plan.steps(plan.step_size, np.unique(marks))
    run = solve(method, "angles", scene.top, scene.start, again, f" on {scene.name}")
    return compared(scene, again, run, middles) if run.outcome == "ok" else None


def compared(scene: Scene, plan: Plan, run: Run, middles: Array) -> Difference:
    """The difference whose drift is larger, of a run that was sampled around `middles`."""
    place = np.searchsorted(plan.marks, middles)
    around = run.states[place[:, None] + np.arange(-REACH, REACH + 1)]  # (places, 9, 4)
    implied = dict(zip(("p_phi", "p_psi"), momenta_of(scene.top, around, plan.step_size), strict=True))
    times, sizes = plan.times[place], {}
    for name, values in implied.items():
        reported = getattr(run, name)[place]
        apart, own = trend(times, (values - reported) / scene.momentum_scale), trend(times, values)
        hidden = abs(apart.rise) > max(LEAST, SHARE * abs(own.rise) / scene.momentum_scale)
        sizes[name] = abs(apart.rise) if hidden and abs(apart.slope) > SURE * apart.interval else 0.0
    name = max(sizes, key=lambda one: sizes[one])
    return Difference(name, sizes[name], LEAST, f"more at the end of {int(plan.marks[-1])} steps than at their start")


def momenta_of(top: SymmetricTop, around: Array, h: float) -> tuple[Array, Array]:
    """p_phi and p_psi (places,) of nine consecutive states (places, 9, 4) in angles."""
    theta = around[:, REACH, 0]
    phi_dot, psi_dot = ((around[:, :, k] - around[:, REACH, None, k]) @ STENCIL / h for k in (2, 3))
    p_psi = top.I3 * (psi_dot + phi_dot * np.cos(theta))
    return top.I1 * phi_dot * np.sin(theta) ** 2 + p_psi * np.cos(theta), p_psi
