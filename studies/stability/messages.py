"""The one message of each figure of a mechanism, made from its data."""

from collections.abc import Callable

import numpy as np
import xarray as xr

from symtop.methods.framework.registry import split_name
from symtop.model.charts import Array
from symtop.report.sentences import counted
from symtop.report.style import number

from .atlas import FAR, NEAR, methods_of
from .failures import LOST
from .resonance_words import BARELY, resonant
from .tables import Column
from .words import LEAST_ASKED, LEAST_SAMPLED, misses, outlasting, unreached

SLEEPERS = ("strang", "cayley", "midpoint", "gauss-4", "yoshida-4")  # methods, of the figure of the sleeping top
ROUNDED = 1e-14  # rad: errors up to this are rounding
SHIFTED = 1e-3  # of the threshold: less is kept


def of_mechanism(name: str, part: xr.Dataset) -> str:
    """What the figure of a mechanism shows, in one sentence; `part` is its scene."""
    return MESSAGES[name](part)


def at_pole(part: xr.Dataset) -> dict[str, tuple[Array, Array]]:
    """Gaps, growing, and errors of every variant of fixed step that is judged next to a pole and away from it."""
    rows = {}
    for name, method in methods_of(part).items():
        cell = part.sel(variant=name)
        gaps, errors = cell[Column.PARAMETER].values, cell[Column.GRAZING_ERROR].values
        there = np.isfinite(gaps)
        near, far = errors[gaps <= NEAR], errors[gaps >= FAR]
        if method.control == "step_size" and near.size and np.isfinite(far).any():
            rows[name] = gaps[there], errors[there]
    return rows


def lasts(name: str, gaps: Array, errors: Array) -> bool:
    """Is it a variant in angles whose runs do not all end early next to a pole?"""
    return split_name(name)[1] == "angles" and bool(np.isfinite(errors[gaps <= NEAR]).any())


def _pole(part: xr.Dataset) -> str:
    """Who ends early next to a pole, and how little the errors of the others change with the gap."""
    early, spread = [], []
    for name, (gaps, errors) in at_pole(part).items():
        if split_name(name)[1] == "angles":
            early.append(not lasts(name, gaps, errors))
        else:
            spread.append(float(np.max(errors)) / max(float(np.nanmin(errors)), ROUNDED))
    near = f"within {number(NEAR, 1)} rad of a pole"
    text = f"At one step {sum(early)} of {len(early)} fixed-step methods in angles end early {near}"
    most = max(spread, default=np.nan)
    if not np.isfinite(most):
        return text
    changed = f"have errors that differ at most {number(max(most, 1.0))} times between all gaps"
    return f"{text}; the {len(spread)} in other charts {changed}"


def _resonances(part: xr.Dataset) -> str:
    steps, tried = resonant(part), int(np.isfinite(part[Column.THIRD_TURN_PHASE]).sum())
    if not steps:
        return "No step that turns the nutation by a third a step was found to be unstable"
    return (
        f"{len(steps)} of {tried} methods lose a top at some displacement of at most {BARELY:g} rad at the step that "
        "turns the nutation by a third, though it is linearly stable"
    )


def _sleeping(part: xr.Dataset) -> str:
    measured = part[Column.SLEEPING_THRESHOLD]
    variants = [str(name) for name in part["variant"].values if split_name(str(name))[0] in SLEEPERS]
    curves = {name: measured.sel(variant=name).dropna("rung").values for name in variants}
    ends = {name: float(curve[np.argmax(np.abs(curve - 2.0))]) for name, curve in curves.items() if curve.size}
    far = sorted((name for name in ends if abs(ends[name] - 2.0) > SHIFTED), key=lambda name: -ends[name])
    listed = ", ".join(f"{ends[name]:.2f} with {name}" for name in far)
    kept = sum(abs(end - 2.0) <= SHIFTED for end in ends.values())
    if not far:
        return f"No step moves the spin 2 from which a top sleeps; {kept} methods keep it"
    return f"Long steps move the spin from which a top sleeps from 2 to {listed}; {kept} methods keep it"


def _separatrix(part: xr.Dataset) -> str:
    gap, apart = misses(part), outlasting(part)
    if not gap.size:
        return "Next to the separatrix no run was seen to lose its accuracy"
    rest = f"; {len(apart)} method{'s last' if len(apart) > 1 else ' lasts'} longer" if apart else ""
    if ended := sum(unreached(part).values()):
        rest += f"{',' if rest else ';'} {counted(ended, 'run')} never got there"
    text = f"Next to the separatrix an early error predicts when it reaches {LOST:g} rad"
    return f"{text}, to {np.median(gap):.2f}/λ in the median{rest}"


def _sampled(part: xr.Dataset) -> dict[str, tuple[float, float]]:
    """Energy errors above rounding, sampled once a nutation and at every step, by variant."""
    once, every = part[Column.ENERGY_ONCE].values, part[Column.ENERGY_EVERY].values
    variants = zip(map(str, part["variant"].values), once, every, strict=True)
    return {name: (float(a), float(b)) for name, a, b in variants if np.isfinite(a) and b > LEAST_ASKED}


def hidden_sampled(part: xr.Dataset) -> list[str]:
    """The variants whose energy error is at rounding if it is sampled once a nutation."""
    return [name for name, (once, _) in _sampled(part).items() if once <= LEAST_SAMPLED]


def worst_sampled(part: xr.Dataset) -> str:
    """The variant whose energy error looks too small by the largest factor; empty if none is seen."""
    seen = {name: every / once for name, (once, every) in _sampled(part).items() if once > LEAST_SAMPLED}
    return max(seen, key=lambda name: seen[name], default="")


def _sampling(part: xr.Dataset) -> str:
    worst, hidden = worst_sampled(part), len(hidden_sampled(part))
    once, every = _sampled(part).get(worst, (1.0, 1.0))
    rest = f", and that of {hidden} method{'s' if hidden > 1 else ''} is not seen at all" if hidden else ""
    by = f" ({worst})" if worst else ""
    return f"Sampled once a nutation an energy error looks up to {number(every / once, 1)} times too small{by}{rest}"


def _solver(part: xr.Dataset) -> str:
    solved = float(part[Column.TEXTBOOK_ENERGY].isel(tolerance_setting=-1).max())
    one = float(part[Column.ONE_ITERATION_ENERGY].max())
    return (
        f"One textbook Newton iteration a step leaves an absolute energy error of {number(one)}; iterated to the end "
        f"it leaves {number(solved)}"
    )


MESSAGES: dict[str, Callable[[xr.Dataset], str]] = {
    "pole": _pole, "resonances": _resonances, "sleeping": _sleeping, "separatrix": _separatrix,
    "sampling": _sampling, "solver": _solver,
}  # fmt: skip
