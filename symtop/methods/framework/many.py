"""Many runs of one fixed-step method: what they return, and which of them run side by side in blocks of lanes.

Member i is a top and a start as nine plain numbers (`symtop.model.top.flat`), a step and the marks of its samples. It
gets the bits of a run alone. Outside of blocks it is one: a call of the compiled run of one (`loop.Loop.whole`), in
which numba lets go of Python's lock, so that threads run at the same time.

A block takes as long as its longest member and about as long as `LEAST` members alone. Members stand in it in the
order of their numbers of steps, and a block whose members together make fewer steps than `LEAST` times the longest is
left to the loop for one. So is every member whose lane was given up (`lanes`).

A step that iterates takes as many passes as its slowest lane. For such methods, members whose steps are alike in
number stand in the order of

    h sqrt(|L|^2 / I1^2 + |mgl| / I1),    how far the top turns and the pendulum swings in a step, in radians,

at the start: over random tops its rank and that of the iterations correlate to 0.92 (midpoint) and 0.97 (gauss-4).
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from symtop.core.parallel import heed
from symtop.methods.framework.lanes import Lanes, W
from symtop.methods.framework.preparation import Requirement, Start
from symtop.model.top import Angles, SymmetricTop

Array = NDArray[np.float64]
Whole = NDArray[np.int64]


GROUP = 200_000  # steps between returns to Python, so that an interrupt is heard: a second of the slowest kernel


class Many(NamedTuple):
    """What the runs of n members return; the counts are those of `loop.March`.

    A member whose start the kernel cannot step, on a pole in the angles chart, has left the chart before its first
    step.
    """

    states: Array  # (n, samples, dimension) of the chart, NaN after a failure
    momenta: Array  # (n, samples, 2): p_phi and p_psi recomputed from the increments
    steps: Whole  # (n,) completed
    work: Whole  # (n,) force evaluations or solver iterations, as the family counts them
    outcome: Whole  # (n,) indices into OUTCOMES

    @classmethod
    def begun(cls, n: int, samples: int, size: int) -> "Many":
        """Room for n members, none of which has made a step."""
        states, momenta = np.full((n, samples, size), np.nan), np.full((n, samples, 2), np.nan)
        return cls(states, momenta, *(np.zeros(n, dtype=np.int64) for _ in range(3)))


def in_turn(
    run: Callable[..., tuple[int, int, int]], chosen: Whole, numbers: Array, rule: Any, h: Array, marks: Whole,
    done: Many,
) -> None:  # fmt: skip
    """The chosen members one after another, by ``run(numbers, rule, h, marks, states, momenta)``.

    A kernel around the loop over members would save most of what a call takes, and takes as long to compile as a
    million members.
    """
    momenta = np.empty((2, marks.shape[1]))
    for i, plain, step in zip(chosen.tolist(), map(tuple, numbers[chosen].tolist()), h[chosen].tolist(), strict=True):
        done.steps[i], done.work[i], done.outcome[i] = run(plain, rule, step, marks[i], done.states[i], momenta)
        done.momenta[i] = momenta.T


def members_of(numbers: Array) -> Iterator[tuple[SymmetricTop, Angles]]:
    """The top and the start in each row of nine numbers."""
    for row in numbers.tolist():
        yield SymmetricTop(*row[:3]), Angles(*row[3:])


def refused(check: Requirement | None, numbers: Array) -> NDArray[np.bool_]:
    """Which members have a start that a kernel with this requirement cannot step."""
    if check is None:
        return np.zeros(len(numbers), dtype=bool)
    holds: NDArray[np.bool_] = check.holds(Start(*numbers[:, 3:].T))
    return ~holds


def groups(chosen: Whole, steps: Whole, most: int) -> list[Whole]:
    """The chosen members, in order, in groups that make about `most` steps together."""
    ends = np.cumsum(steps[chosen]) // most
    return np.split(chosen, np.flatnonzero(np.diff(ends)) + 1) if chosen.size else []


LEAST = 5  # members alone take as long as a block: 32 lanes, each at about a seventh of the time
ALIKE = 1.1  # numbers of steps within this factor of each other are alike, where the step iterates
BATCH = 128 * W  # members that are prepared at a time: 4 MB for the longest table


@dataclass(frozen=True)
class Blocks:
    """The compiled kernels of one method in lanes."""

    lanes: Lanes
    prepare: Any
    march: Any

    def run(self, members: Whole, numbers: Array, rule: Any, h: Array, marks: Whole, done: Many, most: int) -> Whole:
        """Run the chosen members as `FixedStep.many` does; return those that have to be run alone.

        `rule` holds the method's numbers before they are scaled. Control returns to Python after about `most` steps of
        members.
        """
        lanes, steps = self.lanes, marks[:, -1]
        counts_itself = lanes.effort(rule) == 0  # the step iterates
        chosen, left = divided(members, steps, turns(numbers, h) if counts_itself else None)
        widths = lanes.tops, lanes.size(rule), lanes.dimension, lanes.carry
        per_lane = lanes.flag + 2 + lanes.carry + lanes.room(rule), lanes.tops + lanes.size(rule), lanes.dimension
        room = *(aligned(n * W) for n in per_lane), np.empty(W, dtype=np.int64), np.empty(W, dtype=np.int64)
        coefficients = lanes.pack(rule)[1]
        alone = [left]
        for first in range(0, len(chosen), BATCH):
            batch = chosen[first : first + BATCH]
            prepared = tuple(np.empty((len(batch), width)) for width in widths)
            self.prepare(batch, numbers, coefficients, h, marks, prepared, done.momenta)
            at = np.array([0, -1])
            while at[0] * W < len(batch):
                heed()
                self.march(at, most, batch, prepared, h, marks, done[:4], room)
            ended = done.steps[batch] == marks[batch, -1]
            done.work[batch[ended]] += done.steps[batch[ended]] * lanes.effort(rule)
            alone.append(batch[~ended])
        return np.concatenate(alone)


def aligned(count: int) -> Array:
    """Room for so many numbers, from a multiple of 64 bytes on.

    A vector of eight that begins elsewhere lies in two lines of the cache, and is read and written twice: a step of
    strang takes 1.2 times as long.
    """
    room = np.empty(count + 7)
    first = -(room.ctypes.data // 8) % 8
    return room[first : first + count]


def turns(numbers: Array, h: Array) -> Array:
    """About how far each member, nine numbers in a row, moves in its step, in radians; not finite if it overflows."""
    I1, I3, mgl, theta, _, _, dtheta, dphi, dpsi = numbers.T
    with np.errstate(all="ignore"):
        spin = I3 / I1 * (dpsi + dphi * np.cos(theta))
        rate: Array = np.sqrt(dtheta**2 + (dphi * np.sin(theta)) ** 2 + spin**2 + np.abs(mgl) / I1)
        return np.abs(h) * rate


def divided(members: Whole, steps: Whole, turns: Array | None = None) -> tuple[Whole, Whole]:
    """The members whose steps fill blocks of `W` well, in the order in which they do, and the others.

    With `turns`, members whose steps are `ALIKE` stand in the order of these.
    """
    if not len(members):
        return members, members
    made = steps[members]
    if turns is None:
        order = np.argsort(made, kind="stable")
    else:
        order = np.lexsort((turns[members], np.floor(np.log(np.maximum(made, 1)) / np.log(ALIKE))))
    members, made = members[order], made[order]
    firsts = np.arange(0, len(members), W)
    sizes = np.diff(np.append(firsts, len(members)))
    worth = np.add.reduceat(made, firsts) >= LEAST * np.maximum.reduceat(made, firsts)
    in_lanes = np.repeat(worth, sizes)
    return members[in_lanes], members[~in_lanes]
