"""plot(): a run, its errors, a sweep or an ensemble on an Axes of the caller's, or on a new one."""

from typing import TYPE_CHECKING, Any

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr

from symtop.core.errors import SymtopError, one_of
from symtop.measure import spread
from symtop.measure.errors import QUANTITIES, errors
from symtop.report.ensemble import bands
from symtop.report.style import look

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LEAST = 1e-17  # what is smaller is drawn here
LINES = ("-", "--", "-.", ":")  # of a sweep's scenes


def plot(
    data: xr.Dataset, ax: "Axes | None" = None, *, quantity: str = "axis", x: str | None = None,
    members: xr.Dataset | None = None,
) -> "Axes":  # fmt: skip
    """Draw a dataset of `simulate`, `errors`, `sweep` or `ensemble` and return the Axes, a new one if `ax` is None.

        a run         the error of `quantity` over time, or a variable of the run itself (``phi``, ``p_theta``, ...)
        its errors    (a dataset of `errors`) the error of `quantity` over time, and the least that can be seen
        a sweep       the largest error of `quantity` against ``step_size`` or ``tolerance``, or work where
                      some methods have one and some the other, or what `x` names: a line for each integrator, dashed
                      for further scenes
        an ensemble   quantiles over members of the error of `quantity` ("axis" or "energy") over time; `members` are
                      the tops that were run (the dataset does not hold them)

    `quantity` is one of axis, attitude, theta, energy, p_phi, p_psi. Raises SymtopError for anything else.
    """
    if not isinstance(data, xr.Dataset):
        raise SymtopError(f"data must be a dataset of simulate, sweep or ensemble, not {type(data).__name__}")
    if not isinstance(quantity, str):
        raise SymtopError(f"quantity must be the name of one, not {type(quantity).__name__}")
    drawn = _ensemble if "member" in data.dims else _sweep if "setting" in data.dims else _over_time
    if ax is None:
        ax = plt.subplots(figsize=(7.2, 4.4), layout="constrained")[1]
    if drawn is _ensemble:
        _ensemble(ax, data, quantity, members)
    elif drawn is _sweep:
        _sweep(ax, data, quantity, x)
    else:
        _over_time(ax, data, quantity)
    return ax


def _over_time(ax: "Axes", data: xr.Dataset, quantity: str) -> None:
    """A run, its errors, or the errors of somebody's trajectory, which name no integrator."""
    if "time" not in data:
        raise SymtopError("data must have the dimension time, setting or member, as simulate, sweep and ensemble give")
    times, known = data["time"].values, any(f"{name}_bound" in data for name in QUANTITIES)
    name = data.attrs.get("integrator", "")
    color = look(name).color if name else "black"
    if quantity in QUANTITIES:
        wrong = data if known else errors(data)
        if quantity not in wrong:
            shows = ", ".join(str(shown) for shown in wrong.data_vars if shown in QUANTITIES)
            raise SymtopError(f"this run does not show the {quantity}; it shows {shows}")
        ax.plot(wrong["time"].values[1:], np.maximum(wrong[quantity].values[1:], LEAST), color=color, lw=1.2)
        if known:
            ax.plot(times, np.maximum(data[f"{quantity}_bound"].values, LEAST), color="0.6", lw=0.8, ls=":")
        ax.set(yscale="log", ylabel=QUANTITIES[quantity])
    else:
        shown = {name: variable for name, variable in data.data_vars.items() if variable.dims == ("time",)}
        values = data[one_of("quantity", quantity, dict.fromkeys([*QUANTITIES, *map(str, shown)]))]
        unit = values.attrs.get("units", "")
        ax.plot(times, values.values, color=color, lw=1.2)
        ax.set_ylabel(f"{quantity} ({unit})" if unit else quantity)
    title, ended = (data.attrs.get(word, "") for word in ("title", "outcome_message"))
    ax.set(xlabel=f"time{_unit(data)}", title=f"{title}: {ended}" if ended else title)


def _unit(data: xr.Dataset) -> str:
    unit = data["time"].attrs.get("units", "")
    return f" ({unit})" if unit else ""


def _sweep(ax: "Axes", data: xr.Dataset, quantity: str, x: str | None) -> None:
    one_of("quantity", quantity, [name for name in QUANTITIES if name in data])
    if "integrator" in data.coords:  # a sweep of version 0.2
        data = data.rename(integrator="variant")
    for dim in ("scene", "variant"):
        if dim not in data.coords:
            raise SymtopError(f"a sweep must have the {dim}s that it compares, as sweep gives them, not lack {dim}")
        if dim not in data.dims:  # of one alone, as isel leaves it
            data = data.expand_dims(dim)
    controls = [name for name in ("step_size", "tolerance") if name in data and data[name].notnull().any()]
    x = x or (controls[0] if len(controls) == 1 else "force_evaluations")
    x = one_of("x", x, [str(name) for name, values in data.data_vars.items() if _can_be_x(values)])
    for number, scene in enumerate(data["scene"].values):
        for name in data["variant"].values:
            cell = data.sel(scene=scene, variant=name)
            across = cell[x].values
            good = np.isfinite(across) & np.isfinite(cell[quantity].values)
            if not good.any():
                continue
            order = np.argsort(across[good])
            row = str(name) if "chart" not in cell or str(name).endswith("]") else f"{name}[{cell['chart'].item()}]"
            label = row if data.sizes["scene"] == 1 else f"{row} on {scene}"
            ax.plot(
                across[good][order], np.maximum(cell[quantity].values[good][order], LEAST), LINES[number % len(LINES)],
                color=look(str(name)).color, marker=look(str(name)).marker, ms=4.5, lw=1.2, label=label,
            )  # fmt: skip
    ax.set(xscale="log", yscale="log", ylabel=f"largest {QUANTITIES[quantity]}", xlabel=x.replace("_", " "))
    ax.legend(fontsize=8, frameon=False)


def _can_be_x(values: xr.DataArray) -> bool:
    """Has it a number for each run of a sweep?"""
    return values.dtype.kind in "iuf" and {*values.dims} == {"scene", "variant", "setting"}


def _ensemble(ax: "Axes", data: xr.Dataset, quantity: str, members: Any) -> None:
    if not isinstance(members, xr.Dataset):
        raise SymtopError("plot needs members, the tops of the ensemble, to compare it with the exact motion")
    bands(ax, members, data, one_of("quantity", quantity, spread.QUANTITIES))
    ax.set_title(f"{data.attrs['integrator']} on {data.sizes['member']} tops")
