"""Many runs of one fixed-step method: what they return, and the runs of those that have no lane.

Member i is a top and a start as nine plain numbers (`symtop.model.top.flat`), a step and the marks of its samples. It
gets the bits of a run alone, for it is one: a call of the compiled run of one (`loop.Loop.whole`). Inside, numba lets
go of Python's lock, so that threads run at the same time.
"""

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

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

    A member takes 2 us and its steps. A kernel around the loop over members would save most of that, and takes as long
    to compile as a million members.
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
