"""What the stability study says in words and tables, all of it from its dataset.

Each measured mechanism stands beside what theory says. A quick or a partial study says less.
"""

import math

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from symtop.model.scenes import scenes
from symtop.report.sentences import counted, few
from symtop.runner.study import Table

from .atlas import NEAR, families, map_of, methods_of, pole_effect
from .atlas_words import atlas_tables, summary
from .failures import LONGEST, LOST, SEEN
from .outcome_maps import CHECKED, SETTLED_STEPS, SETTLED_TOLERANCES
from .resonance_words import VERLET, limits, only_windows, resonances, unlimited, variants_with
from .tables import CURVE_STEPS, SOUGHT_PHASE, SOUGHT_STEPS, Column

HOW_TO_READ = (
    "A variant is a method in one chart, method[chart], as rk4[axis]. A map has one cell a run. To the right the step "
    "or the tolerance grows; upwards the spin r, or the gap delta between path and pole. Green is accurate. Pale green "
    f"was not run: the top was accurate at every longer step over a factor of {SETTLED_STEPS:g}, or at every looser "
    f"tolerance over a factor of {SETTLED_TOLERANCES:g}; runs at {CHECKED} settings of a map check it. Yellow has "
    "bounded energy and a wrong phase. Hatched cells fail: they lose energy, cross a turning point of the true motion, "
    "or end early. Solid lines: the linear limit, where small nutations about a steady precession first grow or the "
    f"precession is lost, sought at {CURVE_STEPS} steps; without one there is none, or none that can be followed. "
    "Dashed lines: the step that advances such a nutation by a third of a turn. A limit for fast tops (r > 3) or slow "
    "tops (r < 1) holds for nine spins in ten. A method fails from a step or tolerance on if at least half of all "
    "spins fail there and at every larger one."
)
LOOSE = 10.0  # times the change of the solved equation: lost because the solver's tolerance is too loose
LEAST_SAMPLED = 1e-14  # an energy error that is rounding
LEAST_ASKED = 1e-12  # an energy error at every step from which on one asks what samples show of it
HIDDEN = 10.0  # times too small looks an error that samples hide
OUTLASTS = 10.0  # 1/λ: two and a half digits more than the early error has
EARLY = 1e-15, 1e-2  # rad, axis errors that predict the time next to a separatrix: above rounding, still small


def held_fixed(data: xr.Dataset, mechanism: str) -> str:
    """Scene, step or tolerance, and horizon of a mechanism; charts are in the names of the variants."""

    def of(scene: str, *columns: str) -> list[float]:
        return [float(data[name].sel(scene=scene).max()) for name in columns]

    if mechanism == "pole":
        shown = data[Column.SHOWN_SETTING].sel(scene="grazing")
        step = shown.where(data[Column.CONTROL].sel(scene="grazing") == "step_size").max()
        text = f"Scene grazing, one fall (one nutation period), step {float(step):.2g} of it"
    elif mechanism == "resonances":
        text = f"Scene steady-fast, {of('steady-fast', Column.DISPLACED_STEPS)[0]:.0f} steps of each size"
    elif mechanism == "sleeping":
        text = "Scene sleeping, linearised about the upright"
    elif mechanism == "separatrix":
        text = f"Scene separatrix, to {LONGEST:g}/λ, a point for each step or tolerance"
    elif mechanism == "sampling":
        steps, periods = of("goldstein", Column.SAMPLED_STEPS, Column.SAMPLED_PERIODS)
        text = f"Scene goldstein, {steps:.0f} steps a nutation, {periods:.0f} nutations"
    else:
        step_size, steps = of("goldstein", Column.SOLVER_STEP, Column.SOLVER_STEPS)
        text = f"Scene goldstein, step {step_size:g} s, {steps:.0f} steps"
    return f"{text}. A variant is method[chart]."


