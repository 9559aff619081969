"""How well is the truth known?"""

import numpy as np
import xarray as xr

from symtop.measure.published import Published, published_values
from symtop.model.scenes import added_scenes, scene
from symtop.report.style import BLACK, BLUE, GREEN, ORANGE, PURPLE, VERMILLION, legend_below, panels
from symtop.run.reference import have_heyoka
from symtop.runner.study import Case, Picture, Study, Table

from .sources import SOURCES, source_errors

SCENES = {"spheroid": 1e5, "goldstein": 1e4, "hairer-lubich-wanner": 1e4, "bruls-cardona-arnold": 1e3}
LONGEST = {"quadruple, attitude": 100.0, "closed form": 1e6}  # seconds of machine time, not of accuracy
LOOKS = dict(zip(SOURCES, zip((ORANGE, VERMILLION, GREEN, BLUE, PURPLE, BLACK), "v<^>D*", strict=True), strict=True))


def cases(quick: bool) -> list[Case]:
    """Every source on every scene, from t = 8 to as far as it is affordable."""
    grid = []
    for name, longest in {**SCENES, **dict.fromkeys(added_scenes(), 1e3)}.items():
        for source in SOURCES if have_heyoka() else ("closed form",):
            furthest = LONGEST.get(source, longest)
            horizons = [8.0] + [10.0**k for k in (range(2, 3) if quick else range(2, 7)) if 10.0**k <= furthest]
            grid.append(Case(name, source, {"horizons": horizons}))
    return grid


def measure(case: Case) -> xr.Dataset:
    """Error, bound and cost of one source."""
    return source_errors(scene(case.scene), case.integrator, case.settings["horizons"])


def pictures(data: xr.Dataset) -> list[Picture]:
    """Error of each source against the horizon, and the bound it claims."""
    names = [str(name) for name in data["scene"].values]
    figure, axes = panels(-(-len(names) // 2), 2)
    for axis, name in zip(axes.flat, names, strict=False):
        for source in data["integrator"].values:
            cell = data.sel(scene=name, integrator=source)
            t, error, bound = cell["horizon"].values, cell["axis"].values, cell["axis_bound"].values
            color, marker = LOOKS[str(source)]
            known = np.isfinite(error)
            axis.plot(t[known], np.maximum(error[known], 1e-36), marker + "-", color=color, label=str(source))
            claimed = known & np.isfinite(bound)
            axis.fill_between(
                t[claimed], np.maximum(error[claimed], 1e-36), bound[claimed], color=color, alpha=0.15, lw=0
            )
        axis.set(xscale="log", yscale="log", title=name)
    for axis in axes.flat[len(names) :]:
        axis.set_visible(False)
    for axis in axes[-1]:
        axis.set_xlabel("horizon (s)")
    for axis in axes[:, 0]:
        axis.set_ylabel("axis error (rad)")
    legend_below(figure, axes)
    broken, most = bound_ratios(data)
    caption = (
        "True error of each source, against the closed form in 45 digits, and above it, shaded, the bound that the "
        f"reference claims for it. Errors above their bound: {broken}. The bound is {most:.0f} times the error in the "
        "median. The closed form in double does not lose digits with time; an integration does."
    )
    alt = "Log-log plots of axis error against horizon: integrations rise, the closed form stays flat."
    return [Picture("sources", figure, caption, alt)]


def bound_ratios(data: xr.Dataset) -> tuple[int, float]:
    """How often an error exceeds its claimed bound, and the median of bound over error."""
    error, bound = data["axis"].values, data["axis_bound"].values
    both = np.isfinite(error) & np.isfinite(bound)
    return int(np.sum(error[both] > bound[both])), float(np.median(bound[both] / np.maximum(error[both], 1e-40)))


def tables(data: xr.Dataset) -> list[Table]:
    """Published values beside ours, and error and cost by source."""
    rows = [
        [
            entry.source, entry.quantity, f"{entry.published:.12g}", f"{entry.ours:.14g}",
            f"{entry.ours - entry.published:+.1e}", "yes" if entry.reproduced else "no", entry.kind, entry.remark,
        ]
        for entry in published_values()
    ]  # fmt: skip
    header = ["source", "quantity", "published", "ours", "difference", "to the last digit", "kind", "remark"]
    costs = []
    for name in data["scene"].values:
        for source in data["integrator"].values:
            cell = data.sel(scene=name, integrator=source)
            known = np.flatnonzero(np.isfinite(cell["axis"].values))
            if known.size:
                last = cell.isel(horizon=int(known[-1]))
                bound = float(last["axis_bound"])
                costs.append(
                    [
                        str(name), str(source), f"{float(last['horizon']):g}", f"{float(last['axis']):.1e}",
                        f"{bound:.1e}" if np.isfinite(bound) else "none claimed", f"{float(last['seconds']):.2g}",
                    ]
                )  # fmt: skip
    columns = ["scene", "source", "longest horizon (s)", "axis error there", "claimed bound", "seconds"]
    return [Table("Published values", header, rows), Table("Sources at their longest horizon", columns, costs)]


def _agreed(values: list[Published]) -> str:
    return f"{sum(entry.reproduced for entry in values)} of {len(values)}"


def verdict(data: xr.Dataset) -> list[str]:
    """What the reference is worth."""
    broken, ratio = bound_ratios(data)
    values = published_values()
    printed = [entry for entry in values if entry.kind == "printed"]
    others = [entry for entry in values if entry.kind != "printed"]
    count = int(np.sum(np.isfinite(data["axis_bound"].values)))
    held = f"Of {count} claimed bounds {count - broken} hold against the closed form in 45 digits"
    sentences = [
        f"{held}; the median bound is {ratio:.0f} times the error.",
        f"{_agreed(printed)} printed values and {_agreed(others)} formulas and consistencies agree to the last digit.",
    ]
    if "spheroid" in data["scene"].values and "quadruple, attitude" in data["integrator"].values:
        closed = data.sel(scene="spheroid", integrator="closed form")
        known = closed["horizon"].values[np.isfinite(closed["axis"].values)]
        last = closed.sel(horizon=known.max())
        sentences.append(
            f"On spheroid the closed form in double has an axis error of {float(last['axis']):.1e} rad at t = "
            f"{float(known.max()):g}. This is known from the same formula in 45 digits, whose rounding cannot reach "
            "the sixteenth digit, and the formula from the quadruple-precision integration, which agrees with it to "
            f"{float(data['axis'].sel(scene='spheroid', integrator='quadruple, attitude').max()):.0e}."
        )
    return sentences


STUDY = Study(
    name="truth",
    title="Truth",
    question="How well is the truth known?",
    how_to_read=(
        "Every error elsewhere in this report is measured against these sources. A line is the true error of a source, "
        "the shade above it what it admits to. A bound that lies below its line would be a lie; one far above it would "
        "hide good methods. Points of other figures within ten times of the bound are drawn hollow."
    ),
    cases=cases,
    measure=measure,
    pictures=pictures,
    tables=tables,
    verdict=verdict,
)
