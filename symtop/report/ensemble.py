"""An ensemble as a picture: how the errors of its members spread as time goes on."""

from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from symtop.core.errors import SymtopError, at_home
from symtop.measure.spread import LEVELS, QUANTITIES, at_places, member_errors, spread
from symtop.report.style import LEAST_TEXT, headline, look, panels, save

LEAST = 1e-16  # what is smaller is drawn here
BANDS = ((0, 4, 0.18, "1 to 99 %"), (1, 3, 0.38, "10 to 90 %"))  # of `LEVELS`, and how opaque
MOST = {"axis": np.pi, "energy": 1e3}  # what is larger, and members that failed, are drawn here
FAILED = "failed"  # beside a quantile that is drawn there because runs have failed


def draw(members: xr.Dataset, data: xr.Dataset, path: str | Path) -> Path:
    """Two panels into a PNG: quantiles over members of the axis error and of the energy error against time."""
    shown = [name for name in QUANTITIES if name in data]
    figure, axes = panels(len(shown), 1, height=2.1, sharex=True)
    for axis, name in zip(axes[:, 0], shown, strict=True):
        bands(axis, members, data, name)
        axis.label_outer()
    ended = (data["outcome"] == "ok").mean().item()
    sentence = (
        f"{data.attrs['integrator']} on {data.sizes['member']} tops: errors against the closed form; "
        f"{100.0 * ended:.4g} % of the runs ended ok"
    )
    if ended < 1.0:
        sentence += ", and those that failed count as infinitely wrong, at the upper edge"
    headline(figure, sentence)
    target = at_home(path)
    save(figure, target)
    return target


def bands(axis: Any, members: xr.Dataset, data: xr.Dataset, quantity: str) -> None:
    """Quantiles over members of an error against time, on one Axes, at places of `symtop.measure.spread.at_places`.

    Errors beyond `MOST` are drawn there: angles do not exceed pi, and a quantile of runs that failed is named so. Where
    all members have as many steps a nutation, a sample at a whole nutation is one for all of them, and energy errors
    that return there, as those of a symplectic method do, dip: that is no error of the samples, which are dithered.
    """
    horizons = data["horizon"].values
    shared = (horizons == horizons[0]).all()
    places, errors = at_places(data, member_errors(members, data, quantity))
    quantiles = spread(errors)
    known = np.isfinite(places) & ~np.isnan(quantiles).any(axis=0) & (places > 0.0)
    if not known.any():
        raise SymtopError("there is nothing to draw: the closed form of no member is known")
    times, quantiles = (places * (horizons[0] if shared else 1.0))[known], quantiles[:, known]
    _bands(axis, times, quantiles, MOST[quantity], look(data.attrs["integrator"]).color)
    label = "time" if shared else "time, as a fraction of each member's horizon"
    axis.set(yscale="log", ylabel=QUANTITIES[quantity], xlabel=label)


def _bands(axis: Any, times: Any, errors: Any, most: float, color: str) -> None:
    """The median as a line and two bands about it, labelled at their right ends."""
    quantiles = np.clip(errors, LEAST, most)
    for low, high, opaque, _ in BANDS:
        axis.fill_between(times, quantiles[low], quantiles[high], color=color, alpha=opaque, lw=0.0)
    marker = "o" if times.size == 1 else None  # a line has two points at least
    axis.plot(times, quantiles[LEVELS.index(0.5)], color=color, lw=1.8, marker=marker)
    names = [
        (f"{100.0 * level:g} %" if level != 0.5 else "median") + (f": {FAILED}" if np.isinf(end) else "")
        for level, end in zip(LEVELS, errors[:, -1], strict=True)
    ]
    if np.isinf(errors).any():
        axis.plot(times[[0, -1]], [most, most], color="0.4", lw=0.8, ls=":")
    ends, place = np.log10(quantiles[:, -1]), -np.inf
    least = 0.045 * max(np.ptp(np.log10(quantiles)), 1.0)  # labels do not overlap
    for end, name in zip(ends, names, strict=True):
        place = max(end, place + least)
        axis.annotate(
            name, (times[-1], 10.0**place), xytext=(5, 0), textcoords="offset points", fontsize=LEAST_TEXT, va="center"
        )
    axis.set_xlim(0.0, times[-1] * 1.07)
