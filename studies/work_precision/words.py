"""What the work-precision study says in sentences and tables, all of it from its dataset."""

from collections import Counter
from collections.abc import Sequence

import numpy as np
import xarray as xr

from symtop.measure import ranking
from symtop.measure.timing import NOISY
from symtop.measure.work import TARGETS
from symtop.runner.study import Table

from .energy import CLASSIC, STRUCTURE, crossings, growth_at_equal_settings

MOST_NAMES = 3  # of a list of names; the others are counted

HOW_TO_READ = (
    "Choose the error that you accept on the vertical axis: the first curve to the right of it is the fastest method. "
    "Seconds include the call of the compiled loop, about twenty microseconds, so that all curves bend where runs are "
    "that short. A run is timed, and drawn against seconds, if it is its method's cheapest in force evaluations for "
    "some target, or belongs to the comparison of energy errors; no time is computed from others. A force evaluation "
    "is one evaluation of the equations of motion: a Newton iteration at one node, a kick, a stage, or one derivative "
    "of a Taylor series, which costs more the higher it is. The settings of a method were searched for, so that they "
    "just meet 1e-3, 1e-6, 1e-9 and 1e-12; no fixed step is longer than a quarter of a nutation, and no run was longer "
    "than a million force evaluations (25 thousand in plain Python, 40 thousand in quadruple precision). `exact` "
    "spends its time on constants in 40 digits, whatever the horizon."
)


def spans(data: xr.Dataset) -> list[str]:
    """The horizons."""
    return [f"over {value:g} nutation periods" for value in data["horizon"].values]


def seconds(value: float) -> str:
    """A time with a unit that suits it."""
    return f"{value * 1e6:.3g} us" if value < 1e-3 else f"{value * 1e3:.3g} ms" if value < 1.0 else f"{value:.3g} s"


def of_implementation(data: xr.Dataset, kind: str) -> list[str]:
    """The names of the compiled methods, or of those in plain Python."""
    return [str(name) for name in data["integrator"].values if kind in data["implementation"].sel(integrator=name)]


def level(won: ranking.Win) -> str:
    """The first methods that are level with the fastest, and how many more there are."""
    more = len(won.level) - MOST_NAMES
    return "level with " + ", ".join(won.level[:MOST_NAMES]) + (f" and {more} more" if more > 0 else "")


def lead(target: float, cell: xr.Dataset) -> str:
    """The fastest compiled method at a target and its lead; `cell` is one scene and one horizon."""
    won = ranking.win(cell, target)
    if won is None:
        return f"{target:.0e} no method"
    text = f"{target:.0e} {won.best.integrator} in {seconds(won.best.cost)}"
    if won.level:
        text += f" ({level(won)})"
    elif won.behind:
        text += f" ({won.ratio:.1f} times faster than {won.behind.integrator})"
    if won.best.integrator == "exact" and (other := ranking.win(cell, target, without=("exact",))):
        text += f", the fastest that steps {other.best.integrator} in {seconds(other.best.cost)}"
    return text


def left_out(names: Sequence[str]) -> str:
    """Which scenes are shown but not counted, and why; nothing if there are none."""
    if not names:
        return ""
    return (
        f" Not counted: {', '.join(names)} (no nutation). Such a motion is a fixed point of some methods, which then "
        "have no error at any step."
    )


def growth(data: xr.Dataset, names: Sequence[str], part: str) -> str:
    """Median growth of a part of the error from the first to the last horizon."""
    grown = {name: growth_at_equal_settings(data.sel(integrator=name), part) for name in names}
    listed = ", ".join(f"{value:.3g} with {name}" for name, value in grown.items() if np.isfinite(value))
    rest = [name for name, value in grown.items() if not np.isfinite(value)]
    return listed + (f" (not judged: {', '.join(rest)}, at rounding or over budget)" if rest else "")


