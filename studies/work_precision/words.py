"""What the work-precision study says in sentences and tables, all of it from its dataset."""

from collections import Counter
from collections.abc import Sequence

import numpy as np
import xarray as xr

from symtop.measure import ranking
from symtop.measure.settings import TARGETS
from symtop.methods.framework.registry import split_name
from symtop.report.sentences import abridged, joined
from symtop.runner.study import Table

from . import against_taylor, closed_form, energy, growth, leads, trust, worth
from .walk import CAPPED, TOO_WIDE

LEVEL = 3  # names of a list of level variants; the others are counted
SHOWN = ("axis", "reached", "set_up_seconds", "sample_seconds")  # by the tables, beside what a ranking needs
COMPARED = ("rk4[axis]", "takahashi-imada[axis]", "strang[axis]")  # energies at equal steps

HOW_TO_READ = (
    "A variant is a method in one chart: angles (Euler angles), axis (the axis e and the angular momentum L) or "
    "attitude (a quaternion and L). Choose the error that you accept on the vertical axis: the first curve to the "
    "right of it is the fastest variant. All variants of a panel have the same scene, run length and machine, and are "
    "called in the same way. Each variant has the coarsest steps or tolerances found that meet 1e-3, 1e-6, 1e-9 and "
    "1e-12 rad. A force evaluation is one evaluation of the equations of motion: a Newton iteration at one node, a "
    "kick, a stage, or one derivative of a Taylor series. A variant that is marked `budget` was stopped before it met "
    "the error, which says nothing of what it could reach. The closed form, `exact`, is what errors are measured by, "
    "and is not ranked. The table of rules, after the others, says which runs were made and timed."
)
RULES = {
    "variants": "every method in each chart that shows the axis; not in attitude where the method has the axis chart, "
    "because it shows the same axis there, for about the same time or more (see the study of the reduction)",
    "call": "the compiled loop from the start to the end of the run, without `simulate` around it",
    "errors that are asked": "those below the width of the nutation: a motion without any nutation meets the others",
    "variants of the energy comparison": "compiled ones in axis or angles: rk4, rk45-compiled and taylor against the "
    "symplectic or symmetric ones, without those that claim to conserve the energy by construction (the Gauss methods "
    "and simo-wong), whose energy error is rounding or the solver's; two variants without a common run time on a scene "
    "are no comparison there",
    "longest step": "as long as the method is accurate, up to 6 steps a run",
    "budget of a run": "a million force evaluations; 25 thousand in plain Python, 40 thousand in quadruple precision",
    "derivatives": "each of a Taylor series counts as a force evaluation, and costs more the higher it is",
    "runs that are timed": "a variant's cheapest in force evaluations for each error, and those of the comparison of "
    "energy errors and of those that conserve the energy by construction; no time is computed from others",
    "what runs beside": "nothing, or the rounds of another scene on a core of its own, if a trial shows that a run "
    "there takes at most 1.05 times as long as alone: the attributes `timed_at_once` and `timed_slowdown` of a "
    "case's file",
}


def spans(data: xr.Dataset) -> list[str]:
    """The horizons."""
    return [f"over {value:g} nutation periods" for value in data["horizon"].values]


def seconds(value: float) -> str:
    """A time with a unit that suits it."""
    return f"{value * 1e6:.3g} us" if value < 1e-3 else f"{value * 1e3:.3g} ms" if value < 1.0 else f"{value:.3g} s"


def of_implementation(data: xr.Dataset, kind: str) -> list[str]:
    """The names of the compiled methods, or of those in plain Python."""
    kinds = data["implementation"].transpose("variant", ...).values.reshape(data.sizes["variant"], -1)
    return [str(name) for name, known in zip(data["variant"].values, kinds, strict=True) if kind in known]


def lead(won: leads.Win) -> str:
    """The fastest variant at a target, its time, and the variants that are level with it or else its lead."""
    parts = [won.best.integrator, seconds(won.best.cost)]
    if won.level:
        parts.append(f"tied with {abridged(won.level, LEVEL)}")
    elif won.behind:
        parts.append(f"{won.ratio:.1f} times faster than {won.behind.integrator}")
    return ", ".join(parts)


