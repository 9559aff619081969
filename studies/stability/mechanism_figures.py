"""The drawing of the mechanisms of failure: six panels, each a mechanism measured alone.

Points at the upper edge of the first panel, x, are runs that ended early. Values below 1e-16 are drawn there.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from symtop.methods.registry import integrators
from symtop.report.style import BLUE, GREEN, GREY, VERMILLION, Look, legend_below, look, panels

from .failures import LOST, SEEN
from .tables import Column

SHOWN = ("midpoint", "trapezoidal", "stormer-verlet", "galerkin-simpson", "strang", "cayley", "gauss-4", "rk4")


def mechanism_panels(data: xr.Dataset) -> Any:
    """Six panels: pole, resonance, sleeping top, separatrix, sampling, solver."""
    figure, axes = panels(2, 3, height=3.1)
    drawings = (
        ("grazing", _pole), ("steady-fast", _resonance), ("sleeping", _sleep),
        ("separatrix", _separatrix), ("goldstein", _sampling), ("goldstein", _solver),
    )  # fmt: skip
    for axis, (scene, draw) in zip(axes.flat, drawings, strict=True):
        if scene in data["scene"].values:
            draw(axis, data.sel(scene=scene))
        else:
            axis.set_visible(False)
    legend_below(figure, axes)
    return figure


def _each(data: xr.Dataset, names: Sequence[str] = SHOWN) -> list[tuple[str, Look, xr.Dataset]]:
    return [(name, look(name), data.sel(integrator=name)) for name in names if name in data["integrator"].values]


def _pole(axis: Any, data: xr.Dataset) -> None:
    for name, style, cell in _each(data):
        x, y = cell[Column.PARAMETER].values, cell[Column.GRAZING_ERROR].values
        axis.plot(x, y, style.marker + "-", color=style.color, ms=0.6 * style.size, markevery=4, lw=1.0, label=name)
        gone = np.isfinite(x) & ~np.isfinite(y)
        axis.plot(x[gone], np.full(int(gone.sum()), 1.0), "x", color=style.color, ms=4.0, mew=0.8)
    axis.plot([], [], "x", color=GREY, ms=4.0, label="run ended early")
    axis.set(xscale="log", yscale="log", xlabel=r"gap $\delta$ to the pole", ylabel="largest axis error (rad)")
    axis.set_title("a pole next to the path")


def _resonance(axis: Any, data: xr.Dataset) -> None:
    for name, style, cell in _each(data):
        # the resonance lies between two points of the grid
        x = np.append(cell[Column.PHASE].values, float(cell[Column.THIRD_TURN_PHASE]))
        y = np.append(cell[Column.SURVIVING].values, float(cell[Column.SURVIVING_AT_THIRD_TURN]))
        x, y = x[np.argsort(x)], y[np.argsort(x)]
        axis.plot(x, y, style.marker + "-", color=style.color, ms=0.6 * style.size, markevery=5, lw=1.0, label=name)
    for place, label in ((3.0**0.5, r"$\sqrt{3}$"), (2.0, "2"), (12.0**0.5, r"$2\sqrt{3}$")):
        axis.axvline(place, color=GREY, lw=0.8, ls=(0, (5, 3)), zorder=1)
        axis.annotate(label, (place, 0.315), fontsize=8, ha="center", va="bottom", annotation_clip=False)
    axis.set(xlabel=r"step, $h\omega$", ylabel="surviving displacement (rad)", ylim=(0.0, 0.31))
    axis.set_title("resonances", pad=16)


def _sleep(axis: Any, data: xr.Dataset) -> None:
    for name, style, cell in _each(data, ("strang", "cayley", "midpoint", "gauss-4", "yoshida-4")):
        x, y = cell[Column.SLEEPING_STEP].values, cell[Column.SLEEPING_THRESHOLD].values
        axis.plot(x, y, style.marker, color=style.color, ms=style.size, label=name)
    x = np.linspace(0.02, 1.0, 60)
    axis.plot(x, np.sqrt(4.0 + x * x), color=GREY, lw=0.9, label=r"$a^2 = 4 + h^2$")
    spins = np.linspace(1.9, 2.0, 400)
    from_step = [(h, spins[np.argmin(np.abs(spins * np.tan(spins * h / 4.0) - h))]) for h in x]
    axis.plot(*zip(*from_step, strict=True), color=GREY, lw=0.9, ls=(0, (5, 3)), label=r"$a \tan(a h/4) = h$")
    axis.set(xlabel="step h", ylabel=r"least spin that sleeps, $a = I_3\omega_3$")
    axis.set_title("the sleeping top")


def _separatrix(axis: Any, data: xr.Dataset) -> None:
    registered = integrators()
    for name in data["integrator"].values:
        cell, style = data.sel(integrator=name), look(str(name))
        main = str(name) in SHOWN
        axis.plot(
            cell[Column.EARLY_ERROR].values, cell[Column.HORIZON].values, style.marker, color=style.color,
            zorder=3 if main else 2, ms=style.size if main else 0.55 * style.size, alpha=1.0 if main else 0.6,
            label=str(name) if main and str(name) in registered else None,
        )  # fmt: skip
    error = np.geomspace(1e-16, 0.1, 50)
    axis.plot(error, SEEN + 2.0 * np.log(LOST / error), color=GREY, lw=0.9, label=r"$6/g + (2/g) \ln(0.1/e)$", zorder=1)
    axis.set(xscale="log", xlabel="axis error e at 6/g (rad)", ylabel="time to an error of 0.1 rad (1/g)")
    axis.set_title("the separatrix")


def _sampling(axis: Any, data: xr.Dataset) -> None:
    for name in data["integrator"].values:
        cell, style = data.sel(integrator=name), look(str(name))
        x, y = float(cell[Column.ENERGY_EVERY]), max(float(cell[Column.ENERGY_ONCE]), 1e-16)
        label = str(name) if str(name) in SHOWN else None
        axis.plot(x, y, style.marker, color=style.color, ms=style.size, label=label)
    ends = np.array([1e-15, 1e-2])
    axis.plot(ends, ends, color=GREY, lw=0.9, zorder=1)
    axis.set(xscale="log", yscale="log", xlabel="largest energy error, every step", ylabel="the same, once a nutation")
    axis.set_title("sampling")


def _solver(axis: Any, data: xr.Dataset) -> None:
    """The midpoint rule, solved by the textbook's iteration and by this package's kernel."""
    energy = data.get(Column.TEXTBOOK_ENERGY)
    if energy is None or energy.isnull().all():
        axis.set_visible(False)
        return
    name = next(name for name in data["integrator"].values if energy.sel(integrator=name).notnull().any())
    cell = data.sel(integrator=name)
    x = cell[Column.SOLVER_TOLERANCE].values
    x = np.where(np.isfinite(x), x, 10.0 * np.nanmax(np.where(np.isfinite(x), x, np.nan)))
    for variable, label, marker, color in (
        (Column.TEXTBOOK_ENERGY, "energy, textbook Newton", "s", VERMILLION),
        (Column.SOLVER_ENERGY, "energy, this package's kernel", "o", BLUE),
        (Column.SOLVER_MOMENTUM, "momenta, this package's kernel", "^", GREEN),
    ):
        axis.plot(x, np.maximum(cell[variable].values, 1e-16), marker + "-", color=color, label=label)
    axis.set(xscale="log", yscale="log", xlabel="solver tolerance", ylabel="largest residual")
    axis.set_title(f"the solver of {name}")
