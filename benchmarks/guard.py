"""The guard with and without the truth on the same runs: hits against false alarms, and silent wrong runs of bodies.

    python -m benchmarks.guard tops 3600        random tops, every method in its charts, over 10, 100 or 1000 nutations
    python -m benchmarks.guard bodies 5000      bodies of `symtop.run.ensemble.bodies`, over 1 to 100 natural periods
    python -m benchmarks.guard hostile 5000     thin, flat and almost round bodies, at rest and spinning, in any units
    python -m benchmarks.guard page             of the runs that were made: results/guard.json and its figure
    python -m benchmarks.guard tops 300 --ablate   runs with the guard less each check, and with other thresholds

Run k is drawn from a seed of its own; runs are kept in results/tables/guard-NAME.csv and not made again. The score of a
run is what the guard expects, infinite where it warns of something else; it warns from `EXPECTED` on, and another
limit gives another point of the curve. A run is wrong beyond `EXPECTED`. A run that ends early tells so itself and is
counted apart. SciPy's methods and those in software arithmetic run over ten periods at most. The truth is the closed
form of a top, and of a body heyoka's series in long double.
"""

import argparse
import csv
import functools
import itertools
import math
import random
import warnings
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple
from unittest import mock

import numpy as np

from benchmarks import measured, pages
from benchmarks.pages import Table
from symtop.core import netcdf
from symtop.methods.framework.calling import solve
from symtop.methods.framework.plan import Plan
from symtop.methods.framework.registry import Integrator, integrator, integrators
from symtop.model.body import Attitude, RigidBody
from symtop.model.charts import BODY, attitude_distance, axes, axis_distance
from symtop.model.scenes import Scene, closed_form
from symtop.model.top import Angles, SymmetricTop
from symtop.report import style
from symtop.run import guard
from symtop.run.ensemble.bodies import body_population, scenes_of
from symtop.run.ensemble.population import STRATA, population
from symtop.run.motion import ExactMotion, IntegratedMotion, Motion
from symtop.run.simulation import make_plan

CHUNK = 100
SEEDS = {"tops": 29, "bodies": 1125, "hostile": 1125}  # other bodies than those with which the guard was corrected
NUTATIONS = (10.0, 100.0, 1000.0)  # of tops
SAMPLES = {"tops": 501, "bodies": 201, "hostile": 201}
MOST_TURNS = 1e3  # most turns of a hostile body about any axis
TABLES = Path("results") / "tables"
ANSWER = (
    "Hardly. Of the wrong runs of tops the guard is silent on {silent[0]} with the closed form (exact) and on "
    "{silent[1]} with an integration in its place (series); of the correct ones it warns of {false[0]} and {false[1]}. "
    "On bodies, where it always integrates, it is silent on {silent[2]} wrong runs, on hostile ones on {silent[3]}. "
    "Wrong is off by more than {limit} rad."
)
CAPTION = (
    "Each limit of the guard's forecast gives a point, the dot is the limit that it has: higher is fewer silent wrong "
    "runs, further left fewer false alarms. "
    "The axis begins at 0.9. On bodies the guard integrates: two samples, symtop's `body_population` and a hostile "
    "one, of thin, flat and almost round bodies at rest or in fast rotation, in any units."
)


