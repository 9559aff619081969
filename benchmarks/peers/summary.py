"""What the measured peers say: a figure, a table and sentences, in the form in which studies leave theirs."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from benchmarks.kernels import ratio
from benchmarks.peers.measure import HEYOKA, OURS, PERIODS, TARGETS
from symtop.measure.timing import Timing
from symtop.report import figures, style
from symtop.runner.study import Picture, Study, Table

JUDGED = TARGETS[1:]  # the accuracies at which a verdict is given
ASKED = ("spheroid", "goldstein")  # the scenes on which SciPy is to be beaten by `WANTED`
LEVEL = 1.25  # a ratio nearer to one than this is no difference
WANTED = 100.0  # times faster than SciPy's solve_ivp
LOOKS = {
    OURS: (style.BLUE, "o", "-", 2.4),
    HEYOKA: (style.BLACK, "*", "-", 1.3),
    "rebound": (style.GREEN, "^", "-", 1.3),
    "diffrax": (style.PURPLE, "D", "-", 1.3),
    "scikit-sundae": (style.ORANGE, "s", "-", 1.3),
    "mujoco": (style.SKY, "v", "-", 1.3),
    "drake": ("#8A3C00", "P", "-", 1.3),
    "scipy": (style.VERMILLION, "X", "--", 1.3),
    "scipy-odeint": (style.VERMILLION, ".", "-", 1.0),
}


class Best(NamedTuple):
    """The cheapest setting of a package that meets a target."""

    method: str
    timing: Timing


def best_of(data: xr.Dataset, scene: str, package: str | Sequence[str], target: float) -> Best | None:
    """The fastest measured run of a package, or of several, with an error of at most `target`; None if none is."""
    cell = data.sel(scene=scene)
    cell = cell.sel(integrator=np.isin(cell["package"].values.astype(str), package))
    seconds = np.where(cell["axis"].values <= target, cell["seconds"].values, np.inf)
    if not np.isfinite(seconds).any():
        return None
    row, column = np.unravel_index(int(np.argmin(seconds)), seconds.shape)
    samples = tuple(cell["seconds_samples"].values[row, column].tolist())
    return Best(str(cell["integrator"].values[row]), Timing(samples, float(cell["first_call"].values[row, column])))


def packages(data: xr.Dataset) -> list[str]:
    """All packages but ours, in the order of the legend."""
    found = {str(name) for name in data["package"].values}
    return [name for name in LOOKS if name in found and name != OURS] + sorted(found - set(LOOKS))


def _times(seconds: float) -> str:
    for unit, size in (("s", 1.0), ("ms", 1e-3)):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds * 1e6:.3g} us"


class Standing(NamedTuple):
    """How we stand to a peer: ahead, behind, level, or not to be told from the noise."""

    word: str
    ratio: float  # their time over ours
    low: float
    high: float


def standing(mine: Best, theirs: Best) -> Standing:
    """A difference counts if it exceeds `LEVEL` and every fifth of the batches has the same sign."""
    whole, low, high = ratio(theirs.timing, mine.timing)
    if 1.0 / LEVEL <= whole <= LEVEL:
        return Standing("level", whole, low, high)
    certain = low > 1.0 or high < 1.0
    return Standing("noise" if not certain else "ahead" if whole > 1.0 else "behind", whole, low, high)


def judgement(found: Standing) -> str:
    """Who is faster, by how much, and how far to trust it."""
    if found.word == "ahead":
        return f"symtop is {found.ratio:.3g} times faster ({found.low:.3g} to {found.high:.3g})"
    if found.word == "behind":
        gain, least, most = 1.0 / found.ratio, 1.0 / found.high, 1.0 / found.low
        return f"it is {gain:.3g} times faster than symtop ({least:.3g} to {most:.3g})"
    word = "level with symtop" if found.word == "level" else "not told apart from symtop by so noisy a run"
    return f"{word} (ratio {found.ratio:.2f}, {found.low:.2f} to {found.high:.2f})"


def verdict(data: xr.Dataset) -> list[str]:
    """For each scene and accuracy: our best method against the best of every package."""
    sentences = []
    for scene in data["scene"].values:
        for target in JUDGED:
            mine = best_of(data, str(scene), OURS, target)
            start = f"{scene}, axis error {target:.0e} over {PERIODS:g} nutations: "
            if mine is None:
                sentences.append(f"{start}no method of symtop gets there.")
                continue
            parts = [f"{mine.method} takes {_times(mine.timing.best)}"]
            for package in packages(data):
                theirs = best_of(data, str(scene), package, target)
                parts.append(
                    f"{package} does not get there"
                    if theirs is None
                    else f"{theirs.method} {_times(theirs.timing.best)}, {judgement(standing(mine, theirs))}"
                )
            sentences.append(start + "; ".join(parts) + ".")
    return [*_wins(data), *sentences]


def _wins(data: xr.Dataset) -> list[str]:
    """Whether the best kernel of symtop's own is ahead of every compiled peer, after what `_scipy` says."""
    sorted_by: dict[str, list[str]] = {"ahead": [], "level": [], "behind": [], "noise": []}
    for scene in data["scene"].values:
        for target in JUDGED:
            mine = best_of(data, str(scene), OURS, target)
            for package in packages(data):
                theirs = best_of(data, str(scene), package, target)
                if mine is not None and theirs is not None and not package.startswith("scipy"):
                    sorted_by[standing(mine, theirs).word].append(f"{theirs.method} on {scene} at {target:.0e}")
    said = _scipy(data)
    if count := sum(map(len, sorted_by.values())):
        tails = {"level": "level with", "noise": "not told apart from", "behind": "behind"}
        parts = [f"{tail} {', '.join(sorted_by[word])}" for word, tail in tails.items() if sorted_by[word]]
        parts += [] if sorted_by["behind"] else ["no peer is ahead"]
        ahead = f"ahead in {len(sorted_by['ahead'])} of {count} comparisons"
        said.append(f"Against compiled peers the best kernel of symtop's own is {'; '.join([ahead, *parts])}.")
    return said


