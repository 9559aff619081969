"""sweep(): scenes x integrators x steps or tolerances -> one dataset of errors, work and outcomes.

A cell, one integrator on one scene, is an error table (`symtop.measure.accuracy`). A file stores it with the hash of
everything that its numbers depend on (`symtop.core.code_hash`), as it does for the cases of a study.
"""

import contextlib
import functools
import math
import time
from collections.abc import Callable, Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from symtop.core import code_hash, files, netcdf
from symtop.core.errors import SymtopError, boolean, file_path, foreign_code, positive, row, whole
from symtop.core.jit import code
from symtop.core.parallel import MOST_THREADS, cores, in_threads
from symtop.core.progress import progress_bar
from symtop.measure import columns
from symtop.measure.accuracy import as_table, blank_row, enough_samples, error_row
from symtop.measure.timing import bare_run, timings
from symtop.methods.framework.registry import Integrator, integrator as find_integrator, integrators, split_name
from symtop.model.exact import closed_form
from symtop.model.scenes import Scene, horizon_of, scene as find_scene
from symtop.run.simulation import chart_of, make_plan

KEEP_EVERY = 5.0  # seconds between two writings of the file
RAISED = "raised"  # outcome of a run whose integrator raised an exception
BATCHES, BATCH, PATIENCE = 15, 0.0005, 0.1  # of a run: most samples, of one, of all
CLOSE = 0.01  # relative difference of the three least samples of each run below which none is timed further
NOT_TIMED = {"seconds": math.nan, "seconds_spread": math.nan}
TIMED = (
    "one call of the method's solver from the start to the horizon, with two samples and nothing around it; the least "
    f"of at most {BATCHES} batches of at least {1e3 * BATCH:g} ms each, in random order among those of the other runs"
)
MOST_NAMED = 4  # cells that a message lists
_code = functools.cache(code)


class _Cell(NamedTuple):
    """One integrator on one scene with its settings; `made_of` is the hash of all that its numbers depend on."""

    scene: Scene
    method: Integrator
    settings: tuple[float, ...]
    horizon: float
    observe: str | None
    timed: bool
    made_of: str


