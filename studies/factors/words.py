"""Sentences and tables of the factors study, from its dataset."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr

from symtop.report.sentences import abridged, joined
from symtop.runner.study import Table

from .cells import COMPILED, FAMILIES, KERNEL, SAMPLES, SCIPY_PYTHON, SCIPYS, SIMULATE, SOLVE_IVP
from .tables import (
    LEAST,
    NOISY,
    TIE,
    Bar,
    Change,
    Column,
    Timed,
    busy,
    changes,
    chart_ratio,
    fastest,
    goals_of,
    least_share,
    noisy,
    times,
    waterfall,
)  # fmt: skip

HOW_TO_READ = (
    "Four factors make the time of a run: the method, the chart that its equations are written in, the language that "
    "executes them and the call around them. A variant is a method in one chart. Every variant has its own step or "
    "tolerance, the coarsest found that meets the stated error of the axis, so that times compare at equal accuracy. "
    "A factor's effect is the ratio of two measured times that differ in this factor alone. The waterfall changes one "
    "factor after the other. A table has the same factor's effect in every other surrounding, because factors do not "
    "simply multiply: a smaller chart helps a compiled loop more than a Python one. A kernel is the bare solver with "
    f"two samples; simulate and solve_ivp are what a user calls, with {SAMPLES} samples. SciPy's loop is Python, "
    "whatever the language of its right-hand side. The closed form does not take part."
)

WATERFALL = ["scene", "nutations", "axis error", "changed", "run", "call", "time", "ratio", "product so far", "noise"]
EFFECTS = ["factor", "from", "to", "pairs", "times faster, median", "least", "most"]
SCIPY = ["scene", "nutations", "axis error", "SciPy", "solve_ivp", "simulate", "times", "SciPy", "its kernel",
         "own kernel", "times"]  # fmt: skip
CHARTS_BESIDE = ("attitude", "angles")
CHARTS = ["scene", "nutations", "axis error", "method", "angles", "axis", "attitude", "angles/axis", "attitude/axis"]
FACTORIAL = [
    "scene", "nutations", "axis error", "method", "run", "language", "error reached", "force evaluations", "kernel",
    "simulate", "solve_ivp", "noise",
]  # fmt: skip


MICRO = "\N{MICRO SIGN}s"


def duration(value: float) -> str:
    """A time in the unit that suits it."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), (MICRO, 1e-6)):
        if value >= size:
            return f"{value / size:.3g} {unit}"
    return f"{value / 1e-9:.3g} ns"


def times_faster(value: float) -> str:
    """A ratio with two or three digits, without exponents."""
    return f"{value:,.0f}" if value >= 99.5 else f"{value:.3g}"


def waterfalls(data: xr.Dataset, *, call_first: bool = False) -> list[tuple[str, float, float, list[Bar]]]:
    """Scene, nutations, target and bars of every goal that has a waterfall; none of times of a busy machine."""
    every = [
        (scene, span, target, waterfall(times(part), call_first=call_first))
        for scene, span, target, part in ([] if busy(data) else goals_of(data))
    ]
    return [one for one in every if one[3]]


def all_changes(data: xr.Dataset) -> list[Change]:
    """The effects of one factor over all scenes and goals."""
    ratios: dict[tuple[str, str, str], list[float]] = {}
    for *_, part in goals_of(data):
        for change in changes(times(part)):
            ratios.setdefault(change[:3], []).extend(change.ratios)
    return [Change(*step, tuple(values)) for step, values in ratios.items()]


def product(scene: str, nutations: float, target: float, bars: Sequence[Bar]) -> str:
    """Where a waterfall begins and ends."""
    first, last = bars[0].time, bars[-1].time
    return (
        f"The kernel of {last.name} takes {duration(last.seconds)} where {first.name} called through {first.call} "
        f"takes {duration(first.seconds)}, {times_faster(first.seconds / last.seconds)} times less: on {scene}, "
        f"{nutations:g} nutations, axis error {target:.0e}."
    )


