"""Is every declared property of every integrator true?"""

import xarray as xr
from symtop_studies.grid import grid_scenes

from symtop.judging.battery import judge
from symtop.methods.framework.registry import integrator, integrators
from symtop.model.scenes import scene
from symtop.runner.study import Case, Study

from . import facts, figures, planted

LEFT_OUT = {  # tags of scenes, with the reason; all claims of all integrators take minutes on each scene
    "mild": "a defect shows less",
    "fast": "a defect shows less",
    "steady": "energy and momenta are kept by almost any step",
    "near_pole": "the claims try a pole in a scene of their own",
    "unstable": "errors grow with the motion",
}


def cases(quick: bool) -> list[Case]:
    """One case an integrator and scene, and those that make false claims."""
    names = grid_scenes(LEFT_OUT)
    every = [Case(name, method.name, {"quick": quick}) for name in names for method in integrators().values()]
    return every + planted.cases(quick)


def measure(case: Case) -> xr.Dataset:
    """The findings on one integrator, in every chart that it works in."""
    if case.integrator in planted.LIES:
        return planted.measured(case)
    return (
        judge(integrator(case.integrator), scene(case.scene), quick=case.settings["quick"])
        .dataset()
        .assign(chart="every")
    )


STUDY = Study(
    name="claims",
    title="Claims",
    question="Is every declared property of every integrator true?",
    cases=cases, measure=measure, facts=facts.facts, tables=facts.tables, pictures=figures.pictures,
)  # fmt: skip
