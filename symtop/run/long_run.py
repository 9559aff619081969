"""Long runs, of a billion steps and more: stored as statistics of windows, and resumable from a checkpoint.

A run is cut into windows: logarithmic in time, `PER_DECADE` per decade, until they would be longer than
`LONGEST_WINDOW` steps. In each, `SAMPLES` samples are taken at whole steps that the golden ratio scatters, so that no
stride is commensurate with the nutation. Of every quantity only the least, the largest and the mean value are stored.

After a window the state of the run, all that its next step depends on, can be written to a checkpoint: atomically, at
most every `SAVE_SECONDS` seconds, and on an interrupt. Where windows end depends only on the number of steps, so that a
resumed run has the same bits as one that was never interrupted.
"""

import contextlib
import json
import math
import time
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from symtop.core import errors, netcdf
from symtop.core.code_hash import by_file, digest, hashed
from symtop.core.errors import SymtopError, SymtopWarning, boolean, file_path, foreign_code, positive, whole
from symtop.core.files import cache_root, make_private
from symtop.core.jit import code_of
from symtop.core.numbers import GOLDEN
from symtop.core.progress import progress_bar
from symtop.core.signals import ending_on_sigterm
from symtop.methods.framework.lanes import Ints
from symtop.methods.framework.loop import FixedStep, Loop, Position, inside
from symtop.methods.framework.plan import NOT_NORMALISED, OK, ending, off_length, sentence
from symtop.methods.framework.registry import Integrator, integrator as find_integrator
from symtop.model.charts import BODY, Array, View, body_energy
from symtop.model.scenes import Scene, scene as find_scene
from symtop.run import modified_energy as modified
from symtop.run.guard import MOST_STEPS
from symtop.run.simulation import chart_of as smallest_chart

Gauge = Callable[..., dict[str, Array]]  # states and momenta of samples -> quantities

PER_NUTATION = 1000.37  # default steps per nutation: not commensurate with the nutation
FIRST_WINDOW = 10_000  # steps of the first window
PER_DECADE = 12  # windows
LONGEST_WINDOW = 20_000_000  # steps of a window: it takes a second or two, and is lost if the process is killed
SAMPLES = 512  # in a window
SAVE_SECONDS = 2.0  # seconds between two writings of the checkpoint, at least
QUANTITIES = ("energy", "modified_energy", "p_phi", "p_psi", "theta")
OF_BODY = ("energy", "p_phi", "momentum", "theta")  # momentum: |L|, constant if the body has no weight


def windows(steps: int) -> list[int]:
    """Steps at which windows end: logarithmic from `FIRST_WINDOW`, then every `LONGEST_WINDOW`, the last at `steps`."""
    ends = [min(FIRST_WINDOW, steps)]
    while ends[-1] < steps:
        grown = round(FIRST_WINDOW * 10.0 ** (len(ends) / PER_DECADE))
        ends.append(min(grown if grown - ends[-1] < LONGEST_WINDOW else ends[-1] + LONGEST_WINDOW, steps))
    return ends


def scattered(begin: int, end: int, samples: int = SAMPLES) -> Ints:
    """At most `samples` whole steps in (begin, end] with strides of no fixed ratio, and `end`."""
    positions = np.arange(samples, dtype=float)
    positions += np.mod(GOLDEN * positions, 1.0)
    marks = begin + 1 + np.floor(positions * ((end - begin) / samples)).astype(np.int64)
    return np.unique(np.append(marks[marks <= end], end))


def chart_of(method: Integrator, *, of_body: bool = False) -> tuple[str, FixedStep]:
    """The smallest chart in which a method has a compiled loop of fixed steps (for a body "body"), and the loop."""
    loops = {chart: loop for chart, solver in method.solvers.items() if (loop := inside(solver)) is not None}
    if not loops:
        raise SymtopError(f"{method.name} has no compiled loop of fixed steps, as strang has, to be run in stretches")
    chart = smallest_chart(method, BODY) if of_body else method.chart_for("axis", among=loops)
    if chart not in loops:
        raise SymtopError(f"{method.name} has no compiled loop of fixed steps for bodies without symmetry")
    return chart, loops[chart]


def presented(solver: FixedStep, par: Any, states: Array) -> Array:
    """The internal states of a solver's loop, converted to the variables of its chart."""
    return states if solver.present is None else solver.present(par, np.zeros(len(states)), states)


