"""Figures of runs: on the caller's Axes (`plot`), or as a file of one run, a comparison or an ensemble.

a run        its motion and the true one, its errors, and the residuals of constants of the motion
a sweep      the largest error against the setting or the run time; a comparison likewise
an ensemble  quantiles of the errors of its members over time
"""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr

from symtop.core.errors import SymtopError, at_home, one_of, shown
from symtop.measure.conservation import residuals
from symtop.measure.errors import QUANTITIES, errors, quantity_words
from symtop.measure.sweep import failed_setting, period_word, titled
from symtop.model.charts import Array
from symtop.model.scenes import Scene
from symtop.report import spread, style
from symtop.report.figures import SMALLEST, error_band, name_ends
from symtop.report.style import BLACK, BLUE, GREEN, GREY, LEAST_TEXT, ORANGE, PURPLE, SKY, VERMILLION
from symtop.run.trajectory import Trajectory

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LINES = ("-", "--", "-.", ":")  # line styles of the scenes of a sweep
AXES = {"seconds": "time of a run, one core (s)", "force_evaluations": "force evaluations of a run"}
COLORS = {"axis": BLACK, "attitude": GREY, "theta": SKY, "energy": VERMILLION, "p_phi": GREEN, "p_psi": PURPLE}
BANDS = ((0, 4, 0.18), (1, 3, 0.38))  # bands from 1 to 99 % and 10 to 90 %: indices in `spread.LEVELS`, opacity
LARGEST_DRAWN = {"axis": np.pi, "attitude": np.pi, "energy": 1e3}  # larger ones, and those of failed members


def plot(
    data: xr.Dataset, ax: "Axes | None" = None, *, quantity: str = "axis", x: str | None = None,
    members: xr.Dataset | None = None,
) -> "Axes":  # fmt: skip
    """Draw a dataset of `simulate`, `errors`, `sweep`, `compare` or `ensemble`; return the Axes, new if `ax` is None.

        a run         the error of `quantity` over time, or a variable of the run itself (``phi``, ``p_theta``, ...)
        its errors    (a dataset of `errors`) the error of `quantity` over time, and the least that can be judged
        a sweep       the largest error of `quantity` against the variable `x`, by default the run time if it was
                      measured, else ``step_size`` or ``tolerance``, or work if some methods have one and some the
                      other: a line for each variant, dashed for further scenes; crosses are failed runs, the grey band
                      is below the reference's error bound
        a comparison  the same for one scene, of the compared quantity, with the time of the exact motion
        an ensemble   quantiles over members of the error of `quantity` ("axis", for bodies "attitude", or "energy")
                      over time; `members` are those that were run (the dataset does not hold them)

    `quantity` is one of axis, attitude, theta, energy, p_phi, p_psi, except as above. Runs may share an `ax`: each has
    its variant as a label, for ``ax.legend()``, and there is no title. Raises SymtopError for invalid arguments.
    """
    if not isinstance(data, xr.Dataset):
        raise SymtopError(f"data must be a dataset of simulate, sweep or ensemble, not {type(data).__name__}")
    if not isinstance(quantity, str):
        raise SymtopError(f"quantity must be the name of one, not {type(quantity).__name__}")
    if ax is None:
        ax = plt.subplots(figsize=(7.2, 4.4), layout="constrained")[1]
    if not hasattr(ax, "get_lines"):
        raise SymtopError(f"ax must be Axes of matplotlib, not {shown(ax)}; a quantity is given by name, quantity=")
    if "member" in data.dims:
        _ensemble(ax, data, quantity, members)
    elif "setting" in data.dims:
        _sweep(ax, data, quantity, x)
    else:
        _over_time(ax, data, quantity)
    return ax


