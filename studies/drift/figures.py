"""Figures of the study: residuals over a million steps, windows of 10^8, rounding of an ensemble, losses of phase."""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from symtop.measure.conservation import CONSTANTS, tops
from symtop.methods.framework.registry import integrator, integrators, split_name
from symtop.report import style
from symtop.report.figures import name_ends
from symtop.report.style import BLACK, GREY, few_ticks, headline, line, look, number, panels
from symtop.run.long_run import PER_NUTATION
from symtop.runner.study import Picture

from . import dot_figures, messages, variants, words
from .dot_figures import LABELS, NOTE, SMALLEST
from .phase_loss import FEWEST, LOST
from .tables import HISTORIES, HORIZONS, ROUNDINGS, WINDOWS, by_integrator, losses

SHOWN = (
    "midpoint[angles]", "stormer-verlet[angles]", "strang[axis]", "gauss-4[axis]", "rk4[angles]", "rk4[axis]",
    "rk45[angles]", "taylor[axis]",
)  # fmt: skip
BANDS = ("energy", "modified_energy")
ROUNDED = 1e-12  # relative: smaller changes of the modified energy are called rounding


def pictures(data: xr.DataTree) -> list[Picture]:
    """The figures of every group that was measured, with their captions."""
    drawn = {
        HISTORIES: (_residuals, dot_figures.sizes, dot_figures.exponents),
        WINDOWS: (_windows,),
        ROUNDINGS: (_rounding,),
        HORIZONS: (_horizons,),
    }
    return [draw(data[group].to_dataset()) for group, draws in drawn.items() if group in data for draw in draws]


def envelope(t: np.ndarray, r: np.ndarray) -> tuple[list[float], list[float]]:
    """The largest value in each of 18 logarithmic windows of time, which start a little before the first sample."""
    return tops(t, r, math.log10(t[-1] / (0.999 * t[0])), 18)


def _residuals(histories: xr.Dataset) -> Picture:
    small = variants.without_repeats(histories)
    names = [name for name in small["variant"].values if name in SHOWN]
    data = small.sel(variant=names) if names else small
    figure, axes = panels(len(CONSTANTS), data.sizes["scene"], height=1.9, sharex="col", sharey="row")
    for row, constant in zip(axes, CONSTANTS, strict=True):
        for axis, scene in zip(row, data["scene"].values, strict=True):
            for name in data["variant"].values:
                mark, cell = look(str(name)), data.sel(scene=scene, variant=name)
                t, r = cell["sample_time"].values, np.abs(cell[f"{constant}_residual"].values)
                good = np.isfinite(r) & np.isfinite(t) & (t > 0.0)
                if good.any():
                    t, r = t[good], np.maximum(r[good], SMALLEST)
                    axis.plot(t, r, ",", color=mark.color, alpha=0.25, zorder=2, rasterized=True)
                    axis.plot(*envelope(t, r), **line(str(name), 0.8), label=str(name), zorder=3)
            axis.set(xscale="log", yscale="log")
        row[0].set_ylabel(f"relative change of {LABELS[constant]}")
        row[0].annotate("exact zeros", (0.01, SMALLEST), (0, 3), xycoords=row[0].get_yaxis_transform(),
                        textcoords="offset points", **NOTE)  # fmt: skip
    for axis, scene in zip(axes[0], data["scene"].values, strict=True):
        axis.set_title(f"scene {scene}")
        first, last = axis.get_xlim()
        axis.autoscale(enable=False)
        style.slope_guide(axis, 1.0, (first * 6.0, last / 2.0), 1e-8, "as $t$")
    for axis in axes[-1]:
        axis.set_xlabel("time (s)")
    few_ticks(*axes.flat)
    told = "markers: the largest in a span of time\ndots: single samples"  # where every panel of p_phi is empty
    axes[1, 0].text(0.98, 0.45, told, transform=axes[1, 0].transAxes, ha="right", va="center", **NOTE)
    style.legend_below(figure, axes)
    headline(figure, messages.residuals(data))
    caption = (
        "Change of the energy since the start, relative to E0 - min V, the energy of the nutation, and of both "
        "momenta, relative to the larger. Dots are samples, markers the largest in a window of time (at 1e-17 "
        f"if less); the dashed line rises as t; open markers are variants in angles. {variants.setting(data)} On "
        f"every scene the energy stays at rounding or within bounds with {len(words.holding(data))} of these "
        f"{data.sizes['variant']} variants, which does not bound the error of the motion."
    )
    alt = (
        "Log-log plots of residuals over time: level for discrete Lagrangians and splittings, rising for explicit or "
        "adaptive Runge-Kutta methods."
    )
    return Picture("residuals", figure, caption, alt)


