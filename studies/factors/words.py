"""Sentences and tables of the factors study, from its dataset."""

import math
from collections.abc import Sequence

import numpy as np
import xarray as xr

from symtop.measure.timing import NOISY
from symtop.report.sentences import joined
from symtop.runner.study import Table

from .cells import COMPILED, FAMILIES, KERNEL, SAMPLES, SCIPY_PYTHON, SCIPYS, SIMULATE, SOLVE_IVP
from .tables import (
    LEAST,
    TIE,
    Bar,
    Change,
    Column,
    Timed,
    changes,
    chart_ratio,
    fastest,
    goals_of,
    least_share,
    times,
    waterfall,
)  # fmt: skip

HOW_TO_READ = (
    "Four factors make the time of a run: the method, the chart that its equations are written in, the language that "
    "executes them and the call around them. Every row has its own step or tolerance, the coarsest found that meets "
    "the stated error of the axis, so that times compare at equal accuracy. A factor's effect is the ratio of two "
    "measured times that differ in this factor alone. The waterfall changes one factor after the other; the table "
    "below it has the same factor's effect in every other surrounding, because factors do not simply multiply: a "
    "smaller chart helps a compiled loop more than a Python one. A kernel is the bare solver with two samples; "
    f"simulate and solve_ivp are what a user calls, with {SAMPLES} samples. SciPy's loop is Python, whatever the "
    "language of its right-hand side. The closed form does not take part."
)

