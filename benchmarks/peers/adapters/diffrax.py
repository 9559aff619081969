"""diffrax: Tsit5, Dopri5 and Dopri8 on JAX, the whole solve jitted, in double precision on the processor.

Six equations on (e, L); PIDController with rtol = atol = the tolerance and no other change; samples by dense output.
Compiled once for each solver and number of samples, outside of what is timed; tolerance and top are arguments. The
public call hands over NumPy arrays; the inner loop has arrays that JAX holds and asks for the last state alone. A
call starts with tens of microseconds of dispatch; diffrax is made for many tops at once (vmap), of which
`benchmarks.peers.together` asks.
"""

from typing import Any

import numpy as np

from benchmarks.peers import common
from benchmarks.peers.common import Inner, Library, Motion
from symtop.methods.framework.plan import Plan
from symtop.methods.framework.registry import Integrator
from symtop.model.top import Angles, SymmetricTop

PACKAGE = "diffrax"
LANGUAGE = "JAX, compiled with the solver"
MOST_STEPS = 2_000_000
SOLVERS = {"Tsit5": (5, 7), "Dopri5": (5, 7), "Dopri8": (8, 14)}  # order, stages


def _solve(diffrax: Any, jax: Any, method: Any, *, sampled: bool) -> Any:
    jnp = jax.numpy

    def field(_: Any, y: Any, par: Any) -> Any:
        inverse, mgl = par
        wx, wy, wz = inverse * y[3], inverse * y[4], inverse * y[5]
        return jnp.stack(
            [wy * y[2] - wz * y[1], wz * y[0] - wx * y[2], wx * y[1] - wy * y[0], -mgl * y[1], mgl * y[0], 0.0 * y[5]]
        )

    def run(y0: Any, times: Any, par: Any, tolerance: Any) -> Any:
        solution = diffrax.diffeqsolve(
            diffrax.ODETerm(field),
            method,
            t0=0.0,
            t1=times[-1],
            dt0=None,
            y0=y0,
            args=par,
            saveat=diffrax.SaveAt(ts=times) if sampled else diffrax.SaveAt(t1=True),
            stepsize_controller=diffrax.PIDController(rtol=tolerance, atol=tolerance),
            adjoint=diffrax.ForwardMode(),
            max_steps=MOST_STEPS,
            throw=False,
        )
        return solution.ys, solution.stats["num_steps"]

    return run


def many_tops(name: str) -> Any:
    """A pair under vmap, compiled: ``(states, times, (1/I1, mgl), tolerance)`` to last states and steps of each top."""
    import diffrax
    import jax

    jax.config.update("jax_enable_x64", True)
    run = _solve(diffrax, jax, getattr(diffrax, name)(), sampled=False)
    return jax.jit(jax.vmap(run, in_axes=(0, None, 0, None)))


class Diffrax(Library):
    """One explicit pair."""

    def __init__(self, diffrax: Any, jax: Any, name: str, stages: int) -> None:
        method = getattr(diffrax, name)()
        self.jax, self.stages = jax, stages
        self.sampled = jax.jit(_solve(diffrax, jax, method, sampled=True))
        self.bare = jax.jit(_solve(diffrax, jax, method, sampled=False))

    def public(self, top: SymmetricTop, start: Angles, plan: Plan) -> Motion:
        """One jitted call with the sample times."""
        state, par = common.start_of(top, start), (1.0 / top.I1, top.mgl)
        states, steps = self.sampled(state, plan.times, par, plan.tolerance)
        return Motion(np.asarray(states), int(steps), int(steps) * (self.stages - 1))

    def inner(self, top: SymmetricTop, start: Angles, plan: Plan) -> Inner:
        """One jitted call for the last state."""
        put = self.jax.numpy.asarray
        arguments = (
            put(common.start_of(top, start)),
            put([0.0, plan.horizon]),
            (put(1.0 / top.I1), put(top.mgl)),
            put(plan.tolerance),
        )

        def call() -> Any:
            return self.bare(*arguments)[0].block_until_ready()

        return Inner(call, lambda states: np.asarray(states)[-1])


def peers() -> list[tuple[Integrator, str]]:
    """Three explicit pairs."""
    import diffrax
    import jax

    jax.config.update("jax_enable_x64", True)
    return [
        (
            common.record(
                f"diffrax-{name.lower()}",
                Diffrax(diffrax, jax, name, stages),
                f"diffeqsolve under jit; {common.SAME}",
                order=order,
            ),
            LANGUAGE,
        )
        for name, (order, stages) in SOLVERS.items()
    ]
