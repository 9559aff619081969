"""The studies that ship with symtop: one folder a question."""

# of the report; others follow
ORDER = (
    "speed", "cost", "truth", "convergence", "factors", "drift", "stability", "claims", "reduction", "oscillators",
    "notebook",
)  # fmt: skip
FORMER = dict.fromkeys(("population", "work_precision", "phase_diagram"), "cost")  # names that studies had
