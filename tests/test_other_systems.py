"""symtop without what Windows lacks: locks of `fcntl`, interval timers, groups of processes, fork, parents' numbers.

A `sitecustomize` takes them from a whole tree of processes, workers included: it shows that none of them is needed.
"""

import errno
import fcntl
import json
import os
import signal
import time

import pytest

from symtop.core import files
from tests.commands import customized

POORER = """
import multiprocessing, multiprocessing.context, multiprocessing.resource_tracker, os, signal, sys
sys.modules["fcntl"] = None
multiprocessing.resource_tracker.ensure_running = None  # it needs _posixsubprocess, as the spawning here does
os.getppid = (lambda number: lambda: number)(os.getppid())  # that of a parent that has ended stays
for module, names in ((os, ["killpg", "setsid", "fork"]), (signal, ["setitimer", "SIGALRM"])):
    for name in names:
        delattr(module, name)
multiprocessing.set_start_method("spawn")
multiprocessing.context._concrete_contexts.pop("fork")
multiprocessing.context._concrete_contexts.pop("forkserver")
multiprocessing.get_all_start_methods = lambda: ["spawn"]
"""


def test_a_file_is_whole_where_only_a_writer_may_bring_it_to_the_disk_and_the_umask_counts(tmp_path, monkeypatch):
    def as_on_windows(number):
        if fcntl.fcntl(number, fcntl.F_GETFL) & os.O_ACCMODE == os.O_RDONLY:
            raise OSError(errno.EBADF, "only read")

    monkeypatch.setattr(os, "fsync", as_on_windows)
    before = os.umask(0o027)
    with files.replacing(tmp_path / "file") as partial:
        partial.write_text("whole")
    os.umask(before)
    assert (tmp_path / "file").stat().st_mode & 0o777 == 0o640


ORPHAN = """
import os, signal
from symtop.runner.pool import Pool
pool = Pool(1)
pool.open(1)
pool.submit(signal.alarm, 20).result()  # ends a worker that has not ended by then
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_a_worker_ends_with_its_parent(tmp_path):
    start = time.monotonic()
    assert customized(tmp_path, POORER)(python=ORPHAN).returncode == -signal.SIGKILL  # and its output has ended
    assert time.monotonic() < start + 15.0


COMMANDS = """
import importlib.util, json, os, signal
from pathlib import Path
from tests.commands import PROBE, call

def computed(jobs):
    return json.loads(call("study", PROBE, "--jobs", jobs, "--json").stdout)[0]["computed"]

there = [importlib.util.find_spec("fcntl"), hasattr(os, "killpg"), hasattr(signal, "SIGALRM")]
first = computed(2)
next(Path("results/cases/probe").glob("loop--rk4*.npz")).unlink()
again = computed(1)
call("long", "spheroid", "midpoint", "--steps", 100_000, "--checkpoint", "run.nc")
Path("euler.py").write_text("def step(f, t, y, h):\\n    return y + h * f(t, y)\\n")
judged = call("judge", "euler.py", "--quick").stdout
print(json.dumps({"there": there, "first": first, "again": again, "judged": judged}))
"""


@pytest.mark.slow
def test_a_study_in_workers_is_resumed_a_long_run_ends_and_somebodys_step_is_judged(tmp_path):
    """Commands in one process, as each start takes two seconds."""
    result = customized(tmp_path, POORER)(python=COMMANDS)
    assert result.returncode == 0, result.stderr
    report = json.loads(result.stdout)
    assert (report["there"], (report["first"], report["again"])) == ([None, False, False], (12, 1))
    assert not (tmp_path / "run.nc").exists()  # the checkpoint
    assert "order" in report["judged"]
