"""Adapters: what fits is judged; what hangs, crashes, raises or keeps something is reported and stops nothing else."""

import contextlib
import itertools
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import RK23
from scipy.spatial.transform import Rotation

import symtop
from symtop.judging import judge_step
from symtop.judging.adapters import external
from symtop.judging.adapters.adapter import heartbeat, integrator, label_of
from symtop.judging.adapters.python_step import PythonStep, RotationStep, SeparableStep
from symtop.judging.battery import stages
from symtop.judging.claims import calls, subject
from symtop.judging.claims.subject import open_target
from symtop.judging.findings import VERDICTS
from symtop.judging.remote import clock
from tests.commands import ROOT, code_and_output
from tests.conftest import defer
from tests.judging.blind.right import midpoint, product, rates, rk4, turn, verlet
from tests.judging.conftest import shorten

SPHEROID = symtop.scene("spheroid")
needs_compiler = pytest.mark.skipif(shutil.which("gcc") is None, reason="there is no C compiler")


def march(stepper, h, marks):
    """The state that a stepper begins with, and what it makes of so many steps of h."""
    par, state = stepper.form.prepare(SPHEROID.top, SPHEROID.start)
    return np.array(state), stepper.march(SPHEROID.top, par, np.array(state), h, np.array(marks))


def run_of(stepper, steps=200):
    method = integrator(stepper)
    return symtop.simulate(SPHEROID, method, step_size=0.8 / steps, horizon=0.8, samples=5, observe="axis", guard=False)


@pytest.mark.parametrize("chart", ["angles", "axis", "attitude"])
def test_a_python_step_makes_the_steps_of_the_tableau_that_it_is(chart):
    tableau = symtop.runge_kutta("midpoint-tableau", ((), (0.5,)), (0.0, 1.0))
    plan = {"step_size": 0.004, "horizon": 0.8, "samples": 5, "observe": "axis", "guard": False}
    ours, mine = symtop.simulate(SPHEROID, tableau.variant(chart), **plan), run_of(PythonStep(midpoint, chart))
    np.testing.assert_allclose(mine["axis"].values, ours["axis"].values, rtol=0, atol=1e-12)
    np.testing.assert_allclose(mine["p_psi"].values, ours["p_psi"].values, rtol=1e-12)
    run = run_of(PythonStep(lambda f, t, y, h: midpoint(f, t, y, h) * (1.0 if t < 0.45 else np.nan), chart))
    assert [run.attrs[key] for key in ("outcome", "reached_time", "steps")] == ["not_finite", 0.4, 100]
    assert run_of(PythonStep(lambda f, t, y, h: -abs(y) if t > 0.3 else y, "angles"))["theta"].count() == 2  # has left


def test_a_scipy_class_makes_the_steps_that_it_is_told_to():
    Mine = type("Mine", (RK23,), {})
    run = run_of(open_target(Mine, None, "axis"))
    assert run.attrs["steps"] == 200
    assert run.attrs["force_evaluations"] == pytest.approx(600, abs=5)  # it has one in hand at each end
    finer, truth = run_of(open_target(Mine, None, "axis"), 400), symtop.reference(SPHEROID, run["time"].values)
    misses = [float(np.abs(result["axis"].values - truth["axis"].values).max()) for result in (run, finer)]
    assert misses[0] / misses[1] == pytest.approx(8.0, rel=0.1)


def test_separable_steps_are_those_of_the_splitting_and_a_rotation_is_that_of_the_top():
    stepper = RotationStep(lambda q, w, h, inertia, torque: (q, w))
    par, state = stepper.form.prepare(SPHEROID.top, SPHEROID.start)
    values = stepper.form.present(par, np.zeros(1), np.array([state]))[0]
    run = symtop.simulate(SPHEROID, "strang[attitude]", step_size=0.1, horizon=0.2, samples=2, guard=False).isel(time=0)
    np.testing.assert_allclose(np.abs(values[:4] @ run["quaternion"].values), 1.0, atol=1e-14)
    p_phi, p_psi = stepper.form.momenta(par, np.array([state]))
    np.testing.assert_allclose([p_phi[0], p_psi[0]], SPHEROID.top.momenta(SPHEROID.start)[:2], rtol=1e-14)
    ours = symtop.simulate(SPHEROID, "stormer-verlet", step_size=0.004, horizon=0.8, samples=2).isel(time=-1)
    _, states = march(stepper := SeparableStep(verlet), 0.004, [200])
    np.testing.assert_allclose(states[0], [float(ours["theta"]), float(ours["p_theta"])], rtol=1e-12)
    assert stepper.evaluations == 400


