"""Labelled datasets: names and units of variables, provenance, and files that are written completely or not at all.

Conventions are CF-1.11 where it applies. Only unsigned integers and single-precision numbers, which a study has
rounded, are compressed: digits of round-off do not compress. Without time stamps, equal inputs give equal bytes.
"""

import contextlib
import functools
import hashlib
import json
import os
import platform
import shutil
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
import xarray as xr

from symtop.core import __version__
from symtop.core.code_hash import NUMERICS, processor, version
from symtop.core.errors import SymtopError, words_of
from symtop.core.files import replacing
from symtop.core.signals import deferred

one_thread = threading.RLock()  # two threads inside the netCDF library at once end the process (segmentation fault)


class Column(NamedTuple):
    """A line of a table of variables."""

    entry: tuple[str, ...]  # long name, units in SI, and if they differ those of a dimensionless problem
    flags: dict[int, str]  # the meaning of each value of an integer variable


def read_columns(file: Path | None) -> dict[str, Column]:
    """The table in a file, as `symtop.measure.columns` describes it, empty without one; SymtopError for a wrong one."""
    table: dict[str, Column] = {}
    lines = [] if file is None else file.read_text(encoding="utf-8").splitlines()
    for index, line in enumerate(lines[1:], 2):
        name, *cells = line.split("\t")
        units, unitless, flags, long_name = cells if len(cells) == 4 else [""] * 4
        pairs = [flag.split() for flag in flags.split(",") if flag]
        if not (name and long_name and all(len(pair) == 2 and pair[0].isdigit() for pair in pairs)) or name in table:
            form = "a variable that no other line has, its units, those without units, flags, and its long name"
            raise SymtopError(f"{file}: line {index} must be {form}, between tabs, not {line!r}")
        entry = (long_name, *filter(None, (units, unitless)))
        table[name] = Column(entry, {int(number): word for number, word in pairs})
    return table


VARIABLES = {name: column.entry for name, column in read_columns(Path(__file__).with_name("variables.tsv")).items()}
CONVENTIONS = {"Conventions": "CF-1.11", "source": "symtop", "history": f"made by symtop {__version__}"}

Tree = TypeVar("Tree", bound=xr.Dataset | xr.DataTree)

LITTLE_SPACE = 1_000_000  # bytes: with less free space a write error is reported as a full disk
ROOT = Path(__file__).resolve().parents[2]


def _git(*arguments: str) -> str:
    """The output of a git command on symtop's own checkout; empty if there is none, or no git."""
    command = ["git", "-C", str(ROOT), *arguments]
    with contextlib.suppress(OSError, subprocess.SubprocessError):
        if (ROOT / ".git").exists():  # git would use the repository of a folder above
            return subprocess.run(command, capture_output=True, text=True, timeout=10, check=True).stdout.strip()  # noqa: S603
    return ""


@functools.cache
def provenance(*, changes: bool = False) -> dict[str, str]:
    """Versions, revision and machine, flat strings as netCDF needs; `changes` marks code that is not committed."""
    dirty = changes and _git("status", "--porcelain", "--", "symtop", "studies")
    return {
        "symtop_version": __version__,
        "symtop_revision": (_git("rev-parse", "HEAD")[:12] or "unknown") + ("+changes" if dirty else ""),
        "python_version": platform.python_version(),
        "dependencies": json.dumps({name: version(name) for name in (*NUMERICS, "matplotlib")}, sort_keys=True),
        "platform": f"{platform.system()} {platform.machine()}",
        "processor": processor(),
    }


def groups(data: xr.Dataset | xr.DataTree) -> dict[str, xr.Dataset]:
    """The datasets of a tree by their paths in it, "" for its root; a dataset counts as a root without children."""
    if isinstance(data, xr.Dataset):
        return {"": data}
    return {node.path.strip("/"): node.to_dataset(inherit=False) for node in data.subtree}


@functools.cache
def variable_attributes(name: str, units: str) -> dict[str, str]:
    """The long name and units of a variable, or of its low half, NAME_lo; nothing for a name symtop does not know."""
    base = name.removesuffix("_lo")
    attrs = label(VARIABLES[base], units) if base in VARIABLES else {}
    return attrs | {"long_name": f"{attrs['long_name']}, low half"} if attrs and base != name else attrs


def label(entry: tuple[str, ...], units: str, elsewhere: str = "") -> dict[str, str]:
    """Attributes from an entry of `VARIABLES`; `elsewhere` is added to the long name if the units are not the SI's."""
    long_name, *choice = entry
    if units == "SI" or len(set(choice)) < 2:
        elsewhere = ""
    return {"long_name": long_name + elsewhere} | ({"units": choice[0 if units == "SI" else -1]} if choice else {})


def describe(data: Tree, title: str, units: str = "", **attributes: Any) -> Tree:
    """Label the variables without a long name; give the dataset, or the tree's root, provenance and attributes.

    `units` is that of the scene: "SI", or empty for a dimensionless problem, where all but angles have the unit "1".
    Variables that were labelled as those of a dimensionless problem get the units of the scene.
    """
    for group in groups(data).values():
        for name, variable in group.variables.items():  # ``group[name]`` would make a DataArray
            if "long_name" not in variable.attrs or variable.attrs == variable_attributes(str(name), ""):
                variable.attrs.update(variable_attributes(str(name), units))
    data.attrs.update(attributes_of(title, **attributes))
    return data


