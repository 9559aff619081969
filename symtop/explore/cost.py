"""Error against run time of a few methods on the scene of the page, and the runs that it shows.

The runs of a line are those of `symtop.compare`, and all runs of a chart are timed against each other. It takes
seconds, so that a thread does it while the page asks again. Runs are stored by scene and variant, the last chart by
scene. The page asks anew when a slider has moved: a chart that is no longer the newest is left.
"""

import functools
import math
import threading
from collections.abc import Mapping
from typing import Any

from symtop.core.errors import SymtopError, words_of
from symtop.explore.answers import Setup, setup
from symtop.judging.comparison import BUDGET, compare
from symtop.measure.sweep import timed_rows
from symtop.measure.timing import bare_run, first_call
from symtop.methods.framework.registry import Integrator, integrator
from symtop.model.charts import BODY
from symtop.model.scenes import Scene
from symtop.run.simulation import chart_of

BESIDE = ("stormer-verlet", "strang", "rk4", "gauss-4", "dop853-compiled")  # whatever method is chosen
SHARE = 0.1  # of the evaluations that `compare` spends on a run
MOST_LINES, MOST_CHARTS = 500, 100  # that are stored
REPEATS, LONG = 9, 0.05  # of the timing of a run; seconds of one that is not repeated

_charts: dict[Scene, dict[str, dict[str, Any]]] = {}  # the lines by the names of their methods
_newest: list[tuple[Any, ...]] = []  # scene and methods of the chart that is computed
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


@functools.lru_cache(MOST_LINES)
def _runs(scene: Scene, name: str) -> list[tuple[float, str, float]]:
    """Setting, outcome and largest error (rad), of the axis or of a body's attitude, of each run of a line."""
    variant, quantity = integrator(name), "attitude" if scene.of_body else "axis"
    budget = SHARE * BUDGET[variant.implementation] * min(variant.speed, 1.0)
    data = compare(scene, [variant], quantity=quantity, cost="evaluations", budget=budget, quiet=True).isel(variant=0)
    values = (data[one].values.tolist() for one in (str(variant.control), "outcome", "error"))
    return [run for run in zip(*values, strict=True) if run[1] != "not_run"]


def _compute(scene: Scene, variants: dict[str, Integrator], key: tuple[Any, ...]) -> None:
    """The lines of a chart, unless somebody asks for another meanwhile."""
    rows: dict[str, list[dict[str, Any]]] = {}
    messages: dict[str, str] = {}
    with _at_work:
        for name, variant in variants.items():
            if _newest != [key]:
                return
            try:
                runs = _runs(scene, variant.name)
            except Exception as problem:  # noqa: BLE001  (shown in the place of the line; the others are computed)
                runs, messages[name] = [], str(problem) if isinstance(problem, SymtopError) else words_of(problem)
            rows[name] = [dict(zip(("setting_value", "outcome", "error"), run, strict=True)) for run in runs]
        try:
            timed_rows([(scene, variants[name], scene.horizon, own) for name, own in rows.items()])
        except Exception as problem:  # noqa: BLE001  (as above)
            rows, messages = {name: [] for name in rows}, dict.fromkeys(rows, str(problem))
        while len(_charts) >= MOST_CHARTS:
            del _charts[next(iter(_charts))]
        _charts[scene] = {name: _line(name, own, messages.get(name, "")) for name, own in rows.items()}
        _newest.clear()


def _line(name: str, rows: list[dict[str, Any]], message: str) -> dict[str, Any]:
    """Seconds and errors of the good runs of a method, and how many failed."""
    good = [one for one in rows if one["outcome"] == "ok" and one["error"] > 0.0]
    failed = sum(one["outcome"] != "ok" for one in rows)
    numbers = {name: [one[name] for one in good] for name in ("seconds", "error")}
    return {"name": name, **numbers, "failed": failed, "message": message}


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
    """The lines that are there, how many are still to come, and the seconds of the runs that the page shows.

    While a chart is computed its lines are those of the last one on the scene.
    """
    scene, variants = setups[0].scene, _variants(setups)
    last, key = _charts.get(scene, {}), (scene, *variants)
    missing = len(variants) - len(lines := [last[name] for name in variants if name in last])
    if missing and _newest != [key]:
        _newest[:] = [key]
        threading.Thread(target=_compute, args=(scene, variants, key), daemon=True).start()
    return {"lines": lines, "missing": missing, "seconds": [_seconds(one) for one in setups]}
