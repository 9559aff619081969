"""The figures of the population study: run lengths, slowdowns and wins, strata, silent failures, the guard."""

import textwrap
from collections import Counter
from typing import Any

import numpy as np
import xarray as xr

from symtop.methods.framework.registry import split_name
from symtop.report import style
from symtop.report.style import LEAST_TEXT, few_ticks, grid, headline, look, number, panels
from symtop.run.guard import EXPECTED
from symtop.runner.study import Picture

from . import messages, verdicts, words
from .costs import TIE, Share, run_lengths
from .ladder import KEPT, WRONG
from .verdicts import ALL, UNITS, Cell

NAMED = 6  # variants with a label; all others are thin and grey
FAMILIAR = ("rk4[axis]", "strang[axis]", "midpoint[angles]")  # always among them, thin
MARKS = 9  # on a line
SHOWN = 6  # variants of a panel of slowdowns
NOBODY = "nobody"  # the tops on which no variant is the cheapest beyond ties
EVEN = 1e-6  # of a win: what a tie counts between variants with the same wins
FAR = 1e3  # slowdown at which an axis ends
LATEST = 0.995  # of a named variant's costs lie within the axis of a panel
RARE = 1e-3  # share of false alarms at which an axis begins
LEAST = 0.05  # a variant that solves less is named in words
OTHERS = "all other methods"
OTHER = "#999999"  # of variants and bars that a title is not about


def pictures(data: xr.DataTree) -> list[Picture]:
    """Run lengths in seconds and in evaluations, slowdowns, strata, silent failures and the guard."""
    return [
        draw_run_lengths(data, "alone"),
        draw_run_lengths(data, "evaluations"),
        *(draw_slowdowns(data, horizon) for horizon in verdicts.horizons(data)),
        draw_strata(data),
        draw_silent(data),
        draw_guard(data),
    ]


def power(target: float) -> str:
    """A target as a power of ten."""
    return f"$10^{{{np.log10(target):.0f}}}$"


def named(data: xr.DataTree, horizon: str, unit: str) -> list[str]:
    """The familiar variants and those with the most wins at the targets of the axis."""
    standings = [
        verdicts.standings(verdicts.costs(data, Cell(horizon, "axis", target), unit))
        for target in verdicts.targets(data)
    ]
    there = {one.name for listed in standings for one in listed}
    ranked = [listed[place].name for place in range(3) for listed in standings if len(listed) > place]
    familiar = [name for name in FAMILIAR if name in there]
    ahead = [name for name in dict.fromkeys(ranked) if name not in familiar]
    return [*ahead[: NAMED - len(familiar)], *familiar]


def drawn(name: str) -> dict[str, Any]:
    """How a named variant is drawn: its look, as in every figure, and thin if it is familiar."""
    return style.line(name) | {"lw": 0.9 if name in FAMILIAR else 1.7, "zorder": 3, "label": name}


