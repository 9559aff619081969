"""Facts and tables of the study."""

import math
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from symtop.methods.framework.registry import NEEDS, integrator
from symtop.report.formats import duration, number, percent

from . import comparison as by
from .bodies import ASKED, CHAOTIC, FAMILIES, FREE, SYMMETRIC
from .comparison import ANY, FACTOR, LEVEL, MOST_OF, NO, OTHERS, PARTLY, SEVERAL, YES, label

SHOWN = ("0.1", "0.3", CHAOTIC, FREE)  # families of the short table
NEEDLE = "needle"  # a stratum of free bodies whose spin the natural period does not tell
STRATA = ("regular", CHAOTIC)


def words(family: str) -> str:
    """A family in a table."""
    return family if family in (CHAOTIC, FREE) else f"epsilon {family}"


def decades(target: float) -> int:
    """The 6 of 1e-6."""
    return round(-math.log10(target))


def worst_tau(data: xr.DataTree, family: str, span: str = "short") -> by.Interval:
    """Tau of the target with the least."""
    each = [by.tau(data, family, target, span=span) for target in ASKED]
    return min((one for one in each if not math.isnan(one.value)), key=lambda one: one.value, default=each[0])


def worst_winner(data: xr.DataTree, family: str) -> by.Interval:
    """The cost of the winner of tops over the best of each body, at the target where that is the most."""
    each = [by.transferred(data, family, target) for target in ASKED]
    return max((one for one in each if not math.isnan(one.value)), key=lambda one: one.value, default=each[0])


def pooled(each: list[dict[str, float]]) -> tuple[float, float]:
    """The median of factors of all methods and targets, and what `MOST_OF` of them stay below."""
    values = np.array([value for one in each for value in one.values()])
    if not values.size:
        return math.nan, math.nan
    return float(np.median(values)), float(np.quantile(values, MOST_OF))


def steps(data: xr.DataTree, family: str, span: str = "short") -> tuple[float, float]:
    """Safe steps over those of epsilon = 0: median and upper end."""
    return pooled([by.step_factors(data, family, target, span) for target in ASKED])


def own_steps(data: xr.DataTree, family: str, without: str = "") -> tuple[float, float]:
    """Safe steps over those of the top's own charts: median and upper end; `without` a stratum of free bodies."""
    return pooled([by.own_factors(data, family, target, without) for target in ASKED])


def first_steps(data: xr.DataTree, family: str) -> float:
    """The same of the cheapest methods that need f(t, y) alone, the most of the targets; without needles."""
    each = [(by.winner(data, SYMMETRIC, target, "derivative"), by.own_factors(data, family, target, NEEDLE))
            for target in ASKED]  # fmt: skip
    return max((found[name] for name, found in each if name in found), default=math.nan)


def silent_share(data: xr.DataTree, family: str, chosen: str = "") -> float:
    """Mean share over methods of runs that are wrong without a sign."""
    shares = by.silent_shares(data, family, chosen)
    return float(np.nanmean(shares)) if np.isfinite(shares).any() else math.nan


def exponent_gap(data: xr.DataTree, family: str) -> tuple[float, str]:
    """The largest difference of an exponent of growth from that at epsilon = 0, and of which method."""
    found = by.exponents(data)
    gaps = {f"{name}, {quantity}": abs(value - found[name, SYMMETRIC, quantity])
            for (name, one, quantity), value in found.items() if one == family}  # fmt: skip
    known = {name: gap for name, gap in gaps.items() if not math.isnan(gap)}
    return max(((gap, name) for name, gap in known.items()), default=(math.nan, ""))


def exponents_within(data: xr.DataTree, family: str) -> tuple[int, int]:
    """How many exponents of growth are within `EXPONENT` of those at epsilon = 0, and of how many."""
    found = by.exponents(data)
    gaps = [abs(value - found[name, SYMMETRIC, quantity])
            for (name, one, quantity), value in found.items() if one == family]  # fmt: skip
    return sum(gap <= by.EXPONENT for gap in gaps), sum(not math.isnan(gap) for gap in gaps)


def order_gap(data: xr.DataTree, family: str) -> tuple[float, str]:
    """By how much the order seen is lower than at epsilon = 0 at most, and of which method."""
    gaps = [(first - one, name) for name, kind, one, first in by.orders(data) if kind == family]
    return max((gap for gap in gaps if not math.isnan(gap[0])), default=(math.nan, ""))


