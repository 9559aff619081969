"""What the report says first, "Which integrator should I use?", and a chart of every run to point at."""

from collections import Counter

import numpy as np
import xarray as xr

from symtop.measure import ranking
from symtop.measure.errors import QUANTITIES
from symtop.measure.work import TARGETS
from symtop.runner.study import Chart, Opening, Series, Table

from .tables import Column
from .words import crossed, left_out, seconds, spans


def opening(data: xr.Dataset) -> Opening:
    """Which method to begin with: for each horizon and target the one closest to the fastest over all scenes."""
    rows, sentences = [], []
    data, uncounted = ranking.counted(data)
    names = [name for name in map(str, data["integrator"].values) if _steps(data.sel(integrator=name))]
    ahead: Counter[str] = Counter()
    for far, span in enumerate(spans(data)):
        table = ranking.relative(ranking.costs(data.isel(horizon=[far])), names).sel(integrator=names)
        for number, target in enumerate(TARGETS):
            ratios = table.isel(target=[number])
            order = ranking.leaders(ratios, 3)
            if not order:
                rows.append([span, f"{target:.0e}", "none", "", "", ""])
                continue
            first = ratios.sel(integrator=order[0]).values.ravel()
            met = np.isfinite(first)
            ahead[order[0]] += 1
            usual, worst = float(np.median(first[met])), float(first[met].max())
            share = f"{int(met.sum())} of {first.size} scenes"
            time = f"{usual:.2g} (worst {worst:.2g})"
            rows.append([span, f"{target:.0e}", order[0], share, time, ", ".join(order[1:])])
    if ahead:
        best, times = ahead.most_common(1)[0]
        others = ", ".join(f"{name} for {count}" for name, count in ahead.most_common()[1:])
        sentences.append(
            f"For the direction of the axis, begin with {best}: over all scenes it is closest to the fastest method "
            f"for {times} of {len(rows)} pairs of horizon and accuracy"
            + (f"; {others}." if others else ".")
            + left_out(uncounted)
        )
    sentences.append(f"For energy {spans(data)[-1]}: {crossed(data)}")
    sentences.append(
        "For your own scene and accuracy: symtop recommend SCENE --accuracy 1e-6; it also runs what it recommends."
    )
    header = ["horizon", "axis error", "begin with", "meets it on", "time over the fastest", "then"]
    return Opening("Which integrator should I use?", sentences, Table("A method to begin with", header, rows))


def _steps(cell: xr.Dataset) -> bool:
    """Is it compiled, and does it step? The closed form does not."""
    settings = np.isfinite(cell[Column.STEP].values) | np.isfinite(cell[Column.TOLERANCE].values)
    return bool(settings.any()) and "compiled" in cell[Column.IMPLEMENTATION].values


def charts(data: xr.Dataset) -> list[Chart]:
    """Axis error against seconds, every run of every method: one panel a scene and horizon."""
    panels = {}
    for scene in data["scene"].values:
        for far, span in enumerate(spans(data)):
            cell = data.sel(scene=scene).isel(horizon=far)
            names = [str(name) for name in cell["integrator"].values]
            panels[f"{scene}, {span}"] = [_series(cell.sel(integrator=name), name) for name in names]
    title = "Every run: point at one to see its setting"
    return [Chart("axis", title, "wall time of one run (s)", f"largest {QUANTITIES['axis']}", panels)]


def _series(cell: xr.Dataset, name: str) -> Series:
    times, errors = cell[Column.SECONDS].values, cell[Column.AXIS].values
    keep = np.isfinite(times) & np.isfinite(errors) & (cell[Column.OUTCOME].values == "ok")
    points = []
    for k in sorted(np.flatnonzero(keep), key=lambda k: times[k]):
        step, tolerance = float(cell[Column.STEP].values[k]), float(cell[Column.TOLERANCE].values[k])
        words = [f"step {step:.3g}"] if np.isfinite(step) else []
        words += [f"tolerance {tolerance:.1e}"] if np.isfinite(tolerance) and not np.isfinite(step) else []
        time, error = float(f"{times[k]:.3g}"), float(f"{errors[k]:.3g}")
        source = "" if cell[Column.TIMED].values[k] == 1.0 else " (predicted)"
        points.append((time, error, ", ".join([*words, f"{seconds(time)}{source}", f"error {error:.1e}"])))
    return Series(name, points)
