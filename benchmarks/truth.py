"""The closed form: set-up and one sample, by the arithmetic of its constants, a sample among many, and many tops.

Beside it stand the two kernels of the free motion of a body without symmetry, its constants and one sample among many.

Set-up and one sample are timed call by call, each on a top of its own, so that the median and the slow end are those of
single forms. Samples among many, the constants of one top among many and a long reference are timed in batches.
"""

import time
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from benchmarks.pages import Table
from symtop.measure.timing import timings
from symtop.model.exact import closed_form, free_body
from symtop.model.exact.closed_form import ClosedForm, ClosedForms
from symtop.model.exact.digits import PreciseForm
from symtop.model.scenes import sleeping, spinning, steady
from symtop.model.top import Angles, SymmetricTop, flat
from symtop.run.reference.truth import reference

COUNT, MANY, BATCHES = 2000, 10_000, 15
FAR = np.linspace(0.0, 1e5, 1001)  # times of the long reference


class Row(NamedTuple):
    """Seconds of one kind of call."""

    name: str
    median: float
    slow: float  # 99 % of the calls take less


def _tops(arithmetic: str, count: int) -> list[tuple[SymmetricTop, Angles]]:
    """Tops whose constants come from this arithmetic: generic ones, and precessions that are all but steady."""
    random, tops = np.random.default_rng(1), []
    while len(tops) < count:
        I1, mgl, theta, turn, spin = (float(x) for x in random.uniform(0.2, 2.5, 5))
        if arithmetic == "quad-double":
            spin = (I1 * turn**2 * np.cos(theta) + mgl) / (0.7 * I1 * turn) - turn * np.cos(theta)
        pair = SymmetricTop(I1, 0.7 * I1, mgl), Angles(theta, 0.1, 0.2, 0.0, turn, float(spin))
        if ClosedForm(*pair).provenance.arithmetic == arithmetic:
            tops.append(pair)
    return tops


def _row(name: str, calls: list[float]) -> Row:
    return Row(name, float(np.median(calls)), float(np.quantile(calls, 0.99)))


def _timed(tops: list[tuple[SymmetricTop, Angles]]) -> list[float]:
    """Seconds of set-up and one sample of the axis, once for each top, after a round that is not counted."""
    moment, clock = np.array([1.25]), time.perf_counter
    times = []
    for _ in range(2):
        times = []
        for top, start in tops:
            before = clock()
            ClosedForm(top, start).axis(moment)
            times.append(clock() - before)
    return times


def measure() -> list[Row]:
    """Set-up and one sample in each arithmetic, then one sample among many."""
    closed_form.compile_now()
    rows = [
        _row(f"set-up and one sample, {kind}", _timed(_tops(kind, COUNT))) for kind in ("double-double", "quad-double")
    ]
    long = []
    for scene in (sleeping(2.05), sleeping(2.05), spinning(3.0), steady(5.0)):  # the first imports mpmath
        before = time.perf_counter()
        PreciseForm(scene.top, scene.start, digits=40)
        long.append(time.perf_counter() - before)
    rows.append(_row("set-up in 40 digits, for comparison", long[1:]))
    form, times = ClosedForm(*_tops("double-double", 1)[0]), np.linspace(0.0, 1e3, MANY)
    views = {"axis": form.axis, "quaternion": form.quaternion, "angles and rates": form, "state": form.state}
    results = timings([lambda view=view: view(times) for view in views.values()], batches=BATCHES)
    rows += [
        Row(f"one sample among many, {name}", timing.best / MANY, max(timing.samples) / MANY)
        for name, timing in zip(views, results, strict=True)
    ]
    return rows + _rows_of_many()


def _free_body_calls() -> dict[str, tuple[Callable[[], object], int]]:
    """Calls of the kernels of the free body, on random bodies of which no two moments are nearly equal."""
    for kernel in (free_body._build, free_body._fill):
        kernel.compile()
    build, fill, random = free_body._build.compiled, free_body._fill.compiled, np.random.default_rng(2)
    shares = random.uniform(0.2, 1.0, (COUNT, 3))  # of the mass along each axis, squared
    moments, momenta = shares.sum(axis=1, keepdims=True) - shares, random.normal(size=(COUNT, 3))
    rows = [free_body.checked_body(row, (1, 0, 0, 0), L, (0, 0, 0)) for row, L in zip(moments, momenta, strict=True)]
    constants, times, out = np.zeros(free_body.SIZE), np.linspace(0.0, 1e3, MANY), np.empty((MANY, 7))
    return {
        "constants of a free body": (lambda: [build(row, constants) for row in rows], COUNT),
        "one sample of a free body among many": (lambda: fill(constants, times, out), MANY),
    }


def _rows_of_many() -> list[Row]:
    """Times per top of the forms of many tops at once, and the time of a reference that is cached."""
    numbers = np.array([flat(*pair) for pair in _tops("double-double", COUNT)])
    forms, times = ClosedForms(numbers), np.linspace(0.0, 20.0, 11)
    calls = {
        "constants of one top among many": (lambda: ClosedForms(numbers), COUNT),
        "one sample of one top among many, axis": (lambda: forms.axis(times), COUNT * times.size),
        "reference of spheroid at 1001 times to 1e5": (lambda: reference("spheroid", FAR), 1),
        **_free_body_calls(),
    }
    results = timings([call for call, _ in calls.values()], batches=BATCHES)
    return [
        Row(name, timing.best / share, max(timing.samples) / share)
        for (name, (_, share)), timing in zip(calls.items(), results, strict=True)
    ]


def table(rows: Sequence[Row]) -> Table:
    """The times of all calls as a table."""
    return Table(
        "The closed form",
        ["call", "median (us)", "99 % below (us)"],
        [[row.name, f"{row.median * 1e6:.3g}", f"{row.slow * 1e6:.3g}"] for row in rows],
    )
