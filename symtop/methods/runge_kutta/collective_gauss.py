"""Collective Gauss methods: Gauss collocation on canonical variables, whose image on (e, L) is a Lie-Poisson map.

The momentum map of SE(3) acting on T*H, the quaternions g with canonical momenta r, takes the canonical bracket to the
Lie-Poisson bracket of the axis and the momentum,

    e = g e_0 g*,      L = Im(r g*)/2,

so that the flow of K(g, r) = |L|^2/2 I1 + mgl e_z covers the motion of the top, and any symplectic method for K covers
a Poisson map. The equations are

    g' = w g/2,      r' = w r/2 + 2 mgl k g e_0,      w = L/I1.

g starts as 1 and r as 2 L. The choice does not matter: turns g -> g c and shifts r -> r + s g are linear symmetries,
with which a Gauss method commutes, so that the image of a step depends on (e, L) alone. Their momenta, |g|^2 and
r.(g e_0)/2 = L.e, are quadratic, as is L_z: a Gauss method keeps all three, and with them |e|, p_psi and p_phi. The
energy is of degree four in (g, r) and its error stays bounded. In contrast to `gauss`, these methods preserve the
bracket and not the energy. The spin of the body is a constant rate and is added at samples.

The stages are swept as those of `gauss` are, with the same tables, from the slope at the start of the step and until
the correction no longer falls. Sweeps that do not converge end the run.
Sources: Ohsawa, SIGMA 15 (2019) 083 (arXiv:1907.07819), for the map T*C^2 -> se(3)*; McLachlan, Modin, Verdier,
Nonlinearity 27 (2014) 1525 (collective integrators).
"""

from typing import Any

import numpy as np

from symtop.core.jit import register_jitable, set_item
from symtop.methods.framework.plan import NOT_CONVERGED, OK
from symtop.methods.framework.registry import Integrator
from symtop.methods.lie_group.loop import UNSPUN, in_charts, lie_loop
from symtop.methods.runge_kutta.gauss import MOST_SWEEPS, ROUND_OFF, RULES, stage_weights
from symtop.methods.vectors import conjugate
from symtop.model.body import product


@register_jitable
def _field(par: Any, e: Any, y: Any) -> Any:
    """Time derivative of (g, r)."""
    g, r = y[:4], y[4:]
    quarter = 0.25 / par.I1
    L = product(r, conjugate(g))  # its vector is 2 L
    w = 0.0, quarter * L[1], quarter * L[2], quarter * L[3]
    moves, turns = product(w, g), product(w, r)
    a, b, c, d = product(g, (0.0, e[0], e[1], e[2]))
    twice = 2.0 * par.mgl
    return (*moves, turns[0] - twice * d, turns[1] - twice * c, turns[2] + twice * b, turns[3] + twice * a)


def _begin(par: Any, rule: Any, state: Any, h: float) -> Any:
    return np.empty((len(rule.b), 9))  # the increments of the stages, and a column for the weights


@register_jitable
def _solve(par: Any, rule: Any, e: Any, L: Any, work: Any, h: float) -> Any:
    """Fill in the increments of the stages; returns the number of sweeps and the outcome."""
    stages, start = len(rule.b), (1.0, 0.0, 0.0, 0.0, 0.0, 2.0 * L[0], 2.0 * L[1], 2.0 * L[2])
    unit = 1.0 / (abs(L[0]) + abs(L[1]) + abs(L[2]) + np.sqrt(par.I1 * abs(par.mgl)) + 1e-300)
    slope = _field(par, e, start)
    stage_weights(rule, h, work[:, 8])
    for i in range(stages):
        for m in range(8):
            work[i, m] = work[i, 8] * slope[m]
    last, effort = np.inf, 0
    while effort < MOST_SWEEPS:
        gap = 0.0
        for i in range(stages):
            place = start
            for j in range(stages):
                for m in range(8):
                    place = set_item(place, m, place[m] + rule.mu[i, j] * work[j, m])
            slope = _field(par, e, place)
            for m in range(8):
                value = work[i, 8] * slope[m]
                change = abs(value - work[i, m])
                gap = max(gap, change if m < 4 else change * unit)
                work[i, m] = value
        effort += 1
        if not 0.0 < gap < last:
            return effort, OK if gap < ROUND_OFF else NOT_CONVERGED
        last = gap
    return effort, NOT_CONVERGED


def turn(par: Any, rule: Any, e: Any, L: Any, work: Any, h: float) -> Any:
    """One step; the work counted is the number of sweeps over the stages."""
    effort, outcome = _solve(par, rule, e, L, work, h)
    step = (0.0,) * 8
    for m in range(8):
        total = 0.0
        for i in range(len(rule.b)):
            total += work[i, m]
        step = set_item(step, m, total)
    # Im(r g*)/2 - L with g = 1 + dg, r = 2 L + dr: no difference of large numbers
    dr, back = step[4:], conjugate(step[:4])
    linear, quad = product((0.0, L[0], L[1], L[2]), back), product(dr, back)
    dL = (0.5 * (dr[1] + quad[1]) + linear[1], 0.5 * (dr[2] + quad[2]) + linear[2], 0.5 * (dr[3] + quad[3]) + linear[3])
    return step[0], step[1:4], dL, work, effort, outcome


march = lie_loop(turn, _begin)


def built_in() -> list[Integrator]:
    """collective-gauss-2, -4 and -6, named after their orders."""
    return [
        Integrator(
            name=f"collective-gauss-{2 * stages}", family="lie-group",
            summary=f"Gauss collocation with {stages} stage{'s' if stages > 1 else ''} on quaternions: Lie-Poisson",
            solvers=in_charts(march, RULES[stages], UNSPUN, stages, implicit=True),
            order=2 * stages, explicit=False, symplectic=True, symmetric=True,
            conserves=frozenset({"p_phi", "p_psi", "axis_length"}),
            reference="ohsawa-2019 mclachlan-modin-verdier-2014", needs="group", general=True,
        )
        for stages in (1, 2, 3)
    ]  # fmt: skip
