"""Two figures of dots over the histories: how far each constant moves, and how the phase error grows."""

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.ticker import FixedLocator, NullLocator

from symtop.measure.conservation import CONSTANTS, RUN_ROUNDING
from symtop.methods.framework.registry import integrators, split_name
from symtop.report import style
from symtop.runner.study import Picture

from . import behaviours, messages, variants

LABELS = {
    "energy": "energy", "modified_energy": "modified energy", "p_phi": r"$p_\varphi$", "p_psi": r"$p_\psi$",
    "phase": "phase",
}  # fmt: skip
NOTE = {"fontsize": style.LEAST_TEXT, "color": "#444444"}
FAMILIES = {
    "discrete-lagrangian": "discrete Lagrangian", "splitting": "splitting", "runge-kutta": "Runge-Kutta",
    "lie-group": "Lie group", "taylor": "Taylor",
}  # fmt: skip
SMALLEST = 1e-17  # what is smaller is drawn here
ZERO = 4e-17  # left of it nothing was measured but zeros
POWERS = (1e-13, 1e-9, 1e-5, 1e-1)  # on the axis of sizes
HELD, LOST = "#9A9A9A", style.VERMILLION
BIN = 2.0 * messages.AS_TIME  # of an exponent, centred on 1: what grows as t is one column
ABREAST = 5  # dots beside each other in a column
LAWS = {0.0: "0\nstays", 0.5: "½", 1.0: "1\nas t", 1.5: "1½", 2.0: "2\nas t²"}
TELLING = {"bounded": messages.as_time, "lost": messages.faster}  # the runs that the title counts


def sizes(histories: xr.Dataset) -> Picture:
    """The largest change of each constant: variants that hold all three by family, every other one by its name."""
    data = variants.without_repeats(histories)
    groups = messages.lost(data)
    lines = _lines(groups)
    figure, axes = style.panels(1, len(CONSTANTS), height=0.5 + 0.145 * len(lines), sharex=True, sharey=True)
    for axis, constant in zip(axes[0], CONSTANTS, strict=True):
        lose = sum(len(names) for gone, names in groups.items() if constant in gone)
        for place, (_, names, gone) in enumerate(lines):
            largest = data[f"{constant}_largest"].sel(variant=names).max("scene").values
            shift = np.linspace(-0.3, 0.3, len(names)) if len(names) > 1 else np.zeros(len(names))
            axis.plot(np.maximum(largest, SMALLEST), place + shift, "o", ms=4.0, mew=0.4, mec="white",
                      color=LOST if constant in gone else HELD)  # fmt: skip
        axis.axvline(ZERO, color=style.GREY, lw=0.8, ls=":", zorder=1)
        whole = data.sizes["variant"]
        axis.set_title(f"{LABELS[constant]}: {whole - lose} hold it, {lose} do not")
        axis.set_xlabel("largest relative change")
    _name_lines(axes[0, 0], lines)
    axes[0, 0].plot([], [], "o", color=HELD, ms=4.0, label="held: at rounding, or a bounded error")
    axes[0, 0].plot([], [], "o", color=LOST, ms=4.0, label="lost: it drifts or grows")
    style.legend_below(figure, axes)
    style.headline(figure, messages.sizes(data))
    caption = (
        "Largest relative change of every constant over the run and all scenes, energies relative to E0 - min V. "
        "A dot is a variant, method[chart]: those that hold all constants on a line for each family, the "
        f"others on their own. {variants.setting(data)} A million steps of rounding explain changes up to "
        f"{RUN_ROUNDING:.0e} of a momentum or of |E|: what a method conserves lies below. A larger change is the "
        "truncation error of a step or, farthest right, a drift."
    )
    alt = "Dot plot of the largest changes of energy and momenta; methods that lose one are named."
    return Picture("sizes", figure, caption, alt)


def _lines(groups: dict[tuple[str, ...], list[str]]) -> list[tuple[str, list[str], tuple[str, ...]]]:
    """Label, variants and lost constants of every line of the figure; a heading has no variants."""
    known, lines = integrators(), list[tuple[str, list[str], tuple[str, ...]]]()
    for gone, names in groups.items():
        what = " and ".join(LABELS[one] for one in gone) if len(gone) < len(CONSTANTS) else "all three"
        lines.append(
            (f"{len(names)} lose{'s' * (len(names) == 1)} {what}" if gone else f"{len(names)} hold all three", [], gone)
        )
        if gone:
            lines += [(name, [name], gone) for name in names]
            continue
        families: dict[str, list[str]] = {}
        for name in names:
            method = split_name(name)[0]
            families.setdefault(known[method].family if method in known else "other", []).append(name)
        lines += [(f"{FAMILIES.get(one, one)}: {len(families[one])}", families[one], ())
                  for one in sorted(families, key=[*FAMILIES, *families].index)]  # fmt: skip
    return lines


