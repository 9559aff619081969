"""What makes the difference: method, formulation, language or call?

A factorial of the four at equal accuracy: the same error of the axis, over the same horizon, on the same scenes. Every
time is measured by five fresh processes, in interleaved rounds. A factor's effect is the ratio of two times that differ
in it alone.
"""

import math

import xarray as xr
from symtop_studies.grid import ALL_BUT_TWO, grid_scenes

from symtop.methods.framework.registry import integrators
from symtop.model.scenes import TAGS, scene
from symtop.runner.study import Case, Study

from . import facts, figures
from .cells import CALLS, COMPILED, KERNEL, LANGUAGES, QUICK
from .measures import Goal, factorial

GOALS = (
    (10.0, 1e-6, LANGUAGES, CALLS),
    (10.0, 1e-9, LANGUAGES, CALLS),
    (1000.0, 1e-6, (COMPILED,), (KERNEL,)),  # long enough for the overhead of a call to be negligible
)
ROUNDS = 5  # of all cells, in each process
PROCESSES = (5, 2)  # that are started for the times of a scene, in full and quick
BATCH = (0.0015, 0.001)  # seconds, in full and quick


def cases(quick: bool) -> list[Case]:
    """One case for each scene: times that are compared are measured together."""
    names = grid_scenes(TAGS if quick else ALL_BUT_TWO, lambda scene: math.isfinite(scene.nutation_period))
    settings = {
        "schemes": list(QUICK) if quick else None,
        "goals": [list(goal) for goal in (GOALS[:1] if quick else GOALS)],
        "rounds": ROUNDS,
        "batch": BATCH[quick],
        "processes": PROCESSES[quick],
    }
    return [Case(name, "together", settings) for name in names]


def measure(case: Case) -> xr.Dataset:
    """The factorial of one scene."""
    plan = case.settings
    goals = [Goal(float(span), float(target), tuple(rows), tuple(calls)) for span, target, rows, calls in plan["goals"]]
    return factorial(scene(case.scene), plan["schemes"], goals, plan["rounds"], plan["batch"], plan["processes"])


STUDY = Study(
    name="factors",
    title="Factors",
    question="What makes the difference: method, formulation, language or call?",
    cases=cases, measure=measure, facts=facts.facts, tables=facts.tables, pictures=figures.pictures,
    timed=True, uses=lambda _: list(integrators()),
)  # fmt: skip
