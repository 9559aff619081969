"""From a compiled loop to a solver of the registry."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from symtop.methods import loop as loops
from symtop.methods.loop import Loop, March
from symtop.methods.outcomes import OUTCOMES
from symtop.methods.plan import Plan, Run
from symtop.methods.preparation import Later, Preparation, Scaled, Shown, as_it_is, as_it_steps, flat, plain
from symtop.methods.registry import Array, Solver
from symtop.model.top import Angles, SymmetricTop

Prepare = Callable[[SymmetricTop, Angles], tuple[Any, tuple[float, ...]]]
Present = Callable[[Any, Array, Array], Array]


class _Whole(NamedTuple):
    """A run in one compiled call, put together once."""

    run: Callable[..., tuple[int, int, int]]
    rule: tuple[Any, ...]  # plain: numba takes 1 us to look at a NamedTuple, and 0.1 us at this
    fit: Callable[..., Any] | None  # of a rule that hangs on the start
    check: Callable[[Angles], None] | None
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
        """Start to horizon."""
        if self._whole is not None and plan.marks[-1] <= loops.BLOCK:
            return self._at_once(self._whole, top, start, plan)
        par, rule, state = self.setup(top, start, plan.step_size)
        done = self.loop(par, rule, state, plan.step_size, plan.marks)
        if plan.marks[0] == 0:
            done.momenta[0] = top.momenta(start)[:2]
        states = done.states if self.present is None else self.present(par, plan.times, done.states)
        return self._run(plan, states, done.momenta, done.steps, done.work, done.outcome)

    def _at_once(self, whole: "_Whole", top: SymmetricTop, start: Angles, plan: Plan) -> Run:
        """The same in one compiled call: 2 us and the steps."""
        if whole.check is not None:
            whole.check(start)
        rule, h = whole.rule, plan.step_size
        if whole.fit is not None:
            rule = tuple(whole.fit(top, start, h))
        samples = len(plan.marks)
        states, momenta = np.empty((samples, whole.size)), np.empty((samples, 2))
        done = whole.run(flat(top, start), rule, h, plan.marks, states, momenta)
        return self._run(plan, states, momenta, *done)

    @cached_property
    def _whole(self) -> "_Whole | None":
        """The run in one call, if all of its parts are functions that compile."""
        loop, prepare, present, rule, fit = self.loop, self.prepare, self.present, self.rule, None
        if not isinstance(loop, Loop) or not isinstance(prepare, Preparation):
            return None
        if present is not None and not isinstance(present, Shown):
            return None
        sample, size = (as_it_steps, prepare.size) if present is None else (present.sample, present.size)
        scale = as_it_is
        if isinstance(rule, Scaled):
            fit, scale, rule = rule.fitted if rule.fit else None, rule.scale, rule.rule
        elif isinstance(rule, Later):
            rule = rule.make()
        if not isinstance(rule, tuple) or not rule:  # a function of Python, or numbers in an array
            return None
        kind = plain if type(rule) is tuple else type(rule)
        run = loop.whole(kind, prepare.numbers, scale, sample)
        return _Whole(run, tuple(rule), fit, prepare.check, size)

    def _run(self, plan: Plan, states: Array, momenta: Array, steps: int, work: int, outcome: int) -> Run:
        return Run(
            states,
            momenta[:, 0],
            momenta[:, 1],
            steps,
            work * self.evaluations + steps * self.each_step,
            work if self.implicit else 0,
            OUTCOMES[outcome],
            steps * plan.step_size,
        )


def inside(solver: Solver | None) -> FixedStep | None:
    """The fixed-step loop inside a solver, if it has one that can be run in stretches."""
    inner = getattr(solver, "solve", solver)
    return inner if isinstance(inner, FixedStep) and isinstance(inner.loop, Loop) else None