def _windows(data: xr.Dataset) -> Picture:
    figure, axes = panels(len(BANDS), data.sizes["variant"], height=2.0, sharex=True, sharey="row")
    moves = messages.shifts(data.isel(scene=0)).isel(window=-1)
    for row, quantity in zip(axes, BANDS, strict=True):
        size = float(np.abs(data[f"{quantity}_largest"]).max()) or 1.0  # what every method keeps exactly has none
        scale = 10.0 ** np.floor(np.log10(size))
        for axis, (name, cell) in zip(row, by_integrator(data).items(), strict=True):
            mark, run = look(name), cell.dropna("window", subset=["steps"])
            steps = run["steps"].values
            low, middle, high = (run[f"{quantity}_{part}"].values / scale for part in ("least", "mean", "largest"))
            axis.fill_between(steps, low, high, step="pre", color=mark.color, alpha=0.3, lw=0)
            axis.step(steps, middle, where="pre", color=mark.color, lw=2.0)
            axis.axhline(next(iter(middle), np.nan), color=BLACK, lw=0.8, ls=(0, (4, 3)), zorder=3)
            axis.set_xscale("log")
            if quantity == BANDS[0]:
                moved = f"{100.0 * float(moves.sel(variant=name)):+.1g}".replace("-", "\N{MINUS SIGN}")
                axis.set_title(f"{name}\nlast \N{MINUS SIGN} first: {moved}%", fontsize=7.5)
        row[0].set_ylabel(f"{LABELS[quantity]}\nchange / {number(scale)}")
    for axis in axes[-1]:
        axis.set_xlabel("steps")
    if size < ROUNDED:  # of the last quantity, the modified energy
        axes[1, 0].annotate("rounding only", (0.04, 0.05), xycoords="axes fraction", **NOTE)
    few_ticks(*axes.flat, most=4)
    figure.align_ylabels(axes[:, 0])
    axes[0, 0].plot([], [], color=GREY, lw=2.0, label="mean of a window of steps")
    axes[0, 0].plot([], [], color=BLACK, lw=0.8, ls=(0, (4, 3)), label="mean of the first window")
    axes[0, 0].fill_between([], [], [], color=GREY, alpha=0.3, lw=0, label="least to largest in a window")
    style.legend_below(figure, axes[0, 0])
    headline(figure, messages.windows(data))
    momenta = [np.abs(data[f"{name}_{part}"]).max() for name in ("p_phi", "p_psi") for part in ("least", "largest")]
    caption = (
        f"{float(data['steps'].max()):.0e} steps of variants in angles and in the axis chart on "
        f"{data['scene'].values[0]}, {PER_NUTATION:.0f} steps a nutation. A band reaches from the least to the "
        "largest change in a window of steps, the line is its mean, the dashed line that of the first window. A "
        "percentage is the mean of the last window less that of the first, over the band's width. The modified energy "
        f"adds the h^2 term of the discrete motion to the energy. {words.scatter(data)} Momenta stay within "
        f"{max(map(float, momenta)):.0e}."
    )
    alt = (
        "Bands of energy and modified energy over the logarithm of the steps, a column for each method: the mean "
        "energy stays on a dashed line, the mean modified energy leaves it late, by rounding."
    )
    return Picture("windows", figure, caption, alt)