LIBRARY = """
void step(double *y, double h, const double *par, long n) {
    for (long k = 0; k < n; k++) { y[3] -= h * par[2] * y[1]; y[4] += h * par[2] * y[0]; BODY }
}
void other(double *y, double h, const double *par, long n) { y[0] += n; }
"""


def library(folder, body=""):
    target = folder / "my.so"
    (folder / "my.c").write_text(LIBRARY.replace("BODY", body))
    subprocess.run(["gcc", "-O2", "-shared", "-fPIC", str(folder / "my.c"), "-o", str(target)], check=True)
    return str(target)


@needs_compiler
def test_a_library_is_asked_for_so_many_steps_and_told_where_it_must_not_write(tmp_path):
    for body, words in (("y[6] = 1;", "beyond the 6 numbers"), ("((double *)par)[0] = 1;", "into its para")):
        (tmp_path / words).mkdir()
        with pytest.raises(symtop.SymtopError, match=words):
            run_of(open_target(library(tmp_path / words, body), None, "axis"))
    state, states = march(open_target(library(tmp_path), None, "axis"), 0.5, [0, 1, 4])
    np.testing.assert_array_equal(states[0], state)
    np.testing.assert_allclose(states[:, 4] - state[4], np.array([0, 1, 4]) * 0.5 * SPHEROID.top.mgl * state[0])
    assert open_target(f"{tmp_path / 'my.so'}:other", None, "axis").name == "my-other"


def program(folder, body):
    file = folder / "engine.py"
    file.write_text(f"import sys\nnumbers = sys.stdin.readline().split()\n{body}\n")
    return f"{sys.executable} {file}"


STILL = "n, stride = map(int, numbers[4:6])\nfor k in range(0, n + 1, stride): print(*numbers[6:12], sep=',')"
RAW = "from array import array\nprint = lambda *x, sep: sys.stdout.buffer.write(array('d', map(float, x)))\n" + STILL
FLIPPED = STILL.replace("*numbers[6:12]", "*(-float(x) for x in numbers[6:10]), *numbers[10:]")
TURNED = STILL.replace("*numbers[6:12]", "numbers[6], float(numbers[7]) + 6.283185307179586, *numbers[8:]")


@pytest.mark.parametrize(("body", "chart", "change"), [
    (STILL, "axis", lambda y: y), (RAW, "axis", lambda y: y), (FLIPPED, "attitude", lambda y: [*-y[:4], *y[4:]]),
    (TURNED, "angles", lambda y: [y[0], y[1] + 2.0 * np.pi, *y[2:]]),
])  # fmt: skip
def test_a_program_gets_one_line_and_writes_states(tmp_path, body, chart, change):
    state, states = march(open_target(program(tmp_path, body), "program", chart), 0.5, [0, 6, 9])
    np.testing.assert_array_equal(states, [change(state)] * 3)


def test_text_as_long_as_raw_doubles_is_text(tmp_path):
    stepper = open_target(program(tmp_path, "print(*['5.00000'] * 24)"), "program", "axis")
    states = stepper.march(SPHEROID.top, None, np.full(6, 5.0), 0.1, np.array([0, 1, 2, 3]))
    np.testing.assert_array_equal(states, np.full((4, 6), 5.0))


@pytest.mark.parametrize(("body", "words"), [
    ("print(1, 2, 3)", "must write 4 states of 6 numbers .* 24 in all, not 3"),
    ("print('moved to', *numbers)", "must write numbers, as text or as raw doubles, not 'moved to"),
    ("sys.exit('no ' * 99 + 'licence')", "ended with code 1: [.]{3}( no){90,97} licence$"),
    (f"{STILL}\nsys.stdout.flush()\nimport os; os.kill(os.getpid(), 9)", "ended with code -9: it said nothing"),
    ("print(*range(24))", "must write the start that it was given as the first of its states, not 0, 1, 2"),
    ("print(*[-5] * 24)", "must write the start that it was given as the first of its states, not -5, -5"),
    ("import time; time.sleep(9)", "had not ended 1 s after it was asked for 3 steps of 0.1"),
])  # fmt: skip
def test_a_program_that_writes_anything_else_is_told_so(tmp_path, body, words, monkeypatch):
    monkeypatch.setattr(heartbeat, "patience", 0.6)
    stepper = open_target(program(tmp_path, body), "program", "axis")
    with pytest.raises(symtop.SymtopError, match=words):
        stepper.march(SPHEROID.top, None, np.full(6, 5.0), 0.1, np.array([0, 1, 2, 3]))


