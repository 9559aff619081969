"""Compilation of kernels with numba, with a disk cache that never serves stale numbers.

numba stamps a cached kernel with the file of the function itself and does not see edits in the files it
calls, so an old kernel can return old numbers in silence. The cache folder is therefore named after a hash of
every source file of this package that a kernel may come from, and of the file that a plug-in kernel comes from.
A kernel found on disk loads in a few milliseconds; a cold one compiles in about half a second.
"""

import contextlib
import functools
import hashlib
import inspect
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

from numba import config, njit
from numba.cpython.unsafe.tuple import tuple_setitem
from numba.extending import register_jitable as _register

__all__ = ["cache_root", "compile_kernel", "register_jitable", "set_item", "source_digest"]

set_item: Any = tuple_setitem  # in a kernel: set_item(tuple, i, value) is a new tuple

PACKAGE = Path(__file__).resolve().parent.parent
MOST_NEIGHBOURS = 100
WITHOUT_KERNELS = ("runner", "report", "cli")  # a new caption need not compile anything again
KEPT = 6  # cache folders of older sources that are kept, a few megabytes each


def cache_root() -> Path:
    """The folder for everything symtop caches: ``$SYMTOP_CACHE`` or ``symtop`` in the user's cache folder."""
    chosen = os.environ.get("SYMTOP_CACHE")
    if chosen:
        return Path(chosen)
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "symtop"


@functools.lru_cache(maxsize=1)
def source_digest() -> str:
    """Hash of the package's sources, 16 hexadecimal digits."""
    digest = hashlib.sha256()
    for path in sorted(PACKAGE.rglob("*.py")):
        place = path.relative_to(PACKAGE)
        if place.parts[0] in WITHOUT_KERNELS:
            continue
        digest.update(str(place).encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _folder(sources: set[Path]) -> Path:
    foreign = sorted(path for path in sources if PACKAGE not in path.parents)
    name = source_digest()
    if foreign:
        digest = hashlib.sha256(name.encode())
        for path in foreign:  # and what stands beside it, which it may import
            for near in sorted(path.parent.glob("*.py"))[:MOST_NEIGHBOURS]:
                digest.update(near.read_bytes())
        name = digest.hexdigest()[:16]
    return cache_root() / "kernels" / name


def _prune(keep: Path) -> None:
    """Remove the caches of long-gone sources; another process may be doing the same."""
    try:
        folders = sorted(keep.parent.iterdir(), key=lambda path: path.stat().st_mtime, reverse=True)
    except OSError:
        return
    for folder in folders[KEPT:]:
        if folder != keep:
            shutil.rmtree(folder, ignore_errors=True)


def register_jitable(function: Callable[..., Any]) -> Any:
    """Let kernels call a plain function, inlined wherever they do.

    Left to itself LLVM keeps the larger ones, such as the drift of a splitting, as calls that pass their results
    through memory: 1.3 times the time of a step.
    """
    return _register(forceinline=True)(function)


def _forgiving(kernel: Any) -> Any:
    """A kernel for which a cache on a full disk, or a damaged one, costs a compilation and not the run."""
    cache = kernel._cache
    load, save = cache.load_overload, cache.save_overload

    def attempt_load(*arguments: Any) -> Any:
        try:
            return load(*arguments)
        except Exception:  # noqa: BLE001  (a truncated pickle raises nearly anything)
            with contextlib.suppress(Exception):
                cache.flush()  # begin anew: what is damaged would stand in the way of saving, too
            return None

    def attempt_save(*arguments: Any) -> None:
        with contextlib.suppress(OSError):
            save(*arguments)

    cache.load_overload, cache.save_overload = attempt_load, attempt_save
    return kernel


def compile_kernel(function: Callable[..., Any], *parts: Callable[..., Any]) -> Any:
    """``njit`` with the disk cache; `parts` are the functions that `function` closes over.

    Division by zero gives infinity, as in C: the kernel's outcome says what became of it.
    Functions typed at a prompt have no source file to stamp: they compile without the cache.
    """
    sources: set[Path] = set()
    for part in parts:
        try:
            sources.add(Path(inspect.getfile(part)).resolve())
        except (TypeError, OSError):
            return njit(error_model="numpy")(function)
    if not all(path.is_file() for path in sources):
        return njit(error_model="numpy")(function)
    folder = _folder(sources)
    before = config.CACHE_DIR
    if not folder.is_dir():
        _prune(folder)
    try:
        config.CACHE_DIR = str(folder)  # numba reads it while it decorates, so nobody else's cache moves
        return _forgiving(njit(cache=True, error_model="numpy")(function))
    except RuntimeError:  # the cache folder cannot be written: slower, never wrong
        return njit(error_model="numpy")(function)
    finally:
        config.CACHE_DIR = before
