"""The true motion of a scene with a bound on every error: the closed form, and independent checks on request.

By default the values are the closed form in double. Three errors add up at a time t:

    rounding     of the evaluation, which does not grow: `ROUNDING`. 10,010 tops of 26 families showed 7.1e-16 of theta
                 and 8.8e-16 of a component of the axis against 50 digits at times up to 1e6 nutations
                 (`benchmarks/accuracy.py`), and of phi and psi 4.8e-16 beyond their last digit
    rates        of two doubles: their relative bound (`ClosedForm.provenance`, below 1e-28) times t moves the motion
                 along its path, an angle of that times the angular velocity
    formulas     any other error: none is known

The third kind is checked for at every requested time: the angles, the axis and the quaternion are evaluated separately
and must agree on the attitude, and theta' and phi' must reproduce the energy and p_phi. If these differ by more than
`SUSPICIOUS_GAP`, the bound is pi.

A *certificate* is one comparison of a scene's closed form with independent checks; each kind includes the one before:

    digits        its angles, axis and attitude at `CHECKS` times and at the fastest moment before each, up to
                  `CERTIFIED_NUTATIONS` nutations, against the same formulas in 40 digits: finds errors of rounding
    discrete-map  its attitude over `OVERLAP_NUTATIONS` nutations against the iterated discrete map: finds errors of the
    formulas
    integration   the same attitude against heyoka's long double integration of the equations of motion: finds errors
                  that the formulas of the map share

It takes up to half a second and is stored on disk under a hash of the top, the start, the sources and the libraries;
later references of the scene name it. A certificate never lowers a bound; one that contradicts the bounds raises them.

A *body* without symmetry has no such closed form. Free, its motion is exact (`symtop.model.exact.free_body`); with a
weight it is an integration in long double, bounded by a second one (`symtop.model.exact.heavy_body`), or with
precision="quad" by one in quadruple precision. Beyond the time at which the bound passes 1e-9 rad, as it does in chaos,
or that takes more than a million steps, there is no reference.

With a `precision` the values are heyoka's integration of the equations of motion in that arithmetic, compared with the
closed form in 40 digits at some thirty times (`symtop.run.reference.independent_checks`). This is an independent check
and has digits beyond double, stored as pairs, ``theta + theta_lo``. Where an integration visibly differs from the
closed form, that distance is its bound. Results are cached on disk with a hash, by which damaged ones are recognised.
"""

import functools
import hashlib
import itertools
import math
import os
import warnings
from collections.abc import Callable
from pathlib import Path
from reprlib import repr as short
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from symtop.core import code_hash, netcdf
from symtop.core.errors import SymtopError, SymtopWarning, one_of
from symtop.core.files import cache_root, make_private, prune, touch
from symtop.core.numbers import EPSILON, TINY, real_numbers
from symtop.methods.taylor import heyoka
from symtop.model import charts
from symtop.model.body import Attitude, RigidBody
from symtop.model.charts import Array
from symtop.model.exact.closed_form import ClosedForm
from symtop.model.exact.free_body import BodyMotion, FreeBody
from symtop.model.exact.heavy_body import MOST_STEPS, HeavyBody
from symtop.model.exact.turning_points import RATE
from symtop.model.scenes import Scene, closed_form, scene as find_scene
from symtop.run.reference.independent_checks import (
    CHECKED,
    CHECKS,
    DIGITS,
    SAFETY,
    Checks,
    Integration,
    check_times,
    envelope,
    have_heyoka,
    integrate,
    integrate_with_checks,
    integration_values,
    iterate_map_with_error,
    largest_errors,
)
from symtop.run.reference.sensitivity import FAR_APART, LEAST_CHANGE, conditioning
from symtop.run.trajectory import dataset

