"""At what rate does the error fall with the step?"""

import numpy as np
import xarray as xr

from symtop.measure.accuracy import error_table, step_ladder
from symtop.measure.errors import QUANTITIES
from symtop.measure.order import Fit, order
from symtop.methods.registry import integrator, integrators
from symtop.model.scenes import added_scenes, scene
from symtop.report import figures, style
from symtop.runner.study import Case, Picture, Study, Table

SCENES = ["spheroid", "goldstein", "loop", "hairer-lubich-wanner"]
BASIC = ("midpoint", "trapezoidal", "stormer-verlet")
JUDGED = ("attitude", "theta", "energy")
LARGE = 0.01  # radians: larger errors follow no power of the step
STEEP = 8  # the guide of a higher order would fall out of the figure over the width of one of a lower


def cases(quick: bool) -> list[Case]:
    """Every fixed-step method on every scene, ten steps a nutation down to round-off."""
    grid = []
    for name in [*(SCENES[:2] if quick else SCENES), *added_scenes()]:
        where = scene(name)
        horizon = min(where.horizon, 8.0 * where.nutation_period) if name != "spheroid" else where.horizon
        for method in integrators().values():
            if method.knob == "step_size":
                steps = step_ladder(method, where, horizon, *((8, 1e5) if quick else (17,)))
                grid.append(Case(name, method.name, {"horizon": horizon, "step_sizes": steps}))
    return grid


def measure(case: Case) -> xr.Dataset:
    """The error table of one method on one scene."""
    where, method = scene(case.scene), integrator(case.integrator)
    return error_table(where, method, case.settings["step_sizes"], case.settings["horizon"], observe="attitude")


def fits(data: xr.Dataset, quantity: str) -> dict[tuple[str, str], Fit]:
    """The fitted order of every method on every scene."""
    found, declared = {}, integrators()
    for name in data["scene"].values:
        omega = 2.0 * np.pi / scene(str(name)).nutation_period
        for method in data["integrator"].values:
            cell = data.sel(scene=name, integrator=method)
            claim = declared[str(method)].order if str(method) in declared else None
            found[str(name), str(method)] = order(
                cell["step_size"].values, cell[quantity].values, cell[f"{quantity}_bound"].values, omega, claim
            )
    return found


def pictures(data: xr.Dataset) -> list[Picture]:
    """Attitude error against the step, a figure for each declared order; energy error of second-order methods."""
    declared = integrators()
    groups: dict[int, list[str]] = {}
    for name in data["integrator"].values:
        claim = declared[str(name)].order if str(name) in declared else None
        groups.setdefault(claim or 0, []).append(str(name))
    drawn = [_picture(data.sel(integrator=names), "attitude", power) for power, names in sorted(groups.items())]
    if 2 in groups:
        drawn.append(_picture(data.sel(integrator=groups[2]), "energy", 2))
    return drawn


def _constants(cell: xr.Dataset, quantity: str, power: int) -> list[float]:
    """Where a guide may lie if no order could be fitted: error / h^power where it is neither large nor rounding."""
    h, error, bound = (cell[name].values for name in ("step_size", quantity, f"{quantity}_bound"))
    good = (error < LARGE) & (error > 100.0 * bound) & np.isfinite(h)
    return [float(value) for value in (error[good] / h[good] ** power).ravel()]


