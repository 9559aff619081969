"""What the work-precision study says in words, all of it from the data."""

from collections import Counter
from collections.abc import Sequence

import numpy as np
import xarray as xr

from symtop.measure import ranking
from symtop.measure.errors import QUANTITIES
from symtop.measure.work import TARGETS
from symtop.runner.study import Chart, Opening, Series, Table

STRUCTURE = ("midpoint", "trapezoidal", "stormer-verlet", "galerkin-simpson")
CLASSIC = ("rk4", "rk45-compiled")


def spans(data: xr.Dataset) -> list[str]:
    """The horizons."""
    return [f"over {value:g} nutation periods" for value in data["horizon"].values]


def seconds(value: float) -> str:
    """A time with a unit that suits it."""
    return f"{value * 1e6:.3g} us" if value < 1e-3 else f"{value * 1e3:.3g} ms" if value < 1.0 else f"{value:.3g} s"


MOST_NAMES = 3


def few(names: Sequence[str]) -> str:
    """The first names, and how many more there are."""
    more = len(names) - MOST_NAMES
    return ", ".join(names[:MOST_NAMES]) + (f" and {more} more" if more > 0 else "")


def winner(won: ranking.Win | None) -> str:
    """Who won, in how long, and who is level."""
    if won is None:
        return "nobody"
    level = f", level with {few(won.level)}" if won.level else ""
    return f"{won.best.integrator}, {seconds(won.best.cost)}{level}"


def lead(target: float, cell: xr.Dataset) -> str:
    """The fastest compiled method at a target and its lead; `cell` is one scene and one horizon."""
    won = ranking.win(cell, target)
    if won is None:
        return f"{target:.0e} nobody"
    said = f"{target:.0e} {won.best.integrator} in {seconds(won.best.cost)}"
    if won.level:
        said += f" (inside the noise of {few(won.level)})"
    elif won.behind and won.lead:
        foreseen = "" if won.rival_timed else ", foreseen"
        said += f" ({won.lead.ratio:.1f} times ahead of {won.behind.integrator}{foreseen})"
    if won.best.integrator == "exact" and (other := ranking.win(cell, target, without=("exact",))):
        said += f", the fastest that steps {other.best.integrator} in {seconds(other.best.cost)}"
    return said


def left_out(names: Sequence[str]) -> str:
    """Which scenes are shown but not counted, and why; nothing if there are none."""
    if not names:
        return ""
    return (
        f" Not counted: {', '.join(names)}, without a nutation; a start that is a fixed point of a map "
        "gives it no error at any step."
    )


def growth(data: xr.Dataset, names: list[str], part: str) -> str:
    """Median growth of a part of the error from the first to the last horizon."""
    grown = {name: ranking.growth_at_equal_settings(data.sel(integrator=name), part) for name in names}
    said = [f"{value:.3g} times with {name}" for name, value in grown.items() if np.isfinite(value)]
    rest = [name for name, value in grown.items() if not np.isfinite(value)]
    return ", ".join(said) + (f" (not judged: {', '.join(rest)}, at rounding or over budget)" if rest else "")


def crossings(data: xr.Dataset) -> list[str]:
    """For each classical method, who keeps energy better at equal cost, where, and up to what cost."""
    cells = _long(data)
    sentences = []
    for classic in CLASSIC:
        parts = []
        for method in STRUCTURE:
            found = [one for cell in cells if (one := ranking.crossing(cell, method, classic))]
            won = [one for one in found if one.share > 0.0]
            lost = [one.scene for one in found if one.share == 0.0]
            if not found:
                parts.append(f"{method} nowhere, as no costs are common")
                continue
            if not won:
                parts.append(f"{method} on none of {len(found)} scenes")
                continue
            top = max(won, key=lambda one: one.gain)
            reach = seconds(float(np.median([one.dearest_won for one in won])))
            never = f", never on {', '.join(lost)}" if lost else ""
            parts.append(
                f"{method} on {len(won)} of {len(found)} scenes, there up to {reach} a run (median), at best "
                f"{top.gain:.2g} times on {top.scene} (error {top.error:.1g}){never}"
            )
        sentences.append(f"At equal cost energy is kept better than by {classic}: by " + "; by ".join(parts) + ".")
    return sentences


def _long(data: xr.Dataset) -> list[xr.Dataset]:
    """The scenes that count, over the long horizon."""
    kept = ranking.counted(data)[0]
    return [kept.sel(scene=name).isel(horizon=-1) for name in kept["scene"].values]


