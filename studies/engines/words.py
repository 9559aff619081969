"""What the study of engines says: a sentence an engine, the two ends of the field, and what it does not say."""

import math
from typing import NamedTuple

import numpy as np
import xarray as xr

from symtop.methods.engines import SINGLE
from symtop.methods.registry import integrator, split_name

from .tables import FREQUENCIES, HORIZON, SCENES

SLOW, FAST = SCENES
BETWEEN = (400.0, 3000.0)  # steps a nutation that the measured order is taken between
NEAR = math.radians(5.0)
USUAL = 240.0  # steps a second of the sentences
DOES_NOT_SAY = (
    "What this does not say. It is about the rotation of one smooth body: not about contacts, joints, stacks, "
    "friction, speed or robustness, which is what engines are made for and chosen by. A map is that of the "
    "version and the setting its paragraph names, with damping, sleep and limits of speed off; with them on, an "
    "engine does what they do, and another version may do something else. Names in single precision are the maps "
    "rounded after every operation, in symtop's order of operations. Other tops are followed better or worse, as the "
    "population shows. An engine's own documentation is the last table."
)
HOW_TO_READ = (
    "The maps that engines step a free body by (`symtop integrators`), each in the chart its row names, on "
    f"{SLOW}, whose nutation takes 3 s, and {FAST}, which spins at 100 rad/s and nutates in 0.13 s. Steps: from "
    "16 a nutation up, and those of 60, 240 and 1000 a second. The error of the axis is the largest of a hundred "
    "samples, against the closed form; pi for a run that ended early. Energy is relative to |E| + |mgl|, the "
    "spin L.e to the larger of both momenta; the precession is the azimuth that the axis has run through, which means "
    "little once the axis is far off. Rows of the catalogue stand beside the engines at the same step and, in a table "
    "and a figure of their own, at the same cost. Cost is counted in evaluations of the torque, which neither the "
    "machine nor the language decides: four substeps on one torque count as one. The population is that of "
    f"`symtop.population` with its unit of time taken for a second. {DOES_NOT_SAY}"
)


class Facts(NamedTuple):
    """What is known of a row on the slow top."""

    order: float
    best: float  # rad
    best_count: float  # steps a nutation
    last: float  # rad, at the most steps


def rows(data: xr.DataTree) -> list[str]:
    """All rows, in the order of the study."""
    return [str(name) for name in data["tops"]["integrator"].values]


def of_catalogue(row: str) -> bool:
    """Is it a method that stands beside the engines?"""
    return integrator(row).family != "engine"


def single(row: str) -> bool:
    """Is it a map in single precision?"""
    return split_name(row)[0].endswith(SINGLE)


def curve(data: xr.DataTree, row: str, scene: str = SLOW) -> tuple[np.ndarray, np.ndarray]:
    """Steps a nutation, and the axis error there."""
    one = data["tops"]["axis"].sel(scene=scene, integrator=row)
    good = np.isfinite(one.values)
    return one["per_nutation"].values[good], one.values[good]


def facts(data: xr.DataTree, row: str) -> Facts:
    """Order, floor and where it lies."""
    count, error = curve(data, row)
    part = (count > BETWEEN[0]) & (count < BETWEEN[1])
    order = -float(np.polyfit(np.log(count[part]), np.log(error[part]), 1)[0])
    least = int(np.argmin(error))
    return Facts(order, float(error[least]), float(count[least]), float(error[-1]))


def frame(data: xr.DataTree, row: str, variable: str, rate: float, *, scene: str = SLOW, long: bool = False) -> float:
    """A number at the step of so many a second, after the short time or the long one."""
    cell = data["tops"][f"frame_{variable}"].sel(scene=scene, integrator=row, rate=rate)
    return float(cell.isel(horizon=int(long)))


def share(data: xr.DataTree, row: str) -> float:
    """The share of the population whose axis is within `NEAR` at the end."""
    off = data["population"]["off"].sel(scene="population", integrator=row).values
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


