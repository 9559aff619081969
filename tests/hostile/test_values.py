"""Every argument of every public function, every kind of bad value: `SymtopError` in one sentence, or a result.

Values that cannot be meant must be refused; of the others (`ANY`) it is only asked that nothing but a SymtopError comes
of them, and at once. The command line is tried in `tests.hostile.test_command_lines`.
"""

import decimal
import fractions
import math
import time
import warnings

import numpy as np
import pytest
import xarray as xr

import symtop

SECONDS = 20.0  # of processor time for one call


class Unprintable:
    """Has no words, and no comparisons."""

    def __repr__(self):
        raise ValueError("no words")

    def __eq__(self, other):
        raise ValueError("no words")

    __hash__ = None


ODD = [None, "x", "", b"1", [], [1.0], {}, (), object(), 1j, True, np.array([1.0, 2.0]), "1e", lambda: 1.0, 10**400]
NOT_FINITE = [*ODD, math.nan, math.inf, -math.inf]
NOT_POSITIVE = [*NOT_FINITE, 0.0, -0.0, -1.0, -1e300, -5e-324, np.float64(-2.0)]
NOT_WHOLE = [*NOT_POSITIVE, 1.5, 2.0000001]
UNKNOWN = [None, 3, "", "no-such", b"spheroid", [], object(), "Spheroid ", "\0", "x" * 5000]
NOT_LABEL = [None, 3, "", " x", "a b", "ä", "-x", "x" * 65, "a/b", "a\nb", b"x", []]
NOT_ROW = [None, "01", {}, 3.0, [math.nan], ["x"], [[0.5]], [None], object(), [1j]]
NOT_TIMES = [None, "x", [], [math.nan], [math.inf], [-1.0], [[1.0]], ["x"], object(), np.zeros((2, 2)), [None]]

TOP, START = symtop.SymmetricTop(2.0, 1.0, 1.0), symtop.Angles(theta=0.5, psi_dot=5.0)
SOLVERS = {"angles": lambda top, start, plan: None}
STEP = {"step_size": 0.01, "horizon": 1.0, "samples": 11, "observe": "axis"}
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

