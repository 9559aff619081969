"""judge(): anybody's integrator against its claims in a process of its own; or a trajectory, as far as it shows them.

*A step* that hangs, crashes or takes too long costs one verdict. The process is forked, so that any function can be
judged, and sends its findings as they are made; the one that waits looks at its heartbeat. A call that does not return
is ended with its process; if it was a step backwards, the next process refuses such steps and measures the same claims
again, and else the claims stay undecided and say why. Where the system cannot fork, or JAX is loaded here, whose
threads a fork would lose, the battery runs in this process and has no limits.

*A trajectory without a method*: its errors are against the true motion of the scene (`symtop.measure.errors`). Where
the angular momentum L in space is there, energy and momenta are recomputed from it, whatever the file reports,

    E = |L|^2/2 I1 + (L.e)^2 (1/I3 - 1/I1)/2 + mgl e_z,      p_phi = L_z,      p_psi = L.e,

and else they are those of the file. A text file has a line of names and then numbers, with commas or blanks between:
time, elapsed since the start of the scene, and any of

    ex ey ez           the axis, a unit vector in space, z up       theta phi psi         Euler angles (z-x-z), rad
    qw qx qy qz        the attitude, body to space                  energy p_phi p_psi
    Lx Ly Lz           the angular momentum in space

A netCDF file has time, axis (n, 3), quaternion (n, 4), momentum (n, 3) and the same scalars, or is one of `simulate`.
"""

import contextlib
import faulthandler
import math
import multiprocessing
import os
import signal
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from symtop.core import netcdf
from symtop.core.errors import SymtopError, at_home, boolean, one_of, shown, words_of
from symtop.judging.adapters.adapter import heartbeat
from symtop.judging.battery import Stage, measure, stages, unmeasured
from symtop.judging.claims.constants import KEPT, Constant
from symtop.judging.claims.subject import Request
from symtop.judging.findings import NOTHING, About, Finding, Measured, StepLedger, undecided
from symtop.measure.conservation import CONSTANTS, constant_of
from symtop.measure.errors import completed, errors, refuse_other_scene, sampled
from symtop.methods.framework.registry import ENERGY_ERRORS
from symtop.model.charts import CHARTS, space_energy
from symtop.model.scenes import Scene, scene as find_scene
from symtop.run.trajectory import Trajectory

Listener = Callable[[About | Finding], object]
FILES = (".csv", ".txt", ".dat", ".nc")
VECTORS = {"axis": ("ex", "ey", "ez"), "quaternion": ("qw", "qx", "qy", "qz"), "momentum": ("Lx", "Ly", "Lz")}
SCALARS = ("time", "theta", "phi", "psi", *CONSTANTS)
FEWEST = 100  # samples by which a law of growth is judged
THREADED = "jax"  # hangs in a process that was forked after its import
LOOK = 0.05  # seconds between two looks
OPENING = 60.0  # seconds for loading a file and its imports
# seconds for the claims of one stage: at most, for all stages together, and at least however many were spent
VERDICT, QUICK_VERDICT = (45.0, 120.0, 15.0), (12.0, 40.0, 6.0)
WORDS = 160  # characters of what a process says before it ends


