"""Four doubles in one register: explicit vector operations for kernels that LLVM does not vectorise by itself.

A recurrence whose every term needs all terms before it, a Taylor series, is unrolled completely and has no loop that
could be vectorised. Written with the operations of `Vectors`, an order of 20 takes a fifth of the time.
Every operation rounds as IEEE 754 says, and products are fused with sums where `fma` stands and nowhere else, so that
the result does not depend on the processor.

`Components` writes the same operations on four scalars each, to the same bits: inside a loop over many members LLVM
makes vectors of the members, and does not compute components that are not used.

A kernel in plain Python steps two runs at once on tuples of `two()`, two doubles in one register: +, - and * act on
both, with the bits of each run alone.

`times` and `with_item` take a row that is an array, or a tuple, if it is short: LLVM unrolls a loop over a tuple up to
about 16 elements and copies the tuple in each pass beyond.
"""

import functools
import operator
from collections.abc import Callable, Sequence
from typing import Any

from llvmlite import ir
from numba import types
from numba.core.cgutils import unpack_tuple
from numba.extending import intrinsic, models, overload, register_model

from symtop.core.jit import INLINED, register_jitable, set_item

LANES = 4
_INDEX, _DOUBLE = ir.IntType(32), ir.DoubleType()
_VECTOR = ir.VectorType(_DOUBLE, LANES)


class Vectors:
    """Writes operations on vectors of four doubles with LLVM's `builder`; scalars are values of LLVM, too."""

    def __init__(self, builder: Any) -> None:
        self.builder = builder
        name, module = f"llvm.fma.v{LANES}f64", builder.module
        kind = ir.FunctionType(_VECTOR, [_VECTOR] * 3)
        self._fma = module.globals.get(name) or ir.Function(module, kind, name)

    def constant(self, *lanes: float) -> Any:
        """A constant, the same in each lane if only one is given."""
        values = lanes if len(lanes) == LANES else lanes * LANES
        return ir.Constant(_VECTOR, [float(value) for value in values])

    def number(self, value: float) -> Any:
        """A constant scalar."""
        return ir.Constant(_DOUBLE, float(value))

    def pack(self, *scalars: Any) -> Any:
        """A vector of four scalars, or of four times one."""
        vector = ir.Constant(_VECTOR, ir.Undefined)
        for k, scalar in enumerate(scalars if len(scalars) == LANES else scalars * LANES):
            vector = self.builder.insert_element(vector, scalar, ir.Constant(_INDEX, k))
        return vector

    def lane(self, vector: Any, k: int) -> Any:
        """One scalar of a vector."""
        return self.builder.extract_element(vector, ir.Constant(_INDEX, k))

    def shuffled(self, vector: Any, *order: int) -> Any:
        """The lanes of a vector in another order."""
        mask = ir.Constant(ir.VectorType(_INDEX, LANES), list(order))
        return self.builder.shuffle_vector(vector, ir.Constant(_VECTOR, ir.Undefined), mask)

    def fma(self, a: Any, b: Any, c: Any) -> Any:
        """a b + c, rounded once."""
        return self.builder.call(self._fma, [a, b, c])

    def dot(self, pairs: Sequence[tuple[Any, Any]]) -> Any:
        """Sum of products in two chains, the first pairs first: half the latency of one chain."""
        chains: list[Any] = [None, None]
        for k, (a, b) in enumerate(pairs):
            chain = chains[k % 2]
            chains[k % 2] = self.builder.fmul(a, b) if chain is None else self.fma(a, b, chain)
        return chains[0] if chains[1] is None else self.builder.fadd(*chains)

    def total(self, values: Sequence[Any]) -> Any:
        """Sum of vectors by pairs of neighbours."""
        row = list(values)
        while len(row) > 1:
            pairs = [self.builder.fadd(a, b) for a, b in zip(row[::2], row[1::2], strict=False)]
            row = [*pairs, *row[len(pairs) * 2 :]]
        return row[0]

    def array(self, scalars: Sequence[Any]) -> Any:
        """A tuple of doubles, as numba holds it."""
        out = ir.Constant(ir.ArrayType(_DOUBLE, len(scalars)), ir.Undefined)
        for k, scalar in enumerate(scalars):
            out = self.builder.insert_value(out, scalar, k)
        return out


class _Each:
    """A builder whose arithmetic takes lists of scalars, too, component by component."""

    def __init__(self, builder: Any) -> None:
        self._builder = builder

    def __getattr__(self, name: str) -> Any:
        operation = getattr(self._builder, name)

        def each(*values: Any) -> Any:
            lists = [value for value in values if isinstance(value, list)]
            return [operation(*parts) for parts in zip(*values, strict=True)] if lists else operation(*values)

        return each if name in ("fadd", "fsub", "fmul", "fneg", "fma") else operation


class Components(Vectors):
    """`Vectors` whose four doubles stand in four registers, beside those of other members."""

    def __init__(self, builder: Any) -> None:
        self.builder: Any = _Each(builder)

    def constant(self, *lanes: float) -> Any:
        """Four constants."""
        return [self.number(value) for value in (lanes if len(lanes) == LANES else lanes * LANES)]

    def pack(self, *scalars: Any) -> Any:
        """Four scalars, or four times one."""
        return list(scalars if len(scalars) == LANES else scalars * LANES)

    def lane(self, vector: Any, k: int) -> Any:
        """One scalar of four."""
        return vector[k]

    def shuffled(self, vector: Any, *order: int) -> Any:
        """The four in another order."""
        return [vector[k] for k in order]

    def fma(self, a: Any, b: Any, c: Any) -> Any:
        """a b + c, rounded once."""
        return self.builder.fma(a, b, c)