CHECKS: dict[str, dict[str, Any]] = {  # what is set in `symtop.run.guard` to switch a check off
    "small nutations grow": {"_instability": lambda *_: None},
    "errors grow beyond the probe": {"grown": lambda probe, *_, **__: float(probe.error.max())},
    "errors grow as an exponential": {"exponential": lambda *_: 0.0},
    "errors grow by a least part": {"LEAST_GROWTH": 0.0}, "rounding grows as n^1.5": {"ROUNDED_ERROR": 0.0},
    "symmetric methods, too": {"STABILITY_ERROR": math.inf},
    "the motion amplifies errors": {"_amplified": lambda *_: 0.0},
    "and the tolerance": {"_grown_tolerance": lambda *_: 0.0}, "luck at a pole": {"CLOSE_TO_POLE": 0.0},
    "the length of q drifts": {"_length_failure": lambda *_: None}, "tilt beside a pole": {"BESIDE_POLE": 0.0},
    "long probes at a pole": {"POLE_FACTOR": 1.0}, "a least probe": {"LEAST_PROBE": 0.0},
}  # fmt: skip
THRESHOLDS = (
    "PROBE_STEPS", "LEAST_PROBE", "LONGEST_PROBE", "PROBE_SHARE", "MOST_PROBED", "ROUNDED_ERROR", "PROBE_EVALUATIONS",
    "POLE_FACTOR", "MOST_WORK", "LOOSE_TOLERANCE", "LEAST_GROWTH", "OCCASIONAL", "CLOSE_TO_POLE", "PASSING_ERROR",
    "STABILITY_ERROR", "RESOLVED_TURN", "SMALL_TURN", "NONLINEAR_SHARE", "BESIDE_POLE", "FASTER",
)  # fmt: skip
SUMMED = ["runs", "guard", "wrong: silent", "worst silent (rad)", "correct: warned of", "ended early: warned of"]


class Run(NamedTuple):
    """One run: its problem and method, the guard's scores with and without the truth, and its error."""

    k: int
    stratum: str
    method: str
    needs: str
    chart: str
    control: str
    setting: float  # steps a period, or the tolerance
    periods: float
    whole: bool  # the guard's trial was the whole run
    outcome: str
    error: float  # rad, largest of the axis or of the attitude
    exact: float  # score with the truth; the next: with an integration
    series: float


