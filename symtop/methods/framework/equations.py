"""The top's equations of motion for solvers of ordinary differential equations: a right-hand side y' = f(y) per chart.

    chart      y                                       multiplications, divisions   sines, cosines   ends
    angles     (theta, phi, psi, theta', phi', psi')                           16                2   theta = 0 and pi
    axis       (e, L)                                                          12                0   nowhere
    attitude   (q, L)                                                          43                0   nowhere

(see `angles` and `space`). In each of the three, energy and momenta are functions of the state, so that a method's
errors in them are visible. Every Runge-Kutta method, compiled or a library's, takes f from here, so that method and
chart can be varied one at a time; `field` gives f to a user's solver. A Runge-Kutta method keeps what is linear in its
state, and no explicit one keeps more: p_phi = L_z in the space frame, nothing in angles.
"""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from symtop.core.errors import SymtopError, one_of
from symtop.core.jit import compile_kernel, register_jitable
from symtop.core.numbers import real_numbers
from symtop.methods.framework import angles, body, space
from symtop.methods.framework.angles import field_angles
from symtop.methods.framework.plan import OUTCOMES, Array, Run
from symtop.methods.framework.preparation import BareTop
from symtop.methods.framework.space import AttitudeTop, SpaceTop, field_attitude, field_axis
from symtop.model.charts import BODY, CHARTS, lifted, space_momenta
from symtop.model.scenes import Scene, scene
from symtop.model.top import Angles, SymmetricTop, of_kind


class Formulation(NamedTuple):
    """The equations in one chart. `field`, `ended` and `observe` are plain Python on tuples and compile as they are."""

    field: Callable[[Any, Any], Any]  # (par, state) -> time derivative
    ended: Callable[[Any], int]  # outcome of a state: OK, or how the chart was left
    observe: Callable[..., Any]  # (par, rule, before, dstate, h) -> p_phi and p_psi after a step
    prepare: Any  # (top, start) -> parameters and state
    present: Callable[[Any, Array, Array], Array] | None  # (par, times, states) -> states as shown, if they differ
    momenta: Callable[[Any, Array], tuple[Array, Array]]  # (par, states) -> p_phi and p_psi of samples
    top: Any = None  # the NamedTuple of the parameters


FORMULATIONS = {
    "angles": Formulation(
        angles.field_angles, angles.ended_angles, angles.observe_angles, angles.with_rates, angles.to_angles,
        lambda par, y: angles.momenta(par, y[:, 0], y[:, 4], y[:, 5]), BareTop,
    ),
    "axis": Formulation(
        space.field_axis, space.ended_space, space.observe_axis, space.on_axis, None,
        lambda _, states: space_momenta("axis", states), SpaceTop,
    ),
    "attitude": Formulation(
        space.field_attitude, space.ended_space, space.observe_attitude, space.on_state, None,
        lambda _, states: space_momenta("attitude", states), AttitudeTop,
    ),
}  # fmt: skip

FORMS = FORMULATIONS | {  # and for a body without symmetry
    BODY: Formulation(
        body.field_body, space.ended_space, body.observe_body, body.on_body, None,
        lambda _, states: (lifted(states)[..., 2], states[..., 6].copy()), body.General,
    )
}  # fmt: skip


def as_run(
    form: Formulation, par: Any, times: Array, states: Array, steps: int, evaluations: int, outcome: int, reached: float
) -> Run:
    """Samples of the state that was integrated, shape (samples, dimension), with both momenta recomputed from it."""
    p_phi, p_psi = form.momenta(par, states)
    samples = states if form.present is None else form.present(par, times, states)
    return Run(samples, p_phi, p_psi, steps, evaluations, 0, OUTCOMES[outcome], reached)


_RIGHT: dict[str, Callable[..., Any]] = {  # by chart: f(I1, I3, mgl, y)
    "angles": lambda I1, I3, mgl, y: field_angles(BareTop(I1, I3, mgl), y),
    "axis": lambda I1, _I3, mgl, y: field_axis(SpaceTop(I1, mgl, 0.0), y),
    "attitude": lambda I1, I3, mgl, y: field_attitude(AttitudeTop(I1, mgl, 1.0 / I3 - 1.0 / I1), y),
}


@functools.cache
def compiled_field(chart: str) -> Any:
    """f(I1, I3, mgl, y) -> y' of a chart of the top, compiled."""
    right = register_jitable(_RIGHT[chart])

    def kernel(I1, I3, mgl, y):  # type: ignore[no-untyped-def]
        return np.array(right(I1, I3, mgl, y))

    return compile_kernel(kernel)


class Field:
    """y' = f(t, y) of a chart of one top, as `field` makes it."""

    def __init__(self, chart: str, top: SymmetricTop, *, compiled: bool) -> None:
        self.chart, self.top, self.compiled = chart, top, compiled
        self.parameters = top.I1, top.I3, top.mgl
        self._shape = (FORMULATIONS[chart].prepare.size,)

    def __call__(self, _: float, y: Any) -> Array:
        """y' at any time: an array like y. Raises SymtopError for a y that is no state of the chart."""
        if not isinstance(y, np.ndarray) or y.dtype != np.float64:
            y = real_numbers("y", y)
        if y.shape != self._shape:  # compiled code would read beyond the end of the array
            raise SymtopError(f"y must have the shape {self._shape} in the chart {self.chart}, not {y.shape}")
        if self.compiled:
            return np.asarray(self.kernel(*self.parameters, y))
        return np.array(_RIGHT[self.chart](*self.parameters, np.asarray(y, dtype=float).tolist()))

    @property
    def kernel(self) -> Any:
        """The compiled function (I1, I3, mgl, y) -> y', which other compiled code may call with `parameters`."""
        return compiled_field(self.chart)

    def state(self, start: Angles) -> Array:
        """The state y of a start."""
        return np.array(FORMULATIONS[self.chart].prepare(self.top, of_kind(start, Angles))[1], dtype=float)


def field(chart: str, top: SymmetricTop | Scene | str, *, compiled: bool = False) -> Field:
    """The equations of a top, or of a scene's, as a function f(t, y) -> y', for ``solve_ivp`` or one's own solver.

    `chart` says what y is, an array of floats:

        angles     (6,)  theta, phi, psi, theta', phi', psi'     rad and rad per unit time; NaN at theta = 0 and pi
        axis       (6,)  e (unit vector along the axis) and L    both in the space frame, z up; L in units of I1 x rate
        attitude   (7,)  q (w, x, y, z; body to space) and L     as for the axis

    ``f.state(start)`` is an `Angles` as y. With `compiled` each call runs compiled code (y must be an array of floats);
    ``f.kernel(*f.parameters, y)`` can be called from functions that numba compiles; it does not look at the shape of y.

    Raises SymtopError for another chart and for what is no top; so does a call for a y of another shape.
    """
    top = scene(top, bodies=True).top if isinstance(top, (Scene, str)) else top
    if not isinstance(top, SymmetricTop):
        raise SymtopError(f"top must be a SymmetricTop, a scene or its name, not {type(top).__name__}")
    return Field(one_of("chart", chart, CHARTS), top, compiled=compiled)