def reasons(cell: xr.Dataset, target: float, names: Sequence[str] | None = None) -> str:
    """Why variants do not meet a target, the most frequent reason first; empty if all do."""
    variants = ranking.ranked(cell) if names is None else names
    why = [str(value) for value in cell["reached"].sel(variant=variants, target=target).values]
    count = Counter(reason for reason in why if reason not in ("met", CAPPED, ""))
    return ", ".join(reason for reason, _ in count.most_common())


def not_asked(data: xr.Dataset) -> str:
    """Which targets are not asked on which scenes, and why; empty if all are."""
    listed = []
    for name in data["scene"].values:
        cell = data.sel(scene=name)
        asked = leads.targets(cell)
        left = [f"{target:.0e}" for target in TARGETS if target not in asked]
        if left:
            listed.append(f"{' and '.join(left)} on {name} ({float(cell['nutation_width'].max()):.2g} rad wide)")
    return f" Not asked, because the nutation itself is narrower: {joined(listed)}." if listed else ""


def beside(data: xr.Dataset) -> str:
    """What the variants without steps cost: they stand beside the ranking. Empty if there is none."""
    ranked = ranking.ranked(data)
    said = []
    for name in (str(name) for name in data["variant"].values if name not in ranked):
        before, each = (data[key].sel(variant=name).values for key in ("set_up_seconds", "sample_seconds"))
        if np.isfinite(before).any():
            said.append(
                f"{name} is not ranked, because errors are measured by it. Whatever the run length, its constants take "
                f"{seconds(float(np.nanmin(before)))} to {seconds(float(np.nanmax(before)))}, and each sample "
                f"{seconds(float(np.nanmedian(each)))}."
            )
    return " ".join(said)


def sentences(data: xr.Dataset) -> list[str]:
    """The fastest variants, the closed form, heyoka's, the energies, plain Python, and what the times are worth."""
    wins = [won for won in leads.winners(data).values() if won]
    said = [
        fastest(data, wins),
        least_times(data),
        closed_form.headline(data, spans(data)),
        against_taylor.headline(data, spans(data)),
        *(energy.sentence(data, chart) for chart in energy.CHARTS),
        energy.at_equal_steps(data, COMPARED, str(data["scene"].values[0])),
        beside(data),
        plain_python(data),
        trust.sentence(data),
    ]
    return [sentence for sentence in said if sentence]


def fastest(data: xr.Dataset, wins: Sequence[leads.Win]) -> str:
    """Which variants win most of the combinations, and how many leads are sure."""
    if not wins:
        return "No compiled variant meets any of the errors."
    (first, most), *others = Counter(won.best.integrator for won in wins).most_common()
    rest = f", followed by {abridged([f'{name} in {times}' for name, times in others], LEVEL)}" if others else ""
    alone = sum(not won.level and won.behind is None for won in wins)
    return (
        f"{first} is the fastest variant in {most} of the {len(wins)} combinations of scene, run length and error "
        f"that a compiled variant meets{rest}. In {sum(won.behind is not None and not won.level for won in wins)} the "
        f"lead is larger than the noise{f', and in {alone} no other variant meets the error' if alone else ''}."
        + not_asked(data)
    )


def least_times(data: xr.Dataset) -> str:
    """From where to where the times of the fastest variants lie at each run length, and their leads."""
    times: dict[int, list[float]] = {}
    ratios = []
    for (_, far, _), won in leads.winners(data).items():
        if won is not None:
            times.setdefault(far, []).append(won.best.cost)
            ratios += [won.ratio] if won.behind and not won.level else []
    parts = [f"{seconds(min(values))} to {seconds(max(values))} {spans(data)[far]}" for far, values in times.items()]
    if not parts:
        return ""
    said = f"The fastest variant takes {joined(parts)}, by scene and error."
    if ratios:
        said += f" Where its lead is sure, the next variant takes {min(ratios):.1f} to {max(ratios):.1f} times as long."
    return said


