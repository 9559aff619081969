"""Compilation of kernels with numba, with a disk cache that never serves stale numbers.

numba stamps a cached kernel with the file of the function itself and does not see edits in the files it calls, so that
an old kernel can return old numbers in silence; and it compiles again what only moved down by a line. Here the folder
of a kernel is named after a hash of everything it is compiled from (`symtop.core.code_hash`): instructions, constants
and values of its functions, wherever they stand, and the versions of Python and numba. The first time a process saves a
kernel it removes those that nobody used for 30 days, and the oldest ones beyond `MOST_BYTES`.

Beside it stands `fused`, a b + c with one rounding, which numba lacks. A number on the grid of its last place plus a
correction that hardly changes from step to step is rounded the same way every time, a bias of up to half a unit in the
last place; the exact product has random digits below that grid, and added before the rounding they remove the bias.
"""

import contextlib
import functools
import gc
import hashlib
import pickle
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FunctionType
from typing import Any

import numba
from numba import njit, types
from numba.core.caching import CompileResultCacheImpl, FunctionCache, IndexDataCacheFile
from numba.core.codegen import JITCodeLibrary, JITCPUCodegen
from numba.core.compiler import CompileResult
from numba.core.compiler_lock import global_compiler_lock
from numba.core.typing.templates import builtin_registry
from numba.cpython.unsafe.tuple import tuple_setitem
from numba.extending import intrinsic, overload, register_jitable as _register
from numba.np.unsafe.ndarray import to_fixed_tuple

from symtop.core.code_hash import Code, Part, by_file, by_name, digest, hashed
from symtop.core.errors import SymtopError
from symtop.core.files import cache_root, is_trusted, locked, make_private, on_cold, prune, touch
from symtop.core.jit_functions import Function, fused, marked, two_product
from symtop.core.sines import polynomials, sincos

__all__ = [
    "by_length", "code_of", "compile_kernel", "fused", "is_cached", "register_jitable", "set_item", "to_fixed_tuple",
]  # fmt: skip

set_item: Any = tuple_setitem  # in a kernel: set_item(tuple, i, value) is a new tuple

MOST_BYTES = 200_000_000  # of kernels that are kept, about 2000 of them
OPTIONS = {"error_model": "numpy", "nogil": True}  # division by zero gives infinity, as in C; threads run at once
HASH = hashlib.sha256().digest_size  # bytes before the code in its file
NAMES = "by content"  # of kernels: those that were stored before may share one
WITHIN = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}  # kernels alone call it: 14 % less to compile
WRAPPERS = ("_ZN7cpython", "cfunc.")  # names of functions that Python and C can call
INLINED = {"forceinline": True, **WITHIN}

_stands_for: dict[int, list[object]] = {}  # id of a function: what numba compiles in its place
_registered: set[Callable[..., Any]] = set()
_known = [0]  # entries of numba's registry that `_stands_for` knows
_pruned: list[Path] = []

overload(sincos, jit_options=INLINED, strict=False)(lambda *_: polynomials)


@by_name
def register_jitable(function: Function, options: dict[str, Any] = INLINED) -> Function:
    """Let kernels call a plain function, inlined wherever they do: LLVM would keep the larger ones as calls.

    A function is registered once: numba would add another overload each time, and what a kernel is made of would hang
    on how many loops a process has built before.
    """
    if function not in _registered:
        _registered.add(function)
        _register(**options)(function)
    return function


@by_name
def by_length(*functions: tuple[int, Callable[..., Any]]) -> Callable[..., Any]:
    """A function (par, x, ...) that is one of several by the length of the tuple x, in Python and in kernels."""
    known = dict(functions)
    for function in known.values():
        register_jitable(function)

    def chosen(par: Any, x: Any, *rest: Any) -> Any:
        return known[len(x)](par, x, *rest)

    overload(chosen, jit_options=INLINED, strict=False)(lambda _par, x, *_rest: known[len(x)])
    return chosen


def _register_parts() -> None:
    """Register what modules without numba have marked so far."""
    for function, is_inlined in marked:
        register_jitable(function, INLINED if is_inlined else OPTIONS | WITHIN)


def _overloads(function: FunctionType) -> Iterator[object]:
    """What numba compiles where a function is called: the functions that overload it, and their options."""
    entries = builtin_registry.globals
    for value, kind in entries[_known[0] :]:
        if isinstance(value, FunctionType) and isinstance(kind, types.Function):
            _stands_for.setdefault(id(value), []).extend(kind.templates)
    _known[0] = len(entries)
    for template in _stands_for.get(id(function), ()):
        yield getattr(template, "_overload_func", None)
        yield getattr(template, "_jit_options", None)


