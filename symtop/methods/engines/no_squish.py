"""NO_SQUISH: the free rotation of a rigid body split into turns about its own axes, as molecular dynamics has it.

    L_b += h tau_b/2;   turns about s1 s2 s3 s2 s1 by h/2, h/2, h, h/2, h/2;   L_b += h tau_b/2,

each turn q <- q exp(t (L_k/I_k) b_k) exact, with L_b turned back. The kinetic energy is a sum of one term an axis and
each turn the flow of its term, so that the step is symplectic on (q, L), symmetric and of order 2, and L in space moves
by tau alone. L.e is the momentum of one of the three turns only and wobbles. s3 is the axis of the smallest moment, the
order in which LAMMPS sorts them: the result hangs on where the transverse axes of a symmetric body are put, here psi.
Source: Miller, Eleftheriou, Pattnaik, Ndirango, Newns, Martyna, J. Chem. Phys. 116 (2002) 8649.
"""

from typing import Any

import numpy as np

from symtop.core.jit import register_jitable
from symtop.methods.engines.engine_parts import axis, normalised, torque, turned
from symtop.methods.framework.loop import driver
from symtop.methods.framework.space import finite_outcome, observe_attitude
from symtop.methods.vectors import plus, scaled


@register_jitable
def _first_turn(par: Any, q: Any, L: Any, h: float) -> Any:
    """The turn about the body's first axis, with L in body axes."""
    x = 0.5 * h * L[0] / par.I1
    c, s = np.cos(x), np.sin(x)
    C, S = c * c - s * s, 2.0 * s * c
    q = q[0] * c - q[1] * s, q[1] * c + q[0] * s, q[2] * c + q[3] * s, q[3] * c - q[2] * s
    return q, (L[0], C * L[1] + S * L[2], C * L[2] - S * L[1])


@register_jitable
def _second_turn(par: Any, q: Any, L: Any, h: float) -> Any:
    """The turn about the body's second axis."""
    y = 0.5 * h * L[1] / par.I1
    c, s = np.cos(y), np.sin(y)
    C, S = c * c - s * s, 2.0 * s * c
    q = q[0] * c - q[2] * s, q[1] * c - q[3] * s, q[2] * c + q[0] * s, q[3] * c + q[1] * s
    return q, (C * L[0] - S * L[2], L[1], C * L[2] + S * L[0])


@register_jitable
def _third_turn(par: Any, q: Any, L: Any, h: float) -> Any:
    """The turn about the axis of symmetry."""
    z = 0.5 * h * L[2] / par.I3
    c, s = np.cos(z), np.sin(z)
    C, S = c * c - s * s, 2.0 * s * c
    q = q[0] * c - q[3] * s, q[1] * c + q[2] * s, q[2] * c - q[1] * s, q[3] * c + q[0] * s
    return q, (C * L[0] + S * L[1], C * L[1] - S * L[0], L[2])


def begin_no_squish(par: Any, rule: Any, state: Any, h: float) -> Any:
    """A step depends on its start alone."""
    return 0.0


def increment_no_squish(par: Any, rule: Any, state: Any, carry: Any, h: float) -> Any:
    """One step on (q, L); the free rotation leaves L in space as it is."""
    q, half = (state[0], state[1], state[2], state[3]), 0.5 * h
    kick = scaled(half, torque(par, axis(q)))
    kicked = state[4] + kick[0], state[5] + kick[1], state[6] + kick[2]
    L = plus(kicked, 1.0, turned((q[0], -q[1], -q[2], -q[3]), kicked))
    if par.I3 < par.I1:
        q, L = _second_turn(par, *_first_turn(par, q, L, half), half)
        q, L = _third_turn(par, q, L, h)
        q, L = _first_turn(par, *_second_turn(par, q, L, half), half)
    else:
        q, L = _second_turn(par, *_third_turn(par, q, L, half), half)
        q, L = _first_turn(par, q, L, h)
        q, L = _third_turn(par, *_second_turn(par, q, L, half), half)
    q = normalised(par, q)
    kick = plus(kick, half, torque(par, axis(q)))
    dstate = (
        q[0] - state[0], q[1] - state[1], q[2] - state[2], q[3] - state[3],
        *kick,
    )  # fmt: skip
    total = dstate[0] + dstate[1] + dstate[2] + dstate[3] + dstate[4] + dstate[5]
    return dstate, carry, 1, finite_outcome(total)


march_no_squish = driver(begin_no_squish, increment_no_squish, observe_attitude)
