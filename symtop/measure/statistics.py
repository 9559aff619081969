"""Least squares: a straight line, or any columns, with the standard errors of what was fitted.

    line      v = a + b u:         b = du.dv/du.du,  error^2 = rest.rest/((n - 2) du.du)      du = u - mean(u)
    columns   v = sum c_k col_k:   c by least squares,  error_k^2 = rest.rest/(n - m) (A^T A)^-1_kk

A 95 % interval is Student's quantile of the degrees of freedom times the standard error. Source: any textbook, for
example Draper and Smith, Applied Regression Analysis, chapters 1 and 5.
"""

import functools
import math
from typing import NamedTuple

import numpy as np

from symtop.model.charts import Array


class Line(NamedTuple):
    """A straight line through points, by least squares."""

    slope: float
    error: float  # standard error of the slope
    middle: tuple[float, float]  # the point of means, which is on the line
    rest: Array  # what the line leaves


def line(x: Array, y: Array) -> Line:
    """The line through points (n,), n at least 3."""
    middle = x.mean(), y.mean()
    dx, dy = x - middle[0], y - middle[1]
    spread = float(dx @ dx)
    slope = float(dx @ dy) / spread
    rest = dy - slope * dx
    error = math.sqrt(float(rest @ rest) / (x.size - 2) / spread)
    return Line(slope, error, middle, rest)


def columns_fitted(columns: Array, values: Array) -> tuple[Array, Array]:
    """Coefficients (m,) of columns (n, m) in values (n,), and their standard errors."""
    coefficients = np.linalg.lstsq(columns, values, rcond=None)[0]
    rest = values - columns @ coefficients
    freedom = values.size - columns.shape[1]
    variances = float(rest @ rest) / freedom * np.linalg.inv(columns.T @ columns).diagonal()
    return np.asarray(coefficients), np.asarray(np.sqrt(variances))


@functools.lru_cache(maxsize=256)
def student(freedom: int) -> float:
    """By how much a standard error is multiplied for a 95 % interval."""
    from scipy.special import stdtrit  # what scipy.stats asks, which takes a second to import

    return float(stdtrit(freedom, 0.975))
