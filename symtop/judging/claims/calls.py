"""What a step from elsewhere is like to call: the same twice, from any start, in double precision, backwards.

A one-step method is a function of its arguments. A call is repeated, then repeated after a step somewhere else: one
that differs keeps something, such as the last force, and its runs depend on the runs before. Where the loop over steps
is somebody else's, a run of n + m steps is compared with a run of n and one of m: a loop that sums its time and stops
too late or too soon is a step away, a method of several steps less. So are runs of many steps, n and m drawn at random,
whosever the loop is, once in a new process. The m steps begin at a state whose last bit is changed: what a step
remembers of a state, or of the steps that it has made, is not there. Then the first call is repeated.
"""

import contextlib
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from symtop.core.errors import SymtopError
from symtop.judging.adapters.adapter import Stepper, relative_gap
from symtop.judging.claims.subject import Subject
from symtop.judging.findings import Finding, Measured, inapplicable
from symtop.measure.step_map import generic_start, one_step
from symtop.model.scenes import Scene
from symtop.model.top import Angles

SHARE = 0.0137  # of a nutation: the step that is called
SAME = 1e-13  # relative: what threads may leave between two calls
AGAIN, NOISY = 16, 0.1  # calls that tell noise from what is kept, by how much of a difference they scatter
REPEATS, SECONDS = 250, 0.3  # calls with the same arguments, or as many as there is time for
NOTHING, STANDS = 1e-8, 1e-6  # a step of so little moves a state by less than this, relative
FAR = 200.0  # times the step: one that most methods do not survive
PARTS = [(20, 20), (64, 64), (100, 157), (311, 500), (1000, 1000)]  # steps of runs that are cut in two
REMEMBERED = 1e-9  # of a step: a last slope that is kept, and not computed anew, makes 1e-10 in 2000 steps
MISSED = 0.2  # of a step: a method of several steps starts anew with less
LATE = {False: (100_000, 3.0), True: (20_000, 0.5)}  # quick: steps before a late one, or as many as there are seconds
# late runs, steps after each, and what may be missed where our loop remembers nothing
LATER, AFTER, RECALLED = 4, 64, 1e-6
BLOWN_UP = 1e6  # times the start
GROWN = 10.0  # times what the motion makes of the last bit, as beside a separatrix, is nothing that was kept
ELSEWHERE = 0.3  # rad and units of the rates, from the start that is called


def measure(subject: Subject) -> list[Finding]:
    """The finding on the calls; refuted if a step is not a function of its arguments."""
    return [_calls(subject) if subject.method.fixed_step else inapplicable("calls", "it has no step of a given length")]


def _refuted(kind: str, why: str, value: float = math.nan, resolution: float = SAME) -> Finding:
    return Finding("calls", "a function", Measured(kind), "refuted", why, value, resolution)


def _calls(subject: Subject) -> Finding:
    stepper, scene = subject.stepper, subject.scene
    flat = {"phi": 0.0, "psi": 0.0}  # as a map of (theta, p_theta) shows them
    h, start = SHARE * scene.time_scale(), replace(generic_start(scene), **(flat if subject.in_plane else {}))

    def once(at: Angles, step: float) -> Any:
        state, run = stepper.from_start(scene.top, at, step)
        return run(state, 1)[0]

    stepper.renew()  # the step has been timed
    other = Angles(**{name: getattr(start, name) * (1.0 - ELSEWHERE) for name in Angles.__slots__} | flat)
    first = once(start, h)
    if not np.isfinite(first).all():
        kind = f"returns {'NaN' if np.isnan(first).any() else 'infinity'}"
        return _refuted(kind, f"a step of h = {h:.3g} {kind}", resolution=math.nan)
    if refuted := _repeated(stepper, lambda: relative_gap(first, once(start, h)), lambda step: once(other, step), h):
        return refuted
    step = one_step(subject.method, subject.method.charts()[0], scene, NOTHING * h)
    after = step.shown(step.run(start, step.h)), step.image(step.point(other))  # the second is at no pole, or refused
    own, gap = (step.gap(shown, step.at(at)) for shown, at in zip(after, (start, other), strict=True))
    if own > STANDS:
        why = f"a step of {step.h:.0e} moves by {own:.1e}: what it returns is no state, or no next one"
        return _refuted("jumps", why, own, STANDS)
    if gap > STANDS:
        why = f"it keeps something of its first start: from another one, a step of {step.h:.0e} moves by {gap:.1e}"
        return _refuted("keeps state", why, gap, STANDS)
    traits = {"changes its input": "it writes to its input"} if stepper.wrote else {}  # in two words, and in a clause
    traits |= {"single precision": "its numbers are those of single precision"} if subject.single else {}
    miss, why = _cut(stepper, scene, h / 10.0, PARTS) if stepper.own_loop else (0.0, "")
    if miss > MISSED:
        return _refuted("miscounts steps", why, miss, MISSED)
    traits |= {"remembers": why} if miss > REMEMBERED else {}
    miss, why = _cut(stepper, scene, h / 1.6, _late(subject))
    if miss > (most := MISSED if stepper.own_loop else RECALLED):
        why = f"it keeps something between calls: {why} (seed {subject.seed})"
        return _refuted("keeps state", why, miss, most)
    if (gap := relative_gap(first, once(start, h))) > SAME:
        why = f"it keeps something between calls: the first one, repeated, differs by {gap:.1e}"
        return _refuted("keeps state", why, gap)
    try:
        once(start, -h)
    except SymtopError as error:
        traits["forward only"] = str(error)
    why = "; ".join(["a call gives the same numbers again, and after a step elsewhere", *traits.values()])
    return Finding("calls", "", Measured(", ".join(traits) or "a function"), "measured", why, gap, SAME)


