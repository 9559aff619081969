"""Velocity Verlet with h and h^2/2 swapped in the position, as a public library once shipped it."""

import symtop
from symtop.methods.framework.angles import chart_outcome, on_angles
from symtop.methods.framework.loop import FixedStep, Loop
from symtop.methods.splitting import angles


def begin(par, rule, state, h):
    """Nothing is reused."""
    return (0.0,)


def increment(par, rule, state, carry, h):
    """theta += v h^2/2 + a h, where v h + a h^2/2 is meant."""
    zero = (0.0, 0.0, 0.0, 0.0)
    slope, precession, turn = angles.force_angles(par, state, zero)
    move = (0.5 * h * h * state[1] - h * slope) / par.I1
    after, precession_after, turn_after = angles.force_angles(par, state, (move, 0.0, 0.0, 0.0))
    kick = -0.5 * h * (slope + after)
    wheel = 0.5 * h * (precession + precession_after)
    return (
        (move, kick, wheel, h * par.p_psi / par.I3 - 0.5 * h * (turn + turn_after)),
        carry,
        2,
        chart_outcome(state[0] + move),
    )


def observe(par, rule, before, dstate, h):
    """The momenta are parameters of this method."""
    return 0.5 * (par.north + par.south), par.p_psi


solver = FixedStep(Loop(begin, increment, observe), (0.0,), on_angles, 1, implicit=False)
symtop.register(
    symtop.Integrator(
        name="verlet-swapped", family="other", summary="velocity Verlet, mistyped", solvers={"angles": solver}, order=2,
        explicit=True, symplectic=True, symmetric=True, conserves=frozenset({"p_phi", "p_psi"}),
    )
)  # fmt: skip