def gauge_of(scene: Scene, method: Integrator, h: float) -> Gauge:
    """A function from samples of a run to relative changes of energy, modified energy and momenta, and theta.

    The remaining oscillation of the modified energy is fitted on the first `FIRST_WINDOW` steps, which are run here.
    States are the loop's own, or those of the chart if `shown`. The energy is computed from the momenta of the run, or,
    if the method conserves them, from those of the start, which have more digits. A body has the quantities `OF_BODY`.
    """
    if scene.of_body:
        return _body_gauge(scene, method)
    chart, solver = chart_of(method)
    par, rule, state = solver.setup(scene.top, scene.start, h)
    assert isinstance(solver.loop, Loop)  # noqa: S101
    energy_unit, momentum_unit, start = scene.energy_scale, scene.momentum_scale, scene.top.momenta(scene.start)
    conserved = {"p_phi", "p_psi"} <= set(method.conserves or ())

    def energies(states: Array, momenta: Array) -> tuple[Array, Array]:
        measured = None if conserved else momenta
        plain = modified.energy(scene, chart, states, measured)
        return plain, modified.modified_energy(scene, method, chart, states, h, measured)

    head = solver.loop(par, rule, state, h, scattered(0, FIRST_WINDOW, 8 * SAMPLES))
    first, momenta = presented(solver, par, head.states), head.momenta
    valid = np.isfinite(first).all(axis=1) & np.isfinite(momenta).all(axis=1)  # a run may fail in its first steps
    at_start = presented(solver, par, solver.loop(par, rule, state, h, np.array([0])).states)
    momenta_start = np.array([start[:2]])
    first, momenta = (first[valid], momenta[valid]) if valid.any() else (at_start, momenta_start)
    energy_start = float(energies(at_start, momenta_start)[0][0])
    subtract = modified.oscillation(*modified.section(chart, first), energies(first, momenta)[1])

    def gauge(states: Array, momenta: Array, *, shown: bool = False) -> dict[str, Array]:
        states = states if shown else presented(solver, par, states)
        energy, values = energies(states, momenta)
        return {
            "energy": (energy - energy_start) / energy_unit,
            "modified_energy": subtract(*modified.section(chart, states), values) / energy_unit,
            "p_phi": (momenta[:, 0] - start.p_phi) / momentum_unit,
            "p_psi": (momenta[:, 1] - start.p_psi) / momentum_unit,
            "theta": View(chart, scene.top, states).theta,
        }

    return gauge


def _body_gauge(scene: Scene, method: Integrator) -> Gauge:
    """`gauge_of` for a body: relative changes of energy, p_phi and |L| since the start, and theta."""
    body, size = scene.top, scene.momentum_scale
    solver, start = chart_of(method, of_body=True)[1], body.momenta(scene.start)
    par, _ = solver.prepare(body, scene.start)
    L = body.momentum(scene.start)
    energy_start = body_energy(body, np.array([[*scene.start.quaternion, *L]]))[0]

    def gauge(states: Array, momenta: Array, *, shown: bool = False) -> dict[str, Array]:
        states = states if shown else presented(solver, par, states)
        view = View(BODY, body, states)
        return {
            "energy": (view.energy - energy_start) / scene.energy_scale,
            "p_phi": (momenta[:, 0] - start.p_phi) / size,
            "momentum": (np.linalg.norm(states[:, 4:], axis=1) - math.hypot(*L)) / size,
            "theta": view.theta,
        }

    return gauge


