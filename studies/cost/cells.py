"""Results from the study's dataset: costs of all variants on all tops, contests, safe settings, silent failures.

The dataset is a tree. Groups "short" and "long" hold the variants over the two horizons (see `ladder`), "tops" numbers
of the tops, "prices" the seconds of an evaluation and of a call (see `prices`), "confirmed" the safe settings on
other tops (see `confirm`), "far" and "checks" the phase diagram (see `far`). A cost is in seconds, force evaluations x
price at the tolerance that meets the error + call, or in force evaluations. Variants are compared where they show the
same quantity: the axis in every chart but the attitude chart of a method that has the axis chart, which steps the same
axis, and the attitude in the charts that show it.

Each contest is between the variants of one class of `needs`, or of all that exist for a body without symmetry
(`Integrator.general`). A method of this very top, by its equations or its constants, is in a class of its own.
"""

import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import xarray as xr
from numpy.typing import NDArray
from symtop_studies.memoize import of_one_dataset

from symtop.methods.framework.registry import NEEDS, integrator
from symtop.model.charts import Array
from symtop.run.ensemble.population import STRATA
from symtop.run.guard import EXPECTED

from .ladder import KEPT, WRONG
from .prices import prices
from .ranking import Contest, Ladder, Safe, hindsight, safe
from .tops import KINDS, NATURAL, SCENE

HORIZONS = ("short", "long")
POPULATIONS = {"strata": tuple(STRATA), NATURAL: (NATURAL,)}  # kinds of tops in each
GENERAL = "any body"  # whatever a method needs, if it exists for a body without symmetry
CLASSES = (*(name for name in NEEDS if name != "solution"), GENERAL)
# of the front page's table: a class, and whether only methods count that keep energy and momenta
ROWS = ((CLASSES[0], False), (CLASSES[0], True), *((needs, False) for needs in CLASSES[1:-1]))
SECONDS, EVALUATIONS = "seconds", "evaluations"
WITHIN = 2.5  # variants up to this many times the least cost of their class over ten nutations run over a thousand
CLOSER = 1.25  # the same for attitude charts, which take part in contests of the attitude only
OFTEN = 0.1  # share of the tops on which that must be so
CONFIRMED = "confirmed"  # the group of safe settings that were run on other tops


class Cell(NamedTuple):
    """One comparison of variants: a target of a quantity over a horizon, on the tops of a population or a kind."""

    horizon: str
    quantity: str
    target: float
    tops: str  # a population or a kind
    needs: str = GENERAL


class Costs(NamedTuple):
    """Costs of variants on the tops of a cell, and relative errors of their prices."""

    names: list[str]
    values: Array  # (variants, tops), inf where a variant does not reach the target
    errors: Array


def horizons(data: xr.DataTree) -> list[str]:
    """The horizons whose groups are in the dataset."""
    return [name for name in HORIZONS if name in data.children]


def nutations(data: xr.DataTree, horizon: str) -> float:
    """The length of a horizon."""
    return float(np.nanmax(data[horizon]["nutations"].values))


def targets(data: xr.DataTree) -> list[float]:
    """The targets."""
    return [float(value) for value in data["short"]["target"].values]


@of_one_dataset
def kinds_of(data: xr.DataTree, horizon: str) -> NDArray[np.int64]:
    """The place of each top's kind in `KINDS`, of the tops of a horizon."""
    places = data["tops"].to_dataset()["kind_place"].sel(scene=horizon).values.ravel()
    return np.asarray(places[np.isfinite(places)], dtype=np.int64)


def members(data: xr.DataTree, horizon: str) -> int:
    """How many tops of both populations a horizon has."""
    return int((kinds_of(data, horizon) != KINDS.index(SCENE)).sum())


def chosen(data: xr.DataTree, horizon: str, tops: str) -> NDArray[np.bool_]:
    """Which tops belong to a population or a kind."""
    return np.isin(kinds_of(data, horizon), [KINDS.index(kind) for kind in POPULATIONS.get(tops, (tops,))])


def on_tops(values: xr.DataArray, mask: NDArray[np.bool_]) -> Array:
    """Values (variants, tops) of a horizon on some of its tops."""
    return np.asarray(values.transpose("variant", "member").values[:, : mask.size][:, mask])


