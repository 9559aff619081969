"""When a discrete method keeps the energy better than the notebook's solver: both run on, far beyond the notebook.

A discrete Lagrangian has an energy error of O(h^2) from the first nutation on, and it stays there. The solver begins
with the error of its tolerance, and that grows about as t. The two cross at some time, which is measured here with the
notebook's own settings: largest error so far against the time, on a logarithmic grid of times.
"""

import math
from typing import Any

import numpy as np
import xarray as xr

from symtop.measure.conservation import residuals
from symtop.methods.registry import integrator, split_name
from symtop.model.scenes import Scene
from symtop.run.simulation import simulate

from .tables import SOLVER, SOLVER_TOLERANCE, STEPS_A_NUTATION, Column

FIRST = 1.0  # s, of the times at which the largest error so far is stored
TIMES = 320  # of them: neighbours are 2 to 3 % apart
SAMPLES = 12_001  # of a run


def long_energy(scene: Scene, name: str, setting: float, horizon: float) -> xr.Dataset:
    """Largest relative energy error so far of one row, at times from `FIRST` to `horizon`; dimension ``long``."""
    method = integrator(name)
    control = method.setting(setting).kwargs()
    run = simulate(scene, method, observe="nutation", samples=SAMPLES, horizon=horizon, guard=False, **control)
    largest = np.fmax.accumulate(np.abs(residuals(scene, run)["energy"]))
    times = np.geomspace(FIRST, horizon, TIMES)
    seen = np.maximum(np.searchsorted(run["time"].values, times * (1.0 + 1e-12), side="right") - 1, 0)
    values = np.where(times <= run.attrs["reached_time"] * (1.0 + 1e-12), largest[seen], math.nan)
    columns: dict[str, Any] = {Column.LONG_TIME: ("long", times), Column.LONG_ENERGY: ("long", values)}
    return xr.Dataset(columns)


def better_from(data: xr.Dataset, scene: str, name: str) -> float:
    """The time (s) from which a row has a smaller energy error than the solver, up to the end; inf if it never has.

    0 means that it is smaller at every stored time.
    """
    cell = data.sel(scene=scene)
    ours = cell[Column.LONG_ENERGY].sel(integrator=name).values
    times, solver = (cell[column].sel(integrator=SOLVER).values for column in (Column.LONG_TIME, Column.LONG_ENERGY))
    worse = np.flatnonzero(~(ours < solver))
    if not worse.size:
        return 0.0
    return float(times[worse[-1] + 1]) if worse[-1] + 1 < times.size else math.inf


def notebook_end(data: xr.Dataset, scene: str) -> float:
    """The notebook's own horizon (s)."""
    return float(data[Column.SAMPLE_TIME].sel(scene=scene).max())


def energy_until(data: xr.Dataset, scene: str, name: str, time: float) -> float:
    """The largest energy error of a row up to a time."""
    cell = data.sel(scene=scene, integrator=name)
    return float(cell[Column.LONG_ENERGY].values[np.searchsorted(cell[Column.LONG_TIME].values, time)])


def answer(data: xr.Dataset, named: tuple[str, ...]) -> list[str]:
    """Whether the discrete methods that are `named` keep the energy better than the solver, and from when on."""
    sentences = []
    for scene in map(str, data["scene"].values):
        shown = [name for name in named if name in data["integrator"].values]
        largest = data["energy_largest"].sel(scene=scene)
        end = notebook_end(data, scene)
        limit = float(largest.sel(integrator=SOLVER))
        values = {name: float(largest.sel(integrator=name)) for name in shown}
        worse, better = ([n for n in shown if (values[n] < limit) is wanted] for wanted in (False, True))
        verdicts = [f"{word} with {', '.join(f'{name} ({values[name]:.0e})' for name in part)}"
                    for word, part in (("worse", worse), ("better", better)) if part]  # fmt: skip
        sentences.append(
            f"Energy, discrete methods against the notebook's solver: on {scene}, at the notebook's t = {end:g}, it is "
            f"kept {', and '.join(verdicts)}, against {limit:.0e} of {SOLVER} (tolerance {SOLVER_TOLERANCE:g}; "
            f"the others take {STEPS_A_NUTATION:.0f} steps a nutation). {_later(data, scene, worse)}".rstrip()
        )
    return sentences


def _later(data: xr.Dataset, scene: str, names: list[str]) -> str:
    """From when on the rows that are worse at first are better."""
    last, end = float(data[Column.LONG_TIME].sel(scene=scene).max()), notebook_end(data, scene)
    since = {name: better_from(data, scene, name) for name in names}
    true = [f"{time:.3g} ({name})" for name, time in sorted(since.items(), key=lambda one: one[1])
            if math.isfinite(time)]  # fmt: skip
    never = [name for name, time in since.items() if math.isinf(time)]
    grown = [energy_until(data, scene, name, last) / energy_until(data, scene, name, end) - 1.0 for name in names]
    level = (
        f"Up to t = {last:g} their largest error grows by {max(grown, default=0.0):.0%}, and that of "
        f"{split_name(SOLVER)[0]} to {energy_until(data, scene, SOLVER, last):.0e}"
    )
    parts = [f"their error is the smaller one from t = {', '.join(true)} on"] if true else []
    parts += [f"with {', '.join(never)} it never is"] if never else []
    return f"{level}; {'; '.join(parts)}." if parts else ""
