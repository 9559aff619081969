"""What the measured peers say: tables and sentences, in the form in which studies leave theirs.

A *group* is what is compared: a package, with its chart and the language of its right-hand side where it has several.
"""

import itertools
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from benchmarks.pages import Table
from benchmarks.peers.measure import HEYOKA, OURS, PERIODS, SHOWN, TARGETS
from symtop.measure.timing import Timing
from symtop.methods.framework.registry import methods
from symtop.report.formats import listed, number

JUDGED = TARGETS[1:]  # the accuracies at which a verdict is given
NAMES = {"public": "public call", "inner": "inner loop"}
SHORT = {"Python": "Python", "numba, called through Python": "numba", "numba, called from C": "C"}
ENGINES = ("mujoco", "drake")  # model bodies, not equations
NOTES = [  # what a number of a library rests on
    ["simulate", "also computes energy, momenta and angles; it has its defaults and observe=axis"],
    ["symtop with heyoka", "`taylor`, heyoka's stepper called by symtop"],
    ["solve_ivp", "its set-up cannot be taken out of its call"],
    ["CVODE", "that of SUNDIALS 7.9 in scikit-sundae's wheel"],
    ["ARKODE", "the symplectic stepper of SUNDIALS 7.3 in SundialsPy's wheel, which does not wrap it"],
    ["sundials4py", "SUNDIALS' own wrapper has wheels from Python 3.12 on"],
    ["rebound", "IAS15 has no user-defined ODEs and gets the axis as a particle"],
    ["MuJoCo, Drake", "model bodies of any kind and are not in the figure"],
]  # fmt: skip


class Best(NamedTuple):
    """The cheapest setting of a group that meets a target."""

    row: str
    timing: Timing
    steps: float


def groups(data: xr.Dataset) -> dict[str, list[str]]:
    """Variants by group: ours first, then heyoka's, then by package."""
    packages = data["package"].values.astype(str).tolist()
    kinds = list(zip(packages, data["chart"].values.astype(str), data["language"].values.astype(str), strict=True))
    several = {name for name in packages if len({kind for kind in kinds if kind[0] == name}) > 1} - {OURS, HEYOKA}
    variants: dict[str, list[str]] = {}
    for kind, row in zip(kinds, data["variant"].values.astype(str).tolist(), strict=True):
        package, chart, language = kind
        name = f"{package}[{chart}], {SHORT.get(language, language)}" if package in several else package
        variants.setdefault(name, []).append(row)
    return {name: variants[name] for name in sorted(variants, key=lambda name: (name != OURS, name != HEYOKA, name))}


def best_of(data: xr.Dataset, call: str, scene: str, rows: Sequence[str], target: float, least: int = 0) -> Best | None:
    """The fastest run of some variants with an error of at most `target`, and `least` steps; None if none is."""
    cell = data.sel(call=call, scene=scene, variant=list(rows))
    good = (cell["axis"].values <= target) & (cell["steps"].values >= least)
    seconds = np.where(good, cell["seconds"].values, np.inf)
    seconds[np.isnan(seconds)] = np.inf
    if not np.isfinite(seconds).any():
        return None
    row, column = np.unravel_index(int(np.argmin(seconds)), seconds.shape)
    samples = tuple(cell["seconds_samples"].values[row, column].tolist())
    timing = Timing(samples, float(cell["first_call"].values[row, column]))
    return Best(str(cell["variant"].values[row]), timing, float(cell["steps"].values[row, column]))


def standing(mine: Best, theirs: Best) -> str:
    """Whether all batches of the one are faster than all of the other, however little: ahead, behind or level."""
    ours, others = mine.timing.samples, theirs.timing.samples
    return "ahead" if max(ours) < min(others) else "behind" if max(others) < min(ours) else "level"


def shown(seconds: float) -> str:
    """A time with its unit."""
    for unit, size in (("s", 1.0), ("ms", 1e-3)):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds * 1e6:.3g} us"


def both(
    data: xr.Dataset, call: str, mine: Sequence[str], theirs: Sequence[str], least: int = 0
) -> list[tuple[str, Best, Best]]:
    """Our best, of at least so many steps, and theirs, on every scene and at every judged accuracy that both reach."""
    return [
        (f"{scene} at {number(target)}", ours, rival)
        for scene, target in itertools.product(data["scene"].values.astype(str), JUDGED)
        if (ours := best_of(data, call, scene, mine, target, least)) is not None
        and (rival := best_of(data, call, scene, theirs, target)) is not None
    ]


