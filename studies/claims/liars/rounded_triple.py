"""Yoshida's triple with its coefficient off by 3e-8 and the sums kept: of order 2, and its slope in double is 4.0."""

import symtop

outer = 1.3512071919596577 + 3e-8
inner = 1.0 - 2.0 * outer
drift = (outer, inner, outer)
kick = (outer / 2.0, (outer + inner) / 2.0, (outer + inner) / 2.0, outer / 2.0)
symtop.register(symtop.composition("rounded-triple", drift, kick, chart="space", order=4))
