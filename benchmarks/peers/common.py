"""What the adapters share: the top's equations, in plain Python and compiled, and the two calls that are timed.

    axis     e' = L x e / I1,   L' = mgl z x e          six variables, quadratic, no pole anywhere
    angles   theta'', phi'', psi''                      six variables, Euler-Lagrange, a pole at theta = 0 and pi

The first form suits a general solver best: no sine, no singularity, twelve multiplications. Compiled right-hand sides
freeze the numbers of the top, as a user who wants speed would.

Two calls of every solver are timed. The *public call* is what a user writes: objects of the library are built in it,
and it ends with the sampled motion. The *inner loop* is what an author compares: everything that can be built once for
a top, a start and a setting is built before, and the call goes from the start to the horizon without a sample.
Compilation of machine code (numba, JAX, heyoka) happens before both.
"""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from symtop.methods.framework.angles import accelerations, with_rates
from symtop.methods.framework.plan import Array, Plan, Run
from symtop.methods.framework.registry import Integrator
from symtop.methods.framework.space import on_axis
from symtop.model import charts
from symtop.model.top import Angles, SymmetricTop

SAME = "rtol = atol = the tolerance"
PYTHON, NUMBA_IN_PYTHON, NUMBA_IN_C = "Python", "numba, called through Python", "numba, called from C"
DENSE, OWN_STEPS, FIXED_STEPS = "dense output", "the ends of its own steps", "ends of its fixed steps"


class Motion(NamedTuple):
    """What a public call returns: one row a sample, and the library's own counts (0: it does not say)."""

    states: Any
    steps: int = 0
    evaluations: int = 0


class Inner(NamedTuple):
    """An inner loop that is ready to run: a call that starts anew each time, and the end state of what it returned."""

    call: Callable[[], Any]
    end: Callable[[Any], Any]


def axes_of(chart: str, states: Array) -> Array:
    """The axis of each state, shape (states, 3)."""
    if chart == "angles":
        return charts.axis_from_angles(states[:, 0], states[:, 2])
    return states[:, :3] if chart == "axis" else charts.axis_from_quaternion(states[:, :4])


class Library:
    """One solver of another package.

    `public` does all that a user's call does, `inner` prepares the integration alone. `states_of` turns rows of the
    solver's own variables into states of `chart`. A library that would bend its steps to the times it is asked for has
    `own_steps`, and its accuracy is judged there.
    """

    chart = "axis"
    shows = DENSE

    def public(self, top: SymmetricTop, start: Angles, plan: Plan) -> Motion:
        """From the numbers of the top to the sampled motion."""
        raise NotImplementedError

    def inner(self, top: SymmetricTop, start: Angles, plan: Plan) -> Inner:
        """The integration to the horizon, ready to be called."""
        raise NotImplementedError

    def states_of(self, top: SymmetricTop, start: Angles, rows: Array) -> Array:
        """States of `chart`, one row a sample."""
        del top, start
        return rows

    def axes(self, top: SymmetricTop, start: Angles, rows: Any) -> Array:
        """The axis of each row, shape (rows, 3)."""
        return axes_of(self.chart, self.states_of(top, start, np.atleast_2d(np.asarray(rows, dtype=float))))

    def __call__(self, top: SymmetricTop, start: Angles, plan: Plan) -> Run:
        """The public call as a solver of the registry; samples that are missing or not finite are a failure."""
        motion = self.public(top, start, plan)
        states = np.full((plan.times.size, charts.DIMENSIONS[self.chart]), np.nan)
        count = min(len(motion.states), plan.times.size)
        if count:
            states[:count] = self.states_of(top, start, np.asarray(motion.states, dtype=float)[:count])
        good = np.isfinite(states).all(axis=1)
        reached = plan.horizon if good.all() else float(plan.times[good][-1]) if good.any() else 0.0
        blank = np.zeros(plan.times.size)  # only the axis is judged here
        outcome = "ok" if good.all() else "not_finite"
        return Run(states, blank, blank, int(motion.steps), int(motion.evaluations), 0, outcome, reached)


def start_of(top: SymmetricTop, start: Angles) -> Array:
    """(e, L) of a start; computed once, since a user writes it down as numbers."""
    return np.array(_on_axis(top, start))


