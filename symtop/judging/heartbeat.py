"""Signs of life of somebody else's code: which call it is in, seen from the process that waits for it."""

import mmap
from typing import NamedTuple

import numpy as np

from symtop.core.errors import SymtopError

CALLS, STEP, INSIDE, ALLOWED = range(4)
PATIENCE, QUICK_PATIENCE = 10.0, 3.0  # seconds for one call
FORWARD = "it makes no step backwards: a step of -h did not return"


class Beat(NamedTuple):
    """One look at a pulse."""

    calls: int  # begun so far
    step: float  # h of the last one
    inside: bool
    allowed: float  # seconds that this call may take


class Pulse:
    """Counts calls of a step, in memory that a forked process shares; costs 0.3 us a call.

    `forward_only` is set after a step backwards has not returned: such steps are refused from then on.
    """

    def __init__(self) -> None:
        self._numbers = np.frombuffer(mmap.mmap(-1, 4 * 8))
        self.forward_only, self.patience = False, PATIENCE

    def begin_judging(self, *, quick: bool) -> None:
        """Something else is judged from now on."""
        self.forward_only, self.patience = False, QUICK_PATIENCE if quick else PATIENCE

    def begin(self, h: float, seconds: float = 0.0) -> None:
        """A call that steps by h begins, and may take so many seconds beyond the usual."""
        if self.forward_only and h < 0.0:
            raise SymtopError(FORWARD)
        self._numbers[STEP] = h
        self._numbers[ALLOWED] = self.patience + seconds
        self._numbers[INSIDE] = 1.0
        self._numbers[CALLS] += 1.0

    def end(self) -> None:
        """It has returned."""
        self._numbers[INSIDE] = 0.0

    def look(self) -> Beat:
        """What the last call was, from any process."""
        calls, step, inside, allowed = self._numbers.tolist()
        return Beat(int(calls), step, bool(inside), allowed)


pulse = Pulse()  # of the judged step of this process: there is one at a time
