"""Figures of the study: the verdicts at a glance, and what tells a symplectic step from one that is not."""

from collections.abc import Mapping, Sequence
from typing import Any

import xarray as xr

from symtop.judge.ledger import CLAIMS, spoken
from symtop.report import style
from symtop.runner.study import Picture

from . import words
from .tables import Defect, defects, findings

MARKED = ("midpoint", "strang", "galerkin-simpson", "sofroniou-spaletta-10", "gauss-4", "gauss-12", "rk4", "rk45")


def pictures(data: xr.Dataset) -> list[Picture]:
    """The matrix of verdicts, and the defect of the bracket against the differencing width."""
    judged = findings(data)
    rows = {words.row_name(*cell): row for cell, row in judged.items()}
    names = [str(name) for name in data["integrator"].values]
    return [
        Picture(
            "ledger",
            verdict_matrix(rows, [spoken(claim) for claim in CLAIMS], words.SYMBOLS),
            words.matrix(judged),
            f"A matrix of integrators and claims with a symbol for each verdict: {words.LEGEND}.",
        ),
        _defects(defects(data, [name for name in names if name in MARKED] or names)),
    ]


def _defects(measured: dict[str, Defect]) -> Picture:
    figure, axes = style.panels(1, 1, height=4.4)
    axis = axes[0, 0]
    for name, defect in measured.items():
        look = style.look(name)
        axis.plot(defect.width, defect.size, look.marker + "-", color=look.color, ms=look.size, label=name)
    axis.set(xscale="log", yscale="log", xlabel="differencing width (rad, momentum)")
    axis.set_ylabel("defect of the bracket after one step")
    finest = min(defect.width.min() for defect in measured.values())
    coarsest = max(defect.width.max() for defect in measured.values())
    lowest = min(defect.size.min() for defect in measured.values())
    style.slope_guide(axis, 2.0, (1.4 * finest, 0.7 * coarsest), 0.5 * lowest, "width$^2$")
    style.legend_below(figure, axes)
    return Picture(
        "bracket",
        figure,
        words.bracket(measured),
        "Log-log plot of the defect against the differencing width: lines of slope two for symplectic methods, level "
        "lines for the others.",
    )


VERDICT_COLORS = {
    "confirmed": "#CFE8F3",
    "refuted": style.VERMILLION,
    "measured": "#F2F2F2",
    "undecided": style.YELLOW,
    "inapplicable": "#FFFFFF",
}


def verdict_matrix(rows: Mapping[str, Sequence[Any]], claims: Sequence[str], symbols: Mapping[str, str]) -> Any:
    """One row an integrator, one column a claim: in each cell the verdict's colour and symbol and what was measured.

    A refuted cell shows what was declared as well. `rows` holds an integrator's findings in the order of `claims`:
    things with `verdict`, `declared` and `measured`.
    """
    from matplotlib.patches import Patch, Rectangle

    figure, axes = style.panels(1, 1, width=14.5, height=0.6 + 0.235 * len(rows))
    axis = axes[0, 0]
    for line, judged in enumerate(rows.values()):
        for column, one in enumerate(judged):
            color = VERDICT_COLORS[one.verdict]
            axis.add_patch(Rectangle((column - 0.5, line - 0.5), 1.0, 1.0, facecolor=color, edgecolor="white", lw=1.0))
            bad = one.verdict == "refuted"
            text = f"{one.declared} | {one.measured}" if bad else one.measured
            text = f"{symbols[one.verdict]} {text}".replace(" +- ", "±").rstrip()
            axis.text(
                column, line, text, ha="center", va="center", fontsize=min(7.5, (108.0 if bad else 130.0) / len(text)),
                color="white" if bad else "black", fontweight="bold" if bad else "normal",
            )  # fmt: skip
    axis.set(xlim=(-0.5, len(claims) - 0.5), ylim=(len(rows) - 0.5, -0.5), yticks=range(len(rows)), yticklabels=rows)
    axis.set_xticks(range(len(claims)), claims)
    axis.tick_params(length=0, top=True, labeltop=True)
    axis.grid(visible=False)
    axis.spines[:].set_visible(False)
    handles = [
        Patch(facecolor=color, edgecolor=style.GREY, lw=0.4, label=f"{symbols[verdict]} {verdict}")
        for verdict, color in VERDICT_COLORS.items()
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), frameon=False)
    return figure
