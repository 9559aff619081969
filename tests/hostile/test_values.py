"""Every argument of every public function, every kind of bad value: `SymtopError` in one sentence, or a result.

Values that cannot be meant must be refused; of the others (`ANY`) it is only asked that nothing but a SymtopError comes
of them. The first half is the lists of `tests/cli/test_bad_input.py`, each value once and not some of them.
"""

import decimal
import fractions
import math
import time
import warnings

import hypothesis.strategies as st
import numpy as np
import pytest
import xarray as xr
from hypothesis import given

import symtop
from tests.cli.test_bad_input import (
    ANYTHING,
    CALLS,
    CALM,
    NOT_FINITE,
    NOT_POSITIVE,
    NOT_ROW,
    NOT_WHOLE,
    START,
    TOP,
    UNKNOWN,
)

SECONDS = 20.0  # of processor time for one call


class Unprintable:
    """Has no words, and no comparisons."""

    def __repr__(self):
        raise ValueError("no words")

    def __eq__(self, other):
        raise ValueError("no words")

    __hash__ = None


ANY = [
    None, True, False, 0, -1, 1, 2, 10**400, -(10**400), 0.0, -0.0, 0.5, 5e-324, 1e308, -1e308, math.nan, math.inf, 1j,
    "", "x", "nan", "1", "é", "\0", "a" * 5000, b"1", [], [1.0], [[1.0]], (), (1, 2), {}, {"a": 1}, set(), {1.0},
    range(3), object(), Unprintable(), int, len, np.float16(1.0), np.longdouble(1.0), np.int8(3), np.array(1.0),
    np.array([1.0, 2.0]), np.array([]), np.array(["x"]), np.array([None]), np.zeros((2, 3, 4)),
    np.datetime64("2020"),
    np.ma.masked, decimal.Decimal("1e-30"), decimal.Decimal("NaN"), fractions.Fraction(1, 3), slice(2),
    NotImplemented, ...,
    xr.Dataset(), xr.DataArray([1.0]), symtop.SymtopError("x"), TOP, START,
]  # fmt: skip
RUN = symtop.simulate("spheroid", "strang", step_size=0.01, horizon=0.5, samples=11)
NO_TIMES = [{"time": [0.0]}, {"time": "x", "theta": [1.0]}, xr.Dataset(), {"axis": [[0, 0, 1.0]]}]
NOT_DATA = [None, 3, "x", [], {}, object(), *NO_TIMES]
NOT_HORIZONS = [value for value in NOT_POSITIVE if value is not None]
NAMED = [value for value in UNKNOWN if value is not None]  # where None asks for the default
NO_NUMBER = [value for value in NOT_POSITIVE if not isinstance(value, np.ndarray | list)]
SMALL = symtop.population(3, seed=1)

