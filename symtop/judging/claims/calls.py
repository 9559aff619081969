"""The claim that a foreign step is a function of its arguments: same results, from any start, double, backwards.

A call is repeated, then repeated after a step somewhere else: if the result differs, the step keeps data, such as the
last force, and its runs depend on earlier runs. If the loop over steps is foreign, a run of n + m steps is compared
with runs of n and of m steps: a loop that sums its time and stops too late or too soon is off by a step, a multistep
method by less. Where nothing is missed, n = m of the most steps of one call are compared, too. The same is done with
long runs, n and m random, whatever the loop, once in a new process. The m steps begin at a state with its last bit
changed, so that nothing kept for it can be used. Then the first call is repeated. Calls that differ a little from the
first, or in the top alone, are made after it and again in the new process: a result kept for another call, found by
rounded numbers or without regard to f, differs there.
"""

import contextlib
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from symtop.core.errors import SymtopError
from symtop.judging.adapters.adapter import A_STEP, Stepper, relative_gap
from symtop.judging.adapters.external import MOST_STEPS
from symtop.judging.claims.subject import Subject
from symtop.judging.findings import Finding, Reading, inapplicable
from symtop.measure.step_map import generic_start, one_step
from symtop.model.scenes import Scene
from symtop.model.top import Angles, SymmetricTop

STEP_SHARE = 0.0137  # nutations: the step of a call
SAME_CALL = 1e-13  # relative difference of two calls that threads may cause
NOISE_CALLS, NOISE_SHARE = 16, 0.1  # to distinguish noise from kept data; scatter over a difference that is noise
REPEATS, REPEAT_SECONDS = 250, 0.3  # calls with the same arguments, up to this time
TINY_STEP, TINY_MOVE = 1e-8, 1e-6  # ratio of a tiny step to the usual one; largest relative move of a state by it
FEWEST_DIGITS = 14  # decimal digits of numbers that are not those of doubles, which have 17
FAILING_STEP = 200.0  # ratio to the usual step of one with which most methods fail
PART_LENGTHS = [(20, 20), (64, 64), (100, 157), (311, 500), (1000, 1000)]  # steps (n, m) of runs in two parts
DATA_GAP = 1e-9  # of a step: a larger gap shows kept data; a slope kept from the last step causes 1e-10 in 2000 steps
COUNT_GAP = 0.2  # of a step: a larger gap is a miscounted step; the new start of a multistep method causes less
LATE_RUNS = {False: (100_000, 3.0), True: (20_000, 0.5)}  # by quick: n of the longest late run, or its seconds
# number of late runs; largest m; largest gap, in steps, if the loop is symtop's
LATE_CALLS, MOST_AFTER, LATE_GAP = 4, 64, 1e-6
BLOWN_UP = 1e6  # times the start: a state that has blown up
GAP_GROWTH = 10.0  # gaps up to this times the effect of the last bit, as beside a separatrix, do not count
# relative changes of the start, of the step, which moves a state by less, and of mgl for calls beside the first one
CLOSE_START, LONGER_STEP, HEAVIER_TOP = 1e-12, 1e-9, 1.3
NEARBY_CALLS = (f" from a start {CLOSE_START:g} away", f" with a step {LONGER_STEP:g} longer", " on a heavier top", "")
OTHER_START = 0.3  # relative change of the start for a step somewhere else


def measure(subject: Subject) -> list[Finding]:
    """The finding on the claim "calls"; refuted if a step is not a function of its arguments."""
    return [_calls(subject) if subject.method.fixed_step else inapplicable("calls", "it has no step of a given length")]


def _refuted(kind: str, why: str, value: float = math.nan, resolution: float = SAME_CALL) -> Finding:
    return Finding("calls", "a function", Reading(kind), "refuted", why, value, resolution)


