"""Is every declared property of every integrator true?"""

import xarray as xr
from symtop_studies.grid import grid_scenes

from symtop.judging.battery import judge
from symtop.methods.framework.registry import integrator, integrators
from symtop.model.charts import BODY
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
    """A case for each integrator and scene, for each integrator on a free body, and for each planted false claim."""
    methods = integrators().values()
    bodies = [Case(facts.FREE, method.name, {"quick": True}) for method in methods if BODY in method.solvers]
    tops = [Case(name, method.name, {"quick": quick}) for name in grid_scenes(LEFT_OUT) for method in methods]
    return bodies + tops + planted.cases(quick)


def measure(case: Case) -> xr.Dataset:
    """The findings on one integrator, in every chart that it works in."""
    if case.integrator in planted.LIES:
        return planted.measured(case)
    problem = scene(case.scene, bodies=True)
    data = judge(integrator(case.integrator), problem, quick=case.settings["quick"]).dataset().assign(chart="every")
    if problem.of_body:  # a body has other claims: put each in its place among all
        blank = {name: "" for name, column in data.data_vars.items() if column.dtype.kind == "U"}
        data = data.reindex(claim=facts.EVERY, fill_value=blank).assign(chart=BODY)
    return data


STUDY = Study(
    name="claims",
    title="Claims",
    question="Is every declared property of every integrator true?",
    cases=cases, measure=measure, facts=facts.facts, tables=facts.tables, pictures=figures.pictures,
)  # fmt: skip