def draw_run_lengths(data: xr.DataTree, unit: str, horizon: str = "short") -> Picture:
    """The share of tops that each variant has solved within a cost, one panel a target."""
    targets, rows = verdicts.targets(data), named(data, horizon, unit)
    scale = 1e6 if unit != "evaluations" else 1.0
    label = "force evaluations of a run" if unit == "evaluations" else "force evaluations × measured price of one (µs)"
    figure, axes = grid(len(targets), 2, (label, "share of tops solved"), height=2.3, sharex=True, sharey=True)
    each = [verdicts.costs(data, Cell(horizon, "axis", target), unit) for target in targets]
    ends = [
        np.quantile(part, LATEST)
        for taken in each
        for name in rows
        if (part := taken.of(name)[np.isfinite(taken.of(name))]).size
    ]
    cheapest = min((float(taken.values.min()) for taken in each if taken.values.size), default=1.0)
    budgets = np.geomspace(0.9 * cheapest, 1.5 * max(ends, default=1.1 * cheapest), 400)
    for axis, target, taken in zip(axes, targets, each, strict=True):
        shares = {name: run_lengths(taken.of(name), budgets) for name in taken.names}
        lacking = [name for name in rows if name not in shares or shares[name][-1] < LEAST]
        for name, share in shares.items():
            if name in rows:
                first = 5 * rows.index(name)  # markers of two lines seldom meet
                there = share if name not in lacking else np.full_like(share, np.nan)  # kept for the legend
                axis.plot(scale * budgets, there, markevery=(first, len(budgets) // MARKS), **drawn(name))
            else:
                axis.plot(scale * budgets, share, color=style.GREY, lw=0.6, alpha=0.4, zorder=1)
        axis.axhline(messages.HALF, color="black", lw=0.8, ls=(0, (1, 2)), zorder=2)
        half = messages.first_to_half(data, Cell(horizon, "axis", target), unit)
        if half is not None:
            axis.plot(half.cost, messages.HALF, "o", color="black", ms=9, mfc="none", mew=1.2, zorder=4)
            said = f"{number(half.cost)}{'' if unit == 'evaluations' else ' µs'} "
            axis.text(
                half.cost, messages.HALF + 0.05, f"{said}  ", ha="right", va="bottom", fontsize=LEAST_TEXT, zorder=5
            )
        axis.set(xscale="log", ylim=(0.0, 1.03), title=f"axis error below {power(target)} rad")
        axis.set_xlim(scale * budgets[0], scale * budgets[-1])
        axis.yaxis.set_major_formatter(lambda value, _: f"{100.0 * value:.0f} %")
        if lacking:
            said = f"below {LEAST:.0%} at any cost drawn:\n" + "\n".join(lacking)
            axis.text(0.02, 0.97, said, transform=axis.transAxes, fontsize=LEAST_TEXT, color="#444444", va="top")
    axes[0].plot([], [], color=style.GREY, lw=0.8, label=OTHERS)
    axes[0].plot([], [], "o", color="black", ms=7, mfc="none", mew=1.2, label="first to half of the tops")
    few_ticks(*axes, most=5)
    first = verdicts.costs(data, Cell(horizon, "axis", targets[0]), unit)
    style.legend_below(figure, axes)
    headline(figure, messages.run_lengths(data, unit, horizon))
    asked, untimed = first.values.shape[1], "" if unit == "evaluations" else "; no run was timed"
    return Picture(
        f"run-lengths-{unit}",
        figure,
        "Share of random tops, no named scene, on which a variant, method[chart], has met the axis error within a "
        f"cost. Further left is faster; a line that ends higher solves more tops within {words.budget(data, horizon)} "
        f"force evaluations a nutation. {words.span(data, horizon)}, {asked:,} with a nutation wider than the largest "
        "error. "
        f"Cost in {UNITS[unit]}{untimed}, with the step or tolerance that suits the top. Thick: variants that win on "
        "the most tops; thin: familiar ones; grey: all others. Ring: first to half of the tops. To "
        f"{targets[0]:.0e}: {words.winner_words(data, Cell(horizon, 'axis', targets[0]), unit, spoken=True)}.",
        f"Empirical distribution functions of the cost, one panel for each axis error, {len(rows)} lines with a name.",
    )


def draw_slowdowns(data: xr.DataTree, horizon: str) -> Picture:
    """The variants with the most wins: median and 10 to 90 % of the slowdown of each, a panel for each target."""
    targets = verdicts.targets(data)
    cells = [verdicts.standings(verdicts.costs(data, Cell(horizon, "axis", target), words.UNIT)) for target in targets]
    wins: Counter[str] = Counter()
    for listed in cells:
        wins.update({one.name: one.won.count + EVEN * one.level.count for one in listed if one.won.total})
    winners = [name for name, total in wins.most_common() if total >= 1.0]
    names = winners[:SHOWN]
    others = ["another method"] if len(winners) > len(names) else []
    lines = [*names, *others, NOBODY]
    spoken = {name for name, _ in messages.first_and_last(data, horizon)}
    figure, axes = panels(1, len(targets), height=0.19 * len(lines) + 1.2, sharey=True)
    for axis, target, listed in zip(axes[0], targets, cells, strict=True):
        for one in (one for one in listed if one.name in names and one.won.total):
            _slowdown(axis, names.index(one.name), one, one.name in spoken)
        solved = max((one.won.total for one in listed), default=0)
        if solved:
            elsewhere = sum(one.won.count for one in listed if one.name not in names)
            nobody = solved - sum(one.won.count for one in listed)
            for place, count in enumerate([*([elsewhere] if others else []), nobody], len(names)):
                _beside(axis, place, messages.share_won(Share(count, solved)))
        axis.set(xscale="log", xlim=(0.6, FAR), ylim=(len(lines) - 0.4, -0.6), yticks=range(len(lines)))
        axis.set(xlabel="times the least cost")
        axis.set_title(f"to {power(target)} rad", pad=24.0)
        axis.annotate(f"cheapest on,\nof {solved:,} tops", (1.3, -0.6), xycoords=("axes fraction", "data"), va="bottom",
                      ha="right", fontsize=LEAST_TEXT, annotation_clip=False)  # fmt: skip
        axis.set_xticks([1.0, 10.0, 100.0, 1000.0], ["1", "10", "100", "1000"])
        axis.grid(visible=False, axis="y")
        axis.tick_params(axis="y", length=0)
    axes[0, 0].set_yticklabels(lines, fontsize=LEAST_TEXT)
    for name, text in zip(lines, axes[0, 0].get_yticklabels(), strict=True):
        text.set_weight("bold" if name in spoken else "normal")
    dark = {"color": "#444444", "lw": 0.0}
    axes[0, 0].plot([], [], "o", ms=4.5, label="median over the tops", **dark)
    axes[0, 0].plot([], [], color="#444444", lw=1.5, label="10 to 90 % of the tops")
    axes[0, 0].plot([], [], ">", ms=4, mfc="white", label="unsolved on 10 % or more", **dark)
    style.legend_below(figure, axes)
    note = (
        f"Cost: force evaluations × measured price of one, alone. Cheapest: every other method costs at least {TIE:g} "
        f"times as much; nobody: two are closer. Counted are the tops that any method solves. "
        f"{messages.asked_sentence(data, horizon)} Variants: the {len(names)} of "
        f"{max(map(len, cells))} methods that are the cheapest {'most often' if others else 'on at least one top'}."
    )
    figure.legends[0].set_title("\n".join(textwrap.wrap(note, 120)))
    headline(figure, messages.slowdowns(data, horizon))
    return Picture(
        f"slowdowns-{horizon}",
        figure,
        f"The {len(names)} variants, method[chart], with the most wins, each at its own step or tolerance. Marker: "
        "median of the slowdown against the cheapest variant on the same top. Bar: from the 10 % to the 90 % quantile; "
        "arrow: not reached within the budget. Beside it the share of the tops that a variant solves on which it is "
        f"the cheapest; last, those on which two are closer. {messages.asked_sentence(data, horizon)} "
        f"{words.span(data, horizon)}, no named scene; cost in {UNITS[words.UNIT]}. "
        "A bar that stays near 1 is a safe choice.",
        "Dot plots of slowdown with bars from the 10 to the 90 % quantile, one panel for each axis error.",
    )


def _slowdown(axis: Any, place: int, one: verdicts.Standing, spoken: bool) -> None:
    """A line of a panel; the variants that the title is about in their colour, the others grey."""
    low, middle, high = one.slowdown
    mark, weight = look(one.name), "bold" if spoken else "normal"
    color = mark.color if spoken else OTHER
    axis.plot([min(low, FAR), min(high, FAR)], [place, place], color=color, lw=1.5, solid_capstyle="butt")
    if not np.isfinite(high):
        axis.plot(0.75 * FAR, place, ">", color=color, mfc="white", ms=4)
    if np.isfinite(middle):
        axis.plot(middle, place, mark.marker, color=color, ms=5, fillstyle=mark.fill)
    _beside(axis, place, messages.share_won(one.won), weight)


def _beside(axis: Any, place: int, text: str, weight: str = "normal") -> None:
    """A number at the right of a line of a panel."""
    axis.annotate(text, (1.3, place), xycoords=("axes fraction", "data"), va="center", ha="right",
                  fontsize=LEAST_TEXT, weight=weight, annotation_clip=False)  # fmt: skip


def draw_strata(data: xr.DataTree) -> Picture:
    """The variant with the most wins of every stratum and target, one panel a horizon."""
    from matplotlib.colors import to_rgb

    targets, kinds, spans = verdicts.targets(data), [ALL, *verdicts.strata(data)], verdicts.horizons(data)
    figure, axes = panels(1, len(spans), height=0.8 + 0.44 * len(kinds), sharey=True)
    for axis, horizon in zip(axes[0], spans, strict=True):
        for line, kind in enumerate(kinds):
            for column, target in enumerate(targets):
                taken, won = verdicts.best(data, Cell(horizon, "axis", target, kind), words.UNIT)
                label, color = "not asked" if not taken.values.size else "none", "#444444"
                if won is not None:
                    method, chart = split_name(taken.names[won.row])
                    strength = 0.95 if won.sure else 0.35
                    shade = strength * np.array(to_rgb(look(method).color)) + (1.0 - strength)
                    box = ([column - 0.49, column + 0.49], line - 0.46, line + 0.46)
                    axis.fill_between(*box, color=shade, lw=0)
                    color = "white" if shade @ np.array([0.3, 0.59, 0.11]) < 0.55 else "black"
                    share = f"{won.share.value:.0%}" if won.share.count else "level"
                    variant = method if chart == "axis" else taken.names[won.row]
                    name = "\n".join(textwrap.wrap(f"{'' if won.sure else '~'}{variant}", 12))
                    label = f"{name}\n{share}"
                axis.text(column, line, label, ha="center", va="center", fontsize=LEAST_TEXT, color=color)
        axis.set(
            xlim=(-0.5, len(targets) - 0.5), ylim=(len(kinds) - 0.5, -0.5), yticks=range(len(kinds)),
            yticklabels=["all tops", *kinds[1:]], xticks=range(len(targets)), xticklabels=map(power, targets),
            xlabel="largest axis error allowed (rad)", title=words.span(data, horizon),
        )  # fmt: skip
        axis.grid(visible=False)
        axis.tick_params(length=0)
    axes[0, 0].set_ylabel("kind of top")
    figure.supxlabel(
        "In a cell: the method (on the axis e and L if it names no chart) that is the cheapest on the most tops, and\n"
        "on what share of those that any method solves. Pale, ~: its lead may be chance. None: no method reaches the "
        "error.",
        fontsize=7.5, ha="left", x=0.01,
    )  # fmt: skip
    headline(figure, messages.strata(data))
    return Picture(
        "strata",
        figure,
        "The variant that wins on the most tops of each kind, and its share of those that a variant solves, for each "
        "axis error. Pale and with a tilde: its lead may be chance or noise of the times; level: two variants are "
        f"closer than a win. Cost in {UNITS[words.UNIT]}, each at its own step or tolerance on each top. "
        f"{words.strata_sentence(data)}",
        "Coloured cells naming the winning variant, a line a stratum, a column an accuracy, a panel a horizon.",
    )


def draw_silent(data: xr.DataTree) -> Picture:
    """The part of the wrong runs that nothing warns of: of all, of those with small steps, and by steps a nutation."""
    share, steps = words.hidden(data), words.hidden_by_steps(data)
    lines = [
        ("all wrong runs", share.everywhere, share.wrong, True),
        (f"at least {words.FINE:g} steps a nutation", share.fine, share.wrong_fine, True),
        *((f"{step:.3g} steps a nutation", silent / max(wrong, 1.0), wrong, False) for step, wrong, silent in steps),
    ]
    places = [k + 0.6 * (k > 1) for k in range(len(lines))]  # the bars of the title stand apart
    figure, axes = panels(1, 1, height=0.19 * len(lines) + 1.2)
    axis = axes[0, 0]
    for place, (_, value, wrong, spoken) in zip(places, lines, strict=True):
        style_of = {"fontsize": 8.0 if spoken else LEAST_TEXT, "weight": "bold" if spoken else "normal"}
        axis.barh(place, value, height=0.75, color=style.VERMILLION if spoken else OTHER)
        axis.text(value + 0.01, place, f"{value:.0%}", va="center", **style_of)
        axis.annotate(f"{wrong:,.0f}", (1.12, place), xycoords=("axes fraction", "data"), va="center", ha="right",
                      annotation_clip=False, **style_of)  # fmt: skip
    axis.annotate("wrong runs", (1.12, -0.6), xycoords=("axes fraction", "data"), ha="right", va="bottom",
                  fontsize=LEAST_TEXT, annotation_clip=False)  # fmt: skip
    axis.set(xlim=(0.0, 1.0), ylim=(places[-1] + 0.6, -0.6), yticks=places, xlabel="share that look healthy")
    axis.set_yticklabels([label for label, *_ in lines], fontsize=LEAST_TEXT)
    axis.xaxis.set_major_formatter(lambda value, _: f"{100.0 * value:.0f} %")
    axis.grid(visible=False, axis="y")
    axis.tick_params(axis="y", length=0)
    figure.supxlabel(
        f"Wrong: the axis is off by more than {WRONG:g} rad within the run. Healthy: it ends without an error and "
        f"keeps\nenergy and momenta to {KEPT:.0%}. {words.span(data, 'short')}, by every method; those with a "
        "tolerance are in\nthe first bar only.",
        fontsize=7.5, ha="left", x=0.01,
    )  # fmt: skip
    headline(figure, messages.silent(data))
    return Picture(
        "silent",
        figure,
        "Wrong runs, and the share of them that look healthy: of all variants, method[chart]; of the variants with a "
        f"fixed step, with at least {words.FINE:g} steps a nutation and at each number of them. "
        f"{words.span(data, 'short')}, no named scene. {words.silent_sentence(data)} A conserved energy is no sign of "
        "a right answer.",
        "Bars of the share of wrong runs that look healthy: of all, of those with small steps, by steps a nutation.",
        lead="How often a run is wrong without a sign",
    )


def draw_guard(data: xr.DataTree) -> Picture:
    """Hits of the guard against its false alarms, by the threshold of its forecast; with the one that it uses."""
    spans = verdicts.horizons(data)
    figure, axes = panels(1, len(spans), height=2.9, sharey=True)
    for axis, horizon in zip(axes[0], spans, strict=True):
        for score, label, color, spot in (
            ("foretold", "the guard, before the run", style.BLACK, (0.25, 0.90)),
            ("watched", "energy and momenta, after it", style.ORANGES[1], (0.40, 0.35)),
        ):
            curve, (hits, alarms) = verdicts.detected(data, horizon, score), verdicts.caught(data, horizon, score)
            seen = max(int(np.searchsorted(curve.alarms, RARE, side="right")) - 1, 0)  # where the panel begins
            axis.plot(np.maximum(curve.alarms, RARE)[seen:], curve.hits[seen:], color=color, lw=2.0)
            axis.plot(max(alarms.value, RARE), hits.value, "o", color=color, ms=7)
            axis.annotate(
                f"{label}:\n{messages.found_of(hits, whole=False)},\n{words.percent(alarms)} of the right ones",
                (max(alarms.value, RARE), hits.value), spot, textcoords="axes fraction", fontsize=LEAST_TEXT,
                color=color, va="top", arrowprops={"arrowstyle": "-", "color": color, "lw": 0.7},
            )  # fmt: skip
        axis.set(xscale="log", xlim=(RARE, 1.05), ylim=(-0.01, 1.03))
        hits, alarms = verdicts.caught(data, horizon)
        tops, length = int(data[horizon].sizes["guarded"]), verdicts.nutations(data, horizon)
        axis.set_title(
            f"{tops} tops over {length:g} nutations:\n{hits.total:,} wrong runs, {alarms.total:,} right ones"
        )
        axis.set(xlabel="share of right runs that are suspected")
    axes[0, 0].set_ylabel("share of wrong runs that are found")
    figure.supxlabel(
        "The guard tries the method on a piece of the run and foretells the error of the axis. Runs that this piece "
        f"covers whole are\nleft out. Wrong: the axis is off by more than {WRONG:g} rad; right: by less than "
        f"{EXPECTED:g} rad. Lines: any threshold; dots: the guard\nwarns at {EXPECTED:g} rad, energy and momenta at "
        f"{KEPT:.0%}.",
        fontsize=7.5, ha="left", x=0.01,
    )  # fmt: skip
    headline(figure, messages.guard(data))
    return Picture(
        "guard",
        figure,
        "Wrong runs that are noticed against right ones that are suspected. Black: by the guard's "
        f"forecast before the run (dot: it warns at {EXPECTED:g} rad). Orange: by the larger error of energy and "
        f"momenta after the run (dot: {KEPT:.0%}). All variants, method[chart], at their ten coarsest steps or "
        "tolerances, on "
        f"{' and on '.join(messages.guarded(data, one) for one in spans)}, without those that the guard's trial covers "
        "whole; no named scene. The higher a line, the more "
        "wrong runs are found at equal false alarms. Silent failures are counted on all tops instead.",
        "Receiver operating characteristics of the guard and of the conserved quantities, with their thresholds.",
    )