PRECISIONS = ("closed-form", "double", "longdouble", "quad")
KINDS = ("digits", "discrete-map", "integration")  # of certificates
CERTIFIED_NUTATIONS, OVERLAP_NUTATIONS = 1e6, 100.0  # nutations
ROUNDING = {"theta": 2e-15, "axis": 2e-15, "attitude": 4e-15, "phi": 2e-15, "psi": 2e-15}  # rad
SUSPICIOUS_GAP = 1e-12  # a disagreement beyond this is an error, not rounding
ILL_CONDITIONED = 1e4  # amplification beyond which ``conditioning`` states the effect of rounding the start
UNCERTIFIED = "none; certify='digits', 'discrete-map' or 'integration' makes one"
MOST_CACHED = 200_000  # times; larger results are not cached on disk
MOST_BYTES = 500_000_000  # of the folder on disk; a reference at 1000 times takes 200 kB
FILES_A_CHECK = 50  # files that a process writes between two checks of the size of the folder
COMPILED = tuple(code_hash.PACKAGE / "core" / name for name in ("jit.py", "sines.py"))  # without importing numba

_written = itertools.count()


def reference(
    scene: str | Scene, times: ArrayLike, precision: str = "closed-form", *, certify: str | None = None
) -> xr.Dataset:
    """The true motion at the given times, each value with a bound on its error.

    Variables as in `simulate` (``theta``, ``phi``, ``psi``, ``axis``, ``quaternion``, ``energy``, ``p_phi``, ...), for
    an integration their low parts ``theta_lo`` ..., and ``axis_error_bound``, ``attitude_error_bound``,
    ``theta_error_bound``, ``phi_error_bound``, ``psi_error_bound`` in radians, for the sum of both parts. All have the
    dimension ``time``, in the order of `times`; axis and quaternion have a second one. `precision` is "closed-form", or
    "double", "longdouble" or "quad" for heyoka's integration in that arithmetic.

    `certify`, for the closed form: "digits" compares it with 40 digits, "discrete-map" also with `exact-discrete`
    iterated, "integration" also with heyoka in long double; each once per scene, and stored on disk.
    Attributes: ``bound`` from what the bounds are derived, ``certificate`` with what the closed form of this scene has
    been compared, and the result, ``arithmetic`` in which its constants were computed, ``conditioning`` how much the
    motion amplifies a change of its start (`symtop.run.reference.sensitivity`): bounds are for exactly these doubles.

    For a body without symmetry: ``quaternion``, ``axis`` (its third), ``theta``, ``momentum`` (L in the space frame),
    ``energy``, ``p_phi``, ``quaternion_lo``, and the bounds of axis, attitude and theta.

    Raises SymtopError for times that are negative, not finite or none, and for those beyond a body's reference.
    """
    problem = find_scene(scene, bodies=True)
    instants = real_numbers("times", times)
    if instants.ndim != 1 or instants.size == 0 or not np.isfinite(instants).all() or instants.min() < 0.0:
        raise SymtopError(f"times must be a row of finite numbers of at least 0, not {short(times)}")
    one_of("precision", precision, PRECISIONS)
    if problem.of_body:
        return _of_body(problem, instants, precision, certify)
    if certify is not None:
        one_of("certify", certify, KINDS)
        if precision != "closed-form":
            raise SymtopError(f"certify is for the closed form; precision {precision!r} is checked as it is computed")
    source = precision if have_heyoka() else "closed-form"
    if not have_heyoka() and (source != precision or certify == "integration"):
        missing = "is certified without an integration" if source == precision else f"stands in for {precision!r}"
        warnings.warn(f"heyoka is not installed: the closed form in double {missing}", SymtopWarning, stacklevel=2)
    if source == "closed-form":
        data, words = _by_closed_form(problem, instants, certify)
    else:
        data, words = _by_integration(problem, instants, source)
    words = {"scene": problem.name, "precision": source, "asked_for": precision} | words
    return netcdf.describe(data, f"reference motion of {problem.name}", problem.units, **words)


@functools.lru_cache(maxsize=64)
def _motion(body: RigidBody, start: Attitude) -> FreeBody | HeavyBody:
    initial = start.quaternion, body.momentum(start), body.momentum_lo(start)
    return FreeBody(body.moments, *initial) if body.free else HeavyBody(body.moments, body.torque, *initial)


