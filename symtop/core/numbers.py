"""Numbers that many modules need, each defined once; arrays of real numbers; the zeros of a function."""

import math
import sys
from collections.abc import Callable
from reprlib import repr as short

import numpy as np

from symtop.core.errors import SymtopError, finite

EPSILON = sys.float_info.epsilon  # 2.2e-16: the spacing of doubles at 1
TINY = sys.float_info.min  # 2.2e-308: a divisor that is never zero
GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)  # steps of this length, modulo 1, are commensurate with no period


def real_numbers(name: str, values: object) -> np.ndarray:
    """An array of doubles of any shape, C-ordered; SymtopError for anything else, complex numbers and text included."""
    if type(values) is np.ndarray and values.dtype == np.float64:
        return np.ascontiguousarray(values).reshape(values.shape)
    try:
        array = np.asarray(values)
        if array.dtype.kind == "O":  # whole numbers beyond 64 bits, fractions, decimals
            array = np.array([finite(name, value) for value in array.ravel().tolist()]).reshape(array.shape)
    except (TypeError, ValueError, OverflowError):  # ragged, or no number
        array = np.empty(0, dtype=object)
    if array.dtype.kind not in "fiu":
        raise SymtopError(f"{name} must be real numbers, not {short(values)}")
    return np.asarray(array, dtype=np.float64, order="C")


def sign_changes(function: Callable[[float], float], grid: np.ndarray, tolerance: float = 1e-12) -> list[float]:
    """Where a function changes its sign between neighbours of a grid, by bisection; jumps through NaN do not count."""
    values = [function(float(x)) for x in grid]
    roots = []
    for left, right, low, high in zip(grid[:-1], grid[1:], values[:-1], values[1:], strict=True):
        if not (math.isfinite(low) and math.isfinite(high)) or (low > 0.0) == (high > 0.0):
            continue
        a, b = float(left), float(right)
        while b - a > tolerance * max(1.0, abs(b)):
            middle = 0.5 * (a + b)
            value = function(middle)
            if not math.isfinite(value):
                break
            a, b = (middle, b) if (value > 0.0) == (low > 0.0) else (a, middle)
        roots.append(0.5 * (a + b))
    return roots


def newton_between(
    value: Callable[[float], float], slope: Callable[[float], float], below: float, above: float
) -> float:
    """The root of a function that is negative at `below` and positive at `above`, to two units in its last place.

    Newton's method from the middle; where a step leaves what is known to hold the root, half of that.
    """
    x, before = 0.5 * (below + above), math.inf
    while x != before:
        here, rise = value(x), slope(x)
        below, above = (x, above) if here < 0.0 else (below, x)
        newton = x - here / rise if rise > 0.0 else math.nan
        inside = newton if below < newton < above else 0.5 * (below + above)
        x, before = (x if abs(newton - x) <= 2.0 * math.ulp(x) else inside), x
    return x
