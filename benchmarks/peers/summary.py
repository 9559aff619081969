"""What the measured peers say: tables and sentences, in the form in which studies leave theirs.

A *group* is what is compared: a package, with its chart and the language of its right-hand side where it has several.
"""

import itertools
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from benchmarks.kernels import ratio
from benchmarks.pages import Table
from benchmarks.peers.measure import HEYOKA, OURS, PERIODS, SHOWN, TARGETS
from symtop.measure.timing import Timing
from symtop.methods.framework.registry import methods

JUDGED = TARGETS[1:]  # the accuracies at which a verdict is given
LEVEL = 1.25  # a ratio nearer to one than this is no difference
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


def groups(data: xr.Dataset) -> dict[str, list[str]]:
    """Variants by group: ours first, then heyoka's, then by package."""
    packages = data["package"].values.astype(str).tolist()
    kinds = list(zip(packages, data["chart"].values.astype(str), data["language"].values.astype(str), strict=True))
    several = {one for one in packages if len({kind for kind in kinds if kind[0] == one}) > 1} - {OURS, HEYOKA}
    found: dict[str, list[str]] = {}
    for kind, row in zip(kinds, data["variant"].values.astype(str).tolist(), strict=True):
        package, chart, language = kind
        name = f"{package}[{chart}], {SHORT.get(language, language)}" if package in several else package
        found.setdefault(name, []).append(row)
    return {name: found[name] for name in sorted(found, key=lambda name: (name != OURS, name != HEYOKA, name))}


def best_of(data: xr.Dataset, call: str, scene: str, rows: Sequence[str], target: float) -> Best | None:
    """The fastest measured run of some variants with an error of at most `target`; None if none is."""
    cell = data.sel(call=call, scene=scene, variant=list(rows))
    seconds = np.where(cell["axis"].values <= target, cell["seconds"].values, np.inf)
    seconds[np.isnan(seconds)] = np.inf
    if not np.isfinite(seconds).any():
        return None
    row, column = np.unravel_index(int(np.argmin(seconds)), seconds.shape)
    samples = tuple(cell["seconds_samples"].values[row, column].tolist())
    return Best(str(cell["variant"].values[row]), Timing(samples, float(cell["first_call"].values[row, column])))


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


def shown(seconds: float) -> str:
    """A time with its unit."""
    for unit, size in (("s", 1.0), ("ms", 1e-3)):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds * 1e6:.3g} us"


def ratios(data: xr.Dataset, call: str, mine: Sequence[str], theirs: Sequence[str]) -> list[float]:
    """Their time over ours on every scene and at every judged accuracy that both reach."""
    each = []
    for scene in data["scene"].values.astype(str):
        for target in JUDGED:
            ours, other = (best_of(data, call, scene, rows, target) for rows in (mine, theirs))
            if ours is not None and other is not None:
                each.append(other.timing.best / ours.timing.best)
    return each


def span(data: xr.Dataset, call: str, mine: Sequence[str], theirs: Sequence[str]) -> tuple[float, float] | None:
    """The least and the largest ratio, their time over ours, over scenes and judged accuracies."""
    each = ratios(data, call, mine, theirs)
    return (min(each), max(each)) if each else None


def printed(value: float) -> str:
    """A ratio of times as it is printed: ``1.06``, ``23.4``, ``1,110``."""
    return f"{value:.3g}" if value < 100.0 else f"{float(f'{value:.3g}'):,.0f}"


def range_of(ratios: tuple[float, float] | None) -> str:
    """The least and the largest ratio as they are printed."""
    return "not reached" if ratios is None else f"{printed(ratios[0])} to {printed(ratios[1])}"


def verdict(data: xr.Dataset) -> list[str]:
    """Who is ahead in each comparison; what a callback costs."""
    return [*_wins(data), *_callbacks(data)]


def pairs(data: xr.Dataset) -> list[str]:
    """Both ratios against SciPy and heyoka."""
    known = groups(data)
    scipys = sorted((name for name in known if name.partition("[")[0] == "scipy"), key=lambda name: "[angles" in name)
    both = [_both(data, known, name) for name in (*scipys, HEYOKA) if OURS in known and name in known]
    return [*both, f"All ratios: {_fixed(data)}; in angles or on (e, L) as each says."] if both else []


def _fixed(data: xr.Dataset) -> str:
    scenes = " and ".join(data["scene"].values.astype(str))
    return f"{scenes}, axis errors of {' and '.join(f'{target:.0e}' for target in JUDGED)}, {PERIODS:g} nutations"


def _both(data: xr.Dataset, known: dict[str, list[str]], name: str) -> str:
    """The public-call ratio beside the inner-loop ratio of one library."""
    public, inner = (span(data, call, known[OURS], known[name]) for call in NAMES)
    call = "`taylor` in `simulate`" if name == HEYOKA else "a user's `solve_ivp`"
    return (
        f"{name}: {call} takes {range_of(public)} times as long as `simulate` with the best of symtop's own kernels; "
        f"the inner loop takes {range_of(inner)} times as long as the fastest kernel alone."
    )


