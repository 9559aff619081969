"""Facts and tables of the study."""

from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from symtop.judging.claims.subject import declared
from symtop.methods.framework.registry import NEEDS, integrator, split_name
from symtop.model.charts import BODY
from symtop.report.formats import at_most, count, duration, number
from symtop.run.guard import EXPECTED

from . import cells, far
from .cells import CLASSES, Cell
from .confirm import SAMPLES
from .ladder import KEPT, WRONG
from .prices import NOISY, PROCESSES, TOLERANCE, prices
from .ranking import SAFE, TIE
from .tops import KINDS, NATURAL

LEFT_OUT = {  # methods, by the reason, which the page states
    "the same maps in three coordinates": ("midpoint-unreduced", "trapezoidal-unreduced"),
    "the same steps as taylor in slower arithmetic": ("taylor-longdouble", "taylor-quad"),
    "a step of any size is the motion itself": ("exact-discrete",),
}  # fmt: skip
NOTHING = "none within the budget"
STEPS = (4.37, 17.48, 69.92)  # a nutation, of the table of silent failures
QUOTED, FINE = "rk4[axis]", 69.92  # the variant whose wrong runs the page quotes, and its steps a nutation
KNOWN = (
    QUOTED, "dop853-compiled-fixed[axis]", "gauss-4[axis]", "strang[axis]", "takahashi-imada[axis]", "srkn-14-6[axis]",
    "midpoint[angles]", "stormer-verlet[angles]",
)  # fmt: skip
HAVE = (  # common methods, for a table of their settings
    "rk4[axis]", "rk45-compiled[axis]", "dop853-compiled[axis]", "strang[axis]", "stormer-verlet[angles]",
    "midpoint[angles]",
)  # fmt: skip
SHORT_RUN, LONG_RUN = 1e3, 1e5  # nutations of a short run of the map at most, and of a long one at least
AT = 1e-6  # rad, the error at which classes are quoted
KEEPS = "keeps, at 1e-6 rad"  # that is, at `AT`
US = 1e6  # microseconds in a second


def decades(target: float) -> int:
    """The 6 of 1e-6."""
    return round(-np.log10(target))


def serves(name: str) -> str:
    """The suffix " (symmetric)" for a variant whose implementation here is for symmetric bodies only, else ""."""
    method = integrator(split_name(name)[0])
    return "" if BODY in method.solvers or method.needs == "this-top" else " (symmetric)"


def setting_words(name: str, value: float) -> str:
    """A setting in a table: steps a nutation, or a tolerance."""
    return f"{number(value, 3)} steps" if integrator(name).fixed_step else f"tolerance {number(value, 1)}"


def facts(data: xr.DataTree) -> dict[str, Any]:
    """The safe choices, the fastest in hindsight, silent failures, the guard, the map, the prices, the work of all."""
    known, group, spans = prices(data), data["short"].to_dataset(), cells.horizons(data)
    return {
        "safe": SAFE, "tie": TIE, "wrong": WRONG, "kept": KEPT, "near": far.TIE, "processes": PROCESSES,
        "noisy": NOISY, "at": AT, "short_run": SHORT_RUN, "long_run": LONG_RUN,
        **winners_facts(data), **{f"{part}_{span}": value for span in cells.HORIZONS
                                  for part, value in span_facts(data, span).items()},
        **confirmed_facts(data), **silent_facts(data), **guard_facts(data), **far_facts(data),
        "variants": group.sizes["variant"],
        "marked": len(known.marked),
        "processor": data.attrs["processor"].partition(",")[0],
        "dense": known.sampled,  # price with dense output over heyoka's own
        "runs": sum(float(np.nansum(data[span]["made"].values)) for span in spans),
    }  # fmt: skip


