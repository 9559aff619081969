"""Alias of `symtop.run.modified_energy` for studies/drift, studies/notebook and benchmarks/roundoff.py."""

from symtop.run.modified_energy import energy as energy
from symtop.run.modified_energy import modified_energy as modified_energy
from symtop.run.modified_energy import oscillation as oscillation
from symtop.run.modified_energy import section as section

KNOWN = ("stormer-verlet", "midpoint", "strang", "cayley")  # names of those in the registry with `modified_energy`