def of_class(needs: str, general: bool, name: str) -> bool:
    """Does a method with these traits take part in the contests of a class?"""
    return needs == name or (name == GENERAL and general and needs != "")


@of_one_dataset
def costs(data: xr.DataTree, cell: Cell, unit: str = SECONDS) -> Costs:
    """Costs of the variants of a class that show a cell's quantity, on the tops of the cell."""
    group = data[cell.horizon].to_dataset()[["cost", "met_at", "needs", "general", "control"]].isel(scene=0)
    traits = zip(group["needs"].values, group["general"].values > 0.0, strict=True)
    rows_of_class = [of_class(str(needs), bool(general), cell.needs) for needs, general in traits]
    part = group.sel(quantity=cell.quantity, target=cell.target).isel(variant=np.flatnonzero(rows_of_class))
    mask = chosen(data, cell.horizon, cell.tops)
    values = on_tops(part["cost"], mask).astype(float)
    rows, tops = ~np.isnan(values).all(axis=1), ~np.isnan(values).all(axis=0)
    names = [str(name) for name in part["variant"].values[rows]]
    values = np.where(np.isnan(values), np.inf, values)[np.ix_(rows, tops)]
    if unit == EVALUATIONS:
        return Costs(names, values, np.zeros(len(names)))
    met_at = on_tops(part["met_at"], mask)[np.ix_(rows, tops)]
    fixed = part["control"].values[rows] == "step_size"
    tariff = prices(data)
    for row, name in enumerate(names):
        price, call = tariff.at(name, np.full(met_at.shape[1], np.nan) if fixed[row] else met_at[row])
        values[row] = values[row] * price + call
    return Costs(names, values, tariff.error[[tariff.names.index(name) for name in names]])


@of_one_dataset
def contest(data: xr.DataTree, cell: Cell) -> Contest:
    """The contest of a cell in hindsight: with the best setting for each top."""
    return hindsight(*costs(data, cell), prices(data).marked)


@of_one_dataset
def safest(data: xr.DataTree, cell: Cell, keeping: bool = False) -> tuple[list[Safe], bool]:
    """The safe choices of a cell, cheapest first, and whether the lead is called; `keeping` energy and momenta."""
    group = data[cell.horizon].to_dataset()[["met_at", "setting", "control"]].isel(scene=0)
    mask, tariff = chosen(data, cell.horizon, cell.tops), prices(data)
    wide, ladders = asked_tops(data, cell), []
    for name in costs(data, cell).names:
        if keeping and not (integrator(name).conserves or frozenset()) >= {"energy", "p_phi", "p_psi"}:
            continue
        runs = group.sel(variant=name)
        met_at = runs["met_at"].sel(quantity=cell.quantity, target=cell.target).values[: mask.size].astype(float)
        settings, fixed = runs["setting"].values, str(runs["control"].values) == "step_size"
        price, call = tariff.at(name, np.full(settings.size, np.nan) if fixed else settings)
        work = mean_work(data, cell, name)
        error = float(tariff.error[tariff.names.index(name)])
        reached = met_at[mask][wide] * served_over_interpolated(data, cell, name)
        ladders.append(Ladder(name, reached, settings, work * price + call, fixed, error))
    return safe(ladders, tariff.marked)


@of_one_dataset
def weights_of(data: xr.DataTree, cell: Cell) -> Array:
    """How many tops of each kind are asked in a cell."""
    kinds, wide = kinds_of(data, cell.horizon)[chosen(data, cell.horizon, cell.tops)], asked_tops(data, cell)
    return np.array([float(wide[kinds == place].sum()) for place in range(len(KINDS))])


def mean_work(data: xr.DataTree, cell: Cell, name: str) -> Array:
    """Force evaluations of a variant at each of its settings, the mean of the median tops of the kinds in a cell."""
    weights = weights_of(data, cell)
    work = data[cell.horizon]["work"].isel(scene=0).sel(variant=name).transpose("level", "kind").values
    return np.asarray((np.where(weights > 0.0, work, 0.0) * weights).sum(axis=1) / max(weights.sum(), 1.0))


class FewestCalls(NamedTuple):
    """The safe choice with the fewest evaluations."""

    best: Safe
    evaluations: float  # of a run with its safe setting
    price: float  # s by which an evaluation must take longer for it to be the fastest of all; 0 if it is so already


