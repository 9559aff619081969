"""Gauss collocation with s = 1 .. 6 stages on the space-frame equations: order 2s, every constant kept.

    L_i = h b_i f(y + sum_j mu_ij L_j),   mu_ij = a_ij / b_j,         y+ = y + sum_i L_i

c are the zeros of the shifted Legendre polynomial, a_ij and b_j integrals of the Lagrange basis on them. A Gauss method
conserves every linear and quadratic constant of f (Cooper 1987), and all those of the top in (e, L) are: |e| = 1,
L.e = p_psi, L_z = p_phi and the energy |L|^2/2 I1 + mgl e_z, all four at once. The attitude is carried as a
frame (e, L, a), where this still holds (see `space`). The methods are symmetric. They are symplectic for *canonical*
equations; these are Lie-Poisson equations, whose bracket depends on the state, and no Gauss method preserves it: the
trait `symplectic` is false, although the motion stays on the coadjoint orbit and on the energy. `gauss-2` must not be
confused with the `midpoint` discrete Lagrangian in angles, which is symplectic and keeps the energy only on average.
Of a body without symmetry, in (q, M), |q| and the energy are quadratic and kept, and |M| of a free one; L_z is cubic
and is not. There the sweeps are all, without Newton.

What makes this true to rounding over long runs (Hairer, McLachlan, Razakarivony, BIT 48 (2008) 231): conservation needs
mu_ij + mu_ji = 1, and the table satisfies it *exactly* in doubles, whatever the rounding of b (Antonana, Makazaga,
Murua, Numer. Algorithms 76 (2017) 861); the weights h b_i sum to h; the driver sums increments with compensation; and
the iteration runs until its correction no longer falls, never to a tolerance, whose remainder would have a sign.

*Sweeps.* The iteration is the plain one, y_i = y + sum_j mu_ij L_j with the newest L_j, started from the polynomial of
the last step: 4 to 14 sweeps at 60 to 240 steps a nutation. They converge up to steps of 0.15 nutations (s = 1) to 0.48
(s = 6) in the scene `spheroid`: a limit of the sweep, not of the method. Where its corrections leave the line to
rounding within 100 sweeps, Newton's iteration takes over, and the choice hangs on this step alone. A step that Newton
does not solve either ends the run as `not_converged`.

*Newton.* L' is linear in e alone, so that the increments of e give those of L exactly; what remains are 3 s equations
for the x_i, the increments of e, quadratic in them. With w_i = h b_i, nu = mu diag(w) mu and e_i, L_i at the stage,

    dx_i - (w_i/I1) sum_k (mu_ik L_i x dx_k + mgl nu_ik ((z.e_i) dx_k - z (e_i.dx_k))) = w_i L_i x e_i/I1 - x_i

is solved by elimination with pivots, 18 x 18 at most. The increments of a follow with L_i given: the same equations
without mgl, now linear. Newton starts from e_i = e. Where this does not converge in 12 iterations, the solution is
followed from a tenth of the step to all of it, each time 1.09 times further. Every step h omega = 2, 5 and 10 from 1000
states of each of 11 scenes is solved, without following in 100 %, 94 % and 74 % of cases. What stays unsolved has a
path that turns back before the whole step: slow tops that swing widely, at steps of a nutation and more.

*Lanes.* A lane whose sweeps have ended keeps its L_i by selection; one whose corrections do not fall to rounding is
given up. Each stage is a loop of its own with the numbers of its row as constants, because accesses to `block` at a
variable place are not vectorised.

No step is too large for stability. The methods are A-stable, |R(iy)| = 1; and at a steady precession, where the reduced
energy is least, small nutations cannot grow at any step, because the energy is kept. What a large step loses is the
phase: a nutation turns by 2 atan(h omega/2) with s = 1. Cost: s evaluations of f a sweep, or an iteration of Newton.
Sources: Hairer, Lubich, Wanner, Geometric Numerical Integration, IV.2, VIII.6; Hairer, Wanner, Solving Ordinary
Differential Equations II, IV.3 (A-stability), IV.8; Allgower, Georg, Introduction to Numerical Continuation Methods, 2.
"""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from symtop.core.jit import register_jitable, set_item
from symtop.core.numbers import context
from symtop.methods.framework import body, space
from symtop.methods.framework.lanes import Lanes, W, move, none_left, put, reading
from symtop.methods.framework.loop import FixedStep, Loop
from symtop.methods.framework.plan import NOT_CONVERGED, OK, Array
from symtop.methods.framework.preparation import LazyRule
from symtop.methods.framework.registry import Integrator
from symtop.methods.framework.space import SpaceTop, field_axis, field_frame, observe_axis
from symtop.methods.simd import wide_vectors
from symtop.methods.vectors import accumulate, dot_of, each, total, zero
from symtop.model.charts import BODY

