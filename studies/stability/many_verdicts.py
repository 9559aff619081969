"""Verdicts on many runs in one compiled pass, as `symtop.measure.verdicts.judgement` has them one by one.

The order of the rules saves work: the axis error is computed from the last sample backwards, up to the first one that
is too large, and the energy only for runs whose axis stays in the range of the true motion. An inclination is compared
with a bound b without an arc tangent, theta > b where sin(theta) cos(b) > sin(b) cos(theta), 0 <= theta, b <= pi, and
so are two angles between axes.
"""

import functools
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from symtop.measure.verdicts import DRIFT_ERROR, FEWEST_SAMPLES, GROWING_RATIO, NO_GAP, ROUNDING, barriers
from symtop.methods.framework.plan import NOT_FINITE, NOT_NORMALISED, OUTCOMES, off_length
from symtop.methods.framework.space import axis_of as of_quaternion
from symtop.model.charts import DIMENSIONS, Array
from symtop.model.exact import samples
from symtop.model.exact.closed_form import ClosedForms
from symtop.model.scenes import Scene
from symtop.model.top import effective_potential, flat

JUDGED = ("accurate", "bounded_but_wrong", "drifting", "wrong_regime")
VERDICTS = (*JUDGED, *OUTCOMES[1:], "wrong")
BOUNDED_BUT_WRONG, DRIFTING, WRONG_REGIME, WRONG = 1, 2, 3, len(VERDICTS) - 1
EARLY = "ended early"
SAID = dict(zip(JUDGED, ("accurate", "bounded energy, wrong motion", "energy drifts", "crosses a turning point"),
                strict=True)) | {name: f"{EARLY}: {name.replace('_', ' ')}" for name in OUTCOMES[1:]}  # fmt: skip
SAID["wrong"] = f"wrong motion, energy error below {100.0 * DRIFT_ERROR:g} %"


class RunVerdicts(NamedTuple):
    """Verdicts on runs, (scenes, settings) or one row of them."""

    verdict: NDArray[np.uint8]  # index into VERDICTS
    axis_error: Array  # rad, largest over the run; NaN if it ended early

    @classmethod
    def empty(cls, scenes: int, settings: int) -> "RunVerdicts":
        """Arrays for the runs of n scenes at m settings, to be filled in."""
        return cls(np.zeros((scenes, settings), np.uint8), np.full((scenes, settings), math.nan))


class Truths(NamedTuple):
    """The numbers of m scenes by which runs are judged."""

    constants: Array  # (m, constants of a closed form)
    # (m, 12): I1, I3, mgl, nutation period, `barriers`, energy scale, p_phi -+ p_psi where it has a sign, rounding
    scenes: Array

    @property
    def periods(self) -> Array:
        """Nutation periods (m,)."""
        return self.scenes[:, 3]

    def part(self, scenes: NDArray[np.int64]) -> "Truths":
        """The truths of the scenes with these indices."""
        return Truths(self.constants[scenes], self.scenes[scenes])


def truths(scenes: Sequence[Scene]) -> Truths:
    """Closed forms and bounds of scenes; the bounds of the last 1024 scenes are cached."""
    forms = ClosedForms([flat(scene.top, scene.start) for scene in scenes])
    return Truths(forms.constants, np.array([_numbers(scene) for scene in scenes]))


@functools.lru_cache(maxsize=1024)
def _numbers(scene: Scene) -> tuple[float, ...]:
    rounding = ROUNDING * scene.energy_grain
    top, momenta, least = scene.top, scene.top.momenta(scene.start), NO_GAP * scene.momentum_scale
    gaps = (gap if abs(gap) > least else 0.0 for gap in (momenta.north, momenta.south))
    return top.I1, top.I3, top.mgl, scene.nutation_period, *barriers(scene), scene.energy_scale, *gaps, rounding


def judge_runs(
    truth: Truths, phases: Array, followed: NDArray[np.bool_], states: Array, momenta: Array,
    outcome: NDArray[np.int64],
) -> RunVerdicts:  # fmt: skip
    """Verdicts on the runs of m scenes at each of n settings.

    `phases` (n, samples) are the times of the samples in nutation periods, NaN beyond the last of a run; `states`
    (m, n, samples, dimension) those of a chart, known by its dimension, `momenta` (m, n, samples, 2) p_phi and p_psi as
    the run returned them, and `outcome` (m, n) indices into `OUTCOMES`. A run with outcome "ok" and a state that is not
    finite, or a quaternion that is not of length one, counts as ended there. The error of an inaccurate run is the
    first, counted from its end, that is too large; at the settings `followed` (n,) it is the largest.
    """
    judged = RunVerdicts.empty(*outcome.shape)
    counts = np.isfinite(phases).sum(axis=1)
    if states.shape[-1] == DIMENSIONS["attitude"]:
        outcome = np.where(off_length("attitude", states).any(axis=-1), NOT_NORMALISED, outcome)
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
        return of_quaternion(state[0], state[1], state[2], state[3])

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
    def by_energy(scene, states, momenta, count):  # type: ignore[no-untyped-def]
        """The verdict by whether the energy error grows and passes the bound; few samples are not said to grow."""
        half = count // 2
        before = half if half >= FEWEST_SAMPLES else count
        start, early, late = energy_of(scene, states[0], momenta[0, 0], momenta[0, 1]), 0.0, 0.0
        for j in range(count):
            error = abs(energy_of(scene, states[j], momenta[j, 0], momenta[j, 1]) - start) / scene[8]
            if j < before and error > early:
                early = error
            if j >= half and error > late:
                late = error
        if not (late <= DRIFT_ERROR or late <= GROWING_RATIO * early):
            return DRIFTING
        return WRONG if late > max(GROWING_RATIO * early, scene[11]) else BOUNDED_BUT_WRONG

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
                limit = math.inf if followed[k] else scene[7]
                error[i, k] = axis_error(constants[i], scene[3], phases[k], run, count, limit)
                if error[i, k] <= scene[7]:
                    verdict[i, k] = 0
                elif strays(scene, run, kept, count):
                    verdict[i, k] = WRONG_REGIME
                else:
                    verdict[i, k] = by_energy(scene, run, kept, count)

    return compile_kernel(judge_all)
