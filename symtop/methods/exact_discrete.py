"""The exact discrete top: an explicit, integrable, variational step that is the motion itself at any step h.

In the chart of `oscillators`, with Z_n = exp(-i n delta) chi(n h) and s = |Z|^2,

    Z_{n+1} + Z_{n-1} = 2 A Z_n/(1 + B s_n)        A = sqrt((P - e1)(P - e2)(P - e3)/D^3),  B = -sigma/D,  D = P - b
    P = wp(h) (`symtop.model.weierstrass`)         delta = sigma J int_0^h dt/(wp(t) - b) = sigma J R_J(P - e_i, D)/3

for each of the two oscillators: McMillan's map in a plane. Why: chi(t+h) (wp(t) - wp(h)) has poles of order 2 at most
and the multipliers of chi, so that it is alpha chi + beta chi'; added at h and -h, beta drops out.

*Discrete Lagrangian.* With r = sqrt(D), which is 1/h and smaller terms,

    L_d(Z0, Z1) = r (|Z1 - Z0|^2/2 - (V(Z0) + V(Z1))/2),        V(Z) = s - (A/B) log(1 + B s)
    p_0 = -D1 L_d = r (Z1 - A Z0/(1 + B s0)),                   p_1 = D2 L_d = r (A Z1/(1 + B s1) - Z0)

D2 L_d(Z0, Z1) + D1 L_d(Z1, Z2) = 0 is the map. L_d is that of Stormer-Verlet with V in the place of h^2 times the
potential, whose first terms V has; the step is kick-drift-kick with a rational force. It is symplectic in (Z, p) and
reversible for all A and B. It is central: Im(conj(Z) p) = J by Noether's theorem, and

    chi' = p + B Re(conj(Z) p) Z,        |chi_1|^2 + |chi_2|^2 = 1  <->  sum_k Re(conj(Z_k) p_k)/D_k = 0

What is exact is the orbit. Marsden and West's exact discrete Lagrangian is the action of the true motion between two
positions, which no closed form is known for; L_d has the energy E' (in A, B, r) and delta for parameters, as an action
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
the p of the longer of Z_1, Z_2 nearer to the second condition above, and its length to the one that |chi| = 1 asks for
once that is off by `IDLE`. That keeps J; without it two oscillators whose energies are rounded apart leave each other
near an unstable pole (`sleeping-unstable`, ten nutations: 1e-4, and 5e-11 with it). A correction below a last place
keeps J only if its parts in Z and in p are rounded without a bias. Made at once, it follows the rounding that it came
from, and drives J and the energy away by 1e-19 a step, of one sign: so it waits for the next step, where it is added
to an exact product (`symtop.base.fused`). Phases n delta are taken off by exact products at samples. J and the energy
then walk at random up to some 1e7 steps (rms 2e-13 of p_psi on `spheroid`); a drift of 2e-20 a step of one sign is left
and shows from 1e8 on (rms 2e-11 at 1e9, `benchmarks/exactness.py`). Its cause is not known; sums without compensation
walk as these do.

Sources: Kuznetsov, Petrera, Ragnisco, nlin/0403028 (Baecklund transformations of the Lagrange top discretise its flow);
Suris, The Problem of Integrable Discretization (discrete Garnier system); Marsden and West, Acta Numerica 10 (2001)
357. The constants in this form, and L_d, are derived here. Bobenko and Suris, Commun. Math. Phys. 204 (1999) 147, give
the top a discrete Lagrangian that is integrable, with deformed constants; one whose orbits are those of the top was
not found in these sources, which does not say that it is nowhere.
"""

import math
from typing import Any

import numpy as np

from symtop.base.compiled import register_jitable, set_item
from symtop.base.fused import fused
from symtop.base.parts import two_product
from symtop.methods.exact_map import Map, numbers
from symtop.methods.fixed_step import FixedStep
from symtop.methods.lanes import Lanes
from symtop.methods.loop import driver
from symtop.methods.one_loop_lanes import one_loop
from symtop.methods.oscillators import OscillatorTop, attitude_state, axis_state, on_oscillators
from symtop.methods.preparation import Shown
from symtop.methods.registry import Integrator
from symtop.methods.space import finite_outcome