def sweep(
    scenes: str | Scene | Iterable[str | Scene], integrators: str | Integrator | Iterable[str | Integrator], *,
    step_size: object = None, tolerance: object = None, per_nutation: object = None, horizon: float | None = None,
    observe: str | None = None, path: str | Path | None = None, threads: int | None = None, timed: bool = False,
    quiet: bool = False,
) -> xr.Dataset:  # fmt: skip
    """Run integrators on scenes at several steps or tolerances and return errors, work and outcomes as one dataset.

    Methods of fixed step take every `step_size`, or a nutation period over every `per_nutation`; adaptive ones take
    every `tolerance`; a formula, such as ``exact``, runs once. `scenes` and `integrators` are names, variants such as
    ``rk4[axis]``, records, or lists of them. `horizon` and `observe` are those of `simulate`.

    Dimensions ``scene``, ``variant``, ``setting`` (in the order given). Variables, each over all three:

        axis, attitude, theta, energy, p_phi, p_psi    largest error over the run (units as in `symtop.errors`)
        axis_end ...                                   error at the horizon
        axis_bound ...                                 the least error that the reference can judge
        steps, force_evaluations, newton_iterations    work
        step_size, tolerance                           of the run: the step divides the horizon, so that it may differ
                                                       from the one given; NaN where the method has no such setting
        chart                                          of the run, over scene and variant
        seconds, seconds_spread                        if `timed`: least run time, s, and its spread, as in `compare`
        outcome, message                               "ok", or how the run ended; "not_run" where a method has fewer
                                                       settings; "raised", with the message, if it raised an exception

    The attributes ``top`` and ``start`` are JSON by scene, and so is ``horizon`` if scenes differ in it. Cells are
    computed on `threads` threads, by default one per core. With a `path`, finished cells are stored in that netCDF
    file: the same call resumes an interrupted sweep, recomputes cells that have changed (a setting, a scene, the source
    of a method) or raised an exception, and returns the same dataset, which the file then holds. A call may name more
    scenes and integrators than the file holds, but not fewer. Raises SymtopError for invalid arguments, for a damaged
    file, and for one that another process is writing.
    """
    problems = [find_scene(scene, bodies=True) for scene in listed(scenes)]
    methods = [find_integrator(name) for name in listed(integrators)]
    silent = boolean("quiet", quiet)
    workers = cores() if threads is None else whole("threads", threads, 1, MOST_THREADS)
    named = {"scenes": [scene.name for scene in problems], "integrators": [method.name for method in methods]}
    for words, names in named.items():
        if not names or len(set(names)) < len(names):
            raise SymtopError(f"{words} must be one or more, each once, not {names!r}")
    asked = {"step_size": step_size, "per_nutation": per_nutation, "tolerance": tolerance}
    controls = {name: _settings(name, values) for name, values in asked.items() if values is not None}
    clock = boolean("timed", timed)
    grid = [[_cell(scene, method, controls, horizon, observe, clock) for method in methods] for scene in problems]
    cells = [cell for row in grid for cell in row]
    pairs = [(cell.scene.name, cell.method.name) for cell in cells]
    file = None if path is None else file_path("path", path)
    with contextlib.nullcontext() if file is None else files.only_writer(file):
        stored, tables = _stored(file)
        if others := [f"{name} on {scene}" for scene, name in stored if (scene, name) not in pairs]:
            first = ", ".join(others[:MOST_NAMED]) + f" and {len(others) - MOST_NAMED} more" * bool(others[MOST_NAMED:])
            rule = f"{first}: ask for these as well, or name another path"
            raise SymtopError(f"path {str(file)!r} holds what was not asked for, {rule}")
        # cells with an exception are computed again: the cause may have been temporary
        new = [cell for cell in cells if cell.made_of not in tables or RAISED in tables[cell.made_of]["outcome"].values]

        def combined() -> xr.Dataset:
            size = max(len(cell.settings) for cell in cells)
            padded = [[_padded(tables.get(cell.made_of), cell, size) for cell in row] for row in grid]
            data = xr.concat([xr.concat(row, "variant") for row in padded], "scene")
            data = data.assign_coords(scene=named["scenes"], variant=named["integrators"])
            charts = [[chart_of(method, scene.observes, observe) for method in methods] for scene in problems]
            data["chart"] = ("scene", "variant"), charts
            units = problems[0].units if len({scene.units for scene in problems}) == 1 else ""
            words = {"timed": TIMED if timed else "nothing: timed was not asked for", "units": units}
            title, content = "errors and work of a sweep", netcdf.content_hash(data)
            data = columns.described(data, units, of_body=[scene.of_body for scene in problems])
            ends = {row[0].scene.name: row[0].horizon for row in grid}
            return netcdf.describe(data, title, content=content, **words, **attributes(problems, ends))

        saved = time.monotonic()
        with progress_bar("sweep", quiet=silent, total=len(cells), initial=len(cells) - len(new)) as bar:
            try:
                for cell, table in zip(new, in_threads(_table, new, workers), strict=True):
                    tables[cell.made_of] = table
                    bar.update()
                    if file is not None and time.monotonic() - saved > KEEP_EVERY:
                        netcdf.write(combined(), file)
                        saved = time.monotonic()
                bar.set_description("timing")
                changed = _time_cells([cell for cell in cells if timed], tables) or bool(new)
            except BaseException:
                if file is not None and tables:
                    netcdf.write(combined(), file)
                raise
        data = combined()
        if file is not None and (changed or pairs != stored):  # also if only the order of the cells has changed
            netcdf.write(data, file)
    return data


def attributes(scenes: list[Scene], horizons: dict[str, float]) -> dict[str, Any]:
    """Attributes ``top`` and ``start`` by scene name, and ``horizon``: a number, or by scene name if scenes differ."""
    ends = {*horizons.values()}
    records = {name: {scene.name: asdict(getattr(scene, name)) for scene in scenes} for name in ("top", "start")}
    return {"horizon": horizons if len(ends) > 1 else ends.pop(), **records}


