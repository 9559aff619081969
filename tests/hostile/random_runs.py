"""Random guarded runs: every method in every chart on sixteen kinds of scenes, and what the guard had said of them.

python -m tests.hostile.random_runs 20000 [--seed 3]

Run k is drawn from a seed of its own and can be run alone (`outcome_of`). A run is wrong if it ends `ok` and its axis
was ever further than `WRONG` from the closed form; it is silent if the guard had said nothing. A run is right below
`RIGHT`, and takes too long from `LONGEST` on.
"""

import argparse
import collections
import math
import multiprocessing
import random
import time
import warnings
from typing import NamedTuple

import numpy as np
from pebble import ProcessPool

import symtop
from symtop.methods.framework.registry import integrators
from symtop.model import charts
from symtop.model.scenes import Scene, closed_form
from symtop.model.top import Angles, SymmetricTop

WRONG, RIGHT = 0.05, 1e-3  # rad
NEWER = (  # methods that came after the draws whose rates tests bound
    *("strang-drift-first", "dprkn8", "extrapolation", "adams", "tsit5", "tsit5-fixed", "dop853-compiled"),
    *("dop853-compiled-fixed", "vern9", "vern9-fixed", "series-general", "series-general-adaptive", "five-rotations"),
    *("spiral", "rkmk-se3-5", "rkmk-se3-8", "dop853-projected", "vern9-projected"),
    *("galerkin-gauss-4", "galerkin-gauss-6", "galerkin-gauss-8", "galerkin-gauss-12", "euler", "symplectic-euler"),
)
LATER = ("srkn-19-8", "stormer-verlet-reversible", *NEWER)  # and after the runs which tests name
LONGEST, PATIENCE = 60.0, 240.0  # s of processor time, and of the clock on a busy machine
MOST_STEPS = 1.5e5
SEED = 20_000


class Outcome(NamedTuple):
    """One run: what was done, what the guard said, what came of it, and what it took."""

    k: int
    kind: str
    top: tuple[float, ...]  # I1, I3, mgl
    start: tuple[float, ...]  # theta, phi, psi and their rates
    integrator: str
    observe: str
    control: dict[str, float]
    horizon: float
    nutations: float
    warning: str
    outcome: str
    error: float  # of the axis, rad, largest over the samples
    seconds: float  # of processor time

    @property
    def wrong(self) -> bool:
        """It ended well, and its axis was somewhere else."""
        return self.outcome == "ok" and not self.error <= WRONG

    @property
    def right(self) -> bool:
        """It ended well, and its axis was where it should be."""
        return self.outcome == "ok" and self.error < RIGHT

    def scene(self) -> Scene:
        """What was run."""
        return Scene(f"{self.kind}-{self.k}", SymmetricTop(*self.top), Angles(*self.start), self.horizon)


def _top(draw, ratio=None, weight=None):
    I1 = 10.0 ** draw.uniform(-0.7, 0.7)
    mgl = weight or draw.choice([1.0, 1.0, 1.0, -1.0]) * 10.0 ** draw.uniform(-1.0, 1.2)
    return SymmetricTop(I1, I1 * (ratio or draw.uniform(0.05, 2.0)), mgl * I1)


def _swing(top):
    """The frequency of small swings without spin."""
    return math.sqrt(abs(top.mgl) / top.I1)


def _turns(draw):
    return draw.uniform(-3.0, 3.0), draw.uniform(-3.0, 3.0)


def _rates(draw, top):
    g = _swing(top)
    return g * draw.uniform(-2.0, 2.0), g * draw.uniform(-3.0, 3.0), g * draw.uniform(-8.0, 8.0)


def _any_start(draw, top):
    return top, Angles(draw.uniform(0.05, 3.05), *_turns(draw), *_rates(draw, top))


def _fast(draw, low, high):
    top = _top(draw)
    spin = _swing(top) * 10.0 ** draw.uniform(low, high)
    return top, Angles(draw.uniform(0.05, 3.0), *_turns(draw), psi_dot=spin)


def _beside_pole(draw, top, spins, decades, pole=0.0):
    """Let go beside a pole; a top of positive weight sleeps upright from a spin of 2 on."""
    spin, tilt = _swing(top) * draw.uniform(*spins) * top.I1 / top.I3, 10.0 ** draw.uniform(*decades)
    return top, Angles(abs(pole - tilt), *_turns(draw), psi_dot=spin)


def _through_upright(draw, spin, energy):
    """Through the upright position with almost the energy of standing there."""
    top = _top(draw, weight=10.0 ** draw.uniform(-1.0, 1.2))
    theta, p = draw.uniform(0.3, 2.9), spin * 2.0 * top.I1 * _swing(top)
    turn = p / (top.I1 * (1.0 + math.cos(theta)))
    height = p * turn * (1.0 - math.cos(theta)) / 2.0 + top.mgl * math.cos(theta)
    theta_dot = math.sqrt(max(2.0 * (top.mgl * (1.0 + energy) - height) / top.I1, 0.0))
    init = Angles(theta, *_turns(draw), draw.choice([-1.0, 1.0]) * theta_dot, turn, p / top.I3 - turn * math.cos(theta))
    return top, init