def cells(data: xr.DataTree, family: str) -> dict[str, tuple[str, str]]:
    """By line of the table the number of a family and its verdict; no number where nothing was measured."""
    tau, best, (middle, most) = worst_tau(data, family), worst_winner(data, family), steps(data, family)
    own_middle, own_most = own_steps(data, family)
    share, before = silent_share(data, family), silent_share(data, SYMMETRIC)
    gap, order, first = exponent_gap(data, family)[0], order_gap(data, family)[0], first_steps(data, family)
    within, told = exponents_within(data, family)
    round_ones = own_steps(data, family, NEEDLE)
    but = f"; without needles {number(round_ones[0], 3)}, up to {number(round_ones[1], 3)}" if family == FREE else ""
    ratio = share / before if before > 0.0 else math.nan
    return {
        "ranking": (f"tau {number(tau.value, 2)} [{number(tau.low, 2)}, {number(tau.high, 2)}]",
                    by.ranking_verdict(tau)),
        "winner": (f"{number(best.value, 3)} times the best", by.factor_verdict(best.value)),
        "steps": (f"{number(middle, 3)}, up to {number(most, 3)} times", by.factor_verdict(most)),
        "own": (f"{number(own_middle, 3)}, up to {number(own_most, 3)} times{but}", by.factor_verdict(own_most)),
        "first": (f"up to {number(first, 3)} times{', without needles' if family == FREE else ''}",
                  by.factor_verdict(first)),
        "silent": (f"{percent(share, 1)}, {percent(before, 1)} of tops", by.factor_verdict(ratio, SEVERAL)),
        "growth": (f"{within} of {told} exponents within {by.EXPONENT}, all within {number(gap, 2)}",
                   YES if gap <= by.EXPONENT else NO),
        "order": (f"lower by at most {number(max(order, 0.0), 2)}", YES if order <= by.LOWER else NO),
    }  # fmt: skip


LINES = {
    "ranking": "ranking of methods by cost", "winner": "the cheapest method, its cost",
    "steps": "safe steps a period, to those of a top as a body", "own": "safe steps, to those in the top's own charts",
    "first": "the same of the cheapest with f(t, y)",
    "silent": "wrong without a sign", "growth": "growth of errors with time", "order": "order of a method",
}  # fmt: skip


def carry(data: xr.DataTree) -> pd.DataFrame:
    """The answer: a line for each thing, a column for each kind of body, number and verdict."""
    each = {family: cells(data, family) for family in SHOWN}
    rows = [{"of tops": text} | {words(family): sentence(*each[family][line]) for family in SHOWN}
            for line, text in LINES.items()]  # fmt: skip
    prices = np.array([*by.price_factors(data).values()])
    if prices.size:
        times = f"{number(float(np.median(prices)), 3)} times, {number(prices.min(), 2)} to {number(prices.max(), 2)}"
        verdict = by.factor_verdict(float(prices.max()))
        rows.append({"of tops": "time of an evaluation", **dict.fromkeys(map(words, SHOWN), sentence(times, verdict))})
    return pd.DataFrame(rows)


def sentence(told: str, verdict: str) -> str:
    """A cell: the verdict first."""
    return "not measured" if "nan" in told else f"{verdict}: {told}"


