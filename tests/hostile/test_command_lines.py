"""Every command, every option, every kind of bad value: one sentence, exit code 2, and no file anywhere."""

import contextlib
import os
import warnings

import click
import pytest

from symtop.cli.main import main
from tests.commands import call

GOOD = {
    "archive": [], "cite": [], "claims": ["strang", "--quick"], "doctor": [],
    "ensemble": ["strang", "--members", "2", "--step-size", "0.1", "--horizon", "0.2", "--samples", "2"],
    "explore": ["--no-browser"], "integrators": ["strang"], "judge": ["own.py:step", "--order", "4", "--quick"],
    "long": ["spheroid", "strang", "--steps", "10", "--step-size", "0.01"],
    "compare": ["spheroid", "strang", "--nutations", "1", "--cost", "evaluations", "--budget", "1e3"],
    "recommend": ["spheroid", "--accuracy", "1e-3", "--horizon", "1"], "report": [],
    "run": ["spheroid", "strang", "--step-size", "0.02", "--horizon", "0.2", "--samples", "2"], "scenes": ["spheroid"],
    "study": ["notebook", "--quick", "--status"],
}  # fmt: skip
NO_NUMBERS = ["", " ", "x", "nano", "None", "\0", "é", "½", "'1'"]
NOT_NUMBERS = [*NO_NUMBERS, "1,5", "0x10", "1e", "--", "1+2j", "[1]", "1 2", "0.1.2"]
NOT_FINITE = ["nan", "inf", "-inf", "1e999", "-1e999"]
NOT_POSITIVE = ["0", "-1", "-0.0", "-1e-300", "1e-400"]
ODD_NAMES = ["", " ", "no-such", "Spheroid ", "STRANG!", "é", "a\nb", "../x", "/", "x" * 5000]
NAMES = [*ODD_NAMES, "None", "-", "*", "%s", "{}", "\x1b[31m"]
FILES = ["", "/", ".", "/dev/null/x.nc", "/proc/x.nc", "missing/../../x/y.nc", "a" * 300 + ".nc", "no/such/folder/x.nc"]
TAKEN = ["taken.nc", "taken.png"]  # names of folders
WRITTEN = [*FILES, *TAKEN]
FOLDERS = ["/dev/null", "/dev/null/x", "/proc/x", "no-such", "own.py", "a" * 300]
NO_FILES = ["", ".", "/", "no-such.py", "/dev/null/x.py", "/etc/hostname", "x" * 5000]
PLUGINS = [*NO_FILES, "own.txt", "broken.py", "leaves.py"]
ADDRESSES = ["nowhere", "ftp://x", "tcp://[::1:0", "tcp://:", "/", "x" * 300]
NUMBERS = NOT_NUMBERS + NOT_FINITE + NOT_POSITIVE
WHOLE = NOT_NUMBERS + NOT_FINITE + ["1.5", "1e3", "-1", "9" * 400]
BAD = {
    "--seed": WHOLE, "--members": [*WHOLE, "0"], "--samples": [*WHOLE, "0", "1"], "--threads": [*WHOLE, "0"],
    "--jobs": [*WHOLE, "0"], "--port": [*WHOLE, "70000"], "--order": [*WHOLE, "0"],
    "--step-size": [*NUMBERS, "1e300"], "--tolerance": [*NUMBERS, "1e300"], "--horizon": NUMBERS,
    "--per-nutation": NUMBERS, "--nutations": NUMBERS, "--budget": NUMBERS, "--steps": [*NUMBERS, "1e300"],
    "--accuracy": [*NUMBERS, "1e300"], "--limit": NUMBERS, "--max-step": NUMBERS, "--time-a-step": NUMBERS,
    "--scene": NAMES, "--kind": NAMES, "--observe": NAMES, "--quantity": NAMES, "--i-use": NAMES, "--chart": NAMES,
    "--needs": NAMES, "--keeps": NAMES, "--guard": NAMES, "--variables": NAMES, "--form": NAMES, "--cost": NAMES,
    "--energy": NAMES, "--only": NAMES, "--conserves": NAMES,
    "--output": WRITTEN, "--figure": WRITTEN, "--card": WRITTEN, "--badge": WRITTEN, "--checkpoint": WRITTEN,
    "--results": FOLDERS, "--plugin": PLUGINS, "--scheduler": ADDRESSES, "--body": [*NUMBERS, "1,2,4", "1,2"],
    "--mgl": NOT_NUMBERS, "--centre": NOT_NUMBERS, "--rates": NOT_NUMBERS, "--attitude": NOT_NUMBERS,
    "--epsilon": NUMBERS,
}  # fmt: skip
FINE = {
    ("doctor", "--results"),  # it says what it finds there
    ("study", "--results"),  # --status of a folder that is not there: nothing is computed
    ("study", "--limit"), ("study", "--jobs"), ("study", "--scheduler"),  # --status has no use for them
    ("long", "--step-size"),  # a step of 1e300 ends the run at once, which is 3
}  # fmt: skip


