"""ensemble(): many tops or bodies, one integrator, each with a step and a horizon of its own -> one dataset.

Members are computed in chunks (`symtop.run.ensemble.chunks`), on threads or on a cluster, and a member has the same
bits as in `simulate`. An ensemble too large for memory is written to a file (`Stream`), and resumed from there.
"""

import contextlib
import warnings
import zipfile
from collections import Counter
from collections.abc import Callable, Generator, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import xarray as xr

from symtop.core import errors, netcdf
from symtop.core.code_hash import digest, hashed, packages
from symtop.core.errors import SymtopError, SymtopWarning, boolean, check_replaceable, file_path, positive, whole
from symtop.core.files import only_writer, replacing, sweep
from symtop.core.jit import code
from symtop.core.parallel import MOST_THREADS, cores, in_order, in_threads
from symtop.core.progress import progress_bar
from symtop.core.signals import ending_on_sigterm
from symtop.methods.framework import lanes
from symtop.methods.framework.lanes import Ints, of_bodies
from symtop.methods.framework.plan import OUTCOMES
from symtop.methods.framework.registry import Integrator, integrator as find_integrator
from symtop.model.charts import BODY, Array
from symtop.model.exact.samples import LONGEST_TIME
from symtop.model.scenes import Scene, horizon_of
from symtop.run import cluster
from symtop.run.ensemble.chunks import CHUNK, CHUNK_STEPS, RAISED, SHOWN, Job, as_dataset, nutation_periods, same_times
from symtop.run.ensemble.inputs import Members, for_each, member_name, read_members
from symtop.run.guard import MOST_STEPS
from symtop.run.simulation import MOST_SAMPLES, MOST_SWINGS, chart_of, check_control

SAMPLES = 101
IDENTITY = "identity"  # the name of the file with the hash of the ensemble that a folder belongs to
MOST_VALUES = 250_000_000  # numbers in memory, 2 GB: a larger dataset needs a file


