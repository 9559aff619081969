"""Random runs of every kind: tops, starts, methods, steps and tolerances from far too coarse to fine, all horizons."""

import math
import random
from typing import NamedTuple

import numpy as np

import symtop
from symtop.methods.framework.registry import integrators
from symtop.model import charts
from symtop.model.scenes import Scene, closed_form
from symtop.model.top import Angles, SymmetricTop
from symtop.run import guard
from symtop.run.simulation import make_plan

MOST_STEPS = 1.5e5
MOST_NUTATIONS = {"radau": 6.0, "taylor-quad": 30.0}  # so that no run takes seconds


class Trial(NamedTuple):
    """One run: what was done, what the guard said, and what came of it."""

    scene: Scene
    integrator: str
    control: dict
    nutations: float
    warning: str
    outcome: str
    error: float  # of the axis, rad, largest over the samples


def any_scene(draw: random.Random, name: str) -> Scene:
    """Fast tops from rest, tops almost upright, tops aimed at a pole, (almost) steady ones, and anything at all."""
    I1 = 10.0 ** draw.uniform(-0.7, 0.7)
    mgl = draw.choice([1.0, 1.0, 1.0, -1.0]) * 10.0 ** draw.uniform(-1.0, 1.2) * I1
    top, g = SymmetricTop(I1, draw.uniform(0.05, 2.0) * I1, mgl), math.sqrt(abs(mgl) / I1)
    kind = draw.randrange(6)
    if kind == 0:
        at = Angles(draw.uniform(0.05, 3.0), 1.0, 2.0, psi_dot=g * 10.0 ** draw.uniform(0.0, 1.7))
    elif kind == 1:
        at = Angles(10.0 ** draw.uniform(-3.0, -0.7), 0.3, 0.1, psi_dot=g * draw.uniform(0.5, 6.0) * I1 / top.I3)
    elif kind == 2:
        gap = draw.choice([-1.0, 1.0]) * 10.0 ** draw.uniform(-5.0, -0.5)
        theta, spin = draw.uniform(0.5, 2.5), g * draw.uniform(0.1, 3.0) * I1 / top.I3
        turn = top.I3 * spin * (1.0 + gap - math.cos(theta)) / (I1 * math.sin(theta) ** 2)
        at = Angles(theta, 0.2, 0.1, -g * draw.uniform(1.0, 4.0), turn, spin - turn * math.cos(theta))
    elif kind == 3:
        theta, spin = draw.uniform(0.2, 1.4), g * draw.uniform(3.0, 20.0) * I1 / top.I3
        weight = I1 * math.cos(theta)
        turn = 2.0 * mgl / (top.I3 * spin + math.sqrt(max((top.I3 * spin) ** 2 - 4.0 * weight * mgl, 0.0)))
        turn *= draw.choice([1.0, 1.1])
        at = Angles(theta, 0.2, 0.1, phi_dot=turn, psi_dot=spin - turn * math.cos(theta))
    else:
        rates = (g * draw.uniform(-2.0, 2.0), g * draw.uniform(-3.0, 3.0), g * draw.uniform(-8.0, 8.0))
        at = Angles(draw.uniform(0.05, 3.05), draw.uniform(-3.0, 3.0), draw.uniform(-3.0, 3.0), *rates)
    return Scene(name, top, at, 1.0)


def trial(draw: random.Random, name: str) -> Trial:
    """One run of one method: 1 to 500 steps a nutation or a tolerance of 0.1 to 1e-11, over 1 to 1000 nutations."""
    method = draw.choice([entry for entry in integrators().values() if entry.control is not None])
    where = any_scene(draw, name)
    period = where.nutation_period
    if not math.isfinite(period):
        period = 10.0 / math.sqrt(abs(where.top.mgl) / where.top.I1)
    nutations, steps, tolerance = (
        10.0 ** draw.uniform(0, 3),
        10.0 ** draw.uniform(0, 2.7),
        10.0 ** draw.uniform(-11, -1),
    )
    if method.control == "step_size":
        control = {"step_size": period / steps}
        nutations = max(min(nutations, MOST_STEPS / steps), 3.0 / steps)
    else:
        slow = 60.0 if method.implementation == "python" else 1000.0
        nutations = min(nutations, MOST_NUTATIONS.get(method.name, slow))
        control = {"tolerance": max(tolerance, method.least_tolerance, 1e-6 if method.name == "radau" else 0.0)}
    horizon = nutations * period
    observe = draw.choice(["axis", "attitude"])
    plan, _ = make_plan(where, method, **control, horizon=horizon, samples=501)
    said = guard.warning(where, method, method.chart_for(observe), plan)
    run = symtop.simulate(where, method, horizon=horizon, observe=observe, guard=False, **control)
    with np.errstate(all="ignore"):
        error = charts.axis_distance(run["axis"].values, closed_form(where).axis(run["time"].values))
    largest = float(np.max(error)) if run.attrs["outcome"] == "ok" else math.inf
    return Trial(where, method.name, control, nutations, said, run.attrs["outcome"], largest)
