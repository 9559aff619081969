"""The claims of symplecticity, symmetry and the pole, measured on one step and on a run through theta = 0.

Whether a step preserves the Poisson bracket, and whether it is symmetric, is measured by `symtop.measure.step_map` in
every chart of a method. The answer of a chart is no if the defect is clearly above the error of the differencing, yes
if it is negligible, and undecided between. A method fails if one chart fails, and passes if one passes and none fails.
A failure is measured again at half the step, where a true defect is smaller by a power of two; a defect that almost
vanishes there came from an iteration that had not converged.

For the pole, a run goes through theta = 0 exactly, and must continue correctly on the other side. A method in the space
frame claims to pass, one in angles claims nothing; both are run, with a step and with half of it.

A map of (theta, p_theta) is symplectic if it keeps the area, {theta, p_theta} = 1; p_theta is in units of the larger
momentum.
"""

import contextlib
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from symtop.core.errors import SymtopError
from symtop.judging.claims.subject import Subject, hidden_by_single
from symtop.judging.findings import Finding, Reading, agreement, inapplicable, undecided
from symtop.measure import step_map as maps
from symtop.measure.errors import errors
from symtop.methods.framework.plan import Array
from symtop.methods.framework.registry import Integrator
from symtop.model.scenes import Scene
from symtop.model.top import Angles, Momenta, SymmetricTop
from symtop.run.simulation import simulate

SYMPLECTIC = 1e-9  # a smaller defect of the bracket is zero
REAL_DEFECT = 1e-8  # a larger defect counts, if it is above its noise
PERSISTENT_RATIO = 0.2  # of raw defects, finest to widest, above which one counts; a symplectic map has 1/256
LOST_IN_NOISE = 1e-3  # of the noise: a smaller raw defect does not count; near a pole, large slopes in angles leave one
RETURN_GAP = 1e-10  # a step forth and back that ends nearer to its start is symmetric
NO_RETURN_GAP = 1e-8  # one that ends farther away is not
VANISHING_RATIO = 4096.0  # a defect vanishes if it is so many times smaller at half the step: 2^12, as of order 12
BRACKET_UNITS, RETURN_UNITS = 8.0, 64.0  # single-precision epsilons in a difference of two steps, and forth and back
ONE_MAP = 1e-9  # two steps are twice one step within this
TAKES_A_NUMBER = 1e-11  # farther apart, a run may have taken a number from its start: a fitted method's frequency
DRAWS, DRAW_SECONDS = (8, 4), (10.0, 2.0)  # random starts, and seconds for them; the second if `quick`
POLE_STEPS = 400
POLE_RIGHT = 1e-7  # rad: a smaller error is right, whether or not it falls with the step
# the axis passes theta = 0 exactly: I1 = I3 = mgl = 1, w3 = 1, p_phi = p_psi, theta' = -1.2 at theta = 1
_POLE_RATE = 0.5 / math.cos(0.5) ** 2
_POLE_START = Angles(theta=1.0, theta_dot=-1.2, phi_dot=_POLE_RATE, psi_dot=1.0 - _POLE_RATE * math.cos(1.0))
POLE = Scene("pole", SymmetricTop(1.0, 1.0, 1.0), _POLE_START, 4.0)

Answer = tuple[bool | None, float, float, str]  # of a chart: yes, no or neither; value, resolution and reason


def measure(subject: Subject) -> list[Finding]:
    """The findings on the claims "symplectic" and "symmetric"."""
    by_claim: dict[str, list[Finding]] = {"symplectic": [], "symmetric": []}
    for chart in subject.charts:
        answers: list[Answer] = []
        try:
            step, start = map_of(subject, chart)
            subject.traces["structure_step"] = np.array(step.h)
            answers.append(_answer_at(_symplectic, step, start, subject.traces))
            answers.append(_answer_at(_reversible, step, start))
            if subject.method.fixed_step and not subject.in_plane:
                answers = _refuted_elsewhere(subject, step, answers)
            finest = maps.WIDEST_DIFFERENCE / 2.0 ** (maps.WIDTHS - 1)
            rounding = subject.rounding(BRACKET_UNITS) / finest, subject.rounding(RETURN_UNITS)
            for k, (holds, value, _, why) in enumerate(answers):
                if holds is False and value <= rounding[k]:
                    answers[k] = None, value, rounding[k], hidden_by_single(rounding[k], why)
        except SymtopError as error:
            answers += [(None, math.nan, math.nan, undecided("", "", str(error)).why)] * (2 - len(answers))
        for claim, (holds, value, resolution, why) in zip(by_claim, answers, strict=True):
            claimed, words = getattr(subject.method, claim), f"{why}, in the {chart} chart"
            by_claim[claim].append(agreement(claim, claimed, holds, words, value, resolution))
    return [max(findings, key=_badness) for findings in by_claim.values()]


