"""Many tops at once: a loop over lanes around the kernels of a family, which LLVM turns into vector instructions.

A *block* is `W` members, each with a top, a start, a step and marks of its own; all of them make step k together, each
in its lane. The functions of a kernel are inlined into the loop over lanes as they stand and do in each lane what they
do alone, operation by operation, so that a member has the bits of `simulate`.

What a block steps is one array, `block`; number r of lane j is ``block[r W + j]``. With d numbers in a state:

    0 .. d-1        state
    d .. 2d-1       what the sums of the state have rounded off so far
    2d .. 3d-1      increment of the last step
    3d              0, or 1 once a lane has to be run alone
    3d + 1          work that a step counts itself, such as iterations
    3d + 2 ..       carry, then working space

What its members are made of is a second array, `table`, that a step only reads: the numbers of the top (p of them),
then those of the rule that the family's `lay` writes.

A lane is given up when its step does what lanes cannot: an outcome that is not OK, or a branch that only the kernel for
one has. It is then run alone from its start, by the compiled run that `simulate` uses; its neighbours do not notice.

How a family joins: it hands a `Lanes` to `loop.kernel_loop`. Its `step` makes one step of all lanes, as one loop or
several over ``range(W)``; in each, `column` makes the tuple that a kernel takes and `put` writes what it returns. LLVM
turns such a loop into vectors only if
    all that a loop writes lies in `block`, at ``(constant) W + j``, and it reads `table` at ``(same for all j) W + j``;
    nothing in it branches (two values of which one is chosen are no branch) or calls the C library;
    no loop of a length unknown when it is compiled stands inside it: stages go outside, lanes inside;
    W is a constant of 16 or more: eight lanes are unrolled and then not made into vectors (4 times as slow);
and it uses vectors of full width only if `step` begins with a call of `wide_vectors`, and so does each function that it
calls and that has a loop of its own, which is made into vectors before it is inlined. Whether it does is seen in
``kernel.inspect_asm()`` (zmm) and in the time: a step of `strang` takes an eighth of that alone.
"""

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symtop.core.jit import compile_kernel, register_jitable, set_item
from symtop.core.simd import wide_vectors
from symtop.methods.framework.plan import OK
from symtop.methods.framework.preparation import Body, Pack, Start, as_fields, conserved
from symtop.methods.vectors import accumulate

Array = NDArray[np.float64]

W = 32  # lanes of a block: four vectors of eight doubles
NEVER = np.iinfo(np.int64).max  # the next mark of a lane that has none left
STRETCH = 1000  # steps after which a block looks for lanes that were given up


@register_jitable
def column(array: Any, first: int, j: int, like: Any) -> Any:
    """Numbers `first`, `first` + 1, ... of lane j, as a tuple as long as `like`."""
    for i in range(len(like)):
        like = set_item(like, i, array[(first + i) * W + j])
    return like


@register_jitable
def put(array: Any, first: int, j: int, values: Any) -> None:
    """Write a tuple to numbers `first`, `first` + 1, ... of lane j."""
    for i in range(len(values)):
        array[(first + i) * W + j] = values[i]


@register_jitable
def none_left(block: Any, live: int) -> bool:
    """Has number `live` of every lane become 0, so that an iteration over the block has ended?"""
    wide_vectors()
    left = 0
    for j in range(W):
        left += block[live * W + j] != 0.0
    return left == 0


