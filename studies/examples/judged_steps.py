"""Integrators as others write them: what ``symtop judge FILE.py:NAME`` takes.

    symtop judge studies/examples/judged_steps.py:heun --order 2 --card card.html
    symtop judge studies/examples/judged_steps.py:Ralston --order 3
    symtop judge studies/examples/judged_steps.py:leapfrog --form separable --order 2 --symplectic
    symtop judge studies/examples/judged_steps.py:engine --form rotation --order 1

The first is a function of f, the second a class of SciPy's, the third a splitting of H = T(p) + V(theta), the fourth
the rotation of a rigid body as physics engines step it. A library is in judged.c, a program in judged_program.py, a
solver of diffrax in judged_diffrax.py.
"""

import numpy as np
from scipy.integrate import RK23


def heun(f, t, y, h):
    """Heun's method."""
    k1 = f(t, y)
    return y + h / 2 * (k1 + f(t + h, y + h * k1))


class Ralston(RK23):
    """A class derived from scipy.integrate.OdeSolver: here, what SciPy has."""


def leapfrog(state, h, dT, dV):
    """Drift, kick, drift."""
    theta, p = state
    p_new = p - h * dV(theta + h / 2 * dT(p))
    return theta + h / 2 * (dT(p) + dT(p_new)), p_new


def engine(q, w, h, inertia, torque):
    """Semi-implicit Euler: w first, then q by the new w, then q to length one."""
    w = w + h * (torque(q) - np.cross(w, inertia * w)) / inertia
    s, v = q[0], q[1:]
    q = q + h / 2 * np.array([-v @ w, *(s * w + np.cross(v, w))])
    return q / np.linalg.norm(q), w
