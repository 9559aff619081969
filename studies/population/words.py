"""What the population study says in sentences, all of it from its datasets."""

import math
from collections import Counter
from typing import NamedTuple

import numpy as np
import xarray as xr

from symtop.report.sentences import abridged, joined
from symtop.run.guard import EXPECTED

from . import verdicts
from .costs import TIE, Share
from .ladder import GUARDED_LEVELS, KEPT, WRONG
from .verdicts import ALL, Cell

UNIT = "alone"  # of the verdicts; tables have the others
QUANTITIES_ASKED = ("axis", "attitude", "energy")
FINE = 50.0  # steps a nutation that look like enough

LEFT_OUT = {  # methods, by the reason
    "the same maps in three coordinates, at two to three times the time": (
        "midpoint-unreduced",
        "trapezoidal-unreduced",
    ),
    "the same steps as taylor in slower arithmetic, which meets smaller errors": ("taylor-longdouble", "taylor-quad"),
    "a step of any size is the motion itself, so that no step is too coarse": ("exact-discrete",),
}

HOW_TO_READ = (
    "A variant is a method in one chart. The tops are drawn at random in six strata, or kinds: slow, fast, grazing a "
    "pole, near the separatrix, hanging and sleeping. On each top a variant runs from coarse settings to fine ones, "
    "and its cost for an error is that at which it begins to meet it for good. A cost in seconds is force evaluations "
    "times the measured price of one, alone or in a call for many tops. No run of the tops was timed: the price is "
    "the slope between a short and a long run, without the call, at the tolerance that meets the error where the "
    "order of a variant follows its tolerance. The slowdown of a variant on a top is its "
    "cost over the least of all variants there. A variant wins on a top if all others cost at least "
    f"{TIE:g} times as much. Shares have 95 % intervals (Wilson) for the draw of the tops; times that are measured "
    "again move a close contest by more. A winner is sure if its lead is three standard errors with the prices of "
    "either of two processes that timed them. The last table has the rules of the runs and what is left out."
)


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


def winner_words(data: xr.DataTree, cell: Cell, unit: str = UNIT, *, spoken: bool = False) -> str:
    """Who wins a cell, on what share of the tops that a variant solves, and who is next; empty where nobody does."""
    taken, won = verdicts.best(data, cell, unit)
    if won is None:
        return ""
    following = f", then {taken.names[won.next_variant]} on {percent(won.next_share)}" if won.next_share.count else ""
    sure = "" if won.sure else ", a lead that may be chance or noise of the times"
    first = f"{taken.names[won.row]} on {percent(won.share)} ({interval(won.share)})"
    return f"{first}{' of the tops that a variant solves' if spoken else ''}{following}{sure}"


def quantity_sentence(data: xr.DataTree, quantity: str) -> str:
    """Who is the cheapest on the most tops, in how many combinations of run length and error, and on what share."""
    shares: dict[str, list[Share]] = {}
    for cell in verdicts.cells(data, quantity, (ALL,)):
        taken, won = verdicts.best(data, cell, UNIT)
        if won is not None:
            shares.setdefault(taken.names[won.row], []).append(won.share)
    if not shares:
        return ""
    told = []
    for name, won in sorted(shares.items(), key=lambda one: -len(one[1])):
        ends = [percent(pick(won, key=lambda share: share.value)) for pick in (min, max)]
        told.append((name, len(won), " to ".join(dict.fromkeys(ends))))
    (first, most, share), *others = told
    rest = f" Otherwise it is {abridged([f'{name}, with {part}' for name, _, part in others])}." if others else ""
    return (
        f"For the {quantity}, {first} is the cheapest variant on the most tops in {most} of the "
        f"{sum(map(len, shares.values()))} combinations of run length and error that some variant reaches, with "
        f"{share} of the tops that a variant solves.{rest}"
    )


def strata_sentence(data: xr.DataTree) -> str:
    """How many variants win somewhere, and the strata whose winner is another than that of all tops."""
    owners: Counter[str] = Counter()
    others: dict[tuple[str, str], list[str]] = {}
    for target in verdicts.targets(data):
        taken, first = verdicts.best(data, Cell("short", "axis", target), UNIT)
        if first is None:
            continue
        overall = taken.names[first.row]
        for stratum in verdicts.strata(data):
            part, won = verdicts.best(data, Cell("short", "axis", target, stratum), UNIT)
            if won is not None:
                owners[part.names[won.row]] += 1
                if won.sure and part.names[won.row] != overall:
                    others.setdefault((part.names[won.row], stratum), []).append(f"{target:.0e}")
    total = sum(owners.values())
    most = joined([f"{name} {count}" for name, count in owners.most_common(4)])
    told = [f"{name} on {stratum} tops at {joined(errors)}" for (name, stratum), errors in others.items()]
    differ = (
        f"Beyond doubt some kinds have another winner than all tops: {joined(told)}."
        if others
        else "No kind of tops has, beyond doubt, another winner than all tops together."
    )
    return (
        f"{len(owners)} variants win the {total} pairs of a kind of top and an axis error over "
        f"{verdicts.nutations(data, 'short'):g} nutations: {most}. {differ}"
    )


class Hidden(NamedTuple):
    """Wrong runs that look healthy."""

    wrong: float  # runs
    everywhere: float  # share of all wrong runs that look healthy
    fine: float  # among variants with a fixed step, of at least `FINE` steps a nutation
    wrong_fine: float  # runs of these
    silent_fine: float  # of these, runs that look healthy
    kind: str  # of top with the most of them
    of_kind: float  # how many of them
    drawn: float  # share of this kind in all tops


