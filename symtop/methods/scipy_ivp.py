"""SciPy's solvers on the full Euler-Lagrange equations, as a user of SciPy would call them.

Six variables, nothing reduced (see `euler_lagrange`), so that every conserved quantity is free to drift; the tolerance
is used for both rtol and atol; no Jacobian is given. None of the four is symplectic or symmetric, nothing is conserved.

    rk45     Dormand-Prince 5(4), explicit, order 5               Dormand and Prince, JCAM 6 (1980) 19
    dop853   Dormand-Prince 8(5,3), explicit, order 8             Hairer, Norsett, Wanner, Solving ODEs I, II.5
    radau    Radau IIA, 3 stages, implicit, order 5, L-stable     Hairer and Wanner, Solving ODEs II, IV.8
    lsoda    Adams (order 1-12) or BDF (1-5), chosen on the way   Petzold, SIAM J. Sci. Stat. Comput. 4 (1983) 136

Radau and LSODA are made for stiff equations, which the top's are not: they are here because people use them. Every
call of the right-hand side is counted, also those of difference quotients for a Jacobian, which SciPy's own `nfev` of
Radau leaves out. The right-hand side is plain Python on floats, three times faster than the same on NumPy scalars.
"""

import math
import warnings
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from symtop.base.validate import SymtopError
from symtop.methods.euler_lagrange import LEAST_TOLERANCE, accelerations, as_run, with_rates
from symtop.methods.plan import Plan, Run
from symtop.methods.registry import Array, Integrator, Solver
from symtop.model.top import Angles, SymmetricTop

EVALUATIONS = 20_000_000  # a run's limit: about two minutes


class EulerLagrange:
    """Right-hand side of y' = f(t, y) with y = (theta, phi, psi, theta', phi', psi'), and how often it was called."""

    __slots__ = ("calls", "numbers")

    def __init__(self, top: SymmetricTop) -> None:
        self.numbers = (top.I1, top.I3, top.mgl)
        self.calls = 0

    def __call__(self, _: float, y: Any) -> tuple[float, ...]:
        """y' at any time."""
        self.calls += 1
        theta, _, _, theta_dot, phi_dot, psi_dot = y.tolist()
        return (theta_dot, phi_dot, psi_dot, *accelerations(*self.numbers, theta, theta_dot, phi_dot, psi_dot))


def solver(method: str) -> Solver:
    """A solver of the registry around one method of ``scipy.integrate``.

    This is the loop of ``solve_ivp`` with ``t_eval``, to the same bits, kept open so that a run that fails
    returns what it had and a run that would never end is stopped.
    """

    def solve(top: SymmetricTop, start: Angles, plan: Plan) -> Run:
        from scipy import integrate  # 0.6 s to import

        _, y0 = with_rates(top, start)
        rhs = EulerLagrange(top)
        states = np.full((plan.times.size, len(y0)), np.nan)
        steps = seen = 0
        outcome = "ok"
        with np.errstate(all="ignore"), warnings.catch_warnings():
            # LSODA's failures, which are in its status as well. Nothing else is silenced: filters belong to all threads
            warnings.filterwarnings("ignore", "lsoda: ", UserWarning)
            make: Callable[..., Any] = getattr(integrate, method)
            stepper = make(rhs, 0.0, y0, plan.horizon, rtol=plan.tolerance, atol=plan.tolerance)
            while stepper.status == "running" and outcome == "ok":
                try:
                    stepper.step()
                    if stepper.status == "failed":
                        outcome = "step_too_small" if np.isfinite(stepper.y).all() else "not_finite"
                        break
                    steps += 1
                    now = int(np.searchsorted(plan.times, stepper.t, side="right"))
                    if now > seen:
                        states[seen:now] = stepper.dense_output()(plan.times[seen:now]).T  # DOP853 evaluates f here too
                        seen = now
                except (OverflowError, ZeroDivisionError, ValueError):  # sin of infinity, or no finite Jacobian
                    outcome = "not_finite"
                    break
                outcome = _judge(stepper, rhs.calls, plan.most(EVALUATIONS))
        reached = plan.horizon if outcome == "ok" else float(stepper.t)
        return as_run(top, plan.times, states, steps, rhs.calls, outcome, reached)

    return solve


def integrated(rates: Callable[..., Any], start: Sequence[float], times: Array, method: str, tolerance: float) -> Array:
    """Any equations by ``solve_ivp`` at the given times, the first 0: shape (variables, times).

    `tolerance` is both the relative and the absolute one. Raises SymtopError if the solver does not reach the end.
    """
    from scipy.integrate import solve_ivp  # 0.6 s to import

    span = (0.0, float(times[-1]))
    done = solve_ivp(rates, span, start, method=method, rtol=tolerance, atol=tolerance, t_eval=times)
    if not done.success:
        raise SymtopError(f"{method} cannot integrate to t = {times[-1]:g}: {done.message}")
    states: Array = done.y
    return states


def _judge(stepper: Any, calls: int, budget: float) -> str:
    if not np.isfinite(stepper.y).all():
        return "not_finite"
    if not 0.0 < stepper.y[0] < math.pi:
        return "left_chart"
    return "out_of_budget" if calls > budget and stepper.status == "running" else "ok"


def _entry(method: str, summary: str, order: int | None, reference: str, *, explicit: bool) -> Integrator:
    return Integrator(
        name=method.lower(),
        family="library",
        summary=f"SciPy's {method} ({summary}) on the unreduced Euler-Lagrange equations",
        solvers={"angles": solver(method)},
        control="tolerance", implementation="python", order=order, explicit=explicit, symplectic=False,
        symmetric=False, conserves=frozenset(),
        least_tolerance=LEAST_TOLERANCE,
        reference=reference,
        same_steps_as="rk45-compiled" if method == "RK45" else None,
    )  # fmt: skip


def built_in() -> list[Integrator]:
    """SciPy's methods under the names of this registry."""
    return [
        _entry("RK45", "Dormand-Prince 5(4)", 5, "dormand-prince-1980", explicit=True),
        _entry("DOP853", "Dormand-Prince 8(5,3)", 8, "prince-dormand-1981 hairer-norsett-wanner-1993", explicit=True),
        _entry("LSODA", "Adams or BDF of variable order", None, "petzold-1983 hindmarsh-1983", explicit=False),
        _entry("Radau", "implicit Radau IIA", 5, "hairer-wanner-1996", explicit=False),
    ]
