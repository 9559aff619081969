"""Certified truth: two independent methods, and their disagreement as an error bound.

`reference` integrates the space-frame equations with heyoka in double, long double or quadruple precision (never in
angles, which lose digits near a pole), at a tolerance of a hundredth of the rounding unit, from a start that is
built in 60 digits. The closed form, evaluated in `DIGITS` digits at `CHECKS` times, shows the error of that run. The
error of an integration grows, so the bound at a time t is `SAFETY` times the largest error seen at any check up to the
next one after t, plus the rounding of what is stored. With ``precision="closed-form"`` the values are the closed form
in double, which does not lose digits with time: its rounding is checked in the same way, and its mathematics
against the long double integration. An integration that visibly differs from it has that distance as its bound.

Values beyond double are stored as pairs, ``theta + theta_lo``. A result is cached on disk under a hash of the top, the
start, the times, the precision, the sources and the libraries; a damaged cache file is noticed, said and computed
again. Files that nobody used for 30 days are removed, and those used longest ago beyond a limit (see `kept`).
"""

import functools
import hashlib
import math
import warnings
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from symtop.base import datasets, fingerprint, imports
from symtop.base.cache import cache_root
from symtop.base.multiprecision import context
from symtop.base.numbers import EPSILON, TINY
from symtop.base.over_time import over_time
from symtop.base.validate import SymtopError, SymtopWarning, one_of
from symtop.methods import taylor
from symtop.model import charts
from symtop.model.scenes import Scene, closed_form, scene as find_scene, scenes
from symtop.run.kept import kept

PRECISIONS = ("closed-form", "double", "longdouble", "quad")
CHECKS = 16
DIGITS = 40
SAFETY = 8.0
OVERLAP = 100.0  # time over which the closed form is compared with an integration each time it is used
SUSPICIOUS = 1e-12  # a disagreement beyond this is an error of one of them, not rounding
MOST_CACHED = 200_000  # times; larger results are not kept on disk


class Checks(NamedTuple):
    """Largest errors seen up to each check time (running maxima), by quantity."""

    times: charts.Array
    attitude: charts.Array
    axis: charts.Array
    phi: charts.Array
    psi: charts.Array


def integrate(scene: Scene, times: charts.Array, precision: str, chart: str = "attitude") -> tuple[Any, int]:
    """heyoka's states at increasing times, in the working precision, and the number of steps it took."""
    flight = taylor.propagate(
        chart, precision, taylor.arithmetic(precision).epsilon / 100.0, scene.top, scene.start, times
    )
    return flight.states, flight.steps


def have_heyoka() -> bool:
    """heyoka has wheels for Linux only."""
    try:
        import heyoka  # noqa: F401
    except ImportError:
        return False
    return True


def check_times(scene: Scene, horizon: float) -> charts.Array:
    """Times of the checks: denser towards the start, the last one at the horizon.

    Beside each stands the moment of fastest nutation in the period before it: an error of phase shows there most, and
    may be thousands of times smaller elsewhere (near a separatrix the top hovers where all errors look small).
    """
    even = horizon * (np.arange(1, CHECKS + 1) / CHECKS) ** 2
    period = min(scene.nutation_period, horizon)
    around = np.maximum(even[:, None] - period * np.linspace(0.0, 1.0, 64), 0.0)
    speed = np.nan_to_num(np.abs(closed_form(scene)(around).theta_dot))
    fastest = around[np.arange(CHECKS), np.argmax(speed, axis=1)]
    return np.unique(np.concatenate([even, fastest[fastest > 0.0]]))


