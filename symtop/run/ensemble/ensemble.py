"""ensemble(): many tops, one integrator, each with a step and a horizon of its own -> one dataset.

Members are computed in chunks (`symtop.run.ensemble.chunks`), on threads or on a cluster, and a member has the bits of
`simulate` alone. What does not fit into memory goes to a file as it is computed (`symtop.run.ensemble.chunked_output`).
"""

import contextlib
import warnings
from collections.abc import Callable, Generator, Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from tqdm import tqdm

from symtop.core import cluster, netcdf
from symtop.core.errors import SymtopError, SymtopWarning, boolean, file_path, positive, shown, whole
from symtop.core.parallel import MOST_THREADS, cores, in_order, in_threads
from symtop.core.progress import beating
from symtop.methods.framework.plan import OUTCOMES
from symtop.methods.framework.registry import Integrator, integrator as find_integrator
from symtop.model.exact.samples import LONGEST_TIME
from symtop.model.scenes import Scene, horizon_of
from symtop.run.ensemble.chunked_output import streaming
from symtop.run.ensemble.chunks import RAISED, SHOWN, Job, as_dataset
from symtop.run.ensemble.inputs import Members, called, for_each, read_members
from symtop.run.guard.guard import MOST_STEPS
from symtop.run.sampling import nutation_periods
from symtop.run.simulation import MOST_SAMPLES, MOST_SWINGS, chart_of, check_formula

Array = NDArray[np.float64]

SAMPLES = 101
MOST_VALUES = 250_000_000  # of all members, samples and variables, 2 GB: more goes to a file


