"""Figures of the study: the five named methods together, what every order costs, error against tolerance."""

from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from symtop_studies.convergence.tables import TARGET, least_work, named_variants

from symtop.measure.conservation import tops
from symtop.methods.framework.registry import split_name
from symtop.model.charts import Array
from symtop.report.figures import SMALLEST, error_band
from symtop.report.style import FIRM, LEAST_TEXT, few_ticks, headline, legend_below, line, look, number, panels
from symtop.runner.study import Picture

from .tables import (
    HISTORY_STEPS,
    LARGE,
    MAIN,
    NAMED,
    Efficiency,
    adaptive,
    declared_order,
    efficiencies,
    evaluations_a_nutation,
    merged,
    stepping,
    tolerance_fits,
)

HORIZON = "over 8 nutations (spheroid: to t = 8)"
EQUAL = {
    "color": "#9EC9E8",
    "lw": 5.0,
    "alpha": 0.8,
    "zorder": 0.5,
    "label": "error = tolerance",
}  # wide: lines cross it
WINDOWS = 18  # of time, in each of which the largest energy error is drawn


def pictures(data: xr.Dataset) -> list[Picture]:
    """The five named methods; the work that each variant with a step needs; error against the tolerance."""
    drawn = [_named(data)] if any(split_name(str(name))[0] in NAMED for name in data["variant"].values) else []
    works = efficiencies(data, TARGET)
    drawn += [_constants(data, works)] if works else []
    chosen = adaptive(data)
    return [*drawn, _by_tolerance(chosen)] if chosen.sizes["variant"] else drawn


def _line(axis: Any, name: str, label: str, x: Any, y: Any) -> None:
    order = np.argsort(x)
    order = order[np.isfinite(x[order]) & np.isfinite(y[order])]
    if order.size:
        axis.plot(x[order], y[order], **line(name), label=label)


def _named(data: xr.Dataset) -> Picture:
    """Four panels on one scene: error against the step, against the tolerance, against work; energy over time."""
    part, labels = named_variants(data)
    scene = str(part["scene"].values)
    figure, axes = panels(2, 2, height=2.3)
    steps, tolerances, work, energy = axes.flat
    floor = 0.0
    for axis in (steps, tolerances, work):
        floor = 0.3 * error_band(axis, part[f"{MAIN}_bound"].values)
        axis.set(xscale="log", yscale="log", ylim=(0.5 * floor, 10.0), ylabel="largest axis error (rad)")
    for name, label in labels.items():
        cell = part.sel(variant=name)
        error, paid = np.maximum(cell[MAIN].values, floor), evaluations_a_nutation(cell, scene)
        cells = cell["force_evaluations"].values
        with np.errstate(invalid="ignore"):
            _line(steps, name, label, np.where(np.isfinite(cell["step_size"]), cell["step_size"], np.nan), error)
        _line(tolerances, name, label, cell["tolerance"].values, error)
        _line(work, name, label, np.where(cells > 0.0, paid, np.nan), error)
        if "history_time" in cell and np.isfinite(cell["history_time"]).any():
            _history(energy, name, label, cell)
    energy.set_visible(bool(energy.get_lines()))
    _equal(tolerances)
    steps.set(xlabel="step size (s)", title="error against the step")
    tolerances.set(xlabel="tolerance asked for", title="error against the tolerance")
    work.set(xlabel="force evaluations per nutation", title="error against cost")
    energy.set(xscale="log", yscale="log", xlabel="nutations", ylabel="relative change\nof the energy")
    energy.set_title(f"energy (fixed steps: {HISTORY_STEPS:g} a nutation)")
    few_ticks(*axes.flat)
    paid_least = least_work(part, labels)
    if len(paid_least) > 1:
        (best, least), (worst, most) = paid_least[0], paid_least[-1]
        headline(
            figure,
            f"{best} needs {number(least)} force evaluations a nutation for {number(TARGET)}{FIRM}rad on scene "
            f"{scene}, {worst} {number(most)}",
        )
    legend_below(figure, [work, tolerances])
    tolerance = sorted({f"{value:.1e}" for value in np.ravel(part.get("history_tolerance", np.nan)) if value > 0.0})
    caption = (
        f"The five methods that everybody knows on {scene}, chart in the name, to t = {float(part['horizon'].max()):g}."
        " Largest axis error at every step, at every tolerance, and both against force evaluations per nutation: a "
        "line of slope -2 costs ten times the work for a hundredth of the error. Last: the largest change of the "
        f"energy, relative to E0 - min V, in each window of time, at {HISTORY_STEPS:g} steps a nutation (adaptive: "
        f"tolerance {' or '.join(tolerance)}). The table of the cheapest runs says what an error below {TARGET:g} "
        "takes. Grey band: below the error bound of the reference."
    )
    alt = "Four log-log plots of the five named methods: error against step, tolerance and work, energy over time."
    return Picture("named-methods", figure, caption, alt, lead="Five well-known methods")


