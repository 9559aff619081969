"""The one stepping loop: compensated sums of increments, strided output, outcomes.

A kernel family is three plain functions on flat tuples of floats:

    begin(par, rule, state, h) -> carry                    numbers that the first step may reuse
    increment(par, rule, state, carry, h) -> (dstate, carry, work, outcome)
    observe(par, rule, before, dstate, h) -> (p_phi, p_psi)  recomputed from the increment of this step

and two more where the kernel's state differs from the one shown (a processed method, a motion that is known exactly):

    enter(par, rule, state, h) -> state                    the start as the kernel steps it, once a run
    present(par, rule, state, k, h) -> state               a sample as the user sees it, once a sample

`par` are the numbers of the top, `rule` those of the method, `work` force evaluations or solver iterations. A kernel
returns the *increment* of the state; the loop adds it with Knuth's two-sum and carries the rounding error to the next
step. That costs no time, as the latency of the kernel limits the loop. Time is k h, never accumulated.

A run of at most `BLOCK` steps is one compiled call from plain numbers to samples (`whole_run`), preparation included. A
loop can stop after any step and go on, in another process too, to the same bits: a `Position` is all that the next step
depends on (`symtop.run.long_run`).
Source: Hairer, McLachlan, Razakarivony, BIT 48 (2008) 231 (Brouwer's law).
"""

import functools
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any, NamedTuple, NoReturn

import numpy as np

from symtop.core.errors import SymtopError, shown
from symtop.core.jit import compile_kernel, register_jitable
from symtop.core.parallel import check_interrupt
from symtop.methods.framework import lanes as many, preparation
from symtop.methods.framework.lanes import Blocks, Ints, Lanes, Many
from symtop.methods.framework.plan import LEFT_CHART, OK, Array, Plan, Run, ending
from symtop.methods.framework.preparation import Preparation, Presentation, as_it_steps
from symtop.methods.framework.registry import Solver
from symtop.methods.vectors import accumulate, accumulate_plainly, zero
from symtop.model.top import Angles, SymmetricTop, flat

BLOCK = 5_000_000  # steps between returns to Python, so that an interrupt is heard within a second


class Position(NamedTuple):
    """All that the next step of a run depends on."""

    state: tuple[float, ...]
    low: tuple[float, ...]  # accumulated rounding errors of the sums in `state`
    carry: Any  # floats in tuples or arrays, as the kernel's `begin` makes them
    k: int  # steps done


class March(NamedTuple):
    """What one run of a fixed-step kernel returns."""

    states: Array  # (samples, dimension), NaN after a failure
    momenta: Array  # (samples, 2): p_phi and p_psi recomputed from the increments
    steps: int  # completed since the start of the run
    work: int  # force evaluations or solver iterations, as the family counts them
    outcome: int  # index into OUTCOMES


# `begin` of a kernel that reuses nothing: one number, as numba cannot type the entries of an empty tuple
no_carry = register_jitable(lambda _par, _rule, _state, _h: (0.0,))
as_given = register_jitable(lambda _par, _rule, state, _h: state)  # `enter` of a kernel that steps the start itself
as_stepped = register_jitable(lambda _par, _rule, state, _k, _h: state)  # `present` of one that shows its state