def _seen(scene: Scene, times: charts.Array, quaternions: Any, phis: Any, psis: Any) -> Checks:
    """Running maxima of the errors of given attitudes and angles, against the closed form in `DIGITS` digits."""
    from symtop.model.precise_form import PreciseForm

    precise, mp = PreciseForm(scene.top, scene.start, DIGITS), context(DIGITS + 10)
    rows = []
    for t, *components, phi, psi in zip(times, *quaternions.T, phis, psis, strict=True):
        true = w, x, y, z = tuple(map(mp.convert, precise.quaternion(float(t))))  # all digits, in this arithmetic
        attitude = [_read(mp, value) for value in components]
        if sum(a * b for a, b in zip(attitude, true, strict=True)) < 0:
            attitude = [-value for value in attitude]
        turn = 2.0 * float(mp.norm([a - b for a, b in zip(attitude, true, strict=True)]))
        tilt = float(mp.norm([a - b for a, b in zip(_axis(attitude), _axis(true), strict=True)]))
        total, difference = mp.atan2(z, w), mp.atan2(y, x)
        phi_error = _turn(mp, _read(mp, phi), total + difference)
        rows.append((turn, tilt, phi_error, _turn(mp, _read(mp, psi), total - difference)))
    table = np.maximum.accumulate(np.array(rows), axis=0)
    return Checks(times, *table.T)


def _read(mp: Any, value: Any) -> Any:
    """A number of any arithmetic in multiprecision."""
    return mp.mpf(float(value)) if isinstance(value, float) else mp.mpf(str(value))


def _axis(quaternion: Any) -> tuple[Any, Any, Any]:
    w, x, y, z = quaternion
    return 2 * (x * z + w * y), 2 * (y * z - w * x), w * w - x * x - y * y + z * z


def _turn(mp: Any, angle: Any, true: Any) -> float:
    """Distance of two angles modulo a full turn."""
    gap = (angle - true) / (2 * mp.pi)
    return abs(float((gap - mp.nint(gap)) * 2 * mp.pi))


def _envelope(checks: Checks, name: str, times: charts.Array) -> charts.Array:
    """SAFETY times the largest error at any check up to the first one that is not before t."""
    values: charts.Array = getattr(checks, name)
    after = np.minimum(np.searchsorted(checks.times, times, side="left"), values.size - 1)
    return SAFETY * values[after]


def _split(values: Any) -> tuple[charts.Array, charts.Array]:
    """High and low halves, each a double."""
    high = values.astype(np.float64)
    if values.dtype == np.float64:
        return high, np.zeros_like(high)
    return high, (values - high.astype(values.dtype)).astype(np.float64)


def _unwrapped(angle: Any, near: charts.Array) -> Any:
    """`angle` on the branch nearest `near`, without rounding 2 pi to double."""
    turns = np.rint((near - angle.astype(np.float64)) / (2.0 * math.pi))
    if angle.dtype == np.float64:
        return angle + turns * (2.0 * math.pi)
    kind = angle.dtype.type
    return angle + turns.astype(angle.dtype) * kind("6.283185307179586476925286766559005768394")


def _closed_values(scene: Scene, times: charts.Array) -> dict[str, Any]:
    closed = closed_form(scene)
    motion = closed(times)
    return {
        "theta": motion.theta,
        "phi": motion.phi,
        "psi": motion.psi,
        "axis": closed.axis(times),
        "quaternion": closed.quaternion(times),
    }


@functools.lru_cache(maxsize=256)
def _closed_checks(scene: Scene, horizon: float) -> tuple[Checks, float]:
    """Rounding errors of the closed form in double, and how far an integration is from it beyond its own error.

    For the scenes that have a name it is kept on disk: it takes half a second, and every process would want it again.
    """
    if scenes().get(scene.name) != scene:
        return _checked(scene, horizon)

    def computed() -> xr.Dataset:
        checks, overlap = _checked(scene, horizon)
        columns = {name: ("check", values) for name, values in zip(Checks._fields, checks, strict=True)}
        return xr.Dataset({**columns, "overlap": ((), overlap)})

    data = kept(_cache_path(scene, np.array([horizon]), "checks"), computed, None)
    return Checks(*(data[name].values for name in Checks._fields)), float(data["overlap"])


