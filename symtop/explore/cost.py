"""Error against run time of a few methods on the scene of the page, and the times of its own runs.

The runs of a line are those of `symtop.compare`, and all runs of a chart are timed against each other. This takes
seconds and is done in a thread, while the page polls. Runs are cached by scene and variant, the last chart by scene.
After a slider has moved the page requests another chart: the computation of the older one is then ended.
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

PEERS = ("stormer-verlet", "strang", "rk4", "gauss-4", "dop853-compiled")  # methods in every chart
BUDGET_SHARE = 0.1  # budget of a run, as part of that of `compare`
MOST_LINES, MOST_CHARTS = 500, 100  # most that are cached
REPEATS, LONG_RUN = 9, 0.05  # repetitions of a timed run; seconds of a run that is not repeated

_charts: dict[Scene, dict[str, dict[str, Any]]] = {}  # by scene, the lines by the names of their methods
_newest: list[tuple[Any, ...]] = []  # scene and methods of the chart that is being computed
_at_work = threading.Lock()


def question(fields: Mapping[str, Any]) -> list[Setup]:
    """The run of the page and, if it names a `second` method, a second run. Raises SymtopError as `setup`."""
    first, second = setup(fields), str(fields.get("second") or "")
    return [first, setup({**fields, "integrator": second})] if second else [first]


def _variants(setups: list[Setup]) -> dict[str, Integrator]:
    """The variants of a chart by the names of their methods, those of the page first; all determine the attitude."""
    scene, peers = setups[0].scene, map(integrator, PEERS)
    methods = [setup.method for setup in setups]
    methods += [method for method in peers if not scene.of_body or BODY in method.solvers]
    usable = [method for method in methods if method.control]
    return {method.name: method.variant(chart_of(method, scene.observes, "attitude")) for method in usable}


@functools.lru_cache(MOST_LINES)
def _runs(scene: Scene, name: str) -> list[tuple[float, str, float]]:
    """Setting, outcome and largest error (rad; of the axis, or of a body's attitude) of each run of a line."""
    variant, quantity = integrator(name), "attitude" if scene.of_body else "axis"
    budget = BUDGET_SHARE * BUDGET[variant.implementation] * min(variant.speed, 1.0)
    data = compare(scene, [variant], quantity=quantity, cost="evaluations", budget=budget, quiet=True).isel(variant=0)
    values = (data[name].values.tolist() for name in (str(variant.control), "outcome", "error"))
    return [run for run in zip(*values, strict=True) if run[1] != "not_run"]


def _compute(scene: Scene, variants: dict[str, Integrator], key: tuple[Any, ...]) -> None:
    """Compute the lines of a chart; end early if another chart is requested meanwhile."""
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
            timed_rows([(scene, variants[name], scene.horizon, records) for name, records in rows.items()])
        except Exception as problem:  # noqa: BLE001  (as above)
            rows, messages = {name: [] for name in rows}, dict.fromkeys(rows, str(problem))
        while len(_charts) >= MOST_CHARTS:
            del _charts[next(iter(_charts))]
        _charts[scene] = {name: _line(name, records, messages.get(name, "")) for name, records in rows.items()}
        _newest.clear()


def _line(name: str, rows: list[dict[str, Any]], message: str) -> dict[str, Any]:
    """Seconds and errors of the runs of a method with outcome "ok", and the number of failed ones."""
    valid = [row for row in rows if row["outcome"] == "ok" and row["error"] > 0.0]
    failed = sum(row["outcome"] != "ok" for row in rows)
    numbers = {name: [row[name] for row in valid] for name in ("seconds", "error")}
    return {"name": name, **numbers, "failed": failed, "message": message}


def _seconds(setup: Setup) -> float | None:
    """The least time of a run of the page, None if it failed; `timings` would compile the closed form and wait."""
    chart = chart_of(setup.method, setup.scene.observes, "attitude")
    setting = math.nan if setup.setting is None else setup.setting
    run = bare_run(setup.scene, setup.method, chart, setting, setup.scene.horizon, budget=setup.budget)
    if run().outcome != "ok":
        return None
    first = first_call(run)
    return min([first, *(first_call(run) for _ in range(REPEATS if first < LONG_RUN else 0))])


def chart(setups: list[Setup]) -> dict[str, Any]:
    """The lines computed (of the last chart until this one is), the number missing, and seconds of the page's runs."""
    scene, variants = setups[0].scene, _variants(setups)
    last, key = _charts.get(scene, {}), (scene, *variants)
    missing = len(variants) - len(lines := [last[name] for name in variants if name in last])
    if missing and _newest != [key]:
        _newest[:] = [key]
        threading.Thread(target=_compute, args=(scene, variants, key), daemon=True).start()
    return {"lines": lines, "missing": missing, "seconds": [_seconds(setup) for setup in setups]}
