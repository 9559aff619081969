"""The true motion of a scene with a bound on every error: the closed form, and independent checks on request.

By default the values are the closed form in double, and their bounds follow from its arithmetic
(`symtop.run.reference.bounds`), checked at every time asked for: 0.2 milliseconds and 0.7 microseconds a time. A
certificate (`symtop.run.reference.certificate`) holds the closed form of a scene against 40 digits and against an
integration; it takes half a second, is made when it is asked for, kept on disk, and told from then on.

With a `precision` the values are heyoka's integration of the equations of motion in that arithmetic, judged by the
closed form in 40 digits at some thirty times (`symtop.run.reference.independent_checks`): a check, and digits
beyond double, stored as pairs, ``theta + theta_lo``. An integration that visibly differs from the closed form has that
distance as its bound. Such a result is kept on disk under a hash of the top, the start, the times, the precision, the
sources and the libraries.
"""

import math
import warnings
from reprlib import repr as short
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from symtop.core import netcdf
from symtop.core.errors import SymtopError, SymtopWarning, one_of
from symtop.core.numbers import EPSILON, TINY, real_numbers
from symtop.methods.taylor import heyoka
from symtop.model import charts
from symtop.model.scenes import Scene, closed_form, scene as find_scene
from symtop.run.disk_cache import cached, place
from symtop.run.reference.bounds import closed_bounds, closed_values
from symtop.run.reference.certificate import KINDS, certificate
from symtop.run.reference.independent_checks import (
    CHECKS,
    DIGITS,
    SAFETY,
    Checks,
    Flown,
    envelope,
    flown,
    have_heyoka,
    integrated,
)
from symtop.run.reference.sensitivity import conditioning, unbounded
from symtop.run.trajectory import dataset

PRECISIONS = ("closed-form", "double", "longdouble", "quad")
MOST_CACHED = 200_000  # times; larger results are not kept on disk
ILL = 1e4  # times: beyond it the words say what a rounding of the start costs
UNCERTIFIED = "none; certify='digits', 'discrete-map' or 'integration' makes one"


def reference(
    scene: "str | Scene", times: ArrayLike, precision: str = "closed-form", *, certify: str | None = None
) -> xr.Dataset:
    """The true motion at the given times, each value with a bound on its error.

    Variables as `simulate` (``theta``, ``phi``, ``psi``, ``axis``, ``quaternion``, ``energy``, ``p_phi``, ...), the
    low halves ``theta_lo`` ... of what is known beyond double, and ``axis_error_bound``, ``attitude_error_bound``,
    ``theta_error_bound``, ``phi_error_bound``, ``psi_error_bound`` in radians, for the sum of both halves. All have the
    dimension ``time``, in the order asked for; axis and quaternion have a second one. `precision` is "closed-form", or
    "double", "longdouble" or "quad" for heyoka's integration in that arithmetic.

    `certify` is for the closed form: "digits" holds it against 40 digits at times up to a million nutations,
    "discrete-map" also against `exact-discrete` iterated over a hundred, "integration" moreover against heyoka in long
    double. Each is done once a scene and kept on disk.
    Attributes say what was done: ``bound`` what the bounds follow from, ``certificate`` what the closed form of this
    scene has been held against, and how it fared, ``arithmetic`` in which its constants were computed,
    ``conditioning`` how much the motion amplifies a change of its start (`symtop.run.reference.sensitivity`): bounds
    are of the motion from the very doubles that are given.

    Raises SymtopError for times that are negative, not finite or none at all.
    """
    chosen = find_scene(scene)
    wanted = real_numbers("times", times)
    if wanted.ndim != 1 or wanted.size == 0 or not np.isfinite(wanted).all() or wanted.min() < 0.0:
        raise SymtopError(f"times must be a row of finite numbers of at least 0, not {short(times)}")
    one_of("precision", precision, PRECISIONS)
    if certify is not None:
        one_of("certify", certify, KINDS)
        if precision != "closed-form":
            raise SymtopError(f"certify is for the closed form; precision {precision!r} is checked as it is computed")
    source = precision if have_heyoka() else "closed-form"
    if source != precision or (certify == "integration" and not have_heyoka()):
        missing = (
            f"stands in for precision {precision!r}" if source != precision else "is certified without an integration"
        )
        sentence = f"heyoka is not installed: the closed form in double {missing}"
        warnings.warn(sentence, SymtopWarning, stacklevel=2)
    if source == "closed-form":
        data, done = _by_closed_form(chosen, wanted, certify)
    else:
        data, done = _by_integration(chosen, wanted, source)
    return netcdf.describe(
        data, f"reference motion of {chosen.name}", chosen.units, scene=chosen.name, precision=source,
        asked_for=precision, **done,
    )  # fmt: skip