def _repeated(
    stepper: Stepper, again: Callable[[], float], elsewhere: Callable[[float], Any], h: float
) -> Finding | None:
    """The finding if the first call differs from the same one later, by `again`: it kept some, or calls are noisy."""
    began, most, count, gap = time.monotonic(), 2 if stepper.own_loop else REPEATS, 1, 0.0
    while count <= most and gap <= SAME and time.monotonic() - began < SECONDS:
        count, gap = count + 1, again()
    how = f"call {count} with the same arguments"
    if gap <= SAME:
        elsewhere(h)
        with contextlib.suppress(SymtopError):
            elsewhere(FAR * h)  # which may fail, and must not be remembered either
        how, gap = "after a step elsewhere the same call", again()
    if gap <= SAME:
        return None
    differences = [again() for _ in range(AGAIN)]
    if (noise := max(differences) - min(differences)) > NOISY * gap:
        return _refuted("not repeatable", f"calls with the same arguments differ by {noise:.1e}", noise)
    return _refuted("keeps state", f"it keeps something between calls: {how} differs by {gap:.1e}", gap)


def _cut(stepper: Stepper, scene: Scene, h: float, parts: Sequence[tuple[int, int]]) -> tuple[float, str]:
    """How far the last m steps of a run of n + m are from those asked again, in steps, and a clause; the largest."""
    start, run = stepper.from_start(scene.top, generic_start(scene), h)
    a_step, worst, words = _gap(run(start, 1)[0], start), 0.0, "after few steps"
    a_step = a_step if a_step > SAME * (size := np.abs(start).max()) else size  # it stays where it is
    for k, (n, m) in enumerate(parts):
        middle, end = run(start, n, n + m)
        if stepper.own_loop:
            end = run(start, n + m)[0]
        elif k == 0:
            stepper.renew()
        if not np.abs(middle).max() <= BLOWN_UP * np.abs(start).max():  # NaN too, which SciPy's classes refuse
            continue  # there the last bit alone moves a step further than any memory
        above, below = (run(np.nextafter(middle, side), m)[0] for side in (np.inf, -np.inf))
        gap = max(_gap(end, above) - GROWN * _gap(above, below), 0.0) / a_step
        words = words if np.isfinite(gap) or worst else "after a run that fails"
        if gap > worst:
            worst, words = gap, f"after {n} steps the next {m} are {gap:.1e} of a step from those asked again"
    return worst, words


def _late(subject: Subject) -> list[tuple[int, int]]:
    """Lengths of such runs, drawn; the last is the longest, so that a call after it comes after many steps."""
    draw, (most, seconds) = np.random.default_rng(subject.seed), LATE[subject.quick]
    longest = max(min(most, seconds / max(subject.seconds_a_step, 1e-9)), AFTER)
    shares = *np.sort(draw.uniform(0.2, 1.0, LATER - 1)).tolist(), 1.0
    return [(round(longest**one * draw.uniform(1.0, 1.1)), int(draw.integers(1, AFTER))) for one in shares]


def _gap(first: Any, second: Any) -> float:
    with np.errstate(invalid="ignore"):  # both infinite, of runs that blow up
        return float(np.max(np.abs(first - second)))
