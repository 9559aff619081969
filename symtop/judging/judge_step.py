"""judge(): test a foreign integrator against its claims in a process of its own, or a trajectory without its method.

*A trajectory*: its errors are against the true motion of the scene (`symtop.measure.errors`). If it has the angular
momentum L in space, energy and momenta are recomputed from that, whatever the file reports,

    E = |L|^2/2 I1 + (L.e)^2 (1/I3 - 1/I1)/2 + mgl e_z,      p_phi = L_z,      p_psi = L.e,

otherwise those of the file are used. Rates together with an attitude also give L. On a body without symmetry E is that
of `symtop.model.body`, there is no p_psi, and the momentum and the rates have errors of their own: rates may be right
where the attitude is wrong. A text file has a line of names and then numbers, separated by commas or blanks: time,
elapsed since the start of the scene, and any of

    ex ey ez           the axis, a unit vector in space, z up       theta phi psi         Euler angles (z-x-z), rad
    qw qx qy qz        the attitude, body to space                  energy p_phi p_psi
    Lx Ly Lz           the angular momentum in space                wx wy wz              rates in body axes

A netCDF file has time, axis (n, 3), quaternion (n, 4), momentum (n, 3), omega_body (n, 3) and the same scalars, or is
one of `simulate`.
"""

import functools
import math
import secrets
import time
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from symtop.core import netcdf
from symtop.core.errors import SymtopError, at_home, boolean, function, one_of, shown, whole
from symtop.judging.adapters.adapter import Stepper, heartbeat, integrator
from symtop.judging.adapters.python_step import CONJUGATE
from symtop.judging.battery import measure, stages, unmeasured
from symtop.judging.claims.constants import KEPT_CHANGE, Constant, blow_up_finding, blows_up, momentum_grain
from symtop.judging.claims.subject import Subject, open_target, seconds_a_step
from symtop.judging.findings import PHRASES, About, Finding, Ledger, Reading, error_units, undecided
from symtop.judging.remote import Process, Remote, separated, solvers_of, table_of
from symtop.measure.conservation import CONSTANTS, constant_of
from symtop.measure.errors import checked, completed, doubles, errors, refuse_other_order, refuse_other_scene, unpadded
from symtop.methods.framework.registry import ENERGY_ERRORS, Integrator
from symtop.model.body import rotated
from symtop.model.charts import CHARTS, axis_distance, axis_from_quaternion, body_energy, space_energy
from symtop.model.scenes import Scene, scene as find_scene
from symtop.run.reference.truth import reference
from symtop.run.trajectory import Trajectory, column

FILES = (".csv", ".tsv", ".txt", ".dat", ".nc")
VECTORS = {
    "axis": ("ex", "ey", "ez"), "quaternion": ("qw", "qx", "qy", "qz"), "momentum": ("Lx", "Ly", "Lz"),
    "omega_body": ("wx", "wy", "wz"),
}  # fmt: skip
SCALARS = ("time", "theta", "phi", "psi", *CONSTANTS)
OF_STATES = ("axis", "attitude", "theta", "momentum", "rates")
SINGLE_LENGTH = 1e-6  # a length that differs less from one, as by single precision, gets no finding
MOST_FAULTS = 3  # most faults of a line of names in a message
# above the rounding of a file: largest angle, in rad, between the axis and the third axis of the quaternion, and the
AGREE = 1e-3  # relative difference of a constant at the start from the scene's that is not worth mentioning
FEWEST_SAMPLES = 100  # samples from which a law of growth is judged
SEEDS = 1_000_000_000  # random seeds are below this
LOADING_SECONDS = 60.0  # seconds for loading a file and its imports
PLUGIN_SECONDS = 600.0  # seconds for a stage of a registered integrator
# seconds for a stage of a step: at most, for all stages together, and at least in any case
VERDICT_SECONDS, QUICK_VERDICT_SECONDS = (45.0, 120.0, 15.0), (12.0, 40.0, 6.0)
SHORTER_RUNS = 4.0  # factor by which the runs of a stage that took too long are shorter when it is repeated
SLOW_HINTS = "; make a step faster", "; judge it without --quick, or make a step faster"  # the second with --quick
SERVER_HINT = ", or if it starts slowly make it a server"  # for a program