@pytest.mark.slow
def test_a_slow_program_has_the_time_that_earlier_runs_took_also_after_a_short_one(tmp_path, monkeypatch):
    monkeypatch.setattr(heartbeat, "patience", 0.6)
    body = STILL.replace("for k", "import time; time.sleep(0.004 * n)\nfor k")
    for before in ([100], [100, 1]):
        stepper = open_target(program(tmp_path, body), "program", "axis")
        for steps in [*before, 200]:
            assert (stepper.march(SPHEROID.top, None, np.full(6, 5.0), 0.1, np.array([0, steps])) == 5.0).all()
    fresh = open_target(program(tmp_path, body), "program", "axis")
    with pytest.raises(symtop.SymtopError, match="had not ended 1 s after it was asked for 200 steps"):  # the control
        fresh.march(SPHEROID.top, None, np.full(6, 5.0), 0.1, np.array([0, 200]))


SERVES = """import os, sys, time
print('started', file=open({mark!r}, 'a'))
for numbers in map(str.split, sys.stdin):
    n, stride = map(int, numbers[4:6])
    for k in range(0, n + 1, stride): print(*numbers[6:12])
    {body}
"""


@pytest.mark.parametrize(("body", "words", "starts"), [
    *((f"print({end!r}, flush=True)", "", 1) for end in ("", "\r", "  ")),  # of Windows, Fortran
    (r"print(flush=True); time.sleep(0.3); print('\n', flush=True)", "", 1),
    ("print('\\nready', flush=True)", "must write nothing but its answer, which an empty line ends", 2),
    ("break", "must answer line after line, and ended after one: its form is program", 2),
    ("sys.exit('no licence')", "ended with code 1: no licence", 2),
    ("sys.stdout.flush()", "had not ended its answer with an empty line 2 s after it was asked for 3 steps of 0.1", 2),
    ("os.close(1); time.sleep(99)", "had not ended its answer with an empty line 2 s after", 2),
])  # fmt: skip
def test_a_server_is_started_once_and_again_only_if_it_fails(tmp_path, body, words, starts, monkeypatch):
    silent = "had not" in words
    monkeypatch.setattr(heartbeat, "patience", 2.0 if silent else 0.0 if "licence" in words else 20.0)
    monkeypatch.setattr(external, "STARTING_SECONDS", 0.0 if silent else 30.0)  # seconds, also of a second start
    mark, file = tmp_path / "starts", tmp_path / "engine.py"
    file.write_text(SERVES.format(mark=str(mark), body=body))
    stepper = open_target(f"{sys.executable} {file}", "server", "axis")
    for y in (5.0, 6.0):
        with pytest.raises(symtop.SymtopError, match=words) if words else contextlib.nullcontext():
            states = stepper.march(SPHEROID.top, None, np.full(6, y), 0.1, np.array([0, 1, 2, 3]))
            np.testing.assert_array_equal(states, np.full((4, 6), y))
    stepper.close()
    assert mark.read_text().count("started") == starts


def test_a_server_ends_with_the_judging_that_is_not_forked_too(tmp_path, keep_claims, monkeypatch):
    keep_claims("calls")
    monkeypatch.setitem(sys.modules, "jax", None)
    mark, file = tmp_path / "process", tmp_path / "engine.py"
    start = f"import os\nopen({str(mark)!r}, 'w').write(str(os.getpid()))\n"
    file.write_text(start + (EXAMPLES / "judged_program.py").read_text())
    assert symtop.judge(f"{sys.executable} {file}", form="server", quick=True).refuted == []
    with pytest.raises(ProcessLookupError):
        os.kill(int(mark.read_text()), 0)


def hangs(f, t, y, h):
    while True:
        time.sleep(0.01)


@pytest.fixture
def impatient(monkeypatch):
    monkeypatch.setattr("symtop.judging.adapters.adapter.QUICK_PATIENCE", 0.5)


