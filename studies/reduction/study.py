"""What does modelling less buy?"""

import math
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.ticker import LogLocator, NullLocator

from symtop.measure.accuracy import ladder
from symtop.measure.order import power_law
from symtop.methods.registry import integrator, integrators
from symtop.model.scenes import added_scenes, scene
from symtop.report import style
from symtop.runner.study import Case, Picture, Study, Table

from .commutation import commutation_table, reduced_first
from .tables import TWIN, chart_ratios, chart_table, several_charts, twin_cost, twin_history, twins

SCENES = ["spheroid", "goldstein"]
CHART_PERIODS = 32.0  # long enough that the call itself does not count
STEPS = 10_000  # of the comparison with the unreduced twin
FLOOR = 1e-17  # rad: where an exact zero is drawn
ROUNDING = 1e-13  # rad, over a few thousand steps of two compensated sums
TWIN_ROUNDING = (
    1e-11  # rad, over 10 000 steps without compensation: n^1.5 ulp of theta' h, and phi' is steep near a pole
)
COLORS = (style.BLUE, style.VERMILLION, style.GREEN, style.PURPLE)
ANGLES = {"theta_gap": "theta", "phi_gap": "phi", "psi_gap": "psi"}


def cases(quick: bool) -> list[Case]:
    """Every method that has several charts, every kernel that has a twin, every quadrature rule."""
    grid = []
    for name in [*(SCENES[:1] if quick else SCENES), *added_scenes()]:
        period = scene(name).nutation_period
        several = several_charts()
        for method in several[:6] if quick else several if name == SCENES[0] else []:
            settings = ladder(method, scene(name), CHART_PERIODS * period, 8, 1e5)[1 :: 3 if quick else 2]
            plan = {
                "part": "charts",
                "settings": settings,
                "horizon": CHART_PERIODS * period,
                "batches": 2 if quick else 3,
            }
            grid.append(Case(name, method.name, plan))
        for twin in twins():
            steps = [period / 30.7, period / 307.0]
            plan = {"part": "twins", "horizon": 8.0 * period, "step_sizes": steps, "batches": 3 if quick else 5}
            grid.append(Case(name, twin, plan))
        counts = [round(50 * 2**k) for k in range(4 if quick else 6)]
        grid += [
            Case(name, method.name, {"part": "commutation", "horizon": 2.0 * period, "counts": counts})
            for method in integrators().values()
            if reduced_first(scene(name), method)
        ]
    return grid


def measure(case: Case) -> xr.Dataset:
    """The part of the question that a case asks."""
    where, plan = scene(case.scene), case.settings
    if plan["part"] == "charts":
        return chart_table(where, integrator(case.integrator), plan["settings"], plan["horizon"], plan["batches"])
    if plan["part"] == "twins":
        history = twin_history(where, case.integrator, plan["horizon"], STEPS)
        return history.merge(twin_cost(where, case.integrator, plan["step_sizes"], plan["batches"]))
    return commutation_table(where, integrator(case.integrator), plan["horizon"], plan["counts"])


def uses(case: Case) -> list[str]:
    """The integrators that a case runs: both twins, or the midpoint rule as a witness of commutation."""
    also = {"charts": [], "twins": [case.integrator + TWIN], "commutation": ["midpoint"]}
    return [case.integrator, *also[case.settings["part"]]]


def rows(data: xr.Dataset, variable: str) -> list[tuple[str, str, xr.Dataset]]:
    """Scene, integrator and data of the cells in which a variable was measured."""
    if variable not in data:
        return []
    cells = [
        (str(s), str(m), data.sel(scene=s, integrator=m))
        for s in data["scene"].values
        for m in data["integrator"].values
    ]
    return [(name, method, cell) for name, method, cell in cells if np.isfinite(cell[variable]).any()]


def pictures(data: xr.Dataset) -> list[Picture]:
    """One figure a comparison."""
    drawn = [_draw_commutation(data), _draw_twins(data)]
    return drawn + ([_draw_charts(data)] if rows(data, "seconds") else [])


def _scene_panels(data: xr.Dataset, variable: str) -> tuple[Any, Any, list[str]]:
    names = list(dict.fromkeys(name for name, _, _ in rows(data, variable)))
    figure, axes = style.panels(1, len(names), height=4.0, sharey="row")
    for axis, name in zip(axes.flat, names, strict=True):
        axis.set(xscale="log", yscale="log", title=name)
        axis.xaxis.set_minor_formatter("")
    return figure, axes, names


