"""Many tops at once: a loop over lanes around the kernels of a family, which LLVM turns into vector instructions.

A *block* is `W` members, each with a top, a start, a step and marks of its own; all make a step together, each in its
lane, which takes the next member when its own has ended. The functions of a kernel are inlined into the loop over lanes
as they stand: a member has the bits of `simulate`.

What a block steps is one array, `block`; number r of lane j is ``block[r W + j]``. With d numbers in a state:

    0 .. d-1        state
    d .. 2d-1       accumulated rounding errors of the sums in the state
    2d .. 3d-1      increment of the last step
    3d              0, or 1 once a lane has to be run alone, or minus the outcome with which it has ended
    3d + 1          work that a step counts itself, such as iterations
    3d + 2 ..       carry, then working space; the last number counts the steps made, if lanes can end

The constants of the members are a second array, `table`, that a step only reads: the numbers of the top (p of them),
then those of the rule that the family's `lay` writes.

A lane is given up when its step does what lanes cannot: an outcome that is not OK, or a branch that only the kernel for
one member has. It is then run alone from its start; the other lanes are unaffected. With 100 steps a nutation a fifth
of random tops leaves the chart of the angles, mostly early: so a step of Newton's iteration, in its lane, records the
outcome with which a run ends (`newton`), and such runs are not repeated.

How a family joins: its `loop.Loop` has a function `lanes`. Its `step` makes one step of all lanes, as one loop or
several over ``range(W)``; in each, `column` makes the tuple that a kernel takes and `put` writes what it returns. LLVM
turns such a loop into vectors only if
    all that a loop writes lies in `block`, at ``(constant) W + j``, and it reads `table` at ``(same for all j) W + j``;
    nothing in it branches (two values of which one is chosen are no branch) or calls the C library;
    no loop of a length unknown when it is compiled stands inside it: stages go outside, lanes inside;
    a loop over tuples inside it is short, or LLVM does not unroll it in time: `vectors.each` and `total` need none;
    W is a constant of 16 or more: eight lanes are unrolled and then not made into vectors;
and it uses vectors of full width only if `step` begins with a call of `wide_vectors`, and so does each function that it
calls and that has a loop of its own, which is made into vectors before it is inlined. Whether it does is seen in
``kernel.inspect_asm()`` (zmm).

*Order of members.* A block makes as many steps as its longest member; a step takes about as long as `LEAST_MEMBERS`
members alone. Members enter in the order of their numbers of steps, the longest first; `W` successive ones that
together make fewer steps than `LEAST_MEMBERS` times the longest run alone instead (`loop.whole_run`, without Python's
lock). A step that iterates takes as many passes as its slowest lane: there, members with similar numbers of steps enter
in the order of

    h sqrt(|L|^2 / I1^2 + |mgl| / I1),    how far the top turns and the pendulum swings in a step, in radians,

at the start: over random tops its rank and that of the iterations correlate to 0.92 (midpoint) and 0.97 (gauss-4).
"""

import functools
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from symtop.core.errors import SymtopError
from symtop.core.jit import compile_kernel, is_stored, register_jitable, set_item, to_fixed_tuple
from symtop.core.parallel import check_interrupt
from symtop.methods.framework.angles import in_chart, require_chart
from symtop.methods.framework.plan import OK, Array
from symtop.methods.framework.preparation import Preparation
from symtop.methods.simd import wide_vectors
from symtop.methods.vectors import accumulate
from symtop.model.body import from_flat
from symtop.model.top import NUMBERS, Angles, SymmetricTop

Ints = NDArray[np.int64]

W = 32  # lanes of a block: four vectors of eight doubles
NO_MARK = np.iinfo(np.int64).max  # the next mark of a lane that has none left
STRETCH_STEPS = 100  # steps after which lanes are looked at whose members have ended or were given up


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
def move(add: Any, block: Any, dimension: int, j: int, dstate: Any) -> None:
    """Add the increment of a step to the state of lane j by `add`, `accumulate` or like it, and record it."""
    state, low = add(column(block, 0, j, dstate), column(block, dimension, j, dstate), dstate)
    put(block, 0, j, state)
    put(block, dimension, j, low)
    put(block, 2 * dimension, j, dstate)


