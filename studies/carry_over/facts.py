"""Facts and tables of the study."""

import math
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import xarray as xr
from symtop_studies.cost.tops import FIRST

from symtop.methods.framework.registry import NEEDS, integrator
from symtop.report.formats import at_most, code, duration, listed, number, percent

from . import comparison as by
from .bodies import ASKED, CHAOTIC, FAMILIES, FREE, SYMMETRIC
from .comparison import ANY, LEVEL, MOST_OF, NO, OTHERS, SEVERAL, YES, label
from .limits import LEVELS, MOST
from .measures import CHECKED

SHOWN = ("0.1", "0.3", CHAOTIC, FREE)  # families of the short table
NEEDLE = "needle"  # a stratum of free bodies, for which the natural period says nothing of the spin
STRATA = ("regular", CHAOTIC)
IN_PART = (  # facts that are missing if only some methods were run; below, those of each family
    "price", "price_high", "growth_1_judged", "growth_3_judged", "lost_0", "lost_3", "engines", "engine_steps", "grid",
)  # fmt: skip
OF_FAMILY_IN_PART = (
    "limit_{}_low", "limit_{}_least", "limit_{}_of", "order_{}_seen", "order_{}_top", "order_{}_declared",
    "long_tau_{}", "long_of_{}",
)  # fmt: skip
FIRST_TRIED = ("dop853-compiled-fixed", "tsit5-fixed", "vern9-fixed")  # recommended first, with f(t, y) alone


def words(family: str) -> str:
    """A family in a table."""
    return family if family in (CHAOTIC, FREE) else f"epsilon {family}"


def decades(target: float) -> int:
    """The 6 of 1e-6."""
    return round(-math.log10(target))


def worst_tau(data: xr.DataTree, family: str) -> by.Interval:
    """The least tau over all targets in the short runs, with the least ends of its interval (`least`)."""
    return least([by.tau(data, family, target, span="short") for target in ASKED])


def long_tau(data: xr.DataTree, family: str) -> tuple[float, int]:
    """The least tau over all targets in the long runs, and the number of bodies that it is computed from."""
    taus = {target: by.tau(data, family, target, span="long").value for target in ASKED}
    target = min(ASKED, key=lambda target: float(np.nan_to_num(taus[target], nan=math.inf)))
    return taus[target], by.judged_bodies(by.costs(data, family, target, span="long")).size


def least(intervals: list[by.Interval]) -> by.Interval:
    """The least value, low end and high end of all, each by itself, as which interval is the lowest may be noise."""
    known = [interval for interval in intervals if not math.isnan(interval.value)]
    return by.Interval(*(min(ends) for ends in zip(*known, strict=True))) if known else intervals[0]


def tau_words(tau: by.Interval) -> str:
    """Tau and its interval in a table."""
    return f"tau {number(tau.value, 2)} [{number(tau.low, 2)}, {number(tau.high, 2)}]"


def worst_winner(data: xr.DataTree, family: str) -> by.Interval:
    """Cost of methods within `LEVEL` of the winner on tops, over the least on each body: the most of all targets."""
    ratios = [by.transferred(data, family, target, best=name)
            for target in ASKED for name in by.cheapest(data, SYMMETRIC, target)]  # fmt: skip
    return max((ratio for ratio in ratios if not math.isnan(ratio.value)), key=lambda ratio: ratio.value,
               default=by.Interval(*(math.nan,) * 3))  # fmt: skip


class PooledFactors(NamedTuple):
    """Factors of all methods and targets: a summary of those within the budget, and how many exceed it."""

    middle: float  # median of those within the budget
    most: float  # the `MOST_OF` quantile of those within the budget
    beyond: int
    asked: int

    @property
    def words(self) -> str:
        """In a table."""
        within = f"median {number(self.middle, 3)}, {percent(MOST_OF)} below {number(self.most, 3)}"
        beyond = f"{self.beyond} of {self.asked} cases over budget"
        return ", ".join([within] * (self.beyond < self.asked) + [beyond] * (self.beyond > 0))

    @property
    def verdict(self) -> str:
        """The verdict on the upper end; "in part" at best where so many exceed the budget that this is not known."""
        word = by.factor_verdict(self.most)
        return by.worst((word, by.PARTLY)) if self.beyond > (1.0 - MOST_OF) * self.asked else word


