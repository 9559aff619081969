"""Bodies compared with symmetric tops: tau of the rankings, winners, steps, silent wrong runs, growth, order.

A cost is in seconds, evaluations x price + call. A method's median is over the bodies of a family whose reference can
judge the target; a target that is not reached costs infinity, and infinite costs tie. Families named by epsilon have
the same members, so that they are resampled together.
"""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from symtop_studies.cost.ladder import setting_of
from symtop_studies.cost.prices import prices
from symtop_studies.cost.ranking import ENDS, Ladder, Safe, factors, safe
from symtop_studies.memoize import of_one_dataset

from symtop.methods.framework.registry import NEEDS, integrator
from symtop.model.charts import BODY, Array

from .bodies import ASKED, CHAOTIC, FAMILIES, FREE, SYMMETRIC
from .limits import MOST
from .measures import STATUS

SAME, PART = 0.9, 0.8  # tau
LEVEL, DOUBLE, SEVERAL = 1.1, 2.0, 5.0  # factors
EXPONENT, LOWER = 0.25, 0.5
STEPS = 69.92  # a period, of the count of silent wrong runs
LEAST = 0.01  # lower limit on the share of grown steps: smaller shares count as this one
CHAOS = 1000.0  # growth in ten periods
DRAWS = 100
UNREACHED = 1e300  # seconds, the median cost of a target that half of the bodies do not reach
ANY = "any body"
WITHIN = 2.5  # methods with a median up to this many times the least of their class run over a hundred periods
MOST_OF = 0.95  # share of the methods
SPANS = ("short", "long")
YES, FACTOR, PARTLY, NO = "carries over", "with a factor", "in part", "does not"
OTHERS = tuple(name for name in FAMILIES if name != SYMMETRIC)


class Costs(NamedTuple):
    """Seconds of methods on the bodies of a family, and the relative errors of their prices."""

    names: list[str]
    needs: list[str]
    values: Array  # (methods, bodies), inf where the target is not reached, NaN where it is not asked
    errors: Array  # (methods,)


class Interval(NamedTuple):
    """A number with the ends of its 95 % interval."""

    value: float
    low: float
    high: float


def label(name: str) -> str:
    """The name of a variant in the chart `body` without that chart."""
    return name.removesuffix(f"[{BODY}]")


def group_of(data: xr.DataTree, span: str) -> xr.Dataset:
    """The dataset of a group over its only scene."""
    return data[span].to_dataset().isel(scene=0)


@of_one_dataset
def costs(data: xr.DataTree, family: str, target: float, quantity: str = "axis", span: str = "short") -> Costs:
    """Costs of all methods of bodies; span "own" has the same methods in charts of the top, of epsilon = 0."""
    group = group_of(data, span)
    names = [str(name) for name in group["variant"].values]
    part = group.sel(quantity=quantity).sel(target=target, method="nearest")
    if span != "own":
        part = part.sel(family=family)
    values, met_at = (part[name].transpose("variant", "member").values.astype(float) for name in ("cost", "met_at"))
    tariff = prices(data)
    for row, name in enumerate(names):
        fixed = str(group["control"].values[row]) == "step_size"
        price, call = tariff.at(name, np.full(met_at.shape[1], np.nan) if fixed else met_at[row])
        values[row] = values[row] * price + call
    errors = tariff.error[[tariff.names.index(name) for name in names]]
    return Costs(names, [str(needs) for needs in group["needs"].values], values, errors)


def judged_bodies(table: Costs) -> NDArray[np.int64]:
    """The bodies of which the target is asked."""
    return np.flatnonzero(~np.isnan(table.values).all(axis=0))


def medians(values: Array) -> Array:
    """Medians over bodies, along the last axis; `UNREACHED` where the median is not reached, so that these tie."""
    return np.minimum(np.nan_to_num(np.median(values, axis=-1), nan=UNREACHED, posinf=UNREACHED), UNREACHED)


