"""What the population study says in sentences and tables, all of it from its datasets."""

import math
from collections import Counter
from typing import NamedTuple

import numpy as np
import xarray as xr

from symtop.run.guard import EXPECTED
from symtop.runner.study import Table

from . import verdicts
from .costs import TIE, Share
from .ladder import KEPT, WRONG
from .verdicts import ALL, UNITS, Cell

LISTED = 8  # rows of a cell in a table
UNIT = "alone"  # of the verdicts; tables have the others
QUANTITIES_ASKED = ("axis", "attitude", "energy")
FINE = 50.0  # steps a nutation that look like enough
STEPS = (4.37, 17.48, 69.92)  # a nutation, of the table of silent failures

LEFT_OUT = {  # methods, by the reason
    "the same maps in three coordinates, at ten times the time": ("midpoint-unreduced", "trapezoidal-unreduced"),
    "the same steps as taylor in slower arithmetic": ("taylor-longdouble", "taylor-quad"),
    "a step of any size is the motion itself, so that no step is too coarse": ("exact-discrete",),
}

HOW_TO_READ = (
    "The tops are drawn at random, from a distribution without units that `symtop.population` writes down, in six "
    "strata: slow, fast, grazing a pole, near the separatrix, hanging and sleeping. A row is a method in one chart. On "
    "each top it runs from coarse settings to fine ones, steps that are halved or tolerances divided by ten, within a "
    "budget of force evaluations a nutation. The cost of a target is interpolated in logarithms between the last run "
    "that misses it and the first that meets it for good. The coarsest run has 1.1 steps a nutation; energy is asked "
    "from 4.4 on, of the rows that do not conserve it by construction. A target is asked of a top if it is below the "
    "width of the nutation and at least ten times the error of the truth. Seconds are force evaluations times the "
    "measured time of one, of the bare compiled loop, alone or in a call for many tops. The slowdown of a row on a top "
    f"is its cost over the least of all rows there. A row wins on a top if all others cost at least {TIE:g} times as "
    "much; shares have 95 % intervals (Wilson). A winner is called sure if its lead is three standard errors with the "
    "times of either half of the rounds. Errors are the largest of a dozen samples that are not commensurate with the "
    "nutation, measured against the closed form. No run of these tables was timed. Left out are "
    + "; ".join(f"{' and '.join(names)} ({why})" for why, names in LEFT_OUT.items())
    + "."
)

ANOTHER_SHARE = (
    "(The maps of the study stability count another share: of all inaccurate runs, those that end without an error, "
    "whether or not they keep the energy.)"
)
STANDINGS = [
    "nutations", "quantity", "target", "row", "solved", "slowdown, median", "10 %", "90 %", "wins", "95 % interval",
    "level with the cheapest",
]  # fmt: skip
WINNERS = ["nutations", "target", "stratum", "tops", "wins most", "on", "next", "on", "sure", "unsolved"]
SILENT = ["row", *(f"{kind} at {steps:.3g} a nutation" for steps in STEPS for kind in ("wrong", "silent")), "hidden"]
GUARD = ["nutations", "rows", "runs", "wrong", "caught", "false alarms", "area under the curve"]
PRICES = ["row", "alone (ns)", "together (ns)", "ratio", "noise"]


def percent(share: Share) -> str:
    """A share in per cent."""
    return f"{share.value:.1%}" if share.total else "none"


def interval(share: Share) -> str:
    """Its 95 % interval."""
    low, high = share.interval()
    return f"{low:.1%} to {high:.1%}"


def ratio(value: float) -> str:
    """A slowdown; infinite where the target is not reached."""
    return "not reached" if math.isinf(value) else "" if math.isnan(value) else f"{value:.3g}"


def span(data: xr.DataTree, horizon: str) -> str:
    """A horizon and its tops in words."""
    return f"{verdicts.members(data, horizon):,} tops over {verdicts.nutations(data, horizon):g} nutations"


def budget(data: xr.DataTree, horizon: str) -> str:
    """The most force evaluations a nutation of one run."""
    group = data[horizon]
    return f"{float(np.nanmax(group['budget'].values)) / verdicts.nutations(data, horizon):,.0f}"