def judge(
    target: Any, *, form: str | None = None, chart: str = "axis", scene: "str | Scene" = "spheroid",
    order: int | None = None, symplectic: bool | None = None, symmetric: bool | None = None,
    explicit: bool | None = None, conserves: Collection[str] | None = None, energy: str | None = None,
    adaptive: bool = False, quick: bool = False, tell: Listener | None = None,
) -> StepLedger:  # fmt: skip
    """Judge anything that steps: its order, structure, invariants and drift on the top, beside what is claimed of it.

    `target` is one of (`form` says which where it does not show)

        ode       a function step(f, t, y, h) -> y for y' = f(t, y), or "FILE.py:NAME"
        separable a function step(state, h, dT, dV) -> state of (theta, p_theta), or "FILE.py:NAME"
        rotation  a function step(q, w, h, inertia, torque) -> q, w of a rigid body, or "FILE.py:NAME"
        scipy     a class derived from scipy.integrate.OdeSolver, or "FILE.py:NAME"; with `adaptive`, at a tolerance
        diffrax   an instance of a solver, such as diffrax.Tsit5(), or "FILE.py:NAME"
        torch     a function step(f, t, y, h) -> y on batches of tensors, y of shape (batch, 6), or "FILE.py:NAME"
        jax       the same on batches of JAX arrays, compiled by jax.jit
        shared    "FILE.so" or "FILE.so:NAME": void step(double *y, double h, const double *par, long n)
        program   a command that reads one line and writes states (see `symtop.judging.adapters.external`)

    or states without a method: a CSV or netCDF file, a Dataset or a mapping (`symtop.judging.judge_step`), whose
    errors, drift and laws of growth are found.

    `chart` says what y is: "axis" (e, L), shape (6,); "attitude" (q, L), shape (7,); "angles" (theta, phi, psi and
    their rates), shape (6,), in radians and the units of the scene's top. Claims that are not made are measured all
    the same. `conserves` holds names such as "p_phi", "energy"; `energy` is "kept" or "bounded". The step runs in a
    process of its own: one that hangs or crashes costs a verdict and says so. `quick` takes ten seconds at most.
    `tell` is handed what is judged and then each finding, as they are made.

    Returns a `StepLedger`: ``ledger["order"]`` is a finding, ``print(ledger)`` shows all of them,
    ``ledger.dataset()`` is the same as a Dataset, ``ledger.refuted`` names the claims that are false. Raises
    SymtopError for a target that cannot be loaded and claims that make no sense.
    """
    one_of("chart", chart, CHARTS)
    if not isinstance(energy, str | None) or energy not in ENERGY_ERRORS:
        raise SymtopError(f"energy must be 'kept', 'bounded' or None, not {shown(energy)}", "energy")
    claims = {"order": order, "symplectic": symplectic, "symmetric": symmetric, "explicit": explicit}
    claims_of_energy = {"conserves": conserves, "energy_error": energy}
    flags = boolean("adaptive", adaptive), find_scene(scene), boolean("quick", quick)
    request = Request(target, form, chart, *flags, claims | claims_of_energy)
    made = request.claimed()  # claims that make no sense are refused before anything is loaded
    implied = {"time"} | ({"energy"} if energy is None and "energy" not in (made.conserves or ()) else set())
    table = isinstance(target, (xr.Dataset, Mapping))
    file = isinstance(target, (str, Path)) and str(target).lower().endswith(FILES) and " " not in str(target)
    if form is None and (table or file):
        if {order, symplectic, symmetric, explicit} != {None}:
            raise SymtopError("a trajectory shows no order, symplecticity, symmetry or cost: claim what it conserves")
        implied, about = (
            set(),
            About(Path(target).stem if isinstance(target, (str, Path)) else "trajectory", "", "", 0.0),
        )
        findings_of_it = of_trajectory(target, request.scene, made.conserves or (), energy)
        events: Iterable[About | Results] = [about, Results(findings_of_it, {})]
    else:
        events = run(request)
    findings: list[Finding] = []
    traces: dict[str, Any] = {}
    listen = tell or (lambda _: None)
    for event in events:
        if isinstance(event, About):
            about = event
            listen(about)
            continue
        for one in event.findings:
            listen(one)
        findings += event.findings
        traces |= event.traces
    if not findings:
        raise SymtopError("it cannot be judged: its process ended before it was open")
    return StepLedger(about.name, request.scene.name, tuple(findings), traces, about, frozenset(implied))


def read(target: Any) -> dict[str, Any]:
    """Columns by name, of a text file, a Dataset or a mapping; SymtopError for anything else."""
    if not isinstance(target, (str, Path)):
        return {name: np.asarray(target[name]) for name in (*VECTORS, *SCALARS) if name in target}
    path = at_home(target)
    try:
        head, *lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "it is no text, or empty"
        raise SymtopError(f"the trajectory {path} cannot be read: {reason}") from None
    names = head.lstrip("# ").replace(",", " ").split()
    known = (*SCALARS, *(part for parts in VECTORS.values() for part in parts))
    if not set(names) <= set(known) or "time" not in names or len(set(names)) < len(names):
        raise SymtopError(
            f"{path.name} must begin with a line of names, time and of {', '.join(known[1:])}, not {head[:60]!r}"
        )
    rows = [line.replace(",", " ").split() for line in lines if line.strip()]
    for k, row in enumerate(rows):
        if len(row) != len(names):
            raise SymtopError(f"{path.name} must have {len(names)} numbers a line, and row {k + 1} has {len(row)}")
    try:
        table = np.array(rows, dtype=float).reshape(-1, len(names))
    except ValueError as error:
        raise SymtopError(f"{path.name} must hold numbers: {error}") from None
    columns = dict(zip(names, table.T, strict=True))
    for name, parts in VECTORS.items():
        if set(parts) <= set(columns):
            columns[name] = np.stack([columns[part] for part in parts], axis=-1)
    return {name: values for name, values in columns.items() if name in (*VECTORS, *SCALARS)}


