"""The C twin of every compiled fixed-step kernel: built with gcc, fed the same numbers, run the same number of steps.

A twin is one C file for each kernel family (`twins/*.c`), compiled for each length of a table, because numba compiles
for that length too. It gets what the Python kernel gets: the numbers of the top, the table, the start and the step.
Built so that gcc fuses no multiply and add by itself it returns the same bits, which is how we know that it is a twin;
timed it has all that gcc can do with ``-O3 -march=native``.
"""

import ctypes
import functools
import hashlib
import math
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from symtop.methods.framework.loop import Loop, inside
from symtop.methods.framework.registry import Integrator, integrator
from symtop.methods.lagrangian import discrete_lagrangian, exact_discrete, galerkin, galerkin_gauss, unreduced
from symtop.methods.lie_group import energy_momentum, generalised_alpha, runge_kutta, variational
from symtop.methods.runge_kutta import collective_gauss, explicit, gauss, kahan, pairs
from symtop.methods.splitting import angles, space
from symtop.methods.taylor import series, series_general
from symtop.methods.taylor.series import DEFAULT_ORDER
from symtop.model.charts import CHARTS
from symtop.model.scenes import Scene

SOURCES = Path(__file__).resolve().parent / "twins"
BUILD = Path(__file__).resolve().parent / "build"
FAST = ("-O3", "-march=native")
EXACT = (*FAST, "-ffp-contract=off")  # gcc fuses nothing by itself: rounds like the Python kernel


class Kernel(NamedTuple):
    """The arguments that a solver passes to its compiled loop for one run."""

    march: Loop
    par: Any
    rule: Any
    state: tuple[float, ...]
    h: float


def kernel_of(method: Integrator, chart: str, scene: Scene, h: float) -> Kernel:
    """The loop behind a solver and the numbers it would run on; ValueError if it is no fixed-step loop of ours."""
    solver = inside(method.solvers[chart])
    if solver is None:
        raise ValueError(f"{method.name}[{chart}] is no compiled loop")
    return Kernel(solver.loop, *solver.setup(scene.top, scene.start, h), h)


def _macros(rule: Any, chart: str = "") -> dict[str, int]:
    """What numba also knows at compile time, as C macros: the lengths of the table, and the chart."""
    lengths = {
        "drift": "DRIFTS",
        "nodes": "NODES",
        "a": "STAGES",
        "shares": "SHARES",
        "weights": "WEIGHTS",
        "reach": "NODES",
    }
    lengths |= {"counts": "STAGES"} if hasattr(rule, "counts") else {"mu": "STAGES"}
    rows = {"a": "b"}  # a tableau is as long as its weights
    macros = {macro: len(getattr(rule, rows.get(row, row))) for row, macro in lengths.items() if hasattr(rule, row)}
    return macros | ({chart: 1} if chart else {})


PROJECTED = "dop853-projected", "vern9-projected"
# the loop of a family: its C file, and the macro for its chart
FAMILIES: dict[Loop, tuple[str, str]] = {
    discrete_lagrangian.march: ("discrete_lagrangian", ""),
    unreduced.march: ("unreduced", ""),
    galerkin.march: ("galerkin", ""),
    **{galerkin_gauss.loop(s): ("galerkin_gauss", "") for s in galerkin_gauss.NODES},
    angles.march: ("splitting_angles", ""),
    space.march_axis: ("splitting_space", ""),
    space.march_attitude: ("splitting_space", "ATTITUDE"),
    **{explicit.LOOPS[chart]: ("runge_kutta", chart.upper()) for chart in CHARTS},
    **{pairs.fixed_loop(chart, pair): ("runge_kutta", chart.upper()) for pair in pairs.PAIRS for chart in CHARTS},
    **{inside(integrator(name).solvers["axis"]).loop: ("runge_kutta", "PROJECTED") for name in PROJECTED},
    exact_discrete.march_axis: ("exact_discrete", ""),
    exact_discrete.march_attitude: ("exact_discrete", ""),
    series.march_axis(DEFAULT_ORDER): ("series", ""),
    series.march_attitude(DEFAULT_ORDER): ("series", "ATTITUDE"),
    **{series_general.loop(chart): ("series_general", chart.upper()) for chart in ("axis", "attitude")},
    gauss.march_axis: ("gauss", "AXIS"),
    gauss.march_frame: ("gauss", "FRAME"),
    kahan.march_axis: ("kahan", ""),
    kahan.march_frame: ("kahan", "FRAME"),
    runge_kutta.march: ("lie_group", "RUNGE_KUTTA"),
    **dict.fromkeys(variational.MARCH.values(), ("lie_group", "VARIATIONAL")),
    energy_momentum.march: ("lie_group", "ENERGY_MOMENTUM"),
    generalised_alpha.march: ("lie_group", "ALPHA"),
    collective_gauss.march: ("lie_group", "COLLECTIVE"),
}


