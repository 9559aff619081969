"""Labelled datasets: names and units of variables, provenance, and files that are whole or absent.

Conventions are CF-1.11 where it applies. Only maps of bytes are compressed: round-off does not compress. No time stamps
inside, so that equal inputs give equal bytes.
"""

import functools
import importlib.metadata
import json
import os
import platform
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import xarray as xr

from symtop import __version__
from symtop.checks import SymtopError

# name: (long name, units)
VARIABLES: dict[str, tuple[str, str]] = {
    "time": ("elapsed time", "s"),
    "theta": ("nutation angle", "rad"),
    "phi": ("precession angle, unwrapped", "rad"),
    "psi": ("spin angle, unwrapped", "rad"),
    "axis": ("unit vector along the axis of the top, space frame", "1"),
    "quaternion": ("attitude, body to space, (w, x, y, z)", "1"),
    "energy": ("total energy", "kg m2 s-2"),
    "p_theta": ("momentum conjugate to theta", "kg m2 s-1"),
    "p_phi": ("momentum conjugate to phi, recomputed from the trajectory", "kg m2 s-1"),
    "p_psi": ("momentum conjugate to psi, recomputed from the trajectory", "kg m2 s-1"),
}

_DEPENDENCIES = ("numpy", "scipy", "numba", "heyoka", "xarray", "netCDF4", "matplotlib", "mpmath")


def _git(*words: str) -> str:
    root = Path(__file__).resolve().parent.parent
    if not (root / ".git").exists():
        return ""
    try:
        done = subprocess.run(  # noqa: S603
            ["git", "-C", str(root), *words],  # noqa: S607
            capture_output=True,
            text=True,
            timeout=10,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""


def _processor() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


@functools.lru_cache(maxsize=1)
def _provenance() -> tuple[tuple[str, str], ...]:
    versions = {}
    for package in _DEPENDENCIES:
        try:
            versions[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            versions[package] = "absent"
    revision = _git("rev-parse", "--short=12", "HEAD") or "unknown"
    dirty = bool(_git("status", "--porcelain", "--", "symtop", "studies"))
    return (
        ("symtop_version", __version__),
        ("symtop_revision", revision + ("+changes" if dirty else "")),
        ("python_version", platform.python_version()),
        ("dependencies", json.dumps(versions, sort_keys=True)),
        ("platform", f"{platform.system()} {platform.machine()}"),
        ("processor", _processor()),
    )


def provenance() -> dict[str, str]:
    """What made a dataset: versions, revision, machine. Flat strings, as netCDF wants them."""
    return dict(_provenance())


def describe(data: xr.Dataset, title: str, **attributes: Any) -> xr.Dataset:
    """Give the variables their names and units and the dataset its provenance and attributes."""
    for name, (long_name, units) in VARIABLES.items():
        if name in data.variables:
            data[name].attrs.update(long_name=long_name, units=units)
    plain = {key: _plain(value) for key, value in attributes.items()}
    data.attrs.update({"Conventions": "CF-1.11", "title": title, "source": "symtop", **plain, **provenance()})
    return data


def _plain(value: Any) -> Any:
    """Attributes of netCDF files are strings, numbers or lists of them."""
    if isinstance(value, (str, int, float)) and not isinstance(value, bool):
        return value
    return json.dumps(value, sort_keys=True, default=str)


def write(data: xr.Dataset, path: str | os.PathLike[str]) -> Path:
    """Write a netCDF file so that it is whole or not there, whatever happens meanwhile."""
    target = Path(path)
    temporary = ""
    try:
        if target.is_dir():
            msg = f"cannot write {target}: it is a folder"
            raise SymtopError(msg)
        target.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(prefix=f".{target.name}.", suffix=".part", dir=target.parent)
        os.close(handle)
        encoding: dict[Any, dict[str, Any]] = {
            name: {"_FillValue": None} for name in data.coords if data[name].dtype.kind == "f"
        }
        encoding |= {name: {"zlib": True} for name, values in data.data_vars.items() if values.dtype.kind == "u"}
        data.to_netcdf(temporary, engine="netcdf4", encoding=encoding)
        with open(temporary, "rb") as written:  # noqa: PTH123
            os.fsync(written.fileno())
        Path(temporary).chmod(0o644)
        Path(temporary).replace(target)
    except OSError as error:
        msg = f"cannot write {target}: {error.strerror or error}"
        raise SymtopError(msg) from error
    finally:
        if temporary:
            Path(temporary).unlink(missing_ok=True)
    return target


def read(path: str | os.PathLike[str]) -> xr.Dataset:
    """Load a netCDF file completely into memory and close it."""
    try:
        with xr.open_dataset(path, engine="netcdf4") as data:
            return data.load()
    except (OSError, ValueError, RuntimeError) as error:
        msg = f"cannot read {path} as netCDF: {error}"
        raise SymtopError(msg) from error
