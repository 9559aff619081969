"""Figures of the study: residuals over a million steps, windows of 10^8, rounding of an ensemble, losses of phase."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.ticker import NullFormatter

from symtop.measure.conservation import CONSTANTS
from symtop.report.style import BLACK, GREY, legend_below, look, panels, slope_guide
from symtop.runner.study import Picture

from . import words
from .phase_loss import LOST, PhaseLoss
from .tables import HISTORIES, HORIZONS, ROUNDINGS, WINDOWS, band, cells, phase_losses, roundings

SHOWN = ("midpoint", "trapezoidal", "stormer-verlet", "strang", "gauss-4", "rk4", "rk45", "taylor")
LABELS = {
    "energy": "energy",
    "modified_energy": "modified energy",
    "p_phi": r"$p_\varphi$",
    "p_psi": r"$p_\psi$",
    "phase": "phase",
}
BANDS = ("energy", "modified_energy", "p_phi", "p_psi")
EXPONENTS = (*CONSTANTS, "phase")
LAWS = (0.0, 0.5, 1.0, 2.0)  # exponents that are drawn as lines
SMALLEST = 1e-17  # what is smaller is drawn here


def pictures(data: xr.DataTree) -> list[Picture]:
    """The figures of every group that was measured, with their captions."""
    drawn = {HISTORIES: _histories, WINDOWS: _windows, ROUNDINGS: _rounding, HORIZONS: _horizons}
    return [picture for group, draw in drawn.items() if group in data for picture in draw(data[group].to_dataset())]


def _histories(data: xr.Dataset) -> list[Picture]:
    scenes = [str(name) for name in data["scene"].values]
    names = [name for name in data["integrator"].values if str(name) in SHOWN]
    shown = data.sel(integrator=names or data["integrator"].values)
    return [
        Picture(
            "residuals",
            residual_history(shown, scenes, [(name, f"|residual {LABELS[name]}| (relative)") for name in CONSTANTS]),
            words.residuals(shown),
            "Log-log plots of residuals over time: level for the discrete methods, rising for adaptive Runge-Kutta.",
        ),
        Picture(
            "sizes",
            dots(data, scenes, [(f"{name}_largest", f"largest residual {LABELS[name]}") for name in CONSTANTS],
                 log=True),
            words.sizes(data),
            "Dot plot of the largest residuals of energy and momenta for every integrator.",
        ),
        Picture(
            "exponents",
            exponents(data, scenes),
            words.exponents(data),
            "Dot plots of the growth exponents of energy, momenta and phase for every integrator.",
        ),
    ]  # fmt: skip


def exponents(data: xr.Dataset, scenes: Sequence[str]) -> Any:
    """Growth exponents of every integrator with their intervals; the exponents of the laws of growth as lines."""
    figure = dots(data, scenes, [(f"{name}_exponent", f"exponent of {LABELS[name]}") for name in EXPONENTS], log=False)
    for axis in figure.axes:
        axis.set(xlim=(-0.35, 2.5), xticks=(0.0, 0.5, 1.0, 1.5, 2.0))
        for law in LAWS:
            axis.axvline(law, color=GREY, lw=0.8, zorder=1)
    return figure


def _windows(data: xr.Dataset) -> list[Picture]:
    return [
        Picture(
            "windows",
            window_bands(data),
            words.windows(data),
            "Bands of energy, modified energy and momenta over the logarithm of the steps, a column for each method.",
        )
    ]


def window_bands(data: xr.Dataset) -> Any:
    """Least, mean and largest change of energy, modified energy and momenta in each window, against the steps done."""
    runs = cells(data)
    figure, axes = panels(len(BANDS), len(runs), height=1.9, sharex=True, sharey="row")
    for row, quantity in zip(axes, BANDS, strict=True):
        scale = 10.0 ** np.floor(np.log10(max(np.nanmax(np.abs(band(cell, quantity).largest)) for _, _, cell in runs)))
        for axis, (scene, name, cell) in zip(row, runs, strict=True):
            style, steps, changes = look(name), cell["steps"].values, band(cell, quantity)
            good = np.isfinite(steps)
            low, middle, high = (part[good] / scale for part in (changes.least, changes.mean, changes.largest))
            axis.fill_between(steps[good], low, high, step="pre", color=style.color, alpha=0.3, lw=0)
            axis.step(steps[good], middle, where="pre", color=style.color, lw=1.3)
            axis.set_xscale("log")
            if quantity == BANDS[0]:
                axis.set_title(name if data["scene"].size == 1 else f"{name} on {scene}")
            if quantity == BANDS[-1]:
                axis.set_xlabel("steps")
        row[0].set_ylabel(f"{LABELS[quantity]}\n(relative, in {scale:.0e})")
    return figure


def _rounding(data: xr.Dataset) -> list[Picture]:
    return [
        Picture(
            "rounding",
            walks(data),
            words.rounding(data),
            "Log-log plots of the drift by rounding against steps for each method, with compensated and plain sums.",
        )
    ]


def walks(data: xr.Dataset) -> Any:
    """Drift of the modified energy of every member; its root mean square with compensated and with plain sums."""
    ensembles = roundings(data)
    figure, axes = panels(1, len(ensembles), height=3.6, sharex=True, sharey=True)
    for axis, (name, ensemble) in zip(axes[0], ensembles.items(), strict=True):
        style, steps = look(name), ensemble.elapsed
        good = np.isfinite(steps)
        for member in ensemble.drift:
            axis.plot(steps[good], np.abs(member[good]), color=style.color, lw=0.5, alpha=0.45)
        axis.plot(steps[good], ensemble.rms[good], style.marker + "-", color=style.color, ms=4,
                  label=f"{name}, compensated sums")  # fmt: skip
        axis.plot(steps[good], ensemble.plain_rms[good], "x--", color=BLACK, ms=4, lw=1.0, label="plain sums")
        axis.set(xscale="log", yscale="log", title=name, xlabel="steps between the means")
        axis.xaxis.set_minor_formatter(NullFormatter())
        first, last = float(steps[good][0]), float(steps[good][-1])
        slope_guide(axis, 0.5, (first * 3.0, last), 2e-18, r"$n^{1/2}$")
    axes[0, 0].set_ylim(bottom=1e-18)
    axes[0, 0].set_ylabel("drift of modified energy (relative)")
    legend_below(figure, axes)
    return figure


def _horizons(data: xr.Dataset) -> list[Picture]:
    return [
        Picture(
            "horizons",
            lost_phases(phase_losses(data)),
            words.horizons(data),
            "Left, phase errors that rise to a tolerance, with the predicted and the measured time of reaching it; "
            "right, the difference of the two times in percent.",
        )
    ]


def lost_phases(losses: dict[str, PhaseLoss]) -> Any:
    """Phase error of every method against nutations; the loss predicted and measured, and the difference of the two."""
    figure, axes = panels(1, 2, height=0.9 + 0.2 * len(losses), width_ratios=(1.25, 1.0))
    left, right = axes[0]
    for row, (name, loss) in enumerate(losses.items()):
        style, nutations, error = look(name), loss.nutations, np.abs(loss.phase)
        good = np.isfinite(nutations) & np.isfinite(error) & (nutations > 0.0) & (error > 0.0)
        left.plot(*envelope(nutations[good], error[good]), color=style.color, lw=0.9, alpha=0.8)
        left.plot(loss.predicted, LOST, "o", mfc="none", color=style.color, ms=9)
        left.plot(loss.measured, LOST, style.marker, color=style.color, ms=4)
        if np.isfinite(loss.measured):
            right.plot(1e2 * (loss.ratio - 1.0), row, style.marker, color=style.color, ms=6)
    left.axhline(LOST, color=GREY, lw=0.8)
    left.axvspan(0.0, min(loss.short for loss in losses.values()), color=GREY, alpha=0.15, lw=0)
    left.set(xscale="log", yscale="log", xlabel="nutations", ylabel="phase error of the nutation (rad)")
    left.set_ylim(LOST * 1e-4, LOST * 4.0)
    left.plot([], [], "o", mfc="none", color=GREY, ms=9, label="predicted from the grey part")
    left.plot([], [], "s", color=GREY, ms=4, label="measured")
    right.axvline(0.0, color=GREY, lw=0.8)
    right.set(yticks=range(len(losses)), yticklabels=list(losses), ylim=(len(losses) - 0.5, -0.5))
    right.set_xlabel("predicted less measured time (%)")
    legend_below(figure, axes)
    return figure


def residual_history(data: xr.Dataset, scenes: Sequence[str], rows: Sequence[tuple[str, str]]) -> Any:
    """|residual| against time, one row a conserved quantity, one column a scene: envelopes over faint samples."""
    figure, axes = panels(len(rows), len(scenes), height=2.7, sharex="col", sharey="row")
    for (quantity, label), line in zip(rows, axes, strict=True):
        for axis, scene in zip(line, scenes, strict=True):
            for name in data["integrator"].values:
                cell = data.sel(scene=scene, integrator=name)
                t, r = cell["sample_time"].values, np.abs(cell[f"{quantity}_residual"].values)
                good = np.isfinite(r) & np.isfinite(t) & (t > 0.0)
                if not good.any():
                    continue
                t, r = t[good], np.maximum(r[good], SMALLEST)
                style = look(str(name))
                axis.plot(t, r, ",", color=style.color, alpha=0.5, zorder=2)
                axis.plot(
                    *envelope(t, r), style.marker + "-", color=style.color, ms=0.8 * style.size, label=str(name),
                    zorder=3,
                )  # fmt: skip
            axis.set(xscale="log", yscale="log")
            if quantity == rows[0][0]:
                axis.set_title(scene)
        line[0].set_ylabel(label)
    for axis in axes[0]:
        first, last = axis.get_xlim()
        axis.autoscale(enable=False)
        slope_guide(axis, 1.0, (first * 2.0, last / 2.0), 1e-8, "$t$")
    for axis in axes[-1]:
        axis.set_xlabel("time (s)")
    legend_below(figure, axes)
    return figure


def envelope(t: Any, r: Any, windows: int = 18) -> tuple[Any, Any]:
    """Largest value in logarithmic windows of time."""
    edges = np.geomspace(t[0] * 0.999, t[-1], windows + 1)
    place = np.clip(np.searchsorted(edges, t, side="left") - 1, 0, windows - 1)
    kept = np.unique(place)
    return np.sqrt(edges[kept] * edges[kept + 1]), np.array([r[place == k].max() for k in kept])


def dots(data: xr.Dataset, scenes: Sequence[str], columns: Sequence[tuple[str, str]], *, log: bool) -> Any:
    """One row an integrator, one column a variable, one dot a scene: large tables at a glance.

    On a logarithmic axis zeros are drawn at `SMALLEST`. Each column is ``(variable, label)``; a variable ``NAME`` with
    a companion ``NAME_interval`` gets a bar.
    """
    names = [str(name) for name in data["integrator"].values]
    figure, axes = panels(1, len(columns), height=0.9 + 0.2 * len(names), sharey=True)
    shift = np.linspace(-0.22, 0.22, len(scenes)) if len(scenes) > 1 else np.zeros(1)
    for axis, (variable, label) in zip(axes[0], columns, strict=True):
        for scene, offset, face in zip(scenes, shift, ("full", "none", "left", "right") * 3, strict=False):
            for row, name in enumerate(names):
                cell = data.sel(scene=scene, integrator=name)
                value, style = float(cell[variable]), look(name)
                if not np.isfinite(value):
                    continue
                value = max(value, SMALLEST) if log else value
                bar = float(cell[f"{variable}_interval"]) if f"{variable}_interval" in cell else 0.0
                axis.errorbar(
                    value, row + offset, xerr=bar, fmt=style.marker, fillstyle=face, color=style.color, ms=5,
                    elinewidth=0.8,
                )  # fmt: skip
        for face, scene in zip(("full", "none", "left", "right") * 3, scenes, strict=False):
            axis.plot([], [], "o", fillstyle=face, color=GREY, label=scene)
        axis.set(xlabel=label, yticks=range(len(names)), yticklabels=names, ylim=(len(names) - 0.5, -0.5))
        if log:
            axis.set_xscale("log")
    legend_below(figure, axes)
    return figure
