"""The fronts: error against cost, a panel a scene, with the runs that no other run beats in both."""

import textwrap
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from symtop.measure import ranking
from symtop.measure.settings import TARGETS
from symtop.report.figures import bound_of, error_band, pareto
from symtop.report.sentences import joined
from symtop.report.style import GREY, RAISED, few_ticks, grid, headline, legend_below, line, look
from symtop.runner.study import Picture

from . import words

COSTS = {"seconds": "wall time of one run (s)", "force_evaluations": "force evaluations of one run"}
BELOW_AXIS = {"seconds": "time of a run (s)", "force_evaluations": "force evaluations"}  # of a small panel
BEATEN = {"seconds": "time", "force_evaluations": "evaluations"}  # what a run on the front needs least of
LEAST = 1e-15  # the lowest error that is drawn, where the reference has no bound
OTHERS = {"color": GREY, "lw": 0.5, "alpha": 0.5, "zorder": 1}  # a line without a name
REST = "another method, on the front"
OFF = "runs that another beats"
CLOSED = "closed form: takes no steps, not ranked"
MOST_OTHERS = 5  # named of those whose runs are open circles
COLUMNS = 4


class Front(NamedTuple):
    """The runs of a scene that no other beats in both cost and error, from the cheapest on."""

    cost: Any
    error: Any
    owners: list[str]

    def of(self, variants: Sequence[str]) -> int:
        """How many belong to some variants."""
        return sum(owner in variants for owner in self.owners)


def draw(data: xr.Dataset, name: str, far: int, cost: str) -> Picture:
    """Every run of every compiled variant, one panel a scene, with the front and the two that have most of it."""
    data = data[[*COSTS, "axis", "axis_bound", "control", "implementation"]]  # of these alone: a dataset has dozens
    scenes = [str(scene) for scene in data["scene"].values]
    cells = {scene: data.sel(scene=scene).isel(horizon=far) for scene in scenes}
    compiled = [row for row in words.of_implementation(data, "compiled") if row in ranking.ranked(data)]
    floors = {scene: 0.5 * bound_of(cell["axis_bound"].values, LEAST) for scene, cell in cells.items()}
    fronts = {scene: front(cell.sel(variant=compiled), cost, floors[scene]) for scene, cell in cells.items()}
    owners = Counter(owner for one in fronts.values() for owner in one.owners)
    most = [row for row, _ in owners.most_common(2)]
    figure, axes = grid(len(scenes), COLUMNS, (BELOW_AXIS[cost], ""), height=1.75, sharex=True, sharey=True)
    for axis, (scene, cell) in zip(axes, cells.items(), strict=True):
        error_band(axis, cell["axis_bound"].values, LEAST)
        for row in compiled:
            axis.plot(*curve(cell.sel(variant=row), "axis", cost, floors[scene]), **OTHERS)
        if cost == "seconds":
            _closed_form(axis, cell)
        _front(axis, fronts[scene], most)
        axis.set(xscale="log", yscale="log", ylim=(0.03 * LEAST, 10.0))  # the band is seen
        axis.set_title(f"{scene}\n{fronts[scene].of(most)} of {len(fronts[scene].owners)} runs")
    axes[0].plot([], [], **(OTHERS | {"lw": 0.8, "alpha": 0.8}), label=OFF)
    figure.supylabel("largest axis error (rad)", fontsize=8.0)
    few_ticks(*axes, most=4)
    axes[0].minorticks_off()  # all panels share their axes
    legend_below(figure, axes)
    said = f"The front: runs that no other beats in both {BEATEN[cost]} and error, of all compiled methods on a scene. "
    if cost == "seconds":
        said += (
            f"Only runs that were timed are drawn: the cheapest of a method for {', '.join(map(power, TARGETS))} rad, "
            "and some for the comparison of energies. "
        )
    figure.legends[0].set_title("\n".join(textwrap.wrap(f"{said}{others(owners, most)}", 116)))
    whole = sum(owners.values())
    headline(figure, message(most, sum(owners[row] for row in most), whole, BEATEN[cost], words.spans(data)[far]))
    timed = (
        " Only timed runs are shown: a variant's cheapest for some error, and those of the comparison of energies. "
        "Dotted: the closed form, which is not ranked. Of times below ten microseconds 2 to 4 are the call itself."
        if cost == "seconds"
        else " A high derivative, a kick and a stage count alike and take different times."
    )
    owned = joined([f"{row} ({owners[row]})" for row in most])
    return Picture(
        name,
        figure,
        f"Largest axis error {words.spans(data)[far]} against {COSTS[cost]}, one panel a scene. A grey line is a "
        "compiled variant whose step or tolerance varies along it. Marks joined by steps are the front: runs that no "
        f"compiled variant beats in both. Of its {whole} runs the most belong to {owned}. Grey band: below the error "
        f"bound of the reference.{timed}",
        f"Log-log work-precision plots of the axis error against {COSTS[cost]}, one panel a scene.",
    )


