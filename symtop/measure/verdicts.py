"""What became of a run, or of many, judged afterwards against the truth.

An outcome that is not ok stands. A run that reached its end is, in this order,

    accurate            the axis error is at most 1e-2 rad throughout, and at most a tenth of the nutation's width
    wrong_regime        the axis went where the true motion never goes: a tenth of the width beyond a turning point, or
                        past a pole on the other side (p_phi - p_psi or p_phi + p_psi changed its sign)
    drifting            the energy error grew with time and passed 1 % of the energy of the nutation
    bounded_but_wrong   everything looks right except the answer

`judge` takes arrays of such measurements, `verdict` takes one dataset, and `judgement` adds the time and the cause.
`judge_runs` takes the states of many runs in one compiled pass. The order of its rules saves work: the axis error is
looked at from the last sample backwards and no further than the first one that is too large, the energy of those runs
only whose axis stayed where the true motion goes. An inclination is compared with a bound b without an arc tangent,
theta > b where sin(theta) cos(b) > sin(b) cos(theta), 0 <= theta, b <= pi, and so are two angles between axes.
"""

import functools
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from symtop.methods.framework.plan import NOT_FINITE, OUTCOMES
from symtop.model.exact import samples
from symtop.model.exact.closed_form import ClosedForms
from symtop.model.scenes import Scene
from symtop.model.top import effective_potential, flat
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


Array = NDArray[np.float64]


class Judged(NamedTuple):
    """What became of runs, (scenes, settings) or one row of them."""

    verdict: NDArray[np.uint8]  # index into VERDICTS
    axis_error: Array  # rad, largest over the run; NaN if it ended early

    @classmethod
    def begun(cls, scenes: int, settings: int) -> "Judged":
        """Room for so many."""
        return cls(np.zeros((scenes, settings), np.uint8), np.full((scenes, settings), math.nan))


class Truths(NamedTuple):
    """What the runs of m scenes are judged by."""

    constants: Array  # (m, constants of a closed form)
    scenes: Array  # (m, 11): I1, I3, mgl, nutation period, `Barriers`, energy scale, p_phi -+ p_psi where it has a sign

    @property
    def periods(self) -> Array:
        """Nutation periods (m,)."""
        return self.scenes[:, 3]

    def part(self, scenes: NDArray[np.int64]) -> "Truths":
        """The same for some of the scenes."""
        return Truths(self.constants[scenes], self.scenes[scenes])


def truths(scenes: Sequence[Scene]) -> Truths:
    """Closed forms and bounds of scenes, whose numbers are kept for the last 1024 of them."""
    forms = ClosedForms([flat(scene.top, scene.start) for scene in scenes])
    return Truths(forms.constants, np.array([_numbers(scene) for scene in scenes]))


@functools.lru_cache(maxsize=1024)
def _numbers(scene: Scene) -> tuple[float, ...]:
    top, momenta, least = scene.top, scene.top.momenta(scene.start), NO_GAP * scene.momentum_scale
    gaps = (gap if abs(gap) > least else 0.0 for gap in (momenta.north, momenta.south))
    return top.I1, top.I3, top.mgl, scene.nutation_period, *barriers(scene), scene.energy_scale, *gaps


def judge_runs(
    truth: Truths, phases: Array, followed: NDArray[np.bool_], states: Array, momenta: Array,
    outcome: NDArray[np.int64],
) -> Judged:  # fmt: skip
    """Verdicts on the runs of m scenes at each of n settings.

    `phases` (n, samples) are the times of the samples in nutation periods, NaN beyond the last of a run; `states`
    (m, n, samples, dimension) those of a chart, known by its dimension, `momenta` (m, n, samples, 2) p_phi and p_psi as
    the run showed them, and `outcome` (m, n) indices into `OUTCOMES`. A run that shows a state that is not finite and
    says nothing of it has ended there. The error of an inaccurate run is the first, counted from its end, that is too
    large; that of the settings `followed` (n,) is the largest.
    """
    judged = Judged.begun(*outcome.shape)
    counts = np.isfinite(phases).sum(axis=1)
    runs = np.ascontiguousarray(states), np.ascontiguousarray(momenta), np.ascontiguousarray(outcome)
    _kernel()(*truth, phases, counts, followed, *runs, *judged)
    return judged


