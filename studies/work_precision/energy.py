"""Energy errors at equal run time of structure-preserving methods and classical ones, within one chart.

The chart changes the energy error of a method as much as the method does, so that variants are compared only with
variants of the same chart: the splittings with rk4 and taylor on (e, L), the discrete Lagrangians and the
compositions of Verlet with rk4 and rk45-compiled in Euler angles. A method preserves structure if it claims to be
symplectic or symmetric. One that claims to conserve the energy itself is left out: its energy error is rounding or the
solver's, whatever the step, and says nothing of what a bounded error is worth.
"""

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr
from symtop_studies.memoize import of_one_dataset

from symtop.measure import ranking
from symtop.methods.framework.registry import integrator, integrators, split_name
from symtop.report.sentences import abridged, joined
from symtop.runner.study import Table

ROUNDED = 1e-12  # an error below it is not compared between horizons
CHARTS = {"axis": "the axis and the angular momentum (e, L)", "angles": "Euler angles"}
CLASSIC = ("rk4", "rk45-compiled", "taylor")  # compared in each chart that they have
KINDS = ("at every run time", "at short run times only", "at long run times only", "in turns", "at none")
STEPS = 118.0  # a nutation, of the comparison at equal steps


class Crossing(NamedTuple):
    """Energy at equal time on a scene: the share of the common times at which the first of two variants is better."""

    scene: str
    share: float  # of the common range, in the logarithm of time
    at_least: bool  # is the first better at the least common time,
    at_most: bool  # at the largest?
    longest_won: float  # s, the longest run at which the first is better; NaN if none
    error: float  # energy error of the first where its lead is largest (or its lag smallest)
    gain: float  # ratio of the energy errors there, second over first


@of_one_dataset
def in_chart(data: xr.Dataset, chart: str) -> tuple[list[str], list[str]]:
    """The compiled variants of a chart that are compared: the classical ones, and those that preserve structure."""
    classic, structured = _all_in_chart(data, chart)
    return classic, [name for name in structured if not conserving(name)]


def by_construction(data: xr.Dataset, chart: str) -> list[str]:
    """The compiled variants of a chart that preserve structure and are left out, because they conserve the energy."""
    return [name for name in _all_in_chart(data, chart)[1] if conserving(name)]


def conserving(name: str) -> bool:
    """Does a variant claim to conserve the energy?"""
    return split_name(name)[0] in integrators() and "energy" in (integrator(name).conserves or ())


@of_one_dataset
def _all_in_chart(data: xr.Dataset, chart: str) -> tuple[list[str], list[str]]:
    """The classical compiled variants of a chart, and all that are symplectic or symmetric."""
    names = [str(name) for name in ranking.ranked(data)]
    over = [dim for dim in data["structured"].dims if dim != "variant"]
    structured = data["structured"].max(over)
    kept = [
        name
        for name in names
        if chart in data["chart"].sel(variant=name) and "compiled" in data["implementation"].sel(variant=name)
    ]
    classic = [name for name in kept if split_name(name)[0] in CLASSIC]
    return classic, [name for name in kept if name not in classic and float(structured.sel(variant=name)) == 1.0]


def timed(data: xr.Dataset) -> list[str]:
    """All variants of both charts of which every long run is timed: those that are left out of the comparison, too."""
    return [name for chart in CHARTS for names in _all_in_chart(data, chart) for name in names]