def power(target: float) -> str:
    """A target as a power of ten."""
    return f"10{str(round(np.log10(target))).translate(RAISED)}"


def others(owners: Mapping[str, int], most: Sequence[str]) -> str:
    """Whose the open circles of a front are: the variants that its title does not name, with the most runs first."""
    rest = {row: count for row, count in owners.items() if row not in most}
    ranked = sorted(rest, key=lambda row: -rest[row])
    if not ranked:
        return ""
    unnamed = ranked[MOST_OTHERS:]
    listed = ", ".join(f"{row} ({rest[row]})" for row in ranked[:MOST_OTHERS])
    more = f"; {len(unnamed)} other{'s' * (len(unnamed) > 1)} ({sum(rest[row] for row in unnamed)})" if unnamed else ""
    return f"Open circles: {listed}{more}."


def message(most: Sequence[str], count: int, whole: int, unit: str, span: str) -> str:
    """How many runs of the fronts belong to the variants that have most of them."""
    if not most:
        return f"No method has a run {span}"
    return (
        f"{' and '.join(most)} make{'s' * (len(most) < 2)} up {count} of the {whole} runs that no other beats in both "
        f"{unit} and error, {span}"
    )


def curve(runs: xr.Dataset, quantity: str, cost: str, floor: float) -> tuple[Any, Any]:
    """The runs of one variant from its coarsest setting to its finest."""
    x, y = runs[cost].values, runs[quantity].values
    there = np.isfinite(x) & np.isfinite(y)
    return x[there], np.maximum(y[there], floor)


def front(cell: xr.Dataset, cost: str, floor: float) -> Front:
    """The front of some variants on a scene."""
    x, y = cell[cost].values, np.maximum(cell["axis"].values, floor)
    on = pareto(x, y)
    order = np.argsort(x[on])
    x, y, owners = (part[on][order] for part in (x, y, np.broadcast_to(cell["variant"].values[:, None], x.shape)))
    return Front(x, y, [str(owner) for owner in owners])


def _front(axis: Any, one: Front, most: Sequence[str]) -> None:
    """The steps of a front, and a mark on each of its runs: that of its variant if the title names it."""
    axis.step(one.cost, one.error, where="post", color="#444444", lw=0.8, zorder=2)
    owners = np.array(one.owners, dtype=object)
    for row in most:
        mine = owners == row
        axis.plot(one.cost[mine], one.error[mine], **(line(row, 1.1) | {"ls": "none"}), label=row, zorder=4)
    rest = ~np.isin(owners.astype(str), list(most))
    style = {"ls": "none", "marker": "o", "ms": 3.2, "mfc": "white", "mec": "black", "mew": 0.8}
    axis.plot(one.cost[rest], one.error[rest], **style, label=REST, zorder=5)  # small: over the others


def _closed_form(axis: Any, cell: xr.Dataset) -> None:
    """The time of what takes no steps, as a dotted line."""
    for variant in (name for name in map(str, cell["variant"].values) if name not in ranking.ranked(cell)):
        at = float(cell["seconds"].sel(variant=variant).min())
        if np.isfinite(at):
            axis.axvline(at, color=look(variant).color, ls=":", lw=1.0, zorder=1, label=CLOSED)