def _scipy(data: xr.Dataset) -> list[str]:
    """How much faster than SciPy: all that symtop offers, its own kernels alone, and beside SciPy's older interface."""
    asked = [str(name) for name in data["scene"].values if name in ASKED]
    others = [str(name) for name in data["scene"].values if name not in ASKED]
    offered = (OURS, HEYOKA)

    def span(scenes: list[str], mine: str | Sequence[str], theirs: str) -> tuple[Standing, Standing] | None:
        cells = [(scene, at) for scene in scenes for at in JUDGED]
        pairs = [(best_of(data, scene, mine, at), best_of(data, scene, theirs, at)) for scene, at in cells]
        found = sorted((standing(a, b) for a, b in pairs if a and b), key=lambda one: one.ratio)
        return (found[0], found[-1]) if found else None

    said = []
    if (all_of := span(asked, offered, "scipy")) is not None:
        least, most = all_of
        word = "at least" if least.ratio >= WANTED else f"less than the wanted {WANTED:g}, at least"
        among = ", heyoka's `taylor` among them," if HEYOKA in data["package"].values else ""
        said.append(
            f"On {' and '.join(asked)} the fastest method that symtop offers{among} is {word} {least.ratio:.3g} "
            f"({least.low:.3g} to {least.high:.3g}) and up to {most.ratio:.3g} times faster than the best of SciPy's "
            "solve_ivp."
        )
    rest = []
    for words, scenes, mine, theirs in (
        ("symtop's own kernels alone", asked, OURS, "scipy"),
        (f"on {' and '.join(others)}, all methods", others, offered, "scipy"),
        ("against SciPy's older odeint, all methods", asked, offered, "scipy-odeint"),
    ):
        if (found := span(scenes, mine, theirs)) is not None:
            rest.append(f"{words} {found[0].ratio:.3g} to {found[1].ratio:.3g}")
    return [*said, *([f"Times faster than SciPy: {'; '.join(rest)}."] if rest else [])]