def largest_step(bars: Sequence[Bar]) -> str:
    """The largest step of a waterfall."""
    largest = max(bars[1:], key=lambda bar: bar.ratio)
    return (
        f"The largest step on the way is the {largest.factor}, {largest.change}, with {times_faster(largest.ratio)} "
        "times."
    )


class Against(NamedTuple):
    """One of SciPy's methods in its fastest chart beside the fastest compiled variant, called by a user and inside."""

    public: Timed
    ours: Timed
    inner: Timed
    ours_inner: Timed

    @property
    def user(self) -> float:
        """How many times less the own variant takes where a user measures."""
        return self.public.seconds / self.ours.seconds

    @property
    def author(self) -> float:
        """How many times less it takes in the inner loop."""
        return self.inner.seconds / self.ours_inner.seconds


def against_scipy(rows: Sequence[Timed]) -> list[Against]:
    """The comparison that a user makes beside the one that an author makes, against each of SciPy's methods."""
    pairs: list[Against] = []
    if not any(one.call == SIMULATE for one in rows):
        return pairs
    ours = {call: fastest(rows, call, COMPILED) for call in (SIMULATE, KERNEL)}
    for scheme in SCIPYS:
        theirs = {
            call: min((one for one in rows if (one.method, one.language, one.call) == (scheme, SCIPY_PYTHON, call)),
                      key=lambda one: one.seconds, default=None)
            for call in (SOLVE_IVP, KERNEL)
        }  # fmt: skip
        public, inner = theirs[SOLVE_IVP], theirs[KERNEL]
        if public is not None and inner is not None:
            pairs.append(Against(public, ours[SIMULATE], inner, ours[KERNEL]))
    return pairs


def scipy_sentence(data: xr.Dataset) -> str:
    """From how many to how many times SciPy's methods take longer; empty if they were not timed."""
    pairs = [pair for *_, part in goals_of(data) for pair in against_scipy(times(part))]
    if not pairs:
        return ""
    user, author = (sorted(values) for values in zip(*((pair.user, pair.author) for pair in pairs), strict=True))
    methods = abridged(list(dict.fromkeys(pair.public.method for pair in pairs)))
    return (
        f"SciPy's {methods} take {times_faster(user[0])} to {times_faster(user[-1])} times as long as the fastest "
        "compiled variant of this study (series[axis] takes no part) where a user measures, solve_ivp against "
        f"simulate. They take {times_faster(author[0])} to {times_faster(author[-1])} times as long in the inner "
        "loop, kernel against kernel."
    )


def family_ratios(data: xr.Dataset, family: str, chart: str) -> list[float]:
    """Kernel time of a chart over that of the axis: every scheme of a family, scene and goal where both were timed."""
    every = [times(part) for *_, part in goals_of(data)]
    ratios = [chart_ratio(rows, scheme, chart) for rows in every for scheme in FAMILIES[family]]
    return [ratio for ratio in ratios if math.isfinite(ratio)]


def chart_costs(data: xr.Dataset) -> dict[tuple[str, str], list[float]]:
    """The ratios of every family and every chart beside the axis where both were timed."""
    every = {(family, chart): family_ratios(data, family, chart) for family in FAMILIES for chart in CHARTS_BESIDE}
    return {key: ratios for key, ratios in every.items() if ratios}


def families_sentence(data: xr.Dataset) -> str:
    """What a larger chart costs the families of methods, and what the angles cost them, at equal error of the axis."""
    costs, parts = chart_costs(data), []
    for chart in CHARTS_BESIDE:
        middles = {family: float(np.median(ratios)) for (family, one), ratios in costs.items() if one == chart}
        if middles:
            ends = dict.fromkeys(pick(middles, key=lambda name: middles[name]) for pick in (min, max))
            said = " to ".join(f"{middles[name]:.2f} ({name})" for name in ends)
            who = "it takes" if parts else "a compiled run takes"
            parts.append(f"In {chart} {who} {said} times as long{'' if parts else ' as on the axis alone'}.")
    if not parts:
        return ""
    return f"{' '.join(parts)} These are medians of families of methods, at equal error of the axis."


