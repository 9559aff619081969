"""What the report says first: which variant to take, how often that is right, and what nothing warns of."""

import math
from collections import Counter

import xarray as xr

from symtop.runner.study import Opening, Table

from . import verdicts, words
from .costs import TIE
from .verdicts import Standing

HEADER = [
    "nutations", "axis error (rad)", "cheapest most often", "wins, of the tops that a variant solves",
    "cost over the cheapest: median (90% quantile)", "next", "meets it, of all tops", "met on most tops by",
]  # fmt: skip
EXPLAINED = {
    "work_precision": "the times and the work of every variant on eight named scenes",
    "stability": "where variants fail",
}


MARGIN = 0.05  # of all tops: that many more met by another variant are said
ENOUGH = 30  # tops of a kind whose gap is told


def behind(one: Standing, widest: Standing) -> bool:
    """Does another variant meet the error on clearly more tops?"""
    return widest.solved.value - one.solved.value >= MARGIN


def unmet_sentence(data: xr.DataTree) -> str:
    """In how many lines another variant meets the error on clearly more tops than the cheapest, and where most do."""
    gaps: dict[str, list[tuple[float, str]]] = {"all": [], "kind": []}
    lines = 0
    for cell in verdicts.cells(data, "axis"):
        taken, won = verdicts.best(data, cell, words.UNIT)
        everyone = cell.stratum == verdicts.ALL
        lines += everyone
        if won is None:
            continue
        overall = verdicts.best(data, cell._replace(stratum=verdicts.ALL), words.UNIT)
        listed = verdicts.standings(taken)
        name = overall[0].names[overall[1].row] if overall[1] is not None else listed[0].name
        first = next((one for one in listed if one.name == name), listed[0])
        widest = verdicts.widest([first, *listed])
        if behind(first, widest) and (everyone or first.solved.total >= ENOUGH):
            tops = "all tops" if everyone else f"{cell.stratum} tops"
            said = (
                f"{widest.name} meets {cell.target:.0e} rad over {verdicts.nutations(data, cell.horizon):g} nutations"
                f" on {words.percent(widest.solved)} of {tops}, and {first.name} on {words.percent(first.solved)}"
            )
            gaps["all" if everyone else "kind"].append((widest.solved.value - first.solved.value, said))
    if not gaps["all"]:
        return ""
    kind = f" By kind of top the widest gap is: {max(gaps['kind'])[1]}." if gaps["kind"] else ""
    return (
        f"In {len(gaps['all'])} of the {lines} lines another variant meets the error on more tops than the cheapest, "
        f"by at least {MARGIN:.0%}: {max(gaps['all'])[1]}.{kind}"
    )


def opening(data: xr.DataTree) -> Opening:
    """The variant that wins on the most tops, for each horizon and target of the axis, and what to expect of it."""
    rows = []
    ahead: Counter[str] = Counter()
    won_by: list[tuple[float, str]] = []  # the share of wins, and in words where and by whom
    met: list[tuple[float, str]] = []  # the share of the tops that the first variant solves, and the same in words
    for cell in verdicts.cells(data, "axis", (verdicts.ALL,)):
        taken, won = verdicts.best(data, cell, words.UNIT)
        start = [f"{verdicts.nutations(data, cell.horizon):g}", f"{cell.target:.0e}"]
        if won is None:
            rows.append([*start, "none", "", "", "", "", ""])
            continue
        first, *others = verdicts.standings(taken)
        ahead[first.name] += 1
        slow, widest = first.slowdown[2], verdicts.widest([first, *others])
        if others and not others[0].won.count:
            others = []
        following = f"{others[0].name} {words.percent(others[0].won)}" if others else ""
        rows.append(
            [*start, first.name if won.sure else f"{first.name} (not sure)",
             f"{words.percent(first.won)} ({words.interval(first.won)})",
             f"{words.ratio(first.slowdown[1])} ({words.ratio(slow) if math.isfinite(slow) else 'not reached'})",
             following, words.percent(first.solved), f"{widest.name} {words.percent(widest.solved)}"]
        )  # fmt: skip
        second = f", and {others[0].name} on {words.percent(others[0].won)}" if others else ""
        task = f"{start[1]} rad over {start[0]} nutations"
        more = f", and {widest.name} on {words.percent(widest.solved)}" if behind(first, widest) else ""
        said = f"{first.name} meets {task} on {words.percent(first.solved)} of all tops{more}"
        met.append((first.solved.value, said))
        won = f"{first.name} wins on {words.percent(first.won)} of the tops that a variant solves{second}"
        won_by.append((first.won.value, f"{task}: {won}"))
    (name, count), *_ = [*ahead.most_common(), ("none", 0)]
    lines = "in every line" if count == len(rows) else f"in {count} of the {len(rows)} lines"
    drawn = " and ".join(words.span(data, horizon) for horizon in verdicts.horizons(data))
    first_choice = (
        f"Begin with {name}. On more tops than any other variant it reaches a given error of the axis at the least "
        f"cost, {lines} of the table."
    )
    closest = (
        f"The closest contest is at {min(won_by)[1]}. A variant wins if every other costs at least "
        f"{TIE:g} times as much."
        if won_by
        else ""
    )
    hardest = (
        f"The hardest line of the table: {min(met)[1]}. taylor-longdouble and taylor-quad, which are slower and more "
        "precise, take no part in the table."
        if met
        else ""
    )
    measured = (
        f"Measured on {drawn}, drawn at random. A variant is a method in one chart. Its cost is force evaluations, "
        "interpolated between the last setting that misses the error and the first that meets it, times the measured "
        "price of one. No run of the tops was timed."
    )
    priced = (
        "The price of a force evaluation is that of the bare compiled loop: the slope of the time between a short and "
        "a long run, so that the call has no part in it. Where the order follows the tolerance, it is that at the "
        "tolerance which meets the error."
    )
    shares = (
        "Shares have two denominators. A variant meets the error on a share of all tops whose nutation is wider than "
        "it. It wins on a share of those that some variant solves, which are fewer."
    )
    yours = "For your own scene and accuracy: symtop recommend SCENE --accuracy 1e-6."
    said = [
        first_choice, closest, unmet_sentence(data), hardest, words.strata_sentence(data), words.silent_sentence(data),
        words.guard_sentence(data), measured, priced, shares, yours,
    ]  # fmt: skip
    table = Table("Wins on random tops", HEADER, rows)
    return Opening("Which integrator should I use, whatever my top?", list(filter(None, said)), table, EXPLAINED)
