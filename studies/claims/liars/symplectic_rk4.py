"""The classical Runge-Kutta method, declared symplectic."""

import dataclasses

import symtop

symtop.register(dataclasses.replace(symtop.integrator("rk4"), name="symplectic-rk4", symplectic=True))
