"""diffrax: Tsit5, Dopri5 and Dopri8 on JAX, the whole solve jitted, in double precision on the processor.

Six equations on (e, L); PIDController with rtol = atol = the tolerance and no other change; samples by dense output.
Compiled once for each solver and number of samples, outside of what is timed; tolerance and top are arguments.
"""

from typing import Any

import numpy as np

from benchmarks.peers.common import ON_AXIS, SAME, peer, run_of, start_of
from symtop.methods.plan import Plan, Run
from symtop.methods.registry import Integrator, Solver
from symtop.model.top import Angles, SymmetricTop

PACKAGE = "diffrax"
MOST_STEPS = 2_000_000
SOLVERS = {"Tsit5": (5, 7), "Dopri5": (5, 7), "Dopri8": (8, 14)}  # order, stages


def _compiled(diffrax: Any, jax: Any, method: Any) -> Any:
    jnp = jax.numpy

    def field(_: Any, y: Any, par: Any) -> Any:
        inverse, mgl = par
        wx, wy, wz = inverse * y[3], inverse * y[4], inverse * y[5]
        return jnp.stack(
            [wy * y[2] - wz * y[1], wz * y[0] - wx * y[2], wx * y[1] - wy * y[0], -mgl * y[1], mgl * y[0], 0.0 * y[5]]
        )

    def run(y0: Any, times: Any, par: Any, tolerance: Any) -> Any:
        found = diffrax.diffeqsolve(
            diffrax.ODETerm(field),
            method,
            t0=0.0,
            t1=times[-1],
            dt0=None,
            y0=y0,
            args=par,
            saveat=diffrax.SaveAt(ts=times),
            stepsize_controller=diffrax.PIDController(rtol=tolerance, atol=tolerance),
            adjoint=diffrax.ForwardMode(),
            max_steps=MOST_STEPS,
            throw=False,
        )
        return found.ys, found.stats["num_steps"]

    return jax.jit(run)


def _solver(diffrax: Any, jax: Any, name: str, stages: int) -> Solver:
    run = _compiled(diffrax, jax, getattr(diffrax, name)())

    def solve(top: SymmetricTop, start: Angles, plan: Plan) -> Run:
        states, steps = run(start_of(top, start), plan.times, (1.0 / top.I1, top.mgl), plan.tolerance)
        return run_of(plan, np.asarray(states), int(steps), int(steps) * (stages - 1))

    return solve


def peers() -> list[Integrator]:
    """Three explicit pairs."""
    import diffrax
    import jax

    jax.config.update("jax_enable_x64", True)
    return [
        peer(
            f"diffrax-{name.lower()}",
            _solver(diffrax, jax, name, stages),
            f"{ON_AXIS}, jitted; {SAME}",
            implementation="compiled",
            order=order,
        )
        for name, (order, stages) in SOLVERS.items()
    ]
