"""Kernels that are on disk are loaded and not compiled again, in every family."""

import os
import subprocess
import sys

NAMES = ("midpoint", "galerkin-simpson", "midpoint-unreduced", "stormer-verlet", "strang", "gauss-4", "rk4")
SCRIPT = f"""
import gc
import symtop
from numba.core.dispatcher import Dispatcher
for name in {NAMES!r}:
    symtop.simulate("spheroid", name, step_size=0.01, guard=False)
symtop.simulate("spheroid", "rk45-compiled", tolerance=1e-6, guard=False)
ours = [one for one in gc.get_objects() if isinstance(one, Dispatcher) and one.py_func.__module__.startswith("symtop")]
used = [one for one in ours if one.stats.cache_hits or one.stats.cache_misses or one.overloads]
print(len(used), sum(sum(one.stats.cache_misses.values()) for one in used),
      sum(not one.stats.cache_hits and not one.stats.cache_misses for one in used))
"""


def test_a_second_process_finds_the_kernels_of_every_family_on_disk(tmp_path):
    environment = {**os.environ, "SYMTOP_CACHE": str(tmp_path)}
    counts = []
    for _ in range(2):
        done = subprocess.run(
            [sys.executable, "-c", SCRIPT], env=environment, capture_output=True, text=True, check=True
        )
        counts.append([int(word) for word in done.stdout.split()])
    (_, compiled, _), (loaded, missed, without_cache) = counts
    assert compiled >= len(NAMES)  # the first process starts with an empty folder
    assert loaded >= len(NAMES)
    assert (missed, without_cache) == (0, 0)