class Score(NamedTuple):
    """Comparisons with libraries that are handed equations, at every place that both reach."""

    ahead: int
    level: int  # or not to be told from the noise
    behind: int
    slower: dict[str, str]  # than which library, in how many of its comparisons

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
    counts, slower = {"ahead": 0, "level": 0, "behind": 0, "noise": 0}, {}
    for name, rows in groups(data).items():
        if name in (OURS, HEYOKA, *ENGINES):
            continue
        places = ((str(scene), target) for scene in data["scene"].values for target in JUDGED)
        pairs = [[best_of(data, call, scene, some, target) for some in (mine, rows)] for scene, target in places]
        words = [standing(own, theirs).word for own, theirs in pairs if own is not None and theirs is not None]
        for word in words:
            counts[word] += 1
        if "behind" in words:
            slower[name] = f"{words.count('behind')} of {len(words)}"
    return Score(counts["ahead"], counts["level"] + counts["noise"], counts["behind"], slower)


def _wins(data: xr.Dataset) -> list[str]:
    """In how many places our fastest is ahead, and how those stand that need no more than a library."""
    said, simple = [], general(data)
    kinds = [("symtop's own kernels", groups(data).get(OURS, []))]
    if simple:
        kinds.append((f"Those that need f(t, y) alone ({', '.join(simple)})", simple))
    for who, rows in kinds:
        stands = {words: each for call, words in NAMES.items() if (each := score(data, call, rows)).compared}
        ahead = [f"{one.ahead} of {one.compared}" for one in stands.values()]
        level = [str(one.level) for one in stands.values()]
        slower = [f"{name} is faster in {count} ({words})"
                  for words, one in stands.items() for name, count in one.slower.items()]  # fmt: skip
        if stands:
            said.append(f"{who} are faster in {' and '.join(ahead)} comparisons ({' and '.join(stands)}), level or "
                        f"within the noise in {' and '.join(level)}: {', '.join(slower) or 'no library is faster'}."
                        )  # fmt: skip
    return said


def fastest(data: xr.Dataset) -> list[str]:
    """Our variants that are the fastest somewhere."""
    ours = groups(data).get(OURS, [])
    places = itertools.product(NAMES, data["scene"].values.astype(str), JUDGED)
    best = (best_of(data, call, scene, ours, target) for call, scene, target in places)
    return sorted({one.row for one in best if one is not None})


def facts(data: xr.Dataset) -> dict[str, Any]:
    """Numbers that pages quote."""
    known, simple, own = groups(data), general(data), fastest(data)
    needs = [method.needs for row in own if (method := methods().get(row.partition("[")[0])) is not None]
    said: dict[str, Any] = {
        "version": data.attrs["symtop_version"], "fastest": _coded(own), "general": _coded(simple),
        "of_this_top": bool(needs) and set(needs) == {"this-top"},
    }  # fmt: skip
    for call in NAMES:
        said[f"heyoka_{call}"] = range_of(span(data, call, known.get(OURS, []), known.get(HEYOKA, [])))
        for kind, rows in (("", known.get(OURS, [])), ("general_", simple)):
            stands = score(data, call, rows)
            said |= {f"{kind}{key}_{call}": getattr(stands, key) for key in ("ahead", "level", "behind", "compared")}
            said[f"{kind}slower_{call}"] = ", ".join(f"{name} in {count}" for name, count in stands.slower.items())
            said[f"{kind}scipy_{call}"] = range_of(span(data, call, rows, known.get("scipy[axis], numba", [])))
    return said


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
        theirs, mine = (best_of(data, call, scene, some, target) for some in (rows, ours))
        if theirs is None:
            cells += ["", "not reached", ""]
            continue
        times = "" if mine is None else printed(theirs.timing.best / mine.timing.best)
        cells += [theirs.row, shown(theirs.timing.best) + ("" if theirs.timing.reliable else " (noisy)"), times]
    return cells


def tables(data: xr.Dataset) -> list[Table]:
    """Both comparisons side by side, group by group and variant by variant, and what every variant was given."""
    known = groups(data)
    ours = known.get(OURS, [])
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
    both = []
    for name, rows in known.items():
        one = data.sel(variant=rows[0])
        public, inner = (range_of(span(data, call, ours, rows)) for call in NAMES)
        if name != OURS:
            both.append([name, str(one["chart"].values), str(one["language"].values), public, inner])
    keys = ("package", "version", "chart", "language", "implementation", "shows", "formulation")
    given = [[str(row), *(str(data[key].sel(variant=row).values) for key in keys)] for row in data["variant"].values]
    return [
        Table(
            f"Both ratios: the time over symtop's ({_fixed(data)})",
            ["library", "chart", "right-hand side", NAMES["public"], NAMES["inner"]],
            both,
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
            given,
        ),
    ]


HOW_TO_READ = (
    "Held fixed: the top, the start, ten nutations, the largest axis error over them, one thread, double precision. "
    "One code measures all errors, and the setting is searched for every variant. A variant is method[chart]: axis is "
    "the six equations on (e, L), angles are Euler's, attitude is a quaternion. Two calls are timed. Public call: "
    f"what a user types, with the objects built in it. It returns {SHOWN} samples, or the ends of the library's own "
    "steps where it does not interpolate. Inner loop: all that can be built once is built before; start to horizon, "
    "no samples. Below about 15 us it compares calls from Python more than integrators. Compilation is outside of "
    "both calls for all. The columns `times symtop's` divide by the time of the fastest of symtop's own kernels in "
    "the same call; counts of wins are over libraries that are handed equations, not heyoka's stepper, which symtop "
    "offers. None of this says anything about a library's other uses."
)