@dataclass(frozen=True)
class Loop:
    """The loop around one kernel family, compiled when it is first used: ``loop(par, rule, state, h, marks)``.

    A run records the state after ``marks[j]`` steps for each j (increasing; 0 is the start). `start` and `advance` do
    the same in stretches, and the bits do not depend on where a stretch ends. `add` adds an increment to the state.
    `lanes(rule)` is what the family needs to run many members in lanes (`framework.lanes`), or None.
    """

    begin: Callable[..., Any]
    increment: Callable[..., Any]
    observe: Callable[..., Any]
    enter: Callable[..., Any] = as_given
    present: Callable[..., Any] = as_stepped
    add: Callable[..., Any] = accumulate
    lanes: Callable[[Any], Lanes | None] = lambda _: None

    def __post_init__(self) -> None:
        for name in ("begin", "increment", "observe", "enter", "present"):
            if not callable(part := getattr(self, name)):
                raise SymtopError(f"{name} must be a function of a kernel, not {shown(part)}")
            register_jitable(part)

    def __reduce__(self) -> NoReturn:
        raise TypeError("a loop cannot be pickled: numba knows its parts in the process that made it")

    @cached_property
    def plain(self) -> "Loop":
        """The same kernel with sums that are not compensated."""
        return Loop(self.begin, self.increment, self.observe, self.enter, self.present, accumulate_plainly)

    @cached_property  # few processes need it, and each would hash the parts of a hundred loops
    def prepare(self) -> Callable[..., Any]:
        """The compiled function (par, rule, state, h) -> (the kernel's state, the first carry)."""
        begin, enter = self.begin, self.enter

        def prepare(par, rule, state, h):  # type: ignore[no-untyped-def]
            state = enter(par, rule, state, h)
            return state, begin(par, rule, state, h)

        return compile_kernel(prepare)  # type: ignore[no-any-return]

    @cached_property
    def march(self) -> Callable[..., Any]:
        """The compiled loop over a stretch of a run."""
        return compile_kernel(self.marching(as_it_steps))  # type: ignore[no-any-return]

    def marching(self, sample: Callable[..., Any]) -> Callable[..., Any]:
        """`march` before it is compiled, with samples as `sample` shows them."""
        increment, observe, present, add = self.increment, self.observe, self.present, self.add

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
                values = sample(par, k * h, present(par, rule, state, k, h))
                for i in range(len(values)):
                    states[j, i] = values[i]
                if k > 0:
                    momenta[0, j], momenta[1, j] = observe(par, rule, before, dstate, h)
                j += 1
            return state, low, carry, k, j, work, outcome

        return march

    def __call__(self, par: Any, rule: Any, state: tuple[float, ...], h: float, marks: Ints) -> March:
        """From the start to the last mark."""
        return self.advance(par, rule, self.start(par, rule, state, h), h, marks)[0]

    def start(self, par: Any, rule: Any, state: tuple[float, ...], h: float) -> Position:
        """A run before its first step."""
        state, carry = self.prepare(par, rule, state, h)
        return Position(state, (0.0,) * len(state), carry, 0)

    def advance(self, par: Any, rule: Any, at: Position, h: float, marks: Ints) -> tuple[March, Position]:
        """Continue a run from `at` to the last mark; all marks lie beyond `at`, but for a mark 0 at the start."""
        state, low, carry, k = at
        if isinstance(carry, np.ndarray):  # a kernel's working space: `at` stays what it is
            carry = carry.copy()
        states, momenta = np.full((len(marks), len(state)), np.nan), np.full((2, len(marks)), np.nan)
        j = work = outcome = 0
        while j < len(marks) and outcome == OK:
            stop = min(k + BLOCK, int(marks[-1]))
            state, low, carry, k, j, effort, outcome = self.march(
                par, rule, state, low, carry, h, k, j, stop, marks, states, momenta
            )
            work += effort
        return March(states, momenta.T, k, work, outcome), Position(state, low, carry, k)


kernel_loop = Loop  # its public name


@functools.cache
def whole_run(
    loop: Loop, sample: Callable[..., Any], kind: Callable[..., Any], scale: Callable[..., Any], prepare: Preparation
) -> Callable[..., tuple[int, int, int]]:
    """A run in one compiled call, from plain numbers (`preparation`) to filled arrays.

    ``run(row, coefficients, h, marks, states, momenta)``, with momenta (2, samples), returns steps, work and outcome.
    """
    begin, enter, march = loop.begin, loop.enter, register_jitable(loop.marching(sample))
    numbers, unpack, momenta_at = prepare.numbers, prepare.unpack, prepare.momenta

    def run(row, coefficients, h, marks, states, momenta):  # type: ignore[no-untyped-def]
        top, at = unpack(row)
        par, state = numbers(top, at)
        rule = scale(kind(coefficients), top, at, h)
        state = enter(par, rule, state, h)
        if marks[0] == 0:
            momenta[0, 0], momenta[1, 0] = momenta_at(top, at)
        carry, stop = begin(par, rule, state, h), marks[-1]
        _, _, _, k, j, work, outcome = march(
            par, rule, state, zero(state), carry, h, 0, 0, stop, marks, states, momenta
        )
        states[j:] = np.nan
        momenta[:, max(j, int(marks[0] == 0)) :] = np.nan
        return k, work, outcome

    return compile_kernel(run)  # type: ignore[no-any-return]


