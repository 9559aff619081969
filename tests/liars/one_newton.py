"""The midpoint rule with a single Newton iteration from free flight, declared bounded in energy."""

import dataclasses

import symtop
from symtop.integrators import discrete_lagrangian as family
from symtop.integrators.angles import reduced
from symtop.integrators.drive import driver
from symtop.integrators.fixed_step import fixed_step


def increment(par, rule, state, carry, h):
    """The family's own step, its prediction thrown away and its iteration cut after the first correction."""
    return family.increment(par, rule, state, (0.0, 0.0, 0.0, 0.0), h)


march = driver(family.begin, increment, family.observe)
once = family.Quadrature((0.5,), (1.0,), tolerance=1e300)  # any correction is small enough
solver = fixed_step(march, once, reduced, 1, implicit=True)
symtop.register(
    dataclasses.replace(
        symtop.integrator("midpoint"), name="one-newton", solvers={"angles": solver}, energy_error="bounded"
    )
)
