"""The exact discrete top: an explicit, integrable, variational step that gives the true motion at any step h.

In the chart of `oscillators`, with Z_n = exp(-i n delta) chi(n h) and s = |Z|^2,

    Z_{n+1} + Z_{n-1} = 2 A Z_n/(1 + B s_n)        A = sqrt((P - e1)(P - e2)(P - e3)/D^3),  B = -sigma/D,  D = P - b
    P = wp(h) (`symtop.model.exact.elliptic`),  delta = sigma J int_0^h dt/(wp(t) - b) = sigma J R_J(P - e_i, D)/3

for each of the two oscillators: McMillan's map in a plane. Why: chi(t+h) (wp(t) - wp(h)) has poles of order 2 at most
and the multipliers of chi, so that it is alpha chi + beta chi'; added at h and -h, beta drops out.

*Discrete Lagrangian.* With r = sqrt(D), about 1/h,

    L_d(Z0, Z1) = r (|Z1 - Z0|^2/2 - (V(Z0) + V(Z1))/2),        V(Z) = s - (A/B) log(1 + B s)
    p_0 = -D1 L_d = r (Z1 - A Z0/(1 + B s0)),                   p_1 = D2 L_d = r (A Z1/(1 + B s1) - Z0)

D2 L_d(Z0, Z1) + D1 L_d(Z1, Z2) = 0 is the map. L_d is that of Stormer-Verlet with V in the place of h^2 times the
potential, whose first terms V has; the step is kick-drift-kick with a rational force. It is symplectic in (Z, p) and
reversible for all A and B. It is central: Im(conj(Z) p) = J by Noether's theorem, and

    chi' = p + B Re(conj(Z) p) Z,        |chi_1|^2 + |chi_2|^2 = 1  <->  sum_k Re(conj(Z_k) p_k)/D_k = 0

Exact is the orbit. Marsden and West's exact discrete Lagrangian is the action of the true motion between two positions,
for which no closed form is known; L_d has the energy E' (in A, B, r) and delta for parameters, as an action
at fixed energy has, and its discrete Euler-Lagrange equations hold on the orbits of that energy without an error. A
start names them. As a map of starts a step is the flow: symplectic, and reversible with a step of -h.

*Reduction.* L_d does not change when its plane is turned: at a given J its discrete Routhian is that of |Z| alone, and
both oscillators, reduced, are one map of the height, u = e_z. The reduced motion has the exact map of wp itself,

    y+ + y- = (2 P y^2 + (2 P^2 - g2/2) y - P g2/2 - g3)/(y - P)^2,        y = wp = (kappa u - mu)/2

the addition theorem again. It is the same map: reducing and making discrete commute (`tests`, to rounding).

*Limits.* B = -sigma h^2 and A = 1 + 3 b h^2/2 to order h^2: Stormer-Verlet and the midpoint rule on chi differ from the
map by as much. Without gravity B = delta = 0 and A = cos(h |L|/2 I1). At half a nutation A = 0; a step of m whole
nutations and a rest turns Z by 2 delta(T/2) + pi for each nutation and is the step of the rest. So no step is too
large. Next to a separatrix P - wp is a small difference at large steps; there a step is made of several (`parts`).

*Rounding.* On the orbit 1 + B s = (P - wp)/D with one wp for both oscillators: one division a step. Each step brings
the p of the longer of Z_1, Z_2 to the second condition above, and its length to the one that |chi| = 1 asks for once
that is off by `IDLE`. That keeps J; without it two oscillators whose energies are rounded apart leave each other near
an unstable pole (`sleeping-unstable`, ten nutations: 1e-4, and 5e-11 with it), and with half of it those of a slow top
do so at a third of a nutation a step. Phases are exact products.

*Sums.* A state is Z and W = Z_{n+1} - Z_n = p/r + f Z, f Z the half kick: a step is one drift W and one kick 2 f Z. Z,
W and the kick are carried as two doubles each; f is one. A kick along Z, whatever its strength, and a drift along W
change no J, so that rounding f leaves J alone; and f, a function of |Z|^2, is rounded alike on the way up and down, so
that what it does to the energy comes back. Neither walks: on `spheroid` rms 2e-16 of the momenta and 2e-15 of the
energy, after 1e5 steps as after 1e9 (`benchmarks/exactness.py`). With sums of one double they do: 3e-12 and 1e-12 at
1e7. What the sum of W rounds off is not waited for: it joins what is left of Z, and the next step. What a kick owes to
what is left of Z is: put off, it would grow by sqrt |2 f| a step, and end a run with two steps a nutation within a
hundred.

Sources: Kuznetsov, Petrera, Ragnisco, nlin/0403028 (Baecklund transformations of the Lagrange top discretise its flow);
Suris, The Problem of Integrable Discretization (discrete Garnier system); Marsden and West, Acta Numerica 10 (2001)
357. The constants in this form, and L_d, are derived here; the integrable discrete Lagrangian of Bobenko and Suris,
Commun. Math. Phys. 204 (1999) 147, has deformed constants.
"""