@functools.lru_cache(maxsize=16)
def body_samples(name: str, body: RigidBody, start: Attitude, plain: bytes, precise: bool) -> BodyMotion:
    """The motion of a body at times with the bytes `plain`, cached, not to change; SymtopError if it ends before."""
    motion, times = _motion(body, start), np.frombuffer(plain).copy()
    sample = motion.samples if body.free else functools.partial(motion.samples, precise=precise)  # type: ignore[call-arg]
    if not np.isfinite((result := sample(times)).bound).all():  # `known` does not depend on `times`
        limit = float(f"{0.999 * result.known:.4g}")
        why = "its motion is not known to 1e-9 rad for longer"
        if result.too_long:
            why = f"to integrate its motion for longer takes more than {MOST_STEPS:,} Taylor steps"
        words = f"at most {limit:g} on {name}, not {times.max():.6g}: {why}"
        raise SymtopError(f"times must be {words}", "times")
    return result


def _of_body(scene: Scene, times: Array, precision: str, certify: str | None) -> xr.Dataset:
    body, start = scene.top, scene.start
    precisions = ("closed-form",) if body.free else ("closed-form", "longdouble", "quad")
    one_of(f"precision on {scene.name}", precision, precisions)
    if certify is not None:
        raise SymtopError(f"certify must be None on {scene.name}, a body without symmetry, not {certify!r}")
    motion = body_samples(scene.name, body, start, times.tobytes(), precision == "quad")
    quaternion = motion.quaternion
    momentum = charts.lifted(np.concatenate([quaternion, motion.momentum], axis=1))
    axis = charts.axis_from_quaternion(quaternion)
    columns = {"theta": charts.theta_from_axis(axis), "axis": axis, "quaternion": quaternion, "momentum": momentum}
    columns |= {"quaternion_lo": motion.quaternion_lo, "attitude_error_bound": motion.bound}
    columns |= dict.fromkeys(("axis_error_bound", "theta_error_bound"), motion.bound + 2.0 * EPSILON)
    constants = {"energy": body.energy(start), "p_phi": body.momenta(start).p_phi}
    data = dataset(times, columns | {name: np.full(times.size, value) for name, value in constants.items()})
    source = "closed-form" if body.free else "quad" if precision == "quad" else "longdouble"
    words = "256 times the distance of two integrations, of a body whose mgl times centre is rounded to doubles"
    words = "from the arithmetic of the exact motion of a free body" if body.free else words
    attributes = {"scene": scene.name, "precision": source, "asked_for": precision, "bound": words}
    return netcdf.describe(data.copy(deep=True), f"reference motion of {scene.name}", scene.units, **attributes)


def _by_closed_form(scene: Scene, times: Array, certify: str | None) -> tuple[xr.Dataset, dict[str, str]]:
    """The dataset of values and bounds in double, and its attributes."""
    values, record = closed_values(scene, times), certificate(scene, certify)
    bounds = closed_bounds(scene, times, values)
    if record is not None:
        bounds = {name: record.factor * bound + record.doubt for name, bound in bounds.items()}
    words = {
        "bound": "from the arithmetic of the closed form, its views and integrals compared at every time",
        "certificate": UNCERTIFIED if record is None else str(record),
        "arithmetic": f"constants in {closed_form(scene).provenance.arithmetic}, values in double",
        "conditioning": conditioned(scene, float(times.max())),
    }
    return _dataset(scene, times, values, bounds), words


def _by_integration(scene: Scene, times: Array, precision: str) -> tuple[xr.Dataset, dict[str, str]]:
    """The dataset of an integration, from the cache if it is there, and its attributes."""
    distinct, order = np.unique(times, return_inverse=True)
    if distinct.size > MOST_CACHED:
        data = _integration(scene, distinct, precision)
    else:
        path = place(_integration, scene.top, scene.start, precision, CHECKS, DIGITS, SAFETY, data=distinct.tobytes())
        data = cached(path, lambda: _integration(scene, distinct, precision), 5)
    words = {
        "bound": f"{SAFETY:g} times the largest error seen up to the next check",
        "certificate": f"{DIGITS} digits at times up to t = {distinct[-1]:.3g}",
        "arithmetic": precision,
        "conditioning": conditioned(scene, float(distinct[-1])),
    }
    return data.isel(time=order), words


