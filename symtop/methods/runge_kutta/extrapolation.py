"""Extrapolation of the modified midpoint rule (Gragg, Bulirsch, Stoer) with variable order and step, compiled.

    T_j1:  y_1 = y + g f(y),  y_{i+1} = y_{i-1} + 2 g f(y_i),  T_j1 = y_{n_j},   g = h/n_j,  n_j = 2, 4, 6, ...
    T_j,l+1 = T_jl + (T_jl - T_{j-1,l}) / ((n_j / n_{j-l})^2 - 1),    err_j = |T_jj - T_j,j-1| as in `pairs`

T_jj has order 2 j. A step is tried with k - 1, k and k + 1 lines and ends with the first whose error passes, or when
that of line k - 1 or k is above ((k+1) k)^2 or (k+1)^2. With A_j evaluations for j lines and the step that line j would
allow, H_j = .94 h (.65/err_j)^(1/(2j-1)) within [.02, 10] h, the next k is m = min(j, k) of the j lines made, m - 1 if
its work A_j/H_j is a tenth less than that of m, and m + 1 if that of m is a tenth less than that of m - 1 and no try
was rejected, from 3 to 9. ODEX has .8 for the first, other limits, and looks at the work of line k + 1 where that was
computed. The next step is H_k, or for k above j as long for its work as with j, H_j A_k/A_j; a rejected one is repeated
with that or .9 h, the shorter. The first k is 1.5 - .6 log10(tolerance), at most 8; the first h is that of `pairs`.
Samples inside a step are shorter steps with as many lines, which are not counted. Explicit, neither symplectic nor
symmetric; nothing is conserved but what is linear in the state. No smoothing step: all n_j are even.
Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, section II.9 (their code is ODEX).
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from symtop.core.jit import register_jitable, set_item
from symtop.methods.framework.plan import OK, STEP_TOO_SMALL
from symtop.methods.framework.registry import Integrator
from symtop.methods.runge_kutta.explicit import add, row_of, store
from symtop.methods.runge_kutta.pairs import GROW, Method, integrator, nothing_more, rms

LINES = 10  # limit on the lines, so that k is at most 9
LEAST_K = 3  # the least k
ORDERS, LAST = LINES + 1, LINES + 2  # rows of the memory: k and the number of lines of the last step; f at its end


def method(field: Callable[..., Any]) -> Method:  # noqa: C901  (one step, read in one piece)
    """The `Method` for `pairs.loop`: rows 1 .. `LINES` of the memory are the last line of the table."""

    @register_jitable
    def line(par, state, table, j, h):  # type: ignore[no-untyped-def]
        """Fill in line j of the table over line j - 1: T_jj, and T_jj - T_j,j-1."""
        g = h / (2 * j)
        before, current = state, add(state, row_of(table, 0, state), g)
        for _ in range(2 * j - 1):
            before, current = current, add(before, field(par, current), 2.0 * g)
        change = current
        for m in range(len(state)):
            value, low = current[m], 0.0
            for i in range(1, j):
                above, table[i, m] = table[i, m], value
                low = (value - above) / ((j / (j - i)) ** 2 - 1.0)
                value += low
            table[j, m] = value
            current, change = set_item(current, m, value), set_item(change, m, low)
        return current, change

    @register_jitable
    def advance(par, state, table, tolerance, t, step, end):  # type: ignore[no-untyped-def]
        shortest = 10.0 * (np.nextafter(t, np.inf) - t)
        step, evaluations, growth = max(step, shortest), 0, GROW
        k = int(table[ORDERS, 0])
        if k == 0:  # the first step
            k = max(LEAST_K, min(LINES - 2, int(1.5 - 0.6 * math.log10(tolerance))))
        lengths, work = np.full(LINES + 1, 1.0), np.full(LINES + 1, np.inf)  # H_j and A_j/H_j
        while step >= shortest:
            after = min(t + step, end)
            h = after - t
            new, j, error = state, 0, np.inf
            while j <= k and (j < k - 1 or error >= 1.0):
                j += 1
                new, change = line(par, state, table, j, h)
                evaluations += 2 * j - 1
                if j > 1:
                    error = rms(change, state, new, tolerance)
                    factor = GROW if error == 0.0 else 0.94 * (0.65 / error) ** (1.0 / (2 * j - 1))
                    lengths[j] = h * (min(factor, GROW) if factor > 0.02 else 0.02)
                    work[j] = (1 + j * j) / lengths[j]
                if (j == k - 1 and error > ((k + 1.0) * k) ** 2) or (j == k and error > (k + 1.0) ** 2):
                    break
            best = min(j, k)
            if work[best - 1] < 0.9 * work[best]:
                best -= 1
            elif error < 1.0 and growth > 1.0 and work[best] < 0.9 * work[best - 1]:
                best += 1
            best = max(LEAST_K, min(LINES - 1, best))
            step = lengths[min(j, best)]
            if best > j:  # as long as with j lines for the same work
                step *= (1.0 + best * best) / (1.0 + j * j)
            table[ORDERS, 0], table[ORDERS, 1] = best, j
            if error < 1.0:
                store(table, LAST, field(par, new))
                return new, after, min(step, growth * h), evaluations + 1, OK
            k, growth, step = best, 1.0, min(step, 0.9 * h)
        return state, t, step, evaluations, STEP_TOO_SMALL

    @register_jitable
    def sample(par, state, new, table, h, x):  # type: ignore[no-untyped-def]
        if x == 1.0:
            return new
        scratch = table.copy()
        for j in range(1, int(table[ORDERS, 1]) + 1):
            new, _ = line(par, state, scratch, j, x * h)
        return new

    return Method(advance, nothing_more, sample, LAST, -0.2)


def built_in() -> list[Integrator]:
    """The method of Gragg, Bulirsch and Stoer."""
    summary, sources = "Gragg-Bulirsch-Stoer extrapolation of variable order and step, compiled", "bulirsch-stoer-1966"
    sources += " hairer-norsett-wanner-1993"
    return [integrator("extrapolation", summary, sources, method, LAST + 1, symplectic=False, symmetric=False)]