def ensemble(
    members: xr.Dataset | Iterable[str | Scene], integrator: str | Integrator, *, step_size: object = None,
    per_nutation: object = None, tolerance: object = None, horizon: object = None, nutations: object = None,
    samples: int = SAMPLES, observe: str | None = None, variables: Iterable[str] | None = None,
    budget: float | None = None, path: str | Path | None = None, threads: int | None = None,
    scheduler: str | None = None, quiet: bool = False,
    added: Callable[[xr.Dataset], xr.Dataset] = lambda _: xr.Dataset(),
) -> xr.Dataset:  # fmt: skip
    """Run one integrator on many tops, or on many bodies; each member has the same bits as in `simulate`.

    `members` is a list of scenes or their names, or a dataset over ``member`` with ``I1``, ``I3``, ``mgl``, ``theta``
    and, where they are not zero, ``phi``, ``psi``, ``theta_dot``, ``phi_dot``, ``psi_dot`` (`symtop.population` makes
    one; a scalar applies to all members). A dataset with ``I2`` is of bodies without symmetry, as
    `symtop.body_population` makes them. These arguments may be one number or one for each member:

        step_size or per_nutation    the step, or the number of steps per nutation period of the member
        tolerance                    of an adaptive method
        horizon or nutations         the time, or the number of nutation periods, to run to; scenes have their own

    Dimensions ``member``, ``time``, ``component`` (x, y, z). Variables as in `simulate`: ``theta``, ``phi``, ``psi``,
    ``axis``, ``quaternion``, ``energy``, ``p_phi``, ``p_psi``, ``p_theta``, for bodies ``momentum``, or only those in
    `variables`; for each member ``outcome``, ``steps``, ``force_evaluations``, ``newton_iterations``, ``reached_time``,
    ``step_size``, ``horizon``, ``dithered``. In space-frame charts continuous ``phi`` and ``psi`` need the closed form,
    4 us a member, and are computed when first read. ``time`` is a row if all members are sampled at the same times, and
    otherwise an array over ``member`` and ``time``; ``data.isel(member=i)`` has a row either way. A member with fewer
    steps than `samples` is sampled at every step, and the rest of its row is NaN. Labels of members, a coordinate
    ``member``, are kept, and an argument given as a DataArray with such labels is matched by label.

    If a member fails, its samples are NaN from there, ``outcome`` says why, and the others go on; one `SymtopWarning`
    says how many failed (not if `quiet`, which also hides progress). In the angles chart a start on a pole fails at
    once. If a foreign solver raises an exception, ``outcome`` is "raised", and a warning, and the attribute ``raised``
    of a dataset in memory, contain the first such exception; SymtopError if all members raise. `observe` picks the
    chart as in `simulate` (default: that of the scenes, "axis" for a dataset). `budget` is that of one member. There is
    no guard.

    Work is done on `threads` threads, by default one per core, or by the workers of the dask cluster at the address
    `scheduler`. The attribute ``execution`` says how members are run: in "lanes", 32 side by side, if the method
    allows. They are run one after another if they make less than five million steps and lanes are not compiled yet.
    With a `path`, members are written to that netCDF file as they are computed, in memory that does not grow with
    `samples` (0.4 kB a member). The same call resumes an interrupted one to the same file; the dataset is lazy. `added`
    is called with the dataset; the variables (and in a file the attributes) that it returns are added, to a file before
    it is moved to `path`.

    Raises SymtopError for invalid arguments, for members that are no top or no start, by number, and for a path to
    which another process is writing.
    """
    record, method, _ = read_members(members), find_integrator(integrator), errors.function("added", added)
    count, silent = whole("samples", samples, 2, MOST_SAMPLES), boolean("quiet", quiet)
    workers = cores() if threads is None else whole("threads", threads, 1, MOST_THREADS)
    chart = chart_of(method, record.observes, observe)
    observables, n = _observables(variables, chart), len(record.numbers)
    if path is None:
        _check_memory(n, count, observables)
    limit = None if budget is None else positive("budget", budget)
    names, values = ("step_size", "per_nutation", "horizon", "nutations"), (step_size, per_nutation, horizon, nutations)
    settings = {name: value for name, value in zip(names, values, strict=True) if value is not None}
    job = _job(record, method, chart, settings, tolerance, count, limit, observables)
    if scheduler is not None:
        cluster.check_sent(scheduler, job.of(slice(0, 1)), method.name)
    order = job.order() if path is None else None
    compiling = job.steps is not None and int(job.steps.sum()) > lanes.FEW_STEPS
    ordered = replace(job if order is None else job.of(order), continuous=path is not None, compiling=compiling)
    chunks = list(ordered.chunks())
    nouns = ("body", "bodies") if chart == BODY else ("top", "tops")
    words = {
        "title": f"{method.name} on {n} {nouns[n != 1]}", "units": record.units, "chart": chart,
        "integrator": method.name, "implementation": method.implementation, "execution": job.execution,
    }  # fmt: skip

    def compute(pending: list[slice], keep: Callable[[slice, dict[str, Any]], object]) -> tuple[int, str]:
        """Compute the chunks `pending`; returns the number of members whose solver raised, and the first message."""
        raised, first, left = 0, "", sum(chunk.stop - chunk.start for chunk in pending)
        progress = progress_bar(words["title"], quiet=silent, total=n, initial=n - left, unit="run")
        with progress as bar, contextlib.closing(_computed(ordered, pending, workers, scheduler)) as parts:
            for chunk, part in zip(pending, parts, strict=True):
                if message := part.pop(RAISED, ""):
                    raised, first = raised + int((part["outcome"] == RAISED).sum()), first or message
                keep(chunk, part)
                bar.update(chunk.stop - chunk.start)
        return raised, first

    if path is None:
        columns = dict[str, Any]()
        raised, first = compute(
            chunks, lambda chunk, part: _fill(columns, part, chunk if order is None else order[chunk], n)
        )
        if raised == n:
            raise SymtopError(first)
        data = as_dataset(columns, record.labels, of=job)
        data = netcdf.describe(data, **words, **({RAISED: first} if raised else {}))
        data = data.assign(added(data))
    else:
        file = file_path("path", path)
        check_replaceable(file)
        with only_writer(file) as folder:
            stream = Stream(file, folder, job, record.labels, words)
            raised, first = compute(stream.missing(chunks), stream.keep)
            if raised == n:
                stream.forget(chunks)  # there is nothing to resume
                raise SymtopError(first)
            data = stream.finish(chunks, added)
    endings = Counter(() if silent else data["outcome"].values.tolist())
    del endings["ok"], endings[RAISED]
    counts = ", ".join(map("{0[1]} {0[0]}".format, endings.most_common()))
    messages = {f"raised an exception, the first: {first}": raised, f"ended early: {counts}": endings.total()}
    for end in filter(messages.get, messages):
        warnings.warn(f"{messages[end]} of {n} members {end}", SymtopWarning, stacklevel=2)
    return data


