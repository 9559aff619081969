"""A pool of a cluster that goes: whatever was submitted, and whenever, ends; with a client that is made up."""

import threading
from concurrent.futures import Future
from types import SimpleNamespace

import pytest

from symtop.core import cluster
from symtop.core.errors import SymtopError


class Client:
    """A cluster that is there until it is told to go; what it is given lasts until `finish`."""

    def __init__(self):
        self.scheduler = SimpleNamespace(address="tcp://made-up:1", ncores=None)
        self.there, self.given, self.before = True, [], lambda: None

    def sync(self, *_, **__):
        if not self.there:
            raise OSError("nobody answers")
        return {"worker": 1}

    def submit(self, *_, **__):
        self.before()
        inner = Future()
        inner.status = "finished"
        self.given.append(inner)
        return inner


@pytest.fixture
def pool(monkeypatch):
    monkeypatch.setattr(cluster, "LOOKS", 0.01)
    monkeypatch.setattr(cluster, "PATIENCE", 0.02)
    made = cluster.Watched(Client())
    yield made
    made.shutdown()


def test_what_is_waited_for_when_a_cluster_goes_raises_and_what_was_done_does_not(pool):
    done, left = pool.submit(abs, -1), pool.submit(abs, -2)
    pool._client.given[0].set_result(1)
    assert done.result(5.0) == 1
    pool._client.there = False
    with pytest.raises(SymtopError, match="the cluster at tcp://made-up:1 does not answer any more"):
        left.result(5.0)
    with pytest.raises(SymtopError, match="does not answer any more"):
        pool.submit(abs, -3)


def test_a_task_that_is_submitted_while_a_cluster_goes_is_not_waited_for(pool):
    """The cluster goes, and the last look at it ends, between the check and the task's place among those waited for."""

    def goes():
        pool._client.there = False
        for thread in threading.enumerate():
            if getattr(getattr(thread, "_target", None), "__func__", None) is cluster.Watched._watch:
                thread.join(5.0)

    pool._client.before = goes
    with pytest.raises(SymtopError, match="does not answer any more"):
        pool.submit(abs, -1).result(5.0)
    assert pool._waiting == {}
