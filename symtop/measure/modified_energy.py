"""Alias of `symtop.run.modified_energy` for studies/drift, studies/notebook and benchmarks/roundoff.py."""

from symtop.run.modified_energy import energy, modified_energy, oscillation, section

__all__ = ["KNOWN", "energy", "modified_energy", "oscillation", "section"]

KNOWN = ("stormer-verlet", "midpoint", "strang", "cayley")  # names of those in the registry with `modified_energy`
