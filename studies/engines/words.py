"""What the study of engines says: the two ends of the field, what decides, and what it does not say."""

import math
from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np
import xarray as xr

from symtop.methods.framework.registry import integrator, split_name
from symtop.report.sentences import counted, few

from .tables import FREQUENCIES, HORIZON, SCENES

SLOW, FAST = SCENES
BETWEEN = (400.0, 3000.0)  # steps a nutation that the measured order is taken between
NEAR = math.radians(5.0)
USUAL = 240.0  # steps a second of the sentences
DOES_NOT_SAY = (
    "What this does not say: it is about the rotation of one smooth body, not about contacts, joints, stacks, "
    "friction, speed or robustness, by which engines are chosen. A map is that of the version and setting that its "
    "description names, without damping, sleep and limits of speed."
)
HOW_TO_READ = (
    "These are the maps by which engines step a free body; a variant is a map in one chart. "
    f"{SLOW} nutates in 3 s, {FAST} spins at 100 rad/s and nutates in 0.13 s. Steps: from 16 a nutation up, and 60, "
    "240 and 1000 a second. The error of the axis is the largest of a hundred samples, against the closed form; pi for "
    "a run that ended early. Energy is relative to |E| + |mgl|, the spin L.e to the larger of both momenta. The "
    "precession is the azimuth that the axis has run through, which means little once the axis is far off. Cost is "
    "counted in evaluations of the torque: four substeps on one torque count as one. The population is that of "
    "`symtop.population`, its unit of time taken for a second. Damping, sleep, limits of speed or another version "
    "change what an engine does. Variants in single precision round after every operation, in symtop's order. The last "
    "table quotes engines' own documentation."
)


class Facts(NamedTuple):
    """What is known of a variant on the slow top."""

    order: float
    best: float  # rad
    best_count: float  # steps a nutation
    last: float  # rad, at the most steps


def rows(data: xr.DataTree) -> list[str]:
    """All variants, in the order of the study."""
    return [str(name) for name in data["tops"]["variant"].values]


def of_catalogue(variant: str) -> bool:
    """Is it a method that stands beside the engines?"""
    return integrator(variant).family != "engine"


def single(variant: str) -> bool:
    """Is it a map in single precision?"""
    return integrator(variant).precision == "single"


def curve(data: xr.DataTree, variant: str, scene: str = SLOW) -> tuple[np.ndarray, np.ndarray]:
    """Steps a nutation, and the axis error there."""
    one = data["tops"]["axis"].sel(scene=scene, variant=variant)
    good = np.isfinite(one.values)
    return one["per_nutation"].values[good], one.values[good]


def facts(data: xr.DataTree, variant: str) -> Facts:
    """Order, floor and where it lies."""
    count, error = curve(data, variant)
    part = (count > BETWEEN[0]) & (count < BETWEEN[1])
    order = -float(np.polyfit(np.log(count[part]), np.log(error[part]), 1)[0])
    least = int(np.argmin(error))
    return Facts(order, float(error[least]), float(count[least]), float(error[-1]))


def frame(
    data: xr.DataTree, variant: str, variable: str, rate: float, *, scene: str = SLOW, long: bool = False
) -> float:
    """A number at the step of so many a second, after the short time or the long one."""
    cell = data["tops"][f"frame_{variable}"].sel(scene=scene, variant=variant, rate=rate)
    return float(cell.isel(horizon=int(long)))


def share(data: xr.DataTree, variant: str) -> float:
    """The share of the population whose axis is within `NEAR` at the end."""
    off = data["population"]["off"].sel(scene="population", variant=variant).values
    return float(np.mean(off <= NEAR))


def seconds(data: xr.DataTree) -> float:
    """The long time (s)."""
    return float(data["tops"]["horizon"].values[1])


def angle(value: float) -> str:
    """An error of the axis in words; degrees where they are of some size."""
    degrees = math.degrees(value)
    if degrees < 0.1:
        return f"{value:.1e} rad"
    return f"{degrees:.0f} degrees" if degrees >= 10.0 else f"{degrees:.2g} degrees"


def change(value: float) -> str:
    """A relative change: per cent, or a power of ten where it is very small or very large."""
    if not math.isfinite(value):
        return "a number that is not finite"
    return (
        f"{value:+.2g}"
        if abs(value) < 5e-4
        else f"{value:+.1%}"
        if abs(value) < 100.0
        else f"{value:+.0e} times its scale"
    )


def span(values: Iterable[float], say: Callable[[float], str]) -> str:
    """The least and the largest of some numbers, in words."""
    several = list(values)
    return " to ".join(dict.fromkeys((say(min(several)), say(max(several)))))


def engine_variants(data: xr.DataTree) -> list[str]:
    """The maps of engines in double precision."""
    return [row for row in rows(data) if not of_catalogue(row) and not single(row)]


def by_order(data: xr.DataTree) -> dict[int, list[str]]:
    """The maps of engines in double precision by their order, 0 without the gyroscopic term."""
    groups: dict[int, list[str]] = {}
    for variant in engine_variants(data):
        groups.setdefault(0 if variant in without_term(data) else max(1, round(facts(data, variant).order)), []).append(
            variant
        )
    return dict(sorted(groups.items()))


def ordered(data: xr.DataTree) -> str:
    """What the order of a map decides at the usual step."""
    said = [
        f"{f'Order {order}' if order else 'Without a gyroscopic term'}: "
        f"{span((frame(data, row, 'axis', USUAL) for row in group), angle)} ({counted(len(group))})."
        for order, group in by_order(data).items()
    ]
    return f"The order decides how far the axis is off at 1/{USUAL:g} s on {SLOW}. {' '.join(said)}"


