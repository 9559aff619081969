"""The claims that one long run in each chart shows: constants of the motion, and the cost of a step.

The worst chart decides, and the finding names it. What a run *reports* of its momenta is compared with what its states
have: a method that hands back the momenta of its start would keep them for ever.
"""

import math

import numpy as np

from symtop.core.errors import SymtopError
from symtop.judging import claims_long as long
from symtop.judging.findings import Finding, agreement, undecided, yes_no
from symtop.methods.framework.registry import Integrator
from symtop.model.scenes import Scene

CONSTANTS = ("energy", "p_phi", "p_psi", "axis_length")
KINDS = ("kept", "bounded", "random walk", "growing", "drift")  # from best to worst
OWN = "its states'"  # what every run says of the momenta that it reports
BADNESS = ("inapplicable", "measured", "confirmed", "undecided", "refuted")


def over_steps(
    method: Integrator, scene: Scene, traces: dict[str, np.ndarray], *, quick: bool = False, steps: float | None = None
) -> dict[str, Finding]:
    """Everything that one long run in each chart shows; the worst chart decides, and the finding names it."""
    runs, by_chart = [], []
    for chart in method.charts():
        try:
            run = long.long_run(method, scene, chart, quick=quick, most=steps)
        except SymtopError as error:
            by_chart.append(_unseen(method, str(error)))
            continue
        runs.append(run)
        by_chart.append(of_run(method, run))
    if runs:
        least = min(runs, key=lambda run: run.steps)
        traces["steps_run"], traces["nutations_run"] = np.array(least.steps), np.array(least.nutations)
        traces["long_nutations"], traces["energy_change"] = least.energy
    return {
        claim: _worst([_named(one[claim], chart) for one, chart in zip(by_chart, method.charts(), strict=True)])
        for claim in by_chart[0]
    }


def of_run(method: Integrator, run: long.LongRun) -> dict[str, Finding]:
    """What one long run shows."""
    rest = [_reported(run), _invariant(method, run), _explicit(method, run), _work(method, run)]
    return {one.claim: one for one in [*(_kept(method, run, claim) for claim in CONSTANTS), *rest]}


def declared_energy(method: Integrator) -> str:
    """What a method claims of its energy, outright or by its other claims; empty if nothing."""
    if method.energy_error is not None:
        return method.energy_error
    if "energy" in (method.conserves or ()):
        return "kept"
    return "bounded" if method.symplectic and method.fixed_step else ""


def declared_claims(method: Integrator) -> dict[str, str]:
    """What a method says of each claim that a long run judges."""
    return {claim: _declared(method, claim) for claim in (*CONSTANTS, "reported", "invariant", "explicit", "work")}


def _declared(method: Integrator, claim: str) -> str:
    if claim == "energy":
        return declared_energy(method)
    if claim in CONSTANTS:
        return "kept" if claim in (method.conserves or ()) else ""
    others = sorted((method.conserves or frozenset()) - set(CONSTANTS))
    return {"invariant": ", ".join(others), "explicit": yes_no(method.explicit)}.get(claim, "")


def _unseen(method: Integrator, error: str) -> dict[str, Finding]:
    """What is left to say of a chart whose long run breaks."""
    return {claim: undecided(claim, word, error) for claim, word in declared_claims(method).items()}


def _named(finding: Finding, chart: str) -> Finding:
    """The finding with its chart, where the reason does not speak of it already."""
    plain = finding.verdict == "inapplicable" or finding.why.endswith(" chart")
    return finding if plain else finding._replace(why=f"{finding.why}, in the {chart} chart")


def _worst(findings: list[Finding]) -> Finding:
    """The finding that decides: by its verdict, then by the kind of growth, then by its number."""

    def badness(one: Finding) -> tuple[int, int, float]:
        kind = one.measured.split(",")[0]
        growth = KINDS.index(kind) if kind in KINDS else -1
        return BADNESS.index(one.verdict), growth, one.value if math.isfinite(one.value) else -1.0

    return max(findings, key=badness)


def _span(run: long.LongRun) -> str:
    steps = f"{run.steps} steps" if run.steps else "a formula"
    return f"{steps} over {run.nutations:.3g} nutations"


def _kept(method: Integrator, run: long.LongRun, claim: str) -> Finding:
    declared = _declared(method, claim)
    if claim not in run.constants:
        return Finding(claim, declared, "", "inapplicable", f"the {run.chart} chart has no such constant")
    return _constant(claim, declared, run, run.constants[claim])