def halved_at_pole(part: xr.Dataset) -> dict[bool, list[bool]]:
    """Of every variant of fixed step, whether a pole halves its accurate step; by: does it work in angles?"""
    halved: dict[bool, list[bool]] = {True: [], False: []}
    for name, method in methods_of(part).items():
        effect = pole_effect(map_of(part.sel(variant=name)))
        if effect is not None and method.control == "step_size":
            halved[method.charts() == ("angles",)].append(effect.halves)
    return halved


def poles(part: xr.Dataset) -> str:
    """Which methods need shorter steps where a pole is next to the path."""
    halved = halved_at_pole(part)
    if not halved[True] + halved[False]:
        return ""
    return (
        f"A pole closer than {NEAR:g} rad to the path at least halves the longest accurate step of {sum(halved[True])} "
        f"of {len(halved[True])} variants of fixed step in the angles chart, and of {sum(halved[False])} of "
        f"{len(halved[False])} in charts without poles. Each run is one fall past the pole, all else is held fixed."
    )


def sleepers(part: xr.Dataset) -> str:
    """The sleeping thresholds of methods that move it, beside their closed forms."""
    moved, methods = [], methods_of(part)
    for name, cell in variants_with(part, Column.SLEEPING_THRESHOLD).items():
        if name in methods and (theory := methods[name].sleeps_from) is not None:
            good = np.isfinite(cell[Column.SLEEPING_THRESHOLD].values)
            h, measured = cell[Column.SLEEPING_STEP].values[good], cell[Column.SLEEPING_THRESHOLD].values[good]
            miss = np.max(np.abs(measured - np.array([theory(float(x)) for x in h])))
            moved.append(f"{measured[-1]:.6f} with {name} at h = {h[-1]:g}, within {miss:.0e} of theory")
    if not moved:
        return ""
    return (
        "The true top sleeps (spins upright and stays so) from a spin I3 w3 of 2 on, if I1 = mgl = 1. A step moves "
        f"this threshold to {' and to '.join(moved)}."
    )


def outlasting(part: xr.Dataset) -> list[str]:
    """Variants with a run that stays accurate next to the separatrix longer than predicted, by over `OUTLASTS`."""
    longer = (part[Column.HORIZON] - part[Column.PREDICTED_HORIZON]).transpose("variant", ...).values
    variants = zip(map(str, part["variant"].values), longer, strict=True)
    return [name for name, values in variants if np.max(values[np.isfinite(values)], initial=0.0) > OUTLASTS]


def lawful(part: xr.Dataset) -> xr.DataArray:
    """To which runs next to the separatrix does the law of their early error apply?"""
    early = part[Column.EARLY_ERROR]
    methods, apart = methods_of(part), outlasting(part)
    conserving = [
        name in apart or (name in methods and "energy" in (methods[name].conserves or ()))
        for name in map(str, part["variant"].values)
    ]
    return (early < EARLY[1]) & (early > EARLY[0]) & ~xr.DataArray(conserving, dims="variant")


def misses(part: xr.Dataset) -> NDArray[np.float64]:
    """By how much the law misses the accurate time of the runs to which it applies, in units of 1/λ."""
    gap = np.abs(part[Column.HORIZON] - part[Column.PREDICTED_HORIZON]).where(lawful(part)).values
    return np.asarray(gap[np.isfinite(gap)])


def horizons(part: xr.Dataset) -> str:
    """Is the accurate time next to a separatrix what the early error says?"""
    gap = misses(part)
    if not gap.size:
        return ""
    return (
        "Next to the separatrix, the motion that rises for ever, errors grow as exp(λ t/2), λ = "
        f"sqrt(mgl/I1). An error at {SEEN:g}/λ predicts when {gap.size} runs reach {LOST:g} rad: to "
        f"{np.median(gap):.2f}/λ in the median, {np.max(gap):.1f}/λ at most.{_unreached(part)}{_longer(part)}"
    )