def _checked(scene: Scene, horizon: float) -> tuple[Checks, float]:
    times = check_times(scene, horizon)
    shown = _closed_values(scene, times)
    checks = _seen(scene, times, shown["quaternion"], shown["phi"], shown["psi"])
    if not have_heyoka():
        return checks, math.nan
    overlap = check_times(scene, min(horizon, OVERLAP))
    integrated, _ = integrate(scene, overlap, "longdouble")
    gap = charts.attitude_distance(_closed_values(scene, overlap)["quaternion"], integrated[:, :4].astype(float))
    _, phi, psi = charts.angles_from_quaternion(integrated[:, :4])
    rounding = _seen(scene, overlap, integrated[:, :4], phi, psi).attitude  # an unstable motion amplifies its rounding
    return checks, float(max(np.max(gap - 2.0 * rounding), 0.0))


def _integrated(scene: Scene, times: charts.Array, precision: str) -> tuple[dict[str, Any], Checks]:
    """heyoka's quantities at the times, and their errors at the check times, from one run."""
    check = check_times(scene, float(times[-1]))
    grid, place = np.unique(np.concatenate([times, check]), return_inverse=True)
    states, _ = integrate(scene, grid, precision)
    attitude = states[:, :4]
    theta, phi, psi = charts.angles_from_quaternion(attitude)
    motion = closed_form(scene)(grid)
    shown = {
        "theta": theta,
        "phi": _unwrapped(phi, motion.phi),
        "psi": _unwrapped(psi, motion.psi),
        "axis": charts.axis_from_quaternion(attitude),
        "quaternion": attitude,
    }
    asked_for, at_checks = place[: times.size], place[times.size :]
    checks = _seen(scene, check, attitude[at_checks], shown["phi"][at_checks], shown["psi"][at_checks])
    return {name: values[asked_for] for name, values in shown.items()}, checks


def _compute(scene: Scene, times: charts.Array, precision: str) -> xr.Dataset:
    """Values, low halves and bounds at increasing, distinct times."""
    overlap = math.nan
    if precision == "closed-form":
        shown = _closed_values(scene, times)
        checks, overlap = _closed_checks(scene, float(times[-1]))
        grain = 4.0 * EPSILON
    else:
        shown, checks = _integrated(scene, times, precision)
        grain = 8.0 * max(taylor.arithmetic(precision).epsilon, 2.0 * EPSILON**2)  # what a pair of doubles can hold
    columns: dict[str, charts.Array] = {}
    stored = {name: _split(values) for name, values in shown.items()}
    for name, (high, low) in stored.items():
        columns |= {name: high} | ({f"{name}_lo": low} if precision != "closed-form" else {})
    shown = {name: high for name, (high, _) in stored.items()}
    bounds = _bounds(times, shown, checks, grain, overlap)
    if precision != "closed-form":
        _raise_to_distance(bounds, shown, _closed_values(scene, times))
    columns |= {f"{name}_error_bound": bound for name, bound in bounds.items()}
    columns |= {name: np.full(times.size, value) for name, value in _constants(scene).items()}
    return over_time(times, columns).assign_attrs(overlap_with_integration=overlap)


def _bounds(
    times: charts.Array, shown: dict[str, Any], checks: Checks, grain: float, overlap: float
) -> dict[str, charts.Array]:
    """Error bounds from the checks; `overlap` counts in full if the closed form and an integration disagree."""
    doubt = overlap if overlap > SUSPICIOUS else 0.0
    sine = np.maximum(np.sin(shown["theta"]), TINY)
    axis = _envelope(checks, "axis", times) + grain + doubt
    attitude = _envelope(checks, "attitude", times) + grain + doubt
    # an error of the axis turns phi by 1/sin(theta) of it, and psi by the rest of the attitude's error
    turn = np.maximum(_envelope(checks, "phi", times), axis / sine) + grain * np.abs(shown["phi"])
    spin = np.maximum(_envelope(checks, "psi", times), attitude + axis / sine) + grain * np.abs(shown["psi"])
    return {"axis": axis, "attitude": attitude, "theta": axis, "phi": turn, "psi": spin}


