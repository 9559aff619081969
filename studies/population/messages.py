"""The titles of the population study's figures, each one message with the numbers that its figure shows."""

from collections import Counter
from typing import NamedTuple

import numpy as np
import xarray as xr

from symtop.report.style import FIRM, RAISED, number

from . import verdicts
from .verdicts import Cell
from .words import FINE, UNIT, hidden, percent

HALF = 0.5  # of the tops, at which costs are compared
SCALES = {"evaluations": 1.0}  # of a cost in a figure, by unit; microseconds of all others
MADE = {"evaluations": "force evaluations"}


def ten(target: float) -> str:
    """A target as a power of ten."""
    return f"10{str(round(np.log10(target))).translate(RAISED)}{FIRM}rad"


def over(data: xr.DataTree, horizon: str) -> str:
    """The run length."""
    return f"over {verdicts.nutations(data, horizon):g} nutations"


class First(NamedTuple):
    """Who solves half of the tops of a cell for the least cost."""

    name: str
    cost: float  # as in the figure


def first_to_half(data: xr.DataTree, cell: Cell, unit: str) -> First | None:
    """The row that solves half of the tops within the least cost; None if no row does at any."""
    taken = verdicts.costs(data, cell, unit)
    if not taken.names or not taken.values.shape[1]:
        return None
    middle = np.quantile(taken.values, HALF, axis=1, method="inverted_cdf")
    row = int(np.argmin(middle))
    return First(taken.names[row], float(middle[row]) * SCALES.get(unit, 1e6)) if np.isfinite(middle[row]) else None


def run_lengths(data: xr.DataTree, unit: str, horizon: str) -> str:
    """Who solves half of the tops first at the coarsest target and at the finest at which somebody does."""
    each = {target: first_to_half(data, Cell(horizon, "axis", target), unit) for target in verdicts.targets(data)}
    known = {target: one for target, one in each.items() if one is not None}
    if not known:
        return f"No method solves half of the tops {over(data, horizon)}"
    makes, ends = MADE.get(unit, "µs"), sorted({max(known), min(known)}, reverse=True)
    said = [f"to {ten(target)} in {number(known[target].cost)}{FIRM}{makes}" for target in ends]
    names = [known[target].name for target in ends]
    if len(set(names)) == 1:
        return (
            f"{over(data, horizon).capitalize()} {names[0]} is the first to solve half of the tops: {', '.join(said)}"
        )
    each_by = [f"by {name} {words}" for name, words in zip(names, said, strict=True)]
    return f"{over(data, horizon).capitalize()} half of the tops are first solved {', '.join(each_by)}"


def first_and_last(data: xr.DataTree, horizon: str) -> list[tuple[str, str]]:
    """Who wins on the most tops at the coarsest target and at the finest that anybody meets, and on how many."""
    winners = []
    for target in verdicts.targets(data):
        taken, won = verdicts.best(data, Cell(horizon, "axis", target), UNIT)
        if won is not None:
            winners.append((taken.names[won.row], f"on {won.share.value:.0%} of the tops at {ten(target)}"))
    return winners if len(winners) < 2 else [winners[0], winners[-1]]


def slowdowns(data: xr.DataTree, horizon: str) -> str:
    """Who wins on the most tops at the coarsest target and at the finest that anybody meets."""
    ends, length = first_and_last(data, horizon), over(data, horizon)
    if not ends:
        return f"No method meets a target {length}"
    (first, share), *others = ends
    rest = [there.replace(" of the tops", "") if last == first else f"{last} {there}" for last, there in others]
    return f"{', '.join([f'{first} is the cheapest {share}', *rest])}, {length}"


def strata(data: xr.DataTree, horizon: str = "short") -> str:
    """Who wins the most pairs of a kind of top and a target, and how many others win one."""
    owners: Counter[str] = Counter()
    for target in verdicts.targets(data):
        for stratum in verdicts.strata(data):
            part, won = verdicts.best(data, Cell(horizon, "axis", target, stratum), UNIT)
            if won is not None:
                owners[part.names[won.row]] += 1
    if not owners:
        return "No method is the cheapest for a kind of top"
    first, times = owners.most_common(1)[0]
    others = len(owners) - 1
    rest = f"; {others} other{'s' * (others > 1)} for the rest" if others else ""
    return (
        f"{over(data, horizon).capitalize()} {first} is most often the cheapest for {times} of {sum(owners.values())} "
        f"pairs of a kind of top and an accuracy{rest}"
    )


def silent(data: xr.DataTree) -> str:
    """The share of wrong runs that nothing warns of, and that among small steps."""
    share = hidden(data)
    return (
        f"Wrong runs look healthy: {share.everywhere:.0%} of all, {share.fine:.0%} of those with at least {FINE:g} "
        "steps a nutation"
    )


def guard(data: xr.DataTree) -> str:
    """What the guard finds of the wrong runs, and how many right ones it suspects, over each horizon."""
    found, alarms = zip(*(verdicts.caught(data, horizon) for horizon in verdicts.horizons(data)), strict=True)
    least = min(found, key=lambda share: share.value)
    suspected = [
        f"{percent(share)} {over(data, horizon) if not place else f'over {verdicts.nutations(data, horizon):g}'}"
        for place, (horizon, share) in enumerate(zip(verdicts.horizons(data), alarms, strict=True))
    ]
    return (
        f"The guard finds {percent(least)} of the wrong runs before they are made; of the right ones it suspects "
        f"{' and '.join(suspected)}"
    )