CONVERGED_CORRECTION = 1e-9  # a correction in units of |e| = 1, whose square is below rounding
NEAR_SOLUTION = 0.1  # a correction after which the solution is followed to a longer step
MOST_DIRECT = 12  # limit on the iterations for one length of the step; 2 to 7 where they converge soon
RUNGS = 28  # lengths from a tenth of the step to the whole, each longer by the factor `RUNG_RATIO`
RUNG_RATIO = 2.0**0.125  # with sqrt 2 a tenth of `spheroid`'s steps fails at h omega = 10, with 2^(1/4) a hundredth


@register_jitable
def _at_stage(state: Any, work: Any, stages: int, i: int) -> Any:
    """The state at stage i."""
    place = state
    for j in range(stages):
        weight = work[2 * stages + i, j]
        for m in range(len(state)):
            place = set_item(place, m, place[m] + weight * work[j, m])
    return place


@register_jitable
def _linearise(field: Any, par: Any, state: Any, work: Any, stages: int, share: float, first: int, mgl: float) -> None:
    """Fill in the equations for corrections of the three components from `first` on, with their residuals."""
    base = 4 * stages + 1
    for i in range(stages):
        place = _at_stage(state, work, stages, i)
        slope = field(par, place)
        weight = share * work[i, len(state)]
        row, turn = base + 3 * i, weight / par.I1
        for k in range(stages):
            column, unit = 3 * k, 1.0 if i == k else 0.0
            swing, lift = turn * work[2 * stages + i, k], share * turn * mgl * work[2 * stages + i, stages + k]
            x, y, z = swing * place[3], swing * place[4], swing * place[5]
            work[row, column], work[row, column + 1], work[row, column + 2] = unit - lift * place[2], z, -y
            work[row + 1, column], work[row + 1, column + 1], work[row + 1, column + 2] = -z, unit - lift * place[2], x
            work[row + 2, column] = y + lift * place[0]
            work[row + 2, column + 1] = lift * place[1] - x
            work[row + 2, column + 2] = unit
        for m in range(3):
            work[row + m, 3 * stages] = weight * slope[first + m] - work[i, first + m]


@register_jitable
def _eliminate(work: Any, base: int, size: int) -> None:
    """Solve the system in the rows from `base` on; its last column becomes the solution."""
    for k in range(size):
        pivot = k
        for i in range(k + 1, size):
            if abs(work[base + i, k]) > abs(work[base + pivot, k]):
                pivot = i
        if pivot != k:
            for j in range(k, size + 1):
                work[base + k, j], work[base + pivot, j] = work[base + pivot, j], work[base + k, j]
        inverse = 1.0 / work[base + k, k]
        for i in range(k + 1, size):
            factor = work[base + i, k] * inverse
            for j in range(k + 1, size + 1):
                work[base + i, j] -= factor * work[base + k, j]
    for k in range(size - 1, -1, -1):
        value = work[base + k, size]
        for j in range(k + 1, size):
            value -= work[base + k, j] * work[base + j, size]
        work[base + k, size] = value / work[base + k, k]


@register_jitable
def _iterate(
    field: Any, par: Any, state: Any, work: Any, stages: int, share: float, first: int, mgl: float, limit: float
) -> Any:
    """Newton from the present increments, for a share of the step; returns iterations, and whether they converged."""
    base, effort, converged = 4 * stages + 1, 0, False
    while True:
        for i in range(stages):  # the increments of L that belong to those of e
            slope = field(par, _at_stage(state, work, stages, i))
            for m in range(3, 5):
                work[i, m] = share * work[i, len(state)] * slope[m]
        if converged or effort == MOST_DIRECT:
            return effort, converged
        _linearise(field, par, state, work, stages, share, first, mgl)
        _eliminate(work, base, 3 * stages)
        effort += 1
        correction = 0.0
        for i in range(stages):
            for m in range(3):
                change = work[base + 3 * i + m, 3 * stages]
                correction += abs(change)
                work[i, first + m] += change
        converged = correction <= limit  # false if it is not a number


