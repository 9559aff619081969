"""From a compiled loop to a solver of the registry."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np

from symtop.core.parallel import heed
from symtop.methods.framework import loop as loops
from symtop.methods.framework.loop import Loop, March
from symtop.methods.framework.many import GROUP, Blocks, Many, Whole, groups, in_turn, members_of, refused
from symtop.methods.framework.plan import LEFT_CHART, OUTCOMES, Plan, Run
from symtop.methods.framework.preparation import (
    Later,
    Pack,
    Preparation,
    Scaled,
    Shown,
    as_fields,
    as_it_is,
    as_it_steps,
)
from symtop.methods.framework.registry import Array, Solver
from symtop.model import charts
from symtop.model.top import Angles, SymmetricTop, flat

Prepare = Callable[[SymmetricTop, Angles], tuple[Any, tuple[float, ...]]]
Present = Callable[[Any, Array, Array], Array]


class _Whole(NamedTuple):
    """A run in one compiled call, put together once."""

    rule: Any  # what compiled code makes the rule from
    size: int  # of a sample
    alone: tuple[Any, ...]  # what a run of one takes, for a plain tuple comes apart quicker than a NamedTuple
    blocks: Callable[[], Blocks] | None  # many members in lanes
    table: Any  # the rule as the method has it

    def run(self, members: Whole, numbers: Array, h: Array, marks: Whole, done: Many) -> Whole:
        """Run members in lanes or by one call each; returns those that take a call of Python."""
        most = min(GROUP, loops.BLOCK)
        if self.blocks is not None:
            members = self.blocks().run(members, numbers, self.table, h, marks, done, most)
        short = marks[members, -1] <= loops.BLOCK
        for chosen in groups(members[short], marks[:, -1], most):
            heed()
            in_turn(self.alone[0], chosen, numbers, self.rule, h, marks, done)
        longer: Whole = members[~short]
        return longer


@dataclass(frozen=True)
class FixedStep:
    """A solver around a loop: `prepare` gives a kernel its parameters and state, `rule` the method's numbers.

    A rule whose numbers depend on the run is a function of the top, the start and the step.
    `evaluations` is how many force evaluations one unit of the kernel's counted work takes; for an implicit method
    that unit is one iteration (of Newton or of a sweep), and `each_step` evaluations come on top of every step.
    `present(par, times, states)` makes states of the chart from the kernel's, where they differ.

    Where `prepare` is a `Preparation` and `present`, if there is one, is `Shown`, a run is one compiled call; where
    they are functions of Python, a run of few steps takes five times as long.
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
        if whole is None or marks.item(-1) > loops.BLOCK:
            return self._in_stretches(top, start, plan)
        # a field at a time, `counts`, and the class's constructor, which passes its arguments on, take a third more
        run, rule, check, size, evaluations, each_step, counted = whole.alone
        if check is not None:
            check(start)
        samples, numbers = len(marks), flat(top, start)
        states, momenta = np.empty((samples, size)), np.empty((2, samples))  # a row costs half of what a column does
        steps, work, outcome = run(numbers, rule, h, marks, states, momenta)
        spent, ended = work * evaluations + steps * each_step, OUTCOMES[outcome]
        seen = states, momenta[0], momenta[1], steps, spent, work * counted, ended, steps * h
        return tuple.__new__(Run, seen)

    def _in_stretches(self, top: SymmetricTop, start: Angles, plan: Plan) -> Run:
        """The same with the preparation in Python, and a return to Python after every `BLOCK` steps."""
        par, rule, state = self.setup(top, start, plan.step_size)
        done = self.loop(par, rule, state, plan.step_size, plan.marks)
        if plan.marks[0] == 0:
            done.momenta[0] = top.momenta(start)[:2]
        states = done.states if self.present is None else self.present(par, plan.times, done.states)
        counts = done.steps, *self.counts(done.steps, done.work), OUTCOMES[done.outcome], done.steps * plan.step_size
        return Run(states, done.momenta[:, 0], done.momenta[:, 1], *counts)

    def many(self, numbers: Array, h: Array, marks: Whole) -> Many:
        """The runs of n members: `numbers` (n, 9) as `flat` has them, steps `h` (n,), `marks` (n, samples).

        Each has the bits of a run alone, in lanes too (`blocks`). A member that fails fails alone, and so does one
        whose start the kernel cannot step. Threads may call it at the same time; after every `GROUP` steps, or a
        stretch of a longer member, it heeds an interrupt of theirs.
        """
        # writable too: a kernel is compiled again for an array that is not, as a broadcast one
        numbers, h = np.require(numbers, requirements=("C", "W")), np.require(h, requirements=("C", "W"))
        marks = np.require(marks, requirements=("C", "W"))
        whole, check = self._whole, getattr(self.prepare, "check", None)
        out = refused(check, numbers)
        left, done = np.flatnonzero(~out), None
        if whole is not None:
            done = Many.begun(len(numbers), marks.shape[1], whole.size)
            left = whole.run(left, numbers, h, marks, done)
        for i, top in zip(left.tolist(), members_of(numbers[left]), strict=True):
            heed()
            run = self(*top, Plan.steps(float(h[i]), marks[i]))
            if done is None:
                done = Many.begun(len(numbers), *run.states.shape)
            done.states[i], done.momenta[i, :, 0], done.momenta[i, :, 1] = run.states, run.p_phi, run.p_psi
            done.steps[i], done.outcome[i] = run.steps, OUTCOMES.index(run.outcome)
            done.work[i] = (run.force_evaluations - run.steps * self.each_step) // self.evaluations
        if done is None:  # nobody ran, and only angles refuse a start
            done = Many.begun(len(numbers), marks.shape[1], charts.DIMENSIONS["angles"])
        done.outcome[out] = LEFT_CHART
        return done

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
        if present is not None and not isinstance(present, Shown):
            return None
        sample, size = (as_it_steps, prepare.size) if present is None else (present.sample, present.size)
        scale = as_it_is
        pack: Pack = (rule.pack if isinstance(rule, Scaled | Later) else None) or as_fields
        if isinstance(rule, Scaled):
            scale, rule = rule.scale, rule.rule
        elif isinstance(rule, Later):
            rule = rule.make()
        if not isinstance(rule, tuple) or not rule:  # a function of Python, or numbers in an array
            return None
        kind, numbers = pack(rule)
        parts = kind, prepare.numbers, scale, sample
        lanes = loop.lanes(rule)
        blocks = None if lanes is None else partial(loop.blocks, lanes, lanes.pack(rule)[0], *parts[1:])
        costs = self.evaluations, self.each_step, int(self.implicit)
        alone = loop.whole(*parts), numbers, prepare.check, size, *costs
        return _Whole(numbers, size, alone, blocks, rule)


def inside(solver: Solver | None) -> FixedStep | None:
    """The fixed-step loop inside a solver, if it has one that can be run in stretches."""
    inner = getattr(solver, "solve", solver)
    return inner if isinstance(inner, FixedStep) and isinstance(inner.loop, Loop) else None