@register_jitable
def none_left(block: Any, live: int) -> bool:
    """Is number `live` of every lane 0? Then an iteration over the block has ended in all lanes."""
    wide_vectors()
    count = 0
    for j in range(W):
        count += block[live * W + j] != 0.0
    return count == 0


@dataclass(frozen=True)
class Lanes:
    """What a family needs to run in lanes. All functions compile, but for those of `method`, an unscaled rule."""

    step: Callable[[Any, Any], None]  # (block, table): one step of W members, compensated sums included
    lay: Callable[..., None]  # (par, rule, h, numbers): the numbers of a member's rule that a step reads, into an array
    read: Callable[[Any], Any]  # (numbers): a rule as the kernel's `observe` and `present` see it
    size: Callable[[Any], int]  # (method): how many numbers `lay` writes
    top: Any  # the NamedTuple of the numbers of the top
    dimension: int  # of the state
    carry: int  # numbers in the carry, a flat tuple
    effort: Callable[[Any], int] = lambda _: 0  # (method): work of a step that is known beforehand
    room: Callable[[Any], int] = lambda _: 0  # (method): numbers of working space of a lane beside its carry
    begin: Callable[..., Any] | None = None  # (par, rule, state, h): the carry; None where the kernel's own is flat
    show: Callable[..., None] | None = None  # (par, t, state, out): write a sample; None: a kernel for each chart

    def __post_init__(self) -> None:
        for part in (self.step, self.lay, self.read, self.begin, self.show):  # at once, as in `preparation.Preparation`
            if part is not None:
                register_jitable(part)


def preparing(lanes: Lanes, begin: Any, enter: Any, kind: Any, scale: Any, prepare: Preparation) -> Any:
    """The compiled preparation of many members: the initial numbers of `block` and `table`, one row a member."""
    lay, begin, width = lanes.lay, lanes.begin or begin, prepare.given
    numbers, unpack, momenta_at = prepare.numbers, prepare.unpack, prepare.momenta

    def fill(members, rows, coefficients, h, marks, prepared, momenta):  # type: ignore[no-untyped-def]
        tops, rules, starts, carries = prepared
        for i in range(len(members)):
            m = members[i]
            top, start = unpack(to_fixed_tuple(rows[m], width))
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
                momenta[m, 0, 0], momenta[m, 0, 1] = momenta_at(top, start)

    return compile_kernel(fill)


@functools.cache
def showing(sample: Callable[..., Any]) -> Callable[..., None]:
    """`sample` as `Lanes.show` has it."""

    def show(par, t, state, out):  # type: ignore[no-untyped-def]
        values = sample(par, t, state)
        for q in range(len(values)):
            out[q] = values[q]

    return register_jitable(show)


