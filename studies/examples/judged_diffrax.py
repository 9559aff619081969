"""A solver of diffrax, with fixed steps: what ``symtop judge FILE.py:NAME`` takes.

symtop judge studies/examples/judged_diffrax.py:solver --order 5 --not-symplectic
"""

import diffrax

solver = diffrax.Tsit5()