def tau_of(first: Array, second: Array) -> float:
    """Kendall's tau-b of two rows; NaN of fewer than three methods."""
    either = (first < UNREACHED) | (second < UNREACHED)
    if either.sum() < 3:
        return float("nan")
    x, y = (np.sign(row[either, np.newaxis] - row[either]) for row in (first, second))
    pairs = (x * x).sum() * (y * y).sum()
    return float((x * y).sum() / np.sqrt(pairs)) if pairs else float("nan")


def bootstrap_tau(
    first: Costs, second: Costs, rows: tuple[list[int], list[int]], paired: bool, draws: int = DRAWS
) -> Interval:
    """Tau of the medians of two lists of methods; with `draws`, an interval by bootstrap of bodies and prices."""
    bodies, others = judged_bodies(first), judged_bodies(second)
    if bodies.size < 3 or others.size < 3:
        return Interval(*(float("nan"),) * 3)
    a, b = first.values[rows[0]], second.values[rows[1]]
    value = tau_of(medians(a[:, bodies]), medians(b[:, others]))
    generator, taus = np.random.default_rng(4), [] if draws else [float("nan")]
    price = (factors(first.errors[rows[0]], DRAWS),) * 2  # the same methods have the same prices
    if first.names != second.names:
        both_errors = np.append(first.errors[rows[0]], second.errors[rows[1]])
        price = factors(both_errors, DRAWS)[:, : len(rows[0])], factors(both_errors, DRAWS)[:, len(rows[0]) :]
    common = np.intersect1d(bodies, others)
    for k in range(draws):
        if paired:
            draw = common[generator.integers(common.size, size=common.size)]
            pair = draw, draw
        else:
            pair = tuple(part[generator.integers(part.size, size=part.size)] for part in (bodies, others))
        priced = (medians(part[:, picks]) for part, picks in zip((a, b), pair, strict=True))
        # prices do not change the rank of targets that are not reached
        taus.append(tau_of(*(np.where(c < UNREACHED, c * p[k], c) for c, p in zip(priced, price, strict=True))))
    ends = np.nanquantile(taus, ENDS).tolist() if np.isfinite(taus).any() else (float("nan"),) * 2
    return Interval(value, *ends)


@of_one_dataset
def tau(data: xr.DataTree, family: str, target: float, quantity: str = "axis", span: str = "short") -> Interval:
    """The ranking of a family against that at epsilon = 0, prices the same in both."""
    first, second = (costs(data, name, target, quantity, span) for name in (SYMMETRIC, family))
    rows = list(range(len(first.names)))
    draws = DRAWS if quantity == "axis" else 0
    return bootstrap_tau(first, second, (rows, rows), family not in (CHAOTIC, FREE), draws)


@of_one_dataset
def ceiling(data: xr.DataTree, target: float, quantity: str = "axis", span: str = "short") -> Interval:
    """Tau between two halves of the bodies of epsilon = 0."""
    table = costs(data, SYMMETRIC, target, quantity, span)
    bodies, generator, taus = judged_bodies(table), np.random.default_rng(5), list[float]()
    for _ in range(DRAWS):
        order = generator.permutation(bodies)
        taus.append(tau_of(*(medians(table.values[:, half]) for half in np.array_split(order, 2))))
    if not np.isfinite(taus).any():
        return Interval(*(float("nan"),) * 3)
    return Interval(float(np.nanmedian(taus)), *np.nanquantile(taus, ENDS).tolist())


@of_one_dataset
def own_tau(data: xr.DataTree, family: str, target: float) -> Interval:
    """The ranking by the top's own kernels at epsilon = 0 against that of the same methods on bodies of a family."""
    first, second = costs(data, SYMMETRIC, target, "axis", "own"), costs(data, family, target)
    places = [label(name) for name in second.names]
    methods = [integrator(name).method for name in first.names]
    rows = [k for k, name in enumerate(methods) if name in places], [places.index(m) for m in methods if m in places]
    return bootstrap_tau(first, second, rows, family not in (CHAOTIC, FREE))


# ---- winners ---------------------------------------------------------------------------------------------------------