def pooled(groups: list[dict[str, float]]) -> PooledFactors:
    """Factors of all methods and targets together."""
    values = np.array([value for factors in groups for value in factors.values()])
    finite = values[np.isfinite(values)]
    ends = (float(np.median(finite)), float(np.quantile(finite, MOST_OF))) if finite.size else (math.nan, math.nan)
    return PooledFactors(*ends, values.size - finite.size, values.size)


def steps(data: xr.DataTree, family: str, span: str = "short") -> PooledFactors:
    """Safe steps over those of epsilon = 0."""
    return pooled([by.step_factors(data, family, target, span) for target in ASKED])


def own_steps(data: xr.DataTree, family: str, without: str = "") -> PooledFactors:
    """Safe steps over those of the top's own charts; `without` a stratum of free bodies."""
    return pooled([by.own_factors(data, family, target, without) for target in ASKED])


def first_steps(data: xr.DataTree, family: str) -> list[float]:
    """`own_steps` of the methods `FIRST_TRIED` at each target they reach on tops; no needles, inf beyond the budget.

    The methods are fixed, because which is the cheapest at a target depends on the noise of prices.
    """
    return [factor for target in ASKED for name, factor in by.own_factors(data, family, target, NEEDLE).items()
            if label(name) in FIRST_TRIED]  # fmt: skip


def most_within(values: list[float]) -> float:
    """The largest of the finite values."""
    return max(filter(math.isfinite, values), default=math.nan)


def silent_share(data: xr.DataTree, family: str) -> float:
    """Share of wrong runs that keep energy and momenta, the mean over methods."""
    shares = by.silent_shares(data, family)
    return float(np.nanmean(shares)) if np.isfinite(shares).any() else math.nan


def silent_orders(data: xr.DataTree, family: str) -> tuple[float, float, float]:
    """These shares by order of the methods: the least and the most of order 2, and the most from order 4 on."""
    shares = by.silent_shares(data, family)
    orders = np.array([integrator(name).order or 0 for name in by.fixed_steps(data)])
    two, four = shares[orders == 2], shares[orders >= 4]
    if not np.isfinite(two).any() or not np.isfinite(four).any():
        return (math.nan,) * 3
    return float(np.nanmin(two)), float(np.nanmax(two)), float(np.nanmax(four))


def over(share: float, before: float) -> float:
    """The ratio of a share to that of tops; if that is 0, 1 + share / `LEAST`."""
    return share / before if before else 1.0 + share / by.LEAST


def silent_words(data: xr.DataTree, family: str) -> str:
    """Shares of wrong runs that keep energy and momenta, in a table."""
    mean, tops = (percent(silent_share(data, kind), 1) for kind in (family, SYMMETRIC))
    low, high, four = silent_orders(data, family)
    span = f"{100.0 * low:.0f} to {percent(high)}"
    return f"{mean} of runs, {tops} of tops' (order 2: {span}, from order 4 on at most {percent(four, 1)})"


def exponent_gaps(data: xr.DataTree, family: str) -> dict[str, float]:
    """By method and quantity the difference of an exponent of growth from that at epsilon = 0, where both are known."""
    exponents = by.exponents(data)
    gaps = {f"{name}, {quantity}": abs(value - exponents[name, SYMMETRIC, quantity])
            for (name, kind, quantity), value in exponents.items() if kind == family}  # fmt: skip
    return {name: gap for name, gap in gaps.items() if not math.isnan(gap)}


def exponent_gap(data: xr.DataTree, family: str) -> tuple[float, str]:
    """The largest difference of an exponent of growth from that at epsilon = 0, and of which method."""
    return max(((gap, name) for name, gap in exponent_gaps(data, family).items()), default=(math.nan, ""))


def exponents_within(data: xr.DataTree, family: str) -> tuple[int, int]:
    """How many exponents of growth are within `EXPONENT` of those at epsilon = 0, and of how many."""
    gaps = exponent_gaps(data, family).values()
    return sum(gap <= by.EXPONENT for gap in gaps), len(gaps)


def order_gap(data: xr.DataTree, family: str, claimed: bool = False) -> tuple[float, str]:
    """The largest amount by which a measured order is below that at epsilon = 0, and the method.

    With `claimed`, below the declared order, or below the one at epsilon = 0 where that is lower.
    """
    gaps = [(min(base, (integrator(name).order or math.inf) if claimed else math.inf) - order, name)
            for name, kind, order, base in by.orders(data) if kind == family]  # fmt: skip
    return max((gap for gap in gaps if not math.isnan(gap[0])), default=(math.nan, ""))


