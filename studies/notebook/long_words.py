"""What the runs far beyond the notebook's end say: whether, and from when on, a row keeps the energy better."""

import math
from collections.abc import Mapping, Sequence

import xarray as xr

from symtop.report.sentences import few
from symtop.runner.study import Table

from .long_energy import better_from, energy_until, notebook_end
from .tables import SOLVER, SOLVER_TOLERANCE, STEPS_A_NUTATION, Column


def answer(data: xr.Dataset, named: tuple[str, ...]) -> list[str]:
    """Whether the discrete methods that are `named` keep the energy better than the solver, and from when on."""
    sentences = []
    for scene in map(str, data["scene"].values):
        shown = [name for name in named if name in data["integrator"].values]
        largest = data["energy_largest"].sel(scene=scene)
        limit = float(largest.sel(integrator=SOLVER))
        values = {name: float(largest.sel(integrator=name)) for name in shown}
        worse, better = ([n for n in shown if (values[n] < limit) is wanted] for wanted in (False, True))
        parts = [
            f"{word} than {_listed(values, part)}" for word, part in (("better", worse), ("worse", better)) if part
        ]
        sentences.append(
            f"On {scene}, to the notebook's t = {notebook_end(data, scene):g}, {SOLVER} keeps the energy to "
            f"{limit:.0e}, {' and '.join(parts)}. {_later(data, scene, worse)}".rstrip()
        )
    return sentences


def _listed(values: Mapping[str, float], names: Sequence[str]) -> str:
    """Rows with their errors, from the least to the largest."""
    ends = dict.fromkeys(f"{pick(values[name] for name in names):.0e}" for pick in (min, max))
    return f"{few(names)} ({' to '.join(ends)})"


def _later(data: xr.Dataset, scene: str, names: list[str]) -> str:
    """From when on the rows that are worse at first are better."""
    if not names:
        return ""
    last, end = float(data[Column.LONG_TIME].sel(scene=scene).max()), notebook_end(data, scene)
    since = {name: better_from(data, scene, name) for name in names}
    true = sorted(time for time in since.values() if math.isfinite(time))
    never = [name for name, time in since.items() if math.isinf(time)]
    grown = max(energy_until(data, scene, name, last) / energy_until(data, scene, name, end) - 1.0 for name in names)
    said = (
        f"Up to t = {last:g} its error grows to {energy_until(data, scene, SOLVER, last):.0e}, that of the rows it "
        f"beat by {grown:.0%}"
    )
    if true:
        ends = dict.fromkeys(f"{time:.3g}" for time in (true[0], true[-1]))
        said += f"; theirs is smaller from t = {' to '.join(ends)} on"
    return said + (f"; with {few(never)} it never is." if never else ".")


def long_table(data: xr.Dataset, named: Sequence[str]) -> Table:
    """Energy errors at the notebook's end and far beyond it, and from when on a row keeps the energy better."""
    last, lines = float(data[Column.LONG_TIME].max()), []
    for scene in map(str, data["scene"].values):
        end = notebook_end(data, scene)
        for name in (row for row in (SOLVER, *named) if row in data["integrator"].values):
            since = better_from(data, scene, name)
            better = "" if name == SOLVER else f"{since:.3g}" if math.isfinite(since) else "not to the end"
            errors = (energy_until(data, scene, name, time) for time in (end, last))
            lines.append([scene, name, f"{end:g}", *(f"{error:.0e}" for error in errors), better])
    header = ["scene", "row", "notebook's end (s)", "energy error to then", f"to t = {last:g}", "better from t (s)"]
    title = (
        f"Energy of {SOLVER} at tolerance {SOLVER_TOLERANCE:g} and of methods of order two at {STEPS_A_NUTATION:.0f} "
        "steps a nutation"
    )
    return Table(title, header, lines)