def ensemble(
    members: "xr.Dataset | Iterable[str | Scene]", integrator: "str | Integrator", *, step_size: object = None,
    per_nutation: object = None, tolerance: object = None, horizon: object = None, nutations: object = None,
    samples: int = SAMPLES, observe: str | None = None, variables: Iterable[str] | None = None,
    budget: float | None = None, path: str | Path | None = None, threads: int | None = None,
    scheduler: str | None = None, quiet: bool = False,
) -> xr.Dataset:  # fmt: skip
    """Run one integrator on many tops; each member has the bits of `simulate` alone.

    `members` is a list of scenes or their names, or a dataset over ``member`` with ``I1``, ``I3``, ``mgl``, ``theta``
    and, where they are not zero, ``phi``, ``psi``, ``theta_dot``, ``phi_dot``, ``psi_dot`` (`symtop.population` makes
    one; a scalar counts for all members). What follows may be one number or one for each member:

        step_size or per_nutation    the step, or how many steps a nutation period of the member has
        tolerance                    of an adaptive method
        horizon or nutations         the time, or the number of nutation periods, to run to; scenes have their own

    Dimensions ``member``, ``time``, ``component`` (x, y, z). Variables as `simulate` has them: ``theta``, ``phi``,
    ``psi``, ``axis``, ``quaternion``, ``energy``, ``p_phi``, ``p_psi``, ``p_theta``, or those of them that `variables`
    names (``phi`` and ``psi`` of the space frame take the closed form, 12 microseconds a member); for each member
    ``outcome``, ``steps``, ``force_evaluations``, ``newton_iterations``, ``reached_time``, ``step_size``, ``horizon``,
    ``dithered``. ``time`` is a row where all members are sampled at the same times, and otherwise an array over
    ``member`` and ``time``; ``data.isel(member=i)`` has a row either way. A member of fewer steps than `samples` shows
    every step, and the rest of its row is NaN. Labels of members, a coordinate ``member``, are kept, and what is given
    for each as a DataArray with such labels is taken by label.

    A member that fails fails alone: its samples are NaN from there, ``outcome`` says why. One that starts on a pole has
    left the angles chart at once, and one on which somebody's solver raises an exception has "raised": a warning
    (`SymtopWarning`), and the attribute ``raised`` of a dataset in memory, tells the first such exception. If all
    members raise, SymtopError does. `observe` picks the chart as in `simulate` (default: what the scenes are watched
    for, the axis of a dataset). `budget` is that of one member. There is no guard.

    Work is done on as many `threads` as there are cores, or by the workers of the dask cluster at the address
    `scheduler`. The attribute ``execution`` says how members were run: in "lanes", 32 side by side, where the method
    can. With a `path`, members go to that netCDF file as they are computed, in memory that does not grow with
    `samples`: 0.25 kB a member for its nine numbers, its plan and their copies, beside the 0.13 of a population. The
    same call resumes one that was killed, to the same file, and the dataset reads from the file what it is asked for.

    Raises SymtopError for arguments that make no sense, for members that are no top or no start, by number, and for a
    path to which another process is writing.
    """
    read, method = read_members(members), find_integrator(integrator)
    count, silent = whole("samples", samples, 2, MOST_SAMPLES), boolean("quiet", quiet)
    workers = cores() if threads is None else whole("threads", threads, 1, MOST_THREADS)
    chart = chart_of(method, read.observes, observe)
    names = _shown(variables, chart)
    if path is None:
        _check_memory(len(read.numbers), count, names)
    limit = None if budget is None else positive("budget", budget)
    asked = _Asked(step_size, per_nutation, tolerance, horizon, nutations)
    job = _job(read, method, chart, asked, count, limit, names)
    if scheduler is not None:
        cluster.check_sent(scheduler, job.part(slice(0, 1)), method.name)
    n, chunks = len(read.numbers), list(job.chunks())
    words = {
        "title": f"{method.name} on {n} tops", "units": read.units, "integrator": method.name, "chart": chart,
        "implementation": method.implementation, "execution": job.execution,
    }  # fmt: skip

    def compute(rest: list[slice], keep: Callable[[slice, dict[str, Any]], object]) -> _Raised:
        left, raised = sum(chunk.stop - chunk.start for chunk in rest), _Raised(0, "")
        with (
            beating(
                tqdm(total=n, initial=n - left, desc=words["title"], unit="top", disable=silent or None, leave=False)
            ) as bar,
            contextlib.closing(_computed(job, rest, workers, scheduler)) as parts,
        ):
            for chunk, part in zip(rest, parts, strict=True):
                raised = raised.and_of(part)
                keep(chunk, part)
                bar.update(chunk.stop - chunk.start)
        return raised

    if path is None:
        columns = dict[str, Any]()
        raised = compute(chunks, lambda chunk, part: _fill(columns, part, chunk, n))
        raised.refuse(n)
        said = {RAISED: raised.first} if raised.members else {}
        data = netcdf.describe(as_dataset(columns, read.labels), **words, **said)
    else:
        with streaming(file_path("path", path), job, read.labels, words) as stream:
            raised = compute(stream.missing(chunks), stream.keep)
            if raised.members == n:
                stream.forget(chunks)  # there is nothing to resume
            raised.refuse(n)
            data = stream.finish(chunks)
    if raised.members:
        sentence = f"{raised.members} of {n} members raised an exception, the first: {raised.first}"
        warnings.warn(sentence, SymtopWarning, stacklevel=2)
    return data


def _computed(
    job: Job, chunks: list[slice], threads: int, scheduler: str | None
) -> Generator[dict[str, Any], None, None]:
    """The columns of each chunk, in their order."""
    parts = map(job.part, chunks)
    if scheduler is None:
        yield from in_threads(Job.columns, parts, threads)
    else:
        with cluster.connected(scheduler) as client:
            yield from in_order(client.get_executor(pure=False), Job.columns, parts, cluster.width(client))


class _Raised(NamedTuple):
    """How many members a solver raised an exception on, and what the first of them was told."""

    members: int
    first: str

    def and_of(self, part: dict[str, Any]) -> "_Raised":
        """With those of a chunk, whose sentence is taken out of it."""
        said = part.pop(RAISED, "")
        return _Raised(self.members + int((part["outcome"] == RAISED).sum()), self.first or said) if said else self

    def refuse(self, n: int) -> None:
        """SymtopError if that are all n."""
        if self.members == n:
            raise SymtopError(self.first)