@pytest.mark.parametrize(("target", "options", "words"), [
    ("nothing.py:step", {}, r"form program\), not 'nothing.py', which does not exist$"),
    ("no-such-program-anywhere -x", {"form": "program"}, "must be a command that can be run"),
    ("my 'engine -x", {"form": "program"}, 'must be a command that can be run, not "my \'engine -x"'),
    ("true", {}, "a trajectory such as FILE.csv, or a command with form program, not 'true'$"),
    ("rk4[axis]", {}, r"form program, not 'rk4\[axis\]', an integrator, whose claims `symtop claims rk4` measures$"),
    (midpoint, {"form": "rotation", "chart": "attitude"}, r"must take \(q, w, h, inertia, torque\), not \(f, t, y"),
    (midpoint, {"form": "rotation", "chart": "angles"}, "chart must be left out with form rotation, .* not 'angles'"),
    (lambda y, h: y, {}, r"must take \(f, t, y, h\), not \(y, h\)"),
    (midpoint, {"adaptive": True}, "need a class derived from OdeSolver"),
    (dict, {}, "must be derived from scipy.integrate.OdeSolver, not dict; any other step is a function, or the method"),
    (hangs, {}, r"a step of h = \d.* had not returned after \d+ s"),
    (lambda f, t, y, h: os.kill(os.getpid(), signal.SIGSEGV), {}, "its process was ended by SIGSEGV in a step of h = "),
    (lambda f, t, y, h: 1 / 0, {}, r"a step of h = .* raises ZeroDivisionError: division by zero"),
    (lambda f, t, y, h: sys.exit("so"), {}, r"a step of h = .* raises SystemExit: so"),
    (lambda f, t, y, h: y.fill(0.0), {}, "step must return the new state, 6 real numbers, not None"),
    (lambda f, t, y, h: y[:3], {}, r"6 real numbers, not ndarray of shape \(3,\)"),
    (lambda f, t, y, h: (y, h), {}, "step must return the new state, 6 real numbers, not tuple$"),
    (lambda f, t, y, h: y * 1j, {}, "6 real numbers, not ndarray .* complex128"),
])  # fmt: skip
def test_what_cannot_be_judged_is_refused_in_one_sentence(target, options, words, impatient):
    with pytest.raises(symtop.SymtopError, match=words):
        symtop.judge(target, quick=True, **options)


def test_a_file_beside_others_one_that_fails_and_a_name_that_is_not_there(tmp_path):
    file = tmp_path / "mine.py"
    (tmp_path / "helper.py").write_text("import os\nos.environ['JAX_ENABLE_X64']\nslope = lambda f, t, y: f(t, y)\n")
    file.write_text("from helper import slope\ndef leap(f, t, y, h):\n    return y + h * slope(f, t, y)\n"
                    "class One:\n    def leap(self, f, t, y, h):\n        return y\none = One()\n")  # fmt: skip
    with pytest.raises(symtop.SymtopError, match="must have a function 'step'; it has slope, leap, One"):
        open_target(str(file), None, "axis")
    assert open_target(f"{file}:leap", None, "axis").name == "mine-leap"
    assert open_target(f"{file}:one.leap", None, "axis").name == "mine-one.leap"  # the method of an object
    file.write_text("import nothing_of_that_name\n")
    with pytest.raises(symtop.SymtopError, match=r"the file mine\.py failed: ModuleNotFoundError"):
        open_target(str(file), None, "axis")
    assert (label_of("./my engine (new)"), "JAX_ENABLE_X64" in os.environ) == ("my-engine-new", False)


@pytest.mark.parametrize("claimed", [1000, *(pytest.param(claim, marks=pytest.mark.slow) for claim in (3, 10))])
def test_the_order_that_is_there_is_found_whatever_is_claimed(claimed, keep_claims):
    """Long steps, as a method of order 10 may take, show no slope of one of order 2."""
    keep_claims("order")
    finding = symtop.judge(midpoint, order=claimed, quick=True)["order"]
    assert (finding.verdict, finding.declared) == ("refuted", str(claimed))
    assert finding.value == pytest.approx(2.0, abs=0.02)


def _keeps_its_slope(f, t, y, h, memory=[np.zeros(6)]):  # noqa: B006, B008  (what it keeps)
    before, memory[0] = memory[0], f(t, y)
    return y + h * memory[0] + 1e-3 * h * before


PENDULUM = symtop.Scene("pendulum", symtop.SymmetricTop(1.0, 0.5, 1.0), symtop.Angles(theta=2.0), 20.0)


@pytest.mark.parametrize("scene", [*defer("sleeping"), *defer("separatrix", PENDULUM, mark="slow")])
def test_a_right_step_is_not_refuted_beside_a_pole_or_without_momenta(scene, keep_claims, monkeypatch):
    """Beside a pole angles know a state badly; a pendulum has momenta of zero, which are no unit."""
    keep_claims("calls", "order")
    judge = partial(symtop.judge, scene=scene, quick=True)
    ledger = judge(rk4, order=4)
    assert (ledger.refuted, ledger["order"].verdict, ledger["calls"].measured.kind) == ([], "confirmed", "a function")
    faults = (midpoint, 3), (lambda f, t, y, h: rk4(f, t, y, h) + 1e-10 * h * (f(t, y) - f(t + h, y + h * f(t, y))), 4)
    verdicts = [judge(step, order=power).refuted for step, power in faults], judge(_keeps_its_slope)["calls"].verdict
    assert verdicts == ([["order"]] * 2, "refuted")
    if scene == "separatrix":  # no run of order 2 is near it: the motion grows errors a millionfold
        monkeypatch.undo()  # an eighth of the time is too little where processors are busy
        assert judge(midpoint, order=2)["order"].verdict == "confirmed"
        assert judge(lambda f, t, y, h: midpoint(f, t, y, 1.001 * h), order=2).refuted == ["order"]


