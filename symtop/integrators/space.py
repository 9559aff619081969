"""The space-frame charts for kernels: state (e, L) on the axis, (q, L) on the attitude. Nothing is singular.

    e' = L x e / I1,    q' = (L q / I1 + twist q k) / 2,    L' = mgl k x e,    twist = p_psi (1/I3 - 1/I1)

p_phi = L_z and p_psi = L.e are not parameters of these charts: they are read off the state, and whatever a kernel does
to them shows.
"""

from typing import Any, NamedTuple

import numpy as np

from symtop import charts
from symtop.integrators.compiled import register_jitable
from symtop.integrators.outcomes import NOT_FINITE, OK
from symtop.top import Angles, SymmetricTop


class SpaceTop(NamedTuple):
    """The numbers of the top that the space-frame equations need."""

    I1: float
    mgl: float
    twist: float


def _prepare(chart: str, top: SymmetricTop, at: Angles) -> tuple[SpaceTop, tuple[float, ...]]:
    spin = top.I3 * at.spin * (1.0 / top.I3 - 1.0 / top.I1)
    return SpaceTop(top.I1, top.mgl, spin), tuple(float(value) for value in charts.space_state(chart, top, at))


def on_axis(top: SymmetricTop, at: Angles) -> tuple[SpaceTop, tuple[float, ...]]:
    """Kernel parameters and state (e, L) of a start."""
    return _prepare("axis", top, at)


def on_attitude(top: SymmetricTop, at: Angles) -> tuple[SpaceTop, tuple[float, ...]]:
    """Kernel parameters and state (q, L) of a start."""
    return _prepare("attitude", top, at)


@register_jitable
def finite_outcome(value: float) -> int:
    """Is a number that every component feeds into still finite?"""
    return OK if np.isfinite(value) else NOT_FINITE


def observe_axis(par: Any, rule: Any, before: Any, dstate: Any, h: float) -> Any:
    """p_phi = L_z and p_psi = L.e after the step."""
    p_psi = 0.0
    for i in range(3):
        p_psi += (before[i] + dstate[i]) * (before[3 + i] + dstate[3 + i])
    return before[5] + dstate[5], p_psi


def observe_attitude(par: Any, rule: Any, before: Any, dstate: Any, h: float) -> Any:
    """p_phi = L_z and p_psi = L.e(q) after the step."""
    w, x = before[0] + dstate[0], before[1] + dstate[1]
    y, z = before[2] + dstate[2], before[3] + dstate[3]
    axis = (2.0 * (x * z + w * y), 2.0 * (y * z - w * x), w * w - x * x - y * y + z * z)
    p_psi = 0.0
    for i in range(3):
        p_psi += axis[i] * (before[4 + i] + dstate[4 + i])
    return before[6] + dstate[6], p_psi