def _computed(job: Job, chunks: list[slice], threads: int, scheduler: str | None) -> Generator[Any, None, None]:
    """The columns of each chunk, in the order of the chunks, from threads or from a cluster."""
    parts = map(job.of, chunks)
    if scheduler is None:
        yield from in_threads(Job.columns, parts, threads)
    else:
        client = cluster.connect(scheduler)
        try:
            yield from in_order(client.get_executor(pure=False), Job.columns, parts, cluster.width(client))
        finally:
            cluster.leave(client)


def _fill(columns: dict[str, Any], part: dict[str, Any], chunk: Any, n: int) -> None:
    """Copy the members of a chunk into the columns of n members, which are allocated at the first chunk."""
    for name, values in part.items():
        if name not in columns:
            kind = f"U{max(map(len, OUTCOMES))}" if name == "outcome" else values.dtype
            columns[name] = np.empty((n, *values.shape[1:]), dtype=kind)
        columns[name][chunk] = values


def _observables(variables: Iterable[str] | None, chart: str) -> tuple[str, ...]:
    """The variables of the dataset, checked against the chart and in its order; None for all."""
    if variables is None:
        return SHOWN[chart]
    names, possible = [str(name) for name in errors.entries("variables", variables)], SHOWN[chart]
    for name in names:
        if name not in possible:
            raise SymtopError(f"variables in the {chart} chart are {', '.join(possible)}, not {name!r}", "variables")
    return tuple(name for name in possible if name in names)


def _check_memory(n: int, samples: int, observables: tuple[str, ...]) -> None:
    values = n * samples * (1 + sum({"axis": 3, "momentum": 3, "quaternion": 4}.get(name, 1) for name in observables))
    if values > MOST_VALUES:
        size = f"{n} members with {samples} samples are {values:.3g} numbers, more than the {MOST_VALUES:.3g} that are"
        remedy = "give a path to stream them to a netCDF file, fewer samples, or fewer variables"
        raise SymtopError(f"{size} kept in memory: {remedy}")


def _job(
    members: Members, method: Integrator, chart: str, settings: dict[str, Any], tolerance: object, samples: int,
    budget: float | None, observables: tuple[str, ...],
) -> Job:  # fmt: skip
    """Check the settings and return the `Job` of the members."""
    for name, alternative in (("step_size", "per_nutation"), ("horizon", "nutations")):
        if name in settings and alternative in settings:
            raise SymtopError(f"give {name} or {alternative}, not both", name, alternative)
    control = "per_nutation" if "per_nutation" in settings else "step_size"
    check_control(method, settings.get(control), tolerance, control)
    if method.fixed_step and control not in settings:
        words = f"{method.name} has a fixed step and needs step_size or per_nutation"
        raise SymtopError(words, "step_size", "per_nutation")
    numbers, names, n = members.numbers, members.names, len(members.numbers)
    period = nutation_periods(numbers) if "per_nutation" in settings or "nutations" in settings else None
    for i in np.flatnonzero(~np.isfinite(period))[:1] if period is not None else ():
        words = f"per_nutation and nutations count nutation periods, and that of {member_name(names, i)} is endless"
        raise SymtopError(words, "per_nutation", "nutations")
    horizon = _horizons(members, settings, period)
    steps = bounds = None
    if method.fixed_step:
        step = for_each(control, settings[control], n, names)
        step = step if period is None or control == "step_size" else _step_sizes(period, step, horizon, names)
        steps = _steps(step, horizon, budget or MOST_STEPS, names)
    elif method.adaptive:
        period = nutation_periods(numbers) if period is None else period
        bounds = _tolerances(method, tolerance, members, horizon, period)
    return Job(method, chart, numbers, horizon, steps, bounds, samples, budget, observables, period, names)


def _horizons(members: Members, settings: dict[str, Any], period: Array | None) -> Array:
    """The horizon of each member (n,): from `horizon`, from `nutations` times its period, or its scene's."""
    horizon, names, n = members.horizon, members.names, len(members.numbers)
    if "horizon" in settings:
        horizon = for_each("horizon", settings["horizon"], n, names)
    elif period is not None and "nutations" in settings:
        with np.errstate(over="ignore"):  # an infinite horizon is refused below
            horizon = for_each("nutations", settings["nutations"], n, names) * period
    if horizon is None:
        words = "give horizon or nutations: these members have no horizon of their own"
        raise SymtopError(words, "horizon", "nutations")
    for i in np.flatnonzero(horizon > LONGEST_TIME)[:1]:
        if "nutations" in settings:
            words = f"they take {member_name(names, i)} beyond a time of {LONGEST_TIME:g}"
            raise SymtopError(f"nutations must be fewer: {words}", "nutations")
        words = f"not {horizon[i]!s} as of {member_name(names, i)}"
        raise SymtopError(f"horizon must be at most {LONGEST_TIME:g}, {words}", "horizon")
    horizon_of(float(horizon.min()))
    return horizon


