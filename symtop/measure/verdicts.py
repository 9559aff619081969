"""What became of a run, judged afterwards against the truth.

An outcome that is not ok stands. A run that reached its end is, in this order,

    accurate            the axis error is at most 1e-2 rad throughout, and at most a tenth of the nutation's width
    wrong_regime        the axis went where the true motion never goes: a tenth of the width beyond a turning point, or
                        past a pole on the other side (p_phi - p_psi or p_phi + p_psi changed its sign)
    drifting            the energy error grew with time and passed 1 % of the energy of the nutation
    bounded_but_wrong   everything looks right except the answer

`judge` takes arrays and costs 0.13 us a run, `verdict` takes one dataset, and `judgement` adds the time and the cause.
"""

import math
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from symtop.methods.framework.plan import OUTCOMES
from symtop.model.scenes import Scene
from symtop.run.guard.guard import EXPECTED

ACCURATE = EXPECTED  # rad: what is wrong afterwards is what the guard warns of before
OUTSIDE = 0.1  # of the nutation's width, or rad if it has none
STEADY = 1e-6  # rad; a nutation narrower than this is a steady precession, known to rounding only
DRIFT = 0.01  # of the energy of the nutation, `Scene.energy_scale`
GROWING = 1.3  # the second half's largest energy error over the first half's; bounded errors have 1
FEWEST = 8  # samples of half a run: fewer do not tell an energy that grows from one that oscillates
NO_GAP = 1e-9  # of the momentum scale: a gap p_phi -+ p_psi below this has no sign to change

JUDGED = ("accurate", "bounded_but_wrong", "drifting", "wrong_regime")
VERDICTS = (*JUDGED, *OUTCOMES[1:])
BOUNDED_BUT_WRONG, DRIFTING, WRONG_REGIME = 1, 2, 3
_EARLY = len(JUDGED) - 1  # an outcome k > 0 is the verdict k + 3


class Barriers(NamedTuple):
    """The turning points of the true motion, and how exact a run has to be to have respected them; radians."""

    highest: float  # the smallest theta
    lowest: float  # the largest theta
    margin: float
    accurate: float  # the largest axis error that is still accurate


def barriers(scene: Scene) -> Barriers:
    """What the axis of a scene never passes."""
    low, high = scene.top.turning_cosines(scene.start)
    highest, lowest = math.acos(min(high, 1.0)), math.acos(max(low, -1.0))
    width = lowest - highest if lowest - highest > STEADY else 1.0
    return Barriers(highest, lowest, OUTSIDE * width, min(ACCURATE, OUTSIDE * width))


def judge(
    truth: Barriers,
    outcome: ArrayLike,
    axis_error: ArrayLike,
    theta_low: ArrayLike,
    theta_high: ArrayLike,
    energy_early: ArrayLike,
    energy_late: ArrayLike,
    passed_pole: ArrayLike = False,
) -> NDArray[np.uint8]:
    """Index into `VERDICTS` of each of many runs of one scene; all arguments broadcast.

    `outcome` is an index into `OUTCOMES`; `axis_error` the largest over the run, rad; `theta_low` and `theta_high` its
    extreme inclinations; `energy_early` and `energy_late` the largest energy errors of its two halves in units of
    `Scene.energy_scale`; `passed_pole` whether a pole was passed on the other side. `truth` may hold arrays as well.
    NaN counts as the worst. Numbers of a run that ended early are not looked at.
    """
    ended, early, late = np.asarray(outcome), np.asarray(energy_early), np.asarray(energy_late)
    low, high = np.asarray(theta_low), np.asarray(theta_high)
    with np.errstate(invalid="ignore", over="ignore"):
        accurate = np.asarray(axis_error) <= truth.accurate
        inside = (low >= truth.highest - truth.margin) & (high <= truth.lowest + truth.margin)
        steady = (late <= DRIFT) | (late <= GROWING * early)
    word = np.where(steady, BOUNDED_BUT_WRONG, DRIFTING)
    word = np.where(inside & ~np.asarray(passed_pole, dtype=bool), word, WRONG_REGIME)
    word = np.where(accurate, 0, word)
    verdicts: NDArray[np.uint8] = np.where(ended == 0, word, ended + _EARLY).astype(np.uint8)
    return verdicts


