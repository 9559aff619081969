"""What the report says first, "Which integrator should I use?", and charts of every run to point at."""

from collections import Counter

import numpy as np
import xarray as xr

from symtop.measure import ranking
from symtop.measure.errors import QUANTITIES
from symtop.report.sentences import abridged
from symtop.runner.study import Chart, Opening, Series, Table

from . import energy, leads
from .fronts import COSTS
from .words import COMPARED, not_asked, of_implementation, seconds, spans

USED = (*ranking.NEEDS, "axis", "chart", "structured", "energy", "steps", "force_evaluations")  # of dozens of variables


def opening(data: xr.Dataset) -> Opening:
    """Which variant to begin with, for each horizon and target.

    It is, of the compiled variants that meet the target on the most scenes, the one that is closest to the fastest.
    """
    rows, sentences = [], []
    whole, data = data, data[[name for name in USED if name in data]]
    compiled = of_implementation(data, "compiled")
    names = [name for name in ranking.ranked(data) if name in compiled]
    ahead: Counter[str] = Counter()
    for far, span in enumerate(spans(data)):
        table = leads.relative_costs(data.isel(horizon=[far]), names).sel(variant=names)
        for target in table["target"].values:
            ratios = table.sel(target=[target]).dropna("problem", how="all")
            best = leads.leaders(ratios, 3) if ratios.sizes["problem"] else []
            ahead.update(best[:1])
            row = [span, f"{target:.0e}", "none", "", "", ""]
            if best:
                first = ratios.sel(variant=best[0]).values.ravel()
                met = first[np.isfinite(first)]
                time = f"{np.median(met):.2g} (worst {met.max():.2g})"
                row[2:] = [best[0], f"{met.size} of {first.size} scenes", time, ", ".join(best[1:])]
            rows.append(row)
    if ahead:
        (first, times), *others = ahead.most_common()
        listed = f", and {abridged([f'{name} in {count}' for name, count in others])}" if others else ""
        sentences.append(
            f"For the direction of the axis, begin with {first}. It is the first choice in {times} of the {len(rows)} "
            f"lines of the table{listed}. The first choice meets the error on the most scenes and takes, of the "
            "variants that do, the least time over the fastest."
        )
        sentences.append(
            "A variant is a method in one chart, timed as the bare compiled loop, at the coarsest step or tolerance "
            f"that meets the error.{not_asked(data)}"
        )
    steps = energy.at_equal_steps(data, COMPARED[:2], str(data["scene"].values[0]))
    sentences += [
        *filter(None, [*(energy.sentence(whole, chart) for chart in ("axis",)), steps]),
        "For your own scene and accuracy: symtop recommend SCENE --accuracy 1e-6; it also runs what it recommends.",
    ]
    header = ["horizon", "axis error (rad)", "begin with", "meets it on", "time over the fastest", "then"]
    return Opening("Which integrator should I use?", sentences, Table("A variant to begin with", header, rows))


SHOWN = ("seconds", "force_evaluations", "axis", "step_size", "tolerance", "outcome")  # of a run, in a chart


def charts(data: xr.Dataset) -> list[Chart]:
    """Axis error of every timed run against seconds, and of every run against work: one panel a scene and horizon."""
    runs = data[list(SHOWN)].transpose("scene", "horizon", "variant", "setting", ...)
    table = {name: runs[name].values for name in SHOWN}  # selecting a cell of a Dataset takes 10 ms
    cells = {
        f"{scene}, {span}": {name: values[place, far] for name, values in table.items()}
        for place, scene in enumerate(runs["scene"].values)
        for far, span in enumerate(spans(data))
    }
    names = [str(name) for name in runs["variant"].values]
    kinds = {"seconds": "Every timed run", "force_evaluations": "Every run, by its work"}
    return [
        Chart(
            "axis" if cost == "seconds" else "work",
            f"{title}: point at one to see its setting",
            COSTS[cost],
            f"largest {QUANTITIES['axis']}",
            {panel: [_series(name, {key: values[k] for key, values in cell.items()}, cost)
                     for k, name in enumerate(names)]
             for panel, cell in cells.items()},
        )
        for cost, title in kinds.items()
    ]  # fmt: skip


def _series(name: str, runs: dict[str, np.ndarray], cost: str) -> Series:
    """The runs of a variant that ended well, by their cost."""
    keep = np.flatnonzero(np.isfinite(runs[cost]) & np.isfinite(runs["axis"]) & (runs["outcome"] == "ok"))
    keep = keep[np.argsort(runs[cost][keep], kind="stable")]
    points = []
    for x, y, step, tolerance, time in zip(
        *(runs[key][keep] for key in (cost, "axis", "step_size", "tolerance", "seconds")), strict=True
    ):
        words = [f"step {step:.3g}"] if np.isfinite(step) else []
        words += [f"tolerance {tolerance:.1e}"] if np.isfinite(tolerance) and not words else []
        words += [seconds(time)] if np.isfinite(time) else []
        words += [f"{x:.3g} force evaluations"] if cost != "seconds" else []
        points.append((float(f"{x:.3g}"), float(f"{y:.3g}"), ", ".join([*words, f"error {y:.1e}"])))
    return Series(name, points)
