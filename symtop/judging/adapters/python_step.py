"""Adapters of steps in Python: functions in a chart, of a rigid body or of the nutation, and classes like SciPy's.

*ode*, ``step(f, t, y, h) -> y`` for y' = f(t, y): y and what f returns are NumPy arrays of shape (6,), (e, L) on the
axis or (theta, phi, psi and their rates) in angles, or (7,), (q, L) on the attitude, and on a body without symmetry
(q, M) with the momentum in body axes (`symtop.methods.framework.body`). h may be negative. A step that changes its
input in place, and returns it, works.

*rotation*, ``step(q, w, h, inertia, torque) -> q, w`` for a rigid body, as engines integrate it, in the body frame:

    q' = q (0, w) / 2,        inertia w' = (inertia w) x w + torque(q)

q = (w, x, y, z) turns body vectors into space vectors, w is the angular velocity, inertia holds the three principal
moments about the pivot, (I1, I1, I3) of a top, and torque(q) is that of gravity. L in space is R(q) inertia w, R(q)
with q scaled to length one; a q of another length shows as an axis that is not a unit vector. A step that returns a
matrix of shape (3, 3) instead of q is given R, body to space, and torque(R); an R that is no rotation shows likewise.

*separable*, ``step(state, h, dT, dV) -> state`` for the nutation alone, whose Hamiltonian separates:

    H = T(p_theta) + V(theta),     T = p_theta^2/2 I1,     V the effective potential at the p_phi and p_psi of the start

state is (theta, p_theta), a NumPy array of shape (2,), in radians and the units of the scene's top; dT is p_theta/I1
and dV the slope of V, both of one number. The chart ends at theta = 0 and pi.

*scipy*, a class derived from ``scipy.integrate.OdeSolver``: max_step = first_step = h with tolerances that accept any
error make steps of h, so that the formula is judged and not its step control; the end of the interval lies beyond the
last step, which is never shortened. The stages of an implicit class are still solved accurately: the tolerances of
Newton's iteration, which SciPy's classes and similar ones have in `newton_tol`, `kappa` and `tiny_err`, are set to
`STAGE_ERROR`, with at most `MOST_NEWTON` iterations. With a tolerance, rtol = atol, the class chooses its steps, as in
``solve_ivp``.
"""

import contextlib
import math
import sys
import threading
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from symtop.core.errors import SymtopError
from symtop.judging.adapters.adapter import Marks, Stepper, heartbeat, label_of, repeat
from symtop.methods.framework.angles import chart_outcome, on_angles
from symtop.methods.framework.body import torque as torque_of
from symtop.methods.framework.equations import FORMS, FORMULATIONS, Formulation
from symtop.methods.framework.plan import Array
from symtop.methods.framework.space import on_attitude
from symtop.methods.library.scipy_ivp import solver as solver_of
from symtop.model.body import RigidBody, rotated, vertical
from symtop.model.charts import BODY, space_momenta
from symtop.model.top import Angles, SymmetricTop, effective_force

Field = Callable[[float, Array], Array]
PROBE_STEP = 1e-3  # step of the call that shows whether a rotation is a matrix
CONJUGATE = np.array([1.0, -1.0, -1.0, -1.0])
ANY_TOLERANCE = 1e300  # a tolerance that every step meets; with infinity, a component of zero would give NaN
LOOSE_TOLERANCE = 1e8  # the same for implicit classes, small enough that updates of Newton's iteration do not underflow
STAGE_ERROR, MOST_NEWTON, NEWTON_LIMIT = 1e-14, 50, "NEWTON_MAXITER"  # absolute; iterations; their name in SciPy
SAME_STEP = 1e-9  # relative: a step length that differs less from h is h
_patching = threading.RLock()  # `compare` runs variants in threads


def state_like(before: Array, after: Any, name: str = "step") -> Array:
    """The result of a step as an array of floats; SymtopError if it is not of the shape of `before`."""
    if type(after) is np.ndarray and after.shape == before.shape and after.dtype == np.float64:
        return after
    array = None
    with contextlib.suppress(ValueError):  # a pair of an array and a number is no array
        array = np.asarray(after) if after is not None else None
    if array is None or array.shape != before.shape or array.dtype.kind not in "fiu":
        kind = type(after).__name__ if after is not None else "None"
        form = kind if array is None else f"{kind} of shape {array.shape} and type {array.dtype}"
        raise SymtopError(f"{name} must return the new state, {before.size} real numbers, not {form}")
    return array.astype(float)


