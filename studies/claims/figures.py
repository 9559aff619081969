"""Figures of the study: the verdicts at a glance, and what tells a symplectic step from one that is not."""

import numpy as np
import xarray as xr

from symtop.judging.claims import SCENE
from symtop.judging.ledger import CLAIMS, Finding, spoken
from symtop.report import style
from symtop.runner.study import Picture

from .tables import defects, findings
from .words import LEGEND, SYMBOLS, count_words

MARKED = ("midpoint", "strang", "galerkin-simpson", "sofroniou-spaletta-10", "gauss-4", "gauss-12", "rk4", "rk45")
REFINED = 100.0  # a defect that falls by more than this over the differencing widths is an error of the differencing
COLORS = {
    "confirmed": "#CFE8F3", "refuted": style.VERMILLION, "measured": "#F2F2F2", "undecided": style.YELLOW,
    "inapplicable": "#FFFFFF",
}  # fmt: skip


def pictures(data: xr.Dataset) -> list[Picture]:
    """The matrix of verdicts, and the defect of the bracket against the differencing width."""
    return [_matrix(findings(data)), _bracket(data)]


def _matrix(judged: dict[str, list[Finding]]) -> Picture:
    """One row an integrator, one column a claim: what was measured and, if that refutes it, what was declared."""
    from matplotlib.patches import Patch, Rectangle

    figure, axes = style.panels(1, 1, width=14.5, height=0.6 + 0.235 * len(judged))
    axis = axes[0, 0]
    for line, row in enumerate(judged.values()):
        for column, one in enumerate(row):
            color = COLORS[one.verdict]
            axis.add_patch(Rectangle((column - 0.5, line - 0.5), 1.0, 1.0, facecolor=color, edgecolor="white", lw=1.0))
            bad = one.verdict == "refuted"
            text = f"{SYMBOLS[one.verdict]} {f'{one.declared} | ' if bad else ''}{one.measured}"
            text = text.replace(" +- ", "±").rstrip()
            axis.text(
                column, line, text, ha="center", va="center", fontsize=min(7.5, (108.0 if bad else 130.0) / len(text)),
                color="white" if bad else "black", fontweight="bold" if bad else "normal",
            )  # fmt: skip
    axis.set(xlim=(-0.5, len(CLAIMS) - 0.5), ylim=(len(judged) - 0.5, -0.5))
    axis.set_yticks(range(len(judged)), list(judged))
    axis.set_xticks(range(len(CLAIMS)), list(map(spoken, CLAIMS)))
    axis.tick_params(length=0, top=True, labeltop=True)
    axis.grid(visible=False)
    axis.spines[:].set_visible(False)
    handles = [Patch(facecolor=color, edgecolor=style.GREY, lw=0.4, label=f"{SYMBOLS[verdict]} {verdict}")
               for verdict, color in COLORS.items()]  # fmt: skip
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), frameon=False)
    caption = (
        f"Every claim of every integrator, on {SCENE} where a row names no other scene: {count_words(judged)}. A claim "
        "is judged in every chart of a method, and its worst chart is shown; the long runs take up to a million steps, "
        "all other measurements a ladder of steps or tolerances. The text of a cell is what was measured; grey cells "
        "claim nothing, white ones do not apply."
    )
    alt = f"A matrix of integrators and claims with a symbol for each verdict: {LEGEND}."
    return Picture("ledger", figure, caption, alt)


def _bracket(data: xr.Dataset) -> Picture:
    names = [str(name) for name in data["integrator"].values]
    measured = defects(data, [name for name in names if name in MARKED] or names)
    figure, axes = style.panels(1, 1, height=4.4)
    axis = axes[0, 0]
    for name, (width, defect) in measured.items():
        look = style.look(name)
        axis.plot(width, defect, look.marker + "-", color=look.color, ms=look.size, label=name)
    axis.set(xscale="log", yscale="log", xlabel="differencing width (rad, momentum)")
    axis.set_ylabel("defect of the bracket after one step")
    widths, sizes = (np.concatenate(values) for values in zip(*measured.values(), strict=True))
    style.slope_guide(axis, 2.0, (1.4 * widths.min(), 0.7 * widths.max()), 0.5 * sizes.min(), "width$^2$")
    style.legend_below(figure, axes)
    falling = [name for name, (_, defect) in measured.items() if defect[-1] < defect[0] / REFINED]
    level = [name for name in measured if name not in falling]
    caption = (
        f"How far one step is from preserving the Poisson bracket, which a symplectic step does, on {SCENE} in the "
        "chart where it is farthest, against the width of the central differences that measure it. For a symplectic "
        "step the defect is an error of the differencing and falls with the square of the width: "
        f"{', '.join(falling) or 'none'}. For the others it is real and levels off: {', '.join(level) or 'none'}."
    )
    alt = (
        "Log-log plot of the defect against the differencing width: lines of slope two for symplectic methods, level "
        "lines for the others."
    )
    return Picture("bracket", figure, caption, alt)
