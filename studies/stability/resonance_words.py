"""What is said of steps next to a steady precession: where nutations grow, and where a small displacement is lost.

A limit is looked for at the steps of a grid, and then between them (`windows`).
"""

import math
from collections.abc import Mapping

import numpy as np
import xarray as xr

from symtop.report.sentences import counted, few

from .linear_limits import GROWING
from .tables import SOUGHT_STEPS, Column

VERLET = "stormer-verlet[angles]"
THIRDS = {  # the step that turns the nutation by a third, as h omega: two variants with a closed form
    VERLET: "sqrt 3", "midpoint[angles]": "2 sqrt 3",
}  # fmt: skip
BARELY = 0.02  # rad: a top that is lost at a smaller displacement is lost to a resonance
NEXT = 1.05  # times the largest displacement up to which all stay, at most: the first that was lost
REVIVAL = 3.0  # times more survives past a resonance than in it; what stays dead beyond is no resonance


def variants_with(part: xr.Dataset, variable: str) -> dict[str, xr.Dataset]:
    """The integrators that have a value of a variable, by name."""
    return {
        str(name): part.isel(variant=k)
        for k, name in enumerate(part["variant"].values)
        if np.isfinite(part[variable].isel(variant=k).values).any()
    }


def _ends(values: Mapping[str, float]) -> str:
    """The least and the largest of some numbers, with their variants."""
    ranked = sorted(values, key=lambda name: values[name])
    said = [f"{values[name]:.4g} ({name})" for name in dict.fromkeys((ranked[0], ranked[-1]))]
    return f"from {' to '.join(said)}" if len(said) > 1 else f"at {said[0]}"


def limits(part: xr.Dataset) -> str:
    """Linear limits of the step, the methods that have none or only narrow windows, and those that show nothing."""
    phases = {
        name: float(np.fmin(cell[Column.LIMIT_PHASE], cell.get(Column.WINDOW_START, math.nan)))
        for name, cell in variants_with(part, Column.LIMIT_PHASE).items()
    }  # a narrow window may come first
    free, narrow, parts = unlimited(part), only_windows(part), []
    if phases:
        parts.append(f"at h omega {_ends(phases)} with {few(list(phases), most=2)}")
    if free:
        end = f"{'' if phases else 'h omega = '}{max(free.values()):g}"
        parts.append(f"at none of {SOUGHT_STEPS} steps up to {end} with {few(list(free))}")
    if narrow:
        width, least = max(end - start for start, end in narrow.values()), min(start for start, _ in narrow.values())
        place = f"in windows up to {width:.1g} wide from {least:.3g} on"
        parts.append(f"only between steps tried, {place}, with {few(list(narrow))}")
    if not parts:
        return ""
    known = {*phases, *free, *narrow}
    neither = [name for name in variants_with(part, Column.SOUGHT_PHASE) if name not in known]
    rest = f" {counted(len(neither))} cannot be followed." if neither else ""
    return (
        f"Small nutations about a steady precession, of frequency omega, first grow, or it is lost, {'; '.join(parts)}."
        f"{rest} Without symmetry growth counts from {GROWING:g} a step."
    )


def unlimited(part: xr.Dataset) -> dict[str, float]:
    """Methods whose small nutations grow at no step, with the largest h omega at which they were tried.

    A method whose step reaches a third of a turn was followed on the whole way there; one that shows neither is not
    symmetric, or has no precession to follow.
    """
    if Column.SOUGHT_PHASE not in part:
        return {}
    turning, narrow = variants_with(part, Column.THIRD_TURN_PHASE), only_windows(part)
    return {
        name: float(cell[Column.SOUGHT_PHASE])
        for name, cell in turning.items()
        if name not in narrow and math.isnan(float(cell[Column.LIMIT_PHASE]))
    }


def only_windows(part: xr.Dataset) -> dict[str, tuple[float, float]]:
    """Methods whose nutations grow between the steps of the search only, with the ends of their first window."""
    rows = variants_with(part, Column.WINDOW_START) if Column.WINDOW_START in part else {}
    return {
        name: (float(cell[Column.WINDOW_START]), float(cell[Column.WINDOW_END]))
        for name, cell in rows.items()
        if math.isnan(float(cell[Column.LIMIT_PHASE]))
    }


def resonant(part: xr.Dataset) -> dict[str, float]:
    """By variant the linearly stable steps (h omega) where some small displacement is lost, and none just past."""
    phases = {}
    for name, cell in variants_with(part, Column.THIRD_TURN_PHASE).items():
        at, past = float(cell[Column.SURVIVING_AT_THIRD_TURN]), float(cell[Column.SURVIVING_PAST_THIRD_TURN])
        if past > REVIVAL * at and NEXT * at < BARELY:
            phases[name] = float(cell[Column.THIRD_TURN_PHASE])
    return phases


def resonances(part: xr.Dataset) -> str:
    """The linearly stable steps at which some small displacement is lost, in a sentence."""
    steps = resonant(part)
    if not steps:
        return ""
    tried = int(np.isfinite(part[Column.THIRD_TURN_PHASE]).sum())
    known = [f"{steps[name]:.4f} with {name} (theory: {theory})" for name, theory in THIRDS.items() if name in steps]
    return (
        "A step that turns the nutation by a third is linearly stable, but with "
        f"{len(steps)} of {counted(tried)} a top is lost at some displacement of at most {BARELY:g} rad. "
        f"There h omega is {', '.join(known) or _ends(steps)}."
    )