def judge(
    target: Any, *, form: str | None = None, chart: str = "axis", scene: str | Scene = "spheroid",
    order: int | None = None, symplectic: bool | None = None, symmetric: bool | None = None,
    explicit: bool | None = None, conserves: Collection[str] | None = None, energy: str | None = None,
    adaptive: bool = False, autonomous: bool = False, quick: bool = False, seed: int | None = None,
    tell: Callable[[About | Finding], object] | None = None,
) -> Ledger:  # fmt: skip
    """Judge a foreign integrator: measure its order, structure, invariants and drift, and compare them with its claims.

    `target` is one of (`form` says which, if that is ambiguous)

        ode       a function step(f, t, y, h) -> y for y' = f(t, y), or "FILE.py:NAME"
        separable a function step(state, h, dT, dV) -> state of (theta, p_theta), or "FILE.py:NAME"
        rotation  a function step(q, w, h, inertia, torque) -> q, w of a rigid body, or "FILE.py:NAME"
        scipy     a class derived from scipy.integrate.OdeSolver, or "FILE.py:NAME"; with `adaptive`, at a tolerance
        diffrax   an instance of a solver, such as diffrax.Tsit5(), or "FILE.py:NAME"
        torch     a function step(f, t, y, h) -> y on batches of tensors, y of shape (batch, 6), or "FILE.py:NAME"
        jax       the same on batches of JAX arrays, compiled by jax.jit
        shared    "FILE.so" or "FILE.so:NAME": void step(double *y, double h, const double *par, long n)
        program   a command that reads one line and writes states (see `symtop.judging.adapters.external`)
        server    the same, started once: it answers line after line, each answer ended by an empty line

    or states without a method: a CSV or netCDF file, a Dataset or a mapping (`symtop.judging.judge_step`), whose
    errors, drift and laws of growth are found.

    `chart` says what y is: "axis" (e, L), shape (6,); "attitude" (q, L), shape (7,); "angles" (theta, phi, psi and
    their rates), shape (6,), in radians and the units of the scene's top. A scene of a body without symmetry is for a
    trajectory and for the forms ode, with y = (q, M), M in body axes, rotation and scipy; for a step, the order, the
    energy and the momentum are measured on it. Properties without a claim are measured, too. `conserves` holds names
    such as "p_phi", "energy"; `energy` is "kept" or "bounded". The step runs in a process of its own: if it hangs or
    crashes, the verdict is undecided, with the reason. `quick` makes shorter runs. On a top the step is also tried at
    random starts, times and steps; `seed`, which the findings name, repeats the same. `autonomous` says that it was
    written for y' = f(y), whatever f is called with. `tell` is called with an `About`, then with each new finding.

    Returns a `Ledger`: ``ledger["order"]`` is a finding, ``print(ledger)`` shows all of them,
    ``ledger.dataset()`` is the same as a Dataset, ``ledger.refuted`` names the claims that are false. Raises
    SymtopError for a target that cannot be loaded and for invalid claims.
    """
    one_of("chart", chart, CHARTS)
    if not isinstance(energy, str | None) or energy not in ENERGY_ERRORS:
        raise SymtopError(f"energy must be 'kept', 'bounded' or None, not {shown(energy)}", "energy")
    file = isinstance(target, (str, Path)) and str(target).lower().endswith(FILES)
    states = form is None and (file or isinstance(target, (xr.Dataset, Mapping)))
    problem, emit = find_scene(scene, bodies=True), function("tell", (lambda _: None) if tell is None else tell)
    for name, flag in (("adaptive", adaptive), ("autonomous", autonomous), ("quick", quick)):
        boolean(name, flag)
    seed = secrets.randbelow(SEEDS) if seed is None else whole("seed", seed, 0, SEEDS)
    structure: dict[str, Any] = {"order": order, "symplectic": symplectic, "symmetric": symmetric, "explicit": explicit}
    claims = structure | {"conserves": conserves, "energy_error": energy}
    record = Integrator("claims", "other", "", {chart: Stepper()}, **claims)  # checked before anything is loaded
    names = record.conserves or frozenset()
    if states:
        if set(structure.values()) != {None}:
            raise SymtopError("a trajectory shows no order, symplecticity, symmetry or cost: claim what it conserves")
        findings = of_trajectory(target, problem, names, energy)
        about = About(Path(target).stem if isinstance(target, (str, Path)) else "trajectory")
        emit(about)
        for finding in findings:
            emit(finding)
        return Ledger(about.name, problem.name, tuple(findings), {}, about)
    if problem.of_body and ({symplectic, symmetric, explicit} != {None} or names - {"energy"}):
        words = "takes claims of its order and its energy alone; claim the rest on a top"
        raise SymtopError(f"a step on {problem.name}, a RigidBody, {words}")
    implied = {"time": not autonomous, "energy": energy is None and "energy" not in names, "order": order is None}
    heartbeat.reset(quick=quick)
    began, findings = time.monotonic(), []
    load = functools.partial(open_target, target, form, chart, on=problem, adaptive=adaptive)
    with Process(lambda: table_of(load)) as process:
        process.allow(LOADING_SECONDS)
        try:
            stepper = Remote(process)
            method = integrator(stepper, **claims)
            seconds = seconds_a_step(stepper, problem) if method.fixed_step else 0.0
        except SymtopError as error:
            raise SymtopError(f"it cannot be judged: {error}") if process.lost else error from None
        subject = Subject(method, problem, quick, stepper, seconds, seed, autonomous)
        facts = stepper.name, stepper.chart, stepper.implementation, subject.seconds_a_step
        about = About(*facts, seed, problem.time_scale())
        emit(about)
        slow, opening = SLOW_HINTS[quick] + SERVER_HINT * (form == "program"), time.monotonic() - began
        longest, total, shortest = QUICK_VERDICT_SECONDS if quick else VERDICT_SECONDS
        limits = longest + opening, total + opening, shortest + opening  # a process started again opens it again
        for finding in _findings(subject, process, began, limits, slow):
            emit(finding)
            findings.append(finding)
    derived = frozenset(finding.claim for finding in findings if finding.declared and implied.get(finding.claim))
    return Ledger(about.name, problem.name, tuple(findings), subject.traces, about, derived)


