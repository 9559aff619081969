"""A dask cluster that is gone, or goes: a result or one sentence within 30 s, and what was computed is kept."""

import contextlib
import os
import re
import signal
import socket
import subprocess
import sys
import time

import pytest

from tests.commands import PROBE, assert_identical, finish, leftovers, stdout_of, stop, symtop

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("processes_with_dask")]

HERE = "127.0.0.1"
SECONDS = 30.0  # from what happens to the cluster to the end of the command


class Cluster:
    """A scheduler and its workers, each a process of its own."""

    def __init__(self, log, workers=2):
        environment = {**os.environ, "PROBE_LOG": str(log), "PROBE_PAUSE": "0.5"}
        self.started = []
        self.scheduler = self._start(environment, "scheduler", "--port", "0", "--no-dashboard", "--host", HERE)
        self.address = self._match(self.scheduler, r"Scheduler at:\s+(tcp://\S+)")
        self.workers = [
            self._start(environment, "worker", self.address, "--no-nanny", "--no-dashboard", "--nthreads", "1")
            for _ in range(workers)
        ]
        for worker in self.workers:
            self._match(worker, r"Registered to:\s+(tcp://\S+)")

    def _start(self, environment, role, *words):
        line = [sys.executable, "-m", f"distributed.cli.dask_{role}", *words]
        process = subprocess.Popen(line, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env=environment)
        self.started.append(process)
        return process

    def _match(self, process, pattern):
        for line in process.stderr:
            if match := re.search(pattern, line):
                return match[1]
        raise AssertionError("it ended")

    def close(self):
        for process in self.started:
            process.kill()
            process.communicate()


@pytest.fixture
def cluster(tmp_path, processes_with_dask):
    with contextlib.closing(Cluster(tmp_path / "log")) as started:
        yield started


def computed(results):
    """The finished cases, and the identity of the file of each."""
    return {path: (path.stat().st_ino, path.stat().st_mtime_ns) for path in results.rglob("cases/*/*.npz")}


def outcome_after(cluster, results, event):
    """How a study's command ends to whose cluster something happens midway, and how many seconds later."""
    process = symtop("study", PROBE, "--results", results, "--scheduler", cluster.address)
    try:
        start = time.monotonic()
        while len(computed(results)) < 3:
            assert process.poll() is None, process.communicate()
            assert time.monotonic() - start < 120.0
            time.sleep(0.05)
        event()
        start, result = time.monotonic(), finish(process, 300.0)
        return *result, time.monotonic() - start
    finally:
        stop(process)


def run_alone(results):
    """What the command prints without a cluster."""
    return stdout_of(symtop("study", PROBE, "--results", results, "--jobs", 1))


def test_a_worker_that_dies_costs_nothing(cluster, tmp_path):
    code, out, err, seconds = outcome_after(cluster, tmp_path / "r", cluster.workers[0].kill)
    print(f"a worker: {code} after {seconds:.1f} s, {err!r}")
    assert code == 0, err
    before = computed(tmp_path / "r")
    assert len(before) == 12
    assert seconds < SECONDS
    count, calls = int(re.search(r"(\d+) of 12 cases computed", out)[1]), len((tmp_path / "log").read_text().split())
    # one at most is made twice, which the killed worker was computing, or found, which it had written and not told of
    assert calls >= 12
    assert 0 <= calls - count <= 1
    run_alone(tmp_path / "here")
    assert_identical(tmp_path / "here", tmp_path / "r")
    assert "0 of 12 cases computed" in run_alone(tmp_path / "r")
    assert before.items() <= computed(tmp_path / "r").items()
    assert not leftovers(tmp_path / "r")


@pytest.mark.parametrize("how", ["killed", "stopped", "without workers", "deaf"])
@pytest.mark.parametrize("what", ["study", "ensemble"])
def test_a_cluster_that_is_gone_before_or_never_answers_is_one_sentence(tmp_path, what, how):
    """A deaf port takes connections and says nothing, as a firewall or another service may."""
    words = ["ensemble", "strang", "--members", 90, "--step-size", 0.1, "--horizon", 1, "--output", tmp_path / "a.nc"]
    if what == "study":
        words = ["study", PROBE, "--results", tmp_path / "r"]
    with contextlib.closing(Cluster(tmp_path / "log", workers=0)) as cluster, socket.create_server((HERE, 0)) as deaf:
        if how in ("killed", "stopped"):
            cluster.scheduler.send_signal(signal.SIGKILL if how == "killed" else signal.SIGSTOP)
        address = f"tcp://{HERE}:{deaf.getsockname()[1]}" if how == "deaf" else cluster.address
        start = time.monotonic()
        code, _, err = finish(symtop(*words, "--scheduler", address), 300.0)
        seconds = time.monotonic() - start
    print(f"{what}, {how}: {code} after {seconds:.1f} s, {err!r}")
    assert (code, [*tmp_path.glob("a.nc*")]) == (2, [])
    assert "scheduler must be the address of a dask scheduler that answers and has workers" in err
    assert seconds < SECONDS
