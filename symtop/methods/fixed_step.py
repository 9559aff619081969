"""From a compiled loop to a solver of the registry."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from symtop.methods.loop import Loop, March
from symtop.methods.outcomes import OUTCOMES
from symtop.methods.plan import Plan, Run
from symtop.methods.registry import Array, Solver
from symtop.model.top import Angles, SymmetricTop

Prepare = Callable[[SymmetricTop, Angles], tuple[Any, tuple[float, ...]]]
Present = Callable[[Any, Array, Array], Array]


@dataclass(frozen=True)
class FixedStep:
    """A solver around a loop: `prepare` gives a kernel its parameters and state, `rule` the method's numbers.

    A rule whose numbers depend on the run is a function of the top, the start and the step.
    `evaluations` is how many force evaluations one unit of the kernel's counted work takes; for an implicit method
    that unit is one iteration (of Newton or of a sweep), and `each_step` evaluations come on top of every step.
    `present(par, times, states)` makes states of the chart from the kernel's, where they differ.
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

    def run(self, top: SymmetricTop, start: Angles, plan: Plan, par: Any, done: March) -> Run:
        """What the loop returned, in the states of the chart."""
        momenta = done.momenta
        if plan.marks[0] == 0:
            momenta[0] = top.momenta(start)[:2]
        return Run(
            states=done.states if self.present is None else self.present(par, plan.times, done.states),
            p_phi=momenta[:, 0],
            p_psi=momenta[:, 1],
            steps=done.steps,
            force_evaluations=done.work * self.evaluations + done.steps * self.each_step,
            newton_iterations=done.work if self.implicit else 0,
            outcome=OUTCOMES[done.outcome],
            reached=done.steps * plan.step_size,
        )

    def __call__(self, top: SymmetricTop, start: Angles, plan: Plan) -> Run:
        """Start to horizon."""
        par, rule, state = self.setup(top, start, plan.step_size)
        return self.run(top, start, plan, par, self.loop(par, rule, state, plan.step_size, plan.marks))


def inside(solver: Solver | None) -> FixedStep | None:
    """The fixed-step loop inside a solver, if it has one that can be run in stretches."""
    inner = getattr(solver, "solve", solver)
    return inner if isinstance(inner, FixedStep) and isinstance(inner.loop, Loop) else None