def crossed(data: xr.Dataset) -> str:
    """The same in one sentence."""
    cells = _long(data)
    known = [one for cell in cells for a in STRUCTURE for b in CLASSIC if (one := ranking.crossing(cell, a, b))]
    coarse = sum(one.at_least and not one.at_most for one in known)
    fine = sum(one.at_most and not one.at_least for one in known)
    return (
        f"Of {len(known)} comparisons of {', '.join(STRUCTURE)} with {' and '.join(CLASSIC)}, the structure-preserving "
        f"method is better at every cost in {sum(one.share == 1.0 for one in known)}, with coarse steps only in "
        f"{coarse}, with fine steps only in {fine}, and nowhere in {sum(one.share == 0.0 for one in known)}."
    )


def opening(data: xr.Dataset) -> Opening:
    """Which method to begin with: for each horizon and target the one closest to the fastest over all scenes."""
    rows, sentences = [], []
    data, uncounted = ranking.counted(data)
    names = [name for name in map(str, data["integrator"].values) if _steps(data.sel(integrator=name))]
    ahead: Counter[str] = Counter()
    for far, span in enumerate(spans(data)):
        table = ranking.relative(ranking.costs(data.isel(horizon=[far])), names).sel(integrator=names)
        for number, target in enumerate(TARGETS):
            ratios = table.isel(target=[number])
            order = ranking.leaders(ratios, 3)
            if not order:
                rows.append([span, f"{target:.0e}", "none", "", "", ""])
                continue
            own = ratios.sel(integrator=order[0]).values.ravel()
            solved = np.isfinite(own)
            ahead[order[0]] += 1
            usual, worst = float(np.median(own[solved])), float(own[solved].max())
            share = f"{int(solved.sum())} of {own.size} scenes"
            time = f"{usual:.2g} (worst {worst:.2g})"
            rows.append([span, f"{target:.0e}", order[0], share, time, ", ".join(order[1:])])
    if ahead:
        best, times = ahead.most_common(1)[0]
        others = ", ".join(f"{name} for {count}" for name, count in ahead.most_common()[1:])
        sentences.append(
            f"For the direction of the axis, begin with {best}: over all scenes it is closest to the fastest method "
            f"for {times} of {len(rows)} pairs of horizon and accuracy"
            + (f"; {others}." if others else ".")
            + left_out(uncounted)
        )
    sentences.append(f"For energy {spans(data)[-1]}: {crossed(data)}")
    sentences.append(
        "For your own scene and accuracy: symtop recommend SCENE --accuracy 1e-6; it also tries out what it says."
    )
    header = ["horizon", "axis error", "begin with", "meets it on", "time over the fastest", "then"]
    return Opening("Which integrator should I use?", sentences, Table("A method to begin with", header, rows))


def _steps(cell: xr.Dataset) -> bool:
    """Is it compiled, and does it step? The closed form does not."""
    turned = np.isfinite(cell["step_size"].values) | np.isfinite(cell["tolerance"].values)
    return bool(turned.any()) and "compiled" in cell["tier"].values


def charts(data: xr.Dataset) -> list[Chart]:
    """Axis error against seconds, every run of every method: one panel a scene and horizon."""
    panels = {}
    for scene in data["scene"].values:
        for far, span in enumerate(spans(data)):
            cell = data.sel(scene=scene).isel(horizon=far)
            names = [str(name) for name in cell["integrator"].values]
            panels[f"{scene}, {span}"] = [_series(cell.sel(integrator=name), name) for name in names]
    return [Chart("axis", "Point at the runs", "wall time of one run (s)", f"largest {QUANTITIES['axis']}", panels)]


def _series(cell: xr.Dataset, name: str) -> Series:
    keep = np.isfinite(cell["seconds"].values) & np.isfinite(cell["axis"].values) & (cell["outcome"].values == "ok")
    points = []
    for k in sorted(np.flatnonzero(keep), key=lambda k: cell["seconds"].values[k]):
        step, tolerance = float(cell["step_size"].values[k]), float(cell["tolerance"].values[k])
        knob = (
            f"step {step:.3g}, " if np.isfinite(step) else f"tolerance {tolerance:.1e}, " * bool(np.isfinite(tolerance))
        )
        time, error = float(f"{cell['seconds'].values[k]:.3g}"), float(f"{cell['axis'].values[k]:.3g}")
        points.append((time, error, f"{knob}{seconds(time)}, error {error:.1e}"))
    return Series(name, points)