@pytest.mark.parametrize("memory", [0.0, 1e-3])
def test_what_a_run_that_blows_up_makes_of_the_last_bit_is_nothing_that_a_step_keeps(memory):
    scene, calls_made = symtop.scene("separatrix"), itertools.count()
    stepper = PythonStep(lambda f, t, y, h: midpoint(f, t, y, h) + memory * h * (next(calls_made) % 7), "axis")
    missed, _ = calls._largest_gap(stepper, scene, calls.STEP_SHARE * scene.time_scale() / 1.6, [(8, 30), (3, 4)])
    assert (missed > calls.LATE_GAP) is (memory > 0.0)


def in_single(step):
    """A step in single precision."""
    return lambda f, t, y, h: step(lambda s, z: np.float32(f(s, z)), t, np.float32(y), np.float32(h))


@pytest.mark.parametrize("scene", [pytest.param("spheroid", marks=pytest.mark.slow), "heavy-brick"])
def test_single_precision_is_no_other_motion_and_one_of_a_step_in_it_is(scene, keep_claims):
    """Runs of more steps than their rounding lets be judged end 1e-6 away; an order that it hides is undecided."""
    keep_claims("order")
    options = {"scene": scene, "quick": True}
    assert symtop.judge(in_single(midpoint), order=2, **options)["order"].verdict == "confirmed"
    assert symtop.judge(in_single(midpoint), order=3, **options).refuted == ["order"]
    with pytest.MonkeyPatch.context() as patch:  # time for every step that single precision allows, on any machine
        patch.setattr(subject, "SLOPE_SECONDS", (600.0, 600.0))
        added = lambda f, t, y, h: y + (in_single(rk4)(f, t, y, h) - np.float32(y)).astype(float)
        findings = [symtop.judge(step, order=4, **options)["order"] for step in (in_single(rk4), added)]
    words = "undecided: single precision hides errors below about 1e-04: "
    assert all(f"{finding.verdict}: {finding.why}".startswith(words) for finding in findings)
    finding = symtop.judge(in_single(lambda f, t, y, h: midpoint(f, t, y, 0.999 * h)), order=2, **options)["order"]
    assert (finding.verdict, finding.measured.kind) == ("refuted", "wrong limit")
    assert "single" not in symtop.judge(midpoint, order=2, **options)["order"].why


@pytest.mark.quick
def test_single_precision_refutes_nothing_that_its_rounding_hides(keep_claims):
    """It moves a step forth and back by 1e-8, and a bracket from differences by 1e-6."""

    def euler(state, h, dT, dV, share=1.0):
        (x, p), h = map(np.float32, state), np.float32(h)
        kicked = p - h * np.float32(dV(x))
        return x + h * np.float32(dT(share * kicked + (1.0 - share) * p)), kicked

    def implicit(f, t, y, h):
        slope = f(t, y)
        for _ in range(30):
            slope = f(t + h / 2, y + h / 2 * slope)
        return y + h * slope

    keep_claims("symplectic", "symmetric", "energy", "p_psi", "pole")
    claims = {"quick": True, "symplectic": True, "symmetric": True, "energy": "bounded", "form": "separable"}
    good, bad = symtop.judge(euler, **claims), symtop.judge(lambda *args: euler(*args, share=0.0), **claims)
    verdicts = good["symplectic"].verdict, good["energy"].verdict
    assert (good.refuted, *verdicts) == (["symmetric"], "undecided", "confirmed")
    assert good["symplectic"].why.startswith("single precision hides errors below about 4e-04: ")
    assert bad.refuted == ["symplectic", "symmetric", "energy"]
    assert symtop.judge(in_single(rk4), quick=True)["pole"].measured.kind == "passes"  # 1e-6 off, whatever the step
    explicit = in_single(lambda f, t, y, h: y + h * f(t, y))
    for step, verdict in ((implicit, "confirmed"), (in_single(implicit), "undecided"), (explicit, "refuted")):
        ledger = symtop.judge(step, quick=True, symmetric=True, conserves=("p_psi",))
        assert ledger["symmetric"].verdict == verdict
        assert ledger["p_psi"].verdict == ("confirmed" if step is implicit else "refuted")  # to the rounding of doubles


