"""What a stored dataset and a caption must say: which chart, which step or tolerance, which scene.

A comparison of ``rk4`` with ``strang`` changes two factors at once, method and chart, if a name does not say the chart;
and a number without its step or tolerance cannot be compared with another.
"""

import json
import re

import numpy as np
import pytest
import xarray as xr

from symtop.core import netcdf
from symtop.methods.framework.registry import integrators, methods, split_name
from symtop.model.scenes import scenes
from symtop.runner.grid import grid_variants

STUDIES = (
    "population", "truth", "convergence", "work_precision", "factors", "drift", "stability", "reduction", "claims",
    "notebook", "oscillators", "engines", "phase_diagram",
)  # fmt: skip
MUST_SAY = {
    "a step or a tolerance": r"\bsteps?\b|\btolerances?\b",
    "a scene": rf"\b(scenes?|oscillator|{'|'.join(map(re.escape, scenes()))})\b",
    "a chart": r"\bcharts?\b|\bangles\b|\[(angles|axis|attitude)\]",
}  # "no chart" and "no step" say why there is none


def lacking(caption: str) -> list[str]:
    """What a caption does not name."""
    return [what for what, pattern in MUST_SAY.items() if not re.search(pattern, caption)]


def without_a_chart(data: xr.Dataset) -> list[str]:
    """Names of the dimension ``integrator`` that leave open in which of several charts a method ran."""
    if "chart" in data.variables:
        return []
    charts = {name: method.charts() for name, method in integrators().items()}
    return [str(name) for name in data["variant"].values if len(charts.get(str(name), ())) > 1]


@pytest.mark.parametrize("study", STUDIES)
def test_every_stored_dataset_says_in_which_chart_a_method_ran(study, quick_results):
    groups = [
        group for group in netcdf.groups(netcdf.read_any(quick_results / f"{study}.nc")).values() if group.variables
    ]
    assert groups
    assert [name for group in groups for name in without_a_chart(group)] == []


@pytest.mark.parametrize("study", STUDIES)
def test_every_caption_names_step_scene_and_chart(study, quick_results):
    findings = json.loads((quick_results / f"{study}.json").read_text(encoding="utf-8"))
    assert findings["pictures"]
    assert {picture["file"]: lacking(picture["caption"]) for picture in findings["pictures"]} == {
        picture["file"]: [] for picture in findings["pictures"]
    }


@pytest.mark.parametrize(
    ("caption", "lacks"),
    [
        ("Energy error of rk4 over time: it drifts.", ["a step or a tolerance", "a scene", "a chart"]),
        ("Energy error over time on spheroid, 118 steps a nutation.", ["a chart"]),
        ("Energy error over time of rk4[axis], 118 steps a nutation.", ["a scene"]),
        ("Energy error over time of rk4[axis] on spheroid.", ["a step or a tolerance"]),
        ("Energy error over time of rk4[axis] on spheroid, 118 steps a nutation.", []),
        ("The cubic of goldstein, in closed form, which has no step and no chart.", []),
    ],
)
def test_a_caption_that_leaves_something_out_is_found(caption, lacks):
    assert lacking(caption) == lacks


@pytest.mark.parametrize(
    ("names", "found"),
    [
        (["rk4", "midpoint"], ["rk4"]),
        (["rk4[axis]", "strang"], ["strang"]),
        (["rk4[axis]", "rk4[angles]", "exact"], []),
    ],
)
def test_a_name_that_leaves_the_chart_open_is_found(names, found):
    data = xr.Dataset({"axis": ("variant", np.zeros(len(names)))}, coords={"variant": names})
    assert without_a_chart(data) == found
    assert without_a_chart(data.assign_coords(chart=["angles"])) == []


def test_the_rows_of_a_grid_are_every_method_and_no_chart_that_repeats_another():
    rows = [row.name for row in grid_variants("nutation")]
    assert {split_name(name)[0] for name in rows} == set(methods())
    assert {"rk4[angles]", "rk4[axis]", "strang[axis]", "exact[attitude]"} <= set(rows)
    assert "strang[attitude]" not in rows
    assert "strang[attitude]" in [row.name for row in grid_variants("nutation", attitude=True)]
