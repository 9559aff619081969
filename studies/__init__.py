"""The studies that ship with symtop: one folder a question."""

# of the report; others follow
ORDER = (
    "speed", "population", "truth", "convergence", "work_precision", "factors", "drift", "stability", "claims",
    "reduction", "phase_diagram", "oscillators", "notebook",
)  # fmt: skip
