"""An ensemble that goes to a netCDF file chunk by chunk, and is resumed after it was killed.

Each chunk is kept in a file of its own, whole or absent, in the folder ``PATH.parts``, beside a file that says which
ensemble it is of. When all are there they are put together, one after another, into the netCDF file, which replaces
`PATH` in one move; then they are removed, and what says whose they are last. The bytes of the file do not hang on how
often the work was interrupted. While it is put together it takes its size twice. One process at a time may do so: it
holds the lock ``.PATH.lock``. Nothing is removed or replaced that symtop did not write.
"""

import contextlib
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import xarray as xr

from symtop.core import netcdf
from symtop.core.code_hash import digest, hashed, packages
from symtop.core.errors import SymtopError, check_replaceable
from symtop.core.files import locked
from symtop.core.jit import code
from symtop.core.signals import ending_on_sigterm
from symtop.run.ensemble.chunks import CHUNK, CHUNK_STEPS, Job, as_dataset, same_times

IDENTITY = "identity"  # the file that says which ensemble a folder belongs to


@contextlib.contextmanager
def streaming(path: Path, job: Job, labels: dict[str, Any], words: dict[str, Any]) -> Iterator["Stream"]:
    """The stream to a file, while nobody else has one; SymtopError if another process does."""
    check_replaceable(path)
    with locked(_folder(path), wait=False) as ours:
        if not ours:
            raise SymtopError(f"another process is writing {path}: wait until it has ended, or name another path")
        yield Stream(path, job, labels, words)


def _folder(path: Path) -> Path:
    """Where the chunks of a file are."""
    return path.with_name(f"{path.name}.parts")


class Stream:
    """The file of an ensemble, and what is on disk of it so far."""

    def __init__(self, path: Path, job: Job, labels: dict[str, Any], words: dict[str, Any]) -> None:
        self.path, self.n, self.samples, self.labels, self.words = path, len(job.numbers), job.samples, labels, words
        self.folder = _folder(path)
        identity, told = _identity(job, labels), self.folder / IDENTITY
        if self.folder.exists() and not told.is_file() and _holds(self.folder):
            raise SymtopError(
                f"{self.folder} is there and does not say which ensemble it is of: remove it or name another path than "
                f"{path}"
            )
        netcdf.sweep(path)
        if told.is_file() and told.read_text(encoding="utf-8") != identity:
            raise SymtopError(
                f"{self.folder} holds the beginning of another ensemble, or of another version's; remove it or name "
                f"another path than {path}"
            )
        with netcdf.replacing(told) as partial:
            partial.write_text(identity, encoding="utf-8")

    def missing(self, chunks: list[slice]) -> list[slice]:
        """The chunks that are not on disk."""
        return [chunk for chunk in chunks if not self._part(chunk).is_file()]

    def keep(self, chunk: slice, columns: dict[str, Any]) -> None:
        """Put a chunk on disk."""
        with ending_on_sigterm(), netcdf.replacing(self._part(chunk), ".npz") as partial:
            np.savez(partial, **columns)

    def finish(self, chunks: list[slice]) -> xr.Dataset:
        """Put the chunks together; the dataset reads from the file what it is asked for."""
        with self._writing(), netcdf.alone(), netcdf.replacing(self.path) as partial:
            first = self._columns(chunks[0])
            times = first["time"][0]
            shared = all(same_times(self._columns(chunk, "time")["time"], times) for chunk in chunks)
            size = chunks[0].stop
            labels = {name: values[:size] for name, values in self.labels.items()}
            pattern = netcdf.describe(as_dataset(first, labels, shared=shared), **self.words)
            with contextlib.closing(netCDF4.Dataset(partial, "w")) as file:
                _lay_out(file, pattern, self.n)
                for chunk in chunks:
                    columns = self._columns(chunk) | {name: values[chunk] for name, values in self.labels.items()}
                    if shared:
                        del columns["time"]
                    for name, values in columns.items():
                        file[name][chunk] = values.astype(object) if values.dtype.kind == "U" else values
        self.forget(chunks)
        return xr.open_dataset(self.path, engine="netcdf4")

    def forget(self, chunks: list[slice]) -> None:
        """Remove the chunks, what says whose they are last."""
        for kept in (*(self._part(chunk) for chunk in chunks), self.folder / IDENTITY):
            kept.unlink(missing_ok=True)
        with contextlib.suppress(OSError):  # something of somebody else's is in it
            self.folder.rmdir()

    @contextlib.contextmanager
    def _writing(self) -> Iterator[None]:
        """The netCDF library has an error of its own for a disk that is full."""
        try:
            yield
        except RuntimeError as error:
            raise SymtopError(
                f"cannot write {self.path}: {error}; is the disk full? What was computed is in {self.folder}, and the "
                "same call goes on from there"
            ) from error

    def _part(self, chunk: slice) -> Path:
        return self.folder / f"{chunk.start}-{chunk.stop}.npz"

    def _columns(self, chunk: slice, *names: str) -> dict[str, Any]:
        """The columns of a chunk, or some of them."""
        path = self._part(chunk)
        try:
            with path.open("rb") as file, np.load(file) as held:
                return {name: held[name] for name in names or held.files}
        except FileNotFoundError as error:
            raise SymtopError(
                f"{path} is not there any more, so somebody has removed it: run the same again, and it is computed"
            ) from error
        except (OSError, ValueError, zipfile.BadZipFile) as error:
            raise SymtopError(f"{path} is damaged ({error}): remove it, and it is computed again") from error


def _holds(folder: Path) -> bool:
    """Is anything in a folder, or is it a file?"""
    return not folder.is_dir() or any(folder.iterdir())


def _lay_out(file: Any, pattern: xr.Dataset, n: int) -> None:
    """Dimensions, variables, attributes and coordinates of the file, from a dataset of its first members."""
    file.set_fill_off()
    for name, size in pattern.sizes.items():
        file.createDimension(name, n if name == "member" else size)
    variables, attributes = xr.conventions.encode_dataset_coordinates(pattern)
    for name, variable in variables.items():
        values = variable.values
        kind = str if values.dtype.kind == "U" else "i1" if values.dtype.kind == "b" else values.dtype
        made = file.createVariable(name, kind, variable.dims, contiguous=kind is not str)
        made.setncatts(variable.attrs | ({"dtype": "bool"} if values.dtype.kind == "b" else {}))
        if "member" not in variable.dims:
            made[:] = values.astype(object) if kind is str else values
    file.setncatts(attributes)


def _identity(job: Job, labels: dict[str, Any]) -> str:
    """A hash of all that decides the bytes of the file: code, and what it is given."""
    arrays = job.numbers, job.horizon, job.steps, job.tolerance
    limits = job.chart, job.samples, job.budget, job.shown, CHUNK, CHUNK_STEPS
    return digest({
        **code().reasons("integrator", job.method, Job), **packages(),
        "numbers": hashed(*(netcdf.array_hash(values) for values in (*arrays, *labels.values()))),
        "limits": hashed(repr(limits)),
    })  # fmt: skip