def facts(data: xr.DataTree) -> dict[str, Any]:
    """Counts, taus and their ceiling, winners, factors of steps, silent wrong runs, growth, order, prices, truth."""
    about = data["bodies"].to_dataset().isel(variant=0).sel(scene="short")
    grown = about["growth"].values
    named: dict[str, Any] = {
        "bodies": data["short"].sizes["member"], "methods": data["short"].sizes["variant"],
        "long_bodies": data["long"].sizes["member"] if "long" in data.children else None,
        "long_methods": data["long"].sizes["variant"] if "long" in data.children else None,
        "same": by.SAME, "part": by.PART, "level": LEVEL, "double": by.DOUBLE, "several": SEVERAL, "steps": by.STEPS,
        "off_bound": float(np.nanmax(about["off_bound"].values)),
        "truth_bound": float(np.nanmedian(about["truth_bound"].values[: len(FAMILIES) - 1])),
    }  # fmt: skip
    for row, family in enumerate(map(str, about["family"].values)):
        if np.isfinite(grown[row]).any():
            named[f"chaos_{key(family)}"] = float((grown[row] > by.CHAOS)[np.isfinite(grown[row])].mean())
        named[f"judged_{key(family)}"] = float(about["judged"].values[row])
    for target in ASKED:
        named[f"ceiling_{decades(target)}"], low, _ = by.ceiling(data, target)
        named[f"ceiling_{decades(target)}_low"] = low
        best = by.winner(data, SYMMETRIC, target)
        named[f"winner_{decades(target)}"] = best and label(best)
    for family in OTHERS:
        named |= _of_family(data, family)
    named["silent_0"] = silent_share(data, SYMMETRIC)
    prices = np.array([*by.price_factors(data).values()])
    if prices.size:
        named |= {"price": float(np.median(prices)), "price_low": prices.min(), "price_high": prices.max()}
    taus = [by.own_tau(data, SYMMETRIC, target).value for target in ASKED]
    named |= {"own_tau_low": min(taus), "own_tau_high": max(taus)}
    heavy = [family for family in OTHERS if family not in (CHAOTIC, FREE)]
    named["heavy_steps"] = max((steps(data, family)[1] for family in heavy), default=None)
    named["heavy_tau"] = min((worst_tau(data, family).value for family in heavy), default=None)
    named["verdicts"] = count(data)
    return {name: None if isinstance(value, float) and math.isnan(value) else value for name, value in named.items()}


def _of_family(data: xr.DataTree, family: str) -> dict[str, Any]:
    tau, best, place = worst_tau(data, family), worst_winner(data, family), key(family)
    gap, order = exponent_gap(data, family), order_gap(data, family)
    named: dict[str, Any] = {
        f"tau_{place}": tau.value, f"tau_{place}_low": tau.low, f"tau_{place}_high": tau.high,
        f"transfer_{place}": best.value, f"transfer_{place}_high": best.high,
        f"steps_{place}": steps(data, family)[0], f"steps_{place}_high": steps(data, family)[1],
        f"own_{place}_high": own_steps(data, family)[1], f"first_{place}": first_steps(data, family),
        f"silent_{place}": silent_share(data, family),
        f"growth_{place}": gap[0], f"growth_{place}_of": gap[1] or None,
        f"order_{place}": order[0], f"order_{place}_of": order[1] or None,
    }  # fmt: skip
    named |= dict(zip((f"growth_{place}_within", f"growth_{place}_told"), exponents_within(data, family), strict=True))
    if family == FREE:
        named |= dict(zip(("round_steps", "round_steps_high"), own_steps(data, family, NEEDLE), strict=True))
    for name, kind, seen, first in by.orders(data) if order[1] else ():
        if (name, kind) == (order[1], family):
            named |= {f"order_{place}_seen": seen, f"order_{place}_top": first}
            named[f"order_{place}_declared"] = integrator(name).order
    if "long" in data.children:
        named[f"long_tau_{place}"] = worst_tau(data, family, "long").value
        named[f"long_steps_{place}_high"] = steps(data, family, "long")[1]
    return named


def key(family: str) -> str:
    """A family as a part of the name of a fact."""
    return family.replace("0.", "")


def count(data: xr.DataTree) -> str:
    """How many cells of the table carry over, with a factor, in part and not."""
    told = [text.partition(":")[0] for row in carry(data).iloc[:, 1:].values for text in row]
    return ", ".join(f"{told.count(verdict)} {verdict}" for verdict in (YES, FACTOR, PARTLY, NO))


# ---- tables ----------------------------------------------------------------------------------------------------------


def tables(data: xr.DataTree) -> dict[str, pd.DataFrame]:
    """The answer; taus; winners by class; safe steps by method; silent wrong runs by stratum; growth; order."""
    return {
        "carry": carry(data), "rankings": rankings(data), "winners": winners(data), "steps": step_table(data),
        "silent": silent_table(data), "growth": growth_table(data), "order": order_table(data),
    }  # fmt: skip


