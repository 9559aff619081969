"""A Python function ``step(q, w, h, inertia, torque) -> q, w``: the rotation of a rigid body, as engines integrate it.

    q' = q (0, w) / 2,        inertia w' = (inertia w) x w + torque(q)          all in the body frame

q = (w, x, y, z) turns body vectors into space vectors, w is the angular velocity in the body frame, inertia holds the
three principal moments (I1, I1, I3) about the pivot, and torque(q) is that of gravity, in the body frame. The angular
momentum in space, L = R(q) inertia w, is made of both, R(q) with q at length one; a q that loses its length shows it
as an axis that is not a unit vector.
"""

from typing import Any, NamedTuple

import numpy as np

from symtop.core.errors import SymtopError
from symtop.judging.adapters.adapter import March, Marks
from symtop.judging.adapters.python_step import FunctionStep, state_like
from symtop.methods.framework.equations import FORMULATIONS
from symtop.methods.framework.plan import Array
from symtop.methods.framework.space import on_attitude
from symtop.model.charts import space_momenta
from symtop.model.top import Angles, SymmetricTop


class Body(NamedTuple):
    """What a rigid body on a pivot is: principal moments (3,), and its weight times the height of its centre."""

    inertia: Array
    mgl: float


def to_space(q: Any, vector: Any) -> Any:
    """R(q) vector for q of any length, shapes (..., 4) and (..., 3)."""
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    turned = np.cross(q[..., 1:], vector)
    return vector + 2.0 * (q[..., :1] * turned + np.cross(q[..., 1:], turned))


def to_body(q: Any, vector: Any) -> Any:
    """R(q)^T vector."""
    return to_space(q * np.array([1.0, -1.0, -1.0, -1.0]), vector)


def _begin(top: SymmetricTop, at: Angles) -> tuple[Body, tuple[float, ...]]:
    """The body and the state (q, w) of a start."""
    state = np.array(on_attitude(top, at)[1])
    inertia = np.array([top.I1, top.I1, top.I3])
    return Body(inertia, top.mgl), (*state[:4].tolist(), *(to_body(state[:4], state[4:]) / inertia).tolist())


def _show(body: Body, _times: Array, states: Array) -> Array:
    """States (q, L) of states (q, w)."""
    with np.errstate(all="ignore"):
        return np.concatenate([states[:, :4], to_space(states[:, :4], body.inertia * states[:, 4:])], axis=1)


def _momenta(body: Body, states: Array) -> tuple[Array, Array]:
    p_phi, p_psi = space_momenta("attitude", _show(body, states[:, 0], states))
    return p_phi, p_psi


ROTATION = FORMULATIONS["attitude"]._replace(prepare=_begin, present=_show, momenta=_momenta)


class RotationStep(FunctionStep):
    """A stepper around the function; the torques that it asks for are its force evaluations."""

    chart, form = "attitude", ROTATION

    def march(self, _top: SymmetricTop, par: Any, y: Array, h: float, marks: Marks) -> March:
        """The state at the marks."""
        calls, down = 0, np.array([0.0, 0.0, -par.mgl])

        def torque(q: Any) -> Array:
            nonlocal calls
            calls += 1
            moment: Array = np.cross([0.0, 0.0, 1.0], to_body(np.asarray(q, dtype=float), down))
            return moment

        def once(_: float, y: Array) -> Array:
            after = self.function(y[:4].copy(), y[4:].copy(), h, par.inertia.copy(), torque)
            if not isinstance(after, (tuple, list)) or len(after) != 2:
                raise SymtopError(f"step must return q and w, a pair, not {type(after).__name__}")
            parts = zip((y[:4], y[4:]), after, strict=True)
            return np.concatenate([state_like(part, value, "step") for part, value in parts])

        states = self.steps(once, 0.0, y, h, marks)
        return March(states, calls)