def sentence(data: xr.DataTree, row: str) -> str:
    """The verdict on one engine: order, the steps in use, what is left after long, and a floor if it has one."""
    known, method = facts(data, row), integrator(row)
    off = ", ".join(angle(frame(data, row, "axis", rate)) for rate in FREQUENCIES)
    rates = ", ".join(f"1/{rate:g}" for rate in FREQUENCIES)
    kind = (
        f"stays {angle(known.best)} or more from the truth at every step" if abs(known.order) < 0.1
        else f"has order {known.order:.2g}" if not single(row)
        else f"is best at {known.best_count:,.0f} steps a nutation, {angle(known.best)}"
    )  # fmt: skip
    worse = f", {angle(known.last)} at the most" if single(row) and known.last > 1.5 * known.best else ""
    energy, spin, turned = (
        change(frame(data, row, name, USUAL, long=True)) for name in ("energy", "spin", "precession")
    )
    fast = angle(frame(data, row, "axis", USUAL, scene=FAST))
    return (
        f"{row} ({method.summary}) {kind}{worse}; on {SLOW} at {rates} s the axis is off by {off} within "
        f"{HORIZON:g} s; at 1/{USUAL:g} s, {seconds(data):g} s change the energy by {energy}, the spin by {spin} and "
        f"the mean precession by {turned}, and {FAST} is off by {fast} within {HORIZON:g} s; "
        f"{share(data, row):.0%} of the population is within 5 degrees."
    )


def without_term(data: xr.DataTree) -> list[str]:
    """The rows whose map leaves the gyroscopic term out."""
    return [row for row in rows(data) if split_name(row)[0].startswith("no-gyro")]


def spherical(data: xr.DataTree) -> list[str]:
    """What a map without the gyroscopic term follows: the closed form of the spherical top, by order h."""
    said = []
    for row in (row for row in without_term(data) if not single(row)):
        off = [frame(data, row, "spherical", rate) for rate in FREQUENCIES]
        order = -float(np.polyfit(np.log(FREQUENCIES), np.log(off), 1)[0])
        turned = frame(data, row, "precession", USUAL, scene=FAST)
        said.append(
            f"{row}, which has no gyroscopic term, follows the closed form of the spherical top with I3 := I1: on "
            f"{SLOW}, at {', '.join(f'1/{rate:g}' for rate in FREQUENCIES)} s, its axis stays within "
            f"{', '.join(f'{value:.1e}' for value in off)} rad of it for {HORIZON:g} s, a difference of order "
            f"{order:.2f}; the closed form of the top itself it misses by {angle(frame(data, row, 'axis', USUAL))}. "
            f"{FAST} precesses at {1.0 + turned:.2f} of its rate."
        )
    return said


def level(data: xr.DataTree, row: str, rate: float, *, scene: str = SLOW, long: bool = False) -> float:
    """The axis error at so many evaluations of the torque a second."""
    cell = data["tops"]["level_axis"].sel(scene=scene, integrator=row, rate=rate)
    return float(cell.isel(horizon=int(long)))


def at_the_same_cost(data: xr.DataTree) -> str:
    """The best map of an engine and the methods of the catalogue, at as many evaluations of the torque."""
    engines = [row for row in rows(data) if not of_catalogue(row) and not single(row)]
    said = []
    for scene in SCENES:
        off = {row: level(data, row, USUAL, scene=scene) for row in rows(data)}
        best = min(engines, key=lambda row: off[row])
        beside = ", ".join(f"{row} by {angle(off[row])}" for row in rows(data) if of_catalogue(row))
        said.append(f"on {scene} {best}, the nearest map of an engine, is off by {angle(off[best])}, {beside}")
    return f"With {USUAL:g} evaluations of the torque a second, within {HORIZON:g} s, {'; '.join(said)}."


def summary(data: xr.DataTree) -> str:
    """The two ends of the field, in a sentence."""
    engines = [row for row in rows(data) if not of_catalogue(row) and not single(row)]
    ranked = sorted(engines, key=lambda row: frame(data, row, "axis", USUAL))
    shares = {row: share(data, row) for row in rows(data)}
    best, worst = ranked[0], ranked[-1]
    beside = next(row for row in rows(data) if of_catalogue(row))
    median = float(np.nanmedian(data["population"]["steps_a_nutation"].values))
    return (
        f"At 1/{USUAL:g} s, within {HORIZON:g} s of {SLOW}, the maps of engines are off by "
        f"{angle(frame(data, best, 'axis', USUAL))} ({best}) to {angle(frame(data, worst, 'axis', USUAL))} ({worst}); "
        f"{beside}, one force evaluation a step, by {angle(frame(data, beside, 'axis', USUAL))}. On the population, "
        f"where that is {median:.0f} steps a nutation in the median, the axis ends within 5 degrees on "
        f"{min(shares[row] for row in engines):.0%} to {max(shares[row] for row in engines):.0%} of the tops with the "
        f"maps of engines and on {shares[beside]:.0%} with {beside}."
    )


def verdict(data: xr.DataTree) -> list[str]:
    """The field, then every engine, then what it does not say."""
    each = [sentence(data, row) for row in rows(data) if not of_catalogue(row)]
    return [summary(data), at_the_same_cost(data), *spherical(data), *each, DOES_NOT_SAY]