def _by_closed_form(scene: Scene, times: charts.Array, certify: str | None) -> tuple[xr.Dataset, dict[str, str]]:
    """Values and bounds in double, and words on both."""
    values, known = closed_values(scene, times), certificate(scene, certify)
    bounds = closed_bounds(scene, times, values)
    if known is not None and (known.factor, known.doubt) != (1.0, 0.0):
        bounds = {name: known.factor * bound + known.doubt for name, bound in bounds.items()}
    words = {
        "bound": "from the arithmetic of the closed form, its views and integrals compared at every time",
        "certificate": UNCERTIFIED if known is None else str(known),
        "arithmetic": f"constants in {closed_form(scene).provenance.arithmetic}, values in double",
        "conditioning": conditioned(scene, float(times.max())),
    }
    return _dataset(scene, times, values, bounds), words


def _by_integration(scene: Scene, times: charts.Array, precision: str) -> tuple[xr.Dataset, dict[str, str]]:
    """The same of an integration, from the cache if it is there."""
    distinct, order = np.unique(times, return_inverse=True)
    if distinct.size > MOST_CACHED:
        data = _integration(scene, distinct, precision)
    else:
        data = cached(_cache_path(scene, distinct, precision), lambda: _integration(scene, distinct, precision), 5)
    if not np.array_equal(times, distinct):
        data = data.isel(time=order)
    words = {
        "bound": f"{SAFETY:g} times the largest error seen up to the next check",
        "certificate": f"{DIGITS} digits at times up to t = {distinct[-1]:.3g}",
        "arithmetic": precision,
        "conditioning": conditioned(scene, float(distinct[-1])),
    }
    return data, words


def conditioned(scene: Scene, horizon: float) -> str:
    """How well the start determines the motion, in words: bounds are of the motion from the doubles that are given."""
    if not horizon > 0.0:
        return "1: these are times of the start"
    factor = conditioning(scene, horizon)
    if math.isnan(factor):  # a changed start that comes too close to a pole
        return "unknown"
    if unbounded(factor):
        return (
            f"at least {factor:.2g} times a change of the start; rounding the start anew moves the axis by "
            f"{factor * EPSILON:.2g} rad or more: nothing is known of the axis but from these very doubles"
        )
    lost = f"; rounding the start anew moves the axis by {factor * EPSILON:.1g} rad"
    return f"{factor:.2g} times a change of the start{lost if factor > ILL else ''}"


def _cache_path(scene: Scene, times: charts.Array, precision: str) -> Any:
    return place(_integration, scene.top, scene.start, precision, CHECKS, DIGITS, SAFETY, data=times.tobytes())


def _dataset(
    scene: Scene, times: charts.Array, columns: dict[str, charts.Array], bounds: dict[str, charts.Array]
) -> xr.Dataset:
    """Values, bounds and the constants of the motion."""
    form = closed_form(scene)
    constants = {"energy": form.energy, "p_phi": form.p_phi, "p_psi": form.p_psi}
    columns = columns | {f"{name}_error_bound": bound for name, bound in bounds.items()}
    return dataset(times, columns | {name: np.full(times.size, value) for name, value in constants.items()})


def _integration(scene: Scene, times: charts.Array, precision: str) -> xr.Dataset:
    return judged_integration(scene, times, precision, flown(scene, times, precision))


def judged_integration(scene: Scene, times: charts.Array, precision: str, run: Flown) -> xr.Dataset:
    """Values, low halves and bounds at the times of a run, increasing and distinct, as `reference` has them."""
    values, checks = integrated(scene, run)
    grain = 8.0 * max(heyoka.arithmetic(precision).epsilon, 2.0 * EPSILON**2)  # what a pair of doubles can hold
    columns: dict[str, charts.Array] = {}
    for name, (high, low) in {name: _split(value) for name, value in values.items()}.items():
        columns |= {name: high, f"{name}_lo": low}
    bounds = _bounds(times, columns, checks, grain)
    _raise_to_distance(bounds, columns, closed_values(scene, times))
    return _dataset(scene, times, columns, bounds)


def _split(values: Any) -> tuple[charts.Array, charts.Array]:
    """High and low halves, each a double."""
    high = values.astype(np.float64)
    if values.dtype == np.float64:
        return high, np.zeros_like(high)
    return high, (values - high.astype(values.dtype)).astype(np.float64)


def _bounds(times: charts.Array, shown: dict[str, Any], checks: Checks, grain: float) -> dict[str, charts.Array]:
    """Error bounds from the checks."""
    sine = np.maximum(np.sin(shown["theta"]), TINY)
    axis = envelope(checks, "axis", times) + grain
    attitude = envelope(checks, "attitude", times) + grain
    # an error of the axis turns phi by 1/sin(theta) of it, and psi by the rest of the attitude's error
    turn = np.maximum(envelope(checks, "phi", times), axis / sine) + grain * np.abs(shown["phi"])
    spin = np.maximum(envelope(checks, "psi", times), attitude + axis / sine) + grain * np.abs(shown["psi"])
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
