"""What the work-precision study says in sentences and tables, all of it from its dataset."""

from collections import Counter
from collections.abc import Sequence

import numpy as np
import xarray as xr

from symtop.measure import ranking
from symtop.measure.timing import AGAIN, MISSED
from symtop.measure.work import CAPPED, TARGETS, TOO_WIDE
from symtop.runner.study import Table

from . import against_taylor, closed_form, energy, worth

MOST_NAMES = 3  # of a list of names; the others are counted
COMPARED = ("rk4[axis]", "takahashi-imada[axis]", "strang[axis]", "gauss-4[axis]")  # energies at equal steps

HOW_TO_READ = (
    "Choose the error that you accept on the vertical axis: the first curve to the right of it is the fastest row. A "
    "row is a method in one chart: angles (Euler angles), axis (the axis e and the angular momentum L) or attitude (a "
    "quaternion and L). Every method is here in each chart that shows the axis, but not in that of the attitude where "
    "it has the axis chart, because the attitude costs more for the same axis (see the reduction study). All rows of "
    "a panel have the same scene, horizon, machine and call: the compiled loop from the start to the horizon, without "
    "`simulate` around it. The settings of a row, steps or tolerances, were searched for, so that they just meet 1e-3, "
    "1e-6, 1e-9 and 1e-12 rad. A target is asked only where it is less than the width of the nutation: a motion "
    "without any nutation meets the others. A step may be as long as the method is accurate, up to 6 steps a run. No "
    "run takes more than a million force evaluations (25 thousand in plain Python, 40 thousand in quadruple "
    "precision); a target that is not met within that is marked `budget`. A run is timed, and drawn against seconds, "
    "if it is its row's cheapest in force evaluations for some target, or belongs to the comparison of energy errors; "
    "no time is computed from others. A force evaluation is one evaluation of the equations of motion: a Newton "
    "iteration at one node, a kick, a stage, or one derivative of a Taylor series, which costs more the higher it is. "
    "`exact`, the closed form, is what errors are measured by and is not ranked; its time stands beside the others."
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
    """The fastest compiled row at a target and its lead; `cell` is one scene and one horizon."""
    won = ranking.win(cell, target)
    if won is None:
        return f"{target:.0e} no row ({reasons(cell, target)})"
    text = f"{target:.0e} {won.best.integrator} in {seconds(won.best.cost)}"
    if won.level:
        text += f" ({level(won)})"
    elif won.behind:
        text += f" ({won.ratio:.1f} times faster than {won.behind.integrator})"
    return text


def reasons(cell: xr.Dataset, target: float, names: Sequence[str] | None = None) -> str:
    """Why rows do not meet a target, the most frequent reason first; empty if all do."""
    rows = ranking.ranked(cell) if names is None else names
    why = [str(value) for value in cell["reached"].sel(integrator=rows, target=target).values]
    count = Counter(reason for reason in why if reason not in ("met", CAPPED, ""))
    return ", ".join(reason for reason, _ in count.most_common())


def not_asked(data: xr.Dataset) -> str:
    """Which targets are not asked on which scenes, and why; empty if all are."""
    listed = []
    for name in data["scene"].values:
        cell = data.sel(scene=name)
        asked = ranking.targets(cell)
        left = [f"{target:.0e}" for target in TARGETS if target not in asked]
        if left:
            listed.append(f"{' and '.join(left)} on {name} ({float(cell['nutation_width'].max()):.2g} rad wide)")
    return f" Not asked, because the nutation itself is narrower: {'; '.join(listed)}." if listed else ""


def beside(data: xr.Dataset) -> str:
    """What the rows without steps cost: they stand beside the ranking. Empty if there is none."""
    ranked = ranking.ranked(data)
    said = []
    for name in (str(name) for name in data["integrator"].values if name not in ranked):
        before, each = (data[key].sel(integrator=name).values for key in ("set_up_seconds", "sample_seconds"))
        if np.isfinite(before).any():
            said.append(
                f"{name} is not ranked, because errors are measured by it. Whatever the horizon, its constants "
                f"take {seconds(float(np.nanmin(before)))} to {seconds(float(np.nanmax(before)))}, and "
                f"each sample {seconds(float(np.nanmedian(each)))}."
            )
    return " ".join(said)


def growth(data: xr.Dataset, names: Sequence[str], part: str) -> str:
    """Median growth of a part of the error from the first to the last horizon."""
    grown = {name: energy.growth_at_equal_settings(data.sel(integrator=name), part) for name in names}
    listed = ", ".join(f"{value:.3g} with {name}" for name, value in grown.items() if np.isfinite(value))
    rest = [name for name, value in grown.items() if not np.isfinite(value)]
    return listed + (f" (not judged: {', '.join(rest)}, at rounding or over budget)" if rest else "")


def sentences(data: xr.Dataset) -> list[str]:
    """The fastest row for each scene, horizon and target, the energies, and what the times are worth."""
    wins = [won for won in ranking.winners(data).values() if won]
    count = Counter(won.best.integrator for won in wins)
    spoken = [
        f"Of {len(wins)} combinations of scene, horizon and target that a compiled row met, the fastest is "
        + ", ".join(f"{name} in {times}" for name, times in count.most_common())
        + f"; in {sum(not won.level for won in wins)} its lead is larger than the noise."
        + not_asked(data),
        *filter(
            None,
            [
                closed_form.headline(data),
                against_taylor.headline(data, spans(data)),
                beside(data),
                *(energy.sentence(data, chart) for chart in energy.CHARTS),
            ],
        ),
        *filter(None, [energy.at_equal_steps(data, COMPARED, str(data["scene"].values[0]))]),
    ]
    if python := of_implementation(data, "python"):
        spoken.append(
            f"Only compiled rows are ranked. Those in plain Python ({', '.join(python)}) are ranked among themselves "
            "in the table; compare them with the rest by force evaluations. Where the table says budget, the row was "
            "stopped at its budget of force evaluations, which says nothing of what it could reach."
        )
    spoken.append(times(data))
    for name in data["scene"].values:
        asked = ranking.targets(data.sel(scene=name))
        for far, span in enumerate(spans(data)):
            cell = data.sel(scene=name).isel(horizon=far)
            fastest = "; ".join(lead(target, cell) for target in asked)
            spoken.append(f"{name}, the fastest to an axis error {span}: {fastest}.")
    return spoken


def times(data: xr.Dataset) -> str:
    """How many runs were timed, and how far their times can be trusted."""
    taken = data["seconds"]
    rounds = data["seconds_samples"].notnull().sum("batch").where(taken.notnull())
    miss = abs(taken / data["seconds_forecast"] - 1.0)
    samples = np.sort(data["seconds_samples"].transpose(..., "batch").values, axis=-1)
    margins = [
        ranking.margin(data.sel(scene=name).isel(horizon=far))
        for name in data["scene"].values
        for far in range(data.sizes["horizon"])
    ]
    alone = int((samples[..., 1] > (1.0 + AGAIN) * samples[..., 0]).sum())
    return (
        f"{int(taken.notnull().sum())} of the {int((data['outcome'] == 'ok').sum())} runs that ended well were timed, "
        f"every one in at least {int(rounds.min())} rounds with the other rows of its scene; what is shown against "
        f"seconds is these, {measured(data):.0%} of them measured. As a check, each time was compared with the one "
        f"predicted from the row's other times: the median difference is {float(miss.median()):.1%}. A time that "
        f"differs by more than {MISSED:.0%} was taken again; {int((miss > MISSED).sum())} still differ, and a lead of "
        f"theirs counts only if the predicted time has it too. {alone} times are noisy, without a second sample within "
        f"{AGAIN:.0%} of the smallest, and no lead of theirs, or over them, counts. Any other lead counts if the ratio "
        f"of the times is at least {min(margins):.2f} to {max(margins):.2f}, by scene and horizon: 1 plus twice the "
        f"difference that nine of ten times stay within, and at least {ranking.MARGIN:g}."
    )


def measured(data: xr.Dataset) -> float:
    """The share of the times that are the smallest of the samples that were taken of that very run."""
    taken = data["seconds"].values
    shown = np.isfinite(taken)
    least = data["seconds_samples"].min("batch").transpose(*data["seconds"].dims).values
    return float((taken[shown] == least[shown]).mean()) if shown.any() else 1.0


def tables(data: xr.Dataset) -> list[Table]:
    """The fastest rows, and every row's time."""
    shown = []
    header = [f"axis error {target:.0e}" for target in TARGETS]
    for far, span in enumerate(spans(data)):
        fastest, all_times = [], []
        for name in data["scene"].values:
            cell = data.sel(scene=name).isel(horizon=far)
            asked = ranking.targets(cell)
            for implementation in ("compiled", "python"):
                rows = of_implementation(cell, implementation)
                if rows := [row for row in rows if row in ranking.ranked(cell)]:
                    won = [_winner(ranking.win(cell, target, implementation), cell, target, rows) for target in TARGETS]
                    fastest.append([str(name), implementation, *won])
            met = {target: {place.integrator: seconds(place.cost) for place in ranking.cheapest(cell, target)}
                   for target in asked}  # fmt: skip
            for row in ranking.ranked(cell):
                why = {target: str(cell["reached"].sel(integrator=row, target=target).values) for target in TARGETS}
                cells = [met.get(target, {}).get(row, f"({why[target]})") for target in TARGETS]
                all_times.append([str(name), row, *cells])
            for row in (str(row) for row in cell["integrator"].values if row not in ranking.ranked(cell)):
                before, each = (
                    float(cell[key].sel(integrator=row).min()) for key in ("set_up_seconds", "sample_seconds")
                )
                if np.isfinite(before):
                    text = f"set-up {seconds(before)}, each sample {seconds(each)}"
                    all_times.append([str(name), f"{row}, not ranked", text, *[""] * (len(TARGETS) - 1)])
        chart = "in the chart that the row names, call of the compiled loop"
        shown += [
            Table(f"Fastest row to an axis error (rad) {span}", ["scene", "implementation", *header], fastest),
            Table(
                f"Time of every row to the same errors {span}, {chart}; in brackets why an error is not reached",
                ["scene", "integrator", *header],
                all_times,
            ),
        ]
    return [
        *shown, worth.table(data), against_taylor.table(data, spans(data)), closed_form.table(data, spans(data)),
        energy.table(data),
    ]  # fmt: skip


def _winner(won: ranking.Win | None, cell: xr.Dataset, target: float, rows: Sequence[str]) -> str:
    if target not in ranking.targets(cell):
        return f"({TOO_WIDE})"
    if won is None:
        return f"none ({reasons(cell, target, rows)})"
    return ", ".join([won.best.integrator, seconds(won.best.cost), *([level(won)] if won.level else [])])