@register_jitable
def _fill_nu(work: Any, dimension: int, stages: int) -> None:
    """nu = mu diag(w) mu, in each solve: in the preparation, every run would compute it, 216 products at s = 6."""
    for i in range(stages):
        for j in range(stages):
            total = 0.0
            for k in range(stages):
                total += work[2 * stages + i, k] * work[k, dimension] * work[2 * stages + k, j]
            work[2 * stages + i, stages + j] = total


@register_jitable
def solve_stages(field: Any, par: Any, state: Any, work: Any, stages: int) -> Any:
    """Solve a step in the array of `_loop`; returns iterations and convergence. One call of the inlined `_iterate`."""
    effort, rung, first, mgl, restarted = 0, RUNGS, 0, par.mgl, False
    _fill_nu(work, len(state), stages)
    for i in range(stages):
        for m in range(len(state)):
            work[i, m] = 0.0
    while True:
        limit = CONVERGED_CORRECTION if rung == RUNGS else NEAR_SOLUTION
        count, converged = _iterate(field, par, state, work, stages, RUNG_RATIO ** (rung - RUNGS), first, mgl, limit)
        effort += count
        if converged and rung < RUNGS:
            rung += 1
        elif converged and first == 0 and len(state) > 6:
            first, mgl = 6, 0.0
        elif converged or restarted or first > 0:
            return effort, converged
        else:  # from the start again, with a tenth of the step
            restarted, rung = True, 1
            for i in range(stages):
                for m in range(3):
                    work[i, m] = 0.0


STAGES = (1, 2, 3, 4, 5, 6)
DIGITS = 40  # of the multiprecision that coefficients are computed in
MOST_SWEEPS = 100  # limit on the sweeps in a step; a step of usual size takes at most 14
FARTHEST, PACE = 1e3, 0.68  # correction k that does not fall and is above FARTHEST PACE^k: sweeps will not converge
STILL_COMPONENT = 5  # L_z has no slope, so its increments stay zero: left out, they save a sixth of the sums on (e, L)
ROUND_OFF = 1e-14  # a correction that stopped falling above this, in units of |e| = 1 and |L|, has not converged


class GaussRule(NamedTuple):
    """The numbers of one Gauss method, each correctly rounded but for one of each pair mu_ij, mu_ji."""

    mu: Array  # (s, s), mu + mu^T = 1 exactly
    b: Array  # (s,)
    predict: Array  # (s, s): the last step's L_j, continued to the next step's L_i
    shares: tuple[float, ...] = (1.0,)  # the parts of a step of `collective_gauss`, as `lie_group.loop` asks for them


@register_jitable
def _unpack(rows: Any) -> GaussRule:
    s = rows.shape[1]
    return GaussRule(rows[:s], rows[s], rows[s + 1 :], (1.0,))


def packed(rule: GaussRule) -> tuple[Callable[[Any], GaussRule], Array]:
    """How a rule is passed to compiled code: as one array, a faster argument than three."""
    return _unpack, np.vstack([rule.mu, rule.b, rule.predict])


def _antiderivative(roots: list[Any], x: Any) -> Any:
    """int_0^x prod (t - root) dt, in the arithmetic of its arguments."""
    polynomial = np.atleast_1d(np.poly(np.array(roots, dtype=object)) * x**0)  # no integer is divided by another
    return np.polyval(np.polyint(polynomial), x)


@functools.lru_cache(maxsize=len(STAGES))
def gauss_rule(stages: int) -> GaussRule:
    """Coefficients of the method with that many stages, from `DIGITS` digits."""
    mp = context(DIGITS)
    guesses = [mp.cos(mp.pi * (k - 0.25) / (stages + 0.5)) for k in range(stages, 0, -1)]
    roots = [mp.findroot(functools.partial(mp.legendre, stages), (x, x + 0.001)) for x in guesses]
    c = [(1 + root) / 2 for root in roots]
    other_nodes = [[node for k, node in enumerate(c) if k != j] for j in range(stages)]
    tops = [mp.fprod(c[j] - node for node in other_nodes[j]) for j in range(stages)]
    b = [_antiderivative(other_nodes[j], mp.one) / tops[j] for j in range(stages)]
    mu, predict = np.full((stages, stages), 0.5), np.empty((stages, stages))
    for i in range(stages):
        for j in range(stages):
            basis = mp.fprod(1 + c[i] - node for node in other_nodes[j]) / tops[j]
            predict[i, j] = float(b[i] / b[j] * basis)
            if i > j:  # the larger of the pair, mu_ij; 1 - mu_ij is then exact (Sterbenz)
                mu[i, j] = float(_antiderivative(other_nodes[j], c[i]) / tops[j] / b[j])
                mu[j, i] = 1.0 - mu[i, j]
    return GaussRule(mu, np.array([float(value) for value in b]), predict)


