"""Facts and tables of the study."""

from collections import Counter
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from symtop.methods.framework.registry import NEEDS, integrator
from symtop.report.formats import duration, number
from symtop.run.guard import EXPECTED

from . import cells, far
from .cells import CLASSES, EVALUATIONS, Cell
from .ladder import KEPT, WRONG
from .prices import FLOOR, NOISY, PROCESSES, TOLERANCE, prices
from .ranking import SAFE, TIE, Safe
from .tops import KINDS, NATURAL

LEFT_OUT = {  # methods, by the reason, which the page states
    "the same maps in three coordinates": ("midpoint-unreduced", "trapezoidal-unreduced"),
    "the same steps as taylor in slower arithmetic": ("taylor-longdouble", "taylor-quad"),
    "a step of any size is the motion itself": ("exact-discrete",),
}  # fmt: skip
NOTHING = "no setting within the budget"
TIES = (1.0, 1.1, 1.25, 1.5)
STEPS = (4.37, 17.48, 69.92)  # a nutation, of the table of silent failures
QUOTED, FINE = "rk4[axis]", 69.92  # whose wrong runs the page quotes, at so many steps a nutation
KNOWN = (
    QUOTED, "dop853-compiled-fixed[axis]", "gauss-4[axis]", "strang[axis]", "takahashi-imada[axis]", "srkn-14-6[axis]",
    "midpoint[angles]", "stormer-verlet[angles]",
)  # fmt: skip
AT = 1e-6  # rad, the error at which classes are quoted
US = 1e6  # microseconds in a second


def decades(target: float) -> int:
    """The 6 of 1e-6."""
    return round(-np.log10(target))


def short_name(name: str) -> str:
    """A variant, without its chart if that is the axis."""
    return name.removesuffix("[axis]")


def titled(name: str) -> str:
    """The same in a table of classes, with the word for what exists for symmetric bodies alone."""
    method = integrator(name)
    return short_name(name) + ("" if method.general or method.needs == "this-top" else " (symmetric bodies)")


def setting_words(name: str, value: float) -> str:
    """A setting in a table: steps a nutation, or a tolerance."""
    return f"{value:.3g} steps" if integrator(name).fixed_step else f"tolerance {number(value, 1)}"