@functools.cache
def _kernel() -> Any:  # noqa: C901  (one loop, read in one piece)
    from symtop.core.jit import compile_kernel, register_jitable  # numba

    true_axis, potential = register_jitable(samples._axis), register_jitable(effective_potential)

    @register_jitable
    def axis_of(state):  # type: ignore[no-untyped-def]
        if len(state) == 4:
            across = math.sin(state[0])
            return across * math.sin(state[2]), -across * math.cos(state[2]), math.cos(state[0])
        if len(state) == 6:
            return state[0], state[1], state[2]
        w, x, y, z = state[0], state[1], state[2], state[3]
        return 2.0 * (x * z + w * y), 2.0 * (y * z - w * x), w * w - x * x - y * y + z * z

    @register_jitable
    def energy_of(scene, state, p_phi, p_psi):  # type: ignore[no-untyped-def]
        I1, I3, mgl = scene[0], scene[1], scene[2]
        if len(state) == 4:
            kinetic = state[1] * state[1] / (2.0 * I1) + p_psi * p_psi / (2.0 * I3)
            return kinetic + potential(state[0], p_phi - p_psi, p_phi + p_psi, I1, mgl)
        d = len(state)
        squares = state[d - 3] * state[d - 3] + state[d - 2] * state[d - 2] + state[d - 1] * state[d - 1]
        return squares / (2.0 * I1) + 0.5 * p_psi * p_psi * (1.0 / I3 - 1.0 / I1) + mgl * axis_of(state)[2]

    @register_jitable
    def axis_error(c, period, phases, states, count, accurate):  # type: ignore[no-untyped-def]
        """The largest error, or the first from the end that is larger than `accurate`."""
        sine, cosine, bound = 0.0, 1.0, math.tan(min(accurate, 1.5))
        for j in range(count - 1, -1, -1):
            x, y, z = true_axis(c, phases[j] * period)
            u, v, w = axis_of(states[j])
            a, b, d = u - x, v - y, w - z
            left, back, lift = b * z - d * y, d * x - a * z, a * y - b * x
            apart, along = math.sqrt(left * left + back * back + lift * lift), u * x + v * y + w * z
            if not apart * cosine <= sine * along:  # NaN is an error, too
                sine, cosine = apart, along
                if not apart <= bound * along and accurate < 1.5:
                    break
        return math.atan2(sine, cosine)

    @register_jitable
    def strays(scene, states, momenta, count):  # type: ignore[no-untyped-def]
        """Does the axis go where the true motion never goes?"""
        top, bottom, north, south = scene[4] - scene[6], scene[5] + scene[6], scene[9], scene[10]
        top_sine, top_cosine, sine, cosine = math.sin(top), math.cos(top), math.sin(bottom), math.cos(bottom)
        for j in range(count):
            p_phi, p_psi = momenta[j, 0], momenta[j, 1]
            if (p_phi - p_psi) * north < 0.0 or (p_phi + p_psi) * south < 0.0:
                return True
            if states.shape[1] == 4:
                if states[j, 0] < top or states[j, 0] > bottom:
                    return True
                continue
            x, y, z = axis_of(states[j])
            across = math.sqrt(x * x + y * y)
            if top > 0.0 and across * top_cosine < top_sine * z:
                return True
            if bottom < math.pi and across * cosine > sine * z:
                return True
        return False

    @register_jitable
    def drifts(scene, states, momenta, count):  # type: ignore[no-untyped-def]
        """Does the energy error grow and pass the bound? With few samples nothing is said to grow."""
        half = count // 2
        before = half if half >= FEWEST else count
        start, early, late = energy_of(scene, states[0], momenta[0, 0], momenta[0, 1]), 0.0, 0.0
        for j in range(count):
            error = abs(energy_of(scene, states[j], momenta[j, 0], momenta[j, 1]) - start) / scene[8]
            if j < before and error > early:
                early = error
            if j >= half and error > late:
                late = error
        return not (late <= DRIFT or late <= GROWING * early)

    def judge_all(  # type: ignore[no-untyped-def]
        constants, scenes, phases, counts, followed, states, momenta, outcome, verdict, error
    ):
        for i in range(outcome.shape[0]):
            scene = scenes[i]
            for k in range(outcome.shape[1]):
                ended, count, run, kept = outcome[i, k], counts[k], states[i, k], momenta[i, k]
                if ended == 0:
                    for j in range(count):
                        total = 0.0
                        for q in range(run.shape[1]):
                            total += run[j, q]
                        if not math.isfinite(total):
                            ended = NOT_FINITE
                if ended != 0:
                    verdict[i, k] = ended + WRONG_REGIME
                    continue
                most = math.inf if followed[k] else scene[7]
                error[i, k] = axis_error(constants[i], scene[3], phases[k], run, count, most)
                if error[i, k] <= scene[7]:
                    verdict[i, k] = 0
                elif strays(scene, run, kept, count):
                    verdict[i, k] = WRONG_REGIME
                else:
                    verdict[i, k] = DRIFTING if drifts(scene, run, kept, count) else BOUNDED_BUT_WRONG

    return compile_kernel(judge_all)
