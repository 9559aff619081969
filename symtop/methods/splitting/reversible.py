"""Stormer-Verlet in the angles chart with steps that shrink towards a pole and can be retraced.

    dt = sin^k(theta) dtau                                             what steps follow: rho is about sin^-k(theta)
    rho_{1/2} = sin^-k(theta_0) - (k/2) eps cot(theta_0) theta'_0      at the start, half an update
    h = eps/rho_{n+1/2},   kick(h/2) drift(h) kick(h/2)                a step of `stormer-verlet`
    rho_{n+3/2} = rho_{n+1/2} - k eps cot(theta_{n+1}) theta'_{n+1}    d(sin^-k)/dtau at the point between two steps

The axis passes a pole at a rate theta' that hardly depends on the gap, so that the centrifugal barrier acts for a time
of about theta: k = 1, and eps, the step size that a user gives, is the step at the equator. k = 2 would suit a barrier
of given strength; but the closer a passage the weaker it is, as p_phi - p_psi, and such steps are too short.
A step read off the present point, h = eps sin^k(theta_n), is another one on the way back. Here rho belongs to a step
and its change to a grid point: with p_theta turned round the same steps return, and the energy error stays bounded, as
of any reversible method on an integrable reversible system. Steps that depend on the state cost the symplectic form.
A sample is a step, at most half as long, from the grid point next to it and is not fed back: it moves no grid point.
Steps and forces count both. Where eps is too large for a passage, rho falls below zero and the run ends `not_finite`.
Source: Hairer, Soderlind, SIAM J. Sci. Comput. 26 (2005) 1838; Huang, Leimkuhler, SIAM J. Sci. Comput. 18 (1997) 239;
Hairer, Lubich, Wanner, Geometric Numerical Integration, sections VIII.3.2 and XI.3.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from symtop.core.jit import compile_kernel, register_jitable
from symtop.core.sines import sincos
from symtop.methods.framework.angles import chart_outcome, on_angles
from symtop.methods.framework.plan import LEFT_CHART, NOT_FINITE, OK, OUT_OF_BUDGET, OUTCOMES, Array, Plan, Run
from symtop.methods.framework.registry import Integrator
from symtop.methods.splitting.angles import drift_angles, force_angles, kick_angles, observe
from symtop.methods.splitting.loop import Stages, compose
from symtop.methods.vectors import accumulate
from symtop.model.top import Angles, SymmetricTop

BLOCK, STEPS, SHARE = 5_000_000, 200_000_000, 10_000  # steps between returns to Python, of a run (10 s), per plan step
NONE = (0.0, 0.0, 0.0, 0.0)
BEGIN, RETRACE, ONWARD = 0.5, 1.0, 0.0  # updates of rho before the first step


@register_jitable
def growth(par: Any, k: float, state: Any, step: Any) -> Any:
    """d rho/dtau = -k cot(theta) theta' after an increment."""
    sin_x, cos_x = sincos(0.5 * (state[0] + step[0]))
    return 0.5 * k * (sin_x / cos_x - cos_x / sin_x) * ((state[1] + step[1]) / par.I1)


