"""Registered integrators in a process of their own: one that knows its plan, and plug-ins that fail."""

import subprocess
import sys

import numpy as np
import pytest

import symtop
from symtop.judging.battery import judge
from symtop.judging.remote import Process, separated, solvers_of
from symtop.methods.framework.plan import Run


def seeing(below):
    few, many = (symtop.integrator(name).solvers["axis"] for name in ("rk4", "gauss-4"))

    def solver(top, start, plan):
        return (few if plan.marks[-1] < below else many)(top, start, plan)

    return symtop.Integrator("seeing", "other", "sees its plan", {"axis": solver}, order=4)


@pytest.mark.parametrize("below", [300, 5000, 20_000])
def test_a_solver_that_sees_its_plan_contradicts_itself(below):
    ledger = judge(seeing(below), symtop.scene("spheroid"), quick=True)
    assert ledger.refuted == ["reported"]
    assert "a run contradicts itself" in ledger["reported"].why


def test_one_that_does_not_is_what_it_reports():
    assert judge(symtop.integrator("gauss-4"), symtop.scene("spheroid"), quick=True).refuted == []


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
    """What `symtop claims` ends in; it would end this process with its own if it called the plug-in there."""
    command = [sys.executable, "-m", "symtop.cli", "claims", *names, "--plugin", str(plugin), "--quick"]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_a_plug_in_that_fails_is_told_of(tmp_path):
    (tmp_path / "plugin.py").write_text(PLUGIN)
    said = {"nothing": "must return a Run", "leaves": "ended with code 0", "crashes": "was ended by SIGSEGV"}
    names = [f"{name}-at-once" for name in said]
    done = claims(tmp_path / "plugin.py", *names)
    assert done.returncode == 1
    for name, words in zip(names, said.values(), strict=True):
        own = [line for line in done.stdout.splitlines() if line.startswith(f"{name}, ")]
        assert any(words in line for line in own), own


def test_a_plug_in_that_ends_its_process_when_it_is_loaded_is_told_of(tmp_path):
    (tmp_path / "plugin.py").write_text("import os\nos._exit(0)\n")
    done = claims(tmp_path / "plugin.py")
    assert done.returncode == 2
    assert "plugin plugin.py cannot be loaded: its process ended with code 0" in done.stderr


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