def hidden(data: xr.DataTree) -> Hidden:
    """Wrong runs that nothing warns of, of all and among small steps."""
    each = [verdicts.health(data, name) for name in verdicts.judged_variants(data)]
    wrong, silent = sum(one.wrong.sum() for one in each), sum(one.silent.sum() for one in each)
    small = [one for one in each if one.fixed_step]
    missed = sum(one.wrong[one.setting >= FINE].sum() for one in small)
    kinds = verdicts.strata(data)
    by_kind = sum((one.by_kind[one.setting >= FINE].sum(axis=0) for one in small), start=np.zeros(len(kinds)))
    unseen, most = float(by_kind.sum()), int(np.argmax(by_kind))
    shares = float(silent / max(wrong, 1.0)), unseen / max(missed, 1.0)
    drawn = float((verdicts.stratum_of(data, "short") == most).mean())
    return Hidden(float(wrong), *shares, float(missed), unseen, kinds[most], float(by_kind[most]), drawn)


def hidden_by_steps(data: xr.DataTree) -> list[tuple[float, float, float]]:
    """Steps a nutation, wrong runs with so many, and those that nothing warns of; variants with a fixed step."""
    sums: dict[float, tuple[float, float]] = {}
    for one in (verdicts.health(data, name) for name in verdicts.judged_variants(data)):
        for step, wrong, silent in zip(one.setting, one.wrong, one.silent, strict=True) if one.fixed_step else ():
            before = sums.get(float(f"{step:.3g}"), (0.0, 0.0))
            sums[float(f"{step:.3g}")] = before[0] + float(wrong), before[1] + float(silent)
    return [(step, *sums[step]) for step in sorted(sums)]


def silent_sentence(data: xr.DataTree) -> str:
    """How many wrong runs nothing warns of, over all variants and among small steps."""
    share = hidden(data)
    kind = (
        f", {share.of_kind:,.0f} of them on {share.kind} tops, which are {share.drawn:.1%} of the tops"
        if share.silent_fine
        else ""
    )
    return (
        f"{share.everywhere:.0%} of the {share.wrong:,.0f} wrong runs give no sign of it: they end without an error "
        f"and keep energy and momenta to {KEPT:.0%}. Of those with at least {FINE:g} steps a nutation it is "
        f"{share.fine:.0%}, {share.silent_fine:,.0f} runs{kind}. Wrong is an axis that is off by more than {WRONG:g} "
        f"rad within {verdicts.nutations(data, 'short'):g} nutations."
    )


def asked_of(data: xr.DataTree, horizon: str) -> int:
    """How many tops the guard was asked about."""
    told = data[horizon].to_dataset()["foretold"].notnull()
    return int(told.any([name for name in told.dims if name != "guarded"]).sum())


def guard_sentence(data: xr.DataTree) -> str:
    """How often the guard warns over each horizon, of wrong runs and of right ones."""
    said = []
    for horizon in verdicts.horizons(data):
        hits, alarms = verdicts.caught(data, horizon)
        wrong, right = ("", "") if said else (" wrong runs", " right ones")
        said.append(
            f"over {verdicts.nutations(data, horizon):g} nutations ({asked_of(data, horizon)} tops) of {hits.count:,} "
            f"of {hits.total:,}{wrong} and {percent(alarms)} of {alarms.total:,}{right}"
        )
    whole = " and ".join(percent(verdicts.repeated(data, horizon)) for horizon in verdicts.horizons(data))
    return (
        f"The guard tries a method on a piece of a run before it. At the {GUARDED_LEVELS} coarsest settings of each "
        f"variant it warned {', '.join(said)}. Wrong is over {WRONG:g} rad off, right less than {EXPECTED:g} rad. Runs "
        f"that the piece covers whole are left out, {whole} of the wrong ones."
    )


def watched_sentence(data: xr.DataTree) -> str:
    """What a look at energy and momenta after the same runs finds."""
    hits, alarms = verdicts.caught(data, "short", "watched")
    return (
        f"Energy and momenta, looked at after the same runs over {verdicts.nutations(data, 'short'):g} nutations, find "
        f"{percent(hits)} of the wrong runs and suspect {percent(alarms)} of the right ones, if a change of "
        f"{KEPT:.0%} counts as a sign."
    )


def effort_sentence(data: xr.DataTree) -> str:
    """How much was run."""
    parts = [data[horizon] for horizon in verdicts.horizons(data)]
    made, evaluated = (sum(float(np.nansum(part[name].values)) for part in parts) for name in ("made", "evaluated"))
    variants = len({str(name) for part in parts for name in part["variant"].values})
    drawn = joined([span(data, horizon) for horizon in verdicts.horizons(data)])
    return f"{variants} variants made {made:,.0f} runs of {evaluated:.2g} force evaluations in all, on {drawn}."


def sentences(data: xr.DataTree) -> list[str]:
    """The winners by quantity, the strata, the silent failures, the guard and the effort."""
    first, *others = (quantity_sentence(data, name) for name in QUANTITIES_ASKED)
    said = [
        first, strata_sentence(data), silent_sentence(data), guard_sentence(data), watched_sentence(data), *others,
        effort_sentence(data),
    ]  # fmt: skip
    return [sentence for sentence in said if sentence]
