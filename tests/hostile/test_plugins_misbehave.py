"""Plug-ins that misbehave: each ends in one sentence and its exit code, whatever calls them, and spoils nothing."""

import math
import re
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

import symtop
from symtop.core.signals import InterruptedByUser, told_apart
from symtop.methods.framework.calling import solve
from symtop.run import plugins
from tests.commands import code_and_output, finish, symtop as command

PLUGIN = Path(__file__).with_name("plugin.py")
RUN = ["--step-size", "0.01", "--horizon", "2"]
BEFORE = repr(symtop.scene("spheroid"))


@pytest.fixture(scope="module", autouse=True)
def misbehaving():
    plugins.load(PLUGIN)
    return next(module for module in [*sys.modules.values()] if getattr(module, "__file__", None) == str(PLUGIN))


def output_of(words):
    """Exit code and the lines of a command that must not end in a traceback, and must leave the scene as it was."""
    with warnings.catch_warnings():
        code, output = code_and_output(*words)
    assert repr(symtop.scene("spheroid")) == BEFORE
    return code, output.splitlines()


@pytest.mark.parametrize("guard", ["--guard", "--no-guard"])
def test_every_refused_run_is_one_sentence_and_what_can_be_used_is_used(misbehaving, guard):
    for name in misbehaving.REFUSED:
        code, lines = output_of(["run", "spheroid", name, *RUN, guard])
        assert (code, len(lines)) == (2, 1), (name, lines)
        assert lines[0].startswith(f"symtop: integrator {name} "), lines
    _, (_, *expected) = output_of(["run", "spheroid", "midpoint[angles]", *RUN, guard])
    for name in misbehaving.TOLERATED:
        code, (_, *lines) = output_of(["run", "spheroid", name, *RUN, guard])
        assert code == 0, name
        if "float32" not in name:
            ends, expected_ends = ([line.split("largest")[-1] for line in part[-5:]] for part in (lines, expected))
            assert ends == expected_ends, name
    for name in misbehaving.BROKEN:
        assert output_of(["run", "spheroid", name, *RUN, guard])[0] == 3, name


def test_an_ensemble_of_them_is_one_sentence(misbehaving):
    words = ["--members", "3", "--step-size", "0.1", "--horizon", "1"]
    for name in misbehaving.REFUSED:
        code, lines = output_of(["ensemble", name, *words])
        assert code in (2, 3), (name, lines)
        assert lines[-1].startswith(("symtop: ", "ensemble")) or code == 3, lines


@pytest.mark.slow
def test_the_claims_of_all_of_them_are_judged(misbehaving):
    for name in (*misbehaving.REFUSED, *misbehaving.TOLERATED, *misbehaving.BROKEN):
        assert output_of(["claims", name, "--quick"])[0] in (0, 1), name


def test_a_solver_does_not_reach_the_plan_or_an_earlier_run_and_its_interrupt_is_not_the_users(misbehaving):
    scene, plan = symtop.scene("spheroid"), symtop.Plan.steps(0.01, np.arange(5))
    before = scene.top.I1, scene.start.theta
    for name in ("changes-arguments", "changes-and-raises"):
        with pytest.raises(symtop.SymtopError, match="must not change the top or the start"):
            solve(symtop.integrator(name), "angles", scene.top, scene.start, plan)
        assert (scene.top.I1, scene.start.theta) == before
    assert plan.times.tolist() == [0.0, 0.01, 0.02, 0.03, 0.04]
    keeper = symtop.integrator("keeps-its-array")
    first = solve(keeper, "angles", scene.top, scene.start, plan)
    solve(keeper, "angles", scene.top, scene.start, plan)
    assert np.isfinite(first.states).all()
    for name, error in (("signals-itself", InterruptedByUser), ("raises-interrupt", symtop.SymtopError)):
        with told_apart(), pytest.raises(error):
            solve(symtop.integrator(name), "angles", scene.top, scene.start, plan)


KERNEL = """
import symtop
from beside_own import ZERO, plain

def step(par, rule, state, carry, h):
    return {returns}

loop = symtop.kernel_loop(lambda par, rule, state, h: (ZERO,), step, lambda par, rule, before, dstate, h: (0.0, 0.0))
solver = symtop.FixedStep(loop, (0.0,), symtop.on_angles, 1, implicit=False)
method = symtop.Integrator(name="own-kernel", family="other", summary="", solvers={{"angles": solver}})
symtop.register(method, replace=True)
"""


