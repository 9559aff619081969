"""The tables of the population study, from its datasets."""

import math

import numpy as np
import xarray as xr

from symtop.run.guard import EXPECTED
from symtop.runner.study import Table

from . import verdicts, words
from .costs import Share
from .ladder import KEPT, WRONG
from .prices import TOLERANCE, of_processes
from .verdicts import ALL, UNITS, Cell
from .words import interval, percent, ratio, span

LISTED = 8  # variants of a cell in a table
STEPS = (4.37, 17.48, 69.92)  # a nutation, of the table of silent failures

RULES = {
    "tops": "drawn from a distribution without units that `symtop.population` writes down",
    "settings": "steps that are halved, or tolerances divided by ten; the coarsest has 1.1 steps a nutation, for the "
    "energy 4.4",
    "cost of an error": "interpolated in logarithms between the last run that misses it and the first that meets it "
    "for good; no run of these tables was timed",
    "price of an evaluation": "the slope of the time between a short and a long run, so that the call itself has no "
    "part in it; of variants whose order follows the tolerance at each of several, and on each top that of the "
    "tolerance that meets the error, which is interpolated as the cost is",
    "tops that are asked": "those whose nutation is wider than the error, and where this is at least ten times the "
    "error of the truth",
    "energy": "is asked of the variants that do not conserve it by construction",
    "errors": "the largest of a dozen samples that are not commensurate with the nutation, against the closed form",
    "wrong runs without a sign": "are counted here among the wrong runs that keep energy and momenta, on all tops at "
    "the settings that were run on every one; the maps of the study stability count, of all inaccurate runs, those "
    "that end without an error, whether or not they keep the energy",
    **{f"left out: {' and '.join(names)}": why for why, names in words.LEFT_OUT.items()},
}
STANDINGS = [
    "nutations", "quantity", "target", "variant", "solved", "slowdown, median", "10 %", "90 %", "wins", "95 % interval",
    "tied for the cheapest",
]  # fmt: skip
BY_QUANTITY = ["nutations", "error", *words.QUANTITIES_ASKED]
WINNERS = ["nutations", "target", "stratum", "tops", "wins most", "on", "next", "on", "sure", "unsolved"]
SILENT = [
    "variant",
    *(f"{kind} at {steps:.3g} a nutation" for steps in STEPS for kind in ("wrong", "silent")),
    "hidden",
]
GUARD = ["nutations", "tops", "variants", "runs", "wrong", "caught", "false alarms", "area under the curve"]
PRICES = ["variant", "alone (ns)", "together (ns)", "ratio", "noise"]


def tables(data: xr.DataTree) -> list[Table]:
    """Winners by quantity, standings in three units, winners by stratum, silent failures, the guard and the prices."""
    most = words.budget(data, verdicts.horizons(data)[0])
    rules = [["budget of a run", f"{most} force evaluations a nutation"], *map(list, RULES.items())]
    return [
        _by_quantity(data), _guard(data), *(_standings(data, unit) for unit in UNITS), _by_stratum(data),
        _silent(data), _prices(data), _prices_by_tolerance(data),
        Table("Which runs were made", ["what", "rule"], rules),
    ]  # fmt: skip


def _by_quantity(data: xr.DataTree) -> Table:
    lines = [
        [f"{verdicts.nutations(data, horizon):g}", f"{target:.0e}",
         *(words.winner_words(data, Cell(horizon, name, target)) or "none" for name in words.QUANTITIES_ASKED)]
        for horizon in verdicts.horizons(data)
        for target in verdicts.targets(data)
    ]  # fmt: skip
    unit = UNITS[words.UNIT]
    title = f"The cheapest variant, ties left out, on the most of the tops that some variant solves; cost in {unit}"
    return Table(title, BY_QUANTITY, lines)


def _standings(data: xr.DataTree, unit: str) -> Table:
    lines = []
    for quantity in words.QUANTITIES_ASKED:
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
    return Table(f"Slowdown against the cheapest variant on each top, and wins, by {UNITS[unit]}", STANDINGS, lines)