def in_the_long_run(data: xr.DataTree) -> str:
    """What the maps do to energy and spin over the long time, with the worst of each."""
    there, parts = engine_variants(data), []
    for name in ("energy", "spin"):
        changed = {row: frame(data, row, name, USUAL, long=True) for row in there}
        size = {row: abs(value) if math.isfinite(value) else math.inf for row, value in changed.items()}
        least, most = (pick(there, key=lambda row: size[row]) for pick in (min, max))
        parts.append(f"the {name} by {change(changed[least])} ({least}) to {change(changed[most])} ({most})")
    return f"In {seconds(data):g} s at 1/{USUAL:g} s on {SLOW}, the maps of engines change {' and '.join(parts)}."


def in_single_precision(data: xr.DataTree) -> str:
    """Where shorter steps stop helping; empty without such a variant."""
    floors = {row: facts(data, row) for row in rows(data) if single(row) and row not in without_term(data)}
    if not floors:
        return ""
    worse = sum(known.last > 1.5 * known.best for known in floors.values())
    counts = span((known.best_count for known in floors.values()), "{:,.0f}".format)
    return (
        "In single precision shorter steps stop helping: the maps with the gyroscopic term are best at "
        f"{counts} steps a nutation, off by {span((known.best for known in floors.values()), angle)}, and {worse} of "
        f"{len(floors)} are worse at the most steps tried."
    )


def without_term(data: xr.DataTree) -> list[str]:
    """The variants whose map leaves the gyroscopic term out."""
    return [row for row in rows(data) if split_name(row)[0].startswith("no-gyro")]


def order_of_difference(data: xr.DataTree, variant: str) -> float:
    """With which power of the step a map comes to the spherical top."""
    off = [frame(data, variant, "spherical", rate) for rate in FREQUENCIES]
    return -float(np.polyfit(np.log(FREQUENCIES), np.log(off), 1)[0])


def spherical(data: xr.DataTree) -> str:
    """What maps without the gyroscopic term follow: the closed form of the spherical top, by order h."""
    there = [row for row in without_term(data) if not single(row)]
    if not there:
        return ""
    near = span((frame(data, row, "spherical", USUAL) for row in there), angle)
    orders = span((order_of_difference(data, row) for row in there), "{:.2f}".format)
    missed = span((frame(data, row, "axis", USUAL) for row in there), angle)
    turned = span((1.0 + frame(data, row, "precession", USUAL, scene=FAST) for row in there), "{:.2f}".format)
    return (
        f"Without a gyroscopic term a map follows another top, the spherical one with I3 := I1: {few(there)} are off "
        f"it by {near} at 1/{USUAL:g} s on {SLOW}, with order {orders}. The true top is missed by {missed}; "
        f"on the scene {FAST} the precession has {turned} of its rate."
    )


def level(data: xr.DataTree, variant: str, rate: float, *, scene: str = SLOW, long: bool = False) -> float:
    """The axis error at so many evaluations of the torque a second."""
    cell = data["tops"]["level_axis"].sel(scene=scene, variant=variant, rate=rate)
    return float(cell.isel(horizon=int(long)))


def at_the_same_cost(data: xr.DataTree) -> list[str]:
    """On each scene the best map of an engine and the best of the catalogue, at as many evaluations of the torque."""
    engines, said = engine_variants(data), []
    for scene in SCENES:
        off = {row: level(data, row, USUAL, scene=scene) for row in rows(data)}
        best = min(engines, key=lambda row: off[row])
        ours = [row for row in rows(data) if of_catalogue(row)]
        beside = ", ".join(f"{row} by {angle(off[row])}" for row in ours)
        said.append(
            f"At equal cost, {USUAL:g} evaluations of the torque a second for {HORIZON:g} s on {scene}, the best map "
            f"of an engine, {best}, is off by {angle(off[best])}; {beside}."
        )
    return said


def summary(data: xr.DataTree) -> str:
    """The two ends of the field, in a sentence."""
    ranked = sorted(engine_variants(data), key=lambda row: frame(data, row, "axis", USUAL))
    best, worst = ranked[0], ranked[-1]
    beside = next(row for row in rows(data) if of_catalogue(row))
    return (
        f"At 1/{USUAL:g} s, within {HORIZON:g} s of {SLOW}, the maps of engines are off by "
        f"{angle(frame(data, best, 'axis', USUAL))} ({best}) to {angle(frame(data, worst, 'axis', USUAL))} ({worst}); "
        f"{beside}, one force evaluation a step, by {angle(frame(data, beside, 'axis', USUAL))}."
    )


def on_the_population(data: xr.DataTree) -> str:
    """How many random tops the maps follow."""
    shares = {row: share(data, row) for row in rows(data)}
    beside = next(row for row in rows(data) if of_catalogue(row))
    count = data["population"].sizes["member"]
    followed = span((shares[row] for row in engine_variants(data)), "{:.0%}".format)
    median = float(np.nanmedian(data["population"]["steps_a_nutation"].values))
    return (
        f"Of {count} random tops, at {median:.0f} steps a nutation in the median, the maps of engines end within 5 "
        f"degrees on {followed}, {beside} on {shares[beside]:.0%} (a step is 1/{USUAL:g} of the unit of time)."
    )


def verdict(data: xr.DataTree) -> list[str]:
    """The field, at equal steps and equal cost, what decides, and what it does not say."""
    said = [
        summary(data), *at_the_same_cost(data), on_the_population(data), ordered(data), spherical(data),
        in_the_long_run(data), in_single_precision(data), DOES_NOT_SAY,
    ]  # fmt: skip
    return list(filter(None, said))