def growth_cell(data: xr.DataTree, family: str) -> tuple[str, str]:
    """Exponents of growth against those of tops: how many agree within `EXPONENT`, and the largest difference."""
    (within, known), gap = exponents_within(data, family), exponent_gap(data, family)[0]
    verdict = YES if within >= MOST_OF * known else NO
    return f"{within} of {known} exponents within {by.EXPONENT}, all within {at_most(gap)}", verdict


def limit_cell(data: xr.DataTree, family: str) -> tuple[str, str]:
    """Linear limits over those at epsilon = 0: the median and the 5 % quantile."""
    low, middle = limit_ends(data, family)
    return f"{number(middle, 3)}, down to {number(low, 2)} times", by.factor_verdict(min(low, 1.0))


def limit_ends(data: xr.DataTree, family: str) -> tuple[float, float]:
    """The 5 % quantile of the factors of linear limits, and their median."""
    ratio = by.limit_factors(data, family)
    return tuple(np.nanquantile(ratio, (1.0 - MOST_OF, 0.5)).tolist()) if ratio.size else (math.nan, math.nan)


def resonance_cell(data: xr.DataTree, family: str) -> tuple[str, str]:
    """Shares of steps at which a tilt grows."""
    share, before = (by.resonant(data, name) for name in (family, SYMMETRIC))
    ratio = max(share, by.LEAST) / max(before, by.LEAST)
    return f"{percent(share, 1)} of steps, {percent(before, 1)} of tops", by.factor_verdict(ratio, SEVERAL)


def engine_cell(data: xr.DataTree, family: str) -> tuple[str, str]:
    """Tau of engines' maps, the lower of both steps, and the bodies lost in the first period with the longer step."""
    if "engines" not in data.children:
        return "nan", NO
    places = range(len(LEVELS))
    taus = [by.engine_tau(data, family, place) for place in places]
    lost = [(by.lost(data, family, place), by.lost(data, SYMMETRIC, place)) for place in places]
    verdicts = [
        *map(by.ranking_verdict, taus),
        *(by.factor_verdict(over(share, before), SEVERAL) for share, before in lost),
    ]
    shares = f"{percent(lost[0][0], 0)}, {percent(lost[0][1], 0)} of tops"
    return f"{tau_words(min(taus, key=lambda tau: tau.value))}; lost at once {shares}", by.worst(verdicts)


def cells(data: xr.DataTree, family: str) -> dict[str, tuple[str, str]]:
    """By row of the table the number of a family and its verdict; no number where nothing was measured."""
    tau, best = worst_tau(data, family), worst_winner(data, family)
    ratios, own_ratios = steps(data, family), own_steps(data, family)
    share, before = silent_share(data, family), silent_share(data, SYMMETRIC)
    order, first = max(order_gap(data, family, claimed=True)[0], 0.0), first_steps(data, family)
    lost = f", {first.count(math.inf)} of {len(first)} cases over budget" * (math.inf in first)
    needles = f"; without needles {own_steps(data, family, NEEDLE).words}" if family == FREE else ""
    own_tau = least([by.own_tau(data, family, target) for target in ASKED])
    return {
        "ranking": (tau_words(tau), by.ranking_verdict(tau)),
        "own ranking": (f"tau {number(own_tau.value, 2)}", by.ranking_verdict(own_tau)),
        "winner": (f"cost up to {at_most(best.value, 3)} times the best", by.factor_verdict(best.value)),
        "steps": (ratios.words, ratios.verdict), "own": (own_ratios.words + needles, own_ratios.verdict),
        "first": (f"up to {at_most(most_within(first), 3)} times{lost}" + ", without needles" * (family == FREE),
                  by.factor_verdict(max(first, default=math.nan))),
        "silent": (silent_words(data, family), by.factor_verdict(over(share, before), SEVERAL)),
        "growth": growth_cell(data, family),
        "order": (f"below the declared one by at most {at_most(order)}, limit {by.LOWER}",
                  YES if order <= by.LOWER else NO),
        "limit": limit_cell(data, family), "resonances": resonance_cell(data, family),
        "engines": engine_cell(data, family),
    }  # fmt: skip


ANSWER = "what holds for tops"  # the first column
LINES = {
    "ranking": "ranking by cost, kernels for any body", "own ranking": "ranking by times of the top's own kernels",
    "own": "safe steps, over those of the top's own kernels", "silent": "wrong, energy and momenta kept",
    "winner": "the cheapest kernels for any body", "growth": "growth of errors with time",
    "first": "safe steps of three methods with f(t, y)", "steps": "safe steps, over those of the same kernels on a top",
    "order": "order of a method",
    "limit": "linear limit of the step", "resonances": "steps that resonate below it",
    "engines": "ranking of engines' maps",
}  # fmt: skip


