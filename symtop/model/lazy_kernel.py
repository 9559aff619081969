"""Functions that are interpreted at first and compiled once that is worth its while.

A process that needs a handful of numbers should neither import numba nor compile. `LazyKernel` adds up what it
interprets, and goes over to the compiled function after `LOADING` seconds if the kernel is in the cache (`IMPORTING`
more without numba), or after `patience` seconds, what compiling costs, if it is not: no process spends more than twice
what the better way would have cost it. Results do not depend on the way: the function keeps the rules of
`symtop.core.jit_functions`.
"""

import sys
import threading
from collections.abc import Callable
from typing import Any

LOADING, IMPORTING = 0.05, 0.3  # seconds: a kernel from the cache, numba
LAZY: "list[LazyKernel]" = []  # of the modules that have been imported


class LazyKernel:
    """A plain function and the types of its arguments as a kernel, in numba's words: ``"(float64, float64[::1])"``."""

    def __init__(self, function: Callable[..., Any], arguments: str, patience: float) -> None:
        self.py_func, self.arguments, self.patience = function, arguments, patience  # the name that numba has for it
        self.compiled: Any = None
        self._kernel: Any = None
        self._spent = 0.0
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
            if self._spent < self.patience and not self._is_cached():
                return False
        self.compile()
        return True

    def compile(self) -> None:
        """Compile now, or load from the cache."""
        with self._lock:
            if self.compiled is None:
                self._is_cached()
                self._kernel.compile(self._signature)
                self.compiled = self._kernel

    def load(self) -> bool:
        """Load it if it is in the cache; whether the compiled function is there now."""
        with self._lock:
            known = self.compiled is not None or self._is_cached()
        if known:
            self.compile()
        return known

    def _is_cached(self) -> bool:
        if self._kernel is None:
            from numba.core import sigutils  # 0.3 s

            from symtop.core.jit import compile_kernel, is_cached

            self._kernel = compile_kernel(self.py_func)
            self._signature, _ = sigutils.normalize_signature(self.arguments)
            self._in_cache = is_cached(self._kernel, self._signature)
        return self._in_cache
