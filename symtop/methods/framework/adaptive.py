"""Makes a solver of the registry from a compiled loop that chooses its steps, for one run and for many.

    loop(numbers, tolerance, times, budget, index, place, states, momenta) -> (index, steps, effort, outcome)

continues from `place`, an array of all that the next step depends on, or begins at the start in `numbers`
(`symtop.model.top.flat`) if `index` is negative. It fills `states` and `momenta` (p_phi, p_psi) at `times`, and ends at
the last of them, at a failure, or at the first step with which the effort reaches `budget`. It returns the number of
samples filled since the start, and the steps and the effort of this call. Several calls give the bits of one call.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from symtop.core.parallel import check_interrupt
from symtop.methods.framework.lanes import Ints, Many, refused
from symtop.methods.framework.plan import LEFT_CHART, OK, OUT_OF_BUDGET, OUTCOMES, Array, Plan, Run
from symtop.model.top import Angles, SymmetricTop, flat, lightened

AdaptiveLoop = Callable[..., tuple[int, int, int, int]]


@dataclass(frozen=True)
class Adaptive:
    """A solver around compiled loops with a tolerance; a run is one call where it ends within `block`."""

    loop: Callable[[float], AdaptiveLoop]  # (tolerance): the loop
    size: int  # numbers in a sample
    room: int  # numbers in `place`
    time: int  # index in `place` of the time that was reached
    most: float  # limit on the units of effort of a run without a budget
    block: int  # units between returns to Python, so that an interrupt is heard within a second
    unit: Callable[[float], int] = lambda _: 1  # (tolerance): force evaluations in a unit of effort
    check: Callable[[Angles], None] | None = None  # as `Preparation` has it
    light: bool = False  # a sample ends with three momenta, which the loop has in the unit of `lightened`

    def __call__(self, top: SymmetricTop, start: Angles, plan: Plan) -> Run:
        """Run from the start to the last sample of the plan."""
        if self.check is not None:
            self.check(start)
        times = np.ascontiguousarray(plan.times)
        states, momenta = np.full((times.size, self.size), np.nan), np.full((times.size, 2), np.nan)
        result = self._run(flat(top, start), plan.tolerance, times, plan.budget, states, momenta)
        steps, evaluations, outcome, reached = result
        return Run(states, momenta[:, 0], momenta[:, 1], steps, evaluations, 0, OUTCOMES[outcome], reached)

    def limit(self, plan: Plan) -> float:
        """The force evaluations at which a run is stopped."""
        return plan.most(self.most * self.unit(plan.tolerance))

    def many(
        self, numbers: Array, tolerance: Array, times: Array, counts: Ints, budget: float | None = None
    ) -> tuple[Many, Array]:
        """The runs of n members one after another, and the times that they reached, (n,).

        `numbers` (n, 9), `tolerance` (n,), `times` (n, samples), of which the first `counts` (n,) are asked for. Each
        member has the bits of a run alone and fails alone. Work is in force evaluations.
        """
        runs, reached = Many.empty(len(numbers), times.shape[1], self.size), np.zeros(len(numbers))
        outside, times = refused(self.check, numbers), np.ascontiguousarray(times)
        runs.outcome[outside] = LEFT_CHART
        for i, row in enumerate(map(tuple, numbers.tolist())):
            check_interrupt()
            if not outside[i]:
                samples = times[i, : counts[i]]
                result = self._run(row, float(tolerance[i]), samples, budget, runs.states[i], runs.momenta[i])
                runs.steps[i], runs.work[i], runs.outcome[i], reached[i] = result
        return runs, reached

    def _run(
        self, numbers: tuple[float, ...], tolerance: float, times: Array, budget: float | None, states: Array,
        momenta: Array,
    ) -> tuple[int, int, int, float]:  # fmt: skip
        """Fill in the samples: steps, force evaluations, outcome and the time that was reached."""
        loop, unit = self.loop(tolerance), self.unit(tolerance)
        numbers, mass = lightened(numbers) if self.light else (numbers, 1.0)
        place, limit = np.empty(self.room), self.most if budget is None else budget / unit
        index, steps, effort, outcome = -1, 0, 0, OK
        while index < times.size and outcome == OK and effort < limit:
            block = int(min(self.block, limit - effort)) or 1
            index, count, work, outcome = loop(numbers, tolerance, times, block, index, place, states, momenta)
            steps, effort = steps + count, effort + work
        if index < times.size and outcome == OK:
            outcome = OUT_OF_BUDGET
        if mass != 1.0:
            states[:, -3:] *= mass
            momenta *= mass
        reached = float(times[-1] if outcome == OK else place[self.time])
        return steps, effort * unit, outcome, reached
