"""Six ways to fail, a figure each, with what theory says as a thin grey line.

In the figure of the pole a cross is where runs begin to end early. Values below 1e-16 are drawn there.
"""

import textwrap
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.ticker import NullLocator

from symtop.methods.framework.registry import split_name
from symtop.methods.splitting.space import cayley_sleeps_from, strang_sleeps_from
from symtop.report.figures import name_ends
from symtop.report.style import BLUE, GREEN, GREY, LEAST_TEXT, VERMILLION, headline, line, panels
from symtop.runner.study import Picture

from . import messages
from .failures import LOST, SEEN
from .resonance_words import resonant
from .tables import Column
from .words import LEAST_SAMPLED, held_fixed, mechanism_sentences, outlasting

SHOWN = (
    "midpoint[angles]", "trapezoidal[angles]", "stormer-verlet[angles]", "galerkin-simpson[angles]", "strang[axis]",
    "cayley[axis]", "gauss-4[angles]", "gauss-4[axis]", "rk4[angles]", "rk4[axis]",
)  # fmt: skip
PLACED = ("stormer-verlet[angles]", "midpoint[angles]", "rk4[axis]", "strang[axis]", "gauss-4[axis]")
GUIDE = {"color": GREY, "lw": 0.9, "zorder": 1}
RINGED_TOGETHER = 0.1  # of h omega: rings that are closer share a label
LABEL = 1.0  # of h omega: as wide as the label of a ring
TALL = {"pole": 3.1, "resonances": 3.2}  # inches
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
    figure, axes = panels(1, 1, height=TALL.get(name, 2.7))
    part = data.sel(scene=scene)
    draw(axes[0, 0], part)
    said = messages.of_mechanism(name, part)
    headline(figure, said)
    caption = " ".join([held_fixed(data, name), *mechanism_sentences(data, name)])
    return Picture(f"mechanism-{name}", figure, caption, f"{ALTS[name]} {said}")


def _each(data: xr.Dataset, variable: str, names: Sequence[str] = SHOWN) -> list[tuple[str, xr.Dataset]]:
    """The variants of those names that have a value of a variable, with their cells."""
    known = [name for name in names if name in data["variant"].values]
    cells = [(name, data.sel(variant=name)) for name in known]
    return [(name, cell) for name, cell in cells if np.isfinite(cell[variable].values).any()]


