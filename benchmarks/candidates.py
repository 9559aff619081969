"""The methods that `recommend` tries first: their table, made from a stored study, and advice against all candidates.

    python -m benchmarks.candidates make results/cost.nc    # writes symtop/measure/candidates.tsv
    python -m benchmarks.candidates check 200               # of drawn scenes; exit code 1 if the table fails

A row of the table is a greedy cover of the random tops of the study: the variant that costs at most `TIE` times the
least on most of them, then the one that does so on most of those that are left, and so on. One whose cost is next to
the least on a few hard tops comes before a second one that is good where the first is.

A check draws scenes that the table was not made from, with accuracies and lengths of its own. What a method costs is
foreseen by the run that its search over the whole horizon ends with (`symtop.measure.settings`): its force evaluations,
moved to the very accuracy along the method's order, times the seconds of one, and the seconds of a call. The settings
of those that are foreseen to be within `NEXT` of the least, and of the table's, are then corrected as the advice
corrects its own, and their runs are timed against each other and against the very run that is advised, `ROUNDS` times
in turn. That one, and the best of the table's, are compared with the least.
"""

import argparse
import functools
import itertools
import math
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr

import symtop
from symtop import advise
from symtop.core import netcdf
from symtop.measure import ranking, settings
from symtop.measure.ranking import MENU_SIZE
from symtop.methods.framework.registry import NEEDS, integrator
from symtop.run.simulation import likely_step

PRICED_AT = 1e-8  # tolerance at which the study takes the price of an evaluation
TIE = 1.1  # costs with a ratio below this count as equal
SHARE = 0.95  # of the scenes need a method of the table that costs at most `TIE` times the least
CLASSES = {ranking.ANY: advise.OF_ANY, **{need: (need,) for need in NEEDS if need != "solution"}}
SEED = 2027  # of the scenes of a check; the study draws with another
SPANS, ACCURACIES = (3.0, 300.0), (1e-10, 1e-3)  # ranges in which nutations and errors are drawn, log-uniformly
QUANTITIES = ("axis", "axis", "axis", "attitude", "energy")
PRICED = 1e-6  # accuracy of the runs that prices are computed from
NEXT, ROUNDS = 1.5, 25  # variants are timed up to this predicted cost over the least; rounds of timing
ADVISED = "advised"  # name of the advised run
PATIENCE = 8.0  # a run may be predicted to take this many times the least cost so far
MOST = 1e6  # most evaluations of such a run
LONGEST = 1e7  # most evaluations of a compiled trial of the advice: trials with more take minutes
SHORT = 0.01  # nutations of a run of few steps, whose time is that of a call


def cover(costs: np.ndarray, count: int) -> list[int]:
    """Indices of up to `count` variants, one of which costs at most `TIE` times the least on as many tops as possible.

    `costs` is (variants, tops), infinite where a variant misses the target. Among equals the smaller mean excess is
    first; variants that always miss it are left out.
    """
    best = costs.min(axis=0)
    ratio = costs[:, np.isfinite(best)] / best[np.isfinite(best)]
    least, chosen = np.full(ratio.shape[1], np.inf), list[int]()
    for _ in range(min(count, int(np.isfinite(ratio).any(axis=1).sum()))):
        met = np.minimum(ratio, least)
        value = (met <= TIE).mean(axis=1) - 1e-2 * np.log(np.minimum(met, 1e3)).mean(axis=1)
        value[[*chosen, *np.flatnonzero(~np.isfinite(ratio).any(axis=1))]] = -np.inf
        chosen.append(int(value.argmax()))
        least = met[chosen[-1]]
    return chosen


