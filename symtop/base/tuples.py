"""Rows of numbers in kernels: tuples, whose length a kernel is compiled for, or arrays of any length.

A loop that replaces one element of a tuple at a time moves all of it through memory each time, unless LLVM unrolls the
loop, which it does up to about 16 elements: the tables of a splitting with 35 stages took 2 us to multiply by a step.
So a tuple is multiplied by one instruction an element.
"""

from collections.abc import Callable
from typing import Any

from numba import types
from numba.extending import intrinsic, overload

from symtop.base.compiled import INLINED, set_item


@intrinsic
def _times(typing, values, by):  # type: ignore[no-untyped-def]
    def emit(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        result, factor = arguments
        for i in range(len(values)):
            result = builder.insert_value(result, builder.fmul(builder.extract_value(result, i), factor), i)
        return result

    return values(values, types.float64), emit


def times(values: Any, by: float) -> Any:
    """A row of doubles, each multiplied by the number `by`: a new tuple, or the same array."""
    if isinstance(values, tuple):
        return tuple(value * by for value in values)
    for i in range(len(values)):
        values[i] = values[i] * by
    return values


def with_item(values: Any, i: int, value: float) -> Any:
    """A row with number i replaced: a new tuple, or the same array."""
    if isinstance(values, tuple):
        return (*values[:i], value, *values[i + 1 :])
    values[i] = value
    return values


@overload(times, jit_options=INLINED, strict=False)
def _compiled_times(values: Any, by: float) -> Callable[..., Any]:
    def tupled(values, by):  # type: ignore[no-untyped-def]
        return _times(values, by)

    def in_array(values, by):  # type: ignore[no-untyped-def]
        for i in range(len(values)):
            values[i] = values[i] * by
        return values

    return in_array if isinstance(values, types.Array) else tupled


@overload(with_item, jit_options=INLINED, strict=False)
def _compiled_with_item(values: Any, i: int, value: float) -> Callable[..., Any]:
    def tupled(values, i, value):  # type: ignore[no-untyped-def]
        return set_item(values, i, value)

    def in_array(values, i, value):  # type: ignore[no-untyped-def]
        values[i] = value
        return values

    return in_array if isinstance(values, types.Array) else tupled
