"""Pieces on threads come back in order and an error ends the rest; worker processes have one thread each."""

import multiprocessing
import os
import threading
import time
from concurrent.futures import ProcessPoolExecutor

import pytest

from symtop.core.parallel import VARIABLES, OneThreadEach, StoppedError, check_interrupt, in_threads


@pytest.mark.parametrize("threads", [1, 2, 5])
def test_results_come_in_the_order_of_the_pieces_and_one_thread_is_the_callers(threads):
    def work(piece):
        time.sleep(0.001 * (7 - piece % 7))
        return piece * piece

    assert list(in_threads(work, range(30), threads)) == [k * k for k in range(30)]
    assert list(in_threads(work, [], threads)) == []
    callers = lambda _: threading.current_thread() is threading.main_thread()
    assert list(in_threads(callers, range(3), threads)) == [threads == 1] * 3


@pytest.mark.parametrize("threads", [1, 2])
def test_an_error_is_raised_and_what_has_not_begun_is_dropped(threads):
    pieces = []

    def work(piece):
        if piece == 3:
            raise ValueError("the third")
        pieces.append(piece)

    with pytest.raises(ValueError, match="the third"):
        list(in_threads(work, range(1000), threads))
    assert len(pieces) < 30


def test_pieces_are_taken_as_they_are_needed():
    """Results that nobody has asked for would take memory."""
    order = []
    results = in_threads(lambda piece: piece, (order.append(k) or k for k in range(100)), 2)
    assert next(results) == 0
    assert len(order) < 10
    assert list(results) == list(range(1, 100))


def test_pieces_that_have_begun_heed_an_interrupt():
    """The first piece fails while the second waits for ever: it is told, and its thread ends."""
    ended = threading.Event()

    def work(piece):
        if piece == 0:
            time.sleep(0.05)
            raise KeyboardInterrupt
        try:
            while True:
                check_interrupt()
                time.sleep(0.001)
        except StoppedError:
            ended.set()
            raise

    with pytest.raises(KeyboardInterrupt):
        list(in_threads(work, range(2), 2))
    assert ended.wait(5.0)
    check_interrupt()  # nothing asks the caller's thread to stop


def seen_by(context):
    """What a process that is started so finds in its environment."""
    with ProcessPoolExecutor(1, context) as pool:
        return list(pool.map(os.getenv, VARIABLES))


@pytest.fixture(autouse=True)
def unset(monkeypatch):
    for name in VARIABLES:
        monkeypatch.delenv(name, raising=False)


def test_a_process_has_one_thread_and_what_the_user_has_set_is_obeyed(monkeypatch):
    before = dict(os.environ)
    assert (seen_by(OneThreadEach()), dict(os.environ)) == (["1"] * len(VARIABLES), before)
    assert seen_by(multiprocessing.get_context("spawn")) == [None] * len(VARIABLES), "nobody else is told"
    monkeypatch.setenv(VARIABLES[0], "3")
    assert (seen_by(OneThreadEach()), os.environ[VARIABLES[0]]) == (["3", "1", "1"], "3")
