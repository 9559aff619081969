"""The verdict on a finished run, judged against the true motion.

A run that failed keeps its outcome as the verdict. A run that reached its end is, in this order,

    accurate            the axis error is at most 1e-2 rad throughout, and at most a tenth of the nutation's width
    wrong_regime        the axis went where the true motion never goes: a tenth of the width beyond a turning point, or
                        past a pole on the other side (p_phi - p_psi or p_phi + p_psi changed its sign)
    drifting            the energy error grew with time and passed 1 % of the energy of the nutation
    wrong               the energy error grew, but stayed below 1 %
    bounded_but_wrong   the energy error did not grow, or is rounding: only the axis error shows that the run is wrong
"""

import math
from decimal import ROUND_CEILING, Context
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from symtop.model.scenes import Scene
from symtop.run.guard import EXPECTED

ACCURATE_ERROR = EXPECTED  # rad, of the axis; the guard warns if it expects more, however narrow the nutation
OUTSIDE_MARGIN = 0.1  # margin beyond a turning point, in widths of the nutation, or in rad if there is no nutation
STEADY_WIDTH = 1e-6  # rad; a nutation narrower than this is a steady precession, known to rounding only
DRIFT_ERROR = 0.01  # energy error of a drifting run, in units of the energy of the nutation, `Scene.energy_scale`
GROWING_RATIO = 1.3  # an energy error grows if its maximum over the second half is this many times that over the first
ROUNDING = 1e-12  # times `Scene.energy_grain`: an energy error below that is rounding and is not said to grow
FEWEST_SAMPLES = 8  # samples of half a run: with fewer, growth of the energy cannot be told from oscillation
NO_GAP = 1e-9  # of the momentum scale: a gap p_phi -+ p_psi below this has no sign to change


def barriers(scene: Scene) -> tuple[float, float, float, float]:
    """Least and largest true theta, the margin allowed beyond them, and the largest accurate axis error, all in rad."""
    if scene.of_body:  # the axis may point anywhere
        return 0.0, math.pi, OUTSIDE_MARGIN, ACCURATE_ERROR
    low, high = scene.top.turning_cosines(scene.start)
    highest, lowest = math.acos(min(high, 1.0)), math.acos(max(low, -1.0))
    width = lowest - highest if lowest - highest > STEADY_WIDTH else 1.0
    return highest, lowest, OUTSIDE_MARGIN * width, min(ACCURATE_ERROR, OUTSIDE_MARGIN * width)


def pole_passed(scene: Scene, p_phi: Any, p_psi: Any) -> NDArray[np.bool_]:
    """For samples (...) of the momenta: has the axis passed a pole on the side that the start's momenta forbid?"""
    passed = np.zeros(np.shape(p_phi), dtype=bool)
    if scene.of_body:  # no momentum keeps its axis from a pole
        return passed
    momenta = scene.top.momenta(scene.start)
    smallest = NO_GAP * scene.momentum_scale
    for gap, value in ((momenta.north, p_phi - p_psi), (momenta.south, p_phi + p_psi)):
        if abs(gap) > smallest:
            passed |= value * gap < 0.0
    return passed


class Judgement(NamedTuple):
    """A verdict, the time from which it holds, and the cause, in one sentence."""

    verdict: str
    time: float
    sentence: str

    def words(self) -> str:
        """The verdict and its cause, as a line of text."""
        return self.sentence if self.verdict == "accurate" else f"{self.verdict.replace('_', ' ')}, {self.sentence}"


def judgement(scene: Scene, run: xr.Dataset, axis_error: np.ndarray) -> Judgement:
    """The verdict on a run with the given axis errors (attitude errors for a body); NaN counts as the largest error."""
    times, outcome = run["time"].values, str(run.attrs["outcome"])
    if outcome != "ok":
        return Judgement(outcome, float(run.attrs["reached_time"]), str(run.attrs["outcome_message"]))
    (highest, lowest, margin, accurate), worst = barriers(scene), float(np.max(axis_error))
    if worst <= accurate:
        sentence = f"accurate to {_rounded_up(worst)} rad up to t = {times[-1]:.6g}{scene.second}"
        return Judgement("accurate", float(times[-1]), sentence)
    theta, energy = run["theta"].values, np.abs(run["energy"].values - run["energy"].values[0]) / scene.energy_scale
    outside = ~((theta >= highest - margin) & (theta <= lowest + margin))
    violations = outside | pole_passed(scene, run["p_phi"].values, run.get("p_psi", run["p_phi"]).values)
    half = energy.size // 2
    first_half, second_half = np.max(energy[:half] if half >= FEWEST_SAMPLES else energy), np.max(energy[half:])
    if violations.any():
        first = int(np.argmax(violations))
        word, sentence = "wrong_regime", "the axis had passed a pole on the side that its momenta forbid"
        if outside[first]:
            bounds = f"{highest:.4g} to {lowest:.4g}"
            sentence = f"theta was {theta[first]:.4g} rad, where the true motion never goes ({bounds})"
        sentence = f"at t = {times[first]:.6g}{scene.second} {sentence}"
    elif not (second_half <= DRIFT_ERROR or second_half <= GROWING_RATIO * first_half):
        word, first = "drifting", int(np.argmax(~(energy <= DRIFT_ERROR)))
        time_words = f"{times[first]:.6g}{scene.second}"
        sentence = f"the energy error passed {DRIFT_ERROR:.0%} at t = {time_words} and grew on, to {energy.max():.2g}"
    else:
        word, first, energies = "bounded_but_wrong", int(np.argmax(~(axis_error <= accurate))), "stayed within {}"
        if second_half > max(GROWING_RATIO * first_half, ROUNDING * scene.energy_grain):
            word, energies = "wrong", f"error grew, to {{}}, below {DRIFT_ERROR:.0%}"
        energies = f"while the energy {energies.format(_rounded_up(energy.max()))}"
        sentence = f"the axis error passed {accurate:.2g} rad at t = {times[first]:.6g}{scene.second} {energies}"
    return Judgement(word, float(times[first]), sentence)


def _rounded_up(bound: float) -> str:
    """A bound to two digits, rounded up."""
    return f"{float(Context(prec=2, rounding=ROUND_CEILING).create_decimal(repr(float(bound)))):.2g}"