def _calls(subject: Subject) -> Finding:
    stepper, scene = subject.stepper, subject.scene
    flat = {"phi": 0.0, "psi": 0.0}  # a map of (theta, p_theta) has no others
    h, start = STEP_SHARE * scene.time_scale(), replace(generic_start(scene), **(flat if subject.in_plane else {}))

    def move(origin: Angles, step: float) -> Any:
        state, run = stepper.from_start(scene.top, origin, step)
        return run(state, 1)[0]

    stepper.renew()  # timing has called the step before
    other = Angles(**{name: getattr(start, name) * (1.0 - OTHER_START) for name in Angles.__slots__} | flat)
    first = move(start, h)
    if not np.isfinite(first).all():
        kind = f"returns {'NaN' if np.isnan(first).any() else 'infinity'}"
        return _refuted(kind, f"a step of h = {h:.3g} {kind}", resolution=math.nan)
    if refuted := _repeated(stepper, lambda: relative_gap(first, move(start, h)), lambda step: move(other, step), h):
        return refuted
    step = one_step(subject.method, subject.method.charts()[0], scene, TINY_STEP * h)
    after = step.shown(step.run(start, step.h)), step.image(step.point(other))  # SymtopError if the second is at a pole
    shift, gap = (step.gap(end, step.at(origin)) for end, origin in zip(after, (start, other), strict=True))
    if shift > TINY_MOVE:
        no_state = _few_digits(first) or "what it returns is no state, or no next one"
        why = f"a step of {step.h:.0e} moves by {shift:.1e}: {no_state}"
        return _refuted("jumps", why, shift, TINY_MOVE)
    if gap > TINY_MOVE:
        why = f"it keeps something of its first start: from another one, a step of {step.h:.0e} moves by {gap:.1e}"
        return _refuted("keeps state", why, gap, TINY_MOVE)
    traits = {"changes its input": "it writes to its input"} if stepper.wrote else {}  # short names, with clauses
    traits |= {"single precision": "it computes in single precision"} if subject.single else {}
    traits |= {"few digits": clause} if (clause := _few_digits(first)) else {}
    miss, why = _gap_in_parts(subject, h / 10.0) if stepper.own_loop else (0.0, "")
    if miss > COUNT_GAP:
        return _refuted("miscounts steps", why, miss, COUNT_GAP)
    traits |= {"remembers": why} if miss > DATA_GAP and "few digits" not in traits else {}
    traits |= {"stands still": f"a step of {step.h:.0e} moves nothing"} if shift == 0.0 and not subject.single else {}
    gap, refuted = _late_gap(subject, start, h, lambda: relative_gap(first, move(start, h)))
    if refuted:
        return refuted
    try:
        move(start, -h)
    except SymtopError as error:
        traits["forward only"] = str(error)
    why = "; ".join(["a call gives the same numbers again, and after a step elsewhere", *traits.values()])
    return Finding("calls", "", Reading(", ".join(traits) or "a function"), "measured", why, gap, SAME_CALL)


def _repeated(
    stepper: Stepper, repeat: Callable[[], float], other_step: Callable[[float], Any], h: float
) -> Finding | None:
    """A refuting finding if `repeat`, the relative gap of a repeated first call, is too large; None if it is not."""
    began, limit, count, gap = time.monotonic(), 2 if stepper.own_loop else REPEATS, 1, 0.0
    while count <= limit and gap <= SAME_CALL and time.monotonic() - began < REPEAT_SECONDS:
        count, gap = count + 1, repeat()
    call = f"call {count} with the same arguments"
    if gap <= SAME_CALL:
        other_step(h)
        with contextlib.suppress(SymtopError):
            other_step(FAILING_STEP * h)  # it may fail, which must not change later calls either
        call, gap = "after a step elsewhere the same call", repeat()
    if gap <= SAME_CALL:
        return None
    differences = [repeat() for _ in range(NOISE_CALLS)]
    if (noise := max(differences) - min(differences)) > NOISE_SHARE * gap:
        return _refuted("not repeatable", f"calls with the same arguments differ by {noise:.1e}", noise)
    return _refuted("keeps state", f"it keeps something between calls: {call} differs by {gap:.1e}", gap)


def _late_gap(subject: Subject, start: Angles, h: float, repeat: Callable[[], float]) -> tuple[float, Finding | None]:
    """`repeat` after late runs, the gap of the first call, and a refuting finding if they or calls beside it differ."""
    stepper, top = subject.stepper, subject.scene.top
    nearby = [] if stepper.own_loop else _nearby_ends(stepper, top, start, h)
    miss, why = _largest_gap(stepper, subject.scene, h / 1.6, _late_lengths(subject))
    keeps = "it keeps something between calls:"
    if miss > (limit := COUNT_GAP if stepper.own_loop else LATE_GAP):
        return miss, _refuted("keeps state", f"{keeps} {why} (seed {subject.seed})", miss, limit)
    ends = zip(nearby, _nearby_ends(stepper, top, start, h) if nearby else [], strict=True)
    gaps = [*(relative_gap(*pair) for pair in ends), repeat()]
    for change, gap in zip(NEARBY_CALLS[-len(gaps) :], gaps, strict=True):
        if gap > SAME_CALL:
            return gap, _refuted("keeps state", f"{keeps} the first one, repeated{change}, differs by {gap:.1e}", gap)
    return gaps[-1], None


