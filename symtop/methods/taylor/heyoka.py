"""Taylor series of the space-frame equations by heyoka, without poles.

    axis:      e' = L x e / I1,  L' = mgl k x e                      six variables, every term quadratic
    attitude:  q' = (L q / I1 + (1/I3 - 1/I1) p_psi q k)/2,  L' as above with e = q k q*    seven variables
    body:      q and M in body axes, of a body without symmetry (`heavy_body`)               seven variables
    angles:    the Euler-Lagrange equations, with poles (see `euler_lagrange`)               six variables

The order follows from the tolerance (about 20 in double), the step from the size of the series' last terms. Asking for
a hundredth of the rounding unit removes the truncation bias that makes energy drift linearly at tolerance eps.
`taylor` works in double, `taylor-longdouble` and `taylor-quad` with mantissas of 64 and 113 bits: they show the errors
of the method without rounding, and `symtop.reference` uses the same function. Its norm has all numbers of a state, so
that momenta above 128 are counted in another unit (`lightened`). A Taylor step of order n computes n
derivatives of the state; `force_evaluations` counts them. The registry has the two charts without poles; the study of
charts makes an integrator in angles for itself.
Source: Jorba and Zou, Experimental Mathematics 14 (2005) 99; Biscani and Izzo, MNRAS 504 (2021) 2614.
"""

import functools
import importlib.util
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from symtop.core.numbers import EPSILON, context
from symtop.methods.framework.equations import FORMS
from symtop.methods.framework.plan import Array, Plan, Run
from symtop.methods.framework.preparation import BareTop
from symtop.methods.framework.registry import Integrator
from symtop.model import charts
from symtop.model.charts import BODY
from symtop.model.exact import heavy_body
from symtop.model.top import Angles, SymmetricTop, flat, lightened

START_DIGITS = 60  # of the multiprecision that a start is converted in
MOST_STEPS = {"double": 30_000_000, "longdouble": 5_000_000, "quad": 100_000}  # of one run: 10 to 25 s


def equations(chart: str) -> list[Any]:
    """heyoka's system of a chart; of tops par = 1/I1, mgl, and p_psi (1/I3 - 1/I1), or I3 in angles."""
    import heyoka as hy  # Linux only

    if chart == BODY:
        return heavy_body.equations()
    if chart == "angles":
        theta, phi, psi, *rates = hy.make_vars("theta", "phi", "psi", "theta_dot", "phi_dot", "psi_dot")
        theta_dot, phi_dot, psi_dot = rates
        s, c, ratio = hy.sin(theta), hy.cos(theta), hy.par[0] * hy.par[2]
        spin = ratio * (psi_dot + phi_dot * c)
        theta_ddot = s * (phi_dot * (phi_dot * c - spin) + hy.par[0] * hy.par[1])
        phi_ddot = theta_dot * (spin - 2.0 * phi_dot * c) / s
        turns = [theta_ddot, phi_ddot, theta_dot * phi_dot * s - phi_ddot * c]
        return [*zip((theta, phi, psi), rates, strict=True), *zip(rates, turns, strict=True)]
    Lx, Ly, Lz = momentum = hy.make_vars("Lx", "Ly", "Lz")
    inverse, mgl, twist = hy.par[0], hy.par[1], hy.par[2]
    if chart == "axis":
        x, y, z = axis = hy.make_vars("ex", "ey", "ez")
        motion = [inverse * (Ly * z - Lz * y), inverse * (Lz * x - Lx * z), inverse * (Lx * y - Ly * x)]
    else:
        q0, q1, q2, q3 = axis = hy.make_vars("q0", "q1", "q2", "q3")
        x, y = 2.0 * (q1 * q3 + q0 * q2), 2.0 * (q2 * q3 - q0 * q1)
        motion = [
            0.5 * (inverse * (-Lx * q1 - Ly * q2 - Lz * q3) - twist * q3),
            0.5 * (inverse * (Lx * q0 + Ly * q3 - Lz * q2) + twist * q2),
            0.5 * (inverse * (Ly * q0 + Lz * q1 - Lx * q3) - twist * q1),
            0.5 * (inverse * (Lz * q0 + Lx * q2 - Ly * q1) + twist * q0),
        ]
    return [*zip(axis, motion, strict=True), *zip(momentum, [-mgl * y, mgl * x, 0.0 * x], strict=True)]


class Arithmetic(NamedTuple):
    """A floating-point type of heyoka."""

    kind: Any  # converts a decimal string
    epsilon: float
    compact: bool  # unrolled code in quadruple precision takes long to build and runs no faster


