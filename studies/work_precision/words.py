"""What the work-precision study says in sentences and tables, all of it from its dataset."""

from collections import Counter
from collections.abc import Sequence

import numpy as np
import xarray as xr

from symtop.measure import ranking
from symtop.measure.work import TARGETS
from symtop.runner.study import Table

from .tables import Column

STRUCTURE = ("midpoint", "trapezoidal", "stormer-verlet", "galerkin-simpson")
CLASSIC = ("rk4", "rk45-compiled")
MOST_NAMES = 3  # of a list of names; the others are counted

HOW_TO_READ = (
    "Choose the error that you accept on the vertical axis: the first curve to the right of it is the fastest method. "
    "Seconds include the call of the compiled loop, about twenty microseconds, so that all curves bend where runs are "
    "that short. A force evaluation is one evaluation of the equations of motion: a Newton iteration at one node, a "
    "kick, a stage, or one derivative of a Taylor series, which costs more the higher it is. The settings of a method "
    "were searched for, so that they just meet 1e-3, 1e-6, 1e-9 and 1e-12; no fixed step is longer than a quarter of a "
    "nutation, and no run was longer than a million force evaluations (25 thousand in plain Python, 40 thousand in "
    "quadruple precision). `exact` spends its time on constants in 40 digits, whatever the horizon."
)


def spans(data: xr.Dataset) -> list[str]:
    """The horizons."""
    return [f"over {value:g} nutation periods" for value in data["horizon"].values]


def seconds(value: float) -> str:
    """A time with a unit that suits it."""
    return f"{value * 1e6:.3g} us" if value < 1e-3 else f"{value * 1e3:.3g} ms" if value < 1.0 else f"{value:.3g} s"


def few(names: Sequence[str]) -> str:
    """The first names, and how many more there are."""
    more = len(names) - MOST_NAMES
    return ", ".join(names[:MOST_NAMES]) + (f" and {more} more" if more > 0 else "")


def winner(won: ranking.Win | None) -> str:
    """The fastest method, its time, and which methods are level with it."""
    if won is None:
        return "none"
    level = f", level with {few(won.level)}" if won.level else ""
    return f"{won.best.integrator}, {seconds(won.best.cost)}{level}"


def lead(target: float, cell: xr.Dataset) -> str:
    """The fastest compiled method at a target and its lead; `cell` is one scene and one horizon."""
    won = ranking.win(cell, target)
    if won is None:
        return f"{target:.0e} no method"
    text = f"{target:.0e} {won.best.integrator} in {seconds(won.best.cost)}"
    if won.level:
        text += f" (level with {few(won.level)})"
    elif won.behind and won.lead:
        predicted = "" if won.rival_timed else ", by a predicted time"
        text += f" ({won.lead.ratio:.1f} times faster than {won.behind.integrator}{predicted})"
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
    grown = {name: ranking.growth_at_equal_settings(data.sel(integrator=name), part) for name in names}
    listed = ", ".join(f"{value:.3g} with {name}" for name, value in grown.items() if np.isfinite(value))
    rest = [name for name, value in grown.items() if not np.isfinite(value)]
    return listed + (f" (not judged: {', '.join(rest)}, at rounding or over budget)" if rest else "")


def _at_long_horizon(data: xr.Dataset) -> list[xr.Dataset]:
    """The scenes that count, over the long horizon."""
    kept = ranking.counted(data)[0]
    return [kept.sel(scene=name).isel(horizon=-1) for name in kept["scene"].values]


def crossings(data: xr.Dataset) -> list[str]:
    """For each classical method, which structure-preserving ones have less energy error at equal time, and where."""
    cells = _at_long_horizon(data)
    sentences = []
    for classic in CLASSIC:
        parts = []
        for method in STRUCTURE:
            compared = [one for cell in cells if (one := ranking.crossing(cell, method, classic))]
            won = [one for one in compared if one.share > 0.0]
            lost = [one.scene for one in compared if one.share == 0.0]
            if not compared:
                parts.append(f"{method} nowhere, because no run times are common")
                continue
            if not won:
                parts.append(f"{method} on none of {len(compared)} scenes")
                continue
            top = max(won, key=lambda one: one.gain)
            longest = seconds(float(np.median([one.dearest_won for one in won])))
            never = f", not on {', '.join(lost)}" if lost else ""
            parts.append(
                f"{method} on {len(won)} of {len(compared)} scenes{never} (for runs up to {longest} in the median; at "
                f"best {top.gain:.2g} times smaller, on {top.scene}, where it is {top.error:.1g})"
            )
        sentences.append(
            f"At equal run time the energy error is smaller than that of {classic} with {'; '.join(parts)}."
        )
    return sentences