def ratios(data: xr.Dataset, call: str, mine: Sequence[str], theirs: Sequence[str], least: int = 0) -> list[float]:
    """Their times over ours."""
    return [rival.timing.best / ours.timing.best for _, ours, rival in both(data, call, mine, theirs, least)]


def span(
    data: xr.Dataset, call: str, mine: Sequence[str], theirs: Sequence[str], least: int = 0
) -> tuple[float, float] | None:
    """The least and the largest ratio, their time over ours, over scenes and judged accuracies."""
    values = ratios(data, call, mine, theirs, least)
    return (min(values), max(values)) if values else None


def printed(value: float) -> str:
    """A ratio of times as it is printed: ``1.06``, ``23.4``, ``1,110``."""
    return f"{value:.3g}" if value < 100.0 else f"{float(f'{value:.3g}'):,.0f}"


def range_of(ratios: tuple[float, float] | None) -> str:
    """The least and the largest ratio as they are printed."""
    return "not reached" if ratios is None else f"{printed(ratios[0])} to {printed(ratios[1])}"


def verdict(data: xr.Dataset) -> list[str]:
    """Who is ahead in each comparison; what as many samples change."""
    return [*_wins(data), *_samples(data)]


def answer(data: xr.Dataset) -> str:
    """What one gains and what one loses, before the details."""
    numbers = facts(data)
    won, lost, n = (sum(numbers[f"general_{key}_{call}"] for call in NAMES) for key in ("behind", "ahead", "compared"))
    scipy = [numbers[f"general_scipy_{call}"] for call in NAMES]
    slower = (
        f"With SciPy's solve_ivp a user waits {scipy[0]} times as long, and the inner loop of an author takes "
        f"{scipy[1]} times as long. "
    )
    return (
        "You gain equations of any kind, where symtop has tops and rigid bodies alone, and seldom speed: of "
        f"{n} comparisons with symtop's fastest on f(t, y) alone the other library is faster in {won} and slower in "
        f"{lost}. {'' if 'not reached' in scipy else slower}You lose the exact motion, by which symtop tells the error "
        "of a run, and the guard, which warns of a wrong one."
    )


def pairs(data: xr.Dataset) -> list[str]:
    """Both ratios against SciPy and heyoka; what a callback costs."""
    known = groups(data)
    scipys = sorted((name for name in known if name.partition("[")[0] == "scipy"), key=lambda name: "[angles" in name)
    sentences = [_both(data, known, name) for name in (*scipys, HEYOKA) if name in known]
    fixed = [f"All ratios: {_fixed(data)}; in angles or on (e, L) as each says."] if sentences else []
    return [*sentences, *fixed, *_callbacks(data)]


def _fixed(data: xr.Dataset) -> str:
    scenes = " and ".join(data["scene"].values.astype(str))
    return f"{scenes}, axis errors of {' and '.join(f'{target:.0e}' for target in JUDGED)}, {PERIODS:g} nutations"


def _both(data: xr.Dataset, known: dict[str, list[str]], name: str) -> str:
    """The public-call ratio beside the inner-loop ratio of one library."""
    public, inner = (span(data, call, general(data), known[name]) for call in NAMES)
    call = "`taylor` in `simulate`" if name == HEYOKA else "a user's `solve_ivp`"
    return (
        f"{name}: {call} takes {range_of(public)} times as long as `simulate` with symtop's fastest method on f(t, y) "
        f"alone; the inner loop takes {range_of(inner)} times as long as that kernel."
    )


class Score(NamedTuple):
    """Comparisons with libraries that are handed equations, at every place that both reach."""

    ahead: int
    level: int
    behind: int
    faster: list[str]  # which library, how many times as fast, and where

    @property
    def compared(self) -> int:
        """Comparisons that were made."""
        return self.ahead + self.level + self.behind


def general(data: xr.Dataset) -> list[str]:
    """Our variants that need f(t, y) alone, as a library does; the others know the free motion or this very top."""
    known = ((row, methods().get(row.partition("[")[0])) for row in groups(data).get(OURS, []))
    return [row for row, method in known if method is not None and method.needs == "derivative"]