def _constant(claim: str, declared: str, run: long.LongRun, constant: long.Constant) -> Finding:
    kind, changed, verdict = constant.kind, constant.changed, "undecided"
    measured = f"{kind}, {changed.largest:.0e}".replace("0e+00", "0") if kind != "unknown" and run.steps else ""
    why = f"largest relative change {changed.largest:.1e} in {_span(run)}, {constant.a_step:.0e} in one step at most"
    if kind not in ("kept", "unknown"):
        why += f", growth exponent {changed.exponent:.2f} +- {changed.exponent_interval:.2f}"
        if kind == "drift":
            why += f", drifting by {changed.rise / max(run.steps, 1):.1e} a step"
    if run.outcome not in ("ok", "not_finite") or (kind in ("kept", "bounded") and run.outcome != "ok"):
        why += f"; but the run {run.message}"
    elif kind == "unknown":
        why = f"the run {run.message}" if run.outcome != "ok" else f"{why}: no exponent to judge it by"
    elif declared == "bounded" and constant.grows is None and changed.largest > _of_a_nutation(run, constant):
        verdict, why = "refuted", f"{why}, more than the steps of a nutation can add up to: it does not come back"
    elif declared == "bounded" and constant.grows is None:
        why += ", which leaves open whether it grows"
    else:
        within = kind == "kept" or (kind == "bounded" and changed.largest <= constant.floor)
        true = {"kept": within, "bounded": not constant.grows}.get(declared)
        verdict = "measured" if true is None else "confirmed" if true else "refuted"
    return Finding(claim, declared, measured, verdict, why, changed.largest, constant.floor)


def _of_a_nutation(run: long.LongRun, constant: long.Constant) -> float:
    """What an error that returns with the nutation cannot exceed: the largest change of a step, all one way."""
    return constant.a_step * run.steps / run.nutations if run.nutations > 1.0 else math.inf


def _reported(run: long.LongRun) -> Finding:
    """Are the momenta that the run reports those that its states have?"""
    other = run.reported
    if other is None:
        return Finding(
            "reported", "", "", "inapplicable", f"the {run.chart} chart shows no momenta beside the reported"
        )
    if other.size <= other.floor:
        why = f"they differ from those of the states by {other.size:.1e} at most"
        return Finding("reported", "", OWN, "measured", why, other.size, other.floor)
    why = f"it reports other momenta than its states have: {other.name} differs by {other.size:.1e} {other.how}"
    return Finding("reported", OWN, f"others, {other.size:.0e}", "refuted", why, other.size, other.floor)


def _invariant(method: Integrator, run: long.LongRun) -> Finding:
    """What a method claims to conserve that is not a constant of the true motion."""
    declared = _declared(method, "invariant")
    if not declared:
        return Finding("invariant", "", "", "inapplicable", "it claims no invariant of its own")
    claimed = declared.split(", ")
    judged = [name for name in claimed if name in run.constants]
    if judged != claimed:
        unknown = ", ".join(name for name in claimed if name not in run.constants)
        return undecided("invariant", declared, f"the battery has no formula for {unknown}")
    worst = max(judged, key=lambda name: run.constants[name].changed.largest)
    return _constant("invariant", "kept", run, run.constants[worst])._replace(declared=declared)


def _explicit(method: Integrator, run: long.LongRun) -> Finding:
    declared = _declared(method, "explicit")
    if method.control is None:
        return Finding("explicit", declared, "", "inapplicable", "it makes no steps")
    if run.evaluations == 0.0:
        return Finding("explicit", declared, "", "inapplicable", "its forces are not counted")
    if run.iterations > 0.0:
        verdict = agreement(declared=method.explicit, measured=False)
        why = f"it reports {run.iterations:.2f} iterations a step"
        return Finding("explicit", declared, "no", verdict, why, run.iterations, 0.0)
    if run.steady_cost:
        cost = f"{run.evaluations:.2f} forces a step, always"
        if method.explicit is False:
            why = f"it reports no iterations and {cost}; so does a method that solves linear equations"
            return Finding("explicit", declared, "", "undecided", why, 0.0, 0.0)
        verdict = agreement(declared=method.explicit, measured=True)
        return Finding("explicit", declared, "yes", verdict, f"it reports no iterations and {cost}", 0.0, 0.0)
    return undecided("explicit", declared, "it reports no iterations, but its steps do not all cost the same")


def _work(method: Integrator, run: long.LongRun) -> Finding:
    if method.control is None:
        return Finding("work", "", "", "inapplicable", "it makes no steps")
    if run.evaluations == 0.0:
        return Finding("work", "", "", "inapplicable", "its forces are not counted")
    solves = f" and {run.iterations:.2f} iterations" if run.iterations else ""
    why = f"{run.evaluations:.2f} force evaluations{solves} a step, in {_span(run)}"
    short = f"{run.evaluations:.1f}" + (f" ({run.iterations:.1f} it.)" if run.iterations else "")
    return Finding("work", "", short, "measured", why, run.evaluations, 0.0)