@dataclass(frozen=True)
class Lanes:
    """What a family needs to run in lanes.

        step(block, table)               one step of W members, compensated sums included
        lay(par, rule, h, numbers)       the numbers of a member's rule that a step reads, into an array
        read(numbers) -> rule            a rule as the kernel's `observe` and `present` see it
        begin(par, rule, state, h)       the carry in lanes, a flat tuple; None where the kernel's own is one
        size(rule)                       how many numbers `lay` writes
        effort(rule)                     work of a step that is known beforehand
        room(rule)                       numbers of working space that a lane has beside its carry
        pack(rule)                       how a rule travels into compiled code
        show(par, t, state, out)         write a sample at the time t; None where there is a kernel for each chart

    The first four and the last compile; the others take the rule of a method before it is scaled.
    """

    step: Callable[[Any, Any], None]
    lay: Callable[..., None]
    read: Callable[[Any], Any]
    size: Callable[[Any], int]
    top: Any  # the NamedTuple of the numbers of the top
    dimension: int  # of the state
    carry: int  # numbers in the carry, a flat tuple
    effort: Callable[[Any], int] = lambda _: 0
    room: Callable[[Any], int] = lambda _: 0
    begin: Callable[..., Any] | None = None
    show: Callable[..., None] | None = None  # of charts that differ in how many numbers a sample has
    pack: Pack = as_fields

    def __post_init__(self) -> None:
        for part in (self.step, self.lay, self.read, self.begin, self.show):  # at once, as in `preparation.Preparation`
            if part is not None:
                register_jitable(part)

    @property
    def tops(self) -> int:
        """How many numbers of the top there are."""
        return len(self.top._fields)

    @property
    def flag(self) -> int:
        """Which number of a lane says that it has to be run alone."""
        return 3 * self.dimension


def preparing(lanes: Lanes, begin: Any, enter: Any, kind: Any, numbers: Any, scale: Any) -> Any:
    """The compiled preparation of many members: what their columns in `block` and `table` begin with, a row each."""
    lay, begin = lanes.lay, lanes.begin or begin

    def prepare(chosen, given, coefficients, h, marks, prepared, momenta):  # type: ignore[no-untyped-def]
        tops, rules, starts, carries = prepared
        for i in range(len(chosen)):
            m = chosen[i]
            at = given[m]
            top, start = Body(at[0], at[1], at[2]), Start(at[3], at[4], at[5], at[6], at[7], at[8])
            par, state = numbers(top, start)
            rule = scale(kind(coefficients), top, start, h[m])
            state = enter(par, rule, state, h[m])
            carry = begin(par, rule, state, h[m])
            lay(par, rule, h[m], rules[i])
            for q in range(len(par)):
                tops[i, q] = par[q]
            for q in range(len(state)):
                starts[i, q] = state[q]
            for q in range(len(carry)):
                carries[i, q] = carry[q]
            if marks[m, 0] == 0:
                begun = conserved(top, start)
                momenta[m, 0, 0], momenta[m, 0, 1] = begun.p_phi, begun.p_psi

    return compile_kernel(prepare)


@functools.cache
def showing(sample: Callable[..., Any]) -> Callable[..., None]:
    """`sample` as `Lanes.show` has it."""

    def show(par, t, state, out):  # type: ignore[no-untyped-def]
        shown = sample(par, t, state)
        for q in range(len(shown)):
            out[q] = shown[q]

    return register_jitable(show)


