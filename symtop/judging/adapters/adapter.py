"""What every socket gives: something that steps a state of one formulation, and its record for the battery.

A `Stepper` marches a state by steps of h and shows it at marks. The momenta of its runs are read off the states here
and never asked from it, so that it cannot report others than it has.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from symtop.measure.step_map import reversed_rates
from symtop.methods.framework.equations import Formulation, as_run
from symtop.methods.framework.plan import NOT_FINITE, OK, Array, Plan, Run
from symtop.methods.framework.registry import Integrator, Solver
from symtop.model.top import Angles, SymmetricTop


class March(NamedTuple):
    """A state at the marks, shape (marks, dimension), NaN after a failure, and the force evaluations; 0 if unknown."""

    states: Array
    evaluations: int


class Stepper(Protocol):
    """Something that steps. `adaptive` is its solver at a tolerance where it chooses its steps, and None where not."""

    name: str
    chart: str  # of its states; "nutation" for (theta, p_theta), which no solver of the registry shows
    form: Formulation
    implementation: str  # compiled or python: how much it is run
    adaptive: Solver | None
    own_loop: bool  # is a run of many steps a loop of its own?

    def march(self, top: SymmetricTop, par: Any, y: Array, h: float, marks: NDArray[np.int64]) -> March:
        """The state after marks[0], marks[1], ... steps of h from y."""
        ...


def label_of(text: str) -> str:
    """A name of an integrator made of any text."""
    return re.sub(r"[^A-Za-z0-9._+-]+", "-", text).strip("-._+")[:64] or "step"


@dataclass(frozen=True)
class SocketSolver:
    """The solver of the registry around a stepper, which can also go on from any of its states."""

    stepper: Stepper

    def __call__(self, top: SymmetricTop, start: Angles, plan: Plan) -> Run:
        """Start to horizon."""
        form = self.stepper.form
        par, state = form.prepare(top, start)
        states, evaluations = self.stepper.march(top, par, np.array(state, dtype=float), plan.step_size, plan.marks)
        outcome, reached, made = OK, plan.horizon, int(plan.marks[-1])
        for k, row in enumerate(states):
            outcome = form.ended(row.tolist()) if np.isfinite(row).all() else NOT_FINITE
            if outcome != OK:
                states[k:] = np.nan
                reached, made = float(plan.times[max(k - 1, 0)]), int(plan.marks[max(k - 1, 0)])
                break
        return as_run(form, par, plan.times, states, made, evaluations, outcome, reached)

    def onward(self, top: SymmetricTop, start: Angles, steps: Sequence[float]) -> Run:
        """The end of steps of these lengths, each a run of its own from the state where the last one ended."""
        form = self.stepper.form
        par, state = form.prepare(top, start)
        y = np.array(state, dtype=float)
        for h in steps:
            y = self.stepper.march(top, par, y.copy(), h, np.array([1])).states[0]
        return as_run(form, par, np.zeros(1), y[None], 1, 0, OK, 0.0)

    def there_and_back(self, top: SymmetricTop, start: Angles, h: float) -> Run:
        """The end of a step of h and one from there with all rates reversed: for what makes no step of -h."""
        form = self.stepper.form
        par, state = form.prepare(top, start)
        turned = np.ones(len(state))
        turned[-3 if turned.size > 2 else -1 :] = -1.0  # L, w, the rates or p_theta
        y = turned * self.stepper.march(top, par, np.array(state, dtype=float), h, np.array([1])).states[0]
        back, _ = form.prepare(top, reversed_rates(start))
        y = turned * self.stepper.march(top, back, y, h, np.array([1])).states[0]
        return as_run(form, par, np.zeros(1), y[None], 1, 0, OK, 0.0)


def integrator(stepper: Stepper, **claims: Any) -> Integrator:
    """The record of a stepper with the claims that are made for it."""
    chart = "angles" if stepper.chart == "nutation" else stepper.chart
    return Integrator(
        name=stepper.name,
        family="other",
        summary="given through a socket",
        solvers={chart: SocketSolver(stepper) if stepper.adaptive is None else stepper.adaptive},
        control="step_size" if stepper.adaptive is None else "tolerance",
        implementation=stepper.implementation,
        **claims,
    )
