"""Error and time of our methods and of the peers, on the same tops, by one code.

Every solver comes as an Integrator record, ours from the registry and the peers' from their adapters. Accuracy: the
largest angle between the axes over ten nutation periods, at 1001 times (with fixed steps, at the end of each if those
are fewer; for a library that would bend its steps to them, at the ends of its own steps), against the closed form with
its bound. Time: runs of their own, of two calls for every solver and setting (see `common`): the public call, and the
inner loop. All calls of a scene are interleaved in random order.

The setting is searched, not only gridded: between the loosest setting of a ladder that meets a target and the one
before it, `symtop.measure.settings.seek` looks for a looser one, for us as for them. One setting serves both calls.
That the inner loop does the same work is checked: `end_error` is the error of the state that it ends with.
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
from benchmarks.measured import circumstances
from benchmarks.peers import Peer, own
from benchmarks.peers.common import DENSE, FIXED_STEPS, Inner, Library, axes_of
from symtop.core.numbers import EPSILON
from symtop.measure.accuracy import SAMPLES
from symtop.measure.settings import ladder as settings, seek
from symtop.measure.timing import timings
from symtop.methods.framework.registry import Integrator, methods
from symtop.model import charts
from symtop.model.scenes import Scene
from symtop.run.reference.truth import reference
from symtop.run.simulation import make_plan
from symtop.run.trajectory import Trajectory

SCENES = ("spheroid", "goldstein")
TARGETS = (1e-3, 1e-6, 1e-9)
CALLS = ("public", "inner")
PERIODS = 10.0
SHOWN = 501  # samples that a public call is asked for: the default of `simulate`
RUNGS = 9
CLOSE = 0.8  # of a target: an error between it and the target ends a search
ENOUGH = 0.1 * TARGETS[-1]  # no finer setting is tried below this error
PATIENCE = 0.6  # seconds of one run after which no finer setting is tried
BATCHES, BATCH = 8, 0.004
LONG = 0.03  # processor seconds of a run that is timed only if it meets a target
CONTENDERS = 3  # of our methods for each target, by a rough timing
OURS, HEYOKA = "symtop", "symtop with heyoka"


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
    plan, _ = make_plan(scene, method, **method.given(setting), horizon=horizon, samples=SAMPLES)
    solve: Any = method.solvers[chart]
    run = None
    start = time.process_time()
    if hasattr(solve, "own_steps"):
        times, states = solve.own_steps(scene.top, scene.start, plan)
        elapsed, axis = time.process_time() - start, states[:, :3]
    else:
        times, run = plan.times, solve(scene.top, scene.start, plan)
        elapsed, axis = time.process_time() - start, Trajectory.of_run(scene, chart, plan, run).axis
    truth = reference(scene, times, precision="closed-form")
    error = float(np.max(charts.axis_distance(axis, truth["axis"].values)))
    failed = not math.isfinite(error) or (run is not None and run.outcome != "ok")
    steps, work = (run.steps, run.force_evaluations) if run is not None else (len(times) - 1, 0)
    bound = float(truth["axis_error_bound"].max()) + EPSILON
    return Point(setting, math.nan if failed else error, bound, steps, work, elapsed)


def ladder(scene: Scene, method: Integrator) -> list[float]:
    """Settings from coarse to fine."""
    if method.fixed_step:
        return settings(method, scene, PERIODS * scene.nutation_period, RUNGS, most=1e5)
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


def ready(scene: Scene, peer: Peer, setting: float) -> tuple[Callable[[], Any], Inner]:
    """Both calls of a solver at a setting, from the start to the horizon."""
    method, horizon = peer.method, PERIODS * scene.nutation_period
    options = method.given(setting)
    sampled, _ = make_plan(scene, method, **options, horizon=horizon, samples=SHOWN)
    bare, _ = make_plan(scene, method, **options, horizon=horizon, samples=2)
    library = method.solvers[peer.chart]
    if isinstance(library, Library):
        return lambda: library.public(scene.top, scene.start, sampled), library.inner(scene.top, scene.start, bare)
    return own.public(scene, method, setting, horizon), own.inner(scene, method, peer.chart, bare)


def shown_by(peer: Peer) -> str:
    """At what times a public call shows the motion; fixed steps are not interpolated, ours as little as a library's."""
    return FIXED_STEPS if peer.method.fixed_step else getattr(peer.method.solvers[peer.chart], "shows", DENSE)


def end_error(scene: Scene, peer: Peer, loop: Inner) -> float:
    """The axis error of the state that an inner loop ends with; its second call counts, which has to start anew."""
    loop.call()
    state = np.atleast_2d(np.array(loop.end(loop.call()), dtype=float))
    library = peer.method.solvers[peer.chart]
    if isinstance(library, Library):
        state = library.states_of(scene.top, scene.start, state)
    truth = reference(scene, np.array([PERIODS * scene.nutation_period]), precision="closed-form")
    return float(charts.axis_distance(axes_of(peer.chart, state), truth["axis"].values)[0])