def classes(data: xr.DataTree) -> list[str]:
    """The classes of `needs` that methods of bodies have, and `ANY` for all of them."""
    present = set(map(str, group_of(data, "short")["needs"].values))
    return [*(name for name in NEEDS if name in present), ANY]


def of_class(table: Costs, needs: str) -> list[int]:
    """Rows of a class."""
    return [row for row, need in enumerate(table.needs) if needs in (need, ANY)]


@of_one_dataset
def winner(data: xr.DataTree, family: str, target: float, needs: str = ANY, span: str = "short") -> str | None:
    """The method of a class with the least median cost."""
    return next(iter(cheapest(data, family, target, needs, span)), None)


@of_one_dataset
def cheapest(data: xr.DataTree, family: str, target: float, needs: str = ANY, span: str = "short") -> list[str]:
    """The methods of a class with a median cost up to `LEVEL` times the least, the cheapest first."""
    table = costs(data, family, target, span=span)
    rows, bodies = of_class(table, needs), judged_bodies(table)
    middle = medians(table.values[np.ix_(rows, bodies)]) if bodies.size and rows else np.array([UNREACHED])
    level = np.flatnonzero((middle <= LEVEL * middle.min()) & (middle < UNREACHED))
    return [table.names[rows[place]] for place in level[np.argsort(middle[level], kind="stable")]]


@of_one_dataset
def transferred(data: xr.DataTree, family: str, target: float, needs: str = ANY, best: str | None = None) -> Interval:
    """The cost of the winner at epsilon = 0, or of `best`, over the least of the class on each body, with 95 % ends."""
    best = best or winner(data, SYMMETRIC, target, needs)
    table = costs(data, family, target)
    rows, bodies = of_class(table, needs), judged_bodies(table)
    if best is None or not bodies.size:
        return Interval(*(float("nan"),) * 3)
    values = table.values[np.ix_(rows, bodies)]
    solved = np.isfinite(values).any(axis=0)
    if not solved.any():
        return Interval(*(float("nan"),) * 3)
    ratio = values[rows.index(table.names.index(best))][solved] / values[:, solved].min(axis=0)
    return Interval(*np.quantile(ratio, (0.5, *ENDS), method="nearest").tolist())


def contenders(data: xr.DataTree) -> list[str]:
    """The methods that come within `WITHIN` of the least median of their class, in some family at some target."""
    names = set[str]()
    for family in FAMILIES:
        for target in ASKED:
            table = costs(data, family, target)
            bodies = judged_bodies(table)
            for needs in classes(data) if bodies.size else ():
                rows = of_class(table, needs)
                middle = medians(table.values[np.ix_(rows, bodies)])
                near = (middle <= WITHIN * middle.min()) & (middle < UNREACHED)
                names |= {table.names[row] for row, close in zip(rows, near, strict=True) if close}
    return [str(name) for name in group_of(data, "short")["variant"].values if str(name) in names]


# ---- steps -----------------------------------------------------------------------------------------------------------


@of_one_dataset
def safest(data: xr.DataTree, family: str, target: float, span: str = "short", without: str = "") -> dict[str, Safe]:
    """By method its safe setting and seconds (`symtop_studies.cost.ranking.safe`), on all strata but `without`."""
    group, tariff, ladders = group_of(data, span), prices(data), list[Ladder]()
    part = group.sel(quantity="axis").sel(target=target, method="nearest")
    work = group["work"]
    strata = data["bodies"].to_dataset().isel(variant=0).sel(scene="short", family=family)["stratum"].values
    members = strata[: part.sizes["member"]] != (without or None)
    if span != "own":
        part, work = part.sel(family=family), work.sel(family=family)
    for name in map(str, group["variant"].values):
        met_at = part["met_at"].sel(variant=name).values.astype(float)
        met_at = met_at[~np.isnan(part["cost"].sel(variant=name).values) & members]
        fixed = integrator(name).fixed_step
        settings = np.array([setting_of(integrator(name), level) for level in range(work.sizes["level"])])
        price, call = tariff.at(name, np.full(settings.size, np.nan) if fixed else settings)
        seconds = work.sel(variant=name).values * price + call
        ladders.append(Ladder(name, met_at, settings, seconds, fixed, float(tariff.error[tariff.names.index(name)])))
    return {choice.name: choice for choice in safe(ladders)[0]}