def read(target: Any) -> dict[str, Any]:
    """Columns by name, of a text file, a Dataset or a mapping; SymtopError for anything else."""
    if not isinstance(target, (str, Path)):
        return {name: doubles(name, column(target, name)) for name in (*VECTORS, *SCALARS) if name in target}
    path = at_home(target)
    try:
        head, *lines = path.read_text(encoding="utf-8-sig").replace(",", " ").splitlines()
    except (OSError, ValueError) as error:
        undecodable = isinstance(error, UnicodeDecodeError)
        reason = "it must be text in UTF-8" if undecodable else getattr(error, "strerror", None) or "it is empty"
        raise SymtopError(f"the trajectory {path} cannot be read: {reason}") from None
    names = head.lstrip("# ").split()
    fields = (*SCALARS, *(part for parts in VECTORS.values() for part in parts))
    for parts in VECTORS.values():
        if missing := {*parts} - {*names} if {*parts} & {*names} else ():
            words = f"{path.name} must have all of {', '.join(parts)}, and lacks {', '.join(sorted(missing))}"
            raise SymtopError(words)
    problems = [f"{name} is none of them" for name in dict.fromkeys(names) if name not in fields]
    problems += [f"{name} is there twice" for name in dict.fromkeys(names) if names.count(name) > 1]
    problems += ["there is no time"] * ("time" not in names)
    if problems:
        expected = f"{path.name} must begin with names, commas or spaces between: time and of {', '.join(fields[1:])}"
        faults = ", ".join(problems[:MOST_FAULTS]) + " ..." * (len(problems) > MOST_FAULTS)
        raise SymtopError(f"{expected}, but of {head[:60]!r} {faults}")
    if not any(line.partition("#")[0].strip() for line in lines):
        raise SymtopError(f"{path.name} must have a line of numbers below its names, and has none")
    rule = f"{path.name} must have {len(names)} numbers in each line"
    try:
        rows = np.loadtxt(lines, ndmin=2)
    except ValueError as error:
        raise SymtopError(f"{rule}: {str(error).partition(';')[0]}") from None
    if rows.shape[1] != len(names):
        raise SymtopError(f"{rule}, not {rows.shape[1]}")
    columns = dict(zip(names, rows.T, strict=True))
    rows_of = {name: [columns[part] for part in parts] for name, parts in VECTORS.items() if parts[0] in names}
    columns |= {name: np.stack(rows, axis=-1) for name, rows in rows_of.items()}
    return {name: values for name, values in columns.items() if name in (*VECTORS, *SCALARS)}


