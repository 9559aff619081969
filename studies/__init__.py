"""The studies that ship with symtop: one folder a question."""

ORDER = (
    "truth",
    "convergence",
    "work_precision",
    "factors",
    "drift",
    "stability",
    "reduction",
)  # of the report; others follow