def conditioned(scene: Scene, horizon: float) -> str:
    """The attribute ``conditioning``: in words, how much the motion amplifies a change of its start."""
    if not horizon > 0.0:
        return "1: these are times of the start"
    factor = conditioning(scene, horizon)
    if math.isnan(factor):  # a changed start that comes too close to a pole
        return "unknown"
    change, rounding = f"{factor:.2g} times a change of the start", "rounding the start anew moves the axis by"
    if factor * LEAST_CHANGE > FAR_APART:  # the smallest change moves the axis so far: the factor is a lower bound
        note = "nothing is known of the axis but from these very doubles"
        return f"at least {change}; {rounding} {factor * EPSILON:.2g} rad or more: {note}"
    return f"{change}; {rounding} {factor * EPSILON:.1g} rad" if factor > ILL_CONDITIONED else change


def _dataset(scene: Scene, times: Array, columns: dict[str, Array], bounds: dict[str, Array]) -> xr.Dataset:
    form = closed_form(scene)
    constants = {name: np.full(times.size, getattr(form, name)) for name in ("energy", "p_phi", "p_psi")}
    return dataset(times, columns | {f"{name}_error_bound": bound for name, bound in bounds.items()} | constants)


def _integration(scene: Scene, times: Array, precision: str) -> xr.Dataset:
    return judged_integration(scene, times, precision, integrate_with_checks(scene, times, precision))


def judged_integration(scene: Scene, times: Array, precision: str, run: Integration) -> xr.Dataset:
    """The dataset of `reference` from an integration: values, low parts and bounds at increasing, distinct times."""
    values, checks = integration_values(scene, run)
    grain = 8.0 * max(heyoka.arithmetic(precision).epsilon, 2.0 * EPSILON**2)  # the latter: rounding of a double pair
    columns: dict[str, Array] = {}
    for name, value in values.items():
        columns[name] = value.astype(np.float64)
        columns[f"{name}_lo"] = (value - columns[name].astype(value.dtype)).astype(np.float64)
    bounds = _bounds(times, columns, checks, grain)
    _raise_to_distance(bounds, columns, closed_values(scene, times))
    return _dataset(scene, times, columns, bounds)


def _bounds(times: Array, values: dict[str, Any], checks: Checks, grain: float) -> dict[str, Array]:
    sine = np.maximum(np.sin(values["theta"]), TINY)
    axis = envelope(checks, "axis", times) + grain
    attitude = envelope(checks, "attitude", times) + grain
    # an error of the axis changes phi by 1/sin(theta) times it, and psi by that and the attitude's error
    turn = np.maximum(envelope(checks, "phi", times), axis / sine) + grain * np.abs(values["phi"])
    spin = np.maximum(envelope(checks, "psi", times), attitude + axis / sine) + grain * np.abs(values["psi"])
    return {"axis": axis, "attitude": attitude, "theta": axis, "phi": turn, "psi": spin}


def _raise_to_distance(bounds: dict[str, Array], values: dict[str, Any], closed: dict[str, Any]) -> None:
    """Raise bounds where an integration visibly differs from the closed form in double, to that distance."""
    distances = {name: np.abs(values[name] - closed[name]) for name in ("theta", "phi", "psi")}
    distances["axis"] = charts.axis_distance(values["axis"], closed["axis"])
    distances["attitude"] = charts.attitude_distance(values["quaternion"], closed["quaternion"])
    for name, distance in distances.items():
        scale = np.abs(values[name]) if name in ("phi", "psi") else 1.0
        grain = 4.0 * EPSILON * np.maximum(scale, 1.0)
        visible = distance > 8.0 * grain
        bounds[name] = np.where(visible, np.maximum(bounds[name], distance + grain), bounds[name])


def closed_values(scene: Scene, times: Array) -> dict[str, Any]:
    """Angles, axis and quaternion of the closed form, by name."""
    form = closed_form(scene)
    theta, phi, psi, *_ = form(times)
    return {"theta": theta, "phi": phi, "psi": psi, "axis": form.axis(times), "quaternion": form.quaternion(times)}