def attributes_of(title: str, **attributes: Any) -> dict[str, Any]:
    """The attributes of a dataset: conventions, title, those given, as text or numbers of 64 bits, and provenance."""
    plain: dict[str, Any] = {}
    for key, value in attributes.items():  # a plug-in's solver may count steps in NumPy's types
        number = int(value) if isinstance(value, np.integer) else value
        number = float(value) if isinstance(value, np.floating) else number
        is_plain = isinstance(number, (str, float)) or (type(number) is int and abs(number) < 2**63)
        plain[key] = number if is_plain else json.dumps(number, sort_keys=True, default=str)
    return {**CONVENTIONS, "title": title, **plain, **provenance()}


def write_text(path: Path, text: str) -> None:
    """Replace a small text file in one move."""
    with replacing(path) as partial:
        partial.write_text(text, encoding="utf-8")


def write_json(path: Path, content: Any) -> None:
    """Replace a JSON file in one move."""
    plain = lambda value: value.tolist() if isinstance(value, (np.generic, np.ndarray)) else str(value)
    write_text(path, json.dumps(content, indent=1, ensure_ascii=False, default=plain) + "\n")


def read_json(path: Path) -> Any:
    """The content of a JSON file, or None if there is none or it is damaged."""
    with contextlib.suppress(OSError, ValueError):
        return json.loads(path.read_text(encoding="utf-8"))
    return None


def _encoding(data: xr.Dataset) -> dict[Any, dict[str, Any]]:
    bare = {name: {"_FillValue": None} for name in data.coords if data[name].dtype.kind == "f"}
    kinds = {name: variable.dtype for name, variable in data.data_vars.items()}
    rounded = [name for name, kind in kinds.items() if kind.kind == "u" or kind == np.float32]
    return bare | {name: {"zlib": True} for name in rounded}


def write(data: xr.Dataset | xr.DataTree, path: str | os.PathLike[str]) -> Path:
    """Write a netCDF file that is complete or absent, whatever happens meanwhile; a tree becomes netCDF groups.

    In a worker of dask, xarray asks the scheduler for a lock first, and waits for ever if the scheduler has ended. Each
    writer here has a temporary file of its own, so that no lock is needed.
    """
    encoding: Any = {f"/{name}": _encoding(group) for name, group in groups(data).items()}
    with deferred(), replacing(path) as partial, contextlib.ExitStack() as stack:
        if "distributed" in sys.modules:
            import dask

            stack.enter_context(dask.config.set(scheduler="threads"))
        try:
            with one_thread:
                options = encoding if isinstance(data, xr.DataTree) else encoding["/"]
                data.to_netcdf(partial, engine="netcdf4", encoding=options)
        except RuntimeError as error:  # the netCDF library's error for a full disk, among others
            full = shutil.disk_usage(partial.parent).free < LITTLE_SPACE
            raise OSError(None, f"no room is left in {partial.parent}" if full else str(error)) from error
    return Path(path)


def array_hash(values: Any) -> str:
    """Hash of an array of numbers or of text: its type, shape and bytes."""
    row = np.ascontiguousarray(values)
    digest = hashlib.sha256(f"{row.dtype}{row.shape}".encode())
    digest.update(repr(row.tolist()).encode() if row.dtype == object else row.reshape(-1).view(np.uint8).data)
    return digest.hexdigest()


def content_hash(data: xr.Dataset) -> str:
    """Hash of all values and their dimensions, by which a damaged or foreign file is recognised."""
    digest = hashlib.sha256()
    for name in sorted(str(name) for name in data.variables):
        values = np.ascontiguousarray(data.variables[name].values)
        digest.update(f"{name}{data.variables[name].dims}{values.shape}".encode())
        text = values.dtype.kind in "OUT"  # counts by its characters, however it is stored
        digest.update("\0".join(map(str, values.ravel())).encode() if text else values.dtype.kind.encode())
        digest.update(b"" if text else values.tobytes())
    return digest.hexdigest()


@contextlib.contextmanager
def _netcdf(path: str | os.PathLike[str]) -> Iterator[None]:
    """Hold the netCDF library's lock; any error in the block becomes a SymtopError that names the file."""
    try:
        with deferred(), one_thread:
            yield
    except Exception as error:  # (a damaged file: HDF5's errors, and those of names and times that make no sense)
        raise SymtopError(f"cannot read {path} as netCDF: {words_of(error)}") from error


def read(path: str | os.PathLike[str]) -> xr.Dataset:
    """Load a netCDF file completely into memory and close it."""
    with _netcdf(path), xr.open_dataset(path, engine="netcdf4") as data:
        return data.load().drop_encoding()  # an encoding keeps the longest text's length: longer ones would be cut


def read_any(path: str | os.PathLike[str]) -> xr.Dataset | xr.DataTree:
    """Load a netCDF file completely into memory and close it: a tree if it has groups, otherwise a dataset.

    The library is given the bytes, not the path: where a program has opened a tree of a file lazily, with text in it,
    the next ``xr.open_datatree`` of the same path ends the process in HDF5 (xarray 2026.9, netCDF4 1.7.5).
    """
    import netCDF4

    with _netcdf(path), contextlib.closing(netCDF4.Dataset(path, memory=Path(path).read_bytes())) as file:
        datasets, queue = dict[str, xr.Dataset](), [file]
        for group in queue:
            datasets[group.path] = xr.open_dataset(xr.backends.NetCDF4DataStore(group)).load().drop_encoding()
            queue += group.groups.values()
    return xr.DataTree.from_dict(datasets) if len(datasets) > 1 else datasets["/"]
