"""Puts the studies into a wheel as the package `symtop_studies`, and the code of the kernels that are used first.

Compiling those takes a minute or two, and what symtop depends on. A wheel holds them if SYMTOP_COMPILE_WITH names a
Python that has it, and serves that version of Python and of numba with them; others compile when they run, as without.
They are bitcode, from which LLVM makes machine code for the processor that it finds itself on (`symtop.core.jit`).
"""

import os
import subprocess
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

FIRST = """
import contextlib, math, os, sys
from symtop import advise
from symtop.cli.main import main
from symtop.model.lazy_kernel import LAZY
advise.TIE_RATIO = math.inf  # every recommend tries a sixth method, as it may where times are noisy
os.chdir(sys.argv[1])
for line in sys.stdin.read().splitlines():
    with contextlib.redirect_stdout(None):
        main(line.split(), standalone_mode=False)
for kernel in LAZY:
    kernel.compile()
"""
COMMANDS = """\
run spheroid rk4 --step-size 0.01
run spheroid midpoint --step-size 0.01
run spheroid strang --step-size 0.01
recommend spheroid --accuracy 1e-6 --horizon 100
recommend spheroid --accuracy 1e-3
recommend spheroid --accuracy 1e-9
recommend goldstein --accuracy 1e-3 --quantity attitude
compare goldstein stormer-verlet midpoint rk4 dop853-compiled taylor
long spheroid stormer-verlet --steps 1e5
run spheroid chin-4a[axis] --step-size 0.01
run spheroid dop853-compiled-fixed[axis] --step-size 0.01
ensemble strang --members 10000 --per-nutation 100 --nutations 10 --output runs.nc
"""


class KernelsAndStudies(BuildHookInterface):
    """Adds to the files of an ordinary wheel."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """`version` is "editable" for a development install: copies there would go out of date."""
        if version == "editable":
            return
        build_data["force_include"]["studies"] = "symtop_studies"
        if python := os.environ.get("SYMTOP_COMPILE_WITH"):
            self._made = tempfile.TemporaryDirectory()
            folder = Path(self._made.name)
            environment = os.environ | {"PYTHONPATH": self.root, "SYMTOP_CACHE": str(folder)}
            command = [python, "-c", FIRST, str(folder)]
            subprocess.run(command, input=COMMANDS, text=True, env=environment, check=True)  # noqa: S603
            for file in (folder / "kernels").rglob("*.bitcode"):
                build_data["force_include"][str(file)] = str(Path("symtop", file.relative_to(folder)))
