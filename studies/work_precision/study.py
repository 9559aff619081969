"""Which method is the fastest at the accuracy I need?

Two rounds. First every method walks down to each target on every scene and over both horizons, all runs kept
(`measure/work.py`); then each scene's methods are timed against each other, alone (`measure/race.py`).
The dataset has dimensions scene, integrator, horizon (in nutation periods), setting (coarse to fine, each method its
own) and batch; `measure/ranking.py` answers questions from it.

    step_size or tolerance, steps, force_evaluations, newton_iterations, outcome, reached_time      of one run
    axis, attitude, theta, energy, p_phi, p_psi     largest error over the run;  _end at the horizon;  _bound the least
                                                    error the reference can judge
    nutation_period, precession_rate (and _bound)   relative errors of the mean frequencies
    shape, nutation_lag, precession_lag             parts of the axis error
    seconds, seconds_timed, seconds_foreseen, seconds_race, seconds_samples(batch), spread, reliable      see `race`
    first_call, seconds_overhead, seconds_per_evaluation, foreseen_miss, seconds_pace                     of a method
    stopped(horizon)                                why a method tried nothing finer
"""

from collections import Counter

import numpy as np
import xarray as xr

from symtop.measure import ranking
from symtop.measure.errors import QUANTITIES
from symtop.measure.phase import PARTS
from symtop.measure.timing import BATCH
from symtop.measure.work import TARGETS, spans, work_table
from symtop.methods.registry import integrator, integrators
from symtop.model.scenes import added_scenes, scene
from symtop.runner.study import Case, Picture, Study, Table

from . import figures, words
from .race import Entry, entries, race

SCENES = [
    "spheroid", "goldstein", "cusp", "loop", "wave", "fast", "steady", "hairer-lubich-wanner", "bruls-cardona-arnold",
]  # fmt: skip
PERIODS = ([10.0, 1000.0], [10.0, 100.0])  # in full, and quick
BUDGET = {"compiled": 1e6, "python": 2.5e4}  # force evaluations of one run
SOFTWARE = {"taylor-quad": 4e4}  # quadruple precision costs 2 us an evaluation
DECADES = tuple(10.0**-k for k in range(2, 14))
LEADERS = 9


def cases(quick: bool) -> list[Case]:
    """Every method on every scene; python methods and quadruple precision within a smaller budget."""
    grid = []
    for name in [*(SCENES[:2] if quick else SCENES), *added_scenes()]:
        for method in integrators().values():
            budget = SOFTWARE.get(method.name, BUDGET[method.tier]) / (20.0 if quick else 1.0)
            grid.append(Case(name, method.name, {"periods": PERIODS[quick], "budget": budget}))
    return grid


def follow_up(data: xr.Dataset) -> list[Case]:
    """One race a scene, of the runs that ended well."""
    grid = []
    periods = [float(value) for value in data["horizon"].values]
    quick = periods == PERIODS[True]
    pace = {"rounds": 4, "batch": 0.003} if quick else {"rounds": 5, "batch": BATCH}
    for name in data["scene"].values:
        runs = entries(data.sel(scene=name))
        names = list(dict.fromkeys(run.name for run in runs))
        settings = {"runs": runs, "integrators": names, "periods": periods, "size": data.sizes["setting"], **pace}
        grid.append(Case(str(name), "together", settings, timed=True))
    return grid


def measure(case: Case) -> xr.Dataset:
    """Errors and work of one method on a scene, or seconds of all of them."""
    where, options = scene(case.scene), case.settings
    horizons = spans(where, options["periods"])
    if case.timed:
        runs = [Entry(*run) for run in options["runs"]]
        found = race(where, horizons, runs, options["rounds"], options["batch"], options["size"])
    else:
        found = work_table(where, integrator(case.integrator), horizons, options["budget"])
    return found.assign_coords(horizon=options["periods"])