def rankings(data: xr.DataTree) -> pd.DataFrame:
    """Tau by family, target and quantity, with the ceiling, and over the long runs."""
    rows = []
    for span in [one for one in by.SPANS if one in data.children]:
        for quantity in ("axis", "attitude"):
            for target in ASKED:
                top = by.ceiling(data, target, quantity, span)
                for family in OTHERS:
                    one = by.tau(data, family, target, quantity, span)
                    asked = by.there(by.costs(data, family, target, quantity, span)).size
                    rows.append([span, quantity, target, words(family), asked, *one, top.value, top.low,
                                 by.own_tau(data, family, target).value if (span, quantity) == ("short", "axis")
                                 else math.nan])  # fmt: skip
    header = ["runs", "quantity", "error", "bodies", "asked", "tau", "low", "high", "ceiling", "ceiling low",
              "tau with the top's own kernels"]  # fmt: skip
    return pd.DataFrame(rows, columns=header)


def winners(data: xr.DataTree) -> pd.DataFrame:
    """By class, target and family the cheapest in the median, the safe choice, and what the winner of tops costs."""
    rows = []
    for needs in by.classes(data):
        for target in ASKED:
            for family in FAMILIES:
                best, ratio = by.winner(data, family, target, needs), by.transferred(data, family, target, needs)
                choices = [one for name, one in by.safest(data, family, target).items()
                           if needs in (integrator(name).needs, ANY) and np.isfinite(one.seconds)]  # fmt: skip
                safest = min(choices, key=lambda one: one.seconds, default=None)
                rows.append([NEEDS.get(needs, needs), target, words(family), label(best) if best else "",
                             label(safest.name) if safest else "", safest.setting if safest else math.nan,
                             duration(safest.seconds) if safest else "", ratio.value, ratio.high])  # fmt: skip
    header = ["needs", "error", "bodies", "cheapest in the median", "safe", "setting", "time",
              "winner of tops over the best", "for 97.5 %"]  # fmt: skip
    return pd.DataFrame(rows, columns=header)


def step_table(data: xr.DataTree) -> pd.DataFrame:
    """Safe steps a natural period by method and target, and the factors of families."""
    rows = []
    for target in ASKED:
        before, own = by.safest(data, SYMMETRIC, target), by.own_factors(data, SYMMETRIC, target)
        each = {family: by.step_factors(data, family, target) for family in OTHERS}
        rows += [
            [label(name), target, before[name].setting, own.get(name, math.nan),
             *(each[family].get(name, math.nan) for family in OTHERS)]
            for name in by.fixed_steps(data) if np.isfinite(before[name].setting)
        ]  # fmt: skip
    header = ["method", "error", "steps at epsilon 0", "over those in the top's chart", *map(words, OTHERS)]
    return pd.DataFrame(rows, columns=header)


def silent_table(data: xr.DataTree) -> pd.DataFrame:
    """Shares of runs that are wrong without a sign, by method, family and stratum."""
    about = data["bodies"].to_dataset().isel(variant=0).sel(scene="short")
    rows = []
    for family in FAMILIES:
        names = sorted(set(about["stratum"].sel(family=FREE).values.tolist()) - {""}) if family == FREE else STRATA
        for chosen in ["", *names]:
            shares = by.silent_shares(data, family, chosen)
            if np.isfinite(shares).any():
                told = dict(zip(map(label, by.fixed_steps(data)), shares, strict=True))
                rows.append(
                    {"bodies": words(family), "stratum": chosen or "all", "mean": float(np.nanmean(shares))} | told
                )
    return pd.DataFrame(rows)


def growth_table(data: xr.DataTree) -> pd.DataFrame:
    """Exponents of growth of attitude and energy errors with time, by method and family."""
    rows: dict[tuple[str, str], dict[str, Any]] = {}
    for (name, family, quantity), value in by.exponents(data).items():
        rows.setdefault((name, quantity), {"method": name, "error of": quantity})[words(family)] = value
    return pd.DataFrame([*rows.values()])


def order_table(data: xr.DataTree) -> pd.DataFrame:
    """The order seen, by method and family, with the declared one."""
    rows: dict[str, dict[str, Any]] = {}
    for name, family, value, first in by.orders(data):
        line = rows.setdefault(name, {"method": name, "declared": integrator(name).order, words(SYMMETRIC): first})
        line[words(family)] = value
    return pd.DataFrame([*rows.values()])