def _fill(columns: dict[str, Any], part: dict[str, Any], chunk: slice, n: int) -> None:
    """Put a chunk into columns of n members, which the first one makes."""
    for name, values in part.items():
        if name not in columns:
            kind = f"U{max(map(len, OUTCOMES))}" if name == "outcome" else values.dtype
            columns[name] = np.empty((n, *values.shape[1:]), dtype=kind)
        columns[name][chunk] = values


def _shown(variables: Iterable[str] | None, chart: str) -> tuple[str, ...]:
    """Which variables a dataset has, in their usual order."""
    if variables is None:
        return SHOWN[chart]
    if isinstance(variables, str) or not isinstance(variables, Iterable):
        raise SymtopError(f"variables must be a list of names, not {variables!r}", "variables")
    wanted = list(variables)
    for name in wanted:
        if name not in SHOWN[chart]:
            raise SymtopError(
                f"variables in the {chart} chart are {', '.join(SHOWN[chart])}, not {name!r}", "variables"
            )
    return tuple(name for name in SHOWN[chart] if name in wanted)


def _check_memory(n: int, samples: int, shown: tuple[str, ...]) -> None:
    """Refuse a dataset that does not fit into memory."""
    values = n * samples * (1 + sum({"axis": 3, "quaternion": 4}.get(name, 1) for name in shown))
    if values > MOST_VALUES:
        raise SymtopError(
            f"{n} members with {samples} samples are {values:.3g} numbers, more than the {MOST_VALUES:.3g} that are "
            f"kept in memory: give a path to stream them to a netCDF file, fewer samples, or fewer variables"
        )


class _Asked(NamedTuple):
    """The settings of an ensemble as they were given: one for all members, one for each, or none."""

    step_size: object
    per_nutation: object
    tolerance: object
    horizon: object
    nutations: object

    def check(self, method: Integrator) -> None:
        """Refuse settings that exclude each other or are not what the method has."""
        for one, other in (("step_size", "per_nutation"), ("horizon", "nutations")):
            if getattr(self, one) is not None and getattr(self, other) is not None:
                raise SymtopError(f"give {one} or {other}, not both", one, other)
        words, step = next(
            ((name, value) for name, value in zip(self._fields[:2], self[:2], strict=True) if value is not None),
            ("step_size", None),
        )
        if method.fixed_step and self.tolerance is not None:
            raise SymtopError(
                f"{method.name} has a fixed step: give step_size, not tolerance = {shown(self.tolerance)}",
                "step_size",
                "tolerance",
            )
        if method.fixed_step and step is None:
            raise SymtopError(
                f"{method.name} has a fixed step and needs step_size or per_nutation", "step_size", "per_nutation"
            )
        check_formula(method, words, step, self.tolerance)
        if not method.fixed_step and step is not None:
            raise SymtopError(
                f"{method.name} chooses its own steps: give tolerance, not {words} = {shown(step)}", "tolerance", words
            )


def _job(
    members: Members, method: Integrator, chart: str, asked: _Asked, samples: int, budget: float | None,
    shown: tuple[str, ...],
) -> Job:  # fmt: skip
    """What is asked of an integrator, checked."""
    asked.check(method)
    n, numbers, horizon = len(members.numbers), members.numbers, members.horizon
    names = members.names
    period = None
    if asked.per_nutation is not None or asked.nutations is not None:
        period = _periods(numbers, names)
    if period is not None and asked.nutations is not None:
        with np.errstate(over="ignore"):  # an infinite horizon is refused below
            horizon = for_each("nutations", asked.nutations, n, names) * period
    elif asked.horizon is not None:
        horizon = for_each("horizon", asked.horizon, n, names)
    if horizon is None:
        raise SymtopError(
            "give horizon or nutations: these members have no horizon of their own", "horizon", "nutations"
        )
    horizon_of(float(horizon.min()))
    _check_ends(horizon, asked, names)
    steps = bounds = None
    if period is not None and asked.per_nutation is not None:
        counted = for_each("per_nutation", asked.per_nutation, n, names)
        steps = _steps(_parts(period, counted, horizon, names), horizon, budget or MOST_STEPS, names)
    elif method.fixed_step:
        steps = _steps(for_each("step_size", asked.step_size, n, names), horizon, budget or MOST_STEPS, names)
    elif method.adaptive:
        period = nutation_periods(numbers) if period is None else period
        bounds = _tolerances(method, asked.tolerance, members, horizon, period)
    return Job(method, chart, numbers, horizon, steps, bounds, samples, budget, shown, period, names)