def winner_sentence(data: xr.DataTree, cell: Cell, unit: str = UNIT) -> str:
    """Who wins a cell, by how much, and how sure that is; empty where nobody reaches the target."""
    taken, won = verdicts.best(data, cell, unit)
    if won is None:
        return ""
    name = taken.names[won.row]
    following = f"{taken.names[won.next_row]} on {percent(won.next_share)}" if won.next_share.count else "no other row"
    standing = next(one for one in verdicts.standings(taken) if one.name == name)
    sure = "" if won.sure else ", a lead that may be chance or noise of the times"
    return (
        f"{cell.target:.0e}: {name} on {percent(won.share)} ({interval(won.share)}), with a median slowdown of "
        f"{ratio(standing.slowdown[1])} over all tops, then {following}{sure}"
    )


def verdict_of(data: xr.DataTree, horizon: str, quantity: str) -> str:
    """The winners of a quantity over a horizon."""
    each = [winner_sentence(data, Cell(horizon, quantity, target)) for target in verdicts.targets(data)]
    said = "; ".join(filter(None, each))
    return (
        f"The cheapest row for an error of the {quantity}, ties left out, and the share of tops on which it is, among "
        f"{span(data, horizon)} (cost in {UNITS[UNIT]}): {said}."
        if said
        else ""
    )


def strata_sentence(data: xr.DataTree, horizon: str = "short") -> str:
    """How many rows win somewhere, and the strata whose winner is another than that of all tops."""
    owners: Counter[str] = Counter()
    others = []
    for target in verdicts.targets(data):
        taken, first = verdicts.best(data, Cell(horizon, "axis", target), UNIT)
        if first is None:
            continue
        overall = taken.names[first.row]
        for stratum in verdicts.strata(data):
            part, won = verdicts.best(data, Cell(horizon, "axis", target, stratum), UNIT)
            if won is not None:
                owners[part.names[won.row]] += 1
                if won.sure and part.names[won.row] != overall:
                    others.append(f"{part.names[won.row]} for {stratum} at {target:.0e}")
    total = sum(owners.values())
    most = ", ".join(f"{name} ({count})" for name, count in owners.most_common(4))
    differ = (
        f" Kinds of tops whose winner differs from that of all tops, beyond doubt: {'; '.join(others)}."
        if others
        else " No kind of tops has, beyond doubt, another winner than all tops together."
    )
    return (
        f"The tops are of {len(verdicts.strata(data))} kinds (strata). Over {verdicts.nutations(data, horizon):g} "
        f"nutations, {len(owners)} rows win the {total} pairs of a kind and an axis error, most often {most}.{differ}"
    )


class Hidden(NamedTuple):
    """Wrong runs that look healthy."""

    wrong: float  # runs
    everywhere: float  # share of all wrong runs that look healthy
    fine: float  # among rows with a fixed step, of at least `FINE` steps a nutation
    wrong_fine: float  # runs of these


def hidden(data: xr.DataTree) -> Hidden:
    """Wrong runs that nothing warns of, of all and among small steps."""
    each = [verdicts.health(data, name) for name in verdicts.judged_rows(data)]
    wrong, silent = sum(one.wrong.sum() for one in each), sum(one.silent.sum() for one in each)
    small = [one for one in each if one.fixed_step]
    missed = sum(one.wrong[one.setting >= FINE].sum() for one in small)
    unseen = sum(one.silent[one.setting >= FINE].sum() for one in small)
    return Hidden(float(wrong), float(silent / max(wrong, 1.0)), float(unseen / max(missed, 1.0)), float(missed))


def hidden_by_steps(data: xr.DataTree) -> list[tuple[float, float, float]]:
    """Steps a nutation, wrong runs with so many, and those of them that nothing warns of; rows with a fixed step."""
    sums: dict[float, tuple[float, float]] = {}
    for one in (verdicts.health(data, name) for name in verdicts.judged_rows(data)):
        for step, wrong, silent in zip(one.setting, one.wrong, one.silent, strict=True) if one.fixed_step else ():
            before = sums.get(float(f"{step:.3g}"), (0.0, 0.0))
            sums[float(f"{step:.3g}")] = before[0] + float(wrong), before[1] + float(silent)
    return [(step, *sums[step]) for step in sorted(sums)]