def _equal(axis: Any) -> None:
    """The line where error and tolerance are equal, from frame to frame."""
    limits = axis.get_xlim(), axis.get_ylim()
    ends = np.array([1e-20, 1e2])
    axis.plot(ends, ends, **EQUAL)
    axis.set(xlim=limits[0], ylim=limits[1])


def _history(axis: Any, name: str, label: str, cell: xr.Dataset) -> None:
    time, change = cell["history_time"].values, cell["history_energy"].values
    good = np.isfinite(time) & np.isfinite(change) & (time > 0.0)
    if good.any():
        decades = np.log10(time[good][-1] / max(time[good][0], 1.0))
        x, y = tops(time[good], np.maximum(change[good], SMALLEST), decades, WINDOWS)
        axis.plot(
            x, np.where(np.greater(y, SMALLEST), y, np.nan), **line(name), label=label
        )  # no change at all has no place


def _constants(data: xr.Dataset, works: dict[tuple[str, str], Efficiency]) -> Picture:
    """A line a variant, grouped by order: the work that the error constants foretell for `TARGET`, over the scenes."""
    labels = merged(stepping(data), MAIN)
    scenes = [str(name) for name in data["scene"].values]
    sizes = {name: [works[scene, name] for scene in scenes if (scene, name) in works] for name in labels}
    sizes = {name: known for name, known in sizes.items() if known}
    middle = {name: float(np.median([one.work for one in known])) for name, known in sizes.items()}
    orders: dict[int, list[str]] = {}
    for name in sorted(sizes, key=lambda name: middle[name]):
        orders.setdefault(declared_order(name) or 0, []).append(name)
    blocks = [orders[power] for power in sorted(orders)]
    halves = _halves(blocks)
    most = max(sum(len(block) + 1 for block in half) for half in halves)
    best = min(middle, key=lambda name: middle[name])
    firsts = [block[0] for block in blocks if declared_order(block[0])]
    low = min(firsts, key=lambda name: declared_order(name) or 0)
    figure, axes = panels(1, len(halves), height=0.135 * most + 0.3, sharex=True)
    for axis, half in zip(axes[0], halves, strict=True):
        place, places, ticks = 0, [], []
        for block in half:
            power = declared_order(block[0])
            places.append(place)
            ticks.append(f"order {power}" if power else "no order declared")
            place += 1
            for name in block:
                values = [one.work for one in sizes[name]]
                open_ = sum(one.foreseen for one in sizes[name]) * 2 > len(values)
                marks = line(name)
                axis.plot([min(values), max(values)], [place, place], color=marks["color"], lw=1.2)
                face = "white" if open_ else marks["color"]
                axis.plot(middle[name], place, "o", color=marks["color"], mfc=face, ms=5.0)
                if name in (best, low):
                    axis.annotate(number(middle[name]), (max(values), place), (6, 0), textcoords="offset points",
                                  va="center", fontsize=7.5, weight="bold")  # fmt: skip
                places.append(place)
                ticks.append(labels[name])
                place += 1
        axis.set(xscale="log", yticks=places, yticklabels=ticks, ylim=(most - 0.4, -0.6))
        axis.tick_params(axis="y", labelsize=7.0, length=0)
        for tick in axis.get_yticklabels():
            if tick.get_text() not in labels.values():  # the head of a block
                tick.set(weight="bold", fontsize=8.0)
        axis.grid(visible=False, axis="y")
    dark = {"color": "#444444", "lw": 0.0}
    axes[0, 0].plot([], [], "o", ms=5.0, label=f"median over {len(scenes)} scenes", **dark)
    axes[0, 0].plot([], [], color="#444444", lw=1.2, label="least to largest of the scenes")
    axes[0, 0].plot([], [], "o", ms=5.0, mfc="white", label="open: extrapolated on most scenes", **dark)
    for axis in axes[0]:
        axis.set_xlabel("force evaluations\na nutation")
    legend_below(figure, axes)
    figure.legends[0].set_title("in brackets: the variables that are stepped, angles, axis alone or whole attitude")
    most, times = number(middle[best]), number(middle[low] / middle[best])
    headline(
        figure,
        f"To {number(TARGET)}{FIRM}rad {labels[best]} needs {most} force evaluations a nutation; {labels[low]}, the "
        f"best of order {declared_order(low)}, {times} times as many",
    )
    caption = (
        "Force evaluations per nutation that each variant, method[chart], needs for an axis error of "
        f"{TARGET:g} rad {HORIZON}, by its law error = C h^p. p is the declared order, and C the median of error / h^p "
        f"over the steps of the fit. Bar: from the least to the largest of the scenes {', '.join(scenes)}. Marker: "
        f"their median, open if {TARGET:g} rad lies outside the errors that were fitted on most of them. Charts of a "
        "method with the same errors share a line. Variants without an order to be trusted are in the table only."
    )
    alt = "Dot plot of the work for one accuracy, a line a variant, grouped by order."
    return Picture("constants", figure, caption, alt)