def _draw_commutation(data: xr.Dataset) -> Picture:
    figure, axes, names = _scene_panels(data, "commutation_gap")
    for name, method, cell in rows(data, "commutation_gap"):
        axis, h, look = axes.flat[names.index(name)], cell["commutation_step_size"].values, style.look(method)
        gap = np.maximum(cell["commutation_gap"].values, FLOOR)
        axis.plot(h, gap, look.marker + "-", color=look.color, label=method)
        if np.isfinite(cell["hamiltonian_gap"]).any():
            gap = np.maximum(cell["hamiltonian_gap"].values, FLOOR)
            axis.plot(h, gap, "x--", color=style.BLACK, label="midpoint, reduced Hamiltonian")
        if method == "trapezoidal":
            span = (float(np.nanmin(h)), float(np.nanmax(h)))
            style.slope_guide(axis, 2.0, span, 3.0 * float(np.nanmin(cell["commutation_gap"])), "$h^2$")
        axis.set_xlabel("step size (s)")
    axes[0, 0].set_ylabel("difference between reducing\nfirst and last, in theta (rad)")
    style.legend_below(figure, axes)
    return Picture(
        "commutation",
        figure,
        f"Reduce, then discretise, against discretise, then reduce: largest difference in theta over two nutations. "
        f"{_orders(data)} Crosses: the midpoint discrete Lagrangian against the implicit midpoint rule on the reduced "
        "Hamiltonian.",
        "Log-log plots of the difference against the step: lines of slope 2 and 4, and flat ones at 1e-16.",
    )


def _orders(data: xr.Dataset) -> str:
    """Which rules commute with the reduction, and how fast the others approach it."""
    same, apart = {}, {}
    for name, method, cell in rows(data, "commutation_gap"):
        largest = float(cell["commutation_gap"].max())
        if largest < ROUNDING:
            same[method] = max(largest, same.get(method, 0.0))
        else:
            apart[method, name] = _slope(cell)
    commuting = ", ".join(f"{method} (within {gap:.1e} rad)" for method, gap in same.items())
    rest = "; ".join(f"{method} on {name} as h^{slope:.2f}" for (method, name), slope in apart.items())
    return f"Commuting with the reduction: {commuting or 'none'}. Differing: {rest or 'none'}."


def _slope(cell: xr.Dataset) -> float:
    return power_law(cell["commutation_step_size"].values[1:], cell["commutation_gap"].values[1:]).slope


def _draw_twins(data: xr.Dataset) -> Picture:
    figure, axes, names = _scene_panels(data, "theta_gap")
    for name, method, cell in rows(data, "theta_gap"):
        axis, look = axes.flat[names.index(name)], style.look(method)
        for (variable, angle), line in zip(ANGLES.items(), ("-", "--", ":"), strict=True):
            gap = np.maximum.accumulate(np.maximum(cell[variable].values, FLOOR))
            axis.plot(cell["sample_time"].values[1:], gap[1:], line, color=look.color, label=f"{angle} of {method}")
        axis.set_xlabel("time (s)")
    axes[0, 0].set_ylabel("largest difference so far (rad)")
    style.legend_below(figure, axes)
    worst = max(float(cell[variable].max()) for _, _, cell in rows(data, "theta_gap") for variable in ANGLES)
    return Picture(
        "twins",
        figure,
        f"Reduced kernels against twins that eliminate nothing, {STEPS} steps over eight nutations: largest difference "
        f"so far in each angle. It never exceeds {worst:.1e} rad: the two are one map, apart from rounding.",
        "Log-log plots of the differences of the three angles against time, growing from 1e-16 to about 1e-12.",
    )


def _draw_charts(data: xr.Dataset) -> Picture:
    found = [(name, method, ratio) for name, method, cell in rows(data, "seconds") for ratio in chart_ratios(cell)]
    labels = list(dict.fromkeys(f"{method}: {ratio.chart}" for _, method, ratio in found))
    scenes = list(dict.fromkeys(name for name, _, _ in found))
    figure, axes = style.panels(1, 2, height=1.6 + 0.26 * len(labels), sharey=True)
    titles = ("time against the smallest chart", "axis error against the smallest chart")
    for axis, quantity, title in zip(axes.flat, ("time", "error"), titles, strict=True):
        for place, name in enumerate(scenes):
            points = [(getattr(r, quantity), labels.index(f"{m}: {r.chart}")) for s, m, r in found if s == name]
            color, marker = COLORS[place % len(COLORS)], "osv^"[place % 4]
            axis.plot(*zip(*points, strict=True), marker, color=color, label=name, ls="none", ms=6)
        axis.axvline(1.0, color=style.GREY, lw=0.9)
        axis.set(xscale="log", yticks=range(len(labels)), yticklabels=labels, ylim=(len(labels) - 0.5, -0.5))
        axis.set_xlabel(title)
        axis.set_xlim(min(0.9, axis.get_xlim()[0]), max(1.1, axis.get_xlim()[1]))
        axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.xaxis.set_major_formatter("{x:g}")
        axis.xaxis.set_minor_locator(NullLocator())
    style.legend_below(figure, axes)
    times = [ratio.time for *_, ratio in found]
    return Picture(
        "charts",
        figure,
        "The same method at the same setting in a larger chart, relative to the smallest chart it has "
        f"({', '.join(sorted({ratio.base for *_, ratio in found}))}): time of a run, and error of the axis. The "
        f"variables that nobody asked for cost a factor of {min(times):.2f} to {max(times):.2f}.",
        "Two dot plots, a row for each integrator and chart: ratios of time and of error to the smallest chart.",
    )


