"""Six ways to fail, a figure each, with what theory says as a thin grey line.

In the figure of the pole the runs that ended early are crosses above the errors, a line a method. Values below 1e-16
are drawn there.
"""

import textwrap
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.ticker import NullLocator

from symtop.methods.registry import split_name
from symtop.methods.splitting_space import cayley_sleeps_from, strang_sleeps_from
from symtop.report.figures import name_ends
from symtop.report.style import BLUE, GREEN, GREY, LEAST_TEXT, VERMILLION, headline, line, panels
from symtop.runner.study import Picture

from . import messages
from .failures import LOST, SEEN
from .tables import Column
from .words import LEAST_SAMPLED, held_fixed, mechanism_sentences, outlasting, resonant

SHOWN = (
    "midpoint[angles]", "trapezoidal[angles]", "stormer-verlet[angles]", "galerkin-simpson[angles]", "strang[axis]",
    "cayley[axis]", "gauss-4[angles]", "gauss-4[axis]", "rk4[angles]", "rk4[axis]",
)  # fmt: skip
PLACED = ("stormer-verlet[angles]", "midpoint[angles]", "rk4[axis]", "strang[axis]", "gauss-4[axis]")
GUIDE = {"color": GREY, "lw": 0.9, "zorder": 1}
ENDED = 4.0  # rad, above any error: runs that ended early are drawn over it
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
    ends, height = {}, ENDED
    for name, cell in _each(data, Column.GRAZING_ERROR):
        x, y = cell[Column.PARAMETER].values, np.maximum(cell[Column.GRAZING_ERROR].values, FLOOR)
        every = max(1, int(np.isfinite(x).sum()) // 10)
        marks = line(name)
        axis.plot(x, y, **marks, markevery=every)
        gone = np.isfinite(x) & ~np.isfinite(y)
        if gone.any():
            height *= 2.2
            axis.plot(x[gone][::3], np.full(int(gone.sum()), height)[::3], "x", color=marks["color"], ms=3.5, mew=0.8)
        last = int(np.flatnonzero(np.isfinite(y))[-1])
        ends[name] = float(x[last]), float(y[last]), str(marks["color"])
    axis.set(xscale="log", yscale="log", xlabel=r"gap $\delta$ to the pole (rad)", ylabel="largest axis error (rad)")
    if height > ENDED:
        axis.axhline(ENDED, **GUIDE)
        axis.text(0.02, 0.6 * ENDED, "crosses: ended early, no error to show", va="top",
                  transform=axis.get_yaxis_transform(), **NOTE)  # fmt: skip
        axis.set_ylim(top=3.0 * height)
        powers = np.arange(np.floor(np.log10(axis.get_ylim()[0])) + 1, 1)
        axis.set_yticks(10.0**powers)
        axis.yaxis.set_minor_locator(NullLocator())
    name_ends(axis, ends)


def _resonance(axis: Any, data: xr.Dataset) -> None:
    ends, ringed = {}, resonant(data)
    for name, cell in _each(data, Column.SURVIVING):
        # the resonance lies between two points of the grid
        x = np.append(cell[Column.PHASE].values, float(cell[Column.THIRD_TURN_PHASE]))
        y = np.append(cell[Column.SURVIVING].values, float(cell[Column.SURVIVING_AT_THIRD_TURN]))
        good = np.isfinite(x) & np.isfinite(y)
        order = np.argsort(x[good])
        x, y = x[good][order], y[good][order]
        marks = line(name)
        axis.plot(x, y, **marks, markevery=5, clip_on=False)
        if name in ringed:
            axis.plot(ringed[name], float(cell[Column.SURVIVING_AT_THIRD_TURN]), "o", ms=11, mfc="none", mec="black",
                      mew=0.9, clip_on=False, zorder=5)  # fmt: skip
        ends[name] = float(x[-1]), float(y[-1]), str(marks["color"])
    most = float(np.nanmax(data[Column.SURVIVING].values))
    axis.set(xlabel=r"step $h\omega$ (times the frequency of the nutation)", ylabel="displacement that survives (rad)")
    axis.set_ylim(0.0, 1.2 * most)
    limit, third = "2: Verlet's linear limit", r"$2\sqrt{3}$: midpoint"
    for place, label, side, shift in (
        (3.0**0.5, r"$\sqrt{3}$: Verlet", "right", -2), (2.0, limit, "left", 2), (12.0**0.5, third, "left", 2),
    ):  # fmt: skip
        axis.axvline(place, color=GREY, lw=0.8, ls=(0, (5, 3)), zorder=1)
        axis.annotate(label, (place, 1.2 * most), (shift, -2), textcoords="offset points", va="top", ha=side, **NOTE)
    axis.annotate(f"{most:.2g} rad is the largest tried", (0.01, most), (0, 4), textcoords="offset points",
                  xycoords=axis.get_yaxis_transform(), **NOTE)  # fmt: skip
    axis.annotate("ringed: the nutation turns\nby a third a step", (0.01, 0.03), xycoords="axes fraction", **NOTE)
    name_ends(axis, ends)


def _sleep(axis: Any, data: xr.Dataset) -> None:
    rows = [str(name) for name in data["integrator"].values if split_name(str(name))[0] in messages.SLEEPERS]
    for name, cell in _each(data, Column.SLEEPING_THRESHOLD, rows):
        x, y = cell[Column.SLEEPING_STEP].values, cell[Column.SLEEPING_THRESHOLD].values
        axis.plot(x, y, **(line(name, 1.4) | {"ls": "none"}), label=name)
    x = np.linspace(0.02, 1.0, 60)
    for law, method, label in (
        (cayley_sleeps_from, "cayley", r"theory: $a^2 = 4 + h^2$"),
        (strang_sleeps_from, "strang", r"theory: $a\,\mathrm{tan}\,(a h/4) = h$"),
    ):
        axis.plot(x, [law(h) for h in x], ls=line(method)["ls"], color=line(method)["color"], lw=0.9, label=label)
    axis.set(xlabel="step $h$ (with $I_1 = I_3 = mgl = 1$)", ylabel=r"least spin that sleeps, $a = I_3\omega_3$")
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
    axis.plot(error, SEEN + 2.0 * np.log(LOST / error), label=r"theory: $(6 + 2\,\ln\,(0.1/e))/\lambda$", **GUIDE)
    axis.plot([], [], ".", color=GREY, ms=4.0, alpha=0.5, label="all other methods")
    axis.set(xscale="log", xlabel=rf"axis error $e$ at the time ${SEEN:g}/\lambda$ (rad), $\lambda = \sqrt{{mgl/I_1}}$")
    axis.set(ylabel=f"time to an error of {LOST:g} rad ($1/\\lambda$)")
    if apart := outlasting(data):
        late = data[Column.HORIZON].sel(integrator=apart)
        listed = textwrap.fill(", ".join(apart), 40)
        axis.annotate(f"longer than predicted:\n{listed}", (0.98, float(late.max())), (0, -14), va="top", ha="right",
                      xycoords=axis.get_yaxis_transform(), textcoords="offset points", **NOTE)  # fmt: skip
    axis.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), frameon=False)