WATERFALL = ["scene", "nutations", "axis error", "changed", "run", "call", "time", "ratio", "product so far", "noise"]
EFFECTS = ["factor", "from", "to", "pairs", "times faster, median", "least", "most"]
CHARTS_SHOWN = ("angles", "axis", "attitude")
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
    """Scene, nutations, target and bars of every goal that has a waterfall."""
    every = [
        (scene, span, target, waterfall(times(part), call_first=call_first))
        for scene, span, target, part in goals_of(data)
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
    """A waterfall as a sentence."""
    first, last = bars[0].time, bars[-1].time
    steps = joined([f"{bar.change} {times_faster(bar.ratio)}" for bar in bars[1:]])
    return (
        f"On {scene}, {nutations:g} nutations, axis error {target:.0e}: {first.name} called through {first.call} takes "
        f"{duration(first.seconds)}, the kernel of {last.name} {duration(last.seconds)}, "
        f"{times_faster(first.seconds / last.seconds)} times less. Times faster, one factor after the other: {steps}."
    )


def public_and_inner(scene: str, nutations: float, target: float, rows: Sequence[Timed]) -> str:
    """The comparison that a user makes beside the one that an author makes, against each of SciPy's methods."""
    parts: list[str] = []
    if not any(one.call == SIMULATE for one in rows):
        return ""
    for scheme in SCIPYS:
        theirs = {
            call: min((one for one in rows if (one.method, one.language, one.call) == (scheme, SCIPY_PYTHON, call)),
                      key=lambda one: one.seconds, default=None)
            for call in (SOLVE_IVP, KERNEL)
        }  # fmt: skip
        ours = {call: fastest(rows, call, COMPILED) for call in (SIMULATE, KERNEL)}
        public, inner = theirs[SOLVE_IVP], theirs[KERNEL]
        if public is None or inner is None:
            continue
        parts.append(
            f"against {inner.name}, its fastest chart, {times_faster(public.seconds / ours[SIMULATE].seconds)} times "
            f"where a user measures (solve_ivp {duration(public.seconds)}, simulate with {ours[SIMULATE].name} "
            f"{duration(ours[SIMULATE].seconds)}) and {times_faster(inner.seconds / ours[KERNEL].seconds)} times in "
            f"the inner loop (kernel {duration(inner.seconds)}, {ours[KERNEL].name} {duration(ours[KERNEL].seconds)})"
        )
    return f"SciPy on {scene}, {nutations:g} nutations, {target:.0e}: {'; '.join(parts)}." if parts else ""


def family_ratios(data: xr.Dataset, family: str, chart: str) -> list[float]:
    """Kernel time of a chart over that of the axis: every scheme of a family, scene and goal where both were timed."""
    every = [times(part) for *_, part in goals_of(data)]
    ratios = [chart_ratio(rows, scheme, chart) for rows in every for scheme in FAMILIES[family]]
    return [ratio for ratio in ratios if math.isfinite(ratio)]


def family_sentences(data: xr.Dataset) -> list[str]:
    """What a larger chart costs each family of methods, and what the angles cost it, at equal error of the axis."""
    sentences = []
    for family in FAMILIES:
        parts = []
        for chart in ("attitude", "angles"):
            if ratios := family_ratios(data, family, chart):
                several = f" ({min(ratios):.2f} to {max(ratios):.2f}, {len(ratios)} pairs)" if len(ratios) > 1 else ""
                parts.append(f"{np.median(ratios):.2f} times as long in {chart}{several}")
        if parts:
            sentences.append(f"{family}: a compiled run takes {joined(parts)} as on the axis.")
    return sentences


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
    """The effect of each factor over the whole factorial."""
    parts = [
        f"{change.before} to {change.after} {times_faster(float(np.median(change.ratios)))} "
        f"({times_faster(min(change.ratios))} to {times_faster(max(change.ratios))}, {len(change.ratios)} pairs)"
        for change in all_changes(data)
        if change.factor != "method"
    ]
    return (
        f"Times faster by one factor alone, median and range over every pair that holds the others: {'; '.join(parts)}."
    )


def accuracy_sentence(data: xr.Dataset) -> str:
    """How equal the accuracy is."""
    share = (data[Column.AXIS] / data["target"]).where(np.isfinite(data[Column.SECONDS]).any("call"))
    values, least = share.values[np.isfinite(share.values)], least_share(data)
    loosest = str(share["integrator"].values[np.argwhere((share.transpose("integrator", ...) == least).values)[0][0]])
    return (
        f"Every timed run meets its target; {np.mean(values >= LEAST):.0%} of them have an error above {LEAST:g} of "
        f"it, and the least is {least:.2g} of it, with {loosest}."
    )


def noise_sentence(data: xr.Dataset) -> str:
    """How far the times can be trusted."""
    spread = data[Column.SPREAD].values[np.isfinite(data[Column.SPREAD].values)]
    loud = int(np.sum(spread > NOISY))
    warning = f" {loud} of {spread.size} are above {NOISY:.0%}: measure again on a quiet machine." if loud else ""
    return f"The median sample of a time is {np.median(spread):.0%} above its least, for the median time.{warning}"


def verdict(data: xr.Dataset) -> list[str]:
    """The waterfalls, the factors, the public call, and a sentence a family."""
    falls = [product(*one) for one in waterfalls(data)[:2]]
    first = str(data["scene"].values[0])  # the tables have the others
    every = [(scene, span, target, times(part)) for scene, span, target, part in goals_of(data)]
    calls = [public_and_inner(*one) for one in every if one[0] == first]
    families = " ".join(family_sentences(data))
    return [
        *falls,
        factors_sentence(data),
        *[call for call in calls if call],
        f"Model no more than a scene needs, at equal error of the axis. {families}",
        accuracy_sentence(data),
        noise_sentence(data),
    ]


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
        Table("The waterfall: one factor at a time, the call last and the call first", WATERFALL, falls),
        Table("What one factor does, everything else held", EFFECTS, effects),
        Table("Compiled kernels by chart, at equal error of the axis", CHARTS, charts),
        Table("The factorial", FACTORIAL, rows),
    ]


def _factorial(part: xr.Dataset, taken: Sequence[Timed]) -> list[list[str]]:
    rows = []
    for name in map(str, part["integrator"].values):
        mine = {one.call: one for one in taken if one.name == name}
        if mine:
            first = next(iter(mine.values()))
            seconds = [duration(mine[call].seconds) if call in mine else "" for call in (KERNEL, SIMULATE, SOLVE_IVP)]
            noise = f"{max(one.spread for one in mine.values()):.0%}"
            rows.append(
                [first.method, name, first.language, f"{first.error:.1e}", f"{first.forces:.0f}", *seconds, noise]
            )
        elif reason := str(part[Column.REASON].sel(integrator=name).values):
            rows.append(["", name, "", reason, "", "", "", "", ""])
    return rows