class Equations:
    """The right-hand side f(t, y) of a chart for arrays, with a count of its calls."""

    def __init__(self, chart: str, par: Any) -> None:
        self.field, self.par, self.calls = FORMS[chart].field, par, 0

    def __call__(self, _: float, y: Any) -> Array:
        """y' at any time."""
        self.calls += 1
        try:
            return np.array(self.field(self.par, np.asarray(y).tolist()))
        except (OverflowError, ZeroDivisionError, ValueError):  # the sine of infinity
            if np.isfinite(y).all():
                raise
            return np.full(np.shape(y), np.nan)


class FunctionStep(Stepper):
    """A stepper around a foreign function, whose results are checked."""

    def __init__(self, function: Callable[..., Any], name: str = "") -> None:
        self.function, self.name = function, label_of(name or function)

    def steps(self, step: Callable[[float, Array], Any], t: float, y: Array, h: float, marks: Marks) -> Array:
        """The states at the marks, from time t on; `step(t, y)` calls the function for one step of h."""

        def checked_step(k: int, y: Array) -> Array:
            before = y.copy() if k == 0 else y
            try:
                with heartbeat.call(h):
                    after = step(t + k * h, y)
            except SymtopError:
                if np.isfinite(y).all():
                    raise
                after = np.full(y.shape, np.nan)
            self.wrote = self.wrote or (k == 0 and not np.array_equal(before, y))
            return state_like(before, after)

        return repeat(checked_step, y, marks)


class PythonStep(FunctionStep):
    """A stepper around a function ``step(f, t, y, h) -> y``."""

    takes_field = True

    def __init__(self, function: Callable[..., Any], chart: str, name: str = "") -> None:
        super().__init__(function, name)
        self.chart, self.form = chart, FORMS[chart]

    def march(self, _top: SymmetricTop, par: Any, y: Array, h: float, marks: Marks) -> Array:
        """The state at the marks."""
        f = Equations(self.chart, par)
        states = self.along(f, self.since, y, h, marks)
        self.evaluations = f.calls
        return states

    def along(self, f: Field, t: float, y: Array, h: float, marks: Marks) -> Array:
        """The states at the marks for any right-hand side, from time t on."""
        return self.steps(lambda time, state: self.function(f, time, state, h), t, y, h, marks)


class ScipySolver(PythonStep):
    """A stepper around a class like SciPy's solvers; with `adaptive`, it chooses its steps by a tolerance."""

    own_loop = True  # an object may keep data during a run

    def __init__(self, kind: type, chart: str, *, adaptive: bool = False) -> None:
        from scipy.integrate import OdeSolver  # 0.6 s to import

        if not issubclass(kind, OdeSolver):
            hint = "any other step is a function, or the method of an object: FILE.py:OBJECT.METHOD"
            raise SymtopError(f"a class must be derived from scipy.integrate.OdeSolver, not {kind.__name__}; {hint}")
        super().__init__(kind, chart)
        self.adaptive = solver_of(kind, chart) if adaptive else None

    def along(self, f: Field, t: float, y: Array, h: float, marks: Marks) -> Array:
        """The states at the marks for any right-hand side, from time t on; SymtopError for steps that are not h."""
        end, size = t + (int(marks[-1]) + 2) * h, abs(h)
        with heartbeat.call(h):
            options = {"max_step": size, "first_step": size}
            solver: Any = self.function(f, t, y, end, **options, rtol=ANY_TOLERANCE, atol=ANY_TOLERANCE)
            if hasattr(solver, "newton_tol") or hasattr(solver, "kappa"):
                solver = self.function(f, t, y, end, **options, rtol=LOOSE_TOLERANCE, atol=LOOSE_TOLERANCE)
                for name in ("newton_tol", "kappa", "tiny_err"):
                    setattr(solver, name, STAGE_ERROR / LOOSE_TOLERANCE)

        def step(k: int, y: Array) -> Array:
            if solver.status != "running" or not np.isfinite(y).all():
                return np.full(y.shape, np.nan)
            with heartbeat.call(h):
                solver.step()
            if abs(solver.t - (t + (k + 1) * h)) > SAME_STEP * size * (k + 1):
                rule = f"steps of max_step = first_step = {size:.3g} where the tolerance accepts any error"
                raise SymtopError(f"{self.name} must make {rule}, and made one of {solver.t - t - k * h:.3g}")
            return state_like(y, solver.y, "a solver")

        with contextlib.ExitStack() as undo:  # allow Newton's iteration `MOST_NEWTON` iterations
            modules = {sys.modules.get(base.__module__) for base in self.function.__mro__}  # type: ignore[attr-defined]
            for module in [module for module in modules if hasattr(module, NEWTON_LIMIT)]:
                undo.enter_context(_patching)
                undo.callback(setattr, module, NEWTON_LIMIT, getattr(module, NEWTON_LIMIT))
                setattr(module, NEWTON_LIMIT, MOST_NEWTON)
            return repeat(step, state_like(y, solver.y, "a solver"), marks)