def _over_time(ax: "Axes", data: xr.Dataset, quantity: str) -> None:
    """Draw a run, its errors, or the errors of a foreign trajectory, which have no integrator's name."""
    if "time" not in data:
        raise SymtopError("data must have the dimension time, setting or member, as simulate, sweep and ensemble give")
    times, has_bounds = data["time"].values, any(f"{name}_bound" in data for name in QUANTITIES)
    name, chart, several = data.attrs.get("integrator", ""), data.attrs.get("chart", ""), bool(ax.get_lines())
    color = style.look(name).color if name else "black"
    label = name if name.endswith("]") or not chart else f"{name}[{chart}]"
    options: dict[str, Any] = {"color": color, "lw": 1.2, "label": label or None}
    if quantity in QUANTITIES:
        table = data if has_bounds else errors(data)
        if quantity not in table:
            names = ", ".join(str(key) for key in table.data_vars if key in QUANTITIES)
            raise SymtopError(f"this run does not show the {quantity}; it shows {names}")
        marker = "o" if times.size == 2 else None  # a line has two points at least
        sizes = np.maximum(table[quantity].values[1:], SMALLEST)
        ax.plot(table["time"].values[1:], sizes, marker=marker, **options)
        if has_bounds:
            ax.plot(times, np.maximum(data[f"{quantity}_bound"].values, SMALLEST), color="0.6", lw=0.8, ls=":")
        ax.set(yscale="log", ylabel=quantity_words(table, quantity))
    else:
        variables = {name: variable for name, variable in data.data_vars.items() if variable.dims == ("time",)}
        values = data[one_of("quantity", quantity, dict.fromkeys([*QUANTITIES, *map(str, variables)]))]
        unit = values.attrs.get("units", "")
        ax.plot(times, values.values, **options)
        ax.set_ylabel(f"{quantity} ({unit})" if unit else quantity)
    title, outcome = (data.attrs.get(word, "") for word in ("title", "outcome_message"))
    words = f"{title}: {outcome}" if outcome else title
    ax.set(xlabel=_time_label(data), title="" if several else words)  # a title would name only one of several


def _time_label(data: xr.Dataset) -> str:
    """The label of the axis of time, with its unit on a scene that has units."""
    return "time (s)" if data["time"].attrs.get("units") == "s" else "time"


def _sweep(ax: "Axes", data: xr.Dataset, quantity: str, x: str | None) -> None:
    quantity = data.attrs.get("quantity", quantity) if quantity == "axis" else quantity
    one_of("quantity", quantity, [name for name in QUANTITIES if name in data])
    if "integrator" in data.coords:  # a sweep of version 0.2
        data = data.rename(integrator="variant")
    for dim in ("scene", "variant"):
        if dim not in data.coords:
            raise SymtopError(f"a sweep must have the {dim}s that it compares, as sweep gives them, not lack {dim}")
        if dim not in data.dims:  # a single one, as after `isel`
            data = data.expand_dims(dim)
    controls = [name for name in ("step_size", "tolerance") if name in data and data[name].notnull().any()]
    timed, compared = "seconds" in data and bool(data["seconds"].notnull().any()), "cost" in data.attrs
    x = x or ("seconds" if timed else controls[0] if len(controls) == 1 and not compared else "force_evaluations")
    numbers = {name: values for name, values in data.data_vars.items() if values.dtype.kind in "iuf"}
    of_runs = [str(name) for name, values in numbers.items() if {*values.dims} == {"scene", "variant", "setting"}]
    x = one_of("x", x, of_runs)
    words = AXES.get(x, x.replace("_", " "))
    ax.set(xscale="log", yscale="log", ylabel=f"largest {quantity_words(data, quantity)}", xlabel=words)
    ends, level = {}, error_band(ax, data[f"{quantity}_bound"].values)
    edge: dict[str, Any] = {"transform": ax.get_xaxis_transform(), "clip_on": False, "zorder": 3}
    for number, scene in enumerate(data["scene"].values):
        for name in map(str, data["variant"].values):
            cell = data.sel(scene=scene, variant=name)
            variant = name if "chart" not in cell or name.endswith("]") else f"{name}[{cell['chart'].item()}]"
            options = style.line(variant) | ({"ls": LINES[number % len(LINES)]} if data.sizes["scene"] > 1 else {})
            label = titled(cell.assign_coords(variant=variant))
            label = label if data.sizes["scene"] == 1 else f"{label} on {scene}"
            xs, errors = cell[x].where(cell[x] > 0).values, np.maximum(cell[quantity].values, SMALLEST)
            valid = np.flatnonzero(np.isfinite(xs) & np.isfinite(errors))
            valid = valid if compared else valid[np.argsort(xs[valid])]  # a comparison is in order of its settings
            ax.plot(xs[valid], errors[valid], lw=1.4, label=label, **options)
            failed = xs[(cell["outcome"].values != "ok") & np.isfinite(xs)]
            ax.scatter(failed, np.full(failed.size, 0.985), 22.0, options["color"], marker="x", lw=1.0, **edge)
            last = valid[np.argmin(errors[valid])] if valid.size else 0
            point = (xs[last], errors[last]) if valid.size else (np.nanmax(data[x].values, initial=1e-300), np.pi)
            note = "" if np.isfinite(xs).any() else f"no {x.replace('_', ' ')}"
            failure = failed_setting(cell).partition(",")[0] or note
            ends[f"{label}: {failure}" if failure else label] = (*map(float, point), options["color"])
    ax.set_ylim(bottom=0.1 * level)
    if compared:
        count, end = f"{data.attrs['nutations']:.3g}", data.attrs["horizon"]
        runs = f"{count} {period_word(data)}{'s' * (count != '1')}" if count != "0" else f"t = {end:g}"
        ax.set_title(f"{data['scene'].item()}, {runs}", loc="left", weight="bold")
        if x == "seconds" and data["exact_seconds"].notnull():
            ax.axvline(exact := data["exact_seconds"].item(), color="0.35", ls=(0, (1, 2)), lw=1.0)
            ax.text(exact, 0.015, " exact motion", size=LEAST_TEXT, transform=edge["transform"])  # no line is so low
    name_ends(ax, ends)