@dataclass(frozen=True)
class Plane(maps.StepMap):
    """The map of a step in the plane (theta, p_theta), run in the angles chart; both z and Y are (theta, p_theta)."""

    momenta: Momenta

    def scaled(self, state: Array, _phi: float, _psi: float) -> Array:
        """A state as Y."""
        return np.asarray(state[:2] / np.array([1.0, self.unit]))

    def angles(self, z: Array) -> Angles:
        """The start at a point z, with phi = psi = 0."""
        coordinates = [float(z[0]), 0.0, 0.0, self.unit * float(z[1]), self.momenta.p_phi, self.momenta.p_psi]
        return maps.angles_at(self.top, np.array(coordinates))

    def point(self, start: Angles) -> Array:
        """z of a start."""
        return np.array([start.theta, self.top.I1 * start.theta_dot / self.unit])

    def gap(self, first: Array, second: Array) -> float:
        """Largest difference of two Y."""
        return float(np.max(np.abs(first - second)))


def map_of(subject: Subject, chart: str) -> tuple[maps.StepMap, Angles]:
    """The map of a step large enough to show a defect, and the start to judge it at; SymtopError if there is none."""
    if not subject.in_plane:
        return maps.step_map(subject.method, chart, subject.scene)
    scene, start = subject.scene, maps.generic_start(subject.scene)
    h, momenta = maps.RUN_NUTATIONS * scene.time_scale(), scene.top.momenta(start)
    return maps.coarsest(Plane(subject.method, "angles", scene.top, maps.unit_of(scene), h, momenta), start), start


def _badness(finding: Finding) -> tuple[int, float]:
    """The rank of a finding among the charts: no, then yes, then neither; then by its number."""
    return ("", "yes", "no").index(finding.measured.kind), finding.value if math.isfinite(finding.value) else -1.0


def _answer_at(check: Callable[..., Answer], step: maps.StepMap, start: Angles, *traces: dict[str, Any]) -> Answer:
    """The answer of `check` at a step, or that at half the step if a defect vanishes there (not converged)."""
    answer = check(step, start, *traces)
    falls = step.method.explicit and 2.0 ** (step.method.order or 0) >= VANISHING_RATIO  # a true defect falls as fast
    if answer[0] is False and step.method.fixed_step and not falls:
        with contextlib.suppress(SymtopError):
            finer = check(replace(step, h=0.5 * step.h), start)
            return finer if finer[0] and VANISHING_RATIO * finer[1] < answer[1] else answer
    return answer


def _symplectic(step: maps.StepMap, start: Angles, traces: dict[str, Any] | None = None) -> Answer:
    defect, gap = maps.symplectic_defect(step, start), maps.restart_gap(step, start)
    if traces is not None:
        traces.update(defect_width=defect.widths, bracket_defect=defect.raw)
    floor = max(3.0 * defect.noise, 1e-12)
    trend = f"from {defect.raw[0]:.0e} to {defect.raw[-1]:.0e} at a 16th of the width; noise {defect.noise:.0e}"
    foreign = step.own("onward") is not None  # perhaps a multistep method, whose first step is another method's
    if defect.size <= min(SYMPLECTIC, floor) and defect.noise <= SYMPLECTIC and not (foreign and gap > ONE_MAP):
        return True, defect.size, floor, f"defect of the bracket {defect.size:.0e} (it falls {trend})"
    tuned = gap > TAKES_A_NUMBER and not foreign and step.chart != "axis"
    if tuned and defect.rest <= max(3.0 * defect.noise, SYMPLECTIC) and defect.noise <= SYMPLECTIC:
        why = f"one number that a run takes from its start explains the defect ({defect.rest:.0e} is left)"
        return True, defect.rest, floor, why
    if gap > ONE_MAP:
        return None, defect.size, floor, f"a run differs from its steps one by one by {gap:.0e}: no one map"
    stands = defect.raw[-1] > max(PERSISTENT_RATIO * defect.raw[0], 100.0 * REAL_DEFECT, LOST_IN_NOISE * defect.noise)
    violated = stands or defect.size > max(10.0 * defect.noise, REAL_DEFECT)
    return False if violated else None, defect.size, floor, f"defect of the bracket {defect.size:.1e} (it goes {trend})"