def lines(name):
    """Every bad line of a command."""
    command, base = main.get_command(click.Context(main), name), [name, *GOOD[name]]
    yield from ([*base, word] for word in ("--no-such-option", "-q", "--no-such=1"))
    if name not in ("cite", "claims", "study"):
        yield [*base, "one", "too", "many"]
    for part in command.params:
        option = part.opts[0]
        if not isinstance(part, click.Option):
            place = 1 + [param for param in command.params if not isinstance(param, click.Option)].index(part)
            yield from ([*base[:place], value, *base[place + 1 :]] for value in NAMES if part.nargs == 1)
        elif part.is_flag:
            yield from ([*base, f"{option}{value}"] for value in ["=1", "=", "=no"])
        else:
            if option != "--guard":  # which has a default
                yield [*base, option]
            assert option in BAD, f"{name} {option} is not tried"
            yield from ([*base, f"{option}={value}"] for value in BAD[option])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("hostile")
    (place / "own.py").write_text("def step(f, t, y, h):\n    return y + h * f(t, y)\n")
    (place / "own.txt").write_text("no Python\n")
    (place / "broken.py").write_text("def\n")
    (place / "leaves.py").write_text("raise SystemExit(0)\n")
    for name in TAKEN:
        (place / name).mkdir()
    return place


@pytest.mark.parametrize("name", main.list_commands(click.Context(main)))
def test_every_bad_command_line_is_one_sentence(name, folder, monkeypatch):
    """513 of them and more; the same lines without what is bad are right."""
    monkeypatch.chdir(folder)
    monkeypatch.setattr("sys.dont_write_bytecode", False)  # as on most machines
    monkeypatch.setattr("symtop.cli.common.showing_work", contextlib.nullcontext)  # a process for each line
    monkeypatch.setattr("socketserver.BaseServer.serve_forever", lambda *_: pytest.fail("it serves"))
    before = sorted(path.name for path in folder.iterdir())
    names, faults = sorted(path.name for path in folder.parent.iterdir()), []
    for words in lines(name):
        with warnings.catch_warnings(action="ignore"):
            result = call(*words, code=None)
        option = next((word.split("=")[0] for word in reversed(words) if word.startswith("--")), "")
        messages = [line for line in result.output.splitlines() if line.startswith(("symtop: ", "Error: "))]
        allowed = (0, 1, 2, 3) if (name, option) in FINE else (2,)
        if result.exit_code not in allowed or not isinstance(result.exception, SystemExit | None):
            faults.append((words, result.exit_code, repr(result.exception), result.output[-300:]))
        elif "Traceback" in result.output or (result.exit_code == 2 and len(messages) != 1):
            faults.append((words, result.exit_code, result.output[-300:]))
        if sorted(path.name for path in folder.iterdir()) != before:
            faults.append((words, "wrote", sorted(path.name for path in folder.iterdir())))
            for path in folder.iterdir():
                if path.name not in before:
                    os.system(f"rm -rf '{path}'")
    if sorted(path.name for path in folder.parent.iterdir()) != names:
        faults.append("wrote beside the folder")
    assert not faults, "\n".join(repr(fault).replace("a" * 290, "aaa").replace("x" * 4990, "xxx") for fault in faults)