def facts(data: xr.DataTree) -> dict[str, Any]:
    """What is safe, and the fastest in hindsight; what is wrong unseen; the guard; the map; the prices; the effort."""
    spans = cells.horizons(data)
    known, group = prices(data), data["short"].to_dataset()
    made, evaluated = (sum(float(np.nansum(data[span][key].values)) for span in spans) for key in ("made", "evaluated"))
    return {
        "safe": SAFE, "tie": TIE, "wrong": WRONG, "kept": KEPT, "warned_above": EXPECTED, "near": far.TIE,
        "processes": PROCESSES, "floor": FLOOR, "noisy": NOISY, "within": cells.WITHIN, "often": cells.OFTEN,
        "at": AT, "longest": 10.0**far.LAST,
        **winners_facts(data), **{f"{part}_{span}": value for span in cells.HORIZONS
                                  for part, value in span_facts(data, span).items()},
        **silent_facts(data), **guard_facts(data), **far_facts(data),
        "variants": group.sizes["variant"],
        "marked": len(known.marked),
        "dense": known.sampled if np.isfinite(known.sampled) else None,  # price with dense output over heyoka's own
        "runs": made,
        "evaluations": evaluated,
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


def winners_facts(data: xr.DataTree) -> dict[str, Any]:
    """Safe choices and winners in hindsight for any body, the safe choice of each class, and where both agree."""
    named: dict[str, Any] = {}
    called = 0
    for target in cells.targets(data):
        one, place = cells.winner(data, Cell("short", "axis", target, NATURAL)), decades(target)
        called += bool(one["safe"] and one["safe_called"])
        named |= _safe(f"safe_{place}", one["safe"])
        best = one["hindsight"]
        fewest = cells.contest(data, Cell("short", "axis", target, NATURAL), EVALUATIONS).first
        named |= {f"best_{place}": short_name(best.name) if best else None,
                  f"best_{place}_share": best.share if best else None,
                  f"fewest_{place}": short_name(fewest.name) if fewest else None,
                  f"fewest_{place}_share": fewest.share if fewest else None}  # fmt: skip
    for needs in CLASSES[:-1]:
        choices, _ = cells.safest(data, Cell("short", "axis", AT, NATURAL, needs))
        best = choices[0] if choices and np.isfinite(choices[0].seconds) else None
        key = needs.replace("-", "_")
        named |= _safe(key, best) if choices else dict.fromkeys((key, f"{key}_seconds"))
    both = [one for one in cells.winners(data) if one["needs"] != "this-top" and one["safe"] and one["hindsight"]]
    named["cells"] = len(both) or None
    named["same"] = sum(one["safe"].name == one["hindsight"].name for one in both) if both else None
    return named | {"safe_called": called}


def _safe(key: str, one: Safe | None) -> dict[str, Any]:
    return {key: short_name(one.name) if one else NOTHING, f"{key}_seconds": one.seconds if one else None}


def silent_facts(data: xr.DataTree) -> dict[str, Any]:
    """Wrong and silent runs of `QUOTED` at `FINE` steps a nutation, on natural tops and on the kind with the most."""
    names = "quoted_steps", "natural_wrong", "natural_silent", "worst_kind", "worst_wrong", "worst_silent"
    if QUOTED not in data["short"]["variant"].values:
        return dict.fromkeys(names)
    one = cells.health(data, QUOTED)
    at = int(np.argmin(np.abs(one.setting - FINE)))
    wrong, silent = (part[at] / np.maximum(one.drawn, 1.0) for part in (one.wrong, one.silent))
    natural, worst = KINDS.index(NATURAL), int(np.argmax(wrong[:-1]))
    values = one.setting[at], wrong[natural], silent[natural], KINDS[worst], wrong[worst], silent[worst]
    return dict(zip(names, values, strict=True))


def guard_facts(data: xr.DataTree) -> dict[str, int]:
    """Runs that the guard was asked about and warned of: wrong ones by whether its trial covers them whole, others."""
    rows = cells.guard_counts(data)
    kinds = {"piece": [one for one in rows if not one["whole"]], "whole": [one for one in rows if one["whole"]]}
    wrong = {f"guard_{kind}{end}": sum(one[f"wrong{end}"] for one in part)
             for kind, part in kinds.items() for end in ("", "_warned")}  # fmt: skip
    return wrong | {f"guard_{key}{end}": sum(one[f"{key}{end}"] for one in rows)
                    for key in ("between", "right") for end in ("", "_warned")}  # fmt: skip


def far_facts(data: xr.DataTree) -> dict[str, Any]:
    """The map: who has the most cells, how many were predicted, and what the checks of those say."""
    names = "axis", "axis_share", "energy", "energy_share", "shape", "shape_share", "variants", "tops"
    named: dict[str, Any] = dict.fromkeys(
        (*(f"map_{name}" for name in names), "predicted", "checks", "checks_held", "checks_longest", "checks_low",
         "checks_middle", "checks_high")
    )  # fmt: skip
    if "far" not in data.children:
        return named
    reached = predicted = 0
    for quantity in far.QUANTITIES:
        panel = far.diagram(data, quantity)
        there = panel.winner >= 0
        reached, predicted = reached + int(there.sum()), predicted + int((panel.predicted & there).sum())
        area = Counter(panel.names[k] for k in panel.winner[there]).most_common(1)
        named |= {f"map_{quantity}": short_name(area[0][0]) if area else None,
                  f"map_{quantity}_share": area[0][1] / int(there.sum()) if area else None}  # fmt: skip
    checks = far.checks(data)
    ratios = np.concatenate([one.ratios[np.isfinite(one.ratios)] for one in checks]) if checks else np.empty(0)
    low, middle, high = np.quantile(ratios, (0.1, 0.5, 0.9)) if ratios.size else (None,) * 3
    return named | {
        "map_variants": len(far.variants_of(data, "axis")),
        "map_tops": data["far"].sizes["member"],
        "predicted": predicted / reached if reached else None,
        "checks": len(checks) or None,
        "checks_held": sum(one.holds for one in checks) if checks else None,
        "checks_longest": max((one.horizon for one in checks), default=None),
        "checks_low": low, "checks_middle": middle, "checks_high": high,  # error, measured over predicted
    }  # fmt: skip


# ---- tables ----------------------------------------------------------------------------------------------------------


def tables(data: xr.DataTree) -> dict[str, pd.DataFrame]:
    """What to use; winners in both protocols; by kind of top; other quantities; by tie; prices; silent runs; guard."""
    return {
        "use": use(data), "winners": winners(data, cells.winners(data)), "kinds": winners(data, by_kind(data)),
        "quantities": winners(data, other_quantities(data)), "ties": ties(data), "prices": price_list(data),
        "silent": silent(data), "guard": pd.DataFrame(cells.guard_counts(data)), "checks": checked(data),
    }  # fmt: skip


def use(data: xr.DataTree) -> pd.DataFrame:
    """The safe choice of each class at each error, over the shorter runs."""
    rows = []
    for needs in CLASSES[:-1]:
        supplied = f"{needs}: {NEEDS[needs]}" if needs != "this-top" else "this very top's equations, for no other body"
        line = {"you can supply": supplied}
        for target in cells.targets(data):
            one = cells.winner(data, Cell("short", "axis", target, NATURAL, needs))
            best, mark = one["safe"], "" if one["safe_called"] else "~ "
            words = NOTHING if one["asked"] else "not asked"
            if best is not None:
                words = f"{titled(best.name)}, {setting_words(best.name, best.setting)}, {duration(best.seconds)}"
            line[f"1e-{decades(target)} rad"] = f"{mark}{words}" if best else words
        rows.append(line)
    return pd.DataFrame(rows)


def winners(data: xr.DataTree, each: list[dict[str, Any]]) -> pd.DataFrame:
    """Cells, one a row: the safe choice with its time, and the winner in hindsight with its share."""
    marked, rows = prices(data).marked, []
    for one in each:
        safe, best = one["safe"], one["hindsight"]
        row = {
            **({"quantity": one["quantity"]} if one["quantity"] != "axis" else {}),
            "tops": one["tops"], "needs": one["needs"], "nutations": one["nutations"], "error": one["target"],
            "asked (tops)": one["asked"], "solved (tops)": one["solved"],
            "safe": short_name(safe.name) if safe else NOTHING if one["asked"] else "not asked",
            "setting": setting_words(safe.name, safe.setting) if safe else "",
        }  # fmt: skip
        row |= {f"{key} (us)": US * value if np.isfinite(value) else np.nan for key, value in
                zip(("time", "low", "high"), safe[2:5] if safe else (np.nan,) * 3, strict=True)}  # fmt: skip
        row |= {"safe lead": lead(one["safe_called"], safe, marked),
                "hindsight": short_name(best.name) if best else NOTHING if one["asked"] else "not asked"}  # fmt: skip
        row |= dict(zip(("share", "share low", "share high", "level", "meets"),
                        best[1:6] if best else (np.nan,) * 5, strict=True))  # fmt: skip
        rows.append(row | {"hindsight lead": lead(one["hindsight_called"], best, marked)})
    return pd.DataFrame(rows)


def lead(called: bool, best: Any, marked: list[str]) -> str:
    """Is the lead beyond the intervals?"""
    return "" if best is None else "called" if called else "price too noisy" if best.name in marked else "none"


def by_kind(data: xr.DataTree) -> list[dict[str, Any]]:
    """Cells of any body by kind of top."""
    return [cells.winner(data, Cell("short", "axis", target, kind))
            for kind in KINDS[:-1] for target in cells.targets(data)]  # fmt: skip


def other_quantities(data: xr.DataTree) -> list[dict[str, Any]]:
    """Cells of any body for the attitude and the energy."""
    return [cells.winner(data, cell) for quantity in ("attitude", "energy") for cell in cells.cells(data, quantity)]


def ties(data: xr.DataTree) -> pd.DataFrame:
    """The winner in hindsight if costs within another ratio are level."""
    rows = []
    for target in cells.targets(data):
        taken = cells.costs(data, Cell("short", "axis", target, NATURAL))
        solved = taken.values[:, np.isfinite(taken.values).any(axis=0)] if taken.values.size else taken.values
        for tie in TIES:
            level = solved < tie * (1.0 + 1e-12) * solved.min(axis=0, initial=np.inf)
            won = (level & (level.sum(axis=0) == 1)).mean(axis=1) if solved.size else np.zeros(1)
            first = short_name(taken.names[int(won.argmax())]) if won.any() else "none"
            rows.append([target, tie, first, float(won.max())])
    return pd.DataFrame(rows, columns=["axis error (rad)", "level within", "first", "share"])


def price_list(data: xr.DataTree) -> pd.DataFrame:
    """Price of an evaluation and of a call, the spread between processes, and what runs in the inner loop."""
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
    """Shares of all tops of a kind that are wrong, silent and dropped, of methods that people know."""
    rows = []
    for name in (name for name in KNOWN if name in data["short"]["variant"].values):
        one = cells.health(data, name)
        for at in (int(np.argmin(np.abs(one.setting - steps))) for steps in STEPS):
            for k, kind in enumerate(KINDS[:-1]):
                shares = (part[at, k] / max(one.drawn[k], 1.0) for part in (one.wrong, one.silent, one.dropped))
                rows.append([name, one.setting[at], kind, int(one.drawn[k]), *shares])
    header = ["variant", "steps a nutation", "kind of top", "tops", "wrong", "silent", "dropped"]
    return pd.DataFrame(rows, columns=header)


def checked(data: xr.DataTree) -> pd.DataFrame:
    """The predicted cells of the map that were run."""
    rows = []
    for one in far.checks(data):
        good = one.ratios[np.isfinite(one.ratios)]
        spread = np.quantile(good, (0.0, 0.5, 1.0)) if good.size else (np.nan,) * 3
        rows.append([one.quantity, one.target, one.horizon, short_name(one.winner), short_name(one.next), *spread,
                     one.holds])  # fmt: skip
    header = ["quantity", "error", "nutations", "winner", "next", "measured / predicted error, least", "median", "most",
              "meets the error"]  # fmt: skip
    return pd.DataFrame(rows, columns=header)
