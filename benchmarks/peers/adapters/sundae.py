"""CVODE of SUNDIALS as scikit-sundae wraps it, Adams and BDF.

Six equations on (e, L); rtol = atol = the tolerance, and as many steps as it takes; samples by its own interpolation.
The interface takes the right-hand side as a Python object, so that each call of it goes through Python although numba
has compiled it: about 1 us a call. `cvode` is the same library from the same wheel without that.
"""

import types
from typing import Any

from benchmarks.peers import common
from benchmarks.peers.common import Inner, Library, Motion
from symtop.methods.framework.plan import Plan
from symtop.methods.framework.registry import Integrator
from symtop.model.top import Angles, SymmetricTop

PACKAGE = "scikit-sundae"
MOST_STEPS = 10_000_000


def _with_signature(field: Any) -> Any:
    """CVODE inspects the number of arguments, which a compiled function does not show."""

    def call(t: float, y: Any, out: Any) -> None:
        field(t, y, out)

    return call


class Sundae(Library):
    """One family of multistep methods."""

    def __init__(self, cvode: types.ModuleType, family: str) -> None:
        self.cvode, self.family = cvode, family

    def _solver_of(self, top: SymmetricTop, tolerance: float) -> Any:
        field = _with_signature(common.filling_field(top))
        return self.cvode.CVODE(field, method=self.family, rtol=tolerance, atol=tolerance, max_num_steps=MOST_STEPS)

    def public(self, top: SymmetricTop, start: Angles, plan: Plan) -> Motion:
        """Build the solver and call it with the sample times."""
        times = common.with_start(plan)
        solution = self._solver_of(top, plan.tolerance).solve(times, common.start_of(top, start))
        return Motion(solution.y[times.size - plan.times.size :], 0, solution.nfev)

    def inner(self, top: SymmetricTop, start: Angles, plan: Plan) -> Inner:
        """Start a solver again and go to the horizon in one call."""
        solver, state, horizon = self._solver_of(top, plan.tolerance), common.start_of(top, start), plan.horizon

        def call() -> Any:
            solver.init_step(0.0, state)
            return solver.step(horizon)

        return Inner(call, lambda solution: solution.y)


def peers() -> list[tuple[Integrator, str]]:
    """Both families of multistep methods."""
    from sksundae import cvode

    return [
        (
            common.record(f"sundae-{family.lower()}", Sundae(cvode, family), f"CVODE; {common.SAME}"),
            common.NUMBA_IN_PYTHON,
        )
        for family in ("Adams", "BDF")
    ]