def of_trajectory(target: Any, scene: Scene, conserves: Collection[str], energy: str | None) -> list[Finding]:
    """A finding for each error and each constant that the samples show, or that is claimed: then it is undecided.

    Raises SymtopError for data that are no trajectory of a top, or name another top or start than the scene's.
    """
    if isinstance(target, (str, Path)) and str(target).lower().endswith(".nc"):
        target = netcdf.read(target)
    if isinstance(target, xr.Dataset):
        refuse_other_scene(target, scene)
        target = sampled(target)
    given = read(target)
    momentum = given.pop("momentum", None)
    apart = errors(given, scene)
    time = apart["time"].values
    shown = [_error(name, time, apart) for name in ("axis", "attitude", "theta") if name in apart]
    own = _from_states(scene, given, momentum)
    for name in (*CONSTANTS, *sorted({*conserves} - {*CONSTANTS})):
        values = own.get(name, given.get(name))
        declared = energy if name == "energy" and energy else "kept" if name in conserves else ""
        if values is not None:
            shown.append(_constant(name, declared, time, np.asarray(values, float), scene))
        elif declared:
            remedy = f"; it would with {name}, or with the angular momentum beside the axis"
            remedy = remedy if name in CONSTANTS else ", as its axes are scaled to length one"
            shown.append(undecided(name, declared, f"the trajectory shows no {name}{remedy}"))
    return shown


def _from_states(scene: Scene, given: Mapping[str, Any], momentum: Any) -> dict[str, np.ndarray]:
    """Energy and momenta by the angular momentum and the axis; nothing where one of them is not there."""
    if momentum is None:
        return {}
    axis, L = completed(Trajectory.of_data(given)).axis, np.asarray(momentum, dtype=float)
    if axis is None:
        return {}
    if L.shape != axis.shape:
        raise SymtopError(f"momentum must have the shape {axis.shape}, one row for each time, not {L.shape}")
    p_psi = np.sum(L * axis, axis=1)
    return {"energy": space_energy(scene.top, axis, L, p_psi), "p_phi": L[:, 2], "p_psi": p_psi}


def _error(name: str, time: np.ndarray, apart: xr.Dataset) -> Finding:
    """The largest error of a quantity and its law of growth."""
    values = apart[name].values
    growth = constant_of(time, values) if time.size >= FEWEST else None
    largest = float(np.nanmax(values)) if np.isfinite(values).any() else math.nan
    bound = float(np.nanmax(apart[f"{name}_bound"].values))
    why = f"largest error {largest:.1e} rad in {time.size} samples up to t = {time[-1]:.4g}"
    if growth is not None and math.isfinite(growth.exponent):
        why += f", growing as t^{growth.exponent:.2f} +- {growth.exponent_interval:.2f} ({growth.law})"
    law = growth.law if growth is not None and growth.law not in ("undecided", "not judged") else ""
    measured = Measured(law, largest, text=f"{largest:.0e} rad{law and ', '}{law}")
    return Finding(f"{name}_error", "", measured, "measured", why, largest, bound)


def _constant(name: str, declared: str, time: np.ndarray, values: np.ndarray, scene: Scene) -> Finding:
    """What became of a constant of the motion, beside what is claimed of it."""
    scale, grain = (scene.energy_scale, scene.energy_grain) if name == "energy" else (scene.momentum_scale, 1.0)
    true = getattr(scene.top.momenta(scene.start), name) if name != "energy" else scene.top.energy(scene.start)
    change = (values - values[0]) / scale
    constant = Constant(constant_of(time, change), math.nan, KEPT * grain, grain)
    largest, off = constant.changed.largest, abs(values[0] - true) / scale
    why = f"largest relative change {largest:.1e} in {time.size} samples; it begins {off:.1e} from the scene's"
    kind = constant.kind if time.size >= FEWEST else "kept" if largest <= constant.floor else "unknown"
    if kind == "unknown":
        why = f"{why}; no law of growth to judge it by"
        return Finding(name, declared, NOTHING, "undecided", why, largest, constant.floor)
    if kind != "kept":
        why += f", growth exponent {constant.changed.exponent:.2f} +- {constant.changed.exponent_interval:.2f}"
    if declared == "bounded" and constant.grows is None:
        why = f"{why}, which leaves open whether it grows"
        return Finding(name, declared, NOTHING, "undecided", why, largest, constant.floor)
    holds = {"kept": kind == "kept" or largest <= constant.floor, "bounded": not constant.grows}.get(declared)
    verdict = "measured" if holds is None else "confirmed" if holds else "refuted"
    return Finding(name, declared, Measured(kind, largest), verdict, why, largest, constant.floor)


class Results(NamedTuple):
    """The findings of one stage, and what a figure shows of all stages so far."""

    findings: list[Finding]
    traces: dict[str, Any]


class _LostError(Exception):
    """A process was ended, or ended by itself: why, and whether it was in a step of -h."""


