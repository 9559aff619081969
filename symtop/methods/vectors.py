"""Arithmetic of short tuples in kernels: vectors of three, quaternions (w, x, y, z), and sums with compensation."""

from collections.abc import Callable
from typing import Any

from symtop.core.jit import register_jitable, set_item


@register_jitable
def dot(a: Any, b: Any) -> Any:
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@register_jitable
def cross(a: Any, b: Any) -> Any:
    """Vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@register_jitable
def scaled(s: Any, a: Any) -> Any:
    """s a."""
    return s * a[0], s * a[1], s * a[2]


@register_jitable
def plus(a: Any, s: Any, b: Any) -> Any:
    """a + s b."""
    return a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]


@register_jitable
def conjugate(q: Any) -> Any:
    """q*."""
    return q[0], -q[1], -q[2], -q[3]


@register_jitable
def displaced(q: Any, v: Any) -> Any:
    """q v q* - v of a unit quaternion; doubled by addition, in any precision."""
    u = q[1], q[2], q[3]
    c = cross(u, v)
    d = plus(cross(u, c), q[0], c)
    return d[0] + d[0], d[1] + d[1], d[2] + d[2]


@register_jitable
def rotated(q: Any, v: Any) -> Any:
    """q v q* of a unit quaternion."""
    x, y, z = displaced(q, v)
    return v[0] + x, v[1] + y, v[2] + z


@register_jitable
def solve3(a: Any, b: Any, c: Any, y: Any) -> Any:
    """x of M x = y for the matrix with columns a, b and c, by Cramer's rule."""
    bc, ca, ab = cross(b, c), cross(c, a), cross(a, b)
    inverse = 1.0 / dot(a, bc)
    return inverse * dot(bc, y), inverse * dot(ca, y), inverse * dot(ab, y)


def each(make: Callable[[int], Callable[..., Any]], count: int, i: int = 0) -> Callable[..., Any]:
    """A function that returns the tuple of ``make(i)(...)``, i < count.

    In the place of a loop over tuples: LLVM unrolls those only if they are short, and most of them too late for lanes.
    """
    part = register_jitable(make(i))
    if i + 1 == count:
        return register_jitable(lambda *args: (part(*args),))
    others = each(make, count, i + 1)
    return register_jitable(lambda *args: (part(*args), *others(*args)))


def total(make: Callable[[int], Callable[..., Any]], count: int) -> Callable[..., Any]:
    """A function that adds ``make(i)(...)``, i < count, to its first argument in this order."""
    last = register_jitable(make(count - 1))
    if count == 1:
        return register_jitable(lambda first, *args: first + last(*args))
    before = total(make, count - 1)
    return register_jitable(lambda first, *args: before(first, *args) + last(*args))


def dot_of(count: int) -> Callable[..., Any]:
    """The scalar product of the first numbers of two tuples, in order."""
    products = total(lambda i: lambda a, b: a[i] * b[i], count)
    return register_jitable(lambda a, b: products(0.0, a, b))


@register_jitable
def summed(state: Any, step: Any) -> Any:
    """state + step, component by component."""
    for i in range(len(state)):
        state = set_item(state, i, state[i] + step[i])
    return state


@register_jitable
def accumulate(state: Any, low: Any, dstate: Any) -> Any:
    """(state + low) + dstate as a new pair of high and low parts; exact (Knuth's two-sum).

    Two loops: one for both tuples is too long for LLVM to unroll over the nine components of a frame.
    """
    total = state
    for i in range(len(state)):
        total = set_item(total, i, state[i] + (dstate[i] + low[i]))
    for i in range(len(state)):
        addend = dstate[i] + low[i]
        virtual = total[i] - state[i]
        low = set_item(low, i, (state[i] - (total[i] - virtual)) + (addend - virtual))
    return total, low


@register_jitable
def accumulate_plainly(state: Any, low: Any, dstate: Any) -> Any:
    """Sums without compensation, for comparison, and for kernels that compensate themselves."""
    return summed(state, dstate), low


@register_jitable
def zero(like: Any) -> Any:
    """A tuple of as many zeros."""
    for i in range(len(like)):
        like = set_item(like, i, 0.0)
    return like