def _ensemble(ax: "Axes", data: xr.Dataset, quantity: str, members: Any) -> None:
    if not isinstance(members, xr.Dataset):
        raise SymtopError("plot needs members, the tops of the ensemble, to compare it with the exact motion")
    if "horizon" not in data or "chart" not in data.attrs:
        raise SymtopError("data over member must be a dataset of ensemble, with its horizons and attributes")
    _bands(ax, data, quantity, spread.member_errors(members, data, quantity))
    ax.set_title(f"{data.attrs['integrator']} on {spread.so_many(data.sizes['member'], spread.kind_of(data))}")


def draw_run(scene: Scene, run: xr.Dataset, truth: xr.Dataset, errors: xr.Dataset, path: str | Path) -> None:
    """Draw three panels to a file: theta and the true theta, errors of angles, residuals of energy and momenta."""
    figure, axes = style.panels(3, 1, height=1.7, sharex=True)
    times = run["time"].values
    motion, angles, constants = axes[:, 0]
    motion.plot(times, np.degrees(truth["theta"].values), color=ORANGE, lw=2.4, alpha=0.6, label="true theta")
    motion.plot(times, np.degrees(run["theta"].values), color=BLUE, lw=1.0, label=f"theta of {run.attrs['integrator']}")
    motion.set_ylabel("theta (degrees)")
    style.headline(figure, f"{run.attrs['title']}: {run.attrs['outcome_message']}")
    for name in ("axis", "attitude", "theta"):
        if name in errors:
            _line(angles, times, errors[name].values, COLORS[name], QUANTITIES[name])
    for name, values in residuals(scene, Trajectory.of_data(run)).items():
        _line(constants, times, np.abs(values), COLORS[name], f"residual of {name}, relative")
    angles.set(yscale="log", ylabel="error (rad)")
    constants.set(yscale="log", ylabel="|change| since the start", xlabel=_time_label(run))
    if run.attrs["outcome"] != "ok":
        for axis in axes[:, 0]:
            axis.axvline(run.attrs["reached_time"], color=VERMILLION, ls="--", label="stopped here")
    style.legend_below(figure, axes)
    style.save(figure, at_home(path))


