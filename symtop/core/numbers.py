"""Numbers that many modules need, each defined once, arrays of real numbers, mpmath for threads."""

import math
import sys
import threading
from reprlib import repr as short
from typing import Any

import numpy as np

from symtop.core.errors import SymtopError, finite

EPSILON = sys.float_info.epsilon  # 2.2e-16: the spacing of doubles at 1
TINY = sys.float_info.min  # 2.2e-308: a divisor that is never zero
GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)  # steps of this length, modulo 1, are commensurate with no period
_contexts = threading.local()  # its attributes are the thread's own


def context(digits: int) -> Any:
    """An mpmath context of that many decimal digits, one for each thread, as all threads share `mpmath.mp`."""
    contexts: dict[Any, Any] = vars(_contexts)
    if digits not in contexts:
        from mpmath.ctx_mp import MPContext  # mpmath costs 0.1 s to import

        contexts[digits] = MPContext()
        contexts[digits].dps = digits
    return contexts[digits]


def real_numbers(name: str, values: object) -> np.ndarray:
    """An array of doubles of any shape, C-ordered; SymtopError for all else: complex numbers, text, masked entries."""
    if type(values) is np.ndarray and values.dtype == np.float64:
        return np.ascontiguousarray(values).reshape(values.shape)
    try:
        array = np.asarray(values)
        if array.dtype.kind == "O":  # whole numbers beyond 64 bits, fractions, decimals
            array = np.array([finite(name, value) for value in array.ravel().tolist()]).reshape(array.shape)
    except (TypeError, ValueError, OverflowError):  # ragged, or no number
        array = np.empty(0, dtype=object)
    if array.dtype.kind not in "fiu" or np.ma.is_masked(values):
        raise SymtopError(f"{name} must be real numbers, not {short(values)}")
    return np.asarray(array, dtype=np.float64, order="C")
