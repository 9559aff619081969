"""Requests to end are heard, but not between a library's taking a lock and its giving it back."""

import signal
import sys
import threading
import time

import numpy as np
import pytest
import xarray as xr
from numba.core.registry import cpu_target
from xarray.backends.locks import HDF5_LOCK

from symtop.core import jit, netcdf
from symtop.core.errors import foreign_code
from symtop.core.signals import InterruptedByUser, TerminatedError, at_most, deferred, ending_on_sigterm, told_apart


def _at_line(number):
    """A tracer that sends SIGTERM at one of the lines that xarray's locks and files are handled by, and the count."""
    count = [0]

    def trace(frame, event, _):
        if not frame.f_code.co_filename.endswith(("xarray/backends/locks.py", "xarray/backends/file_manager.py")):
            return None
        if event == "line":
            count[0] += 1
            if count[0] == number:
                signal.raise_signal(signal.SIGTERM)
        return trace

    return trace, count


def write_with_signal(path, number):
    trace, count = _at_line(number)
    before = sys.gettrace()
    with ending_on_sigterm():
        sys.settrace(trace)
        try:
            netcdf.write(xr.Dataset({"value": ("x", np.arange(5.0))}), path)
        finally:
            sys.settrace(before)
    return count[0]


@pytest.fixture
def _a_minute():
    """A lock that nobody gives back ends the test, not the whole of them."""

    def out(*_):
        raise AssertionError("the write waits for a lock")

    original = signal.signal(signal.SIGALRM, out)
    signal.alarm(60)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, original)


@pytest.mark.slow
@pytest.mark.usefixtures("_a_minute")
def test_a_write_is_whole_and_gives_back_its_lock_wherever_it_is_interrupted(tmp_path):
    lines = write_with_signal(tmp_path / "whole.nc", -1)
    assert lines > 50
    for number in range(1, lines + 1):
        file = tmp_path / f"{number}.nc"
        with pytest.raises(TerminatedError):
            write_with_signal(file, number)
        assert not HDF5_LOCK.locked(), number
        assert file.read_bytes() == (tmp_path / "whole.nc").read_bytes()


@pytest.fixture
def default_handlers():
    """SIGHUP as it is without ``nohup``, under which nobody hears it."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGHUP, before)


@pytest.mark.parametrize(("number", "hearing", "kind"), [
    (signal.SIGTERM, ending_on_sigterm, TerminatedError), (signal.SIGHUP, ending_on_sigterm, TerminatedError),
    (signal.SIGINT, told_apart, InterruptedByUser),
])  # fmt: skip
def test_a_request_is_heard_once_at_the_end_of_the_outermost_block(number, hearing, kind, default_handlers):
    events = []
    with hearing(), pytest.raises(kind):  # noqa: PT012 (the moment at which it is raised is what is tested)
        with deferred():
            with deferred():
                signal.raise_signal(number)
                signal.raise_signal(number)
                events.append("inner")
            events.append("outer")
        events.append("after")
    assert events == ["inner", "outer"]


def test_ctrl_c_is_heard_while_llvm_calls_back_and_as_a_kernel_returns(monkeypatch):
    engine, once = cpu_target.target_context.codegen()._engine._ee, iter([signal.SIGINT])
    monkeypatch.setattr(engine, "_object_cache_notify", lambda *_: any(map(signal.raise_signal, once)))
    with told_apart(), pytest.raises(InterruptedByUser):
        jit.lean_probe.__wrapped__(), [time.sleep(0.01) for _ in range(500)]
    for block in (foreign_code("a kernel"), ending_on_sigterm(), told_apart()):  # as numba converts its result
        with pytest.raises(InterruptedByUser), block:
            raise SystemError from InterruptedByUser()


def test_two_requests_are_both_heard_and_a_limit_inside_another_leaves_that_one_running(default_handlers):
    with ending_on_sigterm(), told_apart(), pytest.raises(TerminatedError), deferred():
        list(map(signal.raise_signal, (signal.SIGINT, signal.SIGTERM, signal.SIGINT)))
    with pytest.raises(TimeoutError, match=r"after 0\.2 s"), at_most(0.2, processor=False):  # noqa: PT012
        with at_most(60.0, processor=False):
            pass
        time.sleep(5.0)


def test_handlers_are_left_as_they_were_and_threads_are_left_alone():
    handlers = lambda: [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
    before, inside = handlers(), []

    def other():
        with deferred():
            inside.append(handlers())

    with deferred():
        assert signal.getsignal(signal.SIGTERM) == before[1] == signal.SIG_DFL  # it ends the process, then as now
        assert signal.getsignal(signal.SIGINT) != before[0]
    (thread := threading.Thread(target=other)).start()
    thread.join()
    assert handlers() == before == inside[0]