def _step_sizes(period: Array, per_nutation: Array, horizon: Array, names: Any) -> Array:
    """The step of each member, its nutation period divided by `per_nutation`; SymtopError above its horizon."""
    with np.errstate(over="ignore"):  # an infinite step is also longer than the horizon
        step: Array = period / per_nutation
    for i in np.flatnonzero(step > horizon)[:1]:
        minimum = f"{period[i] / horizon[i]:.4g}, a step within the horizon"
        words = f"not {per_nutation[i]:.4g} as of {member_name(names, i)}"
        raise SymtopError(f"per_nutation must be at least {minimum}, {words}", "per_nutation")
    return step


def _steps(step: Array, horizon: Array, limit: float, names: Any) -> Ints:
    """The number of steps of each member, computed and checked as in `simulation.make_plan`."""
    with np.errstate(over="ignore"):
        ratio = horizon / step
    for i in np.flatnonzero(step > horizon)[:1]:
        words = f"not {step[i]!s} of {horizon[i]!s} as of {member_name(names, i)}"
        raise SymtopError(f"step_size must be at most the horizon, {words}", "step_size")
    for i in np.flatnonzero(ratio > limit)[:1]:
        words = f"{ratio[i]:.3g} steps; the limit is {limit:.3g} (see budget)"
        raise SymtopError(f"{member_name(names, i)} asks for {words}", "budget")
    return np.maximum(1, np.rint(ratio)).astype(np.int64)


def _tolerances(method: Integrator, tolerance: object, members: Members, horizon: Array, period: Array) -> Array:
    """The tolerance of each member; tolerance and horizon are checked as in `simulation.make_plan`."""
    numbers, names = members.numbers, members.names
    swinging = 0.0 if of_bodies(numbers) else np.sqrt(np.abs(numbers[:, 2]) / numbers[:, 0])
    swings = horizon * np.maximum(1.0 / period, swinging / (2.0 * np.pi))
    for i in np.flatnonzero(swings > MOST_SWINGS)[:1]:
        words = f"{swings[i]:.3g} swings of the top; an adaptive method may take {MOST_SWINGS:.3g}"
        raise SymtopError(f"the horizon of {member_name(names, i)} is {words}")
    if tolerance is None:
        return np.broadcast_to(method.check_tolerance(None), len(numbers))
    row = for_each("tolerance", tolerance, len(numbers), names)
    for value in (row.min(), row.max()):
        method.check_tolerance(float(value))
    return row


