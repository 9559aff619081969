"""Which method is the fastest at the accuracy I need?"""

import numpy as np
import xarray as xr

from symtop.integrators.registry import integrator, integrators
from symtop.measure.accuracy import error_table, ladder
from symtop.measure.errors import QUANTITIES
from symtop.measure.timing import BATCH, time_settings
from symtop.report import figures
from symtop.scenes import added_scenes, scene
from symtop.study.study import Case, Picture, Study, Table

SCENES = ["spheroid", "goldstein", "fast"]
PERIODS = 10.0
TARGETS = (1e-3, 1e-6, 1e-9, 1e-12)
COSTS = {"seconds": "wall time of one run (s)", "force_evaluations": "force evaluations"}


def cases(quick: bool) -> list[Case]:
    """Every method on every scene over ten nutation periods, from coarse to the limit of its arithmetic."""
    grid, size = [], (5, 1e5) if quick else (7, 4e5)
    for name in [*(SCENES[:2] if quick else SCENES), *added_scenes()]:
        where = scene(name)
        horizon = PERIODS * where.nutation_period
        for method in integrators().values():
            settings = {"horizon": horizon, "settings": ladder(method, where, horizon, *size), "quick": quick}
            grid.append(Case(name, method.name, settings))
    return grid


def measure(case: Case) -> xr.Dataset:
    """Errors from one set of runs, seconds from another."""
    where, method, options = scene(case.scene), integrator(case.integrator), case.settings
    table = error_table(where, method, options["settings"], options["horizon"], observe="axis")
    ran = [value for value, how in zip(options["settings"], table["outcome"].values, strict=True) if how != "not_run"]
    batches, batch = (2, 0.002) if options["quick"] else (3, BATCH)
    timed = time_settings(where, method, ran, options["horizon"], "axis", batches, batch)
    return xr.merge([table, timed.pad(setting=(0, table.sizes["setting"] - timed.sizes["setting"]))])


def pictures(data: xr.Dataset) -> list[Picture]:
    """Axis error against seconds and against force evaluations, and energy error against seconds."""
    scenes = [str(name) for name in data["scene"].values]
    drawn = []
    for cost, quantity in (("seconds", "axis"), ("force_evaluations", "axis"), ("seconds", "energy")):
        judged = {
            (name, str(method)): data[quantity].sel(scene=name, integrator=method).values
            > 10.0 * data[f"{quantity}_bound"].sel(scene=name, integrator=method).values
            for name in scenes
            for method in data["integrator"].values
        }
        leaders = leading(data, cost, quantity)
        faint = [str(method) for method in data["integrator"].values if str(method) not in leaders]
        labels = (COSTS[cost], f"largest {QUANTITIES[quantity]}")
        figure, _ = figures.error_curves(data, scenes, cost, quantity, labels, judged, faint)
        others = f" The other {len(faint)} methods are thin lines in the colour of their family." if faint else ""
        drawn.append(
            Picture(
                f"{quantity}-{cost.replace('_', '-')}",
                figure,
                f"Largest {quantity} error over {PERIODS:g} nutation periods against {COSTS[cost]}. Best is towards "
                "the lower left. Dashed: the inner loop runs in plain Python, not compiled. Hollow: within ten "
                f"times of the reference's own bound (grey band).{others}",
                f"Log-log work-precision plots of {quantity} error against {COSTS[cost]}, one panel a scene.",
            )
        )
    return drawn


SHOWN = ("midpoint", "trapezoidal", "stormer-verlet", "rk45", "taylor")
MOST_SHOWN = 14


def leading(data: xr.Dataset, cost: str, quantity: str) -> list[str]:
    """The five basic methods and those with most points on the front of least cost and error, over all scenes."""
    points = {str(method): 0 for method in data["integrator"].values}
    for name in data["scene"].values:
        cell = data.sel(scene=name)
        front = figures.pareto(cell[cost].values, cell[quantity].values)
        for method, row in zip(data["integrator"].values, front, strict=True):
            points[str(method)] += int(row.sum())
    best = [method for method in sorted(points, key=lambda name: -points[name]) if points[method]]
    return list(dict.fromkeys([*SHOWN, *best]))[:MOST_SHOWN]


