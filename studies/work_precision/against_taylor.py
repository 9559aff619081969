"""Own compiled variants against heyoka's `taylor` in double precision, timed in one round, by problem.

Own is any compiled variant that takes steps and is none of heyoka's three: `taylor`, which has double precision as the
own variants have, and its two forms of longer arithmetic, which are no rivals and are told of only where they alone
meet a target. Each side shows its fastest variant in any chart. Variants whose step is the motion itself
(`Integrator.exact_steps`) take no part in the study.
"""

from typing import NamedTuple

import numpy as np
import xarray as xr

from symtop.measure import ranking
from symtop.measure.settings import TARGETS
from symtop.methods.framework.registry import split_name
from symtop.report.sentences import joined
from symtop.runner.study import Table

from . import leads

RIVAL = "taylor"
LONGER = ("taylor-longdouble", "taylor-quad")  # the same of heyoka, in longer arithmetic
FINE = 1e-9  # rad: errors up to it are fine


class Ratio(NamedTuple):
    """The fastest variant of each side; no name, and NaN in place of a time, where none met the target."""

    row: str
    seconds: float
    rival: float  # seconds
    longer: str  # the fastest of heyoka's variants in longer arithmetic

    @property
    def value(self) -> float:
        """The own time over the rival's: below 1 the own variant is ahead."""
        return self.seconds / self.rival

    @property
    def alone(self) -> str:
        """Which of the two met the target alone: "own" or `RIVAL`; empty if both or neither did."""
        met = np.isfinite([self.seconds, self.rival])
        return "" if met[0] == met[1] else "own" if met[0] else RIVAL

    @property
    def neither(self) -> bool:
        """Did no variant in double precision meet the target?"""
        return bool(np.isnan(self.seconds) and np.isnan(self.rival))


def rivals(data: xr.Dataset) -> list[str]:
    """The variants of the rival, one a chart that it has."""
    return [name for name in ranking.ranked(data) if split_name(name)[0] == RIVAL]


def compared(data: xr.Dataset) -> dict[tuple[str, int, float], Ratio]:
    """Every scene, horizon (by index) and target that is asked there; nothing without the rival."""
    if not rivals(data):
        return {}
    ratios = {}
    for scene in data["scene"].values:
        for far in range(data.sizes["horizon"]):
            cell = data.sel(scene=scene).isel(horizon=far)
            for target in leads.targets(cell):
                ratios[str(scene), far, target] = _ratio(ranking.cheapest(cell, target, implementation="compiled"))
    return ratios


def _ratio(places: list[ranking.Place]) -> Ratio:
    """The fastest of each side among the variants that meet a target, which come cheapest first."""
    sides: dict[str, ranking.Place] = {}
    for place in places:
        method = split_name(place.integrator)[0]
        sides.setdefault(RIVAL if method == RIVAL else "longer" if method in LONGER else "own", place)
    own, rival, longer = (sides.get(side) for side in ("own", RIVAL, "longer"))
    return Ratio(
        own.integrator if own else "", own.cost if own else np.nan, rival.cost if rival else np.nan,
        longer.integrator if longer else "",
    )  # fmt: skip


def headline(data: xr.Dataset, spans: list[str]) -> str:
    """How often own variants are ahead, and by how much to a fine error at each horizon; empty without the rival."""
    ratios = compared(data)
    both = {key: ratio for key, ratio in ratios.items() if np.isfinite(ratio.value)}
    if not both:
        return ""
    ahead = sum(ratio.value <= 1.0 for ratio in both.values())
    mine, theirs = (sum(ratio.alone == side for ratio in ratios.values()) for side in ("own", RIVAL))
    said = (
        f"The fastest own variant takes no more time than heyoka's {joined(rivals(data))} (double precision) in "
        f"{ahead} of {len(both)} combinations of scene, run length and error that both meet; own variants meet {mine} "
        f"more, it {theirs or 'none'}."
    )
    parts = []
    for far, span in enumerate(spans):
        fine = [1.0 / ratio.value for (_, k, target), ratio in both.items() if k == far and target <= FINE]
        if fine:
            ends = f"{min(fine):.1f} to {max(fine):.1f}"
            parts.append(f"{ends} times{' faster' * (not parts)} {span} (median of {len(fine)}: {np.median(fine):.1f})")
    said += f" To {FINE:.0e} rad and below it is {joined(parts)}." if parts else ""
    beyond = [ratio.longer for ratio in ratios.values() if ratio.neither and ratio.longer]
    return said + (f" Met by {joined(list(dict.fromkeys(beyond)))} alone: {len(beyond)}." if beyond else "")


def table(data: xr.Dataset, spans: list[str]) -> Table:
    """The ratios, with the variants that they belong to."""
    ratios = compared(data)
    rows = [
        [str(scene), span, *(_cell(ratios.get((str(scene), far, target))) for target in TARGETS)]
        for scene in data["scene"].values
        for far, span in enumerate(spans)
    ]
    return Table(
        f"The fastest own variant over heyoka's {RIVAL} in double precision, each in its fastest chart, timed in the "
        "same rounds: ratio of the times, below 1 where the own variant is ahead",
        ["scene", "horizon", *(f"axis error {target:.0e}" for target in TARGETS)],
        rows,
    )


def _cell(ratio: Ratio | None) -> str:
    if ratio is None:
        return ""
    if ratio.neither:
        return f"{ratio.longer} alone" if ratio.longer else "neither"
    if ratio.alone:
        return f"{ratio.row or RIVAL} alone{f' of double precision, beside {ratio.longer}' if ratio.longer else ''}"
    return f"{ratio.value:.2f} ({ratio.row})"
