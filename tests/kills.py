"""kill -9 at random moments of `symtop study`, and the same command again until it is through.

python -m tests.kills --all --quick        30 kills over one pass of every study; some four times as long as a pass
"""

import contextlib
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import xarray as xr
from tqdm import tqdm

from symtop.core import netcdf
from symtop.measure.datasets import differences
from symtop.runner import run as runner, store
from tests.commands import leftovers, stdout_of, symtop

PATIENCE = 2400.0  # seconds for an undisturbed run


class Survived(NamedTuple):
    """What so many kills have cost."""

    kills: int
    lost: int  # cases that were begun when a kill came
    most_lost: int  # by one kill
    rounds: int  # times that the command was through


def survive(words: list[object], folder: Path, longest: float, kills: int = 30, seed: int = 9) -> Survived:
    """Kill a study's command `kills` times, each at most `longest` seconds after it has begun a case.

    Half of the time the parent alone is killed and half of the time its workers with it. Nothing that was done may be
    done again, a kill may cost each of two workers one case, and whenever the command is through its datasets must be
    those of an undisturbed run, measured times aside. A command that is through early is begun anew.
    """
    draw, results, calm = random.Random(seed), folder / "r", folder / "calm"
    for script in (str(word) for word in words if str(word).endswith(".py")):
        runner.load(script)  # from here on it is known by its name
    command = ["study", *words, "--jobs", 2, "--results"]
    stdout_of(symtop(*command, calm), PATIENCE)
    count = lost = most_lost = rounds = 0
    bar = tqdm(total=kills, desc="kills", disable=None)  # on a terminal
    cases_before: dict[Path, tuple[int, int]] = {}  # finished cases: the identity of their file and when it was written
    while count < kills:
        before, start = _locks(results), time.time()
        process = symtop(*command, results, PROBE_PAUSE=0.2)
        if draw.random() < 0.9:  # the others come while it is still starting
            while process.poll() is None and not _locks(results) - before:
                time.sleep(0.02)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(draw.uniform(0.0, longest))
        if process.returncode is None:
            (os.kill if draw.random() < 0.5 else os.killpg)(process.pid, signal.SIGKILL)
            count += 1
            bar.update()
        _, errors = process.communicate()
        assert process.returncode in (0, -signal.SIGKILL), errors
        time.sleep(1.5)  # workers whose parent was killed have ended by then
        files = {path: path.stat() for path in results.rglob("cases/*/*.npz")}
        cases = {path: (stat.st_ino, stat.st_mtime_ns) for path, stat in files.items()}
        assert cases_before.items() <= cases.items()  # not one was written a second time
        cost = sum(lock.stat().st_mtime >= start for lock in _locks(results))
        assert cost <= 2  # what a kill costs: one case a worker
        lost, most_lost, cases_before = lost + cost, max(most_lost, cost), cases
        if process.returncode == 0:
            assert_same(results, calm)
            rounds += 1
            shutil.rmtree(results)
            cases_before = {}
    bar.close()
    stdout_of(symtop(*command, results), PATIENCE)
    assert_same(results, calm)
    assert not leftovers(results)
    return Survived(count, lost, most_lost, rounds + 1)


def _locks(results: Path) -> set[Path]:
    """The locks of cases; a study that is being concluded, beside the cases of the next, has one in another folder."""
    return set(results.rglob("cases/*/.*.lock"))


def assert_same(results: Path, calm: Path) -> None:
    """All cases and datasets of both folders are the same but for measured times, and for what is chosen by them."""
    paths = sorted(path.relative_to(results) for path in results.rglob("*.nc"))
    assert paths == sorted(path.relative_to(calm) for path in calm.rglob("*.nc"))
    differing = {}
    for path in paths:
        study, files = runner.load(path.stem), [folder / path for folder in (results, calm)]
        cases = study.cases("quick" in path.parts)
        fixed = [case for case in cases if not case.timed]  # a price is a time, and a second round may follow from it
        for case in fixed:
            ours, theirs = (store.load_case(store.case_path(file.parent, study, case)) for file in files)
            assert ours is not None, case
            assert theirs is not None, case
            differing[f"{study.name}: {case.label}"] = differences(ours, theirs)
        groups = {case.group for case in fixed} - {case.group for case in cases if case.timed}
        differing[str(path)] = differences(*(_of_groups(file, groups) for file in files))
    assert not any(differing.values()), {name: errors for name, errors in differing.items() if errors}


def _of_groups(path: Path, groups: set[str]) -> xr.Dataset | xr.DataTree:
    """A dataset; of a tree the groups of these names."""
    data = netcdf.read_any(path)
    return data if isinstance(data, xr.Dataset) else data.drop_nodes(data.children.keys() - groups)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as place:
        print(survive(list(sys.argv[1:]), Path(place), 10.0))