def pictures(data: xr.Dataset) -> list[Picture]:
    """Fronts at both horizons, winners, profiles, energy at the long horizon, and the parts of the error."""
    over, scenes = words.spans(data), [str(name) for name in data["scene"].values]
    drawn = []
    for name, far, cost, label in (
        ("front-short", 0, "seconds", "wall time of one run (s)"),
        ("front-long", -1, "seconds", "wall time of one run (s)"),
        ("front-evaluations", 0, "force_evaluations", "force evaluations of one run"),
    ):
        figure, on = figures.fronts(data.isel(horizon=far), "axis", cost, (label, f"largest {QUANTITIES['axis']}"))
        drawn.append(
            Picture(
                name,
                figure,
                f"Largest axis error {over[far]} against {label}; every method is a thin line. No compiled method is "
                f"below or left of the black step line, their front: {', '.join(on)} are on it. Dashed: methods whose "
                "inner loop is plain Python, with a front of their own. Grey: the reference's own bound. Runs that are "
                "raced are timed, the others' times are foreseen (`seconds_timed` says which).",
                f"Log-log work-precision plots of the axis error against {label}, one panel a scene.",
            )
        )
    wins = ranking.winners(data, DECADES)
    kept, uncounted = ranking.counted(data)
    counting = {key: won for key, won in wins.items() if key[0] in kept["scene"].values}
    count = Counter(won.best.integrator for won in counting.values() if won)
    most = ", ".join(f"{name} ({times})" for name, times in count.most_common(4))
    drawn.append(
        Picture(
            "winners",
            figures.winner_strips(wins, scenes, over, DECADES),
            f"The fastest compiled method for each decade of axis error. Most often: {most}, of {len(counting)} cells."
            f"{words.left_out(uncounted)} Pale and with a tilde: level with at least one other method. "
            "Methods were raced at 1e-3, 1e-6, 1e-9 and 1e-12; in between some times are foreseen.",
            "Coloured strips naming the fastest method, a row a scene, a column a decade of accuracy.",
        )
    )
    names = [str(n) for n in data["integrator"].values if "compiled" in data["tier"].sel(integrator=n).values]
    ratios = ranking.relative(ranking.costs(kept), names)
    shown = ranking.leaders(ratios.sel(integrator=names), LEADERS)
    shown += [name for name in ("midpoint", "stormer-verlet", "rk4", "rk45-compiled", "rk45") if name not in shown]
    drawn.append(
        Picture(
            "profiles",
            figures.profiles(ratios, shown, [f"axis error {target:.0e}" for target in TARGETS]),
            f"On how many of {ratios.sizes['problem']} scenes and horizons a method meets a target within a factor of "
            "the fastest compiled method's time. A curve's height at the left is the share it wins, its right end the "
            f"share it solves at all within {BUDGET['compiled']:.0e} force evaluations and a thousand times the best. "
            f"On the whole {shown[0]} is closest to the best, then {', '.join(shown[1:4])}.",
            "Performance profiles at four targets, one curve a method.",
        )
    )
    drawn.append(
        Picture(
            "energy-long",
            figures.small_multiples(
                data.isel(horizon=-1), [*words.STRUCTURE, *words.CLASSIC], "energy", "seconds",
                ("wall time of one run (s)", f"largest {QUANTITIES['energy']}"), (1e-16, 30.0),
            ),
            f"Energy error {over[-1]} against cost. {words.crossed(data)}",
            "Log-log plots of energy error against time at the long horizon for six methods, one panel a scene.",
        )
    )  # fmt: skip
    name = scenes[0]
    few = ["midpoint", "stormer-verlet", "takahashi-imada", "rk4", "rk45-compiled", "gauss-8"]
    cells = {f"{name}, {over[far]}": data.sel(scene=name).isel(horizon=far) for far in (0, -1)}
    drawn.append(
        Picture(
            "parts",
            figures.few_curves(cells, few, PARTS, "force_evaluations", "force evaluations of one run"),
            f"What the axis error on {name} is made of. From {data['horizon'].values[0]:g} to "
            f"{data['horizon'].values[-1]:g} nutation periods, at the same step or tolerance, the shape error grows "
            f"{words.growth(data.sel(scene=name), few, 'shape')}; the nutation lag "
            f"{words.growth(data.sel(scene=name), few, 'nutation_lag')}.",
            "Shape error, nutation lag and precession lag against work at two horizons.",
        )
    )
    return drawn


