"""What the runs far beyond the notebook's end say: whether, and from when on, a variant keeps the energy better."""

import math
from collections.abc import Mapping, Sequence

import xarray as xr

from symtop.report.sentences import few, joined
from symtop.runner.study import Table

from .long_energy import better_from, energy_until, notebook_end
from .tables import SOLVER, SOLVER_TOLERANCE, STEPS_A_NUTATION, Column

UNCHANGED = 0.005  # relative: an error that grew by less is said not to have changed


def answer(data: xr.Dataset, named: tuple[str, ...]) -> list[str]:
    """Whether the discrete methods that are `named` keep the energy better than the solver, and from when on."""
    sentences = []
    for scene in map(str, data["scene"].values):
        shown = [name for name in named if name in data["variant"].values]
        largest = data["energy_largest"].sel(scene=scene)
        limit = float(largest.sel(variant=SOLVER))
        values = {name: float(largest.sel(variant=name)) for name in shown}
        worse, better = ([n for n in shown if (values[n] < limit) is wanted] for wanted in (False, True))
        parts = [
            f"{word} than {_listed(values, part, most)}"
            for word, part, most in (("better", worse, 2), ("worse", better, 4))  # the worse are named below
            if part
        ]
        sentences.append(
            f"On {scene}, to the notebook's t = {notebook_end(data, scene):g}, {SOLVER} keeps the energy to "
            f"{limit:.0e}, {' and '.join(parts)}. {_later(data, scene, worse)}".rstrip()
        )
    return sentences


def _listed(values: Mapping[str, float], names: Sequence[str], most: int) -> str:
    """Variants, by name if at most so many, with their errors, from the least to the largest."""
    ends = dict.fromkeys(f"{pick(values[name] for name in names):.0e}" for pick in (min, max))
    return f"{few(names, most=most)} ({' to '.join(ends)})"


def _later(data: xr.Dataset, scene: str, names: list[str]) -> str:
    """From when on the variants that are worse at first are better, one by one."""
    if not names:
        return ""
    last, end = float(data[Column.LONG_TIME].sel(scene=scene).max()), notebook_end(data, scene)
    since = {name: better_from(data, scene, name) for name in names}
    true = sorted((name for name, time in since.items() if math.isfinite(time)), key=lambda name: since[name])
    never = [name for name, time in since.items() if math.isinf(time)]
    grown = max(energy_until(data, scene, name, last) / energy_until(data, scene, name, end) - 1.0 for name in names)
    whose = "theirs" if len(names) > 1 else "the other's"
    change = f"has grown by {grown:.0%}" if grown >= UNCHANGED else "has not changed"
    said = f"By t = {last:g} its error is {energy_until(data, scene, SOLVER, last):.0e}, {whose} {change}"
    if true:
        first, *others = true
        said += ": " + joined([
            f"{first} is better from t = {since[first]:.3g} on", *(f"{name} from {since[name]:.3g}" for name in others)
        ])  # fmt: skip
    return said + (f"; {few(never)} {'is' if len(never) == 1 else 'are'} never better." if never else ".")


def long_table(data: xr.Dataset, named: Sequence[str]) -> Table:
    """Energy errors at the notebook's end and far beyond it, and from when on a variant keeps the energy better."""
    last, lines = float(data[Column.LONG_TIME].max()), []
    for scene in map(str, data["scene"].values):
        end = notebook_end(data, scene)
        for name in (row for row in (SOLVER, *named) if row in data["variant"].values):
            since = better_from(data, scene, name)
            better = "" if name == SOLVER else f"{since:.3g}" if math.isfinite(since) else "not to the end"
            errors = (energy_until(data, scene, name, time) for time in (end, last))
            lines.append([scene, name, f"{end:g}", *(f"{error:.0e}" for error in errors), better])
    header = ["scene", "variant", "notebook's end (s)", "energy error to then", f"to t = {last:g}", "better from t (s)"]
    title = (
        f"Energy of {SOLVER} at tolerance {SOLVER_TOLERANCE:g} and of methods of order two at {STEPS_A_NUTATION:.0f} "
        "steps a nutation"
    )
    return Table(title, header, lines)
