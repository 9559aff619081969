"""SciPy's `solve_ivp`: RK45, DOP853, LSODA, Radau, with a right-hand side in Python and one compiled by numba.

Six equations on (e, L); rtol = atol = the tolerance; samples by dense output. The loop around every step is Python
either way. The same four on the Euler angles, as most users would write them, are symtop's own `rk45`, `dop853`, ...
"""

from collections.abc import Callable
from typing import Any

from scipy.integrate import solve_ivp

from benchmarks.peers.common import ON_AXIS, SAME, compiled_field, peer, python_field, run_of, start_of
from symtop.methods.dormand_prince import LEAST_TOLERANCE
from symtop.methods.plan import Plan, Run
from symtop.methods.registry import Integrator, Solver
from symtop.model.top import Angles, SymmetricTop

PACKAGE = "scipy"
ORDERS = {"RK45": 5, "DOP853": 8, "LSODA": None, "Radau": 5}
LEAST = {"Radau": 1e-8}  # a run of ten nutations takes half a second there, and ten times that two decades on


def _solver(method: str, field: Callable[[SymmetricTop], Any]) -> Solver:
    def solve(top: SymmetricTop, start: Angles, plan: Plan) -> Run:
        found = solve_ivp(
            field(top),
            (0.0, plan.horizon),
            start_of(top, start),
            method=method,
            t_eval=plan.times,
            rtol=plan.tolerance,
            atol=plan.tolerance,
        )
        return run_of(plan, found.y.T, found.t.size, found.nfev)

    return solve


def peers() -> list[Integrator]:
    """Four methods, two languages of the right-hand side."""
    return [
        peer(
            f"scipy-{method.lower()}-{language}",
            _solver(method, field),
            f"solve_ivp, {ON_AXIS}, right-hand side in {language}; {SAME}",
            implementation="python",
            order=order,
            least=LEAST.get(method, LEAST_TOLERANCE),
        )
        for method, order in ORDERS.items()
        for language, field in (("python", python_field), ("numba", compiled_field))
    ]