def listed(things: Any) -> list[Any]:
    """One object as a list of one; several as a list."""
    if isinstance(things, (str, Scene, Integrator)) or not isinstance(things, Iterable):
        return [things]
    if hasattr(things, "keys"):  # a dataset, a table or a dict, whose iteration gives its names
        must = f"scenes and integrators must be names, objects or lists of them, not a {type(things).__name__}"
        raise SymtopError(f"{must}; for a dataset of tops there is ensemble")
    try:
        return list(things)
    except TypeError:  # an array without dimensions
        return [things]


def _settings(name: str, values: object) -> list[float]:
    values = values.ravel() if isinstance(values, np.ndarray) else values
    single = isinstance(values, (str, bytes)) or not isinstance(values, Iterable)
    settings = [positive(name, value) for value in ([values] if single else row(name, values))]
    if not settings:
        raise SymtopError(f"{name} must be one or more numbers, not none")
    return settings


def _cell(
    scene: Scene, method: Integrator, controls: dict[str, list[float]], horizon: float | None, observe: str | None,
    timed: bool,
) -> _Cell:  # fmt: skip
    """A cell; SymtopError before any run if one of its runs has invalid arguments."""
    end = scene.horizon if horizon is None else horizon_of(horizon)
    if method.fixed_step:
        if ("step_size" in controls) is ("per_nutation" in controls):
            note = ", not both" if "step_size" in controls else ""
            raise SymtopError(f"{method.name} has a fixed step: give step_size or per_nutation{note}")
        settings = controls.get("step_size") or [scene.time_scale(end) / count for count in controls["per_nutation"]]
    elif method.adaptive:
        if "tolerance" not in controls:
            raise SymtopError(f"{method.name} is adaptive: give tolerance")
        settings = controls["tolerance"]
    else:
        settings = [math.nan]
    for value in settings:
        make_plan(scene, method, **method.given(value), horizon=end, samples=enough_samples(scene, end))
    made_of = _code().reasons("sweep", error_row, scene, method) | code_hash.packages()
    settings_key = (settings, end, observe, "timed") if timed else (settings, end, observe)
    digest = code_hash.digest(made_of | {"settings": repr(settings_key)})
    return _Cell(scene, method, tuple(settings), end, observe, timed, digest)


def _table(cell: _Cell) -> xr.Dataset:
    runs = [error_row_or_message(*cell[:2], setting, cell.horizon, cell.observe) for setting in cell.settings]
    return as_table([run | (NOT_TIMED if cell.timed else {}) for run in runs])


def error_row_or_message(
    scene: Scene, method: Integrator, setting: float, horizon: float, observe: str | None, budget: float | None = None
) -> dict[str, Any]:
    """One run's entries in an error table, with a ``message`` that is empty unless the run raised an exception."""
    try:
        return error_row(scene, method, setting, horizon, observe, budget=budget) | {"message": ""}
    except SymtopError as error:
        return blank_row(method) | {"outcome": RAISED, "message": str(error)} | method.given(setting)


def _time_cells(cells: list[_Cell], tables: dict[str, xr.Dataset]) -> bool:
    """Time the cells in `tables` that have no times yet; False if there were none."""
    untimed = [(cell, tables[cell.made_of]) for cell in cells if tables[cell.made_of]["seconds"].isnull().all()]
    runs: list[tuple[Scene, Integrator, float, list[dict[str, Any]]]] = []
    for cell, table in untimed:
        outcomes = zip(cell.settings, table["outcome"].values, strict=True)
        rows = [{"setting_value": setting, "outcome": outcome} | NOT_TIMED for setting, outcome in outcomes]
        chart = chart_of(cell.method, cell.scene.observes, cell.observe)
        runs.append((cell.scene, cell.method.variant(chart), cell.horizon, rows))
    timed_rows(runs)
    for (cell, table), (*_, rows) in zip(untimed, runs, strict=True):
        tables[cell.made_of] = table.assign({name: ("setting", [run[name] for run in rows]) for name in NOT_TIMED})
    return bool(untimed)