def compiler() -> str | None:
    """The path of gcc, if there is one."""
    return shutil.which("gcc")


@functools.lru_cache(maxsize=256)
def library(name: str, macros: tuple[tuple[str, int], ...], flags: Sequence[str]) -> ctypes.CDLL:
    """A compiled twin, from `benchmarks/build` if its sources have not changed."""
    options = [*flags, *(f"-D{macro}={value}" for macro, value in macros)]
    digest = hashlib.sha256(" ".join(options).encode())
    for path in sorted(SOURCES.iterdir()):
        digest.update(path.read_bytes())
    target = BUILD / f"{name}-{digest.hexdigest()[:16]}.so"
    if not target.is_file():
        BUILD.mkdir(exist_ok=True)
        partial = target.with_suffix(".part")
        command = ["gcc", "-std=gnu11", "-Wall", "-Wextra", "-Werror", *options, "-shared", "-fPIC"]
        subprocess.run([*command, "-o", str(partial), str(SOURCES / f"{name}.c"), "-lm"], check=True)
        partial.replace(target)
    return ctypes.CDLL(str(target))


def numbers(record: Any) -> list[float]:
    """A record of numbers and tuples as the flat row of doubles that the C structs are."""
    if isinstance(record, gauss.GaussRule):
        stages, longest = len(record.b), max(gauss.STAGES)
        square = [(0, longest - stages), (0, longest - stages)]
        padded = (np.pad(record.mu, square), np.pad(record.b, square[:1]), np.pad(record.predict, square))
        return [float(stages), *(float(value) for part in padded for value in part.ravel())]
    if isinstance(record, np.ndarray):
        return [float(value) for value in record.ravel()]
    nested = (tuple, np.ndarray)
    return [value for part in record for value in (numbers(part) if isinstance(part, nested) else [float(part)])]


class Twin:
    """The C twin of one kernel on one scene."""

    def __init__(self, kernel: Kernel, flags: Sequence[str] = FAST) -> None:
        name, chart = FAMILIES[kernel.march]
        self.kernel = kernel
        self._march = library(name, tuple(_macros(kernel.rule, chart).items()), tuple(flags)).march
        self._march.restype = ctypes.c_long
        pointer = ctypes.c_void_p
        self._march.argtypes = [pointer, pointer, pointer, ctypes.c_double, ctypes.c_long, pointer]
        rule = kernel.rule if kernel.march is not collective_gauss.march else (*kernel.rule[:2], kernel.rule.shares)
        self._par, self._rule = np.array(numbers(kernel.par)), np.array(numbers(rule))
        self._start = np.array(kernel.march.enter(kernel.par, kernel.rule, kernel.state, kernel.h))

    def __call__(self, steps: int) -> tuple[np.ndarray, int]:
        """The state after `steps` steps, in the kernel's own variables, and the work."""
        state, work = self._start.copy(), ctypes.c_long()
        reached = self._march(
            self._par.ctypes.data, self._rule.ctypes.data, state.ctypes.data, self.kernel.h, steps, ctypes.byref(work)
        )
        if reached != steps:
            raise RuntimeError(f"the C twin stopped after {reached} of {steps} steps")
        return state, work.value

    def shown(self, steps: int) -> tuple[np.ndarray, int]:
        """The state after `steps` steps, in the variables that a run returns, and the work."""
        (state, work), kernel = self(steps), self.kernel
        return np.array(kernel.march.present(kernel.par, kernel.rule, tuple(state.tolist()), steps, kernel.h)), work


def ours(kernel: Kernel, steps: int) -> tuple[np.ndarray, int]:
    """The state and the work after `steps` steps of the Python kernel."""
    run = kernel.march(kernel.par, kernel.rule, kernel.state, kernel.h, np.array([steps]))
    return run.states[-1], run.work


def difference(kernel: Kernel, steps: int, flags: Sequence[str] = EXACT) -> float:
    """Largest difference of the two states after `steps` steps, relative to their largest number.

    Infinite if the twin is to have the same bits and took another number of iterations.
    """
    mine, my_work = ours(kernel, steps)
    theirs, their_work = Twin(kernel, flags).shown(steps)
    if my_work != their_work and flags == EXACT:
        return math.inf
    return float(np.max(np.abs(mine - theirs)) / np.max(np.abs(mine)))
