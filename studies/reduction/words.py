"""Sentences and tables of the reduction study, from its dataset."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr

from symtop.methods.framework.registry import integrator
from symtop.report.sentences import few, joined
from symtop.report.style import number
from symtop.runner.study import Table

from .tables import (
    CHART_PERIODS,
    COMMUTES,
    COMPARED_STEPS,
    GAPS,
    SAME_MAP,
    Column,
    Ratio,
    chart_ratios,
    commutation_order,
)

HOW_TO_READ = (
    "Three comparisons. An integrator that works in several charts runs in each of them at the same setting. A reduced "
    "discrete Lagrangian runs beside its unreduced form, which steps the same rule with nothing eliminated: they "
    "differ by rounding, or one of them is wrong. Their times are of two kernels as they are, which differ in more: "
    "the reduced one predicts with a cubic and stops after a correction of 1e-8 of the increment, the unreduced one "
    "with a parabola and only when nothing changes. And eliminating phi and psi before discretising is compared with "
    "doing so afterwards: a flat line at 1e-16 means that the order of the two does not matter, a slope of p that the "
    "results are two different methods, O(h^p) apart."
)

PHI, PSI = "\N{GREEK SMALL LETTER PHI}", "\N{GREEK SMALL LETTER PSI}"  # of titles
CHARTS = ["scene", "variant", "chart", "against", "time (ratio)", "axis error (ratio)"]
COSTS = [
    "scene", "rule", "step (s)", "ns a step", "ns a step, unreduced", "ratio", "iterations a step",
    "iterations a step, unreduced", "ratio of the iterations", "ratio of the time of an iteration",
]  # fmt: skip
GAPS_OVER_STEPS = [
    "scene", "rule", "coarsest step (s)", "difference there (rad)", "at the finest step (rad)", "power of h"
]  # fmt: skip


def cells(data: xr.Dataset, variable: str) -> list[tuple[str, str, xr.Dataset]]:
    """Scene, integrator and data of the cells in which a variable was measured."""
    if variable not in data:
        return []
    every = [
        (str(scene), str(method), data.sel(scene=scene, variant=method))
        for scene in data["scene"].values
        for method in data["variant"].values
    ]
    return [(scene, method, cell) for scene, method, cell in every if np.isfinite(cell[variable]).any()]


def ratios(data: xr.Dataset) -> list[tuple[str, str, Ratio]]:
    """Scene, integrator and ratio of every chart but the first that the integrator has."""
    return [(scene, method, r) for scene, method, cell in cells(data, Column.SECONDS) for r in chart_ratios(cell)]


def commuting_message(data: xr.Dataset) -> str:
    """For which rules the order of reducing and discretising does not matter, as a title."""
    largest: dict[str, float] = {}
    for _, method, cell in cells(data, Column.GAP):
        largest[method] = max(float(cell[Column.GAP].max()), largest.get(method, 0.0))
    same = [method for method, gap in largest.items() if gap < COMMUTES]
    rest = [method for method in largest if method not in same]
    return (
        f"Eliminating {PHI} and {PSI} before or after discretising makes the same method for "
        f"{', '.join(same) or 'no rule'}, and different ones for {', '.join(rest) or 'none'}"
    )


def unreduced_message(data: xr.Dataset, methods: list[str]) -> str:
    """What eliminating angles after discretising changes, as a title."""
    gap = largest_gap(data)
    judged = "nothing but rounding" if gap < SAME_MAP else "more than rounding"
    return (
        f"Eliminating {PHI} and {PSI} after discretising changes {judged}: {' and '.join(methods)} with and without it "
        f"differ by at most {number(gap)} rad"
    )


def commuting(data: xr.Dataset) -> str:
    """Which rules commute with the reduction, and how fast the others approach it."""
    same: dict[str, float] = {}
    apart: dict[str, list[float]] = {}
    for _, method, cell in cells(data, Column.GAP):
        largest = float(cell[Column.GAP].max())
        if largest < COMMUTES:
            same[method] = max(largest, same.get(method, 0.0))
        else:
            apart.setdefault(method, []).append(commutation_order(cell))
    powers = [power for several in apart.values() for power in several]
    ends = " to ".join(dict.fromkeys(f"h^{pick(powers):.2f}" for pick in (min, max))) if powers else ""
    parts = [f"the same method for {few(list(same))}, to {max(same.values()):.1e} rad"] if same else []
    parts += [f"different ones for {few(list(apart))}, apart as {ends}"] if apart else []
    if not parts:
        return ""
    return f"Eliminating phi and psi (reducing) before or after discretising gives {', and '.join(parts)}."


def largest_gap(data: xr.Dataset) -> float:
    """The largest difference of any angle between a kernel and its unreduced form, rad."""
    return max(float(cell[gap].max()) for _, _, cell in cells(data, Column.THETA_GAP) for gap in GAPS)


class Saving(NamedTuple):
    """What the kernels of one rule, unreduced over reduced, differ by at one step on one scene."""

    rule: str
    time: float  # of a step
    iterations: tuple[float, float]  # of Newton, a step: reduced and unreduced

    @property
    def more(self) -> float:
        """The ratio of the iterations."""
        return self.iterations[1] / self.iterations[0]

    @property
    def each(self) -> float:
        """The ratio of the times of an iteration, with what a step does besides."""
        return self.time / self.more


def savings(data: xr.Dataset) -> list[Saving]:
    """Every pair of a kernel and its unreduced form that was timed."""
    return [
        Saving(rule, float(time[1] / time[0]), (float(done[0]), float(done[1])))
        for _, rule, cell in cells(data, Column.SECONDS_A_STEP)
        for time, done in zip(
            cell[Column.SECONDS_A_STEP].transpose("twin_step", "kernel").values,
            cell[Column.ITERATIONS_A_STEP].transpose("twin_step", "kernel").values,
            strict=True,
        )
    ]


def same_map(data: xr.Dataset) -> str:
    """How far a kernel and its unreduced form differ; empty if none was compared."""
    compared = cells(data, Column.THETA_GAP)
    if not compared:
        return ""
    drift = max(float(cell[p].max()) for *_, cell in compared for p in (Column.P_PHI_DRIFT, Column.P_PSI_DRIFT))
    largest = largest_gap(data)
    rules = joined(list(dict.fromkeys(rule for _, rule, _ in compared)))
    judged = "within" if largest < SAME_MAP else "more than"
    return (
        f"The reduced and the unreduced forms of {rules} differ by "
        f"up to {largest:.1e} rad in {COMPARED_STEPS} steps, {judged} the {SAME_MAP:.0e} rad that rounding may reach. "
        f"The momenta of the unreduced form, which are part of its state, change by up to {drift:.1e}, relative."
    )


def cheaper(data: xr.Dataset) -> str:
    """What a reduced kernel saves, and how much of that is in the number of iterations; empty if none was timed."""
    pairs = savings(data)
    if not pairs:
        return ""
    rules = list(dict.fromkeys(pair.rule for pair in pairs))
    reduced, whole = zip(*(pair.iterations for pair in pairs), strict=True)
    return (
        f"A step of the unreduced kernels of {joined(rules)} takes {_ends([pair.time for pair in pairs])} times as "
        f"long as a reduced one. It has {_ends([pair.more for pair in pairs])} times as many Newton iterations "
        f"({_ends(whole)}, not {_ends(reduced)}), and each takes {_ends([pair.each for pair in pairs], 2)} times as "
        "long. The kernels also stop and predict by different rules: what eliminating phi and psi alone saves was not "
        "measured."
    )


def _factors(pair: Saving) -> tuple[float, float]:
    """The ratio of the times of a step is the product of these two."""
    return pair.more, pair.each


def _ends(values: Sequence[float], digits: int = 1) -> str:
    return f"{min(values):.{digits}f} to {max(values):.{digits}f}"


class Larger(NamedTuple):
    """What another chart than the first of `SMALLEST_FIRST["axis"]` costs the methods of a family."""

    family: str
    chart: str
    base: str
    time: float  # median ratio of the times of a run
    methods: list[str]


def larger_charts(data: xr.Dataset) -> list[Larger]:
    """What another chart costs, for each family and chart."""
    groups: dict[tuple[str, str, str], dict[str, list[float]]] = {}
    for _, method, ratio in ratios(data):
        group = groups.setdefault((integrator(method).family, ratio.chart, ratio.base), {})
        group.setdefault(method, []).append(ratio.time)
    return [
        Larger(*names, float(np.median([time for several in times.values() for time in several])), list(times))
        for names, times in groups.items()
    ]


def larger_sentence(data: xr.Dataset) -> str:
    """What another chart costs, from the least to the most over families and charts; empty without any."""
    longer = sorted(larger_charts(data), key=lambda one: one.time)
    if not longer:
        return ""
    said = [f"{one.time:.2g} times as long ({one.chart} over {one.base}, {one.family})" for one in longer]
    return (
        "A run in another chart, with the same steps or tolerances, takes in the median of a family "
        f"{' to '.join(dict.fromkeys((said[0], said[-1])))} over {CHART_PERIODS:g} nutations."
    )


def verdict(data: xr.Dataset) -> list[str]:
    """A sentence or two a comparison."""
    return list(filter(None, [commuting(data), same_map(data), cheaper(data), larger_sentence(data)]))


def tables(data: xr.Dataset) -> list[Table]:
    """Charts, unreduced forms and the order of reducing and discretising, in numbers."""
    charts, costs, gaps = [], [], []
    for scene, method, ratio in ratios(data):
        error = f"{ratio.error:.3g}" if math.isfinite(ratio.error) else ""
        charts.append([scene, method, ratio.chart, ratio.base, f"{ratio.time:.2f}", error])
    timed = iter(savings(data))
    for scene, method, cell in cells(data, Column.SECONDS_A_STEP):
        columns = (cell[Column.COMPARED_STEP], cell[Column.SECONDS_A_STEP].T, cell[Column.ITERATIONS_A_STEP].T)
        for h, seconds, iterations in zip(*(column.values for column in columns), strict=True):
            reduced, whole = seconds * 1e9
            row = [scene, method, f"{h:.3g}", f"{reduced:.0f}", f"{whole:.0f}", f"{whole / reduced:.2f}"]
            costs.append([*row, *(f"{value:.2f}" for value in (*iterations, *_factors(next(timed))))])
    for scene, method, cell in cells(data, Column.GAP):
        gap, h = cell[Column.GAP].values, cell[Column.STEP].values
        power = "" if np.nanmax(gap) < COMMUTES else f"{commutation_order(cell):.3f}"
        gaps.append([scene, method, f"{np.nanmax(h):.3g}", f"{gap[0]:.2e}", f"{gap[np.isfinite(gap)][-1]:.2e}", power])
    larger = [
        [one.family, one.chart, one.base, f"{one.time:.2g}", str(len(one.methods))] for one in larger_charts(data)
    ]
    title = f"A run in another chart: median time over that in the chart against it, {CHART_PERIODS:g} nutations"
    return [
        Table(title, ["family", "chart", "against", "time (ratio)", "methods"], larger),
        Table(f"Two charts of one method, same steps or tolerances, {CHART_PERIODS:g} nutations", CHARTS, charts),
        Table(
            "Reduced kernels and their unreduced forms as they are, in angles: other iterations, predictors and rules "
            "to stop; ratios are unreduced over reduced",
            COSTS,
            costs,
        ),
        Table("Reduce first or last: largest difference in theta, in angles over two nutations", GAPS_OVER_STEPS, gaps),
    ]
