"""`dop853-compiled` against the same method as a plain loop in C: steps, evaluations, time of an evaluation.

python -m benchmarks.adaptive        (needs gcc)

Both run in one process, in turn; the C loop leaves out zero coefficients and takes no samples but the end.
"""

import argparse
import ctypes
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

import symtop
from benchmarks.twin import FAST, library, numbers
from symtop.measure.timing import timings
from symtop.methods.framework.equations import FORMULATIONS
from symtop.methods.framework.plan import Plan
from symtop.methods.runge_kutta.pair_tables import DOP853

NUTATIONS, TOLERANCES = 100.0, (1e-6, 1e-9)


class Row(NamedTuple):
    """One chart at one tolerance."""

    chart: str
    tolerance: float
    steps: tuple[int, int]  # ours, in C
    evaluations: tuple[int, int]
    nanoseconds: tuple[float, float]  # an evaluation
    difference: float  # of the two ends, relative to the largest number

    @property
    def ratio(self) -> float:
        """The time of an evaluation, ours over that in C."""
        return self.nanoseconds[0] / self.nanoseconds[1]


def in_c(chart: str, scene: symtop.Scene, tolerance: float, end: float) -> Callable[[], tuple[np.ndarray, int, int]]:
    """A run of the C loop: the final state in the variables of the equations, steps and evaluations."""
    par, start = FORMULATIONS[chart].prepare(scene.top, scene.start)
    rows = [np.pad(row, (0, 12 - len(row))) for row in (*DOP853.a, DOP853.b, DOP853.error, DOP853.third)]
    table, constants = np.concatenate(rows), np.array(numbers(par))
    integrate = library("dop853", ((chart.upper(), 1),), FAST).integrate
    pointer, real = ctypes.c_void_p, ctypes.c_double
    integrate.restype, integrate.argtypes = ctypes.c_long, [pointer, pointer, pointer, real, real, pointer]

    def run() -> tuple[np.ndarray, int, int]:
        state, work = np.array(start), ctypes.c_long()
        steps = integrate(
            constants.ctypes.data, table.ctypes.data, state.ctypes.data, tolerance, end, ctypes.byref(work)
        )
        return state, steps, work.value

    return run


def measure(
    chart: str, tolerance: float, nutations: float = NUTATIONS, batches: int = 40, name: str = "spheroid"
) -> Row:
    """Time the kernel and the C loop on one scene."""
    scene = symtop.scene(name)
    end = nutations * scene.nutation_period
    solver, plan = symtop.integrator("dop853-compiled").solvers[chart], Plan.until([end], tolerance)
    theirs = in_c(chart, scene, tolerance, end)
    run, (state, steps, work) = solver(scene.top, scene.start, plan), theirs()
    form = FORMULATIONS[chart]
    par, _ = form.prepare(scene.top, scene.start)
    shown = state if form.present is None else form.present(par, plan.times, state[None])[0]
    gap = float(np.max(np.abs(shown - run.states[-1])) / np.max(np.abs(shown)))
    kernel, loop = timings([lambda: solver(scene.top, scene.start, plan), theirs], batches=batches, batch=2e-3)
    nanoseconds = kernel.best / run.force_evaluations * 1e9, loop.best / work * 1e9
    return Row(chart, tolerance, (run.steps, steps), (run.force_evaluations, work), nanoseconds, gap)


if __name__ == "__main__":
    argparse.ArgumentParser(description=str(__doc__).partition("\n")[0]).parse_args()  # it has --help alone
    for chart in FORMULATIONS:
        for tolerance in TOLERANCES:
            row = measure(chart, tolerance)
            print(
                f"{chart:9} {tolerance:.0e}  steps {row.steps}  f {row.evaluations}  ns an f "
                f"{row.nanoseconds[0]:.2f} {row.nanoseconds[1]:.2f}  ratio {row.ratio:.2f}  end {row.difference:.0e}"
            )