def score(data: xr.Dataset, call: str, mine: Sequence[str]) -> Score:
    """How the fastest of some variants stands."""
    counts, faster = {"ahead": 0, "level": 0, "behind": 0}, []
    for name, rows in groups(data).items():
        if name in (OURS, HEYOKA, *ENGINES):
            continue
        for place, ours, rival in both(data, call, mine, rows):
            word = standing(ours, rival)
            counts[word] += 1
            if word == "behind":
                faster.append(f"{name} ({printed(ours.timing.best / rival.timing.best)} times, {NAMES[call]}, {place})")
    return Score(**counts, faster=faster)


def _wins(data: xr.Dataset) -> list[str]:
    """Which libraries are faster than those that need no more than a library and than our fastest, and how often."""
    lines = []
    for group, rows in (("methods on f(t, y) alone", general(data)), ("of all", groups(data).get(OURS, []))):
        scores = {words: result for call, words in NAMES.items() if (result := score(data, call, rows)).compared}
        faster = [library for tally in scores.values() for library in tally.faster]
        ahead = [f"{tally.ahead} of {tally.compared}" for tally in scores.values()]
        if scores:
            lines.append(f"{listed(faster) if faster else 'No library'} {'are' if faster[1:] else 'is'} faster than "
                        f"symtop's fastest {group} ({', '.join(fastest(data, rows))}); symtop is faster in "
                        f"{' and '.join(ahead)} comparisons ({' and '.join(scores)}), level in "
                        f"{' and '.join(str(tally.level) for tally in scores.values())}."
                        )  # fmt: skip
    return lines


def _samples(data: xr.Dataset) -> list[str]:
    """How SciPy stands to those of our public calls that return as many samples."""
    numbers = facts(data)
    words = (
        f"Where solve_ivp returns {SHOWN} samples, symtop's fastest on f(t, y) alone return one a step, "
        f"{numbers.get('samples')}: a call of solve_ivp (numba, on (e, L)) takes {numbers['general_scipy_public']} "
        f"times as long as theirs, and {numbers.get('filled')} times as long as symtop's fastest with {SHOWN} samples."
    )
    return [words] if "samples" in numbers else []


def fastest(data: xr.Dataset, rows: Sequence[str]) -> list[str]:
    """Those of some variants that are the fastest of them somewhere."""
    places = itertools.product(NAMES, data["scene"].values.astype(str), JUDGED)
    best = (best_of(data, call, scene, rows, target) for call, scene, target in places)
    return sorted({choice.row for choice in best if choice is not None})


def facts(data: xr.Dataset) -> dict[str, Any]:
    """Numbers that pages quote."""
    known, simple = groups(data), general(data)
    ours, scipy = known.get(OURS, []), known.get("scipy[axis], numba", [])
    leaders = fastest(data, ours)
    needs = [method.needs for row in leaders if (method := methods().get(row.partition("[")[0])) is not None]
    numbers: dict[str, Any] = {
        "version": data.attrs["symtop_version"], "fastest": _coded(leaders), "general": _coded(fastest(data, simple)),
        "of_this_top": bool(needs) and set(needs) == {"this-top"},
    }  # fmt: skip
    if shown := [best.steps + 1.0 for _, best, _ in both(data, "public", simple, scipy)]:
        numbers["samples"] = range_of((min(shown), max(shown)))
        numbers["filled"] = range_of(span(data, "public", ours, scipy, SHOWN - 1))
    for call in NAMES:
        numbers[f"heyoka_{call}"] = range_of(span(data, call, simple, known.get(HEYOKA, [])))
        for kind, rows in (("", ours), ("general_", simple)):
            stands = score(data, call, rows)
            numbers |= {f"{kind}{key}_{call}": getattr(stands, key) for key in ("ahead", "level", "behind", "compared")}
            numbers[f"{kind}faster_{call}"] = listed(stands.faster) if stands.faster else ""
            numbers[f"{kind}scipy_{call}"] = range_of(span(data, call, rows, scipy))
    return numbers


def _coded(rows: Sequence[str]) -> str:
    return ", ".join(f"`{row}`" for row in rows)