def long_run(
    scene: str | Scene, integrator: str | Integrator, *, steps: int, step_size: float,
    checkpoint: str | Path | bool = False, compensated: bool = True, quiet: bool = False,
    output: str | Path | None = None,
) -> xr.Dataset:  # fmt: skip
    """Run a fixed-step method for any number of steps; statistics of 512 scattered steps of each window of the run.

    Dimension ``window``; ``steps`` is the step at which each ends. For each of energy, modified_energy, p_phi, p_psi
    (relative changes since the start) and theta (rad): ``NAME_least``, ``NAME_largest``, ``NAME_mean``; for a body
    without symmetry of energy, p_phi, momentum (|L|, constant without a weight) and theta. `checkpoint` is a file
    that is written during the run and removed at its end, or True for one in symtop's cache: an interrupted run
    resumes from it. `output` is a netCDF file for the result: the checkpoint is removed once that is written.
    ``compensated=False`` adds increments without compensated summation, for comparison.

    Raises SymtopError for a method without a compiled loop, for a checkpoint of another run and for an output that
    cannot be written.
    """
    problem, method, silent = find_scene(scene, bodies=True), find_integrator(integrator), boolean("quiet", quiet)
    count, h = whole("steps", steps, 1, MOST_STEPS), positive("step_size", step_size)
    chart, solver = chart_of(method, of_body=problem.of_body)
    assert isinstance(solver.loop, Loop)  # noqa: S101
    compensated = boolean("compensated", compensated)
    loop = solver.loop if compensated else solver.loop.plain
    par, rule, state = solver.setup(problem.top, problem.start, h)
    checkpoints = _Checkpoint(checkpoint, _identity(problem, method, h, count, compensated))
    result = None if output is None else checkpoints.checked(file_path("output", output))
    position, rows = checkpoints.resumed(loop.start(par, rule, state, h))
    ends, outcome, reached, title = windows(count), OK, position.k, f"{method.name} on {problem.name}"
    quantities = OF_BODY if problem.of_body else QUANTITIES
    gauge = gauge_of(problem, method, h) if len(rows) < len(ends) else None
    with ending_on_sigterm(), checkpoints:
        with progress_bar(title, quiet=silent, total=count, initial=position.k, unit="step", unit_scale=True) as bar:
            while gauge is not None and len(rows) < len(ends) and outcome == OK:
                marks = scattered(position.k, ends[len(rows)])
                stretch, after = loop.advance(par, rule, position, h, marks)
                outcome, reached = stretch.outcome, after.k
                if outcome == OK and (invalid := off_length(chart, presented(solver, par, stretch.states))).any():
                    outcome, reached = NOT_NORMALISED, int([position.k, *marks][invalid.argmax()])
                if outcome == OK:
                    rows.append(summary(gauge(stretch.states, stretch.momenta)))
                    bar.update(after.k - position.k)
                    position = after
                    checkpoints.note(position, rows)
        with foreign_code(f"integrator {method.name} on {problem.name}"):
            end = ending(outcome)
        columns = np.array(rows).reshape(len(rows), len(quantities), 3)
        variables: dict[str, Any] = {"steps": ("window", np.array(ends[: len(rows)], dtype=float))}
        for i, name in enumerate(quantities):
            words, units = ("theta", "rad") if name == "theta" else (f"relative change of {name} since the start", "1")
            for m, statistic in enumerate(("least", "largest", "mean")):
                attributes = {"long_name": f"{words}, {statistic} over the window", "units": units}
                variables[f"{name}_{statistic}"] = ("window", columns[:, i, m], attributes)
        data = netcdf.describe(
            xr.Dataset(variables), title=f"{title}, {count} steps", units=problem.units,
            integrator=method.name, scene=problem.name, step_size=h, horizon=count * h,
            compensated=str(compensated).lower(), outcome=end, reached_time=reached * h,
            outcome_message=sentence(end, reached * h, count * h, problem.second),
        )  # fmt: skip
        if result is not None:
            checkpoints.write(data, result)
    return data


def summary(values: dict[str, Array]) -> list[float]:
    """Least, largest and mean value of each quantity, in one list."""
    return [float(number) for value in values.values() for number in (value.min(), value.max(), value.mean())]


def _identity(scene: Scene, method: Integrator, h: float, steps: int, compensated: bool) -> str:
    """A hash of all that determines the bits of a run. It uses compiled code, so that comments do not change it."""
    numbers = [[getattr(record, name) for name in record.__slots__] for record in (scene.top, scene.start)]
    settings = [numbers, h, steps, compensated, FIRST_WINDOW, PER_DECADE, LONGEST_WINDOW, SAMPLES]
    hashes = by_file(code_of((method, gauge_of, windows, scattered, summary)))
    return digest(hashes | {"numbers": hashed(json.dumps(settings))})


def leaves(carry: Any) -> list[float]:
    """The floats in the carry that a kernel passes from step to step, nested tuples or one array, as a flat list."""
    if isinstance(carry, tuple):
        return [value for part in carry for value in leaves(part)]
    return [float(value) for value in np.ravel(carry)]


