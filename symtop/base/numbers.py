"""Numbers that many modules need, each defined once, and the search for the zeros of a function."""

import math
import sys
from collections.abc import Callable

import numpy as np

EPSILON = sys.float_info.epsilon  # 2.2e-16: the spacing of doubles at 1
TINY = sys.float_info.min  # 2.2e-308: a divisor that is never zero
GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)  # steps of this length, modulo 1, are commensurate with no period


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
