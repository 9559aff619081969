"""The study's findings in sentences and tables, all of it from `facts`, and charts to point at."""

import math
from collections import Counter
from typing import Any

import numpy as np
import xarray as xr

from symtop.methods.framework.registry import NEEDS, integrator
from symtop.report.sentences import joined
from symtop.run.guard import EXPECTED
from symtop.runner.study import Chart, Opening, Series, Table

from . import cells, far
from .cells import CLASSES, GENERAL, POPULATIONS, Cell
from .ladder import KEPT, WRONG
from .prices import NOISY, TOLERANCE, prices
from .ranking import SAFE, TIE, Safe, Standing
from .tops import KINDS, NATURAL

Facts = dict[str, Any]
SHOWN = 15  # lines of a table of variants
TIES = (1.0, 1.1, 1.25, 1.5)
STEPS = (4.37, 17.48, 69.92)  # a nutation, of the table of silent failures
KNOWN = (
    "rk4[axis]", "dop853-compiled-fixed[axis]", "gauss-4[axis]", "strang[axis]", "takahashi-imada[axis]",
    "srkn-14-6[axis]", "midpoint[angles]", "stormer-verlet[angles]",
)  # fmt: skip
LEFT_OUT = {  # methods, by the reason
    "the same maps in three coordinates, at two to three times the time": (
        "midpoint-unreduced", "trapezoidal-unreduced",
    ),
    "the same steps as taylor in slower arithmetic, which meets smaller errors": ("taylor-longdouble", "taylor-quad"),
    "a step of any size is the motion itself, so that no step is too coarse": ("exact-discrete",),
}  # fmt: skip
HOW_TO_READ = (
    "A variant is a method in one chart. Cost is force evaluations times the price of one, plus one call. Safe: the "
    "one "
    f"setting, in steps a nutation or a tolerance, with which {SAFE:.0%} of the tops meet the error, and what it "
    "costs. "
    "In hindsight: the best setting for each top; a variant wins on a top if all others of its class cost at least "
    f"{TIE:g} times as much. Classes say what a method needs: "
    f"{'; '.join(f'{name}: {NEEDS[name]}' for name in CLASSES[:-1])}. "
    "Any body: all of these but this-top. Brackets hold 95 % of a bootstrap over the tops and the prices. ~ marks a "
    "lead that is inside them, * a variant whose price was too noisy to rank it. Not within the budget is no failure "
    "of "
    "a method: its runs were not allowed to take longer."
)


def seconds(value: float) -> str:
    """A time with two digits."""
    if not math.isfinite(value):
        return "over the budget"
    unit, scale = ("us", 1e6) if value < 9.95e-4 else ("ms", 1e3)
    return f"{float(f'{scale * value:.2g}'):g} {unit}"


def percent(value: float) -> str:
    """A share."""
    return f"{100.0 * value:.0f}%" if 0.095 <= value <= 0.995 or value in (0.0, 1.0) else f"{100.0 * value:.1f}%"


def setting_words(name: str, value: float) -> str:
    """A setting: steps a nutation, or a tolerance."""
    return f"{value:.3g} steps" if integrator(name).fixed_step else f"tolerance {value:.0e}"


def method(name: str) -> str:
    """A variant; without its chart if that is the axis."""
    return name.removesuffix("[axis]")


def safe_words(one: Facts, marked: list[str]) -> str:
    """The safe choice of a cell."""
    best: Safe | None = one["safe"]
    if best is None:
        return "not within the budget" if one["asked"] else "not asked"
    mark = "" if one["safe_called"] else "* " if best.name in marked else "~ "
    return (
        f"{mark}{method(best.name)}, {setting_words(best.name, best.setting)}, {seconds(best.seconds)} "
        f"({seconds(best.low)} to {seconds(best.high)})"
    )


