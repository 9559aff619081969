"""Integrators and a scene of your own: what ``--plugin FILE`` loads.

    symtop study convergence --plugin studies/examples/my_methods.py

Three integrators are tables of numbers: a quadrature rule, the coefficients of a splitting, a Butcher tableau. The last
one is a kernel of its own: symplectic Euler on the reduced top, order 1.
"""

import numpy as np

import symtop
from symtop.methods.framework.angles import chart_outcome, reduced
from symtop.methods.framework.fixed_step import FixedStep
from symtop.methods.framework.loop import driver
from symtop.methods.splitting.angles import force_angles

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
    """p1 = p0 - h V'(theta0), theta1 = theta0 + h p1/I1; phi and psi move with the force."""
    slope, precession, turn = force_angles(par, state, (0.0, 0.0, 0.0, 0.0))
    dp = -h * slope
    step = (h * (state[1] + dp) / par.I1, dp, h * precession, h * (par.p_psi / par.I3 - turn))
    return step, carry, 1, chart_outcome(state[0] + step[0])


def observe(par, rule, before, dstate, h):
    """Undo the step's own formulas: phi' = (p_phi - p_psi c)/(I1 s^2), psi' = p_psi/I3 - phi' c at theta0."""
    sine, cosine = np.sin(before[0]), np.cos(before[0])
    precession, spin = dstate[2] / h, dstate[3] / h
    p_psi = par.I3 * (spin + precession * cosine)
    return par.I1 * precession * sine * sine + p_psi * cosine, p_psi


solver = FixedStep(driver(begin, increment, observe), (0.0,), reduced, 1, implicit=False)
symtop.register(
    symtop.Integrator(
        name="symplectic-euler", family="other", summary="kick then drift, order 1", solvers={"angles": solver},
        order=1, explicit=True, symplectic=True, symmetric=False, conserves=frozenset({"p_phi", "p_psi"}),
    )
)  # fmt: skip
