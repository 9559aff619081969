"""The angles chart for kernels: state (theta, p_theta, phi, psi), parameters with both momenta.

The chart ends at theta = 0 and pi. p_phi and p_psi enter as parameters, so every kernel of this chart must
show them again from the increments that it produced (`observe` in `loop`).
"""

from typing import Any, NamedTuple

import numpy as np

from symtop.core.jit import register_jitable
from symtop.methods.framework.outcomes import LEFT_CHART, NOT_FINITE, OK
from symtop.methods.framework.preparation import Preparation, Requirement, conserved


class ReducedTop(NamedTuple):
    """The top and its conserved momenta."""

    I1: float
    I3: float
    mgl: float
    p_psi: float
    north: float  # p_phi - p_psi
    south: float  # p_phi + p_psi


class BareTop(NamedTuple):
    """The top without its momenta, for kernels whose state has them or the rates."""

    I1: float
    I3: float
    mgl: float


@register_jitable
def chart_outcome(theta: float) -> int:
    """Is theta still a point of the chart?"""
    if 0.0 < theta < np.pi:
        return OK
    if np.isfinite(theta):
        return LEFT_CHART
    return NOT_FINITE


def _in_chart(at: Any) -> Any:
    """Is theta no pole, where phi and psi have no meaning of their own?"""
    return (at.theta > 0.0) & (at.theta < np.pi)


def _outside(at: Any) -> str:
    return f"theta must lie inside (0, pi) for an integrator in the angles chart, not {at.theta!r}"


require_chart = Requirement(_in_chart, _outside)


def _reduced(top: Any, at: Any) -> Any:
    """Kernel parameters and state of a start; p_theta0 = dL/dtheta' is the discrete Legendre transform's start."""
    momenta = conserved(top, at)
    par = ReducedTop(top.I1, top.I3, top.mgl, momenta.p_psi, momenta.north, momenta.south)
    return par, (at.theta, top.I1 * at.theta_dot, at.phi, at.psi)


reduced = Preparation(_reduced, 4, require_chart)