def carry(data: xr.DataTree) -> pd.DataFrame:
    """The main table: a row for each verdict, a column for each kind of body, with number and verdict in a cell."""
    by_family = {family: cells(data, family) for family in SHOWN}
    rows = [{ANSWER: text} | {words(family): sentence(*by_family[family][line]) for family in SHOWN}
            for line, text in LINES.items()]  # fmt: skip
    prices = np.array([*by.price_factors(data).values()])
    if prices.size:
        times = f"{number(float(np.median(prices)), 3)} times, {number(prices.min(), 2)} to {number(prices.max(), 2)}"
        verdict = by.factor_verdict(float(prices.max()))
        rows.append({ANSWER: "time of an evaluation", **dict.fromkeys(map(words, SHOWN), sentence(times, verdict))})
    return pd.DataFrame(rows)


def short(data: xr.DataTree) -> pd.DataFrame:
    """The table of the front page: ranking, steps, and wrong runs that keep energy and momenta."""
    columns: dict[str, list[str]] = {ANSWER: ["ranking by cost", "safe steps", "wrong, energy and momenta kept"]}
    for family in ("0.3", FREE):
        tau, ratios = worst_tau(data, family), own_steps(data, family)
        share, before = (silent_share(data, kind) for kind in (family, SYMMETRIC))
        times = f"median {number(ratios.middle, 3)} times, {ratios.beyond} of {ratios.asked} cases over budget"
        columns[words(family)] = [
            sentence(f"tau {number(tau.value, 2)}", by.ranking_verdict(tau)), sentence(times, ratios.verdict),
            sentence(f"{percent(share, 1)} of runs, {percent(before, 1)} on tops",
                     by.factor_verdict(over(share, before), SEVERAL)),
        ]  # fmt: skip
    return pd.DataFrame(columns)


def sentence(numbers: str, verdict: str) -> str:
    """A cell: the verdict first."""
    return "not measured" if "nan" in numbers else f"{verdict}: {numbers}"


def facts(data: xr.DataTree) -> dict[str, Any]:
    """Counts, taus and their ceiling, cheap methods, factors of steps, silent wrong runs, growth, order, prices, truth.

    A number of a family has its `key` in its name; the page quotes some of them.
    """
    about = data["bodies"].to_dataset().isel(variant=0).sel(scene="short")
    values: dict[str, Any] = dict.fromkeys(IN_PART) | {
        "bodies": data["short"].sizes["member"], "methods": data["short"].sizes["variant"],
        "long_bodies": data["long"].sizes["member"] if "long" in data.children else None,
        "long_methods": data["long"].sizes["variant"] if "long" in data.children else None,
        "long_judged_3": float(data["bodies"]["judged"].isel(variant=0).sel(scene="long", family="0.3")),
        "same": by.SAME, "part": by.PART, "level": LEVEL, "double": by.DOUBLE, "several": SEVERAL, "steps": by.STEPS,
        "lower": by.LOWER, "least": by.LEAST,
        "off_bound": float(about["off_bound"].max()),
        "truth_bound": float(np.nanmedian(about["truth_bound"].values[: len(FAMILIES) - 1])),
        "judged_chaotic": float(about["judged"].sel(family=CHAOTIC)),
        "ceiling_3": by.ceiling(data, 1e-3).value, "ceiling_6": by.ceiling(data, 1e-6).value,
    }  # fmt: skip
    for family in ("0.1", "0.3"):
        growth = about["growth"].sel(family=family).dropna("member").values
        values[f"chaos_{key(family)}"] = float((growth > by.CHAOS).mean()) if growth.size else None
    known = {label(str(name)) for name in data["short"]["variant"].values}
    names = [code(name) for name in FIRST_TRIED if name in known]
    values["first_tried"] = listed(names) if names else None
    for family in OTHERS:
        values |= _family_facts(data, family)
    values["silent_0"] = silent_share(data, SYMMETRIC)
    prices = np.array([*by.price_factors(data).values()])
    if prices.size:
        values |= {"price": float(np.median(prices)), "price_high": prices.max()}
    taus = [by.own_tau(data, SYMMETRIC, target).value for target in ASKED]
    values |= {"own_tau_low": min(taus), "own_tau_high": max(taus)}
    heavy = [worst_tau(data, family).value for family in OTHERS if family not in (CHAOTIC, FREE)]
    values["heavy_tau"] = min(heavy, default=None)
    intervals = [by.tau(data, family, target) for family in OTHERS for target in ASKED]
    known = [tau for tau in intervals if math.isfinite(tau.value) and math.isfinite(tau.low)]
    values |= {"taus": len(known), "outside": sum(not tau.low <= tau.value <= tau.high for tau in known)}
    values["checked"] = CHECKED
    values |= dict(zip(("silent_3_low", "silent_3_most", "silent_3_four"), silent_orders(data, "0.3"), strict=True))
    if "growth" in data.children:
        judged = data["growth"]["judged"].isel(scene=0)
        values |= {f"growth_{key(family)}_judged": float(judged.sel(family=family).min()) for family in ("0.1", "0.3")}
    if "engines" in data.children:
        values |= {f"lost_{key(family)}": by.lost(data, family, 0) for family in (SYMMETRIC, "0.3")}
        values |= {"engines": data["engines"].sizes["variant"], "engine_steps": float(data["engines"]["steps"][0])}
    if "steady" in data.children:
        values["grid"] = float(data["steady"]["grid"].max())
    return {
        name: None if isinstance(value, float) and not math.isfinite(value) else value for name, value in values.items()
    }