def tables(data: xr.Dataset) -> list[Table]:
    """Winners, and every method's cost."""
    found = []
    header = [f"axis error {target:.0e}" for target in TARGETS]
    for far, span in enumerate(words.spans(data)):
        winners, costs = [], []
        for name in data["scene"].values:
            cell = data.sel(scene=name).isel(horizon=far)
            for tier in ("compiled", "python"):
                won = [ranking.win(cell, target, tier=tier) for target in TARGETS]
                winners.append([str(name), tier, *(words.winner(one) for one in won)])
            reached = [{place.integrator: place for place in ranking.cheapest(cell, target)} for target in TARGETS]
            for method in cell["integrator"].values:
                row = [words.seconds(r[str(method)].cost) if str(method) in r else "-" for r in reached]
                costs.append([str(name), str(method), *row, str(cell["stopped"].sel(integrator=method).values)])
        found.append(Table(f"Fastest method to an axis error {span}", ["scene", "tier", *header], winners))
        columns = ["scene", "integrator", *header, "ended by"]
        found.append(Table(f"Time of every method to the same errors {span}", columns, costs))
    return found


def verdict(data: xr.Dataset) -> list[str]:
    """The fastest method for each scene, horizon and target, the crossover in energy, and what the times are worth."""
    kept, uncounted = ranking.counted(data)
    wins = [won for won in ranking.winners(kept).values() if won]
    count = Counter(won.best.integrator for won in wins)
    sentences = [
        f"Of {len(wins)} pairs of a problem and a target that somebody met, fastest is "
        + ", ".join(f"{name} on {times}" for name, times in count.most_common())
        + f"; {sum(won.reliable for won in wins)} of these leads are beyond the noise."
        + words.left_out(uncounted)
    ]
    sentences.append(f"Energy {words.spans(data)[-1]}: " + " ".join(words.crossings(data)))
    slow = [str(m) for m in data["integrator"].values if "python" in data["tier"].sel(integrator=m).values]
    if slow:
        sentences.append(
            f"Only compiled methods are ranked. Those in plain Python ({', '.join(slow)}) are ranked "
            "among themselves in the table; compare them with the rest by force evaluations."
        )
    sure = [won for won in wins if won.reliable and won.lead]
    timed, known = data["seconds_timed"].values == 1.0, np.isfinite(data["seconds"].values)
    miss = data["foreseen_miss"].values
    doubtful = int(np.sum(data["reliable"].values == 0.0))
    sentences.append(
        f"{int(timed.sum())} of {int(known.sum())} run times were measured; the others are foreseen from two measured "
        f"runs of the same method on the same scene. {sum(won.rival_timed for won in sure)} of {len(sure)} leads "
        f"beyond the noise are over a rival timed in the same race, any others over one that was foreseen. Where "
        f"such a forecast was then measured it was off by {np.nanmedian(miss):.0%} (median), {np.nanmax(miss):.0%} at "
        f"worst. {doubtful} of the measured times were too noisy to trust."
        if np.isfinite(miss).any()
        else f"{int(timed.sum())} of {int(known.sum())} run times were measured."
    )
    for name in data["scene"].values:
        for far, span in enumerate(words.spans(data)):
            cell = data.sel(scene=name).isel(horizon=far)
            sentences.append(
                f"{name}, axis error {span}: " + "; ".join(words.lead(target, cell) for target in TARGETS) + "."
            )
    return sentences


STUDY = Study(
    name="work_precision",
    title="Work and precision",
    question="Which method is the fastest at the accuracy I need?",
    how_to_read=(
        "Choose the error you can live with on the vertical axis and go right to the first curve. Seconds include the "
        "call of the compiled loop, about twenty microseconds, so all curves bend where runs are that short. A force "
        "evaluation is one evaluation of the equations of motion: a Newton iteration at one node, a kick, a stage, or "
        "one derivative of a Taylor series, which costs more the higher it is. A method's settings were sought so that "
        "they just meet 1e-3, 1e-6, 1e-9 and 1e-12; no fixed step is longer than a quarter "
        "of a nutation, and no run was longer than a million force evaluations (25 thousand in plain Python or "
        "quadruple precision). `exact` spends its time on constants in 40 digits, whatever the horizon."
    ),
    cases=cases,
    measure=measure,
    pictures=pictures,
    tables=tables,
    verdict=verdict,
    follow_up=follow_up,
    charts=words.charts,
    opening=words.opening,
    uses=lambda case: case.settings.get("integrators", [case.integrator]),
)
