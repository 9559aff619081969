"""Yoshida's composition with two drift coefficients swapped, declared order 4."""

import symtop
from symtop.methods.splitting.coefficients import YOSHIDA_4

a, b, c = YOSHIDA_4.drift
symtop.register(symtop.composition("coefficients-swapped", (b, a, c), YOSHIDA_4.kick, chart="space", order=4))