def timed_rows(cells: list[tuple[Scene, Integrator, float, list[dict[str, Any]]]]) -> None:
    """Time all runs with outcome "ok" against each other; adds "seconds" and "seconds_spread" to the rows of cells."""
    rows, calls, firsts = [], list[Callable[[], object]](), list[Callable[[], object]]()
    for scene, method, horizon, runs in cells:
        rows += (valid := [run for run in runs if run["outcome"] == "ok"])
        timed = [bare_run(scene, method, next(iter(method.solvers)), run["setting_value"], horizon) for run in valid]
        calls += timed
        firsts += timed[:1]
    with foreign_code("a method that is timed"):
        if firsts:
            closed_form.compile_now()
        for first in firsts:  # otherwise the calibration would time the loading of code and make batches of one call
            first()
        results = timings(calls, BATCHES, BATCH, warm=True, patience=PATIENCE, close=CLOSE) if calls else []
    for run, timing in zip(rows, results, strict=True):
        run |= {"seconds": timing.best, "seconds_spread": timing.spread}


def _padded(table: xr.Dataset | None, cell: _Cell, size: int) -> xr.Dataset:
    """The table of a cell, extended by rows "not_run" to `size` settings; only such rows and no hash if it is None."""
    blank = as_table([blank_row(cell.method) | {"message": ""} | (NOT_TIMED if cell.timed else {})] * size)
    if table is None:
        return blank.assign(made_of=((), ""))
    missing = size - table.sizes["setting"]
    padded = xr.concat([table, blank.isel(setting=slice(0, missing))], "setting") if missing else table
    return padded.assign(made_of=((), cell.made_of))


def _stored(file: Path | None) -> tuple[list[tuple[str, str]], dict[str, xr.Dataset]]:
    """The cells of an earlier sweep as (scene, variant), and its error tables by hash; SymtopError for another file."""
    if file is not None:
        files.sweep(file)
    if file is None or not file.exists():
        return [], {}
    data = netcdf.read(file)
    if "made_of" not in data:
        raise SymtopError(f"path must be a new file or that of a sweep, not {str(file)!r}")
    if data.attrs.get("content", content := netcdf.content_hash(data)) != content:
        raise SymtopError(f"path {str(file)!r} is damaged, its numbers are not those that were written: remove it")
    if "integrator" in data.coords:  # a file of version 0.2
        data = data.rename(integrator="variant")
    pairs, tables = [], {}
    for s, scene in enumerate(data["scene"].values.tolist()):
        for i, name in enumerate(data["variant"].values.tolist()):
            cell = data.isel(scene=s, variant=i)
            digest, run = str(cell["made_of"].values), cell["outcome"].values != "not_run"
            if digest and run.any():
                table = cell.drop_attrs().drop_vars(["scene", "variant", "made_of", "chart"], errors="ignore")
                pairs.append((scene, name))
                tables[digest] = table.isel(setting=np.flatnonzero(run))
    return pairs, tables


def titled(cell: xr.Dataset) -> str:
    """The name of a variant; if it is not compiled, with the package or language it runs in: "dop853[axis] (SciPy)"."""
    name = str(cell["variant"].item())
    if "python" not in cell["implementation"].values:
        return name
    method = integrators().get(split_name(name)[0])
    return f"{name} ({'SciPy' if method and method.family == 'library' else 'Python'})"


def period_word(data: xr.Dataset) -> str:
    """The name of the period that ``steps_per_nutation`` of a comparison refers to."""
    return "natural period" if str(data["variant"].values.flat[0]).endswith("[body]") else "nutation"


def failed_setting(cell: xr.Dataset) -> str:
    """The setting at and above which all runs of a variant failed, in words, "fails at 5.3 steps a nutation"; or ""."""
    control = cell["step_size" if cell["step_size"].notnull().any() else "tolerance"].values
    order = np.argsort(-control)  # coarse to fine, with NaN at the end
    failed = ~np.isin(cell["outcome"].values[order], ("ok", "not_run"))
    last = int(np.argmin(np.append(failed, False))) - 1
    if last < 0:
        return ""
    k, word = order[last], str(cell["outcome"].values[order[last]]).replace("_", " ")
    if not np.isfinite(control[k]) or "ok" not in cell["outcome"].values:
        return f"no run ended well, {word}"
    if "steps_per_nutation" not in cell or cell["step_size"].isnull().all():
        return f"fails at {control[k]:.2g}, {word}"
    steps = cell["steps_per_nutation"].values[k]
    return f"fails at {steps if steps < 100.0 else round(steps):.4g} steps a {period_word(cell)}, {word}"
