"""The studies that ship with symtop: one folder a question."""