def code_of(thing: object) -> list[Part]:
    """What a kernel, or anything that holds kernels, is compiled from; the same whatever a process has run before."""
    _register_parts()
    return Code(_overloads).reached("kernel", thing, OPTIONS, sys.version_info[:2], numba.__version__)


def code() -> Code:
    """What looks for code, as numba compiles it; a function counts alike before and after a kernel registers it."""
    return Code(lambda function: () if function in _registered else _overloads(function))


class _Folder:
    """Where a kernel is kept, as numba asks for it."""

    def __init__(self, path: Path, function: Callable[..., Any]) -> None:
        self.path, self._py_file = path, function.__code__.co_filename

    def ensure_cache_path(self) -> None:
        """Make the folder; the first one of a process makes room for it."""
        if not _pruned:
            _pruned.append(self.path)
            prune(self.path.parent, MOST_BYTES)
        make_private(self.path)


class _Index(IndexDataCacheFile):  # type: ignore[misc]
    """The index of a kernel and its files, each named after the signature whose code it holds.

    numba counts them: two processes that save at the same time give two signatures one file, and each gets the code of
    the other. And it runs what it finds, damaged bytes, too. Here the code follows its hash, and an index that cannot
    be read is empty. A pickle is a program: one that somebody else may have written is not read.
    """

    def save(self, key: Any, data: Any) -> None:
        """Write the code, then the index: a process that is killed in between leaves no name without a file."""
        name = f"code.{hashed(repr(key))}.nbc"
        self._save_data(name, data)
        self._save_index(self._load_index() | {key: name})

    def _load_index(self) -> dict[Any, str]:
        with contextlib.suppress(Exception):  # a damaged pickle raises nearly anything
            if is_trusted(Path(self._index_path)):
                return super()._load_index()  # type: ignore[no-any-return]
        return {}

    def _save_data(self, name: str, data: Any) -> None:
        code = self._dump(data)
        with self._open_for_write(self._data_path(name)) as file:
            file.write(hashlib.sha256(code).digest() + code)

    @contextlib.contextmanager
    def _open_for_write(self, filepath: str) -> Iterator[Any]:
        with super()._open_for_write(filepath) as file:
            Path(file.name).chmod(0o600)
            yield file

    def _load_data(self, name: str) -> Any:
        path = Path(self._data_path(name))
        if not is_trusted(path):
            raise ValueError("the code on disk may be somebody else's")
        whole = path.read_bytes()
        checksum, code = whole[:HASH], whole[HASH:]
        if hashlib.sha256(code).digest() != checksum:
            raise ValueError("the code on disk is damaged")
        return pickle.loads(code)  # noqa: S301  (it has its hash)


class _Cache(FunctionCache):  # type: ignore[misc]
    """numba's cache of one kernel in its folder; a full disk or a damaged cache costs a compilation and not the run."""

    def __init__(self, function: Callable[..., Any], folder: Path) -> None:
        self._name, self._py_func = repr(function), function
        self._impl = CompileResultCacheImpl.__new__(CompileResultCacheImpl)
        self._impl._locator = _Folder(folder, function)
        self._impl._lineno = function.__code__.co_firstlineno
        self._cache_path = str(folder)
        self._cache_file = _Index(self._cache_path, "code", "")
        self.enable()

    def _index_key(self, signature: Any, codegen: Any) -> Any:
        return signature, codegen.magic_tuple()

    def index(self) -> dict[Any, str]:
        """The file of the code of each signature."""
        return self._cache_file._load_index()

    def load_overload(self, signature: Any, target_context: Any) -> Any:
        try:
            loaded = super().load_overload(signature, target_context)
            if loaded is not None and tuple(loaded.signature.args) == tuple(signature):
                return loaded
            damaged = loaded is not None
        except Exception:  # noqa: BLE001  (a truncated pickle raises nearly anything)
            damaged = True
        for tell in on_cold:
            tell()
        with contextlib.suppress(Exception):
            if damaged:  # begin anew: it would stand in the way of saving, too
                self.flush()
        return None

    def save_overload(self, signature: Any, data: Any) -> None:
        with contextlib.suppress(OSError):
            super().save_overload(signature, data)