def charts_message(data: xr.Dataset) -> str:
    """What the larger charts cost the first family that was timed in several, as a title."""
    told = {"angles": "in Euler angles", "attitude": "with the whole attitude"}
    for family in FAMILIES:
        known = {chart: family_ratios(data, family, chart) for chart in told}
        middles = {chart: float(np.median(ratios)) for chart, ratios in known.items() if ratios}
        parts = [f"{more(middle)} time {told[chart]} ({middle:.2f} times)" for chart, middle in middles.items()]
        if parts:
            subject = f"{family[0].upper()}{family[1:]} methods"
            return f"{subject} take {joined(parts)} compared with the axis alone, at equal error in the median"
    return "No method was timed in several charts"


def more(ratio: float) -> str:
    """A ratio of times in words; those that differ by less than `TIE` are level."""
    return "more" if ratio > 1.0 + TIE else "less" if ratio < 1.0 - TIE else "the same"


def waterfall_message(shown: Sequence[tuple[str, float, float, list[Bar]]]) -> str:
    """The largest factor of the whole gain, in every order that is drawn, as a title."""
    bars = shown[0][-1]
    factor = max(bars[1:], key=lambda bar: bar.ratio).factor
    gains = [max(bar.ratio for bar in part[1:] if bar.factor == factor) for *_, part in shown]
    ways = ["through simulate" if part[-1].factor == "call" else "with the solver alone" for *_, part in shown]
    said = ", ".join(f"{times_faster(gain)} times {way}" for gain, way in zip(gains, ways, strict=True))
    whole = times_faster(bars[0].time.seconds / bars[-1].time.seconds)
    return f"The {factor} makes the largest part of the gain of {whole} times: {said}"


def factors_sentence(data: xr.Dataset) -> str:
    """The largest effect of each factor but the method over the whole factorial."""
    largest: dict[str, Change] = {}
    for change in all_changes(data):
        known = largest.get(change.factor)
        if change.factor != "method" and (known is None or np.median(change.ratios) > np.median(known.ratios)):
            largest[change.factor] = change
    parts = [
        f"the {factor} ({one.before} to {one.after}) {times_faster(float(np.median(one.ratios)))} times"
        for factor, one in largest.items()
    ]
    if not parts:
        return ""
    return (
        f"Changed alone, these factors make a run faster: {joined(parts)}. Each is the largest effect of its factor, "
        "the median over all pairs of times that differ in nothing else."
    )


def accuracy_sentence(data: xr.Dataset) -> str:
    """How equal the accuracy is."""
    share = (data[Column.AXIS] / data["target"]).where(np.isfinite(data[Column.SECONDS]).any("call"))
    values, least = share.values[np.isfinite(share.values)], least_share(data)
    loosest = str(share["variant"].values[np.argwhere((share.transpose("variant", ...) == least).values)[0][0]])
    return (
        f"Every timed run meets its target; {np.mean(values >= LEAST):.0%} of them have an error above {LEAST:g} of "
        f"it, and the least is {least:.2g} of it, with {loosest}."
    )


def noise_sentence(data: xr.Dataset) -> str:
    """How far the times can be trusted."""
    loud, every = noisy(data)
    usual = np.nanmedian(data[Column.SPREAD])
    return (
        f"A time is the median of its processes, whose quartiles are {usual:.0%} apart for the median time and more "
        f"than {NOISY:.0%} for {loud} of {every}."
    )


def verdict(data: xr.Dataset) -> list[str]:
    """The waterfalls, the factors, SciPy, the charts, and what the numbers are worth."""
    if busy(data):
        loud, every = noisy(data)
        said = f"{loud} of {every} times differ by more than {NOISY:.0%} from process to process"
        return [f"Not measured: the machine was busy. {said}; repeat it on a quiet one.", accuracy_sentence(data)]
    said = [
        *(f"{product(*one)} {largest_step(one[-1])}" for one in waterfalls(data)[:2]),  # the tables have the others
        factors_sentence(data),
        scipy_sentence(data),
        families_sentence(data),
        accuracy_sentence(data),
        noise_sentence(data),
    ]
    return [sentence for sentence in said if sentence]


