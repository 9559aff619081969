"""What the adapters share: the top's equations on (e, L), in plain Python and compiled, and the record of a peer.

    e' = L x e / I1,   L' = mgl z x e        (six variables, quadratic, no pole anywhere)

This is the form that suits a general solver best: no sine, no singularity, twelve multiplications. A library that is
handed equations gets these; one that models bodies gets the body. The compiled right-hand sides freeze the numbers of
the top, as a user who wants speed would.
"""

import functools
from collections.abc import Callable
from typing import Any

import numpy as np
from numba import carray, cfunc, njit, types

from symtop.methods.plan import Plan, Run
from symtop.methods.registry import Array, Integrator, Solver
from symtop.methods.space import on_axis
from symtop.model.top import Angles, SymmetricTop

ON_AXIS = "six equations on (e, L)"
SAME = "rtol = atol = the tolerance"


def start_of(top: SymmetricTop, start: Angles) -> Array:
    """(e, L) of a start."""
    return np.array(on_axis(top, start)[1])


def run_of(plan: Plan, states: Any, steps: int, evaluations: int) -> Run:
    """A Run in the axis chart; samples that are missing or not finite are a failure."""
    shown = np.full((plan.times.size, 6), np.nan)
    count = min(len(states), plan.times.size)
    shown[:count] = np.asarray(states)[:count]
    good = np.isfinite(shown).all(axis=1)
    outcome = "ok" if good.all() else "not_finite"
    reached = plan.horizon if good.all() else float(plan.times[good][-1]) if good.any() else 0.0
    p_psi = np.sum(shown[:, :3] * shown[:, 3:], axis=1)
    return Run(shown, shown[:, 5].copy(), p_psi, int(steps), int(evaluations), 0, outcome, reached)


def with_start(plan: Plan) -> Array:
    """The sample times, with the start in front if it is not asked for."""
    return plan.times if plan.times[0] == 0.0 else np.concatenate([[0.0], plan.times])


def peer(
    name: str, solve: Solver, summary: str, *, implementation: str, control: str = "tolerance",
    order: int | None = None, least: float = 1e-15, chart: str = "axis",
) -> Integrator:  # fmt: skip
    """An outside solver in the same record as our own methods, so that one code measures and times both."""
    return Integrator(
        name=name,
        family="other",
        summary=summary,
        solvers={chart: solve},
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
def c_field(top: SymmetricTop) -> Any:
    """f as a C function ``void(void *, double *out, const double *y, double t)``; keep it alive while it is in use."""
    inverse, mgl = 1.0 / top.I1, top.mgl

    @cfunc(types.void(types.voidptr, types.CPointer(types.float64), types.CPointer(types.float64), types.float64))
    def field(_, out, state, t):  # noqa: ARG001
        f, y = carray(out, 6), carray(state, 6)
        wx, wy, wz = inverse * y[3], inverse * y[4], inverse * y[5]
        f[0], f[1], f[2] = wy * y[2] - wz * y[1], wz * y[0] - wx * y[2], wx * y[1] - wy * y[0]
        f[3], f[4], f[5] = -mgl * y[1], mgl * y[0], 0.0

    return field