@register_jitable
def stage_weights(rule: Any, h: float, weights: Any) -> None:
    """Fill in h b_i."""
    stages, inner = len(rule.b), 0.0
    for i in range(stages):
        weights[i] = h * rule.b[i]
    if stages > 2:  # the two ends take the rounding of the inner weights, so that the sum is h
        for i in range(1, stages - 1):
            inner += weights[i]
        weights[0] = weights[stages - 1] = 0.5 * (h - inner)


@register_jitable
def momentum_unit(par: Any, state: Any) -> float:
    """1/|L|, the unit in which corrections of L are judged."""
    momentum = np.sqrt(state[3] ** 2 + state[4] ** 2 + state[5] ** 2) + np.sqrt(par.I1 * abs(par.mgl))
    return 1.0 / momentum if momentum > 0.0 else 1.0


@register_jitable
def _body_unit(par: Any, state: Any) -> float:
    """`momentum_unit` of a body without symmetry, from M."""
    pull = par.I2 * np.sqrt(par.c1**2 + par.c2**2 + par.c3**2)
    momentum = np.sqrt(state[4] ** 2 + state[5] ** 2 + state[6] ** 2) + np.sqrt(pull)
    return 1.0 / momentum if momentum > 0.0 else 1.0


@register_jitable
def farthest(sweeps: int) -> float:
    """The size of a correction, after so many sweeps, above which one that does not fall will not converge."""
    return FARTHEST * PACE**sweeps


def _chain(first: Any, second: Any) -> Any:
    """A function that applies `first` and then `second` to a block."""

    @register_jitable
    def run(block, table):  # type: ignore[no-untyped-def]
        wide_vectors()
        first(block, table)
        second(block, table)

    return run


