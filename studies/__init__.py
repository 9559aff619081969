"""The studies that ship with symtop: one folder for each question."""

# in the report; all other studies follow
ORDER = (
    "speed", "cost", "truth", "convergence", "factors", "drift", "stability", "claims", "reduction", "oscillators",
    "notebook",
)  # fmt: skip
FORMER = dict.fromkeys(("population", "work_precision", "phase_diagram"), "cost")  # former names of studies