def run(request: Request) -> Iterator[About | Results]:
    """First what is judged, then findings as they are made; SymtopError if it cannot be opened."""
    todo = stages("step")
    if "fork" not in multiprocessing.get_all_start_methods() or THREADED in sys.modules:
        yield from _work(request, todo)
        return
    heartbeat.reset(quick=request.quick)
    opened, began = False, time.monotonic()
    while todo:
        try:
            for event in _isolated(request, todo, began):
                if isinstance(event, Results):
                    todo.pop(0)
                if isinstance(event, Results) or not opened:
                    yield event
                opened = True
        except _LostError as failure:
            if not opened:
                raise SymtopError(f"it cannot be judged: {failure.args[0]}") from None
            yield from _left_open(request, todo, *failure.args)
        else:
            return


def _left_open(request: Request, todo: list[Stage], why: str, backwards: bool) -> Iterator[Results]:
    """What a failure leaves undecided: one stage; all without a call; none if it was a step of -h, then refused."""
    if backwards and not heartbeat.forward_only:
        heartbeat.forward_only = True
        return
    for stage in todo[:] if todo[0][0].name == "calls" else todo[:1]:
        todo.remove(stage)
        yield Results(unmeasured(stage, request.claimed(), why), {})


def _work(request: Request, todo: list[Stage]) -> Iterator[About | Results]:
    """The stages, in this process."""
    subject = request.open()
    stepper = subject.stepper
    yield About(stepper.name, stepper.chart, stepper.implementation, subject.seconds_a_step)
    for stage in todo:
        yield Results(measure(stage, subject), subject.traces)


def _isolated(request: Request, todo: list[Stage], first: float) -> Iterator[About | Results]:
    """The stages in a forked process; `first` is when the judging began."""
    context: Any = multiprocessing.get_context("fork")
    ours, theirs = context.Pipe()
    with tempfile.TemporaryFile() as output, ours:
        process = context.Process(target=_child, args=(request, list(todo), theirs, output), daemon=True)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # newer versions of Python warn of threads; the child uses none of theirs
            heartbeat.inside = False
            process.start()
        theirs.close()
        try:
            yield from _events(process, ours, output, first, quick=request.quick)
        finally:
            if process.is_alive():
                with contextlib.suppress(OSError):
                    os.killpg(process.pid, signal.SIGKILL)
                process.kill()
            process.join()


def _child(request: Request, todo: list[Stage], pipe: Any, output: Any) -> None:
    os.setsid()  # what it starts is ended with it
    for stream in (1, 2):
        os.dup2(output.fileno(), stream)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    faulthandler.disable()  # a crash is reported by the one that waits
    try:
        for event in _work(request, todo):
            pipe.send(event)
    except BaseException as error:  # noqa: BLE001  (somebody else's code)
        pipe.send(error if isinstance(error, SymtopError) else _LostError(words_of(error), False))
    pipe.send(None)


def _events(process: Any, pipe: Any, output: Any, first: float, *, quick: bool) -> Iterator[About | Results]:
    """What the process sends; _LostError if it ends otherwise, hangs in a call or takes too long for a stage."""
    limit, began = OPENING, _clock(process.pid)
    calls, since = heartbeat.calls, began
    while True:
        if pipe.poll(LOOK):
            try:
                event = pipe.recv()
            except EOFError:
                event = _LostError(_death(process, output), False)
            if isinstance(event, Exception):
                raise event
            if event is None:
                return
            yield event
            began = _clock(process.pid)
            most, together, least = QUICK_VERDICT if quick else VERDICT
            limit = max(least, min(most, together - (began - first)))
            continue
        now = _clock(process.pid)
        if heartbeat.calls != calls or not heartbeat.inside:
            calls, since = heartbeat.calls, now
        if now - since > heartbeat.allowed:
            why = f"a step of h = {heartbeat.step:.3g} had not returned after {now - since:.0f} s"
            raise _LostError(why, heartbeat.step < 0)
        if now - began > limit:
            raise _LostError(f"it was not judged within {limit:.0f} s", False)


def _clock(pid: int) -> float:
    """Seconds, less those that a process has waited for a processor, which Linux counts; elsewhere all time counts."""
    try:
        waited = int(Path(f"/proc/{pid}/schedstat").read_text(encoding="ascii").split()[1]) * 1e-9
    except (OSError, IndexError, ValueError):
        waited = 0.0
    return time.monotonic() - waited


def _death(process: Any, output: Any) -> str:
    process.join(2.0)
    code = process.exitcode
    if code is not None and code < 0:
        during = f" in a step of h = {heartbeat.step:.3g}" if heartbeat.inside else ""
        return f"its process was ended by {signal.Signals(-code).name}{during}"
    output.seek(0)
    words = " ".join(output.read()[-4 * WORDS :].decode(errors="replace").split())[-WORDS:]
    return f"its process ended with code {code}{': ' if words else ''}{words}"