@compile_kernel
def march(par, k, eps, turn, times, budget, index, place, states, momenta):  # type: ignore[no-untyped-def]
    """Continue from `place`, a point of the grid, to the last of `times`, a failure or `budget` steps."""
    state, low, force, clock, clock_low, rho = place
    steps = outcome = 0
    if turn > 0.0:
        force, rho = force_angles(par, state, NONE), rho + turn * eps * growth(par, k, state, NONE)
    while index < len(times) and steps < budget and outcome == OK:
        h, gap = eps / rho, (times[index] - clock[0]) - clock_low[0]
        if not rho > 0.0 or clock[0] + h == clock[0]:  # the last steps before the axis is at the pole
            outcome = LEFT_CHART if rho > 0.0 else NOT_FINITE
            break
        is_sample = gap <= 0.5 * h if eps > 0.0 else gap >= 0.5 * h
        part = gap if is_sample else h
        rule = Stages((part / par.I1,), (0.5 * part, 0.5 * part), (0.0, 0.0), 1, 0, 0.0)
        step, after = compose(force_angles, kick_angles, drift_angles, par, rule, state, force)
        new_state, new_low = accumulate(state, low, step)
        steps += 1 if part != 0.0 else 0
        outcome = chart_outcome(new_state[0])
        if outcome == OK and is_sample:
            pair = observe(par, rule, state, step, part) if part != 0.0 else (par.north + par.p_psi, par.p_psi)
            momenta[0, index], momenta[1, index] = pair
            states[index, 0], states[index, 1], states[index, 2], states[index, 3] = new_state
            index += 1
        elif outcome == OK:
            state, low, force, rho = new_state, new_low, after, rho + eps * growth(par, k, state, step)
            clock, clock_low = accumulate(clock, clock_low, (h,))
    return index, steps, outcome, (state, low, force, clock, clock_low, rho)


def _limit(count: int) -> int:
    """The limit on steps of a run without a budget, for a plan of `count` steps."""
    return max(min(BLOCK + SHARE * count, STEPS), 8 * count)


def _run(top: SymmetricTop, start: Angles, k: float, parts: Sequence[tuple[float, Array]], limit: float) -> Run:
    """The samples of the last part, each part with an eps and times of its own."""
    par, state = on_angles(top, start)
    place: Any = (state, NONE, NONE[:3], NONE[:1], NONE[:1], 1.0 / math.sin(start.theta) ** k)
    total, outcome, before, turn, budget = 0, OK, 0.0, BEGIN, limit
    for eps, times in parts:
        index, before, turn = 0, eps, RETRACE if eps * before < 0.0 else turn
        states, momenta = np.full((times.size, 4), np.nan), np.full((2, times.size), np.nan)
        while index < times.size and outcome == OK:
            arguments = min(BLOCK, math.ceil(budget - total)), index, place, states, momenta
            index, steps, outcome, place = march(par, k, eps, turn, times, *arguments)
            total, turn = total + steps, ONWARD
            outcome = OUT_OF_BUDGET if outcome == OK and total >= budget and index < times.size else outcome
    end = OUTCOMES[outcome], float(times[-1] if outcome == OK else place[3][0])
    return Run(states, momenta[0], momenta[1], total, total, 0, *end)


@dataclass(frozen=True)
class Reversible:
    """The solver in the angles chart, with steps of eps sin^k(theta) that can be retraced."""

    k: float = 1.0

    def __call__(self, top: SymmetricTop, start: Angles, plan: Plan) -> Run:
        """The run of a plan, whose step size is eps."""
        return _run(top, start, self.k, [(plan.step_size, plan.times)], self.limit(plan))

    def limit(self, plan: Plan) -> float:
        """The force evaluations at which a run is stopped."""
        return plan.most(_limit(int(plan.marks[-1])))

    def onward(self, top: SymmetricTop, start: Angles, lengths: Sequence[float]) -> Run:
        """A step of each length from the end of the last one, with its rho: a negative length retraces a step."""
        ends = np.cumsum(lengths)
        return _run(top, start, self.k, [(h, ends[i : i + 1]) for i, h in enumerate(lengths)], _limit(len(lengths)))


def built_in() -> list[Integrator]:
    """`stormer-verlet-reversible`."""
    return [Integrator(
        name="stormer-verlet-reversible", family="splitting", order=2, explicit=True, symplectic=False,
        symmetric=True, conserves=frozenset({"p_phi", "p_psi"}), energy_error="bounded",
        summary="Stormer-Verlet with reversible steps that shrink towards a pole, eps sin(theta)",
        needs="kicks", general=False, solvers={"angles": Reversible()},
        reference="hairer-soderlind-2005 huang-leimkuhler-1997",
    )]  # fmt: skip