def _by_stratum(data: xr.DataTree) -> Table:
    lines = []
    for cell in verdicts.cells(data, "axis"):
        taken, won = verdicts.best(data, cell, words.UNIT)
        tops = taken.values.shape[1] if taken.names else 0
        start = [f"{verdicts.nutations(data, cell.horizon):g}", f"{cell.target:.0e}", cell.stratum, f"{tops}"]
        if won is None:
            lines.append([*start, "none", "", "", "", "", f"{1:.0%}" if tops else ""])
            continue
        unsolved = Share(tops - won.share.total, tops)
        names = taken.names[won.row], taken.names[won.next_variant]
        lines.append(
            [*start, names[0], percent(won.share), names[1], percent(won.next_share), "yes" if won.sure else "no",
             percent(unsolved)]
        )  # fmt: skip
    return Table(f"Which tops want which variant: wins by stratum, axis, {UNITS[words.UNIT]}", WINNERS, lines)


def _silent(data: xr.DataTree) -> Table:
    lines = []
    for name in verdicts.judged_variants(data):
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
        length, tops = f"{verdicts.nutations(data, horizon):g}", f"{words.asked_of(data, horizon)}"
        ways = [(label, "foretold", names) for label, names in guarded_variants(data, horizon).items()]
        for label, score, names in [*ways, (f"{ways[0][0]}, by energy and momenta afterwards", "watched", ways[0][2])]:
            hits, alarms = verdicts.caught(data, horizon, score, names)
            area = verdicts.detected(data, horizon, score, names).area
            lines.append(
                [length, tops, label, f"{hits.total + alarms.total}", f"{hits.total}",
                 f"{percent(hits)} ({interval(hits)})", f"{percent(alarms)} ({interval(alarms)})", f"{area:.3f}"]
            )  # fmt: skip
    title = (
        f"The guard's forecast above {EXPECTED:g} rad as a warning of a wrong run, asked at the coarsest steps or "
        f"tolerances of each variant; energy and momenta: a change above {KEPT:.0%}"
    )
    return Table(title, GUARD, lines)


def guarded_variants(data: xr.DataTree, horizon: str) -> dict[str, list[str]]:
    """The variants that the guard was asked about: all, and by what they have in common."""
    rows, group = verdicts.judged_variants(data, horizon), data[horizon].to_dataset().isel(scene=0)
    control = dict(zip(map(str, group["variant"].values), map(str, group["control"].values), strict=True))
    fixed = [name for name in rows if control[name] == "step_size"]
    parts = {
        "fixed step, angles": [name for name in fixed if "[angles]" in name],
        "fixed step, axis": [name for name in fixed if "[axis]" in name],
        "adaptive": [name for name in rows if name not in fixed],
    }
    return {"all": rows} | {label: names for label, names in parts.items() if names}


def _prices(data: xr.DataTree) -> Table:
    group = of_processes(data["prices"].to_dataset())
    lines = []
    for name in map(str, group["variant"].values):
        alone, together, spread = (float(group[key].sel(variant=name)) for key in ("alone", "together", "spread"))
        lines.append([name, f"{1e9 * alone:.3g}", f"{1e9 * together:.3g}", f"{alone / together:.2f}", f"{spread:.0%}"])
    title = (
        "Measured price of a force evaluation, without the call, in a run of one top and in one call for many; "
        f"at the tolerance {TOLERANCE:.0e} where it depends on it"
    )
    return Table(title, PRICES, lines)


def _prices_by_tolerance(data: xr.DataTree) -> Table:
    group = of_processes(data["prices"].to_dataset())
    by = group["alone_by"].transpose("variant", "priced_at").values
    names = [str(name) for name in group["variant"].values]
    lines = [[name, *(f"{1e9 * price:.3g}" for price in row)]
             for name, row in zip(names, by, strict=True) if np.ptp(row)]  # fmt: skip
    header = ["variant", *(f"{tolerance:.0e}" for tolerance in group["priced_at"].values)]
    return Table(
        "Price of a force evaluation alone (ns), by tolerance, of variants whose order follows it", header, lines
    )
