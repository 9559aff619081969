"""How a run can end, as data and as a sentence."""

OUTCOMES = ("ok", "left_chart", "not_converged", "not_finite", "step_too_small", "out_of_budget")
OK, LEFT_CHART, NOT_CONVERGED, NOT_FINITE, STEP_TOO_SMALL, OUT_OF_BUDGET = range(len(OUTCOMES))

_CAUSES = {
    "left_chart": "theta left (0, pi), where the angles chart ends; take a smaller step or an integrator without poles",
    "not_converged": "the implicit equation of the step was not solved; take a smaller step",
    "not_finite": "the state became infinite or not a number; take a smaller step or a tighter tolerance",
    "step_too_small": "the step size fell below the spacing of the numbers; loosen the tolerance",
    "out_of_budget": "the limit on the work of one run was reached; shorten the horizon or loosen the tolerance",
}


def sentence(outcome: str, reached: float, horizon: float) -> str:
    """One sentence on how a run ended, at what time and why."""
    if outcome == "ok":
        return f"reached t = {reached:.6g}"
    return f"stopped at t = {reached:.6g} of {horizon:.6g}: {_CAUSES[outcome]}"