def tables(data: xr.Dataset) -> list[Table]:
    """Charts, twins and the two orders of reducing and discretising, in numbers."""
    charts = [
        [name, method, ratio.chart, ratio.base, f"{ratio.time:.2f}", _number(ratio.error, ".3g")]
        for name, method, cell in rows(data, "seconds")
        for ratio in chart_ratios(cell)
    ]
    pairs, orders = [], []
    for name, method, cell in rows(data, "seconds_per_step"):
        for k, h in enumerate(cell["twin_step_size"].values):
            time, effort = cell["seconds_per_step"].values[:, k] * 1e9, cell["iterations_per_step"].values[:, k]
            cost = [
                f"{time[0]:.0f}",
                f"{time[1]:.0f}",
                f"{time[1] / time[0]:.2f}",
                f"{effort[0]:.2f}",
                f"{effort[1]:.2f}",
            ]
            pairs.append([name, method, f"{h:.3g}", *cost])
    for name, method, cell in rows(data, "commutation_gap"):
        gap, h = cell["commutation_gap"].values, cell["commutation_step_size"].values
        slope = "" if np.nanmax(gap) < ROUNDING else f"{_slope(cell):.3f}"
        orders.append([name, method, f"{np.nanmax(h):.3g}", f"{gap[0]:.2e}", f"{gap[np.isfinite(gap)][-1]:.2e}", slope])
    return [
        Table(
            "A larger chart against the smallest",
            ["scene", "integrator", "chart", "against", "time", "axis error"],
            charts,
        ),
        Table(
            "Reduced kernels and their unreduced twins",
            ["scene", "rule", "step", "ns a step", "ns unreduced", "ratio", "iterations", "iterations unreduced"],
            pairs,
        ),
        Table(
            "Reduce first or last: largest difference in theta",
            ["scene", "rule", "coarsest step", "difference there", "at the finest step", "order in h"],
            orders,
        ),
    ]  # fmt: skip


def _number(value: float, form: str) -> str:
    return format(value, form) if math.isfinite(value) else ""


def verdict(data: xr.Dataset) -> list[str]:
    """One sentence a comparison."""
    sentences = [_orders(data)]
    gaps = [float(cell[variable].max()) for _, _, cell in rows(data, "theta_gap") for variable in ANGLES]
    drift = [float(cell[f"{p}_drift"].max()) for _, _, cell in rows(data, "theta_gap") for p in ("p_phi", "p_psi")]
    cost = [cell["seconds_per_step"].values for _, _, cell in rows(data, "seconds_per_step")]
    ratios = np.concatenate([table[1] / table[0] for table in cost])
    nothing = "nothing but rounding" if max(gaps) < TWIN_ROUNDING else "more than rounding"
    sentences.append(
        f"Eliminating phi and psi changes {nothing}: {max(gaps):.1e} rad in {STEPS} steps, while momenta that nothing "
        f"holds stay within {max(drift):.1e}; it makes a step {ratios.min():.1f} to {ratios.max():.1f} times cheaper."
    )
    found = [(method, ratio) for _, method, cell in rows(data, "seconds") for ratio in chart_ratios(cell)]
    groups: dict[tuple[str, str, str], list[tuple[float, str]]] = {}
    for method, ratio in found:
        family = integrator(method).family
        groups.setdefault((family, ratio.chart, ratio.base), []).append((ratio.time, method))
    for (family, chart, base), times in groups.items():
        middle = float(np.median([time for time, _ in times]))
        sentences.append(
            f"A run in the {chart} chart takes {middle:.2g} times as long as in {base} (median of "
            f"{len({name for _, name in times})} {family} methods)."
        )
    return sentences


STUDY = Study(
    name="reduction",
    title="Reduction",
    question="What does modelling less buy?",
    how_to_read=(
        "Three comparisons. A method that works in several charts runs in each of them at the same setting. A reduced "
        "discrete Lagrangian runs beside a twin that eliminates nothing: their distance is rounding or a mistake. And "
        "eliminating phi and psi before discretising is compared with doing so afterwards: a flat line at 1e-16 means "
        "that the order does not matter, a slope of p that the two are different methods of order p."
    ),
    cases=cases,
    measure=measure,
    pictures=pictures,
    tables=tables,
    verdict=verdict,
    timed=True,
    uses=uses,
)