def _name_lines(axis: Any, lines: list[tuple[str, list[str], tuple[str, ...]]]) -> None:
    """Labels of the lines, headings in bold, and an axis of sizes with a place for zero."""
    axis.set(xscale="log", xlim=(0.3 * SMALLEST, 30.0), yticks=range(len(lines)), ylim=(len(lines) - 0.4, -0.6))
    axis.set_yticklabels([label for label, *_ in lines], fontsize=style.LEAST_TEXT)
    for text, (_, names, _) in zip(axis.get_yticklabels(), lines, strict=True):
        text.set_weight("normal" if names else "bold")
    for one in axis.figure.axes:
        one.tick_params(axis="y", length=0)
        one.grid(visible=False, axis="y")
        one.xaxis.set_major_locator(FixedLocator([SMALLEST, *POWERS]))
        one.xaxis.set_major_formatter(lambda value, _: "0" if value == SMALLEST else style.number(value))
        one.xaxis.set_minor_locator(NullLocator())


def exponents(histories: xr.Dataset) -> Picture:
    """The growth exponents of the phase error, a dot a run, by what happens to the energy."""
    data = variants.without_repeats(histories)
    groups = {word: slopes for word, slopes in messages.by_energy(data).items() if slopes.size}
    tall = [max(map(len, _columns(slopes).values())) / ABREAST + 3.0 for slopes in groups.values()]
    figure, axes = style.panels(len(groups) or 1, 1, height=1.35, sharex=True, height_ratios=tall or None)
    for axis, (word, slopes), most in zip(axes[:, 0], groups.items(), tall, strict=False):
        told = TELLING.get(word, lambda values: np.zeros(values.size, bool))
        for place, column in _columns(slopes).items():
            count = len(column)
            up, across = np.divmod(np.arange(count), ABREAST)
            abreast = np.where(up < count // ABREAST, ABREAST, count % ABREAST)  # in the row of a dot
            bright = told(np.array(column))
            x = place + 0.16 * BIN * (across - 0.5 * (abreast - 1))
            for chosen, color in ((bright, LOST if word == "lost" else "black"), (~bright, "#B5B5B5")):
                axis.plot(x[chosen], up[chosen] + 0.5, "o", color=color, ms=4.2, mew=0)
            axis.annotate(str(count), (place, up.max() + 1.1), ha="center", va="bottom", **NOTE)
        steady, fast = int(messages.as_time(slopes).sum()), int(messages.faster(slopes).sum())
        rest = slopes.size - steady - fast
        parts = [f"{n} {how}" for n, how in ((steady, "as t"), (fast, "faster"), (rest, "slower")) if n]
        axis.set_title(f"{slopes.size} runs with {messages.ENERGIES[word]}: {', '.join(parts)}", loc="left")
        axis.set(ylim=(0.0, most), yticks=())
        axis.spines["left"].set_visible(False)
        axis.grid(visible=False)
        axis.axvspan(1.0 - messages.AS_TIME, 1.0 + messages.AS_TIME, color="#EFEFEF", lw=0, zorder=0)
    axes[-1, 0].set(xticks=list(LAWS), xticklabels=list(LAWS.values()))
    scenes = data.sizes["scene"]
    axes[-1, 0].set_xlabel(f"power of time with which the phase error grows; a dot: a method on one of {scenes} scenes")
    style.headline(figure, messages.exponents(data))
    caption = (
        "Growth exponents of the phase error over the last decade of time, a dot a run of a method[chart], in columns "
        f"of {BIN:g}; a panel holds the runs whose variant fares alike with its energy on its worst scene. 0 is a "
        "bounded error, 1 a steady lag (shaded), 3/2 the phase under a random walk of the energy, 2 that under a "
        f"drift of the energy. Phase errors below {behaviours.ROUNDED_PHASE:g} rad may be rounding alone, which also "
        f"grows as t^3/2. {variants.setting(data)}"
    )
    alt = "Columns of dots of the growth exponents of the phase error, in a panel for each behaviour of the energy."
    return Picture("exponents", figure, caption, alt)


def _columns(slopes: np.ndarray) -> dict[float, list[float]]:
    """Exponents by the middle of their column."""
    columns: dict[float, list[float]] = {}
    for slope in sorted(map(float, slopes)):
        columns.setdefault(1.0 + BIN * round((slope - 1.0) / BIN), []).append(slope)
    return columns
