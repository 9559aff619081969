"""Where does each method fail as its step grows, and how?"""

import math

import numpy as np
import xarray as xr

from symtop.integrators.registry import integrator, integrators
from symtop.measure.accuracy import knobs
from symtop.measure.errors import errors
from symtop.measure.verdicts import ACCURATE, VERDICTS
from symtop.measure.verdicts import verdict as judge
from symtop.reference import reference
from symtop.report import figures
from symtop.scenes import Scene, added_scenes, closed_form, scene
from symtop.simulate import simulate
from symtop.study.study import Case, Picture, Study, Table

SCENES = ["spheroid", "goldstein", "fast", "bruls-cardona-arnold"]
PERIODS = 40.0
GRAZING = 1e-3  # rad
FINEST, COARSEST = 0.002, 2.0  # nutation periods


def cases(quick: bool) -> list[Case]:
    """Steps from 1/500 of a nutation to two of them; tolerances from 1e-10 to 0.5."""
    count = 24 if quick else 97
    steps = np.geomspace(FINEST, COARSEST, count).tolist()
    tolerances = np.geomspace(1e-10, 0.5, max(count // 4, 12)).tolist()
    grid = []
    for name in [*(SCENES[:3] if quick else SCENES), *added_scenes()]:
        for method in integrators().values():
            ladder = {"step_size": steps, "tolerance": tolerances}.get(method.knob or "", [math.nan])
            if method.name == "radau":  # 1 s a run at 1e-10
                ladder = [value for value in tolerances if value > 1e-6]
            grid.append(Case(name, method.name, {"periods": PERIODS, "ladder": ladder}))
    return grid


def measure(case: Case) -> xr.Dataset:
    """What became of one run at each setting: outcome, verdict, axis error and the step in nutation periods."""
    where, method = scene(case.scene), integrator(case.integrator)
    period = where.nutation_period
    horizon = case.settings["periods"] * period
    rows: list[tuple[float, float, float, str, str]] = []
    for value in case.settings["ladder"]:
        setting = value * period if method.knob == "step_size" else value
        knob = knobs(method, setting)
        run = simulate(where, method, **knob, horizon=horizon, samples=241, observe="axis", guard=False)
        error = errors(where, run, reference(where, run["time"].values, "closed-form"))["axis"].values
        mean_step = run.attrs["reached_time"] / max(run.attrs["steps"], 1) / period
        relative = value if method.knob == "step_size" else mean_step
        worst = float(np.max(error)) if run.attrs["outcome"] == "ok" else math.nan
        rows.append((value, relative, worst, run.attrs["outcome"], judge(where, run, error)))
    columns = list(zip(*rows, strict=True))
    names = ("knob", "relative_step", "axis", "outcome", "verdict")
    table = {name: ("setting", list(column)) for name, column in zip(names, columns, strict=True)}
    return xr.Dataset({**table, "knob_name": method.knob or "none"})


def pictures(data: xr.Dataset) -> list[Picture]:
    """One figure a scene, one strip an integrator."""
    return [
        Picture(
            f"outcomes-{name}",
            figures.outcome_strips(data, [str(name)], VERDICTS),
            f"What became of runs on {name} over {PERIODS:g} nutation periods as the step grows. Accurate means an "
            f"axis error of at most {ACCURATE:g} rad throughout. Failed runs are shown as failures, never left out.",
            f"Coloured strips for {name}, one an integrator, showing what became of its runs as steps grow.",
        )
        for name in data["scene"].values
    ]


FAILURES = VERDICTS[4:]  # the run ended early


def limits(data: xr.Dataset, name: str, method: str) -> tuple[float, float, str]:
    """Largest knob below which every run is accurate, smallest knob at which a run failed, and how it failed."""
    cell = data.sel(scene=name, integrator=method)
    known = cell["verdict"].values != ""
    knob, words = cell["knob"].values[known], cell["verdict"].values[known]
    bad, failed = np.flatnonzero(words != "accurate"), np.flatnonzero(np.isin(words, FAILURES))
    last = (bad[0] if bad.size else knob.size) - 1
    accurate = float(knob[last]) if last >= 0 else math.nan
    return accurate, float(knob[failed[0]]) if failed.size else math.nan, str(words[failed[0]]) if failed.size else ""


def gap_to_pole(name: str) -> float:
    """The closest that the axis of a scene comes to a pole, in radians."""
    low, high = closed_form(scene(name)).theta_range
    return min(low, math.pi - high)


def grazing(data: xr.Dataset) -> list[str]:
    """Scenes that come close to a pole, and what that does to methods whose chart ends there."""
    sentences = []
    for name in data["scene"].values:
        where, gap = scene(str(name)), gap_to_pole(str(name))
        if gap > GRAZING:
            continue
        words = data["verdict"].sel(scene=name)
        angles = [str(m) for m in data["integrator"].values if integrator(str(m)).charts() == ("angles",)]
        others = [str(m) for m in data["integrator"].values if str(m) not in angles]
        never = [m for m in angles if not (words.sel(integrator=m) == "accurate").any()]
        good = [m for m in others if (words.sel(integrator=m) == "accurate").any()]
        sentences.append(
            f"On {name} the axis passes a pole at {math.degrees(gap):.1e} degrees, where phi' rises to "
            f"{_fastest(where):.1e} rad/s within an instant: of {len(angles)} methods in the angles chart {len(never)} "
            f"are accurate at no setting tried, while {len(good)} of {len(others)} methods in charts without poles are."
        )
    return sentences


def _fastest(where: Scene) -> float:
    """The largest precession rate, at the turning point next to the pole."""
    theta = min(closed_form(where).theta_range, key=math.sin)
    momenta = where.top.momenta(where.start)
    x = 0.5 * theta
    return abs(momenta.north / math.sin(x) ** 2 + momenta.south / math.cos(x) ** 2) / (4.0 * where.top.I1)


def tables(data: xr.Dataset) -> list[Table]:
    """Limits of accuracy and of survival."""
    rows = []
    for name in data["scene"].values:
        for method in data["integrator"].values:
            accurate, failed, how = limits(data, str(name), str(method))
            words = data["verdict"].sel(scene=name, integrator=method).values
            counts = {word: int(np.sum(words == word)) for word in VERDICTS}
            rows.append(
                [
                    str(name),
                    str(method),
                    _unit(data, str(method)),
                    f"{accurate:.2g}" if math.isfinite(accurate) else "none",
                    f"{failed:.2g} ({how.replace('_', ' ')})" if how else "never",
                    ", ".join(f"{word.replace('_', ' ')} {n}" for word, n in counts.items() if n),
                ]
            )
    header = ["scene", "integrator", "limits in", "accurate up to", "first failure at", "runs by verdict"]
    return [Table("Limits of accuracy and of survival", header, rows)]


def _unit(data: xr.Dataset, method: str) -> str:
    knob = str(data["knob_name"].sel(integrator=method).values[0])
    return {"step_size": "nutation periods", "tolerance": "tolerance"}.get(knob, "nothing to turn")


def verdict(data: xr.Dataset) -> list[str]:
    """How far the methods go, which of them never fail, and how the others do."""
    calm = [str(name) for name in data["scene"].values if gap_to_pole(str(name)) > GRAZING]
    sentences = []
    for unit, thing in (("nutation periods", "steps"), ("tolerance", "tolerances")):
        reach, first = [], {}
        for method in data["integrator"].values:
            if _unit(data, str(method)) != unit:
                continue
            found = [(*limits(data, name, str(method)), name) for name in calm]
            reach.append((min(accurate if math.isfinite(accurate) else 0.0 for accurate, *_ in found), str(method)))
            first[str(method)] = min(((at, how, name) for _, at, how, name in found if how), default=None)
        if not reach:
            continue
        reach.sort(reverse=True)
        ending = " of a nutation" if thing == "steps" else ""
        best = ", ".join(f"{name} ({value:.2g})" for value, name in reach[:5])
        worst = ", ".join(f"{name} ({value:.2g})" for value, name in reach[:-4:-1])
        sentences.append(f"Accurate with the largest {thing}{ending}: {best}; with the smallest only: {worst}.")
        never = [name for name, fate in first.items() if fate is None]
        if never:
            sentences.append(f"{len(never)} of {len(first)} of them never end early: {', '.join(never)}.")
        for how in dict.fromkeys(fate[1] for fate in first.values() if fate):
            failing = sorted((fate[0], name, fate[2]) for name, fate in first.items() if fate and fate[1] == how)
            at, name, where = failing[0]
            later = f", then {len(failing) - 1} more" if len(failing) > 1 else ""
            sentences.append(
                f"First to end with {how.replace('_', ' ')}: {name} at {at:.2g}{ending} on {where}{later}."
            )
    return sentences + grazing(data)


STUDY = Study(
    name="stability",
    title="Stability",
    question="Where does each method fail as its step grows, and how?",
    how_to_read=(
        "Each strip is one method; from left to right the step grows. Green is accurate. Yellow looks healthy and is "
        "wrong: energy bounded, phase lost. Hatched runs ended early or went where the true motion "
        "never goes. Adaptive methods, on the right, are shown against their tolerance."
    ),
    cases=cases,
    measure=measure,
    pictures=pictures,
    tables=tables,
    verdict=verdict,
)