def unreached(part: xr.Dataset) -> dict[str, int]:
    """How many runs of a variant the law applies to that never reach the error of which it speaks."""
    without = lawful(part) & part[Column.HORIZON].isnull()
    count = without.sum([dim for dim in without.dims if dim != "variant"]).values
    return {str(name): int(k) for name, k in zip(part["variant"].values, count, strict=True) if k}


def _unreached(part: xr.Dataset) -> str:
    """Which runs are not among those that the law was held against; empty if there is none."""
    apart = unreached(part)
    if not apart:
        return ""
    broken = part[Column.BROKEN].where(lawful(part)).sum() if Column.BROKEN in part else 0.0
    how = "ended before" if int(broken) == sum(apart.values()) else "never did"
    return f" {counted(sum(apart.values()), 'more run')} ({few(list(apart), most=3)}) {how}."


def _longer(part: xr.Dataset) -> str:
    """Which variants outlast the prediction; empty if none does."""
    apart = outlasting(part)
    if not apart:
        return ""
    return f" {few(apart, most=2)} {'last' if len(apart) > 1 else 'lasts'} more than {OUTLASTS:g}/λ longer."


def absolute() -> str:
    """What the energy errors of sampling and of the solver are: not divided by the energy of the nutation."""
    return f"absolute; the energy of the nutation is {scenes()['goldstein'].energy_scale:.2g}"


def sampling(part: xr.Dataset) -> str:
    """What an energy error sampled once a nutation hides: no ratio is formed with a number at rounding.

    A variant of which the samples show all but a factor `HIDDEN` has an error that goes on from nutation to nutation.
    """
    once, every = part[Column.ENERGY_ONCE].values, part[Column.ENERGY_EVERY].values
    good = np.isfinite(once) & (every > LEAST_ASKED)
    if not good.any():
        return ""
    names, seen = part["variant"].values, good & (once > LEAST_SAMPLED)
    ratio = np.where(seen, every / np.where(seen, once, 1.0), 0.0)
    below, small, whole = good & ~seen, ratio > HIDDEN, seen & (ratio <= HIDDEN)
    parts = [f"{below.sum()} below rounding"] if below.any() else []
    if small.any():
        worst = int(np.argmax(ratio))
        parts.append(f"{small.sum()} up to {ratio[worst]:.0e} times ({names[worst]})")
    text = (
        f"Sampled once a nutation, the energy errors of {int((below | small).sum())} of {counted(int(good.sum()))} "
        f"look more than {HIDDEN:g} times too small{': ' * bool(parts)}{', '.join(parts)}."
    )
    if whole.any():
        text += (
            f" Those of {counted(int(whole.sum()))} drift and look at most {ratio[whole].max():.1f} times too small."
        )
    if tiny := int((np.isfinite(once) & ~good).sum()):
        text += f" {counted(tiny)} with errors up to {LEAST_ASKED:g} are not asked."
    if VERLET in part["variant"].values:
        verlet = part.sel(variant=VERLET)
        true, shown = float(verlet[Column.ENERGY_EVERY]), float(verlet[Column.ENERGY_ONCE])
        text += f" With {VERLET} it is {true:.2g} and looks like {shown:.1g} ({absolute()})."
    return text


def solver(part: xr.Dataset) -> str:
    """The share of the solver in what an implicit method does to energy and momenta."""
    for name, row in variants_with(part, Column.TEXTBOOK_ENERGY).items():
        solved, one = float(row[Column.TEXTBOOK_ENERGY][-1]), float(row[Column.ONE_ITERATION_ENERGY])
        energy, momenta = row[Column.SOLVER_ENERGY].values, row[Column.SOLVER_MOMENTUM].values
        first = f"grows to {one:.1e}" if one > LOOSE * solved else f"stays at {one:.1e}"
        cause = ": the solver makes the difference" if one > LOOSE * solved else ""
        lost = {"energy": energy[0] > LOOSE * energy[-1], "momenta": momenta[0] > LOOSE * momenta[-1]}
        verbs = {name: f"{'loses' if gone else 'conserves'} the {name}" for name, gone in lost.items()}
        return (
            f"With one Newton iteration a step the energy error of {name} {first}; solved, it stays within "
            f"{solved:.1e}{cause}. This package's kernel, stopped after one iteration, {verbs['energy']} "
            f"({energy[0]:.1e}; solved: {energy[-1]:.1e}) {'and' if len(set(lost.values())) == 1 else 'but'} "
            f"{verbs['momenta']} ({momenta[0]:.0e}; solved: {momenta[-1]:.0e}). All are absolute."
        )
    return ""


