"""Engines of other languages: programs that step a top and print its path.

A driver is called with the words SETTING HELD I1 I3 mgl qw qx qy qz wx wy wz h steps and prints one line "qw qx qy qz
wx wy wz" for the start and for each step. Those in `node` run packages of npm; those in `native` are C++, compiled here
against the libraries of the machine.
"""

import functools
import hashlib
import json
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path as File

import numpy as np

from benchmarks.engines import Setting
from benchmarks.engines.common import Body, Path

HERE = File(__file__).resolve().parent
PACKAGES = HERE / ".venv" / "node"  # of npm, put there by install.py
BUILD = HERE.parent / "build"
FLAGS = ("-O2", "-std=c++17", "-ffp-contract=off")
SECONDS = 120.0  # that a run of 400 steps may take; it takes one


def _program(name: str) -> str:
    """The path of a program of the machine; OSError if it has none, which skips the engine."""
    path = shutil.which(name)
    if path is None:
        raise OSError(f"there is no {name} on this machine")
    return path


def run(command: Sequence[str], setting: str, held: str, body: Body, h: float, steps: int) -> Path:
    """The path that a driver prints; RuntimeError with the end of what it complained of if it fails."""
    numbers = (body.I1, body.I3, body.mgl, *body.attitude, *body.velocity, h)
    words = [*command, setting, held, *(repr(float(number)) for number in numbers), str(steps)]
    process = subprocess.run(words, capture_output=True, text=True, timeout=SECONDS, check=False)
    if process.returncode:
        raise RuntimeError(f"the driver ended with {process.returncode}: {process.stderr.strip()[-150:]}")
    rows = np.array([line.split() for line in process.stdout.splitlines()], dtype=float)
    if rows.shape != (steps + 1, 7):
        raise RuntimeError(f"the driver printed {len(rows)} rows where {steps + 1} were expected")
    q = rows[:, :4]
    return Path(q / np.linalg.norm(q, axis=1, keepdims=True), rows[:, 4:])


def of_npm(name: str, engine: str, package: str, rows: Sequence[tuple[str, str, str]]) -> list[Setting]:
    """The settings (name, held, method) of an engine whose driver is `node/NAME.mjs`; OSError without the package."""
    node, file = _program("node"), PACKAGES / "node_modules" / package / "package.json"
    if not file.is_file():
        raise OSError(f"the npm package {package} is not installed in {PACKAGES.relative_to(HERE.parents[1])}")
    version = json.loads(file.read_text(encoding="utf-8"))["version"]
    command = (node, str(HERE / "node" / "top.mjs"), name, str(PACKAGES))
    return [
        Setting(engine, version, label, held, method, functools.partial(run, command, label, held))
        for label, held, method in rows
    ]


def native(name: str, engine: str, library: str, rows: Sequence[tuple[str, str, str]]) -> list[Setting]:
    """The settings of an engine whose driver is `native/NAME.cpp`, built against a library that pkg-config knows."""
    version, program = built(name, library)
    return [
        Setting(engine, version, label, held, method, functools.partial(run, (str(program),), label, held))
        for label, held, method in rows
    ]


@functools.cache
def built(name: str, library: str) -> tuple[str, File]:
    """The version of a library and the driver built against it, from `benchmarks/build` if neither has changed."""
    tool, compiler = _program("pkg-config"), _program("g++")

    def query(*options: str) -> str:
        process = subprocess.run([tool, *options, library], capture_output=True, text=True, check=False)
        if process.returncode:
            raise OSError(f"pkg-config knows no {library} on this machine")
        return process.stdout.strip()

    version, source = query("--modversion"), HERE / "native" / f"{name}.cpp"
    options = [*FLAGS, *query("--cflags").split()], query("--libs").split()
    digest = hashlib.sha256(f"{options} {version}".encode())
    for file in (source, HERE / "native" / "top.h"):
        digest.update(file.read_bytes())
    target = BUILD / f"engine-{library}-{digest.hexdigest()[:16]}"
    if not target.is_file():
        BUILD.mkdir(exist_ok=True)
        partial = target.with_suffix(".part")
        command = [compiler, *options[0], "-w", "-o", str(partial), str(source), *options[1]]
        process = subprocess.run(command, capture_output=True, text=True, check=False)
        if process.returncode:
            raise OSError(f"its driver does not compile against {library} {version}: {process.stderr.strip()[:150]}")
        partial.replace(target)
    return version, target