def _family_facts(data: xr.DataTree, family: str) -> dict[str, Any]:
    place, order = key(family), order_gap(data, family)
    within, known = exponents_within(data, family)
    ratios = steps(data, family)
    values: dict[str, Any] = dict.fromkeys(name.format(place) for name in OF_FAMILY_IN_PART) | {
        f"tau_{place}": worst_tau(data, family).value, f"steps_{place}_high": ratios.most,
        f"steps_{place}_beyond": ratios.beyond, f"steps_{place}_asked": ratios.asked,
        f"first_{place}": most_within(first_steps(data, family)), f"silent_{place}": silent_share(data, family),
        f"growth_{place}_of": exponent_gap(data, family)[1] or None,
        f"growth_{place}_within": within, f"growth_{place}_told": known,
        f"order_{place}": order[0], f"order_{place}_of": order[1] or None,
    }  # fmt: skip
    ratio = by.limit_factors(data, family)
    if ratio.size:
        least = np.nanquantile(ratio, 1.0 - MOST_OF, axis=1)
        values[f"limit_{place}_low"], values[f"limit_{place}_least"] = limit_ends(data, family)[0], float(least.min())
        values[f"limit_{place}_of"] = label(str(data["steady"]["variant"].values[int(np.argmin(least))]))
    for name, kind, measured, base in by.orders(data) if order[1] else ():
        if (name, kind) == (order[1], family):
            values |= {f"order_{place}_seen": measured, f"order_{place}_top": base}
            values[f"order_{place}_declared"] = integrator(name).order
    if "long" in data.children:
        values[f"long_tau_{place}"], values[f"long_of_{place}"] = long_tau(data, family)
    return values


def key(family: str) -> str:
    """A family as a part of the name of a fact."""
    return family.replace("0.", "")


# ---- tables ----------------------------------------------------------------------------------------------------------


def tables(data: xr.DataTree) -> dict[str, pd.DataFrame]:
    """The answer; taus; winners by class; safe steps by method; silent wrong runs by stratum; growth; order; limits."""
    return {
        "carry": carry(data), "short": short(data), "rankings": rankings(data), "winners": winners(data),
        "steps": step_table(data), "silent": silent_table(data), "growth": growth_table(data),
        "order": order_table(data), "limits": limit_table(data),
    }  # fmt: skip


def rankings(data: xr.DataTree) -> pd.DataFrame:
    """Tau by family, target and quantity, with the ceiling (`comparison.ceiling`), also for the long runs."""
    rows = []
    for span in [span for span in by.SPANS if span in data.children]:
        for quantity in ("axis", "attitude"):
            for target in ASKED:
                top = by.ceiling(data, target, quantity, span)
                for family in OTHERS:
                    tau = by.tau(data, family, target, quantity, span)
                    count = by.judged_bodies(by.costs(data, family, target, quantity, span)).size
                    rows.append([span, quantity, target, words(family), count, *tau, top.value, top.low,
                                 by.own_tau(data, family, target).value if (span, quantity) == ("short", "axis")
                                 else math.nan])  # fmt: skip
    header = ["runs", "quantity", "error", "bodies", "asked", "tau", "low", "high", "ceiling", "ceiling low",
              "tau with the top's own kernels"]  # fmt: skip
    return pd.DataFrame(rows, columns=header)


