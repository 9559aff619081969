"""Errors of the members of an ensemble, and how they spread: quantiles over members at each sample.

    axis      angle between the member's axis and that of its closed form, rad
    energy    abs(E - E0) / (E0 - min V), the unit of `errors`

A member that has failed has an infinite error from there on, so that it counts among the worst and is not left out.
Quantiles are those of the sample, without interpolation: an infinite one says that so many have failed.
"""

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from symtop.base.validate import SymtopError, one_of
from symtop.model import charts, scales
from symtop.model.closed_forms import ClosedForms
from symtop.run.members import read_members

Array = NDArray[np.float64]

QUANTITIES = {"axis": "angle between axes (rad)", "energy": "energy error / (E0 - min V)"}
LEVELS = (0.01, 0.1, 0.5, 0.9, 0.99)
BLOCK = 1 << 20  # samples that are compared at a time


def member_errors(members: xr.Dataset, data: xr.Dataset, quantity: str) -> Array:
    """Errors (n, samples) of an ensemble of these members; NaN beyond the samples of a run of few steps."""
    one_of("quantity", quantity, QUANTITIES)
    n, samples = data.sizes["member"], data.sizes["time"]
    if members.sizes.get("member") != n:
        raise SymtopError(f"members must be the {n} of the ensemble, not {members.sizes.get('member')}")
    if quantity not in data:
        raise SymtopError(f"the ensemble was asked for without the variable {quantity}")
    errors, stride = np.empty((n, samples)), max(1, BLOCK // samples)
    for begin in range(0, n, stride):
        part = slice(begin, begin + stride)
        errors[part] = _errors(members.isel(member=part), data.isel(member=part), quantity)
    return errors


def _errors(members: xr.Dataset, data: xr.Dataset, quantity: str) -> Array:
    numbers, values = read_members(members).numbers, data[quantity].values
    times = np.broadcast_to(data["time"].values, values.shape[:2])
    asked = np.isfinite(times)
    with np.errstate(all="ignore"):  # what a run blew up to is no error of this comparison
        if quantity == "axis":
            truth = ClosedForms(numbers).axis(np.where(asked, times, 0.0))
            errors = charts.axis_distance(values, truth)
        else:
            unit = scales.energy_scale(numbers, ClosedForms(numbers).theta_range)
            errors = np.abs(values - values[:, :1]) / unit[:, None]
    known = np.isfinite(truth).all(axis=2) if quantity == "axis" else True
    return np.where(asked & known, np.where(np.isfinite(errors), errors, np.inf), np.nan)


def spread(errors: Array, levels: tuple[float, ...] = LEVELS) -> Array:
    """Quantiles over members (levels, samples), of the members that have such a sample; NaN where none has."""
    out = np.full((len(levels), errors.shape[1]), np.nan)
    for k, column in enumerate(errors.T):
        values = column[~np.isnan(column)]
        if values.size:
            out[:, k] = np.quantile(values, levels, method="inverted_cdf")
    return out


def largest(errors: Array) -> Array:
    """The largest error of each member over its run, shape (n,)."""
    worst: Array = np.where(np.isnan(errors), 0.0, errors).max(axis=1)
    return worst
