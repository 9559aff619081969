"""What happens to the constants of the motion over a million steps?"""

import numpy as np
import xarray as xr

from symtop.integrators.registry import integrator, integrators
from symtop.measure.conservation import CONSTANTS, growth, residuals, trend
from symtop.report import figures
from symtop.scenes import added_scenes, scene
from symtop.simulate import simulate
from symtop.study.study import Case, Picture, Study, Table

SCENES = ["spheroid", "goldstein"]
STEPS_A_NUTATION = 118.02
PARTS = ("largest", "rise", "interval", "exponent", "exponent_interval")
SHORTENED = {"radau": 0.02, "taylor-quad": 0.005}  # seconds to minutes otherwise
LABELS = {"energy": "energy", "p_phi": r"$p_\varphi$", "p_psi": r"$p_\psi$"}


def cases(quick: bool) -> list[Case]:
    """A million steps of every fixed-step method, and the same horizon for the adaptive ones at 1e-6."""
    steps = 20_000 if quick else 1_000_000
    grid = []
    for name in [*SCENES, *added_scenes()]:
        horizon = steps * scene(name).nutation_period / STEPS_A_NUTATION
        for method in integrators().values():
            settings = {"horizon": horizon, "samples": 601 if quick else 4001}
            if method.knob == "step_size":
                settings["step_size"] = horizon / steps
            elif method.knob == "tolerance" and method.default_tolerance is None:
                settings["tolerance"] = 1e-6
            settings["horizon"] = horizon * SHORTENED.get(method.name, 1.0)
            grid.append(Case(name, method.name, settings))
    return grid


def measure(case: Case) -> xr.Dataset:
    """Residuals of energy and both momenta of one long run, with their trend and growth."""
    where = scene(case.scene)
    run = simulate(where, integrator(case.integrator), observe="nutation", guard=False, **case.settings)
    time = run["time"].values
    found = {"sample_time": ("sample", time), "outcome": run.attrs["outcome"], "steps": run.attrs["steps"]}
    for name, values in residuals(where, run).items():
        line, power = trend(time, values), growth(time, values)
        found[f"{name}_residual"] = ("sample", values)
        found[f"{name}_largest"] = float(np.nanmax(np.abs(values))) if np.isfinite(values).any() else np.nan
        found[f"{name}_slope"], found[f"{name}_interval"] = line.slope, line.interval
        found[f"{name}_rise"] = line.rise
        found[f"{name}_exponent"], found[f"{name}_exponent_interval"] = power.slope, power.interval
    return xr.Dataset(found)


SHOWN = ("midpoint", "trapezoidal", "stormer-verlet", "strang", "gauss-4", "rk4", "rk45", "taylor")


def pictures(data: xr.Dataset) -> list[Picture]:
    """Residual energy and both residual momenta against time; their size and growth for every method."""
    scenes = [str(name) for name in data["scene"].values]
    known = [name for name in data["integrator"].values if str(name) in SHOWN]
    shown = data.sel(integrator=known or data["integrator"].values)
    rows = [(name, f"|residual {LABELS[name]}| (relative)") for name in CONSTANTS]
    bounded = _flat(shown, "energy")
    history = Picture(
        "residuals",
        figures.residual_history(shown, scenes, rows),
        "Change of energy and of both momenta since the start: single samples as dots, the largest in each window as a "
        f"line. Without a trend in energy beyond its 95 % interval on every scene: {', '.join(bounded) or 'none'}. "
        "The momenta are recomputed from the increments of the trajectory.",
        "Log-log plots of residuals over time, flat for the discrete methods, rising for adaptive Runge-Kutta.",
    )
    columns = [(f"{name}_largest", f"largest residual {LABELS[name]}") for name in CONSTANTS]
    sizes = Picture(
        "sizes",
        figures.dots(data, scenes, columns, log=True),
        "Largest residual of every method over the whole run. Rounding is at 1e-16 (an exact zero is drawn at 1e-17); "
        "what a method keeps stays within "
        "a few hundred of it, what it does not shows its truncation error, and drifts add up to the right.",
        "Dot plot of largest residuals of energy and momenta for every integrator.",
    )
    growths = Picture(
        "exponents",
        figures.dots(data, scenes, [("energy_exponent", "exponent of energy residual ~ t^exponent")], log=False),
        "Growth exponent of the largest energy residual over the last two decades of time, with 95 % intervals: 0 is "
        "bounded, 1/2 the random walk of rounding, 1 a steady drift.",
        "Dot plot of growth exponents of the energy residual for every integrator.",
    )
    return [history, sizes, growths]


