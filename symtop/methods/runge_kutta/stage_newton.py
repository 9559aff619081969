"""Newton's iteration for the stages of a Gauss step on (e, L) or (e, L, a), where sweeps do not converge.

    K_i = w_i f(y_i),  y_i = y + sum_j mu_ij K_j,  w_i = h b_i,       f: e' = L x e/I1,  L' = mgl z x e,  a' = L x a/I1

L' is linear in e alone: the increments of e give those of L exactly, and what remains are 3 s equations for the x_i,
the increments of e, quadratic in them. Their Jacobian is exact, with nu = mu diag(w) mu and e_i, L_i at the stage,

    dx_i - (w_i/I1) sum_k (mu_ik L_i x dx_k + mgl nu_ik ((z.e_i) dx_k - z (e_i.dx_k))) = w_i L_i x e_i/I1 - x_i

and is solved by elimination with pivots, 18 x 18 at most. The increments of a follow with L_i given: the same equations
without mgl, now linear, so that two iterations end them.

Newton starts from e_i = e at every stage, since the polynomial of the step before says nothing about a step so large. A
correction of 1e-9 is the last, for it leaves its square. Where this does not converge in 12 iterations, the solution is
followed from a tenth of the step to all of it, each time 1.09 times further. Measured at h omega = 2, 5 and 10 from
1000 states of each of 11 scenes with 1, 2, 3 and 6 stages: every step is solved, the first way 100 %, 94 % and 74 % of
them, with 2 to 10 iterations, the second way the others, with 40 to 80. What stays unsolved has a path that turns back
before the whole step: slow tops that swing widely, at steps of a nutation and more, 1 to 3 % of the runs in the maps of
the `stability` study up to two nutations a step. With sweeps alone it would be 20 to 39 %.

The work counted is iterations, each of which evaluates f once a stage; the Jacobian and the elimination count nothing
and show in the time alone. An iteration takes 65 ns (s = 1) to 1300 ns (s = 6), the time of 7 to 18 sweeps. Source:
Hairer, Wanner, Solving Ordinary Differential Equations II, IV.8; Allgower, Georg, Introduction to Numerical
Continuation Methods, chapter 2.
"""

from typing import Any

from symtop.core.jit import register_jitable, set_item

ENOUGH = 1e-9  # a correction in units of |e| = 1, whose square is below rounding
NEAR = 0.1  # a correction after which the solution is followed to a longer step
DIRECT = 12  # iterations for one length of the step, 2 to 7 where they converge soon
RUNGS = 28  # steps of growing length up to the whole one, by `LONGER` each: from a tenth
LONGER = 2.0**0.125  # with sqrt 2 one step in ten of `spheroid` is lost at h omega = 10, with 2^(1/4) one in a hundred


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
def _pull(field: Any, par: Any, state: Any, work: Any, stages: int, share: float) -> None:
    """The increments of L that belong to those of e."""
    for i in range(stages):
        slope = field(par, _at_stage(state, work, stages, i))
        for m in range(3, 5):
            work[i, m] = share * work[i, len(state)] * slope[m]


@register_jitable
def _linearise(field: Any, par: Any, state: Any, work: Any, stages: int, share: float, first: int, mgl: float) -> None:
    """The equations for corrections of the three components from `first` on, and what they must make up for."""
    base = 4 * stages + 1
    for i in range(stages):
        place = _at_stage(state, work, stages, i)
        slope = field(par, place)
        weight = share * work[i, len(state)]
        row, turn = base + 3 * i, weight / par.I1
        for k in range(stages):
            column, same = 3 * k, 1.0 if i == k else 0.0
            swing, lift = turn * work[2 * stages + i, k], share * turn * mgl * work[2 * stages + i, stages + k]
            x, y, z = swing * place[3], swing * place[4], swing * place[5]
            work[row, column], work[row, column + 1], work[row, column + 2] = same - lift * place[2], z, -y
            work[row + 1, column], work[row + 1, column + 1], work[row + 1, column + 2] = -z, same - lift * place[2], x
            work[row + 2, column] = y + lift * place[0]
            work[row + 2, column + 1] = lift * place[1] - x
            work[row + 2, column + 2] = same
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
    field: Any, par: Any, state: Any, work: Any, stages: int, share: float, first: int, mgl: float, enough: float
) -> Any:
    """Newton from the increments as they are, for a share of the step: iterations, and did they converge."""
    base, effort, converged = 4 * stages + 1, 0, False
    while True:
        _pull(field, par, state, work, stages, share)
        if converged or effort == DIRECT:
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
        converged = correction <= enough  # false if it is not a number


@register_jitable
def _twice(work: Any, dimension: int, stages: int) -> None:
    """nu = mu diag(w) mu, made by each solve: in the preparation, 216 products at s = 6, every run would pay for it."""
    for i in range(stages):
        for j in range(stages):
            total = 0.0
            for k in range(stages):
                total += work[2 * stages + i, k] * work[k, dimension] * work[2 * stages + k, j]
            work[2 * stages + i, stages + j] = total


@register_jitable
def solve_stages(field: Any, par: Any, state: Any, work: Any, stages: int) -> Any:
    """Solve a step in the array of `symtop.methods.runge_kutta.gauss.working_space`: iterations, and did they converge.

    `_iterate` stands here once, because all of it is inlined: three times, compilation takes seconds longer.
    """
    effort, rung, first, mgl, grown = 0, RUNGS, 0, par.mgl, False
    _twice(work, len(state), stages)
    for i in range(stages):
        for m in range(len(state)):
            work[i, m] = 0.0
    while True:
        enough = ENOUGH if rung == RUNGS else NEAR
        more, converged = _iterate(field, par, state, work, stages, LONGER ** (rung - RUNGS), first, mgl, enough)
        effort += more
        if converged and rung < RUNGS:
            rung += 1
        elif converged and first == 0 and len(state) > 6:
            first, mgl = 6, 0.0
        elif converged or grown or first > 0:
            return effort, converged
        else:  # from the start again, with a tenth of the step
            grown, rung = True, 1
            for i in range(stages):
                for m in range(3):
                    work[i, m] = 0.0