def tables(data: xr.Dataset) -> list[Table]:
    """The waterfall, the effects, the charts side by side and the whole factorial."""
    falls, charts, rows = [], [], []
    for scene, span, target, bars in [*waterfalls(data), *waterfalls(data, call_first=True)]:
        goal = [scene, f"{span:g}", f"{target:.0e}"]
        for bar in bars:
            run = bar.time
            so_far = bars[0].time.seconds / run.seconds
            cells = [run.name, run.call, duration(run.seconds), f"{bar.ratio:.3g}" if bar.factor else ""]
            changed = f"{bar.factor}: {bar.change}" if bar.factor else ""
            falls.append([*goal, changed, *cells, f"{so_far:.3g}", f"{run.spread:.0%}"])
    effects = [
        [change.factor, change.before, change.after, str(len(change.ratios)), f"{np.median(change.ratios):.3g}",
         f"{min(change.ratios):.3g}", f"{max(change.ratios):.3g}"]
        for change in all_changes(data)
    ]  # fmt: skip
    for scene, span, target, part in goals_of(data):
        goal, taken = [scene, f"{span:g}", f"{target:.0e}"], times(part)
        for scheme in (scheme for schemes in FAMILIES.values() for scheme in schemes):
            seconds = {
                one.chart: one.seconds
                for one in taken
                if (one.method, one.language, one.call) == (scheme, COMPILED, KERNEL)
            }
            if len(seconds) > 1:
                shown = [
                    duration(seconds[chart]) if chart in seconds else "" for chart in ("angles", "axis", "attitude")
                ]
                ratios = [chart_ratio(taken, scheme, chart) for chart in ("angles", "attitude")]
                charts.append([*goal, scheme, *shown, *(f"{r:.2f}" if math.isfinite(r) else "" for r in ratios)])
        rows += [[*goal, *row] for row in _factorial(part, taken)]
    return [
        *(table for table in (_scipy(data), _families(data)) if table.rows),
        Table("The waterfall: one factor at a time, the call last and the call first", WATERFALL, falls),
        Table("What one factor does, everything else held", EFFECTS, effects),
        Table("Compiled kernels by chart, at equal error of the axis", CHARTS, charts),
        Table("The factorial", FACTORIAL, rows),
    ]


def _scipy(data: xr.Dataset) -> Table:
    lines = [
        [scene, f"{span:g}", f"{target:.0e}", pair.public.name, duration(pair.public.seconds),
         f"{duration(pair.ours.seconds)} ({pair.ours.name})", times_faster(pair.user), pair.inner.name,
         duration(pair.inner.seconds), f"{duration(pair.ours_inner.seconds)} ({pair.ours_inner.name})",
         times_faster(pair.author)]
        for scene, span, target, part in goals_of(data)
        for pair in against_scipy(times(part))
    ]  # fmt: skip
    return Table(
        "SciPy's methods, each in its fastest chart, beside the fastest compiled variant of this study", SCIPY, lines
    )


def _families(data: xr.Dataset) -> Table:
    lines = [
        [family, chart, str(len(ratios)), *(f"{value:.2f}" for value in (np.median(ratios), min(ratios), max(ratios)))]
        for (family, chart), ratios in chart_costs(data).items()
    ]
    title = "Time of a compiled run in a larger chart over that on the axis alone, at equal error of the axis"
    return Table(title, ["methods", "chart", "pairs", "times as long, median", "least", "most"], lines)


def _factorial(part: xr.Dataset, taken: Sequence[Timed]) -> list[list[str]]:
    rows = []
    for name in map(str, part["variant"].values):
        mine = {one.call: one for one in taken if one.name == name}
        if mine:
            first = next(iter(mine.values()))
            seconds = [duration(mine[call].seconds) if call in mine else "" for call in (KERNEL, SIMULATE, SOLVE_IVP)]
            noise = f"{max(one.spread for one in mine.values()):.0%}"
            rows.append(
                [first.method, name, first.language, f"{first.error:.1e}", f"{first.forces:.0f}", *seconds, noise]
            )
        elif reason := str(part[Column.REASON].sel(variant=name).values):
            rows.append(["", name, "", reason, "", "", "", "", ""])
    return rows