def _raise_to_distance(bounds: dict[str, charts.Array], shown: dict[str, Any], closed: dict[str, Any]) -> None:
    """Where an integration visibly differs from the closed form in double, that distance is its error at that time."""
    distances = {name: np.abs(shown[name] - closed[name]) for name in ("theta", "phi", "psi")}
    distances["axis"] = charts.axis_distance(shown["axis"], closed["axis"])
    distances["attitude"] = charts.attitude_distance(shown["quaternion"], closed["quaternion"])
    for name, distance in distances.items():
        scale = np.abs(shown[name]) if name in ("phi", "psi") else 1.0
        grain = 4.0 * EPSILON * np.maximum(scale, 1.0)
        visible = distance > 8.0 * grain
        bounds[name] = np.where(visible, np.maximum(bounds[name], distance + grain), bounds[name])


@functools.lru_cache(maxsize=256)
def _constants(scene: Scene) -> dict[str, float]:
    from symtop.model.precise_form import PreciseForm

    precise = PreciseForm(scene.top, scene.start, DIGITS)
    return {"energy": float(precise.energy), "p_phi": float(precise.p_phi), "p_psi": float(precise.p_psi)}


def reference(scene: "str | Scene", times: ArrayLike, precision: str = "longdouble") -> xr.Dataset:
    """The true motion at the given times, each value with a bound on its error.

    Variables as `simulate` (``theta``, ``phi``, ``psi``, ``axis``, ``quaternion``, ``energy``, ``p_phi``, ...), the
    low halves ``theta_lo`` ... of what is known beyond double, and ``axis_error_bound``, ``attitude_error_bound``,
    ``theta_error_bound``, ``phi_error_bound``, ``psi_error_bound`` in radians, for the sum of both halves. All have the
    dimension ``time``, in the order asked for; axis and quaternion have a second one. `precision`
    is "longdouble" (default), "double" or "quad" for heyoka in that arithmetic, or "closed-form".

    Raises SymtopError for times that are negative, not finite or none at all.
    """
    chosen = find_scene(scene)
    try:
        wanted = np.asarray(times, dtype=float)
    except (TypeError, ValueError):
        wanted = np.empty(0)
    if wanted.ndim != 1 or wanted.size == 0 or not np.isfinite(wanted).all() or wanted.min() < 0.0:
        raise SymtopError(f"times must be a row of finite numbers of at least 0, not {times!r}")
    one_of("precision", precision, PRECISIONS)
    source = precision if have_heyoka() else "closed-form"
    if source != precision:
        sentence = (
            f"heyoka is not installed: the closed form in double stands in for precision {precision!r}, unchecked"
        )
        warnings.warn(sentence, SymtopWarning, stacklevel=2)
    distinct, place = np.unique(wanted, return_inverse=True)
    data = _cached(chosen, distinct, source)
    if wanted.size != distinct.size or not np.array_equal(wanted, distinct):
        data = data.isel(time=place)
    return datasets.describe(
        data, f"reference motion of {chosen.name}", chosen.units, scene=chosen.name, precision=source,
        asked_for=precision,
    )  # fmt: skip


def _cached(scene: Scene, times: charts.Array, precision: str) -> xr.Dataset:
    if times.size > MOST_CACHED or precision == "closed-form":  # a microsecond a time, not worth a file
        return _compute(scene, times, precision)
    return kept(_cache_path(scene, times, precision), lambda: _compute(scene, times, precision), 4)


def _cache_path(scene: Scene, times: charts.Array, precision: str) -> Path:
    key = [_sources(), have_heyoka(), scene.top, scene.start, precision, CHECKS, DIGITS, SAFETY]
    return cache_root() / "reference" / f"{hashlib.sha256(repr(key).encode() + times.tobytes()).hexdigest()[:32]}.nc"


@functools.lru_cache(maxsize=1)
def _sources() -> str:
    """Hash of the files that a reference is computed by, this one and all that it imports, and of the libraries."""
    files = imports.closure(frozenset([Path(__file__).resolve()]))
    return fingerprint.digest(fingerprint.file_reasons(files) | fingerprint.packages("numpy", "heyoka", "mpmath"))
