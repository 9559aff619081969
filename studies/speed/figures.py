"""Figure 1, error against run time, and the interactive chart of all runs."""

import math
from itertools import product

import numpy as np
import xarray as xr

from symtop.methods.framework.registry import split_name
from symtop.report.figures import error_band, label_lines
from symtop.report.style import ADAPTIVE, LEAST_TEXT, look, panels
from symtop.runner.study import REFERENCE, Chart, Picture, Series

from .facts import shown

SCIPY = (0, (1.2, 1.4))  # line style of methods called through SciPy
ADAPTED = ("RK45", "DOP853, adaptive")  # labels of methods drawn with the same line style as on the page of costs
NAMES = {  # labels of lines; other lines are labelled with the name of the method
    "stormer-verlet[angles]": "Störmer-Verlet", "midpoint[angles]": "midpoint (discrete Lagrangian)",
    "trapezoidal[angles]": "trapezoidal (discrete Lagrangian)",
    "galerkin-gauss-8[angles]": "Galerkin-Gauss 8 (discrete Lagrangian)",
    "rk4[axis]": "RK4", "gauss-8[axis]": "Gauss 8",
    "rk45-compiled[axis]": "RK45, adaptive", "rk45[axis]": "RK45 through SciPy",
    "tsit5-fixed[axis]": "Tsit5, fixed steps", "dop853-compiled[axis]": "DOP853, adaptive",
    "dop853[axis]": "DOP853 through SciPy", "dop853-compiled-fixed[axis]": "DOP853, fixed steps",
    "vern9-fixed[axis]": "Vern9, fixed steps",
    "strang[axis]": "Strang splitting", "takahashi-imada[axis]": "Takahashi-Imada (symmetric body)",
    "taylor[axis]": "Taylor (heyoka), adaptive", "series[axis]": "series, for\nthis top alone",
}  # fmt: skip
LEAST, MOST = 1e-16, 3.0  # rad, of the panel
COSTS = {"time of a run, one core (µs)": "seconds", "force evaluations": "force_evaluations"}
ERRORS = {
    "largest error of the axis (rad)": "axis", "largest error of the attitude (rad)": "attitude",
    "largest error of the energy / energy of the nutation": "energy",
    "largest error of p_phi / larger momentum": "p_phi",
}  # fmt: skip


def pictures(data: xr.Dataset) -> list[Picture]:
    """Error of the axis against the time of a run on one scene."""
    part = timed(shown(data))
    figure, axes = panels(1, 1, height=3.9)
    axis, ends = axes[0, 0], []
    axis.set(xscale="log", yscale="log", ylim=(LEAST, MOST))
    axis.set_xlabel(f"time of a run of {float(part['nutations']):g} nutations, one core (µs)")
    axis.set_ylabel("largest error of the axis (rad)")
    level = error_band(axis, part["axis_bound"].values)
    for name in map(str, part["variant"].values):
        cell = part.sel(variant=name)
        x, y = (cell[key].values for key in ("seconds", "axis"))
        good = np.isfinite(x) & np.isfinite(y) & (y < MOST)
        if name == REFERENCE or not good.any():
            continue
        method = split_name(name)[0]
        label, color = NAMES.get(name, method), look(name).color
        x, y = x[good], np.maximum(y[good], 0.3 * level)
        line = SCIPY if "SciPy" in label else ADAPTIVE if label.startswith(ADAPTED) else "-"
        axis.plot(x, y, color=color, ls=line, marker="o", lw=1.7, ms=2.4)
        ends.append((label, color, x, y))
    axis.text(0.995, math.sqrt(LEAST * level), "below the bound of the truth ", transform=axis.get_yaxis_transform(),
              ha="right", va="center", fontsize=LEAST_TEXT, color="#444444")  # fmt: skip
    walls = []
    if REFERENCE in part["variant"].values:
        exact = float(part["seconds"].sel(variant=REFERENCE).min())
        walls = [([exact] * 40, np.geomspace(LEAST, MOST, 40))]
        axis.axvline(exact, color="#555555", ls=(0, (1, 2)), lw=1.0)
        above = {"xycoords": ("data", "axes fraction"), "textcoords": "offset points", "ha": "center", "va": "bottom"}
        above |= {"color": "#444444", "fontsize": LEAST_TEXT}
        axis.annotate("exact motion, no integrator", (exact, 1.0), (0, 2), **above)
    low, high = axis.get_xlim()
    axis.set_xlim(0.5 * low, 2.0 * high)  # with room for the labels
    label_lines(axis, ends, walls)
    return [Picture("error-against-time", figure)]


def timed(data: xr.Dataset) -> xr.Dataset:
    """The dataset with its times in microseconds."""
    return data.assign(seconds=1e6 * data["seconds"])


def charts(data: xr.Dataset) -> list[Chart]:
    """Every run: two costs and four errors to choose from, a panel a scene and run length."""
    data, names = timed(data), list(map(str, data["variant"].values))
    series, marks = {}, {}
    for scene, length in product(map(str, data["scene"].values), data["nutations"].values):
        cell, title = data.sel(scene=scene, nutations=length), f"{scene} | {length:g} nutations"
        series[title] = [Series(name, _points(cell.sel(variant=name))) for name in names if name != REFERENCE]
        if REFERENCE in names:
            runs = cell.sel(variant=REFERENCE)
            marks[title] = (float(runs["seconds"].min()), float(runs["axis_bound"].min()))
    costs = {name: place for place, name in enumerate(COSTS)}
    errors = {name: len(COSTS) + place for place, name in enumerate(ERRORS)}
    return [Chart("runs", "Error against cost of every run", costs, errors, series, ("scene", "run length"), marks)]


def _points(cell: xr.Dataset) -> list[tuple[float | str | None, ...]]:
    """Costs and errors of each run to three digits, None where one is missing, and the setting as text."""
    columns = [cell[key].values for key in (*COSTS.values(), *ERRORS.values())]
    points = []
    for k in np.flatnonzero(np.isfinite(cell["seconds"].values)):
        numbers = [float(f"{column[k]:.3g}") if np.isfinite(column[k]) else None for column in columns]
        step, tolerance = (float(cell[key].values[k]) for key in ("step_size", "tolerance"))
        points.append((*numbers, f"step {step:.3g} s" if np.isfinite(step) else f"tolerance {tolerance:.1g}"))
    return points
