"""SciPy's older `odeint`: LSODA with the loop in compiled code, which only the right-hand side leaves.

It takes the same steps as ``solve_ivp(method="LSODA")`` in about a third of the time, but SciPy advises against it in
new code, and it has no events and no dense output. Six equations on (e, L); rtol = atol = the tolerance.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.integrate import odeint

from benchmarks.peers.common import ON_AXIS, SAME, compiled_field, peer, python_field, run_of, start_of, with_start
from symtop.methods.dormand_prince import LEAST_TOLERANCE
from symtop.methods.plan import Plan, Run
from symtop.methods.registry import Integrator, Solver
from symtop.model.top import Angles, SymmetricTop

PACKAGE, DISTRIBUTION = "scipy-odeint", "scipy"
MOST_STEPS = 1_000_000  # between two samples
SUCCESS = "Integration successful."


def _solver(field: Callable[[SymmetricTop], Any]) -> Solver:
    def solve(top: SymmetricTop, start: Angles, plan: Plan) -> Run:
        times = with_start(plan)
        states, about = odeint(
            field(top),
            start_of(top, start),
            times,
            tfirst=True,
            rtol=plan.tolerance,
            atol=plan.tolerance,
            mxstep=MOST_STEPS,
            full_output=True,
        )
        if about["message"] != SUCCESS:  # it leaves zeros where it did not get to, and counts that mean nothing
            return run_of(plan, np.empty((0, 6)), 0, 0)
        return run_of(plan, states[times.size - plan.times.size :], int(about["nst"][-1]), int(about["nfe"][-1]))

    return solve


def peers() -> list[Integrator]:
    """Two languages of the right-hand side; the loop is Fortran's or C's, but every call goes through Python."""
    return [
        peer(
            f"scipy-odeint-{language}",
            _solver(field),
            f"odeint, {ON_AXIS}, right-hand side in {language}; {SAME}",
            implementation="compiled",
            least=LEAST_TOLERANCE,
        )
        for language, field in (("python", python_field), ("numba", compiled_field))
    ]