def closed_bounds(scene: Scene, times: Array, values: dict[str, Any]) -> dict[str, Array]:
    """Bounds at `times` of the `values` there: radians for theta, axis, attitude, phi and psi."""
    form = closed_form(scene)
    top, spin = form.top, form.p_psi / form.top.I3
    kinetic = form.energy - 0.5 * form.p_psi * spin + abs(top.mgl)
    fastest = math.sqrt(max(2.0 * kinetic / top.I1, 0.0)) + abs(spin)  # a bound of the angular velocity
    drift = (form.provenance.rate_error + RATE) * np.abs(times) * fastest
    sine = np.maximum(np.sin(values["theta"]), TINY)
    bounds = {name: ROUNDING[name] + drift for name in ("theta", "axis", "attitude")}
    for name in ("phi", "psi"):
        bounds[name] = ROUNDING[name] + 2.0 * EPSILON * np.abs(values[name]) + 2.0 * drift / sine
    wrong = ~(disagreement(form, times, values) <= SUSPICIOUS_GAP)
    return {name: np.where(wrong, math.pi, bound) for name, bound in bounds.items()}


def disagreement(form: ClosedForm, times: Array, values: dict[str, Any]) -> Array:
    """The largest inconsistency of the closed form (n,): of its three attitudes, rad, or of a constant, relative."""
    axis, (x, y, z) = charts.axis_from_quaternion(values["quaternion"]), values["axis"].T
    gap = np.sqrt(((axis - values["axis"]) ** 2).sum(axis=1))
    from_angles = charts.quaternion_from_angles(values["theta"], values["phi"], values["psi"])
    rounded = 2.0 * EPSILON * (np.abs(values["phi"]) + np.abs(values["psi"]))
    gap = np.maximum(gap, charts.attitude_distance(from_angles, values["quaternion"]) - rounded)
    motion, top = form(times), form.top
    level = x * x + y * y  # sin^2 theta with all digits, next to a pole as well
    turning = top.I1 * motion.phi_dot * level
    moving = 0.5 * (top.I1 * motion.theta_dot**2 + turning * motion.phi_dot)
    spinning, lifting = 0.5 * form.p_psi**2 / top.I3, top.mgl * z
    energy = np.abs(moving + spinning + lifting - form.energy) / (moving + spinning + abs(top.mgl) + TINY)
    p_phi = np.abs(turning + form.p_psi * z - form.p_phi) / (np.abs(turning) + abs(form.p_psi) + TINY)
    return np.asarray(np.maximum(gap, np.maximum(energy, p_phi)))


class Certificate(NamedTuple):
    """The result of comparing the closed form of a scene with independent checks."""

    reach: float  # time of the last comparison with 40 digits
    times: int  # the number of these comparisons
    share: float  # largest ratio of an error to its bound in them
    overlap: float  # time of the two comparisons below; nan without them
    map_apart: float  # rad: distance of closed form and discrete map beyond the map's own error; nan without a map
    apart: float  # rad: the same for the integration

    @property
    def doubt(self) -> float:
        """The possible error of the formulas, rad: a distance from an independent check that exceeds rounding."""
        return max((gap for gap in (self.map_apart, self.apart) if gap > SUSPICIOUS_GAP), default=0.0)

    @property
    def factor(self) -> float:
        """The factor by which the bounds are raised: 1 if they hold."""
        return SAFETY * self.share if self.share > 1.0 else 1.0

    def __str__(self) -> str:
        share = f"largest error {self.share:.2g} of its bound"
        words = f"{DIGITS} digits at {self.times} times up to t = {self.reach:.3g}, {share}"
        for check, gap in (("discrete map", self.map_apart), ("long double integration", self.apart)):
            if not math.isnan(gap):
                clause = "no further apart than its own error" if gap == 0.0 else f"{gap:.1g} rad apart"
                words += f"; {check} up to t = {self.overlap:.3g}, {clause}"
        return words


def certificate(scene: Scene, kind: str | None = None) -> Certificate | None:
    """The certificate of this kind, made if missing (without heyoka: discrete-map); without a kind the best stored."""
    if kind is None:
        return _on_disk(scene, cache_root())
    _on_disk.cache_clear()
    return _stored(scene, kind if kind != "integration" or have_heyoka() else "discrete-map")


@functools.lru_cache(maxsize=1024)
def _on_disk(scene: Scene, _root: Path) -> Certificate | None:
    return next((_stored(scene, kind) for kind in reversed(KINDS) if os.access(_path(scene, kind), os.R_OK)), None)