def pole_passed(scene: Scene, p_phi: Any, p_psi: Any) -> NDArray[np.bool_]:
    """At which samples (...) of momenta the axis has passed a pole on the side that those of the start forbid."""
    momenta = scene.top.momenta(scene.start)
    least = NO_GAP * scene.momentum_scale
    passed = np.zeros(np.shape(p_phi), dtype=bool)
    for gap, now in ((momenta.north, p_phi - p_psi), (momenta.south, p_phi + p_psi)):
        if abs(gap) > least:
            passed |= now * gap < 0.0
    return passed


def verdict(scene: Scene, run: xr.Dataset, axis_error: np.ndarray) -> str:
    """One word of `VERDICTS` for a run with the given axis errors at its samples."""
    ended = OUTCOMES.index(str(run.attrs["outcome"]))
    if ended:
        return OUTCOMES[ended]
    theta = run["theta"].values
    energy = np.abs(run["energy"].values - run["energy"].values[0]) / scene.energy_scale
    half = energy.size // 2
    early = energy[:half] if half >= FEWEST else energy
    index = judge(
        barriers(scene), ended, np.max(axis_error), theta.min(), theta.max(),
        early.max(), energy[half:].max(), pole_passed(scene, run["p_phi"].values, run["p_psi"].values).any(),
    )  # fmt: skip
    return VERDICTS[int(index)]


class Judgement(NamedTuple):
    """A verdict, the time from which it holds, and the cause, in one sentence."""

    verdict: str
    time: float
    sentence: str

    def words(self) -> str:
        """The verdict and its cause, as a line of text."""
        return self.sentence if self.verdict == "accurate" else f"{self.verdict.replace('_', ' ')}, {self.sentence}"


def judgement(scene: Scene, run: xr.Dataset, axis_error: np.ndarray) -> Judgement:
    """The verdict on a run, with the time and the cause."""
    word, times = verdict(scene, run, axis_error), run["time"].values
    if word not in JUDGED:
        return Judgement(word, float(run.attrs["reached_time"]), str(run.attrs["outcome_message"]))
    truth, worst = barriers(scene), float(np.max(axis_error))
    if word == "accurate":
        return Judgement(word, float(times[-1]), f"accurate to {worst:.2g} rad up to t = {times[-1]:.6g}")
    theta = run["theta"].values
    beyond = ~((theta >= truth.highest - truth.margin) & (theta <= truth.lowest + truth.margin))
    passed = pole_passed(scene, run["p_phi"].values, run["p_psi"].values)
    energy = np.abs(run["energy"].values - run["energy"].values[0]) / scene.energy_scale
    events: dict[str, Any] = {
        "wrong_regime": beyond | passed,
        "drifting": ~(energy <= DRIFT),
        "bounded_but_wrong": ~(axis_error <= truth.accurate),
    }
    first = int(np.argmax(events[word]))
    when = f"t = {times[first]:.6g}"
    if word == "wrong_regime" and beyond[first]:
        bounds = f"{truth.highest:.4g} to {truth.lowest:.4g}"
        sentence = f"at {when} theta was {theta[first]:.4g} rad, where the true motion never goes ({bounds})"
    elif word == "wrong_regime":
        sentence = f"at {when} the axis had passed a pole on the side that its momenta forbid"
    elif word == "drifting":
        sentence = f"the energy error passed {DRIFT:.0%} at {when} and grew on, to {energy.max():.2g}"
    else:
        kept = f"while the energy stayed within {energy.max():.2g}"
        sentence = f"the axis error passed {truth.accurate:.2g} rad at {when} {kept}"
    return Judgement(word, float(times[first]), sentence)
