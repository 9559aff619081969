"""``python -m symtop`` is ``symtop``."""

from symtop.cli.main import main

main(prog_name="symtop")
