"""Nanoseconds a step of every compiled fixed-step kernel, against its C twin and against Stormer-Verlet, in one run.

The scene is spheroid, the step 1/400 of a nutation, a call about a millisecond. All kernels and all twins are
interleaved in random order, so that ratios hold although the machine drifts. A ratio is that of the fastest batches;
its spread is that of the same ratio from each fifth of the batches alone.

A twin is timed in two builds. One has all that gcc can do; the other fuses no multiply and add, and so does the same
operations as the kernel. What fusing gains depends on the processor.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

import symtop
from benchmarks import twin
from benchmarks.pages import Table
from symtop.measure.timing import Timing, timings
from symtop.methods.framework.loop import inside
from symtop.methods.framework.registry import methods

SCENE = "spheroid"
PER_NUTATION = 400.37
CALL = 1e-3  # seconds: long against the 10 us of a call from Python, short against a time slice of a busy machine
BATCHES, BATCH = 25, 0.002
LIMIT = 1.25  # a kernel is as fast as C up to this many times the time of the same operations there
CHECKED = 2000  # steps over which both must agree
FIFTHS = 5


class Row(NamedTuple):
    """One kernel: nanoseconds a step, and its comparison with C and with Stormer-Verlet."""

    name: str
    chart: str
    nanoseconds: float
    spread: float
    in_c: float
    ratio: float
    ratio_low: float
    ratio_high: float
    unfused: float  # the ratio to C that fuses no multiply and add
    difference: float  # of the two final states where gcc fuses nothing by itself, relative
    verlet_steps: float


def ratio(ours: Timing, theirs: Timing) -> tuple[float, float, float]:
    """The ratio of two timings, and the smallest and largest that a fifth of the batches gives."""
    parts = [
        min(ours.samples[k::FIFTHS]) / min(theirs.samples[k::FIFTHS])
        for k in range(min(FIFTHS, len(ours.samples), len(theirs.samples)))
    ]
    whole = ours.best / theirs.best
    return whole, min(whole, *parts), max(whole, *parts)


def keys() -> list[tuple[str, str]]:
    """Integrator and chart of every compiled fixed-step kernel of the top; none of them is compiled for it.

    `five-rotations` runs a top with the kernel of a body without symmetry, of which there is no twin.
    """
    return [
        (method.name, chart)
        for method in methods().values()
        if method.fixed_step and method.implementation == "compiled" and method.name != "five-rotations"
        for chart in method.charts()
        if inside(method.solvers[chart]) is not None
    ]


def kernel(key: tuple[str, str]) -> twin.Kernel:
    """The kernel of an integrator in a chart, and the numbers that it runs on."""
    scene, (name, chart) = symtop.scene(SCENE), key
    return twin.kernel_of(methods()[name], chart, scene, scene.nutation_period / PER_NUTATION)


def kernels() -> dict[tuple[str, str], twin.Kernel]:
    """Every compiled fixed-step kernel, by integrator and chart."""
    return {key: kernel(key) for key in keys()}


def within(kernel: twin.Kernel, steps: int) -> int:
    """So many steps, or fewer where the run ends before: `euler` leaves its chart, a twin that fuses a little later."""
    reached = kernel.march(kernel.par, kernel.rule, kernel.state, kernel.h, np.array([steps])).steps
    return steps if reached == steps else int(0.9 * reached)


def measure() -> list[Row]:
    """Compare every kernel with the result of its C twin, then time all of them."""
    twins = {key: kernel for key, kernel in kernels().items() if kernel.march in twin.FAMILIES}
    gaps = {key: twin.difference(kernel, CHECKED) for key, kernel in twins.items()}
    calls, counts = [], []
    for kernel in twins.values():
        others = [twin.Twin(kernel, flags) for flags in (twin.FAST, twin.EXACT)]
        probe = timings([lambda first=others[0]: first(CHECKED)], batches=3, batch=BATCH)[0]
        steps = within(kernel, max(CHECKED, int(CALL / probe.best * CHECKED)))
        counts.append(steps)
        calls += [lambda kernel=kernel, n=steps: twin.ours(kernel, n), *(lambda o=o, n=steps: o(n) for o in others)]
    timed = timings(calls, batches=BATCHES, batch=BATCH)
    rows = list(zip(twins, counts, timed[::3], timed[1::3], timed[2::3], strict=True))
    verlet = next(ours.best / steps for key, steps, ours, *_ in rows if key == ("stormer-verlet", "angles"))
    return [
        Row(
            *key,
            ours.best / steps * 1e9,
            ours.spread,
            theirs.best / steps * 1e9,
            *ratio(ours, theirs),
            ours.best / unfused.best,
            gaps[key],
            ours.best / steps / verlet,
        )
        for key, steps, ours, theirs, unfused in rows
    ]


def table(rows: Sequence[Row]) -> Table:
    """Every kernel beside its twin."""
    return Table(
        "A step of every kernel",
        ["kernel", "ns a step", "in C", "of C's", "spread of the fifths", "of C's unfused", "same bits as C",
         "steps of stormer-verlet"],
        [
            [f"{row.name}[{row.chart}]", f"{row.nanoseconds:.1f}", f"{row.in_c:.1f}", f"{row.ratio:.2f}",
             f"{row.ratio_low:.2f} to {row.ratio_high:.2f}", f"{row.unfused:.2f}",
             "yes" if row.difference == 0.0 else f"{row.difference:.0e}", f"{row.verlet_steps:.2f}"]
            for row in rows
        ],
    )  # fmt: skip


def verdict(rows: Sequence[Row]) -> list[str]:
    """How many kernels are as fast as C, how many return its bits, and what an implicit step costs."""
    slow = [f"{row.name}[{row.chart}] {row.unfused:.2f}" for row in rows if row.unfused > LIMIT]
    worst = max(rows, key=lambda row: row.ratio)
    same = sum(row.difference == 0.0 for row in rows)
    sentences = [
        (
            f"{len(rows) - len(slow)} of {len(rows)} kernels are within {LIMIT:g} times a C twin that fuses no multiply"
            f" and add{'; slower are ' if slow else ''}{', '.join(slow)}."
        ),
        (
            f"Where gcc fuses, {sum(row.ratio <= LIMIT for row in rows)} are; the slowest is "
            f"{worst.name}[{worst.chart}] at {worst.ratio:.2f}."
        ),
        f"{same} of {len(rows)} twins that fuse nothing return the same bits after {CHECKED} steps.",
    ]
    for name in ("midpoint", "trapezoidal"):
        sentences += [
            f"A step of {name}, solved to rounding, takes as long as {row.verlet_steps:.2f} steps of stormer-verlet."
            for row in rows
            if row.name == name
        ]
    return sentences
