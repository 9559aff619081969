"""Which method is the cheapest at the accuracy I need, with what I have?

One ladder of settings (`ladder`), one model of cost, force evaluations times their price plus the call (`prices`), one
ranking with intervals (`ranking`). In the first round every variant, a method in one chart, climbs the ladder on the
tops of two populations and the named scenes (`tops`) over ten nutations, and five processes time an evaluation. In the
second the variants within `WITHIN` of the cheapest of their class climb it over a thousand, recommended settings are
run on other tops (`confirm`), variants whose price is noisy are timed again, and cells of the phase diagram that were
predicted are run (`far`).
"""

import numpy as np
import xarray as xr

from symtop.methods.framework.registry import Integrator, integrator, variants
from symtop.runner.study import Case, Study

from . import cells, facts, far, figures
from .confirm import confirm
from .ladder import table
from .prices import BATCHES, COMPANY, ENOUGH, PROCESSES, measured, prices
from .tops import NATURAL, named, tops_of

SEED = 1
SHORT, LONG, TOPS, PRICES, FAR, CHECKS = "short", "long", "tops", "prices", "far", "checks"  # groups of cases
SAFE = cells.CONFIRMED
# With twice as many tops the intervals of shares would be a tenth narrower and 5 more of 100 leads be called, with the
# same winners: most of the width is the error of the prices.
FULL = {
    SHORT: {"strata": 400, "natural": 400, "seed": SEED, "nutations": 10.0, "budget": 4e4, "guarded": 60},
    LONG: {"strata": 150, "natural": 100, "seed": SEED, "nutations": 1000.0, "budget": 5e5, "guarded": 0},
}
QUICK = {
    SHORT: {"strata": 120, "natural": 60, "seed": SEED, "nutations": 10.0, "budget": 6e3, "guarded": 8},
    LONG: {"strata": 24, "natural": 16, "seed": SEED, "nutations": 100.0, "budget": 3e4, "guarded": 0},
}
FAR_FULL, FAR_QUICK = ({"members": members, "levels": levels, "steps": steps, "budget": budget, "seed": SEED}
                       for members, levels, steps, budget in ((16, 13, 1.2e6, 2.5e6), (4, 10, 1e5, 2e5)))  # fmt: skip
CHECKED = {False: 6e7, True: 2e6}  # force evaluations of one run of a check, by quick


def compiled_variants() -> list[Integrator]:
    """Every compiled variant with a step or a tolerance, but those that are left out."""
    left = {name for names in facts.LEFT_OUT.values() for name in names}
    return [
        variant
        for variant in variants()
        if variant.implementation == "compiled" and variant.control is not None and variant.method not in left
    ]


def has_twin(variant: Integrator) -> bool:
    """Is it the attitude chart of a method that steps the same axis in the axis chart?"""
    return variant.charts() == ("attitude",) and "axis" in integrator(variant.method).charts()


def timing(names: list[str], batch: str, *, quick: bool) -> list[Case]:
    """One case for each process of a batch that times the variants."""
    settings = {"integrators": names, "rounds": 2 if quick else 4, "batch": 0.0005 if quick else 0.001}
    processes = range(ENOUGH if quick else PROCESSES)
    return [Case(f"{batch}-{k}", "together", settings, timed=True, group=PRICES) for k in processes]


def grid(*, quick: bool = False) -> list[Case]:
    """Every variant over ten nutations, the tops themselves, the prices, and the candidates of the phase diagram."""
    settings, names = QUICK if quick else FULL, [variant.name for variant in compiled_variants()]
    return [
        *(Case("tops", name, settings[SHORT], group=SHORT) for name in names),
        *(Case(span, "exact", settings[span], group=TOPS) for span in (SHORT, LONG)),
        *timing(names, BATCHES[0], quick=quick),
        *(Case("natural", name, FAR_QUICK if quick else FAR_FULL, group=FAR) for name in far.candidates()),
    ]


def follow_up(data: xr.DataTree) -> list[Case]:
    """Long runs of possible winners, recommended settings on other tops, noisy prices again, checks of the map."""
    quick = cells.members(data, SHORT) < FULL[SHORT]["natural"]
    plan = (QUICK if quick else FULL)[LONG]
    known = prices(data)
    quiet = [name for name in known.names if name not in known.marked]
    names = [*known.marked, *quiet[:: max(len(quiet) // COMPANY, 1)]] if known.marked else []
    short = (QUICK if quick else FULL)[SHORT]
    options = {"members": short["natural"], "seed": SEED + 1, "nutations": short["nutations"]}
    settings = cells.advised(data, [*facts.HAVE, *figures.FAMILIAR])
    return [
        *(Case("tops", name, plan, group=LONG) for name in cells.contenders(data)),
        *(Case(NATURAL, name, options | {"start": start}, group=SAFE) for name, start in settings.items()),
        *(timing(names, BATCHES[1], quick=quick) if names else []),
        *(Case("natural", f"check-{place:02d}", settings, group=CHECKS)
          for place, settings in enumerate(far.chosen(data, CHECKED[quick]) if FAR in data.children else ())),
    ]  # fmt: skip


def measure(case: Case) -> xr.Dataset:
    """The table of a variant, of its settings, of the tops, of the prices, or of the phase diagram."""
    settings = case.settings
    if case.group == PRICES:
        return measured(settings["integrators"], settings["rounds"], settings["batch"])
    if case.group == CHECKS:
        return far.check(settings)
    if case.group == FAR:
        tops = far.tops_of(settings["members"], settings["seed"])
        return far.ladder(integrator(case.integrator), tops, settings["levels"], settings["steps"], settings["budget"])
    if case.group == SAFE:
        return confirm(integrator(case.integrator), **settings)
    tops = tops_of(settings["strata"], settings["natural"], settings["seed"], settings["nutations"])
    if case.group == TOPS:
        return about_tops(tops).assign(nutations=settings["nutations"])
    row = integrator(case.integrator)
    return table(row, tops, settings["budget"], twin=has_twin(row), guarded=settings["guarded"]).assign(
        nutations=settings["nutations"]
    )


def about_tops(tops) -> xr.Dataset:  # type: ignore[no-untyped-def]
    """Numbers of the tops by the closed form: kind, width of the nutation and regime."""
    return xr.Dataset(
        {
            "kind_place": ("member", tops.kinds.astype(float)),
            "width": ("member", tops.width),
            "regime": (("member", "number"), tops.regime),
            "known": ("member", tops.known.astype(float)),
            "scene_name": ("named", np.array(list(named()))),
        }
    )


STUDY = Study(
    name="cost",
    title="Cost",
    question="Which method is the cheapest at the accuracy I need, with what I have?",
    cases=lambda quick: grid(quick=quick), measure=measure, follow_up=follow_up,
    facts=facts.facts, tables=facts.tables, pictures=figures.pictures,
)  # fmt: skip
