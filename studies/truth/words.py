"""Sentences and tables of the truth study, from its dataset and from the published values."""

import numpy as np
import xarray as xr

from symtop.measure.published import OTHER_BODY, START, TRAJECTORY, Published, published_values
from symtop.runner.study import Table

from .tables import Column, bound_ratios

HOW_TO_READ = (
    "Every error elsewhere in this report is measured against these sources. A line is the true error of a source, the "
    "shade above it reaches up to the bound that the reference claims. A valid bound lies above the measured error; a "
    "useful one lies close to it. Points of other figures within ten times of the bound are drawn hollow."
)


def bounds(data: xr.Dataset) -> str:
    """How many claimed bounds hold, and how close they are."""
    count, broken, ratio = bound_ratios(data)
    return (
        f"Of {count} claimed bounds {count - broken} hold against the closed form in 45 digits; the median bound is "
        f"{ratio:.0f} times the error."
    )


def _agreeing(values: list[Published]) -> str:
    return f"{sum(entry.reproduced for entry in values)} of {len(values)}"


def published(values: list[Published] | None = None) -> str:
    """How many published values are reproduced, and what they test."""
    values = published_values() if values is None else values
    printed = [entry for entry in values if entry.kind == "printed"]
    others = [entry for entry in values if entry.kind != "printed"]
    trajectory, start, other = (
        [entry for entry in printed if entry.tests == subject] for subject in (TRAJECTORY, START, OTHER_BODY)
    )
    sources = ", ".join(dict.fromkeys(entry.source for entry in trajectory))
    return (
        f"{_agreeing(printed)} printed values are reproduced to the last digit. Only {len(trajectory)} of them test a "
        f"trajectory of the top ({sources or 'none'}); {len(start)} tests the energy of a start, and {len(other)} "
        "belong to an asymmetric free body, which SciPy integrates here, not symtop. Of the values that follow from a "
        f"formula, or from the numbers that a source was built from, {_agreeing(others)} agree."
    )


def closed_form(data: xr.Dataset) -> list[str]:
    """The error of the closed form on the first scene and why it is known; nothing without that scene and heyoka."""
    if "spheroid" not in data["scene"].values or "quadruple, attitude" not in data["integrator"].values:
        return []
    closed = data.sel(scene="spheroid", integrator="closed form")
    horizon = closed["horizon"].values[np.isfinite(closed[Column.ERROR].values)].max()
    quadruple = data[Column.ERROR].sel(scene="spheroid", integrator="quadruple, attitude")
    sentence = (
        "On spheroid the closed form in double has an axis error of "
        f"{float(closed[Column.ERROR].sel(horizon=horizon)):.1e} rad at t = {float(horizon):g}, measured with the same "
        "formula in 45 digits, whose rounding cannot reach the sixteenth digit. The formula itself is confirmed by the "
        f"integration in quadruple precision, which agrees with it to {float(quadruple.max()):.0e} rad."
    )
    return [sentence]


def tables(data: xr.Dataset) -> list[Table]:
    """Published values beside ours, and error and cost by source."""
    rows = [
        [
            entry.source, entry.quantity, f"{entry.published:.12g}", f"{entry.ours:.14g}",
            f"{entry.ours - entry.published:+.1e}", "yes" if entry.reproduced else "no", entry.kind, entry.tests,
            entry.remark,
        ]
        for entry in published_values()
    ]  # fmt: skip
    header = ["source", "quantity", "published", "ours", "difference", "to the last digit", "kind", "tests", "remark"]
    return [Table("Published values", header, rows), _costs(data)]


def _costs(data: xr.Dataset) -> Table:
    rows = []
    for scene in data["scene"].values:
        for source in data["integrator"].values:
            cell = data.sel(scene=scene, integrator=source)
            measured = np.flatnonzero(np.isfinite(cell[Column.ERROR].values))
            if measured.size:
                last = cell.isel(horizon=int(measured[-1]))
                bound = float(last[Column.BOUND])
                rows.append(
                    [
                        str(scene), str(source), f"{float(last['horizon']):g}", f"{float(last[Column.ERROR]):.1e}",
                        f"{bound:.1e}" if np.isfinite(bound) else "none claimed", f"{float(last[Column.SECONDS]):.2g}",
                    ]
                )  # fmt: skip
    header = ["scene", "source", "longest horizon (s)", "axis error there (rad)", "claimed bound (rad)", "seconds"]
    return Table("Sources at their longest horizon", header, rows)
