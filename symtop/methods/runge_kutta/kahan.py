"""Kahan's method on (e, L), whose equations are quadratic: linearly implicit, one 3 x 3 system a step.

    e_1 - e_0 = (h/2 I1)(L_0 x e_1 + L_1 x e_0),      L_1 - L_0 = (h mgl/2) k x (e_0 + e_1)

Each product of two variables becomes the mean of both with one factor at the start and one at the end. L_1 follows from
e_1, and with d = e_1 - e_0, g = h/2 I1 and c = h mgl/2

    (1 - g c e_z) d - g L_0 x d + g c k (e_0.d) = 2 g L_0 x e_0 + 2 g c (e_z e_0 - k |e_0|^2).

No iteration, whatever the step; the matrix is singular only where g is so large that a step is a good part of a turn.
It is a Runge-Kutta method, y_1 = y_0 + h (2 f((y_0 + y_1)/2) - f(y_0)/2 - f(y_1)/2), on quadratic fields, and the
discretisation of Hirota and Kimura, which is integrable for this top. It is symmetric, of order 2, and birational: the
inverse is the step of -h. p_phi is linear and kept. The energy, |e| and p_psi are not: they wobble by O(h^2) and do
not drift, because the map keeps functions that differ from them by as much. It preserves no Lie-Poisson bracket. The
attitude is a frame (e, L, a), a quadratic system too, which is made orthonormal at samples.
Sources: Kahan, unpublished lecture notes (1993); Petrera, Pfadler, Suris, Regul. Chaotic Dyn. 16 (2011) 245; Celledoni,
McLachlan, Owren, Quispel, J. Phys. A 46 (2013) 025201.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from symtop.core.jit import register_jitable
from symtop.methods.framework import space
from symtop.methods.framework.lanes import W, one_loop
from symtop.methods.framework.loop import FixedStep, Loop, no_carry
from symtop.methods.framework.plan import OUTCOMES, Run
from symtop.methods.framework.preparation import Presentation
from symtop.methods.framework.registry import Integrator
from symtop.methods.framework.space import finite_outcome, frame_to_attitude, observe_axis, on_axis, on_frame
from symtop.methods.vectors import cross, dot, plus, scaled, solve3
from symtop.model.top import Angles, SymmetricTop

H_AT = len(space.SpaceTop._fields)  # the step, in the table of a block
frame_sample = frame_to_attitude.sample


@register_jitable
def _image(g: float, c: float, e: Any, L: Any, d: Any) -> Any:
    """The matrix times d."""
    x, y, z = plus(scaled(1.0 - g * c * e[2], d), -g, cross(L, d))
    return x, y, z + g * c * dot(e, d)


@register_jitable
def _axis_step(par: Any, e: Any, L: Any, h: float) -> Any:
    """The increments of e and L."""
    g, c = 0.5 * h / par.I1, 0.5 * h * par.mgl
    x, y, z = plus(scaled(2.0 * g, cross(L, e)), 2.0 * g * c * e[2], e)
    right = x, y, z - 2.0 * g * c * dot(e, e)
    first = _image(g, c, e, L, (1.0, 0.0, 0.0))
    second = _image(g, c, e, L, (0.0, 1.0, 0.0))
    third = _image(g, c, e, L, (0.0, 0.0, 1.0))
    d = solve3(first, second, third, right)
    return d, (-c * (2.0 * e[1] + d[1]), c * (2.0 * e[0] + d[0]), 0.0)


def _increment_axis(par: Any, rule: Any, state: Any, carry: Any, h: float) -> Any:
    d, D = _axis_step(par, state[:3], state[3:], h)
    return (*d, *D), carry, 1, finite_outcome(d[0] + d[1] + d[2])


def _increment_frame(par: Any, rule: Any, state: Any, carry: Any, h: float) -> Any:
    """a is turned by the same rule, with L known at both ends."""
    L, a = state[3:6], state[6:]
    d, D = _axis_step(par, state[:3], L, h)
    half = scaled(0.5 * h / par.I1, L)
    right = plus(scaled(2.0, cross(half, a)), 0.5 * h / par.I1, cross(D, a))
    numerator = plus(plus(right, 1.0, cross(half, right)), dot(half, right), half)
    b = scaled(1.0 / (1.0 + dot(half, half)), numerator)
    return (*d, *D, *b), carry, 1, finite_outcome(d[0] + d[1] + d[2] + b[0] + b[1] + b[2])


def _observe_frame(par: Any, rule: Any, before: Any, dstate: Any, h: float) -> Any:
    """The axis of the attitude that is shown has the length one."""
    p_phi, p_psi = observe_axis(par, rule, before, dstate, h)
    e = before[0] + dstate[0], before[1] + dstate[1], before[2] + dstate[2]
    return p_phi, p_psi / math.sqrt(dot(e, e))


def _present_attitude(par: Any, t: float, y: Any) -> Any:
    """(q, L) of the frame with e made a unit vector and a one across it."""
    e, a = (y[0], y[1], y[2]), (y[6], y[7], y[8])
    e = scaled(1.0 / math.sqrt(dot(e, e)), e)
    a = plus(a, -dot(a, e), e)
    a = scaled(1.0 / math.sqrt(dot(a, a)), a)
    return frame_sample(par, t, (*e, y[3], y[4], y[5], *a))


def _loop(increment: Callable[..., Any], observe: Callable[..., Any], dimension: int) -> Loop:
    """The loop around a step that has no branch, for one and in lanes, whose table holds h."""
    register_jitable(increment)

    def lay(par, rule, h, numbers):  # type: ignore[no-untyped-def]
        numbers[0] = h

    def advance(par, state, carry, table, j):  # type: ignore[no-untyped-def]
        dstate, carry, _, outcome = increment(par, 0.0, state, carry, table[H_AT * W + j])
        return dstate, carry, outcome

    lanes = one_loop(advance, lay, 1, top=space.SpaceTop, dimension=dimension)
    return Loop(no_carry, increment, observe, lanes=lambda _: lanes)


march_axis, march_frame = _loop(_increment_axis, observe_axis, 6), _loop(_increment_frame, _observe_frame, 9)
_attitude = Presentation(_present_attitude, 7)


class Onward(FixedStep):
    """A solver whose steps can have different lengths: as |e| is not kept, the end of a step is no valid start."""

    def onward(self, top: SymmetricTop, start: Angles, lengths: Sequence[float]) -> Run:
        """One step of each length, each from where the last one ended."""
        par, rule, state = self.setup(top, start, lengths[0])
        for h in lengths:
            march = self.loop(par, rule, state, h, np.array([1]))
            state = tuple(march.states[0].tolist())
        samples = march.states if self.present is None else self.present(par, np.array([sum(lengths)]), march.states)
        p_phi, p_psi = march.momenta.T
        return Run(samples, p_phi, p_psi, len(lengths), len(lengths), 0, OUTCOMES[march.outcome], sum(lengths))


def built_in() -> list[Integrator]:
    """`kahan`."""
    return [
        Integrator(
            name="kahan", family="runge-kutta", order=2, explicit=False, symplectic=False, symmetric=True,
            summary="Kahan's method on the quadratic equations of the axis: linearly implicit, no iteration",
            conserves=frozenset({"p_phi"}), energy_error="bounded", needs="expression", general=True,
            solvers={
                "axis": Onward(march_axis, (1.0,), on_axis, 1, implicit=True),
                "attitude": Onward(march_frame, (1.0,), on_frame, 1, implicit=True, present=_attitude),
            },
            reference="petrera-pfadler-suris-2011 celledoni-mclachlan-owren-quispel-2013",
        )
    ]  # fmt: skip
