"""Every argument of every public function, every kind of bad value: `SymtopError` in one sentence, or a result.

Values that cannot be meant are refused; of others (`ANY`) comes at once a result or a SymtopError.
"""

import datetime
import decimal
import fractions
import inspect
import math
import time
import warnings

import numpy as np
import pytest
import xarray as xr

import symtop
from symtop.core.numbers import real_numbers
from symtop.model.exact.closed_form import ClosedForm, ClosedForms
from tests.judging.conftest import shorten

SECONDS = 20.0  # of processor time for one call


class Unprintable:
    """Has no words, and no comparisons."""

    def __repr__(self):
        raise ValueError("no words")

    def __eq__(self, other):
        raise ValueError("no words")

    __hash__ = None


ODD = [None, "x", "", b"1", [], [1.0], {}, (), object(), 1j, True, np.array([1.0, 2.0]), "1e", lambda: 1.0, 10**400,
       np.True_, xr.DataArray(True), np.array("0.01"), np.complex128(0.01 + 1j)]  # fmt: skip
NOT_FINITE = [*ODD, math.nan, math.inf, -math.inf]
NOT_POSITIVE = [*NOT_FINITE, 0.0, -0.0, -1.0, -1e300, -5e-324, np.float64(-2.0)]
NOT_WHOLE = [*NOT_POSITIVE, 1.5, 2.0000001]
UNKNOWN = [None, 3, "", "no-such", b"spheroid", [], object(), "Spheroid ", "\0", "x" * 5000, np.array(["x", "y"])]
NOT_LABEL = [None, 3, "", " x", "a b", "ä", "-x", "x" * 65, "a/b", "a\nb", b"x", []]
NOT_ROW = [None, "01", {}, 3.0, [math.nan], ["x"], [[0.5]], [None], object(), [1j]]

TOP, START = symtop.SymmetricTop(2.0, 1.0, 1.0), symtop.Angles(theta=0.5, psi_dot=5.0)
SOLVERS = {"angles": lambda top, start, plan: None}
STEP = {"step_size": 0.01, "horizon": 1.0, "samples": 11, "observe": "axis"}
ANY = [
    None, True, False, 0, -1, 1, 2, 10**400, -(10**400), 0.0, -0.0, 0.5, 5e-324, 1e308, -1e308, math.nan, math.inf, 1j,
    "", "x", "nan", "1", "é", "\0", "a" * 5000, b"1", [], [1.0], [[1.0]], (), (1, 2), {}, {"a": 1}, set(), {1.0},
    range(3), object(), Unprintable(), int, len, np.float16(1.0), np.longdouble(1.0), np.int8(3), np.array(1.0),
    np.array([1.0, 2.0]), np.array([]), np.array(["x"]), np.array([None]), np.zeros((2, 3, 4)), np.datetime64("2020"),
    np.ma.masked, decimal.Decimal("1e-30"), decimal.Decimal("NaN"), fractions.Fraction(1, 3), slice(2),
    NotImplemented, ..., xr.Dataset(), xr.DataArray([1.0]), symtop.SymtopError("x"), TOP, START,
]  # fmt: skip
RUN = symtop.simulate("spheroid", "strang", step_size=0.01, horizon=0.5, samples=11)
NO_TIMES = [{"time": [0.0]}, {"time": "x", "theta": [1.0]}, xr.Dataset(), {"axis": [[0, 0, 1.0]]}]
NOT_DATA = [None, 3, "x", [], {}, object(), *NO_TIMES, RUN.rename(time="t")]
NAMED = [value for value in UNKNOWN if isinstance(value, np.ndarray) or value]  # where None or "" asks for the default
NO_NUMBER = [value for value in NOT_POSITIVE if not isinstance(value, np.ndarray | list)]
SMALL = symtop.population(3, seed=1)
KINDS = {  # what is refused of arguments of these names, by whichever function; None is right where it is the default
    "I1 mass polar_radius equatorial_radius at_centre axial": NOT_POSITIVE,
    "step_size tolerance horizon accuracy budget nutations max_step time_a_step": NOT_POSITIVE,
    "mgl theta phi psi theta_dot phi_dot psi_dot gravity pivot_distance distance processor": NOT_FINITE,
    "top start at": [*NOT_FINITE, *UNKNOWN], "begin": [None, "x", 3, [], {}, TOP],
    "order threads steps n": NOT_WHOLE, "samples": [*NOT_WHOLE, 1], "name": NOT_LABEL,
    "nodes weights drift kick gradient b c quaternion omega_body axis angular_momentum": NOT_ROW,
    "scene scenes integrator integrators methods chart precision observe observes quantity cost": UNKNOWN,
    "family implementation rotation": UNKNOWN,
}  # fmt: skip
USUAL = {name: values for names, values in KINDS.items() for name in names.split()}