def span_facts(data: xr.DataTree, span: str) -> dict[str, float | None]:
    """The length of a horizon in nutations, its tops, and the budget of a run in force evaluations a nutation."""
    if span not in cells.horizons(data):
        return dict.fromkeys(("nutations", "natural", "strata", "budget", "rows"))
    nutations = cells.nutations(data, span)
    return {
        "nutations": nutations,
        **{tops: int(cells.chosen(data, span, tops).sum()) for tops in cells.POPULATIONS},
        "budget": float(np.nanmax(data[span]["budget"].values)) / nutations,
        "rows": data[span].sizes["variant"],
    }


def over(data: xr.DataTree) -> str:
    """The text of the front page for an error that no setting within the budget keeps."""
    return f"not within {count(span_facts(data, 'short')['budget'] or 0.0)} evaluations"


def winners_facts(data: xr.DataTree) -> dict[str, Any]:
    """Safe choices for any body and each class; where counts of evaluations mislead; agreement of both protocols."""
    values: dict[str, Any] = {"safe_called": 0}
    misled: list[tuple[Any, ...]] = []
    for target in cells.targets(data):
        cell, place = Cell("short", "axis", target, NATURAL), decades(target)
        winner, fewest = cells.winner(data, cell), cells.fewest(data, cell)
        values["safe_called"] += bool(winner["safe"] and winner["safe_called"])
        values |= _safe_facts(f"safe_{place}", data, cell)
        if safe := winner["safe"]:
            misled += [(choice.seconds / safe.seconds, target, fewest, choice.seconds, safe.name, safe.seconds)
                       for choice in cells.safest(data, cell)[0] if choice.name == fewest]  # fmt: skip
    keys = "misled", "misled_at", "fewest", "fewest_seconds", "instead", "instead_seconds"
    worst = max((row for row in misled if 1.0 < row[0] < np.inf), default=(None,) * len(keys))
    values |= dict(zip(keys, worst, strict=True))
    for needs in CLASSES[:-1]:
        values |= _safe_facts(needs.replace("-", "_"), data, Cell("short", "axis", AT, NATURAL, needs))
    values["kicks_serve"] = serves(values["kicks"]) if values["kicks_seconds"] else ""
    rows = [row for row in cells.winners(data) if row["needs"] != "this-top" and row["safe"] and row["hindsight"]]
    values["cells"] = len(rows) or None
    values["same"] = sum(row["safe"].name == row["hindsight"].name for row in rows) if rows else None
    return values


def _safe_facts(key: str, data: xr.DataTree, cell: Cell) -> dict[str, Any]:
    best = cells.winner(data, cell)["safe"]
    name = best.name if best else NOTHING if cells.costs(data, cell).names else None
    return {key: name, f"{key}_seconds": best and best.seconds}


def confirmed_facts(data: xr.DataTree) -> dict[str, float | None]:
    """How many settings were run on other tops, at how many times, and the median factor by which steps got finer."""
    table = confirmed(data)
    steps = table[table["steps"]]
    finer = float((steps["served"] / steps["interpolated"]).median()) if len(steps) else None
    return {"confirmed": len(table), "looks": SAMPLES, "finer": finer}


def silent_facts(data: xr.DataTree) -> dict[str, Any]:
    """Wrong and silent runs of `QUOTED` at `FINE` steps a nutation, on natural tops and on the kind with the most."""
    names = "quoted_steps", "natural_wrong", "natural_silent", "worst_kind", "worst_wrong", "worst_silent"
    if QUOTED not in data["short"]["variant"].values:
        return dict.fromkeys(names)
    health = cells.health(data, QUOTED)
    level = int(np.argmin(np.abs(health.setting - FINE)))
    wrong, silent = (part[level] / np.maximum(health.drawn, 1.0) for part in (health.wrong, health.silent))
    natural, worst = KINDS.index(NATURAL), int(np.argmax(wrong[:-1]))
    values = health.setting[level], wrong[natural], silent[natural], KINDS[worst], wrong[worst], silent[worst]
    return dict(zip(names, values, strict=True))


