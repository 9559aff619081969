"""Numbers of two doubles: a phase that grows for a million periods keeps all of its digits.

A pair (high, low) stands for their exact sum. Products with a time are exact (Dekker), sums are exact (Knuth), so that
``start + rate t`` and its remainder after whole turns have the rounding of one operation, whatever t is.
Source: Dekker, Numerische Mathematik 18 (1971) 224.
"""

from typing import Any

import numpy as np

from symtop.model.charts import Array

Pair = tuple[float, float]


def pair(value: Any) -> Pair:
    """The two doubles nearest to a number of higher precision."""
    high = float(value)
    return high, float(value - high)


def turns(ctx: Any, rate: Any, start: Any) -> tuple[Pair, Pair]:
    """A line of angles, rate t + start, in turns; its start to within whole turns."""
    turn = 2 * ctx.pi
    return pair(rate / turn), pair(start / turn - ctx.nint(start / turn))


def line(times: Array, rate: Pair, start: Pair) -> tuple[Array, Array]:
    """The sum start + rate t as two doubles: Dekker's product and Knuth's sum."""
    product = times * rate[0]
    total = product + start[0]
    added = total - product
    rounding = (product - (total - added)) + (start[0] - added)
    return total, _product_error(times, rate[0], product) + (rounding + (times * rate[1] + start[1]))


def _product_error(x: Array, y: float, product: Array) -> Array:
    x_scaled, y_scaled = 134217729.0 * x, 134217729.0 * y  # 2^27 + 1
    x_high, y_high = x_scaled - (x_scaled - x), y_scaled - (y_scaled - y)
    x_low, y_low = x - x_high, y - y_high
    return ((x_high * y_high - product) + x_high * y_low + x_low * y_high) + x_low * y_low


def on_line(times: Array, angle: tuple[Pair, Pair], lag: Array) -> Array:
    """A line of angles plus what the motion adds to it, rounded once."""
    high, low = line(times, *angle)
    total: Array = high + (low + lag)
    return total


def reduced(times: Array, angle: tuple[Pair, Pair], lag: Array) -> Array:
    """The angle to within whole turns, so that its error does not grow with time."""
    high, low = line(times, *angle)
    return 2.0 * np.pi * ((high - np.rint(high)) + low) + lag
