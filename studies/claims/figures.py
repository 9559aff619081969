"""The figure of the study: the verdicts at a glance."""

from collections.abc import Iterator

import pandas as pd
import xarray as xr
from matplotlib.patches import Patch, Rectangle

from symtop.judging.battery import CLAIMS
from symtop.judging.findings import claim_name
from symtop.methods.framework.registry import FAMILIES
from symtop.report import style
from symtop.runner.study import Picture

from .facts import FIRST, by_kind, caught, ledger, parts
from .planted import LIES

SYMBOLS = {"confirmed": "✓", "refuted": "✗", "measured": "○", "undecided": "?", "inapplicable": "∅"}
SAID = {
    "confirmed": "declared correctly, yes or no",
    "measured": "measured, not claimed",
    "inapplicable": "does not apply",
}
TITLES = {"runge-kutta": "Runge-Kutta", "lie-group": "Lie-group", "taylor": "Taylor", "discrete-lagrangian":
          "discrete-Lagrangian", "library": "SciPy"}  # fmt: skip
ROWS = {  # labels of claims whose name alone is not clear
    "energy": "energy over time", "p_phi": "$p_\\varphi$ over time", "p_psi": "$p_\\psi$ over time",
    "axis_length": "length of the axis", "reported": "reported momenta", "invariant": "own invariant",
    "work": "work of a step", "pole": "at a pole",
}  # fmt: skip
COLORS = {
    "confirmed": "#CFE8F3", "refuted": style.VERMILLION, "measured": "#F2F2F2", "undecided": style.YELLOW,
    "inapplicable": "#FFFFFF",
}  # fmt: skip
CAUGHT = "#BFE3D0"  # a planted false claim that is refuted


def pictures(data: xr.Dataset) -> Iterator[Picture]:
    """The matrix of verdicts."""
    data, false = parts(data)
    entries, _ = by_kind(ledger(data))
    if len(entries):
        yield draw_ledger(entries, caught(false))


def draw_ledger(entries: pd.DataFrame, lies: pd.Series) -> Picture:
    """One row a claim, one column a family of methods: how many of its methods have each verdict.

    The last column has the planted false claims, and how many of them are refuted.
    """
    counts = entries.groupby(["family", "claim"])["verdict"].value_counts()
    sizes = entries.groupby("family")[["scene", "integrator"]].apply(lambda part: len(part.drop_duplicates()))
    names = [family for family in (*FAMILIES, "other") if family in sizes]
    figure, axes = style.panels(1, 1, height=0.8 + 0.24 * len(CLAIMS))
    axis = axes[0, 0]
    for column, family in enumerate(names):
        for line, claim in enumerate(CLAIMS):
            count = counts[family].get(claim, pd.Series(dtype=int))
            left, words = column - 0.5, [word for word in FIRST if word in count]
            for word in words:  # its width is its share of the methods
                width = count[word] / count.sum()
                axis.add_patch(Rectangle((left, line - 0.5), width, 1.0, facecolor=COLORS[word], lw=0.0))
                left += width
            axis.add_patch(Rectangle((column - 0.5, line - 0.5), 1.0, 1.0, fill=False, edgecolor="white", lw=1.5))
            axis.text(
                column, line, " ".join(f"{count[word]}{SYMBOLS[word]}" for word in words), ha="center", va="center",
                fontsize=style.LEAST_TEXT, fontweight="bold" if "refuted" in words else "normal",
            )  # fmt: skip
    right = len(names) + 0.25
    for claim, refuted in lies.groupby(lies.index.map(LIES)):
        line, color = CLAIMS.index(claim), CAUGHT if refuted.all() else COLORS["refuted"]
        axis.add_patch(Rectangle((right - 0.5, line - 0.5), 1.0, 1.0, facecolor=color, edgecolor="white", lw=1.5))
        axis.text(
            right, line, f"{refuted.sum()} of {len(refuted)}", ha="center", va="center", fontsize=style.LEAST_TEXT
        )
    axis.set(xlim=(-0.5, (right if len(lies) else len(names) - 1) + 0.5), ylim=(len(CLAIMS) - 0.5, -0.5))
    axis.set_yticks(range(len(CLAIMS)), [ROWS.get(claim, claim_name(claim)) for claim in CLAIMS])
    heads = [f"{TITLES.get(name, name)}\n({sizes[name]})".replace("-", "-\n") for name in names]
    places = [*range(len(names)), right] if len(lies) else range(len(names))
    heads += ["false claims,\nplanted:\ncaught"][: len(lies)]
    axis.set_xticks(places, heads)
    axis.tick_params(length=0, bottom=False, labelbottom=False, labeltop=True)
    axis.grid(visible=False)
    axis.spines[:].set_visible(False)
    handles = [
        Patch(facecolor=COLORS[word], edgecolor=style.GREY, lw=0.4, label=f"{SYMBOLS[word]} {SAID.get(word, word)}")
        for word in FIRST
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False)
    return Picture("ledger", figure)
