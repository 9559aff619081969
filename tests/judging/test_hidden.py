"""What a method does elsewhere, later or in a longer run is found; and what is right at every start is not refuted.

`blind/hidden.py` holds steps that are what they claim at the scene's own start, of its energy, in few steps and early.
"""

import importlib.util
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from scipy import integrate

import symtop
from symtop.cli.main import main
from symtop.judging.battery import judge as judged
from symtop.methods.framework.plan import Run

FILE = Path(__file__).parent / "blind" / "hidden.py"
spec = importlib.util.spec_from_file_location("blind_hidden", FILE)
HIDDEN = importlib.util.module_from_spec(spec)
spec.loader.exec_module(HIDDEN)
HIDDEN.INERTIA = symtop.scene("spheroid").top.I1
QUICKLY = ("late_euler", "half_symmetric", "adams_from_memory", "edits_the_judge")


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[] if n in QUICKLY else pytest.mark.slow) for n in HIDDEN.CLAIMS]
)
def test_what_is_hidden_at_the_start_is_found(name):
    claims, line = HIDDEN.CLAIMS[name]
    ledger = symtop.judge(getattr(HIDDEN, name), quick=True, **claims)
    assert line in ledger.refuted, str(ledger)


@pytest.mark.slow
def test_a_step_that_tires_after_a_hundred_thousand_is_found_in_full():
    """It is of order 4 as long as the order is measured; a run of as many steps, and the first call again, show it."""
    HIDDEN._made[0] = -80_000
    assert "calls" in symtop.judge(HIDDEN.tires, order=4).refuted


def test_random_noise_is_no_memory():
    assert symtop.judge(HIDDEN.noisy, quick=True)["calls"].measured.kind == "not repeatable"


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[] if n == "own_drift" else pytest.mark.slow) for n in HIDDEN.RIGHT]
)
def test_correct_methods_of_their_kinds_are_not_refuted(name):
    claims, options = HIDDEN.RIGHT[name]
    ledger = symtop.judge(getattr(HIDDEN, name), quick=True, **claims, **options)
    assert ledger.refuted == [], str(ledger)
    verdicts = {ledger[claim].verdict for claim in claims if claim in ("order", "symplectic", "symmetric")}
    assert verdicts == {"confirmed"}, str(ledger)


@pytest.mark.parametrize(
    ("name", "order", "quick"),
    [
        ("RK23", 3, True),
        ("RK45", 5, True),
        ("DOP853", 8, True),
        pytest.param("Radau", 5, False, marks=pytest.mark.slow),
    ],
)
def test_the_classes_of_scipy_have_their_orders(name, order, quick):
    ledger = symtop.judge(getattr(integrate, name), quick=quick, order=order)
    assert ledger.refuted == [], str(ledger)
    assert ledger["order"].verdict == "confirmed", str(ledger)


@pytest.mark.parametrize("name", ["BDF", "LSODA"])
def test_classes_of_variable_order_are_judged_at_a_tolerance(name):
    ledger = symtop.judge(getattr(integrate, name), adaptive=True, quick=True)
    assert ledger.refuted == []
    assert ledger["pole"].verdict == "measured"


def test_the_stages_of_an_implicit_class_are_solved_and_newton_is_left_as_it_was():
    from scipy.integrate._ivp import radau

    assert radau.NEWTON_MAXITER == 6
    found = symtop.judge(integrate.Radau, quick=True, order=5)
    assert found.refuted == [], str(found)
    assert "h^5" in found["order"].why
    assert symtop.judge(integrate.Radau, quick=True, order=6).refuted == ["order"]  # the control
    assert radau.NEWTON_MAXITER == 6


def test_the_same_seed_draws_the_same():
    first, again = (symtop.judge(HIDDEN.late_euler, quick=True, order=4, seed=7)["order"] for _ in range(2))
    assert first.why == again.why
    assert "of seed 7" in first.why
    assert symtop.judge(HIDDEN.rk4, quick=True, order=4, seed=7).about.seed == 7


def test_a_step_written_for_f_of_y_may_say_so():
    def wrong_times(f, t, y, h):
        return y + h * f(t, y + h / 2 * f(t + 0.3 * h, y))

    assert "time" in symtop.judge(wrong_times, quick=True, order=2).refuted
    ledger = symtop.judge(wrong_times, quick=True, order=2, autonomous=True)
    assert ledger.refuted == []
    assert ledger["time"].verdict == "inapplicable"


