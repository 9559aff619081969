"""The drawings that studies share: the grey band of the reference's error bound, and the Pareto front."""

from typing import Any

import numpy as np


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