import math
from typing import Any

import numpy as np

from symtop.core.jit import register_jitable, set_item
from symtop.core.jit_functions import fused, two_product
from symtop.methods.framework.lanes import loop_with_rule
from symtop.methods.framework.loop import FixedStep, Loop
from symtop.methods.framework.preparation import Presentation
from symtop.methods.framework.registry import Integrator
from symtop.methods.framework.space import finite_outcome, with_spin
from symtop.methods.lagrangian import oscillators
from symtop.methods.lagrangian.oscillators import Map, OscillatorTop, momentum, on_oscillators
from symtop.methods.vectors import accumulate_plainly, summed

IDLE = 2e-15  # errors of |chi|^2 below this are not corrected, as they are the rounding of |Z|^2


@register_jitable
def _inverse(s: float) -> float:
    """1/s to 6 % for 1/2 <= s <= 1: enough for a correction of the size of rounding, and no division."""
    return 2.82843 - 1.88562 * s


@register_jitable
def _forces(rule: Any, s1: float, s2: float) -> Any:
    """Half kicks over Z of both oscillators; 1 + B s is (P - wp)/D for both, so that one division does."""
    w = 1.0 / (rule.D1 - rule.kappa * s1)
    return (rule.aD1 + rule.kappa * s1) * w, (rule.aD2 - rule.kappa * s2) * w


def enter(par: Any, rule: Any, state: Any, h: float) -> Any:
    """Z and W = p/r + f Z of chi and chi'."""
    a, b, c, d, A, B, C, D = state
    s1, s2 = a * a + b * b, c * c + d * d
    f1, f2 = _forces(rule, s1, s2)
    g1 = par.kappa * (a * A + b * B) / (rule.D1 - par.kappa * s1) * rule.q1 + f1
    g2 = par.kappa * (c * C + d * D) / (rule.D2 + par.kappa * s2) * rule.q2 - f2
    return (
        a, b, c, d,
        A * rule.q1 + g1 * a, B * rule.q1 + g1 * b, C * rule.q2 - g2 * c, D * rule.q2 - g2 * d,
    )  # fmt: skip


def begin(par: Any, rule: Any, state: Any, h: float) -> Any:
    """|Z|^2 and half kicks over Z at the start, and what the sums of the state have rounded off."""
    a, b, c, d = state[0], state[1], state[2], state[3]
    s1, s2 = a * a + b * b, c * c + d * d
    f1, f2 = _forces(rule, s1, s2)
    return s1, s2, f1, f2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0


@register_jitable
def _sum(high: float, low: float, term: float, term_low: float) -> Any:
    """(high + low) + term: the increment of `high`, the new `high`, and the remainder plus `term_low`."""
    addend = term + low
    total = high + addend
    virtual = total - high
    return addend, total, (((high - (total - virtual)) + (addend - virtual)) + ((term - addend) + low)) + term_low


@register_jitable
def _kick(high: float, low: float, f: float, x: float, x_low: float) -> Any:
    """(high + low) + f (x + x_low): the increment of `high`, the new `high`, and the remainder."""
    small = f * x_low + low
    addend = fused(f, x, small)
    total = high + addend
    virtual = total - high
    push = f * x
    remainder = fused(f, x, -push) + ((push - addend) + small)
    return addend, total, ((high - (total - virtual)) + (addend - virtual)) + remainder