CALLS = {  # a function, good arguments, names of those of which the usual values are refused, and what else is refused
    "SymmetricTop": (symtop.SymmetricTop,
        {"I1": 2.0, "I3": 1.0, "mgl": 1.0}, "I1 mgl", {"I3": [*NOT_POSITIVE, 4.1, 1e300]}),
    "from_spheroid": (symtop.SymmetricTop.from_spheroid, {"mass": 1.0, "polar_radius": 2.0, "equatorial_radius": 1.0},
        "mass polar_radius equatorial_radius gravity pivot_distance", {}),
    "Angles": (symtop.Angles, {"theta": 0.5}, "theta phi psi theta_dot phi_dot psi_dot", {}),
    "Scene": (symtop.Scene, {"name": "mine", "top": TOP, "start": START, "horizon": 1.0},
        "name top start horizon observes", {"tags": ["mild", 3, None, [3]]}),
    "simulate midpoint": (symtop.simulate, {"scene": "spheroid", "integrator": "midpoint", **STEP},
        "scene integrator step_size tolerance horizon samples observe",
        {"step_size": [None, 1.1, 1e300, 1e-300], "tolerance": [1e-6], "horizon": [1e300, 0.001], "samples": [10**9]}),
    "simulate at times": (symtop.simulate,
        {"scene": "spheroid", "integrator": "midpoint", "step_size": 0.01, "times": [0.0, 0.5]}, "integrator step_size",
        {"times": ["x", {}, object(), [], [0.2, 0.1], [0.1, 0.1], [-0.1, 0.1], [0.0, 1e-300], [[0.1, 0.2]], [1e300],
                   [0.1, math.inf], [math.inf] * 2, [math.nan], [True], [1j]], "horizon": [0.5], "samples": [11, 500]}),
    "simulate rk45": (symtop.simulate,
        {"scene": "spheroid", "integrator": "rk45", "tolerance": 1e-6, "horizon": 0.5, "samples": 11},
        "tolerance step_size observe",
        {"tolerance": [None, 1e-15, 1.0, 1e300], "step_size": [0.01], "observe": ["psi"]}),
    "reference": (symtop.reference,
        {"scene": "spheroid", "times": [0.5], "precision": "double"}, "scene precision", {}),
    "register": (symtop.register, {"entry": None}, "", {"entry": [*NOT_FINITE, symtop.integrator("midpoint")]}),
    "register_scene": (symtop.register_scene, {"entry": None}, "", {"entry": [*NOT_FINITE, symtop.scene("spheroid")]}),
    "scene": (symtop.scene, {"name": "spheroid"}, "name", {"name": UNKNOWN}),
    "integrator": (symtop.integrator, {"name": "midpoint"}, "name", {"name": UNKNOWN}),
    "citation": (symtop.citation, {"name": "midpoint"}, "name", {"name": UNKNOWN}),
    "discrete_lagrangian": (symtop.discrete_lagrangian,
        {"name": "mine", "nodes": (0.5,), "weights": (1.0,)}, "name nodes weights order",
        {"nodes": [(1.5,), (), (0.2, 0.8)], "weights": [(0.9,), (), (0.5, 0.5)]}),
    "composition": (symtop.composition, {"name": "mine", "drift": (1.0,), "kick": (0.5, 0.5)},
        "name drift kick gradient chart rotation processor",
        {"drift": [(0.9,), (), (0.5, 0.5)], "kick": [(0.5, 0.4), (1.0,)], "gradient": [(1.0,), (1.0, 1.0)],
         "rotation": ["cayley"], "processor": [1.0]}),
    "runge_kutta": (symtop.runge_kutta, {"name": "mine", "a": ((), (1.0,)), "b": (0.5, 0.5)}, "name b c",
        {"a": [None, 3, "x", (), ((),), ((), (math.nan,)), ((), ("x",)), ((), (1.0, 1.0, 1.0)), [[0, 1], [1, 0]]],
         "b": [(0.5, 0.4), (1.0,)], "c": [(0.0, 0.5), (0.0,)]}),
    "series": (symtop.series, {"name": "mine", "order": 12}, "name order", {"order": [9, 24]}),
    "Integrator": (symtop.Integrator, {"name": "mine", "family": "other", "summary": "", "solvers": SOLVERS},
        "name family implementation order",
        {"solvers": [None, {}, [], {"angles": 3}, {"elsewhere": print}, "x"], "control": [3, "", "steps", []]}),
    "from_quaternion": (symtop.Angles.from_quaternion,
        {"quaternion": [1.0, 0.0, 0.0, 0.0], "omega_body": [0.0, 0.0, 1.0]},
        "quaternion omega_body", {"quaternion": [[1.0, 0.0], [2.0, 0.0, 0.0, 0.0], [0.0] * 4], "omega_body": [[1.0]]}),
    "from_axis": (symtop.Angles.from_axis, {"top": TOP, "axis": [0.6, 0.0, 0.8], "angular_momentum": [0.3, 0.0, 0.4]},
        "top axis angular_momentum", {}),
    **{f"{name} of {type(start).__name__}": (getattr(top, name), {"at": start}, "at", {}) for top, start in (
       (TOP, START), (symtop.RigidBody(1.0, 1.2, 1.5, mgl=1.0), symtop.Attitude(omega_body=(1.0, 0.0, 0.0))))
       for name in ("momenta", "energy", "turning_cosines", "nutation_period", "in_principal") if hasattr(top, name)},
    "kernel_loop": (symtop.kernel_loop, dict.fromkeys(("begin", "increment", "observe"), len), "begin", {}),
    "body_population": (symtop.body_population, {"n": 2, "kind": "heavy", "epsilon": 0.1}, "n", {"epsilon": ODD[1:]}),
    "from_inertia": (symtop.SymmetricTop.from_inertia,
        {"mass": 1.0, "at_centre": 0.01, "axial": 0.004, "distance": 0.25},
        "mass at_centre axial distance gravity", {}),
    "errors": (symtop.errors, {"run": RUN}, "scene", {"run": NOT_DATA}),
    "errors of a table": (lambda time, theta: symtop.errors({"time": time, "theta": theta}, "spheroid"),
        {"time": [0.0, 0.5], "theta": [0.4, 0.4]}, "",
        {"time": ["x", [0.0, 10**400], [0.0, -(10**400)]], "theta": ["x", [10**400, 0.4], [0.4, math.inf, 1.0]]}),
    "recommend": (symtop.recommend, {"scene": "spheroid", "accuracy": 1e-2, "horizon": 0.1},
        "scene accuracy quantity horizon step_size max_step time_a_step",
        {"general": ["yes", 2], "keeps": ["time", 3]}),
    "population": (symtop.population, {"n": 3, "seed": 1}, "n", {"seed": [None, "x", -1, 1.5, math.nan, [], 1j]}),
    "ensemble": (symtop.ensemble,
        {"members": SMALL, "integrator": "strang", "step_size": 0.05, "horizon": 0.2, "samples": 3, "quiet": True},
        "integrator samples observe threads",
        {"members": [*NOT_DATA[:4], xr.Dataset({"I1": 1.0}), [symtop.scene("spheroid"), 3], SMALL.to_dataframe()],
         "step_size": NO_NUMBER, "horizon": NO_NUMBER[1:], "added": [None, 3, "x", {}]}),
    "sweep": (symtop.sweep,
        {"scenes": "spheroid", "integrators": "strang", "step_size": [0.05], "horizon": 0.2, "quiet": True},
        "scenes integrators", {"step_size": ["x", [0.0], [-1.0], [math.nan], object()]}),
    "compare": (symtop.compare,
        {"scene": "spheroid", "methods": "strang", "nutations": 1.0, "cost": "evaluations", "budget": 1e3},
        "scene methods quantity cost budget nutations", {}),
    "long_run": (symtop.long_run,
        {"scene": "spheroid", "integrator": "strang", "steps": 10, "step_size": 0.01, "checkpoint": False},
        "scene integrator steps step_size", {"steps": [10**12], "compensated": ["no", 3], "quiet": [3]}),
    "field": (symtop.field, {"chart": "axis", "top": TOP}, "chart top", {}),
    "plot": (symtop.plot, {"data": RUN}, "quantity", {"data": NOT_DATA, "ax": ["axis", 3, [], object()]}),
    "ClosedForm": (symtop.ClosedForm, {"top": TOP, "start": START}, "top start", {}),
    "judge": (symtop.judge, {"target": lambda f, t, y, h: y, "quick": True}, "chart scene order",
        {"form": NAMED, "energy": [*UNKNOWN[1:], np.array([1.0, 2.0])], "tell": [3, "x", [], False],
         "conserves": ["energy", np.array(1.0), np.array([1.0]), np.array(["x"]), [10**400], {"x": 1}, 3]}),
    "judge of nothing": (symtop.judge,
        {"target": "no-such-file.py:step", "form": "ode", "conserves": ["energy"], "energy": "kept", "quick": True},
        "chart order", {"symplectic": ["x", 2, np.array([True, False])]}),
}  # fmt: skip


