"""The closed form against the fastest variant, from the times of one round: what an integrator is not needed for."""

from typing import NamedTuple

import numpy as np
import xarray as xr

from symtop.measure import ranking
from symtop.measure.settings import TARGETS
from symtop.report.sentences import joined
from symtop.runner.study import Table

from . import leads


class Beside(NamedTuple):
    """The fastest compiled variant of one scene, horizon and target, and the closed form timed in the same rounds."""

    scene: str
    far: int  # index of the horizon
    target: float
    row: str
    seconds: float  # of the variant
    closed_form: float  # seconds

    @property
    def ratio(self) -> float:
        """How many times less the closed form takes."""
        return self.seconds / self.closed_form


def compared(data: xr.Dataset) -> list[Beside]:
    """Every problem that a compiled variant solved and the closed form was timed on."""
    names = [str(name) for name in data["variant"].values if name not in ranking.ranked(data)]
    if not names:
        return []
    taken = data["seconds"].sel(variant=names)
    taken = taken.min([dim for dim in taken.dims if dim not in ("scene", "horizon")])
    pairs = []
    for (scene, far, target), won in leads.winners(data).items():
        beside = float(taken.sel(scene=scene).isel(horizon=far))
        if won is not None and np.isfinite(beside):
            pairs.append(Beside(scene, far, target, won.best.integrator, won.best.cost, beside))
    return pairs


def headline(data: xr.Dataset, spans: list[str]) -> str:
    """In how many combinations it is faster, and all ratios at each horizon; empty if the closed form was not timed."""
    pairs = compared(data)
    if not pairs:
        return ""
    faster = sum(pair.ratio > 1.0 for pair in pairs)
    parts = []
    for far, span in enumerate(spans):
        ratios = [pair.ratio for pair in pairs if pair.far == far]
        if ratios:
            parts.append(
                f"{min(ratios):.2g} to {max(ratios):.2g} (median of all {len(ratios)}: {np.median(ratios):.2g}) {span}"
            )
    return (
        f"The closed form takes less time than the fastest compiled variant in {faster} of {len(pairs)} combinations "
        f"of scene, run length and error. The variant's time over that of the closed form is {joined(parts)}. The "
        "variants are compared for what they do on problems without a closed form."
    )


def table(data: xr.Dataset, spans: list[str]) -> Table:
    """The ratios: how many times less the closed form takes than the fastest variant, by scene, horizon and target."""
    pairs = {(pair.scene, pair.far, pair.target): pair for pair in compared(data)}
    rows = [
        [str(scene), span, *(_cell(pairs.get((str(scene), far, target))) for target in TARGETS)]
        for scene in data["scene"].values
        for far, span in enumerate(spans)
    ]
    return Table(
        "The closed form beside the fastest compiled variant, timed in the same rounds: how many times less it takes",
        ["scene", "horizon", *(f"axis error {target:.0e}" for target in TARGETS)],
        rows,
    )


def _cell(pair: Beside | None) -> str:
    return "" if pair is None else f"{pair.ratio:.3g} ({pair.closed_form * 1e6:.3g} us; {pair.row})"
