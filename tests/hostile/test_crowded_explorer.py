"""The explorer under a crowd: aborted requests, many at once, and clients that never finish a sentence."""

import contextlib
import json
import re
import signal
import socket
import struct
import subprocess
import sys
import time
import urllib.request
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

QUESTION = json.dumps({
    "I1": 2.0, "I3": 1.0, "mgl": 1.0, "theta": 0.5, "phi": 0, "psi": 0, "theta_dot": 0, "phi_dot": 0, "psi_dot": 5.0,
    "horizon": 5.0, "integrator": "midpoint", "step_size": 0.01,
}).encode()  # fmt: skip


@pytest.fixture(scope="module")
def crowd(tmp_path_factory):
    """The port of the command that serves the explorer, the file of what it says, that of its memory, its process."""
    log = tmp_path_factory.mktemp("explorer") / "log"
    command = [sys.executable, "-m", "symtop.cli", "explore", "--no-browser"]
    with log.open("w") as file, subprocess.Popen(command, stdout=subprocess.PIPE, stderr=file, text=True) as process:
        try:
            port = int(re.search(r":(\d+)/", process.stdout.readline()).group(1))
            yield port, log, Path(f"/proc/{process.pid}/statm"), process
        finally:
            process.kill()


HEAD = b"%s %s HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\nContent-Length: %d\r\n\r\n"
GOOD = b"HTTP/1.1 200 OK"


def first_line(port, path, body=b"", *, leave=False, patience=60.0):
    """The first line of an answer; with `leave` the connection is reset once the question is sent."""
    verb = b"POST" if body else b"GET"
    with socket.create_connection(("127.0.0.1", port), timeout=patience) as link:
        link.sendall(HEAD % (verb, path, len(body)) + body)
        if leave:
            link.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            return b""
        return link.recv(65536).partition(b"\r\n")[0]


def at_once(count, ask):
    """The answers of so many threads."""

    def answer(_):
        try:
            return ask()
        except OSError as error:
            return repr(error)

    with ThreadPoolExecutor(count) as pool:
        return [*pool.map(answer, range(count))]


@pytest.mark.parametrize("count", [pytest.param(20, id="few"), pytest.param(200, id="many", marks=pytest.mark.slow)])
def test_a_crowd_is_served_and_nothing_is_said_of_those_who_leave(crowd, count):
    port, log, memory, process = crowd
    threads, sizes = re.compile(r"(?m)^Threads:\s+(\d+)$"), []
    for _ in range(3):
        at_once(count, lambda: first_line(port, b"/run", QUESTION, leave=True))
        end = time.monotonic() + 60.0
        while int(threads.search(Path(f"/proc/{process.pid}/status").read_text())[1]) > 20 and time.monotonic() < end:
            time.sleep(0.05)  # until they are forgotten: both crowds together are more than the limit of connections
        assert at_once(count, lambda: first_line(port, b"/run", QUESTION)) == [GOOD] * count
        sizes.append(int(memory.read_text().split()[1]))  # pages in memory now, not the peak
    assert sizes[2] < 1.05 * sizes[1]  # the first round compiles and fills caches
    assert log.read_text() == ""


@pytest.mark.slow
def test_three_thousand_connections_are_refused_and_forgotten(crowd):
    """Idle ones beyond the limit get 503, which is reported; those within it, some unfinished, keep nobody waiting."""
    port, log, memory, _ = crowd
    assert first_line(port, b"/run", QUESTION) == GOOD
    before, start = int(memory.read_text().split()[1]), time.monotonic()
    resource = pytest.importorskip("resource")
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(hard, 4096) if hard > 0 else 4096, hard))
    try:
        idle = [socket.create_connection(("127.0.0.1", port), timeout=10.0) for _ in range(100)]
        for link in idle[:50]:
            link.sendall(HEAD % (b"POST", b"/run", 9) + b"{")
        assert first_line(port, b"/", patience=10.0) == first_line(port, b"/run", QUESTION, patience=10.0) == GOOD
        idle += [socket.create_connection(("127.0.0.1", port), timeout=10.0) for _ in range(2900)]
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
    count = 0
    for link in idle:
        link.settimeout(0.0)
        with contextlib.suppress(OSError):
            count += link.recv(64).startswith(b"HTTP/1.1 503 ")
    assert count > 2000
    assert "connections are open, and others are refused (503)" in log.read_text()
    assert len(log.read_text().splitlines()) < 2.0 + time.monotonic() - start
    end, line = time.monotonic() + 5.0, b""
    while line != GOOD and time.monotonic() < end:
        with contextlib.suppress(OSError):
            line = first_line(port, b"/run", QUESTION, patience=5.0)
        time.sleep(0.1)
    assert line == GOOD
    for link in idle:
        link.close()
    assert int(memory.read_text().split()[1]) < 1.2 * before


def test_the_command_serves_until_it_is_ended(crowd):
    port, _, _, process = crowd
    with urllib.request.urlopen(f"http://127.0.0.1:{port}/", timeout=60) as response:
        assert b"symtop explore" in response.read()
    process.send_signal(signal.SIGTERM)
    assert process.wait(30) == 0
