"""Which method is the fastest at the accuracy I need?

Two rounds. First every method walks down to each target on every scene and over both horizons, all runs kept
(`measure/work.py`). Then the methods of each scene are timed against each other, alone on the machine
(`timing_rounds.py`). `tables.py` lists the variables; `measure/ranking.py` answers questions from them.
"""

import xarray as xr

from symtop.methods.registry import integrators
from symtop.runner.grid import grid_scenes
from symtop.runner.study import Case, Study

from . import words
from .energy import COMPARED
from .figures import pictures
from .opening import charts, opening
from .tables import errors_and_work, run_times
from .timing_rounds import timed_runs

LEFT_OUT = {  # timing all methods on a scene takes ten seconds
    "goldstein is the same top, let go at another speed": ("goldstein-falling", "goldstein-rising"),
    "fast and steady are such tops": ("simo-wong", "kinon-betsch", "steady-fast"),
    "close to a pole, like bruls-cardona-arnold": ("grazing",),
    "unstable or nearly so: errors grow with the motion": ("sleeping", "sleeping-unstable", "separatrix"),
}
NOT_QUICK = {"left to the ordinary grid": (
    "cusp", "loop", "wave", "fast", "steady", "hairer-lubich-wanner", "bruls-cardona-arnold",
)}  # fmt: skip
PERIODS = ([10.0, 1000.0], [10.0, 100.0])  # in full, and quick
BUDGET = {"compiled": 1e6, "python": 2.5e4}  # force evaluations of one run
SOFTWARE = 4e4  # the same for arithmetic in software: quadruple precision costs 2 us an evaluation
EFFORT = (  # rounds and seconds of a batch, of all timed runs and of the contenders; in full, and quick
    {"first": (3, 0.005), "further": (5, 0.01)},
    {"first": (3, 0.002), "further": (4, 0.003)},
)


def cases(quick: bool) -> list[Case]:
    """Every method on every scene; python methods and quadruple precision within a smaller budget."""
    grid = []
    for name in grid_scenes(LEFT_OUT | (NOT_QUICK if quick else {})):
        for method in integrators().values():
            budget = (BUDGET[method.implementation] if method.speed == 1.0 else SOFTWARE) / (20.0 if quick else 1.0)
            grid.append(Case(name, method.name, {"periods": PERIODS[quick], "budget": budget}))
    return grid


def follow_up(data: xr.Dataset) -> list[Case]:
    """One case a scene that times its methods against each other."""
    grid = []
    periods = [float(value) for value in data["horizon"].values]
    for name in data["scene"].values:
        runs = timed_runs(data.sel(scene=name), COMPARED)
        names = list(dict.fromkeys(run.name for run in runs))
        settings = {"runs": [list(run) for run in runs], "integrators": names, "periods": periods}
        settings |= EFFORT[periods == PERIODS[True]]
        grid.append(Case(str(name), "together", settings, timed=True))
    return grid


def measure(case: Case) -> xr.Dataset:
    """Errors and work of one method on a scene, or seconds of all of them."""
    return run_times(case) if case.timed else errors_and_work(case)


STUDY = Study(
    name="work_precision",
    title="Work and precision",
    question="Which method is the fastest at the accuracy I need?",
    how_to_read=words.HOW_TO_READ,
    cases=cases,
    measure=measure,
    pictures=pictures,
    tables=words.tables,
    verdict=words.sentences,
    follow_up=follow_up,
    charts=charts,
    opening=opening,
    uses=lambda case: case.settings.get("integrators", [case.integrator]),
)
