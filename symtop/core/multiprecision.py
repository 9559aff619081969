"""mpmath with a precision of a thread's own: `mpmath.mp` is the process's, and threads spoil its digits."""

import threading
from typing import Any

_contexts = threading.local()  # its attributes are the thread's own


def context(digits: int) -> Any:
    """An mpmath context with that many decimal digits, made once a thread."""
    mine: dict[Any, Any] = vars(_contexts)
    if digits not in mine:
        from mpmath.ctx_mp import MPContext  # mpmath costs 0.1 s to import

        made = MPContext()
        made.dps = digits
        mine[digits] = made
    return mine[digits]
