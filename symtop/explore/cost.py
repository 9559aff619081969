"""Error against run time of a few methods on the scene of the page, and the runs that it shows.

A line is what `symtop.compare` measures of one variant. It takes seconds, so that a thread computes the lines one after
another while the page asks again for what is there; they are stored by scene and variant. The page asks anew when a
slider has moved: lines of a question that is no longer the newest are left.
"""

import math
import threading
from collections.abc import Mapping
from typing import Any

import numpy as np

from symtop.core.errors import SymtopError, words_of
from symtop.explore.answers import Setup, setup
from symtop.judging.comparison import BUDGET, compare
from symtop.measure.timing import bare_run, first_call
from symtop.methods.framework.registry import Integrator, integrator
from symtop.model.charts import BODY
from symtop.model.scenes import Scene
from symtop.run.simulation import chart_of

BESIDE = ("stormer-verlet", "strang", "rk4", "gauss-4", "dop853-compiled")  # whatever method is chosen
SHARE = 0.1  # of the evaluations that `compare` spends on a run
MOST_LINES = 500  # that are stored
REPEATS, LONG = 9, 0.05  # of the timing of a run; seconds of one that is not repeated

_lines: dict[tuple[Scene, str], dict[str, Any]] = {}
_newest: list[tuple[Any, ...]] = []  # the scene and the names of the variants that lines are computed for
_at_work = threading.Lock()


def question(fields: Mapping[str, Any]) -> list[Setup]:
    """The run that a page shows and, if it names a `second` method, the one beside it. SymtopError as `setup`."""
    first, other = setup(fields), str(fields.get("second") or "")
    return [first, setup({**fields, "integrator": other})] if other else [first]


def _variants(setups: list[Setup]) -> dict[str, Integrator]:
    """Those of the question first, each in the chart that the page shows, by the name of the method."""
    scene, beside = setups[0].scene, map(integrator, BESIDE)
    methods = [*(one.method for one in setups), *(one for one in beside if not scene.of_body or BODY in one.solvers)]
    return {one.name: one.variant(chart_of(one, scene.observes, "attitude")) for one in methods if one.control}


def _line(scene: Scene, variant: Integrator) -> dict[str, Any]:
    """Seconds and largest errors (rad) of the axis, or of a body's attitude, of good runs, and how many failed."""
    budget = SHARE * BUDGET[variant.implementation] * min(variant.speed, 1.0)
    try:
        quantity = "attitude" if scene.of_body else "axis"
        data = compare(scene, [variant], quantity=quantity, budget=budget, quiet=True).isel(variant=0)
    except Exception as problem:  # noqa: BLE001  (shown in the place of the line; the other lines are computed)
        words = str(problem) if isinstance(problem, SymtopError) else words_of(problem)
        return {"seconds": [], "error": [], "failed": 0, "message": words}
    seconds, error, outcome = (data[name].values for name in ("seconds", "error", "outcome"))
    good = np.isfinite(seconds) & (error > 0.0)
    return {
        "seconds": seconds[good].tolist(),
        "error": error[good].tolist(),
        "failed": int(np.sum((outcome != "ok") & (outcome != ""))),
        "message": "",
    }


def _compute(scene: Scene, variants: list[Integrator], key: tuple[Any, ...]) -> None:
    """The lines that are missing, as long as nobody asks for others."""
    with _at_work:
        for variant in variants:
            if _newest != [key]:
                return
            if (scene, variant.name) not in _lines:
                while len(_lines) >= MOST_LINES:
                    del _lines[next(iter(_lines))]
                _lines[scene, variant.name] = _line(scene, variant)
        _newest.clear()  # whoever misses a line asks again


def _seconds(one: Setup) -> float | None:
    """Run time of a run of the page, the least of some; None if it does not end well.

    Not `timings`, which has the closed form compiled and so waits for whatever else is.
    """
    chart = chart_of(one.method, one.scene.observes, "attitude")
    setting = math.nan if one.setting is None else one.setting
    run = bare_run(one.scene, one.method, chart, setting, one.scene.horizon, budget=one.budget)
    if run().outcome != "ok":
        return None
    first = first_call(run)
    return min([first, *(first_call(run) for _ in range(REPEATS if first < LONG else 0))])


def chart(setups: list[Setup]) -> dict[str, Any]:
    """The lines that are there, how many are still to come, and the seconds of the runs that the page shows."""
    scene, variants = setups[0].scene, _variants(setups)
    lines = {name: _lines.get((scene, variant.name)) for name, variant in variants.items()}
    missing, key = sum(line is None for line in lines.values()), (scene, *variants)
    if missing and _newest != [key]:
        _newest[:] = [key]
        threading.Thread(target=_compute, args=(scene, [*variants.values()], key), daemon=True).start()
    return {
        "lines": [{"name": name, **line} for name, line in lines.items() if line is not None],
        "missing": missing,
        "seconds": [_seconds(one) for one in setups],
    }