def hindsight_words(one: Facts, marked: list[str]) -> str:
    """The winner of a cell in hindsight."""
    best: Standing | None = one["hindsight"]
    if best is None:
        return "not within the budget" if one["asked"] else "not asked"
    mark = "" if one["hindsight_called"] else "* " if best.name in marked else "~ "
    return f"{mark}{method(best.name)} {percent(best.share)} ({percent(best.low)} to {percent(best.high)})"


def make_facts(data: xr.DataTree) -> Facts:
    """Numbers and names of all that the page says."""
    known = prices(data)
    short = data["short"].to_dataset()
    spans = cells.horizons(data)
    checks = far.checks(data)
    made, evaluated = (sum(float(np.nansum(data[span][key].values)) for span in spans) for key in ("made", "evaluated"))
    return {
        "winners": cells.winners(data), "marked": known.marked, "sampled": known.sampled,
        "guard": cells.guard_counts(data), "checks": checks,
        "checks_held": sum(one.holds for one in checks),
        "spans": {span: (cells.nutations(data, span), cells.members(data, span)) for span in spans},
        "variants": short.sizes["variant"], "made": made, "evaluated": evaluated,
        "budget": {span: float(np.nanmax(data[span]["budget"].values)) / cells.nutations(data, span) for span in spans},
    }  # fmt: skip


def select(found: Facts, **wanted: Any) -> list[Facts]:
    """The winners' cells with these values."""
    return [one for one in found["winners"] if all(one[key] == value for key, value in wanted.items())]


def sentences(data: xr.DataTree) -> list[str]:
    """What to use, what changes in hindsight, silent failures, the guard, the phase diagram, prices and effort."""
    found = make_facts(data)
    nutations = found["spans"]["short"][0]
    here = select(found, tops=NATURAL, needs=GENERAL, nutations=nutations)
    choices = [f"{safe_words(one, found['marked'])} at {one['target']:.0e} rad" for one in here if one["safe"]]
    said = [
        f"For any body, safe on natural tops over {nutations:g} nutations: {'; '.join(choices)}.",
        hindsight_sentence(found, nutations), silent_sentence(data), guard_sentence(found), far_sentence(data, found),
        prices_sentence(found),
        f"{found['variants']} variants made {found['made']:,.0f} runs of {found['evaluated']:.2g} force evaluations on "
        + " and ".join(f"{count:,} tops over {span:g} nutations" for span, count in found["spans"].values()) + ".",
    ]  # fmt: skip
    return [sentence for sentence in said if sentence]


def hindsight_sentence(found: Facts, nutations: float) -> str:
    """In how many cells the winner in hindsight is the safe one."""
    cells = [one for one in found["winners"] if one["safe"] and one["hindsight"] and one["needs"] != "this-top"]
    same = sum(one["safe"].name == one["hindsight"].name for one in cells)
    here = select(found, tops=NATURAL, needs=GENERAL, nutations=nutations)
    told = [f"{hindsight_words(one, found['marked'])} at {one['target']:.0e} rad" for one in here if one["hindsight"]]
    return (
        f"In hindsight it is {'; '.join(told)}. In {same} of {len(cells)} cells of a class, a population, a run length "
        "and an error the safe choice is the winner in hindsight."
    )


def silent_sentence(data: xr.DataTree) -> str:
    """Wrong and silent runs of rk4[axis] by kind of top."""
    name = "rk4[axis]"
    if name not in data["short"]["variant"].values:
        return ""
    one = cells.health(data, name)
    at = int(np.argmin(np.abs(one.setting - STEPS[-1])))
    wrong, silent = (part[at] / np.maximum(one.drawn, 1.0) for part in (one.wrong, one.silent))
    natural, worst = KINDS.index(NATURAL), int(np.argmax(wrong))
    return (
        f"With {one.setting[at]:.3g} steps a nutation {name} is wrong, off by more than {WRONG:g} rad, on "
        f"{percent(wrong[natural])} of the natural tops and on {percent(wrong[worst])} of the {KINDS[worst]} ones; "
        f"silent, with energy and momenta kept to {KEPT:.0%}, on {percent(silent[natural])} and "
        f"{percent(silent[worst])}."
    )


