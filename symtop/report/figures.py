"""What drawings of studies share: the grey band of the reference's error bound, the Pareto front, running maxima."""

from typing import Any

import numpy as np

SMALLEST = 1e-17  # where an error of exactly zero is drawn


def error_band(axis: Any, bounds: Any, least: float = 1e-16) -> float:
    """Shade what lies below the median error bound of the reference; returns that bound, or `least` without one."""
    level = float(np.nanmedian(bounds)) if np.isfinite(bounds).any() else least
    axis.axhspan(level * 1e-3, level, color="#BBBBBB", alpha=0.45, lw=0, label="error bound of the reference")
    return level


def pareto(cost: Any, error: Any) -> Any:
    """Which points no other point beats in both cost and error (boolean, the shape of the arrays)."""
    shape, cost, error = cost.shape, cost.ravel(), error.ravel()
    order = np.lexsort((error, np.where(np.isfinite(error), cost, np.inf)))
    best, front = np.inf, np.zeros(cost.size, bool)
    for k in order:
        if np.isfinite(cost[k]) and error[k] < best:
            best, front[k] = error[k], True
    return front.reshape(shape)


def largest_so_far(values: Any) -> Any:
    """The largest size up to each sample; zeros are `SMALLEST`, for a logarithmic axis."""
    return np.maximum.accumulate(np.maximum(np.abs(np.asarray(values)), SMALLEST))
