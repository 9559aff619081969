"""`solve`, the only function that calls a solver: it protects the arguments and checks the result.

A solver may come from a plug-in. Whatever it raises becomes a `SymtopError` (`symtop.core.errors`), and a result that
is no `Run` or does not fit the plan raises one. A run with outcome "ok" ends before its first state that is not finite.
"""

import contextlib
import copy
from numbers import Real
from typing import Any

import numpy as np

from symtop.core.errors import SymtopError, foreign_code
from symtop.core.signals import at_most
from symtop.methods.framework.plan import LENGTH_OFF, OUTCOMES, QUATERNIONS, Array, Plan, Run, off_length
from symtop.methods.framework.registry import Integrator
from symtop.model.charts import DIMENSIONS

PATIENCE = 10.0  # seconds of processor time for the few steps backwards that probes of reversibility ask for
OWN = "symtop.methods."  # solvers of these modules do not change their arguments and are given no copies
COUNTS = ("steps", "force_evaluations", "newton_iterations", "reached")


def solve(method: Integrator, chart: str, top: Any, start: Any, plan: Plan, context: str = "") -> Run:
    """Run a method in one of its charts; messages have `context`, such as " on spheroid", after the method's name.

    A run that blows up is a result: NumPy's warnings of overflow and NaN are off. Raises SymtopError if the solver
    raises, changes the top or the start, or returns anything but a Run that fits the plan.
    """
    solver = method.solvers[chart]
    with foreign_code(f"integrator {method.name}{context}"):
        built_in, arguments = getattr(solver, "__module__", "").startswith(OWN), (top, start, plan)
        if not built_in:
            plan_copy = plan._replace(times=plan.times.copy(), marks=plan.marks.copy())
            arguments = copy.copy(top), copy.copy(start), plan_copy
        backwards = not built_in and plan.step_size < 0.0  # a loop that assumes a positive step may never end
        try:
            with np.errstate(all="ignore"), at_most(PATIENCE) if backwards else contextlib.nullcontext():
                run = solver(*arguments)
        finally:  # also after an error, of which a change is the likelier cause
            if not built_in and arguments[:2] != (top, start):
                raise SymtopError(f"integrator {method.name} must not change the top or the start that it is given")
        result = _valid_run(method, (plan.times.size, DIMENSIONS[chart]), plan, run, copy=not built_in)
        return _truncate(plan, result, chart) if chart in QUATERNIONS else result


def _valid_run(method: Integrator, shape: tuple[int, int], plan: Plan, run: Any, *, copy: bool) -> Run:
    """The run as arrays of doubles, if its shapes, its numbers and its outcome are what they must be."""
    prefix = f"integrator {method.name} must return"
    if not isinstance(run, Run):
        raise SymtopError(f"{prefix} a Run with real states of shape {shape}, not {type(run).__name__}")
    states, p_phi, p_psi = (_as_doubles(values, copy=copy) for values in run[:3])
    if states is None or states.shape != shape:
        text = "anything else" if states is None else states.shape
        raise SymtopError(f"{prefix} a Run with real states of shape {shape}, not {text}")
    outcome_ok = type(run.outcome) is str and run.outcome in OUTCOMES
    if p_phi is None or p_psi is None or p_phi.shape != shape[:1] or p_psi.shape != shape[:1] or not outcome_ok:
        outcomes = ", ".join(OUTCOMES)
        raise SymtopError(f"{prefix} real p_phi and p_psi of shape {shape[:1]} and an outcome of {outcomes}")
    for name in COUNTS:
        if not isinstance(getattr(run, name), Real):
            raise SymtopError(f"{prefix} a number of {name}, not {type(getattr(run, name)).__name__}")
        if name != "reached" and not abs(getattr(run, name)) < 2**63:  # NaN is not
            raise SymtopError(f"{prefix} a finite number of {name}, not {getattr(run, name)!r}")
    result = Run(states, p_phi, p_psi, *run[3:])
    if result.outcome == "ok" and not np.isfinite(states).all():
        return result._replace(outcome="not_finite", reached=plan.last_of(np.isfinite(states).all(axis=1)))
    return result


def _truncate(plan: Plan, run: Run, chart: str) -> Run:
    """The run, truncated where the length of its quaternion differs from one by more than `LENGTH_OFF`."""
    quaternions = run.states[:, :4]
    squares = np.einsum("ij,ij->i", quaternions, quaternions)  # six times as fast as the search that follows
    if np.abs(squares - 1.0).max(initial=0.0) <= LENGTH_OFF:
        return run
    mask = off_length(chart, run.states)
    if not mask.any():
        return run
    states, p_phi, p_psi = np.where(mask[:, None], np.nan, run.states), *np.where(mask, np.nan, run[1:3])
    return Run(states, p_phi, p_psi, *run[3:6], "not_normalised", plan.last_of(~mask))


def _as_doubles(values: object, *, copy: bool) -> Array | None:
    """An array of doubles; None of anything that is not made of real numbers."""
    if not copy and type(values) is np.ndarray and values.dtype == np.float64:
        return values  # faster than what follows
    try:
        array = np.asarray(values)
    except (ValueError, TypeError):  # ragged
        return None
    return np.array(array, dtype=np.float64, copy=True if copy else None) if array.dtype.kind in "fiu" else None