def guard_sentence(found: Facts) -> str:
    """What the guard warns of, with what its trial covers whole apart."""
    total = {key: [sum(one[key] for one in found["guard"] if one["whole"] == whole) for whole in (False, True)]
             for key in found["guard"][0] if key not in {"variants", "whole"}}  # fmt: skip
    if not sum(total["wrong"]):
        return ""
    return (
        "The guard compares a trial piece of the run with the closed form, which only a body with a known solution "
        f"allows. It warned of {total['wrong_warned'][0]:,} of {total['wrong'][0]:,} wrong runs that its trial does "
        "not "
        f"cover whole (and of {total['wrong_warned'][1]:,} of {total['wrong'][1]:,} that it repeats whole), of "
        f"{sum(total['between_warned']):,} of {sum(total['between']):,} runs between {EXPECTED:g} and {WRONG:g} rad, "
        f"and of {sum(total['right_warned']):,} of {sum(total['right']):,} right ones."
    )


def far_sentence(data: xr.DataTree, found: Facts) -> str:
    """How much of the phase diagram was measured, and what the checks say."""
    panel = far.diagram(data, "axis")
    reached = panel.winner >= 0
    area = Counter(panel.names[k] for k in panel.winner[reached]).most_common(3)
    ratios = np.concatenate([one.ratios for one in found["checks"]]) if found["checks"] else np.empty(0)
    ratios = ratios[np.isfinite(ratios)]
    checked = (
        f" {len(found['checks'])} predicted cells at up to {max(one.horizon for one in found['checks']):.0e} nutations "
        f"were run: the predicted setting meets the error in {found['checks_held']}; a run's error is "
        f"{np.median(ratios):.2g} times the predicted one in the median (80 % from {np.quantile(ratios, 0.1):.2g} to "
        f"{np.quantile(ratios, 0.9):.2g})."
        if ratios.size
        else ""
    )
    return (
        f"Over runs of 10 to 10^{far.LAST:.0f} nutations the cheapest for the axis is "
        f"{joined([f'{name} in {count / reached.sum():.0%}' for name, count in area])} of the cells that a method "
        f"reaches; {(panel.predicted & reached).sum() / reached.sum():.0%} of them are predicted.{checked}"
    )


def prices_sentence(found: Facts) -> str:
    """Which prices were too noisy, and heyoka's beside symtop's call of it."""
    marked = f"{len(found['marked'])} of {found['variants']} prices" if found["marked"] else "No price"
    heyoka = (
        f" heyoka is priced as its own propagate_until; with dense output it takes {found['sampled']:.2f} times as "
        "long."
        if math.isfinite(found["sampled"])
        else ""
    )
    return f"{marked} had a spread above {NOISY:.0%} between processes, twice, and cannot win.{heyoka}"


# ---- tables ----------------------------------------------------------------------------------------------------------


def tables(data: xr.DataTree) -> list[Table]:
    """Winners, safe and in hindsight, of both populations; by kind; other quantities; prices; what is silent."""
    found = make_facts(data)
    return [
        *(winners_table(found, tops, protocol) for protocol in ("safe", "hindsight") for tops in POPULATIONS),
        kinds_table(data, found), quantities_table(data, found), ties_table(data), prices_table(data),
        silent_table(data), guard_table(found), checks_table(found), rules_table(data, found),
    ]  # fmt: skip