@pytest.mark.parametrize(("returns", "message"), [
    ("(0.0,) * 4, carry, 1, 0", None),
    ("(0.0, 0.0), carry, 1, 0", "Cannot unify UniTuple(float64 x 4) and UniTuple(float64 x 2) for 'dstate.N'"),
    ("plain(state)", "a function that a kernel calls is decorated with numba.extending.register_jitable"),
    ("unknown(state)", "TypingError: NameError: name 'unknown' is not defined"),
    ("(0.0,) * 4, carry, 1, 9", "must return an outcome from 0 to 6, not 9"),
    ("(0.0,) * 4, carry, 1, -1", "must return an outcome from 0 to 6, not -1"),
])  # fmt: skip
def test_a_kernel_that_does_not_compile_or_returns_no_outcome_is_one_sentence(returns, message, tmp_path):
    file = tmp_path / "own.py"
    file.write_text(KERNEL.format(returns=returns))
    (tmp_path / "beside_own.py").write_text("ZERO = 0.0\ndef plain(x):\n    return x\n")
    run = "spheroid", "own-kernel"
    for words in (["run", *run], ["long", *run, "--steps", "10"], ["ensemble", "own-kernel", "--members", "3"]):
        horizon = [] if words[0] == "long" else ["--horizon", "1"]
        code, lines = output_of([*words, "--step-size", "0.1", *horizon, "--plugin", file])
        if message is None:
            assert code == 0, lines
        else:
            assert (code, len(lines)) == (2, 1), lines
            assert lines[0].startswith("symtop: "), lines
            # numba counts the assignments to a variable in the bytecode, which differs between versions of Python
            assert re.sub(r"(?<='dstate\.)\d+", "N", lines[0]).endswith(message), lines


@pytest.mark.parametrize("count", [math.nan, math.inf, 1e30])
def test_a_number_of_steps_that_is_none_is_refused(count, misbehaving):
    solver = misbehaving.changed(steps=lambda _: count)
    method = symtop.Integrator(name="counted", family="other", summary="", solvers={"angles": solver})
    for run, target in ((symtop.simulate, "spheroid"), (symtop.ensemble, symtop.population(3))):
        with pytest.raises(symtop.SymtopError, match="must return a finite number of steps, not"):
            run(target, method, step_size=0.01, horizon=0.5)


def test_counts_of_numpy_are_numbers_in_a_dataset(misbehaving):
    solver = misbehaving.changed(steps=np.int64, force_evaluations=lambda _: np.int64(100), reached=np.float32)
    method = symtop.Integrator(name="counted", family="other", summary="", solvers={"angles": solver})
    run = symtop.simulate("spheroid", method, step_size=0.01, horizon=0.5, guard=False)
    counts = [run.attrs[name] for name in ("steps", "force_evaluations", "reached_time")]
    assert (counts, [type(count) for count in counts]) == ([50, 100, 0.5], [int, int, float])


def test_a_solver_that_expects_steps_forwards_is_ended(misbehaving, monkeypatch):
    """Probes of reversibility ask for a step backwards: `claims` waited for ever for a loop up to the horizon."""
    monkeypatch.setattr("symtop.methods.framework.calling.PATIENCE", 0.2)
    scene, method = symtop.scene("spheroid"), symtop.integrator("forwards-only")
    assert solve(method, "angles", scene.top, scene.start, symtop.Plan.steps(0.01, [1])).outcome == "ok"
    with pytest.raises(symtop.SymtopError, match=r"forwards-only failed: TimeoutError: it was not done after 0\.2 s"):
        solve(method, "angles", scene.top, scene.start, symtop.Plan.steps(-0.01, [1]))


@pytest.mark.slow
def test_in_processes_of_their_own():
    for name, code in (("raises-system-exit", 2), ("raises-interrupt", 2), ("raises-base", 2), ("signals-itself", 130)):
        result = finish(command("run", "spheroid", name, *RUN, "--plugin", PLUGIN))
        assert result[0] == code, result
        assert result[2] == "symtop: interrupted\n" if code == 130 else result[2].count("\n") == 1


def test_a_study_whose_measure_exits_has_a_case_that_failed(tmp_path):
    script = tmp_path / "leaving.py"
    script.write_text(
        "import sys\nfrom symtop.runner.study import Case, Study\n"
        "class Odd(BaseException):\n    def __str__(self):\n        raise ValueError\n"
        "def measure(case):\n    sys.exit(0) if case.settings['k'] else (_ for _ in ()).throw(Odd())\n"
        "STUDY = Study('leaving', 't', 'q', lambda quick: [Case('spheroid', 'midpoint', {'k': k}) "
        "for k in range(2)], measure)\n"
    )
    code, lines = output_of(["study", str(script), "--results", str(tmp_path / "r")])
    assert code == 2
    assert "no case could be measured" in lines[-1]
    assert len(list((tmp_path / "r").rglob("*.failed.json"))) == 2


@pytest.mark.parametrize("name", ["../out", "/tmp/out", "a/b", "..", "", "x\0y", "é"])
def test_a_study_writes_nothing_beside_its_results(tmp_path, monkeypatch, name):
    monkeypatch.setattr("sys.dont_write_bytecode", False)  # as on most machines
    script = tmp_path / "named.py"
    script.write_text(f"from symtop.runner.study import Study\nSTUDY = Study({name!r}, *[None] * 7)\n")
    code, lines = output_of(["study", str(script), "--results", str(tmp_path / "in" / "r")])
    assert (code, len(lines)) == (2, 1)
    assert [path.name for path in tmp_path.iterdir()] == ["named.py"]
