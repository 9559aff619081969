"""The peers as a study of the report: its question, its figure, its words, and where and when it was measured."""

from typing import Any

import numpy as np
import xarray as xr

from benchmarks.measured import sentence
from benchmarks.peers import distributions, summary
from benchmarks.peers.measure import HEYOKA, OURS, PERIODS
from benchmarks.peers.summary import ENGINES, JUDGED, NAMES
from symtop.report import figures, style
from symtop.runner.study import Picture, Study

THIN = 1.3
LOOKS = {  # color, marker, line, width
    OURS: (style.BLUE, "o", "-", 2.6),
    HEYOKA: (style.BLACK, "*", "-", THIN),
    "rebound": (style.GREEN, "^", "-", THIN),
    "arkode-sprk": (style.SKY, "v", "-", THIN),
    "cvode": (style.ORANGE, "s", "-", THIN),
    "scikit-sundae": (style.ORANGES[1], "<", ":", THIN),
    "diffrax": (style.PURPLE, "D", "-", THIN),
    "scipy-odeint[axis], numba": (style.REDS[1], "P", "-", THIN),
    "scipy[axis], Python": (style.REDS[2], "o", "--", THIN),
    "scipy[angles], Python": (style.REDS[2], "h", ":", THIN),
    "scipy[axis], numba": (style.VERMILLION, "X", "-", THIN),  # over the one in Python, which is as fast
}
LEAST_SHOWN = 5e-15  # rad: below all that was measured
LEFT_OUT = ("scipy[angles], numba", "scipy-odeint[axis], Python", *ENGINES)


def pictures(data: xr.Dataset) -> list[Picture]:
    """Axis error against seconds: the front of each group, in both calls."""
    scenes = [str(name) for name in data["scene"].values]
    known = summary.groups(data)
    names = [name for name in dict.fromkeys([*LOOKS, *known]) if name in known and name not in LEFT_OUT]
    figure, axes = style.panels(len(NAMES), len(scenes), height=2.5, sharey=True, sharex=True)
    for row, (call, words) in zip(axes, NAMES.items(), strict=True):
        for axis, scene in zip(row, scenes, strict=True):
            for name in names:
                _front(axis, data.sel(call=call, scene=scene, integrator=known[name]), name)
            for target in JUDGED:
                axis.axhline(target, color=style.GREY, lw=0.8, ls=(0, (5, 3)), zorder=0)
            axis.set(xscale="log", yscale="log", title=f"{words}, scene {scene}", ylim=(LEAST_SHOWN, 10.0))
            axis.label_outer()
        row[0].set_ylabel(f"largest axis error over\n{PERIODS:g} nutations (rad)")
    for axis in axes[-1]:
        axis.set_xlabel("wall time of one call (s)")
    style.few_ticks(*axes.flat, most=5)
    style.headline(figure, _message(data, known) or "Axis error against time, the best that each library offers")
    axes[0, 0].plot([], [], color=style.GREY, lw=0.8, ls=(0, (5, 3)), label="errors that the title is about")
    style.legend_below(figure, axes)
    caption = (
        "Above, the call that a user types; below, the inner loop alone; the same runs at the same settings in both. "
        f"{_gain(data, known)}Each curve is the best that a library offers: for every accuracy its fastest method and "
        "setting. Best is towards the lower left; the thick line is symtop's own kernels. Reds: SciPy, on (e, L) "
        "with a compiled right-hand side (solid) or one in Python (dashed), and in Euler angles in Python (dotted). "
        f"All others on (e, L), but arkode-sprk in angles. {PERIODS:g} nutations of each scene; dashed grey: the "
        "accuracies at which the verdict is given."
    )
    alt = "Log-log plots of axis error against wall time, a row for each call, a panel a scene, a curve a library."
    return [Picture("fronts", figure, caption, alt)]


def _gains(data: xr.Dataset, known: dict[str, list[str]]) -> list[str]:
    """How many times as long SciPy's solve_ivp takes on the same equations, in both calls; empty if one is missing."""
    theirs = known.get("scipy[axis], numba", [])
    spans = [summary.span(data, call, known.get(OURS, []), theirs) for call in NAMES]
    if not theirs or None in spans:
        return []
    return [f"{summary.printed(low)} to {summary.printed(high)} times" for low, high in spans]  # type: ignore[misc]


def _message(data: xr.Dataset, known: dict[str, list[str]]) -> str:
    """The message of the figure; empty without SciPy."""
    gains = _gains(data, known)
    if not gains:
        return ""
    return (
        f"SciPy's solve_ivp, compiled, takes {gains[0]} as long as symtop's methods for this top in a public call, "
        f"{gains[1]} as an inner loop"
    )


def _gain(data: xr.Dataset, known: dict[str, list[str]]) -> str:
    """The same as a sentence of the caption."""
    gains = _gains(data, known)
    return (
        f"SciPy's solve_ivp on the same equations takes {gains[0]} as long above, {gains[1]} below. " if gains else ""
    )


def _front(axis: Any, cell: xr.Dataset, name: str) -> None:
    """The Pareto front of one group."""
    seconds, error = cell["seconds"].values.ravel(), cell["axis"].values.ravel()
    keep = figures.pareto(seconds, error) & np.isfinite(seconds) & np.isfinite(error)
    order = np.argsort(seconds[keep])
    color, marker, line, width = LOOKS.get(name, (style.GREY, "x", "-", THIN))
    size = 8.0 if marker == "*" else 4.5
    axis.plot(
        seconds[keep][order], error[keep][order],
        color=color, marker=marker, ls=line, lw=width, label=name, markersize=size,
        zorder=4 if name == OURS else 3,
    )  # fmt: skip


def measured(data: xr.Dataset) -> str:
    """When, where and with which versions, in a sentence."""
    pairs = zip(data["package"].values.astype(str), data["version"].values.astype(str), strict=True)
    wheels = distributions()
    versions = {wheels.get(name, name): version for name, version in pairs if name not in (OURS, HEYOKA)}
    return sentence(data.attrs, "make peers", versions)


STUDY = Study(
    name="peers",
    title="Beside other libraries",
    question="What would I gain or lose by using another library for this, as its user and as its author?",
    how_to_read=summary.HOW_TO_READ,
    cases=lambda _: [],
    measure=lambda _: xr.Dataset(),
    pictures=pictures,
    tables=summary.tables,
    verdict=summary.verdict,
    timed=True,
)
