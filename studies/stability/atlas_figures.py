"""The drawings of the failure atlas: outcome maps by family, and the mechanisms behind them.

Outcomes are told apart three times over: by colours that any common colour blindness leaves apart, by a hatch that is
drawn into the map cell by cell, and by a word on every region that is large enough to hold one.
"""

import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from symtop.measure.verdicts import VERDICTS
from symtop.methods.registry import integrators
from symtop.report.style import GREY, OUTCOME_COLORS, legend_below, look, panels, use

from .atlas_words import Cell, cell

RASTER = (110, 430)  # pixels of one map, about those it has in the figure
SHADE = 0.72  # a hatch line is the same colour, darker
WORDS = {
    "accurate": "accurate", "bounded_but_wrong": "bounded but wrong", "drifting": "drifting",
    "wrong_regime": "wrong regime", "left_chart": "left chart", "not_converged": "not converged",
    "not_finite": "not finite", "step_too_small": "step too small", "out_of_budget": "out of budget",
}  # fmt: skip
KNOBS = {"step_size": "step (nutation periods)", "tolerance": "tolerance", "none": "nothing to turn"}


def _hatch(word: str, rows: Any, columns: Any) -> Any:
    """Which pixels of a raster the hatch of an outcome covers."""
    down, up = (rows + columns) % 10 == 0, (rows - columns) % 10 == 0
    marks = {
        "left_chart": down,
        "wrong_regime": up,
        "not_converged": down | up,
        "drifting": rows % 6 == 0,
        "step_too_small": (rows % 5 == 0) & (columns % 5 == 0),
        "out_of_budget": columns % 6 == 0,
    }
    return marks.get(word, np.zeros_like(down))


