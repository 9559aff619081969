"""From a compiled loop to a solver of the registry."""

from collections.abc import Callable
from typing import Any

from symtop.integrators.drive import March
from symtop.integrators.outcomes import OUTCOMES
from symtop.integrators.registry import Array, Plan, Run, Solver
from symtop.top import Angles, SymmetricTop

Prepare = Callable[[SymmetricTop, Angles], tuple[Any, tuple[float, ...]]]


Present = Callable[[Any, Array, Array], Array]


def fixed_step(
    march: Callable[..., March],
    rule: Any,
    prepare: Prepare,
    evaluations: int,
    *,
    implicit: bool,
    each_step: int = 0,
    present: Present | None = None,
) -> Solver:
    """A solver around a loop: `prepare` gives a kernel its parameters and state, `rule` the method's numbers.

    `evaluations` is how many force evaluations one unit of the kernel's counted work takes; for an implicit method
    that unit is one iteration (of Newton or of a sweep), and `each_step` evaluations come on top of every step.
    `present(par, times, states)` makes states of the chart from the kernel's, where they differ.
    """

    def solve(top: SymmetricTop, start: Angles, plan: Plan) -> Run:
        par, state = prepare(top, start)
        done = march(par, rule, state, plan.step_size, plan.marks)
        momenta = done.momenta
        momenta[plan.marks == 0] = top.momenta(start)[:2]
        return Run(
            states=done.states if present is None else present(par, plan.times, done.states),
            p_phi=momenta[:, 0],
            p_psi=momenta[:, 1],
            steps=done.steps,
            force_evaluations=done.work * evaluations + done.steps * each_step,
            newton_iterations=done.work if implicit else 0,
            outcome=OUTCOMES[done.outcome],
            reached=done.steps * plan.step_size,
        )

    return solve