def _check_ends(horizon: Array, asked: "_Asked", names: Any) -> None:
    """Refuse a horizon beyond the times that the closed form takes."""
    for i in np.flatnonzero(horizon > LONGEST_TIME)[:1]:
        if asked.nutations is not None:
            raise SymtopError(
                f"nutations must be fewer: they take {called(names, i)} beyond a time of {LONGEST_TIME:g}", "nutations"
            )
        raise SymtopError(
            f"horizon must be at most {LONGEST_TIME:g}, not {horizon[i]!s} as of {called(names, i)}", "horizon"
        )


def _periods(numbers: Array, names: Any) -> Array:
    """Nutation periods; SymtopError for a member that has none."""
    period = nutation_periods(numbers)
    endless = np.flatnonzero(~np.isfinite(period))
    if endless.size:
        raise SymtopError(
            f"per_nutation and nutations count nutation periods, and that of {called(names, endless[0])} is endless",
            "per_nutation",
            "nutations",
        )
    return period


def _parts(period: Array, counted: Array, horizon: Array, names: Any) -> Array:
    """A step of each member, of which its nutation period has so many."""
    with np.errstate(over="ignore"):  # a step that is infinite is longer than the horizon, too
        step: Array = period / counted
    for i in np.flatnonzero(step > horizon)[:1]:
        least = f"{period[i] / horizon[i]:.4g}, a step within the horizon"
        raise SymtopError(
            f"per_nutation must be at least {least}, not {counted[i]:.4g} as of {called(names, i)}", "per_nutation"
        )
    return step


def _steps(step: Array, horizon: Array, most: float, names: Any) -> NDArray[np.int64]:
    """Whole steps of each member, as `simulation.make_plan` counts and refuses them."""
    with np.errstate(over="ignore"):
        ratio = horizon / step
    for i in np.flatnonzero(step > horizon)[:1]:
        raise SymtopError(
            f"step_size must be at most the horizon, not {step[i]!s} of {horizon[i]!s} as of {called(names, i)}",
            "step_size",
        )
    for i in np.flatnonzero(ratio > most)[:1]:
        raise SymtopError(
            f"{called(names, i)} asks for {ratio[i]:.3g} steps; the limit is {most:.3g} (see budget)", "budget"
        )
    return np.maximum(1, np.rint(ratio)).astype(np.int64)


def _tolerances(method: Integrator, tolerance: object, members: Members, horizon: Array, period: Array) -> Array:
    """Tolerance of each member; a horizon that `simulation.make_plan` would refuse is refused."""
    numbers, names = members.numbers, members.names
    pendulum = np.sqrt(np.abs(numbers[:, 2]) / numbers[:, 0]) / (2.0 * np.pi)
    swings = horizon * np.maximum(1.0 / period, pendulum)
    for i in np.flatnonzero(swings > MOST_SWINGS)[:1]:
        raise SymtopError(
            f"the horizon of {called(names, i)} is {swings[i]:.3g} swings of the top; an adaptive method may take "
            f"{MOST_SWINGS:.3g}"
        )
    if np.ndim(tolerance) == 0:  # type: ignore[arg-type]
        return np.broadcast_to(method.check_tolerance(tolerance), len(numbers))
    row = for_each("tolerance", tolerance, len(numbers), names)
    for value in (row.min(), row.max()):
        method.check_tolerance(float(value))
    return row