def marching(lanes: Lanes, observe: Any, present: Any, write: Any) -> Any:  # noqa: C901  (one loop, read in one piece)
    """The compiled run of the members that `prepare` prepared, block after block; `write` is as `Lanes.show`.

    ``march(at, most, ...)`` begins with block `at[0]`, after step `at[1]` of it (-1: before it is filled), and returns
    when all blocks are done or about `most` steps of members were made; called again it goes on from there.
    """
    step, read, kind = lanes.step, lanes.read, lanes.top
    size, flag = lanes.dimension, lanes.flag
    state_like, top_like = (0.0,) * size, (0.0,) * lanes.tops
    tops, carry_begin = lanes.tops, flag + 2

    @register_jitable
    def fill(block, table, j, i, prepared):  # type: ignore[no-untyped-def]
        given, rules, starts, carries = prepared
        for r in range(len(block) // W):
            block[r * W + j] = 0.0
        for q in range(size):
            block[q * W + j] = starts[i, q]
        for q in range(carries.shape[1]):
            block[(carry_begin + q) * W + j] = carries[i, q]
        for q in range(tops):
            table[q * W + j] = given[i, q]
        for q in range(rules.shape[1]):
            table[(tops + q) * W + j] = rules[i, q]

    @register_jitable
    def show(block, table, before, j, rule, k, h, states, momenta):  # type: ignore[no-untyped-def]
        par = kind(*column(table, 0, j, top_like))
        write(par, k * h, present(par, rule, column(block, 0, j, state_like), k, h), states)
        if k > 0:
            last, dstate = column(before, 0, j, state_like), column(block, 2 * size, j, state_like)
            momenta[0], momenta[1] = observe(par, rule, last, dstate, h)

    def march(at, most, chosen, prepared, h, marks, done, room):  # type: ignore[no-untyped-def]  # noqa: C901
        wide_vectors()
        states, momenta, steps, work = done
        block, table, before, nearest, seen = room
        rules = prepared[1]
        made, members, samples = 0, len(chosen), marks.shape[1]
        while at[0] * W < members and made < most:
            first, k = at[0] * W, at[1]
            if k < 0:
                k = 0
                for j in range(W):
                    i = min(first + j, members - 1)  # a block that is not full has copies of its last member
                    fill(block, table, j, i, prepared)
                    nearest[j], seen[j] = marks[chosen[i], 0] if first + j < members else NEVER, 0
            target = NEVER
            for j in range(W):
                target = min(target, nearest[j])
            if target == NEVER:
                at[0], at[1] = at[0] + 1, -1
                continue
            stop = min(target, k + STRETCH)
            made += W * (stop - k)
            while k < stop:
                k += 1
                if k == target:
                    for q in range(size * W):
                        before[q] = block[q]
                step(block, table)
            at[1] = k
            for j in range(W):
                if block[flag * W + j] != 0.0:
                    nearest[j] = NEVER
                if nearest[j] == k:
                    i = first + j
                    m, s = chosen[i], seen[j]
                    show(block, table, before, j, read(rules[i]), k, h[m], states[m, s], momenta[m, s])
                    seen[j] = s + 1
                    nearest[j] = marks[m, s + 1] if s + 1 < samples else NEVER
                    if s + 1 == samples:
                        steps[m], work[m] = k, np.int64(block[(flag + 1) * W + j])

    return compile_kernel(march)


AT_ONCE = 8  # numbers of a tuple that LLVM still reads without a loop, which would stand in the way


def reading(count: int) -> Callable[..., Any]:
    """``(array, first, j)`` to so many numbers of lane j."""
    like, after = (0.0,) * min(count, AT_ONCE), count - AT_ONCE
    if after <= 0:

        def read(array, first, j):  # type: ignore[no-untyped-def]
            return column(array, first, j, like)
    else:
        rest = reading(after)

        def read(array, first, j):  # type: ignore[no-untyped-def]
            return column(array, first, j, like) + rest(array, first + AT_ONCE, j)

    return register_jitable(read)


def one_loop(
    advance: Callable[..., Any], rule: Any, *, top: Any, dimension: int, carry: int,
    add: Callable[..., Any] = accumulate,
) -> Lanes:  # fmt: skip
    """``advance(par, rule, state, carry)`` is the increment, the next carry and an outcome; `rule` its NamedTuple.

    `add` is how increments are summed, as in `loop.kernel_loop`.
    """
    tops, fields = len(top._fields), len(rule._fields)
    zeros, given = (0.0,) * dimension, (0.0,) * fields
    step_at, flag, carry_at = 2 * dimension, 3 * dimension, 3 * dimension + 2
    register_jitable(advance)
    top_of, rule_of, carried = reading(tops), reading(fields), reading(carry)

    def lay(par, rule, h, numbers):  # type: ignore[no-untyped-def]
        for i in range(fields):
            numbers[i] = rule[i]

    def read(numbers):  # type: ignore[no-untyped-def]
        values = given
        for i in range(fields):
            values = set_item(values, i, numbers[i])
        return rule(*values)

    def step(block, table):  # type: ignore[no-untyped-def]
        wide_vectors()
        for j in range(W):
            par, scaled = top(*top_of(table, 0, j)), rule(*rule_of(table, tops, j))
            state, lost = column(block, 0, j, zeros), block[flag * W + j]
            dstate, after, outcome = advance(par, scaled, state, carried(block, carry_at, j))
            block[flag * W + j] = lost if outcome == OK else 1.0
            moved, low = add(state, column(block, dimension, j, zeros), dstate)
            put(block, 0, j, moved)
            put(block, dimension, j, low)
            put(block, step_at, j, dstate)
            put(block, carry_at, j, after)

    return Lanes(step, lay, read, lambda _: fields, top, dimension, carry, effort=lambda _: 1)