def _sweep_lanes(  # noqa: C901  (the loops of one step, read in one piece)
    field: Callable[..., Any], top: Any, mu: tuple[tuple[float, ...], ...], predict: tuple[tuple[float, ...], ...],
    dimension: int, first: int, still: int, unit: Callable[..., float],
) -> Lanes:  # fmt: skip
    """A Gauss method in lanes: `mu` and `predict` as `GaussRule` has them, the others as `_loop`."""
    stages, tops = len(mu), len(top._fields)
    flag, work, carry_at = 3 * dimension, 3 * dimension + 1, 3 * dimension + 2
    carry = stages * dimension + 1  # the L_i and the unit
    unit_at = carry_at + carry - 1
    gap_at, pull_at, last_at, live_at = range(unit_at + 1, unit_at + 5)
    zero_carry, state_at, top_at, weighted = (0.0,) * carry, reading(dimension), reading(tops), dot_of(stages)
    sum_of = total(lambda i: lambda increments: increments[i], stages)

    # number m of every L_i, of the next step's L_i, and of the state at a stage
    increments = each(lambda i: lambda block, m, j: block[(carry_at + i * dimension + m) * W + j], stages)
    continued = each(lambda i: lambda last: weighted(predict[i], last), stages)

    def displaced(m: int) -> Any:
        if m == still:
            return lambda _row, state, _block, _j: state[m]
        return lambda row, state, block, j: state[m] + weighted(row, increments(block, m, j))

    place = each(displaced, dimension)
    update = each(
        lambda m: lambda live, weight, slope, old: weight * slope[m] if live and m != still else old[m], dimension
    )
    increment = each(lambda m: lambda block, j: sum_of(0.0, increments(block, m, j)), dimension)

    def extrapolation(m: int) -> Any:
        @register_jitable
        def extrapolated(block, table):  # type: ignore[no-untyped-def]
            wide_vectors()
            for j in range(W):
                values = continued(increments(block, m, j))
                for i in range(stages):
                    block[(carry_at + i * dimension + m) * W + j] = values[i]

        return extrapolated

    def stage(i: int) -> Any:
        row, row_at = mu[i], carry_at + i * dimension

        @register_jitable
        def sweep_stage(block, table):  # type: ignore[no-untyped-def]
            wide_vectors()
            for j in range(W):
                y = place(row, state_at(block, 0, j), block, j)
                slope, old = field(top(*top_at(table, 0, j)), y), state_at(block, row_at, j)
                new = update(block[live_at * W + j] != 0.0, table[(tops + i) * W + j], slope, old)
                gap = 0.0 if i == 0 else block[gap_at * W + j]
                pull = 0.0 if i == 0 else block[pull_at * W + j]
                for m in range(first):
                    gap = max(gap, abs(new[m] - old[m]))
                for m in range(first, first + 3):
                    pull = max(pull, abs(new[m] - old[m]))
                for m in range(first + 3, dimension):
                    gap = max(gap, abs(new[m] - old[m]))
                put(block, row_at, j, new)
                block[gap_at * W + j] = gap
                block[pull_at * W + j] = pull

        return sweep_stage

    extrapolate = functools.reduce(_chain, [extrapolation(m) for m in range(dimension) if m != still])
    sweep = functools.reduce(_chain, map(stage, range(stages)))

    def step(block, table):  # type: ignore[no-untyped-def]
        wide_vectors()
        extrapolate(block, table)
        for j in range(W):
            block[last_at * W + j] = np.inf
            block[live_at * W + j] = 1.0 - block[flag * W + j]
        effort = 0
        while effort < MOST_SWEEPS:
            sweep(block, table)
            effort += 1
            limit = farthest(effort)
            for j in range(W):
                correction = max(block[gap_at * W + j], block[pull_at * W + j] * block[unit_at * W + j])
                live, falls = block[live_at * W + j], 0.0 < correction < block[last_at * W + j]
                goes_on = falls or (correction >= ROUND_OFF and correction <= limit)
                valid = goes_on or correction < ROUND_OFF
                block[work * W + j] += live
                block[last_at * W + j] = correction
                block[flag * W + j] = block[flag * W + j] if valid or live == 0.0 else 1.0
                block[live_at * W + j] = live if goes_on else 0.0
            if none_left(block, live_at):
                break
        for j in range(W):
            dstate = increment(block, j)
            success = np.isfinite(dstate[0]) and block[live_at * W + j] == 0.0
            move(accumulate, block, dimension, j, dstate)
            block[flag * W + j] = block[flag * W + j] if success else 1.0

    def lay(par, rule, h, numbers):  # type: ignore[no-untyped-def]
        stage_weights(rule, h, numbers)

    def begin(par, rule, state, h):  # type: ignore[no-untyped-def]
        shares, slope, values = np.empty(stages), field(par, state), zero_carry
        stage_weights(rule, h, shares)
        for i in range(stages):
            for m in range(dimension):
                values = set_item(values, i * dimension + m, shares[i] * slope[m])
        return set_item(values, carry - 1, unit(par, state))

    return Lanes(step, lay, lambda _: 0.0, lambda _: stages, top, dimension, carry, room=lambda _: 4, begin=begin)


