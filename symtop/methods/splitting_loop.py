"""The one composition loop that all splitting kernels share, whatever their chart.

    step = kick(b_0 h) drift(a_1 h) kick(b_1 h) ... drift(a_n h) kick(b_n h)

A kick with a force gradient is the flow of ``b V + c h^2 {V, {V, T}}``: where that bracket depends on position alone it
costs a multiplication and lets all other coefficients stay positive at order 4 (Chin, Phys. Lett. A 226 (1997) 344).
A force is evaluated only where it is kicked with, and the one at the end of a step serves the start of the next, so a
kick-first table with n drifts costs n forces and a drift-first one n - 1, but n drifts: its last drift and the first of
the next step are not merged.

The kernels see no h: `stages` multiplies the tables out before a run, each row closed to the product that its sum
stands for. A sum that is wrong by one rounding is a clock that runs fast by 1e-16 in every step.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

from symtop.base.compiled import register_jitable, set_item
from symtop.methods.coefficients import exact_sum


class Composition(NamedTuple):
    """The coefficients of a splitting method, in units of the step."""

    drift: tuple[float, ...]  # a_1 .. a_n
    kick: tuple[float, ...]  # b_0 .. b_n
    gradient: tuple[float, ...]  # c_0 .. c_n
    forces: int  # a step

    def stages(self, drift: float, kick: float, bend: float = 0.0, turn: int = 0, boost: float = 0.0) -> "Stages":
        """The coefficients times what a whole step drifts and kicks by."""
        return Stages(
            exact_sum([a * drift for a in self.drift], drift),
            exact_sum([b * kick for b in self.kick], kick),
            tuple(c * bend for c in self.gradient), self.forces, turn, boost,
        )  # fmt: skip


class Stages(NamedTuple):
    """What one run of a kernel drifts and kicks by; a kernel compiles once for each length."""

    drift: tuple[float, ...]
    kick: tuple[float, ...]
    bend: tuple[float, ...]
    forces: int
    turn: int  # which rotation a drift is
    boost: float  # parameter of the processor


def closed(drift: Sequence[float], kick: Sequence[float], gradient: Sequence[float]) -> Composition:
    """A composition whose sums are exactly 1, and what it costs."""
    forces = sum(b != 0.0 for b in kick) - (kick[0] != 0.0 and kick[-1] != 0.0)
    return Composition(exact_sum(drift), exact_sum(kick), tuple(gradient), forces)


@register_jitable
def compose(force: Any, kick: Any, drift: Any, par: Any, rule: Any, state: Any, at_start: Any) -> Any:
    """Increment of one step and the force at its end. A force nobody kicks with is not evaluated."""
    step = state
    for i in range(len(state)):
        step = set_item(step, i, 0.0)
    now = at_start
    n = len(rule.drift)
    for i in range(n):
        if rule.kick[i] != 0.0:
            step = kick(par, now, step, rule.kick[i], rule.bend[i])
        step = drift(rule, state, step, rule.drift[i])
        if rule.kick[i + 1] != 0.0:
            now = force(par, state, step)
    if rule.kick[n] != 0.0:
        step = kick(par, now, step, rule.kick[n], rule.bend[n])
    elif rule.kick[0] != 0.0:  # what the next step kicks with first
        now = force(par, state, step)
    return step, now
