"""Which method is the fastest at the accuracy I need?

Its variants are methods in one chart, every method in each chart that shows the axis, but not in the chart of the
attitude where it has one of the axis alone: that shows the same axis, for about the same time or more, as the
`reduction` study measures.

Two rounds. First every variant walks down to each target on every scene and over both horizons, all runs kept
(`measure/settings.py`). Then the variants of each scene are timed against each other
(`timing_rounds.py`). `tables.py` lists the variables; `leads.py` answers questions from them.
"""

import xarray as xr
from symtop_studies.grid import grid_scenes

from symtop.measure.settings import compared
from symtop.model.scenes import TAGS
from symtop.runner.study import Case, Study

from . import energy, words
from .figures import pictures
from .opening import charts, opening
from .tables import errors_and_work, run_times
from .timing_rounds import timed_runs

LEFT_OUT = {  # tags of scenes, with the reason; timing all methods on a scene takes ten seconds
    "repeats": "the same ranking shows",
    "steady": "no nutation: every target is wider than it",
    "unstable": "errors grow with the motion",
}
PERIODS = ([10.0, 1000.0], [10.0, 100.0])  # in full, and quick
BUDGET = {"compiled": 1e6, "python": 2.5e4}  # force evaluations of one run
SOFTWARE = 4e4  # the same for arithmetic in software: quadruple precision costs 2 us an evaluation
EFFORT = (  # rounds and seconds of a batch, of all timed runs and of the contenders; in full, and quick
    {"first": (3, 0.0025), "further": (6, 0.005)},
    {"first": (3, 0.001), "further": (5, 0.002)},
)


def cases(quick: bool) -> list[Case]:
    """Every variant on every scene; python methods and quadruple precision within a smaller budget."""
    grid = []
    for name in grid_scenes(TAGS if quick else LEFT_OUT):
        for method in compared("axis"):
            budget = (BUDGET[method.implementation] if method.speed == 1.0 else SOFTWARE) / (20.0 if quick else 1.0)
            grid.append(Case(name, method.name, {"periods": PERIODS[quick], "budget": budget}))
    return grid


def follow_up(data: xr.Dataset) -> list[Case]:
    """One case a scene that times its variants against each other."""
    grid = []
    energies = energy.timed(data)
    periods = [float(value) for value in data["horizon"].values]
    for name in data["scene"].values:
        runs = timed_runs(data.sel(scene=name), energies)
        names = list(dict.fromkeys(run.name for run in runs))
        settings = {"runs": [list(run) for run in runs], "integrators": names, "periods": periods}
        settings |= EFFORT[periods == PERIODS[True]]
        grid.append(Case(str(name), "together", settings, timed=True))
    return grid


def measure(case: Case) -> xr.Dataset:
    """Errors and work of one variant on a scene, or seconds of all of them."""
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
)
