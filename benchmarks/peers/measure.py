"""Error and time of our methods and of the peers, on the same tops, by one code.

Every solver comes as an Integrator record, ours from the registry and the peers' from their adapters. Accuracy: the
largest angle between the axes over ten nutation periods, at 331 times that never beat with the nutation (for a library
that would bend its steps to them, at the ends of its own steps), against the closed form with its bound. Time: runs of
their own, start to horizon with nothing sampled between, all solvers of a scene interleaved in random order.

The setting is searched, not only gridded: between the loosest setting of a ladder that meets a target and the one
before it, `symtop.measure.settings.seek` looks for a looser one, for us as for them.
"""

import importlib.metadata
import math
import sys
import time
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

import symtop
from benchmarks.peers import Peer
from symtop.measure.accuracy import SAMPLES, judge_limit
from symtop.measure.settings import seek, step_ladder
from symtop.measure.timing import bare_run, timings
from symtop.methods.registry import Integrator
from symtop.model import charts
from symtop.model.scenes import Scene
from symtop.run.reference import reference
from symtop.run.simulation import as_dataset, make_plan

SCENES = ("spheroid", "goldstein", "fast")
TARGETS = (1e-3, 1e-6, 1e-9)
PERIODS = 10.0
RUNGS = 9
CLOSE = 0.8  # of a target: an error between it and the target ends a search
ENOUGH = 0.1 * TARGETS[-1]  # no finer setting is tried below this error
PATIENCE = 0.6  # seconds of one run after which no finer setting is tried
BATCHES, BATCH = 8, 0.006
LONG = 0.2  # processor seconds of a run that is timed only if it meets a target
CONTENDERS = 3  # of our methods for each target, by a rough timing
OURS, HEYOKA = "symtop", "heyoka"


class Point(NamedTuple):
    """One setting of one solver on one scene."""

    setting: float
    error: float
    bound: float
    steps: int
    evaluations: int
    seconds: float  # of the processor in the accuracy run, rough


def accuracy(scene: Scene, method: Integrator, setting: float) -> Point:
    """One run with samples, judged."""
    chart, horizon = method.chart_for("axis"), PERIODS * scene.nutation_period
    plan, _ = make_plan(scene, method, **method.setting(setting).kwargs(), horizon=horizon, samples=SAMPLES)
    solve: Any = method.solvers[chart]
    run = None
    begun = time.process_time()
    if hasattr(solve, "own_steps"):
        times, states = solve.own_steps(scene.top, scene.start, plan)
        elapsed, axis = time.process_time() - begun, states[:, :3]
    else:
        times, run = plan.times, solve(scene.top, scene.start, plan)
        elapsed, axis = time.process_time() - begun, as_dataset(scene, chart, plan, run)["axis"].values
    truth = reference(scene, times, precision="closed-form")
    error = float(np.max(charts.axis_distance(axis, truth["axis"].values)))
    failed = not math.isfinite(error) or (run is not None and run.outcome != "ok")
    steps, work = (run.steps, run.force_evaluations) if run is not None else (len(times) - 1, 0)
    return Point(setting, math.nan if failed else error, judge_limit(scene, truth, "axis"), steps, work, elapsed)


def ladder(scene: Scene, method: Integrator) -> list[float]:
    """Settings from coarse to fine."""
    if method.fixed_step:
        return step_ladder(method, scene, PERIODS * scene.nutation_period, RUNGS, most=1e5)
    return [float(value) for value in np.geomspace(1e-3, 1.0001 * max(method.least_tolerance, 1e-15), RUNGS)]


def search(scene: Scene, method: Integrator, targets: Sequence[float] = TARGETS) -> list[Point]:
    """The ladder, as far as it is needed, and for each target the loosest setting that meets it."""
    points: dict[float, Point] = {}

    def run(setting: float) -> tuple[float, float]:
        if setting not in points:
            points[setting] = accuracy(scene, method, setting)
        point = points[setting]
        return point.error if math.isfinite(point.error) else math.inf, point.evaluations

    settings = ladder(scene, method)
    accuracy(scene, method, settings[0])  # what is compiled at the first call would look like a lack of patience
    for setting in settings:
        if run(setting)[0] < ENOUGH or points[setting].seconds > PATIENCE:
            break
    rungs = list(points.values())
    for target in targets:
        good = next((i for i, point in enumerate(rungs) if point.error <= target), 0)
        if not good:  # nobody, or the coarsest already
            continue
        ends = rungs[good].setting, rungs[good - 1].setting
        power = float(method.order or 2) if method.fixed_step else 1.0
        seek(run, math.sqrt(ends[0] * ends[1]), target, ends, power, fixed_step=method.fixed_step, least=CLOSE)
    return sorted(points.values(), key=lambda point: -point.setting)