def refused_values(function, names, extra):
    """The values of each argument that a function must refuse."""
    values = {name: [*extra.get(name, ())] for name in {**dict.fromkeys(names.split()), **extra}}
    for name in names.split():
        optional = inspect.signature(function).parameters[name].default is None
        values[name] += [value for value in USUAL[name] if value is not None or not optional]
    return values


REFUSED = {name: refused_values(function, names, extra) for name, (function, _, names, extra) in CALLS.items()}
BAD = [(name, argument) for name, arguments in REFUSED.items() for argument in arguments]
COST = {"judge", "recommend", "compare"}  # seconds for every value that is taken: their bad ones only


def outcome_of(function, arguments):
    """What a call ends in: "" if it returns, the sentence of a SymtopError, or an assertion."""
    start = time.process_time()
    with warnings.catch_warnings(action="ignore", category=symtop.SymtopWarning):
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
            assert time.process_time() - start < SECONDS


@pytest.mark.parametrize(("name", "argument"), BAD)
def test_bad_values_are_refused(name, argument):
    function, arguments, *_ = CALLS[name]
    assert not [value for value in REFUSED[name][argument] if not outcome_of(function, {**arguments, argument: value})]


@pytest.mark.parametrize("stride", [19, pytest.param(1, marks=pytest.mark.slow)])
def test_anything_is_used_or_refused(stride):
    """Each value of `ANY` for each argument, or every nineteenth, begun with another one at each argument."""
    places = [(name, key) for name in CALLS if name not in COST for key in sorted({*CALLS[name][1], *REFUSED[name]})]
    faults = []
    for k, (name, argument) in enumerate(places):
        function, arguments, *_ = CALLS[name]
        for value in ANY[k % stride :: stride] if (name, argument) != ("register", "entry") else ():
            try:
                outcome_of(function, {**arguments, argument: value})
            except Exception as error:  # noqa: BLE001
                faults.append((name, argument, type(value).__name__, type(error).__name__, str(error)[:200]))
    assert not faults