def energy_of_each(data: xr.Dataset) -> str:
    """For each classical method, which structure-preserving ones have less energy error at equal time, and where."""
    parts: dict[str, list[str]] = {classic: [] for classic in CLASSIC}
    for (classic, method), compared in crossings(data).items():
        won = [one for one in compared if one.share > 0.0]
        lost = [one.scene for one in compared if one.share == 0.0]
        if not compared:
            parts[classic].append(f"{method} nowhere, because no run times are common")
        elif not won:
            parts[classic].append(f"{method} on none of {len(compared)} scenes")
        else:
            top = max(won, key=lambda one: one.gain)
            longest = seconds(float(np.median([one.longest_won for one in won])))
            never = f", not on {', '.join(lost)}" if lost else ""
            parts[classic].append(
                f"{method} on {len(won)} of {len(compared)} scenes{never} (for runs up to {longest} in the median; at "
                f"best {top.gain:.2g} times smaller, on {top.scene}, where it is {top.error:.1g})"
            )
    return " ".join(
        f"At equal run time the energy error is smaller than that of {classic} with {'; '.join(listed)}."
        for classic, listed in parts.items()
    )


def energy_in_all(data: xr.Dataset) -> str:
    """How often structure-preserving methods have less energy error at equal time, in one sentence."""
    compared = [one for listed in crossings(data).values() for one in listed]
    coarse = sum(one.at_least and not one.at_most for one in compared)
    fine = sum(one.at_most and not one.at_least for one in compared)
    return (
        f"Of {len(compared)} comparisons at equal run time of a structure-preserving method ({', '.join(STRUCTURE)}) "
        f"with a classical one ({', '.join(CLASSIC)}), the structure-preserving one has the smaller energy error at "
        f"all run times in {sum(one.share == 1.0 for one in compared)}, at short ones only in {coarse}, at long ones "
        f"only in {fine}, and at none in {sum(one.share == 0.0 for one in compared)}."
    )


def sentences(data: xr.Dataset) -> list[str]:
    """The fastest method for each scene, horizon and target, the crossover in energy, and what the times are worth."""
    kept, uncounted = ranking.counted(data)
    wins = [won for won in ranking.winners(kept).values() if won]
    count = Counter(won.best.integrator for won in wins)
    spoken = [
        f"Of {len(wins)} combinations of scene, horizon and target that a compiled method met, the fastest is "
        + ", ".join(f"{name} in {times}" for name, times in count.most_common())
        + f"; in {sum(not won.level for won in wins)} its lead is larger than the noise."
        + left_out(uncounted),
        f"Energy error {spans(data)[-1]}. {energy_of_each(data)}",
    ]
    if python := of_implementation(data, "python"):
        spoken.append(
            f"Only compiled methods are ranked. Those in plain Python ({', '.join(python)}) are ranked "
            "among themselves in the table; compare them with the rest by force evaluations."
        )
    spoken.append(
        f"{int(data['seconds'].notnull().sum())} of the {int((data['outcome'] == 'ok').sum())} runs that ended well "
        f"were timed, every one in at least {ranking.LEAST_ROUNDS} rounds with the other methods of its scene. "
        f"{int((data['spread'] >= NOISY).sum())} of the times are too noisy to trust: the median of their samples is "
        f"more than {NOISY:.0%} above the smallest."
    )
    for name in data["scene"].values:
        for far, span in enumerate(spans(data)):
            cell = data.sel(scene=name).isel(horizon=far)
            fastest = "; ".join(lead(target, cell) for target in TARGETS)
            spoken.append(f"{name}, the fastest to an axis error {span}: {fastest}.")
    return spoken


def tables(data: xr.Dataset) -> list[Table]:
    """The fastest methods, and every method's time."""
    shown = []
    header = [f"axis error {target:.0e}" for target in TARGETS]
    for far, span in enumerate(spans(data)):
        fastest, times = [], []
        for name in data["scene"].values:
            cell = data.sel(scene=name).isel(horizon=far)
            for implementation in ("compiled", "python"):
                won = [ranking.win(cell, target, implementation) for target in TARGETS]
                fastest.append([str(name), implementation, *map(_winner, won)])
            met = [{place.integrator: seconds(place.cost) for place in ranking.cheapest(cell, target)}
                   for target in TARGETS]  # fmt: skip
            for method, stopped in zip(map(str, cell["integrator"].values), cell["stopped"].values, strict=True):
                times.append([str(name), method, *(cost.get(method, "-") for cost in met), str(stopped)])
        shown += [
            Table(f"Fastest method to an axis error {span}", ["scene", "implementation", *header], fastest),
            Table(
                f"Time of every method to the same errors {span}",
                ["scene", "integrator", *header, "nothing finer because of"],
                times,
            ),
        ]
    return shown


def _winner(won: ranking.Win | None) -> str:
    if won is None:
        return "none"
    return ", ".join([won.best.integrator, seconds(won.best.cost), *([level(won)] if won.level else [])])