@register_jitable
def _step(rule: Any, state: Any, carry: Any) -> Any:
    """Increment of one application of the map, the state after it, and the carry."""
    x1, y1, x2, y2, u1, v1, u2, v2 = state
    s1, s2, f1, f2, lx1, ly1, lx2, ly2, lu1, lv1, lu2, lv2 = carry
    first_longer = s1 >= s2
    # the longer one is scaled to its right length, and p by the inverse of that factor, so that J stays the same
    defect, defect2 = (1.0 - s1) - s2, (1.0 - s2) - s1
    defect = defect if first_longer else defect2
    half = 0.5 * defect
    defect = half if abs(defect) > IDLE else 0.0
    # and p is corrected to fulfil sum Re(conj(Z) (W - f Z))/r = 0
    out1, out2 = x1 * u1 + y1 * v1 - f1 * s1, x2 * u2 + y2 * v2 - f2 * s2
    residual = out1 * rule.q1 + out2 * rule.q2
    # both are computed and one is selected: a branch with arithmetic in it is not vectorised
    i1, i2 = _inverse(s1), _inverse(s2)
    e1, e2, c1, c2 = defect * i1, defect * i2, residual * rule.r1 * i1, residual * rule.r2 * i2
    e1 = e1 if first_longer else 0.0
    e2 = 0.0 if first_longer else e2
    c1 = c1 if first_longer else 0.0
    c2 = 0.0 if first_longer else c2
    c1, c2 = 2.0 * e1 * f1 - c1, 2.0 * e2 * f2 - c2
    p1, q1, p2, q2 = c1 * x1 - e1 * u1, c1 * y1 - e1 * v1, c2 * x2 - e2 * u2, c2 * y2 - e2 * v2
    dx1, x1, lx1 = _sum(x1, lx1 + (e1 * x1 + p1), u1, lu1)
    dy1, y1, ly1 = _sum(y1, ly1 + (e1 * y1 + q1), v1, lv1)
    dx2, x2, lx2 = _sum(x2, lx2 + (e2 * x2 + p2), u2, lu2)
    dy2, y2, ly2 = _sum(y2, ly2 + (e2 * y2 + q2), v2, lv2)
    s1, s2 = x1 * x1 + y1 * y1, x2 * x2 + y2 * y2
    rest1, rest2 = 1.0 - s2, 1.0 - s1
    first_longer = s1 >= s2
    t1 = rest1 if first_longer else s1
    t2 = s2 if first_longer else rest2
    f1, f2 = _forces(rule, t1, t2)
    g1, g2 = f1 + f1, f2 + f2
    du1, u1, lu1 = _kick(u1, lu1 + p1, g1, x1, lx1)
    dv1, v1, lv1 = _kick(v1, lv1 + q1, g1, y1, ly1)
    du2, u2, lu2 = _kick(u2, lu2 + p2, g2, x2, lx2)
    dv2, v2, lv2 = _kick(v2, lv2 + q2, g2, y2, ly2)
    return (
        (dx1, dy1, dx2, dy2, du1, dv1, du2, dv2), (x1, y1, x2, y2, u1, v1, u2, v2),
        (s1, s2, f1, f2, lx1, ly1, lx2, ly2, lu1, lv1, lu2, lv2),
    )  # fmt: skip


def increment(par: Any, rule: Any, state: Any, carry: Any, h: float) -> Any:
    """One step; the work counted is one force for each part of it."""
    total, after, carry = _step(rule, state, carry)
    work = 1
    while work < rule.parts:
        _, after, carry = _step(rule, after, carry)
        work += 1
    if work > 1:
        total, carry = _between(state, after, carry)
    return total, carry, work, finite_outcome(total[0] + total[2])


@register_jitable
def _between(state: Any, after: Any, carry: Any) -> Any:
    """The increment from one state to another, and the carry with its rounding error."""
    total = state
    for i in range(8):
        total = set_item(total, i, after[i] - state[i])
        carry = set_item(carry, 4 + i, carry[4 + i] + (after[i] - (state[i] + total[i])))
    return total, carry


def observe(par: Any, rule: Any, before: Any, dstate: Any, h: float) -> Any:
    """p_phi and p_psi after the step, from J = r Im(conj(Z) W)."""
    s = summed(before, dstate)
    first, second = rule.r1 * (s[0] * s[5] - s[1] * s[4]), rule.r2 * (s[2] * s[7] - s[3] * s[6])
    return -2.0 * par.I1 * (first - second), -2.0 * par.I1 * (first + second)