def table(data: xr.DataTree) -> list[str]:
    """The lines of the table, from the dataset of the study of cost."""
    prices = data["prices"].to_dataset()[["price", "call"]].sel(priced_at=PRICED_AT, method="nearest").median("scene")
    lines = ["nutations\tquantity\taccuracy\tneeds\tgeneral\tvariants"]
    for span in ("short", "long"):
        group = data[span].to_dataset().isel(scene=0)
        price, names = prices.sel(variant=group["variant"].values), group["variant"].values
        seconds = (group["cost"] * price["price"] + price["call"]).fillna(np.inf)
        cases = itertools.product(group["quantity"].values, group["target"].values, CLASSES, (False, True))
        for quantity, target, need, general in cases:
            rows = np.isin(group["needs"].values, CLASSES[need]) & ((group["general"].values == 1.0) | (not general))
            costs = seconds.sel(quantity=quantity, target=target).transpose("variant", "member").values[rows]
            chosen = [str(names[rows][place]) for place in cover(costs, MENU_SIZE)] if rows.any() else []
            key = f"{float(group['nutations'].max()):g}", quantity, f"{target:g}", need, "yes" if general else "no"
            lines += ["\t".join((*key, " ".join(chosen)))] if chosen else []
    return lines


def scenes(count: int) -> "list[tuple[symtop.Scene, str, float]]":
    """Drawn scenes, each with a quantity and an accuracy that the reference can judge, below the nutation's width."""
    members = symtop.population(2 * count, seed=SEED)
    rng, chosen = np.random.default_rng(SEED), list[tuple[symtop.Scene, str, float]]()
    for k, row in enumerate(np.stack([members[name].values for name in symtop.model.top.NUMBERS], axis=1).tolist()):
        spans, accuracies = (np.exp(rng.uniform(*np.log(ends))) for ends in (SPANS, ACCURACIES))
        top, start, quantity = symtop.SymmetricTop(*row[:3]), symtop.Angles(*row[3:]), QUANTITIES[k % len(QUANTITIES)]
        period = top.nutation_period(start)
        if len(chosen) < count and math.isfinite(period):
            scene = symtop.Scene(f"drawn-{k}", top, start, float(spans) * period)
            if settings.judgeable(scene, quantity, scene.horizon) <= 0.1 * accuracies:
                chosen.append((scene, quantity, float(accuracies)))
    return chosen


@functools.cache
def prices(quantity: str) -> dict[str, tuple[float, float]]:
    """Seconds of an evaluation and of a call of each candidate, from two runs on one scene, timed against each other.

    As in the study, methods that conserve the energy are not asked for it: any step would meet the accuracy.
    """
    scene = symtop.scene("goldstein")
    known = advise._usable(advise._Question(scene, PRICED, quantity, scene.horizon, advise.OF_ANY))
    methods = [method for method in map(integrator, known) if quantity not in (method.conserves or ())]
    runs = []
    for horizon in (scene.horizon, SHORT * scene.nutation_period):
        step = functools.partial(likely_step, scene, horizon=horizon, accuracy=PRICED)
        pairs = [(method, step(method) if method.fixed_step else PRICED) for method in methods]
        attempts = [settings.attempt(scene, method, setting, horizon, quantity) for method, setting in pairs]
        seconds = np.array(settings.seconds(scene, attempts, quantity, horizon))
        runs.append((seconds, [attempt.evaluations for attempt in attempts]))
    (long, n_long), (short, n_short) = runs
    price = (long - short) / np.subtract(n_long, n_short)
    call = np.maximum(short - price * n_short, 0.0)
    return {method.name: pair for method, *pair in zip(methods, price.tolist(), call.tolist(), strict=True)}  # type: ignore[misc]


