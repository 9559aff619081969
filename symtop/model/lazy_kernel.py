"""Functions that are interpreted at first and compiled once that is worth its while.

A process that needs a handful of numbers should neither import numba nor compile. `LazyKernel` adds up what it
interprets, and goes over to the compiled function after `LOADING` seconds if the kernel is in the cache (`IMPORTING`
more without numba, half of what that takes: who has made 400 forms makes more), or after `patience` seconds, what
compiling costs, if it is not. If its bitcode is there, the part `GENERATING` is enough: what is made of it is kept.
Results do not depend on the way: the function keeps the rules of `symtop.core.jit_functions`.
"""

import sys
import threading
from collections.abc import Callable
from typing import Any

LOADING, IMPORTING = 0.05, 0.15  # seconds: a kernel from the cache, numba
GENERATING = 0.02  # of what compiling costs
LAZY: "list[LazyKernel]" = []  # of the modules that have been imported


class LazyKernel:
    """A plain function and the types of its arguments as a kernel, in numba's words: ``"(float64, float64[::1])"``."""

    def __init__(self, function: Callable[..., Any], arguments: str, patience: float) -> None:
        self.py_func, self.arguments, self.patience = function, arguments, patience  # the name that numba has for it
        self.compiled: Any = None
        self._kernel: Any = None
        self._spent = self._look = 0.0  # seconds of interpreting, and after how many the cache is looked at again
        self._lock = threading.Lock()  # a kernel half made is not for a second thread
        LAZY.append(self)

    def ready(self, seconds: float) -> bool:
        """Is the compiled function the one to call, for work that takes `seconds` interpreted?"""
        if self.compiled is not None:
            return True
        self._spent += seconds
        if self._spent < (LOADING if "numba" in sys.modules else LOADING + IMPORTING):
            return False
        with self._lock:
            if self._spent < self._worth():
                return False
        self.compile()
        return True

    def compile(self) -> None:
        """Compile now, or load from the cache."""
        with self._lock:
            if self.compiled is None:
                self._worth()
                self._kernel.compile(self._signature)
                self.compiled = self._kernel

    def load(self) -> bool:
        """Load it if it is in the cache, or its bitcode; whether the compiled function is there now."""
        with self._lock:
            known = self.compiled is not None or self._worth() < self.patience
        if known:
            self.compile()
        return known

    def _worth(self) -> float:
        """Seconds of interpreting that are worth the compiled function, which another process may have made since."""
        from symtop.core.jit import compile_kernel, is_cached

        if self._kernel is None:
            from numba.core import sigutils  # 0.3 s

            self._kernel = compile_kernel(self.py_func)
            self._signature, _ = sigutils.normalize_signature(self.arguments)
        if self._spent >= self._look:
            self._look = 2.0 * self._spent
            on_disk = [is_cached(self._kernel, self._signature, bitcode=which) for which in (False, True)]
            self._price = 0.0 if on_disk[0] else self.patience * (GENERATING if on_disk[1] else 1.0)
        return self._price