def _halves(blocks: list[list[str]]) -> list[list[list[str]]]:
    """The blocks in two columns of about the same height; one column if there is one block."""
    if len(blocks) < 2:
        return [blocks]
    sums = np.cumsum([len(block) + 1 for block in blocks])
    cut = 1 + int(np.argmin(np.maximum(sums[:-1], sums[-1] - sums[:-1])))
    return [blocks[:cut], blocks[cut:]]


class Met(NamedTuple):
    """The errors of an adaptive variant over its tolerances, and the scene of the largest."""

    ratios: Array
    worst_on: str

    @property
    def middle(self) -> float:
        """The median."""
        return float(np.median(self.ratios))


def _met(data: xr.Dataset) -> dict[str, Met]:
    """Of each adaptive variant, where its tolerance rules; the variant that errs least first."""
    fitted, listed = tolerance_fits(data), {}
    for name in merged(data, MAIN):
        parts = {}
        for scene in map(str, data["scene"].values):
            cell, used = data.sel(scene=scene, variant=name), fitted[scene, name].used
            parts[scene] = (cell[MAIN] / cell["tolerance"]).values[used]
        if sum(part.size for part in parts.values()):
            worst_on = max(parts, key=lambda scene: parts[scene].max(initial=0.0))
            listed[name] = Met(np.concatenate(list(parts.values())), worst_on)
    return dict(sorted(listed.items(), key=lambda item: item[1].middle))


def _by_tolerance(data: xr.Dataset) -> Picture:
    """Error over tolerance of every run of the adaptive variants, with the line where they are equal."""
    met = _met(data)
    figure, axes = panels(1, 1, height=0.155 * max(len(met), 6) + 1.0)
    axis = axes[0, 0]
    for place, (name, one) in enumerate(met.items()):
        color = look(name).color
        axis.plot(one.ratios, [place] * one.ratios.size, "o", color=color, ms=2.5, alpha=0.45, mew=0)
        axis.plot([one.middle] * 2, [place - 0.42, place + 0.42], color=color, lw=2.2, solid_capstyle="butt", zorder=3)
    axis.set(xscale="log", ylim=(len(met) - 0.4, -0.6), yticks=range(len(met)))
    axis.set_xlabel("largest axis error over the tolerance asked for")
    axis.set_yticklabels(list(met), fontsize=LEAST_TEXT)
    axis.grid(visible=False, axis="y")
    axis.tick_params(axis="y", length=0)
    axis.axvline(1.0, color=EQUAL["color"], lw=EQUAL["lw"], zorder=0, label=EQUAL["label"])
    if met:
        ratios = np.concatenate([one.ratios for one in met.values()])
        middle, most = float(np.median(ratios)), float(ratios.max())
        place, (_, one) = max(enumerate(met.items()), key=lambda item: item[1][1].ratios.max())
        axis.axvline(middle, color="black", lw=0.9, ls=(0, (4, 2)), zorder=2, label="median of all runs")
        axis.plot(most, place, "o", color="black", ms=8, mfc="none", mew=1.2, zorder=4)
        said = {"fontsize": 7.5, "weight": "bold", "textcoords": "offset points"}
        axis.annotate(f"{number(most)} times", (most, place), (7, 0), va="center", **said)
        axis.annotate(f"{number(middle)} times", (middle, -0.6), (3, 1), va="bottom", **said)
        axis.set_xlim(0.5 * ratios.min(), 20.0 * most)  # with room for the number
        headline(
            figure,
            f"The error of adaptive methods is {number(middle)} times the tolerance in the median, "
            f"{number(most)} times at most",
        )
    axis.plot([], [], "o", color="#444444", ms=3.5, mew=0, label="a run")
    axis.plot([], [], "|", color="#444444", ms=8, mew=2.2, label="median of a method")
    few_ticks(axis, most=9)
    legend_below(figure, axes)
    scenes = ", ".join(map(str, data["scene"].values))
    figure.legends[0].set_title(
        f"Runs on {scenes}, one at each tolerance.\nNot counted: errors above {LARGE:g} rad, and those near the "
        "reference's error bound, which are rounding."
    )
    caption = (
        f"Largest axis error {HORIZON} of the adaptive methods over the tolerance that was asked for; relative and "
        "absolute tolerance of the Runge-Kutta methods are equal. A dot is a run, a mark the median of its variant, "
        "method[chart]. Right of the wide line a run loses more than it was asked for. Left out are errors that do not "
        f"follow the tolerance: above {LARGE:g} rad, and near the error bound of the reference, where rounding rules."
    )
    if met:
        caption += f" The largest ratio is on {one.worst_on}."
    alt = "A line for each adaptive method with the error of every run over its tolerance, the medians marked."
    return Picture("tolerance", figure, caption, alt)
