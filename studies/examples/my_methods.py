"""Integrators and a scene of your own: what ``--plugin FILE`` loads.

    symtop study convergence --plugin studies/examples/my_methods.py

Three integrators are tables of numbers: a quadrature rule, the coefficients of a splitting, a Butcher tableau. The last
one is a kernel of its own: symplectic Euler on the reduced top, order 1.
"""

import numpy as np

import symtop
from symtop import chart_outcome

# A discrete Lagrangian is a quadrature rule: nodes and weights. Two Gauss points:
left, right = 0.5 - 3**0.5 / 6, 0.5 + 3**0.5 / 6
symtop.register(symtop.discrete_lagrangian("two-point", (left, right), (0.5, 0.5), order=2))

# A splitting method is its coefficients, here McLachlan's second-order method with a small error constant.
b = 0.1931833275037836
symtop.register(symtop.composition("mclachlan-2", (0.5, 0.5), (b, 1 - 2 * b, b), chart="space", order=2))

# A Runge-Kutta method is its tableau. Ralston's third-order method:
a = ((), (1 / 2,), (0, 3 / 4))
symtop.register(symtop.runge_kutta("ralston-3", a, (2 / 9, 1 / 3, 4 / 9), order=3))

# A scene is a top, a start and a horizon.
top, start = symtop.SymmetricTop(1.5, 1.0, 3.0), symtop.Angles(theta=1.0, psi_dot=4.0)
symtop.register_scene(symtop.Scene("mine", top, start, horizon=6.0, purpose="an example"))


def begin(par, rule, state, h):  # noqa: D103
    return (0.0,)


def increment(par, rule, state, carry, h):
    """p1 = p0 - h V'(theta0), theta1 = theta0 + h p1/I1; phi and psi move at the rates of the start."""
    theta, p = state[0], state[1]
    sine, cosine = np.sin(theta), np.cos(theta)
    p_phi = 0.5 * (par.north + par.south)  # north = p_phi - p_psi, south = p_phi + p_psi
    precession = (p_phi - par.p_psi * cosine) / (par.I1 * sine * sine)
    dp = h * sine * (par.mgl - precession * (par.p_psi - par.I1 * precession * cosine))
    step = (h * (p + dp) / par.I1, dp, h * precession, h * (par.p_psi / par.I3 - precession * cosine))
    return step, carry, 1, chart_outcome(theta + step[0])


def observe(par, rule, before, dstate, h):
    """Both momenta from the increments, by the step's own formulas at theta0."""
    sine, cosine = np.sin(before[0]), np.cos(before[0])
    precession, spin = dstate[2] / h, dstate[3] / h
    p_psi = par.I3 * (spin + precession * cosine)
    return par.I1 * precession * sine * sine + p_psi * cosine, p_psi


loop = symtop.kernel_loop(begin, increment, observe)
symtop.register(
    symtop.Integrator(
        name="kick-then-drift", family="other", summary="kick then drift, order 1",
        solvers={"angles": symtop.FixedStep(loop, (0.0,), symtop.on_angles, 1, implicit=False)},
        order=1, explicit=True, symplectic=True, symmetric=False, conserves=frozenset({"p_phi", "p_psi"}),
    )
)  # fmt: skip