def _callbacks(data: xr.Dataset) -> list[str]:
    known = groups(data)
    if not {"cvode", "scikit-sundae"} <= set(known):
        return []
    times = range_of(span(data, "inner", known["cvode"], known["scikit-sundae"]))
    return [
        (
            f"CVODE takes {times} times as long where each call of its right-hand side goes through Python "
            f"(scikit-sundae's interface) as where it calls C (inner loop)."
        )
    ]


def _cells(data: xr.Dataset, scene: str, target: float, rows: Sequence[str], ours: Sequence[str]) -> list[str]:
    cells = []
    for call in NAMES:
        theirs, mine = (best_of(data, call, scene, names, target) for names in (rows, ours))
        if theirs is None:
            cells += ["", "not reached", ""]
            continue
        times = "" if mine is None else printed(theirs.timing.best / mine.timing.best)
        cells += [theirs.row, shown(theirs.timing.best) + ("" if theirs.timing.reliable else " (noisy)"), times]
    return cells


def tables(data: xr.Dataset) -> list[Table]:
    """Both comparisons side by side, group by group and variant by variant, and what every variant was given."""
    known = groups(data)
    ours = general(data)
    places = [(str(scene), target) for scene in data["scene"].values for target in JUDGED]
    heads = [word for call in NAMES.values() for word in (f"{call}: variant", call, "times symtop's")]
    by_group = [
        [scene, f"{target:.0e}", name, *_cells(data, scene, target, rows, ours)]
        for scene, target in places
        for name, rows in known.items()
    ]
    by_row = []
    for scene, target in places:
        for row in [row for rows in known.values() for row in rows]:
            cells = _cells(data, scene, target, [row], ours)
            if cells[1] != "not reached":
                by_row.append([scene, f"{target:.0e}", row, cells[1], cells[2], cells[4], cells[5]])
    by_library = []
    for name, rows in known.items():
        first = data.sel(variant=rows[0])
        public, inner = (range_of(span(data, call, ours, rows)) for call in NAMES)
        if name != OURS:
            by_library.append([name, str(first["chart"].values), str(first["language"].values), public, inner])
    keys = ("package", "version", "chart", "language", "implementation", "shows", "formulation")
    settings = [[str(row), *(str(data[key].sel(variant=row).values) for key in keys)] for row in data["variant"].values]
    return [
        Table(
            f"Both ratios: the time over symtop's ({_fixed(data)})",
            ["library", "chart", "right-hand side", NAMES["public"], NAMES["inner"]],
            by_library,
        ),
        Table(
            "Both comparisons, the fastest variant of each library",
            ["scene", "axis error", "library", *heads],
            by_group,
        ),
        Table(
            "Both comparisons, every variant that reaches the accuracy",
            ["scene", "axis error", "variant", NAMES["public"], "times symtop's", NAMES["inner"], "times symtop's"],
            by_row,
        ),
        Table("What a number of a library rests on", ["library", "note"], NOTES),
        Table(
            "What each variant was given",
            [
                "variant",
                "package",
                "version of its wheel",
                "chart",
                "right-hand side",
                "loop",
                "public call shows",
                "formulation",
            ],
            settings,
        ),
    ]


HOW_TO_READ = (
    "Held fixed: the top, the start, ten nutations, the largest axis error over them, one thread, double precision. "
    "One code measures all errors, and the setting is searched for every variant. A variant is method[chart]: axis is "
    "the six equations on (e, L), angles are Euler's, attitude is a quaternion. Two calls are timed. Public call: "
    f"what a user types, with the objects built in it. It returns {SHOWN} samples where the library interpolates, and "
    f"where it does not the ends of its steps, of fixed ones (symtop, ARKODE, MuJoCo) {SHOWN} at most. Inner loop: all "
    "that can be built once is built before; start to horizon, no samples. Below about 15 us it compares calls from "
    "Python more than integrators. Compilation is outside of both calls for all. Ratios and the columns `times "
    "symtop's` divide by the time of symtop's fastest method on f(t, y) alone in the same call. A library counts as "
    "faster (slower) if every batch of it is faster (slower) than every one of symtop's, however near to one the "
    "ratio is; else both are level. Counted are libraries that are handed equations, not heyoka's stepper, which "
    "symtop offers. None of this says anything about a library's other uses."
)
