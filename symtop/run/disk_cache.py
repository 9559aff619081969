"""A dataset that is in a file of the cache, or is computed and put there.

A file is named after what its numbers are made of, and holds a hash of its values, so that a damaged one is noticed,
said and computed again. Files that nobody used for 30 days are removed, and those used longest ago beyond `MOST_BYTES`
of a folder.
"""

import functools
import hashlib
import itertools
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import xarray as xr

from symtop.core import code_hash, netcdf
from symtop.core.errors import SymtopError, SymtopWarning
from symtop.core.files import cache_root, prune, touch

MOST_BYTES = 500_000_000  # of a folder; a reference at 1000 times takes 200 kB
OFTEN = 50  # files that a process writes between two looks at the size of the folder
_written = itertools.count()


COMPILED = tuple(code_hash.PACKAGE / "core" / name for name in ("jit.py", "sines.py"))  # without importing numba


@functools.lru_cache(maxsize=8)
def _sources(maker: Callable[..., Any]) -> str:
    """Hash of the code that a function reaches, and of the libraries."""
    code = code_hash.Code().reasons("reference", maker, COMPILED)
    return code_hash.digest(code | code_hash.packages("numpy", "heyoka", "mpmath"))


def place(maker: Callable[..., Any], *key: object, data: bytes = b"") -> Path:
    """The file of a result, of the function that makes it and of what it is made from."""
    name = hashlib.sha256(repr([_sources(maker), *key]).encode() + data).hexdigest()[:32]
    return cache_root() / "reference" / f"{name}.nc"


def cached(path: Path, compute: Callable[[], xr.Dataset], depth: int | None) -> xr.Dataset:
    """The dataset in a file, or the one that `compute` returns, which is then written to it.

    Warnings point `depth` calls up, 1 being this function; with None there are none, because nobody asked for a file.
    """
    if path.is_file():
        try:
            data = netcdf.read(path)
            if data.attrs.pop("content", "") == netcdf.content_hash(data):
                touch(path)
                return data
        except SymtopError:
            pass
        if depth is not None:
            sentence = f"the cached reference {path.name} is damaged and is computed again"
            warnings.warn(sentence, SymtopWarning, stacklevel=depth)
    data = compute()
    try:
        netcdf.write(data.assign_attrs(content=netcdf.content_hash(data)), path)
        if next(_written) % OFTEN == 0:
            prune(path.parent, MOST_BYTES)
    except SymtopError as error:
        if depth is not None:
            warnings.warn(f"the reference is not kept: {error}", SymtopWarning, stacklevel=depth)
    return data