@functools.cache
def arithmetic(precision: str) -> Arithmetic:
    """The type behind "double", "longdouble" (80 bits on x86) or "quad" (113 bits)."""
    if precision == "double":
        return Arithmetic(float, EPSILON, compact=False)
    if precision == "longdouble":
        return Arithmetic(np.longdouble, float(np.finfo(np.longdouble).eps), compact=False)
    import heyoka as hy

    return Arithmetic(hy.real128, 2.0**-112, compact=True)


def stepper(chart: str, precision: str, tolerance: float) -> Any:
    """A compiled heyoka integrator; building one is slow the first time, then comes from its disk cache."""
    import heyoka as hy

    system, working = equations(chart), arithmetic(precision)
    zero, bound = [working.kind("0")] * len(system), working.kind(repr(tolerance))
    fp_type = np.float64 if precision == "double" else working.kind
    return hy.taylor_adaptive(system, zero, tol=bound, fp_type=fp_type, compact_mode=working.compact)


@functools.lru_cache(maxsize=32)
def _idle_steppers(chart: str, precision: str, tolerance: float) -> list[Any]:
    """The steppers of one kind that no run is using. A stepper holds the state of its run, so no two runs share one."""
    return []


def _unit(chart: str, top: Any, at: Any) -> float:
    """That of the momenta; angles come with rates."""
    return 1.0 if chart == "angles" else lightened(flat(top, at))[1]


@functools.lru_cache(maxsize=256)
def start_numbers(chart: str, precision: str, top: Any, at: Any) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
    """State and parameters of a start in the unit of `lightened`, correctly rounded; in double theta(8) moves 5e-15."""
    kind, mp, unit = arithmetic(precision).kind, context(START_DIGITS), _unit(chart, top, at)
    if chart == BODY:
        momentum = [mp.mpf(moment) * rate / unit for moment, rate in zip(top.moments, at.omega_body, strict=True)]
        numbers = *(unit / mp.mpf(moment) for moment in top.moments), *(mp.mpf(part) / unit for part in top.torque)
        return _rounded(kind, mp, (*map(mp.mpf, at.quaternion), *momentum)), _rounded(kind, mp, numbers)
    theta, phi, psi, *rates = (mp.mpf(getattr(at, name)) for name in at.__slots__)
    if chart == "angles":
        numbers = 1 / mp.mpf(top.I1), mp.mpf(top.mgl), mp.mpf(top.I3)
        return _rounded(kind, mp, (theta, phi, psi, *rates)), _rounded(kind, mp, numbers)
    place = charts.axis_parts(mp, theta, phi) if chart == "axis" else charts.quaternion_parts(mp, theta, phi, psi)
    state = [*place, *(part / unit for part in charts.momentum_parts(mp, top, theta, phi, *rates))]
    spin = top.I3 * (rates[2] + rates[1] * mp.cos(theta))
    twist = spin * (1 / mp.mpf(top.I3) - 1 / mp.mpf(top.I1))
    return _rounded(kind, mp, state), _rounded(kind, mp, (unit / mp.mpf(top.I1), mp.mpf(top.mgl) / unit, twist))


def _rounded(kind: Any, mp: Any, values: Iterable[Any]) -> tuple[Any, ...]:
    return tuple(kind(mp.nstr(value, 50)) for value in values)


class Flight(NamedTuple):
    """What one run of heyoka returns."""

    states: Any  # (times, dimension of the chart), in the working precision
    steps: int
    order: int
    outcome: str  # as heyoka names it
    time: float  # of the last completed step


def propagate(
    chart: str, precision: str, tolerance: float, top: SymmetricTop, start: Angles, times: Array, max_steps: int = 0
) -> Flight:
    """heyoka's states, in the working precision, at increasing times, or those reached in `max_steps`."""
    kind, grid = arithmetic(precision).kind, times if times[0] == 0.0 else np.concatenate([[0.0], times])
    numbers = grid if precision == "double" else np.array([kind(float(t)) for t in grid])
    pool = _idle_steppers(chart, precision, tolerance)
    try:
        integrator = pool.pop()  # in one instruction: another thread may be here, too
    except IndexError:
        integrator = stepper(chart, precision, tolerance)
    state, parameters = start_numbers(chart, precision, top, start)
    integrator.time = kind("0")
    integrator.state[:] = state
    integrator.pars[:] = parameters[: integrator.pars.size]  # the axis chart does not need the last one
    outcome, _, _, steps, *_, states = integrator.propagate_grid(numbers, max_steps=max_steps)
    order, time = int(integrator.order), float(integrator.time)
    if (unit := _unit(chart, top, start)) != 1.0:
        states[:, -3:] *= kind(repr(unit))
    pool.append(integrator)  # not after an exception, which may leave it in any state
    return Flight(states[grid.size - times.size :], int(steps), order, outcome.name, time)