def guard_facts(data: xr.DataTree) -> dict[str, int]:
    """Numbers of wrong and right runs longer than the guard's trial, and of its warnings among them."""
    rows = cells.guard_counts(data)
    rows = rows[~rows["whole"]]
    return {"expected": EXPECTED} | {f"guard_{key}{end}": int(rows[f"{key}{end}"].sum())
                                     for key in ("wrong", "right") for end in ("", "_warned")}  # fmt: skip


def far_facts(data: xr.DataTree) -> dict[str, Any]:
    """The phase diagram: where splittings win, how many cells are predicted, and the results of checks."""
    ends = "_clear", "_short", "_long"
    names = [f"map_{quantity}{end}" for quantity in far.QUANTITIES for end in ends]
    names += ["map_tops", "map_methods", "predicted", "checks", "checks_runs", "checks_told", "checks_longest"]
    names += ["checks_low", "checks_middle", "checks_high"]  # error of a run, measured over predicted
    values: dict[str, Any] = dict.fromkeys(names)
    if "far" not in data.children:
        return values
    reached = predicted = 0
    for quantity in far.QUANTITIES:
        panel = far.diagram(data, quantity)
        known = panel.winner >= 0
        reached, predicted = reached + int(known.sum()), predicted + int((panel.predicted & known).sum())
        splits = np.isin(panel.winner, [k for k, name in enumerate(panel.names) if integrator(name).needs == "kicks"])
        values[f"map_{quantity}_clear"] = float((panel.ratio[known] >= far.TIE).mean()) if known.any() else None
        for end, part in (("short", panel.horizons <= SHORT_RUN), ("long", panel.horizons >= LONG_RUN)):
            if known[:, part].any():
                values[f"map_{quantity}_{end}"] = float(splits[:, part][known[:, part]].mean())
    values |= {"map_tops": data["far"].sizes["member"], "map_methods": data["far"].sizes["variant"]}
    values |= {"predicted": predicted / reached if reached else None}
    checks = far.checks(data)
    cases = checks.drop_duplicates(["quantity", "target", "horizon"])
    values |= dict(zip(names[-3:], checks["ratio"].quantile([0.1, 0.5, 0.9]), strict=True))
    return values | {"checks": len(cases) or None, "checks_runs": len(checks), "checks_told": int(checks["told"].sum()),
                    "checks_longest": cases["horizon"].max()}  # fmt: skip


# ---- tables ----------------------------------------------------------------------------------------------------------


def tables(data: xr.DataTree) -> dict[str, pd.DataFrame]:
    """Recommended methods; winners by protocol, kind and quantity; settings run; prices; silent runs; guard."""
    kinds = [Cell("short", "axis", target, kind) for kind in KINDS[:-1] for target in cells.targets(data)]
    others = [cell for quantity in ("attitude", "energy") for cell in cells.cells(data, quantity)]
    return {
        "use": use(data), "have": have(data), "winners": winners(data, cells.winners(data)),
        "kinds": winners(data, [cells.winner(data, cell) for cell in kinds]),
        "quantities": winners(data, [cells.winner(data, cell) for cell in others]),
        "confirmed": confirmed(data), "prices": price_list(data), "silent": silent(data),
        "guard": cells.guard_counts(data), "checks": checked(data),
    }  # fmt: skip


def use(data: xr.DataTree) -> pd.DataFrame:
    """The safe choice of each class at each error, in the shorter runs, and the constants kept by that at `AT`.

    The second row is for a slower f, the third for the methods of the first row that keep energy and momenta.
    """
    rows = list[dict[str, str]]()
    for needs, keeping in cells.ROWS:
        line, kept = {"you can supply": f"{NEEDS[needs]}{', all constants kept' * keeping}"}, ""
        for target in cells.targets(data):
            cell = Cell("short", "axis", target, NATURAL, needs)
            choices, called = cells.safest(data, cell, keeping)
            best = next((choice for choice in choices if np.isfinite(choice.seconds)), None)
            words = over(data) if cells.asked_tops(data, cell).any() else "not asked"
            if best is not None:
                words = f"{'' if called else '~ '}{best.name}{serves(best.name)}, "
                words += f"{setting_words(best.name, best.setting)}, {duration(best.seconds)}"
                kept = keeps(best.name) if target == AT else kept
            line[f"1e-{decades(target)} rad"] = words
        rows.append(line | {KEEPS: kept})
        rows += slower(data) if len(rows) == 1 else []
    return pd.DataFrame(rows)