@of_one_dataset
def step_factors(data: xr.DataTree, family: str, target: float, span: str = "short") -> dict[str, float]:
    """By method of fixed step that serves tops, safe steps over those at epsilon = 0; inf beyond the budget."""
    before, after = (safest(data, name, target, span) for name in (SYMMETRIC, family))
    return {name: choice.setting / before[name].setting for name, choice in after.items()
            if integrator(name).fixed_step and np.isfinite(before[name].setting)}  # fmt: skip


@of_one_dataset
def own_factors(data: xr.DataTree, family: str, target: float, without: str = "") -> dict[str, float]:
    """By method, safe steps of a body over those of the top's own chart at epsilon = 0; inf beyond the budget."""
    base = {integrator(name).method: choice for name, choice in safest(data, SYMMETRIC, target, "own").items()}
    after = safest(data, family, target, without=without)
    return {name: choice.setting / base[label(name)].setting for name, choice in after.items()
            if integrator(name).fixed_step and label(name) in base
            and np.isfinite(base[label(name)].setting)}  # fmt: skip


def price_factors(data: xr.DataTree) -> dict[str, float]:
    """By method, price of an evaluation in the chart of bodies over that in the top's own."""
    tariff = prices(data)
    base = {integrator(name).method: name for name in map(str, group_of(data, "own")["variant"].values)}
    pairs = {
        name: base[label(name)] for name in map(str, group_of(data, "short")["variant"].values) if label(name) in base
    }
    tol = np.array([1e-8])
    return {name: float(tariff.at(name, tol)[0][0] / tariff.at(variant, tol)[0][0]) for name, variant in pairs.items()}


# ---- wrong runs and errors -------------------------------------------------------------------------------------------


@of_one_dataset
def silent(data: xr.DataTree, name: str, family: str, stratum: str = "") -> float:
    """The share of bodies whose run with `STEPS` steps a period is wrong although energy and momenta are kept.

    `stratum` is a stratum of free bodies, or regular or chaotic by growth in ten periods; empty for all.
    """
    group = group_of(data, "short")[["setting", "status"]].sel(variant=name, family=family)
    about = data["bodies"].to_dataset()[["growth", "stratum"]].isel(variant=0).sel(scene="short", family=family)
    settings = group["setting"].values[list(STATUS)]
    row = int(np.argmin(np.abs(np.log(settings / STEPS))))
    status = group["status"].transpose("kept", "member").values[row]
    part = status > 0.0
    if stratum in ("regular", CHAOTIC):
        chaos = about["growth"].values[: status.size] > CHAOS
        part &= chaos if stratum == CHAOTIC else ~chaos
    elif stratum:
        part &= about["stratum"].values[: status.size] == stratum
    return float((status[part] == 3.0).mean()) if part.any() else float("nan")


def fixed_steps(data: xr.DataTree) -> list[str]:
    """Methods of bodies with a step."""
    return [name for name in map(str, group_of(data, "short")["variant"].values) if integrator(name).fixed_step]


def silent_shares(data: xr.DataTree, family: str, stratum: str = "") -> Array:
    """The shares of all methods of fixed step."""
    return np.array([silent(data, name, family, stratum) for name in fixed_steps(data)])


@of_one_dataset
def exponents(data: xr.DataTree) -> dict[tuple[str, str, str], float]:
    """By method, family and quantity the exponent of growth of the median error with time, over all times."""
    if "growth" not in data.children:
        return {}
    group = data["growth"].to_dataset().isel(scene=0)
    slopes = {}
    for name in map(str, group["variant"].values):
        for family in map(str, group["family"].values):
            for quantity in ("attitude", "energy"):
                error = group[f"error_{quantity}"].sel(variant=name, family=family).values
                slopes[label(name), family, quantity] = exponent(group["time"].values, error, quantity)
    return slopes


