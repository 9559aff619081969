"""SciPy's solvers on the top's equations in any chart, as a user of SciPy would call them.

Nothing is reduced (see `equations`), so that every conserved quantity is free to drift; the tolerance is used for
both rtol and atol; no Jacobian is given. None of the four is symplectic or symmetric, and nothing is conserved but
p_phi in the space frame, where it is a component of the state.

    rk45     Dormand-Prince 5(4), explicit, order 5               Dormand and Prince, JCAM 6 (1980) 19
    dop853   Dormand-Prince 8(5,3), explicit, order 8             Hairer, Norsett, Wanner, Solving ODEs I, II.5
    radau    Radau IIA, 3 stages, implicit, order 5, L-stable     Hairer and Wanner, Solving ODEs II, IV.8
    lsoda    Adams (order 1-12) or BDF (1-5), chosen on the way   Petzold, SIAM J. Sci. Stat. Comput. 4 (1983) 136

Radau and LSODA are made for stiff equations, which the top's are not: they are here because people use them. Every
call of the right-hand side is counted, also those of difference quotients for a Jacobian, unlike SciPy's `nfev` of
Radau. In the registry the right-hand side is plain Python on floats; ``scipy_method(name, compiled=True)`` is the same
solver around one that numba has compiled, from the same source. The loop around it is SciPy's (LSODA's is Fortran).
"""

import contextlib
import functools
import warnings
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from symtop.core.errors import SymtopError, one_of
from symtop.methods.framework.angles import LEAST_TOLERANCE
from symtop.methods.framework.equations import FORMS, FORMULATIONS, as_run, compiled_field
from symtop.methods.framework.plan import NOT_FINITE, OK, OUT_OF_BUDGET, STEP_TOO_SMALL, Array, Plan, Run
from symtop.methods.framework.registry import Integrator, Solver
from symtop.model.top import Angles, SymmetricTop

# a run's limit: about half a minute each; other classes have the last
EVALUATIONS = {"RK45": 6_000_000, "DOP853": 7_000_000, "LSODA": 9_000_000, "Radau": 1_800_000}


class RightHandSide:
    """y' = f(t, y) of a chart, in plain Python on floats or by its `compiled_field`, and how often it was called."""

    __slots__ = ("calls", "compiled", "field", "par")

    def __init__(self, field: Callable[[Any, Any], Any], par: Any, compiled: Any = None) -> None:
        self.field, self.par, self.compiled = field, par, compiled
        self.calls = 0

    def __call__(self, _: float, y: Any) -> Any:
        """y' at any time."""
        self.calls += 1
        return self.field(self.par, y.tolist()) if self.compiled is None else self.compiled(y)


def solver(method: str | type, chart: str, *, compiled: bool = False) -> Solver:
    """A solver of the registry around a method of ``scipy.integrate`` or a class like it.

    `compiled` is for the right-hand side. The loop is that of ``solve_ivp`` with ``t_eval``, to the same bits, but a
    run that fails returns the samples before the failure, and one that would never end is stopped.
    """
    form = FORMS[chart]
    limit = EVALUATIONS.get(method if isinstance(method, str) else "", EVALUATIONS["Radau"])

    def solve(top: SymmetricTop, start: Angles, plan: Plan) -> Run:
        from scipy import integrate  # 0.6 s to import

        par, y0 = form.prepare(top, start)
        kernel = functools.partial(compiled_field(chart), top.I1, top.I3, top.mgl) if compiled else None
        rhs = RightHandSide(form.field, par, kernel)
        states = np.full((plan.times.size, len(y0)), np.nan)
        steps = row = 0
        outcome = OK
        with np.errstate(all="ignore"), warnings.catch_warnings() if method == "LSODA" else contextlib.nullcontext():
            if method == "LSODA":  # its failures are in its status as well; filters belong to all threads
                warnings.filterwarnings("ignore", "lsoda: ", UserWarning)
            make: Callable[..., Any] = getattr(integrate, method) if isinstance(method, str) else method
            stepper = make(rhs, 0.0, y0, plan.horizon, rtol=plan.tolerance, atol=plan.tolerance)
            while stepper.status == "running" and outcome == OK:
                try:
                    stepper.step()
                    if stepper.status == "failed":
                        outcome = STEP_TOO_SMALL if np.isfinite(stepper.y).all() else NOT_FINITE
                        break
                    steps += 1
                    end = int(np.searchsorted(plan.times, stepper.t, side="right"))
                    if end > row:
                        states[row:end] = stepper.dense_output()(plan.times[row:end]).T  # DOP853 evaluates f here too
                        row = end
                except (OverflowError, ZeroDivisionError, ValueError):  # sin of infinity, or no finite Jacobian
                    outcome = NOT_FINITE
                    break
                outcome = form.ended(stepper.y.tolist())
                if outcome == OK and rhs.calls > plan.most(limit) and stepper.status == "running":
                    outcome = OUT_OF_BUDGET
        reached = plan.horizon if outcome == OK else float(stepper.t)
        return as_run(form, par, plan.times, states, steps, rhs.calls, outcome, reached)

    return solve


def integrated(
    rates: Callable[..., Any], start: Sequence[float], times: Array, method: str, tolerance: float, events: Any = None
) -> Array:
    """``solve_ivp`` at times from 0, (variables, times), those before a terminal event of `events`; or SymtopError."""
    from scipy.integrate import solve_ivp  # 0.6 s to import

    span = (0.0, float(times[-1]))
    solution = solve_ivp(rates, span, start, method=method, rtol=tolerance, atol=tolerance, t_eval=times, events=events)
    if not solution.success:
        raise SymtopError(f"{method} cannot integrate to t = {times[-1]:g}: {solution.message}")
    return solution.y  # type: ignore[no-any-return]


_METHODS = {  # summary, order, reference, explicit
    "RK45": ("Dormand-Prince 5(4)", 5, "dormand-prince-1980", True),
    "DOP853": ("Dormand-Prince 8(5,3)", 8, "hairer-norsett-wanner-1993", True),
    "LSODA": ("Adams or BDF of variable order", None, "petzold-1983 hindmarsh-1983", False),
    "Radau": ("implicit Radau IIA", 5, "hairer-wanner-1996", False),
}


def scipy_method(name: str, *, compiled: bool = False) -> Integrator:
    """One of SciPy's methods, "RK45", "DOP853", "LSODA" or "Radau", in every chart; `compiled` is the right-hand side.

    With a compiled one the name ends in "-numba", and it is not in the registry. Raises SymtopError for another name.
    """
    summary, order, reference, explicit = _METHODS[one_of("name", name, _METHODS)]
    return Integrator(
        name=f"{name.lower()}-numba" if compiled else name.lower(),
        family="library",
        summary=f"SciPy's {name} ({summary}), the right-hand side in {'numba' if compiled else 'Python'}",
        solvers={chart: solver(name, chart, compiled=compiled) for chart in (FORMULATIONS if compiled else FORMS)},
        control="tolerance",
        implementation="python",
        order=order,
        explicit=explicit,
        symplectic=False,
        symmetric=False,
        conserves=frozenset(),
        least_tolerance=LEAST_TOLERANCE,
        reference=reference,
        needs="derivative",
        general=True,
        inner_loop="Python",
        same_steps_as="rk45-compiled" if name == "RK45" else None,
    )


def built_in() -> list[Integrator]:
    """SciPy's methods under the names of this registry."""
    return [scipy_method(name) for name in _METHODS]
