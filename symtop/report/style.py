"""The style of all figures: an integrator has the same colour, marker and line everywhere.

Colours are those of Okabe and Ito, which readers with any common colour blindness can distinguish. Every series also
has a marker of its own, and every family a line style, so that a figure can be read in grey. A figure is as wide as the
text of a printed page, 6.5 inches, and its text is at least 7 points high at that width.
"""

import functools
import textwrap
import zlib
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np

from symtop.core.files import replacing, sweep

WIDTH = 6.5  # inches, of a figure: the text block of a page
LEAST_TEXT = 7.0  # points, of any text at that width
DPI, QUICK_DPI = 200, 100  # of figures, and of those of a quick pass

BLACK, ORANGE, SKY, GREEN, YELLOW, BLUE, VERMILLION, PURPLE, GREY = (
    "#000000", "#E69F00", "#56B4E9", "#009E73", "#F0E442", "#0072B2", "#D55E00", "#CC79A7", "#7F7F7F",
)  # fmt: skip
NAVY, PLUM, BROWN, LEAF, TEAL = "#1B3A6B", "#8C4A73", "#8C510A", "#66A61E", "#148F9E"  # dark ones


class Look(NamedTuple):
    """How an integrator is drawn."""

    color: str
    marker: str
    size: float = 4.0
    fill: str = "full"  # of the marker, matplotlib's fillstyle: the chart of a variant
    dash: Any = "-"  # of the line: the family


# shades of a family: distinguishable, and of one hue
BLUES = (BLUE, "#7B9FD1", NAVY)
GREENS = (GREEN, "#7CC9A8", "#00563F")
ORANGES = (ORANGE, "#B37400", "#F5C766")
BLACKS = (BLACK, "#555555", "#999999")
REDS = (VERMILLION, "#F09A66", "#8A3C00")
YELLOWS = ("#B8A500", YELLOW, "#7A6F00")
PURPLES = (PURPLE, PLUM, "#E6B8D2")
SKIES = (SKY, "#2B7BA8", "#A6D5F2")
SHADES = {
    "discrete-lagrangian": BLUES, "splitting": GREENS, "runge-kutta": ORANGES, "lie-group": YELLOWS, "taylor": BLACKS,
    "library": REDS, "exact": (GREY,), "engine": SKIES, "other": PURPLES,
}  # fmt: skip
DASHES = {  # dash patterns of lines by family; other families have solid lines
    "splitting": (0, (6.0, 1.2)), "runge-kutta": (0, (3.0, 1.2)), "lie-group": (0, (6.0, 1.2, 1.0, 1.2)),
    "taylor": (0, (1.5, 0.8)), "library": (0, (1.0, 1.6)), "engine": (0, (3.0, 1.2, 1.0, 1.2)),
}  # fmt: skip
ADAPTIVE = (0, (6.0, 1.2, 1.0, 1.2, 1.0, 1.2))  # of Runge-Kutta methods with a tolerance
UNDATED = {".svg": "Date", ".pdf": "CreationDate"}  # metadata left out, so that files are reproducible
_MARKERS = "osv^<>DPXph8dH"

_LOOKS = {  # of well-known methods, with one colour for variants of a formula; `look` finds others
    "midpoint": Look(BLUE, "o", 6.0), "trapezoidal": Look(SKY, "s"), "stormer-verlet": Look(GREEN, "^"),
    "strang": Look(LEAF, "<"), "cayley": Look(GREENS[1], ">"), "takahashi-imada": Look(GREENS[2], "P"),
    "yoshida-4": Look(GREENS[2], "p"), "srkn-14-6": Look(GREENS[1], "H"), "chin-4a": Look(TEAL, "D"),
    "kahan-li-8": Look(GREENS[2], "X"), "five-rotations": Look(TEAL, "s"), "euler-poincare": Look(SKY, "D"),
    "galerkin-simpson": Look(NAVY, "D"), "galerkin-gauss-8": Look(BLUES[1], "X"), "lie-variational": Look(BLUE, "v"),
    "rk4": Look(ORANGE, "o"), "rk45-compiled": Look(VERMILLION, "s"), "rk45": Look(VERMILLION, "D"),
    "tsit5-fixed": Look(NAVY, "P"), "tsit5": Look(NAVY, "X"), "vern9-fixed": Look(PLUM, "s"), "vern9": Look(PLUM, "d"),
    "dop853-compiled": Look(BROWN, "v"), "dop853-compiled-fixed": Look(BROWN, "^"), "dop853": Look(BROWN, "o"),
    "gauss-4": Look(PURPLE, "^"), "gauss-8": Look(PURPLE, ">"), "gauss-12": Look(ORANGE, "X"),
    "lsoda": Look(REDS[1], "s"), "radau": Look(REDS[2], "v"), "taylor": Look(BLACK, "*", 6.0),
    "series": Look(BLACKS[2], "D"), "series-general": Look(BLACKS[1], "D"), "exact": Look(GREY, "x"),
}  # fmt: skip