def winners_table(found: Facts, tops: str, protocol: str) -> Table:
    """A line a class, run length and error in the columns."""
    words = safe_words if protocol == "safe" else hindsight_words
    columns = sorted({(one["nutations"], -one["target"]) for one in found["winners"]})
    lines = []
    for needs in CLASSES:
        each = {(one["nutations"], -one["target"]): one for one in select(found, tops=tops, needs=needs)}
        lines.append([needs, *(words(each[column], found["marked"]) for column in columns)])
    asked = {(one["nutations"], -one["target"]): one["asked"] for one in select(found, tops=tops, needs=GENERAL)}
    title = {
        "safe": f"Safe: the cheapest of a class at the one setting with which {SAFE:.0%} of the {tops} tops meet the "
        "axis error, and its seconds",
        "hindsight": f"In hindsight: the cheapest of a class, beyond ties, on the most of the {tops} tops that one of "
        "the class solves, and its share",
    }[protocol]
    header = ["needs", *(f"{-target:.0e} over {span:g} ({asked[span, target]} tops)" for span, target in columns)]
    return Table(title, header, lines)


def kinds_table(data: xr.DataTree, found: Facts) -> Table:
    """Winners by kind of top."""
    lines = []
    for kind in KINDS[:-1]:
        for target in cells.targets(data):
            one = cells.winner(data, Cell("short", "axis", target, kind))
            lines.append([kind, f"{target:.0e}", f"{one['asked']}", safe_words(one, found["marked"]),
                          hindsight_words(one, found["marked"])])  # fmt: skip
    title = f"Winners for any body by kind of top, over {found['spans']['short'][0]:g} nutations"
    return Table(title, ["kind", "axis error (rad)", "tops", "safe", "in hindsight"], lines)


def quantities_table(data: xr.DataTree, found: Facts) -> Table:
    """Winners for the attitude and the energy."""
    lines = []
    for quantity in ("attitude", "energy"):
        for cell in cells.cells(data, quantity):
            one = cells.winner(data, cell)
            lines.append([quantity, f"{one['nutations']:g}", f"{one['target']:.0e}", f"{one['asked']}",
                          safe_words(one, found["marked"]), hindsight_words(one, found["marked"])])  # fmt: skip
    header = ["quantity", "nutations", "error", "tops", "safe", "in hindsight"]
    return Table("Winners for any body in attitude (rad) and relative energy, natural tops", header, lines)


def ties_table(data: xr.DataTree) -> Table:
    """The winner in hindsight if costs within another ratio are level."""
    lines = []
    for target in cells.targets(data):
        taken = cells.costs(data, Cell("short", "axis", target, NATURAL))
        solved = taken.values[:, np.isfinite(taken.values).any(axis=0)] if taken.values.size else taken.values
        line = [f"{target:.0e}"]
        for tie in TIES:
            level = solved < tie * (1.0 + 1e-12) * solved.min(axis=0, initial=np.inf)
            won = (level & (level.sum(axis=0) == 1)).mean(axis=1) if solved.size else np.zeros(1)
            line.append(
                f"{method(taken.names[int(won.argmax())])} {percent(float(won.max()))}" if won.any() else "level"
            )
        lines.append(line)
    header = ["axis error (rad)", *(f"level within {tie:g}" for tie in TIES)]
    return Table("Wins for any body by what counts as a tie, natural tops, ten nutations", header, lines)


def prices_table(data: xr.DataTree) -> Table:
    """Price of an evaluation and a call, the spread between processes, and what runs in the inner loop."""
    known, lines = prices(data), []
    for row, name in enumerate(known.names):
        price, call = known.at(name, np.array([TOLERANCE]))
        width = 1.96 * known.error[row]
        lines.append([
            name, integrator(name).needs or "", integrator(name).inner_loop or "", f"{1e9 * price[0]:.3g}",
            f"{1e9 * price[0] * math.exp(-width):.3g} to {1e9 * price[0] * math.exp(width):.3g}",
            f"{1e6 * call[0]:.2g}", f"{known.spread[row]:.0%}{' *' if name in known.marked else ''}",
        ])  # fmt: skip
    header = ["variant", "needs", "inner loop", "price (ns)", "95 %", "call (us)", "spread"]
    return Table(f"Price of a force evaluation and of a call, at {TOLERANCE:.0e} where it depends on it", header, lines)