SHARE = 0.5  # of what breaks |chi| = 1 that a step takes off: all of it would feed on the rounding that the loop sums
IDLE = 2e-15  # |chi|^2 may be off by as much: corrections below a last place are rounded as the sums before them were


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
    """Z and Q = p/r of chi and chi'."""
    a, b, c, d, A, B, C, D = state
    first = par.kappa * (a * A + b * B) / (rule.D1 - par.kappa * (a * a + b * b))
    second = par.kappa * (c * C + d * D) / (rule.D2 + par.kappa * (c * c + d * d))
    return (
        a, b, c, d,
        (A + first * a) * rule.q1, (B + first * b) * rule.q1, (C - second * c) * rule.q2, (D - second * d) * rule.q2,
    )  # fmt: skip


def begin(par: Any, rule: Any, state: Any, h: float) -> Any:
    """|Z|^2 and half kicks over Z at the start."""
    a, b, c, d = state[0], state[1], state[2], state[3]
    s1, s2 = a * a + b * b, c * c + d * d
    f1, f2 = _forces(rule, s1, s2)
    return s1, s2, f1, f2


@register_jitable
def _step(rule: Any, state: Any, carry: Any) -> Any:
    """Increment of one application of the map, and |Z|^2 and the half kicks over Z at its end."""
    x1, y1, x2, y2, u1, v1, u2, v2 = state
    s1, s2, f1, f2 = carry
    longer = s1 >= s2
    # the longer one gets the length that it must have, and p the inverse of that factor, so that J remains
    lack, other = (1.0 - s1) - s2, (1.0 - s2) - s1
    lack = lack if longer else other
    half = 0.5 * SHARE * lack
    lack = half if abs(lack) > IDLE else 0.0
    # and what is wrong with p is taken off it: sum Re(conj(Z) Q)/r = 0
    swell = SHARE * ((x1 * u1 + y1 * v1) * rule.q1 + (x2 * u2 + y2 * v2) * rule.q2)
    # both are made, and one is chosen: a branch that holds arithmetic is none in lanes
    i1, i2 = _inverse(s1), _inverse(s2)
    e1, e2, c1, c2 = lack * i1, lack * i2, swell * rule.r1 * i1, swell * rule.r2 * i2
    e1 = e1 if longer else 0.0
    e2 = 0.0 if longer else e2
    c1 = c1 if longer else 0.0
    c2 = 0.0 if longer else c2
    p1, q1 = e1 * (f1 * x1 - u1) - c1 * x1, e1 * (f1 * y1 - v1) - c1 * y1
    p2, q2 = e2 * (f2 * x2 - u2) - c2 * x2, e2 * (f2 * y2 - v2) - c2 * y2
    dx1, dy1 = u1 + fused(f1, x1, e1 * x1 + p1), v1 + fused(f1, y1, e1 * y1 + q1)
    dx2, dy2 = u2 + fused(f2, x2, e2 * x2 + p2), v2 + fused(f2, y2, e2 * y2 + q2)
    k1, l1, k2, l2 = fused(f1, x1, p1), fused(f1, y1, q1), fused(f2, x2, p2), fused(f2, y2, q2)
    x1, y1, x2, y2 = x1 + dx1, y1 + dy1, x2 + dx2, y2 + dy2
    s1, s2 = x1 * x1 + y1 * y1, x2 * x2 + y2 * y2
    rest1, rest2 = 1.0 - s2, 1.0 - s1
    longer = s1 >= s2
    t1 = rest1 if longer else s1
    t2 = s2 if longer else rest2
    g1, g2 = _forces(rule, t1, t2)
    return (
        dx1, dy1, dx2, dy2,
        fused(g1, x1, k1), fused(g1, y1, l1), fused(g2, x2, k2), fused(g2, y2, l2),
    ), (s1, s2, g1, g2)  # fmt: skip