MORE = {
    "from_quaternion": (
        symtop.Angles.from_quaternion,
        {"quaternion": [1.0, 0.0, 0.0, 0.0], "omega_body": [0.0, 0.0, 1.0]},
        {"quaternion": [*NOT_ROW, [1.0, 0.0], [2.0, 0.0, 0.0, 0.0], [0.0] * 4], "omega_body": [*NOT_ROW[1:], [1.0]]},
    ),
    "from_inertia": (
        symtop.SymmetricTop.from_inertia,
        {"mass": 1.0, "at_centre": 0.01, "axial": 0.004, "distance": 0.25},
        {**dict.fromkeys(("mass", "at_centre", "axial"), NOT_POSITIVE), "distance": NOT_FINITE, "gravity": NOT_FINITE},
    ),
    "errors": (symtop.errors, {"run": RUN}, {"run": NOT_DATA, "scene": UNKNOWN[1:]}),
    "errors of a table": (
        lambda time, theta: symtop.errors({"time": time, "theta": theta}, "spheroid"),
        {"time": [0.0, 0.5], "theta": [0.4, 0.4]},
        {"time": ["x", [0.0, 10**400], [0.0, -(10**400)]], "theta": ["x", [10**400, 0.4], [0.4, math.inf, 1.0]]},
    ),
    "recommend": (
        symtop.recommend,
        {"scene": "spheroid", "accuracy": 1e-2, "horizon": 0.1},
        {
            "scene": UNKNOWN, "accuracy": NOT_POSITIVE, "quantity": NAMED, "horizon": NOT_HORIZONS,
            **dict.fromkeys(("step_size", "max_step", "time_a_step"), NOT_HORIZONS), "general": ["yes", 2],
            "keeps": ["time", 3],
        },
    ),
    "population": (
        symtop.population, {"n": 3, "seed": 1}, {"n": NOT_WHOLE, "seed": [None, "x", -1, 1.5, math.nan, [], 1j]}
    ),
    "ensemble": (
        symtop.ensemble,
        {"members": SMALL, "integrator": "strang", "step_size": 0.05, "horizon": 0.2, "samples": 3, "quiet": True},
        {
            "members": [*NOT_DATA[:4], xr.Dataset({"I1": 1.0}), [symtop.scene("spheroid"), 3], SMALL.to_dataframe()],
            "integrator": UNKNOWN, "step_size": NO_NUMBER, "horizon": NO_NUMBER[1:],
            "samples": [*NOT_WHOLE, 1], "observe": NAMED,
            "threads": [value for value in NOT_WHOLE if value is not None],
        },
    ),
    "sweep": (
        symtop.sweep,
        {"scenes": "spheroid", "integrators": "strang", "step_size": [0.05], "horizon": 0.2, "quiet": True},
        {"scenes": UNKNOWN, "integrators": UNKNOWN, "step_size": ["x", [0.0], [-1.0], [math.nan], object()]},
    ),
    "compare": (
        symtop.compare,
        {"scene": "spheroid", "methods": "strang", "nutations": 1.0, "cost": "evaluations", "budget": 1e3},
        {
            "scene": UNKNOWN, "methods": UNKNOWN, "quantity": UNKNOWN, "cost": UNKNOWN, "budget": NOT_POSITIVE[1:],
            "nutations": NOT_POSITIVE[1:],
        },
    ),
    "long_run": (
        symtop.long_run,
        {"scene": "spheroid", "integrator": "strang", "steps": 10, "step_size": 0.01, "checkpoint": False},
        {"scene": UNKNOWN, "integrator": UNKNOWN, "steps": NOT_WHOLE, "step_size": NOT_POSITIVE},
    ),
    "field": (symtop.field, {"chart": "axis", "top": TOP}, {"chart": UNKNOWN, "top": UNKNOWN}),
    "plot": (symtop.plot, {"data": RUN}, {"data": NOT_DATA, "quantity": UNKNOWN}),
    "ClosedForm": (symtop.ClosedForm, {"top": TOP, "start": START}, {"top": UNKNOWN, "start": UNKNOWN}),
    "ClosedForm at": (symtop.ClosedForm(TOP, START), {"times": [0.5]}, {"times": ["x", None, [math.nan], object()]}),
    "judge": (
        symtop.judge,
        {"target": lambda f, t, y, h: y, "quick": True},
        {
            "form": [value for value in UNKNOWN[1:] if value], "chart": UNKNOWN, "scene": UNKNOWN,
            "order": NOT_WHOLE[1:], "energy": [*UNKNOWN[1:], np.array([1.0, 2.0])],
            "conserves": ["energy", np.array(1.0), np.array([1.0]), np.array(["x"]), [10**400], {"x": 1}, 3],
        },
    ),
    "judge of nothing": (
        symtop.judge,
        {"target": "no-such-file.py:step", "form": "ode", "conserves": ["energy"], "energy": "kept", "quick": True},
        {"chart": UNKNOWN, "order": NOT_WHOLE[1:], "symplectic": ["x", 2, np.array([True, False])]},
    ),
}  # fmt: skip
BAD = [
    pytest.param(function, good, argument, values, id=f"{name} {argument}")
    for name, (function, good, bad) in {**CALLS, **MORE}.items()
    for argument, values in bad.items()
]
COST = {"judge", "recommend", "compare"}  # seconds for every value that is taken: their bad ones only
WHATEVER = [
    pytest.param(function, good, argument, ANY, id=f"{name} {argument} any")
    for name, (function, good, bad) in {**CALLS, **MORE}.items()
    if name not in COST
    for argument in {**good, **bad}
    if (name, argument) != ("register", "entry")
]


def came(function, arguments):
    """What a call ends in: "" if it returns, the sentence of a SymtopError, or an assertion."""
    began = time.process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", symtop.SymtopWarning)
        try:
            function(**arguments)
            return ""
        except symtop.SymtopError as error:
            said = str(error)
            assert "\n" not in said
            assert " " in said
            assert len(said) < 6000
            return said
        finally:
            assert time.process_time() - began < SECONDS


@pytest.mark.parametrize(("function", "good", "argument", "values"), BAD)
def test_bad_values_are_refused(function, good, argument, values):
    assert not [value for value in values if not came(function, {**good, argument: value})]


@pytest.mark.slow
@pytest.mark.parametrize(("function", "good", "argument", "values"), WHATEVER)
def test_anything_is_used_or_refused(function, good, argument, values):
    faults = []
    for k, value in enumerate(values):
        try:
            came(function, {**good, argument: value})
        except Exception as error:  # noqa: BLE001
            faults.append((k, type(value).__name__, type(error).__name__, str(error)[:200]))
    assert not faults


PLACES = [(name, key) for name, call in MORE.items() if name not in COST for key in sorted({*call[1], *call[2]})]


def _cheap(value):
    """Is it no number of steps, samples or members that would be computed for minutes?"""
    try:
        size = abs(float(value))
    except Exception:  # noqa: BLE001
        return True
    return not (1e-13 < size < 1e-3 or 1e4 < size < 1e13)


@CALM
@given(place=st.sampled_from(PLACES), value=ANYTHING.filter(_cheap))
def test_anything_at_all_is_used_or_refused(place, value):
    """The same for the functions of `tests.cli.test_bad_input` stands there."""
    name, argument = place
    function, good, _ = MORE[name]
    came(function, {**good, argument: value})