def tables(data: xr.Dataset) -> list[Table]:
    """The best of every package at every target, and what every solver was given."""
    rows = []
    for scene in data["scene"].values:
        for package in [OURS, *packages(data)]:
            row = [str(scene), package]
            for target in TARGETS:
                best = best_of(data, str(scene), package, target)
                noisy = "" if best is None or best.timing.reliable else " (noisy)"
                row.append("not reached" if best is None else f"{best.method}, {_times(best.timing.best)}{noisy}")
            rows.append(row)
    given = [
        [str(data[key].sel(integrator=name).values) for key in ("package", "version")]
        + [str(name)]
        + [str(data[key].sel(integrator=name).values) for key in ("implementation", "formulation")]
        for name in data["integrator"].values
    ]
    header = ["scene", "package", *(f"axis error {target:.0e}" for target in TARGETS)]
    return [
        Table("Fastest solver of each package", header, rows),
        Table("What each solver was given", ["package", "version", "solver", "loop", "formulation"], given),
    ]


def pictures(data: xr.Dataset) -> list[Picture]:
    """Axis error against seconds: the front of each package."""
    scenes = [str(name) for name in data["scene"].values]
    figure, axes = style.panels(1, len(scenes), width=max(9.6, 4.2 * len(scenes)), height=4.2, sharey=True)
    for axis, scene in zip(axes[0], scenes, strict=True):
        for package in [*packages(data), OURS]:
            _front(axis, data.sel(scene=scene), package)
        for target in JUDGED:
            axis.axhline(target, color=style.GREY, lw=0.8, ls=(0, (5, 3)), zorder=0)
        axis.set(xscale="log", yscale="log", title=scene, xlabel="wall time of one run (s)", ylim=(3e-12, 3.0))
    axes[0][0].set_ylabel(f"largest axis error over {PERIODS:g} nutations (rad)")
    style.legend_below(figure, axes)
    mine, scipys = (best_of(data, scenes[0], package, JUDGED[-1]) for package in (OURS, "scipy"))
    gain = ""
    if mine is not None and scipys is not None:
        times = scipys.timing.best / mine.timing.best
        gain = f" On {scenes[0]} at {JUDGED[-1]:.0e} SciPy's solve_ivp needs {times:.3g} times as long."
    caption = (
        "The best that each package offers: for every accuracy its fastest solver and setting. Best is towards the "
        f"lower left; the thick line is symtop.{gain} Dashed curve: the loop around every step is Python. Dashed "
        "grey: the accuracies at which the verdict is given."
    )
    alt = "Log-log plots of axis error against wall time, one panel a scene, one curve a package."
    return [Picture("fronts", figure, caption, alt)]


def _front(axis: Any, cell: xr.Dataset, package: str) -> None:
    """The Pareto front of one package."""
    cell = cell.sel(integrator=(cell["package"] == package).values)
    seconds, error = cell["seconds"].values.ravel(), cell["axis"].values.ravel()
    keep = figures.pareto(seconds, error) & np.isfinite(seconds) & np.isfinite(error)
    order = np.argsort(seconds[keep])
    color, marker, line, width = LOOKS.get(package, (style.GREY, "x", "-", 1.3))
    ends = {"markersize": 8.0} if marker == "*" else {}
    axis.plot(
        seconds[keep][order], error[keep][order], color=color, marker=marker, ls=line, lw=width, label=package, **ends
    )


STUDY = Study(
    name="peers",
    title="Beside other libraries",
    question="What would I gain or lose by using another library for this?",
    how_to_read=(
        "The same tops, the same error, the same timing for all, in one run. A library that is handed equations gets "
        "the six quadratic ones on (e, L), without sines and poles; one that models bodies gets the body. heyoka is "
        "what symtop offers as `taylor`, so it stands by itself; the closed form does not take part. None of this says "
        "anything about a package's other uses: MuJoCo and Drake are for whole robots, and rebound is for planets."
    ),
    cases=lambda _: [],
    measure=lambda _: xr.Dataset(),
    pictures=pictures,
    tables=tables,
    verdict=verdict,
    timed=True,
)


def lines(data: xr.Dataset) -> list[str]:
    """The verdict and the first table, for a terminal."""
    table = tables(data)[0]
    rows = [table.header, *table.rows]
    widths = [max(len(row[i]) for row in rows) + 2 for i in range(len(table.header))]
    shown = ["".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
    return [*shown, "", *verdict(data)]
