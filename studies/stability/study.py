"""Where does each method fail, and how?"""

import math

import numpy as np
import xarray as xr

from symtop.methods.registry import Integrator, integrator, integrators
from symtop.model.scenes import added_scenes
from symtop.runner.study import Case, Picture, Study, Table

from . import atlas_figures
from . import atlas_words as atlas
from . import mechanism_words as mechanisms
from . import mechanisms as stability

FAMILY = "cusp"  # let go at theta = 0.8 with any spin
PERIODS = 12.0
SCANS = {
    "grazing": stability.map_table,
    "steady-fast": stability.resonance_table,
    "sleeping": stability.sleeping_table,
    "separatrix": stability.separatrix_table,
    "goldstein": stability.sampling_table,
}
# most settings and rows of a map where a run takes milliseconds: the map's "grid" says what was run
PYTHON, QUICK = (25, 24), (6, 4)
SLOW = {"taylor": (25, 120), "taylor-longdouble": (25, 120), "taylor-quad": (13, 20), "radau": (13, 12)}
LEAST_TOLERANCE = {"radau": 1e-6}  # a second a run at 1e-10


def thinned(values: np.ndarray, most: int) -> np.ndarray:
    """At most so many of the values, evenly."""
    return values[:: -(-values.size // most)]


def axes(method: Integrator, steps: np.ndarray, values: np.ndarray, quick: bool) -> tuple[list[float], list[float]]:
    """Settings and rows of a map: steps, tolerances from 1e-10 to 0.5, or nothing to turn; fewer for slow methods."""
    slow = SLOW.get(method.name, PYTHON if method.tier == "python" else (steps.size, values.size))
    most = tuple(map(min, slow, QUICK)) if quick and slow[0] < steps.size else slow
    parameters = thinned(values, most[1]).tolist()
    if method.knob == "step_size":
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
        grid.append(Case("grazing", method.name, settings | {"shown": 0.005 if method.knob == "step_size" else 1e-6}))
        if method.knob is not None:
            ladder = [0.2, 0.1, 0.05, 0.025] if method.knob == "step_size" else [1e-4, 1e-6, 1e-8, 1e-10]
            grid.append(Case("separatrix", method.name, {"ladder": ladder[: 1 if quick else 4]}))
        if method.knob == "step_size":
            grid.extend(Case(name, method.name, settings) for name, settings in fixed.items())
    return grid


def measure(case: Case) -> xr.Dataset:
    """The table of one mechanism for one integrator."""
    return SCANS.get(case.scene, stability.map_table)(case.scene, integrator(case.integrator), case.settings)


def families(data: xr.Dataset) -> list[str]:
    """The scenes that have a map over spin."""
    return [str(name) for name in data["scene"].values if str(name) not in SCANS]


def advice(data: xr.Dataset, family: str) -> dict[str, atlas.Advice]:
    """One line of the atlas for each integrator that has a map."""
    found = {str(name): atlas.advice(data, family, str(name)) for name in data["integrator"].values}
    return {name: line for name, line in found.items() if line is not None}


def pictures(data: xr.Dataset) -> list[Picture]:
    """The atlas, a page a family of methods, and the mechanisms."""
    drawn = []
    for family in families(data):
        lines = advice(data, family)
        sentences = {name: line.sentence for name, line in lines.items()}
        for page, names in atlas.pages(list(lines)).items():
            drawn.append(Picture(
                f"atlas-{family}-{page}", atlas_figures.atlas_page(data, family, names, sentences),
                f"What became of every run of {len(names)} integrators ({page.replace('-', ' ')}) over {PERIODS:g} "
                f"nutations. Left: {family} with its spin changed (r = 1 lets a top sleep upright) against the knob. "
                "Right: a single fall past a pole that the axis misses by 1.1 delta. " + atlas.page_conclusion(
                    data, family, names),
                f"Maps of outcomes for {', '.join(names)}.",
            ))  # fmt: skip
    if set(SCANS) & set(map(str, data["scene"].values)):
        drawn.append(Picture(
            "mechanisms", atlas_figures.mechanisms(data),
            "Six ways to fail, each measured alone. " + " ".join(mechanisms.poles(data) + mechanisms.horizons(data)),
            "Six panels: pole grazing, resonances, sleeping threshold, separatrix, sampling, solver tolerance.",
        ))  # fmt: skip
    return drawn


def tables(data: xr.Dataset) -> list[Table]:
    """The atlas in words, and the limits in numbers."""
    found = []
    for family in families(data):
        lines = [[line.integrator, line.use, line.fails] for line in advice(data, family).values()]
        found.append(Table(f"The atlas in words: {family}", ["integrator", "use it", "it fails"], lines))
    limits = mechanisms.limit_table(data)
    return [*found, Table(*limits)] if limits else found


def verdict(data: xr.Dataset) -> list[str]:
    """How far the methods go, how they fail, and whether each mechanism is what theory says."""
    return [s for family in families(data) for s in atlas.summary(data, family)] + mechanisms.mechanism_sentences(data)


STUDY = Study(
    name="stability",
    title="Stability",
    question="Where does each method fail, and how?",
    how_to_read=(
        "A map has one cell a run. To the right the step or the tolerance grows, upwards the spin, or the gap between "
        "path and pole. Green is accurate. Yellow looks healthy and is wrong: energy bounded, phase lost. Hatched "
        "cells lose energy, go where the true motion never goes, or ended early. Lines: where small nutations about "
        "a steady precession become unstable (solid), where they turn by a third of a turn a step (dashed)."
    ),
    cases=cases,
    measure=measure,
    pictures=pictures,
    tables=tables,
    verdict=verdict,
)