def test_the_same_calls_with_good_input_are_fine(monkeypatch):
    shorten(monkeypatch)
    for name, (function, arguments, *_) in CALLS.items():
        if name not in ("register", "register_scene", "judge of nothing"):
            assert outcome_of(function, arguments) == "", name


ODD_TIMES = [
    10**400, [10**400], 1j, [1j], np.array([1.0 + 0j]), {1: 2}, {}, {0.0}, "abc", "1", ["1"], b"1", np.array(["1"]),
    None, [None], object(), [object()], [[1.0, 2.0], [3.0]], np.datetime64("2020"), datetime.date(2020, 1, 1), [True],
    True, iter([1.0]), lambda: 1.0, [math.nan], [math.inf], 1e101,
]  # fmt: skip
SPHEROID = symtop.scene("spheroid")
FORM = ClosedForm(SPHEROID.top, SPHEROID.start)
FORMS = ClosedForms([[2.0, 1.0, 1.0, 0.5, 0, 0, 0, 0, 5.0]])


@pytest.mark.parametrize("times", ODD_TIMES, ids=lambda times: repr(times)[:20])
def test_odd_times_are_refused_in_one_sentence(times):
    functions = [FORM, FORM.turns, FORM.quaternion, FORM.axis, FORM.run, FORMS, FORMS.axis, FORMS.turns]
    functions += [lambda row: symtop.reference(SPHEROID, row), lambda row: FORM.axis_distance(row, np.ones((1, 3)))]
    for ask in functions:
        with pytest.raises(symtop.SymtopError, match="times must be") as info:
            ask(times)
        assert len(str(info.value)) < 300
    with pytest.raises(symtop.SymtopError):
        ClosedForms(times)  # tops


