"""What the report says first: which row to take, how often that is right, and what nothing warns of."""

import math
from collections import Counter

import xarray as xr

from symtop.runner.study import Opening, Table

from . import verdicts, words
from .verdicts import Cell

HEADER = ["horizon", "axis error (rad)", "wins most", "wins on", "slowdown on all, median (90 %)", "solves", "next"]
MOST = 3  # rows named after the first
EXPLAINED = {
    "work_precision": "nine scenes, one motion each, explain it by the work of every row",
    "stability": "where rows fail",
}


def opening(data: xr.DataTree) -> Opening:
    """The row that wins on the most tops, for each horizon and target of the axis, and what to expect of it."""
    rows = []
    ahead: Counter[str] = Counter()
    for cell in verdicts.cells(data, "axis", (verdicts.ALL,)):
        taken, won = verdicts.best(data, cell, words.UNIT)
        start = [f"{verdicts.nutations(data, cell.horizon):g} nutations", f"{cell.target:.0e}"]
        if won is None:
            rows.append([*start, "none", "", "", "", ""])
            continue
        first, *others = verdicts.standings(taken)
        ahead[first.name] += 1
        slow = first.slowdown[2]
        rows.append(
            [*start, first.name if won.sure else f"{first.name} (not sure)",
             f"{words.percent(first.won)} ({words.interval(first.won)})",
             f"{words.ratio(first.slowdown[1])} ({words.ratio(slow) if math.isfinite(slow) else 'not reached'})",
             words.percent(first.solved), ", ".join(f"{one.name} {words.percent(one.won)}" for one in others[:MOST])]
        )  # fmt: skip
    (name, count), *_ = [*ahead.most_common(), ("none", 0)]
    first_cell = Cell("short", "axis", verdicts.targets(data)[0])
    tops = verdicts.costs(data, first_cell, words.UNIT).values.shape[1]
    drawn = " and ".join(words.span(data, horizon) for horizon in verdicts.horizons(data))
    first = (
        f"No row is the best for every top. On {drawn}, drawn at random, {name} wins most often at {count} of "
        f"{len(rows)} pairs of horizon and accuracy ({tops:,} tops are asked at the coarsest). A row is a method in "
        "one chart; its step or tolerance is the coarsest that meets the error; times are those of the bare compiled "
        "loop."
    )
    last = "For your own scene and accuracy: symtop recommend SCENE --accuracy 1e-6."
    said = [first, words.silent_sentence(data), words.guard_sentence(data), last]
    table = Table("Wins on random tops", HEADER, rows)
    return Opening("Which integrator should I use, whatever my top?", said, table, EXPLAINED)