def cheapest(data: xr.Dataset, name: str, target: float, quantity: str = "axis") -> list[tuple[float, str, str, bool]]:
    """Methods that reach a target on a scene, cheapest first: (seconds, method, tier, reliable)."""
    found = []
    for method in data["integrator"].values:
        cell = data.sel(scene=name, integrator=method)
        good = (cell[quantity].values <= target) & np.isfinite(cell["seconds"].values)
        if good.any():
            best = int(np.flatnonzero(good)[np.argmin(cell["seconds"].values[good])])
            reliable = bool(cell["reliable"].values[best])
            found.append((float(cell["seconds"].values[best]), str(method), str(cell["tier"].values[best]), reliable))
    return sorted(found)


def _seconds(value: float) -> str:
    return f"{value * 1e6:.3g} us" if value < 1e-3 else f"{value * 1e3:.3g} ms" if value < 1.0 else f"{value:.3g} s"


def tables(data: xr.Dataset) -> list[Table]:
    """The fastest method for each scene and target, and every method's cost."""
    winners, costs = [], []
    for name in data["scene"].values:
        row = [str(name)]
        for target in TARGETS:
            best = cheapest(data, str(name), target)
            row.append(f"{best[0][1]} ({best[0][2]}), {_seconds(best[0][0])}" if best else "nobody")
        winners.append(row)
        for method in data["integrator"].values:
            alone = data.sel(integrator=[method])
            reached = [cheapest(alone, str(name), target) for target in TARGETS]
            costs.append(
                [str(name), str(method), *(_seconds(best[0][0]) if best else "not reached" for best in reached)]
            )
    header = [f"axis error {target:.0e}" for target in TARGETS]
    return [
        Table(f"Fastest method to an axis error over {PERIODS:g} nutation periods", ["scene", *header], winners),
        Table("Time of every method to the same errors", ["scene", "integrator", *header], costs),
    ]


def verdict(data: xr.Dataset) -> list[str]:
    """The fastest method for each scene and target, and by how much."""
    sentences = []
    for name in data["scene"].values:
        parts = []
        for target in TARGETS:
            best = cheapest(data, str(name), target)
            if not best:
                parts.append(f"{target:.0e}: nobody")
                continue
            margin = ""
            if len(best) > 1:
                ratio = best[1][0] / best[0][0]
                sure = best[0][3] and best[1][3] and ratio > 1.25
                margin = f", {ratio:.1f} times ahead of {best[1][1]}" if sure else f", level with {best[1][1]}"
            parts.append(f"{target:.0e}: {best[0][1]} in {_seconds(best[0][0])}{margin}")
        sentences.append(f"{name}, axis error " + "; ".join(parts) + ".")
    slow = [str(m) for m in data["integrator"].values if "python" in data["tier"].sel(integrator=m).values]
    if slow:
        sentences.append(
            f"{', '.join(slow)} run their inner loop in plain Python; compare them with the compiled methods by force "
            "evaluations, not by seconds."
        )
    count = int(np.sum(~np.isnan(data["seconds"].values)))
    doubtful = int(np.sum(data["reliable"].values == 0.0))
    sentences.append(
        f"{doubtful} of {count} timings were too noisy to rank by." if doubtful else f"All {count} timings were steady."
    )
    return sentences


STUDY = Study(
    name="work_precision",
    title="Work and precision",
    question="Which method is the fastest at the accuracy I need?",
    how_to_read=(
        "Choose the error you can live with on the vertical axis and go right to the first curve. Seconds include the "
        "call of the compiled loop, about twenty microseconds, so all curves bend where runs are that short. A force "
        "evaluation is one evaluation of the equations of motion: a Newton iteration at one node, a kick, a stage, or "
        "one derivative of a Taylor series, which costs more the higher it is."
    ),
    cases=cases,
    measure=measure,
    pictures=pictures,
    tables=tables,
    verdict=verdict,
    timed=True,
)
