"""Kernels that are on disk are loaded and not compiled again, in every family."""

import errno
import os
import subprocess
import sys

import pytest

from symtop.core import jit
from symtop.core.jit import compile_kernel

EVERY = "midpoint galerkin-simpson midpoint-unreduced stormer-verlet strang gauss-4 rk4"
SCRIPT = """
import gc
import sys
import numpy as np
import symtop
from symtop.model.top import flat
from numba.core.dispatcher import Dispatcher
for name in sys.argv[1].split():
    symtop.simulate("spheroid", name, step_size=0.01, guard=False)
scene = symtop.scene("spheroid")
numbers, marks = np.tile(flat(scene.top, scene.start), (40, 1)), np.ones((40, 1), int)
if sys.argv[2:]:
    symtop.simulate("spheroid", "rk45-compiled", tolerance=1e-6, guard=False)
for name in sys.argv[2:]:
    method = symtop.integrator(name)
    method.solvers[method.charts()[0]].many(numbers, np.full(40, 0.01), marks)
ours = [one for one in gc.get_objects() if isinstance(one, Dispatcher) and one.py_func.__module__.startswith("symtop")]
used = [one for one in ours if one.stats.cache_hits or one.stats.cache_misses or one.overloads]
print(len(used), sum(sum(one.stats.cache_misses.values()) for one in used),
      sum(not one.stats.cache_hits and not one.stats.cache_misses for one in used))
"""


@pytest.mark.slow  # tests/core/test_cold.py has a short run of one method
@pytest.mark.parametrize(("names", "lanes"), [(EVERY, ["strang[axis]", "srkn-14-6[attitude]"])], ids=["every"])
def test_a_second_process_finds_the_kernels_of_every_family_on_disk(names, lanes, tmp_path):
    environment = {**os.environ, "SYMTOP_CACHE": str(tmp_path)}
    counts = []
    for _ in range(2):
        done = subprocess.run(
            [sys.executable, "-c", SCRIPT, names, *lanes], env=environment, capture_output=True, text=True, check=True
        )
        counts.append([int(word) for word in done.stdout.split()])
    (_, compiled, _), (loaded, missed, without_cache) = counts
    assert compiled >= len(names.split())  # the first process starts with an empty folder
    assert loaded >= len(names.split())
    assert (missed, without_cache) == (0, 0)


def _doubled(x):
    return x + x


def _kept_twice(monkeypatch, folder):
    """A kernel with code on disk for whole and for real numbers, and the two files."""
    monkeypatch.setenv("SYMTOP_CACHE", str(folder))
    kernel = compile_kernel(_doubled)
    assert (kernel(2), kernel(2.5)) == (4, 5.0)
    files = sorted(folder.rglob("*.code"))
    assert len(files) == 2
    return kernel, files


def test_a_file_is_named_after_the_signature_whose_code_it_holds(monkeypatch, tmp_path):
    """And after the processor, so that two processes that save at once write two files."""
    kernel, files = _kept_twice(monkeypatch, tmp_path)
    codegen = kernel.targetctx.codegen()
    assert sorted(kernel._cache.files(signature, codegen)[0] for signature in kernel.overloads) == files
    monkeypatch.setattr(codegen, "magic_tuple", lambda: ("this system", "another processor", ""))
    assert not set(files) & {kernel._cache.files(signature, codegen)[0] for signature in kernel.overloads}


@pytest.mark.parametrize("swapped", [["code"], ["bitcode"], ["code", "bitcode"]])
def test_the_code_of_another_signature_is_not_run(monkeypatch, tmp_path, swapped):
    _kept_twice(monkeypatch, tmp_path)
    for kind in swapped:
        one, other = tmp_path.rglob(f"*.{kind}")
        aside = one.read_bytes()
        one.write_bytes(other.read_bytes())
        other.write_bytes(aside)
    again = compile_kernel(_doubled)
    assert (again(2), again(2.5)) == (4, 5.0)
    assert {signature[0].name for signature in again.signatures} == {"int64", "float64"}


def test_machine_code_is_run_with_the_bitcode_that_it_was_made_of(monkeypatch, tmp_path):
    """Names in it hang on the process that compiled: with another's, a process ended."""
    kernel, files = _kept_twice(monkeypatch, tmp_path)
    old = [file.read_bytes() for file in files]
    for file in tmp_path.rglob("*.bitcode"):
        file.unlink()
    for number in range(3):  # more names of numba's
        compile_kernel(lambda x, number=number: x + number)(1)
    monkeypatch.setattr(jit, "_pruned", [])
    assert compile_kernel(_doubled)(2) == 4
    for file, code in zip(files, old, strict=True):
        file.write_bytes(code)
    again = compile_kernel(_doubled)
    assert (again(2), again(2.5)) == (4, 5.0)
    assert kernel.signatures == again.signatures


def test_a_full_disk_costs_time_and_no_run(monkeypatch, tmp_path):
    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setenv("SYMTOP_CACHE", str(tmp_path))
    with monkeypatch.context() as patch:
        patch.setattr(jit, "_write", full)
        assert compile_kernel(_doubled)(2.0) == 4.0
    assert not list(tmp_path.rglob("*.code"))
    assert compile_kernel(_doubled)(2.0) == 4.0
    assert list(tmp_path.rglob("*.code"))


def test_kernels_of_one_factory_have_names_of_their_own():
    """Machine code is found by name: two stored kernels of one name, loaded into one process, would be one."""

    def adding(number):
        def added(x):
            return x + number

        return compile_kernel(added)

    one, same, other = adding(1.0), adding(1.0), adding(2.0)
    assert (one(1.0), same(1.0), other(1.0)) == (2.0, 2.0, 3.0)
    names = [kernel.py_func.__qualname__ for kernel in (one, same, other)]
    assert names[0] == names[1] != names[2]
