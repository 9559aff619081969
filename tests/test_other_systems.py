"""symtop without what Windows lacks: locks of `fcntl`, interval timers, groups of processes, fork.

A `sitecustomize` takes them away from a whole tree of processes, the workers of a study included. It cannot show that
symtop runs on Windows; it shows that none of them is needed.
"""

import json

import pytest

from tests.commands import PROBE, customized

POORER = """
import multiprocessing, multiprocessing.context, os, signal, sys
sys.modules["fcntl"] = None
for module, names in ((os, ["killpg", "setsid", "fork"]), (signal, ["setitimer", "SIGALRM"])):
    for name in names:
        delattr(module, name)
multiprocessing.set_start_method("spawn")
multiprocessing.context._concrete_contexts.pop("fork")
multiprocessing.context._concrete_contexts.pop("forkserver")
multiprocessing.get_all_start_methods = lambda: ["spawn"]
"""


@pytest.fixture
def poorer(tmp_path):
    return customized(tmp_path, POORER)


def test_they_are_gone(poorer):
    for code in ("import fcntl", "import os; os.killpg", "import signal; signal.SIGALRM"):
        assert poorer(python=code).returncode == 1


def test_a_study_in_workers_is_run_and_resumed(poorer, tmp_path):
    done = poorer("study", PROBE, "--jobs", 2, "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)[0]["computed"] == 12
    next((tmp_path / "results" / "cases" / "probe").glob("loop--rk4*.npz")).unlink()
    assert json.loads(poorer("study", PROBE, "--jobs", 1, "--json").stdout)[0]["computed"] == 1


def test_a_long_run_ends_and_leaves_no_checkpoint(poorer, tmp_path):
    done = poorer("long", "spheroid", "midpoint", "--steps", 100_000, "--checkpoint", "run.nc")
    assert done.returncode == 0, done.stderr
    assert not (tmp_path / "run.nc").exists()


def test_somebodys_step_is_judged(poorer, tmp_path):
    (tmp_path / "euler.py").write_text("def step(f, t, y, h):\n    return y + h * f(t, y)\n")
    done = poorer("judge", "euler.py", "--quick")
    assert done.returncode == 0, done.stderr
    assert "order" in done.stdout
