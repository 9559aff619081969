"""Angles made continuous beside a guide, compiled: `charts.unwrapped` of a few hundred samples in 1 us instead of 13.

With lag = angle - guide, a step d of the lag from one sample to the next is half a turn at most in truth, and otherwise

    d  ->  mod(d + pi, 2 pi) - pi          (pi, and not -pi, for a step forwards),

what all of them took off so far comes off each sample, and whole turns of the first lag come off all. The operations
are those of `charts.unwrapped` in their order, and so are the bits; that function answers until this one is loaded.
"""

import math
from typing import Any

import numpy as np

from symtop.core.lazy_kernel import LazyKernel
from symtop.model import charts
from symtop.model.charts import Array

HALF, TURN = math.pi, 2.0 * math.pi
SECONDS = 1e-5  # of NumPy beyond what the compiled function takes, for a row


def _rows(angles: Any, guides: Any, out: Any) -> None:
    """Continuous angles (rows, n)."""
    for j in range(len(angles)):
        first = angles[j, 0] - guides[j, 0]
        whole = TURN * np.rint(first / TURN)
        out[j, 0] = guides[j, 0] + (first - whole)
        before, taken = first, 0.0
        for i in range(1, angles.shape[1]):
            lag = angles[j, i] - guides[j, i]
            step = lag - before
            if not abs(step) < HALF:  # NaN is one, too
                rest = (step + HALF) % TURN - HALF
                if rest == -HALF and step > 0.0:
                    rest = HALF
                taken += rest - step
            before = lag
            out[j, i] = guides[j, i] + ((lag + taken) - whole)


_compiled = LazyKernel(_rows, "(float64[:, ::1], float64[:, ::1], float64[:, ::1])", patience=1.0)


def continuous(angles: Array, guides: Array) -> Array:
    """Continuous angles (rows, n), n > 0, from samples of them modulo a turn, beside guides of their shape; rad."""
    if angles.dtype != np.float64 or not _compiled.ready(SECONDS * len(angles)):
        return charts.unwrapped(angles, guides)
    out = np.empty(angles.shape)
    _compiled.compiled(angles, guides, out)
    return out
