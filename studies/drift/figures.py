"""Drawings of long runs: windows of a billion steps, walks of an ensemble, horizons foretold and reached."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.ticker import NullFormatter

from symtop.report.figures import dots, envelope
from symtop.report.style import BLACK, GREY, legend_below, look, panels, slope_guide

ROWS = (
    ("energy", "energy"),
    ("modified_energy", "modified energy"),
    ("p_phi", r"$p_\varphi$"),
    ("p_psi", r"$p_\psi$"),
)


def window_bands(data: xr.Dataset, names: Sequence[str]) -> Any:
    """Least, mean and largest change of energy, modified energy and momenta in each window, over the steps done."""
    figure, axes = panels(len(ROWS), len(names), height=1.9, sharex=True, sharey="row")
    for row, (quantity, label) in zip(axes, ROWS, strict=True):
        scale = 10.0 ** np.floor(np.log10(np.nanmax(np.abs(data[f"window_{quantity}_largest"].sel(integrator=names)))))
        for axis, name in zip(row, names, strict=True):
            cell, style = data.sel(integrator=name), look(name)
            steps = cell["window_steps"].values
            good = np.isfinite(steps)
            low, middle, high = (
                cell[f"window_{quantity}_{part}"].values[good] / scale for part in ("least", "mean", "largest")
            )
            axis.fill_between(steps[good], low, high, step="pre", color=style.color, alpha=0.3, lw=0)
            axis.step(steps[good], middle, where="pre", color=style.color, lw=1.3)
            axis.set_xscale("log")
            if quantity == ROWS[0][0]:
                axis.set_title(name)
            if quantity == ROWS[-1][0]:
                axis.set_xlabel("steps")
        row[0].set_ylabel(f"{label}\n({scale:.0e} relative)")
    return figure


def walks(data: xr.Dataset, names: Sequence[str]) -> Any:
    """Drift of the modified energy of every member, and the root mean square with compensated and with plain sums."""
    figure, axes = panels(1, len(names), height=3.6, sharex=True, sharey=True)
    for axis, name in zip(axes[0], names, strict=True):
        cell, style = data.sel(integrator=name), look(name)
        steps = cell["rounding_elapsed"].values
        good = np.isfinite(steps)
        for member in cell["rounding"].values:
            axis.plot(steps[good], np.abs(member[good]), color=style.color, lw=0.5, alpha=0.45)
        axis.plot(steps[good], cell["rounding_rms"].values[good], style.marker + "-", color=style.color, ms=4,
                  label=f"{name}, compensated")  # fmt: skip
        axis.plot(steps[good], cell["rounding_plain_rms"].values[good], "x--", color=BLACK, ms=4, lw=1.0,
                  label="plain sums")  # fmt: skip
        axis.set(xscale="log", yscale="log", title=name, xlabel="steps between the means")
        axis.xaxis.set_minor_formatter(NullFormatter())
        first, last = float(steps[good][0]), float(steps[good][-1])
        slope_guide(axis, 0.5, (first * 3.0, last), 2e-18, r"$n^{1/2}$")
    axes[0, 0].set_ylim(bottom=1e-18)
    axes[0, 0].set_ylabel("drift of modified energy (relative)")
    legend_below(figure, axes)
    return figure


def lost_phases(data: xr.Dataset, lost: float) -> Any:
    """Phase error against the nutations of every method, the loss foretold and measured, and their ratio."""
    names = [
        str(name) for name in data["integrator"].values if np.isfinite(data["horizon_predicted"].sel(integrator=name))
    ]
    figure, axes = panels(1, 2, height=0.9 + 0.2 * len(names), width_ratios=(1.25, 1.0))
    left, right = axes[0]
    for row, name in enumerate(names):
        cell, style = data.sel(integrator=name), look(name)
        t, e = cell["horizon_nutations"].values, np.abs(cell["horizon_phase"].values)
        good = np.isfinite(t) & np.isfinite(e) & (t > 0.0) & (e > 0.0)
        predicted, measured = float(cell["horizon_predicted"]), float(cell["horizon_measured"])
        left.plot(*envelope(t[good], e[good]), color=style.color, lw=0.9, alpha=0.8)
        left.plot(predicted, lost, "o", mfc="none", color=style.color, ms=9)
        left.plot(measured, lost, style.marker, color=style.color, ms=4)
        if np.isfinite(measured):
            right.plot(1e2 * (predicted / measured - 1.0), row, style.marker, color=style.color, ms=6)
    left.axhline(lost, color=GREY, lw=0.8)
    short = float(np.nanmin(data["horizon_short"]))
    left.axvspan(0.0, short, color=GREY, alpha=0.15, lw=0)
    left.set(xscale="log", yscale="log", xlabel="nutations", ylabel="phase error of the nutation (rad)")
    left.set_ylim(lost * 1e-4, lost * 4.0)
    left.plot([], [], "o", mfc="none", color=GREY, ms=9, label="foretold from the grey part")
    left.plot([], [], "s", color=GREY, ms=4, label="measured")
    right.axvline(0.0, color=GREY, lw=0.8)
    right.set(yticks=range(len(names)), yticklabels=names, ylim=(len(names) - 0.5, -0.5))
    right.set_xlabel("foretold time less the measured one (%)")
    legend_below(figure, axes)
    return figure


def exponents(data: xr.Dataset, scenes: Sequence[str], columns: Sequence[tuple[str, str]]) -> Any:
    """Growth exponents of every integrator with their intervals, the laws of growth as lines."""
    figure = dots(data, scenes, columns, log=False)
    for axis in figure.axes:
        axis.set(xlim=(-0.35, 2.5), xticks=(0.0, 0.5, 1.0, 1.5, 2.0))
        for law in (0.0, 0.5, 1.0, 2.0):
            axis.axvline(law, color=GREY, lw=0.8, zorder=1)
    return figure
