"""The claims ledger: what an integrator says about itself, what a battery of measurements says, and a verdict.

One battery judges every integrator alike, ours and a plug-in's, through nothing but its solvers:

    order          slopes of the errors of attitude, theta and energy, and the limit of small steps (`claims_order`)
    symplectic     the bracket after one step, in every chart                                          (`step_map`)
    symmetric      one step forth and back, in every chart                                             (`step_map`)
    energy, p_phi, p_psi, axis_length, invariant      a million steps, in every chart                  (`claims_long`)
    explicit, work                                    what a step costs                                (`claims_long`)
    pole           the axis passes a pole exactly                                                      (`claims_long`)

A claim is refuted only far beyond what the measurement itself leaves in doubt; both numbers are in the ledger
(`symtop.judge.ledger`). Nothing claimed of the energy means what the other claims imply: kept if it is among the
conserved quantities, bounded if the method is symplectic and its step fixed (Benettin, Giorgilli, J. Stat. Phys. 74
(1994) 1117). Work and iterations are what the solver reports.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from symtop.base.validate import SymtopError
from symtop.judge import claims_long as long, claims_order as orders
from symtop.judge.ledger import CLAIMS, Finding, Ledger, undecided
from symtop.measure import step_map as maps
from symtop.measure.order import BESIDE, order_verdict
from symtop.methods.registry import Integrator
from symtop.model.scenes import Scene

SCENE = "spheroid"
CONSTANTS = ("energy", "p_phi", "p_psi", "axis_length")

SYMPLECTIC = 1e-9  # a smaller defect of the bracket is none
MET = 1e-8  # a larger one is one, if it stands out of its noise
STANDS = 0.2  # the raw defect of a symplectic map falls to 1/256 over the widths
RETURNED = 1e-10  # a return as close as this is exact
MISSED = 1e-8
ONE_MAP = 1e-9  # two steps are twice one step within this
SHOWN = 24  # settings of the order that are kept


def declared_energy(method: Integrator) -> str:
    """What a method claims of its energy, outright or by its other claims; empty if nothing."""
    if method.energy_error is not None:
        return method.energy_error
    if "energy" in (method.conserves or ()):
        return "kept"
    return "bounded" if method.symplectic and method.fixed_step else ""


def judge(method: Integrator, scene: Scene, *, quick: bool = False) -> Ledger:
    """Measure every claim of a method on a scene; `quick` shortens the runs."""
    traces: dict[str, np.ndarray] = {}
    findings = {"order": _attempt("order", _yes_no_number(method.order), lambda: _order(method, scene, quick, traces))}
    findings |= _structure(method, scene, quick, traces)
    findings |= _over_steps(method, scene, quick, traces)
    findings["pole"] = _attempt("pole", _pole_claim(method), lambda: _pole(method))
    return Ledger(method.name, scene.name, tuple(findings[claim] for claim in CLAIMS), traces)


def _attempt(claim: str, declared: str, measure: Callable[[], Finding]) -> Finding:
    try:
        return measure()
    except SymtopError as error:
        return undecided(claim, declared, str(error))


def _yes_no_number(value: bool | int | None) -> str:
    if value is None:
        return ""
    return ("yes" if value else "no") if isinstance(value, bool) else str(value)


def _agrees(*, declared: bool | None, measured: bool | None) -> str:
    if measured is None:
        return "undecided"
    return "measured" if declared is None else "confirmed" if declared == measured else "refuted"


# ---- order -----------------------------------------------------------------------------------------------------------


def _order(method: Integrator, scene: Scene, quick: bool, traces: dict[str, np.ndarray]) -> Finding:
    declared = _yes_no_number(method.order)
    if method.control is None:
        return Finding("order", declared, "", "inapplicable", "it has no step and no tolerance")
    fitted = orders.measured_order(method, scene, quick=quick)
    traces["step_size"], traces["error"], traces["fitted"] = orders.settings_shown(fitted, SHOWN)
    main = fitted.fits[fitted.observed]
    measured = str(main) if math.isfinite(main.slope) else ""
    slopes = ", ".join(f"{name} {fit}" for name, fit in fitted.fits.items() if math.isfinite(fit.slope))
    slopes = f"slopes {slopes} on {fitted.scene}" if slopes else "no slope"
    if method.fixed_step:
        power = method.order or 1
        if math.isfinite(main.slope):
            power = max(1, min(power if method.order else 99, round(main.slope)))
        limit = orders.limit(method, scene, power)
        if limit.miss > orders.TRUE_LIMIT and limit.miss > 10.0 * limit.doubt:
            why = f"as its step goes to zero it goes to a motion that is wrong by {limit.miss:.1e} ({slopes})"
            return Finding(
                "order", declared, f"wrong limit, {limit.miss:.0e}", "refuted" if declared else "measured", why,
                limit.miss, orders.TRUE_LIMIT,
            )  # fmt: skip
    if not measured:
        return Finding("order", declared, "", "undecided", f"{main.reason} ({slopes})")
    if method.order is None:
        return Finding("order", declared, measured, "measured", slopes, main.slope, main.interval)
    others = fitted.fits.values() if method.fixed_step else ()  # the steps of an adaptive method do not all scale alike
    verdict = order_verdict(method.order, main, others)
    why = {
        "refuted": f"the error falls with another power of the step: {slopes}",
        "undecided": f"the slope is neither {method.order} nor clearly another order: {slopes}",
    }.get(verdict, slopes)
    return Finding("order", declared, measured, verdict, why, main.slope, BESIDE + main.interval)


# ---- structure of a step ---------------------------------------------------------------------------------------------


class _Chart(NamedTuple):
    """What one chart says on one question: yes, no, or neither."""

    chart: str
    answer: bool | None
    value: float
    resolution: float
    why: str


def _structure(method: Integrator, scene: Scene, quick: bool, traces: dict[str, np.ndarray]) -> dict[str, Finding]:
    brackets, returns = [], []
    names = method.charts()[-1:] if quick else method.charts()
    for chart in names:
        try:
            step, start = maps.step_map(method, chart, scene)
            defect = maps.symplectic_defect(step, start)
            gap = maps.restart_gap(step, start)
            brackets.append(_bracket(chart, defect, gap))
            traces["defect_width"], traces["bracket_defect"] = defect.widths, defect.raw
            returns.append(_returned(chart, maps.return_miss(step, start), gap))
        except SymtopError as error:
            unknown = _Chart(chart, None, math.nan, math.nan, undecided("", "", str(error)).why)
            brackets.append(unknown)
            returns.append(unknown)
    return {
        "symplectic": _over_charts("symplectic", method.symplectic, brackets),
        "symmetric": _over_charts("symmetric", method.symmetric, returns),
    }


def _bracket(chart: str, defect: maps.Defect, gap: float) -> _Chart:
    floor = max(3.0 * defect.noise, 1e-12)
    shrinks = f"from {defect.raw[0]:.0e} to {defect.raw[-1]:.0e} as the differencing width shrinks 16 times"
    if defect.size <= SYMPLECTIC and defect.noise <= SYMPLECTIC:
        return _Chart(chart, True, defect.size, floor, f"defect of the bracket {defect.size:.0e} (it falls {shrinks})")
    stays = f"defect of the bracket {defect.size:.1e} (it goes {shrinks})"
    met = defect.size > max(10.0 * defect.noise, MET)
    met = met or (defect.raw[-1] > STANDS * defect.raw[0] and defect.raw[-1] > 100.0 * MET)
    if gap > ONE_MAP:
        if chart != "axis" and defect.rest <= max(3.0 * defect.noise, SYMPLECTIC):
            why = f"one number that a run takes from its start explains the defect ({defect.rest:.0e} is left)"
            return _Chart(chart, True, defect.rest, floor, why)
        return _Chart(chart, None, defect.size, floor, f"two steps differ from twice one step by {gap:.0e}: no one map")
    return _Chart(chart, False if met else None, defect.size, floor, stays)


def _returned(chart: str, miss: float, gap: float) -> _Chart:
    why = f"a step forth and back misses the start by {miss:.1e}"
    if miss > RETURNED and gap > ONE_MAP:
        return _Chart(chart, None, miss, RETURNED, f"two steps differ from twice one step by {gap:.0e}: no one map")
    return _Chart(chart, True if miss <= RETURNED else False if miss > MISSED else None, miss, RETURNED, why)


def _over_charts(claim: str, declared: bool | None, by_chart: list[_Chart]) -> Finding:
    """No if any chart says no, yes if one says yes and none no."""
    for answer in (False, True, None):
        agreeing = [one for one in by_chart if one.answer is answer]
        if agreeing:
            worst = max(agreeing, key=lambda one: one.value if math.isfinite(one.value) else -1.0)
            words = {True: f"yes, {worst.value:.0e}", False: f"no, {worst.value:.0e}", None: ""}[answer]
            verdict = _agrees(declared=declared, measured=answer)
            why = f"{worst.why}, in the {worst.chart} chart"
            return Finding(claim, _yes_no_number(declared), words, verdict, why, worst.value, worst.resolution)
    return undecided(claim, _yes_no_number(declared), "no chart could be tried")


# ---- a million steps -------------------------------------------------------------------------------------------------


KINDS = ("kept", "bounded", "random walk", "growing", "drift")  # from best to worst
BADNESS = ("inapplicable", "measured", "confirmed", "undecided", "refuted")


def _over_steps(method: Integrator, scene: Scene, quick: bool, traces: dict[str, np.ndarray]) -> dict[str, Finding]:
    """Everything that one long run in each chart shows; the worst chart decides, and the finding names it."""
    runs, by_chart = [], []
    for chart in method.charts():
        try:
            run = long.long_run(method, scene, chart, quick=quick)
        except SymtopError as error:
            by_chart.append(_unseen(method, str(error)))
            continue
        runs.append(run)
        rest = [_invariant(method, run), _explicit(method, run), _work(method, run)]
        by_chart.append({one.claim: one for one in [*(_kept(method, run, claim) for claim in CONSTANTS), *rest]})
    if runs:
        least = min(runs, key=lambda run: run.steps)
        traces["steps_run"], traces["nutations_run"] = np.array(least.steps), np.array(least.nutations)
    return {
        claim: _worst([_named(one[claim], chart) for one, chart in zip(by_chart, method.charts(), strict=True)])
        for claim in by_chart[0]
    }


def _declared(method: Integrator, claim: str) -> str:
    """What a method says of a claim that a long run judges."""
    if claim == "energy":
        return declared_energy(method)
    if claim in CONSTANTS:
        return "kept" if claim in (method.conserves or ()) else ""
    others = sorted((method.conserves or frozenset()) - set(CONSTANTS))
    return {"invariant": ", ".join(others), "explicit": _yes_no_number(method.explicit)}.get(claim, "")


def _unseen(method: Integrator, error: str) -> dict[str, Finding]:
    """What is left to say of a chart whose long run breaks."""
    claims = (*CONSTANTS, "invariant", "explicit", "work")
    return {claim: undecided(claim, _declared(method, claim), error) for claim in claims}


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
    measured = f"{kind}, {changed.largest:.0e}".replace("0e+00", "0") if kind != "unknown" else ""
    why = f"largest relative change {changed.largest:.1e} in {_span(run)}, {constant.a_step:.0e} in one step at most"
    if kind not in ("kept", "unknown"):
        why += f", growth exponent {changed.exponent:.2f} +- {changed.exponent_interval:.2f}"
        if kind == "drift":
            why += f", drifting by {changed.rise / max(run.steps, 1):.1e} a step"
    if run.outcome not in ("ok", "not_finite") or (kind in ("kept", "bounded") and run.outcome != "ok"):
        why += f"; but the run {run.message}"
    elif kind == "unknown":
        why = f"the run {run.message}" if run.outcome != "ok" else f"{why}: no exponent to judge it by"
    elif declared == "bounded" and constant.grows is None:
        why += ", which leaves open whether it grows"
    else:
        within = kind == "kept" or (kind == "bounded" and changed.largest <= constant.floor)
        true = {"kept": within, "bounded": not constant.grows}.get(declared)
        verdict = "measured" if true is None else "confirmed" if true else "refuted"
    return Finding(claim, declared, measured, verdict, why, changed.largest, constant.floor)


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


# ---- cost and chart --------------------------------------------------------------------------------------------------


def _explicit(method: Integrator, run: long.LongRun) -> Finding:
    declared = _declared(method, "explicit")
    if method.control is None:
        return Finding("explicit", declared, "", "inapplicable", "it makes no steps")
    if run.iterations > 0.0:
        verdict = _agrees(declared=method.explicit, measured=False)
        why = f"it reports {run.iterations:.2f} iterations a step"
        return Finding("explicit", declared, "no", verdict, why, run.iterations, 0.0)
    if run.steady_cost:
        cost = f"{run.evaluations:.2f} forces a step, always"
        if method.explicit is False:
            why = f"it reports no iterations and {cost}; so does a method that solves linear equations"
            return Finding("explicit", declared, "", "undecided", why, 0.0, 0.0)
        verdict = _agrees(declared=method.explicit, measured=True)
        return Finding("explicit", declared, "yes", verdict, f"it reports no iterations and {cost}", 0.0, 0.0)
    return undecided("explicit", declared, "it reports no iterations, but its steps do not all cost the same")


def _work(method: Integrator, run: long.LongRun) -> Finding:
    if method.control is None:
        return Finding("work", "", "", "inapplicable", "it makes no steps")
    solves = f" and {run.iterations:.2f} iterations" if run.iterations else ""
    why = f"{run.evaluations:.2f} force evaluations{solves} a step, in {_span(run)}"
    short = f"{run.evaluations:.1f}" + (f" ({run.iterations:.1f} it.)" if run.iterations else "")
    return Finding("work", "", short, "measured", why, run.evaluations, 0.0)


def _pole_claim(method: Integrator) -> str:
    return "no pole" if set(method.solvers) & {"axis", "attitude"} else ""


def _pole(method: Integrator) -> Finding:
    declared, passed = _pole_claim(method), long.passages(method)
    sentence = "; ".join(
        f"{one.chart}: passes, off by {one.error:.0e} and {one.finer:.0e} with finer steps" if one.passes
        else f"{one.chart}: ends there ({one.outcome})" if one.outcome != "ok"
        else f"{one.chart}: comes out wrong by {one.error:.0e}, {one.finer:.0e} with finer steps"
        for one in passed
    )  # fmt: skip
    judged = [one for one in passed if one.chart != "angles"] or passed
    words = ["passes" if one.passes else "wrong" if one.outcome == "ok" else "ends there" for one in judged]
    measured = ", ".join(dict.fromkeys(words))
    worst = max(one.finer for one in judged)
    if not declared:
        return Finding("pole", declared, measured, "measured", sentence, worst, long.POLE_RIGHT)
    if any(one.outcome not in ("ok", "left_chart", "not_finite") for one in judged):
        return Finding("pole", declared, measured, "undecided", sentence, worst, long.POLE_RIGHT)
    verdict = "confirmed" if all(one.passes for one in judged) else "refuted"
    return Finding("pole", declared, measured, verdict, sentence, worst, long.POLE_RIGHT)
