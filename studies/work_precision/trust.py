"""How far the times of the work-precision study can be trusted."""

from typing import NamedTuple

import numpy as np
import xarray as xr

from symtop.runner.study import Table

from . import leads
from .leads import AGAIN, MISSED


class Trust(NamedTuple):
    """What is known of the times."""

    timed: int
    forecast: int  # of them, those that the variant's other times predict; it takes two others
    rounds: int  # the least of a time
    measured: float  # the share of the times that are the smallest sample of that very run
    miss: float  # median difference from the time that the variant's other times predict
    differing: int  # times that differ by more than `MISSED`, though they were taken again
    noisy: int  # times without a second sample within `AGAIN` of the smallest
    margins: tuple[float, float]  # the least ratio that counts as a lead: the range over scenes and horizons


def measured(data: xr.Dataset) -> float:
    """The share of the times that are the smallest of the samples that were taken of that very run."""
    taken = data["seconds"].values
    shown = np.isfinite(taken)
    least = data["seconds_samples"].min("batch").transpose(*data["seconds"].dims).values
    return float((taken[shown] == least[shown]).mean()) if shown.any() else 1.0


def trust(data: xr.Dataset) -> Trust:
    """What is known of the times of a dataset."""
    times = data[["seconds", "seconds_forecast", "seconds_samples"]]
    taken = times["seconds"]
    rounds = times["seconds_samples"].notnull().sum("batch").where(taken.notnull())
    miss = abs(taken / times["seconds_forecast"] - 1.0)
    samples = np.sort(times["seconds_samples"].transpose(..., "batch").values, axis=-1)
    margins = [
        leads.margin(times.sel(scene=name).isel(horizon=far))
        for name in data["scene"].values
        for far in range(data.sizes["horizon"])
    ]
    return Trust(
        int(taken.notnull().sum()), int(miss.notnull().sum()), int(rounds.min()), measured(data), float(miss.median()),
        int((miss > MISSED).sum()),
        int((samples[..., 1] > (1.0 + AGAIN) * samples[..., 0]).sum()), (min(margins), max(margins)),
    )  # fmt: skip


def sentence(data: xr.Dataset) -> str:
    """How far a time can be trusted, and from which ratio on a lead counts."""
    known = trust(data)
    least, most = known.margins
    rest = known.timed - known.forecast
    return (
        f"{known.forecast} of the {known.timed} times were compared with the one that the variant's other times "
        f"predict: the median difference is {known.miss:.1%}."
        f"{f' The other {rest} belong to variants with too few times to predict one.' if rest else ''}"
        f" A lead counts as larger than the noise only from a ratio of {least:.2f} to {most:.2f} on, by scene and run "
        "length."
    )


def table(data: xr.Dataset) -> Table:
    """The numbers behind it, with the rules for the times that are in doubt."""
    known = trust(data)
    least, most = known.margins
    rule = "by scene and horizon: 1 plus twice the difference that nine of ten times stay within, and at least"
    rows = [
        ["runs that ended well", str(int((data["outcome"] == "ok").sum())), ""],
        ["runs of these that were timed", str(known.timed), "only these are shown against seconds"],
        ["times of these with a predicted one beside them", str(known.forecast),
         "the others have fewer than two times of their variant and scene beside them, and were taken again"],
        ["rounds of a time, at least", str(known.rounds), "each is with the other variants of its scene"],
        ["share of the times that are measured", f"{known.measured:.0%}", "none is computed from others"],
        ["median difference from the predicted time", f"{known.miss:.1%}", "predicted from the variant's other times"],
        [f"times that differ from it by more than {MISSED:.0%}", str(known.differing),
         "they were taken again, and lead only if the predicted time leads, too"],
        [f"times without a second sample within {AGAIN:.0%} of the smallest", str(known.noisy),
         "no lead of theirs, or over them, counts"],
        ["least ratio of two times that counts as a lead", f"{least:.2f} to {most:.2f}",
         f"{rule} {leads.MARGIN:g}"],
    ]  # fmt: skip
    return Table("How far the times can be trusted", ["what", "value", "rule"], rows)