def angles_of(top: SymmetricTop, start: Angles) -> Array:
    """(theta, phi, psi, theta', phi', psi') of a start."""
    return np.array(with_rates(top, start)[1])


@functools.lru_cache(maxsize=64)
def _on_axis(top: SymmetricTop, start: Angles) -> tuple[float, ...]:
    return on_axis(top, start)[1]


def with_start(plan: Plan) -> Array:
    """The sample times, with the start in front if it is not asked for."""
    return plan.times if plan.times[0] == 0.0 else np.concatenate([[0.0], plan.times])


def record(
    name: str, library: Library, formulation: str, *, control: str = "tolerance",
    implementation: str = "compiled", order: int | None = None, least: float = 1e-15,
) -> Integrator:  # fmt: skip
    """An outside solver in the same record as our own methods, so that one code measures both."""
    return Integrator(
        name=name,
        family="other",
        summary=formulation,
        solvers={library.chart: library},
        control=control,
        implementation=implementation,
        order=order,
        symplectic=False,
        least_tolerance=least,
    )


@functools.lru_cache(maxsize=16)
def python_field(top: SymmetricTop) -> Callable[[float, Any], list[float]]:
    """f(t, y) in plain Python on floats, which is faster than NumPy on six numbers."""
    inverse, mgl = 1.0 / top.I1, top.mgl

    def field(_: float, y: Any) -> list[float]:
        ex, ey, ez, Lx, Ly, Lz = y.tolist()
        wx, wy, wz = inverse * Lx, inverse * Ly, inverse * Lz
        return [wy * ez - wz * ey, wz * ex - wx * ez, wx * ey - wy * ex, -mgl * ey, mgl * ex, 0.0]

    return field


@functools.lru_cache(maxsize=16)
def compiled_field(top: SymmetricTop) -> Callable[[float, Any], Array]:
    """f(t, y) compiled, returning a new array."""
    inverse, mgl = 1.0 / top.I1, top.mgl

    @njit("float64[::1](float64, float64[:])")  # Radau hands over columns
    def field(_, y):
        f = np.empty(6)
        wx, wy, wz = inverse * y[3], inverse * y[4], inverse * y[5]
        f[0], f[1], f[2] = wy * y[2] - wz * y[1], wz * y[0] - wx * y[2], wx * y[1] - wy * y[0]
        f[3], f[4], f[5] = -mgl * y[1], mgl * y[0], 0.0
        return f

    return field


@functools.lru_cache(maxsize=16)
def filling_field(top: SymmetricTop) -> Callable[[float, Any, Any], None]:
    """f(t, y, out) compiled, writing into an array."""
    inverse, mgl = 1.0 / top.I1, top.mgl

    @njit  # compiled at the first call: CVODE's y is read-only
    def field(_, y, f):
        wx, wy, wz = inverse * y[3], inverse * y[4], inverse * y[5]
        f[0], f[1], f[2] = wy * y[2] - wz * y[1], wz * y[0] - wx * y[2], wx * y[1] - wy * y[0]
        f[3], f[4], f[5] = -mgl * y[1], mgl * y[0], 0.0

    return field


@functools.lru_cache(maxsize=16)
def python_angles(top: SymmetricTop) -> Callable[[float, Any], tuple[float, ...]]:
    """f(t, y) on (theta, phi, psi, theta', phi', psi') in plain Python on floats."""
    numbers = top.I1, top.I3, top.mgl

    def field(_: float, y: Any) -> tuple[float, ...]:
        theta, _, _, theta_dot, phi_dot, psi_dot = y.tolist()
        return (theta_dot, phi_dot, psi_dot, *accelerations(*numbers, theta, theta_dot, phi_dot, psi_dot))

    return field


@functools.lru_cache(maxsize=16)
def compiled_angles(top: SymmetricTop) -> Callable[[float, Any], Array]:
    """The same compiled, returning a new array."""
    I1, I3, mgl = top.I1, top.I3, top.mgl

    @njit("float64[::1](float64, float64[:])")
    def field(_, y):
        f = np.empty(6)
        f[0], f[1], f[2] = y[3], y[4], y[5]
        f[3], f[4], f[5] = accelerations(I1, I3, mgl, y[0], y[3], y[4], y[5])
        return f

    return field
