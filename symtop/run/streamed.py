"""An ensemble that goes to a netCDF file piece by piece, and is resumed after it was killed.

Each piece is kept in a file of its own, whole or absent, in the folder ``PATH.parts``. When all are there they are put
together, one after another, into the netCDF file, which replaces `PATH` in one move; then the folder is removed. The
bytes of the file do not hang on how often the work was interrupted. While it is put together it takes its size twice.
"""

import contextlib
import shutil
import zipfile
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import xarray as xr

from symtop.base import datasets
from symtop.base.fingerprint import digest, file_reasons, hashed, packages
from symtop.base.signals import ending_on_sigterm
from symtop.base.validate import SymtopError
from symtop.base.walk import Walk
from symtop.run.columns import as_dataset
from symtop.run.pieces import PIECE, PIECE_STEPS, Job

IDENTITY = "identity"  # the file that says which ensemble a folder belongs to


class Stream:
    """The file of an ensemble, and what is on disk of it so far."""

    def __init__(self, path: Path, job: Job, labels: dict[str, Any], words: dict[str, Any]) -> None:
        self.path, self.n, self.samples, self.labels, self.words = path, len(job.numbers), job.samples, labels, words
        if path.is_dir():
            raise SymtopError(f"cannot write {path}: it is a folder")
        self.folder = path.with_name(f"{path.name}.parts")
        identity, told = _identity(job, labels), self.folder / IDENTITY
        if told.is_file() and told.read_text(encoding="utf-8") != identity:
            raise SymtopError(
                f"{self.folder} holds the beginning of another ensemble, or of another version's; remove it or name "
                f"another path than {path}"
            )
        with datasets.replacing(told) as partial:
            partial.write_text(identity, encoding="utf-8")

    def missing(self, pieces: list[slice]) -> list[slice]:
        """The pieces that are not on disk."""
        return [piece for piece in pieces if not self._part(piece).is_file()]

    def keep(self, piece: slice, columns: dict[str, Any]) -> None:
        """Put a piece on disk."""
        with ending_on_sigterm(), datasets.replacing(self._part(piece), ".npz") as partial:
            np.savez(partial, **columns)

    def finish(self, pieces: list[slice]) -> xr.Dataset:
        """Put the pieces together; the dataset reads from the file what it is asked for."""
        with datasets.alone(), datasets.replacing(self.path) as partial:
            first = self._columns(pieces[0])
            times = first["time"][0]
            shared = all((self._columns(piece, "time")["time"] == times).all() for piece in pieces)
            size = pieces[0].stop
            labels = {name: values[:size] for name, values in self.labels.items()}
            pattern = datasets.describe(as_dataset(first, labels, shared=shared), **self.words)
            with contextlib.closing(netCDF4.Dataset(partial, "w")) as file:
                _lay_out(file, pattern, self.n)
                for piece in pieces:
                    columns = self._columns(piece) | {name: values[piece] for name, values in self.labels.items()}
                    if shared:
                        del columns["time"]
                    for name, values in columns.items():
                        file[name][piece] = values.astype(object) if values.dtype.kind == "U" else values
        shutil.rmtree(self.folder)
        return xr.open_dataset(self.path, engine="netcdf4")

    def _part(self, piece: slice) -> Path:
        return self.folder / f"{piece.start}-{piece.stop}.npz"

    def _columns(self, piece: slice, *names: str) -> dict[str, Any]:
        """The columns of a piece, or some of them."""
        path = self._part(piece)
        try:
            with path.open("rb") as file, np.load(file) as held:
                return {name: held[name] for name in names or held.files}
        except (OSError, ValueError, zipfile.BadZipFile) as error:
            raise SymtopError(f"{path} is damaged ({error}): remove it, and it is computed again") from error


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
    """A hash of all that decides the bytes of the file: code by its files, as in studies, and what it is given."""
    made = Walk("integrator")
    made.add((job.method, Job))
    arrays = job.numbers, job.horizon, job.steps, job.tolerance
    limits = job.chart, job.samples, job.budget, job.shown, PIECE, PIECE_STEPS
    return digest({
        **made.values(), **file_reasons(made.closure()), **packages(),
        "numbers": hashed(*(datasets.array_hash(values) for values in (*arrays, *labels.values()))),
        "limits": hashed(repr(limits)),
    })  # fmt: skip
