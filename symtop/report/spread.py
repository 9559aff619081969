"""Errors of the members of an ensemble, and their quantiles over members at each sample.

    axis        angle between the member's axis and that of its closed form, rad
    attitude    for bodies without symmetry, instead: angle between the attitude and that of the true motion, rad
    energy      abs(E - E0) / energy of the nutation, or for bodies / (T0 + |mgl|), the units of `errors`

A member that has failed has an infinite error from there on, so that it counts among the worst and is not left out.
Quantiles are without interpolation: the quantile of a level is infinite if more members than that have failed.
"""

import contextlib
import functools
import math
from typing import Any

import numpy as np
import xarray as xr

from symtop.core.errors import SymtopError, one_of
from symtop.measure.errors import OF_BODY, QUANTITIES as OF_TOP
from symtop.methods.framework.lanes import members_of, of_bodies
from symtop.model import charts, scenes
from symtop.model.charts import Array
from symtop.model.exact.closed_form import ClosedForms
from symtop.model.top import NUMBERS
from symtop.run.ensemble.inputs import read_members, refuse_others
from symtop.run.reference.truth import body_samples

QUANTITIES = {
    "tops": {name: OF_TOP[name] for name in ("axis", "energy")},
    "bodies": {name: (OF_TOP | OF_BODY)[name] for name in ("attitude", "energy")},
}
SHOWN_BY = {"axis": "axis", "attitude": "quaternion", "energy": "energy"}  # variables of an ensemble
LEVELS = (0.01, 0.1, 0.5, 0.9, 0.99)
SAME_SHARE = 1e-9  # of a horizon: a sample counts as at a place if it is later by less than this
BLOCK = 1 << 20  # samples that are compared at a time


def kind_of(data: xr.Dataset) -> str:
    """Is this an ensemble of "tops" or of "bodies"?"""
    return "bodies" if data.attrs["chart"] == charts.BODY else "tops"


def so_many(count: int, kind: str) -> str:
    """A count in words: "1 top", "3 bodies"."""
    return f"{count} {kind if count != 1 else {'tops': 'top', 'bodies': 'body'}[kind]}"


def member_errors(members: xr.Dataset, data: xr.Dataset, quantity: str) -> Array:
    """Errors (n, samples) of an ensemble of these members; NaN beyond the samples of a run of few steps.

    Errors of the attitude are NaN for a body without a reference to 1e-9 rad up to its last sample.
    """
    one_of("quantity", quantity, QUANTITIES[kind_of(data)])
    inputs = read_members(members)
    refuse_others(inputs, data)
    if (variable := SHOWN_BY[quantity]) not in data:
        raise SymtopError(f"the ensemble was asked for without the variable {variable}")
    n, samples = data.sizes["member"], data.sizes["time"]
    stride = max(1, BLOCK // samples)
    blocks = [slice(begin, begin + stride) for begin in range(0, n, stride)]
    return np.concatenate([_errors(inputs.numbers[member], data.isel(member=member), quantity) for member in blocks])


@functools.lru_cache(maxsize=1)
def _forms(plain: bytes) -> ClosedForms:
    """The closed forms of members, cached from one quantity to the next: they take longer than the comparison."""
    return ClosedForms(np.frombuffer(plain).reshape(-1, len(NUMBERS)))


def _errors(numbers: Array, data: xr.Dataset, quantity: str) -> Array:
    values = data[SHOWN_BY[quantity]].values
    valid: Any = True
    times = np.broadcast_to(data["time"].values, values.shape[:2])
    finite = np.isfinite(times)
    filled = np.where(finite, times, 0.0)
    with np.errstate(all="ignore"):  # runs may have blown up
        if quantity == "energy":
            errors = np.abs(values - values[:, :1]) / _energy_scales(numbers)[:, None]
        elif quantity == "axis":
            truth = _forms(numbers.tobytes()).axis(filled)
            errors, valid = charts.axis_distance(values, truth), np.isfinite(truth).all(axis=2)
        else:
            errors, valid = np.full(times.shape, np.nan), np.zeros(times.shape, bool)
            for i, ((body, start), row) in enumerate(zip(members_of(numbers), filled, strict=True)):
                with contextlib.suppress(SymtopError):  # if its reference ends before, as in chaos
                    true = body_samples("a member", body, start, row.tobytes(), precise=False)
                    errors[i] = charts.attitude_distance(values[i], true.quaternion, true.quaternion_lo)
                    valid[i] = True
    return np.where(finite & valid, np.where(np.isfinite(errors), errors, np.inf), np.nan)


def _energy_scales(numbers: Array) -> Any:
    if of_bodies(numbers):
        return np.array([body.energy_scale(start) for body, start in members_of(numbers)])
    return scenes.energy_scales(numbers, np.tile((0.0, math.pi), (len(numbers), 1)))  # a top at rest has no range


def at_places(data: xr.Dataset, errors: Array) -> tuple[Array, Array]:
    """Errors of members at common places: parts (places,) of their horizons, and errors (n, places).

    If all members have all samples, sample k of each lies within half a sampling interval and half a step of the same
    part of its horizon (dithered samples vary by so much), and the place is the mean of these parts. If some runs had
    fewer steps than samples, the places are equidistant, as many as the longest run has samples, from where each member
    has made a step; a member has there the error of its latest sample at or before the place. A failed run, which has
    samples to the end, stays infinitely wrong.
    """
    times = np.broadcast_to(data["time"].values, errors.shape)
    with np.errstate(invalid="ignore"):
        shares = times / data["horizon"].values[:, None]
    counts = np.isfinite(shares).sum(axis=1)
    if (counts == errors.shape[1]).all():
        return shares.mean(axis=0), errors
    grid = np.linspace(0.0, 1.0, int(counts.max()))
    grid = grid[grid + SAME_SHARE >= shares[:, 1].max()] + SAME_SHARE  # without the start, where errors are zero
    latest = np.empty((len(errors), grid.size))
    for i, count in enumerate(counts):
        latest[i] = errors[i, np.searchsorted(shares[i, :count], grid, side="right") - 1]
    return grid - SAME_SHARE, latest


def spread(errors: Array, levels: tuple[float, ...] = LEVELS) -> Array:
    """Quantiles (levels, samples) over the members that have a sample; NaN where none has."""
    out = np.full((len(levels), errors.shape[1]), np.nan)
    valid = ~np.isnan(errors).all(axis=0)
    out[:, valid] = np.nanquantile(errors[:, valid], levels, axis=0, method="inverted_cdf")
    return out


def largest(errors: Array) -> Array:
    """The largest error of each member over its run (n,); NaN if nothing was compared."""
    return np.asarray(np.fmax.reduce(errors, axis=1))
