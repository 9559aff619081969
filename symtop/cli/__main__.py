"""``python -m symtop.cli`` is the command ``symtop``."""

from symtop.cli.main import main

main()