@register_jitable
def _plus(state: Any, step: Any) -> Any:
    for i in range(8):
        state = set_item(state, i, state[i] + step[i])
    return state


def increment(par: Any, rule: Any, state: Any, carry: Any, h: float) -> Any:
    """One step; the work counted is one force for each part of it."""
    total, carry = _step(rule, state, carry)
    work = 1
    while work < rule.parts:
        step, carry = _step(rule, _plus(state, total), carry)
        total = _plus(total, step)
        work += 1
    return total, carry, work, finite_outcome(total[0] + total[2])


def observe(par: Any, rule: Any, before: Any, dstate: Any, h: float) -> Any:
    """p_phi and p_psi after the step, from J = r Im(conj(Z) Q)."""
    s = _plus(before, dstate)
    first, second = rule.r1 * (s[0] * s[5] - s[1] * s[4]), rule.r2 * (s[2] * s[7] - s[3] * s[6])
    return -2.0 * par.I1 * (first - second), -2.0 * par.I1 * (first + second)


@register_jitable
def _phase(rule: Any, turn: float, k: int) -> Any:
    """exp(i k delta), and (-1)^k where a step leaves out an odd number of nutations."""
    n = k * rule.parts
    turns, rest = two_product(n, turn)
    rest += turns - np.rint(turns)
    if rule.half_turns != 0.0:
        rest += 0.5 * (n - 2.0 * np.floor(0.5 * n))
    return math.cos(2.0 * math.pi * rest), math.sin(2.0 * math.pi * rest)


@register_jitable
def _unwound(rule: Any, s: Any, k: int) -> Any:
    """chi and chi' after k steps."""
    a, b, c, d = s[0], s[1], s[2], s[3]
    A, B, C, D = rule.r1 * s[4], rule.r1 * s[5], rule.r2 * s[6], rule.r2 * s[7]
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
    return (*axis_state(par, _unwound(rule, state, k)), 0.0, 0.0)


def present_attitude(par: Any, rule: Any, state: Any, k: int, h: float) -> Any:
    """(q, L), as wide as the kernel's state."""
    return (*attitude_state(par, _unwound(rule, state, k), k * h), 0.0)


def first_six(par: Any, t: float, state: Any) -> Any:
    """(e, L) alone."""
    return state[0], state[1], state[2], state[3], state[4], state[5]


def first_seven(par: Any, t: float, state: Any) -> Any:
    """(q, L) alone."""
    return state[0], state[1], state[2], state[3], state[4], state[5], state[6]


def _side_by_side(par: Any, rule: Any, state: Any, carry: Any) -> Any:
    """A step in lanes: one of several parts is left to the kernel for one."""
    step, carry = _step(rule, state, carry)
    return step, carry, finite_outcome(step[0] + step[2] + (0.0 if rule.parts == 1.0 else np.inf))


_lanes = one_loop(_side_by_side, Map, top=OscillatorTop, dimension=8, carry=4)


def _in_lanes(rule: Map) -> Lanes:
    return _lanes


march_axis = driver(begin, increment, observe, enter, present_axis, lanes=_in_lanes)
march_attitude = driver(begin, increment, observe, enter, present_attitude, lanes=_in_lanes)


def built_in() -> list[Integrator]:
    """`exact-discrete`."""
    axis, attitude = Shown(first_six, 6), Shown(first_seven, 7)
    return [
        Integrator(
            name="exact-discrete",
            family="discrete-lagrangian",
            summary="discrete Lagrangian of two oscillators whose step is the motion itself, one force",
            solvers={
                "axis": FixedStep(march_axis, numbers, on_oscillators, 1, implicit=False, present=axis),
                "attitude": FixedStep(march_attitude, numbers, on_oscillators, 1, implicit=False, present=attitude),
            },
            explicit=True, symplectic=True, symmetric=True,
            conserves=frozenset({"energy", "p_phi", "p_psi", "axis_length"}),
            exact_steps=True,
            reference="kuznetsov-petrera-ragnisco-2004 marsden-west-2001 bobenko-suris-1999",
        )
    ]  # fmt: skip