def test_an_axis_that_stays_upright_is_refused_in_a_sentence_and_one_that_hangs_is_judged(keep_claims):
    upright, hanging = (
        symtop.Scene("still", symtop.SymmetricTop(1.0, 1.0, 1.0), symtop.Angles(theta=theta, psi_dot=5.0), 20.0)
        for theta in (0.0, np.pi)
    )
    keep_claims("calls")
    assert symtop.judge(midpoint, scene=hanging, quick=True)["calls"].measured.kind == "a function"
    assert symtop.judge(_keeps_its_slope, scene=hanging, quick=True)["calls"].verdict == "refuted"
    with pytest.raises(symtop.SymtopError, match="its axis stays upright"):
        symtop.judge(midpoint, scene=upright, quick=True)


@pytest.mark.parametrize("claimed", [*defer(2, mark="slow"), *defer(12)])
def test_a_motion_that_is_wrong_is_told_so_whatever_is_claimed(claimed, keep_claims):
    keep_claims("order")
    for factor, expected in ((0.999, 2e-3), (0.0, None)):  # the second stands still
        step = lambda f, t, y, h, factor=factor: midpoint(f, t, y, factor * h)
        finding = symtop.judge(step, order=claimed, quick=True)["order"]
        assert finding.measured.kind == "wrong limit"
        assert expected is None or finding.value == pytest.approx(expected, rel=0.2)


def test_a_step_that_returns_nan_or_the_derivative_is_told_so(keep_claims):
    keep_claims("calls", "order", "pole")
    for value, words in ((np.nan, "returns NaN"), (np.inf, "returns infinity"), (0.0, "jumps")):
        ledger = symtop.judge(lambda f, t, y, h, value=value: f(t, y) + value, quick=True)
        assert (ledger["calls"].measured.kind, ledger["calls"].verdict) == (words, "refuted")
        assert ("differ" in ledger["calls"].why, bool(ledger["order"].measured)) == (False, False)
    rounded = lambda *args: np.array([float(f"{x:.9g}") for x in midpoint(*args)])
    still = lambda f, t, y, h: midpoint(f, t, y, h) if abs(h) > 1e-6 else y  # too short to be made, it says
    late = lambda f, t, y, h: midpoint(f, t, y, h) * (1.0 if t < 50.0 else np.nan)
    assert symtop.judge(late, quick=True, order=2, seed=7).refuted == ["order"]
    for step, kind in ((midpoint, "a function"), (rounded, "few digits"), (still, "stands still")):
        assert symtop.judge(step, quick=True)["calls"].measured.kind == kind
    pole = symtop.judge(lambda f, t, y, h: rk4(f, t, y, h) if y[3:] @ y[3:] > 9.0 else None, quick=True)["pole"]
    assert (pole.declared, pole.verdict) == ("", "undecided")  # a bare step that fails there has not claimed it


@pytest.mark.skipif(not Path("/proc/self/schedstat").exists(), reason="the system does not count what waits")
def test_waiting_for_a_processor_takes_none_of_the_time_that_judging_has():
    """Two processes on one core; sleep is no such waiting (the control)."""
    busy, allowed = subprocess.Popen([sys.executable, "-c", "while True: pass"]), os.sched_getaffinity(0)
    try:
        for process in (0, busy.pid):
            os.sched_setaffinity(process, {min(allowed)})
        wall, counted, worked = time.monotonic(), clock(os.getpid()), time.process_time()
        while time.process_time() < worked + 0.3:
            pass
        assert clock(os.getpid()) - counted < 0.8 * (time.monotonic() - wall)
        counted = clock(os.getpid())
        time.sleep(0.2)
        assert clock(os.getpid()) - counted > 0.19
    finally:
        os.sched_setaffinity(0, allowed)
        busy.kill()
        busy.wait()


@pytest.mark.slow
def test_a_step_that_hangs_backwards_is_judged_forwards(impatient, keep_claims):
    keep_claims("calls", "order", "symplectic")
    ledger = symtop.judge(lambda f, t, y, h: (hangs if h < 0 else midpoint)(f, t, y, h), quick=True, order=2)
    assert (ledger["calls"].measured.kind, ledger["order"].verdict) == ("forward only", "confirmed")
    assert (ledger["symplectic"].measured.kind, heartbeat.inside) == ("no", False)


