"""Own compiled rows against heyoka's `taylor`, timed in one round: the ratio by scene, horizon and target.

An own row is any compiled row that takes steps and is none of heyoka's, which are `taylor` in three precisions. Rows
whose step is the motion itself (`Integrator.exact_steps`) take no part in the study.
"""

from typing import NamedTuple

import numpy as np
import xarray as xr

from symtop.measure import ranking
from symtop.measure.work import TARGETS
from symtop.report.sentences import joined
from symtop.runner.study import Table

RIVAL = "taylor"  # what the rows of heyoka begin with
FINE = 1e-9  # rad: errors up to it are fine


class Ratio(NamedTuple):
    """The fastest own row and the fastest of heyoka's; NaN in place of a time where none met the target."""

    row: str
    seconds: float
    rival: float  # seconds

    @property
    def value(self) -> float:
        """The own time over the rival's: below 1 the own row is ahead."""
        return self.seconds / self.rival


def compared(data: xr.Dataset) -> dict[tuple[str, int, float], Ratio]:
    """Every scene, horizon (by index) and target that is asked there; nothing without the rival."""
    if not any(_is_rival(name) for name in ranking.ranked(data)):
        return {}
    ratios = {}
    for scene in data["scene"].values:
        for far in range(data.sizes["horizon"]):
            cell = data.sel(scene=scene).isel(horizon=far)
            for target in ranking.targets(cell):
                places = ranking.cheapest(cell, target, implementation="compiled")
                own = next(((p.integrator, p.cost) for p in places if not _is_rival(p.integrator)), ("", np.nan))
                theirs = min((p.cost for p in places if _is_rival(p.integrator)), default=np.nan)
                ratios[str(scene), far, target] = Ratio(*own, theirs)
    return ratios


def _is_rival(name: str) -> bool:
    return name.startswith(RIVAL)


def headline(data: xr.Dataset, spans: list[str]) -> str:
    """How often own rows are ahead, and by how much to a fine error at each horizon; empty without the rival."""
    ratios = compared(data)
    both = {key: ratio for key, ratio in ratios.items() if np.isfinite(ratio.value)}
    if not both:
        return ""
    ahead = sum(ratio.value <= 1.0 for ratio in both.values())
    alone = sum(np.isfinite(ratio.seconds) and not np.isfinite(ratio.rival) for ratio in ratios.values())
    said = (
        f"The fastest of symtop's own rows takes no more time than heyoka's {RIVAL} in {ahead} of {len(both)} "
        "combinations of scene, run length and error that both meet"
    ) + (f", and meets {alone} more." if alone else ".")
    parts = []
    for far, span in enumerate(spans):
        fine = [1.0 / ratio.value for (_, k, target), ratio in both.items() if k == far and target <= FINE]
        if fine:
            parts.append(f"{min(fine):.1f} to {max(fine):.1f} times faster {span} (median {np.median(fine):.1f})")
    return said + (f" To {FINE:.0e} rad and below it is {joined(parts)}." if parts else "")


def table(data: xr.Dataset, spans: list[str]) -> Table:
    """The ratios, with the rows that they belong to."""
    ratios = compared(data)
    rows = [
        [str(scene), span, *(_cell(ratios.get((str(scene), far, target))) for target in TARGETS)]
        for scene in data["scene"].values
        for far, span in enumerate(spans)
    ]
    return Table(
        f"The fastest own row over {RIVAL}, timed in the same rounds: ratio of the times, below 1 where it is ahead",
        ["scene", "horizon", *(f"axis error {target:.0e}" for target in TARGETS)],
        rows,
    )


def _cell(ratio: Ratio | None) -> str:
    if ratio is None:
        return ""
    if np.isnan(ratio.seconds):
        return "neither" if np.isnan(ratio.rival) else f"{RIVAL} alone"
    return f"{ratio.row} alone" if np.isnan(ratio.rival) else f"{ratio.value:.2f} ({ratio.row})"
