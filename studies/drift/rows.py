"""What the histories ran with, and what the chart alone changes: sentences that compare rows of one method."""

import itertools
import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import xarray as xr

from symtop.measure.conservation import CONSTANTS
from symtop.methods.registry import split_name

from .tables import rounding

APART = 2.0  # times: two charts of one method differ by more than this, one of them above rounding


def without_repeats(histories: xr.Dataset) -> xr.Dataset:
    """The rows that are drawn and told of: no attitude chart beside an axis chart, whose numbers it repeats."""
    names = list(map(str, histories["integrator"].values))
    repeats = {name.replace("[axis]", "[attitude]") for name in names if name.endswith("[axis]")}
    return histories.sel(integrator=[name for name in names if name not in repeats])


def setting(histories: xr.Dataset) -> str:
    """Scene, horizon, and step or tolerance of all runs, in a sentence or two."""
    scenes, most = ", ".join(map(str, histories["scene"].values)), float(histories["nutations"].max())
    steps = histories["steps_a_nutation"].values
    step = f"{np.nanmax(steps):.0f} steps a nutation" if np.isfinite(steps).any() else ""
    own, common = _tolerances(histories)
    tolerance = f"tolerance {' or '.join(map('{:.0e}'.format, sorted(set(common.values()))))} ({', '.join(common)})"
    parts = " or ".join(filter(None, [step, tolerance if common else ""]))
    text = f"All runs have the same start and length, {most:.0f} nutations of {scenes}, and {parts}."
    if own:
        listed = ", ".join(f"{name} {value:.1e}" for name, value in own.items())
        text += f" At the default tolerance, which is the rounding of the arithmetic: {listed}."
    return text


def _tolerances(histories: xr.Dataset) -> tuple[dict[str, float], dict[str, float]]:
    """The tolerances of rows that ran at their own default, and those that were given, by row."""
    own: dict[str, float] = {}
    given: dict[str, float] = {}
    for name in map(str, histories["integrator"].values):
        cell = histories.sel(integrator=name)
        value = float(cell["tolerance"].max())
        if math.isfinite(value):
            (own if float(cell["own_tolerance"].max()) > 0.0 else given)[name] = value
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
    worse: str  # name of a row
    better: str
    change: float  # relative, of the worse row
    other: float  # of the better one


def pairs(histories: xr.Dataset) -> Iterator[Pair]:
    """Every two charts of a method for every constant; runs that ended early are left out."""
    rows: dict[str, list[str]] = {}
    for name in map(str, histories["integrator"].values):
        if (histories["outcome"].sel(integrator=name) == "ok").all():
            rows.setdefault(split_name(name)[0], []).append(name)
    largest = {one: histories[f"{one}_largest"].max("scene", skipna=False) for one in CONSTANTS}
    for constant, names in itertools.product(CONSTANTS, rows.values()):
        for two in itertools.combinations(names, 2):
            better, worse = sorted(two, key=lambda name: float(largest[constant].sel(integrator=name)))
            sizes = (float(largest[constant].sel(integrator=name)) for name in (worse, better))
            yield Pair(constant, worse, better, *sizes)


def charts_apart(histories: xr.Dataset) -> str:
    """Constants that one chart of a method keeps much better than another; empty if no method has two charts."""
    compared = list(pairs(histories))
    explained = {
        constant: max(rounding(histories.sel(scene=scene), constant) for scene in histories["scene"].values)
        for constant in CONSTANTS
    }
    apart = [one for one in compared if one.change > max(explained[one.constant], APART * one.other)]
    methods = {split_name(one.worse)[0] for one in compared}
    if not compared:
        return ""
    listed = "; ".join(
        f"{one.constant} changes by {one.change:.1e} with {one.worse} and by "
        f"{'exactly 0' if one.other == 0.0 else f'{one.other:.1e}'} with {one.better}"
        for one in apart
    )
    same = sorted(methods - {split_name(one.worse)[0] for one in apart})
    rest = (
        f" The other {len(same)} methods with two charts keep energy and momenta equally well in both (within a factor "
        f"of {APART:g}, or both at rounding)." if same else ""
    )  # fmt: skip
    return (f"The chart alone, same method and step: {listed}." if listed else "") + rest