_PAIR = ir.VectorType(_DOUBLE, 2)


def _paired(builder: Any, first: Any, second: Any) -> Any:
    """Two scalars in one register; `first` itself if it is such a register already."""
    if first.type == _PAIR:
        return first
    half = builder.insert_element(ir.Constant(_PAIR, ir.Undefined), first, ir.Constant(_INDEX, 0))
    return builder.insert_element(half, second, ir.Constant(_INDEX, 1))


def _pair_operation(name: str) -> Any:
    """An operation of LLVM on two values, registers of two doubles or scalars, which stand for two equal ones."""

    @intrinsic
    def operation(typing, a, b):  # type: ignore[no-untyped-def]
        def emit(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
            return getattr(builder, name)(*(_paired(builder, value, value) for value in arguments))

        return two()(a, b), emit

    return operation


class _Two(types.Type):  # type: ignore[misc]
    """The numba type of two doubles in one register; its operations enter the hash of a kernel."""

    def __init__(self) -> None:
        super().__init__("two doubles")
        self.operations = tuple(map(_pair_operation, ("fadd", "fsub", "fmul")))


@functools.cache
def two() -> Any:
    """The only `_Two`; a function, so that no kernel's hash depends on numba's number of the type in this process."""
    return _Two()


register_model(_Two)(lambda manager, kind: models.PrimitiveModel(manager, kind, _PAIR))


def _overload(operation: Any, emitted: Any) -> None:
    def select(a: Any, b: Any) -> Any:
        return (lambda a, b: emitted(a, b)) if two() in (a, b) else None  # noqa: PLW0108  (numba takes functions of Python)

    overload(operation, jit_options=INLINED, strict=False)(select)


for _operation, _emitted in zip((operator.add, operator.sub, operator.mul), two().operations, strict=True):
    _overload(_operation, _emitted)
overload(operator.neg, jit_options=INLINED)(lambda a: (lambda a: -1.0 * a) if a is two() else None)


@intrinsic
def side_by_side(typing, first, second):  # type: ignore[no-untyped-def]
    """A tuple of `two()` of two tuples of doubles."""

    def emit(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        numbers = zip(*(unpack_tuple(builder, pair) for pair in arguments), strict=True)
        return context.make_tuple(builder, signature.return_type, [_paired(builder, *two) for two in numbers])

    return types.UniTuple(two(), len(first))(first, second), emit


@intrinsic
def apart(typing, pairs):  # type: ignore[no-untyped-def]
    """The two tuples of doubles that a tuple of `two()` is made of."""
    row = types.UniTuple(types.float64, len(pairs))

    def emit(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        values = unpack_tuple(builder, arguments[0])
        lanes = ([builder.extract_element(value, ir.Constant(_INDEX, k)) for value in values] for k in range(2))
        return context.make_tuple(builder, signature.return_type, [*map(Vectors(builder).array, lanes)])

    return types.UniTuple(row, 2)(pairs), emit


@intrinsic
def combined(typing, place, terms, weights, h):  # type: ignore[no-untyped-def]
    """place + h w_0 terms_0 + h w_1 terms_1 + ... of tuples, in this order and without the terms whose weight is None.

    Written out: a closure for each term takes twice as long to compile, a loop four times as long to run.
    """
    indices = [j for j, weight in enumerate(weights) if weight is not types.none]

    def emit(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        result, rows, numbers, step = arguments
        factors = [(j, builder.fmul(step, builder.extract_value(numbers, j))) for j in indices]
        broadcast = _paired if place.dtype is two() else lambda _, value, __: value
        for m in range(len(place)):
            total = builder.extract_value(result, m)
            for j, factor in factors:
                term = builder.extract_value(rows, [j, m])
                product = builder.fmul(*(broadcast(builder, value, value) for value in (factor, term)))
                total = builder.fadd(total, product)
            result = builder.insert_value(result, total, m)
        return result

    return place(place, terms, weights, h), emit


@intrinsic
def wide_vectors(typing):  # type: ignore[no-untyped-def]
    """Let the kernel that calls this use 512 bits, where the processor has them; it does nothing when it runs.

    The kernel must call it itself: what is inlined takes the attributes of the function it is inlined into.
    """

    def emit(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        set.add(builder.function.attributes, '"prefer-vector-width"="512"')  # `add` refuses names it does not know
        return context.get_dummy_value()

    return types.void(), emit


def _put(values: Any, i: int, value: float) -> Any:
    values[i] = value
    return values


def with_item(values: Any, i: int, value: float) -> Any:
    """A row with number i replaced: a new tuple, or the same array."""
    return (*values[:i], value, *values[i + 1 :]) if isinstance(values, tuple) else _put(values, i, value)


@overload(with_item, jit_options=INLINED, strict=False)
def _compiled_with_item(values: Any, i: int, value: float) -> Callable[..., Any]:
    return _put if isinstance(values, types.Array) else lambda values, i, value: set_item(values, i, value)  # noqa: PLW0108


@register_jitable
def times(values: Any, factor: float) -> Any:
    """A row of doubles, each multiplied by the number `factor`: a new tuple, or the same array."""
    for i in range(len(values)):
        values = with_item(values, i, values[i] * factor)
    return values
