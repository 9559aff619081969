"""From a compiled loop to a solver of the registry."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np

from symtop.base.threads import heed
from symtop.methods import loop as loops
from symtop.methods.blocks import Blocks
from symtop.methods.loop import Loop, March
from symtop.methods.many import GROUP, Many, Whole, groups, members_of, refused
from symtop.methods.outcomes import LEFT_CHART, OUTCOMES
from symtop.methods.plan import Plan, Run
from symtop.methods.preparation import Later, Preparation, Requirement, Scaled, Shown, as_it_is, as_it_steps, plain
from symtop.methods.registry import Array, Solver
from symtop.model import charts
from symtop.model.top import Angles, SymmetricTop, flat

Prepare = Callable[[SymmetricTop, Angles], tuple[Any, tuple[float, ...]]]
Present = Callable[[Any, Array, Array], Array]


class _Whole(NamedTuple):
    """A run in one compiled call, put together once."""

    run: Callable[..., tuple[int, int, int]]
    many: Callable[[], Callable[..., None]]  # the loop over members around it
    blocks: Callable[[], Blocks] | None  # many members in lanes
    rule: tuple[Any, ...]  # arguments that compiled code makes the rule from
    table: Any  # the rule as the method has it
    fit: Callable[..., tuple[Any, ...]] | None  # the arguments of a rule that hangs on the start
    check: Requirement | None
    size: int  # of a sample


@dataclass(frozen=True)
class FixedStep:
    """A solver around a loop: `prepare` gives a kernel its parameters and state, `rule` the method's numbers.

    A rule whose numbers depend on the run is a function of the top, the start and the step.
    `evaluations` is how many force evaluations one unit of the kernel's counted work takes; for an implicit method
    that unit is one iteration (of Newton or of a sweep), and `each_step` evaluations come on top of every step.
    `present(par, times, states)` makes states of the chart from the kernel's, where they differ.

    Where `prepare` is a `Preparation` and `present`, if there is one, is `Shown`, a run is one compiled call; where
    they are functions of Python, it takes 5 to 10 microseconds more.
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
        """Start to horizon, in one compiled call where that is possible: 1.5 us and the steps."""
        whole, h, marks = self._whole, plan.step_size, plan.marks
        if whole is None or marks.item(-1) > loops.BLOCK:
            return self._in_stretches(top, start, plan)
        if whole.check is not None:
            whole.check(start)
        rule = whole.rule if whole.fit is None else whole.fit(top, start, h)
        states, momenta = np.empty((marks.size, whole.size)), np.empty((marks.size, 2))
        steps, work, outcome = whole.run(flat(top, start), rule, h, marks, states, momenta)
        return self._run(h, states, momenta, steps, work, outcome)

    def _in_stretches(self, top: SymmetricTop, start: Angles, plan: Plan) -> Run:
        """The same with the preparation in Python, and a return to Python after every `BLOCK` steps."""
        par, rule, state = self.setup(top, start, plan.step_size)
        done = self.loop(par, rule, state, plan.step_size, plan.marks)
        if plan.marks[0] == 0:
            done.momenta[0] = top.momenta(start)[:2]
        states = done.states if self.present is None else self.present(par, plan.times, done.states)
        return self._run(plan.step_size, states, done.momenta, done.steps, done.work, done.outcome)

    def many(self, numbers: Array, h: Array, marks: Whole) -> Many:
        """The runs of n members: `numbers` (n, 9) as `flat` has them, steps `h` (n,), `marks` (n, samples).

        Each has the bits of a run alone, in lanes too (`blocks`). A member that fails fails alone, and so does one
        whose start the kernel cannot step. Threads may call it at the same time; after every `GROUP` steps it heeds an
        interrupt of theirs.
        """
        numbers, h = np.ascontiguousarray(numbers), np.ascontiguousarray(h)
        marks = np.ascontiguousarray(marks)
        whole, check = self._whole, getattr(self.prepare, "check", None)
        out = refused(check, numbers)
        alone = ~out & (self.in_python | (marks[:, -1] > loops.BLOCK))
        tops = zip(np.flatnonzero(alone).tolist(), members_of(numbers[alone]), strict=True)
        runs, most = dict[int, Run](), min(GROUP, loops.BLOCK)
        for i, top in tops:
            heed()
            runs[i] = self(*top, Plan.steps(float(h[i]), marks[i]))
        seen = (run.states.shape[1] for run in runs.values())
        size = next(seen, charts.DIMENSIONS["angles"]) if whole is None else whole.size  # only angles refuse a start
        done = Many.begun(len(numbers), marks.shape[1], size)
        done.outcome[out] = LEFT_CHART
        for i, run in runs.items():
            done.states[i], done.momenta[i, :, 0], done.momenta[i, :, 1] = run.states, run.p_phi, run.p_psi
            done.steps[i], done.outcome[i] = run.steps, OUTCOMES.index(run.outcome)
            done.work[i] = (run.force_evaluations - run.steps * self.each_step) // self.evaluations
        if whole is not None:
            rest = np.flatnonzero(~(out | alone))
            if whole.blocks is not None:
                rest = whole.blocks().run(rest, numbers, whole.table, h, marks, done, most)
            for chosen in groups(rest, marks[:, -1], most):
                heed()
                whole.many()(chosen, numbers, whole.rule, h, marks, *done)
        return done

    @property
    def in_python(self) -> bool:
        """Does every run take a call of Python, because its rule hangs on the start or its parts do not compile?"""
        return self._whole is None or self._whole.fit is not None

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
        loop, prepare, present, rule, fit = self.loop, self.prepare, self.present, self.rule, None
        if not isinstance(loop, Loop) or not isinstance(prepare, Preparation):
            return None
        if present is not None and not isinstance(present, Shown):
            return None
        sample, size = (as_it_steps, prepare.size) if present is None else (present.sample, present.size)
        scale, pack = as_it_is, _fields
        if isinstance(rule, Scaled):
            pack = rule.pack or pack
            if rule.fit is not None:
                fit = partial(_fitted, rule, pack)
            scale, rule = rule.scale, rule.rule
        elif isinstance(rule, Later):
            rule = rule.make()
        if not isinstance(rule, tuple) or not rule:  # a function of Python, or numbers in an array
            return None
        kind, arguments = pack(rule)
        parts = kind, prepare.numbers, scale, sample
        lanes = None if fit is not None else loop.lanes(rule)
        blocks = None if lanes is None else partial(loop.blocks, lanes, _fields(rule)[0], *parts[1:])
        many = partial(loop.many, *parts)
        return _Whole(loop.whole(*parts), many, blocks, arguments, rule, fit, prepare.check, size)

    def _run(self, h: float, states: Array, momenta: Array, steps: int, work: int, outcome: int) -> Run:
        # `counts`, and the class's constructor, which passes its arguments on: 0.4 us less of a run of 2.6
        evaluations, iterations = work * self.evaluations + steps * self.each_step, work if self.implicit else 0
        p_phi, p_psi = momenta[:, 0], momenta[:, 1]
        seen = states, p_phi, p_psi, steps, evaluations, iterations, OUTCOMES[outcome], steps * h
        return tuple.__new__(Run, seen)


def _fields(rule: Any) -> tuple[Callable[..., Any], tuple[Any, ...]]:
    """The type of a rule and its fields; numba takes 1 us to look at a NamedTuple, and 0.1 us at a plain tuple."""
    return plain if type(rule) is tuple else type(rule), tuple(rule)


def _fitted(
    rule: Scaled, pack: Callable[..., tuple[Any, tuple[Any, ...]]], top: SymmetricTop, start: Angles, h: float
) -> tuple[Any, ...]:
    """The arguments of a rule that hangs on the start."""
    return pack(rule.fitted(top, start, h))[1]


def inside(solver: Solver | None) -> FixedStep | None:
    """The fixed-step loop inside a solver, if it has one that can be run in stretches."""
    inner = getattr(solver, "solve", solver)
    return inner if isinstance(inner, FixedStep) and isinstance(inner.loop, Loop) else None
