"""Worker processes use one thread for linear algebra, unless the user said another number."""

import multiprocessing
import os
from concurrent.futures import ProcessPoolExecutor

import pytest

from symtop.core.parallel import VARIABLES, OneThreadEach


def looked_up(name):
    return os.environ.get(name)


def seen_by(context):
    """What a process that is started so finds in its environment."""
    with ProcessPoolExecutor(1, context) as pool:
        return [pool.submit(looked_up, name).result() for name in VARIABLES]


@pytest.fixture(autouse=True)
def unset(monkeypatch):
    for name in VARIABLES:
        monkeypatch.delenv(name, raising=False)


def test_a_process_has_one_thread_and_this_one_keeps_its_environment():
    before = dict(os.environ)
    assert seen_by(OneThreadEach()) == ["1"] * len(VARIABLES)
    assert dict(os.environ) == before
    assert seen_by(multiprocessing.get_context("spawn")) == [None] * len(VARIABLES), "nobody else is told"


def test_what_the_user_has_set_is_obeyed(monkeypatch):
    monkeypatch.setenv(VARIABLES[0], "3")
    assert seen_by(OneThreadEach()) == ["3", "1", "1"]
    assert os.environ[VARIABLES[0]] == "3"
