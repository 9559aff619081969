"""Kick-drift-kick whose second half kick is hidden in the first: order 1, declared symmetric."""

import dataclasses

import symtop

euler = symtop.composition("hidden-kick", (1.0,), (1.0, 0.0), chart="space", order=1)
symtop.register(dataclasses.replace(euler, symmetric=True))