SENTENCES = (  # mechanism, its scene, a variable without which there is nothing to say, and what says it
    ("pole", "grazing", Column.OUTCOME, poles),
    ("limits", "steady-fast", Column.LIMIT_PHASE, limits),
    ("resonances", "steady-fast", Column.THIRD_TURN_PHASE, resonances),
    ("sleeping", "sleeping", Column.SLEEPING_THRESHOLD, sleepers),
    ("separatrix", "separatrix", Column.HORIZON, horizons),
    ("sampling", "goldstein", Column.ENERGY_ONCE, sampling),
    ("solver", "goldstein", Column.TEXTBOOK_ENERGY, solver),
)


def mechanism_sentences(data: xr.Dataset, mechanism: str = "") -> list[str]:
    """What the dataset says of a mechanism, or of all that were measured."""
    measured = [one for one in SENTENCES if mechanism in ("", one[0])]
    there = [one for one in measured if one[1] in data["scene"].values and one[2] in data]
    return [sentence for _, scene, _, speak in there if (sentence := speak(data.sel(scene=scene)))]


def sentences(data: xr.Dataset) -> list[str]:
    """How far the methods go, how they fail, and whether each mechanism is what theory says."""
    atlas = [sentence for family in families(data) for sentence in summary(data, family)]
    return atlas + mechanism_sentences(data)


LIMITS = (  # scene, variable, header, format
    ("steady-fast", Column.LIMIT_PHASE, "linear limit: small nutations first grow at h omega", "{:.4f}"),
    (
        "steady-fast",
        Column.WINDOW_START,
        "first narrow window of growth between the steps tried before, from h omega",
        "{:.3f}",
    ),
    ("steady-fast", Column.THIRD_TURN_PHASE, "a third of a turn a step, h omega", "{:.4f}"),
    ("steady-fast", Column.SURVIVING_AT_THIRD_TURN, "displacement up to which all stay near there (rad)", "{:.2g}"),
    ("sleeping", Column.SLEEPING_THRESHOLD, "sleeps from a spin I3 w3 of (largest step)", "{:.6f}"),
    ("goldstein", Column.ENERGY_EVERY, "largest absolute energy error, every step", "{:.1e}"),
    ("goldstein", Column.ENERGY_ONCE, "the same, once a nutation", "{:.1e}"),
)


def tables(data: xr.Dataset) -> list[Table]:
    """The atlas in words, and the limits in numbers."""
    shown = [table for family in families(data) for table in atlas_tables(data, family)]
    columns = [one for one in LIMITS if one[0] in data["scene"].values and one[1] in data]
    rows, limit = [], LIMITS[0]
    part = data.sel(scene=limit[0]) if limit in columns else None
    free = {} if part is None else unlimited(part) | dict.fromkeys(only_windows(part), SOUGHT_PHASE)
    for name in map(str, data["variant"].values):
        last = [float(np.ravel(data[key].sel(scene=scene, variant=name).values)[-1]) for scene, key, *_ in columns]
        if np.isfinite(last).any():
            texts = [one[3].format(x) if math.isfinite(x) else "" for one, x in zip(columns, last, strict=True)]
            if name in free:
                texts[columns.index(limit)] = f"none of {SOUGHT_STEPS} steps up to {free[name]:g}"
            rows.append([name, *texts])
    limits_of_all = Table("Limits in numbers", ["variant", *(one[2] for one in columns)], rows)
    return [*shown, limits_of_all] if columns else shown