CALLS = {
    "SymmetricTop": (
        symtop.SymmetricTop,
        {"I1": 2.0, "I3": 1.0, "mgl": 1.0},
        {"I1": NOT_POSITIVE, "I3": [*NOT_POSITIVE, 4.1, 1e300], "mgl": NOT_FINITE},
    ),
    "from_spheroid": (
        symtop.SymmetricTop.from_spheroid,
        {"mass": 1.0, "polar_radius": 2.0, "equatorial_radius": 1.0},
        {
            "mass": NOT_POSITIVE,
            "polar_radius": NOT_POSITIVE,
            "equatorial_radius": NOT_POSITIVE,
            "gravity": NOT_FINITE,
            "pivot_distance": [value for value in NOT_FINITE if value is not None],
        },
    ),
    "Angles": (
        symtop.Angles,
        {"theta": 0.5},
        dict.fromkeys(("theta", "phi", "psi", "theta_dot", "phi_dot", "psi_dot"), NOT_FINITE),
    ),
    "Scene": (
        symtop.Scene,
        {"name": "mine", "top": TOP, "start": START, "horizon": 1.0},
        {"name": NOT_LABEL, "top": NOT_FINITE, "start": NOT_FINITE, "horizon": NOT_POSITIVE, "observes": UNKNOWN},
    ),
    "simulate midpoint": (
        symtop.simulate,
        {"scene": "spheroid", "integrator": "midpoint", **STEP},
        {
            "scene": UNKNOWN,
            "integrator": UNKNOWN,
            "step_size": [*NOT_POSITIVE, 1.1, 1e300, 1e-300],
            "tolerance": [value for value in NOT_POSITIVE if value is not None] + [1e-6],
            "horizon": [value for value in NOT_POSITIVE if value is not None] + [1e300, 0.001],
            "samples": [*NOT_WHOLE, 1, 10**9],
            "observe": [value for value in UNKNOWN if value is not None],
        },
    ),
    "simulate rk45": (
        symtop.simulate,
        {"scene": "spheroid", "integrator": "rk45", "tolerance": 1e-6, "horizon": 0.5, "samples": 11},
        {"tolerance": [*NOT_POSITIVE, 1e-15, 1.0, 1e300], "step_size": [0.01, "x", math.nan], "observe": ["psi"]},
    ),
    "reference": (
        symtop.reference,
        {"scene": "spheroid", "times": [0.5], "precision": "double"},
        {"scene": UNKNOWN, "times": NOT_TIMES, "precision": UNKNOWN},
    ),
    "register": (symtop.register, {"entry": None}, {"entry": [*NOT_FINITE, symtop.integrator("midpoint")]}),
    "register_scene": (symtop.register_scene, {"entry": None}, {"entry": [*NOT_FINITE, symtop.scene("spheroid")]}),
    "scene": (symtop.scene, {"name": "spheroid"}, {"name": UNKNOWN}),
    "integrator": (symtop.integrator, {"name": "midpoint"}, {"name": UNKNOWN}),
    "citation": (symtop.citation, {"name": "midpoint"}, {"name": UNKNOWN}),
    "discrete_lagrangian": (
        symtop.discrete_lagrangian,
        {"name": "mine", "nodes": (0.5,), "weights": (1.0,)},
        {
            "name": NOT_LABEL,
            "nodes": [*NOT_ROW, (1.5,), (), (0.2, 0.8)],
            "weights": [*NOT_ROW, (0.9,), (), (0.5, 0.5)],
            "order": [value for value in NOT_WHOLE if value is not None],
        },
    ),
    "composition": (
        symtop.composition,
        {"name": "mine", "drift": (1.0,), "kick": (0.5, 0.5)},
        {
            "name": NOT_LABEL,
            "drift": [*NOT_ROW, (0.9,), (), (0.5, 0.5)],
            "kick": [*NOT_ROW, (0.5, 0.4), (1.0,)],
            "gradient": [value for value in NOT_ROW if value is not None] + [(1.0,), (1.0, 1.0)],
            "chart": UNKNOWN,
            "rotation": [*UNKNOWN, "cayley"],
            "processor": [*NOT_FINITE, 1.0],
        },
    ),
    "runge_kutta": (
        symtop.runge_kutta,
        {"name": "mine", "a": ((), (1.0,)), "b": (0.5, 0.5)},
        {
            "name": NOT_LABEL,
            "a": [None, 3, "x", (), ((),), ((), (math.nan,)), ((), ("x",)), ((), (1.0, 1.0, 1.0)), [[0, 1], [1, 0]]],
            "b": [*NOT_ROW, (0.5, 0.4), (1.0,)],
            "c": [value for value in NOT_ROW if value is not None] + [(0.0, 0.5), (0.0,)],
        },
    ),
    "series": (symtop.series, {"name": "mine", "order": 12}, {"name": NOT_LABEL, "order": [*NOT_WHOLE, 9, 24]}),
    "Integrator": (
        symtop.Integrator,
        {"name": "mine", "family": "other", "summary": "", "solvers": SOLVERS},
        {
            "name": NOT_LABEL,
            "family": UNKNOWN,
            "solvers": [None, {}, [], {"angles": 3}, {"elsewhere": print}, "x"],
            "control": [3, "", "steps", []],
            "implementation": UNKNOWN,
            "order": [value for value in NOT_WHOLE if value is not None],
        },
    ),
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
    for name, (function, good, bad) in CALLS.items()
    for argument, values in bad.items()
]
COST = {"judge", "recommend", "compare"}  # seconds for every value that is taken: their bad ones only


def came(function, arguments):
    """What a call ends in: "" if it returns, the sentence of a SymtopError, or an assertion."""
    began = time.process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", symtop.SymtopWarning)
        try:
            function(**arguments)
            return ""
        except symtop.SymtopError as error:
            sentence = str(error)
            assert "\n" not in sentence
            assert " " in sentence
            assert len(sentence) < 6000
            return sentence
        finally:
            assert time.process_time() - began < SECONDS


@pytest.mark.parametrize(("function", "good", "argument", "values"), BAD)
def test_bad_values_are_refused(function, good, argument, values):
    assert not [value for value in values if not came(function, {**good, argument: value})]


@pytest.mark.parametrize("stride", [19, pytest.param(1, marks=pytest.mark.slow)])
def test_anything_is_used_or_refused(stride):
    """Each value of `ANY` for each argument, or every nineteenth, begun with another one at each argument."""
    places = [(name, key) for name, call in CALLS.items() if name not in COST for key in sorted({*call[1], *call[2]})]
    faults = []
    for k, (name, argument) in enumerate(places):
        function, good, _ = CALLS[name]
        for value in ANY[k % stride :: stride] if (name, argument) != ("register", "entry") else ():
            try:
                came(function, {**good, argument: value})
            except Exception as error:  # noqa: BLE001
                faults.append((name, argument, type(value).__name__, type(error).__name__, str(error)[:200]))
    assert not faults


def test_the_same_calls_with_good_input_are_fine():
    for name, (function, good, _) in CALLS.items():
        if name not in ("register", "register_scene", "judge of nothing"):
            assert came(function, good) == "", name
