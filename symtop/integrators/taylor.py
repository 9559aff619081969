"""Taylor series of the space-frame equations by heyoka, without poles.

    axis:      e' = L x e / I1,  L' = mgl k x e                      six variables, every term quadratic
    attitude:  q' = (L q / I1 + (1/I3 - 1/I1) p_psi q k)/2,  L' as above with e = q k q*    seven variables

All constants, |e| = 1, L.e = p_psi, L_z = p_phi and the energy, are linear or quadratic in (e, L). The axis chart is
three times cheaper than the attitude chart and is used whenever nobody asks for the spin angle. The order follows
from the tolerance (about 20 in double); the step from the size of the series' last terms. Asking for a
hundredth of the rounding unit removes the truncation bias that makes energy drift linearly at tolerance eps.
A Taylor step of order n computes n derivatives of the state; `force_evaluations` counts them.
Source: Jorba and Zou, Experimental Mathematics 14 (2005) 99; Biscani and Izzo, MNRAS 504 (2021) 2614.
"""

import functools
from collections.abc import Callable
from typing import Any

import numpy as np

from symtop import charts
from symtop.checks import SymtopError
from symtop.integrators.registry import Array, Integrator, Plan, Run
from symtop.top import Angles, SymmetricTop

EPSILON = float(np.finfo(np.float64).eps)


def equations(chart: str) -> list[Any]:
    """heyoka's system of a chart; par[0] = 1/I1, par[1] = mgl, par[2] = p_psi (1/I3 - 1/I1)."""
    import heyoka as hy  # noqa: PLC0415  (Linux only)

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


@functools.lru_cache(maxsize=32)
def _stepper(chart: str, tolerance: float) -> Any:
    """A compiled heyoka integrator; building one costs 0.1 s the first time, then milliseconds from its disk cache."""
    import heyoka as hy  # noqa: PLC0415

    system = equations(chart)
    return hy.taylor_adaptive(system, [0.0] * len(system), tol=tolerance)


def solver(chart: str) -> Callable[[SymmetricTop, Angles, Plan], Run]:
    """A solver of the registry in one chart."""

    def solve(top: SymmetricTop, start: Angles, plan: Plan) -> Run:
        stepper = _stepper(chart, plan.tolerance)
        stepper.time = 0.0
        stepper.state[:] = charts.space_state(chart, top, start)
        spin = top.momenta(start).p_psi
        numbers = (1.0 / top.I1, top.mgl, spin * (1.0 / top.I3 - 1.0 / top.I1))
        stepper.pars[:] = numbers[: stepper.pars.size]  # the axis chart does not need the last one
        grid = plan.times if plan.times[0] == 0.0 else np.concatenate([[0.0], plan.times])
        outcome, _, _, steps, *_, states = stepper.propagate_grid(grid)
        states = states[grid.size - plan.times.size :]
        good = np.isfinite(states).all(axis=1)
        word = "ok" if good.all() and "time_limit" in str(outcome) else "not_finite"
        reached = plan.horizon if word == "ok" else float(plan.times[good][-1]) if good.any() else 0.0
        p_phi, p_psi = space_momenta(chart, states)
        return Run(states, p_phi, p_psi, int(steps), int(steps) * int(stepper.order), 0, word, reached)

    return solve


def space_momenta(chart: str, states: Array) -> tuple[Array, Array]:
    """p_phi = L_z and p_psi = L.e of states in a space-frame chart."""
    if chart == "axis":
        axis, momentum = states[:, :3], states[:, 3:]
    else:
        axis, momentum = charts.axis_from_quaternion(states[:, :4]), states[:, 4:]
    return momentum[:, 2].copy(), np.sum(momentum * axis, axis=-1)


def built_in() -> list[Integrator]:
    """heyoka's integrator, where heyoka is installed."""
    try:
        import heyoka  # noqa: F401, PLC0415
    except ImportError:
        return [_absent()]
    return [_entry({"axis": solver("axis"), "attitude": solver("attitude")})]


def _absent() -> Integrator:
    def refuse(top: SymmetricTop, start: Angles, plan: Plan) -> Run:
        msg = "taylor needs the package heyoka, which has wheels for Linux only (elsewhere: conda-forge)"
        raise SymtopError(msg)

    return _entry({"attitude": refuse})


def _entry(solvers: Any) -> Integrator:
    return Integrator(
        name="taylor",
        family="taylor",
        summary="heyoka's Taylor series on the space-frame equations, without poles",
        solvers=solvers,
        knob="tolerance",
        explicit=True,
        symplectic=False,
        symmetric=False,
        conserves=frozenset(),
        least_tolerance=EPSILON / 1000.0,
        default_tolerance=EPSILON / 100.0,
        reference="biscani-izzo-2021",
    )