def _pole(axis: Any, data: xr.Dataset) -> None:
    """Errors of all variants of fixed step; a cross where those nearer to the pole have none: the run ended early."""
    ends, rows = {}, messages.at_pole(data)
    for name, (x, errors) in rows.items():
        y = np.maximum(errors, FLOOR)
        named = name in SHOWN or messages.lasts(name, x, y)
        marks = line(name) if named else {"color": GREY, "lw": 0.6, "alpha": 0.6, "zorder": 1}
        axis.plot(x, y, **marks, markevery=max(1, x.size // 10))
        gone = np.flatnonzero(~np.isfinite(y))
        last = int(gone[-1]) + 1 if gone.size else 0
        if 0 < last < x.size:
            color = marks["color"] if named else "black"
            axis.plot(x[last], y[last], "x", color=color, ms=5, mew=1.2, zorder=4)
        if named:
            ends[name] = float(x[-1]), float(y[-1]), str(marks["color"])
    axis.set(xscale="log", yscale="log", xlabel=r"gap $\delta$ to the pole (rad)", ylabel="largest axis error (rad)")
    axis.set_ylim(top=1e3)
    axis.set_yticks(10.0 ** np.arange(np.floor(np.log10(axis.get_ylim()[0])) + 1, 1, 2))
    axis.yaxis.set_minor_locator(NullLocator())
    said = "cross: closer to the pole runs end early\ngrey: all other methods with a fixed step"
    axis.text(0.01, 0.98, said, va="top", transform=axis.transAxes, **NOTE)
    axis.text(0.99, 0.01, "below $10^{-14}$: rounding, not compared", va="bottom", ha="right", transform=axis.transAxes,
              **NOTE)  # fmt: skip
    name_ends(axis, ends)


def _resonance(axis: Any, data: xr.Dataset) -> None:
    """Variants whose step can turn the nutation by a third; those that lose a small displacement there have a ring."""
    ends, ringed = {}, resonant(data)
    tried = [str(variant) for variant in data["variant"].values[np.isfinite(data[Column.THIRD_TURN_PHASE].values)]]
    for name, cell in _each(data, Column.SURVIVING, tried):
        # the resonance lies between two points of the grid
        x = np.append(cell[Column.PHASE].values, float(cell[Column.THIRD_TURN_PHASE]))
        y = np.append(cell[Column.SURVIVING].values, float(cell[Column.SURVIVING_AT_THIRD_TURN]))
        good = np.isfinite(x) & np.isfinite(y)
        order = np.argsort(x[good])
        x, y = x[good][order], y[good][order]
        if name not in ringed:
            axis.plot(x, y, color=GREY, lw=0.6, alpha=0.6, zorder=1)
            continue
        marks = line(name)
        axis.plot(x, y, **marks, markevery=6, clip_on=False)
        ends[name] = float(x[-1]), float(y[-1]), str(marks["color"])
    most = float(np.nanmax(data[Column.SURVIVING].values))
    axis.set(
        xlabel=r"step $h\omega$ ($\omega$: frequency of the nutation)", ylabel="all stay up to a displacement of (rad)"
    )
    groups: dict[float, list[str]] = {}  # variants whose rings are at one step
    for name, phase in sorted(ringed.items(), key=lambda one: one[1]):
        near = next((other for other in groups if abs(other - phase) < RINGED_TOGETHER), phase)
        groups.setdefault(near, []).append(name)
    axis.set_ylim((-0.055 - 0.018 * max(map(len, groups.values()), default=0)) * most / 0.3, 1.1 * most)
    places = list(groups)
    for k, (phase, names) in enumerate(groups.items()):
        axis.plot(phase, 0.0, "o", ms=11, mfc="none", mec="black", mew=1.0, zorder=5)
        said = "\n".join([f"$h\\omega = {phase:.2f}$", *(split_name(name)[0] for name in names)])
        side = _side([other - phase for other in places[:k] + places[k + 1 :]])
        axis.annotate(said, (phase, 0.0), (-14 if side == "left" else 0, -8), textcoords="offset points", va="top",
                      ha=side, fontsize=LEAST_TEXT)  # fmt: skip
    axis.set_yticks([tick for tick in axis.get_yticks() if 0.0 <= tick <= 1.01 * most])
    rest = len(tried) - len(ringed)
    axis.annotate(f"grey: the {rest} other methods; {most:.2g} rad is the largest displacement tried", (0.01, most),
                  (0, 4), textcoords="offset points", xycoords=axis.get_yaxis_transform(), **NOTE)  # fmt: skip
    axis.annotate("rings: a step turns\nthe nutation by a third", (0.01, 0.05), xycoords="axes fraction", **NOTE)
    name_ends(axis, ends)


def _side(others: Sequence[float]) -> str:
    """How a label stands at its place, by the distances of the next: away from one that is too close."""
    nearest = min(others, key=abs, default=np.inf)
    return "center" if abs(nearest) > LABEL else "right" if nearest > 0.0 else "left"


def _sleep(axis: Any, data: xr.Dataset) -> None:
    variants = [str(name) for name in data["variant"].values if split_name(str(name))[0] in messages.SLEEPERS]
    for name, cell in _each(data, Column.SLEEPING_THRESHOLD, variants):
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
    for name in map(str, data["variant"].values):
        x, y = (data[key].sel(variant=name).values for key in (Column.EARLY_ERROR, Column.HORIZON))
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
        late = data[Column.HORIZON].sel(variant=apart)
        listed = textwrap.fill(", ".join(apart), 40)
        axis.annotate(f"longer than predicted:\n{listed}", (0.98, float(late.max())), (0, -14), va="top", ha="right",
                      xycoords=axis.get_yaxis_transform(), textcoords="offset points", **NOTE)  # fmt: skip
    axis.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), frameon=False)


def _sampling(axis: Any, data: xr.Dataset) -> None:
    worst, hidden = messages.worst_sampled(data), messages.hidden_sampled(data)
    for name in map(str, data["variant"].values):
        once, every = (float(data[key].sel(variant=name)) for key in (Column.ENERGY_ONCE, Column.ENERGY_EVERY))
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
    axis.set_xlabel("largest absolute energy error, sampled at every step")
    axis.annotate("rounding: nothing is seen here\n(zeros are drawn at $10^{-16}$)", (0.99, 0.01), va="bottom",
                  xycoords="axes fraction", ha="right", **NOTE)  # fmt: skip
    axis.annotate("equal", (1e-3, 1e-3), (-4, 2), textcoords="offset points", ha="right", **NOTE)
    axis.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), frameon=False)


def _solver(axis: Any, data: xr.Dataset) -> None:
    """The midpoint rule, solved by the textbook's iteration and by this package's kernel."""
    energy = data[Column.TEXTBOOK_ENERGY]
    cell = data.isel(variant=int(np.argmax(energy.notnull().any("tolerance_setting").values)))
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
    axis.set(xscale="log", yscale="log", xlabel=f"solver tolerance of {cell['variant'].values}, step fixed")
    axis.set_ylabel("largest absolute change")
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
    "pole": "Error against the gap to a pole.",
    "resonances": "Displacement up to which all survive against the step.",
    "sleeping": "Least sleeping spin against the step.",
    "separatrix": "Accurate time against the early error.",
    "sampling": "Absolute energy errors sampled in two ways.",
    "solver": "Absolute residuals against the solver's tolerance.",
}
