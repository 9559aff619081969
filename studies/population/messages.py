"""The titles of the population study's figures, each one message with the numbers that its figure shows."""

from collections import Counter
from typing import NamedTuple

import numpy as np
import xarray as xr

from symtop.report.style import FIRM, RAISED, number

from . import verdicts
from .costs import Share
from .verdicts import Cell
from .words import FINE, UNIT, hidden, percent

HALF = 0.5  # of the tops, at which costs are compared
FEW = 0.01  # of the wrong runs: if fewer are missed, they are counted
SCALES = {"evaluations": 1.0}  # of a cost in a figure, by unit; microseconds of all others
MADE = {"evaluations": "force evaluations"}
SOLVED = " of the tops that any method solves"


def ten(target: float) -> str:
    """A target as a power of ten."""
    return f"10{str(round(np.log10(target))).translate(RAISED)}{FIRM}rad"


def over(data: xr.DataTree, horizon: str) -> str:
    """The run length."""
    return f"over {verdicts.nutations(data, horizon):g} nutations"


def share_won(share: Share) -> str:
    """A share in whole per cent, with a digit more if it is small: what is not zero is not printed as zero."""
    if not share.count or share.value >= 0.095:
        return f"{share.value:.0%}"
    return f"{share.value:.1%}" if share.value >= 0.0005 else "<0.1%"


def asked_sentence(data: xr.DataTree, horizon: str) -> str:
    """At which errors some tops are not asked for an axis, because their whole nutation is narrower."""
    drawn = verdicts.members(data, horizon)
    asked = {target: verdicts.costs(data, Cell(horizon, "axis", target), "evaluations").values.shape[1]
             for target in verdicts.targets(data)}  # fmt: skip
    fewer = [f"to {target:g} rad the {count:,}" for target, count in asked.items() if count < drawn]
    if not fewer:
        return ""
    return f"Asked are, of {drawn:,} tops, {' and '.join(fewer)} whose nutation is wider than the error."


class First(NamedTuple):
    """Who solves half of the tops of a cell for the least cost."""

    name: str
    cost: float  # as in the figure


def first_to_half(data: xr.DataTree, cell: Cell, unit: str) -> First | None:
    """The variant that solves half of the tops within the least cost; None if no variant does at any."""
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
    makes, ends = MADE.get(unit, "µs of force evaluations"), sorted({max(known), min(known)}, reverse=True)
    said = [f"to {ten(target)} for {number(known[target].cost)}{FIRM}{makes}" for target in ends]
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
            winners.append((taken.names[won.row], f"on {share_won(won.share)}{SOLVED} at {ten(target)}"))
    return winners if len(winners) < 2 else [winners[0], winners[-1]]


def slowdowns(data: xr.DataTree, horizon: str) -> str:
    """Who wins on the most tops at the coarsest target and at the finest that anybody meets."""
    ends, length = first_and_last(data, horizon), over(data, horizon)
    if not ends:
        return f"No method meets a target {length}"
    (first, share), *others = ends
    rest = [there.replace(SOLVED, "") if last == first else f"{last} {there}" for last, there in others]
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
        f"{share.everywhere:.0%} of all wrong runs look healthy, {share.fine:.0%} of those with at least {FINE:g} "
        "steps a nutation"
    )


def guard(data: xr.DataTree) -> str:
    """How many wrong runs the guard finds over each horizon, and what share a look at them afterwards finds."""
    spans = verdicts.horizons(data)
    before, after = (
        [verdicts.caught(data, horizon, score)[0] for horizon in spans] for score in ("foretold", "watched")
    )
    foreseen = [f"{found_of(share)} over {verdicts.nutations(data, horizon):g} nutations"
                for share, horizon in zip(before, spans, strict=True)]  # fmt: skip
    return (
        f"The guard foresees {' and '.join(foreseen)}; energy and momenta afterwards find "
        f"{' and '.join(map(percent, after))} of them"
    )


def found_of(share: Share, whole: bool = True) -> str:
    """How many wrong runs are found: in per cent, or how many are not if these are few."""
    missed, of = share.total - share.count, f" of {share.total:,}" if whole else ""
    if missed > FEW * share.total:
        return f"{percent(share)}{of or ' of'} wrong runs"
    return f"all but {missed:,}{of} wrong runs" if missed else f"all {f'{share.total:,} ' if whole else ''}wrong runs"


def guarded(data: xr.DataTree, horizon: str) -> str:
    """Over which runs the guard is judged."""
    tops = int(data[horizon].sizes["guarded"])
    wrong, right = verdicts.caught(data, horizon)
    return (
        f"the first {tops:,} of {verdicts.members(data, horizon):,} tops over {verdicts.nutations(data, horizon):g} "
        f"nutations ({wrong.total:,} wrong runs, {right.total:,} right ones)"
    )
