"""Decorators that mark functions for use in kernels without importing numba.

`symtop.core.jit` registers the marked functions before it compiles a kernel, and compiles them unchanged. A marked
function remains a plain function: interpreted, it returns the bits that it returns when compiled, provided that it

    adds, subtracts, multiplies, divides and takes square roots of doubles (IEEE 754 leaves no choice there),
    calls the C library for anything else (`math` and compiled code call the same one),
    never divides by zero and never overflows (compiled code goes on with infinities, the interpreter raises).

Three operations have two implementations. The result of `two_product` is exact and hence the same in both; `fused` and
`sincos` (`symtop.core.sines`) may differ from what the interpreter returns in the last place.
"""

from collections.abc import Callable
from typing import Any, TypeVar

Function = TypeVar("Function", bound=Callable[..., object])

marked: list[tuple[Callable[..., object], bool]] = []  # functions, and whether they are inlined


def inlined(function: Function) -> Function:
    """Let kernels call a plain function, copied into each caller: for a few operations."""
    marked.append((function, True))
    return function


def shared(function: Function) -> Function:
    """Let kernels call a plain function that is compiled once: for a larger one, called from several places."""
    marked.append((function, False))
    return function


def fused(a: Any, b: Any, c: Any) -> Any:
    """a b + c, rounded once in compiled code; outside of it, in whatever arithmetic the arguments bring, twice."""
    return a * b + c


def two_product(a: float, b: float) -> tuple[float, float]:
    """The product of two doubles and its rounding error, exactly, if both lie well within the range of doubles.

    Dekker's seventeen operations; compiled code takes two with the fused multiply-add (`symtop.core.jit`).
    Source: Dekker, Numerische Mathematik 18 (1971) 224.
    """
    product = a * b
    a_scaled, b_scaled = 134217729.0 * a, 134217729.0 * b  # 2^27 + 1
    a_high, b_high = a_scaled - (a_scaled - a), b_scaled - (b_scaled - b)
    a_low, b_low = a - a_high, b - b_high
    return product, ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low
