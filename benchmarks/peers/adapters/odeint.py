"""SciPy's older `odeint`: LSODA with the loop in compiled code, which only the right-hand side leaves.

It takes the same steps as ``solve_ivp(method="LSODA")`` in about a third of the time, but SciPy advises against it in
new code, and it has no events and no dense output. Six equations on (e, L); rtol = atol = the tolerance.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.integrate import odeint

from benchmarks.peers import common
from benchmarks.peers.common import Inner, Library, Motion
from symtop.methods.framework.angles import LEAST_TOLERANCE
from symtop.methods.framework.plan import Plan
from symtop.methods.framework.registry import Integrator
from symtop.model.top import Angles, SymmetricTop

PACKAGE, DISTRIBUTION = "scipy-odeint", "scipy"
MOST_STEPS = 1_000_000  # between two samples
SUCCESS = "Integration successful."


class Odeint(Library):
    """One language of the right-hand side."""

    def __init__(self, field: Callable[[SymmetricTop], Any]) -> None:
        self.field = field

    def public(self, top: SymmetricTop, start: Angles, plan: Plan) -> Motion:
        """One call with the sample times."""
        times = common.with_start(plan)
        states, about = odeint(
            self.field(top), common.start_of(top, start), times,
            tfirst=True, rtol=plan.tolerance, atol=plan.tolerance, mxstep=MOST_STEPS, full_output=True,
        )  # fmt: skip
        if about["message"] != SUCCESS:  # it leaves zeros where it did not get to, and counts that mean nothing
            return Motion(np.empty((0, 6)))
        return Motion(states[times.size - plan.times.size :], int(about["nst"][-1]), int(about["nfe"][-1]))

    def inner(self, top: SymmetricTop, start: Angles, plan: Plan) -> Inner:
        """One call with two times."""
        field, state, ends, bound = self.field(top), common.start_of(top, start), [0.0, plan.horizon], plan.tolerance
        return Inner(
            lambda: odeint(field, state, ends, tfirst=True, rtol=bound, atol=bound, mxstep=MOST_STEPS),
            lambda states: states[-1],
        )


def peers() -> list[tuple[Integrator, str]]:
    """Two languages of the right-hand side; the loop is compiled, but every call goes through Python."""
    return [
        (
            common.record(f"scipy-odeint-{suffix}", Odeint(field), f"odeint; {common.SAME}", least=LEAST_TOLERANCE),
            language,
        )
        for suffix, language, field in (
            ("python", common.PYTHON, common.python_field),
            ("numba", common.NUMBA_IN_PYTHON, common.compiled_field),
        )
    ]