FILLS = {"angles": "none", "axis": "full", "attitude": "left", "body": "top"}  # of a marker, by chart


def look(name: str) -> Look:
    """Colour and marker of an integrator or a variant: the marker of ``rk4[angles]`` is open, of ``rk4[axis]`` full.

    One that is not in `_LOOKS` gets a shade of its family and a marker as an unused pair, by its index in the registry,
    to which others are added at the end; for a name that is not registered the pair follows from a hash of the name.
    """
    from symtop.methods.framework.registry import integrators, split_name

    name, chart = split_name(name)
    if chart:
        return look(name)._replace(fill=FILLS[chart])
    registered = integrators()
    family = registered[name].family if name in registered else "other"
    adaptive = family == "runge-kutta" and not registered[name].fixed_step
    dash = ADAPTIVE if adaptive else DASHES.get(family, "-")
    if name in _LOOKS:
        return _LOOKS[name]._replace(dash=dash)
    pairs = {entry[:2] for entry in _LOOKS.values()}
    free = [Look(shade, marker) for marker in _MARKERS for shade in SHADES[family] if (shade, marker) not in pairs]
    siblings = [key for key, method in registered.items() if method.family == family and key not in _LOOKS]
    index = siblings.index(name) if name in siblings else zlib.crc32(name.encode())
    return free[index % len(free)]._replace(dash=dash)


def line(name: str, scale: float = 1.0) -> dict[str, Any]:
    """Arguments of ``plot`` for an integrator or a variant: colour, line, and marker of `scale` times its size."""
    color, marker, size, fill, dash = look(name)
    return {"color": color, "ls": dash, "marker": marker, "fillstyle": fill, "ms": scale * size}


def ink(color: str) -> tuple[float, float, float]:
    """A colour for text on white: the colour itself, or darker (luminance at most 0.18, a contrast of 4.5)."""
    from matplotlib.colors import to_rgb

    rgb = np.array(to_rgb(color))
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    linear *= min(1.0, 0.18 / max(float(linear @ np.array([0.2126, 0.7152, 0.0722])), 1e-9))
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1.0 / 2.4) - 0.055)
    red, green, blue = map(float, encoded)
    return red, green, blue


PAPER: dict[Any, Any] = {
    "figure.dpi": 100, "savefig.dpi": DPI, "figure.constrained_layout.use": True, "font.size": 8.0,
    "figure.titlesize": 9.5, "axes.titlesize": 8.0, "axes.labelsize": 8.0, "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5, "legend.fontsize": 7.5, "legend.title_fontsize": 7.5, "axes.grid": True,
    "grid.color": "#DDDDDD", "grid.linewidth": 0.5, "axes.axisbelow": True, "axes.linewidth": 0.6,
    "axes.spines.top": False, "axes.spines.right": False, "lines.linewidth": 1.1, "lines.markersize": 4.0,
    "hatch.linewidth": 0.5, "svg.hashsalt": "symtop",
    "pdf.fonttype": 42,  # letters that can be searched and edited
}  # fmt: skip


def use() -> None:
    """Set up matplotlib for the report: no display, legible in print, reproducible bytes."""
    mpl.use("Agg")
    plt.rcParams.update(PAPER)


def save(figure: Any, target: Path, dpi: float = DPI) -> None:
    """Write a figure as a PNG, an SVG or a PDF, atomically, and close it."""
    _write(figure, target, dpi)
    plt.close(figure)


sketch = functools.partial(save, dpi=QUICK_DPI)  # for a quick pass, in half the time


def publish(figure: Any, target: Path) -> None:
    """Write a figure as a PNG and, for print, as a PDF beside it, with one layout; close it."""
    _write(figure, target)
    if target.suffix == ".png":
        figure.set_layout_engine("none")
        _write(figure, target.with_suffix(".pdf"))
    plt.close(figure)