class Body(NamedTuple):
    """A rigid body on a pivot: its principal moments (3,), and its weight times the position of its centre of mass."""

    inertia: Array
    c1: float
    c2: float
    c3: float
    of_top: bool


def _body_of(top: Any, start: Any) -> tuple[Body, tuple[float, ...]]:
    """The body and the state (q, w) of a start, of a top or of a body without symmetry."""
    if isinstance(top, RigidBody):
        x, y, z = top.centre
        body = Body(np.array(top.moments), top.mgl * x, top.mgl * y, top.mgl * z, of_top=False)
        return body, (*start.quaternion, *start.omega_body)
    q, momentum = np.split(np.array(on_attitude(top, start)[1]), [4])
    inertia = np.array([top.I1, top.I1, top.I3])
    rates = rotated(q * CONJUGATE, momentum) / inertia
    return Body(inertia, 0.0, 0.0, top.mgl, of_top=True), (*q.tolist(), *rates.tolist())


def _body_shown(body: Body, _times: Array, states: Array) -> Array:
    """States (q, L) from states (q, w); for a body without symmetry (q, M), with the momentum in body axes."""
    momentum, lengths = body.inertia * states[:, 4:], np.linalg.norm(states[:, :4], axis=1, keepdims=True)
    with np.errstate(all="ignore"):
        momentum = rotated(states[:, :4] / lengths, momentum) if body.of_top else momentum
    return np.concatenate([states[:, :4], momentum], axis=1)


def _body_momenta(body: Body, states: Array) -> tuple[Array, Array]:
    rows = _body_shown(body, states[:, 0], states)
    p_phi, p_psi = space_momenta("attitude", rows) if body.of_top else FORMS[BODY].momenta(None, rows)
    return p_phi, p_psi


ROTATION = FORMULATIONS["attitude"]._replace(prepare=_body_of, present=_body_shown, momenta=_body_momenta)


def _matrix_of(top: Any, start: Any) -> tuple[Body, tuple[float, ...]]:
    """The body and the state (R, w) of a start, R row by row."""
    body, state = _body_of(top, start)
    return body, (*rotated(state[:4], np.eye(3)).T.ravel().tolist(), *state[4:])


def _with_quaternions(states: Array) -> Array:
    """States (q, w) from states (R, w): q of the nearest rotation, |q|^2 the length of R's third column; or NaN."""
    rows = np.full((len(states), 7), np.nan)
    matrices = states[:, :9].reshape(-1, 3, 3)
    with np.errstate(all="ignore"):
        valid = np.isfinite(states).all(axis=1) & (np.linalg.det(matrices) > 0.0)
    if valid.any():
        rotations = Rotation.from_matrix(matrices[valid]).as_quat()[:, [3, 0, 1, 2]]
        lengths = np.sqrt(np.linalg.norm(matrices[valid][:, :, 2], axis=1))
        rows[valid] = np.concatenate([lengths[:, None] * rotations, states[valid, 9:]], axis=1)
    return rows