def crossed(data: xr.Dataset) -> str:
    """How often structure-preserving methods have less energy error at equal time, in one sentence."""
    cells = _at_long_horizon(data)
    compared = [one for cell in cells for a in STRUCTURE for b in CLASSIC if (one := ranking.crossing(cell, a, b))]
    coarse = sum(one.at_least and not one.at_most for one in compared)
    fine = sum(one.at_most and not one.at_least for one in compared)
    return (
        f"Of {len(compared)} comparisons at equal run time of a structure-preserving method ({', '.join(STRUCTURE)}) "
        f"with a classical one ({', '.join(CLASSIC)}), the structure-preserving one has the smaller energy error at "
        f"all run times in {sum(one.share == 1.0 for one in compared)}, at short ones only in {coarse}, at long ones "
        f"only in {fine}, and at none in {sum(one.share == 0.0 for one in compared)}."
    )


def _worth_of_times(data: xr.Dataset, wins: Sequence[ranking.Win]) -> str:
    """How many times were measured, and how far off the predicted ones may be."""
    sure = [won for won in wins if won.reliable and won.lead]
    timed, finite = data[Column.TIMED].values == 1.0, np.isfinite(data[Column.SECONDS].values)
    miss = data[Column.PREDICTION_MISS].values
    text = f"{int(timed.sum())} of {int(finite.sum())} run times were measured"
    if not np.isfinite(miss).any():
        return f"{text}."
    return (
        f"{text}; the others are predicted from two measured runs of the same method on the same scene. "
        f"{sum(won.rival_timed for won in sure)} of {len(sure)} leads larger than the noise are over a method timed in "
        "the same rounds, the others over a predicted time. Where a prediction was tested by a measurement it was off "
        f"by {np.nanmedian(miss):.0%} (median) and by {np.nanmax(miss):.0%} at worst. "
        f"{int(np.sum(data[Column.RELIABLE].values == 0.0))} of the measured times are too noisy to trust."
    )


def sentences(data: xr.Dataset) -> list[str]:
    """The fastest method for each scene, horizon and target, the crossover in energy, and what the times are worth."""
    kept, uncounted = ranking.counted(data)
    wins = [won for won in ranking.winners(kept).values() if won]
    count = Counter(won.best.integrator for won in wins)
    said = [
        f"Of {len(wins)} combinations of scene, horizon and target that a compiled method met, the fastest is "
        + ", ".join(f"{name} in {times}" for name, times in count.most_common())
        + f"; in {sum(won.reliable for won in wins)} its lead is larger than the noise."
        + left_out(uncounted),
        f"Energy error {spans(data)[-1]}. " + " ".join(crossings(data)),
    ]
    tiers = {str(name): data[Column.IMPLEMENTATION].sel(integrator=name).values for name in data["integrator"].values}
    python = [name for name, tier in tiers.items() if "python" in tier]
    if python:
        said.append(
            f"Only compiled methods are ranked. Those in plain Python ({', '.join(python)}) are ranked "
            "among themselves in the table; compare them with the rest by force evaluations."
        )
    said.append(_worth_of_times(data, wins))
    for name in data["scene"].values:
        for far, span in enumerate(spans(data)):
            cell = data.sel(scene=name).isel(horizon=far)
            fastest = "; ".join(lead(target, cell) for target in TARGETS)
            said.append(f"{name}, the fastest to an axis error {span}: {fastest}.")
    return said


def tables(data: xr.Dataset) -> list[Table]:
    """The fastest methods, and every method's time."""
    shown = []
    header = [f"axis error {target:.0e}" for target in TARGETS]
    for far, span in enumerate(spans(data)):
        fastest, times = [], []
        for name in data["scene"].values:
            cell = data.sel(scene=name).isel(horizon=far)
            for tier in ("compiled", "python"):
                won = [ranking.win(cell, target, tier=tier) for target in TARGETS]
                fastest.append([str(name), tier, *(winner(one) for one in won)])
            met = [{place.integrator: place for place in ranking.cheapest(cell, target)} for target in TARGETS]
            for method in map(str, cell["integrator"].values):
                row = [seconds(places[method].cost) if method in places else "-" for places in met]
                times.append([str(name), method, *row, str(cell[Column.STOPPED].sel(integrator=method).values)])
        columns = ["scene", "implementation", *header]
        shown.append(Table(f"Fastest method to an axis error {span}", columns, fastest))
        columns = ["scene", "integrator", *header, "nothing finer because of"]
        shown.append(Table(f"Time of every method to the same errors {span}", columns, times))
    return shown