def _picture(data: xr.Dataset, quantity: str, power: int) -> Picture:
    scenes = [str(name) for name in data["scene"].values]
    orders = fits(data, quantity)
    labels = ("step size (s)", f"largest {QUANTITIES[quantity]}")
    judged = {key: fit.used for key, fit in orders.items()}
    figure, axes = figures.error_curves(data, scenes, "step_size", quantity, labels, judged)
    for axis, name in zip(axes.flat, scenes, strict=False):
        fitted = [fit.constant for (where, _), fit in orders.items() if where == name and np.isfinite(fit.slope)]
        constants = fitted or _constants(data.sel(scene=name), quantity, power)
        if power and constants:
            coarse = float(np.nanmax(data["step_size"].sel(scene=name).values))
            width, below = (0.2, 0.15) if power < STEEP else (0.5, 0.02)
            ends = (width * coarse, coarse)
            style.slope_guide(axis, power, ends, below * min(constants) * ends[0] ** power, f"$h^{{{power}}}$")
    slopes = [fit.slope for fit in orders.values() if np.isfinite(fit.slope)]
    range_ = (
        f"Fitted orders lie between {min(slopes):.3f} and {max(slopes):.3f}." if slopes else "None could be fitted."
    )
    title = f"methods of order {power}" if power else "methods of unknown order"
    return Picture(
        f"{quantity}-order-{power}",
        figure,
        f"Largest {quantity} error over the run against the step, {title}. Filled points enter the fit; hollow ones "
        f"are too large, not yet on a line, or within ten times of the reference's own error (grey band). {range_}",
        f"Log-log plots of {quantity} error against step size, {title}: straight lines parallel to the guide.",
    )


def tables(data: xr.Dataset) -> list[Table]:
    """Fitted orders, declared beside measured, and the error constants."""
    declared = integrators()
    rows = []
    by_quantity = {quantity: fits(data, quantity) for quantity in JUDGED}
    ends = fits(data.assign(attitude=data["attitude_end"]), "attitude")
    for name in data["scene"].values:
        for method in data["integrator"].values:
            key = (str(name), str(method))
            shown = [str(by_quantity[quantity][key]) for quantity in JUDGED]
            claim = declared[key[1]].order if key[1] in declared else None
            constant = ends[key].constant
            rows.append([*key, str(claim or "unknown"), *shown, f"{constant:.4g}" if np.isfinite(constant) else ""])
    header = [
        "scene",
        "integrator",
        "declared",
        *(f"order in {q}" for q in JUDGED),
        "C in attitude error C h^p at the end",
    ]
    return [Table("Fitted orders with 95 % intervals", header, rows)]


def verdict(data: xr.Dataset) -> list[str]:
    """Whether every declared order was measured."""
    declared, wrong, right = integrators(), [], 0
    found = fits(data, "attitude")
    for (name, method), fit in found.items():
        claim = declared[method].order if method in declared else None
        if not np.isfinite(fit.slope) or claim is None:
            continue
        if abs(fit.slope - claim) > max(0.05, 0.03 * claim):
            wrong.append(f"{method} on {name} shows order {fit} where {claim} is declared")
        else:
            right += 1
    sentences = [f"{right} of {len(found)} pairs of method and scene show the order that the method declares."]
    if wrong:
        sentences.append(f"Refuted: {'; '.join(wrong)}.")
    reasons: dict[str, list[str]] = {}
    for (name, method), fit in found.items():
        if fit.reason:
            reasons.setdefault(fit.reason, []).append(f"{method} on {name}")
    sentences += [f"Not judged, because {reason}: {', '.join(pairs)}." for reason, pairs in reasons.items()]
    ends = fits(data.assign(attitude=data["attitude_end"]), "attitude")
    for method in BASIC:
        fit = ends.get(("spheroid", method))
        if fit is not None and np.isfinite(fit.slope):
            sentences.append(
                f"On spheroid at t = 8 the attitude error of {method} is {fit.constant:.4g} h^{fit.slope:.2f}."
            )
    return sentences


STUDY = Study(
    name="convergence",
    title="Convergence",
    question="At what rate does the error fall with the step?",
    how_to_read=(
        "Both axes are logarithmic, so a method of order p is a straight line of slope p. A line that bends at the "
        "top is not yet asymptotic; one that flattens at the bottom has met rounding or the grey band, below "
        "which the reference cannot judge."
    ),
    cases=cases,
    measure=measure,
    pictures=pictures,
    tables=tables,
    verdict=verdict,
)