# ---- registered integrators ------------------------------------------------------------------------------------------


def seeing(below):
    few, many = (symtop.integrator(name).solvers["axis"] for name in ("rk4", "gauss-4"))

    def solver(top, start, plan):
        return (few if plan.marks[-1] < below else many)(top, start, plan)

    return symtop.Integrator("seeing", "other", "sees its plan", {"axis": solver}, order=4)


@pytest.mark.parametrize("below", [300, 5000, 20_000])
def test_a_solver_that_sees_its_plan_contradicts_itself(below):
    ledger = judged(seeing(below), symtop.scene("spheroid"), quick=True)
    assert ledger.refuted == ["reported"]
    assert "a run contradicts itself" in ledger["reported"].why


@pytest.mark.parametrize("name", ["rk4", "gauss-4", "strang", "midpoint"])
def test_one_that_does_not_is_what_it_reports(name):
    assert judged(symtop.integrator(name), symtop.scene("spheroid"), quick=True).refuted == []


PLUGIN = """
import ctypes, os
import symtop
def nothing(top, start, plan): return None
def leaves(top, start, plan): os._exit(0)
def crashes(top, start, plan): ctypes.string_at(0)
for solver in (nothing, leaves, crashes):
    symtop.register(symtop.Integrator(f"{solver.__name__}-at-once", "other", "x", {"axis": solver}, order=4))
"""


@pytest.mark.parametrize(
    ("name", "says"),
    [("nothing", "must return a Run"), ("leaves", "ended with code 0"), ("crashes", "was ended by SIGSEGV")],
)
def test_a_plug_in_that_fails_is_told_of(tmp_path, name, says):
    (tmp_path / "plugin.py").write_text(PLUGIN)
    words = [
        sys.executable,
        "-m",
        "symtop.cli",
        "claims",
        f"{name}-at-once",
        "--plugin",
        str(tmp_path / "plugin.py"),
        "--quick",
    ]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert says in done.stdout


def test_a_plug_in_that_ends_its_process_when_it_is_loaded_is_told_of(tmp_path):
    (tmp_path / "plugin.py").write_text("import os\nos._exit(0)\n")
    words = [sys.executable, "-m", "symtop.cli", "claims", "--plugin", str(tmp_path / "plugin.py")]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "plugin plugin.py cannot be loaded: its process ended with code 0" in done.stderr


# ---- targets ---------------------------------------------------------------------------------------------------------


def test_a_path_with_a_space_is_a_path_and_a_program_must_be_named(tmp_path):
    mark = tmp_path / "touched"
    folder = tmp_path / "a folder"
    folder.mkdir()
    shutil.copy(FILE, folder / "my steps.py")
    done = CliRunner().invoke(main, ["judge", f"{folder / 'my steps.py'}:rk4", "--quick", "--order", "4"])
    assert done.exit_code == 0, done.output
    done = CliRunner().invoke(main, ["judge", f"touch {mark}", "--quick"])
    assert done.exit_code == 2
    assert "form program" in done.output
    assert not mark.exists()
    done = CliRunner().invoke(main, ["judge", f"touch {mark}.py:step", "--quick"])
    assert done.exit_code == 2
    assert not mark.exists()


def test_a_run_that_is_returned_is_one_of_numbers():
    """What a process sends back is read as numbers and words, never as a pickle."""
    from symtop.judging.remote import Process, separated, solvers_of

    def solver(top, start, plan):
        shape = (plan.times.size, 6)
        return Run(np.full(shape, np.nan), np.zeros(shape[0]), np.zeros(shape[0]), 1, 0, 0, "not_finite", 0.0)

    method = symtop.Integrator("nan", "other", "x", {"axis": solver})
    with Process(lambda: solvers_of(method)) as process:
        process.allow(30.0)
        run = symtop.simulate("spheroid", separated(method, process), step_size=0.1, guard=False)
    assert run.attrs["outcome"] == "not_finite"
    assert np.isnan(run["energy"].values).all()


def test_a_command_whose_reader_leaves_ends():
    command = [sys.executable, "-m", "symtop.cli", "judge", f"{FILE}:rk4", "--quick"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as process:
        process.stdout.readline()
        process.stdout.close()
        assert process.wait(60.0) != 0