def _flat(data: xr.Dataset, quantity: str) -> list[str]:
    slopes, intervals = np.abs(data[f"{quantity}_slope"]), data[f"{quantity}_interval"]
    flat = (slopes <= intervals).all("scene")
    return [str(name) for name in data["integrator"].values[flat.values]]


def _number(value: float) -> str:
    return f"{value:.2e}" if np.isfinite(value) else ""


def tables(data: xr.Dataset) -> list[Table]:
    """Largest residuals, trends and growth exponents."""
    rows = []
    for name in data["scene"].values:
        for method in data["integrator"].values:
            cell = data.sel(scene=name, integrator=method)
            row = [str(name), str(method), str(cell["outcome"].item())]
            for quantity in CONSTANTS:
                values = {part: float(cell[f"{quantity}_{part}"]) for part in PARTS}
                doubt = values["interval"] * float(np.nanmax(cell["sample_time"]))
                row.append(_number(values["largest"]))
                row.append(f"{_number(values['rise'])} +- {_number(doubt)}")
                row.append(f"{values['exponent']:.2f} +- {values['exponent_interval']:.2f}")
            rows.append(row)
    header = ["scene", "integrator", "outcome"]
    for quantity in CONSTANTS:
        header += [f"largest {quantity} residual", f"trend of {quantity} over the run", f"exponent of {quantity}"]
    return [Table("Relative residuals, linear trends with 95 % intervals, and growth ~ t^exponent", header, rows)]


ROUNDING = 3e-13  # relative, over a million steps
LOST = 1e-2  # relative; an error of this size is not kept, however steady
STEADY = 0.25  # an exponent below this is not growth


def kind(cell: xr.Dataset, quantity: str) -> str:
    """Does a method keep a quantity to rounding, within bounds, or not at all? `cell` covers all scenes."""
    if not (cell["outcome"] == "ok").all():
        return "failed"
    largest, exponent = float(cell[f"{quantity}_largest"].max()), float(cell[f"{quantity}_exponent"].max())
    if largest <= ROUNDING:
        return "rounding"
    return "bounded" if exponent <= STEADY and largest <= LOST else "growing"


def verdict(data: xr.Dataset) -> list[str]:
    """Who keeps what, and at what rate the others lose it."""
    sentences = []
    for quantity in CONSTANTS:
        groups: dict[str, list[tuple[float, str, float]]] = {}
        for name in data["integrator"].values:
            cell = data.sel(integrator=name)
            worst, rate = (float(cell[f"{quantity}_{part}"].max()) for part in ("largest", "exponent"))
            groups.setdefault(kind(cell, quantity), []).append((worst, str(name), rate))
        if kept := groups.get("rounding"):
            sentences.append(f"{quantity} stays at rounding with {len(kept)} methods (at most {max(kept)[0]:.1e}).")
        if held := groups.get("bounded"):
            (least, best, _), (most, last, _) = min(held), max(held)
            span = f"from {least:.1e} ({best}) to {most:.1e} ({last})" if len(held) > 1 else f"{most:.1e} ({last})"
            sentences.append(f"{quantity} has a bounded error with {len(held)} methods, {span}.")
        if lost := groups.get("growing"):
            listed = ", ".join(f"{name} (to {worst:.1e}, as t^{rate:.2f})" for worst, name, rate in sorted(lost))
            sentences.append(f"{quantity} is lost with {listed}.")
        if failed := groups.get("failed"):
            sentences.append(f"Runs of {', '.join(name for _, name, _ in failed)} ended early.")
    return sentences


STUDY = Study(
    name="drift",
    title="Drift",
    question="What happens to energy and momenta over a million steps?",
    how_to_read=(
        "A flat line is a bounded error, a line of slope one a steady drift, and a slope of one half the random walk "
        "of rounding. The discrete methods hold a larger but bounded energy error and exact momenta; a Runge-Kutta "
        "method begins with a smaller error and loses everything in time."
    ),
    cases=cases,
    measure=measure,
    pictures=pictures,
    tables=tables,
    verdict=verdict,
)
