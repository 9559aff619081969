"""Functions that are interpreted at first, and compiled when interpreting has taken as long as compiling would.

A process that needs few numbers should neither import numba nor compile. `LazyKernel` adds up the seconds of
interpreting. It changes to the compiled function after `LOADING` seconds if the kernel is in the cache (`IMPORTING`
more if numba is not imported, half of the time of the import), or after `patience` seconds, at most those of compiling,
if it is not. If the cache holds its bitcode only, `GENERATING` times `patience` is enough; the machine code is stored.
Results are the same either way, as the function keeps the rules of `symtop.core.jit_functions`.
"""

import sys
import threading
from collections.abc import Callable
from typing import Any

LOADING, IMPORTING = 0.05, 0.15  # seconds of interpreting before a kernel is loaded, and more before numba is imported
GENERATING = 0.02  # time of machine code from bitcode, as a part of that of compiling
LAZY: "list[LazyKernel]" = []  # all instances, of the modules that have been imported


class LazyKernel:
    """A plain function and the types of its arguments as a kernel, in numba's words: ``"(float64, float64[::1])"``."""

    def __init__(self, function: Callable[..., Any], arguments: str, patience: float) -> None:
        self.py_func, self.arguments, self.patience = function, arguments, patience  # `py_func` as in numba
        self.compiled: Any = None
        self._kernel: Any = None
        self._spent = self._look = 0.0  # seconds of interpreting, and after how many the cache is looked at again
        self._lock = threading.Lock()  # no second thread may use a kernel before it is complete
        LAZY.append(self)

    def ready(self, seconds: float) -> bool:
        """Call the compiled function for work that takes `seconds` interpreted? Adds them up; may compile."""
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
        """Load the kernel if it or its bitcode is in the cache; returns whether the compiled function is loaded."""
        with self._lock:
            cached = self.compiled is not None or self._worth() < self.patience
        if cached:
            self.compile()
        return cached

    def _worth(self) -> float:
        """Seconds of interpreting after which to compile or load; another process may have compiled in the meantime."""
        from symtop.core.jit import compile_kernel, is_cached

        if self._kernel is None:
            from numba.core import sigutils  # 0.3 s

            self._kernel = compile_kernel(self.py_func)
            self._signature, _ = sigutils.normalize_signature(self.arguments)
        if self._spent >= self._look:
            self._look = 2.0 * self._spent
            on_disk = [is_cached(self._kernel, self._signature, bitcode=bitcode) for bitcode in (False, True)]
            self._price = 0.0 if on_disk[0] else self.patience * (GENERATING if on_disk[1] else 1.0)
        return self._price