def _excess(draw, high):
    return draw.choice([-1.0, 1.0]) * 10.0 ** draw.uniform(-12.0, high)


def _aimed(draw):
    """At one of the poles, past it by a little."""
    top, lower = _top(draw), draw.random() < 0.3
    g, gap = _swing(top), draw.choice([-1.0, 1.0]) * 10.0 ** draw.uniform(-9.0, -0.5)
    theta, spin = draw.uniform(0.5, 2.5), g * draw.uniform(0.1, 3.0) * top.I1 / top.I3
    turn = top.I3 * spin * ((-1.0 if lower else 1.0) + gap - math.cos(theta)) / (top.I1 * math.sin(theta) ** 2)
    rate = g * draw.uniform(1.0, 4.0) * (1.0 if lower else -1.0)
    return top, Angles(theta, *_turns(draw), rate, turn, spin - turn * math.cos(theta))


def _steady(draw):
    top = _top(draw, weight=10.0 ** draw.uniform(-1.0, 1.2))
    theta, spin = draw.uniform(0.2, 1.4), _swing(top) * draw.uniform(3.0, 20.0) * top.I1 / top.I3
    weight = top.I1 * math.cos(theta)
    turn = 2.0 * top.mgl / (top.I3 * spin + math.sqrt(max((top.I3 * spin) ** 2 - 4.0 * weight * top.mgl, 0.0)))
    turn *= draw.choice([1.0, 1.0 + 10.0 ** draw.uniform(-8.0, -1.0), 1.1])
    return top, Angles(theta, *_turns(draw), phi_dot=turn, psi_dot=spin - turn * math.cos(theta))


def _scaled(draw, decades):
    """Any motion in units of inertia and of time, each up to so many decades larger or smaller."""
    top, start = _any_start(draw, _top(draw))
    mass, clock = 10.0 ** draw.uniform(-decades, decades), 10.0 ** draw.uniform(-decades, decades)
    rates = (rate / clock for rate in (start.theta_dot, start.phi_dot, start.psi_dot))
    scaled_top = SymmetricTop(top.I1 * mass, top.I3 * mass, top.mgl * mass / clock**2)
    return scaled_top, Angles(start.theta, start.phi, start.psi, *rates)


KINDS = {
    "anything": lambda draw: _any_start(draw, _top(draw)), "ball": lambda draw: _any_start(draw, _top(draw, 1.0)),
    "disc": lambda draw: _any_start(draw, _top(draw, 2.0)),
    "needle": lambda draw: _any_start(draw, _top(draw, 10.0 ** draw.uniform(-12.0, -2.0))),
    "weightless": lambda draw: _any_start(draw, _top(draw, weight=10.0 ** draw.uniform(-12.0, -3.0))),
    "heavy": lambda draw: _any_start(draw, _top(draw, weight=10.0 ** draw.uniform(2.0, 6.0))),
    "units": lambda draw: _scaled(draw, 9.0), "fast": lambda draw: _fast(draw, 0.0, 1.7),
    "very-fast": lambda draw: _fast(draw, 2.0, 6.0),
    "upright": lambda draw: _beside_pole(draw, _top(draw), (0.5, 6.0), (-3.0, -0.7)),
    "sleeper": lambda draw: _beside_pole(  # mostly below the spin from which it sleeps
        draw, _top(draw, weight=10.0 ** draw.uniform(-1.0, 1.2)), (0.2, 2.2), (-8.0, -2.0)),
    "separatrix": lambda draw: _through_upright(draw, draw.uniform(0.0, 0.99), _excess(draw, -1.0)),
    "pendulum": lambda draw: _through_upright(draw, 0.0, _excess(draw, 0.0)), "aimed": _aimed,
    # at theta = pi a top of positive weight hangs, and one of negative weight stands
    "hanging": lambda draw: _beside_pole(draw, _top(draw), (0.0, 6.0), (-9.0, -1.0), math.pi), "steady": _steady,
}  # fmt: skip


def _at_pole(draw):
    """From a pole itself, mostly with a rate that leaves it."""
    top, start = _any_start(draw, _top(draw))
    rate = draw.choice([0.0, 1.0, 1.0, 1.0]) * start.theta_dot
    return top, Angles(draw.choice([0.0, math.pi]), start.phi, start.psi, rate, start.phi_dot, start.psi_dot)


HOSTILE = {  # drawn from by seeds below zero
    "near-sphere": lambda draw: _any_start(draw, _top(draw, 1.0 + _excess(draw, -1.0))),
    "flat-or-thin": lambda draw: _any_start(draw, _top(draw, draw.choice([10.0 ** draw.uniform(-3.0, 0.0), 1.999]))),
    "scaled": lambda draw: _scaled(draw, 12.0), "at-pole": _at_pole,
}  # fmt: skip