@register_jitable
def _phase(rule: Any, turn: float, k: int) -> Any:
    """exp(i k delta), and (-1)^k where a step leaves out an odd number of nutations."""
    n = k * rule.parts
    turns, fraction = two_product(n, turn)
    fraction += turns - np.rint(turns)
    if rule.half_turns != 0.0:
        fraction += 0.5 * (n - 2.0 * np.floor(0.5 * n))
    return math.cos(2.0 * math.pi * fraction), math.sin(2.0 * math.pi * fraction)


@register_jitable
def _state_after(rule: Any, s: Any, k: int) -> Any:
    """chi and chi' after k steps."""
    a, b, c, d = s[0], s[1], s[2], s[3]
    f1, f2 = _forces(rule, a * a + b * b, c * c + d * d)
    A, B = rule.r1 * (s[4] - f1 * a), rule.r1 * (s[5] - f1 * b)
    C, D = rule.r2 * (s[6] - f2 * c), rule.r2 * (s[7] - f2 * d)
    first, second = rule.kappa * (a * A + b * B) / rule.D1, rule.kappa * (c * C + d * D) / rule.D2
    A, B, C, D = A - first * a, B - first * b, C + second * c, D + second * d
    c1, s1 = _phase(rule, rule.turn1, k)
    c2, s2 = _phase(rule, rule.turn2, k)
    return (
        a * c1 - b * s1, a * s1 + b * c1, c * c2 - d * s2, c * s2 + d * c2,
        A * c1 - B * s1, A * s1 + B * c1, C * c2 - D * s2, C * s2 + D * c2,
    )  # fmt: skip


def present_axis(par: Any, rule: Any, state: Any, k: int, h: float) -> Any:
    """(e, L), as wide as the kernel's state."""
    s = _state_after(rule, state, k)
    a, b, c, d = s[0], s[1], s[2], s[3]
    e = 2.0 * (a * c + b * d), 2.0 * (a * d - b * c), (a * a + b * b) - (c * c + d * d)
    return (*e, *momentum(par, s), 0.0, 0.0)


def present_attitude(par: Any, rule: Any, state: Any, k: int, h: float) -> Any:
    """(q, L), the twist since the start put on again, as wide as the kernel's state."""
    s = _state_after(rule, state, k)
    return (*with_spin(par, (s[0], -s[3], s[2], -s[1], *momentum(par, s)), k * h), 0.0)


def _advance(par: Any, rule: Any, state: Any, carry: Any) -> Any:
    """A step in lanes; a step of several parts is given up, to be run alone."""
    step, _, carry = _step(rule, state, carry)
    return step, carry, finite_outcome(step[0] + step[2] + (0.0 if rule.parts == 1.0 else np.inf))


_LANES = loop_with_rule(_advance, Map, top=OscillatorTop, dimension=8, carry=12, add=accumulate_plainly)
march_axis, march_attitude = (
    Loop(begin, increment, observe, enter, present, accumulate_plainly, lanes=lambda _: _LANES)
    for present in (present_axis, present_attitude)
)


def built_in() -> list[Integrator]:
    """`exact-discrete`."""
    charts = {
        "axis": (march_axis, Presentation(lambda _par, _t, state: state[:6], 6)),
        "attitude": (march_attitude, Presentation(lambda _par, _t, state: state[:7], 7)),
    }
    return [
        Integrator(
            name="exact-discrete", family="discrete-lagrangian",
            summary="discrete Lagrangian of two oscillators whose step is the motion itself, one force",
            solvers={
                chart: FixedStep(march, oscillators.numbers, on_oscillators, 1, implicit=False, present=presentation)
                for chart, (march, presentation) in charts.items()
            },
            explicit=True, symplectic=True, symmetric=True,
            conserves=frozenset({"energy", "p_phi", "p_psi", "axis_length"}),
            exact_steps=True, needs="this-top", general=False,
            reference="kuznetsov-petrera-ragnisco-2004 marsden-west-2001 bobenko-suris-1999",
        )
    ]  # fmt: skip