def fewest_calls(data: xr.DataTree, cell: Cell) -> FewestCalls | None:
    """The safe choice if evaluations are expensive; None if no choice reaches the error."""
    choices = [choice for choice in safest(data, cell)[0] if np.isfinite(choice.seconds)]
    counts = []
    for choice in choices:
        settings = data[cell.horizon]["setting"].isel(scene=0).sel(variant=choice.name).values
        known = np.isfinite(settings)
        order = np.argsort(settings[known])
        x, work = np.log(settings[known][order]), np.log(mean_work(data, cell, choice.name)[known][order])
        counts.append(math.exp(float(np.interp(math.log(choice.setting), x, work))))
    if not counts:
        return None
    best, least = choices[int(np.argmin(counts))], min(counts)
    others = [(best.seconds - choice.seconds) / (count - least) for choice, count in zip(choices, counts, strict=True)
              if count > least]  # fmt: skip
    return FewestCalls(best, least, max([0.0, *others]))


def served_over_interpolated(data: xr.DataTree, cell: Cell, name: str) -> float:
    """The safe setting confirmed on other tops over the interpolated one; 1 where no other tops were run."""
    confirmed = (cell.horizon, cell.quantity, cell.tops) == ("short", "axis", NATURAL) and CONFIRMED in data.children
    if not confirmed or name not in data[CONFIRMED]["variant"].values:
        return 1.0
    row = data[CONFIRMED].to_dataset().isel(scene=0).sel(variant=name, target=cell.target)
    ratio = float(row["served"] / row["interpolated"])
    return 1.0 if math.isnan(ratio) else ratio


def advised(data: xr.DataTree, others: Sequence[str]) -> dict[str, list[float]]:
    """By variant the safe settings for each target on natural tops, over ten nutations; NaN for other targets.

    For variants within `WITHIN` of the cheapest of their class, also of those that keep every constant, the cheapest
    where f is dear, and the `others`.
    """
    settings: dict[str, list[float]] = {}
    for place, target in enumerate(targets(data)):
        dear = fewest_calls(data, Cell("short", "axis", target, NATURAL, CLASSES[0]))
        extra = [*others, *([dear.best.name] if dear else [])]
        for needs, keeping in [*((needs, False) for needs in CLASSES), (CLASSES[0], True)]:
            choices = safest(data, Cell("short", "axis", target, NATURAL, needs), keeping)[0]
            for choice in choices:
                near = choice.seconds <= WITHIN * choices[0].seconds or choice.name in extra
                if near and math.isfinite(choice.seconds):
                    settings.setdefault(choice.name, [math.nan] * len(targets(data)))[place] = choice.setting
    return dict(sorted(settings.items()))


def reached(data: xr.DataTree, target: float) -> dict[str, Safe]:
    """By variant the safe choice for a target on natural tops, of all classes; those that reach it."""
    lists = (safest(data, Cell("short", "axis", target, NATURAL, needs))[0] for needs in CLASSES[:-1])
    return {choice.name: choice for choices in lists for choice in choices if np.isfinite(choice.seconds)}


def fewest(data: xr.DataTree, cell: Cell) -> str | None:
    """The variant of a cell that needs the fewest force evaluations on the median top."""
    table = costs(data, cell, EVALUATIONS)
    middle = np.median(table.values, axis=1) if table.values.size else np.full(1, np.inf)
    return table.names[int(np.argmin(middle))] if np.isfinite(middle.min()) else None


def asked_tops(data: xr.DataTree, cell: Cell) -> NDArray[np.bool_]:
    """The tops of a cell of which the target is asked for some variant."""
    group = data[cell.horizon].to_dataset()["cost"].isel(scene=0).sel(quantity=cell.quantity, target=cell.target)
    mask = chosen(data, cell.horizon, cell.tops)
    return np.asarray(~np.isnan(on_tops(group, mask)).all(axis=0))


