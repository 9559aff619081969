"""Bad input through the API: always one sentence of SymtopError, never a traceback, never a wait.

A table says for every argument what is surely bad, which `tests.hostile.test_values` tries value by value. Here
hypothesis draws anything at all: then a result is allowed, and any error but SymtopError is not. The command line is
tried in `tests.hostile.test_command_lines`.
"""

import contextlib
import math
import time

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings

import symtop

CALM = settings(
    max_examples=200, deadline=None, derandomize=True, database=None, suppress_health_check=[HealthCheck.too_slow]
)


@contextlib.contextmanager
def at_once():
    """Within two seconds of this process's own time, whatever else the machine does meanwhile."""
    wall, own = time.monotonic(), time.process_time()
    yield
    assert time.process_time() - own < 2.0
    assert time.monotonic() - wall < 20.0


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
}
PLACES = [(call, argument) for call, (_, _, bad) in CALLS.items() for argument in bad]


@pytest.fixture(scope="module", autouse=True)
def _warm():
    """Importing and compiling are not waiting for an answer."""
    test_the_same_calls_with_good_input_are_fine()


def test_the_same_calls_with_good_input_are_fine():
    for call, (function, good, _) in CALLS.items():
        if not call.startswith("register"):
            function(**good)


ANYTHING = st.one_of(
    st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=8), st.binary(max_size=4),
    st.lists(st.floats() | st.text(max_size=2), max_size=3), st.dictionaries(st.text(max_size=2), st.none()),
    st.complex_numbers(), st.just(object()), st.floats(width=16).map(np.float16), st.decimals(), st.fractions(),
)  # fmt: skip


@CALM
@given(place=st.sampled_from([p for p in PLACES if not p[0].startswith("simulate")]), value=ANYTHING)
def test_anything_at_all_is_used_or_refused(place, value):
    call, argument = place
    function, good, _ = CALLS[call]
    with at_once(), contextlib.suppress(symtop.SymtopError):
        function(**{**good, argument: value})