def tops(k: int) -> tuple[Scene, random.Random]:
    """Top k: strata in turn."""
    names = [*STRATA]
    members = _population(names[k % len(names)], k // len(names) // CHUNK)
    member = members.isel(member=k // len(names) % CHUNK)
    numbers = {name: float(member[name]) for name in member.data_vars if name != "stratum"}
    top = SymmetricTop(*(numbers.pop(name) for name in ("I1", "I3", "mgl")))
    return Scene(f"{names[k % len(names)]}.{k}", top, Angles(**numbers), 1.0), random.Random(f"{SEEDS['tops']}/{k}")


@functools.lru_cache(maxsize=16)
def _population(stratum: str, block: int) -> Any:
    return population(CHUNK, seed=SEEDS["tops"] + block, kind=stratum)


@functools.lru_cache(maxsize=2)
def _bodies(block: int) -> list[Scene]:
    return scenes_of(body_population(CHUNK, seed=SEEDS["bodies"] + block))


def bodies(k: int) -> tuple[Scene, random.Random]:
    """Body k of the sampler of symtop."""
    scene = _bodies(k // CHUNK)[k % CHUNK]
    name = f"{scene.name.rpartition('-')[0]}.{k}"
    return Scene(name, scene.top, scene.start, 1.0), random.Random(f"{SEEDS['bodies']}/{k}")


def hostile(k: int) -> tuple[Scene, random.Random]:
    """Body k of this sampler."""
    draw = random.Random(f"hostile/{SEEDS['hostile']}/{k}")
    shape = draw.choice(["thin", "flat", "sphere", "any"])
    small = 10.0 ** draw.uniform(-6.0, -1.0)
    least = draw.uniform(0.1, 0.9)
    moments = {
        "thin": [small, 1.0, 1.0 + small * draw.uniform(-0.99, 0.99)],
        "flat": [least, 1.0 - least, 1.0 - 1e-6 * draw.random()],
        "sphere": [1.0, 1.0 + small * draw.random(), 1.0 - small * draw.random()],
        "any": [least, 1.0, draw.uniform(1.0 - 0.99 * least, 1.0 + 0.99 * least)],
    }[shape]
    draw.shuffle(moments)
    weight = draw.choice([0.0, 10.0 ** draw.uniform(-6.0, 0.0), 1.0, 10.0 ** draw.uniform(0.0, 4.0)])
    axis = draw.randrange(3)

    def direction() -> list[float]:
        """Any, or close to one of the axes."""
        spread = draw.choice([10.0, 10.0 ** draw.uniform(-9.0, -1.0)])
        return [spread * draw.gauss(0.0, 1.0) + (place == axis) for place in range(3)]

    centre, rates = direction(), direction()
    size = draw.choice([0.0 if weight else 1.0, 1.0, 10.0 ** draw.uniform(-3.0, 2.0)]) / math.hypot(*rates)
    turn = [draw.gauss(0.0, 1.0) for _ in range(4)]
    if draw.random() < 0.2:  # the centre of mass above or below the fixed point
        turn = [1.0, 1e-6 * draw.random(), 0.0, 0.0] if draw.random() < 0.5 else [1e-6 * draw.random(), 1.0, 0.0, 0.0]
    mass, clock = (10.0 ** draw.uniform(-9.0, 9.0) if draw.random() < 0.3 else 1.0 for _ in range(2))
    body = RigidBody(*(mass * part for part in moments), weight * mass / clock**2, tuple(centre))
    length = math.hypot(*turn)
    start = Attitude(tuple(part / length for part in turn), tuple(size * rate / clock for rate in rates))
    return Scene(f"{shape}.{k}", body, start, 1.0), draw


SAMPLERS = {"tops": tops, "bodies": bodies, "hostile": hostile}


def drawn(name: str, k: int) -> tuple[Scene, Integrator, str, Plan, float, float]:
    """Run k, 2 to 500 steps a period or a tolerance of 0.1 to 1e-13: this setting and the periods are the last."""
    scene, draw = SAMPLERS[name](k)
    of_top = name == "tops"
    known = [m for m in integrators().values() if m.control is not None and (of_top or BODY in m.solvers)]
    method = draw.choice(known)
    chart = draw.choice(method.charts()) if of_top else BODY
    period = scene.nutation_period
    if not math.isfinite(period):
        period = 10.0 * math.sqrt(scene.top.I1 / abs(scene.top.mgl))
    periods = draw.choice(NUTATIONS) if of_top else 10.0 ** draw.uniform(0.0, 2.0)
    steps, tolerance = 10.0 ** draw.uniform(0.3, 2.7), 10.0 ** draw.uniform(-13.0, -1.0)
    if method.implementation == "python" or method.speed < 0.1:  # seconds to minutes over more
        periods = min(periods, 10.0)
    if name == "hostile":
        periods = min(periods, 2.0 * math.pi * MOST_TURNS / (IntegratedMotion(scene).fast * period))
    horizon, setting = periods * period, steps if method.fixed_step else max(tolerance, method.least_tolerance)
    control = {"step_size": min(period / steps, horizon)} if method.fixed_step else {"tolerance": setting}
    scene = Scene(scene.name, scene.top, scene.start, horizon)
    plan, _ = make_plan(scene, method, **control, horizon=horizon, samples=SAMPLES[name])
    return scene, method, chart, plan, setting, periods


def outcome_and_error(scene: Scene, method: Integrator, chart: str, plan: Plan) -> tuple[str, float]:
    """The outcome of a run and its largest error, rad."""
    run = solve(method, chart, scene.top, scene.start, plan)
    good = run.outcome == "ok"
    return run.outcome, float(np.max(_errors(scene, chart, plan.times, run.states))) if good else math.inf


def run_of(name: str, k: int) -> Run:
    """Draw and make run k."""
    (scene, method, chart, plan, setting, periods), of_top = drawn(name, k), name == "tops"
    series, whole = score(IntegratedMotion(scene), method, chart, plan)
    exact, whole = score(ExactMotion(scene), method, chart, plan) if of_top else (math.nan, whole)
    outcome, error = outcome_and_error(scene, method, chart, plan)
    return Run(k, scene.name.split(".")[0], method.name, method.needs, chart, str(method.control), setting, periods,
               whole, outcome, error, exact, series)  # fmt: skip


def _errors(scene: Scene, chart: str, times: Any, states: Any) -> Any:
    """Errors of states against the truth, rad."""
    if not scene.of_body:
        return axis_distance(axes(chart, states), closed_form(scene).axis(times))
    truth = integrator("taylor-longdouble")
    true = solve(truth, BODY, scene.top, scene.start, Plan.until(times, truth.least_tolerance))
    return attitude_distance(states[:, :4], true.states[:, :4])


def score(motion: Motion, method: Integrator, chart: str, plan: Plan) -> tuple[float, bool]:
    """The error that the guard expects, rad, and whether its trial was the whole run."""
    expected = guard.forecast(motion.scene, method, chart, plan, motion)
    value = max(expected.axis_error, expected.rounding)
    silent = guard.trouble(motion, method, chart, plan, expected) is None
    return (value if silent or value > guard.EXPECTED else math.inf), expected.whole


def ablation(name: str, count: int) -> Table:
    """Counts of runs with the guard as it is, less each check, and with each threshold halved and doubled."""
    ways: dict[str, dict[str, Any]] = {"as it is": {"EXPECTED": guard.EXPECTED}}
    ways |= {f"less: {check}": values for check, values in CHECKS.items()}
    for threshold, factor in itertools.product(THRESHOLDS, (0.5, 2.0)):
        value = getattr(guard, threshold)
        entries = value if isinstance(value, dict) else dict(enumerate(np.atleast_1d(value).tolist()))
        scaled = {key: type(part)(factor * part) for key, part in entries.items()}
        ways[f"{threshold} times {factor:g}"] = {threshold: scaled[0] if isinstance(value, float | int) else scaled}
    tallies, total = {way: np.zeros(4, dtype=int) for way in ways}, np.zeros(4, dtype=int)
    for k in range(count):
        scene, method, chart, plan, *_ = drawn(name, k)
        outcome, error = outcome_and_error(scene, method, chart, plan)
        motion, good = (ExactMotion if name == "tops" else IntegratedMotion)(scene), outcome == "ok"
        kinds = good and error > guard.EXPECTED, good and error <= guard.EXPECTED, not good, good
        total += kinds
        for way, values in ways.items():
            with mock.patch.multiple(guard, **values):
                expected = guard.forecast(scene, method, chart, plan, motion)
                warned = guard.trouble(motion, method, chart, plan, expected) is not None
            wrong_size = abs(math.log10(np.clip(expected.axis_error, 1e-4, 1.0) / np.clip(error, 1e-4, 1.0))) > 1.0
            tallies[way] += np.logical_and(kinds, (not warned, warned, not warned, wrong_size))
    header = ["the guard", "wrong: silent", "right: warned of", "ended early: silent", "size off by ten"]
    rows = [[way, *map("{} of {}".format, counts, total)] for way, counts in tallies.items()]
    return Table(f"{count} {name}", header, rows)


def chunk(name: str, first: int) -> list[Run]:
    """Make `CHUNK` runs from number `first` on."""
    with warnings.catch_warnings(action="ignore"):
        return [run_of(name, k) for k in range(first, first + CHUNK)]


def kept(name: str) -> list[Run]:
    """The stored runs of a sampler."""
    path = TABLES / f"guard-{name}.csv"
    if not path.exists():
        return []
    with path.open() as file:
        return [
            Run(*(kind(value) if kind is not bool else value == "True"
                  for value, kind in zip(row, Run.__annotations__.values(), strict=True)))
            for row in csv.reader(file)
        ]  # fmt: skip


def make(name: str, count: int, workers: int) -> None:
    """Make the runs that are missing."""
    TABLES.mkdir(parents=True, exist_ok=True)
    chunks = {run.k // CHUNK for run in kept(name)}
    missing = [place for place in range(math.ceil(count / CHUNK)) if place not in chunks]
    with ProcessPoolExecutor(workers) as pool, (TABLES / f"guard-{name}.csv").open("a") as file:
        for runs in pool.map(functools.partial(chunk, name), [place * CHUNK for place in missing]):
            csv.writer(file).writerows(runs)
            file.flush()


PARTS = {  # ranges of the error of runs that did not end early
    "beyond 10 limits": (10.0 * guard.EXPECTED, math.inf), "1 to 10 limits": (guard.EXPECTED, 10.0 * guard.EXPECTED),
    "a tenth to 1": (0.1 * guard.EXPECTED, guard.EXPECTED), "below a tenth": (-1.0, 0.1 * guard.EXPECTED),
}  # fmt: skip


def counts(runs: list[Run], guarded: str) -> list[str]:
    """Texts "warnings of runs", for the runs that ended early and for each of `PARTS`."""
    ended = [run for run in runs if run.outcome != "ok"]
    finished = [run for run in runs if run.outcome == "ok"]
    parts = [ended, *([run for run in finished if low < run.error <= high] for low, high in PARTS.values())]
    return [f"{sum(getattr(run, guarded) > guard.EXPECTED for run in part)} of {len(part)}" for part in parts]


def curve(runs: list[Run], guarded: str) -> tuple[Any, Any]:
    """Fractions of right and of wrong runs that are warned of, for every limit of the score."""
    finished = [run for run in runs if run.outcome == "ok"]
    score_of, wrong = np.array([[getattr(run, guarded), run.error > guard.EXPECTED] for run in finished]).T
    order = np.argsort(-score_of, kind="stable")
    wrong = wrong[order] > 0.0
    return np.cumsum(~wrong) / max((~wrong).sum(), 1), np.cumsum(wrong) / max(wrong.sum(), 1)


def grouped(runs: list[Run], field: str) -> dict[str, list[Run]]:
    """Runs grouped by the value of a field."""
    parts: dict[str, list[Run]] = {}
    for run in runs:
        value = getattr(run, field)
        name = ("the whole run tried" if value else "a piece tried") if field == "whole" else str(value)
        parts.setdefault(f"{value:g}" if field == "periods" else name, []).append(run)
    return dict(sorted(parts.items()))


def draw(known: dict[str, list[Run]], target: Path) -> None:
    """Curves of tops with and without the truth, one panel a horizon, and of bodies; a dot is the guard as it is."""
    style.use()
    figure, axes = style.panels(1, 4, height=2.6, sharey=True)
    tops_by = grouped([run for run in known["tops"] if run.periods in NUTATIONS], "periods")
    panels: list[tuple[str, list[tuple[str, list[Run], str, str]]]] = [
        (f"tops, {float(name):g} nutations",
         [("tops, closed form", runs, "exact", style.BLUE), ("tops, integration", runs, "series", style.VERMILLION)])
        for name, runs in sorted(tops_by.items(), key=lambda item: float(item[0]))
    ]  # fmt: skip
    bodies_shown = [
        ("bodies, symtop's", known["bodies"], "series", style.GREEN),
        ("bodies, hostile", known["hostile"], "series", style.PURPLE),
    ]
    for axis, (title, lines) in zip(axes.flat, [*panels, ("bodies", bodies_shown)], strict=True):
        for label, runs, guarded, color in lines:
            false, hits = curve(runs, guarded)
            axis.plot(np.maximum(false, 1e-4), hits, color=color, label=label)
            finished = [run for run in runs if run.outcome == "ok"]
            last = sum(getattr(run, guarded) > guard.EXPECTED for run in finished) - 1
            axis.plot(max(false[last], 1e-4), hits[last], "o", color=color)
        axis.set(
            xscale="log", xlim=(1e-4, 1.2), ylim=(0.9, 1.003), title=title, xlabel="share of correct runs\nwarned of"
        )
    axes[0, 0].set_ylabel("share of wrong runs warned of")
    style.legend_below(figure, axes)
    style.save(figure, target)


def summed(name: str, runs: list[Run], guarded: str) -> list[str]:
    """A row under `SUMMED`: numbers of wrong runs without a warning and of correct ones with one."""
    wrong = [run for run in runs if run.outcome == "ok" and run.error > guard.EXPECTED]
    right = [run for run in runs if run.outcome == "ok" and run.error <= guard.EXPECTED]
    silent = [run for run in wrong if not getattr(run, guarded) > guard.EXPECTED]
    false = sum(getattr(run, guarded) > guard.EXPECTED for run in right)
    return [
        f"{len(runs)} of {name}", guarded, f"{len(silent)} of {len(wrong)}",
        f"{max((run.error for run in silent), default=0.0):.2g}", f"{false} of {len(right)}", counts(runs, guarded)[0],
    ]  # fmt: skip


def page(results: Path) -> None:
    """Write the page: counts by population, and by stratum, class of method, horizon and control."""
    facts, known = measured.circumstances(), {name: kept(name) for name in SAMPLERS}
    header = ["runs", "guard", "ended early", *PARTS]
    rows = list[list[str]]()
    for name, all_runs in known.items():
        parts = {"all": all_runs}
        for field in ("whole", "control", *(("periods",) if name == "tops" else ()), "stratum", "needs"):
            groups = grouped(all_runs, field).items()
            parts |= {value if field == "whole" else f"{field} {value}": runs for value, runs in groups}
        for guarded in ("exact", "series") if name == "tops" else ("series",):
            rows += [[f"{name}: {part}", guarded, *counts(runs, guarded)] for part, runs in parts.items()]
    table = Table("Runs that the guard warned of, of all, by the error that they had", header, rows)
    print("\n".join(" | ".join(row) for row in [header, *rows]))
    summary = list[list[str]]()
    populations = {"tops": known["tops"], "bodies": known["bodies"], "hostile bodies": known["hostile"]}
    for name, runs in populations.items():
        for guarded in ("exact", "series") if name == "tops" else ("series",):
            summary.append(summed(name, runs, guarded))
    draw(known, results / "figures" / "guard-curves.png")
    words = written(summary, table, cases=sum(map(len, known.values())),
                    **measured.record(facts, "python -m benchmarks.guard"))  # fmt: skip
    netcdf.write_json(results / "guard.json", words)


def written(summary: list[list[str]], table: Table, **others: Any) -> dict[str, Any]:
    """The contents of results/guard.json: the rows under `SUMMED` and the counts."""
    alt = "Curves of wrong runs warned of against right runs warned of, near one."
    silent, false = ([row[column] for row in summary] for column in (2, 4))  # tops, with the closed form first
    words = pages.findings(
        "guard", "The guard without the truth", "Does the guard need to know the solution?", Table("", SUMMED, summary),
        f"Wrong: off by more than {guard.EXPECTED} rad at some sample. The margin of the guard in unstable motions was "
        "chosen, and its watch mended, on 19,600 bodies of other seeds, of which few wrong runs were silent, and three "
        "beyond ten limits (0.34, 0.51 and 2.9 rad): the steps of its watch damped the chaos of a needle and of a body "
        "that falls from rest and turns five times as fast as its natural period says, and two motions beside an "
        "unstable rotation stay 0.01 rad apart until they pass it again. These were mended, as was later, on 440 runs "
        "of free bodies beside such rotations, a piece that ended before the body turned over.",
        [table], answer=ANSWER.format(silent=silent, false=false, limit=guard.EXPECTED),
        captions={"curves": (CAPTION, alt)}, **others,
    )  # fmt: skip
    rows = [dict(zip(table.header, row, strict=True)) for row in table.rows]
    return words | {"pictures": [{"name": "curves", "file": "guard-curves.png"}], "counts": rows}


def main() -> None:
    """Make runs, or the page of those that were made."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("name", choices=[*SAMPLERS, "page"])
    parser.add_argument("count", type=int, nargs="?", default=CHUNK)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--ablate", action="store_true", help="sizes are compared between 1e-4 and 1 rad")
    options = parser.parse_args()
    if options.name == "page":
        page(Path("results"))
        return
    if options.ablate:
        warnings.simplefilter("ignore")
        print(ablation(options.name, options.count).text)
        return
    make(options.name, options.count, options.workers)
    for guarded in ("exact", "series") if options.name == "tops" else ("series",):
        print(pages.Table(options.name, SUMMED, [summed(options.name, kept(options.name), guarded)]).text)
    for run in kept(options.name):
        if run.outcome == "ok" and run.error > 10.0 * guard.EXPECTED and not run.series > guard.EXPECTED:
            print("silent and grossly wrong:", run)


if __name__ == "__main__":
    main()