def silent_sentence(data: xr.DataTree) -> str:
    """How many wrong runs nothing warns of, over all rows and among small steps."""
    share = hidden(data)
    return (
        f"Of {share.wrong:,.0f} wrong runs, with the axis off by more than {WRONG:g} rad after "
        f"{verdicts.nutations(data, 'short'):g} nutations, {share.everywhere:.0%} give no sign of it: they end "
        f"without an error and keep energy and momenta to {KEPT:.0%}. Among those with at least {FINE:g} steps a "
        f"nutation it is {share.fine:.0%}."
    )


def warning_sentence(data: xr.DataTree) -> str:
    """How often the guard warns over each horizon, of wrong runs and of right ones."""
    said = []
    for horizon in verdicts.horizons(data):
        hits, alarms = verdicts.caught(data, horizon)
        said.append(
            f"over {verdicts.nutations(data, horizon):g} nutations, on {asked_of(data, horizon)} of the tops, it "
            f"warned of {hits.count:,} of {hits.total:,} runs that ended more than {WRONG:g} rad off, and of "
            f"{percent(alarms)} of {alarms.total:,} that ended within {EXPECTED:g} rad"
        )
    return (
        "Before a run, the guard tries the method on two nutations. Asked at the coarsest steps or tolerances of each "
        f"row, {'; '.join(said)}."
    )


def asked_of(data: xr.DataTree, horizon: str) -> int:
    """How many tops the guard was asked about."""
    told = data[horizon].to_dataset()["foretold"].notnull()
    return int(told.any([name for name in told.dims if name != "guarded"]).sum())


def guard_sentence(data: xr.DataTree) -> str:
    """What the guard catches, and how often it warns for nothing."""
    said = []
    for horizon in verdicts.horizons(data):
        hits, alarms = verdicts.caught(data, horizon)
        said.append(
            f"over {verdicts.nutations(data, horizon):g} nutations of {percent(hits)} ({interval(hits)}) of "
            f"{hits.total:,} wrong runs and of {percent(alarms)} ({interval(alarms)}) of {alarms.total:,} right ones "
            f"(area under its curve {verdicts.detected(data, horizon).area:.3f})"
        )
    seen = verdicts.caught(data, "short", "watched")
    return (
        "The guard, which runs a short piece of the method before the run, warns "
        f"{', and '.join(said)}. Right: below the {EXPECTED:g} rad that it warns of; wrong: above {WRONG:g} rad. "
        f"A look at energy and momenta after these runs, to {KEPT:.0%}, finds {percent(seen[0])} of the wrong ones "
        f"over {verdicts.nutations(data, 'short'):g} nutations and suspects {percent(seen[1])} of the right ones."
    )


def effort_sentence(data: xr.DataTree) -> str:
    """How much was run."""
    parts = [data[horizon] for horizon in verdicts.horizons(data)]
    made, evaluated = (sum(float(np.nansum(part[name].values)) for part in parts) for name in ("made", "evaluated"))
    rows = len({str(name) for part in parts for name in part["integrator"].values})
    return f"{rows} rows made {made:,.0f} runs of {evaluated:.2g} force evaluations in all."


def sentences(data: xr.DataTree) -> list[str]:
    """The winners by horizon and quantity, the strata, the silent failures, the guard and the effort."""
    each = [verdict_of(data, horizon, name) for horizon in verdicts.horizons(data) for name in QUANTITIES_ASKED]
    return [
        *filter(None, each),
        strata_sentence(data),
        f"{silent_sentence(data)} {ANOTHER_SHARE}",
        guard_sentence(data),
        effort_sentence(data),
    ]


def tables(data: xr.DataTree) -> list[Table]:
    """Standings by cell in three units, winners by stratum, silent failures, the guard and the prices."""
    return [*(_standings(data, unit) for unit in UNITS), _by_stratum(data), _silent(data), _guard(data), _prices(data)]


def _standings(data: xr.DataTree, unit: str) -> Table:
    lines = []
    for quantity in QUANTITIES_ASKED:
        for cell in verdicts.cells(data, quantity, (ALL,)):
            taken = verdicts.costs(data, cell, unit)
            if not taken.names:
                continue
            for one in verdicts.standings(taken)[:LISTED]:
                low, middle, high = map(ratio, one.slowdown)
                goal = [f"{verdicts.nutations(data, cell.horizon):g}", quantity, f"{cell.target:.0e}", one.name]
                lines.append(
                    [*goal, percent(one.solved), middle, low, high, percent(one.won), interval(one.won),
                     percent(one.level)]
                )  # fmt: skip
    return Table(f"Slowdown against the cheapest row on each top, and wins, by {UNITS[unit]}", STANDINGS, lines)


