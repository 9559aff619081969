"""The effective potential of the nutation, its slope and its curvature, exact to rounding at both poles.

With ``north = p_phi - p_psi`` and ``south = p_phi + p_psi`` no term is a small difference of large ones;
`symtop.model.top` derives the half-angle form and names its source. Floats and arrays; what is marked compiles as is.
"""

from typing import Any

import numpy as np

from symtop.core.jit_functions import inlined


@inlined
def effective_force(theta: Any, north: Any, south: Any, I1: Any, mgl: Any) -> Any:
    """Return ``V'(theta)``, ``phi'`` and ``cos theta``: all that one kick of the reduced top needs.

    Works on floats and on arrays, and compiles as it stands. Costs one sine and one cosine.
    """
    return half_angle_force(np.sin(0.5 * theta), np.cos(0.5 * theta), north, south, I1, mgl)


@inlined
def half_angle_force(sin_x: Any, cos_x: Any, north: Any, south: Any, I1: Any, mgl: Any) -> Any:
    """`effective_force` from the sine and cosine of theta/2, however a kernel comes by them."""
    up = north / (sin_x * sin_x)
    down = south / (cos_x * cos_x)
    tilt = sin_x * cos_x  # sin(theta)/2, and F = tilt (up + down)
    slope = tilt * ((up + down) * (down - up) / (8.0 * I1) - 2.0 * mgl)
    return slope, (up + down) / (4.0 * I1), cos_x * cos_x - sin_x * sin_x


@inlined
def effective_stiffness(theta: Any, north: Any, south: Any, I1: Any, mgl: Any) -> Any:
    """Return ``V''(theta)``; at a steady precession ``sqrt(V''/I1)`` is the nutation frequency."""
    sin_x = np.sin(0.5 * theta)
    cos_x = np.cos(0.5 * theta)
    up = north / (sin_x * sin_x)
    down = south / (cos_x * cos_x)
    tilt = sin_x * cos_x
    slope = 0.5 * (down - up)
    bend = 0.5 * (down * sin_x / cos_x + up * cos_x / sin_x)
    return (slope * slope + tilt * (up + down) * bend) / (4.0 * I1) - mgl * (cos_x * cos_x - sin_x * sin_x)


@inlined
def effective_potential(theta: Any, north: Any, south: Any, I1: Any, mgl: Any) -> Any:
    """Return ``V(theta)``, without the constant ``p_psi^2 / 2 I3``."""
    sin_x = np.sin(0.5 * theta)
    cos_x = np.cos(0.5 * theta)
    lever = north * cos_x / sin_x + south * sin_x / cos_x
    return lever * lever / (8.0 * I1) + mgl * (cos_x * cos_x - sin_x * sin_x)
