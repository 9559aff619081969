"""Six ways to fail, a figure each, with what theory says as a thin grey line.

Points at the upper edge of the figure of the pole, x, are runs that ended early. Values below 1e-16 are drawn there.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import xarray as xr

from symtop.methods.registry import split_name
from symtop.methods.splitting_space import cayley_sleeps_from, strang_sleeps_from
from symtop.report.figures import name_ends
from symtop.report.style import BLUE, GREEN, GREY, LEAST_TEXT, VERMILLION, headline, line, panels
from symtop.runner.study import Picture

from . import messages
from .failures import LOST, SEEN
from .tables import Column
from .words import LEAST_SAMPLED, held_fixed, mechanism_sentences

SHOWN = (
    "midpoint[angles]", "trapezoidal[angles]", "stormer-verlet[angles]", "galerkin-simpson[angles]", "strang[axis]",
    "cayley[axis]", "gauss-4[angles]", "gauss-4[axis]", "rk4[angles]", "rk4[axis]",
)  # fmt: skip
PLACED = ("stormer-verlet[angles]", "midpoint[angles]", "rk4[axis]", "strang[axis]", "gauss-4[axis]")
GUIDE = {"color": GREY, "lw": 0.9, "zorder": 1}
FLOOR = 1e-16  # what is smaller is drawn here
NOTE = {"fontsize": LEAST_TEXT, "color": "#444444"}


def pictures(data: xr.Dataset) -> list[Picture]:
    """The figures of the mechanisms that the dataset has something for."""
    return [
        _picture(data, scene, name, draw)
        for name, (scene, variable, draw) in DRAWINGS.items()
        if scene in data["scene"].values and variable in data and np.isfinite(data[variable].sel(scene=scene)).any()
    ]


def _picture(data: xr.Dataset, scene: str, name: str, draw: Callable[[Any, xr.Dataset], None]) -> Picture:
    figure, axes = panels(1, 1, height=2.7)
    part = data.sel(scene=scene)
    draw(axes[0, 0], part)
    said = messages.of_mechanism(name, part)
    headline(figure, said)
    caption = " ".join([held_fixed(data, name), *mechanism_sentences(data, name)])
    return Picture(f"mechanism-{name}", figure, caption, f"{ALTS[name]} {said}")


def _each(data: xr.Dataset, variable: str, names: Sequence[str] = SHOWN) -> list[tuple[str, xr.Dataset]]:
    """The rows of those names that have a value of a variable, with their cells."""
    known = [name for name in names if name in data["integrator"].values]
    cells = [(name, data.sel(integrator=name)) for name in known]
    return [(name, cell) for name, cell in cells if np.isfinite(cell[variable].values).any()]


def _pole(axis: Any, data: xr.Dataset) -> None:
    ends = {}
    for name, cell in _each(data, Column.GRAZING_ERROR):
        x, y = cell[Column.PARAMETER].values, np.maximum(cell[Column.GRAZING_ERROR].values, FLOOR)
        every = max(1, int(np.isfinite(x).sum()) // 10)
        marks = line(name)
        axis.plot(x, y, **marks, markevery=every)
        gone = np.isfinite(x) & ~np.isfinite(y)
        axis.plot(x[gone], np.full(int(gone.sum()), 1.0), "x", color=marks["color"], ms=3.5, mew=0.8)
        last = int(np.flatnonzero(np.isfinite(y))[-1])
        ends[name] = float(x[last]), float(y[last]), str(marks["color"])
    axis.set(xscale="log", yscale="log", xlabel=r"gap $\delta$ to the pole (rad)", ylabel="largest axis error (rad)")
    axis.text(0.02, 0.9, "x: run ended early", transform=axis.transAxes, va="top", **NOTE)
    name_ends(axis, ends)


def _resonance(axis: Any, data: xr.Dataset) -> None:
    ends = {}
    for name, cell in _each(data, Column.SURVIVING):
        # the resonance lies between two points of the grid
        x = np.append(cell[Column.PHASE].values, float(cell[Column.THIRD_TURN_PHASE]))
        y = np.append(cell[Column.SURVIVING].values, float(cell[Column.SURVIVING_AT_THIRD_TURN]))
        good = np.isfinite(x) & np.isfinite(y)
        order = np.argsort(x[good])
        x, y = x[good][order], y[good][order]
        marks = line(name)
        axis.plot(x, y, **marks, markevery=5)
        ends[name] = float(x[-1]), float(y[-1]), str(marks["color"])
    axis.set(xlabel=r"step, $h\omega$", ylabel="surviving displacement (rad)", ylim=(0.0, 0.33))
    for place, label in ((3.0**0.5, r"$\sqrt{3}$"), (2.0, "2"), (12.0**0.5, r"$2\sqrt{3}$")):
        axis.axvline(place, color=GREY, lw=0.8, ls=(0, (5, 3)), zorder=1)
        axis.annotate(label, (place, 0.33), (2, -2), textcoords="offset points", va="top", **NOTE)
    name_ends(axis, ends)


def _sleep(axis: Any, data: xr.Dataset) -> None:
    rows = [str(name) for name in data["integrator"].values if split_name(str(name))[0] in messages.SLEEPERS]
    for name, cell in _each(data, Column.SLEEPING_THRESHOLD, rows):
        x, y = cell[Column.SLEEPING_STEP].values, cell[Column.SLEEPING_THRESHOLD].values
        axis.plot(x, y, **(line(name, 1.4) | {"ls": "none"}), label=name)
    x = np.linspace(0.02, 1.0, 60)
    for law, dash, label in (
        (cayley_sleeps_from, "-", r"$a^2 = 4 + h^2$"), (strang_sleeps_from, (0, (5, 3)), r"$a \tan(a h/4) = h$"),
    ):  # fmt: skip
        axis.plot(x, [law(h) for h in x], ls=dash, label=label, **GUIDE)
    axis.set(xlabel="step h (with I1 = I3 = mgl = 1)", ylabel=r"least spin that sleeps, $a = I_3\omega_3$")
    axis.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), frameon=False)


def _separatrix(axis: Any, data: xr.Dataset) -> None:
    for name in map(str, data["integrator"].values):
        x, y = (data[key].sel(integrator=name).values for key in (Column.EARLY_ERROR, Column.HORIZON))
        marks = line(name)
        named = name in PLACED and np.isfinite(y).any()
        other = {"color": GREY, "alpha": 0.5, "ms": 2.0, "zorder": 2}
        look = {"color": marks["color"], "ms": 1.2 * marks["ms"], "zorder": 3} if named else other
        axis.plot(x, y, marks["marker"], fillstyle=marks["fillstyle"], label=name if named else None, **look)
    error = np.geomspace(1e-16, 0.1, 50)
    axis.plot(error, SEEN + 2.0 * np.log(LOST / error), label=r"$6/g + (2/g) \ln(0.1/e)$", **GUIDE)
    axis.plot([], [], "o", color=GREY, ms=2.0, alpha=0.5, label="all other rows")
    axis.set(xscale="log", xlabel="axis error e at 6/g (rad)", ylabel="time to an error of 0.1 rad (1/g)")
    axis.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), frameon=False)


def _sampling(axis: Any, data: xr.Dataset) -> None:
    ends = {}
    for name in map(str, data["integrator"].values):
        once, every = (float(data[key].sel(integrator=name)) for key in (Column.ENERGY_ONCE, Column.ENERGY_EVERY))
        marks = line(name)
        if not np.isfinite(once + every):
            continue
        look = {"color": marks["color"], "zorder": 3} if name in PLACED else {"color": GREY, "alpha": 0.5, "zorder": 2}
        size = 1.3 * marks["ms"] if name in PLACED else 2.5
        axis.plot(every, max(once, FLOOR), marks["marker"], fillstyle=marks["fillstyle"], ms=size, **look)
        if name in PLACED:
            ends[name] = every, max(once, FLOOR), str(marks["color"])
    axis.axhspan(0.0, LEAST_SAMPLED, color=GREY, alpha=0.15, lw=0)
    axis.plot([1e-15, 1e-2], [1e-15, 1e-2], **GUIDE)
    axis.set(xscale="log", yscale="log", ylabel="the same, sampled once a nutation")
    axis.set_xlabel("largest relative energy error, sampled at every step")
    axis.annotate("below rounding", (0.99, LEAST_SAMPLED), (0, -2), xycoords=("axes fraction", "data"),
                  textcoords="offset points", ha="right", va="top", **NOTE)  # fmt: skip
    axis.annotate("equal", (1e-3, 1e-3), (-4, 2), textcoords="offset points", ha="right", **NOTE)
    name_ends(axis, ends)


def _solver(axis: Any, data: xr.Dataset) -> None:
    """The midpoint rule, solved by the textbook's iteration and by this package's kernel."""
    energy = data[Column.TEXTBOOK_ENERGY]
    cell = data.isel(integrator=int(np.argmax(energy.notnull().any("tolerance_setting").values)))
    x = cell[Column.SOLVER_TOLERANCE].values
    x = np.where(np.isfinite(x), x, 10.0 * np.nanmax(np.where(np.isfinite(x), x, np.nan)))
    ends = {}
    for variable, label, marker, color, dash in (
        (Column.TEXTBOOK_ENERGY, "energy, textbook Newton", "s", VERMILLION, "-"),
        (Column.SOLVER_ENERGY, "energy, this package's kernel", "o", BLUE, (0, (4, 1.5))),
        (Column.SOLVER_MOMENTUM, "momenta, this package's kernel", "^", GREEN, ":"),
    ):
        y = np.maximum(cell[variable].values, FLOOR)
        axis.plot(x, y, marker=marker, color=color, ls=dash)
        last = int(np.argmax(x))
        ends[label] = float(x[last]), float(y[last]), color
    axis.set(xscale="log", yscale="log", xlabel=f"solver tolerance of {cell['integrator'].values}, step fixed")
    axis.set_ylabel("largest relative residual")
    name_ends(axis, ends)


DRAWINGS: dict[str, tuple[str, str, Callable[[Any, xr.Dataset], None]]] = {  # scene, variable it needs, drawing
    "pole": ("grazing", Column.GRAZING_ERROR, _pole),
    "resonances": ("steady-fast", Column.SURVIVING, _resonance),
    "sleeping": ("sleeping", Column.SLEEPING_THRESHOLD, _sleep),
    "separatrix": ("separatrix", Column.HORIZON, _separatrix),
    "sampling": ("goldstein", Column.ENERGY_ONCE, _sampling),
    "solver": ("goldstein", Column.TEXTBOOK_ENERGY, _solver),
}
ALTS = {
    "pole": "Log-log plot of the axis error against the gap to a pole.",
    "resonances": "Plot of the displacement that survives against the step.",
    "sleeping": "Plot of the least sleeping spin against the step, with two laws.",
    "separatrix": "Plot of the accurate time against the early error, with a logarithmic law.",
    "sampling": "Log-log plot of energy errors sampled once a nutation against those of every step.",
    "solver": "Log-log plot of residuals against the solver's tolerance.",
}
