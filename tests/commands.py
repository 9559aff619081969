"""The command line in processes of its own, on the probe study."""

import os
import subprocess
import sys
from pathlib import Path

import xarray as xr

from symtop.base import datasets

PROBE = Path(__file__).parent / "probe.py"


def symtop(*words: object, cwd: Path | None = None, **environment: object) -> subprocess.Popen:
    """Start a command; its output is read by `ended`."""
    return subprocess.Popen(
        [sys.executable, "-m", "symtop.cli", *map(str, words)],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=cwd,
        start_new_session=True,
        env={**os.environ, **{name: str(value) for name, value in environment.items()}},
    )


def ended(process: subprocess.Popen, seconds: float = 240.0) -> tuple[int, str, str]:
    """Exit code, output and errors of a command; none of them may hold a traceback or a leak."""
    out, err = process.communicate(timeout=seconds)
    assert "Traceback" not in out + err, err
    assert "leaked" not in err, err
    return process.returncode, out, err


def contents(results: Path) -> dict[str, xr.Dataset]:
    """Every dataset of a results folder by its place in it, without its attributes of provenance."""
    found = {}
    for path in sorted(results.rglob("*.nc")):
        data = datasets.read(path)
        found[str(path.relative_to(results))] = data.drop_attrs().assign_attrs(
            {key: value for key, value in data.attrs.items() if key not in datasets.provenance()}
        )
    return found


def leftovers(results: Path) -> list[str]:
    """Partial files, locks and traces."""
    return [str(path.relative_to(results)) for path in results.rglob(".*") if path.is_file()]
