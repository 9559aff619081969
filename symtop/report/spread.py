"""Errors of the members of an ensemble, and how they spread: quantiles over members at each sample.

    axis      angle between the member's axis and that of its closed form, rad
    energy    abs(E - E0) / (E0 - min V), the unit of `errors`

A member that has failed has an infinite error from there on, so that it counts among the worst and is not left out.
Quantiles are those of the sample, without interpolation: an infinite one says that so many have failed.
"""

import functools

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from symtop.core.errors import SymtopError, one_of
from symtop.model import charts, scenes
from symtop.model.exact.closed_form import ClosedForms
from symtop.model.top import NUMBERS
from symtop.run.ensemble.inputs import read_members

Array = NDArray[np.float64]

QUANTITIES = {"axis": "angle between axes (rad)", "energy": "energy error / (E0 - min V)"}
LEVELS = (0.01, 0.1, 0.5, 0.9, 0.99)
SAME_SHARE = 1e-9  # of a horizon: a sample that is later than a place by less than this is there
BLOCK = 1 << 20  # samples that are compared at a time


def member_errors(members: xr.Dataset, data: xr.Dataset, quantity: str) -> Array:
    """Errors (n, samples) of an ensemble of these members; NaN beyond the samples of a run of few steps."""
    one_of("quantity", quantity, QUANTITIES)
    n, samples = data.sizes["member"], data.sizes["time"]
    if members.sizes.get("member") != n:
        raise SymtopError(f"members must be the {n} of the ensemble, not {members.sizes.get('member')}")
    labels = [given.indexes["member"] for given in (members, data) if "member" in given.indexes]
    if len(labels) == 2 and [*map(str, labels[0])] != [*map(str, labels[1])]:
        raise SymtopError("members must be those of the ensemble in their order, and their labels are others")
    if quantity not in data:
        raise SymtopError(f"the ensemble was asked for without the variable {quantity}")
    stride = max(1, BLOCK // samples)
    parts = [slice(begin, begin + stride) for begin in range(0, n, stride)]
    return np.concatenate([_errors(members.isel(member=one), data.isel(member=one), quantity) for one in parts])


@functools.lru_cache(maxsize=1)
def _forms(plain: bytes) -> ClosedForms:
    """The closed forms of members, kept from one quantity to the next: they take more than the comparison."""
    return ClosedForms(np.frombuffer(plain).reshape(-1, len(NUMBERS)))


def _errors(members: xr.Dataset, data: xr.Dataset, quantity: str) -> Array:
    numbers, values = read_members(members).numbers, data[quantity].values
    times = np.broadcast_to(data["time"].values, values.shape[:2])
    finite = np.isfinite(times)
    with np.errstate(all="ignore"):  # what a run blew up to is no error of this comparison
        if quantity == "axis":
            truth = _forms(numbers.tobytes()).axis(np.where(finite, times, 0.0))
            errors = charts.axis_distance(values, truth)
        else:
            unit = scenes.energy_scales(numbers, _forms(numbers.tobytes()).theta_range)
            errors = np.abs(values - values[:, :1]) / unit[:, None]
    known = np.isfinite(truth).all(axis=2) if quantity == "axis" else True
    return np.where(finite & known, np.where(np.isfinite(errors), errors, np.inf), np.nan)


def at_places(data: xr.Dataset, errors: Array) -> tuple[Array, Array]:
    """Errors of members at places that are the same for all: shares (places,) of their horizons and errors (n, places).

    Where all members have all samples, sample k of each lies within half an interval between samples of the same share
    (and within half a step; dithered samples are so far apart), and the place is the mean of these shares. Where runs
    had fewer steps than samples, the places are those of as many even ones as the longest run has samples at which each
    member has made a step, and each has there the error of its latest sample at or before the place: its error as it
    was known by then. A failed run, which has samples to the end, stays infinitely wrong.
    """
    times = np.broadcast_to(data["time"].values, errors.shape)
    with np.errstate(invalid="ignore"):
        shares = times / data["horizon"].values[:, None]
    counts = np.isfinite(shares).sum(axis=1)
    if (counts == errors.shape[1]).all():
        return shares.mean(axis=0), errors
    places = np.linspace(0.0, 1.0, int(counts.max()))
    places = places[places + SAME_SHARE >= shares[:, 1].max()] + SAME_SHARE  # at a start no method is wrong
    latest = np.empty((len(errors), places.size))
    for i, count in enumerate(counts):
        latest[i] = errors[i, np.searchsorted(shares[i, :count], places, side="right") - 1]
    return places - SAME_SHARE, latest


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
    return np.asarray(np.where(np.isnan(errors), 0.0, errors).max(axis=1))
