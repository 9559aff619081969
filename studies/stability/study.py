"""Where does each method fail, and how?"""

import math

import numpy as np
import xarray as xr

from symtop.methods.registry import Integrator, integrator, integrators
from symtop.model.scenes import added_scenes
from symtop.runner.study import Case, Study

from . import words
from .figures import pictures
from .tables import MECHANISMS, PERIODS, map_table

FAMILY = "cusp"  # let go at theta = 0.8 with any spin
# most settings and rows of a map where a run takes milliseconds: the map's "grid" says what was run
PYTHON, QUICK = (25, 24), (6, 4)
SLOW = {"taylor": (25, 120), "taylor-longdouble": (25, 120), "taylor-quad": (13, 20), "radau": (13, 12)}
LEAST_TOLERANCE = {"radau": 1e-6}  # a second a run at 1e-10


def axes(method: Integrator, steps: np.ndarray, values: np.ndarray, quick: bool) -> tuple[list[float], list[float]]:
    """Settings and rows of a map: steps, tolerances from 1e-10 to 0.5, or nothing to set; fewer for slow methods."""
    slow = SLOW.get(method.name, PYTHON if method.tier == "python" else (steps.size, values.size))
    most = tuple(map(min, slow, QUICK)) if quick and slow[0] < steps.size else slow
    parameters = values[:: -(-values.size // most[1])].tolist()
    if method.fixed_step:
        return steps.tolist(), parameters
    if method.knob is None:
        return [math.nan], parameters
    return np.geomspace(LEAST_TOLERANCE.get(method.name, 1e-10), 0.5, most[0]).tolist(), parameters


def cases(quick: bool) -> list[Case]:
    """Maps of 200 steps by 120 spins and of 72 steps by 48 gaps; then the scans of single mechanisms."""
    steps = np.geomspace(0.005, 2.0, 24 if quick else 200)
    spins = np.geomspace(0.1, 30.0, 16 if quick else 120)
    passes, gaps = np.geomspace(5e-4, 0.1, 12 if quick else 72), np.geomspace(1e-6, 0.3, 12 if quick else 48)
    phases = np.linspace(0.5, 4.0, 15 if quick else 71).tolist()
    limits = np.geomspace(0.1, 30.0, 4 if quick else 14).tolist()
    tolerances = [math.inf, *(10.0 ** -np.arange(0.0 if quick else 1.0, 13.0, 4.0 if quick else 1.0)).tolist()]
    fixed = {"steady-fast": {"phases": phases, "steps": 1000 if quick else 3000},
             "sleeping": {"steps": [0.1, 0.5] if quick else [0.1, 0.25, 0.5, 0.75, 1.0]},
             "goldstein": {"steps": 100, "periods": 3, "step_size": 0.1, "tolerances": tolerances,
                           "solver_steps": 20_000 if quick else 100_000}}  # fmt: skip
    grid = []
    for name in [FAMILY, *added_scenes()]:
        coarser = 1 if quick or name == FAMILY else 3
        for method in integrators().values():
            ladder, parameters = axes(method, steps[::coarser], spins[::coarser], quick)
            settings = {"parameters": parameters, "ladder": ladder, "periods": PERIODS, "limits": limits}
            grid.append(Case(name, method.name, settings))
    for method in integrators().values():
        ladder, parameters = axes(method, passes, gaps, quick)
        settings = {"parameters": parameters, "ladder": ladder, "periods": 1.0}
        grid.append(Case("grazing", method.name, settings | {"shown": 0.005 if method.fixed_step else 1e-6}))
        if method.knob is not None:
            ladder = [0.2, 0.1, 0.05, 0.025] if method.fixed_step else [1e-4, 1e-6, 1e-8, 1e-10]
            grid.append(Case("separatrix", method.name, {"ladder": ladder[: 1 if quick else 4]}))
        if method.fixed_step:
            grid.extend(Case(name, method.name, settings) for name, settings in fixed.items())
    return grid


def measure(case: Case) -> xr.Dataset:
    """The table of one mechanism for one integrator; a map over spin where the scene is that of no mechanism."""
    return MECHANISMS.get(case.scene, map_table)(case.scene, integrator(case.integrator), case.settings)


STUDY = Study(
    name="stability",
    title="Stability",
    question="Where does each method fail, and how?",
    how_to_read=words.HOW_TO_READ,
    cases=cases,
    measure=measure,
    pictures=pictures,
    tables=words.tables,
    verdict=words.sentences,
)
