"""``symtop doctor --warm``: compile every kernel now, so that no first run waits for the compiler later.

A kernel is compiled when a run needs it that the cache does not hold, 0.3 to 8 s each. Here every method is run for two
steps in each of its charts, alone and in an ensemble of two tops, beside the truth and its errors; the runs are shared
out to a process a core.
"""

import concurrent.futures
from collections.abc import Callable
from typing import Any

from tqdm import tqdm

from symtop.core.errors import words_of
from symtop.core.files import cache_root
from symtop.core.parallel import context, cores
from symtop.core.progress import beating

SCENE = "goldstein"
PERIODS = 0.02  # of a nutation: the length of a run


def _truth(_: str) -> None:
    from symtop.core.lazy_kernel import LAZY
    from symtop.model.scenes import scene
    from symtop.run.reference.truth import reference
    from symtop.run.simulation import simulate

    for kernel in LAZY:
        kernel.compile()
    period = scene(SCENE).nutation_period
    run = simulate(SCENE, "strang", step_size=period / 100.0, horizon=period, samples=3)
    reference(SCENE, run["time"].values)


def _alone(name: str) -> None:
    from symtop.run.simulation import simulate

    simulate(SCENE, name, **_asked(name))


def _together(name: str) -> None:
    from symtop.run.ensemble.ensemble import ensemble

    ensemble([SCENE] * 2, name, **_asked(name), threads=1, quiet=True)


def _asked(name: str) -> dict[str, Any]:
    """Two steps of a row, or so, in its chart."""
    from symtop.methods.framework.registry import integrator
    from symtop.model.scenes import scene

    row, span = integrator(name), PERIODS * scene(SCENE).nutation_period
    (chart,) = row.charts()
    setting = row.setting(span / 2 if row.fixed_step else max(1e-6, row.least_tolerance))
    observe = "attitude" if chart == "angles" else chart
    return {**setting.kwargs(), "horizon": span, "samples": 2, "observe": observe}


_RUNS: dict[str, Callable[[str], None]] = {"truth": _truth, "alone": _alone, "together": _together}


def _run(task: tuple[str, str]) -> str:
    """Do one of the runs; returns why it could not be done, or nothing."""
    kind, name = task
    try:
        _RUNS[kind](name)
    except Exception as error:  # noqa: BLE001  (one that fails must not keep the others from being compiled)
        return f"{name or kind}: {words_of(error)}"
    return ""


def tasks() -> list[tuple[str, str]]:
    """Every run that compiles something: what it is, and the row ``method[chart]``."""
    from symtop.methods.framework.registry import integrators

    compiled = [method for method in integrators().values() if method.implementation in {"compiled", "heyoka"}]
    names = [f"{method.name}[{chart}]" for method in compiled for chart in method.charts()]
    return [("truth", ""), *(("alone", name) for name in names), *(("together", name) for name in names)]


def kernels() -> int:
    """How many kernels are kept on disk."""
    return sum(1 for _ in (cache_root() / "kernels").glob("*"))


def warm(jobs: int | None = None) -> tuple[int, list[str]]:
    """Compile what is not on disk; returns how many kernels came to the cache, and which runs could not be done."""
    before, todo = kernels(), tasks()
    with concurrent.futures.ProcessPoolExecutor(jobs or cores(), context()) as pool:
        done = pool.map(_run, todo)
        with beating(tqdm(desc="compiling", total=len(todo), unit="run", disable=None, leave=False)) as bar:
            failed = []
            for why in done:
                failed += [why] if why else []
                bar.update()
    return kernels() - before, failed
