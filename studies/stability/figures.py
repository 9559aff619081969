"""The figures of the stability study: the atlas, a page a family of methods, and six panels of mechanisms.

Points at the upper edge of the panel of the pole, x, are runs that ended early. Values below 1e-16 are drawn there.
"""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import xarray as xr

from symtop.methods.registry import split_name
from symtop.methods.splitting_space import cayley_sleeps_from, strang_sleeps_from
from symtop.report.style import BLUE, GREEN, GREY, VERMILLION, Look, legend_below, look, panels
from symtop.runner.study import Picture

from .atlas import families, pages
from .atlas_figures import atlas_page
from .atlas_words import advice, page_caption
from .failures import LOST, SEEN
from .tables import MECHANISMS, Column
from .words import LEAST_SAMPLED, held_fixed, mechanism_sentences

SHOWN = ("midpoint", "trapezoidal", "stormer-verlet", "galerkin-simpson", "strang", "cayley", "gauss-4", "rk4")
SLEEPERS = ("strang", "cayley", "midpoint", "gauss-4", "yoshida-4")
GUIDE = {"color": GREY, "lw": 0.9, "zorder": 1}


def pictures(data: xr.Dataset) -> Iterator[Picture]:
    """All figures that the dataset has something for, one after the other: with a plug-in they are more than twenty."""
    for family in families(data):
        sentences = {name: line.sentence for name, line in advice(data, family).items()}
        for page, names in pages(list(sentences)).items():
            figure = atlas_page(data, family, names, sentences)
            caption = page_caption(data, family, page, names)
            yield Picture(f"atlas-{family}-{page}", figure, caption, f"Maps of outcomes: {', '.join(names)}.")
    if set(MECHANISMS) & set(map(str, data["scene"].values)):
        measured = mechanism_sentences(data, ("grazing", "separatrix"))
        caption = " ".join([f"Six ways to fail, each measured alone. {held_fixed(data)}", *measured])
        alt = "Six panels: pole grazing, resonances, sleeping threshold, separatrix, sampling, solver tolerance."
        yield Picture("mechanisms", mechanism_panels(data), caption, alt)


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
    """Every row of the methods called `names`, with its look and its cell."""
    shown = [str(name) for name in data["integrator"].values if split_name(str(name))[0] in names]
    return [(name, look(name), data.sel(integrator=name)) for name in shown]


def _methods(data: xr.Dataset) -> list[str]:
    return [split_name(str(name))[0] for name in data["integrator"].values]


def _marked(style: Look, size: float = 1.0) -> dict[str, Any]:
    """Colour and marker of a row: open in angles, full in the axis chart."""
    return {"color": style.color, "fillstyle": style.fill, "ms": size * style.size}


def _pole(axis: Any, data: xr.Dataset) -> None:
    for name, style, cell in _each(data):
        x, y = cell[Column.PARAMETER].values, cell[Column.GRAZING_ERROR].values
        every = max(1, int(np.isfinite(x).sum()) // 12)
        axis.plot(x, y, style.marker + "-", **_marked(style, 0.6), markevery=every, lw=1.0, label=name)
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
        axis.plot(x, y, style.marker + "-", **_marked(style, 0.6), markevery=5, lw=1.0, label=name)
    for place, label in ((3.0**0.5, r"$\sqrt{3}$"), (2.0, "2"), (12.0**0.5, r"$2\sqrt{3}$")):
        axis.axvline(place, color=GREY, lw=0.8, ls=(0, (5, 3)), zorder=1)
        axis.annotate(label, (place, 0.315), fontsize=8, ha="center", va="bottom", annotation_clip=False)
    axis.set(xlabel=r"step, $h\omega$", ylabel="surviving displacement (rad)", ylim=(0.0, 0.31))
    axis.set_title("resonances", pad=16)


def _sleep(axis: Any, data: xr.Dataset) -> None:
    for name, style, cell in _each(data, SLEEPERS):
        x, y = cell[Column.SLEEPING_STEP].values, cell[Column.SLEEPING_THRESHOLD].values
        axis.plot(x, y, style.marker, **_marked(style), label=name)
    x = np.linspace(0.02, 1.0, 60)
    axis.plot(x, [cayley_sleeps_from(h) for h in x], label=r"$a^2 = 4 + h^2$", **GUIDE)
    axis.plot(x, [strang_sleeps_from(h) for h in x], ls=(0, (5, 3)), label=r"$a \tan(a h/4) = h$", **GUIDE)
    axis.set(xlabel="step h", ylabel=r"least spin that sleeps, $a = I_3\omega_3$", title="the sleeping top")


def _separatrix(axis: Any, data: xr.Dataset) -> None:
    for name, style, cell in _each(data, _methods(data)):
        main = {**_marked(style), "zorder": 3, "label": name}
        other = {**_marked(style, 0.55), "zorder": 2, "alpha": 0.6}
        x, y = cell[Column.EARLY_ERROR].values, cell[Column.HORIZON].values
        axis.plot(x, y, style.marker, **(main if split_name(name)[0] in SHOWN else other))
    error = np.geomspace(1e-16, 0.1, 50)
    axis.plot(error, SEEN + 2.0 * np.log(LOST / error), label=r"$6/g + (2/g) \ln(0.1/e)$", **GUIDE)
    axis.set(xscale="log", xlabel="axis error e at 6/g (rad)", ylabel="time to an error of 0.1 rad (1/g)")
    axis.set_title("the separatrix")


def _sampling(axis: Any, data: xr.Dataset) -> None:
    for name, style, cell in _each(data, _methods(data)):
        x, y = float(cell[Column.ENERGY_EVERY]), max(float(cell[Column.ENERGY_ONCE]), 1e-16)
        axis.plot(x, y, style.marker, **_marked(style), label=name if split_name(name)[0] in SHOWN else None)
    axis.axhspan(0.0, LEAST_SAMPLED, color=GREY, alpha=0.15, lw=0, label="below rounding")
    axis.plot([1e-15, 1e-2], [1e-15, 1e-2], **GUIDE)
    axis.set(xscale="log", yscale="log", xlabel="largest energy error, every step", ylabel="the same, once a nutation")
    axis.set_title("sampling")


def _solver(axis: Any, data: xr.Dataset) -> None:
    """The midpoint rule, solved by the textbook's iteration and by this package's kernel."""
    energy = data.get(Column.TEXTBOOK_ENERGY)
    if energy is None or energy.isnull().all():
        axis.set_visible(False)
        return
    cell = data.isel(integrator=int(np.argmax(energy.notnull().any("tolerance_setting").values)))
    x = cell[Column.SOLVER_TOLERANCE].values
    x = np.where(np.isfinite(x), x, 10.0 * np.nanmax(np.where(np.isfinite(x), x, np.nan)))
    for variable, label, marker, color in (
        (Column.TEXTBOOK_ENERGY, "energy, textbook Newton", "s", VERMILLION),
        (Column.SOLVER_ENERGY, "energy, this package's kernel", "o", BLUE),
        (Column.SOLVER_MOMENTUM, "momenta, this package's kernel", "^", GREEN),
    ):
        axis.plot(x, np.maximum(cell[variable].values, 1e-16), marker + "-", color=color, label=label)
    axis.set(xscale="log", yscale="log", xlabel="solver tolerance", ylabel="largest residual")
    axis.set_title(f"the solver of {cell['integrator'].values}")