@pytest.mark.parametrize("name", ["rk45", "rk45-compiled", "lsoda", "radau", "dop853", "taylor", "strang", "exact"])
def test_a_horizon_too_short_for_a_step_or_beyond_the_truth_is_refused(name):
    method = symtop.integrator(name)
    for horizon in (5e-324, 1e-320, 1e-305, 1e-101, 1e101, 1e300):
        control = {None: {}, "tolerance": {"tolerance": 1e-6}, "step_size": {"step_size": horizon}}[method.control]
        with pytest.raises(symtop.SymtopError, match=r"horizon must be at (least 1e-100|most 1e\+100), not"):
            symtop.simulate(SPHEROID, name, horizon=horizon, **control)
    control = {None: {}, "tolerance": {"tolerance": 1e-6}, "step_size": {"step_size": 1e-100}}[method.control]
    assert symtop.simulate(SPHEROID, name, horizon=1e-100, **control).attrs["outcome"] == "ok"


def extreme(I1, I3, mgl, spin):
    return symtop.Scene("extreme", symtop.SymmetricTop(I1, I3, mgl), symtop.Angles(1.0, psi_dot=spin), 10.0)


SLOW = [(1e-30, 1e-31, 1e30), (1e30, 1e30, 1e-30), (1e-30, 1e-30, 1e-30)]
TOPS = [(1e-30, 1e-30, 1e30), (1, 1e-30, 1), *(pytest.param(numbers, marks=pytest.mark.slow) for numbers in SLOW)]


@pytest.mark.parametrize("spin", [0.0, 2.0])
@pytest.mark.parametrize("numbers", TOPS)
def test_references_of_extreme_tops_are_told_or_refused(numbers, spin):
    scene = extreme(*numbers, spin)
    assert np.isfinite(symtop.reference(scene, [0.0, 1.0])["theta"]).all()
    pytest.importorskip("heyoka")
    for options in ({"precision": "double"}, {"certify": "integration"})[: 1 if spin else 2]:
        try:
            assert np.isfinite(symtop.reference(scene, [0.0, 1.0], **options)["theta"]).all()
        except symtop.SymtopError as error:
            assert "ends at t = 0" in str(error)  # noqa: PT017
            assert numbers[2] == 1e30


def test_numbers_of_every_kind_are_read_and_a_swing_too_narrow_is_refused():
    kinds = [1], np.array([1], np.int8), np.array([1.0], np.float16), [fractions.Fraction(1)], [decimal.Decimal(1)]
    for row in kinds:
        assert real_numbers("row", row).tolist() == [1.0]
    assert (real_numbers("row", [10**30]).tolist(), real_numbers("row", 2.5).shape) == ([1e30], ())
    with pytest.raises(symtop.SymtopError, match="row must be real numbers, not masked_array"):
        real_numbers("row", np.ma.array([0.0, 1e3], mask=[False, True]))
    for shape in ((), (0,), (2, 2)):
        assert FORM(np.ones((*shape, 2))[..., 0]).theta.shape == shape
        assert FORM.quaternion(np.ones(shape)).shape == (*shape, 4)
    # A hanging top that swings through the pole: its distance from it is theta^2/2.
    hanging = symtop.SymmetricTop(1.0, 1.5, -1.0)
    for theta in (5e-324, 1e-320, 1e-200, 1e-162):
        with pytest.raises(symtop.SymtopError, match="leave it by as much"):
            ClosedForm(hanging, symtop.Angles(theta))
        with pytest.raises(symtop.SymtopError, match="leave it by as much"):
            symtop.simulate(symtop.Scene("s", hanging, symtop.Angles(theta), 3.0), "rk4", step_size=0.01)
    swing = ClosedForm(hanging, symtop.Angles(1e-140))(np.array([0.0, 1.0])).theta
    assert swing[0] == pytest.approx(1e-140, rel=1e-12)
    assert abs(swing[1]) == pytest.approx(1e-140 * math.cos(1.0), rel=1e-6)