def _lean(kernel: Any, compiling: Callable[..., Any], signature: Any) -> Any:
    """Compile a kernel: what it calls is optimised and linked into it as ever, but gets no machine code of its own.

    numba makes that of each, and nobody runs it: Python and C call a function through a wrapper, which inner ones lack.
    Environments get addresses with the kernel's code. The caller holds numba's lock; other numbas compile as usual.
    """
    finish, set_env = getattr(JITCodeLibrary, "_finalize_final_module", None), getattr(JITCPUCodegen, "set_env", None)
    if finish is None or set_env is None or not hasattr(CompileResult, "_find_referenced_environments"):
        return compiling(signature)

    def link_only(library: Any) -> None:
        names = [function.name for function in library._final_module.functions if not function.is_declaration]
        if any(name.startswith(WRAPPERS) for name in names) or not any(name.startswith("_ZN") for name in names):
            finish(library)
            return
        library._finalize_dynamic_globals()
        library._verify_declare_only_symbols()
        library._finalized = True

    def set_where_defined(codegen: Any, name: str, environment: Any) -> None:
        if codegen._engine.is_symbol_defined(name):
            set_env(codegen, name, environment)

    try:
        JITCodeLibrary._finalize_final_module, JITCPUCodegen.set_env = link_only, set_where_defined
        entry = compiling(signature)
    finally:
        JITCodeLibrary._finalize_final_module, JITCPUCodegen.set_env = finish, set_env
    for result in kernel.overloads.values():
        for environment in result._find_referenced_environments():
            set_env(result.library.codegen, environment.env_name, environment)
    return entry


def _once(kernel: Any, compiling: Callable[..., Any]) -> Callable[..., Any]:
    """numba's compilation, of a kernel that is not on disk by one process at a time: the next ones load it.

    Python looks for no cyclic garbage meanwhile: numba's trees are none before the end, and grow to millions. It takes
    9 % less time, and 100 MB more for the largest kernel there is. numba's lock is taken first, as its own nested
    compilations take it first.
    """

    @functools.wraps(compiling)
    def compile_now(signature: Any) -> Any:
        with global_compiler_lock, contextlib.ExitStack() as stack:
            if gc.isenabled():
                stack.callback(gc.enable)
                gc.disable()
            if isinstance(kernel._cache, _Cache) and not is_cached(kernel, signature):
                with contextlib.suppress(SymtopError, OSError):  # a cache that cannot be written costs time and no run
                    make_private(Path(kernel._cache._cache_path))
                    stack.enter_context(locked(Path(kernel._cache._cache_path) / "code", wait=True))
            return _lean(kernel, compiling, signature)

    return compile_now


@by_name
def compile_kernel(function: Callable[..., Any]) -> Any:
    """``njit`` with the disk cache; division by zero gives infinity, as in C.

    A cache that somebody else may write is not used, with a warning (`is_trusted`).
    A kernel with functions typed at a prompt, which have no source file, compiles without the cache. The constructor of
    a NamedTuple has none either, but follows from the fields, which are part of what the kernel is made of.
    """
    _register_parts()
    parts = code_of(function)
    made_of = digest(by_file(parts) | {"names": NAMES})
    kernel = njit(**OPTIONS)(_named(function, made_of))
    kernel.compile = _once(kernel, kernel.compile)
    functions = (part.thing for part in parts if isinstance(part.thing, FunctionType))
    written = [part for part in functions if not part.__module__.startswith("namedtuple_")]
    if all(Path(part.__code__.co_filename).is_file() for part in written):
        folder = cache_root() / "kernels" / made_of
        if all(map(is_trusted, (cache_root(), folder.parent, folder))):
            touch(folder)
            kernel._cache = _Cache(function, folder)
    return kernel


def _named(function: Any, made_of: str) -> FunctionType:
    """The function under a name of its own: LLVM finds machine code by name, and numba counts names by process."""
    own = FunctionType(function.__code__, function.__globals__, function.__name__, function.__defaults__,
                       function.__closure__)  # fmt: skip
    own.__qualname__, own.__module__ = f"{function.__qualname__}_{made_of[:16]}", function.__module__
    return own


def is_cached(kernel: Any, signature: Any) -> bool:
    """Is a kernel compiled for this signature, in memory or in the cache?"""
    if signature in kernel.overloads:
        return True
    cache = kernel._cache
    return isinstance(cache, _Cache) and cache._index_key(signature, kernel.targetctx.codegen()) in cache.index()


@intrinsic
def _fma(typing, a, b, c):  # type: ignore[no-untyped-def]
    """LLVM's fma: one instruction where the processor has it, exact software where it has not."""

    def emit(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        return builder.fma(*arguments)

    return types.float64(types.float64, types.float64, types.float64), emit


@overload(fused, inline="always")
def _fused(a, b, c):  # type: ignore[no-untyped-def]
    if not all(isinstance(value, types.Float) for value in (a, b, c)):
        return None

    def once(a, b, c):  # type: ignore[no-untyped-def]
        return _fma(a, b, c)

    return once


@overload(two_product, inline="always")
def _two_product(a, b):  # type: ignore[no-untyped-def]
    def exactly(a, b):  # type: ignore[no-untyped-def]
        product = a * b
        return product, _fma(a, b, -product)

    return exactly