@functools.cache
def blocks_of(loop: Loop, lanes: Lanes, show: Callable[..., None], *parts: Any) -> Blocks:
    """The kernels of a loop in lanes, from the parts that `lanes.preparing` takes."""
    prepare = many.preparing(lanes, loop.begin, loop.enter, *parts)
    return Blocks(lanes, prepare, many.marching(lanes, loop.observe, loop.present, show))


Prepare = Callable[[SymmetricTop, Angles], tuple[Any, tuple[float, ...]]]
Present = Callable[[Any, Array, Array], Array]


class _Whole(NamedTuple):
    """The parts of a run in one compiled call."""

    alone: tuple[Any, ...]  # the parts of a single run; a plain tuple unpacks faster than a NamedTuple
    blocks: Callable[[], Blocks] | None  # the kernels for many members in lanes
    rule: tuple[Any, Any]  # as the method has it, and as it is passed to compiled code


@dataclass(frozen=True)
class FixedStep:
    """A solver around a loop: `prepare` gives a kernel its parameters and state, `rule` the method's numbers.

    A rule whose numbers depend on the run is a function of the top, the start and the step. A unit of the kernel's
    counted work (of an implicit method, an iteration) takes `evaluations` force evaluations, and each step `each_step`
    more. `present(par, times, states)` makes states of the chart from the kernel's, where they differ. A run is one
    compiled call where `prepare` is a `Preparation` and `present`, if there is one, is `Presentation`.
    """

    loop: Loop | Callable[..., March]
    rule: Any
    prepare: Prepare
    evaluations: int
    implicit: bool = field(kw_only=True)
    each_step: int = 0
    present: Present | None = None

    def setup(self, top: SymmetricTop, start: Angles, h: float) -> tuple[Any, Any, tuple[float, ...]]:
        """The numbers of the top and of the method, and the state that the kernel starts from."""
        par, state = self.prepare(top, start)
        return par, self.rule(top, start, h) if callable(self.rule) else self.rule, state

    def __call__(self, top: SymmetricTop, start: Angles, plan: Plan) -> Run:
        """Start to horizon, in one compiled call where that is possible."""
        whole, h, marks = self._whole, plan.step_size, plan.marks
        if whole is None or marks.item(-1) > BLOCK:
            march = self._in_stretches(top, start, plan)
            counts = march.steps, *self.counts(march.steps, march.work), ending(march.outcome), march.steps * h
            return Run(march.states, march.momenta[:, 0], march.momenta[:, 1], *counts)
        # what follows takes as long as a run of few steps: hence no fields one at a time, no `counts`, no constructor
        run, rule, check, size, evaluations, each_step, counted = whole.alone
        if check is not None:
            check(start)
        samples, numbers = len(marks), flat(top, start)
        states, momenta = np.empty((samples, size)), np.empty((2, samples))
        steps, work, outcome = run(numbers, rule, h, marks, states, momenta)
        effort, name = work * evaluations + steps * each_step, ending(outcome)
        fields = states, momenta[0], momenta[1], steps, effort, work * counted, name, steps * h
        return tuple.__new__(Run, fields)

    def _in_stretches(self, top: SymmetricTop, start: Angles, plan: Plan) -> March:
        """A run with the preparation in Python, and a return to Python after every `BLOCK` steps."""
        par, rule, state = self.setup(top, start, plan.step_size)
        march = self.loop(par, rule, state, plan.step_size, plan.marks)
        if plan.marks[0] == 0:
            march.momenta[0] = top.momenta(start)[:2]
        return march if self.present is None else march._replace(states=self.present(par, plan.times, march.states))

    def many(self, numbers: Array, h: Array, marks: Ints, *, compiling: bool = False) -> Many:
        """The runs of n members: `numbers` (n, 9) as `flat` has them, steps `h` (n,), `marks` (n, samples).

        Few steps are made one member after another if kernels in lanes are not stored, unless `compiling` asks for them
        (`Blocks.worth`). Each has the bits of a run alone, in lanes too, and fails alone, as does one whose start the
        kernel cannot step. Threads may call it at the same time; after every `GROUP` steps, or a stretch of a longer
        member, it heeds an interrupt. Raises SymtopError for a solver `in_python`, which runs one member at a time.
        """
        # writable too: a kernel is compiled again for an array that is not, as a broadcast one
        numbers, h = np.require(numbers, requirements=("C", "W")), np.require(h, requirements=("C", "W"))
        marks = np.require(marks, requirements=("C", "W"))
        whole, limit = self._whole, min(many.GROUP_STEPS, BLOCK)
        if whole is None:
            raise SymtopError("many needs a solver whose parts all compile")
        run, rule, check, size, *_ = whole.alone
        runs, outside = Many.empty(len(numbers), marks.shape[1], size), many.refused(check, numbers)
        runs.outcome[outside] = LEFT_CHART
        members = np.flatnonzero(~outside)
        if whole.blocks is not None:
            blocks = whole.blocks()
            if compiling or blocks.worth(int(marks[members, -1].sum())):
                members = blocks.run(members, numbers, whole.rule, h, marks, runs, limit)
        short, momenta = marks[members, -1] <= BLOCK, np.empty((2, marks.shape[1]))
        for group in many.groups(members[short], marks[:, -1], limit):
            check_interrupt()
            rows = map(tuple, numbers[group].tolist())
            for i, row, step in zip(group.tolist(), rows, h[group].tolist(), strict=True):
                runs.steps[i], runs.work[i], runs.outcome[i] = run(row, rule, step, marks[i], runs.states[i], momenta)
                runs.momenta[i] = momenta.T
        for i, top in zip(members[~short].tolist(), many.members_of(numbers[members[~short]]), strict=True):
            check_interrupt()
            march = self._in_stretches(*top, Plan.steps(float(h[i]), marks[i]))
            runs.states[i], runs.momenta[i], runs.steps[i], runs.work[i], runs.outcome[i] = march
        return runs

    @property
    def in_python(self) -> bool:
        """Does every run take a call of Python, because parts of it do not compile?"""
        return self._whole is None

    @property
    def in_lanes(self) -> bool:
        """Does `many` run members side by side, but for those whose lane is given up?"""
        return self._whole is not None and self._whole.blocks is not None

    def counts(self, steps: Any, work: Any) -> tuple[Any, Any]:
        """Force evaluations and solver iterations, of the counts of a `March` or of `Many`."""
        return work * self.evaluations + steps * self.each_step, work if self.implicit else 0 * work

    @cached_property
    def _whole(self) -> "_Whole | None":
        """The run in one call, if all of its parts are functions that compile."""
        loop, prepare, present, rule = self.loop, self.prepare, self.present, self.rule
        if not isinstance(loop, Loop) or not isinstance(prepare, Preparation):
            return None
        if present is not None and not isinstance(present, Presentation):
            return None
        sample, size = (as_it_steps, prepare.size) if present is None else (present.sample, present.size)
        scale = preparation.as_it_is
        pack = getattr(rule, "pack", preparation.as_fields)
        if isinstance(rule, preparation.ScaledRule):
            scale, rule = rule.scale, rule.rule
        elif isinstance(rule, preparation.LazyRule):
            rule = rule.make()
        if not isinstance(rule, tuple) or not rule:  # a function of Python, or numbers in an array
            return None
        kind, numbers = pack(rule)
        run = whole_run(loop, sample, kind, scale, prepare)
        alone = run, numbers, prepare.check, size, self.evaluations, self.each_step, int(self.implicit)
        if (lanes := loop.lanes(rule)) is None:
            return _Whole(alone, None, (rule, numbers))
        show = lanes.show or many.showing(sample)
        return _Whole(alone, partial(blocks_of, loop, lanes, show, kind, scale, prepare), (rule, numbers))


def inside(solver: Solver | None) -> FixedStep | None:
    """The fixed-step loop inside a solver, if it has one that can be run in stretches."""
    inner = getattr(solver, "solve", solver)
    return inner if isinstance(inner, FixedStep) and isinstance(inner.loop, Loop) else None
