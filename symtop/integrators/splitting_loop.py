"""The one composition loop that all splitting kernels share, whatever their chart.

    step = kick(b_0 h) drift(a_1 h) kick(b_1 h) ... drift(a_n h) kick(b_n h)

A kick with a force gradient is the flow of ``b V + c h^2 {V, {V, T}}``: where that bracket depends on position alone it
costs a multiplication and lets all other coefficients stay positive at order 4 (Chin, Phys. Lett. A 226 (1997) 344).
A force is evaluated only where it is kicked with, and the one at the end of a step serves the start of the next, so a
kick-first table with n drifts costs n forces and a drift-first one n - 1, but n drifts: its last drift and the first of
the next step are not merged.
"""

from typing import Any, NamedTuple

from numba.cpython.unsafe.tuple import tuple_setitem

from symtop.integrators.compiled import register_jitable


class Composition(NamedTuple):
    """The numbers of one splitting method, in units of the step; a kernel compiles once for each length."""

    drift: tuple[float, ...]  # a_1 .. a_n
    kick: tuple[float, ...]  # b_0 .. b_n
    gradient: tuple[float, ...]  # c_0 .. c_n
    forces: int  # a step
    cayley: float = 0.0  # tau of a Cayley drift in units of h/2 I1; zero is the exact rotation
    processor: float = 0.0  # k of the processor exp(k h^2 (mgl/I1) L.(e x z))


@register_jitable
def compose(force: Any, kick: Any, drift: Any, par: Any, rule: Any, state: Any, at_start: Any, h: float) -> Any:
    """Increment of one step and the force at its end. A force nobody kicks with is not evaluated."""
    step = state
    for i in range(len(state)):
        step = tuple_setitem(step, i, 0.0)
    now = at_start
    cube = h * h * h
    stages = len(rule.drift)
    for i in range(stages):
        if rule.kick[i] != 0.0:
            step = kick(par, now, step, rule.kick[i] * h, rule.gradient[i] * cube)
        step = drift(par, rule, state, step, rule.drift[i] * h)
        if rule.kick[i + 1] != 0.0:
            now = force(par, state, step)
    if rule.kick[stages] != 0.0:
        step = kick(par, now, step, rule.kick[stages] * h, rule.gradient[stages] * cube)
    return step, now