def _loop(  # noqa: C901
    field: Any, dimension: int, first: int = 3, still: int = STILL_COMPONENT, unit: Any = momentum_unit,
    solve: Any = solve_stages, observe: Any = observe_axis, top: Any = SpaceTop,
) -> Loop:  # fmt: skip
    """The loop on states that move by `field`, a momentum from `first` on and, in `still`, a number that has no slope.

    It counts sweeps and iterations of Newton. A step is one function, because numba counts references to an array at
    each call. The largest correction is kept for the momentum and for the rest, and not for each component, as there
    are too few registers.
    """

    def begin(par, rule, state, h):  # type: ignore[no-untyped-def]
        """One array for all that a step reads and writes, because numba counts references to each.

        Of its rows 0 .. s-1 hold L_i and then h b_i; s .. 2s-1 are room for the prediction; 2s .. 3s-1 hold mu, and
        then have room for Newton's nu; 3s .. 4s-1 hold the predictor; row 4s begins with 1/|L|, the unit in
        which corrections of L are judged; the last 3s are room for Newton's equations. L_i starts as h b_i f(y).
        """
        stages = len(rule.b)
        work = np.empty((7 * stages + 1, max(dimension + 1, 3 * stages + 1)))
        stage_weights(rule, h, work[:stages, dimension])
        work[4 * stages, 0] = unit(par, state)
        slope = field(par, state)
        for i in range(stages):
            for m in range(dimension):
                work[i, m] = work[i, dimension] * slope[m]
            for j in range(stages):
                work[2 * stages + i, j] = rule.mu[i, j]
                work[3 * stages + i, j] = rule.predict[i, j]
        return work

    def increment(par, rule, state, work, h):  # type: ignore[no-untyped-def]  # noqa: C901  (one loop, read in one piece)
        stages, zeros = len(work) // 7, zero(state)
        for i in range(stages):  # the last step's polynomial, evaluated at this step's nodes
            guess = zeros
            for j in range(stages):
                weight = work[3 * stages + i, j]
                for m in range(dimension):
                    if m != still:
                        guess = set_item(guess, m, guess[m] + weight * work[j, m])
            for m in range(dimension):
                work[stages + i, m] = guess[m]
        for i in range(stages):
            for m in range(dimension):
                work[i, m] = work[stages + i, m]
        last, effort, outcome = np.inf, 0, NOT_CONVERGED
        while effort < MOST_SWEEPS:
            gap = gap_momentum = 0.0
            for i in range(stages):
                place = zeros
                for j in range(stages):
                    weight = work[2 * stages + i, j]
                    for m in range(dimension):
                        if m != still:
                            place = set_item(place, m, place[m] + weight * work[j, m])
                for m in range(dimension):
                    place = set_item(place, m, state[m] + place[m])
                slope = field(par, place)
                for m in range(dimension):
                    if m == still:
                        continue
                    value = work[i, dimension] * slope[m]
                    change = abs(value - work[i, m])
                    if first <= m < first + 3:
                        gap_momentum = max(gap_momentum, change)
                    else:
                        gap = max(gap, change)
                    work[i, m] = value
            effort += 1
            correction = max(gap, gap_momentum * work[4 * stages, 0])
            if not 0.0 < correction < last:
                if correction < ROUND_OFF:
                    outcome = OK
                    break
                if not correction <= farthest(effort):
                    break
            last = correction
        if outcome != OK:
            iterations, converged = solve(field, par, state, work, stages)
            effort += iterations
            if converged:
                outcome = OK
        step = zeros
        for i in range(stages):
            for m in range(dimension):
                step = set_item(step, m, step[m] + work[i, m])
        return step, work, effort, outcome if np.isfinite(step[0]) else NOT_CONVERGED

    @functools.cache
    def lanes_of(mu: Any, predict: Any) -> Lanes:
        return _sweep_lanes(field, top, mu, predict, dimension, first, still, unit)

    def in_lanes(rule: GaussRule) -> Lanes:
        return lanes_of(*(tuple(map(tuple, rows.tolist())) for rows in (rule.mu, rule.predict)))

    return Loop(begin, increment, observe, lanes=in_lanes)


# `solve` of a loop without Newton's iteration: no iterations, not converged
_unsolved = register_jitable(lambda _field, _par, _state, _work, _stages: (0, False))
march_axis, march_frame = _loop(field_axis, 6), _loop(field_frame, 9)
march_body = _loop(body.field_body, 7, 4, -1, _body_unit, _unsolved, body.observe_body, body.General)


RULES = {stages: LazyRule(functools.partial(gauss_rule, stages), packed) for stages in STAGES}


def built_in() -> list[Integrator]:
    """gauss-2, gauss-4, ... gauss-12, named after their orders; coefficients are computed at the first run."""
    return [
        Integrator(
            name=f"gauss-{2 * stages}", family="runge-kutta",
            summary=f"Gauss collocation with {stages} stage{'s' if stages > 1 else ''} on the space-frame equations",
            solvers={
                "axis": FixedStep(march_axis, rule, space.on_axis, stages, implicit=True),
                "attitude": FixedStep(
                    march_frame, rule, space.on_frame, stages, implicit=True, present=space.frame_to_attitude
                ),
                BODY: FixedStep(march_body, rule, body.on_body, stages, implicit=True),
            },
            order=2 * stages, explicit=False, symplectic=False, symmetric=True,
            conserves=frozenset({"energy", "p_phi", "p_psi", "axis_length"}),
            reference="butcher-1964 hairer-mclachlan-razakarivony-2008", needs="derivative", general=True,
        )
        for stages, rule in RULES.items()
    ]  # fmt: skip