MATRIX = ROTATION._replace(
    prepare=_matrix_of, present=lambda body, times, states: _body_shown(body, times, _with_quaternions(states)),
    momenta=lambda body, states: _body_momenta(body, _with_quaternions(states)),
)  # fmt: skip


class RotationStep(FunctionStep):
    """A stepper around the function of a rigid body; the torques that it asks for are its force evaluations."""

    form = ROTATION

    def __init__(self, function: Callable[..., Any], name: str = "", chart: str = "attitude") -> None:
        super().__init__(function, name)
        self.chart = chart  # or `BODY`, of a body without symmetry
        self.of_matrix = ""  # its error message for a matrix, until it has made a step
        probe = np.eye(3), np.array([0.1, 0.2, 0.3]), PROBE_STEP, np.array([1.0, 1.0, 0.5]), lambda _: np.zeros(3)
        try:
            with heartbeat.call(PROBE_STEP):
                first = function(*probe)
            with contextlib.suppress(Exception):
                self.form = MATRIX if np.shape(first[0]) == (3, 3) and np.size(first[1]) == 3 else ROTATION
        except SymtopError as error:
            self.of_matrix = str(error)

    def march(self, _top: SymmetricTop, par: Any, y: Array, h: float, marks: Marks) -> Array:
        """The state at the marks."""
        self.evaluations, shape = 0, (3, 3) if self.form is MATRIX else (4,)

        def torque(q: Any) -> Array:
            self.evaluations += 1
            q = np.asarray(q, dtype=float)
            up = q[2] if shape == (3, 3) else np.array(vertical(*q.tolist())) / (float(q @ q) or math.nan)
            return np.array(torque_of(par, *up.tolist()))

        def step(_: float, y: Array) -> Array:
            q = y[:-3].reshape(shape)
            after = self.function(q.copy(), y[-3:].copy(), h, par.inertia.copy(), torque)
            if not isinstance(after, (tuple, list)) or len(after) != 2:
                raise SymtopError(f"step must return q = (w, x, y, z) and w, a pair, not {type(after).__name__}")
            return np.concatenate([state_like(q, after[0]).ravel(), state_like(y[-3:], after[1])])

        try:
            states = self.steps(step, 0.0, y, h, marks)
        except SymtopError as error:
            matrix_error = self.of_matrix.partition("raises ")[2]
            if not matrix_error or str(error).endswith(matrix_error):
                raise
            raise SymtopError(f"{error}, given q = (w, x, y, z); given a matrix, it raises {matrix_error}") from None
        self.of_matrix = ""
        return states


def _no_field(*_: Any) -> Any:
    raise SymtopError("a map of (theta, p_theta) has no equations of six variables")


def _plane_of(top: SymmetricTop, start: Angles) -> tuple[Any, tuple[float, ...]]:
    """The top with its momenta, which are parameters of the reduced motion, and (theta, p_theta) of a start."""
    par, state = on_angles(top, start)
    return par, state[:2]


REDUCED = Formulation(
    _no_field, lambda y: chart_outcome(y[0]), _no_field, _plane_of,
    lambda _, __, states: np.pad(states, ((0, 0), (0, 2))),  # in angles, with phi = psi = 0
    lambda par, states: (np.full(len(states), 0.5 * (par.north + par.south)), np.full(len(states), par.p_psi)),
)  # fmt: skip


class SeparableStep(FunctionStep):
    """A stepper around the function of the nutation; a call of dV is a force evaluation."""

    chart, form = "nutation", REDUCED

    def march(self, _top: SymmetricTop, par: Any, y: Array, h: float, marks: Marks) -> Array:
        """The state at the marks."""
        self.evaluations = 0

        def dT(p_theta: Any) -> Any:
            return p_theta / par.I1

        def dV(theta: Any) -> Any:
            self.evaluations += 1
            try:
                return effective_force(theta, par.north, par.south, par.I1, par.mgl)[0]
            except (OverflowError, ZeroDivisionError, ValueError):  # at a pole, or at infinity
                return np.nan

        return self.steps(lambda _, state: self.function(state, h, dT, dV), 0.0, y, h, marks)