def silent_table(data: xr.DataTree) -> Table:
    """Shares of all tops of a kind that are wrong, silent and dropped, of methods that people know."""
    lines = []
    for name in (name for name in KNOWN if name in data["short"]["variant"].values):
        one = cells.health(data, name)
        for steps in STEPS:
            at = int(np.argmin(np.abs(one.setting - steps)))
            shares = [[percent(part[at, k] / max(one.drawn[k], 1.0)) for part in (one.wrong, one.silent, one.dropped)]
                      for k in range(len(KINDS) - 1)]  # fmt: skip
            lines.append([name, f"{one.setting[at]:.3g}", *(" / ".join(part) for part in shares)])
    title = (
        f"Wrong (axis off by more than {WRONG:g} rad) / silent (wrong, ended well, energy and momenta kept to "
        f"{KEPT:.0%}) "
        f"/ dropped (over the budget), of all tops of a kind, over {cells.nutations(data, 'short'):g} nutations"
    )
    return Table(title, ["variant", "steps a nutation", *KINDS[:-1]], lines)


def guard_table(found: Facts) -> Table:
    """Every run that the guard was asked about, once."""
    lines = [
        [one["variants"], "whole" if one["whole"] else "a piece",
         *(f"{one[f'{key}_warned']:,} of {one[key]:,}" for key in ("wrong", "between", "right")),
         f"{one['wrong_seen']:,} of {one['wrong']:,}"]
        for one in found["guard"]
    ]  # fmt: skip
    header = ["variants", "trial covers", f"warned, above {WRONG:g} rad", f"{EXPECTED:g} to {WRONG:g} rad",
              f"below {EXPECTED:g} rad", f"above {WRONG:g} rad, energy or momenta off by {KEPT:.0%}"]  # fmt: skip
    return Table(f"The guard warns above {EXPECTED:g} rad; half of the tops are natural", header, lines)


def checks_table(found: Facts) -> Table:
    """The predicted cells that were run."""
    lines = []
    for one in found["checks"]:
        good = one.ratios[np.isfinite(one.ratios)]
        low, middle, high = np.quantile(good, (0.0, 0.5, 1.0)) if good.size else (math.nan,) * 3
        lines.append([one.quantity, f"{one.target:.0e}", f"{one.horizon:.0e}", one.winner, one.next,
                      f"{middle:.2g} ({low:.2g} to {high:.2g})", "yes" if one.holds else "no"])  # fmt: skip
    header = ["quantity", "error", "nutations", "winner", "next", "measured over predicted error", "meets the error"]
    return Table(f"Predicted cells of the phase diagram, run in full on {far.CHECKED_TOPS} natural tops", header, lines)


def rules_table(data: xr.DataTree, found: Facts) -> Table:
    """Which runs were made."""
    long = [str(name) for name in data["long"]["variant"].values] if "long" in data.children else []
    rules = {
        "strata": "symtop.population: slow 25 %, fast 25 %, grazing 15 %, near-separatrix 10 %, hanging 10 %, "
        "sleeping 15 % of the tops; where kinds are pooled, these are the weights",
        "natural": "homogeneous spheroids about a pole of their surface, axes of ratio 1/4 to 4; axis isotropic; spin "
        "log-uniform from 1/16 to 32 sleeping thresholds; velocity of the axis up to 2 sqrt(mgl/I1)",
        "settings": "steps that are halved, or tolerances divided by ten; the coarsest has 1.1 steps a nutation, for "
        "the energy 4.4",
        "budget of a run": ", ".join(f"{budget:,.0f} evaluations a nutation over {found['spans'][span][0]:g} nutations"
                                     for span, budget in found["budget"].items()),
        "long runs": f"of the {len(long)} variants within {cells.WITHIN:g} times the least cost of their class on "
        f"{cells.OFTEN:.0%} of the tops over ten nutations; others are not run and not ranked there",
        "tops that are asked": "those whose nutation is wider than the error, and where this is at least ten times the "
        "error of the truth",
        "meets": "of all tops that are asked; wins: of those that a variant of the class solves",
        **{f"left out: {' and '.join(names)}": why for why, names in LEFT_OUT.items()},
    }  # fmt: skip
    return Table("Which runs were made", ["what", "rule"], [list(rule) for rule in rules.items()])