def _line(axis: Any, times: Any, values: Any, color: str, label: str) -> None:
    valid = np.isfinite(values[1:])
    if valid.any():  # a logarithmic axis cannot show a line of NaN only
        marker = "o" if valid.sum() == 1 else None  # a line has two points at least
        axis.plot(times[1:], np.maximum(values[1:], SMALLEST), color=color, lw=1.0, label=label, marker=marker)


def draw_ensemble(data: xr.Dataset, errors: dict[str, Array], path: str | Path) -> None:
    """Draw a panel for each error of an ensemble to a file: quantiles of `member_errors` (n, samples) against time."""
    panels = {name: values for name, values in errors.items() if not np.isnan(values).all()} or errors
    figure, axes = style.panels(len(panels), 1, height=2.1, sharex=True)
    for axis, (name, values) in zip(axes[:, 0], panels.items(), strict=True):
        _bands(axis, data, name, values)
        axis.label_outer()
    share = (data["outcome"] == "ok").mean().item()
    members = spread.so_many(data.sizes["member"], spread.kind_of(data))
    sentence = (
        f"{data.attrs['integrator']} on {members}: errors against the true motion; "
        f"{100.0 * share:.4g} % of the runs ended ok"
    )
    if share < 1.0:
        sentence += ", and those that failed count as infinitely wrong, at the upper edge"
    if missing := max(np.isnan(values).all(axis=1).sum() for values in errors.values()):
        sentence += f"; the angle is without {missing}, whose motion is not known"
    style.headline(figure, sentence)
    style.save(figure, at_home(path))


def _bands(axis: Any, data: xr.Dataset, quantity: str, values: Array) -> None:
    """Draw quantiles over members of an error against time, at the places of `symtop.report.spread.at_places`.

    The median is a line, with two bands about it, labelled at their right ends. Errors beyond `LARGEST_DRAWN` are drawn
    there; the label of a quantile says if it is of failed runs. If all members have equally many steps per nutation, a
    sample at a whole nutation is one for all of them, and periodic energy errors, as of a symplectic method, show a dip
    there.
    """
    horizons = data["horizon"].values
    shared = (horizons == horizons[0]).all()
    positions, values = spread.at_places(data, values)
    quantiles = spread.spread(values)
    valid = np.isfinite(positions) & ~np.isnan(quantiles).any(axis=0) & (positions > 0.0)
    if not valid.any():
        raise SymtopError("there is nothing to draw: the true motion of no member is known")
    times, errors = (positions * (horizons[0] if shared else 1.0))[valid], quantiles[:, valid]
    limit, color = LARGEST_DRAWN[quantity], style.look(data.attrs["integrator"]).color
    quantiles = np.clip(errors, SMALLEST, limit)
    for low, high, alpha in BANDS:
        axis.fill_between(times, quantiles[low], quantiles[high], color=color, alpha=alpha, lw=0.0)
    marker = "o" if times.size == 1 else None  # a line has two points at least
    axis.plot(times, quantiles[spread.LEVELS.index(0.5)], color=color, lw=1.8, marker=marker)
    if np.isinf(errors).any():
        axis.plot(times[[0, -1]], [limit, limit], color="0.4", lw=0.8, ls=":")
    names = ["median" if level == 0.5 else f"{100.0 * level:g} %" for level in spread.LEVELS]
    ends = {f"{name}: failed" if np.isinf(error) else name: (float(times[-1]), float(height), color)
            for name, error, height in zip(names, errors[:, -1], quantiles[:, -1], strict=True)}  # fmt: skip
    label = "time" if shared else "time, as a fraction of each member's horizon"
    words = spread.QUANTITIES[spread.kind_of(data)][quantity]
    axis.set(xlim=(0.0, times[-1]), yscale="log", ylabel=words, xlabel=label)
    name_ends(axis, ends)


def draw_compare(data: xr.Dataset, path: str | Path) -> None:
    """Draw the figure of a comparison to a file."""
    figure, axes = style.panels(1, 1, height=3.6)
    _sweep(axes[0, 0], data, "axis", None)
    style.save(figure, at_home(path))
