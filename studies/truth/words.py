"""Sentences and tables of the truth study, from its dataset and from the published values."""

from itertools import product

import numpy as np
import xarray as xr

from symtop.measure.published import OTHER_BODY, START, TRAJECTORY, Published, published_values
from symtop.report.style import number
from symtop.runner.study import Table

from .tables import BOUND, DIGITS, ERROR, SECONDS, bound_ratios


def verdict(data: xr.Dataset) -> list[str]:
    """Whether bounds hold, what the published values show, and how the closed form is known."""
    return [bounds(data), *published(published_values()), *closed_form(data)]


def bounds(data: xr.Dataset) -> str:
    """How many claimed bounds hold, and how close they are."""
    count, broken, ratio = bound_ratios(data)
    return (
        f"Of {count} claimed bounds {count - broken} hold against the closed form in 45 digits; the median bound is "
        f"{ratio:.0f} times the error."
    )


def message(data: xr.Dataset) -> str:
    """What the closed form keeps and an integration loses, each at its own longest time, as a title."""
    said = f"The closed form in double is right to {number(float(data[ERROR].sel(variant='closed form').max()))} rad"
    names = [name for name in ("double, axis", "double, attitude") if name in data["variant"].values]
    integrated = data[ERROR].sel(variant=names).stack(run=("scene", "variant", "horizon")).dropna("run")
    if not integrated.size:
        return f"{said} at every time"
    worst = integrated[int(np.argmax(integrated.values))]
    return (
        f"{said} at every time; a Taylor integration in double is off by up to {number(float(worst))} rad after "
        f"{number(float(worst['horizon']))} s"
    )


def measured_against(data: xr.Dataset) -> str:
    """What the errors are measured against, and how closely what was not made from it agrees."""
    text = f"Error: the distance from the closed form in {DIGITS} digits"
    quad = [name for name in map(str, data["variant"].values) if name.startswith("quadruple")]
    if not quad or not np.isfinite(data[ERROR].sel(variant=quad)).any():
        return f"{text}."
    agreed = number(float(data[ERROR].sel(variant=quad).max()))
    return f"{text}; integration in quadruple precision, which knows nothing of it,\nagrees with it to {agreed} rad."


def published(values: list[Published]) -> list[str]:
    """How many published values are reproduced, and what they test."""
    printed, others = ([entry for entry in values if (entry.kind == "printed") is wanted] for wanted in (True, False))
    right, agreeing = (f"{sum(entry.reproduced for entry in part)} of {len(part)}" for part in (printed, others))
    tests, other_tests = ([entry.tests for entry in part] for part in (printed, others))
    sources = ", ".join(dict.fromkeys(entry.source for entry in printed if entry.tests == TRAJECTORY))
    first = (
        f"{right} printed values are reproduced to the last digit. Only {tests.count(TRAJECTORY)} of them test a "
        f"trajectory of the top ({sources or 'none'}); {tests.count(START)} tests the energy of a start, and "
        f"{tests.count(OTHER_BODY)} belong to an asymmetric free body, which SciPy integrates here, not symtop."
    )
    second = (
        f"Of the values that follow from a formula, or from the numbers that a source was built from, {agreeing} "
        f"agree; {other_tests.count(TRAJECTORY)} of them test a trajectory and {other_tests.count(START)} a start."
    )
    return [first, second]


def closed_form(data: xr.Dataset) -> list[str]:
    """The error of the closed form on the first scene and why it is known; nothing without that scene and heyoka."""
    if "spheroid" not in data["scene"].values or "quadruple, attitude" not in data["variant"].values:
        return []
    errors = data[ERROR].sel(scene="spheroid")
    last = errors.sel(variant="closed form").dropna("horizon")[-1]
    quadruple = float(errors.sel(variant="quadruple, attitude").max())
    sentence = (
        f"On spheroid the closed form in double has an axis error of {float(last):.1e} rad at t = "
        f"{float(last['horizon']):g}, measured with the same formula in 45 digits, whose rounding cannot reach the "
        "sixteenth digit. The formula itself is confirmed by the integration in quadruple precision, which agrees with "
        f"it to {quadruple:.0e} rad."
    )
    return [sentence]


def tables(data: xr.Dataset) -> list[Table]:
    """Published values beside ours, and error and cost by source."""
    rows = [
        [
            entry.source, entry.quantity, f"{entry.published:.12g}", f"{entry.ours:.14g}",
            f"{entry.ours - entry.published:+.1e}", "yes" if entry.reproduced else "no", entry.kind, entry.tests,
            entry.remark,
        ]
        for entry in published_values()
    ]  # fmt: skip
    header = ["source", "quantity", "published", "ours", "difference", "to the last digit", "kind", "tests", "remark"]
    costs = []
    for scene, source in product(data["scene"].values, data["variant"].values):
        cell = data.sel(scene=scene, variant=source).dropna("horizon", subset=[ERROR])
        if cell.sizes["horizon"]:
            last = cell.isel(horizon=-1)
            bound = f"{last[BOUND]:.1e}" if np.isfinite(last[BOUND]) else "none claimed"
            ends = f"{last['horizon']:g}", f"{last[ERROR]:.1e}", bound, f"{last[SECONDS]:.2g}"
            costs.append([str(scene), str(source), *ends])
    ends = ["longest horizon (s)", "axis error there (rad)", "claimed bound (rad)", "seconds"]
    return [
        Table("Published values", header, rows),
        Table(
            "Sources at their longest horizon, each at the tolerance of its arithmetic's rounding",
            ["scene", "source", *ends],
            costs,
        ),
    ]
