"""Figures of the study: the verdicts at a glance, and what tells a symplectic step from one that is not."""

from collections import Counter

import numpy as np
import xarray as xr
from matplotlib.ticker import NullLocator

from symtop.judging.battery import CLAIMS, SCENE
from symtop.judging.findings import Finding, claim_name
from symtop.methods.framework.registry import FAMILIES, integrators
from symtop.report import style
from symtop.report.figures import name_ends
from symtop.report.sentences import joined
from symtop.runner.study import Picture

from .tables import defects, findings
from .words import LEGEND, SYMBOLS, count_words

MARKED = ("midpoint", "strang", "galerkin-simpson", "sofroniou-spaletta-10", "gauss-4", "gauss-12", "rk4", "rk45")
REFINED = 100.0  # a defect that falls by more than this over the differencing widths is an error of the differencing
WORST = ("refuted", "undecided", "confirmed", "measured", "inapplicable")  # in a cell, from the left
VERDICTS_SAID = {
    "confirmed": "claim confirmed, yes or no",
    "measured": "measured, not claimed",
    "inapplicable": "does not apply",
}
TITLES = {"runge-kutta": "Runge-Kutta", "lie-group": "Lie-group", "taylor": "Taylor", "discrete-lagrangian":
          "discrete-Lagrangian"}  # fmt: skip
ROWS = {  # what a name alone does not say
    "energy": "energy over time", "p_phi": "$p_\\varphi$ over time", "p_psi": "$p_\\psi$ over time",
    "axis_length": "length of the axis", "reported": "reported momenta", "invariant": "own invariant",
    "work": "work of a step", "pole": "at a pole",
}  # fmt: skip
COLORS = {
    "confirmed": "#CFE8F3", "refuted": style.VERMILLION, "measured": "#F2F2F2", "undecided": style.YELLOW,
    "inapplicable": "#FFFFFF",
}  # fmt: skip


def pictures(data: xr.Dataset) -> list[Picture]:
    """The matrix of verdicts, and the defect of the bracket against the differencing width."""
    return [_matrix(findings(data)), _bracket(data)]


def _matrix(judged: dict[str, list[Finding]]) -> Picture:
    """One row a claim, one column a family of methods: how many of its methods have each verdict."""
    from matplotlib.patches import Patch, Rectangle

    families = by_family(judged)
    names = [family for family in FAMILIES if family in families]
    figure, axes = style.panels(1, 1, height=0.8 + 0.24 * len(CLAIMS))
    axis = axes[0, 0]
    for column, family in enumerate(names):
        for line, claim in enumerate(CLAIMS):
            count = Counter(one.verdict for row in families[family] for one in row if one.claim == claim)
            there, left = [word for word in WORST if count[word]], column - 0.5
            for word in there:  # as wide as its share of the methods
                width = count[word] / count.total()
                axis.add_patch(Rectangle((left, line - 0.5), width, 1.0, facecolor=COLORS[word], lw=0.0))
                left += width
            axis.add_patch(Rectangle((column - 0.5, line - 0.5), 1.0, 1.0, fill=False, edgecolor="white", lw=1.5))
            axis.text(
                column, line, ", ".join(f"{count[word]} {SYMBOLS[word]}" for word in there), ha="center", va="center",
                fontsize=style.LEAST_TEXT, fontweight="bold" if count["refuted"] else "normal",
            )  # fmt: skip
    axis.set(xlim=(-0.5, len(names) - 0.5), ylim=(len(CLAIMS) - 0.5, -0.5))
    axis.set_yticks(range(len(CLAIMS)), [ROWS.get(claim, claim_name(claim)) for claim in CLAIMS])
    heads = [TITLES.get(name, name).replace("-", "\n") for name in names]
    counts = [methods(len(families[name])) for name in names]
    axis.set_xticks(range(len(names)), [f"{head}\n{count}" for head, count in zip(heads, counts, strict=True)])
    axis.tick_params(length=0, bottom=False, labelbottom=False, labeltop=True)
    axis.grid(visible=False)
    axis.spines[:].set_visible(False)
    said = {verdict: f"{SYMBOLS[verdict]} {VERDICTS_SAID.get(verdict, verdict)}" for verdict in WORST}
    handles = [Patch(facecolor=COLORS[verdict], edgecolor=style.GREY, lw=0.4, label=label)
               for verdict, label in said.items()]  # fmt: skip
    figure.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False)
    number = Counter(one.verdict for row in judged.values() for one in row)
    decided = number["confirmed"] + number["refuted"]
    style.headline(figure, f"{number['confirmed']} of {decided} claims that could be judged are confirmed, "
                           f"{number['refuted']} refuted; {number['undecided']} are left undecided")  # fmt: skip
    caption = (
        f"Claims of every integrator by family, on {SCENE} where a table row names no other scene: "
        f"{count_words(judged)}. A number is that of the methods with a verdict; below the family the number of its "
        "methods. A claim is judged in every chart of a method, and its worst chart counts; the long runs take up to a "
        "million steps, all other measurements a ladder of steps or tolerances. A cell is coloured by the shares "
        "of its verdicts. Grey: not claimed, and measured all the same; white: does not apply. Each method and what "
        "was measured is in the table."
    )
    alt = f"A matrix of claims and families of methods with the number of methods for each verdict: {LEGEND}."
    return Picture("ledger", figure, caption, alt)


