"""Where does each method fail, and how?"""

import math

import numpy as np
import xarray as xr

from symtop.measure.settings import smallest_charts
from symtop.methods.framework.loop import FixedStep
from symtop.methods.framework.registry import Integrator, integrator
from symtop.model.scenes import added_scenes
from symtop.runner.study import Case, Study

from . import facts, figures
from .measures import MECHANISMS, PERIODS, map_table

FAMILY = "cusp"  # let go at theta = 0.8 with any spin
NOT_SLEEPING = {  # variants left out of the mechanism "sleeping", by the reason
    "steps shrink towards the upright: millions in three samples, and the threshold of the motion": (
        "stormer-verlet-reversible[angles]",
    )
}
QUICK = (5, 3)  # settings and rows of a map of a slow method
FINER = 2.0  # cells of a map with runs in lanes over those of other maps: then each cell is a pixel of the picture


def solves_slowly(method: Integrator) -> bool:
    """Does it solve equations of a fixed order in plain Python? A run at a tolerance of 1e-10 then takes a second."""
    return method.implementation == "python" and method.explicit is False and method.order is not None


def finer(method: Integrator) -> float:
    """How many times as many settings and rows a map has whose runs go side by side in lanes."""
    solver = method.solvers[method.chart_for("axis")]
    in_lanes = isinstance(solver, FixedStep) and solver.in_lanes
    return math.sqrt(FINER) if in_lanes else 1.0


def axes(method: Integrator, steps: np.ndarray, values: np.ndarray, quick: bool) -> tuple[list[float], list[float]]:
    """Settings and rows of a map: steps, tolerances from 1e-10 to 0.5, or nothing to set.

    There are more for runs in lanes and fewer where a run takes milliseconds; a map's variable "grid" says how many.
    """
    factor = 1.0 if quick else finer(method)
    if factor > 1.0:
        steps, values = (np.geomspace(row[0], row[-1], round(factor * row.size)) for row in (steps, values))
    settings, rows = steps.size, values.size
    ordinary = settings, rows
    if method.implementation == "python":
        settings, rows = (13, 12) if solves_slowly(method) else (25, 24)
    elif method.adaptive and method.order is None:  # the order of a series grows with the accuracy
        settings, rows = (25, values.size) if method.speed == 1.0 else (13, 20)
    if quick and (settings, rows) != ordinary:
        settings, rows = min(settings, QUICK[0]), min(rows, QUICK[1])
        values = values[np.linspace(0, values.size - 1, rows).round().astype(int)]  # the first and the last among them
    parameters = values[:: -(-values.size // rows)].tolist()
    if method.fixed_step:
        return steps.tolist(), parameters
    if method.control is None:
        return [math.nan], parameters
    return np.geomspace(1e-6 if solves_slowly(method) else 1e-10, 0.5, settings).tolist(), parameters


def cases(quick: bool) -> list[Case]:
    """Maps of 160 steps by 96 spins and of 72 steps by 48 gaps for every variant; then the scans of single mechanisms.

    Methods in lanes have twice the cells, 226 by 136 and 102 by 68. An attitude chart beside an axis chart is left out:
    a map is judged by the axis, which both step alike.
    """
    steps = np.geomspace(0.005, 2.0, 24 if quick else 160)
    spins = np.geomspace(0.1, 30.0, 16 if quick else 96)
    passes, gaps = np.geomspace(5e-4, 0.1, 12 if quick else 72), np.geomspace(1e-6, 0.3, 12 if quick else 48)
    phases = np.linspace(0.5, 4.0, 8 if quick else 71).tolist()
    limits = np.geomspace(0.1, 30.0, 4 if quick else 14).tolist()
    tolerances = [math.inf, *(10.0 ** -np.arange(0.0 if quick else 1.0, 13.0, 4.0 if quick else 1.0)).tolist()]
    fixed = {"steady-fast": {"phases": phases, "steps": 1000 if quick else 3000},
             "sleeping": {"steps": [0.1, 0.5] if quick else [0.1, 0.25, 0.5, 0.75, 1.0]},
             "goldstein": {"steps": 100, "periods": 3, "step_size": 0.1, "tolerances": tolerances,
                           "solver_steps": 20_000 if quick else 100_000}}  # fmt: skip
    grid, left = [], {name for names in NOT_SLEEPING.values() for name in names}
    for name in [FAMILY, *added_scenes()]:  # the family holds the other tops, and a map of each method takes minutes
        coarser = 1 if quick or name == FAMILY else 3
        for method in smallest_charts("axis"):
            ladder, parameters = axes(method, steps[::coarser], spins[::coarser], quick)
            settings = {"parameters": parameters, "ladder": ladder, "periods": PERIODS, "limits": limits}
            grid.append(Case(name, method.name, settings))
    for method in smallest_charts("axis"):
        ladder, parameters = axes(method, passes, gaps, quick)
        settings = {"parameters": parameters, "ladder": ladder, "periods": 1.0}
        grid.append(Case("grazing", method.name, settings | {"shown": 0.005 if method.fixed_step else 1e-6}))
        if method.control is not None:
            ladder = [0.2, 0.1, 0.05, 0.025] if method.fixed_step else [1e-4, 1e-6, 1e-8, 1e-10]
            grid.append(Case("separatrix", method.name, {"ladder": ladder[: 1 if quick else 4]}))
        if method.fixed_step:
            grid.extend(
                Case(name, method.name, settings)
                for name, settings in fixed.items()
                if name != "sleeping" or method.name not in left
            )
    return grid


def measure(case: Case) -> xr.Dataset:
    """The table of one mechanism for one integrator; a map over spin if no mechanism belongs to the scene."""
    return MECHANISMS.get(case.scene, map_table)(case.scene, integrator(case.integrator), case.settings)


STUDY = Study(
    name="stability",
    title="Stability",
    question="Where does each method fail, and how?",
    cases=cases, measure=measure, facts=facts.facts, tables=facts.tables, pictures=figures.pictures,
)  # fmt: skip
