"""scikit-sundae: CVODE of SUNDIALS, Adams and BDF, with a right-hand side compiled by numba.

Six equations on (e, L); rtol = atol = the tolerance, and as many steps as it takes; samples by its own interpolation.
The interface calls the right-hand side as a Python object, so that each call goes through Python.
"""

import functools
import types
from typing import Any

from benchmarks.peers.common import ON_AXIS, SAME, filling_field, peer, run_of, start_of, with_start
from symtop.methods.plan import Plan, Run
from symtop.methods.registry import Integrator, Solver
from symtop.model.top import Angles, SymmetricTop

PACKAGE = "scikit-sundae"
MOST_STEPS = 10_000_000


def _with_signature(field: Any) -> Any:
    """CVODE inspects the number of arguments, which a compiled function does not show."""

    def call(t: float, y: Any, out: Any) -> None:
        field(t, y, out)

    return call


def _solver(cvode: types.ModuleType, family: str) -> Solver:
    @functools.lru_cache(maxsize=256)
    def prepared(top: SymmetricTop, tolerance: float) -> Any:
        return cvode.CVODE(
            _with_signature(filling_field(top)), method=family, rtol=tolerance, atol=tolerance, max_num_steps=MOST_STEPS
        )

    def solve(top: SymmetricTop, start: Angles, plan: Plan) -> Run:
        solver, times = prepared(top, plan.tolerance), with_start(plan)
        state = start_of(top, start)
        if times.size > 2:
            found = solver.solve(times, state)
            states = found.y
        else:
            solver.init_step(0.0, state)
            found = solver.step(plan.horizon)
            states = [state, found.y]
        return run_of(plan, states[times.size - plan.times.size :], 0, found.nfev)

    return solve


def peers() -> list[Integrator]:
    """Both families of multistep methods."""
    from sksundae import cvode

    return [
        peer(
            f"cvode-{family.lower()}",
            _solver(cvode, family),
            f"{ON_AXIS}, right-hand side in numba; {SAME}",
            implementation="compiled",
        )
        for family in ("Adams", "BDF")
    ]