class Stream:
    """The netCDF file of an ensemble, and its chunks on disk.

    Each chunk is written atomically to a file of its own in the folder ``PATH.parts``, beside the file `IDENTITY`. When
    all exist they are copied, one after another, into a netCDF file, which is then moved to `PATH`; then the chunks are
    removed, `IDENTITY` last. The bytes of the file do not depend on how often the work was interrupted. Copying needs
    twice the size of the file on disk. Only one process at a time does this: it holds the lock ``.PATH.lock``. Files
    that symtop did not write are never removed or replaced.
    """

    def __init__(self, path: Path, folder: Path, job: Job, labels: dict[str, Any], attributes: dict[str, Any]) -> None:
        self.path, self.folder, self.labels, self.attributes = path, folder, labels, attributes
        self.n = len(job.numbers)
        self.identity, self.stored = _identity(job, labels), self.folder / IDENTITY
        empty = not self.folder.exists() or (self.folder.is_dir() and not any(self.folder.iterdir()))
        if not empty and not self.stored.is_file():
            words = "is there and does not say which ensemble it is of: remove it or name another path than"
            raise SymtopError(f"{self.folder} {words} {path}")
        sweep(path)
        if self.stored.is_file() and self.stored.read_text(encoding="utf-8") != self.identity:
            words = "holds the beginning of another ensemble, or of another version's; remove it or name another path"
            raise SymtopError(f"{self.folder} {words} than {path}")

    def missing(self, chunks: list[slice]) -> list[slice]:
        """The chunks that are not on disk."""
        return [chunk for chunk in chunks if not self._part(chunk).is_file()]

    def keep(self, chunk: slice, columns: dict[str, Any]) -> None:
        """Write a chunk to its file; the first one makes the folder."""
        if not self.stored.is_file():
            netcdf.write_text(self.stored, self.identity)
        with ending_on_sigterm(), replacing(self._part(chunk), ".npz") as partial:
            np.savez(partial, **columns)

    def finish(self, chunks: list[slice], added: Callable[[xr.Dataset], xr.Dataset]) -> xr.Dataset:
        """Copy the chunks into the netCDF file, remove them, and open it as a lazy dataset."""
        with netcdf.one_thread, replacing(self.path) as partial:
            first = self._columns(chunks[0])
            shared = all(same_times(self._columns(chunk, "time")["time"], first["time"][0]) for chunk in chunks)
            labels = {name: values[: chunks[0].stop] for name, values in self.labels.items()}
            pattern = netcdf.describe(as_dataset(first, labels, shared=shared), **self.attributes)
            try:
                with contextlib.closing(netCDF4.Dataset(partial, "w")) as file:
                    _lay_out(file, pattern, self.n)
                    for chunk in chunks:
                        columns = self._columns(chunk) | {name: values[chunk] for name, values in self.labels.items()}
                        if shared:
                            del columns["time"]
                        for name, values in columns.items():
                            file[name][chunk] = values.astype(object) if values.dtype.kind == "U" else values
                with xr.open_dataset(partial, engine="netcdf4") as data:
                    extra = added(data)
                if extra:
                    extra.to_netcdf(partial, mode="a")
            except RuntimeError as error:  # raised by the netCDF library if the disk is full
                words = f"What was computed is in {self.folder}, and the same call goes on from there"
                raise SymtopError(f"cannot write {self.path}: {error}; is the disk full? {words}") from error
        self.forget(chunks)
        return xr.open_dataset(self.path, engine="netcdf4")

    def forget(self, chunks: list[slice]) -> None:
        """Remove the chunks, and last the file `IDENTITY`."""
        for file in (*map(self._part, chunks), self.folder / IDENTITY):
            file.unlink(missing_ok=True)
        with contextlib.suppress(OSError):  # the folder holds other files
            self.folder.rmdir()

    def _part(self, chunk: slice) -> Path:
        return self.folder / f"{chunk.start}-{chunk.stop}.npz"

    def _columns(self, chunk: slice, *names: str) -> dict[str, Any]:
        path = self._part(chunk)
        try:
            with path.open("rb") as file, np.load(file) as columns:
                return {name: columns[name] for name in names or columns.files}
        except FileNotFoundError as error:
            words = "is not there any more, so somebody has removed it: run the same again, and it is computed"
            raise SymtopError(f"{path} {words}") from error
        except (OSError, ValueError, zipfile.BadZipFile) as error:
            raise SymtopError(f"{path} is damaged ({error}): remove it, and it is computed again") from error


def _lay_out(file: Any, pattern: xr.Dataset, n: int) -> None:
    """Create the dimensions, variables, attributes and coordinates of a file like those of `pattern`, for n members."""
    file.set_fill_off()
    for name, size in pattern.sizes.items():
        file.createDimension(name, n if name == "member" else size)
    variables, attributes = xr.conventions.encode_dataset_coordinates(pattern)
    for name, variable in variables.items():
        values = variable.values
        kind = str if values.dtype.kind == "U" else "i1" if values.dtype.kind == "b" else values.dtype
        copy = file.createVariable(name, kind, variable.dims, contiguous=kind is not str)
        copy.setncatts(variable.attrs | ({"dtype": "bool"} if values.dtype.kind == "b" else {}))
        if "member" not in variable.dims:
            copy[:] = values.astype(object) if kind is str else values
    file.setncatts(attributes)


def _identity(job: Job, labels: dict[str, Any]) -> str:
    """A hash of all that determines the bytes of the file: code, libraries and inputs."""
    arrays = job.numbers, job.horizon, job.steps, job.tolerance
    limits = job.chart, job.samples, job.budget, job.observables, CHUNK, CHUNK_STEPS
    return digest({
        **code().reasons("integrator", job.method, Job), **packages(),
        "numbers": hashed(*(netcdf.array_hash(values) for values in (*arrays, *labels.values())), *labels),
        "limits": hashed(repr(limits)),
    })  # fmt: skip
