"""The one stepping loop: compensated sums of increments, strided output, outcomes.

A kernel family is three plain functions on flat tuples of floats:

    begin(par, rule, state, h) -> carry                    what the first step may reuse
    increment(par, rule, state, carry, h) -> (dstate, carry, work, outcome)
    observe(par, rule, before, dstate, h) -> (p_phi, p_psi)  the momenta that this step really carried

and two more where what is stepped is not what is shown (a processed method, a motion that is known exactly):

    enter(par, rule, state, h) -> state                    the start as the kernel steps it, once a run
    present(par, rule, state, k, h) -> state               a sample as the user sees it, once a sample

`par` are the numbers of the top, `rule` the numbers of the method, `work` its force evaluations or solver
iterations. A kernel returns the *increment* of the state; the loop adds it with Knuth's two-sum and carries
the rounding error to the next step, which costs nothing (the loop is bound by the latency of the
kernel) and lowers the growth of round-off about 60-fold. Time is k h with h = T/N exactly, never accumulated.

A run that nobody interrupts is one compiled call from plain numbers to samples (`Loop.whole`), the preparation of the
kernel included: a run of one step takes a fifth of the time.

A loop can stop after any step and go on from there, now or in another process, to the same bits: a `Position` is all
that the next step depends on. Runs too long to wait for are made of such stretches (`symtop.run.long_run`).
Reference: Hairer, McLachlan, Razakarivony, Achieving Brouwer's law with implicit Runge-Kutta methods,
BIT 48 (2008) 231.
"""

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from symtop.core.jit import compile_kernel, register_jitable, set_item
from symtop.methods.framework.lanes import Lanes, marching as marching_lanes, preparing, showing
from symtop.methods.framework.many import Blocks
from symtop.methods.framework.plan import OK
from symtop.methods.framework.preparation import Body, Start, as_it_steps, conserved
from symtop.methods.vectors import accumulate, accumulate_plainly

Array = NDArray[np.float64]
Marks = NDArray[np.int64]

BLOCK = 5_000_000  # steps between returns to Python, so that an interrupt is heard within a second


class Position(NamedTuple):
    """Where a run stands: all that its next step depends on."""

    state: tuple[float, ...]
    low: tuple[float, ...]  # what the sums of the state have rounded off so far
    carry: Any  # floats in tuples or arrays, as the kernel's `begin` makes them
    k: int  # steps done


class March(NamedTuple):
    """What one run of a fixed-step kernel returns."""

    states: Array  # (samples, dimension), NaN after a failure
    momenta: Array  # (samples, 2): p_phi and p_psi recomputed from the increments
    steps: int  # completed since the start of the run
    work: int  # force evaluations or solver iterations, as the family counts them
    outcome: int  # index into OUTCOMES


@register_jitable
def no_carry(par: Any, rule: Any, state: Any, h: float) -> Any:
    """`begin` of a kernel whose step depends on its start alone; an empty tuple has no type of entry."""
    return (0.0,)


@register_jitable
def _as_given(par: Any, rule: Any, state: Any, h: float) -> Any:
    return state


@register_jitable
def as_stepped(par: Any, rule: Any, state: Any, k: int, h: float) -> Any:
    """`present` of a kernel whose state is shown as it is."""
    return state


@dataclass(frozen=True)
class Loop:
    """The loop around one kernel family, compiled when it is first used: ``loop(par, rule, state, h, marks)``.

    A run records the state after ``marks[j]`` steps for each j (increasing whole numbers; a mark at 0 records the
    start). `begun` and `advance` do the same in stretches, and the bits do not depend on where a stretch ends.
    ``whole(kind, prepare, scale, sample)`` is a run in one compiled call, from the plain numbers of
    `symtop.methods.framework.preparation` to filled arrays: ``run(numbers, rule, h, marks, states, momenta)``, with
    momenta (2, samples), returns steps, work and outcome. `lanes` is what the family has for a rule to run many
    members in lanes, if it has it, and ``blocks(lanes, ...)`` the kernels of that, from the same parts.
    """

    begin: Callable[..., Any]
    prepare: Callable[..., Any]
    march: Callable[..., Any]
    whole: Callable[..., Callable[..., tuple[int, int, int]]]
    lanes: Callable[[Any], Lanes | None]
    blocks: Callable[..., Blocks]
    plain: Callable[[], "Loop"]  # the same kernel with sums that are not compensated

    def __call__(self, par: Any, rule: Any, state: tuple[float, ...], h: float, marks: Marks) -> March:
        """From the start to the last mark."""
        return self.advance(par, rule, self.begun(par, rule, state, h), h, marks)[0]

    def begun(self, par: Any, rule: Any, state: tuple[float, ...], h: float) -> Position:
        """A run before its first step."""
        state, carry = self.prepare(par, rule, state, h)
        return Position(state, (0.0,) * len(state), carry, 0)

    def advance(self, par: Any, rule: Any, at: Position, h: float, marks: Marks) -> tuple[March, Position]:
        """On to the last mark; the marks lie beyond `at`, or begin with 0 at the start."""
        state, low, carry, k = at
        if isinstance(carry, np.ndarray):  # a kernel's working space: `at` stays what it is
            carry = carry.copy()
        states, momenta = np.empty((len(marks), len(state))), np.empty((2, len(marks)))
        states.fill(np.nan)
        momenta.fill(np.nan)
        j = work = outcome = 0
        while j < len(marks) and outcome == OK:
            stop = min(k + BLOCK, int(marks[-1]))
            state, low, carry, k, j, effort, outcome = self.march(
                par, rule, state, low, carry, h, k, j, stop, marks, states, momenta
            )
            work += effort
        return March(states, momenta.T, k, work, outcome), Position(state, low, carry, k)