def painted(outcome: NDArray[np.uint8]) -> NDArray[np.float64]:
    """A map of outcomes, shape (rows, columns), as an image (height, width, 3) with hatches."""
    from matplotlib.colors import to_rgb

    height, width = RASTER
    big = outcome[np.arange(height) * outcome.shape[0] // height][:, np.arange(width) * outcome.shape[1] // width]
    rows, columns = np.indices(big.shape)
    image = np.ones((*big.shape, 3))
    for index, word in enumerate(VERDICTS):
        here = big == index
        image[here] = to_rgb(OUTCOME_COLORS[word])
        image[here & _hatch(word, rows, columns)] *= SHADE
    return image


def _name_regions(axis: Any, outcome: NDArray[np.uint8], extent: Sequence[float]) -> None:
    """Write each outcome's name where its largest region is widest, if it fits."""
    from scipy.ndimage import distance_transform_edt, label

    height, width = outcome.shape
    for index in np.unique(outcome):
        regions, count = label(outcome == index)
        if not count:
            continue
        largest = 1 + int(np.argmax(np.bincount(regions.ravel())[1:]))
        # a cell is seen from the text's shape: six times as wide as high
        across, upright = 1.0 / width * 3.0 / 6.0, 1.0 / height
        depth = distance_transform_edt(np.pad(regions == largest, 1), sampling=(upright, across))[1:-1, 1:-1]
        row, column = np.unravel_index(int(np.argmax(depth)), depth.shape)
        if depth[row, column] < 0.055 or VERDICTS[int(index)] not in WORDS:
            continue
        x = extent[0] + (column + 0.5) / width * (extent[1] - extent[0])
        y = extent[2] + (row + 0.5) / height * (extent[3] - extent[2])
        for_word = 0.0085 * len(WORDS[VERDICTS[int(index)]])  # half the width of the text, of the map's
        x = min(max(x, extent[0] + for_word * (extent[1] - extent[0])), extent[1] - for_word * (extent[1] - extent[0]))
        y = min(max(y, extent[2] + 0.07 * (extent[3] - extent[2])), extent[3] - 0.07 * (extent[3] - extent[2]))
        dark = VERDICTS[int(index)] in ("not_finite", "not_converged", "accurate", "left_chart")
        axis.text(
            x, y, WORDS[VERDICTS[int(index)]], ha="center", va="center", fontsize=7.5, weight="bold",
            color="white" if dark else "black",
        )  # fmt: skip


def _edges(values: NDArray[np.float64]) -> tuple[float, float]:
    """Both ends of an axis of cells at logarithmically even values, as decimal logarithms."""
    if values.size < 2:
        return 0.0, 1.0
    half = 0.5 * (np.log10(values[-1]) - np.log10(values[0])) / (values.size - 1)
    return float(np.log10(values[0]) - half), float(np.log10(values[-1]) + half)


def _ticks(axis: Any, which: str, ends: tuple[float, float]) -> None:
    powers = range(int(np.ceil(ends[0] - 1e-9)), int(np.floor(ends[1] + 1e-9)) + 1)
    step = 1 if len(powers) <= 5 else 2 if len(powers) <= 8 else 3
    shown = powers[::step]
    names = [f"{10.0**k:g}" if -3 <= k <= 2 else rf"$10^{{{k}}}$" for k in shown]
    getattr(axis, f"set_{which}ticks")(shown, names, fontsize=7.5)


def draw_map(axis: Any, found: Cell, *, down: bool = False) -> None:
    """One map; parameter upwards (downwards if `down`), knob to the right, both logarithmic."""
    x, y = _edges(found.knob), _edges(found.parameter)
    extent = (*x, *y)
    axis.imshow(painted(found.outcome), origin="lower", extent=extent, aspect="auto", interpolation="nearest")
    _name_regions(axis, found.outcome, extent)
    axis.grid(visible=False)
    if found.knob_name == "none":
        axis.set_xticks([])
    else:
        _ticks(axis, "x", x)
    _ticks(axis, "y", y)
    if down:
        axis.invert_yaxis()


def _line(axis: Any, x: Any, y: Any, dashes: Any) -> None:
    from matplotlib.patheffects import Normal, Stroke

    ends = axis.get_xlim(), axis.get_ylim()
    axis.plot(
        np.log10(x), np.log10(y), color="black", lw=1.1, ls=dashes,
        path_effects=[Stroke(linewidth=2.6, foreground="white"), Normal()],
    )  # fmt: skip
    axis.set(xlim=ends[0], ylim=ends[1])


LIMIT, THIRD, PASSAGE = "-", (0, (4, 2)), (0, (1, 1.5))


def _overlay(axis: Any, at: xr.Dataset) -> None:
    """The linear limit and the third of a turn over a spin map."""
    if "linear_limit" not in at:
        return
    for variable, dashes in (("linear_limit", LIMIT), ("third_turn", THIRD)):
        x, y = at[variable].values, at["limit_parameter"].values
        if np.isfinite(x).sum() > 1:
            _line(axis, x, y, dashes)


def atlas_page(data: xr.Dataset, family: str, names: Sequence[str], sentences: Mapping[str, str]) -> Any:
    """One row an integrator: its map over spin and step, its map over the gap to a pole and step, its sentence."""
    import matplotlib.pyplot as plt
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    use()
    grazed = any(cell(data, "grazing", name) is not None for name in names)
    figure, axes = plt.subplots(
        len(names), 1 + grazed, figsize=(8.4, 1.7 * len(names) + 0.95), squeeze=False,
        gridspec_kw={"width_ratios": [1.25, 1.0][: 1 + grazed]},
    )  # fmt: skip
    seen: set[int] = set()
    for line, name, below in zip(axes, names, [*names[1:], None], strict=True):
        for axis, scene, label in zip(line, (family, "grazing"), ("spin r", r"gap $\delta$"), strict=False):
            found = cell(data, scene, name)
            if found is None:
                axis.set_visible(False)
                continue
            seen |= {int(k) for k in np.unique(found.outcome)}
            draw_map(axis, found)
            axis.set_ylabel(label, fontsize=8.5)
            if scene == family:
                _overlay(axis, data.sel(scene=scene, integrator=name))
            elif found.knob_name == "step_size":  # the step in which the axis falls past the pole, 1.2 h = 1.1 delta
                _line(axis, 1.1 * found.parameter / 1.2 / 4.22, found.parameter, PASSAGE)
            if below is None or found.knob_name != _knob(data, family, below):
                axis.set_xlabel(KNOBS[found.knob_name], fontsize=8.5)
        _caption(line[0], name, sentences[name])
    handles: list[Any] = [
        Patch(facecolor=OUTCOME_COLORS[VERDICTS[k]], label=WORDS[VERDICTS[k]], hatch=_legend_hatch(VERDICTS[k]),
              edgecolor=GREY, lw=0.4)
        for k in sorted(seen) if k < len(VERDICTS)
    ]  # fmt: skip
    if any(_knob(data, family, name) == "step_size" for name in names):
        lines = ((LIMIT, "linear limit"), (THIRD, "a third of a turn a step"), (PASSAGE, "one step passes the pole"))
        shown = lines if grazed else lines[:2]
        handles += [Line2D([], [], color="black", lw=1.1, ls=dashes, label=word) for dashes, word in shown]
    figure.legend(handles=handles, loc="outside lower center", ncols=4, frameon=False, fontsize=8)
    return figure


def _caption(axis: Any, name: str, sentence: str) -> None:
    """The integrator's name, and below it its sentence, over a row of maps."""
    lines = textwrap.wrap(sentence, 128)
    axis.set_title("\n".join(["", *lines]), loc="left", fontsize=8.0)
    axis.annotate(
        name, (0.0, 1.0), (0.0, 5.5 + 11.2 * len(lines)), xycoords="axes fraction", textcoords="offset points",
        fontsize=9.0, weight="bold", annotation_clip=False,
    )  # fmt: skip


def _knob(data: xr.Dataset, family: str, name: str) -> str:
    found = cell(data, family, name)
    return found.knob_name if found else ""


def _legend_hatch(word: str) -> str | None:
    return {
        "left_chart": "////", "wrong_regime": "\\\\\\\\", "not_converged": "xxxx", "drifting": "----",
        "step_too_small": "....", "out_of_budget": "||||",
    }.get(word)  # fmt: skip


# ---- the mechanisms --------------------------------------------------------------------------------------------------

SHOWN = ("midpoint", "trapezoidal", "stormer-verlet", "galerkin-simpson", "strang", "cayley", "gauss-4", "rk4")


def mechanisms(data: xr.Dataset) -> Any:
    """Six panels: pole, resonance, sleeping top, separatrix, sampling, solver."""
    figure, axes = panels(2, 3, height=3.1)
    drawn = ("grazing", "steady-fast", "sleeping", "separatrix", "goldstein", "goldstein")
    for axis, draw, scene in zip(axes.flat, (_pole, _resonance, _sleep, _separatrix, _sampling, _solver), drawn,
                                 strict=True):  # fmt: skip
        if scene in data["scene"].values:
            draw(axis, data.sel(scene=scene))
        else:
            axis.set_visible(False)
    legend_below(figure, axes)
    return figure


def _each(data: xr.Dataset, names: Sequence[str] = SHOWN) -> list[tuple[str, Any, xr.Dataset]]:
    return [(name, look(name), data.sel(integrator=name)) for name in names if name in data["integrator"].values]


def _pole(axis: Any, data: xr.Dataset) -> None:
    for name, style, at in _each(data):
        x, y = at["parameter_value"].values, at["grazing_error"].values
        axis.plot(x, y, style.marker + "-", color=style.color, ms=0.6 * style.size, markevery=4, lw=1.0, label=name)
        gone = np.isfinite(x) & ~np.isfinite(y)
        axis.plot(x[gone], np.full(int(gone.sum()), 1.0), "x", color=style.color, ms=4.0, mew=0.8)
    axis.plot([], [], "x", color=GREY, ms=4.0, label="run ended early")
    axis.set(xscale="log", yscale="log", xlabel=r"gap $\delta$ to the pole", ylabel="largest axis error (rad)")
    axis.set_title("a pole next to the path")


def _resonance(axis: Any, data: xr.Dataset) -> None:
    for name, style, at in _each(data):
        # the resonance lies between two points of the grid
        x = np.append(at["phase_value"].values, float(at["third_turn_phase"]))
        y = np.append(at["surviving"].values, float(at["surviving_at_third_turn"]))
        x, y = x[np.argsort(x)], y[np.argsort(x)]
        axis.plot(x, y, style.marker + "-", color=style.color, ms=0.6 * style.size, markevery=5, lw=1.0, label=name)
    for place, said in ((3.0**0.5, r"$\sqrt{3}$"), (2.0, "2"), (12.0**0.5, r"$2\sqrt{3}$")):
        axis.axvline(place, color=GREY, lw=0.8, ls=(0, (5, 3)), zorder=1)
        axis.annotate(said, (place, 0.315), fontsize=8, ha="center", va="bottom", annotation_clip=False)
    axis.set(xlabel=r"step, $h\omega$", ylabel="displacement that survives (rad)", ylim=(0.0, 0.31))
    axis.set_title("resonances", pad=16)


def _sleep(axis: Any, data: xr.Dataset) -> None:
    for name, style, at in _each(data, ("strang", "cayley", "midpoint", "gauss-4", "yoshida-4")):
        axis.plot(at["sleeping_step"].values, at["sleeping_threshold"].values, style.marker, color=style.color,
                  ms=style.size, label=name)  # fmt: skip
    x = np.linspace(0.02, 1.0, 60)
    axis.plot(x, np.sqrt(4.0 + x * x), color=GREY, lw=0.9, label=r"$a^2 = 4 + h^2$")
    spins = np.linspace(1.9, 2.0, 400)
    from_step = [(h, spins[np.argmin(np.abs(spins * np.tan(spins * h / 4.0) - h))]) for h in x]
    axis.plot(*zip(*from_step, strict=True), color=GREY, lw=0.9, ls=(0, (5, 3)), label=r"$a \tan(a h/4) = h$")
    axis.set(xlabel="step h", ylabel="spin at which it sleeps")
    axis.set_title("the sleeping top")


def _separatrix(axis: Any, data: xr.Dataset) -> None:
    known = integrators()
    for name in data["integrator"].values:
        at, style = data.sel(integrator=name), look(str(name))
        main = str(name) in SHOWN
        axis.plot(
            at["early_error"].values, at["horizon"].values, style.marker, color=style.color, zorder=3 if main else 2,
            ms=style.size if main else 0.55 * style.size, alpha=1.0 if main else 0.6,
            label=str(name) if main and str(name) in known else None,
        )  # fmt: skip
    error = np.geomspace(1e-16, 0.1, 50)
    axis.plot(error, 6.0 + 2.0 * np.log(0.1 / error), color=GREY, lw=0.9, label=r"$6/g + (2/g) \ln(0.1/e)$", zorder=1)
    axis.set(xscale="log", xlabel="axis error e at 6/g (rad)", ylabel="time to an error of 0.1 rad (1/g)")
    axis.set_title("the separatrix")


def _sampling(axis: Any, data: xr.Dataset) -> None:
    for name in data["integrator"].values:
        at, style = data.sel(integrator=name), look(str(name))
        axis.plot(
            float(at["energy_every"]), max(float(at["energy_once"]), 1e-16), style.marker, color=style.color,
            ms=style.size, label=str(name) if str(name) in SHOWN else None,
        )  # fmt: skip
    ends = np.array([1e-15, 1e-2])
    axis.plot(ends, ends, color=GREY, lw=0.9, zorder=1)
    axis.set(xscale="log", yscale="log", xlabel="energy error, every step", ylabel="the same, once a nutation")
    axis.set_title("sampling")


def _solver(axis: Any, data: xr.Dataset) -> None:
    at = data.sel(integrator="midpoint") if "midpoint" in data["integrator"].values else None
    if at is None or "plain_energy" not in at:
        axis.set_visible(False)
        return
    x = at["solver_tolerance"].values
    x = np.where(np.isfinite(x), x, 10.0 * np.nanmax(np.where(np.isfinite(x), x, np.nan)))
    for variable, said, marker, color in (
        ("plain_energy", "energy, textbook Newton", "s", "#D55E00"),
        ("solver_energy", "energy, this package's kernel", "o", "#0072B2"),
        ("solver_momentum", "momenta, this package's kernel", "^", "#009E73"),
    ):
        axis.plot(x, np.maximum(at[variable].values, 1e-16), marker + "-", color=color, label=said)
    axis.set(xscale="log", yscale="log", xlabel="solver tolerance", ylabel="largest residual")
    axis.set_title("the solver of midpoint")