def crossing(cell: xr.Dataset, first: str, second: str) -> Crossing | None:
    """Compare the least energy error that each of two variants has for a time; None if their times do not overlap.

    The error for a time is that of the most accurate run that takes no longer, joined by straight lines in the
    logarithms. `cell` is one scene and one horizon.
    """
    curves = []
    for name in (first, second):
        runs = cell.sel(variant=name)
        x, y = runs["seconds"].values, runs["energy"].values
        good = np.isfinite(x) & np.isfinite(y) & (runs["outcome"].values == "ok")
        order = np.argsort(x[good])
        x, y = x[good][order], np.minimum.accumulate(np.maximum(y[good][order], 1e-17))
        if x.size < 2:
            return None
        curves.append((np.log(x), np.log(y)))
    low, high = max(x[0] for x, _ in curves), min(x[-1] for x, _ in curves)
    if high <= low:
        return None
    at = np.linspace(low, high, 201)
    ours, theirs = (np.interp(at, *curve) for curve in curves)
    ahead, best = ours < theirs, int(np.argmax(theirs - ours))
    won = float(np.exp(at[ahead][-1])) if ahead.any() else np.nan
    gain, error = float(np.exp(theirs[best] - ours[best])), float(np.exp(ours[best]))
    return Crossing(str(cell["scene"].values), float(ahead.mean()), bool(ahead[0]), bool(ahead[-1]), won, error, gain)


@of_one_dataset
def crossings(data: xr.Dataset, chart: str) -> dict[str, dict[str, list[Crossing]]]:
    """All comparisons of a chart over the long horizon, by the classical variant and by the other one."""
    last = data[["seconds", "energy", "outcome"]].isel(horizon=-1)  # of these alone: a dataset has dozens
    cells = [last.sel(scene=name) for name in last["scene"].values]
    classic, structured = in_chart(data, chart)
    return {
        second: {first: [one for cell in cells if (one := crossing(cell, first, second))] for first in structured}
        for second in classic
    }


def at_steps(runs: xr.Dataset, steps: float) -> tuple[float, float]:
    """Energy error and force evaluations a step of a variant at so many steps, between its runs in logarithms.

    NaN if no two runs have that number between them. `runs` is one scene, one horizon and one variant.
    """
    x, y, work = (runs[name].values for name in ("steps", "energy", "force_evaluations"))
    good = np.isfinite(x) & (y > 0.0) & (runs["outcome"].values == "ok")
    order = np.argsort(x[good])
    x, y, work = (values[good][order] for values in (x, y, work))
    if x.size < 2 or not x[0] <= steps <= x[-1]:
        return np.nan, np.nan
    return tuple(float(np.exp(np.interp(np.log(steps), np.log(x), np.log(one)))) for one in (y, work / x))


def ratios_at_equal_settings(runs: xr.Dataset, quantity: str) -> list[float]:
    """An error at the last horizon over that at the first, for each setting run at both; none where it is rounding."""
    near, later = runs.isel(horizon=0), runs.isel(horizon=-1)
    ratios = [
        later[quantity].values[j] / near[quantity].values[k]
        for k, setting in enumerate(near["setting_value"].values)
        for j in np.flatnonzero(np.isclose(later["setting_value"].values, setting, rtol=1e-9))
        if near[quantity].values[k] > ROUNDED
    ]
    return [float(ratio) for ratio in ratios if np.isfinite(ratio)]


def growth_at_equal_settings(runs: xr.Dataset, quantity: str) -> float:
    """Median ratio of an error at the last horizon to that at the first, over settings that were run at both."""
    ratios = ratios_at_equal_settings(runs, quantity)
    return float(np.median(ratios)) if ratios else np.nan


def table(data: xr.Dataset) -> Table:
    """Of every classical variant: its comparisons by how they end, and the variants that are ahead or behind in all."""
    rows = []
    for chart in CHARTS:
        for classic, compared in crossings(data, chart).items():
            pairs = [one for listed in compared.values() for one in listed]
            kinds = Counter(_kind(one) for one in pairs)
            ends = [
                abridged(
                    [name for name, listed in compared.items() if listed and all(one.share == end for one in listed)]
                )
                for end in (1.0, 0.0)
            ]
            if pairs:
                rows.append([classic, str(len(pairs)), *(str(kinds[kind]) for kind in KINDS), *ends])
    return Table(
        f"Energy errors over {float(data['horizon'].values[-1]):g} nutation periods at equal run times: comparisons of "
        "a classical variant with a structure-preserving one on a scene, by the run times at which the latter has "
        "less; without variants that conserve the energy by construction, and without pairs that have no common run "
        "time",
        ["against", "comparisons", *KINDS, "always less", "never less"],
        rows,
    )


