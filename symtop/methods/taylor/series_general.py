"""Taylor series of the unreduced space-frame equations by recurrence: `series-general`, `series-general-adaptive`.

The equations of (e, L) and of (q, L) are quadratic, f(y) = Q(y, y) + l(y), so that the coefficients of the solution
follow from each other by Cauchy products:

    y(t + tau) = sum_n c_n tau^n,    c_0 = y,    (n + 1) c_{n+1} = sum_{j<=n} Q(c_j, c_{n-j}) + l(c_n)

This is what a general Taylor code does: six products of series on the axis, sixteen on the attitude, in loops. It uses
no second-order form, no vector registers, and no constant of the motion but L.e, a parameter of (q, L) as in `taylor`.
A comparison with `series` shows the gain by those, one with `taylor` the gain by heyoka on the same equations.

*With a fixed step* the order is 16. *With a tolerance* eps it is N = ceil(1 - log(eps)/2), and the step is

    h = exp(-2 - 0.7/(N - 1)) min((s/|c_{N-1}|)^(1/(N-1)), (s/|c_N|)^(1/N)),    s = max(1, |y|)

with the largest components as norms, as `taylor` has it: both take the same steps, and none is rejected. Momenta above
128 are counted in another unit (`symtop.model.top.lightened`), as one norm weighs them and e or q. A sample is the
polynomial. An order counts as an evaluation of f. Explicit, without poles; neither symplectic nor symmetric; L_z
does not move.
Source: Jorba, Zou, Experimental Mathematics 14 (2005) 99.
"""

import functools
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from symtop.core.jit import register_jitable, set_item
from symtop.core.jit_functions import fused
from symtop.core.numbers import EPSILON
from symtop.methods.framework import equations
from symtop.methods.framework.body import torque
from symtop.methods.framework.loop import FixedStep, Loop
from symtop.methods.framework.plan import OK, STEP_TOO_SMALL
from symtop.methods.framework.registry import Integrator
from symtop.methods.framework.space import field_twisted, on_attitude
from symtop.methods.runge_kutta.explicit import row_of, store
from symtop.methods.runge_kutta.pairs import Method, nothing_more, solver
from symtop.methods.vectors import summed
from symtop.model.charts import BODY

ORDER = 16  # with a fixed step
HIGHEST_ORDER = 24  # of a tolerance: N = 21 at the default, 23 at the least


@register_jitable
def _axis_products(par: Any, total: Any, a: Any, b: Any) -> Any:
    """Add L x e, L of `a` and e of `b`, one product after the other."""
    x, y, z = total
    x, y, z = fused(a[4], b[2], x), fused(a[5], b[0], y), fused(a[3], b[1], z)
    return fused(-a[5], b[1], x), fused(-a[3], b[2], y), fused(-a[4], b[0], z)


@register_jitable
def _axis_slope(par: Any, total: Any, y: Any) -> Any:
    inverse = 1.0 / par.I1
    return inverse * total[0], inverse * total[1], inverse * total[2], -par.mgl * y[1], par.mgl * y[0], 0.0


@register_jitable
def _attitude_products(par: Any, total: Any, a: Any, b: Any) -> Any:
    """Add L q, L of `a` and q of `b`, and half of e_x and e_y."""
    w, x, y, z, right, back = total
    w, x, y, z = fused(-a[4], b[1], w), fused(a[4], b[0], x), fused(a[5], b[0], y), fused(a[6], b[0], z)
    w, x, y, z = fused(-a[5], b[2], w), fused(a[5], b[3], x), fused(a[6], b[1], y), fused(a[4], b[2], z)
    w, x, y, z = fused(-a[6], b[3], w), fused(-a[6], b[2], x), fused(-a[4], b[3], y), fused(-a[5], b[1], z)
    right, back = fused(a[1], b[3], right), fused(a[2], b[3], back)
    return w, x, y, z, fused(a[0], b[2], right), fused(-a[0], b[1], back)


@register_jitable
def _attitude_slope(par: Any, total: Any, y: Any) -> Any:
    half, turn, pull = 0.5 / par.I1, 0.5 * par.twist, 2.0 * par.mgl
    w, x = half * total[0] - turn * y[3], half * total[1] + turn * y[2]
    return w, x, half * total[2] - turn * y[1], half * total[3] + turn * y[0], -pull * total[5], pull * total[4], 0.0


class Quadratic(NamedTuple):
    """A chart's equations as `pairs.loop` takes a method; row 0 of the memory has N, and c_0 .. c_N follow."""

    products: Callable[..., Any]
    slope: Callable[..., Any]
    sums: tuple[float, ...]

    def series(self) -> Callable[..., None]:
        """``(par, state, c, order)`` fills in the rows of c, from the second on."""
        products, slope, zeros = self

        @register_jitable
        def fill(par, state, c, order):  # type: ignore[no-untyped-def]
            store(c, 1, state)
            for n in range(order):
                total = zeros
                for j in range(n + 1):
                    total = products(par, total, row_of(c, 1 + j, state), row_of(c, 1 + n - j, state))
                rate = slope(par, total, row_of(c, 1 + n, state))
                for m in range(len(state)):
                    c[2 + n, m] = rate[m] / (n + 1)

        return fill

    def __call__(self, _: Callable[..., Any]) -> Method:
        """Steps and samples of an order that depends on the tolerance."""
        fill = self.series()

        @register_jitable
        def advance(par, state, c, tolerance, t, step, end):  # type: ignore[no-untyped-def]
            order = math.ceil(1.0 - 0.5 * math.log(tolerance))
            fill(par, state, c, order)
            scale, last, earlier = 1.0, 0.0, 0.0
            for m in range(len(state)):
                scale, last = max(scale, abs(state[m])), max(last, abs(c[1 + order, m]))
                earlier = max(earlier, abs(c[order, m]))
            h = min((scale / earlier) ** (1.0 / (order - 1)), (scale / last) ** (1.0 / order))
            after = min(t + h * math.exp(-2.0 - 0.7 / (order - 1)), end)
            if not after > t:
                return state, t, step, order, STEP_TOO_SMALL
            c[0, 0] = order
            return summed(state, tail(state, c, order, after - t)), after, step, order, OK

        @register_jitable
        def sample(par, state, new, c, h, x):  # type: ignore[no-untyped-def]
            return summed(state, tail(state, c, int(c[0, 0]), x * h))

        return Method(advance, nothing_more, sample, 0, -0.5)