def worth_timing(points: Sequence[Point], targets: Sequence[float] = TARGETS) -> list[Point]:
    """Points that no looser setting beats, the long ones left out, and the loosest ones that meet a target."""
    best, kept = math.inf, []
    for point in points:
        meets = any(point.error <= target < best for target in targets)
        if math.isfinite(point.error) and (meets or (point.error < 0.3 * best and point.seconds < LONG)):
            kept.append(point)
            best = min(best, point.error)
    return kept


def ours(scene: Scene, tell: Callable[[str], None]) -> list[tuple[Peer, list[Point]]]:
    """Our compiled integrators that are among the fastest at some target, by a rough timing; and heyoka's."""
    chosen: dict[str, tuple[Peer, list[Point]]] = {}
    rough: dict[float, list[tuple[float, str]]] = {target: [] for target in TARGETS}
    searched = {}
    for method in symtop.integrators().values():
        if method.implementation != "compiled" or method.control is None or method.name.startswith("taylor-"):
            continue  # no control: the closed form, which is the truth here
        points = worth_timing(search(scene, method))
        searched[method.name] = points
        if method.family == "taylor":
            chosen[method.name] = (Peer(HEYOKA, method), points)
            continue
        for target in TARGETS:
            best = next((point for point in points if point.error <= target), None)
            if best is not None:
                call = bare_run(scene, method, method.chart_for("axis"), best.setting, _horizon(scene))
                rough[target].append((timings([call], batches=5, batch=1e-3)[0].best, method.name))
    for target, row in rough.items():
        for _, name in sorted(row)[:CONTENDERS]:
            chosen[name] = (Peer(OURS, symtop.integrator(name)), searched[name])
        tell(f"{scene.name}, {target:.0e}: {', '.join(name for _, name in sorted(row)[:CONTENDERS])}")
    return list(chosen.values())


def _horizon(scene: Scene) -> float:
    return PERIODS * scene.nutation_period


def measure(peers: Sequence[Peer], scenes: Sequence[str] = SCENES) -> xr.Dataset:
    """Everything: dimensions scene, integrator, setting and batch."""
    cells: dict[tuple[str, str], dict[str, Any]] = {}
    about: dict[str, Peer] = {}
    for name in scenes:
        scene = symtop.scene(name)
        entries = ours(scene, _tell)
        for peer in peers:
            begun = time.perf_counter()
            try:
                entries.append((peer, worth_timing(search(scene, peer.method))))
                _tell(f"{name}: {peer.method.name} searched in {time.perf_counter() - begun:.1f} s")
            except Exception as error:  # noqa: BLE001  (somebody else's solver must not take the others down)
                _tell(f"{name}: {peer.method.name} failed, {type(error).__name__}: {error}")
        calls = [
            bare_run(scene, peer.method, peer.method.chart_for("axis"), point.setting, _horizon(scene))
            for peer, points in entries
            for point in points
        ]
        _tell(f"{name}: timing {len(calls)} runs of {len(entries)} solvers")
        timed = iter(timings(calls, batches=BATCHES, batch=BATCH))
        for peer, points in entries:
            about[peer.method.name] = peer
            samples = [next(timed) for _ in points]
            cells[name, peer.method.name] = {
                "axis": [point.error for point in points],
                "axis_bound": [point.bound for point in points],
                "knob_setting": [point.setting for point in points],
                "steps": [point.steps for point in points],
                "force_evaluations": [point.evaluations for point in points],
                "seconds": [timing.best for timing in samples],
                "first_call": [timing.first_call for timing in samples],
                "reliable": [float(timing.reliable) for timing in samples],
                "seconds_samples": [timing.samples for timing in samples],
            }
    return _combined(list(scenes), about, cells)


def _combined(scenes: list[str], about: dict[str, Peer], cells: dict[tuple[str, str], dict[str, Any]]) -> xr.Dataset:
    names = list(about)
    most = max((len(cell["axis"]) for cell in cells.values()), default=0)
    variables = {}
    for key in next(iter(cells.values())):
        deep = key == "seconds_samples"
        values = np.full((len(scenes), len(names), most, *([BATCHES] if deep else [])), np.nan)
        for (scene, name), cell in cells.items():
            row = np.array(cell[key], dtype=float)
            values[scenes.index(scene), names.index(name), : len(row)] = row.reshape(len(row), *values.shape[3:])
        variables[key] = (("scene", "integrator", "setting", *(["batch"] if deep else [])), values)
    variables["package"] = ("integrator", [about[name].package for name in names])
    variables["version"] = ("integrator", [_version(about[name].distribution or about[name].package) for name in names])
    variables["formulation"] = ("integrator", [about[name].method.summary for name in names])
    variables["implementation"] = ("integrator", [about[name].method.implementation for name in names])
    return xr.Dataset(variables, coords={"scene": scenes, "integrator": names})


def _version(distribution: str) -> str:
    try:
        return importlib.metadata.version(distribution)
    except importlib.metadata.PackageNotFoundError:
        return "unknown"


def _tell(line: str) -> None:
    print(f"  {line}", file=sys.stderr, flush=True)
