"""Does the verdict hold for tops that nobody picked?

A variant, a method in one chart, runs thousands of random tops from coarse settings to fine ones, and each top has a
cost for each target. A case is a variant and a horizon; a last one, alone on the machine, times a force evaluation of
each variant.
"""

import numpy as np
import xarray as xr

from symtop.methods.framework.registry import Integrator, integrator, variants
from symtop.run.ensemble.population import STRATA
from symtop.runner.study import Case, Study

from . import figures, listed, words
from .ladder import table
from .opening import opening
from .prices import PROCESSES, prices
from .tops import Tops, strata_of

SEED = 1
HORIZONS = {"short": 10.0, "long": 1000.0}  # nutations, by the group of cases
MEMBERS = {"short": 10_000, "long": 50}  # at 25 ms and 2 s of one core a top, all variants together
BUDGET = 1000.0  # force evaluations a nutation, of one run
QUICK = {"horizons": {"short": 10.0, "long": 100.0}, "members": {"short": 300, "long": 30}, "budget": 600.0}
GUARDED = {"short": 100, "long": 50}  # tops that the guard is asked about, which takes it 60 us and more a run
TOPS, PRICES = "tops", "prices"  # groups: what is known of the tops, and what an evaluation costs


def compiled_variants() -> list[Integrator]:
    """Every compiled variant with a step or a tolerance, but those that are left out."""
    left = {name for names in words.LEFT_OUT.values() for name in names}
    return [
        variant
        for variant in variants()
        if variant.implementation == "compiled" and variant.control is not None and variant.method not in left
    ]


def has_twin(variant: Integrator) -> bool:
    """Is it the attitude chart of a method that steps the same axis in the axis chart?"""
    return variant.charts() == ("attitude",) and "axis" in integrator(variant.method).charts()


def grid(*, quick: bool = False, full: bool = False) -> list[Case]:
    """Every variant over both horizons, the tops themselves, and the prices."""
    horizons, members = (QUICK["horizons"], QUICK["members"]) if quick else (HORIZONS, MEMBERS)
    members = dict.fromkeys(members, MEMBERS["short"]) if full else members
    names, cases = [variant.name for variant in compiled_variants()], []
    for group, nutations in horizons.items():
        drawn = {"members": members[group], "seed": SEED, "nutations": nutations}
        budget = (QUICK["budget"] if quick else BUDGET) * nutations
        guarded = min(GUARDED[group], 10) if quick else GUARDED[group]
        cases += [
            Case("population", name, drawn | {"budget": budget, "guarded": guarded}, group=group) for name in names
        ]
    drawn = {"members": members["short"], "seed": SEED, "nutations": horizons["short"]}
    cases.append(Case("population", "exact", drawn, group=TOPS))
    timing = {"integrators": names, "rounds": 3 if quick else 4, "batch": 0.001 if quick else 0.002}
    return [*cases, *(Case(process, "together", timing, timed=True, group=PRICES) for process in PROCESSES)]


def measure(case: Case) -> xr.Dataset:
    """The table of a variant, of the tops, or of the prices."""
    chosen = case.settings
    if case.group == PRICES:
        return prices(chosen["integrators"], chosen["rounds"], chosen["batch"])
    tops = Tops.drawn(chosen["members"], chosen["seed"], chosen["nutations"])
    strata = strata_of(chosen["members"], chosen["seed"])
    if case.group == TOPS:
        return about_tops(tops, strata)
    row = integrator(case.integrator)
    return table(
        row, tops, strata, len(STRATA), chosen["budget"], twin=has_twin(row), guarded=chosen["guarded"]
    ).assign(nutations=chosen["nutations"])


def about_tops(tops: Tops, strata: np.ndarray) -> xr.Dataset:
    """What the closed form knows of the tops: stratum, width of the nutation, regime, and the kinds of arithmetic."""
    return xr.Dataset(
        {
            "stratum_place": ("member", strata.astype(float)),
            "width": ("member", tops.width),
            "regime": (("member", "number"), tops.regime),
            "known": ("member", tops.known.astype(float)),
        },
        coords={"stratum": list(STRATA)},
    )


STUDY = Study(
    name="population",
    title="Populations",
    question="Does the verdict hold for tops that nobody picked?",
    how_to_read=words.HOW_TO_READ,
    cases=lambda quick: grid(quick=quick),
    measure=measure,
    pictures=figures.pictures,
    tables=listed.tables,
    verdict=words.sentences,
    opening=opening,
    full=lambda: grid(full=True),
)