# ---- the first screen, and charts ------------------------------------------------------------------------------------


def opening(data: xr.DataTree) -> Opening:
    """What to use, by what you have: safe settings on natural tops over ten nutations."""
    found = make_facts(data)
    nutations = found["spans"]["short"][0]
    targets = cells.targets(data)
    lines = []
    for needs in CLASSES[:-1]:
        each = {one["target"]: one for one in select(found, tops=NATURAL, needs=needs, nutations=nutations)}
        label = f"{needs}: {NEEDS[needs]}" if needs != "this-top" else "this very top's equations (no other body)"
        lines.append([label, *(safe_words(each[target], found["marked"]).split(" (")[0] for target in targets)])
    lines.append(["a heavy symmetric top and nothing else", *["exact, the closed form: no integrator"] * len(targets)])
    title = f"Safe settings: {SAFE:.0%} of natural tops keep the axis error over {nutations:g} nutations"
    said = [
        *sentences(data)[:2],
        (
            "This very top has a closed form (exact), which needs no integrator. Methods are compared for bodies "
            "without one; what was made for this top stands in a line of its own."
        ),
        silent_sentence(data),
        "A variant is a method in one chart, which is the axis where none is named.",
        "For your own scene and accuracy: symtop recommend SCENE --accuracy 1e-6.",
    ]
    table = Table(title, ["you can supply", *(f"{target:.0e} rad" for target in targets)], lines)
    explained = {"stability": "where variants fail", "factors": "what makes the difference"}
    return Opening("Which integrator should I use?", [one for one in said if one], table, explained)


def charts(data: xr.DataTree) -> list[Chart]:
    """Axis error against cost of every run on the named scenes, a panel a scene and run length."""
    names = [str(name) for name in data["tops"]["scene_name"].sel(scene="short").values.ravel() if str(name)]
    panels: dict[str, dict[str, list[Series]]] = {"seconds": {}, "evaluations": {}}
    known = prices(data)
    for span in cells.horizons(data):
        group = data[span].to_dataset().isel(scene=0)
        for place, scene in enumerate(names):
            label = f"{scene}, {cells.nutations(data, span):g} nutations"
            for cost, into in panels.items():
                series = []
                for name in map(str, group["variant"].values):
                    one = group.sel(variant=name)
                    work, error = (
                        one[key].transpose("level", "named").values[:, place] for key in ("scene_work", "scene_error")
                    )
                    good = np.isfinite(work) & np.isfinite(error) & (error > 0.0)
                    settings, x = one["setting"].values[good], work[good]
                    if cost == "seconds":
                        fixed = str(one["control"].values) == "step_size"
                        price, call = known.at(name, np.where(fixed, np.nan, settings))
                        x = x * price + call
                    points = [(float(f"{a:.3g}"), float(f"{b:.3g}"), f"{setting_words(name, c)}, error {b:.1e}")
                              for a, b, c in zip(x, error[good], settings, strict=True)]  # fmt: skip
                    series.append(Series(name, points))
                into[label] = series
    axes = {"seconds": "evaluations x price + call (s)", "evaluations": "force evaluations"}
    return [Chart(cost, f"Every run on the named scenes, by {cost}", axes[cost], "largest axis error (rad)", each)
            for cost, each in panels.items()]  # fmt: skip
