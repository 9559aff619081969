"""Seconds of a force evaluation of every row, alone and among many tops at once, measured in interleaved rounds.

The study counts force evaluations, because a count is the same on every machine. What an evaluation costs is measured
here for each row: in the run of one top, bare, and in one call for `TOGETHER` tops where kernels have lanes and work on
several at once, or for `IN_TURN` where they have not. The ordinary tops of a stratum without poles stand for all: the
arithmetic of a step does not hang on the top, but for the iterations of implicit methods, which are counted.
"""

import functools
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import xarray as xr

from symtop.measure.timing import timings
from symtop.methods.calling import solve
from symtop.methods.fixed_step import inside
from symtop.methods.plan import Plan
from symtop.methods.registry import Integrator, integrator
from symtop.model.closed_forms import ClosedForms
from symtop.model.top import Angles, SymmetricTop
from symtop.run.population import NUMBERS, population

from .tops import FIRST

TOGETHER, IN_TURN = 256, 16  # tops of a call: side by side in lanes, or one after another
NUTATIONS, FINE = 20, 5  # of a timed run; FIRST 2^FINE steps a nutation
TOLERANCE = 1e-8
KIND = "slow"
KINDS = ("alone", "together")


@functools.cache
def _tops() -> tuple[Any, Any]:
    """Numbers (TOGETHER, 9) and nutation periods of the tops that are timed."""
    drawn = population(TOGETHER, seed=0, kind=KIND)
    numbers = np.stack([drawn[name].values for name in NUMBERS], axis=1)
    return numbers, np.array(ClosedForms(numbers).nutation_period)


def calls(row: Integrator) -> dict[str, tuple[Callable[[], object], float]]:
    """The timed calls of a row, "alone" and "together", each with its number of force evaluations."""
    (chart,), (numbers, period) = row.charts(), _tops()
    top, start = SymmetricTop(*numbers[0, :3].tolist()), Angles(*numbers[0, 3:].tolist())
    steps = round(NUTATIONS * FIRST * 2.0**FINE)
    solver, marks, h = inside(row.solvers[chart]), np.array([steps // 2, steps]), period * (NUTATIONS / steps)
    plan = Plan.steps(float(h[0]), marks)
    if not row.fixed_step:
        plan = Plan.until(np.array([0.5, 1.0]) * NUTATIONS * float(period[0]), TOLERANCE)
    if solver is None:
        run = solve(row, chart, top, start, plan)
        return {"alone": (lambda: solve(row, chart, top, start, plan), float(run.force_evaluations))}
    run, count = solver(top, start, plan), TOGETHER if solver.in_lanes else IN_TURN
    given = numbers[:count], h[:count], np.tile(marks, (count, 1))
    many = solver.many(*given)
    return {
        "alone": (lambda: solver(top, start, plan), float(run.force_evaluations)),
        "together": (lambda: solver.many(*given), float(solver.counts(many.steps, many.work)[0].sum())),
    }


def prices(names: Sequence[str], rounds: int, batch: float) -> xr.Dataset:
    """Seconds of a force evaluation: ``alone`` and ``together`` over ``integrator``, and ``spread`` of the samples.

    The smallest sample counts, and that of every other round by itself (``alone_half``, ``together_half``): what is
    said of a time must be so in both halves. A row whose tops share no loop has the price of a run alone in both.
    """
    each = {(name, kind): call for name in names for kind, call in calls(integrator(name)).items()}
    taken = dict(zip(each, timings([call for call, _ in each.values()], rounds, batch, warm=True), strict=True))
    columns: dict[str, Any] = {}
    for kind in KINDS:
        keys = [(name, kind if (name, kind) in each else "alone") for name in names]
        samples = [np.array(taken[key].samples[-rounds:]) / each[key][1] for key in keys]
        columns[kind] = "integrator", [one.min() for one in samples]
        columns[f"{kind}_half"] = ("integrator", "half"), [[one[::2].min(), one[1::2].min()] for one in samples]
    spread = [max(taken[key].spread for key in each if key[0] == name) for name in names]
    return xr.Dataset(columns | {"spread": ("integrator", spread)}, coords={"integrator": list(names)})