def _sampling(axis: Any, data: xr.Dataset) -> None:
    worst, hidden = messages.worst_sampled(data), messages.hidden_sampled(data)
    for name in map(str, data["integrator"].values):
        once, every = (float(data[key].sel(integrator=name)) for key in (Column.ENERGY_ONCE, Column.ENERGY_EVERY))
        marks = line(name)
        if not np.isfinite(once + every):
            continue
        if name in (*PLACED, worst):
            look = {"color": marks["color"], "zorder": 3, "ms": 1.3 * marks["ms"], "label": name}
            axis.plot(every, max(once, FLOOR), marks["marker"], fillstyle=marks["fillstyle"], **look)
        else:
            color = "black" if name in hidden else GREY
            axis.plot(every, max(once, FLOOR), ".", color=color, ms=4.0, alpha=0.6, zorder=2)
    if hidden:
        axis.plot([], [], ".", color="black", ms=4.0, alpha=0.6, label="other, its error not seen")
    axis.plot([], [], ".", color=GREY, ms=4.0, alpha=0.6, label="all other methods")
    axis.axhspan(0.0, LEAST_SAMPLED, color=GREY, alpha=0.15, lw=0)
    axis.plot([1e-15, 1e-2], [1e-15, 1e-2], **GUIDE)
    axis.set(xscale="log", yscale="log", ylabel="the same, sampled once a nutation")
    axis.set_xlabel("largest relative energy error, sampled at every step")
    axis.annotate("rounding: nothing is seen here\n(zeros are drawn at $10^{-16}$)", (0.99, 0.01), va="bottom",
                  xycoords="axes fraction", ha="right", **NOTE)  # fmt: skip
    axis.annotate("equal", (1e-3, 1e-3), (-4, 2), textcoords="offset points", ha="right", **NOTE)
    axis.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), frameon=False)


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
    axis.set_ylabel("largest relative change")
    loose = x[np.isclose(cell[Column.TEXTBOOK_ENERGY].values, float(cell[Column.ONE_ITERATION_ENERGY]), rtol=1e-3)]
    if loose.size:
        axis.axvspan(loose.min() / 2.0, x.max() * 2.0, color=GREY, alpha=0.12, lw=0)
        axis.annotate("the textbook's stops\nafter one iteration;\nlast point: no tolerance", (x.max() * 1.7, 0.03),
                      xycoords=("data", "axes fraction"), ha="right", **NOTE)  # fmt: skip
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