def _rounding(data: xr.Dataset) -> Picture:
    ensembles = by_integrator(data)
    figure, axes = panels(1, len(ensembles), height=2.6, sharex=True, sharey=True)
    bold: dict[str, Any] = {"fontsize": 7.5, "weight": "bold", "va": "center", "ha": "center", "zorder": 5}
    bold |= {"bbox": {"color": "white", "pad": 0.8}}
    for axis, (name, cell) in zip(axes[0], ensembles.items(), strict=True):
        mark, ensemble = look(name), cell.dropna("window", subset=["elapsed"])
        steps, last = ensemble["elapsed"].values, float(ensemble["elapsed"].max())
        for drift in ensemble["drift"].values:
            axis.plot(steps, np.abs(drift), color=mark.color, lw=0.4, alpha=0.3, zorder=1)
        plain, compensated = ensemble["plain_rms"].values, ensemble["rms"].values
        axis.plot(steps, plain, color=BLACK, lw=1.6, ls=(0, (3, 1)), zorder=3)
        axis.plot(steps, compensated, color=mark.color, lw=2.2, zorder=3)
        axis.axvspan(0.1 * last, last, color="#EEEEEE", lw=0, zorder=0)
        gain, middle = number(float(cell["gain"])), math.sqrt(0.1) * last
        ends = float(cell["late"]), float(cell["plain_late"])
        axis.annotate("", (middle, ends[0]), (middle, ends[1]), zorder=4,
                      arrowprops={"arrowstyle": "<->", "shrinkA": 2, "shrinkB": 2, "lw": 0.9})  # fmt: skip
        axis.text(middle, math.sqrt(ends[0] * ends[1]), f"{gain}\N{MULTIPLICATION SIGN}", **bold)
        axis.set(xscale="log", yscale="log", xlabel="steps n")
        axis.set_title(f"{name}\n{messages.walk(cell)}", fontsize=7.5)
        style.slope_guide(axis, 0.5, (steps[0] * 3.0, steps[-1]), 1e-18, r"$n^{1/2}$")
    axes[0, 0].set_ylim(bottom=2e-19)
    axes[0, 0].set_ylabel("drift of modified energy (relative)")
    few_ticks(*axes.flat, most=5)
    members = data.sizes["member"], data.sizes["plain_member"]
    lines = (
        (BLACK, 1.6, (0, (3, 1)), f"plain sums: root mean square of {members[1]} starts"),
        (GREY, 2.2, "-", f"compensated sums: root mean square of {members[0]} starts (thin: each)"),
    )
    for color, width, dash, label in lines:
        axes[0, 0].plot([], [], color=color, lw=width, ls=dash, label=label)
    axes[0, 0].fill_between([], [], [], color="#EEEEEE", lw=0, label=f"last decade of n, over which both are averaged "
                            f"(first {members[1]} starts) for the ratio")  # fmt: skip
    style.legend_below(figure, axes)
    headline(figure, messages.rounding(ensembles))
    caption = (
        f"Drift of the modified energy by rounding near {data['scene'].values[0]}, {PER_NUTATION:.0f} steps a "
        f"nutation, over {float(data['elapsed'].max()):.0e} steps; the chart is in the variant's name. Each of "
        f"{members[0]} starts is a thin line, their root mean square a thick one. Dashed is that of the first "
        f"{members[1]} with plain sums in the same kernels. Above a panel: the fitted exponents of both, in it the "
        f"ratio of the root mean squares over the last decade of steps. {words.walks(ensembles)}"
    )
    alt = "Log-log plots of the drift by rounding against steps for each method, with compensated and plain sums."
    return Picture("rounding", figure, caption, alt)


