"""a b + c with one rounding, for kernels that add a small correction to a large number.

A number on the grid of its last place plus a correction that hardly changes from step to step is rounded the same way
every time: a bias of up to half a unit in the last place, of one sign for a whole stretch of an orbit. The exact
product of two doubles has random digits below that grid; added before the one rounding, they make it unbiased.
"""

from numba import types
from numba.extending import intrinsic, overload

from symtop.base.parts import fused, two_product

__all__ = ["fused"]


@intrinsic
def _fma(typing, a, b, c):  # type: ignore[no-untyped-def]
    """LLVM's fma: one instruction where the processor has it, exact software where it has not."""

    def emit(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        return builder.fma(*arguments)

    return types.float64(types.float64, types.float64, types.float64), emit


@overload(fused, inline="always")
def _fused(a, b, c):  # type: ignore[no-untyped-def]
    if not all(isinstance(value, types.Float) for value in (a, b, c)):
        return None

    def once(a, b, c):  # type: ignore[no-untyped-def]
        return _fma(a, b, c)

    return once


@overload(two_product, inline="always")
def _two_product(a, b):  # type: ignore[no-untyped-def]
    def exactly(a, b):  # type: ignore[no-untyped-def]
        product = a * b
        return product, _fma(a, b, -product)

    return exactly
