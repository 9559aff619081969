"""Facts and tables of the study."""

from itertools import product
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from symtop.measure.order import CONFIRMED_BEYOND

from .measures import (
    HISTORY_TOLERANCE,
    LARGE,
    LEAST_SCENES,
    MAIN,
    OTHERS,
    TARGET,
    WRONG,
    adaptive,
    declared_order,
    efficiencies,
    fits,
    judged,
    merged,
    named_variants,
    ratios,
    stepping,
    tolerance_fits,
)


def facts(data: xr.Dataset) -> dict[str, Any]:
    """How many orders are confirmed, the work within each order, and how errors compare with tolerances."""
    words = [judgement.verdict for judgement in judged(data).values()]
    part, _ = named_variants(data)
    ranked = cheapest(data).query("ranked")
    spans = ranked.groupby("order")["work"].agg(lambda works: works.max() / works.min())
    span_order = int(spans.idxmax()) if len(spans) else None
    alike = ranked[ranked["order"] == span_order]  # the least work first
    (span_best, span_least), (span_worst, span_most) = map(first, (alike, alike[::-1]))
    verdicts = orders(data)["verdict"]
    known = {name: values for name, values in ratios(data).items() if values.size}
    all_ratios = np.concatenate([np.full(1, np.nan), *known.values()])
    return {
        "scenes": ", ".join(map(str, data["scene"].values)),
        "scene": str(part["scene"].values),
        "target": TARGET,  # rad
        "least_scenes": LEAST_SCENES,
        "beside": CONFIRMED_BEYOND,
        "pairs": len(words) or None,  # of a variant and a scene
        **{word: words.count(word) if words else None for word in ("confirmed", "refuted", "undecided")},
        "higher": int((verdicts == "higher").sum()),
        "lower": int((verdicts == "lower").sum()),
        "wrong": int((verdicts == WRONG).sum()),
        "unknown": stepping(data).sizes["variant"] - len({name for _, name in efficiencies(data, TARGET)}),
        "span": float(spans.max()) if len(spans) else None,  # most work over least within an order
        "span_order": span_order,
        "span_best": span_best,
        "span_least": span_least,
        "span_worst": span_worst,
        "span_most": span_most,
        "history_tolerance": HISTORY_TOLERANCE,
        "large": LARGE,  # rad
        "ratio_asked": int(np.isfinite(data["tolerance"].values).sum()) or None,  # runs at a tolerance
        "ratio_runs": sum(values.size for values in known.values()),  # of these
        "ratio_middle": float(np.nanmedian(all_ratios)) if known else None,  # error over tolerance
        "ratio_most": float(np.nanmax(all_ratios)) if known else None,
        "ratio_most_variant": max(known, key=lambda name: known[name].max(), default=None),
    }


def first(costs: pd.DataFrame) -> tuple[str | None, float | None]:
    """Variant and work in the first row, or None without one."""
    return (None, None) if costs.empty else (str(costs.iloc[0]["variant"]), float(costs.iloc[0]["work"]))


def cheapest(data: xr.Dataset) -> pd.DataFrame:
    """Force evaluations a nutation that each fixed-step variant needs for `TARGET`, median over scenes, least first.

    A median over fewer than `LEAST_SCENES` scenes is not ranked, and comes last.
    """
    works, enough = efficiencies(data, TARGET), min(LEAST_SCENES, data.sizes["scene"])
    rows = []
    for name, label in merged(stepping(data), MAIN).items():
        costs = [cost for (_, variant), cost in works.items() if variant == name]
        if costs:
            known, foreseen = [cost.work for cost in costs], sum(cost.foreseen for cost in costs)
            work = float(np.median(known)), min(known), max(known), len(known), foreseen
            rows.append([label, declared_order(name), *work, len(known) >= enough])
    header = ["variant", "order", "work", "least", "most", "scenes", "of these extrapolated", "ranked"]
    table = pd.DataFrame(rows, columns=header)
    return table.astype({"ranked": bool}).sort_values(["ranked", "work"], ascending=[False, True])


def tables(data: xr.Dataset) -> dict[str, pd.DataFrame]:
    """The work for an error by variant; every order; every adaptive variant on every scene."""
    costs = cheapest(data).drop(columns="ranked")
    costs = costs.rename(columns={"work": "force evaluations a nutation, median over scenes", "most": "largest"})
    return {"costs": costs, "orders": orders(data), "tolerances": tolerances(data)}


def orders(data: xr.Dataset) -> pd.DataFrame:
    """Every order with its verdict, those that are not confirmed first."""
    ends, rows = fits(data, MAIN, at_end=True), []
    for pair, (word, slopes) in judged(data).items():
        numbers = [part for name in (MAIN, *OTHERS) for part in _order(slopes.get(name))]
        side = "higher" if MAIN in slopes and slopes[MAIN].slope > declared_order(pair[1]) else "lower"
        verdict = side if word == "refuted" else word  # a claim is judged by more than this run: see the ledger
        rows.append([*pair, declared_order(pair[1]), verdict, *numbers, ends[pair].constant])
    names = [part for name in (MAIN, *OTHERS) for part in (f"order in {name}", f"+- in {name}")]
    table = pd.DataFrame(rows, columns=["scene", "variant", "declared", "verdict", *names, "C at the end (rad/s^p)"])
    rank = {WRONG: -1, "lower": 0, "higher": 1, "undecided": 2}
    return table.sort_values("verdict", key=lambda column: column.map(lambda word: rank.get(word, 3)), kind="stable")


def _order(fit: Any) -> tuple[float, float]:
    return (np.nan, np.nan) if fit is None else (float(fit.slope), float(fit.interval))


def tolerances(data: xr.Dataset) -> pd.DataFrame:
    """How the axis error follows the tolerance: the power, and the error over the tolerance, by variant and scene."""
    fitted, part, rows = tolerance_fits(data), adaptive(data), []
    for name, scene in product(map(str, part["variant"].values), map(str, part["scene"].values)):
        fit, cell = fitted[scene, name], part.sel(scene=scene, variant=name)
        ratio = (cell[MAIN] / cell["tolerance"]).values[fit.used]
        span = (float(ratio.min()), float(ratio.max())) if ratio.size else (np.nan, np.nan)
        rows.append([name, scene, float(fit.slope), *span, float(cell[MAIN].min())])
    header = ["variant", "scene", "power of the tolerance", "error / tolerance, least", "largest", "least error (rad)"]
    return pd.DataFrame(rows, columns=header)
