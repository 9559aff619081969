"""What the histories ran with, and what the chart alone changes: sentences that compare variants of one method."""

import itertools
import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import xarray as xr

from symtop.measure.conservation import CONSTANTS
from symtop.methods.framework.registry import split_name
from symtop.model.charts import CHARTS
from symtop.report.sentences import counted, few
from symtop.runner.study import Table

from .tables import rounding

APART = 2.0  # times: two charts of one method differ by more than this, one of them above rounding


def without_repeats(histories: xr.Dataset) -> xr.Dataset:
    """The variants that are drawn and told of: no attitude chart beside an axis chart, whose numbers it repeats."""
    names = list(map(str, histories["variant"].values))
    repeats = {name.replace("[axis]", "[attitude]") for name in names if name.endswith("[axis]")}
    return histories.sel(variant=[name for name in names if name not in repeats])


def setting(histories: xr.Dataset) -> str:
    """Scene, horizon, and step or tolerance of all runs, in a sentence or two."""
    scenes, most = " and ".join(map(str, histories["scene"].values)), float(histories["nutations"].max())
    steps = histories["steps_a_nutation"].values
    step = f"{np.nanmax(steps):.0f} steps a nutation" if np.isfinite(steps).any() else ""
    own, common = _tolerances(histories)
    tolerance = (
        f"tolerance {' or '.join(map('{:.0e}'.format, sorted(set(common.values()))))} ({few(list(common), most=2)})"
    )
    parts = " or ".join(filter(None, [step, tolerance if common else ""]))
    text = f"Held fixed: the start, {most:.0f} nutations of {scenes}, {parts}."
    if own:
        keeps = "keeps its" if len(own) == 1 else "keep their"
        text += f" {few(list(own), most=2)} {keeps} default tolerance, the rounding of the arithmetic."
    return text


def _tolerances(histories: xr.Dataset) -> tuple[dict[str, float], dict[str, float]]:
    """The tolerances of variants that ran at their own default, and those that were given, by variant."""
    own: dict[str, float] = {}
    given: dict[str, float] = {}
    columns = (histories[name].max("scene").values for name in ("tolerance", "own_tolerance"))
    for name, value, default in zip(map(str, histories["variant"].values), *columns, strict=True):
        if math.isfinite(value):
            (own if default > 0.0 else given)[name] = float(value)
    return own, given


def used(cell: xr.Dataset) -> str:
    """Step or tolerance of one run, for a table."""
    steps, tolerance = float(cell["steps_a_nutation"]), float(cell["tolerance"])
    if math.isfinite(steps):
        return f"{steps:.2f} steps a nutation"
    if not math.isfinite(tolerance):
        return "nothing to set"
    return f"tolerance {tolerance:.1e}" + (" (its default: rounding)" if float(cell["own_tolerance"]) > 0.0 else "")


class Pair(NamedTuple):
    """One constant in two charts of one method: the largest change over all scenes in each."""

    constant: str
    worse: str  # name of a variant
    better: str
    change: float  # relative, of the worse variant
    other: float  # of the better one


def pairs(histories: xr.Dataset) -> Iterator[Pair]:
    """Every two charts of a method for every constant; runs that ended early are left out."""
    rows: dict[str, list[str]] = {}
    every = list(map(str, histories["variant"].values))
    for name, whole in zip(every, (histories["outcome"] == "ok").all("scene").values, strict=True):
        if whole:
            rows.setdefault(split_name(name)[0], []).append(name)
    for constant in CONSTANTS:
        values = histories[f"{constant}_largest"].max("scene", skipna=False).values
        largest = dict(zip(every, map(float, values), strict=True))
        for two in itertools.chain.from_iterable(itertools.combinations(names, 2) for names in rows.values()):
            better, worse = sorted(two, key=largest.__getitem__)
            yield Pair(constant, worse, better, largest[worse], largest[better])


def _apart(histories: xr.Dataset) -> list[Pair]:
    """Two charts of a method of which one keeps a constant much better than the other."""
    explained = {
        constant: max(rounding(histories.sel(scene=scene), constant) for scene in histories["scene"].values)
        for constant in CONSTANTS
    }
    return [one for one in pairs(histories) if one.change > max(explained[one.constant], APART * one.other)]


def charts_apart(histories: xr.Dataset) -> str:
    """How many methods keep a constant much better in one chart than in another; empty if none has two charts."""
    methods = {split_name(one.worse)[0] for one in pairs(histories)}
    if not methods:
        return ""
    apart = _apart(histories)
    differing = {split_name(one.worse)[0] for one in apart}
    if not apart:
        return f"The chart changes no constant more than {APART:g} times with {counted(len(methods), 'method')} in two."
    examples = [
        max(group, key=lambda one: (one.change / one.other if one.other else math.inf, one.change))
        for names in (CONSTANTS[:1], CONSTANTS[1:])
        if (group := [one for one in apart if one.constant in names])
    ]
    listed = ", and ".join(
        f"{one.constant} changes by {one.change:.1e} with {one.worse} and by {_size(one.other)} with {one.better}"
        for one in examples
    )
    return (
        f"The chart alone, same method, same step or tolerance: {listed}. It matters more than {APART:g}-fold for "
        f"{len(differing)} of {counted(len(methods), 'method')} that have two charts."
    )


def _size(value: float) -> str:
    return "exactly 0" if value == 0.0 else f"{value:.1e}"


def charts_table(histories: xr.Dataset) -> list[Table]:
    """Every method and constant for which the chart matters, with the largest change in each chart; none if none."""
    losing = dict.fromkeys((one.constant, split_name(one.worse)[0]) for one in _apart(histories))
    names = list(map(str, histories["variant"].values))
    lines = []
    for constant, method in losing:
        cells = []
        for chart in CHARTS:
            row = f"{method}[{chart}]"
            largest = histories[f"{constant}_largest"].max("scene")
            cells.append(_size(float(largest.sel(variant=row))) if row in names else "")
        lines.append([constant, method, *cells])
    title = f"The chart alone: largest relative change where two charts of a method differ more than {APART:g} times"
    return [Table(title, ["constant", "method", *CHARTS], lines)] if lines else []