def plain_python(data: xr.Dataset) -> str:
    """That the variants in plain Python are ranked among themselves; empty if there is none."""
    rows = of_implementation(data, "python")
    methods = list(dict.fromkeys(split_name(row)[0] for row in rows))
    return (
        f"Only compiled variants are ranked. The {len(rows)} variants in plain Python, of {abridged(methods)}, are "
        "ranked among themselves in a table of their own; compare them with the others by force evaluations."
        if rows
        else ""
    )


def tables(data: xr.Dataset) -> list[Table]:
    """The fastest variants, every variant's time, when to choose each, other comparisons, and the errors of times."""
    used = [name for name in (*ranking.NEEDS, *SHOWN) if name in data]
    cells = {
        (str(name), span): data[used].sel(scene=name).isel(horizon=far)  # of these alone: a dataset has dozens
        for far, span in enumerate(spans(data))
        for name in data["scene"].values
    }
    header = [f"axis error {target:.0e}" for target in TARGETS]
    winners, everything = [], []
    for span in spans(data):
        here = {name: cell for (name, at), cell in cells.items() if at == span}
        rows = [[name, *_winners(cell, "compiled")] for name, cell in here.items()]
        winners.append(Table(f"Fastest compiled variant to an axis error (rad) {span}", ["scene", *header], rows))
        chart = "in the chart that the variant names, call of the compiled loop"
        everything.append(
            Table(
                f"Time of every variant to the same errors {span}, {chart}; in brackets why an error is not reached",
                ["scene", "variant", *header],
                [[name, *row] for name, cell in here.items() for row in _every_time(cell)],
            )
        )
    if of_implementation(data, "python"):
        rows = [[*place, *_winners(cell, "python")] for place, cell in cells.items()]
        title = "Fastest variant in plain Python to an axis error (rad); in brackets why there is none"
        everything.append(Table(title, ["scene", "horizon", *header], rows))
    return [
        *winners, energy.table(data), growth.table(data), *everything, worth.table(data),
        against_taylor.table(data, spans(data)), closed_form.table(data, spans(data)), trust.table(data),
        Table("Which runs were made and timed", ["what", "rule"], list(RULES.items())),
    ]  # fmt: skip


def _winners(cell: xr.Dataset, implementation: str) -> list[str]:
    """The fastest variant of an implementation at every target, or why there is none."""
    rows = [row for row in of_implementation(cell, implementation) if row in ranking.ranked(cell)]
    asked, shown = leads.targets(cell), []
    for target in TARGETS:
        won = leads.win(cell, target, implementation) if target in asked else None
        none = f"none ({reasons(cell, target, rows)})" if target in asked else f"({TOO_WIDE})"
        shown.append(none if won is None else lead(won))
    return shown


def _every_time(cell: xr.Dataset) -> list[list[str]]:
    """Every variant of a scene and horizon: its time to each target, or why it has none."""
    rows, asked = ranking.ranked(cell), leads.targets(cell)
    met = {target: {place.integrator: seconds(place.cost) for place in ranking.cheapest(cell, target)}
           for target in asked}  # fmt: skip
    why = cell["reached"].sel(variant=rows, target=list(TARGETS)).transpose("variant", "target").values
    shown = [
        [row, *(met.get(target, {}).get(row, f"({reason})") for target, reason in zip(TARGETS, reached, strict=True))]
        for row, reached in zip(rows, why, strict=True)
    ]
    for row in (str(row) for row in cell["variant"].values if row not in rows):
        before, each = (float(cell[key].sel(variant=row).min()) for key in ("set_up_seconds", "sample_seconds"))
        if np.isfinite(before):
            text = f"set-up {seconds(before)}, each sample {seconds(each)}"
            shown.append([f"{row}, not ranked", text, *[""] * (len(TARGETS) - 1)])
    return shown