def _reversible(step: maps.StepMap, start: Angles) -> Answer:
    miss = maps.return_miss(step, start)
    if (miss > RETURN_GAP or step.own("onward") is not None) and (gap := maps.restart_gap(step, start)) > ONE_MAP:
        return None, miss, RETURN_GAP, f"a run differs from its steps one by one by {gap:.0e}: no one map"
    why = f"a step forth and back misses the start by {miss:.1e}"
    return True if miss <= RETURN_GAP else False if miss > NO_RETURN_GAP else None, miss, RETURN_GAP, why


def _refuted_elsewhere(subject: Subject, step: maps.StepMap, answers: list[Answer]) -> list[Answer]:
    """The answers, with each yes replaced by a no that is measured at a random start."""
    for name, scene in subject.elsewhere(DRAWS, DRAW_SECONDS) if answers[0][0] or answers[1][0] else ():
        with contextlib.suppress(SymtopError):
            trial = maps.one_step(step.method, step.chart, scene, maps.RUN_NUTATIONS * scene.time_scale())
            coarse = maps.coarsest(trial, scene.start)
            for i, check in enumerate((_symplectic, _reversible)):
                if answers[i][0] and (answer := _answer_at(check, coarse, scene.start))[0] is False:
                    answers[i] = *answer[:3], f"{answer[3]} ({name})"
    return answers


class Passage(NamedTuple):
    """The run of a method in one chart in which the axis passes a pole."""

    chart: str
    outcome: str
    error: float  # of the axis, rad
    finer: float  # with half the step or a tenth of the tolerance
    right: float = POLE_RIGHT

    @property
    def passes(self) -> bool:
        """Did it reach the end, with a small error or one that falls with the step?"""
        return self.outcome == "ok" and (self.finer < 0.7 * self.error or self.finer < self.right)

    @property
    def word(self) -> str:
        """The result in a word: "passes", "wrong" or "ends there"."""
        return "passes" if self.passes else "wrong" if self.outcome == "ok" else "ends there"

    def __str__(self) -> str:
        words = f", off by {self.error:.0e} and {self.finer:.0e} with finer steps"
        return f"{self.chart}: {self.word}{words if self.outcome == 'ok' else f' ({self.outcome})'}"


def passages(method: Integrator, right: float = POLE_RIGHT) -> list[Passage]:
    """Run a method through a pole in each of its charts; an error below `right` (rad) is negligible."""
    rows = []
    for chart in method.charts():
        settings = [max(tolerance, method.least_tolerance) for tolerance in (1e-6, 1e-7)]
        if method.fixed_step:
            settings = [POLE.horizon / (POLE_STEPS * finer) for finer in (1.0, 2.0)]
        options: dict[str, Any] = {"samples": 201, "observe": "attitude" if chart == "attitude" else "axis"}
        controls = [options | method.given(setting) for setting in settings]
        runs = [simulate(POLE, method.variant(chart), guard=False, **control) for control in controls]
        ends = {str(run.attrs["outcome"]) for run in runs} - {"ok"}
        error, finer = (float(errors(run)["axis"].max()) for run in runs)
        rows.append(Passage(chart, max(ends, default="ok"), error, finer, right))
    return rows


def pole(subject: Subject) -> list[Finding]:
    """The finding on the pole; for a bare step it is measured without a claim, because its chart implies none."""
    if subject.knows_top:
        return [inapplicable("pole", "it knows equations of the top beside f, and the pole is passed on another top")]
    right = max(POLE_RIGHT, subject.rounding(2.0 * POLE_STEPS))
    claim, rows = subject.declared("pole"), passages(subject.method, right)
    relevant = [row for row in rows if row.chart != "angles"] or rows
    verdict = "measured" if not claim else "confirmed" if all(row.passes for row in relevant) else "refuted"
    if claim and any(row.outcome not in ("ok", "left_chart", "not_finite", "not_normalised") for row in relevant):
        verdict = "undecided"
    measured = Reading(", ".join(dict.fromkeys(row.word for row in relevant)))
    value = max(row.finer for row in relevant)
    return [Finding("pole", claim, measured, verdict, "; ".join(map(str, rows)), value, right)]