def winners(data: xr.DataTree) -> pd.DataFrame:
    """By class, target and family the cheapest in the median, the safe choice, and the cost of the winner on tops."""
    rows = []
    for needs in by.classes(data):
        for target in ASKED:
            for family in FAMILIES:
                best, ratio = by.winner(data, family, target, needs), by.transferred(data, family, target, needs)
                choices = [choice for name, choice in by.safest(data, family, target).items()
                           if needs in (integrator(name).needs, ANY) and np.isfinite(choice.seconds)]  # fmt: skip
                safest = min(choices, key=lambda choice: choice.seconds, default=None)
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
        before, ratios = by.safest(data, SYMMETRIC, target), by.own_factors(data, SYMMETRIC, target)
        by_family = {family: by.step_factors(data, family, target) for family in OTHERS}
        rows += [
            [label(name), target, before[name].setting, ratios.get(name, math.nan),
             *(by_family[family][name] for family in OTHERS)]
            for name in by.fixed_steps(data) if np.isfinite(before[name].setting)
        ]  # fmt: skip
    header = ["method", "error", "steps at epsilon 0", "over those in the top's chart", *map(words, OTHERS)]
    return pd.DataFrame(rows, columns=header).replace(math.inf, math.nan)


def silent_table(data: xr.DataTree) -> pd.DataFrame:
    """Shares of wrong runs that keep energy and momenta, by method, family and stratum."""
    about = data["bodies"].to_dataset().isel(variant=0).sel(scene="short")
    rows = []
    for family in FAMILIES:
        names = sorted(set(about["stratum"].sel(family=FREE).values.tolist()) - {""}) if family == FREE else STRATA
        for stratum in ["", *names]:
            shares = by.silent_shares(data, family, stratum)
            if np.isfinite(shares).any():
                line = {"bodies": words(family), "stratum": stratum or "all", "mean": float(np.nanmean(shares))}
                rows.append(line | dict(zip(map(label, by.fixed_steps(data)), shares, strict=True)))
    return pd.DataFrame(rows)


def growth_table(data: xr.DataTree) -> pd.DataFrame:
    """Exponents of growth of attitude and energy errors with time, by method and family."""
    rows: dict[tuple[str, str], dict[str, Any]] = {}
    for (name, family, quantity), value in by.exponents(data).items():
        rows.setdefault((name, quantity), {"method": name, "error of": quantity})[words(family)] = value
    return pd.DataFrame([*rows.values()])


def order_table(data: xr.DataTree) -> pd.DataFrame:
    """The measured order, by method and family, with the declared one."""
    rows: dict[str, dict[str, Any]] = {}
    for name, family, value, first in by.orders(data):
        line = rows.setdefault(name, {"method": name, "declared": integrator(name).order, words(SYMMETRIC): first})
        line[words(family)] = value
    return pd.DataFrame([*rows.values()])


def limit_table(data: xr.DataTree) -> pd.DataFrame:
    """Linear limits and resonances by method, errors and lost bodies by engine's map, each by family."""
    rows: list[dict[str, Any]] = []
    measures = {
        "linear limit, h omega": lambda values: np.nanmedian(np.nan_to_num(values, nan=MOST), axis=1),
        "share of steps that resonate": lambda values: np.nanmean(values, axis=1),
    }
    for (title, average), name in zip(measures.items(), ("limit", "grown"), strict=True):
        tables = {family: by.steady(data, name, family) for family in FAMILIES}
        names = map(label, map(str, data["steady"]["variant"].values)) if "steady" in data.children else []
        columns = {words(family): average(values) for family, values in tables.items() if values.size}
        rows += [{"measured": title, "method": method} | {name: column[k] for name, column in columns.items()}
                 for k, method in enumerate(names)]  # fmt: skip
    for place, level in enumerate(LEVELS) if "engines" in data.children else ():
        for name, title in (("error", "median error of the axis, rad"), ("lost", "share lost in the first period")):
            tables = {family: by.engine_errors(data, family, place, name) for family in FAMILIES}
            for k, method in enumerate(tables[SYMMETRIC].names):
                line = {"measured": f"{title}, {number(FIRST * 2**level, 2)} steps a period", "method": label(method)}
                middle = np.nanmedian if name == "error" else np.nanmean
                rows.append(line | {words(family): float(middle(costs.values[k])) for family, costs in tables.items()})
    return pd.DataFrame(rows)