def marching(lanes: Lanes, observe: Any, present: Any, write: Any) -> Any:  # noqa: C901  (one loop, read in one piece)
    """The compiled run of what `prepare` prepared, in a block whose lanes take the next member when they are free.

    ``march(at, limit, ...)`` goes on after `at[0]` members have entered and `at[1]` steps were made, and returns when
    about `limit` steps of members were made, or when all members have ended, with `at[1]` at -1.
    """
    step, read, kind = lanes.step, lanes.read, lanes.top
    size, tops = lanes.dimension, len(kind._fields)
    state_like, top_like = (0.0,) * size, (0.0,) * tops
    flag, carry_begin = 3 * size, 3 * size + 2

    @register_jitable
    def fill(block, table, j, i, prepared):  # type: ignore[no-untyped-def]
        parameters, rules, starts, carries = prepared
        for r in range(len(block) // W):
            block[r * W + j] = 0.0
        for q in range(size):
            block[q * W + j] = starts[i, q]
        for q in range(carries.shape[1]):
            block[(carry_begin + q) * W + j] = carries[i, q]
        for q in range(tops):
            table[q * W + j] = parameters[i, q]
        for q in range(rules.shape[1]):
            table[(tops + q) * W + j] = rules[i, q]

    @register_jitable
    def show(block, table, before, j, rule, k, h, states, momenta):  # type: ignore[no-untyped-def]
        par = kind(*column(table, 0, j, top_like))
        write(par, k * h, present(par, rule, column(block, 0, j, state_like), k, h), states)
        if k > 0:
            last, dstate = column(before, 0, j, state_like), column(block, 2 * size, j, state_like)
            momenta[0], momenta[1] = observe(par, rule, last, dstate, h)

    def march(at, limit, batch, prepared, h, marks, runs, room):  # type: ignore[no-untyped-def]  # noqa: C901
        wide_vectors()
        states, momenta, steps, work, outcomes = runs
        block, table, before, next_mark, sample, member, start = room
        rules = prepared[1]
        total, members, samples, ended_at = 0, len(batch), marks.shape[1], len(block) - W
        while at[1] >= 0 and total < limit:
            k, target = at[1], NO_MARK
            for j in range(W):
                if next_mark[j] == NO_MARK and (at[0] < members or k == 0):
                    i = min(at[0], members - 1)  # a block that is not full has copies of its last member
                    fill(block, table, j, i, prepared)
                    if at[0] < members:
                        at[0], member[j], start[j], sample[j], next_mark[j] = i + 1, i, k, 0, k + marks[batch[i], 0]
                target = min(target, next_mark[j])
            if target == NO_MARK:
                at[1] = -1
                break
            stop = min(target, k - k % STRETCH_STEPS + STRETCH_STEPS)
            total += W * (stop - k)
            while k < stop:
                k += 1
                if k == target:
                    for q in range(size * W):
                        before[q] = block[q]
                step(block, table)
            at[1] = k
            for j in range(W):
                m, s, effort = batch[member[j]], sample[j], np.int64(block[(flag + 1) * W + j])
                status = block[flag * W + j]
                if status < 0.0 and next_mark[j] != NO_MARK:
                    outcomes[m], steps[m], work[m] = np.int64(-status), np.int64(block[ended_at + j]), effort
                if status != 0.0:
                    next_mark[j] = NO_MARK
                if next_mark[j] == k:
                    own_steps = k - start[j]
                    show(block, table, before, j, read(rules[member[j]]), own_steps, h[m], states[m, s], momenta[m, s])
                    sample[j] = s + 1
                    next_mark[j] = start[j] + marks[m, s + 1] if s + 1 < samples else NO_MARK
                    if s + 1 == samples:
                        steps[m], work[m] = own_steps, effort

    return compile_kernel(march)


AT_ONCE = 8  # the longest tuple that LLVM reads without an inner loop, which would prevent vector instructions


def reading(count: int) -> Callable[..., Any]:
    """A function (array, first, j) that returns numbers `first`, `first` + 1, ... of lane j, `count` of them."""
    zeros, after = (0.0,) * min(count, AT_ONCE), count - AT_ONCE
    if after <= 0:

        def read(array, first, j):  # type: ignore[no-untyped-def]
            return column(array, first, j, zeros)
    else:
        rest = reading(after)

        def read(array, first, j):  # type: ignore[no-untyped-def]
            return column(array, first, j, zeros) + rest(array, first + AT_ONCE, j)

    return register_jitable(read)


def one_loop(
    advance: Callable[..., Any], lay: Callable[..., None], size: int, *, top: Any, dimension: int, carry: int = 1,
    begin: Callable[..., Any] | None = None, cost: int = 1, read: Callable[[Any], Any] = lambda _: 0.0,
    add: Callable[..., Any] = accumulate,
) -> Lanes:  # fmt: skip
    """Lanes whose step is one loop over ``advance(par, state, carry, table, j)`` -> (increment, next carry, outcome).

    `lay` writes `size` numbers, and a step takes `cost` units of work.
    """
    zeros, flag, carry_at = (0.0,) * dimension, 3 * dimension, 3 * dimension + 2
    top_of, carry_of = reading(len(top._fields)), reading(carry)
    register_jitable(advance)

    def step(block, table):  # type: ignore[no-untyped-def]
        wide_vectors()
        for j in range(W):
            state, before = column(block, 0, j, zeros), carry_of(block, carry_at, j)
            dstate, after, outcome = advance(top(*top_of(table, 0, j)), state, before, table, j)
            block[flag * W + j] = block[flag * W + j] if outcome == OK else 1.0
            move(add, block, dimension, j, dstate)
            put(block, carry_at, j, after)

    return Lanes(step, lay, read, lambda _: size, top, dimension, carry, lambda _: cost, begin=begin)


def loop_with_rule(advance: Callable[..., Any], rule: Any, *, top: Any, **options: Any) -> Lanes:
    """`one_loop` over ``advance(par, rule, state, carry)``, of a rule that is a NamedTuple of numbers."""
    fields, tops = len(rule._fields), len(top._fields)
    rule_of = reading(fields)
    register_jitable(advance)

    def lay(par, rule, h, numbers):  # type: ignore[no-untyped-def]
        for i in range(fields):
            numbers[i] = rule[i]

    def read(numbers):  # type: ignore[no-untyped-def]
        return rule(*to_fixed_tuple(numbers, fields))

    def advance_lane(par, state, carry, table, j):  # type: ignore[no-untyped-def]
        return advance(par, rule(*rule_of(table, tops, j)), state, carry)

    return one_loop(advance_lane, lay, fields, top=top, read=read, **options)


GROUP_STEPS = 200_000  # steps between returns to Python, so that an interrupt is heard: a second of the slowest kernel


class Many(NamedTuple):
    """What the runs of n members return; one that starts on a pole of the angles chart makes no step."""

    states: Array  # (n, samples, dimension) of the chart, NaN after a failure
    momenta: Array  # (n, samples, 2): p_phi and p_psi recomputed from the increments
    steps: Ints  # (n,) completed
    work: Ints  # (n,) force evaluations or solver iterations, as the family counts them
    outcome: Ints  # (n,) indices into OUTCOMES

    @classmethod
    def empty(cls, n: int, samples: int, size: int) -> "Many":
        """Room for n members, none of which has made a step."""
        states, momenta = np.full((n, samples, size), np.nan), np.full((n, samples, 2), np.nan)
        return cls(states, momenta, *(np.zeros(n, dtype=np.int64) for _ in range(3)))


def of_bodies(numbers: Array) -> bool:
    """Are these rows of bodies without symmetry, and not of tops?"""
    return int(numbers.shape[1]) != len(NUMBERS)


def members_of(numbers: Array) -> Iterator[tuple[Any, Any]]:
    """The top, or the body, and the start in each row."""
    for row in numbers.tolist():
        yield from_flat(row) if of_bodies(numbers) else (SymmetricTop(*row[:3]), Angles(*row[3:]))


def refused(check: Callable[..., None] | None, numbers: Array) -> NDArray[np.bool_]:
    """Which members have a start that a kernel with this check, of `Preparation`, cannot step."""
    if check is None:
        return np.zeros(len(numbers), dtype=bool)
    if check is require_chart:  # of all at once
        return ~np.asarray(in_chart(numbers[:, 3]))
    return np.array([_refuses(check, start) for _, start in members_of(numbers)], dtype=bool)


def _refuses(check: Callable[..., None], start: Any) -> bool:
    try:
        check(start)
    except SymtopError:
        return True
    return False


def groups(members: Ints, steps: Ints, limit: int) -> list[Ints]:
    """The members, in order, in groups that make about `limit` steps together."""
    ends = np.cumsum(steps[members]) // limit
    return np.split(members, np.flatnonzero(np.diff(ends)) + 1) if members.size else []


LEAST_MEMBERS = 5  # alone take as long as a block: 32 lanes, each in about a seventh of the time of a member alone
ALIKE_RATIO = 1.1  # numbers of steps within this factor of each other are alike, where the step iterates
BATCH_MEMBERS = 128 * W  # members that are prepared at a time: 4 MB for the longest table
FEW_STEPS = 5_000_000  # steps, which take members alone 0.2 to 3 s, where kernels in lanes take 1 to 14 s to compile


@dataclass
class Blocks:
    """The kernels of one method in lanes, which are compiled when they first run."""

    lanes: Lanes
    prepare: Any
    march: Any
    asked: int = 0  # steps, of all calls of `worth`

    def worth(self, steps: int) -> bool:
        """Are the kernels compiled, or have they, with these, been asked for more than `FEW_STEPS` steps?"""
        self.asked += steps
        return self.asked > FEW_STEPS or is_stored(self.march)

    def run(self, members: Ints, numbers: Array, rule: Any, h: Array, marks: Ints, runs: Many, limit: int) -> Ints:
        """Run members, about `limit` steps a call; return those to run alone. `rule`: as it is, and as compiled."""
        (rule, coefficients), lanes, steps = rule, self.lanes, marks[:, -1]
        counts_itself = lanes.effort(rule) == 0  # the step iterates
        queue, rest = divided(members, steps, turns(numbers, h) if counts_itself else None)
        tops, fields, dimension, carry = len(lanes.top._fields), lanes.size(rule), lanes.dimension, lanes.carry
        per_lane = 3 * dimension + 2 + carry + lanes.room(rule), tops + fields, dimension
        room = *(aligned(n * W) for n in per_lane), np.full(W, NO_MARK), *np.zeros((3, W), dtype=np.int64)
        queue = np.ascontiguousarray(queue[::-1])  # the longest begin first
        alone = [rest]
        for first in range(0, len(queue), BATCH_MEMBERS):
            batch = queue[first : first + BATCH_MEMBERS]
            prepared = tuple(np.empty((len(batch), width)) for width in (tops, fields, dimension, carry))
            self.prepare(batch, numbers, coefficients, h, marks, prepared, runs.momenta)
            at = np.array([0, 0])
            while at[1] >= 0:
                check_interrupt()
                self.march(at, limit, batch, prepared, h, marks, tuple(runs), room)
            ended = (runs.steps[batch] == marks[batch, -1]) | (runs.outcome[batch] != OK)
            runs.work[batch[ended]] += runs.steps[batch[ended]] * lanes.effort(rule)
            alone.append(batch[~ended])
        return np.concatenate(alone)


def aligned(count: int) -> Array:
    """An array of `count` numbers at a multiple of 64 bytes: no vector of eight lies in two lines of the cache."""
    array = np.empty(count + 7)
    first = -(array.ctypes.data // 8) % 8
    return array[first : first + count]


def turns(numbers: Array, h: Array) -> Array:
    """About the angle by which each member (row) moves in one of its steps, in radians; not finite if it overflows."""
    if of_bodies(numbers):
        moments = numbers[:, :3]
        with np.errstate(all="ignore"):
            square = (numbers[:, 11:] ** 2).sum(axis=1) + np.abs(numbers[:, 3]) / moments.min(axis=1)
            return np.asarray(np.abs(h) * np.sqrt(square))
    I1, I3, mgl, theta, _, _, dtheta, dphi, dpsi = numbers.T
    with np.errstate(all="ignore"):
        spin = I3 / I1 * (dpsi + dphi * np.cos(theta))
        rate: Array = np.sqrt(dtheta**2 + (dphi * np.sin(theta)) ** 2 + spin**2 + np.abs(mgl) / I1)
        return np.abs(h) * rate


def divided(members: Ints, steps: Ints, turns: Array | None = None) -> tuple[Ints, Ints]:
    """The members whose steps fill blocks well, in order (of `turns` where steps are `ALIKE_RATIO`), and the others."""
    if not len(members):
        return members, members
    counts = steps[members]
    if turns is None:
        order = np.argsort(counts, kind="stable")
    else:
        order = np.lexsort((turns[members], np.floor(np.log(np.maximum(counts, 1)) / np.log(ALIKE_RATIO))))
    members, counts = members[order], counts[order]
    firsts = np.arange(0, len(members), W)
    sizes = np.diff(np.append(firsts, len(members)))
    full = np.add.reduceat(counts, firsts) >= LEAST_MEMBERS * np.maximum.reduceat(counts, firsts)
    in_lanes = np.repeat(full, sizes)
    return members[in_lanes], members[~in_lanes]
