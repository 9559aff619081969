"""What a command says on a standard error that nobody watches."""

import re
import subprocess
import sys
import time
from types import SimpleNamespace

import pytest

import symtop
from symtop.cli import runs
from symtop.measure import timing
from symtop.run.ensemble import population
from tests.commands import call

SLOW = """\
import sys, time
from symtop.cli import clock
clock.FIRST, clock.EVERY = 0.1, 0.15
with clock.telling("judge"):
    time.sleep(float(sys.argv[1]))
    with clock.ticking("trying methods"):
        time.sleep(float(sys.argv[1]))
"""


def stderr_of(code, *words):
    return subprocess.run([sys.executable, "-c", code, *words], capture_output=True, text=True, check=True).stderr


def test_a_command_that_waits_says_what_it_does_and_for_how_long():
    lines = stderr_of(SLOW, "0.5").splitlines()
    assert lines[0].startswith("symtop: judge, ")
    assert lines[-1].startswith("symtop: trying methods, ")
    assert 3 <= len(lines) <= 8
    assert all(line.endswith(" s") for line in lines)


def test_a_command_that_is_quick_says_nothing():
    assert stderr_of(SLOW, "0.01") == ""


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_the_lines_end_with_a_command_that_is_killed():
    code = SLOW.replace("with clock", "print('on', flush=True)\nwith clock", 1)
    process = subprocess.Popen([sys.executable, "-c", code, "60"], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    process.stdout.readline()
    time.sleep(0.5)
    process.kill()
    assert process.communicate(timeout=10)[1].count(b"symtop: judge") < 20  # the pipe is closed by all who wrote to it


def test_a_run_of_many_steps_says_how_long_it_takes(capsys, monkeypatch):
    """Steps of a microsecond: a million are not timed, five million take five seconds, a billion a quarter hour."""
    few, now, step = [], [0.0], 1e-6
    monkeypatch.setattr(timing, "time", SimpleNamespace(perf_counter=lambda: now[0]))

    def run(steps):
        few.append(steps)
        now[0] += 0.3 + step * steps  # whatever the steps, as the set-up of a long run does

    runs.estimate(1e6, run)
    assert not few
    runs.estimate(5e6, run)
    assert capsys.readouterr().err == ""
    runs.estimate(1e9, run)
    minutes = re.fullmatch(r"symtop: 1e\+09 steps take about (\d+) min\n", capsys.readouterr().err)
    assert 15 <= int(minutes[1]) <= 25
    runs.estimate(9e9, run)  # and so many two and a half hours
    assert re.fullmatch(r"symtop: 9e\+09 steps take about 2.\d h\n", capsys.readouterr().err)
    assert max(few) < 1.1e6
    few.clear()
    step = 1e-4  # in plain Python
    runs.estimate(3e6, run)
    assert "take about 5" in capsys.readouterr().err
    assert sum(few) < 40_000


def test_members_that_do_not_fit_into_memory_are_refused_before_they_are_drawn(monkeypatch):
    monkeypatch.setattr(population, "memory", lambda: 1000.0 * population.BYTES)
    assert population.population(1000).sizes["member"] == 1000
    with pytest.raises(symtop.SymtopError, match=r"n must be at most 1e\+03 in the .* GiB of this machine.*, not 1001"):
        population.population(1001)
    result = call("ensemble", "strang", "--members", "1001", "--per-nutation", "20", "--nutations", "1", code=2)
    assert "--members must be at most" in result.stderr