def contenders(data: xr.DataTree) -> list[str]:
    """The variants that come within `WITHIN` of the cheapest of their class on `OFTEN` of the tops, at some target.

    Attitude charts must come within `CLOSER`: in a full run of those within `WITHIN` none of the others won or was
    level with the cheapest over a thousand nutations on 2 % of the tops, and they took a third of the time of all.
    """
    names: set[str] = set()
    chart = data["short"].to_dataset()["chart"].isel(scene=0)
    for quantity in ("axis", "attitude"):
        for target in targets(data):
            for tops in POPULATIONS:
                for needs in CLASSES[:-1] if quantity == "axis" else (GENERAL,):
                    table = costs(data, Cell("short", quantity, target, tops, needs))
                    best = table.values.min(axis=0, initial=np.inf)
                    alone = (quantity == "attitude") & (chart.sel(variant=table.names).values == "attitude")
                    limit = np.where(alone, CLOSER, WITHIN)[:, np.newaxis] * best
                    near = (table.values <= limit) & np.isfinite(table.values)
                    enough = near.sum(axis=1) > OFTEN * max(best.size, 1)
                    names |= {name for name, passes in zip(table.names, enough, strict=True) if passes}
    return [str(name) for name in data["short"]["variant"].values if str(name) in names]


# ---- winners ---------------------------------------------------------------------------------------------------------


def cells(data: xr.DataTree, quantity: str = "axis", tops: str = NATURAL, needs: str = GENERAL) -> Iterator[Cell]:
    """The cells of a quantity, by horizon and target."""
    for horizon in horizons(data):
        for target in targets(data):
            yield Cell(horizon, quantity, target, tops, needs)


def winners(data: xr.DataTree) -> list[dict[str, Any]]:
    """Every cell of the axis: population, class, horizon, target; the safe choice and the contest in hindsight."""
    return [
        winner(data, cell) for tops in POPULATIONS for needs in CLASSES for cell in cells(data, "axis", tops, needs)
    ]


def winner(data: xr.DataTree, cell: Cell) -> dict[str, Any]:
    """One cell in both protocols."""
    choices, called = safest(data, cell)
    result = contest(data, cell)
    best = choices[0] if choices and np.isfinite(choices[0].seconds) else None
    return {
        "quantity": cell.quantity, "tops": cell.tops, "needs": cell.needs,
        "nutations": nutations(data, cell.horizon), "target": cell.target,
        "asked": int(asked_tops(data, cell).sum()), "safe": best,
        "safe_called": called, "hindsight": result.first, "hindsight_called": result.called,
        "solved": result.solved,
    }  # fmt: skip


# ---- silent failures and the guard -----------------------------------------------------------------------------------


class Health(NamedTuple):
    """Numbers of tops (settings, kinds) of one variant over ten nutations, by setting and kind of top."""

    setting: Array  # steps a nutation, or tolerances
    drawn: Array  # (kinds,)
    wrong: Array
    silent: Array
    dropped: Array  # not run, as the budget of a run would have been exceeded


def health(data: xr.DataTree, name: str) -> Health:
    """Wrong runs, silent failures and tops that were dropped."""
    group = data["short"].to_dataset().isel(scene=0).sel(variant=name)
    levels = np.isfinite(group["setting"].values)
    drawn = group["drawn"].values
    runs, wrong, silent = (group[key].transpose("level", "kind").values[levels] for key in ("runs", "wrong", "silent"))
    return Health(group["setting"].values[levels], drawn, wrong, silent,
                  drawn - runs)  # fmt: skip


def guard_counts(data: xr.DataTree) -> pd.DataFrame:
    """Numbers of wrong and of other runs, and of guard warnings, by chart and by whether its trial was the whole run.

    ``between`` are runs with an error above `EXPECTED`, from which on the guard warns, and below `WRONG`.
    """
    group = data["short"].to_dataset().isel(scene=0)[["foretold", "measured", "watched", "whole", "chart", "control"]]
    runs = group.to_dataframe().dropna(subset=["foretold"])
    # a fixed step on the attitude repeats the numbers of the axis
    runs = runs[(runs["control"] == "tolerance") | (runs["chart"] != "attitude")]
    kinds = {"wrong": runs["measured"] > WRONG, "right": runs["measured"] <= EXPECTED}
    kinds["between"] = ~kinds["wrong"] & ~kinds["right"]
    warned = {f"{name}_warned": mask & (runs["foretold"] > EXPECTED) for name, mask in kinds.items()}
    columns = pd.DataFrame({**kinds, **warned, "wrong_seen": kinds["wrong"] & (runs["watched"] > KEPT)})
    adaptive = np.where(runs["control"] == "tolerance", "adaptive", "fixed step, " + runs["chart"])
    return (
        columns.assign(variants=adaptive, whole=runs["whole"] > 0.0).groupby(["variants", "whole"]).sum().reset_index()
    )