def costs(question: advise._Question, advised: symtop.Advice, menu: list[str]) -> dict[str, float]:
    """Seconds of the candidates that meet the accuracy and may be the cheapest, of the table's, and of `ADVISED`."""
    scene, accuracy, quantity = question.scene, advise.SAMPLE_MARGIN * question.accuracy, question.quantity
    tariffs, first = prices(quantity), ranking.cheapest((), quantity, accuracy, 100.0)
    attempts, seconds = dict[str, settings.Attempt](), dict[str, float]()
    for name in sorted(tariffs, key=lambda name: (name not in first, -(integrator(name).order or 0))):
        price, call = tariffs[name]
        patience = math.inf if name in menu else min(PATIENCE * min(seconds.values(), default=math.inf) / price, MOST)
        attempt = settings.search(scene, integrator(name), accuracy, quantity, scene.horizon, patience=patience)
        if not attempt.why:
            attempts[name] = attempt
            part = settings.at_accuracy(attempt.integrator, attempt.error / accuracy)
            seconds[name] = attempt.evaluations * price * part + call
    least = min(seconds.values(), default=math.inf)
    near = {name: attempt for name, attempt in attempts.items() if seconds[name] <= NEXT * least or name in menu}
    for name, attempt in near.items():
        retry = settings.search(
            scene, attempt.integrator, accuracy, quantity, scene.horizon, attempt.setting, least=advise.CLOSE_TO_TARGET
        )  # fmt: skip
        near[name] = attempt if retry.why else retry
    if advised.integrator is not None:
        setting = float(advised.step_size or advised.tolerance or math.nan)
        near[ADVISED] = settings.attempt(scene, integrator(advised.integrator), setting, scene.horizon, quantity)
    return dict(zip(near, settings.seconds(scene, [*near.values()], quantity, scene.horizon, ROUNDS), strict=True))


class Row(NamedTuple):
    """A question, the advice and the cheapest method, and what the advised one costs over that, and the table's."""

    question: str
    advised: str
    best: str
    advice: float
    table: float  # excess of the best method that the table names


def excess(count: int) -> list[Row]:
    """The rows of drawn scenes on which something meets the accuracy."""
    rows = []
    for scene, quantity, accuracy in scenes(count):
        advised = symtop.recommend(scene, accuracy=accuracy, quantity=quantity)
        question = advise._Question(scene, accuracy, quantity, scene.horizon, ())
        seconds = costs(question, advised, menu := advise._menu(question))
        if seconds:
            words = f"{scene.name} {quantity} {accuracy:.1e} over {scene.horizon / scene.nutation_period:.3g} nutations"
            best = min(seconds, key=seconds.__getitem__)
            ratios = {name: cost / seconds[best] for name, cost in seconds.items()}
            table_ratio = min((ratios[name] for name in menu if name in ratios), default=math.inf)
            rows.append(Row(words, str(advised.integrator), best, ratios.get(ADVISED, math.inf), table_ratio))
    return rows


def main() -> int:
    """Make the table, or check the advice."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.candidates", description=__doc__.partition("\n")[0])
    modes = parser.add_subparsers(dest="action", required=True)
    modes.add_parser("make", help="write the table").add_argument("study", type=Path, help="dataset of the study cost")
    modes.add_parser("check", help="try the advice").add_argument("scenes", type=int, help="how many to draw")
    arguments = parser.parse_args()
    if arguments.action == "check" and arguments.scenes < 1:
        parser.error(f"scenes must be at least 1, not {arguments.scenes}")
    if arguments.action == "make":
        try:
            study = netcdf.read_any(arguments.study)
        except symtop.SymtopError as error:
            parser.error(str(error))
        Path(ranking.TABLE).write_text("\n".join(table(study)) + "\n", encoding="utf-8")
        return 0
    settings.MOST_EVALUATIONS["compiled"] = LONGEST
    rows = excess(arguments.scenes)
    for row in sorted(rows, key=lambda row: -row.advice):
        if row.advice > TIE:
            print(f"{row.question}: {row.advised} costs {row.advice:.2f} times {row.best}, the table's {row.table:.2f}")
    advice, menu = (np.mean([getattr(row, name) <= TIE for row in rows]) for name in ("advice", "table"))
    print(f"at most {TIE} times the best of all candidates, on {len(rows)} scenes:")
    print(
        f"  {menu:.1%} of the table's methods, {advice:.1%} of the advice, which settings and times of one run decide"
    )
    return int(menu < SHARE)


if __name__ == "__main__":
    sys.exit(main())