def _by_stratum(data: xr.DataTree) -> Table:
    lines = []
    for cell in verdicts.cells(data, "axis"):
        taken, won = verdicts.best(data, cell, UNIT)
        tops = taken.values.shape[1] if taken.names else 0
        start = [f"{verdicts.nutations(data, cell.horizon):g}", f"{cell.target:.0e}", cell.stratum, f"{tops}"]
        if won is None:
            lines.append([*start, "none", "", "", "", "", f"{1:.0%}" if tops else ""])
            continue
        unsolved = Share(tops - won.share.total, tops)
        names = taken.names[won.row], taken.names[won.next_row]
        lines.append(
            [*start, names[0], percent(won.share), names[1], percent(won.next_share), "yes" if won.sure else "no",
             percent(unsolved)]
        )  # fmt: skip
    return Table(f"Which tops want which row: wins by stratum, axis, {UNITS[UNIT]}", WINNERS, lines)


def _silent(data: xr.DataTree) -> Table:
    lines = []
    for name in verdicts.judged_rows(data):
        one = verdicts.health(data, name)
        if not one.fixed_step:
            continue
        shown = []
        for steps in STEPS:
            at = np.flatnonzero(np.isclose(one.setting, steps))
            shown += (
                [f"{one.wrong[at[0]] / one.runs[at[0]]:.1%}", f"{one.silent[at[0]] / one.runs[at[0]]:.1%}"]
                if at.size
                else ["", ""]
            )
        lines.append([name, *shown, f"{one.hidden:.0%}" if math.isfinite(one.hidden) else ""])
    title = (
        f"Silent failures: axis off by more than {WRONG:g} rad, outcome ok, energy and momenta kept to {KEPT:.0%}; "
        f"{span(data, 'short')}; hidden: silent of all wrong runs"
    )
    return Table(title, SILENT, lines)


def _guard(data: xr.DataTree) -> Table:
    lines = []
    for horizon in verdicts.horizons(data):
        for label, names in guarded_rows(data, horizon).items():
            hits, alarms = verdicts.caught(data, horizon, names=names)
            area = verdicts.detected(data, horizon, names=names).area
            lines.append(
                [f"{verdicts.nutations(data, horizon):g}", label, f"{hits.total + alarms.total}", f"{hits.total}",
                 f"{percent(hits)} ({interval(hits)})", f"{percent(alarms)} ({interval(alarms)})", f"{area:.3f}"]
            )  # fmt: skip
    return Table(f"The guard's forecast above {EXPECTED:g} rad as a warning of a wrong run", GUARD, lines)


def guarded_rows(data: xr.DataTree, horizon: str) -> dict[str, list[str]]:
    """The rows that the guard was asked about: all, and by what they have in common."""
    rows, group = verdicts.judged_rows(data, horizon), data[horizon].to_dataset().isel(scene=0)
    control = dict(zip(map(str, group["integrator"].values), map(str, group["control"].values), strict=True))
    fixed = [name for name in rows if control[name] == "step_size"]
    parts = {
        "fixed step, angles": [name for name in fixed if "[angles]" in name],
        "fixed step, axis": [name for name in fixed if "[axis]" in name],
        "adaptive": [name for name in rows if name not in fixed],
    }
    return {"all": rows} | {label: names for label, names in parts.items() if names}


def _prices(data: xr.DataTree) -> Table:
    group = data["prices"].to_dataset().isel(scene=0)
    lines = []
    for name in map(str, group["integrator"].values):
        alone, together, spread = (float(group[key].sel(integrator=name)) for key in ("alone", "together", "spread"))
        lines.append([name, f"{1e9 * alone:.3g}", f"{1e9 * together:.3g}", f"{alone / together:.2f}", f"{spread:.0%}"])
    return Table("Time of a force evaluation, in a run of one top and in one call for many", PRICES, lines)