def _path(scene: Scene, kind: str) -> Path:
    return place(_compared, "certificate", kind, scene.top, scene.start)


def _stored(scene: Scene, kind: str) -> Certificate:
    data = cached(_path(scene, kind), lambda: _compared(scene, kind), None)
    return Certificate(*(data[name].item() for name in Certificate._fields))


def _compared(scene: Scene, kind: str) -> xr.Dataset:
    times = _times(scene, CERTIFIED_NUTATIONS)
    values = closed_values(scene, times)
    checks = largest_errors(scene, times, values["quaternion"], values["phi"], values["psi"])
    bounds = closed_bounds(scene, times, values)
    share = max(float(np.max(checks[name] / bounds[name])) for name in CHECKED)
    overlap, map_apart = _against_map(scene) if kind != "digits" else (math.nan, math.nan)
    gap = _against_integration(scene)[1] if kind == "integration" else math.nan
    record = Certificate(float(times[-1]), times.size, share, overlap, map_apart, gap)
    return xr.Dataset({name: ((), value) for name, value in record._asdict().items()})


def _times(scene: Scene, nutations: float) -> Array:
    period = scene.nutation_period
    return check_times(scene, nutations * period if math.isfinite(period) else scene.horizon)


def _against_map(scene: Scene) -> tuple[float, float]:
    """The last time compared with the discrete map, and the distance from the closed form beyond the map's error."""
    times = _times(scene, OVERLAP_NUTATIONS)
    attitudes, error = iterate_map_with_error(scene, times)
    gap = charts.attitude_distance(closed_form(scene).quaternion(times), attitudes)
    return float(times[-1]), float(max(np.max(gap - error), 0.0))


def _against_integration(scene: Scene) -> tuple[float, float]:
    """The last time compared with the integration, and the distance from the closed form beyond its rounding error."""
    times = _times(scene, OVERLAP_NUTATIONS)
    states, _ = integrate(scene, times, "longdouble")
    gap = charts.attitude_distance(closed_form(scene).quaternion(times), states[:, :4].astype(float))
    _, phi, psi = charts.angles_from_quaternion(states[:, :4])
    rounding = largest_errors(scene, times, states[:, :4], phi, psi)["attitude"]  # grows where the motion is unstable
    return float(times[-1]), float(max(np.max(gap - 2.0 * rounding), 0.0))


@functools.lru_cache(maxsize=8)
def _sources(maker: Callable[..., Any]) -> str:
    """Hash of the code that a function reaches, and of the libraries."""
    code = code_hash.Code().reasons("reference", maker, COMPILED)
    return code_hash.digest(code | code_hash.packages("numpy", "heyoka", "mpmath"))


def place(maker: Callable[..., Any], *key: object, data: bytes = b"") -> Path:
    """The cache file of a result, named by a hash of the code of `maker` and of its arguments."""
    name = hashlib.sha256(repr([_sources(maker), *key]).encode() + data).hexdigest()[:32]
    return cache_root() / "reference" / f"{name}.nc"


def cached(path: Path, compute: Callable[[], xr.Dataset], depth: int | None) -> xr.Dataset:
    """The dataset in a file, or the one that `compute` returns, which is then written to it.

    Warnings point `depth` calls up, 1 being this function; with None there are no warnings. Files unused for 30 days
    are removed, and beyond `MOST_BYTES` of the folder those used longest ago.
    """
    if os.access(path, os.R_OK):  # also false in a folder of another user
        try:
            data = netcdf.read(path)
            if data.attrs.pop("content", "") == netcdf.content_hash(data):
                touch(path)
                return data
        except SymtopError:
            pass
        if depth is not None:
            sentence = f"the cached reference {path.name} is damaged and is computed again"
            warnings.warn(sentence, SymtopWarning, stacklevel=depth)
    data = compute()
    try:
        make_private(path.parent)
        netcdf.write(data.assign_attrs(content=netcdf.content_hash(data)), path)
        if next(_written) % FILES_A_CHECK == 0:
            prune(path.parent, MOST_BYTES)
    except (SymtopError, OSError) as error:
        if depth is not None:
            warnings.warn(f"the reference is not kept: {error}", SymtopWarning, stacklevel=depth)
    return data
