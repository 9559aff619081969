"""Nanoseconds a step of every fixed-step kernel, against C twins and against Stormer-Verlet, in one run.

    make bench        (needs gcc; the twins are built into benchmarks/build)

All kernels are interleaved in random order, so that ratios hold although the machine drifts. The scene is spheroid,
the step 1/400 of a nutation; `--json FILE` keeps the samples.
"""

import argparse
import ctypes
import json
import subprocess
from pathlib import Path

import numpy as np

import symtop
from symtop.integrators.angles import reduced
from symtop.integrators.registry import Plan
from symtop.measure.timing import timings

HERE = Path(__file__).resolve().parent


def build() -> ctypes.CDLL:
    """Compile the C twins for this processor."""
    library = HERE / "build" / "twins.so"
    library.parent.mkdir(exist_ok=True)
    flags = ["-O3", "-march=native", "-shared", "-fPIC"]
    subprocess.run(["gcc", *flags, "-o", str(library), str(HERE / "twins.c"), "-lm"], check=True)
    return ctypes.CDLL(str(library))


def twin(library: ctypes.CDLL, name: str, scene: symtop.Scene, h: float, steps: int):
    """A call of a C twin that does `steps` steps, and the state it ends in."""
    par, state = reduced(scene.top, scene.start)
    numbers = (ctypes.c_double * len(par))(*par)
    function = library[name.replace("-", "_")]
    function.restype = ctypes.c_long
    function.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_double, ctypes.c_long]

    def call() -> np.ndarray:
        box = (ctypes.c_double * len(state))(*state)
        done = function(numbers, box, h, steps)
        assert done == steps
        return np.array(box)

    return call


def main() -> None:
    """Time everything and print the table."""
    parser = argparse.ArgumentParser(description="Nanoseconds a step of every fixed-step kernel")
    parser.add_argument("--steps", type=int, default=200_000)
    parser.add_argument("--per-nutation", type=float, default=400.37)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    scene = symtop.scene("spheroid")
    steps, h = options.steps, scene.nutation_period / options.per_nutation
    plan = Plan(np.array([steps * h]), steps * h, h, np.array([steps]), np.nan)
    library = build()
    twins = ["stormer-verlet"]
    names, calls = [], []
    for method in symtop.integrators().values():
        if method.knob == "step_size" and method.tier == "compiled":
            for chart, solve in method.solvers.items():
                names.append(f"{method.name} [{chart}]")
                calls.append(lambda solve=solve: solve(scene.top, scene.start, plan))
    for name in twins:
        call = twin(library, name, scene, h, steps)
        ours = symtop.integrator(name).solvers["angles"](scene.top, scene.start, plan).states[-1]
        gap = float(np.max(np.abs(call() - ours)))
        assert gap < 1e-8, f"the C twin of {name} computes something else: {gap}"
        names.append(f"{name} [C]")
        calls.append(call)
    found = dict(zip(names, timings(calls, batches=7), strict=True))
    base = found["stormer-verlet [angles]"].best
    print(f"{'kernel':<42}{'ns/step':>9}{'spread':>8}{'/ Verlet':>10}{'/ C':>7}")
    for name, timing in found.items():
        other = found.get(name.replace(" [angles]", " [C]")) if "[angles]" in name else None
        ratio = f"{timing.best / other.best:7.2f}" if other else ""
        print(f"{name:<42}{timing.best / steps * 1e9:9.1f}{timing.spread:8.0%}{timing.best / base:10.2f}{ratio}")
    if options.json:
        options.json.write_text(json.dumps({name: timing._asdict() for name, timing in found.items()}, indent=1))


if __name__ == "__main__":
    main()