def changes_its_input(f, t, y, h):
    y += h / 2 * f(t, y)
    return y + h / 2 * f(t + h / 2, y)


def test_findings_come_as_they_are_made_and_are_a_screen_and_a_dataset(monkeypatch):
    shorten(monkeypatch)
    monkeypatch.setattr("symtop.judging.judge_step.seconds_a_step", lambda *_: 7e-6)  # on a slow machine it blows up
    events = []
    ledger = symtop.judge(changes_its_input, quick=True, tell=events.append)
    assert (events[0].name, events[1:]) == ("changes_its_input", list(ledger.findings))
    assert [entry.claim for entry in ledger.findings] == [claim for stage in stages("step") for claim in stage.claims]
    assert {finding.verdict for finding in ledger.findings} <= set(VERDICTS) - {"refuted", "confirmed"}
    assert "writes to its input" in ledger["calls"].why
    data = ledger.dataset()
    assert data["measured"].values.tolist() == [str(finding.measured) for finding in ledger.findings]
    assert data.attrs["name"] == "changes_its_input"
    texts = {line[:15].strip(): line[15:] for line in str(ledger).splitlines()}
    expected = {"order": "1.0", "symplectic": "no, ", "p_phi": "kept, ", "energy": "drifts, ", "work": "2.0 "}
    assert [name for name, words in expected.items() if not texts[name].startswith(words)] == []


EXAMPLES = ROOT / "studies" / "examples"
STEPS = EXAMPLES / "judged_steps.py"
run_judge = partial(code_and_output, "judge", "--quick")


def test_a_file_with_a_step_says_what_it_is_and_writes_it(tmp_path, monkeypatch, keep_claims):
    keep_claims("order", "symplectic", "symmetric", "energy", "p_phi")
    shutil.copy(STEPS, tmp_path / "mine.py")
    monkeypatch.setenv("HOME", str(tmp_path))
    code, output = run_judge("~/mine.py:heun", "--output=~/found.nc", "--card=~/card.html", "--badge", "~/badge.svg")
    assert code == 0, output
    assert "It is: order 2, not symplectic, not reversible, keeps p_phi; not the energy" in output
    with xr.open_dataset(tmp_path / "found.nc") as data:
        assert str(data.sel(claim="order")["verdict"].values) == "measured"
    assert {"card.html", "badge.svg"} <= {file.name for file in tmp_path.iterdir()}
    assert f"written to {tmp_path / 'card.html'}" in output


@pytest.mark.slow
def test_a_claim_is_implied_if_it_follows_from_those_that_are_made(keep_claims):
    keep_claims("order", "time", "energy")
    for words, end in (((), "(time): 1 confirmed."), (("--symplectic",), "(energy and time): 1 confirmed, 1 refuted.")):
        assert run_judge(f"{STEPS}:heun", "--order", "2", *words)[1].endswith(f"Implied by them {end}\n")


@pytest.mark.parametrize(("arguments", "words"), [
    ((f"{STEPS}:heun", "--order", "2"), "It is: order 2, not symplectic"),
    ((f"{STEPS}:leapfrog", "--form", "separable", "--order", "2", "--symplectic", "--symmetric"),
     "It is: order 2, symplectic, reversible, the energy bounded"),
    *(pytest.param(words, f"It is: order {words[-1]}, not symplectic", marks=pytest.mark.slow) for words in (
        (f"{STEPS}:Ralston", "--order", "3"), (f"{STEPS}:engine", "--form", "rotation", "--order", "1"),
        *((f"{sys.executable} {EXAMPLES / 'judged_program.py'}", "--form", form, "--order", "2")
          for form in ("program", "server")))),
])  # fmt: skip
def test_the_example_of_a_form_is_what_it_says(arguments, words, keep_claims):
    keep_claims("order", "symplectic", "symmetric", *(["energy"] if "energy" in words else []))
    code, output = run_judge(*arguments)
    assert (code, words in output) == (0, True), output


def test_a_path_with_a_space_is_a_path_and_a_program_must_be_named(tmp_path, keep_claims):
    keep_claims("calls")
    mark, folder = tmp_path / "touched", tmp_path / "a folder"
    folder.mkdir()
    shutil.copy(STEPS, folder / "my steps.py")
    code, output = run_judge(f"{folder / 'my steps.py'}:heun")
    assert code == 0, output
    for target in (f"touch {mark}", f"touch {mark}.py:step"):
        code, output = run_judge(target)
        assert (code, "form program" in output, mark.exists()) == (2, True, False)