def slower(data: xr.DataTree) -> list[dict[str, str]]:
    """The row of safe choices with f(t, y) alone if f is so slow that the fewest evaluations win at every error.

    A cell has the evaluations in the place of the time; no row if the winners have the fewest already.
    """
    by_target = {target: cells.fewest_calls(data, Cell("short", "axis", target, NATURAL, CLASSES[0]))
            for target in cells.targets(data)}  # fmt: skip
    known = {target: fewest for target, fewest in by_target.items() if fewest is not None}
    price = max((fewest.price for fewest in known.values()), default=0.0)
    line = {"you can supply": f"{NEEDS[CLASSES[0]]} that takes {at_most(US * price, 1, 'us')} longer"}
    for target in by_target:
        line[f"1e-{decades(target)} rad"] = over(data)
    for target, (best, evaluations, _) in known.items():
        words = f"{best.name}, {setting_words(best.name, best.setting)}, {count(evaluations)} evaluations"
        line[f"1e-{decades(target)} rad"] = words
    return [line | {KEEPS: keeps(known[AT].best.name) if AT in known else ""}] if price > 0.0 else []


def keeps(name: str) -> str:
    """The constants of the motion that a variant keeps, for a table: those declared, and those linear in its state.

    A method that uses f alone keeps the linear ones: p_phi = L_z, if L is part of the state.
    """
    method = integrator(name)
    words = {claim: declared(method, claim) for claim in ("p_phi", "p_psi", "axis_length", "energy")}
    if method.needs in ("derivative", "expression") and "angles" not in method.charts():
        words["p_phi"] = "kept"
    symbols = {"axis_length": "|e|"}
    kept = [symbols.get(claim, claim) for claim, word in words.items() if word == "kept"]
    return ", ".join(kept + ["energy bounded"] * (words["energy"] == "bounded")) or "nothing exactly"


def have(data: xr.DataTree) -> pd.DataFrame:
    """For common methods at each error: the safe setting, its time, and the ratio to the least time."""
    rows = [{"you have": name} for name in HAVE if name in data["short"]["variant"].values]
    for target in cells.targets(data)[:3]:
        known = cells.reached(data, target)
        best = min((choice.seconds for choice in known.values() if integrator(choice.name).general), default=np.nan)
        for row in rows:
            choice = known.get(row["you have"])
            row[f"1e-{decades(target)} rad"] = over(data) if choice is None else (
                f"{setting_words(choice.name, choice.setting)}, {duration(choice.seconds)}, "
                f"{number(choice.seconds / best)} times")  # fmt: skip
    return pd.DataFrame(rows)


def winners(data: xr.DataTree, results: list[dict[str, Any]]) -> pd.DataFrame:
    """Cells, one a row: the safe choice with its time, and the winner in hindsight with its share."""
    marked, rows = prices(data).marked, []
    for cell in results:
        safe, best = cell["safe"], cell["hindsight"]
        row = {
            **({"quantity": cell["quantity"]} if cell["quantity"] != "axis" else {}),
            "tops": cell["tops"], "needs": cell["needs"], "nutations": cell["nutations"], "error": cell["target"],
            "asked (tops)": cell["asked"], "solved (tops)": cell["solved"],
            "safe": safe.name if safe else NOTHING if cell["asked"] else "not asked",
            "setting": setting_words(safe.name, safe.setting) if safe else "",
        }  # fmt: skip
        for key, name in (("time", "seconds"), ("low", "low"), ("high", "high")):
            row[f"{key} (us)"] = US * value if np.isfinite(value := getattr(safe, name, np.nan)) else np.nan
        row |= {"safe lead": lead(cell["safe_called"], safe, marked),
                "hindsight": best.name if best else NOTHING if cell["asked"] else "not asked"}  # fmt: skip
        shares = {"share": "share", "share low": "low", "share high": "high", "level": "level", "meets": "met"}
        row |= {key: getattr(best, name, np.nan) for key, name in shares.items()}
        rows.append(row | {"hindsight lead": lead(cell["hindsight_called"], best, marked)})
    return pd.DataFrame(rows)


