"""The symplectic and the symmetric claim: what one step does to the bracket, and whether it retraces itself.

The measurements are those of `symtop.measure.step_map`, in every chart of a method. A chart says no if the defect
stands out of what the differencing leaves in doubt, yes if it is none, and nothing between. The answer is no if any
chart says no, yes if one says yes and none no.
"""

import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import NamedTuple

from symtop.core.errors import SymtopError
from symtop.judging.claims.subject import Subject
from symtop.judging.findings import NOTHING, Finding, Measured, agreement, undecided, yes_no
from symtop.measure import step_map as maps
from symtop.model.top import Angles

SYMPLECTIC = 1e-9  # a smaller defect of the bracket is none
MET = 1e-8  # a larger one is one, if it stands out of its noise
STANDS = 0.2  # the raw defect of a symplectic map falls to 1/256 over the widths
RETURNED = 1e-10  # a return as close as this is exact
MISSED = 1e-8
ONE_MAP = 1e-9  # two steps are twice one step within this


class _Chart(NamedTuple):
    """What one chart says on one question: yes, no, or neither."""

    chart: str
    answer: bool | None
    value: float
    resolution: float
    why: str


def measure(subject: Subject) -> list[Finding]:
    """The findings on symplectic and symmetric."""
    names = subject.method.charts()[-1:] if subject.quick else subject.method.charts()
    steps = {chart: partial(maps.step_map, subject.method, chart, subject.scene) for chart in names}
    return structure_of(steps, subject)


def structure_of(steps: Mapping[str, Callable[[], tuple[maps.StepMap, Angles]]], subject: Subject) -> list[Finding]:
    """The findings from the map of a step in each chart, with the point to judge it at; a map may refuse to be made."""
    brackets: dict[str, _Chart] = {}
    returns: dict[str, _Chart] = {}
    for chart, made in steps.items():
        try:
            step, start = made()
            defect = maps.symplectic_defect(step, start)
            gap = maps.restart_gap(step, start)
            brackets[chart] = _bracket(chart, defect, gap)
            subject.traces.update(defect_width=defect.widths, bracket_defect=defect.raw)
            returns[chart] = _returned(chart, maps.return_miss(step, start), gap)
        except SymtopError as error:
            unknown = _Chart(chart, None, math.nan, math.nan, undecided("", "", str(error)).why)
            brackets.setdefault(chart, unknown)
            returns.setdefault(chart, unknown)
    return [
        _over_charts("symplectic", subject.method.symplectic, list(brackets.values())),
        _over_charts("symmetric", subject.method.symmetric, list(returns.values())),
    ]


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
            measured = NOTHING if answer is None else Measured(yes_no(answer), worst.value)
            verdict = agreement(declared=declared, measured=answer)
            why = f"{worst.why}, in the {worst.chart} chart"
            return Finding(claim, yes_no(declared), measured, verdict, why, worst.value, worst.resolution)
    return undecided(claim, yes_no(declared), "no chart could be tried")