def _kind(one: Crossing) -> str:
    """The run times at which the first variant of a pair has less error."""
    if one.share in (0.0, 1.0):
        return KINDS[0] if one.share else KINDS[-1]
    return "in turns" if one.at_least == one.at_most else KINDS[1] if one.at_least else KINDS[2]


def sentence(data: xr.Dataset, chart: str) -> str:
    """How often structure-preserving variants have less energy error than the classical ones of their chart."""
    counted = tallies(data, chart)
    if not counted:
        return ""
    said = [
        f"{percent(tally.share)} of {tally.compared}{' comparisons' * (not k)} with {classic}"
        for k, (classic, tally) in enumerate(counted.items())
    ]
    left = len(by_construction(data, chart))
    apart = f", without {left} that conserve{'s' * (left == 1)} the energy by construction," if left else ""
    return (
        f"Structure-preserving variants in {CHARTS[chart]}{apart} have less energy error at every common run time in "
        f"{joined(said)}. A comparison is two variants with a common run time on one scene over "
        f"{float(data['horizon'].values[-1]):g} nutation periods."
    )


def percent(share: float) -> str:
    """A share in whole per cent; in tenths where that would read as none or all of them."""
    return f"{share:.0%}" if share in (0.0, 1.0) or 0.01 <= share < 0.995 else f"{share:.1%}"


class Tally(NamedTuple):
    """Comparisons with one classical variant: where a structure-preserving variant has less energy error."""

    always: int  # at every run time that both have
    partly: int
    never: int

    @property
    def compared(self) -> int:
        """All comparisons."""
        return sum(self)

    @property
    def share(self) -> float:
        """That of the comparisons which are won at every run time."""
        return self.always / self.compared


def tallies(data: xr.Dataset, chart: str) -> dict[str, Tally]:
    """The comparisons of a chart, by the classical variant; variants without any are left out."""
    counted = {}
    for classic, compared in crossings(data, chart).items():
        shares = [one.share for listed in compared.values() for one in listed]
        if shares:
            always, never = shares.count(1.0), shares.count(0.0)
            counted[classic] = Tally(always, len(shares) - always - never, never)
    return counted


def message(data: xr.Dataset, chart: str) -> str:
    """Against which classical variants those that preserve structure mostly win at all run times, as a title."""
    counts = sorted(tallies(data, chart).items(), key=lambda one: -one[1].share)
    named = [(f"{split_name(name)[0]} ({percent(tally.share)})", tally.share) for name, tally in counts]
    most, few = [name for name, share in named if share >= 0.5], [name for name, share in named if share < 0.5]
    parts = [
        f"in {size} half of the comparisons with {' and '.join(names)}"
        for size, names in (("at least", most), ("less than", few))
        if names
    ]
    if not parts:
        return "Energy errors at equal run time"
    place = {"axis": "in the axis chart", "angles": "in Euler angles"}[chart]
    return f"Structure-preserving methods {place} keep energy better at every run time {', '.join(parts)}"


def at_equal_steps(data: xr.Dataset, names: Sequence[str], scene: str) -> str:
    """Energy errors of variants of one chart over the long horizon at the same steps; empty if not run there."""
    last = data.sel(scene=scene).isel(horizon=-1)
    periods = float(data["horizon"].values[-1])
    known = [name for name in names if name in last["variant"].values]
    ends = {name: at_steps(last.sel(variant=name), STEPS * periods) for name in known}
    listed = [f"{error:.1e} with {name} ({work:.2g})" for name, (error, work) in ends.items() if np.isfinite(error)]
    if len(listed) < 2:
        return ""
    return (
        f"At {STEPS:g} steps a nutation, the largest energy error on {scene} over {periods:g} nutation periods is "
        f"{joined(listed)}; in brackets, force evaluations a step."
    )