def of_trajectory(target: Any, scene: Scene, conserves: Collection[str], energy: str | None) -> list[Finding]:
    """A finding for each error and constant that samples show or that is claimed; SymtopError for another scene's."""
    if isinstance(target, (str, Path)) and str(target).lower().endswith(".nc"):
        target = netcdf.read(target)
    if isinstance(target, xr.Dataset):
        refuse_other_scene(target, scene)
        target = unpadded(target)
    columns = read(target)
    rates, states = columns.pop("omega_body", None), completed(checked(columns))
    if rates is not None:
        rates = np.asarray(rates, dtype=float)
        if states.quaternion is None or rates.shape != (states.time.size, 3):
            raise SymtopError(f"omega_body must be {states.time.size} rows of 3 beside an attitude, not {rates.shape}")
        if states.momentum is None:
            moments = scene.top.moments if scene.of_body else (scene.top.I1, scene.top.I1, scene.top.I3)
            states = states._replace(momentum=rotated(states.quaternion, rates * np.array(moments)))
            columns["momentum"] = states.momentum
    _refuse_contradiction(states, scene)
    deviation = errors(columns, scene)
    time = deviation["time"].values
    if rates is not None and scene.of_body:
        truth, moments = reference(scene, time), np.array(scene.top.moments)
        body_momentum = rotated(truth["quaternion"].values * CONJUGATE, truth["momentum"].values)
        bound = scene.momentum_scale / moments.min() * deviation["momentum_bound"].values
        gaps = np.linalg.norm(rates - body_momentum / moments, axis=1)
        deviation = deviation.assign(rates=("time", gaps), rates_bound=("time", bound))
    lengths = [name for name in map(str, deviation) if name.endswith("_length")]
    wrong_lengths = [name for name in lengths if (deviation[name] > SINGLE_LENGTH).any()]
    findings = [_error(name, scene, time, deviation) for name in (*OF_STATES, *wrong_lengths) if name in deviation]
    recomputed = _from_states(scene, states)
    for name in (*CONSTANTS, *sorted({*conserves} - {*CONSTANTS})):
        values = recomputed.get(name, columns.get(name))
        declared = energy if name == "energy" and energy else "kept" if name in conserves else ""
        if values is not None:
            note, values = "" if name in recomputed else ", as the file reports it", np.asarray(values, float)
            findings.append(_constant(name, declared, time, values, scene, states.momentum, note))
        elif declared:
            remedy = f"; it would with {name}, or with the angular momentum beside the axis"
            remedy = remedy if name in CONSTANTS else ", as its axes are scaled to length one"
            findings.append(undecided(name, declared, f"the trajectory shows no {name}{remedy}"))
    return findings


def _refuse_contradiction(states: Trajectory, scene: Scene) -> None:
    """SymtopError if axis and quaternion of a trajectory disagree, naming another convention if that explains it."""
    if states.axis is None or states.quaternion is None:
        return
    gap = axis_distance(states.axis, axis_from_quaternion(states.quaternion))
    if (gap > AGREE).any():  # false where it is NaN
        refuse_other_order(states.quaternion, reference(scene, states.time))
        k = int(np.nanargmax(gap))
        rule = f"axis and quaternion must show one attitude within {AGREE:g} rad, but at t = {states.time[k]:.6g}"
        raise SymtopError(f"{rule} the axis is {gap[k]:.2g} rad from that of the quaternion")


@np.errstate(invalid="ignore")  # L may be infinite
def _from_states(scene: Scene, states: Trajectory) -> dict[str, np.ndarray]:
    """Energy and momenta from the angular momentum and the attitude; empty if one of these is missing."""
    axis, L, q = states.axis, states.momentum, states.quaternion
    if L is None or axis is None or (scene.of_body and q is None):
        return {}
    if scene.of_body:
        inside = rotated(q * CONJUGATE, L)
        return {"energy": body_energy(scene.top, np.concatenate([q, inside], axis=1)), "p_phi": L[:, 2]}
    p_psi = np.sum(L * axis, axis=1)
    return {"energy": space_energy(scene.top, axis, L, p_psi), "p_phi": L[:, 2], "p_psi": p_psi}


