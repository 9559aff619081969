"""Adams methods of variable order and step, predict, evaluate, correct, evaluate, after Shampine and Gordon: `adams`.

With psi_i = t_{n+1} - t_{n+1-i}, alpha_i = h/psi_i, beta_1 = 1, beta_i = beta_{i-1} psi_{i-1}/psi_{i-1} (one step ago),
and the modified divided differences phi_1 = f_n, phi_{i+1} = phi_i - phi*_i (one step ago), phi*_i = beta_i phi_i:

    p = y_n + h sum_{i<=k} g_i phi*_i,    d = f(p) - sum_{i<=k} phi*_i,    y_{n+1} = p + h g_{k+1} d,    f(y_{n+1})
    g_i = w_i1,    w_1q = 1/q,    w_2q = 1/(q (q+1)),    w_{i+1,q} = w_iq - alpha_i w_{i,q+1}
    error of the step: h |g_k - g_{k+1}| |d|;    with order j and steps of one length: h sigma_j |gamma*_j phi_{j+1}|

It predicts with order k = 1 .. 12 and corrects with order k + 1. The run starts with order 1 and raises order and step
together until an error is too large; then the order is the one with the least error, raised only after k + 1 steps of
one length, and in every second step at most. Norm and first step are those of `pairs`. h is kept, doubled if the error
allows it, or multiplied by 0.5 to 0.9; doubled steps are what keeps the g_i (after k of them they are constants). Two
evaluations a step, one for a step that is rejected. A sample is y_{n+1} and the integral back from there of the
polynomial through f(y_{n+1}) and the k values of f before it; it takes no evaluation.

Explicit, with a memory of up to twelve steps: what is defined by the map of one step (symplectic, symmetric, its order
by a fixed step) is not claimed of it. Not to be confused with Nordsieck forms (LSODA, VODE), which change the length of
a step by interpolation.
Source: Shampine, Gordon, Computer Solution of Ordinary Differential Equations (1975), the code STEP/DE; Hairer,
Norsett, Wanner, Solving Ordinary Differential Equations I, section III.5 and III.7.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from symtop.core.jit import register_jitable
from symtop.methods.framework.plan import OK, STEP_TOO_SMALL
from symtop.methods.framework.registry import Integrator
from symtop.methods.runge_kutta.explicit import add, row_of, store
from symtop.methods.runge_kutta.pairs import Method, integrator, nothing_more, rms
from symtop.methods.vectors import zero

HIGHEST = 12  # the largest k
MOST_FAILURES = 2000  # of a step: one that is rounded up to its length before halving would be tried for ever
SUMS, NUMBERS = HIGHEST + 2, 2 * HIGHEST + 2  # rows of the memory: phi, then sums of phi*, then numbers of order i
PSI, G, ALPHA, BETA, SIGMA, WORK = range(6)  # columns of the rows of numbers
LAST = NUMBERS + HIGHEST + 2  # the row on the last step, with the columns:
ORDER, ORDER_THEN, SAME, LENGTH, SETTLED = range(5)  # next k, its k, steps of its length, its length, start is over

gamma = [1.0]  # gamma*_j, whose sizes are the error constants of Adams-Moulton methods with steps of one length
for j in range(1, HIGHEST + 2):
    gamma.append(-sum(value / (j + 1 - i) for i, value in enumerate(gamma)))
GAMMA = tuple(map(abs, gamma))


@register_jitable
def coefficients(memory: Any, k: int, h: float) -> None:
    """alpha, beta, g and sigma of a step h; the memory has the psi of the step before."""
    n, psi, before, beta, sigma = NUMBERS, 0.0, 0.0, 1.0, 1.0
    for i in range(k):
        if i > 0:
            before = memory[n + i - 1, PSI]
            beta *= psi / before
        psi = before + h
        memory[n + i, ALPHA], memory[n + i, BETA], memory[n + i, SIGMA] = h / psi, beta, sigma
        memory[n + i, WORK] = 1.0 / ((i + 1) * (i + 2))
        sigma *= (i + 1) * (h / psi)
    memory[n + k, SIGMA], memory[n, G], memory[n + 1, G] = sigma, 1.0, 0.5
    for i in range(2, k + 1):
        for q in range(k + 1 - i):
            memory[n + q, WORK] -= memory[n + i - 1, ALPHA] * memory[n + q + 1, WORK]
        memory[n + i, G] = memory[n, WORK]


@register_jitable
def update(memory: Any, last: Any, k: int, h: float) -> None:
    """The differences phi and the psi after a step, where f - sum phi* is `last`."""
    store(memory, k + 1, add(last, row_of(memory, k, last), -1.0))
    store(memory, k, last)
    for i in range(k):
        store(memory, i, add(last, row_of(memory, SUMS + i, last), 1.0))
    for i in range(HIGHEST + 1, 0, -1):
        memory[NUMBERS + i, PSI] = memory[NUMBERS + i - 1, PSI] + h
    memory[NUMBERS, PSI] = h


def method(field: Callable[..., Any]) -> Method:  # noqa: C901  (one step, read in one piece)
    """The `Method` for `pairs.loop`."""

    @register_jitable
    def advance(par, state, memory, tolerance, t, step, end):  # type: ignore[no-untyped-def]  # noqa: C901
        shortest, grid = 10.0 * (np.nextafter(t, np.inf) - t), 1.5 * end
        k, failures, evaluations, step = max(int(memory[LAST, ORDER]), 1), 0, 0, max(step, shortest)
        settled = memory[LAST, SETTLED] != 0.0
        while step >= shortest and failures < MOST_FAILURES:
            h = (grid + step) - grid  # so that t + h is exact and steps of one length stay so
            h = max(shortest, h if h > 0.0 else step)
            after = min(t + h, end)
            h = h if after < end else end - t
            count = min(memory[LAST, SAME], memory[LAST, ORDER_THEN]) + 1.0 if h == memory[LAST, LENGTH] else 1.0
            if count <= k or k != memory[LAST, ORDER_THEN] or failures > 0:
                coefficients(memory, k, h)
            total = place = zero(state)
            for i in range(k - 1, -1, -1):
                beta, phi = memory[NUMBERS + i, BETA], row_of(memory, i, state)
                total, place = add(total, phi, beta), add(place, phi, beta * memory[NUMBERS + i, G])
                store(memory, SUMS + i, total)
            place = add(state, place, h)
            change = add(field(par, place), total, -1.0)
            evaluations += 1
            size = h * rms(change, state, place, tolerance)
            error, below, lower = size * memory[NUMBERS + k, SIGMA] * GAMMA[k], np.inf, np.inf
            for i in range(1, min(k, 3)):
                part = rms(add(change, row_of(memory, SUMS + k - i, state), 1.0), state, place, tolerance)
                part *= h * memory[NUMBERS + k - i, SIGMA] * GAMMA[k - i]
                below, lower = (part, 2.0 * part) if i == 1 else (below, max(below, part))
            down = lower <= error
            settled = settled or down or k == HIGHEST
            if size * abs(memory[NUMBERS + k - 1, G] - memory[NUMBERS + k, G]) < 1.0:
                new = add(place, change, h * memory[NUMBERS + k, G])
                update(memory, add(field(par, new), total, -1.0), k, h)
                order, step = k, h
                if not settled:
                    order, error = k + 1, 0.0
                elif down:
                    order, error = k - 1, below
                elif count > k:
                    above = h * GAMMA[k + 1] * rms(row_of(memory, k + 1, state), state, new, tolerance)
                    if k > 1 and below <= min(error, above):
                        order, error = k - 1, below
                    elif k < HIGHEST and above < (error if k > 1 else 0.5 * error):
                        order, error = k + 1, above
                if error * 2.0 ** (order + 1) <= 0.5:
                    step = 2.0 * h
                elif error > 0.5:
                    step = h * max(0.5, min(0.9, (0.5 / error) ** (1.0 / (order + 1))))
                memory[LAST, ORDER], memory[LAST, ORDER_THEN], memory[LAST, SAME] = order, k, count
                memory[LAST, LENGTH], memory[LAST, SETTLED] = h, 1.0 if settled else 0.0
                return new, after, step, evaluations + 1, OK
            settled, failures = True, failures + 1
            factor = math.sqrt(0.5 / error) if failures > 3 and error > 2.0 else 0.5
            k, step = 1 if failures > 2 else k - 1 if down else k, factor * h
        return state, t, step, evaluations, STEP_TOO_SMALL

    @register_jitable
    def sample(par, state, new, memory, h, x):  # type: ignore[no-untyped-def]
        if x == 0.0:  # the start of the run, to which the polynomial does not lead back
            return state
        back, previous, g, place = (x - 1.0) * h, 0.0, 1.0, zero(state)
        terms = int(memory[LAST, ORDER_THEN]) + 1
        for q in range(terms):
            memory[NUMBERS + q, WORK] = 1.0 / (q + 1)
        for i in range(terms):
            if i > 0:
                psi = memory[NUMBERS + i - 1, PSI]
                for q in range(terms - i):
                    value = (back + previous) * memory[NUMBERS + q, WORK] - back * memory[NUMBERS + q + 1, WORK]
                    memory[NUMBERS + q, WORK] = value / psi
                g, previous = memory[NUMBERS, WORK], psi
            place = add(place, row_of(memory, i, state), g)
        return add(new, place, back)

    return Method(advance, nothing_more, sample, 0, -0.5)


def built_in() -> list[Integrator]:
    """`adams`."""
    summary = "Adams methods of order 2 to 13 and variable step (Shampine-Gordon), compiled"
    return [integrator("adams", summary, "shampine-gordon-1975", method, LAST + 1)]