def euler_of_matrices(R, w, h, inertia, torque):
    w = w + h * rates(R, w, inertia, torque)
    return R @ Rotation.from_rotvec(h * w).as_matrix(), w


def euler_of_quaternions(q, w, h, inertia, torque):
    w = w + h * rates(q, w, inertia, torque)
    return product(q, turn(h * w)), w


def of_rotation(function, step_size, horizon):
    method = integrator(RotationStep(function))
    return symtop.simulate("spheroid", method, step_size=step_size, horizon=horizon, guard=False)


def test_a_step_of_rotation_matrices_is_judged_as_one_of_quaternions_until_it_is_no_rotation():
    matrices, quaternions = (of_rotation(step, 0.01, 2.0) for step in (euler_of_matrices, euler_of_quaternions))
    assert matrices.attrs["outcome"] == quaternions.attrs["outcome"] == "ok"
    np.testing.assert_allclose(matrices["axis"].values, quaternions["axis"].values, atol=1e-11)
    np.testing.assert_allclose(matrices["p_phi"].values, quaternions["p_phi"].values, rtol=1e-10)
    longer = lambda q, w, h, inertia, torque: euler_of_quaternions(q, w, h, inertia, lambda pose: torque(2.0 * pose))
    np.testing.assert_allclose(of_rotation(longer, 0.01, 2.0)["axis"], quaternions["axis"], atol=1e-11)
    errors = [float(symtop.errors(of_rotation(euler_of_matrices, h, 0.5))["axis"].max()) for h in (2e-3, 1e-3)]
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.1)  # order 1
    # SciPy raises an error of its own where one is left-handed, as a step that blows up may return it.
    stretches = lambda R, w, h, inertia, torque: (R + h * np.cross(R, w), w + h * rates(R, w, inertia, torque))
    assert of_rotation(stretches, 0.01, 2.0).attrs["outcome"] == "not_normalised"
    assert 1e-13 < abs(np.linalg.norm(of_rotation(stretches, 1e-5, 1e-3)["axis"].values[-1]) - 1.0) < 1e-3
    run = of_rotation(lambda R, w, h, inertia, torque: (R @ np.diag([1.0, 1.0, -1.0]), w), 0.01, 0.1)
    assert (run.attrs["outcome"], run.attrs["reached_time"]) == ("not_finite", 0.0)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="there is no fork")
def test_the_process_of_a_method_ends_with_a_judge_that_is_killed():
    """kill -9 leaves no process behind that waits for it; before the kill it does wait."""
    code = (
        "import time\nfrom symtop.judging.remote import Process\n"
        "first, second = (Process(lambda: {'ping': lambda: 1}) for _ in range(2))\n"
        "first.call('ping'), second.call('ping')\n"
        "print(first.process.pid, second.process.pid, flush=True)\ntime.sleep(600)\n"
    )
    judge = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    waiting = [int(pid) for pid in judge.stdout.readline().split()]
    assert all(map(_lives, waiting))
    judge.kill()
    judge.communicate()
    deadline = time.monotonic() + 20.0
    while any(map(_lives, waiting)) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not any(map(_lives, waiting))


def _lives(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


@pytest.mark.slow
def test_a_step_that_slows_down_is_judged_on_shorter_runs_and_one_that_stops_says_why_once(keep_claims, monkeypatch):
    """A step takes 0.5 ms from t = 20 on, which its first ones do not tell; or 2.5 ms, always, after 1 s to open it."""
    keep_claims("energy", "p_phi", "p_psi")
    monkeypatch.setattr(judge_step, "QUICK_VERDICT_SECONDS", (1.0, 2.5, 1.0))

    def slow_from(since, seconds):
        def step(f, t, y, h):
            if t >= since:
                time.sleep(seconds)
            return midpoint(f, t, y, h)

        return symtop.judge(step, quick=True)

    slow = slow_from(20.0, 5e-4)
    monkeypatch.setattr(judge_step, "seconds_a_step", lambda *args: time.sleep(1.0) or subject.seconds_a_step(*args))
    stuck = slow_from(0.0, 2.5e-3)
    assert (slow["energy"].measured.kind in ("drift", "growing"), 300 < slow.traces["steps_run"] < 5000) == (True, True)
    assert [stuck[claim].verdict for claim in stuck] == ["undecided"] * 3
    assert re.search(r"not judged within [2-9] s, at [\d.]+ ms a call; judge it without --quick", stuck["energy"].why)
    screen = str(stuck).splitlines()
    assert sum("not judged" in line for line in screen) == 1
    assert "p_psi          undecided, as with energy" in screen