def ours(scene: Scene, tell: Callable[[str], None]) -> list[tuple[Peer, list[Point]]]:
    """Our compiled integrators that are among the fastest at some target, by a rough timing; and heyoka's.

    The closed form takes no part, neither at once nor step by step: it integrates nothing.
    """
    chosen: dict[str, tuple[Peer, list[Point]]] = {}
    rough: dict[float, list[tuple[float, str]]] = {target: [] for target in TARGETS}
    searched = {}
    for method in methods().values():
        if method.implementation != "compiled" or method.control is None or method.name.startswith("taylor-"):
            continue  # no control: the closed form, which is the truth here
        if method.exact_steps:  # the closed form once more, step by step
            continue
        points = worth_timing(search(scene, method))
        if method.name == "taylor":
            chosen[method.name] = (Peer(HEYOKA, method, own.TAYLOR_LANGUAGE, "heyoka"), points)
            continue
        searched[method.name] = (Peer(OURS, method, own.LANGUAGE), points)
        for target in TARGETS:
            best = next((point for point in points if point.error <= target), None)
            if best is not None:
                _, loop = ready(scene, searched[method.name][0], best.setting)
                rough[target].append((timings([loop.call], batches=5, batch=1e-3)[0].best, method.name))
    for target, row in rough.items():
        names = [name for _, name in sorted(row)]
        simple = [name for name in names if searched[name][0].method.needs == "derivative"]
        names = [*names[:CONTENDERS], *simple[:1]]  # a general solver's like is among them
        chosen |= {name: searched[name] for name in names}
        tell(f"{scene.name}, {target:.0e}: {', '.join(names)}")
    return list(chosen.values())


def measure(peers: Sequence[Peer], scenes: Sequence[str] = SCENES) -> xr.Dataset:
    """Everything: dimensions call, scene, variant (``method[chart]``), setting and batch."""
    cells: dict[tuple[str, str], dict[str, Any]] = {}
    about: dict[str, Peer] = {}
    facts = circumstances()
    for name in scenes:
        scene = symtop.scene(name)
        entries = ours(scene, _tell) + [entry for peer in peers if (entry := _points_of(scene, peer)) is not None]
        rows = [(peer, point, *ready(scene, peer, point.setting)) for peer, points in entries for point in points]
        ends = [end_error(scene, peer, loop) for peer, _, _, loop in rows]
        functions = [function for _, _, whole, loop in rows for function in (whole, loop.call)]
        _tell(f"{name}: timing {len(functions)} calls of {len(entries)} solvers")
        results = timings(functions, batches=BATCHES, batch=BATCH)
        for peer, points in entries:
            about[peer.row] = peer
            places = [i for i, row in enumerate(rows) if row[0] is peer]
            cells[name, peer.row] = {
                "axis": [point.error for point in points],
                "axis_bound": [point.bound for point in points],
                "end_error": [ends[i] for i in places],
                "control_setting": [point.setting for point in points],
                "steps": [point.steps for point in points],
                "force_evaluations": [point.evaluations for point in points],
                "timing": [[results[2 * i + k] for i in places] for k in range(len(CALLS))],
            }
    return _dataset(list(scenes), about, cells).assign_attrs(facts)


def _points_of(scene: Scene, peer: Peer) -> tuple[Peer, list[Point]] | None:
    start = time.perf_counter()
    try:
        points = worth_timing(search(scene, peer.method))
        for point in points:
            ready(scene, peer, point.setting)
    except Exception as error:  # noqa: BLE001  (somebody else's solver must not take the others down)
        _tell(f"{scene.name}: {peer.row} failed, {type(error).__name__}: {error}")
        return None
    _tell(f"{scene.name}: {peer.row} searched in {time.perf_counter() - start:.1f} s")
    return peer, points


def _dataset(scenes: list[str], about: dict[str, Peer], cells: dict[tuple[str, str], dict[str, Any]]) -> xr.Dataset:
    names = list(about)
    shape = len(scenes), len(names), max((len(cell["axis"]) for cell in cells.values()), default=0)
    dims, call_dims = ("scene", "variant", "setting"), ("call", "scene", "variant", "setting")
    plain = [key for key in next(iter(cells.values())) if key != "timing"]
    values = {key: np.full(shape, np.nan) for key in plain}
    timed = {key: np.full((len(CALLS), *shape), np.nan) for key in ("seconds", "first_call", "reliable")}
    samples = np.full((len(CALLS), *shape, BATCHES), np.nan)
    for (scene, name), cell in cells.items():
        place = scenes.index(scene), names.index(name)
        for key in plain:
            values[key][place][: len(cell[key])] = cell[key]
        for k, row in enumerate(cell["timing"]):
            for i, timing in enumerate(row):
                timed["seconds"][(k, *place, i)] = timing.best
                timed["first_call"][(k, *place, i)] = timing.first_call
                timed["reliable"][(k, *place, i)] = timing.reliable
                samples[(k, *place, i)] = timing.samples
    words = {
        "package": [peer.package for peer in about.values()],
        "version": [_version(peer.distribution or peer.package) for peer in about.values()],
        "chart": [peer.chart for peer in about.values()],
        "language": [peer.language for peer in about.values()],
        "implementation": [peer.method.implementation for peer in about.values()],
        "formulation": [peer.method.summary for peer in about.values()],
        "shows": [shown_by(peer) for peer in about.values()],
    }
    return xr.Dataset(
        {key: (dims, array) for key, array in values.items()}
        | {key: (call_dims, array) for key, array in timed.items()}
        | {"seconds_samples": ((*call_dims, "batch"), samples)}
        | {key: ("variant", column) for key, column in words.items()},
        coords={"call": list(CALLS), "scene": scenes, "variant": names},
    )


def _version(distribution: str) -> str:
    try:
        return importlib.metadata.version(distribution)
    except importlib.metadata.PackageNotFoundError:
        return "unknown"


def _tell(line: str) -> None:
    print(f"  {line}", file=sys.stderr, flush=True)
