"""Calls that work beside the cases of studies, in a process that computes none.

A thread sees to it that they are made one after another, and only while it may: a timed phase stops it and waits for
the one call that works. When no more cases are computed, all that are left begin at once, in workers that are idle.
No call is handed over from another's callback, which an executor may run while it holds its own lock.
"""

import contextlib
import threading
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future, ProcessPoolExecutor
from typing import Any


class Beside:
    """A call in another process, which begins when it may, or when its result is asked for."""

    def __init__(self, begin: Callable[[], "Future[Any]"]) -> None:
        self._begin = begin
        self._once = threading.Lock()
        self._future: Future[Any] | None = None

    def start(self) -> "Future[Any]":
        """Begin, if it has not begun."""
        with self._once:
            if self._future is None:
                try:
                    self._future = self._begin()
                except (RuntimeError, OSError) as error:  # its process was ended before, or there is no room for one
                    self._future = Future()
                    self._future.set_exception(BrokenExecutor(str(error)))
            return self._future

    def settle(self) -> None:
        """Begin, if it has not begun, and wait until it is done."""
        with contextlib.suppress(CancelledError):
            self.start().exception()

    def begun(self) -> bool:
        """Has it begun?"""
        return self._future is not None

    def done(self) -> bool:
        """Is there nothing to wait for?"""
        return self._future is not None and self._future.done()

    def result(self) -> Any:
        """What the call returned; raises what it raised."""
        return self.start().result()


class Sideline:
    """The calls that are promised, in order, and the process that makes them, in the end with `idle` workers."""

    def __init__(self, spawned: Callable[[], ProcessPoolExecutor], idle: Callable[[], Executor]) -> None:
        self._spawned, self._idle = spawned, idle
        self._changed = threading.Condition()
        self._promised: list[Beside] = []
        self._working: Beside | None = None
        self._may = self._ended = False
        self._thread: threading.Thread | None = None
        self._opening = threading.Lock()
        self._own: ProcessPoolExecutor | None = None
        self._all_computed = False

    def promise(self, function: Callable[..., Any], *args: Any) -> Beside:
        """A call that begins when it may."""
        one = Beside(lambda: self._pool().submit(function, *args))
        with self._changed:
            self._promised = [*(other for other in self._promised if not other.done()), one]
        return one

    def open(self, first: Callable[[], Any]) -> None:
        """Start the process, which takes two seconds, with a call that nobody waits for."""
        if self._own is None:
            self.promise(first).start()

    def go_on(self) -> None:
        """Let promised calls begin, one after another."""
        with self._changed:
            self._may = True
            if self._thread is None:
                self._thread = threading.Thread(target=self._conduct, daemon=True)
                self._thread.start()
            self._working = self._working or self._next()
            one = self._working
            self._changed.notify_all()
        if one is not None:
            one.start()

    def pause(self) -> None:
        """Wait for the call that works; what has not begun does not begin."""
        with self._changed:
            self._may = False
            self._changed.wait_for(lambda: self._working is None)
            begun = [one for one in self._promised if one.begun()]
        for one in begun:
            one.settle()

    def finish(self) -> None:
        """Begin all that is promised at once: no more cases are computed."""
        with self._changed:
            self._may = False
            left = [one for one in self._promised if not one.begun()]
        with self._opening:
            self._all_computed = True
        for one in left:
            one.start()

    def close(self) -> ProcessPoolExecutor | None:
        """Promise nothing any more; returns the pool of the process, if it was opened, which the caller ends."""
        with self._changed:
            self._may, self._ended, self._promised = False, True, []
            self._changed.notify_all()
        with self._opening:
            own, self._own = self._own, None
        return own

    def _next(self) -> Beside | None:
        return next((one for one in self._promised if not one.begun()), None)

    def _conduct(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._ended or self._working is not None)
                if self._ended or self._working is None:
                    return
                one = self._working
            one.settle()
            with self._changed:
                self._working = self._next() if self._may else None
                self._changed.notify_all()

    def _pool(self) -> Executor:
        """Where the next call is made."""
        with self._opening:
            if self._all_computed:
                return self._idle()
            self._own = self._own or self._spawned()
            return self._own
