"""What a command says on a standard error that nobody watches."""

import subprocess
import sys
import time

import pytest

SLOW = """\
import sys, time
from symtop.core import progress
progress.FIRST, progress.EVERY = 0.2, 0.3
with progress.telling("judge"):
    time.sleep(float(sys.argv[1]))
    with progress.ticking("trying methods"):
        time.sleep(float(sys.argv[1]))
"""


def said(code, *words):
    return subprocess.run([sys.executable, "-c", code, *words], capture_output=True, text=True, check=True).stderr


def test_a_command_that_waits_says_what_it_does_and_for_how_long():
    lines = said(SLOW, "1.0").splitlines()
    assert lines[0].startswith("symtop: judge, ")
    assert lines[-1].startswith("symtop: trying methods, ")
    assert 3 <= len(lines) <= 8
    assert all(line.endswith(" s") for line in lines)


def test_a_command_that_is_quick_says_nothing():
    assert said(SLOW, "0.01") == ""


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_the_lines_end_with_a_command_that_is_killed():
    code = SLOW.replace("with progress", "print('on', flush=True)\nwith progress", 1)
    process = subprocess.Popen([sys.executable, "-c", code, "60"], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    process.stdout.readline()
    time.sleep(0.5)
    process.kill()
    assert process.communicate(timeout=10)[1].count(b"symtop: judge") < 20  # the pipe is closed by all who wrote to it
