"""Newton's iteration of an implicit kernel: one loop for all of them, inlined where it is called.

    x <- x + c(x),    c(x) = -F'(x)^-1 F(x)        until |c| is small enough or no longer falls

A kernel supplies three functions of `problem`, a tuple of whatever they need; x is a float or a tuple of floats:

    evaluate(problem, x) -> trial             what the equations are made of at x: sums, forces and their slopes
    correct(problem, trial, x) -> Correction
    restart(problem) -> x                     another first guess, taken once, after half of the evaluations

The iteration ends where ``size <= enough``, or where a correction of at most `grain` did not even halve: that is
rounding, which Newton cannot lower. The last correction is *not* applied: the caller has the trial at x and may follow
it to first order, which saves one evaluation a step. A predicted x is good to many digits, but in a large step it may
lie outside the basin of the root; hence `restart`.

The functions are arguments and everything is inlined, so that each kernel compiles to what it was when the loop stood
in it, and returns the same bits. numba caches it on disk as before: what passes the functions is itself compiled. Time
of a step, beside the loop written out in each kernel: midpoint 87 against 88 ns, midpoint-unreduced 164 against 165 ns,
galerkin-simpson 140 against 141 ns, trapezoidal 96 against 95 ns (noise about 2 ns).
"""

from typing import Any, NamedTuple

import numpy as np

from symtop.core.jit import register_jitable

NEGLIGIBLE_ANGLE = 1e-18  # radians: no correction below this can matter to an angle
ANGLE_GRAIN = 1e-12  # radians: a smaller correction that does not halve is rounding (a steady precession has no other)


class Correction(NamedTuple):
    """What Newton proposes at x, and how it is judged."""

    change: Any  # like x
    after: Any  # x + change
    size: float  # |change|
    enough: float  # converged at this size or below
    grain: float  # at this size or below, a correction that does not halve is rounding


class Solution(NamedTuple):
    """Where the iteration ended; `x` lacks the last correction."""

    x: Any
    trial: Any  # at x
    correction: Correction
    evaluations: int
    converged: bool


@register_jitable
def settled(correction: Any, last: float) -> Any:
    """Is this correction the last one, after one of size `last`?"""
    size: float = correction.size
    return size <= correction.enough or 0.5 * last <= size <= correction.grain


@register_jitable
def newton(evaluate: Any, correct: Any, restart: Any, problem: Any, guess: Any, most: int) -> Any:
    """Solve from a first guess with at most so many evaluations."""
    x = guess
    trial = evaluate(problem, x)
    evaluations = 1
    size = np.inf
    while True:
        correction = correct(problem, trial, x)
        last, size = size, correction.size
        converged = settled(correction, last)
        if converged or evaluations >= most:
            return Solution(x, trial, correction, evaluations, converged)
        x = restart(problem) if evaluations == most // 2 else correction.after
        trial = evaluate(problem, x)
        evaluations += 1
