"""Python says once that it compiles, to a terminal or a notebook and to nobody else."""

import functools
import gc
import importlib
import os
import pkgutil
import pty
import subprocess
import sys
import time

import numpy as np
import pytest
from numba import types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompileResult
from numba.core.dispatcher import Dispatcher
from numba.core.errors import TypingError

import studies
import symtop
from symtop.core import jit
from symtop.core.jit import compile_kernel
from symtop.methods.framework import loop
from symtop.methods.framework.loop import Loop
from tests.commands import ROOT

UNIQUE = time.time()  # a constant that no kernel on disk was compiled with
SCRIPT = """
import sys
{before}
sys.path.insert(0, {folder!r})
import two_kernels
from symtop.core import jit
from symtop.core.jit import compile_kernel
for _ in range(2):
    compile_kernel(two_kernels.first)(1.0), compile_kernel(two_kernels.second)(1.0)
"""
KERNELS = """
def first(x):
    return x + 1.0


def second(x):
    return x + 2.0
"""


def _stderr_of(tmp_path, before="", terminal=False):
    """What a script that runs two methods twice prints to its standard error."""
    (tmp_path / "two_kernels.py").write_text(KERNELS, encoding="utf-8")
    environment = {**os.environ, "SYMTOP_CACHE": str(tmp_path), "PYTHONPATH": str(ROOT)}
    ours, theirs = pty.openpty() if terminal else os.pipe()
    command = [sys.executable, "-c", SCRIPT.format(before=before, folder=str(tmp_path))]
    subprocess.run(command, env=environment, stderr=theirs, check=True)
    os.close(theirs)
    with os.fdopen(ours, "rb") as stream:
        return (os.read(stream.fileno(), 4096) if terminal else stream.read()).decode()


@pytest.mark.parametrize("watched", [{"terminal": True}, {"before": "sys.modules['ipykernel'] = sys"}])
def test_compiling_is_said_once_to_whoever_watches(tmp_path, watched):
    assert _stderr_of(tmp_path, **watched).count("symtop: compiling") == 1


def test_nothing_is_said_of_kernels_that_are_on_disk(tmp_path):
    assert "symtop: compiling" not in _stderr_of(tmp_path)  # nor of the others where nobody watches
    assert _stderr_of(tmp_path, before="sys.modules['ipykernel'] = sys") == ""


def _kernels():
    """Kernels of all modules of the package and of its studies, by name."""
    for package in (symtop, studies):
        for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            if module.name.endswith("__main__"):
                continue
            for name, value in vars(importlib.import_module(module.name)).items():
                parts = [value.prepare, value.march] if isinstance(value, Loop) else [value]
                yield from ((f"{module.name}.{name}", part) for part in parts if isinstance(part, Dispatcher))


def test_every_kernel_is_kept_on_disk():
    kernels, names = list(_kernels()), ("runge_kutta.collective_gauss", "lagrangian.damped_top")
    assert {f"symtop.methods.{name}.march" for name in names} <= {name for name, _ in kernels}
    assert {name for name, kernel in kernels if not isinstance(kernel._cache, jit._Cache)} == set()
    namespace = {"__name__": "prompt"}
    exec("def typed(x): return x", namespace)  # the control: a function without a file
    assert not isinstance(compile_kernel(namespace["typed"])._cache, jit._Cache)


def test_a_loop_makes_a_kernel_when_it_is_used(monkeypatch):
    """Loading a hundred methods would hash all their kernels otherwise, in every process."""
    compiled = []
    monkeypatch.setattr(loop, "compile_kernel", lambda part: compiled.append(part) or part)
    family = loop.Loop(loop.no_carry, loop.no_carry, loop.no_carry)
    assert not compiled
    assert family.march is family.march is compiled[0]
    assert len(compiled) == 1


def test_garbage_is_collected_and_calls_of_llvm_noted_again_after_a_kernel_is_compiled_or_refused():
    def kernel(x):
        return x + UNIQUE

    def refused(x):
        return x.no_such_thing

    state = lambda: (gc.isenabled(), len(jit.ffi.lib._lock._cblist))
    before, during, compiled = state(), [], compile_kernel(kernel)
    jit._compile_once(compiled, lambda _: during.append(state()))((types.float64,))
    assert (before, during) == ((True, 1), [(False, 0)])
    assert state() == before
    with pytest.raises(TypingError):
        compile_kernel(refused)(1.0)
    assert state() == before


def test_numba_without_its_compiler_is_refused(monkeypatch):
    monkeypatch.setattr(jit.numba.config, "DISABLE_JIT", 1)
    with pytest.raises(symtop.SymtopError, match="NUMBA_DISABLE_JIT must be 0 or unset, not 1"):
        compile_kernel(lambda x: x)


PRIVATE = {  # of numba's, without which it compiles as it does
    **dict.fromkeys(("_final_module", "_finalize_dynamic_globals", "_verify_declare_only_symbols"), jit._Library),
    "_find_referenced_environments": CompileResult,
}


@pytest.mark.parametrize("way", ["lean", "numba alone", *PRIVATE])
def test_inner_functions_get_no_machine_code_and_kernels_the_same_bits(monkeypatch, way):
    def tenth(x):
        if x > 1e6:
            raise ValueError("too large")
        return 0.1 * x * UNIQUE

    def kernel(rows):
        total = 0.1
        for k in range(len(rows)):
            total += tenth(rows[k])
        return total + np.sum(rows)

    rows, generated, generate = np.linspace(0.0, 3.0, 17), [], JITCodeLibrary._finalize_specific
    final, optimise = [], JITCodeLibrary._optimize_final_module
    expected = sum((tenth(x) for x in rows.tolist()), 0.1) + rows.sum()
    jit.register_jitable(tenth, jit.OPTIONS | jit.KERNEL_ONLY)
    monkeypatch.setattr(JITCodeLibrary, "_finalize_specific", lambda lib: (generated.append(lib.name), generate(lib)))
    monkeypatch.setattr(JITCodeLibrary, "_optimize_final_module", lambda lib: (final.append(lib.name), optimise(lib)))
    kernel.__code__ = kernel.__code__.replace(co_filename=f"<{way}>")  # no file, and so no cache on disk
    compiled = compile_kernel(kernel)
    if way in PRIVATE:
        monkeypatch.setattr(PRIVATE[way], way, property(), raising=False)
        monkeypatch.setattr(jit, "lean_probe", functools.cache(jit.lean_probe.__wrapped__))
    if way == "numba alone":
        monkeypatch.setattr(compiled, "compile", compiled.compile.__wrapped__)
    assert compiled(rows) == pytest.approx(expected, rel=1e-15)
    for names in (generated, final):  # optimised with the kernel alone
        assert sum(name.endswith(".tenth") for name in names) == (0 if way == "lean" else 1)
    with pytest.raises(ValueError, match="too large"):
        compiled(1e7 * rows)
