"""How well is the truth known?

Errors elsewhere are measured against a reference. Here the reference itself is measured: a Taylor integration in three
precisions and two charts, and the closed form in double, all against the closed form in 45 digits; and values that
others have published are computed anew.
"""

import xarray as xr

from symtop.model.scenes import added_scenes, scene
from symtop.run.reference import have_heyoka
from symtop.runner.study import Case, Study

from . import figures, words
from .sources import SOURCES
from .tables import source_errors

LONGEST = {"spheroid": 1e5, "goldstein": 1e4, "hairer-lubich-wanner": 1e4, "bruls-cardona-arnold": 1e3}  # horizons, s
AFFORDABLE = {"quadruple, attitude": 100.0, "closed form": 1e6}  # horizons, s: a limit of machine time, not of accuracy


def cases(quick: bool) -> list[Case]:
    """Every source on every scene, from t = 8 to as far as it is affordable."""
    grid = []
    for name, longest in {**LONGEST, **dict.fromkeys(added_scenes(), 1e3)}.items():
        for source in SOURCES if have_heyoka() else ("closed form",):
            furthest = AFFORDABLE.get(source, longest)
            horizons = [8.0] + [10.0**k for k in (range(2, 3) if quick else range(2, 7)) if 10.0**k <= furthest]
            grid.append(Case(name, source, {"horizons": horizons}))
    return grid


def measure(case: Case) -> xr.Dataset:
    """Error, bound and cost of one source."""
    return source_errors(scene(case.scene), case.integrator, case.settings["horizons"])


def verdict(data: xr.Dataset) -> list[str]:
    """Whether bounds hold, what the published values show, and how the closed form is known."""
    return [words.bounds(data), words.published(), *words.closed_form(data)]


STUDY = Study(
    name="truth",
    title="Truth",
    question="How well is the truth known?",
    how_to_read=words.HOW_TO_READ,
    cases=cases,
    measure=measure,
    pictures=figures.pictures,
    tables=words.tables,
    verdict=verdict,
)