def kernel_loop(  # noqa: C901  (one loop, read in one piece)
    begin: Callable[..., Any], increment: Callable[..., Any], observe: Callable[..., Any],
    enter: Callable[..., Any] = _as_given, present: Callable[..., Any] = as_stepped,
    add: Callable[..., Any] = accumulate, lanes: Callable[[Any], Lanes | None] = lambda _: None,
) -> Loop:  # fmt: skip
    """The loop around one kernel family; `add` is how increments are summed, `lanes` how it steps many, by its rule."""
    for part in (begin, increment, observe, enter, present):
        register_jitable(part)

    def prepare(par, rule, state, h):  # type: ignore[no-untyped-def]
        state = enter(par, rule, state, h)
        return state, begin(par, rule, state, h)

    def marching(sample: Callable[..., Any]) -> Callable[..., Any]:
        def march(par, rule, state, low, carry, h, k, j, stop, marks, states, momenta):  # type: ignore[no-untyped-def]
            work = 0
            outcome = 0
            before, dstate = state, state
            while j < len(marks):
                target = min(marks[j], stop)
                while k < target:
                    before = state
                    dstate, carry, effort, outcome = increment(par, rule, state, carry, h)
                    work += effort
                    if outcome != 0:
                        break
                    state, low = add(state, low, dstate)
                    k += 1
                if outcome != 0 or k < marks[j]:
                    break
                shown = sample(par, k * h, present(par, rule, state, k, h))
                for i in range(len(shown)):
                    states[j, i] = shown[i]
                if k > 0:
                    momenta[0, j], momenta[1, j] = observe(par, rule, before, dstate, h)
                j += 1
            return state, low, carry, k, j, work, outcome

        return march

    @functools.cache
    def whole(
        kind: Callable[..., Any], numbers: Callable[..., Any], scale: Callable[..., Any], sample: Callable[..., Any]
    ) -> Callable[..., tuple[int, int, int]]:
        march = register_jitable(marching(sample))

        def run(plain, coefficients, h, marks, states, momenta):  # type: ignore[no-untyped-def]
            top, at = Body(*plain[:3]), Start(*plain[3:])
            par, state = numbers(top, at)
            rule = scale(kind(coefficients), top, at, h)
            state = enter(par, rule, state, h)
            low = state
            for i in range(len(state)):
                low = set_item(low, i, 0.0)
            if marks[0] == 0:
                begun = conserved(top, at)
                momenta[0, 0], momenta[1, 0] = begun.p_phi, begun.p_psi
            carry, stop = begin(par, rule, state, h), marks[-1]
            _, _, _, k, j, work, outcome = march(par, rule, state, low, carry, h, 0, 0, stop, marks, states, momenta)
            states[j:] = np.nan
            momenta[:, max(j, int(marks[0] == 0)) :] = np.nan
            return k, work, outcome

        compiled: Callable[..., tuple[int, int, int]] = compile_kernel(run)
        return compiled

    @functools.cache
    def together(family: Lanes, kind: Any, numbers: Any, scale: Any, show: Any) -> Blocks:
        prepare = preparing(family, begin, enter, kind, numbers, scale)
        return Blocks(family, prepare, marching_lanes(family, observe, present, show))

    def blocks(family: Lanes, kind: Any, numbers: Any, scale: Any, sample: Any) -> Blocks:
        return together(family, kind, numbers, scale, family.show or showing(sample))

    @functools.cache
    def plain() -> Loop:
        return kernel_loop(begin, increment, observe, enter, present, accumulate_plainly)

    alone = compile_kernel(prepare), compile_kernel(marching(as_it_steps))
    return Loop(begin, *alone, whole, lanes, blocks, plain)