def _horizons(data: xr.Dataset) -> Picture:
    """Work per nutation that keeps the phase for N nutations: measured at one N, by the law of each variant elsewhere.

    The phase error is LOST (N / N0)^q (h / h0)^p with the measured exponent q and the declared order p, so that the
    work grows as N^(q / p).
    """
    lost = losses(data)
    laws = {name: law for name, loss in lost.items() if (law := keeping(name, loss)) is not None}
    named = chosen(laws)
    figure, axes = panels(1, 1, height=3.4)
    axis, ends = axes[0, 0], {}
    for name, law in laws.items():
        work = law.work(LENGTHS)
        work[work < FEWEST] = np.nan  # fewer steps than any run may have
        if name not in named:
            axis.plot(LENGTHS, work, color=GREY, lw=0.5, alpha=0.5, zorder=1)
            continue
        mark = line(name)
        axis.plot(LENGTHS, work, color=mark["color"], ls=mark["ls"], lw=1.1)
        axis.plot(law.length, law.paid, "o", color=mark["color"], ms=5.5, mec="white", mew=0.6, zorder=4)
        if np.isnan(work).any():
            begins = int(np.flatnonzero(np.isfinite(work))[0])
            note = f"begins at {number(FEWEST)} a nutation:\nfewer were not tried "
            axis.annotate(note, (LENGTHS[begins], work[begins]), (-4, 0), textcoords="offset points", va="center",
                          ha="right", **NOTE)  # fmt: skip
        ends[f"{name}, order {law.order}"] = float(LENGTHS[-1]), float(work[-1]), str(mark["color"])
    axis.set(xscale="log", yscale="log", xlim=(LENGTHS[0], LENGTHS[-1]))
    axis.set_xlabel(f"nutations N over which the phase error stays below {LOST:g} rad")
    axis.set_ylabel("force evaluations a nutation")
    few_ticks(axis)
    axis.plot([], [], "o", color=BLACK, ms=4.5, label=f"measured: where its run reached {LOST:g} rad")
    axis.plot([], [], color=BLACK, lw=1.1, label="extrapolated: as N to the power (growth of its error) / order")
    axis.plot([], [], color=GREY, lw=0.5, alpha=0.5, label="all other methods, extrapolated")
    style.legend_below(figure, axis)
    figure.legends[0].set_title("in brackets: the variables that are stepped, all three angles or the axis alone")
    if named:
        cheapest, dearest = (pick(named, key=lambda name: laws[name].work(LENGTHS[-1])) for pick in (min, max))
        works = [number(float(laws[name].work(LENGTHS[-1]))) for name in (cheapest, dearest)]
        headline(
            figure,
            f"{cheapest} holds the phase over {number(LENGTHS[-1])} nutations (extrapolated) with {works[0]} force "
            f"evaluations a nutation, {dearest} with {works[1]}",
        )
        name_ends(axis, ends)
    caption = (
        f"Force evaluations per nutation that keep the phase error of the nutation of {data['scene'].values[0]} below "
        f"{LOST:g} rad for N nutations, a line a variant, method[chart]. The marker is measured: there each variant, "
        "with a step of its own, loses its phase. The rest follows from its law, error as N^q h^p with the exponent q "
        f"found there and the declared order p, without rounding. Coloured: {len(named)} variants, the familiar ones "
        "and the cheapest of each order for a thousand nutations; grey: all others."
    )
    alt = "Log-log plot of the work per nutation against the nutations that the phase must last, a line a variant."
    return Picture("horizons", figure, caption, alt)


LENGTHS = np.geomspace(10.0, 1e6, 41)  # nutations
FAMILIAR = ("midpoint[angles]", "stormer-verlet[angles]", "rk4[axis]")
MOST = 8  # names


class Keeping(NamedTuple):
    """What it costs to keep the phase for N nutations, by the law of a variant that was measured at one N.

    The phase error of a variant with step h after N nutations is LOST (N / N0)^q (h / h0)^p: q is the exponent of its
    growth that was measured, p the declared order, N0 when a run with step h0 reached LOST. A variant that is to last N
    nutations needs h = h0 (N / N0)^(-q / p), and as many force evaluations a nutation more.
    """

    order: int
    length: float  # nutations after which the phase was lost
    paid: float  # force evaluations a nutation
    power: float  # of the length, with which the cost grows

    def work(self, lengths: Any) -> Any:
        """Force evaluations per nutation that keep the phase for so many nutations."""
        return self.paid * (np.asarray(lengths) / self.length) ** self.power


def keeping(name: str, loss: xr.Dataset) -> Keeping | None:
    """The law of a variant; None without a declared order, or if its phase was not seen to be lost."""
    row = integrator(name) if split_name(name)[0] in integrators() else None
    if row is None or row.order is None or "evaluations" not in loss:
        return None
    length, paid, exponent = (float(loss[key]) for key in ("measured", "evaluations", "exponent"))
    if not (math.isfinite(length) and math.isfinite(paid) and math.isfinite(exponent)):
        return None
    return Keeping(row.order, length, paid, exponent / row.order)


def chosen(laws: Mapping[str, Keeping]) -> list[str]:
    """The variants that are named: the familiar ones, and the cheapest of each order for a thousand nutations."""
    best: dict[int, str] = {}
    for name in sorted(laws, key=lambda name: float(laws[name].work(1000.0))):
        best.setdefault(laws[name].order, name)
    firsts = [best[order] for order in sorted(best)]
    familiar = [name for name in FAMILIAR if name in laws and name not in firsts]
    return [*familiar, *firsts][:MOST]