def _nearby_ends(stepper: Stepper, top: SymmetricTop, start: Angles, h: float) -> list[Any]:
    """The ends of steps that differ from the first one as `NEARBY_CALLS` says; zeros where a step fails."""
    near = Angles(**{name: getattr(start, name) * (1.0 - CLOSE_START) for name in Angles.__slots__})
    trials = (top, near, h), (top, start, h * (1.0 + LONGER_STEP)), (replace(top, mgl=HEAVIER_TOP * top.mgl), start, h)
    state, ends = stepper.form.prepare(top, start)[1], []
    for trial_top, trial_start, step in trials:
        par, y = stepper.form.prepare(trial_top, trial_start)
        ends.append(np.zeros(len(y)))
        with contextlib.suppress(SymtopError):
            y = y if trial_start is near else state
            ends[-1] = np.nan_to_num(stepper.march(trial_top, par, np.array(y, dtype=float), step, A_STEP)[0])
    return ends


def _few_digits(state: Any) -> str:
    """A clause on numbers of at most `FEWEST_DIGITS` digits, as a program writes them; empty if one has more."""
    is_short = all(float(f"{number:.{FEWEST_DIGITS}g}") == number for number in state.tolist())
    return f"its numbers have at most {FEWEST_DIGITS} digits: it must write 17" * is_short


def _gap_in_parts(subject: Subject, h: float) -> tuple[float, str]:
    """The gap of short runs in two parts (`_largest_gap`); of halves of the longest call if these miss a step."""
    short = _largest_gap(subject.stepper, subject.scene, h, PART_LENGTHS)
    half = int(min(MOST_STEPS, LATE_RUNS[subject.quick][1] / max(subject.seconds_a_step, 1e-9) / 3.0)) // 2
    if short[0] > DATA_GAP or half <= PART_LENGTHS[-1][0]:  # the new start of a multistep method has more effect later
        return short
    long = _largest_gap(subject.stepper, subject.scene, h, [(half, half)])
    return long if long[0] > COUNT_GAP else short


def _largest_gap(stepper: Stepper, scene: Scene, h: float, parts: Sequence[tuple[int, int]]) -> tuple[float, str]:
    """The largest gap, in steps, between the end of a run of n + m steps and m steps made anew, and a clause on it."""
    start, run = stepper.from_start(scene.top, generic_start(scene), h)
    a_step, worst, words = _gap(run(start, 1)[0], start), 0.0, "after few steps"
    a_step = a_step if a_step > SAME_CALL * (size := np.abs(start).max()) else size  # the step does not move
    for k, (n, m) in enumerate(parts):
        middle, end = run(start, n, n + m)
        if stepper.own_loop:
            end = run(start, n + m)[0]
        elif k == 0:
            stepper.renew()
        if not np.abs(middle).max() <= BLOWN_UP * np.abs(start).max():  # or NaN, which SciPy's classes refuse
            continue  # there the change of the last bit has more effect than kept data
        above, below = (run(np.nextafter(middle, side), m)[0] for side in (np.inf, -np.inf))
        gap = max(_gap(end, above) - GAP_GROWTH * _gap(above, below), 0.0) / a_step
        words = words if np.isfinite(gap) or worst else "after a run that fails"
        if gap > worst:
            worst, words = gap, f"after {n} steps the next {m} are {gap:.1e} of a step from those asked again"
    return worst, words


def _late_lengths(subject: Subject) -> list[tuple[int, int]]:
    """Random lengths (n, m) of late runs; the last is the longest, so that the next call comes after many steps."""
    rng, (limit, seconds) = np.random.default_rng(subject.seed), LATE_RUNS[subject.quick]
    longest = max(min(limit, seconds / max(subject.seconds_a_step, 1e-9)), MOST_AFTER)
    shares = *np.sort(rng.uniform(0.2, 1.0, LATE_CALLS - 1)).tolist(), 1.0
    return [(round(longest**share * rng.uniform(1.0, 1.1)), int(rng.integers(1, MOST_AFTER))) for share in shares]


def _gap(first: Any, second: Any) -> float:
    with np.errstate(invalid="ignore"):  # both may be infinite, if runs blow up
        return float(np.max(np.abs(first - second)))
