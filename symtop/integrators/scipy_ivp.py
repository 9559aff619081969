"""SciPy's solvers on the full Euler-Lagrange equations, as a user of SciPy would call them.

Six variables, nothing reduced, so that every conserved quantity is free to drift:

    theta'' = sin(theta) [phi' (I1 phi' cos(theta) - I3 w3) + mgl] / I1,     w3 = psi' + phi' cos(theta)
    phi''   = theta' (I3 w3 - 2 I1 phi' cos(theta)) / (I1 sin(theta))
    psi''   = theta' phi' sin(theta) - phi'' cos(theta)

The tolerance is used for both rtol and atol. `rk45` is Dormand-Prince 5(4), explicit, of order 5, neither
symplectic nor symmetric; nothing is conserved. The right-hand side is plain Python on floats, three times faster
than the same lines on NumPy scalars. Source: Dormand and Prince, J. Comput. Appl. Math. 6 (1980) 19.
"""

from collections.abc import Callable
from math import cos, sin
from typing import Any

import numpy as np

from symtop.integrators.angles import require_chart
from symtop.integrators.registry import Integrator, Plan, Run
from symtop.top import Angles, SymmetricTop

EVALUATIONS = 20_000_000  # a run's limit: about two minutes
LEAST_TOLERANCE = 2.3e-14  # SciPy itself refuses rtol below 100 eps


def euler_lagrange(top: SymmetricTop) -> Callable[[float, Any], tuple[float, ...]]:
    """Right-hand side of y' = f(t, y) with y = (theta, phi, psi, theta', phi', psi')."""
    I1, I3, mgl = top.I1, top.I3, top.mgl

    def rhs(_: float, y: Any) -> tuple[float, ...]:
        theta, _, _, theta_dot, phi_dot, psi_dot = y.tolist()
        s, c = sin(theta), cos(theta)
        spin = I3 * (psi_dot + phi_dot * c)
        theta_ddot = s * (phi_dot * (I1 * phi_dot * c - spin) + mgl) / I1
        phi_ddot = theta_dot * (spin - 2.0 * I1 * phi_dot * c) / (I1 * s)
        return theta_dot, phi_dot, psi_dot, theta_ddot, phi_ddot, theta_dot * phi_dot * s - phi_ddot * c

    return rhs


def solver(method: str) -> Callable[[SymmetricTop, Angles, Plan], Run]:
    """A solver of the registry around one method of ``scipy.integrate``.

    This is the loop of ``solve_ivp`` with ``t_eval``, to the same bits, kept open so that a run that fails
    returns what it had and a run that would never end is stopped.
    """

    def solve(top: SymmetricTop, start: Angles, plan: Plan) -> Run:
        from scipy import integrate  # noqa: PLC0415  (0.6 s to import)

        require_chart(start)
        y0 = (start.theta, start.phi, start.psi, start.theta_dot, start.phi_dot, start.psi_dot)
        found = np.full((6, plan.times.size), np.nan)
        steps = seen = 0
        outcome = "ok"
        with np.errstate(all="ignore"):
            method_class = getattr(integrate, method)
            stepper = method_class(euler_lagrange(top), 0.0, y0, plan.horizon, rtol=plan.tolerance, atol=plan.tolerance)
            while stepper.status == "running" and outcome == "ok":
                try:
                    stepper.step()
                except (OverflowError, ZeroDivisionError, ValueError):  # sin of infinity, or a pole hit exactly
                    outcome = "not_finite"
                    break
                if stepper.status == "failed":
                    outcome = "step_too_small"
                    break
                steps += 1
                now = int(np.searchsorted(plan.times, stepper.t, side="right"))
                if now > seen:
                    found[:, seen:now] = stepper.dense_output()(plan.times[seen:now])
                    seen = now
                outcome = _judge(stepper)
        reached = plan.horizon if outcome == "ok" else float(stepper.t)
        return _as_run(top, found, steps, int(stepper.nfev), outcome, reached)

    return solve


def _judge(stepper: Any) -> str:
    theta = stepper.y[0]
    if not np.isfinite(stepper.y).all():
        return "not_finite"
    if not 0.0 < theta < np.pi:
        return "left_chart"
    return "out_of_budget" if stepper.nfev > EVALUATIONS else "ok"


def _as_run(top: SymmetricTop, found: Any, steps: int, evaluations: int, outcome: str, reached: float) -> Run:
    """p_theta and both momenta from the angles and rates that were found."""
    theta, phi, psi, theta_dot, phi_dot, psi_dot = found
    states = np.stack([theta, top.I1 * theta_dot, phi, psi], axis=-1)
    p_psi = top.I3 * (psi_dot + phi_dot * np.cos(theta))
    p_phi = top.I1 * phi_dot * np.sin(theta) ** 2 + p_psi * np.cos(theta)
    return Run(states, p_phi, p_psi, steps, evaluations, 0, outcome, reached)


def built_in() -> list[Integrator]:
    """SciPy's methods under the names of this registry."""
    return [
        Integrator(
            name="rk45",
            family="library",
            summary="SciPy's RK45 (Dormand-Prince) on the six-variable Euler-Lagrange equations",
            solvers={"angles": solver("RK45")},
            knob="tolerance",
            tier="python",
            order=5,
            explicit=True,
            symplectic=False,
            symmetric=False,
            conserves=frozenset(),
            least_tolerance=LEAST_TOLERANCE,
            reference="dormand-prince-1980",
        ),
    ]