def draw_run(k: int, seed: int = SEED, *, without: tuple[str, ...] = LATER) -> Outcome:
    """Run k, known to tests by number `without` later methods: 1 to 500 steps a nutation or a tolerance, to 1000."""
    draw = random.Random(f"{seed}/{k}")
    kinds = KINDS if seed >= 0 else HOSTILE
    kind = draw.choice([*kinds])
    top, start = kinds[kind](draw)
    methods = [entry for entry in integrators().values() if entry.control is not None and entry.name not in without]
    method, period = draw.choice(methods), Scene("drawn", top, start, 1.0).nutation_period
    if not math.isfinite(period):
        period = 10.0 / _swing(top)
    nutations, steps = 10.0 ** draw.uniform(0.0, 3.0), 10.0 ** draw.uniform(0.0, 2.7)
    tolerance = 10.0 ** draw.uniform(-13.0, -1.0)
    if method.control == "step_size":
        control = {"step_size": period / steps}
        limit = MOST_STEPS if method.implementation == "compiled" else MOST_STEPS / 300.0
        nutations = max(min(nutations, limit / steps), 3.0 / steps)
    else:
        control = {"tolerance": max(tolerance, method.least_tolerance)}
        if method.implementation == "python" and draw.random() < 0.98:
            nutations = min(nutations, 10.0 ** draw.uniform(0.0, 1.5))
        if method.name in ("radau", "taylor-quad"):
            nutations = min(nutations, 10.0 ** draw.uniform(0.0, 1.0))
    numbers = top.I1, top.I3, top.mgl
    angles = start.theta, start.phi, start.psi, start.theta_dot, start.phi_dot, start.psi_dot
    observe, horizon = draw.choice(["nutation", "axis", "attitude"]), nutations * period
    return Outcome(k, kind, numbers, angles, method.name, observe, control, horizon, nutations, "", "", math.nan, 0.0)


def outcome_of(k: int, seed: int = SEED, *, without: tuple[str, ...] = LATER) -> Outcome:
    """Draw run k and do it; a run that is refused has the outcome `refused` and the sentence for a warning."""
    draft, messages = draw_run(k, seed, without=without), []
    start = time.process_time()
    try:
        scene, controls = draft.scene(), {**draft.control, "observe": draft.observe, "samples": 501}
        try:
            run = symtop.simulate(scene, draft.integrator, guard=messages.append, **controls)
        except symtop.SymtopError as error:
            if "does not show" not in str(error):
                raise
            run = symtop.simulate(scene, draft.integrator, guard=messages.append, **{**controls, "observe": "axis"})
    except symtop.SymtopError as error:
        return draft._replace(outcome="refused", warning=str(error), seconds=time.process_time() - start)
    seconds = time.process_time() - start
    with np.errstate(all="ignore"):
        error = charts.axis_distance(run["axis"].values, closed_form(scene).axis(run["time"].values))
    outcome = run.attrs["outcome"]
    largest = float(np.max(error)) if outcome == "ok" else math.inf
    return draft._replace(warning=" ".join(messages), outcome=outcome, error=largest, seconds=seconds)


def summary(runs: list[Outcome]) -> str:
    """The figures of so many runs, and each run that should not be."""
    wrong, right = [run for run in runs if run.wrong], [run for run in runs if run.right]
    silent, false = [run for run in wrong if not run.warning], [run for run in right if run.warning]
    failures = [run for run in runs if run.outcome not in ("ok", "refused", "endless", "crashed")]
    sudden = [run for run in failures if not run.warning]
    odd = [run for run in runs if run.outcome in ("endless", "crashed") or run.seconds >= LONGEST]
    lines = [
        f"{len(runs)} runs: {dict(collections.Counter(run.outcome for run in runs))}",
        f"{len(wrong)} wrong by more than {WRONG} rad, of them silent: {len(silent)}",
        f"{len(right)} right to {RIGHT} rad, of them warned of: {len(false)}",
        f"{len(failures)} ended early, of them not announced: {len(sudden)}",
    ]
    return "\n".join([*lines, *map(repr, silent), *map(repr, sudden), *map(repr, odd)])


def run_all(count: int, seed: int = SEED, without: tuple[str, ...] = ()) -> list[Outcome]:
    """Do the first `count` runs in a process apart, and in a new one after a run that does not end or that ends it."""
    outcomes, spawn = [], multiprocessing.get_context("spawn")
    initargs = "ignore", symtop.SymtopWarning
    with ProcessPool(1, context=spawn, initializer=warnings.simplefilter, initargs=initargs) as pool:
        tasks = [pool.schedule(outcome_of, (k, seed), {"without": without}, timeout=PATIENCE) for k in range(count)]
        for k, task in enumerate(tasks):
            try:
                outcomes.append(task.result())
            except Exception as error:  # noqa: BLE001
                outcome = "endless" if isinstance(error, TimeoutError) else "crashed"
                outcomes.append(draw_run(k, seed, without=without)._replace(outcome=outcome, warning=repr(error)))
    return outcomes


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("count", type=int)
    parser.add_argument("--seed", type=int, default=SEED, help="below zero: hostile kinds of scenes")
    arguments = parser.parse_args()
    print(summary(run_all(arguments.count, arguments.seed)))