def methods(count: int) -> str:
    """So many methods."""
    return f"{count} method{'s' * (count != 1)}"


def by_family(judged: dict[str, list[Finding]]) -> dict[str, list[list[Finding]]]:
    """The findings of the integrators of each family; of those that are not registered any more under "other"."""
    known, families = integrators(), {}
    for name, row in judged.items():
        method = known.get(name.partition(" on ")[0])
        families.setdefault(method.family if method else "other", []).append(row)
    return families


def bracket_message(falling: list[str], level: list[str]) -> str:
    """Which methods are symplectic, by the defect that falls with the width of the differences, and which are not."""
    if not falling or not level:
        return f"{'No' if level else 'Each'} defect of the Poisson bracket falls with the width of the differences"
    named = f"{', '.join(falling[:-1])} and {falling[-1]} are" if len(falling) > 1 else f"{falling[0]} is"
    return f"{named} symplectic: the defect falls with the difference width; that of {len(level)} others levels off"


def _bracket(data: xr.Dataset) -> Picture:
    names = [str(name) for name in data["variant"].values]
    measured = defects(data, [name for name in names if name in MARKED] or names)
    figure, axes = style.panels(1, 1, height=2.8)
    axis, ends = axes[0, 0], {}
    for name, (width, defect) in measured.items():
        look = style.line(name)
        axis.plot(width, defect, **look, mec="white", mew=0.5)  # so that one marker shows within another
        least = int(np.argmin(width))
        ends[name] = float(width[least]), float(defect[least]), str(look["color"])
    axis.set(
        xscale="log",
        yscale="log",
        xlabel="width of the finite differences that measure the defect (not the step), finer to the right",
    )
    axis.invert_xaxis()
    ticks = sorted({float(value) for width, _ in measured.values() for value in width})
    axis.set_xticks(ticks, [f"{tick:.2g}" for tick in ticks])
    axis.xaxis.set_minor_locator(NullLocator())
    axis.set_ylabel("defect of the Poisson bracket\nafter one step")
    widths, sizes = (np.concatenate(values) for values in zip(*measured.values(), strict=True))
    style.slope_guide(axis, 2.0, (1.4 * widths.min(), 0.7 * widths.max()), 0.5 * sizes.min(), "width$^2$")
    falling = [name for name, (_, defect) in measured.items() if defect[-1] < defect[0] / REFINED]
    level = [name for name in measured if name not in falling]
    style.headline(figure, bracket_message(falling, level))
    if gauss := [name for name in level if name.startswith("gauss-")]:
        why = "symplectic for canonical\nequations; these are Lie-Poisson\n(the bracket depends on the state)"
        told = f"{' and '.join(gauss)}: {why}"
        axis.text(0.985, 0.68, told, transform=axis.transAxes, ha="right", va="top", fontsize=7.5,
                  color=style.ink(style.ORANGE))  # fmt: skip
    name_ends(axis, ends)
    caption = (
        f"How far one step is from preserving the Poisson bracket, which a symplectic step does, on {SCENE} in the "
        "chart where it is farthest, against the width of the central differences that measure it. A defect that falls "
        f"with the square of the width is an error of the differencing: {joined(falling)}. One that levels off is "
        f"real: {joined(level)}. Gauss methods are symplectic for canonical equations. In the variables (e, L) those "
        "of the top are Lie-Poisson, with a bracket that depends on the state, and no Gauss method preserves it."
    )
    alt = (
        "Log-log plot of the defect against the differencing width: lines of slope two for symplectic methods, level "
        "lines for the others."
    )
    return Picture("bracket", figure, caption, alt)