@dataclass(frozen=True)
class HeyokaSolver:
    """A solver of one chart and precision, samples in double."""

    chart: str
    precision: str

    def __call__(self, top: SymmetricTop, start: Angles, plan: Plan) -> Run:
        """Run from the start to the horizon, samples by dense output."""
        form = FORMS[self.chart]
        limit = max(1, int(min(plan.most(MOST_STEPS[self.precision]), sys.maxsize)))  # infinity is a budget, too
        flight = propagate(self.chart, self.precision, plan.tolerance, top, start, plan.times, limit)
        count, size = len(flight.states), plan.times.size
        states = _padded(flight.states, size)
        par = BareTop(top.I1, top.I3, top.mgl) if self.chart == "angles" else None
        samples = flight.states if self.chart in ("axis", "attitude") else states  # the others work in double
        p_phi, p_psi = (_padded(values, size) for values in form.momenta(par, samples))
        if form.present is not None:
            states = form.present(par, plan.times, states)
        finite: Any = np.isfinite(states).all(axis=1)
        outcome = "ok" if finite.all() and "time_limit" in flight.outcome else "not_finite"
        if "step_limit" in flight.outcome and finite[:count].all():
            outcome = "out_of_budget"
        reached = plan.horizon if outcome == "ok" else float(plan.times[finite][-1]) if finite.any() else 0.0
        reached = flight.time if outcome == "out_of_budget" else reached
        return Run(states, p_phi, p_psi, flight.steps, flight.steps * flight.order, 0, outcome, reached)

    def bare(self, top: SymmetricTop, start: Angles, plan: Plan) -> tuple[Callable[[], Any], int]:
        """A function that runs heyoka's own loop to the horizon, without samples, and the derivatives it computes."""
        state, parameters = start_numbers(self.chart, self.precision, top, start)
        taylor, kind = stepper(self.chart, self.precision, plan.tolerance), arithmetic(self.precision).kind
        begin, end, parameters = kind("0"), kind(plan.horizon), parameters[: taylor.pars.size]

        def run() -> Any:
            taylor.time, taylor.state[:], taylor.pars[:] = begin, state, parameters
            return taylor.propagate_until(end)

        return run, int(run()[3] * taylor.order)


def _padded(values: Any, size: int) -> Array:
    """Values as doubles, and NaN for the times that were not reached."""
    if len(values) == size and values.dtype == np.float64:
        return values  # type: ignore[no-any-return]  # not shared with another run: no copy
    result = np.full((size, *values.shape[1:]), np.nan)
    result[: len(values)] = values
    return result


# beyond double there are no vector units, and quadruple precision is software
_SUMMARIES = {
    "double": "heyoka's Taylor series on the space-frame equations, without poles",
    "longdouble": "heyoka's Taylor series in 80-bit arithmetic, samples rounded to double",
    "quad": "heyoka's Taylor series in quadruple precision, samples rounded to double; slow, keep the horizon short",
}


def built_in() -> list[Integrator]:
    """heyoka's integrator in three arithmetics, where heyoka is installed."""
    try:
        import heyoka as hy
    except ImportError:
        return []
    extended = ["longdouble"] if np.finfo(np.longdouble).eps < EPSILON else []
    quad = ["quad"] if hasattr(hy, "real128") else []
    return [
        Integrator(
            name="taylor" if precision == "double" else f"taylor-{precision}",
            family="taylor", summary=_SUMMARIES[precision],
            solvers={chart: HeyokaSolver(chart, precision) for chart in ("axis", "attitude", BODY)},
            control="tolerance", explicit=True, symplectic=False, symmetric=False, conserves=frozenset(),
            least_tolerance=arithmetic(precision).epsilon / 1000.0,
            default_tolerance=arithmetic(precision).epsilon / 100.0,
            reference="biscani-izzo-2021", needs="expression", general=True, inner_loop="heyoka", precision=precision,
            speed=0.002 if precision == "quad" else 1.0,
        )
        for precision in ("double", *extended, *quad)
    ]  # fmt: skip


def missing() -> dict[str, str]:
    """Names that cannot be registered here, each with the reason."""
    if importlib.util.find_spec("heyoka") is not None:
        return {}
    reason = "needs the package heyoka, which has wheels for Linux only (elsewhere: conda-forge)"
    return {name: f"{name} {reason}" for name in ("taylor", "taylor-longdouble", "taylor-quad")}