def _error(name: str, scene: Scene, time: np.ndarray, deviation: xr.Dataset) -> Finding:
    """The finding on the largest error of a quantity and its law of growth, from the samples that are not NaN."""
    valid = np.isfinite(deviation[name].values)
    if not valid.any():
        return undecided(f"{name}_error", "", f"all of its {valid.size} samples are lost")
    time, values, missing = time[valid], deviation[name].values[valid], int((~valid).sum())
    growth = constant_of(time, values) if time.size >= FEWEST_SAMPLES else None
    largest, note = float(values.max()), f", {missing} of {valid.size} samples lost" * bool(missing)
    bound = float(np.nanmax(deviation[f"{name}_bound"].values))
    unit = error_units(name)
    why = f"largest error {largest:.1e}{unit} in {time.size} samples up to t = {time[-1]:.4g}{scene.second}{note}"
    if growth is not None and math.isfinite(growth.exponent):
        why += f", growing as t^{growth.exponent:.2f} +- {growth.exponent_interval:.2f} ({growth.law})"
    law = growth.law if growth is not None and growth.law not in ("undecided", "not judged") else ""
    text = f"{largest:.0e}{unit} to t = {time[-1]:.4g}{scene.second}{law and ', '}{law}{note}"
    return Finding(f"{name}_error", "", Reading(law, largest, text=text), "measured", why, largest, bound)


def _constant(
    name: str, declared: str, time: np.ndarray, values: np.ndarray, scene: Scene, L: Any, note: str
) -> Finding:  # fmt: skip
    """The finding on the change of a constant, with the claim `declared`; L (n, 3) or None, `note` ends its words."""
    valid = ~np.isnan(values)
    if not valid.any():
        return undecided(name, declared, f"all of its {valid.size} samples are lost")
    time, values = time[valid], values[valid]
    scale, grain = scene.momentum_scale, momentum_grain(scene, L)
    if name == "energy":
        scale, grain = scene.energy_scale, scene.energy_grain
    true = getattr(scene.top.momenta(scene.start), name) if name != "energy" else scene.top.energy(scene.start)
    times = time if time[-1] else [1.0]  # with a single sample at the start nothing grows
    change = constant_of(times, (values - values[0]) / scale, period=scene.time_scale())
    if time.size < FEWEST_SAMPLES:
        change = change._replace(exponent=math.nan)
    constant = Constant(change, math.nan, KEPT_CHANGE * grain, grain)
    count = f"{time.size}{f' of {valid.size}' * (not valid.all())} samples"
    gap = float(abs(values[0] - true)) / scale
    finding = constant.finding(name, declared, constant.words(f"in {count}; it begins {gap:.1e} from the scene's"))
    note += f", and begins {gap:.0e} from the scene's" * (gap > AGREE)
    if note and (reading := finding.measured):
        text = PHRASES.get(reading.kind, "{1}").format(reading.number, reading) + note
        finding = finding._replace(measured=reading._replace(text=text))
    if finding.verdict != "refuted" and time.size < FEWEST_SAMPLES and np.ptp(time) < scene.time_scale():
        words = f"fewer than {FEWEST_SAMPLES}, over less than a {scene.period_word}, say nothing"
        finding = undecided(name, declared, f"{finding.why}; {words}")
    indices = blows_up(scene, (values - values[0]) / scale) if name == "energy" else np.flatnonzero(np.isinf(values))
    return blow_up_finding(finding, time[indices[0]], scene.of_body) if indices.size else finding


def _findings(
    subject: Subject, process: Process, began: float, limits: tuple[float, float, float], slow: str = ""
) -> Iterator[Finding]:
    """The findings of all stages. Claims of a stage whose process was lost are undecided; of all, if it was "calls"."""
    longest, total, shortest = limits
    todo = stages(subject.kind)
    for stage in todo:
        current = subject
        for _ in range(2):
            process.allow(max(shortest, min(longest, total - (time.monotonic() - began))))
            try:
                findings = measure(stage, current)
            except SymtopError:
                if not process.lost:
                    raise
            if not (process.late and subject.seconds_a_step):
                break
            current = replace(subject, seconds_a_step=SHORTER_RUNS * max(subject.seconds_a_step, process.late))
        first = "calls" in stage.claims
        process.lost += slow if process.late else ""
        if process.lost:
            claims = tuple(claim for skipped in (todo if first else [stage]) for claim in skipped.claims)
            findings = unmeasured(claims, subject, process.lost)
        yield from findings
        if process.lost and first:
            return


def judge_separately(method: Integrator, scene: Scene, *, quick: bool = False) -> Ledger:
    """The `Ledger` of a registered integrator, as `symtop.judging.battery.judge`; foreign solvers run in a process."""
    heartbeat.reset(quick=quick)
    limits = PLUGIN_SECONDS, math.inf, PLUGIN_SECONDS
    with Process(lambda: solvers_of(method)) as process:
        subject = Subject(separated(method, process), scene, quick, seed=secrets.randbelow(SEEDS))
        findings = tuple(_findings(subject, process, time.monotonic(), limits))
    return Ledger(method.name, scene.name, findings, subject.traces)
