"""Signs of life of somebody else's code: which call it is in, seen from the process that waits for it."""

import mmap
from types import TracebackType
from typing import NamedTuple

import numpy as np

from symtop.core.errors import SymtopError, words_of

CALLS, STEP, INSIDE, ALLOWED = range(4)
PATIENCE, QUICK_PATIENCE = 10.0, 3.0  # seconds for one call


class Beat(NamedTuple):
    """One look at a heartbeat."""

    calls: int  # begun so far
    step: float  # h of the last one
    inside: bool
    allowed: float  # seconds that this call may take


class Heartbeat:
    """Counts calls of a step, in memory that a forked process shares: ``with heartbeat.call(h): step(...)``.

    What the call raises becomes a SymtopError. `forward_only` is set after a step backwards has not returned: such
    steps are refused from then on.
    """

    def __init__(self) -> None:
        self._numbers = np.frombuffer(mmap.mmap(-1, 4 * 8))
        self.forward_only, self.patience = False, PATIENCE

    def reset(self, *, quick: bool) -> None:
        """Something else is judged from now on."""
        self.forward_only, self.patience = False, QUICK_PATIENCE if quick else PATIENCE

    def call(self, h: float, seconds: float = 0.0) -> "Heartbeat":
        """The context of a call that steps by h, which may take so many seconds beyond the usual."""
        if self.forward_only and h < 0.0:
            raise SymtopError("it makes no step backwards: a step of -h did not return")
        self._numbers[STEP] = h
        self._numbers[ALLOWED] = self.patience + seconds
        return self

    def __enter__(self) -> None:
        self._numbers[INSIDE] = 1.0
        self._numbers[CALLS] += 1.0

    def end(self) -> None:
        """No call is under way."""
        self._numbers[INSIDE] = 0.0

    def __exit__(
        self, _kind: type[BaseException] | None, error: BaseException | None, _trace: TracebackType | None
    ) -> None:
        self.end()
        if isinstance(error, Exception) and not isinstance(error, SymtopError):
            raise SymtopError(f"a step of h = {self._numbers[STEP]:.3g} raises {words_of(error)}") from error

    def look(self) -> Beat:
        """What the last call was, from any process."""
        calls, step, inside, allowed = self._numbers.tolist()
        return Beat(int(calls), step, bool(inside), allowed)


heartbeat = Heartbeat()  # of the judged step of this process: there is one at a time
