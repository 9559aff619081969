"""What the report says first: which row to take, how often that is right, and what nothing warns of."""

import math
from collections import Counter

import xarray as xr

from symtop.runner.study import Opening, Table

from . import verdicts, words
from .costs import TIE

HEADER = [
    "run length", "axis error (rad)", "cheapest most often", "wins, of the tops that a row solves",
    "cost over the cheapest: median (90% quantile)", "meets it on", "next",
]  # fmt: skip
EXPLAINED = {
    "work_precision": "the times and the work of every row on eight named scenes",
    "stability": "where rows fail",
}


def opening(data: xr.DataTree) -> Opening:
    """The row that wins on the most tops, for each horizon and target of the axis, and what to expect of it."""
    rows = []
    ahead: Counter[str] = Counter()
    won_by: list[tuple[float, str]] = []  # the share of wins, and in words where and by whom
    met: list[tuple[float, str]] = []  # the share of the tops that the first row solves, and the same in words
    for cell in verdicts.cells(data, "axis", (verdicts.ALL,)):
        taken, won = verdicts.best(data, cell, words.UNIT)
        start = [f"{verdicts.nutations(data, cell.horizon):g} nutations", f"{cell.target:.0e}"]
        if won is None:
            rows.append([*start, "none", "", "", "", ""])
            continue
        first, *others = verdicts.standings(taken)
        ahead[first.name] += 1
        slow = first.slowdown[2]
        if others and not others[0].won.count:
            others = []
        following = f"{others[0].name} {words.percent(others[0].won)}" if others else ""
        rows.append(
            [*start, first.name if won.sure else f"{first.name} (not sure)",
             f"{words.percent(first.won)} ({words.interval(first.won)})",
             f"{words.ratio(first.slowdown[1])} ({words.ratio(slow) if math.isfinite(slow) else 'not reached'})",
             words.percent(first.solved), following]
        )  # fmt: skip
        second = f", and {others[0].name} on {words.percent(others[0].won)}" if others else ""
        task = f"{start[1]} rad over {start[0]}"
        met.append((first.solved.value, f"{first.name} meets {task} on {words.percent(first.solved)} of the tops"))
        won_by.append((first.won.value, f"{task}: {first.name} wins on {words.percent(first.won)} of the tops{second}"))
    (name, count), *_ = [*ahead.most_common(), ("none", 0)]
    lines = "in every line" if count == len(rows) else f"in {count} of the {len(rows)} lines"
    drawn = " and ".join(words.span(data, horizon) for horizon in verdicts.horizons(data))
    first_choice = (
        f"Begin with {name}. On more tops than any other row it reaches a given error of the axis at the least cost, "
        f"{lines} of the table."
    )
    closest = (
        f"The closest contest is at {min(won_by)[1]}. A row wins if every other costs at least {TIE:g} times as much."
        if won_by
        else ""
    )
    hardest = (
        f"The hardest line: {min(met)[1]}. taylor-longdouble and taylor-quad, which are slower and more precise, take "
        "no part in the table."
        if met
        else ""
    )
    measured = (
        f"Measured on {drawn}, drawn at random. A row is a method in one chart. Its cost is force evaluations, "
        "interpolated between the last setting that misses the error and the first that meets it, times the measured "
        "time of one in the bare compiled loop."
    )
    shares = (
        "A row meets the error on a share of all tops whose nutation is wider than it. It is the cheapest on a share "
        "of those that some row solves."
    )
    yours = "For your own scene and accuracy: symtop recommend SCENE --accuracy 1e-6."
    said = [
        first_choice, closest, hardest, words.strata_sentence(data), words.silent_sentence(data),
        words.guard_sentence(data), measured, shares, yours,
    ]  # fmt: skip
    table = Table("Wins on random tops", HEADER, rows)
    return Opening("Which integrator should I use, whatever my top?", list(filter(None, said)), table, EXPLAINED)