def regrown(carry: Any, values: Iterator[float]) -> Any:
    """A carry of the same structure as `carry`, filled with `values`: the inverse of `leaves`."""
    if isinstance(carry, np.ndarray):
        return np.array([next(values) for _ in range(carry.size)]).reshape(carry.shape)
    if isinstance(carry, tuple):
        return tuple(regrown(part, values) for part in carry)
    return next(values)


class _Checkpoint(contextlib.AbstractContextManager["_Checkpoint"]):
    """The checkpoint file of one run: written from time to time and if the run is interrupted, removed at its end."""

    def __init__(self, file: str | Path | bool, identity: str) -> None:
        self.own, self.identity, self.saved = file is True, identity, time.monotonic()
        self.file = cache_root() / "runs" / f"{identity}.nc" if self.own else None
        if not isinstance(file, bool):
            self.file = file_path("checkpoint", file)
            if self.file.is_dir():
                raise SymtopError(f"checkpoint must be a file, not the folder {str(file)!r}", "checkpoint")
        self.latest: tuple[Position, list[list[float]]] | None = None

    def resumed(self, start: Position) -> tuple[Position, list[list[float]]]:
        """The position and the rows of windows to continue from: those in the file, else `start` and none."""
        data = self._read(self.file) if self.file is not None and self.file.is_file() else None
        if data is None:
            return start, []
        if data.attrs.get("identity") != self.identity:
            words = "belongs to another run or version; remove it or name another file"
            raise SymtopError(f"checkpoint {self.file} {words}", "checkpoint")
        state, low, carry = regrown(start[:3], iter(data["position"].values.tolist()))
        return Position(state, low, carry, int(data["steps_done"])), data["rows"].values.tolist()

    def _read(self, file: Path) -> xr.Dataset | None:
        """The data in the file. If damaged: SymtopError for a user's file, None with a warning for one in the cache."""
        try:
            data = netcdf.read(file)
            matches = not self.own or data.attrs.get("identity") == self.identity  # a file in the cache is named by it
            if matches and data.attrs.get("content") == netcdf.content_hash(data):
                return data
            raise SymtopError("its numbers are not those that were written")  # noqa: TRY301
        except SymtopError as error:
            sentence = f"checkpoint {file} is damaged ({error})"
            if not self.own:
                raise SymtopError(f"{sentence}; remove it or name another file") from error
            warnings.warn(f"{sentence}; the run begins anew", SymtopWarning, stacklevel=4)
            return None

    def note(self, position: Position, rows: list[list[float]]) -> None:
        """Record the position after a window, and write the file if the last writing was over `SAVE_SECONDS` ago."""
        self.latest = (position, list(rows))  # a copy: an interrupt may fall between a window and its note
        if time.monotonic() - self.saved > SAVE_SECONDS:
            self.save()

    def save(self) -> None:
        if self.file is None or self.latest is None:
            return
        position, rows = self.latest
        columns: dict[str, Any] = {"position": ("number", leaves(position[:3])), "rows": (("window", "part"), rows)}
        data = xr.Dataset({**columns, "steps_done": ((), position.k)})
        data.attrs.update(content=netcdf.content_hash(data), identity=self.identity)
        if self.own:
            make_private(self.file.parent)
        netcdf.write(data, self.file)
        self.saved, self.latest = time.monotonic(), None

    def __exit__(self, failure: object, *_: object) -> None:
        if failure is not None:  # an interrupt, SIGTERM or an error
            self.save()
        elif self.file is not None:
            self.file.unlink(missing_ok=True)

    def checked(self, output: Path) -> Path:
        """The output file; SymtopError if it is a folder, not writable, or the checkpoint, which the end removes."""
        if output.is_dir():
            raise SymtopError(f"output must be a file, not the folder {str(output)!r}", "output")
        if self.file is not None and output.resolve() == self.file.resolve():
            words = f"output and checkpoint must be two files, not both {str(output)!r}"
            raise SymtopError(words, "output", "checkpoint")
        errors.check_replaceable(output)
        return output

    def write(self, data: xr.Dataset, output: Path) -> None:
        """Write the result; if that fails, SymtopError says that the run can be resumed from its checkpoint."""
        try:
            netcdf.write(data, output)
        except SymtopError as error:
            left = "" if self.file is None else f"; the steps are kept in {self.file}, and the same call goes on there"
            raise SymtopError(f"{error}{left}") from error