@register_jitable
def tail(state: Any, c: Any, order: int, h: float) -> Any:
    """sum_{n>0} c_n h^n, the last first."""
    total = row_of(c, 1 + order, state)
    for n in range(order - 1, 0, -1):
        for m in range(len(state)):
            total = set_item(total, m, fused(h, total[m], c[1 + n, m]))
    for m in range(len(state)):
        total = set_item(total, m, h * total[m])
    return total


@register_jitable
def _body_products(par: Any, total: Any, a: Any, b: Any) -> Any:
    """Add q omega, two q's for Gamma, and M x omega; q and M of `a`, q and omega of `b`.

    One rounded omega turns q and M, so that its rounding, which is biased where 1/I has a short period as 1/1.2 has,
    leaves |q| and L_z alone, and the energy but for a function of M. (1/I3 - 1/I2) M2 M3 in its place drifts.
    """
    w, x, y1, z, g1, g2, g3, t1, t2, t3 = total
    w1, w2, w3 = par.a1 * b[4], par.a2 * b[5], par.a3 * b[6]
    w = fused(-a[1], w1, fused(-a[2], w2, fused(-a[3], w3, w)))
    x = fused(a[0], w1, fused(a[2], w3, fused(-a[3], w2, x)))
    y1 = fused(a[0], w2, fused(-a[1], w3, fused(a[3], w1, y1)))
    z = fused(a[0], w3, fused(a[1], w2, fused(-a[2], w1, z)))
    g1 = fused(-a[0], b[2], fused(a[1], b[3], g1))
    g2 = fused(a[0], b[1], fused(a[2], b[3], g2))
    g3 = fused(-a[1], b[1], fused(-a[2], b[2], fused(a[3], b[3], fused(a[0], b[0], g3))))
    t1 = fused(a[5], w3, fused(-a[6], w2, t1))
    t2 = fused(a[6], w1, fused(-a[4], w3, t2))
    return w, x, y1, z, g1, g2, g3, t1, t2, fused(a[4], w2, fused(-a[5], w1, t3))


@register_jitable
def _body_slope(par: Any, total: Any, y: Any) -> Any:
    w, x, y1, z, g1, g2, g3, t1, t2, t3 = total
    pull1, pull2, pull3 = torque(par, 2.0 * g1, 2.0 * g2, g3)
    return 0.5 * w, 0.5 * x, 0.5 * y1, 0.5 * z, t1 + pull1, t2 + pull2, t3 + pull3


CHARTS = {
    "axis": Quadratic(_axis_products, _axis_slope, (0.0,) * 3),
    "attitude": Quadratic(_attitude_products, _attitude_slope, (0.0,) * 6),
    BODY: Quadratic(_body_products, _body_slope, (0.0,) * 10),
}
TWISTED = equations.FORMS["attitude"]._replace(field=field_twisted, prepare=on_attitude)
FORMS = equations.FORMS | {"attitude": TWISTED}


@functools.cache
def loop(chart: str) -> Loop:
    """The loop with fixed steps in one chart."""
    form, fill = FORMS[chart], CHARTS[chart].series()
    ended_at = form.ended

    def begin(par, rule, state, h):  # type: ignore[no-untyped-def]
        return np.empty((ORDER + 2, len(state)))

    def increment(par, rule, state, carry, h):  # type: ignore[no-untyped-def]
        fill(par, state, carry, ORDER)
        step = tail(state, carry, ORDER, h)
        return step, carry, 1, ended_at(summed(state, step))

    return Loop(begin, increment, form.observe)


def built_in() -> list[Integrator]:
    """`series-general` and `series-general-adaptive`."""
    common: dict[str, Any] = {
        "family": "taylor", "explicit": True, "symplectic": False, "symmetric": False,
        "conserves": frozenset({"p_phi"}), "reference": "jorba-zou-2005", "needs": "expression", "general": True,
    }  # fmt: skip
    fixed = {chart: FixedStep(loop(chart), (0.0,), FORMS[chart].prepare, ORDER, implicit=False) for chart in CHARTS}
    adaptive = {chart: solver(FORMS[chart], method, HIGHEST_ORDER + 2, light=True) for chart, method in CHARTS.items()}
    summary = "Taylor series of the unreduced space-frame equations by recurrence"
    return [
        Integrator("series-general", summary=f"{summary}, order {ORDER}", solvers=fixed, order=ORDER, **common),
        Integrator(
            "series-general-adaptive", summary=f"{summary}, order and steps of a tolerance", solvers=adaptive,
            control="tolerance", least_tolerance=EPSILON / 1000.0, default_tolerance=EPSILON / 10.0, **common,
        ),
    ]  # fmt: skip