def _write(figure: Any, target: Path, dpi: float = DPI) -> None:
    """Write a figure in the format of the ending; ``savefig`` would draw a PNG or a PDF twice, once for layout."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.backends.backend_pdf import FigureCanvasPdf

    kind = target.suffix.lower()
    metadata = {UNDATED.get(kind, "Software"): None}
    sweep(target)
    with replacing(target, target.suffix) as path:
        if kind not in {".png", ".pdf"}:
            figure.savefig(path, metadata=metadata, dpi=dpi)
            return
        figure.set_dpi(dpi)
        if kind == ".pdf":
            FigureCanvasPdf(figure).print_pdf(path, metadata=metadata)
        else:
            FigureCanvasAgg(figure).print_png(path, metadata=metadata)


def headline(figure: Any, message: str) -> None:
    """Write a title above a figure, in lines of about the same length."""
    widths = range(round(6.15 * figure.get_figwidth()), round(12.3 * figure.get_figwidth()) + 1)
    wrapped = [textwrap.wrap(message, width, break_on_hyphens=False) for width in widths]
    lines = next(broken for broken in wrapped if len(broken) == len(wrapped[-1]))  # the narrowest with the least lines
    figure.suptitle("\n".join(lines), x=0.01, ha="left", weight="bold")


def panels(rows: int, columns: int, width: float = WIDTH, height: float = 2.3, **options: Any) -> Any:
    """A grid of axes, always two-dimensional, with room for a title above and a legend below; sizes in inches."""
    use()
    tall = max(2.6, height * rows + 0.8)  # a figure of few rows needs the space for its legend
    return plt.subplots(rows, columns, figsize=(width, tall), squeeze=False, **options)


def grid(count: int, columns: int, labels: tuple[str, str] = ("", ""), **options: Any) -> Any:
    """A figure of `count` equal panels in `columns` columns, and its panels in reading order (one-dimensional).

    `labels` are those of the x axes, below the lowest panel of each column, and of the y axes, at the left. `options`
    are those of `panels`.
    """
    figure, axes = panels(-(-count // columns), columns, **options)
    for axis in axes.flat[count:]:
        axis.set_visible(False)
    visible = axes.flat[:count]
    for axis in visible[-columns:]:
        axis.set_xlabel(labels[0])
        axis.tick_params(which="both", labelbottom=True)  # with shared axes only the last row has labels
    for axis in visible[::columns]:
        axis.set_ylabel(labels[1])
    return figure, visible


def few_ticks(*axes: Any, most: int = 6) -> None:
    """Label at most `most` powers of ten on the logarithmic axes of panels, and no minor ticks."""
    from matplotlib.ticker import LogLocator, NullFormatter

    for panel in axes:
        for axis in (panel.xaxis, panel.yaxis):
            if axis.get_scale() == "log":
                axis.set_major_locator(LogLocator(numticks=most + 1))
                axis.set_minor_formatter(NullFormatter())


def legend_below(figure: Any, axes: Any) -> None:
    """One legend for the whole figure, under it, in as many columns as its longest label allows."""
    handles: dict[str, Any] = {}
    for axis in np.ravel(axes):
        for handle, label in zip(*axis.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    handles = dict(sorted(handles.items(), key=lambda item: isinstance(item[1], mpl.patches.Patch)))  # patches last
    columns = max(1, min(len(handles), int(17.0 * figure.get_figwidth()) // (max(map(len, handles), default=0) + 6)))
    figure.legend(list(handles.values()), list(handles), loc="outside lower center", ncols=columns, frameon=False)


def slope_guide(axis: Any, power: float, x: tuple[float, float], y: float, label: str) -> None:
    """A thin reference line y ~ x^power from (x[0], y), labelled below its middle, on the side where it is free."""
    ends = np.array(x)
    axis.plot(ends, y * (ends / ends[0]) ** power, color=GREY, lw=0.9, ls=(0, (5, 3)), zorder=1)
    middle = float(np.sqrt(ends[0] * ends[1]))
    point = middle, y * (middle / ends[0]) ** power
    side, shift = ("left", 3) if (power > 0.0) != axis.xaxis_inverted() else ("right", -3)
    text = {"color": "#444444", "fontsize": 7.5, "va": "top", "ha": side}
    axis.annotate(label, point, (shift, -2), textcoords="offset points", **text)
