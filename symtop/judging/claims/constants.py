"""The claims that one long run in each chart shows: constants of the motion, and the cost of a step.

The worst chart decides, and the finding names it. What a run *reports* of its momenta is compared with what its states
have: a method that hands back the momenta of its start would keep them for ever.
"""

import math

import numpy as np

from symtop.core.errors import SymtopError
from symtop.judging.claims.long_run import Constant, LongRun, long_run
from symtop.judging.claims.subject import CONSTANTS, Subject, declared
from symtop.judging.findings import NOTHING, Finding, Measured, agreement, inapplicable, undecided
from symtop.methods.framework.registry import Integrator

OF_A_RUN = (*CONSTANTS, "reported", "invariant", "explicit", "work")
KINDS = ("kept", "bounded", "random walk", "growing", "drift")  # from best to worst
OWN = "its states'"  # what every run says of the momenta that it reports
BADNESS = ("inapplicable", "measured", "confirmed", "undecided", "refuted")


def measure(subject: Subject) -> list[Finding]:
    """Everything that one long run in each chart shows; the worst chart decides, and the finding names it."""
    method, runs, by_chart = subject.method, [], []
    for chart in method.charts():
        try:
            run = long_run(method, subject.scene, chart, quick=subject.quick, most=subject.long_steps)
            runs.append(run)
            findings = of_run(method, run)
        except SymtopError as error:
            findings = [undecided(claim, declared(method, claim), str(error)) for claim in OF_A_RUN]
        by_chart.append([_named(one, chart) for one in findings])
    if runs:
        subject.traces.update(traces_of(min(runs, key=lambda run: run.steps)))
    return [max(findings, key=_badness) for findings in zip(*by_chart, strict=True)]


def of_run(method: Integrator, run: LongRun) -> list[Finding]:
    """What one long run shows of each claim of `OF_A_RUN`."""
    rest = [_reported(run), _invariant(method, run), _explicit(method, run), _work(method, run)]
    return [*(_constant(one, declared(method, one), run, run.constants.get(one)) for one in CONSTANTS), *rest]


def traces_of(run: LongRun) -> dict[str, np.ndarray]:
    """What a figure shows of a long run."""
    names = ("steps_run", "nutations_run", "long_nutations", "energy_change")
    return dict(zip(names, (np.array(run.steps), np.array(run.nutations), *run.energy), strict=True))


def _named(finding: Finding, chart: str) -> Finding:
    """The finding with its chart, where the reason does not speak of it already."""
    plain = finding.verdict == "inapplicable" or finding.why.endswith(" chart")
    return finding if plain else finding._replace(why=f"{finding.why}, in the {chart} chart")


def _badness(one: Finding) -> tuple[int, int, float]:
    """The rank of a finding among the charts: by its verdict, then by the kind of growth, then by its number."""
    growth = KINDS.index(one.measured.kind) if one.measured.kind in KINDS else -1
    return BADNESS.index(one.verdict), growth, one.value if math.isfinite(one.value) else -1.0


def _constant(claim: str, claimed: str, run: LongRun, constant: Constant | None) -> Finding:
    if constant is None:
        return inapplicable(claim, f"the {run.chart} chart has no such constant", claimed)
    kind, changed, verdict = constant.kind, constant.changed, "undecided"
    measured = Measured(kind, changed.largest) if kind != "unknown" and run.steps else NOTHING
    why = f"largest relative change {changed.largest:.1e} in {run.span}, {constant.a_step:.0e} in one step at most"
    if kind not in ("kept", "unknown"):
        why += f", growth exponent {changed.exponent:.2f} +- {changed.exponent_interval:.2f}"
        if kind == "drift":
            why += f", drifting by {changed.rise / max(run.steps, 1):.1e} a step"
    if run.outcome not in ("ok", "not_finite") or (kind in ("kept", "bounded") and run.outcome != "ok"):
        why += f"; but the run {run.message}"
    elif kind == "unknown":
        why = f"the run {run.message}" if run.outcome != "ok" else f"{why}: no exponent to judge it by"
    elif claimed == "bounded" and constant.grows is None and changed.largest > run.most_in_a_nutation(constant):
        verdict, why = "refuted", f"{why}, more than the steps of a nutation can add up to: it does not come back"
    elif claimed == "bounded" and constant.grows is None:
        why += ", which leaves open whether it grows"
    else:
        within = kind == "kept" or (kind == "bounded" and changed.largest <= constant.floor)
        true = {"kept": within, "bounded": not constant.grows}.get(claimed)
        verdict = "measured" if true is None else "confirmed" if true else "refuted"
    return Finding(claim, claimed, measured, verdict, why, changed.largest, constant.floor)


def _reported(run: LongRun) -> Finding:
    """Are the momenta that the run reports those that its states have?"""
    other = run.reported
    if other is None:
        return inapplicable("reported", f"the {run.chart} chart shows no momenta beside the reported")
    if other.size <= other.floor:
        why = f"they differ from those of the states by {other.size:.1e} at most"
        return Finding("reported", "", Measured(OWN), "measured", why, other.size, other.floor)
    why = f"it reports other momenta than its states have: {other.name} differs by {other.size:.1e} {other.how}"
    return Finding("reported", OWN, Measured("others", other.size), "refuted", why, other.size, other.floor)


def _invariant(method: Integrator, run: LongRun) -> Finding:
    """What a method claims to conserve that is not a constant of the true motion."""
    claimed = declared(method, "invariant")
    if not claimed:
        return inapplicable("invariant", "it claims no invariant of its own")
    names = claimed.split(", ")
    unknown = ", ".join(name for name in names if name not in run.constants)
    if unknown:
        return undecided("invariant", claimed, f"the battery has no formula for {unknown}")
    worst = max(names, key=lambda name: run.constants[name].changed.largest)
    return _constant("invariant", "kept", run, run.constants[worst])._replace(declared=claimed)


def _no_cost(method: Integrator, run: LongRun) -> str:
    """Why nothing can be said of the cost of a step; empty if something can."""
    return "it makes no steps" if method.control is None else "" if run.evaluations else "its forces are not counted"


def _explicit(method: Integrator, run: LongRun) -> Finding:
    claimed = declared(method, "explicit")
    if without := _no_cost(method, run):
        return inapplicable("explicit", without, claimed)
    if run.iterations > 0.0:
        verdict = agreement(declared=method.explicit, measured=False)
        why = f"it reports {run.iterations:.2f} iterations a step"
        return Finding("explicit", claimed, Measured("no"), verdict, why, run.iterations, 0.0)
    if not run.steady_cost:
        return undecided("explicit", claimed, "it reports no iterations, but its steps do not all cost the same")
    why = f"it reports no iterations and {run.evaluations:.2f} forces a step, always"
    if method.explicit is False:
        why += "; so does a method that solves linear equations"
        return Finding("explicit", claimed, NOTHING, "undecided", why, 0.0, 0.0)
    verdict = agreement(declared=method.explicit, measured=True)
    return Finding("explicit", claimed, Measured("yes"), verdict, why, 0.0, 0.0)


def _work(method: Integrator, run: LongRun) -> Finding:
    if without := _no_cost(method, run):
        return inapplicable("work", without)
    solves = f" and {run.iterations:.2f} iterations" if run.iterations else ""
    why = f"{run.evaluations:.2f} force evaluations{solves} a step, in {run.span}"
    text = f"{run.evaluations:.1f}" + (f" ({run.iterations:.1f} it.)" if run.iterations else "")
    measured = Measured("work", run.evaluations, unit="forces a step", text=text)
    return Finding("work", "", measured, "measured", why, run.evaluations, 0.0)
