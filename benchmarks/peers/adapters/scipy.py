"""SciPy's `solve_ivp`: RK45, DOP853, LSODA, Radau, on two formulations, each in Python and compiled by numba.

rtol = atol = the tolerance; samples by dense output. The loop around every step is Python either way. Its set-up (about
0.1 ms) is part of `solve_ivp` and cannot be taken out of the call, so that it is in both of the times.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from benchmarks.peers import common
from benchmarks.peers.common import Inner, Library, Motion
from symtop.methods.framework.angles import LEAST_TOLERANCE
from symtop.methods.framework.plan import Array, Plan
from symtop.methods.framework.registry import Integrator
from symtop.model.top import Angles, SymmetricTop

PACKAGE = "scipy"
ORDERS = {"RK45": 5, "DOP853": 8, "LSODA": None, "Radau": 5}
CHARTS = {"Radau": ("axis",)}  # the slowest by far: in one chart
LEAST = {"Radau": 1e-8}  # a run of ten nutations takes half a second there, and ten times that two decades on
FIELDS = {
    "axis": {common.PYTHON: common.python_field, common.NUMBA_IN_PYTHON: common.compiled_field},
    "angles": {common.PYTHON: common.python_angles, common.NUMBA_IN_PYTHON: common.compiled_angles},
}
SUFFIX = {common.PYTHON: "python", common.NUMBA_IN_PYTHON: "numba"}


class SolveIvp(Library):
    """One method on one chart."""

    def __init__(self, method: str, chart: str, field: Callable[[SymmetricTop], Any]) -> None:
        self.method, self.chart, self.field = method, chart, field
        self.start_of = common.angles_of if chart == "angles" else common.start_of

    def public(self, top: SymmetricTop, start: Angles, plan: Plan) -> Motion:
        """One call with the sample times."""
        solution = solve_ivp(
            self.field(top), (0.0, plan.horizon), self.start_of(top, start),
            method=self.method, t_eval=plan.times, rtol=plan.tolerance, atol=plan.tolerance,
        )  # fmt: skip
        return Motion(solution.y.T, 0, solution.nfev)

    def inner(self, top: SymmetricTop, start: Angles, plan: Plan) -> Inner:
        """One call that keeps its own steps."""
        field, state, span = self.field(top), self.start_of(top, start), (0.0, plan.horizon)
        method, tolerance = self.method, plan.tolerance
        return Inner(
            lambda: solve_ivp(field, span, state, method=method, rtol=tolerance, atol=tolerance),
            lambda solution: solution.y[:, -1],
        )

    def states_of(self, top: SymmetricTop, start: Angles, rows: Array) -> Array:
        """In angles, the momentum in place of the rate."""
        del start
        if self.chart == "axis":
            return rows
        return np.stack([rows[:, 0], top.I1 * rows[:, 3], rows[:, 1], rows[:, 2]], axis=-1)


def peers() -> list[tuple[Integrator, str]]:
    """Four methods, two charts, two languages of the right-hand side."""
    return [
        (
            common.record(
                f"scipy-{method.lower()}-{SUFFIX[language]}",
                SolveIvp(method, chart, field),
                f"solve_ivp; {common.SAME}",
                implementation="python",
                order=order,
                least=LEAST.get(method, LEAST_TOLERANCE),
            ),
            language,
        )
        for method, order in ORDERS.items()
        for chart, fields in FIELDS.items()
        if chart in CHARTS.get(method, FIELDS)
        for language, field in fields.items()
    ]
