"""Registered integrators in a process of their own: one that knows its plan, and plug-ins that fail."""

import numpy as np
import pytest

import symtop
from symtop.judging.battery import judge
from symtop.judging.remote import Process, separated, solvers_of
from symtop.methods.framework.plan import Run
from tests import commands
from tests.commands import call


def seeing(below):
    few, many = (symtop.integrator(name).solvers["axis"] for name in ("rk4", "gauss-4"))

    def solver(top, start, plan):
        return (few if plan.marks[-1] < below else many)(top, start, plan)

    return symtop.Integrator("seeing", "other", "sees its plan", {"axis": solver}, order=4)


def test_a_solver_that_sees_its_plan_contradicts_itself():
    for below in (300, 5000, 20_000):
        ledger = judge(seeing(below), symtop.scene("spheroid"), quick=True)
        assert ledger.refuted == ["reported"]
        assert "a run contradicts itself" in ledger["reported"].why


PLUGIN = """
import ctypes, os
import symtop
def nothing(top, start, plan): return None
def leaves(top, start, plan): os._exit(0)
def crashes(top, start, plan): ctypes.string_at(0)
for solver in (nothing, leaves, crashes):
    symtop.register(symtop.Integrator(f"{solver.__name__}-at-once", "other", "x", {"axis": solver}, order=4))
"""


def claims(plugin, *names):
    """Code, output and errors of `symtop claims`, which would end this process too if it called the plug-in there."""
    return commands.ended(commands.symtop("claims", *names, "--plugin", plugin, "--quick"))


@pytest.mark.slow
def test_a_plug_in_that_fails_is_told_of(tmp_path):
    (tmp_path / "plugin.py").write_text(PLUGIN)
    expected = {"nothing": "must return a Run", "leaves": "ended with code 0", "crashes": "was ended by SIGSEGV"}
    names = [f"{name}-at-once" for name in expected]
    code, out, _ = claims(tmp_path / "plugin.py", *names)
    assert code == 1
    for name, words in zip(names, expected.values(), strict=True):
        own = [line for line in out.splitlines() if line.startswith(f"{name}, ")]
        assert any(words in line for line in own), own


def test_a_plug_in_that_ends_its_process_when_it_is_loaded_is_told_of(tmp_path):
    (tmp_path / "plugin.py").write_text("import os\nos._exit(0)\n")
    code, _, err = claims(tmp_path / "plugin.py")
    assert code == 2
    assert "plugin plugin.py cannot be loaded: its process ended with code 0" in err


def test_a_run_that_is_returned_is_one_of_numbers():
    """What a process sends back is read as numbers and words, never as a pickle."""

    def solver(top, start, plan):
        shape = (plan.times.size, 6)
        return Run(np.full(shape, np.nan), np.zeros(shape[0]), np.zeros(shape[0]), 1, 0, 0, "not_finite", 0.0)

    method = symtop.Integrator("nan", "other", "x", {"axis": solver})
    with Process(lambda: solvers_of(method)) as process:
        process.allow(30.0)
        run = symtop.simulate("spheroid", separated(method, process), step_size=0.1, guard=False)
    assert run.attrs["outcome"] == "not_finite"
    assert np.isnan(run["energy"].values).all()


def test_a_name_that_is_unknown_is_told_before_anything_is_measured(monkeypatch):
    measured = []
    monkeypatch.setattr("symtop.judging.judge_step.judge_separately", lambda *one, **_: measured.append(one))
    result = call("claims", "midpoint", "midpont", code=2)
    assert "integrator 'midpont' is unknown" in result.output
    assert measured == []
