"""``python -m symtop`` is ``symtop``."""

from symtop.cli.__main__ import run

run("symtop")
