"""Whole tuples of numbers in kernels, one instruction an element.

A loop that replaces one element of a tuple at a time moves all of it through memory each time, unless LLVM unrolls the
loop, which it does up to about 16 elements: the tables of a splitting with 35 stages took 2 us to multiply by a step.
"""

from numba import types
from numba.extending import intrinsic


@intrinsic
def times(typing, values, by):  # type: ignore[no-untyped-def]
    """A tuple of doubles, each multiplied by the number `by`."""

    def emit(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        result, factor = arguments
        for i in range(len(values)):
            result = builder.insert_value(result, builder.fmul(builder.extract_value(result, i), factor), i)
        return result

    return values(values, types.float64), emit