def exponent(time: Array, error: Array, quantity: str) -> float:
    """The slope of log error over log time; NaN where the error is rounding or has the size of the motion."""
    high, low = (0.3, 1e-11) if quantity == "attitude" else (0.3, 1e-13)
    good = np.isfinite(error) & (error < high) & (error > low)
    return float(np.polyfit(np.log(time[good]), np.log(error[good]), 1)[0]) if good.sum() >= 3 else float("nan")


def orders(data: xr.DataTree) -> Iterator[tuple[str, str, float, float]]:
    """Method, family, measured order, measured order at epsilon = 0."""
    order = group_of(data, "short")["order"]
    for name in fixed_steps(data):
        first = float(order.sel(variant=name, family=SYMMETRIC))
        for family in OTHERS:
            yield label(name), family, float(order.sel(variant=name, family=family)), first


# ---- steady rotations and engines ------------------------------------------------------------------------------------


def steady(data: xr.DataTree, name: str, family: str) -> Array:
    """Limits or grown shares of steps, (methods, bodies); empty where nothing was measured."""
    if "steady" not in data.children or family not in data["steady"]["family"].values:
        return np.empty((0, 0))
    return np.asarray(group_of(data, "steady")[name].sel(family=family).transpose("variant", "member").values)


def limit_factors(data: xr.DataTree, family: str) -> Array:
    """Linear limits over those of the same draws at epsilon = 0, (methods, bodies); NaN of an unstable rotation."""
    before, after = (steady(data, "limit", name) for name in (SYMMETRIC, family))
    if not after.size:
        return after
    ratio = np.nan_to_num(after, nan=MOST) / np.where(before == 0.0, np.nan, np.nan_to_num(before, nan=MOST))
    return np.where(after == 0.0, np.nan, ratio)


def resonant(data: xr.DataTree, family: str) -> float:
    """The mean share of steps below the limit at which a tilt grows."""
    shares = steady(data, "grown", family)
    return float(np.nanmean(shares)) if np.isfinite(shares).any() else float("nan")


def engine_errors(data: xr.DataTree, family: str, place: int, name: str = "error") -> Costs:
    """Errors of engines' maps in the place of costs, or whether bodies are lost, at one of the two steps."""
    group = group_of(data, "engines").sel(family=family).isel(steps=place).transpose("variant", "member")
    names = [str(variant) for variant in group["variant"].values]
    return Costs(names, [""] * len(names), group[name].values, np.zeros(len(names)))


@of_one_dataset
def engine_tau(data: xr.DataTree, family: str, place: int) -> Interval:
    """The ranking of engines' maps by error against that at epsilon = 0."""
    first, second = (engine_errors(data, name, place) for name in (SYMMETRIC, family))
    rows = [*range(len(first.names))]
    return bootstrap_tau(first, second, (rows, rows), family not in (CHAOTIC, FREE))


def lost(data: xr.DataTree, family: str, place: int) -> float:
    """The share of bodies lost in the first period, in the mean over maps."""
    return float(np.nanmean(engine_errors(data, family, place, "lost").values))


# ---- verdicts --------------------------------------------------------------------------------------------------------


def ranking_verdict(interval: Interval) -> str:
    """The verdict on an interval of tau."""
    return NO if interval.high < PART else YES if interval.low >= SAME else PARTLY


def factor_verdict(factor: float, with_factor: float = DOUBLE) -> str:
    """The verdict on a factor or its reciprocal, whichever is larger."""
    size = max(factor, 1.0 / factor) if factor > 0.0 else np.inf
    return YES if size <= LEVEL else FACTOR if size <= with_factor else NO


def worst(verdicts: Iterable[str]) -> str:
    """The verdict that is furthest from carrying over."""
    return max(verdicts, key=(YES, FACTOR, PARTLY, NO).index)