def confirmed(data: xr.DataTree) -> pd.DataFrame:
    """Settings run on other tops, one a row: the interpolated one, and the first that is safe, with its share."""
    header = ["variant", "error", "steps", "interpolated", "served", "share"]
    if cells.CONFIRMED not in data.children:
        return pd.DataFrame(columns=header)
    group = data[cells.CONFIRMED].to_dataset().isel(scene=0)
    rows = group[["interpolated", "served", "share"]].to_dataframe().dropna(subset=["interpolated"]).reset_index()
    rows["steps"] = [integrator(name).fixed_step for name in rows["variant"]]
    return rows.rename(columns={"target": "error"})[header].sort_values(["variant", "error"], ascending=[True, False])


def lead(called: bool, best: Any, marked: list[str]) -> str:
    """The text for a lead: "called", "price too noisy", "none", or "" without a winner."""
    return "" if best is None else "called" if called else "price too noisy" if best.name in marked else "none"


def price_list(data: xr.DataTree) -> pd.DataFrame:
    """Price of an evaluation and of a call, the spread between processes, and the kind of the inner loop."""
    known, rows = prices(data), []
    for place, name in enumerate(known.names):
        price, call = (float(part[0]) for part in known.at(name, np.array([TOLERANCE])))
        width, method = 1.96 * known.error[place], integrator(name)
        rows.append([name, method.needs or "", method.general, method.inner_loop or "", 1e9 * price,
                     1e9 * price * np.exp(-width), 1e9 * price * np.exp(width), US * call, known.spread[place],
                     name not in known.marked])  # fmt: skip
    header = ["variant", "needs", "for any body", "inner loop", "price (ns)", "low (ns)", "high (ns)", "call (us)",
              "spread", "ranked"]  # fmt: skip
    return pd.DataFrame(rows, columns=header)


def silent(data: xr.DataTree) -> pd.DataFrame:
    """Shares of all tops of a kind with wrong, silent and dropped runs, for well-known methods."""
    rows = []
    for name in (name for name in KNOWN if name in data["short"]["variant"].values):
        runs = cells.health(data, name)
        for level in (int(np.argmin(np.abs(runs.setting - steps))) for steps in STEPS):
            for k, kind in enumerate(KINDS[:-1]):
                shares = (part[level, k] / max(runs.drawn[k], 1.0) for part in (runs.wrong, runs.silent, runs.dropped))
                rows.append([name, runs.setting[level], kind, int(runs.drawn[k]), *shares])
    header = ["variant", "steps a nutation", "kind of top", "tops", "wrong", "silent", "dropped"]
    return pd.DataFrame(rows, columns=header)


def checked(data: xr.DataTree) -> pd.DataFrame:
    """The predicted cells of the map that were run, with the ratio of measured to predicted errors."""
    runs = far.checks(data)
    cells = runs.groupby(list(runs.columns[:-2]), sort=False)
    table = cells.agg(runs=("told", "size"), told=("told", "sum"), least=("ratio", "min"), median=("ratio", "median"),
                      most=("ratio", "max")).reset_index()  # fmt: skip
    return table.rename(columns={"target": "error", "horizon": "nutations", "told": "meet or miss it as predicted",
                                 "least": "measured / predicted error, least"})  # fmt: skip
