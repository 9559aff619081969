"""Figures of the study: the verdicts at a glance, and what tells a symplectic step from one that is not."""

import xarray as xr

from symtop.judge.ledger import CLAIMS, spoken
from symtop.report import style
from symtop.report.figures import verdict_matrix
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
