"""Sine and cosine of the angles kernels against those of the C library, alone and in a loop over many tops.

    python -m benchmarks.sines

A step of Stormer-Verlet on (theta, p_theta), twice: in a loop over steps, which waits for every result, and with a loop
over `LANES` tops inside it, which LLVM vectorises if nothing in it is called. All four are interleaved in one process.
"""

import argparse
from collections.abc import Callable
from typing import Any

import numpy as np
from numba import njit

import symtop
from symtop.core.jit import OPTIONS, register_jitable
from symtop.core.sines import sincos
from symtop.measure.timing import Timing, timings
from symtop.model.top import half_angle_force

LANES = 32
PER_NUTATION = 400.37
STEPS = 20_000


@register_jitable
def library(x: float) -> Any:
    """Sine and cosine by two calls."""
    return np.sin(x), np.cos(x)


def stepping(both: Callable[..., Any], lanes: int) -> Callable[..., Any]:
    """Kick-drift-kick of so many tops: `M` holds theta, p_theta and V', and `T` I1, mgl, north, south and the step."""

    def run(M: Any, T: Any, steps: int) -> None:
        for _ in range(steps):
            for j in range(lanes):
                I1, mgl, north, south, h = T[j], T[lanes + j], T[2 * lanes + j], T[3 * lanes + j], T[4 * lanes + j]
                p = M[lanes + j] - 0.5 * h * M[2 * lanes + j]
                theta = M[j] + h * p / I1
                s, c = both(0.5 * theta)
                slope = half_angle_force(s, c, north, south, I1, mgl)[0]
                M[j], M[lanes + j], M[2 * lanes + j] = theta, p - 0.5 * h * slope, slope

    return njit(**OPTIONS)(run)  # type: ignore[no-any-return]


def numbers(lanes: int) -> tuple[np.ndarray, np.ndarray]:
    """States and parameters of so many neighbours of the notebook's top."""
    scene = symtop.scene("spheroid")
    top, start, momenta = scene.top, scene.start, scene.top.momenta(scene.start)
    theta = start.theta + 0.001 * np.arange(lanes)
    state = (theta, np.full(lanes, top.I1 * start.theta_dot), np.zeros(lanes))
    body = (top.I1, top.mgl, momenta.north, momenta.south, scene.nutation_period / PER_NUTATION)
    return np.concatenate(state), np.repeat(body, lanes)


def measure() -> dict[str, Timing]:
    """Time of a call of `STEPS` steps of one top."""
    calls = {}
    for name, both in (("polynomials", sincos), ("C library", library)):
        for lanes in (1, LANES):
            run, (state, body), steps = stepping(both, lanes), numbers(lanes), STEPS // lanes
            calls[f"{name}, {lanes} tops"] = lambda run=run, m=state, t=body, n=steps: run(m, t, n)
    return dict(zip(calls, timings(list(calls.values()), batches=40, batch=2e-3), strict=True))


def main() -> None:
    """Print nanoseconds a step and top."""
    for name, timing in measure().items():
        print(f"{name:<22}{timing.best / STEPS * 1e9:8.2f} ns")


if __name__ == "__main__":
    argparse.ArgumentParser(description=str(__doc__).partition("\n")[0]).parse_args()  # it has --help alone
    main()
