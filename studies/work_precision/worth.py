"""When to choose each variant, from the times of this study alone.

A problem is a scene, a horizon and a target. A variant is worth choosing where it is the fastest compiled variant or
level with it (`leads.win`) and within the `WITHIN` of it that the rounds of the timing tell apart: a variant that is
farther behind may pass for level because a round was disturbed. A variant that never is has its best showing instead,
the least ratio of its time to the fastest. What
a variant keeps of the motion beside the axis is not weighed here: that is in the claims and in the drift study.
"""

from collections import Counter

import numpy as np
import xarray as xr

from symtop.measure import ranking
from symtop.runner.study import Table

from . import leads
from .timing_rounds import WITHIN

HEADER = ["variant", "fastest in", "tied with the fastest in", "met", "at its best", "median", "when to choose it"]
NEVER, NO_TARGET = "never", "never: it meets no target within its budget"


def _counted(values: list[str]) -> str:
    """The values with how often they come, the most frequent first."""
    return ", ".join(f"{value} ({times})" for value, times in Counter(values).most_common(3))


def choice(first: list[tuple[str, float]], ratios: np.ndarray) -> str:
    """When to choose a variant that is first or level with the first on these problems, of so many ratios."""
    met = ratios[np.isfinite(ratios)]
    if not met.size:
        return NO_TARGET
    if not first:
        return f"{NEVER}: at its best it takes {met.min():.2g} times the fastest"
    targets = _counted([f"{target:.0e}" for _, target in first])
    return f"for errors of {targets} on {_counted([scene for scene, _ in first])}"


def table(data: xr.Dataset) -> Table:
    """Every compiled variant: how often it wins, how far it is behind, and when to choose it."""
    kind = data["implementation"]
    names = [row for row in ranking.ranked(data) if "compiled" in kind.sel(variant=row).values]
    wins = {problem: won for problem, won in leads.winners(data).items() if won is not None}
    costs, scenes = leads.relative_costs(data, names), [str(scene) for scene in data["scene"].values]

    def place(scene: str, far: int) -> int:
        return scenes.index(scene) * data.sizes["horizon"] + far

    rows = []
    for name in names:
        best = [problem for problem, won in wins.items() if won.best.integrator == name]
        mine = costs.sel(variant=name)
        behind = {float(target): mine.sel(target=target).values for target in costs["target"].values}
        near = {problem for problem in wins if behind[problem[2]][place(*problem[:2])] <= WITHIN}
        level = [problem for problem, won in wins.items() if name in won.level and problem in near]
        ratios = mine.values
        met = ratios[np.isfinite(ratios)]
        asked = int(np.sum(~np.isnan(ratios)))
        shown = [f"{met.min():.2g}", f"{np.median(met):.2g}"] if met.size else ["", ""]
        said = choice([(scene, target) for scene, _, target in (*best, *level)], ratios)
        rows.append([name, str(len(best)), str(len(level)), f"{met.size} of {asked}", *shown, said])
    title = "When to choose each compiled variant, by the time to an axis error; times the fastest variant's"
    return Table(title, HEADER, rows)
